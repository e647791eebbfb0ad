//! Rays in lanes that search the tree, each by itself.
//!
//! The searches are functions of their own: the path loop keeps its vectors in memory meanwhile, and they their registers.

use super::{Lanes, set, vector};
use crate::scene::RenderScene;
use hotspot_bvh::few::{Hits, Rays};
use hotspot_bvh::simd::{F8, Floats, Integers, Simd, U8, Vectors};
use hotspot_bvh::{Hit, NoProbe, Ray};

/// What rays of lanes `active` hit first, but for the triangles `from`. `together`: they run close together, as camera rays do.
#[inline(never)]
pub(super) fn closest_hits<S: Simd>(
    s: S,
    scene: &RenderScene,
    rays: &Rays<S>,
    from: Integers<S>,
    active: u32,
    together: bool,
) -> Hits<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (lines, from) = (Lines::of(rays), from.store());
            let mut all = Found::NOTHING;
            if together {
                let mut rays = [lines.ray(0); 8];
                let mut hits = [None; 8];
                let mut lanes = [0; 8];
                let mut count = 0;
                for lane in Lanes(active) {
                    (rays[count & 7], lanes[count & 7]) = (lines.ray(lane), lane);
                    count += 1;
                }
                scene.bvh.closest_hits_flat(s, &rays[..count], &mut hits[..count]);
                for (hit, lane) in hits[..count].iter().zip(lanes) {
                    all.add(lane, hit);
                }
            } else {
                for lane in Lanes(active) {
                    let hit = scene.bvh.closest_hit_here(s, &lines.ray(lane), [from.0[lane]], NoProbe);
                    all.add(lane, &hit);
                }
            }
            let primitive = Integers::load(s, &all.primitive);
            Hits {
                found: all.found,
                doubtful: 0,
                primitive,
                corners: scene.geometry.corners_in_lanes(primitive),
                t: Floats::load(s, &all.t),
                u: Floats::load(s, &all.u),
                v: Floats::load(s, &all.v),
                normal: Vectors::load(s, &all.normal),
            }
        },
    )
}

/// The rays of lanes `active` that are blocked before `t_max`; `ends`: the triangles that they start on and are aimed at.
#[inline(never)]
pub(super) fn blocked<S: Simd>(
    s: S,
    scene: &RenderScene,
    rays: &Rays<S>,
    t_max: Floats<S>,
    ends: [Integers<S>; 2],
    active: u32,
) -> u32 {
    s.vectorize(
        #[inline(always)]
        || {
            let (lines, t_max) = (Lines::of(rays), t_max.store());
            let (from, to) = (ends[0].store(), ends[1].store());
            let mut blocked = 0;
            for lane in Lanes(active) {
                let ray = Ray { t_max: t_max.0[lane], ..lines.ray(lane) };
                let ends = [from.0[lane], to.0[lane]];
                blocked |= u32::from(scene.bvh.occluded_here(s, &ray, ends, NoProbe)) << lane;
            }
            blocked
        },
    )
}

/// Rays in memory.
struct Lines {
    origin: [F8; 3],
    direction: [F8; 3],
}

impl Lines {
    #[inline(always)]
    fn of<S: Simd>(rays: &Rays<S>) -> Self {
        Self { origin: rays.origin.store(), direction: rays.direction.store() }
    }

    #[inline(always)]
    fn ray(&self, lane: usize) -> Ray {
        Ray::new(vector(&self.origin, lane).to_array(), vector(&self.direction, lane).to_array())
    }
}

/// Hits in memory; of lanes that are not found they are of no meaning.
struct Found {
    found: u32,
    primitive: U8,
    t: F8,
    u: F8,
    v: F8,
    normal: [F8; 3],
}

impl Found {
    const NOTHING: Self = Self {
        found: 0,
        primitive: U8([0; 8]),
        t: F8([0.0; 8]),
        u: F8([0.0; 8]),
        v: F8([0.0; 8]),
        normal: [F8([0.0; 8]); 3],
    };

    #[inline(always)]
    fn add(&mut self, lane: usize, hit: &Option<Hit>) {
        let Some(hit) = hit else { return };
        self.found |= 1 << lane;
        self.primitive.0[lane] = hit.primitive;
        (self.t.0[lane], self.u.0[lane], self.v.0[lane]) = (hit.t, hit.u, hit.v);
        set(&mut self.normal, lane, hit.normal);
    }
}
