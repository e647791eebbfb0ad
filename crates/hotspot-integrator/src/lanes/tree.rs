//! Rays in lanes that search the tree, each by itself.
//!
//! The searches are functions of their own: the path loop keeps its vectors in memory meanwhile, and they their registers.

use super::counts::{BookedRays, Listener, Senders, TalliedRays};
use crate::class::{Class, Feature, has};
use crate::cutout::Cutouts;
use crate::scene::RenderScene;
use hotspot_bvh::lanes::LaneProbes;
use hotspot_bvh::rays::{Hits, Nearest, Rays};
use hotspot_bvh::simd::{Floats, Integers, Lanes, Simd, U8, Vectors, set_vector, vector};
use hotspot_bvh::{NoFilter, Ray};
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
        self.nearest_of::<C, _>(s, &mut NoProbe)
    }

    /// The same, counted.
    #[inline(never)]
    pub(super) fn nearest_counted<C: Class>(
        &self,
        s: S,
        listener: &mut Listener<'_>,
        senders: &Senders<'_>,
    ) -> Nearest<S> {
        match listener {
            Listener::Tallies(tallies) => self.nearest_of::<C, _>(s, &mut TalliedRays { tallies, senders }),
            Listener::Books(books, booking) => {
                self.nearest_of::<C, _>(s, &mut BookedRays { books, booking, senders })
            }
        }
    }

    /// Which rays are blocked before `t_max`, `to` being the triangles that they are aimed at.
    #[inline(always)]
    pub(super) fn blocked<C: Class>(&self, s: S, to: Integers<S>, t_max: Floats<S>) -> u32 {
        self.blocked_of::<C, _>(s, (to, t_max), &mut NoProbe)
    }

    /// The same, counted.
    #[inline(never)]
    pub(super) fn blocked_counted<C: Class>(
        &self,
        s: S,
        ends: (Integers<S>, Floats<S>),
        listener: &mut Listener<'_>,
        senders: &Senders<'_>,
    ) -> u32 {
        match listener {
            Listener::Tallies(tallies) => {
                self.blocked_of::<C, _>(s, ends, &mut TalliedRays { tallies, senders })
            }
            Listener::Books(books, booking) => {
                self.blocked_of::<C, _>(s, ends, &mut BookedRays { books, booking, senders })
            }
        }
    }

    /// Whether instances are to be searched.
    #[inline(always)]
    fn instanced(&self) -> bool {
        self.scene.bvh.instance_count() > 0
    }

    #[inline(always)]
    fn nearest_of<C: Class, P: LaneProbes>(&self, s: S, probes: &mut P) -> Nearest<S> {
        if !has::<C>(Feature::Cutouts) {
            self.search::<P, false, false>(s, probes)
        } else if self.instanced() {
            self.search::<P, true, true>(s, probes)
        } else {
            self.search::<P, true, false>(s, probes)
        }
    }

    #[inline(always)]
    fn blocked_of<C: Class, P: LaneProbes>(
        &self,
        s: S,
        ends: (Integers<S>, Floats<S>),
        probes: &mut P,
    ) -> u32 {
        if !has::<C>(Feature::Cutouts) {
            self.any::<P, false, false>(s, ends, probes)
        } else if self.instanced() {
            self.any::<P, true, true>(s, ends, probes)
        } else {
            self.any::<P, true, false>(s, ends, probes)
        }
    }

    #[inline(never)]
    fn search<P: LaneProbes, const CUTOUTS: bool, const INSTANCED: bool>(
        &self,
        s: S,
        probes: &mut P,
    ) -> Nearest<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let Self { scene: RenderScene { bvh, .. }, rays, from, active, .. } = *self;
                if CUTOUTS {
                    let filters = &cutouts(s, self.scene, &self.keys.store());
                    bvh.closest_of_lanes::<S, _, P, INSTANCED>(s, rays, from, active, (filters, probes))
                } else {
                    let filters = &[NoFilter; 8];
                    bvh.closest_of_lanes::<S, _, P, INSTANCED>(s, rays, from, active, (filters, probes))
                }
            },
        )
    }

    #[inline(never)]
    fn any<P: LaneProbes, const CUTOUTS: bool, const INSTANCED: bool>(
        &self,
        s: S,
        (to, t_max): (Integers<S>, Floats<S>),
        probes: &mut P,
    ) -> u32 {
        s.vectorize(
            #[inline(always)]
            || {
                let Self { scene: RenderScene { bvh, .. }, rays, from, active, .. } = *self;
                let ends = [from, to];
                if CUTOUTS {
                    let filters = &cutouts(s, self.scene, &self.keys.store());
                    bvh.occluded_lanes::<S, _, P, INSTANCED>(s, rays, t_max, ends, active, (filters, probes))
                } else {
                    let filters = &[NoFilter; 8];
                    bvh.occluded_lanes::<S, _, P, INSTANCED>(s, rays, t_max, ends, active, (filters, probes))
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

/// The same where lanes `placed` hit instances.
#[inline(never)]
pub(super) fn placed_hits<S: Simd>(
    s: S,
    scene: &RenderScene,
    rays: &Rays<S>,
    nearest: Nearest<S>,
    placed: u32,
) -> Hits<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let hits = hits(s, scene, rays, nearest);
            let (primitive, instance) = (nearest.primitive.store(), nearest.instance.store());
            let (origin, direction) = (rays.origin.store(), rays.direction.store());
            let (mut u, mut v, mut normal) = (hits.u.store(), hits.v.store(), hits.normal.store());
            for lane in Lanes(placed) {
                let ray = Ray::new(vector(&origin, lane), vector(&direction, lane));
                let instance = instance.0[lane];
                let triangle = scene.geometry.corners_of(scene.geometry.surface(instance, primitive.0[lane]));
                let (weights, n) = scene.bvh.details_of_instance(&ray, instance, triangle);
                [u.0[lane], v.0[lane]] = weights;
                set_vector(&mut normal, lane, n);
            }
            let (u, v) = (Floats::load(s, &u), Floats::load(s, &v));
            Hits { u, v, normal: Vectors::load(s, &normal), ..hits }
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
