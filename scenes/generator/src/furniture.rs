//! Furniture and small things shared by the rooms, in metres: each stands on y = 0 about its own axis, front to +z.

use crate::math::{Affine, Dice, Vec3, X, Y, Z, sin_cos, smoothstep, v};
use crate::shapes::{
    Mesh, Station, block, cuboid, cylinder, join, lathe, quad, rod, rounded_box, sheet, sphere, tube,
};

/// A rounded slab whose underside is at y = 0.
pub(crate) fn slab(width: f64, height: f64, depth: f64, radius: f64) -> Mesh {
    rounded_box(v(width, height, depth), radius, 2).at(0.0, height / 2.0, 0.0)
}

/// A leg that tapers downwards, from `foot` to `head`.
fn leg(foot: Vec3, head: Vec3, thin: f64, thick: f64) -> Mesh {
    let stations: Vec<Station> = (0..=4)
        .map(|i| {
            let t = f64::from(i) / 4.0;
            let r = thin + (thick - thin) * t;
            Station { centre: foot * (1.0 - t) + head * t, side: r, up: r }
        })
        .collect();
    tube(&stations, Z, 12)
}

/// Four splayed legs under a top of the given size whose underside is at `height`.
pub(crate) fn table_legs(width: f64, depth: f64, height: f64) -> Mesh {
    let mut parts = vec![];
    for (sx, sz) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let head = v(sx * (width / 2.0 - 0.12), height - 0.02, sz * (depth / 2.0 - 0.1));
        parts.push(leg(v(head.x + sx * 0.06, 0.012, head.z + sz * 0.05), head, 0.014, 0.026));
    }
    for s in [-1.0, 1.0] {
        let z = s * (depth / 2.0 - 0.1);
        parts.push(block(width - 0.26, 0.06, 0.018).at(0.0, height - 0.061, z));
        let x = s * (width / 2.0 - 0.12);
        parts.push(block(0.018, 0.06, depth - 0.22).at(x, height - 0.061, 0.0));
    }
    join(parts)
}

/// A chair: its wooden frame, and its seat and back rest. It faces +z.
pub(crate) fn chair() -> (Mesh, Mesh) {
    let mut wood = vec![];
    for sx in [-1.0, 1.0] {
        wood.push(leg(v(sx * 0.205, 0.01, 0.2), v(sx * 0.17, 0.44, 0.165), 0.01, 0.018));
        let post: Vec<Station> = [
            (0.01, -0.235, 0.01),
            (0.22, -0.195, 0.015),
            (0.44, -0.175, 0.018),
            (0.62, -0.19, 0.016),
            (0.80, -0.235, 0.013),
        ]
        .iter()
        .map(|(y, z, r)| Station { centre: v(sx * (0.205 - 0.06 * y), *y, *z), side: *r, up: *r })
        .collect();
        wood.push(tube(&post, Z, 10));
        wood.push(rod(&[v(sx * 0.195, 0.2, -0.2), v(sx * 0.195, 0.2, 0.185)], 0.008, 8));
    }
    wood.push(rod(&[v(-0.19, 0.2, 0.0), v(0.0, 0.2, 0.0), v(0.19, 0.2, 0.0)], 0.008, 8));
    let seat = slab(0.42, 0.045, 0.41, 0.02).at(0.0, 0.44, 0.0);
    // A back rest bent around the sitter, a shell of two sheets and a rim.
    let rest = |inner: f64| {
        move |u: f64, t: f64| {
            let side = (u - 0.5) * 0.4;
            let hollow = 0.05 * (1.0 - (u - 0.5) * (u - 0.5) * 4.0);
            v(side, 0.63 + 0.19 * t, -0.205 - 0.045 * t - hollow + inner)
        }
    };
    let mut back = sheet(14, 4, rest(0.009));
    back.add(&sheet(14, 4, rest(-0.009)).flipped());
    // The rim between the two sheets.
    let rim = |along: &dyn Fn(f64) -> (f64, f64)| {
        sheet(14, 1, |s, w| {
            let (u, t) = along(s);
            rest(-0.009)(u, t) * (1.0 - w) + rest(0.009)(u, t) * w
        })
    };
    back.add(&rim(&|s| (s, 0.0)));
    back.add(&rim(&|s| (1.0 - s, 1.0)));
    back.add(&rim(&|s| (1.0, s)));
    back.add(&rim(&|s| (0.0, 1.0 - s)));
    (join(wood), join([seat, back]))
}

