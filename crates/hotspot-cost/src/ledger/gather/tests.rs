//! Sums that are as full as they get.

use super::super::payers::{Payer, PayerDesc};
use super::*;
use crate::{Cause, Counter, Frame, FrameDesc};

/// Sums of a row and of a path that are nearly full, and a ray that visits more than a pair can hold.
#[test]
fn full_sums_lose_nothing() {
    let desc = PayerDesc {
        triangles: vec![1],
        nodes: vec![Payer::Object(0)],
        blocks: vec![Payer::Object(0)],
        instances: vec![0],
        ..PayerDesc::default()
    };
    let payers = Payers::new(&desc);
    let (mut ledger, mut frame) = (Ledger::new(&payers), Frame::new(FrameDesc::new(1, 1)));
    let nearly = Pair::FULL - 3;
    let full = Pair::of([nearly, 8 * nearly]).unwrap();
    let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
    let mut visit = ledger.visit(&payers, pixel.visit());
    visit.pairs.iter_mut().take(2 * payers.columns()).for_each(|pair| *pair = full.word());
    let mut path = visit.path();
    // As if earlier rays of the path had visited so much.
    path.visit.tally.end_ray(false, [full; PAIRS], false);
    path.visit.tally.end_ray(true, [full; PAIRS], false);
    let shadow = Spawner { kind: RayKind::Shadow, ..Spawner::CAMERA };
    let [mut nodes, mut leaves] = [0u64; 2];
    for (round, by) in [Spawner::CAMERA, shadow, shadow, Spawner::CAMERA].into_iter().enumerate() {
        let mut ray = path.ray(by);
        for _ in 0..7 {
            ray.node(0, 5);
            ray.leaf(0, 2);
            nodes += 1;
            leaves += 1;
            if round > 1 {
                ray.instance(0);
            }
        }
        ray.finish(true);
    }
    // Into sums that are as good as full: as much again, twice, which no pair could hold.
    path.visit.tally.end_ray(false, [full; PAIRS], false);
    for _ in 0..2 {
        let mut ray = path.ray(Spawner::CAMERA);
        for _ in 0..Pair::FULL {
            ray.node(0, 5);
        }
        nodes += Pair::FULL;
        ray.finish(false);
    }
    path.end(PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 0 });
    drop(visit);
    let all = frame.cost_total(0, 0);
    // What the sums began with, of both kinds of rays and once more for the last.
    assert_eq!(all.get(Counter::Nodes), nodes + 3 * nearly);
    assert_eq!(all.get(Counter::Boxes), 5 * nodes + 3 * 8 * nearly);
    assert_eq!(all.get(Counter::Leaves), leaves + 3 * nearly);
    assert_eq!(all.get(Counter::Shapes), 2 * leaves + 3 * 8 * nearly);
    assert_eq!(all.get(Counter::NodesShadow), 14 + nearly);
    assert_eq!(all.get(Counter::WasteNodes), 14);
    let rows = ledger.rows(&payers, &["a".to_owned()], &[]);
    let sum = |rows: &mut dyn Iterator<Item = Traversal>| {
        rows.fold(Traversal::default(), |mut sum, row| {
            sum.add(&row);
            sum
        })
    };
    let sent = sum(&mut rows.spawner.iter().map(|row| row.traversal));
    assert_eq!([sent.nodes, sent.boxes], [nodes, 5 * nodes]);
    assert_eq!([sent.leaves, sent.shapes], [leaves, 2 * leaves]);
    // The row began with that much in each column.
    let began = nearly * payers.columns() as u64;
    let paid = sum(&mut rows.payer.iter().map(|row| row.traversal));
    assert_eq!([paid.nodes, paid.boxes], [nodes + began, 5 * nodes + 8 * began]);
    assert_eq!([paid.leaves, paid.shapes], [leaves + began, 2 * leaves + 8 * began]);
}
