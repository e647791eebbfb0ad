//! Light samples for eight paths at once, where few patches are all the light there is: those of [`Lights::sample`], bit for bit.

use super::patches::Alone;
use super::{Lights, Surroundings};
use crate::geometry::Geometry;
use crate::lanes::math::square_to_triangle;
use crate::lanes::{PointLanes, PointTables};
use core::iter::once;
use hotspot_bvh::simd::{Floats, Integers, Mask, Simd, U8, Vectors};
use hotspot_scene::Material;

/// Numbers of a patch.
const PATCH: u32 = 8;

/// What light samples read, in tables.
#[derive(Clone, Debug)]
pub(crate) struct LightLanes {
    /// As [`Lights`] has them; the cumulative distribution ends with what no number reaches.
    guide: Vec<u32>,
    cumulative: Vec<f32>,
    probability: Vec<f32>,
    /// Of each patch: whether it is a pair; of either half: triangle, and the two weights.
    patches: Vec<u32>,
    /// Of each emissive triangle.
    points: PointTables,
    normals: Vec<f32>,
    emission: Vec<f32>,
    pdf_area: Vec<f32>,
    edge: Vec<f32>,
    /// 1 where both sides emit.
    two_sided: Vec<u32>,
    primitive: Vec<u32>,
}

/// Light samples in lanes, as [`LightSample`](super::LightSample) and [`LightTarget::Surface`](super::LightTarget::Surface) have them.
#[derive(Clone, Copy)]
pub(crate) struct LightSamples<S: Simd> {
    /// Lanes that have one; of others the fields hold anything.
    pub(crate) there: u32,
    pub(crate) wi: Vectors<S>,
    pub(crate) pdf: Floats<S>,
    pub(crate) point: PointLanes<S>,
    /// Of the light's normal with the direction to the shading point.
    pub(crate) cos: Floats<S>,
    pub(crate) normal: Vectors<S>,
    pub(crate) primitive: Integers<S>,
    pub(crate) emission: Vectors<S>,
}

impl LightLanes {
    /// `None` where there is other light than that of patches, none at all, or a part of so many patches that they lie in strips.
    pub(crate) fn new(lights: &Lights, geometry: &Geometry, materials: &[Material]) -> Option<Self> {
        let alone = lights.patches.one_each()?;
        if !matches!(lights.environment, Surroundings::Nothing)
            || !lights.punctual.is_empty()
            || lights.triangles.is_empty()
        {
            return None;
        }
        let patches: Vec<Alone> = alone.collect();
        let triangles = &lights.triangles;
        let corners = |primitive: u32| &geometry.triangles[primitive as usize];
        let material = |primitive: u32| &materials[geometry.part(primitive).material as usize];
        Some(Self {
            guide: lights.guide.clone(),
            cumulative: patches.iter().map(|p| p.cumulative).chain(once(f32::INFINITY)).collect(),
            probability: patches.iter().map(|p| p.probability).collect(),
            patches: patches
                .iter()
                .flat_map(|p| {
                    let half = |i: usize| {
                        let [b, c] = p.weights[i].map(u32::from);
                        [p.triangles[i], b, c]
                    };
                    let ([t, b, c], [u, d, e]) = (half(0), half(1));
                    [u32::from(p.pair), 0, t, b, c, u, d, e]
                })
                .collect(),
            points: PointTables::new(triangles.iter().map(|t| corners(t.primitive))),
            normals: triangles.iter().flat_map(|t| t.normal.to_array()).collect(),
            emission: triangles.iter().flat_map(|t| material(t.primitive).emission.factor).collect(),
            pdf_area: triangles.iter().map(|t| t.pdf_area).collect(),
            edge: triangles.iter().map(|t| t.edge).collect(),
            two_sided: triangles.iter().map(|t| u32::from(t.two_sided)).collect(),
            primitive: triangles.iter().map(|t| t.primitive).collect(),
        })
    }

