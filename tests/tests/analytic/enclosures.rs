//! Closed rooms at albedo 0.5, with paths of any length.

use crate::{SIGMA, TESSELLATION};
use core::f64::consts::PI;
use hotspot_scene::Mesh;
use hotspot_tests::forms;
use hotspot_tests::measured::{Measured, measure_with};
use hotspot_tests::picture::settings;
use hotspot_tests::world::{V3, World, cross, cuboid, dot, emitting, matte, pencil, sphere, sub, unit};

/// No limit that a path could reach (roulette ends them all), with the roulette that renders have by default.
const UNLIMITED: u32 = u32::MAX;

fn seen(world: &World, to: V3, spp: u32) -> Measured {
    measure_with(&world.prepare(), &pencil([0.0; 3], to), &settings(24, 24, spp, UNLIMITED, 5))
}

/// Walls that emit e and reflect ρ: e/(1 − ρ) everywhere, whatever the shape of the room: exact for the mesh.
#[test]
fn luminous_rooms_without_a_limit() {
    let walls = emitting(matte([0.5, 0.25, 0.75]), [1.0, 2.0, 0.5]);
    for (room, what) in [
        (sphere([0.0; 3], 1.0, 3, true), "sphere"),
        (cuboid([-1.0, -0.7, -1.3], [1.2, 0.9, 1.0], true), "box"),
    ] {
        let world = World::new().with(room, walls.clone());
        let expected = [2.0, 2.0 / 0.75, 2.0];
        seen(&world, [-0.3, -0.6, 0.7], 1024).assert_near(expected, SIGMA, what);
    }
}

fn corners(mesh: &Mesh, triangle: [u32; 3]) -> [V3; 3] {
    triangle.map(|i| mesh.positions[i as usize].map(f64::from))
}

fn area(mesh: &Mesh) -> f64 {
    let areas = mesh.triangles.iter().map(|t| {
        let [a, b, c] = corners(mesh, *t);
        let n = cross(sub(b, a), sub(c, a));
        0.5 * dot(n, n).sqrt()
    });
    areas.sum()
}

/// The integrating sphere: a patch of the wall shines (L), all of it reflects ρ = 0.5. Every point of a sphere sees every
/// other one alike, so E = Φ/(4πr² (1 − ρ)) with Φ = π L A of the patch, half of it direct. The mesh: 81 920 triangles, direct
/// light by Lambert's formula over the patch's triangles (a facet is turned from the sphere's tangent by up to 0.7 degrees,
/// which shows in it), the rest by conservation of energy over the mesh's own area.
#[test]
fn an_integrating_sphere() {
    let ball = sphere([0.0; 3], 1.0, 6, true);
    let pole = unit([0.2, 0.9, -0.3]);
    let (mut patch, mut rest) = (ball.clone(), ball.clone());
    let shines = |t: &[u32; 3]| corners(&ball, *t).iter().all(|p| dot(*p, pole) > 0.97);
    patch.triangles.retain(|t| shines(t));
    rest.triangles.retain(|t| !shines(t));
    let (of_patch, whole) = (area(&patch), area(&ball));
    assert!((whole / (4.0 * PI) - 1.0).abs() < TESSELLATION, "area {whole}");
    let world =
        World::new().with(patch.clone(), emitting(matte([0.5; 3]), [10.0; 3])).with(rest, matte([0.5; 3]));
    for to in [[0.5, -0.7, 0.4], [-0.8, 0.1, 0.5], [0.1, 0.2, -0.9]] {
        // Where the ray from the centre meets the mesh, and the normal of that facet.
        let to = unit(to);
        let inside = |t: &&[u32; 3]| {
            let [a, b, c] = corners(&ball, **t);
            dot(a, to) > 0.0 && [(a, b), (b, c), (c, a)].iter().all(|(a, b)| dot(cross(*a, *b), to) <= 0.0)
        };
        let facet = corners(&ball, *ball.triangles.iter().find(inside).expect("the sphere is closed"));
        let n = unit(cross(sub(facet[1], facet[0]), sub(facet[2], facet[0])));
        let p = to.map(|c| c * dot(facet[0], n) / dot(to, n));
        let direct: f64 =
            patch.triangles.iter().map(|t| 10.0 * forms::lambert(&corners(&patch, *t), p, n).abs()).sum();
        let power = PI * 10.0 * of_patch;
        let e = direct + 0.5 * power / whole / 0.5;
        seen(&world, to, 512).assert_grey(0.5 / PI * e, SIGMA, &format!("towards {to:?}"));
    }
}
