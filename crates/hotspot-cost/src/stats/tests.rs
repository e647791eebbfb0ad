use super::*;
use crate::testing::{Random, random_frame};
use crate::{Cause, FrameDesc, PathEnd, Rect, Sum};
use hotspot_probe::Spawner;

/// A frame whose paths visit 10·(1 + x) plus or minus up to 8 nodes, drawn independently, and the true mean.
fn noisy(desc: FrameDesc, spp: u32, random: &mut Random) -> (Frame, f64) {
    let mut frame = Frame::new(desc);
    for (x, y) in frame.pixels() {
        let half_count = frame.halves();
        for half in 0..half_count {
            for _ in 0..spp {
                let nodes = 10 * (1 + x) + random.below(17) - 8;
                let tile = &mut frame.tiles_mut()[0];
                tile.film_mut(x, y, half).add([nodes as f32, 1.0, 0.0]);
                let mut pixel = tile.pixel(x, y, half);
                let mut path = pixel.path();
                path.add_ray(Spawner::CAMERA, nodes, 2, true);
                let cause = if random.below(4) == 0 { Cause::Roulette } else { Cause::Escaped };
                path.end(PathEnd { cause, throughput: 1.0, brought_radiance: true, first_object: 0 });
            }
        }
    }
    let mean = 10.0 * (1.0 + f64::from(desc.width - 1) / 2.0);
    (frame, mean)
}

fn desc(intervals: bool) -> FrameDesc {
    FrameDesc { intervals, tile: 64, ..FrameDesc::new(12, 8) }
}

/// How many of 300 intervals of `metric` hold the truth.
fn covered(intervals: bool, spp: u32, metric: Metric, truth: impl Fn(f64) -> f64) -> usize {
    let mut random = Random::new(u64::from(spp) + 100);
    (0..300)
        .filter(|_| {
            let (frame, mean) = noisy(desc(intervals), spp, &mut random);
            let [low, high] = total(&frame, metric, CostModel::default()).ci95.unwrap();
            (low..=high).contains(&truth(mean))
        })
        .count()
}

/// 300 intervals at 95 %: 285 expected, standard deviation 3.8. 271 to 297 leaves out correct intervals with a
/// probability of about 0.001; the seeds are fixed, so that the outcome is too.
const EXPECTED: std::ops::RangeInclusive<usize> = 271..=297;

#[test]
fn intervals_from_halves_cover_the_truth() {
    for spp in [1, 4] {
        let count = covered(true, spp, Metric::Nodes, |mean| mean);
        assert!(EXPECTED.contains(&count), "{spp} spp: {count} of 300");
        let count = covered(true, spp, Metric::Intersection, |mean| mean + 2.0);
        assert!(EXPECTED.contains(&count), "{spp} spp: {count} of 300");
    }
}

#[test]
fn conservative_intervals_cover_exactly_where_samples_are_independent() {
    for spp in [2, 5] {
        let count = covered(false, spp, Metric::Nodes, |mean| mean);
        assert!(EXPECTED.contains(&count), "{spp} spp: {count} of 300");
        let count = covered(false, spp, Metric::Roulette, |_| 0.25);
        assert!(EXPECTED.contains(&count), "{spp} spp: {count} of 300");
    }
}

#[test]
fn single_samples_give_an_interval_that_is_too_wide_rather_than_none() {
    let count = covered(false, 1, Metric::Nodes, |mean| mean);
    assert_eq!(count, 300);
}

#[test]
fn what_each_metric_knows_about_itself() {
    let halves = random_frame(desc(true), 2, 3);
    let plain = random_frame(desc(false), 2, 3);
    let kind = |frame, metric| total(frame, metric, CostModel::default()).ci_kind;
    for metric in Metric::ALL {
        let time = metric == Metric::TimeUs;
        assert_eq!(kind(&halves, metric), if time { CiKind::None } else { CiKind::Halves }, "{metric:?}");
        let squares = metric.squares(&CostPixel::default(), CostModel::default()).is_some();
        assert_eq!(
            kind(&plain, metric),
            if squares { CiKind::Conservative } else { CiKind::None },
            "{metric:?}"
        );
        for frame in [&halves, &plain] {
            let total = total(frame, metric, CostModel::default());
            assert_eq!(total.ci95.is_some(), total.ci_kind != CiKind::None);
        }
    }
    // 1500 ns for each path.
    let time = total(&plain, Metric::TimeUs, CostModel::default());
    assert_eq!((time.mean, time.sum), (1.5, Sum::Real(1.5 * 12.0 * 8.0 * 2.0)));
}

#[test]
fn an_empty_frame_has_totals_of_nothing() {
    let frame = Frame::new(desc(true));
    let total = total(&frame, Metric::Nodes, CostModel::default());
    assert_eq!(total, Total { sum: Sum::Exact(0), mean: 0.0, ci95: None, ci_kind: CiKind::None });
    assert_eq!(estimated_relmse(&frame), None);
    assert!(
        totals(&Frame::new(FrameDesc { cost: false, ..desc(false) }), MetricSet::ALL, CostModel::default())
            .is_empty()
    );
}

