//! Scenes whose radiance is known in closed form: within 4σ, at σ ≤ 0.1 % of it, which is asserted too.
//!
//! σ comes from independent replicates: the 576 pixels of a camera all of whose rays are the same, or renders with seeds of
//! their own ([`hotspot_tests::measured`]). Rate of false alarms: 6.3e-5 for each of 126 comparisons. Curved shapes are
//! meshes: they are held against the closed form of the mesh, and that against the closed form of the shape, within 0.02 %.

mod albedo;
mod cornell;
mod enclosures;
mod irradiance;
mod mirrors;

/// The largest σ, relative to what is expected.
const SIGMA: f64 = 1e-3;

/// How far the closed form of a mesh may lie from that of the curved shape it stands for.
const TESSELLATION: f64 = 2e-4;
