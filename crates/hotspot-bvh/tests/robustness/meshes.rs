//! Closed convex meshes: vertices are shared, so neighbours agree on every bit of them.

use crate::support::{Rng, Triangle, along, narrow, wide};
use std::collections::HashMap;

/// A closed convex mesh around `centre`; its faces are counter-clockwise from outside.
pub(crate) struct Mesh {
    pub(crate) name: &'static str,
    pub(crate) vertices: Vec<[f32; 3]>,
    pub(crate) faces: Vec<[usize; 3]>,
    pub(crate) centre: [f64; 3],
    /// `centre` ± this lies well inside.
    pub(crate) inside: [f64; 3],
}

impl Mesh {
    /// Unit vertices, scaled by `radius` and rounded once.
    fn new(
        name: &'static str,
        unit: &[[f64; 3]],
        faces: Vec<[usize; 3]>,
        centre: f64,
        radius: [f64; 3],
        inside: f64,
    ) -> Self {
        let centre = [centre, 0.75 * centre, -centre];
        let place = |p: &[f64; 3]| narrow(core::array::from_fn(|i| centre[i] + radius[i] * p[i]));
        let vertices = unit.iter().map(place).collect();
        Self { name, vertices, faces, centre, inside: radius.map(|r| r * inside) }
    }

    pub(crate) fn triangles(&self) -> Vec<Triangle> {
        self.faces.iter().map(|f| f.map(|v| self.vertices[v])).collect()
    }

    pub(crate) fn inner_point(&self, rng: &mut Rng) -> [f32; 3] {
        let p = rng.cube();
        narrow(core::array::from_fn(|i| self.centre[i] + self.inside[i] * p[i]))
    }

    pub(crate) fn is_inner(&self, axis: usize, coordinate: f32) -> bool {
        (f64::from(coordinate) - self.centre[axis]).abs() <= self.inside[axis]
    }
}

pub(crate) fn icosphere(level: u32, centre: f64, radius: f64) -> Mesh {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        vertices.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    // The faces of the icosahedron: all triples of vertices at edge length 2.
    let near = |a: usize, b: usize| {
        let d = along(vertices[a], vertices[b], -1.0);
        (d.iter().map(|c| c * c).sum::<f64>() - 4.0).abs() < 1e-9
    };
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    faces.push([a, b, c]);
                }
            }
        }
    }
    for _ in 0..level {
        let mut middle = HashMap::new();
        let mut midpoint = |a: usize, b: usize| {
            *middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                vertices.push(along(vertices[a], vertices[b], 1.0).map(|c| c / 2.0));
                vertices.len() - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let (ab, bc, ca) = (midpoint(a, b), midpoint(b, c), midpoint(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = finer;
        for v in &mut vertices {
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            *v = v.map(|c| c / length * (1.0 + g * g).sqrt());
        }
    }
    let unit: Vec<_> = vertices.iter().map(|v| v.map(|c| c / (1.0 + g * g).sqrt())).collect();
    outward(Mesh::new("icosphere", &unit, faces, centre, [radius; 3], 0.4))
}

/// With poles, and thin triangles around them.
pub(crate) fn uv_sphere(rings: usize, segments: usize, centre: f64, radius: f64) -> Mesh {
    let mut unit = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let theta = core::f64::consts::PI * ring as f64 / rings as f64;
        for segment in 0..segments {
            let phi = core::f64::consts::TAU * segment as f64 / segments as f64;
            unit.push([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]);
        }
    }
    let at = |ring: usize, segment: usize| match ring {
        0 => 0,
        r if r == rings => 1,
        r => 2 + (r - 1) * segments + segment % segments,
    };
    let mut faces = Vec::new();
    for ring in 0..rings {
        for s in 0..segments {
            let (a, b, c, d) = (at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1));
            if b != c {
                faces.push([a, b, c]);
            }
            if a != d {
                faces.push([a, c, d]);
            }
        }
    }
    outward(Mesh::new("uv sphere", &unit, faces, centre, [radius; 3], 0.4))
}

/// A box of half extents `radius`, each face a grid of `cells` × `cells` squares of two triangles: many boxes without
/// thickness.
pub(crate) fn grid_box(name: &'static str, cells: i32, centre: f64, radius: [f64; 3]) -> Mesh {
    let mut index = HashMap::new();
    let mut unit = Vec::new();
    let mut faces = Vec::new();
    for axis in 0..3 {
        for side in [0, cells] {
            for row in 0..cells {
                for column in 0..cells {
                    let corner = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
                        let mut key = [side; 3];
                        key[(axis + 1) % 3] = column + i;
                        key[(axis + 2) % 3] = row + j;
                        *index.entry(key).or_insert_with(|| {
                            unit.push(key.map(|k| 2.0 * f64::from(k) / f64::from(cells) - 1.0));
                            unit.len() - 1
                        })
                    });
                    let [a, b, c, d] = corner;
                    faces.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    outward(Mesh::new(name, &unit, faces, centre, radius, 0.5))
}

/// Turns every face counter-clockwise seen from outside.
fn outward(mut mesh: Mesh) -> Mesh {
    for face in &mut mesh.faces {
        let t = face.map(|v| mesh.vertices[v]);
        let from_centre = crate::support::sub(wide(t[0]), mesh.centre);
        if crate::support::dot(crate::support::cross_of(&t), from_centre) < 0.0 {
            face.swap(1, 2);
        }
    }
    mesh
}

/// Every directed edge occurs once, and its reverse too.
#[test]
fn meshes_are_closed() {
    for mesh in [icosphere(2, 0.0, 1.0), uv_sphere(8, 12, 0.0, 1.0), grid_box("box", 3, 0.0, [1.0; 3])] {
        let mut edges = std::collections::HashSet::new();
        for f in &mesh.faces {
            for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
                assert!(edges.insert((a, b)), "{}", mesh.name);
            }
        }
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "{}", mesh.name);
        assert_eq!(mesh.vertices.len() + mesh.faces.len(), edges.len() / 2 + 2, "{}", mesh.name);
    }
}
