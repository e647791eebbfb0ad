//! `error.json`.

use super::fit::{Crossing, Estimate, Middle, mean_with_interval, median_with_interval, seconds_to, slope};
use crate::picture_error::PictureError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The schema of [`ErrorReport`].
pub const SCHEMA: &str = "hotspot-error/1";

/// One render measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Name of the configuration.
    pub config: String,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Camera samples per pixel.
    pub spp: u32,
    /// Seconds of sampling.
    pub seconds: f64,
    /// Loading, preparing (tree included) and sampling: what a process that does this alone spends before it writes files.
    pub process_seconds: f64,
    /// The errors.
    #[serde(flatten)]
    pub error: PictureError,
    /// What the render itself, without a reference, says of its relMSE (an upper bound unless in halves).
    pub estimated_relmse: Option<f64>,
}

impl Run {
    /// The unbiased relMSE where there is one, else the plain one.
    pub fn best_error(&self) -> f64 {
        self.error.relmse_unbiased.unwrap_or(self.error.relmse)
    }
}

/// What errors are measured against.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFacts {
    /// Its file; absent for one that was rendered for the purpose.
    pub file: Option<String>,
    /// Samples per pixel of one that was rendered for the purpose.
    pub spp: Option<u32>,
    /// The relMSE that it is expected to have itself: every plain relMSE holds about so much on top.
    pub noise_floor: Option<f64>,
}

/// The runs of one configuration at one number of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Camera samples per pixel.
    pub spp: u32,
    /// Seconds of sampling.
    pub seconds: Middle,
    /// The error that slopes and crossings are taken from.
    pub error: Middle,
}

/// One configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConfigSummary {
    /// Its name.
    pub config: String,
    /// By rising samples.
    pub points: Vec<Point>,
    /// Of log error on log spp, over seeds.
    pub slope: Option<Estimate>,
    /// Median seconds to an error, by the error as it was asked for; null where not every seed crosses it.
    pub seconds_to: BTreeMap<String, Option<Middle>>,
    /// Why not, by the error: "reached before the first point", "not reached".
    pub seconds_to_notes: BTreeMap<String, String>,
}

/// One configuration against the first, seed by seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// The configuration.
    pub config: String,
    /// The first.
    pub to: String,
    /// Error at equal samples, config / first, by spp: the geometric mean over seeds.
    pub error: BTreeMap<u32, Estimate>,
    /// Seconds to an error, config / first: below 1 it is faster.
    pub seconds_to: BTreeMap<String, Option<Estimate>>,
}

/// Speed against error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ErrorReport {
    /// [`SCHEMA`].
    pub schema: String,
    /// Program and version.
    pub generator: String,
    /// Name of the scene.
    pub scene: String,
    /// The words that were typed.
    pub command: Vec<String>,
    /// Width and height.
    pub resolution: [u32; 2],
    /// Worker threads.
    pub threads: u32,
    /// What errors are measured against.
    pub reference: ReferenceFacts,
    /// Every render, in the order of time.
    pub runs: Vec<Run>,
    /// The slope of the first configuration.
    pub slope: Option<f64>,
    /// Its 95 % interval.
    pub slope_ci95: Option<[f64; 2]>,
    /// Median seconds of the first configuration to each error asked for; null where it is not crossed.
    pub seconds_to: BTreeMap<String, Option<f64>>,
    /// All configurations, in the order they were named.
    pub configs: Vec<ConfigSummary>,
    /// All but the first against the first.
    pub ratios: Vec<Ratio>,
    /// What to know when reading the figures.
    pub notes: Vec<String>,
}

/// Geometric mean of ratios.
fn geometric(ratios: &[f64]) -> Option<Estimate> {
    let logs: Vec<f64> = ratios.iter().map(|r| libm::log(*r)).collect();
    mean_with_interval(&logs)
        .map(|e| Estimate { value: libm::exp(e.value), ci95: e.ci95.map(|ci| ci.map(libm::exp)) })
}

impl ErrorReport {
    /// Derives slope, crossings and ratios from the runs. `configs`: their names in order; `targets`: errors as they were
    /// written, and their values.
    pub fn summarise(&mut self, configs: &[String], targets: &[(String, f64)]) {
        self.configs = configs.iter().map(|config| self.summary(config, targets)).collect();
        let first = self.configs.first();
        self.slope = first.and_then(|c| c.slope).map(|s| s.value);
        self.slope_ci95 = first.and_then(|c| c.slope).and_then(|s| s.ci95);
        self.seconds_to = first.map_or_else(BTreeMap::new, |c| {
            c.seconds_to.iter().map(|(target, middle)| (target.clone(), middle.map(|m| m.value))).collect()
        });
        self.ratios = configs.iter().skip(1).map(|config| self.ratio(config, &configs[0], targets)).collect();
    }

