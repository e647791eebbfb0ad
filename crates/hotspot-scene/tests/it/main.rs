//! Tests of the public interface: what is loaded, what is refused, what is mended.
mod damage;
mod damage_moving;
mod gltf_animation;
mod gltf_draco;
mod gltf_features;
mod gltf_instancing;
mod gltf_materials;
mod gltf_meshopt;
mod gltf_morph;
mod gltf_skins;
mod gltf_vertices;
mod hostile_files;
mod hostile_gltf;
mod obj_features;
mod shared_scenes;
mod support;
