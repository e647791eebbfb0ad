//! Choosing a light and a point or direction of it, in proportion to power.
//!
//! **Kinds.** Emissive triangles ([`triangles`]), one environment (a constant, or a map: [`environment`]), and lights without
//! area ([`punctual`]).
//!
//! **Dimensions.** A vertex spends two numbers on light, dimensions 2 and 3 of its segment's set
//! ([`Dimensions::segment`](crate::sampler::Dimensions::segment)). The first chooses: the environment below its
//! probability, otherwise an entry of one cumulative distribution, triangles before punctual lights. What the choice leaves of
//! it is stretched to [0, 1) and used on: with the second number it makes the point of a triangle or the direction to a
//! constant environment; of a map it chooses the row and the place in it, and the second number the column and the
//! place in that. Punctual lights have no use for either. All choices invert a cumulative distribution, so stratified
//! numbers stay stratified.
//!
//! **Densities.** [`LightSample::pdf`] holds everything that was chosen. P(environment) · pdf(direction); or
//! (1 − P(environment)) · P(triangle) / area, turned into solid angle; or (1 − P(environment)) · P(light), a
//! probability. A ray that meets a triangle or leaves the scene asks for the same density, for MIS; nothing meets a punctual
//! light, so its samples count in full.
//!
//! **Probabilities** go by power, summed over channels; of triangles half by power and half evenly by object
//! (`towards_even`). With punctual lights in the scene, power alone would starve: a
//! sun's power over a large scene is a million times that of a lamp, and what is never sampled is missing. So then each
//! kind that is present gets at least [`LEAST_SHARE`], and so much of the punctual lights' share is spread evenly over them.

mod environment;
mod environment_lanes;
mod facing;
mod guided;
mod lanes;
mod learn;
mod learned_lanes;
#[cfg(test)]
mod patch_tests;
mod patches;
mod punctual;
#[cfg(test)]
mod sampling_tests;
mod steps;
#[cfg(test)]
mod tests;
mod trees;
mod triangles;
mod windows;

use crate::class::{Class, Feature, has};
use crate::geometry::{Geometry, SurfacePoint, SurfaceTriangle, least_height};
use crate::math::{FRAC_1_PI, Frame, square_to_cosine_hemisphere};
use crate::scene::PrepareError;
use crate::texture::Texture;
pub(crate) use environment::EnvironmentSampler;
use glam::{Vec2, Vec3};
use hotspot_probe::Probe;
use hotspot_scene::{Environment, Light, Material};
pub(crate) use lanes::{LightLanes, LightSamples, sample_each, way_to_positions};
pub(crate) use learn::{Learned, Lessons, Outlook, Viewpoint, met};
pub(crate) use learned_lanes::ViewpointLanes;
use patches::Patches;
use punctual::PunctualLight;
pub(crate) use punctual::ray_to_position;
use std::collections::BTreeMap;
pub(crate) use triangles::area_to_solid_angle;
use triangles::{LightTriangle, area, power_per_area};

/// Least probability of a kind of light in a scene with punctual lights.
const LEAST_SHARE: f64 = 1.0 / 16.0;

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    triangles: Vec<LightTriangle>,
    /// Where on the triangles.
    patches: Patches,
    punctual: Vec<PunctualLight>,
    /// Of each strip of patches and then each punctual light, given that no environment is chosen: probability of all
    /// before it.
    cumulative: Vec<f32>,
    /// For each of as many equal intervals of [0, 1) as there are entries: the first entry that reaches into it.
    guide: Vec<u32>,
    environment: Surroundings,
    /// Probability of choosing the environment.
    environment_probability: f32,
}

/// What lies around the scene.
#[derive(Clone, Debug, Default)]
pub(crate) enum Surroundings {
    /// Blackness.
    #[default]
    Nothing,
    /// The same radiance everywhere.
    Constant(Vec3),
    /// Radiance by direction.
    Map(Box<EnvironmentSampler>),
}

/// A sampled direction towards a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Unit direction from the shading point.
    pub(crate) wi: Vec3,
    /// Density per solid angle, choice of the light included. Where the target is a [`LightTarget::Position`] or a
    /// [`LightTarget::Direction`]: the probability of the light's choice.
    pub(crate) pdf: f32,
    /// What is aimed at.
    pub(crate) target: LightTarget,
}

