//! Ray traversal alone: triangles, rays, and a peer that traces the same ones; for the binaries `trace` and `kernels`.

pub mod peer;
pub mod query;
pub mod rays;
pub mod soup;
