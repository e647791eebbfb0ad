//! What the path loop must be able to do for a scene.

use crate::check::visit_shaded_textures;
use hotspot_scene::{Alpha, Bsdf, Material, Mesh, Scene};

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

    /// The least class that draws all of a scene's surfaces.
    pub(crate) fn of(scene: &Scene) -> Self {
        scene.instances.iter().fold(Self::Matte, |class, instance| {
            let material = &scene.materials[instance.material as usize];
            class.max(Self::of_surface(material, &scene.meshes[instance.mesh as usize]))
        })
    }

    fn of_surface(material: &Material, mesh: &Mesh) -> Self {
        let mut textured = false;
        visit_shaded_textures(material, &mut |_| textured = true);
        let shines_through_holes = material.is_emissive() && material.alpha != Alpha::Opaque;
        match &material.bsdf {
            _ if textured || shines_through_holes || mesh.colors.is_some() => Self::Full,
            Bsdf::Matte { .. } => Self::Matte,
            Bsdf::Mix { .. } | Bsdf::Unlit { .. } => Self::Full,
            Bsdf::Glass { absorption, .. } if *absorption != [0.0; 3] => Self::Full,
            _ => Self::Lobes,
        }
    }
}
