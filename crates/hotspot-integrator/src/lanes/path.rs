//! The path loop in lanes: [`crate::path::trace`] for eight samples at once.
//!
//! Paths that are under way wait on a stack: the topmost eight are taken one segment further, and those that go on are put back. Where fewer than
//! eight wait, eight new samples are taken one segment instead; so lanes stay busy to the end of the list. What every lane can do is done
//! for all of them; what few need (doubtful rays, points at edges) is done one by one, by the same code as for single paths.

mod pool;

use super::bsdf::{At, BUMPY, BsdfLanes, GLOWS, Kind};
use super::counts::{Counted, Lookups, Senders};
use super::few::{self, Few};
use super::math::{FrameLanes, facing, max_element, power_heuristic};
use super::sampler::Points;
use super::surface::{
    absorbed, bumped_normals, emissions, emissions_of_samples, placed_normals, points, shading_normals,
    unlit_colors,
};
use super::tree::{self, Query};
use super::{LaneScene, PointLanes};
use crate::camera::FilmCamera;
use crate::class::{Class, Feature, has};
use crate::light::{LightSamples, ViewpointLanes, sample_each, way_to_positions};
use crate::path::PathSettings;
use crate::roulette::LEAST_BASE;
use crate::scene::RenderScene;
use hotspot_bvh::NO_INSTANCE;
use hotspot_bvh::rays::{Hits, Nearest, Rays};
use hotspot_bvh::simd::{Floats, Integers, Lanes, Mask, Simd, U8, Vectors};
use hotspot_cost::Cause;
use hotspot_probe::{NONE, RayKind};
use pool::Pool;

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
    pub(crate) lanes: &'a LaneScene,
    /// Where all triangles are tried.
    pub(crate) few: Option<&'a Few>,
    /// Whether camera rays go in packets.
    pub(crate) packets: bool,
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
    /// The triangle of the world that the ray leaves.
    from: Integers<S>,
    /// The number of its part; of kernels for everything.
    part: Integers<S>,
    radiance: Vectors<S>,
    throughput: Vectors<S>,
    survival_scale: Floats<S>,
    /// BSDF pdf of the present direction, infinite from the camera; and its cosine with the shading normal there.
    scattered_pdf: Floats<S>,
    scattered_cos: Floats<S>,
    /// The vertex, where light sampling depends on it.
    scattered_from: ViewpointLanes<S>,
    /// Of the glass that they are in; of kernels for everything.
    absorption: Vectors<S>,
    bounces: Integers<S>,
    /// Two numbers for the light sample at the next vertex.
    light: [Floats<S>; 2],
    points: Points<S>,
    /// Which of the list they are.
    number: Integers<S>,
}

/// A vertex of each path.
struct Vertex<S: Simd> {
    /// The triangle, if of the world, and its part.
    primitive: Integers<S>,
    part: Integers<S>,
    geometric: Vectors<S>,
    /// Around the shading normal on the path's side.
    frame: FrameLanes<S>,
    /// Where the path came from, in it.
    local_wo: Vectors<S>,
    point: PointLanes<S>,
    viewpoint: ViewpointLanes<S>,
    bsdf: BsdfLanes<S>,
}

