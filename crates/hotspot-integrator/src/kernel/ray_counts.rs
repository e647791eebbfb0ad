//! Every ray of whole renders costs what the slow oracle says.
//!
//! Under test [`crate::cast`] writes down each ray that it casts on this thread, so that the oracle can be asked the same
//! question: nodes, boxes, leaves, triangles, instances and alpha tests must be equal ray by ray, and their sums equal
//! to the frame of a render, pixel by pixel.

use super::{Kernel, PixelSampler, Sampler, sample};
use crate::camera::FilmCamera;
use crate::class::{FullClass, LobesClass, MatteClass, SceneClass, TexturedClass};
use crate::cutout::Cutouts;
use crate::path::PathResult;
use crate::{Control, Gather, Instancing, PrepareOptions, RenderScene, Settings, render};
use hotspot_bvh::oracle::{self, Counts};
use hotspot_bvh::simd::Portable;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_bvh::{Candidate, Filter, Ray, RayProbe};
use hotspot_cost::Counter;
use hotspot_probe::{Probe, Spawner};
use hotspot_scene::{LoadOptions, Scene, load};
use std::cell::RefCell;
use std::path::PathBuf;

/// A ray as it was cast.
#[derive(Clone, Copy)]
struct Cast {
    ray: Ray,
    key: u32,
    shadow: bool,
}

thread_local! {
    static LOG: RefCell<Option<Vec<Cast>>> = const { RefCell::new(None) };
}

/// Called by `cast.rs`.
pub(crate) fn record(ray: &Ray, key: u32, shadow: bool) {
    LOG.with_borrow_mut(|log| {
        if let Some(log) = log {
            log.push(Cast { ray: *ray, key, shadow });
        }
    });
}

/// What a ray cost: the counts, alpha tests with their look-ups and bytes, and whether it hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cost {
    counts: Counts,
    alpha: [u64; 3],
    hit: bool,
}

/// Writes down the cost of each ray, as the kernel reports it.
#[derive(Default)]
struct Listener(Vec<Cost>);

struct RayListener<'a>(&'a mut Vec<Cost>, Cost);

impl RayProbe for RayListener<'_> {
    fn node(&mut self, _id: u32, boxes: u32) {
        self.1.counts.nodes += 1;
        self.1.counts.boxes += u64::from(boxes);
    }
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.1.counts.leaves += 1;
        self.1.counts.shapes += u64::from(shapes);
    }
    fn instance(&mut self, _id: u32) {
        self.1.counts.instances += 1;
    }
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        let [tests, all_lookups, all_bytes] = self.1.alpha;
        self.1.alpha = [tests + 1, all_lookups + u64::from(lookups), all_bytes + u64::from(bytes)];
    }
    fn finish(self, hit: bool) {
        self.0.push(Cost { hit, ..self.1 });
    }
}

impl Probe for Listener {
    const ON: bool = true;
    type Ray<'p> = RayListener<'p>;
    fn ray(&mut self, _by: Spawner) -> RayListener<'_> {
        RayListener(&mut self.0, Cost::default())
    }
    fn untraced(&mut self, _by: Spawner) {}
    fn bsdf(&mut self, _evaluations: u32) {}
    fn texture(&mut self, _lookups: u32, _bytes: u32) {}
}

/// The scene's filter, with the alpha tests that the oracle asks for; which triangles it concerns it learns from their parts.
struct Asked<'a, 'b>(Cutouts<'a, Portable>, RayListener<'b>);

impl Filter for Asked<'_, '_> {
    const ON: bool = true;

    fn concerns(&self, instance: u32, primitive: u32) -> bool {
        self.0.scene.geometry.surface(instance, primitive).part.cutout
    }

    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, _probe: &mut P) -> bool {
        self.0.accept(candidate, &mut self.1)
    }
}

fn by_oracle(scene: &RenderScene, cast: &Cast) -> Cost {
    let mut unused = Vec::new();
    let mut filter = Asked(
        Cutouts { simd: Portable, scene, ray_key: cast.key },
        RayListener(&mut unused, Cost::default()),
    );
    let (hit, counts) = if cast.shadow {
        oracle::occluded_filtered(&scene.bvh, &cast.ray, &mut filter)
    } else {
        let (hit, counts) = oracle::closest_filtered(&scene.bvh, &cast.ray, &mut filter);
        (hit.is_some(), counts)
    };
    Cost { counts, alpha: filter.1.1.alpha, hit }
}

struct Job<'a> {
    kernel: &'a Kernel<'a>,
    x: u32,
    y: u32,
    sampler: Sampler<'a>,
    listener: &'a mut Listener,
}

impl WithSimd for Job<'_> {
    type Output = PathResult;

    fn run<S: Simd>(self, simd: S) -> PathResult {
        let Job { kernel, x, y, sampler, listener } = self;
        match kernel.scene.class() {
            SceneClass::Matte => simd.vectorize(
                #[inline(always)]
                || sample::<S, _, MatteClass>(simd, kernel, (x, y), &sampler, listener),
            ),
            SceneClass::Lobes => simd.vectorize(
                #[inline(always)]
                || sample::<S, _, LobesClass>(simd, kernel, (x, y), &sampler, listener),
            ),
            SceneClass::Textured => simd.vectorize(
                #[inline(always)]
                || sample::<S, _, TexturedClass>(simd, kernel, (x, y), &sampler, listener),
            ),
            SceneClass::Full => simd.vectorize(
                #[inline(always)]
                || sample::<S, _, FullClass>(simd, kernel, (x, y), &sampler, listener),
            ),
        }
    }
}

