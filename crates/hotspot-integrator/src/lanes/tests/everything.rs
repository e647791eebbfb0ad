//! What kernels for everything know besides: mixed, absorbing and unlit surfaces, emission that varies, environment maps, lights without
//! area, instances.

use super::*;
use crate::Instancing;
use hotspot_scene::{Alpha, Bsdf, EnvironmentMap, Light, LightKind};

const PLACE: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.3], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]];

fn glass(ior: f32, thin: bool, absorption: [f32; 3]) -> Bsdf {
    Bsdf::Glass { ior, thin, transmittance: Color::constant([0.9, 1.0, 0.8]), absorption }
}

fn metal(roughness: f32) -> Bsdf {
    Bsdf::RoughMetal { f0: Color::constant([0.9, 0.6, 0.3]), roughness: Scalar::constant(roughness) }
}

fn mix(weight: Scalar, base: Bsdf, other: Bsdf) -> Bsdf {
    Bsdf::Mix { weight, base: Box::new(base), other: Box::new(other) }
}

/// With texture coordinates, colours and tangents.
fn dressed(mut mesh: Mesh) -> Mesh {
    mesh.uvs = Some(mesh.positions.iter().map(|[x, y, z]| [3.0 * x + z, 2.0 * y]).collect());
    mesh.colors = Some(mesh.positions.iter().map(|[x, y, z]| [*x, *y, *z, 0.9]).collect());
    let around = |[x, _, z]: &[f32; 3]| {
        let length = (z * z + x * x).sqrt().max(1e-6);
        [z / length, 0.0, -x / length, 1.0]
    };
    mesh.tangents = mesh.normals.as_ref().map(|normals| normals.iter().map(around).collect());
    mesh
}

/// Of this many columns and rows.
fn map(random: &mut Random, [width, height]: [u32; 2]) -> Environment {
    let texel = |i: u32| if i % 7 == 3 { [0.0; 3] } else { [0, 1, 2].map(|_| random.unit() as f32) };
    Environment::Map(EnvironmentMap {
        name: "map".into(),
        width,
        height,
        texels: (0..width * height).map(texel).collect(),
        scale: [1.0, 0.9, 1.5],
        rotation: 0.7,
    })
}

fn lights(which: u32) -> Vec<Light> {
    let kinds = [
        LightKind::Point { position: [0.8, 0.7, -0.5] },
        LightKind::Spot {
            position: [0.9, 0.9, -0.2],
            direction: [-0.3, -0.8, -0.3],
            cos_inner: 0.9,
            cos_outer: 0.6,
        },
        LightKind::Directional { direction: [-0.2, -0.4, -1.0] },
    ];
    let light = |(i, kind): (usize, LightKind)| Light {
        name: format!("light {i}"),
        kind,
        intensity: [1.0, 2.0, 0.5 + i as f32],
    };
    kinds.into_iter().enumerate().filter(|(i, _)| which >> i & 1 != 0).map(light).collect()
}

/// Each in a room of its own, with lights by power and as learned, in halves and adaptive, to some depth.
fn agree_in_all_ways(name: &str, scene: &Scene, seed: u64) -> usize {
    let mut wanted = settings(7);
    wanted.seed = seed;
    wanted.roulette = [Roulette::Efficient, Roulette::From(1), Roulette::Off][seed as usize % 3];
    wanted.light_choice = LightChoice::Learned;
    let lit = agree(name, scene, &wanted, &camera(1.0, false));
    wanted.light_choice = LightChoice::Power;
    wanted.max_depth = 5;
    match seed % 3 {
        0 => (wanted.intervals, wanted.spp) = (true, 8),
        1 => (wanted.adaptive, wanted.spp) = (true, 33),
        _ => (wanted.gather, wanted.cost_spp, wanted.ledgers) = (Gather::ALL, Some(3), true),
    }
    lit + agree(name, scene, &wanted, &camera(1.0, false))
}

#[test]
fn mixed_surfaces() {
    let mut lit = 0;
    for seed in 0..4u64 {
        let mut random = Random(seed + 7);
        let mut scene = room(seed, 1.0);
        let reference = texture(&mut scene, &mut random);
        let varying = Scalar { factor: 0.8, texture: Some((reference, Channel::B)) };
        let color = Color { factor: [0.9, 0.8, 1.0], texture: Some(reference) };
        let inner = mix(Scalar::constant(0.4), glass(1.4, seed % 2 == 0, [0.0, 2.0, 1.0]), metal(0.3));
        let mixed = match seed {
            0 => mix(varying, substrate([0.5, 0.2, 0.1], 0.4, 0.3), metal(0.2)),
            1 => mix(Scalar::constant(0.5), Bsdf::Matte { reflectance: color }, inner),
            2 => mix(varying, inner, Bsdf::Mirror { reflectance: color }),
            _ => mix(Scalar::constant(1.0), Bsdf::Matte { reflectance: color }, metal(0.0)),
        };
        add_ball(&mut scene, "ball", dressed(ball([0.55, 0.5, 0.55], 0.3, 8)), mixed.clone(), [0.0; 3]);
        scene.materials[2].bsdf = mixed;
        if seed % 2 == 1 {
            scene.environment = Some(Environment::Constant([0.4, 0.5, 0.9]));
        }
        lit += agree_in_all_ways(&format!("mixed {seed}"), &scene, seed);
        // Among few triangles.
        scene.instances.pop();
        lit += agree("few, mixed", &scene, &settings(5), &camera(1.0, false));
    }
    assert!(lit > 6000, "{lit} pixels are lit");
}

