use super::*;
use crate::testing::Random;
use crate::{Cause, Counter, Frame, FrameDesc, PathEnd};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};
use std::collections::BTreeMap;

/// Of a tree of so many nodes and blocks over `objects` objects, some of them mixed, some of them of instances.
fn desc(objects: u32, size: u32, random: &mut Random) -> PayerDesc {
    let mut payer = |leaf: bool| match random.below(4) {
        0 => Payer::Scene(
            // A block without triangles is nobody's, and a visit of it tests none.
            (0..if leaf { random.below(9) } else { 0 }).map(|_| random.below(objects)).collect(),
        ),
        1 => Payer::Instance,
        _ => Payer::Object(random.below(objects)),
    };
    let nodes = (0..size).map(|_| payer(false)).collect();
    let blocks = (0..size).map(|_| payer(true)).collect();
    PayerDesc {
        nodes,
        blocks,
        instances: (0..5).map(|_| random.below(objects)).collect(),
        triangles: (0..objects).map(|_| u64::from(random.below(9))).collect(),
        lights: (0..objects).filter(|_| random.below(2) == 0).collect(),
    }
}

/// Object, material, bounce, kind, light.
type SpawnerKey = (Option<u32>, Option<u32>, u32, SpawnerKind, Option<u32>);

/// Books by the definition, ray by ray and count by count.
#[derive(Default)]
struct Oracle {
    spawner: BTreeMap<SpawnerKey, ([u64; 3], Traversal)>,
    /// What was met, and paths that went on from there.
    matrix: BTreeMap<(Option<u32>, Option<u32>), (Traversal, u64)>,
}

impl Oracle {
    fn event(&mut self, by: Spawner, payer: Option<u32>, what: impl Fn(&mut Traversal)) {
        what(&mut self.row(by).1);
        what(&mut self.matrix.entry(((by.object != NONE).then_some(by.object), payer)).or_default().0);
    }

    fn row(&mut self, by: Spawner) -> &mut ([u64; 3], Traversal) {
        let id = |id: u32| (id != NONE).then_some(id);
        let key = (id(by.object), id(by.material), by.bounce.min(31), by.kind.into(), id(by.light));
        self.spawner.entry(key).or_default()
    }
}

fn some_spawner(objects: u32, random: &mut Random) -> Spawner {
    let kind = [RayKind::Camera, RayKind::Bounce, RayKind::Shadow][random.below(3) as usize];
    if kind == RayKind::Camera {
        return Spawner::CAMERA;
    }
    let light = if kind == RayKind::Shadow && random.below(3) > 0 { random.below(objects) } else { NONE };
    Spawner {
        object: random.below(objects),
        material: random.below(3),
        bounce: random.below(50),
        kind,
        light,
    }
}

/// A frame of paths of one to four random rays in a tree of 40 nodes and blocks, booked both ways: what the ledger says, and the oracle.
fn booked(objects: u32, paths: u32, workers: usize, seed: u64) -> (Frame, Ledgers, Oracle, PayerDesc) {
    booked_in(40, objects, paths, workers, seed)
}

