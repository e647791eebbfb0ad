//! Whether instances lie where they should: against the same geometry placed in f64, apart from all code of the tree;
//! closed meshes do not leak wherever they are placed; and what happens between two instances that touch.

use crate::instances::tiles;
use crate::meshes::{Mesh, grid_box, icosphere, uv_sphere};
use crate::placed::{
    Matrix, Placement, affine, cross, determinant, place, rotation, scaling, translation, turn, unit,
};
use crate::support::{Rng, Triangle, along, dot, narrow, point_on, soup, sub, towards, wide};
use hotspot_bvh::{BuildOptions, Bvh, Hit, Instance, NoProbe, Quality, Ray};

/// Half an ulp, relative.
const U: f64 = 1.0 / (1u64 << 24) as f64;

/// `p` taken back by `m`, with w = 1 for points and 0 for directions: Cramer's rule.
fn back(m: &Matrix, p: [f64; 3], w: f64) -> [f64; 3] {
    let column = |j: usize| [m[0][j], m[1][j], m[2][j]];
    let (a, b, c) = (column(0), column(1), column(2));
    let p = along(p, column(3), -w);
    [dot(p, cross(b, c)), dot(p, cross(c, a)), dot(p, cross(a, b))].map(|x| x / determinant(m))
}

/// Sum of |a_i| |b_i|.
fn size(a: [f64; 3], b: [f64; 3]) -> f64 {
    dot(a.map(f64::abs), b.map(f64::abs))
}

/// A triangle placed in f64; mirrored ones are turned round, so that the front stays the front.
fn placed(m: &Matrix, triangle: &Triangle) -> [[f64; 3]; 3] {
    let [a, b, c] = triangle.map(|v| place(m, wide(v)));
    if determinant(m) < 0.0 { [a, c, b] } else { [a, b, c] }
}

