//! What rays visit of the tree of few triangles, said from what they hit: for who counts visits and does not search.
//!
//! **Nearest hits.** A search visits the children of a node in the order of their entries, and those alone that begin no later than what it has
//! hit by then. The boxes that lead to the nearest hit begin no later than that: its distance is clamped to its triangle's own box, boxes nest, and
//! roundings are monotone. So of the root's children those are visited that begin no later than the nearest hit does, whatever else was
//! hit before it. The same is surely so further below where no child that is entered begins later; of other rays (few trees of few
//! triangles have many nodes) it may depend on the order, and they are handed back.
//!
//! **Blocked rays** end in the leaf block where the search, in the order of slots, comes upon a hit; those that are not blocked visit all that they
//! enter.

#[cfg(test)]
mod tests;

use super::is_down;
use crate::Bvh;
use crate::lanes::{LaneProbes, far};
use crate::rays::Rays;
use crate::simd::{Floats, Integers, Lanes, Mask, Simd, U8, Vectors};
use crate::triangle::NO_PRIMITIVE;
use hotspot_probe::RayProbe;

/// Most inner nodes.
const NODES: usize = 8;
/// Most places: as many as bits.
const MOST: usize = 32;

/// A child of an inner node.
#[derive(Clone, Debug)]
struct Place {
    low: [f32; 3],
    high: [f32; 3],
    /// Number of that node, and if this is one its own, else [`NODES`].
    parent: usize,
    node: usize,
}

/// The nodes and leaf blocks of a small tree without instances.
#[derive(Clone, Debug)]
pub struct FewVisits {
    /// All but the root, in the order in which rays come upon them that ask whether anything blocks them: so parents before their children. The
    /// place with index i has bit i + 1, the root bit 0.
    places: Vec<Place>,
    /// Which bits are leaf blocks.
    leaves: u32,
    /// By bit: the id of the node or leaf block, and its number of boxes or triangles less one.
    told: [(u32, u8); MOST],
    /// By triangle: the bit of its leaf block.
    leaf_of: Vec<u32>,
}

impl FewVisits {
    /// `None` for trees that are empty, have instances, more than 8 inner nodes, or more than 32 nodes and leaf blocks.
    pub fn new(bvh: &Bvh) -> Option<Self> {
        let triangles =
            bvh.blocks.iter().map(|block| block.primitives.iter().filter(|p| **p != NO_PRIMITIVE).count());
        let leaf_of = vec![0; triangles.sum()];
        let mut this = Self { places: Vec::new(), leaves: 0, told: [(0, 0); MOST], leaf_of };
        // What is still to be looked at, the next one last: the node that it is a child of, if any, and its box there.
        let mut stack = vec![(bvh.root, None)];
        let mut nodes = 0;
        while let Some((child, inside)) = stack.pop() {
            if child.is_instance() {
                // Or empty.
                return None;
            }
            let bit = this.places.len() + usize::from(inside.is_some());
            *this.told.get_mut(bit)? = (child.index() as u32, (child.number() - 1) as u8);
            let mut node = NODES;
            if child.is_leaf() {
                this.leaves |= 1 << bit;
                for primitive in bvh.blocks[child.index()].primitives {
                    if let Some(leaf) = this.leaf_of.get_mut(primitive as usize) {
                        *leaf = 1 << bit;
                    }
                }
            } else {
                node = nodes;
                nodes += 1;
                if nodes > NODES {
                    return None;
                }
                let children: Vec<_> = bvh.nodes[child.node_index()].occupied().collect();
                stack.extend(children.into_iter().rev().map(|(bounds, child)| (child, Some((node, bounds)))));
            }
            if let Some((parent, bounds)) = inside {
                this.places.push(Place { low: bounds.min, high: bounds.max, parent, node });
            }
        }
        Some(this)
    }

    /// By triangle: the bit of its leaf block, for [`FewTriangles::blocked_where`](super::FewTriangles::blocked_where).
    pub fn leaf_of(&self) -> &[u32] {
        &self.leaf_of
    }

    /// Tells of the rays of `lanes`, of which those that hit something do so at `t` and are `found`, what they visit, as
    /// [`Bvh::closest_of_lanes`] does; the lanes of which it cannot be said, and nothing was told.
    #[inline(always)]
    pub fn of_nearest<S: Simd, P: LaneProbes>(
        &self,
        s: S,
        rays: &Rays<S>,
        (t, found): (Floats<S>, u32),
        lanes: u32,
        probes: &mut P,
    ) -> u32 {
        let infinite = Floats::splat(s, f32::INFINITY);
        let end = Mask::of_bits(s, found).select(t, infinite);
        let (visits, unclear) = self.entered(s, rays, [infinite, end]);
        self.tell(&visits.store(), lanes & !unclear, found, probes);
        lanes & unclear
    }

