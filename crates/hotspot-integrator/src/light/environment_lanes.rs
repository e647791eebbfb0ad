//! [`EnvironmentSampler`] for eight directions at once: rows and columns are searched and texels read lane by lane, the rest is the same for all.

use super::environment::EnvironmentSampler;
use crate::lanes::math::{atan2_turns, sin_cos_turn};
use hotspot_bvh::simd::{F8, Floats, Integers, Lanes, Simd, U8, Vectors, set_vector};

/// [`Look`](super::environment::Look)s.
pub(super) struct LookLanes<S: Simd> {
    pub(super) radiance: Vectors<S>,
    pub(super) pdf: Floats<S>,
}

/// The whole number below, of numbers far below 2^31 either way.
#[inline(always)]
fn floor<S: Simd>(s: S, x: Floats<S>) -> Floats<S> {
    let zero = Floats::splat(s, 0.0);
    let size = x.abs();
    let whole = size.truncate().to_floats();
    let more = whole.less(size).or_zero(Floats::splat(s, 1.0));
    x.less(zero).select(zero - whole - more, whole)
}

/// What is left above it.
#[inline(always)]
fn fraction<S: Simd>(s: S, x: Floats<S>) -> Floats<S> {
    x - floor(s, x)
}

/// A place in (−1, 1) under a tent.
#[inline(always)]
fn tent<S: Simd>(s: S, u: Floats<S>) -> Floats<S> {
    let two = Floats::splat(s, 2.0);
    let below = (two * u).sqrt() - 1.0;
    let above = 1.0 - (two - two * u).sqrt();
    u.less(Floats::splat(s, 0.5)).select(below, above)
}

/// Between two texels of a row: colours, and densities.
#[inline(always)]
fn across<S: Simd>(
    s: S,
    [left, right]: &[[F8; 3]; 2],
    density: &F8,
    fx: Floats<S>,
    luminance: Vectors<S>,
) -> (Vectors<S>, Floats<S>) {
    let color = Vectors::load(s, left).scaled(1.0 - fx) + Vectors::load(s, right).scaled(fx);
    (color, color.dot(luminance) * Floats::load(s, density))
}

impl EnvironmentSampler {
    /// [`EnvironmentSampler::look_up`] for lanes `asked`.
    #[inline(always)]
    pub(super) fn look_ups<S: Simd>(&self, s: S, direction: Vectors<S>, asked: u32) -> LookLanes<S> {
        let (width, height, rotation) = self.frame();
        let sin = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let u = fraction(s, atan2_turns(s, direction.x, -direction.z) + 0.5 + rotation);
        let v = Floats::splat(s, 2.0) * atan2_turns(s, sin, direction.y);
        self.looks(s, u * width as f32, v * height as f32, sin, asked)
    }

    /// [`EnvironmentSampler::sample`] for lanes `asked`: directions, what they show, and lanes where rounding leaves light.
    #[inline(always)]
    pub(super) fn samples<S: Simd>(
        &self,
        s: S,
        [u, v]: [Floats<S>; 2],
        asked: u32,
    ) -> (Vectors<S>, LookLanes<S>, u32) {
        let (width, height, rotation) = self.frame();
        let (u, v) = (u.store(), v.store());
        let (mut rows, mut columns) = (U8([0; 8]), U8([0; 8]));
        let (mut down, mut across) = (F8([0.0; 8]), F8([0.0; 8]));
        for lane in Lanes(asked) {
            let (row, rest) = self.row(u.0[lane]);
            (rows.0[lane], down.0[lane]) = (row as u32, rest);
            let (column, rest) = self.column(row, v.0[lane]);
            (columns.0[lane], across.0[lane]) = (column as u32, rest);
        }
        let (half, zero) = (Floats::splat(s, 0.5), Floats::splat(s, 0.0));
        let rows = Integers::load(s, &rows);
        let row = rows.to_floats();
        let (down, across) = (Floats::load(s, &down), Floats::load(s, &across));
        let x = Integers::load(s, &columns).to_floats() + 0.5 + tent(s, across);
        let upper = down.less(half);
        let y = row + 0.5 + tent(s, down);
        let y = rows.is(height as u32 - 1).without(upper).select(row + down, y);
        let y = (rows.is(0) & upper).select(down, y);
        let turn = (half * y / Floats::splat(s, height as f32)).max(zero).min(half);
        let (sin, cos) = sin_cos_turn(s, turn);
        let (sin_phi, cos_phi) = sin_cos_turn(s, fraction(s, x / Floats::splat(s, width as f32) - rotation));
        let wi = Vectors::new(-sin_phi * sin, cos, cos_phi * sin);
        let look = self.looks(s, x, y, sin, asked);
        let valid = zero.less(look.pdf) & look.pdf.less(Floats::splat(s, f32::INFINITY));
        (wi, look, valid.bits() & asked)
    }

    /// Interpolated at places of the picture, as [`EnvironmentSampler::sample`] does.
    #[inline(always)]
    fn looks<S: Simd>(&self, s: S, x: Floats<S>, y: Floats<S>, sin: Floats<S>, asked: u32) -> LookLanes<S> {
        let (width, height, _) = self.frame();
        let zero = Floats::splat(s, 0.0);
        let (x, y) = (x - 0.5, y - 0.5);
        let (column, row) = (floor(s, x), floor(s, y));
        let (fx, fy) = (x - column, y - row);
        let (columns, below) =
            (column.max(zero).truncate().store(), (row + 1.0).max(zero).truncate().store());
        let (rows, beyond) = (row.max(zero).truncate().store(), column.less(zero).bits());
        let mut texels = [[[F8([0.0; 8]); 3]; 2]; 2];
        let mut density = [F8([0.0; 8]); 2];
        for lane in Lanes(asked) {
            let left =
                if beyond >> lane & 1 != 0 { width - 1 } else { (columns.0[lane] as usize).min(width - 1) };
            let right = if left + 1 == width { 0 } else { left + 1 };
            let both = [rows.0[lane], below.0[lane]].map(|row| (row as usize).min(height - 1));
            for (row, (texels, density)) in both.into_iter().zip(texels.iter_mut().zip(&mut density)) {
                let (colors, there) = self.texels([left, right], row);
                set_vector(&mut texels[0], lane, colors[0]);
                set_vector(&mut texels[1], lane, colors[1]);
                density.0[lane] = there;
            }
        }
        let one = Floats::splat(s, 1.0);
        let (scale, luminance) = self.weights();
        let luminance = Vectors::splat(s, luminance);
        let above = across(s, &texels[0], &density[0], fx, luminance);
        let below = across(s, &texels[1], &density[1], fx, luminance);
        let density = above.1 * (one - fy) + below.1 * fy;
        LookLanes {
            radiance: (above.0.scaled(one - fy) + below.0.scaled(fy)) * Vectors::splat(s, scale),
            pdf: density / sin.max(Floats::splat(s, f32::MIN_POSITIVE)),
        }
    }
}
