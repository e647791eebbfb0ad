//! The six shared scenes: counts from their README, material classes from their files.

use std::io::Write;
use std::path::{Path, PathBuf};

use hotspot_scene::{Alpha, Bsdf, Environment, LoadOptions, Projection, Scene, load};

/// The folder of shared scenes, or a visible note that the tests over it are skipped.
fn shared() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if folder.is_dir() {
        return Some(folder);
    }
    // Not by `eprintln!`, which the test runner keeps to itself while a test passes.
    let note = format!("SKIPPED: no shared scenes at {}\n", folder.display());
    std::io::stderr().write_all(note.as_bytes()).unwrap();
    None
}

fn load_shared(name: &str) -> Option<Scene> {
    let path = shared()?.join(name).join(format!("{name}.gltf"));
    Some(load(&path, &LoadOptions::default()).unwrap())
}

fn triangles(scene: &Scene) -> usize {
    scene.instances.iter().map(|i| scene.meshes[i.mesh as usize].triangles.len()).sum()
}

/// Names of the materials of each class, sorted.
fn class(scene: &Scene, is: impl Fn(&Bsdf) -> bool) -> Vec<&str> {
    let mut names: Vec<_> = scene.materials.iter().filter(|m| is(&m.bsdf)).map(|m| m.name.as_str()).collect();
    names.sort_unstable();
    names
}

#[test]
fn all_six_load_whole_and_without_remarks() {
    let wanted = [
        ("cornell-box-red", 32),
        ("cornell-box-blue", 32),
        ("killeroo", 68_556),
        ("living-room-substrate", 142_973),
        ("living-room-matte", 142_973),
        ("veach-mis", 11_052),
    ];
    for (name, count) in wanted {
        let Some(scene) = load_shared(name) else { return };
        assert_eq!(triangles(&scene), count, "{name}");
        assert_eq!(scene.name, name);
        assert_eq!(scene.unmodelled, [], "{name}");
        assert_eq!(scene.repairs, [], "{name}");
        assert_eq!(scene.cameras.len(), 1, "{name}");
        assert!(matches!(scene.cameras[0].projection, Projection::Perspective { .. }));
        assert!(scene.materials.iter().any(|m| m.is_emissive()) || scene.environment.is_some());
    }
}

#[test]
fn the_cornell_boxes_differ_in_one_reflectance() {
    let (Some(red), Some(blue)) = (load_shared("cornell-box-red"), load_shared("cornell-box-blue")) else {
        return;
    };
    let reflectance = |scene: &Scene| -> Vec<[f32; 3]> {
        let of = |bsdf: &Bsdf| match bsdf {
            Bsdf::Matte { reflectance } => reflectance.factor,
            other => panic!("{other:?}"),
        };
        scene.materials.iter().map(|m| of(&m.bsdf)).collect()
    };
    let (red, blue) = (reflectance(&red), reflectance(&blue));
    let differing: Vec<_> = red.iter().zip(&blue).filter(|(a, b)| a != b).collect();
    assert_eq!(differing, [(&[0.5, 0.1, 0.1], &[0.1, 0.1, 0.5])]);
}

#[test]
fn killeroos_share_one_mesh() {
    let Some(scene) = load_shared("killeroo") else { return };
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.objects.len()), (4, 5, 5));
    let of = |name: &str| {
        let object = scene.objects.iter().position(|o| o.name == name).unwrap() as u32;
        scene.instances.iter().find(|i| i.object == object).unwrap()
    };
    assert_eq!(of("killeroo-1").mesh, of("killeroo-2").mesh);
    assert_ne!(of("killeroo-1").material, of("killeroo-2").material);
    assert_eq!(class(&scene, |b| matches!(b, Bsdf::Substrate { .. })), ["killeroo-green", "killeroo-red"]);
    // No material has a texture, so the texture coordinates of floor and wall are not kept.
    assert!(scene.meshes.iter().all(|m| m.uvs.is_none() && m.normals.is_some()));
    // T * R * S of the file, and the matrix that says the same for the other one: both scale by 1/2.
    for name in ["killeroo-1", "killeroo-2"] {
        let m = of(name).to_world;
        let column = |c: usize| m.iter().map(|row| row[c] * row[c]).sum::<f64>().sqrt();
        assert!((0..3).all(|c| (column(c) - 0.5).abs() < 1e-12), "{name} {m:?}");
    }
    let light = &scene.materials[of("light").material as usize];
    assert_eq!(light.emission.factor, [2000.0; 3]);
    assert!(!light.double_sided);
}

#[test]
fn living_rooms_have_every_material_class() {
    let (Some(substrate), Some(matte)) =
        (load_shared("living-room-substrate"), load_shared("living-room-matte"))
    else {
        return;
    };
    assert_eq!(class(&substrate, |b| matches!(b, Bsdf::Mirror { .. })), ["FireplaceGlass", "Mirror"]);
    assert_eq!(class(&substrate, |b| matches!(b, Bsdf::RoughMetal { .. })), ["BrushedStainlessSteel"]);
    assert_eq!(
        class(&substrate, |b| matches!(b, Bsdf::Substrate { .. })),
        ["Floor", "Paneling", "TableWood"]
    );
    assert_eq!(class(&matte, |b| matches!(b, Bsdf::Substrate { .. })), ["Floor", "Paneling"]);
    assert_eq!(class(&substrate, |b| matches!(b, Bsdf::Glass { thin: false, .. })), ["Glass"]);
    assert_eq!(substrate.materials.len(), 19);
    assert_eq!(substrate.textures.len(), 4);
    let leaves = substrate.materials.iter().find(|m| m.name == "Leaves").unwrap();
    assert!(matches!(leaves.alpha, Alpha::Mask { cutoff: 0.5, alpha } if alpha.texture.is_some()));
    let Some(Environment::Constant(radiance)) = substrate.environment else { panic!() };
    assert_eq!(radiance, [21.0, 13.8, 8.4]);
    // Rs = ((1.5 - 1) / (1.5 + 1))^2
    let floor = substrate.materials.iter().find(|m| m.name == "Floor").unwrap();
    let Bsdf::Substrate { specular, .. } = floor.bsdf else { panic!() };
    assert!(specular.factor.iter().all(|s| (s - 0.04).abs() < 1e-7));
}

#[test]
fn veach_mis_has_its_index_of_refraction() {
    let Some(scene) = load_shared("veach-mis") else { return };
    let shiny: Vec<_> = scene
        .materials
        .iter()
        .filter_map(|m| match m.bsdf {
            Bsdf::Substrate { specular, roughness, .. } => Some((specular.factor, roughness.factor)),
            _ => None,
        })
        .collect();
    assert!(!shiny.is_empty());
    // ior 2: ((2 - 1) / (2 + 1))^2
    assert!(shiny.iter().all(|(specular, _)| (specular[0] - 1.0 / 9.0).abs() < 1e-6), "{shiny:?}");
    assert!(scene.meshes.iter().all(|m| m.normals.is_none()));
    assert_eq!(scene.materials.iter().filter(|m| m.is_emissive()).count(), 5);
}
