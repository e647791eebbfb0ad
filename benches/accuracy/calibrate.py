#!/usr/bin/env python3
"""The table of tests/calibration.md from profiles that `hotspot-render calibrate` wrote; needs nothing else.

    python3 benches/accuracy/calibrate.py PROFILE.json...
"""

import json
import pathlib
import sys


def number(value):
    return "" if value is None else f"{value:.3f}"


def main():
    print("| scene | ns/path | R² two terms | + constant | all terms | ceiling | of the ceiling | NRMSE | pooled | unseen scene | drift |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    lowest = []
    for name in sys.argv[1:]:
        for scene in json.loads(pathlib.Path(name).read_text())["scenes"]:
            fits = {form: fit["held_out"] for form, fit in scene["fits"].items()}
            full = fits["full"]
            lowest.append((full["r2"], scene["scene"]))
            others = scene["from_other_scenes"].get("full", {})
            drift = max(abs(d - 1) for d in scene["drift"])
            cells = [
                scene["scene"],
                f"{scene['mean_ns']:.0f}",
                number(fits["two"]["r2"]),
                number(fits["two_constant"]["r2"]),
                number(full["r2"]),
                number(scene["repeat_r2"]),
                number(full["r2_of_repeat"]),
                f"{full['nrmse']:.1%}",
                number(scene["pooled"]["full"]["r2"]),
                number(others.get("r2")),
                f"{drift:.1%}",
            ]
            print("| " + " | ".join(cells) + " |")
    lowest.sort()
    print(f"\n{len(lowest)} scenes, {sum(r2 >= 0.95 for r2, _ in lowest)} at 0.95 or above; lowest: {lowest[:3]}")


if __name__ == "__main__":
    main()
