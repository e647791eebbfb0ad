//! Meshes stored once: the same pictures as when they are written out, for any matrix; nothing leaks, nothing is lost.

use hotspot_cost::{Counter, Frame};
use hotspot_integrator::{Instancing, RenderScene, Roulette};
use hotspot_scene::{Alpha, Bsdf, Camera, Channel, Color, LightKind, Material, Mesh, NormalMap, Scalar};
use hotspot_tests::picture::{Picture, frame, picture, settings};
use hotspot_tests::stats::{Variance, mean_and_variance, sidak};
use hotspot_tests::world::{
    IDENTITY, Random, V3, World, bilinear, cross, cuboid, image, light, matte, metal, nearest, pinhole,
    rectangle, sphere, substrate, surface, unit,
};

type Matrix = [[f64; 4]; 3];

/// Rotated about z, sheared, scaled, mirrored where `mirror`, moved.
fn matrix(size: f64, shear: f64, angle: f64, mirror: bool, to: V3) -> Matrix {
    let (s, c) = angle.sin_cos();
    let flip = if mirror { -1.0 } else { 1.0 };
    let m = [[c, -s, shear], [s, c, 0.0], [0.0, 0.3 * shear, flip]];
    [0, 1, 2].map(|i| [size * m[i][0], size * m[i][1], size * m[i][2], to[i]])
}

/// A ball of the given radius about the origin with normals, two sets of uvs, colours and tangents.
fn dressed_ball(radius: f64, n: u32) -> Mesh {
    let mut ball = sphere([0.0; 3], radius, n, false);
    let normals: Vec<V3> = ball.positions.iter().map(|p| unit(p.map(f64::from))).collect();
    let f = |v: V3| v.map(|c| c as f32);
    ball.uvs = Some(normals.iter().map(|n| [2.0 * n[0] as f32, n[1] as f32]).collect());
    ball.second_uvs = Some(normals.iter().map(|n| [n[2] as f32, 3.0 * n[0] as f32]).collect());
    let tint = |c: f64| (0.75 + 0.25 * c) as f32;
    ball.colors = Some(normals.iter().map(|n| [tint(n[0]), tint(n[1]), tint(n[2]), tint(n[0])]).collect());
    let tangent = |n: &V3| {
        let t = f(unit(cross([0.02, 1.0, 0.01], *n)));
        [t[0], t[1], t[2], -1.0]
    };
    ball.tangents = Some(normals.iter().map(tangent).collect());
    ball.normals = Some(normals.into_iter().map(f).collect());
    ball
}

/// Balls of every kind of material, each mesh twice and more, in a room with a lamp and a sun. All in sizes of `size`;
/// the meshes are that much smaller or larger than their places ask for.
fn crowd(size: f64, blend: bool) -> (World, Camera) {
    let s = |v: V3| v.map(|c| c * size);
    let mut random = Random(7);
    let noise = image(16, 16, |_, _| [0; 4].map(|_| random.within(0.0, 256.0) as u8));
    let bumps = image(8, 8, |x, y| [100 + 8 * x as u8, 156 - 8 * y as u8, 230, 255]);
    let color = |factor: [f32; 3]| Color { factor, texture: Some(nearest(0)) };
    let alpha = Scalar { factor: 1.0, texture: Some((bilinear(0), Channel::A)) };
    let second = hotspot_scene::TextureRef { second_uvs: true, ..bilinear(0) };
    let masked = Material { alpha: Alpha::Mask { cutoff: 0.4, alpha }, ..matte([0.7, 0.6, 0.5]) };
    let blended = Material { alpha: Alpha::Blend { alpha: Scalar::constant(0.6) }, ..matte([0.7, 0.6, 0.5]) };
    let materials = [
        Material {
            normal_map: Some(NormalMap { texture: bilinear(1), scale: 1.0 }),
            ..surface(Bsdf::Matte { reflectance: color([0.9; 3]) })
        },
        if blend { blended } else { masked },
        substrate([0.5, 0.3, 0.2], 0.08, 0.4),
        surface(Bsdf::RoughMetal {
            f0: Color { factor: [0.9, 0.8, 0.5], texture: Some(second) },
            roughness: Scalar::constant(0.5),
        }),
    ];
    let mut world = World::new()
        .with_texture(noise)
        .with_texture(bumps)
        .with(rectangle(s([0.0, -1.0, 0.0]), s([0.0, 0.0, 3.0]), s([3.0, 0.0, 0.0])), matte([0.7; 3]))
        .with(rectangle(s([0.0, 0.0, -1.5]), s([3.0, 0.0, 0.0]), s([0.0, 2.0, 0.0])), matte([0.4, 0.6, 0.7]))
        .with(rectangle(s([0.5, 2.0, 1.0]), s([0.5, 0.0, 0.0]), s([0.0, 0.0, 0.5])), light([9.0; 3]))
        .with_light(LightKind::Directional { direction: [0.48, -0.64, -0.6] }, [0.6; 3])
        .with_environment([0.2; 3]);
    // The mesh in a size of its own.
    let own = 0.25;
    let (mut first, mut count) = (true, 0);
    for row in 0..3 {
        for column in 0..4 {
            let at = s([f64::from(column) * 0.75 - 1.1, row as f64 * 0.7 - 0.6, -0.3 * row as f64 + 0.2]);
            let shear = [0.0, 0.4, -0.3][row];
            let m = matrix(size / own * 0.28, shear, 0.7 * f64::from(count), count % 2 == 1, at);
            let material = materials[count as usize % 4].clone();
            world = if first {
                world.with_placed(dressed_ball(own, 3), material, m)
            } else {
                world.with_again(material, m)
            };
            first = false;
            count += 1;
        }
    }
    (world, pinhole(s([0.8, 0.6, 4.0]), s([0.0, 0.0, 0.0]), 40.0))
}

