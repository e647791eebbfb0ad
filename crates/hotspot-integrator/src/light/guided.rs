//! Inversion of cumulative distributions with a guide table.
//!
//! Inversion rather than the alias method: it is monotonic, so that stratified numbers give stratified choices. The guide
//! (Chen and Asau, *On Generating Random Variates from an Empirical Distribution*, 1974) narrows the search to the entries
//! that reach into an equal interval of [0, 1), some eight on average, which lie side by side.

/// Entries per interval of the guide, on average, at most twice as many.
const ENTRIES: usize = 8;

/// Intervals of the guide of a distribution over `count` entries: a power of two, so that `u * intervals` is exact.
fn intervals(count: usize) -> usize {
    (count / ENTRIES).max(1).next_power_of_two()
}

/// Distributions over equally many entries each, such as the texels of each row.
#[derive(Clone, Debug, Default)]
pub(super) struct Guided {
    count: usize,
    intervals: usize,
    /// Probability of all entries before each, by distribution. Rounded to f32, so an entry's own probability is off by at
    /// most 2^-24, and that of any run of entries as well: no more than what is lost by numbers of 23 or 24 bits anyway.
    cumulative: Vec<f32>,
    /// Entry that holds the start of each interval, by distribution, and one past the last.
    guide: Vec<u32>,
}

impl Guided {
    pub(super) fn with_capacity(distributions: usize, count: usize) -> Self {
        let intervals = intervals(count);
        Self {
            count,
            intervals,
            cumulative: Vec::with_capacity(distributions * count),
            guide: Vec::with_capacity(distributions * (intervals + 1)),
        }
    }

    /// Adds a distribution in proportion to `weights` (at least 0, `count` of them) and returns their sum. One without
    /// any weight must never be sampled.
    pub(super) fn push(&mut self, weights: impl Iterator<Item = f64> + Clone) -> f64 {
        let start = self.cumulative.len();
        let total: f64 = weights.clone().sum();
        let mut before = 0.0f64;
        let mut last = 0u32;
        for (i, weight) in weights.enumerate().take(self.count) {
            self.cumulative.push(if total > 0.0 { (before / total) as f32 } else { 0.0 });
            before += weight;
            if weight > 0.0 {
                last = i as u32;
            }
        }
        self.cumulative.resize(start + self.count, 1.0);
        let cumulative = &self.cumulative[start..];
        let mut index = 0;
        for interval in 0..self.intervals {
            let begin = interval as f32 / self.intervals as f32;
            while index + 1 < self.count && cumulative[index + 1] <= begin {
                index += 1;
            }
            self.guide.push(index as u32);
        }
        self.guide.push(last.max(index as u32));
        total
    }

    /// The entry that holds `u` (in [0, 1)), never one without weight, and where in it `u` lies, in [0, 1).
    #[inline(always)]
    pub(super) fn sample(&self, distribution: usize, u: f32) -> (usize, f32) {
        let cumulative = &self.cumulative[distribution * self.count..][..self.count];
        let guide = &self.guide[distribution * (self.intervals + 1)..][..self.intervals + 1];
        let interval = ((u * self.intervals as f32) as usize).min(self.intervals - 1);
        let (low, high) = (guide[interval] as usize, guide[interval + 1] as usize);
        let index = low + cumulative[low + 1..=high].partition_point(|c| *c <= u);
        let start = cumulative[index];
        let end = cumulative.get(index + 1).copied().unwrap_or(1.0);
        (index, ((u - start) / (end - start)).clamp(0.0, 1.0 - f32::EPSILON))
    }

    pub(super) fn memory(&self) -> u64 {
        (size_of_val(&self.cumulative[..]) + size_of_val(&self.guide[..])) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a plain search, on and beside every boundary, and with the rest in order.
    #[test]
    fn the_guide_finds_what_a_search_finds() {
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as f64 / 16_777_216.0
        };
        for count in [1usize, 2, 3, 7, 8, 9, 31, 64, 100, 1000] {
            let rows: Vec<Vec<f64>> = vec![
                (0..count).map(|_| random()).collect(),
                (0..count).map(|_| if random() < 0.7 { 0.0 } else { random().powi(8) }).collect(),
                vec![0.0; count],
                (0..count).map(|i| f64::from(u8::from(i == count / 2))).collect(),
                (0..count).map(|i| if i == 0 { 1e6 } else { 1.0 }).collect(),
            ];
            let mut guided = Guided::with_capacity(rows.len(), count);
            for (row, weights) in rows.iter().enumerate() {
                let total = guided.push(weights.iter().copied());
                assert_eq!(total, weights.iter().sum::<f64>());
                if total == 0.0 {
                    continue;
                }
                let cumulative = guided.cumulative[row * count..][..count].to_vec();
                let mut numbers: Vec<f32> = (0..2000).map(|_| random() as f32).collect();
                for c in &cumulative {
                    numbers.extend([c.next_down(), *c, c.next_up()]);
                }
                numbers.extend([0.0, 1.0f32.next_down()]);
                for u in numbers.into_iter().filter(|u| (0.0..1.0).contains(u)) {
                    let (found, rest) = guided.sample(row, u);
                    let expected = (0..count).rev().find(|&i| cumulative[i] <= u).unwrap();
                    assert_eq!(found, expected, "row {row} of {count}, u {u}");
                    assert!(weights[found] > 0.0 && (0.0..1.0).contains(&rest));
                }
            }
        }
    }

    /// Equal numbers of equally spaced points where the weights are equal: inversion keeps strata.
    #[test]
    fn choices_are_in_proportion() {
        let weights = [3.0, 0.0, 1.0, 4.0, 0.0];
        let mut guided = Guided::with_capacity(1, weights.len());
        guided.push(weights.into_iter());
        let mut hits = [0u32; 5];
        (0..800).for_each(|i| hits[guided.sample(0, (i as f32 + 0.5) / 800.0).0] += 1);
        assert_eq!(hits, [300, 0, 100, 400, 0]);
    }
}
