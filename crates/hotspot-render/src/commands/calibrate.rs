//! `calibrate`: what a node, a triangle, a BSDF evaluation … cost on this machine, in nanoseconds.
//!
//! Each scene is counted once and timed several times without counting, with the same seed: results are the same bit for bit
//! with counting on or off, so that counts and times belong to the same paths. The timed runs of all scenes take turns.

use crate::args::{FilmArgs, TalkArgs};
use crate::fail::{FAILED, Fail, INTERRUPTED};
use crate::interrupt;
use crate::open::{SceneArgs, default_size};
use crate::progress::Talker;
use crate::stage::Stage;
use clap::Args;
use hotspot_cost::calibration::{
    Fit, Form, Machine, PROFILE_SCHEMA, Profile, SceneProfile, TILE, Tiles, Timings, fit, held_out,
    repeat_r2, scene_held_out, score, traversal,
};
use hotspot_cost::maps::{ColorMap, HeatOptions, Scale, heat_map, write_atomic, write_png};
use hotspot_integrator::{Control, Gather, Rendered, Settings, Stop};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// `calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Further scenes
    #[arg(value_name = "SCENE")]
    pub(crate) more: Vec<PathBuf>,
    /// The profile to write, for `render --profile` and `predict --profile`
    #[arg(long, value_name = "FILE", default_value = "hotspot-profile.json")]
    pub(crate) profile: PathBuf,
    /// Folder for the maps of what the fits leave
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    /// Timed runs of each scene
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(4..=1000))]
    pub(crate) repeats: u32,
    /// Camera samples per pixel of each run
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: u32,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// Pixels on the long edge of the runs.
const LONG_EDGE: f64 = 320.0;

/// One scene under way.
struct Subject<'a> {
    name: String,
    stage: Stage<'a>,
    settings: Settings,
    counted: Rendered,
    timings: Timings,
    kernel: String,
}

pub(crate) fn run(args: &CalibrateArgs) -> Result<(), Fail> {
    let talker = Talker::new(&args.talk);
    make_folder(&args.output)?;
    // An unwritable profile should not cost the runs.
    let folder = args.profile.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::tempfile_in(folder).map_err(|e| {
        Fail::new(
            FAILED,
            format!(
                "cannot write into the folder of {}: {e}; name another file with --profile",
                args.profile.display()
            ),
        )
    })?;
    let opens: Vec<SceneArgs> = std::iter::once(args.open.clone())
        .chain(args.more.iter().map(|file| SceneArgs {
            file: Some(file.clone()),
            demo: false,
            ..args.open.clone()
        }))
        .collect();
    let cancel = interrupt::flag();
    let control = Control { cancel: Some(cancel), progress: None, ..Control::default() };
    let mut subjects = Vec::new();
    for open in &opens {
        let subject = Subject::new(open, args, control, &talker)?;
        subjects.push(subject);
    }
    tell_names_apart(&mut subjects);
    let start = Instant::now();
    for repeat in 0..args.repeats {
        for subject in &mut subjects {
            subject.time(control)?;
        }
        talker.say(&format!(
            "timed run {} of {}, {:.0} s",
            repeat + 1,
            args.repeats,
            start.elapsed().as_secs_f64()
        ));
    }
    let tiles = subjects
        .iter()
        .map(|s| s.timings.tiles(&s.counted.frame).map_err(|e| Fail::new(FAILED, format!("{}: {e}", s.name))))
        .collect::<Result<Vec<Tiles>, Fail>>()?;
    let mut profile = profile(args, &subjects, &tiles);
    for (index, (subject, tiles)) in subjects.iter().zip(&tiles).enumerate() {
        let file = args.output.join(format!("{}.calibrate.residual.png", subject.name));
        draw_residuals(&file, subject, tiles)?;
        talker.say(&format!("wrote {}: what the full fit leaves", file.display()));
        profile.scenes[index].residual_map =
            file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    }
    write_atomic(&args.profile, profile.to_json().as_bytes())?;
    talker.say(&format!("wrote {}: the profile", args.profile.display()));
    summarise(&talker, &profile);
    Ok(())
}

/// Reads a profile for another command.
pub(crate) fn read_profile(path: &Path) -> Result<Profile, Fail> {
    let place = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|e| {
        Fail::new(FAILED, format!("--profile: cannot read {place}: {e}; make one with calibrate"))
    })?;
    Ok(Profile::from_json(&text, &place)?)
}

