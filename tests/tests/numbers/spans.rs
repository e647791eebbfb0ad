//! Sizes of 10^9:1 within one scene, and triangles 10^9 times longer than wide: pictures against those of a twin in f64.
//!
//! Rates of false alarms: 6.3e-5 for each channel's mean (4σ), 1e-3 for any of a picture's 16 tiles (Šidák).

use hotspot_scene::{Camera, Projection};
use hotspot_tests::measured::Measured;
use hotspot_tests::picture::{picture, settings, tiles};
use hotspot_tests::stats::{Variance, mean_and_variance, quantile, sidak};
use hotspot_tests::twin::Twin;
use hotspot_tests::world::{
    Random, V3, World, add_scaled, camera, cross, cuboid, emitting, light, matte, mesh, pinhole, rectangle,
    sphere, unit,
};

const EDGE: u32 = 32;

/// `replicates` pictures of each, compared by mean and by tile; σ of the difference at most `most` of the mean.
fn assert_twin(world: &World, camera: &Camera, spp: u32, replicates: u64, most: f64, what: &str) {
    let depth = 3;
    let scene = world.prepare();
    let ours: Vec<_> = (0..replicates)
        .map(|seed| picture(&scene, camera, &settings(EDGE, EDGE, spp, depth, seed)).pixels)
        .collect();
    let twin = Twin::new(&world.scene);
    let theirs: Vec<_> = (0..replicates)
        .map(|seed| twin.picture(camera, (EDGE, EDGE), spp, depth, &mut Random(seed)))
        .collect();
    let mean_of = |pixels: &Vec<[f64; 3]>, tile: &[usize]| {
        [0, 1, 2].map(|c| tile.iter().map(|i| pixels[*i][c]).sum::<f64>() / tile.len() as f64)
    };
    let all: Vec<usize> = (0..(EDGE * EDGE) as usize).collect();
    let of = |pictures: &[Vec<[f64; 3]>], tile: &[usize]| -> Vec<[f64; 3]> {
        pictures.iter().map(|p| mean_of(p, tile)).collect()
    };
    let (a, b) = (Measured::of(&of(&ours, &all)), Measured::of(&of(&theirs, &all)));
    let dof = replicates as f64 - 1.0;
    for c in 0..3 {
        let ((a, sa), (b, sb)) = (a.0[c], b.0[c]);
        let sigma = sa.hypot(sb);
        hotspot_tests::say(&format!(
            "{what}, channel {c}: {a:.6} and {b:.6}, {:+.3} % ± {:.3} %",
            100.0 * (a / b - 1.0),
            100.0 * sigma / b
        ));
        assert!(sigma <= most * b, "{what}, channel {c}: sigma {sigma} of {b}");
        // At worst one of the two variances matters.
        assert!(
            (a - b).abs() <= quantile(6.334e-5, dof) * sigma,
            "{what}, channel {c}: {a} for {b} ± {sigma}"
        );
    }
    let tiles = tiles(EDGE as usize, EDGE as usize, EDGE as usize / 4);
    let level = sidak(1e-3, tiles.len());
    for (i, tile) in tiles.iter().enumerate() {
        let (ours, theirs) = (of(&ours, tile), of(&theirs, tile));
        let green = |values: &[[f64; 3]]| mean_and_variance(&values.iter().map(|v| v[1]).collect::<Vec<_>>());
        let ((a, va), (b, vb)) = (green(&ours), green(&theirs));
        let mut variance = Variance::default();
        variance.add(va, dof);
        variance.add(vb, dof);
        assert!(variance.p_value(a - b) >= level, "{what}, tile {i}: {a} for {b} ± {}", variance.sigma());
    }
}

/// Balls over plates, the smallest 1e-6 in radius and the largest 1e3, each from its own distance seen under the same angle,
/// lit by the sky, by a lamp of middle size and by each other. Triangles from 3e-7 to 2e3.
fn all_sizes() -> (World, Camera) {
    let mut world = World::new().with_environment([0.5, 0.8, 1.0]);
    for k in 0..10 {
        let size = 10f64.powi(k - 6);
        // Ten directions: two rows of five, the sizes shuffled.
        let place = (k * 7) % 10;
        let to = unit([0.28 * f64::from(place % 5) - 0.56, if place < 5 { 0.27 } else { -0.27 }, -1.0]);
        let center = to.map(|c| 9.0 * size * c);
        let u = unit(cross([0.0, 1.0, 0.0], to));
        let v = cross(to, u);
        let plate = rectangle(
            add_scaled(center, 1.2 * size, to),
            u.map(|c| -1.1 * size * c),
            v.map(|c| 1.1 * size * c),
        );
        let colour = [0.9 - 0.05 * k as f32, 0.7, 0.4 + 0.05 * k as f32];
        world = world.with(sphere(center, 0.8 * size, 1, false), matte(colour)).with(plate, matte([0.8; 3]));
    }
    // Overhead, the length of a room; a box around the eye's lower side, open to the view.
    let lamp = rectangle([0.0, 3.0, -2.0], [2.5, 0.0, 0.0], [0.0, 0.0, 2.5]);
    let shelf = cuboid([-3.0, -4.0, -6.0], [3.0, -3.5, 0.5], false);
    let world = world.with(lamp, light([2.0, 1.5, 1.0])).with(shelf, emitting(matte([0.6; 3]), [0.1; 3]));
    (world, pinhole([0.0; 3], [0.0, 0.0, -1.0], 58.0))
}

#[test]
fn sizes_of_a_billion_to_one_in_one_scene() {
    let (world, camera) = all_sizes();
    assert_twin(&world, &camera, 16, 16, 3e-3, "all sizes");
}

#[test]
#[ignore = "a minute of f64: 16 times the samples"]
fn sizes_of_a_billion_to_one_in_one_scene_in_full() {
    let (world, camera) = all_sizes();
    assert_twin(&world, &camera, 128, 32, 1e-3, "all sizes");
}

/// A pleated sheet: 40 strips, 1e-6 wide and 1e3 long, of two triangles each; the film spans 20 of them at z = `along`.
fn pleats(along: f64) -> (World, Camera) {
    let (width, length) = (1e-6, 1e3);
    let mut sheet = mesh(Vec::new(), Vec::new());
    for i in 0..=40u32 {
        let x = width * (f64::from(i) - 20.0);
        let y = if i % 2 == 0 { 0.4 * width } else { -0.4 * width };
        sheet.positions.extend([-0.5, 0.5].map(|z| [x as f32, y as f32, (length * z) as f32]));
        if i > 0 {
            let first = 2 * i - 2;
            sheet.triangles.extend([[first, first + 1, first + 2], [first + 2, first + 1, first + 3]]);
        }
    }
    let world = World::new().with(sheet, matte([0.9, 0.6, 0.3])).with_environment([1.0; 3]);
    let half = 10.0 * width;
    let from: V3 = [0.0, 1e-3, along];
    (world, camera(from, [0.0, 0.0, along], Projection::Orthographic { xmag: half, ymag: half }))
}

/// In the middle of the strips, where coordinates are fine, and 300 from there, where one of them rounds to 30 times the
/// strips' width.
#[test]
fn slivers_of_a_billion_to_one() {
    for along in [0.0, 300.0] {
        let (world, camera) = pleats(along);
        assert_twin(&world, &camera, 16, 16, 1e-3, &format!("slivers at {along}"));
    }
}
