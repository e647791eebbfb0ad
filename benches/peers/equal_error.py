#!/usr/bin/env python3
"""hotspot-render against Mitsuba 3: error at equal spp, and seconds to equal error.

    pip install mitsuba numpy pillow
    export DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1     # Debian: libllvm19
    cargo build --release
    python benches/peers/equal_error.py --scenes DIR --references DIR --tool reference_render.py [--only NAME,…] [-o OUT.json]
    python benches/peers/equal_error.py --tabulate OUT.json …               # the tables of benches/EQUAL-ERROR.md

DIR holds NAME/NAME.gltf, and references NAME_WxH_SPP.exr with their halves (…_a.exr, …_b.exr). `reference_render.py` builds the
Mitsuba scene from the glTF with the same materials as ours. With Mitsuba 3.9.1 (Dr.Jit 1.5.0) LLVM 19 works, also on machines with
AVX-512; LLVM 15 crashes there, LLVM 16 aborts in code generation.

Both renderers: same resolution, same greatest path length, box filter, no denoiser, the same number of threads. Runs are
interleaved: for every seed, every spp, every configuration in turn, so that a machine that drifts does not favour one. Seconds are
those of sampling alone (Mitsuba: `mi.render` with its kernels compiled beforehand; ours: `render.seconds`); `process_seconds` is the
whole process of ours; `cpu` is user and system time (for ours of the whole process), which a busy machine disturbs less.

Configurations are names of `OURS`, or options of our command line (`roulette=8+adaptive`), or Mitsuba's: its sampler, and after a colon
the path segment from which its roulette acts, or `off` (`multijitter:off`). Ratios are taken against the Mitsuba configuration that
reaches the error first.

Error: relMSE = mean of (I − A)(I − B) / (R² + 0.01) over pixels and channels, A and B the halves of the reference R, which leaves
out the reference's own noise; `trimmed` leaves out the 0.1 % of pixels with the largest error. Medians over seeds are noisy where
fireflies decide, so the *mean* over seeds is reported (it is what relMSE estimates), with the standard error from the seeds.
Seconds to an error: log-log interpolation between the runs' means (extrapolated along the last segment, and marked, beyond them).
The ± of a ratio is its standard error by leaving out one seed at a time (of the logarithm, so in percent).
"""
import argparse, glob, importlib.util, json, math, os, subprocess, sys, tempfile, time
import numpy as np

SCENES = {  # greatest number of scattering events; spp to render; the two levels of error, untrimmed and trimmed
    'cornell-box-red': (64, [4, 16, 64, 256], ['4e-3', '4e-4'], ['3e-3', '3e-4']),
    'killeroo': (64, [4, 16, 64, 256], ['2e-2', '4e-3'], ['1e-2', '2e-3']),
    'living-room-matte': (64, [4, 16, 64, 256], ['2e-1', '5e-2'], ['1e-1', '3e-2']),
    'living-room-substrate': (64, [4, 16, 64, 256], ['2e-1', '5e-2'], ['1e-1', '3e-2']),
    'veach-mis': (64, [4, 16, 64, 256], ['1e-1', '3e-2'], ['1e-1', '3e-2']),
}
# Ours: options of the command line. `paper` is what the program does by default.
OURS = {
    'paper': [],
    'independent': ['--sampler', 'independent'],
    'learned': ['--lights', 'learned'],
    'adaptive': ['--adaptive'],
    'best': ['--adaptive', '--lights', 'learned'],
}


def load(mi, path):
    bitmap = mi.Bitmap(path)
    names = [field.name for field in bitmap.struct_()]
    return np.array(bitmap, dtype=np.float64)[..., [names.index(c) for c in 'RGB']]


