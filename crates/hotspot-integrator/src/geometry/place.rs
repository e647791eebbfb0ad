//! From the scene's instances to [`Geometry`]: most are written out in world space; a mesh that appears often is stored once.

use super::point::least_height;
use super::{Geometry, Part, Placed};
use glam::{DVec3, Vec2};
use hotspot_bvh::Bvh;
use hotspot_scene::{Instance, Mesh, Scene};

/// Which meshes are stored once, however often they appear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Instancing {
    /// Those whose copies would take much memory (more than [`COPIES_THAT_PAY`] triangles beyond the first); a copy traces
    /// faster than an instance.
    #[default]
    Auto,
    /// All that appear twice or more.
    Always,
    /// None.
    Never,
}

/// Triangles saved from which on [`Instancing::Auto`] stores a mesh once: some 25 MB of triangles and tree.
pub const COPIES_THAT_PAY: u64 = 1 << 18;

/// Triangles saved in all meshes together from which on [`Instancing::Auto`] stores every mesh once that appears twice.
const ALL_COPIES_THAT_PAY: u64 = 1 << 22;

/// Bytes that a triangle takes, at most: corners, indices, its share of the tree, and what building takes for a moment.
const BYTES_PER_TRIANGLE: u64 = 400;
/// The same of an instance.
const BYTES_PER_INSTANCE: u64 = 800;

/// What was dropped while placing the geometry.
#[derive(Clone, Debug, Default)]
pub(crate) struct Dropped {
    /// (object, triangles without area or with a coordinate that is not finite)
    pub(crate) triangles: Vec<(u32, u64)>,
}

fn transform(m: &[[f64; 4]; 3], p: [f32; 3]) -> [f32; 3] {
    let p = p.map(f64::from);
    m.map(|row| (row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]) as f32)
}

/// Cofactors of the linear part, and the determinant: they take normals to the world up to scale, for any matrix, also
/// singular ones; a mirroring matrix turns them over, which is undone by the sign of the determinant.
pub(super) fn cofactors(m: &[[f64; 4]; 3]) -> ([[f64; 3]; 3], f64) {
    let c = |a: usize, b: usize, i: usize, j: usize| m[a][i] * m[b][j] - m[a][j] * m[b][i];
    let rows = [
        [c(1, 2, 1, 2), c(1, 2, 2, 0), c(1, 2, 0, 1)],
        [c(2, 0, 1, 2), c(2, 0, 2, 0), c(2, 0, 0, 1)],
        [c(0, 1, 1, 2), c(0, 1, 2, 0), c(0, 1, 0, 1)],
    ];
    let determinant = (0..3).map(|i| m[0][i] * rows[0][i]).sum();
    (rows, determinant)
}

fn has_area(t: &[[f32; 3]; 3]) -> bool {
    if !t.iter().flatten().all(|c| c.is_finite()) {
        return false;
    }
    let [a, b, c] = t.map(|v| DVec3::from_array(v.map(f64::from)));
    (b - a).cross(c - a) != DVec3::ZERO
}

/// For each instance whether its mesh is stored once.
fn stored_once(scene: &Scene, instancing: Instancing) -> Vec<bool> {
    let mut uses = vec![0u64; scene.meshes.len()];
    if instancing == Instancing::Never {
        return vec![false; scene.instances.len()];
    }
    for instance in &scene.instances {
        uses[instance.mesh as usize] += 1;
    }
    let triangles = |mesh: u32| scene.meshes[mesh as usize].triangles.len() as u64;
    let saved = |mesh: u32, uses: u64| uses.saturating_sub(1).saturating_mul(triangles(mesh));
    let in_all = uses.iter().enumerate().fold(0u64, |sum, (i, &n)| sum.saturating_add(saved(i as u32, n)));
    let pays = |mesh: u32, uses: u64| match instancing {
        Instancing::Never => false,
        Instancing::Always => uses > 1,
        // Many small meshes add up; the smallest take no more room than an instance.
        Instancing::Auto if in_all > ALL_COPIES_THAT_PAY => uses > 1 && triangles(mesh) > 8,
        Instancing::Auto => saved(mesh, uses) > COPIES_THAT_PAY,
    };
    let candidates: Vec<bool> = scene.instances.iter().map(|i| pays(i.mesh, uses[i.mesh as usize])).collect();
    if !candidates.contains(&true) {
        return candidates;
    }
    let bounds: Vec<_> = scene.meshes.iter().map(bounds).collect();
    let can = |instance: &Instance| {
        // Light sampling wants the triangles of emitters in the world.
        let material = &scene.materials[instance.material as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let (min, max) = bounds[instance.mesh as usize];
        !material.is_emissive() && !mesh.triangles.is_empty() && Bvh::can_place(min, max, &instance.to_world)
    };
    // Those that cannot be stored once do not make it pay for the others.
    let once: Vec<bool> = scene.instances.iter().zip(candidates).map(|(i, pays)| pays && can(i)).collect();
    let mut uses = vec![0u64; scene.meshes.len()];
    for (instance, _) in scene.instances.iter().zip(&once).filter(|(_, once)| **once) {
        uses[instance.mesh as usize] += 1;
    }
    scene.instances.iter().zip(once).map(|(i, once)| once && pays(i.mesh, uses[i.mesh as usize])).collect()
}

/// Corners of a mesh's bounding box in its own space.
fn bounds(mesh: &Mesh) -> ([f32; 3], [f32; 3]) {
    mesh.positions.iter().fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(min, max), p| {
        ([0, 1, 2].map(|i| p[i].min(min[i])), [0, 1, 2].map(|i| p[i].max(max[i])))
    })
}

