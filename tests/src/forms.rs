//! Closed forms of radiative transfer between simple shapes, in f64.
//!
//! Formulas by Howell, *A Catalog of Radiation Heat Transfer Configuration Factors* (B-5, B-12, C-11, C-14), and by Lambert
//! (1760) for polygons: each of them can be held against the other.

use crate::world::{V3, cross, dot, sub, unit};
use core::f64::consts::PI;
use hotspot_scene::Mesh;

/// Irradiance at `p` with normal `n` from a polygon of radiance 1 that lies wholly above the horizon, as seen by its
/// corners: positive when they run clockwise seen from `p` (that is, when `p` is behind the front), negative otherwise
/// (Lambert 1760; Arvo, *Analytic Methods for Simulated Light Transport*, 1995, equation 2.16).
pub fn lambert(corners: &[V3], p: V3, n: V3) -> f64 {
    let r: Vec<V3> = corners.iter().map(|c| unit(sub(*c, p))).collect();
    let edges = (0..r.len()).map(|i| {
        let (a, b) = (r[i], r[(i + 1) % r.len()]);
        let c = cross(a, b);
        let sin = dot(c, c).sqrt();
        if sin == 0.0 { 0.0 } else { sin.atan2(dot(a, b)) * dot(c, n) / sin }
    });
    0.5 * edges.sum::<f64>()
}

/// Irradiance at `p` with normal `n` from the fronts of a convex mesh of radiance 1, all of it above the horizon: its
/// triangles cannot hide each other.
pub fn convex_mesh(mesh: &Mesh, p: V3, n: V3) -> f64 {
    let corner = |i: u32| mesh.positions[i as usize].map(f64::from);
    mesh.triangles
        .iter()
        .map(|t| t.map(corner))
        .filter(|[a, b, c]| dot(cross(sub(*b, *a), sub(*c, *a)), sub(p, *a)) > 0.0)
        .map(|t| lambert(&t, p, n).abs())
        .sum()
}

/// From a sphere of radiance 1, radius r, centre at `to` as seen from the point: π (r/d)² cos θ.
pub fn sphere(to: V3, radius: f64, n: V3) -> f64 {
    let d2 = dot(to, to);
    PI * radius * radius / d2 * dot(to, n) / d2.sqrt()
}

/// From a disk of radiance 1 parallel to the surface, at height `h`, its centre aside by `d` (B-12).
pub fn parallel_disk(radius: f64, h: f64, d: f64) -> f64 {
    let (r2, h2, d2) = (radius * radius, h * h, d * d);
    0.5 * PI * (1.0 - (d2 + h2 - r2) / ((d2 + h2 + r2).powi(2) - 4.0 * r2 * d2).sqrt())
}

/// From an a × b rectangle of radiance 1 parallel to the surface, at height `h` with one corner over the point (B-5).
pub fn parallel_rectangle_corner(a: f64, b: f64, h: f64) -> f64 {
    let (x, y) = (a / h, b / h);
    let part = |x: f64, y: f64| x / x.hypot(1.0) * (y / x.hypot(1.0)).atan();
    0.5 * (part(x, y) + part(y, x))
}

/// The share of what a unit square sends out that reaches an equal one opposite, at distance `c` (C-11).
pub fn opposite_squares(c: f64) -> f64 {
    let x = 1.0 / c;
    let root = x.hypot(1.0);
    let log = ((1.0 + x * x).powi(2) / (1.0 + 2.0 * x * x)).sqrt().ln();
    2.0 / (PI * x * x) * (log + 2.0 * x * root * (x / root).atan() - 2.0 * x * x.atan())
}

/// The same for unit squares that share an edge at a right angle (C-14, H = W = 1).
pub fn adjoining_squares() -> f64 {
    let log = (4.0f64 / 3.0).ln() + 2.0 * 0.75f64.ln();
    (2.0 * 1f64.atan() - 2f64.sqrt() * (0.5f64.sqrt()).atan() + 0.25 * log) / PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::{rectangle_corners, sphere as ball};

    const UP: V3 = [0.0, 1.0, 0.0];

    #[test]
    fn lambert_agrees_with_the_catalogue() {
        let corners = [[0.0, 0.7, 0.0], [0.0, 0.7, 1.3], [0.4, 0.7, 1.3], [0.4, 0.7, 0.0]];
        let by_corner = parallel_rectangle_corner(0.4, 1.3, 0.7);
        assert!((lambert(&corners, [0.0; 3], UP).abs() / by_corner - 1.0).abs() < 1e-12);
        // A polygon of many sides is a disk.
        let ring = |i: i32| {
            let (s, c) = (f64::from(i) * core::f64::consts::TAU / 4096.0).sin_cos();
            [0.9 + 0.5 * c, 1.1, 0.5 * s]
        };
        let ring: Vec<V3> = (0..4096).map(ring).collect();
        assert!((lambert(&ring, [0.0; 3], UP).abs() / parallel_disk(0.5, 1.1, 0.9) - 1.0).abs() < 1e-6);
        assert!(
            (convex_mesh(&ball([0.3, 2.0, 0.1], 0.5, 5, false), [0.0; 3], UP)
                / sphere([0.3, 2.0, 0.1], 0.5, UP)
                - 1.0)
                .abs()
                < 5e-4
        );
    }

    /// Form factors as means of irradiance over the receiving square, and as tables give them.
    #[test]
    fn form_factors_are_means_of_irradiance() {
        assert!((opposite_squares(1.0) - 0.199_825).abs() < 1e-6);
        assert!((adjoining_squares() - 0.200_044).abs() < 1e-6);
        for distance in [0.5, 2.0] {
            let above = rectangle_corners([0.0, distance, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]);
            let n = 100;
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) - 0.5;
            let points = (0..n * n).map(|i| [at(i % n), 0.0, at(i / n)]);
            let mean = points.map(|p| lambert(&above, p, UP).abs()).sum::<f64>() / f64::from(n * n);
            assert!((mean / PI / opposite_squares(distance) - 1.0).abs() < 1e-4);
        }
    }
}
