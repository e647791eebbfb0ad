//! Eight paths at once give the pictures and counts of single paths, bit for bit.

mod everything;

use crate::chi_square::Random;
use crate::render::{Control, Gather, LightChoice, Rendered, Settings, Way, render_somehow};
use crate::roulette::Roulette;
use crate::sampler::SamplerKind;
use crate::scene::{PrepareOptions, RenderScene};
use crate::{BuildOptions, Isa};
use hotspot_cost::CostPixel;
use hotspot_scene::{
    Camera, Channel, Color, Environment, Instance, Material, Mesh, NormalMap, Object, Projection, Scalar,
    Scene, Texture, TextureRef, Wrap,
};

/// The sides of a box that is skewed and turned a little, where `open` does not leave one out.
fn sides(at: [f64; 3], size: [f64; 3], skew: f64, open: usize) -> Mesh {
    let mut mesh = Mesh::default();
    for side in (0..6).filter(|side| *side != open) {
        let (axis, far) = (side / 2, side % 2);
        let first = mesh.positions.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let mut p = [0.0; 3];
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (far as f64, u, v);
            let [x, y, z] = [0, 1, 2].map(|i| at[i] + size[i] * p[i]);
            mesh.positions.push([x + skew * z, y + skew * x * z, z - skew * x].map(|c| c as f32));
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// A room that is open towards the camera, what stands in it, and lamps.
fn room(seed: u64, scale: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::default();
    let to_world = [[scale, 0.0, 0.0, 0.3 * scale], [0.0, scale, 0.0, 0.0], [0.0, 0.0, scale, -scale]];
    let mut add = |name: &str, mesh: Mesh, color: [f32; 3], emission: [f32; 3], double_sided: bool| {
        let index = scene.meshes.len() as u32;
        let matte = Material::default_matte(name);
        scene.materials.push(Material {
            bsdf: hotspot_scene::Bsdf::Matte { reflectance: Color::constant(color) },
            emission: Color::constant(emission),
            double_sided,
            ..matte
        });
        scene.objects.push(Object { name: name.into() });
        scene.meshes.push(mesh);
        scene.instances.push(Instance { object: index, mesh: index, material: index, to_world });
    };
    let skew = if seed.is_multiple_of(2) { 0.0 } else { 0.02 };
    add("room", sides([0.0; 3], [1.0; 3], skew, 5), [0.7, 0.6, 0.5], [0.0; 3], true);
    let mut rounded = sides([0.2, 0.1, 0.3], [0.2, 0.3, 0.2], 0.1, 6);
    // Normals of its own, unlike the surface's, some of no length.
    rounded.normals = Some(
        rounded
            .positions
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let [x, y, z] = [0, 1, 2].map(|k| p[k] - [0.3, 0.25, 0.4][k]);
                let length = (x * x + y * y + z * z).sqrt();
                if i == 5 { [0.0; 3] } else { [x / length, y / length, z / length] }
            })
            .collect(),
    );
    add("rounded", rounded, [0.2, 0.8, 0.4], [0.0; 3], true);
    add("black", sides([0.6, 0.0, 0.5], [0.2, 0.4, 0.1], 0.05, 2), [0.0, 0.9, 0.0], [0.0; 3], true);
    let mut flat = |corners: &[[f64; 3]]| {
        let jitter = 0.01 * random.unit();
        let positions = corners.iter().map(|p| p.map(|x| (x + jitter) as f32)).collect();
        let triangles = (2..corners.len() as u32).map(|i| [0, i, i - 1]).collect();
        Mesh { positions, triangles, ..Mesh::default() }
    };
    let quad = flat(&[[0.3, 0.95, 0.3], [0.6, 0.95, 0.3], [0.6, 0.95, 0.6], [0.3, 0.95, 0.6]]);
    add("lamp", quad, [0.4; 3], [9.0, 8.0, 7.0], false);
    if !seed.is_multiple_of(3) {
        let triangle = flat(&[[0.05, 0.3, 0.4], [0.05, 0.4, 0.5], [0.1, 0.3, 0.5]]);
        add("triangle", triangle, [0.1; 3], [0.0, 30.0, 5.0], true);
    }
    if seed % 3 > 1 {
        let strip =
            flat(&[[0.9, 0.2, 0.2], [0.9, 0.25, 0.2], [0.9, 0.25, 0.9], [0.9, 0.22, 0.95], [0.9, 0.2, 0.9]]);
        add("strip", strip, [0.0; 3], [1.0, 2.0, 50.0], true);
    }
    scene
}

