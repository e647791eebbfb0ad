//! Tree and loop agree exactly: same triangle, same bits of t, u, v and normal, same counts.

use crate::meshes::{grid_box, icosphere};
use crate::support::{QUALITIES, Rng, Scene, Triangle, along, narrow, point_on, scaled, soup, towards, wide};
use hotspot_bvh::{Quality, Ray};

/// Origins near the scene, rays random or at points, edges and corners of triangles.
fn ray(rng: &mut Rng, triangles: &[Triangle], scale: f64) -> Ray {
    let origin = narrow(rng.cube().map(|c| 1.5 * scale * c));
    if triangles.is_empty() || rng.below(4) == 0 {
        return Ray::new(origin, narrow(rng.direction()));
    }
    let at = rng.below(triangles.len());
    towards(origin, point_on(rng, &triangles[at]))
}

/// 11 sizes × 3 qualities, 300 rays each (60 for 20 000 triangles).
#[test]
fn random_soups_of_every_size_and_quality() {
    for size in [0, 1, 2, 7, 8, 9, 63, 64, 65, 1000, 20_000] {
        for quality in QUALITIES {
            let mut rng = Rng::new(size as u64);
            // Small sizes need large triangles to be hit at all.
            let triangles = soup(&mut rng, size, 1.0 / (1.0 + size as f64).sqrt());
            let scene = Scene::new(triangles, quality);
            assert_eq!(scene.trees[0].triangle_count(), size);
            let count = if size > 1000 { 60 } else { 300 };
            let hits = (0..count)
                .filter(|_| {
                    let ray = ray(&mut rng, &scene.triangles, 1.0);
                    scene.check(&ray).is_some()
                })
                .count();
            assert!(size == 0 || hits > count / 3, "{hits} hits of {size} triangles");
        }
    }
}

/// Every triangle is in exactly one block: nothing is split, dropped or doubled.
#[test]
fn every_triangle_lies_in_one_block() {
    for size in [0, 1, 2, 7, 8, 9, 63, 64, 65, 1000, 20_000] {
        for quality in QUALITIES {
            let scene = Scene::new(soup(&mut Rng::new(1), size, 0.1), quality);
            for tree in &scene.trees {
                let mut held: Vec<u32> =
                    (0..tree.block_count() as u32).flat_map(|b| tree.block_triangles(b)).collect();
                held.sort_unstable();
                assert!(held.into_iter().eq(0..size as u32));
            }
        }
    }
}

/// Origins on a vertex, on an edge, inside a face; directions random, within the face's plane, and along its edges.
/// 3 scenes × 5 000 rays.
#[test]
fn origins_on_the_surface() {
    let mut rng = Rng::new(2);
    for triangles in [
        icosphere(2, 0.0, 1.0).triangles(),
        grid_box("box", 4, 1e3, [1.0; 3]).triangles(),
        soup(&mut rng, 300, 0.3),
    ] {
        let scene = Scene::new(triangles, Quality::Medium);
        for _ in 0..5000 {
            let t = *rng.pick(&scene.triangles);
            let origin = point_on(&mut rng, &t);
            let direction = match rng.below(4) {
                0 => narrow(rng.direction()),
                1 => core::array::from_fn(|i| t[1][i] - t[0][i]),
                2 => towards(origin, point_on(&mut rng, &t)).direction,
                _ => {
                    let mut d = [0.0, -0.0, 0.0];
                    d[rng.below(3)] = if rng.coin() { 1.0 } else { -1.0 };
                    d
                }
            };
            scene.check(&Ray::new(origin, direction));
        }
    }
}

/// All 16³ directions whose components are zero, denormal, tiny, ordinary or huge, from three origins; the zero
/// direction hits nothing. 12 288 rays.
#[test]
fn directions_with_awkward_components() {
    let pool = [
        0.0, -0.0, 1e-45, -1e-45, 1e-40, -1e-39, 1.2e-38, 1e-30, -1e-20, 1e-8, -1e-7, 1.0, -1.0, 0.3, 1e20,
        -3e20,
    ];
    let mut rng = Rng::new(3);
    let mut triangles = soup(&mut rng, 60, 0.5);
    triangles.extend(grid_box("box", 2, 0.0, [1.0; 3]).triangles());
    let scene = Scene::new(triangles, Quality::Medium);
    let origins = [[0.0; 3], [-0.0, 0.5, 1.0], [0.25, -0.125, 0.1]];
    for origin in origins {
        for x in pool {
            for y in pool {
                for z in pool {
                    let hit = scene.check(&Ray::new(origin, [x, y, z]));
                    assert!([x, y, z] != [0.0; 3] || hit.is_none());
                }
            }
        }
    }
}

/// Lengths from 1e-20 to 1e20 find the same triangle; for powers of two t scales exactly. 61 lengths × 100 rays.
#[test]
fn directions_of_any_length() {
    let scene = Scene::new(icosphere(2, 0.0, 1.0).triangles(), Quality::Medium);
    let mut rng = Rng::new(4);
    for _ in 0..100 {
        let base = ray(&mut rng, &scene.triangles, 1.0);
        let reference = scene.check(&base);
        for exponent in (-66..=66).step_by(6) {
            let scale = 2f32.powi(exponent);
            let hit = scene.check(&Ray::new(base.origin, base.direction.map(|c| c * scale)));
            assert_eq!(
                hit.map(|h| (h.primitive, h.t * scale)),
                reference.map(|h| (h.primitive, h.t)),
                "{base:?}"
            );
            assert_eq!(hit.map(|h| (h.u, h.v, h.normal)), reference.map(|h| (h.u, h.v, h.normal)));
        }
        for exponent in -20..=20 {
            let scale = 10f32.powi(exponent);
            scene.check(&Ray::new(base.origin, base.direction.map(|c| c * scale)));
        }
    }
}

