//! Renders a prepared scene: waves of samples over all tiles, in the caller's thread pool.

use crate::adaptive::{Plan, pilot};
use crate::camera::FilmCamera;
use crate::kernel::{Kernel, Lost, NonFinite, TileJob};
use crate::lanes::LaneScene;
use crate::light::{Learned, Lessons};
use crate::path::PathSettings;
use crate::payers::Booking;
use crate::roulette::{Pilot, Roulette, Survival};
use crate::sampler::SamplerKind;
use crate::scene::RenderScene;
use hotspot_bvh::simd::{Isa, dispatch};
use hotspot_cost::ledger::{Ledger, Ledgers, Payers};
use hotspot_cost::{Frame, FrameDesc};
use hotspot_scene::Camera;
use rayon::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What to gather.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gather {
    /// The picture.
    pub radiance: bool,
    /// Counters.
    pub cost: bool,
    /// Time per pixel. Of paths that go one by one, one clock reading per visit of a pixel. Of paths that go eight at a time
    /// ([`Rendered::eights`]) the clock is read where they change from one pixel to others; what eight of several pixels take is shared in equal
    /// parts among them, so that with few samples per wave time is blurred over pixels beside each other. With [`Settings::cost_spp`], that of the
    /// counted samples alone where the others go eight at a time. Alone (without `cost`): of paths that go one by one.
    pub time: bool,
    /// Trace shadow rays. Off: they are counted only, which is right where ray counts alone are asked for and no radiance
    /// is (the paper's shortcut, section 4).
    pub trace_shadow_rays: bool,
}

impl Gather {
    /// Radiance and every cost.
    pub const ALL: Self = Self { radiance: true, cost: true, time: true, trace_shadow_rays: true };
    /// Radiance alone, on the plain kernel.
    pub const RADIANCE: Self = Self { radiance: true, cost: false, time: false, trace_shadow_rays: true };
}

/// How to render.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Settings {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Camera samples per pixel, at least 1; rounded up to an even number with intervals, so that both halves have as many.
    pub spp: u32,
    /// Count on the first so many samples of each pixel only (rounded up to even with intervals); `None`: on all.
    pub cost_spp: Option<u32>,
    /// Most scattering events of a path: 0 shows emitters only, 1 adds direct light.
    pub max_depth: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Two independently scrambled halves per pixel, for confidence intervals.
    pub intervals: bool,
    /// Sample points.
    pub sampler: SamplerKind,
    /// When Russian roulette may end a path.
    pub roulette: Roulette,
    /// What to gather.
    pub gather: Gather,
    /// Book what is counted by what sent it and by what it met.
    pub ledgers: bool,
    /// Share out three quarters of the samples by the noise that the first quarter shows, where there are at least 16.
    /// `spp` is then the mean. Unbiased; cost layers stay means per pixel, totals weigh pixels by their samples.
    pub adaptive: bool,
    /// How lights are chosen.
    pub light_choice: LightChoice,
    /// Stop after about this much time; at least one sample per pixel is taken.
    pub time_limit: Option<Duration>,
    /// Width over height of the film where its pixels are not square; `None`: width over height in pixels.
    pub aspect: Option<f64>,
    /// Samples per pixel of the first wave, at least 1; the result does not depend on it, but the time that a pixel's visits
    /// take does. `None`: 1 with a time limit, else [`Waves::first`].
    pub first_wave: Option<u32>,
    /// Trace camera rays that are not counted in packets where a scene's triangles are not much smaller than pixels, which is
    /// faster and gives the same hits; and whole paths eight at a time, which gives the same pictures and counts. (Each ray of a path that is
    /// counted searches the tree by itself, so that it has visits of its own.) False is for comparisons.
    pub packets: bool,
}

/// Triangles per pixel up to which packets are used: with many more, the samples of a pixel have little in common.
const PACKED: u64 = 8;

