//! Where a constant environment is seen from: learned before the render.
//!
//! A room lit through its windows sees the environment in a small part of all directions, and light sampling that does not
//! know which part casts most of its shadow rays at walls. So walks through the scene ([`learn`](super::learn)) note, for the
//! surfaces in each cell of a coarse grid, in which directions rays escaped. Surfaces in one cell that face different ways see
//! different things: a cell holds six distributions, by the axis nearest to the normal.
//!
//! **Distribution.** Directions fall into bins of equal solid angle (cos θ × φ about +Z); one number chooses the row, the other
//! the column, both in few bytes ([`steps`](super::steps)). Counts are shared with the cells
//! beside and blurred over neighbouring bins, then stand for a density that is constant in each bin. A share goes by the
//! receiver's cosine over the whole hemisphere as without learning, the larger the fewer rays escaped: so every direction can
//! be sampled, whatever was learned, and the estimate is unbiased.

use super::steps::Steps;
use crate::math::{FRAC_1_PI, Frame, atan2_turns, sin_cos_turn, square_to_cosine_hemisphere};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Cells along the longest edge of the scene.
const CELLS: f32 = 20.0;
/// Bins along cos θ, and along φ.
const ROWS: usize = 16;
const COLUMNS: usize = 32;
const BINS: usize = ROWS * COLUMNS;
/// Density of a uniform direction in one of [`BINS`] bins.
const PER_BIN: f32 = BINS as f32 * 0.25 * FRAC_1_PI;
/// Least share that goes by the cosine alone.
const DEFENSIVE: f32 = 0.05;
/// So many escapes are worth as much as knowing nothing.
const TRUST: f32 = 4.0;
/// No distribution.
pub(super) const NOWHERE: u16 = u16::MAX;
// All views of a grid have a number.
const _: () = assert!((CELLS as usize + 1).pow(3) * 6 < NOWHERE as usize);

/// A grid of six orientations per cell.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    min: Vec3,
    per_length: f32,
    size: [u32; 3],
}

impl Grid {
    pub(super) fn new((min, max): ([f32; 3], [f32; 3])) -> Self {
        let (min, max) = (Vec3::from_array(min), Vec3::from_array(max));
        let longest = (max - min).max_element();
        let per_length = if longest > 0.0 && longest.is_finite() { CELLS / longest } else { 0.0 };
        let size = ((max - min) * per_length).to_array().map(|x| (x as u32).min(CELLS as u32) + 1);
        Self { min, per_length, size }
    }

    /// The number of the orientation and cell of a surface; points outside belong to the nearest cell.
    #[inline(always)]
    pub(super) fn key(&self, p: Vec3, n: Vec3) -> u32 {
        let at = (p - self.min) * self.per_length;
        // Float to integer saturates.
        let [x, y, z] = [0, 1, 2].map(|i| (at[i] as u32).min(self.size[i] - 1));
        let a = n.abs();
        let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
        let face = 2 * axis as u32 + u32::from(n[axis] < 0.0);
        ((z * self.size[1] + y) * self.size[0] + x) * 6 + face
    }

    fn keys(&self) -> usize {
        self.size.iter().map(|s| *s as usize).product::<usize>() * 6
    }

    /// The same orientation in the up to six cells beside.
    fn beside(&self, key: u32) -> impl Iterator<Item = u32> {
        let (cell, face) = (key / 6, key % 6);
        let size = self.size.map(i64::from);
        let at =
            [cell % self.size[0], cell / self.size[0] % self.size[1], cell / (self.size[0] * self.size[1])];
        let at = at.map(i64::from);
        (0..6).filter_map(move |side| {
            let mut at = at;
            at[side / 2] += if side % 2 == 0 { 1 } else { -1 };
            let inside = (0..3).all(|i| (0..size[i]).contains(&at[i]));
            inside.then(|| ((at[2] * size[1] + at[1]) * size[0] + at[0]) as u32 * 6 + face)
        })
    }
}

/// The learned distributions.
#[derive(Debug)]
pub(super) struct Windows {
    grid: Grid,
    /// View from each orientation of each cell, or [`NOWHERE`].
    view_of: Vec<u16>,
    views: Vec<View>,
}

/// Directions in which the environment is seen: the row by the first number, the column in it by the second. What a choice
/// reads are two or three cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct View {
    rows: Steps<u16, ROWS>,
    /// Share that goes by the cosine.
    cosine: f32,
    columns: [Steps<u8, COLUMNS>; ROWS],
}

/// A ray that met nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Escape {
    /// Key of the surface that it left times [`BINS`], and bin of its direction.
    code: u32,
    weight: f32,
}

impl Escape {
    /// `weight`: the density by the cosine over the sum of the densities of all rays that were tried there, which makes
    /// sums of weights what the environment brings (Veach's balance heuristic).
    #[inline(always)]
    pub(super) fn new(key: u32, bin: usize, weight: f32) -> Self {
        Self { code: key * BINS as u32 + bin as u32, weight }
    }

