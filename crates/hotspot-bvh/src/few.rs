//! Few triangles, all of them against eight rays at once: what a scene of some dozens of triangles needs no tree for.
//!
//! The hits are those of the tree, bit for bit: they are defined without it (`triangle.rs`). Here f32 with bounds on its errors says what
//! surely is hit, surely nearest, or surely blocks; rays of which it cannot say so, some in ten thousand, are handed back as *doubtful*, to be
//! traced through the tree. Distance, weights and normal of what is hit are then computed as the tree's traversal does.
//!
//! **Faces.** Two triangles that make up a convex quadrangle in a plane are one face: the diagonal says which of the two it is. A face is
//! kept as equations: its plane's, scaled so that the coefficient of the axis that it faces most is 1, and distances from its edges, seen
//! along that axis. Faces of one axis lie together, so that the axis is known when the loop over them is compiled.
//!
//! **The bound.** Let the direction be scaled so that its largest component is 1, so that t is a length; B bound the coordinates of origins
//! and corners, and u = 2^−24. The plane's coefficients are at most 1 and off by u each, so its height at the origin is off by at most 20uB and
//! that of the direction, at most 3, by 15u: t by m(20uB + 21u|t|), where m ≥ 1/3 is the reciprocal of the latter. The point o + td is off by
//! m(23uB + 33u|t|) per axis, and with the roundings of their own distances from edges by less than m(62uB + 64u|t|): `ERROR` is 64u. What
//! quadrangles are off their planes by is added. Where a ray runs along a plane, so that m is beyond 1/64u, the bound is larger than t and than
//! all distances: nothing is sure then, and nothing that is hit is away. The decisions of `triangle.rs` are made in f64, or by f32 distances
//! within 4u|t| of the true ones, which is less than what is left of t's bound.
//!
//! What rays would visit in the tree [`FewVisits`] tells from what they hit here.

mod face;
#[cfg(test)]
mod tests;
mod visits;

use crate::exact::{difference, edge_weights, plane, widened};
use crate::rays::{Hits, Rays};
use crate::simd::{Doubles, Floats, Integers, Mask, Simd, Vectors};
use crate::triangle::unit_normal;
use face::{Equation, Face, Faces, NONE, Shape, Tilt, corners, quadrangle};
pub use visits::FewVisits;

