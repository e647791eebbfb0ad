//! Figure 1: does the cost follow the time?

use super::{Claim, Figure, Verdict, panel};
use crate::stage::{Scale, Subject, sequential};
use hotspot_cost::analysis::{correlation, despike, tile_means};
use hotspot_cost::{LayerOptions, Layers, Metric};
use hotspot_integrator::Gather;

const PICTURE_SPP: u32 = 128;
const METRIC_SPP: u32 = 10;
const DEPTH: u32 = 15;

pub(super) fn figure(subject: &Subject, scale: Scale) -> Result<Figure, String> {
    let size = scale.size([512, 512]);
    let [width, height] = size;
    let picture = subject.picture(size, PICTURE_SPP, DEPTH);
    let costs = subject.costs(size, METRIC_SPP, DEPTH);
    // Time from a run that does not count, on one thread, so that neither the counters nor another thread are in it.
    let clock = Gather { radiance: true, cost: false, time: true, trace_shadow_rays: true };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| e.to_string())?;
    let frame = pool.install(|| subject.frame(size, METRIC_SPP, DEPTH, clock));
    let layers = Layers::from_frame(&frame, &LayerOptions::default());
    let raw = layers.metric(Metric::TimeUs).unwrap_or_default();
    let (time, replaced) = despike(width, height, raw, 99.9);

    let pixels = |metric| correlation(costs.plane(metric), &time).unwrap_or(f64::NAN);
    let tiles = |metric| {
        let tile = |values: &[f32]| tile_means(width, height, values);
        correlation(&tile(costs.plane(metric)), &tile(&time)).unwrap_or(f64::NAN)
    };
    let (intersection, rays) = (pixels(Metric::Intersection), pixels(Metric::Rays));
    let n = f64::from(width * height);
    let said = |metric, r| {
        let (lo, hi) = fisher(r, n);
        format!("r = {r:.3} ({lo:.3} to {hi:.3}) per pixel, {:.3} per 8×8 tile", tiles(metric))
    };
    let apart = fisher(intersection, n).0 > fisher(rays, n).1;
    Ok(Figure {
        title: "Figure 1: correspondence with time",
        scene: subject.scene.name.clone(),
        settings: format!(
            "{width} × {height}; picture {PICTURE_SPP} spp, metrics and time {METRIC_SPP} spp, depth {DEPTH}; time on one \
             thread without counters, {replaced} spikes above the 99.9th percentile replaced by the median of their 3×3 \
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
                ours: format!("Intersection cost: {}", said(Metric::Intersection, intersection)),
                verdict: Verdict::of(intersection > 0.7),
                why: "\"Well\" is read as a correlation above 0.7; the paper shows it by eye. Ten samples leave noise in both.",
            },
            Claim {
                paper: "The path length is less accurate than the intersection cost.",
                ours: format!("Path length: {}", said(Metric::Rays, rays)),
                verdict: Verdict::of(apart),
                why: "A ray costs what it meets: rays that leave the scene count as much here as those through dense geometry.",
            },
            Claim {
                paper: "The path length still shows hotspots, from paths caught in the geometry.",
                ours: hot(&costs, &time),
                verdict: Verdict::of(share_of_hot(&costs, &time) > 0.15),
                why: "",
            },
        ],
    })
}

/// 95 % interval of a correlation by Fisher's transformation, pixels taken as independent.
fn fisher(r: f64, n: f64) -> (f64, f64) {
    let z = r.clamp(-0.999_999, 0.999_999).atanh();
    let width = 1.96 / (n - 3.0).max(1.0).sqrt();
    ((z - width).tanh(), (z + width).tanh())
}

/// Of the tenth of the pixels with the longest paths, the part that is also among the slowest tenth; 0.1 is chance.
fn share_of_hot(costs: &crate::stage::Costs, time: &[f32]) -> f64 {
    let rays = costs.plane(Metric::Rays);
    let high = |values: &[f32]| hotspot_cost::analysis::percentile(values, 90.0);
    let (long, slow) = (high(rays), high(time));
    let hot: Vec<bool> = rays.iter().map(|r| *r > long).collect();
    let both = hot.iter().zip(time).filter(|(hot, t)| **hot && **t > slow).count();
    both as f64 / hot.iter().filter(|hot| **hot).count().max(1) as f64
}

fn hot(costs: &crate::stage::Costs, time: &[f32]) -> String {
    format!(
        "{:.0} % of the tenth of the pixels with the longest paths are among the slowest tenth (chance: 10 %)",
        100.0 * share_of_hot(costs, time)
    )
}
