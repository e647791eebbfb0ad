//! Lights without area: points, spots, and directions from infinitely far away (KHR_lights_punctual).
//!
//! All the light of such a light arrives from one direction, so only light sampling finds it, and no ray ever hits it.
//! Distances are squared in f64: the scene may be of any size that f32 holds.

use super::{LightSample, LightTarget};
use glam::{DVec3, Vec3};
use hotspot_bvh::Ray;
use hotspot_scene::{Light, LightKind};

/// A light made ready.
#[derive(Clone, Copy, Debug)]
pub(super) struct PunctualLight {
    kind: Kind,
    /// W/sr, or W/m² across the rays of a directional light; finite, at least 0.
    intensity: Vec3,
    /// Probability of choosing it, all choices included.
    pub(super) probability: f32,
}

/// Where it shines.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Point {
        position: Vec3,
    },
    Spot {
        position: Vec3,
        /// Of unit length.
        axis: DVec3,
        cos_outer: f64,
        /// 1 / (cos inner − cos outer).
        slope: f64,
    },
    Directional {
        /// Unit direction to the light.
        towards: Vec3,
    },
}

impl PunctualLight {
    /// `None` for a light that cannot shine: dark, or with numbers that are not finite.
    pub(super) fn new(light: &Light) -> Option<Self> {
        let intensity = Vec3::from_array(light.intensity);
        if !intensity.is_finite() || intensity.max_element() <= 0.0 {
            return None;
        }
        let place = |p: [f32; 3]| Some(Vec3::from_array(p)).filter(|p| p.is_finite());
        let unit = |d: [f32; 3]| DVec3::from_array(d.map(f64::from)).try_normalize();
        let kind = match light.kind {
            LightKind::Point { position } => Kind::Point { position: place(position)? },
            LightKind::Spot { position, direction, cos_inner, cos_outer } => {
                let (inner, outer) = (f64::from(cos_inner), f64::from(cos_outer));
                if !inner.is_finite() || !outer.is_finite() {
                    return None;
                }
                // Equal angles make a hard edge.
                let slope = 1.0 / (inner - outer).max(1e-12);
                Kind::Spot { position: place(position)?, axis: unit(direction)?, cos_outer: outer, slope }
            }
            LightKind::Directional { direction } => {
                Kind::Directional { towards: (-unit(direction)?).as_vec3() }
            }
        };
        Some(Self { kind, intensity: intensity.max(Vec3::ZERO), probability: 0.0 })
    }

    /// Power in W, summed over channels; of a directional light that which enters a sphere of the scene's `radius`.
    pub(super) fn power(&self, radius: f64) -> f64 {
        let sum: f64 = self.intensity.to_array().iter().map(|c| f64::from(*c)).sum();
        let pi = core::f64::consts::PI;
        sum * match self.kind {
            Kind::Point { .. } => 4.0 * pi,
            // ∫ falloff dω = 2π ((1 − cos inner) + (cos inner − cos outer) / 3): s² from 0 to 1 integrates to a third.
            Kind::Spot { cos_outer, slope, .. } => {
                let edge = 1.0 / slope;
                2.0 * pi * ((1.0 - cos_outer - edge).max(0.0) + edge / 3.0)
            }
            Kind::Directional { .. } => pi * radius * radius,
        }
    }

    /// Where it is; `None` infinitely far away.
    #[cfg(test)]
    pub(super) fn position(&self) -> Option<Vec3> {
        match self.kind {
            Kind::Point { position } | Kind::Spot { position, .. } => Some(position),
            Kind::Directional { .. } => None,
        }
    }

    /// The light at `p`. `None` where it brings none: outside a spot's cone, or at the light's own position.
    #[inline(never)]
    pub(super) fn sample(&self, p: Vec3) -> Option<LightSample> {
        let (wi, target) = match self.kind {
            Kind::Directional { towards } => (towards, LightTarget::Direction(self.intensity)),
            Kind::Point { position } => {
                let (d, distance2) = way(p, position);
                let wi = (d / distance2.sqrt()).as_vec3();
                (wi, LightTarget::Position { irradiance: self.at(1.0, distance2)?, position })
            }
            Kind::Spot { position, axis, cos_outer, slope } => {
                let (d, distance2) = way(p, position);
                let wi = d / distance2.sqrt();
                let s = ((-wi.dot(axis) - cos_outer) * slope).clamp(0.0, 1.0);
                let irradiance = self.at(s * s, distance2)?;
                (wi.as_vec3(), LightTarget::Position { irradiance, position })
            }
        };
        Some(LightSample { wi, pdf: self.probability, target })
    }

    /// Irradiance across the rays; `None` where it is nothing or not finite.
    #[inline(always)]
    fn at(&self, falloff: f64, distance2: f64) -> Option<Vec3> {
        let irradiance = (self.intensity.as_dvec3() * (falloff / distance2)).as_vec3();
        (irradiance.is_finite() && irradiance.max_element() > 0.0).then_some(irradiance)
    }
}

