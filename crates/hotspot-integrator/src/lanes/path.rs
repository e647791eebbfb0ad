//! The path loop in lanes: [`crate::path::trace`] of a matte scene, for eight samples at once.
//!
//! Paths wait in a pool, packed: eight are read, taken one segment further, and those that go on are written back side by side; the pool is
//! filled up with new samples, so lanes stay busy to the end of the list. What every lane can do is done for all of them;
//! what few need (doubtful rays, points at edges) is done one by one, by the same code as for single paths.

use super::math::{facing, max_element, power_heuristic, square_to_cosine_hemisphere, to_world};
use super::sampler::Points;
use super::{PointLanes, SmallScene, set};
use crate::camera::FilmCamera;
use crate::math::FRAC_1_PI;
use crate::path::PathSettings;
use crate::roulette::LEAST_BASE;
use crate::scene::RenderScene;
use hotspot_bvh::few::{Hits, Rays};
use hotspot_bvh::simd::{Floats, Integers, Mask, Simd, U8, Vectors};
use hotspot_bvh::{NoProbe, Ray};
use hotspot_probe::NONE;

/// Samples to take.
#[derive(Clone, Debug, Default)]
pub(crate) struct SampleList {
    /// [`pixel_key`](crate::sampler::pixel_key) of each, and which sample of it: below 2^16.
    key: Vec<u32>,
    index: Vec<u32>,
    x: Vec<u32>,
    y: Vec<u32>,
}

impl SampleList {
    pub(crate) fn clear(&mut self) {
        for list in [&mut self.key, &mut self.index, &mut self.x, &mut self.y] {
            list.clear();
        }
    }

    pub(crate) fn push(&mut self, key: u32, (x, y): (u32, u32), index: u32) {
        self.key.push(key);
        self.index.push(index);
        self.x.push(x);
        self.y.push(y);
    }

    pub(crate) fn len(&self) -> usize {
        self.key.len()
    }
}

/// What all paths share.
pub(crate) struct View<'a> {
    pub(crate) scene: &'a RenderScene,
    pub(crate) small: &'a SmallScene,
    pub(crate) camera: &'a FilmCamera,
    /// Of the film, in pixels.
    pub(crate) size: (u32, u32),
    pub(crate) settings: &'a PathSettings<'a>,
    /// Of sample points.
    pub(crate) table: &'static [u32],
}

/// Eight paths under way.
#[derive(Clone, Copy)]
struct Paths<S: Simd> {
    rays: Rays<S>,
    /// The triangle that the ray leaves.
    from: Integers<S>,
    radiance: Vectors<S>,
    throughput: Vectors<S>,
    survival_scale: Floats<S>,
    /// BSDF pdf of the present direction; infinite from the camera.
    scattered_pdf: Floats<S>,
    bounces: Integers<S>,
    /// Two numbers for the light sample at the next vertex.
    light: [Floats<S>; 2],
    points: Points<S>,
    /// Which of the list they are.
    number: Integers<S>,
}

/// A vertex of each path.
struct Vertex<S: Simd> {
    primitive: Integers<S>,
    geometric: Vectors<S>,
    /// Shading normal on the path's side.
    normal: Vectors<S>,
    /// Cosine of it with where the path came from.
    cos_wo: Floats<S>,
    point: PointLanes<S>,
    reflectance: Vectors<S>,
}

/// Paths that wait for their next segment.
const WAITING: usize = 128;

/// Lists for what a path is made of ([`Paths`]).
const LISTS: usize = 21;

/// The paths that wait, packed: list by list, with room for eight more than there may be.
struct Pool(Box<[[f32; WAITING + 8]; LISTS]>);

