//! Animations at a point in time.

use std::f64::consts::FRAC_1_SQRT_2;

use serde_json::{Value, json};

use crate::support::*;

/// A square whose translation is animated with the given interpolation.
fn moving(interpolation: &str, times: &[f32], values: &[f32]) -> (Value, Vec<u8>) {
    let (mut json, mut bin) = square();
    let input = float_accessor(&mut json, &mut bin, times, "SCALAR");
    let output = float_accessor(&mut json, &mut bin, values, "VEC3");
    json["animations"] = json!([{"name": "Slide",
        "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
    (json, bin)
}

fn place(json: &Value, bin: &[u8], time: f64) -> [f64; 3] {
    let scene = load_at(json, bin, time).unwrap();
    scene.instances[0].to_world.map(|row| row[3])
}

#[test]
fn steps_and_lines_hold_their_ends() {
    let values = [1.0, 0.0, 0.0, 3.0, 4.0, 0.0, 3.0, 4.0, 8.0];
    let (mut json, bin) = moving("LINEAR", &[1.0, 2.0, 4.0], &values);
    let cases = [
        (-5.0, [1.0, 0.0, 0.0]),
        (1.0, [1.0, 0.0, 0.0]),
        (1.25, [1.5, 1.0, 0.0]),
        (2.0, [3.0, 4.0, 0.0]),
        (3.0, [3.0, 4.0, 4.0]),
        (99.0, [3.0, 4.0, 8.0]),
    ];
    for (time, wanted) in cases {
        assert_close(&place(&json, &bin, time), &wanted, 1e-12);
    }
    json["animations"][0]["samplers"][0]["interpolation"] = "STEP".into();
    assert_eq!(place(&json, &bin, 1.99), [1.0, 0.0, 0.0]);
    assert_eq!(place(&json, &bin, 2.0), [3.0, 4.0, 0.0]);
    // Linear is the default.
    json["animations"][0]["samplers"][0].as_object_mut().unwrap().remove("interpolation");
    assert_close(&place(&json, &bin, 1.25), &[1.5, 1.0, 0.0], 1e-12);
}

#[test]
fn splines_follow_hermites_formula() {
    // Keys at 0 and 2 seconds: in-tangent, value, out-tangent.
    let key = |into: f32, value: f32, out: f32| [into, 0.0, 0.0, value, 5.0, 0.0, out, 0.0, 0.0];
    let (json, bin) = moving("CUBICSPLINE", &[0.0, 2.0], &[key(9.0, 1.0, 2.0), key(-4.0, 3.0, 9.0)].concat());
    // s = 1/4, 2 seconds: h00 = 27/32, h10 = 9/64, h01 = 5/32, h11 = -3/64.
    let wanted = 27.0 / 32.0 + 2.0 * 9.0 / 64.0 * 2.0 + 3.0 * 5.0 / 32.0 + 2.0 * (-3.0 / 64.0) * -4.0;
    assert_close(&place(&json, &bin, 0.5), &[wanted, 5.0, 0.0], 1e-12);
    assert_eq!(place(&json, &bin, -1.0), [1.0, 5.0, 0.0]);
    assert_eq!(place(&json, &bin, 2.0), [3.0, 5.0, 0.0]);
}

#[test]
fn rotations_go_round_at_constant_speed_also_normalised() {
    let (mut json, mut bin) = square();
    let input = float_accessor(&mut json, &mut bin, &[0.0, 1.0], "SCALAR");
    let half = FRAC_1_SQRT_2 as f32;
    let output = float_accessor(&mut json, &mut bin, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -half, -half], "VEC4");
    // The same as 16-bit integers.
    let shorts = [0i16, 0, 0, 32767, 0, 0, -23170, -23170];
    let shorts: Vec<u8> = shorts.iter().flat_map(|c| c.to_le_bytes()).collect();
    let shorts = accessor(&mut json, &mut bin, &shorts, 5122, "VEC4");
    json["accessors"][shorts]["normalized"] = true.into();
    json["nodes"][0]["scale"] = json!([2, 1, 1]);
    for output in [output, shorts] {
        json["animations"] = json!([{"samplers": [{"input": input, "output": output}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}]);
        let matrix = load_at(&json, &bin, 1.0 / 3.0).unwrap().instances[0].to_world;
        // A third of 90 degrees; the scale of the node stays.
        let (sin, cos) = 30f64.to_radians().sin_cos();
        assert_close(&[matrix[0][0], matrix[1][0], matrix[0][1]], &[2.0 * cos, 2.0 * sin, -sin], 2e-5);
    }
}

#[test]
fn weights_are_animated() {
    let (mut json, mut bin) = square();
    let up = float_accessor(&mut json, &mut bin, &[0.0, 0.0, 1.0].repeat(4), "VEC3");
    let right = float_accessor(&mut json, &mut bin, &[1.0, 0.0, 0.0].repeat(4), "VEC3");
    json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}, {"POSITION": right}]);
    json["nodes"][0]["weights"] = json!([9, 9]);
    let input = float_accessor(&mut json, &mut bin, &[0.0, 1.0], "SCALAR");
    let output = float_accessor(&mut json, &mut bin, &[0.0, 1.0, 4.0, 2.0], "SCALAR");
    json["animations"] = json!([{"samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]);
    let at = |time| load_at(&json, &bin, time).unwrap().meshes[0].positions[0];
    assert_eq!(at(0.0), [1.0, 0.0, 0.0]);
    assert_eq!(at(0.5), [1.5, 0.0, 2.0]);
    // Without a time, the node's own.
    assert_eq!(load_pair(&json, &bin).unwrap().meshes[0].positions[0], [9.0, 0.0, 9.0]);
    // A spline: nothing but the number of values tells how many weights there are.
    let spline: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let output = float_accessor(&mut json, &mut bin, &spline, "SCALAR");
    json["animations"][0]["samplers"][0] =
        json!({"input": input, "output": output, "interpolation": "CUBICSPLINE"});
    let scene = load_at(&json, &bin, 0.0).unwrap();
    assert_eq!(scene.meshes[0].positions[0], [3.0, 0.0, 2.0]);
}

#[test]
fn cameras_and_joints_move_along() {
    let (mut json, bin) = moving("LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, 0.0, 6.0]);
    json["nodes"][0]["camera"] = 0.into();
    json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1}}]);
    let scene = load_at(&json, &bin, 0.5).unwrap();
    assert_eq!(scene.cameras[0].to_world[2][3], 3.0);
    assert!(scene.unmodelled.is_empty() && scene.repairs.is_empty());
}

