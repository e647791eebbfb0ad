//! Loads glTF and OBJ files into a renderer-neutral [`Scene`].
//!
//! Files are not trusted: [`load`] never panics, reads regular files inside the scene's own folder only, and estimates
//! memory before it allocates. What the scene does not carry is named in [`Scene::unmodelled`], what was mended in
//! [`Scene::repairs`].
//!
//! Skins and morph targets are bent, and animations shown, at one point in time ([`LoadOptions::time`]).
//!
//! Limits of today: triangles only (no points, lines, curves); PNG, JPEG, WebP, BMP and TGA images
//! and the first frames of GIFs; of OBJ's polygons, those that
//! cross themselves are split as fans.
//!
//! ```no_run
//! let scene = hotspot_scene::load("scene.gltf".as_ref(), &hotspot_scene::LoadOptions::default())?;
//! println!("{} objects", scene.objects.len());
//! # Ok::<(), hotspot_scene::LoadError>(())
//! ```
#![forbid(unsafe_code)]

mod budget;
pub mod edit;
mod environment;
mod error;
mod files;
mod geometry;
mod gltf;
mod images;
mod left_out;
mod notes;
mod obj;
mod options;
mod reduce;
mod scene;
mod uri;

use std::path::Path;

use budget::Budget;
use files::Folder;

pub use environment::load_environment;
pub use error::{LoadError, Place};
pub use gltf::rewrite::Container;
pub use options::{LoadOptions, SceneChoice};
pub use scene::*;

/// Loads a scene from a `.gltf`, `.glb` or `.obj` file, recognised by content and extension.
///
/// # Errors
/// [`LoadError`] names the file, the element in it, and what to do.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, LoadError> {
    load_file(path, options).map_err(|error| error.in_file(path))
}

/// Loads a scene from a GLB file in memory. It cannot refer to files. `name` stands for the file in messages, and its stem
/// names the scene.
///
/// # Errors
/// [`LoadError`] names the element and what to do.
pub fn load_glb_bytes(name: &str, bytes: &[u8], options: &LoadOptions) -> Result<Scene, LoadError> {
    let path = Path::new(name);
    let budget = Budget::new(options.max_memory_bytes);
    let mut scene = gltf::load(bytes, true, None, options, &budget).map_err(|error| error.in_file(path))?;
    scene.name = stem(path);
    Ok(scene)
}

/// The bytes of a glTF file with edits made in its JSON, so that nothing else changes; buffers and images that lie in other
/// files are brought inside, so that it opens from anywhere. `options` must be those that the scene was loaded with: they
/// decide which names there are. `environment`: a constant one to write into the scene
/// (`scenes[].extras.environment.constant`).
///
/// # Errors
/// [`LoadError`], also for OBJ files, and for what no change of the JSON can do: moving what a skin places, roughness that
/// lies in a texture.
pub fn edited_gltf(
    path: &Path,
    options: &LoadOptions,
    edits: &[edit::Edit],
    environment: Option<[f32; 3]>,
    container: Container,
) -> Result<Vec<u8>, LoadError> {
    let edited = || {
        let budget = Budget::new(options.max_memory_bytes);
        let bytes = files::read(path, options.max_file_bytes, &budget, "")?;
        let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
        let is_text = matches!(first, Some(b'{' | 0xef));
        if !gltf::glb::is_glb(&bytes) && !is_text {
            return Err(error::unsupported(
                "",
                "the edited scene can only be written for glTF files",
                "convert it to glTF first",
            ));
        }
        let folder = Folder::of(path)?;
        gltf::rewrite::rewrite(&bytes, Some(&folder), options, edits, environment, container)
    };
    edited().map_err(|error: LoadError| error.in_file(path))
}

/// [`edited_gltf`] for a GLB file in memory; `name` stands for it in messages.
///
/// # Errors
/// As [`edited_gltf`].
pub fn edited_glb_bytes(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    edits: &[edit::Edit],
    environment: Option<[f32; 3]>,
    container: Container,
) -> Result<Vec<u8>, LoadError> {
    gltf::rewrite::rewrite(bytes, None, options, edits, environment, container)
        .map_err(|error| error.in_file(Path::new(name)))
}

fn load_file(path: &Path, options: &LoadOptions) -> Result<Scene, LoadError> {
    let budget = Budget::new(options.max_memory_bytes);
    let bytes = files::read(path, options.max_file_bytes, &budget, "")?;
    let folder = Folder::of(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    let mut scene = match extension.as_str() {
        _ if gltf::glb::is_glb(&bytes) => gltf::load(&bytes, true, Some(&folder), options, &budget)?,
        "glb" => gltf::load(&bytes, true, Some(&folder), options, &budget)?,
        "gltf" => gltf::load(&bytes, false, Some(&folder), options, &budget)?,
        "obj" => obj::load(&bytes, &stem(path), &folder, options, &budget)?,
        _ if first == Some(&b'{') => gltf::load(&bytes, false, Some(&folder), options, &budget)?,
        _ => {
            return Err(error::unsupported(
                "",
                "this is neither glTF nor OBJ",
                "give a .gltf, .glb or .obj file",
            ));
        }
    };
    scene.name = stem(path);
    Ok(scene)
}

/// The file's name without folder and extension.
fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".into(), |stem| stem.to_string_lossy().into_owned())
}