/// What a whole render holds in all, to see that the scenes are not too simple.
#[derive(Debug, Default)]
struct Held {
    rays: usize,
    shadow: usize,
    blocked: usize,
    instances: u64,
    alpha: u64,
}

/// Renders a few pixels ray by ray and as a whole.
fn check(name: &str, scene: &Scene, instancing: Instancing) -> Held {
    let options = PrepareOptions { instancing, ..PrepareOptions::default() };
    let ready = RenderScene::prepare(scene, options).expect("the scene is whole");
    let camera = &scene.cameras[0];
    let mut settings = Settings::new(24, 16);
    settings.spp = 3;
    settings.max_depth = 6;
    settings.seed = 5;
    settings.gather = Gather { time: false, ..Gather::ALL };
    let frame = render(&ready, camera, &settings, Control::default()).frame;
    let guides = settings.guides(&ready, None);
    let kernel = Kernel {
        scene: &ready,
        camera: FilmCamera::new(camera, f64::from(settings.width) / f64::from(settings.height)),
        width: settings.width,
        height: settings.height,
        path: settings.path(true, &guides),
        sampler: settings.sampler,
        seed: settings.seed,
        halves: 1,
        counted: 3,
        radiance: true,
        clock: false,
        booking: None,
        lanes: None,
        counted_in_eights: false,
        packets: true,
    };
    let mut held = Held::default();
    for (x, y) in frame.pixels() {
        let pixel = frame.cost_total(x, y);
        let mut sums = [0; 12];
        let mut squares = [0.0; 4];
        for index in 0..u64::from(settings.spp) {
            let points = PixelSampler::new(settings.sampler, x, y, 0, settings.seed);
            let mut listener = Listener::default();
            LOG.set(Some(Vec::new()));
            let job = Job { kernel: &kernel, x, y, sampler: points.sample(index), listener: &mut listener };
            dispatch(ready.bvh.isa(), job);
            let log = LOG.take().expect("it was set above");
            assert_eq!(log.len(), listener.0.len(), "{name}: rays at {x}, {y}");
            let mut path = [0.0; 3];
            for (number, (cast, heard)) in log.iter().zip(&listener.0).enumerate() {
                let told = by_oracle(&ready, cast);
                assert_eq!(*heard, told, "{name} {instancing:?}: ray {number} of sample {index} at {x}, {y}");
                let Counts { nodes, boxes, leaves, shapes, instances } = told.counts;
                let shadow = u64::from(cast.shadow);
                let ray = [1, nodes, boxes, leaves, shapes, instances];
                for (i, value) in ray.into_iter().enumerate() {
                    sums[i] += value;
                    sums[6 + i] += value * shadow;
                }
                for (sum, value) in path.iter_mut().zip([1, nodes, shapes]) {
                    *sum += value as f64;
                }
                held.rays += 1;
                held.shadow += usize::from(cast.shadow);
                held.blocked += usize::from(cast.shadow && told.hit);
                held.instances += instances;
                held.alpha += told.alpha[0];
            }
            let [rays, nodes, shapes] = path;
            for (sum, value) in
                squares.iter_mut().zip([rays * rays, nodes * nodes, shapes * shapes, nodes * shapes])
            {
                *sum += value;
            }
        }
        let expected = [
            Counter::Rays,
            Counter::Nodes,
            Counter::Boxes,
            Counter::Leaves,
            Counter::Shapes,
            Counter::Instances,
            Counter::RaysShadow,
            Counter::NodesShadow,
            Counter::BoxesShadow,
            Counter::LeavesShadow,
            Counter::ShapesShadow,
            Counter::InstancesShadow,
        ];
        assert_eq!(expected.map(|counter| pixel.get(counter)), sums, "{name}: sums at {x}, {y}");
        assert_eq!(pixel.squares, squares, "{name}: squares at {x}, {y}");
    }
    let alpha: u64 = frame.costs().map(|pixel| pixel.get(Counter::AlphaTests)).sum();
    assert_eq!(alpha, held.alpha, "{name}: alpha tests");
    held
}

fn open(path: &str) -> Scene {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../scenes", path].iter().collect();
    load(&path, &LoadOptions::default()).expect("the scene loads")
}

#[test]
fn rays_of_whole_renders_cost_what_the_oracle_says() {
    for name in ["cornell-box-red", "mirror-gap-narrow", "white-room-substrate", "creature"] {
        let scene = open(&format!("{name}/{name}.gltf"));
        let held = check(name, &scene, Instancing::Never);
        assert!(held.rays > 3000 && held.shadow > 900 && held.blocked > 100, "{name}: too simple: {held:?}");
    }
    for name in ["glass", "metal", "many-lights", "lights-punctual", "environment"] {
        check(name, &open(&format!("features/{name}.gltf")), Instancing::Auto);
    }
}

#[test]
fn rays_through_instances_cost_what_the_oracle_says() {
    for name in ["features/instances", "features/gpu-instancing", "creature/creature"] {
        let scene = open(&format!("{name}.gltf"));
        let never = check(name, &scene, Instancing::Never);
        let always = check(name, &scene, Instancing::Always);
        assert!(never.instances == 0 && always.instances > 100, "{name}: {never:?} {always:?}");
    }
}

#[test]
fn rays_through_cutouts_cost_what_the_oracle_says() {
    for name in ["alpha-mask", "alpha-blend"] {
        let scene = open(&format!("features/{name}.gltf"));
        for instancing in [Instancing::Never, Instancing::Always] {
            let held = check(name, &scene, instancing);
            assert!(held.alpha > 100, "{name}: {held:?}");
        }
    }
}
