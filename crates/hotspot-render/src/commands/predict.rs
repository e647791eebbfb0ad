//! `predict`: what a render will count and how long it will take, from a few seconds of small renders.
//!
//! The pilots run the kernel that the render would run, on as many threads, with as many samples for each visit of a pixel
//! (a visit has a cost of its own), over the same film. Each has a seed of its own. Time is read from the pixels' clocks and
//! divided by the threads, since at the end of a small render threads wait for each other longer than in a large one. What the
//! clocks do not see is added for each wave of samples that the render will have. Where paths that are not counted go eight at a time no
//! clock can tell pixels apart, so there the time is that of the pilot as a whole.

use super::calibrate::read_profile;
use crate::args::{FilmArgs, TalkArgs, ViewArgs, parse_seconds};
use crate::causes;
use crate::fail::{FAILED, Fail, INTERRUPTED};
use crate::interrupt;
use crate::open::SceneArgs;
use crate::output::{Output, Writer};
use crate::progress::Talker;
use crate::stage::Stage;
use clap::Args;
use hotspot_cost::calibration::{Form, Profile, Term};
use hotspot_cost::exr_io::Header;
use hotspot_cost::maps::write_atomic;
use hotspot_cost::prediction::{
    Budget, Interval, PREDICT_SCHEMA, Pilot, Pilots, Prediction, Seconds, seconds,
};
use hotspot_cost::{CostModel, LayerOptions, Ledgers, Metric, MetricSet, hotspots};
use hotspot_integrator::{Control, Gather, Rendered, Settings, Stop, Waves};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// `predict`.
#[derive(Debug, Args)]
pub(crate) struct PredictArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    /// Camera samples per pixel of the render to predict [default: 64; 32 for --demo]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Option<u32>,
    /// Predict a render with `--metrics none`: the picture alone, on the plain kernel
    #[arg(long)]
    pub(crate) plain: bool,
    /// Calibrated coefficients from `calibrate`: intersection in nanoseconds, and, where paths go one by one, a second opinion on the
    /// time
    #[arg(long, value_name = "FILE")]
    pub(crate) profile: Option<PathBuf>,
    /// Also say how many samples per pixel fit into so many seconds from start to end
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) budget: Option<f64>,
    /// Spend about so many seconds on the small renders
    #[arg(long, value_name = "S", default_value_t = 4.0, value_parser = parse_seconds)]
    pub(crate) pilot: f64,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// Small renders. Sixteen are worth 6 degrees of freedom where the machine's speed wanders, with a t quantile of 2.4; fewer
/// would widen every interval, more make each too short.
const REPEATS: u32 = 16;

/// Most samples for a visit of a pixel in pilots: the cost of the visit is spread over 32 paths then, and hardly shows.
const MOST_PER_VISIT: u32 = 32;

/// Fewest pixels of a pilot: small features must be hit.
const FEWEST_PIXELS: f64 = 4096.0;

