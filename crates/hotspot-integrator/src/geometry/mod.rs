//! The scene's triangles, and what shading needs to know of a hit.
//!
//! World space is the file's scene space; transforms are applied in f64 and stored as f32. A mesh that appears often may be
//! stored once, in its own space ([`Instancing`]); its triangles follow those of the world.

#[cfg(test)]
mod leaving;
mod place;
mod point;

use crate::class::{Class, Feature, has};
use glam::{DVec3, Vec2, Vec3};
use hotspot_bvh::simd::{Integers, Simd, Vectors};
use hotspot_bvh::{Hit, NO_INSTANCE};
use std::ops::Range;

pub use place::{COPIES_THAT_PAY, Instancing};
use point::inset;
pub(crate) use point::{SurfacePoint, SurfaceTriangle, least_height};

/// A run of triangles that share object and material, and where their attributes begin (`None`: they have none).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) object: u32,
    pub(crate) material: u32,
    /// Its surface is not there everywhere.
    pub(crate) cutout: bool,
    /// Density per area with which light sampling takes a point of this part; 0 if it does not emit.
    pub(crate) light_pdf_area: f32,
    first_triangle: u32,
    /// In [`Geometry::corners`].
    first_corner: Option<u32>,
    normals: Option<u32>,
    tangents: Option<u32>,
    uvs: Option<u32>,
    second_uvs: Option<u32>,
    colors: Option<u32>,
}

impl Part {
    fn has_attributes(&self) -> bool {
        [self.normals, self.tangents, self.uvs, self.second_uvs, self.colors].iter().any(Option::is_some)
    }

    /// What to add to a triangle's number for where its corners' indices are, and to those for where its normals are; `None`
    /// without normals of its own.
    pub(crate) fn smooth(&self) -> Option<[u32; 2]> {
        Some([self.first_corner?.wrapping_sub(self.first_triangle), self.normals?])
    }

    /// Whether its vertices have colours.
    pub(crate) fn has_colors(&self) -> bool {
        self.colors.is_some()
    }

    /// Whether bumps can be applied.
    #[inline(always)]
    pub(crate) fn has_tangents(&self) -> bool {
        self.tangents.is_some()
    }
}

/// An instance of a mesh that is stored once.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Index into [`Geometry::meshes`].
    pub(crate) mesh: u32,
    pub(crate) part: Part,
    pub(crate) to_world: [[f64; 4]; 3],
    /// Takes normals to the world, up to scale.
    normals: [Vec3; 3],
    /// 1, or −1 where `to_world` mirrors: cross products turn over.
    handedness: f32,
    /// A lower bound of how much lengths shrink on the way to the world.
    least_scale: f32,
}

impl Placed {
    fn new(mesh: u32, part: Part, to_world: &[[f64; 4]; 3]) -> Self {
        let (cofactors, determinant) = place::cofactors(to_world);
        // The inverse is the transposed cofactors over the determinant; its Frobenius norm bounds how much it stretches.
        let inverse = cofactors.iter().flatten().map(|c| (c / determinant).powi(2)).sum::<f64>().sqrt();
        // Scaled to size 1, so that tiny and huge instances stay in the range of f32.
        let largest = cofactors.iter().flatten().fold(0.0f64, |m, c| m.max(c.abs()));
        let scale = determinant.signum() / largest;
        Self {
            mesh,
            part,
            to_world: *to_world,
            normals: cofactors.map(|r| DVec3::from_array(r.map(|c| c * scale)).as_vec3()),
            handedness: determinant.signum() as f32,
            least_scale: (1.0 / inverse) as f32,
        }
    }

    /// Whether it turns triangles over.
    pub(crate) fn is_mirrored(&self) -> bool {
        self.handedness < 0.0
    }

    #[inline(always)]
    fn normal(&self, n: Vec3) -> Vec3 {
        Vec3::new(self.normals[0].dot(n), self.normals[1].dot(n), self.normals[2].dot(n))
    }

    #[inline(always)]
    fn direction(&self, d: Vec3) -> Vec3 {
        let row =
            |r: &[f64; 4]| (r[0] * f64::from(d.x) + r[1] * f64::from(d.y) + r[2] * f64::from(d.z)) as f32;
        Vec3::new(row(&self.to_world[0]), row(&self.to_world[1]), row(&self.to_world[2]))
    }
}

/// All triangles and their attributes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Geometry {
    /// Corners, counter-clockwise seen from the front: those of the world, then the meshes' in their own space.
    pub(crate) triangles: Vec<[[f32; 3]; 3]>,
    /// Part of each triangle of the world.
    pub(crate) part_of: Vec<u32>,
    pub(crate) parts: Vec<Part>,
    /// Triangles of each mesh that is stored once.
    pub(crate) meshes: Vec<Range<usize>>,
    pub(crate) placed: Vec<Placed>,
    /// Least height of each triangle: twice its area over its longest edge.
    least_height: Vec<f32>,
    /// For the triangles of parts with attributes: the corners' indices, counted from where each attribute begins.
    corners: Vec<[u32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Direction, and handedness of the bitangent.
    tangents: Vec<[f32; 4]>,
    uvs: Vec<Vec2>,
    /// Linear RGBA.
    colors: Vec<[f32; 4]>,
}

