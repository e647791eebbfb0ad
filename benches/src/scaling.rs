//! Scenes of a size that can be chosen, for curves of cost against size.

use crate::trace::soup::noise;
use hotspot_scene::{Alpha, Bsdf, Camera, Color, Instance, Material, Mesh, Object, Projection, Scene};

/// The same everywhere.
const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A closed hall with rough ground of about `triangles` triangles (at least 2), lit by a panel below the ceiling that is cut
/// into about `lights` triangles (at least 2) of the same total power.
pub fn hall(triangles: u64, lights: u64) -> Scene {
    let mut scene =
        Scene { name: format!("hall of {triangles} triangles, {lights} lights"), ..Scene::default() };
    let matte = |name: &str, emission: f32| Material {
        name: name.into(),
        bsdf: Bsdf::Matte { reflectance: Color::constant([0.7; 3]) },
        double_sided: false,
        emission: Color::constant([emission; 3]),
        alpha: Alpha::Opaque,
        normal_map: None,
    };
    scene.materials = vec![matte("stone", 0.0), matte("panel", 10.0)];
    let cells = |count: u64| ((count as f64 / 2.0).sqrt().round() as u32).max(1);
    let ground = sheet(cells(triangles), |u, v| {
        let (x, z) = (20.0 * u - 10.0, 20.0 * v - 10.0);
        [x, 0.8 * noise(0.5 * x, 0.0, 0.5 * z) + 0.05 * noise(7.0 * x, 3.0, 7.0 * z), z]
    });
    let ceiling = |height: f32, half: f32, cells: u32| {
        sheet(cells, move |u, v| [half * (1.0 - 2.0 * u), height, half * (2.0 * v - 1.0)])
    };
    let wall = |axis: usize, side: f32| {
        sheet(1, move |u, v| {
            // Seen from inside: counter-clockwise as u and v run.
            let along = side * if axis == 0 { 20.0 * v - 10.0 } else { 10.0 - 20.0 * v };
            let mut corner = [along, 11.0 * u - 2.0, along];
            corner[axis] = 10.0 * side;
            corner
        })
    };
    let panel = ceiling(8.9, 2.0, cells(lights));
    let named: [(&str, Mesh, u32); 7] = [
        ("ground", ground, 0),
        ("ceiling", ceiling(9.0, 10.0, 1), 0),
        ("wall +x", wall(0, 1.0), 0),
        ("wall -x", wall(0, -1.0), 0),
        ("wall +z", wall(2, 1.0), 0),
        ("wall -z", wall(2, -1.0), 0),
        ("panel", panel, 1),
    ];
    for (index, (name, mut mesh, material)) in (0..).zip(named) {
        mesh.name = name.into();
        scene.meshes.push(mesh);
        scene.objects.push(Object { name: name.into() });
        scene.instances.push(Instance { object: index, mesh: index, material, to_world: IDENTITY });
    }
    // From a corner at eye height, along the diagonal and a little down.
    let s = core::f64::consts::FRAC_1_SQRT_2;
    scene.cameras.push(Camera {
        name: "corner".into(),
        to_world: [[s, -0.2 * s, s, 9.0], [0.0, 0.96, 0.28, 4.0], [-s, -0.2 * s, s, 9.0]],
        projection: Projection::Perspective { yfov: 1.0, aspect: None },
    });
    scene
}

/// A square of cells × cells, two triangles each: `place` of (u, v) in 0..1.
fn sheet(cells: u32, place: impl Fn(f32, f32) -> [f32; 3]) -> Mesh {
    let at = |i: u32| i as f32 / cells as f32;
    let positions =
        (0..=cells).flat_map(|i| (0..=cells).map(move |j| (i, j))).map(|(i, j)| place(at(i), at(j)));
    let corner = |i: u32, j: u32| i * (cells + 1) + j;
    let triangles = (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))).flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)];
        [[a, b, c], [a, c, d]]
    });
    Mesh { positions: positions.collect(), triangles: triangles.collect(), ..Mesh::default() }
}

/// Least-squares slope of ln y over ln x with its standard error; `None` for fewer than three points.
pub fn exponent(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    if points.len() < 3 {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) =
        (logs.iter().map(|p| p.0).sum::<f64>() / n, logs.iter().map(|p| p.1).sum::<f64>() / n);
    let xx: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let slope = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum::<f64>() / xx;
    let left: f64 = logs.iter().map(|p| (p.1 - mean_y - slope * (p.0 - mean_x)).powi(2)).sum();
    Some((slope, (left / (n - 2.0) / xx).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hotspot_integrator::{BuildOptions, RenderScene, Settings, render};

    #[test]
    fn halls_are_closed_lit_and_as_large_as_asked() {
        for (triangles, lights) in [(1000, 2), (20_000, 500)] {
            let scene = hall(triangles, lights);
            let count = |name: &str| {
                let mesh = scene.meshes.iter().find(|m| m.name == name).expect("it is there");
                mesh.triangles.len() as f64
            };
            assert!((count("ground") / triangles as f64 - 1.0).abs() < 0.1);
            assert!((count("panel") / lights as f64 - 1.0).abs() < 0.1);
            let prepared = RenderScene::prepare(&scene, BuildOptions::default()).expect("it is whole");
            let mut settings = Settings::new(16, 16);
            settings.spp = 4;
            let frame = render(&prepared, &scene.cameras[0], &settings, Default::default()).frame;
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                assert_eq!(frame.cost_total(x, y).get(hotspot_cost::Counter::Escaped), 0, "({x}, {y})");
                assert!(frame.film(x, y, 0).expect("it is in the frame").sum[0] > 0.0, "({x}, {y})");
            }
        }
    }

    #[test]
    fn exponents_of_powers() {
        let (slope, error) = exponent(&[(1.0, 3.0), (2.0, 12.0), (4.0, 48.0)]).expect("three points");
        assert!((slope - 2.0).abs() < 1e-12 && error < 1e-6);
        assert_eq!(exponent(&[(1.0, 1.0), (2.0, 2.0)]), None);
    }
}
