//! Ray–triangle intersection, in one definition that every traversal shares.
//!
//! A ray hits a triangle if and only if
//! 1. the edge functions of Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection* (JCGT 2013) say so: vertices
//!    relative to the origin, sheared so that the ray runs along +z, three 2-D cross products of one sign; where one of
//!    them is 0 in f32 the three are evaluated in f64. Edges and vertices belong to every triangle that shares them, so
//!    closed meshes do not leak; and
//! 2. the ray passes the slab test of the triangle's own bounding box.
//!
//! Its t is the distance to the triangle's plane, evaluated in f64 (Woop's own t is noisy on slivers) and clamped to the
//! interval of that slab test. Both rules have a purpose: slab distances are monotone under rounding, so the box of every
//! ancestor is entered no later than the triangle's own box and left no earlier. Hence no tree can lose a hit that a
//! plain loop over all triangles finds: traversal and loop agree exactly, triangle and t, whatever the tree. Where two
//! triangles have the same t the lower index wins, so the order of visits does not matter either.
//!
//! No fused multiply-add anywhere: the sign argument of the edge functions (fl(ab) > fl(cd) implies ab > cd) needs both
//! products rounded alike.

use crate::ray::Ray;
use crate::simd::{F8, Simd};

/// The far side of a slab test is scaled by this: 2 ulp close all holes, 1 does not (Ize, *Robust BVH Ray Traversal*,
/// JCGT 2013).
pub(crate) const FAR_PAD: f32 = 1.0 + 2.0 * f32::EPSILON;

/// Triangles per block.
pub(crate) const LANES: usize = 8;

/// Marks an unused lane.
pub(crate) const NO_PRIMITIVE: u32 = u32::MAX;

/// What a ray needs again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayFrame {
    pub(crate) ray: Ray,
    /// 1 / direction; infinite for zero and for tiny components.
    pub(crate) inverse: [f32; 3],
    /// Row of a node's bounds that holds the near plane of each axis: 0 min, 1 max.
    pub(crate) near: [usize; 3],
    /// Axis permutation of the shear: the direction's largest component last.
    k: [usize; 3],
    /// Shear factors along x and y.
    shear: [f32; 2],
}

impl RayFrame {
    #[inline(always)]
    pub(crate) fn new(ray: &Ray) -> Self {
        let d = ray.direction;
        let (ax, ay, az) = (d[0].abs(), d[1].abs(), d[2].abs());
        let kz = if ax > ay {
            if ax > az { 0 } else { 2 }
        } else if ay > az {
            1
        } else {
            2
        };
        // Either cyclic order does: the sign of all three edge functions flips together.
        let kx = [1, 2, 0][kz];
        let ky = [2, 0, 1][kz];
        Self {
            ray: *ray,
            inverse: [1.0 / d[0], 1.0 / d[1], 1.0 / d[2]],
            near: d.map(|c| usize::from(c.is_sign_negative())),
            k: [kx, ky, kz],
            shear: [d[kx] / d[kz], d[ky] / d[kz]],
        }
    }
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

    /// Triangles held.
    #[inline(always)]
    pub(crate) fn count(&self) -> u32 {
        self.primitives.iter().map(|&p| u32::from(p != NO_PRIMITIVE)).sum()
    }

    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        self.vertices.map(|corner| corner.map(|axis| axis.0[lane]))
    }

    /// A corner relative to the origin, sheared so that the ray runs along z.
    #[inline(always)]
    fn sheared<S: Simd>(&self, s: S, frame: &RayFrame, corner: usize) -> (S::Vector, S::Vector) {
        let [kx, ky, kz] = frame.k;
        let o = frame.ray.origin;
        let corner = &self.vertices[corner];
        let z = s.sub(s.load(&corner[kz]), s.splat(o[kz]));
        let x = s.sub(s.sub(s.load(&corner[kx]), s.splat(o[kx])), s.mul(s.splat(frame.shear[0]), z));
        let y = s.sub(s.sub(s.load(&corner[ky]), s.splat(o[ky])), s.mul(s.splat(frame.shear[1]), z));
        (x, y)
    }

    /// Lanes whose edge functions have one sign (or a zero), as bits: a filter that passes all that [`confirm`] accepts.
    #[inline(always)]
    pub(crate) fn candidates<S: Simd>(&self, s: S, frame: &RayFrame) -> u32 {
        let (ax, ay) = self.sheared(s, frame, 0);
        let (bx, by) = self.sheared(s, frame, 1);
        let (cx, cy) = self.sheared(s, frame, 2);
        let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
        let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
        let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
        let zero = s.splat(0.0);
        s.le(zero, s.min(u, s.min(v, w))) | s.le(s.max(u, s.max(v, w)), zero)
    }
}

