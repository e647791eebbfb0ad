//! Mirrors of known radiance, beyond those of `physics/emitters.rs`.

use crate::SIGMA;
use core::f64::consts::PI;
use hotspot_tests::forms::lambert;
use hotspot_tests::measured::measure;
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{World, light, matte, mirror, pencil, rectangle, rectangle_corners};

/// Three mirrors at right angles send every ray back where it came from: r³ L, and nothing before the third.
#[test]
fn a_corner_of_three_mirrors() {
    let r = [0.5f32, 0.8, 0.25];
    let (x, y, z) = ([2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]);
    let scene = World::new()
        .with(rectangle([0.0, 2.0, 2.0], y, z), mirror(r))
        .with(rectangle([2.0, 0.0, 2.0], z, x), mirror(r))
        .with(rectangle([2.0, 2.0, 0.0], x, y), mirror(r))
        // Behind the eye, facing the corner.
        .with(rectangle([6.0; 3], [-4.0, -4.0, 8.0], [-4.0, 4.0, 0.0]), light([1.0, 2.0, 4.0]))
        .prepare();
    let camera = pencil([1.5, 1.4, 1.6], [0.3, 0.2, 0.1]);
    for depth in [0, 1, 2, 3, 8] {
        let picture = picture(&scene, &camera, &settings(4, 4, 4, depth, 0));
        let expected = if depth < 3 { [0.0; 3] } else { [0.125, 2.0 * 0.512, 4.0 / 64.0] };
        for pixel in &picture.pixels {
            let off = [0, 1, 2].map(|c| (pixel[c] - expected[c]).abs());
            assert!(off.iter().all(|o| *o < 1e-6), "depth {depth}: {pixel:?} for {expected:?}");
        }
    }
}

/// A lamp beside a large mirror lights the floor twice: itself, and as its image, times the reflectance.
#[test]
fn a_lamp_and_its_image() {
    let r = [0.9f32, 0.5, 0.2];
    let world = World::new()
        .with(rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]), matte([0.6; 3]))
        // In the plane x = −1.
        .with(rectangle([-1.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]), mirror(r));
    for (center, u, v) in [
        ([0.3, 1.0, 0.0], [0.8, 0.0, 0.0], [0.0, 0.0, 0.9]),
        ([0.6, 1.4, -0.3], [0.5, -0.3, 0.0], [0.0, 0.0, 1.0]),
    ] {
        let scene = world.clone().with(rectangle(center, u, v), light([3.0; 3])).prepare();
        let lamp = rectangle_corners(center, u, v);
        let image = lamp.map(|[x, y, z]| [-2.0 - x, y, z]);
        let [itself, image] = [lamp, image].map(|c| 3.0 * lambert(&c, [0.0; 3], [0.0, 1.0, 0.0]).abs());
        let expected = r.map(|r| f64::from(0.6f32) / PI * (itself + f64::from(r) * image));
        let what = format!("lamp at {center:?}");
        measure(&scene, &pencil([3.9, 0.3, 0.2], [0.0; 3]), 2, 512).assert_near(expected, SIGMA, &what);
    }
}
