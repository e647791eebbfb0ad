//! Do our pictures converge to those of an independent renderer?
//!
//! The references (Mitsuba 3, several thousand samples per pixel, in two independent halves) lie beside the checkout, not
//! in it; without them every test here prints SKIPPED and passes. Depth-limited references tell errors of geometry,
//! camera, light and material from errors of the path loop.
//!
//! For each picture, over the pixels that see no emitter directly:
//! * **means**: each channel's mean within max(0.3 %, 4σ) of the reference's;
//! * **tiles**: each 16×16 tile's mean against the reference's in each channel. Its variance is the sum over its pixels of
//!   our variance over independently scrambled renders and the reference's from its halves, with Satterthwaite's
//!   degrees of freedom. The level of a single test is Šidák's for a family-wise false-alarm rate of 0.1 % a picture;
//! * **speed of convergence**: relMSE = mean of (X − A)(X − B)/(M² + 0.01), nothing trimmed, A and B the reference's
//!   halves and M their mean, so that the reference's own error adds nothing on average. From one number of samples to
//!   the next it must fall at least in proportion, within the t interval (0.1 %, Welch) that its spread over seeds gives.
//!
//! Short: 4 × 16 samples per pixel. Long (ignored): 8 × 128.

use hotspot_integrator::{Roulette, Settings};
use hotspot_tests::agreement::{Difference, Estimate, Tests};
use hotspot_tests::picture::{Picture, picture, settings};
use hotspot_tests::reference::{Loaded, Reference, reference, shared_scene};
use hotspot_tests::say;
use hotspot_tests::stats::{Variance, mean_and_variance, p_value, quantile, slope};
use std::fmt::Write;

/// Rate of any false alarm among the tiles of one picture.
const FAMILY: f64 = 1e-3;
/// Edge of a tile in pixels.
const EDGE: usize = 16;

/// How much to render.
struct Effort {
    /// Independent renders, and samples per pixel of each: for means and tiles, and the last step of convergence.
    renders: u64,
    spp: u32,
    /// The steps before: samples per pixel and renders.
    steps: &'static [(u32, u64)],
}

const SHORT: Effort = Effort { renders: 4, spp: 16, steps: &[(1, 8), (4, 6)] };
const SHORT_TILES: Effort = Effort { renders: 4, spp: 16, steps: &[] };
const LONG: Effort = Effort { renders: 8, spp: 128, steps: &[(2, 16), (8, 16), (32, 8)] };
/// For scenes whose samples cost more.
const FEW_TILES: Effort = Effort { renders: 4, spp: 8, steps: &[] };
const LONG_TILES: Effort = Effort { renders: 8, spp: 128, steps: &[] };

#[test]
fn killeroo() {
    check("killeroo", "killeroo_256x256_2048", 64, Roulette::From(4), &SHORT);
}

#[test]
fn cornell_red() {
    check("cornell-box-red", "cornell-box-red_256x256_4096", 64, Roulette::From(4), &SHORT);
}

#[test]
fn cornell_blue() {
    check("cornell-box-blue", "cornell-box-blue_256x256_4096", 64, Roulette::From(4), &SHORT_TILES);
}

#[test]
fn cornell_red_direct_light_only() {
    check("cornell-box-red", "cornell-box-red_direct_256x256_2048", 1, Roulette::Off, &SHORT);
}

#[test]
fn cornell_red_up_to_five_bounces() {
    check("cornell-box-red", "cornell-box-red_depth6_256x256_512", 5, Roulette::Off, &SHORT_TILES);
}

#[test]
fn veach_mis() {
    check("veach-mis", "veach-mis_300x200_4140", 64, Roulette::From(4), &SHORT_TILES);
}

#[test]
fn living_room_substrate() {
    check("living-room-substrate", "living-room-substrate_320x180_3456", 64, Roulette::From(4), &FEW_TILES);
}

#[test]
fn living_room_matte() {
    check("living-room-matte", "living-room-matte_320x180_2160", 64, Roulette::From(4), &FEW_TILES);
}

#[test]
#[ignore = "minutes of rendering: the long version of the tests above; run in release"]
fn long() {
    check("cornell-box-red", "cornell-box-red_direct_256x256_2048", 1, Roulette::Off, &LONG);
    check("cornell-box-red", "cornell-box-red_depth6_256x256_512", 5, Roulette::Off, &LONG_TILES);
    check("cornell-box-red", "cornell-box-red_256x256_4096", 64, Roulette::From(4), &LONG);
    check("cornell-box-red", "cornell-box-red_256x256_4096", 64, Roulette::Off, &LONG_TILES);
    check("cornell-box-blue", "cornell-box-blue_256x256_4096", 64, Roulette::From(4), &LONG);
    check("killeroo", "killeroo_256x256_2048", 64, Roulette::From(4), &LONG);
}

#[test]
#[ignore = "many minutes of rendering: textures, masks, metals, glass and many lights; run in release"]
fn long_real_scenes() {
    check("veach-mis", "veach-mis_300x200_4140", 64, Roulette::From(4), &LONG);
    check("living-room-substrate", "living-room-substrate_320x180_3456", 64, Roulette::From(4), &LONG);
    check("living-room-matte", "living-room-matte_320x180_2160", 64, Roulette::From(4), &LONG);
}

