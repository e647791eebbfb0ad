//! `obj-still-life`: a kitchen still life as Wavefront OBJ + MTL, in metres, y up: what a hand-made OBJ has.
//!
//! Quads, n-gons (disc-shaped caps), triangles; `o`, `g`, `s`, `usemtl`; all four corner forms (`v`, `v/vt`, `v//vn`,
//! `v/vt/vn`) and negative indices; a `Ke` light (front face down), `Ns`/`Ks` gloss, `illum 3` mirror. OBJ has no
//! camera: the renderer frames the bounds.

use crate::Output;
use crate::furniture as f;
use crate::gltf_writer::File;
use crate::math::{Affine, Vec3, X, Y, Z, sin_cos, spline, v};
use crate::shapes::{Mesh, quad, rod};
use std::fmt::Write as _;

const NAME: &str = "obj-still-life";

const MATERIALS: &str = "\
# Materials of the still life. CC0-1.0, written by the generator of this repository.

newmtl Table_oak
Kd 0.46 0.31 0.19
Ks 0 0 0
illum 1

newmtl Backdrop
Kd 0.36 0.42 0.44
Ks 0 0 0
illum 1

newmtl Blue_glaze
Kd 0.07 0.16 0.36
Ks 0.05 0.05 0.05
Ns 120
illum 2

newmtl White_glaze
Kd 0.74 0.72 0.68
Ks 0.04 0.04 0.04
Ns 60
illum 2

newmtl Apple_red
Kd 0.52 0.06 0.04
Ks 0.04 0.04 0.04
Ns 90
illum 2

newmtl Stalk
Kd 0.16 0.10 0.05
Ks 0 0 0
illum 1

newmtl Silver_mirror
Kd 0 0 0
Ks 0.92 0.91 0.88
Ns 1000
illum 3

newmtl Candle_wax
Kd 0.80 0.74 0.60
Ks 0 0 0
illum 1

newmtl Flame
Kd 0 0 0
Ke 420 270 95
illum 1

newmtl Slate
Kd 0.10 0.11 0.12
Ks 0.03 0.03 0.03
Ns 20
illum 2

newmtl Lamp_enamel
Kd 0.50 0.13 0.05
Ks 0.04 0.04 0.04
Ns 150
illum 2

newmtl Lamp_light
Kd 0 0 0
Ke 75 69 60
illum 1
";

/// Writes OBJ text and counts what it wrote.
#[derive(Default)]
struct Obj {
    text: String,
    vertices: usize,
    normals: usize,
    coordinates: usize,
    triangles: usize,
}

