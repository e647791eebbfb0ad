//! The scene's triangles in world space, and what shading needs to know of a hit.
//!
//! World space is the file's scene space; transforms are applied in f64 and stored as f32.

use glam::{Vec2, Vec3};
use hotspot_bvh::Hit;
use hotspot_scene::Scene;

/// A run of triangles that share object and material.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) object: u32,
    pub(crate) material: u32,
    first_triangle: u32,
    /// Where the part's triangles begin in [`Geometry::corners`], if it has normals or uvs.
    first_corner: Option<u32>,
    smooth: bool,
    textured: bool,
    /// Density per area with which light sampling takes a point of this part; 0 if it does not emit.
    pub(crate) light_pdf_area: f32,
}

/// Triangles in world space.
#[derive(Clone, Debug, Default)]
pub(crate) struct Geometry {
    /// Corners, counter-clockwise seen from the front.
    pub(crate) triangles: Vec<[[f32; 3]; 3]>,
    /// Part of each triangle.
    pub(crate) part_of: Vec<u32>,
    /// Least height of each triangle: twice its area over its longest edge.
    least_height: Vec<f32>,
    pub(crate) parts: Vec<Part>,
    /// Indices into `normals` and `uvs` of the corners of triangles that need them.
    corners: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

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

/// Cofactors of the linear part: they take normals to the world up to scale, for any matrix, also singular ones; a
/// mirroring matrix turns them over, which is undone by the sign of the determinant.
fn cofactors(m: &[[f64; 4]; 3]) -> ([[f64; 3]; 3], f64) {
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
    let [a, b, c] = t.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    (b - a).cross(c - a) != glam::DVec3::ZERO
}

impl Geometry {
    /// Places the instances of a scene.
    pub(crate) fn new(scene: &Scene) -> (Self, Dropped) {
        let mut geometry = Self::default();
        let mut dropped = Dropped::default();
        for instance in &scene.instances {
            let material = &scene.materials[instance.material as usize];
            let mesh = &scene.meshes[instance.mesh as usize];
            let (cofactors, determinant) = cofactors(&instance.to_world);
            let mirrored = determinant < 0.0;
            // Emitters use geometric normals.
            let normals = mesh.normals.as_ref().filter(|_| !material.is_emissive());
            let uvs = mesh.uvs.as_ref();
            let vertex_base = geometry.normals.len() as u32;
            let uv_base = geometry.uvs.len() as u32;
            // Normals and uvs share one index per corner: pad whichever is missing only where the other exists.
            let base = vertex_base.max(uv_base);
            if normals.is_some() || uvs.is_some() {
                geometry.normals.resize(base as usize, Vec3::ZERO);
                geometry.uvs.resize(base as usize, Vec2::ZERO);
            }
            if let Some(normals) = normals {
                let sign = if mirrored { -1.0 } else { 1.0 };
                geometry.normals.extend(normals.iter().map(|n| {
                    let n = n.map(f64::from);
                    let w = cofactors.map(|r| sign * (r[0] * n[0] + r[1] * n[1] + r[2] * n[2]));
                    glam::DVec3::from_array(w).normalize_or_zero().as_vec3()
                }));
            }
            if let Some(uvs) = uvs {
                geometry.uvs.extend(uvs.iter().map(|uv| Vec2::from_array(*uv)));
            }
            let part = geometry.parts.len() as u32;
            geometry.parts.push(Part {
                object: instance.object,
                material: instance.material,
                first_triangle: geometry.triangles.len() as u32,
                first_corner: (normals.is_some() || uvs.is_some()).then_some(geometry.corners.len() as u32),
                smooth: normals.is_some(),
                textured: uvs.is_some(),
                light_pdf_area: 0.0,
            });
            let mut lost = 0;
            for &[a, b, c] in &mesh.triangles {
                let corners = if mirrored { [a, c, b] } else { [a, b, c] };
                let triangle = corners.map(|i| transform(&instance.to_world, mesh.positions[i as usize]));
                if !has_area(&triangle) {
                    lost += 1;
                    continue;
                }
                geometry.triangles.push(triangle);
                geometry.part_of.push(part);
                geometry
                    .least_height
                    .push(heights(&triangle).into_iter().fold(f64::INFINITY, f64::min) as f32);
                if normals.is_some() || uvs.is_some() {
                    geometry.corners.push(corners.map(|i| base + i));
                }
            }
            if lost > 0 {
                dropped.triangles.push((instance.object, lost));
            }
        }
        (geometry, dropped)
    }

