//! Gates: `--fail-over nodes=2%` fails a build when a render got costlier.

use super::Comparison;
use crate::metric::Metric;
use serde::{Deserialize, Serialize};

/// A limit for the growth of a metric's total.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// The metric.
    pub metric: Metric,
    /// Largest growth that passes, relative to A: 0.02 for 2 %.
    pub limit: f64,
}

/// Why a gate does not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GateError {
    /// Not of the form `metric=percentage`.
    #[error("\"{0}\" is not a gate; write a metric and a percentage such as nodes=2%")]
    Form(String),
    /// No such metric.
    #[error("no metric is named \"{0}\"")]
    Metric(String),
}

/// What a gate found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GateOutcome {
    /// No significant growth above the limit.
    Passed,
    /// Significant, and above the limit.
    Tripped,
    /// There is no interval, or no such layer, to decide by.
    #[default]
    Undecided,
}

/// A gate's outcome with its reason.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct GateResult {
    /// [`Metric::name`].
    pub metric: String,
    /// The limit, relative to A.
    pub limit: f64,
    /// The change found, relative to A.
    pub relative: Option<f64>,
    /// What follows.
    pub outcome: GateOutcome,
    /// In words.
    pub reason: String,
}

impl Gate {
    /// Reads `nodes=2%`.
    ///
    /// # Errors
    /// Anything else; the percentage must be finite and at least 0.
    pub fn parse(text: &str) -> Result<Self, GateError> {
        let form = || GateError::Form(text.to_owned());
        let (metric, limit) = text.split_once('=').ok_or_else(form)?;
        let percent: f64 =
            limit.trim().strip_suffix('%').ok_or_else(form)?.trim().parse().map_err(|_| form())?;
        if !percent.is_finite() || percent < 0.0 {
            return Err(form());
        }
        let metric = metric.trim();
        let metric = Metric::from_name(metric).ok_or_else(|| GateError::Metric(metric.to_owned()))?;
        Ok(Self { metric, limit: percent / 100.0 })
    }
}

impl Comparison {
    /// Whether a gate trips: only when the change is significant and larger than the limit. Falling cost never trips.
    /// Without an interval the outcome is [`GateOutcome::Undecided`].
    pub fn gate(&self, gate: &Gate) -> GateResult {
        let name = gate.metric.name();
        let limit = gate.limit * 100.0;
        let change = self.totals.get(name);
        let (outcome, reason) = match change {
            None => (GateOutcome::Undecided, format!("{name} is not in both renders")),
            Some(change) => {
                let larger = match change.relative {
                    Some(relative) => relative > gate.limit,
                    // From nothing to something is growth without bound.
                    None => change.delta > 0.0,
                };
                let found = match change.relative {
                    Some(relative) => format!("{name} changed by {:+.2} %", relative * 100.0),
                    None => format!("{name} went from 0 to {:.3} per path", change.b),
                };
                match (larger, change.significant) {
                    (false, _) => (GateOutcome::Passed, format!("{found}, within {limit} %")),
                    (true, Some(true)) => (GateOutcome::Tripped, format!("{found}, over {limit} %")),
                    (true, Some(false)) => {
                        (GateOutcome::Passed, format!("{found}, over {limit} % but not significantly"))
                    }
                    (true, None) => (
                        GateOutcome::Undecided,
                        format!("{found}, over {limit} %, but without an interval; render with --intervals"),
                    ),
                }
            }
        };
        GateResult {
            metric: name.to_owned(),
            limit: gate.limit,
            relative: change.and_then(|change| change.relative),
            outcome,
            reason,
        }
    }
}
