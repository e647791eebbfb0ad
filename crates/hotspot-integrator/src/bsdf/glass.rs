//! Smooth dielectric: exact Fresnel, the boundary of a solid or a thin pane.

use super::BsdfSample;
use glam::Vec3;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Glass {
    /// Scales the transmitted part.
    pub(crate) transmittance: Vec3,
    /// Index of refraction on the far side over that on the side of `wo`.
    pub(crate) eta: f32,
    /// A pane: both interfaces and all reflections between them at once, no refraction.
    pub(crate) thin: bool,
    /// Inside of a solid, per unit of length; the path loop applies it.
    pub(crate) absorption: Vec3,
}

/// Unpolarised Fresnel reflectance, and the cosine of the transmitted angle (0 under total reflection).
#[inline(always)]
fn fresnel(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

impl Glass {
    /// Reflects or transmits in proportion to the Fresnel reflectance. Radiance is carried as is along the path (camera
    /// paths scale it by 1/η² on entry and by η² on exit; `eta_scale` lets roulette undo that).
    #[inline(always)]
    pub(crate) fn sample(&self, wo: Vec3, lobe: f32) -> BsdfSample {
        let (mut r, cos_t) = fresnel(wo.z, self.eta);
        if self.thin && r < 1.0 {
            // All orders of reflection between the two faces: R + T²R/(1 − R²) = 2R/(1 + R).
            r += (1.0 - r) * (1.0 - r) * r / (1.0 - r * r);
        }
        if lobe < r {
            return BsdfSample {
                wi: Vec3::new(-wo.x, -wo.y, wo.z),
                weight: Vec3::ONE,
                pdf: f32::INFINITY,
                eta_scale: 1.0,
            };
        }
        if self.thin {
            return BsdfSample { wi: -wo, weight: self.transmittance, pdf: f32::INFINITY, eta_scale: 1.0 };
        }
        let inv = 1.0 / self.eta;
        BsdfSample {
            wi: Vec3::new(-wo.x * inv, -wo.y * inv, -cos_t),
            weight: self.transmittance * (inv * inv),
            pdf: f32::INFINITY,
            eta_scale: self.eta * self.eta,
        }
    }
}
