//! The two sides of a comparison: whether they may be compared, what they share, their means and variances.

use super::Side;
use crate::document::{Document, Tree};
use crate::error::{Error, Result};
use crate::metric::Metric;
use crate::stats::CiKind;
use crate::student::Variance;

/// Two renders that may be compared.
pub(super) struct Sides<'a> {
    pub(super) a: Side<'a>,
    pub(super) b: Side<'a>,
    /// Pixel by pixel, not in total alone.
    pub(super) same_size: bool,
    /// `force` was needed.
    pub(super) overridden: bool,
    /// The metrics that both have.
    pub(super) metrics: Vec<Metric>,
    pub(super) notes: Vec<String>,
}

impl<'a> Sides<'a> {
    pub(super) fn new(a: Side<'a>, b: Side<'a>, force: bool) -> Result<Self> {
        for side in [&a, &b] {
            for (name, plane) in &side.layers.planes {
                if plane.len() != side.layers.pixels() || plane.is_empty() {
                    return Err(Error::invalid(
                        side.name,
                        format!("plane {name} does not fit {} × {}", side.layers.width, side.layers.height),
                        "render it again",
                    ));
                }
            }
        }
        let same_size = (a.layers.width, a.layers.height) == (b.layers.width, b.layers.height);
        let mut notes = Vec::new();
        let mut obstacles = Vec::new();
        if !same_size {
            obstacles.push(format!(
                "size ({} × {} and {} × {})",
                a.layers.width, a.layers.height, b.layers.width, b.layers.height
            ));
            notes.push("the sizes differ: totals alone are compared, as if independent".to_owned());
        }
        let mut weighted = true;
        match (a.document.filter(|d| tells(d)), b.document.filter(|d| tells(d))) {
            (Some(a), Some(b)) => {
                obstacles.extend(unlike(a, b));
                notes.extend(remarks(a, b));
                weighted = a.cost_model == b.cost_model;
                if !weighted {
                    notes.push("c0 and c1 differ: intersection and waste are left out".to_owned());
                }
            }
            _ => notes.push(
                "a document is missing: tree, builder, kernel, c0 and c1 could not be checked".to_owned(),
            ),
        }
        if !obstacles.is_empty() && !force {
            return Err(Error::unsupported(
                format!("{} and {}", a.name, b.name),
                format!("the renders differ in {}", obstacles.join(", ")),
                "render both alike, or compare them nevertheless with --force",
            ));
        }
        let metrics: Vec<Metric> = a
            .layers
            .metrics()
            .filter(|metric| b.layers.metric(*metric).is_some() && (weighted || !metric.is_weighted()))
            .collect();
        if metrics.is_empty() {
            return Err(Error::invalid(
                format!("{} and {}", a.name, b.name),
                "they share no cost layer",
                "render both with the same --metrics",
            ));
        }
        let halves = |side: &Side<'_>| metrics.iter().any(|metric| half(side, *metric).is_some());
        for side in [&a, &b] {
            if !halves(side) {
                notes.push(format!(
                    "{} has no halves: intervals are conservative where there are any, and pixels are not tested; \
                     render with --intervals",
                    side.name
                ));
            }
        }
        Ok(Self { a, b, same_size, overridden: !obstacles.is_empty(), metrics, notes })
    }

    /// Indices of the pixels (of A, when the sizes differ).
    pub(super) fn pixels(&self) -> std::ops::Range<usize> {
        0..self.a.layers.pixels()
    }

    /// Whether a pixel has finite values and paths on both sides.
    pub(super) fn valid(&self, index: usize, metric: Metric) -> bool {
        counted(&self.a, index, metric) && counted(&self.b, index, metric)
    }

    fn usable(&self, side: &Side<'_>, index: usize, metric: Metric) -> bool {
        if self.same_size { self.valid(index, metric) } else { counted(side, index, metric) }
    }

    /// Number of pixels that `mean` and `variance` cover on a side.
    fn count(&self, side: &Side<'_>, metric: Metric) -> f64 {
        (0..side.layers.pixels()).filter(|index| self.usable(side, *index, metric)).count() as f64
    }

