//! What MTL statements mean together.

use hotspot_scene::{Alpha, Bsdf, Channel, Color, Material, Scalar, Scene, Wrap};

use crate::support::*;

/// A textured triangle with a material of the given statements.
fn scene(statements: &str) -> Scene {
    let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    let mtl = format!("newmtl m\n{statements}\n");
    let picture = png(&[[1; 4], [2; 4], [3; 4], [255; 4]]);
    let grey = png(&[[1, 1, 1, 255], [2, 2, 2, 255], [3, 3, 3, 255], [4, 4, 4, 255]]);
    let files: [(&str, &[u8]); 4] =
        [("a.obj", text.as_bytes()), ("m.mtl", mtl.as_bytes()), ("t.png", &picture), ("grey.png", &grey)];
    let scene = load_files(&files).unwrap();
    check(&scene);
    scene
}

fn material(statements: &str) -> Material {
    scene(statements).materials[0].clone()
}

fn bsdf(statements: &str) -> Bsdf {
    material(statements).bsdf
}

#[test]
fn glass_is_what_programs_mean_by_it() {
    // (statements, index and filter where it is glass)
    type Glass = (f32, [f32; 3]);
    let cases: [(&str, Option<Glass>); 17] = [
        // Refraction is asked for.
        ("illum 6\nNi 1.33\nd 0.5", Some((1.33, [1.0; 3]))),
        ("illum 7\nTf 0.5 0.6 0.7", Some((1.5, [0.5, 0.6, 0.7]))),
        ("illum 7\nNi 1.7\nd 1", Some((1.7, [1.0; 3]))),
        ("illum 7\nNi 0", Some((1.5, [1.0; 3]))),
        ("illum 7\nNi 1\nTf 0.5", Some((1.0, [0.5; 3]))),
        ("illum 7\nNi 1\nd 1", None),
        ("illum 7\nNi 1.5\nTf 0 0 0", None),
        // Maya writes this for everything.
        ("illum 4\nTf 1 1 1\nNi 1", None),
        ("illum 4\nTf 0.9 1 0.9\nNi 1.5", Some((1.5, [0.9, 1.0, 0.9]))),
        // Blender's alpha.
        ("illum 9\nNi 1.45\nd 0.5", None),
        ("illum 9\nTf 0.5 0.5 0.5", Some((1.5, [0.5; 3]))),
        // 3ds Max writes this for everything.
        ("illum 2\nTf 1 1 1\nNi 1.5\nd 1", None),
        ("illum 2\nTf 0.5 0.5 0.5", None),
        ("Ni 1.5\nd 0.5", None),
        // Blender's transmission.
        ("Kd 0.5 0.5 1\nPr 0\nPm 0\nTf 1 1 1\nillum 2", Some((1.5, [0.5, 0.5, 1.0]))),
        ("Pr 0\nTf 0 0 0", None),
        ("Pr 0\nNi 1.5", None),
    ];
    for (statements, wanted) in cases {
        let got = match bsdf(statements) {
            Bsdf::Glass { ior, thin: false, transmittance, absorption: [0.0, 0.0, 0.0] } => {
                Some((ior, transmittance.factor))
            }
            _ => None,
        };
        assert_eq!(got, wanted, "{statements:?}");
    }
    // Glass is not faked beside.
    assert_eq!(material("illum 7\nd 0.5").alpha, Alpha::Opaque);
    assert!(matches!(material("illum 9\nd 0.5").alpha, Alpha::Blend { alpha } if alpha.factor == 0.5));
    assert_eq!(scene("illum 2\nTf 0.5 0.5 0.5").unmodelled[0].feature, "Tf");
    assert_eq!(scene("illum 2\nTf 1 1 1").unmodelled, []);
    assert_eq!(scene("illum 4\nTf 1 1 1").unmodelled, []);
    assert_eq!(scene("Pr 0.5\nTf 1 1 1").unmodelled[0].feature, "rough glass");
}

#[test]
fn physical_keywords_follow_gltf() {
    let kd = Color::constant([0.5, 0.25, 0.125]);
    let of = |statements: &str| bsdf(&format!("Kd 0.5 0.25 0.125\nKs 1 1 1\nillum 3\n{statements}"));
    let Bsdf::RoughMetal { f0, roughness } = of("Pm 1\nPr 0.5") else { panic!() };
    assert_eq!((f0, roughness), (kd, Scalar::constant(0.5)));
    assert!(matches!(of("Pm 1\nPr 0"), Bsdf::Mirror { reflectance } if reflectance == kd));
    let Bsdf::Substrate { diffuse, specular, roughness, specular_weight } = of("Pr 0.25\nNi 2") else {
        panic!()
    };
    assert_eq!((diffuse, roughness, specular_weight.factor), (kd, Scalar::constant(0.25), 1.0));
    // ((2 - 1) / (2 + 1))²
    assert!(specular.factor.iter().all(|c| (c - 1.0 / 9.0).abs() < 1e-7), "{specular:?}");
    let Bsdf::Substrate { specular, roughness, .. } = of("Pm 0") else { panic!() };
    assert!((specular.factor[0] - 0.04).abs() < 1e-7);
    assert_eq!(roughness.factor, 1.0);
    // Roughness of Ns where Pr is absent: (2 / 32)^(1/4).
    let Bsdf::Substrate { roughness, .. } = of("Pm 0\nNs 30") else { panic!() };
    assert!((roughness.factor - 0.5).abs() < 1e-7);
    assert!(matches!(of("Pr 0.5\nNi 1"), Bsdf::Matte { .. }));
    let Bsdf::Mix { weight, base, other } = of("Pm 0.25\nPr 0.5") else { panic!() };
    assert_eq!(weight, Scalar::constant(0.25));
    assert!(matches!((*base, *other), (Bsdf::Substrate { .. }, Bsdf::RoughMetal { .. })));
    // Maps: red, or what -imfchan says.
    let Bsdf::Mix { weight, base, .. } = of("map_Pm t.png\nmap_Pr -imfchan g t.png\nPr 0.5") else {
        panic!()
    };
    assert_eq!((weight.factor, weight.texture.unwrap().1), (1.0, Channel::R));
    let Bsdf::Substrate { roughness, .. } = *base else { panic!() };
    assert_eq!((roughness.factor, roughness.texture.unwrap().1), (0.5, Channel::G));
    assert!(scene("Pm 0\nmap_Pr grey.png").meshes[0].uvs.is_some());
    assert!(scene("Pm 1\nmap_Kd grey.png").meshes[0].uvs.is_some());
}

