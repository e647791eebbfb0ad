//! Each rule by numbers: what it names, and for each of its conditions a twin that misses that condition alone and must not be
//! named. `tests/tests/causes.rs` holds the same rules to rendered scenes.

use super::*;
use crate::hotspots::sounding::{Aimed, Paid};
use crate::metric::CostModel;

/// An ordinary path: 4 vertices with a shadow ray each, 20 nodes, 20 triangles.
fn ordinary() -> Flow {
    Flow { paths: 1.0, cost: 40.0, rays: 8.0, shadow_rays: 4.0, nodes: 20.0, shapes: 20.0, ..Flow::default() }
}

/// So many vertices, with a shadow ray each, of ordinary rays.
fn vertices(count: f64) -> Flow {
    Flow { cost: 10.0 * count, rays: 2.0 * count, shadow_rays: count, ..ordinary() }
}

/// As many rays as ordinary, which met so much; by payer the same (nodes, triangles).
fn met(nodes: f64, shapes: f64, by: &[(Option<u32>, f64, f64)]) -> Flow {
    Flow { cost: nodes + shapes, nodes, shapes, ..paid(ordinary(), by) }
}

fn paid(flow: Flow, by: &[(Option<u32>, f64, f64)]) -> Flow {
    let paid = |&(payer, nodes, shapes): &(Option<u32>, f64, f64)| {
        (payer, Paid { nodes, shapes, ..Paid::default() })
    };
    Flow { paid: by.iter().map(paid).collect(), ..flow }
}

fn kinds(here: &Flow, ordinary: &Flow) -> Vec<CauseKind> {
    drafts(here, ordinary).into_iter().map(|draft| draft.kind).collect()
}

/// Four boxes: 0 to 2 in one place, 3 beside them.
fn drafts(here: &Flow, ordinary: &Flow) -> Vec<Draft> {
    let near = Some([[0.0; 3], [1.0; 3]]);
    let far = Some([[5.0, 0.0, 0.0], [6.0, 1.0, 1.0]]);
    let context = Context {
        model: CostModel::default(),
        max_depth: 15,
        materials: &[],
        bounds: &[near, near, near, far],
        triangles: &[],
        visible: &[],
        lights: 1,
    };
    judge(here, ordinary, &context)
}

#[track_caller]
fn assert_named(kind: CauseKind, here: &Flow, ordinary: &Flow) {
    let kinds = kinds(here, ordinary);
    assert!(kinds.contains(&kind), "{kinds:?}");
}

#[track_caller]
fn assert_not(kind: CauseKind, here: &Flow, ordinary: &Flow) {
    let kinds = kinds(here, ordinary);
    assert!(!kinds.contains(&kind), "{kind:?} is among {kinds:?}");
}

#[test]
fn what_costs_no_more_has_no_cause() {
    let here = Flow { textures: 100.0, futile: 40.0, ..ordinary() };
    assert!(kinds(&here, &ordinary()).is_empty());
}

#[test]
fn heavy_leaves_are_crowded_many_and_ones_own() {
    let usual = paid(ordinary(), &[(Some(1), 10.0, 10.0)]);
    let kind = CauseKind::HeavyLeaves;
    assert_named(kind, &met(20.0, 180.0, &[(Some(1), 10.0, 170.0)]), &usual);
    // As many nodes more as triangles.
    assert_not(kind, &met(180.0, 180.0, &[(Some(1), 170.0, 170.0)]), &usual);
    // Six more triangles a ray are no burden.
    assert_not(kind, &met(20.0, 70.0, &[(Some(1), 10.0, 60.0)]), &usual);
    // A quarter each of four objects.
    let four: Vec<_> = (0..4).map(|object| (Some(object), 0.0, 80.0)).collect();
    assert_not(kind, &met(20.0, 320.0, &four), &ordinary());
}

#[test]
fn bounds_overlap_where_two_objects_share_nodes_and_boxes() {
    let usual = paid(ordinary(), &[(None, 10.0, 0.0)]);
    let kind = CauseKind::OverlappingBounds;
    let pair = |a, b| [(None, 150.0, 0.0), (Some(a), 25.0, 50.0), (Some(b), 25.0, 50.0)];
    assert_named(kind, &met(200.0, 100.0, &pair(1, 2)), &usual);
    // Boxes side by side.
    assert_not(kind, &met(200.0, 100.0, &pair(1, 3)), &usual);
    // Hardly a triangle of the other is tested.
    let one = [(None, 150.0, 0.0), (Some(1), 25.0, 95.0), (Some(2), 25.0, 5.0)];
    assert_not(kind, &met(200.0, 100.0, &one), &usual);
    // The nodes are their own.
    let own = [(None, 50.0, 0.0), (Some(1), 75.0, 50.0), (Some(2), 75.0, 50.0)];
    assert_not(kind, &met(200.0, 100.0, &own), &usual);
    // It is triangles that cost, of three alike.
    let three = [(None, 30.0, 0.0), (Some(0), 0.0, 33.0), (Some(1), 0.0, 33.0), (Some(2), 0.0, 33.0)];
    let few = [(None, 10.0, 0.0), (Some(0), 0.0, 6.0), (Some(1), 0.0, 6.0), (Some(2), 0.0, 6.0)];
    assert_not(kind, &met(40.0, 100.0, &three), &paid(ordinary(), &few));
}

