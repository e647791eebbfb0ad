//! Changes of a scene, to ask what they would do to its cost: [`apply`] makes an edited copy.
//!
//! Objects and materials keep their numbers: an object that is deleted loses its instances and stays in the list, so that the
//! two scenes can be compared object by object. The environment is left alone. A scene that has no light left therefore stays
//! dark only where the caller states an environment (`hotspot-integrator` lights scenes without any by a white one).

mod surface;

use crate::scene::{Bsdf, Material, Scene};
use std::fmt;

/// One change.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Makes a material matte: what it scatters diffusely stays, or becomes its base colour.
    Matte {
        /// Its name.
        material: String,
    },
    /// Sets the roughness of a material, 0 to 1 as glTF has it; a mirror of roughness above 0 becomes a rough metal, and the
    /// other way round. A roughness texture goes on to be multiplied in.
    Roughness {
        /// Its name.
        material: String,
        /// 0 to 1.
        roughness: f32,
    },
    /// Takes an object away: all its instances.
    Delete {
        /// Its name.
        object: String,
    },
    /// Moves an object, with all its instances, by a vector in world space.
    Move {
        /// Its name.
        object: String,
        /// In units of the scene.
        by: [f64; 3],
    },
}

impl fmt::Display for Edit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Matte { material } => write!(f, "material \"{material}\" matte"),
            Self::Roughness { material, roughness } => {
                write!(f, "roughness of material \"{material}\" {roughness}")
            }
            Self::Delete { object } => write!(f, "object \"{object}\" deleted"),
            Self::Move { object, by: [x, y, z] } => write!(f, "object \"{object}\" moved by {x}, {y}, {z}"),
        }
    }
}

/// What a name stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Named {
    /// [`Scene::objects`].
    Object,
    /// [`Scene::materials`].
    Material,
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Object => "object",
            Self::Material => "material",
        })
    }
}

/// Why a change cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// Nothing has this name; [`Scene`] has the names that there are.
    #[error("the scene has no {named} \"{name}\"; name one of its own")]
    Unknown {
        /// What was looked for.
        named: Named,
        /// The name.
        name: String,
    },
    /// The change would change nothing of this material.
    #[error("material \"{material}\" {problem}; choose another material or another change")]
    Nothing {
        /// The material.
        material: String,
        /// Why.
        problem: &'static str,
    },
    /// A number is out of its range.
    #[error("{what} {value} is not {range}; give a number in that range")]
    Range {
        /// Of what.
        what: &'static str,
        /// The number.
        value: f64,
        /// What is allowed, in words.
        range: &'static str,
    },
    /// Two changes contradict each other.
    #[error(
        "\"{name}\" is changed twice in ways that contradict each other ({first} and {second}); leave one out"
    )]
    Twice {
        /// The object or material.
        name: String,
        /// The first change.
        first: String,
        /// The second.
        second: String,
    },
}

/// What a change met.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Affected {
    /// Instances (a glTF node whose mesh has several primitives has one for each).
    pub instances: u64,
    /// Objects.
    pub objects: u64,
    /// Triangles placed.
    pub triangles: u64,
    /// Some of what was taken away emitted light.
    pub lights_removed: bool,
    /// Some of what was moved emits light.
    pub lights_moved: bool,
    /// Other objects whose names differ by a number alone (`Chair #2`), and stay as they are.
    pub namesakes: Vec<String>,
}

/// An edited copy of the scene, and what each change met.
///
/// # Errors
/// [`EditError`]; the scene is left as it was.
pub fn apply(scene: &Scene, edits: &[Edit]) -> Result<(Scene, Vec<Affected>), EditError> {
    contradictions(edits)?;
    let mut edited = scene.clone();
    let affected = edits.iter().map(|edit| one(&mut edited, edit)).collect::<Result<_, _>>()?;
    Ok((edited, affected))
}

/// Whether anything in the scene gives light, apart from an environment.
pub fn has_lights(scene: &Scene) -> bool {
    let emits = |material: &Material| material.is_emissive() || matches!(material.bsdf, Bsdf::Unlit { .. });
    let dark = |light: &crate::Light| light.intensity.iter().all(|c| *c <= 0.0);
    scene.instances.iter().any(|i| scene.materials.get(i.material as usize).is_some_and(emits))
        || !scene.lights.iter().all(dark)
}

