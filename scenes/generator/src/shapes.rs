//! Building blocks: triangle meshes with normals, in metres, y up, counter-clockwise seen from outside.
//!
//! Smooth shapes share vertices and average the normals of the faces around them; flat ones repeat vertices.

use crate::math::{Affine, Vec3, X, Y, Z, sin_cos, v};

/// Triangles with one normal per vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Some part is a sheet, so the mesh encloses no volume.
    pub(crate) open: bool,
}

impl Mesh {
    pub(crate) fn add(&mut self, other: &Mesh) {
        let base = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
        self.open |= other.open;
    }

    pub(crate) fn moved(mut self, map: Affine) -> Mesh {
        for p in &mut self.positions {
            *p = map.point(*p);
        }
        for n in &mut self.normals {
            *n = map.normal(*n);
        }
        if map.determinant() < 0.0 {
            for t in &mut self.triangles {
                t.swap(1, 2);
            }
        }
        self
    }

    pub(crate) fn at(self, x: f64, y: f64, z: f64) -> Mesh {
        self.moved(Affine::translate(v(x, y, z)))
    }

    /// The same surface seen from its other side.
    pub(crate) fn flipped(mut self) -> Mesh {
        for n in &mut self.normals {
            *n = -*n;
        }
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        self
    }

    /// Gives every vertex the area-weighted mean normal of its triangles.
    fn smooth(mut self) -> Mesh {
        self.normals = vec![Vec3::default(); self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.positions[i as usize]);
            let n = (b - a).cross(c - a);
            for i in t {
                self.normals[*i as usize] += n;
            }
        }
        for n in &mut self.normals {
            *n = n.unit();
        }
        self
    }

    #[cfg(test)]
    pub(crate) fn volume(&self) -> f64 {
        let p = |i: u32| self.positions[i as usize];
        self.triangles.iter().map(|t| p(t[0]).dot(p(t[1]).cross(p(t[2]))) / 6.0).sum()
    }
}

/// All of them in one mesh.
pub(crate) fn join(parts: impl IntoIterator<Item = Mesh>) -> Mesh {
    let mut all = Mesh::default();
    for part in parts {
        all.add(&part);
    }
    all
}

/// A flat convex polygon, counter-clockwise seen from its front.
pub(crate) fn polygon(points: &[Vec3]) -> Mesh {
    let normal = (points[1] - points[0]).cross(points[2] - points[0]).unit();
    Mesh {
        positions: points.to_vec(),
        normals: vec![normal; points.len()],
        triangles: (2..points.len() as u32).map(|i| [0, i - 1, i]).collect(),
        open: true,
    }
}

/// A parallelogram: `corner`, `corner + a`, `corner + a + b`, `corner + b`; its front is along a × b.
pub(crate) fn quad(corner: Vec3, a: Vec3, b: Vec3) -> Mesh {
    polygon(&[corner, corner + a, corner + a + b, corner + b])
}

/// An axis-aligned box with sharp edges between two corners.
pub(crate) fn cuboid(lo: Vec3, hi: Vec3) -> Mesh {
    let d = hi - lo;
    let (x, y, z) = (X * d.x, Y * d.y, Z * d.z);
    let mut mesh = join([
        quad(lo, y, x),
        quad(lo, z, y),
        quad(lo, x, z),
        quad(lo + z, x, y),
        quad(lo + x, y, z),
        quad(lo + y, z, x),
    ]);
    mesh.open = false;
    mesh
}

/// A box of the given size, standing on y = 0, centred in x and z.
pub(crate) fn block(width: f64, height: f64, depth: f64) -> Mesh {
    cuboid(v(-width / 2.0, 0.0, -depth / 2.0), v(width / 2.0, height, depth / 2.0))
}

