//! The ledgers of real renders against an oracle that keeps every event of every ray and books them by the definition.

use crate::camera::FilmCamera;
use crate::class::FullClass;
use crate::geometry::Instancing;
use crate::path::{Start, trace};
use crate::sampler::{Dimensions, PixelSampler};
use crate::{BuildOptions, Control, PrepareOptions, RenderScene, Settings, frame_bounds, render};
use hotspot_bvh::simd::Portable;
use hotspot_cost::Counter;
use hotspot_cost::ledger::{Ledgers, Traversal};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};
use std::collections::BTreeMap;
use std::path::Path;

/// What a traversal told.
enum Event {
    Node(u32, u32),
    Leaf(u32),
    Instance(u32),
    Alpha,
}

#[derive(Default)]
struct Log(Vec<(Spawner, Vec<Event>)>);

struct RayLog<'r>(&'r mut Vec<Event>);

impl RayProbe for RayLog<'_> {
    fn node(&mut self, id: u32, boxes: u32) {
        self.0.push(Event::Node(id, boxes));
    }
    fn leaf(&mut self, id: u32, _shapes: u32) {
        self.0.push(Event::Leaf(id));
    }
    fn instance(&mut self, id: u32) {
        self.0.push(Event::Instance(id));
    }
    fn alpha(&mut self, _lookups: u32, _bytes: u32) {
        self.0.push(Event::Alpha);
    }
    fn finish(self, _hit: bool) {}
}

impl Probe for Log {
    const ON: bool = true;
    type Ray<'p> = RayLog<'p>;
    fn ray(&mut self, by: Spawner) -> RayLog<'_> {
        self.0.push((by, Vec::new()));
        RayLog(&mut self.0.last_mut().unwrap().1)
    }
    fn untraced(&mut self, _by: Spawner) {}
    fn bsdf(&mut self, _evaluations: u32) {}
    fn texture(&mut self, _lookups: u32, _bytes: u32) {}
}

/// Object of a leaf block's triangles, one by one; `inside`: object of the instance that the ray is in. Ids tell blocks of
/// the world from those of meshes: the latter are visited inside alone.
fn triangles(scene: &RenderScene, block: u32, inside: Option<u32>) -> Vec<u32> {
    let triangles = scene.bvh.block_triangles(block);
    match inside {
        Some(object) => triangles.map(|_| object).collect(),
        None => triangles.map(|t| scene.geometry.part(t).object).collect(),
    }
}

fn one(objects: &[u32]) -> Option<u32> {
    let first = *objects.first()?;
    objects.iter().all(|object| *object == first).then_some(first)
}

/// What was met, and paths that went on from there.
type Matrix = BTreeMap<(Option<u32>, Option<u32>), (Traversal, u64)>;

/// Books the leaves of a render ray by ray, by asking the scene for the object of each triangle, and nodes by what the tree says
/// of them (`hotspot-bvh` tests that against a walk).
fn oracle(scene: &RenderScene, camera: &hotspot_scene::Camera, settings: &Settings) -> (Matrix, u64) {
    let owners = scene.bvh.owners(
        |triangle| scene.geometry.part(triangle).object,
        |instance| scene.geometry.placed[instance as usize].part.object,
    );
    let film = FilmCamera::new(camera, f64::from(settings.width) / f64::from(settings.height));
    let guides = settings.guides(scene, None);
    let path = settings.path(true, &guides);
    let mut matrix = Matrix::new();
    let mut rays = 0;
    for y in 0..settings.height {
        for x in 0..settings.width {
            let pixel = PixelSampler::new(settings.sampler, x, y, 0, settings.seed);
            for index in 0..u64::from(settings.spp) {
                let sampler = pixel.sample(index);
                let [u, v, light @ ..] = sampler.get(Dimensions::segment(0));
                let (origin, direction) =
                    film.ray((x as f32 + u) / settings.width as f32, (y as f32 + v) / settings.height as f32);
                let mut log = Log::default();
                trace::<_, _, FullClass, false>(
                    Portable,
                    scene,
                    &path,
                    Start::new((origin, direction), light),
                    &sampler,
                    &mut log,
                );
                rays += log.0.len() as u64;
                let mut left = None;
                for (by, events) in log.0 {
                    let spawner = (by.object != NONE).then_some(by.object);
                    if by.kind == RayKind::Bounce {
                        matrix.entry((left, spawner)).or_default().1 += 1;
                        left = spawner;
                    }
                    let (mut inside, mut block) = (None, None);
                    let mut book = |payer: Option<u32>, what: &dyn Fn(&mut Traversal)| {
                        what(&mut matrix.entry((spawner, payer)).or_default().0);
                    };
                    for event in events {
                        match event {
                            Event::Node(id, boxes) => {
                                let payer = match owners.nodes[id as usize] {
                                    hotspot_bvh::Owner::One(object) => Some(object),
                                    hotspot_bvh::Owner::Several => None,
                                    hotspot_bvh::Owner::Instance => inside,
                                };
                                book(payer, &|t| {
                                    t.nodes += 1;
                                    t.boxes += u64::from(boxes);
                                });
                            }
                            Event::Leaf(id) => {
                                let of_mesh = owners.blocks[id as usize] == hotspot_bvh::Owner::Instance;
                                let objects = triangles(scene, id, inside.filter(|_| of_mesh));
                                block = one(&objects);
                                book(block, &|t| t.leaves += 1);
                                for object in objects {
                                    book(Some(object), &|t| t.shapes += 1);
                                }
                            }
                            Event::Instance(id) => {
                                inside = Some(scene.geometry.placed[id as usize].part.object);
                                book(inside, &|t| t.instances += 1);
                            }
                            Event::Alpha => book(block, &|t| t.alpha_tests += 1),
                        }
                    }
                }
            }
        }
    }
    (matrix, rays)
}

