//! Animations (glTF 2.0, section 3.11) at one point in time.
//!
//! The clips of a file have no order of play: all are applied, and where two want to move the same thing, the first does.
//! They are kept from the `gltf` crate and read from the JSON here, so that a broken one does no harm to a still.

use std::collections::HashMap;

use gltf::Accessor;
use serde_json::Value;

use super::accessor::{self, Kind};
use super::document::{Document, label};
use super::schema;
use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid};
use crate::notes::Notes;
use crate::options::LoadOptions;

/// What animations make of a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pose {
    pub(crate) translation: Option<[f64; 3]>,
    /// Unit quaternion x, y, z, w.
    pub(crate) rotation: Option<[f64; 4]>,
    pub(crate) scale: Option<[f64; 3]>,
    /// Weights of the morph targets of the node's mesh.
    pub(crate) weights: Option<Vec<f64>>,
}

impl Pose {
    /// True when the node's transform is animated.
    pub(crate) fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

/// The poses of all animated nodes.
#[derive(Default)]
pub(crate) struct Poses {
    by_node: HashMap<usize, Pose>,
    rest: Pose,
}

impl Poses {
    pub(crate) fn of(&self, node: usize) -> &Pose {
        self.by_node.get(&node).unwrap_or(&self.rest)
    }
}

/// Takes the animations out of the JSON: mended when a point in time is asked for, only named otherwise.
pub(crate) fn take(root: &mut Value, options: &LoadOptions, notes: &mut Notes) -> Result<Vec<Value>> {
    let animations = root.as_object_mut().and_then(|root| root.remove("animations"));
    let Some(Value::Array(mut animations)) = animations else { return Ok(Vec::new()) };
    let Some(time) = options.time else {
        for (i, animation) in animations.iter().enumerate() {
            notes.unmodelled(
                "animation",
                &label_of(i, animation),
                "everything is drawn at rest; choose a point in time with --time",
            );
        }
        return Ok(Vec::new());
    };
    if !time.is_finite() {
        return Err(invalid(
            "animations",
            format!("{time} is not a point in time"),
            "give a finite number of seconds",
        ));
    }
    for (i, animation) in animations.iter_mut().enumerate() {
        schema::mend_element(animation, &mut format!("animations[{i}]"))?;
    }
    Ok(animations)
}

fn label_of(index: usize, animation: &Value) -> String {
    label(&format!("animations[{index}]"), animation.get("name").and_then(Value::as_str))
}

/// What a channel drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
}

/// Evaluates all animations at `time`.
pub(crate) fn poses(doc: &Document<'_>, time: f64, notes: &mut Notes) -> Result<Poses> {
    let mut poses = Poses::default();
    let mut driven: HashMap<(usize, Path), usize> = HashMap::new();
    for (clip, animation) in doc.animations.iter().enumerate() {
        let element = label_of(clip, animation);
        let mut lost = 0u64;
        let channels = animation.get("channels").and_then(Value::as_array);
        for (c, channel) in channels.into_iter().flatten().enumerate() {
            let path = format!("animations[{clip}].channels[{c}]");
            let Some((node, target)) = target(doc, channel, &path, &element, notes)? else { continue };
            doc.budget.charge(1, 512, &path)?;
            // Two channels of one clip with the same target are invalid: the first counts, too.
            if *driven.entry((node, target)).or_insert(clip) != clip {
                lost += 1;
                continue;
            }
            let sampler = Sampler { doc, animation, clip, channel, path: &path };
            let pose = poses.by_node.entry(node).or_default();
            match target {
                Path::Translation if pose.translation.is_none() => {
                    pose.translation = Some(sampler.vector(time, notes)?);
                }
                Path::Scale if pose.scale.is_none() => pose.scale = Some(sampler.vector(time, notes)?),
                Path::Rotation if pose.rotation.is_none() => {
                    pose.rotation = Some(sampler.rotation(time, notes)?);
                }
                Path::Weights if pose.weights.is_none() => {
                    pose.weights = Some(sampler.weights(time, notes)?);
                }
                _ => notes.repair("second channel with the same target ignored", &path, 1),
            }
        }
        if lost > 0 {
            let effect = format!("{lost} of its channels are left out: an earlier animation drives the same");
            notes.unmodelled("overlapping animations", &element, &effect);
        }
    }
    Ok(poses)
}

