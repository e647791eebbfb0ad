//! Do samples follow their density? Pearson's chi-square over cells, as pbrt-v4's `bsdfs_test.cpp` does it.
//!
//! A sphere of directions around an axis is cut into 80 × 160 cells of polar angle and azimuth; what falls outside of them
//! (beyond the last polar angle, or no sample at all) is one cell more. Expectations are integrals of the density,
//! adaptively in f64. Cells that expect less than 5 are pooled. A suite states the rate of any false alarm over all of its
//! tests (0.01), from which the level of each follows (Šidák 1967).

use glam::DVec3;

/// Rows of polar angle and columns of azimuth, as in pbrt.
pub(crate) const ROWS: usize = 80;
pub(crate) const COLUMNS: usize = 160;
/// Samples of a test, as in pbrt.
pub(crate) const SAMPLES: usize = 1_000_000;
/// Rate of any false alarm in a suite.
const FAMILY: f64 = 0.01;
/// Cells that expect less are taken together.
const LEAST: f64 = 5.0;

/// Uniform in [0, 1): SplitMix64 (Steele, Lea, Flood 2014).
#[derive(Clone, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 40) as f64 / 16_777_216.0
    }

    /// Below 1, with the bits that the sampler gives.
    pub(crate) fn single(&mut self) -> f32 {
        self.unit() as f32
    }
}

/// Cells of directions around an axis, out to a polar angle, finer towards the axis for a power above 1.
pub(crate) struct Cells {
    axis: DVec3,
    s: DVec3,
    t: DVec3,
    limit: f64,
    power: i32,
}

impl Cells {
    /// `limit`: the last polar angle; rows have their ends at limit · (row / rows)^power.
    pub(crate) fn new(axis: DVec3, limit: f64, power: i32) -> Self {
        let axis = axis.normalize();
        let (s, t) = axis.any_orthonormal_pair();
        Self { axis, s, t, limit, power }
    }

    /// The hemisphere around +z, rows of equal angle.
    pub(crate) fn hemisphere() -> Self {
        Self::new(DVec3::Z, core::f64::consts::FRAC_PI_2, 1)
    }

    /// `None` beyond the last row.
    pub(crate) fn cell(&self, w: DVec3) -> Option<usize> {
        let (x, y, z) = (w.dot(self.s), w.dot(self.t), w.dot(self.axis));
        let row = (x.hypot(y).atan2(z) / self.limit).powf(f64::from(self.power).recip()) * ROWS as f64;
        let turns = y.atan2(x) / core::f64::consts::TAU;
        let column = (turns - turns.floor()) * COLUMNS as f64;
        (row < ROWS as f64).then(|| row as usize * COLUMNS + (column as usize).min(COLUMNS - 1))
    }

    /// Integral of the density over each cell, times `SAMPLES`.
    pub(crate) fn expected(&self, density: &impl Fn(DVec3) -> f64) -> Vec<f64> {
        let at = |[v, u]: [f64; 2]| {
            let (sin, cos) = (self.limit * v.powi(self.power)).sin_cos();
            let (s, c) = (core::f64::consts::TAU * u).sin_cos();
            let stretch =
                self.limit * f64::from(self.power) * v.powi(self.power - 1) * core::f64::consts::TAU;
            let d = density(self.s * (sin * c) + self.t * (sin * s) + self.axis * cos);
            d * sin * stretch * SAMPLES as f64
        };
        (0..ROWS * COLUMNS)
            .map(|i| {
                let (row, column) = ((i / COLUMNS) as f64, (i % COLUMNS) as f64);
                integral(
                    &at,
                    [row / ROWS as f64, column / COLUMNS as f64],
                    [1.0 / ROWS as f64, 1.0 / COLUMNS as f64],
                    0,
                )
            })
            .collect()
    }
}

/// Gauss-Legendre with 3 × 3 points, halved both ways until that changes little.
fn integral(f: &impl Fn([f64; 2]) -> f64, from: [f64; 2], size: [f64; 2], depth: u32) -> f64 {
    let gauss = |from: [f64; 2], size: [f64; 2]| {
        let points =
            [(0.5 - 0.15f64.sqrt(), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + 0.15f64.sqrt(), 5.0 / 18.0)];
        let mut sum = 0.0;
        for (v, wv) in points {
            for (u, wu) in points {
                sum += wv * wu * f([from[0] + size[0] * v, from[1] + size[1] * u]);
            }
        }
        sum * size[0] * size[1]
    };
    let half = size.map(|s| 0.5 * s);
    let parts = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]
        .map(|[v, u]| [from[0] + v * half[0], from[1] + u * half[1]]);
    let whole = gauss(from, size);
    let sum: f64 = parts.iter().map(|p| gauss(*p, half)).sum();
    if depth >= 7 || (whole - sum).abs() <= 1e-3 + 1e-4 * sum {
        return sum;
    }
    parts.iter().map(|p| integral(f, *p, half, depth + 1)).sum()
}

