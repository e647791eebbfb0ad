//! BSDFs seen through the public interface: a small light in one direction, a pencil camera in the other, gives f.
//!
//! The light's solid angle is some 1e-6 sr, so that f hardly varies over it; irradiance is known in closed form. Against
//! DESIGN's formulas in f64 (tolerance 4σ and 1e-3 for the light's extent), and against itself with the directions
//! swapped. What cannot be reached from here, the agreement of sample() with pdf(), shows in the albedos of the furnace.

use crate::measure;
use hotspot_scene::Material;
use hotspot_tests::world::{
    Random, V3, World, add_scaled, cross, dot, light, matte, metal, pencil, rectangle, substrate, unit,
};

/// f(wo, wi), with its σ.
fn measured(material: &Material, wo: V3, wi: V3) -> (f64, f64) {
    // A square of half edge 1e-3 at distance 2 in direction wi.
    let (distance, half) = (2.0, 1e-3);
    let u = unit(cross(wi, [0.3, 0.2, 0.9]));
    let v = cross(u, wi);
    let scale = |a: V3| a.map(|c| c * half);
    let world = World::new()
        .with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), material.clone())
        .with(rectangle(wi.map(|c| c * distance), scale(u), scale(v)), light([1e6; 3]));
    let camera = pencil(wo.map(|c| 3.0 * c), [0.0; 3]);
    let irradiance = 1e6 * wi[2] * (2.0 * half) * (2.0 * half) / (distance * distance);
    let (mean, sigma) = measure(&world.prepare(), &camera, 1, 16).0[0];
    (mean / irradiance, sigma / irradiance)
}

fn schlick(r: f64, cos: f64) -> f64 {
    r + (1.0 - r) * (1.0 - cos).powi(5)
}

fn ggx(cos: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    let t = cos * cos * (a2 - 1.0) + 1.0;
    a2 / (core::f64::consts::PI * t * t)
}

fn substrate_f(rd: f64, rs: f64, alpha: f64, wo: V3, wi: V3) -> f64 {
    let h = unit(add_scaled(wo, 1.0, wi));
    let coat = |cos: f64| 1.0 - (1.0 - 0.5 * cos).powi(5);
    let diffuse = 28.0 / (23.0 * core::f64::consts::PI) * rd * (1.0 - rs) * coat(wo[2]) * coat(wi[2]);
    diffuse + ggx(h[2], alpha) / (4.0 * dot(wi, h) * wi[2].max(wo[2])) * schlick(rs, dot(wi, h))
}

fn metal_f(f0: f64, alpha: f64, wo: V3, wi: V3) -> f64 {
    let h = unit(add_scaled(wo, 1.0, wi));
    let g1 = |c: f64| 2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 - c * c) / (c * c)).sqrt());
    schlick(f0, dot(wi, h)) * ggx(h[2], alpha) * g1(wo[2]) * g1(wi[2]) / (4.0 * wo[2] * wi[2])
}

/// Pairs of directions: at random, and near mirror reflection, where the lobes are.
fn pairs() -> Vec<(V3, V3)> {
    let mut random = Random(5);
    let mut pairs = Vec::new();
    while pairs.len() < 24 {
        let mut wo = random.point(-1.0, 1.0);
        let mut wi = random.point(-1.0, 1.0);
        if pairs.len() % 2 == 0 {
            let near = random.point(-0.1, 0.1);
            wi = add_scaled([-wo[0], -wo[1], wo[2]], 1.0, near);
        }
        wo = unit(wo);
        wi = unit(wi);
        let apart = dot(cross(wo, wi), cross(wo, wi)) > 1e-3;
        if wo[2] > 0.15 && wi[2] > 0.15 && apart {
            pairs.push((wo, wi));
        }
    }
    pairs
}

fn compare(material: &Material, what: &str, f: impl Fn(V3, V3) -> f64) {
    for (wo, wi) in pairs() {
        let (there, s1) = measured(material, wo, wi);
        let (back, s2) = measured(material, wi, wo);
        let expected = f(wo, wi);
        for (value, sigma) in [(there, s1), (back, s2)] {
            assert!(
                (value - expected).abs() < 4.0 * sigma + 1e-3 * expected,
                "{what}: f({wo:?}, {wi:?}) = {value} ± {sigma} for {expected}"
            );
            assert!(sigma < 2e-3 * expected, "{what}: sigma {sigma} of {expected}");
        }
    }
}

#[test]
fn matte_is_constant() {
    compare(&matte([0.6; 3]), "matte", |_, _| f64::from(0.6f32) / core::f64::consts::PI);
}

#[test]
fn substrate_follows_its_formula_and_is_reciprocal() {
    for (rd, rs, roughness) in [(0.5f32, 0.04f32, 0.5f32), (0.2, 1.0 / 9.0, 0.25), (0.0, 0.5, 0.9)] {
        let alpha = f64::from(roughness * roughness);
        let material = substrate([rd; 3], rs, roughness);
        compare(&material, &format!("substrate {roughness}"), |wo, wi| {
            substrate_f(rd.into(), rs.into(), alpha, wo, wi)
        });
    }
}

#[test]
fn metal_follows_its_formula_and_is_reciprocal() {
    for (f0, roughness) in [(0.9f32, 0.5f32), (0.3, 0.25), (1.0, 1.0)] {
        let alpha = f64::from(roughness * roughness);
        compare(&metal([f0; 3], roughness), &format!("metal {roughness}"), |wo, wi| {
            metal_f(f0.into(), alpha, wo, wi)
        });
    }
}