/// A triangle that was hit, wherever it is stored.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    pub(crate) part: &'a Part,
    triangle: u32,
    placed: Option<&'a Placed>,
}

/// Texture coordinates and vertex colour of a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attributes {
    pub(crate) uv: Vec2,
    pub(crate) second_uv: Vec2,
    /// Multiplies the base colour.
    pub(crate) tint: Vec3,
    /// Multiplies alpha.
    pub(crate) tint_alpha: f32,
}

impl Attributes {
    pub(crate) const NONE: Self =
        Self { uv: Vec2::ZERO, second_uv: Vec2::ZERO, tint: Vec3::ONE, tint_alpha: 1.0 };
}

impl Geometry {
    /// Bytes held.
    pub(crate) fn memory(&self) -> u64 {
        (size_of_val(&self.triangles[..])
            + size_of_val(&self.part_of[..])
            + size_of_val(&self.least_height[..])
            + size_of_val(&self.parts[..])
            + size_of_val(&self.placed[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.tangents[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.colors[..])) as u64
    }

    /// Whether some surface is not there everywhere.
    pub(crate) fn has_cutouts(&self) -> bool {
        self.parts.iter().chain(self.placed.iter().map(|p| &p.part)).any(|p| p.cutout)
    }

    /// Number of triangles that are in the world themselves.
    pub(crate) fn world_triangles(&self) -> usize {
        self.part_of.len()
    }

    /// The part of a triangle of the world.
    #[inline(always)]
    pub(crate) fn part(&self, primitive: u32) -> &Part {
        &self.parts[self.part_of[primitive as usize] as usize]
    }

    /// Number of parts, those that are instances after those of the world.
    pub(crate) fn part_count(&self) -> usize {
        self.parts.len() + self.placed.len()
    }

    /// One of them.
    #[inline(always)]
    pub(crate) fn part_of_number(&self, number: u32) -> &Part {
        let number = number as usize;
        match self.parts.get(number) {
            Some(part) => part,
            None => &self.placed[number - self.parts.len()].part,
        }
    }

    /// The numbers of the parts that these triangles of the world, or of instances, belong to.
    #[inline(always)]
    pub(crate) fn part_numbers<S: Simd, C: Class>(
        &self,
        primitive: Integers<S>,
        instance: Integers<S>,
    ) -> Integers<S> {
        if !has::<C>(Feature::Instances) || self.placed.is_empty() {
            return Integers::gather(&self.part_of, primitive);
        }
        let placed = instance + self.parts.len() as u32;
        if self.part_of.is_empty() {
            return placed;
        }
        Integers::gather(&self.part_of, primitive).or_where_not(instance.is(NO_INSTANCE), placed)
    }

    /// The triangle `primitive` of the world or of an instance.
    #[inline(always)]
    pub(crate) fn surface(&self, instance: u32, primitive: u32) -> Surface<'_> {
        if instance == NO_INSTANCE {
            self.world_surface(primitive)
        } else {
            let placed = &self.placed[instance as usize];
            let triangle = placed.part.first_triangle + primitive;
            Surface { part: &placed.part, triangle, placed: Some(placed) }
        }
    }

    /// The triangle `primitive` of the world.
    #[inline(always)]
    pub(crate) fn world_surface(&self, primitive: u32) -> Surface<'_> {
        Surface { part: self.part(primitive), triangle: primitive, placed: None }
    }

    /// The triangle's corners, where it is stored.
    #[inline(always)]
    pub(crate) fn corners_of(&self, surface: Surface<'_>) -> &[[f32; 3]; 3] {
        &self.triangles[surface.triangle as usize]
    }

    #[inline(always)]
    fn corners(&self, surface: Surface<'_>) -> Option<[u32; 3]> {
        let first_corner = surface.part.first_corner?;
        Some(self.corners[(first_corner + surface.triangle - surface.part.first_triangle) as usize])
    }

    /// Normals of the corners of a triangle of the world, where its surface has normals of its own.
    pub(crate) fn corner_normals(&self, primitive: u32) -> Option<[Vec3; 3]> {
        let surface = self.world_surface(primitive);
        let (first, corners) = (surface.part.normals?, self.corners(surface)?);
        Some(corners.map(|corner| Vec3::from_array(self.normals[(first + corner) as usize])))
    }

    /// The corners' indices and the normals that [`Part::smooth`] points into; behind those in use there are at least four numbers more.
    pub(crate) fn corners_and_normals(&self) -> (&[u32], &[f32]) {
        (self.corners.as_flattened(), self.normals.as_flattened())
    }