/// Triangles to store, and an estimate from above of the bytes that they and the instances take.
fn estimate(scene: &Scene, once: &[bool]) -> (u64, u64) {
    let mut is_stored = vec![false; scene.meshes.len()];
    let (mut triangles, mut instances) = (0u64, 0u64);
    for (instance, &once) in scene.instances.iter().zip(once) {
        let mesh = instance.mesh as usize;
        if !once || !core::mem::replace(&mut is_stored[mesh], true) {
            triangles = triangles.saturating_add(scene.meshes[mesh].triangles.len() as u64);
        }
        instances += u64::from(once);
    }
    let bytes = triangles.saturating_mul(BYTES_PER_TRIANGLE);
    (triangles, bytes.saturating_add(instances.saturating_mul(BYTES_PER_INSTANCE)))
}

impl Geometry {
    /// Places the instances of a scene.
    ///
    /// # Errors
    /// When they would take more than `limit` bytes: the number of triangles and the estimate.
    pub(crate) fn new(
        scene: &Scene,
        instancing: Instancing,
        limit: Option<u64>,
    ) -> Result<(Self, Dropped), (u64, u64)> {
        let mut geometry = Self::default();
        let mut dropped = Dropped::default();
        let once = stored_once(scene, instancing);
        let (triangles, bytes) = estimate(scene, &once);
        if limit.is_some_and(|limit| bytes > limit) {
            return Err((triangles, bytes));
        }
        // Triangles of the world first: their indices are those of the tree.
        for (instance, _) in scene.instances.iter().zip(&once).filter(|(_, once)| !**once) {
            let part = geometry.parts.len() as u32;
            let lost = geometry.append(scene, instance, Some(&instance.to_world));
            geometry.part_of.resize(geometry.triangles.len(), part);
            if lost > 0 {
                dropped.triangles.push((instance.object, lost));
            }
        }
        let mut stored = vec![None; scene.meshes.len()];
        for (instance, _) in scene.instances.iter().zip(&once).filter(|(_, once)| **once) {
            let slot = &mut stored[instance.mesh as usize];
            let (tree, part) = match *slot {
                Some(known) => known,
                None => {
                    let first = geometry.triangles.len();
                    let lost = geometry.append(scene, instance, None);
                    if lost > 0 {
                        dropped.triangles.push((instance.object, lost));
                    }
                    let Some(part) = geometry.parts.pop() else { continue };
                    geometry.meshes.push(first..geometry.triangles.len());
                    *slot.insert((geometry.meshes.len() as u32 - 1, part))
                }
            };
            if geometry.meshes[tree as usize].is_empty() {
                continue;
            }
            let material = &scene.materials[instance.material as usize];
            let part = Part {
                object: instance.object,
                material: instance.material,
                cutout: material.alpha != hotspot_scene::Alpha::Opaque,
                ..part
            };
            geometry.placed.push(Placed::new(tree, part, &instance.to_world));
        }
        // Lanes read them four numbers at a time ([`Geometry::corners_and_normals`]).
        geometry.corners.extend([[0; 3]; 2]);
        geometry.normals.extend([[0.0; 3]; 2]);
        Ok((geometry, dropped))
    }

