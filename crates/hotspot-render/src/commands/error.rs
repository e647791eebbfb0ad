//! `error`: speed against error.

use crate::args::{FilmArgs, TalkArgs, nearest, parse_roulette};
use crate::fail::{Fail, INTERRUPTED};
use crate::interrupt;
use crate::open::SceneArgs;
use crate::progress::Talker;
use crate::stage::Stage;
use clap::Args;
use hotspot_cost::convergence::{ErrorReport, ReferenceFacts, Run, SCHEMA};
use hotspot_cost::exr_io::Limits;
use hotspot_cost::maps::{Curve, HeatOptions, LogPlot, heat_map, write_atomic, write_png};
use hotspot_cost::picture_error::{Picture, PictureError, Reference, error_by_pixel};
use hotspot_cost::{LayerOptions, stats};
use hotspot_integrator::{Control, Gather, Rendered, Roulette, SamplerKind, Settings, Stop};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Options of `error`.
#[derive(Debug, Args)]
pub(crate) struct ErrorArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// The converged picture, with its halves beside it as NAME_a.exr and NAME_b.exr or in its half.* channels [default: one is
    /// rendered]
    #[arg(long, value_name = "EXR")]
    reference: Option<PathBuf>,
    /// Camera samples per pixel of the reference that is rendered where none is named [default: 16 times the most of --spp]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..), conflicts_with = "reference")]
    reference_spp: Option<u32>,
    /// Camera samples per pixel to measure
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1,4,16,64",
          value_parser = clap::value_parser!(u32).range(1..))]
    spp: Vec<u32>,
    /// Seeds to repeat everything with, from --seed upwards
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// Relative squared errors whose time to interpolate
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1e-2,1e-3", value_parser = parse_target)]
    to: Vec<Target>,
    /// Configurations to measure side by side, in turns: sampler, roulette or max-depth with their values. Repeated, all
    /// combinations
    #[arg(long, value_name = "OPTION=A,B…", value_parser = parse_vary)]
    vary: Vec<Vary>,
    /// Keep two independent halves in each render, whose estimate of the error is then unbiased
    #[arg(long)]
    intervals: bool,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    output: PathBuf,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    #[command(flatten)]
    talk: TalkArgs,
}

/// An error, as written and as a number.
#[derive(Clone, Debug, PartialEq)]
struct Target {
    text: String,
    value: f64,
}

/// One option and the values it takes in turn.
#[derive(Clone, Debug, PartialEq)]
struct Vary {
    values: Vec<Change>,
}

/// A change of the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    Sampler(SamplerKind),
    Roulette(Roulette),
    MaxDepth(u32),
}

impl Change {
    fn apply(self, settings: &mut Settings) {
        match self {
            Self::Sampler(kind) => settings.sampler = kind,
            Self::Roulette(roulette) => settings.roulette = roulette,
            Self::MaxDepth(depth) => settings.max_depth = depth,
        }
    }

    fn name(self) -> String {
        match self {
            Self::Sampler(kind) => format!("sampler={}", kind.name()),
            Self::Roulette(Roulette::Off) => "roulette=off".into(),
            Self::Roulette(Roulette::From(from)) => format!("roulette={from}"),
            Self::Roulette(Roulette::Efficient) => "roulette=efficient".into(),
            Self::MaxDepth(depth) => format!("max-depth={depth}"),
        }
    }
}

/// What a configuration is called and changes.
struct Config {
    name: String,
    changes: Vec<Change>,
}

/// A reference of many samples is rendered in this many times the most samples measured.
const REFERENCE_FACTOR: u32 = 16;

