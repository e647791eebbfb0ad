//! What can be said on the command line.

use crate::commands::calibrate::CalibrateArgs;
use crate::commands::error::ErrorArgs;
use crate::commands::predict::PredictArgs;
use crate::fail::Fail;
use crate::open::SceneArgs;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use hotspot_cost::calibration::Profile;
use hotspot_cost::maps::{ColorMap, Exposure, Scale};
use hotspot_cost::{CostModel, MetricSet};
use hotspot_integrator::{LightChoice, Roulette, SamplerKind};
use std::ffi::OsString;
use std::path::PathBuf;

const EXAMPLES: &str = "\
All options of a render (--size, --spp, --intervals, --camera, --env, --metrics, --time-limit, --threads, …):
  hotspot-render render --help

Examples:
  hotspot-render --demo                            a built-in scene: picture, heat maps and report in seconds
  hotspot-render scene.gltf                        the same for a scene of yours, into hotspot-out/
  hotspot-render scene.glb --size 640x360 --spp 16 -o out
  hotspot-render scene.gltf --camera \"Kitchen\" --intervals
  hotspot-render compare before.exr after.exr      what a change did to the cost, with intervals
  hotspot-render compare a.exr b.exr --fail-over nodes=2%
  hotspot-render error scene.gltf --vary sampler=independent,sobol      seconds against error, side by side
  hotspot-render whatif scene.gltf --matte Mirror   what that change would save, with intervals
  hotspot-render report other-renderer.exr         maps and page from any EXR with cost.* channels";

/// A path tracer that shows what every pixel of a scene costs, and why.
#[derive(Debug, Parser)]
#[command(
    name = "hotspot-render",
    version,
    override_usage = "hotspot-render [render] SCENE [OPTIONS]\n       hotspot-render --demo\n       hotspot-render <COMMAND> …",
    after_help = EXAMPLES,
    arg_required_else_help = true
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene and what it costs (the default: `hotspot-render SCENE` does)
    Render(Box<RenderArgs>),
    /// Show what changed in cost from one render to another
    Compare(CompareArgs),
    /// Make maps and the page from an EXR file with cost.* channels
    Report(ReportArgs),
    /// Measure speed against error
    Error(Box<ErrorArgs>),
    /// Find what nodes, triangles and the rest cost on this machine, in nanoseconds
    Calibrate(Box<CalibrateArgs>),
    /// Say what a render will count and how long it will take
    Predict(Box<PredictArgs>),
    /// Put the cost where rays land onto the surfaces, as glTF for any viewer
    Bake(Box<crate::commands::bake::BakeArgs>),
    /// Measure what a change of the scene would do to its cost
    Whatif(Box<crate::commands::whatif::WhatIfArgs>),
}

/// The names of the commands, `help` last.
fn command_names() -> Vec<String> {
    let command = Cli::command();
    let names = command.get_subcommands().map(|c| c.get_name().to_owned());
    names.filter(|name| name != "help").chain(["help".to_owned()]).collect()
}

/// Inserts `render` where no command is named, and answers mistyped commands.
pub(crate) fn with_default_command(mut words: Vec<OsString>) -> Result<Vec<OsString>, Fail> {
    let Some(first) = words.get(1) else { return Ok(words) };
    let text = first.to_string_lossy().into_owned();
    let commands = command_names();
    let global = ["-h", "--help", "-V", "--version"];
    if commands.contains(&text) || (global.contains(&text.as_str()) && words.len() == 2) {
        return Ok(words);
    }
    let is_file = std::path::Path::new(first).exists() || text.contains(['.', '/', '\\']);
    if !text.starts_with('-') && !is_file {
        let near = nearest(&text, commands.iter().map(String::as_str));
        return Err(Fail::usage(match near {
            Some(near) => {
                format!("there is no command or scene file named \"{text}\"; did you mean \"{near}\"?")
            }
            None => format!(
                "there is no command or scene file named \"{text}\"; commands are {}, anything else is a scene file",
                commands.join(", ")
            ),
        }));
    }
    words.insert(1, "render".into());
    Ok(words)
}

