//! The light that stands in where a file has none: when, how bright, and what keeps it away.

use crate::measure;
use hotspot_integrator::{BuildOptions, RenderScene};
use hotspot_scene::{
    Bsdf, Color, Environment, EnvironmentMap, LightKind, Material, Scene, Texture, TextureRef, Wrap,
};
use hotspot_tests::world::{World, environment_map, light, matte, pencil, rectangle, surface};

/// A matte floor of reflectance 0.5 and beside it a panel that glows through a texture of one white texel.
fn with_panel(factor: [f32; 3], textured: bool) -> World {
    let texture = TextureRef {
        texture: 0,
        wrap: [Wrap::Repeat; 2],
        nearest: false,
        transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        second_uvs: false,
    };
    let emission = Color { factor, texture: textured.then_some(texture) };
    let mut panel = rectangle([20.0, -0.1, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
    panel.uvs = Some(vec![[0.0; 2]; 4]);
    let mut world = World::new()
        .with(rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]), matte([0.5; 3]))
        .with(panel, Material { emission, ..matte([0.0; 3]) });
    let rgba = vec![255u8; 4].into();
    world.scene.textures.push(Texture { name: "white".into(), width: 1, height: 1, rgba });
    world
}

/// What was said about light.
fn said(scene: &Scene) -> Option<String> {
    let prepared = RenderScene::prepare(scene, BuildOptions::default()).expect("the scene is whole");
    let said: Vec<String> = prepared.repairs().iter().map(|repair| repair.what.clone()).collect();
    assert!(said.len() <= 1, "{said:?}");
    said.into_iter().next()
}

#[test]
fn glow_alone_is_joined_by_a_white_environment() {
    let world = with_panel([1.0, 0.5, 0.0], true);
    let said = said(&world.scene).expect("a note");
    assert!(said.contains("glow of emissive textures") && said.contains("--env 0,0,0"), "{said}");
    // The floor sees the white sky; the panel lies lower and faces up.
    let view = pencil([0.0, 2.0, 0.0], [0.0; 3]);
    measure(&world.prepare(), &view, 1, 64).assert_grey(0.5, 1e-3, "the floor");
    // The panel shows its glow as the file says.
    let view = pencil([20.0, 2.0, 0.0], [20.0, -0.1, 0.0]);
    let picture = hotspot_tests::picture::picture(
        &world.prepare(),
        &view,
        &hotspot_tests::picture::settings(4, 4, 4, 1, 0),
    );
    assert_eq!(picture.pixels[0], [1.0, 0.5, 0.0]);
}

#[test]
fn whatever_else_shines_keeps_the_environment_away() {
    // Brighter than 1 in one channel, or without a texture: meant as a lamp.
    assert_eq!(said(&with_panel([1.0, 1.5, 0.0], true).scene), None);
    assert_eq!(said(&with_panel([0.5; 3], false).scene), None);
    // One lamp beside the glow.
    let lamp = rectangle([0.0, 3.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    assert_eq!(said(&with_panel([1.0; 3], true).with(lamp.clone(), light([0.1; 3])).scene), None);
    let point = LightKind::Point { position: [0.0, 1.0, 0.0] };
    assert_eq!(said(&with_panel([1.0; 3], true).with_light(point, [1.0; 3]).scene), None);
    // A lamp that is not placed is no lamp.
    let mut unused = with_panel([1.0; 3], true).with(lamp, light([9.0; 3]));
    unused.scene.instances.pop();
    assert!(said(&unused.scene).is_some_and(|said| said.contains("glow")));
    // Nor is a light without power.
    assert!(said(&with_panel([1.0; 3], true).with_light(point, [0.0; 3]).scene).is_some());
}

#[test]
fn a_stated_environment_is_respected_even_a_black_one() {
    let black = || environment_map(4, 2, |_, _| [0.0; 3]);
    let maps: [fn(EnvironmentMap) -> Environment; 2] =
        [Environment::Map, |_| Environment::Constant([0.0; 3])];
    for glow in [0.0, 1.0] {
        let mut world = with_panel([glow; 3], true);
        let without = said(&world.scene).expect("a note");
        assert_eq!(without.contains("glow"), glow > 0.0, "{without}");
        for environment in maps {
            world.scene.environment = Some(environment(black()));
            assert_eq!(said(&world.scene), None);
            let picture = hotspot_tests::picture::picture(
                &world.prepare(),
                &pencil([0.0, 2.0, 0.0], [0.0; 3]),
                &hotspot_tests::picture::settings(4, 4, 4, 3, 0),
            );
            assert_eq!(picture.max(), 0.0);
        }
    }
    // Surfaces that show themselves need no light.
    let unlit = surface(Bsdf::Unlit { color: Color::constant([0.5; 3]) });
    let world = World::new().with(rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]), unlit);
    assert_eq!(said(&world.scene), None);
}
