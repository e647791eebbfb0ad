//! Few triangles, all of them against eight rays at once: what a scene of some dozens of triangles needs no tree for.
//!
//! The hits are those of the tree, bit for bit: they are defined without it (`triangle.rs`). Here f32 with bounds on its errors says what
//! surely is hit, surely nearest, or surely blocks; rays of which it cannot say so, some in ten thousand, are handed back as *doubtful*, to be
//! traced through the tree. Distance, weights and normal of what is hit are then computed as the tree's traversal does.
//!
//! **Faces.** Two triangles that make up a parallelogram are one face: one plane, four edges, and the diagonal says which of the two it is.
//! A face is kept as equations: its plane's, and the distances from its edges as functions of a point.
//!
//! **The bound.** Let the direction be scaled so that its largest component is 1, so that t is a length; B bound the coordinates of origins
//! and corners, and u = 2^−24. With a unit normal n whose components are off by u each, the height of the origin above the plane is off by at
//! most 11uB', B' = 2B, and n·d by 14u; so t by m(11uB' + 18u|t|), m = 1/|n·d| ≥ 1/√3. The point o + td is off by that and by 4u(B + |t|)
//! per axis, its distances from edges by √3 times as much and by 9u(B' + |t|): together less than m(40uB' + 57u|t|). [`ERROR`] is 64u. What
//! corners of a parallelogram are off by is added to B'u. The decisions of `triangle.rs` are made in f64, or by f32 distances within 4u|t| of
//! the true ones, which is less than what is left.
//!
//! Visits cannot be counted: there are none.

use crate::simd::{Doubles, F8, Floats, Integers, Mask, Simd, Vectors};
use crate::triangle::unit_normal;

/// See the file's header.
const ERROR: f32 = 64.0 * 0.5 * f32::EPSILON;
/// Corners that complete a parallelogram may be off by this part of the largest coordinate.
const SAME_CORNER: f64 = 8.0 * f32::EPSILON as f64;
/// A triangle's least height over the largest coordinate, below which its equations say too little.
const LEAST_HEIGHT: f64 = 1e-4;
/// The largest coordinates for which no product here overflows or vanishes.
const COORDINATES: core::ops::Range<f32> = 1e-6..1e6;
/// In place of a second triangle.
const NONE: u32 = u32::MAX;

/// A vector and what is added to its product with a point.
type Equation = [F8; 4];

/// One triangle, or two that make up a parallelogram. All lanes of its vectors are the same.
#[derive(Clone, Debug)]
struct Face {
    /// Height above the plane.
    plane: Equation,
    /// Distance from two edges: the first and last of a single triangle, two that are not parallel of a parallelogram.
    edges: [Equation; 2],
    /// Distance from the diagonal, positive in the first triangle: the third edge of a single triangle.
    diagonal: Equation,
    /// Of a parallelogram: the distances of the other two edges from these.
    widths: [F8; 2],
    /// The part of the bound that does not depend on t.
    error: F8,
    triangles: [u32; 2],
}

/// Rays in lanes.
#[derive(Clone, Copy)]
pub struct Rays<S: Simd> {
    /// Where they start.
    pub origin: Vectors<S>,
    /// Where they go, of any length but zero.
    pub direction: Vectors<S>,
}

/// What rays hit first.
#[derive(Clone, Copy)]
pub struct Hits<S: Simd> {
    /// Rays that surely hit something: the other fields say where. Of other lanes they hold anything.
    pub found: u32,
    /// Rays of which it cannot be said what they hit: the tree knows.
    pub doubtful: u32,
    /// Index of the triangle.
    pub primitive: Integers<S>,
    /// Distance in lengths of the ray's direction.
    pub t: Floats<S>,
    /// Barycentric weight of the second vertex.
    pub u: Floats<S>,
    /// Barycentric weight of the third vertex.
    pub v: Floats<S>,
    /// Geometric normal.
    pub normal: Vectors<S>,
}

/// Whether rays are blocked.
#[derive(Clone, Copy, Debug)]
pub struct Blocked {
    /// Surely.
    pub surely: u32,
    /// Rays of which it cannot be said: the tree knows.
    pub doubtful: u32,
}

