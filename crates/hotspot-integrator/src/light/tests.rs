//! The environment sampler against the words of [`EnvironmentMap`] and against its own density.
//!
//! Independent numbers from a fixed seed. A chi-square test fails beyond 5σ of the normal approximation (false-alarm rate
//! 3e-7 each, ten in all).

use super::environment::EnvironmentSampler;
use crate::chi_square::Random;
use core::f64::consts::{PI, TAU};
use glam::{DVec3, Vec2, Vec3};
use hotspot_scene::EnvironmentMap;

fn map(width: u32, height: u32, texel: impl FnMut(u32, u32) -> [f32; 3]) -> EnvironmentMap {
    let mut texel = texel;
    let texels = (0..width * height).map(|i| texel(i % width, i / width)).collect();
    EnvironmentMap { name: "map".into(), width, height, texels, rotation: 0.0, scale: [1.0; 3] }
}

fn sampler(map: &EnvironmentMap) -> EnvironmentSampler {
    EnvironmentSampler::new(map).unwrap().unwrap()
}

/// All of a map at once: name, map, and the part of the picture (u, v from, to) that holds its light.
fn maps() -> Vec<(&'static str, EnvironmentMap, [f64; 4])> {
    let mut random = Random(5);
    let all = [0.0, 0.0, 1.0, 1.0];
    let mut turned = map(24, 12, |x, y| [(x + 1) as f32, (y * y) as f32, 3.0]);
    turned.rotation = 2.0;
    turned.scale = [0.5, 0.0, 7.0];
    let hot = |w: u32, h: u32, x: u32, y: u32| {
        let at = |x: i64, y: i64| [x as f64 / f64::from(w), y as f64 / f64::from(h)];
        let ([u0, v0], [u1, v1]) =
            (at(i64::from(x) - 1, i64::from(y) - 1), at(i64::from(x) + 2, i64::from(y) + 2));
        let lit = move |i, j| if (i, j) == (x, y) { [1e5, 2e4, 3.0] } else { [0.0; 3] };
        (map(w, h, lit), [u0, v0, u1, v1])
    };
    let (small, small_at) = hot(16, 8, 5, 3);
    let (large, large_at) = hot(4096, 16, 1000, 11);
    vec![
        ("constant", map(12, 6, |_, _| [2.0; 3]), all),
        ("gradient", map(20, 10, |x, y| [x as f32, (10 - y) as f32, 1.0]), all),
        ("black rows", map(12, 12, |_, y| [f32::from(y % 3 == 1); 3]), all),
        (
            "a red texel on blue",
            map(8, 4, |x, y| if (x, y) == (7, 0) { [9.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] }),
            all,
        ),
        ("1 x 1", map(1, 1, |_, _| [0.3; 3]), all),
        ("2 x 1", map(2, 1, |x, _| [x as f32; 3]), all),
        ("random", map(40, 20, |_, _| [0; 3].map(|_| random.unit().powi(6) as f32)), all),
        ("turned", turned, all),
        ("one hot texel", small, small_at),
        ("one hot texel of 4096", large, large_at),
    ]
}

/// The direction of a place of the picture, as [`EnvironmentMap`] has it, unrotated.
fn direction(u: f64, v: f64) -> DVec3 {
    let (phi, theta) = (TAU * u - PI, PI * v);
    DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin())
}

/// Rotated about +Y, counter-clockwise seen from above: −Z turns towards −X.
fn rotated(d: DVec3, angle: f64) -> DVec3 {
    let (s, c) = angle.sin_cos();
    DVec3::new(c * d.x + s * d.z, d.y, c * d.z - s * d.x)
}

/// The place of a direction, unrotated.
fn place(d: DVec3) -> (f64, f64) {
    (d.x.atan2(-d.z) / TAU + 0.5, d.x.hypot(d.z).atan2(d.y) / PI)
}

