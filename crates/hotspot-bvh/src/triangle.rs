//! Ray–triangle intersection, in one definition that every traversal shares.
//!
//! A ray hits a triangle if and only if
//! 1. the edge functions of Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection* (JCGT 2013) say so: vertices
//!    relative to the origin, sheared so that the ray runs along z, three 2-D cross products of one sign or zero, in f64.
//!    The value of an edge depends on its two vertices alone, so neighbours agree on its sign, edges and vertices belong
//!    to every triangle that shares them, and closed meshes do not leak; and
//! 2. the ray passes the slab test of the triangle's own bounding box.
//!
//! Its t is the distance to the triangle's plane, evaluated in f64 (Woop's own t is noisy on slivers) and clamped to the
//! interval of that slab test. Both rules have a purpose: slab distances are monotone under rounding, so the box of every
//! ancestor is entered no later than the triangle's own box and left no earlier. Hence no tree can lose a hit that a
//! plain loop over all triangles finds: traversal and loop agree exactly, triangle and t, whatever the tree. Where two
//! triangles have the same t the lower index wins, so the order of visits does not matter either.
//!
//! Rule 1 must be as sharp as rule 2. Edge functions in f32 err by the rounding errors of the farthest vertex; near a
//! long edge they choose a triangle whose box the ray misses by more than the slab test forgives, and the ray leaks. So
//! f32 only sorts out what surely misses ([`Block::candidates`]); [`confirm`] decides.
//!
//! No fused multiply-add anywhere: the sign argument of the edge functions (fl(ab) > fl(cd) implies ab > cd) needs both
//! products rounded alike.

use crate::ray::Ray;
use crate::simd::{F8, Simd};
use core::hint::select_unpredictable;

/// The far side of a slab test is scaled by this (Ize, *Robust BVH Ray Traversal*, JCGT 2013). A slab distance is three
/// roundings (difference, reciprocal, product) of relative error u = 2^−24 away from the true one, so for a point in the
/// box the near distance is at most t (1 + u)³ and the far one at least t (1 − u)³; the scaling rounds once more. 1 + 7u
/// would do; f32 has 1 + 8u. (Ize's 2 ulp, 1 + 4u, hold in every test here too, but without a proof.)
pub(crate) const FAR_PAD: f32 = 1.0 + 4.0 * f32::EPSILON;

/// The reciprocals for the far sides of nodes' boxes are scaled by this: so that no box is left before a triangle in it is
/// by [`FAR_PAD`], although the factor is multiplied in elsewhere. With d the rounded difference, r the rounded reciprocal,
/// the triangle's distance is at most d r (1 + u)² (1 + 8u), the box's at least d r (1 − u)² (1 + 32u); 1 + 12u would do.
/// Where distances are subnormal, within half a quantum q: the triangle's rounds (k + 8uk)q for a d r of at least
/// (k − 1/2)q, the box's at least (k − 1/2 + 30uk)q; the latter is not less, or 8uk < 1/2, and both round to kq.
pub(crate) const FAR_SCALE: f32 = 1.0 + 16.0 * f32::EPSILON;
/// Added to their magnitude, for reciprocals that are subnormal: more than 12u of any such.
pub(crate) const FAR_QUANTA: f32 = f32::from_bits(8);

/// Triangles per block.
pub(crate) const LANES: usize = 8;

/// Marks an unused lane.
pub(crate) const NO_PRIMITIVE: u32 = u32::MAX;

/// A coordinate axis: an index that needs no bounds check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Axis {
    X = 0,
    Y = 1,
    Z = 2,
}

/// Axis permutations by the axis that comes last; the fourth is never used.
pub(crate) const CYCLES: [[Axis; 3]; 4] = [
    [Axis::Y, Axis::Z, Axis::X],
    [Axis::Z, Axis::X, Axis::Y],
    [Axis::X, Axis::Y, Axis::Z],
    [Axis::X, Axis::Y, Axis::Z],
];

