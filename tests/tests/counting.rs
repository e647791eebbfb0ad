//! Do the counters count what they are defined to count?
//!
//! Camera rays can be known exactly from outside: an orthographic camera of no extent sends the same ray for every
//! sample. Their counts must be those of the slow oracle. Everything else is held by identities: between rays and
//! vertices in scenes where both are known, and between the counters themselves in scenes of every kind.

use hotspot_bvh::{Candidate, Filter, NO_INSTANCE, Ray, RayProbe, oracle};
use hotspot_cost::{CostPixel, Counter, Frame, Metric};
use hotspot_integrator::{Gather, Instancing, RenderScene, Roulette, Settings};
use hotspot_scene::{Alpha, Bsdf, Camera, Channel, Color, Material, NormalMap, Scalar};
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::reference::own_scene;
use hotspot_tests::world::{
    IDENTITY, Random, World, bilinear, cuboid, emitting, image, light, matte, metal, mirror, nearest, panel,
    pencil, pinhole, rectangle, sphere, substrate, surface,
};

fn total(frame: &Frame) -> CostPixel {
    let mut total = CostPixel::default();
    for pixel in frame.costs() {
        for (sum, value) in total.counts.iter_mut().zip(pixel.counts) {
            *sum += value;
        }
        total.throughput += pixel.throughput;
        total.samples += pixel.samples;
    }
    total
}

/// The one ray of a pencil camera.
fn ray_of(camera: &Camera) -> Ray {
    let column = |i: usize| [0, 1, 2].map(|row| camera.to_world[row][i] as f32);
    Ray::new(column(3), column(2).map(|c| -c))
}

/// Some 40,000 triangles: balls and boxes.
fn clutter() -> World {
    let mut random = Random(9);
    let mut world = World::new().with_environment([1.0; 3]);
    for i in 0..12 {
        let at = random.point(-2.0, 2.0);
        let shape = if i % 3 == 0 {
            cuboid(at, at.map(|c| c + random.within(0.1, 1.0)), false)
        } else {
            sphere(at, random.within(0.2, 0.8), 4, false)
        };
        world = world.with(shape, matte([0.5; 3]));
    }
    world
}

#[test]
fn camera_rays_cost_what_the_oracle_says() {
    let scene = clutter().prepare();
    let mut random = Random(4);
    let (mut hits, mut nodes) = (0, 0);
    for _ in 0..300 {
        let camera = pencil(random.point(-6.0, 6.0), random.point(-2.0, 2.0));
        let (hit, counts) = oracle::closest(scene.bvh(), &ray_of(&camera));
        let rendered = frame(&scene, &camera, &settings(2, 1, 3, 0, 1));
        let sums = total(&rendered.frame);
        let samples = 6;
        assert_eq!(sums.samples, samples);
        assert_eq!(sums.get(Counter::Rays), samples);
        assert_eq!(sums.get(Counter::RaysShadow), 0);
        assert_eq!(sums.get(Counter::Nodes), samples * counts.nodes);
        assert_eq!(sums.get(Counter::Boxes), samples * counts.boxes);
        assert_eq!(sums.get(Counter::Leaves), samples * counts.leaves);
        assert_eq!(sums.get(Counter::Shapes), samples * counts.shapes);
        let end = if hit.is_some() { Counter::DepthLimit } else { Counter::Escaped };
        assert_eq!(sums.get(end), samples);
        // Σ over paths of the squares, path by path the same.
        let pixel = rendered.frame.cost_total(0, 0);
        let (n, s) = (counts.nodes as f64, counts.shapes as f64);
        assert_eq!(pixel.squares, [3.0, 3.0 * n * n, 3.0 * s * s, 3.0 * n * s]);
        hits += u32::from(hit.is_some());
        nodes += counts.nodes;
    }
    assert!((60..290).contains(&hits) && nodes > 600, "{hits} hits, {nodes} nodes: too simple a scene");
}

