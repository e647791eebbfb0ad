//! Cost where rays land: paths whose cost is booked on the surfaces that they meet (`hotspot_cost::surface` says what is booked
//! where), from the camera or from many viewpoints.
//!
//! A pass of its own, so that renders pay nothing for it; the paths are the render's own, ray by ray.

mod mesh;
mod views;

pub use mesh::{MeshError, MeshPart, SurfaceMesh};
pub use views::viewpoints;

use crate::camera::FilmCamera;
use crate::cast::closest_hit;
use crate::class::{FullClass, Learning};
use crate::path::{PathSettings, Start, trace};
use crate::render::{Control, Progress, Settings, Stop};
use crate::sampler::{Dimensions, PixelSampler, Sampler, hash};
use crate::scene::RenderScene;
use glam::Vec3;
use hotspot_bvh::Ray;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_cost::surface::{SurfaceCounts, SurfaceSums};
use hotspot_probe::{NONE, NoProbe, Probe, RayKind, RayProbe, Spawner};
use hotspot_scene::Camera;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Where paths begin.
#[derive(Clone, Copy, Debug)]
pub enum BakeView<'a> {
    /// At the camera: the paths of a render with the same settings.
    Camera(&'a Camera),
    /// At points in the world, in all directions alike: each sample of each pixel belongs to one of the points.
    Points(&'a [[f32; 3]]),
}

/// What was booked.
#[derive(Debug)]
pub struct Baked {
    /// At the vertices of the mesh.
    pub sums: SurfaceSums,
    /// Of rays that left the scene.
    pub escaped: SurfaceCounts,
    /// Paths traced.
    pub paths: u64,
    /// Samples of each pixel.
    pub samples: u32,
    /// Seconds of sampling.
    pub seconds: f64,
    /// Why it ended.
    pub stop: Stop,
}

/// Samples of each pixel between two questions whether to go on.
const WAVE: u64 = 4;

/// Traces the paths of `settings` (size, samples, depth, roulette, seed, sampler, light choice; the rest does not matter) and books
/// their cost on `mesh`, which must be made of `scene`. Runs in the caller's rayon pool; the result does not depend on the number of threads.
///
/// # Panics
/// When width, height or spp is 0, or there is no viewpoint.
pub fn bake(
    scene: &RenderScene,
    mesh: &SurfaceMesh,
    view: BakeView<'_>,
    settings: &Settings,
    control: Control<'_>,
) -> Baked {
    assert!(settings.spp > 0 && settings.width > 0 && settings.height > 0, "no paths to trace");
    let start = Instant::now();
    let film = match view {
        BakeView::Camera(camera) => Some(settings.film_camera(camera)),
        BakeView::Points(points) => {
            assert!(!points.is_empty(), "no viewpoint");
            None
        }
    };
    let guides = settings.guides(scene, film.as_ref());
    let sums = SurfaceSums::new(mesh.vertex_count());
    let escaped = [const { AtomicU64::new(0) }; 3];
    let kernel = BakeKernel {
        scene,
        mesh,
        sums: &sums,
        film,
        points: match view {
            BakeView::Points(points) => points,
            BakeView::Camera(_) => &[],
        },
        settings,
        path: settings.path(true, &guides),
    };
    let (rows, columns) = (u64::from(settings.height), u64::from(settings.width));
    let total = rows * columns * u64::from(settings.spp);
    let taken = AtomicU64::new(0);
    let mut done = 0u64;
    let mut stop = Stop::Done;
    while done < u64::from(settings.spp) {
        if done > 0 && control.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            stop = Stop::Cancelled;
            break;
        }
        let samples = done..(done + WAVE).min(settings.spp.into());
        done = samples.end;
        (0..settings.height).into_par_iter().for_each(|y| {
            let count = samples.end - samples.start;
            let row = BakeRow { kernel: &kernel, y, samples: samples.clone() };
            let counts = dispatch(scene.bvh.isa(), row);
            for (sum, count) in escaped.iter().zip([counts.rays, counts.nodes, counts.shapes]) {
                sum.fetch_add(count, Ordering::Relaxed);
            }
            let done = taken.fetch_add(columns * count, Ordering::Relaxed) + columns * count;
            if let Some(progress) = control.progress {
                progress(Progress { done, total, elapsed: start.elapsed() });
            }
        });
    }
    let [rays, nodes, shapes] = escaped.map(AtomicU64::into_inner);
    Baked {
        sums,
        escaped: SurfaceCounts { rays, nodes, shapes },
        paths: rows * columns * done,
        samples: done as u32,
        seconds: start.elapsed().as_secs_f64(),
        stop,
    }
}

/// Values at the vertices of a mesh as the camera sees them: interpolated where the ray through each pixel's middle lands, 0 where it
/// lands nowhere. Runs in the caller's rayon pool.
///
/// # Panics
/// When there are fewer values than vertices.
pub fn surface_view(
    scene: &RenderScene,
    mesh: &SurfaceMesh,
    values: &[f32],
    camera: &Camera,
    (width, height): (u32, u32),
) -> Vec<f32> {
    assert!(values.len() >= mesh.vertex_count(), "a value for each vertex");
    let film = FilmCamera::new(camera, f64::from(width) / f64::from(height));
    let mut out = vec![0.0; width as usize * height as usize];
    out.par_chunks_mut(width.max(1) as usize).enumerate().for_each(|(y, row)| {
        dispatch(scene.bvh.isa(), ViewRow { scene, mesh, values, film, y: y as u32, height, row });
    });
    out
}

struct ViewRow<'a> {
    scene: &'a RenderScene,
    mesh: &'a SurfaceMesh,
    values: &'a [f32],
    film: FilmCamera,
    y: u32,
    height: u32,
    row: &'a mut [f32],
}

