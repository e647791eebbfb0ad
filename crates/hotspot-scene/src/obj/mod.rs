//! Wavefront OBJ and MTL to a [`Scene`].
//!
//! The parser is our own: one pass gives both the checks that name a line and the triangles, and faces with and without
//! normals or texture coordinates may be mixed.

mod material;
mod mtl;
mod parse;
mod text;

use std::collections::HashMap;
use std::path::Path;

use material::Textures;
use mtl::Mtl;
use parse::{Corner, Group, NONE, Parsed};

use crate::budget::Budget;
use crate::error::Result;
use crate::files::{self, Folder, Refusal};
use crate::geometry;
use crate::notes::{Names, Notes};
use crate::options::LoadOptions;
use crate::scene::{Instance, Material, Mesh, Object, Scene};

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
    let library = read_libraries(&parsed, folder, options, budget, &mut notes)?;
    let mut textures = Textures::new(folder, options, budget);
    let mut scene = Scene::default();
    let mut materials: HashMap<Option<usize>, u32> = HashMap::new();
    let mut material_names = Names::default();
    let mut objects: HashMap<usize, u32> = HashMap::new();
    for group in std::mem::take(&mut parsed.groups) {
        let material = match materials.get(&group.material) {
            Some(known) => *known,
            None => {
                let mut new = find_material(&parsed, group.material, &library, &mut textures, &mut notes)?;
                new.name = material_names.unique(&new.name);
                scene.materials.push(new);
                // Fewer than the file has lines.
                let index = scene.materials.len() as u32 - 1;
                materials.insert(group.material, index);
                index
            }
        };
        let name = parsed.objects.get(group.object).cloned().unwrap_or_default();
        let textured = scene.materials.get(material as usize).is_some_and(material::is_textured);
        let mesh = build_mesh(&parsed, &group, name.clone(), textured, budget, &mut notes)?;
        if mesh.triangles.is_empty() {
            continue;
        }
        let object = *objects.entry(group.object).or_insert_with(|| {
            scene.objects.push(Object { name });
            scene.objects.len() as u32 - 1
        });
        scene.meshes.push(mesh);
        let mesh = scene.meshes.len() as u32 - 1;
        scene.instances.push(Instance { object, mesh, material, to_world: IDENTITY });
    }
    scene.textures = textures.images.into_textures();
    (scene.unmodelled, scene.repairs) = notes.into_lists();
    Ok(scene)
}

/// All materials that the `mtllib` statements lead to.
fn read_libraries(
    parsed: &Parsed,
    folder: &Folder,
    options: &LoadOptions,
    budget: &Budget,
    notes: &mut Notes,
) -> Result<HashMap<String, Mtl>> {
    let mut library = HashMap::new();
    for (names, line) in &parsed.libraries {
        let element = format!("line {line}");
        // One name with spaces, or several names.
        let whole = [names.as_str()];
        let several: Vec<&str> = match folder.find(names) {
            Ok(_) => whole.into(),
            Err(_) => names.split_whitespace().collect(),
        };
        for name in several {
            let path = match folder.find(name) {
                Ok(path) => path,
                Err(Refusal::Outside(reason)) => return Err(files::outside(name, reason, &element)),
                Err(Refusal::Missing(_)) => {
                    notes.repair("missing material library left out", &format!("{element}: {name}"), 1);
                    continue;
                }
            };
            let bytes = files::read(&path, options.max_file_bytes, budget, &element)?;
            // A material takes a few hundred bytes for some ten bytes of text.
            budget.charge(bytes.len() as u64, 64, &element)?;
            let name = name.replace('\\', "/");
            mtl::parse(&bytes, Path::new(&name), &mut library, notes)
                .map_err(|error| error.in_file(Path::new(&name)))?;
        }
    }
    Ok(library)
}

/// The material that `usemtl` names, or grey matte.
fn find_material(
    parsed: &Parsed,
    index: Option<usize>,
    library: &HashMap<String, Mtl>,
    textures: &mut Textures<'_>,
    notes: &mut Notes,
) -> Result<Material> {
    let Some((name, line)) = index.and_then(|index| parsed.materials.get(index)) else {
        notes.repair("no material: grey matte used", "faces before any usemtl", 1);
        return Ok(Material::default_matte("default"));
    };
    match library.get(name) {
        Some(mtl) => {
            material::build(name.clone(), mtl, textures, notes).map_err(|error| error.in_file(&mtl.file))
        }
        None => {
            let element = format!("line {line}: usemtl {name}");
            notes.repair("material not found: grey matte used", &element, 1);
            Ok(Material::default_matte(name))
        }
    }
}

/// One vertex for each distinct corner.
fn build_mesh(
    parsed: &Parsed,
    group: &Group,
    name: String,
    textured: bool,
    budget: &Budget,
    notes: &mut Notes,
) -> Result<Mesh> {
    // The clean-up's sums included.
    const VERTEX: u64 = 160;
    budget.charge(group.triangles.len() as u64, 12, &name)?;
    let mut mesh = Mesh { name, triangles: Vec::with_capacity(group.triangles.len()), ..Mesh::default() };
    let mut normals = Vec::new();
    let mut uvs = Vec::new();
    let mut known: HashMap<Corner, u32> = HashMap::new();
    let mut without_uv = 0;
    for triangle in &group.triangles {
        let mut indices = [0; 3];
        for (index, corner) in indices.iter_mut().zip(triangle) {
            let [position, uv, normal] = *corner;
            // What the mesh does not keep must not split vertices.
            let key =
                [position, if textured { uv } else { NONE }, if group.has_normals { normal } else { NONE }];
            if let Some(vertex) = known.get(&key) {
                *index = *vertex;
                continue;
            }
            budget.charge(1, VERTEX, &mesh.name)?;
            // At most as many as corners, whose memory was granted.
            *index = mesh.positions.len() as u32;
            known.insert(key, *index);
            mesh.positions.push(parsed.positions.get(position as usize).copied().unwrap_or_default());
            if group.has_normals {
                normals.push(parsed.normals.get(normal as usize).copied().unwrap_or_default());
            }
            if textured {
                without_uv += u64::from(uv == NONE);
                uvs.push(parsed.uvs.get(uv as usize).copied().unwrap_or_default());
            }
        }
        mesh.triangles.push(indices);
    }
    notes.repair("corners without texture coordinates set to (0, 0)", &mesh.name, without_uv);
    mesh.normals = group.has_normals.then_some(normals);
    mesh.uvs = textured.then_some(uvs);
    let element = mesh.name.clone();
    Ok(geometry::clean(mesh, &element, notes))
}
