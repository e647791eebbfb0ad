//! Which kernel a scene is drawn by: the least that can draw it, so that it pays for nothing else; and never a lesser one, which
//! would leave something out.

use hotspot_integrator::SceneClass::{self, Full, Lobes, Matte, Textured};
use hotspot_integrator::{Instancing, PrepareOptions, RenderScene};
use hotspot_scene::{Alpha, Environment, LoadOptions, Scene, load, load_environment};
use std::path::PathBuf;

fn path(file: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../scenes", file].iter().collect()
}

fn scene(file: &str) -> Scene {
    load(&path(file), &LoadOptions::default()).expect("the file loads")
}

fn class_as(scene: &Scene, instancing: Instancing) -> SceneClass {
    let options = PrepareOptions { instancing, ..PrepareOptions::default() };
    RenderScene::prepare(scene, options).expect("the scene is whole").class()
}

fn class(scene: &Scene) -> SceneClass {
    class_as(scene, Instancing::Auto)
}

#[test]
fn surfaces_choose_among_the_lesser_classes() {
    assert_eq!(class(&scene("cornell-box-red/cornell-box-red.gltf")), Matte);
    assert_eq!(class(&scene("white-room-substrate/white-room-substrate.gltf")), Lobes);
    assert_eq!(class(&scene("features/metallic-roughness-texture.gltf")), Textured);
    assert_eq!(class(&scene("features/vertex-colors.gltf")), Textured);
    assert_eq!(class(&scene("features/unlit.gltf")), Textured);
}

#[test]
fn holes_need_the_full_class_in_the_world_and_in_instances() {
    for file in ["features/alpha-mask.gltf", "features/alpha-blend.gltf"] {
        let mut scene = scene(file);
        assert_eq!(class(&scene), Full, "{file}");
        assert_eq!(class_as(&scene, Instancing::Always), Full, "{file}");
        for material in &mut scene.materials {
            material.alpha = Alpha::Opaque;
        }
        assert_ne!(class_as(&scene, Instancing::Never), Full, "{file} without holes");
    }
}

#[test]
fn meshes_stored_once_need_the_full_class() {
    let scene = scene("features/instances.gltf");
    assert_eq!(class_as(&scene, Instancing::Always), Full);
    assert_ne!(class_as(&scene, Instancing::Never), Full);
}

#[test]
fn lights_without_area_and_pictures_around_need_the_full_class() {
    let mut lit = scene("features/lights-punctual.gltf");
    assert_eq!(class(&lit), Full);
    let mut dark = lit.clone();
    for light in &mut dark.lights {
        light.intensity = [0.0; 3];
    }
    assert_ne!(class(&dark), Full, "lights that do not shine");
    lit.lights.clear();
    assert_ne!(class(&lit), Full);
    // What lights a scene without lights is not a map.
    let mut unlit = scene("cornell-box-red/cornell-box-red.gltf");
    for material in &mut unlit.materials {
        material.emission.factor = [0.0; 3];
    }
    assert_eq!(class(&unlit), Matte);

    let mut surrounded = scene("cornell-box-red/cornell-box-red.gltf");
    let (mut sky, _) =
        load_environment(&path("features/sky.hdr"), &LoadOptions::default()).expect("the sky loads");
    surrounded.environment = Some(Environment::Map(sky.clone()));
    assert_eq!(class(&surrounded), Full);
    sky.scale = [0.0; 3];
    surrounded.environment = Some(Environment::Map(sky));
    assert_eq!(class(&surrounded), Matte, "a black sky");
    surrounded.environment = Some(Environment::Constant([1.0; 3]));
    assert_eq!(class(&surrounded), Matte);
}