/// Bilinear interpolation in f64 at a place of the picture.
fn bilinear(map: &EnvironmentMap, u: f64, v: f64) -> DVec3 {
    let (w, h) = (i64::from(map.width), i64::from(map.height));
    let (x, y) = (u * w as f64 - 0.5, v * h as f64 - 0.5);
    let texel = |i: i64, j: i64| {
        let t = map.texels[(j.clamp(0, h - 1) * w + i.rem_euclid(w)) as usize];
        DVec3::from_array(t.map(f64::from)) * DVec3::from_array(map.scale.map(f64::from))
    };
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    texel(i, j) * (1.0 - fx) * (1.0 - fy)
        + texel(i + 1, j) * fx * (1.0 - fy)
        + texel(i, j + 1) * (1.0 - fx) * fy
        + texel(i + 1, j + 1) * fx * fy
}

#[test]
fn the_centre_is_minus_z_the_right_is_plus_x_the_top_is_plus_y() {
    let [centre, right, top, left] = [[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]];
    let picture = map(12, 7, |x, y| match (x, y) {
        (_, 0) => top,
        (5 | 6, 3) => centre,
        (8 | 9, 3) => right,
        (2 | 3, 3) => left,
        _ => [0.1; 3],
    });
    let near = |rotation: f64, d: Vec3, expected: [f32; 3]| {
        let found = sampler(&EnvironmentMap { rotation, ..picture.clone() }).look_up(d).radiance;
        assert!((found - Vec3::from_array(expected)).length() < 1e-5, "{rotation} {d}: {found}");
    };
    for turns in [0.0, 1.0, -3.0] {
        near(turns * TAU, Vec3::NEG_Z, centre);
        near(turns * TAU, Vec3::X, right);
        near(turns * TAU, Vec3::NEG_X, left);
        near(turns * TAU, Vec3::Y, top);
    }
    // A quarter turn takes what lay along −Z to −X, and what lay along +X to −Z.
    near(0.5 * PI, Vec3::NEG_X, centre);
    near(0.5 * PI, Vec3::NEG_Z, right);
    near(-0.5 * PI, Vec3::X, centre);
    near(-0.5 * PI, Vec3::Y, top);
}

/// Everywhere, with any rotation: the interpolation in f64, up to a thousandth of a texel.
#[test]
fn look_ups_are_bilinear() {
    let mut random = Random(1);
    for (name, map, _) in maps() {
        let sampler = sampler(&map);
        let contrast = map.texels.iter().flatten().fold(0.0f32, |m, c| m.max(*c)) * map.scale[2].max(1.0);
        for _ in 0..20_000 {
            let (u, v) = (random.unit(), random.unit());
            let found = sampler.look_up(rotated(direction(u, v), map.rotation).as_vec3()).radiance;
            let expected = bilinear(&map, u, v);
            let off = (found.as_dvec3() - expected).length();
            let most = f64::from(contrast) * 3e-7 * f64::from(map.width + map.height);
            assert!(off <= most, "{name} at {u}, {v}: {found} for {expected}");
        }
        for row in 0..map.height {
            for column in (0..map.width).step_by(map.width as usize / 64 + 1) {
                let u = (f64::from(column) + 0.5) / f64::from(map.width);
                let v = (f64::from(row) + 0.5) / f64::from(map.height);
                let found = sampler.look_up(rotated(direction(u, v), map.rotation).as_vec3()).radiance;
                let texel = Vec3::from_array(map.texels[(row * map.width + column) as usize]);
                let off = (found - texel * Vec3::from_array(map.scale)).length();
                assert!(off <= contrast * 3e-7 * (map.width + map.height) as f32, "{name}");
            }
        }
    }
}

