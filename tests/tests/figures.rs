//! The paper's figures as numbers. Ignored by default: they print tables and take minutes; run them in release, the first
//! on a quiet machine:
//!
//! `cargo test --release -p hotspot-tests --test figures -- --ignored --test-threads=1`
//!
//! The paper: *Identifying and Visualizing Computational Hotspots in Path Tracing* (Sundarrajan, van de Ruit, Eisemann
//! 2022).

use hotspot_cost::analysis::{correlation, despike, tile_means};
use hotspot_cost::{Document, LayerOptions, Layers, Metric, Side, compare};
use hotspot_integrator::Settings;
use hotspot_scene::Scene;
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::reference::{Loaded, own_scene, shared_scene};
use hotspot_tests::say;

/// Figure 1: the cost metrics against the time that a pixel took, despiked at the 99.9th percentile as in the paper.
#[test]
#[ignore = "measures time: needs a quiet machine and the release profile"]
fn figure_1_cost_against_time() {
    say("Figure 1: Pearson correlation with despiked time_us, 256 x 256, 256 spp, depth 15");
    say("| scene | metric | per pixel | per 8x8 tile |\n|---|---|---|---|");
    for (name, scene) in [
        ("killeroo", shared_scene("killeroo")),
        ("cornell-box-red", shared_scene("cornell-box-red")),
        ("creature", own_scene("creature")),
        ("mirror-gap-narrow", own_scene("mirror-gap-narrow")),
        ("white-room-substrate", own_scene("white-room-substrate")),
    ] {
        let Some(scene) = scene else { continue };
        let loaded = Loaded::new(&scene);
        // One thread, so that threads do not take each other's time.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let settings: Settings = settings(256, 256, 256, 15, 0);
        let frame = pool.install(|| frame(&loaded.scene, &loaded.camera, &settings).frame);
        let layers = Layers::from_frame(&frame, &LayerOptions::default());
        let (time, _) = despike(256, 256, layers.metric(Metric::TimeUs).unwrap(), 99.9);
        let time_tiles = tile_means(256, 256, &time);
        for metric in [Metric::Intersection, Metric::Nodes, Metric::Shapes, Metric::Rays, Metric::Bsdf] {
            let cost = layers.metric(metric).unwrap();
            let pixels = correlation(cost, &time).unwrap();
            let tiles = correlation(&tile_means(256, 256, cost), &time_tiles).unwrap();
            say(&format!("| {name} | {} | {pixels:.3} | {tiles:.3} |", metric.name()));
            assert!(
                metric != Metric::Intersection || pixels > 0.5,
                "{name}: the intersection cost says too little of the time"
            );
        }
    }
}

/// One render with halves, ready to compare.
fn rendered(scene: &Scene, width: u32, height: u32, spp: u32) -> (Layers, Document) {
    let loaded = Loaded::new(scene);
    let mut settings = settings(width, height, spp, 15, 0);
    settings.intervals = true;
    settings.gather.time = false;
    let frame = frame(&loaded.scene, &loaded.camera, &settings).frame;
    let options = LayerOptions::default();
    let mut document = Document::of_frame(&frame, &options);
    document.scene.clone_from(&scene.name);
    (Layers::from_frame(&frame, &options), document)
}

/// Prints the change from A to B of each metric's total, and the part of it in the pixels where the change is largest.
fn changes(a: &Scene, b: &Scene, [width, height]: [u32; 2], spp: u32) -> Vec<(Metric, f64, [f64; 2])> {
    let ((la, da), (lb, db)) = (rendered(a, width, height, spp), rendered(b, width, height, spp));
    let comparison = compare(
        Side { name: &a.name, layers: &la, document: Some(&da) },
        Side { name: &b.name, layers: &lb, document: Some(&db) },
        false,
    )
    .unwrap();
    say(&format!("{} against {}, {width} x {height}, {spp} spp, depth 15, intervals", b.name, a.name));
    say(
        "| metric | A per path | B per path | change | 95 % interval | pixels in changed tiles | their mean change |",
    );
    say("|---|---|---|---|---|---|---|");
    [Metric::Rays, Metric::RaysShadow, Metric::Nodes, Metric::Shapes, Metric::Intersection]
        .into_iter()
        .map(|metric| {
            let name = metric.name();
            let total = comparison.totals[name];
            let tests = comparison.pixels[name];
            let (relative, ci) = (total.relative.unwrap(), total.ci95.unwrap());
            let difference = comparison.layers.plane(&format!("diff.{name}")).unwrap();
            let flags = comparison.layers.plane(&format!("significant.{name}")).unwrap();
            let changed = || difference.iter().zip(flags).filter(|(_, flag)| **flag > 0.0);
            let mean = changed().map(|(d, _)| f64::from(*d)).sum::<f64>() / changed().count().max(1) as f64;
            let share =
                100.0 * tests.significant.unwrap_or(0) as f64 / tests.tested.unwrap_or(1).max(1) as f64;
            say(&format!(
                "| {name} | {:.3} | {:.3} | {:+.2} % | {:+.2} % .. {:+.2} % | {share:.1} % | {mean:+.3} |",
                total.a,
                total.b,
                100.0 * relative,
                100.0 * ci[0],
                100.0 * ci[1],
            ));
            (metric, relative, ci)
        })
        .collect()
}

/// Figure 2: one reflectance changed, geometry the same. What changes is where roulette ends the paths.
#[test]
#[ignore = "half a minute of rendering in release; prints a table"]
fn figure_2_blue_minus_red() {
    for (red, blue) in [
        (shared_scene("cornell-box-red"), shared_scene("cornell-box-blue")),
        (own_scene("cornell-box-red"), own_scene("cornell-box-blue")),
    ] {
        let (Some(red), Some(blue)) = (red, blue) else { continue };
        for (metric, relative, ci) in changes(&red, &blue, [256, 256], 128) {
            if metric == Metric::Rays {
                assert!(ci[0] > 0.0 || ci[1] < 0.0, "rays: {relative} in {ci:?} is not told from chance");
            }
        }
    }
}

/// Figure 3: the table of the white room, lacquered against matte.
#[test]
#[ignore = "half a minute of rendering in release; prints a table"]
fn figure_3_substrate_minus_matte() {
    let (Some(matte), Some(substrate)) = (own_scene("white-room-matte"), own_scene("white-room-substrate"))
    else {
        return;
    };
    changes(&matte, &substrate, [320, 180], 64);
}

/// Figure 4: the gap behind the mirror, wide against narrow.
#[test]
#[ignore = "half a minute of rendering in release; prints a table"]
fn figure_4_wide_minus_narrow() {
    let (Some(narrow), Some(wide)) = (own_scene("mirror-gap-narrow"), own_scene("mirror-gap-wide")) else {
        return;
    };
    changes(&narrow, &wide, [320, 180], 128);
}
