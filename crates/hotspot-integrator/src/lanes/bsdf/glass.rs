//! Mirrors and [`crate::bsdf::Glass`] in lanes.

use super::{BsdfLanes, Kind, SampledLanes};
use hotspot_bvh::simd::{Floats, Simd, Vectors};

/// Unpolarised Fresnel reflectance, and the cosine of the transmitted angle, as [`crate::bsdf::Glass`] has them.
#[inline(always)]
fn fresnel<S: Simd>(s: S, cos_i: Floats<S>, eta: Floats<S>) -> (Floats<S>, Floats<S>) {
    let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
    let sin2_t = (one - cos_i * cos_i).max(zero) / (eta * eta);
    let total = one.less_equal(sin2_t);
    let cos_t = (one - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let reflected = Floats::splat(s, 0.5) * (parallel * parallel + perpendicular * perpendicular);
    (total.select(one, reflected), total.select(zero, cos_t))
}

impl<S: Simd> BsdfLanes<S> {
    /// `sample`, with what mirrors and glass make of it in lanes `asked`.
    #[inline(always)]
    pub(super) fn sample_specular(
        &self,
        s: S,
        wo: Vectors<S>,
        lobe: Floats<S>,
        mut sample: SampledLanes<S>,
        asked: u32,
    ) -> SampledLanes<S> {
        let mirror = self.is(Kind::Mirror);
        let (pane, solid) = (self.is(Kind::Pane), self.is(Kind::Glass));
        let glass = pane | solid;
        let mirrored = Vectors::new(-wo.x, -wo.y, wo.z);
        sample.pdf = (mirror | glass).select(Floats::splat(s, f32::INFINITY), sample.pdf);
        sample.wi = mirrored.or_where_not(mirror | glass, sample.wi);
        if glass.bits() & asked == 0 {
            return sample;
        }
        let one = Floats::splat(s, 1.0);
        let eta = self.alpha;
        let (r, cos_t) = fresnel(s, wo.z, eta);
        let more = r + (one - r) * (one - r) * r / (one - r * r);
        let r = (pane & r.less(one)).select(more, r);
        let reflected = lobe.less(r);
        let inverse = 1.0 / eta;
        let refracted = Vectors::new(-wo.x * inverse, -wo.y * inverse, -cos_t);
        let through = glass.without(reflected);
        sample.wi = (-wo).or_where_not(through & pane, refracted.or_where_not(through & solid, sample.wi));
        let squared = pane.select(one, inverse * inverse);
        let ones = Vectors::new(one, one, one);
        let weight = self.color.scaled(squared).or_where_not(through, ones);
        sample.weight = weight.or_where_not(glass, sample.weight);
        sample.eta_scale = (through & solid).select(eta * eta, sample.eta_scale);
        sample
    }

    /// What solid glass absorbs, and where there is any.
    #[inline(always)]
    pub(in crate::lanes) fn absorbing(&self) -> (Vectors<S>, hotspot_bvh::simd::Mask<S>) {
        (self.specular, self.is(Kind::Glass))
    }
}