impl<'a> Subject<'a> {
    /// Opens and counts a scene; counting also warms caches up.
    fn new(
        open: &'a SceneArgs,
        args: &'a CalibrateArgs,
        control: Control<'_>,
        talker: &Talker,
    ) -> Result<Self, Fail> {
        let scene = open.load()?;
        let mut stage = Stage::new(&scene, open, &args.film)?;
        drop(scene);
        if args.film.size.is_none() {
            (stage.width, stage.height) = default_size(&stage.camera, LONG_EDGE);
        }
        if stage.width < TILE || stage.height < TILE {
            return Err(Fail::usage(format!(
                "--size {}x{}: time is fitted to tiles of {TILE} x {TILE} pixels; make the picture at least that large",
                stage.width, stage.height
            )));
        }
        stage.check_memory(false, 2)?;
        stage.announce(talker);
        let mut settings = stage.settings();
        settings.spp = args.spp;
        settings.gather = Gather { time: false, ..Gather::ALL };
        let counted = stage.render(&settings, control);
        unless_cancelled(&counted)?;
        settings.gather = Gather { cost: false, time: true, ..Gather::ALL };
        let timings = Timings::new(stage.width, stage.height);
        Ok(Self {
            name: stage.name.clone(),
            kernel: counted.kernel.clone(),
            stage,
            settings,
            counted,
            timings,
        })
    }

    fn time(&mut self, control: Control<'_>) -> Result<(), Fail> {
        // The caches hold the scene whose turn it was: unwarmed, the first tiles of each thread took up to three times as long in
        // every repeat, which no count explains.
        let mut warm = self.settings.clone();
        warm.spp = 1;
        unless_cancelled(&self.stage.render(&warm, control))?;
        let timed = self.stage.render(&self.settings, control);
        unless_cancelled(&timed)?;
        Ok(self.timings.add(&timed.frame)?)
    }
}

fn unless_cancelled(rendered: &Rendered) -> Result<(), Fail> {
    match rendered.stop {
        Stop::Cancelled => Err(Fail::new(INTERRUPTED, "interrupted: nothing was saved")),
        _ => Ok(()),
    }
}

fn make_folder(folder: &Path) -> Result<(), Fail> {
    std::fs::create_dir_all(folder).map_err(|e| {
        Fail::new(FAILED, format!("cannot make the folder {}: {e}; choose another with -o", folder.display()))
    })
}

/// Scenes of one name get numbers, since files are named after them.
fn tell_names_apart(subjects: &mut [Subject<'_>]) {
    let names: Vec<String> = subjects.iter().map(|s| s.name.clone()).collect();
    for (index, subject) in subjects.iter_mut().enumerate() {
        let before = names[..index].iter().filter(|name| **name == subject.name).count();
        if before > 0 {
            subject.name = format!("{}-{}", subject.name, before + 1);
        }
    }
}

fn profile(args: &CalibrateArgs, subjects: &[Subject<'_>], tiles: &[Tiles]) -> Profile {
    let all: Vec<&Tiles> = tiles.iter().collect();
    let pooled = Form::ALL.map(|form| (form, held_out(&all, form)));
    let scenes = subjects.iter().zip(tiles).enumerate().map(|(index, (subject, tiles))| SceneProfile {
        scene: subject.name.clone(),
        kernel: subject.kernel.clone(),
        resolution: [subject.settings.width, subject.settings.height],
        samples_per_pixel: subject.counted.samples.into(),
        repeats: args.repeats,
        drift: tiles.drift.clone(),
        tiles: tiles.tiles.len() as u64,
        mean_ns: tiles.mean_ns(),
        repeat_r2: repeat_r2(tiles),
        fits: Form::ALL.map(|form| (form, fit(&[tiles], form))).into(),
        pooled: pooled.iter().map(|(form, predicted)| (*form, score(tiles, &predicted[index]))).collect(),
        from_other_scenes: Form::ALL
            .iter()
            .map(|form| (*form, scene_held_out(&all, index, *form)))
            .filter(|(_, predicted)| !predicted.is_empty())
            .map(|(form, predicted)| (form, score(tiles, &predicted)))
            .collect(),
        residual_map: String::new(),
    });
    let mut kernels: Vec<String> = subjects.iter().map(|s| s.kernel.clone()).collect();
    kernels.sort();
    kernels.dedup();
    let mut settings = subjects[0].stage.described(&subjects[0].settings);
    settings.retain(|name, _| name != "camera");
    settings.insert("repeats".into(), json!(args.repeats));
    Profile {
        schema: PROFILE_SCHEMA.into(),
        generator: format!("hotspot-render {}", env!("CARGO_PKG_VERSION")),
        command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        machine: machine(),
        threads: subjects[0].counted.threads as u32,
        kernels,
        settings,
        tile: TILE,
        intersection: traversal(&all),
        fits: Form::ALL.map(|form| (form, fit(&all, form))).into(),
        scenes: scenes.collect(),
    }
}

/// This computer, as far as the system tells.
fn machine() -> Machine {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    Machine {
        cpu: cpu.map_or_else(String::new, |(_, name)| name.trim().to_owned()),
        processors: std::thread::available_parallelism().map_or(0, |n| n.get() as u32),
        system: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
    }
}

/// Measured less predicted time of each tile, over the mean: red is where tiles took longer than the fit to the others says.
fn draw_residuals(file: &Path, subject: &Subject<'_>, tiles: &Tiles) -> Result<(), Fail> {
    let predicted = held_out(&[tiles], Form::Full).remove(0);
    let (width, height) = (tiles.columns * TILE, tiles.rows * TILE);
    let mean = tiles.mean_ns().max(f64::MIN_POSITIVE);
    let plane: Vec<f32> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (y / TILE * tiles.columns + x / TILE) as usize))
        .map(|i| (100.0 * (tiles.tiles[i].ns - predicted[i]) / mean) as f32)
        .collect();
    let options = HeatOptions {
        label: format!("{}: time that counts do not explain", subject.name),
        unit: "% of the mean time".into(),
        map: ColorMap::RedBlue,
        scale: Scale::default(),
        despike: false,
    };
    Ok(write_png(file, &heat_map(width, height, &plane, &options).image)?)
}

