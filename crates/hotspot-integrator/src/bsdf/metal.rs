//! Rough metal: isotropic GGX, separable Smith masking, Schlick's Fresnel from F0 (glTF 2.0, appendix B).
//! Walter et al., *Microfacet Models for Refraction through Rough Surfaces* (EGSR 2007); visible normals after Heitz,
//! *Sampling the GGX Distribution of Visible Normals* (JCGT 2018).

use super::BsdfSample;
use crate::math::{FRAC_1_PI, pow5, sin_cos_turn, square_to_disk};
use glam::{Vec2, Vec3};

#[derive(Clone, Copy, Debug)]
pub(crate) struct RoughMetal {
    /// Reflectance at normal incidence.
    pub(crate) f0: Vec3,
    /// GGX α.
    pub(crate) alpha: f32,
}

/// D(h), isotropic GGX.
#[inline(always)]
pub(crate) fn ggx(h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    // cos²(α² − 1) + 1 = sin² + α² cos², with sin² taken from x and y, so that nothing cancels near the pole.
    let t = h.x * h.x + h.y * h.y + a2 * (h.z * h.z);
    a2 * FRAC_1_PI / (t * t)
}

/// h with pdf D(h) cos θh.
#[inline(always)]
pub(crate) fn sample_ggx(u: Vec2, alpha: f32) -> Vec3 {
    let a2 = alpha * alpha;
    // 1 + (α² − 1) u and sin² = 1 − cos² as sums of what is not negative: nothing cancels, and h is of unit length however
    // small α is.
    let (up, out) = (1.0 - u.x, a2 * u.x);
    let denominator = up + out;
    let cos = (up / denominator).sqrt();
    let sin = (out / denominator).sqrt();
    let (s, c) = sin_cos_turn(u.y);
    Vec3::new(sin * c, sin * s, cos)
}

/// Mirrors w about h.
#[inline(always)]
pub(crate) fn reflect(w: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * w.dot(h)) - w
}

/// Smith's G1 for GGX.
#[inline(always)]
fn g1(cos: f32, alpha: f32) -> f32 {
    let c2 = cos * cos;
    let tan2 = (1.0 - c2).max(0.0) / c2;
    2.0 / (1.0 + (1.0 + alpha * alpha * tan2).sqrt())
}

impl RoughMetal {
    /// f·cos θi and the pdf of reflection about a visible normal.
    #[inline(always)]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let h = wi + wo;
        let length = h.length();
        if length == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let h = h / length;
        let d = ggx(h, self.alpha);
        // wi·h = wo·h = |wi + wo| / 2.
        let fresnel = self.f0 + (Vec3::ONE - self.f0) * pow5((1.0 - 0.5 * length).max(0.0));
        let g1_wo = g1(wo.z, self.alpha);
        let g1_wi = g1(wi.z, self.alpha);
        // f cos θi = F D G1 G1 / (4 cos θo); pdf = G1(wo) D / (4 cos θo).
        let pdf = g1_wo * d / (4.0 * wo.z);
        (fresnel * (pdf * g1_wi), pdf)
    }

    #[inline(always)]
    pub(crate) fn sample(&self, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let stretched = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let lateral2 = stretched.x * stretched.x + stretched.y * stretched.y;
        let t1 = if lateral2 > 0.0 {
            Vec3::new(-stretched.y, stretched.x, 0.0) / lateral2.sqrt()
        } else {
            Vec3::X
        };
        let t2 = stretched.cross(t1);
        let disk = square_to_disk(u);
        let s = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - s) * (1.0 - disk.x * disk.x).max(0.0).sqrt() + s * disk.y;
        let z = (1.0 - disk.x * disk.x - y * y).max(0.0).sqrt();
        let n = t1 * disk.x + t2 * y + stretched * z;
        let h = Vec3::new(self.alpha * n.x, self.alpha * n.y, n.z.max(1e-7)).normalize();
        let wi = reflect(wo, h);
        if wi.z <= 0.0 {
            return None;
        }
        let (f_cos, pdf) = self.eval(wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: f_cos / pdf, pdf, eta_scale: 1.0 })
    }
}
