//! Filters: which hits count, which of them the filter is asked about, and what the probe hears of it.
//!
//! That traversal and recursive twin ask the same questions in the same order, [`Placement::check_filtered`] tests for
//! every ray.

use crate::instances::{placements, share};
use crate::placed::{
    BYTES, Everything, IDENTITY, Placement, Question, Recorder, affine, all_bits, closest, occluded,
};
use crate::support::{Heard, Listener, Rng, Scene, soup};
use hotspot_bvh::{Candidate, Filter, Hit, NO_INSTANCE, NoFilter, NoProbe, Quality, Ray, RayProbe};
use std::collections::HashSet;

/// A number in [0, 1) that instance and triangle decide.
fn lot(instance: u32, primitive: u32) -> f64 {
    Rng::new(u64::from(instance) << 32 | u64::from(primitive)).unit()
}

/// Which hits count.
#[derive(Clone, Copy, Debug)]
enum Mask {
    /// This share of all triangles.
    Share(f64),
    /// Every other square of a grid of so many squares over each triangle's barycentrics.
    Checkerboard(f32),
    /// One triangle only.
    Only(u32, u32),
}

impl Mask {
    fn counts(self, instance: u32, primitive: u32, (u, v): (f32, f32)) -> bool {
        match self {
            Self::Share(share) => lot(instance, primitive) < share,
            Self::Checkerboard(squares) => ((u * squares) as u32 + (v * squares) as u32).is_multiple_of(2),
            Self::Only(i, p) => (instance, primitive) == (i, p),
        }
    }
}

impl Filter for Mask {
    const ON: bool = true;
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool {
        probe.alpha(1, BYTES);
        self.counts(candidate.instance(), candidate.primitive(), candidate.barycentric())
    }
}

const MASKS: [Mask; 7] = [
    Mask::Share(0.0),
    Mask::Share(0.1),
    Mask::Share(0.5),
    Mask::Share(0.9),
    Mask::Share(1.0),
    Mask::Checkerboard(2.0),
    Mask::Checkerboard(16.0),
];

/// Returns the number of rays.
fn agree(work: usize, seed: u64) -> usize {
    let mut rays = 0;
    for quality in [Quality::Fast, Quality::High] {
        for placement in placements(quality) {
            if placement.name == "nothing" {
                continue;
            }
            let mut rng = Rng::new(seed);
            let count = share(&placement, work);
            rays += count;
            for _ in 0..count {
                let ray = placement.hostile_ray(&mut rng);
                for mask in MASKS {
                    let hit = placement.check_filtered(&ray, mask);
                    if let Some(h) = hit {
                        assert!(mask.counts(h.instance, h.primitive, (h.u, h.v)), "{mask:?} {h:?} {ray:?}");
                    }
                    if let Mask::Share(0.0) = mask {
                        assert_eq!(hit, None);
                    }
                    placement.check_filtered(&Placement::with_ends(&mut rng, &ray, hit), mask);
                }
            }
        }
    }
    rays
}

/// Some 3 500 rays, each with 7 masks and two pairs of ends.
#[test]
fn tree_loop_and_twin_agree() {
    agree(60_000, 90);
}

/// 10^6 rays per quality, each with 7 masks and two pairs of ends: as [`crate::instances`] counts.
#[test]
#[ignore = "minutes in release: 2e6 rays with 7 masks each"]
fn tree_loop_and_twin_agree_in_full() {
    let rays = agree(40_000_000, 91);
    assert!(rays >= 2_000_000, "{rays}");
}

/// A hit, whether there is any, and what probes heard of both queries.
type Answers = (Option<(u32, [u32; 7])>, bool, [Heard; 2]);

/// Both queries under every instruction set.
fn heard<F: Filter + Copy>(placement: &Placement, ray: &Ray, filter: F) -> Vec<Answers> {
    let ask = |tree| {
        let (mut nearest, mut any) = (Heard::default(), Heard::default());
        let hit = closest(tree, ray, filter, Listener(&mut nearest));
        let blocked = occluded(tree, ray, filter, Listener(&mut any));
        (all_bits(hit), blocked, [nearest, any])
    };
    placement.trees.iter().map(ask).collect()
}

