//! Shadow rays that ask first the triangles that blocked others lately.
//!
//! Where most shadow rays are blocked (a room lit through its windows), most of them are by the same few triangles: walls and
//! ceiling. Eight of them are tested together for less than the visit of two nodes. Whether a ray is blocked does not depend
//! on which triangle is asked first, so pictures stay the same bit by bit; what was visited does, so rays whose visits are
//! counted go without.

use crate::Bvh;
use crate::filter::{Filter, counts};
use crate::node::Child;
use crate::ray::{NO_INSTANCE, Ray};
use crate::simd::Simd;
use crate::traverse::{Place, SlabTest, blocked};
use crate::triangle::{Block, LANES, RayFrame};
use hotspot_probe::NoProbe;

/// [`Blockers::score`] from which on they are asked.
const ASKED: u8 = 8;
/// Its largest value.
const MOST: u8 = 15;

/// Triangles of one tree that blocked shadow rays lately, of one thread. Those of another tree would be as wrong as its triangles.
#[derive(Clone, Debug)]
pub struct Blockers {
    block: Block,
    /// Lanes that blocked a ray since their turn to be replaced came last, as bits.
    again: u8,
    /// The lane whose turn it is.
    turn: u8,
    /// Goes up with each ray that is blocked, down with each that is not.
    score: u8,
}

impl Default for Blockers {
    fn default() -> Self {
        Self { block: Block::new(core::iter::empty()), again: 0, turn: 0, score: 0 }
    }
}

impl Blockers {
    #[inline(always)]
    fn learn(&mut self, blocked: bool) {
        self.score = if blocked { (self.score + 1).min(MOST) } else { self.score.saturating_sub(1) };
    }

    /// A second chance for those that blocked again: the clock algorithm of page replacement.
    #[inline(never)]
    fn add(&mut self, block: &Block, lane: usize) {
        while self.again >> self.turn & 1 != 0 {
            self.again &= !(1 << self.turn);
            self.turn = (self.turn + 1) % LANES as u8;
        }
        self.block.set(usize::from(self.turn), block, lane);
        self.turn = (self.turn + 1) % LANES as u8;
    }
}

/// Whether anything is hit.
#[inline(always)]
pub(crate) fn any<S: Simd, F: Filter, const N: usize>(
    s: S,
    bvh: &Bvh,
    ray: &Ray,
    except: [u32; N],
    mut filter: F,
    lately: &mut Blockers,
) -> bool {
    let frame = RayFrame::new(ray);
    if bvh.root == Child::EMPTY || !ray.is_finite() {
        return false;
    }
    let place = Place { bvh, root: bvh.root, frame: &frame, instance: NO_INSTANCE, except };
    if lately.score >= ASKED
        && let Some(lane) = blocker(s, &place, &mut filter, &lately.block)
    {
        lately.again |= 1 << lane;
        lately.learn(true);
        return true;
    }
    let found = blocked::<S, NoProbe, F, false, N>(s, place, &mut filter, &mut NoProbe);
    if let Some((block, lane)) = found {
        lately.add(&bvh.blocks[block], lane);
    }
    lately.learn(found.is_some());
    found.is_some()
}

/// The first lane of a block that blocks the ray.
#[inline(always)]
fn blocker<S: Simd, F: Filter, const N: usize>(
    s: S,
    place: &Place<'_, N>,
    filter: &mut F,
    block: &Block,
) -> Option<usize> {
    let t_max = place.frame.ray.t_max;
    let mut candidates = SlabTest::new(s, place.frame).candidates(s, block, place, t_max)?;
    while candidates.lanes != 0 {
        let (lane, triangle, hit) = candidates.next(block, place.frame, t_max);
        if hit.is_some_and(|t| t < t_max)
            && counts(filter, place.instance, block.primitives[lane], place.frame, &triangle, &mut NoProbe)
        {
            return Some(lane);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuildOptions;
    use crate::random::Random;
    use crate::simd::{Isa, WithSimd, dispatch};

    struct Both<'a>(&'a Bvh, &'a Ray, [u32; 1], &'a mut Blockers);

    impl WithSimd for Both<'_> {
        type Output = (bool, bool);
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (bool, bool) {
            let Self(bvh, ray, except, lately) = self;
            let expected = bvh.occluded_flat(simd, ray, except, NoProbe);
            (bvh.occluded_as_lately(simd, ray, except, lately), expected)
        }
    }

    /// In soups that block nearly all rays, some, and few, of few and of many triangles, with ends and exceptions of all kinds:
    /// the answer is that of the tree. 3 × 2 × 3000 rays under each instruction set.
    #[test]
    fn the_answer_is_the_same() {
        let mut random = Random(17);
        for (size, scale) in [(12, 1.5f32), (12, 0.3), (400, 0.3)] {
            let triangles: Vec<[[f32; 3]; 3]> = (0..size)
                .map(|_| {
                    let center: [f32; 3] = core::array::from_fn(|_| random.signed());
                    core::array::from_fn(|_| center.map(|c| c + scale * random.signed()))
                })
                .collect();
            let bvh = Bvh::build(&triangles, BuildOptions::default()).unwrap();
            for isa in [Isa::Portable, Isa::Auto] {
                let mut lately = Blockers::default();
                let (mut blocked, mut asked) = (0, 0);
                for i in 0..3000 {
                    let [origin, direction] = [(); 2].map(|()| core::array::from_fn(|_| random.signed()));
                    let mut ray = Ray::new(origin, direction);
                    ray.t_max = if i % 3 == 0 { f32::INFINITY } else { 1.0 + random.signed() };
                    let except = [if i % 2 == 0 { i % size } else { u32::MAX }];
                    asked += u32::from(lately.score >= ASKED);
                    let (answer, expected) = dispatch(isa, Both(&bvh, &ray, except, &mut lately));
                    assert_eq!(answer, expected, "{size} {scale} {ray:?} but {except:?}");
                    blocked += u32::from(expected);
                }
                // Those that are asked are worth it.
                assert!(asked > 2900 || blocked < 1800, "{size} {scale}: {blocked} blocked, {asked} asked");
                assert!(asked < 300 || blocked > 1200, "{size} {scale}: {blocked} blocked, {asked} asked");
            }
        }
    }

    /// Triangles that block again outlive the others.
    #[test]
    fn what_blocks_again_stays() {
        let block = |first: u32| Block::new((0..8).map(|i| (first + i, [[0.0; 3], [1.0; 3], [2.0; 3]])));
        let mut lately = Blockers::default();
        for lane in 0..8 {
            lately.add(&block(0), lane);
        }
        assert_eq!(lately.block.primitives, [0, 1, 2, 3, 4, 5, 6, 7]);
        lately.again = 0b1000_0011;
        for lane in 0..5 {
            lately.add(&block(100), lane);
        }
        assert_eq!(lately.block.primitives, [0, 1, 100, 101, 102, 103, 104, 7]);
        // All had their second chance.
        lately.add(&block(200), 0);
        assert_eq!(lately.block.primitives, [200, 1, 100, 101, 102, 103, 104, 7]);
        lately.again = 0xff;
        lately.add(&block(300), 0);
        assert_eq!((lately.block.primitives[1], lately.again), (300, 0));
    }
}
