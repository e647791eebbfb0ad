//! Area lights: irradiance against closed forms, sides, direct views.

use crate::measure;
use hotspot_integrator::Roulette;
use hotspot_scene::Material;
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{
    Random, V3, World, cross, cuboid, dot, emitting, light, matte, mirror, pencil, pinhole, rectangle,
    rectangle_corners, sub, unit,
};

/// Irradiance at `p` with normal `n` from a polygon of radiance 1, all of it above the horizon: Lambert's formula
/// (1760; Arvo, *Analytic Methods for Simulated Light Transport*, 1995, equation 2.16).
pub(crate) fn lambert(corners: [V3; 4], p: V3, n: V3) -> f64 {
    let r = corners.map(|c| unit(sub(c, p)));
    let edges = (0..4).map(|i| {
        let (a, b) = (r[i], r[(i + 1) % 4]);
        let c = cross(a, b);
        let sin = dot(c, c).sqrt();
        sin.atan2(dot(a, b)) * dot(c, n) / sin
    });
    (0.5 * edges.sum::<f64>()).abs()
}

fn floor() -> hotspot_scene::Mesh {
    rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0])
}

/// A grazing view of the origin, below all lights.
fn view() -> hotspot_scene::Camera {
    pencil([3.9, 0.35, 0.2], [0.0; 3])
}

const UP: V3 = [0.0, 1.0, 0.0];

/// A rectangle somewhere above the floor, its front towards the origin.
fn random_light(random: &mut Random) -> (V3, V3, V3) {
    loop {
        let center = [random.within(-1.5, 1.5), random.within(0.9, 2.0), random.within(-1.5, 1.5)];
        let u = random.point(-0.5, 0.5);
        let v = random.point(-0.5, 0.5);
        let n = cross(u, v);
        let facing = -dot(n, center) / (dot(n, n) * dot(center, center)).sqrt();
        let above = rectangle_corners(center, u, v).iter().all(|c| c[1] > 0.5);
        if facing > 0.2 && above && dot(n, n) > 0.01 {
            return (center, u, v);
        }
    }
}

#[test]
fn a_rectangle_lights_a_plane_by_lamberts_formula() {
    let mut random = Random(1);
    for i in 0..24 {
        let (center, u, v) = random_light(&mut random);
        let world = World::new()
            .with(floor(), matte([0.2, 0.5, 0.9]))
            .with(rectangle(center, u, v), light([3.0, 2.0, 1.0]));
        let e = lambert(rectangle_corners(center, u, v), [0.0; 3], UP) / core::f64::consts::PI;
        let expected = [0.2f32 * 3.0, 0.5 * 2.0, 0.9].map(|c| f64::from(c) * e);
        measure(&world.prepare(), &view(), 1, 64).assert_near(expected, 1e-3, &format!("light {i}"));
    }
}

/// Lights of very different powers, one of them turned away, under an environment that they block: what the choice of
/// a light is divided by must be what it is chosen with.
#[test]
fn several_lights_and_an_environment_add_up() {
    let mut random = Random(2);
    for i in 0..6 {
        let mut world = World::new().with(floor(), matte([0.7; 3])).with_environment([0.25; 3]);
        let mut expected = 0.25 * core::f64::consts::PI;
        for k in 0..4 {
            let (center, u, v) = random_light(&mut random);
            // Apart from each other, so that none shades another: four quadrants, drawn towards their middle.
            let quadrant = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]][k];
            let center =
                [0.5 * center[0] + 2.2 * quadrant[0], center[1], 0.5 * center[2] + 2.2 * quadrant[1]];
            // The second is turned about now and then, the last emits from both sides.
            let (u, v) = if k == 1 && i % 2 == 0 { (v, u) } else { (u, v) };
            let radiance = [0.5, 40.0, 3.0, 1.0][k];
            let material = Material { double_sided: k == 3, ..light([radiance as f32; 3]) };
            let shines = k == 3 || dot(cross(u, v), center) < 0.0;
            let e = lambert(rectangle_corners(center, u, v), [0.0; 3], UP);
            expected += e * (if shines { radiance } else { 0.0 } - 0.25);
            world = world.with(rectangle(center, u, v), material);
        }
        let expected = f64::from(0.7f32) / core::f64::consts::PI * expected;
        measure(&world.prepare(), &view(), 1, 256).assert_grey(expected, 1e-3, &format!("set {i}"));
    }
}

