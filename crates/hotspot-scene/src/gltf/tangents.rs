//! Tangents for normal maps (glTF 2.0, section 3.7.2.1): those of the file, else MikkTSpace's, which is what such maps are
//! baked for (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited").

use std::cell::Cell;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use bevy_mikktspace::{Geometry, Ops, TangentSpace};
use gltf::Semantic;

use super::document::Document;
use crate::error::{Result, limit};
use crate::geometry;
use crate::notes::Notes;
use crate::scene::Mesh;

/// Where a mesh takes its tangents from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct TangentSources {
    /// The attribute `TANGENT`, which counts only beside normals.
    pub(crate) accessor: Option<usize>,
    /// The normal map reads the mesh's second texture coordinates.
    pub(crate) second_uvs: bool,
}

impl TangentSources {
    pub(crate) fn of(primitive: &gltf::Primitive<'_>, second_uvs: bool) -> Self {
        let find = |semantic| primitive.get(&semantic).map(|accessor| accessor.index());
        let accessor = find(Semantic::Normals).and_then(|_| find(Semantic::Tangents));
        Self { accessor, second_uvs }
    }
}

/// The generator takes time by the square of the corners that meet in a vertex: at this sum of squares over a file, seconds.
/// Meshes made for normal maps stay far below (ten thousand triangles around one point are 10⁸).
const MOST_EFFORT: u64 = 200_000_000;

/// Of that sum, what every corner has free: where few meet in each vertex, time goes by the corners, which the memory limit
/// bounds. Six meet in a vertex of most meshes.
const FREE_EFFORT: u64 = 16;

/// Bytes that generating takes for each corner at most, while it runs and in what it leaves.
const BYTES_PER_CORNER: u64 = 400;

/// Gives a cleaned mesh what its normal map needs. Flat meshes get normals (and no shared vertices).
pub(crate) fn complete(
    doc: &Document<'_>,
    sources: TangentSources,
    mesh: &mut Mesh,
    path: &str,
    notes: &mut Notes,
) -> Result<()> {
    let uvs = if sources.second_uvs { &mesh.second_uvs } else { &mesh.uvs };
    if uvs.is_none() {
        mesh.tangents = None;
        notes.repair("no texture coordinates: normal map left out", path, 1);
        return Ok(());
    }
    if mesh.tangents.is_some() {
        return Ok(());
    }
    let corners = 3 * mesh.triangles.len() as u64;
    doc.budget.charge(corners, BYTES_PER_CORNER, path)?;
    if u32::try_from(corners.saturating_add(mesh.positions.len() as u64)).is_err() {
        return Err(limit(path, "the primitive has more than 2³² corners", "split the mesh"));
    }
    if mesh.normals.is_none() {
        flatten(mesh);
    }
    if !generate(mesh, sources.second_uvs, &doc.tangent_effort) {
        notes.repair("too many triangles meet in a vertex: normal map left out", path, 1);
    }
    geometry::mend_tangents(mesh, path, notes);
    Ok(())
}

/// Gives every triangle its own vertices and its geometric normal.
fn flatten(mesh: &mut Mesh) {
    let corners: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let normals = mesh.triangles.iter().flat_map(|triangle| {
        // Cleaned: every triangle has an area.
        let normal = geometry::cross(&mesh.positions, *triangle).and_then(geometry::unit);
        [normal.unwrap_or([0.0, 0.0, 1.0]); 3]
    });
    mesh.normals = Some(normals.collect());
    mesh.positions = pick(&mesh.positions, &corners);
    mesh.uvs = mesh.uvs.as_deref().map(|uvs| pick(uvs, &corners));
    mesh.second_uvs = mesh.second_uvs.as_deref().map(|uvs| pick(uvs, &corners));
    mesh.colors = mesh.colors.as_deref().map(|colors| pick(colors, &corners));
    for (triangle, first) in mesh.triangles.iter_mut().zip((0u32..).step_by(3)) {
        *triangle = [first, first + 1, first + 2];
    }
}

fn pick<T: Copy>(items: &[T], indices: &[u32]) -> Vec<T> {
    indices.iter().filter_map(|i| items.get(*i as usize).copied()).collect()
}