pub(crate) fn run(args: &PredictArgs) -> Result<(), Fail> {
    let talker = Talker::new(&args.talk);
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let model = profile.as_ref().map_or_else(CostModel::default, |p| p.intersection.model());
    let writer = Writer::new(&args.output, &args.views)?;
    let start = Instant::now();
    let scene = args.open.load()?;
    let load = start.elapsed().as_secs_f64();
    let mut stage = Stage::new(&scene, &args.open, &args.film)?;
    let build = start.elapsed().as_secs_f64() - load;
    stage.load_seconds = load;
    drop(scene);
    drop(writer);
    stage.check_memory(false, 1)?;
    stage.announce(&talker);

    let spp = args.spp.unwrap_or(if args.open.demo { 32 } else { 64 });
    let mut full = stage.settings();
    full.spp = spp;
    full.gather = if args.plain { Gather::RADIANCE } else { Gather::ALL };
    full.ledgers = !args.plain;
    let control = Control { cancel: Some(interrupt::flag()), progress: None, ..Control::default() };
    let begin = Instant::now();
    let plan = Plan::new(&stage, &full, args.pilot, control)?;
    let run = plan.run(&stage, &full, model, control)?;
    let pilot_seconds = begin.elapsed().as_secs_f64();

    let pixels = u64::from(full.width) * u64::from(full.height);
    let paths = pixels * u64::from(spp);
    let threads = run.last.threads;
    // The render in pilots.
    let length = paths as f64 / (plan.pixels() * f64::from(plan.settings.spp)).max(1.0);
    let Some(per_path) = seconds(&run.path_seconds, drift(profile.as_ref()), length) else {
        return Err(Fail::new(FAILED, "the pilots took no time; raise --pilot"));
    };
    // Learning does not depend on the number of samples.
    let idle = f64::from(plan.waves) * run.idle_per_wave + run.last.learning_seconds;
    let render = per_path.scaled(paths as f64 / threads as f64).plus(idle);
    let output = output_seconds(
        args,
        &stage,
        &run.last,
        model,
        &plan.settings,
        pixels as f64 / plan.pixels().max(1.0),
    )?;
    let mut prediction = Prediction {
        schema: PREDICT_SCHEMA.into(),
        generator: format!("hotspot-render {}", env!("CARGO_PKG_VERSION")),
        command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        scene: stage.name.clone(),
        settings: stage.described(&full),
        resolution: [full.width, full.height],
        samples_per_pixel: spp.into(),
        threads: threads as u32,
        kernel: run.last.kernel.clone(),
        pilot: Pilot {
            resolution: [plan.settings.width, plan.settings.height],
            samples_per_pixel: plan.settings.spp.into(),
            repeats: REPEATS,
            path_ns: run.path_seconds.iter().map(|s| s * 1e9).collect(),
            idle_per_wave: run.idle_per_wave,
            seconds: pilot_seconds,
        },
        seconds: Seconds { render, load, build, output, total: render.plus(load + build + output) },
        totals: run.pilots.totals(paths),
        cost_unit: profile.as_ref().map(|_| crate::args::CALIBRATED_UNIT.to_owned()),
        ..Prediction::default()
    };
    if let Some(profile) = &profile {
        if run.last.eights {
            talker
                .warn("note: --profile: its coefficients are of single paths; here they go eight at a time");
        } else {
            note_differences(&talker, profile, &run.last);
            prediction.seconds_by_profile =
                by_profile(profile, &prediction.totals, paths).map(|ns| ns * 1e-9 / threads as f64);
        }
    }
    prediction.budget = args.budget.map(|budget| {
        let per_sample = per_path.ci95[1] * pixels as f64 / threads as f64;
        let left = (budget - load - build - output - idle).max(0.0);
        // Float to integer saturates.
        Budget { seconds: budget, samples_per_pixel: (left / per_sample) as u64 }
    });
    prediction.verdict = sentence(&prediction);
    let file = args.output.join(format!("{}.predict.json", stage.name));
    write_atomic(&file, prediction.to_json().as_bytes())?;
    talker.say(&format!("wrote {}: every total with its interval", file.display()));
    say_rest(&talker, &prediction);
    talker.say(&prediction.verdict);
    Ok(())
}

/// How the pilots are rendered.
struct Plan {
    settings: Settings,
    /// Waves of samples of the render to predict.
    waves: u32,
}

/// What they gave.
struct Run {
    pilots: Pilots,
    /// Seconds of one thread per path, pilot by pilot.
    path_seconds: Vec<f64>,
    idle_per_wave: f64,
    last: Rendered,
}

impl Plan {
    /// Sized by a first pilot, that also warms everything up.
    fn new(stage: &Stage<'_>, full: &Settings, budget: f64, control: Control<'_>) -> Result<Self, Fail> {
        // As many samples as may go eight at a time, in each half.
        let enough = if full.intervals { 16 } else { 8 };
        let mut settings = pilot_of(full, FEWEST_PIXELS * 2.0, full.spp.min(enough));
        let mut first = render(stage, &settings, control)?;
        if !first.eights && !settings.gather.time {
            settings.gather.time = true;
            first = render(stage, &settings, control)?;
        }
        let clocked = settings.gather.time;
        let per_path = thread_seconds(&first, &settings, full) / first.threads as f64;
        let layer = per_path * f64::from(full.width) * f64::from(full.height);
        let waves = waves(layer, Waves::new(full, first.eights));
        let visit = samples_per_visit(full.spp, waves);
        let paths = budget / f64::from(REPEATS) / per_path.max(1e-9);
        settings = pilot_of(full, paths / f64::from(visit), visit);
        settings.gather.time = clocked;
        Ok(Self { settings, waves })
    }

    fn pixels(&self) -> f64 {
        f64::from(self.settings.width) * f64::from(self.settings.height)
    }