/// Pixels whose paths differ beyond rounding.
fn different(a: &Picture, b: &Picture) -> usize {
    let far =
        |(a, b): (&[f64; 3], &[f64; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-3 * (a[c] + b[c] + 0.01));
    a.pixels.iter().zip(&b.pixels).filter(|pair| far(*pair)).count()
}

/// With the same samples nearly every path is the same: hits round differently, which tips a comparison now and then (at
/// silhouettes, texels' and masks' edges), but shows nowhere else.
#[test]
fn stored_once_or_written_out() {
    for size in [1.0, 1e-3, 1e3] {
        let (world, camera) = crowd(size, false);
        let (often, once) = (world.prepare_with(Instancing::Never), world.prepare_with(Instancing::Always));
        assert_eq!((often.instance_count(), once.instance_count()), (0, 12));
        for (depth, share) in [(1, 50), (4, 20)] {
            let settings = settings(80, 60, 4, depth, 5);
            let (a, b) = (picture(&often, &camera, &settings), picture(&once, &camera, &settings));
            let count = different(&a, &b);
            assert!(count < 80 * 60 / share, "size {size}, depth {depth}: {count} pixels differ");
            for c in 0..3 {
                assert!((a.mean()[c] / b.mean()[c] - 1.0).abs() < 2e-3, "{:?} and {:?}", a.mean(), b.mean());
            }
        }
    }
}

/// Blending is decided per instance, so that paths differ: pixel by pixel within the noise, judged by eight independent
/// renders each (Student's t, 1e-4 for all pixels together, and for the mean).
#[test]
fn stored_once_or_written_out_where_surfaces_blend() {
    let (world, camera) = crowd(1.0, true);
    let runs = |instancing: Instancing, seed: u64| -> Vec<Picture> {
        let scene = world.prepare_with(instancing);
        (0..8).map(|i| picture(&scene, &camera, &settings(40, 30, 16, 3, seed + i))).collect()
    };
    let (a, b) = (runs(Instancing::Never, 100), runs(Instancing::Always, 200));
    assert!(different(&a[0], &b[0]) > 600, "nothing to tell");
    let level = sidak(1e-4, 1200);
    let judge = |values: &dyn Fn(&Picture) -> f64, level: f64, what: &str| {
        let of = |runs: &[Picture]| mean_and_variance(&runs.iter().map(values).collect::<Vec<_>>());
        let ((ma, va), (mb, vb)) = (of(&a), of(&b));
        let mut variance = Variance::default();
        variance.add(va, 7.0);
        variance.add(vb, 7.0);
        let p = variance.p_value(ma - mb);
        assert!(p > level || (ma - mb).abs() < 1e-5 * ma, "{what}: {ma} and {mb}, p {p}");
    };
    for i in 0..1200 {
        judge(&|p| p.pixels[i][1], level, &format!("pixel {i}"));
    }
    judge(&|p| p.mean()[1], 1e-4, "mean");
}

/// A closed box around the eye, stored once: light from outside does not come in, wherever it lies and however it is placed.
#[test]
fn boxes_do_not_leak() {
    let mut random = Random(3);
    for i in 0..24 {
        let size = [1.0, 1e-3, 1e3][i % 3];
        let at = random.point(-1.0, 1.0).map(|c| c * size * [1.0, 100.0][i % 2]);
        let m = matrix(size, random.within(-0.5, 0.5), random.within(0.0, 6.0), i % 4 < 2, at);
        let mut away = m;
        away[0][3] += 5.0 * size;
        let world = World::new()
            .with_placed(cuboid([-1.03, -0.87, -1.21], [0.93, 1.01, 1.1], i % 5 == 0), matte([0.9; 3]), m)
            .with_again(matte([0.9; 3]), away)
            .with_light(LightKind::Directional { direction: [0.48, -0.64, -0.6] }, [1e3; 3])
            .with_environment([1e6; 3]);
        let scene = world.prepare_with(Instancing::Always);
        assert_eq!(scene.instance_count(), 2);
        let look = [0, 1, 2].map(|k| at[k] + size * [0.3, 0.5, -0.6][k]);
        let mut settings = settings(32, 32, 8, 12, i as u64);
        settings.roulette = Roulette::Off;
        let seen = picture(&scene, &pinhole(at, look, 100.0), &settings);
        assert_eq!(seen.max(), 0.0, "box {i} of {size} at {at:?}");
    }
}

/// The same where the mesh lies far from its own origin and is brought back by its matrix: coordinates in the mesh's space
/// round far more coarsely than those in the world.
#[test]
fn boxes_far_from_their_origin_do_not_leak() {
    let mut random = Random(4);
    for i in 0..24 {
        let far = [1e2, 1e3, 1e4][i % 3];
        let middle = [far, far * [1.0, -1.0][i % 2], far];
        let corner = |s: f64| [0, 1, 2].map(|k| middle[k] + s * (1.0 + 0.01 * k as f64));
        let angle = if i % 4 == 0 { core::f64::consts::FRAC_PI_4 } else { random.within(0.0, 6.0) };
        let mut m = matrix(1.0, random.within(-0.3, 0.3), angle, i % 2 == 0, [0.0; 3]);
        for row in &mut m {
            row[3] = -(0..3).map(|k| row[k] * middle[k]).sum::<f64>();
        }
        let mut away = m;
        away[0][3] += 9.0;
        let world = World::new()
            .with_placed(cuboid(corner(-1.0), corner(1.0), i % 5 == 0), matte([0.9; 3]), m)
            .with_again(matte([0.9; 3]), away)
            .with_light(LightKind::Directional { direction: [0.48, -0.64, -0.6] }, [1e3; 3])
            .with_environment([1e6; 3]);
        let scene = world.prepare_with(Instancing::Always);
        assert_eq!(scene.instance_count(), 2);
        let mut settings = settings(32, 32, 8, 12, i as u64);
        settings.roulette = Roulette::Off;
        let seen = picture(&scene, &pinhole([0.0; 3], [0.3, 0.5, -0.6], 100.0), &settings);
        assert_eq!(seen.max(), 0.0, "box {i}, {far} from its origin");
    }
}

/// Two plates a little apart, stored once: the light between them stays there, and none of what is outside comes in; each
/// hides what is behind it, down to gaps of some roundings.
#[test]
fn plates_that_nearly_touch() {
    for (gap, at) in [(1e-2, 0.0), (1e-4, 0.0), (1e-5, 1.0), (1e-3, 100.0)] {
        let plate = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
        let lift = |y: f64| {
            let mut m = IDENTITY;
            m[1][3] = at + y;
            m
        };
        let world = World::new()
            .with_placed(plate, matte([0.0; 3]), lift(gap))
            .with_again(matte([1.0; 3]), lift(0.0))
            .with(rectangle([0.0, at - 9.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), matte([1.0; 3]))
            .with_light(LightKind::Directional { direction: [0.0, -1.0, 0.0] }, [1.0; 3]);
        let scene = world.prepare_with(Instancing::Always);
        let eye = pinhole([0.2, at + 3.0, 0.1], [0.0, at, 0.0], 20.0);
        assert_eq!(picture(&scene, &eye, &settings(24, 24, 8, 3, 1)).max(), 0.0, "gap {gap}");
        // From below the white plate is seen, and the sun above it does not shine through it.
        let eye = pinhole([0.2, at - 3.0, 0.1], [0.0, at, 0.0], 20.0);
        assert_eq!(picture(&scene, &eye, &settings(24, 24, 8, 3, 1)).max(), 0.0, "gap {gap}, below");
    }
}

/// White balls stored once vanish in a uniform sky, whatever the matrix makes of them: convex ones to the last bit of it,
/// several in the mean.
#[test]
fn white_instances_vanish() {
    for (i, size) in [1.0, 1e-3, 1e3, 1.0].into_iter().enumerate() {
        let m = matrix(size, 0.4, 1.0, i % 2 == 1, [0.0; 3]);
        let mut away = m;
        away[2][3] = -1e3 * size;
        let world = World::new()
            .with_placed(sphere([0.0; 3], 1.0, 3, false), matte([1.0; 3]), m)
            .with_again(matte([1.0; 3]), away)
            .with_environment([1.0; 3]);
        let scene = world.prepare_with(Instancing::Always);
        let eye = pinhole([1.0, 2.0, 3.0].map(|c: f64| c * size), [0.0; 3], 40.0);
        let seen = picture(&scene, &eye, &settings(32, 32, 8, 64, 1));
        assert!(seen.min() > 1.0 - 1e-4 && seen.max() < 1.0 + 1e-4, "{size}: {}..{}", seen.min(), seen.max());
    }
    let mut world = World::new().with_environment([1.0; 3]);
    for i in 0..9 {
        let m =
            matrix(0.4, 0.2, f64::from(i), i % 2 == 0, [f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0, 0.0]);
        world = match i {
            0 => world.with_placed(sphere([0.0; 3], 1.0, 2, false), matte([1.0; 3]), m),
            _ => world.with_again(matte([1.0; 3]), m),
        };
    }
    let scene = world.prepare_with(Instancing::Always);
    let mut settings = settings(32, 32, 32, 1000, 1);
    settings.roulette = Roulette::Off;
    let seen = picture(&scene, &pinhole([1.0, 2.0, 5.0], [0.0; 3], 40.0), &settings);
    let values: Vec<f64> = seen.pixels.iter().map(|p| p[1]).collect();
    let (mean, variance) = mean_and_variance(&values);
    let sigma = variance.sqrt();
    assert!((mean - 1.0).abs() < 4.0 * sigma && sigma < 1e-3, "{mean} ± {sigma}");
}

fn instances(frame: &Frame) -> u64 {
    frame.pixels().map(|(x, y)| frame.cost_total(x, y).get(Counter::Instances)).sum()
}

/// Whose triangles they are, and what the camera meets first.
#[test]
fn objects_of_instances_are_known() {
    let (world, camera) = crowd(1.0, false);
    let (often, once) = (world.prepare_with(Instancing::Never), world.prepare_with(Instancing::Always));
    let triangles = often.object_triangles();
    assert_eq!(triangles, [2, 2, 2].into_iter().chain([1280; 12]).collect::<Vec<_>>());
    assert_eq!(once.object_triangles(), triangles);
    assert_eq!((often.placed_triangle_count(), once.placed_triangle_count()), (6 + 12 * 1280, 6 + 12 * 1280));
    assert_eq!((often.triangle_count(), once.triangle_count()), (6 + 12 * 1280, 6 + 1280));
    let settings = settings(80, 60, 1, 2, 5);
    let (a, b) = (frame(&often, &camera, &settings).frame, frame(&once, &camera, &settings).frame);
    assert_eq!(instances(&a), 0);
    assert!(instances(&b) > 80 * 60 / 10);
    let (mut same, mut seen) = (0, std::collections::BTreeSet::new());
    for (x, y) in a.pixels() {
        let (a, b) = (a.cost_total(x, y).first_object, b.cost_total(x, y).first_object);
        same += u32::from(a == b);
        seen.insert(b);
    }
    assert!(same > 80 * 60 - 40, "{same} pixels name the same object");
    assert!((3..15).all(|object| seen.contains(&object)), "{seen:?}");
}

fn spread(count: usize, n: u32, material: &Material) -> World {
    let mut world = World::new().with_environment([1.0; 3]);
    for i in 0..count {
        let mut m = IDENTITY;
        m[0][3] = 3.0 * (i % 32) as f64;
        m[1][3] = 3.0 * (i / 32) as f64;
        world = match i {
            0 => world.with_placed(sphere([0.0; 3], 1.0, n, false), material.clone(), m),
            _ => world.with_again(material.clone(), m),
        };
    }
    world
}

fn bytes(scene: &RenderScene) -> u64 {
    let memory = scene.memory();
    memory.geometry + memory.bvh + memory.textures
}

/// A thousand instances of some 10,000 triangles take less than twice the memory of one, on their own accord; small
/// scenes stay flat; emitters are always written out.
#[test]
fn memory_is_that_of_one() {
    let plain = matte([0.5; 3]);
    // 20,480 triangles: 4⁵ · 20.
    let one = spread(1, 5, &plain).prepare();
    let many = spread(1000, 5, &plain).prepare();
    assert_eq!((one.instance_count(), many.instance_count()), (0, 1000));
    assert_eq!((one.triangle_count(), many.triangle_count()), (20480, 20480));
    assert!(bytes(&many) < 2 * bytes(&one), "{} for {}", bytes(&many), bytes(&one));
    assert_eq!(many.placed_triangle_count(), 20_480_000);

    // 13 × 20,480 is 2^18 + 4096 beyond the first.
    let count = hotspot_integrator::COPIES_THAT_PAY as usize / 20480;
    assert_eq!(spread(count + 1, 5, &plain).prepare().instance_count(), 0);
    assert_eq!(spread(count + 2, 5, &plain).prepare().instance_count(), count + 2);
    assert_eq!(spread(50, 2, &plain).prepare().instance_count(), 0);
    assert_eq!(spread(50, 2, &plain).prepare_with(Instancing::Always).instance_count(), 50);
    assert_eq!(spread(1, 2, &plain).prepare_with(Instancing::Always).instance_count(), 0);
    let lamps = spread(3, 1, &light([1.0; 3])).prepare_with(Instancing::Always);
    assert_eq!((lamps.instance_count(), lamps.light_count()), (0, 240));
    // A lamp among them: it alone is written out.
    let mixed = spread(3, 1, &metal([0.9; 3], 0.4)).with_again(light([1.0; 3]), IDENTITY);
    let mixed = mixed.prepare_with(Instancing::Always);
    assert_eq!((mixed.instance_count(), mixed.light_count(), mixed.triangle_count()), (3, 80, 160));
    // Two uses, one of which must be written out, are no two uses.
    let pair = spread(1, 1, &plain).with_again(light([1.0; 3]), IDENTITY).prepare_with(Instancing::Always);
    assert_eq!((pair.instance_count(), pair.triangle_count()), (0, 160));
    // Flat matrices have no way back: written out, and dropped there.
    let mut flat = IDENTITY;
    flat[0][0] = 0.0;
    let world = spread(3, 1, &plain).with_again(plain.clone(), flat);
    let flattened = world.prepare_with(Instancing::Always);
    assert_eq!(flattened.instance_count(), 3);
}

/// Memory is estimated before it is taken: copies that do not fit are refused, and many small meshes are stored once.
#[test]
fn geometry_that_does_not_fit_is_refused() {
    let plain = matte([0.5; 3]);
    let world = spread(100, 3, &plain);
    let with = |instancing, limit| {
        let options = hotspot_integrator::PrepareOptions {
            instancing,
            max_memory_bytes: Some(limit),
            ..Default::default()
        };
        RenderScene::prepare(&world.scene, options)
    };
    // 100 × 1280 triangles: some tens of megabytes as copies, less than one when stored once.
    let refused = with(Instancing::Never, 16 << 20).expect_err("too large").to_string();
    assert!(refused.contains("128000 triangles") && refused.contains("16 MiB"), "{refused}");
    assert!(with(Instancing::Never, 64 << 20).is_ok());
    assert!(with(Instancing::Always, 16 << 20).is_ok());
    // 199 further copies of 1280 triangles are too few to pay for one mesh, but not for twenty.
    let kit = |meshes: u32| {
        let mut world = World::new();
        for mesh in 0..meshes {
            world = world.with(sphere([f64::from(mesh), 0.0, 0.0], 0.4, 3, false), plain.clone());
            for copy in 1..200 {
                world = world
                    .with_again(plain.clone(), matrix(1.0, 0.0, 0.0, false, [0.0, f64::from(copy), 0.0]));
            }
        }
        world.prepare().instance_count()
    };
    assert_eq!((kit(1), kit(20)), (0, 4000));
}
