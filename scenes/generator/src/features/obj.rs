//! `obj-features.obj`: smoothing groups, vertex colours, PBR materials, concave n-gons with negative indices.
//!
//! It has neither normals nor a camera: both are made by whoever reads it.

use crate::gltf_writer::File;
use crate::math::{Vec3, X, Y, Z, sin_cos, v};
use crate::shapes::{Mesh, cuboid, quad, sphere};
use std::fmt::Write as _;

const MATERIALS: &str = "\
# Materials of obj-features.obj. CC0-1.0, written by the generator of this repository.

newmtl Floor
Kd 0.34 0.33 0.32
illum 1

newmtl Clay
Kd 0.62 0.36 0.24
illum 1

newmtl White
Kd 1 1 1
illum 1

newmtl Gold_rough
Kd 1 0.77 0.34
Pm 1
Pr 0.35

newmtl Gold_mirror
Kd 1 0.77 0.34
Pm 1
Pr 0

newmtl Blue_coat
Kd 0.08 0.2 0.6
Pm 0
Pr 0.15
Ni 1.5

newmtl Lamp
Kd 0 0 0
Ke 12 11.6 11
illum 1
";

#[derive(Default)]
struct Obj {
    text: String,
    vertices: usize,
}

impl Obj {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn object(&mut self, name: &str, material: &str, group: &str) {
        let _ = writeln!(self.text, "o {name}\nusemtl {material}\ns {group}");
    }

    /// A vertex, with a colour if it has one.
    fn vertex(&mut self, p: Vec3, color: Option<[f64; 3]>) {
        let round = |x: f64| (x * 1e4 + 0.5).floor() / 1e4 + 0.0;
        let _ = write!(self.text, "v {} {} {}", round(p.x), round(p.y), round(p.z));
        if let Some([r, g, b]) = color {
            let _ = write!(self.text, " {} {} {}", round(r), round(g), round(b));
        }
        self.text.push('\n');
        self.vertices += 1;
    }

    /// Positions alone, moved.
    fn mesh(&mut self, mesh: &Mesh, at: Vec3) {
        let base = self.vertices + 1;
        for p in &mesh.positions {
            self.vertex(*p + at, None);
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| i as usize + base);
            let _ = writeln!(self.text, "f {a} {b} {c}");
        }
    }

    /// A polygon of new vertices, by negative indices.
    fn polygon(&mut self, points: &[Vec3]) {
        for p in points {
            self.vertex(*p, None);
        }
        self.text.push('f');
        for i in (1..=points.len()).rev() {
            let _ = write!(self.text, " -{i}");
        }
        self.text.push('\n');
    }
}

pub(super) fn files() -> Vec<File> {
    let mut obj = Obj::default();
    obj.line("# CC0-1.0, written by the generator of this repository.");
    obj.line("mtllib obj-features.mtl");
    obj.object("Floor", "Floor", "off");
    obj.mesh(&quad(v(-1.0, 0.0, 0.9), X * 2.0, Z * -1.5), v(0.0, 0.0, 0.0));
    obj.object("Wall", "Floor", "off");
    obj.mesh(&quad(v(-1.0, 0.0, -0.6), X * 2.0, Y * 1.5), v(0.0, 0.0, 0.0));
    obj.object("Step", "Floor", "off");
    obj.mesh(&cuboid(v(-1.0, 0.0, -0.6), v(1.0, 0.28, 0.2)), v(0.0, 0.0, 0.0));
    obj.object("Lamp", "Lamp", "off");
    obj.mesh(&quad(v(-1.0, 1.6, 0.4), X * 0.5, Z * 0.5), v(0.0, 0.0, 0.0));

    let ball = sphere(0.22, 12);
    obj.object("Faceted", "Clay", "off");
    obj.mesh(&ball, v(-0.66, 0.5, -0.15));
    obj.object("Smooth", "Clay", "1");
    obj.mesh(&ball, v(0.0, 0.5, -0.15));

    // Round between the groups' edges: the sides are one group, each cap another.
    obj.object("Drum", "Clay", "1");
    let n = 12;
    let base = obj.vertices;
    for y in [0.28, 0.68] {
        for j in 0..n {
            let (s, c) = sin_cos(j as f64 / n as f64);
            obj.vertex(v(0.66 + 0.2 * c, y, -0.15 - 0.2 * s), None);
        }
    }
    for j in 0..n {
        let k = (j + 1) % n;
        let [a, b, c, d] = [j, k, n + k, n + j].map(|i| base + 1 + i);
        let _ = writeln!(obj.text, "f {a} {b} {c} {d}");
    }
    for (group, list) in [("2", (0..n).rev().collect::<Vec<_>>()), ("3", (n..2 * n).collect())] {
        let _ = writeln!(obj.text, "s {group}");
        let corners: Vec<String> = list.iter().map(|i| (base + 1 + i).to_string()).collect();
        let _ = writeln!(obj.text, "f {}", corners.join(" "));
    }

    for (i, name) in ["Gold_mirror", "Gold_rough", "Blue_coat"].into_iter().enumerate() {
        obj.object(&format!("Ball_{name}"), name, "1");
        obj.mesh(&sphere(0.17, 24), v(0.62 * (i as f64 - 1.0), 0.17, 0.55));
    }

    // Red, green, blue and white corners on white.
    obj.object("Colours", "White", "off");
    for (p, color) in [
        (v(-0.9, 0.83, -0.55), [1.0, 0.0, 0.0]),
        (v(-0.35, 0.83, -0.55), [0.0, 1.0, 0.0]),
        (v(-0.35, 1.38, -0.55), [0.0, 0.0, 1.0]),
        (v(-0.9, 1.38, -0.55), [1.0, 1.0, 1.0]),
    ] {
        obj.vertex(p, Some(color));
    }
    obj.line("f -4 -3 -2 -1");

    // Concave polygons, wound counter-clockwise: a star and a letter U.
    obj.object("Star", "Clay", "off");
    let star: Vec<Vec3> = (0..10)
        .map(|i| {
            let (s, c) = sin_cos(0.25 + f64::from(i) / 10.0);
            v(0.0, 1.08, -0.55) + (X * c + Y * s) * if i % 2 == 0 { 0.32 } else { 0.13 }
        })
        .collect();
    obj.polygon(&star);
    obj.object("Letter_U", "Clay", "off");
    let u = [
        (0.0, 0.0),
        (0.6, 0.0),
        (0.6, 0.7),
        (0.42, 0.7),
        (0.42, 0.18),
        (0.18, 0.18),
        (0.18, 0.7),
        (0.0, 0.7),
    ];
    obj.polygon(&u.map(|(x, y)| v(0.4 + 0.8 * x, 0.82 + 0.8 * y, -0.55)));

    vec![
        File { path: "features/obj-features.obj".into(), bytes: obj.text.into_bytes() },
        File { path: "features/obj-features.mtl".into(), bytes: MATERIALS.as_bytes().to_vec() },
    ]
}
