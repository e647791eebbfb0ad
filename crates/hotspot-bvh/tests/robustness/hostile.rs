//! Geometry made to degrade the tree: it still builds, on a small stack, and answers as the loop does.

use crate::support::{QUALITIES, Rng, Scene, Triangle, narrow, point_on, towards};
use hotspot_bvh::Quality;

/// Builds and checks on a stack of 512 KiB, on which deep recursion would fail.
fn on_a_small_stack(triangles: &[Triangle], rays: usize) {
    let work = || {
        for quality in QUALITIES {
            let scene = Scene::new(triangles.to_vec(), quality);
            let mut rng = Rng::new(60);
            for _ in 0..rays {
                let at = *rng.pick(&scene.triangles);
                let near = *rng.pick(&scene.triangles);
                let origin = if rng.coin() { narrow(rng.cube()) } else { point_on(&mut rng, &near) };
                scene.check(&towards(origin, point_on(&mut rng, &at)));
            }
        }
    };
    std::thread::scope(|scope| {
        std::thread::Builder::new().stack_size(512 << 10).spawn_scoped(scope, work).unwrap().join().unwrap();
    });
}

/// Triangles of size 2^i at 2^i, from 2^−120 to 2^60 and to 2^126: nested boxes, one chain.
#[test]
fn geometric_progression() {
    for last in [60, 126] {
        let triangles: Vec<Triangle> = (-120..=last)
            .map(|i| {
                let s = 2f32.powi(i);
                [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]]
            })
            .collect();
        on_a_small_stack(&triangles, 300);
    }
}

/// The same around the origin, with eight triangles for each size: every box contains all smaller ones, and a ray from
/// the middle enters all of them.
#[test]
fn nested_octahedra() {
    let mut triangles = Vec::new();
    for i in -60..=40 {
        let s = 2f32.powi(i);
        for sign in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|bit| if sign >> bit & 1 == 0 { s } else { -s });
            triangles.push([[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]]);
        }
    }
    on_a_small_stack(&triangles, 300);
    // All shells are entered: from the middle the smallest is hit, beyond it the next.
    let scene = Scene::new(triangles, Quality::Medium);
    let mut ray = hotspot_bvh::Ray::new([0.0; 3], [1.0, 0.5, 0.25]);
    for shell in 0..101u32 {
        let hit = scene.check(&ray).unwrap();
        assert_eq!(hit.primitive, 8 * shell);
        ray.t_min = hit.t;
    }
    assert_eq!(scene.check(&ray), None);
}

/// 5 000 times the same triangle: no split separates anything.
#[test]
fn identical_triangles() {
    on_a_small_stack(&vec![[[0.1, 0.0, 0.0], [1.0, 0.2, 0.0], [0.0, 1.0, 0.3]]; 5000], 40);
}

/// 3 000 triangles whose boxes have one centre but growing sizes.
#[test]
fn concentric_triangles() {
    let triangles: Vec<Triangle> = (1..=3000)
        .map(|i| {
            let s = i as f32 / 1024.0;
            [[-s, -s, -s], [s, s, -s], [-s, s, s]]
        })
        .collect();
    on_a_small_stack(&triangles, 60);
}

/// Centroids on a line along an axis, along a diagonal, and at exponentially growing distances.
#[test]
fn collinear_centroids() {
    for direction in [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, -0.3, 0.01]] {
        for exponential in [false, true] {
            let triangles: Vec<Triangle> = (0..2000)
                .map(|i| {
                    let at = if exponential { 1.02f64.powi(i - 1000) } else { f64::from(i) / 1000.0 };
                    let size = at / 500.0 + 1e-6;
                    let corner = |x: f64, y: f64, z: f64| narrow([x, y, z].map(|c| c * size)).map(f64::from);
                    let offsets = [corner(1.0, 0.0, -1.0), corner(-1.0, 1.0, 0.0), corner(0.0, -1.0, 1.0)];
                    offsets.map(|o| narrow(core::array::from_fn(|k| direction[k] * at + o[k])))
                })
                .collect();
            on_a_small_stack(&triangles, 40);
        }
    }
}

/// One giant across many dwarfs.
#[test]
fn a_giant_among_dwarfs() {
    let mut rng = Rng::new(61);
    let mut triangles = crate::support::soup(&mut rng, 2000, 1e-3);
    triangles.insert(1000, [[-1e9, -1e9, 0.1], [1e9, -1e9, 0.1], [0.0, 1e9, 0.1]]);
    on_a_small_stack(&triangles, 150);
}
