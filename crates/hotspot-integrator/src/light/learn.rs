//! Light sampling that knows where it is asked from: [`Facing`] for emissive triangles, [`Windows`] for a constant
//! environment.
//!
//! Off by default: the paper's integrator chooses lights by power. When on, kernels of their own run
//! ([`Learning`](crate::class::Learning)), so that others do not pay. The estimate stays unbiased: samples are weighed
//! by the densities that they were taken with, and MIS asks for the density at the vertex that the ray left
//! ([`Viewpoint`]). Cost maps: fewer shadow rays are wasted on lights that face away or lie behind walls, so
//! `rays_shadow`, `waste` and what shadow rays visit change; everything else is as without.

use super::facing::Facing;
use super::windows::{Escape, Grid, Key, NOWHERE, Windows, bin};
use super::{LightSample, LightTarget, Lights, Surroundings};
use crate::camera::FilmCamera;
use crate::cast::{closest_hit, occluded};
use crate::class::FullClass;
use crate::geometry::Attributes;
use crate::math::{FRAC_1_PI, Frame, square_to_cosine_hemisphere};
use crate::sampler::{Dimensions, PixelSampler, SamplerKind};
use crate::scene::RenderScene;
use crate::surface::resolve;
use glam::{Vec2, Vec3};
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_bvh::{Hit, NO_INSTANCE, Ray};
use hotspot_probe::{NONE, NoProbe};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Walks: of these a sixteenth searches. On the living room four times as many bring a tenth less error. Always the same number, so that
/// a shorter or smaller render, such as a pilot of `predict`, is about what a longer one is.
const WALKS: u32 = 1 << 15;
/// Directions checked at each vertex.
const CHECKS: u32 = 4;
// Most escapes; beside them is another copy while they are sorted or gathered.
const _: () = assert!((WALKS * ((LENGTH + 1) * CHECKS + 1)) as usize * size_of::<Escape>() <= 8 << 20);
/// Scattering events of a walk, at most.
const LENGTH: u32 = 5;
/// Walks that one thread takes at a time.
const BATCH: u32 = 1 << 8;
/// Golden ratio: multiples of it modulo 1 lie far apart.
const GOLDEN: f32 = 0.618_034;

/// What was learned about a scene's lights.
#[derive(Debug, Default)]
pub(crate) struct Learned {
    pub(super) facing: Option<Facing>,
    windows: Option<Windows>,
}

/// A view of [`Windows`], or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outlook(u16);

impl Outlook {
    /// Nothing is known.
    pub(crate) const NONE: Self = Self(NOWHERE);

    /// For lanes.
    pub(super) const fn number(self) -> u32 {
        self.0 as u32
    }

    /// Of [`Outlook::number`].
    pub(super) const fn of_number(number: u32) -> Self {
        Self(number as u16)
    }
}

/// Where lights are seen from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewpoint {
    pub(super) p: Vec3,
    n: Vec3,
    outlook: Outlook,
}

impl Viewpoint {
    /// Where nothing was sampled: the camera.
    pub(crate) const NONE: Self = Self::new(Vec3::ZERO, Vec3::Z, Outlook::NONE);

    /// A surface at `p` with shading normal `n`, on the path's side.
    #[inline(always)]
    pub(crate) const fn new(p: Vec3, n: Vec3, outlook: Outlook) -> Self {
        Self { p, n, outlook }
    }
}

/// What to learn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lessons {
    /// Choose emissive triangles by where they are seen from.
    pub(crate) facing: bool,
    /// Sample a constant environment where it is seen.
    pub(crate) windows: bool,
}

impl Learned {
    /// Learns what is asked for and worth it; `None` if nothing is. Runs in the caller's thread pool; the result does not
    /// depend on the number of threads.
    pub(crate) fn new(scene: &RenderScene, camera: &FilmCamera, seed: u64, lessons: Lessons) -> Option<Self> {
        let lights = &scene.lights;
        let facing = (lessons.facing && lights.punctual.is_empty())
            .then(|| Facing::new(&lights.triangles, lights.patches.all(), &scene.geometry))
            .flatten();
        let constant = matches!(lights.environment, Surroundings::Constant(_));
        let windows = (lessons.windows && constant).then(|| learn_windows(scene, camera, seed));
        let windows = windows.filter(|windows| windows.len() > 0);
        (facing.is_some() || windows.is_some()).then_some(Self { facing, windows })
    }

    pub(super) fn has_windows(&self) -> bool {
        self.windows.is_some()
    }

