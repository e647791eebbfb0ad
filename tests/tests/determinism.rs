//! The same bits whatever does not matter: threads, instruction set, instrumentation, waves of samples; and sums that
//! are the same wherever they are read.

use hotspot_bvh::{BuildOptions, Bvh};
use hotspot_cost::{
    CostModel, CostPixel, Counter, Digest, Document, Frame, LayerOptions, Layers, Metric, exr_io, stats,
};
use hotspot_integrator::{
    Control, Gather, Instancing, Isa, LightChoice, PrepareOptions, RenderScene, Roulette, Settings, Stop,
    render,
};
use hotspot_scene::{Alpha, Bsdf, Camera, Channel, Color, Material, NormalMap, Scalar, Scene};
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::reference::own_scene;
use hotspot_tests::world::{
    IDENTITY, World, bilinear, cuboid, emitting, image, light, matte, metal, mirror, nearest, pinhole,
    rectangle, sphere, substrate, surface,
};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A closed room with a ball of every kind of surface, area lights and an environment through a window.
fn room(lobes: bool) -> (Scene, Camera) {
    let wall = |mesh, color| (mesh, matte(color));
    let mut world = World::new().with_environment([0.3, 0.4, 0.6]);
    for (mesh, material) in [
        wall(rectangle([0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]), [0.7, 0.7, 0.7]),
        wall(rectangle([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), [0.8, 0.8, 0.8]),
        wall(rectangle([0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), [0.3, 0.6, 0.3]),
        wall(rectangle([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), [0.6, 0.2, 0.2]),
    ] {
        world = world.with(mesh, material);
    }
    let balls = if lobes {
        [mirror([0.9; 3]), substrate([0.5, 0.3, 0.1], 0.08, 0.3), metal([0.9, 0.6, 0.3], 0.2)]
    } else {
        [matte([0.9; 3]), matte([0.5, 0.3, 0.1]), matte([0.9, 0.6, 0.3])]
    };
    for (i, ball) in balls.into_iter().enumerate() {
        let x = i as f64 * 0.6 - 0.6;
        world = world.with(sphere([x, -0.7, 0.2 * x], 0.28, 3, false), ball);
    }
    let world = world
        .with(rectangle([0.0, 0.98, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.3]), light([12.0, 11.0, 9.0]))
        .with(cuboid([0.5, 0.0, -0.5], [0.7, 0.1, -0.3], false), emitting(matte([0.5; 3]), [0.0, 2.0, 4.0]));
    (world.scene, pinhole([0.3, 0.1, 3.2], [0.0, 0.0, 0.0], 42.0))
}

/// The same room full of what is seldom there: masks, blending, bumps, colours at vertices, glass that absorbs, a mix of
/// mixes, an unlit ball; each ball twice.
fn bazaar() -> (Scene, Camera) {
    let (scene, camera) = room(true);
    let mut world = World { scene }.with_texture(image(8, 8, |x, y| {
        [100 + 9 * x as u8, 156 - 8 * y as u8, 230, 40 * ((x * 5 + y) % 7) as u8]
    }));
    let mut ball = sphere([0.0; 3], 0.25, 3, false);
    let unit = |p: &[f32; 3]| p.map(|c| 4.0 * c);
    ball.normals = Some(ball.positions.iter().map(unit).collect());
    ball.uvs = Some(ball.positions.iter().map(|p| [3.0 * p[0] + p[2], 4.0 * p[1]]).collect());
    ball.colors =
        Some(ball.positions.iter().map(|p| [0.7 + p[0], 0.7 + p[1], 0.7 + p[2], 0.8 + 0.7 * p[0]]).collect());
    ball.tangents = Some(vec![[1.0, 0.0, 0.0, 1.0]; ball.positions.len()]);
    let color = Color { factor: [0.9; 3], texture: Some(nearest(0)) };
    let alpha = Scalar { factor: 1.0, texture: Some((bilinear(0), Channel::A)) };
    let plain = Bsdf::Matte { reflectance: color };
    let mix = |base: Bsdf, other: Bsdf| Bsdf::Mix {
        weight: Scalar::constant(0.4),
        base: Box::new(base),
        other: Box::new(other),
    };
    let metal = Bsdf::RoughMetal { f0: color, roughness: Scalar::constant(0.3) };
    let glass = Bsdf::Glass {
        ior: 1.4,
        thin: false,
        transmittance: Color::constant([1.0; 3]),
        absorption: [1.0, 3.0, 0.0],
    };
    let materials = [
        Material { alpha: Alpha::Mask { cutoff: 0.4, alpha }, ..surface(plain.clone()) },
        Material { alpha: Alpha::Blend { alpha }, ..emitting(surface(plain.clone()), [0.5, 1.0, 0.2]) },
        Material { alpha: Alpha::Blend { alpha: Scalar::constant(0.6) }, ..matte([0.9; 3]) },
        Material {
            normal_map: Some(NormalMap { texture: bilinear(0), scale: 0.8 }),
            ..surface(mix(plain.clone(), mix(metal, plain)))
        },
        surface(glass),
        surface(Bsdf::Unlit { color }),
    ];
    for (i, material) in materials.into_iter().cycle().take(12).enumerate() {
        let mut m = IDENTITY;
        m[0][0] = if i % 3 == 0 { -0.8 } else { 1.0 };
        m[0][3] = (i % 4) as f64 * 0.5 - 0.75;
        m[1][3] = (i / 4) as f64 * 0.5 - 0.4;
        m[2][3] = 0.3 * ((i * 7) % 5) as f64 - 0.4;
        world =
            if i == 0 { world.with_placed(ball.clone(), material, m) } else { world.with_again(material, m) };
    }
    (world.scene, camera)
}

/// Meshes that appear twice are stored once.
fn prepared(scene: &Scene, isa: Isa) -> RenderScene {
    let tree = BuildOptions { isa, ..BuildOptions::default() };
    RenderScene::prepare(
        scene,
        PrepareOptions { tree, instancing: Instancing::Always, ..PrepareOptions::default() },
    )
    .unwrap()
}

/// Everything but time.
fn costs(frame: &Frame) -> Vec<CostPixel> {
    let timeless = |cost: &CostPixel| CostPixel { time_ns: 0, time_samples: 0, ..*cost };
    frame.costs().map(timeless).collect()
}

/// Bit-identical radiance and, where both have them, counters.
fn assert_same(a: &Frame, b: &Frame, what: &str) {
    let (da, db) = (Digest::of(a), Digest::of(b));
    assert_eq!(da.radiance, db.radiance, "{what}: radiance");
    for (x, y) in a.pixels() {
        assert_eq!(a.film_total(x, y), b.film_total(x, y), "{what}: pixel {x}, {y}");
    }
    if a.desc().cost && b.desc().cost {
        assert_eq!(da.counters, db.counters, "{what}: counters");
        assert_eq!(costs(a), costs(b), "{what}: squares, throughput or first object");
    }
}

fn on_threads(threads: usize, scene: &RenderScene, camera: &Camera, settings: &Settings) -> Frame {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let rendered = render(scene, camera, settings, Control::default());
        assert_eq!((rendered.threads, rendered.stop), (threads, Stop::Done));
        rendered.frame
    })
}

/// Scenes of every class: made here, and the project's own.
fn scenes() -> Vec<(String, Scene, Camera)> {
    let mut scenes = Vec::new();
    for (name, lobes) in [("matte room", false), ("glossy room", true)] {
        let (scene, camera) = room(lobes);
        scenes.push((name.to_owned(), scene, camera));
    }
    let (scene, camera) = bazaar();
    assert_eq!(prepared(&scene, Isa::Auto).instance_count(), 10, "all but the emitting ones");
    scenes.push(("bazaar".to_owned(), scene.clone(), camera.clone()));
    // The same with copies in the world.
    let mut copies = scene;
    for instance in &mut copies.instances {
        copies.meshes.push(copies.meshes[instance.mesh as usize].clone());
        instance.mesh = copies.meshes.len() as u32 - 1;
    }
    scenes.push(("bazaar of copies".to_owned(), copies, camera));
    for name in ["cornell-box-red", "mirror-gap-narrow", "creature"] {
        if let Some(scene) = own_scene(name) {
            let camera = scene.cameras[0].clone();
            scenes.push((name.to_owned(), scene, camera));
        }
    }
    scenes
}

#[test]
fn threads_and_instruction_sets_do_not_show() {
    for (name, scene, camera) in scenes() {
        let auto = prepared(&scene, Isa::Auto);
        let portable = prepared(&scene, Isa::Portable);
        assert_eq!(portable.bvh().isa(), Isa::Portable);
        // Not a multiple of the tile's edge in either direction.
        // Sixteen samples of a pixel and half go eight at a time, the others one by one.
        let mut settings = settings(75, 50, 18, 8, 11);
        settings.first_wave = Some(16);
        settings.intervals = true;
        let one = on_threads(1, &auto, &camera, &settings);
        assert!(one.costs().any(|cost| cost.get(Counter::Nodes) > 0), "{name}: nothing was counted");
        for threads in [2, 7, 16] {
            let other = on_threads(threads, &auto, &camera, &settings);
            assert_same(&one, &other, &format!("{name} on {threads} threads"));
        }
        assert_same(&one, &on_threads(2, &portable, &camera, &settings), &format!("{name}, portable"));
    }
}

#[test]
fn trees_do_not_depend_on_threads_or_instruction_set() {
    for (name, scene, _) in scenes() {
        let words = |threads: usize, isa: Isa| -> Vec<u32> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| prepared(&scene, isa).bvh().words().collect())
        };
        let one = words(1, Isa::Auto);
        assert!(!one.is_empty());
        assert!(one == words(2, Isa::Auto), "{name}: 2 threads");
        assert!(one == words(7, Isa::Auto), "{name}: 7 threads");
        assert!(one == words(2, Isa::Portable), "{name}: portable");
    }
}

