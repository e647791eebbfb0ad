//! Eight paths at once through scenes of few matte triangles.
//!
//! In a scene of some dozens of triangles a ray is cheap, and what is not tracing (sampler, light, BSDF, the ray's set-up) is more than half
//! of a path. So there the samples that are not counted are traced eight at a time, one in each lane of a vector: rays try all triangles
//! ([`hotspot_bvh::few`]), and paths wait in a pool that new samples fill up ([`path`]). Each formula is that of the single path
//! ([`crate::path`]), in the same order of operations, so pictures are the same bit for bit.
//!
//! Counted samples go one by one: what is counted are visits of the tree.

pub(crate) mod math;
mod path;
mod sampler;
#[cfg(test)]
mod tests;

use crate::camera::FilmCamera;
use crate::class::SceneClass;
use crate::geometry::{SurfacePoint, SurfaceTriangle};
use crate::light::LightLanes;
use crate::scene::RenderScene;
use glam::Vec3;
use hotspot_bvh::few::FewTriangles;
use hotspot_bvh::simd::{Doubles, F8, Floats, Simd, Vectors};
use hotspot_scene::Bsdf;
pub(crate) use path::{SampleList, View, trace_samples};
pub(crate) use sampler::points_table;

/// A scene whose paths can go eight at a time.
#[derive(Clone, Debug)]
pub(crate) struct SmallScene {
    few: FewTriangles,
    lights: LightLanes,
    // Of each triangle, by its number:
    /// [`SurfaceTriangle::error`].
    errors: Vec<f32>,
    least_height: Vec<f32>,
    reflectance: Vec<f32>,
    emission: Vec<f32>,
    light_pdf_area: Vec<f32>,
    /// 1 where both sides emit.
    two_sided: Vec<u32>,
    /// Corner by corner; empty where no surface has normals of its own.
    normals: Vec<f32>,
    /// 1 where the surface has normals of its own.
    smooth: Vec<u32>,
    /// Whether no triangle has corners with different normals.
    flat: bool,
}

impl SmallScene {
    /// `None` unless the scene has at most [`FewTriangles::MOST`] triangles, of regular shape and matte without textures, lit by a few
    /// of them alone. Nor for parallel cameras that look along a triangle: all of their rays would be doubtful.
    pub(crate) fn new(scene: &RenderScene, camera: &FilmCamera) -> Option<Self> {
        let geometry = &scene.geometry;
        if scene.class() != SceneClass::Matte || geometry.triangles.len() > FewTriangles::MOST {
            return None;
        }
        let lights = LightLanes::new(&scene.lights, geometry, &scene.materials)?;
        let few = FewTriangles::new(&geometry.triangles, camera.reach())?;
        if camera.parallel_direction().is_some_and(|direction| few.has_along(direction)) {
            return None;
        }
        let all = 0..geometry.triangles.len() as u32;
        let material = |t: u32| &scene.materials[geometry.part(t).material as usize];
        let reflectance = |t: u32| match &material(t).bsdf {
            Bsdf::Matte { reflectance } => reflectance.factor,
            _ => [0.0; 3],
        };
        let normals: Vec<Option<[Vec3; 3]>> = all.clone().map(|t| geometry.corner_normals(t)).collect();
        let smooth = normals.iter().any(Option::is_some);
        Some(Self {
            few,
            lights,
            errors: geometry.triangles.iter().flat_map(|t| SurfaceTriangle::new(t).error).collect(),
            least_height: geometry.least_heights().to_vec(),
            reflectance: all.clone().flat_map(reflectance).collect(),
            emission: all.clone().flat_map(|t| material(t).emission.factor).collect(),
            light_pdf_area: all.clone().map(|t| geometry.part(t).light_pdf_area).collect(),
            two_sided: all.map(|t| u32::from(material(t).double_sided)).collect(),
            flat: normals.iter().flatten().all(|corners| {
                // By bits: the sign of a zero turns the shading frame.
                let [a, b, c] = corners.map(|n| n.to_array().map(f32::to_bits));
                a == b && a == c
            }),
            smooth: normals.iter().map(|n| u32::from(n.is_some())).collect(),
            normals: if smooth {
                normals.iter().flat_map(|n| n.unwrap_or([Vec3::ZERO; 3])).flat_map(|n| n.to_array()).collect()
            } else {
                Vec::new()
            },
        })
    }
}

/// [`SurfacePoint`]s in lanes.
#[derive(Clone, Copy)]
pub(crate) struct PointLanes<S: Simd> {
    pub(crate) p: Vectors<S>,
    pub(crate) error: Vectors<S>,
}

#[inline(always)]
fn interpolated<S: Simd>([a, b, c]: [Floats<S>; 3], u: Doubles<S>, v: Doubles<S>) -> Floats<S> {
    let a = a.widen();
    (a + (b.widen() - a) * u + (c.widen() - a) * v).narrow()
}

impl<S: Simd> PointLanes<S> {
    /// [`SurfaceTriangle::point`]; `errors`: the triangles' share.
    #[inline(always)]
    pub(crate) fn new(
        s: S,
        [a, b, c]: [Vectors<S>; 3],
        errors: Vectors<S>,
        u: Floats<S>,
        v: Floats<S>,
    ) -> Self {
        let (u, v) = (u.widen(), v.widen());
        let x = interpolated([a.x, b.x, c.x], u, v);
        let y = interpolated([a.y, b.y, c.y], u, v);
        let z = interpolated([a.z, b.z, c.z], u, v);
        let p = Vectors::new(x, y, z);
        let error = p.abs().scaled(Floats::splat(s, 3.0 * (0.5 * f32::EPSILON))) + errors;
        Self { p, error }
    }

    /// With lanes `bits` replaced one by one.
    #[inline(always)]
    pub(crate) fn replaced(self, s: S, mut bits: u32, mut by: impl FnMut(usize) -> SurfacePoint) -> Self {
        let (mut p, mut error) = (self.p.store(), self.error.store());
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize & 7;
            bits &= bits - 1;
            let point = by(lane);
            set(&mut p, lane, point.p.to_array());
            set(&mut error, lane, point.error.to_array());
        }
        Self { p: Vectors::load(s, &p), error: Vectors::load(s, &error) }
    }

    /// [`SurfacePoint::leave`].
    #[inline(always)]
    fn leave(&self, normal: Vectors<S>) -> Vectors<S> {
        self.p + normal.scaled(normal.abs().dot(self.error))
    }

    /// [`SurfacePoint::meet`].
    #[inline(always)]
    fn meet(&self, s: S, normal: Vectors<S>, origin: Vectors<S>) -> Vectors<S> {
        let reach = (self.p - origin).abs().scaled(Floats::splat(s, 5.0 * 0.5 * f32::EPSILON));
        self.p + normal.scaled(normal.abs().dot(self.error + reach))
    }

    /// [`SurfacePoint::margin`].
    #[inline(always)]
    fn margin(&self, s: S) -> Floats<S> {
        Floats::splat(s, 2.0) * self.error.dot(self.error).sqrt()
    }
}

/// Sets a lane.
#[inline(always)]
fn set(vectors: &mut [F8; 3], lane: usize, [x, y, z]: [f32; 3]) {
    vectors[0].0[lane] = x;
    vectors[1].0[lane] = y;
    vectors[2].0[lane] = z;
}
