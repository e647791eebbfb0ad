//! Figure 1: does the cost follow the time?

use super::{Claim, Figure, Verdict, panel};
use crate::blocks::{Estimate, correlations, over_blocks};
use crate::stage::{Costs, Scale, Subject, sequential};
use hotspot_cost::analysis::{TILE, despike, median, percentile, tile_means};
use hotspot_cost::{LayerOptions, Layers, Metric};
use hotspot_integrator::Gather;

const PICTURE_SPP: u32 = 128;
const METRIC_SPP: u32 = 10;
const DEPTH: u32 = 15;

/// Of the same paths.
const TIMED_RUNS: usize = 5;

pub(super) fn figure(subject: &Subject, scale: Scale) -> Result<Figure, String> {
    let size = scale.size([512, 512]);
    let [width, height] = size;
    let picture = subject.picture(size, PICTURE_SPP, DEPTH);
    let costs = subject.costs(size, METRIC_SPP, DEPTH);
    // Time from a run that does not count, on one thread, so that neither the counters nor another thread are in it.
    let clock = Gather { radiance: true, cost: false, time: true, trace_shadow_rays: true };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| e.to_string())?;
    let runs: Vec<Vec<f32>> = (0..TIMED_RUNS)
        .map(|_| {
            let frame = pool.install(|| subject.frame(size, METRIC_SPP, DEPTH, clock));
            let layers = Layers::from_frame(&frame, &LayerOptions::default());
            layers.metric(Metric::TimeUs).unwrap_or_default().to_vec()
        })
        .collect();
    // Interrupts hit other pixels in each run.
    let raw: Vec<f32> =
        (0..runs[0].len()).map(|i| median(&runs.iter().map(|run| run[i]).collect::<Vec<_>>())).collect();
    let raw = raw.as_slice();
    let (time, replaced) = despike(width, height, raw, 99.9);

    let (cost, rays) = (costs.plane(Metric::Intersection), costs.plane(Metric::Rays));
    let [intersection, path_length, lead] = correlations(size, 1, cost, rays, &time);
    let tile = |values: &[f32]| tile_means(width, height, values);
    let tiles = [width.div_ceil(TILE), height.div_ceil(TILE)];
    let [by_tile, rays_by_tile, lead_by_tile] =
        correlations(tiles, TILE, &tile(cost), &tile(rays), &tile(&time));
    let said = |pixel: Estimate, tile: Estimate| {
        format!("r = {} per pixel, {} per 8×8 tile", pixel.digits(3), tile.digits(3))
    };
    let hot = hot(&costs, &time);
    Ok(Figure {
        title: "Figure 1: correspondence with time",
        scene: subject.scene.name.clone(),
        settings: format!(
            "{width} × {height}; picture {PICTURE_SPP} spp, metrics and time {METRIC_SPP} spp, depth {DEPTH}; time: median of \
             {TIMED_RUNS} runs of the same paths on one thread without counters, {replaced} spikes above the 99.9th percentile replaced by the median of their 3×3 \
             neighbours"
        ),
        panels: vec![
            panel("(a) the picture", picture.image),
            panel("(b) time", sequential(size, raw, Metric::TimeUs, true)),
            panel("(c) intersection cost", costs.map(Metric::Intersection)),
            panel("(d) path length", costs.map(Metric::Rays)),
        ],
        claims: vec![
            Claim {
                paper: "The intersection cost corresponds well with time.",
                ours: format!("Intersection cost: {}", said(intersection, by_tile)),
                verdict: Verdict::of(intersection.ci95[0] > 0.7),
                why: "\"Well\" is read as a correlation surely above 0.7 per pixel; the paper shows it by eye. Ten samples leave noise \
                      in both, which tiles average out.",
            },
            Claim {
                paper: "The path length is less accurate than the intersection cost.",
                ours: format!(
                    "Path length: {}. Less by {} per pixel, {} per tile",
                    said(path_length, rays_by_tile),
                    lead.digits(3),
                    lead_by_tile.digits(3)
                ),
                verdict: Verdict::of(lead.ci95[0] > 0.0),
                why: "A ray costs what it meets: rays that leave the scene count as much here as those through dense geometry.",
            },
            Claim {
                paper: "The path length still shows hotspots, from paths caught in the geometry.",
                ours: format!(
                    "Of the tenth of the pixels with the longest paths {} % are among the slowest tenth (chance: 10 %)",
                    Estimate { value: 100.0 * hot.value, ci95: hot.ci95.map(|end| 100.0 * end) }.digits(0)
                ),
                verdict: Verdict::of(hot.ci95[0] > 0.1),
                why: "",
            },
        ],
    })
}

/// Of the tenth of the pixels with the longest paths, the part that is also among the slowest tenth; 0.1 is chance.
fn hot(costs: &Costs, time: &[f32]) -> Estimate {
    let rays = costs.plane(Metric::Rays);
    let (long, slow) = (percentile(rays, 90.0), percentile(time, 90.0));
    let sums = |i: usize| {
        let hot = rays[i] > long;
        [f64::from(u8::from(hot)), f64::from(u8::from(hot && time[i] > slow))]
    };
    let [share] = over_blocks(costs.size, 1, sums, |&[hot, both]| [both / hot.max(1.0)]);
    share
}