fn one(scene: &mut Scene, edit: &Edit) -> Result<Affected, EditError> {
    match edit {
        Edit::Matte { material } => {
            let index = find(scene, Named::Material, material)?;
            surface::matte(&mut scene.materials[index])?;
            Ok(affected(scene, |i| i.material as usize == index))
        }
        Edit::Roughness { material, roughness } => {
            if !(0.0..=1.0).contains(roughness) {
                return Err(EditError::Range {
                    what: "roughness",
                    value: f64::from(*roughness),
                    range: "0 to 1",
                });
            }
            let index = find(scene, Named::Material, material)?;
            surface::roughness(&mut scene.materials[index], *roughness)?;
            Ok(affected(scene, |i| i.material as usize == index))
        }
        Edit::Delete { object } => {
            let index = find(scene, Named::Object, object)?;
            let mut met = affected(scene, |i| i.object as usize == index);
            met.lights_removed = emits(scene, index);
            met.namesakes = namesakes(scene, index);
            scene.instances.retain(|i| i.object as usize != index);
            Ok(met)
        }
        Edit::Move { object, by } => {
            if let Some(value) = by.iter().find(|c| c.is_nan() || c.abs() > 1e30) {
                return Err(EditError::Range {
                    what: "distance",
                    value: *value,
                    range: "finite and within 1e30",
                });
            }
            let index = find(scene, Named::Object, object)?;
            let mut met = affected(scene, |i| i.object as usize == index);
            met.lights_moved = emits(scene, index);
            met.namesakes = namesakes(scene, index);
            for instance in scene.instances.iter_mut().filter(|i| i.object as usize == index) {
                for (row, distance) in instance.to_world.iter_mut().zip(by) {
                    row[3] += distance;
                }
            }
            Ok(met)
        }
    }
}

/// The index of that name.
fn find(scene: &Scene, named: Named, name: &str) -> Result<usize, EditError> {
    let found = match named {
        Named::Object => scene.objects.iter().position(|o| o.name == name),
        Named::Material => scene.materials.iter().position(|m| m.name == name),
    };
    found.ok_or_else(|| EditError::Unknown { named, name: name.to_owned() })
}

fn affected(scene: &Scene, met: impl Fn(&crate::Instance) -> bool) -> Affected {
    let mut affected = Affected::default();
    let mut objects = std::collections::BTreeSet::new();
    for instance in scene.instances.iter().filter(|i| met(i)) {
        affected.instances += 1;
        objects.insert(instance.object);
        affected.triangles +=
            scene.meshes.get(instance.mesh as usize).map_or(0, |m| m.triangles.len() as u64);
    }
    affected.objects = objects.len() as u64;
    affected
}

fn emits(scene: &Scene, object: usize) -> bool {
    let of_object = scene.instances.iter().filter(|i| i.object as usize == object);
    let mut materials = of_object.filter_map(|i| scene.materials.get(i.material as usize));
    materials.any(Material::is_emissive)
}

/// Objects that the file calls the same: the loaders number all but the first of them.
fn namesakes(scene: &Scene, object: usize) -> Vec<String> {
    fn stem(name: &str) -> &str {
        match name.rsplit_once(" #") {
            Some((stem, number)) if number.parse::<u32>().is_ok() => stem,
            _ => name,
        }
    }
    let Some(own) = scene.objects.get(object) else { return Vec::new() };
    let others =
        scene.objects.iter().enumerate().filter(|(i, o)| *i != object && stem(&o.name) == stem(&own.name));
    others.map(|(_, o)| o.name.clone()).collect()
}

/// Edits of one thing that cannot both be meant.
fn contradictions(edits: &[Edit]) -> Result<(), EditError> {
    let key = |edit: &Edit| match edit {
        Edit::Matte { material } | Edit::Roughness { material, .. } => (Named::Material, material.clone()),
        Edit::Delete { object } | Edit::Move { object, .. } => (Named::Object, object.clone()),
    };
    for (i, first) in edits.iter().enumerate() {
        for second in &edits[i + 1..] {
            // Moves add up.
            let both_move = matches!((first, second), (Edit::Move { .. }, Edit::Move { .. }));
            let (named, name) = key(first);
            if (named, &name) == (key(second).0, &key(second).1) && !both_move {
                return Err(EditError::Twice { name, first: first.to_string(), second: second.to_string() });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
