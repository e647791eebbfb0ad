//! Tests of the public interface: what is loaded, what is refused, what is mended.
mod damage;
mod gltf_features;
mod gltf_materials;
mod hostile_files;
mod hostile_gltf;
mod obj_features;
mod obj_geometry;
mod obj_materials;
mod obj_text;
mod shared_scenes;
mod support;