    fn run(
        &self,
        stage: &Stage<'_>,
        full: &Settings,
        model: CostModel,
        control: Control<'_>,
    ) -> Result<Run, Fail> {
        let mut pilots = Pilots::new(self.settings.width, self.settings.height, model);
        let mut path_seconds = Vec::new();
        let mut idle = 0.0;
        let mut last = None;
        for repeat in 0..REPEATS {
            let mut settings = self.settings.clone();
            // Never the render's own seed, nor one that another pilot has.
            settings.seed = full.seed.wrapping_add(1 + u64::from(repeat));
            let timed = render(stage, &settings, control)?;
            path_seconds.push(thread_seconds(&timed, &settings, full));
            idle += idle_seconds(&timed, &settings);
            if full.gather.cost {
                pilots.add(&timed.frame)?;
            } else {
                settings.gather = Gather { time: false, ..Gather::ALL };
                pilots.add(&render(stage, &settings, control)?.frame)?;
            }
            last = Some(timed);
        }
        let last = last.ok_or_else(|| Fail::new(FAILED, "no pilot was rendered"))?;
        Ok(Run { pilots, path_seconds, idle_per_wave: idle / f64::from(REPEATS), last })
    }
}

/// The whole film in about so many pixels, each visited once.
fn pilot_of(full: &Settings, pixels: f64, spp: u32) -> Settings {
    let mut settings = full.clone();
    let all = f64::from(full.width) * f64::from(full.height);
    let shrink = (pixels.max(FEWEST_PIXELS) / all).sqrt().min(1.0);
    let edge = |edge: u32| ((f64::from(edge) * shrink).round() as u32).clamp(1, edge);
    (settings.width, settings.height) = (edge(full.width), edge(full.height));
    // The film is the same, though its pixels may no longer be square.
    settings.aspect = Some(f64::from(full.width) / f64::from(full.height));
    settings.spp = spp;
    settings.first_wave = Some(spp);
    // Without counts it may go eight at a time, unless it is clocked.
    settings.gather.time = full.gather.cost;
    settings
}

/// Waves of a render of which one sample for every pixel takes `layer` seconds.
fn waves(layer: f64, waves: Waves) -> u32 {
    let left = waves.total.saturating_sub(waves.first());
    1 + left.div_ceil(waves.next(layer)) as u32
}

/// Samples for each visit of a pixel in a render of so many waves.
fn samples_per_visit(spp: u32, waves: u32) -> u32 {
    ((f64::from(spp) / f64::from(waves)).round() as u32).clamp(1, MOST_PER_VISIT)
}

fn render(stage: &Stage<'_>, settings: &Settings, control: Control<'_>) -> Result<Rendered, Fail> {
    let rendered = stage.render(settings, control);
    match rendered.stop {
        Stop::Cancelled => Err(Fail::new(INTERRUPTED, "interrupted: nothing was saved")),
        _ => Ok(rendered),
    }
}

/// Seconds of one thread per path, without the clock where the render to predict has none.
fn thread_seconds(rendered: &Rendered, settings: &Settings, full: &Settings) -> f64 {
    if !settings.gather.time {
        let paths = f64::from(settings.width) * f64::from(settings.height) * f64::from(settings.spp);
        return (rendered.seconds - rendered.learning_seconds) * rendered.threads as f64 / paths;
    }
    let (mut ns, mut paths) = (0.0, 0.0);
    for pixel in rendered.frame.costs() {
        ns += pixel.time_ns as f64;
        paths += pixel.time_samples as f64;
    }
    let clock = if full.gather.time { 0.0 } else { clock_seconds() / f64::from(settings.spp) };
    (ns * 1e-9 / f64::max(paths, 1.0) - clock).max(0.0)
}

/// What a pilot's clocks do not see of its time: threads that wait for the last tile, the film's memory. 0 where there are so
/// few tiles that threads wait for want of work.
fn idle_seconds(rendered: &Rendered, settings: &Settings) -> f64 {
    let tiles = f64::from(settings.width.div_ceil(16)) * f64::from(settings.height.div_ceil(16));
    let threads = rendered.threads as f64;
    if tiles < 8.0 * threads || !settings.gather.time {
        return 0.0;
    }
    let clocked: f64 = rendered.frame.costs().map(|pixel| pixel.time_ns as f64 * 1e-9).sum();
    (rendered.seconds - rendered.learning_seconds - clocked / threads).max(0.0)
}

/// What reading the clock takes: the least of a few tries.
fn clock_seconds() -> f64 {
    const READINGS: u32 = 1000;
    let once = |_| {
        let start = Instant::now();
        for _ in 0..READINGS {
            std::hint::black_box(Instant::now());
        }
        start.elapsed().as_secs_f64() / f64::from(READINGS)
    };
    (0..8).map(once).fold(f64::INFINITY, f64::min)
}

