//! The OBJ reader against `tobj`, which another hand wrote: of well-formed files both read the same triangles.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use hotspot_scene::{LoadOptions, Scene, load};

use crate::support::*;

/// A triangle: positions, and where the file has them, texture coordinates from the image's upper edge and unit normals.
#[derive(Clone, Debug, PartialEq)]
struct Triangle {
    positions: [[f32; 3]; 3],
    uvs: Option<[[f32; 2]; 3]>,
    normals: Option<[[f32; 3]; 3]>,
}

impl Triangle {
    /// Twice the area times the normal.
    fn cross(&self) -> [f64; 3] {
        let [a, b, c] = self.positions.map(|p| p.map(f64::from));
        let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    }
}

fn ours(scene: &Scene) -> Vec<Triangle> {
    let mut all = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        all.extend(mesh.triangles.iter().map(|triangle| Triangle {
            positions: triangle.map(|i| mesh.positions[i as usize]),
            uvs: mesh.uvs.as_ref().map(|uvs| triangle.map(|i| uvs[i as usize])),
            normals: mesh.normals.as_ref().map(|normals| triangle.map(|i| normals[i as usize])),
        }));
    }
    all
}

/// As `tobj` reads them, without those that have no area; `None` where it cannot read the file.
fn theirs(bytes: &[u8]) -> Option<Vec<Triangle>> {
    let options =
        tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    // It takes polylines for polygons.
    let is_line = |line: &&[u8]| line.starts_with(b"l ");
    let bytes =
        bytes.split(|byte| *byte == b'\n').filter(|line| !is_line(line)).collect::<Vec<_>>().join(&b'\n');
    let read = || tobj::load_obj_buf(&mut &*bytes, &options, |_| Ok((Vec::new(), HashMap::default())));
    let (models, _) = catch_unwind(read).ok()?.ok()?;
    let mut all = Vec::new();
    for mesh in models.iter().map(|model| &model.mesh) {
        let (positions, uvs) = (mesh.positions.as_chunks::<3>().0, mesh.texcoords.as_chunks::<2>().0);
        let normals = mesh.normals.as_chunks::<3>().0;
        // Shorter lists are those of meshes where some corners have none: they are not the vertices' any more.
        for triangle in mesh.indices.as_chunks::<3>().0 {
            let triangle = triangle.map(|i| i as usize);
            let unit = |n: [f32; 3]| {
                let length = n.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt();
                n.map(|c| (f64::from(c) / length) as f32)
            };
            all.push(Triangle {
                positions: triangle.map(|i| positions[i]),
                uvs: (uvs.len() == positions.len()).then(|| triangle.map(|i| [uvs[i][0], 1.0 - uvs[i][1]])),
                normals: (normals.len() == positions.len()).then(|| triangle.map(|i| unit(normals[i]))),
            });
        }
    }
    all.retain(|triangle| triangle.cross() != [0.0; 3]);
    Some(all)
}

/// What differs first, in triangles read in the same order. Texture coordinates are compared where we keep them, normals
/// where the file states them.
fn difference(ours: &[Triangle], theirs: &[Triangle]) -> Option<String> {
    if ours.len() != theirs.len() {
        return Some(format!("{} triangles instead of {}", ours.len(), theirs.len()));
    }
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6);
    ours.iter().zip(theirs).enumerate().find_map(|(i, (a, b))| {
        let uvs = match (&a.uvs, &b.uvs) {
            (Some(a), Some(b)) => a == b,
            _ => true,
        };
        let normals = match (&a.normals, &b.normals) {
            // Zero normals have no direction; we mend them.
            (Some(a), Some(b)) => {
                a.iter().zip(b).all(|(a, b)| near(a, b) || b.iter().any(|c| !c.is_finite()))
            }
            (None, Some(_)) => false,
            _ => true,
        };
        (a.positions != b.positions || !uvs || !normals)
            .then(|| format!("triangle {i}: {a:?} instead of {b:?}"))
    })
}

/// Knuth's MMIX generator.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % bound
    }

    /// In -1..1, of four digits.
    fn number(&mut self) -> f64 {
        self.below(20_001) as f64 / 10_000.0 - 1.0
    }
}

