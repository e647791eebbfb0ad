//! Scattering at a surface. Directions are unit vectors in the shading frame (normal +z) and point away from the surface;
//! `wo` is where the path came from and has wo.z > 0 (the frame is turned to its side). pdfs are per solid angle.

mod glass;
mod metal;
mod substrate;
#[cfg(test)]
mod tests;

use crate::math::{FRAC_1_PI, square_to_cosine_hemisphere};
use glam::{Vec2, Vec3};

pub(crate) use glass::Glass;
pub(crate) use metal::RoughMetal;
pub(crate) use substrate::Substrate;

/// How a surface scatters at one point: textures are resolved.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bsdf {
    /// Lambert: f = ρ/π.
    Matte(Vec3),
    Substrate(Substrate),
    /// Perfect specular reflection, without Fresnel.
    Mirror(Vec3),
    RoughMetal(RoughMetal),
    Glass(Glass),
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BsdfSample {
    pub(crate) wi: Vec3,
    /// f·|cos θi| / pdf.
    pub(crate) weight: Vec3,
    /// Per solid angle; infinite for specular directions.
    pub(crate) pdf: f32,
    /// η² of a refraction (relative to the incident side), which roulette must not count as a loss; 1 otherwise.
    pub(crate) eta_scale: f32,
}

impl Bsdf {
    /// True when no direction but single ones has f > 0, so that light sampling is in vain.
    #[inline(always)]
    pub(crate) const fn is_specular(&self) -> bool {
        matches!(self, Self::Mirror(_) | Self::Glass(_))
    }

    /// f·|cos θi| and the pdf with which [`Bsdf::sample`] takes `wi`.
    #[inline(always)]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        match self {
            Self::Matte(reflectance) => (*reflectance * (FRAC_1_PI * wi.z), FRAC_1_PI * wi.z),
            Self::Substrate(substrate) => substrate.eval(wo, wi),
            Self::RoughMetal(metal) => metal.eval(wo, wi),
            Self::Mirror(_) | Self::Glass(_) => (Vec3::ZERO, 0.0),
        }
    }

    /// Splits one number into the choice of a lobe and what remains of it for the direction, stretched to [0, 1): so both are
    /// stratified as one. Smooth lobes have no use for the rest.
    #[inline(always)]
    pub(crate) fn choose_lobe(&self, u: f32) -> (f32, f32) {
        match self {
            Self::Substrate(_) => (u, if u < 0.5 { 2.0 * u } else { 2.0 * u - 1.0 }),
            _ => (u, u),
        }
    }

    /// A direction, or `None` where the sample carries nothing. `lobe`, `u`: uniform in [0, 1).
    #[inline(always)]
    pub(crate) fn sample(&self, wo: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let sample = match self {
            Self::Matte(reflectance) => {
                let wi = square_to_cosine_hemisphere(u);
                BsdfSample { wi, weight: *reflectance, pdf: FRAC_1_PI * wi.z, eta_scale: 1.0 }
            }
            Self::Substrate(substrate) => substrate.sample(wo, lobe, u)?,
            Self::Mirror(reflectance) => BsdfSample {
                wi: Vec3::new(-wo.x, -wo.y, wo.z),
                weight: *reflectance,
                pdf: f32::INFINITY,
                eta_scale: 1.0,
            },
            Self::RoughMetal(metal) => metal.sample(wo, u)?,
            Self::Glass(glass) => glass.sample(wo, lobe),
        };
        (sample.pdf > 0.0 && sample.weight != Vec3::ZERO).then_some(sample)
    }
}
