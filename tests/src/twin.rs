//! A slow and obvious path tracer in f64, the twin of the renderer for matte scenes: every ray against every triangle, no
//! tree, no light sampling, no roulette, no error bounds. A ray is never held against the triangle that it leaves.

use crate::world::{Random, V3, add_scaled, cross, dot, sub, unit};
use hotspot_scene::{Bsdf, Camera, Environment, Projection, Scene};

struct Facet {
    corner: V3,
    edges: [V3; 2],
    normal: V3,
    reflectance: V3,
    emission: V3,
    double_sided: bool,
}

/// A matte scene in f64.
pub struct Twin {
    facets: Vec<Facet>,
    environment: V3,
}

impl Twin {
    /// Of a scene of matte materials without textures, under a constant environment or none.
    ///
    /// # Panics
    /// For any other scene.
    pub fn new(scene: &Scene) -> Self {
        let mut facets = Vec::new();
        for instance in &scene.instances {
            let material = &scene.materials[instance.material as usize];
            let Bsdf::Matte { reflectance } = &material.bsdf else { panic!("not matte: {material:?}") };
            assert!(reflectance.texture.is_none() && material.emission.texture.is_none());
            let mesh = &scene.meshes[instance.mesh as usize];
            let placed = |i: u32| {
                let [x, y, z] = mesh.positions[i as usize].map(f64::from);
                instance.to_world.map(|[a, b, c, d]| a * x + b * y + c * z + d)
            };
            facets.extend(mesh.triangles.iter().map(|t| {
                let [a, b, c] = t.map(placed);
                let edges = [sub(b, a), sub(c, a)];
                Facet {
                    corner: a,
                    edges,
                    normal: unit(cross(edges[0], edges[1])),
                    reflectance: reflectance.factor.map(f64::from),
                    emission: material.emission.factor.map(f64::from),
                    double_sided: material.double_sided,
                }
            }));
        }
        let environment = match &scene.environment {
            None => [0.0; 3],
            Some(Environment::Constant(radiance)) => radiance.map(f64::from),
            Some(other) => panic!("not constant: {other:?}"),
        };
        Self { facets, environment }
    }

    /// Distance and index of the nearest facet but `left` (Möller and Trumbore 1997).
    fn nearest(&self, from: V3, towards: V3, left: usize) -> Option<(f64, usize)> {
        let mut nearest: Option<(f64, usize)> = None;
        for (i, facet) in self.facets.iter().enumerate() {
            let [e1, e2] = facet.edges;
            let p = cross(towards, e2);
            let det = dot(e1, p);
            let s = sub(from, facet.corner);
            let u = dot(s, p) / det;
            let q = cross(s, e1);
            let v = dot(towards, q) / det;
            let t = dot(e2, q) / det;
            // NaN, where the ray is parallel, fails all of these.
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && i != left && nearest.is_none_or(|n| t < n.0)
            {
                nearest = Some((t, i));
            }
        }
        nearest
    }

    /// Radiance of one path with at most `max_depth` scattering events.
    fn path(&self, mut from: V3, mut towards: V3, max_depth: u32, random: &mut Random) -> V3 {
        let (mut radiance, mut throughput) = ([0.0; 3], [1.0; 3]);
        let mut left = usize::MAX;
        for bounces in 0.. {
            let Some((t, i)) = self.nearest(from, towards, left) else {
                return [0, 1, 2].map(|c| radiance[c] + throughput[c] * self.environment[c]);
            };
            let facet = &self.facets[i];
            let facing = dot(facet.normal, towards) < 0.0;
            if facing || facet.double_sided {
                radiance = [0, 1, 2].map(|c| radiance[c] + throughput[c] * facet.emission[c]);
            }
            if bounces >= max_depth {
                break;
            }
            throughput = [0, 1, 2].map(|c| throughput[c] * facet.reflectance[c]);
            from = add_scaled(from, t, towards);
            left = i;
            let n = if facing { facet.normal } else { facet.normal.map(|c| -c) };
            // Cosine-distributed: a point of the unit sphere around the tip of the normal.
            let z = 2.0 * random.unit() - 1.0;
            let (s, c) = (core::f64::consts::TAU * random.unit()).sin_cos();
            let r = (1.0 - z * z).sqrt();
            towards = unit(add_scaled(n, 1.0, [r * c, r * s, z]));
        }
        radiance
    }

    /// A picture, row by row from the top, box-filtered, of pixels of independent samples.
    pub fn picture(
        &self,
        camera: &Camera,
        (width, height): (u32, u32),
        spp: u32,
        max_depth: u32,
        random: &mut Random,
    ) -> Vec<[f64; 3]> {
        let column = |i: usize| camera.to_world.map(|row| row[i]);
        let (right, up, back, eye) = (column(0), column(1), column(2), column(3));
        let (half, parallel) = match camera.projection {
            Projection::Perspective { yfov, .. } => ((0.5 * yfov).tan(), false),
            Projection::Orthographic { ymag, .. } => (ymag, true),
        };
        let aspect = f64::from(width) / f64::from(height);
        let mut pixel = |x: u32, y: u32| {
            let mut sum = [0.0; 3];
            for _ in 0..spp {
                let x = (2.0 * (f64::from(x) + random.unit()) / f64::from(width) - 1.0) * half * aspect;
                let y = (1.0 - 2.0 * (f64::from(y) + random.unit()) / f64::from(height)) * half;
                let offset = add_scaled(right.map(|c| c * x), y, up);
                let forward = back.map(|c| -c);
                let (from, towards) = if parallel {
                    (add_scaled(eye, 1.0, offset), forward)
                } else {
                    (eye, unit(add_scaled(forward, 1.0, offset)))
                };
                let found = self.path(from, towards, max_depth, random);
                sum = [0, 1, 2].map(|c| sum[c] + found[c] / f64::from(spp));
            }
            sum
        };
        (0..width * height).map(|i| pixel(i % width, i / width)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forms::lambert;
    use crate::world::{World, light, matte, pencil, rectangle, rectangle_corners};

    /// The twin itself: a floor under a lamp by Lambert's formula, and a white box in a white sky. 4σ.
    #[test]
    fn the_twin_knows_lamberts_formula() {
        let lamp = ([0.3, 1.0, -0.2], [0.7, 0.0, 0.0], [0.0, 0.0, 0.9]);
        let world = World::new()
            .with(rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]), matte([0.5; 3]))
            .with(rectangle(lamp.0, lamp.1, lamp.2), light([3.0; 3]));
        let pixels = Twin::new(&world.scene).picture(
            &pencil([3.9, 0.3, 0.0], [0.0; 3]),
            (64, 64),
            64,
            3,
            &mut Random(1),
        );
        let corners = rectangle_corners(lamp.0, lamp.1, lamp.2);
        let e = 3.0 * lambert(&corners, [0.0; 3], [0.0, 1.0, 0.0]).abs();
        crate::measured::Measured::of(&pixels).assert_grey(0.5 / core::f64::consts::PI * e, 4e-3, "twin");
    }
}