/// What a ray needs again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayFrame {
    pub(crate) ray: Ray,
    /// 1 / direction; infinite for zero and for tiny components.
    pub(crate) inverse: [f32; 3],
    /// The same, a little larger ([`FAR_SCALE`]).
    pub(crate) inverse_far: [f32; 3],
    /// Whether the ray runs down an axis: its near plane is then the maximum.
    pub(crate) down: [bool; 3],
    /// Axis permutation of the shear: the direction's largest component last.
    pub(crate) k: [Axis; 3],
    /// Origin and direction, permuted likewise.
    pub(crate) origin_k: [f32; 3],
    pub(crate) direction_k: [f32; 3],
    /// Shear factors along x and y.
    pub(crate) shear: [f32; 2],
}

impl RayFrame {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let (o, d) = (ray.origin, ray.direction);
        // Either cyclic order does: the sign of all three edge functions flips together.
        let k = CYCLES[longest_axis(d) & 3];
        let direction_k = permuted(&d, k);
        let inverse = [1.0 / d[0], 1.0 / d[1], 1.0 / d[2]];
        Self {
            ray: *ray,
            inverse,
            inverse_far: [reciprocal_far(inverse[0]), reciprocal_far(inverse[1]), reciprocal_far(inverse[2])],
            down: [d[0].is_sign_negative(), d[1].is_sign_negative(), d[2].is_sign_negative()],
            k,
            origin_k: permuted(&o, k),
            direction_k,
            shear: [direction_k[0] / direction_k[2], direction_k[1] / direction_k[2]],
        }
    }
}

/// The reciprocal for the far sides of boxes ([`FAR_SCALE`]).
#[inline(always)]
pub(crate) fn reciprocal_far(r: f32) -> f32 {
    r * FAR_SCALE + FAR_QUANTA.copysign(r)
}

/// Index of a direction's largest component, a later one where they are equal. Without branches, which no predictor could follow.
#[inline(always)]
pub(crate) fn longest_axis(d: [f32; 3]) -> usize {
    let (ax, ay, az) = (d[0].abs(), d[1].abs(), d[2].abs());
    let (y_wins, xy) = (ax <= ay, if ax > ay { ax } else { ay });
    select_unpredictable(xy > az, usize::from(y_wins), 2)
}

/// A vertex in a ray's order of axes.
#[inline(always)]
pub(crate) fn permuted(v: &[f32; 3], k: [Axis; 3]) -> [f32; 3] {
    [v[k[0] as usize], v[k[1] as usize], v[k[2] as usize]]
}

/// Up to eight triangles, one per lane. Unused lanes hold NaN vertices, which no test accepts.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    /// `vertices[corner][axis]`, one triangle per lane.
    vertices: [[F8; 3]; 3],
    /// Triangle index per lane, [`NO_PRIMITIVE`] where unused; used lanes come first.
    pub(crate) primitives: [u32; LANES],
}

impl Block {
    pub(crate) fn new(triangles: impl Iterator<Item = (u32, [[f32; 3]; 3])>) -> Self {
        let mut block = Self { vertices: [[F8([f32::NAN; LANES]); 3]; 3], primitives: [NO_PRIMITIVE; LANES] };
        for (lane, (primitive, triangle)) in triangles.take(LANES).enumerate() {
            block.primitives[lane] = primitive;
            for (corner, vertex) in triangle.iter().enumerate() {
                for (axis, &value) in vertex.iter().enumerate() {
                    block.vertices[corner][axis].0[lane] = value;
                }
            }
        }
        block
    }

    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        // Spelled out: `map` would be a call of its own, outside of the instruction set chosen for the traversal.
        let [a, b, c] = &self.vertices;
        [
            [a[0].0[lane], a[1].0[lane], a[2].0[lane]],
            [b[0].0[lane], b[1].0[lane], b[2].0[lane]],
            [c[0].0[lane], c[1].0[lane], c[2].0[lane]],
        ]
    }

    /// Boxes of the triangles along an axis: minima and maxima.
    #[inline(always)]
    pub(crate) fn extent<S: Simd>(&self, s: S, axis: usize) -> [S::Vector; 2] {
        let [a, b, c] = &self.vertices;
        let [a, b, c] = [s.load(&a[axis]), s.load(&b[axis]), s.load(&c[axis])];
        [s.min(s.min(a, b), c), s.max(s.max(a, b), c)]
    }

    /// Lanes that may be hit by rule 1, and among them those that surely are, as bits: [`edge_test`] of one ray.
    #[inline(always)]
    pub(crate) fn candidates<S: Simd>(&self, s: S, frame: &RayFrame) -> (u32, u32) {
        let [kx, ky, kz] = frame.k;
        let [ox, oy, oz] = frame.origin_k;
        let shear = [s.splat(frame.shear[0]), s.splat(frame.shear[1])];
        let origin = [s.splat(ox), s.splat(oy), s.splat(oz)];
        let [a, b, c] = &self.vertices;
        let [kx, ky, kz] = [kx as usize, ky as usize, kz as usize];
        let a = sheared(s, [s.load(&a[kx]), s.load(&a[ky]), s.load(&a[kz])], origin, shear);
        let b = sheared(s, [s.load(&b[kx]), s.load(&b[ky]), s.load(&b[kz])], origin, shear);
        let c = sheared(s, [s.load(&c[kx]), s.load(&c[ky]), s.load(&c[kz])], origin, shear);
        edge_test(s, [a, b, c])
    }
}

