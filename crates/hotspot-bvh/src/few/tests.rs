use super::*;
use crate::oracle;
use crate::random::Random;
use crate::simd::{F8, Isa, U8, WithSimd, dispatch};
use crate::{Hit, NO_INSTANCE, Ray};

/// Eight rays against the triangles, in one instruction set: what is hit, and what is blocked.
struct Ask<'a> {
    few: &'a FewTriangles,
    rays: &'a [Ray; 8],
    except: [[u32; 8]; 2],
}

impl WithSimd for Ask<'_> {
    type Output = ([Option<Hit>; 8], u32, Blocked);
    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Self::Output {
        let vectors = |of: fn(&Ray) -> [f32; 3]| {
            let component = |i: usize| F8(core::array::from_fn(|lane| of(&self.rays[lane])[i]));
            Vectors::load(s, &[component(0), component(1), component(2)])
        };
        let rays = Rays { origin: vectors(|r| r.origin), direction: vectors(|r| r.direction) };
        let [from, to] = self.except.map(|e| Integers::load(s, &U8(e)));
        let Tried { hits, doubtful } = self.few.closest_hits(s, &rays, from, 0xff);
        let [primitive] = [hits.primitive].map(|i| i.store().0);
        let [t, u, v] = [hits.t, hits.u, hits.v].map(|f| f.store().0);
        let normal = hits.normal.store();
        let found = core::array::from_fn(|lane| {
            (hits.found >> lane & 1 != 0).then(|| Hit {
                t: t[lane],
                u: u[lane],
                v: v[lane],
                primitive: primitive[lane],
                instance: NO_INSTANCE,
                normal: [0, 1, 2].map(|i| normal[i].0[lane]),
            })
        });
        (found, doubtful, self.few.blocked(s, &rays, [from, to], 0xff))
    }
}

/// A box of twelve triangles, corners as given by `place`.
fn cuboid(place: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[[f32; 3]; 3]> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                place(p).map(|x| x as f32)
            };
            let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

/// A room with a roof and three boxes in it, one turned around an axis and one altogether, and some triangles of any shape.
pub(super) fn room(random: &mut Random, scale: f64) -> Vec<[[f32; 3]; 3]> {
    let mut all = cuboid(|p| p.map(|x| x * scale));
    all.extend(cuboid(|[x, y, z]| [0.2 + 0.2 * x, 0.02 + 0.3 * y, 0.3 + 0.25 * z].map(|x| x * scale)));
    all.extend(cuboid(|[x, y, z]| {
        [0.6 + 0.25 * x - 0.1 * z, 0.01 + 0.6 * y, 0.4 + 0.1 * x + 0.25 * z].map(|x| x * scale)
    }));
    all.extend(cuboid(|[x, y, z]| {
        [0.1 + 0.1 * x + 0.05 * y, 0.7 + 0.03 * x + 0.1 * y - 0.04 * z, 0.1 + 0.02 * x + 0.1 * z]
            .map(|x| x * scale)
    }));
    let [a, b, c, d] = [[0.3, 0.9, 0.3], [0.3, 0.92, 0.7], [0.7, 0.97, 0.7], [0.7, 0.95, 0.3]]
        .map(|corner: [f64; 3]| corner.map(|x| (x * scale) as f32));
    all.extend([[a, b, c], [a, c, d]]);
    for _ in 0..6 {
        all.push([0; 3].map(|_| [0; 3].map(|_| (0.5 + 0.5 * random.signed()) * scale as f32)));
    }
    all
}

