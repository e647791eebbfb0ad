//! Energy and reciprocity.

use super::super::metal::reflect;
use super::{all, direction, over_samples};
use crate::bsdf::Bsdf;
use crate::chi_square::Random;
use core::f64::consts::PI;
use glam::Vec3;

/// ∫ g(f cos, pdf) dω over the hemisphere, by the midpoint rule: of the half vector (the lobe) and of the direction (the rest),
/// each where its share of the density is the larger.
pub(super) fn over_hemisphere(bsdf: &Bsdf, wo: Vec3, g: impl Fn(Vec3, f32) -> f64) -> f64 {
    let alpha = match bsdf {
        Bsdf::Substrate(s) => f64::from(s.alpha),
        Bsdf::RoughMetal(m) => f64::from(m.alpha),
        _ => 1.0,
    };
    let points = 1 << 18;
    // Densities of the two ways to take wi: cosine, and about a half vector distributed as GGX.
    let cosine = |wi: Vec3| f64::from(wi.z) / PI;
    let about = |wi: Vec3| {
        let h = (wi.as_dvec3() + wo.as_dvec3()).normalize();
        let t = h.x * h.x + h.y * h.y + alpha * alpha * h.z * h.z;
        alpha * alpha / (PI * t * t) * h.z / (4.0 * wi.as_dvec3().dot(h))
    };
    let mut sum = 0.0;
    let mut add = |wi: Vec3| {
        if wi.z > 0.0 {
            let (f_cos, pdf) = bsdf.eval(wo, wi);
            // The balance heuristic, as a quadrature.
            sum += g(f_cos, pdf) / (cosine(wi) + about(wi));
        }
    };
    for i in 0..points {
        // A lattice of the golden ratio: its points lie on no common line that an edge of the integrand could follow.
        let u = (f64::from(i) + 0.5) / f64::from(points);
        let turns = (f64::from(i) * 0.618_033_988_749_894_9).fract();
        add(direction((1.0 - u).sqrt() as f32, turns as f32));
        let cos2 = (1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u);
        let sin = (alpha * alpha * u / (1.0 + (alpha * alpha - 1.0) * u)).sqrt();
        let (s, c) = (2.0 * PI * turns).sin_cos();
        add(reflect(wo, Vec3::new((sin * c) as f32, (sin * s) as f32, cos2.sqrt() as f32)));
    }
    sum / f64::from(points)
}

/// At every incidence at most 1.01 of what arrives is scattered, and sampling gives the same albedo as quadrature.
#[test]
fn no_more_is_scattered_than_arrives() {
    for (name, bsdf) in all() {
        for i in 0..12 {
            // Down to a grazing angle of 0.03 degrees.
            let cos = [1.0f32, 0.95, 0.8, 0.6, 0.4, 0.25, 0.15, 0.08, 0.04, 0.015, 0.004, 0.0005][i];
            let wo = direction(cos, 0.3);
            let sampled = over_samples(&bsdf, wo, 256, |s| s.map_or(0.0, |s| f64::from(s.weight.x)));
            assert!(sampled < 1.01, "{name}, cos {cos}: albedo {sampled}");
            let integrated = over_hemisphere(&bsdf, wo, |f_cos, _| f64::from(f_cos.x));
            assert!(
                (sampled - integrated).abs() < if cos < 0.01 { 1e-2 } else { 2e-3 },
                "{name}, cos {cos}: sampled {sampled}, integrated {integrated}"
            );
        }
    }
}

/// f(wo, wi) = f(wi, wo) within 1e-4 of itself: 20 000 pairs each, anywhere and near the mirror direction.
#[test]
fn scattering_is_reciprocal() {
    let mut random = Random(7);
    for (name, bsdf) in all() {
        for i in 0..20_000 {
            let wo = direction(0.01 + 0.99 * random.single(), random.single());
            let mut wi = direction(0.01 + 0.99 * random.single(), random.single());
            if i % 2 == 0 {
                let near =
                    Vec3::new(random.single() - 0.5, random.single() - 0.5, 0.0) * 0.2 * random.single();
                wi = (reflect(wo, Vec3::Z) + near).normalize();
            }
            let there = f64::from(bsdf.eval(wo, wi).0.x) / f64::from(wi.z);
            let back = f64::from(bsdf.eval(wi, wo).0.x) / f64::from(wo.z);
            let off = (there - back).abs();
            assert!(off <= 1e-4 * there, "{name}: f({wo}, {wi}) = {there}, back {back}");
        }
    }
}
