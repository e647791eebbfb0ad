//! What is told of rays among few triangles against what searches tell.

use super::*;
use crate::few::FewTriangles;
use crate::few::tests::room;
use crate::filter::NoFilter;
use crate::random::Random;
use crate::simd::{F8, Isa, WithSimd, dispatch};
use crate::{BuildOptions, Bvh, Ray};

/// Whether it is a leaf block, its id, and its boxes or triangles.
type Visit = (bool, u32, u32);

/// What eight rays tell: their visits, and whether they hit.
#[derive(Default)]
struct Log([Option<(Vec<Visit>, bool)>; 8]);

struct Writer<'a> {
    of: &'a mut Option<(Vec<Visit>, bool)>,
    visits: Vec<Visit>,
}

impl LaneProbes for Log {
    type Ray<'p> = Writer<'p>;
    fn ray(&mut self, lane: usize) -> Writer<'_> {
        Writer { of: &mut self.0[lane], visits: Vec::new() }
    }
}

impl RayProbe for Writer<'_> {
    fn node(&mut self, id: u32, boxes: u32) {
        self.visits.push((false, id, boxes));
    }
    fn leaf(&mut self, id: u32, shapes: u32) {
        self.visits.push((true, id, shapes));
    }
    fn instance(&mut self, _id: u32) {}
    fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
    fn finish(mut self, hit: bool) {
        self.visits.sort_unstable();
        assert!(self.of.is_none(), "told twice");
        *self.of = Some((self.visits, hit));
    }
}

/// Eight rays: what searches tell of nearest hits and of what blocks, what is told without, and the lanes of which nothing can be told.
struct Ask<'a>(&'a Bvh, &'a FewTriangles, &'a FewVisits, &'a [Ray; 8], [[u32; 8]; 2]);

impl WithSimd for Ask<'_> {
    type Output = ([Log; 4], [u32; 3]);
    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let Self(bvh, few, visits, rays, except) = self;
        let vectors = |of: fn(&Ray) -> [f32; 3]| {
            let component = |i: usize| F8(core::array::from_fn(|lane| of(&rays[lane])[i]));
            Vectors::load(s, &[component(0), component(1), component(2)])
        };
        let t_max = Floats::load(s, &F8(core::array::from_fn(|lane| rays[lane].t_max)));
        let rays = Rays { origin: vectors(|r| r.origin), direction: vectors(|r| r.direction) };
        let except = [Integers::load(s, &U8(except[0])), Integers::load(s, &U8(except[1]))];
        let mut logs = <[Log; 4]>::default();
        let [nearest, blocked, of_nearest, of_shadow] = &mut logs;
        let filters = &[NoFilter; 8];
        let hits = bvh.closest_of_lanes::<_, _, _, false>(s, &rays, except[0], 0xff, (filters, nearest));
        let stopped = bvh.occluded_lanes::<_, _, _, false>(s, &rays, t_max, except, 0xff, (filters, blocked));
        let unclear = visits.of_nearest(s, &rays, (hits.t, hits.found), 0xff, of_nearest);
        let (found, hit) = few.blocked_where(s, &rays, except, 0xff, visits.leaf_of());
        // Those end at their directions' length.
        let told = 0xff & !found.doubtful;
        visits.of_shadow(s, &rays, (t_max, hit), told, of_shadow);
        assert_eq!(found.surely, stopped & told);
        (logs, [unclear, stopped, told])
    }
}

/// Of rooms in trees of several shapes, in both instruction sets; rays from anywhere to anywhere, some along axes.
#[test]
fn visits_are_those_of_searches() {
    let mut random = Random(5);
    let (mut asked, mut handed_back, mut ends, mut roots_that_are_leaves) = (0, 0, [0; 2], 0);
    for (count, shuffle) in
        [(62, None), (62, Some(1)), (40, None), (20, Some(2)), (9, None), (5, None), (2, None)]
    {
        let mut triangles = room(&mut random, 1.0);
        let skipped = triangles.len().saturating_sub(count);
        triangles.drain(..skipped);
        let bvh =
            Bvh::build(&triangles, BuildOptions { shuffle, ..BuildOptions::default() }).expect("a tree");
        let visits = FewVisits::new(&bvh).expect("few nodes");
        roots_that_are_leaves += u32::from(bvh.node_count() == 0);
        let few = FewTriangles::new(&triangles, 2.0).expect("regular triangles");
        for round in 0..400 {
            let rays: [Ray; 8] = core::array::from_fn(|lane| {
                let mut point = || [0; 3].map(|_| 0.5 + 0.7 * random.signed());
                let (from, to) = (point(), point());
                let mut ray = Ray::new(from, [0, 1, 2].map(|i| to[i] - from[i]));
                if round % 3 == 1 {
                    ray.direction[lane % 3] = [0.0, -0.0][lane / 4];
                }
                Ray { t_max: 1.0, ..ray }
            });
            // As paths do that leave a triangle, and shadow rays that end before another.
            let except = [3, 7].map(|step| core::array::from_fn(|lane| (lane + step * round) as u32 % 70));
            for isa in [Isa::Auto, Isa::Portable] {
                let (logs, [unclear, stopped, told]) = dispatch(isa, Ask(&bvh, &few, &visits, &rays, except));
                let [nearest, blocked, of_nearest, of_shadow] = logs.map(|Log(log)| log);
                for lane in 0..8 {
                    asked += 1;
                    if unclear >> lane & 1 != 0 {
                        handed_back += 1;
                        assert_eq!(of_nearest[lane], None);
                    } else {
                        assert_eq!(of_nearest[lane], nearest[lane], "{:?}", rays[lane]);
                    }
                    if told >> lane & 1 != 0 {
                        assert_eq!(of_shadow[lane], blocked[lane], "{:?}", rays[lane]);
                        ends[usize::from(stopped >> lane & 1 != 0)] += 1;
                    } else {
                        assert_eq!(of_shadow[lane], None);
                    }
                }
            }
        }
    }
    // Those that may depend on the order.
    assert!(handed_back > 0 && handed_back < asked / 3, "{handed_back} of {asked}");
    assert_eq!(roots_that_are_leaves, 2);
    assert!(ends.iter().all(|rays| *rays > asked / 5), "{ends:?} of {asked}");
}

#[test]
fn large_and_empty_trees_are_not_taken() {
    let mut random = Random(1);
    let mut triangle = || [0; 3].map(|_| [0; 3].map(|_| random.signed()));
    let many: Vec<_> = (0..600).map(|_| triangle()).collect();
    for triangles in [&many[..], &many[..0]] {
        let bvh = Bvh::build(triangles, BuildOptions::default()).expect("a tree");
        assert!(FewVisits::new(&bvh).is_none());
    }
}
