#!/usr/bin/env python3
"""Do the intervals of `whatif` cover the saving that long renders show?

For each case: one whatif of many samples (another seed) as the truth, then one of 16 samples for each of several seeds, with
the intervals of sampling alone, and three with tree noise. Needs a built hotspot-render and nothing else. Writes a table.

    python3 benches/accuracy/whatif.py target/release/hotspot-render --seeds 20 [--shared DIR]
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile

SCENES = pathlib.Path(__file__).resolve().parents[2] / "scenes"
CASES = [
    ("mirror-gap-narrow", "160x90", ["--roughness", "Mirror glass=0.5"]),
    ("mirror-gap-narrow", "160x90", ["--delete", "Potted plant"]),
    ("cornell-box-red", "128x128", ["--delete", "Short box"]),
    ("white-room-substrate", "160x90", ["--matte", "Table top lacquer"]),
    ("creature", "160x90", ["--delete", "Creature behind"]),
]
SHARED = [
    ("living-room-substrate", "128x72", ["--matte", "Floor"]),
    ("living-room-substrate", "128x72", ["--max-depth", "7"]),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--long", type=int, default=1024, help="samples per pixel of the truth")
    parser.add_argument("--shared", type=pathlib.Path, help="folder of further scenes")
    args = parser.parse_args()
    folder = tempfile.mkdtemp()

    def change(path, edit, size, spp, seed, trees):
        words = ["--size", size, "--spp", str(spp), "--seed", str(seed), "--repeats", "0", "--tree-noise", str(trees)]
        subprocess.run([args.program, "whatif", str(path), *edit, *words, "-o", folder, "--quiet"], check=True)
        document = json.loads(pathlib.Path(folder, f"{path.stem}.whatif.json").read_text())
        total = document["totals"]["intersection"]
        low, high = total["ci95"]
        return total["relative"], 0.5 * (high - low)

    cases = [(SCENES / name / f"{name}.gltf", size, edit) for name, size, edit in CASES]
    if args.shared:
        cases += [(args.shared / name / f"{name}.gltf", size, edit) for name, size, edit in SHARED]
    print("| scene | change | true | 16 spp: mean, spread | half width | covers | half width with trees | covers |")
    print("|---|---|---|---|---|---|---|---|")
    for path, size, edit in cases:
        true, own = change(path, edit, size, args.long, 9999, 0)
        short = [change(path, edit, size, 16, seed, 0) for seed in range(1, args.seeds + 1)]
        trees = [change(path, edit, size, 16, seed, 4) for seed in range(1, 4)]
        values = [value for value, _ in short]
        covers = [sum(abs(value - true) <= half for value, half in rows) for rows in (short, trees)]
        print(
            f"| {path.stem} | {' '.join(edit)} | {true:+.3%} ± {own:.3%} | {statistics.mean(values):+.3%},"
            f" {statistics.stdev(values):.3%} | {statistics.mean(half for _, half in short):.3%} |"
            f" {covers[0]} of {len(short)} | {statistics.mean(half for _, half in trees):.2%} | {covers[1]} of {len(trees)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