/// Edge 1 × edge 2.
fn normal_of([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    cross(sub(b, a), sub(c, a))
}

/// How far from the nearest edge a hit is.
fn margin(h: &Hit) -> f32 {
    h.u.min(h.v).min(1.0 - h.u - h.v)
}

/// Hits of instances against the plane of the placed triangle in f64, and against a tree of placed triangles.
///
/// With u = 2^−24, o' and d' the ray in the mesh's space, n the triangle's normal there, the traversal errs by rounding o'
/// and d' once (u |o'_i|, u |d'_i| per component), then t; the clamp to the world's box brings t no farther from the truth
/// than the three roundings of a slab distance and the padding:
///
/// |Δt| ≤ u Σ|n_i| (|o'_i| + t |d'_i|) / |n·d'| + 8 u t
///
/// The placed triangle N, V errs by the rounding of its vertices: u Σ|N_i| max|V_i| / |N·d| + 8 u t. (All else is f64; 1 %
/// covers it, and terms of higher order.)
fn compare(
    matrices: &[Matrix],
    mesh: &[Triangle],
    rays: usize,
    normal_tolerance: f64,
    seed: u64,
) -> (usize, usize) {
    let mut rng = Rng::new(seed);
    let places: Vec<_> = matrices.iter().map(|&m| (0, m)).collect();
    let scene = Placement::new("placed", Vec::new(), vec![mesh.to_vec()], &places, Quality::Medium);
    let copies: Vec<[[f64; 3]; 3]> =
        matrices.iter().flat_map(|m| mesh.iter().map(|t| placed(m, t))).collect();
    let rounded: Vec<Triangle> = copies.iter().map(|t| t.map(narrow)).collect();
    let flat = Bvh::build(&rounded, BuildOptions::default()).unwrap();
    let (mut same, mut other) = (0, 0);
    for _ in 0..rays {
        let at = scene.some_triangle(&mut rng);
        // Mostly well inside, where both trees must hit the same triangle.
        let (b, c) = (0.05 + 0.4 * rng.unit(), 0.05 + 0.4 * rng.unit());
        let [p, q, r] = at.map(wide);
        let inner = narrow(along(along(p, sub(q, p), b), sub(r, p), c));
        let target = if rng.below(4) == 0 { point_on(&mut rng, &at) } else { inner };
        let extent = dot(sub(wide(at[1]), wide(at[0])), sub(wide(at[1]), wide(at[0]))).sqrt();
        let origin = narrow(along(wide(target), rng.direction(), extent * rng.magnitude(-1.0, 1.0)));
        let ray = towards(origin, target);
        let (hit, of_copy) = (scene.trees[1].closest_hit(&ray, NoProbe), flat.closest_hit(&ray, NoProbe));
        let (o, d) = (wide(ray.origin), wide(ray.direction));
        let index = |h: &Hit| h.instance as usize * mesh.len() + h.primitive as usize;
        let (Some(h), Some(f)) = (hit, of_copy) else {
            let grazing = |h: Hit| dot(wide(h.normal), unit(d)).abs() < 1e-2;
            assert!(
                hit.or(of_copy).is_none_or(|h| margin(&h) < 1e-2 || grazing(h)),
                "{ray:?} {hit:?} {of_copy:?}"
            );
            other += 1;
            continue;
        };
        if index(&h) != f.primitive as usize {
            let near = margin(&h) < 1e-2 || margin(&f) < 1e-2;
            // Or where two triangles pass through each other.
            let together = (f64::from(h.t) / f64::from(f.t) - 1.0).abs() < 1e-2;
            assert!(near || together, "{ray:?} {h:?} {f:?}");
            other += 1;
            continue;
        }
        same += 1;

        // Where the ray meets the plane.
        let matrix = &matrices[h.instance as usize];
        let triangle = copies[index(&h)];
        let n = normal_of(triangle);
        let t = dot(n, sub(triangle[0], o)) / dot(n, d);
        let n_object = normal_of(mesh[h.primitive as usize].map(wide));
        let (o_object, d_object) = (back(matrix, o, 1.0), back(matrix, d, 0.0));
        let rate = dot(n_object, d_object).abs();
        let grazes = size(n_object, d_object) * U > 1e-3 * rate;
        if !grazes {
            let of_object =
                1.01 * U * (size(n_object, o_object) + t * size(n_object, d_object)) / rate + 8.0 * U * t;
            let error = (f64::from(h.t) - t).abs();
            assert!(error <= of_object, "t off by {error}, more than {of_object}: {ray:?} {h:?}");
            let largest = core::array::from_fn(|i| triangle.iter().map(|v| v[i].abs()).fold(0.0, f64::max));
            let of_copy = 1.01 * U * size(n, largest) / dot(n, d).abs() + 8.0 * U * t;
            let error = (f64::from(h.t) - f64::from(f.t)).abs();
            assert!(error <= of_object + of_copy, "t off by {error} from the copy's: {ray:?} {h:?} {f:?}");
            // Seen from the same side.
            let (side, expected) = (dot(wide(h.normal), d), dot(wide(f.normal), d));
            assert_eq!(side > 0.0, expected > 0.0, "{ray:?} {h:?} {f:?}");
            assert_eq!(side > 0.0, dot(n_object, d_object) > 0.0, "{ray:?} {h:?}");
        }
        let apart = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        assert!(apart(wide(h.normal), unit(n)) < 1e-6, "{h:?} {:?}", unit(n));
        assert!(apart(wide(h.normal), wide(f.normal)) < normal_tolerance, "{h:?} {f:?}");
    }
    (same, other)
}

#[test]
fn instances_lie_where_copies_lie() {
    let mut rng = Rng::new(100);
    let meshes = [
        icosphere(2, 0.5, 1.0).triangles(),
        soup(&mut rng, 50, 0.8),
        grid_box("box", 3, 0.0, [1.0, 2.0, 0.5]).triangles(),
    ];
    // Decades of scale, shear, distance, and how well the copies' normals survive the rounding of vertices.
    let cases =
        [(0.0, 0.0, 5.0, 1e-5), (0.3, 0.5, 3.0, 1e-5), (0.5, 1.0, 10.0, 1e-4), (1.0, 1.0, 1000.0, 1e-1)];
    for (decades, shear, far, tolerance) in cases {
        for (seed, mesh) in meshes.iter().enumerate() {
            let matrices: Vec<_> = (0..8).map(|_| affine(&mut rng, decades, shear, far)).collect();
            let (same, other) = compare(&matrices, mesh, 1500, tolerance, seed as u64);
            assert!(
                same > 1000 && other * 4 < same,
                "{same} alike, {other} not, with {decades} {shear} {far}"
            );
        }
    }
}

/// Known by hand: a mirrored triangle's normal stays on its front, a stretched one's turns as planes do.
#[test]
fn normals_by_hand() {
    let triangle = vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0f32]]];
    let normal = |to_world: Matrix, from: [f64; 3]| {
        let bvh = Bvh::build_instanced(
            &[],
            core::slice::from_ref(&triangle),
            &[Instance { mesh: 0, to_world }],
            BuildOptions::default(),
        )
        .unwrap();
        let target = place(&to_world, [0.25, 0.25, 0.0]);
        let origin = place(&to_world, from);
        bvh.closest_hit(&towards(narrow(origin), narrow(target)), NoProbe).unwrap().normal
    };
    for from in [[0.2, 0.3, 1.0], [0.2, 0.3, -1.0]] {
        assert_eq!(normal(scaling(1.0, 1.0, 1.0), from), [0.0, 0.0, 1.0]);
        // Mirrored along x: the front still faces +z. Mirrored along z: it faces −z.
        assert_eq!(normal(scaling(-1.0, 1.0, 1.0), from), [0.0, 0.0, 1.0]);
        assert_eq!(normal(scaling(1.0, 1.0, -2.0), from), [0.0, 0.0, -1.0]);
        // z' = z + x: the plane z' = x', whose normal is (−1, 0, 1) / √2.
        let sheared = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0]];
        let half = 0.5f64.sqrt() as f32;
        assert_eq!(normal(sheared, from), [-half, 0.0, half]);
        // x to y, y to z, z to x.
        let turned = [[0.0, 0.0, 1.0, 5.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -2.0]];
        assert_eq!(normal(turned, from), [1.0, 0.0, 0.0]);
    }
}

