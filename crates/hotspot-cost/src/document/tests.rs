use super::*;
use crate::ledger::{MatrixRow, PayerRow, SpawnerRow};
use crate::testing::random_frame;
use crate::{FrameDesc, Sum, hotspots};
use serde_json::json;
use std::collections::BTreeSet;

/// A document in which every key has a value.
fn full() -> Document {
    let frame = random_frame(FrameDesc { intervals: true, ..FrameDesc::new(32, 16) }, 2, 3);
    let mut document = Document::of_frame(&frame, &LayerOptions::default());
    document.cost_unit = Some("ns".into());
    document.hotspots =
        hotspots::of_frame(&frame, CostModel::default(), &["a", "b", "c", "d"].map(String::from), 5);
    document.hotspots[0].causes = vec![hotspots::Finding {
        kind: hotspots::CauseKind::HeavyLeaves,
        share: Some(0.5),
        objects: vec![1],
        names: vec!["b".to_owned()],
        ..hotspots::Finding::default()
    }];
    document.hotspots[0].whatif = vec!["--delete=a".to_owned()];
    document.verdict = hotspots::verdict(&document.hotspots);
    document.command = vec!["hotspot-render".to_owned()];
    document.settings.insert("seed".to_owned(), json!(7));
    document.ledgers = Some(Ledgers {
        objects: vec!["a".to_owned()],
        materials: vec!["m".to_owned()],
        merged_objects: 0,
        spawner: vec![SpawnerRow { object: Some(0), light: Some(0), ..SpawnerRow::default() }],
        payer: vec![PayerRow::default()],
        matrix: vec![MatrixRow { others: true, ..MatrixRow::default() }],
    });
    let note = Note { what: "x".to_owned(), element: "/meshes/0".to_owned(), count: 1 };
    document.unmodelled = vec![note.clone()];
    document.repairs = vec![note];
    let totals = [("nodes".to_owned(), 0.01)].into();
    document.render.stopped = Some(Stopped::TargetError);
    document.depth_limit = DepthLoss::of(&frame, 15);
    document.tree_noise = Some(crate::TreeNoise { trees: 5, samples_per_pixel: 4, totals });
    document.views = vec![View {
        file: "x.png".to_owned(),
        metric: Some("rays".to_owned()),
        scale: Some([0.0, 1.0]),
        exposure_ev: Some(0.5),
        altered: vec!["clipped".to_owned()],
    }];
    document
}

fn schema() -> Value {
    serde_json::from_str(JSON_SCHEMA).unwrap()
}

