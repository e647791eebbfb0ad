//! A scene made ready for rendering: triangles in world space, tree, lights, and the class that chooses the kernel.

use crate::geometry::Geometry;
use crate::light::{Lights, Surroundings, bounding_radius};
use crate::texture::Texture;
use glam::Vec3;
use hotspot_bvh::{BuildOptions, Bvh, BvhError};
use hotspot_scene::{Alpha, Bsdf, Material, Repair, Scalar, Scene, Unmodelled};
use std::time::Instant;

/// Why a scene cannot be rendered.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// An index between the scene's vectors is out of range, or a texture is not whole.
    #[error("{element} {problem}; fix the scene before preparing it")]
    Invalid {
        /// Where.
        element: String,
        /// What is wrong.
        problem: String,
    },
    /// The tree could not be built.
    #[error("cannot build the tree: {0}")]
    Tree(#[from] BvhError),
}

/// What the path loop must be able to do for a scene; chosen once per render, so that what a scene lacks costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum SceneClass {
    /// Untextured matte surfaces only.
    Matte,
    /// Untextured surfaces of every kind.
    Lobes,
    /// Everything.
    Full,
}

impl SceneClass {
    /// Name as shown in outputs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Matte => "matte",
            Self::Lobes => "lobes",
            Self::Full => "full",
        }
    }
}

/// A scene ready for rendering.
#[derive(Debug)]
pub struct RenderScene {
    pub(crate) geometry: Geometry,
    pub(crate) materials: Vec<Material>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) lights: Lights,
    pub(crate) bvh: Bvh,
    objects: Vec<String>,
    class: SceneClass,
    unmodelled: Vec<Unmodelled>,
    repairs: Vec<Repair>,
    build_seconds: f64,
}

/// Bytes held by a prepared scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneMemory {
    /// Triangles, normals, texture coordinates, lights; of an environment map the texels too.
    pub geometry: u64,
    /// The tree.
    pub bvh: u64,
    /// Texels.
    pub textures: u64,
}

impl RenderScene {
    /// Places the geometry, builds the tree and collects the lights. A scene without any light gets a constant white
    /// environment, which is named among the repairs.
    ///
    /// # Errors
    /// When an index is out of range or the tree cannot be built.
    pub fn prepare(scene: &Scene, options: BuildOptions) -> Result<Self, PrepareError> {
        check(scene)?;
        let mut textures = Vec::with_capacity(scene.textures.len());
        for (i, texture) in scene.textures.iter().enumerate() {
            textures.push(Texture::new(texture).ok_or_else(|| PrepareError::Invalid {
                element: format!("textures[{i}] \"{}\"", texture.name),
                problem: format!("does not hold {} x {} RGBA texels", texture.width, texture.height),
            })?);
        }
        let (mut geometry, dropped) = Geometry::new(scene);
        let mut repairs: Vec<Repair> = dropped
            .triangles
            .iter()
            .map(|&(object, count)| Repair {
                what: "triangles without area (or beyond the range of f32) dropped after placing".into(),
                element: scene.objects[object as usize].name.clone(),
                count,
            })
            .collect();
        let start = Instant::now();
        let bvh = Bvh::build(&geometry.triangles, options)?;
        let build_seconds = start.elapsed().as_secs_f64();
        let (min, max) = bvh.bounds();
        if geometry.triangles.is_empty() {
            repairs.push(Repair {
                what: "nothing to see: the scene has no triangles".into(),
                element: "scene".into(),
                count: 1,
            });
        }
        let radius = bounding_radius(min, max);
        let mut collect = |environment: Surroundings| {
            Lights::new(&scene.materials, environment, &scene.lights, &mut geometry, &textures, radius)
        };
        let mut lights = collect(Surroundings::new(scene.environment.as_ref())?);
        if lights.is_empty() {
            lights = collect(Surroundings::Constant(Vec3::ONE));
            repairs.push(Repair {
                what: "no light in the file: a constant white environment is used".into(),
                element: "scene".into(),
                count: 1,
            });
        }
        let class = classify(scene);
        Ok(Self {
            geometry,
            materials: scene.materials.clone(),
            textures,
            lights,
            bvh,
            objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
            class,
            unmodelled: unmodelled(scene),
            repairs,
            build_seconds,
        })
    }

    /// Names of the objects, by the ids that the cost layers use.
    pub fn objects(&self) -> &[String] {
        &self.objects
    }

    /// Names of the materials, by id.
    pub fn material_names(&self) -> impl Iterator<Item = &str> {
        self.materials.iter().map(|m| m.name.as_str())
    }

    /// Triangles of each object, by its id.
    pub fn object_triangles(&self) -> Vec<u64> {
        let mut counts = vec![0; self.objects.len()];
        for &part in &self.geometry.part_of {
            counts[self.geometry.parts[part as usize].object as usize] += 1;
        }
        counts
    }

    /// The class that chooses the kernel.
    pub const fn class(&self) -> SceneClass {
        self.class
    }

    /// What the scene holds and this renderer leaves out.
    pub fn unmodelled(&self) -> &[Unmodelled] {
        &self.unmodelled
    }

    /// What was mended while preparing.
    pub fn repairs(&self) -> &[Repair] {
        &self.repairs
    }

    /// Seconds that the tree took.
    pub const fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Triangles, after dropping those without area.
    pub fn triangle_count(&self) -> usize {
        self.geometry.triangles.len()
    }

    /// Emissive triangles.
    pub fn light_count(&self) -> usize {
        self.lights.triangle_count()
    }