fn camera(scale: f64, parallel: bool) -> Camera {
    Camera {
        name: "camera".into(),
        to_world: [
            [1.0, 0.0, 0.13, 0.8 * scale],
            [0.0, 1.0, 0.15, 0.5 * scale],
            [-0.13, -0.15, 1.0, 1.2 * scale],
        ],
        projection: if parallel {
            Projection::Orthographic { xmag: 0.5 * scale, ymag: 0.5 * scale }
        } else {
            Projection::Perspective { yfov: 0.8, aspect: None }
        },
    }
}

fn prepare(scene: &Scene, isa: Isa) -> RenderScene {
    let options = PrepareOptions::from(BuildOptions { isa, ..BuildOptions::default() });
    RenderScene::prepare(scene, options).expect("the scene is whole")
}

/// What a render counts, but for its time, with ledgers and without: path by path and with paths side by side.
fn counts_agree(name: &str, ready: &RenderScene, settings: &Settings, camera: &Camera) {
    counts_of_kind_agree(name, ready, settings, camera, true);
    counts_of_kind_agree(name, ready, settings, camera, false);
}

/// Without ledgers the clock is off too.
fn counts_of_kind_agree(
    name: &str,
    ready: &RenderScene,
    settings: &Settings,
    camera: &Camera,
    ledgers: bool,
) {
    // At once, and some by some, so that few of a pixel go with those of others.
    let spp = settings.spp.max(17).next_multiple_of(2);
    let first_wave = Some(if ledgers { spp } else { 3 });
    let of = |packets| {
        let gather = Gather { time: ledgers, ..Gather::ALL };
        let settings = Settings { packets, gather, spp, ledgers, first_wave, ..settings.clone() };
        let rendered = render(ready, camera, &settings, Control::default());
        assert_eq!(rendered.eights, packets, "{name}");
        let costs = rendered.frame.costs().map(|pixel| {
            // With some samples counted the clock of single paths reads all.
            assert!(settings.cost_spp.is_some() || !ledgers || pixel.time_samples == pixel.samples, "{name}");
            CostPixel { time_ns: 0, time_samples: 0, ..*pixel }
        });
        (sums(&rendered), costs.collect::<Vec<_>>(), format!("{:?}", rendered.ledgers))
    };
    let (eights, single) = (of(true), of(false));
    assert!(eights.0 == single.0, "{name}: the pictures of counted paths differ");
    for (index, (a, b)) in eights.1.iter().zip(&single.1).enumerate() {
        assert_eq!(a, b, "{name}, pixel or half {index}");
    }
    assert_eq!(eights.2, single.2, "{name}");
}

/// With paths eight at a time wherever they can be, in plain Rust too.
fn render(scene: &RenderScene, camera: &Camera, settings: &Settings, control: Control<'_>) -> Rendered {
    render_somehow(scene, camera, settings, control, Way { tile: 16, portable_eights: true })
}

/// Film sums of all pixels.
fn sums(rendered: &Rendered) -> Vec<([f64; 3], [f64; 3])> {
    let frame = &rendered.frame;
    let film = |(x, y)| {
        let film = frame.film_total(x, y);
        (film.sum, film.squares)
    };
    frame.pixels().map(film).collect()
}

fn settings(spp: u32) -> Settings {
    let mut settings = Settings::new(37, 23);
    settings.spp = spp;
    settings.gather = Gather::RADIANCE;
    settings
}

