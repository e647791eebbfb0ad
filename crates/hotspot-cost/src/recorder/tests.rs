use super::*;
use crate::ledger::{Ledger, Payer, PayerDesc, Payers};
use crate::testing::{Random, SHADOW, random_frame, random_path};
use crate::{CostModel, Frame, FrameDesc, LayerOptions, Layers, Metric, MetricSet, Sum, stats};
use hotspot_probe::RayProbe;

const END: PathEnd =
    PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 3 };

fn desc(intervals: bool) -> FrameDesc {
    FrameDesc { intervals, tile: 8, ..FrameDesc::new(21, 13) }
}

/// All sums of a frame, in order.
fn sums(frame: &Frame) -> Vec<(FilmPixel, CostPixel)> {
    frame
        .pixels()
        .flat_map(|(x, y)| (0..frame.halves()).map(move |half| (x, y, half)))
        .map(|(x, y, half)| (*frame.film(x, y, half).unwrap(), *frame.cost(x, y, half).unwrap()))
        .collect()
}

#[test]
fn sums_beyond_32_and_53_bits_are_exact() {
    let mut frame = Frame::new(FrameDesc::new(1, 1));
    let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
    let mut path = pixel.path();
    // 2^22 + 1 rays of 2^32 - 1 nodes: an odd number above 2^53 has no f64.
    for _ in 0..(1_u64 << 22) + 1 {
        path.add_ray(Spawner::CAMERA, u32::MAX, 1, true);
    }
    path.end(END);
    let exact = u64::from(u32::MAX) * ((1 << 22) + 1);
    assert!(exact > 1 << 53 && exact % 2 == 1);
    let total = |metric| stats::total(&frame, metric, CostModel::default()).sum;
    assert_eq!(total(Metric::Nodes), Sum::Exact(exact));
    assert_eq!(total(Metric::Intersection), Sum::Exact(exact + (1 << 22) + 1));
    assert_eq!(
        stats::total(&frame, Metric::Intersection, CostModel { c0: 1.5, c1: 0.0 }).sum,
        Sum::Real(1.5 * exact as f64)
    );
    let text = serde_json::to_string(&total(Metric::Nodes)).unwrap();
    assert_eq!(text, exact.to_string());
    assert_eq!(serde_json::from_str::<Sum>(&text).unwrap(), Sum::Exact(exact));
}

/// Boxes and shapes are kept as what is beyond one for each visit: also where there is none, and for blocked rays alone.
#[test]
fn visits_of_nothing_and_of_very_much_are_counted() {
    let mut frame = Frame::new(FrameDesc::new(1, 1));
    let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
    let mut visit = pixel.visit();
    let rays =
        [(Spawner::CAMERA, [0, 0]), (SHADOW, [0, 3]), (SHADOW, [u32::MAX, 0]), (SHADOW, [8, u32::MAX])];
    for (round, (by, [boxes, shapes])) in rays.into_iter().enumerate() {
        let mut ray = visit.path().ray(by);
        ray.leaf(0, shapes);
        ray.node(0, boxes);
        ray.leaf(1, shapes);
        // The last two are blocked.
        ray.finish(round > 1);
        visit.end(END);
    }
    drop(visit);
    let all = frame.cost_total(0, 0);
    let most = u64::from(u32::MAX);
    assert_eq!((all.get(Counter::Nodes), all.get(Counter::Boxes)), (4, most + 8));
    assert_eq!((all.get(Counter::Leaves), all.get(Counter::Shapes)), (8, 2 * (3 + most)));
    assert_eq!((all.get(Counter::BoxesShadow), all.get(Counter::ShapesShadow)), (most + 8, 2 * (3 + most)));
    // Of paths that brought light, what their blocked shadow rays met.
    assert_eq!((all.get(Counter::WasteNodes), all.get(Counter::WasteShapes)), (2, 2 * most));
}

#[test]
fn pixels_add_up_to_totals_and_layers_to_both() {
    for intervals in [false, true] {
        let frame = random_frame(desc(intervals), 3, 11);
        let model = CostModel { c0: 2.0, c1: 3.0 };
        let layers = Layers::from_frame(&frame, &LayerOptions { model, ..LayerOptions::default() });
        for metric in Metric::ALL {
            let total = stats::total(&frame, metric, model);
            let pixels: f64 = frame.pixels().map(|(x, y)| metric.sum(&frame.cost_total(x, y), model)).sum();
            assert!((pixels - total.sum.as_f64()).abs() <= 1e-12 * pixels, "{metric:?}");
            if let Some(plane) = layers.metric(metric) {
                let samples = layers.plane("cost.samples").unwrap();
                let sum: f64 = plane.iter().zip(samples).map(|(m, n)| f64::from(*m) * f64::from(*n)).sum();
                // Half an ulp for each mean.
                assert!((sum - pixels).abs() <= 6e-8 * pixels, "{metric:?}: {sum} {pixels}");
            } else {
                assert!(!metric.in_layers());
            }
        }
    }
}

