//! Surfaces that are not there everywhere: alpha masks and alpha blending, resolved during traversal.

use crate::class::FullClass;
use crate::geometry::{Attributes, Geometry, Surface};
use crate::sampler::hash;
use crate::scene::RenderScene;
use crate::texture::scalar_counted;
use hotspot_bvh::simd::Simd;
use hotspot_bvh::{Candidate, Filter, NO_INSTANCE};
use hotspot_probe::{NONE, RayProbe};
use hotspot_scene::{Alpha, Material};

/// The share of a surface that is there at a point: 0 or 1 under a mask, in between where it blends; and the look-ups and
/// bytes of texels that finding out took.
#[inline(always)]
pub(crate) fn presence(scene: &RenderScene, material: &Material, point: &Attributes) -> (f32, u32, u32) {
    match &material.alpha {
        Alpha::Opaque => (1.0, 0, 0),
        Alpha::Mask { cutoff, alpha } => {
            let (alpha, lookups, bytes) = scalar_counted(&scene.textures, alpha, point);
            let there = alpha * point.tint_alpha >= *cutoff;
            (f32::from(u8::from(there)), lookups, bytes)
        }
        Alpha::Blend { alpha } => {
            let (alpha, lookups, bytes) = scalar_counted(&scene.textures, alpha, point);
            ((alpha * point.tint_alpha).clamp(0.0, 1.0), lookups, bytes)
        }
    }
}

/// Which triangles are not there everywhere: one bit for each triangle of the world, so that a traversal finds out without
/// looking into the geometry. Empty where there is no such triangle, neither in the world nor in instances.
#[derive(Clone, Debug, Default)]
pub(crate) struct CutoutTriangles {
    bits: Vec<u64>,
    any: bool,
}

impl CutoutTriangles {
    pub(crate) fn of(geometry: &Geometry) -> Self {
        if !geometry.has_cutouts() {
            return Self::default();
        }
        let mut bits = vec![0u64; geometry.world_triangles().div_ceil(64)];
        for triangle in 0..geometry.world_triangles() {
            bits[triangle / 64] |= u64::from(geometry.part(triangle as u32).cutout) << (triangle % 64);
        }
        Self { bits, any: true }
    }

    /// Whether some surface is not there everywhere.
    #[inline(always)]
    pub(crate) fn any(&self) -> bool {
        self.any
    }

    /// Bytes held.
    pub(crate) fn memory(&self) -> u64 {
        size_of_val(&self.bits[..]) as u64
    }

    #[inline(always)]
    fn contains(&self, triangle: u32) -> bool {
        self.bits.get(triangle as usize / 64).is_some_and(|bits| bits >> (triangle % 64) & 1 != 0)
    }
}

/// Lets a ray pass where surfaces are not there. Where a surface blends, each ray meets it with probability alpha: decided
/// by a hash of the ray and the triangle, so that the answer does not depend on the order of visits.
#[derive(Clone, Copy)]
pub(crate) struct Cutouts<'a, S> {
    pub(crate) simd: S,
    pub(crate) scene: &'a RenderScene,
    /// Of pixel, sample and ray.
    pub(crate) ray_key: u32,
}

impl<S: Simd> Filter for Cutouts<'_, S> {
    const ON: bool = true;

    #[inline(always)]
    fn concerns(&self, instance: u32, primitive: u32) -> bool {
        if instance == NO_INSTANCE {
            self.scene.cutouts.contains(primitive)
        } else {
            self.scene.geometry.surface(instance, primitive).part.cutout
        }
    }

    /// Not inlined: few hits are on such triangles, and the traversal needs its registers.
    #[inline(never)]
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool {
        let Self { simd, scene, ray_key } = *self;
        simd.vectorize(
            #[inline(always)]
            || is_there(scene, ray_key, candidate, probe),
        )
    }
}

#[inline(always)]
fn is_there<P: RayProbe>(
    scene: &RenderScene,
    ray_key: u32,
    candidate: &Candidate<'_>,
    probe: &mut P,
) -> bool {
    let surface: Surface<'_> = scene.geometry.surface(candidate.instance(), candidate.primitive());
    let (u, v) = candidate.barycentric();
    let point = scene.geometry.attributes::<FullClass>(surface, u, v);
    let material = &scene.materials[surface.part.material as usize];
    let (share, lookups, bytes) = presence(scene, material, &point);
    probe.alpha(lookups, bytes);
    if share >= 1.0 || share <= 0.0 {
        return share >= 1.0;
    }
    let instance = candidate.instance().wrapping_sub(NONE);
    let number = hash(candidate.primitive(), hash(instance, ray_key));
    ((number >> 8) as f32) * (1.0 / 16_777_216.0) < share
}
