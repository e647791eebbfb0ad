//! [`crate::bsdf::Substrate`] in lanes.

use super::BsdfLanes;
use super::metal::ggx;
use crate::lanes::math::pow5;
use crate::math::{FRAC_1_PI, PI};
use hotspot_bvh::simd::{Floats, Simd, Vectors};

impl<S: Simd> BsdfLanes<S> {
    /// [`Substrate::eval`](crate::bsdf::Substrate::eval) where both directions lie above.
    #[inline(always)]
    pub(super) fn eval_substrate(&self, s: S, wo: Vectors<S>, wi: Vectors<S>) -> (Vectors<S>, Floats<S>) {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let half = Floats::splat(s, 0.5);
        let h = wi + wo;
        let length = h.dot(h).sqrt();
        let some = Floats::splat(s, 1e-7).less_equal(length);
        let h = Vectors::new(h.x / length, h.y / length, h.z / length);
        let wi_h = half * length;
        let d = ggx(s, h, self.alpha);
        let ones = Vectors::new(one, one, one);
        let coat = Floats::splat(s, 28.0 / (23.0 * PI))
            * (one - pow5(one - half * wi.z))
            * (one - pow5(one - half * wo.z));
        let diffuse = (self.color * (ones - self.specular)).scaled(coat);
        let schlick = pow5((one - wi_h).max(zero));
        let fresnel = self.specular + (ones - self.specular).scaled(schlick);
        let lobe = d / (Floats::splat(s, 4.0) * wi_h);
        let f_cos = diffuse.scaled(wi.z) + fresnel.scaled(lobe * (wi.z / wi.z.max(wo.z)));
        let pdf = half * (Floats::splat(s, FRAC_1_PI) * wi.z + lobe * h.z.abs());
        (f_cos.or_zero(some), some.or_zero(pdf))
    }
}