/// A vase with a hollow neck; `height` to its lip, `belly` its greatest radius.
pub(crate) fn vase(height: f64, belly: f64, segments: usize) -> Mesh {
    let outside = [
        (0.55, 0.0),
        (0.55, 0.0),
        (0.74, 0.05),
        (0.93, 0.17),
        (1.0, 0.32),
        (0.95, 0.46),
        (0.78, 0.60),
        (0.53, 0.72),
        (0.37, 0.82),
        (0.33, 0.90),
        (0.37, 0.96),
        (0.44, 1.0),
        (0.42, 1.008),
        (0.39, 1.0),
        (0.31, 0.94),
        (0.28, 0.88),
        (0.33, 0.80),
        (0.48, 0.70),
        (0.72, 0.58),
        (0.86, 0.40),
        (0.80, 0.2),
        (0.45, 0.07),
        (0.0, 0.06),
    ];
    let profile: Vec<(f64, f64)> = outside.iter().map(|(r, y)| (r * belly, y * height)).collect();
    lathe(&profile, segments)
}

/// Bare twigs with buds, growing from the origin: twigs, buds.
pub(crate) fn twigs(count: usize, height: f64, seed: u64) -> (Mesh, Mesh) {
    let mut dice = Dice::new(seed);
    let (mut wood, mut buds) = (vec![], vec![]);
    for i in 0..count {
        let (s, c) = sin_cos((i as f64 + dice.range(0.0, 0.5)) / count as f64);
        let lean = dice.range(0.18, 0.42);
        let tall = height * dice.range(0.75, 1.05);
        let bend = dice.range(-0.1, 0.1) * height;
        let at = |t: f64| {
            let out = lean * height * t * t + 0.01;
            v(c * out - s * bend * t * t, tall * t, s * out + c * bend * t * t)
        };
        let stations: Vec<Station> = (0..=6)
            .map(|k| {
                let t = f64::from(k) / 6.0;
                let r = 0.0035 * (1.0 - 0.7 * t);
                Station { centre: at(t), side: r, up: r }
            })
            .collect();
        wood.push(tube(&stations, X, 5));
        for k in 0..7 {
            let t = 0.4 + 0.6 * f64::from(k) / 6.0;
            let jitter = v(dice.range(-1.0, 1.0), dice.range(-0.3, 1.0), dice.range(-1.0, 1.0)) * 0.014;
            let size = dice.range(0.007, 0.012);
            let bud = sphere(size, 6).moved(Affine::scale(v(1.0, 1.35, 1.0)));
            let p = at(t) + jitter;
            buds.push(bud.at(p.x, p.y, p.z));
        }
    }
    (join(wood), join(buds))
}

/// A potted plant: pot, soil and stems, leaves.
pub(crate) fn plant(height: f64, leaves: usize, seed: u64) -> (Mesh, Mesh, Mesh) {
    let pot = lathe(
        &[
            (0.11, 0.0),
            (0.11, 0.0),
            (0.135, 0.14),
            (0.155, 0.27),
            (0.155, 0.27),
            (0.14, 0.27),
            (0.14, 0.27),
            (0.13, 0.2),
            (0.0, 0.2),
        ],
        32,
    );
    let mut dice = Dice::new(seed);
    let mut stems = vec![cylinder(0.131, 0.03, 0.0, 24).at(0.0, 0.2, 0.0)];
    let mut blades = vec![];
    for i in 0..leaves {
        // Golden angle: every leaf finds its own light.
        let turn = i as f64 * 0.381_966 + dice.range(-0.04, 0.04);
        let age = i as f64 / leaves as f64;
        let tall = (height - 0.25) * (0.35 + 0.6 * (1.0 - age)) * dice.range(0.9, 1.1);
        let reach = (0.08 + 0.24 * age) * dice.range(0.8, 1.15);
        let (s, c) = sin_cos(turn);
        let out = v(c, 0.0, s);
        let across = v(-s, 0.0, c);
        let base = out * 0.03 + Y * 0.22;
        let stem = |t: f64| base + out * (reach * t * t) + Y * (tall * t);
        stems.push(rod(&[stem(0.0), stem(0.33), stem(0.66), stem(1.0)], 0.005, 6));
        let (length, width) = (dice.range(0.2, 0.3), dice.range(0.055, 0.08));
        let droop = 0.25 + 0.5 * age;
        blades.push(sheet(8, 4, |u, w| {
            // Blunt ends: a leaf that ended in a point would have triangles without area.
            let u = 0.02 + 0.96 * u;
            let shape = (4.0 * u * (1.0 - u)).sqrt() * (1.15 - 0.45 * u);
            let x = (w - 0.5) * 2.0;
            let along = out * (length * u * 0.9) + Y * (length * u * (0.75 - droop * u * 1.6));
            stem(1.0) + along + across * (x * width * shape) + Y * (0.022 * x * x * shape)
        }));
    }
    (pot, join(stems), join(blades))
}

