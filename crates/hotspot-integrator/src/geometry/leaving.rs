//! Rays that leave a surface do not meet it again, at coordinates from 10^-8 to 10^8 (after pbrt-v4, `shapes_test.cpp`): not
//! the triangle itself, not a neighbour of a convex body; and from inside of a closed one they do not get out.
//!
//! Points of real hits, as the path loop takes them ([`super::Geometry::point`]), flat normals. All randomness is seeded;
//! nothing here has a false-alarm rate.

use crate::chi_square::Random;
use crate::scene::{PrepareOptions, RenderScene};
use glam::{DVec3, Vec3};
use hotspot_bvh::{Hit, NoProbe, Ray, oracle};
use hotspot_scene::{Instance, Material, Mesh, Object, Scene};

/// Full count per cell.
const FULL: usize = 1_000_000;

fn prepare(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> RenderScene {
    let to_world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let scene = Scene {
        meshes: vec![Mesh { positions, triangles, ..Mesh::default() }],
        materials: vec![Material::default_matte("surface")],
        objects: vec![Object { name: "object".into() }],
        instances: vec![Instance { object: 0, mesh: 0, material: 0, to_world }],
        ..Scene::default()
    };
    RenderScene::prepare(&scene, PrepareOptions::default()).expect("the scene is whole")
}

fn signed(random: &mut Random) -> f64 {
    2.0 * random.unit() - 1.0
}

fn direction(random: &mut Random) -> DVec3 {
    loop {
        let d = DVec3::new(signed(random), signed(random), signed(random));
        if d.length_squared() > 1e-4 && d.length_squared() < 1.0 {
            return d.normalize();
        }
    }
}

/// A direction on the side of `normal`, exactly: anywhere, or grazing it down to a cosine of `least`.
fn away(random: &mut Random, normal: Vec3, least: f64) -> Vec3 {
    let n = normal.as_dvec3();
    loop {
        let d = direction(random);
        let lift = if random.unit() < 0.5 { 1.0 } else { 10f64.powf(-8.0 * random.unit()) };
        let flat = d - n * n.dot(d);
        let d = (flat + n * n.dot(d).abs() * lift).as_vec3();
        if d.as_dvec3().dot(n) > least {
            return d;
        }
    }
}

/// Where a ray that hit leaves on the side of `side`, off the plane by a cosine above `least`.
fn leaving(scene: &RenderScene, hit: &Hit, side: Vec3, least: f64, random: &mut Random) -> Ray {
    let point = scene.geometry.point(scene.geometry.world_surface(hit.primitive), hit.u, hit.v);
    Ray::new(point.leave(side).to_array(), away(random, side, least).to_array())
}

fn on(random: &mut Random, triangle: &[[f32; 3]; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|p| DVec3::from_array(p.map(f64::from)));
    let (mut u, mut v) = (random.unit(), random.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    // Now and then on an edge.
    let u = if random.unit() < 0.1 { 0.0 } else { u };
    a + (b - a) * u + (c - a) * v
}

/// Rays from triangles that meet the same triangle again, and how many were tried.
fn self_hits(
    mut corner: impl FnMut(&mut Random) -> [[f32; 3]; 3],
    least: f64,
    count: usize,
    seed: u64,
) -> (Vec<String>, usize) {
    let mut random = Random(seed);
    let (mut found, mut tried) = (Vec::new(), 0);
    while tried < count {
        let corners: Vec<_> = (0..1000).map(|_| corner(&mut random)).collect();
        let triangles = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = prepare(corners.concat(), triangles);
        for (primitive, triangle) in scene.geometry.triangles.iter().enumerate() {
            for _ in 0..4 {
                let target = on(&mut random, triangle);
                let size = triangle.iter().map(|p| (DVec3::from_array(p.map(f64::from)) - target).length());
                let far = size.fold(0.0, f64::max) * 10f64.powf(3.0 * signed(&mut random));
                let origin = (target + direction(&mut random) * far).as_vec3();
                let ray = Ray::new(origin.to_array(), (target - origin.as_dvec3()).as_vec3().to_array());
                let Some(hit) = oracle::brute_force(&[*triangle], &ray) else { continue };
                let hit = Hit { primitive: primitive as u32, ..hit };
                for side in [1.0, -1.0] {
                    let ray = leaving(&scene, &hit, Vec3::from_array(hit.normal) * side, least, &mut random);
                    tried += 1;
                    if let Some(again) = oracle::brute_force(&[*triangle], &ray) {
                        found.push(format!("{triangle:?}, {ray:?}: {again:?}"));
                    }
                }
            }
        }
    }
    (found, tried)
}

/// Triangles each of whose coordinates has a size of its own, 10^-8 to 10^8: shards and needles, up to `longest` times longer
/// than wide.
fn shards(longest: f64) -> impl FnMut(&mut Random) -> [[f32; 3]; 3] {
    move |random: &mut Random| {
        loop {
            let mut coordinate = || (signed(random).signum() * 10f64.powf(8.0 * signed(random))) as f32;
            let triangle = [0; 3].map(|_| [0; 3].map(|_| coordinate()));
            let [a, b, c] = triangle.map(|p| DVec3::from_array(p.map(f64::from)));
            let length = (b - a).length().max((c - b).length()).max((a - c).length());
            if length < longest * f64::from(super::least_height(&triangle)) {
                return triangle;
            }
        }
    }
}

/// Nearer to the plane than this the side of a direction is a matter of the normal's rounding: a ray that is above the rounded
/// normal's plane may be below the triangle's, and meets it truly where the triangle reaches far beyond the bound by which
/// rays start off it, as it does when its corners lie much farther from the origin than the point.
const ROUNDED_NORMAL: f64 = 1e-6;

fn assert_no_self_hits(count: usize) {
    let mut report = Vec::new();
    for exponent in -8..=8 {
        let place = 10f64.powi(exponent);
        // Triangles of 10^-3 of their distance from the origin up to as much as that.
        let corners = move |random: &mut Random| {
            let center = direction(random) * place;
            let size = place * 10f64.powf(-3.0 * random.unit());
            [0; 3].map(|_| (center + direction(random) * size).as_vec3().to_array())
        };
        let (found, tried) = self_hits(corners, 0.0, count, exponent as u64);
        if !found.is_empty() {
            report.push(format!("at 1e{exponent}: {} of {tried}, the first: {}", found.len(), found[0]));
        }
    }
    let (found, tried) = self_hits(shards(1e9), ROUNDED_NORMAL, count, 99);
    if !found.is_empty() {
        report.push(format!("mixed: {} of {tried}, the first: {}", found.len(), found[0]));
    }
    assert!(report.is_empty(), "{report:#?}");
}

/// 18 cells of 20 000 rays.
#[test]
fn triangles_are_left_behind() {
    assert_no_self_hits(20_000);
}

/// 18 cells of 10^6 rays.
#[test]
#[ignore = "half a minute: 1.8e7 rays"]
fn triangles_are_left_behind_in_full() {
    assert_no_self_hits(FULL);
}

/// The table of NUMBERS.md: how often shards are met again.
#[test]
#[ignore = "measures, asserts nothing: run with --nocapture"]
#[expect(clippy::print_stdout, reason = "its output is its purpose")]
fn how_often_shards_are_met_again() {
    for longest in [1e1, 1e3, 1e6, 1e9, f64::INFINITY] {
        for least in [0.0, ROUNDED_NORMAL] {
            let (found, tried) = self_hits(shards(longest), least, FULL, 7);
            println!("SHARDS up to {longest:e}:1, cosines from {least:e}: {} of {tried}", found.len());
        }
    }
}

/// A subdivided octahedron, fronts outside, turned so that no face is parallel to an axis.
fn ball(level: u32, center: DVec3, radius: f64) -> RenderScene {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let mut points = vec![x, -x, y, -y, z, -z];
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for (a, b, c) in [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)] {
        triangles.extend([[a, b, c], [b, a, c + 1]]);
    }
    for _ in 0..level {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |i: u32, j: u32, points: &mut Vec<DVec3>| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                points.push((points[i as usize] + points[j as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let old = core::mem::take(&mut triangles);
        for [a, b, c] in old {
            let (ab, bc, ca) =
                (middle(a, b, &mut points), middle(b, c, &mut points), middle(c, a, &mut points));
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
    }
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    let positions = points.iter().map(|p| (center + turn * *p * radius).as_vec3().to_array()).collect();
    prepare(positions, triangles)
}

/// From every hit one ray out, which meets nothing, and one in, which meets the other side.
fn assert_closed(count: usize) {
    let mut report = Vec::new();
    for exponent in -8..=8 {
        let place = 10f64.powi(exponent);
        // About the origin, and so far from it that the radius is some 10^4 units in the last place.
        for (center, radius) in [(DVec3::ZERO, place), (DVec3::new(1.0, 0.75, -1.0) * place, 1e-3 * place)] {
            for level in [0, 3] {
                let scene = ball(level, center, radius);
                let mut random = Random(exponent as u64);
                let (mut again, mut leaks, mut tried) = (0, 0, 0);
                while tried < count {
                    let from = center + direction(&mut random) * radius * 3.0;
                    let index = (random.unit() * scene.geometry.triangles.len() as f64) as usize;
                    let target = on(&mut random, &scene.geometry.triangles[index]);
                    let from = from.as_vec3();
                    let ray = Ray::new(from.to_array(), (target - from.as_dvec3()).as_vec3().to_array());
                    let Some(hit) = scene.bvh.closest_hit(&ray, NoProbe) else { continue };
                    let outward = Vec3::from_array(hit.normal);
                    tried += 1;
                    let out = leaving(&scene, &hit, outward, 0.0, &mut random);
                    again += usize::from(scene.bvh.occluded(&out, NoProbe));
                    let inward = leaving(&scene, &hit, -outward, 0.0, &mut random);
                    let met = scene.bvh.closest_hit(&inward, NoProbe);
                    leaks += usize::from(met.is_none_or(|met| {
                        Vec3::from_array(met.normal).dot(Vec3::from_array(inward.direction)) < 0.0
                    }));
                }
                if again + leaks > 0 {
                    report.push(format!(
                        "radius {radius:e} at {center}, level {level}: {again} met again, {leaks} leaked, of {tried}"
                    ));
                }
            }
        }
    }
    assert!(report.is_empty(), "{report:#?}");
}

/// 68 cells of 10 000 hits, two rays each.
#[test]
fn closed_bodies_are_left_and_stay_closed() {
    assert_closed(10_000);
}

/// 68 cells of 10^6 hits.
#[test]
#[ignore = "two minutes: 1.4e8 rays"]
fn closed_bodies_are_left_and_stay_closed_in_full() {
    assert_closed(FULL);
}