/// Generates tangents per corner; vertices whose corners disagree are split, the others stay shared. False where that
/// would take too long, after the effort `spent` on other meshes.
fn generate(mesh: &mut Mesh, second_uvs: bool, spent: &Cell<u64>) -> bool {
    let uvs = if second_uvs { mesh.second_uvs.as_deref() } else { mesh.uvs.as_deref() };
    let (Some(uvs), Some(normals)) = (uvs, mesh.normals.as_deref()) else { return true };
    let mut corners = Corners {
        positions: &mesh.positions,
        normals,
        uvs,
        triangles: &mesh.triangles,
        position_scale: scale(mesh.positions.iter().flatten()),
        uv_scale: scale(uvs.iter().flatten()),
        tangents: vec![[0.0; 4]; 3 * mesh.triangles.len()],
    };
    let free = FREE_EFFORT.saturating_mul(corners.tangents.len() as u64);
    let effort = spent.get().saturating_add(corners.effort().saturating_sub(free));
    if effort > MOST_EFFORT {
        return false;
    }
    spent.set(effort);
    if bevy_mikktspace::generate_tangents(&mut corners).is_err() {
        return false;
    }
    let tangents = corners.tangents;
    share(mesh, &tangents);
    true
}

/// A power of two that brings the largest number near 1. Tangents do not depend on the scale, but the generator multiplies
/// coordinates in f32, which overflows or vanishes for some.
fn scale<'n>(numbers: impl Iterator<Item = &'n f32>) -> f32 {
    let largest = numbers.fold(0.0f32, |largest, c| largest.max(c.abs()));
    if (1e-6..=1e6).contains(&largest) || largest <= 0.0 {
        return 1.0;
    }
    let (_, exponent) = libm::frexpf(largest);
    // Both within the range of normal numbers; what is smaller still than the smaller of them stays small.
    libm::ldexpf(1.0, (-exponent).clamp(-126, 126))
}

/// Stores the corners' tangents at the vertices.
fn share(mesh: &mut Mesh, corners: &[[f32; 4]]) {
    let vertices = mesh.positions.len();
    let mut first: Vec<Option<[f32; 4]>> = vec![None; vertices];
    // Vertex and bits of its tangent to the vertex split off for it.
    let mut split: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut origins: Vec<u32> = Vec::new();
    let mut added: Vec<[f32; 4]> = Vec::new();
    for (corner, tangent) in mesh.triangles.iter_mut().flatten().zip(corners) {
        let Some(known) = first.get_mut(*corner as usize) else { continue };
        match known {
            None => *known = Some(*tangent),
            Some(known) if known == tangent => {}
            Some(_) => {
                let origin = *corner;
                *corner = *split.entry((origin, tangent.map(f32::to_bits))).or_insert_with(|| {
                    origins.push(origin);
                    added.push(*tangent);
                    // Fits: checked by the caller.
                    (vertices + added.len() - 1) as u32
                });
            }
        }
    }
    fn extend<T: Copy>(items: &mut Vec<T>, origins: &[u32]) {
        let new = pick(items, origins);
        items.extend(new);
    }
    extend(&mut mesh.positions, &origins);
    for vectors in [&mut mesh.normals].into_iter().flatten() {
        extend(vectors, &origins);
    }
    for uvs in [&mut mesh.uvs, &mut mesh.second_uvs].into_iter().flatten() {
        extend(uvs, &origins);
    }
    for colors in [&mut mesh.colors].into_iter().flatten() {
        extend(colors, &origins);
    }
    // Vertices that no triangle uses have none; any will do, and the mender is not to count them.
    let unused = [1.0, 0.0, 0.0, 1.0];
    mesh.tangents = Some(first.into_iter().map(|known| known.unwrap_or(unused)).chain(added).collect());
}

/// A mesh as the generator sees it, and what it answers.
struct Corners<'m> {
    positions: &'m [[f32; 3]],
    normals: &'m [[f32; 3]],
    uvs: &'m [[f32; 2]],
    triangles: &'m [[u32; 3]],
    position_scale: f32,
    uv_scale: f32,
    tangents: Vec<[f32; 4]>,
}

impl Corners<'_> {
    /// The sum of the squares of how many corners agree in position, normal and texture coordinates.
    fn effort(&self) -> u64 {
        let key = |vertex: u32| {
            let mut hasher = DefaultHasher::new();
            let vertex = vertex as usize;
            let numbers = self.positions.get(vertex).into_iter().flatten();
            let numbers = numbers.chain(self.normals.get(vertex).into_iter().flatten());
            for number in numbers.chain(self.uvs.get(vertex).into_iter().flatten()) {
                // Zeros of either sign agree.
                (number + 0.0).to_bits().hash(&mut hasher);
            }
            hasher.finish()
        };
        let mut keys: Vec<u64> = self.triangles.iter().flatten().map(|vertex| key(*vertex)).collect();
        keys.sort_unstable();
        let runs = keys.chunk_by(|a, b| a == b).map(|run| run.len() as u64);
        runs.fold(0, |sum, run| sum.saturating_add(run.saturating_mul(run)))
    }

    fn at<const N: usize>(&self, items: &[[f32; N]], face: usize, corner: usize) -> [f32; N] {
        let vertex = self.triangles.get(face).and_then(|triangle| triangle.get(corner));
        vertex.and_then(|vertex| items.get(*vertex as usize)).copied().unwrap_or([0.0; N])
    }
}