pub(crate) fn run(args: &ErrorArgs) -> Result<(), Fail> {
    let talker = Talker::new(&args.talk);
    let configs = configurations(&args.vary);
    let mut spps = args.spp.clone();
    spps.sort_unstable();
    spps.dedup();
    if args.intervals && spps.iter().any(|spp| spp % 2 == 1) {
        return Err(Fail::usage(
            "--intervals: every number of --spp must be even, so that both halves have as many",
        ));
    }
    super::make_folder(&args.output)?;
    let read = args.reference.as_ref().map(|path| Reference::read(path, &Limits::default())).transpose()?;
    let mut film = args.film.clone();
    if let Some(reference) = &read {
        let size = reference.mean().size();
        let file = args.reference.as_ref().map_or_else(String::new, |path| path.display().to_string());
        match film.size {
            Some(asked) if asked != size => {
                return Err(Fail::usage(format!(
                    "--size {}x{}: the reference {file} has {}x{} pixels; leave --size out to render at its size",
                    asked.0, asked.1, size.0, size.1
                )));
            }
            _ => film.size = Some(size),
        }
    }

    let start = Instant::now();
    let scene = args.open.load()?;
    let mut stage = Stage::new(&scene, &args.open, &film)?;
    drop(scene);
    let before_sampling = start.elapsed().as_secs_f64();
    stage.load_seconds = before_sampling - stage.prepared.build_seconds();
    stage.check_memory(true, 2)?;
    stage.announce(&talker);

    let cancel = interrupt::flag();
    let render = |settings: &Settings| -> Rendered {
        stage.render(
            settings,
            Control { cancel: Some(cancel), progress: Some(&|p| talker.progress(p)), ..Control::default() },
        )
    };
    let most = spps.last().copied().unwrap_or(1);
    let (reference, facts) = match read {
        Some(reference) => {
            let facts = ReferenceFacts {
                file: args.reference.as_ref().map(|p| p.display().to_string()),
                spp: None,
                noise_floor: reference.noise_floor(),
            };
            (reference, facts)
        }
        None => {
            let spp = args.reference_spp.unwrap_or_else(|| most.saturating_mul(REFERENCE_FACTOR).max(256));
            talker.say(&format!(
                "rendering a reference of {spp} samples per pixel (name one with --reference)"
            ));
            let mut settings = base(&stage, true);
            // Far from the seeds that are measured: --seed upwards.
            settings.seed = args.film.seed ^ (1 << 40);
            settings.spp = spp;
            for change in configs.first().map_or(&[][..], |config| &config.changes) {
                change.apply(&mut settings);
            }
            settings.sampler = SamplerKind::Sobol;
            let rendered = render(&settings);
            talker.finish();
            if rendered.stop == Stop::Cancelled {
                return Err(Fail::new(
                    INTERRUPTED,
                    "interrupted while the reference was rendered: nothing to save",
                ));
            }
            let layers = stage.layers(&rendered, &picture_only());
            let reference = Reference::of_layers(&layers, "the reference")?.into_owned();
            let facts = ReferenceFacts {
                file: None,
                spp: Some(rendered.samples),
                noise_floor: reference.noise_floor(),
            };
            (reference, facts)
        }
    };
    if let Some(floor) = facts.noise_floor {
        talker.say(&format!(
            "the reference's own relMSE is about {floor:.2e}: the noise floor of plain relMSE"
        ));
    }

    let mut report = ErrorReport {
        schema: SCHEMA.to_owned(),
        generator: format!("hotspot-render {}", env!("CARGO_PKG_VERSION")),
        scene: stage.name.clone(),
        command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        resolution: [stage.width, stage.height],
        reference: facts,
        notes: notes(&reference, &configs, args),
        ..ErrorReport::default()
    };
    let mut last_picture = None;
    'all: for seed in 0..u64::from(args.seeds) {
        for spp in &spps {
            // In turns, and each seed begins with another one: a machine that drifts treats all alike.
            for turn in 0..configs.len() {
                let index = (turn + seed as usize) % configs.len();
                let config = &configs[index];
                let mut settings = base(&stage, args.intervals);
                settings.seed = args.film.seed.wrapping_add(seed);
                settings.spp = *spp;
                for change in &config.changes {
                    change.apply(&mut settings);
                }
                let rendered = render(&settings);
                if rendered.stop == Stop::Cancelled {
                    break 'all;
                }
                let layers = stage.layers(&rendered, &picture_only());
                let picture = Picture::of_layers(&layers, "the render")?;
                report.threads = rendered.threads as u32;
                report.runs.push(Run {
                    config: config.name.clone(),
                    seed: settings.seed,
                    spp: rendered.samples,
                    seconds: rendered.seconds,
                    process_seconds: before_sampling + rendered.seconds,
                    error: PictureError::of(&picture, &reference)?,
                    estimated_relmse: stage
                        .install(|| stats::estimated_relmse(&rendered.frame))
                        .map(|(value, _)| value),
                });
                if index == 0 && *spp == most {
                    last_picture = Some(picture.into_owned());
                }
            }
        }
    }
    talker.finish();
    let interrupted = cancel.load(Ordering::Relaxed);
    if report.runs.is_empty() {
        return Err(Fail::new(INTERRUPTED, "interrupted before the first measurement: nothing to save"));
    }
    if interrupted {
        report.notes.push("interrupted: not all runs that were asked for are here".into());
    }
    let names: Vec<String> = configs.iter().map(|c| c.name.clone()).collect();
    let targets: Vec<(String, f64)> = args.to.iter().map(|t| (t.text.clone(), t.value)).collect();
    report.summarise(&names, &targets);
    write(args, &talker, &report, last_picture.as_ref(), &reference)?;
    summary(&talker, &report);
    if interrupted {
        return Err(Fail::new(INTERRUPTED, format!("interrupted: saved {} runs", report.runs.len())));
    }
    Ok(())
}

/// Radiance alone, on the plain kernel.
fn base(stage: &Stage<'_>, intervals: bool) -> Settings {
    let mut settings = stage.settings();
    settings.gather = Gather::RADIANCE;
    settings.intervals = intervals;
    settings
}

