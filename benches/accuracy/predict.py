#!/usr/bin/env python3
"""How well does `predict` say what a render takes and counts?

Predictions and renders take turns, each pair with a seed of its own, on a machine that should do nothing else. Needs a built
hotspot-render and nothing else. Writes a table; figures of seconds belong to the machine.

    python3 benches/accuracy/predict.py target/release/hotspot-render --seconds 200 [--pilot 2]
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

SCENES = pathlib.Path(__file__).resolve().parents[2] / "scenes"
CASES = [("cornell-box-red", "256x256", 32), ("creature", "320x180", 32), ("white-room-substrate", "320x180", 24)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--seconds", type=float, default=200.0, help="begin no further round after so many")
    parser.add_argument("--pilot", type=float, default=4.0)
    parser.add_argument("--times", type=int, default=1, help="so many times the samples per pixel: longer renders")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--raw", help="also write what was read, pair by pair, into this JSON file")
    args = parser.parse_args()
    folder = tempfile.mkdtemp()
    rows = {name: [] for name, _, _ in CASES}
    start, seed = time.monotonic(), args.first_seed
    while time.monotonic() - start < args.seconds:
        for name, size, spp in CASES:
            words = [str(SCENES / name / f"{name}.gltf"), "--size", size, "--spp", str(spp * args.times), "--seed", str(seed)]
            words += ["-o", folder, "--quiet"]
            subprocess.run([args.program, "predict", *words, "--pilot", str(args.pilot)], check=True)
            begin = time.monotonic()
            subprocess.run([args.program, "render", *words], check=True)
            wall = time.monotonic() - begin
            predicted = json.loads(pathlib.Path(folder, f"{name}.predict.json").read_text())
            rendered = json.loads(pathlib.Path(folder, f"{name}.json").read_text())
            rows[name].append((predicted, rendered, wall))
        seed += 1
    if args.raw:
        keep = {name: [[p, {"render": r["render"], "totals": r["totals"]}, wall] for p, r, wall in runs] for name, runs in rows.items()}
        pathlib.Path(args.raw).write_text(json.dumps(keep))
    print("| scene | runs | seconds | error: mean, mean of sizes, median of sizes | within 5 % | covers | half width "
          "| start to end | counts cover | error of counts |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, runs in rows.items():
        seconds = [(p["seconds"]["render"], r["render"]["seconds"]) for p, r, _ in runs]
        errors = [p["value"] / r - 1 for p, r in seconds]
        sizes = [abs(error) for error in errors]
        covers = sum(p["ci95"][0] <= r <= p["ci95"][1] for p, r in seconds)
        half = statistics.mean(0.5 * (p["ci95"][1] - p["ci95"][0]) / p["value"] for p, _ in seconds)
        whole = [p["seconds"]["total"]["value"] / wall - 1 for p, _, wall in runs]
        counts = [
            (p["totals"][metric], r["totals"][metric]["sum"])
            for p, r, _ in runs
            for metric in ("rays", "nodes", "shapes", "bsdf")
        ]
        counted = sum(p["ci95"][0] <= sum_ <= p["ci95"][1] for p, sum_ in counts)
        off = statistics.mean(abs(p["value"] / sum_ - 1) for p, sum_ in counts)
        print(
            f"| {name} | {len(runs)} | {statistics.median(r for _, r in seconds):.2f} | {statistics.mean(errors):+.1%},"
            f" {statistics.mean(sizes):.1%}, {statistics.median(sizes):.1%} | {sum(size <= 0.05 for size in sizes)} | {covers} |"
            f" {half:.1%} | {statistics.median(whole):+.1%} | {counted} of {len(counts)} | {off:.2%} |"
        )


if __name__ == "__main__":
    main()