/// Two parallel mirrors: every path is one camera ray and one ray for each of N bounces, and no shadow ray.
#[test]
fn rays_between_mirrors_are_depth_plus_one() {
    let scene = World::new()
        .with(rectangle([0.0; 3], [50.0, 0.0, 0.0], [0.0, 50.0, 0.0]), mirror([1.0; 3]))
        .with(rectangle([0.0, 0.0, 1.0], [0.0, 50.0, 0.0], [50.0, 0.0, 0.0]), mirror([0.5; 3]))
        .with_environment([1.0; 3])
        .prepare();
    for depth in [0u64, 1, 2, 9, 30] {
        let mut settings = settings(4, 4, 2, depth as u32, 0);
        settings.roulette = Roulette::Off;
        let sums = total(&frame(&scene, &pinhole([0.0, 0.0, 0.5], [0.1, 0.0, 0.0], 20.0), &settings).frame);
        assert_eq!(sums.get(Counter::Rays), 32 * (depth + 1), "depth {depth}");
        assert_eq!((sums.get(Counter::RaysShadow), sums.get(Counter::DepthLimit)), (0, 32));
        // One sampling at each vertex but the last; nothing is evaluated towards lights.
        assert_eq!(sums.get(Counter::Bsdf), 32 * depth);
        // No path brought radiance: all of its cost is waste.
        assert_eq!(sums.get(Counter::WasteNodes), sums.get(Counter::Nodes));
        assert_eq!(sums.get(Counter::WasteShapes), sums.get(Counter::Shapes));
        // Every second mirror halves what is carried.
        let first = f64::from(0.5f32.powi(depth.div_ceil(2) as i32));
        let second = f64::from(0.5f32.powi((depth / 2) as i32));
        let mean = sums.throughput / 32.0;
        assert!(mean == first || mean == second, "depth {depth}: throughput {mean}");
    }
}

/// A closed matte box whose walls shine: from each of the N scattering vertices one shadow ray, if the chosen point of a
/// wall is not in the vertex's own plane, and one bounce.
#[test]
fn rays_in_a_closed_box() {
    let walls = emitting(matte([0.5; 3]), [1.0; 3]);
    let scene = World::new().with(cuboid([-1.0; 3], [1.0; 3], true), walls).prepare();
    let paths = 16 * 16 * 8;
    for depth in [0u64, 1, 2, 5] {
        let mut settings = settings(16, 16, 8, depth as u32, 0);
        settings.roulette = Roulette::Off;
        let sums = total(&frame(&scene, &pinhole([0.1, 0.2, 0.3], [1.0, 0.0, 0.0], 60.0), &settings).frame);
        let shadow = sums.get(Counter::RaysShadow);
        assert_eq!(sums.get(Counter::Rays) - shadow, paths * (depth + 1));
        assert_eq!(sums.get(Counter::DepthLimit), paths);
        // A wall in six is the vertex's own and sends it nothing.
        let expected = paths as f64 * depth as f64 * 5.0 / 6.0;
        let sigma = (paths as f64 * depth as f64 * 5.0 / 36.0).sqrt();
        assert!((shadow as f64 - expected).abs() <= 4.0 * sigma, "depth {depth}: {shadow} for {expected}");
        assert!((sums.throughput / paths as f64 - 0.5f64.powi(depth as i32)).abs() < 1e-12);
        // Each vertex is sampled once, and evaluated at most once.
        let bsdf = sums.get(Counter::Bsdf);
        assert!(bsdf >= paths * depth + shadow && bsdf <= 2 * paths * depth, "depth {depth}: {bsdf}");
    }
}