fn sum(rows: impl Iterator<Item = Traversal>) -> Traversal {
    rows.fold(Traversal::default(), |mut sum, row| {
        sum.add(&row);
        sum
    })
}

fn check(file: &str, instancing: Instancing) -> Ledgers {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(file);
    let loaded = hotspot_scene::load(&path, &hotspot_scene::LoadOptions::default()).unwrap();
    let options = PrepareOptions { tree: BuildOptions::default(), instancing, max_memory_bytes: None };
    let scene = RenderScene::prepare(&loaded, options).unwrap();
    let (min, max) = scene.bounds();
    let camera = loaded.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
    let mut settings = Settings::new(24, 18);
    settings.spp = 3;
    settings.ledgers = true;
    let rendered = render(&scene, &camera, &settings, Control::default());
    let ledgers = rendered.ledgers.unwrap();
    let (matrix, rays) = oracle(&scene, &camera, &settings);
    let found: Matrix =
        ledgers.matrix.iter().map(|row| ((row.spawner, row.payer), (row.traversal, row.landed))).collect();
    assert_eq!(found, matrix, "{file}");
    assert_eq!(ledgers.spawner.iter().map(|row| row.rays).sum::<u64>(), rays, "{file}");
    // And all of it is what the frame counted.
    let total = |counter| rendered.frame.costs().map(|pixel| pixel.get(counter)).sum::<u64>();
    let expected = Traversal {
        nodes: total(Counter::Nodes),
        boxes: total(Counter::Boxes),
        leaves: total(Counter::Leaves),
        shapes: total(Counter::Shapes),
        instances: total(Counter::Instances),
        alpha_tests: total(Counter::AlphaTests),
    };
    assert_eq!(sum(ledgers.spawner.iter().map(|row| row.traversal)), expected, "{file}");
    assert_eq!(sum(ledgers.payer.iter().map(|row| row.traversal)), expected, "{file}");
    assert_eq!(sum(ledgers.matrix.iter().map(|row| row.traversal)), expected, "{file}");
    let shadow =
        |row: &&hotspot_cost::ledger::SpawnerRow| row.kind == hotspot_cost::ledger::SpawnerKind::Shadow;
    let sent = sum(ledgers.spawner.iter().filter(shadow).map(|row| row.traversal));
    assert_eq!(sent.nodes, total(Counter::NodesShadow), "{file}");
    let bounces = total(Counter::Rays)
        - total(Counter::RaysShadow)
        - rendered.frame.costs().map(|p| p.samples).sum::<u64>();
    assert_eq!(ledgers.matrix.iter().map(|row| row.landed).sum::<u64>(), bounces, "{file}");
    assert!(bounces > 0, "{file}");
    let cast: u64 = ledgers.spawner.iter().filter(shadow).map(|row| row.rays).sum();
    assert_eq!(cast, total(Counter::RaysShadow), "{file}");
    ledgers
}

#[test]
fn ledgers_of_renders_are_those_of_the_oracle() {
    let cornell = check("cornell-box-red/cornell-box-red.gltf", Instancing::default());
    assert!(cornell.spawner.iter().any(|row| row.light.is_some()), "lights are named");
    check("mirror-gap-narrow/mirror-gap-narrow.gltf", Instancing::default());
    check("creature/creature.gltf", Instancing::default());
    let holes = check("features/alpha-mask.gltf", Instancing::default());
    assert!(holes.payer.iter().any(|row| row.traversal.alpha_tests > 0));
    for instancing in [Instancing::Always, Instancing::Never] {
        let copies = check("features/instances.gltf", instancing);
        let entered = copies.payer.iter().any(|row| row.traversal.instances > 0);
        assert_eq!(entered, instancing == Instancing::Always);
    }
}
