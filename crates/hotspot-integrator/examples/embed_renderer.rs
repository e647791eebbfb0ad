//! The renderer as a library: a scene made in memory, rendered, and its cost layers read back.
//!
//! Run with `cargo run --release -p hotspot-integrator --example embed_renderer`.

#![expect(clippy::print_stdout, reason = "an example talks to its reader")]

use hotspot_cost::{LayerOptions, Layers, Metric, stats};
use hotspot_integrator::{BuildOptions, Control, Progress, RenderScene, Settings, render};
use hotspot_scene::{
    Bsdf, Camera, Color, Environment, Instance, Material, Mesh, Object, Projection, Scalar, Scene,
};

const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn quad(name: &str, corners: [[f32; 3]; 4]) -> Mesh {
    Mesh {
        name: name.into(),
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let floor = quad("floor", [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]]);
    let mirror = quad("mirror", [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 1.5, -1.0], [-1.0, 1.5, -1.0]]);
    let glossy = Material {
        bsdf: Bsdf::Substrate {
            diffuse: Color::constant([0.5, 0.2, 0.1]),
            specular: Color::constant([0.04; 3]),
            specular_weight: Scalar::constant(1.0),
            roughness: Scalar::constant(0.3),
        },
        ..Material::default_matte("glossy")
    };
    let silver = Material {
        bsdf: Bsdf::Mirror { reflectance: Color::constant([0.9; 3]) },
        ..Material::default_matte("silver")
    };
    let scene = Scene {
        name: "embedded".into(),
        meshes: vec![floor, mirror],
        objects: ["Floor", "Mirror"].map(|name| Object { name: name.into() }).to_vec(),
        materials: vec![glossy, silver],
        instances: (0..2).map(|i| Instance { object: i, mesh: i, material: i, to_world: IDENTITY }).collect(),
        cameras: vec![Camera {
            name: "camera".into(),
            to_world: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.8], [0.0, 0.0, 1.0, 3.0]],
            projection: Projection::Perspective { yfov: 0.8, aspect: None },
        }],
        environment: Some(Environment::Constant([1.0; 3])),
        ..Scene::default()
    };

    let prepared = RenderScene::prepare(&scene, BuildOptions::default())?;
    let mut settings = Settings::new(120, 80);
    settings.spp = 16;
    settings.intervals = true;
    let progress = |p: Progress| {
        if p.done == p.total {
            println!("{} camera samples taken", p.done);
        }
    };
    // Runs in the rayon pool of the caller.
    let rendered = render(
        &prepared,
        &scene.cameras[0],
        &settings,
        Control { progress: Some(&progress), ..Control::default() },
    );

    let options = LayerOptions::default();
    let layers = Layers::from_frame(&rendered.frame, &options);
    let total = stats::total(&rendered.frame, Metric::Intersection, options.model);
    println!("intersection cost per path: {:.3}, 95 % interval {:?}", total.mean, total.ci95);
    let red = layers.plane("R").ok_or("radiance was gathered")?;
    let rays = layers.metric(Metric::Rays).ok_or("rays were counted")?;
    let middle = 40 * 120 + 60;
    println!("the pixel in the middle: red {:.3}, {:.2} rays per path", red[middle], rays[middle]);
    Ok(())
}
