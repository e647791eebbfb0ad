//! How much of a cost is the luck of the tree.
//!
//! An edit rebuilds the tree, and costs change everywhere, also where nothing was edited. That *tree noise* is no sampling
//! error: more samples do not lessen it. It is measured by rendering the same scene, with the same random numbers, over several
//! trees that are as good as the renderer's own (hotspot-bvh's `shuffle`); paths are then the same and only what the tree
//! decides differs. Counts that no tree decides (rays, shading) show none.
//!
//! For a comparison in memory, A and B are rendered over the same shuffles, and the spread is that of ln(B/A): what an edit
//! leaves of the tree cancels, and an edit that rebuilds the same tree has no tree noise but that of its own effect. For files,
//! each side brings the spread of its own totals, and the two add up, unless both have the very same tree.
//!
//! The spread s over k trees (mean subtracted) has k − 1 degrees of freedom; the tree compared is another one, so its
//! variance is s² itself and not s²/k.

use crate::analysis::TILE;
use crate::layers::Layers;
use crate::metric::Metric;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The spread of costs over trees.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TreeNoise {
    /// Trees it was measured over, beside the one rendered.
    pub trees: u32,
    /// Camera samples per pixel of each.
    pub samples_per_pixel: u64,
    /// Standard deviation over trees of each metric's total, relative to their mean, by [`Metric::name`]; for a pair that
    /// of ln(B/A).
    pub totals: BTreeMap<String, f64>,
}

/// Name of the plane with the standard deviation over trees of a tile's mean, the same in all pixels of a tile.
pub(crate) fn plane_name(metric: Metric) -> String {
    format!("tree.{}", metric.name())
}

/// Collects renders over several trees, one after the other, and keeps their means of tiles only.
#[derive(Clone, Debug, Default)]
pub struct TreeSpread {
    size: [u32; 2],
    trees: u32,
    metrics: BTreeMap<&'static str, Spread>,
}

#[derive(Clone, Debug, Default)]
struct Spread {
    totals: Vec<f64>,
    /// Mean and sum of squared deviations of each tile (Welford).
    tiles: Vec<(f64, f64)>,
}

impl TreeSpread {
    /// Nothing yet, for pictures of this size.
    pub fn new(width: u32, height: u32) -> Self {
        Self { size: [width, height], ..Self::default() }
    }

    /// Adds a render over a further tree. Renders of another size are left out.
    pub fn add(&mut self, layers: &Layers) {
        self.add_values(layers, |metric| {
            let plane = layers.metric(metric)?;
            Some((mean(plane), self_tiles(layers, plane)))
        });
    }

    /// Adds a pair of renders over the same shuffle.
    pub fn add_pair(&mut self, a: &Layers, b: &Layers) {
        self.add_values(a, |metric| {
            let (a_plane, b_plane) = (a.metric(metric)?, b.metric(metric)?);
            let (mean_a, mean_b) = (mean(a_plane), mean(b_plane));
            let ratio = if mean_a > 0.0 && mean_b > 0.0 { (mean_b / mean_a).ln() } else { 0.0 };
            let tiles_b = self_tiles(b, b_plane);
            let difference = self_tiles(a, a_plane).iter().zip(tiles_b).map(|(a, b)| b - a).collect();
            Some((ratio, difference))
        });
    }

    fn add_values(&mut self, like: &Layers, values: impl Fn(Metric) -> Option<(f64, Vec<f64>)>) {
        if [like.width, like.height] != self.size {
            return;
        }
        self.trees += 1;
        let count = f64::from(self.trees);
        // Time says nothing here: its noise is another.
        for metric in Metric::ALL.into_iter().filter(|metric| *metric != Metric::TimeUs) {
            let Some((total, tiles)) = values(metric) else { continue };
            let spread = self.metrics.entry(metric.name()).or_default();
            spread.totals.push(total);
            spread.tiles.resize(tiles.len(), (0.0, 0.0));
            for ((mean, squares), value) in spread.tiles.iter_mut().zip(tiles) {
                let before = value - *mean;
                *mean += before / count;
                *squares += before * (value - *mean);
            }
        }
    }

    /// The spread of renders that were added with [`TreeSpread::add`], and its planes (`tree.<metric>`) into `layers`, where
    /// they fit. `None` for fewer than two trees.
    pub fn finish(self, samples_per_pixel: u64, layers: &mut Layers) -> Option<TreeNoise> {
        self.spread(samples_per_pixel, layers, false)
    }

