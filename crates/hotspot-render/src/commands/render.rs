//! `render`: a scene in, a picture and what it cost out.

use super::calibrate::read_profile;
use crate::args::{CALIBRATED_UNIT, LayersArg, RenderArgs};
use crate::causes;
use crate::fail::{Fail, INTERRUPTED};
use crate::interrupt;
use crate::memory;
use crate::output::{Output, Writer};
use crate::progress::Talker;
use crate::seen;
use crate::stage::Stage;
use crate::trees;
use hotspot_cost::document::Note;
use hotspot_cost::exr_io::Header;
use hotspot_cost::{
    CiKind, CostModel, DepthLoss, Document, Frame, LayerOptions, Layers, Ledgers, Metric, hotspots, stats,
};
use hotspot_integrator::{Control, Gather, RenderScene, Rendered, Settings, Stop};
use hotspot_scene::{Camera, Projection};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// Most hotspots that are reported.
const HOTSPOTS: usize = 12;

pub(crate) fn run(args: &RenderArgs) -> Result<(), Fail> {
    let talker = Talker::new(&args.talk);
    let metrics = args.metric_set()?;
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let model = args.cost_model(profile.as_ref());
    if args.no_radiance && metrics.is_empty() {
        return Err(Fail::usage(
            "--no-radiance with --metrics none leaves nothing to do; ask for one of them",
        ));
    }
    // The folder is made first: an unwritable one should not cost a render.
    let writer = Writer::new(&args.output, &args.views)?;

    let start = Instant::now();
    let scene = args.open.load()?;
    let load_seconds = start.elapsed().as_secs_f64();
    if args.intervals && (args.samples() % 2 == 1 || args.cost_spp.is_some_and(|k| k % 2 == 1)) {
        talker.warn(
            "note: --intervals: sample counts are rounded up to even, so that both halves have as many",
        );
    }
    let mut stage = Stage::new(&scene, &args.open, &args.film)?;
    stage.load_seconds = load_seconds;
    // Needed again for other trees alone.
    let scene = args.tree_noise.map(|trees| (trees, scene));
    let aov = args.layers.contains(&LayersArg::Aov);
    stage.check_memory_beside(args.intervals, 1, if aov { seen::BYTES } else { 0 })?;
    let settings = settings(args, &stage, metrics)?;
    stage.announce(&talker);

    let cancel = interrupt::flag();
    let progress = |p| talker.progress(p);
    let estimate = |frame: &Frame| {
        let (error, kind) = stats::estimated_relmse(frame)?;
        talker.estimate(error, kind == CiKind::Halves);
        Some(error)
    };
    let watch = |frame: &Frame| {
        estimate(frame);
    };
    let enough = |frame: &Frame| {
        let (Some(target), Some(error)) = (args.target_error, estimate(frame)) else { return false };
        // The error falls with the samples at least as their number.
        let taken = frame.film_total(0, 0).samples as f64;
        talker.expect(Some((taken * error / target / f64::from(settings.spp)).min(1.0)));
        error <= target
    };
    if args.target_error.is_some() {
        talker.expect(None);
    }
    let shows = args.target_error.is_none() && settings.gather.radiance && talker.shows_estimate();
    let rendered = stage.render(
        &settings,
        Control {
            cancel: Some(cancel),
            progress: Some(&progress),
            enough: if args.target_error.is_some() { Some(&enough) } else { None },
            watch: if shows { Some(&watch) } else { None },
        },
    );
    talker.finish();
    let prepared = &stage.prepared;

    let options = LayerOptions {
        model,
        metrics,
        radiance: !args.no_radiance,
        var: args.layers.contains(&LayersArg::Var),
    };
    talker.say("sampling done; writing layers, maps and the report");
    let mut layers = stage.layers(&rendered, &options);
    let mut tree_noise = None;
    if let Some((trees, scene)) = scene.filter(|_| settings.gather.cost) {
        talker.say(&format!("measuring tree noise over {trees} further trees"));
        let of = (&settings, &options);
        tree_noise = trees::measure(&stage, (&args.open, &scene), of, trees, &mut layers, (&talker, cancel))?;
    }
    let objects =
        if rendered.frame.desc().cost { hotspots::first_objects(&rendered.frame) } else { Vec::new() };
    let mut attributes = BTreeMap::new();
    let mut materials = seen::Names::default();
    if aov || rendered.frame.desc().cost {
        let layers = if aov { Some((&mut layers, &mut attributes)) } else { None };
        materials = seen::look(&stage, &settings, &rendered.frame, layers, (&talker, cancel));
    }
    let mut document = stage.document(&rendered, &options);
    document.settings = described_settings(args, model, &stage, &settings);
    document.cost_unit = profile.as_ref().map(|_| CALIBRATED_UNIT.to_owned());
    document.tree_noise = tree_noise;
    if settings.gather.cost {
        document.depth_limit = DepthLoss::of(&rendered.frame, settings.max_depth);
    }
    note_non_finite(&talker, &rendered, &mut document);
    if settings.gather.cost {
        document.hotspots =
            stage.install(|| find_hotspots(model, &settings, &rendered, &layers, &objects, prepared));
        document.verdict = hotspots::verdict(&document.hotspots);
        document.render.causes_seconds =
            find_causes(model, &stage, (&settings, &rendered), &layers, &objects, &mut document.hotspots);
    }
    document.ledgers = rendered.ledgers.clone().map(Ledgers::shortened);
    document.memory.peak = memory::peak();

    let size = (settings.width, settings.height);
    let header = Header { attributes, ..header(&stage.camera, size, &rendered, &document) };
    let output = Output {
        stem: &stage.name,
        layers: &layers,
        document: &mut document,
        header,
        objects: &objects,
        object_names: prepared.objects(),
        materials: &materials.ids,
        material_names: &materials.names,
        object_triangles: &prepared.object_triangles(),
        ledgers: rendered.ledgers.as_ref(),
        write_exr: true,
    };
    let page = stage.install(|| writer.render(output))?;
    for file in &page.files {
        talker.say(&format!("wrote {file}"));
    }
    summarise(&talker, &document, &rendered);
    finish(&talker, &rendered, args, &document, &page.page)
}

