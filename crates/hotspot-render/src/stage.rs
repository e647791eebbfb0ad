//! A scene on stage: opened, prepared, seen from its camera, with the threads that will render it. What every command that
//! renders has in common.

use crate::args::FilmArgs;
use crate::fail::{FAILED, Fail};
use crate::memory;
use crate::open::{SceneArgs, default_size};
use crate::progress::Talker;
use hotspot_cost::document::{Note, Stopped, Tree};
use hotspot_cost::hotspots::Sounding;
use hotspot_cost::{Document, Frame, LayerOptions, Layers};
use hotspot_integrator::{
    BakeView, Baked, Control, FirstHit, Quality, RenderScene, Rendered, Roulette, Settings, Stop,
    SurfaceMesh, bake, first_hits, render, sound, surface_view, viewpoints,
};
use hotspot_scene::{Camera, Environment, Repair, Scene};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// A scene ready to be rendered any number of times.
pub(crate) struct Stage<'a> {
    pub(crate) name: String,
    pub(crate) prepared: RenderScene,
    pub(crate) camera: Camera,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// What the file uses and we do not model.
    pub(crate) unmodelled: Vec<Note>,
    /// What was mended in it.
    pub(crate) repairs: Vec<Note>,
    /// Seconds that the caller spent on loading the scene.
    pub(crate) load_seconds: f64,
    lights: String,
    open: &'a SceneArgs,
    film: &'a FilmArgs,
    pool: rayon::ThreadPool,
}

impl<'a> Stage<'a> {
    /// Prepares a scene; the caller may drop it then, since meshes and textures live on in here.
    pub(crate) fn new(scene: &Scene, open: &'a SceneArgs, film: &'a FilmArgs) -> Result<Self, Fail> {
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(film.threads.unwrap_or(0) as usize).build().map_err(
                |e| Fail::new(FAILED, format!("cannot start the worker threads: {e}; try --threads 1")),
            )?;
        let prepared = open.prepare(scene)?;
        let (camera, camera_note) = open.choose_camera(scene, &prepared)?;
        let long_edge = if open.demo { 640.0 } else { 960.0 };
        let (width, height) = film.size.unwrap_or_else(|| default_size(&camera, long_edge));
        let repairs = scene.repairs.iter().chain(prepared.repairs()).chain(&camera_note);
        let note = |r: &Repair| Note { what: r.what.clone(), element: r.element.clone(), count: r.count };
        Ok(Self {
            name: scene.name.clone(),
            width,
            height,
            unmodelled: scene
                .unmodelled
                .iter()
                .map(|u| Note {
                    what: format!("{}: {}", u.feature, u.effect),
                    element: u.element.clone(),
                    count: 1,
                })
                .collect(),
            repairs: repairs.map(note).collect(),
            load_seconds: 0.0,
            lights: lights(scene, &prepared),
            prepared,
            camera,
            open,
            film,
            pool,
        })
    }

    /// Size, depth, roulette, seed and sampler as asked for; the rest is the default.
    pub(crate) fn settings(&self) -> Settings {
        let mut settings = Settings::new(self.width, self.height);
        settings.max_depth = self.film.max_depth;
        settings.seed = self.film.seed;
        settings.sampler = self.film.sampler.kind();
        settings.roulette = self.film.roulette;
        settings.adaptive = self.film.adaptive;
        settings.light_choice = self.film.lights.choice();
        settings
    }

    /// Renders on the stage's own threads.
    pub(crate) fn render(&self, settings: &Settings, control: Control<'_>) -> Rendered {
        self.render_over(&self.prepared, settings, control)
    }

    /// The layers of a render, made on the stage's own threads.
    pub(crate) fn layers(&self, rendered: &Rendered, options: &LayerOptions) -> Layers {
        self.pool.install(|| Layers::from_frame(&rendered.frame, options))
    }