/// A filter that lets everything count changes nothing but the look-ups; one that lets nothing count finds nothing.
#[test]
fn all_is_as_no_filter_and_nothing_is_nothing() {
    let mut rng = Rng::new(92);
    for placement in placements(Quality::Medium) {
        if placement.name == "nothing" {
            continue;
        }
        for _ in 0..share(&placement, 60_000) {
            let ray = placement.hostile_ray(&mut rng);
            let (all, none) = (heard(&placement, &ray, Everything), heard(&placement, &ray, NoFilter));
            for ((hit, blocked, all), (expected, expected_blocked, none)) in all.into_iter().zip(none) {
                assert_eq!((hit, blocked), (expected, expected_blocked), "{ray:?}");
                for (all, none) in all.iter().zip(&none) {
                    assert_eq!(all.counts, none.counts, "{ray:?}");
                    assert_eq!(all.node_ids, none.node_ids, "{ray:?}");
                    assert_eq!(all.leaf_ids, none.leaf_ids, "{ray:?}");
                    assert_eq!(all.instance_ids, none.instance_ids, "{ray:?}");
                    assert_eq!(all.finished, none.finished, "{ray:?}");
                    // NoFilter never asks.
                    assert_eq!(none.alpha, (0, 0));
                    assert_eq!(all.alpha.0 > 0, hit.is_some());
                }
            }
            for (hit, blocked, _) in heard(&placement, &ray, Mask::Share(0.0)) {
                assert_eq!((hit, blocked), (None, false), "{ray:?}");
            }
        }
    }
}

/// A tree without instances gives under a filter what a world of the accepted triangles alone gives.
#[test]
fn rejected_triangles_are_as_if_they_were_not_there() {
    let mut rng = Rng::new(93);
    let triangles = soup(&mut rng, 300, 0.4);
    for share in [0.1, 0.5, 0.9] {
        let kept: Vec<u32> = (0..300).filter(|&p| lot(NO_INSTANCE, p) < share).collect();
        let rest = Scene::new(kept.iter().map(|&p| triangles[p as usize]).collect(), Quality::Medium);
        let whole = Placement::new("whole", triangles.clone(), Vec::new(), &[], Quality::Medium);
        for _ in 0..400 {
            let ray = whole.hostile_ray(&mut rng);
            let expected = rest.check(&ray).map(|h| Hit { primitive: kept[h.primitive as usize], ..h });
            let hit = whole.check_filtered(&ray, Mask::Share(share));
            assert_eq!(all_bits(hit), all_bits(expected), "{ray:?}");
        }
    }
}

/// Where a triangle and its copies lie in one place, the first that counts wins: the world's in order, then the
/// instances' in order.
#[test]
fn the_first_accepted_of_equals_wins() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [0.0, 1.0, 0.25]];
    let copies = vec![triangle; 20];
    let places = [(0, IDENTITY); 12];
    let scene = Placement::new("equals", copies.clone(), vec![copies], &places, Quality::Medium);
    let ray = Ray::new([0.2, 0.3, 2.0], [0.0, 0.0, -1.0]);
    let everything: Vec<(u32, u32)> =
        (0..20).map(|p| (NO_INSTANCE, p)).chain((0..12).flat_map(|i| (0..20).map(move |p| (i, p)))).collect();
    for &(i, p) in &everything {
        let hit = scene.check_filtered(&ray, Mask::Only(i, p)).unwrap();
        assert_eq!((hit.instance, hit.primitive), (i, p));
    }
    /// Refuses the first so many in the order of ties.
    #[derive(Clone, Copy)]
    struct From(usize);
    impl Filter for From {
        const ON: bool = true;
        fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, _probe: &mut P) -> bool {
            let instance = candidate.instance().wrapping_add(1) as usize;
            instance * 20 + candidate.primitive() as usize >= self.0
        }
    }
    for first in 0..=everything.len() {
        let hit = scene.check_filtered(&ray, From(first));
        assert_eq!(hit.map(|h| (h.instance, h.primitive)), everything.get(first).copied());
    }
}

/// Before what others a hit counts: distance, world before instances, index.
type Key = (f32, u32, u32);

