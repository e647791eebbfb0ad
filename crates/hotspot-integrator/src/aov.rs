//! What the camera sees first: the guides that compositors and denoisers ask for, by a pass of camera rays of its own.
//!
//! The pass casts the render's own camera samples again, with the same cutouts, so that coverage agrees with the picture, and
//! counts nothing. Every value is a mean over all samples of a pixel to which a miss adds 0: values of what was hit are premultiplied
//! by coverage, and dividing by alpha undoes that.

use crate::camera::FilmCamera;
use crate::cast::closest_hit;
use crate::class::FullClass;
use crate::geometry::Attributes;
use crate::render::Settings;
use crate::sampler::{Dimensions, PixelSampler};
use crate::scene::RenderScene;
use crate::surface::bumped;
use crate::texture::{color, scalar};
use glam::{DVec3, Vec3};
use hotspot_bvh::Ray;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_cost::cryptomatte::{Coverage, RANKS, Rank, Ranks};
use hotspot_cost::{Frame, Layers};
use hotspot_probe::{NONE, NoProbe};
use hotspot_scene::{Bsdf, Camera};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// What the camera sees first in one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHit {
    /// Share of the samples that hit anything, 0..=1.
    pub alpha: f32,
    /// Reflectance at normal incidence, linear Rec.709: base colour of matte surfaces, metals, mirrors and glass, Rd (1 − Rs) + Rs of
    /// substrate, the colour shown by unlit surfaces; mixed materials in proportion. What a surface emits is not in it.
    pub albedo: [f32; 3],
    /// Shading normal (with normal maps) in world space, on the camera's side.
    pub normal: [f32; 3],
    /// Distance from the camera along the ray, in scene units.
    pub depth: f32,
    /// Coverage by objects: indices into [`RenderScene::objects`].
    pub objects: Ranks,
    /// Coverage by materials: indices into [`RenderScene::material_names`].
    pub materials: Ranks,
}

impl FirstHit {
    const NOTHING: Self = Self {
        alpha: 0.0,
        albedo: [0.0; 3],
        normal: [0.0; 3],
        depth: 0.0,
        objects: [Rank::EMPTY; RANKS],
        materials: [Rank::EMPTY; RANKS],
    };
}

/// Bytes per pixel that the layers take at most while they are made: [`FirstHit`]s, then their planes.
pub const FIRST_HIT_BYTES: u64 = 2 * size_of::<FirstHit>() as u64;

/// The first hits of the samples that `frame` holds, at most `most` of each pixel's half, row by row from the top. Runs in the caller's rayon
/// pool; the result does not depend on the number of threads. `None` when `cancel` became true.
///
/// `settings` must be those of the frame's render.
pub fn first_hits(
    scene: &RenderScene,
    camera: &Camera,
    settings: &Settings,
    frame: &Frame,
    most: u64,
    cancel: Option<&AtomicBool>,
) -> Option<Vec<FirstHit>> {
    let (width, height) = (frame.desc().width, frame.desc().height);
    let camera = settings.film_camera(camera);
    let mut hits = vec![FirstHit::NOTHING; width as usize * height as usize];
    let cancelled = || cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed));
    hits.par_chunks_mut(width as usize).enumerate().for_each(|(y, hits)| {
        if !cancelled() {
            let row = Row { scene, camera, settings, frame, most, y: y as u32, height, hits };
            dispatch(scene.bvh.isa(), row);
        }
    });
    (!cancelled()).then_some(hits)
}

/// Adds `A`, `albedo.*`, `normal.*` and `depth.Z` to `layers`.
///
/// # Panics
/// When there are not as many hits as pixels.
pub fn add_first_hits(layers: &mut Layers, hits: &[FirstHit]) {
    let mut put = |name: &str, value: &dyn Fn(&FirstHit) -> f32| {
        layers.insert(name, hits.iter().map(value).collect());
    };
    put("A", &|hit| hit.alpha);
    put("depth.Z", &|hit| hit.depth);
    for (axis, (color, direction)) in
        [("albedo.R", "normal.X"), ("albedo.G", "normal.Y"), ("albedo.B", "normal.Z")].into_iter().enumerate()
    {
        put(color, &|hit| hit.albedo[axis]);
        put(direction, &|hit| hit.normal[axis]);
    }
}

