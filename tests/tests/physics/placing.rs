//! Instances: what a matrix does to a mesh is what doing it to the mesh does.

use hotspot_cost::Digest;
use hotspot_scene::{Material, Mesh, Scene};
use hotspot_tests::picture::{frame, settings};
use hotspot_tests::world::{
    IDENTITY, World, cuboid, emitting, light, matte, pinhole, rectangle, sphere, substrate,
};

/// A ball with smooth normals and a lamp, whose corner would show a wrong side at once.
fn parts() -> Vec<(Mesh, Material)> {
    let mut ball = sphere([0.5, 0.25, 0.0], 0.5, 2, false);
    let normals = ball.positions.iter().map(|p| [2.0 * (p[0] - 0.5), 2.0 * (p[1] - 0.25), 2.0 * p[2]]);
    ball.normals = Some(normals.collect());
    vec![
        (ball, substrate([0.5, 0.2, 0.1], 0.08, 0.4)),
        (rectangle([0.75, 1.5, 0.25], [0.5, 0.0, 0.0], [0.0, 0.0, 0.25]), light([9.0, 8.0, 7.0])),
        (cuboid([-0.75, 0.0, -0.25], [-0.5, 0.5, 0.5], false), emitting(matte([0.5; 3]), [0.0, 1.0, 2.0])),
    ]
}

fn digest(placed: Vec<(Mesh, Material, [[f64; 4]; 3])>) -> Digest {
    let floor = rectangle([0.0, -0.5, 0.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]);
    let mut world = World::new().with(floor, matte([0.6; 3]));
    for (mesh, material, matrix) in placed {
        world = world.with_placed(mesh, material, matrix);
    }
    let camera = pinhole([1.0, 1.2, 4.0], [0.0, 0.3, 0.0], 40.0);
    Digest::of(&frame(&world.prepare(), &camera, &settings(32, 24, 8, 6, 0)).frame)
}

/// Powers of two and exact coordinates, so that both ways round alike: not a bit may differ.
#[test]
fn matrices_and_transformed_meshes_agree() {
    let matrix = |s: [f64; 3], t: f64| {
        let mut m = IDENTITY;
        for i in 0..3 {
            m[i][i] = s[i];
            m[i][3] = t * (i as f64 + 1.0);
        }
        m
    };
    for (scale, shift) in [
        ([-1.0, 1.0, 1.0], 0.0),
        ([1.0, 1.0, -1.0], 0.25),
        ([-1.0, -1.0, -1.0], 0.5),
        ([-1.0, 1.0, -1.0], 0.0),
    ] {
        let mirrored = scale.iter().product::<f64>() < 0.0;
        let m = matrix(scale, shift);
        let by_matrix = parts().into_iter().map(|(mesh, material)| (mesh, material, m)).collect();
        let by_hand = parts()
            .into_iter()
            .map(|(mut mesh, material)| {
                for p in &mut mesh.positions {
                    *p = [0, 1, 2].map(|i| (f64::from(p[i]) * scale[i] + m[i][3]) as f32);
                }
                for n in mesh.normals.iter_mut().flatten() {
                    *n = [0, 1, 2].map(|i| n[i] * scale[i] as f32);
                }
                if mirrored {
                    // The front stays the front.
                    for t in &mut mesh.triangles {
                        t.swap(1, 2);
                    }
                }
                (mesh, material, IDENTITY)
            })
            .collect();
        assert_eq!(digest(by_matrix), digest(by_hand), "scale {scale:?}");
    }
}

/// Two instances of one mesh are two meshes.
#[test]
fn shared_meshes_are_placed_apart() {
    let at = |x: f64| {
        let mut m = IDENTITY;
        m[0][3] = x;
        m
    };
    let (ball, material) = parts().swap_remove(0);
    let mut shared: Scene = World::new()
        .with_placed(ball.clone(), material.clone(), at(-0.5))
        .with_placed(ball.clone(), material.clone(), at(0.75))
        .scene;
    let apart = shared.clone();
    shared.meshes.truncate(1);
    for instance in &mut shared.instances {
        instance.mesh = 0;
    }
    let camera = pinhole([0.0, 0.5, 5.0], [0.5, 0.0, 0.0], 40.0);
    let render = |scene: Scene| {
        let world = World { scene }.with_environment([1.0, 0.8, 0.6]);
        Digest::of(&frame(&world.prepare(), &camera, &settings(32, 16, 4, 4, 0)).frame)
    };
    assert_eq!(render(shared), render(apart));
}
