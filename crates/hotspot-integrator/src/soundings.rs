//! A few more paths through some pixels, counted and booked apart from the render: what its hotspots are explained from.

use crate::kernel::{Kernel, Lost, TileJob};
use crate::payers::Booking;
use crate::render::Settings;
use crate::scene::RenderScene;
use hotspot_bvh::simd::dispatch;
use hotspot_cost::hotspots::{MaterialKind, Sounding};
use hotspot_cost::ledger::Ledger;
use hotspot_cost::{Frame, FrameDesc, Rect};
use hotspot_scene::{Bsdf, Camera};
use rayon::prelude::*;

/// Independent parts of each sounding.
const PARTS: u64 = 4;
/// Paths that a part aims at.
const PATHS: u64 = 1024;
/// Most samples of a pixel in a part.
const MOST_SAMPLES: u64 = 16;
/// A seed of its own: hotspots were chosen by the cost of the render's own paths, which is above their mean by chance too.
const SEED: u64 = 0x5eed_50f7_c0de_d0e5;

/// Traces paths through each region (indices of pixels, row by row from the top) in four independent parts, in the rayon pool
/// of the caller: about 4096 paths of the first sample numbers of another seed, fewer for regions of under 64 pixels. Depth,
/// roulette, sampler and lights are those of the render; pixels outside the frame are left out.
///
/// # Panics
/// When width or height is 0.
pub fn sound(
    scene: &RenderScene,
    camera: &Camera,
    settings: &Settings,
    regions: &[Vec<u32>],
) -> Vec<Vec<Sounding>> {
    let booking = Booking::new(scene);
    let payers = &booking.payers;
    let camera = settings.film_camera(camera);
    let guides = settings.guides(scene, Some(&camera));
    let kernel = Kernel {
        scene,
        camera,
        width: settings.width,
        height: settings.height,
        path: settings.path(true, &guides),
        sampler: settings.sampler,
        seed: settings.seed ^ SEED,
        halves: 1,
        counted: PARTS * MOST_SAMPLES,
        radiance: false,
        clock: false,
        booking: Some(&booking),
        lanes: None,
        counted_in_eights: false,
        packets: true,
    };
    let frame = Frame::new(FrameDesc { tile: 1, ..FrameDesc::new(1, 1) });
    let names: Vec<String> = scene.material_names().map(str::to_owned).collect();
    let isa = scene.bvh.isa();
    let jobs: Vec<(&Vec<u32>, u64)> =
        regions.iter().flat_map(|region| (0..PARTS).map(move |part| (region, part))).collect();
    let parts: Vec<Sounding> = jobs
        .par_iter()
        .map(|(region, part)| {
            let mut sounding = Sounding::default();
            let mut ledger = Ledger::new(payers);
            let mut lost = Lost::default();
            let samples = PATHS.div_ceil(region.len().max(1) as u64).min(MOST_SAMPLES);
            // Evenly over large regions, each part at pixels of its own.
            let len = region.len() as u64;
            let pixels = len.min(PATHS);
            for number in 0..pixels {
                let index = region[((number * PARTS + part) * len / (pixels * PARTS)) as usize];
                let (x, y) = (index % settings.width, index / settings.width);
                if y >= settings.height {
                    continue;
                }
                let mut tile = frame.tile(Rect { x, y, width: 1, height: 1 });
                dispatch(
                    isa,
                    TileJob {
                        kernel: &kernel,
                        tile: &mut tile,
                        samples: part * samples..(part + 1) * samples,
                        plan: None,
                        lost: &mut lost,
                        ledger: Some(&mut ledger),
                    },
                );
                sounding.add(&tile);
            }
            sounding.ledgers = ledger.rows(payers, scene.objects(), &names);
            sounding
        })
        .collect();
    parts.chunks(PARTS as usize).map(<[Sounding]>::to_vec).collect()
}

/// Below this roughness a surface reflects nearly as a mirror does.
const SMOOTH: f32 = 0.3;

fn material_kind(bsdf: &Bsdf) -> MaterialKind {
    match bsdf {
        Bsdf::Matte { .. } | Bsdf::Unlit { .. } => MaterialKind::Matte,
        Bsdf::Mirror { .. } => MaterialKind::Smooth,
        Bsdf::Substrate { roughness, .. } | Bsdf::RoughMetal { roughness, .. } => {
            if roughness.factor < SMOOTH { MaterialKind::Smooth } else { MaterialKind::Rough }
        }
        Bsdf::Glass { .. } => MaterialKind::Glass,
        Bsdf::Mix { base, other, .. } => match (material_kind(base), material_kind(other)) {
            (MaterialKind::Smooth, _) | (_, MaterialKind::Smooth) => MaterialKind::Smooth,
            (MaterialKind::Glass, _) | (_, MaterialKind::Glass) => MaterialKind::Glass,
            _ => MaterialKind::Rough,
        },
    }
}

impl RenderScene {
    /// How each material scatters, by id.
    pub fn material_kinds(&self) -> Vec<MaterialKind> {
        self.materials.iter().map(|material| material_kind(&material.bsdf)).collect()
    }

    /// Objects that emit.
    pub fn emitting_objects(&self) -> Vec<u32> {
        let parts = self.geometry.parts.iter().filter(|part| part.light_pdf_area > 0.0);
        let mut objects: Vec<u32> = parts.map(|part| part.object).collect();
        objects.sort_unstable();
        objects.dedup();
        objects
    }

    /// Least and greatest corner of each object in the world, by id; `None` for objects without triangles. Those of instances
    /// hold the corners of their mesh's box.
    pub fn object_bounds(&self) -> Vec<Option<[[f32; 3]; 2]>> {
        let geometry = &self.geometry;
        let mut bounds: Vec<Option<[[f32; 3]; 2]>> = vec![None; self.objects().len()];
        let mut grow = |object: u32, point: [f32; 3]| {
            let [min, max] = bounds[object as usize].get_or_insert([point; 2]);
            for axis in 0..3 {
                min[axis] = min[axis].min(point[axis]);
                max[axis] = max[axis].max(point[axis]);
            }
        };
        for (triangle, part) in geometry.triangles.iter().zip(&geometry.part_of) {
            for corner in triangle {
                grow(geometry.parts[*part as usize].object, *corner);
            }
        }
        for placed in &geometry.placed {
            let corners =
                || geometry.triangles[geometry.meshes[placed.mesh as usize].clone()].iter().flatten();
            let axis = |axis: usize, pick: fn(f32, f32) -> f32| corners().map(|c| c[axis]).reduce(pick);
            let lows: Option<Vec<f32>> = (0..3).map(|i| axis(i, f32::min)).collect();
            let highs: Option<Vec<f32>> = (0..3).map(|i| axis(i, f32::max)).collect();
            let (Some(low), Some(high)) = (lows, highs) else { continue };
            for corner in 0..8 {
                let local: [f64; 3] =
                    core::array::from_fn(|i| f64::from(if corner >> i & 1 == 0 { low[i] } else { high[i] }));
                let world = placed
                    .to_world
                    .map(|row| (row[0] * local[0] + row[1] * local[1] + row[2] * local[2] + row[3]) as f32);
                grow(placed.part.object, world);
            }
        }
        bounds
    }
}