/// Hotspots of what was asked for: `intersection` where it is shown, else the first shown of the metrics that can stand for
/// the cost. Empty when none of them is.
fn find_hotspots(
    model: CostModel,
    settings: &Settings,
    rendered: &Rendered,
    layers: &Layers,
    objects: &[u32],
    prepared: &RenderScene,
) -> Vec<hotspot_cost::Hotspot> {
    if layers.metric(Metric::Intersection).is_some() && settings.gather.trace_shadow_rays {
        return hotspots::of_frame_layers(
            &rendered.frame,
            layers,
            model,
            objects,
            prepared.objects(),
            HOTSPOTS,
        );
    }
    let shown = [Metric::Nodes, Metric::Rays, Metric::Shapes, Metric::TimeUs];
    let Some(metric) = shown.into_iter().find(|m| layers.metric(*m).is_some()) else { return Vec::new() };
    hotspots::of_layers(layers, metric, objects, prepared.objects(), HOTSPOTS)
}

/// The hotspots' causes: from soundings where ledgers are asked for and hotspots go by `intersection`, else from ratios.
fn find_causes(
    model: CostModel,
    stage: &Stage<'_>,
    (settings, rendered): (&Settings, &Rendered),
    layers: &Layers,
    objects: &[u32],
    found: &mut [hotspot_cost::Hotspot],
) -> f64 {
    let why = match layers.metric(Metric::Intersection) {
        Some(_) if !settings.gather.trace_shadow_rays => "shadow rays were not traced",
        None => "intersection cost was not asked for",
        Some(_) if rendered.ledgers.is_none() => "ledgers were not asked for",
        Some(_) if rendered.stop == Stop::Cancelled => "the render was interrupted",
        Some(cost) => return causes::explain(stage, settings, model, (cost, objects), found),
    };
    causes::explain_by_ratios(found, &stage.prepared.object_triangles(), why);
    0.0
}

fn settings(
    args: &RenderArgs,
    stage: &Stage<'_>,
    metrics: hotspot_cost::MetricSet,
) -> Result<Settings, Fail> {
    if args.intervals && args.samples() < 2 {
        return Err(Fail::usage("--intervals needs at least two samples per pixel; raise --spp"));
    }
    let time = metrics.contains(Metric::TimeUs);
    let counts = metrics.iter().any(|m| m != Metric::TimeUs) || metrics.ledgers();
    let mut settings = stage.settings();
    settings.spp = args.samples();
    settings.cost_spp = args.cost_spp;
    settings.intervals = args.intervals;
    settings.gather = Gather {
        radiance: !args.no_radiance,
        cost: counts,
        time,
        trace_shadow_rays: !(args.no_radiance && metrics.only_rays()),
    };
    settings.ledgers = metrics.ledgers() && settings.gather.cost;
    settings.time_limit = args.time_limit.map(Duration::from_secs_f64);
    Ok(settings)
}