/// Standard deviation of the machine's drift between the runs of a profile, that were seconds to minutes apart.
fn drift(profile: Option<&Profile>) -> f64 {
    let Some(profile) = profile else { return 0.0 };
    let (mut sum, mut count) = (0.0, 0.0);
    for scene in profile.scenes.iter().filter(|scene| scene.drift.len() > 1) {
        sum += scene.drift.iter().map(|d| (d - 1.0).powi(2)).sum::<f64>();
        count += (scene.drift.len() - 1) as f64;
    }
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}

/// Seconds to make and write the outputs of a render that has `scale` times the pixels of a pilot. Ledgers and the causes of
/// hotspots do not grow with the pixels: what they add is taken once.
fn output_seconds(
    args: &PredictArgs,
    stage: &Stage<'_>,
    rendered: &Rendered,
    model: CostModel,
    settings: &Settings,
    scale: f64,
) -> Result<f64, Fail> {
    let without = write_outputs(args, stage, rendered, model, (settings, None))?;
    let Some(ledgers) = &rendered.ledgers else { return Ok(without * scale) };
    let with = write_outputs(args, stage, rendered, model, (settings, Some(ledgers)))?;
    Ok(without * scale + (with - without).max(0.0))
}

/// Seconds to make and write the outputs of a pilot.
fn write_outputs(
    args: &PredictArgs,
    stage: &Stage<'_>,
    rendered: &Rendered,
    model: CostModel,
    (settings, ledgers): (&Settings, Option<&Ledgers>),
) -> Result<f64, Fail> {
    let folder = tempfile::tempdir()
        .map_err(|e| Fail::new(FAILED, format!("cannot make a temporary folder: {e}; set TMPDIR")))?;
    let writer = Writer::new(folder.path(), &args.views)?;
    let start = Instant::now();
    let metrics = if args.plain { MetricSet::NONE } else { MetricSet::ALL };
    let options = LayerOptions { model, metrics, ..LayerOptions::default() };
    let layers = stage.layers(rendered, &options);
    let mut document = stage.document(rendered, &options);
    let objects = hotspots::first_objects(&rendered.frame);
    if layers.metric(Metric::Intersection).is_some() {
        let of = (&rendered.frame, stage.prepared.objects());
        document.hotspots =
            stage.install(|| hotspots::of_frame_layers(of.0, &layers, model, &objects, of.1, 12));
    }
    if let (Some(ledgers), Some(cost)) = (ledgers, layers.metric(Metric::Intersection)) {
        document.ledgers = Some(ledgers.clone().shortened());
        causes::explain(stage, settings, model, (cost, &objects), &mut document.hotspots);
    }
    let triangles = stage.prepared.object_triangles();
    let output = Output {
        stem: &stage.name,
        layers: &layers,
        document: &mut document,
        header: Header::default(),
        objects: &objects,
        object_names: stage.prepared.objects(),
        materials: &[],
        material_names: &[],
        object_triangles: &triangles,
        ledgers,
        write_exr: true,
    };
    stage.install(|| writer.render(output))?;
    Ok(start.elapsed().as_secs_f64())
}

/// Nanoseconds of one thread by a profile's full fit.
fn by_profile(profile: &Profile, totals: &BTreeMap<String, Interval>, paths: u64) -> Option<f64> {
    let fit = profile.fits.get(&Form::Full)?;
    let total = |name: &str| totals.get(name).map_or(0.0, |total| total.value);
    let terms = Term::ALL.map(|term| match term {
        Term::Path => paths as f64,
        Term::RaysTrace => total("rays") - total("rays_shadow"),
        other => total(other.name()),
    });
    Some(fit.predict(&terms))
}

/// A profile speaks for its machine, threads and kernels.
fn note_differences(talker: &Talker, profile: &Profile, rendered: &Rendered) {
    if profile.threads as usize != rendered.threads {
        talker.warn(&format!(
            "note: --profile: it was calibrated on {} threads, this is on {}; times per event may differ",
            profile.threads, rendered.threads
        ));
    }
    if !profile.kernels.contains(&rendered.kernel) {
        talker.warn(&format!(
            "note: --profile: it knows {}, this scene runs {}; calibrate with this scene to be sure",
            profile.kernels.join(", "),
            rendered.kernel
        ));
    }
}

