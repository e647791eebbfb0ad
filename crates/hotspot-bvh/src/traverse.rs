//! Single-ray traversal: the nearest hit, and whether there is any.
//!
//! Order of visits (it decides the counts): the nearest-hit query visits the hit children of a node from near to far,
//! ties by child word; a child whose box begins beyond the best hit when its turn comes is culled and not counted. The
//! any-hit query visits hit children in slot order, leaf blocks first.
//!
//! An instance is searched when its turn comes, as a tree of its own with a stack of its own; `INSTANCED` compiles that out
//! where a tree has none. A [`Filter`] is asked about each hit that would count.
//!
//! `except`: triangles of the world that the ray is not to hit, such as the one that it starts on, which passes all tests but the
//! last, dearest one. They are visited and counted like all others.

use crate::Bvh;
use crate::filter::{Filter, counts};
use crate::instance::{clamped, search_limit};
use crate::node::{Child, Node};
use crate::ray::{Hit, NO_INSTANCE, Ray};
use crate::simd::{F8, Simd};
use crate::stack::Stack;
use crate::triangle::{Block, FAR_PAD, RayFrame, decide, details};
use core::hint::select_unpredictable;
use hotspot_probe::RayProbe;

/// A child waiting: the distance's bits (ordered as the distance, which is not negative) above the child word.
#[derive(Clone, Copy)]
pub(crate) struct Pending(u64);

impl Pending {
    /// After all others.
    pub(crate) const LAST: Self = Self(u64::MAX);

