//! Rays in lanes that search the tree, each by itself.
//!
//! The searches are functions of their own: the path loop keeps its vectors in memory meanwhile, and they their registers.

use super::counts::{BookedRays, Listener, Senders, TalliedRays};
use crate::class::{Class, Feature, has};
use crate::cutout::Cutouts;
use crate::scene::RenderScene;
use hotspot_bvh::NoFilter;
use hotspot_bvh::lanes::LaneProbes;
use hotspot_bvh::rays::{Hits, Nearest, Rays};
use hotspot_bvh::simd::{Floats, Integers, Simd, U8};
use hotspot_probe::NoProbe;

/// Rays in lanes, and who listens to them.
pub(super) struct Query<'a, S: Simd> {
    pub(super) scene: &'a RenderScene,
    pub(super) rays: &'a Rays<S>,
    /// The triangles that they start on.
    pub(super) from: Integers<S>,
    /// [`Sampler::ray_key`](crate::sampler::Sampler::ray_key) of each.
    pub(super) keys: Integers<S>,
    /// Which lanes have one.
    pub(super) active: u32,
}

impl<S: Simd> Query<'_, S> {
    /// What the rays hit first.
    #[inline(always)]
    pub(super) fn nearest<C: Class>(&self, s: S) -> Nearest<S> {
        if has::<C>(Feature::Cutouts) {
            self.search::<_, true>(s, &mut NoProbe)
        } else {
            self.search::<_, false>(s, &mut NoProbe)
        }
    }

    /// The same, counted.
    #[inline(never)]
    pub(super) fn nearest_counted<C: Class>(
        &self,
        s: S,
        listener: &mut Listener<'_>,
        senders: &Senders<'_>,
    ) -> Nearest<S> {
        match (listener, has::<C>(Feature::Cutouts)) {
            (Listener::Tallies(tallies), false) => {
                self.search::<_, false>(s, &mut TalliedRays { tallies, senders })
            }
            (Listener::Tallies(tallies), true) => {
                self.search::<_, true>(s, &mut TalliedRays { tallies, senders })
            }
            (Listener::Books(books), false) => self.search::<_, false>(s, &mut BookedRays { books, senders }),
            (Listener::Books(books), true) => self.search::<_, true>(s, &mut BookedRays { books, senders }),
        }
    }

    /// Which rays are blocked before `t_max`, `to` being the triangles that they are aimed at.
    #[inline(always)]
    pub(super) fn blocked<C: Class>(&self, s: S, to: Integers<S>, t_max: Floats<S>) -> u32 {
        if has::<C>(Feature::Cutouts) {
            self.any::<_, true>(s, to, t_max, &mut NoProbe)
        } else {
            self.any::<_, false>(s, to, t_max, &mut NoProbe)
        }
    }

    /// The same, counted.
    #[inline(never)]
    pub(super) fn blocked_counted<C: Class>(
        &self,
        s: S,
        (to, t_max): (Integers<S>, Floats<S>),
        listener: &mut Listener<'_>,
        senders: &Senders<'_>,
    ) -> u32 {
        match (listener, has::<C>(Feature::Cutouts)) {
            (Listener::Tallies(tallies), false) => {
                self.any::<_, false>(s, to, t_max, &mut TalliedRays { tallies, senders })
            }
            (Listener::Tallies(tallies), true) => {
                self.any::<_, true>(s, to, t_max, &mut TalliedRays { tallies, senders })
            }
            (Listener::Books(books), false) => {
                self.any::<_, false>(s, to, t_max, &mut BookedRays { books, senders })
            }
            (Listener::Books(books), true) => {
                self.any::<_, true>(s, to, t_max, &mut BookedRays { books, senders })
            }
        }
    }

    #[inline(never)]
    fn search<P: LaneProbes, const CUTOUTS: bool>(&self, s: S, probes: &mut P) -> Nearest<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let Self { scene, rays, from, keys, active } = *self;
                if CUTOUTS {
                    let cutouts = cutouts(s, scene, &keys.store());
                    scene.bvh.closest_of_lanes(s, rays, from, active, (&cutouts, probes))
                } else {
                    scene.bvh.closest_of_lanes(s, rays, from, active, (&[NoFilter; 8], probes))
                }
            },
        )
    }

    #[inline(never)]
    fn any<P: LaneProbes, const CUTOUTS: bool>(
        &self,
        s: S,
        to: Integers<S>,
        t_max: Floats<S>,
        probes: &mut P,
    ) -> u32 {
        s.vectorize(
            #[inline(always)]
            || {
                let Self { scene, rays, from, keys, active } = *self;
                if CUTOUTS {
                    let cutouts = cutouts(s, scene, &keys.store());
                    scene.bvh.occluded_lanes(s, rays, t_max, [from, to], active, (&cutouts, probes))
                } else {
                    scene.bvh.occluded_lanes(s, rays, t_max, [from, to], active, (&[NoFilter; 8], probes))
                }
            },
        )
    }
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

#[inline(always)]
fn cutouts<'a, S: Simd>(simd: S, scene: &'a RenderScene, keys: &U8) -> [Cutouts<'a, S>; 8] {
    let mut all = [Cutouts { simd, scene, ray_key: 0 }; 8];
    for (cutouts, key) in all.iter_mut().zip(keys.0) {
        cutouts.ray_key = key;
    }
    all
}