/// Where `question` would be hit if it were alone. The answers are left out.
fn key(placement: &Placement, ray: &Ray, question: &Question) -> Option<Key> {
    let &(instance, primitive, ..) = question;
    let hit = placement.brute_force(ray, Mask::Only(instance, primitive))?;
    Some((hit.t, instance.wrapping_add(1), primitive))
}

/// What holds of the questions of the nearest-hit query:
/// * no triangle is asked about twice, and none but those that the ray hits before its end;
/// * whatever is nearer than the final hit was asked about (and refused);
/// * none is asked about that lies farther than what was accepted before (at the same distance only an instance's, since
///   ties between instances are decided when the instance has been searched);
/// * u and v are those of the hit.
///
/// And of the any-hit query: none after the first accepted; none twice; where nothing is accepted, all that is hit.
#[test]
fn questions_are_about_hits_that_matter() {
    let mut rng = Rng::new(94);
    let mesh = soup(&mut rng, 40, 0.7);
    let places: Vec<_> = (0..6).map(|_| (0, affine(&mut rng, 0.3, 0.5, 0.7))).collect();
    let wild = Placement::new("wild", soup(&mut rng, 40, 0.7), vec![mesh.clone()], &places, Quality::Medium);
    let tied = Placement::new("tied", mesh.clone(), vec![mesh], &[(0, IDENTITY); 5], Quality::Medium);
    let mut questions = 0;
    for placement in [wild, tied] {
        let in_world = (0..placement.triangles.len() as u32).map(|p| (NO_INSTANCE, p));
        let of_mesh = placement.meshes[0].len() as u32;
        let instances = placement.instances.len() as u32;
        let everything: Vec<(u32, u32)> =
            in_world.chain((0..instances).flat_map(|i| (0..of_mesh).map(move |p| (i, p)))).collect();
        for _ in 0..40 {
            let ray = placement.hostile_ray(&mut rng);
            let any = placement.check_filtered(&ray, NoFilter);
            let ray = if rng.coin() { Placement::with_ends(&mut rng, &ray, any) } else { ray };
            // All that the ray hits.
            let mut met = Vec::new();
            placement.brute_force(&ray, Recorder(Mask::Share(0.0), &mut met));
            for mask in MASKS {
                let mut asked = Vec::new();
                let mut heard = Heard::default();
                let hit =
                    closest(&placement.trees[1], &ray, Recorder(mask, &mut asked), Listener(&mut heard));
                questions += asked.len();
                // Every question reaches the probe once.
                let lookups = asked.len() as u64;
                assert_eq!(heard.alpha, (lookups, lookups * u64::from(BYTES)));
                let unique: HashSet<_> = asked.iter().map(|q| (q.0, q.1)).collect();
                assert_eq!(unique.len(), asked.len(), "asked twice: {ray:?}");

                let mut best: Option<Key> = None;
                for q in &asked {
                    assert!(met.iter().any(|m| (m.0, m.1, m.2) == (q.0, q.1, q.2)), "not hit: {q:?} {ray:?}");
                    // None: the box of its instance begins at the very end of the ray.
                    let Some(k) = key(&placement, &ray, q) else { continue };
                    if let Some(b) = best {
                        assert!(k < b || (k.0 == b.0 && k.1 > 0), "{k:?} asked about behind {b:?}: {ray:?}");
                    }
                    if q.3 && best.is_none_or(|b| k < b) {
                        best = Some(k);
                    }
                }
                let order = |h: Hit| (h.t, h.instance.wrapping_add(1), h.primitive);
                assert_eq!(hit.map(order), best, "the best of the accepted: {ray:?}");
                for m in &met {
                    let Some(k) = key(&placement, &ray, m) else { continue };
                    if best.is_none_or(|b| k.0 < b.0) {
                        assert!(unique.contains(&(m.0, m.1)), "{k:?} not asked about: {ray:?}");
                    }
                }
                if let Some(h) = hit {
                    let q = asked.iter().find(|q| (q.0, q.1) == (h.instance, h.primitive)).unwrap();
                    assert_eq!((q.2, q.3), ([h.u.to_bits(), h.v.to_bits()], true));
                }

                let mut asked = Vec::new();
                let mut heard = Heard::default();
                let blocked =
                    occluded(&placement.trees[1], &ray, Recorder(mask, &mut asked), Listener(&mut heard));
                assert_eq!(heard.alpha.0, asked.len() as u64);
                let accepted: Vec<bool> = asked.iter().map(|q| q.3).collect();
                let unique: HashSet<_> = asked.iter().map(|q| (q.0, q.1)).collect();
                assert_eq!(unique.len(), asked.len(), "asked twice: {ray:?}");
                assert_eq!(accepted.iter().filter(|&&a| a).count(), usize::from(blocked));
                assert_eq!(accepted.last().copied().unwrap_or(false), blocked);
                assert!(asked.iter().all(|q| key(&placement, &ray, q).is_some()), "does not block: {ray:?}");
                if !blocked {
                    let all = everything
                        .iter()
                        .filter(|&&(i, p)| key(&placement, &ray, &(i, p, [0; 2], false)).is_some());
                    assert_eq!(all.count(), asked.len(), "{ray:?}");
                }
            }
        }
    }
    assert!(questions > 1_000, "{questions}");
}

