//! A path tracer as a library: one pass gives the radiance and what every pixel cost.
#![forbid(unsafe_code)]

mod adaptive;
mod aov;
mod bake;
mod bsdf;
mod camera;
mod cast;
mod check;
#[cfg(test)]
mod chi_square;
mod class;
mod cutout;
mod geometry;
mod kernel;
mod lanes;
mod light;
mod math;
mod path;
mod payers;
mod render;
mod roulette;
mod sampler;
mod scene;
mod soundings;
mod surface;
mod texture;

pub use aov::{FIRST_HIT_BYTES, FirstHit, add_first_hits, first_hits};
pub use bake::{BakeView, Baked, MeshError, MeshPart, SurfaceMesh, bake, surface_view, viewpoints};
pub use camera::frame_bounds;
#[cfg(hotspot_ablation)]
pub use class::Feature;
pub use class::SceneClass;
pub use geometry::{COPIES_THAT_PAY, Instancing};
pub use hotspot_bvh::simd::Isa;
pub use hotspot_bvh::{BuildOptions, Quality};
pub use kernel::NonFinite;
pub use render::{Control, Gather, LightChoice, Progress, Rendered, Settings, Stop, Waves, render};
pub use roulette::Roulette;
pub use sampler::SamplerKind;
pub use scene::{PrepareError, PrepareOptions, RenderScene, SceneMemory};
pub use soundings::sound;
