//! glTF 2.0 to a [`Scene`].
//!
//! The `gltf` crate interprets the schema, checks indices, follows references and decodes items. What is ours, and why:
//! containers, URIs, buffers and the ranges of accessors, since the crate panics or reads on where their numbers lie;
//! mending the JSON before the crate sees it (`schema`); transforms and lenses in f64, which it rounds to f32.

mod accessor;
mod animation;
mod camera;
mod colors;
mod deform;
mod document;
mod draco;
mod extensions;
pub(crate) mod glb;
mod graph;
mod instancing;
mod light;
mod material;
mod member;
mod meshopt;
mod morph;
mod primitive;
pub(crate) mod rewrite;
mod schema;
mod skin;
mod specular_glossiness;
mod tangents;
mod texture;
mod variant;

use std::collections::HashMap;

use animation::Poses;
use deform::Deformation;
use document::{Document, label};
use graph::Placed;
use instancing::Copies;
use morph::MeshWeights;
use primitive::Sources;
use skin::Skins;
use tangents::TangentSources;
use texture::Textures;

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit};
use crate::files::Folder;
use crate::images::Images;
use crate::notes::{Names, Notes, cut};
use crate::options::{LoadOptions, SceneChoice};
use crate::scene::{Environment, Instance, Light, Material, Mesh, Object, Scene};

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
    let json = schema::parse_json(text, budget, &mut notes)?;
    let doc = Document::new(json, bin, folder, options, budget, &mut notes)?;
    let mut loader = Loader::new(&doc, notes);
    loader.variant = variant::choose(&doc)?;
    loader.scene()?;
    loader.finish()
}

/// A material as primitives refer to it.
#[derive(Clone, Copy)]
struct MaterialUse {
    index: u32,
    uv_sets: [Option<u32>; 2],
}

struct Loader<'d, 'a> {
    doc: &'d Document<'a>,
    notes: Notes,
    scene: Scene,
    textures: Textures<'d>,
    /// Of the material variants.
    variant: Option<usize>,
    /// By index in the file; `None` is the default material.
    materials: HashMap<Option<usize>, MaterialUse>,
    /// `None` for those without triangles.
    meshes: HashMap<(Sources, Option<deform::Key>), Option<u32>>,
    mesh_weights: MeshWeights,
    poses: Poses,
    /// Present where a node of the scene has a skin.
    skins: Option<Skins>,
    origins: rewrite::Origins,
    object_names: Names,
    material_names: Names,
    camera_names: Names,
    /// Primitives and lights of the nodes met so far.
    placed: u64,
}

impl<'d, 'a> Loader<'d, 'a> {
    fn new(doc: &'d Document<'a>, notes: Notes) -> Self {
        Self {
            doc,
            notes,
            scene: Scene::default(),
            textures: Textures::new(Images::new(doc.options)),
            variant: None,
            materials: HashMap::new(),
            meshes: HashMap::new(),
            mesh_weights: MeshWeights::default(),
            poses: Poses::default(),
            skins: None,
            origins: rewrite::Origins::default(),
            object_names: Names::default(),
            material_names: Names::default(),
            camera_names: Names::default(),
            placed: 0,
        }
    }