/// Takes all samples of a list; their radiance goes to `found`, in the list's order. Where they are `counted`, no
/// rays go in packets, which share their visits.
#[inline(always)]
pub(crate) fn trace_samples<S: Simd, C: Class>(
    s: S,
    view: &View<'_>,
    list: &SampleList,
    found: &mut Vec<[f32; 3]>,
    mut counted: Option<&mut Counted<'_>>,
) {
    found.clear();
    found.resize(list.len(), [0.0; 3]);
    let mut pool = Pool::new();
    let (mut waiting, mut next) = (0, 0);
    let mut held: Option<(Paths<S>, Nearest<S>, usize)> = None;
    loop {
        let mut known = None;
        let (mut paths, count) = if waiting >= 8 || (next == list.len() && held.is_none()) {
            let count = waiting.min(8);
            waiting -= count;
            (Paths::read::<C>(s, view, &pool, waiting), count)
        } else if let Some((paths, nearest, count)) = held.take() {
            known = Some(nearest);
            (paths, count)
        } else {
            let first = next;
            next = list.len().min(next + 8);
            let paths = Paths::starting(s, view, list, first as u32);
            if view.packets {
                // Camera rays go sixteen at a time; the second eight paths wait for their turn.
                let second = next;
                next = list.len().min(next + 8);
                let others = Paths::starting(s, view, list, second as u32);
                let rays = [&paths.rays, &others.rays];
                let [here, there] = tree::nearest_of_camera(s, view.scene, rays, next - first);
                known = Some(here);
                if next > second {
                    held = Some((others, there, next - second));
                }
                (paths, second - first)
            } else {
                (paths, next - first)
            }
        };
        if count == 0 {
            return;
        }
        let all = (1 << count) - 1;
        if let Some(counted) = &mut counted {
            counted.step(s, paths.number, all);
        }
        let alive = paths.step::<C>(s, view, all, known, counted.as_deref_mut());
        let ended = all & !alive;
        if ended != 0 {
            let (numbers, [x, y, z]) = (paths.number.store(), paths.radiance.store());
            for lane in Lanes(ended) {
                found[numbers.0[lane] as usize] = [x.0[lane], y.0[lane], z.0[lane]];
            }
        }
        paths.write::<C>(&mut pool, waiting, Integers::of_set_bits(s, alive));
        waiting += alive.count_ones() as usize;
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
            part: Integers::splat(s, 0),
            radiance: Vectors::splat(s, [0.0; 3]),
            throughput: Vectors::splat(s, [1.0; 3]),
            survival_scale: one,
            scattered_pdf: Floats::splat(s, f32::INFINITY),
            scattered_cos: one,
            scattered_from: ViewpointLanes::none(s),
            absorption: Vectors::splat(s, [0.0; 3]),
            bounces: Integers::splat(s, 0),
            light,
            points,
            number,
        }
    }

    /// One segment further: from the present rays to their hits, `known` where they are, and on. The lanes that go on.
    #[inline(always)]
    fn step<C: Class>(
        &mut self,
        s: S,
        view: &View<'_>,
        alive: u32,
        known: Option<Nearest<S>>,
        mut counted: Option<&mut Counted<'_>>,
    ) -> u32 {
        let mut lookups = Lookups::NONE;
        let alive = self.go_on::<C>(s, view, (alive, known), counted.as_deref_mut(), &mut lookups);
        if C::TEXTURED
            && let Some(counted) = counted
        {
            counted.textures(&self.number.store(), &lookups);
        }
        alive
    }

    /// The same, but that nobody is told what is looked up.
    #[inline(always)]
    fn go_on<C: Class>(
        &mut self,
        s: S,
        view: &View<'_>,
        (mut alive, known): (u32, Option<Nearest<S>>),
        mut counted: Option<&mut Counted<'_>>,
        lookups: &mut [Lookups; 8],
    ) -> u32 {
        let View { scene, lanes, .. } = *view;
        let learned = if C::LEARNED { view.settings.learned } else { None };
        let zero = Floats::splat(s, 0.0);
        let (hits, instance) = self.hits::<C>(s, view, alive, known, counted.as_deref_mut());
        let escaped = alive & !hits.found;
        if escaped != 0
            && let Some((sky, mut pdf)) = {
                let by = (self.rays.direction, self.scattered_cos);
                lanes.lights.escaped::<S, C, _>(s, &scene.lights, by, escaped, lookups)
            }
        {
            if let Some(learned) = learned {
                let (from, d) = (&self.scattered_from, self.rays.direction);
                pdf = learned.pdfs_environment(s, &scene.lights, from, d, pdf, escaped);
            }
            let weight = power_heuristic(s, self.scattered_pdf, pdf);
            let found = (self.throughput * sky).scaled(weight);
            self.radiance = (self.radiance + found).or_where_not(Mask::of_bits(s, escaped), self.radiance);
            if let Some(counted) = &mut counted {
                counted.light(s, self.number, found, self.scatterings_left(s, view), escaped);
            }
        }
        if let Some(counted) = &mut counted {
            counted.end(Cause::Escaped, self.number, max_element(self.throughput), escaped);
        }
        alive &= hits.found;
        if alive == 0 {
            return 0;
        }
        let outlook = match learned {
            Some(learned) => learned.outlooks(s, &self.rays, &hits, alive),
            None => ViewpointLanes::none(s).outlook,
        };
        let primitive = hits.primitive;
        let part = scene.geometry.part_numbers::<S, C>(primitive, instance);
        let placed = if has::<C>(Feature::Instances) { !instance.is(NO_INSTANCE).bits() & alive } else { 0 };
        if let Some(counted) = &mut counted {
            let first = self.bounces.is(0).bits() & alive;
            if first != 0 {
                counted.land(scene, &self.number.store(), &part.store(), first);
            }
        }
        let surface = lanes.parts(part);
        let geometric = hits.normal;
        let wo = -self.rays.direction;
        let at = At { primitive, instance, u: hits.u, v: hits.v };
        if C::TEXTURED {
            let inside = self.absorption.any().bits() & alive;
            if inside != 0 {
                self.throughput = absorbed(s, self.throughput, self.absorption, hits.t, inside);
            }
        }

        // Light of the surface itself.
        let emissive = zero.less(surface.light_pdf_area);
        if emissive.bits() & alive != 0 {
            let mut pdf_area = surface.light_pdf_area;
            if let Some(learned) = learned {
                let (from, emissive) = (&self.scattered_from, emissive.bits() & alive);
                pdf_area = learned.pdfs_area(s, &scene.lights, from, primitive, pdf_area, emissive);
            }
            let cos = wo.dot(geometric);
            let shows = zero.less(cos) | (surface.two_sided & cos.less(zero));
            let shines = emissive & shows & Mask::of_bits(s, alive);
            let light_pdf = pdf_area * (hits.t * hits.t) / cos.abs();
            let weight = power_heuristic(s, self.scattered_pdf, light_pdf);
            let mut emission = surface.emission;
            if C::TEXTURED {
                let glowing = (surface.kind & GLOWS).is(GLOWS).bits() & shines.bits();
                if glowing != 0 {
                    emission = emissions::<S, C>(s, scene, &at, emission, glowing, lookups);
                }
            }
            let found = (self.throughput * emission).scaled(weight);
            self.radiance = (self.radiance + found).or_where_not(shines, self.radiance);
            if let Some(counted) = &mut counted {
                counted.light(s, self.number, found, self.scatterings_left(s, view), shines.bits());
            }
        }
        if C::TEXTURED {
            let unlit = Kind::Unlit.among(surface.kind).bits() & alive;
            if unlit != 0 {
                let [color, tint] = unlit_colors::<S, C>(s, scene, &at, unlit, lookups);
                let found = self.throughput * color * tint;
                self.radiance = (self.radiance + found).or_where_not(Mask::of_bits(s, unlit), self.radiance);
                if let Some(counted) = &mut counted {
                    counted.light(s, self.number, found, self.scatterings_left(s, view), unlit);
                    counted.end(Cause::Absorbed, self.number, max_element(self.throughput), unlit);
                }
                alive &= !unlit;
            }
        }
        let deepest = self.bounces.is(view.settings.max_depth).bits() & alive;
        if let Some(counted) = &mut counted {
            counted.end(Cause::DepthLimit, self.number, max_element(self.throughput), deepest);
        }
        alive &= !deepest;
        if alive == 0 {
            return 0;
        }

        // Early: these wait for nothing, and what follows waits for memory.
        let following = self.bounces + 1;
        let [u, v, light @ ..] = self.points.segment(s, following);
        let mut smooth = shading_normals(s, view, &surface, &hits);
        if placed != 0 {
            smooth = placed_normals(s, scene, (&hits, instance), smooth, placed);
        }
        let front = zero.less_equal(wo.dot(smooth));
        let mut normal = smooth.or_where_not(front, -smooth);
        if C::TEXTURED {
            let bumpy = (surface.kind & BUMPY).is(BUMPY).bits() & alive;
            if bumpy != 0 {
                normal = bumped_normals::<S, C>(s, scene, &at, [smooth, wo, normal], bumpy, lookups);
            }
        }
        let frame = FrameLanes::new(s, normal);
        let local_wo = frame.to_local(wo);
        let point = points(s, view, (&hits, instance), alive, placed);
        let mut choice = zero;
        if C::TEXTURED && Kind::Mixed.among(surface.kind).bits() & alive != 0 {
            choice = self.points.part(s, self.bounces);
        }
        let of = (part, surface.kind);
        let bsdf = BsdfLanes::new::<C>(s, (lanes, scene), of, (at, choice), (front, alive), lookups);
        let viewpoint = ViewpointLanes { p: point.p, n: frame.n, outlook };
        let mut leaves = primitive;
        if placed != 0 {
            leaves = Integers::splat(s, NONE).or_where_not(Mask::of_bits(s, placed), leaves);
        }
        let vertex = Vertex { primitive: leaves, part, geometric, frame, local_wo, point, viewpoint, bsdf };
        let lit = alive & !bsdf.speculars;
        let mut evaluated = 0;
        if lit != 0 {
            evaluated = self.add_direct_light::<C>(s, view, &vertex, lit, counted.as_deref_mut(), lookups);
        }

        // The BSDF's direction.
        let sample = bsdf.sample::<C>(s, local_wo, [u, v], alive);
        if let Some(counted) = &mut counted {
            counted.bsdfs(self.number, evaluated, alive);
            counted.end(Cause::Absorbed, self.number, max_element(self.throughput), alive & !sample.there);
        }
        alive &= sample.there;
        self.throughput = self.throughput * sample.weight;
        if C::LOBES {
            self.survival_scale = self.survival_scale * sample.eta_scale;
        }
        let at_first = self.bounces.is(0);
        if let Some(gain) = view.settings.roulette.gain
            && at_first.bits() & alive != 0
        {
            let weight = max_element(self.throughput) * self.survival_scale;
            let least = Floats::splat(s, LEAST_BASE);
            let relative = Floats::splat(s, gain) / weight.max(least);
            self.survival_scale = at_first.select(self.survival_scale * relative, self.survival_scale);
        }
        // Without what makes up for those that end.
        let throughput = self.throughput;
        let survivors = self.survivors(s, view.settings.roulette.from, alive);
        if let Some(counted) = &mut counted {
            counted.end(Cause::Roulette, self.number, max_element(throughput), alive & !survivors);
        }
        alive = survivors;

        let wi = frame.to_world(sample.wi);
        if C::TEXTURED {
            let (absorption, solid) = bsdf.absorbing();
            if solid.bits() & alive != 0 {
                // Which side the path is on goes by the surface as it is, not as it is shaded.
                let from_front = zero.less_equal(wo.dot(geometric));
                let to_front = zero.less_equal(wi.dot(geometric));
                let enters = solid & from_front.without(to_front);
                let leaves = solid & to_front.without(from_front);
                let inside = absorption.or_where_not(enters, self.absorption);
                self.absorption = inside.or_zero(Mask::splat(s, true).without(leaves));
            }
        }
        let origin = point.leave(facing(s, geometric, wi));
        self.rays = Rays { origin, direction: wi };
        (self.from, self.part) = (leaves, part);
        self.scattered_pdf = sample.pdf;
        self.scattered_cos = sample.wi.z;
        if C::LEARNED {
            self.scattered_from = viewpoint;
        }
        self.bounces = following;
        self.light = light;
        alive
    }

    /// What rays are told apart by where surfaces are not there everywhere; `shadow`: 1 for shadow rays.
    #[inline(always)]
    fn ray_keys<C: Class>(&self, s: S, shadow: u32) -> Integers<S> {
        if has::<C>(Feature::Cutouts) {
            self.points.ray_key(self.bounces.shift_left::<1>() + shadow)
        } else {
            Integers::splat(s, 0)
        }
    }

    /// What sends rays from these parts to these triangles.
    #[inline(always)]
    fn senders<'a>(&self, scene: &'a RenderScene, kind: RayKind, [part, to]: [U8; 2]) -> Senders<'a> {
        let (number, bounces) = (self.number.store(), self.bounces.store());
        Senders { scene, kind, number, part, to, bounces }
    }

    /// How many scattering events more the depth limit would allow.
    #[inline(always)]
    fn scatterings_left(&self, s: S, view: &View<'_>) -> Integers<S> {
        Integers::splat(s, view.settings.max_depth) - self.bounces
    }

    /// What the rays hit.
    #[inline(always)]
    fn hits<C: Class>(
        &self,
        s: S,
        view: &View<'_>,
        active: u32,
        known: Option<Nearest<S>>,
        counted: Option<&mut Counted<'_>>,
    ) -> (Hits<S>, Integers<S>) {
        let View { scene, few, .. } = *view;
        let in_world = Integers::splat(s, NO_INSTANCE);
        let keys = if few.is_some() { Integers::splat(s, 0) } else { self.ray_keys::<C>(s, 0) };
        let query = Query { scene, rays: &self.rays, from: self.from, keys, active };
        let told = counted.map(
            #[inline(always)]
            |counted| {
                // Camera rays leave none.
                let part = if C::TEXTURED {
                    self.part
                } else {
                    scene.geometry.part_numbers::<S, C>(self.from, in_world)
                };
                let part = part.store();
                (&mut counted.listener, self.senders(scene, RayKind::Bounce, [part, part]))
            },
        );
        if let Some(few) = few {
            return (few::hits(s, few, &query, told), in_world);
        }
        let nearest = match (known, told) {
            (Some(nearest), _) => nearest,
            (None, None) => query.nearest::<C>(s),
            (None, Some((listener, senders))) => query.nearest_counted::<C>(s, listener, &senders),
        };
        if has::<C>(Feature::Instances) {
            let placed = nearest.found & !nearest.instance.is(NO_INSTANCE).bits();
            if placed != 0 {
                let hits = tree::placed_hits(s, scene, &self.rays, nearest, placed);
                return (hits, nearest.instance);
            }
        }
        (tree::hits(s, scene, &self.rays, nearest), in_world)
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

    /// Places on lights for lanes `active`.
    #[inline(always)]
    fn light_samples<C: Class>(
        &self,
        s: S,
        view: &View<'_>,
        vertex: &Vertex<S>,
        active: u32,
        lookups: &mut [Lookups; 8],
    ) -> LightSamples<S> {
        let View { scene, lanes, .. } = *view;
        let at = (&scene.lights, &scene.geometry);
        let Vertex { frame, viewpoint, .. } = vertex;
        let p = vertex.point.p;
        let learned = view.settings.learned.filter(|_| C::LEARNED);
        if has::<C>(Feature::PunctualLights) && lanes.lights.have_points() {
            return sample_each(s, scene, learned, viewpoint, frame, self.light, active, lookups);
        }
        let Some(learned) = learned else {
            return lanes.lights.sample::<S, C, _>(s, at, p, frame, self.light, active, lookups);
        };
        let tables = (&lanes.lights, &scene.lights, &scene.geometry);
        let (light, unknown) = learned.samples(s, tables, viewpoint, frame, self.light, active);
        if unknown == 0 {
            return light;
        }
        let others = lanes.lights.sample::<S, C, _>(s, at, p, frame, self.light, unknown, lookups);
        light.with(s, unknown, others)
    }

    /// The light-sampled half of direct light. The lanes whose BSDF was evaluated for it.
    #[inline(always)]
    fn add_direct_light<C: Class>(
        &mut self,
        s: S,
        view: &View<'_>,
        vertex: &Vertex<S>,
        active: u32,
        mut counted: Option<&mut Counted<'_>>,
        lookups: &mut [Lookups; 8],
    ) -> u32 {
        let View { scene, lanes, few, .. } = *view;
        let zero = Floats::splat(s, 0.0);
        let light = self.light_samples::<C>(s, view, vertex, active, lookups);
        let evaluated = light.there;
        if evaluated == 0 {
            return 0;
        }
        let wi = vertex.frame.to_local(light.wi);
        let (f_cos, mut pdf) = vertex.bsdf.eval::<C>(s, vertex.local_wo, wi, light.there);
        let emits = zero.less(light.cos) | (light.two_sided & light.cos.less(zero));
        let emits = light.sky | light.positions | emits.bits();
        let mut emission = light.emission;
        let mut lit = light.there & emits;
        if C::TEXTURED {
            lit &= f_cos.any().bits();
        }
        if C::TEXTURED && lanes.glows && lit & !light.sky & !light.positions != 0 {
            let surfaces = lit & !light.sky & !light.positions;
            let (primitive, instance) = (light.primitive, Integers::splat(s, NO_INSTANCE));
            let kind = lanes.parts(scene.geometry.part_numbers::<S, C>(primitive, instance)).kind;
            let glowing = (kind & GLOWS).is(GLOWS).bits() & surfaces;
            let at = At { primitive, instance, u: light.uv[0], v: light.uv[1] };
            emission = emissions_of_samples::<S, C>(s, scene, &at, emission, glowing, lookups);
        }
        lit &= (f_cos.any() & emission.any()).bits();
        if lit == 0 {
            return evaluated;
        }
        let origin = vertex.point.leave(facing(s, vertex.geometric, light.wi));
        let towards = (-light.normal).or_where_not(light.cos.less(zero), light.normal);
        let target = light.point.meet(s, towards, origin);
        let mut rays = Rays { origin, direction: target - origin };
        let mut ends = [vertex.primitive, light.primitive];
        let (infinite, nothing) = (Floats::splat(s, f32::INFINITY), Integers::splat(s, NONE));
        let mut t_max = Floats::splat(s, 1.0);
        let dark;
        if let Some(few) = few {
            let keys = Integers::splat(s, 0);
            let query = Query { scene, rays: &rays, from: ends[0], keys, active: lit };
            let told = counted.as_deref_mut().map(
                #[inline(always)]
                |counted| {
                    let places = [vertex.part.store(), ends[1].store()];
                    (&mut counted.listener, self.senders(scene, RayKind::Shadow, places))
                },
            );
            dark = few::blocked(s, few, &query, ends[1], told);
        } else {
            if light.sky != 0 {
                let sky = Mask::of_bits(s, light.sky);
                rays.direction = light.wi.or_where_not(sky, rays.direction);
                t_max = sky.select(infinite, t_max);
                ends[1] = nothing.or_where_not(sky, ends[1]);
            }
            if has::<C>(Feature::PunctualLights) && light.positions != 0 {
                let positions = Mask::of_bits(s, light.positions);
                let (way, end) = way_to_positions(s, origin, light.point.p);
                // None leads to the light itself.
                lit &= !(positions.without(way.any()).bits());
                rays.direction = way.or_where_not(positions, rays.direction);
                t_max = positions.select(end, t_max);
                ends[1] = nothing.or_where_not(positions, ends[1]);
            }
            if has::<C>(Feature::PunctualLights) {
                pdf = Mask::of_bits(s, !light.delta).or_zero(pdf);
            }
            let keys = self.ray_keys::<C>(s, 1);
            let query = Query { scene, rays: &rays, from: ends[0], keys, active: lit };
            dark = match &mut counted {
                None => query.blocked::<C>(s, ends[1], t_max),
                Some(counted) => {
                    let places = [vertex.part.store(), ends[1].store()];
                    let senders = self.senders(scene, RayKind::Shadow, places);
                    query.blocked_counted::<C>(s, (ends[1], t_max), &mut counted.listener, &senders)
                }
            };
        }
        let shown = lit & !dark;
        if C::TEXTURED {
            // Of lights in the same glass; what is infinitely far away is not.
            let inside = shown & (self.absorption.any() & t_max.less(infinite)).bits();
            if inside != 0 {
                let length = rays.direction.dot(rays.direction).sqrt() * t_max;
                emission = absorbed(s, emission, self.absorption, length, inside);
            }
        }
        let weight = power_heuristic(s, light.pdf, pdf) / light.pdf;
        let direct = (f_cos * emission).scaled(weight);
        let found = self.throughput * direct;
        self.radiance = (self.radiance + found).or_where_not(Mask::of_bits(s, shown), self.radiance);
        if let Some(counted) = counted {
            let left = self.scatterings_left(s, view) - 1;
            counted.light(s, self.number, found, left, shown);
        }
        evaluated
    }
}