/// Probability that chi-square of `dof` degrees of freedom is at least `x`: Wilson and Hilferty (1931), good to a few percent of
/// itself from some thirty degrees on.
fn upper_tail(x: f64, dof: f64) -> f64 {
    let k = 2.0 / (9.0 * dof);
    let z = ((x / dof).cbrt() - (1.0 - k)) / k.sqrt();
    0.5 * libm::erfc(z / core::f64::consts::SQRT_2)
}

/// How unlikely so large a chi-square is.
pub(crate) fn p_value(observed: &[u64], expected: &[f64]) -> f64 {
    let (mut pool, mut pool_hits, mut chi2, mut cells) = (0.0, 0.0, 0.0, 0.0);
    for (&hits, &expected) in observed.iter().zip(expected) {
        if expected < LEAST {
            pool += expected;
            pool_hits += hits as f64;
        } else {
            chi2 += (hits as f64 - expected).powi(2) / expected;
            cells += 1.0;
        }
    }
    if pool >= LEAST {
        chi2 += (pool_hits - pool).powi(2) / pool;
        cells += 1.0;
    } else if pool_hits > 30.0 {
        // Poisson with a mean below 5: 30 and more happen once in 10^14.
        return 0.0;
    }
    if cells < 2.0 { 1.0 } else { upper_tail(chi2, cells - 1.0) }
}

/// Tests of which none may fail.
pub(crate) struct Suite {
    results: Vec<(String, f64)>,
}

impl Suite {
    pub(crate) const fn new() -> Self {
        Self { results: Vec::new() }
    }

    pub(crate) fn add(&mut self, what: String, p: f64) {
        self.results.push((what, p));
    }

    /// Draws samples (`None`: nothing) and compares them with a density per solid angle.
    pub(crate) fn directions(
        &mut self,
        what: String,
        cells: &Cells,
        density: impl Fn(DVec3) -> f64,
        mut sample: impl FnMut() -> Option<DVec3>,
    ) {
        let mut expected = cells.expected(&density);
        let mut observed = vec![0; expected.len() + 1];
        for _ in 0..SAMPLES {
            observed[sample().and_then(|w| cells.cell(w)).unwrap_or(ROWS * COLUMNS)] += 1;
        }
        let elsewhere = SAMPLES as f64 - expected.iter().sum::<f64>();
        assert!(elsewhere > -1e-3 * SAMPLES as f64, "{what}: density integrates to more than 1");
        expected.push(elsewhere.max(0.0));
        self.add(what, p_value(&observed, &expected));
    }

    /// Fails when any test is below the level of the family.
    pub(crate) fn finish(self) {
        let level = -f64::exp_m1(f64::ln_1p(-FAMILY) / self.results.len() as f64);
        let bad: Vec<_> = self.results.iter().filter(|r| r.1 < level).collect();
        assert!(bad.is_empty(), "{} tests, level {level:.1e}, below it: {bad:#?}", self.results.len());
    }
}

#[test]
fn the_tail_of_chi_square() {
    // Abramowitz and Stegun, table 26.8.
    for (dof, x, p) in
        [(30.0, 50.892, 0.01), (100.0, 135.807, 0.01), (30.0, 29.336, 0.5), (30.0, 59.703, 0.001)]
    {
        assert!((upper_tail(x, dof) / p - 1.0).abs() < 0.05, "{dof}");
    }
}

/// Cells around any axis integrate a constant to its solid angle and put directions where they belong.
#[test]
fn cells_cover_their_cap() {
    for (axis, limit, power) in
        [(DVec3::Z, 1.5, 1), (DVec3::new(0.3, -0.5, 0.1), 0.02, 3), (DVec3::X, 3.1, 2)]
    {
        let cells = Cells::new(axis, limit, power);
        let sum: f64 = cells.expected(&|_| 1.0).iter().sum();
        let cap = core::f64::consts::TAU * 2.0 * (0.5 * limit).sin().powi(2);
        assert!((sum / SAMPLES as f64 / cap - 1.0).abs() < 1e-6);
        // A density that is 1 in one cell integrates to something there and nowhere else (but beside its borders).
        for index in [0, 17, 5000, ROWS * COLUMNS - 1] {
            let expected = cells.expected(&|w| f64::from(u8::from(cells.cell(w) == Some(index))));
            assert!(expected[index] > 0.0);
            assert!(expected.iter().enumerate().all(|(i, e)| i == index || *e <= 1e-2 * expected[index]));
        }
    }
}
