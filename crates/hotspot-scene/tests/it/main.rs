//! Tests of the public interface: what is loaded, what is refused, what is mended.
mod damage;
mod environment;
mod gltf_features;
mod gltf_lights;
mod gltf_materials;
mod gltf_textures;
mod hostile_files;
mod hostile_gltf;
mod obj_features;
mod shared_scenes;
mod support;