/// Node and path of a channel; `None` where it has no effect here.
fn target(
    doc: &Document<'_>,
    channel: &Value,
    path: &str,
    element: &str,
    notes: &mut Notes,
) -> Result<Option<(usize, Path)>> {
    let target = match channel.get("target").and_then(|target| Some((target, target.get("path")?.as_str()?)))
    {
        Some((target, name)) => (target, name),
        None => return Err(invalid(format!("{path}.target.path"), "this is missing", REEXPORT)),
    };
    let kind = match target.1 {
        "translation" => Path::Translation,
        "rotation" => Path::Rotation,
        "scale" => Path::Scale,
        "weights" => Path::Weights,
        "pointer" => {
            notes.unmodelled("KHR_animation_pointer", element, "only nodes and morph weights move");
            return Ok(None);
        }
        other => {
            return Err(invalid(
                format!("{path}.target.path"),
                format!("\"{other}\" is not among the values allowed here"),
                REEXPORT,
            ));
        }
    };
    // Without a node, an extension may say what moves; without that, nothing does.
    let Some(node) = target.0.get("node") else { return Ok(None) };
    let count = doc.gltf.nodes().len();
    match node.as_u64().and_then(|node| usize::try_from(node).ok()) {
        Some(node) if node < count => Ok(Some((node, kind))),
        _ => Err(invalid(
            format!("{path}.target.node"),
            format!("index {node} is out of range, the file has {count} nodes"),
            REEXPORT,
        )),
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

/// A channel's sampler.
struct Sampler<'s, 'a> {
    doc: &'s Document<'a>,
    animation: &'s Value,
    clip: usize,
    channel: &'s Value,
    path: &'s str,
}

/// Where a point in time lies among the keys.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Position {
    /// At a key, before the first or after the last.
    At(usize),
    /// Between this key and the next: the share of the way, and the seconds between the two.
    Between(usize, f64, f64),
}

/// Keys of one sampler: how they are joined, and the point in time among them.
struct Keys {
    interpolation: Interpolation,
    count: usize,
    position: Position,
    output: usize,
    path: String,
}

impl Sampler<'_, '_> {
    fn keys(&self, time: f64, notes: &mut Notes) -> Result<Keys> {
        let samplers = self.animation.get("samplers").and_then(Value::as_array);
        let number = self.channel.get("sampler").and_then(Value::as_u64);
        let found = number.and_then(|n| usize::try_from(n).ok()).and_then(|n| Some((n, samplers?.get(n)?)));
        let Some((index, sampler)) = found else {
            let count = samplers.map_or(0, Vec::len);
            return Err(invalid(
                format!("{}.sampler", self.path),
                format!("this is missing or out of range, the animation has {count} samplers"),
                REEXPORT,
            ));
        };
        let path = format!("animations[{}].samplers[{index}]", self.clip);
        let interpolation = match sampler.get("interpolation").map(|value| value.as_str()) {
            None | Some(Some("LINEAR")) => Interpolation::Linear,
            Some(Some("STEP")) => Interpolation::Step,
            Some(Some("CUBICSPLINE")) => Interpolation::CubicSpline,
            _ => {
                let path = format!("{path}.interpolation");
                return Err(invalid(path, "this is not among the values allowed here", REEXPORT));
            }
        };
        let input = self.accessor(sampler, "input", &path)?;
        let times = accessor::vectors::<1>(self.doc, &input, Kind::Float, notes)?;
        if times.is_empty() || times.iter().any(|[t]| !t.is_finite()) {
            return Err(invalid(format!("{path}.input"), "there is no key, or one is not finite", REEXPORT));
        }
        let unsorted = times.iter().zip(times.iter().skip(1)).filter(|(a, b)| a > b).count();
        notes.repair("keys not in order of time", &path, unsorted as u64);
        let output = self.accessor(sampler, "output", &path)?.index();
        Ok(Keys { interpolation, count: times.len(), position: position(&times, time), output, path })
    }

    fn accessor(&self, sampler: &Value, key: &str, path: &str) -> Result<Accessor<'_>> {
        let index = sampler.get(key).and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok());
        index.and_then(|index| self.doc.gltf.accessors().nth(index)).ok_or_else(|| {
            let count = self.doc.gltf.accessors().len();
            invalid(
                format!("{path}.{key}"),
                format!("this is missing or out of range, the file has {count} accessors"),
                REEXPORT,
            )
        })
    }

    /// The sampler's values: `items` of `N` numbers for each key, three times as many for splines.
    fn output<const N: usize>(&self, keys: &Keys, notes: &mut Notes) -> Result<Vec<[f64; N]>> {
        let Some(accessor) = self.doc.gltf.accessors().nth(keys.output) else { return Ok(Vec::new()) };
        let values = accessor::vectors::<N>(self.doc, &accessor, Kind::Value, notes)?;
        self.doc.budget.charge(values.len() as u64, 8 * N as u64, &keys.path)?;
        Ok(values.into_iter().map(|value| value.map(f64::from)).collect())
    }

    fn vector(&self, time: f64, notes: &mut Notes) -> Result<[f64; 3]> {
        let keys = self.keys(time, notes)?;
        let value = keys.interpolate(&self.output(&keys, notes)?, 1, mix)?;
        value.first().copied().ok_or_else(|| keys.wrong_count(0, 1))
    }

    fn rotation(&self, time: f64, notes: &mut Notes) -> Result<[f64; 4]> {
        let keys = self.keys(time, notes)?;
        let value = keys.interpolate(&self.output(&keys, notes)?, 1, slerp)?;
        let q = *value.first().ok_or_else(|| keys.wrong_count(0, 1))?;
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length > 0.0 {
            Ok(q.map(|c| c / length))
        } else {
            notes.repair("rotation without direction ignored", &keys.path, 1);
            Ok([0.0, 0.0, 0.0, 1.0])
        }
    }

    fn weights(&self, time: f64, notes: &mut Notes) -> Result<Vec<f64>> {
        let keys = self.keys(time, notes)?;
        let values = self.output::<1>(&keys, notes)?;
        let items = values.len() / keys.count / keys.values_per_key();
        Ok(keys.interpolate(&values, items, mix)?.into_iter().map(|[weight]| weight).collect())
    }
}