impl Settings {
    /// The defaults for a picture of this size: 64 samples, depth 15, everything gathered.
    pub const fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            spp: 64,
            cost_spp: None,
            max_depth: 15,
            seed: 0,
            intervals: false,
            sampler: SamplerKind::Sobol,
            roulette: Roulette::From(4),
            gather: Gather::ALL,
            ledgers: false,
            adaptive: false,
            light_choice: LightChoice::Power,
            time_limit: None,
            aspect: None,
            first_wave: None,
            packets: true,
        }
    }

    /// The camera with these settings' film: pixels are square unless they say otherwise.
    pub(crate) fn film_camera(&self, camera: &Camera) -> FilmCamera {
        let square = f64::from(self.width) / f64::from(self.height);
        FilmCamera::new(camera, self.aspect.unwrap_or(square))
    }

    /// What is learned about the scene before its first sample, where that is asked for and worth it. Without a camera nothing is.
    pub(crate) fn guides(&self, scene: &RenderScene, camera: Option<&FilmCamera>) -> Guides {
        let lessons = self.light_choice == LightChoice::Learned;
        let learned = camera.and_then(|camera| {
            Learned::new(scene, camera, self.seed, Lessons { facing: lessons, windows: lessons })
        });
        let survival = Survival::new(self.roulette, |roulette| {
            let pilot = Pilot {
                scene,
                camera: *camera?,
                size: (self.width, self.height),
                sampler: self.sampler,
                path: PathSettings {
                    max_depth: self.max_depth,
                    roulette,
                    trace_shadow_rays: true,
                    learned: learned.as_ref(),
                },
            };
            pilot.gain()
        });
        Guides { learned, survival }
    }

    /// What the path loop needs to know.
    pub(crate) fn path<'a>(&self, trace_shadow_rays: bool, guides: &'a Guides) -> PathSettings<'a> {
        PathSettings {
            max_depth: self.max_depth,
            roulette: guides.survival,
            trace_shadow_rays,
            learned: guides.learned.as_ref(),
        }
    }
}

/// What was learned before the first sample.
#[derive(Debug)]
pub(crate) struct Guides {
    learned: Option<Learned>,
    survival: Survival,
}

/// How light sampling chooses a light and a direction to it. Unbiased either way; what shadow rays cost depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LightChoice {
    /// Half by power, half evenly by object, so that no dim light nearby starves; a constant environment by the receiver's
    /// cosine.
    #[default]
    Power,
    /// By where it is asked from: emissive triangles by distance and by how they face the point, a constant environment by
    /// where rays were found to escape (walks before the first sample, counted in the render's seconds).
    Learned,
}

impl LightChoice {
    /// Name as shown in outputs and understood on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Power => "power",
            Self::Learned => "learned",
        }
    }
}

/// Where a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Camera samples taken, over all pixels.
    pub done: u64,
    /// Camera samples asked for, over all pixels.
    pub total: u64,
    /// Since the start of sampling.
    pub elapsed: Duration,
}

/// Reins on a running render.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// When it becomes true the render finishes its wave of samples and returns what it has.
    pub cancel: Option<&'a AtomicBool>,
    /// Called from worker threads after each tile.
    pub progress: Option<&'a (dyn Fn(Progress) + Sync)>,
    /// Asked with what there is after 8, 10, 12, 14, 16, 20, … samples per pixel (four times in each doubling) whether that is
    /// enough. Where it is asked does not depend on time, so neither does where the render ends. Not asked of adaptive renders.
    pub enough: Option<&'a (dyn Fn(&Frame) -> bool + Sync)>,
    /// Shown what there is between waves, a few times in a render (each time that the samples have doubled), for displays. Waves
    /// are what they are without it, and its time is not counted in [`Rendered::seconds`].
    pub watch: Option<&'a (dyn Fn(&Frame) + Sync)>,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// All samples were taken.
    Done,
    /// The time limit.
    TimeLimit,
    /// [`Control::enough`].
    Enough,
    /// [`Control::cancel`].
    Cancelled,
}

