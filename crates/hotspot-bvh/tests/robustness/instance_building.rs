//! Building trees of instances: what cannot be placed, hostile matrices, the words for hashing, memory and bounds.

use crate::instances::signed_permutation;
use crate::meshes::{grid_box, icosphere};
use crate::placed::{IDENTITY, Placement, affine, place, scaling, translation};
use crate::support::{QUALITIES, Rng, Triangle, narrow, soup, wide};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh, BvhError, Instance, NoProbe, Quality, Ray};

fn build(meshes: &[Vec<Triangle>], instances: &[Instance]) -> Result<Bvh, BvhError> {
    Bvh::build_instanced(&[], meshes, instances, BuildOptions::default())
}

#[test]
fn what_cannot_be_placed_is_named() {
    let mesh = soup(&mut Rng::new(79), 20, 0.3);
    let at = |mesh| Instance { mesh, to_world: IDENTITY };
    let meshes = [mesh.clone(), Vec::new()];
    assert_eq!(build(&meshes, &[at(0), at(0), at(2)]).unwrap_err(), BvhError::NoSuchMesh { instance: 2 });
    assert_eq!(build(&meshes, &[at(u32::MAX)]).unwrap_err(), BvhError::NoSuchMesh { instance: 0 });
    assert_eq!(build(&[], &[at(0)]).unwrap_err(), BvhError::NoSuchMesh { instance: 0 });
    assert_eq!(build(&meshes, &[at(0), at(1)]).unwrap_err(), BvhError::EmptyMesh { instance: 1 });
    let flat = Instance { mesh: 0, to_world: scaling(1.0, 1.0, 0.0) };
    assert_eq!(build(&meshes, &[at(0), flat]).unwrap_err(), BvhError::NotInvertible { instance: 1 });
    // Meshes that nobody places may be empty, but not broken.
    assert_eq!(build(&meshes, &[at(0)]).unwrap().triangle_count(), 20);
    let mut broken = mesh.clone();
    broken[7][1][2] = f32::NAN;
    let error = BvhError::NotFinite { mesh: Some(1), triangle: 7 };
    assert_eq!(build(&[mesh.clone(), broken.clone()], &[at(0)]).unwrap_err(), error);
    assert_eq!(error.to_string().matches("triangle 7 of mesh 1").count(), 1);
    broken[7][1][2] = f32::NEG_INFINITY;
    let error = Bvh::build_instanced(&broken, &[mesh], &[at(0)], BuildOptions::default()).unwrap_err();
    assert_eq!(error, BvhError::NotFinite { mesh: None, triangle: 7 });
    assert!(error.to_string().starts_with("triangle 7 has"), "{error}");
}

/// 2^27 − 1 triangles are too many, also when meshes share them out.
#[test]
#[ignore = "5 GB of address space (not of memory: it is never touched)"]
fn too_many_triangles_are_named() {
    let half = |count| vec![[[0.0f32; 3]; 3]; count];
    let meshes = [half(1 << 26), half((1 << 26) - 1)];
    let error = build(&meshes, &[]).unwrap_err();
    assert_eq!(error, BvhError::TooManyTriangles { count: (1 << 27) - 1 });
}

