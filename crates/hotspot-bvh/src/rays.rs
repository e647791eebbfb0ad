//! Rays and hits in lanes.

use crate::simd::{Floats, Integers, Simd, Vectors};

/// Rays in lanes, from 0 on.
#[derive(Clone, Copy)]
pub struct Rays<S: Simd> {
    /// Where they start.
    pub origin: Vectors<S>,
    /// Where they go, of any length.
    pub direction: Vectors<S>,
}

/// Which triangles rays hit first.
#[derive(Clone, Copy)]
pub struct Nearest<S: Simd> {
    /// Rays that hit anything, as bits: the other fields say what. Of other lanes they hold anything.
    pub found: u32,
    /// Index of the triangle.
    pub primitive: Integers<S>,
    /// Index of the instance that it belongs to, [`NO_INSTANCE`](crate::NO_INSTANCE) for triangles of the world.
    pub instance: Integers<S>,
    /// Distance in lengths of the ray's direction.
    pub t: Floats<S>,
}

/// What rays hit first, as [`Hit`](crate::Hit) has it.
#[derive(Clone, Copy)]
pub struct Hits<S: Simd> {
    /// Rays that hit anything, as bits: the other fields say what. Of other lanes they hold anything.
    pub found: u32,
    /// Index of the triangle.
    pub primitive: Integers<S>,
    /// Its corners.
    pub corners: [Vectors<S>; 3],
    /// Distance in lengths of the ray's direction.
    pub t: Floats<S>,
    /// Barycentric weight of the second vertex.
    pub u: Floats<S>,
    /// Barycentric weight of the third vertex.
    pub v: Floats<S>,
    /// Geometric normal.
    pub normal: Vectors<S>,
}