#[test]
fn every_path_ends_once_and_waste_is_part_of_the_cost() {
    let frame = random_frame(desc(false), 5, 2);
    let model = CostModel { c0: 0.5, c1: 1.25 };
    for pixel in frame.costs() {
        let ends: u64 = [Cause::Escaped, Cause::Absorbed, Cause::Roulette, Cause::DepthLimit]
            .map(|cause| pixel.get(cause.counter()))
            .iter()
            .sum();
        assert_eq!(ends, pixel.samples);
        assert!(pixel.get(Counter::WasteNodes) <= pixel.get(Counter::Nodes));
        assert!(pixel.get(Counter::WasteShapes) <= pixel.get(Counter::Shapes));
        assert!(Metric::Waste.sum(pixel, model) <= Metric::Intersection.sum(pixel, model));
        for metric in Metric::ALL {
            if let Some(shadow) = metric.shadow() {
                assert!(shadow.sum(pixel, model) <= metric.sum(pixel, model), "{metric:?}");
            }
        }
    }
    // The waste is neither nothing nor everything, so the bounds above say something.
    let total = |metric| stats::total(&frame, metric, model).sum.as_f64();
    assert!(total(Metric::Waste) > 0.1 * total(Metric::Intersection));
    assert!(total(Metric::Waste) < 0.9 * total(Metric::Intersection));
}

#[test]
fn what_one_path_counts() {
    let mut frame = Frame::new(FrameDesc::new(2, 1));
    for (x, brought) in [(0, true), (1, false)] {
        let mut pixel = frame.tiles_mut()[0].pixel(x, 0, 0);
        let mut path = pixel.path();
        let mut ray = path.ray(Spawner::CAMERA);
        ray.node(0, 6);
        ray.node(1, 4);
        ray.instance(0);
        ray.leaf(0, 3);
        ray.finish(true);
        for blocked in [true, false] {
            let mut ray = path.ray(SHADOW);
            ray.node(0, 6);
            ray.leaf(0, 2);
            ray.finish(blocked);
        }
        path.untraced(SHADOW);
        path.bsdf(2);
        path.texture(3, 48);
        path.end(PathEnd { brought_radiance: brought, ..END });
    }
    let pixel = frame.cost(0, 0, 0).unwrap();
    let expected = [4, 3, 4, 2, 7, 4, 22, 12, 3, 2, 1, 0, 2, 3, 48, 0, 1, 2, 1, 0, 0, 0];
    assert_eq!(pixel.counts, expected);
    assert_eq!(pixel.squares, [16.0, 16.0, 49.0, 28.0]);
    assert_eq!(pixel.first_object, 3);
    // All of it is waste when the path brought nothing.
    let dark = frame.cost(1, 0, 0).unwrap();
    assert_eq!((dark.get(Counter::WasteNodes), dark.get(Counter::WasteShapes)), (4, 7));
}

#[test]
fn a_path_that_is_not_ended_leaves_no_trace() {
    let mut frame = Frame::new(FrameDesc::new(1, 1));
    let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
    pixel.path().add_ray(Spawner::CAMERA, 5, 5, true);
    assert_eq!(*frame.cost(0, 0, 0).unwrap(), CostPixel::default());
}

#[test]
fn passes_of_any_size_give_the_same_bits() {
    let spp = 7;
    let once = random_by_waves(&[spp]);
    for waves in [&[1, 1, 1, 1, 1, 1, 1][..], &[4, 3], &[1, 6]] {
        assert_eq!(sums(&random_by_waves(waves)), sums(&once), "{waves:?}");
    }
}

/// Each sample draws from a generator of its own, as a renderer's does.
fn random_by_waves(waves: &[u32]) -> Frame {
    let mut frame = Frame::new(desc(true));
    let mut first = 0;
    for wave in waves {
        for (x, y) in frame.pixels() {
            for half in 0..2 {
                for sample in first..first + wave {
                    let key =
                        (u64::from(sample) << 40) | (u64::from(y) << 20) | u64::from(x) << 2 | half as u64;
                    random_path(&mut frame, x, y, half, &mut Random::new(key), 5);
                }
            }
        }
        first += wave;
    }
    frame
}

