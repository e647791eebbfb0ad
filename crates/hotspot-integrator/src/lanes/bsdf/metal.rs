//! [`crate::bsdf::RoughMetal`] in lanes, and GGX's distribution.

use super::BsdfLanes;
use crate::lanes::math::{pow5, sin_cos_turn, square_to_disk};
use crate::math::FRAC_1_PI;
use hotspot_bvh::simd::{Floats, Simd, Vectors};

/// [`crate::bsdf::ggx`].
#[inline(always)]
pub(super) fn ggx<S: Simd>(s: S, h: Vectors<S>, alpha: Floats<S>) -> Floats<S> {
    let a2 = alpha * alpha;
    let t = h.x * h.x + h.y * h.y + a2 * (h.z * h.z);
    a2 * Floats::splat(s, FRAC_1_PI) / (t * t)
}

/// [`crate::bsdf::sample_ggx`].
#[inline(always)]
pub(super) fn sample_ggx<S: Simd>(s: S, alpha: Floats<S>, u: Floats<S>, v: Floats<S>) -> Vectors<S> {
    let a2 = alpha * alpha;
    let (up, out) = (Floats::splat(s, 1.0) - u, a2 * u);
    let denominator = up + out;
    let cos = (up / denominator).sqrt();
    let sin = (out / denominator).sqrt();
    let (y, x) = sin_cos_turn(s, v);
    Vectors::new(sin * x, sin * y, cos)
}

/// Smith's G1 for GGX.
#[inline(always)]
fn g1<S: Simd>(s: S, cos: Floats<S>, alpha: Floats<S>) -> Floats<S> {
    let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
    let c2 = cos * cos;
    let tan2 = (one - c2).max(zero) / c2;
    2.0 / (one + (one + alpha * alpha * tan2).sqrt())
}

/// As [`Vec3::normalize`](glam::Vec3::normalize) has it.
#[inline(always)]
fn normalized<S: Simd>(v: Vectors<S>) -> Vectors<S> {
    v.scaled(1.0 / v.dot(v).sqrt())
}

impl<S: Simd> BsdfLanes<S> {
    /// [`RoughMetal::eval`](crate::bsdf::RoughMetal::eval) where both directions lie above.
    #[inline(always)]
    pub(super) fn eval_metal(&self, s: S, wo: Vectors<S>, wi: Vectors<S>) -> (Vectors<S>, Floats<S>) {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let h = wi + wo;
        let length = h.dot(h).sqrt();
        let some = zero.less(length);
        let h = Vectors::new(h.x / length, h.y / length, h.z / length);
        let d = ggx(s, h, self.alpha);
        let ones = Vectors::new(one, one, one);
        let schlick = pow5((one - Floats::splat(s, 0.5) * length).max(zero));
        let fresnel = self.color + (ones - self.color).scaled(schlick);
        let g1_wo = g1(s, wo.z, self.alpha);
        let g1_wi = g1(s, wi.z, self.alpha);
        let pdf = g1_wo * d / (Floats::splat(s, 4.0) * wo.z);
        (fresnel.scaled(pdf * g1_wi).or_zero(some), some.or_zero(pdf))
    }

    /// The visible normal about which [`RoughMetal::sample`](crate::bsdf::RoughMetal::sample) reflects.
    #[inline(always)]
    pub(super) fn sample_visible_normal(
        &self,
        s: S,
        wo: Vectors<S>,
        u: Floats<S>,
        v: Floats<S>,
    ) -> Vectors<S> {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let alpha = self.alpha;
        let stretched = normalized(Vectors::new(alpha * wo.x, alpha * wo.y, wo.z));
        let lateral2 = stretched.x * stretched.x + stretched.y * stretched.y;
        let lateral = lateral2.sqrt();
        let tangent = Vectors::new(-stretched.y / lateral, stretched.x / lateral, zero);
        let t1 = tangent.or_where_not(zero.less(lateral2), Vectors::new(one, zero, zero));
        let t2 = stretched.cross(t1);
        let (x, across) = square_to_disk(s, u, v);
        let share = Floats::splat(s, 0.5) * (one + stretched.z);
        let y = (one - share) * (one - x * x).max(zero).sqrt() + share * across;
        let z = (one - x * x - y * y).max(zero).sqrt();
        let n = t1.scaled(x) + t2.scaled(y) + stretched.scaled(z);
        normalized(Vectors::new(alpha * n.x, alpha * n.y, n.z.max(Floats::splat(s, 1e-7))))
    }
}