/// The name most like `text`, if any is like it.
pub(crate) fn nearest<'n>(text: &str, names: impl IntoIterator<Item = &'n str>) -> Option<&'n str> {
    names
        .into_iter()
        .map(|name| (strsim::jaro_winkler(&text.to_lowercase(), &name.to_lowercase()), name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// Unit of `intersection` and `waste` where a profile gives c0 and c1.
pub(crate) const CALIBRATED_UNIT: &str = "ns of traversal per path, calibrated";

/// `render`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    /// Camera samples per pixel [default: 64; 32 for --demo]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: Option<u32>,
    /// Count the cost on the first K samples of each pixel only; the rest run uninstrumented (and unclocked in most scenes, where
    /// uncounted paths go eight at a time)
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) cost_spp: Option<u32>,
    /// Keep two independent halves of the samples, for confidence intervals
    #[arg(long)]
    pub(crate) intervals: bool,
    /// Measure tree noise over K further trees, for the intervals of later comparisons
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub(crate) tree_noise: Option<u32>,
    /// What to measure: all, none, names, or the groups rays, intersection, time, shading, cause, ledgers
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub(crate) metrics: String,
    /// Measure the cost alone, without a picture; with `--metrics rays` shadow rays are counted but not traced
    #[arg(long)]
    pub(crate) no_radiance: bool,
    /// Cost of visiting a node in `intersection`
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = parse_weight)]
    pub(crate) c0: f64,
    /// Cost of testing a triangle in `intersection`
    #[arg(long, value_name = "Y", default_value_t = 1.0, value_parser = parse_weight)]
    pub(crate) c1: f64,
    /// Take c0 and c1 from a file of `calibrate`: `intersection` in nanoseconds
    #[arg(long, value_name = "FILE", conflicts_with_all = ["c0", "c1"])]
    pub(crate) profile: Option<PathBuf>,
    /// Stop after about so many seconds and keep what was done
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    pub(crate) time_limit: Option<f64>,
    /// Stop once the picture's estimated relative squared error is at most this: with --intervals about right (measured: 6 % too small
    /// to 8 % too large on five scenes of 256 x 256 pixels or so, up to 19 % too large at 96 x 72), an upper bound without
    ///
    /// Asked after 8, 10, 12, 14, 16, 20, … samples per pixel; --spp is the most [default: 65536]. The error is that of noise, the
    /// mean over pixels of (I - R)²/(R² + 0.01): it knows nothing of light that no sample has found yet (a caustic, a lamp
    /// behind a slit), nor of what the depth limit cuts; where the edge of a lamp fills much of a very small picture it can be
    /// off by a factor of two.
    #[arg(long, value_name = "E", value_parser = parse_error, conflicts_with_all = ["adaptive", "no_radiance"])]
    pub(crate) target_error: Option<f64>,
    /// Further layers in the EXR: var (upper bounds of the variances), aov (albedo, normal, depth and Cryptomatte)
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',')]
    pub(crate) layers: Vec<LayersArg>,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

/// The film and the paths that end on it.
#[derive(Clone, Debug, Args)]
pub(crate) struct FilmArgs {
    /// Size in pixels [default: 960 on the long edge, at the camera's aspect; 640 for --demo]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Most scattering events of a path: 0 shows emitters only, 1 adds direct light
    #[arg(long, value_name = "N", default_value_t = 15)]
    pub(crate) max_depth: u32,
    /// Surface vertex (from 0) at which Russian roulette begins, "off", or "efficient": as likely as pays (beyond the paper)
    #[arg(long, value_name = "N|off|efficient", default_value = "4", value_parser = parse_roulette)]
    pub(crate) roulette: Roulette,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Sample points
    #[arg(long, value_enum, default_value_t = SamplerArg::Sobol)]
    pub(crate) sampler: SamplerArg,
    /// Give noisy pixels more samples and others fewer (from 16 on); --spp is then the mean
    #[arg(long)]
    pub(crate) adaptive: bool,
    /// How lights are chosen
    #[arg(long, value_enum, default_value_t = LightsArg::Power)]
    pub(crate) lights: LightsArg,
    /// Worker threads [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
}

