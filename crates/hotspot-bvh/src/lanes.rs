//! Rays of eight lanes that search the tree, each by itself.
//!
//! What a ray needs before its first visit (reciprocals, shears, the order of axes) and what its hit needs after the last (weights, normal) is
//! computed for all of them at once, in between each runs through the traversal of single rays; so hits are those of single rays, bit
//! for bit.

#[cfg(test)]
mod tests;

use crate::Bvh;
use crate::exact::{LongestAxis, edge_weights, unit_normals};
use crate::filter::Filter;
use crate::node::Child;
use crate::packet::{PACKET, nearest_of_packet};
use crate::ray::{NO_INSTANCE, Ray};
use crate::rays::{Hits, Nearest, Rays};
use crate::simd::{F8, Floats, Integers, Lanes, Simd, U8, Vectors, vector};
use crate::traverse::{Best, any_of_frame, closest_of_frame};
use crate::triangle::{CYCLES, FAR_QUANTA, FAR_SCALE, RayFrame, details};
use hotspot_probe::{NoProbe, RayProbe};

/// Listens to the rays of eight lanes.
pub trait LaneProbes {
    /// The listener for one ray.
    type Ray<'p>: RayProbe
    where
        Self: 'p;
    /// The ray of a lane is about to be cast.
    fn ray(&mut self, lane: usize) -> Self::Ray<'_>;
}

impl LaneProbes for NoProbe {
    type Ray<'p> = Self;

    #[inline(always)]
    fn ray(&mut self, _lane: usize) -> Self {
        Self
    }
}

/// Tells of the rays of `lanes` that nothing is visited by them.
#[inline(always)]
fn without_visits<P: LaneProbes>(lanes: u32, probes: &mut P) {
    if P::Ray::<'_>::ON {
        for lane in Lanes(lanes) {
            probes.ray(lane).finish(false);
        }
    }
}

/// [`RayFrame`]s in memory.
struct Frames {
    origin: [F8; 3],
    direction: [F8; 3],
    inverse: [F8; 3],
    inverse_far: [F8; 3],
    origin_k: [F8; 3],
    direction_k: [F8; 3],
    shear: [F8; 2],
    /// The last axis.
    last: U8,
    /// Lanes whose ray is finite.
    finite: u32,
}

impl Frames {
    #[inline(always)]
    fn new<S: Simd>(s: S, rays: &Rays<S>) -> Self {
        let Rays { origin: o, direction: d } = *rays;
        let one = Floats::splat(s, 1.0);
        let inverse = Vectors::new(one / d.x, one / d.y, one / d.z);
        let axes = LongestAxis::of(d);
        let (origin_k, direction_k) = (axes.permuted(o), axes.permuted(d));
        let zero = Floats::splat(s, 0.0);
        let sum = zero * o.x + zero * o.y + zero * o.z + zero * d.x + zero * d.y + zero * d.z;
        Self {
            origin: o.store(),
            direction: d.store(),
            inverse: inverse.store(),
            inverse_far: [far(s, inverse.x).store(), far(s, inverse.y).store(), far(s, inverse.z).store()],
            origin_k: origin_k.store(),
            direction_k: direction_k.store(),
            shear: [(direction_k.x / direction_k.z).store(), (direction_k.y / direction_k.z).store()],
            last: axes.number(s).store(),
            finite: sum.is(0.0).bits(),
        }
    }

    #[inline(always)]
    fn frame(&self, lane: usize, t_max: f32) -> RayFrame {
        let (origin, direction) = (vector(&self.origin, lane), vector(&self.direction, lane));
        let [dx, dy, dz] = direction;
        RayFrame {
            ray: Ray { t_max, ..Ray::new(origin, direction) },
            inverse: vector(&self.inverse, lane),
            inverse_far: vector(&self.inverse_far, lane),
            down: [dx.is_sign_negative(), dy.is_sign_negative(), dz.is_sign_negative()],
            k: CYCLES[self.last.0[lane] as usize & 3],
            origin_k: vector(&self.origin_k, lane),
            direction_k: vector(&self.direction_k, lane),
            shear: [self.shear[0].0[lane], self.shear[1].0[lane]],
        }
    }
}

/// [`reciprocal_far`](crate::triangle::reciprocal_far).
#[inline(always)]
pub(crate) fn far<S: Simd>(s: S, inverse: Floats<S>) -> Floats<S> {
    inverse * FAR_SCALE + Floats::splat(s, FAR_QUANTA).copysign(inverse)
}

