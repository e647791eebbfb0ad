//! t, barycentrics and normal against exact arithmetic.
//!
//! Coordinates are multiples of 2^−10 below 2^30 that f32 holds exactly, so as integers they have at most 41 bits, and
//! numerator and denominator of t = n·(v0 − o) / n·d fit into an i128 without rounding.

use crate::support::{Rng, Scene, Triangle, along, dot, narrow, sub, towards, wide};
use hotspot_bvh::{Hit, Quality, Ray};

/// Half an ulp, relative.
const U: f64 = 1.0 / (1u64 << 24) as f64;

/// A multiple of 2^−10 that f32 holds.
fn grid(value: f64) -> f32 {
    ((value * 1024.0).round() / 1024.0) as f32
}

fn integer(value: f32) -> i128 {
    let scaled = f64::from(value) * 1024.0;
    assert_eq!(scaled, scaled.round());
    scaled as i128
}

/// t of the plane as an exact fraction, rounded twice in f64 (relative error below 2^−51), and the condition numbers of
/// its numerator and denominator: by how much rounding errors of f64 grow where the terms cancel.
fn exact_t(triangle: &Triangle, ray: &Ray) -> Option<(f64, f64)> {
    let [a, b, c] = triangle.map(|v| v.map(integer));
    let (o, d) = (ray.origin.map(integer), ray.direction.map(integer));
    let e: [i128; 3] = core::array::from_fn(|i| b[i] - a[i]);
    let f: [i128; 3] = core::array::from_fn(|i| c[i] - a[i]);
    let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    let terms: [i128; 3] = core::array::from_fn(|i| n[i] * (a[i] - o[i]));
    let rates: [i128; 3] = core::array::from_fn(|i| n[i] * d[i]);
    let (height, rate) = (terms.iter().sum::<i128>(), rates.iter().sum::<i128>());
    if rate == 0 {
        return None;
    }
    // The normal's own terms cancel too.
    let grown: [i128; 3] = core::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        (e[j] * f[k]).abs() + (e[k] * f[j]).abs()
    });
    let size = |by: [i128; 3]| (0..3).map(|i| grown[i] as f64 * by[i].abs() as f64).sum::<f64>();
    let offset = core::array::from_fn(|i| a[i] - o[i]);
    let condition = size(offset) / (height as f64).abs() + size(d) / (rate as f64).abs();
    Some((height as f64 / rate as f64, condition))
}

/// Entry and exit of the triangle's box, in f64 (relative error below 2^−51).
fn slab(triangle: &Triangle, ray: &Ray) -> (f64, f64) {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let d = f64::from(ray.direction[axis]);
        if d != 0.0 {
            let t = triangle.map(|v| (f64::from(v[axis]) - f64::from(ray.origin[axis])) / d);
            near = near.max(t[0].min(t[1]).min(t[2]));
            far = far.min(t[0].max(t[1]).max(t[2]));
        }
    }
    (near, far)
}

/// The bound: t is the exact t, computed in f64 and rounded (U, and the condition number times a few units of f64), then
/// clamped to slab distances. A slab distance has three roundings (subtraction, reciprocal, product): 3 U. Where the
/// exact t lies outside the box, which only rounding can bring about, the nearest end of the box takes its place.
fn check_t(hit: Hit, triangle: &Triangle, ray: &Ray) {
    let (near, far) = slab(triangle, ray);
    let t = f64::from(hit.t);
    let tolerance = 3.1 * U * t;
    if let Some((exact, condition)) = exact_t(triangle, ray) {
        let spread = 10.0 * f64::EPSILON * condition * exact.abs();
        let low = (exact - spread).clamp(near.min(far), near.max(far));
        let high = (exact + spread).clamp(near.min(far), near.max(far));
        assert!(t >= low - tolerance && t <= high + tolerance, "{t} is not {exact}: {triangle:?} {ray:?}");
    } else {
        assert!(t >= near.min(far) - tolerance && t <= near.max(far) + tolerance);
    }
}

fn point(rng: &mut Rng, t: &Triangle) -> [f32; 3] {
    crate::support::point_on(rng, t).map(|c| grid(c.into()))
}