    /// Adds an instance's triangles as a new part, placed or in their own space; returns how many were dropped.
    fn append(&mut self, scene: &Scene, instance: &Instance, to_world: Option<&[[f64; 4]; 3]>) -> u64 {
        let material = &scene.materials[instance.material as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let mirrored = to_world.is_some_and(|m| cofactors(m).1 < 0.0);
        let mut part = Part {
            object: instance.object,
            material: instance.material,
            cutout: material.alpha != hotspot_scene::Alpha::Opaque,
            first_triangle: self.triangles.len() as u32,
            first_corner: None,
            normals: None,
            uvs: None,
            second_uvs: None,
            colors: None,
            tangents: None,
            light_pdf_area: 0.0,
        };
        // A light is as flat as its triangles; a surface that glows in places is shaded as smoothly as any. What they emit
        // goes by geometric normals either way.
        let is_light = material.is_emissive() && material.emission.texture.is_none();
        if let Some(normals) = mesh.normals.as_ref().filter(|_| !is_light) {
            part.normals = Some(self.normals.len() as u32);
            self.normals.extend(placed_normals(normals, to_world));
            // Bumps need normals to be bumps of. What shares a mesh that is stored once may differ in its material.
            let bumpy = to_world.is_none() || material.normal_map.is_some();
            if let Some(tangents) = mesh.tangents.as_ref().filter(|_| bumpy) {
                part.tangents = Some(self.tangents.len() as u32);
                self.tangents.extend(placed_tangents(tangents, to_world, mirrored));
            }
        }
        if let Some(uvs) = &mesh.uvs {
            part.uvs = Some(self.uvs.len() as u32);
            self.uvs.extend(uvs.iter().map(|uv| Vec2::from_array(*uv)));
        }
        if let Some(uvs) = &mesh.second_uvs {
            part.second_uvs = Some(self.uvs.len() as u32);
            self.uvs.extend(uvs.iter().map(|uv| Vec2::from_array(*uv)));
        }
        if let Some(colors) = &mesh.colors {
            part.colors = Some(self.colors.len() as u32);
            self.colors.extend_from_slice(colors);
        }
        let has_attributes = part.has_attributes();
        part.first_corner = has_attributes.then_some(self.corners.len() as u32);
        self.parts.push(part);
        self.append_triangles(mesh, to_world, mirrored, has_attributes)
    }

    fn append_triangles(
        &mut self,
        mesh: &Mesh,
        to_world: Option<&[[f64; 4]; 3]>,
        mirrored: bool,
        has_attributes: bool,
    ) -> u64 {
        let mut lost = 0;
        for &[a, b, c] in &mesh.triangles {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let triangle = corners.map(|i| {
                let p = mesh.positions[i as usize];
                to_world.map_or(p, |m| transform(m, p))
            });
            if !has_area(&triangle) {
                lost += 1;
                continue;
            }
            self.triangles.push(triangle);
            self.least_height.push(least_height(&triangle));
            if has_attributes {
                self.corners.push(corners);
            }
        }
        lost
    }
}

fn placed_normals<'a>(
    normals: &'a [[f32; 3]],
    to_world: Option<&[[f64; 4]; 3]>,
) -> impl Iterator<Item = [f32; 3]> + 'a {
    let placing = to_world.map(|m| {
        let (rows, determinant) = cofactors(m);
        (rows, if determinant < 0.0 { -1.0 } else { 1.0 })
    });
    normals.iter().map(move |n| {
        let Some((rows, sign)) = placing else { return *n };
        let n = n.map(f64::from);
        let w = rows.map(|r| sign * (r[0] * n[0] + r[1] * n[1] + r[2] * n[2]));
        DVec3::from_array(w).normalize_or_zero().as_vec3().to_array()
    })
}

/// Tangents go with the surface. A mirroring matrix turns cross products over, and with them the bitangents.
fn placed_tangents<'a>(
    tangents: &'a [[f32; 4]],
    to_world: Option<&'a [[f64; 4]; 3]>,
    mirrored: bool,
) -> impl Iterator<Item = [f32; 4]> + 'a {
    tangents.iter().map(move |&[x, y, z, w]| {
        let Some(m) = to_world else { return [x, y, z, w] };
        let t = [x, y, z].map(f64::from);
        let world = m.map(|r| r[0] * t[0] + r[1] * t[1] + r[2] * t[2]);
        let [x, y, z] = DVec3::from_array(world).normalize_or_zero().as_vec3().to_array();
        [x, y, z, if mirrored { -w } else { w }]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cofactors_carry_normals_through_scale_shear_and_mirror() {
        let m = [[2.0, 0.5, 0.0, 1.0], [0.0, -3.0, 0.2, 2.0], [0.1, 0.0, 0.5, 3.0]];
        let (c, determinant) = cofactors(&m);
        assert!(determinant < 0.0);
        // Two tangents and their normal in object space stay orthogonal in the world.
        let (t1, t2) = ([1.0, 2.0, 0.5], [-1.0, 0.3, 2.0]);
        let linear = |v: [f64; 3]| m.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2]);
        let cross = DVec3::from_array(t1).cross(DVec3::from_array(t2));
        let n = c.map(|r| DVec3::from_array(r).dot(cross));
        for t in [t1, t2] {
            assert!(DVec3::from_array(n).dot(DVec3::from_array(linear(t))).abs() < 1e-12);
        }
    }
}