/// Matrices made to break the build: an error, or an instance that behaves; never a panic, never a hit that is not finite.
#[test]
fn hostile_matrices() {
    let values = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        1e300,
        -1e300,
        1e-300,
        1e160,
        1e-160,
        1e38,
        1e39,
        1e-45,
        5e-324,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        1e-3,
        7.0,
    ];
    let mut rng = Rng::new(80);
    let mesh = icosphere(0, 0.0, 1.0).triangles();
    let (mut built, mut refused) = (0, 0);
    for round in 0..3000 {
        let mut matrix = if rng.coin() { IDENTITY } else { affine(&mut rng, 2.0, 1.0, 10.0) };
        for _ in 0..1 + rng.below(3) {
            matrix[rng.below(3)][rng.below(4)] = *rng.pick(&values);
        }
        let whole = *rng.pick(&values);
        if rng.below(6) == 0 {
            matrix = matrix.map(|row| row.map(|c| c * whole));
        }
        if rng.below(6) == 0 {
            // One row a multiple of another.
            matrix[rng.below(3)] = matrix[rng.below(3)].map(|c| c * 2.0);
        }
        let instance = Instance { mesh: 0, to_world: matrix };
        let finite = matrix.iter().flatten().all(|c| c.is_finite());
        match build(core::slice::from_ref(&mesh), &[instance]) {
            Err(error) => {
                refused += 1;
                assert_eq!(error, BvhError::NotInvertible { instance: 0 });
            }
            Ok(bvh) => {
                built += 1;
                assert!(finite, "{matrix:?}");
                assert!(Bvh::can_place([-1.0; 3], [1.0; 3], &matrix), "{matrix:?}");
                let (low, high) = bvh.bounds();
                assert!(low.iter().chain(&high).all(|c| c.is_finite()), "{matrix:?}");
            }
        }
        if finite && Bvh::can_place([-1.0; 3], [1.0; 3], &matrix) && round % 4 == 0 {
            // Not all that has an inverse lies within the range of f32.
            let Ok(_) = build(core::slice::from_ref(&mesh), &[instance]) else { continue };
            let scene =
                Placement::new("hostile", Vec::new(), vec![mesh.clone()], &[(0, matrix)], Quality::Fast);
            for _ in 0..5 {
                scene.check(&scene.hostile_ray(&mut rng));
            }
        }
    }
    assert!(built > 300 && refused > 300, "{built} {refused}");
}

fn hash(bvh: &Bvh) -> u64 {
    bvh.words().fold(0xcbf2_9ce4_8422_2325, |h, word| (h ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn trees_with_instances_do_not_depend_on_threads_or_instruction_sets() {
    let mut rng = Rng::new(81);
    let meshes = [soup(&mut rng, 5000, 0.05), icosphere(3, 0.0, 1.0).triangles(), soup(&mut rng, 5, 1.0)];
    let instances: Vec<_> =
        (0..600).map(|i| Instance { mesh: i % 3, to_world: affine(&mut rng, 1.0, 1.0, 20.0) }).collect();
    let world = soup(&mut rng, 2000, 0.5);
    for quality in QUALITIES {
        let hash = |isa| {
            let options = BuildOptions { quality, isa, ..Default::default() };
            hash(&Bvh::build_instanced(&world, &meshes, &instances, options).unwrap())
        };
        let expected = hash(Isa::Auto);
        assert_eq!(hash(Isa::Portable), expected);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| hash(Isa::Auto)), expected, "{quality:?} {threads}");
        }
    }
}

/// The words tell a change of any coefficient of a matrix, however small the change, and of the mesh and the order.
#[test]
fn words_tell_instances_apart() {
    let mut rng = Rng::new(82);
    let meshes = [soup(&mut rng, 50, 0.2), soup(&mut rng, 50, 0.2)];
    let instances: Vec<_> =
        (0..6).map(|i| Instance { mesh: i % 2, to_world: affine(&mut rng, 0.5, 0.5, 5.0) }).collect();
    let words = |instances: &[Instance]| hash(&build(&meshes, instances).unwrap());
    let expected = words(&instances);
    assert_eq!(words(&instances), expected);
    for index in 0..instances.len() {
        for row in 0..3 {
            for column in 0..4 {
                let mut other = instances.clone();
                let c = &mut other[index].to_world[row][column];
                // Smaller than any unit in the last place of f32.
                *c += 1e-12 * c.abs().max(1.0);
                assert_ne!(words(&other), expected, "{index} {row} {column}");
            }
        }
        let mut other = instances.clone();
        other[index].mesh ^= 1;
        assert_ne!(words(&other), expected);
    }
    let mut other = instances.clone();
    other.swap(1, 3);
    assert_ne!(words(&other), expected);
    other.truncate(5);
    assert_ne!(words(&other), expected);
}

