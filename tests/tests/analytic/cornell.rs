//! Direct light in the Cornell box: at points in full light, in shadow and in between, by Lambert's formula over what the two
//! blocks leave of the lamp.
//!
//! Measures of the box: Cornell University Program of Computer Graphics, *The Cornell Box* (2005), in millimetres; the lamp
//! hangs 0.1 mm below the ceiling.

use crate::SIGMA;
use core::f64::consts::PI;
use hotspot_scene::Mesh;
use hotspot_tests::forms::lambert;
use hotspot_tests::measured::measure;
use hotspot_tests::world::{V3, World, add_scaled, cross, dot, light, matte, mesh, pencil, quad, sub, unit};

const LAMP: f64 = 548.7;
const TALL: f64 = 330.0;
const SHORT: f64 = 165.0;
/// Foot prints of the blocks, x and z.
const BLOCKS: [([[f64; 2]; 4], f64); 2] = [
    ([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]], SHORT),
    ([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]], TALL),
];
const EMITTER: [[f64; 2]; 4] = [[343.0, 227.0], [343.0, 332.0], [213.0, 332.0], [213.0, 227.0]];

/// Top and sides of a block.
fn faces(foot: [[f64; 2]; 4], height: f64) -> Vec<[V3; 4]> {
    let at = |i: usize, y: f64| [foot[i % 4][0], y, foot[i % 4][1]];
    let mut faces = vec![[0, 1, 2, 3].map(|i| at(i, height))];
    faces.extend((0..4).map(|i| [at(i, 0.0), at(i + 1, 0.0), at(i + 1, height), at(i, height)]));
    faces
}

