#!/usr/bin/env python3
"""How hotspot-render and Mitsuba 3 gain from threads: samples per second at 1, 2, 4, … threads, in turns in one run.

    python benches/peers/threads.py --scenes DIR --tool reference_render.py [--only NAME,…] [--rounds N] [-o OUT.json]

What it needs: see `equal_error.py`. Efficiency is t(1) / (n t(n)), the median over rounds of the ratio within a round; the ± is the
median absolute deviation of the rounds. Threads are hardware threads, of which two may share a core. Mitsuba has a process for each
number of threads: Dr.Jit 1.5.0 hangs when the number changes between renders.
"""
import argparse, importlib.util, json, multiprocessing, os, statistics, sys
from equal_error import Mitsuba, Ours, SCENES


def worker(pipe, threads, tool_path, path, size, depth):
    """Renders with Mitsuba whatever (spp, seed) it is sent, and answers with seconds."""
    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    import drjit as dr
    dr.set_thread_count(threads)
    spec = importlib.util.spec_from_file_location('reference_render', tool_path)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    tool.define_bsdfs(mi, dr)
    mitsuba = Mitsuba(mi, tool, path, size, depth, 5, 'multijitter')
    for spp, seed in iter(pipe.recv, None):
        pipe.send(mitsuba.run(spp, seed)[1]['seconds'])


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument('--scenes', required=True)
    ap.add_argument('--tool', required=True, help='path of reference_render.py')
    ap.add_argument('--hotspot', default=os.path.join(os.path.dirname(__file__), '../../target/release/hotspot-render'))
    ap.add_argument('--only', default='cornell-box-red,killeroo,living-room-matte,veach-mis')
    ap.add_argument('--edge', type=int, default=256, help='of the square picture')
    ap.add_argument('--spp', type=int, default=36, help="a square for Mitsuba's multijitter")
    ap.add_argument('--rounds', type=int, default=5)
    ap.add_argument('-o', '--out')
    a = ap.parse_args()
    import mitsuba as mi
    mi.set_variant('scalar_rgb')
    spawn = multiprocessing.get_context('spawn')
    most = len(os.sched_getaffinity(0))
    counts = sorted({1, most, *(n for n in (2, 4, 8, 16, 32, 64) if n < most)})
    size = (a.edge, a.edge)
    report = []
    print('| scene | renderer | ' + ' | '.join(f'Msamples/s, {n} thread{"s" * (n > 1)}' for n in counts) + ' | efficiency at most |')
    print('|---|---|' + '---|' * (len(counts) + 1))
    for name in a.only.split(','):
        depth = SCENES[name][0]
        path = f'{a.scenes}/{name}/{name}.gltf'
        workers = {}
        for n in counts:
            here, there = spawn.Pipe()
            process = spawn.Process(target=worker, args=(there, n, a.tool, path, size, depth), daemon=True)
            process.start()
            there.close()
            workers[n] = process, here
        seconds = {'hotspot-render': {n: [] for n in counts}, 'Mitsuba llvm': {n: [] for n in counts}}
        for k in range(a.rounds):
            for n in counts if k % 2 == 0 else counts[::-1]:
                seconds['hotspot-render'][n].append(Ours(mi, a.hotspot, path, size, depth, n, []).run(a.spp, k)[1]['seconds'])
                process, pipe = workers[n]
                pipe.send((a.spp, k))
                if not pipe.poll(300):
                    sys.exit(f'Mitsuba with {n} threads does not answer')
                seconds['Mitsuba llvm'][n].append(pipe.recv())
        for process, pipe in workers.values():
            pipe.send(None)
            process.join()
        for renderer, s in seconds.items():
            speeds = [a.edge * a.edge * a.spp / statistics.median(s[n]) / 1e6 for n in counts]
            efficiency = [one / (most * many) for one, many in zip(s[1], s[most])]
            middle = statistics.median(efficiency)
            spread = statistics.median(abs(x - middle) for x in efficiency)
            print(f'| {name} | {renderer} | ' + ' | '.join(f'{x:.2f}' for x in speeds) + f' | {middle:.2f} ± {spread:.2f} |', flush=True)
            report.append({'scene': name, 'renderer': renderer, 'threads': counts, 'seconds': [s[n] for n in counts], 'efficiency': middle})
    if a.out:
        with open(a.out, 'w') as f:
            json.dump(report, f, indent=1)


if __name__ == '__main__':
    main()
