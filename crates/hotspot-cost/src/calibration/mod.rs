//! Time from counts: what a node, a triangle, a BSDF evaluation … cost on the machine at hand.
//!
//! Time is measured in runs that do not count ([`Timings`]) and explained by the counts of a run that traced the same paths
//! ([`Timings::tiles`]); [`fit()`] finds the nanoseconds per event, for the paper's two terms and for all that are counted
//! ([`Form`]); [`held_out`] and [`score`] judge it on tiles that it has not seen, against what the noise of the measurement
//! lets a perfect model reach ([`repeat_r2`]). A [`Profile`] keeps the result. Knows no renderer: any [`crate::Frame`] with counts and times will
//! do.

mod fit;
mod nnls;
mod profile;
#[cfg(test)]
mod tests;
mod tiles;

pub use fit::{
    Coefficient, Fit, Form, Score, Traversal, fit, held_out, repeat_r2, scene_held_out, score, traversal,
};
pub use profile::{Machine, PROFILE_JSON_SCHEMA, PROFILE_SCHEMA, Profile, SceneProfile};
pub use tiles::{TILE, Term, Tile, Tiles, Timings};