    fn finish(mut self) -> Result<Scene> {
        let scene = &mut self.scene;
        let finished = self.textures.images.finish(&mut scene.materials, self.doc.budget, &mut self.notes)?;
        scene.textures = finished.textures;
        let has_alpha = |mesh: &Mesh| mesh.colors.iter().flatten().any(|color| color[3] < 1.0);
        let with_alpha: Vec<bool> = scene.meshes.iter().map(has_alpha).collect();
        let mut by_vertex = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            if with_alpha.get(instance.mesh as usize) == Some(&true)
                && let Some(flag) = by_vertex.get_mut(instance.material as usize)
            {
                *flag = true;
            }
        }
        for (material, by_vertex) in scene.materials.iter_mut().zip(by_vertex) {
            material::settle_alpha(material, &finished.solid, by_vertex);
        }
        (scene.unmodelled, scene.repairs) = self.notes.into_lists();
        Ok(self.scene)
    }

    fn scene(&mut self) -> Result<()> {
        let doc = self.doc;
        let count = doc.gltf.scenes().len();
        let chosen = match &doc.options.scene {
            Some(choice) => Some(self.chosen_scene(choice)?),
            None => doc.gltf.default_scene().or_else(|| doc.gltf.scenes().next()),
        };
        if let Some(time) = doc.options.time {
            self.poses = animation::poses(doc, time, &mut self.notes)?;
        }
        let placed = match chosen {
            Some(scene) => {
                let path = format!("scenes[{}]", scene.index());
                if count > 1 {
                    let effect = format!("only {} is drawn", label(&path, scene.name()));
                    self.notes.unmodelled("several scenes", "scenes", &effect);
                }
                doc.note_unknown(&path, scene.name(), &[], &mut self.notes);
                self.environment(scene.index())?;
                let roots: Vec<usize> = scene.nodes().map(|node| node.index()).collect();
                graph::walk(doc, &self.poses, &roots, &format!("{path}.nodes"), &mut self.notes)?
            }
            None => graph::walk(doc, &self.poses, &graph::roots(doc)?, "nodes", &mut self.notes)?,
        };
        let skinned = |placed: &Placed| doc.gltf.nodes().nth(placed.node).is_some_and(|n| n.skin().is_some());
        if placed.iter().any(skinned) {
            self.skins = Some(Skins::new(doc, &placed)?);
        }
        for placed in &placed {
            self.node(placed)?;
            self.light(placed)?;
        }
        Ok(())
    }

    /// After the node's mesh, so that of equal names the object keeps its own.
    fn light(&mut self, placed: &Placed) -> Result<()> {
        let doc = self.doc;
        if !light::is_on(doc, placed.node) {
            return Ok(());
        }
        let Some(node) = doc.gltf.nodes().nth(placed.node) else { return Ok(()) };
        self.place(1)?;
        if let Some(mut light) = light::read(doc, &node, &placed.to_world, &mut self.notes)? {
            light.name = self.object_names.unique(&light.name);
            doc.budget.charge(2, (size_of::<Light>() + light.name.len()) as u64, "nodes")?;
            self.scene.lights.push(light);
        }
        Ok(())
    }

    /// Counts primitives and lights against the limit, before they are looked at: also those that give nothing take time.
    fn place(&mut self, count: u64) -> Result<()> {
        self.placed = self.placed.saturating_add(count);
        if self.placed > self.doc.options.max_instances {
            return Err(limit(
                "nodes",
                format!(
                    "the scene places more than {} primitives and lights",
                    self.doc.options.max_instances
                ),
                "simplify the scene or raise the limit",
            ));
        }
        Ok(())
    }

    fn chosen_scene(&self, choice: &SceneChoice) -> Result<gltf::Scene<'d>> {
        let scenes = self.doc.gltf.scenes();
        let (found, asked) = match choice {
            SceneChoice::Index(index) => (scenes.clone().nth(*index), format!("scene #{index}")),
            SceneChoice::Name(name) => {
                (scenes.clone().find(|scene| scene.name() == Some(name)), format!("the scene \"{name}\""))
            }
        };
        found.ok_or_else(|| {
            let list: Vec<String> =
                scenes.map(|scene| label(&format!("#{}", scene.index()), scene.name())).collect();
            let list = if list.is_empty() { "none".into() } else { list.join(", ") };
            invalid("scenes", format!("{asked} is asked for, the file has {list}"), "choose one of them")
        })
    }

    /// Our convention for a constant environment: `extras.environment.constant = [R, G, B]`.
    fn environment(&mut self, scene: usize) -> Result<()> {
        // Extras may be anything: only an object in an object is ours.
        let Some(Some(environment)) = self.doc.environments.get(scene) else { return Ok(()) };
        let path = format!("scenes[{scene}].extras.environment");
        let Some(constant) = environment.get("constant").filter(|constant| !constant.is_null()) else {
            self.notes.unmodelled("environment", &path, "ignored: it has no `constant`");
            return Ok(());
        };
        let numbers: Option<Vec<f32>> = constant
            .as_array()
            .and_then(|items| items.iter().map(|item| item.as_f64().map(|number| number as f32)).collect());
        match numbers.and_then(|numbers| <[f32; 3]>::try_from(numbers).ok()) {
            Some(radiance) if radiance.iter().all(|c| c.is_finite() && *c >= 0.0) => {
                self.scene.environment = Some(Environment::Constant(radiance));
                Ok(())
            }
            _ => Err(invalid(
                format!("{path}.constant"),
                "this is not a radiance: three finite numbers of at least 0",
                REEXPORT,
            )),
        }
    }

    fn node(&mut self, placed: &Placed) -> Result<()> {
        let doc = self.doc;
        let Some(node) = doc.gltf.nodes().nth(placed.node) else { return Ok(()) };
        let path = format!("nodes[{}]", placed.node);
        doc.note_unknown(&path, node.name(), &[instancing::NAME], &mut self.notes);
        if let Some(mut camera) = camera::read(doc, &node, &placed.to_world, &mut self.notes)? {
            camera.name = self.camera_names.unique(&camera.name);
            self.scene.cameras.push(camera);
        }
        let Some(mesh) = node.mesh() else { return Ok(()) };
        let animated = self.poses.of(placed.node).weights.as_deref();
        let weights = morph::weights(doc, placed.node, &mesh, animated, &mut self.mesh_weights)?;
        let mut deformation = Deformation { weights, skin: None };
        if let (Some(skin), Some(skins)) = (node.skin(), &mut self.skins) {
            deformation.skin = Some(skins.get(doc, &self.poses, skin.index(), &mut self.notes)?);
        }
        let mut copies = Copies::of(doc, placed.node)?;
        if copies.is_some() && deformation.skin.is_some() {
            let effect = "the skin alone places the mesh, once";
            self.notes.unmodelled(instancing::NAME, &label(&path, node.name()), effect);
            copies = None;
        }
        let number = copies.as_ref().map_or(1, |copies| copies.count as u64);
        let path = format!("meshes[{}]", mesh.index());
        doc.note_unknown(&path, mesh.name(), &[], &mut self.notes);
        let primitives = mesh.primitives();
        if primitives.len() == 0 {
            self.notes.repair("mesh without primitives dropped", &path, 1);
        }
        self.place(number.saturating_mul(primitives.len() as u64))?;
        let to_world = match &copies {
            Some(copies) => placed.copies(&copies.transforms(doc, &mut self.notes)?)?,
            None => vec![placed.to_world],
        };
        let mut object = None;
        for primitive in primitives {
            let unbound = Deformation { skin: None, ..deformation.clone() };
            let bound = deformation.skin.is_some() && skin::is_bound(&primitive);
            if deformation.skin.is_some() && !bound {
                let path = format!("{path}.primitives[{}]", primitive.index());
                self.notes.repair("no JOINTS_0: drawn unbent, where the node stands", &path, 1);
            }
            let (to_world, deformation) =
                if bound { (&[graph::IDENTITY][..], &deformation) } else { (&to_world[..], &unbound) };
            let Some((mesh_index, material)) = self.primitive(&node, &mesh, &primitive, deformation)? else {
                continue;
            };
            if to_world.is_empty() {
                continue;
            }
            let object = match object {
                Some(object) => object,
                None => *object.insert(self.object(&node, &mesh, placed)?),
            };
            for to_world in to_world {
                self.instance(Instance { object, mesh: mesh_index, material, to_world: *to_world })?;
            }
        }
        Ok(())
    }

    fn object(&mut self, node: &gltf::Node<'_>, mesh: &gltf::Mesh<'_>, placed: &Placed) -> Result<u32> {
        let name = match (node.name(), mesh.name()) {
            (Some(name), _) | (None, Some(name)) if !name.is_empty() => cut(name).to_owned(),
            _ => format!("node {}", node.index()),
        };
        let name = self.object_names.unique(&name);
        self.scene.objects.push(Object { name });
        self.origins.objects.push((placed.node, placed.to_world));
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
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
        primitive: &gltf::Primitive<'_>,
        deformation: &Deformation,
    ) -> Result<Option<(u32, u32)>> {
        let path = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
        self.doc.note_unknown(&path, None, &[], &mut self.notes);
        // Asked without a material first, so that no texture is read for points and lines.
        if Sources::of(primitive, &path, [None; 2], &mut self.notes).is_none() {
            return Ok(None);
        }
        let own = primitive.material();
        let chosen = variant::material(self.doc, self.variant, mesh.index(), primitive.index())?;
        let chosen = chosen.and_then(|index| self.doc.gltf.materials().nth(index));
        let material = self.material(chosen.as_ref().unwrap_or(&own), &path)?;
        let Some(mut sources) = Sources::of(primitive, &path, material.uv_sets, &mut self.notes) else {
            return Ok(None);
        };
        let normal_map = self.scene.materials.get(material.index as usize).and_then(|m| m.normal_map);
        sources.tangents = normal_map.map(|map| TangentSources::of(primitive, map.texture.second_uvs));
        sources.draco = draco::stream(self.doc, &path);
        let bent = deformation.key(self.doc, primitive, mesh.index(), &path)?;
        let key = (sources, bent);
        if let Some(known) = self.meshes.get(&key) {
            return Ok(known.map(|index| (index, material.index)));
        }
        let name = match (mesh.name().map(cut), primitive.index()) {
            (Some(name), 0) => name.to_owned(),
            (Some(name), number) => format!("{name} part {}", number + 1),
            (None, _) => path.clone(),
        };
        let name = match (&key.1, node.name().map(cut)) {
            (None, _) => name,
            (Some(_), Some(node)) => format!("{name} of {node}"),
            (Some(_), None) => format!("{name} of nodes[{}]", node.index()),
        };
        let read = sources.read(self.doc, primitive, deformation, name, &path, &mut self.notes)?;
        let index = match read {
            Some(read) => {
                self.scene.meshes.push(read);
                Some(index_of_last(self.scene.meshes.len(), "meshes")?)
            }
            None => None,
        };
        self.meshes.insert(key, index);
        Ok(index.map(|index| (index, material.index)))
    }

    fn material(&mut self, material: &gltf::Material<'_>, primitive: &str) -> Result<MaterialUse> {
        let key = material.index();
        if key.is_none() {
            self.notes.repair("no material: grey matte used", primitive, 1);
        }
        if let Some(known) = self.materials.get(&key) {
            return Ok(*known);
        }
        let (mut material, uv_sets) = match key {
            Some(index) => {
                let loaded = material::read(self.doc, material, index, &mut self.textures, &mut self.notes)?;
                (loaded.material, loaded.uv_sets)
            }
            None => (Material::default_matte("default"), [None; 2]),
        };
        material.name = self.material_names.unique(&material.name);
        self.scene.materials.push(material);
        self.origins.materials.push(key);
        let index = index_of_last(self.scene.materials.len(), "materials")?;
        let material = MaterialUse { index, uv_sets };
        self.materials.insert(key, material);
        Ok(material)
    }
}

/// The index of the last of `count` elements.
fn index_of_last(count: usize, element: &str) -> Result<u32> {
    u32::try_from(count.saturating_sub(1))
        .map_err(|_| invalid(element, "there are more than 2³² of them", REEXPORT))
}