impl Bvh {
    /// What the rays of lanes `active` (as bits) hit first, but for the triangles `from` of the world, of what each lane's filter accepts: as
    /// [`Bvh::closest_hit_filtered`] finds it, and tells of it; [`Nearest::hits`] has the rest, of instances [`Bvh::details_of_instance`].
    ///
    /// # Panics
    /// May panic where the tree has instances, unless `INSTANCED`.
    #[inline(always)]
    pub fn closest_of_lanes<S: Simd, F: Filter + Copy, P: LaneProbes, const INSTANCED: bool>(
        &self,
        s: S,
        rays: &Rays<S>,
        from: Integers<S>,
        active: u32,
        (filters, probes): (&[F; 8], &mut P),
    ) -> Nearest<S> {
        let (frames, from) = (Frames::new(s, rays), from.store());
        let (mut found, mut primitive, mut t) = (0, U8([0; 8]), F8([0.0; 8]));
        let mut instance = U8([NO_INSTANCE; 8]);
        let asked = if self.root == Child::EMPTY { 0 } else { active & frames.finite };
        without_visits(active & !asked, probes);
        for lane in Lanes(asked) {
            // First, so that nothing of the frame has to be kept meanwhile.
            let mut probe = probes.ray(lane);
            let frame = frames.frame(lane, f32::INFINITY);
            let mut filter = filters[lane];
            let best = closest_of_frame::<S, P::Ray<'_>, F, INSTANCED, 1>(
                s,
                self,
                &frame,
                [from.0[lane]],
                &mut filter,
                &mut probe,
            );
            probe.finish(best.found);
            found |= u32::from(best.found) << lane;
            (primitive.0[lane], t.0[lane]) = (best.primitive, best.t);
            if INSTANCED {
                instance.0[lane] = best.instance;
            }
        }
        let (primitive, instance) = (Integers::load(s, &primitive), Integers::load(s, &instance));
        Nearest { found, primitive, instance, t: Floats::load(s, &t) }
    }

    /// Of a hit of a triangle with these corners in the space of an instance's mesh: barycentric weights of the second and third corner, and the
    /// geometric normal in the world.
    ///
    /// # Panics
    /// Where there is no such instance.
    #[inline(always)]
    pub fn details_of_instance(
        &self,
        ray: &Ray,
        instance: u32,
        triangle: &[[f32; 3]; 3],
    ) -> ([f32; 2], [f32; 3]) {
        let placed = &self.instances[instance as usize];
        let frame = RayFrame::new(&placed.object_ray(ray, (0.0, 0.0), f32::INFINITY));
        let (u, v, normal) = details(&frame, triangle);
        ([u, v], placed.world_normal(normal))
    }

    /// What the first `count` rays of two times eight hit first in a tree without instances, where they run close together, as the camera
    /// rays of a pixel do: as [`Bvh::closest_hits_flat`] finds it.
    ///
    /// # Panics
    /// May panic where the tree has instances.
    #[inline(always)]
    pub fn closest_of_packet_in_lanes<S: Simd>(
        &self,
        s: S,
        rays: [&Rays<S>; 2],
        count: usize,
    ) -> [Nearest<S>; 2] {
        let mut all = [Ray::new([0.0; 3], [0.0; 3]); PACKET];
        for (half, rays) in all.chunks_exact_mut(8).zip(rays) {
            let (origin, direction) = (rays.origin.store(), rays.direction.store());
            for (lane, ray) in half.iter_mut().enumerate() {
                *ray = Ray::new(vector(&origin, lane), vector(&direction, lane));
            }
        }
        let mut hits = [Best::none(0.0); PACKET];
        nearest_of_packet(s, self, &all[..count], &mut hits[..count]);
        let (mut found, mut primitive, mut t) = ([0; 2], [U8([0; 8]); 2], [F8([0.0; 8]); 2]);
        for (index, best) in hits.iter().enumerate() {
            let (half, lane) = (index / 8, index % 8);
            found[half] |= u32::from(best.found) << lane;
            (primitive[half].0[lane], t[half].0[lane]) = (best.primitive, best.t);
        }
        let instance = Integers::splat(s, NO_INSTANCE);
        [
            Nearest {
                found: found[0],
                primitive: Integers::load(s, &primitive[0]),
                instance,
                t: Floats::load(s, &t[0]),
            },
            Nearest {
                found: found[1],
                primitive: Integers::load(s, &primitive[1]),
                instance,
                t: Floats::load(s, &t[1]),
            },
        ]
    }

    /// The rays of lanes `active` that are blocked before `t_max`, by what each lane's filter accepts but for two triangles of each: as
    /// [`Bvh::occluded_filtered`] says, and tells of it.
    ///
    /// # Panics
    /// May panic where the tree has instances, unless `INSTANCED`.
    #[inline(always)]
    pub fn occluded_lanes<S: Simd, F: Filter + Copy, P: LaneProbes, const INSTANCED: bool>(
        &self,
        s: S,
        rays: &Rays<S>,
        t_max: Floats<S>,
        except: [Integers<S>; 2],
        active: u32,
        (filters, probes): (&[F; 8], &mut P),
    ) -> u32 {
        let (frames, t_max) = (Frames::new(s, rays), t_max.store());
        let (from, to) = (except[0].store(), except[1].store());
        let mut occluded = 0;
        let asked = if self.root == Child::EMPTY { 0 } else { active & frames.finite };
        without_visits(active & !asked, probes);
        for lane in Lanes(asked) {
            let mut probe = probes.ray(lane);
            let frame = frames.frame(lane, t_max.0[lane]);
            let except = [from.0[lane], to.0[lane]];
            let mut filter = filters[lane];
            let hit = any_of_frame::<S, P::Ray<'_>, F, INSTANCED, 2>(
                s,
                self,
                &frame,
                except,
                &mut filter,
                &mut probe,
            );
            probe.finish(hit);
            occluded |= u32::from(hit) << lane;
        }
        occluded
    }
}

impl<S: Simd> Nearest<S> {
    /// The rest of what is to know, of triangles of the world with area and these corners.
    #[inline(always)]
    pub fn hits(self, s: S, rays: &Rays<S>, corners: [Vectors<S>; 3]) -> Hits<S> {
        let Self { found, primitive, t, .. } = self;
        let [u, v] = edge_weights(s, rays, corners);
        Hits { found, primitive, corners, t, u, v, normal: unit_normals(s, corners) }
    }
}
