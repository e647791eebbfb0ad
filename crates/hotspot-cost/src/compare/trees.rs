//! What the luck of the trees adds to a comparison's variances.

use super::Side;
use super::inputs::Sides;
use crate::document::Document;
use crate::layers::Layers;
use crate::metric::Metric;
use crate::tree_noise::{TreeNoise, plane_name};

/// What is known of the two trees.
pub(super) enum Trees<'a> {
    /// Both renders went over the same tree.
    Same,
    /// Measured over shared shuffles.
    Pair(&'a TreeNoise, &'a Layers),
    /// Each side brings its own.
    Each([(&'a TreeNoise, &'a Layers); 2]),
    /// Not measured.
    Unknown,
}

impl<'a> Trees<'a> {
    pub(super) fn of(sides: &Sides<'a>, pair: Option<(&'a TreeNoise, &'a Layers)>) -> Self {
        if let Some((noise, layers)) = pair {
            return Self::Pair(noise, layers);
        }
        let digest = |side: &Side<'a>| side.document.map_or("", |d: &Document| d.tree.digest.as_str());
        if !digest(&sides.a).is_empty() && digest(&sides.a) == digest(&sides.b) {
            return Self::Same;
        }
        let own = |side: &Side<'a>| {
            let noise = side.document?.tree_noise.as_ref()?;
            (noise.trees > 1).then_some((noise, side.layers))
        };
        match (own(&sides.a), own(&sides.b)) {
            (Some(a), Some(b)) => Self::Each([a, b]),
            _ => Self::Unknown,
        }
    }

    pub(super) fn note(&self) -> Option<String> {
        match self {
            Self::Pair(..) => None,
            Self::Same => Some("both renders went over the same tree: there is no tree noise".into()),
            Self::Each([(a, _), (b, _)]) => Some(format!(
                "tree noise, measured over {} and {} trees, is in the intervals",
                a.trees, b.trees
            )),
            Self::Unknown => Some(
                "tree noise is not in the intervals: the trees differ, or nothing is known of them, and it was not measured; \
                 render both with --tree-noise 5"
                    .into(),
            ),
        }
    }

    /// Variances of B − R·A with their degrees of freedom, where `b` is B's mean; `None` where nothing is known. The relative
    /// spread of A's trees counts as R·A = B.
    pub(super) fn totals(&self, metric: Metric, b: f64) -> Option<Vec<(f64, f64)>> {
        let of = |noise: &TreeNoise| {
            let relative = noise.totals.get(metric.name()).copied().unwrap_or(0.0);
            ((b * relative).powi(2), f64::from(noise.trees - 1))
        };
        match self {
            Self::Same => Some(Vec::new()),
            Self::Pair(noise, _) => Some(vec![of(noise)]),
            Self::Each([(a, _), (b, _)]) => Some(vec![of(a), of(b)]),
            Self::Unknown => None,
        }
    }

    /// For tiles: planes of standard deviations of the tile's mean, with their degrees of freedom.
    pub(super) fn tiles(&self, sides: &Sides<'_>, metric: Metric) -> Vec<(&'a [f32], f64)> {
        let of = |(noise, layers): (&TreeNoise, &'a Layers)| {
            let plane = layers.plane(&plane_name(metric))?;
            (plane.len() == sides.a.layers.pixels()).then_some((plane, f64::from(noise.trees - 1)))
        };
        match self {
            Self::Same | Self::Unknown => Vec::new(),
            Self::Pair(noise, layers) => of((noise, layers)).into_iter().collect(),
            Self::Each(both) => both.iter().filter_map(|one| of(*one)).collect(),
        }
    }
}