/// A window with a hole: through it one sees what is behind, of the world or of an instance, placed by any matrix.
#[test]
fn one_sees_through_holes() {
    /// A round hole in the middle of the unit square's first triangle's hypotenuse, in every triangle alike.
    #[derive(Clone, Copy)]
    struct Hole;
    impl Filter for Hole {
        const ON: bool = true;
        fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, _probe: &mut P) -> bool {
            let (u, v) = candidate.barycentric();
            // The wall behind has no holes.
            candidate.primitive() > 0 || (u - 0.25).hypot(v - 0.25) > 0.125
        }
    }
    let window = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let wall = [[-9.0, -9.0, -1.0], [19.0, -9.0, -1.0], [-9.0, 19.0, -1.0]];
    let mut rng = Rng::new(95);
    let world = Placement::new("world", vec![window, wall], Vec::new(), &[], Quality::Medium);
    let turned = affine(&mut rng, 0.3, 0.3, 3.0);
    let placed =
        Placement::new("placed", Vec::new(), vec![vec![window, wall]], &[(0, turned)], Quality::Medium);
    for _ in 0..2000 {
        let (x, y) = (rng.unit() as f32, rng.unit() as f32);
        let radius = (x - 0.25).hypot(y - 0.25);
        if (radius - 0.125).abs() < 1e-3 || (x + y - 1.0).abs() < 1e-3 || x < 1e-3 || y < 1e-3 {
            continue;
        }
        let behind = x + y > 1.0 || radius < 0.125;
        let ray = Ray::new([x, y, 1.0], [0.0, 0.0, -1.0]);
        let hit = world.check_filtered(&ray, Hole).unwrap();
        assert_eq!(hit.primitive, u32::from(behind), "{x} {y}");
        let short = Ray { t_max: 1.5, ..ray };
        assert_eq!(occluded(&world.trees[1], &short, Hole, NoProbe), !behind, "{x} {y}");
        let from = crate::support::narrow(crate::placed::place(&turned, [f64::from(x), f64::from(y), 1.0]));
        let along = crate::support::narrow(crate::placed::turn(&turned, [0.0, 0.0, -1.0]));
        let hit = placed.check_filtered(&Ray::new(from, along), Hole).unwrap();
        assert_eq!(hit.primitive, u32::from(behind), "{x} {y}");
    }
}

/// A filter behind a reference keeps its state, and is as good as the filter itself.
#[test]
fn filters_may_be_lent() {
    let mut rng = Rng::new(96);
    let scene = Placement::new("lent", soup(&mut rng, 50, 0.5), Vec::new(), &[], Quality::Medium);
    for _ in 0..100 {
        let ray = scene.hostile_ray(&mut rng);
        let (mut owned, mut lent) = (Vec::new(), Vec::new());
        let expected = closest(&scene.trees[0], &ray, Recorder(Mask::Share(0.5), &mut owned), NoProbe);
        let mut filter = Recorder(Mask::Share(0.5), &mut lent);
        let hit = closest(&scene.trees[0], &ray, &mut filter, NoProbe);
        assert_eq!(all_bits(hit), all_bits(expected));
        assert_eq!(owned, lent);
    }
}