    /// Lights without area that shine.
    pub fn punctual_light_count(&self) -> usize {
        self.lights.punctual_count()
    }

    /// The tree.
    pub const fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Corners of the scene's bounding box.
    pub const fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        self.bvh.bounds()
    }

    /// Bytes held.
    pub fn memory(&self) -> SceneMemory {
        SceneMemory {
            geometry: self.geometry.memory() + self.lights.memory(),
            bvh: self.bvh.memory(),
            textures: self.textures.iter().map(Texture::memory).sum(),
        }
    }
}

fn check(scene: &Scene) -> Result<(), PrepareError> {
    let invalid =
        |element: String, problem: &str| Err(PrepareError::Invalid { element, problem: problem.to_owned() });
    for (i, instance) in scene.instances.iter().enumerate() {
        if instance.object as usize >= scene.objects.len() {
            return invalid(format!("instances[{i}].object"), "is out of range");
        }
        if instance.mesh as usize >= scene.meshes.len() {
            return invalid(format!("instances[{i}].mesh"), "is out of range");
        }
        if instance.material as usize >= scene.materials.len() {
            return invalid(format!("instances[{i}].material"), "is out of range");
        }
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        let vertices = mesh.positions.len();
        if mesh.triangles.iter().flatten().any(|&v| v as usize >= vertices) {
            return invalid(format!("meshes[{i}] \"{}\"", mesh.name), "has a vertex index out of range");
        }
        if mesh.normals.as_ref().is_some_and(|n| n.len() != vertices)
            || mesh.uvs.as_ref().is_some_and(|t| t.len() != vertices)
        {
            return invalid(
                format!("meshes[{i}] \"{}\"", mesh.name),
                "has normals or uvs that do not match its vertices",
            );
        }
    }
    for (i, material) in scene.materials.iter().enumerate() {
        let mut highest = None;
        visit_textures(material, &mut |t| highest = highest.max(Some(t as usize)));
        if highest.is_some_and(|t| t >= scene.textures.len()) {
            return invalid(format!("materials[{i}] \"{}\"", material.name), "names a texture out of range");
        }
    }
    Ok(())
}

/// Calls `visit` with every texture index that a material uses.
fn visit_textures(material: &Material, visit: &mut dyn FnMut(u32)) {
    visit_shaded_textures(material, visit);
    match &material.alpha {
        Alpha::Mask { alpha: Scalar { texture: Some((t, _)), .. }, .. }
        | Alpha::Blend { alpha: Scalar { texture: Some((t, _)), .. } } => visit(t.texture),
        Alpha::Opaque | Alpha::Mask { .. } | Alpha::Blend { .. } => {}
    }
}

/// The same for those that shading looks up.
fn visit_shaded_textures(material: &Material, visit: &mut dyn FnMut(u32)) {
    fn color(c: &hotspot_scene::Color, visit: &mut dyn FnMut(u32)) {
        if let Some(t) = &c.texture {
            visit(t.texture);
        }
    }
    fn scalar(s: &Scalar, visit: &mut dyn FnMut(u32)) {
        if let Some((t, _)) = &s.texture {
            visit(t.texture);
        }
    }
    fn bsdf(b: &Bsdf, visit: &mut dyn FnMut(u32)) {
        match b {
            Bsdf::Matte { reflectance } | Bsdf::Mirror { reflectance } => color(reflectance, visit),
            Bsdf::Substrate { diffuse, specular, specular_weight, roughness } => {
                color(diffuse, visit);
                color(specular, visit);
                scalar(specular_weight, visit);
                scalar(roughness, visit);
            }
            Bsdf::RoughMetal { f0, roughness } => {
                color(f0, visit);
                scalar(roughness, visit);
            }
            Bsdf::Glass { transmittance, .. } => color(transmittance, visit),
            Bsdf::Unlit { color: radiance } => color(radiance, visit),
            Bsdf::Mix { weight, base, other } => {
                scalar(weight, visit);
                bsdf(base, visit);
                bsdf(other, visit);
            }
        }
    }
    bsdf(&material.bsdf, visit);
    color(&material.emission, visit);
}

fn classify(scene: &Scene) -> SceneClass {
    scene.instances.iter().fold(SceneClass::Matte, |class, instance| {
        let material = &scene.materials[instance.material as usize];
        let mut textured = false;
        visit_shaded_textures(material, &mut |_| textured = true);
        let needs = match material.bsdf {
            _ if textured => SceneClass::Full,
            Bsdf::Matte { .. } => SceneClass::Matte,
            Bsdf::Mix { .. } | Bsdf::Unlit { .. } => SceneClass::Full,
            _ => SceneClass::Lobes,
        };
        class.max(needs)
    })
}

/// What the loader delivers and the integrator does not do yet.
fn unmodelled(scene: &Scene) -> Vec<Unmodelled> {
    let mut used = vec![false; scene.materials.len()];
    for instance in &scene.instances {
        used[instance.material as usize] = true;
    }
    let mut list = Vec::new();
    for (i, material) in scene.materials.iter().enumerate().filter(|(i, _)| used[*i]) {
        let feature = match material.alpha {
            Alpha::Opaque => continue,
            Alpha::Mask { .. } => "alphaMode MASK",
            Alpha::Blend { .. } => "alphaMode BLEND",
        };
        list.push(Unmodelled {
            feature: feature.into(),
            element: format!("materials[{i}] \"{}\"", material.name),
            effect: "rendered opaque".into(),
        });
    }
    list
}