/// How pictures are drawn.
#[derive(Debug, Args)]
pub(crate) struct ViewArgs {
    /// Exposure of the picture in stops, or "auto"
    #[arg(long, value_name = "EV|auto", default_value = "auto", value_parser = parse_exposure, allow_hyphen_values = true)]
    pub(crate) exposure: Exposure,
    /// Which heat maps to write as PNG: the three of the first screen, or all
    #[arg(long, value_enum, default_value_t = MapsArg::Main)]
    pub(crate) maps: MapsArg,
    /// Colours of the heat maps
    #[arg(long, value_enum, default_value_t = ColorArg::Inferno)]
    pub(crate) colors: ColorArg,
    /// Fixed range of the heat maps, or the JSON of another render whose ranges to use
    #[arg(long, value_name = "LO:HI|FILE", value_parser = parse_scale)]
    pub(crate) scale: Option<ScaleArg>,
}

/// How to report progress.
#[derive(Debug, Args)]
pub(crate) struct TalkArgs {
    /// Print nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Progress as JSON lines on standard error
    #[arg(long, conflicts_with = "quiet")]
    pub(crate) json_progress: bool,
}

/// `compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// The render to compare with
    pub(crate) a: PathBuf,
    /// The render to judge: red is where it is costlier
    pub(crate) b: PathBuf,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    /// Exit with code 3 when a metric grew significantly by more than this
    #[arg(long, value_name = "METRIC=X%")]
    pub(crate) fail_over: Vec<String>,
    /// Compare although tree width, builder or kernel differ
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    /// Print nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// An EXR file with cost.* channels
    pub(crate) input: PathBuf,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    /// JSON file that names channels: {"cost.nodes": "bvh.visits", …}
    #[arg(long, value_name = "FILE")]
    pub(crate) channels: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    /// Print nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SamplerArg {
    /// Owen-scrambled Sobol
    Sobol,
    /// Independent random numbers, for comparison
    Independent,
}

