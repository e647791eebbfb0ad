//! From film positions to camera rays.

use glam::Vec3;
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
