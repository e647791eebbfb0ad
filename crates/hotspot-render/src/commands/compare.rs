//! `compare`: what changed in cost from one render to another.

use super::report::document;
use crate::args::{CompareArgs, nearest};
use crate::fail::{FAILED, Fail, GATE};
use crate::output::{Writer, stem};
use hotspot_cost::compare::{Comparison, Gate, GateError, GateOutcome, Needed};
use hotspot_cost::exr_io::{self, Limits};
use hotspot_cost::{Metric, Side, compare};

pub(crate) fn run(args: &CompareArgs) -> Result<(), Fail> {
    let gates = args
        .fail_over
        .iter()
        .map(|text| Gate::parse(text).map_err(|error| unreadable(&error)))
        .collect::<Result<Vec<_>, _>>()?;
    let read = |path: &std::path::Path| -> Result<_, Fail> {
        let file = exr_io::read(path, &Limits::default())?;
        let document = document(&file, &path.display().to_string())?;
        Ok((file, document))
    };
    let (a, document_a) = read(&args.a)?;
    let (b, document_b) = read(&args.b)?;
    let (name_a, name_b) = names(&stem(&args.a), &stem(&args.b));
    let side_a = Side { name: &name_a, layers: &a.layers, document: Some(&document_a) };
    let side_b = Side { name: &name_b, layers: &b.layers, document: Some(&document_b) };
    let mut comparison = compare(side_a, side_b, args.force)?;
    let results: Vec<_> = gates.iter().map(|gate| comparison.gate(gate)).collect();
    comparison.gates.clone_from(&results);

    let mut writer = Writer::new(&args.output, &args.views)?;
    // Of A, else of B: where an object moved they differ.
    let seen = [&a, &b].map(|file| crate::seen::of_file(file, &[], &[]));
    writer.shows(seen.into_iter().find(|names| !names[0].ids.is_empty()).unwrap_or_default());
    let page = writer.comparison(&side_a, &side_b, &comparison)?;
    if !args.quiet {
        for file in &page.files {
            crate::say::out!("wrote {file}");
        }
        for note in &comparison.notes {
            crate::say::out!("note: {note}");
        }
        print_totals(&comparison);
        print_power(&comparison, &gates, document_a.samples_per_pixel.min(document_b.samples_per_pixel));
        crate::say::out!("→ open {}", page.page.display());
    }
    let reasons = |outcome: GateOutcome| -> Vec<&str> {
        results.iter().filter(|r| r.outcome == outcome).map(|r| r.reason.as_str()).collect()
    };
    let (tripped, undecided) = (reasons(GateOutcome::Tripped), reasons(GateOutcome::Undecided));
    if !tripped.is_empty() {
        return Err(Fail::new(GATE, format!("gate tripped: {}", tripped.join("; "))));
    }
    // A gate that cannot decide must not pass silently, nor claim that the cost grew.
    if !undecided.is_empty() {
        return Err(Fail::new(FAILED, format!("gate undecided: {}", undecided.join("; "))));
    }
    Ok(())
}

fn unreadable(error: &GateError) -> Fail {
    let near = match error {
        GateError::Metric(name) => nearest(name, Metric::ALL.map(Metric::name)),
        GateError::Form(_) => None,
    };
    let hint = near.map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
    Fail::usage(format!("--fail-over: {error}{hint}"))
}

/// Stems, told apart when they are the same.
fn names(a: &str, b: &str) -> (String, String) {
    if a == b { (format!("{a} (A)"), format!("{b} (B)")) } else { (a.to_owned(), b.to_owned()) }
}

fn print_totals(comparison: &Comparison) {
    for metric in [Metric::Rays, Metric::Nodes, Metric::Shapes, Metric::Intersection, Metric::TimeUs] {
        let Some(change) = comparison.totals.get(metric.name()) else { continue };
        let Some(relative) = change.relative else { continue };
        if change.delta == 0.0 {
            crate::say::out!("{:<13} {:>10.3} per path: exactly the same", metric.name(), change.a);
            continue;
        }
        let without = match metric {
            Metric::TimeUs => "one run each: no test; whatif takes turns",
            _ => "no interval",
        };
        let interval = change.ci95.map_or(without.to_owned(), |[lo, hi]| {
            format!("95 % interval {:+.2} % to {:+.2} %", lo * 100.0, hi * 100.0)
        });
        let verdict = match change.significant {
            Some(true) => ", significant",
            Some(false) => ", not significant",
            None => "",
        };
        crate::say::out!(
            "{:<13} {:>10.3} -> {:>10.3} per path  {:+.2} % ({interval}{verdict})",
            metric.name(),
            change.a,
            change.b,
            relative * 100.0
        );
    }
}

/// What changes these renders could have shown: those that gates ask for, or 2 %.
fn print_power(comparison: &Comparison, gates: &[Gate], samples_per_pixel: u64) {
    let asked = gates.iter().filter(|gate| gate.limit > 0.0).map(|gate| (gate.metric, gate.limit));
    let mut asked: Vec<(Metric, f64)> = asked.collect();
    if asked.is_empty() {
        asked.push((Metric::Intersection, 0.02));
    }
    for (metric, limit) in asked {
        let unclear = comparison
            .totals
            .get(metric.name())
            .is_some_and(|c| c.significant == Some(false) && c.delta != 0.0);
        let Some(needed) = comparison.samples_to_find(metric, limit).filter(|_| unclear) else { continue };
        let change = format!("a change of {} % of {}", 100.0 * limit, metric.name());
        match needed {
            Needed::Times(times) => {
                let samples = (times * samples_per_pixel as f64).ceil().max(2.0);
                crate::say::out!(
                    "{change} would be found in 80 % of runs from about {samples:.0} samples per pixel on (these have \
                     {samples_per_pixel})"
                );
            }
            Needed::TreeNoise => {
                crate::say::out!("{change} would be hidden by tree noise, however many samples are taken");
            }
        }
    }
}
