//! The program as its user meets it: files, words and exit codes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hotspot-render")).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs and expects an exit code; returns standard output and standard error.
fn expect(code: i32, arguments: &[&str]) -> (String, String) {
    let output = run(arguments);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{out}\n{err}");
    (out, err)
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../scenes/{name}/{name}.gltf"));
    path.to_str().expect("a path in UTF-8").to_owned()
}

fn json(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}

/// A small render of the red or blue Cornell box into `folder`; returns the EXR.
fn cornell(folder: &Path, color: &str, more: &[&str]) -> PathBuf {
    let scene = scene(&format!("cornell-box-{color}"));
    let out = folder.to_str().expect("UTF-8");
    let mut arguments = vec![scene.as_str(), "--size", "32x32", "--spp", "8", "-o", out, "-q"];
    arguments.extend(more);
    expect(0, &arguments);
    folder.join(format!("cornell-box-{color}.exr"))
}

#[test]
fn the_demo_renders_and_says_where_the_cost_is() {
    let dir = folder();
    let out = dir.path().to_str().expect("UTF-8");
    let (said, _) = expect(0, &["--demo", "--size", "48x27", "--spp", "2", "-o", out]);
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("Costliest: ") && last.ends_with("demo.html"), "{last}");
    for suffix in ["exr", "json", "html", "png", "cost.rays.png", "cost.intersection.png", "cost.time_us.png"]
    {
        let file = dir.path().join(format!("demo.{suffix}"));
        let size = std::fs::metadata(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).len();
        assert!(size > 100, "{}: {size} bytes", file.display());
        assert!(said.contains(&format!("demo.{suffix}: ")), "{suffix} is not announced in {said}");
    }
    let document = json(&dir.path().join("demo.json"));
    assert_eq!(document["samples_per_pixel"], 2);
    assert_eq!(document["totals"]["cause.escaped"]["sum"].as_u64().map(|n| n <= 48 * 27 * 2), Some(true));
}

#[test]
fn threads_and_instruction_sets_give_the_same_digests() {
    let dir = folder();
    let digest = |more: &[&str]| {
        cornell(dir.path(), "red", more);
        json(&dir.path().join("cornell-box-red.json"))["digest"].clone()
    };
    let first = digest(&["--threads", "1"]);
    assert!(first["radiance"].is_string() && first["counters"].is_string());
    assert_eq!(first, digest(&["--threads", "3", "--isa", "portable"]));
    // Without counters: the same picture.
    assert_eq!(first["radiance"], digest(&["--metrics", "none"])["radiance"]);
    assert_eq!(first["radiance"], digest(&["--cost-spp", "3"])["radiance"]);
    assert_ne!(first["radiance"], digest(&["--seed", "1"])["radiance"]);
}

/// What is learned before the first sample does not depend on the machine either, and is told in the settings.
#[test]
fn what_is_learned_gives_the_same_digests() {
    let dir = folder();
    let out = dir.path().to_str().expect("UTF-8");
    for name in ["cornell-box-red", "white-room-matte"] {
        let scene = scene(name);
        let document = |more: &[&str]| {
            let mut arguments = vec![scene.as_str(), "--size", "16x16", "--spp", "2", "-o", out, "-q"];
            arguments.extend(more);
            expect(0, &arguments);
            json(&dir.path().join(format!("{name}.json")))
        };
        let plain = document(&[]);
        let learned = ["--roulette", "efficient", "--lights", "learned"];
        let one = document(&[&learned[..], &["--threads", "1"]].concat());
        let other = document(&[&learned[..], &["--threads", "3", "--isa", "portable"]].concat());
        assert_eq!(one["digest"], other["digest"], "{name}");
        assert_ne!(one["digest"], plain["digest"], "{name}");
        assert_eq!([&one["settings"]["roulette"], &one["settings"]["lights"]], ["efficient", "learned"]);
    }
    expect(2, &["--demo", "--roulette", "eficient", "-o", out]);
}

#[test]
fn compare_finds_what_changed_and_gates() {
    let dir = folder();
    let a = cornell(dir.path(), "red", &["--intervals"]);
    let b = cornell(dir.path(), "blue", &["--intervals"]);
    let (a, b) = (a.to_str().expect("UTF-8"), b.to_str().expect("UTF-8"));
    let out = dir.path().join("compare");
    let out = out.to_str().expect("UTF-8");
    expect(0, &["compare", a, b, "-o", out, "--fail-over", "nodes=2%"]);
    let comparison = json(&dir.path().join("compare/compare.json"));
    let rays = &comparison["totals"]["rays"];
    assert!(rays["delta"].as_f64().is_some_and(|d| d < 0.0), "{rays}");
    assert!(rays["ci95"].is_array(), "{rays}");
    // Against itself nothing is significant, and no gate trips.
    let (said, _) = expect(0, &["compare", a, a, "-o", out, "--fail-over", "nodes=0%"]);
    assert!(said.contains("per path: exactly the same"), "{said}");
    // The other way round it grew, by more than nothing.
    let (_, err) = expect(3, &["compare", b, a, "-o", out, "--fail-over", "nodes=0%"]);
    assert!(err.contains("gate tripped") && err.contains("nodes"), "{err}");
    let (_, err) = expect(2, &["compare", a, b, "-o", out, "--fail-over", "nods=1%"]);
    assert!(err.contains("nods") && err.contains("did you mean \"nodes\"?"), "{err}");
}

