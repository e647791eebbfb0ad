//! The surface at a hit: its material with textures looked up, and its bumps.

use crate::bsdf::{Bsdf, Glass, RoughMetal, Substrate};
use crate::class::{Class, Feature, has};
use crate::cutout::presence;
use crate::geometry::{Attributes, Surface};
use crate::scene::RenderScene;
use crate::texture::{color, mapped_normal, scalar};
use glam::{Vec2, Vec3};
use hotspot_probe::Probe;

/// The material at a point: textures looked up, one part of a mixed material chosen by `choice`.
#[inline(always)]
pub(crate) fn resolve<P: Probe, C: Class>(
    scene: &RenderScene,
    bsdf: &hotspot_scene::Bsdf,
    point: &Attributes,
    front: bool,
    mut choice: f32,
    probe: &mut P,
) -> Bsdf {
    use hotspot_scene::Bsdf as Given;
    if !C::LOBES {
        return match bsdf {
            Given::Matte { reflectance } => Bsdf::Matte(Vec3::from_array(reflectance.factor)),
            _ => unreachable!("a scene of class matte holds only matte surfaces"),
        };
    }
    let mut bsdf = bsdf;
    if C::TEXTURED && has::<C>(Feature::Mixes) {
        // A linear mix is the expectation of choosing one part with its share as probability.
        while let Given::Mix { weight, base, other } = bsdf {
            let share = scalar(&scene.textures, weight, point, probe);
            // What is left of the number is uniform again.
            (bsdf, choice) = if choice < share {
                (other, choice / share)
            } else {
                (base, (choice - share) / (1.0 - share))
            };
        }
    }
    let mut colored = |c: &hotspot_scene::Color| {
        if C::TEXTURED { color(&scene.textures, c, point, probe) } else { Vec3::from_array(c.factor) }
    };
    // Vertex colours multiply the base colour.
    let tint = |base: Vec3| {
        if C::TEXTURED && has::<C>(Feature::VertexColors) { base * point.tint } else { base }
    };
    // α = max(roughness², 1e-3)
    match bsdf {
        Given::Matte { reflectance } => Bsdf::Matte(tint(colored(reflectance))),
        Given::Substrate { diffuse, specular, specular_weight, roughness } => Bsdf::Substrate(Substrate {
            diffuse: tint(colored(diffuse)),
            specular: colored(specular) * number::<P, C>(scene, specular_weight, point, probe),
            alpha: alpha::<P, C>(scene, roughness, point, probe),
        }),
        Given::Mirror { reflectance } => Bsdf::Mirror(tint(colored(reflectance))),
        Given::RoughMetal { f0, roughness } => Bsdf::RoughMetal(RoughMetal {
            f0: tint(colored(f0)),
            alpha: alpha::<P, C>(scene, roughness, point, probe),
        }),
        Given::Glass { ior, thin, transmittance, absorption } => Bsdf::Glass(Glass {
            transmittance: tint(colored(transmittance)),
            absorption: Vec3::from_array(*absorption),
            eta: if *thin || front { *ior } else { 1.0 / *ior },
            thin: *thin,
        }),
        Given::Unlit { .. } | Given::Mix { .. } => Bsdf::Matte(Vec3::ZERO),
    }
}

#[inline(always)]
fn number<P: Probe, C: Class>(
    scene: &RenderScene,
    given: &hotspot_scene::Scalar,
    point: &Attributes,
    probe: &mut P,
) -> f32 {
    if C::TEXTURED { scalar(&scene.textures, given, point, probe) } else { given.factor }
}

#[inline(always)]
fn alpha<P: Probe, C: Class>(
    scene: &RenderScene,
    roughness: &hotspot_scene::Scalar,
    point: &Attributes,
    probe: &mut P,
) -> f32 {
    let roughness = number::<P, C>(scene, roughness, point, probe);
    (roughness * roughness).max(1e-3)
}

/// What a point of an emissive triangle of the world emits, as light sampling takes it: by the share of the surface that is there.
#[inline(always)]
pub(crate) fn emitted<P: Probe, C: Class>(
    scene: &RenderScene,
    primitive: u32,
    uv: Vec2,
    probe: &mut P,
) -> Vec3 {
    let surface = scene.geometry.world_surface(primitive);
    let material = &scene.materials[surface.part.material as usize];
    if !C::TEXTURED {
        return Vec3::from_array(material.emission.factor);
    }
    let attributes = scene.geometry.attributes::<C>(surface, uv.x, uv.y);
    let mut share = 1.0;
    if has::<C>(Feature::Cutouts) && surface.part.cutout {
        let (there, lookups, bytes) = presence(scene, material, &attributes);
        probe.texture(lookups, bytes);
        share = there;
    }
    if share == 0.0 {
        return Vec3::ZERO;
    }
    color(&scene.textures, &material.emission, &attributes, probe) * share
}

/// The shading normal on the path's side, under a normal map. `smooth` is the interpolated normal.
///
/// A mapped normal may point away from where the path came from although the surface does not. It is then tilted back until
/// the path arrives just above the horizon: a surface must not vanish behind its own bumps.
#[inline(never)]
pub(crate) fn bumped<P: Probe>(
    scene: &RenderScene,
    surface: Surface<'_>,
    [u, v]: [f32; 2],
    point: &Attributes,
    smooth: Vec3,
    wo: Vec3,
    probe: &mut P,
) -> Vec3 {
    const LEAST_COS: f32 = 1e-3;
    let side = if wo.dot(smooth) >= 0.0 { 1.0 } else { -1.0 };
    let material = &scene.materials[surface.part.material as usize];
    let (Some(map), Some((tangent, bitangent))) =
        (&material.normal_map, scene.geometry.tangents(surface, smooth, u, v))
    else {
        return smooth * side;
    };
    let n = mapped_normal(&scene.textures, map, point, probe);
    let Some(mapped) = (tangent * n.x + bitangent * n.y + smooth * n.z).try_normalize() else {
        return smooth * side;
    };
    let normal = mapped * side;
    let cos = wo.dot(normal);
    if cos >= LEAST_COS {
        return normal;
    }
    (normal + wo * (LEAST_COS - cos)).try_normalize().unwrap_or(smooth * side)
}
