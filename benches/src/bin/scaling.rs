//! How time and memory grow: with threads, triangles, lights, pixels, and samples.
//!
//! ```text
//! cargo run --profile bench -p hotspot-benches --bin scaling -- [-o DIR] [--rounds N] [--most N] [--only AXIS,…]
//! ```
//!
//! Along each axis everything else stays as it is: a hall of 100,000 triangles and 2 light triangles, 128 × 128 pixels, 8
//! samples, all threads, depth 15. The sizes of an axis are rendered in turns, there and back, so that a drifting machine
//! does not bend the curve; medians of the rounds. Exponents are slopes on logarithmic axes with their standard errors. `--most` bounds
//! triangles (20,000,000 take 6 GB). Writes `scaling.AXIS.json`, and a plot for each of its curves; grey: proportional.
//!
//! `--draw scaling.AXIS.json,…` draws the plots of earlier runs.
//!
//! Threads beside Mitsuba's: `benches/peers/threads.py`.
#![expect(clippy::print_stdout, reason = "it prints tables")]

use hotspot_benches::scaling::{exponent, hall};
use hotspot_cost::maps::{Curve, LogPlot};
use hotspot_integrator::{BuildOptions, Control, RenderScene, Settings, render};
use hotspot_scene::Camera;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
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
#[derive(Serialize, Deserialize)]
struct Series {
    axis: String,
    what: String,
    unit: String,
    /// Slope on logarithmic axes and its standard error.
    exponent: Option<(f64, f64)>,
    points: Vec<(f64, f64)>,
}

impl Series {
    fn new(axis: &str, what: &str, unit: &str, points: Vec<(f64, f64)>) -> Self {
        let exponent = exponent(&points);
        Self { axis: axis.into(), what: what.into(), unit: unit.into(), exponent, points }
    }

    fn plot(&self) -> LogPlot {
        let x_label = match self.axis.as_str() {
            "resolution" => "pixels",
            "spp" => "samples per pixel",
            "lights" => "light triangles",
            other => other,
        };
        let guide = match (self.what.as_str(), self.axis.as_str()) {
            ("seconds", "threads") => Some(-1.0),
            ("seconds" | "preparing", _) => Some(1.0),
            _ => None,
        };
        LogPlot {
            title: match self.exponent {
                Some((slope, error)) => format!("Growth with {x_label}: exponent {slope:.3} ± {error:.3}"),
                None => format!("Growth with {x_label}"),
            },
            x_label: x_label.into(),
            y_label: format!("{} [{}]", self.what, self.unit),
            curves: vec![Curve {
                name: String::new(),
                points: self.points.iter().map(|(x, y)| (*x, *y, [*y, *y])).collect(),
            }],
            level: None,
            guide,
        }
    }
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
    draw: Vec<PathBuf>,
}

fn options() -> Options {
    let mut o =
        Options { folder: "scaling-out".into(), rounds: 3, most: 4_000_000, only: None, draw: Vec::new() };
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
            "--draw" => o.draw = value.split(',').map(PathBuf::from).collect(),
            "--only" => o.only = Some(value.split(',').map(str::to_owned).collect()),
            _ => panic!("{word} is not an option; see the head of this file"),
        }
    }
    o
}