/// What a shadow ray aims at.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LightTarget {
    /// A point of an emissive triangle, the cosine of the light's geometric normal with the direction to the shading
    /// point (positive on the front), and that normal.
    Surface { primitive: u32, point: SurfacePoint, uv: Vec2, cos: f32, normal: Vec3 },
    /// Infinitely far away; the radiance from there.
    Environment(Vec3),
    /// A light without area. All its light comes from this one direction (a delta distribution), so `pdf` is a
    /// probability, not a density, and there is nothing that BSDF sampling could find: a weight of 1.
    Position { irradiance: Vec3, position: Vec3 },
    /// The same, infinitely far away; the irradiance across its rays.
    Direction(Vec3),
}

impl Surroundings {
    /// `None` in `environment`, and light of no power, give blackness.
    ///
    /// # Errors
    /// When a map's texels do not fill it or its numbers are out of range.
    pub(crate) fn new(environment: Option<&Environment>) -> Result<Self, PrepareError> {
        Ok(match environment {
            Some(Environment::Constant(radiance)) if radiance.iter().any(|c| *c > 0.0) => {
                Self::Constant(Vec3::from_array(*radiance))
            }
            Some(Environment::Map(map)) => {
                let invalid = |problem: &str| PrepareError::Invalid {
                    element: format!("environment \"{}\"", map.name),
                    problem: problem.into(),
                };
                let sampler = EnvironmentSampler::new(map).map_err(invalid)?;
                sampler.map_or(Self::Nothing, |sampler| Self::Map(Box::new(sampler)))
            }
            _ => Self::Nothing,
        })
    }

    /// The power that enters a sphere of this radius, summed over channels: radiance over the sphere of directions times
    /// the sphere's cross-section.
    fn power(&self, radius: f64) -> f64 {
        match self {
            Self::Nothing => 0.0,
            Self::Constant(radiance) => {
                let sum: f64 = radiance.to_array().iter().map(|c| f64::from(*c)).sum();
                4.0 * core::f64::consts::PI.powi(2) * radius * radius * sum
            }
            Self::Map(map) => core::f64::consts::PI * radius * radius * map.flux(),
        }
    }
}

/// Shares of environment, triangles and punctual lights in the choice, by their powers: at least [`LEAST_SHARE`] of each
/// that has any.
fn shares(powers: [f64; 3]) -> [f64; 3] {
    let total: f64 = powers.iter().sum();
    let present = powers.iter().filter(|p| **p > 0.0).count() as f64;
    powers.map(|p| if p > 0.0 { LEAST_SHARE + (1.0 - present * LEAST_SHARE) * (p / total) } else { 0.0 })
}

/// What the powers of each emissive object are multiplied by, so that half of the choices go by power and half are even among
/// objects; their sum stays. Power alone starves what is near but weak: with veach-mis's bright lamp out of sight of its
/// plates, 5 times the error. Even among objects alone would starve a strong lamp among many candles; of half and half either
/// fault costs at most a factor of two in variance.
fn towards_even(powers: &[(u32, f64)], geometry: &Geometry) -> BTreeMap<u32, f64> {
    let mut objects: BTreeMap<u32, f64> = BTreeMap::new();
    for (primitive, power) in powers {
        *objects.entry(geometry.part(*primitive).object).or_default() += power;
    }
    let even = objects.values().sum::<f64>() / objects.len().max(1) as f64;
    objects.into_iter().map(|(object, power)| (object, 0.5 + 0.5 * even / power)).collect()
}

