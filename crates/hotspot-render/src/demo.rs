//! The built-in scene: an interior with a mirror that hangs off the wall, made by this repository's scene generator.

/// The scene as a GLB file.
pub(crate) const GLB: &[u8] = include_bytes!("demo.glb");