/// Rooms large and small, seen in perspective and in parallel, with each kind of roulette, any number of lamps, halves, adaptive, and
/// with some samples counted.
#[test]
fn pictures_are_those_of_single_paths() {
    let mut bright = 0;
    for seed in 0..6u64 {
        let scale = [1.0, 1.0, 0.01, 300.0][seed as usize % 4];
        let scene = room(seed, scale);
        let mut wanted = settings(19);
        wanted.seed = seed;
        match seed {
            0 => wanted.roulette = Roulette::Off,
            1 => wanted.roulette = Roulette::Efficient,
            2 => (wanted.intervals, wanted.spp) = (true, 18),
            3 => (wanted.adaptive, wanted.spp) = (true, 33),
            4 => {
                (wanted.gather, wanted.cost_spp) = (Gather::ALL, Some(11));
                wanted.ledgers = true;
            }
            _ => (wanted.max_depth, wanted.roulette) = (3, Roulette::From(0)),
        }
        let camera = camera(scale, seed == 5);
        let mut pictures = Vec::new();
        for isa in [Isa::Auto, Isa::Portable] {
            let ready = prepare(&scene, isa);
            for packets in [true, false] {
                let settings = Settings { packets, ..wanted.clone() };
                let rendered = render(&ready, &camera, &settings, Control::default());
                assert_eq!(rendered.eights, packets, "room {seed}");
                pictures.push(sums(&rendered));
            }
            counts_agree(&format!("room {seed}"), &ready, &wanted, &camera);
        }
        let [first, others @ ..] = &pictures[..] else { unreachable!() };
        bright += first.iter().filter(|(sum, _)| sum[0] > 0.0).count();
        for (index, other) in others.iter().enumerate() {
            let differ = first.iter().zip(other).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "room {seed}, way {index}");
        }
    }
    assert!(bright > 2000, "{bright} pixels are lit");
}

/// No depth, one sample, and so many that lists end within a pixel.
#[test]
fn lists_of_any_length_are_taken() {
    let scene = room(1, 1.0);
    let ready = prepare(&scene, Isa::Auto);
    // Beyond 2^16 samples points are of another block, which lanes leave to single paths.
    let cases = [(1, 0, (37, 23)), (1, 15, (1, 1)), (5000, 2, (2, 1)), (3, 4, (16, 16)), (65_600, 1, (1, 1))];
    for (spp, depth, size) in cases {
        let mut wanted = settings(spp);
        (wanted.width, wanted.height, wanted.max_depth) = (size.0, size.1, depth);
        wanted.first_wave = Some(spp);
        let of = |packets| {
            let settings = Settings { packets, ..wanted.clone() };
            render(&ready, &camera(1.0, false), &settings, Control::default())
        };
        let (eights, single) = (of(true), of(false));
        assert!(eights.eights && !single.eights);
        assert_eq!(sums(&eights), sums(&single), "{spp} samples, depth {depth}");
        let halves = Settings { intervals: true, ..wanted };
        counts_agree("lists", &ready, &halves, &camera(1.0, false));
    }
}

/// Corners whose normals differ in the signs of zeros alone: the shading frame goes by those.
#[test]
fn signs_of_zeros_in_normals_count() {
    let mut scene = room(0, 1.0);
    let to_world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let floor = scene.meshes[0].positions.len();
    let mut normals = vec![[0.0, 0.0, 1.0]; floor];
    for corners in scene.meshes[0].triangles.clone() {
        let [a, b, c] = corners.map(|i| scene.meshes[0].positions[i as usize]);
        let axis = (0..3).find(|i| a[*i] == b[*i] && a[*i] == c[*i]).expect("walls lie along axes");
        for (place, corner) in corners.into_iter().enumerate() {
            let zero = if place == 0 { -0.0 } else { 0.0 };
            let mut normal = [zero; 3];
            // Placing would turn other zeros positive.
            normal[axis] = -1.0;
            normals[corner as usize] = normal;
        }
    }
    scene.meshes[0].normals = Some(normals);
    scene.meshes[1].normals = None;
    for instance in &mut scene.instances {
        instance.to_world = to_world;
    }
    let ready = prepare(&scene, Isa::Auto);
    let of = |packets| {
        let settings = Settings { packets, ..settings(16) };
        render(&ready, &camera(1.0, false), &settings, Control::default())
    };
    let (eights, single) = (of(true), of(false));
    assert!(eights.eights && !single.eights);
    assert_eq!(sums(&eights), sums(&single));
}

