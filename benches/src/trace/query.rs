//! Our side of the queries: loops over rays, compiled for an instruction set as a whole as the renderer's loops are.

use hotspot_bvh::simd::{Isa, Simd, WithSimd, dispatch};
use hotspot_bvh::{Bvh, Hit, NoProbe, PACKET, Ray};

struct Closest<'a>(&'a Bvh, &'a [Ray], &'a mut [Option<Hit>]);

impl WithSimd for Closest<'_> {
    type Output = u64;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let mut hits = 0;
        for (ray, out) in self.1.iter().zip(self.2) {
            *out = self.0.closest_hit_flat(simd, ray, [], NoProbe);
            hits += u64::from(out.is_some());
        }
        hits
    }
}

struct Packets<'a>(&'a Bvh, &'a [Ray], &'a mut [Option<Hit>]);

impl WithSimd for Packets<'_> {
    type Output = u64;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u64 {
        let mut hits = 0;
        for (rays, out) in self.1.chunks(PACKET).zip(self.2.chunks_mut(PACKET)) {
            self.0.closest_hits_flat(simd, rays, out);
            hits += out.iter().flatten().count() as u64;
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
            *out = self.0.occluded_flat(simd, ray, [], NoProbe);
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

/// As [`closest`], each sixteen in a row as a packet.
#[inline(never)]
pub fn packets(bvh: &Bvh, isa: Isa, rays: &[Ray], out: &mut [Option<Hit>]) -> u64 {
    dispatch(isa, Packets(bvh, rays, out))
}

/// Whether each ray is blocked; how many are.
#[inline(never)]
pub fn any(bvh: &Bvh, isa: Isa, rays: &[Ray], out: &mut [bool]) -> u64 {
    dispatch(isa, Any(bvh, rays, out))
}