/// See the file's header.
const ERROR: f32 = 64.0 * 0.5 * f32::EPSILON;
/// The largest coordinates for which no product here overflows or vanishes.
const COORDINATES: core::ops::Range<f32> = 1e-6..1e6;
/// What rays hit first.
#[derive(Clone, Copy)]
pub struct Tried<S: Simd> {
    /// Of those that surely hit something; of others anything.
    pub hits: Hits<S>,
    /// Rays of which it cannot be said what they hit: the tree knows. Those of no length are among them.
    pub doubtful: u32,
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
    /// By axis.
    faces: [Faces; 3],
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
        // Rays leave a face that bounds everything from a little beyond it.
        let reach = reach * (1.0 + 16.0 * f32::EPSILON);
        if triangles.is_empty() || triangles.len() > Self::MOST || !COORDINATES.contains(&reach) {
            return None;
        }
        let mut this = Self {
            faces: Default::default(),
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
            let first = corners(triangle);
            let partner = later
                .find_map(|other| Some((other, quadrangle(&first, &corners(&triangles[other]), reach)?)));
            if let Some((other, corners)) = partner {
                paired[other] = true;
                let (axis, shape, face) = Face::new(&corners, [index as u32, other as u32], reach)?;
                this.faces[axis].add(shape, face);
            } else {
                let [a, b, c] = first;
                let (axis, shape, face) = Face::new(&[a, b, c, a], [index as u32, NONE], reach)?;
                this.faces[axis].add(shape, face);
            }
        }
        // Normals are read four numbers at a time.
        this.normals.push(0.0);
        Some(this)
    }

    /// Whether a triangle runs along this unit direction, or nearly so: rays that go there are doubtful.
    pub fn has_along(&self, direction: [f32; 3]) -> bool {
        let (normals, _) = self.normals.as_chunks::<3>();
        normals.iter().any(|n| {
            let cos = n[0] * direction[0] + n[1] * direction[1] + n[2] * direction[2];
            cos.is_nan() || cos.abs() < 1e-3
        })
    }

    /// What the rays of lanes `active` (as bits) hit first, but for the triangles `from`.
    #[inline(always)]
    pub fn closest_hits<S: Simd>(&self, s: S, rays: &Rays<S>, from: Integers<S>, active: u32) -> Tried<S> {
        let scaled = Scaled::new(s, rays, self.reach);
        let infinite = Floats::splat(s, f32::INFINITY);
        let primitive = Integers::splat(s, NONE);
        let mut nearest = Nearest { from, active, least: infinite, most: infinite, primitive, doubtful: 0 };
        self.try_faces(s, &scaled, &mut nearest);
        let doubtful = (nearest.doubtful | !scaled.within.bits()) & active;
        let none = nearest.primitive.is(NONE).bits();
        let found = active & !doubtful & !none;
        let primitive = nearest.primitive;
        let corners = self.corners(primitive);
        let [t, u, v] = details(s, rays, corners);
        let normal = Vectors::gather(&self.normals, primitive + primitive.shift_left::<1>());
        Tried { hits: Hits { found, primitive, corners, t, u, v, normal }, doubtful }
    }

    /// Whether anything lies before the rays' ends, in lanes `active`, at their directions' length; but for two triangles of each.
    #[inline(always)]
    pub fn blocked<S: Simd>(&self, s: S, rays: &Rays<S>, except: [Integers<S>; 2], active: u32) -> Blocked {
        let scaled = Scaled::new(s, rays, self.reach);
        let mut found = Found { except, active, end: scaled.length, surely: 0, perhaps: 0, place: Nowhere };
        self.try_faces(s, &scaled, &mut found);
        let within = scaled.within.bits();
        let surely = found.surely & within & active;
        Blocked { surely, doubtful: (found.perhaps | !within) & active & !surely }
    }

    /// The same, and in which places those that are surely blocked are: `place_of` says that of each triangle, as a bit. A ray that is
    /// blocked but may be in another place too is doubtful.
    #[inline(always)]
    pub fn blocked_where<S: Simd>(
        &self,
        s: S,
        rays: &Rays<S>,
        except: [Integers<S>; 2],
        active: u32,
        place_of: &[u32],
    ) -> (Blocked, Integers<S>) {
        let scaled = Scaled::new(s, rays, self.reach);
        let place = Places { of: place_of, hit: Integers::splat(s, 0) };
        let mut found = Found { except, active, end: scaled.length, surely: 0, perhaps: 0, place };
        self.try_faces(s, &scaled, &mut found);
        let doubtful = (found.perhaps | !scaled.within.bits()) & active;
        (Blocked { surely: found.surely & active & !doubtful, doubtful }, found.place.hit)
    }

    /// Tries all of them, in loops that are compiled for what each kind needs.
    #[inline(always)]
    fn try_faces<S: Simd>(&self, s: S, rays: &Scaled<S>, trial: &mut impl Trial<S>) {
        let [x, y, z] = &self.faces;
        try_axis::<S, 0>(s, rays, x, trial);
        try_axis::<S, 1>(s, rays, y, trial);
        try_axis::<S, 2>(s, rays, z, trial);
    }

    /// Corners of triangles.
    #[inline(always)]
    fn corners<S: Simd>(&self, primitive: Integers<S>) -> [Vectors<S>; 3] {
        Vectors::gather_three(&self.corners, primitive.shift_left::<3>() + primitive)
    }
}

/// Distance and barycentric weights, as `triangle.rs` computes them.
#[inline(always)]
fn details<S: Simd>(s: S, rays: &Rays<S>, [a, b, c]: [Vectors<S>; 3]) -> [Floats<S>; 3] {
    let (o, d) = (rays.origin, rays.direction);

    // The triangle's box, as `slab_interval` has it.
    let (near_x, far_x) = slab([a.x, b.x, c.x], o.x, d.x);
    let (near_y, far_y) = slab([a.y, b.y, c.y], o.y, d.y);
    let (near_z, far_z) = slab([a.z, b.z, c.z], o.z, d.z);
    let enter = near_z.max(near_y.max(near_x.max(Floats::splat(s, 0.0))));
    let leave = far_z.min(far_y.min(far_x.min(Floats::splat(s, f32::INFINITY))));

    let (n, corner) = plane([a, b, c]);
    let plane_t =
        (dot_from_zero(s, n, difference(corner, widened(o))) / dot_from_zero(s, n, widened(d))).narrow();
    let leave = leave.max(enter);
    let t = leave.min(enter.max(plane_t));

    let [u, v] = edge_weights(s, rays, [a, b, c]);
    [t, u, v]
}