impl WithSimd for ViewRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let width = self.row.len() as u32;
        for (x, out) in (0..).zip(self.row) {
            let (origin, direction) = self.film.ray_of((x, self.y), [0.5; 2], (width, self.height));
            let ray = Ray::new(origin.to_array(), direction.to_array());
            let pixel = PixelSampler::new(crate::SamplerKind::Sobol, x, self.y, 0, 0);
            let hit =
                closest_hit::<S, _, FullClass>(simd, self.scene, &ray, NONE, &pixel.sample(0), 0, NoProbe);
            let Some(hit) = hit else { continue };
            let (vertices, [u, v]) = self.mesh.locate(hit.instance, hit.primitive, [hit.u, hit.v]);
            let [a, b, c] = vertices.map(|vertex| self.values[vertex as usize]);
            *out = a * (1.0 - u - v) + b * u + c * v;
        }
    }
}

/// What all rows share.
struct BakeKernel<'a> {
    scene: &'a RenderScene,
    mesh: &'a SurfaceMesh,
    sums: &'a SurfaceSums,
    film: Option<FilmCamera>,
    points: &'a [[f32; 3]],
    settings: &'a Settings,
    path: PathSettings<'a>,
}

impl BakeKernel<'_> {
    /// Origin and direction of a sample's first ray.
    fn first_ray(&self, x: u32, y: u32, index: u64, [u, v]: [f32; 2]) -> (Vec3, Vec3) {
        let size = (self.settings.width, self.settings.height);
        if let Some(film) = &self.film {
            return film.ray_of((x, y), [u, v], size);
        }
        // The points take turns over a pixel's samples, from one that the pixel chooses.
        let turn = u64::from(hash(x, hash(y, self.settings.seed as u32))) + index;
        let point = self.points[(turn % self.points.len() as u64) as usize];
        // The film is the sphere, areas alike (Archimedes).
        let (across, down) = ((x as f32 + u) / size.0 as f32, (y as f32 + v) / size.1 as f32);
        let z = 1.0 - 2.0 * down;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * across);
        (Vec3::from_array(point), Vec3::new(r * sin, z, r * cos))
    }
}

struct BakeRow<'a> {
    kernel: &'a BakeKernel<'a>,
    y: u32,
    samples: core::ops::Range<u64>,
}

impl WithSimd for BakeRow<'_> {
    type Output = SurfaceCounts;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> SurfaceCounts {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { kernel, y, samples } = self;
                let settings = kernel.settings;
                let mut probe = BakeProbe::new(kernel.mesh, kernel.sums);
                for x in 0..settings.width {
                    let pixel = PixelSampler::new(settings.sampler, x, y, 0, settings.seed);
                    for index in samples.clone() {
                        let sampler: Sampler<'_> = pixel.sample(index);
                        let [u, v, light @ ..] = sampler.get(Dimensions::segment(0));
                        let ray = kernel.first_ray(x, y, index, [u, v]);
                        // Draws any scene; without lessons as the other classes do.
                        trace::<S, _, Learning<FullClass>, false>(
                            simd,
                            kernel.scene,
                            &kernel.path,
                            Start::new(ray, light),
                            &sampler,
                            &mut probe,
                        );
                        probe.book();
                    }
                }
                probe.escaped
            },
        )
    }
}

/// Books what a path costs where its rays land.
struct BakeProbe<'a> {
    mesh: &'a SurfaceMesh,
    sums: &'a SurfaceSums,
    /// Instance, primitive and weights where the last ray landed.
    at: Option<(u32, u32, [f32; 2])>,
    /// Of the last ray and of the shadow ray from where it landed.
    cost: SurfaceCounts,
    escaped: SurfaceCounts,
}

impl<'a> BakeProbe<'a> {
    fn new(mesh: &'a SurfaceMesh, sums: &'a SurfaceSums) -> Self {
        let none = SurfaceCounts::default();
        Self { mesh, sums, at: None, cost: none, escaped: none }
    }

    /// The last ray's account is closed.
    fn book(&mut self) {
        let cost = core::mem::take(&mut self.cost);
        match self.at.take() {
            Some((instance, primitive, weights)) => {
                let (vertices, weights) = self.mesh.locate(instance, primitive, weights);
                self.sums.land(vertices, weights, &cost);
            }
            None => self.escaped.add(&cost),
        }
    }
}

impl Probe for BakeProbe<'_> {
    const ON: bool = true;
    type Ray<'p>
        = BakeRay<'p>
    where
        Self: 'p;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> BakeRay<'_> {
        if by.kind != RayKind::Shadow {
            self.book();
            self.cost.rays = 1;
        }
        BakeRay { cost: &mut self.cost, nodes: 0, shapes: 0 }
    }

    fn untraced(&mut self, _by: Spawner) {}

    fn bsdf(&mut self, _evaluations: u32) {}

    fn texture(&mut self, _lookups: u32, _bytes: u32) {}

    #[inline(always)]
    fn landed(&mut self, instance: u32, primitive: u32, weights: [f32; 2]) {
        self.at = Some((instance, primitive, weights));
    }
}

struct BakeRay<'p> {
    cost: &'p mut SurfaceCounts,
    nodes: u64,
    shapes: u64,
}

impl RayProbe for BakeRay<'_> {
    #[inline(always)]
    fn node(&mut self, _id: u32, _boxes: u32) {
        self.nodes += 1;
    }

    #[inline(always)]
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.shapes += u64::from(shapes);
    }

    fn instance(&mut self, _id: u32) {}

    fn alpha(&mut self, _lookups: u32, _bytes: u32) {}

    #[inline(always)]
    fn finish(self, _hit: bool) {
        self.cost.nodes += self.nodes;
        self.cost.shapes += self.shapes;
    }
}