/// Takes all samples of a list; their radiance goes to `found`, in the list's order.
#[inline(always)]
pub(crate) fn trace_samples<S: Simd>(s: S, view: &View<'_>, list: &SampleList, found: &mut Vec<[f32; 3]>) {
    found.clear();
    found.resize(list.len(), [0.0; 3]);
    let mut pool = Pool(Box::new([[0.0; WAITING + 8]; LISTS]));
    let (mut waiting, mut next) = (0, 0);
    loop {
        while waiting + 8 <= WAITING && next < list.len() {
            Paths::starting(s, view, list, next as u32).write(&mut pool, waiting);
            let count = (list.len() - next).min(8);
            waiting += count;
            next += count;
        }
        if waiting == 0 {
            return;
        }
        // What goes on is written over what has been read.
        let mut going_on = 0;
        for at in (0..waiting).step_by(8) {
            let mut paths = Paths::read(s, view, &pool, at);
            let all = if waiting - at < 8 { (1 << (waiting - at)) - 1 } else { 0xff };
            let alive = paths.step(s, view, all);
            let mut ended = all & !alive;
            if ended != 0 {
                let (numbers, [x, y, z]) = (paths.number.store(), paths.radiance.store());
                while ended != 0 {
                    let lane = ended.trailing_zeros() as usize & 7;
                    ended &= ended - 1;
                    found[numbers.0[lane] as usize] = [x.0[lane], y.0[lane], z.0[lane]];
                }
            }
            paths.permuted(Integers::of_set_bits(s, alive)).write(&mut pool, going_on);
            going_on += alive.count_ones() as usize;
        }
        waiting = going_on;
    }
}

impl<S: Simd> Paths<S> {
    /// At the camera: those of a list from `first` on; beyond its end anything.
    #[inline(always)]
    fn starting(s: S, view: &View<'_>, list: &SampleList, first: u32) -> Self {
        let number = Integers::load(s, &U8([0, 1, 2, 3, 4, 5, 6, 7])) + first;
        let key = Integers::gather(&list.key, number);
        let points = Points { key, index: Integers::gather(&list.index, number), table: view.table };
        let [u, v, light @ ..] = points.camera(s);
        let pixel = [Integers::gather(&list.x, number), Integers::gather(&list.y, number)];
        let rays = view.camera.rays(s, pixel, [u, v], view.size);
        let one = Floats::splat(s, 1.0);
        Self {
            rays,
            from: Integers::splat(s, NONE),
            radiance: Vectors::splat(s, [0.0; 3]),
            throughput: Vectors::splat(s, [1.0; 3]),
            survival_scale: one,
            scattered_pdf: Floats::splat(s, f32::INFINITY),
            bounces: Integers::splat(s, 0),
            light,
            points,
            number,
        }
    }

    /// Those of a pool from `at` on.
    #[inline(always)]
    fn read(s: S, view: &View<'_>, Pool(pool): &Pool, at: usize) -> Self {
        Self {
            rays: Rays {
                origin: Vectors::new(
                    Floats::read(s, &pool[0], at),
                    Floats::read(s, &pool[1], at),
                    Floats::read(s, &pool[2], at),
                ),
                direction: Vectors::new(
                    Floats::read(s, &pool[3], at),
                    Floats::read(s, &pool[4], at),
                    Floats::read(s, &pool[5], at),
                ),
            },
            radiance: Vectors::new(
                Floats::read(s, &pool[6], at),
                Floats::read(s, &pool[7], at),
                Floats::read(s, &pool[8], at),
            ),
            throughput: Vectors::new(
                Floats::read(s, &pool[9], at),
                Floats::read(s, &pool[10], at),
                Floats::read(s, &pool[11], at),
            ),
            survival_scale: Floats::read(s, &pool[12], at),
            scattered_pdf: Floats::read(s, &pool[13], at),
            light: [Floats::read(s, &pool[14], at), Floats::read(s, &pool[15], at)],
            from: Floats::read(s, &pool[16], at).bits(),
            bounces: Floats::read(s, &pool[17], at).bits(),
            points: Points {
                key: Floats::read(s, &pool[18], at).bits(),
                index: Floats::read(s, &pool[19], at).bits(),
                table: view.table,
            },
            number: Floats::read(s, &pool[20], at).bits(),
        }
    }