#[inline(always)]
fn sheared(frame: &RayFrame, vertex: &[f32; 3]) -> [f32; 2] {
    let [kx, ky, kz] = frame.k;
    let o = frame.ray.origin;
    let z = vertex[kz] - o[kz];
    [(vertex[kx] - o[kx]) - frame.shear[0] * z, (vertex[ky] - o[ky]) - frame.shear[1] * z]
}

#[inline(always)]
fn edges_f32(frame: &RayFrame, triangle: &[[f32; 3]; 3]) -> (f32, f32, f32) {
    let [a, b, c] = [0, 1, 2].map(|i| sheared(frame, &triangle[i]));
    (c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0])
}

/// Decides whether a triangle is hit within (`t_min`, `t_max`], and where: the whole definition of the file's header.
#[inline(always)]
pub(crate) fn confirm(frame: &RayFrame, triangle: &[[f32; 3]; 3], t_max: f32) -> Option<f32> {
    let o = frame.ray.origin;
    let d = frame.ray.direction;

    // Rule 2, and the interval for t. NaN (0 · ∞: the origin lies on a plane that the ray runs along) drops out, since
    // the comparisons keep the other operand.
    let (mut near, mut far) = (frame.ray.t_min, f32::INFINITY);
    for axis in 0..3 {
        let (a, b, c) = (triangle[0][axis], triangle[1][axis], triangle[2][axis]);
        let bounds = [a.min(b).min(c), a.max(b).max(c)];
        let side = frame.near[axis];
        let enter = (bounds[side] - o[axis]) * frame.inverse[axis];
        let leave = (bounds[1 - side] - o[axis]) * frame.inverse[axis];
        near = if enter > near { enter } else { near };
        far = if leave < far { leave } else { far };
    }
    if !(near <= far * FAR_PAD && near <= t_max) {
        return None;
    }

    // Rule 1, in f64 where f32 cannot tell.
    let (u, v, w) = edges_f32(frame, triangle);
    if !((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) {
        return None;
    }
    if u == 0.0 || v == 0.0 || w == 0.0 {
        let [a, b, c] = [0, 1, 2].map(|i| sheared(frame, &triangle[i]).map(f64::from));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        if u + v + w == 0.0 {
            return None;
        }
    }

    // t of the plane.
    let (n, v0) = plane(triangle);
    let mut height = 0.0;
    let mut rate = 0.0;
    for axis in 0..3 {
        height += n[axis] * (v0[axis] - f64::from(o[axis]));
        rate += n[axis] * f64::from(d[axis]);
    }
    let t = (height / rate) as f32;
    if !(t > frame.ray.t_min) {
        return None;
    }
    let t = if t < near { near } else { t };
    let t = if t > far && far >= near { far } else { t };
    (t > frame.ray.t_min && t <= t_max).then_some(t)
}

/// Unnormalised normal (edge 1 × edge 2) and first vertex.
#[inline(always)]
fn plane(triangle: &[[f32; 3]; 3]) -> ([f64; 3], [f64; 3]) {
    let [v0, v1, v2] = triangle.map(|v| v.map(f64::from));
    let e1 = [v1[0] - v0[0], v1[1] - v0[1], v1[2] - v0[2]];
    let e2 = [v2[0] - v0[0], v2[1] - v0[1], v2[2] - v0[2]];
    ([e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]], v0)
}

/// Barycentric weights of the second and third vertex, and the unit normal: for the winner only, in f64.
#[inline(always)]
pub(crate) fn details(frame: &RayFrame, triangle: &[[f32; 3]; 3]) -> (f32, f32, [f32; 3]) {
    let (n, _) = plane(triangle);
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let normal = if length > 0.0 { n.map(|c| (c / length) as f32) } else { [0.0; 3] };
    let [kx, ky, kz] = frame.k;
    let o = frame.ray.origin.map(f64::from);
    let d = frame.ray.direction.map(f64::from);
    let (sx, sy) = (d[kx] / d[kz], d[ky] / d[kz]);
    let [a, b, c] = triangle.map(|vertex| {
        let z = f64::from(vertex[kz]) - o[kz];
        [f64::from(vertex[kx]) - o[kx] - sx * z, f64::from(vertex[ky]) - o[ky] - sy * z]
    });
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let sum = u + v + w;
    if sum == 0.0 {
        return (1.0 / 3.0, 1.0 / 3.0, normal);
    }
    // u belongs to the first vertex, v to the second, w to the third. An edge hit may be a rounding error outside.
    let second = (v / sum).clamp(0.0, 1.0);
    let third = (w / sum).clamp(0.0, 1.0 - second);
    (second as f32, third as f32, normal)
}
