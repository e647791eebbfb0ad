//! The vertices that cost is booked on: those of the scene's triangles in the world, and of the pieces that large triangles are split
//! into, since the cost of a wall does not vary from corner to corner alone.
//!
//! Triangles of one object and material share the vertices that they have in common. Instances have vertices of their own.

use crate::scene::RenderScene;
use hotspot_bvh::NO_INSTANCE;
use hotspot_cost::surface::SurfaceSums;
use std::collections::HashMap;
use std::ops::Range;

/// Most pieces that an edge is split into.
const MOST_SEGMENTS: u32 = 256;

/// Bytes per point of the triangles' grids: its index, a position, sums, and what the caller and the written file hold.
const BYTES_PER_POINT: u64 = 4 + 12 + SurfaceSums::BYTES + 3 * 28 + 24;

/// Why there is no mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// It would take more memory than granted.
    #[error(
        "{points} points on the surfaces need about {} MiB, more than the limit of {} MiB; split triangles less, simplify the scene, or \
         raise the limit",
        bytes >> 20,
        limit >> 20
    )]
    TooLarge {
        /// Points.
        points: u64,
        /// Bytes, estimated from above.
        bytes: u64,
        /// Bytes granted.
        limit: u64,
    },
    /// Nothing to book on.
    #[error("the scene has no triangles to bake on; choose another scene")]
    Empty,
}

/// The pieces that share an object and a material.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPart {
    /// Index into [`RenderScene::objects`].
    pub object: u32,
    /// Index into [`RenderScene::material_names`].
    pub material: u32,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its triangles as they are numbered in the mesh, before they are split.
    slots: Range<usize>,
    mirrored: bool,
}

/// See the module's documentation.
#[derive(Clone, Debug)]
pub struct SurfaceMesh {
    positions: Vec<[f32; 3]>,
    parts: Vec<MeshPart>,
    /// For each triangle where its grid begins and into how many segments its edges are split.
    slots: Vec<(u32, u32)>,
    /// Vertex of each grid point: row after row along the second corner's weight.
    grid: Vec<u32>,
    /// First triangle of each instance.
    instances: Vec<u32>,
}

/// Grid points of a triangle whose edges are split into `n` segments.
const fn points(n: u64) -> u64 {
    (n + 1) * (n + 2) / 2
}

/// Place of grid point (i, j) within its triangle's grid.
const fn place(n: u32, i: u32, j: u32) -> u32 {
    // Row r has n + 1 − r points; (j − 1) j is even.
    j * (n + 1) - j * j.saturating_sub(1) / 2 + i
}

impl SurfaceMesh {
    /// The mesh of a scene whose edges are at most 1/`detail` of the bounds' diagonal long (or split into `MOST_SEGMENTS`); 0: as they are.
    ///
    /// # Errors
    /// When the scene has no triangles, or what follows would take more than `limit` bytes.
    pub fn new(scene: &RenderScene, detail: u32, limit: Option<u64>) -> Result<Self, MeshError> {
        let geometry = &scene.geometry;
        let (min, max) = scene.bounds();
        let diagonal = length([0, 1, 2].map(|i| f64::from(max[i]) - f64::from(min[i])));
        let step =
            if detail > 0 && diagonal.is_finite() { diagonal / f64::from(detail) } else { f64::INFINITY };
        let segments = |corners: &[[f64; 3]; 3]| {
            let [a, b, c] = corners;
            let edge = |a: &[f64; 3], b: &[f64; 3]| length([0, 1, 2].map(|i| a[i] - b[i]));
            let longest = edge(a, b).max(edge(b, c)).max(edge(c, a));
            // Float to integer saturates; what is not a number becomes 0.
            ((longest / step).ceil() as u32).clamp(1, MOST_SEGMENTS)
        };
        let world = |corners: &[[f32; 3]; 3]| corners.map(|p| p.map(f64::from));

        // Counted before anything is made.
        let mut count = 0u64;
        for triangle in &geometry.triangles[..geometry.world_triangles()] {
            count += points(segments(&world(triangle)).into());
        }
        for placed in &geometry.placed {
            for triangle in &geometry.triangles[geometry.meshes[placed.mesh as usize].clone()] {
                count = count.saturating_add(points(segments(&carried(triangle, &placed.to_world)).into()));
            }
        }
        if count == 0 {
            return Err(MeshError::Empty);
        }
        let bytes = count.saturating_mul(BYTES_PER_POINT);
        let limit = limit.unwrap_or(u64::MAX).min(BYTES_PER_POINT * u64::from(u32::MAX));
        if bytes > limit {
            return Err(MeshError::TooLarge { points: count, bytes, limit });
        }

        let mut mesh = Self {
            positions: Vec::new(),
            parts: Vec::new(),
            slots: Vec::new(),
            grid: Vec::with_capacity(count as usize),
            instances: Vec::with_capacity(geometry.placed.len()),
        };
        let mut known = HashMap::new();
        let mut first = 0;
        while first < geometry.world_triangles() {
            let part = geometry.part_of[first];
            let mut end = first;
            mesh.open(geometry.parts[part as usize].object, geometry.parts[part as usize].material, false);
            known.clear();
            while end < geometry.world_triangles() && geometry.part_of[end] == part {
                let corners = world(&geometry.triangles[end]);
                mesh.add(&corners, segments(&corners), &mut known);
                end += 1;
            }
            mesh.close();
            first = end;
        }
        for placed in &geometry.placed {
            mesh.instances.push(mesh.slots.len() as u32);
            mesh.open(placed.part.object, placed.part.material, placed.is_mirrored());
            known.clear();
            for triangle in &geometry.triangles[geometry.meshes[placed.mesh as usize].clone()] {
                let corners = carried(triangle, &placed.to_world);
                mesh.add(&corners, segments(&corners), &mut known);
            }
            mesh.close();
        }
        Ok(mesh)
    }