fn check(scene: &str, name: &str, max_depth: u32, roulette: Roulette, effort: &Effort) {
    let (Some(file), Some(reference)) = (shared_scene(scene), reference(name)) else { return };
    let loaded = Loaded::new(&file);
    let (width, height) = (reference.mean.width, reference.mean.height);
    let with = |spp, seed| {
        let mut settings: Settings = settings(width as u32, height as u32, spp, max_depth, seed);
        settings.roulette = roulette;
        picture(&loaded.scene, &loaded.camera, &settings)
    };
    let renders: Vec<Picture> = (1..=effort.renders).map(|seed| with(effort.spp, seed)).collect();
    let emitters = settings(width as u32, height as u32, 64, 0, 0);
    let lit = picture(&loaded.scene, &loaded.camera, &emitters).lit();

    let mut problems = String::new();
    let ours = Estimate::of(&renders);
    let expected = Estimate::of(&[reference.a.clone(), reference.b.clone()]);
    let samples = effort.renders * u64::from(effort.spp);
    say(&format!("{name}, depth {max_depth}, {} x {} = {samples} spp", effort.renders, effort.spp));
    means(&ours, &expected, &lit, &mut problems);
    let tiles = Tests::new(&ours, &expected, |i| !lit[i], EDGE, false, FAMILY);
    say(&format!("  tiles: {}", tiles.summary()));
    problems += &tiles.problems();
    if !effort.steps.is_empty() {
        let mut ladder: Vec<(u32, Vec<f64>)> = effort
            .steps
            .iter()
            .map(|&(spp, count)| {
                let errors = (0..count).map(|i| relmse(&with(spp, 1000 + i), &reference)).collect();
                (spp, errors)
            })
            .collect();
        ladder.push((effort.spp, renders.iter().map(|r| relmse(r, &reference)).collect()));
        convergence(&ladder, &mut problems);
    }
    assert!(problems.is_empty(), "{name}:\n{problems}");
}

fn means(ours: &Estimate, reference: &Estimate, lit: &[bool], problems: &mut String) {
    let mut line = String::from("  means: ");
    for (c, channel) in ["R", "G", "B"].into_iter().enumerate() {
        let unlit = (0..lit.len()).filter(|i| !lit[*i]);
        let found = Difference::of(ours, reference, unlit, c);
        let (relative, sigma) = (found.relative(), found.variance.sigma() / found.sum);
        let _ = write!(line, "{channel} {:+.4} % ± {:.4} %  ", 100.0 * relative, 100.0 * sigma);
        if relative.abs() > (4.0 * sigma).max(0.003) {
            let _ = writeln!(problems, "mean of {channel} off by {relative:+.2e}, sigma {sigma:.1e}");
        }
    }
    say(&line);
}

/// Squared error relative to the reference, freed of the reference's own.
fn relmse(x: &Picture, reference: &Reference) -> f64 {
    let mut sum = 0.0;
    for (i, x) in x.pixels.iter().enumerate() {
        for (c, x) in x.iter().enumerate() {
            let (a, b) = (reference.a.pixels[i][c], reference.b.pixels[i][c]);
            let m = 0.5 * (a + b);
            sum += (x - a) * (x - b) / (m * m + 0.01);
        }
    }
    sum / (3 * x.pixels.len()) as f64
}

fn convergence(ladder: &[(u32, Vec<f64>)], problems: &mut String) {
    let mut line = String::from("  relMSE: ");
    let mut points = Vec::new();
    let mut before: Option<(f64, f64, f64, f64)> = None;
    for (spp, errors) in ladder {
        let (mean, variance) = mean_and_variance(errors);
        let relative = variance.sqrt() / mean;
        let _ = write!(line, "{spp} spp {mean:.3e} ± {:.0} %  ", 100.0 * relative);
        let (x, y, dof) = (f64::from(*spp).ln(), mean.ln(), errors.len() as f64 - 1.0);
        points.push((x, y, relative));
        if let Some((x0, y0, r0, dof0)) = before {
            let mut variance = Variance::default();
            variance.add(relative * relative, dof);
            variance.add(r0 * r0, dof0);
            // Fall beyond proportion: positive when it falls too little.
            let excess = (y - y0) + (x - x0);
            if excess > 0.0 && p_value(excess / variance.sigma(), variance.dof()) < 2.0 * FAMILY {
                let allowed = quantile(2.0 * FAMILY, variance.dof()) * variance.sigma();
                let _ = writeln!(
                    problems,
                    "at {spp} spp relMSE is {:.2} times what 1/spp leads to expect, tolerance {:.2}",
                    excess.exp(),
                    allowed.exp()
                );
            }
        }
        before = Some((x, y, relative, dof));
    }
    let (slope, error) = slope(&points);
    say(&format!("{line} slope {slope:.3} ± {error:.3}"));
}