/// With a lamp and lights without area in the same glass, and a sky beyond.
#[test]
fn absorbing_glass() {
    let mut lit = 0;
    for seed in 0..3u64 {
        let mut scene = room(seed, 1.0);
        let absorbing = glass(1.3, false, [3.0, 0.5, 0.0]);
        add_ball(&mut scene, "ball", ball([0.55, 0.5, 0.55], 0.35, 8), absorbing.clone(), [0.0; 3]);
        let matte = Bsdf::Matte { reflectance: Color::constant([0.3, 0.5, 0.7]) };
        add_ball(&mut scene, "lamp", ball([0.6, 0.6, 0.5], 0.05, 6), matte, [20.0, 18.0, 9.0]);
        // One that is crossed by its shading normals alone at times.
        scene.materials[1].bsdf = absorbing;
        scene.environment = (seed > 0).then_some(Environment::Constant([0.4, 0.5, 0.9]));
        if seed == 2 {
            scene.lights = lights(7);
        }
        lit += agree_in_all_ways(&format!("absorbing {seed}"), &scene, seed);
    }
    assert!(lit > 3500, "{lit} pixels are lit");
}

#[test]
fn unlit_surfaces() {
    let mut scene = room(1, 1.0);
    let reference = texture(&mut scene, &mut Random(5));
    let color = Color { factor: [0.9, 0.8, 1.0], texture: Some(reference) };
    let unlit = Bsdf::Unlit { color };
    add_ball(&mut scene, "ball", dressed(ball([0.55, 0.5, 0.55], 0.2, 8)), unlit, [0.0; 3]);
    scene.materials[1].bsdf = Bsdf::Unlit { color: Color::constant([0.5, 0.1, 0.0]) };
    // Lamps that are unlit besides.
    scene.materials[3].bsdf = Bsdf::Unlit { color: Color::constant([0.1; 3]) };
    assert!(agree_in_all_ways("unlit", &scene, 3) > 400);
    scene.instances.pop();
    assert!(agree("few, unlit", &scene, &settings(5), &camera(1.0, false)) > 200);
}

/// Textured lamps, lamps with holes, and both.
#[test]
fn emission_that_varies() {
    for seed in 0..4u64 {
        let mut random = Random(seed);
        let mut scene = room(2, 1.0);
        let reference = texture(&mut scene, &mut random);
        let emission = Color { factor: [9.0, 8.0, 20.0], texture: Some(reference) };
        let matte = Bsdf::Matte { reflectance: Color::constant([0.3, 0.5, 0.7]) };
        add_ball(&mut scene, "lamp", dressed(ball([0.7, 0.6, 0.5], 0.2, 6)), matte, [20.0, 18.0, 9.0]);
        let material = scene.materials.last_mut().expect("one was added");
        if seed != 1 {
            material.emission = emission;
        }
        let alpha = Scalar { factor: 0.8, texture: Some((reference, Channel::A)) };
        material.alpha = match seed {
            0 => Alpha::Opaque,
            1 | 2 => Alpha::Blend { alpha },
            _ => Alpha::Mask { cutoff: 0.3, alpha },
        };
        material.double_sided = seed == 2;
        let lamp = &mut scene.meshes[3];
        lamp.uvs = Some(lamp.positions.iter().map(|[x, _, z]| [4.0 * x, 3.0 * z]).collect());
        scene.materials[3].emission = emission;
        assert!(agree_in_all_ways(&format!("glowing {seed}"), &scene, seed) > 400);
        scene.instances.pop();
        assert!(agree("few, glowing", &scene, &settings(5), &camera(1.0, false)) > 200);
    }
}

#[test]
fn environment_maps_and_lights_without_area() {
    for seed in 0..8u64 {
        let mut random = Random(seed);
        let mut scene = room(seed, 1.0);
        if seed % 2 == 0 {
            scene.environment = Some(map(&mut random, [8, 5]));
        } else if seed == 7 {
            scene.environment = Some(Environment::Constant([0.4, 0.5, 0.9]));
        }
        scene.lights = lights(seed as u32);
        if seed == 3 || seed == 4 {
            for material in &mut scene.materials {
                material.emission = Color::constant([0.0; 3]);
            }
        }
        // Near a light, and one in it.
        if seed == 5 {
            let [x, y, z] = scene.meshes[0].positions[0].map(f64::from);
            let place = PLACE.map(|row| (row[0] * x + row[1] * y + row[2] * z + row[3]) as f32);
            scene.lights[0].kind = LightKind::Point { position: place };
        }
        let metals = [metal(0.3), glass(1.5, false, [0.0; 3]), substrate([0.5, 0.2, 0.1], 0.4, 0.3)];
        let bsdf = metals[seed as usize % 3].clone();
        add_ball(&mut scene, "ball", ball([0.55, 0.5, 0.55], 0.2, 8), bsdf, [0.0; 3]);
        assert!(agree_in_all_ways(&format!("lights {seed}"), &scene, seed) > 300);
        scene.instances.pop();
        assert!(agree("few, lights", &scene, &settings(5), &camera(1.0, false)) > 150);
    }
}

