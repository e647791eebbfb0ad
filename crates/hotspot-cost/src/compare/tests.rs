use super::*;
use crate::testing::Random;

const SIZE: u32 = 32;

/// How a synthetic render is made: pixel means around `level` with a noise that differs a hundredfold between pixels, as
/// renders' does.
struct Model {
    level: f64,
    noise: f64,
}

impl Model {
    fn deviation(&self, index: usize) -> f64 {
        // Between 0.1 and 10 times the noise, without pattern.
        let mut random = Random::new(index as u64 * 77 + 5);
        self.noise * 10.0_f64.powf(2.0 * random.unit() - 1.0)
    }

    fn render(&self, random: &mut Random) -> Layers {
        let mut layers = Layers::new(SIZE, SIZE);
        let (mut means, mut halves) = (Vec::new(), Vec::new());
        for index in 0..layers.pixels() {
            let deviation = self.deviation(index) * std::f64::consts::SQRT_2;
            let level = self.level * (1.0 + (index % 7) as f64);
            let [a, b] = [0, 1].map(|_| level + deviation * random.normal());
            means.push((0.5 * (a + b)) as f32);
            halves.push((0.5 * (a - b)) as f32);
        }
        layers.insert("cost.nodes", means);
        layers.insert("half.nodes", halves);
        layers.insert("cost.samples", vec![8.0; layers.pixels()]);
        layers
    }
}

fn side(layers: &Layers) -> Side<'_> {
    Side { name: "A.exr", layers, document: None }
}

fn nodes(a: &Layers, b: &Layers) -> (TotalChange, PixelTests, Comparison) {
    let comparison = compare(side(a), side(b), false).unwrap();
    (comparison.totals["nodes"], comparison.pixels["nodes"], comparison)
}

/// A probability below 5 % is a significant change, and the document is what its schema says.
#[test]
fn probabilities_agree_with_verdicts_and_documents_with_their_schema() {
    let mut random = Random::new(3);
    let (mut seen, mut last) = ([0, 0], Comparison::default());
    for step in 0..40 {
        let raised = Model { level: 100.0 + 0.02 * f64::from(step), noise: 3.0 };
        let (a, b) = (NOISY.render(&mut random), raised.render(&mut random));
        let (change, _, comparison) = nodes(&a, &b);
        let p = change.p_value.unwrap();
        assert_eq!(change.significant, Some(p < 0.05), "{change:?}");
        seen[usize::from(p < 0.05)] += 1;
        let flags = comparison.layers.plane("significant.nodes").unwrap();
        let p_values = comparison.layers.plane("p_value.nodes").unwrap();
        let of = |flag: f32| flags.iter().zip(p_values).filter(move |(f, _)| **f == flag).map(|(_, p)| *p);
        assert!(of(1.0).fold(0.0, f32::max) <= of(0.0).fold(1.0, f32::min));
        last = comparison;
    }
    assert!(seen.iter().all(|count| *count > 3), "{seen:?}");
    last.gates = vec![last.gate(&Gate::parse("nodes=2%").unwrap())];
    for change in last.totals.values_mut() {
        (change.sum_a, change.sum_b, change.tree_error) =
            (Some(Sum::Exact(3)), Some(Sum::Real(4.5)), Some(0.01));
    }
    last.notes.push("x".into());
    let value: serde_json::Value = serde_json::from_str(&last.to_json()).unwrap();
    crate::document::tests::agree(&value, &serde_json::from_str(JSON_SCHEMA).unwrap());
}

const NOISY: Model = Model { level: 100.0, noise: 3.0 };

#[test]
fn renders_of_the_same_scene_are_rarely_told_apart() {
    let mut random = Random::new(1);
    let (mut significant, mut flagged) = (0, 0);
    for _ in 0..300 {
        let (a, b) = (NOISY.render(&mut random), NOISY.render(&mut random));
        let (change, tests, _) = nodes(&a, &b);
        assert_eq!(change.ci_kind, CiKind::Halves);
        assert_eq!(tests.tested, Some(u64::from(SIZE * SIZE)));
        significant += usize::from(change.significant.unwrap());
        flagged += usize::from(tests.significant.unwrap() > 0);
    }
    // Of 300 at 5 %: 15 expected, standard deviation 3.8; 3 to 29 misjudges a correct test with a probability of 0.001. For
    // tiles 5 % is the upper bound.
    assert!((3..=29).contains(&significant), "totals: {significant} of 300");
    assert!(flagged <= 29, "tiles: {flagged} of 300");
}