#[test]
fn buckets_of_ones_own_merge_to_the_same_frame() {
    let source = random_frame(desc(true), 2, 5);
    let buckets = [(0, 0, 10, 13), (10, 0, 11, 6), (10, 6, 30, 30)].map(|(x, y, width, height)| {
        let mut bucket = source.tile(Rect { x, y, width, height });
        for (x, y) in bucket.rect().pixels() {
            for half in 0..2 {
                // Past the frame too: that part must be ignored.
                let index = bucket.index(x, y, half);
                bucket.film[index] = source
                    .film(x, y, half)
                    .copied()
                    .unwrap_or(FilmPixel { samples: 9, ..FilmPixel::default() });
                bucket.cost[index] = source
                    .cost(x, y, half)
                    .copied()
                    .unwrap_or(CostPixel { samples: 9, ..CostPixel::default() });
            }
        }
        bucket
    });
    for order in [[0, 1, 2], [2, 0, 1]] {
        let mut frame = Frame::new(*source.desc());
        for index in order {
            frame.merge(&buckets[index]);
        }
        assert_eq!(sums(&frame), sums(&source));
    }
}

#[test]
fn overlapping_recorders_add_up_and_no_half_is_lost() {
    let halves = random_frame(desc(true), 2, 5);
    let mut single = Frame::new(desc(false));
    for tile in &mut halves.clone().tiles_mut().iter() {
        single.merge(tile);
        single.merge(tile);
    }
    for metric in
        MetricSet::ALL.iter().filter(|metric| !matches!(metric, Metric::Throughput | Metric::TimeUs))
    {
        let total = |frame: &Frame| metric.total(frame.costs(), CostModel::default()).as_f64();
        assert_eq!(total(&single), 2.0 * total(&halves), "{metric:?}");
    }
}

#[test]
fn a_half_that_does_not_exist_is_not_the_next_pixel() {
    let frame = random_frame(desc(false), 1, 5);
    assert!(frame.film(0, 0, 0).is_some() && frame.cost(0, 0, 0).is_some());
    assert!(frame.film(0, 0, 1).is_none() && frame.cost(0, 0, 1).is_none());
    assert!(frame.film(21, 0, 0).is_none() && frame.film(0, 13, 0).is_none());
}

#[test]
fn a_frame_without_cost_gathers_radiance_alone() {
    let frame = random_frame(FrameDesc { cost: false, ..desc(false) }, 2, 1);
    assert!(frame.cost(0, 0, 0).is_none());
    assert_eq!(frame.film(3, 3, 0).unwrap().samples, 2);
    let layers = Layers::from_frame(&frame, &LayerOptions::default());
    let names: Vec<&str> = layers.planes.keys().map(String::as_str).collect();
    assert_eq!(names, ["A", "B", "G", "R", "samples"]);
}

/// Feeds a path some rays, near the depth limit too.
fn some_rays<P: Probe>(path: &mut P, random: &mut Random) {
    for _ in 0..random.below(4) {
        for by in [Spawner::CAMERA, SHADOW, SHADOW] {
            let mut ray = path.ray(by);
            for id in 0..random.below(5) {
                ray.node(id, 1 + random.below(8));
                ray.leaf(id, random.below(9));
            }
            if random.below(3) == 0 {
                ray.instance(0);
                ray.alpha(1, 4);
            }
            ray.finish(random.below(2) == 0);
        }
        path.untraced(SHADOW);
        path.bsdf(2);
        path.texture(1, 16);
        path.light(random.below(6), random.unit() as f32);
    }
}