/// A row of standing books from x = 0 to `width`: one mesh per colour of the palette.
pub(crate) fn books(width: f64, colours: usize, seed: u64) -> Vec<Mesh> {
    let mut dice = Dice::new(seed);
    let mut rows = vec![Mesh::default(); colours];
    let mut x = 0.0;
    let mut colour = 0;
    loop {
        let thick = dice.range(0.018, 0.045);
        if x + thick > width {
            break;
        }
        let (tall, deep) = (dice.range(0.19, 0.28), dice.range(0.14, 0.19));
        let book = cuboid(v(0.0, 0.0, -deep), v(thick - 0.0015, tall, 0.0));
        let lean = if dice.range(0.0, 1.0) < 0.1 { -0.012 } else { 0.0 };
        rows[colour].add(&book.moved(Affine::rotate(Z, lean).at(x, 0.0, 0.0)));
        x += thick;
        colour = (colour + 1 + (dice.range(0.0, 2.0) as usize)) % colours;
    }
    rows.retain(|r| !r.triangles.is_empty());
    rows
}

/// A lamp shade (a thin dome, open below, its rim at y = 0) and its cord up to `cord`.
pub(crate) fn pendant(radius: f64, height: f64, cord: f64) -> (Mesh, Mesh) {
    let arc = |grow: f64| {
        (0..=7).map(move |i| {
            let (s, c) = sin_cos(0.25 * f64::from(i) / 7.0);
            ((radius + grow) * c, (height + grow) * s)
        })
    };
    let mut profile: Vec<(f64, f64)> = arc(-0.004).collect();
    profile.reverse();
    profile[0].0 = 0.0;
    let rim = profile[profile.len() - 1];
    profile.push(rim);
    profile.push((radius, 0.0));
    profile.extend(arc(0.0));
    let last = profile.len() - 1;
    profile[last].0 = 0.0;
    let shade = lathe(&profile, 40);
    let line = join([
        cylinder(0.022, 0.05, 0.006, 16).at(0.0, height - 0.004, 0.0),
        cuboid(v(-0.003, height, -0.003), v(0.003, cord, 0.003)),
    ]);
    (shade, line)
}

/// A rectangular frame of four bars about the origin, its back at z = 0.
pub(crate) fn frame(width: f64, height: f64, bar: f64, depth: f64) -> Mesh {
    let (w, h) = (width / 2.0, height / 2.0);
    let beam = |x: f64, y: f64, sx: f64, sy: f64| {
        rounded_box(v(sx, sy, depth), (depth.min(bar) * 0.2).min(0.006), 1).at(x, y, depth / 2.0)
    };
    join([
        beam(0.0, h - bar / 2.0, width, bar),
        beam(0.0, -h + bar / 2.0, width, bar),
        beam(w - bar / 2.0, 0.0, bar, height - 2.0 * bar),
        beam(-w + bar / 2.0, 0.0, bar, height - 2.0 * bar),
    ])
}

/// A curtain of `width` hanging from y = 0 down to -`height`, its folds along z.
pub(crate) fn curtain(width: f64, height: f64, folds: f64) -> Mesh {
    sheet((folds * 10.0) as usize, 6, |u, t| {
        let (s, _) = sin_cos(u * folds + 0.05 * t);
        let (s2, _) = sin_cos(u * folds * 0.37 + 0.2);
        let deep = 0.028 + 0.022 * t;
        v(width * u, -height * (1.0 - t), s * (0.05 - 0.01 * t) * 0.8 + s2 * deep * 0.5)
    })
}

/// The panes' bars of a window in a hole (x0, y0, x1, y1) of a wall in z = 0, and the light behind it, facing +z.
pub(crate) fn window(hole: [f64; 4], depth: f64, bars: (usize, usize)) -> (Mesh, Mesh) {
    let [x0, y0, x1, y1] = hole;
    let (w, h, t) = (x1 - x0, y1 - y0, 0.045);
    let z = -depth * 0.7;
    let mut parts = vec![frame(w, h, 0.06, t).at((x0 + x1) / 2.0, (y0 + y1) / 2.0, z)];
    for i in 1..=bars.0 {
        let x = x0 + w * i as f64 / (bars.0 + 1) as f64;
        parts.push(cuboid(v(x - 0.018, y0 + 0.06, z + 0.005), v(x + 0.018, y1 - 0.06, z + t - 0.005)));
    }
    for i in 1..=bars.1 {
        let y = y0 + h * i as f64 / (bars.1 + 1) as f64;
        parts.push(cuboid(v(x0 + 0.06, y - 0.015, z + 0.008), v(x1 - 0.06, y + 0.015, z + t - 0.008)));
    }
    (join(parts), quad(v(x0, y0, -depth), X * w, Y * h))
}