fn summarise(talker: &Talker, profile: &Profile) {
    let r2 = |fit: Option<&Fit>| {
        fit.and_then(|fit| fit.held_out?.r2).map_or("     -".into(), |r2| format!("{r2:6.3}"))
    };
    let number = |value: Option<f64>| value.map_or("     -".into(), |value| format!("{value:6.3}"));
    talker.say(&format!(
        "{:<28} {:>9}  R² held out: {:>6} {:>6} {:>6}  {:>9} {:>7}  pooled",
        "scene", "ns/path", "c0,c1", "+const", "full", "/ceiling", "NRMSE"
    ));
    for scene in &profile.scenes {
        let full = scene.fits.get(&Form::Full).and_then(|fit| fit.held_out).unwrap_or_default();
        talker.say(&format!(
            "{:<28} {:>9.1}  {:>12} {} {} {}  {:>9} {:>6.1} %  {}",
            shortened(&scene.scene, 28),
            scene.mean_ns,
            "",
            r2(scene.fits.get(&Form::Two)),
            r2(scene.fits.get(&Form::TwoConstant)),
            r2(scene.fits.get(&Form::Full)),
            number(full.r2_of_repeat),
            100.0 * full.nrmse,
            number(scene.pooled.get(&Form::Full).and_then(|s| s.r2)),
        ));
        if scene.repeat_r2.is_none_or(|r2| r2 < 0.975) {
            talker.warn(&format!(
                "note: {}: the timed runs differ so much that no model could explain more than {} of the variance; something \
                 else kept the machine busy, or there are too few samples: raise --spp or --repeats",
                scene.scene,
                number(scene.repeat_r2).trim()
            ));
        }
    }
    for form in [Form::Two, Form::Full] {
        let Some(fit) = profile.fits.get(&form) else { continue };
        let words: Vec<String> = fit
            .coefficients
            .iter()
            .filter(|(_, c)| c.ns > 0.0)
            .map(|(term, c)| format!("{} {} ({} to {})", term.name(), ns(c.ns), ns(c.ci95[0]), ns(c.ci95[1])))
            .collect();
        talker.say(&format!(
            "ns per event, {}: {}",
            if form == Form::Two { "two terms" } else { "all terms" },
            words.join(", ")
        ));
    }
    let t = &profile.intersection;
    talker.say(&format!(
        "intersection in nanoseconds of traversal: c0 = {} ({} to {}), c1 = {} ({} to {})",
        ns(t.c0.ns),
        ns(t.c0.ci95[0]),
        ns(t.c0.ci95[1]),
        ns(t.c1.ns),
        ns(t.c1.ci95[0]),
        ns(t.c1.ci95[1])
    ));
}

/// Three digits.
fn ns(value: f64) -> String {
    if value >= 99.95 {
        format!("{value:.0}")
    } else if value >= 9.995 {
        format!("{value:.1}")
    } else {
        format!("{value:.2}")
    }
}

fn shortened(text: &str, limit: usize) -> String {
    text.chars().take(limit).collect()
}
