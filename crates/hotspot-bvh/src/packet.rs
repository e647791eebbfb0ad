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
use crate::traverse::{Best, Pending, closest_of_frame, ordered};
use crate::triangle::{
    Axis, Block, FAR_PAD, NO_PRIMITIVE, RayFrame, decide, details, edge_test, longest_axis, permuted,
    reciprocal_far, sheared,
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
    let mut all = [Best::none(0.0); PACKET];
    nearest_of_packet(s, bvh, rays, &mut all[..hits.len()]);
    for ((ray, best), hit) in rays.iter().zip(&all).zip(hits) {
        *hit = best.found.then(
            #[inline(always)]
            || {
                let triangle = bvh.blocks[best.block].triangle(best.lane);
                let (u, v, normal) = details(&RayFrame::new(ray), &triangle);
                Hit { t: best.t, u, v, primitive: best.primitive, instance: NO_INSTANCE, normal }
            },
        );
    }
}

/// The same without weights and normals.
///
/// # Panics
/// As [`closest_of_packet`].
#[inline(always)]
pub(crate) fn nearest_of_packet<S: Simd>(s: S, bvh: &Bvh, rays: &[Ray], all: &mut [Best]) {
    assert!(rays.len() == all.len() && rays.len() <= PACKET, "a packet holds at most {PACKET} rays");
    let packet = if rays.len() < FEWEST || bvh.root == Child::EMPTY { None } else { Packet::of(rays) };
    let Some(mut packet) = packet else {
        for (ray, best) in rays.iter().zip(all) {
            *best = alone(s, bvh, ray);
        }
        return;
    };
    packet.find(s, bvh);
    all.copy_from_slice(&packet.best[..all.len()]);
}

/// Rays that do not run together. Not inlined: seldom, and long.
#[inline(never)]
fn alone<S: Simd>(s: S, bvh: &Bvh, ray: &Ray) -> Best {
    s.vectorize(
        #[inline(always)]
        || {
            if bvh.root == Child::EMPTY || !ray.is_finite() {
                return Best::none(0.0);
            }
            let frame = RayFrame::new(ray);
            closest_of_frame::<S, NoProbe, NoFilter, false, 0>(
                s,
                bvh,
                &frame,
                [],
                &mut NoFilter,
                &mut NoProbe,
            )
        },
    )
}

/// Eight rays in lanes: what the slab tests and [`sheared`] need. Lanes that are left over hold the last ray.
#[derive(Clone, Copy)]
struct Lanes {
    origin: [F8; 3],
    inverse: [F8; 3],
    inverse_far: [F8; 3],
    /// In the rays' order of axes.
    origin_k: [F8; 3],
    shear: [F8; 2],
    t_min: F8,
    /// The best distance of each so far, or its end; 0 in lanes that are left over.
    best: F8,
    /// Lanes in use.
    used: u32,
}

/// Rays that agree in the signs of their directions and in the axis of the largest component.
struct Packet<'r> {
    rays: &'r [Ray],
    down: [bool; 3],
    k: [Axis; 3],
    lanes: [Lanes; GROUPS],
    best: [Best; PACKET],
}

impl<'r> Packet<'r> {
    /// `None` where the rays do not agree, or one has no finite reciprocals (0 · ∞ would tell nothing of the others).
    #[inline(always)]
    fn of(rays: &'r [Ray]) -> Option<Self> {
        let first = RayFrame::new(&rays[0]);
        let (here, there) = rays.split_at(rays.len().min(LANES));
        let (a, agree) = Lanes::of(here, &first);
        let (b, agree_too) = if there.is_empty() {
            (Lanes { used: 0, best: F8([0.0; LANES]), ..a }, true)
        } else {
            Lanes::of(there, &first)
        };
        let mut best = [Best::none(0.0); PACKET];
        for (best, ray) in best.iter_mut().zip(rays) {
            best.t = ray.t_max;
        }
        (agree && agree_too).then_some(Self { rays, down: first.down, k: first.k, lanes: [a, b], best })
    }
}

