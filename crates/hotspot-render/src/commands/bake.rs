//! `bake`: what rays cost where they land, on the surfaces themselves, as glTF for any viewer.

use crate::args::{ColorArg, FilmArgs, LightsArg, TalkArgs};
use crate::commands::make_folder;
use crate::fail::{FAILED, Fail, INTERRUPTED};
use crate::interrupt;
use crate::memory;
use crate::open::{SceneArgs, default_size};
use crate::progress::Talker;
use crate::stage::Stage;
use clap::{Args, ValueEnum};
use hotspot_cost::CostModel;
use hotspot_cost::maps::{HeatOptions, Scale, heat_map, write_atomic, write_png};
use hotspot_cost::surface::{
    SurfaceCamera, SurfaceCounts, SurfacePart, SurfaceScale, vertex_colors, write_glb,
};
use hotspot_integrator::{BakeView, Baked, Control, MeshPart, Stop, SurfaceMesh};
use hotspot_scene::Projection;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

/// Version of `NAME.bake.json`.
const SCHEMA: &str = "hotspot-bake/1";
/// Rays beyond this percentile get the last colour.
const CLIP: f64 = 99.0;
/// Objects that the JSON lists.
const OBJECTS: usize = 1000;

/// `bake`.
#[derive(Debug, Args)]
pub(crate) struct BakeArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    /// Look from N points inside the scene's bounds in all directions, rather than from the camera: the cost of the scene, not of one view
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) views: Option<u32>,
    /// What the values are: cost per ray that lands there, or per path and unit of area
    #[arg(long, value_enum, default_value_t = PerArg::Ray)]
    pub(crate) per: PerArg,
    /// Split triangles until no edge is longer than 1/N of the scene's diagonal (0: leave them as they are)
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(..=100_000))]
    pub(crate) detail: u32,
    /// Paths of each pixel
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: u32,
    /// Cost of visiting a node
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = crate::args::parse_weight)]
    pub(crate) c0: f64,
    /// Cost of testing a triangle
    #[arg(long, value_name = "Y", default_value_t = 1.0, value_parser = crate::args::parse_weight)]
    pub(crate) c1: f64,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    /// Colours
    #[arg(long, value_enum, default_value_t = ColorArg::Inferno)]
    pub(crate) colors: ColorArg,
    /// Fixed range of the colours
    #[arg(long, value_name = "LO:HI", value_parser = parse_range)]
    pub(crate) scale: Option<(f64, f64)>,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PerArg {
    /// Mean over the rays that land there
    Ray,
    /// Sum over the rays, by path and area: where the cost lies
    Area,
}

impl PerArg {
    const fn name(self) -> &'static str {
        match self {
            Self::Ray => "ray",
            Self::Area => "area",
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            Self::Ray => "nodes + triangles per ray that lands there",
            Self::Area => "nodes + triangles per path and unit of area",
        }
    }
}

fn parse_range(text: &str) -> Result<(f64, f64), String> {
    let ends = text.split_once(':').and_then(|(lo, hi)| Some((lo.parse().ok()?, hi.parse().ok()?)));
    match ends {
        Some((lo, hi)) if f64::is_finite(lo) && f64::is_finite(hi) && lo < hi => Ok((lo, hi)),
        _ => Err("write the lower and the upper end such as 0:50".into()),
    }
}

/// An object's share.
#[derive(Clone, Copy, Debug, Default)]
struct Share {
    cost: f64,
    rays: f64,
    area: f64,
}

