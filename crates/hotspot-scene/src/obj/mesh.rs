//! Groups of polygons to meshes: equal corners become one vertex, polygons become triangles.

use std::collections::HashMap;

use super::parse::{Corner, Group, NONE, Parsed, Shading};
use super::polygon::Splitter;
use super::smooth::Smoother;
use crate::budget::Budget;
use crate::error::Result;
use crate::geometry;
use crate::notes::{Notes, cut};
use crate::scene::Mesh;

/// Bytes of a vertex while a mesh is built, besides its attributes: its corner in a growing list, an entry of a growing hash
/// table, and the clean-up's sum.
const VERTEX: u64 = 2 * 12 + 75 + 24;

/// A mesh whose normals wait for all other meshes, since smoothing groups reach across them.
pub(super) struct Unfinished {
    mesh: Mesh,
    shading: Shading,
    /// Of each vertex.
    corners: Vec<Corner>,
}

/// Turns groups into meshes.
pub(super) struct Builder<'a> {
    parsed: &'a Parsed,
    smoother: Smoother,
    splitter: Splitter,
    budget: &'a Budget,
}

impl<'a> Builder<'a> {
    pub(super) fn new(parsed: &'a Parsed, budget: &'a Budget) -> Self {
        Self { parsed, smoother: Smoother::new(parsed.smooth), splitter: Splitter::new(), budget }
    }

    /// The triangles and vertices of a group; what a mesh does not keep does not split its vertices. `textured` says whether
    /// it keeps texture coordinates.
    pub(super) fn build(&mut self, group: &Group, textured: bool, notes: &mut Notes) -> Result<Unfinished> {
        let name = cut(self.parsed.objects.get(group.object).map_or("", String::as_str)).to_owned();
        let count: u64 = group.arities.iter().map(|arity| u64::from(arity.saturating_sub(2))).sum();
        self.budget.charge(count, 12, &name)?;
        let mut triangles = Vec::with_capacity(count as usize);
        let (mut positions, mut corners) = (Vec::new(), Vec::new());
        let mut indices: HashMap<Corner, u32> = HashMap::new();
        let mut polygon = Vec::new();
        let mut rest = group.corners.as_slice();
        for arity in &group.arities {
            let Some((stated, after)) = rest.split_at_checked(*arity as usize) else { break };
            rest = after;
            polygon.clear();
            for corner in stated {
                let [position, uv, normal] = *corner;
                let corner = [position, if textured { uv } else { NONE }, normal];
                let corner =
                    if group.shading == Shading::Flat { [corner[0], corner[1], NONE] } else { corner };
                // Fewer than corners of a file, whose bytes are limited.
                let next = corners.len() as u32;
                let index = *indices.entry(corner).or_insert(next);
                if index == next {
                    self.budget.charge(1, VERTEX + 2 * 12, &name)?;
                    corners.push(corner);
                    positions.push(at(&self.parsed.positions, position));
                }
                polygon.push(index);
            }
            let first = triangles.len();
            self.splitter.split(&polygon, &positions, &mut triangles);
            if group.shading == Shading::Smooth {
                for triangle in triangles.get(first..).unwrap_or_default() {
                    let sums =
                        triangle.map(|i| corners.get(i as usize).map_or(NONE, |corner: &Corner| corner[2]));
                    self.smoother.add(triangle.map(|i| at(&positions, i)), sums);
                }
            }
        }
        drop(indices);
        let fans = std::mem::take(&mut self.splitter.fans);
        notes.repair("concave polygon split as a fan", &name, fans);
        let mut mesh = Mesh { name, positions, triangles, ..Mesh::default() };
        self.attributes(&mut mesh, group, &corners, textured, notes)?;
        Ok(Unfinished { mesh, shading: group.shading, corners })
    }

    /// Texture coordinates and colours.
    fn attributes(
        &self,
        mesh: &mut Mesh,
        group: &Group,
        corners: &[Corner],
        textured: bool,
        notes: &mut Notes,
    ) -> Result<()> {
        let vertices = corners.len() as u64;
        if textured {
            self.budget.charge(vertices, 8, &mesh.name)?;
            // OBJ counts from the lower edge of the image, the scene from the upper.
            let flipped = |uv: [f32; 2]| [uv[0], 1.0 - uv[1]];
            let uvs = corners.iter().map(|[_, uv, _]| match *uv {
                NONE => [0.0; 2],
                uv => flipped(at(&self.parsed.uvs, uv)),
            });
            mesh.uvs = Some(uvs.collect());
            let without = group.corners.iter().filter(|[_, uv, _]| *uv == NONE).count();
            notes.repair("corners without texture coordinates set to (0, 0)", &mesh.name, without as u64);
        }
        if !self.parsed.colors.is_empty() {
            let color = |corner: &Corner| self.parsed.colors.get(corner[0]);
            if corners.iter().any(|corner| color(corner) != [1.0; 3]) {
                self.budget.charge(vertices, 16, &mesh.name)?;
                let opaque = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
                mesh.colors = Some(corners.iter().map(|corner| opaque(color(corner))).collect());
            }
        }
        Ok(())
    }

    /// Fills in normals, and cleans the mesh.
    pub(super) fn finish(&self, unfinished: Unfinished, notes: &mut Notes) -> Result<Mesh> {
        let Unfinished { mut mesh, shading, corners } = unfinished;
        if shading != Shading::Flat {
            self.budget.charge(corners.len() as u64, 12, &mesh.name)?;
            let normals = corners.iter().map(|[_, _, normal]| match shading {
                Shading::Smooth => self.smoother.normal(*normal),
                _ => at(&self.parsed.normals, *normal),
            });
            mesh.normals = Some(normals.collect());
        }
        let element = mesh.name.clone();
        Ok(geometry::clean(mesh, &element, notes))
    }
}

/// An element whose index was checked.
fn at<T: Copy + Default>(items: &[T], index: u32) -> T {
    items.get(index as usize).copied().unwrap_or_default()
}