#[test]
fn intervals_of_a_real_change_cover_it() {
    let mut random = Random::new(2);
    let changed = Model { level: 110.0, noise: 4.0 };
    let covered = (0..300)
        .filter(|_| {
            let (a, b) = (NOISY.render(&mut random), changed.render(&mut random));
            let [low, high] = nodes(&a, &b).0.ci95.unwrap();
            (low..=high).contains(&0.1)
        })
        .count();
    assert!((271..=297).contains(&covered), "{covered} of 300");
}

#[test]
fn pairing_by_halves_cancels_shared_noise() {
    let mut random = Random::new(3);
    let a = NOISY.render(&mut random);
    let mut b = a.clone();
    // The same noise, 0.1 % more of everything.
    for name in ["cost.nodes", "half.nodes"] {
        for value in b.planes.get_mut(name).unwrap() {
            *value *= 1.001;
        }
    }
    let (paired, tests, _) = nodes(&a, &b);
    assert!((paired.relative.unwrap() - 0.001).abs() < 1e-6);
    assert_eq!(paired.significant, Some(true));
    assert_eq!(tests.significant, Some(u64::from(SIZE * SIZE)));
    // An independent render of that scene does not show so small a change.
    let (independent, _, _) = nodes(&a, &Model { level: 100.1, noise: 3.0 }.render(&mut random));
    let width = |change: &TotalChange| change.ci95.unwrap()[1] - change.ci95.unwrap()[0];
    assert!(width(&paired) < 0.01 * width(&independent));
}

#[test]
fn a_render_does_not_differ_from_itself() {
    let a = NOISY.render(&mut Random::new(4));
    let (change, tests, comparison) = nodes(&a, &a);
    assert_eq!((change.delta, change.relative, change.significant), (0.0, Some(0.0), Some(false)));
    assert_eq!(tests.significant, Some(0));
    assert!(comparison.layers.planes["diff.nodes"].iter().all(|value| *value == 0.0));
}

#[test]
fn a_change_in_one_tile_is_found_there() {
    let mut random = Random::new(5);
    let quiet = Model { level: 100.0, noise: 0.5 };
    let (a, mut b) = (quiet.render(&mut random), quiet.render(&mut random));
    for index in (0..b.pixels()).filter(|index| index % 32 < 8 && index / 32 < 8) {
        b.planes.get_mut("cost.nodes").unwrap()[index] += 50.0;
    }
    let (_, tests, comparison) = nodes(&a, &b);
    assert_eq!(tests.significant, Some(64));
    let flags = &comparison.layers.planes["significant.nodes"];
    assert!(flags.iter().enumerate().all(|(i, flag)| (*flag == 1.0) == (i % 32 < 8 && i / 32 < 8)));
    let (diff, relative) =
        (&comparison.layers.planes["diff.nodes"], &comparison.layers.planes["relative.nodes"]);
    let old = a.planes["cost.nodes"][3];
    assert_eq!(diff[3], b.planes["cost.nodes"][3] - old);
    assert_eq!(relative[3], diff[3] / old);
}

#[test]
fn without_halves_intervals_are_conservative_or_absent() {
    let mut random = Random::new(6);
    let mut a = NOISY.render(&mut random);
    let b = NOISY.render(&mut random);
    let exact = nodes(&a, &b).0.ci95.unwrap();
    a.planes.remove("half.nodes");
    let (change, tests, comparison) = nodes(&a, &b);
    assert_eq!((change.ci95, change.ci_kind, change.significant), (None, CiKind::None, None));
    assert_eq!((tests.tested, tests.significant), (None, None));
    assert!(comparison.notes.iter().any(|note| note.contains("--intervals")), "{:?}", comparison.notes);
    let var = (0..a.pixels()).map(|index| (2.0 * NOISY.deviation(index).powi(2)) as f32).collect();
    a.insert("var.nodes", var);
    let (change, _, _) = nodes(&a, &b);
    assert_eq!(change.ci_kind, CiKind::Conservative);
    let wide = change.ci95.unwrap();
    assert!(wide[0] < exact[0] && wide[1] > exact[1], "{wide:?} {exact:?}");
    let pixels = a.pixels();
    a.insert("cost.samples", vec![1.0; pixels]);
    assert_eq!(nodes(&a, &b).0.ci95, None);
}

