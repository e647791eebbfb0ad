//! The same rays for both sides.

use super::soup::{Soup, Triangle, hash};
use hotspot_bvh::{Bvh, Hit, NoProbe, Ray};
use hotspot_scene::Projection;

/// What rays are for, and whether any hit or the nearest is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// From the camera, nearest hit.
    Primary,
    /// From the camera, sixteen to a pixel, as a renderer takes samples; ours trace each sixteen as a packet (peers: one at a
    /// time).
    Packets,
    /// From what the camera sees, about the normal as a matte surface scatters, nearest hit.
    Bounce,
    /// From what the camera sees to points on the lights, any hit.
    Shadow,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Packets, Self::Bounce, Self::Shadow];

    /// Name in outputs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Packets => "packets",
            Self::Bounce => "bounce",
            Self::Shadow => "shadow",
        }
    }
}

/// Rays of each kind, in the order in which a renderer would trace them: tiles of 16 × 16 pixels.
pub fn rays(soup: &Soup, bvh: &Bvh, size: u32, kind: Kind) -> Vec<Ray> {
    let m = &soup.camera.to_world;
    let column = |i: usize| [m[0][i], m[1][i], m[2][i]];
    let (half, parallel) = match soup.camera.projection {
        Projection::Perspective { yfov, .. } => ((0.5 * yfov).tan(), false),
        Projection::Orthographic { ymag, .. } => (ymag, true),
    };
    let mut out = Vec::with_capacity((size * size) as usize);
    for index in 0..size * size {
        // Tiles row by row, pixels row by row within.
        let (tile, pixel) = (index / 256, index % 256);
        let across = size / 16;
        let at = if kind == Kind::Packets {
            // As many rays: pixels four times as large.
            let place = |i: u32, offset: f32| f64::from(4 * i) + 4.0 * f64::from(offset);
            let across = size / 4;
            let (column, row) = (index / 16 % across, index / 16 / across);
            [place(column, hash(index * 8)), place(row, hash(index * 8 + 1))]
        } else {
            let x = f64::from(tile % across * 16 + pixel % 16) + f64::from(hash(index * 8));
            [x, f64::from(tile / across * 16 + pixel / 16) + f64::from(hash(index * 8 + 1))]
        };
        let [x, y] = at;
        let (px, py) = ((2.0 * x / f64::from(size) - 1.0) * half, (1.0 - 2.0 * y / f64::from(size)) * half);
        let [right, up, back, eye] = [0, 1, 2, 3].map(column);
        let offset: [f64; 3] = core::array::from_fn(|i| right[i] * px + up[i] * py);
        let primary = if parallel {
            let origin = core::array::from_fn(|i| (eye[i] + offset[i]) as f32);
            Ray::new(origin, back.map(|b| -b as f32))
        } else {
            let d: [f64; 3] = core::array::from_fn(|i| offset[i] - back[i]);
            Ray::new(eye.map(|e| e as f32), unit(d.map(|d| d as f32)))
        };
        match kind {
            Kind::Primary | Kind::Packets => out.push(primary),
            Kind::Bounce | Kind::Shadow => {
                let Some(hit) = bvh.closest_hit(&primary, NoProbe) else { continue };
                out.push(if kind == Kind::Bounce {
                    bounce(&primary, &hit, index)
                } else {
                    shadow(&primary, &hit, &soup.lights, index)
                });
            }
        }
    }
    out
}

/// The point hit, a little off the surface, and the normal on the ray's side.
fn leave(ray: &Ray, hit: &Hit) -> ([f32; 3], [f32; 3]) {
    let facing = dot(hit.normal, ray.direction) < 0.0;
    let normal = if facing { hit.normal } else { hit.normal.map(|n| -n) };
    let reach = ray.origin.iter().fold(hit.t, |m, c| m.max(c.abs()));
    let point = core::array::from_fn(|i| ray.origin[i] + hit.t * ray.direction[i] + 1e-5 * reach * normal[i]);
    (point, normal)
}

fn bounce(ray: &Ray, hit: &Hit, index: u32) -> Ray {
    let (origin, normal) = leave(ray, hit);
    // A point of the unit sphere about the tip of the normal: cosine-distributed.
    let z = 1.0 - 2.0 * hash(index * 8 + 2);
    let (sin, cos) = (core::f32::consts::TAU * hash(index * 8 + 3)).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    let direction = unit([normal[0] + r * cos, normal[1] + r * sin, normal[2] + 0.999 * z]);
    Ray::new(origin, direction)
}

fn shadow(ray: &Ray, hit: &Hit, lights: &[Triangle], index: u32) -> Ray {
    let (origin, _) = leave(ray, hit);
    let pick = (hash(index * 8 + 4) * lights.len() as f32) as usize;
    let [a, b, c] = lights[pick.min(lights.len() - 1)];
    let s = hash(index * 8 + 5).sqrt();
    let t = hash(index * 8 + 6);
    let target: [f32; 3] = core::array::from_fn(|i| a[i] * (1.0 - s) + b[i] * s * (1.0 - t) + c[i] * s * t);
    let direction = core::array::from_fn(|i| target[i] - origin[i]);
    Ray { t_max: 0.999, ..Ray::new(origin, direction) }
}

/// Rays from inside a closed mesh at its corners and at points of its edges: none may leave.
pub fn leak_rays(triangles: &[Triangle], count: u32) -> Vec<Ray> {
    (0..count)
        .map(|index| {
            let random = |k: u32| hash(index.wrapping_mul(8).wrapping_add(k));
            let origin = [0, 1, 2].map(|k| 0.3 * (random(k) - 0.5));
            let triangle = &triangles[(random(3) * triangles.len() as f32) as usize % triangles.len()];
            let corner = (random(4) * 3.0) as usize % 3;
            let (p, q) = (triangle[corner], triangle[(corner + 1) % 3]);
            // Every other ray at the corner itself.
            let s = if index % 2 == 0 { 0.0 } else { random(5) };
            Ray::new(origin, core::array::from_fn(|i| p[i] + s * (q[i] - p[i]) - origin[i]))
        })
        .collect()
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}
