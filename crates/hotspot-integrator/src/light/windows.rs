//! Where a constant environment is seen from: learned before the render.
//!
//! A room lit through its windows sees the environment in a small part of all directions, and light sampling that does not
//! know which part casts most of its shadow rays at walls. So walks through the scene ([`learn`](super::learn)) note, for the
//! surfaces in each cell of a coarse grid, in which directions rays escaped. Surfaces in one cell that face different ways see
//! different things: a cell holds six distributions, by the axis nearest to the geometric normal.
//!
//! **Backing off.** Few rays escape from any one cell, so cells lie in coarser ones, each twice as long. What is seen from a
//! cell is what escaped from it and, for as many escapes as [`PRIOR`] besides, what is seen from the coarser cell around (as
//! if by a Dirichlet prior). Cells that nothing escaped from share the view of the smallest coarser one that something did.
//!
//! **Distribution.** Directions fall into bins of equal solid angle (cos θ × φ about +Z); one number chooses the row, the other
//! the column, both in few bytes ([`steps`](super::steps)). Counts are blurred over neighbouring bins, then stand for a density
//! that is constant in each bin. A share goes by the receiver's cosine over the whole hemisphere as without learning, the larger
//! the less is known, and the more of the hemisphere is open: so every direction can be sampled, whatever was learned, and the
//! estimate is unbiased.

use super::steps::Steps;
use crate::math::{FRAC_1_PI, Frame, atan2_turns, sin_cos_turn, square_to_cosine_hemisphere};
use glam::{Vec2, Vec3};
use hotspot_bvh::simd::Simd;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Cells along the longest edge of the scene.
const CELLS: f32 = 20.0;
/// Sizes of cells, each twice the one before.
const LEVELS: u32 = 4;
/// Escapes that what is seen from the coarser cell around is worth. A quarter of it, or three times as much, costs the living
/// room 2 % more error.
const PRIOR: f32 = 32.0;
/// As [`PRIOR`], of visits, for how open a cell is.
const PRIOR_VISITS: f32 = 8.0;
/// Bits of a cell's number along an edge.
const BITS: u32 = 5;
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
/// So many more where it is wide open.
const TRUST_OPEN: f32 = 128.0;
/// Share of the cosine-weighted hemisphere from which on a view is wide open: then all goes by the cosine, since surfaces of one cell
/// differ in their normals, and their cosines matter more than what little is hidden.
const WIDE_OPEN: f32 = 0.5;
/// No distribution.
pub(super) const NOWHERE: u16 = u16::MAX;
// All views of a grid have a number, all cells a code.
const _: () = {
    let (mut views, mut level) = (0, 0);
    while level < LEVELS {
        views += ((CELLS as usize >> level) + 1).pow(3) * 6;
        level += 1;
    }
    assert!(views <= NOWHERE as usize && (CELLS as u32) < 1 << BITS);
};

/// A grid of six orientations per cell.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    min: Vec3,
    per_length: f32,
    size: [u32; 3],
}

/// An orientation of a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key {
    at: [u32; 3],
    face: u32,
}

impl Key {
    /// Orientation, then cells so that those in one coarser cell follow one another.
    #[inline(always)]
    fn code(self) -> u32 {
        (self.face << (3 * BITS)) | spread(self.at[0]) | (spread(self.at[1]) << 1) | (spread(self.at[2]) << 2)
    }

    fn of(code: u32) -> Self {
        Self { at: [0, 1, 2].map(|i| gather(code >> i)), face: code >> (3 * BITS) }
    }
}

/// Each bit to thrice its place.
fn spread(x: u32) -> u32 {
    (0..BITS).map(|b| ((x >> b) & 1) << (3 * b)).sum()
}

/// What [`spread`] spread.
fn gather(x: u32) -> u32 {
    (0..BITS).map(|b| ((x >> (3 * b)) & 1) << b).sum()
}

impl Grid {
    pub(super) fn new((min, max): ([f32; 3], [f32; 3])) -> Self {
        let (min, max) = (Vec3::from_array(min), Vec3::from_array(max));
        let longest = (max - min).max_element();
        let per_length = if longest > 0.0 && longest.is_finite() { CELLS / longest } else { 0.0 };
        let size = ((max - min) * per_length).to_array().map(|x| (x as u32).min(CELLS as u32) + 1);
        Self { min, per_length, size }
    }

