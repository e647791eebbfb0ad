//! glTF 2.0 to a [`Scene`].
//!
//! The JSON is walked as plain values and accessors are read by our own checked reader: importers that trust the file's
//! numbers panic on malformed ones.

mod accessor;
mod camera;
mod document;
mod extensions;
pub(crate) mod glb;
mod graph;
mod json;
mod material;
mod primitive;
mod texture;

use std::collections::HashMap;

use document::Document;
use graph::Placed;
use json::Element;
use primitive::Sources;
use texture::Textures;

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit};
use crate::files::Folder;
use crate::images::Images;
use crate::notes::{Names, Notes};
use crate::options::LoadOptions;
use crate::scene::{Environment, Instance, Material, Object, Scene};

/// Loads a GLB file (recognised by its magic or when `container` says so) or JSON.
pub(crate) fn load(
    bytes: &[u8],
    container: bool,
    folder: Option<&Folder>,
    options: &LoadOptions,
    budget: &Budget,
) -> Result<Scene> {
    let mut notes = Notes::default();
    let (text, bin) = if container || glb::is_glb(bytes) {
        let glb = glb::parse(bytes, &mut notes)?;
        (glb.json, glb.bin)
    } else {
        (bytes, None)
    };
    let json = document::parse_json(text, budget, &mut notes)?;
    let doc = Document::new(&json, bin, folder, options, budget)?;
    extensions::note_unknown(&doc.root, &["KHR_lights_punctual"], &mut notes)?;
    for animation in 0..doc.count("animations")? {
        let animation = doc.root.item("animations", animation)?;
        notes.unmodelled("animation", &animation.label(), "everything is drawn at rest");
    }
    let mut loader = Loader::new(&doc, notes);
    loader.scene()?;
    Ok(loader.finish())
}

/// A material as primitives refer to it.
#[derive(Clone, Copy)]
struct MaterialUse {
    index: u32,
    uv_set: Option<u64>,
}

struct Loader<'d, 'a> {
    doc: &'d Document<'a>,
    notes: Notes,
    scene: Scene,
    textures: Textures,
    /// By index in the file; `None` is the default material.
    materials: HashMap<Option<usize>, MaterialUse>,
    /// `None` for those without triangles.
    meshes: HashMap<Sources, Option<u32>>,
    object_names: Names,
    material_names: Names,
    camera_names: Names,
    /// Primitives of the nodes met so far.
    placed: u64,
}

impl<'d, 'a> Loader<'d, 'a> {
    fn new(doc: &'d Document<'a>, notes: Notes) -> Self {
        Self {
            doc,
            notes,
            scene: Scene::default(),
            textures: Textures::new(Images::new(doc.options)),
            materials: HashMap::new(),
            meshes: HashMap::new(),
            object_names: Names::default(),
            material_names: Names::default(),
            camera_names: Names::default(),
            placed: 0,
        }
    }

    fn finish(mut self) -> Scene {
        self.scene.textures = self.textures.images.into_textures();
        (self.scene.unmodelled, self.scene.repairs) = self.notes.into_lists();
        self.scene
    }

    fn scene(&mut self) -> Result<()> {
        let count = self.doc.count("scenes")?;
        let chosen = match self.doc.options.scene {
            Some(index) if index >= count => {
                return Err(invalid(
                    "scenes",
                    format!("scene {index} is asked for, the file has {count}"),
                    "choose one of them",
                ));
            }
            Some(index) => Some(index),
            None => self.doc.root.index("scene", count, "scenes")?.or((count > 0).then_some(0)),
        };
        let placed = match chosen {
            Some(index) => {
                let scene = self.doc.root.item("scenes", index)?;
                if count > 1 {
                    let effect = format!("only {} is drawn", scene.label());
                    self.notes.unmodelled("several scenes", "scenes", &effect);
                }
                extensions::note_unknown(&scene, &[], &mut self.notes)?;
                self.environment(&scene)?;
                let roots = self.doc.indices(&scene, "nodes", "nodes")?;
                graph::walk(self.doc, &roots, &scene.path_of("nodes"), &mut self.notes)?
            }
            None => graph::walk(self.doc, &graph::roots(self.doc)?, "nodes", &mut self.notes)?,
        };
        placed.iter().try_for_each(|placed| self.node(placed))
    }

    /// Our convention for a constant environment: `extras.environment.constant = [R, G, B]`.
    fn environment(&mut self, scene: &Element<'a>) -> Result<()> {
        // Extras may be anything: only an object in an object is ours.
        let Some(extras) = scene.get("extras") else { return Ok(()) };
        let Some(environment) = extras.get("environment") else { return Ok(()) };
        match environment.floats::<3>("constant")? {
            Some(radiance) if radiance.iter().all(|c| *c >= 0.0) => {
                self.scene.environment = Some(Environment::Constant(radiance));
            }
            Some(_) => return Err(environment.wrong("constant", "radiance is not below 0")),
            None => self.notes.unmodelled("environment", &environment.path, "ignored: it has no `constant`"),
        }
        Ok(())
    }