fn described_settings(
    args: &RenderArgs,
    model: CostModel,
    stage: &Stage<'_>,
    settings: &Settings,
) -> BTreeMap<String, Value> {
    let mut map = stage.described(settings);
    let mut put = |name: &str, value: Value| map.insert(name.to_owned(), value);
    put("metrics", json!(args.metrics));
    put("no-radiance", json!(args.no_radiance));
    put("c0", json!(model.c0));
    put("c1", json!(model.c1));
    put("profile", json!(args.profile.as_ref().map(|path| path.to_string_lossy())));
    put("time-limit", json!(args.time_limit));
    put("target-error", json!(args.target_error));
    map
}

/// Non-finite samples are counted in the document and shown with the command that reproduces the first.
fn note_non_finite(talker: &Talker, rendered: &Rendered, document: &mut Document) {
    let Some(first) = rendered.non_finite.first() else { return };
    talker.warn(&format!(
        "warning: {} samples had a radiance that is not finite and count as black; the first is sample {} of half {} of \
         pixel ({}, {}); this command shows it again, please report it: {}",
        rendered.non_finite_count,
        first.sample,
        first.half,
        first.x,
        first.y,
        document.command.join(" ")
    ));
    document.repairs.push(Note {
        what: "samples with a radiance that is not finite, counted as black".into(),
        element: format!("pixel ({}, {}), sample {}", first.x, first.y, first.sample),
        count: rendered.non_finite_count,
    });
}

fn header(camera: &Camera, (width, height): (u32, u32), rendered: &Rendered, document: &Document) -> Header {
    let (world_to_camera, world_to_ndc) = matrices(camera, f64::from(width) / f64::from(height));
    Header {
        samples_per_pixel: Some(rendered.samples),
        render_seconds: Some(rendered.seconds as f32),
        world_to_camera: Some(world_to_camera),
        world_to_ndc: Some(world_to_ndc),
        comments: format!("{}; {}", document.generator, document.verdict),
        settings: document
            .settings
            .iter()
            .map(|(k, v)| (k.clone(), v.as_str().map_or_else(|| v.to_string(), str::to_owned)))
            .collect(),
        ..Header::default()
    }
}

/// worldToCamera and worldToNDC as OpenEXR has them: row vectors, camera space left-handed with y up and z forward.
fn matrices(camera: &Camera, aspect: f64) -> ([f32; 16], [f32; 16]) {
    let m = &camera.to_world;
    let column = |i: usize| [m[0][i], m[1][i], m[2][i]];
    let (right, up, back, eye) = (column(0), column(1), column(2), column(3));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let axes = [right, up, back.map(|c| -c)];
    let mut view = [[0.0; 4]; 4];
    for (j, axis) in axes.iter().enumerate() {
        for i in 0..3 {
            view[i][j] = axis[i];
        }
        view[3][j] = -dot(*axis, eye);
    }
    view[3][3] = 1.0;
    // x/w and y/w run from −1 to 1 over the picture; z = 1 and w = depth for perspective.
    let mut projection = [[0.0; 4]; 4];
    match camera.projection {
        Projection::Perspective { yfov, .. } => {
            let h = (0.5 * yfov).tan();
            projection[0][0] = 1.0 / (h * aspect);
            projection[1][1] = 1.0 / h;
            projection[2][2] = 1.0;
            projection[2][3] = 1.0;
        }
        Projection::Orthographic { ymag, .. } => {
            projection[0][0] = 1.0 / (ymag * aspect);
            projection[1][1] = 1.0 / ymag;
            projection[2][2] = 1.0;
            projection[3][3] = 1.0;
        }
    }
    let mut ndc = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            ndc[i][j] = (0..4).map(|k| view[i][k] * projection[k][j]).sum();
        }
    }
    let flat = |m: [[f64; 4]; 4]| core::array::from_fn(|i| m[i / 4][i % 4] as f32);
    (flat(view), flat(ndc))
}

