//! Patches: exact densities, nothing torn, and the same light as from triangles by themselves.

use super::facing::Facing;
use super::sampling_tests::{check, scene};
use super::{LightTarget, Lights};
use crate::chi_square::{Random, Suite, p_value};
use crate::class::FullClass;
use crate::math::Frame;
use crate::scene::RenderScene;
use core::f64::consts::{PI, TAU};
use glam::{DVec3, Vec2, Vec3};
use hotspot_bvh::BuildOptions;
use hotspot_probe::NoProbe;
use hotspot_scene::{Color, Instance, Material, Mesh, Object, Scene};

/// An emissive mesh, an object by itself.
fn add(scene: &mut Scene, positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>, radiance: f32) {
    let i = scene.objects.len() as u32;
    scene.meshes.push(Mesh { positions, triangles, ..Mesh::default() });
    let emission = Color::constant([radiance, 0.5 * radiance, 0.0]);
    scene.materials.push(Material { emission, double_sided: true, ..Material::default_matte("light") });
    scene.objects.push(Object { name: format!("light {i}") });
    let to_world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    scene.instances.push(Instance { object: i, mesh: i, material: i, to_world });
}

fn one(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Scene {
    let mut scene = Scene::default();
    add(&mut scene, positions.to_vec(), triangles.to_vec(), 1.0);
    scene
}

/// The same with each triangle an object of its own, so that nothing is merged.
fn apart(together: &Scene) -> Scene {
    let mut apart = Scene::default();
    for (mesh, material) in together.meshes.iter().zip(&together.materials) {
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| mesh.positions[i as usize]);
            add(&mut apart, corners.to_vec(), vec![[0, 1, 2]], material.emission.factor[0]);
        }
    }
    apart
}

fn prepared(scene: &Scene) -> RenderScene {
    RenderScene::prepare(scene, BuildOptions::default()).unwrap()
}

fn lights(scene: &Scene) -> Lights {
    prepared(scene).lights
}

fn facing(scene: &RenderScene) -> Option<Facing> {
    Facing::new(&scene.lights.triangles, scene.lights.patches.all(), &scene.geometry)
}