/// Checks the parts of JSON Schema that ours uses, and collects the properties met. Unlike the published schema it takes
/// no unknown keys, so that the two cannot drift apart.
fn check(
    value: &Value,
    schema: &Value,
    root: &Value,
    path: &str,
    met: &mut BTreeSet<String>,
) -> Result<(), String> {
    if let Some(reference) = schema["$ref"].as_str() {
        let target = root.pointer(reference.strip_prefix('#').unwrap()).unwrap();
        return check(value, target, root, path, met);
    }
    let fail = |what: &str| Err(format!("{path}: {what}: {value}"));
    if schema.get("const").is_some_and(|expected| expected != value) {
        return fail("not the constant");
    }
    if schema["enum"].as_array().is_some_and(|values| !values.contains(value)) {
        return fail("not in the enumeration");
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_u64() || number.is_i64() => "integer",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let matches = |expected: &Value| expected == kind || (expected == "number" && kind == "integer");
    let allowed = match &schema["type"] {
        Value::Null => true,
        Value::Array(types) => types.iter().any(matches),
        one => matches(one),
    };
    if !allowed {
        return fail("wrong type");
    }
    if let Some(items) = value.as_array() {
        if schema["minItems"].as_u64().is_some_and(|least| (items.len() as u64) < least)
            || schema["maxItems"].as_u64().is_some_and(|most| items.len() as u64 > most)
        {
            return fail("wrong number of items");
        }
        for (index, item) in items.iter().enumerate() {
            check(item, &schema["items"], root, &format!("{path}/{index}"), met)?;
        }
    }
    if let Some(object) = value.as_object() {
        for name in schema["required"].as_array().into_iter().flatten() {
            if !object.contains_key(name.as_str().unwrap()) {
                return fail(&format!("{name} is missing"));
            }
        }
        for (name, member) in object {
            let inner = format!("{path}/{name}");
            match (schema["properties"].get(name), &schema["additionalProperties"]) {
                (Some(property), _) => {
                    met.insert(format!("{:p}", std::ptr::from_ref(property)));
                    check(member, property, root, &inner, met)?;
                }
                (None, Value::Bool(true)) => {}
                (None, Value::Object(_)) => {
                    check(member, &schema["additionalProperties"], root, &inner, met)?;
                }
                (None, _) => return fail(&format!("{name} is not in the schema")),
            }
        }
    }
    Ok(())
}

/// Every property that the schema names anywhere.
fn properties(schema: &Value, path: &str, all: &mut Vec<(String, String)>) {
    match schema {
        Value::Object(object) => {
            for (name, inner) in object {
                let inner_path = format!("{path}/{name}");
                if name == "properties" {
                    for (property, value) in inner.as_object().unwrap() {
                        all.push((
                            format!("{:p}", std::ptr::from_ref(value)),
                            format!("{inner_path}/{property}"),
                        ));
                    }
                }
                properties(inner, &inner_path, all);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| properties(item, path, all)),
        _ => {}
    }
}

/// Holds a value with every key against its schema, both ways.
pub(crate) fn agree(value: &Value, schema: &Value) {
    let mut met = BTreeSet::new();
    check(value, schema, schema, "", &mut met).unwrap();
    let mut all = Vec::new();
    properties(schema, "", &mut all);
    let unmet: Vec<_> = all.iter().filter(|(id, _)| !met.contains(id)).map(|(_, path)| path).collect();
    assert!(unmet.is_empty(), "in the schema but never written: {unmet:?}");
    assert!(all.len() > 20, "{}", all.len());
}

#[test]
fn the_document_and_its_schema_agree_both_ways() {
    agree(&serde_json::from_str(&full().to_json()).unwrap(), &schema());
}

#[test]
fn the_checker_can_fail() {
    let schema = schema();
    let good: Value = serde_json::from_str(&full().to_json()).unwrap();
    let damages: [fn(&mut Value); 6] = [
        |v| v["schema"] = json!("other/1"),
        |v| v["render"]["threads"] = json!("two"),
        |v| v["totals"]["nodes"]["ci95"] = json!([1.0]),
        |v| v["totals"]["nodes"]["ci_kind"] = json!("guess"),
        |v| drop(v["memory"].as_object_mut().unwrap().remove("bvh")),
        |v| v["unmodelled"][0]["extra"] = json!(1),
    ];
    for damage in damages {
        let mut bad = good.clone();
        damage(&mut bad);
        assert!(check(&bad, &schema, &schema, "", &mut BTreeSet::new()).is_err());
    }
}

#[test]
fn documents_survive_json_exactly() {
    let mut document = full();
    let total = document.totals.get_mut("nodes").unwrap();
    total.sum = Sum::Exact(u64::MAX - 1);
    total.mean = 0.1 + 0.2;
    assert!(!document.hotspots.is_empty());
    let text = document.to_json();
    assert!(text.contains("18446744073709551614"));
    // Which pixels a hotspot has stays in memory.
    for hotspot in &mut document.hotspots {
        assert!(!std::mem::take(&mut hotspot.members).is_empty());
    }
    assert_eq!(Document::from_json(&text, "x.json").unwrap(), document);
}

#[test]
fn keys_may_be_missing_or_new_but_the_schema_must_fit() {
    let document = Document::from_json(r#"{"schema": "hotspot-render/1", "later": {}}"#, "x").unwrap();
    assert_eq!(document.totals.len(), 0);
    let error = Document::from_json(r#"{"schema": "hotspot-render/2"}"#, "x.json").unwrap_err();
    assert!(matches!(&error, Error::Unsupported { place, .. } if place == "x.json"), "{error}");
    assert!(matches!(Document::from_json("{}", "x"), Err(Error::Unsupported { .. })));
    assert!(matches!(Document::from_json("{", "x"), Err(Error::Invalid { .. })));
}

/// What is made side by side does not depend on by how many.
#[test]
fn threads_change_nothing() {
    for intervals in [false, true] {
        let frame = random_frame(FrameDesc { intervals, ..FrameDesc::new(75, 43) }, 3, 5);
        let made = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let layers = crate::Layers::from_frame(&frame, &LayerOptions::default());
                let names = ["a", "b", "c", "d"].map(String::from);
                let found = hotspots::of_frame(&frame, CostModel::default(), &names, 5);
                (layers, found, Document::of_frame(&frame, &LayerOptions::default()))
            })
        };
        let (one, many) = (made(1), made(4));
        assert!(one.2.estimated_relmse.is_some() && !one.1.is_empty());
        assert_eq!(one, many);
    }
}

#[test]
fn samples_are_counted() {
    let document = full();
    assert_eq!((document.samples_per_pixel, document.cost_samples_per_pixel), (4, 4));
    assert_eq!(document.samples, Samples { radiance: 32 * 16 * 4, cost: 32 * 16 * 4 });
    assert_eq!(document.estimated_relmse_kind, CiKind::Halves);
    assert_eq!(document.memory.film, 32 * 16 * 2 * (56 + size_of::<crate::CostPixel>() as u64));
}

#[test]
fn digests_follow_every_sum_but_time() {
    let desc = FrameDesc { intervals: true, tile: 8, ..FrameDesc::new(16, 16) };
    let frame = random_frame(desc, 1, 3);
    let digest = Digest::of(&frame);
    // Tiling is not part of the result.
    let mut other = Frame::new(FrameDesc { tile: 5, ..desc });
    for tile in frame.clone().tiles_mut().iter() {
        other.merge(tile);
    }
    assert_eq!(Digest::of(&other), digest);
    let mut timed = frame.clone();
    timed.tiles_mut()[0].add_time(0, 0, 1, 5, 1);
    assert_eq!(Digest::of(&timed), digest);
    let mut brighter = frame.clone();
    brighter.tiles_mut()[3].film_mut(15, 15, 1).sum[2] += 1e-12;
    assert_ne!(Digest::of(&brighter).radiance, digest.radiance);
    assert_eq!(Digest::of(&brighter).counters, digest.counters);
    let mut costlier = frame.clone();
    let mut random = crate::testing::Random::new(1);
    crate::testing::random_path(&mut costlier, 15, 15, 1, &mut random, 1);
    assert_ne!(Digest::of(&costlier).counters, digest.counters);
    assert_eq!(Digest::of(&Frame::new(FrameDesc { cost: false, ..desc })).counters, None);
}