/// The same in a tree of `size` nodes and blocks.
fn booked_in(
    size: u32,
    objects: u32,
    paths: u32,
    workers: usize,
    seed: u64,
) -> (Frame, Ledgers, Oracle, PayerDesc) {
    let mut random = Random::new(seed);
    let desc = desc(objects, size, &mut random);
    let payers = Payers::new(&desc);
    let mut ledgers: Vec<Ledger> = (0..workers).map(|_| Ledger::new(&payers)).collect();
    let mut frame = Frame::new(FrameDesc::new(1, 1));
    let mut oracle = Oracle::default();
    for index in 0..paths {
        let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
        let mut visit = ledgers[index as usize % workers].visit(&payers, pixel.visit());
        let mut path = visit.path();
        let mut left = None;
        for _ in 0..=random.below(4) {
            let by = some_spawner(objects, &mut random);
            oracle.row(by).0[0] += 1;
            let untraced = random.below(20) == 0;
            if by.kind == RayKind::Bounce && !untraced {
                oracle.matrix.entry((left, Some(by.object))).or_default().1 += 1;
                left = Some(by.object);
            }
            if untraced {
                path.untraced(by);
            } else {
                let mut ray = path.ray(by);
                let (mut inside, mut block, mut cost) = (None, None, 0);
                for _ in 0..random.below(12) {
                    let id = random.below(size);
                    match random.below(4) {
                        0 => {
                            let instance = random.below(5);
                            ray.instance(instance);
                            inside = Some(desc.instances[instance as usize]);
                            oracle.event(by, inside, |t| t.instances += 1);
                        }
                        1 if block.is_some() => {
                            ray.alpha(1, 4);
                            oracle.event(by, block.unwrap(), |t| t.alpha_tests += 1);
                        }
                        2 => {
                            let payer = match &desc.nodes[id as usize] {
                                Payer::Object(object) => Some(*object),
                                Payer::Scene(_) => None,
                                Payer::Instance => inside,
                            };
                            // Seldom as many as foreign trees might claim.
                            let boxes = [5, 8, 0, 254, 255, u32::MAX, 1 << 31, 1 << 28, (1 << 31) - 1]
                                [random.below(62).saturating_sub(53) as usize];
                            ray.node(id, boxes);
                            cost += 1;
                            oracle.event(by, payer, |t| {
                                t.nodes += 1;
                                t.boxes += u64::from(boxes);
                            });
                        }
                        _ => {
                            let (payer, triangles) = match &desc.blocks[id as usize] {
                                Payer::Object(object) => (Some(*object), vec![Some(*object); 6]),
                                Payer::Scene(triangles) => {
                                    (None, triangles.iter().map(|t| Some(*t)).collect())
                                }
                                Payer::Instance => (inside, vec![inside; 6]),
                            };
                            ray.leaf(id, triangles.len() as u32);
                            cost += triangles.len() as u64;
                            block = Some(payer);
                            oracle.event(by, payer, |t| t.leaves += 1);
                            for triangle in triangles {
                                oracle.event(by, triangle, |t| t.shapes += 1);
                            }
                        }
                    }
                }
                let hit = random.below(2) == 0;
                ray.finish(hit);
                oracle.row(by).0[1] += u64::from(hit);
                oracle.row(by).0[2] += if hit && by.kind == RayKind::Shadow { cost } else { 0 };
            }
        }
        path.end(PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 0 });
    }
    let sum = ledgers.into_iter().reduce(|mut sum, other| {
        sum.merge(&other);
        sum
    });
    let names: Vec<String> = (0..objects).map(|o| format!("object {o}")).collect();
    let materials = ["a", "b", "c"].map(String::from);
    (frame, sum.unwrap().rows(&payers, &names, &materials), oracle, desc)
}

/// The ledgers' sums are the frame's.
fn assert_totals(frame: &Frame, ledgers: &Ledgers) {
    let all = frame.cost_total(0, 0);
    let expected = Traversal {
        nodes: all.get(Counter::Nodes),
        boxes: all.get(Counter::Boxes),
        leaves: all.get(Counter::Leaves),
        shapes: all.get(Counter::Shapes),
        instances: all.get(Counter::Instances),
        alpha_tests: all.get(Counter::AlphaTests),
    };
    let sum = |rows: &mut dyn Iterator<Item = Traversal>| {
        rows.fold(Traversal::default(), |mut sum, row| {
            sum.add(&row);
            sum
        })
    };
    assert_eq!(sum(&mut ledgers.spawner.iter().map(|row| row.traversal)), expected);
    assert_eq!(sum(&mut ledgers.payer.iter().map(|row| row.traversal)), expected);
    assert_eq!(sum(&mut ledgers.matrix.iter().map(|row| row.traversal)), expected);
    assert_eq!(ledgers.spawner.iter().map(|row| row.rays).sum::<u64>(), all.get(Counter::Rays));
    // Every path brought light: wasted is what blocked shadow rays visited.
    let wasted = all.get(Counter::WasteNodes) + all.get(Counter::WasteShapes);
    assert_eq!(ledgers.spawner.iter().map(|row| row.blocked).sum::<u64>(), wasted);
    assert!(expected.instances > 0 && expected.alpha_tests > 0 && wasted > 0);
}

