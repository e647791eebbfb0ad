//! Eight paths at once, a lane each.
//!
//! What is not tracing (sampler, light, BSDF, normals, points) is more than half of a path, and most of it is the same for every path: so
//! paths go eight at a time, in the lanes of vectors ([`path`]). In scenes of some dozens of triangles their rays try
//! all triangles at once ([`few`]); in others each searches the tree by itself ([`tree`]). Each formula is that of the single
//! path ([`crate::path`]), in the same order of operations, so pictures are the same bit for bit.
//!
//! Paths that are counted ([`counts`]) go eight at a time as well: each of their rays tells what it visits, and time is shared out among their
//! pixels ([`clock`]).

mod bsdf;
mod clock;
mod counts;
mod few;
pub(crate) mod math;
mod path;
mod sampler;
mod surface;
#[cfg(test)]
mod tests;
mod tree;

use crate::camera::FilmCamera;
use crate::check::visit_shaded_textures;
use crate::geometry::{Part, SurfacePoint};
use crate::light::LightLanes;
use crate::scene::RenderScene;
use bsdf::{BUMPY, GLOWS, Kind, VARIES};
pub(crate) use clock::{INTERRUPTION, SharedClock, passed};
pub(crate) use counts::{Counted, End, Listener};
use few::Few;
use glam::Vec3;
use hotspot_bvh::simd::{Doubles, Floats, Integers, Lanes, Mask, Simd, Vectors, set_vector};
use hotspot_probe::NONE;
use hotspot_scene::{Alpha, Bsdf, Material};
pub(crate) use path::{SampleList, View, trace_samples};
pub(crate) use sampler::points_table;

/// What paths in lanes read of a scene, beside its geometry.
#[derive(Clone, Debug)]
pub(crate) struct LaneScene {
    /// Where all triangles are tried instead of searched; by paths that are counted only if it counts ([`Few::counts`]).
    pub(crate) few: Option<Few>,
    lights: LightLanes,
    /// Of each part ([`PartLanes`]).
    rows: Vec<[f32; ROW]>,
    /// Whether any surface has normals of its own.
    smooth: bool,
    /// Whether what any emits varies over it.
    glows: bool,
    /// Of few triangles whose corners have the same normal each: those; of triangles without any, zeros. Three numbers more at the end.
    flat_normals: Option<Vec<f32>>,
}

/// Numbers of a part's row: a cache line.
const ROW: usize = 16;

/// What a part's row says, whole numbers by their bits: in [`PartLanes`] the first eight numbers, in [`BsdfLanes`](bsdf::BsdfLanes) the others.
#[derive(Clone, Copy)]
struct PartLanes<S: Simd> {
    light_pdf_area: Floats<S>,
    emission: Vectors<S>,
    /// Whether both sides emit.
    two_sided: Mask<S>,
    /// [`Part::smooth`]; normals are at [`NONE`] where there are none.
    corners_at: Integers<S>,
    normals_at: Integers<S>,
    /// [`Kind`], and what is added to it.
    kind: Integers<S>,
}

impl LaneScene {
    /// `None` for scenes without triangles, and of so many that lanes could not read their tables. All of them are tried where there are at most [`FewTriangles::MOST`](hotspot_bvh::few::FewTriangles::MOST), of regular shape and opaque, none in
    /// instances, and neither an environment nor a light without area; unless a parallel camera looks along one: all of its rays would be doubtful.
    pub(crate) fn new(scene: &RenderScene, camera: &FilmCamera) -> Option<Self> {
        let geometry = &scene.geometry;
        let (corners, normals) = geometry.corners_and_normals();
        // Lanes gather by numbers below 2^31.
        let too_many = corners.len().max(normals.len()).max(ROW * geometry.part_count()) > i32::MAX as usize;
        if geometry.triangles.is_empty() || too_many {
            return None;
        }
        #[cfg(hotspot_ablation)]
        if scene.without.is_some() {
            return None;
        }
        let lights = LightLanes::new(&scene.lights, geometry, &scene.materials);
        let instanced = scene.bvh.instance_count() > 0;
        let few = if !lights.are_surfaces() || scene.cutouts.any() || instanced {
            None
        } else {
            Few::new(scene, camera.reach())
        };
        let few =
            few.filter(|few| !camera.parallel_direction().is_some_and(|direction| few.has_along(direction)));
        let parts = (0..geometry.part_count() as u32).map(|number| geometry.part_of_number(number));
        let material = |part: &Part| &scene.materials[part.material as usize];
        let flat_normals = few.as_ref().and_then(|_| {
            let all = (0..geometry.triangles.len() as u32).map(|t| match geometry.corner_normals(t) {
                None => Some([0.0; 3]),
                Some(corners) => {
                    // By bits: the sign of a zero turns the shading frame.
                    let [a, b, c] = corners.map(|n| n.to_array().map(f32::to_bits));
                    (a == b && a == c).then_some(corners[0].to_array())
                }
            });
            all.chain([Some([0.0; 3])]).collect::<Option<Vec<_>>>().map(|all| all.concat())
        });
        Some(Self {
            few,
            lights,
            rows: parts.clone().map(|part| row(part, material(part))).collect(),
            glows: parts.clone().any(|part| glows(material(part))),
            smooth: parts.clone().any(|part| part.smooth().is_some()),
            flat_normals,
        })
    }

