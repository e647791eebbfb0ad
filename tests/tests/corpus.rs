//! The program that tries models of others: its table and its exit code.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn corpus(path: &Path) -> (Output, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_corpus")).arg(path).output().expect("corpus runs");
    let table = String::from_utf8(output.stdout.clone()).expect("the table is text");
    (output, table)
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nbogus\nl 1 2\nf 1 2 3\n";

#[test]
fn models_that_load_are_measured_and_those_that_must_load_are_demanded() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = folder.path().join("some/sub");
    fs::create_dir_all(&good).expect("a folder");
    fs::write(good.join("A.OBJ"), TRIANGLE).expect("a file");
    fs::write(good.join("notes.txt"), "no model").expect("a file");
    let (output, table) = corpus(folder.path());
    assert!(output.status.success(), "{table}");
    let row = table.lines().find(|line| line.contains("A.OBJ")).expect("a row for the model");
    let cells: Vec<&str> = row.split('|').map(str::trim).collect();
    assert_eq!(cells[2..5], ["1", "0", "0"], "{row}");
    let luminance: f64 = cells[6].parse().expect("a number");
    assert!(luminance > 0.5 && luminance < 1.0, "{row}");
    assert!(cells[7] == "lines (1)" && cells[8].contains("unknown statements skipped (1)"), "{row}");

    fs::write(good.join("broken.obj"), "v 0 0 0\nf 1 2 3\n").expect("a file");
    let (output, table) = corpus(folder.path());
    assert_eq!(output.status.code(), Some(1), "{table}");
    assert!(table.contains("2 files: 1 shown, 1 refused") && table.contains("FAILURES: 1"), "{table}");
}

#[test]
fn models_that_packages_excuse_may_be_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, code) in [("assimp-testmodels/invalid/malformed.obj", 0), ("other/invalid/malformed.obj", 1)] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(&path, "v 0 0 0\nf 0 0 0\n").expect("a file");
        let (output, table) = corpus(&path);
        assert_eq!(output.status.code(), Some(code), "{table}");
        assert!(table.contains("broken on purpose") == (code == 0), "{table}");
    }
    // Nothing to try is a mistake.
    assert_eq!(corpus(&folder.path().join("missing")).0.status.code(), Some(2));
}
