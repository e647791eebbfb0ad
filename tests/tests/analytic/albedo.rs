//! Balls of each material in a uniform sky: convex, so that every facet shows its own albedo, and against quadrature.

use crate::SIGMA;
use hotspot_scene::{Bsdf, Color, Material, Projection, Scalar};
use hotspot_tests::albedo::{metal_albedo, substrate_albedo};
use hotspot_tests::measured::measure_film;
use hotspot_tests::picture::settings;
use hotspot_tests::world::{
    World, camera, cross, dot, matte, metal, mirror, sphere, sub, substrate, surface, unit,
};

type Albedo = Box<dyn Fn(f64) -> f64>;

fn materials() -> Vec<(&'static str, Material, Albedo)> {
    let glass = |thin| {
        surface(Bsdf::Glass {
            ior: 1.5,
            thin,
            transmittance: Color::constant([1.0; 3]),
            absorption: [0.0; 3],
        })
    };
    let mix = surface(Bsdf::Mix {
        weight: Scalar::constant(0.25),
        base: Box::new(Bsdf::Matte { reflectance: Color::constant([0.8; 3]) }),
        other: Box::new(Bsdf::Mirror { reflectance: Color::constant([0.4; 3]) }),
    });
    let alpha = |roughness: f32| f64::from(roughness * roughness);
    vec![
        ("matte", matte([0.5; 3]), Box::new(|_| 0.5)),
        ("mirror", mirror([0.25; 3]), Box::new(|_| 0.25)),
        ("glass", glass(false), Box::new(|_| 1.0)),
        ("thin glass", glass(true), Box::new(|_| 1.0)),
        ("mix", mix, Box::new(|_| 0.75 * f64::from(0.8f32) + 0.25 * f64::from(0.4f32))),
        (
            "substrate",
            substrate([0.5; 3], 0.04, 0.3),
            Box::new(move |cos| substrate_albedo(0.5, f64::from(0.04f32), alpha(0.3), cos)),
        ),
        ("rough metal", metal([0.75; 3], 0.5), Box::new(move |cos| metal_albedo(0.75, alpha(0.5), cos))),
    ]
}

/// The mean over a film around the ball: what each visible facet shows, by its projected area, and the sky beside it.
#[test]
fn balls_show_their_albedo() {
    let ball = sphere([0.0; 3], 1.0, 1, false);
    let from = [2.0, 3.0, 4.0];
    let eye = unit(from);
    // Projected area and cosine of the facets that face the eye.
    let facets: Vec<(f64, f64)> = ball
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| ball.positions[i as usize].map(f64::from));
            let n = cross(sub(b, a), sub(c, a));
            (0.5 * dot(n, eye), dot(unit(n), eye))
        })
        .filter(|f| f.1 > 0.0)
        .collect();
    let film = 4.0;
    let covered: f64 = facets.iter().map(|f| f.0).sum();
    let camera = camera(from, [0.0; 3], Projection::Orthographic { xmag: 1.0, ymag: 1.0 });
    for (name, material, albedo) in materials() {
        let shown: f64 = facets.iter().map(|(area, cos)| area * albedo(*cos)).sum();
        let expected = (shown + film - covered) / film;
        let scene = World::new().with(ball.clone(), material).with_environment([1.0; 3]).prepare();
        let measured = measure_film(&scene, &camera, &settings(16, 16, 16, 1000, 1), 64);
        measured.assert_grey(expected, SIGMA, name);
        assert!(expected < 1.01, "{name}");
    }
}