/// A shadow ray counts if and only if the light's pdf, its radiance and f·cos are non-zero.
#[test]
fn shadow_rays_that_cannot_matter_do_not_count() {
    let floor = || rectangle([0.0; 3], [0.0, 0.0, 3.0], [3.0, 0.0, 0.0]);
    let lamp = |down: bool| {
        let (u, v) = ([0.3, 0.0, 0.0], [0.0, 0.0, 0.3]);
        if down { rectangle([0.0, 1.0, 0.0], u, v) } else { rectangle([0.0, 1.0, 0.0], v, u) }
    };
    let below = || rectangle([0.0, -1.0, 0.0], [0.0, 0.0, 0.3], [0.3, 0.0, 0.0]);
    let shine = || light([1.0; 3]);
    let camera = pencil([2.0, 0.5, 0.3], [0.0; 3]);
    for (world, expected, what) in [
        (World::new().with(floor(), matte([0.5; 3])).with(lamp(true), shine()), 64, "lit"),
        (World::new().with(floor(), matte([0.5; 3])).with(lamp(false), shine()), 0, "turned away"),
        (World::new().with(floor(), matte([0.5; 3])).with(below(), shine()), 0, "below the horizon"),
        (World::new().with(floor(), matte([0.0; 3])).with(lamp(true), shine()), 0, "black"),
        (World::new().with(floor(), mirror([0.5; 3])).with(lamp(true), shine()), 0, "specular"),
        (World::new().with(floor(), matte([0.5; 3])).with_environment([1.0; 3]), 64, "environment"),
    ] {
        let scene = world.prepare();
        for trace_shadow_rays in [true, false] {
            let mut settings = settings(4, 4, 4, 1, 0);
            settings.gather = Gather { trace_shadow_rays, radiance: trace_shadow_rays, ..Gather::ALL };
            let sums = total(&frame(&scene, &camera, &settings).frame);
            assert_eq!(sums.get(Counter::RaysShadow), expected, "{what}, traced: {trace_shadow_rays}");
            assert!(sums.get(Counter::NodesShadow) == 0 || trace_shadow_rays);
        }
    }
}

/// Every kind of surface, light inside and outside, open on one side.
fn mixed() -> (RenderScene, Camera) {
    let world = World::new()
        .with(cuboid([-2.0, -1.0, -2.0], [2.0, 1.5, 2.0], true), matte([0.8, 0.6, 0.4]))
        .with(sphere([-0.8, -0.4, 0.0], 0.5, 3, false), mirror([0.9; 3]))
        .with(sphere([0.4, -0.4, -0.6], 0.5, 3, false), substrate([0.5; 3], 0.1, 0.3))
        .with(sphere([0.9, -0.5, 0.7], 0.4, 3, false), metal([0.9; 3], 0.3))
        .with_placed(cuboid([-0.2; 3], [0.2; 3], false), matte([0.0; 3]), IDENTITY)
        .with(rectangle([0.0, 1.4, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]), light([8.0; 3]))
        .with_environment([1.0; 3]);
    (world.prepare(), pinhole([0.2, 0.3, 1.9], [0.0, -0.3, 0.0], 70.0))
}

#[test]
fn counters_keep_their_identities() {
    let mut scenes = vec![("mixed", mixed())];
    for name in ["mirror-gap-narrow", "white-room-substrate"] {
        if let Some(scene) = own_scene(name) {
            let camera = scene.cameras[0].clone();
            let prepared = RenderScene::prepare(&scene, hotspot_integrator::BuildOptions::default());
            scenes.push((name, (prepared.unwrap(), camera)));
        }
    }
    for (name, (scene, camera)) in &scenes {
        for depth in [0u32, 1, 3, 15] {
            let frame = frame(scene, camera, &settings(40, 30, 4, depth, 2)).frame;
            for (x, y) in frame.pixels() {
                let p = frame.cost_total(x, y);
                let what = format!("{name}, depth {depth}, pixel {x}, {y}");
                let get = |c| p.get(c);
                assert_eq!((p.samples, frame.film_total(x, y).samples), (4, 4), "{what}");
                let ended = [Counter::Escaped, Counter::Absorbed, Counter::Roulette, Counter::DepthLimit];
                assert_eq!(ended.map(get).iter().sum::<u64>(), 4, "{what}");
                let [rays, shadow] = [Counter::Rays, Counter::RaysShadow].map(get);
                let traced = rays - shadow;
                assert!((4..=4 * (u64::from(depth) + 1)).contains(&traced), "{what}: {traced} rays traced");
                assert!(shadow <= traced && shadow <= 4 * u64::from(depth), "{what}: {shadow} shadow rays");
                // Each ray visits the root; a node has 1 to 8 children and a block 1 to 8 triangles.
                let [nodes, boxes, leaves, shapes] =
                    [Counter::Nodes, Counter::Boxes, Counter::Leaves, Counter::Shapes].map(get);
                assert!(nodes >= rays && (nodes..=8 * nodes).contains(&boxes), "{what}");
                assert!((leaves..=8 * leaves).contains(&shapes), "{what}");
                assert!(nodes + leaves <= boxes + rays, "{what}: visited without having been tested");
                for (all, part) in [
                    (Counter::Nodes, Counter::NodesShadow),
                    (Counter::Shapes, Counter::ShapesShadow),
                    (Counter::Boxes, Counter::BoxesShadow),
                    (Counter::Leaves, Counter::LeavesShadow),
                    (Counter::Nodes, Counter::WasteNodes),
                    (Counter::Shapes, Counter::WasteShapes),
                ] {
                    assert!(get(part) <= get(all), "{what}: {part:?}");
                }
                assert_eq!(get(Counter::Instances), 0, "{what}");
                assert_eq!(get(Counter::Texture), 0, "{what}");
                assert!(p.throughput >= 0.0 && p.throughput <= 4.0 * 1.5, "{what}: {}", p.throughput);
                if frame.film_total(x, y).sum == [0.0; 3] {
                    assert_eq!(
                        (get(Counter::WasteNodes), get(Counter::WasteShapes)),
                        (nodes, shapes),
                        "{what}"
                    );
                }
            }
        }
    }
}