/// A box centred at the origin whose edges are rounded by `radius` in `steps` steps.
pub(crate) fn rounded_box(size: Vec3, radius: f64, steps: usize) -> Mesh {
    let core = v(size.x / 2.0 - radius, size.y / 2.0 - radius, size.z / 2.0 - radius);
    // Directions along one edge of a cube; 0 comes twice: the flat part of the face lies between its two.
    let mut line: Vec<(f64, f64)> = (0..=steps).map(|i| (i as f64 / steps as f64 - 1.0, -1.0)).collect();
    line.extend((0..=steps).map(|i| (i as f64 / steps as f64, 1.0)));
    // Cubed sphere: the tangent spreads the directions evenly.
    let spread = |u: f64| {
        let (s, c) = sin_cos(u / 8.0);
        s / c
    };
    let mut mesh = Mesh::default();
    for (w, a, b) in [(X, Y, Z), (Y, Z, X), (Z, X, Y), (-X, Z, Y), (-Y, X, Z), (-Z, Y, X)] {
        let base = mesh.positions.len() as u32;
        let n = line.len() as u32;
        for (u, su) in &line {
            for (t, st) in &line {
                let d = w + a * spread(*u) + b * spread(*t);
                let side = w + a * *su + b * *st;
                let normal = d.unit();
                mesh.positions.push(v(side.x * core.x, side.y * core.y, side.z * core.z) + normal * radius);
                mesh.normals.push(normal);
            }
        }
        for i in 0..n - 1 {
            for j in 0..n - 1 {
                let k = base + i * n + j;
                mesh.triangles.push([k, k + n, k + n + 1]);
                mesh.triangles.push([k, k + n + 1, k + 1]);
            }
        }
    }
    mesh.close_seams()
}

impl Mesh {
    /// Snaps positions to a grid of 2^-30 m, so that the same point computed in two ways is the same.
    fn close_seams(mut self) -> Mesh {
        let grid = (1u64 << 30) as f64;
        let snap = |x: f64| (x * grid + 0.5).floor() / grid;
        for p in &mut self.positions {
            *p = v(snap(p.x), snap(p.y), snap(p.z));
        }
        self
    }
}

/// A closed skin over `rings` of equal length (counter-clockwise around the direction of travel) between two tips.
fn skin(first: Vec3, rings: &[Vec<Vec3>], last: Vec3) -> Mesh {
    let n = rings[0].len() as u32;
    let mut mesh = Mesh::default();
    mesh.positions.push(first);
    mesh.positions.extend(rings.iter().flatten());
    mesh.positions.push(last);
    let end = mesh.positions.len() as u32 - 1;
    let at = |ring: u32, j: u32| 1 + ring * n + j % n;
    for j in 0..n {
        mesh.triangles.push([0, at(0, j + 1), at(0, j)]);
    }
    for r in 0..rings.len() as u32 - 1 {
        for j in 0..n {
            mesh.triangles.push([at(r, j), at(r, j + 1), at(r + 1, j + 1)]);
            mesh.triangles.push([at(r, j), at(r + 1, j + 1), at(r + 1, j)]);
        }
    }
    for j in 0..n {
        mesh.triangles.push([end, at(rings.len() as u32 - 1, j), at(rings.len() as u32 - 1, j + 1)]);
    }
    mesh.smooth()
}

/// A sphere about the origin; `segments` around, half as many from pole to pole.
pub(crate) fn sphere(radius: f64, segments: usize) -> Mesh {
    let stacks = (segments / 2).max(3);
    let rings: Vec<Vec<Vec3>> = (1..stacks)
        .map(|i| {
            let (s, c) = sin_cos(0.5 * i as f64 / stacks as f64);
            circle(segments, |ca, sa| v(ca * s, -c, -sa * s) * radius)
        })
        .collect();
    let mut mesh = skin(Y * -radius, &rings, Y * radius);
    for (n, p) in mesh.normals.iter_mut().zip(&mesh.positions) {
        *n = p.unit();
    }
    mesh
}

/// `n` points from the cosines and sines of a circle.
fn circle(n: usize, point: impl Fn(f64, f64) -> Vec3) -> Vec<Vec3> {
    (0..n)
        .map(|j| {
            let (s, c) = sin_cos(j as f64 / n as f64);
            point(c, s)
        })
        .collect()
}

