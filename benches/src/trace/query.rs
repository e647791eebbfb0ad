//! Our side of the queries: loops over rays, compiled for an instruction set as a whole as the renderer's loops are.

use hotspot_bvh::simd::{Isa, Simd, WithSimd, dispatch};
use hotspot_bvh::{Bvh, Hit, NoProbe, Ray};

struct Closest<'a>(&'a Bvh, &'a [Ray], &'a mut [Option<Hit>]);

impl WithSimd for Closest<'_> {
    type Output = u64;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let mut hits = 0;
        for (ray, out) in self.1.iter().zip(self.2) {
            *out = self.0.closest_hit_flat(simd, ray, NoProbe);
            hits += u64::from(out.is_some());
        }
        hits
    }
}

struct Any<'a>(&'a Bvh, &'a [Ray], &'a mut [bool]);

impl WithSimd for Any<'_> {
    type Output = u64;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let mut hits = 0;
        for (ray, out) in self.1.iter().zip(self.2) {
            *out = self.0.occluded_flat(simd, ray, NoProbe);
            hits += u64::from(*out);
        }
        hits
    }
}

/// The nearest hit of each ray; how many hit.
#[inline(never)]
pub fn closest(bvh: &Bvh, isa: Isa, rays: &[Ray], out: &mut [Option<Hit>]) -> u64 {
    dispatch(isa, Closest(bvh, rays, out))
}

/// Whether each ray is blocked; how many are.
#[inline(never)]
pub fn any(bvh: &Bvh, isa: Isa, rays: &[Ray], out: &mut [bool]) -> u64 {
    dispatch(isa, Any(bvh, rays, out))
}