    /// The parts of these numbers.
    #[inline(always)]
    fn parts<S: Simd>(&self, part: Integers<S>) -> PartLanes<S> {
        let [light_pdf_area, r, g, b, two_sided, corners_at, normals_at, kind] =
            Floats::gather_eights(self.rows.as_flattened(), part.shift_left::<4>());
        PartLanes {
            light_pdf_area,
            emission: Vectors::new(r, g, b),
            two_sided: two_sided.bits().is(1),
            corners_at: corners_at.bits(),
            normals_at: normals_at.bits(),
            kind: kind.bits(),
        }
    }
}

/// Whether what a surface emits varies over it.
fn glows(material: &Material) -> bool {
    material.is_emissive() && (material.emission.texture.is_some() || material.alpha != Alpha::Opaque)
}

/// A part's row.
fn row(part: &Part, material: &Material) -> [f32; ROW] {
    let [corners, normals] = part.smooth().unwrap_or([0, NONE]).map(f32::from_bits);
    let two_sided = f32::from_bits(material.double_sided.into());
    let [r, g, b] = material.emission.factor;
    let scatters = Kind::of(&material.bsdf);
    let mut kind = scatters as u32;
    let mut textured = part.has_colors() || scatters == Kind::Mixed;
    visit_shaded_textures(material, &mut |_| textured = true);
    if textured {
        kind |= VARIES;
    }
    if glows(material) {
        kind |= GLOWS;
    }
    if part.has_tangents() && material.normal_map.is_some() {
        kind |= BUMPY;
    }
    let kind = f32::from_bits(kind);
    let mut row = [0.0; ROW];
    row[..8].copy_from_slice(&[part.light_pdf_area, r, g, b, two_sided, corners, normals, kind]);
    // As `resolve` has it without textures.
    match &material.bsdf {
        Bsdf::Matte { reflectance } => row[8..11].copy_from_slice(&reflectance.factor),
        Bsdf::Substrate { diffuse, specular, specular_weight, roughness } => {
            let specular = Vec3::from_array(specular.factor) * specular_weight.factor;
            row[8..11].copy_from_slice(&diffuse.factor);
            row[11..14].copy_from_slice(&specular.to_array());
            row[14] = (roughness.factor * roughness.factor).max(1e-3);
        }
        Bsdf::Mirror { reflectance } => row[8..11].copy_from_slice(&reflectance.factor),
        Bsdf::RoughMetal { f0, roughness } => {
            row[8..11].copy_from_slice(&f0.factor);
            row[14] = (roughness.factor * roughness.factor).max(1e-3);
        }
        Bsdf::Glass { ior, transmittance, absorption, .. } => {
            row[8..11].copy_from_slice(&transmittance.factor);
            row[11..14].copy_from_slice(absorption);
            row[14] = *ior;
        }
        Bsdf::Unlit { .. } | Bsdf::Mix { .. } => {}
    }
    row
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

/// The triangles' share of errors: [`SurfaceTriangle::error`](crate::geometry::SurfaceTriangle).
#[inline(always)]
fn triangle_error<S: Simd>(s: S, [a, b, c]: [Vectors<S>; 3]) -> Vectors<S> {
    let (a, b, c) = (a.abs(), b.abs(), c.abs());
    let most = Vectors::new(a.x.max(b.x).max(c.x), a.y.max(b.y).max(c.y), a.z.max(b.z).max(c.z));
    most.scaled(Floats::splat(s, 2.273_737e-13))
}

impl<S: Simd> PointLanes<S> {
    /// [`SurfaceTriangle::point`](crate::geometry::SurfaceTriangle::point); `errors`: the triangles' share.
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
    pub(crate) fn replaced(self, s: S, bits: u32, mut by: impl FnMut(usize) -> SurfacePoint) -> Self {
        let (mut p, mut error) = (self.p.store(), self.error.store());
        for lane in Lanes(bits) {
            let point = by(lane);
            set_vector(&mut p, lane, point.p.to_array());
            set_vector(&mut error, lane, point.error.to_array());
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