    #[inline(always)]
    pub(crate) fn new(near: f32, child: Child) -> Self {
        Self(u64::from(near.to_bits()) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    pub(crate) fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    pub(crate) fn child(self) -> Child {
        Child(self.0 as u32)
    }
}

/// The ray in registers.
pub(crate) struct SlabTest<S: Simd> {
    origin: [S::Vector; 3],
    inverse: [S::Vector; 3],
    /// For the far sides of nodes' boxes ([`RayFrame::inverse_far`]).
    inverse_far: [S::Vector; 3],
    down: [bool; 3],
    /// The same, for all lanes.
    down_lanes: [S::Vector; 3],
    t_min: S::Vector,
}

impl<S: Simd> SlabTest<S> {
    #[inline(always)]
    pub(crate) fn new(s: S, frame: &RayFrame) -> Self {
        let o = frame.ray.origin;
        let i = frame.inverse;
        let f = frame.inverse_far;
        Self {
            origin: [s.splat(o[0]), s.splat(o[1]), s.splat(o[2])],
            inverse: [s.splat(i[0]), s.splat(i[1]), s.splat(i[2])],
            inverse_far: [s.splat(f[0]), s.splat(f[1]), s.splat(f[2])],
            down: frame.down,
            down_lanes: [s.fill(frame.down[0]), s.fill(frame.down[1]), s.fill(frame.down[2])],
            // No distance is −0.0 then: `max` keeps its second operand when both are zero.
            t_min: s.splat(frame.ray.t_min + 0.0),
        }
    }

    /// Entry distances, and the lanes that are entered by `t_max`, as bits. Subtract-then-multiply; the far side is padded
    /// by its factor. A NaN (0 · ∞: the origin on a plane that the ray runs along) drops out: `min` and `max` keep their
    /// second operand (pairs of axes compared first would be faster by a hair, and lose both where one is NaN). The latency of
    /// this chain is what a visit costs.
    #[inline(always)]
    pub(crate) fn enter(&self, s: S, node: &Node, t_max: f32) -> (S::Vector, u32) {
        let plane = |axis: usize, upper: bool, inverse: &[S::Vector; 3]| {
            s.mul(s.sub(s.load(&node.bounds[axis][usize::from(upper)]), self.origin[axis]), inverse[axis])
        };
        let [x, y, z] = self.down;
        let near = s.max(plane(0, x, &self.inverse), self.t_min);
        let near = s.max(plane(1, y, &self.inverse), near);
        let near = s.max(plane(2, z, &self.inverse), near);
        let far = s.min(plane(0, !x, &self.inverse_far), s.splat(t_max));
        let far = s.min(plane(1, !y, &self.inverse_far), far);
        let far = s.min(plane(2, !z, &self.inverse_far), far);
        (near, s.le(near, far))
    }
}

/// Triangles of a block that pass rule 2 by `t_max`, and may pass rule 1 ([`Block::candidates`]); both rules are those of
/// `triangle.rs`.
struct Candidates {
    lanes: u32,
    /// Those that surely pass rule 1.
    inside: u32,
    enter: F8,
    leave: F8,
}

impl<S: Simd> SlabTest<S> {
    /// As [`slab_interval`](crate::triangle::slab_interval) for each lane; only where rule 1 leaves any. Without those triangles
    /// of which is known that they are not hit.
    #[inline(always)]
    fn candidates<const N: usize>(
        &self,
        s: S,
        block: &Block,
        place: &Place<'_, N>,
        t_max: f32,
    ) -> Option<Candidates> {
        let (mut lanes, inside) = block.candidates(s, place.frame);
        for primitive in place.except {
            lanes &= !s.equal(&block.primitives, primitive);
        }
        if lanes == 0 {
            return None;
        }
        let mut enter = s.splat(0.0);
        let mut leave = s.splat(f32::INFINITY);
        for axis in 0..3 {
            let [low, high] = block.extent(s, axis);
            let (near, far) = s.swap_where(self.down_lanes[axis], low, high);
            let plane = |bound| s.mul(s.sub(bound, self.origin[axis]), self.inverse[axis]);
            enter = s.max(plane(near), enter);
            leave = s.min(plane(far), leave);
        }
        let near = s.max(enter, self.t_min);
        let far = s.min(s.mul(leave, s.splat(FAR_PAD)), s.splat(t_max));
        let lanes = lanes & s.le(near, far);
        (lanes != 0).then(
            #[inline(always)]
            || Candidates { lanes, inside, enter: s.store(enter), leave: s.store(leave) },
        )
    }
}

impl Candidates {
    /// The next lane, and where its triangle is hit by `t_max`.
    #[inline(always)]
    fn next(&mut self, block: &Block, frame: &RayFrame, t_max: f32) -> (usize, [[f32; 3]; 3], Option<f32>) {
        let lane = self.lanes.trailing_zeros() as usize & 7;
        self.lanes &= self.lanes - 1;
        let triangle = block.triangle(lane);
        let inside = self.inside >> lane & 1 != 0;
        let interval = (self.enter.0[lane], self.leave.0[lane]);
        let hit = decide(frame, &triangle, interval, inside, t_max);
        (lane, triangle, hit)
    }
}

/// Asks for what a child is, before its turn comes.
#[inline(always)]
fn fetch<S: Simd>(s: S, bvh: &Bvh, child: Child) {
    // Without a branch: which of the two it is, no predictor knows.
    let leaf = child.is_leaf();
    let start = select_unpredictable(leaf, bvh.blocks.as_ptr().cast::<u8>(), bvh.nodes.as_ptr().cast::<u8>());
    let stride = select_unpredictable(leaf, size_of::<Block>(), size_of::<Node>());
    s.prefetch(start.wrapping_add(child.offset(stride)));
}

/// The first of the entered slots, and the others.
#[inline(always)]
fn next(near: &F8, node: &Node, entered: u32) -> (u32, Pending) {
    let slot = entered.trailing_zeros() as usize & 7;
    (entered & (entered - 1), Pending::new(near.0[slot], node.children[slot]))
}

/// The nearer first, without a branch.
#[inline(always)]
pub(crate) fn ordered(a: Pending, b: Pending) -> (Pending, Pending) {
    let swap = b.0 < a.0;
    (Pending(select_unpredictable(swap, b.0, a.0)), Pending(select_unpredictable(swap, a.0, b.0)))
}

/// The best hit so far.
#[derive(Clone, Copy)]
pub(crate) struct Best {
    /// Its distance, or the end of the ray.
    pub(crate) t: f32,
    pub(crate) primitive: u32,
    pub(crate) instance: u32,
    pub(crate) block: usize,
    pub(crate) lane: usize,
    pub(crate) found: bool,
}

impl Best {
    /// Nothing yet. Something at `t_max` itself does not count: it would need an index below 0 to win the tie.
    #[inline(always)]
    pub(crate) fn none(t_max: f32) -> Self {
        Self { t: t_max, primitive: 0, instance: NO_INSTANCE, block: 0, lane: 0, found: false }
    }
}

/// The nearest hit.
#[inline(always)]
pub(crate) fn closest<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    bvh: &Bvh,
    ray: &Ray,
    except: [u32; N],
    mut filter: F,
    mut probe: P,
) -> Option<Hit> {
    let frame = RayFrame::new(ray);
    if bvh.root == Child::EMPTY || !ray.is_finite() {
        probe.finish(false);
        return None;
    }
    let best = closest_of_frame::<S, P, F, INSTANCED, N>(s, bvh, &frame, except, &mut filter, &mut probe);
    probe.finish(best.found);
    if !best.found {
        return None;
    }
    let triangle = bvh.blocks[best.block].triangle(best.lane);
    let (u, v, normal) = if INSTANCED && best.instance != NO_INSTANCE {
        let ([u, v], normal) = bvh.details_of_instance(ray, best.instance, &triangle);
        (u, v, normal)
    } else {
        details(&frame, &triangle)
    };
    Some(Hit { t: best.t, u, v, primitive: best.primitive, instance: best.instance, normal })
}

/// The same in a tree that is not empty, for a ray that is finite.
#[inline(always)]
pub(crate) fn closest_of_frame<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    bvh: &Bvh,
    frame: &RayFrame,
    except: [u32; N],
    filter: &mut F,
    probe: &mut P,
) -> Best {
    let place = Place { bvh, root: bvh.root, frame, instance: NO_INSTANCE, except };
    nearest::<S, P, F, INSTANCED, N>(s, place, Best::none(frame.ray.t_max), filter, probe)
}