/// Where throughput grows beyond all numbers, the same paths are lost: those that find light with it.
#[test]
fn paths_beyond_all_numbers_are_lost_alike() {
    let mut scene = room(1, 1.0);
    for material in &mut scene.materials {
        material.bsdf = hotspot_scene::Bsdf::Matte { reflectance: Color::constant([1e25; 3]) };
    }
    let ready = prepare(&scene, Isa::Auto);
    let of = |packets| {
        let settings = Settings { packets, ..settings(16) };
        let rendered = render(&ready, &camera(1.0, false), &settings, Control::default());
        (sums(&rendered), rendered.non_finite_count)
    };
    let (eights, single) = (of(true), of(false));
    assert_eq!(eights, single);
    // Some find light before it is too much.
    assert!(single.1 > 1000 && single.0.iter().any(|(sum, _)| sum[0] > 0.0), "{} lost", single.1);
}

/// The picture in lanes and path by path, with both instruction sets; whether all are the same, and how many pixels are lit.
fn agree(name: &str, scene: &Scene, settings: &Settings, camera: &Camera) -> usize {
    let mut pictures = Vec::new();
    for isa in [Isa::Auto, Isa::Portable] {
        let ready = prepare(scene, isa);
        for packets in [true, false] {
            let settings = Settings { packets, ..settings.clone() };
            let rendered = render(&ready, camera, &settings, Control::default());
            assert_eq!(rendered.eights, packets, "{name}");
            pictures.push(sums(&rendered));
        }
        counts_agree(name, &ready, settings, camera);
    }
    let [first, others @ ..] = &pictures[..] else { unreachable!() };
    for (index, other) in others.iter().enumerate() {
        let differ = first.iter().zip(other).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{name}, way {index}");
    }
    first.iter().filter(|(sum, _)| sum[0] > 0.0).count()
}

/// A ball of `2 n²` triangles with normals of its own, of which two corners have none.
fn ball(at: [f32; 3], radius: f32, n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut normals = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let (sin, cos) = (std::f32::consts::PI * i as f32 / n as f32).sin_cos();
            let (y, x) = (std::f32::consts::TAU * j as f32 / n as f32).sin_cos();
            let normal = [sin * x, cos, sin * y];
            mesh.positions.push([0, 1, 2].map(|k| at[k] + radius * normal[k]));
            normals.push(if normals.len() % 37 == 5 { [0.0; 3] } else { normal });
        }
    }
    for i in 0..n {
        for j in 0..n {
            let corner = |di, dj| (i + di) * (n + 1) + j + dj;
            mesh.triangles.push([corner(0, 0), corner(0, 1), corner(1, 0)]);
            mesh.triangles.push([corner(1, 0), corner(0, 1), corner(1, 1)]);
        }
    }
    mesh.normals = Some(normals);
    mesh
}

/// Adds a ball of some material.
fn add_ball(scene: &mut Scene, name: &str, mesh: Mesh, bsdf: hotspot_scene::Bsdf, emission: [f32; 3]) {
    let index = scene.meshes.len() as u32;
    let matte = Material::default_matte(name);
    let emission = Color::constant(emission);
    scene.materials.push(Material { bsdf, emission, ..matte });
    scene.objects.push(Object { name: name.into() });
    scene.meshes.push(mesh);
    let to_world = [[1.0, 0.0, 0.0, 0.3], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]];
    scene.instances.push(Instance {
        object: index,
        mesh: index,
        material: scene.materials.len() as u32 - 1,
        to_world,
    });
}

