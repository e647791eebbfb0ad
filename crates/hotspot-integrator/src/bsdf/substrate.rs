//! A glossy coat over a diffuse base: Ashikhmin and Shirley, *An Anisotropic Phong BRDF Model* (2000), with isotropic GGX
//! and without a masking term, as pbrt-v3's SubstrateMaterial (Pharr, Jakob, Humphreys, *Physically Based Rendering*,
//! 3rd edition, section 8.5).
//!
//! f = 28/(23π) Rd (1 − Rs) (1 − (1 − cos θi/2)⁵) (1 − (1 − cos θo/2)⁵)
//!   + D(h) / (4 |wi·h| max(cos θi, cos θo)) (Rs + (1 − Rs)(1 − wi·h)⁵)

use super::BsdfSample;
use super::metal::{ggx, reflect, sample_ggx};
use crate::math::{FRAC_1_PI, PI, pow5, square_to_cosine_hemisphere};
use glam::{Vec2, Vec3};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Substrate {
    /// Rd.
    pub(crate) diffuse: Vec3,
    /// Rs, at normal incidence.
    pub(crate) specular: Vec3,
    /// GGX α.
    pub(crate) alpha: f32,
}

impl Substrate {
    /// f·cos θi and the pdf of the even mixture of a cosine lobe and reflection about h ~ D(h) cos θh.
    #[inline(always)]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let h = wi + wo;
        let length = h.length();
        // Opposite directions, up to rounding: there is no half vector.
        if length < 1e-7 {
            return (Vec3::ZERO, 0.0);
        }
        let h = h / length;
        // wi·h = wo·h, in one way for both: reciprocal to the last bits.
        let wi_h = 0.5 * length;
        let d = ggx(h, self.alpha);
        let diffuse = self.diffuse
            * (Vec3::ONE - self.specular)
            * ((28.0 / (23.0 * PI)) * (1.0 - pow5(1.0 - 0.5 * wi.z)) * (1.0 - pow5(1.0 - 0.5 * wo.z)));
        let fresnel = self.specular + (Vec3::ONE - self.specular) * pow5((1.0 - wi_h).max(0.0));
        // Per solid angle of wi. The ratio of cosines is taken first: their product with wi·h may underflow.
        let lobe = d / (4.0 * wi_h);
        let f_cos = diffuse * wi.z + fresnel * (lobe * (wi.z / wi.z.max(wo.z)));
        (f_cos, 0.5 * (FRAC_1_PI * wi.z + lobe * h.z.abs()))
    }

    #[inline(always)]
    pub(crate) fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let wi =
            if lobe < 0.5 { square_to_cosine_hemisphere(u) } else { reflect(wo, sample_ggx(u, self.alpha)) };
        if wi.z <= 0.0 {
            return None;
        }
        let (f_cos, pdf) = self.eval(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: f_cos / pdf, pdf, eta_scale: 1.0 })
    }
}
