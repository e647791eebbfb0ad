//! Vectors, frames and warps: small, exact about its arithmetic, the same on every machine.
//!
//! Only IEEE operations and square roots are used, in a fixed order and without contraction, so results do not depend on
//! the processor or the platform's libm.

use core::hint::select_unpredictable;
use glam::{Vec2, Vec3};

/// 1/π.
pub(crate) const FRAC_1_PI: f32 = core::f32::consts::FRAC_1_PI;
/// π.
pub(crate) const PI: f32 = core::f32::consts::PI;

/// sin and cos of x in [−π/4, π/4]: Taylor series to x⁹ and x⁸, error below 4e-8.
#[inline(always)]
fn sin_cos_eighth(x: f32) -> (f32, f32) {
    let x2 = x * x;
    let sin =
        x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362_880.0)))));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    (sin, cos)
}

/// sin and cos of 2πu for u in [0, 1].
#[inline(always)]
pub(crate) fn sin_cos_turn(u: f32) -> (f32, f32) {
    let quarter = (u * 4.0 + 0.5) as u32;
    let (s, c) = sin_cos_eighth((u * 4.0 - quarter as f32) * core::f32::consts::FRAC_PI_2);
    // Odd quarters exchange the two; which quarter it is, no predictor knows.
    let odd = quarter & 1 != 0;
    let negated = |x: f32, when: u32| f32::from_bits(x.to_bits() ^ (when & 2) << 30);
    (
        negated(select_unpredictable(odd, c, s), quarter),
        negated(select_unpredictable(odd, s, c), quarter.wrapping_add(1)),
    )
}

/// The angle of (x, y) with the x axis in turns, in [−½, ½]; 0 at the origin. As [`f32::atan2`] otherwise, but for the sign
/// of zeros. Error below 3e-8: that of a polynomial for atan up to π/8, interpolated at Chebyshev's points (1e-9), and
/// rounding.
#[inline(always)]
pub(crate) fn atan2_turns(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (long, short) = (select_unpredictable(ay > ax, ay, ax), select_unpredictable(ay > ax, ax, ay));
    // Above π/8 from the difference with π/4.
    let steep = short > 0.414_213_56 * long;
    let above = select_unpredictable(steep, short - long, short);
    let below = select_unpredictable(steep, short + long, long.max(f32::MIN_POSITIVE));
    let t = above / below;
    let t2 = t * t;
    let p = 0.159_154_94
        + t2 * (-0.053_050_776 + t2 * (0.031_789_74 + t2 * (-0.022_040_557 + t2 * 0.012_694_663)));
    let mut turns = t * p + select_unpredictable(steep, 0.125, 0.0);
    turns = select_unpredictable(ay > ax, 0.25 - turns, turns);
    turns = select_unpredictable(x < 0.0, 0.5 - turns, turns);
    turns.copysign(y)
}

/// The concentric map of Shirley and Chiu, *A Low Distortion Map Between Disk and Square* (1997): the unit square to the
/// unit disk, uniformly.
#[inline(always)]
pub(crate) fn square_to_disk(u: Vec2) -> Vec2 {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    // Which of the two is longer, no predictor knows.
    let wide = a.abs() > b.abs();
    let (radius, other) = (select_unpredictable(wide, a, b), select_unpredictable(wide, b, a));
    if radius == 0.0 {
        return Vec2::ZERO;
    }
    let (s, c) = sin_cos_eighth(core::f32::consts::FRAC_PI_4 * (other / radius));
    let (along, across) = (radius * c, radius * s);
    Vec2::new(select_unpredictable(wide, along, across), select_unpredictable(wide, across, along))
}

/// A direction of the upper hemisphere with pdf cos θ / π.
#[inline(always)]
pub(crate) fn square_to_cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = square_to_disk(u);
    d.extend((1.0 - d.x * d.x - d.y * d.y).max(0.0).sqrt())
}

/// Barycentric weights of the second and third corner, uniform over the triangle. The split of Heitz, *A Low-Distortion
/// Map Between Triangle and Square* (2019).
#[inline(always)]
pub(crate) fn square_to_triangle(u: Vec2) -> (f32, f32) {
    let above = u.y > u.x;
    let half = 0.5 * select_unpredictable(above, u.x, u.y);
    (select_unpredictable(above, half, u.x - half), select_unpredictable(above, u.y - half, half))
}

/// An orthonormal frame around a unit normal: Duff et al., *Building an Orthonormal Basis, Revisited* (JCGT 2017).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) s: Vec3,
    pub(crate) t: Vec3,
    pub(crate) n: Vec3,
}