/// Corners relative to origins, sheared so that the rays run along z: x, y, and z. All in the rays' order of axes.
#[inline(always)]
pub(crate) fn sheared<S: Simd>(
    s: S,
    [x, y, z]: [S::Vector; 3],
    [ox, oy, oz]: [S::Vector; 3],
    shear: [S::Vector; 2],
) -> [S::Vector; 3] {
    let z = s.sub(z, oz);
    let x = s.sub(s.sub(x, ox), s.mul(shear[0], z));
    let y = s.sub(s.sub(y, oy), s.mul(shear[1], z));
    [x, y, z]
}

/// Lanes that may be hit by rule 1, a filter that passes all that [`confirm`] accepts, and among them those that surely
/// are; as bits. From [`sheared`] corners.
///
/// Let S be the largest |x|, |y| of the sheared corners, Z their largest |z|, R = S + Z, u = 2^−24. A corner's x is
/// off by at most u(|X| + 3|Z| + |x|) ≤ u(2S + 4Z) =: E, since |shear| ≤ 1 and |X| ≤ |x| + |Z|; an edge function by
/// 4SE + 2E² from its corners and by 4uS² from its own roundings; together no more than 16uR(S + 2uR). The factor 20
/// covers the terms of higher order, the added constant covers underflow. Written so that nothing waits for long: S
/// comes last.
#[inline(always)]
pub(crate) fn edge_test<S: Simd>(
    s: S,
    [[ax, ay, az], [bx, by, bz], [cx, cy, cz]]: [[S::Vector; 3]; 3],
) -> (u32, u32) {
    const U: f32 = 0.5 * f32::EPSILON;
    const UNDERFLOW: f32 = f32::from_bits(1 << 9);
    let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
    let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
    let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
    let largest = |x, y| s.max(s.abs(x), s.abs(y));
    let depth = s.max(s.max(s.abs(az), s.abs(bz)), s.abs(cz));
    let side = s.max(s.max(largest(ax, ay), largest(bx, by)), largest(cx, cy));
    let scale = s.add(s.mul(side, s.splat(20.0 * U + 40.0 * U * U)), s.mul(depth, s.splat(40.0 * U * U)));
    let error = s.mul(s.add(side, depth), scale);
    // Misses are what is certain: one edge function below −error, another above. Where f32 overflows nothing is. The
    // last term drops unused lanes. Hits are certain where all edge functions lie on one side by more than the error;
    // none is NaN then, which the sum tells.
    let (least, most) = (s.min(u, s.min(v, w)), s.max(u, s.max(v, w)));
    let tiny = s.splat(UNDERFLOW);
    let negative = s.lt(s.add(least, tiny), s.neg(error));
    let positive = s.lt(error, s.sub(most, tiny));
    let surely_positive = s.lt(error, s.sub(least, tiny));
    let surely_negative = s.lt(s.add(most, tiny), s.neg(error));
    let sum = s.add(s.add(u, v), w);
    (!(negative & positive) & s.le(az, az), (surely_positive | surely_negative) & s.le(sum, sum))
}

