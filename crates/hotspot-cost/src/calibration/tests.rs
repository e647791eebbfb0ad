//! Fits of tiles whose truth is known.

use super::*;
use crate::testing::Random;

/// Nanoseconds that made the tiles below, in the order of [`Term::ALL`].
const TRUTH: [f64; Term::COUNT] = [30.0, 45.0, 90.0, 12.0, 1.5, 25.0, 3.0, 20.0, 60.0, 35.0, 0.2, 15.0];

/// Tiles with random counts, time by [`TRUTH`] with relative noise, partly shared by blocks of 2 × 2 tiles.
fn tiles(columns: u32, rows: u32, noise: f64, random: &mut Random) -> Tiles {
    let mut scene = Tiles { columns, rows, ..Tiles::default() };
    let shared: Vec<f64> = (0..(columns.div_ceil(2) * rows.div_ceil(2))).map(|_| random.normal()).collect();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let mut terms = [1.0; Term::COUNT];
        let scales = [1.0, 3.0, 2.0, 40.0, 250.0, 12.0, 60.0, 4.0, 5.0, 3.0, 200.0, 2.0];
        for (term, scale) in terms.iter_mut().zip(scales).skip(1) {
            *term = scale * (0.5 + random.unit());
        }
        let exact: f64 = terms.iter().zip(TRUTH).map(|(x, b)| x * b).sum();
        let block = shared[(row / 2 * columns.div_ceil(2) + column / 2) as usize];
        // The scatter grows with the time: intervals must stand that.
        let mut measured =
            || exact * (1.0 + noise * (0.6 * block + 0.8 * random.normal()) * (exact / 1500.0));
        let [a, b] = [measured(), measured()];
        let noise = 0.25 * (a - b).powi(2);
        scene.tiles.push(Tile { column, row, terms, ns: 0.5 * (a + b), noise });
    }
    scene
}

#[test]
fn recovers_the_truth_without_noise() {
    let scene = tiles(20, 12, 0.0, &mut Random::new(1));
    let found = fit(&[&scene], Form::Full);
    for (term, coefficient) in &found.coefficients {
        let truth = TRUTH[*term as usize];
        assert!((coefficient.ns - truth).abs() < 1e-3 * truth, "{}: {coefficient:?}", term.name());
        assert!(coefficient.ci95[0] <= coefficient.ns && coefficient.ns <= coefficient.ci95[1]);
    }
    let score = found.held_out.unwrap();
    assert!(score.r2.unwrap() > 0.999_999 && score.nrmse < 1e-5, "{score:?}");
    assert!((score.r2_of_repeat.unwrap() - score.r2.unwrap()).abs() < 1e-12, "there is no noise");
    assert!((found.predict(&scene.tiles[7].terms) / scene.tiles[7].ns - 1.0).abs() < 1e-5);
    let two = fit(&[&scene], Form::Two).held_out.unwrap();
    assert!(two.r2.unwrap() < 0.9, "{two:?}");
}

/// 95 % intervals of the coefficients that are well above 0. Of 12 × 100 intervals, dependent within a fit, 95 % should
/// cover. For the bound of 92.5 % to fail by chance, as few as 1110 of 1200 would have to: at an effective 400 independent
/// intervals the standard deviation is 1.1 %, so that the false-alarm rate is about 1 %; the seed is fixed.
#[test]
fn intervals_cover_the_truth() {
    let mut random = Random::new(11);
    let (mut covered, mut all) = (0, 0);
    for _ in 0..100 {
        let scene = tiles(24, 20, 0.02, &mut random);
        for (term, c) in fit(&[&scene], Form::Full).coefficients {
            let truth = TRUTH[term as usize];
            all += 1;
            covered += u32::from(c.ci95[0] <= truth && truth <= c.ci95[1]);
        }
    }
    let share = f64::from(covered) / f64::from(all);
    assert!((0.925..=0.985).contains(&share), "{covered} of {all}");
}

