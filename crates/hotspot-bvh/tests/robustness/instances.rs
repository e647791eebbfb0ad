//! Meshes placed many times: tree, loop and recursive twin agree, whatever the matrices and the rays; ties; what cannot be
//! placed; memory and words. (Whether instances lie where they should is the matter of `instance_geometry`.)

use crate::meshes::{grid_box, icosphere};
use crate::placed::{IDENTITY, Matrix, Placement, affine, all_bits, place, scaling, translation};
use crate::support::{QUALITIES, Rng, Triangle, narrow, point_on, scaled, soup, towards, wide};
use hotspot_bvh::oracle::{self, Counts};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{
    BuildOptions, Bvh, BvhError, Hit, Instance, NO_INSTANCE, NoFilter, NoProbe, Quality, Ray, RayProbe,
};

/// Axis-parallel tiles of the plane z = 0: boxes without thickness.
pub(crate) fn tiles(cells: u32) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for x in 0..cells {
        for y in 0..cells {
            let corner = |i: u32, j: u32| [(x + i) as f32, (y + j) as f32, 0.0];
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// A permutation of the axes with signs, moved by whole numbers: boxes stay flat, and nothing is rounded.
fn signed_permutation(rng: &mut Rng) -> Matrix {
    let shift = rng.below(3);
    core::array::from_fn(|i| {
        let mut row = [0.0; 4];
        row[(i + shift) % 3] = if rng.coin() { 1.0 } else { -1.0 };
        row[3] = rng.below(9) as f64 - 4.0;
        row
    })
}

/// Everything that has its own way to go wrong.
pub(crate) fn placements(quality: Quality) -> Vec<Placement> {
    let mut rng = Rng::new(70);
    let one = vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [0.0, 1.0, -0.3]]];
    let ball = icosphere(1, 0.0, 1.0).triangles();
    let meshes = vec![soup(&mut rng, 30, 0.4), ball.clone(), one.clone(), soup(&mut rng, 9, 1.0)];
    let mut everywhere = |count: usize, decades: f64, far: f64| -> Vec<(u32, Matrix)> {
        (0..count).map(|i| (i as u32 % 4, affine(&mut rng, decades, 1.0, far))).collect()
    };
    let wild = everywhere(24, 3.0, 3.0);
    let mut far = everywhere(16, 3.0, 1e6);
    far.extend(everywhere(4, 1.0, 1.0));
    let near = everywhere(20, 0.5, 2.0);
    let single = everywhere(1, 1.0, 5.0);
    let blocks: Vec<_> = everywhere(12, 1.0, 2.0).into_iter().map(|(_, m)| (2, m)).collect();
    let quads = (0..20).map(|_| (0, signed_permutation(&mut rng))).collect::<Vec<_>>();
    let shells: Vec<_> = (-20..20).map(|i| (0, scaling(1.0, 1.0, 1.0).map(|r| r.map(|c| c * 2f64.powi(i))))).collect();
    let world = soup(&mut rng, 40, 0.5);
    let twice: Vec<Triangle> = ball.iter().chain(&one).copied().collect();
    let same = affine(&mut rng, 0.3, 0.5, 1.0);
    vec![
        Placement::new("wild", world.clone(), meshes.clone(), &wild, quality),
        Placement::new("far", scaled(&world, 1e5), meshes.clone(), &far, quality),
        Placement::new("near", world.clone(), meshes.clone(), &near, quality),
        Placement::new("instances only", Vec::new(), meshes.clone(), &near, quality),
        Placement::new("one instance", Vec::new(), meshes.clone(), &[(0, single[0].1)], quality),
        Placement::new("one triangle, once", Vec::new(), vec![one.clone()], &[(0, single[0].1)], quality),
        Placement::new("an instance and a triangle", one.clone(), meshes.clone(), &single, quality),
        Placement::new("blocks", world.clone(), meshes.clone(), &blocks, quality),
        Placement::new("flat", tiles(3), vec![tiles(3)], &quads, quality),
        Placement::new("shells", Vec::new(), vec![grid_box("box", 1, 0.0, [1.0; 3]).triangles()], &shells, quality),
        Placement::new("one place", Vec::new(), vec![ball.clone()], &vec![(0, same); 300], quality),
        Placement::new("a copy of the world", twice.clone(), vec![twice], &[(0, IDENTITY); 2], quality),
        Placement::new("no instance", world.clone(), meshes, &[], quality),
        Placement::new("nothing", Vec::new(), Vec::new(), &[], quality),
    ]
}

