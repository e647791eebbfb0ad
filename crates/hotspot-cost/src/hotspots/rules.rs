//! From what paths do in a region and at ordinary pixels to what makes the region cost more.
//!
//! The cost of a path is a product: vertices per path × rays per vertex × nodes per ray × cost per node. In logarithms the
//! region's excess over ordinary pixels is a sum, and each factor has a share of it. A rule fires when its factor has a fair
//! share and the ledgers show who is behind it; where several could, the more particular one wins. Thresholds are stated once,
//! here, and are lenient: causes are ranked by their share, and how often independent parts of the sounding agree is told with
//! them.

use super::causes::{CauseKind, Context};
use super::sounding::Flow;
use std::collections::{BTreeMap, BTreeSet};

/// A factor below this is as elsewhere.
const NOTABLE: f64 = 1.25;
/// A cause explains at least this share of the excess.
const FAIR: f64 = 0.2;
/// Moves between trapping objects per path, beyond those of ordinary pixels: fewer is one more bounce, not a trap.
const TRAPPED_MOVES: f64 = 1.0;
/// A trap holds at least this share of what the paths are longer by.
const TRAPPED_SHARE: f64 = 0.5;
/// There and back differ by less than this factor in a trap of two.
const BALANCE: f64 = 0.25;
/// A trap of two explains so much more than each of the two alone.
const TWO_BEAT_ONE: f64 = 1.2;
/// Shadow rays that are mostly blocked …
const BLOCKED: f64 = 0.5;
/// … and more often than at ordinary pixels by this much.
const MORE_BLOCKED: f64 = 0.15;
/// Alpha tests per ray.
const ALPHA_TESTS: f64 = 0.3;
/// Texture look-ups per vertex.
const TEXTURES: f64 = 1.0;
/// Twice as many as at ordinary pixels, of what need not cost intersections.
const TWICE: f64 = 2.0;
/// Of the nodes that a ray visits more, those above several objects …
const SHARED_NODES: f64 = 0.5;
/// … where nodes are this part of what it costs more,
const NODES: f64 = 0.25;
/// while each of two objects has this part of the triangles tested more
const BOTH_TESTED: f64 = 0.15;
/// and their boxes share this part of the smaller one.
const OVERLAP: f64 = 0.2;
/// Of what a ray costs more, triangles of one object.
const ONES_TRIANGLES: f64 = 0.4;
/// Cost per node against ordinary pixels: more triangles tested for each node.
const CROWDED_LEAVES: f64 = 1.3;
/// More triangles per ray than at ordinary pixels: fewer are no burden, whatever their ratio.
const BURDEN: f64 = 8.0;
/// An object is named for geometry that has this part of what a ray costs more.
const NAMED: f64 = 0.3;

/// A cause, before it is put into words.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Draft {
    pub(super) kind: CauseKind,
    pub(super) objects: Vec<u32>,
    /// Materials that paths leave there.
    pub(super) materials: Vec<u32>,
    pub(super) share: Option<f64>,
    /// What the kind is about, here and at ordinary pixels.
    pub(super) here: f64,
    pub(super) ordinary: f64,
}

/// Of the logarithm of the cost's ratio.
struct Shares {
    vertices: f64,
    per_ray: f64,
}

/// The causes, the greatest share first. Empty where the region does not cost more.
pub(super) fn judge(here: &Flow, ordinary: &Flow, context: &Context<'_>) -> Vec<Draft> {
    let excess = here.cost - ordinary.cost;
    if excess <= 0.0 || ordinary.cost <= 0.0 || here.paths <= 0.0 || ordinary.paths <= 0.0 {
        return Vec::new();
    }
    let share = |factor: f64| {
        let share = factor.ln() / (here.cost / ordinary.cost).ln();
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    };
    let longer = here.vertices() / ordinary.vertices();
    let per_ray = (here.cost / here.rays) / (ordinary.cost / ordinary.rays);
    let shares = Shares { vertices: share(longer), per_ray: share(per_ray) };
    let mut drafts: Vec<Draft> = Vec::new();
    drafts.extend(blocked(here, ordinary, excess));
    let alpha = alpha_tests(here, ordinary, &shares);
    if alpha.is_none() && per_ray >= NOTABLE && shares.per_ray >= FAIR {
        drafts.extend(geometry(here, ordinary, context, shares.per_ray));
    }
    drafts.extend(alpha);
    let futile = futile(here, ordinary, excess);
    if longer >= NOTABLE && shares.vertices >= FAIR {
        match trapped(here, ordinary, shares.vertices) {
            Some(trap) => drafts.push(trap),
            None if futile.is_none() => drafts.push(long(here, ordinary, shares.vertices)),
            None => {}
        }
    }
    drafts.extend(futile);
    drafts.extend(textures(here, ordinary));
    drafts.sort_by(|a, b| {
        b.share.unwrap_or(-1.0).total_cmp(&a.share.unwrap_or(-1.0)).then(a.kind.cmp(&b.kind))
    });
    drafts
}