    /// (seed → (spp, seconds, error) by rising spp) of a configuration.
    fn by_seed(&self, config: &str) -> BTreeMap<u64, Vec<(u32, f64, f64)>> {
        let mut seeds: BTreeMap<u64, Vec<_>> = BTreeMap::new();
        for run in self.runs.iter().filter(|run| run.config == config) {
            seeds.entry(run.seed).or_default().push((run.spp, run.seconds, run.best_error()));
        }
        for runs in seeds.values_mut() {
            runs.sort_by_key(|run| run.0);
        }
        seeds
    }

    fn summary(&self, config: &str, targets: &[(String, f64)]) -> ConfigSummary {
        let seeds = self.by_seed(config);
        let mut by_spp: BTreeMap<u32, (Vec<f64>, Vec<f64>)> = BTreeMap::new();
        for (spp, seconds, error) in seeds.values().flatten() {
            let entry = by_spp.entry(*spp).or_default();
            entry.0.push(*seconds);
            entry.1.push(*error);
        }
        let points = by_spp
            .into_iter()
            .filter_map(|(spp, (seconds, errors))| {
                Some(Point {
                    spp,
                    seconds: median_with_interval(&seconds)?,
                    error: median_with_interval(&errors)?,
                })
            })
            .collect();
        let slopes: Vec<f64> = seeds
            .values()
            .filter_map(|runs| slope(&runs.iter().map(|r| (f64::from(r.0), r.2)).collect::<Vec<_>>()))
            .collect();
        let mut summary = ConfigSummary {
            config: config.to_owned(),
            points,
            slope: mean_with_interval(&slopes),
            seconds_to: BTreeMap::new(),
            seconds_to_notes: BTreeMap::new(),
        };
        for (name, target) in targets {
            let crossings: Vec<Crossing> = seeds.values().map(|runs| crossing(runs, *target)).collect();
            let at: Vec<f64> = crossings
                .iter()
                .filter_map(|c| if let Crossing::At(seconds) = c { Some(*seconds) } else { None })
                .collect();
            let all = at.len() == crossings.len();
            summary.seconds_to.insert(name.clone(), median_with_interval(&at).filter(|_| all));
            if !all {
                let early = crossings.contains(&Crossing::Before);
                let note = if early { "reached before the first point" } else { "not reached" };
                summary.seconds_to_notes.insert(name.clone(), note.to_owned());
            }
        }
        summary
    }

    fn ratio(&self, config: &str, first: &str, targets: &[(String, f64)]) -> Ratio {
        let (ours, theirs) = (self.by_seed(config), self.by_seed(first));
        let mut errors: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        for (seed, runs) in &ours {
            let Some(others) = theirs.get(seed) else { continue };
            for (a, b) in runs.iter().zip(others).filter(|(a, b)| a.0 == b.0 && a.2 > 0.0 && b.2 > 0.0) {
                errors.entry(a.0).or_default().push(a.2 / b.2);
            }
        }
        let seconds_to = targets
            .iter()
            .map(|(name, target)| {
                let ratios: Vec<f64> = ours
                    .iter()
                    .filter_map(|(seed, runs)| {
                        match (crossing(runs, *target), crossing(theirs.get(seed)?, *target)) {
                            (Crossing::At(a), Crossing::At(b)) => Some(a / b),
                            _ => None,
                        }
                    })
                    .collect();
                (name.clone(), geometric(&ratios).filter(|_| ratios.len() == ours.len()))
            })
            .collect();
        Ratio {
            config: config.to_owned(),
            to: first.to_owned(),
            error: errors.into_iter().filter_map(|(spp, r)| Some((spp, geometric(&r)?))).collect(),
            seconds_to,
        }
    }

    /// As indented JSON with a newline at its end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// The runs as comma-separated values with a heading; empty cells where a value is unknown.
    pub fn to_csv(&self) -> String {
        let mut out = String::from(
            "config,seed,spp,seconds,process_seconds,relmse,relmse_trimmed,relmse_unbiased,rmse,flip,mean_ratio_r,\
             mean_ratio_g,mean_ratio_b,estimated_relmse\n",
        );
        let cell = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:e}"));
        for run in &self.runs {
            let e = &run.error;
            let numbers = [
                Some(run.seconds),
                Some(run.process_seconds),
                Some(e.relmse),
                Some(e.relmse_trimmed),
                e.relmse_unbiased,
                Some(e.rmse),
                e.flip,
                e.mean_ratio[0],
                e.mean_ratio[1],
                e.mean_ratio[2],
                run.estimated_relmse,
            ];
            let cells: Vec<String> = numbers.into_iter().map(cell).collect();
            let _ = writeln!(
                out,
                "\"{}\",{},{},{}",
                run.config.replace('"', "\"\""),
                run.seed,
                run.spp,
                cells.join(",")
            );
        }
        out
    }
}

fn crossing(runs: &[(u32, f64, f64)], target: f64) -> Crossing {
    seconds_to(&runs.iter().map(|r| (r.1, r.2)).collect::<Vec<_>>(), target)
}