fn substrate(diffuse: [f32; 3], specular: f32, roughness: f32) -> hotspot_scene::Bsdf {
    hotspot_scene::Bsdf::Substrate {
        diffuse: Color::constant(diffuse),
        specular: Color::constant([specular, 0.8 * specular, specular]),
        specular_weight: Scalar::constant(0.7),
        roughness: Scalar::constant(roughness),
    }
}

/// Every material of the class, lamps of many triangles that lie in strips, and a constant sky; alone and together, with lights
/// chosen by power and as learned; in halves, adaptive, counted in part, without any depth, and with lists that end within a pixel.
#[test]
fn pictures_of_many_triangles_are_those_of_single_paths() {
    use hotspot_scene::Bsdf;
    let glass = Bsdf::Glass {
        ior: 1.5,
        thin: false,
        transmittance: Color::constant([0.9, 1.0, 0.9]),
        absorption: [0.0; 3],
    };
    let pane =
        Bsdf::Glass { ior: 1.3, thin: true, transmittance: Color::constant([0.9; 3]), absorption: [0.0; 3] };
    let metal = |roughness| Bsdf::RoughMetal {
        f0: Color::constant([0.9, 0.6, 0.3]),
        roughness: Scalar::constant(roughness),
    };
    let matte = Bsdf::Matte { reflectance: Color::constant([0.3, 0.5, 0.7]) };
    let mirror = Bsdf::Mirror { reflectance: Color::constant([0.8, 0.0, 0.8]) };
    let surfaces = [
        ("matte", matte.clone()),
        ("smooth substrate", substrate([0.5, 0.2, 0.1], 0.4, 0.0)),
        ("rough substrate", substrate([0.0, 0.2, 0.1], 1.0, 0.6)),
        ("mirror", mirror),
        ("metal", metal(0.4)),
        ("smooth metal", metal(0.0)),
        ("glass", glass),
        ("pane", pane),
    ];
    let mut lit = 0;
    for (index, (name, bsdf)) in surfaces.into_iter().enumerate() {
        let mut scene = room(index as u64, 1.0);
        add_ball(&mut scene, "ball", ball([0.55, 0.5, 0.55], 0.2, 8), bsdf.clone(), [0.0; 3]);
        // Walls of it too, so that paths come back to it.
        scene.materials[2].bsdf = bsdf;
        let mut wanted = settings(7);
        wanted.seed = index as u64;
        wanted.roulette = [Roulette::Efficient, Roulette::From(1), Roulette::Off][index % 3];
        if index % 2 == 0 {
            add_ball(&mut scene, "lamp", ball([0.75, 0.75, 0.4], 0.08, 6), matte.clone(), [20.0, 18.0, 9.0]);
            wanted.light_choice = LightChoice::Learned;
        }
        if index % 4 > 1 {
            scene.environment = Some(Environment::Constant([0.4, 0.5, 0.9]));
        }
        lit += agree(name, &scene, &wanted, &camera(1.0, index == 3));
        wanted.light_choice = LightChoice::Power;
        match index {
            1 => (wanted.intervals, wanted.spp) = (true, 8),
            2 => (wanted.adaptive, wanted.spp) = (true, 33),
            4 => {
                (wanted.gather, wanted.cost_spp) = (Gather::ALL, Some(3));
                wanted.ledgers = true;
            }
            5 => wanted.max_depth = 0,
            6 => (wanted.spp, wanted.width, wanted.height) = (3000, 3, 2),
            _ => {}
        }
        lit += agree(name, &scene, &wanted, &camera(1.0, false));
    }
    assert!(lit > 8000, "{lit} pixels are lit");
}

/// No light but a sky, a sky beside lamps, over few triangles.
#[test]
fn skies_over_few_triangles_are_taken() {
    let mut dark = room(0, 1.0);
    for material in &mut dark.materials {
        material.emission = Color::constant([0.0; 3]);
    }
    dark.environment = Some(Environment::Constant([1.0, 2.0, 3.0]));
    assert!(agree("sky", &dark, &settings(5), &camera(1.0, false)) > 500);
    let learned = Settings { light_choice: LightChoice::Learned, ..settings(5) };
    assert!(agree("windows", &dark, &learned, &camera(1.0, false)) > 500);
    let mut both = room(2, 1.0);
    both.environment = dark.environment.clone();
    assert!(agree("both", &both, &learned, &camera(1.0, false)) > 500);
}

