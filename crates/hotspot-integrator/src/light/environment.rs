//! An equirectangular map around the scene: look-ups and importance sampling.
//!
//! What a direction shows is the bilinear interpolation of the texels in (φ, θ), round in φ, held beyond the first and the
//! last row. Interpolation weighs each texel by a tent around it (over the edge rows: half a tent and half a box), all of
//! the same area. So a mixture is sampled: a texel in proportion to its luminance and its row's solid angle, then a
//! place under its tent. The density of that is the same interpolation again, of luminance times the row's solid angle:
//! exact, positive wherever there is light, free of fireflies (radiance over density hardly varies, at the scale of texels
//! too), and found from the texels that the look-up reads anyway.
//!
//! In the picture (w × h texels, x and y in texels) the density is q(x, y) / Σ s L, with L a texel's luminance, s its row's
//! solid angle, and q the interpolation of s L. Per solid angle that is w h / (2π² sin θ) times as much.

use super::guided::Guided;
use crate::math::{atan2_turns, sin_cos_turn};
use glam::{DVec3, Vec2, Vec3};
use hotspot_scene::EnvironmentMap;
use std::sync::Arc;

/// Luminance of linear Rec.709 (ITU-R BT.709).
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// A map made ready for look-ups and sampling.
#[derive(Clone, Debug)]
pub(crate) struct EnvironmentSampler {
    width: usize,
    height: usize,
    texels: Arc<[[f32; 3]]>,
    scale: Vec3,
    /// Turns, in [0, 1): added to the place in the picture of a direction.
    rotation: f32,
    /// Dotted with a texel: its luminance, scale included, over that of the brightest.
    luminance: Vec3,
    /// By row: density per solid angle times sin θ where the luminance is 1.
    row_density: Vec<f32>,
    rows: Guided,
    /// One distribution for each row.
    columns: Guided,
    /// Integrated over the sphere and summed over channels: W/m².
    flux: f64,
}

/// What a direction shows, and how likely it is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub(crate) radiance: Vec3,
    /// Per solid angle, given that the environment is chosen.
    pub(crate) pdf: f32,
}

impl EnvironmentSampler {
    /// Bytes of texels that a look-up touches.
    pub(crate) const LOOKUP_BYTES: u32 = 4 * size_of::<[f32; 3]>() as u32;

    /// `Ok(None)` for a map without light.
    ///
    /// # Errors
    /// What is wrong with a map whose texels do not fill it or whose numbers are not finite and at least 0.
    pub(crate) fn new(map: &EnvironmentMap) -> Result<Option<Self>, &'static str> {
        let (width, height) = (map.width as usize, map.height as usize);
        if width == 0 || height == 0 || width.checked_mul(height) != Some(map.texels.len()) {
            return Err("does not hold width x height texels");
        }
        let fine = |c: &f32| c.is_finite() && *c >= 0.0;
        if !map.texels.iter().flatten().all(fine) {
            return Err("has a texel that is not finite and at least 0");
        }
        if !map.scale.iter().all(fine) {
            return Err("has a scale that is not finite and at least 0");
        }
        if !map.rotation.is_finite() {
            return Err("has a rotation that is not finite");
        }
        let scale = Vec3::from_array(map.scale);
        let weights = LUMINANCE * scale.as_dvec3();
        let of = |texel: &[f32; 3]| DVec3::from_array(texel.map(f64::from));
        let brightest = map.texels.iter().map(|t| of(t).dot(weights)).fold(0.0, f64::max);
        if brightest <= 0.0 {
            return Ok(None);
        }
        let luminance = (weights / brightest).min(DVec3::splat(1e38)).as_vec3();