/// The edge functions of rule 1: weights of the three vertices, up to a common factor. The shear is multiplied through by
/// the direction's largest component, so that it needs no division; both products of a coordinate are then exact (unless
/// the difference to the origin needs more than 29 bits), and it is rounded once.
#[inline(always)]
fn edges(frame: &RayFrame, triangle: &[[f32; 3]; 3]) -> (f64, f64, f64) {
    let a = sheared_exactly(frame, &triangle[0]);
    let b = sheared_exactly(frame, &triangle[1]);
    let c = sheared_exactly(frame, &triangle[2]);
    (c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0])
}

#[inline(always)]
fn sheared_exactly(frame: &RayFrame, vertex: &[f32; 3]) -> [f64; 2] {
    let [ox, oy, oz] = frame.origin_k;
    let [dx, dy, dz] = frame.direction_k;
    let [vx, vy, vz] = permuted(vertex, frame.k);
    let z = f64::from(vz) - f64::from(oz);
    let x = (f64::from(vx) - f64::from(ox)) * f64::from(dz) - f64::from(dx) * z;
    let y = (f64::from(vy) - f64::from(oy)) * f64::from(dz) - f64::from(dy) * z;
    [x, y]
}

/// Where a ray enters a box (not before 0) and where it leaves it, unpadded. NaN (0 · ∞: the origin lies on a plane that
/// the ray runs along) drops out, since the comparisons keep the other operand.
#[inline(always)]
pub(crate) fn slab_interval(frame: &RayFrame, min: &[f32; 3], max: &[f32; 3]) -> (f32, f32) {
    let o = frame.ray.origin;
    let (mut enter, mut leave) = (0.0, f32::INFINITY);
    for axis in 0..3 {
        let bounds = [min[axis], max[axis]];
        let side = usize::from(frame.down[axis]);
        let near = (bounds[side] - o[axis]) * frame.inverse[axis];
        let far = (bounds[1 - side] - o[axis]) * frame.inverse[axis];
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    (enter, leave)
}

/// Decides whether a triangle is hit within (`t_min`, `t_max`], and where: the whole definition of the file's header.
#[inline(always)]
pub(crate) fn confirm(frame: &RayFrame, triangle: &[[f32; 3]; 3], t_max: f32) -> Option<f32> {
    let t_min = frame.ray.t_min;

    // Rule 2, and the interval for t.
    let [a, b, c] = triangle;
    let min = [a[0].min(b[0]).min(c[0]), a[1].min(b[1]).min(c[1]), a[2].min(b[2]).min(c[2])];
    let max = [a[0].max(b[0]).max(c[0]), a[1].max(b[1]).max(c[1]), a[2].max(b[2]).max(c[2])];
    let (enter, leave) = slab_interval(frame, &min, &max);
    let near = if enter > t_min { enter } else { t_min };
    let passes = near <= leave * FAR_PAD && near <= t_max;
    if !passes {
        return None;
    }
    decide(frame, triangle, (enter, leave), false, t_max)
}

/// [`confirm`] for a triangle that passes rule 2, with that rule's interval; `inside`: it surely passes rule 1 as well.
#[inline(always)]
pub(crate) fn decide(
    frame: &RayFrame,
    triangle: &[[f32; 3]; 3],
    (enter, leave): (f32, f32),
    inside: bool,
    t_max: f32,
) -> Option<f32> {
    let o = frame.ray.origin;
    let d = frame.ray.direction;
    let t_min = frame.ray.t_min;

    // Rule 1.
    if !inside && !passes_edges(*frame, *triangle) {
        return None;
    }

    // t of the plane, which must lie in front; clamped to the box alone, so that it does not depend on the interval.
    let (n, v0) = plane(triangle);
    let mut height = 0.0;
    let mut rate = 0.0;
    for axis in 0..3 {
        height += n[axis] * (v0[axis] - f64::from(o[axis]));
        rate += n[axis] * f64::from(d[axis]);
    }
    let plane_t = (height / rate) as f32;
    let leave = if leave > enter { leave } else { enter };
    let t = if plane_t < enter { enter } else { plane_t };
    let t = if t > leave { leave } else { t };
    // One branch, since each condition alone is a coin toss.
    ((plane_t > 0.0) & (t > t_min) & (t <= t_max)).then_some(t)
}

/// Rule 1 in f64: seldom needed, so it is kept out of the way. By value: a reference would keep ray and triangle in memory
/// for all the rays that never come here.
#[cold]
#[inline(never)]
fn passes_edges(frame: RayFrame, triangle: [[f32; 3]; 3]) -> bool {
    let (u, v, w) = edges(&frame, &triangle);
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    inside && u + v + w != 0.0
}

/// Unnormalised normal (edge 1 × edge 2) and first vertex.
#[inline(always)]
fn plane(triangle: &[[f32; 3]; 3]) -> ([f64; 3], [f64; 3]) {
    let [a, b, c] = triangle;
    let v0 = [f64::from(a[0]), f64::from(a[1]), f64::from(a[2])];
    let e1 = [f64::from(b[0]) - v0[0], f64::from(b[1]) - v0[1], f64::from(b[2]) - v0[2]];
    let e2 = [f64::from(c[0]) - v0[0], f64::from(c[1]) - v0[1], f64::from(c[2]) - v0[2]];
    ([e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]], v0)
}