    fn open(&mut self, object: u32, material: u32, mirrored: bool) {
        let (vertex, slot) = (self.positions.len(), self.slots.len());
        self.parts.push(MeshPart { object, material, vertices: vertex..vertex, slots: slot..slot, mirrored });
    }

    fn close(&mut self) {
        if let Some(part) = self.parts.last_mut() {
            part.vertices.end = self.positions.len();
            part.slots.end = self.slots.len();
        }
    }

    /// Adds a triangle. `known`: the vertices of its part, by the bits of their positions.
    fn add(&mut self, [a, b, c]: &[[f64; 3]; 3], n: u32, known: &mut HashMap<[u32; 3], u32>) {
        self.slots.push((self.grid.len() as u32, n));
        for j in 0..=n {
            for i in 0..=n - j {
                let weights = [n - i - j, i, j].map(f64::from);
                let position: [f32; 3] = core::array::from_fn(|axis| {
                    // On an edge one term is 0, and the sum of two does not depend on their order: neighbours agree.
                    let sum = weights[0] * a[axis] + weights[1] * b[axis] + weights[2] * c[axis];
                    // + 0.0, so that −0 is 0.
                    (sum / f64::from(n)) as f32 + 0.0
                });
                let vertex = *known.entry(position.map(f32::to_bits)).or_insert_with(|| {
                    self.positions.push(position);
                    self.positions.len() as u32 - 1
                });
                self.grid.push(vertex);
            }
        }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Their positions in the world.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The parts, one for each object and material; their vertices follow each other.
    pub fn parts(&self) -> &[MeshPart] {
        &self.parts
    }

    /// The triangles of a part, counter-clockwise seen from the front.
    pub fn triangles<'a>(&'a self, part: &'a MeshPart) -> impl Iterator<Item = [u32; 3]> + 'a {
        self.slots[part.slots.clone()].iter().flat_map(move |&(first, n)| {
            let at = move |i, j| self.grid[(first + place(n, i, j)) as usize];
            (0..n).flat_map(move |j| {
                (0..n - j).flat_map(move |i| {
                    let lower = [at(i, j), at(i + 1, j), at(i, j + 1)];
                    let upper = (i + j + 1 < n).then(|| [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                    let turn = move |[a, b, c]: [u32; 3]| if part.mirrored { [a, c, b] } else { [a, b, c] };
                    [Some(lower), upper].into_iter().flatten().map(turn)
                })
            })
        })
    }

    /// The vertices around a point of a triangle, and the weights of the second and the third of them. `weights`: those of the triangle's
    /// own second and third corner.
    #[inline]
    pub(super) fn locate(&self, instance: u32, primitive: u32, weights: [f32; 2]) -> ([u32; 3], [f32; 2]) {
        let base = if instance == NO_INSTANCE { 0 } else { self.instances[instance as usize] };
        let (first, n) = self.slots[(base + primitive) as usize];
        let at = |i, j| self.grid[(first + place(n, i, j)) as usize];
        let [x, y] = weights.map(|w| w * n as f32);
        let i = (x as u32).min(n - 1);
        let j = (y as u32).min(n - 1 - i);
        let (u, v) = ((x - i as f32).clamp(0.0, 1.0), (y - j as f32).clamp(0.0, 1.0));
        if u + v <= 1.0 || i + j + 1 == n {
            let sum = (u + v).max(1.0);
            ([at(i, j), at(i + 1, j), at(i, j + 1)], [u / sum, v / sum])
        } else {
            ([at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)], [1.0 - u, 1.0 - v])
        }
    }
}

fn length(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

fn carried(triangle: &[[f32; 3]; 3], to_world: &[[f64; 4]; 3]) -> [[f64; 3]; 3] {
    triangle.map(|p| {
        let p = p.map(f64::from);
        to_world.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    })
}
