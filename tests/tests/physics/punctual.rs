//! Lights without area: closed forms without noise, shadows, the choice among many and among all kinds of light.

use crate::{Measured, measure, measure_with};
use core::f64::consts::PI;
use hotspot_scene::LightKind;
use hotspot_tests::picture::{picture, settings};
use hotspot_tests::world::{
    Random, V3, World, add_scaled, cuboid, dot, environment_map, light, matte, metal, pencil, pinhole,
    rectangle, sphere, unit,
};

fn floor() -> hotspot_scene::Mesh {
    rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0])
}

/// A grazing view of the origin, below all lights.
fn view() -> hotspot_scene::Camera {
    pencil([3.9, 0.35, 0.2], [0.0; 3])
}

fn f32s(v: V3) -> [f32; 3] {
    v.map(|c| c as f32)
}

fn point(position: V3) -> LightKind {
    LightKind::Point { position: f32s(position) }
}

/// Every pixel, up to rounding.
fn assert_exact(world: &World, camera: &hotspot_scene::Camera, expected: [f64; 3], what: &str) {
    let picture = picture(&world.prepare(), camera, &settings(4, 4, 4, 1, 0));
    for p in &picture.pixels {
        for c in 0..3 {
            assert!((p[c] - expected[c]).abs() <= 2e-5 * expected[c], "{what}: {p:?} for {expected:?}");
        }
    }
}

#[test]
fn a_point_lights_a_plane_by_the_inverse_square() {
    let mut random = Random(1);
    for i in 0..50 {
        let p = [random.within(-2.0, 2.0), random.within(0.1, 3.0), random.within(-2.0, 2.0)];
        let world = World::new().with(floor(), matte([0.2, 0.5, 0.9])).with_light(point(p), [3.0, 2.0, 1.0]);
        let e = p[1] / dot(p, p).powf(1.5) / PI;
        let expected = [0.2f32 * 3.0, 0.5 * 2.0, 0.9].map(|c| f64::from(c) * e);
        assert_exact(&world, &view(), expected, &format!("light {i}"));
    }
}

/// Scenes from 1e-6 to 1e6 and far beyond, and a light from next to the surface to 1e6 times its size away.
#[test]
fn distances_of_any_size() {
    for exponent in [-15, -6, -3, 0, 3, 6, 15] {
        let s = 10f64.powi(exponent);
        let at = |v: V3| v.map(|c| c * s);
        let plane = rectangle([0.0; 3], at([0.0, 0.0, 4.0]), at([4.0, 0.0, 0.0]));
        let p = at([0.5, 1.5, -0.7]);
        let d2 = dot(f32s(p).map(f64::from), f32s(p).map(f64::from));
        let intensity = (d2 as f32).clamp(1e-30, 1e30);
        let world = World::new().with(plane, matte([0.5; 3])).with_light(point(p), [intensity; 3]);
        let camera = pencil(at([3.9, 0.35, 0.2]), [0.0; 3]);
        let expected = 0.5 / PI * f64::from(intensity) / d2 * unit(p)[1];
        assert_exact(&world, &camera, [expected; 3], &format!("scale 1e{exponent}"));
    }
    for distance in [1e-2, 1.0, 1e2, 1e4, 1e6] {
        let world =
            World::new().with(floor(), matte([0.5; 3])).with_light(point([0.0, distance, 0.0]), [1.0; 3]);
        let camera = if distance < 1.0 { pencil([1.0, 0.3 * distance, 0.0], [0.0; 3]) } else { view() };
        let picture = picture(&world.prepare(), &camera, &settings(2, 2, 2, 1, 0));
        let expected = 0.5 / PI / (distance * distance);
        assert!((picture.mean()[0] / expected - 1.0).abs() < 1e-4, "{distance}: {:?}", picture.mean());
    }
}

