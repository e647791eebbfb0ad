//! Choosing a light and a point on it, in proportion to power.

use crate::geometry::{Geometry, SurfacePoint, SurfaceTriangle};
use crate::math::{FRAC_1_PI, Frame, square_to_cosine_hemisphere, square_to_triangle};
use crate::texture::Texture;
use glam::{Vec2, Vec3};
use hotspot_scene::{Environment, Material};

/// An emissive triangle.
#[derive(Clone, Copy, Debug)]
struct LightTriangle {
    primitive: u32,
    /// Probability of all lights before it.
    cumulative: f32,
    /// Its own probability.
    probability: f32,
    /// Density per area.
    pdf_area: f32,
    triangle: SurfaceTriangle,
    normal: Vec3,
}

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    triangles: Vec<LightTriangle>,
    /// For each of as many equal intervals of [0, 1) as there are triangles: the first triangle that reaches into it.
    guide: Vec<u32>,
    /// Constant environment radiance.
    pub(crate) environment: Option<Vec3>,
    /// Probability of choosing the environment.
    environment_probability: f32,
}

/// A sampled direction towards a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Unit direction from the shading point.
    pub(crate) wi: Vec3,
    /// Density per solid angle, choice of the light included.
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
    /// Infinitely far away.
    Environment(Vec3),
}

/// Mean emitted radiance of a material, summed over channels: what the choice of lights goes by.
fn mean_emission(material: &Material, textures: &[Texture]) -> f64 {
    let mut emission = Vec3::from_array(material.emission.factor);
    if let Some(at) = &material.emission.texture {
        emission *= textures[at.texture as usize].mean_color();
    }
    emission.to_array().iter().map(|c| f64::from(*c)).sum()
}

fn area(triangle: &[[f32; 3]; 3]) -> f64 {
    let [a, b, c] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    0.5 * (b - a).cross(c - a).length()
}

impl Lights {
    /// Collects the lights of a scene and writes each emissive part's `light_pdf_area` into `geometry`.
    /// `radius`: of a sphere around the scene; the environment's power is that which enters it.
    pub(crate) fn new(
        materials: &[Material],
        environment: Option<&Environment>,
        geometry: &mut Geometry,
        textures: &[Texture],
        radius: f64,
    ) -> Self {
        let environment = match environment {
            Some(Environment::Constant(radiance)) if radiance.iter().any(|c| *c > 0.0) => {
                Some(Vec3::from_array(*radiance))
            }
            _ => None,
        };
        // Power of a one-sided Lambertian emitter: π · area · radiance; of a constant environment: 4π · πR² · radiance.
        let per_area: Vec<f64> = materials
            .iter()
            .map(|m| {
                let sides = if m.double_sided { 2.0 } else { 1.0 };
                if m.is_emissive() { sides * core::f64::consts::PI * mean_emission(m, textures) } else { 0.0 }
            })
            .collect();
        let environment_power = environment.map_or(0.0, |e| {
            let sum: f64 = e.to_array().iter().map(|c| f64::from(*c)).sum();
            4.0 * core::f64::consts::PI.powi(2) * radius * radius * sum
        });
        let powers: Vec<(u32, f64)> = (0..geometry.triangles.len() as u32)
            .filter_map(|primitive| {
                let weight = per_area[geometry.part(primitive).material as usize];
                (weight > 0.0).then(|| (primitive, weight * area(&geometry.triangles[primitive as usize])))
            })
            .collect();
        let surface_power: f64 = powers.iter().map(|p| p.1).sum();
        let total = surface_power + environment_power;
        if total <= 0.0 || !total.is_finite() {
            return Self { environment, environment_probability: 1.0, ..Self::default() };
        }
        for part in &mut geometry.parts {
            part.light_pdf_area = (per_area[part.material as usize] / total) as f32;
        }
        let mut cumulative = 0.0;
        let triangles: Vec<LightTriangle> = powers
            .iter()
            .map(|&(primitive, power)| {
                let probability = power / surface_power;
                let corners = &geometry.triangles[primitive as usize];
                let [v0, v1, v2] = corners.map(Vec3::from_array);
                let light = LightTriangle {
                    primitive,
                    cumulative: cumulative as f32,
                    probability: probability as f32,
                    pdf_area: geometry.part(primitive).light_pdf_area,
                    triangle: SurfaceTriangle::new(corners),
                    normal: (v1 - v0).cross(v2 - v0).normalize_or_zero(),
                };
                cumulative += probability;
                light
            })
            .collect();
        let mut guide = Vec::with_capacity(triangles.len());
        let mut index = 0;
        for interval in 0..triangles.len() {
            let start = interval as f32 / triangles.len() as f32;
            while index + 1 < triangles.len() && triangles[index + 1].cumulative <= start {
                index += 1;
            }
            guide.push(index as u32);
        }
        // Never rounds to 1 where there are surfaces: they would be weighted but not sampled.
        let most = if triangles.is_empty() { 1.0 } else { 1.0 - f32::EPSILON };
        let environment_probability = ((environment_power / total) as f32).min(most);
        Self { triangles, guide, environment, environment_probability }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.environment.is_none()
    }

