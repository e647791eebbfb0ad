//! `--target-error` and `--time-limit`, as a process.

use std::path::Path;
use std::process::{Command, Output};

fn run(folder: &Path, words: &[&str]) -> (Output, serde_json::Value) {
    let root =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box-red/cornell-box-red.gltf");
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .arg(root)
        .args(["--size", "32x32", "-o"])
        .arg(folder)
        .args(words)
        .output()
        .unwrap();
    let json = std::fs::read_to_string(folder.join("cornell-box-red.json")).unwrap_or_else(|_| "null".into());
    (output, serde_json::from_str(&json).unwrap())
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn it_stops_where_the_estimate_says_at_any_thread_count() {
    let folder = tempfile::tempdir().unwrap();
    for more in [&[][..], &["--intervals"]] {
        let mut digests = Vec::new();
        for threads in ["1", "2"] {
            let words = [&["--target-error", "2e-2", "--threads", threads], more].concat();
            let (output, json) = run(folder.path(), &words);
            assert!(output.status.success() && said(&output).contains(" reached:"), "{}", said(&output));
            assert!(json["estimated_relmse"].as_f64().unwrap() <= 2e-2);
            let samples = json["samples_per_pixel"].as_u64().unwrap();
            assert!((8..4096).contains(&samples), "{samples}");
            assert_eq!(json["render"]["stopped"], "target_error");
            digests.push((samples, json["digest"].clone()));
        }
        assert_eq!(digests[0], digests[1]);
    }
}

#[test]
fn samples_and_seconds_are_the_most() {
    let folder = tempfile::tempdir().unwrap();
    let (output, json) = run(folder.path(), &["--target-error", "1e-9", "--spp", "12"]);
    assert!(output.status.success() && said(&output).contains("not reached"), "{}", said(&output));
    assert_eq!(json["samples_per_pixel"], 12);
    assert_eq!(json["render"]["stopped"], "samples");
    let (output, json) = run(folder.path(), &["--target-error", "1e-9", "--time-limit", "0.2"]);
    assert!(
        output.status.success() && said(&output).contains("stopped by --time-limit"),
        "{}",
        said(&output)
    );
    assert!(json["samples_per_pixel"].as_u64().unwrap() >= 1);
    assert_eq!(json["render"]["stopped"], "time_limit");
    // One sample tells nothing of its error, and that is said.
    let (output, json) = run(folder.path(), &["--target-error", "1e-2", "--spp", "1"]);
    assert!(
        output.status.success() && said(&output).contains("the error cannot be told"),
        "{}",
        said(&output)
    );
    assert!(json["estimated_relmse"].is_null());
    assert!(folder.path().join("cornell-box-red.cost.rays.png").exists());
}

#[test]
fn bad_targets_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for words in [["--target-error=0"], ["--target-error=-1"], ["--target-error=nan"], ["--target-error=x"]] {
        let (output, json) = run(folder.path(), &words);
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert!(said(&output).contains("1e-3") && json.is_null());
    }
}

/// Progress towards a target is not measured by the most samples: once the first estimate is there, the share done is well above
/// what it is of 65536 samples, and the time left is unknown before.
#[test]
fn progress_goes_by_the_target() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["--target-error", "2e-4", "--json-progress", "--metrics", "none"];
    let (output, json) = run(folder.path(), &words);
    assert!(output.status.success(), "{}", said(&output));
    let lines: Vec<serde_json::Value> =
        said(&output).lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let samples = json["samples_per_pixel"].as_f64().unwrap();
    // A fast machine may be done before a line is due.
    for line in &lines {
        if line["seconds_left"].is_null() {
            assert_eq!(line["progress"], 0.0, "{line}");
        } else if line.get("estimated_relmse").is_some() {
            assert!(line["progress"].as_f64().unwrap() > 4.0 * 8.0 / 65536.0, "{line} of {samples} samples");
        }
    }
}
