//! Equal distances, degenerate triangles, and triangles that no tree can hold.

use crate::meshes::grid_box;
use crate::support::{
    QUALITIES, Rng, Scene, Triangle, along, bits, narrow, point_on, soup, sub, towards, wide,
};
use hotspot_bvh::oracle;
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh, BvhError, NoProbe, Quality};

/// Each triangle five times, shuffled, some with their corners rotated or reversed: the lowest index wins, under every
/// instruction set. 3 qualities × 2 000 rays.
#[test]
fn coplanar_duplicates_are_won_by_the_lowest_index() {
    for quality in QUALITIES {
        let mut rng = Rng::new(30);
        let mut originals = soup(&mut rng, 40, 0.4);
        originals.extend(grid_box("box", 2, 0.0, [1.0; 3]).triangles());
        let mut triangles: Vec<Triangle> = originals.iter().flat_map(|t| [*t; 5]).collect();
        for i in (1..triangles.len()).rev() {
            triangles.swap(i, rng.below(i + 1));
        }
        let first = |t: &Triangle| triangles.iter().position(|other| other == t).unwrap();
        let trees = [Isa::Portable, Isa::Auto, Isa::Avx2]
            .map(|isa| Bvh::build(&triangles, BuildOptions { quality, isa, ..Default::default() }).unwrap());
        for _ in 0..2000 {
            let origin = narrow(rng.cube().map(|c| 2.0 * c));
            let target = *rng.pick(&triangles);
            let ray = towards(origin, point_on(&mut rng, &target));
            let expected = oracle::brute_force(&triangles, &ray);
            for tree in &trees {
                assert_eq!(bits(tree.closest_hit(&ray, NoProbe)), bits(expected));
            }
            if let Some(hit) = expected {
                let winner = hit.primitive as usize;
                assert_eq!(winner, first(&triangles[winner]), "{ray:?}");
            }
        }
    }
}

/// Coplanar triangles that overlap without being equal: the lowest index at the winning distance wins.
#[test]
fn overlapping_coplanar_triangles() {
    let mut rng = Rng::new(31);
    let triangles: Vec<Triangle> =
        (0..300).map(|_| core::array::from_fn(|_| [rng.signed() as f32, rng.signed() as f32, 0.5])).collect();
    let scene = Scene::new(triangles, Quality::High);
    for _ in 0..2000 {
        let target = [0.8 * rng.signed() as f32, 0.8 * rng.signed() as f32, 0.5];
        let ray = towards(narrow(rng.cube().map(|c| 3.0 * c)), target);
        if let Some(hit) = scene.check(&ray) {
            let lower = &scene.triangles[..hit.primitive as usize];
            // None with a lower index is hit at this distance.
            let earlier = oracle::brute_force(lower, &ray);
            assert!(earlier.is_none_or(|h| h.t > hit.t), "{earlier:?} {hit:?}");
        }
    }
}

/// Points, segments along axes, exact multiples of a step, doubled corners.
fn degenerate(rng: &mut Rng) -> Triangle {
    let from = rng.cube().map(|c| (c * 1024.0).round() / 1024.0);
    let step = rng.cube().map(|c| (c * 64.0).round() / 1024.0);
    let (second, third) = (rng.below(9) as f64 - 4.0, rng.below(9) as f64 - 4.0);
    let line: Triangle = [narrow(from), narrow(along(from, step, second)), narrow(along(from, step, third))];
    match rng.below(4) {
        0 => [narrow(from); 3],
        1 => {
            let mut t = [narrow(from); 3];
            t[2][rng.below(3)] += 0.5;
            t
        }
        _ => line,
    }
}

/// Zero-area triangles among others: none is ever hit, and the others answer as if they were alone. 3 qualities × 3 000
/// rays, most of them at degenerate triangles.
#[test]
fn degenerate_triangles_are_never_hit() {
    for quality in QUALITIES {
        let mut rng = Rng::new(32);
        let good = soup(&mut rng, 200, 0.3);
        let mut mixed = Vec::new();
        let mut index_of = Vec::new();
        for t in &good {
            for _ in 0..rng.below(4) {
                mixed.push(degenerate(&mut rng));
            }
            index_of.push(mixed.len() as u32);
            mixed.push(*t);
        }
        let alone = Scene::new(good, quality);
        let scene = Scene::new(mixed, quality);
        for _ in 0..3000 {
            let origin = narrow(rng.cube().map(|c| 1.5 * c));
            let at = *rng.pick(&scene.triangles);
            let ray = towards(origin, point_on(&mut rng, &at));
            let expected = alone.check(&ray).map(|h| (index_of[h.primitive as usize], h.t.to_bits()));
            assert_eq!(scene.check(&ray).map(|h| (h.primitive, h.t.to_bits())), expected, "{ray:?}");
        }
    }
}

/// Nothing but degenerate triangles.
#[test]
fn only_degenerate_triangles() {
    for quality in QUALITIES {
        let mut rng = Rng::new(33);
        let triangles: Vec<_> = (0..500).map(|_| degenerate(&mut rng)).collect();
        for triangles in [triangles, vec![[[0.5; 3]; 3]; 300]] {
            let scene = Scene::new(triangles, quality);
            for _ in 0..300 {
                let at = *rng.pick(&scene.triangles);
                let ray = towards(narrow(rng.cube()), point_on(&mut rng, &at));
                assert_eq!(scene.check(&ray), None);
            }
        }
    }
}

/// The first coordinate that is not finite is named, wherever it stands.
#[test]
fn coordinates_that_are_not_finite_are_an_error() {
    let good = soup(&mut Rng::new(34), 20, 0.5);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for index in [0, 7, 19] {
            for corner in 0..3 {
                for axis in 0..3 {
                    let mut triangles = good.clone();
                    triangles[index][corner][axis] = bad;
                    triangles[19][2][2] = f32::NAN;
                    let error = Bvh::build(&triangles, BuildOptions::default()).unwrap_err();
                    assert_eq!(error, BvhError::NotFinite { mesh: None, triangle: index });
                    assert!(error.to_string().contains(&format!("triangle {index} ")), "{error}");
                }
            }
        }
    }
}

/// Two triangles that share an edge: a ray at the edge hits one of them, and the same one in either order of corners.
#[test]
fn shared_edges_belong_to_both() {
    let mut rng = Rng::new(35);
    for _ in 0..2000 {
        let [a, b, c, d] = core::array::from_fn(|_| narrow(rng.cube()));
        let scene = Scene::new(vec![[a, b, c], [b, a, d]], Quality::Fast);
        let turned = Scene::new(vec![[b, c, a], [d, b, a]], Quality::Fast);
        let t = rng.unit();
        let target = narrow(along(wide(a), sub(wide(b), wide(a)), t));
        let ray = towards(narrow(rng.cube()), target);
        let (one, other) = (scene.check(&ray), turned.check(&ray));
        assert_eq!(one.map(|h| h.primitive), other.map(|h| h.primitive), "{ray:?}");
    }
}