    /// To a pool from `at` on, as [`Paths::read`] reads them.
    #[inline(always)]
    fn write(&self, Pool(pool): &mut Pool, at: usize) {
        let Self { rays: Rays { origin, direction }, radiance, throughput, points, .. } = self;
        origin.x.write(&mut pool[0], at);
        origin.y.write(&mut pool[1], at);
        origin.z.write(&mut pool[2], at);
        direction.x.write(&mut pool[3], at);
        direction.y.write(&mut pool[4], at);
        direction.z.write(&mut pool[5], at);
        radiance.x.write(&mut pool[6], at);
        radiance.y.write(&mut pool[7], at);
        radiance.z.write(&mut pool[8], at);
        throughput.x.write(&mut pool[9], at);
        throughput.y.write(&mut pool[10], at);
        throughput.z.write(&mut pool[11], at);
        self.survival_scale.write(&mut pool[12], at);
        self.scattered_pdf.write(&mut pool[13], at);
        self.light[0].write(&mut pool[14], at);
        self.light[1].write(&mut pool[15], at);
        self.from.as_bits().write(&mut pool[16], at);
        self.bounces.as_bits().write(&mut pool[17], at);
        points.key.as_bits().write(&mut pool[18], at);
        points.index.as_bits().write(&mut pool[19], at);
        self.number.as_bits().write(&mut pool[20], at);
    }

    /// Lane i gets lane `order[i]`.
    #[inline(always)]
    fn permuted(self, order: Integers<S>) -> Self {
        Self {
            rays: Rays {
                origin: self.rays.origin.permuted(order),
                direction: self.rays.direction.permuted(order),
            },
            radiance: self.radiance.permuted(order),
            throughput: self.throughput.permuted(order),
            survival_scale: self.survival_scale.permuted(order),
            scattered_pdf: self.scattered_pdf.permuted(order),
            light: [self.light[0].permuted(order), self.light[1].permuted(order)],
            from: self.from.permuted(order),
            bounces: self.bounces.permuted(order),
            points: Points {
                key: self.points.key.permuted(order),
                index: self.points.index.permuted(order),
                table: self.points.table,
            },
            number: self.number.permuted(order),
        }
    }

    /// One segment further: from the present rays to their hits, and on. The lanes that go on.
    #[inline(always)]
    fn step(&mut self, s: S, view: &View<'_>, mut alive: u32) -> u32 {
        let small = view.small;
        let zero = Floats::splat(s, 0.0);
        let mut hits = small.few.closest_hits(s, &self.rays, self.from, alive);
        if hits.doubtful != 0 {
            hits = hits_of_doubtful(s, view, self, &hits);
        }
        alive &= hits.found;
        let primitive = hits.primitive;
        let three = primitive.shift_left::<1>() + primitive;
        let geometric = hits.normal;
        let wo = -self.rays.direction;

        // Light of the surface itself.
        let pdf_area = Floats::gather(&small.light_pdf_area, primitive);
        let cos = wo.dot(geometric);
        if zero.less(pdf_area).bits() & alive != 0 {
            let both = Integers::gather(&small.two_sided, primitive).is(1);
            let shows = zero.less(cos) | (both & cos.less(zero));
            let shines = zero.less(pdf_area) & shows & Mask::of_bits(s, alive);
            let light_pdf = pdf_area * (hits.t * hits.t) / cos.abs();
            let emission = Vectors::gather(&small.emission, three);
            let weight = power_heuristic(s, self.scattered_pdf, light_pdf);
            let found = (self.throughput * emission).scaled(weight);
            self.radiance = (self.radiance + found).or_where_not(shines, self.radiance);
        }
        alive &= !self.bounces.is(view.settings.max_depth).bits();
        if alive == 0 {
            return 0;
        }

        let smooth = self.shading_normals(s, small, &hits);
        let front = zero.less_equal(wo.dot(smooth));
        let normal = smooth.or_where_not(front, -smooth);
        let mut point =
            PointLanes::new(s, hits.corners, Vectors::gather(&small.errors, three), hits.u, hits.v);
        let least =
            hits.u.min(hits.v).min(1.0 - hits.u - hits.v) * Floats::gather(&small.least_height, primitive);
        let at_edge = least.less(point.margin(s)).bits() & alive;
        if at_edge != 0 {
            let (primitive, u, v) = (primitive.store(), hits.u.store(), hits.v.store());
            point = point.replaced(s, at_edge, |lane| {
                let surface = view.scene.geometry.world_surface(primitive.0[lane]);
                view.scene.geometry.point(surface, u.0[lane], v.0[lane])
            });
        }
        let reflectance = Vectors::gather(&small.reflectance, three);
        let vertex = Vertex { primitive, geometric, normal, cos_wo: wo.dot(normal), point, reflectance };
        self.add_direct_light(s, view, &vertex, alive);

        // The BSDF's direction.
        let following = self.bounces + 1;
        let [u, v, light @ ..] = self.points.segment(s, following);
        let local = square_to_cosine_hemisphere(s, u, v);
        let pdf = Floats::splat(s, FRAC_1_PI) * local.z;
        alive &= (zero.less(pdf) & reflectance.any()).bits();
        self.throughput = self.throughput * reflectance;
        let at_first = self.bounces.is(0);
        if let Some(gain) = view.settings.roulette.gain
            && at_first.bits() & alive != 0
        {
            let weight = max_element(self.throughput) * self.survival_scale;
            let least = Floats::splat(s, LEAST_BASE);
            let relative = Floats::splat(s, gain) / weight.max(least);
            self.survival_scale = at_first.select(self.survival_scale * relative, self.survival_scale);
        }
        alive = self.survivors(s, view.settings.roulette.from, alive);

        let wi = to_world(s, normal, local);
        let origin = point.leave(facing(s, geometric, wi));
        self.rays = Rays { origin, direction: wi };
        self.from = primitive;
        self.scattered_pdf = pdf;
        self.bounces = following;
        self.light = light;
        alive
    }

