//! Wavefront OBJ and MTL to a [`Scene`].
//!
//! `text` reads lines, words and numbers; `parse` makes polygons of statements; `library` and `mtl` read materials, `map` and
//! `textures` their pictures, found by `locate`; `material` decides what they mean. `mesh` makes vertices and triangles, with
//! `polygon` for n-gons, `smooth` for smoothing groups and `colors` for vertex colours.

mod colors;
mod library;
mod locate;
mod map;
mod material;
mod mesh;
mod mtl;
mod parse;
mod polygon;
mod smooth;
mod text;
mod textures;

use std::collections::HashMap;

use library::Library;
use mesh::Builder;
use textures::Textures;

use crate::budget::Budget;
use crate::error::Result;
use crate::files::Folder;
use crate::notes::{Names, Notes};
use crate::options::LoadOptions;
use crate::scene::{Instance, Object, Scene};

/// OBJ states everything in world space.
const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Loads an OBJ file whose name without folder and extension is `stem`.
pub(crate) fn load(
    bytes: &[u8],
    stem: &str,
    folder: &Folder,
    options: &LoadOptions,
    budget: &Budget,
) -> Result<Scene> {
    let mut notes = Notes::default();
    let mut parsed = parse::parse(bytes, stem, budget, &mut notes)?;
    let library = Library::read(&parsed, folder, options, budget, &mut notes)?;
    let mut textures = Textures::new(folder, options, budget);
    let mut scene = Scene::default();
    let mut materials: HashMap<Option<usize>, u32> = HashMap::new();
    let mut material_names = Names::default();
    let groups = std::mem::take(&mut parsed.groups);
    let mut builder = Builder::new(&parsed, budget);
    let mut parts = Vec::new();
    for group in groups {
        let material = match materials.get(&group.material) {
            Some(known) => *known,
            None => {
                let mut new = library.material(&parsed, group.material, &mut textures, &mut notes)?;
                new.name = material_names.unique(&new.name);
                scene.materials.push(new);
                // Fewer than the file has lines.
                let index = scene.materials.len() as u32 - 1;
                materials.insert(group.material, index);
                index
            }
        };
        let textured = scene.materials.get(material as usize).is_some_and(material::is_textured);
        parts.push((builder.build(&group, textured, &mut notes)?, group.object, material));
    }
    let mut objects: HashMap<usize, u32> = HashMap::new();
    let mut object_names = Names::default();
    for (part, object, material) in parts {
        let mesh = builder.finish(part, &mut notes)?;
        if mesh.triangles.is_empty() {
            continue;
        }
        let object = *objects.entry(object).or_insert_with(|| {
            let name = object_names.unique(parsed.objects.get(object).map_or("", String::as_str));
            scene.objects.push(Object { name });
            scene.objects.len() as u32 - 1
        });
        scene.meshes.push(mesh);
        let mesh = scene.meshes.len() as u32 - 1;
        scene.instances.push(Instance { object, mesh, material, to_world: IDENTITY });
    }
    scene.textures = textures.images.finish(&mut scene.materials, budget, &mut notes)?.textures;
    (scene.unmodelled, scene.repairs) = notes.into_lists();
    Ok(scene)
}