/// A tree, and the ray in its space.
#[derive(Clone, Copy)]
struct Place<'a, const N: usize> {
    bvh: &'a Bvh,
    root: Child,
    frame: &'a RayFrame,
    instance: u32,
    /// Triangles that are not hit.
    except: [u32; N],
}

impl<'a, const N: usize> Place<'a, N> {
    /// In an instance, with the ray in its space. Exceptions are of the world.
    #[inline(always)]
    fn inside(&self, root: Child, frame: &'a RayFrame, instance: usize) -> Place<'a, 0> {
        Place { bvh: self.bvh, root, frame, instance: instance as u32, except: [] }
    }
}

#[inline(always)]
fn nearest<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    place: Place<'_, N>,
    mut best: Best,
    filter: &mut F,
    probe: &mut P,
) -> Best {
    let Place { bvh, root, frame, instance, .. } = place;
    let slabs = SlabTest::new(s, frame);
    let mut stack: Stack<Pending> = Stack::new();
    let mut current = root;
    'visit: loop {
        if INSTANCED && current.is_leaf() && current.is_instance() {
            best = nearest_of_instance(s, place, current.index(), best, filter, probe);
        } else if current.is_leaf() {
            let index = current.index();
            let block = &bvh.blocks[index];
            if P::ON {
                probe.leaf(index as u32, current.number());
            }
            let mut candidates = slabs.candidates(s, block, &place, best.t);
            while let Some(left) = &mut candidates
                && left.lanes != 0
            {
                let (lane, triangle, hit) = left.next(block, frame, best.t);
                if let Some(t) = hit {
                    let primitive = block.primitives[lane];
                    // Triangles of the world win ties against those of instances.
                    let wins_ties = primitive < best.primitive || (INSTANCED && best.instance != NO_INSTANCE);
                    if (t < best.t || wins_ties)
                        && counts(filter, instance, primitive, frame, &triangle, probe)
                    {
                        best = Best { t, primitive, instance, block: index, lane, found: true };
                    }
                }
            }
        } else {
            let index = current.node_index();
            let node = &bvh.nodes[index];
            if P::ON {
                probe.node(index as u32, current.number());
            }
            let (near, entered) = slabs.enter(s, node, best.t);
            if entered != 0 {
                let near = s.store(near);
                let (rest, a) = next(&near, node, entered);
                if rest == 0 {
                    current = a.child();
                    continue 'visit;
                }
                let (rest, b) = next(&near, node, rest);
                let (first, second) = ordered(a, b);
                if rest == 0 {
                    fetch(s, bvh, second.child());
                    stack.push(second);
                    current = first.child();
                    continue 'visit;
                }
                let (mut rest, c) = next(&near, node, rest);
                // Networks without branches: which of two children is nearer, no predictor knows.
                let (second, third) = ordered(second, c);
                let (first, second) = ordered(first, second);
                if rest == 0 {
                    fetch(s, bvh, third.child());
                    stack.push(third);
                    fetch(s, bvh, second.child());
                    stack.push(second);
                    current = first.child();
                    continue 'visit;
                }
                let mut sorted = [
                    first,
                    second,
                    third,
                    Pending::LAST,
                    Pending::LAST,
                    Pending::LAST,
                    Pending::LAST,
                    Pending::LAST,
                ];
                let mut count = 3;
                loop {
                    let (left, mut item) = next(&near, node, rest);
                    rest = left;
                    // Insertion from the front: what is displaced moves on.
                    for place in &mut sorted[..count] {
                        let (low, high) = ordered(*place, item);
                        *place = low;
                        item = high;
                    }
                    sorted[count & 7] = item;
                    count += 1;
                    if rest == 0 {
                        break;
                    }
                }
                for &item in sorted[1..count].iter().rev() {
                    fetch(s, bvh, item.child());
                    stack.push(item);
                }
                current = sorted[0].child();
                continue 'visit;
            }
        }
        loop {
            let Some(item) = stack.pop() else { break 'visit };
            if item.near() <= best.t {
                current = item.child();
                continue 'visit;
            }
        }
    }
    best
}

