//! Paths that wait, as rows of numbers.

use super::{Paths, View};
use crate::class::Class;
use crate::lanes::sampler::Points;
use crate::light::ViewpointLanes;
use hotspot_bvh::rays::Rays;
use hotspot_bvh::simd::{Floats, Integers, Simd, Vectors};

/// Most paths that wait, when those of fewer than eight that wait and of eight others go on.
const WAITING: usize = 16;

/// Numbers that make up a path. Then come those that only kernels with learned lights have, and last those of kernels for everything.
const ROWS: usize = 22;
const LEARNED_ROWS: usize = 7;
const TEXTURED_ROWS: usize = 4;
const ALL_ROWS: usize = ROWS + LEARNED_ROWS + TEXTURED_ROWS;

/// How many a kernel has.
const fn rows_of<C: Class>() -> usize {
    match (C::TEXTURED, C::LEARNED) {
        (true, _) => ALL_ROWS,
        (false, true) => ROWS + LEARNED_ROWS,
        (false, false) => ROWS,
    }
}

/// The paths that wait, number by number ([`Paths::rows`]).
pub(super) struct Pool([[f32; WAITING]; ALL_ROWS]);

impl Pool {
    /// With none.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self([[0.0; WAITING]; ALL_ROWS])
    }
}

impl<S: Simd> Paths<S> {
    /// All numbers, whole ones by their bits; in the order of [`Paths::of_rows`].
    #[rustfmt::skip]
    #[inline(always)]
    fn rows(&self) -> [Floats<S>; ALL_ROWS] {
        let Self { rays: Rays { origin, direction }, radiance, throughput, points, scattered_from, absorption, part, .. } = self;
        let ViewpointLanes { p, n, outlook } = scattered_from;
        [
            origin.x, origin.y, origin.z,
            direction.x, direction.y, direction.z,
            self.from.as_bits(),
            radiance.x, radiance.y, radiance.z,
            throughput.x, throughput.y, throughput.z,
            self.survival_scale, self.scattered_pdf, self.scattered_cos,
            self.bounces.as_bits(),
            self.light[0], self.light[1],
            points.key.as_bits(), points.index.as_bits(), self.number.as_bits(),
            p.x, p.y, p.z, n.x, n.y, n.z, outlook.as_bits(),
            absorption.x, absorption.y, absorption.z, part.as_bits(),
        ]
    }

    /// Those of [`Paths::rows`].
    #[rustfmt::skip]
    #[inline(always)]
    fn of_rows(view: &View<'_>, rows: &[Floats<S>; ALL_ROWS]) -> Self {
        let [
            ox, oy, oz,
            dx, dy, dz,
            from,
            r, g, b,
            throughput_r, throughput_g, throughput_b,
            survival_scale, scattered_pdf, scattered_cos,
            bounces,
            light_u, light_v,
            key, index, number,
            px, py, pz, nx, ny, nz, outlook,
            absorbs_r, absorbs_g, absorbs_b, part,
        ] = *rows;
        Self {
            rays: Rays { origin: Vectors::new(ox, oy, oz), direction: Vectors::new(dx, dy, dz) },
            from: from.bits(),
            radiance: Vectors::new(r, g, b),
            throughput: Vectors::new(throughput_r, throughput_g, throughput_b),
            survival_scale,
            scattered_pdf,
            scattered_cos,
            scattered_from: ViewpointLanes {
                p: Vectors::new(px, py, pz),
                n: Vectors::new(nx, ny, nz),
                outlook: outlook.bits(),
            },
            absorption: Vectors::new(absorbs_r, absorbs_g, absorbs_b),
            part: part.bits(),
            bounces: bounces.bits(),
            light: [light_u, light_v],
            points: Points { key: key.bits(), index: index.bits(), table: view.table },
            number: number.bits(),
        }
    }

    /// Those of a pool from `at` on.
    #[inline(always)]
    pub(super) fn read<C: Class>(s: S, view: &View<'_>, Pool(pool): &Pool, at: usize) -> Self {
        let mut rows = [Floats::splat(s, 0.0); ALL_ROWS];
        for (row, numbers) in rows[..rows_of::<C>()].iter_mut().zip(pool) {
            *row = Floats::read(s, numbers, at);
        }
        Self::of_rows(view, &rows)
    }

    /// To a pool from `at` on: lane `order[0]` first, and so on.
    #[inline(always)]
    pub(super) fn write<C: Class>(&self, Pool(pool): &mut Pool, at: usize, order: Integers<S>) {
        for (row, numbers) in self.rows()[..rows_of::<C>()].iter().zip(pool) {
            row.permuted(order).write(numbers, at);
        }
    }
}