/// From a light that fills nearly the half space to one of 1e-10 steradian.
#[test]
fn lights_of_any_solid_angle() {
    for (height, half) in [(1e-3, 3.0), (0.01, 3.0), (1.0, 1.0), (1.5, 0.02), (2.0, 1e-5)] {
        let (u, v) = ([half, 0.0, 0.0], [0.0, 0.0, half]);
        let center = [0.0, height, 0.0];
        let world = World::new()
            .with(floor(), matte([0.5; 3]))
            .with(rectangle(center, u, v), light([8.0; 3]))
            .prepare();
        let e = lambert(rectangle_corners(center, u, v), [0.0; 3], UP);
        // Below a low light the camera must be lower still.
        let camera = if height < 0.1 { pencil([2.0, 0.5 * height, 0.0], [0.0, 0.0, 0.0]) } else { view() };
        let what = format!("height {height}, half edge {half}");
        measure(&world, &camera, 1, 256).assert_grey(8.0 * 0.5 / core::f64::consts::PI * e, 1e-3, &what);
    }
}

#[test]
fn a_thousand_lights() {
    let mut random = Random(3);
    let mut world = World::new().with(floor(), matte([0.6; 3]));
    let mut expected = 0.0;
    for i in 0..1000 {
        // In one plane, so that none shades another.
        let center = [f64::from(i % 32) * 0.1 - 1.55, 1.5, f64::from(i / 32) * 0.1 - 1.55];
        let (u, v) = ([0.04 * random.unit() + 0.005, 0.0, 0.0], [0.0, 0.0, 0.03 * random.unit() + 0.005]);
        let radiance = random.unit().powi(3) * 50.0;
        expected += radiance * lambert(rectangle_corners(center, u, v), [0.0; 3], UP);
        world = world.with(rectangle(center, u, v), light([radiance as f32; 3]));
    }
    let expected = f64::from(0.6f32) / core::f64::consts::PI * expected;
    measure(&world.prepare(), &view(), 1, 1024).assert_grey(expected, 1e-3, "a thousand lights");
}

/// What the camera sees of an emitter: its radiance from the front, nothing from behind; both when double-sided; scaled
/// by a mirror's reflectance. max_depth 0 shows the emitter and nothing else.
#[test]
fn emission_leaves_the_front() {
    let at = |z: f64, material: Material| {
        World::new().with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, z, 0.0]), material)
    };
    let front = pencil([0.2, 0.1, 2.0], [0.0; 3]);
    let behind = pencil([0.2, 0.1, -2.0], [0.0; 3]);
    let radiance = [0.3, 7.0, 2000.0];
    let one = light(radiance);
    let both = Material { double_sided: true, ..light(radiance) };
    let seen = radiance.map(f64::from);
    let dark = [0.0; 3];
    for (material, z, camera, expected) in [
        (&one, 1.0, &front, seen),
        (&one, 1.0, &behind, dark),
        (&one, -1.0, &front, dark),
        (&one, -1.0, &behind, seen),
        (&both, 1.0, &front, seen),
        (&both, 1.0, &behind, seen),
    ] {
        for depth in [0, 1, 5] {
            let picture = picture(&at(z, material.clone()).prepare(), camera, &settings(3, 3, 5, depth, 0));
            assert!(
                picture.pixels.iter().all(|p| *p == expected),
                "{:?} for {expected:?}",
                picture.pixels[0]
            );
        }
    }
}

