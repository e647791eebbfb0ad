//! Causes in plain words, and what to do about them.

use super::causes::{CauseKind, Context, Finding};
use super::{Hotspot, words};
use crate::names::in_sentence;

/// The cause in a sentence, without a stop.
pub(super) fn cause(finding: &Finding) -> String {
    let Finding { here, ordinary, names, .. } = finding;
    let who = words::list(names);
    match finding.kind {
        CauseKind::Trapped => {
            let place = match names.len() {
                1 => format!("bounce about within {who}"),
                _ => format!("are trapped between {who}"),
            };
            format!(
                "paths {place}: {} moves per path, {} at ordinary pixels",
                number(*here),
                number(*ordinary)
            )
        }
        CauseKind::BlockedShadowRays => {
            let towards = if names.is_empty() { "lights without a surface".to_owned() } else { who };
            format!(
                "{} of the shadow rays towards {towards} are blocked, {} at ordinary pixels",
                percent(*here),
                percent(*ordinary)
            )
        }
        CauseKind::AlphaTests => {
            format!(
                "rays pass through holes{}: {} alpha tests per ray, {} at ordinary pixels",
                of(&who),
                number(*here),
                number(*ordinary)
            )
        }
        CauseKind::HeavyLeaves => format!(
            "each ray is tested against {} triangles{}, {} at ordinary pixels, without many more nodes: they lie on each \
             other or are long and thin",
            number(*here),
            most_of(&who),
            number(*ordinary)
        ),
        CauseKind::OverlappingBounds => format!(
            "the bounds of {who} overlap: each ray visits {} nodes, {} at ordinary pixels, most of the additional ones above \
             both",
            number(*here),
            number(*ordinary)
        ),
        CauseKind::DenseGeometry => format!(
            "each ray meets dense geometry{}: {} nodes and triangles per ray, {} at ordinary pixels",
            of(&who),
            number(*here),
            number(*ordinary)
        ),
        CauseKind::FutilePaths => format!(
            "{} of the cost is of paths that bring no light, {} at ordinary pixels",
            percent(*here),
            percent(*ordinary)
        ),
        CauseKind::Textures => format!(
            "{} texture look-ups per vertex, {} at ordinary pixels: they take time that the intersection cost does not show",
            number(*here),
            number(*ordinary)
        ),
        CauseKind::LongPaths => format!(
            "paths are long: {} vertices, {} at ordinary pixels{}",
            number(*here),
            number(*ordinary),
            if names.is_empty() { String::new() } else { format!(", most of the additional ones on {who}") }
        ),
    }
}

/// What to say where no cause stands out. `waste`: share of the cost that brings no light, here and at ordinary pixels.
pub(super) fn nothing(cost: f64, [here, ordinary]: [f64; 2]) -> String {
    let mut words = format!("costs {cost:.2} times an ordinary pixel; no cause stands out");
    if here >= words::WASTED {
        words += &format!(
            ", but {} of the cost brings no light ({} at ordinary pixels)",
            percent(here),
            percent(ordinary)
        );
    }
    words
}

/// What to try, as sentences.
pub(super) fn fix(finding: &Finding, hotspot: &Hotspot, context: &Context<'_>) -> String {
    let who = words::list(&finding.names);
    match finding.kind {
        CauseKind::Trapped if finding.names.len() == 1 => {
            format!("Make {who} darker, matte or more open, or lower --max-depth.")
        }
        CauseKind::Trapped => {
            format!("Move {who} apart, make one of them darker or matte, or lower --max-depth.")
        }
        CauseKind::BlockedShadowRays if finding.names.is_empty() => {
            "Take away lights that are not seen from here, or try --lights learned.".into()
        }
        CauseKind::BlockedShadowRays => {
            format!("Move {who} to where it is seen from here, split or dim it, or try --lights learned.")
        }
        CauseKind::AlphaTests => {
            format!("Cut the cards{} closer to what is opaque, or model the shape.", of(&who))
        }
        CauseKind::HeavyLeaves => {
            format!("Remove duplicates in {who}, and subdivide its long thin triangles.")
        }
        CauseKind::OverlappingBounds => {
            format!("Move {who} apart, join them to one mesh, or split the larger one into compact parts.")
        }
        CauseKind::DenseGeometry => match finding.objects.first() {
            Some(own)
                if hotspot.object == Some(*own) && words::too_fine(hotspot, triangles(context, *own)) =>
            {
                format!("Simplify {who}: it has more triangles than pixels here.")
            }
            Some(_) => format!("Simplify {who}, or move it away from where these rays pass."),
            None => "Simplify or move apart what surrounds it.".into(),
        },
        CauseKind::FutilePaths => "Let light in, or lower --max-depth: these paths end in the dark.".into(),
        CauseKind::Textures => {
            "Bake several textures into fewer, or make materials that are seen from afar plain.".into()
        }
        CauseKind::LongPaths if finding.names.is_empty() => {
            "Darken near-white surfaces, or lower --max-depth.".into()
        }
        CauseKind::LongPaths => format!("Make {who} rougher, matte or darker, or lower --max-depth."),
    }
}

fn triangles(context: &Context<'_>, object: u32) -> Option<u64> {
    context.triangles.get(object as usize).copied()
}

/// " of "A" and "B"", or nothing.
fn of(who: &str) -> String {
    if who.is_empty() { String::new() } else { format!(" of {who}") }
}

fn most_of(who: &str) -> String {
    if who.is_empty() { String::new() } else { format!(", most of them of {who}") }
}

/// A name in quotes, tamed.
pub(super) fn name(name: &str) -> String {
    format!("\"{}\"", in_sentence(name, words::NAME))
}

/// To two or three digits.
fn number(value: f64) -> String {
    if value >= 9.95 { format!("{value:.0}") } else { format!("{value:.1}") }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}
