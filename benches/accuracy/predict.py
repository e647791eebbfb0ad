#!/usr/bin/env python3
"""How well does `predict` say what a render takes and counts?

Predictions and renders take turns, each pair with a seed of its own, on a machine that should do nothing else. Needs a built
hotspot-render and nothing else. Writes a table; figures of seconds belong to the machine.

With --again each render is made twice in a row. How far the second is from the first is the ceiling: what the best of all
predictions, the very same work done a moment before, says about a render on this machine. Processor time is compared beside
the wall clock, to see whether threads that had to wait for a processor are what makes the difference.

    python3 benches/accuracy/predict.py target/release/hotspot-render --seconds 200 [--pilot 2]
"""

import argparse
import json
import pathlib
import resource
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
    parser.add_argument("--again", action="store_true", help="render twice and tell how far the second is from the first")
    args = parser.parse_args()
    folder = tempfile.mkdtemp()
    rows = {name: [] for name, _, _ in CASES}
    repeats = {name: [] for name, _, _ in CASES}
    start, seed = time.monotonic(), args.first_seed
    while time.monotonic() - start < args.seconds:
        for name, size, spp in CASES:
            words = [str(SCENES / name / f"{name}.gltf"), "--size", size, "--spp", str(spp * args.times), "--seed", str(seed)]
            words += ["-o", folder, "--quiet"]
            subprocess.run([args.program, "predict", *words, "--pilot", str(args.pilot)], check=True)
            predicted = json.loads(pathlib.Path(folder, f"{name}.predict.json").read_text())
            (rendered, wall, processor), *more = [render(args.program, words, folder, name) for _ in range(1 + args.again)]
            rows[name].append((predicted, rendered, wall))
            for again, _, processor_again in more:
                repeats[name].append(
                    (again["render"]["seconds"] / rendered["render"]["seconds"] - 1, processor_again / processor - 1)
                )
        seed += 1
    if args.raw:
        keep = {name: [[p, {"render": r["render"], "totals": r["totals"]}, wall] for p, r, wall in runs] for name, runs in rows.items()}
        keep["again"] = repeats
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
    if args.again:
        print("\n| scene | repeats | second against first: mean of sizes | within 5 % | by processor time | within 5 % |")
        print("|---|---|---|---|---|---|")
        everything = [pair for pairs in repeats.values() for pair in pairs]
        for name, pairs in [*repeats.items(), ("all", everything)]:
            cells = [name, str(len(pairs))]
            for clock in (0, 1):
                sizes = [abs(pair[clock]) for pair in pairs]
                within = sum(size <= 0.05 for size in sizes)
                cells += [f"{statistics.mean(sizes):.1%}", f"{within} ({within / len(sizes):.0%})"]
            print("| " + " | ".join(cells) + " |")


def render(program, words, folder, name):
    """The render's document, its seconds from start to end, and its processor time."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([program, "render", *words], check=True)
    wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    document = json.loads(pathlib.Path(folder, f"{name}.json").read_text())
    return document, wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