impl Lights {
    /// Collects the lights of a scene and writes each emissive part's `light_pdf_area` into `geometry`.
    /// `radius`: of a sphere around the scene, for the power of what is infinitely far away: that which enters it.
    pub(crate) fn new(
        materials: &[Material],
        environment: Surroundings,
        punctual: &[Light],
        geometry: &mut Geometry,
        textures: &[Texture],
        radius: f64,
    ) -> Self {
        let mut punctual: Vec<PunctualLight> = punctual.iter().filter_map(PunctualLight::new).collect();
        let mut means = vec![None; textures.len()];
        let per_area: Vec<f64> = materials.iter().map(|m| power_per_area(m, textures, &mut means)).collect();
        let powers: Vec<(u32, f64)> = (0..geometry.world_triangles() as u32)
            .filter_map(|primitive| {
                let weight = per_area[geometry.part(primitive).material as usize];
                (weight > 0.0).then(|| (primitive, weight * area(&geometry.triangles[primitive as usize])))
            })
            .collect();
        let surface_power: f64 = powers.iter().map(|p| p.1).sum();
        let shift = towards_even(&powers, geometry);
        let environment_power = environment.power(radius);
        let punctual_powers: Vec<f64> = punctual.iter().map(|l| l.power(radius)).collect();
        let punctual_power: f64 = punctual_powers.iter().sum();
        let total = surface_power + environment_power + punctual_power;
        if total <= 0.0 || !total.is_finite() {
            return Self { environment, environment_probability: 1.0, ..Self::default() };
        }
        // `near`: of triangles, within what is not the environment.
        let (environment_share, area_total, near) = if punctual_power > 0.0 {
            let [e, s, p] = shares([environment_power, surface_power, punctual_power]);
            (e, if s > 0.0 { surface_power / s } else { 1.0 }, s / (s + p))
        } else {
            punctual.clear();
            (environment_power / total, total, 1.0)
        };
        for part in &mut geometry.parts {
            let shift = shift.get(&part.object).copied().unwrap_or(1.0);
            part.light_pdf_area = (per_area[part.material as usize] * shift / area_total) as f32;
        }
        let triangles: Vec<LightTriangle> = powers
            .iter()
            .map(|&(primitive, power)| {
                let probability = power * shift[&geometry.part(primitive).object] / surface_power * near;
                let corners = &geometry.triangles[primitive as usize];
                // In f64: which side of a long thin lamp a point near its plane sees is decided by it, once for all of the lamp.
                let [v0, v1, v2] = corners.map(|corner| Vec3::from_array(corner).as_dvec3());
                let triangle = SurfaceTriangle::new(corners);
                LightTriangle {
                    primitive,
                    probability,
                    pdf_area: geometry.part(primitive).light_pdf_area,
                    triangle,
                    edge: triangle.most_margin() / least_height(corners),
                    normal: (v1 - v0).cross(v2 - v0).normalize_or_zero().as_vec3(),
                    inverse_area: (1.0 / area(corners)) as f32,
                    two_sided: materials[geometry.part(primitive).material as usize].double_sided,
                }
            })
            .collect();
        let patches = Patches::new(&triangles, geometry);
        let mut cumulative: Vec<f32> = patches.cumulative().collect();
        let mut before: f64 = triangles.iter().map(|t| t.probability).sum();
        // Never rounds to 1 where there are others: they would be weighted but not sampled.
        let most = if triangles.is_empty() && punctual.is_empty() { 1.0 } else { 1.0 - f32::EPSILON };
        let environment_probability = (environment_share as f32).min(most);
        let count = punctual.len() as f64;
        for (light, power) in punctual.iter_mut().zip(punctual_powers) {
            let among = LEAST_SHARE / count + (1.0 - LEAST_SHARE) * (power / punctual_power);
            let probability = (1.0 - near) * among;
            cumulative.push(before as f32);
            before += probability;
            light.probability = ((1.0 - f64::from(environment_probability)) * probability) as f32;
        }
        let mut guide = Vec::with_capacity(cumulative.len());
        let mut index = 0;
        for interval in 0..cumulative.len() {
            let start = interval as f32 / cumulative.len() as f32;
            while index + 1 < cumulative.len() && cumulative[index + 1] <= start {
                index += 1;
            }
            guide.push(index as u32);
        }
        Self { triangles, patches, punctual, cumulative, guide, environment, environment_probability }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.cumulative.is_empty() && matches!(self.environment, Surroundings::Nothing)
    }

    /// Number of emissive triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Number of lights without area that shine.
    pub(crate) fn punctual_count(&self) -> usize {
        self.punctual.len()
    }

    /// Bytes held by an environment map and its distribution.
    pub(crate) fn map_memory(&self) -> u64 {
        if let Surroundings::Map(map) = &self.environment { map.memory() } else { 0 }
    }

    /// Bytes held but for the environment map's.
    pub(crate) fn memory(&self) -> u64 {
        self.patches.memory()
            + (size_of_val(&self.triangles[..])
                + size_of_val(&self.punctual[..])
                + size_of_val(&self.cumulative[..])
                + size_of_val(&self.guide[..])) as u64
    }

    /// Density of a constant environment at a surface whose shading normal makes cosine `cos` with the direction.
    #[inline(always)]
    fn constant_pdf(&self, cos: f32) -> f32 {
        self.environment_probability * FRAC_1_PI * cos.max(0.0)
    }