#[test]
fn zeros_that_programs_write_for_everything_are_not_named() {
    let blender = "Ns 250\nKa 1 1 1\nKs 0.5 0.5 0.5\nKe 0 0 0\nNi 1.45\nd 1\nillum 2\nPr 0.5\nPm 0\nPs 0\nPc 0\nPcr 0.03\n\
        aniso 0\nanisor 0";
    assert_eq!(scene(blender).unmodelled, []);
    let named: Vec<_> =
        scene("Pc 0.5\nPcr 0.1\nPs 1\naniso 0.5\nanisor 0.5\nnorm t.png\nmap_Bump -bm 0.5 t.png\nrefl -type sphere t.png")
            .unmodelled
            .into_iter()
            .map(|u| u.feature)
            .collect();
    assert_eq!(named, ["Pc", "Ps", "aniso", "norm", "map_Bump", "refl"]);
}

#[test]
fn highlights_follow_the_illumination_model_and_its_texture() {
    assert!(matches!(bsdf("Ks 1 1 1\nillum 1"), Bsdf::Matte { .. }));
    assert!(matches!(bsdf("Ks 1 1 1\nillum 0"), Bsdf::Matte { .. }));
    assert!(matches!(bsdf("Ks 1 1 1"), Bsdf::Substrate { .. }));
    let Bsdf::Substrate { specular, .. } = bsdf("Ks 0.5 0.5 0.5\nmap_Ks t.png") else { panic!() };
    assert_eq!(specular.factor, [0.5; 3]);
    assert!(specular.texture.is_some());
    assert!(scene("Ks 0.5 0.5 0.5\nmap_Ks t.png").meshes[0].uvs.is_some());
    // Off is off, and looks up nothing.
    let off = scene("Ks 0 0 0\nmap_Ks t.png");
    assert!(matches!(off.materials[0].bsdf, Bsdf::Matte { .. }) && off.meshes[0].uvs.is_none());
}

#[test]
fn black_under_a_texture_and_tr_one_alone_are_mended() {
    let maya = scene("Kd 0 0 0\nmap_Kd t.png\nKe 0 0 0\nmap_Ke t.png");
    let Bsdf::Matte { reflectance } = maya.materials[0].bsdf else { panic!() };
    assert_eq!((reflectance.factor, maya.materials[0].emission.factor), ([1.0; 3], [1.0; 3]));
    assert_eq!((repaired(&maya, "black Kd"), repaired(&maya, "black Ke")), (1, 1));
    let missing = scene("Kd 0 0 0\nmap_Kd none.png");
    let Bsdf::Matte { reflectance } = missing.materials[0].bsdf else { panic!() };
    assert_eq!((reflectance.factor, repaired(&missing, "black Kd")), ([0.0; 3], 0));

    let alpha = |statements: &str| match material(statements).alpha {
        Alpha::Blend { alpha } => alpha.factor,
        _ => 1.0,
    };
    assert_eq!(alpha("Tr 1"), 1.0);
    assert_eq!(repaired(&scene("Tr 1"), "Tr 1 alone"), 1);
    assert_eq!(
        (alpha("Tr 0.25"), alpha("d 0.25\nTr 1"), alpha("Tr 1\nd 0"), alpha("Tr 0")),
        (0.75, 0.25, 0.0, 1.0)
    );
    assert_eq!(alpha("d -halo 0.5"), 0.5);
}

#[test]
fn keywords_in_any_case_and_options_of_textures() {
    let Bsdf::Matte { reflectance } = bsdf("KD 0.5 0.5 0.5") else { panic!() };
    assert_eq!(reflectance.factor, [0.5; 3]);
    let Bsdf::Matte { reflectance } =
        bsdf("map_kd -blendu on -blendv off -cc off -boost 2 -mm 0 1 -texres 64 -clamp on -o 0.5 -s 2 t.png")
    else {
        panic!()
    };
    let texture = reflectance.texture.unwrap();
    assert_eq!((texture.wrap, texture.transform), ([Wrap::Clamp; 2], [[2.0, 0.0, 0.5], [0.0, 1.0, 0.0]]));
    let named: Vec<_> =
        scene("map_Kd -mm 0.1 2 -t 1 1 1 t.png").unmodelled.into_iter().map(|u| u.feature).collect();
    assert_eq!(named, ["map_Kd -mm", "map_Kd -t (turbulence)"]);
    // Opacity: alpha where the picture has some, else red, else what the file says.
    let channel = |statements: &str| match material(statements).alpha {
        Alpha::Blend { alpha } => alpha.texture.unwrap().1,
        _ => panic!(),
    };
    let channels = (channel("map_d t.png"), channel("map_d grey.png"), channel("map_d -imfchan b t.png"));
    assert_eq!(channels, (Channel::A, Channel::R, Channel::B));
    assert_eq!(channel("map_d -imfchan m grey.png"), Channel::A);
}
