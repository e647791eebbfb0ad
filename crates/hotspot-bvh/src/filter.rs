//! Surfaces that are not there everywhere: a say in which hits count.

use crate::triangle::{RayFrame, barycentric};
use hotspot_probe::RayProbe;

/// Decides whether a hit counts, for alpha masks and the like.
///
/// The answer must depend on ray, instance and triangle alone. The traversal asks only where it matters (the hit would be
/// the nearest so far, or would block; ties with an instance are decided after asking), and about each triangle at most
/// once. How often it asks depends on the order of visits, which is the same everywhere.
pub trait Filter {
    /// False where every hit counts, so that the traversal need not ask.
    const ON: bool;
    /// Whether hits of a triangle need asking about. Where not, they all count, and [`Filter::accept`] is not called: quick,
    /// since every hit that would count comes here.
    #[inline(always)]
    fn concerns(&self, _instance: u32, _primitive: u32) -> bool {
        Self::ON
    }
    /// Whether the hit counts. What finding out costs is told to `probe` ([`RayProbe::alpha`]).
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool;
}

/// Lets every hit count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoFilter;

impl Filter for NoFilter {
    const ON: bool = false;

    #[inline(always)]
    fn accept<P: RayProbe>(&mut self, _candidate: &Candidate<'_>, _probe: &mut P) -> bool {
        true
    }
}

impl<F: Filter> Filter for &mut F {
    const ON: bool = F::ON;

    #[inline(always)]
    fn concerns(&self, instance: u32, primitive: u32) -> bool {
        (**self).concerns(instance, primitive)
    }

    #[inline(always)]
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool {
        (**self).accept(candidate, probe)
    }
}

/// Whether a hit counts, by a filter. Ray and triangle are copied for it where it is asked: references to them would keep both
/// in memory for all hits.
#[inline(always)]
pub(crate) fn counts<F: Filter, P: RayProbe>(
    filter: &mut F,
    instance: u32,
    primitive: u32,
    frame: &RayFrame,
    triangle: &[[f32; 3]; 3],
    probe: &mut P,
) -> bool {
    if !F::ON || !filter.concerns(instance, primitive) {
        return true;
    }
    let (frame, triangle) = (*frame, *triangle);
    filter.accept(&Candidate { instance, primitive, frame: &frame, triangle: &triangle }, probe)
}

/// A hit that may come to count.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    pub(crate) instance: u32,
    pub(crate) primitive: u32,
    pub(crate) frame: &'a RayFrame,
    pub(crate) triangle: &'a [[f32; 3]; 3],
}

impl Candidate<'_> {
    /// Index of the instance, [`crate::NO_INSTANCE`] for triangles of the world.
    #[inline(always)]
    pub const fn instance(&self) -> u32 {
        self.instance
    }

    /// Index of the triangle, as in [`crate::Hit::primitive`].
    #[inline(always)]
    pub const fn primitive(&self) -> u32 {
        self.primitive
    }

    /// Barycentric weights of the triangle's second and third vertex, as in [`crate::Hit`].
    #[inline(always)]
    pub fn barycentric(&self) -> (f32, f32) {
        barycentric(self.frame, self.triangle)
    }
}