    /// As [`Lights::sample`], seen from `p`, for lanes `active`.
    #[inline(always)]
    pub(crate) fn sample<S: Simd>(
        &self,
        s: S,
        lights: &Lights,
        p: Vectors<S>,
        [select, v]: [Floats<S>; 2],
        active: u32,
    ) -> LightSamples<S> {
        let (zero, one) = (Floats::splat(s, 0.0), Floats::splat(s, 1.0));
        let index = self.strip(s, select);

        // The place in the patch.
        let below_one = Floats::splat(s, 1.0 - 0.5 * f32::EPSILON);
        let from = select - Floats::gather(&self.cumulative, index);
        let x = from / Floats::gather(&self.probability, index);
        let x = below_one.min(zero.max(x));
        let patch = index * PATCH;
        let pair = Integers::gather(&self.patches, patch).is(1);
        let first = (x + v).less(one);
        let weights = [
            first.select(one - x - v, (x - (one - v)).max(zero)),
            first.select(x, one - v),
            first.select(v, one - x),
        ];
        let half = patch + Integers::splat(s, 2).or_where_not(first, Integers::splat(s, 5));
        let triangle = Integers::gather(&self.patches, half);
        let b = chosen(Integers::gather(&self.patches, half + 1), weights);
        let c = chosen(Integers::gather(&self.patches, half + 2), weights);
        let (folded_b, folded_c) = square_to_triangle(x, v);
        let (b, c) = (pair.select(b, folded_b), pair.select(c, folded_c));

        // The point, off the triangle's edges.
        let normal = Vectors::gather(&self.normals, triangle * 3);
        let corner = self.points.corner(triangle);
        let shows = zero.less(normal.dot(p - corner));
        let two_sided = Integers::gather(&self.two_sided, triangle).is(1);
        let mut there = active & (shows | two_sided).bits();
        let mut point = self.points.point(s, triangle, b, c);
        let near_edge = b.min(c).min(one - b - c).less(Floats::gather(&self.edge, triangle)).bits() & there;
        if near_edge != 0 {
            let (triangles, b, c) = (triangle.store(), b.store(), c.store());
            point = point.replaced(s, near_edge, |lane| {
                let light = &lights.triangles[triangles.0[lane] as usize];
                light.triangle.point_off_edges(b.0[lane], c.0[lane])
            });
        }
        let d = point.p - p;
        let distance2 = d.dot(d);
        let length = distance2.sqrt();
        let wi = Vectors::new(d.x / length, d.y / length, d.z / length);
        let cos = -wi.dot(normal);
        let pdf = Floats::gather(&self.pdf_area, triangle) * distance2 / cos.abs();
        let somewhere = Mask::splat(s, true).without(distance2.is(0.0));
        let valid = somewhere & zero.less(pdf) & pdf.less(Floats::splat(s, f32::INFINITY));
        there &= valid.bits();
        let primitive = Integers::gather(&self.primitive, triangle);
        let emission = Vectors::gather(&self.emission, triangle * 3);
        LightSamples { there, wi, pdf, point, cos, normal, primitive, emission }
    }

    /// Which patch the first number chooses.
    #[inline(always)]
    fn strip<S: Simd>(&self, s: S, select: Floats<S>) -> Integers<S> {
        let count = self.guide.len();
        if count == 1 {
            return Integers::splat(s, 0);
        }
        // One after the other is simplest where there are few: the guide first, as there.
        let mut index = select.store().0.map(f32::to_bits);
        for index in &mut index {
            let select = f32::from_bits(*index);
            *index = self.guide[((select * count as f32) as usize).min(count - 1)];
            while self.cumulative[*index as usize + 1] <= select {
                *index += 1;
            }
        }
        Integers::load(s, &U8(index))
    }
}

/// Weight 0, 1 or 2.
#[inline(always)]
fn chosen<S: Simd>(which: Integers<S>, weights: [Floats<S>; 3]) -> Floats<S> {
    which.is(0).select(weights[0], which.is(1).select(weights[1], weights[2]))
}