/// Instances of closed meshes, and rays from within at points, edges and vertices, and from without through such a point
/// into the middle. Returns the leaks.
fn leaks(matrices: usize, count: usize) -> Vec<String> {
    let mut rng = Rng::new(101);
    let mut leaks = Vec::new();
    let meshes: Vec<Mesh> = [(0.0, 1.0), (1e3, 1.0)]
        .into_iter()
        .flat_map(|(centre, radius)| {
            [
                icosphere(2, centre, radius),
                uv_sphere(12, 24, centre, radius),
                grid_box("cube", 1, centre, [radius; 3]),
                grid_box("slab", 4, centre, [radius, radius * 0.05, radius]),
            ]
        })
        .collect();
    for mesh in &meshes {
        let triangles = mesh.triangles();
        for far in [0.0, 10.0, 1e3] {
            let places: Vec<_> = (0..matrices).map(|_| (0, affine(&mut rng, 0.5, 0.5, far))).collect();
            let together =
                Placement::new("together", Vec::new(), vec![triangles.clone()], &places, Quality::Medium);
            for place_of in &places {
                let alone = Placement::new(
                    "alone",
                    Vec::new(),
                    vec![triangles.clone()],
                    &[*place_of],
                    Quality::Medium,
                );
                let matrix = &place_of.1;
                for _ in 0..count {
                    let at = *rng.pick(&triangles);
                    let target = wide(point_on(&mut rng, &at));
                    let inner = wide(mesh.inner_point(&mut rng));
                    let outside = rng.coin();
                    let from = if outside {
                        along(target, sub(target, inner), 0.5 + 2.0 * rng.unit())
                    } else {
                        inner
                    };
                    let origin = narrow(place(matrix, from));
                    let mut direction = sub(place(matrix, target), wide(origin));
                    match rng.below(3) {
                        0 => {}
                        1 => direction = unit(direction),
                        _ => {
                            let scale = rng.magnitude(-3.0, 3.0);
                            direction = direction.map(|c| c * scale);
                        }
                    }
                    let ray = Ray::new(origin, narrow(direction));
                    for tree in &alone.trees {
                        let hit = tree.closest_hit(&ray, NoProbe);
                        let side = hit.map(|h| dot(wide(h.normal), wide(ray.direction)) < 0.0);
                        if side != Some(outside) || !tree.occluded(&ray, NoProbe) {
                            leaks.push(format!(
                                "{} outside: {outside}: {ray:?} {hit:?} {matrix:?}",
                                mesh.name
                            ));
                        }
                        let among = together.trees[1].closest_hit(&ray, NoProbe);
                        if among.is_none_or(|a| hit.is_some_and(|h| h.t < a.t)) {
                            leaks.push(format!("{} among others: {ray:?} {hit:?} {among:?}", mesh.name));
                        }
                    }
                }
            }
        }
    }
    leaks
}

/// 24 cells (8 meshes × 3 distances) of 6 matrices with 400 rays: 6 · 10^4.
#[test]
fn closed_meshes_do_not_leak_wherever_they_are_placed() {
    let leaks = leaks(6, 400);
    assert!(leaks.is_empty(), "{} leaks; the first: {}", leaks.len(), leaks[0]);
}

/// 10^7 rays.
#[test]
#[ignore = "a minute in release: 1e7 rays"]
fn closed_meshes_do_not_leak_wherever_they_are_placed_in_full() {
    let leaks = leaks(40, 10_000);
    assert!(leaks.is_empty(), "{} leaks; the first: {}", leaks.len(), leaks[0]);
}

/// A floor of 8 × 8 instances of one square tile that touch, put down by `frame` after being laid out.
fn floor(layout: f64, frame: &Matrix) -> Bvh {
    let places: Vec<_> = (0..64)
        .map(|i| {
            let (x, y) = (f64::from(i % 8) * layout, f64::from(i / 8) * layout);
            let at = translation(x, y, 0.0);
            let tile: Matrix = core::array::from_fn(|row| {
                let mut out = [0.0; 4];
                for (column, out) in out.iter_mut().enumerate() {
                    let m = |k: usize| if column < 3 { at[k][column] * layout } else { at[k][3] };
                    *out = frame[row][0] * m(0) + frame[row][1] * m(1) + frame[row][2] * m(2);
                }
                out[3] += frame[row][3];
                out
            });
            Instance { mesh: 0, to_world: tile }
        })
        .collect();
    Bvh::build_instanced(&[], &[tiles(1)], &places, BuildOptions::default()).unwrap()
}