#[test]
fn report_works_from_the_exr_alone() {
    let dir = folder();
    let exr = cornell(dir.path(), "red", &[]);
    let out = dir.path().join("again");
    expect(0, &["report", exr.to_str().expect("UTF-8"), "-o", out.to_str().expect("UTF-8"), "--maps", "all"]);
    assert!(out.join("cornell-box-red.html").exists() && out.join("cornell-box-red.cost.nodes.png").exists());
    let again = json(&out.join("cornell-box-red.json"));
    let first = json(&dir.path().join("cornell-box-red.json"));
    assert_eq!(again["totals"], first["totals"]);
}

#[test]
fn metrics_choose_what_is_kept() {
    let dir = folder();
    cornell(dir.path(), "red", &["--metrics", "rays", "--no-radiance"]);
    let document = json(&dir.path().join("cornell-box-red.json"));
    let totals: Vec<&String> = document["totals"].as_object().expect("an object").keys().collect();
    assert_eq!(totals, ["rays", "rays_shadow"]);
    assert!(!dir.path().join("cornell-box-red.png").exists());
    // The shortcut counts the same rays as the full pass.
    let shortcut = document["totals"]["rays"]["sum"].clone();
    cornell(dir.path(), "red", &[]);
    let full = json(&dir.path().join("cornell-box-red.json"));
    assert_eq!(shortcut, full["totals"]["rays"]["sum"]);
    let scene = scene("cornell-box-red");
    let (_, err) = expect(2, &[&scene, "--metrics", "rais"]);
    assert!(err.contains("did you mean \"rays\""), "{err}");
}

#[test]
fn wrong_usage_is_answered_with_code_2() {
    let scene = scene("cornell-box-red");
    for (arguments, words) in [
        (vec!["comapre", "a.exr", "b.exr"], "did you mean \"compare\""),
        (vec![&scene, "--spp", "0"], "--spp"),
        (vec![&scene, "--size", "0x5"], "--size"),
        (vec![&scene, "--camera", "Kamera"], "did you mean"),
        (vec![&scene, "--camera", "#7"], "no such camera"),
        (vec![&scene, "--no-radiance", "--metrics", "none"], "nothing to do"),
        (vec![&scene, "--intervals", "--spp", "1"], "two samples"),
        (vec![&scene, "--size", "60000x60000"], "--max-memory"),
        (vec!["--demo", &scene], "cannot be used"),
    ] {
        let (_, err) = expect(2, &arguments);
        assert!(err.contains(words), "{arguments:?}: {err}");
    }
}

#[test]
fn bad_files_are_named_and_leave_nothing_behind() {
    let dir = folder();
    let out = dir.path().join("out");
    let out = out.to_str().expect("UTF-8");
    let broken = dir.path().join("broken.glb");
    std::fs::write(&broken, b"glTF\x02\0\0\0\xff\xff\xff\xff").expect("writable");
    for (command, file) in [("render", "missing.gltf"), ("render", "broken.glb"), ("report", "broken.glb")] {
        let path = dir.path().join(file);
        let (_, err) = expect(1, &[command, path.to_str().expect("UTF-8"), "-o", out]);
        assert!(err.contains(file), "{err}");
        let left = std::fs::read_dir(out).map_or(0, Iterator::count);
        assert_eq!(left, 0, "files were left after {err}");
    }
    // The output folder cannot be made below a file.
    let below = broken.join("sub");
    let (_, err) = expect(1, &["--demo", "-o", below.to_str().expect("UTF-8")]);
    assert!(err.contains("broken.glb"), "{err}");
}