    /// Corners of eight triangles.
    #[inline(always)]
    pub(crate) fn corners_in_lanes<S: Simd>(&self, triangle: Integers<S>) -> [Vectors<S>; 3] {
        let corners = self.triangles.as_flattened().as_flattened();
        Vectors::gather_three(corners, triangle.shift_left::<3>() + triangle)
    }

    /// Of each triangle: the least distance of a corner from the opposite edge.
    pub(crate) fn least_heights(&self) -> &[f32] {
        &self.least_height
    }

    /// The point of a triangle with barycentric weights u, v of its second and third corner, as the origin of further
    /// rays: kept off the triangle's edges by [`SurfacePoint::margin`]. A point on an edge may round to the far side of the
    /// neighbouring face, and a ray from there would leave a closed box.
    #[inline(always)]
    pub(crate) fn point(&self, surface: Surface<'_>, u: f32, v: f32) -> SurfacePoint {
        let triangle = &self.triangles[surface.triangle as usize];
        let least = u.min(v).min(1.0 - u - v) * self.least_height[surface.triangle as usize];
        let Some(placed) = surface.placed else {
            let point = SurfacePoint::new(triangle, u, v);
            if least >= point.margin() {
                return point;
            }
            let [_, u, v] = inset(triangle, [1.0 - u - v, u, v], &point);
            return SurfacePoint::new(triangle, u, v);
        };
        let point = SurfacePoint::placed(triangle, u, v, &placed.to_world);
        if least * placed.least_scale >= point.margin() {
            return point;
        }
        let there = triangle.map(|p| {
            let p = p.map(f64::from);
            placed.to_world.map(|r| (r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]) as f32)
        });
        let [_, u, v] = inset(&there, [1.0 - u - v, u, v], &point);
        SurfacePoint::placed(triangle, u, v, &placed.to_world)
    }

    /// Shading normal: of unit length, on the counter-clockwise side unless the file's normals say otherwise.
    #[inline(always)]
    pub(crate) fn normal(&self, surface: Surface<'_>, hit: &Hit) -> Vec3 {
        let geometric = Vec3::from_array(hit.normal);
        let (Some(first), Some(corners)) = (surface.part.normals, self.corners(surface)) else {
            return geometric;
        };
        let n = |i: usize| Vec3::from_array(self.normals[(first + corners[i]) as usize]);
        let normal = n(0) * (1.0 - hit.u - hit.v) + n(1) * hit.u + n(2) * hit.v;
        let normal = surface.placed.map_or(normal, |placed| placed.normal(normal));
        normal.try_normalize().unwrap_or(geometric)
    }

    /// Unit tangent, and bitangent, for bumps of a surface with this interpolated normal.
    #[inline(always)]
    pub(crate) fn tangents(
        &self,
        surface: Surface<'_>,
        normal: Vec3,
        u: f32,
        v: f32,
    ) -> Option<(Vec3, Vec3)> {
        let (first, corners) = (surface.part.tangents?, self.corners(surface)?);
        let t = |i: usize| self.tangents[(first + corners[i]) as usize];
        let xyz = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
        let mut tangent = xyz(t(0)) * (1.0 - u - v) + xyz(t(1)) * u + xyz(t(2)) * v;
        // All corners of a triangle have the same handedness.
        let mut handedness = t(0)[3];
        if let Some(placed) = surface.placed {
            handedness *= placed.handedness;
            tangent = placed.direction(tangent);
        }
        let tangent = tangent.try_normalize()?;
        Some((tangent, normal.cross(tangent) * handedness))
    }

    /// Texture coordinates and vertex colour.
    #[inline(always)]
    pub(crate) fn attributes<C: Class>(&self, surface: Surface<'_>, u: f32, v: f32) -> Attributes {
        let mut out = Attributes::NONE;
        let Some(corners) = self.corners(surface) else { return out };
        let w = 1.0 - u - v;
        let uv = |first: u32| {
            let t = |i: usize| self.uvs[(first + corners[i]) as usize];
            t(0) * w + t(1) * u + t(2) * v
        };
        if let Some(first) = surface.part.uvs {
            out.uv = uv(first);
        }
        if has::<C>(Feature::SecondUvs)
            && let Some(first) = surface.part.second_uvs
        {
            out.second_uv = uv(first);
        }
        if has::<C>(Feature::VertexColors)
            && let Some(first) = surface.part.colors
        {
            let c = |i: usize| glam::Vec4::from_array(self.colors[(first + corners[i]) as usize]);
            // From differences, so that what is the same at all corners is the same in between: an alpha of 1 must not
            // round below a cutoff of 1.
            let tint = c(0) + (c(1) - c(0)) * u + (c(2) - c(0)) * v;
            (out.tint, out.tint_alpha) = (tint.truncate(), tint.w);
        }
        out
    }
}