/// Predictions of held-out tiles must not depend on their times; a change of any other tile of the other colour must show.
#[test]
fn held_out_tiles_are_held_out() {
    let scene = tiles(10, 8, 0.05, &mut Random::new(2));
    for form in Form::ALL {
        let before = held_out(&[&scene], form).remove(0);
        let mut changed = scene.clone();
        for tile in changed.tiles.iter_mut().filter(|tile| (tile.row + tile.column) % 2 == 0) {
            tile.ns *= 3.0 + f64::from(tile.row);
        }
        let after = held_out(&[&changed], form).remove(0);
        // The scene's mean time is but a common weight: it moves rounding alone.
        for (i, tile) in scene.tiles.iter().enumerate() {
            let same = (before[i] / after[i] - 1.0).abs() < 1e-9;
            assert_eq!(same, (tile.row + tile.column) % 2 == 0, "{form:?}, tile {i}");
        }
    }
}

#[test]
fn noise_explains_itself_by_repeats() {
    let scene = tiles(40, 30, 0.05, &mut Random::new(4));
    // Of the variance of a tile's time 0.36 is shared within blocks and by both runs: a repeat does not show it. 0.64 / 2 is
    // what it shows, and the rest of what the fit leaves.
    let ceiling = repeat_r2(&scene).unwrap();
    assert!((0.3..0.98).contains(&ceiling), "{ceiling}");
    let score = fit(&[&scene], Form::Full).held_out.unwrap();
    assert!((score.r2_of_repeat.unwrap() - score.r2.unwrap() / ceiling).abs() < 1e-12);
    let flat = Tiles { columns: 1, rows: 1, tiles: vec![scene.tiles[0]], ..Tiles::default() };
    let score = fit(&[&flat], Form::Two).held_out.unwrap();
    assert_eq!((score.r2, score.r2_of_repeat), (None, None));
    assert_eq!(fit(&[&Tiles::default()], Form::Full).held_out.unwrap(), Score::default());
}

#[test]
fn scenes_count_alike_and_teach_each_other() {
    let mut random = Random::new(6);
    let (small, large) = (tiles(10, 8, 0.01, &mut random), tiles(40, 20, 0.01, &mut random));
    let both = [&small, &large];
    let predicted = held_out(&both, Form::Full);
    assert_eq!((predicted[0].len(), predicted[1].len()), (80, 800));
    for (scene, predicted) in both.iter().zip(&predicted) {
        assert!(score(scene, predicted).r2.unwrap() > 0.9);
    }
    let from_large = scene_held_out(&both, 0, Form::Full);
    assert!(score(&small, &from_large).r2.unwrap() > 0.9);
    assert!(scene_held_out(&[&small], 0, Form::Full).is_empty());
    // Leaving a scene out leaves it out.
    let mut changed = small.clone();
    changed.tiles.iter_mut().for_each(|tile| tile.ns *= 2.0);
    assert_eq!(scene_held_out(&[&changed, &large], 0, Form::Full), from_large);
}

#[test]
fn traversal_is_the_share_of_nodes_boxes_leaves_and_shapes() {
    let mut scene = tiles(24, 20, 0.0, &mut Random::new(8));
    // Boxes and leaves in proportion: then nodes and shapes say it all.
    for tile in &mut scene.tiles {
        tile.terms[Term::Boxes as usize] = 6.0 * tile.terms[Term::Nodes as usize];
        tile.terms[Term::Leaves as usize] = 0.2 * tile.terms[Term::Shapes as usize];
        tile.ns = tile.terms.iter().zip(TRUTH).map(|(x, b)| x * b).sum();
        tile.noise = 0.0;
    }
    let found = traversal(&[&scene]);
    assert!((found.c0.ns - (12.0 + 6.0 * 1.5)).abs() < 1e-3, "{found:?}");
    assert!((found.c1.ns - (3.0 + 0.2 * 25.0)).abs() < 1e-3, "{found:?}");
    assert!(found.r2 > 0.999_999);
    assert_eq!(found.model().c0, found.c0.ns);
}