/// The paper's shortcut: ray counts do not depend on whether shadow rays are traced.
#[test]
fn counting_shadow_rays_without_tracing_them() {
    let (scene, camera) = mixed();
    let with = |trace_shadow_rays: bool, radiance: bool| {
        let mut settings: Settings = settings(40, 30, 4, 15, 2);
        settings.gather = Gather { radiance, cost: true, time: false, trace_shadow_rays };
        frame(&scene, &camera, &settings).frame
    };
    let (full, short) = (with(true, true), with(false, false));
    for (x, y) in full.pixels() {
        let (a, b) = (full.cost_total(x, y), short.cost_total(x, y));
        for counter in
            [Counter::Rays, Counter::RaysShadow, Counter::Bsdf, Counter::Escaped, Counter::Roulette]
        {
            assert_eq!(a.get(counter), b.get(counter), "{counter:?} at {x}, {y}");
        }
        assert_eq!(a.get(Counter::Nodes) - a.get(Counter::NodesShadow), b.get(Counter::Nodes));
        assert_eq!(a.get(Counter::Shapes) - a.get(Counter::ShapesShadow), b.get(Counter::Shapes));
        assert_eq!(b.get(Counter::NodesShadow), 0);
    }
    assert!(total(&full).get(Counter::NodesShadow) > 0);
}

/// Deeper paths cost more; shallower ones are their beginning.
#[test]
fn cost_grows_with_depth() {
    let (scene, camera) = mixed();
    let mut before = [0; 3];
    for depth in 0..6 {
        let sums = total(&frame(&scene, &camera, &settings(24, 18, 4, depth, 2)).frame);
        let now = [Counter::Rays, Counter::Nodes, Counter::Shapes].map(|c| sums.get(c));
        assert!((0..3).all(|i| now[i] > before[i]), "depth {depth}: {now:?} after {before:?}");
        before = now;
    }
}

/// Metrics are what their counters say.
#[test]
fn metrics_follow_from_counters() {
    let (scene, camera) = mixed();
    let frame = frame(&scene, &camera, &settings(16, 12, 4, 5, 2)).frame;
    let model = hotspot_cost::CostModel { c0: 2.0, c1: 3.0 };
    let sums = total(&frame);
    let get = |c| sums.get(c);
    for (metric, expected) in [
        (Metric::Intersection, 2 * get(Counter::Nodes) + 3 * get(Counter::Shapes)),
        (Metric::IntersectionShadow, 2 * get(Counter::NodesShadow) + 3 * get(Counter::ShapesShadow)),
        (Metric::Waste, 2 * get(Counter::WasteNodes) + 3 * get(Counter::WasteShapes)),
        (Metric::Rays, get(Counter::Rays)),
    ] {
        let total = hotspot_cost::stats::total(&frame, metric, model);
        assert_eq!(total.sum, hotspot_cost::Sum::Exact(expected), "{}", metric.name());
        assert!((total.mean - expected as f64 / sums.samples as f64).abs() < 1e-9 * total.mean);
    }
}