/// Objects of flat convex polygons with three to five corners, whose vertices are listed anywhere above them and named by
/// positive and negative indices; each object has texture coordinates, normals, both or neither.
fn generated(seed: u64) -> String {
    let mut numbers = Numbers(seed);
    let mut text = String::from("mtllib m.mtl\nusemtl m\n");
    let (mut v, mut vt, mut vn) = (0i64, 0i64, 0i64);
    for object in 0..1 + numbers.below(4) {
        let _ = writeln!(text, "{} object {object}", if numbers.below(2) == 0 { "o" } else { "g" });
        let (with_uv, with_normal) = (numbers.below(2) == 0, numbers.below(2) == 0);
        for _ in 0..1 + numbers.below(12) {
            let corners = 3 + numbers.below(3) as i64;
            let axis = |numbers: &mut Numbers| [numbers.number(), numbers.number(), numbers.number()];
            let (center, a, b) = (axis(&mut numbers), axis(&mut numbers), axis(&mut numbers));
            for i in 0..corners {
                let angle = std::f64::consts::TAU * i as f64 / corners as f64;
                let p: Vec<f64> =
                    (0..3).map(|k| center[k] + angle.cos() * a[k] + angle.sin() * b[k]).collect();
                let _ = writeln!(text, "v {} {:e} {}", p[0], p[1], p[2]);
                let _ = writeln!(text, "vt {} {}", numbers.number(), 3.0 * numbers.number());
                let _ = writeln!(text, "vn {} {} 0.5", numbers.number(), numbers.number());
            }
            (v, vt, vn) = (v + corners, vt + corners, vn + corners);
            let start = numbers.below(corners as u64) as i64;
            text.push('f');
            for i in 0..corners {
                // Texture coordinates and normals of any earlier line.
                let back = corners - 1 - (i + start) % corners;
                let (t, n) = (numbers.below(vt as u64) as i64, numbers.below(vn as u64) as i64);
                let mut index = |count: i64, back: i64| {
                    if numbers.below(2) == 0 { count - back } else { -1 - back }
                };
                let (v, vt, vn) = (index(v, back), index(vt, t), index(vn, n));
                let _ = match (with_uv, with_normal) {
                    (false, false) => write!(text, " {v}"),
                    (true, false) => write!(text, " {v}/{vt}"),
                    (false, true) => write!(text, " {v}//{vn}"),
                    (true, true) => write!(text, " {v}/{vt}/{vn}"),
                };
            }
            text.push('\n');
        }
    }
    text
}

#[test]
fn generated_files_are_read_as_tobj_reads_them() {
    let texture = png(&[[9; 4]; 4]);
    let (mut triangles, mut with_uvs, mut with_normals) = (0, 0, 0);
    for seed in 0..200 {
        let text = generated(seed);
        let mtl = b"newmtl m\nmap_Kd t.png\n";
        let scene = load_files(&[("a.obj", text.as_bytes()), ("m.mtl", mtl), ("t.png", &texture)]).unwrap();
        check(&scene);
        let ours = ours(&scene);
        let theirs = theirs(text.as_bytes()).expect("tobj reads it");
        if let Some(difference) = difference(&ours, &theirs) {
            panic!("seed {seed}: {difference}\n{text}");
        }
        triangles += ours.len();
        // Objects without are given (0, 0) where the material has a texture.
        with_uvs += theirs.iter().filter(|triangle| triangle.uvs.is_some()).count();
        with_normals += ours.iter().filter(|triangle| triangle.normals.is_some()).count();
        assert!(ours.iter().all(|triangle| triangle.uvs.is_some()), "seed {seed}");
    }
    assert!(triangles > 4000 && with_uvs > triangles / 4 && with_normals > triangles / 4);
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() && !path.is_symlink() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj")) {
            files.push(path);
        }
    }
}

fn say(line: &str) {
    // Not by `eprintln!`, which the test runner keeps to itself while a test passes.
    std::io::stderr().write_all(format!("{line}\n").as_bytes()).unwrap();
}

/// Order is that of the file within a group only: groups that are left and entered again are put together by us.
#[test]
fn files_of_the_corpus_are_read_as_tobj_reads_them() {
    let Some(folder) = std::env::var_os("HOTSPOT_CORPUS") else {
        say("SKIPPED: HOTSPOT_CORPUS does not name a folder that tests/corpus/fetch.py has filled");
        return;
    };
    let mut files = Vec::new();
    collect(Path::new(&folder), &mut files);
    assert!(!files.is_empty(), "no OBJ files below {}", Path::new(&folder).display());
    let (mut same, mut split, mut unread, mut wrong) = (0, 0, 0, Vec::new());
    for file in &files {
        let Ok(scene) = load(file, &LoadOptions::default()) else { continue };
        let bytes = std::fs::read(file).unwrap();
        let Some(mut theirs) = theirs(&bytes) else {
            unread += 1;
            say(&format!("not read by tobj: {}", file.display()));
            continue;
        };
        let mut ours = ours(&scene);
        for list in [&mut ours, &mut theirs] {
            list.sort_by_key(|triangle| triangle.positions.map(|p| p.map(f32::to_bits)));
        }
        match difference(&ours, &theirs) {
            None => same += 1,
            // Concave polygons: fans of theirs, and ears of ours. The sum of the areas as vectors is that of the outline.
            Some(_) if has_polygons(&bytes) && same_outline(&ours, &theirs) => split += 1,
            Some(difference) => wrong.push(format!("{}: {difference}", file.display())),
        }
    }
    say(&format!(
        "{} OBJ files: {same} alike, {split} alike but for the triangles of polygons, {unread} not read by tobj",
        files.len()
    ));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn has_polygons(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    text.lines().any(|line| line.starts_with("f ") && line.split_whitespace().count() > 4)
}

fn same_outline(ours: &[Triangle], theirs: &[Triangle]) -> bool {
    let sum = |list: &[Triangle]| {
        list.iter().fold(([0.0; 3], 0.0f64), |(sum, size), triangle| {
            let cross: [f64; 3] = triangle.cross();
            let length = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
            (std::array::from_fn(|i: usize| sum[i] + cross[i]), size + length)
        })
    };
    let ((a, size), (b, _)) = (sum(ours), sum(theirs));
    a.iter().zip(b).all(|(a, b): (&f64, f64)| (a - b).abs() <= 1e-6 * size)
}