/// The generator's mathematics: the same on all platforms.
struct Portable;

impl Ops for Portable {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        libm::acos(f64::from(x)) as f32
    }
}

impl Geometry<Portable> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.at(self.positions, face, vert).map(|c| c * self.position_scale)
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.at(self.normals, face, vert)
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.at(self.uvs, face, vert).map(|c| c * self.uv_scale)
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        // glTF's v goes down the image while the map's green points up: the bitangent is that of -v.
        let tangent = tangent_space.map_or([0.0; 4], |space| {
            let [x, y, z, w] = space.tangent_encoded();
            [x, y, z, -w]
        });
        if let Some(slot) = self.tangents.get_mut(3 * face + vert) {
            *slot = tangent;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The unit square facing +z with an upright image: v goes down.
    fn square() -> Mesh {
        Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            normals: Some(vec![[0.0, 0.0, 1.0]; 4]),
            uvs: Some(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn generated(mut mesh: Mesh, second_uvs: bool) -> (Mesh, u64) {
        if mesh.normals.is_none() {
            flatten(&mut mesh);
        }
        assert!(generate(&mut mesh, second_uvs, &Cell::new(0)));
        let mut notes = Notes::default();
        geometry::mend_tangents(&mut mesh, "m", &mut notes);
        let repairs = notes.into_lists().1.iter().map(|repair| repair.count).sum();
        for tangent in mesh.tangents.as_ref().unwrap() {
            let [x, y, z, w] = tangent.map(f64::from);
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-5 && w.abs() == 1.0, "{tangent:?}");
        }
        let count = mesh.positions.len();
        assert_eq!(mesh.normals.as_ref().unwrap().len(), count);
        assert_eq!(mesh.uvs.as_ref().unwrap().len(), count);
        assert_eq!(mesh.tangents.as_ref().unwrap().len(), count);
        assert!(mesh.triangles.iter().flatten().all(|i| (*i as usize) < count));
        (mesh, repairs)
    }

    #[test]
    fn tangents_point_right_and_bitangents_up_the_image() {
        let (mesh, repairs) = generated(square(), false);
        assert_eq!(mesh.tangents.unwrap(), [[1.0, 0.0, 0.0, 1.0]; 4]);
        assert_eq!((mesh.positions.len(), repairs), (4, 0));
        // The image turned by 90 degrees counter-clockwise: its right is the square's top.
        let mut turned = square();
        turned.uvs = Some(vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]);
        assert_eq!(generated(turned, false).0.tangents.unwrap(), [[0.0, 1.0, 0.0, 1.0]; 4]);
    }

    #[test]
    fn the_second_coordinates_decide_where_the_map_reads_them() {
        let mut mesh = square();
        // Mirrored: the image's right is the square's left.
        mesh.second_uvs = Some(vec![[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
        assert_eq!(generated(mesh.clone(), false).0.tangents.unwrap()[0], [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(generated(mesh, true).0.tangents.unwrap(), [[-1.0, 0.0, 0.0, -1.0]; 4]);
    }

    #[test]
    fn only_vertices_whose_corners_disagree_are_split() {
        // Two squares side by side; the image is mirrored about the edge that they share.
        let mut mesh = square();
        mesh.positions.extend([[2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]);
        mesh.normals = Some(vec![[0.0, 0.0, 1.0]; 6]);
        mesh.uvs.as_mut().unwrap().extend([[0.0, 1.0], [0.0, 0.0]]);
        mesh.colors = Some((0..6).map(|i| [i as f32 / 6.0; 4]).collect());
        mesh.triangles.extend([[1, 4, 5], [1, 5, 2]]);
        let before = mesh.clone();
        let (mesh, repairs) = generated(mesh, false);
        assert_eq!((mesh.positions.len(), repairs), (8, 0));
        let tangents = mesh.tangents.as_ref().unwrap();
        for (t, (triangle, old)) in mesh.triangles.iter().zip(&before.triangles).enumerate() {
            let wanted = if t < 2 { [1.0, 0.0, 0.0, 1.0] } else { [-1.0, 0.0, 0.0, -1.0] };
            for (new, old) in triangle.iter().zip(old) {
                let (new, old) = (*new as usize, *old as usize);
                assert_eq!(tangents[new], wanted);
                assert_eq!(mesh.positions[new], before.positions[old]);
                assert_eq!(mesh.colors.as_ref().unwrap()[new], before.colors.as_ref().unwrap()[old]);
            }
        }
    }

    #[test]
    fn without_normals_the_mesh_becomes_flat() {
        let mut mesh = square();
        mesh.normals = None;
        // The second triangle is lifted, so that the two face different ways.
        mesh.positions[3] = [0.0, 1.0, 1.0];
        let (mesh, _) = generated(mesh, false);
        assert_eq!(mesh.positions.len(), 6);
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
        let normals = mesh.normals.unwrap();
        assert_eq!(normals[..3], [[0.0, 0.0, 1.0]; 3]);
        let third = 1.0 / 3f32.sqrt();
        // Corners (0,0,0), (1,1,0), (0,1,1): (1, -1, 1) / √3.
        for (got, wanted) in normals[4].iter().zip([third, -third, third]) {
            assert!((got - wanted).abs() < 1e-6);
        }
        assert_eq!(mesh.positions[5], [0.0, 1.0, 1.0]);
        assert_eq!(mesh.uvs.unwrap()[5], [0.0, 0.0]);
    }

    #[test]
    fn coordinates_without_area_get_some_tangent_and_a_note() {
        let mut mesh = square();
        mesh.uvs = Some(vec![[0.5, 0.5]; 4]);
        let (mesh, repairs) = generated(mesh, false);
        assert!(repairs > 0);
        assert!(mesh.tangents.unwrap().iter().all(|[_, _, z, _]| z.abs() < 1e-6));
    }

    #[test]
    fn the_scale_of_positions_and_coordinates_does_not_matter() {
        for (position, uv) in [(1e-30f32, 1.0f32), (3e37, 1.0), (1.0, 1e-30), (1.0, 1e30), (1e-35, 1e35)] {
            let mut mesh = square();
            mesh.positions.iter_mut().flatten().for_each(|c| *c *= position);
            mesh.uvs.iter_mut().flatten().flatten().for_each(|c| *c *= uv);
            let (mesh, repairs) = generated(mesh, false);
            assert_eq!(repairs, 0, "{position} {uv}");
            for [x, _, _, w] in mesh.tangents.unwrap() {
                assert!((x - 1.0).abs() < 1e-5 && w == 1.0, "{position} {uv}: {x} {w}");
            }
        }
    }

    #[test]
    fn fans_that_would_take_minutes_are_left_out() {
        // Around one vertex, and stacked with vertices of their own.
        for shared in [true, false] {
            let fan = |count: u32| {
                let mut mesh = Mesh::default();
                for i in 0..count {
                    let first = if shared && i > 0 { 0 } else { mesh.positions.len() as u32 };
                    if !shared || i == 0 {
                        mesh.positions.push([0.0; 3]);
                    }
                    let next = mesh.positions.len() as u32;
                    let angle = i as f32 * 1e-3;
                    mesh.positions.extend([[angle.cos(), angle.sin(), 0.0], [0.0, 0.0, 1.0 + angle]]);
                    mesh.triangles.push([first, next, next + 1]);
                }
                mesh.normals = Some(vec![[0.0, 0.0, 1.0]; mesh.positions.len()]);
                mesh.uvs = Some(mesh.positions.iter().map(|p| [p[0], p[2]]).collect());
                mesh
            };
            let spent = Cell::new(0);
            assert!(!generate(&mut fan(20_000), false, &spent));
            assert!(generate(&mut fan(500), false, &spent));
            // What others have taken counts.
            let one = spent.get();
            assert!(one > 0);
            spent.set(MOST_EFFORT - one);
            assert!(generate(&mut fan(500), false, &spent));
            assert!(!generate(&mut fan(500), false, &spent));
        }
    }

    /// Whatever the mesh, the generator answers.
    #[test]
    fn random_meshes_never_panic() {
        let mut state = 7u64;
        let mut random = move |bound: u64| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (z ^ (z >> 31)) % bound
        };
        let palette = [0.0f32, 1.0, -1.0, 0.5, 1e-30, 1e30, -3e38, 1e-45, f32::MIN_POSITIVE, 2.0];
        for _ in 0..3000 {
            let vertices = 3 + random(8);
            let mut number = || palette[random(palette.len() as u64) as usize];
            let positions: Vec<[f32; 3]> = (0..vertices).map(|_| [number(), number(), number()]).collect();
            let uvs = (0..vertices).map(|_| [number(), number()]).collect();
            let normals = (0..vertices).map(|_| [number(), number(), number()]).collect();
            let triangles = (0..1 + random(12))
                .map(|_| [random(vertices) as u32, random(vertices) as u32, random(vertices) as u32])
                .collect();
            let flat = random(2) == 0;
            let mesh = Mesh {
                positions,
                uvs: Some(uvs),
                normals: (!flat).then_some(normals),
                triangles,
                ..Mesh::default()
            };
            let mesh = geometry::clean(mesh, "m", &mut Notes::default());
            if !mesh.triangles.is_empty() {
                generated(mesh, false);
            }
        }
    }
}
