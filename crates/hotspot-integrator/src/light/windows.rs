//! Where a constant environment is seen from: learned before the render.
//!
//! A room lit through its windows sees the environment in a small part of all directions, and light sampling that does not
//! know which part casts most of its shadow rays at walls. So walks through the scene ([`learn`](super::learn)) note, for the
//! surfaces in each cell of a coarse grid, in which directions rays escaped. Surfaces in one cell that face different ways see
//! different things: a cell holds six distributions, by the axis nearest to the normal.
//!
//! **Distribution.** Directions fall into bins of equal solid angle (cos θ × φ about +Z). Counts are shared with the cells
//! beside and blurred over neighbouring bins, then stand for a density that is constant in each bin. A share goes by the
//! receiver's cosine over the whole hemisphere as without learning, the larger the fewer rays escaped: so every direction can
//! be sampled, whatever was learned, and the estimate is unbiased.

use super::guided::Guided;
use crate::math::{FRAC_1_PI, Frame, atan2_turns, sin_cos_turn, square_to_cosine_hemisphere};
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;

/// Cells along the longest edge of the scene.
const CELLS: f32 = 20.0;
/// Bins along cos θ, and along φ.
const ROWS: usize = 16;
const COLUMNS: usize = 32;
const BINS: usize = ROWS * COLUMNS;
/// Density of a uniform direction in one of [`BINS`] bins.
const PER_BIN: f32 = BINS as f32 * 0.25 * FRAC_1_PI;
/// Least share that goes by the cosine alone.
const DEFENSIVE: f32 = 0.2;
/// So many escapes are worth as much as knowing nothing.
const TRUST: f32 = 16.0;
/// No distribution.
pub(super) const NOWHERE: u32 = u32::MAX;

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
    /// Distribution of each orientation of each cell, or [`NOWHERE`].
    distribution: Vec<u32>,
    guided: Guided,
    /// Share of each that goes by the cosine.
    cosine: Vec<f32>,
}

/// The bin of a unit direction.
#[inline(always)]
pub(super) fn bin(d: Vec3) -> usize {
    let row = (((d.z + 1.0) * (0.5 * ROWS as f32)) as usize).min(ROWS - 1);
    let column = (((atan2_turns(d.y, d.x) + 0.5) * COLUMNS as f32) as usize).min(COLUMNS - 1);
    row * COLUMNS + column
}

impl Windows {
    /// From escaped rays: key of the surface that they left, and bin of their direction.
    pub(super) fn new(grid: Grid, escaped: &[(u32, u32)]) -> Self {
        let mut counts: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
        for &(key, bin) in escaped {
            counts.entry(key).or_insert_with(|| vec![0.0; BINS])[bin as usize] += 1.0;
        }
        let mut distribution = vec![NOWHERE; grid.keys()];
        let mut guided = Guided::with_capacity(counts.len(), BINS);
        let mut cosine = Vec::with_capacity(counts.len());
        for (key, own) in &counts {
            let mut shared = own.clone();
            for beside in grid.beside(*key).filter_map(|key| counts.get(&key)) {
                shared.iter_mut().zip(beside).for_each(|(s, b)| *s += 0.25 * b);
            }
            let total: f32 = shared.iter().sum();
            let blurred = blurred(&shared);
            distribution[*key as usize] = cosine.len() as u32;
            guided.push(blurred.iter().map(|w| f64::from(*w)));
            cosine.push(DEFENSIVE + (1.0 - DEFENSIVE) * TRUST / (TRUST + total));
        }
        Self { grid, distribution, guided, cosine }
    }

    /// Number of distributions.
    pub(super) fn len(&self) -> usize {
        self.cosine.len()
    }

    /// The distribution for a surface, or [`NOWHERE`].
    #[inline(always)]
    pub(super) fn find(&self, p: Vec3, n: Vec3) -> u32 {
        self.distribution[self.grid.key(p, n) as usize]
    }