#[test]
fn visits_of_several_paths_leave_what_paths_one_by_one_do() {
    let mut frame = Frame::new(FrameDesc::new(3, 1));
    let mut randoms = [Random::new(8), Random::new(8), Random::new(8)];
    let payers = Payers::new(&PayerDesc {
        nodes: vec![Payer::Object(0); 5],
        blocks: vec![Payer::Object(1); 5],
        instances: vec![0],
        triangles: vec![3, 5],
        lights: vec![1],
    });
    let mut ledger = Ledger::new(&payers);
    for visit_of in [1, 3, 2, 7, 200] {
        let end = |random: &mut Random| PathEnd {
            cause: [Cause::Escaped, Cause::Absorbed, Cause::Roulette, Cause::DepthLimit]
                [random.below(4) as usize],
            throughput: random.unit() as f32,
            brought_radiance: random.below(2) == 0,
            first_object: random.below(9),
        };
        for _ in 0..visit_of {
            let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
            let mut path = pixel.path();
            some_rays(&mut path, &mut randoms[0]);
            path.end(end(&mut randoms[0]));
        }
        let mut pixel = frame.tiles_mut()[0].pixel(1, 0, 0);
        let mut visit = pixel.visit();
        for _ in 0..visit_of {
            some_rays(visit.path(), &mut randoms[1]);
            visit.end(end(&mut randoms[1]));
        }
        drop(visit);
        let mut pixel = frame.tiles_mut()[0].pixel(2, 0, 0);
        let mut visit = ledger.visit(&payers, pixel.visit());
        for _ in 0..visit_of {
            let mut path = visit.path();
            some_rays(&mut path, &mut randoms[2]);
            path.end(end(&mut randoms[2]));
        }
    }
    let [one_by_one, visits, booked] = [0, 1, 2].map(|x| *frame.cost(x, 0, 0).unwrap());
    assert_eq!(visits, one_by_one);
    assert_eq!(booked, one_by_one);
    assert!(visits.counts.iter().all(|sum| *sum > 0) && visits.samples == 213);
    assert!(visits.cut.throughput > 0.0 && visits.cut.last.iter().all(|sum| *sum > 0.0));
}

/// Rays of a tally with visits that no pair can hold, sums that fill up, instances, alpha tests, textures and light: as the same rays of a path that
/// counts each visit at once.
#[test]
fn tallies_are_what_paths_count_at_once() {
    let mut frame = Frame::new(FrameDesc::new(2, 1));
    let mut random = Random::new(8);
    let mut tally = PathTally::new();
    for path in 0..40 {
        let end = PathEnd { brought_radiance: path % 3 > 0, ..END };
        let mut pixel = frame.tiles_mut()[0].pixel(0, 0, 0);
        let mut expected = pixel.path();
        for ray in 0..path % 5 {
            let shadow = ray % 2 == 1;
            let by =
                Spawner { kind: if shadow { RayKind::Shadow } else { RayKind::Bounce }, ..Spawner::CAMERA };
            let (mut one, mut other) = (expected.ray(by), tally.ray(shadow));
            for _ in 0..random.below(30) {
                let boxes = [random.below(9), 254, 255, 70_000][random.below(4) as usize];
                match random.below(4) {
                    0 if path % 2 == 0 => {
                        one.instance(1);
                        other.instance(1);
                    }
                    1 => {
                        one.leaf(3, boxes);
                        other.leaf(3, boxes);
                    }
                    2 if path % 2 == 0 => {
                        one.alpha(2, 8);
                        other.alpha(2, 8);
                    }
                    _ => {
                        one.node(2, boxes);
                        other.node(2, boxes);
                    }
                }
            }
            let hit = random.below(2) == 1;
            one.finish(hit);
            other.finish(hit);
        }
        expected.bsdf(3);
        tally.bsdf(3);
        if path % 4 == 0 {
            expected.texture(2, 64);
            tally.texture(2, 64);
            expected.light(path % 7, 0.5);
            tally.light(path % 7, 0.5);
        }
        expected.end(end);
        frame.tiles_mut()[0].pixel(1, 0, 0).visit().add(&tally, end);
        tally.clear();
    }
    assert_eq!(frame.cost(1, 0, 0), frame.cost(0, 0, 0));
    assert!(frame.cost(0, 0, 0).is_some_and(|cost| cost.get(Counter::WasteShapes) > 1 << 20));
}

/// What a ray that is not finished leaves in a tally goes with its path.
#[test]
fn a_tally_that_is_cleared_counts_as_new() {
    let mut frame = Frame::new(FrameDesc::new(2, 1));
    let mut tally = PathTally::new();
    tally.ray(true).node(0, 70_000);
    tally.clear();
    let mut new = PathTally::new();
    for (x, tally) in [(0, &mut tally), (1, &mut new)] {
        let mut ray = tally.ray(false);
        ray.node(0, 300);
        ray.finish(true);
        frame.tiles_mut()[0].pixel(x, 0, 0).visit().add(tally, END);
    }
    assert_eq!(frame.cost(0, 0, 0), frame.cost(1, 0, 0));
}