#[test]
fn ledgers_agree_with_the_oracle_row_by_row() {
    // The last tree has more sets of objects in its blocks than there are columns.
    for (size, objects, workers, seed) in [(40, 1, 1, 1), (40, 7, 3, 2), (40, 60, 2, 3), (6000, 60, 2, 7)] {
        let (frame, ledgers, oracle, desc) = booked_in(size, objects, 8000, workers, seed);
        assert_totals(&frame, &ledgers);
        assert!(desc.lights.len() <= 64 && ledgers.merged_objects == 0);
        // Lights of which the renderer did not say that they are lights share an entry.
        let shared = |light: Option<u32>| light.map(|l| if desc.lights.contains(&l) { l } else { objects });
        let mut expected: BTreeMap<_, ([u64; 3], Traversal)> = BTreeMap::new();
        for ((object, material, bounce, kind, light), (counts, traversal)) in &oracle.spawner {
            let row = expected.entry((*object, *material, *bounce, *kind, shared(*light))).or_default();
            for (sum, count) in row.0.iter_mut().zip(counts) {
                *sum += count;
            }
            row.1.add(traversal);
        }
        let found: BTreeMap<_, _> = ledgers
            .spawner
            .iter()
            .map(|r| {
                let key = (r.object, r.material, r.bounce, r.kind, r.light);
                (key, ([r.rays, r.hits, r.blocked], r.traversal))
            })
            .collect();
        assert!(found == expected && found.len() == ledgers.spawner.len());
        let matrix: BTreeMap<_, _> =
            ledgers.matrix.iter().map(|r| ((r.spawner, r.payer), (r.traversal, r.landed))).collect();
        assert!(matrix == oracle.matrix && matrix.len() == ledgers.matrix.len());
        let mut paid: BTreeMap<Option<u32>, Traversal> = BTreeMap::new();
        for ((_, payer), (traversal, _)) in &oracle.matrix {
            if *traversal == Traversal::default() {
                continue;
            }
            paid.entry(*payer).or_default().add(traversal);
        }
        let payer: BTreeMap<_, _> = ledgers.payer.iter().map(|row| (row.object, row.traversal)).collect();
        assert!(payer == paid && payer.len() == ledgers.payer.len());
    }
}

#[test]
fn workers_do_not_change_the_rows() {
    let one = booked(9, 2000, 1, 4).1;
    assert_eq!(one, booked(9, 2000, 4, 4).1);
    let mut sorted = one.clone();
    sorted.spawner.sort_by_key(|row| std::cmp::Reverse(row.traversal.nodes + row.traversal.shapes));
    assert_eq!(one, sorted);
}

#[test]
fn thousands_of_objects_share_an_entry_and_lose_nothing() {
    let (frame, ledgers, _, desc) = booked(3000, 10_000, 2, 5);
    assert_totals(&frame, &ledgers);
    assert_eq!(ledgers.merged_objects, 3000 - 1022);
    assert_eq!(ledgers.objects.len(), 3001);
    // Those with the most triangles keep their own.
    let own: Vec<u64> = ledgers
        .matrix
        .iter()
        .filter_map(|row| row.spawner)
        .filter(|object| *object < 3000)
        .map(|object| desc.triangles[object as usize])
        .collect();
    let least = own.iter().min().unwrap();
    assert!(desc.triangles.iter().filter(|count| *count > least).count() <= 1022);
    let short = ledgers.clone().shortened();
    assert_eq!((short.spawner.len(), short.matrix.len()), (1000, 1000));
    assert!(short.matrix[999].others && short.spawner[999].kind == SpawnerKind::Other);
    assert_totals(&frame, &short);
    let landed = |ledgers: &Ledgers| ledgers.matrix.iter().map(|row| row.landed).sum::<u64>();
    assert_eq!(landed(&short), landed(&ledgers));
    // The matrix of cells, rare counts and paths alone takes so much.
    let memory = Ledger::new(&Payers::new(&desc)).memory();
    assert!((40 << 20..80 << 20).contains(&memory), "{memory}");
}

