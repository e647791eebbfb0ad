//! Light sampling that knows where it is asked from: [`Facing`] for emissive triangles, [`Windows`] for a constant
//! environment.
//!
//! Off by default: the paper's integrator chooses lights by power. When on, kernels of their own run
//! ([`Learning`](crate::class::Learning)), so that others do not pay. The estimate stays unbiased: samples are weighed
//! by the densities that they were taken with, and MIS asks for the density at the vertex that the ray left
//! ([`Viewpoint`]). Cost maps: fewer shadow rays are wasted on lights that face away or lie behind walls, so
//! `rays_shadow`, `waste` and what shadow rays visit change; everything else is as without.

use super::facing::Facing;
use super::windows::{Grid, NOWHERE, Windows, bin};
use super::{LightSample, LightTarget, Lights, Surroundings};
use crate::camera::FilmCamera;
use crate::cast::closest_hit;
use crate::class::FullClass;
use crate::geometry::Attributes;
use crate::math::{Frame, square_to_cosine_hemisphere};
use crate::sampler::{Dimensions, PixelSampler, SamplerKind};
use crate::scene::RenderScene;
use crate::surface::resolve;
use glam::{Vec2, Vec3};
use hotspot_bvh::Ray;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_probe::NoProbe;
use rayon::prelude::*;
use std::ops::Range;

/// Walks to learn from, at most; there is one per pixel of a small picture.
const WALKS: u32 = 1 << 17;
/// Surfaces that a walk visits, at most.
const LENGTH: u32 = 5;
/// Walks that one thread takes at a time.
const BATCH: u32 = 1 << 12;

/// What was learned about a scene's lights.
#[derive(Debug, Default)]
pub(crate) struct Learned {
    facing: Option<Facing>,
    windows: Option<Windows>,
}

/// Where lights are seen from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viewpoint {
    p: Vec3,
    n: Vec3,
    /// What [`Windows`] knows there.
    windows: u32,
}

impl Viewpoint {
    /// Where nothing was sampled: the camera.
    pub(crate) const NONE: Self = Self { p: Vec3::ZERO, n: Vec3::Z, windows: NOWHERE };
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

    /// A surface at `p` with shading normal `n`, on the path's side.
    #[inline(always)]
    pub(crate) fn viewpoint(&self, p: Vec3, n: Vec3) -> Viewpoint {
        let windows = self.windows.as_ref().map_or(NOWHERE, |windows| windows.find(p, n));
        Viewpoint { p, n, windows }
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
                let wi = windows.sample(from.windows, frame, Vec2::new(select / share, v));
                let pdf = share * windows.pdf(from.windows, wi, wi.dot(frame.n));
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
        lights.environment_probability * windows.pdf(from.windows, direction, direction.dot(from.n))
    }
}

fn learn_windows(scene: &RenderScene, camera: &FilmCamera, seed: u64) -> Windows {
    let grid = Grid::new(scene.bounds());
    let isa = scene.bvh.isa();
    let escaped: Vec<(u32, u32)> = (0..WALKS / BATCH)
        .into_par_iter()
        .flat_map_iter(|batch| {
            let walks = batch * BATCH..(batch + 1) * BATCH;
            dispatch(isa, Walks { scene, camera, grid: &grid, seed, walks })
        })
        .collect();
    Windows::new(grid, &escaped)
}

/// Walks from the camera that scatter by the cosine wherever a surface is not specular, and note escapes.
struct Walks<'a> {
    scene: &'a RenderScene,
    camera: &'a FilmCamera,
    grid: &'a Grid,
    seed: u64,
    walks: Range<u32>,
}

impl WithSimd for Walks<'_> {
    type Output = Vec<(u32, u32)>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<(u32, u32)> {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut escaped = Vec::new();
                // One sequence for all walks; its key lies outside of those of pixels.
                let points = PixelSampler::new(SamplerKind::Sobol, u32::MAX, u32::MAX, 0, self.seed);
                for walk in self.walks.clone() {
                    self.walk(simd, &points.sample(u64::from(walk)), &mut escaped);
                }
                escaped
            },
        )
    }
}

impl Walks<'_> {
    #[inline(always)]
    fn walk<S: Simd>(&self, simd: S, sampler: &crate::sampler::Sampler<'_>, escaped: &mut Vec<(u32, u32)>) {
        let scene = self.scene;
        let [x, y, ..] = sampler.get(Dimensions::segment(0));
        let (origin, mut direction) = self.camera.ray(x, y);
        let mut ray = Ray::new(origin.to_array(), direction.to_array());
        let mut left = None;
        for bounce in 0..=LENGTH {
            let Some(hit) = closest_hit::<S, _, FullClass>(simd, scene, &ray, sampler, bounce, NoProbe)
            else {
                if let Some(key) = left {
                    escaped.push((key, bin(direction) as u32));
                }
                return;
            };
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
            let [u, v, ..] = sampler.get(Dimensions::segment(bounce + 1));
            let local = if bsdf.is_specular() {
                left = None;
                let Some(sample) = bsdf.sample(frame.to_local(wo), u, Vec2::new(u, v)) else { return };
                sample.wi
            } else {
                square_to_cosine_hemisphere(Vec2::new(u, v))
            };
            let point = scene.geometry.point(surface, hit.u, hit.v);
            if !bsdf.is_specular() {
                left = Some(self.grid.key(point.p, frame.n));
            }
            direction = frame.to_world(local);
            let geometric = Vec3::from_array(hit.normal);
            let side = if direction.dot(geometric) < 0.0 { -geometric } else { geometric };
            ray = Ray::new(point.leave(side).to_array(), direction.to_array());
        }
    }
}
