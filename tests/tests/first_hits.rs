//! Albedo, normal, depth and mattes at the first hit: against closed forms, and against the picture that they go with.

use hotspot_cost::cryptomatte::Ranks;
use hotspot_cost::{Frame, hotspots};
use hotspot_integrator::{FirstHit, Instancing, Isa, PrepareOptions, RenderScene, Settings, first_hits};
use hotspot_scene::{Alpha, Bsdf, Camera, Channel, Color, Material, Scalar};
use hotspot_tests::picture::{self, frame};
use hotspot_tests::reference::own_scene;
use hotspot_tests::world::{
    IDENTITY, World, bilinear, image, matte, metal, panel, pinhole, rectangle, sphere, substrate, surface,
};

/// Depth 15, seed 1.
fn settings(width: u32, height: u32, spp: u32) -> Settings {
    picture::settings(width, height, spp, 15, 1)
}

fn look(scene: &RenderScene, camera: &Camera, settings: &Settings, of: &Frame) -> Vec<FirstHit> {
    first_hits(scene, camera, settings, of, u64::MAX, None).expect("nobody interrupts")
}

fn coverage(ranks: &Ranks) -> f64 {
    ranks.iter().map(|rank| f64::from(rank.coverage)).sum()
}

/// A surface that shows white and nothing else.
fn white() -> Material {
    surface(Bsdf::Unlit { color: Color::constant([1.0; 3]) })
}

#[test]
fn a_wall_has_its_distance_its_normal_and_its_color() {
    let camera = pinhole([0.0, 0.0, 2.0], [0.0, 0.0, -1.0], 90.0);
    let cases = [
        (matte([0.2, 0.4, 0.6]), [0.2, 0.4, 0.6]),
        (metal([0.9, 0.6, 0.3], 0.4), [0.9, 0.6, 0.3]),
        (substrate([0.5, 0.25, 0.0], 0.1, 0.3), [0.55, 0.325, 0.1]),
        (
            surface(Bsdf::Mix {
                weight: Scalar::constant(0.25),
                base: Box::new(matte([0.8, 0.0, 0.4]).bsdf),
                other: Box::new(matte([0.0, 0.8, 0.4]).bsdf),
            }),
            [0.6, 0.2, 0.4],
        ),
    ];
    for (material, albedo) in cases {
        // Seen from behind: normals stand on the camera's side.
        let wall = rectangle([0.0, 0.0, -2.0], [0.0, 9.0, 0.0], [9.0, 0.0, 0.0]);
        let scene = World::new().with_environment([1.0; 3]).with(wall, material).prepare();
        let settings = settings(9, 9, 1);
        let rendered = frame(&scene, &camera, &settings);
        let hits = look(&scene, &camera, &settings, &rendered.frame);
        for (i, hit) in hits.iter().enumerate() {
            assert_eq!((hit.alpha, hit.normal), (1.0, [0.0, 0.0, 1.0]));
            for (got, want) in hit.albedo.iter().zip(albedo) {
                assert!((got - want).abs() < 1e-6, "{:?} {albedo:?}", hit.albedo);
            }
            // 4 times the secant; the middle pixel looks along the axis up to its jitter.
            let (x, y) = ((i % 9) as f32 - 4.0, (i / 9) as f32 - 4.0);
            let tangent = (x * x + y * y).sqrt() / 4.5;
            let jitter = 0.5f32.sqrt() / 4.5;
            let bounds =
                [tangent - jitter, tangent + jitter].map(|t| 4.0 * (1.0 + t.max(0.0).powi(2)).sqrt());
            assert!((bounds[0] - 1e-5..=bounds[1] + 1e-5).contains(&hit.depth), "{hit:?} {bounds:?}");
            assert_eq!((hit.objects[0].id, hit.objects[0].coverage), (0, 1.0));
        }
    }
}