#[test]
fn a_spot_falls_off_between_its_angles() {
    let position = [0.3, 2.0, -0.4];
    let to_origin = unit(position.map(|c: f64| -c));
    let side = unit([to_origin[1], -to_origin[0], 0.0]);
    let (inner, outer) = (0.2f64, 0.5f64);
    let (cos_inner, cos_outer) = (inner.cos() as f32, outer.cos() as f32);
    for i in 0..60 {
        // The axis turns away from the origin.
        let angle = 0.01 * f64::from(i) + 0.003;
        let axis = f32s(add_scaled(to_origin.map(|c| c * angle.cos()), angle.sin(), side));
        let kind = LightKind::Spot { position: f32s(position), direction: axis, cos_inner, cos_outer };
        let world = World::new().with(floor(), matte([0.5; 3])).with_light(kind, [7.0, 1.0, 0.0]);
        let cos = dot(axis.map(f64::from), to_origin) / dot(axis.map(f64::from), axis.map(f64::from)).sqrt();
        let s = (cos - f64::from(cos_outer)) / (f64::from(cos_inner) - f64::from(cos_outer));
        let s = s.clamp(0.0, 1.0);
        let e = 0.5 / PI * s * s * -to_origin[1] / dot(position, position);
        let picture = picture(&world.prepare(), &view(), &settings(2, 2, 2, 1, 0));
        for p in picture.pixels {
            assert!((p[0] - 7.0 * e).abs() < 2e-5 * 7.0 * e + 1e-7, "{angle}: {p:?} for {}", 7.0 * e);
            assert!((p[1] - e).abs() < 2e-5 * e + 1e-7 && p[2] == 0.0, "{angle}: {p:?} for {e}");
            assert_eq!(p[0] == 0.0, s == 0.0, "{angle}");
        }
    }
}

#[test]
fn a_directional_light_shines_everywhere_alike() {
    let mut random = Random(2);
    for i in 0..30 {
        let d = unit([random.within(-1.0, 1.0), random.within(-1.0, -0.05), random.within(-1.0, 1.0)]);
        let kind = LightKind::Directional { direction: f32s(d) };
        let world = World::new().with(floor(), matte([0.2, 0.5, 0.9])).with_light(kind, [3.0, 2.0, 1.0]);
        let e = -d[1] / PI;
        let expected = [0.2f32 * 3.0, 0.5 * 2.0, 0.9].map(|c| f64::from(c) * e);
        assert_exact(&world, &view(), expected, &format!("light {i}"));
        // From below it lights the other side only.
        let up = World::new()
            .with(floor(), matte([0.9; 3]))
            .with_light(LightKind::Directional { direction: f32s(d.map(|c| -c)) }, [9.0; 3]);
        assert_exact(&up, &view(), [0.0; 3], &format!("light {i} from below"));
    }
}

/// A quad between floor and light casts its shadow; one behind the light, or holding it, does not.
#[test]
fn only_what_is_between_casts_shadows() {
    let lamp = [0.2, 1.5, 0.1];
    let screen = |height: f64| rectangle([0.0, height, 0.0], [0.7, 0.0, 0.0], [0.0, 0.0, 0.7]);
    let spot = LightKind::Spot {
        position: f32s(lamp),
        direction: f32s(unit(lamp.map(|c| -c))),
        cos_inner: 0.9,
        cos_outer: 0.5,
    };
    let sun = LightKind::Directional { direction: f32s(unit(lamp.map(|c| -c))) };
    for (kind, reaches) in [(point(lamp), true), (spot, true), (sun, false)] {
        let lit = |height: f64| {
            let world = World::new()
                .with(floor(), matte([0.9; 3]))
                .with(screen(height), matte([0.0; 3]))
                .with_light(kind, [10.0; 3]);
            let picture = picture(&world.prepare(), &view(), &settings(4, 4, 4, 1, 0));
            (picture.min(), picture.max())
        };
        for height in [0.5, 1.0, 1.499, 1.499_99] {
            assert_eq!(lit(height), (0.0, 0.0), "{kind:?}, screen at {height}");
        }
        for height in [1.5, 1.500_01, 1.501, 5.0] {
            let (min, max) = lit(height);
            assert!(
                if reaches { min > 0.1 } else { max == 0.0 },
                "{kind:?}, screen at {height}: {min}..{max}"
            );
        }
    }
    // Off the origin, in a ceiling that rounds.
    for at in [[0.0; 3], [100.1, 37.3, -250.7], [1e4, -1e4, 3e4]] {
        let p = |v: V3| add_scaled(at, 1.0, v);
        let room = cuboid(p([-1.03, 0.0, -1.51]), p([1.21, 1.37, 1.7]), true);
        let world = World::new().with(room, matte([0.9; 3])).with_light(point(p([0.1, 1.37, 0.2])), [1.0; 3]);
        let camera = pinhole(p([0.8, 0.7, 0.6]), p([-0.3, 0.0, -0.2]), 30.0);
        let picture = picture(&world.prepare(), &camera, &settings(48, 48, 1, 1, 0));
        assert!(picture.min() > 0.01, "{at:?}: {}", picture.min());
    }
}

