//! Each BSDF against its own words: does sample() follow pdf(), does pdf() integrate to 1, is the scattered energy at most
//! what arrives, is f the same both ways, is everything finite at the ends of the parameters?

mod ends;
mod energy;
mod sampling;

use super::{Bsdf, RoughMetal, Substrate};
use glam::{Vec2, Vec3};

/// A direction of the upper hemisphere.
fn direction(cos: f32, turns: f32) -> Vec3 {
    let sin = (1.0 - f64::from(cos) * f64::from(cos)).sqrt();
    let (s, c) = (core::f64::consts::TAU * f64::from(turns)).sin_cos();
    Vec3::new((sin * c) as f32, (sin * s) as f32, cos).normalize()
}

fn substrate(diffuse: f32, specular: f32, roughness: f32) -> Bsdf {
    let alpha = (roughness * roughness).max(1e-3);
    Bsdf::Substrate(Substrate { diffuse: Vec3::splat(diffuse), specular: Vec3::splat(specular), alpha })
}

fn metal(f0: f32, roughness: f32) -> Bsdf {
    Bsdf::RoughMetal(RoughMetal { f0: Vec3::splat(f0), alpha: (roughness * roughness).max(1e-3) })
}

/// Every BSDF with a density, over its range. Roughness 0 is α = 1e-3, the smallest that the renderer makes.
fn all() -> Vec<(String, Bsdf)> {
    let mut all = vec![("matte".to_owned(), Bsdf::Matte(Vec3::splat(0.8)))];
    for (diffuse, specular, roughness) in [
        (0.5, 0.04, 0.0),
        (0.5, 1.0 / 9.0, 0.07),
        (0.3, 0.05, 0.12),
        (0.9, 0.04, 0.3),
        (0.0, 0.5, 0.5),
        (0.5, 0.04, 0.8),
        (1.0, 1.0 / 9.0, 1.0),
    ] {
        let name = format!("substrate {diffuse} {specular:.2}, roughness {roughness}");
        all.push((name, substrate(diffuse, specular, roughness)));
    }
    for (f0, roughness) in [(1.0, 0.0), (0.9, 0.1), (0.9, 0.3), (0.5, 0.6), (1.0, 1.0)] {
        all.push((format!("metal {f0}, roughness {roughness}"), metal(f0, roughness)));
    }
    all
}

const INCIDENCES: [(f32, f32); 5] = [(1.0, 0.0), (0.9, 0.1), (0.6, 0.4), (0.25, 0.77), (0.04, 0.6)];

/// `f` of samples with n² numbers spread evenly (a lattice of the golden ratio), averaged; both lobes of a substrate alike.
fn over_samples(bsdf: &Bsdf, wo: Vec3, n: u32, mut f: impl FnMut(Option<super::BsdfSample>) -> f64) -> f64 {
    let lobes: &[f32] = if matches!(bsdf, Bsdf::Substrate(_)) { &[0.25, 0.75] } else { &[0.5] };
    let mut sum = 0.0;
    for lobe in lobes {
        for i in 0..n * n {
            let u = (f64::from(i) + 0.5) / f64::from(n * n);
            let v = (f64::from(i) * 0.618_033_988_749_894_9).fract();
            sum += f(bsdf.sample(wo, *lobe, Vec2::new(u as f32, v as f32)));
        }
    }
    sum / f64::from(n * n) / lobes.len() as f64
}