impl Frame {
    #[inline(always)]
    pub(crate) fn new(n: Vec3) -> Self {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    #[inline(always)]
    pub(crate) fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    #[inline(always)]
    pub(crate) fn to_world(self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// The fifth power.
#[inline(always)]
pub(crate) fn pow5(x: f32) -> f32 {
    let x2 = x * x;
    x2 * x2 * x
}

/// Veach's power heuristic with exponent 2, robust against overflow: the weight of a sample taken with `pdf` where
/// `other` could have taken it too.
#[inline(always)]
pub(crate) fn power_heuristic(pdf: f32, other: f32) -> f32 {
    if pdf == f32::INFINITY {
        return 1.0;
    }
    let ratio = other / pdf;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_accurate_over_the_turn() {
        for i in 0..=100_000 {
            let u = i as f32 / 100_000.0;
            let (s, c) = sin_cos_turn(u);
            let angle = f64::from(u) * core::f64::consts::TAU;
            assert!((f64::from(s) - angle.sin()).abs() < 3e-7, "{u}");
            assert!((f64::from(c) - angle.cos()).abs() < 3e-7, "{u}");
        }
    }

    #[test]
    fn angles_are_accurate_all_around() {
        for i in 0..=100_000 {
            let angle = (f64::from(i) / 50_000.0 - 1.0) * core::f64::consts::PI;
            for length in [1.0, 1e-18, 1e18] {
                let (y, x) = ((length * angle.sin()) as f32, (length * angle.cos()) as f32);
                let expected = f64::from(y).atan2(x.into()) / core::f64::consts::TAU;
                let off = (f64::from(atan2_turns(y, x)) - expected).abs();
                assert!(off < 3e-8 || (off - 1.0).abs() < 3e-8, "{angle}: {off}");
            }
        }
        // Small angles keep their digits; the axes are exact.
        for y in [1e-30f32, 1e-10, 1e-3] {
            let expected = f64::from(y).atan() / core::f64::consts::TAU;
            assert!((f64::from(atan2_turns(y, 1.0)) / expected - 1.0).abs() < 2e-7);
        }
        for (y, x, turns) in
            [(0.0, 1.0, 0.0), (1.0, 0.0, 0.25), (0.0, -1.0, 0.5), (-1.0, 0.0, -0.25), (0.0, 0.0, 0.0)]
        {
            assert_eq!(atan2_turns(y, x), turns);
        }
    }

    #[test]
    fn frames_are_orthonormal_everywhere() {
        for i in 0..1000 {
            let (s, c) = sin_cos_turn((i as f32 * 0.618_034).fract());
            let z = (i as f32 / 499.5 - 1.0).clamp(-1.0, 1.0);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let f = Frame::new(Vec3::new(r * c, r * s, z).normalize());
            let dots = [f.s.dot(f.t), f.s.dot(f.n), f.t.dot(f.n)];
            assert!(dots.iter().all(|d| d.abs() < 1e-6), "{f:?}");
            assert!((f.s.cross(f.t).dot(f.n) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn warps_are_uniform() {
        // Means of a fine grid against the closed forms.
        let n = 512;
        let (mut hemisphere, mut triangle, mut disk) = (Vec3::ZERO, Vec2::ZERO, 0.0);
        for i in 0..n * n {
            let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            hemisphere += square_to_cosine_hemisphere(u) / (n * n) as f32;
            let (b, c) = square_to_triangle(u);
            assert!(b >= 0.0 && c >= 0.0 && b + c <= 1.0 + 1e-6);
            triangle += Vec2::new(b, c) / (n * n) as f32;
            disk += square_to_disk(u).length_squared() / (n * n) as f32;
        }
        assert!((hemisphere - Vec3::new(0.0, 0.0, 2.0 / 3.0)).length() < 1e-3, "{hemisphere}");
        assert!((triangle - Vec2::splat(1.0 / 3.0)).length() < 1e-3, "{triangle}");
        assert!((disk - 0.5).abs() < 1e-3, "{disk}");
    }

    #[test]
    fn power_heuristic_sums_to_one_and_survives_extremes() {
        for (a, b) in [(1.0, 3.0), (1e-30, 1e30), (1e30, 1e-30), (0.5, 0.0)] {
            let sum = power_heuristic(a, b) + if b > 0.0 { power_heuristic(b, a) } else { 0.0 };
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}");
        }
    }
}
