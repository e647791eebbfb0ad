//! Hits count in the open interval (`t_min`, `t_max`), to the last bit.

use crate::meshes::grid_box;
use crate::support::{Rng, Scene, point_on, soup, towards};
use hotspot_bvh::{Quality, Ray};

fn scene(rng: &mut Rng) -> Scene {
    let mut triangles = soup(rng, 400, 0.3);
    triangles.extend(grid_box("box", 3, 0.0, [1.0; 3]).triangles());
    Scene::new(triangles, Quality::Medium)
}

fn ray(rng: &mut Rng, scene: &Scene) -> Ray {
    let origin = rng.cube().map(|c| (2.0 * c) as f32);
    let target = *rng.pick(&scene.triangles);
    towards(origin, point_on(rng, &target))
}

/// An end exactly at a hit excludes it, one representable number further includes it. 3 000 rays, 5 intervals each.
#[test]
fn ends_at_a_hit() {
    let mut rng = Rng::new(20);
    let scene = scene(&mut rng);
    for _ in 0..3000 {
        let ray = ray(&mut rng, &scene);
        let Some(hit) = scene.check(&ray) else { continue };
        assert_eq!(scene.check(&Ray { t_max: hit.t, ..ray }), None);
        assert_eq!(scene.check(&Ray { t_max: hit.t.next_up(), ..ray }), Some(hit));
        assert_eq!(scene.check(&Ray { t_min: hit.t.next_down(), ..ray }), Some(hit));
        let beyond = scene.check(&Ray { t_min: hit.t, ..ray });
        assert!(beyond.is_none_or(|h| h.t > hit.t));
        if let Some(beyond) = beyond {
            assert_eq!(scene.check(&Ray { t_min: hit.t, t_max: beyond.t, ..ray }), None);
        }
    }
}

/// Random ends, empty and reversed intervals among them, and −0. 5 000 rays.
#[test]
fn random_intervals() {
    let mut rng = Rng::new(21);
    let scene = scene(&mut rng);
    let ends = [0.0, -0.0, 1e-45, 1e-30, 0.25, 0.5, 1.0, 2.0, 1e30, f32::MAX, f32::INFINITY];
    for _ in 0..5000 {
        let mut ray = ray(&mut rng, &scene);
        ray.t_min = if rng.coin() { *rng.pick(&ends) } else { rng.unit() as f32 };
        ray.t_max = if rng.coin() { *rng.pick(&ends) } else { 2.0 * rng.unit() as f32 };
        let hit = scene.check(&ray);
        assert!(ray.t_min < ray.t_max || hit.is_none());
    }
}

/// An end that is NaN excludes everything.
#[test]
fn ends_that_are_nan() {
    let mut rng = Rng::new(22);
    let scene = scene(&mut rng);
    for _ in 0..500 {
        let ray = ray(&mut rng, &scene);
        assert_eq!(scene.check(&Ray { t_max: f32::NAN, ..ray }), None);
        assert_eq!(scene.check(&Ray { t_min: f32::NAN, ..ray }), None);
    }
}