/// Probability of a box of the picture (in the unrotated frame) by midpoints.
fn mass(sampler: &EnvironmentSampler, rotation: f64, [u0, v0, u1, v1]: [f64; 4], n: usize) -> f64 {
    let at = |i: usize, a: f64, b: f64| a + (b - a) * (i as f64 + 0.5) / n as f64;
    let mut sum = 0.0;
    for j in 0..n {
        let v = at(j, v0, v1);
        for i in 0..n {
            let d = rotated(direction(at(i, u0, u1), v), rotation).as_vec3();
            sum += f64::from(sampler.look_up(d).pdf) * TAU * PI * (PI * v).sin();
        }
    }
    sum * (u1 - u0) * (v1 - v0) / (n * n) as f64
}

#[test]
fn densities_integrate_to_one() {
    for (name, map, at) in maps() {
        let sum = mass(&sampler(&map), map.rotation, at, 720);
        assert!((sum - 1.0).abs() < 1e-4, "{name}: {sum}");
    }
}

#[test]
fn samples_follow_their_density() {
    const CELLS: usize = 24;
    const SAMPLES: usize = 400_000;
    let mut random = Random(2);
    for (name, map, [u0, v0, u1, v1]) in maps() {
        let sampler = sampler(&map);
        let mut hits = vec![0.0f64; CELLS * CELLS];
        let mut lost = 0;
        for _ in 0..SAMPLES {
            let u = Vec2::new(random.unit() as f32, random.unit() as f32);
            let Some((wi, _)) = sampler.sample(u) else {
                lost += 1;
                continue;
            };
            assert!((wi.length() - 1.0).abs() < 1e-6);
            let (u, v) = place(rotated(wi.as_dvec3(), -map.rotation));
            let cell = |x: f64, a: f64, b: f64| (((x - a) / (b - a) * CELLS as f64) as usize).min(CELLS - 1);
            hits[cell(v, v0, v1) * CELLS + cell(u, u0, u1)] += 1.0;
        }
        assert!(lost < 10, "{name}: {lost} lost");
        // Cells with few expected are taken together.
        let (mut rest, mut rest_hits, mut chi2, mut cells) = (0.0, 0.0, 0.0, -1.0);
        for (i, hits) in hits.into_iter().enumerate() {
            let edge = |k: usize, a: f64, b: f64| a + (b - a) * k as f64 / CELLS as f64;
            let (x, y) = (i % CELLS, i / CELLS);
            let bounds = [edge(x, u0, u1), edge(y, v0, v1), edge(x + 1, u0, u1), edge(y + 1, v0, v1)];
            let expected = SAMPLES as f64 * mass(&sampler, map.rotation, bounds, 12);
            if expected < 20.0 {
                rest += expected;
                rest_hits += hits;
            } else {
                chi2 += (hits - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        if rest >= 5.0 {
            chi2 += (rest_hits - rest).powi(2) / rest;
            cells += 1.0;
        } else {
            assert!(rest_hits <= 30.0, "{name}: {rest_hits} samples where {rest} are expected");
        }
        // Wilson and Hilferty (1931).
        let k = 2.0 / (9.0 * cells);
        let z = ((chi2 / cells).cbrt() - (1.0 - k)) / k.sqrt();
        assert!(z < 5.0, "{name}: chi-square {chi2} of {cells} degrees of freedom");
    }
}

/// A sample's density and radiance are those that a ray finds in its direction; radiance over density is bounded.
#[test]
fn samples_know_what_rays_find() {
    let mut random = Random(3);
    for (name, map, _) in maps() {
        let sampler = sampler(&map);
        let most = map.texels.iter().flatten().fold(0.0f32, |m, c| m.max(*c)) * map.scale[2].max(1.0);
        let mut peak = 0.0f32;
        let found: Vec<_> = (0..20_000)
            .filter_map(|_| sampler.sample(Vec2::new(random.unit() as f32, random.unit() as f32)))
            .map(|(wi, sample)| (wi, sample, sampler.look_up(wi)))
            .inspect(|(.., look)| peak = peak.max(look.pdf))
            .collect();
        let slack = 1e-6 * (map.width + map.height) as f32;
        for (wi, sample, look) in found {
            let off = (sample.radiance - look.radiance).length();
            assert!(off <= slack * most, "{name} at {wi}: {sample:?} and {look:?}");
            let off = (sample.pdf - look.pdf).abs();
            assert!(
                off <= slack * sample.pdf.max(peak.min(1e3 * sample.pdf)),
                "{name} at {wi}: {sample:?} and {look:?}"
            );
            let flux = sampler.flux() as f32;
            let brightness = sample.radiance.element_sum() / sample.pdf;
            // At worst sin θ is π/2 of its mean (one row), and luminance 0.0722/0.3333 of the mean of channels (blue).
            assert!(brightness <= 1.6 * 4.7 * flux, "{name} at {wi}: {brightness} of {flux}");
        }
    }
}

#[test]
fn densities_are_positive_where_there_is_light() {
    let mut random = Random(4);
    for (name, map, [u0, v0, u1, v1]) in maps() {
        let sampler = sampler(&map);
        for _ in 0..50_000 {
            let (u, v) = (u0 + (u1 - u0) * random.unit(), v0 + (v1 - v0) * random.unit());
            let look = sampler.look_up(rotated(direction(u, v), map.rotation).as_vec3());
            assert_eq!(look.pdf > 0.0, look.radiance.max_element() > 0.0, "{name}: {look:?}");
        }
    }
}

#[test]
fn flux_of_equal_texels_is_four_pi() {
    for (w, h) in [(1, 1), (2, 1), (7, 5), (64, 32)] {
        let flux = sampler(&map(w, h, |_, _| [0.5, 1.0, 2.0])).flux();
        assert!((flux / (3.5 * 4.0 * PI) - 1.0).abs() < 1e-12, "{flux}");
    }
}

#[test]
fn extremes_stay_finite() {
    let extremes: [fn(u32, u32) -> [f32; 3]; 4] = [
        |x, y| if (x, y) == (3, 2) { [f32::MAX; 3] } else { [1.0; 3] },
        |x, _| [1e-44 * (x + 1) as f32; 3],
        |x, y| if x == y { [f32::MAX, 0.0, 0.0] } else { [0.0, 0.0, 1e-45] },
        |_, y| if y == 0 { [1.0; 3] } else { [0.0; 3] },
    ];
    let mut random = Random(6);
    for texel in extremes {
        let sampler = sampler(&map(8, 4, texel));
        for _ in 0..2000 {
            if let Some((wi, look)) = sampler.sample(Vec2::new(random.unit() as f32, random.unit() as f32)) {
                assert!(wi.is_finite() && look.pdf.is_finite() && look.pdf > 0.0, "{wi} {look:?}");
                assert!(look.radiance.is_finite(), "{look:?}");
            }
        }
        for d in [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z] {
            assert!(sampler.look_up(d).radiance.is_finite() && !sampler.look_up(d).pdf.is_nan());
        }
        for d in [Vec3::NAN, Vec3::ZERO, Vec3::INFINITY] {
            let _ = sampler.look_up(d);
        }
    }
}

#[test]
fn bad_maps_are_refused_and_black_ones_are_nothing() {
    let good = map(3, 2, |_, _| [1.0; 3]);
    let refused = |map: EnvironmentMap| EnvironmentSampler::new(&map).is_err();
    assert!(!refused(good.clone()));
    for width in [0, 2, 4, u32::MAX] {
        assert!(refused(EnvironmentMap { width, ..good.clone() }), "{width}");
    }
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        assert!(refused(map(3, 2, |x, y| [1.0, if x == y { bad } else { 0.0 }, 1.0])));
        assert!(refused(EnvironmentMap { scale: [1.0, bad, 1.0], ..good.clone() }));
    }
    assert!(refused(EnvironmentMap { rotation: f64::NAN, ..good.clone() }));
    assert!(EnvironmentSampler::new(&map(3, 2, |_, _| [0.0; 3])).unwrap().is_none());
    assert!(EnvironmentSampler::new(&EnvironmentMap { scale: [0.0; 3], ..good }).unwrap().is_none());
}