/// Few triangles ([`FewTriangles::MOST`]) of regular shape.
#[derive(Clone, Debug)]
pub struct FewTriangles {
    parallelograms: Vec<Face>,
    singles: Vec<Face>,
    /// Corner by corner.
    corners: Vec<f32>,
    /// Unit normals.
    normals: Vec<f32>,
    /// Largest coordinate of the origins for which the bounds hold.
    reach: f32,
}

impl FewTriangles {
    /// Most triangles that are faster to try all than to search.
    pub const MOST: usize = 64;

    /// `None` where there are too many triangles, or where one is so small or so narrow beside the largest coordinate that little could be
    /// said about it.
    ///
    /// `reach`: largest coordinate of the rays' origins, where they may lie beyond the triangles.
    pub fn new(triangles: &[[[f32; 3]; 3]], reach: f32) -> Option<Self> {
        let coordinates = triangles.iter().flatten().flatten();
        let reach = coordinates.fold(reach.abs(), |most, c| if c.abs() > most { c.abs() } else { most });
        if triangles.is_empty() || triangles.len() > Self::MOST || !COORDINATES.contains(&reach) {
            return None;
        }
        let mut this = Self {
            parallelograms: Vec::new(),
            singles: Vec::new(),
            corners: triangles.iter().flatten().flatten().copied().collect(),
            normals: Vec::new(),
            reach,
        };
        let mut paired = vec![false; triangles.len()];
        for (index, triangle) in triangles.iter().enumerate() {
            this.normals.extend(unit_normal(triangle));
            if paired[index] {
                continue;
            }
            let mut later = (index + 1..triangles.len()).filter(|other| !paired[*other]);
            let corners = wide(triangle);
            let partner = later
                .find_map(|other| Some((other, parallelogram(&corners, &wide(&triangles[other]), reach)?)));
            let numbers = [index as u32, partner.map_or(NONE, |(other, _)| other as u32)];
            if let Some((other, corners)) = partner {
                paired[other] = true;
                this.parallelograms.push(Face::new(&corners, numbers, reach)?);
            } else {
                this.singles.push(Face::new(&corners, numbers, reach)?);
            }
        }
        Some(this)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        (size_of_val(&self.parallelograms[..])
            + size_of_val(&self.singles[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.normals[..])) as u64
    }

    /// What the rays of lanes `active` (as bits) hit first, but for the triangles `from`.
    #[inline(always)]
    pub fn closest_hits<S: Simd>(&self, s: S, rays: &Rays<S>, from: Integers<S>, active: u32) -> Hits<S> {
        let scaled = Scaled::new(s, rays, self.reach);
        let infinite = Floats::splat(s, f32::INFINITY);
        let mut nearest =
            Nearest { least: infinite, most: infinite, primitive: Integers::splat(s, NONE), doubtful: 0 };
        for face in &self.parallelograms {
            nearest.try_face::<true>(s, &scaled, face, from, active);
        }
        for face in &self.singles {
            nearest.try_face::<false>(s, &scaled, face, from, active);
        }
        let doubtful = (nearest.doubtful | !scaled.within.bits()) & active;
        let none = nearest.primitive.is(NONE).bits();
        let found = active & !doubtful & !none;
        let [t, u, v] = self.details(s, rays, nearest.primitive);
        let three = nearest.primitive + nearest.primitive.shift_left::<1>();
        let normal = Vectors::gather(&self.normals, three);
        Hits { found, doubtful, primitive: nearest.primitive, t, u, v, normal }
    }

    /// Whether anything lies before the rays' ends, in lanes `active`, at their directions' length; but for two triangles of each.
    #[inline(always)]
    pub fn blocked<S: Simd>(&self, s: S, rays: &Rays<S>, except: [Integers<S>; 2], active: u32) -> Blocked {
        let scaled = Scaled::new(s, rays, self.reach);
        let mut found = Found { surely: 0, perhaps: 0 };
        for face in &self.parallelograms {
            found.try_face::<S, true>(s, &scaled, face, except, active);
            if found.surely & active == active {
                break;
            }
        }
        if found.surely & active != active {
            for face in &self.singles {
                found.try_face::<S, false>(s, &scaled, face, except, active);
            }
        }
        let within = scaled.within.bits();
        let surely = found.surely & within & active;
        Blocked { surely, doubtful: (found.perhaps | !within) & active & !surely }
    }

    /// Distance and barycentric weights, as `triangle.rs` computes them.
    #[inline(always)]
    fn details<S: Simd>(&self, s: S, rays: &Rays<S>, primitive: Integers<S>) -> [Floats<S>; 3] {
        let (o, d) = (rays.origin, rays.direction);
        let first = primitive.shift_left::<3>() + primitive;
        let a = Vectors::gather(&self.corners, first);
        let b = Vectors::gather(&self.corners, first + 3);
        let c = Vectors::gather(&self.corners, first + 6);

        // The triangle's box, as `slab_interval` has it.
        let (near_x, far_x) = slab([a.x, b.x, c.x], o.x, d.x);
        let (near_y, far_y) = slab([a.y, b.y, c.y], o.y, d.y);
        let (near_z, far_z) = slab([a.z, b.z, c.z], o.z, d.z);
        let enter = near_z.max(near_y.max(near_x.max(Floats::splat(s, 0.0))));
        let leave = far_z.min(far_y.min(far_x.min(Floats::splat(s, f32::INFINITY))));

        let corner = widened(a);
        let (e1, e2) = (difference(widened(b), corner), difference(widened(c), corner));
        let n = [e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]];
        let plane_t =
            (dot_from_zero(s, n, difference(corner, widened(o))) / dot_from_zero(s, n, widened(d))).narrow();
        let leave = leave.max(enter);
        let t = leave.min(enter.max(plane_t));

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
        [t, second.narrow(), third.narrow()]
    }
}

