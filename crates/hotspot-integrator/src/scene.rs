//! A scene made ready for rendering: triangles in world space, tree, lights, and the class that chooses the kernel.

use crate::check::check;
use crate::class::{FullClass, SceneClass};
use crate::cutout::CutoutTriangles;
use crate::geometry::{Geometry, Instancing};
use crate::light::{Lights, Surroundings, bounding_radius};
use crate::texture::Texture;
use glam::Vec3;
use hotspot_bvh::{BuildOptions, Bvh, BvhError, Instance};
use hotspot_scene::{Bsdf, Material, Repair, Scene};
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
    /// The placed geometry would take more memory than granted.
    #[error(
        "{triangles} triangles need about {} MiB, more than the limit of {} MiB; simplify the scene, store meshes that \
         appear often once, or raise the limit",
        bytes >> 20,
        limit >> 20
    )]
    TooLarge {
        /// Triangles to store.
        triangles: u64,
        /// Bytes, estimated from above.
        bytes: u64,
        /// Bytes granted.
        limit: u64,
    },
    /// The tree could not be built.
    #[error("cannot build the tree: {0}")]
    Tree(#[from] BvhError),
}

/// How to prepare a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct PrepareOptions {
    /// The tree.
    pub tree: BuildOptions,
    /// Which meshes are stored once.
    pub instancing: Instancing,
    /// Most bytes that geometry and tree may take, estimated before they are made; `None`: as many as there are.
    pub max_memory_bytes: Option<u64>,
}

impl From<BuildOptions> for PrepareOptions {
    fn from(tree: BuildOptions) -> Self {
        Self { tree, ..Self::default() }
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
    pub(crate) cutouts: CutoutTriangles,
    /// Render with kernels that lack this.
    #[cfg(hotspot_ablation)]
    pub(crate) without: Option<crate::class::Feature>,
    objects: Vec<String>,
    class: SceneClass,
    repairs: Vec<Repair>,
    default_environment: bool,
    build_seconds: f64,
}

/// Bytes held by a prepared scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneMemory {
    /// Triangles, normals, texture coordinates, lights; of an environment map the texels too.
    pub geometry: u64,
    /// The tree.
    pub bvh: u64,
    /// Texels, those of an environment map included.
    pub textures: u64,
}

impl RenderScene {
    /// Whether its camera rays may go in packets: which know neither cutouts, that are asked ray by ray, nor instances.
    pub(crate) fn in_packets(&self) -> bool {
        !self.cutouts.any() && self.bvh.instance_count() == 0
    }

    /// Places the geometry, builds the tree and collects the lights. A scene without an environment gets a constant white one,
    /// which is named among the repairs, where there is no light at all, or nothing but glow: emission of at most 1 that
    /// comes through textures. Files with glow are made for viewers that light everything by an environment of their
    /// own. An environment that is stated is respected, even a black one.
    ///
    /// # Errors
    /// When an index is out of range or the tree cannot be built.
    pub fn prepare(scene: &Scene, options: impl Into<PrepareOptions>) -> Result<Self, PrepareError> {
        let options = options.into();
        check(scene)?;
        let mut textures = Vec::with_capacity(scene.textures.len());
        for (i, texture) in scene.textures.iter().enumerate() {
            textures.push(Texture::new(texture).ok_or_else(|| PrepareError::Invalid {
                element: format!("textures[{i}] \"{}\"", texture.name),
                problem: format!("does not hold {} x {} RGBA texels", texture.width, texture.height),
            })?);
        }
        let placed = Geometry::new(scene, options.instancing, options.max_memory_bytes);
        let (mut geometry, dropped) = placed.map_err(|(triangles, bytes)| PrepareError::TooLarge {
            triangles,
            bytes,
            limit: options.max_memory_bytes.unwrap_or(u64::MAX),
        })?;
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
        let bvh = build_tree(&geometry, options.tree)?;
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
        let mut default_environment = false;
        if scene.environment.is_none()
            && let Some(problem) = lacks_light(scene, &lights)
        {
            lights = collect(Surroundings::Constant(Vec3::ONE));
            default_environment = true;
            repairs.push(Repair {
                what: format!("{problem}: a constant white environment is used (--env 0,0,0 turns it off)"),
                element: "scene".into(),
                count: 1,
            });
        }
        let cutouts = CutoutTriangles::of(&geometry);
        let extras = cutouts.any() || bvh.instance_count() > 0 || lights.has_maps_or_points::<FullClass>();
        let class = if extras { SceneClass::Full } else { SceneClass::of_surfaces(scene) };
        Ok(Self {
            geometry,
            materials: scene.materials.clone(),
            textures,
            lights,
            bvh,
            #[cfg(hotspot_ablation)]
            without: None,
            objects: scene.objects.iter().map(|o| o.name.clone()).collect(),
            cutouts,
            class,
            repairs,
            default_environment,
            build_seconds,
        })
    }