/// Searches an instance: `best`, or what it holds before that. Not inlined: it would double the code of the loop.
#[inline(never)]
fn nearest_of_instance<S: Simd, P: RayProbe, F: Filter, const N: usize>(
    s: S,
    place: Place<'_, N>,
    index: usize,
    best: Best,
    filter: &mut F,
    probe: &mut P,
) -> Best {
    s.vectorize(
        #[inline(always)]
        || {
            let placed = &place.bvh.instances[index];
            let Some(interval) = placed.interval(place.frame, best.t) else { return best };
            let limit = search_limit(best.t, interval);
            let ray = placed.object_ray(&place.frame.ray, interval, limit);
            if P::ON {
                probe.instance(index as u32);
            }
            if !ray.is_finite() {
                return best;
            }
            let frame = RayFrame::new(&ray);
            let inside = place.inside(placed.root, &frame, index);
            // A tie with a hit elsewhere is decided below.
            let ties = best.found && limit == best.t;
            let start = Best { primitive: if ties { u32::MAX } else { 0 }, ..Best::none(limit) };
            let mut found = nearest::<S, P, F, false, 0>(s, inside, start, filter, probe);
            if !found.found {
                return best;
            }
            found.t = clamped(found.t, interval);
            // Triangles of the world win ties, then lower instances.
            let wins_ties = best.found && best.instance != NO_INSTANCE && found.instance < best.instance;
            if found.t < best.t || (found.t == best.t && wins_ties) { found } else { best }
        },
    )
}

