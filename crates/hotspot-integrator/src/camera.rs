//! From film positions to camera rays.

use glam::Vec3;
use hotspot_bvh::rays::Rays;
use hotspot_bvh::simd::{Floats, Integers, Simd, Vectors};
use hotspot_scene::{Camera, Projection};

/// A camera ready for a film of a given shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FilmCamera {
    origin: Vec3,
    forward: Vec3,
    /// From the film's left edge to its right, in the plane at distance 1 (perspective) or in the world (orthographic).
    right: Vec3,
    /// From the film's top edge to its bottom.
    down: Vec3,
    parallel: bool,
}

impl FilmCamera {
    /// `aspect`: width over height of the film.
    pub(crate) fn new(camera: &Camera, aspect: f64) -> Self {
        let column = |i: usize| Vec3::from_array([0, 1, 2].map(|row| camera.to_world[row][i] as f32));
        let (half_height, half_width, parallel) = match camera.projection {
            Projection::Perspective { yfov, .. } => {
                let h = libm::tan(0.5 * yfov);
                (h, h * aspect, false)
            }
            // The vertical extent is kept, as for perspective cameras.
            Projection::Orthographic { ymag, .. } => (ymag, ymag * aspect, true),
        };
        Self {
            origin: column(3),
            forward: -column(2),
            right: column(0) * (2.0 * half_width) as f32,
            down: column(1) * (-2.0 * half_height) as f32,
            parallel,
        }
    }

    /// Origin and unit direction of the ray through film position (x, y), each in [0, 1] from the upper left corner.
    #[inline(always)]
    pub(crate) fn ray(&self, x: f32, y: f32) -> (Vec3, Vec3) {
        let offset = self.right * (x - 0.5) + self.down * (y - 0.5);
        if self.parallel {
            (self.origin + offset, self.forward)
        } else {
            (self.origin, (self.forward + offset).normalize())
        }
    }

    /// The ray through the point (u, v) of pixel (x, y), each in [0, 1), on a film of that many pixels.
    #[inline(always)]
    pub(crate) fn ray_of(
        &self,
        (x, y): (u32, u32),
        [u, v]: [f32; 2],
        (width, height): (u32, u32),
    ) -> (Vec3, Vec3) {
        self.ray((x as f32 + u) / width as f32, (y as f32 + v) / height as f32)
    }

    /// The largest coordinate that the origin of a ray may have.
    pub(crate) fn reach(&self) -> f32 {
        let far =
            self.origin.abs() + if self.parallel { self.right.abs() + self.down.abs() } else { Vec3::ZERO };
        far.max_element()
    }

    /// Where all rays go, if they go the same way.
    pub(crate) fn parallel_direction(&self) -> Option<[f32; 3]> {
        self.parallel.then(|| self.forward.to_array())
    }

    /// [`FilmCamera::ray_of`] in lanes: the same bits.
    #[inline(always)]
    pub(crate) fn rays<S: Simd>(
        &self,
        s: S,
        [x, y]: [Integers<S>; 2],
        [u, v]: [Floats<S>; 2],
        (width, height): (u32, u32),
    ) -> Rays<S> {
        let x = (x.to_floats() + u) / Floats::splat(s, width as f32);
        let y = (y.to_floats() + v) / Floats::splat(s, height as f32);
        let across = Vectors::splat(s, self.right.to_array()).scaled(x - 0.5);
        let offset = across + Vectors::splat(s, self.down.to_array()).scaled(y - 0.5);
        let origin = Vectors::splat(s, self.origin.to_array());
        let forward = Vectors::splat(s, self.forward.to_array());
        if self.parallel {
            return Rays { origin: origin + offset, direction: forward };
        }
        let towards = forward + offset;
        Rays { origin, direction: towards.scaled(1.0 / towards.dot(towards).sqrt()) }
    }
}

