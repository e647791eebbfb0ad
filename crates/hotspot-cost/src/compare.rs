//! What changed between two renders, and whether it could be chance.
//!
//! A total's change is R − 1 with R = B/A, where A and B are means over pixels of the mean cost per path. To first order
//! R's error is that of Σ_p (b_p − R·a_p)/(P·A), so with halves
//!
//! Var R = Σ_p (half_b,p − R·half_a,p)² / (P·A)²
//!
//! whether the renders share their random numbers (then most of the noise cancels, index by index) or not (then the cross
//! terms average out). Each pixel gives one degree of freedom; the sum's are Satterthwaite's, the interval is Student's.
//! Assumed: pixels are independent, halves are independent of each other, A's own relative error is small (below some
//! 10 %). Not included: differences between runs in time.
//!
//! Where the trees differ, what their luck changes ([`crate::tree_noise`]) is added to the variance, of totals and of tiles,
//! if it was measured; else a note says that it is missing.
//!
//! Without halves on both sides the variances of A and B are added as if independent, from whatever there is: half²,
//! `var.*`, the document's interval. With s²/n and shared random numbers that is doubly too wide, hence "conservative".
//!
//! Tiles of 8 × 8 pixels are tested in the same way, Σ (b − a) against Σ (half_b − half_a)², and the false-discovery rate
//! over all tiles is held at 5 % (Benjamini and Hochberg 1995): where nothing changed, any flag at all appears in at most
//! 5 % of comparisons, for each metric.

mod gate;
mod inputs;
mod power;
mod tiles;
mod trees;

pub use gate::{Gate, GateError, GateOutcome, GateResult};
pub use power::Needed;

use crate::document::Document;
use crate::error::Result;
use crate::layers::Layers;
use crate::metric::{Metric, Sum};
use crate::stats::CiKind;
use crate::tree_noise::TreeNoise;
use inputs::Sides;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The schema of [`Comparison`].
pub const SCHEMA: &str = "hotspot-compare/1";

/// The JSON Schema of [`Comparison`].
pub const JSON_SCHEMA: &str = include_str!("../schema/hotspot-compare-1.schema.json");

/// Rate of false discoveries among flagged tiles.
pub const FALSE_DISCOVERY_RATE: f64 = 0.05;

/// One of two renders.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a> {
    /// What to call it: its file.
    pub name: &'a str,
    /// Its planes.
    pub layers: &'a Layers,
    /// Its document, when it has one.
    pub document: Option<&'a Document>,
}

/// The change from A to B: `compare.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Comparison {
    /// [`SCHEMA`].
    pub schema: String,
    /// The first render's file.
    pub a: String,
    /// The second's.
    pub b: String,
    /// Compared although the renders differ in a way that `--force` overrides.
    pub forced: bool,
    /// Changes of the totals, by [`Metric::name`].
    pub totals: BTreeMap<String, TotalChange>,
    /// Pixels tested and found changed, by [`Metric::name`].
    pub pixels: BTreeMap<String, PixelTests>,
    /// What to know when reading the figures.
    pub notes: Vec<String>,
    /// Gates and whether they tripped.
    pub gates: Vec<GateResult>,
    /// Planes to draw: `diff.<metric>` = b − a; `relative.<metric>` = (b − a)/a, 0 where a is 0; with halves
    /// `significant.<metric>`: 1 in tiles that changed, 0 elsewhere, and `p_value.<metric>`: each tile's own p-value, not
    /// adjusted for the number of tiles. Not part of the JSON.
    #[serde(skip)]
    pub layers: Layers,
}

/// The change of one metric over the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TotalChange {
    /// Per path in A: the mean over pixels of the mean per path (with equal sample counts in all pixels, the mean of A's
    /// document).
    pub a: f64,
    /// Per path in B.
    pub b: f64,
    /// b − a.
    pub delta: f64,
    /// delta/a; null when a is 0.
    pub relative: Option<f64>,
    /// 95 % interval of `relative`.
    pub ci95: Option<[f64; 2]>,
    /// Where it comes from.
    pub ci_kind: CiKind,
    /// Whether the interval leaves out 0; null without one.
    pub significant: Option<bool>,
    /// Two-sided probability of a change at least this large where nothing changed: below 0.05 exactly when `significant`,
    /// up to the rounding of planes. Not adjusted for the number of metrics looked at.
    pub p_value: Option<f64>,
    /// Standard error of `relative` from sampling alone; absent where there are no halves.
    pub sampling_error: Option<f64>,
    /// Its degrees of freedom.
    pub sampling_dof: Option<f64>,
    /// Standard error of `relative` from the luck of the trees; absent where it is not known.
    pub tree_error: Option<f64>,
    /// Σ over A's paths, from its document.
    pub sum_a: Option<Sum>,
    /// Σ over B's paths.
    pub sum_b: Option<Sum>,
}

/// How many pixels were tested, and how many lie in tiles that changed; null where halves are missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct PixelTests {
    /// Pixels in tested tiles.
    pub tested: Option<u64>,
    /// Pixels in tiles with a significant change.
    pub significant: Option<u64>,
}

/// Compares B with A.
///
/// # Errors
/// [`crate::Error::Unsupported`] when the renders differ in size, tree width, builder or kernel and `force` is false;
/// [`crate::Error::Invalid`] when they share no metric, or a plane does not fit its picture.
pub fn compare(a: Side<'_>, b: Side<'_>, force: bool) -> Result<Comparison> {
    compare_over_trees(a, b, force, None)
}

