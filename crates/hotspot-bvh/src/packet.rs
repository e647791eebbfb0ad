//! The nearest hits of a packet: rays that run close together, as the camera rays of one pixel do.
//!
//! Inner nodes are visited once for all of them. A node's child is entered where an interval that encloses the slab test of
//! every ray says so; its bounds are products of the extremes of origins and reciprocals, and since each rounded operation
//! is monotone in its operands, no ray can enter what the packet does not. Leaf blocks first lose the triangles whose boxes the
//! packet misses; each of the others is tested against eight rays at once, by the very operations of the single-ray traversal. What
//! a hit is does not depend on the order of visits (`triangle.rs`), so hits are those of single rays, bit for bit.
//!
//! There is no probe: the rays of a packet share their visits, so none has a count of its own.

use crate::Bvh;
use crate::filter::NoFilter;
use crate::node::{Child, Node};
use crate::ray::{Hit, NO_INSTANCE, Ray};
use crate::simd::{F8, Simd};
use crate::stack::Stack;
use crate::traverse::{Best, Pending, closest, ordered};
use crate::triangle::{
    Block, FAR_PAD, NO_PRIMITIVE, RayFrame, decide, details, edge_test, permuted, sheared,
};
use hotspot_probe::NoProbe;

/// Most rays of a packet.
pub const PACKET: usize = 16;
/// With fewer, a packet is no gain.
const FEWEST: usize = 3;
const LANES: usize = 8;
const GROUPS: usize = PACKET / LANES;

/// The nearest hits of up to [`PACKET`] rays.
///
/// # Panics
/// Where `rays` and `hits` differ in length, or are longer than a packet.
#[inline(always)]
pub(crate) fn closest_of_packet<S: Simd>(s: S, bvh: &Bvh, rays: &[Ray], hits: &mut [Option<Hit>]) {
    assert!(rays.len() == hits.len() && rays.len() <= PACKET, "a packet holds at most {PACKET} rays");
    let mut one_by_one = || {
        for (ray, hit) in rays.iter().zip(hits.iter_mut()) {
            *hit = alone(s, bvh, ray);
        }
    };
    // Before the packet, which is large, is made.
    if rays.len() < FEWEST || bvh.root == Child::EMPTY {
        return one_by_one();
    }
    let mut packet = Packet::of(&rays[0]);
    if !packet.take(rays) {
        return one_by_one();
    }
    packet.find(s, bvh);
    for (index, hit) in hits.iter_mut().enumerate() {
        let best = packet.best[index];
        *hit = best.found.then(
            #[inline(always)]
            || {
                let triangle = bvh.blocks[best.block].triangle(best.lane);
                let (u, v, normal) = details(&packet.frames[index], &triangle);
                Hit { t: best.t, u, v, primitive: best.primitive, instance: NO_INSTANCE, normal }
            },
        );
    }
}

/// Rays that do not run together. Not inlined: seldom, and long.
#[inline(never)]
fn alone<S: Simd>(s: S, bvh: &Bvh, ray: &Ray) -> Option<Hit> {
    s.vectorize(
        #[inline(always)]
        || closest::<S, NoProbe, NoFilter, false, 0>(s, bvh, ray, [], NoFilter, NoProbe),
    )
}

/// Eight rays in lanes: what [`sheared`] and the slab test of a triangle's box need.
#[derive(Clone, Copy)]
struct Lanes {
    origin: [F8; 3],
    inverse: [F8; 3],
    origin_k: [F8; 3],
    shear: [F8; 2],
    /// The best distance of each so far, or its end.
    best: F8,
    /// Lanes in use.
    used: u32,
}

/// Rays that agree in the signs of their directions and in the axis of the largest component.
struct Packet {
    frames: [RayFrame; PACKET],
    lanes: [Lanes; GROUPS],
    best: [Best; PACKET],
    count: usize,
}