/// Where rays enter and leave the slab of a triangle's box along an axis.
#[inline(always)]
fn slab<S: Simd>([a, b, c]: [Floats<S>; 3], o: Floats<S>, d: Floats<S>) -> (Floats<S>, Floats<S>) {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let inverse = 1.0 / d;
    let down = d.bits().shift_right::<31>().is(1);
    ((down.select(high, low) - o) * inverse, (down.select(low, high) - o) * inverse)
}

#[inline(always)]
fn difference<S: Simd>(a: [Doubles<S>; 3], b: [Doubles<S>; 3]) -> [Doubles<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Added up from 0 on, as `decide` does: it turns −0 to 0.
#[inline(always)]
fn dot_from_zero<S: Simd>(s: S, n: [Doubles<S>; 3], v: [Doubles<S>; 3]) -> Doubles<S> {
    Floats::splat(s, 0.0).widen() + n[0] * v[0] + n[1] * v[1] + n[2] * v[2]
}

/// As `sheared_exactly`: all in the rays' order of axes.
#[inline(always)]
fn sheared<S: Simd>(v: [Doubles<S>; 3], o: [Doubles<S>; 3], d: [Doubles<S>; 3]) -> [Doubles<S>; 2] {
    let z = v[2] - o[2];
    [(v[0] - o[0]) * d[2] - d[0] * z, (v[1] - o[1]) * d[2] - d[1] * z]
}

#[inline(always)]
fn widened<S: Simd>(v: Vectors<S>) -> [Doubles<S>; 3] {
    [v.x.widen(), v.y.widen(), v.z.widen()]
}

/// Which component of a direction is the largest, as [`longest_axis`](crate::triangle::longest_axis) says; neither: the third.
struct LongestAxis<S: Simd> {
    x: Mask<S>,
    y: Mask<S>,
}

impl<S: Simd> LongestAxis<S> {
    #[inline(always)]
    fn of(direction: Vectors<S>) -> Self {
        let Vectors { x, y, z } = direction.abs();
        let y_wins = x.less_equal(y);
        let not_z = z.less(x.max(y));
        Self { x: not_z.without(y_wins), y: not_z & y_wins }
    }

    /// In an order of axes where it comes last.
    #[inline(always)]
    fn permuted(&self, Vectors { x, y, z }: Vectors<S>) -> Vectors<S> {
        Vectors::new(
            self.x.select(y, self.y.select(z, x)),
            self.x.select(z, self.y.select(x, y)),
            self.x.select(x, self.y.select(y, z)),
        )
    }
}

/// Rays with directions whose largest component is 1, so that distances are lengths.
struct Scaled<S: Simd> {
    origin: Vectors<S>,
    direction: Vectors<S>,
    /// What the largest component was.
    length: Floats<S>,
    /// Whether the origin is where the bounds hold.
    within: Mask<S>,
}

impl<S: Simd> Scaled<S> {
    #[inline(always)]
    fn new(s: S, rays: &Rays<S>, reach: f32) -> Self {
        let d = rays.direction.abs();
        let length = d.x.max(d.y).max(d.z);
        let (o, reach) = (rays.origin.abs(), Floats::splat(s, reach));
        let within = o.x.less_equal(reach) & o.y.less_equal(reach) & o.z.less_equal(reach);
        let direction = rays.direction.scaled(1.0 / length);
        Self { origin: rays.origin, direction, length, within }
    }
}

/// Where rays meet a face's plane, and what that says.
struct Meeting<S: Simd> {
    /// Distance in the [`Scaled`] direction's.
    t: Floats<S>,
    /// How far from its edges, positive inside.
    margin: Floats<S>,
    /// How far from the diagonal, positive in the first triangle; of single triangles part of the margin.
    diagonal: Floats<S>,
    /// Bound on the errors of all of these.
    error: Floats<S>,
}

/// An equation's value at points.
#[inline(always)]
fn value<S: Simd>(s: S, [x, y, z, w]: &Equation, p: Vectors<S>) -> Floats<S> {
    Floats::load(s, x) * p.x + Floats::load(s, y) * p.y + Floats::load(s, z) * p.z + Floats::load(s, w)
}

impl<S: Simd> Meeting<S> {
    #[inline(always)]
    fn new<const PAIR: bool>(s: S, rays: &Scaled<S>, face: &Face) -> Self {
        let (o, d) = (rays.origin, rays.direction);
        let normal = Vectors::new(
            Floats::load(s, &face.plane[0]),
            Floats::load(s, &face.plane[1]),
            Floats::load(s, &face.plane[2]),
        );
        let height = value(s, &face.plane, o);
        let inverse = 1.0 / normal.dot(d);
        let t = -(height * inverse);
        let error = inverse.abs() * (Floats::load(s, &face.error) + t.abs() * ERROR);
        let p = o + d.scaled(t);
        let (u, v) = (value(s, &face.edges[0], p), value(s, &face.edges[1], p));
        let diagonal = value(s, &face.diagonal, p);
        let margin = if PAIR {
            let (width, height) = (Floats::load(s, &face.widths[0]), Floats::load(s, &face.widths[1]));
            u.min(width - u).min(v.min(height - v))
        } else {
            u.min(v).min(diagonal)
        };
        Self { t, margin, diagonal, error }
    }

    /// Which triangle of the face it is, and where that is sure.
    #[inline(always)]
    fn triangle<const PAIR: bool>(&self, s: S, face: &Face) -> (Integers<S>, Mask<S>) {
        let (first, second) = (Integers::splat(s, face.triangles[0]), Integers::splat(s, face.triangles[1]));
        if PAIR {
            let sure = self.error.less(self.diagonal.abs());
            (second.or_where_not(self.diagonal.less(Floats::splat(s, 0.0)), first), sure)
        } else {
            (first, Mask::splat(s, true))
        }
    }
}

/// The nearest of the faces that were tried.
struct Nearest<S: Simd> {
    /// Bounds on its distance.
    least: Floats<S>,
    most: Floats<S>,
    primitive: Integers<S>,
    /// Lanes where something else may be nearer.
    doubtful: u32,
}

impl<S: Simd> Nearest<S> {
    /// Written so that what is no number is doubtful.
    #[inline(always)]
    fn try_face<const PAIR: bool>(
        &mut self,
        s: S,
        rays: &Scaled<S>,
        face: &Face,
        from: Integers<S>,
        active: u32,
    ) {
        let meeting = Meeting::new::<PAIR>(s, rays, face);
        let Meeting { t, margin, error, .. } = meeting;
        let (near, far) = (t - error, t + error);
        let away = margin.less(-error) | t.less(-error) | self.most.less(near);
        if !away.bits() & active == 0 {
            return;
        }
        let (primitive, which) = meeting.triangle::<PAIR>(s, face);
        let away = away | (primitive.equal(from) & which);
        let surely = (error.less(margin) & error.less(t) & far.less(self.least) & which).without(away);
        self.doubtful |= !(away | surely).bits();
        self.least = surely.select(near, self.least);
        self.most = surely.select(far, self.most);
        self.primitive = primitive.or_where_not(surely, self.primitive);
    }
}

/// Lanes that are blocked.
struct Found {
    surely: u32,
    perhaps: u32,
}

impl Found {
    #[inline(always)]
    fn try_face<S: Simd, const PAIR: bool>(
        &mut self,
        s: S,
        rays: &Scaled<S>,
        face: &Face,
        except: [Integers<S>; 2],
        active: u32,
    ) {
        let meeting = Meeting::new::<PAIR>(s, rays, face);
        let Meeting { t, margin, error, .. } = meeting;
        let end = rays.length;
        let away = margin.less(-error) | t.less(-error) | end.less(t - error);
        if !away.bits() & active == 0 {
            return;
        }
        let (primitive, which) = meeting.triangle::<PAIR>(s, face);
        let excepted = primitive.equal(except[0]) | primitive.equal(except[1]);
        let away = away | (excepted & which);
        let surely = (error.less(margin) & error.less(t) & (t + error).less(end) & which).without(away);
        self.surely |= surely.bits();
        self.perhaps |= !(away | surely).bits();
    }
}

fn wide(triangle: &[[f32; 3]; 3]) -> [DVec; 3] {
    triangle.map(|corner| corner.map(f64::from))
}

type DVec = [f64; 3];

fn sub(a: DVec, b: DVec) -> DVec {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: DVec, b: DVec) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: DVec, b: DVec) -> DVec {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: DVec) -> DVec {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// The corners of the first triangle, turned so that the edge that it shares with the second lies across from its first corner, where both
/// make up a parallelogram.
fn parallelogram(first: &[DVec; 3], second: &[DVec; 3], reach: f32) -> Option<[DVec; 3]> {
    let off = |a: DVec, b: DVec| sub(a, b).into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let [a, b, c] = *first;
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().find(|[across, from, to]| {
        let shared = |corner: &DVec| *corner == *from || *corner == *to;
        let Some(last) = second.iter().find(|corner| !shared(corner)) else { return false };
        let opposite = [0, 1, 2].map(|i| from[i] + to[i] - across[i]);
        second.iter().filter(|corner| shared(corner)).count() == 2
            && second.contains(from)
            && second.contains(to)
            && off(opposite, *last) <= SAME_CORNER * f64::from(reach)
    })
}

impl Face {
    /// `corners`: of the first triangle; the second lies beyond the edge between the last two. `None` where it is too narrow.
    fn new([a, b, c]: &[DVec; 3], triangles: [u32; 2], reach: f32) -> Option<Self> {
        let splat = |x: f64| F8([x as f32; 8]);
        let equation = |n: DVec, at: DVec| {
            let [x, y, z] = n.map(splat);
            [x, y, z, splat(-dot(n, at))]
        };
        let normal = unit(cross(sub(*b, *a), sub(*c, *a)));
        // Distance from the edge between two corners, on the side of the third.
        let edge = |p: DVec, q: DVec, inside: DVec| {
            let n = unit(cross(normal, sub(q, p)));
            let height = dot(n, sub(inside, p));
            (equation(n.map(|x| x * height.signum()), p), height.abs())
        };
        let (first, width) = edge(*a, *b, *c);
        let (second, height) = edge(*a, *c, *b);
        let (diagonal, third) = edge(*b, *c, *a);
        let least = width.min(height).min(third);
        // What is no number is too narrow as well.
        let wide_enough = least >= LEAST_HEIGHT * f64::from(reach);
        if !wide_enough {
            return None;
        }
        let error =
            ERROR * 2.0 * reach + if triangles[1] == NONE { 0.0 } else { SAME_CORNER as f32 * 4.0 * reach };
        Some(Self {
            plane: equation(normal, *a),
            edges: [first, second],
            diagonal,
            widths: [splat(width), splat(height)],
            error: F8([error; 8]),
            triangles,
        })
    }
}

#[cfg(test)]
mod tests;
