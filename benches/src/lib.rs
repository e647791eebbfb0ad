//! What the benchmarks share: scenes, and the choices of metrics whose overhead is compared.
#![forbid(unsafe_code)]

pub mod scaling;
pub mod trace;

use hotspot_bvh::simd::Isa;
use hotspot_integrator::{
    BuildOptions, Control, Gather, RenderScene, Rendered, Settings, frame_bounds, render,
};
use hotspot_scene::Camera;
use std::path::{Path, PathBuf};

/// A prepared scene with its camera.
pub struct Subject {
    /// Name of the scene.
    pub name: String,
    /// The scene.
    pub scene: RenderScene,
    /// Its first camera, or one that frames it.
    pub camera: Camera,
}

/// The folder of this repository's scenes.
pub fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

/// Loads and prepares a scene file.
///
/// # Panics
/// When it cannot be loaded: a benchmark without its scene has no result.
pub fn subject(path: &Path) -> Subject {
    subject_under(path, Isa::Auto)
}

/// The same under a chosen instruction set.
///
/// # Panics
/// As [`subject`].
pub fn subject_under(path: &Path, isa: Isa) -> Subject {
    let scene = match hotspot_scene::load(path, &Default::default()) {
        Ok(scene) => scene,
        Err(e) => panic!("{e}"),
    };
    let prepared = match RenderScene::prepare(&scene, BuildOptions { isa, ..Default::default() }) {
        Ok(prepared) => prepared,
        Err(e) => panic!("{}: {e}", path.display()),
    };
    let (min, max) = prepared.bounds();
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
    Subject { name: scene.name, scene: prepared, camera }
}

/// A choice of what to gather.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// Name, after the `--metrics` that gives it.
    pub name: &'static str,
    /// What is gathered.
    pub gather: Gather,
    /// Two halves per pixel.
    pub intervals: bool,
    /// Count on so many samples only.
    pub cost_spp: Option<u32>,
    /// Book the counts by what sent and by what was met.
    pub ledgers: bool,
    /// Paths go eight at a time where the scene allows, and camera rays that are not counted in packets.
    pub packets: bool,
}

/// Path by path.
const fn single(name: &'static str, gather: Gather) -> Variant {
    Variant { name, gather, intervals: false, cost_spp: None, ledgers: false, packets: false }
}

/// As `render` does it.
const fn as_it_runs(name: &'static str, gather: Gather) -> Variant {
    Variant { packets: true, ..single(name, gather) }
}

/// Counting without the clock: the kernel behind `rays`, `intersection`, `shading` and `cause`, which differ only in what
/// they show.
const COUNTERS: Gather = Gather { time: false, ..Gather::ALL };
const CLOCK: Gather = Gather { cost: false, ..Gather::ALL };

/// A render that counts nothing: what uncounted samples cost.
pub const PLAIN: Variant = as_it_runs("none, as it runs", Gather::RADIANCE);

/// A render that counts, without the clock and without ledgers, path by path.
pub const COUNTING: Variant = single("rays, intersection, shading, cause", COUNTERS);

/// The same as it runs, and a render by default.
pub const COUNTING_AS_IT_RUNS: Variant = as_it_runs("rays … cause, as it runs", COUNTERS);
/// The same with the clock and ledgers.
pub const DEFAULT: Variant = Variant { ledgers: true, ..as_it_runs("all, as it runs", Gather::ALL) };

/// The metric groups, from none to everything. The first is the baseline: the very loop that the others run, path by path. Those that go eight at
/// a time where they can say that they are as it runs.
pub const VARIANTS: [Variant; 10] = [
    single("none, one ray at a time", Gather::RADIANCE),
    PLAIN,
    single("time", CLOCK),
    COUNTING,
    single("the same and time", Gather::ALL),
    Variant { ledgers: true, ..single("all: with ledgers", Gather::ALL) },
    Variant { ledgers: true, intervals: true, ..single("all, --intervals", Gather::ALL) },
    Variant { ledgers: true, cost_spp: Some(8), ..as_it_runs("--cost-spp 8, as it runs", Gather::ALL) },
    COUNTING_AS_IT_RUNS,
    DEFAULT,
];

/// Cost without the picture: the paper's shortcut (section 4) casts no shadow rays where ray counts are all that is asked
/// for; beside it the same counts with shadow rays traced.
pub const COST_ALONE: [Variant; 2] = [
    single(
        "rays, no radiance, shadow rays untraced",
        Gather { radiance: false, cost: true, time: false, trace_shadow_rays: false },
    ),
    single(
        "intersection, no radiance",
        Gather { radiance: false, cost: true, time: false, trace_shadow_rays: true },
    ),
];

/// Renders with a variant in the current rayon pool, depth 15.
pub fn run(subject: &Subject, size: u32, spp: u32, variant: &Variant) -> Rendered {
    let mut settings = Settings::new(size, size);
    settings.spp = spp;
    settings.gather = variant.gather;
    settings.intervals = variant.intervals;
    settings.cost_spp = variant.cost_spp;
    settings.ledgers = variant.ledgers;
    settings.packets = variant.packets;
    render(&subject.scene, &subject.camera, &settings, Control::default())
}