#[test]
fn sixty_four_lights_have_entries_of_their_own() {
    let desc = PayerDesc { triangles: vec![1; 70], lights: (0..70).rev().collect(), ..PayerDesc::default() };
    let payers = Payers::new(&desc);
    let own: Vec<u32> = (0..70).filter(|light| payers.light(*light) == payers.slot(*light)).collect();
    assert_eq!(own, (6..70).collect::<Vec<_>>());
    assert!((0..6).all(|light| payers.object(payers.light(light)) == Some(70)), "the rest share");
    assert_eq!(payers.light(NONE), 0);
}

/// The only block is without triangles: its column is the last one, and a visit of it is kept beside the cells.
#[test]
fn the_last_column_is_whole() {
    let desc =
        PayerDesc { triangles: vec![1], blocks: vec![Payer::Scene(Vec::new())], ..PayerDesc::default() };
    let payers = Payers::new(&desc);
    let (mut ledger, mut frame) = (Ledger::new(&payers), Frame::new(FrameDesc::new(1, 1)));
    let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
    let mut visit = ledger.visit(&payers, pixel.visit());
    let mut path = visit.path();
    let mut ray = path.ray(Spawner::CAMERA);
    ray.leaf(0, 0);
    ray.finish(false);
    path.end(PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 0 });
    drop(visit);
    let rows = ledger.rows(&payers, &["a".to_owned()], &[]);
    assert_eq!((rows.payer.len(), rows.payer[0].object, rows.payer[0].traversal.leaves), (1, None, 1));
}

#[test]
#[should_panic(expected = "ledgers of different scenes")]
fn ledgers_of_different_scenes_are_not_added() {
    let ledger = |objects| {
        Ledger::new(&Payers::new(&PayerDesc { triangles: vec![1; objects], ..PayerDesc::default() }))
    };
    ledger(3).merge(&ledger(4));
}

#[test]
fn csv_has_every_row_and_tames_names() {
    let mut ledgers = booked(7, 2000, 1, 6).1;
    ledgers.objects[0] = "=cmd(\"x\"),\r\n1".to_owned();
    for (text, rows) in [
        (ledgers.spawner_csv(), ledgers.spawner.len()),
        (ledgers.payer_csv(), ledgers.payer.len()),
        (ledgers.matrix_csv(), ledgers.matrix.len()),
    ] {
        assert!(text.contains("\"'=cmd(\"\"x\"\"),\r\n1\""), "{text}");
        let plain = text.replace("\"'=cmd(\"\"x\"\"),\r\n1\"", "x");
        let columns = plain.lines().next().unwrap().split(',').count();
        assert_eq!(plain.lines().count(), 1 + rows);
        assert!(plain.lines().all(|line| line.split(',').count() == columns));
    }
}

/// The sums of five workers, each as full as a pair of sums gets.
#[test]
fn merging_loses_nothing_of_full_sums() {
    let desc = PayerDesc { triangles: vec![1], nodes: vec![Payer::Object(0)], ..PayerDesc::default() };
    let payers = Payers::new(&desc);
    let mut frame = Frame::new(FrameDesc::new(1, 1));
    let mut sum = Ledger::new(&payers);
    for _ in 0..5 {
        let mut ledger = Ledger::new(&payers);
        let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
        let mut visit = ledger.visit(&payers, pixel.visit());
        let mut path = visit.path();
        let mut ray = path.ray(Spawner::CAMERA);
        ray.node(0, (1 << 31) - 1);
        ray.finish(false);
        path.end(PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 0 });
        drop(visit);
        sum.merge(&ledger);
    }
    let row = sum.rows(&payers, &["a".to_owned()], &[]).payer[0].traversal;
    assert_eq!((row.nodes, row.boxes), (5, 5 * ((1 << 31) - 1)));
}