pub(crate) fn run(args: &BakeArgs) -> Result<(), Fail> {
    if args.film.adaptive {
        return Err(Fail::usage("bake takes as many paths of every pixel; leave --adaptive out"));
    }
    if args.views.is_some() && args.film.lights == LightsArg::Learned {
        return Err(Fail::usage("--lights learned learns from a camera; leave it or --views out"));
    }
    let talker = Talker::new(&args.talk);
    make_folder(&args.output)?;
    let start = Instant::now();
    let scene = args.open.load()?;
    let mut stage = Stage::new(&scene, &args.open, &args.film)?;
    stage.load_seconds = start.elapsed().as_secs_f64();
    if args.film.size.is_none() {
        (stage.width, stage.height) = default_size(&stage.camera, 480.0);
    }
    let prepared = &stage.prepared;
    let limit = args.open.max_memory.saturating_mul(1 << 20);
    let mesh = SurfaceMesh::new(prepared, args.detail, Some(limit))
        .map_err(|error| Fail::new(FAILED, format!("{}: {error}", stage.name)))?;
    stage.announce(&talker);
    let points = args.views.map(|count| stage.viewpoints(count));
    talker.say(&match &points {
        Some(points) => {
            format!("baking on {} vertices from {} viewpoints", mesh.vertex_count(), points.len())
        }
        None => format!("baking on {} vertices from camera \"{}\"", mesh.vertex_count(), stage.camera.name),
    });
    if let (Some(points), Some(wanted)) = (&points, args.views)
        && points.len() < wanted as usize
    {
        talker.warn(&format!(
            "note: --views {wanted}: only {} points were found that lie in the open and see anything",
            points.len()
        ));
    }

    let view = points.as_deref().map_or(BakeView::Camera(&stage.camera), BakeView::Points);
    let mut settings = stage.settings();
    settings.spp = args.spp;
    let cancel = interrupt::flag();
    let progress = |p| talker.progress(p);
    let control = Control { cancel: Some(cancel), progress: Some(&progress), enough: None, watch: None };
    let baked = stage.bake(&mesh, view, &settings, control);
    talker.finish();

    let model = CostModel { c0: args.c0, c1: args.c1 };
    let areas = areas(&mesh);
    let rays: Vec<f32> =
        (0..mesh.vertex_count()).map(|vertex| baked.sums.vertex(vertex).rays() as f32).collect();
    let value = |vertex: usize| {
        let sum = baked.sums.vertex(vertex);
        let over = match args.per {
            PerArg::Ray => sum.rays(),
            PerArg::Area => areas[vertex] * baked.paths as f64,
        };
        // Where no ray landed nothing is known; `_RAYS` says so.
        if over > 0.0 { (sum.cost(model) / over) as f32 } else { 0.0 }
    };
    let values: Vec<f32> = (0..mesh.vertex_count()).map(value).collect();
    let pairs = || values.iter().copied().zip(rays.iter().copied());
    let scale =
        args.scale.map_or_else(|| SurfaceScale::auto(pairs(), CLIP), |(lo, hi)| SurfaceScale { lo, hi });
    let colors = vertex_colors(pairs(), args.colors.map(), scale);

    let materials: Vec<&str> = prepared.material_names().collect();
    let parts: Vec<SurfacePart> = mesh
        .parts()
        .iter()
        .map(|part| SurfacePart {
            object: prepared.objects()[part.object as usize].clone(),
            material: materials[part.material as usize].to_owned(),
            positions: mesh.positions()[part.vertices.clone()].to_vec(),
            triangles: mesh
                .triangles(part)
                .map(|t| t.map(|vertex| vertex - part.vertices.start as u32))
                .collect(),
            colors: colors[part.vertices.clone()].to_vec(),
            cost: values[part.vertices.clone()].to_vec(),
            rays: rays[part.vertices.clone()].to_vec(),
        })
        .collect();
    let shares = shares(&mesh, &baked, model, &areas);
    let document = document(args, &stage, (&mesh, &baked), points.as_deref(), (scale, &shares));
    let about = json!({
        "_COST": args.per.unit(), "_RAYS": "rays that landed around the vertex",
        "COLOR_0": { "map": args.colors.map().name(), "lo": scale.lo, "hi": scale.hi },
        "schema": SCHEMA,
    });
    let generator = format!("hotspot-render {}", env!("CARGO_PKG_VERSION"));
    let camera = camera(&stage, &mesh);
    let glb = write_glb(&parts, camera.as_ref(), &generator, &about)?;
    drop(parts);

    let file = |suffix: &str| args.output.join(format!("{}.bake.{suffix}", stage.name));
    let picture = heat_map(
        stage.width,
        stage.height,
        &stage.surface_view(&mesh, &values),
        &HeatOptions {
            label: "Cost where rays land".into(),
            unit: args.per.unit().into(),
            map: args.colors.map(),
            scale: Scale::Fixed(scale.lo as f32, scale.hi as f32),
            despike: false,
        },
    );
    write_atomic(&file("glb"), &glb)?;
    talker.say(&format!("wrote {}: the surfaces with COLOR_0, _COST and _RAYS", file("glb").display()));
    write_png(&file("png"), &picture.image)?;
    talker.say(&format!("wrote {}: the same from the camera", file("png").display()));
    let text = format!("{document:#}\n");
    write_atomic(&file("json"), text.as_bytes())?;
    talker.say(&format!("wrote {}: sums and objects", file("json").display()));
    talker.say(&format!(
        "{} paths in {:.2} s on {} threads; peak memory {} MiB",
        baked.paths,
        baked.seconds,
        stage.threads(),
        memory::peak() >> 20
    ));
    talker.say(&format!(
        "{} → open {}",
        document["verdict"].as_str().unwrap_or_default(),
        file("glb").display()
    ));
    if baked.stop == Stop::Cancelled {
        return Err(Fail::new(
            INTERRUPTED,
            format!("interrupted: saved {} of {} paths per pixel", baked.samples, args.spp),
        ));
    }
    Ok(())
}