/// What is learned before the first sample: lights and roulette, over scenes that have something to learn.
#[test]
fn what_is_learned_does_not_depend_on_threads() {
    for (name, scene, camera) in scenes() {
        let portable = scene;
        let scene = prepared(&portable, Isa::Auto);
        let mut settings = settings(40, 30, 4, 8, 3);
        settings.roulette = Roulette::Efficient;
        settings.light_choice = LightChoice::Learned;
        let one = on_threads(1, &scene, &camera, &settings);
        for threads in [2, 7] {
            let other = on_threads(threads, &scene, &camera, &settings);
            assert_same(&one, &other, &format!("{name} on {threads} threads"));
        }
        let portable = prepared(&portable, Isa::Portable);
        assert_same(&one, &on_threads(2, &portable, &camera, &settings), &format!("{name}, portable"));
        // Roulette does not depend on the number of samples either (lights do): stopped early is what a shorter render gives.
        settings.light_choice = LightChoice::Power;
        let short = frame(&scene, &camera, &settings).frame;
        (settings.spp, settings.first_wave) = (64, Some(4));
        let cancel = AtomicBool::new(true);
        let control = Control { cancel: Some(&cancel), ..Control::default() };
        let stopped = render(&scene, &camera, &settings, control);
        assert_eq!((stopped.stop, stopped.samples), (Stop::Cancelled, 4));
        assert_same(&short, &stopped.frame, &format!("{name}, stopped early"));
    }
}

