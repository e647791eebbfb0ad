//! What is to be changed: from the command line to edits and back, with answers to mistyped names.

use super::WhatIfArgs;
use crate::args::nearest;
use crate::fail::Fail;
use hotspot_cost::hotspots::Try;
use hotspot_cost::whatif::Change;
use hotspot_scene::Scene;
use hotspot_scene::edit::{Affected, Edit, EditError, Named};

/// Names listed in an answer.
const LISTED: usize = 12;

/// The edits in the order of their options' kinds.
pub(super) fn of(args: &WhatIfArgs) -> Vec<Edit> {
    let matte = args.matte.iter().map(|material| Edit::Matte { material: material.clone() });
    let roughness = args
        .roughness
        .iter()
        .map(|(material, roughness)| Edit::Roughness { material: material.clone(), roughness: *roughness });
    let delete = args.delete.iter().map(|object| Edit::Delete { object: object.clone() });
    let moves = args.moves.iter().map(|(object, by)| Edit::Move { object: object.clone(), by: *by });
    matte.chain(roughness).chain(delete).chain(moves).collect()
}

/// The option that makes an edit, as a shell takes it.
pub(super) fn option(edit: &Edit) -> String {
    let tried = match edit {
        Edit::Matte { material } => Try::Matte { material: material.clone() },
        Edit::Roughness { material, roughness } => {
            Try::Roughness { material: material.clone(), roughness: *roughness }
        }
        Edit::Delete { object } => Try::Delete { object: object.clone() },
        Edit::Move { object, by } => Try::Move { object: object.clone(), by: *by },
    };
    tried.to_string()
}

/// What hotspots want tried, as an edit or a depth.
pub(super) fn tried(tried: &Try) -> (Vec<Edit>, Option<u32>) {
    let edit = match tried.clone() {
        Try::Matte { material } => Edit::Matte { material },
        Try::Roughness { material, roughness } => Edit::Roughness { material, roughness },
        Try::Delete { object } => Edit::Delete { object },
        Try::Move { object, by } => Edit::Move { object, by },
        Try::MaxDepth(depth) => return (Vec::new(), Some(depth)),
    };
    (vec![edit], None)
}

/// Unknown names get the nearest one that there is.
pub(super) fn refused(scene: &Scene, error: &EditError) -> Fail {
    let EditError::Unknown { named, name } = error else { return Fail::usage(error.to_string()) };
    let names: Vec<&str> = match named {
        Named::Object => scene.objects.iter().map(|o| o.name.as_str()).collect(),
        Named::Material => scene.materials.iter().map(|m| m.name.as_str()).collect(),
    };
    let hint = match nearest(name, names.iter().copied()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => {
            let some: Vec<String> = names.iter().take(LISTED).map(|name| format!("\"{name}\"")).collect();
            let more = if names.len() > some.len() { ", …" } else { "" };
            format!("it has {}{more}", some.join(", "))
        }
    };
    Fail::usage(format!("the scene has no {named} \"{name}\"; {hint}"))
}

/// A change of edits and of the depth, in words and as options, with what it met.
pub(super) fn described(edits: &[Edit], met: &[Affected], [before, after]: [u32; 2]) -> Change {
    let mut change = Change::default();
    let mut words: Vec<String> = Vec::new();
    for (edit, met) in edits.iter().zip(met) {
        words.push(edit.to_string());
        change.options.push(option(edit));
        let objects =
            if met.objects == 1 { "one object".to_owned() } else { format!("{} objects", met.objects) };
        change.affected.push(format!("{edit}: {} triangles of {objects}", met.triangles));
        if met.instances == 0 {
            change.warnings.push(format!("{edit}: nothing in the scene is made of it"));
        }
        if met.lights_removed {
            change.warnings.push(format!("{edit}: it gave light, which is gone"));
        }
        if met.lights_moved {
            change.warnings.push(format!("{edit}: it gives light, which moves with it"));
        }
        if !met.namesakes.is_empty() {
            change.warnings.push(format!("{edit}: {} stay as they are", met.namesakes.join(", ")));
        }
    }
    if before != after {
        words.push(format!("depth at most {after}"));
        change.options.push(Try::MaxDepth(after).to_string());
        change.affected.push(format!("depth at most {after} in place of {before}"));
    }
    change.what = words.join(", ");
    change
}

/// `MATERIAL=X`; the name may hold an equals sign itself.
pub(super) fn parse_roughness(text: &str) -> Result<(String, f32), String> {
    let parsed = text.rsplit_once('=').and_then(|(name, x)| Some((name.to_owned(), x.parse::<f32>().ok()?)));
    match parsed {
        Some((name, x)) if (0.0..=1.0).contains(&x) && !name.is_empty() => Ok((name, x)),
        _ => Err("write a material and a roughness from 0 to 1, such as Glass=0.3".into()),
    }
}

/// `OBJECT=x,y,z`.
pub(super) fn parse_move(text: &str) -> Result<(String, [f64; 3]), String> {
    let parsed = text.rsplit_once('=').and_then(|(name, by)| {
        let by: Vec<f64> = by.split(',').map(|c| c.trim().parse().ok()).collect::<Option<_>>()?;
        Some((name.to_owned(), <[f64; 3]>::try_from(by).ok()?))
    });
    match parsed {
        Some((name, by)) if by.iter().all(|c| c.is_finite()) && !name.is_empty() => Ok((name, by)),
        _ => Err("write an object and a vector, such as \"Left wall=0.5,0,0\"".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_read_names_with_equals_signs() {
        assert_eq!(parse_roughness("a=b=0.5"), Ok(("a=b".into(), 0.5)));
        assert_eq!(parse_move("Chair=0,-1.5, 2"), Ok(("Chair".into(), [0.0, -1.5, 2.0])));
        for wrong in ["a", "a=2", "a=-0.1", "a=nan", "a=", "=0.5"] {
            assert!(parse_roughness(wrong).is_err(), "{wrong}");
        }
        for wrong in ["a", "a=1,2", "a=1,2,3,4", "a=1,2,inf", "a=1;2;3", "=1,2,3"] {
            assert!(parse_move(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_tried_is_the_option_that_is_shown() {
        for wanted in [
            Try::Matte { material: "Table top".into() },
            Try::Roughness { material: "Glass".into(), roughness: 0.5 },
            Try::Delete { object: "Lamp".into() },
            Try::Move { object: "Chair".into(), by: [0.0, 1.5, -2.0] },
        ] {
            let (edits, depth) = tried(&wanted);
            assert_eq!((option(&edits[0]), depth), (wanted.to_string(), None));
        }
        assert_eq!(tried(&Try::MaxDepth(4)), (Vec::new(), Some(4)));
    }
}