impl Packet {
    /// One ray, in all places.
    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        let frame = RayFrame::new(ray);
        Self {
            frames: [frame; PACKET],
            lanes: [Lanes::of(&frame); GROUPS],
            best: [Best::none(ray.t_max); PACKET],
            count: 1,
        }
    }

    /// Fills the places; false where the rays do not agree, or one has no finite reciprocals (0 · ∞ would tell nothing of
    /// the others). In place, since it is too large to be moved for nothing.
    #[inline(always)]
    fn take(&mut self, rays: &[Ray]) -> bool {
        let (down, k) = (self.frames[0].down, self.frames[0].k);
        let mut agree = true;
        for (index, ray) in rays.iter().enumerate() {
            let frame = &mut self.frames[index];
            *frame = RayFrame::new(ray);
            let [x, y, z] = frame.inverse_far;
            // The sum of finite numbers may be infinite; zero times one may not.
            agree &= ray.t_min >= 0.0
                && ray.is_finite()
                && 0.0 * x + 0.0 * y + 0.0 * z == 0.0
                && frame.down == down
                && frame.k == k;
            self.lanes[index / LANES].set(index % LANES, frame);
            self.best[index] = Best::none(ray.t_max);
        }
        self.count = rays.len();
        agree
    }
}

impl Lanes {
    /// One ray in all lanes, none of them in use.
    #[inline(always)]
    fn of(frame: &RayFrame) -> Self {
        let [o, i, k] = [frame.ray.origin, frame.inverse, frame.origin_k];
        let lanes = |value: f32| F8([value; LANES]);
        Self {
            origin: [lanes(o[0]), lanes(o[1]), lanes(o[2])],
            inverse: [lanes(i[0]), lanes(i[1]), lanes(i[2])],
            origin_k: [lanes(k[0]), lanes(k[1]), lanes(k[2])],
            shear: [lanes(frame.shear[0]), lanes(frame.shear[1])],
            best: lanes(frame.ray.t_max),
            used: 0,
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, frame: &RayFrame) {
        for axis in 0..3 {
            self.origin[axis].0[lane] = frame.ray.origin[axis];
            self.inverse[axis].0[lane] = frame.inverse[axis];
            self.origin_k[axis].0[lane] = frame.origin_k[axis];
        }
        self.shear[0].0[lane] = frame.shear[0];
        self.shear[1].0[lane] = frame.shear[1];
        self.best.0[lane] = frame.ray.t_max;
        self.used |= 1 << lane;
    }
}

/// Makes an interval hold a value.
#[inline(always)]
fn widen(low: &mut f32, high: &mut f32, value: f32) {
    *low = if value < *low { value } else { *low };
    *high = if value > *high { value } else { *high };
}

/// The interval that encloses the slab tests of all rays, in registers.
struct Beam<S: Simd> {
    /// The extreme origin for the near and for the far sides.
    origin: [[S::Vector; 2]; 3],
    /// Least and greatest reciprocal.
    inverse: [[S::Vector; 2]; 3],
    /// The same of the reciprocals for far sides.
    inverse_far: [[S::Vector; 2]; 3],
    down: [bool; 3],
    t_min: S::Vector,
}

impl<S: Simd> Beam<S> {
    #[inline(always)]
    fn new(s: S, frames: &[RayFrame]) -> Self {
        let (mut low, mut high) = (frames[0], frames[0]);
        for frame in &frames[1..] {
            for axis in 0..3 {
                widen(&mut low.ray.origin[axis], &mut high.ray.origin[axis], frame.ray.origin[axis]);
                widen(&mut low.inverse[axis], &mut high.inverse[axis], frame.inverse[axis]);
                widen(&mut low.inverse_far[axis], &mut high.inverse_far[axis], frame.inverse_far[axis]);
            }
            widen(&mut low.ray.t_min, &mut high.ray.t_min, frame.ray.t_min);
        }
        let mut beam = Self {
            origin: [[s.splat(0.0); 2]; 3],
            inverse: [[s.splat(0.0); 2]; 3],
            inverse_far: [[s.splat(0.0); 2]; 3],
            down: low.down,
            t_min: s.splat(low.ray.t_min + 0.0),
        };
        for axis in 0..3 {
            // The nearest a near side can be: from the greatest origin for rays that run up, from the least for others.
            let origin = [s.splat(low.ray.origin[axis]), s.splat(high.ray.origin[axis])];
            beam.origin[axis] = if low.down[axis] { origin } else { [origin[1], origin[0]] };
            beam.inverse[axis] = [s.splat(low.inverse[axis]), s.splat(high.inverse[axis])];
            beam.inverse_far[axis] = [s.splat(low.inverse_far[axis]), s.splat(high.inverse_far[axis])];
        }
        beam
    }

