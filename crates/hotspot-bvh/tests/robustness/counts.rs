//! What probes are told. [`Scene::check`] compares every ray of every room with the recursive oracle; here are the cases
//! that it cannot see: absolute numbers, and rays without a traversal.

use crate::support::{Heard, Listener, Rng, Scene, narrow, point_on, soup, towards};
use hotspot_bvh::oracle::Counts;
use hotspot_bvh::{Quality, Ray, WIDTH};

/// Both queries, as heard by a probe, under both instruction sets.
fn heard(scene: &Scene, ray: &Ray) -> Vec<Heard> {
    let mut all = Vec::new();
    for tree in &scene.trees {
        let (mut closest, mut any) = (Heard::default(), Heard::default());
        tree.closest_hit(ray, Listener(&mut closest));
        tree.occluded(ray, Listener(&mut any));
        all.extend([closest, any]);
    }
    all
}

/// No tree, or a ray that is not finite: nothing is visited, and the end is told once.
#[test]
fn nothing_to_visit() {
    let empty = Scene::new(Vec::new(), Quality::Medium);
    let full = Scene::new(soup(&mut Rng::new(40), 100, 0.3), Quality::Medium);
    let cases = [
        (&empty, Ray::new([0.0; 3], [0.0, 0.0, 1.0])),
        (&full, Ray::new([f32::NAN; 3], [0.0, 0.0, 1.0])),
        (&full, Ray::new([0.0; 3], [f32::INFINITY, 0.0, 1.0])),
    ];
    for (scene, ray) in cases {
        for heard in heard(scene, &ray) {
            assert_eq!((heard.counts, heard.finished), (Counts::default(), vec![false]));
        }
    }
}

/// Up to eight triangles may be one block: then the leaf is the root and every ray tests it once, whole.
#[test]
fn a_single_block_is_always_tested() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for count in 1..=8u64 {
        let scene = Scene::new(vec![triangle; count as usize], Quality::Medium);
        let aside = Ray::new([5.0; 3], [0.0, 0.0, 1.0]);
        let at_it = Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]);
        for ray in [aside, at_it] {
            for heard in heard(&scene, &ray) {
                assert_eq!(
                    heard.counts,
                    Counts { nodes: 0, boxes: 0, leaves: 1, shapes: count, instances: 0 }
                );
            }
        }
    }
}

/// The root is visited even by a ray that misses everything, or whose interval is empty; and only it.
#[test]
fn the_root_is_visited_once() {
    let scene = Scene::new(soup(&mut Rng::new(41), 1000, 0.1), Quality::Medium);
    let away = Ray::new([5.0; 3], [1.0, 0.3, 0.2]);
    let reversed = Ray { t_min: 3.0, t_max: 1.0, ..Ray::new([0.0; 3], [0.0, 0.0, 1.0]) };
    for ray in [away, reversed] {
        for heard in heard(&scene, &ray) {
            assert_eq!((heard.counts.nodes, heard.counts.leaves), (1, 0));
            assert!((2..=u64::from(WIDTH)).contains(&heard.counts.boxes));
        }
        scene.check(&ray);
    }
}

/// No node or block is visited twice by one ray; an occluded query never visits more than the whole tree; both
/// instruction sets make the same visits in the same order. 2 000 rays.
#[test]
fn visits_are_unique_and_equal_in_order() {
    let mut rng = Rng::new(42);
    let scene = Scene::new(soup(&mut rng, 3000, 0.1), Quality::High);
    for _ in 0..2000 {
        let at = *rng.pick(&scene.triangles);
        let ray = towards(narrow(rng.cube()), point_on(&mut rng, &at));
        let all = heard(&scene, &ray);
        assert_eq!(all[0].node_ids, all[2].node_ids);
        assert_eq!(all[0].leaf_ids, all[2].leaf_ids);
        assert_eq!(all[1].node_ids, all[3].node_ids);
        assert_eq!(all[1].leaf_ids, all[3].leaf_ids);
        for heard in &all {
            let mut nodes = heard.node_ids.clone();
            let mut leaves = heard.leaf_ids.clone();
            nodes.sort_unstable();
            leaves.sort_unstable();
            nodes.dedup();
            leaves.dedup();
            assert_eq!((nodes.len(), leaves.len()), (heard.node_ids.len(), heard.leaf_ids.len()));
            assert_eq!(heard.node_ids.first(), Some(&0));
        }
    }
}

/// The oracle shares the slab test with the traversal, so here is a case whose count is known: the ray runs in the common
/// side plane of all boxes (0 · ∞ on that axis), away from them. Only the root is visited.
#[test]
fn boxes_behind_a_ray_in_their_side_plane_are_not_entered() {
    for side in 0..3 {
        for forward in [(side + 1) % 3, (side + 2) % 3] {
            for sign in [1.0, -1.0] {
                let mut rng = Rng::new(43);
                let triangles = (0..300)
                    .map(|_| {
                        let at = rng.cube();
                        core::array::from_fn(|corner| {
                            let mut p = narrow(at.map(|c| c + 0.1 * rng.signed()));
                            // One corner on the plane, the others on one side of it.
                            p[side] = if corner == 0 { 0.0 } else { sign * p[side].abs() };
                            p
                        })
                    })
                    .collect();
                let scene = Scene::new(triangles, Quality::Medium);
                for zero in [0.0, -0.0] {
                    let (mut origin, mut direction) = ([0.0; 3], [zero; 3]);
                    origin[forward] = 10.0 * sign;
                    direction[forward] = sign;
                    let ray = Ray::new(origin, direction);
                    assert_eq!(scene.check(&ray), None);
                    for heard in heard(&scene, &ray) {
                        assert_eq!((heard.counts.nodes, heard.counts.leaves), (1, 0), "{ray:?}");
                    }
                }
            }
        }
    }
}