/// A surface behind a one-sided light stays black, however long the paths.
#[test]
fn nothing_is_lit_from_behind() {
    let world = World::new()
        .with(floor(), matte([0.9; 3]))
        .with(rectangle([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), light([100.0; 3]));
    let picture =
        picture(&world.prepare(), &pinhole([3.0, 0.8, 0.0], [0.0; 3], 40.0), &settings(24, 24, 32, 8, 0));
    assert_eq!(picture.max(), 0.0);
}

/// Nor through a screen close before the light: shadow rays go all the way.
#[test]
fn a_screen_close_to_the_light_casts_its_shadow() {
    let lamp = rectangle([0.0, 1.5, 0.0], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4]);
    for gap in [0.1, 1e-3, 1e-5] {
        let screen = rectangle([0.0, 1.5 - gap, 0.0], [0.7, 0.0, 0.0], [0.0, 0.0, 0.7]);
        let world = World::new()
            .with(floor(), matte([0.9; 3]))
            .with(lamp.clone(), light([100.0; 3]))
            .with(screen, matte([0.0; 3]));
        let picture = picture(&world.prepare(), &view(), &settings(24, 24, 16, 1, 0));
        assert_eq!(picture.max(), 0.0, "gap {gap}");
    }
}

#[test]
fn depth_zero_shows_emitters_only() {
    let world = World::new().with(floor(), matte([0.9; 3])).with(
        rectangle([0.0, 1.5, 0.0], [0.8, 0.4, 0.0], [0.0, 0.4, 0.8]),
        emitting(matte([0.9; 3]), [5.0; 3]),
    );
    let scene = world.prepare();
    // From below, so that both are seen.
    let camera = pinhole([0.0, 0.3, 3.5], [0.0, 0.8, 0.0], 50.0);
    let zero = picture(&scene, &camera, &settings(32, 32, 4, 0, 0));
    let one = picture(&scene, &camera, &settings(32, 32, 4, 1, 0));
    let of = |v: f64| zero.pixels.iter().filter(|p| p[0] == v).count();
    assert!(of(5.0) > 20 && of(0.0) > 500, "{} {}", of(5.0), of(0.0));
    assert!(zero.pixels.iter().flatten().all(|v| *v <= 5.0));
    let lit =
        one.pixels.iter().zip(&zero.pixels).filter(|(one, zero)| zero[0] == 0.0 && one[0] > 0.0).count();
    assert!(lit > 200, "{lit} pixels of the floor are lit");
}

/// A mirror shows the light behind the camera, times its reflectance; two mirrors, times both.
#[test]
fn mirrors_show_emitters_exactly() {
    let lit = |world: World| {
        world.with(rectangle([0.0, 0.0, 5.0], [0.0, 4.0, 0.0], [4.0, 0.0, 0.0]), light([4.0, 2.0, 1.0]))
    };
    // Facing +z, then a pair of parallel ones passed twice.
    let one =
        lit(World::new()
            .with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), mirror([0.5, 0.25, 1.0])));
    let scene = one.prepare();
    let camera = pencil([0.0, -0.1, 1.0], [0.0; 3]);
    for (depth, expected) in [(0, [0.0; 3]), (1, [2.0, 0.5, 1.0]), (6, [2.0, 0.5, 1.0])] {
        let picture = picture(&scene, &camera, &settings(3, 3, 4, depth, 0));
        assert!(picture.pixels.iter().all(|p| *p == expected), "depth {depth}: {:?}", picture.pixels[0]);
    }
}

/// A closed box of mirrors that emit e and reflect r: e Σ r^k, for every path.
#[test]
fn a_box_of_luminous_mirrors() {
    let walls = emitting(mirror([0.5, 0.8, 0.95]), [1.0; 3]);
    let scene = World::new().with(cuboid([-1.0, -0.7, -1.2], [1.3, 0.8, 0.9], true), walls).prepare();
    for depth in [0u32, 1, 3, 20, 200] {
        let mut settings = settings(16, 16, 2, depth, 0);
        settings.roulette = Roulette::Off;
        let picture = picture(&scene, &pinhole([0.1, 0.2, 0.3], [1.0, 0.1, -0.4], 80.0), &settings);
        let expected = [0.5f64, 0.8, 0.95].map(|r| (1.0 - r.powi(depth as i32 + 1)) / (1.0 - r));
        for (c, expected) in expected.into_iter().enumerate() {
            let off = picture.pixels.iter().map(|p| (p[c] / expected - 1.0).abs()).fold(0.0, f64::max);
            assert!(off < 2e-5, "depth {depth}, channel {c}: {off}");
        }
    }
}
