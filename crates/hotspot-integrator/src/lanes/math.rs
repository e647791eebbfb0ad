//! Formulas of [`crate::math`] and its neighbours for eight paths at once, in the same order of operations.

use glam::Vec3;
use hotspot_bvh::simd::{F8, Floats, Integers, Simd, Vectors, vector};

/// [`crate::math::square_to_disk`].
#[inline(always)]
pub(crate) fn square_to_disk<S: Simd>(s: S, u: Floats<S>, v: Floats<S>) -> (Floats<S>, Floats<S>) {
    let zero = Floats::splat(s, 0.0);
    let two = Floats::splat(s, 2.0);
    let (a, b) = (two * u - 1.0, two * v - 1.0);
    let wide = b.abs().less(a.abs());
    let (radius, other) = (wide.select(a, b), wide.select(b, a));
    let (sin, cos) = sin_cos_eighth(s, Floats::splat(s, core::f32::consts::FRAC_PI_4) * (other / radius));
    // At the centre neither is a number.
    let centre = radius.is(0.0);
    let along = centre.select(zero, radius * cos);
    let across = centre.select(zero, radius * sin);
    (wide.select(along, across), wide.select(across, along))
}

/// [`crate::math::square_to_cosine_hemisphere`].
#[inline(always)]
pub(crate) fn square_to_cosine_hemisphere<S: Simd>(s: S, u: Floats<S>, v: Floats<S>) -> Vectors<S> {
    let (x, y) = square_to_disk(s, u, v);
    Vectors::new(x, y, (1.0 - x * x - y * y).max(Floats::splat(s, 0.0)).sqrt())
}

#[inline(always)]
fn sin_cos_eighth<S: Simd>(s: S, x: Floats<S>) -> (Floats<S>, Floats<S>) {
    let x2 = x * x;
    let sin = x * series(s, x2, [-1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0]);
    (sin, series(s, x2, [-0.5, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0]))
}

/// 1 + ax + bx² + cx³ + dx⁴.
#[inline(always)]
fn series<S: Simd>(s: S, x: Floats<S>, [a, b, c, d]: [f32; 4]) -> Floats<S> {
    let [one, a, b, c] =
        [Floats::splat(s, 1.0), Floats::splat(s, a), Floats::splat(s, b), Floats::splat(s, c)];
    one + x * (a + x * (b + x * (c + x * d)))
}

/// [`crate::math::square_to_triangle`].
#[inline(always)]
pub(crate) fn square_to_triangle<S: Simd>(u: Floats<S>, v: Floats<S>) -> (Floats<S>, Floats<S>) {
    let above = u.less(v);
    let half = above.select(u, v) * 0.5;
    (above.select(half, u - half), above.select(v - half, half))
}

/// [`crate::math::Frame`].
#[derive(Clone, Copy)]
pub(crate) struct FrameLanes<S: Simd> {
    s: Vectors<S>,
    t: Vectors<S>,
    pub(crate) n: Vectors<S>,
}

impl<S: Simd> FrameLanes<S> {
    /// Around unit normals.
    #[inline(always)]
    pub(super) fn new(s: S, n: Vectors<S>) -> Self {
        let one = Floats::splat(s, 1.0);
        let sign = one.copysign(n.z);
        let a = Floats::splat(s, -1.0) / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vectors::new(one + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vectors::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Tangents, bitangents and normals.
    #[inline(always)]
    pub(crate) fn store(&self) -> [[F8; 3]; 3] {
        [self.s.store(), self.t.store(), self.n.store()]
    }

    #[inline(always)]
    pub(super) fn to_local(self, v: Vectors<S>) -> Vectors<S> {
        Vectors::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    #[inline(always)]
    pub(crate) fn to_world(self, v: Vectors<S>) -> Vectors<S> {
        self.s.scaled(v.x) + self.t.scaled(v.y) + self.n.scaled(v.z)
    }
}

/// [`crate::math::sin_cos_turn`].
#[inline(always)]
pub(crate) fn sin_cos_turn<S: Simd>(s: S, u: Floats<S>) -> (Floats<S>, Floats<S>) {
    let quarter = (u * 4.0 + 0.5).truncate();
    let angle = (u * 4.0 - quarter.to_floats()) * core::f32::consts::FRAC_PI_2;
    let (sin, cos) = sin_cos_eighth(s, angle);
    let odd = (quarter & 1).is(1);
    (negated(odd.select(cos, sin), quarter), negated(odd.select(sin, cos), quarter + 1))
}

/// [`crate::math::atan2_turns`].
#[inline(always)]
pub(crate) fn atan2_turns<S: Simd>(s: S, y: Floats<S>, x: Floats<S>) -> Floats<S> {
    let zero = Floats::splat(s, 0.0);
    let (ax, ay) = (x.abs(), y.abs());
    let upright = ax.less(ay);
    let (long, short) = (upright.select(ay, ax), upright.select(ax, ay));
    let steep = (long * 0.414_213_56).less(short);
    let above = steep.select(short - long, short);
    let below = steep.select(short + long, long.max(Floats::splat(s, f32::MIN_POSITIVE)));
    let t = above / below;
    let t2 = t * t;
    let [a, b, c, d] = [0.159_154_94, -0.053_050_776, 0.031_789_74, -0.022_040_557];
    let p = t2 * (t2 * (t2 * (t2 * 0.012_694_663 + d) + c) + b) + a;
    let turns = t * p + steep.or_zero(Floats::splat(s, 0.125));
    let turns = upright.select(0.25 - turns, turns);
    x.less(zero).select(0.5 - turns, turns).copysign(y)
}

/// Where the second bit of `when` is set.
#[inline(always)]
fn negated<S: Simd>(x: Floats<S>, when: Integers<S>) -> Floats<S> {
    (x.bits() ^ (when & 2).shift_left::<30>()).as_bits()
}

/// [`crate::math::pow5`].
#[inline(always)]
pub(super) fn pow5<S: Simd>(x: Floats<S>) -> Floats<S> {
    let x2 = x * x;
    x2 * x2 * x
}

/// [`crate::math::power_heuristic`].
#[inline(always)]
pub(super) fn power_heuristic<S: Simd>(s: S, pdf: Floats<S>, other: Floats<S>) -> Floats<S> {
    let one = Floats::splat(s, 1.0);
    let ratio = other / pdf;
    let infinite = Floats::splat(s, f32::INFINITY).less_equal(pdf);
    infinite.select(one, one / (one + ratio * ratio))
}

/// The largest component.
#[inline(always)]
pub(crate) fn max_element<S: Simd>(v: Vectors<S>) -> Floats<S> {
    v.x.max(v.y.max(v.z))
}

/// `a` turned to the side of `towards`: as [`crate::path`] chooses the side that a ray leaves on.
#[inline(always)]
pub(super) fn facing<S: Simd>(s: S, a: Vectors<S>, towards: Vectors<S>) -> Vectors<S> {
    (-a).or_where_not(towards.dot(a).less(Floats::splat(s, 0.0)), a)
}

/// A lane of vectors in memory.
#[inline(always)]
pub(crate) fn vec3(vectors: &[F8; 3], lane: usize) -> Vec3 {
    Vec3::from_array(vector(vectors, lane))
}