/// Hits, misses and blocks that are sure are those of a loop over all triangles with the exact rules, bit for bit, at every scale for
/// which the equations hold and in every instruction set; and few rays are doubtful.
#[test]
fn what_is_sure_is_what_the_exact_rules_say() {
    let mut random = Random(7);
    let (mut asked, mut doubtful, mut hit, mut stopped) = (0u32, 0, 0, 0);
    for scale in [1e-5, 0.01, 1.0, 37.0, 1e5] {
        for _ in 0..4 {
            let triangles = room(&mut random, scale);
            let Some(few) = FewTriangles::new(&triangles, 0.0) else { continue };
            let count = |of: fn(&Faces) -> usize| few.faces.iter().map(of).sum::<usize>();
            let quadrangles = [count(|f| f.quadrangles.len()), count(|f| f.level_quadrangles.len())];
            assert_eq!(quadrangles, [6, 2]);
            let rectangles = [
                count(|f| f.rectangles[0].len()),
                count(|f| f.rectangles[1].len()),
                count(|f| f.rectangles[2].len()),
                count(|f| f.rectangles[3].len()),
            ];
            assert_eq!(rectangles, [12, 2, 2, 1]);
            for round in 0..500 {
                let mut except = [[NONE; 8]; 2];
                let rays: [Ray; 8] = core::array::from_fn(|lane| {
                    let mut point = || [0; 3].map(|_| (0.5 + 0.5 * random.signed()) * scale as f32);
                    let (from, mut to) = (point(), point());
                    if round % 4 == 3 {
                        // At an edge, or beside it by some roundings.
                        let triangle = triangles[(round * 8 + lane) % triangles.len()];
                        let along = 0.5 + 0.5 * random.signed();
                        let beside =
                            1e-6 * scale as f32 * random.signed() * random.signed() * random.signed();
                        to = [0, 1, 2].map(|i| {
                            let [a, b, c] = [0, 1, 2].map(|k| triangle[(lane + k) % 3][i]);
                            a + (b - a) * along + (c - a) * beside / scale as f32
                        });
                    }
                    let mut ray = Ray::new(from, [0, 1, 2].map(|i| to[i] - from[i]));
                    if round % 4 == 1 {
                        // Along an axis or two.
                        ray.direction[lane % 3] = 0.0;
                    }
                    ray
                });
                if round % 2 == 1 {
                    except[0] = core::array::from_fn(|lane| (round + lane) as u32 % triangles.len() as u32);
                    except[1] = except[0].map(|e| (e * 7 + 3) % triangles.len() as u32);
                }
                let ask = || Ask { few: &few, rays: &rays, except };
                let (hits, unsure, blocked) = dispatch(Isa::Auto, ask());
                let portable = dispatch(Isa::Portable, ask());
                assert_eq!((hits, unsure), (portable.0, portable.1));
                assert_eq!((blocked.surely, blocked.doubtful), (portable.2.surely, portable.2.doubtful));
                for lane in 0..8 {
                    let excepted = |ends: usize| {
                        let (mut left, mut numbers) = (Vec::new(), Vec::new());
                        for (number, triangle) in (0u32..).zip(&triangles) {
                            if (0..ends).all(|e| except[e][lane] != number) {
                                left.push(*triangle);
                                numbers.push(number);
                            }
                        }
                        (left, numbers)
                    };
                    asked += 2;
                    let bit = |bits: u32| bits >> lane & 1 != 0;
                    if bit(unsure) {
                        doubtful += 1;
                    } else {
                        let (left, numbers) = excepted(1);
                        let expected = oracle::brute_force(&left, &rays[lane])
                            .map(|hit| Hit { primitive: numbers[hit.primitive as usize], ..hit });
                        assert_eq!(hits[lane], expected, "{:?} at {scale}", rays[lane]);
                        hit += u32::from(expected.is_some());
                    }
                    if bit(blocked.doubtful) {
                        doubtful += 1;
                    } else {
                        let shadow = Ray { t_max: 1.0, ..rays[lane] };
                        let expected = oracle::brute_force(&excepted(2).0, &shadow).is_some();
                        assert_eq!(bit(blocked.surely), expected, "{shadow:?} at {scale}");
                        stopped += u32::from(expected);
                    }
                }
            }
        }
    }
    assert!(hit > asked / 4 && stopped > asked / 20, "{hit} hits and {stopped} blocks of {asked}");
    // Rays along axes, a quarter of all, run along walls, and whether they ever meet them is doubtful; so are those at edges.
    assert!(doubtful < asked / 2, "{doubtful} of {asked} doubtful");
}