/// At most six decimals, without needless zeros.
fn short(x: f64) -> String {
    let text = format!("{:.5}", (x * 1e5 + 0.5).floor() / 1e5 + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl Obj {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn vector(&mut self, key: &str, p: Vec3) {
        let line = format!("{key} {} {} {}", short(p.x), short(p.y), short(p.z));
        self.line(&line);
    }

    fn position(&mut self, p: Vec3) -> usize {
        self.vector("v", p);
        self.vertices += 1;
        self.vertices
    }

    fn normal(&mut self, n: Vec3) -> usize {
        self.vector("vn", n);
        self.normals += 1;
        self.normals
    }

    fn coordinate(&mut self, u: f64, t: f64) -> usize {
        let line = format!("vt {} {}", short(u), short(t));
        self.line(&line);
        self.coordinates += 1;
        self.coordinates
    }

    fn face(&mut self, corners: &[String]) {
        self.triangles += corners.len() - 2;
        let line = format!("f {}", corners.join(" "));
        self.line(&line);
    }

    fn object(&mut self, name: &str, group: &str, material: &str, smooth: bool) {
        let line =
            format!("\no {name}\ng {group}\nusemtl {material}\ns {}", if smooth { "1" } else { "off" });
        self.line(&line);
    }

    /// A mesh as triangles `v//vn`.
    fn mesh(&mut self, mesh: &Mesh) {
        let base = self.vertices;
        for p in &mesh.positions {
            self.position(*p);
        }
        let normals = self.normals;
        for n in &mesh.normals {
            self.normal(*n);
        }
        for t in &mesh.triangles {
            let corners = t.map(|i| format!("{}//{}", base + 1 + i as usize, normals + 1 + i as usize));
            self.face(&corners);
        }
    }

    /// A surface of revolution about `centre` in smooth quads `v/vt/vn`; its end rings become n-gons when not at 0.
    fn lathe(&mut self, centre: Vec3, profile: &[(f64, f64)], segments: usize) {
        let (rows, n) = (profile.len(), segments);
        let (v0, n0, t0) = (self.vertices + 1, self.normals + 1, self.coordinates + 1);
        let at = |j: usize| sin_cos(j as f64 / n as f64);
        for (r, y) in profile {
            for j in 0..n {
                let (s, c) = at(j);
                self.position(centre + v(c * r, *y, -s * r));
            }
        }
        for i in 0..rows {
            let (a, b) = (profile[i.saturating_sub(1)], profile[(i + 1).min(rows - 1)]);
            for j in 0..n {
                let (s, c) = at(j);
                // The profile's direction turned by a quarter, outwards.
                let (out, up) = (b.1 - a.1, a.0 - b.0);
                self.normal(v(c * out, up, -s * out).unit());
            }
        }
        for i in 0..rows {
            for j in 0..=n {
                self.coordinate(j as f64 / n as f64, i as f64 / (rows - 1) as f64);
            }
        }
        for i in 0..rows - 1 {
            for j in 0..n {
                let corner = |i: usize, j: usize| {
                    let ring = i * n + j % n;
                    format!("{}/{}/{}", v0 + ring, t0 + i * (n + 1) + j, n0 + ring)
                };
                self.face(&[corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)]);
            }
        }
        let bottom: Vec<String> = (0..n).rev().map(|j| (v0 + j).to_string()).collect();
        let top: Vec<String> = (0..n).map(|j| (v0 + (rows - 1) * n + j).to_string()).collect();
        self.line("s off");
        self.face(&bottom);
        self.face(&top);
    }

    /// A box of six quads with corners counted from the end (`-8` .. `-1`), without normals.
    fn crate_box(&mut self, lo: Vec3, hi: Vec3, turn: f64) {
        let middle = (lo + hi) * 0.5;
        let map = Affine::rotate(Y, turn).then(Affine::translate(middle));
        for i in 0..8_u32 {
            let pick = |bit: u32, a: f64, b: f64| if i >> bit & 1 == 0 { a } else { b };
            let p = v(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z));
            self.position(map.point(p - middle));
        }
        for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5], [2, 6, 7, 3], [0, 1, 5, 4]] {
            self.face(&q.map(|i: i32| (i - 8).to_string()));
        }
    }

    /// A disc as one n-gon of bare positions, facing down.
    fn disc_down(&mut self, centre: Vec3, radius: f64, segments: usize) {
        let base = self.vertices;
        for j in 0..segments {
            let (s, c) = sin_cos(j as f64 / segments as f64);
            self.position(centre + v(c * radius, 0.0, s * radius));
        }
        let corners: Vec<String> = (1..=segments).map(|j| (base + j).to_string()).collect();
        self.face(&corners);
    }

    /// A flat quad with texture coordinates, `v/vt`.
    fn panel(&mut self, corner: Vec3, a: Vec3, b: Vec3) {
        let mut corners = vec![];
        for ((u, t), p) in
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].into_iter().zip(quad(corner, a, b).positions)
        {
            let (p, t) = (self.position(p), self.coordinate(u, t));
            corners.push(format!("{p}/{t}"));
        }
        self.face(&corners);
    }
}

