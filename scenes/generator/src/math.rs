//! Vectors, affine maps, splines and dice for the scene generator. Lengths are metres, angles are turns (1 = full circle).
//!
//! Only additions, multiplications, divisions and square roots of `f64` are used, which IEEE 754 rounds in one way
//! on every machine: regenerating a scene gives the same bytes everywhere. The platform's `sin`, `cos` and `pow` do not.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// A point or a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Vec3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// Short for the constructor.
pub(crate) const fn v(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3 { x, y, z }
}

pub(crate) const X: Vec3 = v(1.0, 0.0, 0.0);
pub(crate) const Y: Vec3 = v(0.0, 1.0, 0.0);
pub(crate) const Z: Vec3 = v(0.0, 0.0, 1.0);

impl Vec3 {
    pub(crate) fn dot(self, o: Vec3) -> f64 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    pub(crate) fn cross(self, o: Vec3) -> Vec3 {
        v(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    pub(crate) fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The unit vector, or zero for zero.
    pub(crate) fn unit(self) -> Vec3 {
        let l = self.length();
        if l > 0.0 { self * (1.0 / l) } else { self }
    }

    pub(crate) fn array(self) -> [f64; 3] {
        [self.x, self.y, self.z]
    }
}

impl Add for Vec3 {
    type Output = Vec3;
    fn add(self, o: Vec3) -> Vec3 {
        v(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl AddAssign for Vec3 {
    fn add_assign(&mut self, o: Vec3) {
        *self = *self + o;
    }
}

impl Sub for Vec3 {
    type Output = Vec3;
    fn sub(self, o: Vec3) -> Vec3 {
        v(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Vec3;
    fn mul(self, s: f64) -> Vec3 {
        v(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for Vec3 {
    type Output = Vec3;
    fn neg(self) -> Vec3 {
        v(-self.x, -self.y, -self.z)
    }
}

/// Sine and cosine of `turns` full circles; exact at the quarters.
pub(crate) fn sin_cos(turns: f64) -> (f64, f64) {
    let t = turns - turns.floor();
    let quarter = (t * 4.0 + 0.5).floor();
    let x = (t - quarter * 0.25) * std::f64::consts::TAU;
    let q = x * x;
    // Taylor polynomials on [-pi/4, pi/4]: the first terms left out are below 1e-16.
    let mut sin = 0.0;
    let mut cos = 0.0;
    for k in (0..9).rev() {
        let n = f64::from(2 * k);
        sin = 1.0 - sin * q / ((n + 2.0) * (n + 3.0));
        cos = 1.0 - cos * q / ((n + 1.0) * (n + 2.0));
    }
    sin *= x;
    match quarter as u32 % 4 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// An affine map: the three images of the axes, and of the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Affine {
    pub(crate) x: Vec3,
    pub(crate) y: Vec3,
    pub(crate) z: Vec3,
    pub(crate) t: Vec3,
}

impl Affine {
    pub(crate) const IDENTITY: Affine = Affine { x: X, y: Y, z: Z, t: v(0.0, 0.0, 0.0) };

    pub(crate) fn translate(t: Vec3) -> Affine {
        Affine { t, ..Affine::IDENTITY }
    }

    pub(crate) fn scale(s: Vec3) -> Affine {
        Affine { x: X * s.x, y: Y * s.y, z: Z * s.z, t: Vec3::default() }
    }

    /// Rotation about `axis` (unit), counter-clockwise seen from its tip.
    pub(crate) fn rotate(axis: Vec3, turns: f64) -> Affine {
        let (s, c) = sin_cos(turns);
        let turn = |p: Vec3| p * c + axis.cross(p) * s + axis * (axis.dot(p) * (1.0 - c));
        Affine { x: turn(X), y: turn(Y), z: turn(Z), t: Vec3::default() }
    }

    /// The same map followed by `next`.
    pub(crate) fn then(self, next: Affine) -> Affine {
        Affine {
            x: next.direction(self.x),
            y: next.direction(self.y),
            z: next.direction(self.z),
            t: next.point(self.t),
        }
    }

    /// Short for `then(translate)`.
    pub(crate) fn at(self, x: f64, y: f64, z: f64) -> Affine {
        self.then(Affine::translate(v(x, y, z)))
    }

    pub(crate) fn direction(&self, d: Vec3) -> Vec3 {
        self.x * d.x + self.y * d.y + self.z * d.z
    }

    pub(crate) fn point(&self, p: Vec3) -> Vec3 {
        self.direction(p) + self.t
    }

    pub(crate) fn determinant(&self) -> f64 {
        self.x.dot(self.y.cross(self.z))
    }

    /// The normal's image: by the inverse transpose, unit length.
    pub(crate) fn normal(&self, n: Vec3) -> Vec3 {
        let image = self.y.cross(self.z) * n.x + self.z.cross(self.x) * n.y + self.x.cross(self.y) * n.z;
        image.unit() * if self.determinant() < 0.0 { -1.0 } else { 1.0 }
    }
}

/// A quaternion (x, y, z, w) for a rotation about `axis`, as glTF wants it.
pub(crate) fn quaternion(axis: Vec3, turns: f64) -> [f64; 4] {
    let (s, c) = sin_cos(turns * 0.5);
    [axis.x * s, axis.y * s, axis.z * s, c]
}

/// A Catmull-Rom spline through `keys`, at `t` in 0 ..= 1 (equal share per span).
pub(crate) fn spline<const N: usize>(keys: &[[f64; N]], t: f64) -> [f64; N] {
    let spans = keys.len() - 1;
    let at = (t.clamp(0.0, 1.0)) * spans as f64;
    let i = (at.floor() as usize).min(spans - 1);
    let u = at - i as f64;
    let key = |k: isize| keys[k.clamp(0, spans as isize) as usize];
    let (a, b, c, d) = (key(i as isize - 1), key(i as isize), key(i as isize + 1), key(i as isize + 2));
    std::array::from_fn(|n| {
        let (p0, p1, p2, p3) = (a[n], b[n], c[n], d[n]);
        let cubic = -p0 + 3.0 * p1 - 3.0 * p2 + p3;
        let square = 2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3;
        0.5 * (2.0 * p1 + u * ((p2 - p0) + u * (square + u * cubic)))
    })
}

/// Smooth step from 0 to 1 as `x` goes from `lo` to `hi`.
pub(crate) fn smoothstep(lo: f64, hi: f64, x: f64) -> f64 {
    let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A seeded source of numbers (SplitMix64).
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Dice {
        Dice(seed)
    }

    /// Uniform in `lo .. hi`.
    pub(crate) fn range(&mut self, lo: f64, hi: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        lo + (hi - lo) * ((z >> 11) as f64 / (1u64 << 53) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_match_the_platform() {
        for i in -2000..2000 {
            let t = f64::from(i) / 777.0;
            let (s, c) = sin_cos(t);
            let (ps, pc) = (t * std::f64::consts::TAU).sin_cos();
            assert!((s - ps).abs() < 1e-14 && (c - pc).abs() < 1e-14, "{t}");
        }
        assert_eq!(sin_cos(0.25), (1.0, 0.0));
        assert_eq!(sin_cos(0.5).1, -1.0);
    }

    #[test]
    fn spline_passes_through_its_keys() {
        let keys = [[0.0], [1.0], [4.0], [2.0]];
        for (i, k) in keys.iter().enumerate() {
            assert!((spline(&keys, i as f64 / 3.0)[0] - k[0]).abs() < 1e-12);
        }
    }

    #[test]
    fn rotation_keeps_handedness() {
        let r = Affine::rotate(v(1.0, 2.0, 3.0).unit(), 0.17);
        assert!((r.determinant() - 1.0).abs() < 1e-12);
        assert!((Affine::rotate(Y, 0.25).point(Z) - X).length() < 1e-15);
    }
}
