//! One small file per feature of the formats: `features/NAME.gltf`, composed so that one look tells whether it works.
//!
//! Beside most subjects stands a twin that says the same by other means; `tests/tests/features.rs` compares the two.

mod alpha;
mod doc;
mod geometry;
mod lights;
mod materials;
mod moving;
mod nodes;
mod normal_map;
mod obj;
mod png;
mod sky;
mod stage;
mod textures;

use crate::Output;
use crate::gltf_writer::File;

/// All files; their triangles are not counted.
pub(crate) fn all() -> Vec<Output> {
    let docs = [
        textures::wrap(),
        textures::metallic_roughness(),
        textures::emissive(),
        textures::transform(),
        textures::second_uvs(),
        alpha::mask(),
        alpha::blend(),
        normal_map::doc(),
        materials::metal(),
        materials::glass(),
        materials::transmission(),
        materials::specular_ior(),
        materials::substrate(),
        materials::specular_glossiness(),
        materials::unlit(),
        materials::variants(),
        lights::emissive_strength(),
        lights::emissive_sides(),
        lights::punctual(),
        lights::many(),
        lights::environment(),
        geometry::vertex_colors(),
        geometry::sparse(),
        geometry::quantization(),
        geometry::strips_fans(),
        nodes::mirrored(),
        nodes::instances(),
        nodes::gpu_instancing(),
        nodes::orthographic(),
        nodes::scenes_cameras(),
        moving::animation(),
        moving::skin(),
        moving::morph(),
    ];
    let mut files: Vec<File> = docs.into_iter().map(doc::Doc::file).collect();
    files.push(sky::file());
    files.extend(obj::files());
    vec![Output { name: "features", triangles: 0, stored: 0, files }]
}

#[cfg(test)]
mod tests {
    #[test]
    fn files_are_small_and_named_once() {
        let files = super::all().remove(0).files;
        let mut names: Vec<&str> = files.iter().map(|f| f.path.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), files.len());
        for file in &files {
            assert!(file.bytes.len() < 60_000, "{}: {}", file.path, file.bytes.len());
        }
        assert!(files.iter().map(|f| f.bytes.len()).sum::<usize>() < 1_200_000);
    }
}