/// An instance costs its matrix, its box and its root, not its mesh: 16 of 20 480 triangles take a tenth of 16 copies.
#[test]
fn instances_share_their_mesh() {
    let mesh = icosphere(5, 0.0, 1.0).triangles();
    assert_eq!(mesh.len(), 20_480);
    let places: Vec<_> = (0..16).map(|i| translation(3.0 * f64::from(i), 0.0, 0.0)).collect();
    let instances: Vec<_> = places.iter().map(|&to_world| Instance { mesh: 0, to_world }).collect();
    let meshes = [mesh.clone()];
    let shared = build(&meshes, &instances).unwrap();
    let one = Bvh::build(&mesh, BuildOptions::default()).unwrap();
    let copies: Vec<Triangle> =
        places.iter().flat_map(|m| mesh.iter().map(|t| t.map(|v| narrow(place(m, wide(v)))))).collect();
    let copied = Bvh::build(&copies, BuildOptions::default()).unwrap();
    assert!(shared.memory() * 10 < copied.memory(), "{} {}", shared.memory(), copied.memory());
    // What is not the mesh: the instances themselves (at least their matrices) and a few nodes above them.
    let more = shared.memory() - one.memory();
    assert!((16 * 12 * 8..16 * 12 * 8 + 4096).contains(&more), "{more}");
    assert_eq!((shared.instance_count(), shared.triangle_count()), (16, 20_480));
    // And an instance more costs memory.
    let twice: Vec<_> = instances.iter().chain(&instances).copied().collect();
    assert!(build(&meshes, &twice).unwrap().memory() >= shared.memory() + 16 * 12 * 8);
}

/// The bounding box of everything holds every placed vertex, and is not more than rounding wider.
#[test]
fn bounds_hold_all_instances_tightly() {
    let mut rng = Rng::new(83);
    // Boxes turned by quarter turns: their placed box is that of their vertices.
    for _ in 0..100 {
        let mesh = grid_box("box", 2, rng.signed(), [1.0, 2.0, 0.5]).triangles();
        let matrix = signed_permutation(&mut rng);
        let bvh = build(core::slice::from_ref(&mesh), &[Instance { mesh: 0, to_world: matrix }]).unwrap();
        let (low, high) = bvh.bounds();
        for axis in 0..3 {
            let placed = || mesh.iter().flatten().map(|&v| place(&matrix, wide(v))[axis]);
            let (min, max) =
                (placed().fold(f64::INFINITY, f64::min), placed().fold(f64::NEG_INFINITY, f64::max));
            let (low, high) = (f64::from(low[axis]), f64::from(high[axis]));
            assert!(low < min && max < high, "{low} {min} {max} {high}");
            assert!(min - low < 1e-6 && high - max < 1e-6, "{low} {min} {max} {high}");
        }
    }
    for _ in 0..100 {
        let mesh = soup(&mut rng, 60, 0.3);
        let matrix = affine(&mut rng, 2.0, 1.0, 100.0);
        let bvh = build(core::slice::from_ref(&mesh), &[Instance { mesh: 0, to_world: matrix }]).unwrap();
        let (low, high) = bvh.bounds();
        for v in mesh.iter().flatten() {
            let p = place(&matrix, wide(*v));
            assert!(
                (0..3).all(|i| f64::from(low[i]) < p[i] && p[i] < f64::from(high[i])),
                "{p:?} {low:?} {high:?}"
            );
        }
    }
}

/// What `can_place` promises, the build keeps.
#[test]
fn what_can_be_placed_builds() {
    let mesh = grid_box("box", 1, 0.0, [1.0; 3]).triangles();
    for to_world in [translation(1e300, 0.0, 0.0), scaling(1e39, 1e39, 1e39), scaling(1e-3, 1e3, 1.0)] {
        let built = build(core::slice::from_ref(&mesh), &[Instance { mesh: 0, to_world }]).is_ok();
        assert_eq!(Bvh::can_place([-1.0; 3], [1.0; 3], &to_world), built, "{to_world:?}");
    }
}

/// Matrices that f32 cannot follow: the ray's direction in the mesh's space overflows or vanishes, though mesh and
/// instance lie within the range of f32. Such an instance should be refused, or be hit.
#[test]
fn scales_beyond_f32_are_refused_or_hit() {
    for (size, scale) in [(1e38, 1e-42), (1e-38, 1e47)] {
        let mesh = grid_box("box", 1, 0.0, [size; 3]).triangles();
        let instance = Instance { mesh: 0, to_world: scaling(scale, scale, scale) };
        if let Ok(bvh) = build(core::slice::from_ref(&mesh), &[instance]) {
            // From its middle.
            let ray = Ray::new([0.0; 3], [0.3, 0.2, 1.0]);
            assert!(bvh.closest_hit(&ray, NoProbe).is_some(), "{size} {scale}");
        }
    }
}