/// A solid of revolution about y from a profile of (radius, height), bottom to top, ends closed on the axis.
/// A profile point given twice makes a sharp edge.
pub(crate) fn lathe(profile: &[(f64, f64)], segments: usize) -> Mesh {
    let mut points = profile.to_vec();
    if points[0].0 > 0.0 {
        points.insert(0, (0.0, points[0].1));
    }
    let top = points[points.len() - 1];
    if top.0 > 0.0 {
        points.push((0.0, top.1));
    }
    let mut mesh = Mesh::default();
    let mut start = 0;
    for i in 0..points.len() {
        let sharp = i + 1 < points.len() && points[i] == points[i + 1];
        if sharp || i + 1 == points.len() {
            mesh.add(&lathe_sheet(&points[start..=i], segments));
            start = i + 1;
        }
    }
    mesh.open = false;
    mesh
}

fn lathe_sheet(profile: &[(f64, f64)], segments: usize) -> Mesh {
    let mut mesh = Mesh { open: true, ..Mesh::default() };
    let n = segments as u32;
    let mut starts: Vec<(u32, bool)> = Vec::new();
    for (r, y) in profile {
        starts.push((mesh.positions.len() as u32, *r == 0.0));
        if *r == 0.0 {
            mesh.positions.push(Y * *y);
        } else {
            mesh.positions.extend(circle(segments, |c, s| v(c * r, *y, -s * r)));
        }
    }
    for pair in starts.windows(2) {
        let ((a, a_tip), (b, b_tip)) = (pair[0], pair[1]);
        for j in 0..n {
            let k = (j + 1) % n;
            if !a_tip {
                mesh.triangles.push([a + j, a + k, if b_tip { b } else { b + k }]);
            }
            if !b_tip {
                mesh.triangles.push([if a_tip { a } else { a + j }, b + k, b + j]);
            }
        }
    }
    mesh.smooth()
}

/// A cylinder on y = 0 with its edges bevelled by `bevel`.
pub(crate) fn cylinder(radius: f64, height: f64, bevel: f64, segments: usize) -> Mesh {
    let r = radius;
    let mut profile = vec![(r, 0.0), (r, 0.0), (r, height), (r, height)];
    if bevel > 0.0 {
        let b = bevel;
        profile = vec![
            (r - b, 0.0),
            (r - b, 0.0),
            (r - 0.3 * b, 0.3 * b),
            (r, b),
            (r, height - b),
            (r - 0.3 * b, height - 0.3 * b),
            (r - b, height),
            (r - b, height),
        ];
    }
    lathe(&profile, segments)
}

/// One station of a tube: centre, half-width across (`side`) and half-height (`up`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    pub(crate) centre: Vec3,
    pub(crate) side: f64,
    pub(crate) up: f64,
}

/// The frame carried along a tube at a station.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) station: Station,
    pub(crate) forward: Vec3,
    pub(crate) side: Vec3,
    pub(crate) up: Vec3,
}

impl Frame {
    /// The point of the ring at `turns` (0 = side, a quarter = up).
    pub(crate) fn point(&self, turns: f64) -> Vec3 {
        let (s, c) = sin_cos(turns);
        self.station.centre + self.side * (c * self.station.side) + self.up * (s * self.station.up)
    }

    /// The ellipse's outward normal there.
    pub(crate) fn outward(&self, turns: f64) -> Vec3 {
        let (s, c) = sin_cos(turns);
        (self.side * (c * self.station.up) + self.up * (s * self.station.side)).unit()
    }
}

/// Frames along the stations, turned as little as possible, the first with its `up` towards the given hint.
pub(crate) fn frames(stations: &[Station], hint: Vec3) -> Vec<Frame> {
    let last = stations.len() - 1;
    let mut up = hint;
    (0..=last)
        .map(|i| {
            let forward = (stations[(i + 1).min(last)].centre - stations[i.saturating_sub(1)].centre).unit();
            let side = forward.cross(up).unit();
            up = side.cross(forward).unit();
            Frame { station: stations[i], forward, side, up }
        })
        .collect()
}

