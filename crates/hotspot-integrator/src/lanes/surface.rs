//! The surface at eight hits: normals, bumps, and the points that rays leave from.

use super::bsdf::At;
use super::counts::Lookups;
use super::math::vec3;
use super::path::View;
use super::{PartLanes, PointLanes, triangle_error};
use crate::class::Class;
use crate::scene::RenderScene;
use crate::surface::{bumped, emitted};
use crate::texture::color;
use glam::{Vec2, Vec3};
use hotspot_bvh::Hit;
use hotspot_bvh::rays::Hits;
use hotspot_bvh::simd::{Floats, Integers, Lanes, Simd, Vectors, set_vector, vector};
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

/// [`Geometry::normal`](crate::geometry::Geometry::normal) of instances in lanes `placed`; in others `smooth`.
#[inline(never)]
pub(super) fn placed_normals<S: Simd>(
    s: S,
    scene: &RenderScene,
    (hits, instance): (&Hits<S>, Integers<S>),
    smooth: Vectors<S>,
    placed: u32,
) -> Vectors<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (primitive, instance) = (hits.primitive.store(), instance.store());
            let (u, v, geometric) = (hits.u.store(), hits.v.store(), hits.normal.store());
            let mut smooth = smooth.store();
            for lane in Lanes(placed) {
                let (primitive, instance) = (primitive.0[lane], instance.0[lane]);
                let (u, v, normal) = (u.0[lane], v.0[lane], vector(&geometric, lane));
                let hit = Hit { t: 0.0, u, v, primitive, instance, normal };
                let normal = scene.geometry.normal(scene.geometry.surface(instance, primitive), &hit);
                set_vector(&mut smooth, lane, normal.to_array());
            }
            Vectors::load(s, &smooth)
        },
    )
}

/// [`Geometry::point`](crate::geometry::Geometry::point) for lanes `alive`, of which `placed` are of instances.
#[inline(always)]
pub(super) fn points<S: Simd>(
    s: S,
    view: &View<'_>,
    (hits, instance): (&Hits<S>, Integers<S>),
    alive: u32,
    placed: u32,
) -> PointLanes<S> {
    let geometry = &view.scene.geometry;
    let point = PointLanes::new(s, hits.corners, triangle_error(s, hits.corners), hits.u, hits.v);
    let least = hits.u.min(hits.v).min(1.0 - hits.u - hits.v)
        * Floats::gather(geometry.least_heights(), hits.primitive);
    let each = (least.less(point.margin(s)).bits() | placed) & alive;
    if each == 0 {
        return point;
    }
    let (primitive, instance) = (hits.primitive.store(), instance.store());
    let (u, v) = (hits.u.store(), hits.v.store());
    point.replaced(s, each, |lane| {
        geometry.point(geometry.surface(instance.0[lane], primitive.0[lane]), u.0[lane], v.0[lane])
    })
}

/// What surfaces emit there that varies, in lanes `asked`; in others `emission`.
#[inline(never)]
pub(super) fn emissions<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    at: &At<S>,
    emission: Vectors<S>,
    asked: u32,
    lookups: &mut [Lookups; 8],
) -> Vectors<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (places, mut emission) = (at.store(), emission.store());
            for lane in Lanes(asked) {
                let (surface, attributes) = places.surface::<C>(scene, lane);
                let given = &scene.materials[surface.part.material as usize].emission;
                let found = color(&scene.textures, given, &attributes, &mut lookups[lane]);
                set_vector(&mut emission, lane, found.to_array());
            }
            Vectors::load(s, &emission)
        },
    )
}

/// The same of points that light sampling takes: [`emitted`].
#[inline(never)]
pub(super) fn emissions_of_samples<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    at: &At<S>,
    emission: Vectors<S>,
    asked: u32,
    lookups: &mut [Lookups; 8],
) -> Vectors<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (places, mut emission) = (at.store(), emission.store());
            for lane in Lanes(asked) {
                let uv = Vec2::from_array(places.weights(lane));
                let found = emitted::<_, C>(scene, places.primitive(lane), uv, &mut lookups[lane]);
                set_vector(&mut emission, lane, found.to_array());
            }
            Vectors::load(s, &emission)
        },
    )
}

/// What unlit surfaces show in lanes `asked`: colours, and what they are multiplied by.
#[inline(never)]
pub(super) fn unlit_colors<S: Simd, C: Class>(
    s: S,
    scene: &RenderScene,
    at: &At<S>,
    asked: u32,
    lookups: &mut [Lookups; 8],
) -> [Vectors<S>; 2] {
    s.vectorize(
        #[inline(always)]
        || {
            let places = at.store();
            let black = Vectors::splat(s, [0.0; 3]).store();
            let (mut colors, mut tints) = (black, black);
            for lane in Lanes(asked) {
                let (surface, attributes) = places.surface::<C>(scene, lane);
                let material = &scene.materials[surface.part.material as usize];
                let hotspot_scene::Bsdf::Unlit { color: given } = &material.bsdf else { continue };
                let found = color(&scene.textures, given, &attributes, &mut lookups[lane]);
                set_vector(&mut colors, lane, found.to_array());
                set_vector(&mut tints, lane, attributes.tint.to_array());
            }
            [Vectors::load(s, &colors), Vectors::load(s, &tints)]
        },
    )
}

/// `light`, in lanes `inside` less what glass absorbs on so long a way.
#[inline(never)]
pub(super) fn absorbed<S: Simd>(
    s: S,
    light: Vectors<S>,
    absorption: Vectors<S>,
    length: Floats<S>,
    inside: u32,
) -> Vectors<S> {
    s.vectorize(
        #[inline(always)]
        || {
            let (mut light, absorption, length) = (light.store(), absorption.store(), length.store());
            for lane in Lanes(inside) {
                let exponent: Vec3 = vec3(&absorption, lane) * -length.0[lane];
                let left = vec3(&light, lane) * Vec3::from_array(exponent.to_array().map(libm::expf));
                set_vector(&mut light, lane, left.to_array());
            }
            Vectors::load(s, &light)
        },
    )
}
