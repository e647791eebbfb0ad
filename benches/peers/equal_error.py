#!/usr/bin/env python3
"""hotspot-render against Mitsuba 3: error at equal spp, and seconds to equal error.

    pip install mitsuba numpy pillow            # Mitsuba's llvm variants also want a libLLVM (DRJIT_LIBLLVM_PATH)
    cargo build --release
    python benches/peers/equal_error.py --scenes DIR --references DIR --tool reference_render.py [--only NAME,…] [-o OUT.json]

DIR holds NAME/NAME.gltf, and references NAME_WxH_SPP.exr with their halves (…_a.exr, …_b.exr). `reference_render.py` builds the
Mitsuba scene from the glTF with the same materials as ours.

Both renderers: same resolution, same greatest path length, box filter, no denoiser, the same number of threads, and roulette as
each has it by default. Runs are interleaved: for every seed, every spp, every configuration in turn, so that a machine that drifts
does not favour one. Seconds are those of sampling alone (Mitsuba: `mi.render` with its kernels compiled beforehand; ours:
`render.seconds`); `process_seconds` is the whole process of ours.

Error: relMSE = mean of (I − A)(I − B) / (R² + 0.01) over pixels and channels, A and B the halves of the reference R, which leaves
out the reference's own noise; `trimmed` leaves out the 0.1 % of pixels with the largest error. Medians over seeds are noisy where
fireflies decide, so the *mean* over seeds is reported (it is what relMSE estimates), with the standard error from the seeds.
Seconds to an error: log-log interpolation between the runs' means (extrapolated along the last segment, and marked, beyond them).
"""
import argparse, glob, importlib.util, json, math, os, subprocess, sys, tempfile, time
import numpy as np

