//! Which scattering model a glTF material becomes, and with which numbers.

use hotspot_scene::{Alpha, Bsdf, Channel, Color, Material, Scalar, Scene};
use serde_json::{Value, json};

use crate::support::*;

/// Loads the textured square with another material, whose base colour texture is kept when it names it.
fn scene_with(material: Value) -> Scene {
    let (mut json, bin) = textured_square();
    json["materials"][0] = material;
    load_pair(&json, &bin).unwrap()
}

fn material(value: Value) -> Material {
    let scene = scene_with(value);
    assert!(scene.repairs.is_empty() && scene.unmodelled.is_empty(), "{scene:?}");
    scene.materials[0].clone()
}

fn unmodelled(value: Value) -> Vec<String> {
    scene_with(value).unmodelled.into_iter().map(|u| u.feature).collect()
}

const RED: [f32; 3] = [1.0, 0.5, 0.25];

fn pbr(metallic: f64, roughness: f64) -> Value {
    json!({"pbrMetallicRoughness":
        {"baseColorFactor": [1, 0.5, 0.25, 1], "metallicFactor": metallic, "roughnessFactor": roughness}})
}

/// A material with one extension.
fn extended(mut material: Value, name: &str, extension: Value) -> Value {
    material["extensions"][name] = extension;
    material
}

#[test]
fn metals_are_mirrors_or_rough() {
    let Bsdf::Mirror { reflectance } = material(pbr(1.0, 0.0)).bsdf else { panic!() };
    assert_eq!(reflectance, Color::constant(RED));
    let Bsdf::RoughMetal { f0, roughness } = material(pbr(1.0, 0.25)).bsdf else { panic!() };
    assert_eq!((f0, roughness), (Color::constant(RED), Scalar::constant(0.25)));
    // Both factors default to 1.
    let Bsdf::RoughMetal { f0, roughness } = material(json!({})).bsdf else { panic!() };
    assert_eq!((f0, roughness), (Color::constant([1.0; 3]), Scalar::constant(1.0)));
}

