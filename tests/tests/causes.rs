//! Causes of hotspots: small scenes, each made so that one cause is known to be the right answer, and its twin in which that
//! cause would be a lie.

use hotspot_cost::hotspots::{self, CauseKind, Context, Hotspot};
use hotspot_cost::{CostModel, LayerOptions, Layers, Metric};
use hotspot_integrator::{Control, Settings, render, sound};
use hotspot_scene::{Alpha, Bsdf, Camera, Channel, Color, Material, Mesh, Scalar};
use hotspot_tests::world::{
    Random, V3, World, add_scaled, image, light, matte, mesh, mirror, nearest, panel, pinhole, rectangle,
    sphere,
};

const GREY: [f32; 3] = [0.5; 3];
const WHITE: [f32; 3] = [0.95; 3];

trait Named {
    fn named(self, name: &str, mesh: Mesh, material: Material) -> Self;
}

impl Named for World {
    fn named(self, name: &str, mesh: Mesh, material: Material) -> Self {
        let mut world = self.with(mesh, Material { name: format!("{name} material"), ..material });
        world.scene.objects.last_mut().unwrap().name = name.into();
        world
    }
}

/// A large matte floor under a lamp that all of it sees.
fn floor() -> World {
    World::new().named("Floor", rectangle([0.0; 3], [0.0, 0.0, 12.0], [12.0, 0.0, 0.0]), matte(GREY)).named(
        "Lamp",
        rectangle([0.0, 9.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
        light([40.0; 3]),
    )
}

fn view() -> Camera {
    pinhole([0.0, 4.0, 7.0], [0.0, 0.8, 0.0], 50.0)
}

/// Small triangles anywhere in a box.
fn soup(count: usize, seed: u64, min: V3, max: V3, size: f64) -> Mesh {
    let mut random = Random(seed);
    let mut positions = Vec::new();
    for _ in 0..count {
        let center: V3 = core::array::from_fn(|i| random.within(min[i], max[i]));
        for _ in 0..3 {
            positions.push(add_scaled(center, size, random.point(-1.0, 1.0)).map(|c| c as f32));
        }
    }
    mesh(positions, (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// Several meshes as one.
fn joined(meshes: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh { uvs: Some(Vec::new()), ..mesh(Vec::new(), Vec::new()) };
    for one in meshes {
        let first = all.positions.len() as u32;
        let count = one.positions.len();
        all.positions.extend(one.positions);
        all.uvs.as_mut().unwrap().extend(one.uvs.unwrap_or_else(|| vec![[0.0; 2]; count]));
        all.triangles.extend(one.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

/// The hotspots of a scene with their causes.
fn explained(world: &World, camera: &Camera) -> Vec<Hotspot> {
    let scene = world.prepare();
    let mut settings = Settings::new(64, 48);
    settings.spp = 16;
    settings.max_depth = 12;
    settings.gather.time = false;
    let rendered = render(&scene, camera, &settings, Control::default());
    let model = CostModel::default();
    let objects = hotspots::first_objects(&rendered.frame);
    let mut found = hotspots::of_frame(&rendered.frame, model, scene.objects(), 6);
    let layers = Layers::from_frame(&rendered.frame, &LayerOptions::default());
    let cost = layers.metric(Metric::Intersection).unwrap();
    let regions: Vec<Vec<u32>> = std::iter::once(hotspots::ordinary_pixels(cost, &objects))
        .chain(found.iter().map(|hotspot| hotspot.members.clone()))
        .collect();
    let soundings = sound(&scene, camera, &settings, &regions);
    let (materials, bounds) = (scene.material_kinds(), scene.object_bounds());
    let triangles = scene.object_triangles();
    let context = Context {
        model,
        max_depth: settings.max_depth,
        materials: &materials,
        bounds: &bounds,
        triangles: &triangles,
        visible: &vec![0.01; triangles.len()],
        lights: scene.emitting_objects().len(),
    };
    for (hotspot, here) in found.iter_mut().zip(&soundings[1..]) {
        hotspots::explain(hotspot, here, &soundings[0], &context);
    }
    assert!(!found.is_empty(), "nothing stands out");
    found
}

/// What is told of the costliest hotspot, for messages.
fn told(found: &[Hotspot]) -> String {
    let one =
        |h: &Hotspot| format!("{:?} {:.2}: {} [{}] {:?}", h.name, h.excess_share, h.cause, h.fix, h.whatif);
    found.iter().map(one).collect::<Vec<_>>().join("\n")
}

/// The costliest hotspot on an object.
fn on<'h>(found: &'h [Hotspot], name: &str) -> &'h [Hotspot] {
    let at = found.iter().position(|h| h.name.as_deref() == Some(name));
    let at = at.unwrap_or_else(|| panic!("no hotspot on {name}\n{}", told(found)));
    &found[at..=at]
}

/// The first cause of the costliest hotspot.
fn assert_first(found: &[Hotspot], kind: CauseKind, names: &[&str]) {
    let first = found[0].causes.first().unwrap_or_else(|| panic!("no cause\n{}", told(found)));
    assert_eq!(first.kind, kind, "{}", told(found));
    let mut expected = names.to_vec();
    expected.sort_unstable();
    let mut got: Vec<&str> = first.names.iter().map(String::as_str).collect();
    got.sort_unstable();
    assert_eq!(got, expected, "{}", told(found));
    assert!(first.confidence >= 0.75, "{} {}", first.confidence, told(found));
    assert!(names.iter().all(|name| found[0].cause.contains(name)), "{}", told(found));
    assert!(found[0].sounded >= 1000, "{}", found[0].sounded);
}

fn assert_never(found: &[Hotspot], kind: CauseKind) {
    let named = found.iter().flat_map(|h| &h.causes).any(|cause| cause.kind == kind);
    assert!(!named, "{kind:?} is named\n{}", told(found));
}

/// Two upright panels that face each other, seen into.
fn facing(width: f64) -> World {
    let x = 0.5 * width;
    floor().named("Left", rectangle([-x, 1.5, 0.0], [0.0, 0.0, -5.0], [0.0, 1.5, 0.0]), matte(WHITE)).named(
        "Right",
        rectangle([x, 1.5, 0.0], [0.0, 0.0, 5.0], [0.0, 1.5, 0.0]),
        mirror(WHITE),
    )
}

#[test]
fn a_narrow_lane_traps_paths_between_its_walls() {
    let camera = pinhole([0.0, 7.0, 6.0], [0.0, 1.0, 0.0], 50.0);
    let found = explained(&facing(0.5), &camera);
    let left = on(&found, "Left");
    assert_first(left, CauseKind::Trapped, &["Left", "Right"]);
    // The matte one cannot be made matte.
    assert!(left[0].whatif.iter().any(|w| w == "--matte 'Right material'"), "{:?}", left[0].whatif);
    assert!(!left[0].whatif.iter().any(|w| w == "--matte 'Left material'"), "{:?}", left[0].whatif);
    assert!(left[0].whatif.iter().any(|w| w == "--max-depth 6"), "{:?}", left[0].whatif);
    // A wide one lets them go.
    assert_never(&explained(&facing(7.0), &camera), CauseKind::Trapped);
}

/// A single mirror makes paths one longer: no trap.
#[test]
fn a_mirror_alone_is_no_trap() {
    let world =
        floor().named("Mirror", rectangle([0.0, 1.5, -1.0], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0]), mirror(WHITE));
    assert_never(&explained(&world, &view()), CauseKind::Trapped);
}

#[test]
fn interleaved_meshes_have_overlapping_bounds() {
    let (min, max) = ([-1.2, 0.2, -1.2], [1.2, 2.6, 1.2]);
    let both = |a: Mesh, b: Mesh| floor().named("Ivy", a, matte(GREY)).named("Hedge", b, matte(GREY));
    let (ivy, hedge) = (soup(4000, 1, min, max, 0.05), soup(4000, 2, min, max, 0.05));
    let found = explained(&both(ivy.clone(), hedge.clone()), &view());
    assert_first(&found, CauseKind::OverlappingBounds, &["Hedge", "Ivy"]);
    // The same triangles as one mesh.
    let found = explained(&floor().named("Hedge", joined([ivy, hedge]), matte(GREY)), &view());
    assert_first(&found, CauseKind::DenseGeometry, &["Hedge"]);
    assert_never(&found, CauseKind::OverlappingBounds);
    // Side by side.
    let apart = both(
        soup(4000, 1, [-2.4, 0.2, -1.2], [-0.1, 2.6, 1.2], 0.05),
        soup(4000, 2, [0.1, 0.2, -1.2], [2.4, 2.6, 1.2], 0.05),
    );
    assert_never(&explained(&apart, &view()), CauseKind::OverlappingBounds);
}

#[test]
fn a_stack_of_coincident_triangles_has_heavy_leaves() {
    let plate = || rectangle([0.0, 1.0, 0.0], [1.2, 0.0, 0.0], [0.0, 0.0, -1.2]);
    let stack = joined((0..150).map(|_| plate()));
    let found = explained(&floor().named("Stack", stack, matte(GREY)), &view());
    assert_first(&found, CauseKind::HeavyLeaves, &["Stack"]);
    assert!(found[0].whatif.iter().any(|w| w == "--delete Stack"), "{:?}", found[0].whatif);
    // As many triangles, one beside the other.
    let ball = sphere([0.0, 1.3, 0.0], 1.2, 4, false);
    let found = explained(&floor().named("Ball", ball, matte(GREY)), &view());
    assert_never(&found, CauseKind::HeavyLeaves);
}

/// A stage under a lamp, a cloud of small triangles that may hang between the two, and another lamp that is free.
fn shaded(cloud: V3) -> World {
    let at = |offset: V3| add_scaled(cloud, 1.0, offset);
    let cloud = soup(20_000, 3, at([-0.9, -0.3, -0.9]), at([0.9, 0.3, 0.9]), 0.03);
    let spare = rectangle([9.0, 3.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
    floor()
        .named("Stage", rectangle([0.0, 0.02, 0.0], [0.0, 0.0, 1.3], [1.3, 0.0, 0.0]), matte(GREY))
        .named("Cloud", cloud, matte(GREY))
        .named("Spare lamp", spare, light([2.0; 3]))
}

#[test]
fn a_hidden_light_blocks_shadow_rays() {
    let camera = pinhole([0.0, 5.0, 8.0], [0.0; 3], 40.0);
    let found = explained(&shaded([0.0, 6.8, 0.0]), &camera);
    let stage = on(&found, "Stage");
    assert_first(stage, CauseKind::BlockedShadowRays, &["Lamp"]);
    assert!(stage[0].whatif.iter().any(|w| w == "--delete Lamp"), "{:?}", stage[0].whatif);
    // Low in the light it costs those who see it for itself.
    let low = explained(&shaded([0.0, 1.5, 0.0]), &camera);
    assert_eq!(low[0].name.as_deref(), Some("Cloud"), "{}", told(&low));
    assert!(low[0].causes.iter().all(|cause| cause.kind != CauseKind::BlockedShadowRays), "{}", told(&low));
}

/// Cards one behind the other.
fn cards(alpha: Alpha) -> World {
    let card = |i: usize| panel([0.0, 1.4, 1.0 - 0.15 * i as f64], [1.3, 0.0, 0.0], [0.0, 1.3, 0.0]);
    let leaves = image(16, 16, |x, y| [60, 160, 40, if (x + 3 * y) % 5 == 0 { 255 } else { 0 }]);
    floor().with_texture(leaves).named("Leaves", joined((0..14).map(card)), Material { alpha, ..matte(GREY) })
}

#[test]
fn cards_with_holes_take_alpha_tests() {
    let alpha = Scalar { factor: 1.0, texture: Some((nearest(0), Channel::A)) };
    let found = explained(&cards(Alpha::Mask { cutoff: 0.5, alpha }), &view());
    assert_first(&found, CauseKind::AlphaTests, &["Leaves"]);
    assert_never(&found, CauseKind::HeavyLeaves);
    assert_never(&explained(&cards(Alpha::Opaque), &view()), CauseKind::AlphaTests);
}

/// A fine ball whose every shading needs four textures, or none.
fn painted(textured: bool) -> World {
    let texture = |yes: bool| yes.then(|| nearest(0));
    let scalar = Scalar { factor: 1.0, texture: texture(textured).map(|t| (t, Channel::G)) };
    let color = Color { factor: [0.8; 3], texture: texture(textured) };
    let bsdf =
        Bsdf::Substrate { diffuse: color, specular: color, specular_weight: scalar, roughness: scalar };
    let mut ball = sphere([0.0, 1.3, 0.0], 1.2, 5, false);
    ball.uvs = Some(ball.positions.iter().map(|p| [p[0], p[1]]).collect());
    floor().with_texture(image(8, 8, |x, y| [200, (90 + 9 * x) as u8, (90 + 9 * y) as u8, 255])).named(
        "Ball",
        ball,
        Material { bsdf, ..matte(GREY) },
    )
}

#[test]
fn many_textures_are_told_apart_from_cost() {
    let found = explained(&painted(true), &view());
    let ball = found.iter().find(|h| h.name.as_deref() == Some("Ball")).expect("the ball is a hotspot");
    let textures = ball
        .causes
        .iter()
        .find(|c| c.kind == CauseKind::Textures)
        .unwrap_or_else(|| panic!("{}", told(&found)));
    assert!(textures.share.is_none() && textures.here > 1.5, "{textures:?}");
    assert_never(&explained(&painted(false), &view()), CauseKind::Textures);
}

/// A yard of low walls, each an object of its own, open to the sky.
fn yard(material: Material) -> World {
    let wall = |i: usize| {
        let (sin, cos) = (core::f64::consts::TAU * i as f64 / 12.0).sin_cos();
        rectangle([1.6 * sin, 0.9, 1.6 * cos], [-0.42 * cos, 0.0, 0.42 * sin], [0.0, 0.9, 0.0])
    };
    let ground = rectangle([0.0, 0.01, 0.0], [0.0, 0.0, 1.5], [1.5, 0.0, 0.0]);
    let yard = floor().named("Ground", ground, material.clone());
    (0..12).fold(yard, |world, i| world.named(&format!("Wall {i}"), wall(i), material.clone()))
}

/// A niche of five walls, open to the camera.
fn niche(material: &dyn Fn(&str) -> Material) -> World {
    let walls = [
        ("Back", [0.0, 1.5, -2.0], [1.5, 0.0, 0.0], [0.0, 1.5, 0.0]),
        ("Left", [-1.5, 1.5, 0.0], [0.0, 0.0, -2.0], [0.0, 1.5, 0.0]),
        ("Right", [1.5, 1.5, 0.0], [0.0, 0.0, 2.0], [0.0, 1.5, 0.0]),
        ("Bottom", [0.0, 0.01, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, -2.0]),
        ("Top", [0.0, 3.0, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, 2.0]),
    ];
    walls.iter().fold(floor(), |world, &(name, center, u, v)| {
        world.named(name, rectangle(center, u, v), material(name))
    })
}

#[test]
fn a_white_yard_makes_paths_long() {
    let camera = pinhole([0.0, 7.0, 6.0], [0.0, 0.5, 0.0], 60.0);
    let found = explained(&yard(matte(WHITE)), &camera);
    let long = found[0].causes.iter().find(|cause| cause.kind == CauseKind::LongPaths);
    let long = long.unwrap_or_else(|| panic!("{}", told(&found)));
    assert!(long.here > 1.25 * long.ordinary && long.confidence >= 0.75, "{}", told(&found));
    assert!(found[0].whatif.iter().any(|w| w == "--max-depth 6"), "{:?}", found[0].whatif);
    assert_never(&found, CauseKind::Trapped);
    // Paths leave a ball at once, however costly it is.
    assert_never(&explained(&painted(false), &view()), CauseKind::LongPaths);
}

/// Mirrors around a niche that looks out into the dark.
#[test]
fn mirrors_before_the_dark_are_futile() {
    let camera = pinhole([0.0, 2.0, 9.0], [0.0, 1.4, 0.0], 60.0);
    let found = explained(&niche(&|_| mirror(WHITE)), &camera);
    let futile = found.iter().flat_map(|h| &h.causes).any(|c| c.kind == CauseKind::FutilePaths);
    assert!(futile, "{}", told(&found));
    assert_never(
        &explained(&niche(&|_| mirror(WHITE)).with_environment([0.3; 3]), &camera),
        CauseKind::FutilePaths,
    );
}