/// Rays and scene of one scale; aimed rays must hit at every one, although products of coordinates overflow and underflow
/// f32; only where directions are denormal and 1/d is infinite, tree and loop need but agree. 12 scales × 400 rays.
#[test]
fn scenes_of_any_size() {
    for exponent in [-40, -36, -30, -18, -9, -6, 0, 4, 8, 18, 30, 38] {
        let scale = 10f64.powi(exponent);
        let mut rng = Rng::new(5);
        let unit = soup(&mut rng, 200, 0.2);
        let scene = Scene::new(scaled(&unit, scale), Quality::Medium);
        let hits = (0..400)
            .filter(|_| {
                let ray = ray(&mut rng, &scene.triangles, scale);
                scene.check(&ray).is_some()
            })
            .count();
        assert!(exponent < -37 || hits > 150, "{hits} hits at 1e{exponent}");
    }
}

/// Triangles of 1e-6 around points of the unit cube. 3 000 rays.
#[test]
fn tiny_triangles() {
    let mut rng = Rng::new(6);
    let scene = Scene::new(soup(&mut rng, 1000, 1e-6), Quality::Medium);
    let hits = (0..3000)
        .filter(|_| {
            let ray = ray(&mut rng, &scene.triangles, 1.0);
            scene.check(&ray).is_some()
        })
        .count();
    assert!(hits > 500, "{hits}");
}

/// Slivers 1e9 times longer than wide, in random directions and along axes. 3 000 rays.
#[test]
fn slivers() {
    let mut rng = Rng::new(7);
    let triangles: Vec<Triangle> = (0..500)
        .map(|_| {
            let from = rng.cube();
            let mut direction = rng.direction();
            if rng.coin() {
                direction = [0.0; 3];
                direction[rng.below(3)] = 1.0;
            }
            // The width shows only where coordinates are small enough for it.
            let from = from.map(|c| c * rng.magnitude(-9.0, 0.0));
            [narrow(from), narrow(along(from, direction, 1.0)), narrow(along(from, rng.direction(), 1e-9))]
        })
        .collect();
    let scene = Scene::new(triangles, Quality::Medium);
    let hits = (0..3000)
        .filter(|_| {
            let ray = ray(&mut rng, &scene.triangles, 1.0);
            scene.check(&ray).is_some()
        })
        .count();
    assert!(hits > 30, "{hits}");
}

/// Triangles from 1e-4 to 1e5 in one scene, origins and targets at every scale. 4 000 rays.
#[test]
fn scale_of_a_billion_within_one_scene() {
    let mut rng = Rng::new(8);
    let triangles: Vec<Triangle> = (0..600)
        .map(|_| {
            let (place, size) = (rng.magnitude(-4.0, 5.0), rng.magnitude(-4.0, 5.0));
            let centre = rng.cube().map(|c| c * place);
            core::array::from_fn(|_| narrow(along(centre, rng.cube(), size)))
        })
        .collect();
    let scene = Scene::new(triangles, Quality::Medium);
    let mut hits = 0;
    for _ in 0..4000 {
        let scale = rng.magnitude(-4.0, 5.0);
        let ray = ray(&mut rng, &scene.triangles, scale);
        hits += usize::from(scene.check(&ray).is_some());
    }
    assert!(hits > 2000, "{hits}");
}

/// Coordinates around 1e8, where a unit in the last place is 8. 3 000 rays.
#[test]
fn coordinates_around_a_hundred_million() {
    let mut rng = Rng::new(9);
    let offset = [1e8, -0.9e8, 0.7e8];
    let triangles: Vec<Triangle> =
        soup(&mut rng, 500, 0.2).iter().map(|t| t.map(|v| narrow(along(offset, wide(v), 1e4)))).collect();
    let scene = Scene::new(triangles, Quality::Medium);
    let mut hits = 0;
    for _ in 0..3000 {
        let mut ray = ray(&mut rng, &scene.triangles, 1e8);
        if rng.coin() {
            let near = narrow(along(offset, rng.cube(), 2e4));
            let at = *rng.pick(&scene.triangles);
            ray = towards(near, point_on(&mut rng, &at));
        }
        hits += usize::from(scene.check(&ray).is_some());
    }
    assert!(hits > 1500, "{hits}");
}

/// Rays whose origin or direction is not finite hit nothing and end.
#[test]
fn rays_that_are_not_finite_hit_nothing() {
    let scene = Scene::new(icosphere(1, 0.0, 1.0).triangles(), Quality::Medium);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = ([0.0; 3], [0.1, 0.2, 1.0]);
            origin[axis] = bad;
            assert_eq!(scene.check(&Ray::new(origin, [0.1, 0.2, 1.0])), None);
            direction[axis] = bad;
            assert_eq!(scene.check(&Ray::new([0.0; 3], direction)), None);
        }
    }
}