/// Whether anything is hit.
#[inline(always)]
pub(crate) fn any<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    bvh: &Bvh,
    ray: &Ray,
    except: [u32; N],
    mut filter: F,
    mut probe: P,
) -> bool {
    let frame = RayFrame::new(ray);
    if bvh.root == Child::EMPTY || !ray.is_finite() {
        probe.finish(false);
        return false;
    }
    let hit = any_of_frame::<S, P, F, INSTANCED, N>(s, bvh, &frame, except, &mut filter, &mut probe);
    probe.finish(hit);
    hit
}

/// The same in a tree that is not empty, for a ray that is finite.
#[inline(always)]
pub(crate) fn any_of_frame<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    bvh: &Bvh,
    frame: &RayFrame,
    except: [u32; N],
    filter: &mut F,
    probe: &mut P,
) -> bool {
    let place = Place { bvh, root: bvh.root, frame, instance: NO_INSTANCE, except };
    blocked::<S, P, F, INSTANCED, N>(s, place, filter, probe)
}

#[inline(always)]
fn blocked<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
    s: S,
    place: Place<'_, N>,
    filter: &mut F,
    probe: &mut P,
) -> bool {
    let Place { bvh, root, frame, instance, .. } = place;
    let t_max = frame.ray.t_max;
    let slabs = SlabTest::new(s, frame);
    let mut stack: Stack<Child> = Stack::new();
    let mut current = root;
    loop {
        if INSTANCED && current.is_leaf() && current.is_instance() {
            if blocked_by_instance(s, place, current.index(), filter, probe) {
                return true;
            }
        } else if current.is_leaf() {
            let index = current.index();
            let block = &bvh.blocks[index];
            if P::ON {
                probe.leaf(index as u32, current.number());
            }
            let mut candidates = slabs.candidates(s, block, &place, t_max);
            while let Some(left) = &mut candidates
                && left.lanes != 0
            {
                let (lane, triangle, hit) = left.next(block, frame, t_max);
                if hit.is_some_and(|t| t < t_max) {
                    let primitive = block.primitives[lane];
                    if counts(filter, instance, primitive, frame, &triangle, probe) {
                        return true;
                    }
                }
            }
        } else {
            let index = current.node_index();
            let node = &bvh.nodes[index];
            if P::ON {
                probe.node(index as u32, current.number());
            }
            let (_, mut entered) = slabs.enter(s, node, t_max);
            if entered != 0 {
                // Last slot first onto the stack, so that the first slot, a leaf if there is one, comes next.
                while entered & (entered - 1) != 0 {
                    let slot = 31 - entered.leading_zeros();
                    entered ^= 1 << slot;
                    stack.push(node.children[slot as usize & 7]);
                }
                current = node.children[entered.trailing_zeros() as usize & 7];
                continue;
            }
        }
        match stack.pop() {
            Some(child) => current = child,
            None => return false,
        }
    }
}

/// Whether an instance blocks the ray. Not inlined: it would double the code of the loop.
#[inline(never)]
fn blocked_by_instance<S: Simd, P: RayProbe, F: Filter, const N: usize>(
    s: S,
    place: Place<'_, N>,
    index: usize,
    filter: &mut F,
    probe: &mut P,
) -> bool {
    s.vectorize(
        #[inline(always)]
        || {
            let placed = &place.bvh.instances[index];
            let t_max = place.frame.ray.t_max;
            // A hit may be clamped to where the box begins, never before; one at t_max does not count.
            let Some(interval) = placed.interval(place.frame, t_max).filter(|(near, _)| *near < t_max) else {
                return false;
            };
            // Where the box ends before t_max, every hit in it does too.
            let limit = if interval.1 < t_max { f32::INFINITY } else { t_max };
            let ray = placed.object_ray(&place.frame.ray, interval, limit);
            if P::ON {
                probe.instance(index as u32);
            }
            if !ray.is_finite() {
                return false;
            }
            let frame = RayFrame::new(&ray);
            let inside = place.inside(placed.root, &frame, index);
            blocked::<S, P, F, false, 0>(s, inside, filter, probe)
        },
    )
}
