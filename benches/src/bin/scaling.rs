//! How time and memory grow: with threads, triangles, lights, pixels, and samples.
//!
//! ```text
//! cargo run --profile bench -p hotspot-benches --bin scaling -- [-o DIR] [--rounds N] [--most N] [--only AXIS,…]
//! ```
//!
//! Along each axis everything else stays as it is: a hall of 100,000 triangles and 2 light triangles, 128 × 128 pixels, 8
//! samples, all threads, depth 15. The sizes of an axis are rendered in turns, there and back, so that a drifting machine
//! does not bend the curve; medians of the rounds. Exponents are slopes on logarithmic axes with their standard errors. `--most` bounds
//! triangles (20,000,000 take 6 GB). Writes `scaling.AXIS.json` and a plot for each axis.
//!
//! Threads beside Mitsuba's: `benches/peers/threads.py`.
#![expect(clippy::print_stdout, reason = "it prints tables")]

use hotspot_benches::scaling::{exponent, hall};
use hotspot_cost::maps::{Curve, LogPlot};
use hotspot_integrator::{BuildOptions, Control, RenderScene, Settings, render};
use hotspot_scene::Camera;
use std::path::PathBuf;
use std::time::Instant;

struct Prepared {
    scene: RenderScene,
    camera: Camera,
    seconds: f64,
}

fn prepare(triangles: u64, lights: u64) -> Prepared {
    let scene = hall(triangles, lights);
    let start = Instant::now();
    let prepared = match RenderScene::prepare(&scene, BuildOptions::default()) {
        Ok(prepared) => prepared,
        Err(e) => panic!("{}: {e}", scene.name),
    };
    let seconds = start.elapsed().as_secs_f64();
    Prepared { scene: prepared, camera: scene.cameras[0].clone(), seconds }
}

/// What is rendered.
#[derive(Clone, Copy)]
struct Load {
    edge: u32,
    spp: u32,
    threads: usize,
}

/// Seconds of sampling, and bytes of the film.
fn run(prepared: &Prepared, load: Load) -> (f64, u64) {
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(load.threads).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start {} threads: {e}", load.threads),
    };
    let mut settings = Settings::new(load.edge, load.edge);
    settings.spp = load.spp;
    let rendered = pool.install(|| render(&prepared.scene, &prepared.camera, &settings, Control::default()));
    (rendered.seconds, rendered.frame.memory())
}

/// The most memory that this process has held at once, scene included, in bytes; `None` where the system does not say.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.parse::<f64>().ok().map(|kib| 1024.0 * kib)
}

/// One curve.
struct Series {
    what: &'static str,
    unit: &'static str,
    points: Vec<(f64, f64)>,
}

struct Axis {
    name: &'static str,
    x: &'static str,
    series: Vec<Series>,
}

