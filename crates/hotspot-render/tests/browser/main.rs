//! The pages in a real browser: a script plays the reader (hover, sliders, keys, clicks) and writes down what changed.
//!
//! Needs Chromium or Chrome (`CHROMIUM=/path/to/it`, or on the PATH); skips visibly without.
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Collects what goes wrong on the page; stands before its first script.
const WATCH: &str = include_str!("watch.js");
/// What both players share.
const PLAY: &str = include_str!("play.js");

fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    let known = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    named.into_iter().chain(known.map(PathBuf::from)).find(|program| {
        Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
    })
}

/// Runs a page with a player's script at the given window size; the names of the checks that failed and the errors seen.
fn play(browser: &Path, page: &Path, script: &str, (width, height): (u32, u32)) -> (usize, Vec<String>) {
    let text = std::fs::read_to_string(page).unwrap();
    let text = text.replacen("<head>", &format!("<head><script>{WATCH}</script>"), 1);
    let text = text.replacen("</body>", &format!("<script>{PLAY}\n{script}</script></body>"), 1);
    let folder = tempfile::tempdir().unwrap();
    let played = folder.path().join("played.html");
    std::fs::write(&played, text).unwrap();
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", "--virtual-time-budget=60000"])
        .arg(format!("--window-size={width},{height}"))
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", played.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let start = dom
        .find("<pre id=\"played\">")
        .unwrap_or_else(|| panic!("the player did not finish; {}", String::from_utf8_lossy(&output.stderr)))
        + 17;
    let end = start + dom[start..].find("</pre>").unwrap();
    let said = dom[start..end].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let said: serde_json::Value = serde_json::from_str(&said).unwrap();
    let checks = said["checks"].as_array().unwrap();
    let failed = checks.iter().filter(|c| c[1] != true).map(|c| c[0].to_string());
    let errors = said["errors"].as_array().unwrap().iter().map(|e| format!("error: {e}"));
    (checks.len(), failed.chain(errors).collect())
}

fn run(words: &[&str], folder: &Path) {
    let output = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args(words)
        .args(["--quiet", "-o"])
        .arg(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn scene(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    root.join(name).join(format!("{name}.gltf")).to_string_lossy().into_owned()
}

#[test]
fn the_pages_work_in_a_browser() {
    let Some(browser) = browser() else {
        eprintln!("SKIPPED: no Chromium or Chrome found; install one or set CHROMIUM");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str| {
        let out = folder.path().join(name);
        run(&[&scene(name), "--size", "160x90", "--spp", "16", "--intervals", "--layers", "aov"], &out);
        out
    };
    let (wide, narrow) = (render("mirror-gap-wide"), render("mirror-gap-narrow"));
    let exr = |out: &Path, name: &str| out.join(format!("{name}.exr")).to_string_lossy().into_owned();
    run(&["compare", &exr(&wide, "mirror-gap-wide"), &exr(&narrow, "mirror-gap-narrow")], folder.path());
    // What a change does has the same page; the file's own names, without layers for them.
    let wide_scene = scene("mirror-gap-wide");
    let change = ["--max-depth", "3", "--size", "96x54", "--spp", "4", "--repeats", "0", "--tree-noise", "0"];
    run(&[&["whatif", &wide_scene][..], &change[..]].concat(), folder.path());
    // An EXR alone is enough for names.
    run(&["report", &exr(&wide, "mirror-gap-wide")], &folder.path().join("report"));

    let pages = [
        (wide.join("mirror-gap-wide.html"), include_str!("render.js"), 20),
        (folder.path().join("report").join("mirror-gap-wide.html"), include_str!("render.js"), 20),
        (folder.path().join("compare.html"), include_str!("compare.js"), 15),
        (folder.path().join("mirror-gap-wide.whatif.html"), include_str!("compare.js"), 15),
    ];
    for (page, script, least) in pages {
        for size in [(1280, 720), (390, 844)] {
            let (checks, failed) = play(&browser, &page, script, size);
            assert!(failed.is_empty(), "{} at {size:?}: {failed:#?}", page.display());
            assert!(checks >= least, "{} at {size:?}: only {checks} checks ran", page.display());
        }
    }
}