#[test]
fn a_time_limit_keeps_what_was_done() {
    let dir = folder();
    let out = dir.path().to_str().expect("UTF-8");
    let scene = scene("cornell-box-red");
    let (said, _) =
        expect(0, &[&scene, "--size", "64x64", "--spp", "1000000", "--time-limit", "0.3", "-o", out]);
    assert!(said.contains("stopped by --time-limit"), "{said}");
    let document = json(&dir.path().join("cornell-box-red.json"));
    let samples = document["samples_per_pixel"].as_u64().expect("a count");
    assert!((1..1_000_000).contains(&samples), "{samples}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_saves_and_exits_with_130() {
    use std::process::Stdio;
    let dir = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args([&scene("cornell-box-red"), "--size", "64x64", "--spp", "10000000", "--json-progress", "-o"])
        .arg(dir.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // The first line of progress: sampling has begun.
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(child.stderr.take().expect("piped")));
    assert!(lines.next().is_some_and(|l| l.is_ok_and(|l| l.contains("progress"))));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(killed.success());
    lines.for_each(drop);
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(json(&dir.path().join("cornell-box-red.json"))["samples_per_pixel"].as_u64() > Some(0));
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_does_not_end_the_render() {
    use std::process::Stdio;
    let dir = folder();
    let mut child = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .args([&scene("cornell-box-red"), "--size", "16x16", "--spp", "1", "-o"])
        .arg(dir.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    assert!(dir.path().join("cornell-box-red.html").exists());
}

#[test]
fn an_obj_without_camera_and_a_scene_without_light_are_framed_and_lit() {
    let dir = folder();
    let obj = dir.path().join("triangle.obj");
    std::fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("writable");
    let out = dir.path().join("out");
    let (said, _) = expect(
        0,
        &[obj.to_str().expect("UTF-8"), "--size", "16x16", "--spp", "4", "-o", out.to_str().expect("UTF-8")],
    );
    assert!(said.contains("no camera in the file") && said.contains("no light in the file"), "{said}");
    assert!(out.join("triangle.exr").exists());
    // An explicit environment is respected, even a black one.
    let arguments = [obj.to_str().expect("UTF-8"), "--size", "16x16", "--spp", "4", "--env", "0,0,0", "-o"];
    let (said, _) = expect(0, &[&arguments[..], &[out.to_str().expect("UTF-8")]].concat());
    assert!(said.contains("no camera in the file") && !said.contains("no light in the file"), "{said}");
}

#[test]
fn a_material_edit_compares_without_force() {
    let dir = folder();
    let out = dir.path().join("out");
    let out = out.to_str().expect("UTF-8");
    let text = std::fs::read_to_string(scene("cornell-box-red")).expect("the scene");
    let bin = scene("cornell-box-red").replace(".gltf", ".bin");
    std::fs::copy(bin, dir.path().join("cornell-box-red.bin")).expect("writable");
    let matte = dir.path().join("matte.gltf");
    let glossy = dir.path().join("glossy.gltf");
    assert!(text.contains("\"specularFactor\": 0"), "{text}");
    std::fs::write(&matte, &text).expect("writable");
    std::fs::write(&glossy, text.replace("\"specularFactor\": 0", "\"specularFactor\": 1"))
        .expect("writable");
    for file in [&matte, &glossy] {
        let file = file.to_str().expect("UTF-8");
        expect(0, &[file, "--size", "24x24", "--spp", "4", "--intervals", "-o", out, "-q"]);
    }
    let (a, b) = (format!("{out}/matte.exr"), format!("{out}/glossy.exr"));
    expect(0, &["compare", &a, &b, "-o", out]);
}

#[test]
fn pictures_of_an_earlier_render_do_not_stay_beside_a_json_that_does_not_know_them() {
    let dir = folder();
    cornell(dir.path(), "red", &["--maps", "all"]);
    assert!(dir.path().join("cornell-box-red.cost.leaves.png").exists());
    cornell(dir.path(), "red", &["--metrics", "none"]);
    let left: Vec<_> = std::fs::read_dir(dir.path())
        .expect("the folder")
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .filter(|name| name.contains(".cost."))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

/// Of samples that are not counted nobody knows how many rays they cast.
#[test]
fn rays_per_second_are_said_where_all_are_counted() {
    let dir = folder();
    let (scene, out) = (scene("cornell-box-red"), dir.path().to_str().expect("UTF-8"));
    for (more, says) in [(&[][..], true), (&["--cost-spp", "2"], false), (&["--no-radiance"], true)] {
        let mut arguments = vec![scene.as_str(), "--size", "16x16", "--spp", "4", "-o", out];
        arguments.extend(more);
        let (said, told) = expect(0, &arguments);
        let line = format!("{said}{told}");
        assert!(line.contains("Msamples/s"), "{line}");
        assert_eq!(line.contains("Mrays/s"), says, "{more:?}: {line}");
    }
}

#[test]
fn halves_are_even() {
    let dir = folder();
    cornell(dir.path(), "red", &["--intervals", "--cost-spp", "3"]);
    let document = json(&dir.path().join("cornell-box-red.json"));
    assert_eq!(document["samples_per_pixel"], 8);
    assert_eq!(document["cost_samples_per_pixel"], 4);
    let page = std::fs::read_to_string(dir.path().join("cornell-box-red.html")).expect("a page");
    assert!(page.contains("8, 4 counted"), "the page says of how many samples its maps are");
}

#[cfg(unix)]
#[test]
fn a_file_name_that_is_not_utf8_is_no_reason_to_lose_a_render() {
    use std::os::unix::ffi::OsStrExt;
    let dir = folder();
    let obj = dir.path().join(std::ffi::OsStr::from_bytes(b"bad\xff.obj"));
    // Some file systems refuse such names.
    if std::fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").is_err() {
        return;
    }
    let status = Command::new(env!("CARGO_BIN_EXE_hotspot-render"))
        .arg(&obj)
        .args(["--size", "8x8", "--spp", "1", "-q", "-o"])
        .arg(dir.path().join("out"))
        .status()
        .expect("the program starts");
    assert_eq!(status.code(), Some(0));
}
