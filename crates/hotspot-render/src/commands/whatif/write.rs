//! Writes the edited scene.

use crate::demo;
use crate::fail::{FAILED, Fail};
use crate::open::SceneArgs;
use hotspot_cost::maps::write_atomic;
use hotspot_scene::Container;
use hotspot_scene::edit::Edit;
use std::path::Path;

fn container(file: &Path) -> Option<Container> {
    match file.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "gltf" => Some(Container::Json),
        "glb" => Some(Container::Binary),
        _ => None,
    }
}

/// Refuses what could not be written, before anything is rendered.
pub(super) fn check(file: &Path, open: &SceneArgs) -> Result<(), Fail> {
    let shown = file.display();
    if container(file).is_none() {
        return Err(Fail::usage(format!("--write-scene {shown}: the name must end in .gltf or .glb")));
    }
    let Some(source) = &open.file else { return Ok(()) };
    if source.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
        return Err(Fail::usage(format!(
            "--write-scene: only glTF scenes can be written with their changes, and {} is OBJ; convert it to glTF first",
            source.display()
        )));
    }
    let same = std::fs::canonicalize(source).ok().zip(std::fs::canonicalize(file).ok());
    if same.is_some_and(|(a, b)| a == b) {
        return Err(Fail::usage(format!(
            "--write-scene {shown}: this is the scene itself; choose another name"
        )));
    }
    Ok(())
}

/// Writes it, and says so.
pub(super) fn write(
    file: &Path,
    open: &SceneArgs,
    edits: &[Edit],
    environment: Option<[f32; 3]>,
) -> Result<String, Fail> {
    let container = container(file).unwrap_or(Container::Json);
    let options = open.load_options();
    let bytes = match &open.file {
        Some(source) => hotspot_scene::edited_gltf(source, &options, edits, environment, container)?,
        None => {
            hotspot_scene::edited_glb_bytes("demo.glb", demo::GLB, &options, edits, environment, container)?
        }
    };
    write_atomic(file, &bytes).map_err(|e| {
        Fail::new(
            FAILED,
            format!("--write-scene: cannot write {}: {e}; choose another place", file.display()),
        )
    })?;
    Ok(format!("wrote {}: the edited scene", file.display()))
}