/// White surfaces in the dark, with holes and haze: the picture is the coverage itself, sample by sample.
#[test]
fn coverage_is_what_the_picture_shows() {
    let holes = image(4, 4, |x, y| [255, 255, 255, 60 * ((x + 2 * y) % 5) as u8]);
    let alpha = Scalar { factor: 1.0, texture: Some((bilinear(0), Channel::A)) };
    let hazy = Material { alpha: Alpha::Blend { alpha }, ..white() };
    let cut = Material { alpha: Alpha::Mask { cutoff: 0.5, alpha }, ..white() };
    let world = World::new()
        .with_environment([0.0; 3])
        .with_texture(holes)
        .with(sphere([-0.7, 0.3, 0.0], 0.5, 2, false), white())
        .with(panel([0.3, 0.1, 0.5], [0.8, 0.1, 0.0], [0.0, 0.8, 0.0]), hazy)
        .with(panel([0.2, -0.4, 0.2], [0.9, 0.0, 0.0], [0.0, 0.4, 0.1]), cut)
        .with(sphere([0.6, -0.2, -0.6], 0.4, 1, false), white());
    let scene = world.prepare();
    let camera = pinhole([0.0, 0.0, 3.0], [0.0, 0.0, 0.0], 50.0);
    for (intervals, adaptive) in [(false, false), (true, false), (false, true)] {
        let mut settings = settings(24, 16, 32);
        (settings.intervals, settings.adaptive) = (intervals, adaptive);
        let rendered = frame(&scene, &camera, &settings);
        let hits = look(&scene, &camera, &settings, &rendered.frame);
        let mut partly = 0;
        for ((x, y), hit) in rendered.frame.pixels().zip(&hits) {
            let film = rendered.frame.film_total(x, y);
            let shown = film.sum[0] / film.samples as f64;
            assert!((shown - f64::from(hit.alpha)).abs() < 1e-6, "{shown} {hit:?}");
            assert!((coverage(&hit.objects) - f64::from(hit.alpha)).abs() < 1e-6);
            assert!((coverage(&hit.materials) - f64::from(hit.alpha)).abs() < 1e-6);
            assert!(hit.objects.is_sorted_by(|a, b| a.coverage >= b.coverage));
            partly += usize::from(hit.objects[1].coverage > 0.0);
        }
        assert!(partly > 50, "{partly} pixels with two objects");
    }
}

/// One sample of a pixel is the frame's first path; and looking changes nothing.
#[test]
fn first_objects_are_those_of_the_paths() {
    let scene = own_scene("creature").expect("the checkout has its scenes");
    let camera = scene.cameras[0].clone();
    let prepared = RenderScene::prepare(&scene, PrepareOptions::default()).unwrap();
    let settings = settings(48, 32, 4);
    let rendered = frame(&prepared, &camera, &settings);
    let hits = first_hits(&prepared, &camera, &settings, &rendered.frame, 1, None).unwrap();
    let ids: Vec<u32> = hits.iter().map(|hit| hit.objects[0].id).collect();
    assert_eq!(ids, hotspots::first_objects(&rendered.frame));
    let materials = prepared.material_names().count();
    assert!(hits.iter().all(|hit| hit.alpha == 0.0 || (hit.materials[0].id as usize) < materials));
}

#[test]
fn threads_and_instruction_sets_do_not_matter_and_instances_look_like_copies() {
    let ball = sphere([0.0; 3], 0.5, 3, false);
    let at = |x: f64, s: f64| [[s, 0.0, 0.0, x], [0.0, 1.0, 0.2, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let world = World::new()
        .with_environment([1.0; 3])
        .with_placed(ball, matte([0.5, 0.2, 0.1]), at(-0.6, 1.0))
        .with_again(metal([0.7; 3], 0.1), at(0.6, -0.8))
        .with_again(matte([0.1; 3]), IDENTITY);
    let camera = pinhole([0.3, 0.4, 3.0], [0.0; 3], 45.0);
    let settings = settings(32, 24, 3);
    let of = |isa: Isa, instancing, threads: usize| {
        let mut options = PrepareOptions { instancing, ..PrepareOptions::default() };
        options.tree.isa = isa;
        let scene = RenderScene::prepare(&world.scene, options).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let rendered = frame(&scene, &camera, &settings);
            look(&scene, &camera, &settings, &rendered.frame)
        })
    };
    let first = of(Isa::Auto, Instancing::Never, 1);
    assert_eq!(first, of(Isa::Portable, Instancing::Never, 3));
    let mut differ = 0;
    for (a, b) in first.iter().zip(of(Isa::Auto, Instancing::Always, 2)) {
        let close = (a.depth - b.depth).abs() < 1e-4
            && a.normal.iter().zip(b.normal).all(|(a, b)| (a - b).abs() < 1e-3)
            && a.objects == b.objects;
        differ += usize::from(!close);
    }
    // A ray along a silhouette may pass one and not the other.
    assert!(differ <= 2, "{differ} pixels differ");
}

#[test]
fn an_interrupted_look_gives_nothing() {
    let scene = World::new().with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), white()).prepare();
    let camera = pinhole([0.0, 0.0, 3.0], [0.0; 3], 45.0);
    let settings = settings(4, 4, 1);
    let rendered = frame(&scene, &camera, &settings);
    let cancel = std::sync::atomic::AtomicBool::new(true);
    assert!(first_hits(&scene, &camera, &settings, &rendered.frame, 1, Some(&cancel)).is_none());
}
