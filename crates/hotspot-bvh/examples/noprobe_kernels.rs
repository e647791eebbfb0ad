//! The traversal's kernels without a probe, each in a function of its own: what `benches/gates/noprobe.sh` disassembles.

use hotspot_bvh::simd::{Isa, Simd, WithSimd, dispatch};
use hotspot_bvh::{Bvh, Hit, NoProbe, Ray};

struct Closest<'a>(&'a Bvh, &'a Ray);

impl WithSimd for Closest<'_> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        self.0.closest_hit_flat(simd, self.1, [], NoProbe)
    }
}

struct Any<'a>(&'a Bvh, &'a Ray);

impl WithSimd for Any<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        self.0.occluded_flat(simd, self.1, [], NoProbe)
    }
}

#[inline(never)]
fn closest(bvh: &Bvh, isa: Isa, ray: &Ray) -> Option<Hit> {
    dispatch(isa, Closest(bvh, ray))
}

#[inline(never)]
fn any(bvh: &Bvh, isa: Isa, ray: &Ray) -> bool {
    dispatch(isa, Any(bvh, ray))
}

fn main() {
    let triangles = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
    let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    if let Ok(bvh) = Bvh::build(&triangles, Default::default()) {
        for isa in [Isa::Auto, Isa::Portable] {
            assert!(closest(&bvh, isa, &ray).is_some() && any(&bvh, isa, &ray));
        }
    }
}
