//! How much a file may ask for, and which part of it to load.

/// Limits and choices of [`crate::load`].
///
/// The limits keep a hostile or broken file from taking the machine down; no honest scene should meet the defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Largest single file read, in bytes. Default 4 GiB.
    pub max_file_bytes: u64,
    /// Most memory that loading may hold at once, in bytes, estimated before each allocation. Default 8 GiB.
    pub max_memory_bytes: u64,
    /// Largest width or height of an image, in texels. Default 16384.
    pub max_texture_dimension: u32,
    /// Most texels in all images together, as they are in their files. Default 2³².
    pub max_texture_pixels: u64,
    /// Most bytes that the textures of the scene may take (4 a texel). Beyond, the largest are halved until the rest fits, and
    /// named. Default 4 GiB.
    pub max_texture_bytes: u64,
    /// Most nodes in the file. Default 4 million.
    pub max_nodes: u64,
    /// Most placed primitives. Default 16 million.
    pub max_instances: u64,
    /// Which of a glTF file's scenes to load; `None` for the file's own default, else its first. OBJ ignores it.
    pub scene: Option<SceneChoice>,
    /// Point in time at which a glTF file's animations are shown, in seconds; `None` for rest.
    pub time: Option<f64>,
    /// Which of a glTF file's material variants to show, by name; `None` for the materials that primitives have by default.
    /// OBJ ignores it.
    pub variant: Option<String>,
}

/// One of a file's scenes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneChoice {
    /// By its place in the file, from 0.
    Index(usize),
    /// By its name; the first of those that bear it.
    Name(String),
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            max_file_bytes: 4 << 30,
            max_memory_bytes: 8 << 30,
            max_texture_dimension: 16384,
            max_texture_pixels: 1 << 32,
            max_texture_bytes: 4 << 30,
            max_nodes: 4_000_000,
            max_instances: 16_000_000,
            scene: None,
            time: None,
            variant: None,
        }
    }
}
