//! A Lambertian plane under a sphere, a disk, a rectangle and an environment; form factors of squares.

use crate::{SIGMA, TESSELLATION};
use core::f64::consts::{PI, TAU};
use hotspot_scene::{Camera, Mesh, Projection};
use hotspot_tests::forms;
use hotspot_tests::measured::{measure, measure_film};
use hotspot_tests::picture::settings;
use hotspot_tests::world::{
    V3, World, add_scaled, camera, light, matte, mesh, pencil, rectangle, rectangle_corners, sphere,
};

const UP: V3 = [0.0, 1.0, 0.0];

fn floor() -> Mesh {
    rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0])
}

/// A grazing view of the origin, below all lights.
fn view() -> Camera {
    pencil([3.9, 0.35, 0.2], [0.0; 3])
}

/// The floor's radiance at the origin, for irradiance `e` from a light of radiance 1.
fn assert_lit(world: &World, e: f64, spp: u32, what: &str) {
    let expected = [0.2f32, 0.5, 0.9].map(|rho| f64::from(rho) / PI * e);
    measure(&world.prepare(), &view(), 1, spp).assert_near(expected, SIGMA, what);
}

fn lit_floor() -> World {
    World::new().with(floor(), matte([0.2, 0.5, 0.9]))
}

/// π (r/d)² cos θ. 81 920 triangles: 0.01 % less than the sphere.
#[test]
fn a_sphere_over_a_plane() {
    for (center, radius) in [([0.0, 1.5, 0.0], 0.5), ([0.7, 1.2, -0.4], 0.4), ([-1.5, 0.9, 1.0], 0.3)] {
        let ball = sphere(center, radius, 6, false);
        let what = format!("sphere at {center:?}");
        let e = forms::convex_mesh(&ball, [0.0; 3], UP);
        let curved = forms::sphere(center, radius, UP);
        assert!((e / curved - 1.0).abs() < TESSELLATION, "{what}: mesh {e}, sphere {curved}");
        assert_lit(&lit_floor().with(ball, light([1.0; 3])), e, 1024, &what);
    }
}

/// A fan of 512 triangles, facing down, with the area of the disk.
fn disk(center: V3, radius: f64) -> Mesh {
    let n = 512u32;
    let step = TAU / f64::from(n);
    let radius = radius * (step / step.sin()).sqrt();
    let rim = (0..n).map(|i| {
        let (s, c) = (step * f64::from(i)).sin_cos();
        add_scaled(center, radius, [c, 0.0, s])
    });
    let positions = core::iter::once(center).chain(rim).map(|p| p.map(|c| c as f32)).collect();
    // Counter-clockwise seen from below: x towards z.
    mesh(positions, (0..n).map(|i| [0, 1 + i, 1 + (i + 1) % n]).collect())
}

#[test]
fn a_disk_over_a_plane() {
    for (center, radius) in [([0.0, 1.0, 0.0], 0.6), ([0.8, 0.7, -0.3], 0.5), ([-1.2, 1.4, 0.9], 1.0)] {
        let disk = disk(center, radius);
        let what = format!("disk at {center:?}");
        let e = forms::convex_mesh(&disk, [0.0; 3], UP);
        let curved = forms::parallel_disk(radius, center[1], center[0].hypot(center[2]));
        assert!((e / curved - 1.0).abs() < TESSELLATION, "{what}: mesh {e}, disk {curved}");
        assert_lit(&lit_floor().with(disk, light([1.0; 3])), e, 1024, &what);
    }
}

/// A rectangle over the point by its four corners (B-5), from far to so near that it gives 95 % of what the whole half space would.
#[test]
fn a_rectangle_over_a_plane() {
    for (height, [left, right, front, back]) in [
        (1.0, [0.5, 0.5, 0.5, 0.5]),
        (0.6, [0.2, 1.1, 0.7, 0.3]),
        (2.5, [0.4, 0.4, 1.5, 0.1]),
        (0.4, [1.5; 4]),
    ] {
        let (u, v) = (0.5 * (left + right), 0.5 * (front + back));
        let lamp =
            rectangle([0.5 * (right - left), height, 0.5 * (back - front)], [u, 0.0, 0.0], [0.0, 0.0, v]);
        let corner = |a, b| forms::parallel_rectangle_corner(a, b, height);
        let e = corner(left, front) + corner(left, back) + corner(right, front) + corner(right, back);
        assert_lit(&lit_floor().with(lamp, light([1.0; 3])), e, 256, &format!("rectangle at {height}"));
    }
}

/// E = π L under the open sky, exactly; less what a black rectangle hides of it.
#[test]
fn an_environment_over_a_plane() {
    let open = lit_floor().with_environment([1.0; 3]);
    assert_lit(&open, PI, 16, "open sky");
    for (center, u, v) in [
        ([0.0, 0.8, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.7]),
        ([-0.6, 0.9, 0.5], [0.4, 0.1, 0.0], [0.0, 0.2, 0.6]),
        ([-1.0, 1.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 3.0]),
    ] {
        let hidden = forms::lambert(&rectangle_corners(center, u, v), [0.0; 3], UP).abs();
        let world = open.clone().with(rectangle(center, u, v), matte([0.0; 3]));
        assert_lit(&world, PI - hidden, 512, &format!("sky behind a screen at {center:?}"));
    }
}

/// Form factors of opposite squares and of squares that share an edge: the mean irradiance of the one from the other, seen by
/// a camera whose film covers it exactly, from between the two. 64 renders each.
#[test]
fn form_factors_of_squares() {
    let half = 0.5;
    let projection = Projection::Orthographic { xmag: half, ymag: half };
    let down = |height: f64| camera([0.0, height, 0.0], [0.0; 3], projection);
    let square = rectangle([0.0; 3], [0.0, 0.0, half], [half, 0.0, 0.0]);
    let world = World::new().with(square, matte([0.5; 3]));
    let assert_factor = |world: World, camera: &Camera, factor: f64, what: &str| {
        let settings = settings(16, 16, 64, 1, 1);
        measure_film(&world.prepare(), camera, &settings, 64).assert_grey(0.5 * 2.0 * factor, SIGMA, what);
    };
    for distance in [0.5, 1.0, 2.0] {
        let lamp = rectangle([0.0, distance, 0.0], [half, 0.0, 0.0], [0.0, 0.0, half]);
        let world = world.clone().with(lamp, light([2.0; 3]));
        let what = format!("opposite squares at {distance}");
        assert_factor(world, &down(0.5 * distance), forms::opposite_squares(distance), &what);
    }
    let wall = rectangle([-half, half, 0.0], [0.0, half, 0.0], [0.0, 0.0, half]);
    assert_factor(
        world.with(wall, light([2.0; 3])),
        &down(2.0),
        forms::adjoining_squares(),
        "adjoining squares",
    );
}