    /// Lower bounds of the entry distances, and the lanes that a ray may enter by `t_max`. `low`, `high`: corners of
    /// boxes, one per lane.
    #[inline(always)]
    fn enter(&self, s: S, [low, high]: [[S::Vector; 3]; 2], t_max: S::Vector) -> (S::Vector, u32) {
        let (mut near, mut far) = (self.t_min, t_max);
        for axis in 0..3 {
            let (first, last) =
                if self.down[axis] { (high[axis], low[axis]) } else { (low[axis], high[axis]) };
            let x = s.sub(first, self.origin[axis][0]);
            let [least, most] = self.inverse[axis];
            near = s.max(s.min(s.mul(x, least), s.mul(x, most)), near);
            let x = s.sub(last, self.origin[axis][1]);
            let [least, most] = self.inverse_far[axis];
            far = s.min(s.max(s.mul(x, least), s.mul(x, most)), far);
        }
        (near, s.le(near, far))
    }
}

impl Packet {
    /// The farthest distance at which any ray still looks for a hit.
    #[inline(always)]
    fn limit(&self) -> f32 {
        let best = self.best[..self.count].iter();
        best.fold(0.0, |limit, best| if best.t > limit { best.t } else { limit })
    }

    #[inline(always)]
    fn find<S: Simd>(&mut self, s: S, bvh: &Bvh) {
        let beam = Beam::new(s, &self.frames[..self.count]);
        let mut limit = self.limit();
        let mut stack: Stack<Pending> = Stack::new();
        let mut current = bvh.root;
        'visit: loop {
            if current.is_leaf() {
                if self.visit(s, &beam, current.index(), &bvh.blocks[current.index()], limit) {
                    limit = self.limit();
                }
            } else {
                let node: &Node = &bvh.nodes[current.node_index()];
                let [x, y, z] = &node.bounds;
                let bounds = [
                    [s.load(&x[0]), s.load(&y[0]), s.load(&z[0])],
                    [s.load(&x[1]), s.load(&y[1]), s.load(&z[1])],
                ];
                let (near, mut entered) = beam.enter(s, bounds, s.splat(limit));
                if entered != 0 {
                    let near = s.store(near);
                    let mut sorted = [Pending::LAST; LANES];
                    let mut count = 0;
                    while entered != 0 {
                        let slot = entered.trailing_zeros() as usize & 7;
                        entered &= entered - 1;
                        let mut item = Pending::new(near.0[slot], node.children[slot]);
                        for place in &mut sorted[..count] {
                            let (low, high) = ordered(*place, item);
                            *place = low;
                            item = high;
                        }
                        sorted[count & 7] = item;
                        count += 1;
                    }
                    for &item in sorted[1..count].iter().rev() {
                        stack.push(item);
                    }
                    current = sorted[0].child();
                    continue 'visit;
                }
            }
            loop {
                let Some(item) = stack.pop() else { return };
                if item.near() <= limit {
                    current = item.child();
                    continue 'visit;
                }
            }
        }
    }

