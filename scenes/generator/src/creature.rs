//! A glossy spined creature of about 28,000 triangles, and the scene with two of it (a stand-in for the paper's Figure 1).
//!
//! Everything is swept along splines with smooth normals: body and tail, limbs, toes, horns, spines; small scales are
//! set around the body on a spiral. It stands on y = 0, about 1.5 m tall, looks along +x; its tail curls to +z.

use crate::gltf_writer::{MaterialId, Place, Scene, Surface};
use crate::math::{Affine, Dice, Vec3, X, Y, Z, quaternion, spline, v};
use crate::shapes::{Frame, Mesh, Station, frames, join, quad, sphere, spike, tube};

/// The creature's parts, by material.
pub(crate) struct Creature {
    pub(crate) skin: Mesh,
    pub(crate) spines: Mesh,
    pub(crate) eyes: Mesh,
}

/// x, y, z, half-width, half-height: from the tail's tip to the snout.
const BODY: [[f64; 5]; 20] = [
    [-0.46, 0.44, 0.66, 0.010, 0.010],
    [-0.36, 0.46, 0.76, 0.017, 0.017],
    [-0.33, 0.37, 0.90, 0.024, 0.024],
    [-0.45, 0.23, 0.99, 0.031, 0.032],
    [-0.65, 0.11, 0.95, 0.039, 0.040],
    [-0.86, 0.06, 0.78, 0.047, 0.050],
    [-0.98, 0.066, 0.52, 0.056, 0.062],
    [-0.94, 0.085, 0.27, 0.068, 0.076],
    [-0.72, 0.15, 0.10, 0.085, 0.096],
    [-0.46, 0.29, 0.03, 0.110, 0.124],
    [-0.22, 0.44, 0.00, 0.145, 0.160],
    [-0.03, 0.57, 0.00, 0.172, 0.190],
    [0.10, 0.73, 0.00, 0.180, 0.196],
    [0.18, 0.90, 0.00, 0.172, 0.182],
    [0.23, 1.05, 0.00, 0.132, 0.142],
    [0.25, 1.18, 0.00, 0.088, 0.100],
    [0.30, 1.31, 0.00, 0.080, 0.088],
    [0.41, 1.40, 0.00, 0.098, 0.092],
    [0.56, 1.40, 0.00, 0.074, 0.064],
    [0.72, 1.345, 0.00, 0.042, 0.032],
];

/// A limb swept through keys of (x, y, z, radius), its bends eased so that its rings do not cross.
fn limb(keys: &[[f64; 4]], rings: usize, segments: usize) -> Mesh {
    let mut line: Vec<[f64; 4]> = (0..=rings).map(|i| spline(keys, i as f64 / rings as f64)).collect();
    for _ in 0..rings * rings / 100 {
        let old = line.clone();
        for i in 1..rings {
            line[i] = std::array::from_fn(|n| (old[i - 1][n] + 2.0 * old[i][n] + old[i + 1][n]) / 4.0);
        }
    }
    let stations: Vec<Station> =
        line.iter().map(|[x, y, z, r]| Station { centre: v(*x, *y, *z), side: *r, up: *r }).collect();
    tube(&stations, X, segments)
}

/// The same mesh and its mirror image across the plane z = 0.
fn both_sides(mesh: &Mesh) -> Mesh {
    join([mesh.clone(), mesh.clone().moved(Affine::scale(v(1.0, 1.0, -1.0)))])
}

fn body_frames(rings: usize) -> Vec<Frame> {
    let stations: Vec<Station> = (0..=rings)
        .map(|i| {
            let [x, y, z, side, up] = spline(&BODY, i as f64 / rings as f64);
            Station { centre: v(x, y, z), side, up }
        })
        .collect();
    // Carry the frame from the neck backwards, so that the back's spines stay on the back, then put it in order.
    let mut reversed = stations.clone();
    reversed.reverse();
    let mut list = frames(&reversed, Y);
    list.reverse();
    list
}