#[test]
fn the_first_animation_wins_and_the_losers_are_named() {
    let (mut json, bin) = moving("LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let mut second = json["animations"][0].clone();
    second["name"] = "Jump".into();
    push(&mut second["channels"], json!({"sampler": 0, "target": {"node": 0, "path": "scale"}}));
    push(&mut json["animations"], second);
    let scene = load_at(&json, &bin, 1.0).unwrap();
    assert_eq!(scene.instances[0].to_world, [[1.0, 0.0, 0.0, 1.0], [0.0; 4], [0.0; 4]]);
    assert_eq!(scene.unmodelled.len(), 1);
    assert_eq!(scene.unmodelled[0].element, "animations[1] \"Jump\"");
    assert!(scene.unmodelled[0].effect.starts_with("1 of its channels"));
}

#[test]
fn what_does_not_move_is_named() {
    let (mut json, bin) = moving("LINEAR", &[0.0, 1.0], &[0.0; 6]);
    json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1]);
    push(
        &mut json["animations"][0]["channels"],
        json!({"sampler": 0, "target": {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/x"}}}}),
    );
    push(&mut json["animations"][0]["channels"], json!({"sampler": 0, "target": {"path": "scale"}}));
    let scene = load_at(&json, &bin, 1.0).unwrap();
    assert_eq!(scene.instances[0].to_world[0][3], 7.0);
    assert_eq!(repaired(&scene, "node with a matrix"), 1);
    assert_eq!(scene.unmodelled.len(), 1);
    assert_eq!(scene.unmodelled[0].feature, "KHR_animation_pointer");
    // At rest, nothing of this matters.
    let rest = load_pair(&json, &bin).unwrap();
    assert_eq!((rest.repairs.len(), rest.unmodelled.len()), (0, 1));
    assert_eq!(rest.unmodelled[0].feature, "animation");
    assert!(rest.unmodelled[0].effect.contains("--time"));
}

#[test]
fn broken_animations_are_refused_by_name_and_do_no_harm_at_rest() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change, &[&str]); 11] = [
        ("no sampler", |a| a["channels"][0]["sampler"] = 5.into(), &["animations[0].channels[0].sampler"]),
        ("no path", |a| a["channels"][0]["target"] = json!({"node": 0}), &["channels[0].target.path"]),
        ("odd path", |a| a["channels"][0]["target"]["path"] = "colour".into(), &["target.path", "colour"]),
        ("no such node", |a| a["channels"][0]["target"]["node"] = 9.into(), &["target.node", "9"]),
        ("no input", |a| a["samplers"][0]["input"] = 77.into(), &["samplers[0].input"]),
        ("no output", |a| a["samplers"][0]["output"] = Value::Null, &["samplers[0].output"]),
        ("odd way", |a| a["samplers"][0]["interpolation"] = "CURVE".into(), &["samplers[0].interpolation"]),
        ("input of another type", |a| a["samplers"][0]["input"] = 0.into(), &["accessors[0].type", "SCALAR"]),
        ("output of another type", |a| a["samplers"][0]["output"] = 4.into(), &["accessors[4].type", "VEC3"]),
        (
            "too few values",
            |a| a["samplers"][0]["output"] = 6.into(),
            &["samplers[0].output", "1 values for 2"],
        ),
        (
            "no spline",
            |a| a["samplers"][0]["interpolation"] = "CUBICSPLINE".into(),
            &["samplers[0].output", "6 are needed"],
        ),
    ];
    for (case, change, parts) in cases {
        let (mut json, mut bin) = moving("LINEAR", &[0.0, 1.0], &[0.0; 6]);
        float_accessor(&mut json, &mut bin, &[0.0; 3], "VEC3");
        change(&mut json["animations"][0]);
        assert_refused(load_at(&json, &bin, 0.5), case, "test.glb", parts);
        assert!(load_pair(&json, &bin).is_ok(), "{case}");
    }
    let (json, bin) = moving("LINEAR", &[0.0, f32::NAN], &[0.0; 6]);
    assert_refused(load_at(&json, &bin, 0.5), "NaN key", "test.glb", &["samplers[0].input"]);
    let (json, bin) = moving("LINEAR", &[0.0, 1.0], &[f32::INFINITY; 6]);
    assert_refused(load_at(&json, &bin, 0.5), "infinite value", "test.glb", &["samplers[0].output"]);
    assert_refused(load_at(&json, &bin, f64::NAN), "no time", "test.glb", &["animations", "NaN"]);
    let (json, bin) = moving("LINEAR", &[1.0, 0.0], &[0.0; 6]);
    assert_eq!(repaired(&load_at(&json, &bin, 0.5).unwrap(), "not in order"), 1);
    let mut json = json;
    json["animations"] = json!([7, {"channels": 3}, {"channels": [{}]}]);
    assert!(load_at(&json, &bin, 0.5).is_err() && load_pair(&json, &bin).is_ok());
}
