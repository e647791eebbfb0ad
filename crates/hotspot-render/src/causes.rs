//! Why hotspots cost what they do: a few more paths through their pixels, booked, and what the rules make of them.

use crate::stage::Stage;
use hotspot_cost::CostModel;
use hotspot_cost::hotspots::{self, Context, Hotspot};
use hotspot_integrator::Settings;
use std::time::Instant;

/// Explains hotspots by soundings of their pixels and of ordinary ones; seconds that it took. `cost` and `objects` are the planes
/// that the hotspots were found in.
pub(crate) fn explain(
    stage: &Stage<'_>,
    settings: &Settings,
    model: CostModel,
    (cost, objects): (&[f32], &[u32]),
    found: &mut [Hotspot],
) -> f64 {
    if found.is_empty() {
        return 0.0;
    }
    let start = Instant::now();
    let regions: Vec<Vec<u32>> = std::iter::once(hotspots::ordinary_pixels(cost, objects))
        .chain(found.iter().map(|hotspot| hotspot.members.clone()))
        .collect();
    let soundings = stage.sound(settings, &regions);
    let prepared = &stage.prepared;
    let (materials, bounds) = (prepared.material_kinds(), prepared.object_bounds());
    let (triangles, visible) = (prepared.object_triangles(), visible(objects, prepared.objects().len()));
    let context = Context {
        model,
        max_depth: settings.max_depth,
        materials: &materials,
        bounds: &bounds,
        triangles: &triangles,
        visible: &visible,
        lights: prepared.emitting_objects().len(),
    };
    if let [ordinary, regions @ ..] = soundings.as_slice() {
        for (hotspot, here) in found.iter_mut().zip(regions) {
            hotspots::explain(hotspot, here, ordinary, &context);
        }
    }
    start.elapsed().as_secs_f64()
}

/// What can be said without soundings.
pub(crate) fn explain_by_ratios(found: &mut [Hotspot], object_triangles: &[u64], why: &str) {
    for hotspot in found {
        let triangles = hotspot.object.and_then(|object| object_triangles.get(object as usize)).copied();
        hotspot.fix = hotspots::fix(hotspot, triangles);
        hotspot.cause = format!("{} (by ratios alone: {why})", hotspot.cause);
    }
}

/// Share of the pixels that show each object.
fn visible(objects: &[u32], count: usize) -> Vec<f64> {
    let mut shares = vec![0.0; count];
    let pixel = 1.0 / objects.len().max(1) as f64;
    for object in objects {
        if let Some(share) = shares.get_mut(*object as usize) {
            *share += pixel;
        }
    }
    shares
}