/// A wall across z, from −1 to 1.
fn wall(z: f64) -> hotspot_scene::Mesh {
    panel([0.0, 0.0, z], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
}

fn masked(material: Material, alpha: Scalar) -> Material {
    Material { alpha: Alpha::Mask { cutoff: 0.5, alpha }, ..material }
}

fn by_alpha(at: hotspot_scene::TextureRef) -> Scalar {
    Scalar { factor: 1.0, texture: Some((at, Channel::A)) }
}

/// Texel (0, 0) is a hole, the others are there.
fn one_hole() -> hotspot_scene::Texture {
    image(2, 2, |x, y| [200, 100, 50, if x + y == 0 { 0 } else { 255 }])
}

const TEXTURE_COUNTERS: [Counter; 4] =
    [Counter::AlphaTests, Counter::Texture, Counter::TextureBytes, Counter::Bsdf];

/// One masked wall before the eye, at depth 0: an alpha test for each sample that meets it, there or not, and one look-up
/// of four texels (one where the nearest is taken). None for a constant alpha's texels, none beside the wall.
#[test]
fn alpha_tests_of_one_wall() {
    let there = ([0.5, -0.3, 5.0], [0.5, -0.3, 0.0]);
    let hole = ([-0.5, 0.3, 5.0], [-0.5, 0.3, 0.0]);
    let beside = ([1.5, 0.3, 5.0], [1.5, 0.3, 0.0]);
    for (alpha, per_test) in
        [(by_alpha(bilinear(0)), (1, 16)), (by_alpha(nearest(0)), (1, 4)), (Scalar::constant(0.7), (0, 0))]
    {
        let scene = World::new()
            .with_texture(one_hole())
            .with(wall(0.0), masked(matte([0.5; 3]), alpha))
            .with_environment([1.0; 3])
            .prepare();
        for ((from, to), tests) in [(there, 1), (hole, 1), (beside, 0)] {
            let sums = total(&frame(&scene, &pencil(from, to), &settings(3, 2, 5, 0, 1)).frame);
            let counts = TEXTURE_COUNTERS.map(|c| sums.get(c));
            let n = 30 * tests;
            assert_eq!(counts, [n, n * per_test.0, n * per_test.1, 0], "{alpha:?} from {from:?}");
            let open = tests == 0 || (per_test.0 > 0 && from == hole.0);
            assert_eq!(sums.get(Counter::Escaped), if open { 30 } else { 0 });
        }
    }
}

/// What a vertex looks up, by hand: the slots of its material, once each, in the part of a mix that was chosen; a normal
/// map; emission where the front is seen.
#[test]
fn look_ups_of_one_vertex() {
    let at = || Some(nearest(0));
    let color = || Color { factor: [1.0; 3], texture: at() };
    let scalar = || Scalar { factor: 1.0, texture: Some((nearest(0), Channel::G)) };
    let coat = || Bsdf::Substrate {
        diffuse: color(),
        specular: color(),
        specular_weight: scalar(),
        roughness: scalar(),
    };
    let texel = |r: u8| image(1, 1, |_, _| [r, 255, 255, 255]);
    let mix = |weight: f32, base: Bsdf, other: Bsdf| {
        let weight = Scalar { factor: weight, texture: Some((nearest(0), Channel::G)) };
        surface(Bsdf::Mix { weight, base: Box::new(base), other: Box::new(other) })
    };
    let plain = || Bsdf::Matte { reflectance: color() };
    let bumpy = Material {
        normal_map: Some(NormalMap { texture: bilinear(0), scale: 0.1 }),
        ..surface(Bsdf::Matte { reflectance: Color::constant([0.5; 3]) })
    };
    let emitting = Material { emission: color(), double_sided: false, ..surface(plain()) };
    let front = pencil([0.3, 0.1, 5.0], [0.2, 0.1, 0.0]);
    let behind = pencil([0.3, 0.1, -5.0], [0.2, 0.1, 0.0]);
    for (material, camera, lookups, bytes, what) in [
        (surface(plain()), &front, 1, 4, "matte"),
        (surface(coat()), &front, 4, 16, "coat"),
        (surface(Bsdf::RoughMetal { f0: color(), roughness: scalar() }), &front, 2, 8, "metal"),
        (mix(0.0, plain(), coat()), &front, 2, 8, "base of a mix"),
        (mix(1.0, plain(), coat()), &front, 5, 20, "other part of a mix"),
        (bumpy, &front, 1, 16, "normal map"),
        (emitting.clone(), &front, 2, 8, "emission"),
        (emitting, &behind, 1, 4, "emission from behind"),
        (surface(Bsdf::Unlit { color: color() }), &front, 1, 4, "unlit"),
        (matte([0.5; 3]), &front, 0, 0, "plain"),
    ] {
        let mut mesh = wall(0.0);
        mesh.normals = Some(vec![[0.0, 0.0, 1.0]; 4]);
        mesh.tangents = Some(vec![[1.0, 0.0, 0.0, 1.0]; 4]);
        // A sun on the side that no camera here is on: light, but no shadow rays towards it.
        let scene = World::new()
            .with_texture(texel(255))
            .with(mesh, material)
            .with_light(hotspot_scene::LightKind::Directional { direction: [1.0, 0.0, 0.0] }, [1.0; 3])
            .prepare();
        let sums = total(&frame(&scene, camera, &settings(4, 4, 4, 1, 3)).frame);
        let get = |c| sums.get(c);
        assert_eq!((get(Counter::Texture), get(Counter::TextureBytes)), (64 * lookups, 64 * bytes), "{what}");
        assert_eq!(get(Counter::AlphaTests), 0, "{what}");
    }
}

/// An unlit surface ends its path and evaluates nothing.
#[test]
fn unlit_surfaces_evaluate_nothing() {
    let scene = World::new()
        .with(wall(0.0), surface(Bsdf::Unlit { color: Color::constant([0.5; 3]) }))
        .with_environment([1.0; 3])
        .prepare();
    let sums =
        total(&frame(&scene, &pencil([0.3, 0.1, 5.0], [0.2, 0.1, 0.0]), &settings(4, 4, 4, 9, 3)).frame);
    let counts = [Counter::Rays, Counter::Bsdf, Counter::RaysShadow, Counter::Absorbed].map(|c| sums.get(c));
    assert_eq!(counts, [64, 0, 0, 64]);
}

/// Lets through what lies in even eighths of a triangle's first weight, and counts what it is asked.
struct Stripes<'a>(&'a mut u64, &'a dyn Fn(u32, u32) -> bool);

impl Filter for Stripes<'_> {
    const ON: bool = true;

    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, _probe: &mut P) -> bool {
        if !self.1(candidate.instance(), candidate.primitive()) {
            return true;
        }
        *self.0 += 1;
        let (u, v) = candidate.barycentric();
        // The alpha of the stripes' image at (u, v), the nearest texel.
        let (x, y) = ((u * 8.0).floor() as i64 & 7, (v * 8.0).floor() as i64 & 7);
        (x * 3 + y * 5) % 4 != 0
    }
}