fn axes(o: &Options) -> Vec<Vec<Series>> {
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    let usual = Load { edge: 128, spp: 8, threads: all };
    let samples = |load: Load| f64::from(load.edge * load.edge * load.spp);
    let wanted = |axis: &str| o.only.as_ref().is_none_or(|only| only.iter().any(|name| name == axis));
    let mut axes = Vec::new();
    let base = prepare(100_000, 2);
    // Along an axis of loads over the same scene.
    let over = |name: &str, xs: Vec<f64>, loads: Vec<Load>| {
        let mut film = vec![0.0; loads.len()];
        let seconds = medians(o.rounds, loads.len(), |i| {
            let (seconds, bytes) = run(&base, loads[i]);
            film[i] = bytes as f64;
            seconds
        });
        let with = |values: &[f64]| xs.iter().copied().zip(values.iter().copied()).collect();
        let per_sample: Vec<f64> =
            seconds.iter().zip(&loads).map(|(s, load)| 1e6 * s / samples(*load)).collect();
        let mut series = vec![Series::new(name, "seconds", "s", with(&seconds))];
        if name != "threads" {
            series.push(Series::new(name, "time per sample", "µs", with(&per_sample)));
        }
        if name == "resolution" {
            let per_pixel: Vec<f64> = film.iter().zip(&xs).map(|(bytes, pixels)| bytes / pixels).collect();
            series.push(Series::new(name, "film per pixel", "bytes", with(&per_pixel)));
        }
        series
    };
    if wanted("threads") {
        let mut counts: Vec<usize> =
            std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|n| *n < all).collect();
        counts.push(all);
        let loads = counts.iter().map(|threads| Load { spp: 32, threads: *threads, ..usual }).collect();
        axes.push(over("threads", counts.iter().map(|n| *n as f64).collect(), loads));
    }
    if wanted("resolution") {
        let edges = [64_u32, 128, 256, 512, 1024];
        let loads = edges.map(|edge| Load { edge, spp: 4, ..usual }).to_vec();
        axes.push(over("resolution", edges.map(|e| f64::from(e * e)).to_vec(), loads));
    }
    if wanted("spp") {
        let counts = [1_u32, 4, 16, 64, 256];
        let loads = counts.map(|spp| Load { spp, ..usual }).to_vec();
        axes.push(over("spp", counts.map(f64::from).to_vec(), loads));
    }
    // Along an axis of scenes.
    let scenes = |name: &str, sizes: Vec<u64>, make: &dyn Fn(u64) -> Prepared| {
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
            Series::new(name, "time per sample", "µs", trace),
            Series::new(name, "preparing", "s", build),
            Series::new(name, "geometry and tree per triangle", "bytes", bytes),
        ];
        if !peaks.is_empty() {
            series.push(Series::new(name, "peak of the process per triangle", "bytes", peaks));
        }
        series
    };
    if wanted("triangles") {
        let sizes = [1000, 10_000, 100_000, 1_000_000, 4_000_000, 20_000_000];
        let sizes = sizes.into_iter().filter(|n| *n <= o.most).collect();
        axes.push(scenes("triangles", sizes, &|n| prepare(n, 2)));
    }
    if wanted("lights") {
        let sizes = vec![2, 10, 100, 1000, 10_000, 100_000];
        axes.push(scenes("lights", sizes, &|n| prepare(1000, n)));
    }
    axes
}

fn main() {
    let o = options();
    if let Err(e) = std::fs::create_dir_all(&o.folder) {
        panic!("{}: {e}", o.folder.display());
    }
    for file in &o.draw {
        draw(&o, &read(file));
    }
    if !o.draw.is_empty() {
        return;
    }
    for series in axes(&o) {
        let axis = &series[0].axis;
        println!("\n{axis} ({} rounds)", o.rounds);
        for Series { what, unit, exponent, points, .. } in &series {
            let row: Vec<String> = points.iter().map(|(x, y)| format!("{x}: {y:.4}")).collect();
            let told = exponent
                .map_or(String::new(), |(slope, error)| format!("   exponent {slope:+.3} ± {error:.3}"));
            println!("  {what} [{unit}]   {}{told}", row.join("   "));
        }
        match serde_json::to_string_pretty(&series) {
            Ok(text) => write(&o, &format!("scaling.{axis}.json"), &(text + "\n")),
            Err(e) => panic!("{axis}: {e}"),
        }
        draw(&o, &series);
    }
}

fn draw(o: &Options, series: &[Series]) {
    for one in series {
        let name = format!("scaling.{}.{}.svg", one.axis, one.what.replace(' ', "-"));
        write(o, &name, &one.plot().svg());
    }
}

fn read(file: &Path) -> Vec<Series> {
    let text = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(e) => panic!("{}: {e}", file.display()),
    };
    match serde_json::from_str(&text) {
        Ok(series) => series,
        Err(e) => panic!("{}: {e}", file.display()),
    }
}

fn write(o: &Options, name: &str, text: &str) {
    let file = o.folder.join(name);
    match std::fs::write(&file, text) {
        Ok(()) => println!("wrote {}", file.display()),
        Err(e) => panic!("{}: {e}", file.display()),
    }
}