/// Where rays enter and leave the slab of a triangle's box along an axis.
#[inline(always)]
fn slab<S: Simd>([a, b, c]: [Floats<S>; 3], o: Floats<S>, d: Floats<S>) -> (Floats<S>, Floats<S>) {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let inverse = 1.0 / d;
    let down = is_down(d);
    ((down.select(high, low) - o) * inverse, (down.select(low, high) - o) * inverse)
}

/// Where the sign is set, of zeros too.
#[inline(always)]
fn is_down<S: Simd>(d: Floats<S>) -> Mask<S> {
    d.bits().shift_right::<31>().is(1)
}

/// Added up from 0 on, as `decide` does: it turns −0 to 0.
#[inline(always)]
fn dot_from_zero<S: Simd>(s: S, n: [Doubles<S>; 3], v: [Doubles<S>; 3]) -> Doubles<S> {
    Floats::splat(s, 0.0).widen() + n[0] * v[0] + n[1] * v[1] + n[2] * v[2]
}

/// Rays with directions whose largest component is 1, so that distances are lengths.
struct Scaled<S: Simd> {
    origin: Vectors<S>,
    direction: Vectors<S>,
    /// What the largest component was.
    length: Floats<S>,
    /// Whether the origin is where the bounds hold, and the direction finite.
    within: Mask<S>,
}

impl<S: Simd> Scaled<S> {
    #[inline(always)]
    fn new(s: S, rays: &Rays<S>, reach: f32) -> Self {
        let d = rays.direction.abs();
        let length = d.x.max(d.y).max(d.z);
        let (o, reach) = (rays.origin.abs(), Floats::splat(s, reach));
        let direction = rays.direction.scaled(1.0 / length);
        let finite = ((direction.x + direction.y + direction.z) * 0.0).is(0.0);
        let within = o.x.less_equal(reach) & o.y.less_equal(reach) & o.z.less_equal(reach) & finite;
        Self { origin: rays.origin, direction, length, within }
    }
}

/// Where rays meet a face's plane, and what that says.
struct Meeting<S: Simd> {
    /// Distance in the [`Scaled`] direction's.
    t: Floats<S>,
    /// Where, along the two axes that follow the face's.
    p: (Floats<S>, Floats<S>),
    /// Bound on the errors of all of these.
    error: Floats<S>,
}

/// An equation's value at points, for two of their coordinates.
#[inline(always)]
fn value<S: Simd>(s: S, [a, b, c]: &Equation, (x, y): (Floats<S>, Floats<S>)) -> Floats<S> {
    Floats::load(s, a) * x + Floats::load(s, b) * y + Floats::load(s, c)
}

/// A component, and the two that follow it.
#[inline(always)]
fn components<S: Simd, const AXIS: usize>(
    Vectors { x, y, z }: Vectors<S>,
) -> (Floats<S>, (Floats<S>, Floats<S>)) {
    match AXIS {
        0 => (x, (y, z)),
        1 => (y, (z, x)),
        _ => (z, (x, y)),
    }
}

/// What the planes of all level faces of an axis have in common: the reciprocal of how fast rays fall.
#[inline(always)]
fn level_fall<S: Simd, const AXIS: usize>(s: S, rays: &Scaled<S>) -> Floats<S> {
    let (d, _) = components::<S, AXIS>(rays.direction);
    1.0 / (Floats::splat(s, 0.0) - d)
}