/// Barycentric weights of the second and third vertex, and the unit normal: for the winner only, in f64.
#[inline(always)]
pub(crate) fn details(frame: &RayFrame, triangle: &[[f32; 3]; 3]) -> (f32, f32, [f32; 3]) {
    let (u, v) = barycentric(frame, triangle);
    (u, v, unit_normal(triangle))
}

/// The unit normal, rounded from f64; zero where the triangle is degenerate.
#[inline(always)]
pub(crate) fn unit_normal(triangle: &[[f32; 3]; 3]) -> [f32; 3] {
    let (n, _) = plane(triangle);
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    if length > 0.0 {
        let scale = 1.0 / length;
        [(n[0] * scale) as f32, (n[1] * scale) as f32, (n[2] * scale) as f32]
    } else {
        [0.0; 3]
    }
}

/// Barycentric weights of the second and third vertex.
#[inline(always)]
pub(crate) fn barycentric(frame: &RayFrame, triangle: &[[f32; 3]; 3]) -> (f32, f32) {
    let (u, v, w) = edges(frame, triangle);
    let sum = u + v + w;
    // u belongs to the first vertex, v to the second, w to the third. All have one sign and their sum is not 0.
    let second = v / sum;
    let third = (w / sum).min(1.0 - second);
    (second as f32, third as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::simd::Portable;

    /// At all scales, those included where the products of an edge function overflow (above 1.8e19) or vanish.
    #[test]
    fn what_a_block_calls_certain_agrees_with_the_exact_rule() {
        let mut random = Random(1);
        let (mut sure, mut misses) = (0, 0);
        for exponent in -40i32..=38 {
            let scale = 10f64.powi(exponent) as f32;
            for _ in 0..400 {
                let mut vertex = || core::array::from_fn(|_| random.signed() * scale);
                let triangles: Vec<[[f32; 3]; 3]> =
                    (0..LANES).map(|_| core::array::from_fn(|_| vertex())).collect();
                let origin = vertex();
                let direction = core::array::from_fn(|_| random.signed());
                let frame = RayFrame::new(&Ray::new(origin, direction));
                let block = Block::new((0u32..).zip(triangles.iter().copied()));
                let (may, surely) = block.candidates(Portable, &frame);
                for (lane, triangle) in triangles.iter().enumerate() {
                    let inside = passes_edges(frame, *triangle);
                    let (may, surely) = (may >> lane & 1 != 0, surely >> lane & 1 != 0);
                    assert!(
                        may || !inside,
                        "1e{exponent}: {triangle:?} from {origin:?} along {direction:?} lost"
                    );
                    assert!(
                        !surely || inside,
                        "1e{exponent}: {triangle:?} from {origin:?} along {direction:?}"
                    );
                    sure += u32::from(may && surely);
                    misses += u32::from(!may);
                }
            }
        }
        // The filter is worth having: most lanes are decided by it.
        assert!(sure + misses > 79 * 400 * LANES as u32 / 2, "{sure} hits and {misses} misses decided");
    }
}