def errors(image, reference):
    a, b = reference
    r = 0.5 * (a + b)
    e = ((image - a) * (image - b) / (r * r + 0.01)).mean(-1).ravel()
    # The worst pixels by their plain error, so that noise of the reference does not choose them.
    plain = ((image - r) ** 2 / (r * r + 0.01)).mean(-1).ravel()
    keep = np.argsort(plain)[: int(len(plain) * 0.999)]
    return {'relmse': e.mean(), 'trimmed': e[keep].mean()}


class Mitsuba:
    def __init__(self, mi, tool, path, size, depth, rr_depth, sampler):
        self.mi = mi
        w, h = size
        doc = tool.Doc(path)
        builder = tool.Builder(mi, doc)
        sensor = builder.sensor(w, h)
        sensor['sampler'] = {'type': sampler, 'sample_count': 16}
        d = {'type': 'scene', 'sensor': sensor, 'integrator': {'type': 'path', 'max_depth': depth + 1, 'rr_depth': rr_depth}}
        meshes, _ = builder.meshes()
        d.update(meshes)
        env = doc.j['scenes'][doc.j.get('scene', 0)].get('extras', {}).get('environment', {}).get('constant')
        if env and max(env) > 0:
            d['env'] = {'type': 'constant', 'radiance': {'type': 'rgb', 'value': env}}
        self.scene = mi.load_dict(d)
        self.pixels = w * h
        self.ready = set()

    def run(self, spp, seed):
        if spp not in self.ready:  # compiles
            np.array(self.mi.render(self.scene, spp=spp, seed=9999))
            self.ready.add(spp)
        start, cpu = time.perf_counter(), time.process_time()
        image = np.array(self.mi.render(self.scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]
        return image, {'seconds': time.perf_counter() - start, 'cpu': time.process_time() - cpu}


class Ours:
    def __init__(self, mi, binary, path, size, depth, threads, options):
        self.mi = mi
        self.command = [binary, path, '--size', f'{size[0]}x{size[1]}', '--max-depth', str(depth), '--threads', str(threads),
                        '--metrics', 'none', '--quiet', *options]
        self.stem = os.path.splitext(os.path.basename(path))[0]

    def run(self, spp, seed):
        with tempfile.TemporaryDirectory() as out:
            cpu = lambda: sum(os.times()[2:4])  # of children
            start, before = time.perf_counter(), cpu()
            subprocess.run([*self.command, '--spp', str(spp), '--seed', str(seed), '-o', out], check=True)
            took = {'process_seconds': time.perf_counter() - start, 'cpu': cpu() - before}
            took['seconds'] = json.load(open(f'{out}/{self.stem}.json'))['render']['seconds']
            return load(self.mi, f'{out}/{self.stem}.exr'), took


def seconds_to(points, error):
    """points: [(seconds, error)] by rising spp. Returns seconds and whether they lie beyond the runs."""
    points = [(s, e) for s, e in points if e > 0]
    if len(points) < 2:
        return None, True
    logs = [(math.log(s), math.log(e)) for s, e in points]
    target = math.log(error)
    k = next((i for i in range(len(logs) - 1) if logs[i + 1][1] <= target), len(logs) - 2)
    (s0, e0), (s1, e1) = logs[k], logs[k + 1]
    beyond = not (min(e0, e1) <= target <= max(e0, e1))
    return (math.exp(s0 + (s1 - s0) * (target - e0) / (e1 - e0)) if e1 != e0 else None), beyond


def means(runs, leave_out=None):
    """One row per spp of the mean errors with their standard errors and the median times."""
    rows = []
    for n, all_seeds in runs.items():
        r = [x for k, x in enumerate(all_seeds) if k != leave_out]
        row = {'spp': int(n)}
        for key in ('seconds', 'cpu', 'process_seconds'):
            row[key] = float(np.median([x.get(key, math.nan) for x in r]))
        for key in ('relmse', 'trimmed'):
            row[key] = float(np.mean([x[key] for x in r]))
            row[key + '_se'] = float(np.std([x[key] for x in r], ddof=1) / math.sqrt(len(r))) if len(r) > 1 else math.nan
        rows.append(row)
    return rows


def slope(points):
    x, y = np.log([s for s, e in points if e > 0]), np.log([e for s, e in points if e > 0])
    return float(np.polyfit(x, y, 1)[0]) if len(x) > 1 else None


def is_mitsuba(config):
    return config.split(':')[0] in ('multijitter', 'mi-independent')


def time_to(runs, metric, target, clock, leave_out=None):
    return seconds_to([(r[clock], r[metric]) for r in means(runs, leave_out)], target)


def ratios(scene, metric, targets, clock):
    """{config: [(ratio to the best Mitsuba, its relative standard error, beyond the runs, seconds, the best Mitsuba) per target]}."""
    out = {}
    configs = scene['configs']
    peers = [c for c in configs if is_mitsuba(c)]
    for c in configs:
        out[c] = []
        for target in map(float, targets):
            seconds, beyond = time_to(configs[c]['seeds'], metric, target, clock)
            best = min(peers, key=lambda p: time_to(configs[p]['seeds'], metric, target, clock)[0] or math.inf, default=None)
            if best is None or not seconds:
                out[c].append((math.nan, math.nan, beyond, seconds or math.nan, best))
                continue
            peer, peer_beyond = time_to(configs[best]['seeds'], metric, target, clock)
            seeds = len(next(iter(configs[c]['seeds'].values())))
            left = [math.log((time_to(configs[best]['seeds'], metric, target, clock, k)[0] or math.nan)
                             / (time_to(configs[c]['seeds'], metric, target, clock, k)[0] or math.nan)) for k in range(seeds)] if seeds > 1 else []
            error = math.sqrt((seeds - 1) / seeds * sum((x - np.mean(left)) ** 2 for x in left)) if left else math.nan
            out[c].append((peer / seconds, error, beyond or peer_beyond, seconds, best))
    return out


def show(name, scene, clock):
    """The tables of one scene in Markdown."""
    w, h = scene['size']
    configs = scene['configs']
    spps = [r['spp'] for r in means(next(iter(configs.values()))['seeds'])]
    print(f"\n### {name}: {w}x{h}, {scene['depth']} bounces, {scene['threads']} threads, {scene['seed_count']} seeds\n")
    print('| | Msamples/s | relMSE at ' + ' / '.join(map(str, spps)) + ' spp | trimmed | slope | trimmed |')
    print('|---|---|---|---|---|---|')
    for c, e in configs.items():
        rows = means(e['seeds'])
        speed = w * h * rows[-1]['spp'] / rows[-1][clock] / 1e6
        cell = lambda key: ' / '.join(f"{r[key]:.2e}" for r in rows)
        slopes = [slope([(r['spp'], r[key]) for r in rows]) or math.nan for key in ('relmse', 'trimmed')]
        print(f"| {c} | {speed:.2f} | {cell('relmse')} | {cell('trimmed')} | {slopes[0]:.2f} | {slopes[1]:.2f} |")
    print()
    head = [f'relMSE {t}' for t in scene['levels']['relmse']] + [f'trimmed {t}' for t in scene['levels']['trimmed']]
    print('| seconds (times faster than the best Mitsuba) | ' + ' | '.join(head) + ' |')
    print('|---|' + '---|' * len(head))
    found = [ratios(scene, m, scene['levels'][m], clock) for m in ('relmse', 'trimmed')]
    for c in configs:
        cells = [f"{s:.3g}{'*' if beyond else ''}" + ('' if is_mitsuba(c) and best == c else f' ({r:.2f} ± {100 * e:.0f} %)')
                 for f in found for r, e, beyond, s, best in f[c]]
        print(f'| {c} | ' + ' | '.join(cells) + ' |', flush=True)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument('--scenes')
    ap.add_argument('--references')
    ap.add_argument('--tool', help='path of reference_render.py')
    ap.add_argument('--hotspot', default=os.path.join(os.path.dirname(__file__), '../../target/release/hotspot-render'))
    ap.add_argument('--only', help='scenes, by name')
    ap.add_argument('--configs', default='paper,best,multijitter,multijitter:off', help=f'of {", ".join(OURS)}, or see above')
    ap.add_argument('--spp', help='instead of the spp of each scene')
    ap.add_argument('--seeds', type=int, default=5)
    ap.add_argument('--first-seed', type=int, default=1)
    ap.add_argument('--time-limit', type=float, help='seconds after which no further seed is begun that would go beyond')
    ap.add_argument('--threads', type=int, default=2)
    ap.add_argument('--errors', help='levels in place of those of each scene')
    ap.add_argument('--clock', default='seconds', choices=['seconds', 'cpu'], help='what is divided: wall-clock seconds, or CPU time')
    ap.add_argument('--tabulate', nargs='+', metavar='OUT.json', help='no runs: the tables of earlier ones')
    ap.add_argument('-o', '--out')
    a = ap.parse_args()
    if a.tabulate:
        for file in a.tabulate:
            for name, scene in json.load(open(file)).items():
                if a.errors:
                    scene['levels'] = dict.fromkeys(('relmse', 'trimmed'), a.errors.split(','))
                show(name, scene, a.clock)
        return
    if not (a.scenes and a.references and a.tool):
        ap.error('--scenes, --references and --tool are needed')
    started = time.monotonic()
    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    import drjit as dr
    dr.set_thread_count(a.threads)
    spec = importlib.util.spec_from_file_location('reference_render', a.tool)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    tool.define_bsdfs(mi, dr)
    report = {}
    for name in a.only.split(',') if a.only else SCENES:
        depth, spps, *levels = SCENES[name]
        if a.errors:
            levels = [a.errors.split(',')] * 2
        if a.spp:
            spps = [int(x) for x in a.spp.split(',')]
        whole = [p for p in glob.glob(f'{a.references}/{name}_*.exr')
                 if not p.endswith(('_a.exr', '_b.exr')) and '_depth' not in p and '_direct' not in p]
        if not whole:
            sys.exit(f'no reference {name}_WxH_SPP.exr in {a.references}')
        stem = whole[0][:-4]
        size = tuple(int(x) for x in stem.split('_')[-2].split('x'))
        reference = [load(mi, f'{stem}_{half}.exr') for half in 'ab']
        path = f'{a.scenes}/{name}/{name}.gltf'
        engines = {}
        for c in a.configs.split(','):
            if is_mitsuba(c):
                sampler, _, roulette = c.removeprefix('mi-').partition(':')
                engines[c] = Mitsuba(mi, tool, path, size, depth, depth + 1 if roulette == 'off' else int(roulette or 5), sampler)
            else:
                engines[c] = Ours(mi, a.hotspot, path, size, depth, a.threads, OURS[c] if c in OURS else [f'--{option}' for option in c.split('+')])
        runs = {c: {n: [] for n in spps} for c in engines}
        scene = report[name] = {'size': size, 'depth': depth, 'threads': a.threads, 'seed_count': 0,
                                'levels': dict(zip(('relmse', 'trimmed'), levels)), 'configs': {c: {'seeds': runs[c]} for c in runs}}
        longest = 0
        for seed in range(a.first_seed, a.first_seed + a.seeds):
            if a.time_limit and time.monotonic() + longest > started + a.time_limit:
                break
            begun = time.monotonic()
            for n in spps:
                for c in engines:
                    image, took = engines[c].run(n, seed)
                    runs[c][n].append({**took, **errors(image, reference)})
            scene['seed_count'] += 1
            longest = max(longest, time.monotonic() - begun)
            if a.out:
                with open(a.out, 'w') as f:
                    json.dump(report, f, indent=1)
        if scene['seed_count']:
            show(name, scene, a.clock)


if __name__ == '__main__':
    main()