#[test]
fn the_documents_interval_is_the_last_resort() {
    let mut a = NOISY.render(&mut Random::new(7));
    a.planes.remove("half.nodes");
    let total = crate::Total {
        sum: Sum::Exact(1 << 60),
        mean: 400.0,
        ci95: Some([396.0, 404.0]),
        ci_kind: CiKind::Conservative,
    };
    let document = Document { totals: [("nodes".to_owned(), total)].into(), ..Document::default() };
    let side = Side { document: Some(&document), ..side(&a) };
    let change = compare(side, side, false).unwrap().totals["nodes"];
    let expected = 4.0 * std::f64::consts::SQRT_2 / change.a;
    assert!((change.ci95.unwrap()[1] / expected - 1.0).abs() < 0.01, "{change:?}");
    assert_eq!(change.sum_a, Some(Sum::Exact(1 << 60)));
}

#[test]
fn unlike_renders_are_refused_unless_forced() {
    let a = NOISY.render(&mut Random::new(8));
    let mut one = Document::default();
    one.tree.width = 8;
    one.render.kernel = "single".to_owned();
    type Change = fn(&mut Document);
    let changes: [(&str, Change); 3] = [
        ("tree width (8 and 2)", |d| d.tree.width = 2),
        ("builder ( and sah)", |d| d.tree.builder = "sah".to_owned()),
        ("kernel (single and packet)", |d| d.render.kernel = "packet".to_owned()),
    ];
    for (what, change) in changes {
        let mut two = one.clone();
        change(&mut two);
        let [x, y] = [&one, &two].map(|document| Side { document: Some(document), ..side(&a) });
        let error = compare(x, y, false).unwrap_err();
        assert!(
            matches!(error, crate::Error::Unsupported { .. }) && error.to_string().contains(what),
            "{error}"
        );
        assert!(compare(x, y, true).unwrap().forced);
        assert!(!compare(x, x, true).unwrap().forced);
    }
}

#[test]
fn renders_of_two_sizes_compare_in_total_alone() {
    let a = NOISY.render(&mut Random::new(9));
    let mut b = Layers::new(2, 2);
    b.insert("cost.nodes", vec![100.0, 200.0, 300.0, 400.0]);
    b.insert("half.nodes", vec![1.0, -2.0, 3.0, 4.0]);
    assert!(compare(side(&a), side(&b), false).unwrap_err().to_string().contains("size (32 × 32 and 2 × 2)"));
    let comparison = compare(side(&a), side(&b), true).unwrap();
    assert_eq!(comparison.totals["nodes"].b, 250.0);
    assert!(comparison.totals["nodes"].ci95.is_some());
    assert!(comparison.layers.planes.is_empty());
    assert_eq!(comparison.pixels["nodes"], PixelTests::default());
}

#[test]
fn other_constants_leave_out_what_they_weigh() {
    let mut a = NOISY.render(&mut Random::new(9));
    a.insert("cost.intersection", a.planes["cost.nodes"].clone());
    let mut one = Document::default();
    one.tree.width = 8;
    let two = Document { cost_model: crate::CostModel { c0: 2.0, c1: 1.0 }, ..one.clone() };
    let [x, y] = [&one, &two].map(|document| Side { document: Some(document), ..side(&a) });
    assert!(compare(x, x, false).unwrap().totals.contains_key("intersection"));
    let comparison = compare(x, y, false).unwrap();
    assert!(!comparison.totals.contains_key("intersection") && comparison.totals.contains_key("nodes"));
}

#[test]
fn odd_planes_do_no_harm() {
    let mut a = NOISY.render(&mut Random::new(10));
    a.planes.get_mut("cost.nodes").unwrap()[5] = f32::NAN;
    a.planes.get_mut("half.nodes").unwrap()[6] = f32::INFINITY;
    let (change, _, _) = nodes(&a, &a);
    assert!(change.a.is_finite() && change.ci95.unwrap()[0].is_finite());
    let mut zero = Layers::new(SIZE, SIZE);
    zero.insert("cost.nodes", vec![0.0; zero.pixels()]);
    zero.insert("half.nodes", vec![0.0; zero.pixels()]);
    let (change, tests, _) = nodes(&zero, &a);
    assert_eq!((change.relative, change.ci95, change.significant), (None, None, Some(true)));
    assert!(tests.significant.unwrap() > 900);
    assert_eq!(nodes(&zero, &zero).0.significant, Some(false));
    let mut short = Layers::new(4, 4);
    short.planes.insert("cost.nodes".to_owned(), vec![0.0; 3]);
    assert!(compare(side(&short), side(&short), false).is_err());
}

