//! Do the counters count what they are defined to count?
//!
//! Camera rays can be known exactly from outside: an orthographic camera of no extent sends the same ray for every
//! sample. Their counts must be those of the slow oracle. Everything else is held by identities: between rays and
//! vertices in scenes where both are known, and between the counters themselves in scenes of every kind.

use hotspot_bvh::{Ray, oracle};
use hotspot_cost::{CostPixel, Counter, Frame, Metric};
use hotspot_integrator::{Gather, RenderScene, Settings};
use hotspot_scene::Camera;
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::reference::own_scene;
use hotspot_tests::world::{
    IDENTITY, Random, World, cuboid, emitting, light, matte, metal, mirror, pencil, pinhole, rectangle,
    sphere, substrate,
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
        settings.roulette_from = None;
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
        settings.roulette_from = None;
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