    /// Tells of the rays of `lanes`, which end at `t_max` and before that hit something in these leaf blocks or nothing, what they visit,
    /// as [`Bvh::occluded_lanes`] does. Of blocks with a hit none may be missing: bits as
    /// [`FewTriangles::blocked_where`](super::FewTriangles::blocked_where) finds them with [`Self::leaf_of`].
    #[inline(always)]
    pub fn of_shadow<S: Simd, P: LaneProbes>(
        &self,
        s: S,
        rays: &Rays<S>,
        (t_max, hit): (Floats<S>, Integers<S>),
        lanes: u32,
        probes: &mut P,
    ) {
        let (entered, _) = self.entered(s, rays, [t_max; 2]);
        // Up to the first leaf block with a hit.
        let visits = entered & (hit ^ (hit + u32::MAX));
        self.tell(&visits.store(), lanes, !hit.is(0).bits(), probes);
    }

    /// The places that rays enter before the first of two distances and no later than at the second, as bits; and the lanes in which
    /// something below a node that is entered so is entered between them.
    #[inline(always)]
    fn entered<S: Simd>(&self, s: S, rays: &Rays<S>, [limit, end]: [Floats<S>; 2]) -> (Integers<S>, u32) {
        let slabs = SlabLanes::new(s, rays);
        // Nodes that are visited.
        let mut reached = [Mask::splat(s, true); NODES];
        let (mut visits, mut unclear) = (Integers::splat(s, 1), 0);
        for (index, place) in self.places.iter().enumerate() {
            let (near, far) = slabs.interval(s, place, limit);
            // Since boxes nest, who enters one enters those around it.
            let entered = near.less_equal(far);
            let later = end.less(near);
            let visited = entered.without(later);
            if place.parent > 0 {
                unclear |= (entered & later & reached[place.parent & (NODES - 1)]).bits();
            }
            if place.node < NODES {
                reached[place.node] = visited;
            }
            let bit = Integers::splat(s, 2 << index);
            visits = visits | bit.or_where_not(visited, Integers::splat(s, 0));
        }
        (visits, unclear)
    }

    #[inline(always)]
    fn tell<P: LaneProbes>(&self, visits: &U8, lanes: u32, found: u32, probes: &mut P) {
        for lane in Lanes(lanes) {
            let mut probe = probes.ray(lane);
            let visits = visits.0[lane];
            for (id, boxes) in self.told(visits & !self.leaves) {
                probe.node(id, boxes);
            }
            for (id, shapes) in self.told(visits & self.leaves) {
                probe.leaf(id, shapes);
            }
            probe.finish(found >> lane & 1 != 0);
        }
    }

    /// Ids and numbers of these bits.
    #[inline(always)]
    fn told(&self, bits: u32) -> Told<'_> {
        Told { table: &self.told, bits }
    }
}

/// Those of a table whose bit is set.
struct Told<'a> {
    table: &'a [(u32, u8); MOST],
    bits: u32,
}

impl Iterator for Told<'_> {
    type Item = (u32, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, u32)> {
        if self.bits == 0 {
            return None;
        }
        // The same numbers; so that the compiler knows that they are small.
        let (id, less_one) = self.table[self.bits.trailing_zeros() as usize & (MOST - 1)];
        self.bits &= self.bits - 1;
        Some((id, u32::from(less_one & 7) + 1))
    }
}

/// [`SlabTest`](crate::traverse::SlabTest)s of eight rays.
struct SlabLanes<S: Simd> {
    origin: Vectors<S>,
    inverse: Vectors<S>,
    inverse_far: Vectors<S>,
    down: [Mask<S>; 3],
}

impl<S: Simd> SlabLanes<S> {
    #[inline(always)]
    fn new(s: S, rays: &Rays<S>) -> Self {
        let Rays { origin, direction: d } = *rays;
        let one = Floats::splat(s, 1.0);
        let inverse = Vectors::new(one / d.x, one / d.y, one / d.z);
        let inverse_far = Vectors::new(far(s, inverse.x), far(s, inverse.y), far(s, inverse.z));
        let down = [is_down(d.x), is_down(d.y), is_down(d.z)];
        Self { origin, inverse, inverse_far, down }
    }

    /// Where rays enter a box, and where they leave it or end at `limit`: as [`SlabTest::enter`](crate::traverse::SlabTest::enter) says.
    #[inline(always)]
    fn interval(&self, s: S, Place { low, high, .. }: &Place, limit: Floats<S>) -> (Floats<S>, Floats<S>) {
        let Self { origin: o, inverse: i, inverse_far: f, down: [x, y, z] } = self;
        let low = Vectors::splat(s, *low);
        let high = Vectors::splat(s, *high);
        let near = ((x.select(high.x, low.x) - o.x) * i.x).max(Floats::splat(s, 0.0));
        let near = ((y.select(high.y, low.y) - o.y) * i.y).max(near);
        let near = ((z.select(high.z, low.z) - o.z) * i.z).max(near);
        let far = ((x.select(low.x, high.x) - o.x) * f.x).min(limit);
        let far = ((y.select(low.y, high.y) - o.y) * f.y).min(far);
        let far = ((z.select(low.z, high.z) - o.z) * f.z).min(far);
        (near, far)
    }
}