        let mut columns = Guided::with_capacity(height, width);
        let mut row_weights = Vec::with_capacity(height);
        let mut row_density = Vec::with_capacity(height);
        let mut flux = 0.0;
        for (y, row) in map.texels.chunks_exact(width).enumerate() {
            let angle = solid_angle(y, width, height);
            let texels = row.iter().map(|t| f64::from(Vec3::from_array(*t).dot(luminance)));
            row_weights.push(angle * columns.push(texels));
            row_density.push(angle);
            flux += angle * row.iter().map(|t| (of(t) * scale.as_dvec3()).element_sum()).sum::<f64>();
        }
        let mut rows = Guided::with_capacity(1, height);
        let total = rows.push(row_weights.into_iter());
        if total <= 0.0 {
            return Ok(None);
        }
        let per_solid_angle =
            map.texels.len() as f64 / (2.0 * core::f64::consts::PI * core::f64::consts::PI * total);
        let turns = map.rotation / core::f64::consts::TAU;
        Ok(Some(Self {
            width,
            height,
            texels: map.texels.clone(),
            scale,
            rotation: fraction((turns - turns.floor()) as f32),
            luminance,
            row_density: row_density.into_iter().map(|angle| (angle * per_solid_angle) as f32).collect(),
            rows,
            columns,
            flux,
        }))
    }

    /// Radiance integrated over the sphere and summed over channels (W/m²), texels taken as plates of one colour.
    pub(crate) fn flux(&self) -> f64 {
        self.flux
    }

    /// Bytes held, texels included.
    pub(crate) fn memory(&self) -> u64 {
        (size_of_val(&self.texels[..]) + size_of_val(&self.row_density[..])) as u64
            + self.rows.memory()
            + self.columns.memory()
    }

    /// What unit vector `direction` shows.
    #[inline(never)]
    pub(crate) fn look_up(&self, direction: Vec3) -> Look {
        let sin = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let u = fraction(atan2_turns(direction.x, -direction.z) + 0.5 + self.rotation);
        let v = 2.0 * atan2_turns(sin, direction.y);
        self.at(u * self.width as f32, v * self.height as f32, sin)
    }

    /// A direction by importance; `u` in [0, 1)²: its first number chooses the row, its second the column, and what each
    /// leaves the place under the tent. `None` where rounding leaves no light.
    #[inline(never)]
    pub(crate) fn sample(&self, u: Vec2) -> Option<(Vec3, Look)> {
        let (row, down) = self.row(u.x);
        let (column, across) = self.column(row, u.y);
        let x = column as f32 + 0.5 + tent(across);
        let y = match down {
            d if d < 0.5 && row == 0 => d,
            d if d >= 0.5 && row + 1 == self.height => row as f32 + d,
            d => row as f32 + 0.5 + tent(d),
        };
        let (sin, cos) = sin_cos_turn((0.5 * y / self.height as f32).clamp(0.0, 0.5));
        // sin φ and −cos φ, for φ half a turn before the picture's left edge.
        let (s, c) = sin_cos_turn(fraction(x / self.width as f32 - self.rotation));
        let wi = Vec3::new(-s * sin, cos, c * sin);
        let look = self.at(x, y, sin);
        (look.pdf > 0.0 && look.pdf.is_finite()).then_some((wi, look))
    }

    /// Width, height and rotation.
    #[inline(always)]
    pub(super) fn frame(&self) -> (usize, usize, f32) {
        (self.width, self.height, self.rotation)
    }

    /// What texels are multiplied by for radiance, and dotted with for luminance.
    #[inline(always)]
    pub(super) fn weights(&self) -> ([f32; 3], [f32; 3]) {
        (self.scale.to_array(), self.luminance.to_array())
    }

    /// Two texels of a row, and the row's density.
    #[inline(always)]
    pub(super) fn texels(&self, columns: [usize; 2], row: usize) -> ([[f32; 3]; 2], f32) {
        (columns.map(|column| self.texels[row * self.width + column]), self.row_density[row])
    }

    /// The row that a number chooses, and the place in it.
    #[inline(always)]
    pub(super) fn row(&self, u: f32) -> (usize, f32) {
        self.rows.sample(0, u)
    }

    /// The column of that row that a number chooses, and the place in it.
    #[inline(always)]
    pub(super) fn column(&self, row: usize, u: f32) -> (usize, f32) {
        self.columns.sample(row, u)
    }

    /// Interpolates at a place of the picture (texel centres at halves), seen under polar angle θ of sine `sin`.
    #[inline(always)]
    fn at(&self, x: f32, y: f32, sin: f32) -> Look {
        let ((x, fx), (y, fy)) = (split(x - 0.5), split(y - 0.5));
        let left = if x < 0 { self.width - 1 } else { (x as usize).min(self.width - 1) };
        let right = if left + 1 == self.width { 0 } else { left + 1 };
        let row = |y: i32| (y.max(0) as usize).min(self.height - 1);
        let across = |row: usize| {
            let texel = |x: usize| Vec3::from_array(self.texels[row * self.width + x]);
            let color = texel(left) * (1.0 - fx) + texel(right) * fx;
            (color, color.dot(self.luminance) * self.row_density[row])
        };
        let (above, below) = (across(row(y)), across(row(y.saturating_add(1))));
        let density = above.1 * (1.0 - fy) + below.1 * fy;
        Look {
            radiance: (above.0 * (1.0 - fy) + below.0 * fy) * self.scale,
            pdf: density / sin.max(f32::MIN_POSITIVE),
        }
    }
}

/// Solid angle of a texel of row `y`: 2π/w (cos θ₀ − cos θ₁) between its upper and lower edge, as a product.
fn solid_angle(y: usize, width: usize, height: usize) -> f64 {
    let half = core::f64::consts::FRAC_PI_2 / height as f64;
    let middle = half * (2.0 * y as f64 + 1.0);
    core::f64::consts::TAU / width as f64 * 2.0 * libm::sin(middle) * libm::sin(half)
}

/// A place in (−1, 1) under a tent of height 1 at 0; monotonic.
#[inline(always)]
fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 - 2.0 * u).sqrt() }
}

/// Whole number below and what is left; saturates. (`floor` is a function call where SSE 4.1 may be missing.)
#[inline(always)]
fn split(x: f32) -> (i32, f32) {
    let whole = x as i32;
    let whole = if (whole as f32) > x { whole - 1 } else { whole };
    (whole, x - whole as f32)
}

/// What is left of a small number above the whole number below it, in [0, 1].
#[inline(always)]
fn fraction(x: f32) -> f32 {
    split(x).1
}