/// Builds the creature; `detail` 1 is the full one, less has fewer rings, segments and scales.
pub(crate) fn creature(detail: f64) -> Creature {
    let mut skin = vec![];
    let mut spines = vec![];
    let few = |n: usize| (n as f64 * detail + 0.5) as usize;
    let rings = few(168);
    let ring = |t: f64| (t * rings as f64) as usize;
    let body = body_frames(rings);
    let stations: Vec<Station> = body.iter().rev().map(|f| f.station).collect();
    skin.push(tube(&stations, Y, few(30)));

    // Head: lower jaw, brows, nostrils, horns, teeth.
    let jaw = [
        [0.37, 1.335, 0.0, 0.062],
        [0.48, 1.29, 0.0, 0.050],
        [0.60, 1.245, 0.0, 0.034],
        [0.69, 1.225, 0.0, 0.020],
    ];
    skin.push(limb(&jaw, 14, 16));
    let brow = [[0.37, 1.47, 0.070, 0.022], [0.45, 1.483, 0.078, 0.028], [0.54, 1.452, 0.066, 0.014]];
    skin.push(both_sides(&limb(&brow, 8, 10)));
    skin.push(both_sides(&sphere(0.017, 12).at(0.715, 1.372, 0.026)));
    spines.push(both_sides(&spike(
        v(0.36, 1.46, 0.055),
        v(0.20, 1.62, 0.10),
        v(0.02, 1.60, 0.20),
        0.032,
        12,
        9,
    )));
    spines.push(both_sides(&spike(
        v(0.35, 1.40, 0.085),
        v(0.24, 1.43, 0.20),
        v(0.10, 1.36, 0.24),
        0.022,
        10,
        6,
    )));
    spines.push(spike(v(0.64, 1.385, 0.0), v(0.67, 1.45, 0.0), v(0.655, 1.50, 0.0), 0.018, 10, 4));
    for i in 0..6 {
        let t = f64::from(i) / 5.0;
        let upper = v(0.50 + 0.2 * t, 1.342 - 0.022 * t, 0.058 - 0.032 * t);
        spines.push(both_sides(&spike(upper, upper - Y * 0.02, upper - v(-0.004, 0.044, 0.0), 0.009, 6, 1)));
        let lower = v(0.50 + 0.17 * t, 1.318 - 0.062 * t, 0.036 - 0.020 * t);
        spines.push(both_sides(&spike(lower, lower + Y * 0.015, lower + v(0.004, 0.034, 0.0), 0.007, 6, 1)));
    }

    // Hind legs: thigh, shin, long foot; three toes with claws each.
    let thigh = [
        [-0.12, 0.60, 0.10, 0.085],
        [-0.02, 0.56, 0.17, 0.135],
        [0.13, 0.475, 0.24, 0.116],
        [0.225, 0.405, 0.272, 0.082],
    ];
    skin.push(both_sides(&limb(&thigh, few(20), few(18))));
    let shin = [
        [0.235, 0.405, 0.275, 0.074],
        [0.17, 0.29, 0.284, 0.066],
        [0.03, 0.185, 0.285, 0.047],
        [-0.055, 0.095, 0.285, 0.043],
    ];
    skin.push(both_sides(&limb(&shin, few(18), few(16))));
    let foot = [[-0.058, 0.078, 0.285, 0.045], [0.06, 0.060, 0.29, 0.044], [0.20, 0.040, 0.30, 0.039]];
    skin.push(both_sides(&limb(&foot, few(12), few(14))));
    for (dx, dz) in [(0.17, -0.075), (0.205, 0.005), (0.165, 0.085)] {
        let root = v(0.17, 0.04, 0.30);
        let tip = root + v(dx, -0.016, dz);
        let toe = [
            [root.x, root.y, root.z, 0.034],
            [root.x + dx * 0.5, 0.052, root.z + dz * 0.5, 0.030],
            [tip.x, tip.y, tip.z, 0.021],
        ];
        skin.push(both_sides(&limb(&toe, 9, 10)));
        let claw = tip + v(dx, 0.0, dz) * 0.12;
        spines.push(both_sides(&spike(
            claw,
            claw + v(dx * 0.25, 0.02, dz * 0.25),
            claw + v(dx * 0.5, -0.018, dz * 0.5),
            0.017,
            8,
            4,
        )));
    }

    // Arms, bent forwards, with three fingers.
    let arm = [
        [0.19, 1.03, 0.09, 0.066],
        [0.20, 0.98, 0.17, 0.064],
        [0.24, 0.86, 0.245, 0.048],
        [0.31, 0.775, 0.262, 0.042],
        [0.43, 0.79, 0.225, 0.036],
        [0.53, 0.835, 0.185, 0.030],
        [0.575, 0.84, 0.170, 0.033],
    ];
    skin.push(both_sides(&limb(&arm, few(30), few(14))));
    for (dy, dz) in [(0.055, 0.050), (0.012, 0.0), (-0.045, -0.040)] {
        let root = v(0.575, 0.84, 0.165);
        let finger = [
            [root.x, root.y, root.z, 0.020],
            [root.x + 0.05, root.y + dy * 0.8, root.z + dz * 0.8, 0.019],
            [root.x + 0.095, root.y + dy - 0.03, root.z + dz, 0.013],
        ];
        skin.push(both_sides(&limb(&finger, 8, 8)));
        let tip = v(root.x + 0.097, root.y + dy - 0.036, root.z + dz);
        spines.push(both_sides(&spike(
            tip,
            tip + v(0.018, -0.012, 0.0),
            tip + v(0.02, -0.045, 0.0),
            0.011,
            8,
            3,
        )));
    }

    // Spines along the back, from neck to tail: tall over the shoulders, leaning backwards.
    let count = 46;
    for i in 0..count {
        let t = 0.045 + 0.77 * f64::from(i) / f64::from(count - 1);
        let frame = &body[ring(t)];
        let thick = frame.station.up;
        let tall = 0.035 + thick * if i % 2 == 0 { 0.95 } else { 0.62 };
        let base = frame.station.centre + frame.up * (thick * 0.95);
        // The frames look towards the tail.
        let via = base + frame.up * (tall * 0.6);
        let tip = base + frame.up * tall + frame.forward * (tall * 0.55);
        spines.push(spike(base, via, tip, 0.010 + thick * 0.14, few(8), 3));
    }

    // Scales on a spiral around body and tail, flanks and back only.
    let mut dice = Dice::new(7);
    let mut placed = 0;
    let scales = few(900) as u32;
    for i in 0..scales {
        let t = 0.10 + 0.72 * f64::from(i) / f64::from(scales);
        let turn = f64::from(i) * 0.381_966;
        let turn = turn - turn.floor();
        // A quarter turn is the back; leave room for the spines there, and for the belly below.
        let off_back = (turn - 0.25).abs();
        if !(0.06..0.36).contains(&off_back) {
            continue;
        }
        let frame = &body[ring(t)];
        let size = (frame.station.up * 0.15).max(0.0075) * dice.range(0.85, 1.15);
        let n = frame.outward(turn);
        let base = frame.point(turn) - n * (size * 0.25);
        let tip = base + n * (size * 0.95) + frame.forward * (size * 1.9);
        skin.push(spike(base, base + n * (size * 1.25) + frame.forward * (size * 0.3), tip, size, 6, 0));
        placed += 1;
    }
    debug_assert!(placed > scales / 3);

    let eyes = both_sides(&sphere(0.030, few(20)).at(0.475, 1.435, 0.076));
    Creature { skin: join(skin), spines: join(spines), eyes }
}