/// A third of the areas of the triangles around each vertex.
fn areas(mesh: &SurfaceMesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertex_count()];
    for part in mesh.parts() {
        for triangle in mesh.triangles(part) {
            let [a, b, c] = triangle.map(|vertex| mesh.positions()[vertex as usize].map(f64::from));
            let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i| p[i] - a[i]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let third = n.iter().map(|c| c * c).sum::<f64>().sqrt() / 6.0;
            for vertex in triangle {
                areas[vertex as usize] += third;
            }
        }
    }
    areas
}

/// Objects by falling cost.
fn shares(mesh: &SurfaceMesh, baked: &Baked, model: CostModel, areas: &[f64]) -> Vec<(u32, Share)> {
    let mut objects = BTreeMap::<u32, Share>::new();
    for MeshPart { object, vertices, .. } in mesh.parts() {
        let share = objects.entry(*object).or_default();
        for vertex in vertices.clone() {
            let sum = baked.sums.vertex(vertex);
            share.cost += sum.cost(model);
            share.rays += sum.rays();
            share.area += areas[vertex];
        }
    }
    let mut objects: Vec<_> = objects.into_iter().collect();
    objects.sort_by(|a, b| b.1.cost.total_cmp(&a.1.cost));
    objects
}

fn counts(counts: &SurfaceCounts, model: CostModel) -> Value {
    json!({ "rays": counts.rays, "nodes": counts.nodes, "shapes": counts.shapes, "cost": counts.cost(model) })
}

fn document(
    args: &BakeArgs,
    stage: &Stage<'_>,
    (mesh, baked): (&SurfaceMesh, &Baked),
    points: Option<&[[f32; 3]]>,
    (scale, shares): (SurfaceScale, &[(u32, Share)]),
) -> Value {
    let model = CostModel { c0: args.c0, c1: args.c1 };
    let landed = baked.sums.total();
    let mut total = landed;
    total.add(&baked.escaped);
    let names = stage.prepared.objects();
    let landed_cost = landed.cost(model);
    let share_of = |cost: f64| if landed_cost > 0.0 { cost / landed_cost } else { 0.0 };
    let objects: Vec<Value> = shares
        .iter()
        .take(OBJECTS)
        .map(|(object, share)| {
            let per = |over: f64| (over > 0.0).then(|| share.cost / over);
            json!({
                "object": object,
                "name": names[*object as usize],
                "share": share_of(share.cost),
                "rays": share.rays,
                "area": share.area,
                "cost_per_ray": per(share.rays),
                "cost_per_path_and_area": per(share.area * baked.paths as f64),
            })
        })
        .collect();
    let top: Vec<String> = shares
        .iter()
        .filter(|(_, share)| share.cost > 0.0)
        .take(3)
        .map(|(object, share)| {
            format!("{:.0} % on \"{}\"", 100.0 * share_of(share.cost), names[*object as usize])
        })
        .collect();
    let verdict = if top.is_empty() {
        "No ray landed on a surface".to_owned()
    } else {
        format!("Of the cost where rays land, {} ", top.join(", ")).trim_end().to_owned()
    };
    let mut settings = stage.described(&{
        let mut settings = stage.settings();
        settings.spp = args.spp;
        settings
    });
    settings.insert("c0".into(), json!(args.c0));
    settings.insert("c1".into(), json!(args.c1));
    settings.insert("detail".into(), json!(args.detail));
    json!({
        "schema": SCHEMA,
        "generator": format!("hotspot-render {}", env!("CARGO_PKG_VERSION")),
        "scene": stage.name,
        "verdict": verdict,
        "per": args.per.name(),
        "unit": args.per.unit(),
        "scale": [scale.lo, scale.hi],
        "size": [stage.width, stage.height],
        "paths": baked.paths,
        "samples_per_pixel": baked.samples,
        "seconds": baked.seconds,
        "vertices": mesh.vertex_count(),
        "viewpoints": points,
        "total": counts(&total, model),
        "landed": counts(&landed, model),
        "escaped": counts(&baked.escaped, model),
        "objects": objects,
        "settings": settings,
    })
}

/// The stage's camera, where glTF can say it as it is.
fn camera(stage: &Stage<'_>, mesh: &SurfaceMesh) -> Option<SurfaceCamera> {
    let Projection::Perspective { yfov, .. } = stage.camera.projection else { return None };
    let reach = mesh.positions().iter().flatten().fold(0.0f64, |most, c| most.max(f64::from(c.abs())));
    Some(SurfaceCamera {
        to_world: stage.camera.to_world,
        yfov,
        aspect: f64::from(stage.width) / f64::from(stage.height),
        znear: (1e-4 * reach).max(1e-6),
    })
}

#[cfg(test)]
mod tests {
    use super::parse_range;

    #[test]
    fn ranges_are_checked() {
        assert_eq!(parse_range("0:5.5"), Ok((0.0, 5.5)));
        for wrong in ["", "5", "5:1", "nan:2", "0:inf", "a:b"] {
            assert!(parse_range(wrong).is_err(), "{wrong}");
        }
    }
}