    /// Renders with kernels that lack `feature` from now on, for benches: a scene that uses it is drawn wrong, and
    /// one that has instances may panic without them.
    #[cfg(hotspot_ablation)]
    pub fn set_without(&mut self, feature: Option<crate::Feature>) {
        self.without = feature;
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
        for placed in &self.geometry.placed {
            counts[placed.part.object as usize] += self.geometry.meshes[placed.mesh as usize].len() as u64;
        }
        counts
    }

    /// The class that chooses the kernel.
    pub const fn class(&self) -> SceneClass {
        self.class
    }

    /// What was mended while preparing.
    pub fn repairs(&self) -> &[Repair] {
        &self.repairs
    }

    /// Whether the scene was given the white environment of those that have no light.
    pub const fn has_default_environment(&self) -> bool {
        self.default_environment
    }

    /// Seconds that the tree took.
    pub const fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Triangles stored, after dropping those without area; those of a mesh that is stored once count once.
    pub fn triangle_count(&self) -> usize {
        self.geometry.triangles.len()
    }

    /// Triangles in the world: those of every instance.
    pub fn placed_triangle_count(&self) -> u64 {
        self.object_triangles().iter().sum()
    }

    /// Instances of meshes that are stored once.
    pub fn instance_count(&self) -> usize {
        self.geometry.placed.len()
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
            geometry: self.geometry.memory() + self.cutouts.memory() + self.lights.memory(),
            bvh: self.bvh.memory(),
            textures: self.textures.iter().map(Texture::memory).sum::<u64>() + self.lights.map_memory(),
        }
    }
}

fn build_tree(geometry: &Geometry, options: BuildOptions) -> Result<Bvh, BvhError> {
    let world = &geometry.triangles[..geometry.world_triangles()];
    let meshes: Vec<_> = geometry.meshes.iter().map(|range| &geometry.triangles[range.clone()]).collect();
    let instances: Vec<Instance> =
        geometry.placed.iter().map(|p| Instance { mesh: p.mesh, to_world: p.to_world }).collect();
    Bvh::build_instanced(world, &meshes, &instances, options)
}

/// Why a scene without an environment needs one; `None` where it does not.
fn lacks_light(scene: &Scene, lights: &Lights) -> Option<&'static str> {
    if shows_itself(scene) {
        None
    } else if lights.is_empty() {
        Some("no light in the file")
    } else if lights.punctual_count() == 0 && only_glows(scene) {
        Some("no light in the file but the glow of emissive textures")
    } else {
        None
    }
}

/// Whether whatever emits does so through a texture, with a factor of at most 1.
fn only_glows(scene: &Scene) -> bool {
    let materials = scene.instances.iter().map(|instance| &scene.materials[instance.material as usize]);
    let mut emission = materials.filter(|material| material.is_emissive()).map(|material| material.emission);
    emission.all(|emission| emission.texture.is_some() && emission.factor.iter().all(|c| *c <= 1.0))
}

/// Whether every surface shows its own colour, so that there is nothing to light.
fn shows_itself(scene: &Scene) -> bool {
    let unlit =
        |i: &hotspot_scene::Instance| matches!(scene.materials[i.material as usize].bsdf, Bsdf::Unlit { .. });
    !scene.instances.is_empty() && scene.instances.iter().all(unlit)
}