/// Balls of masked triangles, every second one opaque, written out and stored once: alpha tests, their look-ups, instances
/// entered, nodes and triangles of camera rays are those of the oracle.
#[test]
fn cutouts_and_instances_cost_what_the_oracle_says() {
    let stripes = || image(8, 8, |x, y| [255, 255, 255, if (x * 3 + y * 5) % 4 != 0 { 255 } else { 0 }]);
    // Each triangle has corners of its own, so that its texture coordinates are its weights.
    let mut ball = sphere([0.0; 3], 1.0, 2, false);
    ball.positions = ball.triangles.iter().flatten().map(|&i| ball.positions[i as usize]).collect();
    ball.triangles = (0..ball.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    ball.uvs = Some((0..ball.positions.len()).map(|i| [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]][i % 3]).collect());
    let per_ball = ball.triangles.len() as u32;
    let mut random = Random(21);
    let mut world = World::new().with_texture(stripes()).with_environment([1.0; 3]);
    for i in 0..10 {
        let mut m = IDENTITY;
        let size = random.within(0.6, 1.2);
        for (k, row) in m.iter_mut().enumerate() {
            row[k] = size;
            row[3] = random.within(-1.5, 1.5);
        }
        let holes = masked(matte([0.5; 3]), by_alpha(nearest(0)));
        let material = if i % 2 == 0 { holes } else { matte([0.5; 3]) };
        world =
            if i == 0 { world.with_placed(ball.clone(), material, m) } else { world.with_again(material, m) };
    }
    for instancing in [Instancing::Never, Instancing::Always] {
        let scene = world.prepare_with(instancing);
        let is_masked = |instance: u32, primitive: u32| {
            (if instance == NO_INSTANCE { primitive / per_ball } else { instance }) % 2 == 0
        };
        let (mut asked, mut entered) = (0, 0);
        for _ in 0..400 {
            let camera = pencil(random.point(-5.0, 5.0), random.point(-1.5, 1.5));
            let mut tests = 0;
            let (hit, counts) =
                oracle::closest_filtered(scene.bvh(), &ray_of(&camera), Stripes(&mut tests, &is_masked));
            let sums = total(&frame(&scene, &camera, &settings(2, 1, 3, 0, 1)).frame);
            let what = format!("{instancing:?}");
            for (counter, expected) in [
                (Counter::Rays, 1),
                (Counter::Nodes, counts.nodes),
                (Counter::Boxes, counts.boxes),
                (Counter::Leaves, counts.leaves),
                (Counter::Shapes, counts.shapes),
                (Counter::Instances, counts.instances),
                (Counter::InstancesShadow, 0),
                (Counter::AlphaTests, tests),
                (Counter::Texture, tests),
                (Counter::TextureBytes, 4 * tests),
                (Counter::Escaped, u64::from(hit.is_none())),
            ] {
                assert_eq!(sums.get(counter), 6 * expected, "{what}: {counter:?}");
            }
            asked += tests;
            entered += counts.instances;
        }
        assert!(asked > 120, "{asked} alpha tests");
        assert_eq!(entered > 0, instancing == Instancing::Always);
    }
}

