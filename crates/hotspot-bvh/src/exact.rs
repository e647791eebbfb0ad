//! The exact part of a hit's definition for eight rays at once: as `triangle.rs` has it, operation by operation.

use crate::rays::Rays;
use crate::simd::{Doubles, Floats, Integers, Mask, Simd, Vectors};

/// Barycentric weights of the second and third corner, as `triangle.rs` computes them.
#[inline(always)]
pub(crate) fn edge_weights<S: Simd>(s: S, rays: &Rays<S>, [a, b, c]: [Vectors<S>; 3]) -> [Floats<S>; 2] {
    let (o, d) = (rays.origin, rays.direction);
    // In the ray's order of axes: the direction's longest component comes last.
    let last = LongestAxis::of(d);
    let (o, d) = (widened(last.permuted(o)), widened(last.permuted(d)));
    let a = sheared(widened(last.permuted(a)), o, d);
    let b = sheared(widened(last.permuted(b)), o, d);
    let c = sheared(widened(last.permuted(c)), o, d);
    let u = c[0] * b[1] - c[1] * b[0];
    let v = a[0] * c[1] - a[1] * c[0];
    let w = b[0] * a[1] - b[1] * a[0];
    let sum = u + v + w;
    let second = v / sum;
    let third = (w / sum).min(Floats::splat(s, 1.0).widen() - second);
    [second.narrow(), third.narrow()]
}

/// Unit normals of triangles with area, as [`unit_normal`](crate::triangle::unit_normal) computes them.
#[inline(always)]
pub(crate) fn unit_normals<S: Simd>(s: S, corners: [Vectors<S>; 3]) -> Vectors<S> {
    let (n, _) = plane(corners);
    let scale = Floats::splat(s, 1.0).widen() / (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    Vectors::new((n[0] * scale).narrow(), (n[1] * scale).narrow(), (n[2] * scale).narrow())
}

/// Edge 1 × edge 2, and the first corner.
#[inline(always)]
pub(crate) fn plane<S: Simd>([a, b, c]: [Vectors<S>; 3]) -> ([Doubles<S>; 3], [Doubles<S>; 3]) {
    let corner = widened(a);
    let (e1, e2) = (difference(widened(b), corner), difference(widened(c), corner));
    let n = [e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]];
    (n, corner)
}

#[inline(always)]
pub(crate) fn difference<S: Simd>(a: [Doubles<S>; 3], b: [Doubles<S>; 3]) -> [Doubles<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// As `sheared_exactly`: all in the rays' order of axes.
#[inline(always)]
fn sheared<S: Simd>(v: [Doubles<S>; 3], o: [Doubles<S>; 3], d: [Doubles<S>; 3]) -> [Doubles<S>; 2] {
    let z = v[2] - o[2];
    [(v[0] - o[0]) * d[2] - d[0] * z, (v[1] - o[1]) * d[2] - d[1] * z]
}

#[inline(always)]
pub(crate) fn widened<S: Simd>(v: Vectors<S>) -> [Doubles<S>; 3] {
    [v.x.widen(), v.y.widen(), v.z.widen()]
}

/// Which component of a direction is the largest, as [`longest_axis`](crate::triangle::longest_axis) says; neither: the third.
pub(crate) struct LongestAxis<S: Simd> {
    x: Mask<S>,
    y: Mask<S>,
}

impl<S: Simd> LongestAxis<S> {
    #[inline(always)]
    pub(crate) fn of(direction: Vectors<S>) -> Self {
        let Vectors { x, y, z } = direction.abs();
        let y_wins = x.less_equal(y);
        let not_z = z.less(x.max(y));
        Self { x: not_z.without(y_wins), y: not_z & y_wins }
    }

    /// Its index.
    #[inline(always)]
    pub(crate) fn number(&self, s: S) -> Integers<S> {
        let [x, y, z] = [Integers::splat(s, 0), Integers::splat(s, 1), Integers::splat(s, 2)];
        x.or_where_not(self.x, y.or_where_not(self.y, z))
    }

    /// In an order of axes where it comes last.
    #[inline(always)]
    pub(crate) fn permuted(&self, Vectors { x, y, z }: Vectors<S>) -> Vectors<S> {
        Vectors::new(
            self.x.select(y, self.y.select(z, x)),
            self.x.select(z, self.y.select(x, y)),
            self.x.select(x, self.y.select(y, z)),
        )
    }
}
