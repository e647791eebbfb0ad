//! Casting rays: which traversal a scene needs.
//!
//! One for each class, and part of the loop: as a call it takes 35 instructions a ray more. That of the full class asks about
//! cutouts and searches instances, that of the others knows neither.

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
    let bvh = &scene.bvh;
    match (has::<C>(Feature::Cutouts), has::<C>(Feature::Instances)) {
        (true, true) => {
            let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce) };
            bvh.closest_hit_filtered_here::<S, R, _, true, 1>(simd, ray, [from], filter, probe)
        }
        (true, false) => {
            let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce) };
            bvh.closest_hit_filtered_here::<S, R, _, false, 1>(simd, ray, [from], filter, probe)
        }
        (false, true) => {
            bvh.closest_hit_filtered_here::<S, R, _, true, 1>(simd, ray, [from], NoFilter, probe)
        }
        (false, false) => bvh.closest_hit_here(simd, ray, [from], probe),
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
    let extras = has::<C>(Feature::Cutouts) || has::<C>(Feature::Instances);
    if !kernel.packets || (extras && !scene.in_packets()) {
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
    let bvh = &scene.bvh;
    match (has::<C>(Feature::Cutouts), has::<C>(Feature::Instances)) {
        (true, true) => {
            let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce + 1) };
            bvh.occluded_filtered_here::<S, R, _, true, 2>(simd, ray, ends, filter, probe)
        }
        (true, false) => {
            let filter = Cutouts { simd, scene, ray_key: sampler.ray_key(2 * bounce + 1) };
            bvh.occluded_filtered_here::<S, R, _, false, 2>(simd, ray, ends, filter, probe)
        }
        (false, true) => bvh.occluded_filtered_here::<S, R, _, true, 2>(simd, ray, ends, NoFilter, probe),
        (false, false) => bvh.occluded_here(simd, ray, ends, probe),
    }
}
