//! Viewpoints for the cost of a scene rather than of one view.

use crate::cast::closest_hit;
use crate::class::FullClass;
use crate::sampler::PixelSampler;
use crate::scene::RenderScene;
use hotspot_bvh::simd::{Simd, WithSimd, dispatch};
use hotspot_bvh::{NoProbe, Ray};
use hotspot_probe::NONE;

/// Directions in which a candidate looks around.
const LOOKS: u32 = 64;
/// Candidates for each viewpoint wanted.
const TRIES: u32 = 16;

/// At most `count` points inside the scene's bounds from which it can be seen: the first of a Halton sequence (bases 2, 3, 5) over the bounding
/// box, whose flat axes are widened to a tenth of its diagonal, without those that see nothing in any of 64 directions spread evenly, and
/// without those that lie inside of something: that see more backs than fronts of one-sided surfaces. Of `16 count` points
/// tried; where none is left, the one that sees most.
pub fn viewpoints(scene: &RenderScene, count: u32) -> Vec<[f32; 3]> {
    let (min, max) = scene.bounds();
    let size = [0, 1, 2].map(|i| f64::from(max[i]) - f64::from(min[i]));
    let diagonal = size.iter().map(|s| s * s).sum::<f64>().sqrt();
    let mut found = Vec::new();
    let mut best = (0, [0, 1, 2].map(|i| (0.5 * (f64::from(min[i]) + f64::from(max[i]))) as f32));
    for index in 1..=u64::from(count.saturating_mul(TRIES)) {
        if found.len() == count as usize {
            break;
        }
        let point: [f32; 3] = core::array::from_fn(|axis| {
            let middle = 0.5 * (f64::from(min[axis]) + f64::from(max[axis]));
            let reach = size[axis].max(0.1 * diagonal);
            (middle + reach * (radical_inverse(index, [2, 3, 5][axis]) - 0.5)) as f32
        });
        let (fronts, backs) = dispatch(scene.bvh.isa(), LookAround { scene, point });
        if fronts > 0 && fronts >= backs {
            found.push(point);
        }
        if fronts + backs > best.0 {
            best = (fronts + backs, point);
        }
    }
    if found.is_empty() {
        found.push(best.1);
    }
    found
}

/// The digits of `n` in a base, mirrored at the point (van der Corput).
fn radical_inverse(mut n: u64, base: u64) -> f64 {
    let (mut value, mut place) = (0.0, 1.0);
    while n > 0 {
        place /= base as f64;
        value += place * (n % base) as f64;
        n /= base;
    }
    value
}

/// Counts fronts and backs of what is seen from a point.
struct LookAround<'a> {
    scene: &'a RenderScene,
    point: [f32; 3],
}

impl WithSimd for LookAround<'_> {
    type Output = (u32, u32);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (u32, u32) {
        let (mut fronts, mut backs) = (0, 0);
        let pixel = PixelSampler::new(crate::SamplerKind::Sobol, 0, 0, 0, 0);
        for k in 0..LOOKS {
            // A spiral over the sphere: as many directions in equal areas (Swinbank and Purser, Fibonacci grids, 2006).
            let z = 1.0 - (2 * k + 1) as f32 / LOOKS as f32;
            let r = (1.0 - z * z).sqrt();
            let (sin, cos) = libm::sincosf(2.399_963_2 * k as f32);
            let direction = [r * cos, z, r * sin];
            let ray = Ray::new(self.point, direction);
            let hit = closest_hit::<S, _, FullClass>(
                simd,
                self.scene,
                &ray,
                NONE,
                &pixel.sample(k.into()),
                0,
                NoProbe,
            );
            let Some(hit) = hit else { continue };
            let part = self.scene.geometry.surface(hit.instance, hit.primitive).part;
            let faces = direction.iter().zip(hit.normal).map(|(d, n)| d * n).sum::<f32>() <= 0.0;
            if faces || self.scene.materials[part.material as usize].double_sided {
                fronts += 1;
            } else {
                backs += 1;
            }
        }
        (fronts, backs)
    }
}

#[cfg(test)]
mod tests {
    use super::radical_inverse;

    #[test]
    fn digits_are_mirrored() {
        let values: Vec<f64> = (0..6).map(|n| radical_inverse(n, 2)).collect();
        assert_eq!(values, [0.0, 0.5, 0.25, 0.75, 0.125, 0.625]);
        assert!((radical_inverse(5, 3) - (2.0 / 3.0 + 1.0 / 9.0)).abs() < 1e-15);
    }
}