    /// Tests the triangles of a block; whether any ray found something nearer.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, s: S, beam: &Beam<S>, index: usize, block: &Block, limit: f32) -> bool {
        let [x, y, z] = [block.extent(s, 0), block.extent(s, 1), block.extent(s, 2)];
        let bounds = [[x[0], y[0], z[0]], [x[1], y[1], z[1]]];
        let (_, mut entered) = beam.enter(s, bounds, s.splat(limit));
        let mut found = false;
        while entered != 0 {
            let lane = entered.trailing_zeros() as usize & 7;
            entered &= entered - 1;
            let primitive = block.primitives[lane];
            if primitive == NO_PRIMITIVE {
                break;
            }
            let triangle = block.triangle(lane);
            for group in 0..GROUPS {
                if group * LANES >= self.count {
                    break;
                }
                let Some((mut hit, inside, enter, leave)) = self.candidates(s, group, &triangle) else {
                    continue;
                };
                while hit != 0 {
                    let place = hit.trailing_zeros() as usize & 7;
                    hit &= hit - 1;
                    let ray = group * LANES + place;
                    let best = &mut self.best[ray];
                    let interval = (enter.0[place], leave.0[place]);
                    let surely = inside >> place & 1 != 0;
                    if let Some(t) = decide(&self.frames[ray], &triangle, interval, surely, best.t)
                        && (t < best.t || primitive < best.primitive)
                    {
                        *best = Best { t, primitive, instance: NO_INSTANCE, block: index, lane, found: true };
                        self.lanes[group].best.0[place] = t;
                        found = true;
                    }
                }
            }
        }
        found
    }

    /// Rays of a group that pass rule 2 by their best distance, and may pass rule 1; those that surely do; and the
    /// interval of rule 2. The operations are those of the single-ray traversal with rays and triangles exchanged.
    #[inline(always)]
    fn candidates<S: Simd>(
        &self,
        s: S,
        group: usize,
        triangle: &[[f32; 3]; 3],
    ) -> Option<(u32, u32, F8, F8)> {
        let lanes = &self.lanes[group];
        let k = self.frames[0].k;
        let origin_k = [s.load(&lanes.origin_k[0]), s.load(&lanes.origin_k[1]), s.load(&lanes.origin_k[2])];
        let shear = [s.load(&lanes.shear[0]), s.load(&lanes.shear[1])];
        let [a, b, c] = triangle;
        let (a_k, b_k, c_k) = (permuted(a, k), permuted(b, k), permuted(c, k));
        let corners = [
            sheared(s, [s.splat(a_k[0]), s.splat(a_k[1]), s.splat(a_k[2])], origin_k, shear),
            sheared(s, [s.splat(b_k[0]), s.splat(b_k[1]), s.splat(b_k[2])], origin_k, shear),
            sheared(s, [s.splat(c_k[0]), s.splat(c_k[1]), s.splat(c_k[2])], origin_k, shear),
        ];
        let (may, inside) = edge_test(s, corners);
        let may = may & lanes.used;
        if may == 0 {
            return None;
        }
        let mut enter = s.splat(0.0);
        let mut leave = s.splat(f32::INFINITY);
        for axis in 0..3 {
            let low = s.splat(a[axis].min(b[axis]).min(c[axis]));
            let high = s.splat(a[axis].max(b[axis]).max(c[axis]));
            let (near, far) = if self.frames[0].down[axis] { (high, low) } else { (low, high) };
            let origin = s.load(&lanes.origin[axis]);
            let inverse = s.load(&lanes.inverse[axis]);
            enter = s.max(s.mul(s.sub(near, origin), inverse), enter);
            leave = s.min(s.mul(s.sub(far, origin), inverse), leave);
        }
        // `decide` sees to t_min.
        let far = s.min(s.mul(leave, s.splat(FAR_PAD)), s.load(&lanes.best));
        let may = may & s.le(enter, far);
        (may != 0).then(
            #[inline(always)]
            || (may, inside, s.store(enter), s.store(leave)),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuildOptions;
    use crate::random::Random;
    use crate::simd::{Isa, Portable, WithSimd, dispatch};

    fn vector(random: &mut Random) -> [f32; 3] {
        core::array::from_fn(|_| random.signed())
    }

    struct Find<'a>(&'a Bvh, &'a [Ray], &'a mut [Option<Hit>]);
    impl WithSimd for Find<'_> {
        type Output = ();
        fn run<S: Simd>(self, simd: S) {
            self.0.closest_hits_flat(simd, self.1, self.2);
        }
    }

    /// Soups of small and of long triangles, with shared corners and with equal triangles (ties); packets of 1 to 16 rays
    /// through a point or a small disc, of narrow and of wide cones, some with ends, aimed at corners, edges or anywhere. Most
    /// must run as one.
    #[test]
    fn hits_are_those_of_single_rays() {
        let mut random = Random(7);
        let (mut together, mut found, mut packets) = (0, 0, 0);
        for soup in 0..24 {
            let size = [0.02, 0.2, 2.0][soup % 3];
            let mut triangles: Vec<[[f32; 3]; 3]> = Vec::new();
            for index in 0..300 {
                let center = vector(&mut random);
                let corner = |random: &mut Random| {
                    let offset = vector(random);
                    core::array::from_fn(|a| center[a] + size * offset[a])
                };
                let mut triangle = [corner(&mut random), corner(&mut random), corner(&mut random)];
                if index % 3 == 1 {
                    triangle[0] = triangles[index - 1][1];
                    triangle[1] = triangles[index - 1][2];
                } else if index % 7 == 5 {
                    triangle = triangles[index - 3];
                }
                triangles.push(triangle);
            }
            for isa in [Isa::Portable, Isa::Auto] {
                let options = BuildOptions { isa, ..Default::default() };
                let Ok(bvh) = Bvh::build(&triangles, options) else { panic!("soup {soup} is not built") };
                for packet in 0..300 {
                    let eye = vector(&mut random).map(|c| 2.5 * c);
                    let target = match packet % 3 {
                        0 => vector(&mut random),
                        1 => triangles[packet % 300][1],
                        _ => {
                            let [a, b, _] = triangles[packet % 300];
                            core::array::from_fn(|i| 0.5 * (a[i] + b[i]))
                        }
                    };
                    let spread = [0.0, 1e-4, 0.01, 0.1, 1.0][packet % 5];
                    let lens = [0.0, 0.0, 0.02][packet % 3];
                    let rays: Vec<Ray> = (0..1 + packet % PACKET)
                        .map(|index| {
                            let (a, b) = (vector(&mut random), vector(&mut random));
                            let origin = core::array::from_fn(|i| eye[i] + lens * a[i]);
                            let direction = core::array::from_fn(|i| target[i] - origin[i] + spread * b[i]);
                            let mut ray = Ray::new(origin, direction);
                            if packet % 4 == 1 {
                                ray.t_max = 1.0 + 0.3 * random.signed();
                                ray.t_min = if index % 2 == 0 { 0.6 } else { 0.0 };
                            }
                            // Some along a plane of boxes, to which 0 · ∞ belongs; others beside it.
                            if packet % 10 == 4 {
                                let side = if packet % 20 == 4 { 0.02 } else { -0.02 };
                                let beside = [0.0f32, side][index % 2].copysign(side);
                                ray.origin = [target[0], target[1] - side, target[2] - 1.0];
                                ray.direction = [beside, side, 1.0];
                            }
                            ray
                        })
                        .collect();
                    let mut hits = vec![None; rays.len()];
                    dispatch(isa, Find(&bvh, &rays, &mut hits));
                    for (ray, hit) in rays.iter().zip(&hits) {
                        assert_eq!(
                            *hit,
                            bvh.closest_hit(ray, NoProbe),
                            "soup {soup}, packet {packet}: {ray:?}"
                        );
                        found += u32::from(hit.is_some());
                    }
                    packets += 1;
                    together += u32::from(rays.len() >= FEWEST && Packet::of(&rays[0]).take(&rays));
                }
            }
        }
        assert!(2 * together > packets && found > 20_000, "{together} of {packets}, {found} hits");
        let nothing = Bvh::build(&[], BuildOptions::default());
        let mut hits = [None; 4];
        let rays = [Ray::new([0.0; 3], [1.0, 2.0, 3.0]); 4];
        nothing.map(|bvh| bvh.closest_hits_flat(Portable, &rays, &mut hits)).ok();
        assert_eq!(hits, [None; 4]);
    }
}