/// What cannot be said of few triangles at once goes by the tree: those that are too many, walls that parallel rays run along, and what
/// is too far away.
#[test]
fn trees_serve_where_few_triangles_do_not() {
    let mut many = room(2, 1.0);
    let copy = many.instances[0].clone();
    many.instances.extend((0..6).map(|i| {
        let mut instance = copy.clone();
        instance.to_world[0][3] += f64::from(i) + 2.0;
        instance
    }));
    agree("many", &many, &settings(3), &camera(1.0, false));
    let mut parallel = camera(1.0, true);
    parallel.to_world = [[1.0, 0.0, 0.0, 0.8], [0.0, 1.0, 0.0, 0.5], [0.0, 0.0, 1.0, 1.2]];
    let mut far = camera(1.0, false);
    far.to_world[2][3] = 1e5;
    let scene = room(2, 1.0);
    let ready = prepare(&scene, Isa::Auto);
    for (camera, few) in [(camera(1.0, true), true), (parallel, false), (far, false)] {
        agree("few", &scene, &settings(3), &camera);
        let lanes = super::LaneScene::new(&ready, &settings(3).film_camera(&camera));
        assert_eq!(lanes.is_some_and(|lanes| lanes.few.is_some()), few);
    }
}

/// A texture of random texels, among them holes.
fn texture(scene: &mut Scene, random: &mut Random) -> TextureRef {
    let texels =
        (0..16 * 4).map(|i| if i % 4 == 3 && i % 3 == 0 { 0 } else { (random.unit() * 255.0) as u8 });
    let rgba: Vec<u8> = texels.collect();
    scene.textures.push(Texture { name: "texture".into(), width: 4, height: 4, rgba: rgba.into() });
    TextureRef {
        texture: scene.textures.len() as u32 - 1,
        wrap: [Wrap::Repeat, Wrap::Mirror],
        nearest: false,
        transform: [[2.0, 0.5, 0.1], [-0.3, 1.7, 0.2]],
        second_uvs: false,
    }
}

/// Textures on every material, colours of vertices, bumps, and surfaces that are not there everywhere, under lamps and sky.
#[test]
fn textured_pictures_are_those_of_single_paths() {
    use hotspot_scene::{Alpha, Bsdf};
    let mut lit = 0;
    for index in 0..8u64 {
        let mut random = Random(index + 99);
        let mut scene = room(index, 1.0);
        let reference = texture(&mut scene, &mut random);
        let color = Color { factor: [0.9, 0.8, 1.0], texture: Some(reference) };
        let number = |factor, channel| Scalar { factor, texture: Some((reference, channel)) };
        let bsdf = match index % 5 {
            0 => Bsdf::Matte { reflectance: color },
            1 => Bsdf::Substrate {
                diffuse: color,
                specular: Color::constant([0.3; 3]),
                specular_weight: number(1.0, Channel::B),
                roughness: number(0.7, Channel::G),
            },
            2 => Bsdf::RoughMetal { f0: color, roughness: number(0.6, Channel::R) },
            3 => Bsdf::Mirror { reflectance: color },
            _ => Bsdf::Glass { ior: 1.4, thin: index < 5, transmittance: color, absorption: [0.0; 3] },
        };
        let mut mesh = ball([0.55, 0.5, 0.55], 0.3, 8);
        mesh.uvs = Some(mesh.positions.iter().map(|[x, y, z]| [3.0 * x + z, 2.0 * y]).collect());
        if index % 2 == 0 {
            mesh.colors = Some(mesh.positions.iter().map(|[x, y, z]| [*x, *y, *z, 0.9]).collect());
        }
        let bumpy = index % 3 != 2;
        if bumpy {
            let around = |[x, y, z]: [f32; 3]| {
                let length = (z * z + x * x).sqrt().max(1e-6);
                [z / length, 0.0 * y, -x / length, if x > 0.55 { 1.0 } else { -1.0 }]
            };
            mesh.tangents = Some(mesh.normals.iter().flatten().map(|n| around(*n)).collect());
        }
        add_ball(&mut scene, "ball", mesh, bsdf, [0.0; 3]);
        let material = scene.materials.last_mut().expect("one was added");
        material.normal_map = bumpy.then_some(NormalMap { texture: reference, scale: 0.7 });
        material.alpha = match index % 3 {
            0 => Alpha::Opaque,
            1 => Alpha::Mask { cutoff: 0.4, alpha: number(1.0, Channel::A) },
            _ => Alpha::Blend { alpha: number(0.8, Channel::A) },
        };
        // Of few triangles too.
        scene.materials[1].bsdf = Bsdf::Matte { reflectance: color };
        scene.meshes[1].uvs = Some(scene.meshes[1].positions.iter().map(|[x, _, z]| [*x, *z]).collect());
        if index > 3 {
            scene.environment = Some(Environment::Constant([0.4, 0.5, 0.9]));
        }
        let mut wanted = settings(9);
        wanted.seed = index;
        wanted.light_choice = if index % 4 > 1 { LightChoice::Learned } else { LightChoice::Power };
        lit += agree(&format!("textured {index}"), &scene, &wanted, &camera(1.0, false));
        scene.instances.pop();
        lit += agree(&format!("few, textured {index}"), &scene, &wanted, &camera(1.0, false));
    }
    assert!(lit > 9000, "{lit} pixels are lit");
}