fn summarise(talker: &Talker, document: &Document, rendered: &Rendered) {
    let [width, height] = document.resolution;
    let pixels = f64::from(width) * f64::from(height);
    let rate = f64::from(rendered.samples) * pixels / rendered.seconds.max(1e-9) * 1e-6;
    // Under `--cost-spp` the rays of the other samples are not known.
    let all_counted = document.samples.cost >= document.samples.radiance;
    let rays = document.totals.get("rays").filter(|_| all_counted).map_or(String::new(), |rays| {
        format!(", {:.1} Mrays/s", rays.sum.as_f64() / rendered.seconds.max(1e-9) * 1e-6)
    });
    let threads = if rendered.threads == 1 { "thread" } else { "threads" };
    talker.say(&format!(
        "{width} x {height}, {} spp in {:.2} s on {} {threads}: {rate:.2} Msamples/s{rays}; peak memory {} MiB",
        rendered.samples,
        rendered.seconds,
        rendered.threads,
        document.memory.peak >> 20
    ));
    if let Some(line) = document.depth_limit.as_ref().and_then(depth_line) {
        talker.say(&line);
    }
    if let Some(view) = document.views.iter().find(|v| v.exposure_ev.is_some()) {
        talker.say(&format!("exposure {:+.2} EV", view.exposure_ev.unwrap_or(0.0)));
    }
}

/// Shares of missing light below this are not worth a line.
const LITTLE_LIGHT: f64 = 1e-3;

/// What the depth limit took away, where that matters. A limit below 2 was asked for to see just that.
fn depth_line(cut: &DepthLoss) -> Option<String> {
    let DepthLoss { max_depth, paths, .. } = cut;
    let missing = match cut.lost_share {
        Some(share) if share >= LITTLE_LIGHT => {
            format!("an estimated {:.2} % of the picture's light is missing", 100.0 * share)
        }
        None if *max_depth >= 2 && *paths >= LITTLE_LIGHT => {
            "how much light is missing cannot be told, for it does not yet decay".to_owned()
        }
        _ => return None,
    };
    Some(format!(
        "depth limit {max_depth}: {:.1} % of the paths were cut; {missing}; raise --max-depth to see it",
        100.0 * paths
    ))
}

/// Where the cost is, and where to look.
pub(crate) fn last_line(document: &Document, page: &Path) -> String {
    let page = page.display();
    if document.verdict.is_empty() {
        format!("→ open {page}")
    } else if document.hotspots.is_empty() {
        format!("{} → open {page}", document.verdict)
    } else {
        format!("Costliest: {} → open {page}", document.verdict)
    }
}

/// The last line, and how the command ends.
fn finish(
    talker: &Talker,
    rendered: &Rendered,
    args: &RenderArgs,
    document: &Document,
    page: &Path,
) -> Result<(), Fail> {
    talker.say(&last_line(document, page));
    if let (Some(target), None) = (args.target_error, document.estimated_relmse) {
        talker.say(&format!(
            "--target-error {target:e} not reached: after {} the error cannot be told; it takes two samples per pixel at least",
            if rendered.samples == 1 { "one sample per pixel" } else { "so few samples" }
        ));
    }
    if let (Some(target), Some(error)) = (args.target_error, document.estimated_relmse) {
        let kind = if document.estimated_relmse_kind == CiKind::Halves {
            "estimated"
        } else {
            "at most, by its upper bound,"
        };
        let reached = if error <= target { "reached" } else { "not reached" };
        talker.say(&format!(
            "--target-error {target:e} {reached}: the relative squared error is {kind} {error:.2e} after {} samples per pixel",
            rendered.samples
        ));
    }
    match rendered.stop {
        Stop::Done | Stop::Enough => Ok(()),
        Stop::TimeLimit => {
            talker.say(&format!(
                "stopped by --time-limit after {} of {} samples per pixel",
                rendered.samples,
                args.samples()
            ));
            Ok(())
        }
        Stop::Cancelled => Err(Fail::new(
            INTERRUPTED,
            format!("interrupted: saved {} of {} samples per pixel", rendered.samples, args.samples()),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_in_the_middle_of_the_view_is_at_the_origin_of_ndc() {
        let camera = Camera {
            name: String::new(),
            to_world: [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]],
            projection: Projection::Perspective { yfov: core::f64::consts::FRAC_PI_2, aspect: None },
        };
        let (view, ndc) = matrices(&camera, 2.0);
        let apply = |m: [f32; 16], p: [f32; 4]| -> [f32; 4] {
            core::array::from_fn(|j| (0..4).map(|i| p[i] * m[4 * i + j]).sum())
        };
        // Five ahead of the camera (towards −z), on its axis.
        assert_eq!(apply(view, [1.0, 2.0, -2.0, 1.0]), [0.0, 0.0, 5.0, 1.0]);
        let corner = apply(ndc, [11.0, 7.0, -2.0, 1.0]);
        assert!((corner[0] / corner[3] - 1.0).abs() < 1e-6 && (corner[1] / corner[3] - 1.0).abs() < 1e-6);
    }
}