impl<S: Simd> Meeting<S> {
    /// Where planes tilt along fewer axes there are fewer operations with the same numbers, since coefficients of 0 change none. `level`:
    /// [`level_fall`].
    #[inline(always)]
    fn new<const AXIS: usize, K: Kind>(s: S, rays: &Scaled<S>, face: &Face, level: Floats<S>) -> Self {
        let (o, o_across) = components::<S, AXIS>(rays.origin);
        let (d, d_across) = components::<S, AXIS>(rays.direction);
        let [a, b, c] = &face.plane;
        let (height, inverse) = match K::TILT {
            Tilt::None => (o - Floats::load(s, c), level),
            Tilt::First => {
                let height = o - (Floats::load(s, a) * o_across.0 + Floats::load(s, c));
                (height, 1.0 / (Floats::load(s, a) * d_across.0 - d))
            }
            Tilt::Second => {
                let height = o - (Floats::load(s, b) * o_across.1 + Floats::load(s, c));
                (height, 1.0 / (Floats::load(s, b) * d_across.1 - d))
            }
            Tilt::Both => {
                let fall = Floats::load(s, a) * d_across.0 + Floats::load(s, b) * d_across.1 - d;
                (o - value(s, &face.plane, o_across), 1.0 / fall)
            }
        };
        let t = height * inverse;
        let error = inverse.abs() * (Floats::load(s, &face.error) + t.abs() * ERROR);
        let p = (o_across.0 + d_across.0 * t, o_across.1 + d_across.1 * t);
        Self { t, p, error }
    }

    /// How far from the face's edges, positive inside.
    #[inline(always)]
    fn margin<K: Kind>(&self, s: S, face: &Face) -> Floats<S> {
        let (x, y) = self.p;
        if let Shape::Rectangle = K::SHAPE {
            let [[left, right], [low, high]] = &face.extent;
            let across = (x - Floats::load(s, left)).min(Floats::load(s, right) - x);
            return across.min((y - Floats::load(s, low)).min(Floats::load(s, high) - y));
        }
        let [first, second, third, fourth] = &face.edges;
        let margin = value(s, first, self.p).min(value(s, second, self.p)).min(value(s, third, self.p));
        if K::PAIR { margin.min(value(s, fourth, self.p)) } else { margin }
    }

    /// Which triangle of the face it is, and where that is sure.
    #[inline(always)]
    fn triangle<K: Kind>(&self, s: S, face: &Face) -> (Integers<S>, Mask<S>) {
        let (first, second) = (Integers::splat(s, face.triangles[0]), Integers::splat(s, face.triangles[1]));
        if K::PAIR {
            let diagonal = value(s, &face.diagonal, self.p);
            let sure = self.error.less(diagonal.abs());
            (second.or_where_not(diagonal.less(Floats::splat(s, 0.0)), first), sure)
        } else {
            (first, Mask::splat(s, true))
        }
    }
}

/// What loops over faces are compiled for.
trait Kind {
    const SHAPE: Shape;
    const TILT: Tilt;
    /// Whether they are two triangles each.
    const PAIR: bool = !matches!(Self::SHAPE, Shape::Triangle);
}

macro_rules! kinds {
    ($($name:ident: $shape:ident, $tilt:ident;)*) => {
        $(struct $name;
        impl Kind for $name {
            const SHAPE: Shape = Shape::$shape;
            const TILT: Tilt = Tilt::$tilt;
        })*
    };
}

kinds! {
    Triangles: Triangle, Both;
    Quadrangles: Quadrangle, Both;
    LevelQuadrangles: Quadrangle, None;
    Rectangles: Rectangle, Both;
    RectanglesByFirst: Rectangle, First;
    RectanglesBySecond: Rectangle, Second;
    LevelRectangles: Rectangle, None;
}

/// What faces are tried for.
trait Trial<S: Simd> {
    /// Written so that what is no number is doubtful.
    fn try_face<K: Kind>(&mut self, s: S, meeting: &Meeting<S>, face: &Face);
}

#[inline(always)]
fn try_axis<S: Simd, const AXIS: usize>(s: S, rays: &Scaled<S>, faces: &Faces, trial: &mut impl Trial<S>) {
    let [none, first, second, both] = &faces.rectangles;
    try_kind::<S, AXIS, LevelRectangles>(s, rays, none, trial);
    try_kind::<S, AXIS, RectanglesByFirst>(s, rays, first, trial);
    try_kind::<S, AXIS, RectanglesBySecond>(s, rays, second, trial);
    try_kind::<S, AXIS, Rectangles>(s, rays, both, trial);
    try_kind::<S, AXIS, LevelQuadrangles>(s, rays, &faces.level_quadrangles, trial);
    try_kind::<S, AXIS, Quadrangles>(s, rays, &faces.quadrangles, trial);
    try_kind::<S, AXIS, Triangles>(s, rays, &faces.triangles, trial);
}