/// Floors: tiles on whole numbers, on multiples of 0.1, and turned and moved.
fn floors() -> [(&'static str, f64, Matrix); 4] {
    let r = rotation(&mut Rng::new(102));
    let turned = |far: f64| core::array::from_fn(|i| [r[i][0], r[i][1], r[i][2], far * (i as f64 + 0.3)]);
    [
        ("whole numbers", 1.0, translation(0.0, 0.0, 0.0)),
        ("multiples of 0.1", 0.1, translation(0.0, 0.0, 0.0)),
        ("turned", 1.0, turned(0.0)),
        ("turned, 100 tiles away", 1.0, turned(100.0)),
    ]
}

/// A ray from above at a point of the floor that lies `off` tiles beside a seam.
fn ray_at_seam(rng: &mut Rng, layout: f64, frame: &Matrix, off: f64) -> Ray {
    let seam = 1.0 + rng.below(7) as f64 + if rng.coin() { off } else { -off };
    // Not at a corner, unless the seam itself is aimed at.
    let other = rng.below(8) as f64 + 0.01 + 0.98 * rng.unit();
    let (x, y) = if rng.coin() { (seam, other) } else { (other, seam) };
    let target = [x * layout, y * layout, 0.0];
    let mut up = rng.direction();
    up[2] = up[2].abs() + 0.2;
    let origin = narrow(place(frame, along(target, up, layout * rng.magnitude(-1.0, 1.5))));
    Ray::new(origin, narrow(sub(place(frame, target), wide(origin))))
}

/// Between two instances that touch, a ray may pass: each takes it into its own space and rounds it there. Measured, of
/// 10^6 rays aimed at the seams of each floor, none where the tiles lie on whole numbers, 5 where they lie on multiples of
/// 0.1, 4.2 % where the floor is turned by arbitrary angles, near or far; 10^−7 of a tile beside the seam 0.4 %, 10^−6
/// beside it 0.03 %, 10^−5 beside it none. (Triangles of the world that share vertices let none pass.) Rays aimed 10^−4 of a tile beside the seam never pass
/// ([`seams_are_narrow`]).
#[test]
#[ignore = "measures, asserts nothing: run with --nocapture"]
#[expect(clippy::print_stdout, reason = "the measurement is its output")]
fn share_of_rays_that_pass_between_instances_that_touch() {
    for (name, layout, frame) in floors() {
        let bvh = floor(layout, &frame);
        let mut rng = Rng::new(103);
        let count = 1_000_000;
        for off in [0.0, 1e-7, 1e-6, 1e-5] {
            let passes =
                |_: &u32| bvh.closest_hit(&ray_at_seam(&mut rng, layout, &frame, off), NoProbe).is_none();
            let passed = (0..count).filter(passes).count();
            println!("{name}, {off} beside: {passed} of {count}");
        }
    }
}

/// The gap between two instances that touch is a matter of rounding: rays 10^−4 of a tile beside the seam never pass, and
/// of those at the seam most do not.
#[test]
fn seams_are_narrow() {
    for (name, layout, frame) in floors() {
        let bvh = floor(layout, &frame);
        let mut rng = Rng::new(104);
        for _ in 0..20_000 {
            let ray = ray_at_seam(&mut rng, layout, &frame, 1e-4);
            assert!(
                bvh.closest_hit(&ray, NoProbe).is_some() && bvh.occluded(&ray, NoProbe),
                "{name} {ray:?}"
            );
        }
        // Their interior is sound: turned by the frame, moved, but never lost.
        let inside = turn(&frame, [0.0, 0.0, 1.0]);
        for _ in 0..1000 {
            let at = [8.0 * rng.unit(), 8.0 * rng.unit(), 0.0];
            if at.iter().take(2).any(|c| (c - c.round()).abs() < 1e-3) {
                continue;
            }
            let target = place(&frame, at.map(|c| c * layout));
            let ray = Ray::new(narrow(along(target, inside, layout)), narrow(inside.map(|c| -c)));
            let hit = bvh.closest_hit(&ray, NoProbe).unwrap();
            assert_eq!(hit.instance, at[0] as u32 + 8 * at[1] as u32, "{name} {ray:?}");
            assert!((f64::from(hit.t) - layout).abs() < 1e-4 * layout, "{name} {ray:?}");
        }
    }
}
