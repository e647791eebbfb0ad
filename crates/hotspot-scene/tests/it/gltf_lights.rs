//! Lights and material variants of glTF files.

use hotspot_scene::{Bsdf, Light, LightKind, LoadError, LoadOptions, Scene, load_glb_bytes};
use serde_json::{Value, json};

use crate::support::*;

/// The square with a light on a node of its own.
fn lit(light: Value, mut node: Value) -> (Value, Vec<u8>) {
    let (mut json, bin) = square();
    node["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
    json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    push(&mut json["nodes"], node);
    json["scenes"][0]["nodes"] = json!([0, 1]);
    (json, bin)
}

fn load_light(light: Value, node: Value) -> Result<Scene, LoadError> {
    let (json, bin) = lit(light, node);
    load_pair(&json, &bin)
}

fn only_light(light: Value, node: Value) -> Light {
    let scene = load_light(light, node).unwrap();
    check(&scene);
    assert!(scene.repairs.is_empty() && scene.unmodelled.is_empty(), "{scene:?}");
    scene.lights[0].clone()
}

fn near(got: [f32; 3], wanted: [f32; 3]) {
    assert!(got.iter().zip(wanted).all(|(g, w)| (g - w).abs() < 1e-6), "{got:?} {wanted:?}");
}

#[test]
fn points_stand_where_their_node_stands_unscaled() {
    let light = only_light(
        json!({"type": "point", "name": "Bulb", "color": [1, 0.5, 0.25], "intensity": 8}),
        json!({"translation": [1, 2, 3], "scale": [10, 10, 10]}),
    );
    let kind = LightKind::Point { position: [1.0, 2.0, 3.0] };
    assert_eq!(light, Light { name: "Bulb".into(), kind, intensity: [8.0, 4.0, 2.0] });
    assert_eq!(only_light(json!({"type": "point"}), json!({"scale": [0, 0, 0]})).intensity, [1.0; 3]);
}

#[test]
fn directional_lights_travel_along_minus_z_of_their_node() {
    let direction = |node: Value| {
        let LightKind::Directional { direction } = only_light(json!({"type": "directional"}), node).kind
        else {
            panic!()
        };
        direction
    };
    assert_eq!(direction(json!({})), [0.0, 0.0, -1.0]);
    // A quarter turn about +X lifts -Z to +Y; about +Y turns it to -X.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    near(direction(json!({"rotation": [half, 0, 0, half]})), [0.0, 1.0, 0.0]);
    near(direction(json!({"rotation": [0, half, 0, half], "scale": [1, 1, 7]})), [-1.0, 0.0, 0.0]);
    near(direction(json!({"scale": [1e-200, 1e-200, 1e-200]})), [0.0, 0.0, -1.0]);
}

#[test]
fn spots_have_cosines_of_their_angles() {
    let spot = |spot: Value| {
        let scene = load_light(json!({"type": "spot", "spot": spot}), json!({"translation": [0, 1, 0]}));
        let scene = scene.unwrap();
        let light = scene.lights.first().map(|light| light.kind);
        match light {
            Some(LightKind::Spot { position, direction, cos_inner, cos_outer }) => {
                assert_eq!((position, direction), ([0.0, 1.0, 0.0], [0.0, 0.0, -1.0]));
                assert!(cos_outer < cos_inner && cos_inner <= 1.0 && cos_outer >= 0.0);
                (Some([cos_inner, cos_outer]), scene.repairs.len())
            }
            Some(other) => panic!("{other:?}"),
            None => (None, scene.repairs.len()),
        }
    };
    let quarter = std::f32::consts::FRAC_1_SQRT_2;
    assert_eq!(spot(json!({})), (Some([1.0, quarter]), 0));
    let (Some([inner, outer]), 0) = spot(json!({"innerConeAngle": 0.5, "outerConeAngle": 1})) else {
        panic!()
    };
    assert!((inner - 0.5f32.cos()).abs() < 1e-6 && (outer - 1f32.cos()).abs() < 1e-6);
    // f32's π/2 is a little more than π/2.
    for (outer, repairs) in [(f64::from(std::f32::consts::FRAC_PI_2), 0), (3.0, 1)] {
        let (Some([1.0, cos_outer]), count) = spot(json!({ "outerConeAngle": outer })) else { panic!() };
        assert!(count == repairs && cos_outer < 1e-6);
    }
    assert_eq!(spot(json!({"innerConeAngle": -1})), (Some([1.0, quarter]), 1));
    assert_eq!(spot(json!({"innerConeAngle": 1, "outerConeAngle": 1})).1, 1);
    assert_eq!(spot(json!({"innerConeAngle": 3, "outerConeAngle": 1e-9})).1, 1);
    assert_eq!(spot(json!({"outerConeAngle": 0})), (None, 1));
    assert_eq!(spot(json!({"outerConeAngle": -1})), (None, 1));
}

#[test]
fn lights_that_do_not_shine_are_dropped_and_said_so() {
    let dropped = |light: Value, node: Value, what: &str| {
        let scene = load_light(light, node).unwrap();
        assert!(scene.lights.is_empty(), "{what}");
        assert!(repaired(&scene, what) == 1, "{what}: {:?}", scene.repairs);
    };
    dropped(json!({"type": "point", "intensity": 0}), json!({}), "without intensity");
    dropped(json!({"type": "point", "color": [0, 0, 0]}), json!({}), "without intensity");
    dropped(json!({"type": "point", "intensity": -3}), json!({}), "without intensity");
    dropped(json!({"type": "directional"}), json!({"scale": [0, 0, 0]}), "scaled to nothing");
    dropped(json!({"type": "spot"}), json!({"scale": [1, 1, 0]}), "scaled to nothing");
    let scene = load_light(json!({"type": "ambient", "name": "Sky"}), json!({})).unwrap();
    assert!(scene.lights.is_empty());
    assert_eq!(scene.unmodelled[0].feature, "light of type ambient");
    assert!(scene.unmodelled[0].element.contains("\"Sky\""));
}

#[test]
fn a_range_is_named_once_per_light_and_names_are_unique() {
    let (mut json, bin) = lit(json!({"type": "point", "range": 5}), json!({"name": "Square"}));
    let node = json["nodes"][1].clone();
    push(&mut json["nodes"], node);
    json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let scene = load_pair(&json, &bin).unwrap();
    check(&scene);
    let names: Vec<_> = scene.lights.iter().map(|light| light.name.as_str()).collect();
    // The mesh of the same node keeps its name.
    assert_eq!(scene.objects[0].name, "Square");
    assert_eq!(names, ["Square #2", "Square #3", "Square #4"]);
    assert_eq!(scene.unmodelled.len(), 1);
    assert_eq!(scene.unmodelled[0].feature, "range of a light");
    // A directional light has no place for a range to be measured from.
    let scene = load_light(json!({"type": "directional", "range": 5}), json!({})).unwrap();
    assert!(scene.unmodelled.is_empty());
}

#[test]
fn broken_lights_are_refused_by_name_and_counted_against_the_limit() {
    let refused = |light: Value, node: Value, part: &str| {
        assert_refused(load_light(light, node), part, "test.glb", &[part]);
    };
    const PATH: &str = "extensions.KHR_lights_punctual.lights[0]";
    refused(json!({}), json!({}), &format!("{PATH}.type"));
    refused(json!({"type": 7}), json!({}), &format!("{PATH}.type"));
    refused(json!({"type": "point", "color": [1, 1]}), json!({}), &format!("{PATH}.color"));
    refused(json!({"type": "point", "intensity": "x"}), json!({}), &format!("{PATH}.intensity"));
    refused(json!({"type": "point", "intensity": 1e300}), json!({}), &format!("{PATH}.intensity"));
    refused(json!({"type": "spot", "spot": {"outerConeAngle": []}}), json!({}), "spot.outerConeAngle");
    refused(json!({"type": "point"}), json!({"translation": [1e300, 0, 0]}), "nodes[1]");
    for light in [json!(1), json!(-1), json!("x"), json!(1.5)] {
        let (mut json, bin) = lit(json!({"type": "point"}), json!({}));
        json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = light;
        let part = "nodes[1].extensions.KHR_lights_punctual.light";
        assert_refused(load_pair(&json, &bin), part, "test.glb", &[part]);
    }
    let (json, bin) = lit(json!({"type": "point"}), json!({}));
    for (most, fits) in [(1, false), (2, true)] {
        let options = LoadOptions { max_instances: most, ..Default::default() };
        assert_eq!(load_glb_bytes("test.glb", &glb(&json, &bin), &options).is_ok(), fits);
    }
}

/// The square with two materials more, and variants that put them on it.
fn varied() -> (Value, Vec<u8>) {
    let (mut json, bin) = square();
    json["materials"] = json!([
        {"name": "Plain", "pbrMetallicRoughness": {"metallicFactor": 0}},
        {"name": "Red", "pbrMetallicRoughness": {"metallicFactor": 1}},
        {"name": "Blue", "extensions": {"KHR_materials_unlit": {}}}]);
    json["extensionsRequired"] = json!(["KHR_materials_variants", "KHR_materials_unlit"]);
    json["extensions"] = json!({"KHR_materials_variants":
        {"variants": [{"name": "day"}, {"name": "night"}, {"name": "unused"}]}});
    json["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_materials_variants":
        {"mappings": [{"material": 1, "variants": [7, 0]}, {"material": 2, "variants": [1]}]}});
    (json, bin)
}