/// From `p` to a light, and the squared length of that.
#[inline(always)]
fn way(p: Vec3, position: Vec3) -> (DVec3, f64) {
    let d = position.as_dvec3() - p.as_dvec3();
    (d, d.length_squared())
}

/// The shadow ray from `origin` to a light at `position`. It ends short of the light by what rounding can move the surfaces
/// there (2^-24 of their coordinates) and the distances found by the intersection test (5 · 2^-24 of the length, see
/// [`SurfacePoint::meet`](crate::geometry::SurfacePoint::meet)), taken together and doubled: so a light that lies in a
/// surface, such as a ceiling, is not blocked by it. `None` at the light itself.
#[inline(always)]
pub(crate) fn ray_to_position(origin: Vec3, position: Vec3) -> Option<Ray> {
    let way = position - origin;
    let length = way.abs().max_element();
    if length == 0.0 {
        return None;
    }
    let size = position.abs().max_element().max(origin.abs().max_element());
    let mut ray = Ray::new(origin.to_array(), way.to_array());
    ray.t_max = (1.0 - f32::EPSILON * (5.0 + size / length)).max(0.0);
    Some(ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: LightKind, intensity: [f32; 3]) -> Light {
        Light { name: "light".into(), kind, intensity }
    }

    fn spot(cos_inner: f32, cos_outer: f32) -> LightKind {
        LightKind::Spot { position: [0.0; 3], direction: [0.0, 0.0, -1.0], cos_inner, cos_outer }
    }

    /// ∫ I dω by midpoints over the cosine.
    #[test]
    fn a_spots_power_is_its_intensity_over_the_sphere() {
        for (inner, outer) in [(0.9, 0.7), (1.0, -1.0), (0.3, 0.299), (0.999, 0.99)] {
            let light = PunctualLight::new(&light(spot(inner, outer), [1.0, 2.0, 3.0])).unwrap();
            let n = 200_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let z = 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
                    let p = Vec3::new((1.0 - z * z).sqrt() as f32, 0.0, -z as f32);
                    light.sample(p).map_or(0.0, |s| match s.target {
                        LightTarget::Position { irradiance, .. } => f64::from(irradiance.element_sum()),
                        _ => 0.0,
                    })
                })
                .sum();
            let power = sum * 4.0 * core::f64::consts::PI / f64::from(n);
            assert!((light.power(1.0) / power - 1.0).abs() < 1e-4, "{} for {power}", light.power(1.0));
        }
    }

    #[test]
    fn lights_that_cannot_shine_are_left_out() {
        let point = |position| LightKind::Point { position };
        assert!(PunctualLight::new(&light(point([0.0; 3]), [0.0, 1.0, 0.0])).is_some());
        for intensity in [[0.0; 3], [-1.0; 3], [f32::NAN, 1.0, 1.0], [f32::INFINITY; 3]] {
            assert!(PunctualLight::new(&light(point([0.0; 3]), intensity)).is_none());
        }
        for kind in [
            point([f32::NAN, 0.0, 0.0]),
            LightKind::Directional { direction: [0.0; 3] },
            LightKind::Directional { direction: [f32::NAN; 3] },
            spot(f32::NAN, 0.0),
        ] {
            assert!(PunctualLight::new(&light(kind, [1.0; 3])).is_none(), "{kind:?}");
        }
    }

    #[test]
    fn nothing_comes_from_the_lights_own_position() {
        for kind in [LightKind::Point { position: [0.0; 3] }, spot(1.0, -1.0)] {
            let light = PunctualLight::new(&light(kind, [1.0; 3])).unwrap();
            assert!(light.sample(Vec3::ZERO).is_none());
            assert!(light.sample(Vec3::splat(1e-30)).is_none(), "beyond the range of f32");
            assert!(light.sample(Vec3::splat(1e-15)).is_some());
        }
        assert!(ray_to_position(Vec3::ONE, Vec3::ONE).is_none());
    }

    #[test]
    fn shadow_rays_end_just_short_of_the_light() {
        let end = |origin, position| ray_to_position(origin, position).unwrap().t_max;
        let near = end(Vec3::ZERO, Vec3::X);
        assert!(near < 1.0 && near > 0.999_999, "{near}");
        // Far from the origin the light's surroundings are coarser.
        let far = end(Vec3::new(1e6, 0.0, 0.0), Vec3::new(1e6 + 1.0, 0.0, 0.0));
        assert!((0.8..0.95).contains(&far), "{far}");
        assert_eq!(end(Vec3::new(1e8, 0.0, 0.0), Vec3::new(1e8 + 8.0, 0.0, 0.0)), 0.0);
    }
}