/// A closed tube through the stations; its ends are rounded by two extra rings.
pub(crate) fn tube(stations: &[Station], hint: Vec3, segments: usize) -> Mesh {
    let frames = frames(stations, hint);
    let (first, last) = (frames[0], frames[frames.len() - 1]);
    let bulge = |f: &Frame, along: f64, shrink: f64| Frame {
        station: Station {
            centre: f.station.centre + f.forward * (along * f.station.side.min(f.station.up)),
            side: f.station.side * shrink,
            up: f.station.up * shrink,
        },
        ..*f
    };
    let mut all = vec![bulge(&first, -0.8, 0.6)];
    all.extend(&frames);
    all.push(bulge(&last, 0.8, 0.6));
    // Counter-clockwise around `forward`: from side to up is clockwise there, since side = forward x up.
    let rings: Vec<Vec<Vec3>> =
        all.iter().map(|f| (0..segments).map(|j| f.point(-(j as f64) / segments as f64)).collect()).collect();
    skin(bulge(&first, -1.0, 0.0).station.centre, &rings, bulge(&last, 1.0, 0.0).station.centre)
}

/// A spike: a tapered tube from a base (sunk a little) to a sharp tip, bent through `via`.
pub(crate) fn spike(base: Vec3, via: Vec3, tip: Vec3, radius: f64, segments: usize, rings: usize) -> Mesh {
    let at = |t: f64| base * ((1.0 - t) * (1.0 - t)) + via * (2.0 * t * (1.0 - t)) + tip * (t * t);
    let station = |i: usize| {
        let t = i as f64 / (rings + 1) as f64;
        Station { centre: at(t), side: radius * (1.0 - t), up: radius * (1.0 - t) }
    };
    let stations: Vec<Station> = (0..=rings + 1).map(station).collect();
    let hint = if (tip - base).unit().y.abs() < 0.9 { Y } else { X };
    let rings: Vec<Vec<Vec3>> = frames(&stations, hint)[..=rings]
        .iter()
        .map(|f| (0..segments).map(|j| f.point(-(j as f64) / segments as f64)).collect())
        .collect();
    skin(base - (at(0.1) - base).unit() * (radius * 0.8), &rings, tip)
}

/// A tube of constant radius along a polyline.
pub(crate) fn rod(points: &[Vec3], radius: f64, segments: usize) -> Mesh {
    let stations: Vec<Station> =
        points.iter().map(|c| Station { centre: *c, side: radius, up: radius }).collect();
    let d = (points[1] - points[0]).unit();
    tube(&stations, if d.y.abs() < 0.9 { Y } else { X }, segments)
}

/// A sheet over the unit square, cut into `nu` x `nv`; its front is along du x dv.
pub(crate) fn sheet(nu: usize, nv: usize, point: impl Fn(f64, f64) -> Vec3) -> Mesh {
    let mut mesh = Mesh { open: true, ..Mesh::default() };
    for i in 0..=nu {
        for j in 0..=nv {
            mesh.positions.push(point(i as f64 / nu as f64, j as f64 / nv as f64));
        }
    }
    let row = nv as u32 + 1;
    for i in 0..nu as u32 {
        for j in 0..nv as u32 {
            let k = i * row + j;
            mesh.triangles.push([k, k + row, k + row + 1]);
            mesh.triangles.push([k, k + row + 1, k + 1]);
        }
    }
    mesh.smooth()
}

/// A wall in the plane z = 0, front along +z, from (0, 0) to (width, height), with a rectangular hole
/// (x0, y0, x1, y1) whose reveals go back by `depth`.
pub(crate) fn wall_with_opening(width: f64, height: f64, hole: [f64; 4], depth: f64) -> Mesh {
    let [x0, y0, x1, y1] = hole;
    let panel = |a: f64, b: f64, c: f64, d: f64| quad(v(a, b, 0.0), X * (c - a), Y * (d - b));
    let back = Z * -depth;
    let mut parts = vec![
        panel(0.0, 0.0, x0, height),
        panel(x1, 0.0, width, height),
        panel(x0, y1, x1, height),
        quad(v(x0, y0, 0.0), back, Y * (y1 - y0)),
        quad(v(x1, y0, 0.0), Y * (y1 - y0), back),
        quad(v(x0, y1, 0.0), back, X * (x1 - x0)),
    ];
    if y0 > 0.0 {
        parts.push(panel(x0, 0.0, x1, y0));
        parts.push(quad(v(x0, y0, 0.0), X * (x1 - x0), back));
    }
    join(parts)
}