#[test]
fn dielectrics_are_matte_or_substrate() {
    let specular = |value: Value| extended(pbr(0.0, 0.5), "KHR_materials_specular", value);
    let Bsdf::Matte { reflectance } = material(specular(json!({"specularFactor": 0}))).bsdf else { panic!() };
    assert_eq!(reflectance, Color::constant(RED));
    let rs = |value: Value| {
        let Bsdf::Substrate { diffuse, specular, roughness, .. } = material(value).bsdf else { panic!() };
        assert_eq!((diffuse, roughness), (Color::constant(RED), Scalar::constant(0.5)));
        specular.factor
    };
    let near = |got: [f32; 3], wanted: [f32; 3]| {
        assert!(got.iter().zip(wanted).all(|(g, w)| (g - w).abs() < 1e-7), "{got:?} {wanted:?}");
    };
    near(rs(pbr(0.0, 0.5)), [0.04; 3]);
    near(rs(specular(json!({"specularFactor": 0.5}))), [0.02; 3]);
    near(
        rs(specular(json!({"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 100]}))),
        [0.02, 0.01, 1.0],
    );
    near(rs(extended(pbr(0.0, 0.5), "KHR_materials_ior", json!({"ior": 2}))), [1.0 / 9.0; 3]);
    near(rs(extended(pbr(0.0, 0.5), "KHR_materials_ior", json!({"ior": 0}))), [1.0; 3]);
}

#[test]
fn metallic_between_0_and_1_or_textured_is_a_mix() {
    let Bsdf::Mix { weight, base, other } = material(pbr(0.25, 0.5)).bsdf else { panic!() };
    assert_eq!(weight, Scalar::constant(0.25));
    assert!(matches!(*base, Bsdf::Substrate { .. }) && matches!(*other, Bsdf::RoughMetal { .. }));

    let textured = |metallic: f64, roughness: f64| {
        let mut value = pbr(metallic, roughness);
        value["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({"index": 0});
        material(value).bsdf
    };
    let Bsdf::Mix { weight, base, .. } = textured(1.0, 0.5) else { panic!() };
    assert_eq!((weight.factor, weight.texture.unwrap().1), (1.0, Channel::B));
    let Bsdf::Substrate { roughness, .. } = *base else { panic!() };
    assert_eq!((roughness.factor, roughness.texture.unwrap().1), (0.5, Channel::G));
    let Bsdf::Mix { other, .. } = textured(1.0, 0.0) else { panic!() };
    assert!(matches!(*other, Bsdf::Mirror { .. }));
    let Bsdf::Substrate { roughness, .. } = textured(0.0, 0.5) else { panic!() };
    assert!(roughness.texture.is_some());
}

#[test]
fn transmission_is_glass_thin_or_solid() {
    let glass = |transmission: f64, roughness: f64| {
        extended(
            pbr(0.0, roughness),
            "KHR_materials_transmission",
            json!({"transmissionFactor": transmission}),
        )
    };
    let Bsdf::Glass { ior: 1.5, thin: true, transmittance, .. } = material(glass(1.0, 0.0)).bsdf else {
        panic!()
    };
    assert_eq!(transmittance, Color::constant(RED));
    let solid = extended(glass(1.0, 0.0), "KHR_materials_volume", json!({"thicknessFactor": 0.1}));
    let solid = extended(solid, "KHR_materials_ior", json!({"ior": 1.33}));
    assert!(matches!(material(solid.clone()).bsdf, Bsdf::Glass { ior: 1.33, thin: false, .. }));
    let flat = extended(glass(1.0, 0.0), "KHR_materials_volume", json!({"thicknessFactor": 0}));
    assert!(matches!(material(flat).bsdf, Bsdf::Glass { thin: true, .. }));
    assert!(matches!(material(glass(0.0, 0.5)).bsdf, Bsdf::Substrate { .. }));
    assert_eq!(unmodelled(glass(0.5, 0.3)), ["transmissionFactor below 1", "rough glass"]);
    let mut absorbing = solid;
    absorbing["extensions"]["KHR_materials_volume"] =
        json!({"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0, 0]});
    assert_eq!(unmodelled(absorbing), ["attenuation in glass"]);
}

#[test]
fn emission_is_factor_times_strength_times_texture() {
    let mut value = pbr(0.0, 1.0);
    value["emissiveFactor"] = json!([1, 0.5, 0]);
    value["emissiveTexture"] = json!({"index": 0});
    assert_eq!(material(value.clone()).emission.factor, [1.0, 0.5, 0.0]);
    let strong =
        material(extended(value, "KHR_materials_emissive_strength", json!({"emissiveStrength": 2000})));
    assert_eq!(strong.emission.factor, [2000.0, 1000.0, 0.0]);
    assert!(strong.emission.texture.is_some() && strong.is_emissive() && !strong.double_sided);
    let mut dark = pbr(0.0, 1.0);
    dark["emissiveTexture"] = json!({"index": 0});
    dark["doubleSided"] = true.into();
    let dark = material(dark);
    assert!(!dark.is_emissive() && dark.emission.texture.is_none() && dark.double_sided);
}

#[test]
fn alpha_modes_use_the_base_colours_alpha() {
    let with = |mode: &str, alpha: f64, textured: bool| {
        let mut value = pbr(0.0, 1.0);
        value["alphaMode"] = mode.into();
        value["pbrMetallicRoughness"]["baseColorFactor"][3] = alpha.into();
        if textured {
            value["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
        }
        material(value).alpha
    };
    assert_eq!(with("OPAQUE", 0.2, true), Alpha::Opaque);
    assert_eq!(with("BLEND", 0.25, false), Alpha::Blend { alpha: Scalar::constant(0.25) });
    assert_eq!(with("BLEND", 1.0, false), Alpha::Opaque);
    assert_eq!(with("MASK", 0.25, false), Alpha::Mask { cutoff: 0.5, alpha: Scalar::constant(0.25) });
    assert_eq!(with("MASK", 0.5, false), Alpha::Opaque);
    let Alpha::Mask { alpha, .. } = with("MASK", 0.75, true) else { panic!() };
    assert_eq!((alpha.factor, alpha.texture.unwrap().1), (0.75, Channel::A));
}

#[test]
fn no_material_is_grey_matte_and_said_so() {
    let scene = load_changed(|json, _| {
        json["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("material");
    })
    .unwrap();
    let Bsdf::Matte { reflectance } = &scene.materials[0].bsdf else { panic!() };
    assert_eq!(reflectance.factor, [0.8; 3]);
    assert_eq!(repaired(&scene, "no material"), 1);
}

#[test]
fn factors_out_of_range_are_clamped_and_counted() {
    let mut value = pbr(-0.5, 2.0);
    value["pbrMetallicRoughness"]["baseColorFactor"][0] = 1.5.into();
    value["emissiveFactor"] = json!([-1, 0, 0]);
    let scene = scene_with(value);
    assert_eq!(repaired(&scene, "clamped"), 3);
    assert_eq!(repaired(&scene, "negative emission"), 1);
    let Bsdf::Substrate { roughness, .. } = scene.materials[0].bsdf else { panic!() };
    assert_eq!(roughness.factor, 1.0);
}
