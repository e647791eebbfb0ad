//! Rays in lanes.

use crate::simd::{Simd, Vectors};

/// Rays in lanes, from 0 on.
#[derive(Clone, Copy)]
pub struct Rays<S: Simd> {
    /// Where they start.
    pub origin: Vectors<S>,
    /// Where they go, of any length.
    pub direction: Vectors<S>,
}
