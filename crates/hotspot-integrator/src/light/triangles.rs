//! Emissive triangles: their power, and points on them.

use super::{LightSample, LightTarget};
use crate::geometry::SurfaceTriangle;
use crate::texture::Texture;
use glam::{Vec2, Vec3};
use hotspot_scene::Material;

/// An emissive triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightTriangle {
    pub(super) primitive: u32,
    /// Probability of taking it, given that no environment is chosen.
    pub(super) probability: f64,
    /// Density per area, all choices included.
    pub(super) pdf_area: f32,
    pub(super) triangle: SurfaceTriangle,
    pub(super) normal: Vec3,
    /// 1 / area.
    pub(super) inverse_area: f32,
    /// Emits from both sides.
    pub(super) two_sided: bool,
    /// A barycentric weight below this may be too close to an edge: the point is then moved off it, since it may round to the
    /// far side of the face beyond, which would stop the shadow ray.
    pub(super) edge: f32,
}

impl LightTriangle {
    /// A point of the triangle, by the barycentric weights of its second and third corner; `pdf_area`: density per area,
    /// choice included. `None` where the triangle shows `p` a side that does not emit, its edge, or the point is `p`.
    #[inline(always)]
    pub(super) fn sample(&self, p: Vec3, (b, c): (f32, f32), pdf_area: f32) -> Option<LightSample> {
        let [x, y, z] = self.triangle.corner();
        if !self.two_sided && self.normal.dot(p - Vec3::new(x, y, z)) <= 0.0 {
            return None;
        }
        let near_edge = b.min(c).min(1.0 - b - c) < self.edge;
        let point = if near_edge { self.triangle.point_off_edges(b, c) } else { self.triangle.point(b, c) };
        let normal = self.normal;
        let d = point.p - p;
        let distance2 = d.length_squared();
        if distance2 == 0.0 {
            return None;
        }
        let wi = d / distance2.sqrt();
        let cos = -wi.dot(normal);
        let pdf = pdf_area * distance2 / cos.abs();
        if !(pdf > 0.0 && pdf.is_finite()) {
            return None;
        }
        let target =
            LightTarget::Surface { primitive: self.primitive, point, uv: Vec2::new(b, c), cos, normal };
        Some(LightSample { wi, pdf, target })
    }
}

/// Power that a material emits per area, summed over channels: π · radiance for each side of a Lambertian emitter.
pub(super) fn power_per_area(material: &Material, textures: &[Texture], means: &mut [Option<Vec3>]) -> f64 {
    if !material.is_emissive() {
        return 0.0;
    }
    let sides = if material.double_sided { 2.0 } else { 1.0 };
    sides * core::f64::consts::PI * mean_emission(material, textures, means)
}

/// Mean emitted radiance of a material, summed over channels: what the choice of lights goes by. `means` keeps the mean of
/// each texture, which many materials may share.
fn mean_emission(material: &Material, textures: &[Texture], means: &mut [Option<Vec3>]) -> f64 {
    let mut emission = Vec3::from_array(material.emission.factor);
    if let Some(at) = &material.emission.texture {
        let index = at.texture as usize;
        emission *= *means[index].get_or_insert_with(|| textures[index].mean_color());
    }
    emission.to_array().iter().map(|c| f64::from(*c)).sum()
}

pub(super) fn area(triangle: &[[f32; 3]; 3]) -> f64 {
    let [a, b, c] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    0.5 * (b - a).cross(c - a).length()
}

/// Density per solid angle of taking a point of an emissive part by light sampling.
#[inline(always)]
pub(crate) fn area_to_solid_angle(pdf_area: f32, distance2: f32, cos: f32) -> f32 {
    if cos == 0.0 { 0.0 } else { pdf_area * distance2 / cos.abs() }
}