/// Where `time` lies; equal times jump to the last of them.
fn position(times: &[[f32; 1]], time: f64) -> Position {
    let after = times.partition_point(|[key]| f64::from(*key) <= time);
    let Some(before) = after.checked_sub(1) else { return Position::At(0) };
    match (times.get(before), times.get(after)) {
        (Some([start]), Some([end])) => {
            let (start, end) = (f64::from(*start), f64::from(*end));
            let seconds = end - start;
            // Keys out of order may leave nothing between.
            if seconds > 0.0 && time > start && time < end {
                Position::Between(before, (time - start) / seconds, seconds)
            } else {
                Position::At(before)
            }
        }
        _ => Position::At(before),
    }
}

impl Keys {
    fn values_per_key(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    fn wrong_count(&self, found: usize, items: usize) -> LoadError {
        let wanted = items.saturating_mul(self.count).saturating_mul(self.values_per_key());
        invalid(
            format!("{}.output", self.path),
            format!("there are {found} values for {} keys, {wanted} are needed", self.count),
            REEXPORT,
        )
    }

    /// The `items` values at the point in time. `linear` goes from one to the other.
    fn interpolate<const N: usize>(
        &self,
        values: &[[f64; N]],
        items: usize,
        linear: impl Fn([f64; N], [f64; N], f64) -> [f64; N],
    ) -> Result<Vec<[f64; N]>> {
        let per_key = self.values_per_key();
        let wanted = items.checked_mul(self.count).and_then(|n| n.checked_mul(per_key));
        if items == 0 || wanted != Some(values.len()) {
            return Err(self.wrong_count(values.len(), items.max(1)));
        }
        let spline = self.interpolation == Interpolation::CubicSpline;
        // A spline's key holds the tangents towards it, the values, and the tangents from it on.
        let part = |key: usize, part: usize| {
            let start = (key * per_key + part) * items;
            values.get(start..start + items).unwrap_or_default()
        };
        let value = |key| part(key, usize::from(spline));
        let out: Vec<[f64; N]> = match (self.position, self.interpolation) {
            (Position::At(key), _) | (Position::Between(key, ..), Interpolation::Step) => value(key).to_vec(),
            (Position::Between(key, share, _), Interpolation::Linear) => {
                value(key).iter().zip(value(key + 1)).map(|(a, b)| linear(*a, *b, share)).collect()
            }
            (Position::Between(key, s, seconds), Interpolation::CubicSpline) => {
                let weights = [
                    2.0 * s * s * s - 3.0 * s * s + 1.0,
                    seconds * (s * s * s - 2.0 * s * s + s),
                    -2.0 * s * s * s + 3.0 * s * s,
                    seconds * (s * s * s - s * s),
                ];
                // Value and tangent of this key, value and tangent of the next.
                let parts = [value(key), part(key, 2), value(key + 1), part(key + 1, 0)];
                let mut sums = vec![[0.0; N]; items];
                for (values, weight) in parts.into_iter().zip(weights) {
                    for (sum, c) in sums.iter_mut().flatten().zip(values.iter().flatten()) {
                        *sum += weight * c;
                    }
                }
                sums
            }
        };
        if out.iter().flatten().all(|c| c.is_finite()) {
            Ok(out)
        } else {
            Err(invalid(format!("{}.output", self.path), "the value at this time is not finite", REEXPORT))
        }
    }
}

fn mix<const N: usize>(a: [f64; N], b: [f64; N], share: f64) -> [f64; N] {
    let mut out = a;
    for (out, b) in out.iter_mut().zip(b) {
        *out = *out * (1.0 - share) + b * share;
    }
    out
}

/// Along the shorter great arc (glTF 2.0, appendix C.4).
fn slerp(a: [f64; 4], b: [f64; 4], share: f64) -> [f64; 4] {
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let sign = if dot < 0.0 { -1.0 } else { 1.0 };
    let angle = libm::acos(dot.abs().min(1.0));
    let sine = libm::sin(angle);
    // Below, the arc is straight as far as f64 can tell.
    let [from, to] = if sine > 1e-9 {
        [libm::sin(angle * (1.0 - share)) / sine, libm::sin(angle * share) / sine]
    } else {
        [1.0 - share, share]
    };
    let mut out = a.map(|c| c * from);
    for (out, b) in out.iter_mut().zip(b) {
        *out += sign * to * b;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_found_among_equal_and_disordered_keys() {
        let times = [[1.0f32], [2.0], [2.0], [4.0]];
        assert_eq!(position(&times, 0.0), Position::At(0));
        assert_eq!(position(&times, 1.0), Position::At(0));
        assert_eq!(position(&times, 1.25), Position::Between(0, 0.25, 1.0));
        assert_eq!(position(&times, 2.0), Position::At(2));
        assert_eq!(position(&times, 3.0), Position::Between(2, 0.5, 2.0));
        assert_eq!(position(&times, 9.0), Position::At(3));
        // Whatever is answered, the keys exist.
        let disordered = [[3.0f32], [1.0], [2.0], [0.0]];
        for time in [-1.0, 0.5, 1.5, 2.5, 3.5] {
            match position(&disordered, time) {
                Position::At(key) => assert!(key < 4),
                Position::Between(key, share, _) => assert!(key < 3 && (0.0..=1.0).contains(&share)),
            }
        }
    }

    #[test]
    fn slerp_takes_the_shorter_arc_at_constant_speed() {
        let about_z = |degrees: f64| {
            let half = degrees.to_radians() / 2.0;
            [0.0, 0.0, half.sin(), half.cos()]
        };
        let close = |a: [f64; 4], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(close(slerp(about_z(0.0), about_z(90.0), 0.25), about_z(22.5)));
        // The negated quaternion is the same rotation: no way round the back.
        assert!(close(slerp(about_z(0.0), about_z(90.0).map(|c| -c), 0.25), about_z(22.5)));
        assert!(close(slerp(about_z(10.0), about_z(10.0), 0.5), about_z(10.0)));
        assert!(close(slerp(about_z(0.0), about_z(1e-9), 0.5), about_z(0.5e-9)));
    }
}
