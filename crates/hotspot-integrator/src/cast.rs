//! Casting rays: which traversal a scene needs.
//!
//! Cutouts and instances have a traversal of their own, chosen by a branch that always goes the same way, so that a scene
//! without them does not pay for them. The traversal without either is part of the loop: as a call it takes 35 instructions a
//! ray more.

use crate::class::{Class, Feature, has};
use crate::cutout::Cutouts;
use crate::kernel::Kernel;
use crate::sampler::Sampler;
use crate::scene::RenderScene;
use hotspot_bvh::simd::Simd;
use hotspot_bvh::{Hit, NoFilter, NoProbe, Ray, RayProbe};
use hotspot_probe::NONE;

/// The nearest hit. `bounce`: scattering events before the ray; `from`: the triangle of the world that it leaves,
/// `NONE` for none.
#[inline(always)]
pub(crate) fn closest_hit<S: Simd, R: RayProbe, C: Class>(
    simd: S,
    scene: &RenderScene,
    ray: &Ray,
    from: u32,
    sampler: &Sampler<'_>,
    bounce: u32,
    probe: R,
) -> Option<Hit> {
    #[cfg(test)]
    crate::kernel::ray_counts::record(ray, sampler.ray_key(2 * bounce), false);
    if has::<C>(Feature::Cutouts) && scene.cutouts.any() {
        let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce) };
        scene.bvh.closest_hit_filtered(simd, ray, [from], filter, probe)
    } else if has::<C>(Feature::Instances) && scene.bvh.instance_count() > 0 {
        scene.bvh.closest_hit_filtered(simd, ray, [from], NoFilter, probe)
    } else {
        scene.bvh.closest_hit_here(simd, ray, [from], probe)
    }
}

/// The nearest hits of camera rays of a pixel, at most [`PACKET`](hotspot_bvh::PACKET): as a packet, unless cutouts must be asked
/// ray by ray or instances want their own traversal. `sampler`: that of each ray.
#[inline(always)]
pub(crate) fn closest_hits<'a, S: Simd, C: Class>(
    simd: S,
    kernel: &Kernel<'_>,
    rays: &[Ray],
    sampler: impl Fn(usize) -> Sampler<'a>,
    hits: &mut [Option<Hit>],
) {
    let scene = kernel.scene;
    let cutouts = has::<C>(Feature::Cutouts) && scene.cutouts.any();
    let instances = has::<C>(Feature::Instances) && scene.bvh.instance_count() > 0;
    if cutouts || instances || !kernel.packets {
        for (place, (ray, hit)) in rays.iter().zip(hits).enumerate() {
            *hit = closest_hit::<S, _, C>(simd, scene, ray, NONE, &sampler(place), 0, NoProbe);
        }
        return;
    }
    #[cfg(test)]
    for (place, ray) in rays.iter().enumerate() {
        crate::kernel::ray_counts::record(ray, sampler(place).ray_key(0), false);
    }
    scene.bvh.closest_hits_flat(simd, rays, hits);
}

/// Whether a shadow ray is blocked. `ends`: the triangles of the world that it leaves and that it is aimed at, `NONE` for none;
/// it is kept off their planes.
#[inline(always)]
pub(crate) fn occluded<S: Simd, R: RayProbe, C: Class>(
    simd: S,
    scene: &RenderScene,
    ray: &Ray,
    ends: [u32; 2],
    sampler: &Sampler<'_>,
    bounce: u32,
    probe: R,
) -> bool {
    #[cfg(test)]
    crate::kernel::ray_counts::record(ray, sampler.ray_key(2 * bounce + 1), true);
    if has::<C>(Feature::Cutouts) && scene.cutouts.any() {
        let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce + 1) };
        scene.bvh.occluded_filtered(simd, ray, ends, filter, probe)
    } else if has::<C>(Feature::Instances) && scene.bvh.instance_count() > 0 {
        scene.bvh.occluded_filtered(simd, ray, ends, NoFilter, probe)
    } else {
        scene.bvh.occluded_here(simd, ray, ends, probe)
    }
}