    /// Does something on the stage's own threads.
    pub(crate) fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }

    /// The same of another preparation of the scene: over another tree, or of an edited scene.
    pub(crate) fn render_over(
        &self,
        prepared: &RenderScene,
        settings: &Settings,
        control: Control<'_>,
    ) -> Rendered {
        self.pool.install(|| render(prepared, &self.camera, settings, control))
    }

    /// Books a few more paths through regions of the picture, on the stage's own threads.
    pub(crate) fn sound(&self, settings: &Settings, regions: &[Vec<u32>]) -> Vec<Vec<Sounding>> {
        self.pool.install(|| sound(&self.prepared, &self.camera, settings, regions))
    }

    /// Refuses frames that would not fit, before anything is allocated. `frames`: how many are held at once.
    pub(crate) fn check_memory(&self, intervals: bool, frames: u64) -> Result<(), Fail> {
        self.check_memory_beside(intervals, frames, 0)
    }

    /// The same where `beside` bytes per pixel are wanted beside the frames.
    pub(crate) fn check_memory_beside(&self, intervals: bool, frames: u64, beside: u64) -> Result<(), Fail> {
        let (width, height, limit) = (self.width, self.height, self.open.max_memory);
        // Sums in f64 and u64, then planes in f32, then the EXR writer's copy: about 800 bytes per pixel and half.
        let per_pixel = (800 * (1 + u64::from(intervals))).saturating_mul(frames).saturating_add(beside);
        let bytes = (u64::from(width) * u64::from(height)).saturating_mul(per_pixel);
        if bytes > limit.saturating_mul(1 << 20) {
            return Err(Fail::usage(format!(
                "{width} x {height} pixels with every layer need about {} MiB, more than --max-memory {limit}; \
                 make the picture smaller or raise the limit",
                bytes >> 20,
            )));
        }
        Ok(())
    }

    /// Says what is about to be rendered and what of the file will not be seen as its author meant it.
    pub(crate) fn announce(&self, talker: &Talker) {
        let prepared = &self.prepared;
        talker.say(&format!(
            "{}: {} triangles{} in {} objects, {}, tree built in {:.2} s",
            self.name,
            prepared.placed_triangle_count(),
            match prepared.instance_count() {
                0 => String::new(),
                count => format!(" ({} stored, {count} instances)", prepared.triangle_count()),
            },
            prepared.objects().len(),
            self.lights,
            prepared.build_seconds()
        ));
        for u in self.unmodelled.iter().take(8) {
            talker.say(&format!("not modelled: {} ({})", u.what, u.element));
        }
        if self.unmodelled.len() > 8 {
            talker
                .say(&format!("… and {} more, listed in the JSON and the report", self.unmodelled.len() - 8));
        }
        for r in self.repairs.iter().take(8) {
            let times = if r.count > 1 { format!(" ({} times)", r.count) } else { String::new() };
            talker.say(&format!("note: {}: {}{times}", r.element, r.what));
        }
        if self.repairs.len() > 8 {
            talker.say(&format!(
                "… and {} more notes, listed in the JSON and the report",
                self.repairs.len() - 8
            ));
        }
    }

    /// What the camera sees first, of at most `most` samples of each pixel; `None` when interrupted.
    pub(crate) fn first_hits(
        &self,
        settings: &Settings,
        frame: &Frame,
        most: u64,
        cancel: &AtomicBool,
    ) -> Option<Vec<FirstHit>> {
        let (scene, camera) = (&self.prepared, &self.camera);
        self.pool.install(|| first_hits(scene, camera, settings, frame, most, Some(cancel)))
    }

    /// Cost where rays land, on a mesh of the stage's scene.
    pub(crate) fn bake(
        &self,
        mesh: &SurfaceMesh,
        view: BakeView<'_>,
        settings: &Settings,
        control: Control<'_>,
    ) -> Baked {
        self.pool.install(|| bake(&self.prepared, mesh, view, settings, control))
    }

    /// Points to look at the scene from.
    pub(crate) fn viewpoints(&self, count: u32) -> Vec<[f32; 3]> {
        viewpoints(&self.prepared, count)
    }

    /// Values at a mesh's vertices, as the camera sees them.
    pub(crate) fn surface_view(&self, mesh: &SurfaceMesh, values: &[f32]) -> Vec<f32> {
        let size = (self.width, self.height);
        self.pool.install(|| surface_view(&self.prepared, mesh, values, &self.camera, size))
    }

    /// Worker threads.
    pub(crate) fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// The document of a render on this stage. Settings and hotspots are the caller's to add.
    pub(crate) fn document(&self, rendered: &Rendered, options: &LayerOptions) -> Document {
        self.document_over(&self.prepared, rendered, options)
    }

    /// The same of another preparation of the scene.
    pub(crate) fn document_over(
        &self,
        prepared: &RenderScene,
        rendered: &Rendered,
        options: &LayerOptions,
    ) -> Document {
        let held = prepared.memory();
        let mut document = self.pool.install(|| Document::of_frame(&rendered.frame, options));
        document.generator = format!("hotspot-render {}", env!("CARGO_PKG_VERSION"));
        document.scene.clone_from(&self.name);
        document.command = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
        document.render.seconds = rendered.seconds;
        document.render.load_seconds = self.load_seconds;
        document.render.build_seconds = prepared.build_seconds();
        document.render.threads = rendered.threads as u32;
        document.render.kernel.clone_from(&rendered.kernel);
        document.render.stopped = Some(match rendered.stop {
            Stop::Done => Stopped::Samples,
            Stop::TimeLimit => Stopped::TimeLimit,
            Stop::Enough => Stopped::TargetError,
            Stop::Cancelled => Stopped::Interrupted,
        });
        document.tree = Tree {
            builder: match self.open.prepare_options().tree.quality {
                Quality::Obvhs => "obvhs ploc medium".to_owned(),
                ours => format!("ploc {}", ours.name()),
            },
            width: hotspot_bvh::WIDTH,
            nodes: prepared.bvh().node_count() as u64,
            triangles: prepared.triangle_count() as u64,
            digest: tree_digest(prepared),
        };
        document.memory.geometry = held.geometry;
        document.memory.bvh = held.bvh;
        document.memory.textures = held.textures;
        document.memory.peak = memory::peak();
        document.unmodelled.clone_from(&self.unmodelled);
        document.repairs.clone_from(&self.repairs);
        document
    }

    /// The choices that make the picture, for the settings in the outputs.
    pub(crate) fn described(&self, settings: &Settings) -> BTreeMap<String, Value> {
        let mut map = BTreeMap::new();
        let mut put = |name: &str, value: Value| map.insert(name.to_owned(), value);
        put("spp", json!(settings.spp));
        put("cost-spp", json!(settings.cost_spp));
        put("max-depth", json!(settings.max_depth));
        put(
            "roulette",
            match settings.roulette {
                Roulette::Off => json!("off"),
                Roulette::From(from) => json!(from),
                Roulette::Efficient => json!("efficient"),
            },
        );
        put("seed", json!(settings.seed));
        put("sampler", json!(settings.sampler.name()));
        put("intervals", json!(settings.intervals));
        put("adaptive", json!(settings.adaptive));
        put("lights", json!(settings.light_choice.name()));
        put("camera", json!(self.camera.name));
        put("trace-shadow-rays", json!(settings.gather.trace_shadow_rays));
        for (name, value) in self.open.described() {
            put(name, value);
        }
        map
    }
}

/// FNV-1a over the words of the tree: equal for equal trees, for telling whether two renders went over the same one.
fn tree_digest(prepared: &RenderScene) -> String {
    let mix = |hash: u64, word: u32| (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", prepared.bvh().words().fold(0xcbf2_9ce4_8422_2325, mix))
}

/// What shines, in words.
fn lights(scene: &Scene, prepared: &RenderScene) -> String {
    let mut words = vec![format!("{} emissive triangles", prepared.light_count())];
    if prepared.punctual_light_count() > 0 {
        words.push(format!("{} punctual lights", prepared.punctual_light_count()));
    }
    match &scene.environment {
        Some(Environment::Map(map)) => words.push(format!("environment \"{}\"", map.name)),
        Some(Environment::Constant(_)) => words.push("a constant environment".into()),
        None => {}
    }
    words.join(", ")
}