    fn node(&mut self, placed: &Placed) -> Result<()> {
        let node = self.doc.root.item("nodes", placed.node)?;
        extensions::note_unknown(&node, &[], &mut self.notes)?;
        if let Some(mut camera) = camera::read(self.doc, &node, &placed.to_world, &mut self.notes)? {
            camera.name = self.camera_names.unique(&camera.name);
            self.scene.cameras.push(camera);
        }
        let Some((_, mesh)) = self.doc.follow(&node, "mesh", "meshes")? else { return Ok(()) };
        if node.get("skin").is_some() {
            self.notes.unmodelled("skin", &node.label(), "the mesh is drawn unbent, where its node stands");
        }
        extensions::note_unknown(&mesh, &[], &mut self.notes)?;
        let primitives = mesh.array("primitives")?;
        if primitives.is_empty() {
            self.notes.repair("mesh without primitives dropped", &mesh.path, 1);
        }
        // Counted before they are looked at: also those that draw nothing take time.
        self.placed = self.placed.saturating_add(primitives.len() as u64);
        if self.placed > self.doc.options.max_instances {
            return Err(limit(
                "nodes",
                format!("the scene places more than {} primitives", self.doc.options.max_instances),
                "simplify the scene or raise the limit",
            ));
        }
        let mut object = None;
        for index in 0..primitives.len() {
            let primitive = mesh.item("primitives", index)?;
            let Some((mesh_index, material)) = self.primitive(&mesh, &primitive, index)? else { continue };
            let object = match object {
                Some(object) => object,
                None => *object.insert(self.object(placed.node, &node, &mesh)?),
            };
            self.instance(Instance { object, mesh: mesh_index, material, to_world: placed.to_world })?;
        }
        Ok(())
    }

    fn object(&mut self, index: usize, node: &Element<'a>, mesh: &Element<'a>) -> Result<u32> {
        let name = match (node.string("name")?, mesh.string("name")?) {
            (Some(name), _) | (None, Some(name)) if !name.is_empty() => name.to_owned(),
            _ => format!("node {index}"),
        };
        let name = self.object_names.unique(&name);
        self.scene.objects.push(Object { name });
        index_of_last(self.scene.objects.len(), "nodes")
    }

    fn instance(&mut self, instance: Instance) -> Result<()> {
        self.doc.budget.charge(2, size_of::<Instance>() as u64, "nodes")?;
        self.scene.instances.push(instance);
        Ok(())
    }

    /// Mesh and material of a primitive; `None` where it has no triangles.
    fn primitive(
        &mut self,
        mesh: &Element<'a>,
        primitive: &Element<'a>,
        number: usize,
    ) -> Result<Option<(u32, u32)>> {
        extensions::note_unknown(primitive, &[], &mut self.notes)?;
        // Asked without a material first, so that no texture is read for points and lines.
        if Sources::of(self.doc, primitive, None, &mut self.notes)?.is_none() {
            return Ok(None);
        }
        let material = self.material(primitive)?;
        let Some(sources) = Sources::of(self.doc, primitive, material.uv_set, &mut self.notes)? else {
            return Ok(None);
        };
        if let Some(known) = self.meshes.get(&sources) {
            return Ok(known.map(|index| (index, material.index)));
        }
        let name = match mesh.string("name")? {
            Some(name) if number == 0 => name.to_owned(),
            Some(name) => format!("{name} part {}", number + 1),
            None => primitive.path.clone(),
        };
        let index = match sources.read(self.doc, name, &primitive.path, &mut self.notes)? {
            Some(read) => {
                self.scene.meshes.push(read);
                Some(index_of_last(self.scene.meshes.len(), "meshes")?)
            }
            None => None,
        };
        self.meshes.insert(sources, index);
        Ok(index.map(|index| (index, material.index)))
    }

    fn material(&mut self, primitive: &Element<'a>) -> Result<MaterialUse> {
        let key = self.doc.follow(primitive, "material", "materials")?.map(|(index, _)| index);
        if key.is_none() {
            self.notes.repair("no material: grey matte used", &primitive.path, 1);
        }
        if let Some(known) = self.materials.get(&key) {
            return Ok(*known);
        }
        let (mut material, uv_set) = match key {
            Some(index) => {
                let loaded = material::read(self.doc, index, &mut self.textures, &mut self.notes)?;
                (loaded.material, loaded.uv_set)
            }
            None => (Material::default_matte("default"), None),
        };
        material.name = self.material_names.unique(&material.name);
        self.scene.materials.push(material);
        let index = index_of_last(self.scene.materials.len(), "materials")?;
        let material = MaterialUse { index, uv_set };
        self.materials.insert(key, material);
        Ok(material)
    }
}

/// The index of the last of `count` elements.
fn index_of_last(count: usize, element: &str) -> Result<u32> {
    u32::try_from(count.saturating_sub(1))
        .map_err(|_| invalid(element, "there are more than 2³² of them", REEXPORT))
}