    /// The same of [`TreeSpread::add_pair`].
    pub fn finish_pairs(self, samples_per_pixel: u64, layers: &mut Layers) -> Option<TreeNoise> {
        self.spread(samples_per_pixel, layers, true)
    }

    fn spread(self, samples_per_pixel: u64, layers: &mut Layers, pairs: bool) -> Option<TreeNoise> {
        if self.trees < 2 {
            return None;
        }
        let degrees = f64::from(self.trees - 1);
        let mut totals = BTreeMap::new();
        for (name, spread) in self.metrics {
            let count = spread.totals.len() as f64;
            let mean = spread.totals.iter().sum::<f64>() / count;
            let squares: f64 = spread.totals.iter().map(|total| (total - mean).powi(2)).sum();
            let deviation = (squares / (count - 1.0).max(1.0)).sqrt();
            let relative = if pairs {
                deviation
            } else if mean == 0.0 {
                0.0
            } else {
                deviation / mean.abs()
            };
            totals.insert(name.to_owned(), relative);
            if let Some(metric) = Metric::from_name(name)
                && [layers.width, layers.height] == self.size
            {
                let deviations: Vec<f32> =
                    spread.tiles.iter().map(|(_, squares)| (squares / degrees).sqrt() as f32).collect();
                let plane = tile_numbers(layers).map(|tile| deviations[tile]).collect();
                layers.insert(plane_name(metric), plane);
            }
        }
        Some(TreeNoise { trees: self.trees, samples_per_pixel, totals })
    }
}

/// The tile of each pixel, in order.
fn tile_numbers(layers: &Layers) -> impl Iterator<Item = usize> {
    let (width, height) = (layers.width, layers.height);
    let columns = width.div_ceil(TILE);
    (0..height).flat_map(move |y| (0..width).map(move |x| (y / TILE * columns + x / TILE) as usize))
}

fn self_tiles(layers: &Layers, plane: &[f32]) -> Vec<f64> {
    let count = (layers.width.div_ceil(TILE) * layers.height.div_ceil(TILE)) as usize;
    let mut sums = vec![(0.0, 0.0); count];
    for (tile, value) in tile_numbers(layers).zip(plane) {
        if value.is_finite() {
            sums[tile].0 += f64::from(*value);
            sums[tile].1 += 1.0;
        }
    }
    sums.into_iter().map(|(sum, count): (f64, f64)| sum / count.max(1.0)).collect()
}

fn mean(plane: &[f32]) -> f64 {
    let finite = plane.iter().filter(|value| value.is_finite());
    let (sum, count) = finite.fold((0.0, 0.0), |(sum, count), value| (sum + f64::from(*value), count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layers(values: impl Fn(u32, u32) -> f32) -> Layers {
        let mut layers = Layers::new(20, 9);
        let plane = (0..9).flat_map(|y| (0..20).map(move |x| (x, y))).map(|(x, y)| values(x, y)).collect();
        layers.insert("cost.nodes", plane);
        layers
    }

    #[test]
    fn spreads_are_those_of_totals_and_of_tiles() {
        let mut spread = TreeSpread::new(20, 9);
        // The left tile varies, the rest does not.
        for value in [8.0, 10.0, 12.0] {
            spread.add(&layers(|x, y| if x < 8 && y < 8 { value } else { 10.0 }));
        }
        let mut out = layers(|_, _| 10.0);
        let noise = spread.finish(4, &mut out).unwrap();
        assert_eq!((noise.trees, noise.samples_per_pixel), (3, 4));
        let expected = 2.0 * 64.0 / 180.0 / 10.0;
        assert!((noise.totals["nodes"] - expected).abs() < 1e-9);
        let plane = out.plane("tree.nodes").unwrap();
        assert_eq!((plane[0], plane[7 * 20 + 7], plane[8], plane[8 * 20]), (2.0, 2.0, 0.0, 0.0));
    }

    #[test]
    fn what_both_sides_share_cancels_in_pairs() {
        let mut spread = TreeSpread::new(20, 9);
        for luck in [0.9, 1.0, 1.1] {
            spread.add_pair(&layers(|_, _| 10.0 * luck), &layers(|_, _| 5.0 * luck));
        }
        let noise = spread.finish_pairs(4, &mut Layers::default()).unwrap();
        assert!(noise.totals["nodes"] < 1e-6, "{noise:?}");
        let one = TreeSpread::new(20, 9);
        assert_eq!(one.finish(1, &mut Layers::default()), None);
    }
}