/// A light at the very point that is shaded, or in the plane of the surface, lights nothing there and breaks nothing.
#[test]
fn lights_on_the_surface_itself() {
    for p in [[0.0; 3], [0.5, 0.0, 0.0], [1e-20, 0.0, 0.0], [0.0, 1e-30, 0.0]] {
        let world = World::new().with(floor(), metal([0.9; 3], 0.5)).with_light(point(p), [1.0; 3]);
        let picture = picture(&world.prepare(), &view(), &settings(4, 4, 16, 3, 0));
        assert_eq!(picture.max(), 0.0, "{p:?}");
    }
}

/// What cannot shine is not counted, and a scene with nothing else gets its stand-in; a punctual light is light enough.
#[test]
fn lights_are_counted() {
    let dark = World::new().with(floor(), matte([0.5; 3]));
    let repaired = |world: &World| world.prepare().repairs().iter().any(|r| r.what.contains("no light"));
    assert!(repaired(&dark));
    let bad = dark
        .clone()
        .with_light(point([f64::NAN; 3]), [1.0; 3])
        .with_light(point([0.0; 3]), [0.0; 3])
        .with_light(LightKind::Directional { direction: [0.0; 3] }, [1.0; 3]);
    assert!(repaired(&bad));
    assert_eq!(bad.prepare().punctual_light_count(), 0);
    let lit = bad.with_light(point([0.0, 1.0, 0.0]), [1.0; 3]);
    assert!(!repaired(&lit));
    let scene = lit.prepare();
    assert_eq!((scene.punctual_light_count(), scene.light_count()), (1, 0));
}

#[test]
fn a_thousand_points() {
    let mut random = Random(3);
    let mut world = World::new().with(floor(), matte([0.6; 3]));
    let mut expected = 0.0;
    for i in 0..1000 {
        let p = random.point(-1.5, 1.5);
        let p = f32s([p[0], 1.7 + 0.3 * p[1], p[2]]).map(f64::from);
        let intensity = (random.unit().powi(4) * 50.0) as f32;
        let (inner, outer) = (0.99f32, 0.2f32);
        let mut falloff = 1.0;
        let kind = if i % 3 == 0 {
            let direction = f32s(unit([0.3 * p[0], -1.0, 0.1]));
            let cos = -dot(direction.map(f64::from), unit(p));
            falloff = ((cos - f64::from(outer)) / f64::from(inner - outer)).clamp(0.0, 1.0).powi(2);
            LightKind::Spot { position: f32s(p), direction, cos_inner: inner, cos_outer: outer }
        } else {
            point(p)
        };
        expected += f64::from(intensity) * falloff * unit(p)[1] / dot(p, p);
        world = world.with_light(kind, [intensity; 3]);
    }
    let expected = f64::from(0.6f32) / PI * expected;
    measure(&world.prepare(), &view(), 1, 256).assert_grey(expected, 3e-3, "a thousand lights");
}

fn sum_of(parts: &[Measured], c: usize) -> (f64, f64) {
    parts.iter().fold((0.0, 0.0), |(m, s), p| (m + p.0[c].0, f64::hypot(s, p.0[c].1)))
}