/// A finished render.
#[derive(Debug)]
pub struct Rendered {
    /// The sums.
    pub frame: Frame,
    /// The same booked by what sent and by what was met, where [`Settings::ledgers`] asks for it and anything is counted.
    pub ledgers: Option<Ledgers>,
    /// Camera samples per pixel, their mean under adaptive sampling.
    pub samples: u32,
    /// Why it ended.
    pub stop: Stop,
    /// Seconds of learning and sampling, without those spent in the hooks of [`Control`].
    pub seconds: f64,
    /// Of these, what was spent before the first sample: on lights and roulette that learn.
    pub learning_seconds: f64,
    /// Worker threads.
    pub threads: usize,
    /// Name of the kernel of paths that go one by one: tree, instruction set, scene class.
    pub kernel: String,
    /// Whether any paths went eight at a time: those of Sobol points; without AVX2 only
    /// paths that are not counted among few triangles.
    pub eights: bool,
    /// Samples whose radiance was not finite and counted as black, sorted; at most 64 per tile and wave are listed (which of more
    /// depends on the order in which they were taken).
    pub non_finite: Vec<NonFinite>,
    /// How many samples that happened to.
    pub non_finite_count: u64,
}

/// The ledgers that no worker holds at the moment: as many come into being as workers run at once.
#[derive(Default)]
pub(crate) struct Shelf(Mutex<Vec<Ledger>>);

impl Shelf {
    /// A worker that panicked took its ledger with it; the others are whole.
    fn open(&self) -> std::sync::MutexGuard<'_, Vec<Ledger>> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    pub(crate) fn take(&self, payers: &Payers) -> Ledger {
        let ledger = self.open().pop();
        ledger.unwrap_or_else(|| Ledger::new(payers))
    }

    pub(crate) fn put(&self, ledger: Ledger) {
        self.open().push(ledger);
    }

    pub(crate) fn sum(self, payers: &Payers) -> Ledger {
        let all = self.0.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        let sum = all.into_iter().reduce(|mut sum, ledger| {
            sum.merge(&ledger);
            sum
        });
        sum.unwrap_or_else(|| Ledger::new(payers))
    }
}

/// The first number above `done` of 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, …
const fn next_question(done: u64) -> u64 {
    if done < 8 {
        return 8;
    }
    let step = (1 << done.ilog2()) / 4;
    (done / step + 1) * step
}

/// How samples are split into waves: sized to take about a second, so that a render can be stopped and shows progress. Where counted samples
/// go eight at a time a wave may take three seconds to have some of each pixel: a visit of one has a cost of its own, and times are shared with
/// fewer others.
#[derive(Clone, Copy, Debug)]
pub struct Waves {
    /// Of the picture.
    pub pixels: u64,
    /// Samples per pixel in all.
    pub total: u64,
    /// Counted samples of a pixel that are worth a longer wave, where they go eight at a time.
    pub least: Option<u64>,
}

impl Waves {
    /// Of a half.
    const LEAST: u64 = 8;
    const SECONDS: f64 = 1.0;
    const MOST_SECONDS: f64 = 3.0;
    /// Samples of all pixels that a first wave of more than four may have: as many as hardly any scene takes many seconds for.
    const MOST_AT_FIRST: u64 = 1 << 21;

    /// Those of a render of so many pixels and samples of each. `eights`: whether counted paths go eight at a time in its scene
    /// ([`Rendered::eights`] says so).
    pub fn new(settings: &Settings, eights: bool) -> Self {
        let halves = if settings.intervals { 2 } else { 1 };
        let total = u64::from(settings.spp).next_multiple_of(halves);
        let counted =
            settings.cost_spp.map_or(total, |spp| total.min(u64::from(spp).next_multiple_of(halves)));
        let least = Some(Self::LEAST * halves);
        let least = least.filter(|least| eights && settings.gather.cost && counted >= *least);
        Self { pixels: u64::from(settings.width) * u64::from(settings.height), total, least }
    }

    /// Samples per pixel of the first wave of a render without a time limit.
    pub fn first(&self) -> u64 {
        match self.least {
            // No wave is left that has fewer.
            Some(least) if self.pixels * least <= Self::MOST_AT_FIRST => {
                if self.total < 2 * least {
                    self.total
                } else {
                    least
                }
            }
            _ => 4,
        }
    }

    /// Samples per pixel of another, one of which takes so many seconds over the picture.
    pub fn next(&self, seconds_per_sample: f64) -> u64 {
        // Float to integer saturates.
        let within = |seconds: f64| ((seconds / seconds_per_sample.max(1e-12)) as u64).max(1);
        let wave = within(Self::SECONDS);
        // Of twice the least, little is lost.
        self.least.map_or(wave, |least| wave.max(within(Self::MOST_SECONDS).min(2 * least)))
    }
}