    /// Roulette: the lanes that survive, with what makes up for the others.
    #[inline(always)]
    fn survivors(&mut self, s: S, from: u32, alive: u32) -> u32 {
        let one = Floats::splat(s, 1.0);
        // Bounces are far below 2^24, so as floats they compare as they are.
        let due = Floats::splat(s, from as f32).less_equal(self.bounces.to_floats());
        let survival = max_element(self.throughput) * self.survival_scale;
        let risky = due & survival.less(one);
        if risky.bits() & alive == 0 {
            return alive;
        }
        let survival = survival.min(Floats::splat(s, 0.95));
        let ends = risky & survival.less_equal(self.points.roulette(s, self.bounces));
        let Vectors { x, y, z } = self.throughput;
        let made_up = Vectors::new(x / survival, y / survival, z / survival);
        self.throughput = made_up.or_where_not(risky, self.throughput);
        alive & !ends.bits()
    }

    /// [`Geometry::normal`](crate::geometry::Geometry::normal).
    #[inline(always)]
    fn shading_normals(&self, s: S, small: &SmallScene, hits: &Hits<S>) -> Vectors<S> {
        if small.normals.is_empty() {
            return hits.normal;
        }
        let first = hits.primitive.shift_left::<3>() + hits.primitive;
        let a = Vectors::gather(&small.normals, first);
        let (b, c) = if small.flat {
            (a, a)
        } else {
            (Vectors::gather(&small.normals, first + 3), Vectors::gather(&small.normals, first + 6))
        };
        let normal = a.scaled(1.0 - hits.u - hits.v) + b.scaled(hits.u) + c.scaled(hits.v);
        let reciprocal = 1.0 / normal.dot(normal).sqrt();
        let infinite = Floats::splat(s, f32::INFINITY);
        let whole = Floats::splat(s, 0.0).less(reciprocal) & reciprocal.less(infinite);
        let has = Integers::gather(&small.smooth, hits.primitive).is(1);
        normal.scaled(reciprocal).or_where_not(whole & has, hits.normal)
    }