    fn key(&self) -> u32 {
        self.code / BINS as u32
    }

    fn bin(&self) -> usize {
        self.code as usize % BINS
    }
}

/// The bin of a unit direction.
#[inline(always)]
pub(super) fn bin(d: Vec3) -> usize {
    let row = (((d.z + 1.0) * (0.5 * ROWS as f32)) as usize).min(ROWS - 1);
    let column = (((atan2_turns(d.y, d.x) + 0.5) * COLUMNS as f32) as usize).min(COLUMNS - 1);
    row * COLUMNS + column
}

impl View {
    /// From rays that escaped from here, and from beside.
    fn new<'a>(own: &[Escape], beside: impl Iterator<Item = &'a Escape>) -> Self {
        let mut shared = [0.0; BINS];
        let mut total = 0.0;
        own.iter().for_each(|escape| shared[escape.bin()] += escape.weight);
        total += own.len() as f32;
        for escape in beside {
            shared[escape.bin()] += 0.25 * escape.weight;
            total += 0.25;
        }
        let blurred = blurred(&shared);
        let mut rows = [0.0; ROWS];
        let mut columns = [Steps::new(&[0.0; COLUMNS]); ROWS];
        for (row, weights) in blurred.as_chunks::<COLUMNS>().0.iter().enumerate() {
            rows[row] = weights.iter().sum();
            columns[row] = Steps::new(weights);
        }
        Self {
            rows: Steps::new(&rows),
            cosine: DEFENSIVE + (1.0 - DEFENSIVE) * TRUST / (TRUST + total),
            columns,
        }
    }

    /// Density per solid angle in a bin, given that the cosine is not followed.
    #[inline(always)]
    fn density(&self, bin: usize) -> f32 {
        let (row, column) = (bin / COLUMNS, bin % COLUMNS);
        PER_BIN * self.rows.probability(row) * self.columns[row].probability(column)
    }
}

impl Windows {
    /// From escaped rays; leaves them sorted.
    pub(super) fn new(grid: Grid, escapes: &mut [Escape]) -> Self {
        // Stable: sums must not depend on the number of threads.
        escapes.par_sort_by_key(|escape| escape.code);
        let keys: Vec<&[Escape]> = escapes.chunk_by(|a, b| a.key() == b.key()).collect();
        let mut view_of = vec![NOWHERE; grid.keys()];
        for (view, own) in keys.iter().enumerate() {
            view_of[own[0].key() as usize] = view as u16;
        }
        let view = |own: &&[Escape]| {
            let beside = grid.beside(own[0].key()).map(|key| view_of[key as usize]);
            View::new(own, beside.filter_map(|view| keys.get(usize::from(view))).copied().flatten())
        };
        let views = keys.par_iter().map(view).collect();
        Self { grid, view_of, views }
    }

    /// Number of distributions.
    pub(super) fn len(&self) -> usize {
        self.views.len()
    }

    /// The distribution for a surface, or [`NOWHERE`].
    #[inline(always)]
    pub(super) fn find(&self, p: Vec3, n: Vec3) -> u16 {
        self.view_of[self.grid.key(p, n) as usize]
    }

    /// Density per solid angle of unit direction `d`, which makes cosine `cos` with the normal.
    #[inline(always)]
    pub(super) fn pdf(&self, view: u16, d: Vec3, cos: f32) -> f32 {
        let by_cosine = FRAC_1_PI * cos.max(0.0);
        let Some(view) = self.views.get(usize::from(view)) else { return by_cosine };
        view.cosine * by_cosine + (1.0 - view.cosine) * view.density(bin(d))
    }

    /// A unit direction in the world, and its density per solid angle.
    #[inline(always)]
    pub(super) fn sample(&self, view: u16, frame: &Frame, u: Vec2) -> (Vec3, f32) {
        let Some(view) = self.views.get(usize::from(view)) else {
            let local = square_to_cosine_hemisphere(u);
            return (frame.to_world(local), FRAC_1_PI * local.z);
        };
        let share = view.cosine;
        if u.x < share {
            let local = square_to_cosine_hemisphere(Vec2::new(u.x / share, u.y));
            let d = frame.to_world(local);
            return (d, share * FRAC_1_PI * local.z + (1.0 - share) * view.density(bin(d)));
        }
        let rest = ((u.x - share) / (1.0 - share)).clamp(0.0, 1.0 - f32::EPSILON);
        let row = view.rows.sample(rest);
        let column = view.columns[row.index].sample(u.y);
        let z = (row.index as f32 + row.rest) * (2.0 / ROWS as f32) - 1.0;
        let (sin, cos) =
            sin_cos_turn(((column.index as f32 + column.rest) * (1.0 / COLUMNS as f32) + 0.5).fract());
        let r = (1.0 - z * z).max(0.0).sqrt();
        let d = Vec3::new(r * cos, r * sin, z);
        let learned = PER_BIN * row.probability * column.probability;
        (d, share * FRAC_1_PI * d.dot(frame.n).max(0.0) + (1.0 - share) * learned)
    }
}