/// A sphere of parallels and meridians.
fn sphere(rows: u32, columns: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for i in 0..=rows {
        for j in 0..=columns {
            let (theta, phi) = (PI * f64::from(i) / f64::from(rows), TAU * f64::from(j) / f64::from(columns));
            let p = DVec3::new(theta.sin() * phi.cos(), 1.5 * theta.cos(), theta.sin() * phi.sin());
            positions.push((p + DVec3::new(0.0, 0.0, 3.0)).as_vec3().to_array());
        }
    }
    let mut triangles = Vec::new();
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: u32, j: u32| i * (columns + 1) + j;
            if i > 0 {
                triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            }
            if i + 1 < rows {
                triangles.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    (positions, triangles)
}

/// A square of squares at height 2.
fn grid(n: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let positions = (0..(n + 1) * (n + 1))
        .map(|i| [(i % (n + 1)) as f32 / n as f32 - 0.5, (i / (n + 1)) as f32 / n as f32 - 0.5, 2.0])
        .collect();
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let cells = (0..n * n).map(|k| (k / n, k % n));
    let triangles = cells
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    (positions, triangles)
}

const SQUARE: [[f32; 3]; 4] = [[-1.0, -1.0, 2.0], [0.7, -1.2, 2.1], [1.1, 0.9, 1.9], [-0.6, 1.1, 1.8]];

/// Name, scene, and how many patches it has.
fn scenes() -> Vec<(&'static str, Scene, usize)> {
    let mut two_materials = Scene::default();
    add(&mut two_materials, SQUARE.to_vec(), vec![[0, 1, 2]], 1.0);
    add(&mut two_materials, SQUARE.to_vec(), vec![[0, 2, 3]], 3.0);
    let mut kite = SQUARE;
    // Across the diagonal at the same distance from it, but folded and not a parallelogram.
    kite[0] = [0.0, 0.0, 2.0];
    kite[1] = [1.5, -1.0, 2.0];
    kite[2] = [1.0, 0.0, 2.0];
    kite[3] = [0.3, 0.6, 2.8];
    let mut oblong = SQUARE;
    oblong[3] = [-3.0, 2.5, 1.5];
    let (ball, faces) = sphere(12, 16);
    let (plate, cells) = grid(6);
    vec![
        ("a parallelogram", one(&SQUARE, &[[0, 1, 2], [0, 2, 3]]), 1),
        ("windings that differ", one(&SQUARE, &[[2, 0, 1], [0, 3, 2]]), 1),
        ("the same turned over", one(&SQUARE, &[[1, 2, 0], [0, 2, 3]]), 1),
        ("one against the other", one(&SQUARE, &[[1, 0, 2], [3, 0, 2]]), 1),
        ("a folded kite of equal halves", one(&kite, &[[0, 1, 2], [0, 2, 3]]), 1),
        ("unequal halves", one(&oblong, &[[0, 1, 2], [0, 2, 3]]), 2),
        ("two materials", two_materials, 2),
        ("a ball", one(&ball, &faces), 0),
        ("a plate", one(&plate, &cells), 36),
    ]
}

#[test]
fn equal_neighbours_are_paired() {
    for (name, scene, expected) in scenes() {
        let patches = lights(&scene).patches.len();
        assert!(expected == 0 || patches == expected, "{name}: {patches}");
        let triangles: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        assert_eq!(lights(&apart(&scene)).patches.len(), triangles, "{name} apart");
    }
}

/// Every triangle and each part of it, against the density that MIS asks for: 10^6 samples each, rate of any false alarm 1 %.
#[test]
fn patches_follow_the_density_of_their_triangles() {
    let mut suite = Suite::new();
    for (name, scene, _) in scenes() {
        check(&mut suite, name, &scene, Vec3::new(0.1, 0.2, 0.0), Vec3::Z, 6);
    }
    suite.finish();
}

/// The choice by where lights are seen from takes each triangle as often as MIS is told: 10^6 samples each, rate of any false alarm
/// 1 %. One lamp that is flat has no such choice.
#[test]
fn facing_patches_follow_the_density_of_their_triangles() {
    const SAMPLES: usize = 1_000_000;
    let mut suite = Suite::new();
    let mut asked = 0;
    for (name, mut scene, _) in scenes() {
        match name {
            "a plate" => assert!(facing(&prepared(&scene)).is_none()),
            "a ball" | "two materials" => assert!(facing(&prepared(&scene)).is_some(), "{name}"),
            _ => {}
        }
        // Another lamp, below: two groups.
        let below = SQUARE.map(|[x, y, z]| [x - 3.0, y, z - 4.0]);
        add(&mut scene, below.to_vec(), vec![[0, 2, 1], [0, 2, 3]], 2.0);
        let prepared = prepared(&scene);
        let Some(facing) = facing(&prepared) else { panic!("{name}") };
        let (p, n) = (Vec3::new(0.1, 0.2, 0.0), Vec3::new(0.1, -0.2, 1.0).normalize());
        let probability = |l: &super::LightTriangle| facing.probability_of(p, n, l.primitive);
        let expected: Vec<f64> = prepared
            .lights
            .triangles
            .iter()
            .enumerate()
            .map(|(i, light)| {
                let (index, probability) = probability(light);
                assert_eq!(index as usize, i);
                f64::from(probability)
            })
            .collect();
        let sum: f64 = expected.iter().sum();
        assert!((sum - 1.0).abs() < 1e-4, "{name}: {sum}");
        let mut random = Random(11);
        let mut observed = vec![0; expected.len()];
        for _ in 0..SAMPLES {
            let chosen = facing.choose(p, n, random.single(), random.single());
            observed[chosen.place.triangle as usize] += 1;
            let told = expected[chosen.place.triangle as usize];
            assert!((f64::from(chosen.probability) / told - 1.0).abs() < 1e-4, "{name}");
        }
        let expected: Vec<f64> = expected.iter().map(|e| e / sum * SAMPLES as f64).collect();
        suite.add(name.to_owned(), p_value(&observed, &expected));
        asked += 1;
    }
    assert_eq!(asked, 9);
    suite.finish();
}

/// Irradiance at a point, with its standard error.
fn irradiance(scene: &Scene, seed: u64) -> (f64, f64) {
    const SAMPLES: usize = 200_000;
    let lights = lights(scene);
    let frame = Frame::new(Vec3::new(0.1, -0.2, 1.0).normalize());
    let mut random = Random(seed);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..SAMPLES {
        let u = [random.single(), random.single()];
        let p = Vec3::new(0.1, 0.2, 0.0);
        let sample = lights.sample::<_, FullClass, true>(p, &frame, u, &mut NoProbe);
        let Some(sample) = sample else { continue };
        let LightTarget::Surface { primitive, .. } = sample.target else { continue };
        // Of one material, or apart, in the order of the triangles.
        let of = |m: &Mesh| m.triangles.len();
        let mut object = 0;
        let mut left = primitive as usize;
        while left >= of(&scene.meshes[object]) {
            left -= of(&scene.meshes[object]);
            object += 1;
        }
        let radiance = f64::from(scene.materials[object].emission.factor[0]);
        let value = radiance * f64::from(sample.wi.dot(frame.n).max(0.0)) / f64::from(sample.pdf);
        sum += value;
        squares += value * value;
    }
    let mean = sum / SAMPLES as f64;
    (mean, ((squares / SAMPLES as f64 - mean * mean) / SAMPLES as f64).sqrt())
}

/// Merged or not, the same light: nine pairs of estimates, 4σ each, rate of any false alarm 6e-4. (Visibility does not matter
/// to it.)
#[test]
fn merged_and_separate_triangles_shine_alike() {
    for (i, (name, scene, _)) in scenes().into_iter().enumerate() {
        let (a, sa) = irradiance(&scene, 2 * i as u64 + 1);
        let (b, sb) = irradiance(&apart(&scene), 2 * i as u64 + 2);
        assert!(sa < 0.01 * a && (a - b).abs() < 4.0 * sa.hypot(sb), "{name}: {a} ± {sa}, apart {b} ± {sb}");
    }
}

fn place(lights: &Lights, u: f32, v: f32) -> Vec3 {
    let frame = Frame::new(Vec3::Z);
    let sample = lights.sample::<_, FullClass, true>(Vec3::ZERO, &frame, [u, v], &mut NoProbe).unwrap();
    let LightTarget::Surface { point, .. } = sample.target else { unreachable!("there are only triangles") };
    point.p
}

/// The unit square is laid upon a parallelogram by an affine map, whichever way its triangles turn and begin.
#[test]
fn a_parallelogram_is_not_torn() {
    let corners = [[-1.0f32, -1.0, 2.0], [1.0, -1.5, 2.5], [1.5, 0.5, 2.0], [-0.5, 1.0, 1.5]];
    for turn in 0..3 {
        for (first, second) in [([0, 1, 2], [0, 2, 3]), ([1, 2, 0], [2, 0, 3]), ([0, 1, 3], [1, 2, 3])] {
            let mut second: [u32; 3] = second;
            second.rotate_left(turn);
            let lights = lights(&one(&corners, &[first, second]));
            let origin = place(&lights, 0.001, 0.001);
            let [along, across] =
                [(0.998, 0.001), (0.001, 0.998)].map(|(u, v)| place(&lights, u, v) - origin);
            for k in 0..1024u16 {
                let at = Vec2::new(f32::from(k % 32) + 0.5, f32::from(k / 32) + 0.5) / 32.0;
                let there = (at - 0.001) / 0.997;
                let expected = origin + along * there.x + across * there.y;
                let found = place(&lights, at.x, at.y);
                assert!(found.distance(expected) < 1e-4, "{turn} {at}: {found} for {expected}");
            }
        }
    }
}

/// Numbers that are near each other lie near each other on the lamp: of 8 × 8 cells of the square, the points of each keep
/// within a fraction of the lamp. Two random points of the ball are 1.5 apart on average, of the plate 0.52.
#[test]
fn cells_of_the_square_are_places_of_the_lamp() {
    let (ball, faces) = sphere(24, 32);
    let (plate, cells) = grid(24);
    for (name, scene, most) in [("ball", one(&ball, &faces), 0.5), ("plate", one(&plate, &cells), 0.09)] {
        let lights = lights(&scene);
        let mut random = Random(7);
        let mut sum = 0.0;
        for k in 0..64u8 {
            for _ in 0..100 {
                let mut number = |i: u8| (f32::from(i) + random.single()) / 8.0;
                let [a, b] = [0; 2].map(|_| place(&lights, number(k % 8), number(k / 8)));
                sum += f64::from(a.distance(b)) / 6400.0;
            }
        }
        assert!(sum < most, "{name}: {sum}");
    }
}

/// The triangles of `scene` of the neighbouring tests are objects, which stay what they were.
#[test]
fn objects_are_not_merged() {
    let half = |d: f32| [[d, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
    let lights =
        lights(&scene(&[(half(0.0), 1.0), ([[1.0, 1.0, 2.0], [0.0, 1.0, 2.0], [1.0, 0.0, 2.0]], 1.0)]));
    assert_eq!(lights.patches.len(), 2);
}