/// The larger values first, at most `most`, those of at least `least`.
fn largest<K: Copy + Ord>(values: impl IntoIterator<Item = (K, f64)>, least: f64, most: usize) -> Vec<K> {
    let mut values: Vec<(K, f64)> = values.into_iter().filter(|(_, value)| *value >= least).collect();
    values.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    values.into_iter().take(most).map(|(key, _)| key).collect()
}

/// Materials of these objects that paths leave, the most used first.
fn materials_of(flow: &Flow, objects: &[u32]) -> Vec<u32> {
    let mut sums = BTreeMap::new();
    for ((object, material), rays) in &flow.left {
        if objects.contains(object) {
            *sums.entry(*material).or_insert(0.0) += rays;
        }
    }
    largest(sums, f64::MIN_POSITIVE, 4)
}

/// Paths that go to and fro between two objects, or within one.
fn trapped(here: &Flow, ordinary: &Flow, share: f64) -> Option<Draft> {
    let more = |from: u32, to: u32| here.moved(from, to) - ordinary.moved(from, to);
    let objects: BTreeSet<u32> = here.moves.keys().flat_map(|(a, b)| [*a, *b]).collect();
    let alone = |a: u32| more(a, a).max(0.0);
    let mut best: Option<(Vec<u32>, f64)> = None;
    let mut offer = |objects: Vec<u32>, moves: f64, factor: f64| {
        if best.as_ref().is_none_or(|(_, least)| moves > least * factor) {
            best = Some((objects, moves));
        }
    };
    for &a in &objects {
        offer(vec![a], alone(a), 1.0);
    }
    for (&(a, b), _) in here.moves.range(..) {
        if a >= b {
            continue;
        }
        let (there, back) = (more(a, b), more(b, a));
        let between = there + back;
        let all = between + alone(a) + alone(b);
        if there.min(back) >= BALANCE * there.max(back) && between >= BALANCE * all {
            offer(vec![a, b], all, TWO_BEAT_ONE);
        }
    }
    let (objects, moves) = best?;
    let longer = here.vertices() - ordinary.vertices();
    if moves < TRAPPED_MOVES || moves < TRAPPED_SHARE * longer {
        return None;
    }
    let all =
        |flow: &Flow| objects.iter().flat_map(|a| objects.iter().map(|b| flow.moved(*a, *b))).sum::<f64>();
    Some(Draft {
        kind: CauseKind::Trapped,
        materials: materials_of(here, &objects),
        share: Some(share),
        here: all(here),
        ordinary: all(ordinary),
        objects,
    })
}

fn long(here: &Flow, ordinary: &Flow, share: f64) -> Draft {
    let mut more: BTreeMap<u32, f64> = BTreeMap::new();
    for (flow, sign) in [(here, 1.0), (ordinary, -1.0)] {
        for ((object, _), rays) in &flow.left {
            *more.entry(*object).or_default() += sign * rays;
        }
    }
    let longer = here.vertices() - ordinary.vertices();
    let objects = largest(more, NAMED * longer, 2);
    Draft {
        kind: CauseKind::LongPaths,
        materials: materials_of(here, &objects),
        objects,
        share: Some(share),
        here: here.vertices(),
        ordinary: ordinary.vertices(),
    }
}

/// Long paths that bring nothing.
fn futile(here: &Flow, ordinary: &Flow, excess: f64) -> Option<Draft> {
    let share = (here.futile - ordinary.futile) / excess;
    let (of_here, of_ordinary) = (here.futile / here.cost, ordinary.futile / ordinary.cost);
    if share < 2.0 * FAIR || here.vertices() < ordinary.vertices() || of_here < of_ordinary + MORE_BLOCKED {
        return None;
    }
    Some(Draft {
        kind: CauseKind::FutilePaths,
        objects: Vec::new(),
        materials: Vec::new(),
        share: Some(share.min(1.0)),
        here: of_here,
        ordinary: of_ordinary,
    })
}