#[test]
fn geometry_is_dense_where_rays_cost_more() {
    let kind = CauseKind::DenseGeometry;
    assert_named(kind, &met(30.0, 30.0, &[]), &ordinary());
    assert_not(kind, &met(24.0, 24.0, &[]), &ordinary());
    // Paths ten times as long explain it better.
    assert_not(kind, &Flow { cost: 520.0, ..vertices(40.0) }, &ordinary());
}

#[test]
fn blocked_rays_are_most_more_than_elsewhere_and_dear() {
    let aimed = |cost: f64, blocked_cost: f64, blocked: f64| Flow {
        cost,
        blocked: blocked_cost,
        aimed: [(Some(5), Aimed { rays: 4.0, blocked })].into(),
        ..ordinary()
    };
    let usual = aimed(40.0, 5.0, 1.0);
    let kind = CauseKind::BlockedShadowRays;
    assert_named(kind, &aimed(100.0, 60.0, 3.0), &usual);
    assert_not(kind, &aimed(100.0, 10.0, 3.0), &usual);
    assert_not(kind, &aimed(100.0, 60.0, 1.8), &usual);
    assert_not(kind, &aimed(100.0, 60.0, 3.0), &aimed(40.0, 5.0, 2.8));
}

#[test]
fn a_trap_holds_what_paths_are_longer_by() {
    let moves =
        |flow: Flow, there: f64, back: f64| Flow { moves: [((1, 2), there), ((2, 1), back)].into(), ..flow };
    let kind = CauseKind::Trapped;
    assert_named(kind, &moves(vertices(12.0), 4.0, 4.0), &ordinary());
    // Within one object.
    let within = Flow { moves: [((1, 1), 6.0)].into(), ..vertices(12.0) };
    assert_named(kind, &within, &ordinary());
    // Two that hold paths each for itself, with few between them, are not one trap.
    let apart = [((1, 1), 5.0), ((2, 2), 4.0), ((1, 2), 0.5), ((2, 1), 0.5)];
    let found = drafts(&Flow { moves: apart.into(), ..vertices(12.0) }, &ordinary());
    assert_eq!((found[0].kind, &found[0].objects[..]), (kind, &[1][..]));
    // Less than a move more.
    assert_not(kind, &moves(vertices(5.2), 0.45, 0.45), &ordinary());
    // Of 8 vertices more 3 are moves between them; then paths are but long.
    let elsewhere = moves(vertices(12.0), 1.5, 1.5);
    assert_not(kind, &elsewhere, &ordinary());
    assert_named(CauseKind::LongPaths, &elsewhere, &ordinary());
    // There and never back.
    assert_not(kind, &moves(vertices(12.0), 8.0, 1.0), &ordinary());
    // Ordinary paths do the same.
    assert_not(kind, &moves(vertices(12.0), 4.0, 4.0), &moves(ordinary(), 4.0, 4.0));
}

#[test]
fn paths_are_long_by_a_quarter_and_a_fair_share() {
    let kind = CauseKind::LongPaths;
    assert_named(kind, &vertices(5.2), &ordinary());
    assert_not(kind, &vertices(4.8), &ordinary());
    assert_not(kind, &Flow { cost: 400.0, ..vertices(5.2) }, &ordinary());
    // That they bring nothing says more.
    assert_eq!(kinds(&Flow { futile: 60.0, ..vertices(12.0) }, &ordinary()), [CauseKind::FutilePaths]);
}

#[test]
fn alpha_tests_are_many_more_than_elsewhere_and_take_the_place_of_geometry() {
    let tests = |flow: Flow, alpha_tests: f64| Flow { alpha_tests, ..flow };
    let heavy = || met(20.0, 180.0, &[(Some(1), 10.0, 170.0)]);
    let kind = CauseKind::AlphaTests;
    let found = kinds(&tests(heavy(), 8.0), &tests(ordinary(), 0.8));
    assert_eq!(found, [kind]);
    assert_not(kind, &tests(heavy(), 2.0), &ordinary());
    assert_not(kind, &tests(heavy(), 8.0), &tests(ordinary(), 5.0));
    // Rays as elsewhere, but more of them at each vertex.
    let more_rays = Flow { cost: 80.0, rays: 16.0, shadow_rays: 12.0, ..ordinary() };
    assert_not(kind, &tests(more_rays, 16.0), &ordinary());
}

#[test]
fn futile_paths_are_dear_no_shorter_and_more_than_elsewhere() {
    let futile = |cost: f64, futile: f64| Flow { cost, futile, ..ordinary() };
    let kind = CauseKind::FutilePaths;
    assert_named(kind, &futile(100.0, 50.0), &futile(40.0, 4.0));
    assert_not(kind, &futile(100.0, 23.0), &ordinary());
    assert_not(kind, &Flow { rays: 7.0, ..futile(100.0, 50.0) }, &futile(40.0, 4.0));
    assert_not(kind, &futile(100.0, 50.0), &futile(40.0, 16.0));
}

#[test]
fn textures_are_many_for_each_vertex_and_more_than_elsewhere() {
    let looked = |textures: f64| Flow { cost: 41.0, textures, ..ordinary() };
    let kind = CauseKind::Textures;
    assert_named(kind, &looked(8.0), &Flow { textures: 2.0, ..ordinary() });
    assert_not(kind, &looked(3.6), &ordinary());
    assert_not(kind, &looked(8.0), &Flow { textures: 5.0, ..ordinary() });
}