    /// The cell and orientation of a surface about `p` with geometric normal `n` ([`met`](super::met)); points outside belong to the nearest cell.
    #[inline(always)]
    pub(super) fn key(&self, p: Vec3, n: Vec3) -> Key {
        let at = (p - self.min) * self.per_length;
        // Float to integer saturates.
        let at = [0, 1, 2].map(|i| (at[i] as u32).min(self.size[i] - 1));
        let a = n.abs();
        let axis = if a.x >= a.y && a.x >= a.z { 0 } else { 1 + usize::from(a.z > a.y) };
        let face = 2 * axis as u32 + u32::from(n[axis] < 0.0);
        Key { at, face }
    }

    /// A key's number, less than [`Grid::keys`].
    #[inline(always)]
    pub(super) fn index(&self, Key { at: [x, y, z], face }: Key) -> usize {
        (((z * self.size[1] + y) * self.size[0] + x) * 6 + face) as usize
    }

    /// Numbers of the cells of the finest level in a coarser one, in its orientation.
    fn within(&self, code: u32, level: u32) -> impl Iterator<Item = usize> {
        let Key { at, face } = Key::of(code);
        let [x, y, z] = [0, 1, 2].map(|i| {
            let first = (at[i] >> level) << level;
            first..(first + (1 << level)).min(self.size[i])
        });
        z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| self.index(Key { at: [x, y, z], face })))
        })
    }

    pub(super) fn keys(&self) -> usize {
        self.size.iter().map(|s| *s as usize).product::<usize>() * 6
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
    /// Code of the key of the surface that it left times [`BINS`], and bin of its direction.
    code: u32,
    weight: f32,
}

impl Escape {
    /// `weight`: the density by the cosine over the sum of the densities of all rays that were tried there, which makes
    /// sums of weights what the environment brings (Veach's balance heuristic).
    #[inline(always)]
    pub(super) fn new(key: Key, bin: usize, weight: f32) -> Self {
        Self { code: key.code() * BINS as u32 + bin as u32, weight }
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
    /// From what is known of its cell.
    fn new(known: &Known) -> Self {
        let mut rows = [0.0; ROWS];
        let mut columns = [Steps::new(&[0.0; COLUMNS]); ROWS];
        for (row, weights) in known.bins.as_chunks::<COLUMNS>().0.iter().enumerate() {
            rows[row] = weights.iter().sum();
            columns[row] = Steps::new(weights);
        }
        // Where nothing is hidden the cosine is the best that there is, and bins only approach it; the more of them are seen, the
        // more escapes it takes.
        let open = (known.open / WIDE_OPEN).min(1.0);
        let open = open * open;
        let trust = TRUST + TRUST_OPEN * open;
        let unknown = DEFENSIVE + (1.0 - DEFENSIVE) * trust / (trust + known.escapes);
        Self { rows: Steps::new(&rows), cosine: unknown.max(open), columns }
    }

    /// Density per solid angle in a bin, given that the cosine is not followed.
    #[inline(always)]
    fn density(&self, bin: usize) -> f32 {
        let (row, column) = (bin / COLUMNS, bin % COLUMNS);
        PER_BIN * self.rows.probability(row) * self.columns[row].probability(column)
    }
}

/// What is known of a cell.
struct Known {
    /// Orientation and cell, without what finer cells add.
    code: u32,
    /// How many escapes it is worth.
    escapes: f32,
    /// Share of the cosine-weighted hemisphere that sees the environment.
    open: f32,
    /// Sums to 1, if there is any weight.
    bins: [f32; BINS],
}

impl Known {
    /// From rays that escaped from here, at how many places they were looked for, and what is known of the coarser cell around.
    fn new(code: u32, own: &[Escape], visits: u32, around: Option<&Self>) -> Self {
        let mut counts = [0.0; BINS];
        own.iter().for_each(|escape| counts[escape.bin()] += escape.weight);
        let seen: f32 = counts.iter().sum();
        let mut bins = blurred(&counts);
        let mut escapes = own.len() as f32;
        let mut open = seen / (visits as f32).max(1.0);
        let total: f32 = bins.iter().sum();
        // Weights may be too small for a sum.
        let scale = if total >= f32::MIN_POSITIVE { 1.0 / total } else { 0.0 };
        bins.iter_mut().for_each(|bin| *bin *= scale);
        if let Some(around) = around {
            let share = PRIOR / (PRIOR + escapes);
            bins.iter_mut().zip(&around.bins).for_each(|(bin, other)| *bin += share * (other - *bin));
            escapes += share * around.escapes.min(PRIOR);
            open = (seen + PRIOR_VISITS * around.open) / (visits as f32 + PRIOR_VISITS);
        }
        Self { code, escapes, open: open.min(1.0), bins }
    }
}

impl Windows {
    /// From escaped rays, and how many places of each key they were looked for at; leaves them sorted.
    pub(super) fn new(grid: Grid, escapes: &mut [Escape], visits: &[AtomicU32]) -> Self {
        // Stable: sums must not depend on the number of threads.
        escapes.par_sort_by_key(|escape| escape.code);
        let mut view_of = vec![NOWHERE; grid.keys()];
        let mut views = Vec::new();
        let mut around: Vec<Known> = Vec::new();
        for level in (0..LEVELS).rev() {
            let code = |escape: &Escape| escape.key() >> (3 * level);
            let cells: Vec<&[Escape]> = escapes.chunk_by(|a, b| code(a) == code(b)).collect();
            // Finer cells replace what coarser ones wrote.
            for (i, own) in cells.iter().enumerate() {
                let view = (views.len() + i) as u16;
                grid.within(own[0].key(), level).for_each(|index| view_of[index] = view);
            }
            let known = |own: &&[Escape]| {
                let code = code(&own[0]);
                let at = around.binary_search_by_key(&(code >> 3), |known| known.code);
                let visits = grid.within(own[0].key(), level).map(|i| visits[i].load(Relaxed)).sum();
                Known::new(code, own, visits, at.ok().map(|at| &around[at]))
            };
            if level == 0 {
                views.par_extend(cells.par_iter().map(|own| View::new(&known(own))));
            } else {
                let all: Vec<Known> = cells.par_iter().map(known).collect();
                views.par_extend(all.par_iter().map(View::new));
                around = all;
            }
        }
        Self { grid, view_of, views }
    }