/// Shadow rays that do not arrive, by the light that most of them aim at.
fn blocked(here: &Flow, ordinary: &Flow, excess: f64) -> Option<Draft> {
    let aimed = |flow: &Flow, light| flow.aimed.get(&light).copied().unwrap_or_default();
    let more = here
        .aimed
        .keys()
        .map(|light| (*light, aimed(here, *light).blocked - aimed(ordinary, *light).blocked));
    let light = largest(more, f64::MIN_POSITIVE, 1).first().copied()?;
    let share = (here.blocked - ordinary.blocked) / excess;
    let [of_here, of_ordinary] = [here, ordinary].map(|flow| {
        let aimed = aimed(flow, light);
        if aimed.rays > 0.0 { aimed.blocked / aimed.rays } else { 0.0 }
    });
    if share < FAIR || of_here < BLOCKED || of_here < of_ordinary + MORE_BLOCKED {
        return None;
    }
    Some(Draft {
        kind: CauseKind::BlockedShadowRays,
        objects: light.into_iter().collect(),
        materials: Vec::new(),
        share: Some(share.min(1.0)),
        here: of_here,
        ordinary: of_ordinary,
    })
}

fn alpha_tests(here: &Flow, ordinary: &Flow, shares: &Shares) -> Option<Draft> {
    let (of_here, of_ordinary) = (here.alpha_tests / here.rays, ordinary.alpha_tests / ordinary.rays);
    if of_here < ALPHA_TESTS || of_here < TWICE * of_ordinary || shares.per_ray.max(shares.vertices) < FAIR {
        return None;
    }
    let tests = here.paid.iter().filter_map(|(payer, paid)| Some(((*payer)?, paid.alpha_tests)));
    Some(Draft {
        kind: CauseKind::AlphaTests,
        objects: largest(tests, NAMED * here.alpha_tests, 2),
        materials: Vec::new(),
        share: Some(shares.per_ray),
        here: of_here,
        ordinary: of_ordinary,
    })
}

/// Rays that cost more each: whose nodes and triangles they meet.
fn geometry(here: &Flow, ordinary: &Flow, context: &Context<'_>, share: f64) -> Option<Draft> {
    let model = context.model;
    let per_ray = |flow: &Flow, value: f64| value / flow.rays;
    let more = |of: &dyn Fn(&Flow) -> f64| per_ray(here, of(here)) - per_ray(ordinary, of(ordinary));
    let excess = more(&|f| f.cost);
    let shapes = |payer: Option<u32>| more(&|f| f.paid(payer).shapes);
    let nodes = |payer: Option<u32>| more(&|f| f.paid(payer).nodes);
    let payers = || here.paid.keys().filter_map(|payer| *payer);
    let draft = |kind, objects: Vec<u32>, value: &dyn Fn(&Flow) -> f64| Draft {
        kind,
        objects,
        materials: Vec::new(),
        share: Some(share),
        here: per_ray(here, value(here)),
        ordinary: per_ray(ordinary, value(ordinary)),
    };

    let cost_per_node = (here.cost / here.nodes) / (ordinary.cost / ordinary.nodes);
    let heaviest = largest(payers().map(|p| (p, shapes(Some(p)))), f64::MIN_POSITIVE, 1);
    if let [heaviest] = heaviest[..]
        && cost_per_node >= CROWDED_LEAVES
        && shapes(Some(heaviest)) >= BURDEN
        && model.c1 * shapes(Some(heaviest)) >= ONES_TRIANGLES * excess
    {
        return Some(draft(CauseKind::HeavyLeaves, vec![heaviest], &|f| f.shapes));
    }

    let all_shapes: f64 = payers().map(|p| shapes(Some(p)).max(0.0)).sum();
    let tested = largest(payers().map(|p| (p, shapes(Some(p)))), BOTH_TESTED * all_shapes, 6);
    let all_nodes = more(&|f| f.nodes);
    if nodes(None) >= SHARED_NODES * all_nodes && model.c0 * all_nodes >= NODES * excess {
        for (i, &a) in tested.iter().enumerate() {
            for &b in &tested[i + 1..] {
                if context.overlap(a, b).is_none_or(|overlap| overlap >= OVERLAP) {
                    return Some(draft(CauseKind::OverlappingBounds, vec![a, b], &|f| f.nodes));
                }
            }
        }
    }
    let cost = |p: u32| model.c0 * nodes(Some(p)) + model.c1 * shapes(Some(p));
    let objects = largest(payers().map(|p| (p, cost(p))), NAMED * excess, 2);
    Some(draft(CauseKind::DenseGeometry, objects, &|f| f.cost))
}

fn textures(here: &Flow, ordinary: &Flow) -> Option<Draft> {
    let (of_here, of_ordinary) = (here.textures / here.vertices(), ordinary.textures / ordinary.vertices());
    (of_here >= TEXTURES && of_here >= TWICE * of_ordinary).then(|| Draft {
        kind: CauseKind::Textures,
        objects: Vec::new(),
        materials: Vec::new(),
        share: None,
        here: of_here,
        ordinary: of_ordinary,
    })
}

#[cfg(test)]
#[path = "rules_tests.rs"]
mod tests;