pub(crate) fn output() -> Output {
    let mut obj = Obj::default();
    obj.line("# A still life. CC0-1.0, written by the generator of this repository. Metres, y up.");
    obj.line(&format!("mtllib {NAME}.mtl"));

    obj.object("Table", "furniture", "Table_oak", false);
    obj.crate_box(v(-0.50, -0.025, -0.30), v(0.50, 0.0, 0.30), 0.0);
    obj.object("Backdrop", "furniture", "Backdrop", false);
    obj.panel(v(-0.50, 0.0, -0.30), X, Y * 0.47);

    // A desk lamp: foot, bent arm, dome, and in it a disc that emits downwards.
    let head = v(0.0, 0.40, 0.06);
    obj.object("Lamp_foot", "lamp", "Lamp_enamel", true);
    let foot = [(0.066, 0.0), (0.068, 0.004), (0.066, 0.009), (0.030, 0.013), (0.012, 0.018)];
    obj.lathe(v(-0.38, 0.0, -0.17), &foot, 28);
    obj.object("Lamp_arm", "lamp", "Lamp_enamel", true);
    let bend = [
        [-0.38, 0.010, -0.17],
        [-0.385, 0.22, -0.172],
        [-0.37, 0.41, -0.165],
        [-0.25, 0.505, -0.09],
        [-0.08, 0.522, 0.01],
        [-0.008, 0.492, 0.055],
        [0.0, 0.462, 0.06],
    ];
    let arm: Vec<Vec3> = (0..=30)
        .map(|i| {
            let [x, y, z] = spline(&bend, f64::from(i) / 30.0);
            v(x, y, z)
        })
        .collect();
    obj.mesh(&rod(&arm, 0.006, 10));
    obj.object("Lamp_shade", "lamp", "Lamp_enamel", true);
    let (shade, _) = f::pendant(0.105, 0.07, 0.08);
    obj.mesh(&shade.at(head.x, head.y, head.z));
    obj.object("Lamp_disc", "lamp", "Lamp_light", false);
    obj.disc_down(head + Y * 0.012, 0.088, 24);

    obj.object("Tray", "crockery", "Silver_mirror", true);
    let tray =
        [(0.195, 0.001), (0.205, 0.004), (0.208, 0.010), (0.203, 0.011), (0.198, 0.007), (0.19, 0.0065)];
    obj.lathe(v(0.17, 0.0, 0.05), &tray, 36);
    obj.object("Jug", "crockery", "Blue_glaze", true);
    let jug = [
        (0.050, 0.0),
        (0.060, 0.012),
        (0.079, 0.05),
        (0.086, 0.095),
        (0.080, 0.140),
        (0.060, 0.185),
        (0.046, 0.220),
        (0.045, 0.250),
        (0.056, 0.280),
        (0.053, 0.281),
        (0.041, 0.250),
        (0.042, 0.222),
        (0.055, 0.18),
    ];
    obj.lathe(v(-0.22, 0.0, -0.08), &jug, 32);
    obj.object("Jug_handle", "crockery", "Blue_glaze", true);
    let handle: Vec<Vec3> = (0..=14)
        .map(|i| {
            let (s, c) = sin_cos(0.06 + 0.42 * f64::from(i) / 14.0 - 0.25);
            v(-0.22 - 0.052 - 0.062 * c, 0.168 - 0.078 * s, -0.08)
        })
        .collect();
    obj.mesh(&rod(&handle, 0.0095, 10));
    obj.object("Bowl", "crockery", "White_glaze", true);
    obj.mesh(&f::bowl(0.125, 0.075, 36).at(0.17, 0.0068, 0.05));

    let (flesh, stalk) = f::fruit(0.037, 18);
    let apples = [
        (0.135, 0.0245, 0.075, 0.02),
        (0.210, 0.0245, 0.060, -0.03),
        (0.165, 0.0265, 0.000, 0.04),
        (-0.06, 0.0, 0.20, 0.0),
    ];
    for (i, (x, y, z, tilt)) in apples.into_iter().enumerate() {
        let map = Affine::rotate(Z, tilt).then(Affine::rotate(Y, 0.29 * i as f64)).at(x, y, z);
        obj.object(&format!("Apple_{}", i + 1), "fruit", "Apple_red", true);
        obj.mesh(&flesh.clone().moved(map));
        obj.line("usemtl Stalk");
        obj.mesh(&stalk.clone().moved(map));
    }

    obj.object("Candle", "small_things", "Candle_wax", true);
    let candle =
        [(0.021, 0.015), (0.0215, 0.05), (0.0205, 0.12), (0.021, 0.167), (0.017, 0.172), (0.012, 0.170)];
    obj.lathe(v(-0.36, 0.0, 0.11), &candle, 20);
    obj.object("Candle_flame", "small_things", "Flame", true);
    let flame = [(0.002, 0.176), (0.0055, 0.181), (0.0065, 0.187), (0.005, 0.196), (0.0015, 0.207)];
    obj.lathe(v(-0.36, 0.0, 0.11), &flame, 12);
    obj.object("Candle_dish", "small_things", "Silver_mirror", true);
    let dish =
        [(0.032, 0.0), (0.050, 0.004), (0.060, 0.014), (0.058, 0.0155), (0.046, 0.0075), (0.028, 0.006)];
    obj.lathe(v(-0.36, 0.0, 0.11), &dish, 28);

    // Hexagonal coasters: prisms of quads between two hexagons.
    for (i, (x, z, y)) in [(-0.23, 0.215, 0.0), (-0.215, 0.22, 0.0081)].into_iter().enumerate() {
        obj.object(&format!("Coaster_{}", i + 1), "small_things", "Slate", false);
        let base = obj.vertices;
        for layer in [0.0, 0.008] {
            for j in 0..6 {
                let (s, c) = sin_cos(f64::from(j) / 6.0 + 0.02 + 0.03 * i as f64);
                obj.position(v(x + 0.052 * c, y + layer, z - 0.052 * s));
            }
        }
        for j in 0..6 {
            let k = (j + 1) % 6;
            obj.face(&[j, k, k + 6, j + 6].map(|n| (base + 1 + n).to_string()));
        }
        obj.face(&[5, 4, 3, 2, 1, 0].map(|n| (base + 1 + n).to_string()));
        obj.face(&[6, 7, 8, 9, 10, 11].map(|n| (base + 1 + n).to_string()));
    }
    obj.object("Recipe_book", "small_things", "White_glaze", false);
    obj.crate_box(v(0.24, 0.0003, -0.25), v(0.44, 0.028, -0.10), 0.04);
    obj.object("Note_book", "small_things", "Blue_glaze", false);
    obj.crate_box(v(0.25, 0.0285, -0.24), v(0.42, 0.046, -0.12), -0.03);

    let mut header = String::new();
    let _ = writeln!(header, "# {} triangles once its polygons are cut.", obj.triangles);
    let text = header + &obj.text;
    Output {
        name: NAME,
        triangles: obj.triangles,
        stored: obj.triangles,
        files: vec![
            File { path: format!("{NAME}/{NAME}.obj"), bytes: text.into_bytes() },
            File { path: format!("{NAME}/{NAME}.mtl"), bytes: MATERIALS.as_bytes().to_vec() },
        ],
    }
}