fn picture_only() -> LayerOptions {
    LayerOptions { radiance: true, ..LayerOptions::default() }
}

/// All combinations of what varies.
fn configurations(vary: &[Vary]) -> Vec<Config> {
    let mut configs = vec![Vec::new()];
    for option in vary {
        configs = configs
            .into_iter()
            .flat_map(|changes: Vec<Change>| {
                option.values.iter().map(move |value| changes.iter().copied().chain([*value]).collect())
            })
            .collect();
    }
    configs
        .into_iter()
        .map(|changes| {
            let words: Vec<String> = changes.iter().map(|change| change.name()).collect();
            Config { name: if words.is_empty() { "default".into() } else { words.join(" ") }, changes }
        })
        .collect()
}

fn notes(reference: &Reference<'_>, configs: &[Config], args: &ErrorArgs) -> Vec<String> {
    let mut notes = Vec::new();
    if reference.halves().is_none() {
        notes.push(
            "the reference has no halves: relMSE holds its unknown noise on top, and slopes flatten there"
                .to_owned(),
        );
    }
    if args.reference.is_none() {
        notes.push(
            "the reference was rendered by this program: what it gets wrong everywhere does not show in the errors".to_owned(),
        );
    }
    let depths = configs.iter().flat_map(|c| &c.changes).filter(|c| matches!(c, Change::MaxDepth(_))).count();
    if depths > 0 {
        notes.push("max-depth varies: what a shallower depth leaves out counts as error".to_owned());
    }
    let samplers: Vec<_> =
        configs.iter().flat_map(|c| &c.changes).filter(|c| matches!(c, Change::Sampler(_))).collect();
    if samplers.len() > 1 {
        notes.push(
            "sampler varies: only paths of sobol points can go eight at a time, so seconds compare that as well"
                .to_owned(),
        );
    }
    if !cfg!(feature = "flip") {
        notes.push(
            "flip is null: this program was built without the feature flip, which needs a C++ compiler"
                .to_owned(),
        );
    }
    notes
}

fn write(
    args: &ErrorArgs,
    talker: &Talker,
    report: &ErrorReport,
    picture: Option<&Picture<'_>>,
    reference: &Reference<'_>,
) -> Result<(), Fail> {
    let path = |name: &str| args.output.join(name);
    let plot = plot(report);
    let texts = [
        ("error.json", report.to_json(), "all runs and what follows from them"),
        ("error.csv", report.to_csv(), "the runs as a table"),
        ("error.svg", plot.svg(), "error against seconds"),
    ];
    for (name, text, what) in texts {
        write_atomic(&path(name), text.as_bytes())?;
        talker.say(&format!("wrote {}: {what}", path(name).display()));
    }
    write_png(&path("error.png"), &plot.picture())?;
    talker.say(&format!("wrote {}: the same as a picture", path("error.png").display()));
    if let Some(picture) = picture {
        let errors: Vec<f32> =
            error_by_pixel(picture, reference.mean())?.iter().map(|e| e.sqrt() as f32).collect();
        let options = HeatOptions {
            label: "Relative error".into(),
            unit: "|I - R| / sqrt(R^2 + 0.01)".into(),
            ..HeatOptions::default()
        };
        let (width, height) = picture.size();
        write_png(&path("error.map.png"), &heat_map(width, height, &errors, &options).image)?;
        let what = "where the error is, at the most samples";
        talker.say(&format!("wrote {}: {what}", path("error.map.png").display()));
    }
    Ok(())
}

fn plot(report: &ErrorReport) -> LogPlot {
    LogPlot {
        title: format!(
            "{}, {} x {}, {} threads: medians of {} seeds",
            report.scene,
            report.resolution[0],
            report.resolution[1],
            report.threads,
            report.runs.iter().map(|r| r.seed).collect::<std::collections::BTreeSet<_>>().len()
        ),
        x_label: "seconds of sampling".into(),
        y_label: "relMSE (line: slope -1)".into(),
        curves: report
            .configs
            .iter()
            .map(|config| Curve {
                name: config.config.clone(),
                points: config
                    .points
                    .iter()
                    .map(|p| (p.seconds.value, p.error.value, p.error.interval))
                    .collect(),
            })
            .collect(),
        level: report.reference.noise_floor.map(|floor| (floor, "the reference's own noise".to_owned())),
        guide: Some(-1.0),
    }
}