    /// What is known of the directions in which the environment is seen about `p` on a surface with geometric normal `n`, turned to the
    /// path's side ([`met`]). By these, since a hit has them before its surface is looked up: what a choice reads is on its way from
    /// memory while normals and textures are.
    #[inline(always)]
    pub(crate) fn outlook<S: Simd>(&self, s: S, p: Vec3, n: Vec3) -> Outlook {
        let Some(windows) = &self.windows else { return Outlook::NONE };
        let view = windows.find(p, n);
        windows.fetch(s, view);
        Outlook(view)
    }

    /// As [`Lights::sample`]; `None`: nothing was learned about the kind of light that the numbers choose.
    #[inline(always)]
    pub(crate) fn sample(
        &self,
        lights: &Lights,
        from: &Viewpoint,
        frame: &Frame,
        u: [f32; 2],
    ) -> Option<Option<LightSample>> {
        let [mut select, v] = u;
        let share = lights.environment_probability;
        if !matches!(lights.environment, Surroundings::Nothing) {
            if select < share {
                let (Some(windows), Surroundings::Constant(radiance)) = (&self.windows, &lights.environment)
                else {
                    return None;
                };
                let (wi, pdf) = windows.sample(from.outlook.0, frame, Vec2::new(select / share, v));
                let pdf = share * pdf;
                let target = LightTarget::Environment(*radiance);
                return Some((pdf > 0.0).then_some(LightSample { wi, pdf, target }));
            }
            select = ((select - share) / (1.0 - share)).clamp(0.0, 1.0 - f32::EPSILON);
        }
        let facing = self.facing.as_ref()?;
        let chosen = facing.choose(from.p, from.n, select, v);
        let light = &lights.triangles[chosen.place.triangle as usize];
        let pdf_area = (1.0 - share) * chosen.probability * light.inverse_area;
        Some(light.sample(from.p, chosen.place.weights, pdf_area))
    }

    /// Density per area of taking a point of an emissive triangle from `from`; `by_power`: that of the choice by power.
    #[inline(always)]
    pub(crate) fn pdf_area(&self, lights: &Lights, from: &Viewpoint, primitive: u32, by_power: f32) -> f32 {
        let Some(facing) = &self.facing else { return by_power };
        let (light, probability) = facing.probability_of(from.p, from.n, primitive);
        (1.0 - lights.environment_probability) * probability * lights.triangles[light as usize].inverse_area
    }

    /// Density per solid angle of sampling the environment along `direction`; `otherwise`: that without learning.
    #[inline(always)]
    pub(crate) fn pdf_environment(
        &self,
        lights: &Lights,
        from: &Viewpoint,
        direction: Vec3,
        otherwise: f32,
    ) -> f32 {
        let Some(windows) = &self.windows else { return otherwise };
        lights.environment_probability * windows.pdf(from.outlook.0, direction, direction.dot(from.n))
    }
}

/// About where a ray met a surface, and the surface's geometric normal, on the side of the ray: as [`Learned::outlook`] wants them.
#[inline(always)]
pub(crate) fn met(ray: &Ray, hit: &Hit) -> (Vec3, Vec3) {
    let (direction, normal) = (Vec3::from_array(ray.direction), Vec3::from_array(hit.normal));
    let p = Vec3::from_array(ray.origin) + direction * hit.t;
    (p, if direction.dot(normal) <= 0.0 { normal } else { -normal })
}

/// In a room few rays get out by chance, one in thirty: so the first walks learn where windows are about, and the others check
/// directions towards them at each vertex, a quarter of them first, so that the rest knows better where to look.
fn learn_windows(scene: &RenderScene, camera: &FilmCamera, seed: u64) -> Windows {
    let grid = Grid::new(scene.bounds());
    // Sums of whole numbers do not depend on their order.
    let visits: Vec<AtomicU32> = (0..grid.keys()).map(|_| AtomicU32::new(0)).collect();
    let walk = |walks: Range<u32>, known: Option<&Windows>| -> Vec<Escape> {
        (walks.start / BATCH..walks.end / BATCH)
            .into_par_iter()
            .flat_map_iter(|batch| {
                let walks = batch * BATCH..(batch + 1) * BATCH;
                let walks = Walks { scene, camera, grid: &grid, visits: &visits, seed, walks, known };
                dispatch(scene.bvh.isa(), walks)
            })
            .collect()
    };
    let rounds = [WALKS / 16, WALKS / 4, WALKS];
    let mut escapes = walk(0..rounds[0], None);
    let mut windows = Windows::new(grid.clone(), &mut escapes, &visits);
    for round in rounds.windows(2) {
        escapes.extend(walk(round[0]..round[1], Some(&windows)));
        windows = Windows::new(grid.clone(), &mut escapes, &visits);
    }
    windows
}