#[test]
fn the_same_on_every_run() {
    let scene = tiles(12, 10, 0.05, &mut Random::new(12));
    assert_eq!(fit(&[&scene], Form::Full), fit(&[&scene], Form::Full));
}

#[test]
fn profiles_are_read_as_written_and_damaged_ones_refused() {
    let scene = tiles(12, 10, 0.05, &mut Random::new(3));
    let mut profile = Profile {
        schema: PROFILE_SCHEMA.into(),
        intersection: traversal(&[&scene]),
        fits: Form::ALL.map(|form| (form, fit(&[&scene], form))).into(),
        scenes: vec![SceneProfile {
            fits: [(Form::Full, fit(&[&scene], Form::Full))].into(),
            ..SceneProfile::default()
        }],
        ..Profile::default()
    };
    let text = profile.to_json();
    assert_eq!(Profile::from_json(&text, "p.json").unwrap(), profile);
    let broken = [
        text.replace("hotspot-profile/1", "hotspot-profile/9"),
        text.replacen("\"ns\": ", "\"ns\": -", 1),
        text[..text.len() / 2].to_owned(),
        "{}".to_owned(),
    ];
    for text in broken {
        let message = Profile::from_json(&text, "p.json").unwrap_err().to_string();
        assert!(message.starts_with("p.json: ") && message.contains("calibrate"), "{message}");
    }
    profile.intersection = Traversal::default();
    assert!(Profile::from_json(&profile.to_json(), "p.json").is_err());
}

/// Every key that is written is in the schema, and nothing in the schema's `required` is missing.
#[test]
fn the_schema_names_what_is_written() {
    use serde_json::Value;
    fn check(schema: &Value, root: &Value, value: &Value, path: &str) {
        let schema = match schema["$ref"].as_str() {
            Some(name) => &root["$defs"][name.trim_start_matches("#/$defs/")],
            None => schema,
        };
        assert!(schema.is_object(), "{path}: no schema");
        match value {
            Value::Object(members) => {
                for (key, member) in members {
                    let known = &schema["properties"][key];
                    let known = if known.is_null() { &schema["additionalProperties"] } else { known };
                    if *known != Value::Bool(true) {
                        check(known, root, member, &format!("{path}/{key}"));
                    }
                }
                for key in schema["required"].as_array().into_iter().flatten() {
                    assert!(members.contains_key(key.as_str().unwrap()), "{path}: {key} is missing");
                }
            }
            Value::Array(items) => {
                items.iter().for_each(|item| check(&schema["items"], root, item, &format!("{path}/[]")));
            }
            _ => {}
        }
    }
    let scene = tiles(12, 10, 0.05, &mut Random::new(3));
    let fits: std::collections::BTreeMap<_, _> = Form::ALL.map(|form| (form, fit(&[&scene], form))).into();
    let scores: std::collections::BTreeMap<_, _> =
        Form::ALL.map(|form| (form, fits[&form].held_out.unwrap())).into();
    let profile = Profile {
        schema: PROFILE_SCHEMA.into(),
        settings: [("spp".to_owned(), serde_json::json!(16))].into(),
        kernels: vec!["k".into()],
        intersection: traversal(&[&scene]),
        fits: fits.clone(),
        scenes: vec![SceneProfile {
            fits,
            pooled: scores.clone(),
            from_other_scenes: scores,
            drift: vec![1.0],
            ..SceneProfile::default()
        }],
        ..Profile::default()
    };
    let schema: Value = serde_json::from_str(PROFILE_JSON_SCHEMA).unwrap();
    assert_eq!(schema["properties"]["schema"]["const"], PROFILE_SCHEMA);
    check(&schema, &schema, &serde_json::to_value(&profile).unwrap(), "");
}