    /// Mean over pixels, 0 without any.
    pub(super) fn mean(&self, side: &Side<'_>, metric: Metric) -> f64 {
        let Some(plane) = side.layers.metric(metric) else { return 0.0 };
        let (mut sum, mut count) = (0.0, 0.0);
        for (index, value) in plane.iter().enumerate() {
            if self.usable(side, index, metric) {
                sum += f64::from(*value);
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Variance of B − ratio·A with its kind; `None` when a side has none.
    pub(super) fn variance(&self, metric: Metric, ratio: f64) -> Option<(Variance, CiKind)> {
        if self.same_size
            && let (Some(a), Some(b)) = (half(&self.a, metric), half(&self.b, metric))
        {
            let weight = 1.0 / self.count(&self.a, metric).max(1.0);
            let mut variance = Variance::default();
            for index in self.pixels().filter(|index| self.valid(*index, metric)) {
                let residual = weight * (f64::from(b[index]) - ratio * f64::from(a[index]));
                if residual.is_finite() {
                    variance.add(residual * residual, 1.0);
                }
            }
            return Some((variance, CiKind::Halves));
        }
        let mut variance = Variance::default();
        let a = self.own_variance(&self.a, metric, ratio, &mut variance)?;
        let b = self.own_variance(&self.b, metric, 1.0, &mut variance)?;
        let both = a == CiKind::Halves && b == CiKind::Halves;
        Some((variance, if both { CiKind::Halves } else { CiKind::Conservative }))
    }

    /// Adds the variance of `factor` times a side's mean.
    fn own_variance(
        &self,
        side: &Side<'_>,
        metric: Metric,
        factor: f64,
        variance: &mut Variance,
    ) -> Option<CiKind> {
        let weight = factor / self.count(side, metric).max(1.0);
        let mut add = |plane: &[f32], square: bool, dof: &dyn Fn(usize) -> f64| {
            for (index, value) in plane.iter().enumerate() {
                if self.usable(side, index, metric) && value.is_finite() {
                    let value = f64::from(*value);
                    let own = if square { value * value } else { value };
                    variance.add(weight * weight * own, dof(index));
                }
            }
        };
        if let Some(half) = half(side, metric) {
            add(half, true, &|_| 1.0);
            return Some(CiKind::Halves);
        }
        let samples = side.layers.plane("cost.samples");
        // One sample has no variance to show: such planes do not count.
        if let (Some(var), Some(samples)) = (side.layers.var(metric), samples)
            && samples.iter().all(|samples| *samples >= 2.0 || *samples == 0.0)
        {
            add(var, false, &|index| f64::from(samples[index]) - 1.0);
            return Some(CiKind::Conservative);
        }
        let total = side.document?.total(metric)?;
        let [low, high] = total.ci95?;
        let deviation = factor * (high - low) / (2.0 * 1.96);
        variance.add(deviation * deviation, side.layers.pixels() as f64);
        Some(total.ci_kind)
    }
}

/// The half differences, where they say something: pixels with a single path have one half alone and a difference of 0.
pub(super) fn half<'a>(side: &Side<'a>, metric: Metric) -> Option<&'a [f32]> {
    let lone = |samples: &[f32]| samples.iter().any(|samples| *samples > 0.0 && *samples < 2.0);
    if side.layers.plane("cost.samples").is_some_and(lone) { None } else { side.layers.half(metric) }
}

fn counted(side: &Side<'_>, index: usize, metric: Metric) -> bool {
    let samples = side.layers.plane("cost.samples").is_none_or(|samples| samples[index] > 0.0);
    samples && side.layers.metric(metric).is_some_and(|plane| plane[index].is_finite())
}

/// Whether a document says how its counts came about; other programs' do not.
fn tells(document: &Document) -> bool {
    document.tree != Tree::default() || !document.render.kernel.is_empty()
}

/// A kernel's name without what does not change counts: instruction set and scene class follow in further words.
fn kernel(document: &Document) -> &str {
    document.render.kernel.split_whitespace().next().unwrap_or_default()
}

/// What makes counts incomparable.
fn unlike(a: &Document, b: &Document) -> Vec<String> {
    let mut unlike = Vec::new();
    if a.tree.width != b.tree.width {
        unlike.push(format!("tree width ({} and {})", a.tree.width, b.tree.width));
    }
    if a.tree.builder != b.tree.builder {
        unlike.push(format!("builder ({} and {})", a.tree.builder, b.tree.builder));
    }
    if kernel(a) != kernel(b) {
        unlike.push(format!("kernel ({} and {})", kernel(a), kernel(b)));
    }
    unlike
}

/// What explains a difference without being the scene.
fn remarks(a: &Document, b: &Document) -> Vec<String> {
    let mut remarks = Vec::new();
    if a.cost_samples_per_pixel != b.cost_samples_per_pixel {
        remarks.push(format!(
            "paths per pixel differ: {} and {}",
            a.cost_samples_per_pixel, b.cost_samples_per_pixel
        ));
    }
    if kernel(a) == kernel(b) && a.render.kernel != b.render.kernel {
        remarks.push(format!(
            "instruction set or scene class differ, which does not change counts: {} and {}",
            a.render.kernel, b.render.kernel
        ));
    }
    let names: std::collections::BTreeSet<_> = a.settings.keys().chain(b.settings.keys()).collect();
    for name in names {
        if a.settings.get(name) != b.settings.get(name) {
            let value = |document: &Document| {
                document.settings.get(name).map_or_else(|| "absent".to_owned(), ToString::to_string)
            };
            remarks.push(format!("setting {name} differs: {} and {}", value(a), value(b)));
        }
    }
    remarks
}
