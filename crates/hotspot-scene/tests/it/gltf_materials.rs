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
        // The colour is bounded before it is weighted.
        [0.02, 0.01, 0.5],
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
    assert_eq!(unmodelled(glass(0.5, 0.3)), ["rough glass"]);
    // exp(-absorption distance) is the attenuation colour; black lets nothing through.
    let mut absorbing = solid;
    let volume = &mut absorbing["extensions"]["KHR_materials_volume"];
    *volume = json!({"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.25, 0]});
    let Bsdf::Glass { absorption, thin: false, .. } = material(absorbing.clone()).bsdf else { panic!() };
    assert_eq!(absorption[0], 0.0);
    assert!(absorption[0].is_sign_positive());
    assert!(((-2.0 * absorption[1]).exp() - 0.25).abs() < 1e-6, "{absorption:?}");
    assert!(absorption[2] > 30.0 && absorption[2].is_finite());
    // A pane has no inside.
    absorbing["extensions"]["KHR_materials_volume"]["thicknessFactor"] = 0.into();
    assert!(matches!(material(absorbing.clone()).bsdf, Bsdf::Glass { absorption: [0.0, 0.0, 0.0], .. }));
    absorbing["extensions"]["KHR_materials_volume"] =
        json!({"thicknessFactor": 1, "attenuationDistance": 1e-45, "attenuationColor": [0, 0, 0]});
    let Bsdf::Glass { absorption, .. } = material(absorbing.clone()).bsdf else { panic!() };
    assert!(absorption.iter().all(|a| a.is_finite()));
    absorbing["extensions"]["KHR_materials_volume"]["attenuationDistance"] = 0.into();
    let scene = scene_with(absorbing);
    assert_eq!(repaired(&scene, "attenuation distance"), 1);
    assert!(matches!(scene.materials[0].bsdf, Bsdf::Glass { absorption: [0.0, 0.0, 0.0], .. }));
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

#[test]
fn transmission_mixes_glass_into_what_is_not_metal() {
    let with = |metallic: f64, transmission: Value| {
        extended(pbr(metallic, 0.0), "KHR_materials_transmission", transmission)
    };
    let Bsdf::Mix { weight, base, other } = material(with(0.0, json!({"transmissionFactor": 0.5}))).bsdf
    else {
        panic!()
    };
    assert_eq!(weight, Scalar::constant(0.5));
    assert!(matches!(*base, Bsdf::Substrate { .. }));
    assert!(matches!(*other, Bsdf::Glass { thin: true, .. }));
    let textured = json!({"transmissionFactor": 1, "transmissionTexture": {"index": 0}});
    let Bsdf::Mix { weight, .. } = material(with(0.0, textured.clone())).bsdf else { panic!() };
    assert_eq!((weight.factor, weight.texture.unwrap().1), (1.0, Channel::R));
    // Half metal: the dielectric half alone transmits.
    let Bsdf::Mix { weight, base, other } = material(with(0.5, textured.clone())).bsdf else { panic!() };
    assert_eq!(weight, Scalar::constant(0.5));
    assert!(matches!(*base, Bsdf::Mix { .. }) && matches!(*other, Bsdf::Mirror { .. }));
    assert!(matches!(material(with(1.0, textured)).bsdf, Bsdf::Mirror { .. }));
}

#[test]
fn unlit_shows_its_base_colour_and_nothing_else() {
    let mut value = extended(pbr(1.0, 0.5), "KHR_materials_unlit", json!({}));
    value["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    value["emissiveFactor"] = json!([1, 1, 1]);
    value["normalTexture"] = json!({"index": 0});
    value["alphaMode"] = "BLEND".into();
    let got = material(value);
    let Bsdf::Unlit { color } = got.bsdf else { panic!("{got:?}") };
    assert!(color.factor == RED && color.texture.is_some());
    assert!(!got.is_emissive() && got.normal_map.is_none());
    let Alpha::Blend { alpha } = got.alpha else { panic!() };
    assert_eq!(alpha.texture.unwrap().1, Channel::A);
}

#[test]
fn normal_maps_have_scale_transform_and_coordinates_of_their_own() {
    let mut value = pbr(0.0, 1.0);
    value["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    value["normalTexture"] = json!({"index": 0, "scale": -0.5, "texCoord": 0, "extensions":
        {"KHR_texture_transform": {"offset": [0.25, 0], "scale": [2, 3], "texCoord": 1}}});
    let scene = scene_with(value.clone());
    let map = scene.materials[0].normal_map.unwrap();
    assert_eq!((map.scale, map.texture.second_uvs), (-0.5, true));
    assert_eq!(map.texture.transform, [[2.0, 0.0, 0.25], [0.0, 3.0, 0.0]]);
    assert_eq!(scene.materials[0].emission, Color::constant([0.0; 3]));
    value["normalTexture"]["scale"] = 0.into();
    assert!(material(value.clone()).normal_map.is_none());
    value["normalTexture"] = json!({"index": 0});
    assert_eq!(material(value).normal_map.unwrap().scale, 1.0);
}

#[test]
fn occlusion_takes_neither_image_nor_coordinates() {
    let (mut json, bin) = textured_square();
    push(&mut json["images"], json!({"uri": "nowhere.png"}));
    push(&mut json["textures"], json!({"source": 1}));
    let mut value = pbr(0.0, 1.0);
    value["occlusionTexture"] = json!({"index": 1, "texCoord": 3});
    value["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    json["materials"][0] = value;
    let scene = load_pair(&json, &bin).unwrap();
    assert!(scene.repairs.is_empty() && scene.unmodelled.is_empty());
    assert!(scene.meshes[0].second_uvs.is_none());
}

#[test]
fn specular_textures_scale_the_highlights() {
    let specular = json!({"specularFactor": 0.5, "specularColorFactor": [1, 2, 3],
        "specularTexture": {"index": 0}, "specularColorTexture":
            {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [4, 1]}}}});
    let value = extended(pbr(0.0, 0.5), "KHR_materials_specular", specular);
    let Bsdf::Substrate { specular, specular_weight, .. } = material(value).bsdf else { panic!() };
    assert_eq!((specular_weight.factor, specular_weight.texture.unwrap().1), (0.5, Channel::A));
    assert_eq!(specular.factor, [0.04, 0.08, 0.12]);
    assert_eq!(specular.texture.unwrap().transform[0], [4.0, 0.0, 0.0]);
    assert_eq!(specular_weight.texture.unwrap().0.transform[0], [1.0, 0.0, 0.0]);
}

#[test]
fn specular_glossiness_is_a_substrate_and_wins() {
    const NAME: &str = "KHR_materials_pbrSpecularGlossiness";
    let with = |value: Value| extended(pbr(1.0, 0.5), NAME, value);
    let plain = json!({"diffuseFactor": [0.5, 0.25, 0, 0.5], "specularFactor": [0.25, 0.5, 1],
        "glossinessFactor": 0.75});
    let mut value = with(plain);
    value["alphaMode"] = "BLEND".into();
    let got = material(value);
    let Bsdf::Substrate { diffuse, specular, specular_weight, roughness } = got.bsdf else { panic!() };
    assert_eq!(diffuse, Color::constant([0.5, 0.25, 0.0]));
    assert_eq!(specular, Color::constant([0.25, 0.5, 1.0]));
    assert_eq!((specular_weight, roughness), (Scalar::constant(1.0), Scalar::constant(0.25)));
    assert_eq!(got.alpha, Alpha::Blend { alpha: Scalar::constant(0.5) });
    assert!(matches!(material(with(json!({"specularFactor": [0, 0, 0]}))).bsdf, Bsdf::Matte { .. }));

    // Roughness is 1 - glossiness alpha, texel by texel: the first has alpha 64, the others 255.
    let textured = with(json!({"glossinessFactor": 0.5,
        "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 0}}));
    let scene = scene_with(textured);
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
    let Bsdf::Substrate { diffuse, specular, roughness, .. } = &scene.materials[0].bsdf else { panic!() };
    assert_eq!(diffuse.texture, specular.texture);
    let (texture, channel) = roughness.texture.unwrap();
    assert_eq!((roughness.factor, channel), (1.0, Channel::R));
    assert_ne!(texture.texture, specular.texture.unwrap().texture);
    let rough: Vec<u8> =
        scene.textures[texture.texture as usize].rgba.chunks_exact(4).map(|texel| texel[0]).collect();
    assert_eq!(rough, [223, 128, 128, 128]);
}

#[test]
fn extensions_that_are_not_modelled_are_named_where_they_act() {
    let cases = [
        ("KHR_materials_clearcoat", "clearcoatFactor", json!(0.5), json!(0)),
        ("KHR_materials_sheen", "sheenColorFactor", json!([0, 0.1, 0]), json!([0, 0, 0])),
        ("KHR_materials_iridescence", "iridescenceFactor", json!(1), json!(0)),
        ("KHR_materials_anisotropy", "anisotropyStrength", json!(0.5), json!(0.0)),
        ("KHR_materials_diffuse_transmission", "diffuseTransmissionFactor", json!(0.1), json!(0)),
    ];
    for (name, key, acting, idle) in cases {
        assert_eq!(unmodelled(extended(pbr(0.0, 0.5), name, json!({ key: acting }))), [name]);
        assert!(unmodelled(extended(pbr(0.0, 0.5), name, json!({ key: idle }))).is_empty(), "{name}");
        assert!(unmodelled(extended(pbr(0.0, 0.5), name, json!({}))).is_empty(), "{name}");
    }
    assert_eq!(unmodelled(extended(pbr(0.0, 0.5), "ACME_velvet", json!({}))), ["ACME_velvet"]);
    // Only solid glass disperses.
    let dispersing = extended(pbr(0.0, 0.0), "KHR_materials_dispersion", json!({"dispersion": 0.1}));
    let glass = extended(dispersing, "KHR_materials_transmission", json!({"transmissionFactor": 1}));
    assert!(unmodelled(glass.clone()).is_empty());
    let solid = extended(glass, "KHR_materials_volume", json!({"thicknessFactor": 1}));
    assert_eq!(unmodelled(solid), ["KHR_materials_dispersion"]);
}

#[test]
fn alpha_that_is_1_all_over_is_opaque() {
    // All texels of alpha 1: nothing to look up.
    let (mut json, mut bin) = textured_square();
    let picture = png(&[[1, 2, 3, 255]; 4]);
    json["bufferViews"][4] = json!({"buffer": 0, "byteOffset": bin.len(), "byteLength": picture.len()});
    bin.extend(&picture);
    json["buffers"][0]["byteLength"] = bin.len().into();
    for mode in ["BLEND", "MASK"] {
        json["materials"][0]["alphaMode"] = mode.into();
        assert_eq!(load_pair(&json, &bin).unwrap().materials[0].alpha, Alpha::Opaque, "{mode}");
    }
}

#[test]
fn values_of_the_wrong_type_are_refused_by_name() {
    let cases = [
        ("KHR_materials_pbrSpecularGlossiness", json!({"specularFactor": [1, 1]}), "specularFactor"),
        ("KHR_materials_pbrSpecularGlossiness", json!({"glossinessFactor": [1]}), "glossinessFactor"),
        ("KHR_materials_pbrSpecularGlossiness", json!({"diffuseTexture": {"index": 9}}), "index 9"),
        ("KHR_materials_pbrSpecularGlossiness", json!({"diffuseTexture": {"index": -1}}), "index"),
        ("KHR_materials_pbrSpecularGlossiness", json!({"diffuseTexture": 3}), "diffuseTexture.index"),
    ];
    for (name, value, part) in cases {
        let (mut json, bin) = textured_square();
        json["materials"][0] = extended(pbr(0.0, 0.5), name, value);
        let parts = ["materials[0].extensions.KHR_materials_pbrSpecularGlossiness", part];
        assert_refused(load_pair(&json, &bin), part, "test.glb", &parts);
    }
}