    /// What a ray that leaves the scene along unit vector `direction` meets: radiance, and the density per solid angle
    /// with which [`Lights::sample`] takes that direction at the surface that the ray left, whose shading normal
    /// makes cosine `cos` with it.
    #[inline(always)]
    pub(crate) fn escaped<P: Probe, C: Class>(
        &self,
        direction: Vec3,
        cos: f32,
        probe: &mut P,
    ) -> Option<(Vec3, f32)> {
        match &self.environment {
            Surroundings::Nothing => None,
            Surroundings::Constant(radiance) => Some((*radiance, self.constant_pdf(cos))),
            Surroundings::Map(_) if !has::<C>(Feature::EnvironmentMaps) => None,
            Surroundings::Map(map) => {
                probe.texture(1, EnvironmentSampler::LOOKUP_BYTES);
                let look = map.look_up(direction);
                Some((look.radiance, self.environment_probability * look.pdf))
            }
        }
    }

    /// Whether [`Lights::sample`] must know more than triangles and a constant environment.
    #[inline(always)]
    pub(crate) fn has_maps_or_points<C: Class>(&self) -> bool {
        (has::<C>(Feature::EnvironmentMaps) && matches!(self.environment, Surroundings::Map(_)))
            || (has::<C>(Feature::PunctualLights) && !self.punctual.is_empty())
    }

    /// A direction towards a light, seen from `p`; `frame` is the shading frame on the side of the path. `None` where
    /// the sample cannot bring light: no lights, seen edge-on, outside of a spot, or a point of the light itself. `ANY`
    /// as [`Lights::has_maps_or_points`] says: without it maps and punctual lights give nothing.
    #[inline(always)]
    pub(crate) fn sample<P: Probe, C: Class, const ANY: bool>(
        &self,
        p: Vec3,
        frame: &Frame,
        u: [f32; 2],
        probe: &mut P,
    ) -> Option<LightSample> {
        let [mut select, v] = u;
        if !matches!(self.environment, Surroundings::Nothing) {
            if select < self.environment_probability {
                let u = Vec2::new(select / self.environment_probability, v);
                return self.sample_environment::<P, C, ANY>(frame, u, probe);
            }
            select = (select - self.environment_probability) / (1.0 - self.environment_probability);
        }
        let count = self.cumulative.len();
        if count == 0 {
            return None;
        }
        let mut index = self.guide[((select * count as f32) as usize).min(count - 1)] as usize;
        while index + 1 < count && self.cumulative[index + 1] <= select {
            index += 1;
        }
        if index >= self.patches.strips() {
            if !ANY || !has::<C>(Feature::PunctualLights) {
                return None;
            }
            return self.punctual[index - self.patches.strips()].sample(p);
        }
        let place = self.patches.sample(index, select, v);
        let light = &self.triangles[place.triangle as usize];
        light.sample(p, place.weights, light.pdf_area)
    }

    #[inline(always)]
    fn sample_environment<P: Probe, C: Class, const ANY: bool>(
        &self,
        frame: &Frame,
        u: Vec2,
        probe: &mut P,
    ) -> Option<LightSample> {
        match &self.environment {
            Surroundings::Nothing => None,
            Surroundings::Constant(radiance) => {
                // The radiance is the same from everywhere, so the receiver's cosine is all that is worth following.
                let local = square_to_cosine_hemisphere(u);
                let pdf = self.constant_pdf(local.z);
                let target = LightTarget::Environment(*radiance);
                (pdf > 0.0).then(|| LightSample { wi: frame.to_world(local), pdf, target })
            }
            Surroundings::Map(_) if !ANY || !has::<C>(Feature::EnvironmentMaps) => None,
            Surroundings::Map(map) => {
                // A quotient below 1 may round to 1.
                let (wi, look) = map.sample(u.min(Vec2::splat(1.0 - f32::EPSILON)))?;
                probe.texture(1, EnvironmentSampler::LOOKUP_BYTES);
                let pdf = self.environment_probability * look.pdf;
                Some(LightSample { wi, pdf, target: LightTarget::Environment(look.radiance) })
            }
        }
    }
}

/// Radius of a sphere around the box.
pub(crate) fn bounding_radius(min: [f32; 3], max: [f32; 3]) -> f64 {
    let d2: f64 = (0..3).map(|i| (f64::from(max[i]) - f64::from(min[i])).powi(2)).sum();
    let radius = 0.5 * d2.sqrt();
    if radius.is_finite() { radius } else { 1.0 }
}