impl Creature {
    /// The creature's primitives with their materials.
    pub(crate) fn parts(
        self,
        skin: MaterialId,
        spines: MaterialId,
        eyes: MaterialId,
    ) -> Vec<(Mesh, MaterialId)> {
        vec![(self.skin, skin), (self.spines, spines), (self.eyes, eyes)]
    }
}

pub(crate) fn scene() -> Scene {
    let mut s = Scene::new("creature");
    let glossy = |base: [f64; 3]| Surface::Substrate { base, roughness: 0.45, ior: 1.5, specular: 0.5 };
    let skin = s.material("Creature skin", glossy([0.38, 0.28, 0.12]));
    let horn = s.material("Creature horn", glossy([0.62, 0.50, 0.34]));
    let eye = s.material(
        "Creature eye",
        Surface::Substrate { base: [0.06, 0.02, 0.01], roughness: 0.2, ior: 1.5, specular: 1.0 },
    );
    let paint = s.material("Backdrop paint", Surface::Matte([0.52, 0.54, 0.58]));
    let ground = s.material("Ground", Surface::Matte([0.42, 0.40, 0.37]));
    let lamp = s.material("Lamp", Surface::Light { base: [0.0; 3], radiance: [1150.0, 1050.0, 900.0] });

    let mesh = s.mesh("Creature", creature(1.0).parts(skin, horn, eye));
    // The first by translation, rotation and scale, the second by a matrix.
    let turn = quaternion(Y, -0.10);
    let place = Place::Trs { translation: v(0.42, 0.0, 0.35), rotation: turn, scale: 1.0 };
    s.node("Creature in front", mesh, place);
    let map = Affine::scale(v(1.0, 1.0, 1.0) * 1.15).then(Affine::rotate(Y, -0.36)).at(-0.62, 0.0, -0.85);
    s.node("Creature behind", mesh, Place::Matrix(map));

    s.add("Ground", quad(v(-6.0, 0.0, 6.0), X * 12.0, Z * -8.2), ground);
    s.add("Backdrop", quad(v(-6.0, 0.0, -2.2), X * 12.0, Y * 6.0), paint);
    let bulb = sphere(0.09, 24);
    s.place("Lamp", vec![(bulb, lamp)], Place::at(v(-1.7, 3.3, 3.0)));
    s.look(v(0.35, 1.30, 5.2), v(-0.02, 0.79, 0.0), 27.5, 1.0);
    s
}

/// Where a sculpture of the creature stands on a table: its scale for a given height.
pub(crate) fn scale_for(height: f64) -> f64 {
    height / 1.62
}

/// Needed by rooms that place it with a point of view.
pub(crate) fn facing(centre: Vec3, turns: f64, scale: f64) -> Place {
    Place::Trs { translation: centre, rotation: quaternion(Y, turns), scale }
}
