//! Tests of the figures of speed against error.

use super::*;
use crate::picture_error::PictureError;

fn run(config: &str, seed: u64, spp: u32, seconds: f64, error: f64) -> Run {
    Run {
        config: config.into(),
        seed,
        spp,
        seconds,
        process_seconds: seconds + 1.0,
        error: PictureError {
            relmse: error + 0.5,
            relmse_trimmed: error,
            relmse_unbiased: Some(error),
            rmse: 0.1,
            flip: None,
            mean_ratio: [Some(1.0), None, Some(0.9)],
        },
        estimated_relmse: Some(error),
    }
}

fn names(words: &[&str]) -> Vec<String> {
    words.iter().map(|w| (*w).to_owned()).collect()
}

/// Two configurations that follow a law exactly: error = c/spp, seconds = t·spp.
fn lawful() -> ErrorReport {
    let mut report = ErrorReport::default();
    for seed in 0..5 {
        let luck = 1.0 + 0.1 * seed as f64;
        for spp in [1, 4, 16, 64] {
            let n = f64::from(spp);
            report.runs.push(run("a", seed, spp, 0.5 * n, luck / n));
            report.runs.push(run("b", seed, spp, n, luck / (4.0 * n)));
        }
    }
    report
        .summarise(&names(&["a", "b"]), &[("1e-1".into(), 0.1), ("1e-9".into(), 1e-9), ("10".into(), 10.0)]);
    report
}

#[test]
fn what_follows_a_law_is_found() {
    let report = lawful();
    assert!((report.slope.unwrap() + 1.0).abs() < 1e-12);
    let a = &report.configs[0];
    assert_eq!((a.points.len(), a.points[2].spp), (4, 16));
    // The median seed has luck 1.2: 0.1 is reached at 12 samples, 6 seconds.
    let middle = a.seconds_to["1e-1"].unwrap();
    assert!((middle.value - 6.0).abs() < 1e-9, "{middle:?}");
    assert!((middle.interval[0] - 5.0).abs() < 1e-9 && (middle.interval[1] - 7.0).abs() < 1e-9);
    assert_eq!(report.seconds_to["1e-9"], None);
    assert_eq!(a.seconds_to_notes["1e-9"], "not reached");
    assert_eq!(a.seconds_to_notes["10"], "reached before the first point");
    let ratio = &report.ratios[0];
    assert!((ratio.error[&16].value - 0.25).abs() < 1e-12);
    // b needs a quarter of the samples at twice the time each.
    let seconds = ratio.seconds_to["1e-1"].unwrap();
    assert!((seconds.value - 0.5).abs() < 1e-9 && seconds.ci95.unwrap()[1] < 0.5001, "{seconds:?}");
}

#[test]
fn medians_have_the_coverage_of_order_statistics() {
    assert_eq!(median_with_interval(&[]), None);
    let one = median_with_interval(&[3.0]).unwrap();
    assert_eq!((one.value, one.interval, one.coverage), (3.0, [3.0, 3.0], 0.0));
    let five = median_with_interval(&[5.0, 1.0, 4.0, 2.0, 3.0]).unwrap();
    assert_eq!((five.value, five.interval, five.coverage), (3.0, [1.0, 5.0], 0.9375));
    let twelve: Vec<f64> = (1..=12).map(f64::from).collect();
    let twelve = median_with_interval(&twelve).unwrap();
    // Tables of the binomial distribution: the third of twelve, 0.9614.
    assert_eq!((twelve.value, twelve.interval), (6.5, [3.0, 10.0]));
    assert!((twelve.coverage - 0.961_425_78).abs() < 1e-8);
}

#[test]
fn means_have_students_interval() {
    assert_eq!(mean_with_interval(&[]), None);
    assert_eq!(mean_with_interval(&[2.0]).unwrap().ci95, None);
    let e = mean_with_interval(&[1.0, 2.0, 3.0]).unwrap();
    // t(0.975, 2) = 4.302653, s = 1.
    assert!((e.ci95.unwrap()[1] - (2.0 + 4.302_653 / 3.0_f64.sqrt())).abs() < 1e-5);
}

#[test]
fn slopes_and_crossings_take_what_is_there() {
    assert_eq!(slope(&[(1.0, 1.0)]), None);
    assert_eq!(slope(&[(1.0, 1.0), (1.0, 2.0)]), None);
    assert!((slope(&[(1.0, 1.0), (2.0, 0.25), (4.0, -1.0)]).unwrap() + 2.0).abs() < 1e-12);
    assert_eq!(seconds_to(&[], 1.0), Crossing::Never);
    assert_eq!(seconds_to(&[(1.0, 0.5)], 1.0), Crossing::Before);
    // An error that bounces back counts as reached when it first was.
    assert_eq!(seconds_to(&[(1.0, 4.0), (2.0, 1.0), (4.0, 2.0)], 1.0), Crossing::At(2.0));
    assert_eq!(seconds_to(&[(1.0, 4.0), (2.0, -1.0)], 1.0), Crossing::At(2.0));
}

#[test]
fn tables_and_json_hold_the_runs() {
    let report = lawful();
    let csv = report.to_csv();
    assert_eq!(csv.lines().count(), 41);
    assert_eq!(
        csv.lines().nth(1).unwrap().split(',').count(),
        csv.lines().next().unwrap().split(',').count()
    );
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).unwrap();
    let schema: serde_json::Value = serde_json::from_str(JSON_SCHEMA).unwrap();
    // Every key that is written is in the schema, and the other way round.
    let keys = |v: &serde_json::Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&json), keys(&schema["properties"]));
    assert_eq!(keys(&json["runs"][0]), keys(&schema["$defs"]["run"]["properties"]));
    assert_eq!(keys(&json["configs"][0]), keys(&schema["$defs"]["config"]["properties"]));
    assert!(json["runs"][0]["flip"].is_null() && json["seconds_to"]["1e-9"].is_null());
    assert_eq!(serde_json::from_value::<ErrorReport>(json).unwrap(), report);
}