/// Medians of rounds that go through all sizes, there and back.
fn medians(rounds: usize, sizes: usize, mut seconds: impl FnMut(usize) -> f64) -> Vec<f64> {
    let mut all = vec![Vec::new(); sizes];
    for round in 0..rounds {
        let mut order: Vec<usize> = (0..sizes).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for i in order {
            all[i].push(seconds(i));
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    all.into_iter().map(median).collect()
}

struct Options {
    folder: PathBuf,
    rounds: usize,
    most: u64,
    only: Option<Vec<String>>,
}

fn options() -> Options {
    let mut o = Options { folder: "scaling-out".into(), rounds: 3, most: 4_000_000, only: None };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let Some(value) = words.next() else { panic!("{word} wants a value") };
        let number = || match value.parse::<u64>() {
            Ok(n) if n > 0 => n,
            _ => panic!("{word} wants a number above 0"),
        };
        match word.as_str() {
            "-o" => o.folder = value.into(),
            "--rounds" => o.rounds = number() as usize,
            "--most" => o.most = number(),
            "--only" => o.only = Some(value.split(',').map(str::to_owned).collect()),
            _ => panic!("{word} is not an option; see the head of this file"),
        }
    }
    o
}

fn axes(o: &Options) -> Vec<Axis> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let usual = Load { edge: 128, spp: 8, threads: all };
    let samples = |load: Load| f64::from(load.edge * load.edge * load.spp);
    let wanted = |axis: &str| o.only.as_ref().is_none_or(|only| only.iter().any(|name| name == axis));
    let mut axes = Vec::new();
    let base = prepare(100_000, 2);
    // Along an axis of loads over the same scene.
    let over = |name, x, xs: Vec<f64>, loads: Vec<Load>| {
        let mut film = vec![0.0; loads.len()];
        let seconds = medians(o.rounds, loads.len(), |i| {
            let (seconds, bytes) = run(&base, loads[i]);
            film[i] = bytes as f64;
            seconds
        });
        let with = |values: &[f64]| xs.iter().copied().zip(values.iter().copied()).collect();
        let per_sample: Vec<f64> =
            seconds.iter().zip(&loads).map(|(s, load)| 1e6 * s / samples(*load)).collect();
        let mut series = vec![
            Series { what: "seconds", unit: "s", points: with(&seconds) },
            Series { what: "time per sample", unit: "µs", points: with(&per_sample) },
        ];
        if name == "resolution" {
            let per_pixel: Vec<f64> = film.iter().zip(&xs).map(|(bytes, pixels)| bytes / pixels).collect();
            series.push(Series { what: "film per pixel", unit: "bytes", points: with(&per_pixel) });
        }
        Axis { name, x, series }
    };
    if wanted("threads") {
        let mut counts: Vec<usize> =
            std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|n| *n < all).collect();
        counts.push(all);
        let loads = counts.iter().map(|threads| Load { spp: 32, threads: *threads, ..usual }).collect();
        axes.push(over("threads", "threads", counts.iter().map(|n| *n as f64).collect(), loads));
    }
    if wanted("resolution") {
        let edges = [64_u32, 128, 256, 512, 1024];
        let loads = edges.map(|edge| Load { edge, spp: 4, ..usual }).to_vec();
        axes.push(over("resolution", "pixels", edges.map(|e| f64::from(e * e)).to_vec(), loads));
    }
    if wanted("spp") {
        let counts = [1_u32, 4, 16, 64, 256];
        let loads = counts.map(|spp| Load { spp, ..usual }).to_vec();
        axes.push(over("spp", "samples per pixel", counts.map(f64::from).to_vec(), loads));
    }
    // Along an axis of scenes.
    let scenes = |name, x, sizes: Vec<u64>, make: &dyn Fn(u64) -> Prepared| {
        let (mut trace, mut build, mut bytes, mut peaks) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for size in sizes {
            let prepared = make(size);
            let seconds = medians(o.rounds, 1, |_| run(&prepared, usual).0)[0];
            let memory = prepared.scene.memory();
            let triangles = prepared.scene.object_triangles().iter().sum::<u64>() as f64;
            trace.push((size as f64, 1e6 * seconds / samples(usual)));
            build.push((size as f64, prepared.seconds));
            bytes.push((size as f64, (memory.geometry + memory.bvh) as f64 / triangles));
            // Sizes rise, so that the peak is of the present one; below a million the rest of the process counts.
            if let Some(peak) = peak().filter(|_| triangles >= 9e5) {
                peaks.push((size as f64, peak / triangles));
            }
        }
        let mut series = vec![
            Series { what: "time per sample", unit: "µs", points: trace },
            Series { what: "preparing", unit: "s", points: build },
            Series { what: "geometry and tree per triangle", unit: "bytes", points: bytes },
        ];
        if !peaks.is_empty() {
            series.push(Series { what: "peak of the process per triangle", unit: "bytes", points: peaks });
        }
        Axis { name, x, series }
    };
    if wanted("triangles") {
        let sizes = [1000, 10_000, 100_000, 1_000_000, 4_000_000, 20_000_000];
        let sizes = sizes.into_iter().filter(|n| *n <= o.most).collect();
        axes.push(scenes("triangles", "triangles", sizes, &|n| prepare(n, 2)));
    }
    if wanted("lights") {
        let sizes = vec![2, 10, 100, 1000, 10_000, 100_000];
        axes.push(scenes("lights", "light triangles", sizes, &|n| prepare(1000, n)));
    }
    axes
}

fn main() {
    let o = options();
    if let Err(e) = std::fs::create_dir_all(&o.folder) {
        panic!("{}: {e}", o.folder.display());
    }
    for axis in axes(&o) {
        let mut json = Vec::new();
        println!("\n{} ({} rounds)", axis.name, o.rounds);
        for series in &axis.series {
            let row: Vec<String> = series.points.iter().map(|(x, y)| format!("{x}: {y:.4}")).collect();
            let fit = exponent(&series.points);
            let told =
                fit.map_or(String::new(), |(slope, error)| format!("   exponent {slope:+.3} ± {error:.3}"));
            println!("  {} [{}]   {}{told}", series.what, series.unit, row.join("   "));
            let points: Vec<String> = series.points.iter().map(|(x, y)| format!("[{x}, {y}]")).collect();
            let fit = fit.map_or("null".into(), |(slope, error)| format!("[{slope}, {error}]"));
            json.push(format!(
                "  {{ \"axis\": \"{}\", \"what\": \"{}\", \"unit\": \"{}\", \"exponent\": {fit}, \"points\": [{}] }}",
                axis.name,
                series.what,
                series.unit,
                points.join(", ")
            ));
        }
        let curves = axis.series.iter().map(|series| Curve {
            name: format!("{} [{}]", series.what, series.unit),
            points: series.points.iter().map(|(x, y)| (*x, *y, [*y, *y])).collect(),
        });
        let plot = LogPlot {
            title: format!("Growth with {}", axis.name),
            x_label: axis.x.into(),
            y_label: "see the legend".into(),
            curves: curves.collect(),
            level: None,
            guide: None,
        };
        write(&o, &format!("scaling.{}.svg", axis.name), &plot.svg());
        write(&o, &format!("scaling.{}.json", axis.name), &format!("[\n{}\n]\n", json.join(",\n")));
    }
}

fn write(o: &Options, name: &str, text: &str) {
    let file = o.folder.join(name);
    match std::fs::write(&file, text) {
        Ok(()) => println!("wrote {}", file.display()),
        Err(e) => panic!("{}: {e}", file.display()),
    }
}
