//! sample() against pdf().

use super::super::metal::reflect;
use super::{INCIDENCES, all, direction, over_samples};
use crate::bsdf::Bsdf;
use crate::chi_square::{Cells, Random, Suite};
use core::f64::consts::FRAC_PI_2;
use glam::{DVec3, Vec2, Vec3};

/// α of the lobe, if there is one.
fn lobe(bsdf: &Bsdf) -> Option<f32> {
    match bsdf {
        Bsdf::Substrate(s) => Some(s.alpha),
        Bsdf::RoughMetal(m) => Some(m.alpha),
        _ => None,
    }
}

/// Chi-square at four incidences of each BSDF: over the hemisphere, and around a narrow lobe, which would lie in one or
/// two cells of that. Rate of any false alarm: 1 %; 10^6 samples each.
#[test]
fn samples_follow_their_density() {
    let mut suite = Suite::new();
    let mut random = Random(1);
    for (name, bsdf) in all() {
        for (cos, turns) in INCIDENCES.into_iter().skip(1) {
            let wo = direction(cos, turns);
            let density = |w: DVec3| f64::from(bsdf.eval(wo, w.as_vec3()).1);
            let mut draw = || {
                let (choice, u) = (random.single(), Vec2::new(random.single(), random.single()));
                bsdf.sample(wo, choice, u).map(|s| s.wi.as_dvec3())
            };
            let what = format!("{name}, cos {cos}");
            let alpha = lobe(&bsdf).unwrap_or(1.0);
            if alpha >= 0.01 {
                suite.directions(what.clone(), &Cells::hemisphere(), density, &mut draw);
            }
            if alpha < 0.1 {
                // Up to the horizon, ever finer towards the mirror direction.
                let mirrored = reflect(wo, Vec3::Z).as_dvec3();
                let above = FRAC_PI_2 - mirrored.z.min(1.0).acos();
                suite.directions(what + ", lobe", &Cells::new(mirrored, above, 3), density, &mut draw);
            }
        }
    }
    suite.finish();
}

/// ∫ pdf over the hemisphere and the share of samples rejected below the horizon make 1, within 1e-3: both by quadrature.
#[test]
fn densities_and_rejections_make_one() {
    for (name, bsdf) in all() {
        for (cos, turns) in INCIDENCES {
            let wo = direction(cos, turns);
            let rejected = over_samples(&bsdf, wo, 512, |s| f64::from(u8::from(s.is_none())));
            let sum = rejected + super::energy::over_hemisphere(&bsdf, wo, |_, pdf| f64::from(pdf));
            assert!((sum - 1.0).abs() < 1e-3, "{name}, cos {cos}: {sum}, of it {rejected} rejected");
        }
    }
}

/// A sample's own pdf and weight are those that eval() finds for its direction.
#[test]
fn samples_know_their_density() {
    for (name, bsdf) in all() {
        for (cos, turns) in INCIDENCES {
            let wo = direction(cos, turns);
            over_samples(&bsdf, wo, 64, |sample| {
                if let Some(sample) = sample {
                    let (f_cos, pdf) = bsdf.eval(wo, sample.wi);
                    assert!(
                        (sample.pdf / pdf - 1.0).abs() < 1e-5,
                        "{name}, cos {cos}: {sample:?}, pdf {pdf}"
                    );
                    let off = (sample.weight * pdf - f_cos).abs().max_element();
                    assert!(off <= 1e-5 * f_cos.max_element(), "{name}, cos {cos}: {sample:?}, {f_cos}");
                }
                0.0
            });
        }
    }
}
