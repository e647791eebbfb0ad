//! Surfaces that are not there everywhere: alpha masks and alpha blending, resolved during traversal.

use crate::class::FullClass;
use crate::geometry::{Attributes, Surface};
use crate::sampler::hash;
use crate::scene::RenderScene;
use crate::texture::scalar_counted;
use hotspot_bvh::{Candidate, Filter};
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

/// Lets a ray pass where surfaces are not there. Where a surface blends, each ray meets it with probability alpha: decided
/// by a hash of the ray and the triangle, so that the answer does not depend on the order of visits.
#[derive(Clone, Copy)]
pub(crate) struct Cutouts<'a> {
    pub(crate) scene: &'a RenderScene,
    /// Of pixel, sample and ray.
    pub(crate) ray_key: u32,
}

impl Filter for Cutouts<'_> {
    const ON: bool = true;

    #[inline(always)]
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool {
        let scene = self.scene;
        let surface: Surface<'_> = scene.geometry.surface(candidate.instance(), candidate.primitive());
        if !surface.part.cutout {
            return true;
        }
        let (u, v) = candidate.barycentric();
        let point = scene.geometry.attributes::<FullClass>(surface, u, v);
        let material = &scene.materials[surface.part.material as usize];
        let (share, lookups, bytes) = presence(scene, material, &point);
        probe.alpha(lookups, bytes);
        if share >= 1.0 || share <= 0.0 {
            return share >= 1.0;
        }
        let instance = candidate.instance().wrapping_sub(NONE);
        let number = hash(candidate.primitive(), hash(instance, self.ray_key));
        ((number >> 8) as f32) * (1.0 / 16_777_216.0) < share
    }
}
