//! Rays in lanes that search the tree, each by itself.
//!
//! The searches are functions of their own: the path loop keeps its vectors in memory meanwhile, and they their registers.

use crate::class::{Class, Feature, has};
use crate::cutout::Cutouts;
use crate::scene::RenderScene;
use hotspot_bvh::NoFilter;
use hotspot_bvh::rays::{Hits, Nearest, Rays};
use hotspot_bvh::simd::{Floats, Integers, Simd, U8};

/// What rays of lanes `active` hit first, but for the triangles `from`; `keys`: [`Sampler::ray_key`](crate::sampler::Sampler::ray_key) of each.
#[inline(never)]
pub(super) fn nearest<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    rays: &Rays<S>,
    from: Integers<S>,
    keys: Integers<S>,
    active: u32,
) -> Nearest<S> {
    s.vectorize(
        #[inline(always)]
        || {
            if has::<C>(Feature::Cutouts) {
                scene.bvh.closest_of_lanes(s, rays, from, &cutouts(s, scene, &keys.store()), active)
            } else {
                scene.bvh.closest_of_lanes(s, rays, from, &[NoFilter; 8], active)
            }
        },
    )
}

/// What the first `count` camera rays of two times eight hit first, where everything is there.
#[inline(never)]
pub(super) fn nearest_of_camera<S: Simd>(
    s: S,
    scene: &RenderScene,
    rays: [&Rays<S>; 2],
    count: usize,
) -> [Nearest<S>; 2] {
    s.vectorize(
        #[inline(always)]
        || scene.bvh.closest_of_packet_in_lanes(s, rays, count),
    )
}

/// All about what is hit.
#[inline(always)]
pub(super) fn hits<S: Simd>(s: S, scene: &RenderScene, rays: &Rays<S>, nearest: Nearest<S>) -> Hits<S> {
    nearest.hits(s, rays, scene.geometry.corners_in_lanes(nearest.primitive))
}

/// The rays of lanes `active` that are blocked before `t_max`; `ends`: the triangles that they start on and are aimed at; `keys` as in
/// [`nearest`].
#[inline(never)]
pub(super) fn blocked<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    rays: &Rays<S>,
    t_max: Floats<S>,
    ends: [Integers<S>; 2],
    keys: Integers<S>,
    active: u32,
) -> u32 {
    s.vectorize(
        #[inline(always)]
        || {
            if has::<C>(Feature::Cutouts) {
                let cutouts = cutouts(s, scene, &keys.store());
                scene.bvh.occluded_lanes(s, rays, t_max, ends, &cutouts, active)
            } else {
                scene.bvh.occluded_lanes(s, rays, t_max, ends, &[NoFilter; 8], active)
            }
        },
    )
}

#[inline(always)]
fn cutouts<'a, S: Simd>(simd: S, scene: &'a RenderScene, keys: &U8) -> [Cutouts<'a, S>; 8] {
    let mut all = [Cutouts { simd, scene, ray_key: 0 }; 8];
    for (cutouts, key) in all.iter_mut().zip(keys.0) {
        cutouts.ray_key = key;
    }
    all
}