/// A shelf: a case of boards, `shelves` openings high, its back at z = 0, open to +z.
pub(crate) fn bookcase(width: f64, height: f64, depth: f64, shelves: usize) -> Mesh {
    let t = 0.022;
    let mut parts = vec![
        cuboid(v(-width / 2.0, 0.0, 0.0), v(-width / 2.0 + t, height, depth)),
        cuboid(v(width / 2.0 - t, 0.0, 0.0), v(width / 2.0, height, depth)),
        cuboid(v(-width / 2.0 + t, 0.0, 0.001), v(width / 2.0 - t, height, 0.008)),
    ];
    for i in 0..=shelves {
        let y = (height - t) * i as f64 / shelves as f64;
        parts.push(cuboid(v(-width / 2.0 + t, y, 0.008), v(width / 2.0 - t, y + t, depth - 0.002)));
    }
    join(parts)
}

/// A rug with soft waves and rounded ends, 1 cm thick.
pub(crate) fn rug(width: f64, depth: f64) -> Mesh {
    sheet(24, 16, |u, t| {
        let edge = |x: f64| smoothstep(0.0, 0.03, x) * smoothstep(1.0, 0.97, x);
        let (s, _) = sin_cos(u * 2.0 + t * 1.3);
        v(width * (0.5 - u), 0.002 + (0.010 + 0.002 * s) * edge(u) * edge(t), depth * (t - 0.5))
    })
}

/// A bowl, hollow, `radius` wide at its lip.
pub(crate) fn bowl(radius: f64, height: f64, segments: usize) -> Mesh {
    let shape = [
        (0.36, 0.0),
        (0.36, 0.0),
        (0.40, 0.05),
        (0.62, 0.16),
        (0.82, 0.42),
        (0.95, 0.74),
        (1.0, 1.0),
        (0.985, 1.02),
        (0.965, 1.0),
        (0.91, 0.76),
        (0.77, 0.46),
        (0.55, 0.22),
        (0.3, 0.13),
        (0.0, 0.11),
    ];
    let profile: Vec<(f64, f64)> = shape.iter().map(|(r, y)| (r * radius, y * height)).collect();
    lathe(&profile, segments)
}

/// A plate, 2 cm high, its rim sharp.
pub(crate) fn plate(radius: f64, segments: usize) -> Mesh {
    let shape = [
        (0.55, 0.0),
        (0.55, 0.0),
        (0.62, 0.003),
        (1.0, 0.017),
        (1.0, 0.017),
        (1.0, 0.020),
        (1.0, 0.020),
        (0.66, 0.009),
        (0.58, 0.006),
        (0.0, 0.006),
    ];
    let profile: Vec<(f64, f64)> = shape.iter().map(|(r, y)| (r * radius, *y)).collect();
    lathe(&profile, segments)
}

/// A framed print of a sun over hills, 1 wide, its back at z = 0: frame, paper, hills, sun.
pub(crate) fn print(height: f64) -> [Mesh; 4] {
    let (w, h) = (0.5, height / 2.0);
    let hill = |base: f64, swell: f64, phase: f64, z: f64| {
        sheet(24, 1, move |u, t| {
            let (s, _) = sin_cos(u * 0.9 + phase);
            let top = base + swell * s;
            v((u - 0.5) * (2.0 * w - 0.2), -h + 0.1 + t * (top + h - 0.1), z)
        })
    };
    let sun = cylinder(0.2 * h, 0.002, 0.0, 40).moved(Affine::rotate(X, 0.25)).at(0.12, 0.38 * h, 0.0065);
    [
        frame(2.0 * w, height, 0.025, 0.025),
        quad(v(-w + 0.02, -h + 0.02, 0.006), X * (2.0 * w - 0.04), Y * (height - 0.04)),
        join([hill(0.05 * h, 0.16 * h, 0.1, 0.007), hill(-0.3 * h, 0.14 * h, 0.55, 0.0075)]),
        sun,
    ]
}

/// An apple-like fruit with a dimple, and its stalk.
pub(crate) fn fruit(radius: f64, segments: usize) -> (Mesh, Mesh) {
    let shape = [
        (0.0, 0.10),
        (0.12, 0.04),
        (0.30, 0.0),
        (0.58, 0.10),
        (0.84, 0.42),
        (1.0, 0.90),
        (0.98, 1.25),
        (0.80, 1.58),
        (0.52, 1.72),
        (0.26, 1.70),
        (0.10, 1.58),
        (0.0, 1.46),
    ];
    let profile: Vec<(f64, f64)> = shape.iter().map(|(r, y)| (r * radius, y * radius)).collect();
    let stalk = [v(0.0, 1.44, 0.0), v(0.03, 1.7, 0.0), v(0.12, 1.98, 0.04)].map(|p| p * radius);
    (lathe(&profile, segments), rod(&stalk, radius * 0.045, 6))
}