/// Samples per pixel after which [`Control::watch`] looks first.
const FIRST_LOOK: u64 = 8;

/// Renders. Runs in the rayon pool of the caller; the result does not depend on the number of threads, nor on how the
/// samples are split into waves.
///
/// # Panics
/// When width, height or spp is 0.
pub fn render(scene: &RenderScene, camera: &Camera, settings: &Settings, control: Control<'_>) -> Rendered {
    render_somehow(scene, camera, settings, control, Way { tile: 16, portable_eights: false })
}

/// What does not show, and only tests ask for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    /// Edge of the tiles.
    pub(crate) tile: u32,
    /// Let paths go eight at a time without AVX2 too, wherever they can.
    pub(crate) portable_eights: bool,
}

/// The same in some way.
pub(crate) fn render_somehow(
    scene: &RenderScene,
    camera: &Camera,
    settings: &Settings,
    control: Control<'_>,
    way: Way,
) -> Rendered {
    assert!(settings.spp > 0, "no samples to take");
    let gather = settings.gather;
    let mut frame = Frame::new(FrameDesc {
        width: settings.width,
        height: settings.height,
        intervals: settings.intervals,
        cost: gather.cost || gather.time,
        tile: way.tile,
    });
    // Both halves always have as many samples.
    let halves = frame.halves() as u64;
    let whole = |samples: u32| u64::from(samples).next_multiple_of(halves);
    let booking = (settings.ledgers && gather.cost).then(|| Booking::new(scene));
    let shelf = Shelf::default();
    let start = Instant::now();
    let camera = settings.film_camera(camera);
    let guides = settings.guides(scene, Some(&camera));
    let learning_seconds = start.elapsed().as_secs_f64();
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    let total = whole(settings.spp);
    let path = settings.path(gather.trace_shadow_rays, &guides);
    // Not where time alone is asked for: its clock reads paths that go one by one.
    let counted = if gather.cost { whole(settings.cost_spp.unwrap_or(u32::MAX)) } else { 0 };
    let in_eights = settings.packets
        && settings.sampler == SamplerKind::Sobol
        && (gather.radiance || counted > 0)
        && gather.trace_shadow_rays
        && (!gather.time || counted > 0);
    let lanes = if in_eights { LaneScene::new(scene, &camera) } else { None };
    // Without vectors of eight, path by path is faster, unless all triangles are tried.
    let wide = scene.bvh.isa() == Isa::Avx2 || way.portable_eights;
    let lanes = lanes.filter(|lanes| wide || lanes.few.is_some());
    let kernel = Kernel {
        scene,
        camera,
        width: settings.width,
        height: settings.height,
        path,
        sampler: settings.sampler,
        seed: settings.seed,
        halves: frame.halves(),
        counted,
        radiance: gather.radiance,
        clock: gather.time,
        booking: booking.as_ref(),
        packets: settings.packets && scene.triangle_count() as u64 <= PACKED * pixels,
        lanes: lanes.as_ref(),
        counted_in_eights: wide,
    };
    let isa = scene.bvh.isa();
    let pilot = if settings.adaptive { pilot(total) } else { None };
    let pilot = pilot.map(|pilot| pilot.next_multiple_of(halves));
    let mut plan: Option<Plan> = None;
    let taken = AtomicU64::new(0);
    let mut non_finite = Vec::new();
    let mut non_finite_count = 0;
    let mut done = 0u64;
    let mut waves = Waves::new(settings, lanes.is_some() && wide);
    let mut eights = false;
    let default_wave = if settings.time_limit.is_some() { 1 } else { waves.first() };
    let mut wave = settings.first_wave.map_or(default_wave, |wave| u64::from(wave.max(1)));
    // Spent in the caller's hooks.
    let mut outside = Duration::ZERO;
    let mut next_look = FIRST_LOOK;
    let stop = loop {
        let end = match (&plan, pilot) {
            (Some(plan), _) => plan.most(),
            (None, Some(pilot)) => pilot,
            (None, None) => total,
        };
        let camera_samples = plan.as_ref().map_or(total * pixels, Plan::total);
        let asked = control.enough.filter(|_| !settings.adaptive);
        let end = if asked.is_some() { end.min(next_question(done).next_multiple_of(halves)) } else { end };
        let samples = done..(done + wave.next_multiple_of(halves)).min(end);
        eights |= kernel.in_eights(samples.clone(), gather.cost);
        let found: Vec<Lost> = frame
            .tiles_mut()
            .par_iter_mut()
            // Tiles go to whoever is free, one by one: in larger pieces a thread could be left with the last of them.
            .with_max_len(1)
            .map(|tile| {
                let mut lost = Lost::default();
                let mut ledger = booking.as_ref().map(|booking| shelf.take(&booking.payers));
                let added = match &plan {
                    Some(plan) => plan.samples(tile.rect(), samples.start, samples.end),
                    None => tile.rect().area() as u64 * (samples.end - samples.start),
                };
                if added > 0 {
                    dispatch(
                        isa,
                        TileJob {
                            kernel: &kernel,
                            tile,
                            samples: samples.clone(),
                            plan: plan.as_ref(),
                            lost: &mut lost,
                            ledger: ledger.as_mut(),
                        },
                    );
                }
                if let Some(ledger) = ledger {
                    shelf.put(ledger);
                }
                let done = taken.fetch_add(added, Ordering::Relaxed) + added;
                if let Some(progress) = control.progress {
                    progress(Progress { done, total: camera_samples, elapsed: start.elapsed() });
                }
                lost
            })
            .collect();
        for lost in found {
            non_finite_count += lost.count;
            non_finite.extend(lost.listed);
        }
        done = samples.end;
        if plan.is_none() && pilot == Some(done) {
            plan = Some(Plan::new(&frame, done, total));
        }
        if done == plan.as_ref().map_or(total, Plan::most) {
            break Stop::Done;
        }
        let asked_at = Instant::now();
        if asked
            .is_some_and(|enough| done == next_question(done - 1).next_multiple_of(halves) && enough(&frame))
        {
            outside += asked_at.elapsed();
            break Stop::Enough;
        }
        if let Some(watch) = control.watch
            && done >= next_look
        {
            watch(&frame);
            next_look = 2 * done;
        }
        outside += asked_at.elapsed();
        if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            break Stop::Cancelled;
        }
        let elapsed = start.elapsed();
        // Of one more sample for every pixel that is to get one.
        let active = plan.as_ref().map_or(pixels, |plan| plan.active(done));
        let taken = taken.load(Ordering::Relaxed);
        let per_sample = elapsed.saturating_sub(outside).as_secs_f64() * (active as f64 / taken as f64);
        waves.least = waves.least.filter(|_| done < counted);
        wave = waves.next(per_sample);
        if let Some(limit) = settings.time_limit {
            let left = limit.as_secs_f64() - elapsed.as_secs_f64();
            if left < per_sample {
                break Stop::TimeLimit;
            }
            wave = wave.min((left / per_sample) as u64);
        }
    };
    non_finite.sort_unstable();
    let seconds = start.elapsed().saturating_sub(outside).as_secs_f64();
    Rendered {
        frame,
        ledgers: booking.map(|Booking { payers, .. }| {
            let names: Vec<String> = scene.material_names().map(str::to_owned).collect();
            shelf.sum(&payers).rows(&payers, scene.objects(), &names)
        }),
        samples: ((taken.into_inner() + pixels / 2) / pixels) as u32,
        stop,
        seconds,
        learning_seconds,
        threads: rayon::current_num_threads(),
        kernel: format!(
            "bvh8-single-ray {} {}",
            isa.name(),
            if guides.learned.is_some() { "learned" } else { scene.class().name() }
        ),
        eights,
        non_finite,
        non_finite_count,
    }
}

#[cfg(test)]
mod tiles;

#[cfg(test)]
mod tests {
    use super::next_question;

    #[test]
    fn questions_come_four_times_in_each_doubling() {
        let mut asked = vec![next_question(0)];
        while asked.len() < 14 {
            asked.push(next_question(asked[asked.len() - 1]));
        }
        assert_eq!(asked, [8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80]);
        assert_eq!((next_question(9), next_question(33)), (10, 40));
    }
}