impl SamplerArg {
    pub(crate) const fn kind(self) -> SamplerKind {
        match self {
            Self::Sobol => SamplerKind::Sobol,
            Self::Independent => SamplerKind::Independent,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LightsArg {
    /// Half by power, half evenly by object
    Power,
    /// By how they face each point, and an environment by where it was found to be seen from
    Learned,
}

impl LightsArg {
    pub(crate) const fn choice(self) -> LightChoice {
        match self {
            Self::Power => LightChoice::Power,
            Self::Learned => LightChoice::Learned,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MapsArg {
    /// Rays, intersection and time
    Main,
    /// Every metric
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LayersArg {
    /// Upper bounds of the variances
    Var,
    /// What the camera sees first: albedo, normal, depth, Cryptomatte of objects and materials
    Aov,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColorArg {
    Inferno,
    Viridis,
    Turbo,
}

impl ColorArg {
    pub(crate) const fn map(self) -> ColorMap {
        match self {
            Self::Inferno => ColorMap::Inferno,
            Self::Viridis => ColorMap::Viridis,
            Self::Turbo => ColorMap::Turbo,
        }
    }
}

/// Where the range of a heat map comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ScaleArg {
    Fixed(f32, f32),
    File(PathBuf),
}

impl RenderArgs {
    /// The metrics asked for.
    pub(crate) fn metric_set(&self) -> Result<MetricSet, Fail> {
        MetricSet::parse(&self.metrics).map_err(|unknown| {
            let near = nearest(&unknown.name, MetricSet::names());
            let hint = near.map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
            Fail::usage(format!("--metrics: {unknown}{hint}"))
        })
    }

    /// Camera samples per pixel.
    pub(crate) fn samples(&self) -> u32 {
        self.spp.unwrap_or(match (self.target_error, self.open.demo) {
            (Some(_), _) => 65536,
            (None, true) => 32,
            (None, false) => 64,
        })
    }

    /// The constants of equation 1; a profile brings its own.
    pub(crate) fn cost_model(&self, profile: Option<&Profile>) -> CostModel {
        profile.map_or(CostModel { c0: self.c0, c1: self.c1 }, |p| p.intersection.model())
    }
}

impl ScaleArg {
    pub(crate) const fn fixed(lo: f32, hi: f32) -> Scale {
        Scale::Fixed(lo, hi)
    }
}

pub(crate) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match parsed {
        Some((w @ 1..=65536, h @ 1..=65536)) => Ok((w, h)),
        _ => Err("write width x height such as 640x360, each from 1 to 65536".into()),
    }
}

pub(crate) fn parse_roulette(text: &str) -> Result<Roulette, String> {
    match text {
        "off" => Ok(Roulette::Off),
        "efficient" => Ok(Roulette::Efficient),
        _ => text
            .parse()
            .map(Roulette::From)
            .map_err(|_| "write a vertex index such as 4, off, or efficient".into()),
    }
}

pub(crate) fn parse_weight(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("write a number that is not negative".into()),
    }
}

fn parse_error(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("write a positive error such as 1e-3".into()),
    }
}

pub(crate) fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x <= 1e9 => Ok(x),
        _ => Err("write a positive number of seconds".into()),
    }
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    match text.parse::<f32>() {
        Ok(ev) if ev.abs() <= 30.0 => Ok(Exposure::Ev(ev)),
        _ => Err("write a number of stops from -30 to 30 such as -1.5, or auto".into()),
    }
}

fn parse_scale(text: &str) -> Result<ScaleArg, String> {
    if let Some((lo, hi)) = text.split_once(':')
        && let (Ok(lo), Ok(hi)) = (lo.parse::<f32>(), hi.parse::<f32>())
    {
        return if lo.is_finite() && hi.is_finite() && lo < hi {
            Ok(ScaleArg::Fixed(lo, hi))
        } else {
            Err("the lower end must be below the upper end".into())
        };
    }
    Ok(ScaleArg::File(text.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<OsString> {
        line.split(' ').map(Into::into).collect()
    }

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn render_is_the_default_command() {
        let inserted = with_default_command(words("hotspot-render scene.gltf --spp 4")).unwrap();
        assert_eq!(inserted[1], "render");
        let kept = with_default_command(words("hotspot-render compare a.exr b.exr")).unwrap();
        assert_eq!(kept[1], "compare");
        assert_eq!(with_default_command(words("hotspot-render --demo")).unwrap()[1], "render");
        assert_eq!(with_default_command(words("hotspot-render --help")).unwrap()[1], "--help");
    }

    #[test]
    fn mistyped_commands_are_answered() {
        let fail = with_default_command(words("hotspot-render comapre a.exr b.exr")).unwrap_err();
        assert!(fail.message.contains("did you mean \"compare\""), "{}", fail.message);
        assert_eq!(fail.code, crate::fail::USAGE);
    }

    #[test]
    fn values_are_checked() {
        assert_eq!(parse_size("640x360"), Ok((640, 360)));
        assert!(parse_size("640").is_err() && parse_size("0x4").is_err() && parse_size("1x99999").is_err());
        assert!(parse_weight("-1").is_err() && parse_weight("nan").is_err());
        assert_eq!(parse_scale("0:5"), Ok(ScaleArg::Fixed(0.0, 5.0)));
        assert!(parse_scale("5:0").is_err());
        assert_eq!(parse_exposure("-1.5"), Ok(Exposure::Ev(-1.5)));
    }
}