/// Rays to shoot at a placement of such a size, so that the loop over everything stays cheap.
pub(crate) fn share(placement: &Placement, work: usize) -> usize {
    let of = |i: &Instance| placement.meshes[i.mesh as usize].len();
    let triangles = placement.triangles.len() + placement.instances.iter().map(of).sum::<usize>();
    work / (triangles + 300)
}

fn agree(qualities: &[Quality], work: usize, seed: u64) {
    for &quality in qualities {
        for placement in placements(quality) {
            if placement.name == "nothing" {
                assert_eq!(placement.check(&Ray::new([0.0; 3], [0.0, 0.0, 1.0])), None);
                continue;
            }
            let mut rng = Rng::new(seed);
            let (mut hits, count) = (0, share(&placement, work));
            for _ in 0..count {
                let ray = placement.hostile_ray(&mut rng);
                let hit = placement.check(&ray);
                hits += usize::from(hit.is_some());
                placement.check(&Placement::with_ends(&mut rng, &ray, hit));
                placement.check(&Placement::with_ends(&mut rng, &ray, hit));
            }
            assert!(hits * 4 > count, "{} {quality:?}: only {hits} of {count} rays hit", placement.name);
        }
    }
}

/// Some 17 000 rays, each with three pairs of ends.
#[test]
fn tree_loop_and_twin_agree() {
    agree(&QUALITIES, 500_000, 71);
}

/// Some 10^7 rays.
#[test]
#[ignore = "minutes in release: 1e7 rays, each against every triangle"]
fn tree_loop_and_twin_agree_in_full() {
    agree(&QUALITIES, 300_000_000, 72);
}

