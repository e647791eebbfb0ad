//! What a scene must hold to, and which textures its materials use.

use crate::scene::PrepareError;
use hotspot_scene::{Alpha, Bsdf, Material, Scalar, Scene};

/// Checks what the loaders promise, for scenes that were made by hand.
pub(crate) fn check(scene: &Scene) -> Result<(), PrepareError> {
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
        let lengths = [
            mesh.normals.as_ref().map(Vec::len),
            mesh.uvs.as_ref().map(Vec::len),
            mesh.second_uvs.as_ref().map(Vec::len),
            mesh.colors.as_ref().map(Vec::len),
            mesh.tangents.as_ref().map(Vec::len),
        ];
        if lengths.iter().flatten().any(|&length| length != vertices) {
            return invalid(
                format!("meshes[{i}] \"{}\"", mesh.name),
                "has normals, uvs, colours or tangents that do not match its vertices",
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
pub(crate) fn visit_shaded_textures(material: &Material, visit: &mut dyn FnMut(u32)) {
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
    if let Some(map) = &material.normal_map {
        visit(map.texture.texture);
    }
}