    /// Number of emissive triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    pub(crate) fn memory(&self) -> u64 {
        (size_of_val(&self.triangles[..]) + size_of_val(&self.guide[..])) as u64
    }

    /// Density per solid angle with which [`Lights::sample`] takes a direction that leaves the scene, at a surface whose
    /// shading normal makes cosine `cos` with it.
    #[inline(always)]
    pub(crate) fn environment_pdf(&self, cos: f32) -> f32 {
        self.environment_probability * FRAC_1_PI * cos.max(0.0)
    }

    /// A direction towards a light, seen from `p`; `frame` is the shading frame on the side of the path. `None` where
    /// the sample cannot bring light: no lights, seen edge-on, or a point of the light itself.
    #[inline(always)]
    pub(crate) fn sample(&self, p: Vec3, frame: &Frame, u: [f32; 2]) -> Option<LightSample> {
        let [mut select, v] = u;
        if let Some(radiance) = self.environment {
            if select < self.environment_probability {
                // The radiance is the same from everywhere, so the receiver's cosine is all that is worth following.
                let local = square_to_cosine_hemisphere(Vec2::new(select / self.environment_probability, v));
                let pdf = self.environment_pdf(local.z);
                return (pdf > 0.0).then(|| LightSample {
                    wi: frame.to_world(local),
                    pdf,
                    target: LightTarget::Environment(radiance),
                });
            }
            select = (select - self.environment_probability) / (1.0 - self.environment_probability);
        }
        if self.triangles.is_empty() {
            return None;
        }
        let count = self.triangles.len();
        let mut index = self.guide[((select * count as f32) as usize).min(count - 1)] as usize;
        while index + 1 < count && self.triangles[index + 1].cumulative <= select {
            index += 1;
        }
        let light = &self.triangles[index];
        let rest = ((select - light.cumulative) / light.probability).clamp(0.0, 1.0 - f32::EPSILON);
        let (b, c) = square_to_triangle(Vec2::new(rest, v));
        let point = light.triangle.point(b, c);
        let normal = light.normal;
        let d = point.p - p;
        let distance2 = d.length_squared();
        if distance2 == 0.0 {
            return None;
        }
        let wi = d / distance2.sqrt();
        let cos = -wi.dot(normal);
        let pdf = light.pdf_area * distance2 / cos.abs();
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let target =
            LightTarget::Surface { primitive: light.primitive, point, uv: Vec2::new(b, c), cos, normal };
        Some(LightSample { wi, pdf, target })
    }
}

/// Density per solid angle of taking a point of an emissive part by light sampling.
#[inline(always)]
pub(crate) fn area_to_solid_angle(pdf_area: f32, distance2: f32, cos: f32) -> f32 {
    if cos == 0.0 { 0.0 } else { pdf_area * distance2 / cos.abs() }
}

/// Radius of a sphere around the box.
pub(crate) fn bounding_radius(min: [f32; 3], max: [f32; 3]) -> f64 {
    let d2: f64 = (0..3).map(|i| (f64::from(max[i]) - f64::from(min[i])).powi(2)).sum();
    let radius = 0.5 * d2.sqrt();
    if radius.is_finite() { radius } else { 1.0 }
}