fn load_variant(json: &Value, bin: &[u8], variant: Option<&str>) -> Result<Scene, LoadError> {
    let options = LoadOptions { variant: variant.map(Into::into), ..Default::default() };
    load_glb_bytes("test.glb", &glb(json, bin), &options)
}

#[test]
fn variants_choose_materials() {
    let (json, bin) = varied();
    for (variant, wanted) in
        [(None, "Plain"), (Some("day"), "Red"), (Some("night"), "Blue"), (Some("unused"), "Plain")]
    {
        let scene = load_variant(&json, &bin, variant).unwrap();
        assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
        // Only the material in use is read.
        let names: Vec<_> = scene.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names, [wanted]);
        assert_eq!(matches!(scene.materials[0].bsdf, Bsdf::Unlit { .. }), wanted == "Blue");
    }
    let result = load_variant(&json, &bin, Some("noon"));
    assert_refused(result, "unknown", "test.glb", &["\"noon\"", "\"day\", \"night\", \"unused\""]);
    let (plain, bin) = square();
    assert_refused(load_variant(&plain, &bin, Some("noon")), "none", "test.glb", &["the file has none"]);
}

#[test]
fn broken_variants_are_refused_where_they_are_chosen() {
    let (mut json, bin) = varied();
    for material in [json!(3), json!("x"), Value::Null] {
        json["meshes"][0]["primitives"][0]["extensions"]["KHR_materials_variants"]["mappings"][0]["material"] =
            material;
        let part = "mappings[0].material";
        assert_refused(load_variant(&json, &bin, Some("day")), part, "test.glb", &[part]);
        assert!(load_variant(&json, &bin, Some("night")).is_ok());
    }
}
