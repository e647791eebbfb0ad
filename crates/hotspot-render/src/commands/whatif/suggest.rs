//! `--suggest`: the changes that the hotspots' causes ask for, tried one by one and ranked.
//!
//! Each is one counted render paired with that of the scene as it is (its interval is that of sampling alone) and a few uncounted
//! pairs in turns for the time.

use super::{Run, Version, edits};
use crate::causes;
use crate::fail::Fail;
use crate::progress::Talker;
use hotspot_cost::hotspots::{self, Try};
use hotspot_cost::whatif::Suggestion;
use hotspot_cost::{Metric, compare};
use hotspot_scene::edit::{Edit, apply};
use std::time::Instant;

/// Hotspots looked at.
const HOTSPOTS: usize = 12;
/// Most changes tried.
const MOST: usize = 10;
/// What a change that no cause asks for is worth beside one that a cause does.
const UNGUIDED: f64 = 0.1;
/// Pairs of timed renders for each.
const REPEATS: u32 = 3;

/// A change, and what it did.
pub(super) struct Tried {
    pub(super) edits: Vec<Edit>,
    pub(super) depth: u32,
    pub(super) suggestion: Suggestion,
}

struct Candidate {
    tried: Try,
    reason: String,
}

/// Tries the candidates until the time is over; the greatest saving comes first.
pub(super) fn run(run: &Run<'_>, a: &Version) -> Result<Vec<Tried>, Fail> {
    let start = Instant::now();
    let candidates = candidates(run, a);
    let count = candidates.len();
    let mut all = Vec::new();
    for (number, candidate) in candidates.into_iter().enumerate() {
        if start.elapsed().as_secs_f64() > run.args.suggest_seconds {
            run.talker.say(&format!(
                "--suggest-seconds {} are over: {number} of {count} changes were tried",
                run.args.suggest_seconds
            ));
            break;
        }
        let (edits, depth) = edits::tried(&candidate.tried);
        let depth = depth.unwrap_or(run.args.base_max_depth);
        // What the scene does not allow is no suggestion.
        let Ok((scene, change)) = run.edited(&edits, depth) else { continue };
        run.talker.say(&format!("trying {} of {count}: {}", number + 1, change.what));
        let b = run.version(Some(run.args.open.prepare(&scene)?), depth)?;
        let comparison = compare(a.side("A"), b.side("B"), false)?;
        let total = comparison.totals.get(Metric::Intersection.name()).copied().unwrap_or_default();
        let time = run.time([a, &b], run.args.repeats.min(REPEATS))?;
        all.push(Tried {
            suggestion: Suggestion {
                what: change.what,
                option: candidate.tried.to_string(),
                reason: candidate.reason,
                relative: total.relative,
                ci95: total.ci95,
                significant: total.significant,
                time,
                image: super::picture_change(&a.layers, &b.layers),
                warnings: change.warnings,
            },
            edits,
            depth,
        });
    }
    run.talker.finish();
    let saving = |tried: &Tried| tried.suggestion.relative.unwrap_or(0.0);
    all.sort_by(|x, y| saving(x).total_cmp(&saving(y)));
    Ok(all)
}

/// From the causes of the hotspots, those of the largest excess first; each change once.
fn candidates(run: &Run<'_>, a: &Version) -> Vec<Candidate> {
    let (frame, model) = (&a.rendered.frame, run.options.model);
    let Some(cost) = a.layers.metric(Metric::Intersection) else { return Vec::new() };
    let objects = hotspots::first_objects(frame);
    let names = run.stage.prepared.objects();
    let mut found =
        run.stage.install(|| hotspots::of_frame_layers(frame, &a.layers, model, &objects, names, HOTSPOTS));
    causes::explain(&run.stage, &a.settings, model, (cost, &objects), &mut found);
    let mut candidates: Vec<(f64, Candidate)> = Vec::new();
    for hotspot in &found {
        for finding in &hotspot.causes {
            let worth = hotspot.excess_share * finding.share.unwrap_or(0.0);
            for tried in &finding.tries {
                match candidates.iter_mut().find(|(_, known)| known.tried == *tried) {
                    Some((sum, _)) => *sum += worth,
                    None => candidates.push((
                        worth,
                        Candidate {
                            tried: tried.clone(),
                            reason: format!("hotspot {}: {}", hotspot.rank, finding.words),
                        },
                    )),
                }
            }
        }
    }
    let mut add = |worth: f64, tried: Try, reason: String| {
        if candidates.iter().all(|(_, known)| known.tried != tried) {
            candidates.push((worth, Candidate { tried, reason }));
        }
    };
    // Where causes say little: the surfaces that hotspots lie on, and shorter paths.
    for hotspot in &found {
        let of_object = run.scene.instances.iter().filter(|i| Some(i.object) == hotspot.object);
        let mut materials: Vec<u32> = of_object.map(|i| i.material).collect();
        materials.sort_unstable();
        materials.dedup();
        for material in materials.iter().filter_map(|m| run.scene.materials.get(*m as usize)) {
            let reason = format!("hotspot {} lies on it", hotspot.rank);
            add(UNGUIDED * hotspot.excess_share, Try::Matte { material: material.name.clone() }, reason);
        }
    }
    if run.args.base_max_depth >= 4 {
        add(0.0, Try::MaxDepth(run.args.base_max_depth / 2), "long paths may bring little".into());
    }
    candidates.sort_by(|x, y| y.0.total_cmp(&x.0));
    // What changes nothing is no candidate.
    candidates.retain(|(_, candidate)| apply(run.scene, &edits::tried(&candidate.tried).0).is_ok());
    candidates.into_iter().map(|(_, candidate)| candidate).take(MOST).collect()
}

/// The ranked table.
pub(super) fn print(talker: &Talker, suggestions: &[Suggestion]) {
    let wide = suggestions.iter().map(|s| s.option.chars().count()).max().unwrap_or(0);
    for (rank, s) in suggestions.iter().enumerate() {
        talker.say(&format!("{:>2}. {:<wide$}  {}", rank + 1, s.option, s.measured()));
    }
    if !suggestions.is_empty() {
        talker.say("    intervals of sampling and of repeats; rebuilding the tree adds its luck, which is measured for the best alone");
    }
    for (rank, s) in suggestions.iter().enumerate() {
        talker.say(&format!("    {}: {}; {}", rank + 1, s.what, s.reason));
    }
}

/// The best that saves for certain.
pub(super) fn best(tried: &[Tried]) -> Option<&Tried> {
    let saves = |tried: &&Tried| {
        tried.suggestion.significant == Some(true) && tried.suggestion.relative.is_some_and(|r| r < 0.0)
    };
    tried.iter().find(saves)
}