/// A camera that sees the whole box (`min`, `max`) from a three-quarter view, for files that bring none.
pub fn frame_bounds(min: [f32; 3], max: [f32; 3]) -> Camera {
    let finite = min.iter().chain(&max).all(|c| c.is_finite());
    let (min, max) = if finite { (min.map(f64::from), max.map(f64::from)) } else { ([-1.0; 3], [1.0; 3]) };
    let center: [f64; 3] = core::array::from_fn(|i| 0.5 * (min[i] + max[i]));
    let radius = (0..3).map(|i| (0.5 * (max[i] - min[i])).powi(2)).sum::<f64>().sqrt().max(1e-6);
    let yfov = 40f64.to_radians();
    // Seen from the front (+Z), a little from the right and above.
    let back = glam::DVec3::new(0.35, 0.3, 1.0).normalize();
    let distance = radius / libm::sin(0.5 * yfov);
    let right = glam::DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    let eye = glam::DVec3::from_array(center) + back * distance;
    Camera {
        name: "framing the scene".into(),
        to_world: [0, 1, 2].map(|i| [right[i], up[i], back[i], eye[i]]),
        projection: Projection::Perspective { yfov, aspect: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_square::{COLUMNS, Cells, ROWS, Random, SAMPLES, Suite, p_value};

    /// Uniform numbers on the film: rays have density d²/(A cos³ θ) per solid angle (A: the film at distance d), by
    /// chi-square over a cone that fits the film; and those of an orthographic camera are spread evenly. 10^6 samples each,
    /// rate of any false alarm 1 %.
    #[test]
    fn rays_fill_the_film_evenly() {
        let mut suite = Suite::new();
        let mut random = Random(1);
        let (s, c) = (0.6, 0.8);
        let to_world = [[c, 0.0, s, 5.0], [0.0, 1.0, 0.0, 6.0], [-s, 0.0, c, 7.0]];
        let camera = |projection| Camera { name: String::new(), to_world, projection };
        for yfov in [0.05f64, 0.9, 2.6] {
            let film = FilmCamera::new(&camera(Projection::Perspective { yfov, aspect: None }), 2.0);
            let half = (0.5 * yfov).tan();
            let forward = glam::DVec3::new(-s, 0.0, -c);
            let density = |w: glam::DVec3| 1.0 / (8.0 * half * half * w.dot(forward).powi(3));
            suite.directions(format!("{yfov}"), &Cells::new(forward, 0.499 * yfov, 1), density, || {
                let (origin, direction) = film.ray(random.single(), random.single());
                assert_eq!(origin, Vec3::new(5.0, 6.0, 7.0));
                Some(direction.as_dvec3())
            });
        }
        let film = FilmCamera::new(&camera(Projection::Orthographic { xmag: 9.0, ymag: 2.0 }), 2.0);
        let mut hits = vec![0; ROWS * COLUMNS];
        for _ in 0..SAMPLES {
            let (origin, direction) = film.ray(random.single(), random.single());
            assert!((direction - Vec3::new(-0.6, 0.0, -0.8)).length() < 1e-6);
            let d = origin.as_dvec3() - glam::DVec3::new(5.0, 6.0, 7.0);
            let (x, y) = (c * d.x - s * d.z, d.y);
            let cell =
                |v: f64, half: f64, n: usize| ((v / half + 1.0) * 0.5 * n as f64).clamp(0.0, n as f64 - 1.0);
            hits[cell(y, 2.0, ROWS) as usize * COLUMNS + cell(x, 4.0, COLUMNS) as usize] += 1;
        }
        let expected = vec![SAMPLES as f64 / hits.len() as f64; hits.len()];
        suite.add("orthographic".into(), p_value(&hits, &expected));
        suite.finish();
    }

    #[test]
    fn the_film_edges_span_the_field_of_view() {
        let camera = Camera {
            name: String::new(),
            to_world: [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0]],
            projection: Projection::Perspective { yfov: core::f64::consts::FRAC_PI_2, aspect: None },
        };
        let film = FilmCamera::new(&camera, 2.0);
        let (origin, top) = film.ray(0.5, 0.0);
        assert_eq!(origin, Vec3::new(5.0, 6.0, 7.0));
        assert!((top - Vec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-6, "{top}");
        let (_, right) = film.ray(1.0, 0.5);
        assert!((right - Vec3::new(2.0, 0.0, -1.0).normalize()).length() < 1e-6, "{right}");
    }
}
