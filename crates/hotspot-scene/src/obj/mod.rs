//! Wavefront OBJ and MTL to a [`Scene`].
//!
//! `tobj` parses numbers and materials, and makes one vertex of equal corners. What is ours, and why: the pass before it
//! (`check`), which names lines and mends what `tobj` stumbles over; reading MTL files and their textures inside one folder
//! under limits; options of texture statements, which `tobj` takes for part of the name; splitting polygons (`polygon`),
//! since `tobj` makes fans of concave ones too.

mod check;
mod material;
mod mtl;
mod polygon;
mod text;

use std::collections::HashMap;
use std::path::Path;

use check::{Group, NONE, Parsed};
use material::Textures;
use mtl::Mtl;
use polygon::Splitter;

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid};
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
    let mut parsed = check::check(bytes, stem, budget, &mut notes)?;
    let library = read_libraries(&parsed, folder, options, budget, &mut notes)?;
    let mut textures = Textures::new(folder, options, budget);
    let mut scene = Scene::default();
    let mut materials: HashMap<Option<usize>, u32> = HashMap::new();
    let mut material_names = Names::default();
    let mut used = Vec::new();
    for group in &parsed.groups {
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
        used.push(material);
    }
    let is_textured = |index: &u32| scene.materials.get(*index as usize).is_some_and(material::is_textured);
    let textured: Vec<bool> = used.iter().map(is_textured).collect();
    let models = parse(&parsed.restate(&textured, budget)?)?;
    let mut splitter = Splitter::new();
    let mut objects: HashMap<usize, u32> = HashMap::new();
    for ((model, group), material) in models.into_iter().zip(&parsed.groups).zip(used) {
        let name = parsed.objects.get(group.object).cloned().unwrap_or_default();
        let mesh = build_mesh(model.mesh, group, name.clone(), &mut splitter, budget, &mut notes)?;
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
    scene.textures = textures.images.finish(&scene.materials, budget, &mut notes)?.textures;
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
            // A material takes about a thousand bytes, twice for a moment, for some ten bytes of text.
            budget.charge(bytes.len() as u64, 256, &element)?;
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

/// The models of a restated file, one for each group. It names no materials and no libraries.
fn parse(text: &str) -> Result<Vec<tobj::Model>> {
    let options = tobj::LoadOptions {
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let parsed = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Err(tobj::LoadError::OpenFileFailed));
    parsed.map(|(models, _)| models).map_err(refused)
}

/// Not expected after our checks.
fn refused(error: tobj::LoadError) -> crate::LoadError {
    invalid("the file as a whole", format!("the parser refuses it ({error})"), REEXPORT)
}

/// The mesh of a model. It has texture coordinates where its material needs them.
fn build_mesh(
    model: tobj::Mesh,
    group: &Group,
    name: String,
    splitter: &mut Splitter,
    budget: &Budget,
    notes: &mut Notes,
) -> Result<Mesh> {
    let positions = model.positions.as_chunks::<3>().0.to_vec();
    // What is copied here, and the clean-up's sums.
    budget.charge(positions.len() as u64, 80, &name)?;
    let triangles: usize = group.arities.iter().map(|arity| arity - 2).sum();
    budget.charge(triangles as u64, 2 * 12, &name)?;
    let mut triangles = Vec::with_capacity(triangles);
    let mut rest = model.indices.as_slice();
    for arity in &group.arities {
        let Some((polygon, after)) = rest.split_at_checked(*arity) else { break };
        splitter.split(polygon, &positions, &mut triangles);
        rest = after;
    }
    let fans = std::mem::take(&mut splitter.fans);
    notes.repair("concave polygon split as a fan", &name, fans);
    // OBJ counts from the lower edge of the image, the scene from the upper.
    let flipped = |uv: &[f32; 2]| [uv[0], 1.0 - uv[1]];
    let uvs: Option<Vec<_>> = (!model.texcoords.is_empty())
        .then(|| model.texcoords.as_chunks::<2>().0.iter().map(flipped).collect());
    if uvs.is_some() {
        let without = group.corners.iter().filter(|[_, uv, _]| *uv == NONE).count();
        notes.repair("corners without texture coordinates set to (0, 0)", &name, without as u64);
    }
    let normals = group.has_normals.then(|| model.normals.as_chunks::<3>().0.to_vec());
    let element = name.clone();
    Ok(geometry::clean(Mesh { name, positions, normals, uvs, triangles, ..Mesh::default() }, &element, notes))
}
