//! A renderer of its own (spheres on a plane, no BVH, no triangles) feeds the recorder.
//!
//! What it shows: open a tile, open a path per camera sample, add each ray's counts by hand, end the path, and turn the
//! frame into layers, totals, hotspots and files. Run with
//! `cargo run --release -p hotspot-cost --example embed_cost -- OUTPUT_FOLDER`.
#![expect(clippy::print_stdout, reason = "an example talks to its reader")]

use hotspot_cost::{Cause, Document, Frame, FrameDesc, LayerOptions, Layers, Metric, PathEnd, hotspots};
use hotspot_probe::{NONE, RayKind, Spawner};

type Vec3 = [f64; 3];

/// (centre, radius); the object id is the index.
const SPHERES: [(Vec3, f64); 4] = [
    ([0.0, -100.5, -3.0], 100.0),
    ([-0.9, 0.0, -3.0], 0.5),
    ([0.1, 0.0, -2.6], 0.5),
    ([1.0, 0.1, -3.2], 0.6),
];
const NAMES: [&str; 4] = ["Ground", "Left ball", "Middle ball", "Right ball"];

fn add(a: Vec3, b: Vec3, scale: f64) -> Vec3 {
    [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]]
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Nearest sphere along a unit direction, and how many were tested: the foreign renderer's own "traversal".
fn intersect(origin: Vec3, direction: Vec3) -> (Option<(f64, usize)>, u32) {
    let mut nearest: Option<(f64, usize)> = None;
    for (i, (centre, radius)) in SPHERES.iter().enumerate() {
        let offset = add(origin, *centre, -1.0);
        let b = dot(offset, direction);
        let discriminant = b * b - dot(offset, offset) + radius * radius;
        let t = -b - discriminant.max(0.0).sqrt();
        if discriminant > 0.0 && t > 1e-6 && nearest.is_none_or(|(best, _)| t < best) {
            nearest = Some((t, i));
        }
    }
    (nearest, SPHERES.len() as u32)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (width, height, spp) = (160, 90, 4);
    let light = [0.48, 0.8, 0.36];
    let mut frame = Frame::new(FrameDesc::new(width, height));

    // Each tile could go to a worker of its own; they share nothing.
    for tile in frame.tiles_mut() {
        for (x, y) in tile.rect().pixels() {
            for sample in 0..spp {
                let jitter = (f64::from(sample) + 0.5) / f64::from(spp);
                let film = [
                    (f64::from(x) + jitter) / f64::from(width) * 2.0 - 1.0,
                    1.0 - (f64::from(y) + jitter) / f64::from(height) * 2.0,
                ];
                let mut direction = [film[0] * 1.2, film[1] * 0.675, -1.0];
                let length = dot(direction, direction).sqrt();
                direction = direction.map(|c| c / length);

                let mut pixel = tile.pixel(x, y, 0);
                let mut path = pixel.path();
                let (hit, tested) = intersect([0.0; 3], direction);
                path.add_ray(Spawner::CAMERA, 0, tested, hit.is_some());
                let mut radiance = 0.0;
                let mut first_object = NONE;
                let mut cause = Cause::Escaped;
                if let Some((t, object)) = hit {
                    first_object = object as u32;
                    cause = Cause::DepthLimit;
                    let p = add([0.0; 3], direction, t);
                    let (centre, radius) = SPHERES[object];
                    let normal = add(p, centre, -1.0).map(|c| c / radius);
                    let cos = dot(normal, light);
                    // A shadow ray counts where it could bring light.
                    if cos > 0.0 {
                        let (blocker, tested) = intersect(p, light);
                        let by = Spawner {
                            object: first_object,
                            material: first_object,
                            bounce: 0,
                            kind: RayKind::Shadow,
                            light: NONE,
                        };
                        path.add_ray(by, 0, tested, blocker.is_some());
                        if blocker.is_none() {
                            radiance = cos;
                        }
                    }
                } else {
                    radiance = 0.3;
                }
                path.end(PathEnd { cause, throughput: 1.0, brought_radiance: radiance > 0.0, first_object });
                tile.film_mut(x, y, 0).add([radiance as f32; 3]);
            }
        }
    }

    let options = LayerOptions::default();
    let layers = Layers::from_frame(&frame, &options);
    let mut document = Document::of_frame(&frame, &options);
    let names = NAMES.map(String::from);
    document.hotspots = hotspots::of_frame(&frame, options.model, &names, 5);
    document.verdict = hotspots::verdict(&document.hotspots);
    let rays = document.total(Metric::Rays).ok_or("rays were counted")?;
    println!("{} rays, {:.3} per path", rays.sum.as_f64(), rays.mean);
    println!("{}", document.verdict);

    if let Some(folder) = std::env::args_os().nth(1) {
        let folder = std::path::Path::new(&folder);
        std::fs::create_dir_all(folder)?;
        let file = folder.join("embed_cost.exr");
        let header = hotspot_cost::exr_io::Header { json: document.to_json(), ..Default::default() };
        hotspot_cost::exr_io::write(&file, &layers, &header)?;
        println!(
            "wrote {}: hotspot-render report {} makes the maps and the page",
            file.display(),
            file.display()
        );
    }
    Ok(())
}
