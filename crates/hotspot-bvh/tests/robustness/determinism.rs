//! The same triangles give the same tree: on every build, in every thread pool, for every instruction set. (That the
//! instruction sets give the same hits and counts, `Scene::check` tests for every ray of every room.)

use crate::meshes::icosphere;
use crate::support::{QUALITIES, Rng, Triangle, bits, narrow, scaled, soup};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh, NoProbe, Quality, Ray};

/// FNV-1a over the words of a tree.
fn hash(triangles: &[Triangle], options: BuildOptions) -> u64 {
    let bvh = Bvh::build(triangles, options).unwrap();
    bvh.words().fold(0xcbf2_9ce4_8422_2325, |h, word| (h ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3))
}

fn scenes() -> [Vec<Triangle>; 4] {
    let mut rng = Rng::new(50);
    let mut doubled = soup(&mut rng, 300, 0.2);
    doubled.extend_from_within(..);
    // Large enough for a parallel sort to split its work.
    [soup(&mut rng, 30_000, 0.02), icosphere(4, 0.0, 1.0).triangles(), doubled, vec![[[1.0; 3]; 3]; 700]]
}

#[test]
fn trees_do_not_depend_on_threads_or_repetition() {
    for triangles in scenes() {
        for quality in QUALITIES {
            let options = BuildOptions { quality, ..Default::default() };
            let expected = hash(&triangles, options);
            for threads in [1, 2, 7] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                for _ in 0..2 {
                    assert_eq!(pool.install(|| hash(&triangles, options)), expected, "{quality:?} {threads}");
                }
            }
        }
    }
}

/// Around the numbers of triangles from which on loops are shared out and of their pieces; where all boxes or centres are equal, where
/// each triangle is there twice, where the tree is deep on one side.
#[test]
fn trees_do_not_depend_on_where_loops_are_cut() {
    let pools = [1, 2, 3, 7].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for count in [4095, 4096, 4097, 5120, 5121, 12_289] {
        let mut rng = Rng::new(count as u64);
        let mut doubled = soup(&mut rng, count / 2, 0.1);
        doubled.extend_from_within(..);
        let around_one_centre = |i: usize| {
            let r = 0.5 + (i % 977) as f32;
            [[-r, -r, 0.0], [r, r, 0.0], [0.0; 3]]
        };
        let ever_larger = |i: usize| {
            let s = 1.005f32.powi(i as i32 % 4000);
            [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]]
        };
        let scenes = [
            ("soup", soup(&mut rng, count, 0.02)),
            ("doubled", doubled),
            ("points", vec![[[2.0; 3]; 3]; count]),
            ("equal", vec![[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; count]),
            ("around one centre", (0..count).map(around_one_centre).collect()),
            ("ever larger", (0..count).map(ever_larger).collect()),
        ];
        for (name, triangles) in &scenes {
            // The longest searches once: they take their time.
            let qualities: &[Quality] = if count == 5121 { &QUALITIES } else { &QUALITIES[..2] };
            for &quality in qualities {
                let options = BuildOptions { quality, ..Default::default() };
                let [alone, shared @ ..] =
                    pools.each_ref().map(|pool| pool.install(|| hash(triangles, options)));
                assert!(shared == [alone; 3], "{count} {name} {quality:?}");
            }
        }
    }
}

/// Builds that run at the same time do not disturb each other.
#[test]
fn trees_do_not_depend_on_concurrent_builds() {
    let triangles = &scenes()[2];
    let expected = hash(triangles, BuildOptions::default());
    std::thread::scope(|scope| {
        let builds: Vec<_> =
            (0..4).map(|_| scope.spawn(|| hash(triangles, BuildOptions::default()))).collect();
        for build in builds {
            assert_eq!(build.join().unwrap(), expected);
        }
    });
}

#[test]
fn trees_do_not_depend_on_the_instruction_set() {
    for triangles in scenes() {
        let hash =
            |isa| hash(&triangles, BuildOptions { quality: Quality::Medium, isa, ..Default::default() });
        assert_eq!(hash(Isa::Portable), hash(Isa::Auto));
    }
}

/// Scaling a scene by a power of two changes no decision of the builder, also where areas would overflow f32.
#[test]
fn topology_does_not_depend_on_the_scale() {
    let unit = soup(&mut Rng::new(52), 2000, 0.1);
    for quality in QUALITIES {
        let blocks = |exponent: i32| {
            let scaled = scaled(&unit, 2f64.powi(exponent));
            let bvh = Bvh::build(&scaled, BuildOptions { quality, ..Default::default() }).unwrap();
            let held = |b| bvh.block_triangles(b).collect::<Vec<_>>();
            (bvh.node_count(), (0..bvh.block_count() as u32).map(held).collect::<Vec<_>>())
        };
        let expected = blocks(0);
        for exponent in [-20, 20, 60, 100, 125] {
            assert!(blocks(exponent) == expected, "{quality:?} 2^{exponent}");
        }
    }
}

/// The hash notices a change of one coordinate and of the order.
#[test]
fn words_tell_trees_apart() {
    let triangles = soup(&mut Rng::new(51), 100, 0.2);
    let expected = hash(&triangles, BuildOptions::default());
    let mut moved = triangles.clone();
    moved[17][1][2] += 0.5;
    assert_ne!(hash(&moved, BuildOptions::default()), expected);
    let mut swapped = triangles;
    swapped.swap(3, 80);
    assert_ne!(hash(&swapped, BuildOptions::default()), expected);
}

/// Shuffled trees are other trees with the same hits: what they cost is how much the tree's luck is worth.
#[test]
fn shuffled_trees_hit_the_same_and_count_otherwise() {
    for triangles in &scenes()[..3] {
        let plain = Bvh::build(triangles, BuildOptions::default()).unwrap();
        let mut trees = std::collections::BTreeSet::from([hash(triangles, BuildOptions::default())]);
        for shuffle in 1..4 {
            let options = BuildOptions { shuffle: Some(shuffle), ..Default::default() };
            assert_eq!(hash(triangles, options), hash(triangles, options));
            assert!(trees.insert(hash(triangles, options)), "shuffle {shuffle} changes nothing");
            let shuffled = Bvh::build(triangles, options).unwrap();
            let mut rng = Rng::new(shuffle);
            for _ in 0..300 {
                let origin = narrow(rng.cube().map(|c| 1.5 * c));
                let ray = Ray::new(origin, narrow(rng.direction()));
                assert_eq!(bits(plain.closest_hit(&ray, NoProbe)), bits(shuffled.closest_hit(&ray, NoProbe)));
                assert_eq!(plain.occluded(&ray, NoProbe), shuffled.occluded(&ray, NoProbe));
            }
        }
    }
}