/// [`compare`] with the tree noise of the pair, measured over shared shuffles ([`crate::TreeSpread::add_pair`]), in place of
/// each side's own: its totals, and the layers that hold its planes.
///
/// # Errors
/// As [`compare`].
pub fn compare_over_trees(
    a: Side<'_>,
    b: Side<'_>,
    force: bool,
    pair: Option<(&TreeNoise, &Layers)>,
) -> Result<Comparison> {
    let mut sides = Sides::new(a, b, force)?;
    let trees = trees::Trees::of(&sides, pair);
    sides.notes.extend(trees.note());
    let mut comparison = Comparison {
        schema: SCHEMA.to_owned(),
        a: a.name.to_owned(),
        b: b.name.to_owned(),
        forced: force && sides.overridden,
        notes: sides.notes.clone(),
        layers: if sides.same_size {
            Layers::new(a.layers.width, a.layers.height)
        } else {
            Layers::default()
        },
        ..Comparison::default()
    };
    for metric in &sides.metrics {
        comparison.add(&sides, &trees, *metric);
    }
    Ok(comparison)
}

impl Comparison {
    fn add(&mut self, sides: &Sides<'_>, trees: &trees::Trees<'_>, metric: Metric) {
        let name = metric.name().to_owned();
        self.totals.insert(name.clone(), change(sides, trees, metric));
        let mut tests = PixelTests::default();
        if sides.same_size
            && let (Some(a), Some(b)) = (sides.a.layers.metric(metric), sides.b.layers.metric(metric))
        {
            let relative = |a: f32, b: f32| if a == 0.0 { 0.0 } else { (b - a) / a };
            self.layers.insert(format!("diff.{name}"), a.iter().zip(b).map(|(a, b)| b - a).collect());
            self.layers
                .insert(format!("relative.{name}"), a.iter().zip(b).map(|(a, b)| relative(*a, *b)).collect());
            if metric != Metric::TimeUs
                && let (Some(half_a), Some(half_b)) =
                    (inputs::half(&sides.a, metric), inputs::half(&sides.b, metric))
            {
                let differences: Vec<[f64; 2]> = sides
                    .pixels()
                    .map(|index| {
                        let valid = sides.valid(index, metric);
                        let difference = |a: &[f32], b: &[f32]| f64::from(b[index]) - f64::from(a[index]);
                        if valid { [difference(a, b), difference(half_a, half_b)] } else { [0.0; 2] }
                    })
                    .collect();
                let tiles::Tested { flags, p_values } = tiles::test(
                    sides.a.layers.width,
                    sides.a.layers.height,
                    &differences,
                    &trees.tiles(sides, metric),
                );
                self.layers.insert(format!("p_value.{name}"), p_values);
                tests.tested = Some(differences.len() as u64);
                tests.significant = Some(flags.iter().filter(|flag| **flag).count() as u64);
                let plane = flags.into_iter().map(|flag| if flag { 1.0 } else { 0.0 }).collect();
                self.layers.insert(format!("significant.{name}"), plane);
            }
        }
        self.pixels.insert(name, tests);
    }

    /// As indented JSON with a newline at its end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }
}

/// The change of a metric's mean with its interval.
fn change(sides: &Sides<'_>, trees: &trees::Trees<'_>, metric: Metric) -> TotalChange {
    let (a, b) = (sides.mean(&sides.a, metric), sides.mean(&sides.b, metric));
    let sum =
        |side: &Side<'_>| side.document.and_then(|document| document.total(metric)).map(|total| total.sum);
    let mut change = TotalChange {
        a,
        b,
        delta: b - a,
        relative: (a != 0.0).then(|| (b - a) / a),
        sum_a: sum(&sides.a),
        sum_b: sum(&sides.b),
        ..TotalChange::default()
    };
    // Repeats alone can tell about time.
    if metric == Metric::TimeUs {
        return change;
    }
    let ratio = if a == 0.0 { 0.0 } else { b / a };
    let Some((mut variance, kind)) = sides.variance(metric, ratio) else { return change };
    change.ci_kind = kind;
    if a != 0.0 {
        change.sampling_error = (kind == CiKind::Halves).then(|| variance.sum().sqrt() / a.abs());
        change.sampling_dof = (kind == CiKind::Halves).then(|| variance.dof());
    }
    let of_trees = trees.totals(metric, b);
    for (of_tree, dof) in of_trees.iter().flatten() {
        variance.add(*of_tree, *dof);
    }
    if a != 0.0 {
        change.tree_error = of_trees.map(|v| v.iter().map(|(v, _)| v).sum::<f64>().sqrt() / a.abs());
    }
    // Planes are rounded to f32: what lies below that is no change.
    let rounding = f64::from(f32::EPSILON) * a.abs().max(b.abs());
    change.p_value = Some(if change.delta.abs() <= rounding { 1.0 } else { variance.p_value(change.delta) });
    match change.relative {
        Some(relative) => {
            let width = (variance.half_width95() + rounding) / a.abs();
            change.ci95 = Some([relative - width, relative + width]);
            change.significant = Some(relative.abs() > width);
        }
        None => change.significant = Some(change.delta.abs() > variance.half_width95() + rounding),
    }
    change
}

#[cfg(test)]
mod tests;