    /// Bytes held.
    pub(crate) fn memory(&self) -> u64 {
        (size_of_val(&self.triangles[..])
            + size_of_val(&self.part_of[..])
            + size_of_val(&self.least_height[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.uvs[..])) as u64
    }

    #[inline(always)]
    pub(crate) fn part(&self, primitive: u32) -> &Part {
        &self.parts[self.part_of[primitive as usize] as usize]
    }

    /// The point of a triangle with barycentric weights u, v of its second and third corner, as the origin of further
    /// rays: kept off the triangle's edges by [`SurfacePoint::margin`]. A point on an edge may round to the far side of the
    /// neighbouring face, and a ray from there would leave a closed box.
    #[inline(always)]
    pub(crate) fn point(&self, primitive: u32, u: f32, v: f32) -> SurfacePoint {
        let triangle = &self.triangles[primitive as usize];
        let point = SurfacePoint::new(triangle, u, v);
        let margin = point.margin();
        let least = u.min(v).min(1.0 - u - v);
        if least * self.least_height[primitive as usize] >= margin {
            return point;
        }
        inset(triangle, [1.0 - u - v, u, v], margin)
    }

    /// Shading normal (unit length, on the counter-clockwise side unless the file's normals say otherwise) and uv.
    #[inline(always)]
    pub(crate) fn shading<const TEXTURED: bool>(&self, hit: &Hit, part: &Part) -> (Vec3, Vec2) {
        let geometric = Vec3::from_array(hit.normal);
        let Some(first_corner) = part.first_corner else { return (geometric, Vec2::ZERO) };
        let corners = self.corners[(first_corner + hit.primitive - part.first_triangle) as usize];
        let w = 1.0 - hit.u - hit.v;
        let mut normal = geometric;
        if part.smooth {
            let n = |i: usize| self.normals[corners[i] as usize];
            normal = (n(0) * w + n(1) * hit.u + n(2) * hit.v).try_normalize().unwrap_or(geometric);
        }
        let mut uv = Vec2::ZERO;
        if TEXTURED && part.textured {
            let t = |i: usize| self.uvs[corners[i] as usize];
            uv = t(0) * w + t(1) * hit.u + t(2) * hit.v;
        }
        (normal, uv)
    }
}

/// Distances of the corners from the opposite edges; 0 without area.
fn heights(triangle: &[[f32; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let twice_area = (b - a).cross(c - a).length();
    [c - b, a - c, b - a].map(|edge| {
        let length = edge.length();
        if length > 0.0 { twice_area / length } else { 0.0 }
    })
}

/// The point with these weights, moved so that it is at least `margin` away from every edge, or as far as a triangle too
/// small for that allows.
#[cold]
#[inline(never)]
fn inset(triangle: &[[f32; 3]; 3], mut weights: [f32; 3], margin: f32) -> SurfacePoint {
    let heights = heights(triangle);
    let mut missing = 0.0;
    for (weight, height) in weights.iter_mut().zip(heights) {
        let least = (margin / height as f32).min(0.33);
        if *weight < least {
            missing += least - *weight;
            *weight = least;
        }
    }
    // The largest weight pays: it is at least a third, and the other two asked for less than a third each.
    let largest = (0..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
    weights[largest] = (weights[largest] - missing).max(0.0);
    SurfacePoint::new(triangle, weights[1], weights[2])
}

impl Geometry {
    /// Texture coordinates of the point of a triangle with barycentric weights u, v; zero where it has none.
    #[inline(always)]
    pub(crate) fn uv(&self, primitive: u32, u: f32, v: f32) -> Vec2 {
        let part = self.part(primitive);
        let Some(first_corner) = part.first_corner.filter(|_| part.textured) else { return Vec2::ZERO };
        let corners = self.corners[(first_corner + primitive - part.first_triangle) as usize];
        let t = |i: usize| self.uvs[corners[i] as usize];
        t(0) * (1.0 - u - v) + t(1) * u + t(2) * v
    }
}

/// A triangle prepared for [`SurfacePoint`]s: worth keeping for lights, which are sampled again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceTriangle {
    corner: [f64; 3],
    edges: [[f64; 3]; 2],
    /// The share of the corners in [`SurfacePoint::error`].
    error: [f32; 3],
}

impl SurfaceTriangle {
    #[inline(always)]
    pub(crate) fn new(triangle: &[[f32; 3]; 3]) -> Self {
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let mut this = Self { corner: [0.0; 3], edges: [[0.0; 3]; 2], error: [0.0; 3] };
        #[expect(clippy::needless_range_loop, reason = "one axis of several arrays in step")]
        for axis in 0..3 {
            let [a, b, c] = [triangle[0][axis], triangle[1][axis], triangle[2][axis]];
            this.corner[axis] = f64::from(a);
            this.edges[0][axis] = f64::from(b) - f64::from(a);
            this.edges[1][axis] = f64::from(c) - f64::from(a);
            this.error[axis] = 2.273_737e-13 * larger(larger(a.abs(), b.abs()), c.abs());
        }
        this
    }

    #[inline(always)]
    pub(crate) fn point(&self, u: f32, v: f32) -> SurfacePoint {
        let (u, v) = (f64::from(u), f64::from(v));
        let mut p = [0.0f32; 3];
        let mut error = [0.0f32; 3];
        for axis in 0..3 {
            p[axis] = (self.corner[axis] + self.edges[0][axis] * u + self.edges[1][axis] * v) as f32;
            error[axis] = 3.0 * (0.5 * f32::EPSILON) * p[axis].abs() + self.error[axis];
        }
        SurfacePoint { p: Vec3::from_array(p), error: Vec3::from_array(error) }
    }
}

/// A point of a triangle, with a bound on how far it may lie off the triangle's plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) p: Vec3,
    /// Bound per axis, see [`SurfacePoint::new`].
    error: Vec3,
}

impl SurfacePoint {
    /// Interpolates in f64, so that errors of the weights move the point within the plane only. What is left: rounding p
    /// to f32 (2^-24 |p|), rounding the offset origin (2^-24 |p| again), and the f64 evaluation of the plane's distance
    /// in the next intersection test (a few 2^-53 of the corners' coordinates, amplified by up to 2^10 for slivers).
    /// Hence the bound 3·2^-24 |p| + 2^-42 max|corner|, per axis.
    #[inline(always)]
    pub(crate) fn new(triangle: &[[f32; 3]; 3], u: f32, v: f32) -> Self {
        SurfaceTriangle::new(triangle).point(u, v)
    }

    /// How far from its triangle's edges a point should stay: twice the distance by which rays start off the plane, so that
    /// they start inside of any neighbour that meets the face at more than about 27 degrees.
    #[inline(always)]
    fn margin(&self) -> f32 {
        2.0 * self.error.length()
    }

    /// Where a ray from `origin` to this point of a light must end, so that it cannot hit the light itself: off the
    /// light's plane, on the side of unit normal `normal`, by the bound of [`SurfacePoint::leave`] and by the errors that
    /// grow with the ray's length: rounding the direction (u = 2^-24 of it), and the distance found by the intersection
    /// test, which is clamped to a slab interval (three roundings) and rounded itself: 5 u per axis.
    #[inline(always)]
    pub(crate) fn meet(&self, normal: Vec3, origin: Vec3) -> Vec3 {
        let reach = (self.p - origin).abs() * (5.0 * 0.5 * f32::EPSILON);
        self.p + normal * normal.abs().dot(self.error + reach)
    }

    /// The origin of a ray that leaves on the side of unit normal `normal` (turned to the ray's side): off the plane by
    /// the bound, so that the ray cannot hit the surface that it leaves (after Pharr, Jakob, Humphreys, *Physically
    /// Based Rendering*, 3rd edition, section 3.9.5, with the bound above).
    #[inline(always)]
    pub(crate) fn leave(&self, normal: Vec3) -> Vec3 {
        self.p + normal * normal.abs().dot(self.error)
    }
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
        let cross = glam::DVec3::from_array(t1).cross(glam::DVec3::from_array(t2));
        let n = c.map(|r| glam::DVec3::from_array(r).dot(cross));
        for t in [t1, t2] {
            assert!(glam::DVec3::from_array(n).dot(glam::DVec3::from_array(linear(t))).abs() < 1e-12);
        }
    }
}