/// Shoots `rays` at each triangle, as a scene of its own. Returns how many hit.
fn run(rng: &mut Rng, count: usize, mut make: impl FnMut(&mut Rng) -> (Triangle, [f32; 3])) -> usize {
    let mut hits = 0;
    for _ in 0..count {
        let (triangle, origin) = make(rng);
        let scene = Scene::new(vec![triangle], Quality::Fast);
        for _ in 0..10 {
            let ray = towards(origin, point(rng, &triangle));
            let ray = Ray { direction: ray.direction.map(|c| grid(c.into())), ..ray };
            if let Some(hit) = scene.check(&ray) {
                check_t(hit, &triangle, &ray);
                hits += 1;
            }
        }
    }
    hits
}

/// 2 000 triangles × 10 rays.
#[test]
fn ordinary_triangles() {
    let mut rng = Rng::new(70);
    let hits = run(&mut rng, 2000, |rng| {
        let corner = |rng: &mut Rng| rng.cube().map(|c| grid(1000.0 * c));
        ([corner(rng), corner(rng), corner(rng)], corner(rng))
    });
    assert!(hits > 10_000, "{hits}");
}

/// Up to 1e9 times longer than wide. 3 000 triangles × 10 rays.
#[test]
fn slivers() {
    let mut rng = Rng::new(71);
    let hits = run(&mut rng, 3000, |rng| {
        let length = rng.magnitude(0.0, 6.0);
        let width = (length * rng.magnitude(-9.0, -1.0)).max(1.0 / 1024.0);
        let from = rng.cube().map(|c| grid(c * length * rng.magnitude(-6.0, 0.0)));
        let to = along(wide(from), rng.direction(), length);
        let aside = along(wide(from), rng.direction(), width);
        let triangle = [from, to.map(grid), aside.map(grid)];
        (triangle, rng.cube().map(|c| grid(c * length)))
    });
    assert!(hits > 3_000, "{hits}");
}

/// Origins close to the triangle's plane. 3 000 triangles × 10 rays.
#[test]
fn grazing_rays() {
    let mut rng = Rng::new(72);
    let hits = run(&mut rng, 3000, |rng| {
        let corner = |rng: &mut Rng| rng.cube().map(|c| grid(1000.0 * c));
        let triangle = [corner(rng), corner(rng), corner(rng)];
        let [a, b, c] = triangle.map(wide);
        let outside = along(along(a, sub(b, a), 2.0 * rng.signed()), sub(c, a), 2.0 * rng.signed());
        let origin = along(outside, rng.direction(), rng.magnitude(-3.0, 0.0));
        (triangle, origin.map(grid))
    });
    assert!(hits > 3_000, "{hits}");
}

/// Barycentrics give back the point, the normal is perpendicular to both edges and on the counter-clockwise side. Points
/// in f64 from t (error 3 U of the distance), from barycentrics in f32 (U of the triangle's size each), and the edge
/// functions' own error (a few U of the distance): 20 U of both. 5 000 rays.
#[test]
fn barycentrics_and_normal() {
    let mut rng = Rng::new(73);
    for _ in 0..5000 {
        let triangle: Triangle = core::array::from_fn(|_| narrow(rng.cube()));
        let scene = Scene::new(vec![triangle], Quality::Fast);
        let ray = towards(narrow(rng.cube().map(|c| 3.0 * c)), crate::support::point_on(&mut rng, &triangle));
        let Some(hit) = scene.check(&ray) else { continue };
        let [a, b, c] = triangle.map(wide);
        let n = wide(hit.normal);
        let cross = crate::support::cross_of(&triangle);
        let area = dot(cross, cross).sqrt();
        assert!(dot(n, cross) > 0.999_999 * area);
        let d = wide(ray.direction);
        if dot(n, d).abs() < 1e-3 * dot(d, d).sqrt() {
            continue;
        }
        // Perpendicular to the ray the two points agree; along it grazing rays stretch every error.
        let p = along(along(a, sub(b, a), hit.u.into()), sub(c, a), hit.v.into());
        let q = along(wide(ray.origin), wide(ray.direction), hit.t.into());
        let apart = sub(p, q);
        let lateral = along(apart, d, -dot(apart, d) / dot(d, d));
        assert!(dot(lateral, lateral).sqrt() < 20.0 * U * (4.0 + dot(d, d).sqrt()), "{lateral:?} {ray:?}");
    }
}
