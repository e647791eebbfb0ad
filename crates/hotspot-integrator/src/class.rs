//! What the path loop must be able to do for a scene, and the kernels that are compiled for it.

use crate::check::visit_shaded_textures;
use hotspot_scene::{Alpha, Bsdf, Material, Mesh, Scene};

/// What the path loop must be able to do for a scene; chosen once per render, so that what a scene lacks costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum SceneClass {
    /// Untextured matte surfaces only; lit by surfaces and constant environments, as up to `Textured`.
    Matte,
    /// Surfaces without anything that varies, such as textures and vertex colours, and without mixed and unlit materials and
    /// absorption.
    Lobes,
    /// Surfaces of every kind, but neither cutouts nor instances, environment maps nor punctual lights.
    Textured,
    /// Everything.
    Full,
}

impl SceneClass {
    /// Name as shown in outputs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Matte => "matte",
            Self::Lobes => "lobes",
            Self::Textured => "textured",
            Self::Full => "full",
        }
    }

    /// The least class that draws all of a scene's surfaces, where no more than surfaces is asked for.
    pub(crate) fn of_surfaces(scene: &Scene) -> Self {
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
            _ if textured || shines_through_holes || mesh.colors.is_some() => Self::Textured,
            Bsdf::Matte { .. } => Self::Matte,
            Bsdf::Mix { .. } | Bsdf::Unlit { .. } => Self::Textured,
            Bsdf::Glass { absorption, .. } if *absorption != [0.0; 3] => Self::Textured,
            _ => Self::Lobes,
        }
    }
}

/// What a kernel is compiled for.
pub(crate) trait Class {
    /// Surfaces other than matte.
    const LOBES: bool;
    /// Everything that varies over a surface or is seldom used: textures, vertex colours, bumps, mixed and unlit
    /// materials, absorption.
    const TEXTURED: bool;
    /// Light sampling by what was learned about the scene.
    const LEARNED: bool = false;
    /// Cutouts, instances, environment maps and punctual lights: each is a call that a scene without it never makes, but together
    /// they would cost it 4 % by the registers that are kept for those calls.
    const EXTRAS: bool = false;
    /// What is compiled out although a scene may want it: only in the kernels with which benches compare.
    const WITHOUT: Option<Feature> = None;
}

pub(crate) struct MatteClass;
pub(crate) struct LobesClass;
pub(crate) struct TexturedClass;
pub(crate) struct FullClass;
/// A class with learned light sampling: kernels of their own for scenes that ask for it.
pub(crate) struct Learning<C>(core::marker::PhantomData<C>);

impl Class for MatteClass {
    const LOBES: bool = false;
    const TEXTURED: bool = false;
}
impl Class for LobesClass {
    const LOBES: bool = true;
    const TEXTURED: bool = false;
}
impl Class for TexturedClass {
    const LOBES: bool = true;
    const TEXTURED: bool = true;
}
impl Class for FullClass {
    const LOBES: bool = true;
    const TEXTURED: bool = true;
    const EXTRAS: bool = true;
}
impl<C: Class> Class for Learning<C> {
    const LOBES: bool = C::LOBES;
    const TEXTURED: bool = C::TEXTURED;
    const EXTRAS: bool = C::EXTRAS;
    const LEARNED: bool = true;
}

/// What kernels do for the scenes that ask for it. Builds with `--cfg hotspot_ablation` can compile each out, to see what
/// it costs a scene that does not use it (`benches/src/bin/unused.rs`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[cfg_attr(not(hotspot_ablation), expect(unreachable_pub, reason = "for benches alone"))]
pub enum Feature {
    /// Alpha masks and blending.
    Cutouts,
    /// Meshes stored once.
    Instances,
    /// Normal maps.
    NormalMaps,
    /// Vertex colours.
    VertexColors,
    /// A second set of texture coordinates.
    SecondUvs,
    /// Materials that show their colour as it is.
    Unlit,
    /// Absorption in glass.
    Absorption,
    /// Mixed materials.
    Mixes,
    /// Environment maps.
    EnvironmentMaps,
    /// Lights without area.
    PunctualLights,
    /// All of these together: what is left is the class alone.
    Every,
}

/// Whether kernels of a class do this.
#[inline(always)]
pub(crate) const fn has<C: Class>(feature: Feature) -> bool {
    let extra = matches!(
        feature,
        Feature::Cutouts | Feature::Instances | Feature::EnvironmentMaps | Feature::PunctualLights
    );
    if extra && !C::EXTRAS {
        return false;
    }
    match C::WITHOUT {
        Some(without) => without as u8 != feature as u8 && without as u8 != Feature::Every as u8,
        None => true,
    }
}

#[cfg(hotspot_ablation)]
impl Feature {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Cutouts,
        Self::Instances,
        Self::NormalMaps,
        Self::VertexColors,
        Self::SecondUvs,
        Self::Unlit,
        Self::Absorption,
        Self::Mixes,
        Self::EnvironmentMaps,
        Self::PunctualLights,
        Self::Every,
    ];
}

/// A class without one feature, by its index in [`Feature::ALL`].
#[cfg(hotspot_ablation)]
pub(crate) struct Without<C, const FEATURE: usize>(core::marker::PhantomData<C>);

#[cfg(hotspot_ablation)]
impl<C: Class, const FEATURE: usize> Class for Without<C, FEATURE> {
    const LOBES: bool = C::LOBES;
    const TEXTURED: bool = C::TEXTURED;
    const EXTRAS: bool = C::EXTRAS;
    const WITHOUT: Option<Feature> = Some(Feature::ALL[FEATURE]);
}