SCENES = {  # greatest number of scattering events; spp to render
    'cornell-box-red': (64, [4, 16, 64, 256]),
    'killeroo': (64, [4, 16, 64, 256]),
    'living-room-matte': (64, [4, 16, 64, 256]),
    'living-room-substrate': (64, [4, 16, 64, 256]),
    'veach-mis': (64, [4, 16, 64, 256]),
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

    def run(self, spp, seed, warm=True):
        # One wavefront holds at most 2^26 samples of these sizes: split so that memory stays bounded, at equal seeds never.
        if spp not in self.ready and warm:
            np.array(self.mi.render(self.scene, spp=spp, seed=9999))
            self.ready.add(spp)
        start = time.perf_counter()
        image = np.array(self.mi.render(self.scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]
        return image, time.perf_counter() - start, None


class Ours:
    def __init__(self, mi, binary, path, size, depth, threads, options):
        self.mi = mi
        self.command = [binary, path, '--size', f'{size[0]}x{size[1]}', '--max-depth', str(depth), '--threads', str(threads),
                        '--metrics', 'none', '--quiet', *options]
        self.stem = os.path.splitext(os.path.basename(path))[0]

    def run(self, spp, seed):
        with tempfile.TemporaryDirectory() as out:
            start = time.perf_counter()
            subprocess.run([*self.command, '--spp', str(spp), '--seed', str(seed), '-o', out], check=True)
            whole = time.perf_counter() - start
            seconds = json.load(open(f'{out}/{self.stem}.json'))['render']['seconds']
            return load(self.mi, f'{out}/{self.stem}.exr'), seconds, whole


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


def slope(points):
    x, y = np.log([s for s, e in points if e > 0]), np.log([e for s, e in points if e > 0])
    return float(np.polyfit(x, y, 1)[0]) if len(x) > 1 else None


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument('--scenes', required=True)
    ap.add_argument('--references', required=True)
    ap.add_argument('--tool', required=True, help='path of reference_render.py')
    ap.add_argument('--hotspot', default=os.path.join(os.path.dirname(__file__), '../../target/release/hotspot-render'))
    ap.add_argument('--only', help='scenes, by name')
    ap.add_argument('--configs', default='paper,best,multijitter', help=f'of {", ".join([*OURS, "multijitter", "mi-independent"])}')
    ap.add_argument('--spp', help='instead of the spp of each scene')
    ap.add_argument('--seeds', type=int, default=5)
    ap.add_argument('--first-seed', type=int, default=1)
    ap.add_argument('--threads', type=int, default=2)
    ap.add_argument('--errors', default='1e-2,1e-3')
    ap.add_argument('--rr-depth', type=int, default=5, help="Mitsuba's roulette")
    ap.add_argument('--metric', default='relmse', choices=['relmse', 'trimmed'])
    ap.add_argument('-o', '--out')
    a = ap.parse_args()
    import mitsuba as mi
    mi.set_variant('llvm_ad_rgb')
    import drjit as dr
    dr.set_thread_count(a.threads)
    spec = importlib.util.spec_from_file_location('reference_render', a.tool)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    tool.define_bsdfs(mi, dr)
    configs = a.configs.split(',')
    report = {}
    for name in a.only.split(',') if a.only else SCENES:
        depth, spps = SCENES[name]
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
        for c in configs:
            if c in ('multijitter', 'mi-independent'):
                engines[c] = Mitsuba(mi, tool, path, size, depth, a.rr_depth, c.removeprefix('mi-'))
            else:
                engines[c] = Ours(mi, a.hotspot, path, size, depth, a.threads, OURS[c] if c in OURS else [f'--{option}' for option in c.split('+')])
        runs = {c: {n: [] for n in spps} for c in configs}
        for seed in range(a.first_seed, a.first_seed + a.seeds):
            for n in spps:
                for c in configs:
                    image, seconds, process = engines[c].run(n, seed)
                    runs[c][n].append({'seconds': seconds, 'process_seconds': process, **errors(image, reference)})
        scene = report[name] = {'size': size, 'depth': depth, 'configs': {}}
        print(f'\n{name} {size[0]}x{size[1]}, depth {depth}, {a.threads} threads, {a.seeds} seeds')
        for c in configs:
            rows = []
            for n in spps:
                r = runs[c][n]
                mean = lambda key: float(np.mean([x[key] for x in r]))
                row = {'spp': n, 'seconds': float(np.median([x['seconds'] for x in r])),
                       'process_seconds': float(np.median([x['process_seconds'] or math.nan for x in r]))}
                for key in ('relmse', 'trimmed'):
                    row[key] = mean(key)
                    row[key + '_se'] = float(np.std([x[key] for x in r], ddof=1) / math.sqrt(len(r))) if len(r) > 1 else math.nan
                rows.append(row)
            e = {'runs': rows, 'slope': {k: slope([(r['spp'], r[k]) for r in rows]) for k in ('relmse', 'trimmed')}, 'seconds_to': {}}
            for target in a.errors.split(','):
                e['seconds_to'][target] = seconds_to([(r['seconds'], r[a.metric]) for r in rows], float(target))
            scene['configs'][c] = e
            print(f'  {c:16}' + ''.join(f"  {r['spp']:5}: {r['relmse']:.2e} ({r['relmse_se']:.0e}) {r['trimmed']:.2e} {r['seconds']:6.2f} s" for r in rows))
            to = ', '.join(f'{t}: ' + (f"{s:.3g} s{' (beyond)' if beyond else ''}" if s else '-') for t, (s, beyond) in e['seconds_to'].items())
            print(f"  {'':16}  slope {e['slope']['relmse'] or 0:.2f} trimmed {e['slope']['trimmed'] or 0:.2f};  to {to}", flush=True)
        if 'multijitter' in configs:
            base = scene['configs']['multijitter']
            for c in configs:
                if c != 'multijitter':
                    other = scene['configs'][c]
                    ratio = {t: base['seconds_to'][t][0] / other['seconds_to'][t][0] for t in base['seconds_to']
                             if base['seconds_to'][t][0] and other['seconds_to'][t][0]}
                    equal = [b['trimmed'] / o['trimmed'] for b, o in zip(base['runs'], other['runs'])]
                    equal_all = [b['relmse'] / o['relmse'] for b, o in zip(base['runs'], other['runs'])]
                    other['against_multijitter'] = {'seconds': ratio, 'error_at_equal_spp': equal}
                    print(f'  {c} against multijitter: seconds ' + ', '.join(f'{t}: {r:.2f}x' for t, r in ratio.items())
                          + '; error at equal spp ' + ', '.join(f'{r:.2f}' for r in equal_all) + '; trimmed ' + ', '.join(f'{r:.2f}' for r in equal), flush=True)
    if a.out:
        with open(a.out, 'w') as f:
            json.dump(report, f, indent=1)


if __name__ == '__main__':
    main()