impl Lanes {
    /// Of 1 to 8 rays, and whether all agree with the first of the packet. Loops over lanes that are as simple as can be, so that
    /// the compiler makes vectors of them.
    #[inline(always)]
    fn of(rays: &[Ray], first: &RayFrame) -> (Self, bool) {
        let zero = F8([0.0; LANES]);
        let (mut origin, mut direction, mut t_min, mut best) = ([zero; 3], [zero; 3], zero, zero);
        for lane in 0..LANES {
            let ray = &rays[lane.min(rays.len() - 1)];
            for axis in 0..3 {
                origin[axis].0[lane] = ray.origin[axis];
                direction[axis].0[lane] = ray.direction[axis];
            }
            t_min.0[lane] = ray.t_min;
            best.0[lane] = if lane < rays.len() { ray.t_max } else { 0.0 };
        }
        let (mut inverse, mut inverse_far) = ([zero; 3], [zero; 3]);
        // 0 where everything is finite. The sum of finite numbers may be infinite; zero times one may not.
        let mut odd = zero;
        // The top bit where a ray runs another way.
        let mut turned = [0u32; LANES];
        for axis in 0..3 {
            let sign = u32::from(first.down[axis]) << 31;
            for (lane, turned) in turned.iter_mut().enumerate() {
                let d = direction[axis].0[lane];
                inverse[axis].0[lane] = 1.0 / d;
                inverse_far[axis].0[lane] = reciprocal_far(inverse[axis].0[lane]);
                odd.0[lane] += 0.0 * origin[axis].0[lane] + 0.0 * d + 0.0 * inverse_far[axis].0[lane];
                *turned |= d.to_bits() ^ sign;
            }
        }
        let last = first.k[2] as usize;
        let [x, y, z] = &direction;
        let mut disagree = false;
        for (lane, turned) in turned.iter().enumerate() {
            disagree |= longest_axis([x.0[lane], y.0[lane], z.0[lane]]) != last;
            disagree |= odd.0[lane] != 0.0;
            disagree |= turned >> 31 != 0;
            // Ends that are no numbers would hide those of the other rays.
            disagree |= (t_min.0[lane] < 0.0) | t_min.0[lane].is_nan() | best.0[lane].is_nan();
        }
        let [kx, ky, kz] = [first.k[0] as usize, first.k[1] as usize, first.k[2] as usize];
        let (x, y, z) = (&direction[kx], &direction[ky], &direction[kz]);
        let mut shear = [zero; 2];
        for lane in 0..LANES {
            shear[0].0[lane] = x.0[lane] / z.0[lane];
            shear[1].0[lane] = y.0[lane] / z.0[lane];
        }
        let origin_k = [origin[kx], origin[ky], origin[kz]];
        let used = (1 << rays.len()) - 1;
        (Self { origin, inverse, inverse_far, origin_k, shear, t_min, best, used }, !disagree)
    }
}

/// The least and the greatest of the numbers of all lanes, a tree of comparisons.
#[inline(always)]
fn extremes(numbers: [&F8; GROUPS]) -> (f32, f32) {
    let less = |a: f32, b: f32| if a < b { a } else { b };
    let more = |a: f32, b: f32| if a > b { a } else { b };
    let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        low[lane] = less(numbers[0].0[lane], numbers[1].0[lane]);
        high[lane] = more(numbers[0].0[lane], numbers[1].0[lane]);
    }
    for half in [4, 2, 1] {
        for lane in 0..half {
            low[lane] = less(low[lane], low[lane + half]);
            high[lane] = more(high[lane], high[lane + half]);
        }
    }
    (low[0], high[0])
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
    fn new(s: S, packet: &Packet<'_>) -> Self {
        let [a, b] = &packet.lanes;
        let ends = |a: &F8, b: &F8| {
            let (low, high) = extremes([a, b]);
            [s.splat(low), s.splat(high)]
        };
        let mut beam = Self {
            origin: [[s.splat(0.0); 2]; 3],
            inverse: [[s.splat(0.0); 2]; 3],
            inverse_far: [[s.splat(0.0); 2]; 3],
            down: packet.down,
            t_min: s.splat(extremes([&a.t_min, &b.t_min]).0 + 0.0),
        };
        for axis in 0..3 {
            // The nearest a near side can be: from the greatest origin for rays that run up, from the least for others.
            let [low, high] = ends(&a.origin[axis], &b.origin[axis]);
            beam.origin[axis] = if packet.down[axis] { [low, high] } else { [high, low] };
            beam.inverse[axis] = ends(&a.inverse[axis], &b.inverse[axis]);
            beam.inverse_far[axis] = ends(&a.inverse_far[axis], &b.inverse_far[axis]);
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

impl Packet<'_> {
    /// The farthest distance at which any ray still looks for a hit.
    #[inline(always)]
    fn limit(&self) -> f32 {
        extremes([&self.lanes[0].best, &self.lanes[1].best]).1
    }

    #[inline(always)]
    fn find<S: Simd>(&mut self, s: S, bvh: &Bvh) {
        let beam = Beam::new(s, self);
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
                if group * LANES >= self.rays.len() {
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
                    if let Some(t) =
                        decide(&RayFrame::new(&self.rays[ray]), &triangle, interval, surely, best.t)
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
        let k = self.k;
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
            let (near, far) = if self.down[axis] { (high, low) } else { (low, high) };
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
                            // The last of a full packet.
                            if packet % 32 == 31 && index == PACKET - 1 {
                                let end = if packet % 64 == 31 { &mut ray.t_max } else { &mut ray.t_min };
                                *end = f32::NAN;
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
                    together += u32::from(rays.len() >= FEWEST && Packet::of(&rays).is_some());
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