    /// Number of distributions.
    pub(super) fn len(&self) -> usize {
        self.views.len()
    }

    /// The distribution for a surface ([`Grid::key`]), or [`NOWHERE`].
    #[inline(always)]
    pub(super) fn find(&self, p: Vec3, n: Vec3) -> u16 {
        self.view_of[self.grid.index(self.grid.key(p, n))]
    }

    /// Asks for what a choice reads first of a view.
    #[inline(always)]
    pub(super) fn fetch<S: Simd>(&self, s: S, view: u16) {
        s.prefetch(self.views.as_ptr().wrapping_add(usize::from(view)).cast());
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

    fn grid() -> Grid {
        Grid::new(([0.0; 3], [4.0, 2.0, 3.0]))
    }

    /// Escapes upwards from points whose normal is +Y: `count` at each, of `visits`.
    fn learned(points: &[(Vec3, u32)], visits: u32) -> Windows {
        let grid = grid();
        let seen: Vec<AtomicU32> = (0..grid.keys()).map(|_| AtomicU32::new(0)).collect();
        let mut escapes = Vec::new();
        for (p, count) in points {
            let key = grid.key(*p, Vec3::Y);
            seen[grid.index(key)].store(visits, Relaxed);
            for i in 0..*count {
                let towards = Vec3::new(0.3 - 0.8 * p.x.fract(), 0.9, -0.2) + Vec3::X * (i as f32 * 0.01);
                escapes.push(Escape::new(key, bin(towards.normalize()), 1.0));
            }
        }
        Windows::new(grid, &mut escapes, &seen)
    }

    fn windows() -> Windows {
        learned(&[(Vec3::ONE, 40)], 4000)
    }

    /// Sampled directions fall into boxes of directions as often as the density says, and their bins are their own: where
    /// rays escaped, where others escaped beside, where none did, and under an open sky.
    #[test]
    fn samples_follow_their_density() {
        let beside = Vec3::new(1.15, 1.0, 1.0);
        let both = [(Vec3::ONE, 40), (beside, 5)];
        agrees(&learned(&[(Vec3::ONE, 40)], 4000), Vec3::ONE);
        agrees(&learned(&both, 4000), beside);
        agrees(&learned(&both, 4000), Vec3::new(1.5, 1.1, 1.1));
        agrees(&learned(&both, 5), beside);
    }

    fn agrees(windows: &Windows, p: Vec3) {
        let found = windows.find(p, Vec3::Y);
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

    /// Cells without escapes share the views of coarser ones, up to the coarsest.
    #[test]
    fn cells_back_off() {
        let windows = learned(&[(Vec3::ONE, 40)], 4000);
        assert_eq!(windows.len(), LEVELS as usize);
        let edge = 4.0 / CELLS;
        let find = |cells: f32| windows.find(Vec3::new(1.0 + (cells + 0.5) * edge, 1.0, 1.0), Vec3::Y);
        // It is the sixth cell; cells twice, four and eight times as long end after it, two and two further.
        let views = [0.0, -1.0, 1.0, 2.0, -2.0, -5.0, 3.0, 10.0].map(find);
        assert_eq!(views, [3, 2, 1, 1, 0, 0, NOWHERE, NOWHERE]);
        // The second point shares the largest two of the four with the first, the third the largest.
        let others = [1.5, -3.5].map(|cells| (Vec3::new(1.0 + cells * edge, 1.0, 1.0), 3));
        let several = learned(&[(Vec3::ONE, 40), others[0], others[1]], 4000);
        assert_eq!(several.len(), 1 + 2 + 3 + 3);
        let views = [Vec3::ONE, others[0].0, others[1].0].map(|p| several.find(p, Vec3::Y));
        assert_eq!(views, [7, 8, 6]);
    }

    /// What is known of a cell is its own escapes, and for [`PRIOR`] more what is known around.
    #[test]
    fn coarser_cells_are_a_prior() {
        let escapes =
            |bin: usize, count: usize| vec![Escape::new(Key { at: [0; 3], face: 0 }, bin, 0.5); count];
        let middle = |row: usize, column: usize| row * COLUMNS + column;
        let (here, there) = (middle(4, 4), middle(10, 20));
        let around = Known::new(0, &escapes(there, 100), 200, None);
        assert!((around.bins.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        // The middle of 1 2 1 along both axes.
        assert!((around.bins[there] - 0.25).abs() < 1e-5);
        assert!((around.open - 0.25).abs() < 1e-5);
        let known = Known::new(0, &escapes(here, 10), 5, Some(&around));
        assert!((known.bins.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((known.bins[here] - 0.25 * 10.0 / (10.0 + PRIOR)).abs() < 1e-5);
        assert!((known.bins[there] - 0.25 * PRIOR / (10.0 + PRIOR)).abs() < 1e-5);
        assert!((known.escapes - (10.0 + PRIOR * PRIOR / (10.0 + PRIOR))).abs() < 1e-3);
        assert!((known.open - (5.0 + PRIOR_VISITS * 0.25) / (5.0 + PRIOR_VISITS)).abs() < 1e-5);
        // The more escapes, the less goes by the cosine; unless all is open.
        let share = |count, visits| View::new(&Known::new(0, &escapes(here, count), visits, None)).cosine;
        assert!(share(1, 1000) > share(10, 1000) && share(10, 1000) > share(1000, 100_000));
        assert!(share(1000, 1_000_000) < 1.5 * DEFENSIVE);
        assert_eq!(share(1000, 500), 1.0);
        assert_eq!(share(10_000, 10_000), 1.0);
        // Half as wide: more than that alone makes it, since a hundred escapes do not fill so many bins.
        assert!(share(100, 200) > 0.29 && share(100, 200) < 0.31 && share(10_000, 20_000) == 0.25);
        // Next to no weight, and none that has a number.
        for weight in [0.0, 1e-45, f32::MIN_POSITIVE] {
            let own = [Escape { code: here as u32, weight }];
            for around in [None, Some(&around)] {
                let known = Known::new(0, &own, 0, around);
                assert!(known.bins.iter().all(|bin| bin.is_finite()), "{weight}");
                let view = View::new(&known);
                assert!((0.0..=1.0).contains(&view.cosine));
                assert!((0..BINS).all(|bin| view.density(bin).is_finite()));
            }
        }
    }

    /// Codes are those of the cells around, and more bits.
    #[test]
    fn codes_lie_in_those_of_coarser_cells() {
        let grid = grid();
        let mut seen = vec![0; grid.keys()];
        for (x, y, z) in (0..21 * 11 * 16).map(|i| (i % 21, i / 21 % 11, i / 21 / 11)) {
            for face in 0..6 {
                let key = Key { at: [x, y, z], face };
                assert_eq!((Key::of(key.code()).at, Key::of(key.code()).face), (key.at, face));
                for level in 0..LEVELS {
                    let code = key.code() >> (3 * level);
                    let coarse = Key { at: key.at.map(|x| x >> level), face: 0 }.code();
                    assert_eq!(code, coarse | (face << (3 * (BITS - level))));
                    let within: Vec<usize> = grid.within(key.code(), level).collect();
                    assert!(within.contains(&grid.index(key)) && within.len() <= 1 << (3 * level));
                }
                grid.within(key.code(), 0).for_each(|index| seen[index] += 1);
            }
        }
        assert!(seen.iter().all(|count| *count == 1));
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
                    assert!(grid.index(grid.key(p, n)) < grid.keys());
                }
            }
        }
        for d in [Vec3::NAN, Vec3::ZERO, Vec3::Z, Vec3::NEG_X] {
            assert!(bin(d) < BINS);
        }
    }
}