/// Without those along axes: some in ten thousand.
#[test]
fn few_rays_are_doubtful() {
    let mut random = Random(3);
    let triangles = room(&mut random, 1.0);
    let few = FewTriangles::new(&triangles, 0.0).expect("regular");
    let (mut asked, mut doubtful) = (0, 0);
    for _ in 0..5000 {
        let rays: [Ray; 8] = core::array::from_fn(|_| {
            let mut point = || [0; 3].map(|_| 0.5 + 0.5 * random.signed());
            let (from, to) = (point(), point());
            Ray::new(from, [0, 1, 2].map(|i| to[i] - from[i]))
        });
        let (_, unsure, blocked) =
            dispatch(Isa::Auto, Ask { few: &few, rays: &rays, except: [[NONE; 8]; 2] });
        asked += 16;
        doubtful += unsure.count_ones() + blocked.doubtful.count_ones();
    }
    assert!(doubtful * 1000 < asked, "{doubtful} of {asked}");
}

/// What is no number, or beyond the bounds, is left to the tree.
#[test]
fn strange_rays_are_doubtful() {
    let triangles = cuboid(|p| p);
    let few = FewTriangles::new(&triangles, 0.0).expect("regular");
    let inside = [0.4, 0.5, 0.6];
    let strange = [
        Ray::new([f32::NAN, 0.5, 0.5], [0.3, 0.4, 0.5]),
        Ray::new(inside, [f32::NAN, 0.4, 0.5]),
        Ray::new(inside, [0.3, f32::NAN, 0.5]),
        Ray::new(inside, [0.3, 0.4, f32::INFINITY]),
        Ray::new(inside, [0.0; 3]),
        Ray::new([0.5, f32::INFINITY, 0.5], [0.3, -0.4, 0.5]),
        Ray::new([0.5, 0.5, 2.0], [0.1, 0.2, -1.0]),
        Ray::new([-1e30, 0.5, 0.5], [1.0, 0.001, 0.002]),
    ];
    let (hits, doubtful, blocked) =
        dispatch(Isa::Auto, Ask { few: &few, rays: &strange, except: [[NONE; 8]; 2] });
    assert_eq!((hits, doubtful), ([None; 8], 0xff));
    assert_eq!((blocked.surely, blocked.doubtful), (0, 0xff));
    // One wall alone, whose distance does not depend on all that is no number.
    for wall in triangles.chunks(2) {
        let few = FewTriangles::new(wall, 0.0).expect("regular");
        let rays = core::array::from_fn(|lane| {
            let mut direction = if lane < 3 { [0.9, 1.0, 1.1] } else { [-0.9, -1.0, -1.1] };
            direction[lane % 3] = f32::NAN;
            Ray::new(inside, direction)
        });
        let (hits, doubtful, blocked) =
            dispatch(Isa::Auto, Ask { few: &few, rays: &rays, except: [[NONE; 8]; 2] });
        assert_eq!((hits, doubtful), ([None; 8], 0xff));
        assert_eq!((blocked.surely, blocked.doubtful), (0, 0xff));
    }
}

#[test]
fn only_few_and_regular_triangles_are_taken() {
    let triangle = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    let many = |n: usize| (0..n).map(|i| triangle(i as f32)).collect::<Vec<_>>();
    assert!(FewTriangles::new(&many(1), 0.0).is_some());
    assert!(FewTriangles::new(&many(FewTriangles::MOST), 0.0).is_some());
    assert!(FewTriangles::new(&many(FewTriangles::MOST + 1), 0.0).is_none());
    assert!(FewTriangles::new(&[], 0.0).is_none());
    for reach in [1e7, f32::INFINITY, f32::NAN] {
        assert!(FewTriangles::new(&many(1), reach).is_none() || reach.is_nan(), "{reach}");
    }
    let needle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-5, 0.0]];
    let degenerate = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let broken = [[0.0, f32::NAN, 0.0], [1.0, 0.0, 0.0], [2.0, 1.0, 0.0]];
    for bad in [needle, degenerate, broken] {
        assert!(FewTriangles::new(&[triangle(0.0), bad], 0.0).is_none(), "{bad:?}");
    }
}