#[test]
fn gates_read_percentages() {
    let gate = Gate::parse(" nodes = 2.5 %").unwrap();
    assert_eq!((gate.metric, gate.limit), (Metric::Nodes, 0.025));
    for text in ["nodes", "nodes=2", "nodes=x%", "nodes=-1%", "nodes=nan%", "=2%x"] {
        assert!(matches!(Gate::parse(text), Err(GateError::Form(_))), "{text}");
    }
    assert_eq!(Gate::parse("nods=2%"), Err(GateError::Metric("nods".to_owned())));
}

#[test]
fn gates_trip_only_on_significant_growth_beyond_the_limit() {
    let outcome = |relative: Option<f64>, significant: Option<bool>| {
        let change = TotalChange { relative, significant, delta: 1.0, ..TotalChange::default() };
        let comparison =
            Comparison { totals: [("nodes".to_owned(), change)].into(), ..Comparison::default() };
        comparison.gate(&Gate::parse("nodes=2%").unwrap()).outcome
    };
    assert_eq!(outcome(Some(0.03), Some(true)), GateOutcome::Tripped);
    assert_eq!(outcome(Some(0.03), Some(false)), GateOutcome::Passed);
    assert_eq!(outcome(Some(0.03), None), GateOutcome::Undecided);
    assert_eq!(outcome(Some(0.02), Some(true)), GateOutcome::Passed);
    assert_eq!(outcome(Some(-0.5), Some(true)), GateOutcome::Passed);
    assert_eq!(outcome(None, Some(true)), GateOutcome::Tripped);
    assert_eq!(Comparison::default().gate(&Gate::parse("nodes=2%").unwrap()).outcome, GateOutcome::Undecided);
}

#[test]
fn the_json_has_the_keys_that_scripts_rely_on() {
    let a = NOISY.render(&mut Random::new(11));
    let (_, _, comparison) = nodes(&a, &a);
    let json: serde_json::Value = serde_json::from_str(&comparison.to_json()).unwrap();
    assert_eq!(json["schema"], SCHEMA);
    for key in ["a", "b", "delta", "relative", "ci95", "significant"] {
        assert!(!json["totals"]["nodes"][key].is_null(), "{key}");
    }
    for key in ["tested", "significant"] {
        assert!(json["pixels"]["nodes"][key].is_u64(), "{key}");
    }
    let back: Comparison = serde_json::from_value(json).unwrap();
    assert_eq!(back, Comparison { layers: Layers::default(), ..comparison });
}

#[test]
fn scene_class_and_instruction_set_do_not_stand_in_the_way() {
    let a = NOISY.render(&mut Random::new(12));
    let [one, two] = ["bvh8-single-ray avx2 matte", "bvh8-single-ray sse2 lobes"].map(|kernel| {
        let mut document = Document::default();
        document.render.kernel = kernel.to_owned();
        document
    });
    let [x, y] = [&one, &two].map(|document| Side { document: Some(document), ..side(&a) });
    let comparison = compare(x, y, false).unwrap();
    assert!(!comparison.forced);
    assert!(
        comparison.notes.iter().any(|note| note.contains("avx2 matte and bvh8")),
        "{:?}",
        comparison.notes
    );
    // A document that says nothing is none.
    let mut full = one.clone();
    full.tree.width = 8;
    let empty = Document::default();
    let [x, y] = [&full, &empty].map(|document| Side { document: Some(document), ..side(&a) });
    let comparison = compare(x, y, false).unwrap();
    assert!(!comparison.forced && comparison.notes.iter().any(|note| note.contains("document is missing")));
}

#[test]
fn lone_samples_have_no_halves() {
    let mut a = NOISY.render(&mut Random::new(13));
    let pixels = a.pixels();
    a.insert("cost.samples", vec![1.0; pixels]);
    a.insert("half.nodes", vec![0.0; pixels]);
    let (change, tests, _) = nodes(&a, &a);
    assert_eq!((change.ci95, change.ci_kind, tests.tested), (None, CiKind::None, None));
}