#[test]
fn the_estimated_error_is_the_error() {
    // Uniform on 17 integers: variance (17² − 1)/12 = 24 per sample.
    let expected: f64 = (0..12)
        .map(|x| {
            let mean = 10.0 * f64::from(1 + x);
            24.0 / 8.0 / (mean * mean + 0.01)
        })
        .sum::<f64>()
        / 36.0;
    for (intervals, spp, kind) in [(true, 4, CiKind::Halves), (false, 8, CiKind::Conservative)] {
        let mut random = Random::new(9);
        let runs = 60;
        let mean = (0..runs)
            .map(|_| {
                let (value, found) = estimated_relmse(&noisy(desc(intervals), spp, &mut random).0).unwrap();
                assert_eq!(found, kind);
                value
            })
            .sum::<f64>()
            / f64::from(runs);
        // 60 runs of 8 rows: the noisiest column has 480 squares, so about 6 % at one standard deviation.
        assert!((mean / expected - 1.0).abs() < 0.2, "{kind:?}: {mean} {expected}");
    }
}

#[test]
fn an_empty_half_gives_no_interval_by_halves() {
    let mut frame = Frame::new(FrameDesc { intervals: true, ..FrameDesc::new(4, 1) });
    let mut random = Random::new(4);
    for x in 0..4 {
        for _ in 0..3 {
            crate::testing::random_path(&mut frame, x, 0, 0, &mut random, 9);
        }
    }
    for metric in Metric::ALL {
        let kind = total(&frame, metric, CostModel::default()).ci_kind;
        let squares = metric.squares(&CostPixel::default(), CostModel::default()).is_some();
        assert_eq!(kind, if squares { CiKind::Conservative } else { CiKind::None }, "{metric:?}");
    }
    assert_eq!(estimated_relmse(&frame).unwrap().1, CiKind::Conservative);
}

/// One pixel of four has a path that visits more nodes, one in each half.
#[test]
fn halves_that_agree_by_chance_give_way_to_the_bound() {
    let of = |rare: [u32; 2]| {
        let mut frame = Frame::new(FrameDesc { intervals: true, ..FrameDesc::new(4, 1) });
        for (x, y) in frame.pixels() {
            for (half, rare) in rare.into_iter().enumerate() {
                for sample in 0..4 {
                    let nodes = if x == 1 && sample < rare { 9 } else { 1 };
                    let mut pixel = frame.tiles_mut()[0].pixel(x, y, half);
                    let mut path = pixel.path();
                    path.add_ray(Spawner::CAMERA, nodes, 1, true);
                    let cause = Cause::Escaped;
                    path.end(PathEnd { cause, throughput: 1.0, brought_radiance: true, first_object: 0 });
                }
            }
        }
        let whole = total(&frame, Metric::Nodes, CostModel::default());
        let part = Rect { x: 0, y: 0, width: 2, height: 9 };
        (whole, region(&frame, part, Metric::Nodes, CostModel::default()))
    };
    let width = |total: &Total| total.ci95.map(|[low, high]| high - low).unwrap();
    let (whole, part) = of([1, 1]);
    assert_eq!((whole.ci_kind, part.ci_kind), (CiKind::Conservative, CiKind::Conservative));
    // s² = 8²·(2·6/8)/7 = 96/7 over 8 samples, at 7 degrees of freedom, the pixel one of two.
    let expected = 2.0 * crate::student::quantile95(7.0) * 0.5 * (96.0 / 56.0_f64).sqrt();
    assert!((width(&part) - expected).abs() < 1e-9 && (width(&whole) - 0.5 * expected).abs() < 1e-9);
    assert_eq!((part.sum, part.mean), (Sum::Exact(32), 2.0));
    // Halves that differ say how much themselves; where no sample differs, there is nothing to fear.
    assert_eq!(of([1, 2]).0.ci_kind, CiKind::Halves);
    let (whole, _) = of([0, 0]);
    assert_eq!((whole.ci_kind, width(&whole)), (CiKind::Halves, 0.0));
}

/// Every 20th sample is 40 times as bright as the rest, relMSE 0.25, mean of 60 frames: neither the pixel's own mean nor a window
/// without such samples may stand for its true value of about 3. The seed is fixed.
#[test]
fn the_estimated_error_of_fireflies_is_their_error() {
    let (frames, spp, bright) = (60, 16, 40.0);
    let mut random = Random::new(11);
    let truth = 1.0 + (bright - 1.0) / 20.0;
    let (mut expected, mut found) = (0.0, 0.0);
    for _ in 0..frames {
        let mut frame =
            Frame::new(FrameDesc { intervals: true, cost: false, tile: 64, ..FrameDesc::new(32, 32) });
        for (x, y) in frame.pixels() {
            for half in 0..2 {
                for _ in 0..spp {
                    let value = if random.below(20) == 0 { bright as f32 } else { 1.0 };
                    frame.tiles_mut()[0].film_mut(x, y, half).add([value; 3]);
                }
            }
            let off = frame.film_total(x, y).sum[0] / f64::from(2 * spp) - truth;
            expected += off * off / (truth * truth + 0.01) / (32.0 * 32.0);
        }
        found += estimated_relmse(&frame).unwrap().0;
    }
    let ratio = found / expected;
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
}