    /// The light-sampled half of direct light.
    #[inline(always)]
    fn add_direct_light(&mut self, s: S, view: &View<'_>, vertex: &Vertex<S>, alive: u32) {
        let zero = Floats::splat(s, 0.0);
        let lights = &view.small.lights;
        let light = lights.sample(s, &view.scene.lights, vertex.point.p, self.light, alive);
        let cos = light.wi.dot(vertex.normal);
        let pdf = Floats::splat(s, FRAC_1_PI) * cos;
        let f_cos = vertex.reflectance.scaled(pdf);
        let both = Integers::gather(&view.small.two_sided, light.primitive).is(1);
        let emits = zero.less(light.cos) | (both & light.cos.less(zero));
        let lit = zero.less(cos) & zero.less(vertex.cos_wo) & f_cos.any() & emits & light.emission.any();
        let lit = light.there & lit.bits();
        if lit == 0 {
            return;
        }
        let origin = vertex.point.leave(facing(s, vertex.geometric, light.wi));
        let towards = (-light.normal).or_where_not(light.cos.less(zero), light.normal);
        let target = light.point.meet(s, towards, origin);
        let rays = Rays { origin, direction: target - origin };
        let ends = [vertex.primitive, light.primitive];
        let blocked = view.small.few.blocked(s, &rays, ends, lit);
        let mut dark = blocked.surely;
        if blocked.doubtful != 0 {
            dark |= blocked_of_doubtful(s, view, &rays, ends, blocked.doubtful);
        }
        let weight = power_heuristic(s, light.pdf, pdf) / light.pdf;
        let direct = (f_cos * light.emission).scaled(weight);
        let found = self.radiance + self.throughput * direct;
        self.radiance = found.or_where_not(Mask::of_bits(s, lit & !dark), self.radiance);
    }
}

/// A lane's ray.
#[inline(always)]
fn single_ray<S: Simd>(rays: &Rays<S>, lane: usize) -> Ray {
    let (o, d) = (rays.origin.store(), rays.direction.store());
    Ray::new([o[0].0[lane], o[1].0[lane], o[2].0[lane]], [d[0].0[lane], d[1].0[lane], d[2].0[lane]])
}

/// Hits with those of doubtful rays, from the tree.
#[cold]
#[inline(never)]
fn hits_of_doubtful<S: Simd>(s: S, view: &View<'_>, paths: &Paths<S>, hits: &Hits<S>) -> Hits<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let from = paths.from.store();
            let (mut t, mut u, mut v) = (hits.t.store(), hits.u.store(), hits.v.store());
            let (mut primitive, mut normal) = (hits.primitive.store(), hits.normal.store());
            let mut found = hits.found;
            let mut left = hits.doubtful;
            while left != 0 {
                let lane = left.trailing_zeros() as usize & 7;
                left &= left - 1;
                let hit = view.scene.bvh.closest_hit_flat(
                    s,
                    &single_ray(&paths.rays, lane),
                    [from.0[lane]],
                    NoProbe,
                );
                if let Some(hit) = hit {
                    found |= 1 << lane;
                    (t.0[lane], u.0[lane], v.0[lane]) = (hit.t, hit.u, hit.v);
                    primitive.0[lane] = hit.primitive;
                    set(&mut normal, lane, hit.normal);
                }
            }
            Hits {
                found,
                doubtful: 0,
                primitive: Integers::load(s, &primitive),
                corners: view.small.few.corners(Integers::load(s, &primitive)),
                t: Floats::load(s, &t),
                u: Floats::load(s, &u),
                v: Floats::load(s, &v),
                normal: Vectors::load(s, &normal),
            }
        },
    )
}

/// The doubtful rays that the tree says are blocked.
#[cold]
#[inline(never)]
fn blocked_of_doubtful<S: Simd>(
    s: S,
    view: &View<'_>,
    rays: &Rays<S>,
    ends: [Integers<S>; 2],
    doubtful: u32,
) -> u32 {
    s.vectorize(
        #[inline(always)]
        || {
            let (from, to) = (ends[0].store(), ends[1].store());
            let mut blocked = 0;
            let mut left = doubtful;
            while left != 0 {
                let lane = left.trailing_zeros() as usize & 7;
                left &= left - 1;
                let ray = Ray { t_max: 1.0, ..single_ray(rays, lane) };
                let ends = [from.0[lane], to.0[lane]];
                blocked |= u32::from(view.scene.bvh.occluded_flat(s, &ray, ends, NoProbe)) << lane;
            }
            blocked
        },
    )
}