    /// Density per solid angle of unit direction `d`, which makes cosine `cos` with the normal.
    #[inline(always)]
    pub(super) fn pdf(&self, distribution: u32, d: Vec3, cos: f32) -> f32 {
        let by_cosine = FRAC_1_PI * cos.max(0.0);
        if distribution == NOWHERE {
            return by_cosine;
        }
        let share = self.cosine[distribution as usize];
        share * by_cosine + (1.0 - share) * PER_BIN * self.guided.probability(distribution as usize, bin(d))
    }

    /// A unit direction in the world.
    #[inline(always)]
    pub(super) fn sample(&self, distribution: u32, frame: &Frame, u: Vec2) -> Vec3 {
        if distribution == NOWHERE {
            return frame.to_world(square_to_cosine_hemisphere(u));
        }
        let share = self.cosine[distribution as usize];
        if u.x < share {
            return frame.to_world(square_to_cosine_hemisphere(Vec2::new(u.x / share, u.y)));
        }
        let rest = ((u.x - share) / (1.0 - share)).clamp(0.0, 1.0 - f32::EPSILON);
        let (bin, rest) = self.guided.sample(distribution as usize, rest);
        let z = ((bin / COLUMNS) as f32 + rest) * (2.0 / ROWS as f32) - 1.0;
        let (sin, cos) = sin_cos_turn((((bin % COLUMNS) as f32 + u.y) / COLUMNS as f32 + 0.5).fract());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * cos, r * sin, z)
    }
}

/// Spread over neighbouring bins by 1 2 1 along both axes.
fn blurred(counts: &[f32]) -> Vec<f32> {
    let at = |row: usize, column: usize| counts[row * COLUMNS + column % COLUMNS];
    let along: Vec<f32> = (0..BINS)
        .map(|i| (i / COLUMNS, i % COLUMNS))
        .map(|(r, c)| at(r, c + COLUMNS - 1) + 2.0 * at(r, c) + at(r, c + 1))
        .collect();
    (0..BINS)
        .map(|i| {
            let (below, above) =
                (i.checked_sub(COLUMNS).unwrap_or(i), if i + COLUMNS < BINS { i + COLUMNS } else { i });
            along[below] + 2.0 * along[i] + along[above]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn windows() -> Windows {
        let grid = Grid::new(([0.0; 3], [4.0, 2.0, 3.0]));
        let key = grid.key(Vec3::ONE, Vec3::Y);
        let towards = Vec3::new(0.3, 0.9, -0.2).normalize();
        let escaped: Vec<_> =
            (0..40).map(|i| (key, bin((towards + Vec3::X * (i as f32 * 0.01)).normalize()) as u32)).collect();
        Windows::new(grid, &escaped)
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
        let mut hits = vec![0u32; BINS];
        for i in 0..N * N {
            let u = Vec2::new((i % N) as f32 + 0.5, (i / N) as f32 + 0.5) / N as f32;
            let d = windows.sample(found, &frame, u);
            assert!((d.length() - 1.0).abs() < 1e-5);
            let pdf = windows.pdf(found, d, d.dot(frame.n));
            assert!(pdf > 0.0);
            if d.y > 0.0 {
                // ∫ cos over the hemisphere = E[cos / pdf], which is bounded.
                irradiance += f64::from(d.y / pdf) / (N * N) as f64;
            }
            hits[bin(d)] += 1;
        }
        assert!((irradiance / core::f64::consts::PI - 1.0).abs() < 0.01, "{irradiance}");
        // In the bins that escapes point to, the density holds bin by bin.
        let share = windows.cosine[found as usize];
        for (b, hits) in hits.iter().enumerate() {
            let learned = (1.0 - share) * windows.guided.probability(found as usize, b);
            assert!(f64::from(*hits) >= 0.98 * f64::from(learned) * (N * N) as f64 - 2.0, "{b}");
        }
    }

    #[test]
    fn where_nothing_was_learned_the_cosine_serves() {
        let windows = windows();
        let nowhere = windows.find(Vec3::new(3.9, 0.1, 0.1), Vec3::X);
        assert_eq!(nowhere, NOWHERE);
        let d = windows.sample(nowhere, &Frame::new(Vec3::Z), Vec2::new(0.3, 0.8));
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
