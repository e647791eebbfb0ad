//! Renders a prepared scene: waves of samples over all tiles, in the caller's thread pool.

use crate::camera::FilmCamera;
use crate::kernel::{Kernel, NonFinite, TileJob};
use crate::path::PathSettings;
use crate::sampler::SamplerKind;
use crate::scene::RenderScene;
use hotspot_bvh::simd::dispatch;
use hotspot_cost::{Frame, FrameDesc};
use hotspot_scene::Camera;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// What to gather.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gather {
    /// The picture.
    pub radiance: bool,
    /// Counters.
    pub cost: bool,
    /// Time per pixel: one clock reading per visit of a pixel.
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
    /// Surface vertex (from 0) at which Russian roulette begins; `None`: never.
    pub roulette_from: Option<u32>,
    /// What to gather.
    pub gather: Gather,
    /// Stop after about this much time; at least one sample per pixel is taken.
    pub time_limit: Option<Duration>,
    /// Width over height of the film where its pixels are not square; `None`: width over height in pixels.
    pub aspect: Option<f64>,
    /// Samples per pixel of the first wave, at least 1; the result does not depend on it, but the time that a pixel's visits
    /// take does. `None`: 4, or 1 with a time limit.
    pub first_wave: Option<u32>,
}

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
            roulette_from: Some(4),
            gather: Gather::ALL,
            time_limit: None,
            aspect: None,
            first_wave: None,
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
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// All samples were taken.
    Done,
    /// The time limit.
    TimeLimit,
    /// [`Control::cancel`].
    Cancelled,
}

/// A finished render.
#[derive(Debug)]
pub struct Rendered {
    /// The sums.
    pub frame: Frame,
    /// Camera samples per pixel.
    pub samples: u32,
    /// Why it ended.
    pub stop: Stop,
    /// Seconds of sampling.
    pub seconds: f64,
    /// Worker threads.
    pub threads: usize,
    /// Name of the kernel: tree, instruction set, scene class.
    pub kernel: String,
    /// Samples whose radiance was not finite and counted as black, sorted; at most 64 per tile and wave are listed.
    pub non_finite: Vec<NonFinite>,
}

/// Waves are sized to take about this long, so that a render can be stopped and shows progress.
const WAVE: Duration = Duration::from_millis(1000);

/// Renders. Runs in the rayon pool of the caller; the result does not depend on the number of threads, nor on how the
/// samples are split into waves.
///
/// # Panics
/// When width, height or spp is 0.
pub fn render(scene: &RenderScene, camera: &Camera, settings: &Settings, control: Control<'_>) -> Rendered {
    assert!(settings.spp > 0, "no samples to take");
    let gather = settings.gather;
    let mut frame = Frame::new(FrameDesc {
        width: settings.width,
        height: settings.height,
        intervals: settings.intervals,
        cost: gather.cost || gather.time,
        tile: 16,
    });
    // Both halves always have as many samples.
    let halves = frame.halves() as u64;
    let whole = |samples: u32| u64::from(samples).next_multiple_of(halves);
    let kernel = Kernel {
        scene,
        camera: FilmCamera::new(
            camera,
            settings.aspect.unwrap_or_else(|| f64::from(settings.width) / f64::from(settings.height)),
        ),
        width: settings.width,
        height: settings.height,
        path: PathSettings {
            max_depth: settings.max_depth,
            roulette_from: settings.roulette_from.unwrap_or(u32::MAX),
            trace_shadow_rays: gather.trace_shadow_rays,
        },
        sampler: settings.sampler,
        seed: settings.seed,
        halves: frame.halves(),
        counted: if gather.cost { whole(settings.cost_spp.unwrap_or(u32::MAX)) } else { 0 },
        radiance: gather.radiance,
        clock: gather.time,
    };
    let isa = scene.bvh.isa();
    let total = whole(settings.spp);
    let pixels = u64::from(settings.width) * u64::from(settings.height);
    let taken = AtomicU64::new(0);
    let start = Instant::now();
    let mut non_finite = Vec::new();
    let mut done = 0u64;
    let default_wave = if settings.time_limit.is_some() { 1 } else { 4 };
    let mut wave = u64::from(settings.first_wave.unwrap_or(default_wave).max(1));
    let stop = loop {
        let samples = done..(done + wave.next_multiple_of(halves)).min(total);
        let found: Vec<NonFinite> = frame
            .tiles_mut()
            .par_iter_mut()
            .map(|tile| {
                let mut found = Vec::new();
                let area = tile.rect().area() as u64;
                dispatch(
                    isa,
                    TileJob { kernel: &kernel, tile, samples: samples.clone(), non_finite: &mut found },
                );
                let added = area * (samples.end - samples.start);
                let done = taken.fetch_add(added, Ordering::Relaxed) + added;
                if let Some(progress) = control.progress {
                    progress(Progress { done, total: total * pixels, elapsed: start.elapsed() });
                }
                found
            })
            .flatten()
            .collect();
        non_finite.extend(found);
        done = samples.end;
        if done == total {
            break Stop::Done;
        }
        if control.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            break Stop::Cancelled;
        }
        let elapsed = start.elapsed();
        let per_sample = elapsed.as_secs_f64() / done as f64;
        let mut budget = WAVE.as_secs_f64();
        if let Some(limit) = settings.time_limit {
            budget = budget.min(limit.as_secs_f64() - elapsed.as_secs_f64());
            if budget < per_sample {
                break Stop::TimeLimit;
            }
        }
        // Float to integer saturates.
        wave = ((budget / per_sample) as u64).max(1);
    };
    non_finite.sort_unstable();
    Rendered {
        frame,
        samples: done as u32,
        stop,
        seconds: start.elapsed().as_secs_f64(),
        threads: rayon::current_num_threads(),
        kernel: format!("bvh8-single-ray {} {}", isa.name(), scene.class().name()),
        non_finite,
    }
}