/// One row of pixels.
struct Row<'a> {
    scene: &'a RenderScene,
    camera: FilmCamera,
    settings: &'a Settings,
    frame: &'a Frame,
    most: u64,
    y: u32,
    height: u32,
    hits: &'a mut [FirstHit],
}

impl WithSimd for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { scene, camera, settings, frame, most, y, height, hits } = self;
        let width = hits.len() as u32;
        let (mut objects, mut materials) = (Coverage::default(), Coverage::default());
        for (x, out) in (0..).zip(hits) {
            let (mut samples, mut met) = (0u64, 0u64);
            let (mut albedo, mut normal, mut depth) = (DVec3::ZERO, DVec3::ZERO, 0.0f64);
            for half in 0..frame.halves() {
                let pixel = PixelSampler::new(settings.sampler, x, y, half as u32, settings.seed);
                for index in 0..samples_of(frame, x, y, half).min(most) {
                    samples += 1;
                    let sampler = pixel.sample(index);
                    let [u, v, ..] = sampler.get(Dimensions::segment(0));
                    let (origin, direction) = camera.ray_of((x, y), [u, v], (width, height));
                    let ray = Ray::new(origin.to_array(), direction.to_array());
                    let hit = closest_hit::<S, _, FullClass>(simd, scene, &ray, NONE, &sampler, 0, NoProbe);
                    let Some(hit) = hit else { continue };
                    met += 1;
                    let surface = scene.geometry.surface(hit.instance, hit.primitive);
                    objects.add(surface.part.object);
                    materials.add(surface.part.material);
                    let attributes = scene.geometry.attributes::<FullClass>(surface, hit.u, hit.v);
                    let smooth = scene.geometry.normal(surface, &hit);
                    let bumpy = if surface.part.has_tangents() {
                        bumped(scene, surface, [hit.u, hit.v], &attributes, smooth, -direction, &mut NoProbe)
                    } else if direction.dot(smooth) <= 0.0 {
                        smooth
                    } else {
                        -smooth
                    };
                    let material = &scene.materials[surface.part.material as usize];
                    albedo += reflectance(scene, &material.bsdf, &attributes).as_dvec3();
                    normal += bumpy.as_dvec3();
                    depth += f64::from(hit.t);
                }
            }
            if met > 0 {
                let n = samples as f64;
                *out = FirstHit {
                    alpha: (met as f64 / n) as f32,
                    albedo: (albedo / n).as_vec3().to_array(),
                    normal: (normal / n).as_vec3().to_array(),
                    depth: (depth / n) as f32,
                    objects: objects.finish(samples),
                    materials: materials.finish(samples),
                };
            }
        }
    }
}

/// Camera samples of a pixel's half, whatever was gathered of them.
fn samples_of(frame: &Frame, x: u32, y: u32, half: usize) -> u64 {
    let film = frame.film(x, y, half).map_or(0, |film| film.samples);
    film.max(frame.cost(x, y, half).map_or(0, |cost| cost.samples.max(cost.time_samples)))
}

/// See [`FirstHit::albedo`].
fn reflectance(scene: &RenderScene, bsdf: &Bsdf, point: &Attributes) -> Vec3 {
    let color = |c: &hotspot_scene::Color| color(&scene.textures, c, point, &mut NoProbe);
    let scalar = |s: &hotspot_scene::Scalar| scalar(&scene.textures, s, point, &mut NoProbe);
    match bsdf {
        Bsdf::Matte { reflectance: base }
        | Bsdf::Mirror { reflectance: base }
        | Bsdf::RoughMetal { f0: base, .. }
        | Bsdf::Glass { transmittance: base, .. }
        | Bsdf::Unlit { color: base } => color(base) * point.tint,
        Bsdf::Substrate { diffuse, specular, specular_weight, .. } => {
            let (diffuse, specular) =
                (color(diffuse) * point.tint, color(specular) * scalar(specular_weight));
            diffuse * (Vec3::ONE - specular) + specular
        }
        Bsdf::Mix { weight, base, other } => {
            let share = scalar(weight);
            reflectance(scene, base, point) * (1.0 - share) + reflectance(scene, other, point) * share
        }
    }
}