/// Walks from the camera that scatter by the cosine wherever a surface is not specular, and note escapes.
struct Walks<'a> {
    scene: &'a RenderScene,
    camera: &'a FilmCamera,
    grid: &'a Grid,
    /// Vertices so far, by key.
    visits: &'a [AtomicU32],
    seed: u64,
    walks: Range<u32>,
    /// Where to look for the environment besides, at each vertex.
    known: Option<&'a Windows>,
}

impl WithSimd for Walks<'_> {
    type Output = Vec<Escape>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Escape> {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut escapes = Vec::new();
                // One sequence for all walks; its key lies outside of those of pixels.
                let points = PixelSampler::new(SamplerKind::Sobol, u32::MAX, u32::MAX, 0, self.seed);
                for walk in self.walks.clone() {
                    self.walk(simd, &points.sample(u64::from(walk)), &mut escapes);
                }
                escapes
            },
        )
    }
}

impl Walks<'_> {
    #[inline(always)]
    fn walk<S: Simd>(&self, simd: S, sampler: &crate::sampler::Sampler<'_>, escapes: &mut Vec<Escape>) {
        let scene = self.scene;
        let [x, y, mut to_light @ ..] = sampler.get(Dimensions::segment(0));
        let (origin, mut direction) = self.camera.ray(x, y);
        let mut ray = Ray::new(origin.to_array(), direction.to_array());
        // The surface that the ray left by the cosine, if by that: its key, and that cosine's density and the other.
        let mut left: Option<(Key, f32, f32)> = None;
        let mut from = NONE;
        for bounce in 0..=LENGTH {
            let Some(hit) = closest_hit::<S, _, FullClass>(simd, scene, &ray, from, sampler, bounce, NoProbe)
            else {
                // A cosine of 0 has no density to weigh.
                if let Some((key, cosine, looked)) = left
                    && cosine > 0.0
                {
                    escapes.push(Escape::new(key, bin(direction), cosine / (cosine + looked)));
                }
                return;
            };
            let leaves = if hit.instance == NO_INSTANCE { hit.primitive } else { NONE };
            let surface = scene.geometry.surface(hit.instance, hit.primitive);
            let material = &scene.materials[surface.part.material as usize];
            let wo = -direction;
            let smooth = scene.geometry.normal(surface, &hit);
            let front = wo.dot(smooth) >= 0.0;
            let frame = Frame::new(if front { smooth } else { -smooth });
            let choice = sampler.get(Dimensions::choices(bounce))[2];
            let bsdf = resolve::<_, FullClass>(
                scene,
                &material.bsdf,
                &Attributes::NONE,
                front,
                choice,
                &mut NoProbe,
            );
            let [u, v, next_to_light @ ..] = sampler.get(Dimensions::segment(bounce + 1));
            let point = scene.geometry.point(surface, hit.u, hit.v);
            let geometric = Vec3::from_array(hit.normal);
            let (met_at, turned) = met(&ray, &hit);
            let leave = |direction: Vec3| {
                let side = if direction.dot(geometric) < 0.0 { -geometric } else { geometric };
                Ray::new(point.leave(side).to_array(), direction.to_array())
            };
            if bsdf.is_specular() {
                left = None;
                let Some(sample) = bsdf.sample(frame.to_local(wo), u, Vec2::new(u, v)) else { return };
                direction = frame.to_world(sample.wi);
            } else {
                let key = self.grid.key(met_at, turned);
                self.visits[self.grid.index(key)].fetch_add(1, Relaxed);
                let local = square_to_cosine_hemisphere(Vec2::new(u, v));
                direction = frame.to_world(local);
                let mut looked = 0.0;
                if let Some(known) = self.known {
                    let view = known.find(met_at, turned);
                    let many = CHECKS as f32;
                    for check in 0..CHECKS {
                        let u = (to_light[0] + check as f32 / many).fract();
                        let v = (to_light[1] + check as f32 * GOLDEN).fract();
                        let (there, density) = known.sample(view, &frame, Vec2::new(u, v));
                        let cosine = FRAC_1_PI * there.dot(frame.n);
                        let ends = [leaves, NONE];
                        let ray = leave(there);
                        if cosine > 0.0
                            && !occluded::<S, _, FullClass>(simd, scene, &ray, ends, sampler, bounce, NoProbe)
                        {
                            escapes.push(Escape::new(key, bin(there), cosine / (cosine + many * density)));
                        }
                    }
                    looked = many * known.pdf(view, direction, local.z);
                }
                left = Some((key, FRAC_1_PI * local.z, looked));
            }
            to_light = next_to_light;
            ray = leave(direction);
            from = leaves;
        }
    }
}