/// The words really tell trees apart.
#[test]
fn different_trees_have_different_words() {
    let at = |z: f32| vec![[[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]; 20];
    let words = |z| Bvh::build(&at(z), BuildOptions::default()).unwrap().words().collect::<Vec<_>>();
    assert_eq!(words(1.0), words(1.0));
    let moved: Vec<_> = (0..20).flat_map(|i| at(i as f32).into_iter().take(1)).collect();
    let moved: Vec<u32> = Bvh::build(&moved, BuildOptions::default()).unwrap().words().collect();
    assert_ne!(words(1.0), moved);
}

/// Under intervals sample counts are rounded up to even, so that both halves have as many.
fn whole(samples: u32, intervals: bool) -> u32 {
    if intervals { samples.next_multiple_of(2) } else { samples }
}

#[test]
fn instrumentation_does_not_show() {
    for (name, scene, camera) in scenes() {
        let scene = prepared(&scene, Isa::Auto);
        for intervals in [false, true] {
            let with = |gather: Gather, cost_spp: Option<u32>| {
                let mut settings = settings(40, 27, 17, 15, 3);
                settings.gather = gather;
                settings.intervals = intervals;
                settings.cost_spp = cost_spp;
                frame(&scene, &camera, &settings).frame
            };
            let all = with(Gather::ALL, None);
            assert_same(&all, &with(Gather::RADIANCE, None), &format!("{name}: counters off"));
            let timeless = with(Gather { time: false, ..Gather::ALL }, None);
            assert_same(&all, &timeless, &format!("{name}: clock off"));
            assert!(timeless.costs().all(|cost| cost.time_ns == 0 && cost.time_samples == 0));
            let samples = u64::from(whole(17, intervals));
            assert_eq!(all.costs().map(|cost| cost.time_samples).sum::<u64>(), 40 * 27 * samples);
            let blind = with(Gather { radiance: false, ..Gather::ALL }, None);
            assert_eq!(costs(&all), costs(&blind), "{name}: counters without a picture");
            // Counting the first samples alone.
            for count in [0, 1, 4, 9] {
                let part = with(Gather::ALL, Some(count));
                assert_eq!(Digest::of(&part).radiance, Digest::of(&all).radiance, "{name}: cost_spp {count}");
                let counted = u64::from(whole(count, intervals));
                assert!(part.pixels().all(|(x, y)| part.cost_total(x, y).samples == counted));
                if count > 0 {
                    let mut settings = settings(40, 27, count, 15, 3);
                    settings.intervals = intervals;
                    let short = frame(&scene, &camera, &settings).frame;
                    assert_eq!(costs(&part), costs(&short), "{name}: the first {count} samples");
                }
            }
        }
    }
}

/// Paths that are not counted go eight at a time or one by one, their camera rays in packets, of sixteen samples and of what is left: in
/// waves of 19 all in one wave.
#[test]
fn packets_do_not_show() {
    for (name, scene, camera) in scenes() {
        for isa in [Isa::Auto, Isa::Portable] {
            let scene = prepared(&scene, isa);
            let with = |packets: bool| {
                let mut settings = settings(40, 27, 19, 4, 3);
                (settings.gather, settings.first_wave) = (Gather::RADIANCE, Some(19));
                settings.packets = packets;
                frame(&scene, &camera, &settings).frame
            };
            assert_same(&with(true), &with(false), &format!("{name}, {}", isa.name()));
        }
    }
}

/// Samples come in waves whose sizes depend on the clock; a time limit starts with smaller ones.
#[test]
fn waves_do_not_show() {
    for (scene, camera) in [room(true), bazaar()] {
        let scene = prepared(&scene, Isa::Auto);
        same_in_waves(&scene, &camera);
    }
}

fn same_in_waves(scene: &RenderScene, camera: &Camera) {
    for intervals in [false, true] {
        let mut settings = settings(33, 21, 37, 6, 5);
        settings.intervals = intervals;
        let plain = frame(scene, camera, &settings).frame;
        settings.time_limit = Some(Duration::from_secs(3600));
        let limited = frame(scene, camera, &settings);
        assert_eq!((limited.stop, limited.samples), (Stop::Done, whole(37, intervals)));
        assert_same(&plain, &limited.frame, "with a time limit");

        // Stopped early: what was done is what a shorter render gives.
        settings.time_limit = None;
        let cancel = AtomicBool::new(true);
        let stopped = render(
            scene,
            camera,
            &settings,
            Control { cancel: Some(&cancel), progress: None, ..Control::default() },
        );
        assert_eq!(stopped.stop, Stop::Cancelled);
        assert!(stopped.samples < 37);
        settings.spp = stopped.samples;
        assert_same(&stopped.frame, &frame(scene, camera, &settings).frame, "stopped early");
        settings.spp = 37;
        settings.time_limit = Some(Duration::ZERO);
        let expired = frame(scene, camera, &settings);
        assert_eq!((expired.stop, expired.samples), (Stop::TimeLimit, whole(1, intervals)));
    }
}

/// Seeds, samplers and halves do show.
#[test]
fn what_matters_shows() {
    let (scene, camera) = room(false);
    let scene = prepared(&scene, Isa::Auto);
    let digest = |change: &dyn Fn(&mut Settings)| {
        let mut settings = settings(16, 16, 4, 5, 0);
        change(&mut settings);
        Digest::of(&frame(&scene, &camera, &settings).frame)
    };
    let plain = digest(&|_| {});
    assert_eq!(plain, digest(&|_| {}));
    let changes: [&dyn Fn(&mut Settings); 7] = [
        &|s| s.seed = 1,
        &|s| s.seed = 1 << 32,
        &|s| s.spp = 5,
        &|s| s.max_depth = 6,
        &|s| s.sampler = hotspot_integrator::SamplerKind::Independent,
        &|s| s.intervals = true,
        &|s| s.roulette = Roulette::Efficient,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let other = digest(change);
        assert_ne!(plain.radiance, other.radiance, "change {i}");
        assert_ne!(plain.counters, other.counters, "change {i}");
    }
}

/// The halves behind an interval know nothing of each other: the differences of two seeds in half a and in half b are
/// uncorrelated (4/√n over n pixels).
#[test]
fn halves_are_independent() {
    let (scene, camera) = room(false);
    let scene = prepared(&scene, Isa::Auto);
    let render = |seed| {
        let mut settings = settings(64, 64, 8, 4, seed);
        settings.intervals = true;
        frame(&scene, &camera, &settings).frame
    };
    let (one, two) = (render(1), render(2));
    let differences = |half: usize| -> Vec<f64> {
        let nodes = |frame: &Frame, x, y| frame.cost(x, y, half).unwrap().get(Counter::Nodes) as f64;
        one.pixels().map(|(x, y)| nodes(&one, x, y) - nodes(&two, x, y)).collect()
    };
    let (a, b) = (differences(0), differences(1));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let correlation = product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt();
    assert!(correlation.abs() < 4.0 / (a.len() as f64).sqrt(), "correlation {correlation}");
}

/// Σ pixels = totals = the JSON's sums, and the EXR's f32 means equal sum / samples within half an ulp.
#[test]
fn sums_agree_wherever_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (name, scene, camera) in scenes() {
        let scene = prepared(&scene, Isa::Auto);
        for (intervals, cost_spp) in [(false, None), (true, None), (false, Some(3))] {
            let mut settings = settings(35, 22, 6, 15, 8);
            settings.intervals = intervals;
            settings.cost_spp = cost_spp;
            let frame = frame(&scene, &camera, &settings).frame;
            let options = LayerOptions::default();
            let document = Document::of_frame(&frame, &options);
            let json: serde_json::Value = serde_json::from_str(&document.to_json()).unwrap();
            let counted = u64::from(cost_spp.unwrap_or(6));
            assert_eq!(json["samples"]["radiance"].as_u64(), Some(35 * 22 * 6));
            assert_eq!(json["samples"]["cost"].as_u64(), Some(35 * 22 * counted));
            let pixels: Vec<CostPixel> = frame.pixels().map(|(x, y)| frame.cost_total(x, y)).collect();
            let sum = |counter: Counter| pixels.iter().map(|p| p.get(counter)).sum::<u64>();
            let exact = [
                (Metric::Rays, sum(Counter::Rays)),
                (Metric::RaysShadow, sum(Counter::RaysShadow)),
                (Metric::Nodes, sum(Counter::Nodes)),
                (Metric::Shapes, sum(Counter::Shapes)),
                (Metric::Boxes, sum(Counter::Boxes)),
                (Metric::Leaves, sum(Counter::Leaves)),
                (Metric::Bsdf, sum(Counter::Bsdf)),
                (Metric::Intersection, sum(Counter::Nodes) + sum(Counter::Shapes)),
                (Metric::IntersectionShadow, sum(Counter::NodesShadow) + sum(Counter::ShapesShadow)),
                (Metric::Waste, sum(Counter::WasteNodes) + sum(Counter::WasteShapes)),
                (Metric::Escaped, sum(Counter::Escaped)),
                (Metric::Absorbed, sum(Counter::Absorbed)),
                (Metric::Roulette, sum(Counter::Roulette)),
                (Metric::DepthLimit, sum(Counter::DepthLimit)),
            ];
            for (metric, sum) in exact {
                let what = format!("{name}: {}", metric.name());
                assert_eq!(stats::total(&frame, metric, CostModel::default()).sum.as_f64(), sum as f64);
                assert_eq!(json["totals"][metric.name()]["sum"].as_u64(), Some(sum), "{what}");
            }

            let path = folder.path().join("picture.exr");
            exr_io::write(&path, &Layers::from_frame(&frame, &options), &exr_io::Header::default()).unwrap();
            let layers = exr_io::read(&path, &exr_io::Limits::default()).unwrap().layers;
            assert!(layers.plane("samples").unwrap().iter().all(|s| *s == 6.0));
            assert!(layers.plane("cost.samples").unwrap().iter().all(|s| *s == counted as f32));
            for metric in layers.metrics().filter(|m| !matches!(m, Metric::TimeUs)) {
                for (value, pixel) in layers.metric(metric).unwrap().iter().zip(&pixels) {
                    let sum = metric.sum(pixel, CostModel::default());
                    assert_rounded(*value, sum, counted, metric.name());
                }
            }
            for (c, channel) in ["R", "G", "B"].into_iter().enumerate() {
                let values = layers.plane(channel).unwrap();
                for (value, (x, y)) in values.iter().zip(frame.pixels()) {
                    assert_rounded(*value, frame.film_total(x, y).sum[c], 6, channel);
                }
            }
        }
    }
}

/// `value` is sum / samples within half an ulp (and what two roundings in f64 may add).
fn assert_rounded(value: f32, sum: f64, samples: u64, what: &str) {
    let exact = sum / samples as f64;
    let ulp = if value == 0.0 {
        f64::from(f32::MIN_POSITIVE)
    } else {
        f64::from(value.abs().next_up()) - f64::from(value.abs())
    };
    let off = (f64::from(value) - exact).abs();
    assert!(off <= 0.5 * ulp * (1.0 + 1e-8), "{what}: {value} for {exact}, {} ulp", off / ulp);
}