/// All kinds of light together give the sum of what each gives alone, on a rough and on a shiny floor, direct and over
/// several bounces.
#[test]
fn kinds_of_light_add_up() {
    for (material, depth) in [(matte([0.7, 0.5, 0.3]), 1), (metal([0.9; 3], 0.5), 1), (matte([0.8; 3]), 4)] {
        let base = World::new()
            .with(floor(), material)
            .with(cuboid([-1.2, 0.0, -0.8], [-0.6, 0.9, 0.3], false), matte([0.6; 3]));
        // The area light is there, dark, when others shine: it blocks.
        let quad = || rectangle([0.4, 1.4, 0.6], [0.3, 0.0, 0.0], [0.0, 0.1, 0.3]);
        let area =
            |w: World, on: bool| w.with(quad(), if on { light([6.0, 5.0, 4.0]) } else { matte([0.0; 3]) });
        let points = |w: World| {
            let spot = LightKind::Spot {
                position: [1.0, 1.0, 1.0],
                direction: f32s(unit([-1.0, -1.0, -1.0])),
                cos_inner: 0.98,
                cos_outer: 0.6,
            };
            let sun = LightKind::Directional { direction: f32s(unit([0.2, -1.0, 0.4])) };
            w.with_light(point([0.5, 0.8, -0.9]), [1.0, 2.0, 3.0])
                .with_light(spot, [4.0, 3.0, 2.0])
                .with_light(sun, [0.5, 0.6, 0.7])
        };
        let around = |w: World| {
            w.with_environment_map(environment_map(8, 4, |x, y| {
                [0.1 + 0.2 * (x + 1) as f32 / (y + 1) as f32; 3]
            }))
        };
        let constant = |w: World| w.with_environment([0.3, 0.4, 0.5]);
        let run =
            |w: World, seed: u64| measure_with(&w.prepare(), &view(), &settings(24, 24, 256, depth, seed));
        for map in [true, false] {
            let sky = |w: World| if map { around(w) } else { constant(w) };
            let parts = [
                run(area(base.clone(), true), 1),
                run(points(area(base.clone(), false)), 2),
                run(sky(area(base.clone(), false)), 3),
            ];
            let pairs = run(points(area(base.clone(), true)), 4);
            let all = run(sky(points(area(base.clone(), true))), 5);
            for c in 0..3 {
                for (whole, parts, what) in
                    [(&all, &parts[..], "all"), (&pairs, &parts[..2], "area and points")]
                {
                    let (sum, error) = sum_of(parts, c);
                    let (mean, sigma) = whole.0[c];
                    let sigma = sigma.hypot(error);
                    assert!(
                        (mean - sum).abs() < 4.0 * sigma,
                        "{what}, depth {depth}: {mean} for {sum}, sigma {sigma}"
                    );
                    assert!(sigma < 0.01 * sum, "{what}, depth {depth}: sigma {sigma} of {sum}");
                }
            }
        }
    }
}

/// A lamp and a panel under a roof, with a sun over a scene so large that its power is 10^9 times theirs: what is rarely
/// chosen must not be missing.
#[test]
fn lamps_are_found_beside_a_mighty_sun() {
    let lamp = [0.3, 1.0, 0.2];
    let ground = rectangle([0.0, -50.0, 0.0], [0.0, 0.0, 1e4], [1e4, 0.0, 0.0]);
    let roof = rectangle([0.0, 2.0, 0.0], [40.0, 0.0, 0.0], [0.0, 0.0, 40.0]);
    let world = World::new()
        .with(floor(), matte([0.5; 3]))
        .with(ground, matte([0.2; 3]))
        .with(roof, matte([0.0; 3]))
        .with_light(point(lamp), [1.0; 3])
        .with_light(LightKind::Directional { direction: [0.0, -1.0, 0.0] }, [1000.0; 3]);
    let expected = 0.5 / PI * unit(lamp)[1] / dot(lamp, lamp);
    measure(&world.prepare(), &view(), 1, 512).assert_grey(expected, 0.02, "lamp");
    // An environment of far more power beside both.
    let map = environment_map(4, 2, |_, _| [1e6; 3]);
    let world = world
        .with(cuboid([-9.0, -9.0, -9.0], [9.0, 9.0, 9.0], true), matte([0.0; 3]))
        .with_environment_map(map);
    measure(&world.prepare(), &view(), 1, 1024).assert_grey(expected, 0.02, "lamp in a box");
}

/// A point light in the middle of a closed sphere of albedo ρ: each wall gets I/r² and, from all others alike, the
/// geometric series of it.
#[test]
fn a_lamp_in_an_integrating_sphere() {
    let (r, rho) = (1.5, 0.7f32);
    let ball = sphere([0.0; 3], r, 5, true);
    let world = World::new().with(ball, matte([rho; 3])).with_light(point([0.0; 3]), [2.0; 3]);
    let scene = world.prepare();
    let camera = pinhole([0.4, 0.3, -0.2], [-1.0, 0.1, 0.3], 90.0);
    for depth in [1, 2, 5, 200] {
        let rho = f64::from(rho);
        let expected = 2.0 / (r * r) / PI * rho * (1.0 - rho.powi(depth)) / (1.0 - rho);
        let mean = picture(&scene, &camera, &settings(32, 32, 64, depth as u32, 1)).mean()[0];
        // The faceted sphere is a little inside of the round one: some 1e-3.
        assert!((mean / expected - 1.0).abs() < 4e-3, "depth {depth}: {mean} for {expected}");
    }
}
