//! The shared scenes and the reference images rendered from them by another renderer, where they lie beside the checkout.

use crate::picture::Picture;
use crate::say;
use hotspot_integrator::{BuildOptions, RenderScene};
use hotspot_scene::{Camera, LoadOptions, Scene};
use std::path::{Path, PathBuf};

/// A scene loaded from a file and made ready, with its first camera.
#[derive(Debug)]
pub struct Loaded {
    /// Ready for rendering.
    pub scene: RenderScene,
    /// Where from.
    pub camera: Camera,
}

/// A reference image and its two halves: independent estimates of the same picture.
#[derive(Debug)]
pub struct Reference {
    /// The mean of both.
    pub mean: Picture,
    /// First half.
    pub a: Picture,
    /// Second half.
    pub b: Picture,
}

impl Loaded {
    /// Makes a scene with a camera ready.
    pub fn new(scene: &Scene) -> Self {
        Self {
            scene: RenderScene::prepare(scene, BuildOptions::default()).expect("the scene can be rendered"),
            camera: scene.cameras.first().expect("the scene has a camera").clone(),
        }
    }
}

fn shared() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared")
}

fn load(path: &Path) -> Option<Scene> {
    if path.is_file() {
        return Some(hotspot_scene::load(path, &LoadOptions::default()).expect("the scene loads"));
    }
    say(&format!("SKIPPED: there is no {}", path.display()));
    None
}

/// A shared scene, or a visible note that the test over it is skipped.
pub fn shared_scene(name: &str) -> Option<Scene> {
    load(&shared().join("scenes").join(name).join(format!("{name}.gltf")))
}

/// A scene of the project's own, or a visible note that the test over it is skipped.
pub fn own_scene(name: &str) -> Option<Scene> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    load(&folder.join(name).join(format!("{name}.gltf")))
}

/// A reference by its name without ending, or a visible note that the test over it is skipped.
pub fn reference(name: &str) -> Option<Reference> {
    let path = |end: &str| shared().join("references").join(format!("{name}{end}.exr"));
    if !["", "_a", "_b"].iter().all(|end| path(end).is_file()) {
        say(&format!("SKIPPED: there is no {} with its halves", path("").display()));
        return None;
    }
    let read = |end| Picture::read(&path(end));
    Some(Reference { mean: read(""), a: read("_a"), b: read("_b") })
}