fn summary(talker: &Talker, report: &ErrorReport) {
    for config in &report.configs {
        // With few seeds no interval of order statistics covers 95 %: the widest is given, and what it covers is said.
        let intervals = match config.points.first() {
            Some(point) if point.error.coverage > 0.0 => {
                let percent = 100.0 * point.error.coverage;
                format!(" medians of the seeds, with their {percent:.0} % intervals")
            }
            _ => " one seed".to_owned(),
        };
        talker.say(&format!("{}:{intervals}", config.config));
        for point in &config.points {
            talker.say(&format!(
                "  {:>6} spp  {:>9.3} s  relMSE {:.3e} ({:.3e} to {:.3e})",
                point.spp,
                point.seconds.value,
                point.error.value,
                point.error.interval[0],
                point.error.interval[1]
            ));
        }
        if let Some(slope) = config.slope {
            let interval = slope.ci95.map_or(String::new(), |[lo, hi]| format!(" ({lo:.3} to {hi:.3})"));
            talker.say(&format!("  slope {:.3}{interval}", slope.value));
        }
        for (target, middle) in &config.seconds_to {
            match middle {
                Some(m) => talker.say(&format!(
                    "  {:.3} s to relMSE {target} ({:.3} to {:.3})",
                    m.value, m.interval[0], m.interval[1]
                )),
                None => {
                    let why = config.seconds_to_notes.get(target).map_or("", String::as_str);
                    talker.say(&format!("  relMSE {target}: {why}"));
                }
            }
        }
    }
    let interval =
        |ci: Option<[f64; 2]>| ci.map_or(String::new(), |[lo, hi]| format!(" ({lo:.3} to {hi:.3})"));
    for ratio in &report.ratios {
        let errors: Vec<String> = ratio
            .error
            .iter()
            .map(|(spp, e)| format!("{:.3}{} at {spp} spp", e.value, interval(e.ci95)))
            .collect();
        talker.say(&format!("{} / {}: error {}", ratio.config, ratio.to, errors.join(", ")));
        for (target, estimate) in &ratio.seconds_to {
            if let Some(e) = estimate {
                talker.say(&format!("  seconds to relMSE {target}: {:.3}{}", e.value, interval(e.ci95)));
            }
        }
    }
    for note in &report.notes {
        talker.say(&format!("note: {note}"));
    }
}

fn parse_target(text: &str) -> Result<Target, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(Target { text: text.trim().to_owned(), value }),
        _ => Err("write positive errors such as 1e-2,1e-3".into()),
    }
}

fn parse_vary(text: &str) -> Result<Vary, String> {
    const OPTIONS: [&str; 3] = ["sampler", "roulette", "max-depth"];
    let Some((option, values)) = text.split_once('=') else {
        return Err("write an option and its values, such as sampler=independent,sobol".into());
    };
    let parse = |value: &str| -> Result<Change, String> {
        match option {
            "sampler" => match value {
                "sobol" => Ok(Change::Sampler(SamplerKind::Sobol)),
                "independent" => Ok(Change::Sampler(SamplerKind::Independent)),
                _ => Err(format!("there is no sampler \"{value}\"; there are sobol and independent")),
            },
            "roulette" => {
                parse_roulette(value).map(Change::Roulette).map_err(|e| format!("roulette={value}: {e}"))
            }
            "max-depth" => value
                .parse()
                .map(Change::MaxDepth)
                .map_err(|_| format!("max-depth={value}: write a whole number")),
            _ => {
                let hint = nearest(option, OPTIONS).map_or(String::new(), |n| format!("; did you mean {n}?"));
                Err(format!("{option} cannot vary here{hint} ({} can)", OPTIONS.join(", ")))
            }
        }
    };
    let values = values.split(',').map(|value| parse(value.trim())).collect::<Result<Vec<_>, _>>()?;
    for (i, value) in values.iter().enumerate() {
        if values[..i].contains(value) {
            return Err(format!("{} is there twice", value.name()));
        }
    }
    Ok(Vary { values })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_varies_is_checked() {
        let names = |words: &[&str]| -> Vec<String> {
            let vary: Vec<Vary> = words.iter().map(|w| parse_vary(w).unwrap()).collect();
            configurations(&vary).into_iter().map(|c| c.name).collect()
        };
        assert_eq!(names(&[]), ["default"]);
        assert_eq!(names(&["sampler=independent,sobol"]), ["sampler=independent", "sampler=sobol"]);
        assert_eq!(
            names(&["roulette=off,4,efficient", "max-depth=3"]),
            ["roulette=off max-depth=3", "roulette=4 max-depth=3", "roulette=efficient max-depth=3"]
        );
        for wrong in [
            "sampler",
            "sampler=",
            "sampler=halton",
            "sampelr=sobol",
            "roulette=x",
            "max-depth=-1",
            "sampler=sobol,sobol",
        ] {
            assert!(parse_vary(wrong).is_err(), "{wrong}");
        }
        assert!(parse_vary("sampelr=sobol").unwrap_err().contains("did you mean sampler"));
        assert!(parse_target("0").is_err() && parse_target("nan").is_err() && parse_target("1e-3").is_ok());
    }
}
