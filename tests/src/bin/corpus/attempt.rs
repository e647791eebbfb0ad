//! One model: loaded, prepared and rendered, with what is to be known about it.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use hotspot_integrator::{BuildOptions, Control, RenderScene, frame_bounds, render};
use hotspot_scene::{LoadOptions, load};
use hotspot_tests::picture::{Picture, settings};

/// What is to be known about a model that loaded.
#[derive(Default)]
pub(crate) struct Shown {
    pub(crate) triangles: usize,
    pub(crate) textures: usize,
    pub(crate) lights: usize,
    /// To load it.
    pub(crate) seconds: f64,
    /// Mean of the picture.
    pub(crate) luminance: f64,
    /// Every pixel is finite.
    pub(crate) finite: bool,
    /// Feature to number of elements.
    pub(crate) unmodelled: BTreeMap<String, u64>,
    /// Kind to number of repairs.
    pub(crate) repairs: BTreeMap<String, u64>,
    pub(crate) picture: Option<Picture>,
}

/// What became of a model.
pub(crate) enum Outcome {
    Shown(Box<Shown>),
    Refused(String),
    Panicked(String),
}

/// Tries a model. `size`: width, height, samples per pixel.
pub(crate) fn attempt(file: &Path, size: [u32; 3]) -> Outcome {
    catch_unwind(AssertUnwindSafe(|| unguarded(file, size)))
        .unwrap_or_else(|payload| Outcome::Panicked(message(payload.as_ref())))
}

fn unguarded(file: &Path, [width, height, spp]: [u32; 3]) -> Outcome {
    let started = Instant::now();
    let scene = match load(file, &LoadOptions::default()) {
        Ok(scene) => scene,
        Err(error) => return Outcome::Refused(error.to_string()),
    };
    let seconds = started.elapsed().as_secs_f64();
    let prepared = match RenderScene::prepare(&scene, BuildOptions::default()) {
        Ok(prepared) => prepared,
        Err(error) => return Outcome::Refused(error.to_string()),
    };
    let (min, max) = prepared.bounds();
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| frame_bounds(min, max));
    let rendered = render(&prepared, &camera, &settings(width, height, spp, 15, 0), Control::default());
    let picture = Picture::of_frame(&rendered.frame);
    let [r, g, b] = picture.mean();
    let mut unmodelled = BTreeMap::new();
    for item in &scene.unmodelled {
        *unmodelled.entry(item.feature.clone()).or_default() += 1;
    }
    let mut repairs = BTreeMap::new();
    for item in scene.repairs.iter().chain(prepared.repairs()) {
        *repairs.entry(item.what.clone()).or_default() += item.count;
    }
    Outcome::Shown(Box::new(Shown {
        triangles: prepared.triangle_count(),
        textures: scene.textures.len(),
        lights: prepared.light_count() + prepared.punctual_light_count(),
        seconds,
        luminance: 0.2126 * r + 0.7152 * g + 0.0722 * b,
        finite: rendered.non_finite.is_empty() && picture.pixels.iter().flatten().all(|c| c.is_finite()),
        unmodelled,
        repairs,
        picture: Some(picture),
    }))
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_else(|| "without words".into())
}
