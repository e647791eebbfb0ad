//! Intervals of correlations and shares over a picture, by resampling blocks of pixels: neighbours are alike, so that pixels
//! counted as independent would make intervals several times too narrow.

/// Edge of a block in pixels: four tiles of a comparison.
const BLOCK: u32 = 32;

/// Resamplings behind an interval.
const RESAMPLES: usize = 1000;

/// An estimate with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) ci95: [f64; 2],
}

impl Estimate {
    /// "0.812 (0.801 to 0.823)".
    pub(crate) fn digits(&self, digits: usize) -> String {
        let [low, high] = self.ci95;
        format!("{:.digits$} ({low:.digits$} to {high:.digits$})", self.value)
    }
}

/// The block of every value of a plane of so many columns, each of which stands for `edge`² pixels.
fn block_of(width: u32, edge: u32) -> impl Fn(usize) -> usize {
    let size = (BLOCK / edge).max(1);
    let columns = width.div_ceil(size) as usize;
    move |i| {
        let (x, y) = (i % width as usize, i / width as usize);
        y / size as usize * columns + x / size as usize
    }
}

/// A statistic of sums over a picture, with an interval: percentiles over blocks drawn with replacement. `sums` gives what a
/// value adds; the same on every run.
pub(crate) fn over_blocks<const N: usize, const S: usize>(
    [width, height]: [u32; 2],
    edge: u32,
    sums: impl Fn(usize) -> [f64; N],
    statistic: impl Fn(&[f64; N]) -> [f64; S],
) -> [Estimate; S] {
    let block = block_of(width, edge);
    let count = width as usize * height as usize;
    let blocks = (0..count).map(&block).max().map_or(0, |last| last + 1);
    let mut parts = vec![[0.0; N]; blocks];
    for i in 0..count {
        for (sum, value) in parts[block(i)].iter_mut().zip(sums(i)) {
            *sum += value;
        }
    }
    let add = |mut all: [f64; N], part: &[f64; N]| {
        for (sum, value) in all.iter_mut().zip(part) {
            *sum += value;
        }
        all
    };
    let value = statistic(&parts.iter().fold([0.0; N], add));
    let mut state = 0x5eed_u64;
    let mut drawn: [Vec<f64>; S] = core::array::from_fn(|_| Vec::with_capacity(RESAMPLES));
    for _ in 0..RESAMPLES {
        let mut all = [0.0; N];
        for _ in 0..blocks {
            all = add(all, &parts[(next(&mut state) % blocks as u64) as usize]);
        }
        for (values, value) in drawn.iter_mut().zip(statistic(&all)) {
            values.push(value);
        }
    }
    core::array::from_fn(|k| {
        let values = &mut drawn[k];
        values.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
        Estimate { value: value[k], ci95: [at(0.025), at(0.975)] }
    })
}

/// Correlations of `a` and of `b` with `t`, and the first less the second, resampled together.
pub(crate) fn correlations(size: [u32; 2], edge: u32, a: &[f32], b: &[f32], t: &[f32]) -> [Estimate; 3] {
    let sums = |i: usize| {
        let [a, b, t] = [a[i], b[i], t[i]].map(f64::from);
        [1.0, a, a * a, a * t, b, b * b, b * t, t, t * t]
    };
    over_blocks(size, edge, sums, |&[n, a, aa, at, b, bb, bt, t, tt]| {
        let of = |x: f64, xx: f64, xt: f64| {
            let (x_spread, t_spread) = (xx - x * x / n, tt - t * t / n);
            (xt - x * t / n) / (x_spread * t_spread).sqrt()
        };
        let (first, second) = (of(a, aa, at), of(b, bb, bt));
        [first, second, first - second]
    })
}

/// `SplitMix64`.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(state: &mut u64) -> f64 {
        (next(state) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Planes whose values agree within blocks: intervals of 100 pictures must cover the truth about as often as they say. Of
    /// 200 intervals, two and two from one picture, 95 % should cover; fewer than 87 % by chance less than once in 10^4.
    #[test]
    fn intervals_cover_though_neighbours_are_alike() {
        let size = [256, 192];
        let mut covered = 0;
        for seed in 0..100 {
            let mut state = 77 * seed;
            // Sums of twelve uniform numbers are normal enough.
            let mut normal = || (0..12).map(|_| unit(&mut state)).sum::<f64>() - 6.0;
            let shared: Vec<[f64; 3]> = (0..24 * 32).map(|_| core::array::from_fn(|_| normal())).collect();
            let at = |i: usize| shared[(i / 256 / 8) * 32 + i % 256 / 8];
            // Correlations of 0.8 and 0.6.
            let t: Vec<f32> = (0..256 * 192).map(|i| at(i)[0] as f32).collect();
            let a: Vec<f32> = (0..256 * 192).map(|i| (0.8 * at(i)[0] + 0.6 * at(i)[1]) as f32).collect();
            let b: Vec<f32> = (0..256 * 192).map(|i| (0.6 * at(i)[0] + 0.8 * at(i)[2]) as f32).collect();
            let [first, second, _] = correlations(size, 1, &a, &b, &t);
            for (estimate, truth) in [(first, 0.8), (second, 0.6)] {
                covered += u32::from(estimate.ci95[0] <= truth && truth <= estimate.ci95[1]);
            }
        }
        assert!((174..=199).contains(&covered), "{covered} of 200");
    }

    #[test]
    fn values_are_those_of_the_whole_plane() {
        let mut state = 5;
        let plane: Vec<f32> = (0..70 * 50).map(|_| unit(&mut state) as f32).collect();
        let other: Vec<f32> = plane.iter().map(|v| 2.0 * v + 0.3 * unit(&mut state) as f32).collect();
        let [r, one, difference] = correlations([70, 50], 1, &other, &plane, &plane);
        let expected = hotspot_cost::analysis::correlation(&other, &plane).unwrap();
        assert!((r.value - expected).abs() < 1e-9 && (one.value - 1.0).abs() < 1e-9);
        assert!((difference.value - (expected - 1.0)).abs() < 1e-9);
    }
}