/// Rays that are not finite, have no direction or no interval, hit nothing and visit no more than the root.
#[test]
fn unusable_rays_hit_nothing() {
    let mut rng = Rng::new(73);
    for placement in placements(Quality::Medium) {
        for _ in 0..50 {
            let mut ray = Ray::new(narrow(rng.cube()), narrow(rng.direction()));
            let bad = *rng.pick(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
            let axis = rng.below(3);
            match rng.below(5) {
                0 => ray.origin[axis] = bad,
                1 => ray.direction[axis] = bad,
                2 => (ray.origin[axis], ray.direction[axis]) = (bad, -bad),
                3 => ray.direction = [0.0, -0.0, 0.0],
                _ => (ray.t_min, ray.t_max) = (2.0, 1.0),
            }
            assert_eq!(placement.check(&ray), None, "{} {ray:?}", placement.name);
        }
    }
}

/// 300 instances in one place: the first wins every tie, all the others lose, and no instance hides another.
#[test]
fn of_instances_in_one_place_the_first_wins() {
    let mut rng = Rng::new(74);
    let mesh = icosphere(1, 0.0, 1.0).triangles();
    for decades in [0.0, 1.0] {
        let matrix = affine(&mut rng, decades, decades, 2.0);
        for quality in QUALITIES {
            let many = Placement::new("one place", Vec::new(), vec![mesh.clone()], &[(0, matrix); 300], quality);
            let alone = Placement::new("alone", Vec::new(), vec![mesh.clone()], &[(0, matrix)], quality);
            for _ in 0..30 {
                let ray = many.hostile_ray(&mut rng);
                let (hit, only) = (many.check(&ray), alone.check(&ray));
                assert_eq!(all_bits(hit), all_bits(only), "{ray:?}");
                assert!(hit.is_none_or(|h| h.instance == 0));
            }
        }
    }
}

/// An instance that lies exactly on triangles of the world never wins; and without them it gives the same values (but
/// its normals are rounded twice, and zeros may change their sign).
#[test]
fn the_world_wins_against_its_copy() {
    let mut rng = Rng::new(75);
    let meshes =
        [soup(&mut rng, 60, 0.4), grid_box("box", 3, 0.0, [1.0; 3]).triangles(), tiles(5), soup(&mut rng, 3, 1.0)];
    for mesh in meshes {
        for quality in QUALITIES {
            let copies = [(0, IDENTITY); 3];
            let both = Placement::new("both", mesh.clone(), vec![mesh.clone()], &copies, quality);
            let world = Placement::new("world", mesh.clone(), Vec::new(), &[], quality);
            let copy = Placement::new("copy", Vec::new(), vec![mesh.clone()], &copies, quality);
            for _ in 0..150 {
                let ray = both.hostile_ray(&mut rng);
                let hit = both.check(&ray);
                let ray = if rng.coin() { Placement::with_ends(&mut rng, &ray, hit) } else { ray };
                let (hit, of_world, of_copy) = (both.check(&ray), world.check(&ray), copy.check(&ray));
                assert_eq!(all_bits(hit), all_bits(of_world), "{ray:?}");
                let same = |h: Hit| (h.t, h.u, h.v, h.primitive);
                assert_eq!(of_copy.map(same), of_world.map(same), "{ray:?}");
                if let (Some(a), Some(b)) = (of_copy, of_world) {
                    assert!((0..3).all(|i| (a.normal[i] - b.normal[i]).abs() <= f32::EPSILON), "{a:?} {b:?}");
                }
                assert!(hit.is_none_or(|h| h.instance == NO_INSTANCE));
                assert!(of_copy.is_none_or(|h| h.instance == 0));
            }
        }
    }
}

/// A ray that goes on behind each hit (`t_min` at its t) makes progress and ends; and a beginning just before the nearest
/// hit loses nothing.
#[test]
fn rays_that_go_on_behind_a_hit_make_progress() {
    let mut rng = Rng::new(76);
    for placement in placements(Quality::Medium) {
        if placement.name == "nothing" || placement.name == "one place" {
            continue;
        }
        for _ in 0..share(&placement, 100_000) {
            let mut ray = placement.hostile_ray(&mut rng);
            for _ in 0..40 {
                let Some(hit) = placement.check(&ray) else { break };
                let before = Ray { t_min: hit.t.next_down().max(0.0), ..ray };
                assert_eq!(placement.check(&before).map(|h| h.t), Some(hit.t), "{} {before:?}", placement.name);
                ray.t_min = hit.t;
            }
        }
    }
}

/// Hits do not depend on where the ray ends: with `t_max` just behind the nearest it stays the nearest, at its t there is
/// none.
#[test]
fn ends_do_not_change_the_hit() {
    let mut rng = Rng::new(77);
    for placement in placements(Quality::Medium) {
        if placement.name == "nothing" {
            continue;
        }
        for _ in 0..share(&placement, 100_000) {
            let ray = placement.hostile_ray(&mut rng);
            let Some(hit) = placement.check(&ray) else { continue };
            let behind = Ray { t_max: hit.t.next_up(), ..ray };
            assert_eq!(all_bits(placement.check(&behind)), all_bits(Some(hit)), "{} {ray:?}", placement.name);
            assert_eq!(placement.check(&Ray { t_max: hit.t, ..ray }), None, "{} {ray:?}", placement.name);
        }
    }
}

/// Nothing of the mesh counts where its root is a block and the ray passes the world's box: absolute counts.
#[test]
fn counts_of_one_instance() {
    let one = vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
    let only = Placement::new("one", Vec::new(), vec![one], &[(0, translation(2.0, 0.0, 0.0))], Quality::Medium);
    let cases = [
        // At it; through its box but past the triangle; past the box.
        (Ray::new([2.2, 0.2, 1.0], [0.0, 0.0, -1.0]), 1),
        (Ray::new([2.9, 0.9, 1.0], [0.0, 0.0, -1.0]), 1),
        (Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]), 0),
    ];
    for (ray, entered) in cases {
        only.check(&ray);
        let counts = Counts { nodes: 0, boxes: 0, leaves: entered, shapes: entered, instances: entered };
        for tree in &only.trees {
            assert_eq!(oracle::closest_filtered(tree, &ray, NoFilter).1, counts);
            assert_eq!(oracle::occluded_filtered(tree, &ray, NoFilter).1, counts);
        }
    }
}

/// The recursive twin visits nothing that the traversal does not, also where a box of the mesh begins one unit in the last
/// place behind a hit of the world.
#[test]
fn boxes_just_behind_a_hit_are_not_counted() {
    let mut rng = Rng::new(78);
    let far = 1f32.next_up();
    for _ in 0..200 {
        // Small triangles in the plane just behind z = 1, around the ray; others off it, nearer, so that the box of the
        // instance begins before.
        let mut mesh: Vec<Triangle> = (0..40)
            .map(|_| core::array::from_fn(|_| [rng.signed() as f32, rng.signed() as f32, far]))
            .collect();
        mesh.extend((0..40).map(|_| {
            core::array::from_fn(|_| [(5.0 + rng.signed()) as f32, rng.signed() as f32, rng.unit() as f32])
        }));
        // The world's box begins at the origin, too, and its block comes first.
        let behind = [[-1.0, -1.0, -1.0], [-0.9, -1.0, -1.0], [-1.0, -0.9, -1.0]];
        let world = vec![[[-1.0, -1.0, 1.0], [3.0, -1.0, 1.0], [-1.0, 3.0, 1.0]], behind];
        let scene = Placement::new("behind", world, vec![mesh], &[(0, IDENTITY)], Quality::Medium);
        let ray = Ray::new([0.01 * rng.signed() as f32, 0.0, 0.0], [0.0, 0.0, 1.0]);
        assert_eq!(scene.check(&ray).map(|h| h.t), Some(1.0));
    }
}

