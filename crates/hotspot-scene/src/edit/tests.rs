use super::*;
use crate::scene::{Color, Instance, Mesh, Object, Scalar};

const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

fn scene() -> Scene {
    let color = Color::constant([0.2, 0.4, 0.6]);
    let material = |name: &str, bsdf| Material { bsdf, ..Material::default_matte(name) };
    let mirror = Bsdf::Mirror { reflectance: color };
    let metal = Bsdf::RoughMetal { f0: color, roughness: Scalar::constant(0.3) };
    let substrate = Bsdf::Substrate {
        diffuse: color,
        specular: Color::constant([0.04; 3]),
        specular_weight: Scalar::constant(1.0),
        roughness: Scalar::constant(0.3),
    };
    let mix = Bsdf::Mix {
        weight: Scalar::constant(0.5),
        base: Box::new(substrate.clone()),
        other: Box::new(metal.clone()),
    };
    let mut lamp = Material::default_matte("Lamp");
    lamp.emission = Color::constant([5.0; 3]);
    let glass = Bsdf::Glass { ior: 1.5, thin: false, transmittance: color, absorption: [0.0; 3] };
    let mesh = Mesh {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let instance = |object, material| Instance { object, mesh: 0, material, to_world: IDENTITY };
    Scene {
        meshes: vec![mesh],
        instances: vec![instance(0, 0), instance(0, 3), instance(1, 1), instance(2, 4), instance(3, 2)],
        objects: ["Chair", "Chair #2", "Lamp", "Wall"].map(|name| Object { name: name.into() }).to_vec(),
        materials: vec![
            material("Mirror", mirror),
            material("Metal", metal),
            material("Paint", substrate),
            material("Mix", mix),
            lamp,
            material("Glass", glass),
        ],
        ..Scene::default()
    }
}

fn edited(edit: Edit) -> (Scene, Affected) {
    let (scene, mut affected) = apply(&scene(), &[edit]).unwrap();
    (scene, affected.remove(0))
}

fn roughness(material: &str, roughness: f32) -> Edit {
    Edit::Roughness { material: material.into(), roughness }
}

#[test]
fn matte_keeps_the_base_colour() {
    for name in ["Mirror", "Metal", "Paint", "Mix", "Glass"] {
        let (scene, met) = edited(Edit::Matte { material: name.into() });
        let material = scene.materials.iter().find(|m| m.name == name).unwrap();
        let Bsdf::Matte { reflectance } = material.bsdf else { panic!("{name}: {:?}", material.bsdf) };
        assert_eq!(reflectance.factor, [0.2, 0.4, 0.6]);
        assert_eq!(met.instances, u64::from(name != "Glass"));
    }
}

#[test]
fn roughness_turns_mirrors_into_metals_and_back() {
    let bsdf = |material: &str, value| {
        let (scene, _) = edited(roughness(material, value));
        scene.materials.into_iter().find(|m| m.name == material).unwrap().bsdf
    };
    assert!(matches!(bsdf("Mirror", 0.5), Bsdf::RoughMetal { roughness, .. } if roughness.factor == 0.5));
    assert!(matches!(bsdf("Metal", 0.0), Bsdf::Mirror { .. }));
    assert!(matches!(bsdf("Paint", 0.0), Bsdf::Substrate { roughness, .. } if roughness.factor == 0.0));
    let Bsdf::Mix { base, other, .. } = bsdf("Mix", 0.9) else { panic!() };
    assert!(matches!(*base, Bsdf::Substrate { roughness, .. } if roughness.factor == 0.9));
    assert!(matches!(*other, Bsdf::RoughMetal { roughness, .. } if roughness.factor == 0.9));
}

#[test]
fn deleted_objects_keep_their_number() {
    let (without, met) = edited(Edit::Delete { object: "Chair".into() });
    assert_eq!(without.objects.len(), 4);
    assert!(without.instances.iter().all(|i| i.object != 0) && without.instances.len() == 3);
    assert_eq!((met.instances, met.objects, met.triangles, met.lights_removed), (2, 1, 2, false));
    assert_eq!(met.namesakes, ["Chair #2"]);
    let (dark, met) = edited(Edit::Delete { object: "Lamp".into() });
    assert!(met.lights_removed && !has_lights(&dark) && has_lights(&scene()));
}

#[test]
fn moves_are_in_the_world_and_add_up() {
    let step = |x| Edit::Move { object: "Wall".into(), by: [x, 0.0, -2.0] };
    let (scene, _) = apply(&scene(), &[step(1.0), step(0.5)]).unwrap();
    assert_eq!(scene.instances[4].to_world.map(|row| row[3]), [1.5, 0.0, -4.0]);
    assert_eq!(scene.instances[0].to_world, IDENTITY);
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |edits: &[Edit]| apply(&scene(), edits).unwrap_err();
    let delete = |object: &str| Edit::Delete { object: object.into() };
    assert!(matches!(refused(&[delete("chair")]), EditError::Unknown { named: Named::Object, .. }));
    assert!(matches!(refused(&[roughness("Wood", 0.5)]), EditError::Unknown { named: Named::Material, .. }));
    assert!(matches!(refused(&[roughness("Metal", 1.5)]), EditError::Range { .. }));
    assert!(matches!(refused(&[roughness("Metal", f32::NAN)]), EditError::Range { .. }));
    assert!(matches!(refused(&[roughness("Metal", 0.3)]), EditError::Nothing { .. }));
    assert!(matches!(refused(&[roughness("Mirror", 0.0)]), EditError::Nothing { .. }));
    assert!(matches!(refused(&[roughness("Glass", 0.5)]), EditError::Nothing { .. }));
    assert!(matches!(refused(&[roughness("Lamp", 0.5)]), EditError::Nothing { .. }));
    assert!(matches!(refused(&[Edit::Matte { material: "Lamp".into() }]), EditError::Nothing { .. }));
    let far = Edit::Move { object: "Wall".into(), by: [f64::INFINITY, 0.0, 0.0] };
    assert!(matches!(refused(&[far]), EditError::Range { .. }));
    let matte = Edit::Matte { material: "Metal".into() };
    assert!(matches!(refused(&[matte, roughness("Metal", 0.5)]), EditError::Twice { .. }));
    assert!(matches!(refused(&[delete("Wall"), delete("Wall")]), EditError::Twice { .. }));
}