#[inline(always)]
fn try_kind<S: Simd, const AXIS: usize, K: Kind>(
    s: S,
    rays: &Scaled<S>,
    faces: &[Face],
    trial: &mut impl Trial<S>,
) {
    if faces.is_empty() {
        return;
    }
    let level = level_fall::<S, AXIS>(s, rays);
    for face in faces {
        trial.try_face::<K>(s, &Meeting::new::<AXIS, K>(s, rays, face, level), face);
    }
}

/// The nearest of the faces that were tried.
struct Nearest<S: Simd> {
    /// The triangles that rays start on, and which lanes have one.
    from: Integers<S>,
    active: u32,
    /// Bounds on its distance.
    least: Floats<S>,
    most: Floats<S>,
    primitive: Integers<S>,
    /// Lanes where something else may be nearer.
    doubtful: u32,
}

impl<S: Simd> Trial<S> for Nearest<S> {
    #[inline(always)]
    fn try_face<K: Kind>(&mut self, s: S, meeting: &Meeting<S>, face: &Face) {
        let margin = meeting.margin::<K>(s, face);
        let Meeting { t, error, .. } = *meeting;
        let (near, far) = (t - error, t + error);
        // Of two `min` keeps the second where one is no number; where that is `t` the error is none either.
        let inside = t.min(margin);
        let away = inside.less(-error) | self.most.less(near);
        if !away.bits() & self.active == 0 {
            return;
        }
        let (primitive, which) = meeting.triangle::<K>(s, face);
        let away = away | (primitive.equal(self.from) & which);
        let surely = (error.less(inside) & far.less(self.least) & which).without(away);
        self.doubtful |= !(away | surely).bits();
        self.least = surely.select(near, self.least);
        self.most = surely.select(far, self.most);
        self.primitive = primitive.or_where_not(surely, self.primitive);
    }
}

/// Where rays are blocked.
trait Note<S: Simd> {
    /// Lanes `hit` surely are by these triangles.
    fn note(&mut self, s: S, primitive: Integers<S>, hit: Mask<S>);
}

/// Nobody asks.
struct Nowhere;

impl<S: Simd> Note<S> for Nowhere {
    #[inline(always)]
    fn note(&mut self, _s: S, _primitive: Integers<S>, _hit: Mask<S>) {}
}

/// Places of triangles, as bits, and those where rays are blocked.
struct Places<'a, S: Simd> {
    of: &'a [u32],
    hit: Integers<S>,
}

impl<S: Simd> Note<S> for Places<'_, S> {
    #[inline(always)]
    fn note(&mut self, s: S, primitive: Integers<S>, hit: Mask<S>) {
        let place = Integers::gather(self.of, primitive);
        self.hit = self.hit | place.or_where_not(hit, Integers::splat(s, 0));
    }
}

/// Lanes that are blocked.
struct Found<S: Simd, N> {
    /// The triangles that rays start on and end before, and which lanes have one.
    except: [Integers<S>; 2],
    active: u32,
    /// Of the rays.
    end: Floats<S>,
    surely: u32,
    perhaps: u32,
    place: N,
}

impl<S: Simd, N: Note<S>> Trial<S> for Found<S, N> {
    #[inline(always)]
    fn try_face<K: Kind>(&mut self, s: S, meeting: &Meeting<S>, face: &Face) {
        let Self { except, active, end, .. } = *self;
        let Meeting { t, error, .. } = *meeting;
        let away = t.less(-error) | end.less(t - error);
        // As walls are that a room lies on one side of.
        if !away.bits() & active == 0 {
            return;
        }
        let margin = meeting.margin::<K>(s, face);
        let away = away | margin.less(-error);
        if !away.bits() & active == 0 {
            return;
        }
        let (primitive, which) = meeting.triangle::<K>(s, face);
        let excepted = primitive.equal(except[0]) | primitive.equal(except[1]);
        let away = away | (excepted & which);
        let surely = (error.less(t.min(margin)) & (t + error).less(end) & which).without(away);
        self.place.note(s, primitive, surely);
        self.surely |= surely.bits();
        self.perhaps |= !(away | surely).bits();
    }
}