/// What goes path by path says so.
#[test]
fn other_renders_go_path_by_path() {
    let camera = camera(1.0, false);
    let goes = |scene: &Scene, settings: &Settings| {
        render(&prepare(scene, Isa::Auto), &camera, settings, Control::default()).eights
    };
    let scene = room(2, 1.0);
    let few = settings(1);
    assert!(goes(&scene, &few));
    assert!(!goes(&Scene::default(), &few), "there are no triangles");

    // Without vectors of eight, only among few triangles, and nothing that is counted.
    let portable = prepare(&scene, Isa::Portable);
    let mut many = scene.clone();
    let matte = many.materials[1].bsdf.clone();
    add_ball(&mut many, "ball", ball([0.5; 3], 0.1, 8), matte, [0.0; 3]);
    let many = prepare(&many, Isa::Portable);
    let counted = |spp| Settings { gather: Gather::ALL, spp, ..few.clone() };
    for (scene, settings, goes) in
        [(&portable, &few, true), (&portable, &counted(8), false), (&many, &few, false)]
    {
        assert_eq!(crate::render(scene, &camera, settings, Control::default()).eights, goes);
    }

    let independent = Settings { sampler: SamplerKind::Independent, ..few.clone() };
    let clocked = Settings { gather: Gather { time: true, ..Gather::RADIANCE }, ..few.clone() };
    for other in [independent, clocked] {
        assert!(!goes(&scene, &other), "{other:?}");
    }
    assert!(goes(&scene, &counted(1)));
}

/// All samples are timed, and no time is given out twice.
#[test]
fn time_is_shared_out() {
    let ready = prepare(&room(2, 1.0), Isa::Auto);
    for (spp, wave, intervals) in [(1, 1, false), (7, 3, false), (600, 600, false), (20, 4, true)] {
        let first_wave = Some(wave);
        let settings = Settings { gather: Gather::ALL, spp, first_wave, intervals, ..settings(spp) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        let rendered = pool.install(|| render(&ready, &camera(1.0, false), &settings, Control::default()));
        assert!(rendered.eights);
        let mut all = 0;
        for pixel in rendered.frame.costs() {
            assert_eq!(pixel.time_samples, pixel.samples, "{spp} samples");
            all += pixel.time_ns;
        }
        let (all, most) = (all as f64 * 1e-9, rendered.seconds);
        let least = if spp > 100 { most / 3.0 } else { 0.0 };
        assert!(all > least && all <= most, "{all} s in {most} s");
    }
}