/// Instances within instances' boxes, from tiny to huge: deep trees on a small stack.
#[test]
fn nested_instances_on_a_small_stack() {
    let work = || {
        let mesh = grid_box("box", 2, 0.0, [1.0; 3]).triangles();
        let places: Vec<_> = (-60..60)
            .map(|i| (0, IDENTITY.map(|row| row.map(|c| c * 2f64.powi(i)))))
            .collect();
        let scene = Placement::new("nested", Vec::new(), vec![mesh], &places, Quality::Medium);
        let mut ray = Ray::new([0.0; 3], [1.0, 0.5, 0.25]);
        for shell in 0..120 {
            let hit = scene.check(&ray).unwrap();
            assert_eq!((hit.instance, hit.t), (shell, 2f32.powi(shell as i32 - 60)));
            ray.t_min = hit.t;
        }
        assert_eq!(scene.check(&ray), None);
    };
    std::thread::scope(|scope| {
        std::thread::Builder::new().stack_size(512 << 10).spawn_scoped(scope, work).unwrap().join().unwrap();
    });
}

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

/// 2^30 − 1 triangles are too many, also when meshes share them out.
#[test]
#[ignore = "39 GB of address space (not of memory: it is never touched)"]
fn too_many_triangles_are_named() {
    let half = || vec![[[0.0f32; 3]; 3]; 1 << 29];
    let meshes = [half(), half()];
    let error = build(&meshes, &[]).unwrap_err();
    assert_eq!(error, BvhError::TooManyTriangles { count: 1 << 30 });
}

/// Matrices made to break the build: an error, or an instance that behaves; never a panic, never a hit that is not finite.
#[test]
fn hostile_matrices() {
    let values = [
        0.0, -0.0, 1.0, -1.0, 1e300, -1e300, 1e-300, 1e160, 1e-160, 1e38, 1e39, 1e-45, 5e-324, f64::NAN,
        f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 1e-3, 7.0,
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
                assert!(Bvh::can_place(&matrix), "{matrix:?}");
                let (low, high) = bvh.bounds();
                assert!(low.iter().chain(&high).all(|c| c.is_finite()), "{matrix:?}");
            }
        }
        if finite && Bvh::can_place(&matrix) && round % 4 == 0 {
            // Not all that has an inverse lies within the range of f32.
            let Ok(_) = build(core::slice::from_ref(&mesh), &[instance]) else { continue };
            let scene = Placement::new("hostile", Vec::new(), vec![mesh.clone()], &[(0, matrix)], Quality::Fast);
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
            let options = BuildOptions { quality, isa };
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
    let copies: Vec<Triangle> = places
        .iter()
        .flat_map(|m| mesh.iter().map(|t| t.map(|v| narrow(place(m, wide(v))))))
        .collect();
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
            let (min, max) = (placed().fold(f64::INFINITY, f64::min), placed().fold(f64::NEG_INFINITY, f64::max));
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
            assert!((0..3).all(|i| f64::from(low[i]) < p[i] && p[i] < f64::from(high[i])), "{p:?} {low:?} {high:?}");
        }
    }
}

/// The probe hears the instance it entered, by its index.
#[test]
fn probes_hear_which_instance() {
    struct Ids<'a>(&'a mut Vec<u32>);
    impl RayProbe for Ids<'_> {
        fn node(&mut self, _id: u32, _boxes: u32) {}
        fn leaf(&mut self, _id: u32, _shapes: u32) {}
        fn instance(&mut self, id: u32) {
            self.0.push(id);
        }
        fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
        fn finish(self, _hit: bool) {}
    }
    let mesh = grid_box("box", 1, 0.0, [0.4; 3]).triangles();
    let instances: Vec<_> =
        (0..20).map(|i| Instance { mesh: 0, to_world: translation(f64::from(i), 0.0, 0.0) }).collect();
    let bvh = build(&[mesh.clone()], &instances).unwrap();
    for index in 0..20 {
        let at = *Rng::new(84).pick(&mesh);
        let target = narrow(place(&instances[index].to_world, wide(point_on(&mut Rng::new(85), &at))));
        let ray = towards([index as f32, 0.0, 0.0], target);
        let ray = Ray { direction: [0.0, ray.direction[1], ray.direction[2]], ..ray };
        let mut ids = Vec::new();
        let hit = bvh.closest_hit(&ray, Ids(&mut ids)).unwrap();
        assert_eq!((hit.instance, ids), (index as u32, vec![index as u32]));
        assert!(bvh.occluded(&ray, NoProbe));
    }
}
