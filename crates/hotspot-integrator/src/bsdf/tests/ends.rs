//! The ends of the parameters.

use super::super::metal::reflect;
use super::{direction, metal, over_samples, substrate};
use crate::bsdf::{Bsdf, Glass, RoughMetal, Substrate};
use crate::chi_square::Random;
use glam::{Vec2, Vec3};

/// Nothing but finite numbers: incidences down to denormal cosines, numbers at the ends of [0, 1), α from 1e-3 to 1.
#[test]
fn everything_is_finite() {
    let mut random = Random(3);
    let ends = [0.0f32, 1e-38, 1e-7, 0.5, 0.5f32.next_up(), 1.0 - f32::EPSILON, 1.0f32.next_down()];
    let cosines = [1.0f32, 1.0f32.next_down(), 0.5, 1e-3, 1e-7, 1e-20, f32::MIN_POSITIVE, 1e-45, 0.0];
    for alpha in [1e-3, 1.01e-3, 0.01, 0.3, 1.0] {
        let parts = [
            Bsdf::Substrate(Substrate { diffuse: Vec3::ONE, specular: Vec3::ONE, alpha }),
            Bsdf::Substrate(Substrate { diffuse: Vec3::ONE, specular: Vec3::ZERO, alpha }),
            Bsdf::RoughMetal(RoughMetal { f0: Vec3::ONE, alpha }),
            Bsdf::RoughMetal(RoughMetal { f0: Vec3::ZERO, alpha }),
            Bsdf::Matte(Vec3::ONE),
            Bsdf::Mirror(Vec3::ONE),
            Bsdf::Glass(Glass {
                transmittance: Vec3::ONE,
                eta: 1.0 + alpha,
                thin: false,
                absorption: Vec3::ZERO,
            }),
            Bsdf::Glass(Glass { transmittance: Vec3::ONE, eta: 0.4, thin: false, absorption: Vec3::ZERO }),
            Bsdf::Glass(Glass { transmittance: Vec3::ONE, eta: 3.0, thin: true, absorption: Vec3::ZERO }),
        ];
        for bsdf in parts {
            for cos in cosines {
                let turns = random.single();
                let wo = Vec3 { z: cos, ..direction(cos, turns) };
                let mut numbers: Vec<[f32; 3]> = Vec::new();
                for u in ends {
                    for v in ends {
                        numbers.extend([0.0, 0.49, 0.5, 1.0f32.next_down()].map(|lobe| [lobe, u, v]));
                    }
                }
                for [lobe, u, v] in numbers {
                    if let Some(s) = bsdf.sample(wo, lobe, Vec2::new(u, v)) {
                        let what = || format!("{bsdf:?}, cos {cos}, lobe {lobe}, {u} {v}: {s:?}");
                        assert!(s.wi.is_finite() && (s.wi.length() - 1.0).abs() < 1e-3, "{}", what());
                        assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{}", what());
                        assert!(s.pdf > 0.0 && (s.pdf.is_finite() || bsdf.is_specular()), "{}", what());
                    }
                    let wi = direction(u, v);
                    for wi in [wi, reflect(wo, Vec3::Z), wo, Vec3 { z: cos, ..-wo }] {
                        let (f, pdf) = bsdf.eval(wo, wi);
                        assert!(f.is_finite() && f.min_element() >= 0.0, "{bsdf:?}, {wo} {wi}: {f}");
                        assert!(pdf.is_finite() && pdf >= 0.0, "{bsdf:?}, {wo} {wi}: {pdf}");
                    }
                }
            }
        }
    }
}

/// Roughness to 0: metal of base colour 1 sends everything to where a mirror does (Schlick's Fresnel is 1 there), within
/// an angle of some α; at normal to grazing incidence.
#[test]
fn smooth_metal_becomes_a_mirror() {
    for cos in [1.0, 0.7, 0.2, 0.05] {
        let wo = direction(cos, 0.2);
        let mirrored = reflect(wo, Vec3::Z);
        let mut before = f64::INFINITY;
        for roughness in [0.3, 0.1, 0.05, 0.0316] {
            let bsdf = metal(1.0, roughness);
            let albedo = over_samples(&bsdf, wo, 128, |s| s.map_or(0.0, |s| f64::from(s.weight.x)));
            let off = over_samples(&bsdf, wo, 128, |s| {
                s.map_or(0.0, |s| f64::from((s.wi - mirrored).length()) * f64::from(s.weight.x))
            });
            assert!(off < before, "cos {cos}, roughness {roughness}");
            before = off;
            let alpha = f64::from((roughness * roughness).max(1e-3));
            assert!(off < 6.0 * alpha, "cos {cos}, roughness {roughness}: {off}");
            if roughness < 0.04 {
                assert!((albedo - 1.0).abs() < 2e-3, "cos {cos}: albedo {albedo}");
            }
        }
    }
    // A coat without a base, and one that is all Fresnel.
    let bsdf = substrate(0.0, 1.0, 0.0);
    let albedo = over_samples(&bsdf, direction(0.7, 0.0), 256, |s| s.map_or(0.0, |s| f64::from(s.weight.x)));
    assert!((albedo - 1.0).abs() < 5e-3, "{albedo}");
}