/// Spread over neighbouring bins by 1 2 1 along both axes.
fn blurred(counts: &[f32; BINS]) -> [f32; BINS] {
    let at = |row: usize, column: usize| counts[row * COLUMNS + column % COLUMNS];
    let along: [f32; BINS] = core::array::from_fn(|i| {
        let (r, c) = (i / COLUMNS, i % COLUMNS);
        at(r, c + COLUMNS - 1) + 2.0 * at(r, c) + at(r, c + 1)
    });
    core::array::from_fn(|i| {
        let (below, above) =
            (i.checked_sub(COLUMNS).unwrap_or(i), if i + COLUMNS < BINS { i + COLUMNS } else { i });
        along[below] + 2.0 * along[i] + along[above]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn windows() -> Windows {
        let grid = Grid::new(([0.0; 3], [4.0, 2.0, 3.0]));
        let key = grid.key(Vec3::ONE, Vec3::Y);
        let towards = Vec3::new(0.3, 0.9, -0.2).normalize();
        let direction = |i: u8| (towards + Vec3::X * (f32::from(i) * 0.01)).normalize();
        let mut escapes: Vec<_> = (0..40).map(|i| Escape::new(key, bin(direction(i)), 1.0)).collect();
        Windows::new(grid, &mut escapes)
    }

    /// Sampled directions fall into boxes of directions as often as the density says, and their bins are their own.
    #[test]
    fn samples_follow_their_density() {
        let windows = windows();
        let found = windows.find(Vec3::ONE, Vec3::Y);
        assert_ne!(found, NOWHERE);
        let frame = Frame::new(Vec3::Y);
        const N: usize = 512;
        let mut irradiance = 0.0f64;
        let mut other = 0;
        let mut hits = vec![0u32; BINS];
        for i in 0..N * N {
            let u = Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) / N as f32;
            let (d, pdf) = windows.sample(found, &frame, u);
            assert!((d.length() - 1.0).abs() < 1e-5);
            assert!(pdf > 0.0);
            // But for directions that round into the bin beside.
            other += usize::from((windows.pdf(found, d, d.dot(frame.n)) / pdf - 1.0).abs() > 1e-4);
            if d.y > 0.0 {
                // ∫ cos over the hemisphere = E[cos / pdf], which is bounded.
                irradiance += f64::from(d.y / pdf) / (N * N) as f64;
            }
            hits[bin(d)] += 1;
        }
        assert!((irradiance / core::f64::consts::PI - 1.0).abs() < 0.01, "{irradiance}");
        assert!(other * 1000 < N * N, "{other}");
        // In the bins that escapes point to, the density holds bin by bin.
        let view = &windows.views[usize::from(found)];
        for (b, hits) in hits.iter().enumerate() {
            let learned = (1.0 - view.cosine) * view.density(b) / PER_BIN;
            assert!(f64::from(*hits) >= 0.98 * f64::from(learned) * (N * N) as f64 - 2.0, "{b}");
        }
    }

    #[test]
    fn where_nothing_was_learned_the_cosine_serves() {
        let windows = windows();
        let nowhere = windows.find(Vec3::new(3.9, 0.1, 0.1), Vec3::X);
        assert_eq!(nowhere, NOWHERE);
        let (d, pdf) = windows.sample(nowhere, &Frame::new(Vec3::Z), Vec2::new(0.3, 0.8));
        assert_eq!(pdf, FRAC_1_PI * d.z);
        assert_eq!(windows.pdf(nowhere, d, d.z), FRAC_1_PI * d.z);
        assert_eq!(windows.pdf(nowhere, -d, -d.z), 0.0);
    }

    #[test]
    fn odd_points_and_scenes_have_a_cell() {
        for bounds in [([0.0; 3], [0.0; 3]), ([-1e30; 3], [1e30; 3]), ([1.0, 1.0, 1.0], [1.0, 9.0, 1.0])] {
            let grid = Grid::new(bounds);
            for p in [Vec3::ZERO, Vec3::NAN, Vec3::splat(f32::MAX), Vec3::splat(-1e9)] {
                for n in [Vec3::X, Vec3::NEG_Z, Vec3::NAN, Vec3::ZERO] {
                    assert!((grid.key(p, n) as usize) < grid.keys());
                }
            }
        }
        for d in [Vec3::NAN, Vec3::ZERO, Vec3::Z, Vec3::NEG_X] {
            assert!(bin(d) < BINS);
        }
    }
}