fn say_rest(talker: &Talker, prediction: &Prediction) {
    let Seconds { load, build, output, total, .. } = prediction.seconds;
    talker.say(&format!(
        "beside sampling: load {}, tree {}, output about {}; {} in all",
        time(load),
        time(build),
        time(output),
        time(total.value)
    ));
    if let Some(seconds) = prediction.seconds_by_profile {
        talker.say(&format!("by the profile's coefficients: {} of sampling", time(seconds)));
    }
    if let Some(budget) = prediction.budget {
        talker.say(&match budget.samples_per_pixel {
            0 => format!("{} is too short for a single sample per pixel", time(budget.seconds)),
            n => format!("{n} samples per pixel fit into {}", time(budget.seconds)),
        });
    }
}

/// "640x360 at 256 spp: 41 s ± 2 s on 2 threads; 3.1e9 node visits ± 0.8 %".
fn sentence(prediction: &Prediction) -> String {
    let [width, height] = prediction.resolution;
    let render = prediction.seconds.render;
    let half = 0.5 * (render.ci95[1] - render.ci95[0]);
    let threads = if prediction.threads == 1 { "thread" } else { "threads" };
    let nodes = prediction.totals.get(Metric::Nodes.name()).map_or_else(String::new, |nodes| {
        format!("; {} node visits ± {:.2} %", scientific(nodes.value), 100.0 * nodes.relative())
    });
    format!(
        "{width}x{height} at {} spp: {} ± {} on {} {threads}{nodes}",
        prediction.samples_per_pixel,
        time(render.value),
        time(half),
        prediction.threads
    )
}

/// 3.1e9.
fn scientific(value: f64) -> String {
    if value < 1e4 { format!("{value:.0}") } else { format!("{value:.2e}") }
}

/// A duration for people, to two or three digits.
fn time(seconds: f64) -> String {
    match seconds {
        s if s >= 7200.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 600.0 => format!("{:.1} min", s / 60.0),
        s if s >= 10.0 => format!("{s:.1} s"),
        s => format!("{s:.2} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visits_follow_the_waves_of_a_render() {
        let of = |spp: u32, least| Waves { pixels: 256 * 256, total: spp.into(), least };
        let visit = |spp, layer| samples_per_visit(spp, waves(layer, of(spp, None)));
        // A layer of 0.3 s: waves of 4, then of 3.
        assert_eq!(waves(0.3, of(64, None)), 21);
        // Eight, then sixteen in two and a half seconds; one at a time where even that takes longer.
        let eights = |spp, layer| waves(layer, of(spp, Some(8)));
        assert_eq!((eights(64, 0.15), eights(64, 5.0), eights(64, 1e-4), eights(13, 5.0)), (5, 57, 2, 1));
        let large = Waves { pixels: 1 << 20, ..of(64, Some(8)) };
        assert_eq!((large.first(), large.next(0.3), large.next(0.5)), (4, 10, 6));
        assert_eq!(visit(64, 0.3), 3);
        // One visit for what fits the first wave; two for a small picture.
        assert_eq!(visit(3, 0.3), 3);
        assert_eq!(visit(64, 1e-4), 32);
        assert_eq!(visit(16, 1e-4), 8);
        // Layers longer than a wave: one sample a visit, after the first four.
        assert_eq!(visit(64, 9.0), 1);
    }

    #[test]
    fn pilots_cover_the_whole_film() {
        let full = Settings::new(643, 359);
        let pilot = pilot_of(&full, 20_000.0, 5);
        assert_eq!(pilot.aspect, Some(643.0 / 359.0));
        assert!((f64::from(pilot.width * pilot.height) / 20_000.0 - 1.0).abs() < 0.02);
        assert_eq!((pilot.spp, pilot.first_wave), (5, Some(5)));
        let tiny = pilot_of(&Settings::new(20, 10), 1e9, 4);
        assert_eq!((tiny.width, tiny.height), (20, 10));
    }

    #[test]
    fn the_sentence_reads() {
        let prediction = Prediction {
            resolution: [640, 360],
            samples_per_pixel: 256,
            threads: 2,
            seconds: Seconds { render: Interval { value: 41.0, ci95: [39.0, 43.0] }, ..Seconds::default() },
            totals: [("nodes".to_owned(), Interval { value: 3.1e9, ci95: [3.08e9, 3.12e9] })].into(),
            ..Prediction::default()
        };
        assert_eq!(
            sentence(&prediction),
            "640x360 at 256 spp: 41.0 s ± 2.00 s on 2 threads; 3.10e9 node visits ± 0.65 %"
        );
    }
}
