//! The surface at eight hits: normals, bumps, and the points that rays leave from.

use super::bsdf::At;
use super::counts::Lookups;
use super::math::vec3;
use super::path::View;
use super::{PartLanes, PointLanes, triangle_error};
use crate::class::Class;
use crate::scene::RenderScene;
use crate::surface::bumped;
use hotspot_bvh::rays::Hits;
use hotspot_bvh::simd::{Floats, Integers, Lanes, Simd, Vectors, set_vector};
use hotspot_probe::NONE;

/// [`Geometry::normal`](crate::geometry::Geometry::normal).
#[inline(always)]
pub(super) fn shading_normals<S: Simd>(
    s: S,
    view: &View<'_>,
    surface: &PartLanes<S>,
    hits: &Hits<S>,
) -> Vectors<S> {
    let lanes = view.lanes;
    if !lanes.smooth {
        return hits.normal;
    }
    let first = surface.normals_at;
    let [a, b, c] = if let Some(flat) = &lanes.flat_normals {
        let normal = Vectors::gather(flat, hits.primitive.shift_left::<1>() + hits.primitive);
        [normal, normal, normal]
    } else {
        let (corners, normals) = view.scene.geometry.corners_and_normals();
        let at = hits.primitive + surface.corners_at;
        let [a, b, c, _] = Integers::gather_fours(corners, at.shift_left::<1>() + at);
        [normals_at(normals, first + a), normals_at(normals, first + b), normals_at(normals, first + c)]
    };
    let normal = a.scaled(1.0 - hits.u - hits.v) + b.scaled(hits.u) + c.scaled(hits.v);
    let reciprocal = 1.0 / normal.dot(normal).sqrt();
    let infinite = Floats::splat(s, f32::INFINITY);
    let whole = Floats::splat(s, 0.0).less(reciprocal) & reciprocal.less(infinite);
    normal.scaled(reciprocal).or_where_not(whole.without(first.is(NONE)), hits.normal)
}

#[inline(always)]
fn normals_at<S: Simd>(normals: &[f32], index: Integers<S>) -> Vectors<S> {
    Vectors::gather(normals, index.shift_left::<1>() + index)
}

/// [`bumped`] in lanes `asked`; in others the third vectors, shading normals on the paths' sides.
#[inline(never)]
pub(super) fn bumped_normals<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    at: &At<S>,
    [smooth, wo, normal]: [Vectors<S>; 3],
    asked: u32,
    lookups: &mut [Lookups; 8],
) -> Vectors<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (places, smooth, wo) = (at.store(), smooth.store(), wo.store());
            let mut normal = normal.store();
            for lane in Lanes(asked) {
                let (surface, attributes) = places.surface::<C>(scene, lane);
                let weights = places.weights(lane);
                let (smooth, wo) = (vec3(&smooth, lane), vec3(&wo, lane));
                let bumped = bumped(scene, surface, weights, &attributes, smooth, wo, &mut lookups[lane]);
                set_vector(&mut normal, lane, bumped.to_array());
            }
            Vectors::load(s, &normal)
        },
    )
}

/// [`Geometry::point`](crate::geometry::Geometry::point) for lanes `alive`.
#[inline(always)]
pub(super) fn points<S: Simd>(s: S, view: &View<'_>, hits: &Hits<S>, alive: u32) -> PointLanes<S> {
    let geometry = &view.scene.geometry;
    let point = PointLanes::new(s, hits.corners, triangle_error(s, hits.corners), hits.u, hits.v);
    let least = hits.u.min(hits.v).min(1.0 - hits.u - hits.v)
        * Floats::gather(geometry.least_heights(), hits.primitive);
    let at_edge = least.less(point.margin(s)).bits() & alive;
    if at_edge == 0 {
        return point;
    }
    let (primitive, u, v) = (hits.primitive.store(), hits.u.store(), hits.v.store());
    point.replaced(s, at_edge, |lane| {
        geometry.point(geometry.world_surface(primitive.0[lane]), u.0[lane], v.0[lane])
    })
}