/// Σ over pixels = totals, and shadow rays' instances are part of all; alpha tests without textures look nothing up.
#[test]
fn cutouts_and_instances_keep_their_identities() {
    let mut world = World::new().with_environment([1.0; 3]);
    for i in 0..8 {
        let mut m = IDENTITY;
        m[0][3] = f64::from(i % 4) - 1.5;
        m[1][3] = f64::from(i / 4) - 0.5;
        let material = Material { alpha: Alpha::Blend { alpha: Scalar::constant(0.5) }, ..matte([0.8; 3]) };
        let material = if i % 2 == 0 { material } else { metal([0.9; 3], 0.4) };
        world = match i {
            0 => world.with_placed(sphere([0.0; 3], 0.6, 2, false), material, m),
            _ => world.with_again(material, m),
        };
    }
    for instancing in [Instancing::Never, Instancing::Always] {
        let scene = world.prepare_with(instancing);
        let frame =
            frame(&scene, &pinhole([0.3, 0.4, 5.0], [0.0; 3], 40.0), &settings(40, 30, 4, 6, 2)).frame;
        for (x, y) in frame.pixels() {
            let p = frame.cost_total(x, y);
            assert!(p.get(Counter::InstancesShadow) <= p.get(Counter::Instances));
            assert_eq!((p.get(Counter::Texture), p.get(Counter::TextureBytes)), (0, 0));
        }
        let sums = total(&frame);
        assert!(sums.get(Counter::AlphaTests) > 1000);
        assert_eq!(sums.get(Counter::InstancesShadow) > 0, instancing == Instancing::Always);
        for (metric, counter) in [
            (Metric::AlphaTests, Counter::AlphaTests),
            (Metric::Instances, Counter::Instances),
            (Metric::Texture, Counter::Texture),
        ] {
            let told = hotspot_cost::stats::total(&frame, metric, hotspot_cost::CostModel::default());
            assert_eq!(told.sum, hotspot_cost::Sum::Exact(sums.get(counter)), "{}", metric.name());
        }
    }
    // Without any of it: none.
    let (scene, camera) = mixed();
    let sums = total(&frame(&scene, &camera, &settings(20, 15, 4, 6, 2)).frame);
    for counter in [
        Counter::AlphaTests,
        Counter::Texture,
        Counter::TextureBytes,
        Counter::Instances,
        Counter::InstancesShadow,
    ] {
        assert_eq!(sums.get(counter), 0, "{counter:?}");
    }
}