fn block(foot: [[f64; 2]; 4], height: f64) -> Mesh {
    let mut all = mesh(Vec::new(), Vec::new());
    for face in faces(foot, height) {
        let part = quad(face);
        let first = all.positions.len() as u32;
        all.positions.extend(part.positions);
        all.triangles.extend(part.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

type Polygon = Vec<[f64; 2]>;

/// The part of a convex polygon to the left of a → b, or to the right of it.
fn cut(polygon: &Polygon, [a, b]: [[f64; 2]; 2], left: bool) -> Polygon {
    let side = |p: [f64; 2]| {
        let s = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        if left { s } else { -s }
    };
    let mut kept = Polygon::new();
    for i in 0..polygon.len() {
        let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        let (sp, sq) = (side(p), side(q));
        if sp >= 0.0 {
            kept.push(p);
        }
        if sp * sq < 0.0 {
            let t = sp / (sp - sq);
            kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
        }
    }
    kept
}

/// Twice the area, positive when counter-clockwise in (x, z).
fn twice_area(p: &[[f64; 2]]) -> f64 {
    (0..p.len()).map(|i| (p[i], p[(i + 1) % p.len()])).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// What of `polygon` lies outside of convex `screen`, in convex pieces.
fn without(polygon: Polygon, screen: &Polygon) -> Vec<Polygon> {
    let forward = twice_area(screen) > 0.0;
    let (mut rest, mut pieces) = (polygon, Vec::new());
    for i in 0..screen.len() {
        let edge = [screen[i], screen[(i + 1) % screen.len()]];
        pieces.push(cut(&rest, edge, !forward));
        rest = cut(&rest, edge, forward);
    }
    pieces.retain(|p| p.len() > 2 && twice_area(p).abs() > 1e-9);
    pieces
}

/// The shadow of a face on the lamp's plane, seen from `p`: of the part of it that is above `p`.
fn shadow(face: [V3; 4], p: V3) -> Option<Polygon> {
    let floor = p[1] + 1e-6;
    let mut above: Vec<V3> = Vec::new();
    for i in 0..4 {
        let (a, b) = (face[i], face[(i + 1) % 4]);
        if a[1] > floor {
            above.push(a);
        }
        if (a[1] > floor) != (b[1] > floor) {
            above.push(add_scaled(a, (floor - a[1]) / (b[1] - a[1]), sub(b, a)));
        }
    }
    let onto = |q: V3| {
        let t = (LAMP - p[1]) / (q[1] - p[1]);
        [p[0] + t * (q[0] - p[0]), p[2] + t * (q[2] - p[2])]
    };
    let shadow: Polygon = above.into_iter().map(onto).collect();
    // A face seen edge-on hides nothing.
    (shadow.len() > 2 && twice_area(&shadow).abs() > 1e-6).then_some(shadow)
}

/// Irradiance of a lamp of radiance 1, and the share of the lamp that is seen.
fn irradiance(p: V3, n: V3) -> (f64, f64) {
    let mut seen = vec![EMITTER.to_vec()];
    for (foot, height) in BLOCKS {
        for shadow in faces(foot, height).into_iter().filter_map(|face| shadow(face, p)) {
            seen = seen.into_iter().flat_map(|piece| without(piece, &shadow)).collect();
        }
    }
    let whole = twice_area(&EMITTER).abs();
    let share = seen.iter().map(|s| twice_area(s).abs()).sum::<f64>() / whole;
    let lit = |piece: &Polygon| {
        let corners: Vec<V3> = piece.iter().map(|[x, z]| [*x, LAMP, *z]).collect();
        assert!(corners.iter().all(|c| dot(sub(*c, p), n) > 0.0), "below the horizon of {p:?}");
        lambert(&corners, p, n).abs()
    };
    (seen.iter().map(lit).sum(), share)
}

fn cornell() -> World {
    let (white, green, red) = ([0.73f32; 3], [0.12, 0.45, 0.15], [0.65, 0.05, 0.05]);
    let wall = |corners: [V3; 4]| quad(corners);
    let mut world = World::new()
        .with(wall([[552.8, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]), matte(white))
        .with(
            wall([[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]]),
            matte(white),
        )
        .with(
            wall([[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]]),
            matte(white),
        )
        .with(wall([[0.0, 0.0, 559.2], [0.0; 3], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]), matte(green))
        .with(
            wall([[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]]),
            matte(red),
        );
    for (foot, height) in BLOCKS {
        world = world.with(block(foot, height), matte(white));
    }
    let lamp = EMITTER.map(|[x, z]| [x, LAMP, z]);
    let mut lamp = quad(lamp);
    let [a, b, c] = lamp.triangles[0].map(|i| lamp.positions[i as usize].map(f64::from));
    if cross(sub(b, a), sub(c, a))[1] > 0.0 {
        lamp.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    world.with(lamp, light([17.0, 12.0, 4.0]))
}

#[test]
fn direct_light_in_the_cornell_box() {
    let scene = cornell().prepare();
    let up = [0.0, 1.0, 0.0];
    let white = [0.73f32; 3];
    // The red wall is not plane: a point of its first triangle.
    let red = [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2]];
    let inward = unit(cross(sub(red[1], red[0]), sub(red[2], red[0])));
    let inward = if inward[0] < 0.0 { inward } else { inward.map(|c| -c) };
    let on_red = [0, 1, 2].map(|i| 0.3 * red[0][i] + 0.2 * red[1][i] + 0.5 * red[2][i]);
    let floor = |x: f64, z: f64| [x, 0.0, z];
    let points = [
        ("floor, in the light", floor(400.0, 100.0), up, white),
        ("floor, between the blocks", floor(278.0, 279.5), up, white),
        ("floor, half shadow of the short block", floor(30.0, 150.0), up, white),
        ("floor, half shadow of the tall block", floor(230.0, 330.0), up, white),
        ("back wall, over the blocks", [278.0, 420.0, 559.2], [0.0, 0.0, -1.0], white),
        ("back wall, half shadow of the tall block", [380.0, 190.0, 559.2], [0.0, 0.0, -1.0], white),
        ("green wall", [0.0, 300.0, 250.0], [1.0, 0.0, 0.0], [0.12, 0.45, 0.15]),
        ("short block, top", [180.0, SHORT, 150.0], up, white),
        ("tall block, top", [370.0, TALL, 350.0], up, white),
        ("red wall", on_red, inward, [0.65, 0.05, 0.05]),
    ];
    let mut half_lit = 0;
    for (what, p, n, rho) in points {
        let (e, share) = irradiance(p, n);
        half_lit += u32::from(share > 0.02 && share < 0.98);
        let expected = [0, 1, 2].map(|c| f64::from(rho[c]) / PI * [17.0, 12.0, 4.0][c] * e);
        // From close by, so that nothing is between.
        let aside = if n[1] > 0.5 { [0.9, 0.0, -0.3] } else { [0.1, 0.2, 0.1] };
        let from = add_scaled(add_scaled(p, 4.0, n), 3.0, aside);
        let what = format!("{what}, {:.0} % of the lamp", 100.0 * share);
        assert!(share > 0.02, "{what}");
        measure(&scene, &pencil(from, p), 1, 1024).assert_near(expected, SIGMA, &what);
    }
    assert!(half_lit >= 3, "{half_lit} points in half shadow");
}