/// Where columns, rows or both are so few that a look-up meets some of them twice.
#[test]
fn environment_maps_of_few_texels() {
    let mut random = Random(9);
    for (seed, size) in (0..).zip([[1, 1], [2, 1], [1, 6], [3, 2]]) {
        let mut scene = room(seed, 1.0);
        scene.environment = Some(map(&mut random, size));
        assert!(agree_in_all_ways(&format!("{size:?}"), &scene, seed) > 500);
    }
}

/// Turned, stretched, mirrored; dressed, with holes, bumps and absorption; beside triangles of the world and without any.
#[test]
fn instances() {
    for seed in 0..4u64 {
        let mut random = Random(seed);
        let mut scene = room(seed, 1.0);
        let reference = texture(&mut scene, &mut random);
        let color = Color { factor: [0.9, 0.8, 1.0], texture: Some(reference) };
        let alpha = Scalar { factor: 0.8, texture: Some((reference, Channel::A)) };
        let bsdf = match seed {
            0 => Bsdf::Matte { reflectance: Color::constant([0.3, 0.5, 0.7]) },
            1 => mix(Scalar::constant(0.5), Bsdf::Matte { reflectance: color }, metal(0.2)),
            2 => glass(1.3, false, [3.0, 0.5, 0.0]),
            _ => Bsdf::Unlit { color },
        };
        let mesh = ball([0.0; 3], 0.15, 8);
        let mesh = if seed == 0 { mesh } else { dressed(mesh) };
        add_ball(&mut scene, "ball", mesh, bsdf, [0.0; 3]);
        let material = scene.materials.last_mut().expect("one was added");
        if seed == 1 {
            material.normal_map = Some(NormalMap { texture: reference, scale: 0.7 });
            material.alpha = Alpha::Blend { alpha };
        }
        let first = scene.instances.pop().expect("one was added");
        for i in 0..5 {
            let a = 0.5 + f64::from(i);
            let size = [1.0, if i == 2 { -1.0 } else { 1.3 }, 0.8];
            let turn = [[a.cos(), 0.0, a.sin()], [0.1, 1.0, 0.0], [-a.sin(), 0.0, a.cos()]];
            let at =
                [0.45 + 0.2 * f64::from(i % 3), 0.3 + 0.15 * f64::from(i), -0.4 - 0.1 * f64::from(i % 2)];
            let mut instance = first.clone();
            instance.to_world = [0, 1, 2].map(|r| {
                let [x, y, z] = [0, 1, 2].map(|c| turn[r][c] * size[c]);
                [x, y, z, at[r]]
            });
            instance.object = i % 3;
            scene.instances.push(instance);
        }
        if seed != 3 {
            assert!(agree_placed(&format!("instances {seed}"), &scene, seed) > 300);
        }
        // Nothing but instances.
        scene.instances.drain(..first.object as usize);
        scene.environment = Some(Environment::Constant([0.4, 0.5, 0.9]));
        if seed > 1 {
            scene.environment = Some(map(&mut random, [8, 5]));
            scene.lights = lights(5);
        }
        assert!(agree_placed(&format!("instances alone {seed}"), &scene, seed) > 300);
    }
}

/// As [`agree_in_all_ways`] where meshes that appear twice are stored once.
fn agree_placed(name: &str, scene: &Scene, seed: u64) -> usize {
    let camera = camera(1.0, false);
    let mut lit = 0;
    for (isa, choice) in [(Isa::Auto, LightChoice::Power), (Isa::Portable, LightChoice::Learned)] {
        let tree = BuildOptions { isa, ..BuildOptions::default() };
        let options = PrepareOptions { tree, instancing: Instancing::Always, max_memory_bytes: None };
        let ready = RenderScene::prepare(scene, options).expect("the scene is whole");
        assert!(ready.bvh.instance_count() > 1, "{name}");
        let wanted = Settings { seed, light_choice: choice, ..settings(6) };
        let of = |packets| {
            let settings = Settings { packets, ..wanted.clone() };
            let rendered = render(&ready, &camera, &settings, Control::default());
            assert_eq!(rendered.eights, packets, "{name}");
            sums(&rendered)
        };
        let (eights, single) = (of(true), of(false));
        let differ = eights.iter().zip(&single).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{name}");
        counts_agree(name, &ready, &wanted, &camera);
        lit += eights.iter().filter(|(sum, _)| sum[0] > 0.0).count();
    }
    lit
}
