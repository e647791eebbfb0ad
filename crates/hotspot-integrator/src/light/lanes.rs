//! Light samples for eight paths at once, where few patches are all the light there is: those of [`Lights::sample`], bit for bit.

use super::patches::Alone;
use super::triangles::LightTriangle;
use super::{Lights, Surroundings};
use crate::geometry::{Geometry, SurfaceTriangle};
use crate::lanes::PointLanes;
use crate::lanes::math::square_to_triangle;
use hotspot_bvh::simd::{F8, Floats, Integers, Mask, Simd, U8, Vectors};
use hotspot_scene::Material;

/// Most emissive triangles, and patches.
const MOST: usize = 8;

/// What light samples read, in tables of eight.
#[derive(Clone, Debug)]
pub(crate) struct LightLanes {
    /// As [`Lights`] has them.
    guide: Vec<u32>,
    cumulative: F8,
    probability: F8,
    /// Of each patch: 1 where it is a pair.
    pair: U8,
    /// Of the halves of each: the triangle, and which weights are its own.
    halves: [[U8; 3]; 2],
    /// Of each emissive triangle.
    corners: [[F8; 3]; 3],
    /// [`SurfaceTriangle::error`].
    errors: [F8; 3],
    normals: [F8; 3],
    emission: [F8; 3],
    pdf_area: F8,
    edge: F8,
    /// 1 where both sides emit.
    two_sided: U8,
    primitive: U8,
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
        if patches.len() > MOST || triangles.len() > MOST {
            return None;
        }
        let corners = |t: &LightTriangle| geometry.triangles[t.primitive as usize];
        let emission =
            |t: &LightTriangle| materials[geometry.part(t.primitive).material as usize].emission.factor;
        let half = |i: usize| {
            [
                numbers(&patches, |p| p.triangles[i]),
                numbers(&patches, |p| u32::from(p.weights[i][0])),
                numbers(&patches, |p| u32::from(p.weights[i][1])),
            ]
        };
        Some(Self {
            guide: lights.guide.clone(),
            cumulative: floats(&patches, |p| p.cumulative),
            probability: floats(&patches, |p| p.probability),
            pair: numbers(&patches, |p| u32::from(p.pair)),
            halves: [half(0), half(1)],
            corners: [0, 1, 2].map(|corner| vectors(triangles, |t| corners(t)[corner])),
            errors: vectors(triangles, |t| SurfaceTriangle::new(&corners(t)).error),
            normals: vectors(triangles, |t| t.normal.to_array()),
            emission: vectors(triangles, emission),
            pdf_area: floats(triangles, |t| t.pdf_area),
            edge: floats(triangles, |t| t.edge),
            two_sided: numbers(triangles, |t| u32::from(t.two_sided)),
            primitive: numbers(triangles, |t| t.primitive),
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
        let patch = self.strip(s, select);

        // The place in the patch.
        let below_one = Floats::splat(s, 1.0 - 0.5 * f32::EPSILON);
        let from = select - Floats::look_up(&self.cumulative, patch);
        let x = from / Floats::look_up(&self.probability, patch);
        let x = below_one.min(zero.max(x));
        let pair = Integers::look_up(&self.pair, patch).is(1);
        let first = (x + v).less(one);
        let weights = [
            first.select(one - x - v, (x - (one - v)).max(zero)),
            first.select(x, one - v),
            first.select(v, one - x),
        ];
        let triangle = self.of_half(first, 0, patch);
        let b = chosen(self.of_half(first, 1, patch), weights);
        let c = chosen(self.of_half(first, 2, patch), weights);
        let (folded_b, folded_c) = square_to_triangle(x, v);
        let (b, c) = (pair.select(b, folded_b), pair.select(c, folded_c));

        // The point, off the triangle's edges.
        let normal = Vectors::look_up(&self.normals, triangle);
        let [k, l, m] = &self.corners;
        let corners =
            [Vectors::look_up(k, triangle), Vectors::look_up(l, triangle), Vectors::look_up(m, triangle)];
        let shows = zero.less(normal.dot(p - corners[0]));
        let two_sided = Integers::look_up(&self.two_sided, triangle).is(1);
        let mut there = active & (shows | two_sided).bits();
        let mut point = PointLanes::new(s, corners, Vectors::look_up(&self.errors, triangle), b, c);
        let near_edge = b.min(c).min(one - b - c).less(Floats::look_up(&self.edge, triangle)).bits() & there;
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
        let pdf = Floats::look_up(&self.pdf_area, triangle) * distance2 / cos.abs();
        let somewhere = Mask::splat(s, true).without(distance2.is(0.0));
        let valid = somewhere & zero.less(pdf) & pdf.less(Floats::splat(s, f32::INFINITY));
        there &= valid.bits();
        let primitive = Integers::look_up(&self.primitive, triangle);
        let emission = Vectors::look_up(&self.emission, triangle);
        LightSamples { there, wi, pdf, point, cos, normal, primitive, emission }
    }

    /// Of the first halves of patches, or of the second ones: triangle or weights.
    #[inline(always)]
    fn of_half<S: Simd>(&self, first: Mask<S>, what: usize, patch: Integers<S>) -> Integers<S> {
        let [a, b] = &self.halves;
        Integers::look_up(&a[what], patch).or_where_not(first, Integers::look_up(&b[what], patch))
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
            while (*index as usize) + 1 < count && self.cumulative.0[*index as usize + 1] <= select {
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

/// At most eight.
fn floats<T>(all: &[T], of: impl Fn(&T) -> f32) -> F8 {
    F8(core::array::from_fn(|i| all.get(i).map_or(0.0, &of)))
}

/// At most eight.
fn numbers<T>(all: &[T], of: impl Fn(&T) -> u32) -> U8 {
    U8(core::array::from_fn(|i| all.get(i).map_or(0, &of)))
}

/// At most eight.
fn vectors<T>(all: &[T], of: impl Fn(&T) -> [f32; 3]) -> [F8; 3] {
    [0, 1, 2].map(|axis| floats(all, |one| of(one)[axis]))
}
