//! The sampler's points: independent ones by chi-square, Sobol's by elementary intervals.

use super::{Dimensions, PixelSampler, SamplerKind};
use crate::chi_square::{COLUMNS, ROWS, SAMPLES, Suite, p_value};

/// Every pair of the four numbers of a set, and one number of two sets: 80 × 160 cells, 10^6 points, rate of any false
/// alarm 1 %.
#[test]
fn independent_points_are_uniform_in_pairs() {
    let mut suite = Suite::new();
    let pixel = PixelSampler::new(SamplerKind::Independent, 17, 4, 0, 9);
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [0, 4], [3, 7]];
    let mut observed = vec![vec![0; ROWS * COLUMNS]; pairs.len()];
    for i in 0..SAMPLES as u64 {
        let sample = pixel.sample(i);
        let [a, b] = [1, 2].map(|set| sample.get(set));
        let numbers = [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
        for (pair, observed) in pairs.iter().zip(&mut observed) {
            let [x, y] = pair.map(|d| numbers[d]);
            observed[(x * ROWS as f32) as usize * COLUMNS + (y * COLUMNS as f32) as usize] += 1;
        }
    }
    let expected = vec![SAMPLES as f64 / (ROWS * COLUMNS) as f64; ROWS * COLUMNS];
    for (pair, observed) in pairs.iter().zip(&observed) {
        suite.add(format!("{pair:?}"), p_value(observed, &expected));
    }
    suite.finish();
}

/// The least t for which each elementary interval of 2^t points of 2^k holds just as many: 0 for a perfect net.
fn quality(points: &[[f32; 2]]) -> u32 {
    let k = points.len().ilog2();
    let even = |a: u32, b: u32| {
        let mut counts = vec![0usize; 1 << (a + b)];
        for p in points {
            counts[((p[0] * (1u32 << a) as f32) as usize) << b | (p[1] * (1u32 << b) as f32) as usize] += 1;
        }
        counts.iter().all(|c| *c == points.len() >> (a + b))
    };
    (0..=k).find(|t| (0..=k - t).all(|a| even(a, k - t - a))).unwrap_or(k)
}

/// Named pairs: film, BSDF direction, light. Film and the direction at the head of a sequence are (0, 2)-nets; the light's pair at
/// the first vertex (Sobol dimensions 2 and 3, of primitive polynomials of degree 2 and 3) is one of quality (2 − 1) + (3 − 1) = 3
/// at worst (Sobol 1967; Niederreiter 1987). Of later pairs the quality is that counted over the unscrambled dimensions
/// up to 2^12, which scrambling keeps. Each number by itself is stratified perfectly. Of all vertices, over powers of two up to 2^12.
#[test]
fn named_pairs_are_nets() {
    let named = [
        ("film", Dimensions::segment(0), [0, 1], 0),
        ("BSDF, first vertex", Dimensions::segment(1), [0, 1], 0),
        ("BSDF, 5th vertex", Dimensions::segment(5), [0, 1], 0),
        ("BSDF, 12th vertex", Dimensions::segment(12), [0, 1], 2),
        ("light, first vertex", Dimensions::segment(0), [2, 3], 3),
        ("light, 5th vertex", Dimensions::segment(4), [2, 3], 5),
        ("light, 12th vertex", Dimensions::segment(11), [2, 3], 3),
    ];
    for (name, set, pair, t) in named {
        for (x, seed) in [(0, 0), (17, 9), (1023, 1 << 40)] {
            let pixel = PixelSampler::new(SamplerKind::Sobol, x, 4, 1, seed);
            for k in [2, 4, 6, 8, 10, 12] {
                let all: Vec<_> = (0..1u64 << k).map(|i| pixel.sample(i).get(set)).collect();
                let points: Vec<_> = all.iter().map(|p| pair.map(|d| p[d])).collect();
                assert!(quality(&points) <= t, "{name}, {k}: {}", quality(&points));
                for d in 0..4 {
                    let mut seen = vec![false; all.len()];
                    all.iter().for_each(|p| seen[(p[d] * all.len() as f32) as usize] = true);
                    assert!(seen.iter().all(|s| *s), "{name}, number {d} of 2^{k}");
                }
            }
        }
    }
    // Chance is no net.
    let pixel = PixelSampler::new(SamplerKind::Independent, 0, 0, 0, 0);
    let points: Vec<_> = (0..256).map(|i| pixel.sample(i).get(0)).map(|p| [p[0], p[1]]).collect();
    assert!(quality(&points) > 4);
}