/// Every directed edge meets as many of the opposite direction.
#[cfg(test)]
pub(crate) fn watertight(mesh: &Mesh) -> bool {
    let key = |i: u32| mesh.positions[i as usize].array().map(|x| (x as f32 + 0.0).to_bits());
    let mut edges: std::collections::HashMap<_, i32> = std::collections::HashMap::new();
    for t in &mesh.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let (a, b) = (key(a), key(b));
            if a < b {
                *edges.entry((a, b)).or_default() += 1;
            } else {
                *edges.entry((b, a)).or_default() -= 1;
            }
        }
    }
    edges.values().all(|n| *n == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Affine;

    fn check(name: &str, mesh: &Mesh, volume: f64, tolerance: f64) {
        assert!(!mesh.open, "{name} is open");
        assert!(watertight(mesh), "{name} leaks");
        let found = mesh.volume();
        assert!((found / volume - 1.0).abs() < tolerance, "{name}: volume {found}, expected {volume}");
        for n in &mesh.normals {
            assert!((n.length() - 1.0).abs() < 1e-9, "{name}: normal {n:?}");
        }
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let g = (b - a).cross(c - a);
            assert!(g.length() > 0.0, "{name}: flat triangle");
            for i in t {
                assert!(g.dot(mesh.normals[*i as usize]) > 0.0, "{name}: normal against the winding");
            }
        }
    }

    #[test]
    fn solids_are_closed_and_face_outwards() {
        let pi = std::f64::consts::PI;
        check("cuboid", &cuboid(v(0.0, 0.0, 0.0), v(1.0, 2.0, 3.0)), 6.0, 1e-9);
        check("sphere", &sphere(1.0, 64), 4.0 / 3.0 * pi, 0.01);
        check("cylinder", &cylinder(1.0, 2.0, 0.0, 64), 2.0 * pi, 0.01);
        check("bevelled cylinder", &cylinder(1.0, 2.0, 0.05, 64), 2.0 * pi, 0.01);
        check("rounded box", &rounded_box(v(1.0, 2.0, 3.0), 0.05, 3), 6.0, 0.01);
        check("cone", &lathe(&[(1.0, 0.0), (1.0, 0.0), (0.0, 3.0)], 64), pi, 0.01);
        check("rod", &rod(&[v(0.0, 0.0, 0.0), X * 5.0, X * 10.0], 0.1, 48), 10.0 * 0.01 * pi, 0.02);
        let bent = rod(&[v(0.0, 0.0, 0.0), v(1.0, 0.2, 0.0), v(2.0, 0.0, 0.4)], 0.1, 24);
        check("bent rod", &bent, 2.1 * 0.01 * pi, 0.05);
        let mirrored = bent.moved(Affine::scale(v(1.0, 1.0, -1.0)));
        check("mirrored rod", &mirrored, 2.1 * 0.01 * pi, 0.05);
        check("spike", &spike(v(0.0, 0.0, 0.0), Y * 0.5, Y, 0.1, 32, 4), 0.01 * pi / 3.0, 0.1);
    }

    #[test]
    fn sheets_face_where_they_say() {
        assert_eq!(quad(v(0.0, 0.0, 0.0), X, Y).normals[0], Z);
        assert_eq!(sheet(2, 2, |u, w| v(u, w, 0.0)).normals[4], Z);
        for n in &wall_with_opening(4.0, 3.0, [1.0, 1.0, 2.0, 2.0], 0.2).normals[..12] {
            assert_eq!(*n, Z);
        }
        // The reveals look into the hole.
        let wall = wall_with_opening(4.0, 3.0, [1.0, 1.0, 2.0, 2.0], 0.2);
        let centre = v(1.5, 1.5, -0.1);
        for (p, n) in wall.positions.iter().zip(&wall.normals).filter(|(_, n)| **n != Z) {
            assert!((centre - *p).dot(*n) > 0.0, "{n:?}");
        }
    }
}
