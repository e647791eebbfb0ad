//! Single-ray traversal: the nearest hit, and whether there is any.
//!
//! Order of visits (it decides the counts): the nearest-hit query visits the hit children of a node from near to far,
//! ties by child word; a child whose box begins beyond the best hit when its turn comes is culled and not counted. The
//! any-hit query visits hit children in slot order, leaves first.

use crate::Bvh;
use crate::node::{Child, Node};
use crate::ray::{Hit, Ray};
use crate::simd::{F8, Portable, Simd};
use crate::stack::Stack;
use crate::triangle::{FAR_PAD, NO_PRIMITIVE, RayFrame, confirm, details};
use hotspot_probe::RayProbe;

/// A child waiting: the distance's bits (ordered as the distance, which is not negative) above the child word.
#[derive(Clone, Copy)]
struct Pending(u64);

impl Pending {
    #[inline(always)]
    fn new(near: f32, child: Child) -> Self {
        // `near` may be −0.0 only if t_min is; + 0.0 makes it 0.0.
        Self(u64::from((near + 0.0).to_bits()) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn child(self) -> Child {
        Child(self.0 as u32)
    }
}

/// The ray in registers.
struct SlabTest<S: Simd> {
    origin: [S::Vector; 3],
    inverse: [S::Vector; 3],
    down: [bool; 3],
    t_min: S::Vector,
}

impl<S: Simd> SlabTest<S> {
    #[inline(always)]
    fn new(s: S, frame: &RayFrame) -> Self {
        let o = frame.ray.origin;
        let i = frame.inverse;
        Self {
            origin: [s.splat(o[0]), s.splat(o[1]), s.splat(o[2])],
            inverse: [s.splat(i[0]), s.splat(i[1]), s.splat(i[2])],
            down: frame.down,
            t_min: s.splat(frame.ray.t_min),
        }
    }

    #[inline(always)]
    fn plane(&self, s: S, node: &Node, axis: usize, upper: bool) -> S::Vector {
        s.mul(s.sub(s.load(&node.bounds[axis][usize::from(upper)]), self.origin[axis]), self.inverse[axis])
    }

    /// Entry distances, and the lanes that are entered by `t_max`, as bits. Subtract-then-multiply, the far side padded
    /// ([`FAR_PAD`]). A NaN (0 · ∞: the origin on a plane that the ray runs along) drops out: `min` and `max` keep their
    /// second operand.
    #[inline(always)]
    fn enter(&self, s: S, node: &Node, t_max: f32) -> (S::Vector, u32) {
        let [x, y, z] = self.down;
        let near = s.max(self.plane(s, node, 0, x), self.t_min);
        let near = s.max(self.plane(s, node, 1, y), near);
        let near = s.max(self.plane(s, node, 2, z), near);
        let far = s.min(self.plane(s, node, 0, !x), s.splat(f32::INFINITY));
        let far = s.min(self.plane(s, node, 1, !y), far);
        let far = s.min(self.plane(s, node, 2, !z), far);
        let far = s.min(s.mul(far, s.splat(FAR_PAD)), s.splat(t_max));
        (near, s.le(near, far))
    }
}

/// The first of the entered slots, and the others.
#[inline(always)]
fn next(near: &F8, node: &Node, entered: u32) -> (u32, Pending) {
    let slot = entered.trailing_zeros() as usize & 7;
    (entered & (entered - 1), Pending::new(near.0[slot], node.children[slot]))
}

/// The nearest hit.
#[inline(always)]
pub(crate) fn closest<S: Simd, P: RayProbe>(s: S, bvh: &Bvh, ray: &Ray, mut probe: P) -> Option<Hit> {
    let frame = RayFrame::new(ray);
    let slabs = SlabTest::new(s, &frame);
    // A hit at t_max itself does not count: it would need an index below 0 to win the tie.
    let mut best = Best { t: ray.t_max, primitive: 0, block: 0, lane: 0 };
    let mut found = false;
    let mut stack: Stack<Pending> = Stack::new();
    let mut current = bvh.root;
    if current == Child::EMPTY || !ray.is_finite() {
        probe.finish(false);
        return None;
    }
    'visit: loop {
        if current.is_leaf() {
            let index = current.index();
            let block = &bvh.blocks[index];
            probe.leaf(index as u32, block.count());
            let mut candidates = block.candidates(s, &frame);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize & 7;
                candidates &= candidates - 1;
                if let Some(t) = confirm(&frame, &block.triangle(lane), best.t) {
                    let primitive = block.primitives[lane];
                    if t < best.t || primitive < best.primitive {
                        best = Best { t, primitive, block: index, lane };
                        found = true;
                    }
                }
            }
        } else {
            let index = current.index();
            let node = &bvh.nodes[index];
            probe.node(index as u32, node.count());
            let (near, entered) = slabs.enter(s, node, best.t);
            if entered != 0 {
                let near = s.store(near);
                let (rest, a) = next(&near, node, entered);
                if rest == 0 {
                    current = a.child();
                    continue 'visit;
                }
                let (mut rest, b) = next(&near, node, rest);
                let (first, second) = if b.0 < a.0 { (b, a) } else { (a, b) };
                if rest == 0 {
                    stack.push(second);
                    current = first.child();
                    continue 'visit;
                }
                let mut sorted = [Pending(u64::MAX); 8];
                sorted[0] = first;
                sorted[1] = second;
                let mut count = 2;
                loop {
                    let (left, item) = next(&near, node, rest);
                    rest = left;
                    let mut place = count;
                    while place > 0 && item.0 < sorted[place - 1].0 {
                        sorted[place] = sorted[place - 1];
                        place -= 1;
                    }
                    sorted[place] = item;
                    count += 1;
                    if rest == 0 {
                        break;
                    }
                }
                for &item in sorted[1..count].iter().rev() {
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
    probe.finish(found);
    if !found {
        return None;
    }
    let (u, v, normal) = details(&frame, &bvh.blocks[best.block].triangle(best.lane));
    Some(Hit { t: best.t, u, v, primitive: best.primitive, normal })
}

#[derive(Clone, Copy)]
struct Best {
    t: f32,
    primitive: u32,
    block: usize,
    lane: usize,
}

/// Whether anything is hit.
#[inline(always)]
pub(crate) fn any<S: Simd, P: RayProbe>(s: S, bvh: &Bvh, ray: &Ray, mut probe: P) -> bool {
    let frame = RayFrame::new(ray);
    let slabs = SlabTest::new(s, &frame);
    let mut stack: Stack<Child> = Stack::new();
    let mut current = bvh.root;
    if current == Child::EMPTY || !ray.is_finite() {
        probe.finish(false);
        return false;
    }
    loop {
        if current.is_leaf() {
            let index = current.index();
            let block = &bvh.blocks[index];
            probe.leaf(index as u32, block.count());
            let mut candidates = block.candidates(s, &frame);
            while candidates != 0 {
                let lane = candidates.trailing_zeros() as usize & 7;
                candidates &= candidates - 1;
                if confirm(&frame, &block.triangle(lane), ray.t_max).is_some_and(|t| t < ray.t_max) {
                    probe.finish(true);
                    return true;
                }
            }
        } else {
            let index = current.index();
            let node = &bvh.nodes[index];
            probe.node(index as u32, node.count());
            let (_, mut entered) = slabs.enter(s, node, ray.t_max);
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
            None => {
                probe.finish(false);
                return false;
            }
        }
    }
}

/// The slow, obvious twins: recursion and plain loops, for tests.
pub mod oracle {
    use super::*;

    /// Tests every triangle: no tree at all. `triangles` as given to the build.
    pub fn brute_force(triangles: &[[[f32; 3]; 3]], ray: &Ray) -> Option<Hit> {
        let frame = RayFrame::new(ray);
        let mut best: Option<(f32, u32)> = None;
        if !ray.is_finite() {
            return None;
        }
        for (index, triangle) in triangles.iter().enumerate() {
            if let Some(t) = confirm(&frame, triangle, ray.t_max)
                && t < best.map_or(ray.t_max, |b| b.0)
            {
                best = Some((t, index as u32));
            }
        }
        best.map(|(t, primitive)| {
            let (u, v, normal) = details(&frame, &triangles[primitive as usize]);
            Hit { t, u, v, primitive, normal }
        })
    }

    /// What a query did, counted by the oracle.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Counts {
        /// Inner nodes visited.
        pub nodes: u64,
        /// Child boxes tested.
        pub boxes: u64,
        /// Leaf blocks tested.
        pub leaves: u64,
        /// Triangles tested.
        pub shapes: u64,
    }

    /// Nearest hit by recursion over the tree, scalar, sorting with the standard library; counts by the definitions.
    pub fn closest(bvh: &Bvh, ray: &Ray) -> (Option<(u32, f32)>, Counts) {
        let mut state = Search { bvh, frame: RayFrame::new(ray), best: None, counts: Counts::default() };
        if bvh.root != Child::EMPTY && ray.is_finite() {
            // The root has no box: it is visited even if the interval is empty.
            state.nearest(bvh.root, f32::NEG_INFINITY);
        }
        (state.best.map(|(t, p)| (p, t)), state.counts)
    }

    /// Any hit by recursion; counts by the definitions.
    pub fn occluded(bvh: &Bvh, ray: &Ray) -> (bool, Counts) {
        let mut state = Search { bvh, frame: RayFrame::new(ray), best: None, counts: Counts::default() };
        let hit = bvh.root != Child::EMPTY && ray.is_finite() && state.any(bvh.root);
        (hit, state.counts)
    }

    struct Search<'b> {
        bvh: &'b Bvh,
        frame: RayFrame,
        best: Option<(f32, u32)>,
        counts: Counts,
    }

    impl Search<'_> {
        fn t_max(&self) -> f32 {
            self.best.map_or(self.frame.ray.t_max, |b| b.0)
        }

        /// Slot and entry distance of the children entered by `t_max`, in slot order.
        fn entered(&mut self, child: Child, t_max: f32) -> Vec<(f32, Child)> {
            let node = &self.bvh.nodes[child.index()];
            self.counts.nodes += 1;
            let slabs = SlabTest::new(Portable, &self.frame);
            let (near, bits) = slabs.enter(Portable, node, t_max);
            let F8(near) = near;
            let mut entered = Vec::new();
            for (slot, &child) in node.children.iter().enumerate() {
                if child != Child::EMPTY {
                    self.counts.boxes += 1;
                    if bits >> slot & 1 == 1 {
                        entered.push((near[slot], child));
                    }
                }
            }
            entered
        }

        fn leaf(&mut self, child: Child) -> Vec<(u32, [[f32; 3]; 3])> {
            let block = &self.bvh.blocks[child.index()];
            self.counts.leaves += 1;
            let used: Vec<_> = (0..8)
                .filter(|&lane| block.primitives[lane] != NO_PRIMITIVE)
                .map(|lane| (block.primitives[lane], block.triangle(lane)))
                .collect();
            self.counts.shapes += used.len() as u64;
            used
        }

        fn nearest(&mut self, child: Child, near: f32) {
            if near > self.t_max() {
                return;
            }
            if child.is_leaf() {
                for (primitive, triangle) in self.leaf(child) {
                    if let Some(t) = confirm(&self.frame, &triangle, self.frame.ray.t_max)
                        && t < self.frame.ray.t_max
                        && self.best.is_none_or(|best| (t, primitive) < best)
                    {
                        self.best = Some((t, primitive));
                    }
                }
                return;
            }
            let mut entered = self.entered(child, self.t_max());
            entered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.0.cmp(&b.1.0)));
            for (near, child) in entered {
                self.nearest(child, near);
            }
        }

        fn any(&mut self, child: Child) -> bool {
            if child.is_leaf() {
                let triangles = self.leaf(child);
                return triangles.iter().any(|(_, triangle)| {
                    confirm(&self.frame, triangle, self.frame.ray.t_max)
                        .is_some_and(|t| t < self.frame.ray.t_max)
                });
            }
            let entered = self.entered(child, self.frame.ray.t_max);
            entered.into_iter().any(|(_, child)| self.any(child))
        }
    }
}
