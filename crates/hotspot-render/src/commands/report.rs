//! `report`: maps and the page from any EXR with `cost.*` channels.

use crate::args::ReportArgs;
use crate::fail::{FAILED, Fail};
use crate::output::{Output, Writer, stem};
use crate::seen;
use hotspot_cost::document::SCHEMA;
use hotspot_cost::exr_io::{self, ExrFile, Limits};
use hotspot_cost::{Document, Layers, Metric, hotspots};
use std::collections::BTreeMap;
use std::path::Path;

pub(crate) fn run(args: &ReportArgs) -> Result<(), Fail> {
    let mut file = exr_io::read(&args.input, &Limits::default())?;
    if let Some(mapping) = &args.channels {
        rename_channels(&mut file.layers, mapping)?;
    }
    let place = args.input.display().to_string();
    if file.layers.metrics().next().is_none() {
        let names: Vec<&str> = file.layers.planes.keys().map(String::as_str).take(12).collect();
        return Err(Fail::new(
            FAILED,
            format!(
                "{place}: it has no cost.* channels (it has {}); name them with --channels FILE, a JSON object such as \
                 {{\"cost.nodes\": \"{}\"}}",
                names.join(", "),
                names.first().unwrap_or(&"bvh.visits")
            ),
        ));
    }
    let mut document = document(&file, &place)?;
    let ignored = file.ignored.clone();
    let known = document.ledgers.as_ref();
    let known = known.map_or((&[][..], &[][..]), |ledgers| (&ledgers.objects[..], &ledgers.materials[..]));
    let [objects, materials] = seen::of_file(&file, known.0, known.1);
    let name = stem(&args.input);
    let writer = Writer::new(&args.output, &args.views)?;
    let page = writer.render(Output {
        stem: &name,
        layers: &file.layers,
        document: &mut document,
        header: file.header.clone(),
        objects: &objects.ids,
        object_names: &objects.names,
        materials: &materials.ids,
        material_names: &materials.names,
        object_triangles: &[],
        ledgers: None,
        write_exr: false,
    })?;
    if !args.quiet {
        for line in ignored {
            crate::say::out!("left out: {line}");
        }
        for written in &page.files {
            crate::say::out!("wrote {written}");
        }
        crate::say::out!("{}", super::render::last_line(&document, &page.page));
    }
    Ok(())
}

/// The file's own document, or one made from its layers.
pub(crate) fn document(file: &ExrFile, place: &str) -> Result<Document, Fail> {
    if !file.header.json.is_empty() {
        return Ok(Document::from_json(&file.header.json, place)?);
    }
    let layers = &file.layers;
    let mut document = Document {
        schema: SCHEMA.to_owned(),
        scene: place.to_owned(),
        resolution: [layers.width, layers.height],
        samples_per_pixel: file.header.samples_per_pixel.unwrap_or(0).into(),
        ..Document::default()
    };
    document.render.seconds = file.header.render_seconds.unwrap_or(0.0).into();
    let metric = [Metric::Intersection, Metric::Nodes, Metric::TimeUs, Metric::Rays]
        .into_iter()
        .chain(layers.metrics())
        .find(|m| layers.metric(*m).is_some());
    if let Some(metric) = metric {
        document.hotspots = hotspots::of_layers(layers, metric, &[], &[], 12);
        document.verdict = hotspots::verdict(&document.hotspots);
    }
    Ok(document)
}

/// Applies a mapping from our channel names to the file's.
fn rename_channels(layers: &mut Layers, mapping: &Path) -> Result<(), Fail> {
    let place = mapping.display();
    let text = std::fs::read_to_string(mapping)
        .map_err(|e| Fail::new(FAILED, format!("cannot read {place}: {e}")))?;
    let names: BTreeMap<String, String> = serde_json::from_str(&text).map_err(|e| {
        Fail::new(
            FAILED,
            format!(
                "{place}: not a JSON object of channel names ({e}); write {{\"cost.nodes\": \"bvh.visits\"}}"
            ),
        )
    })?;
    for (ours, theirs) in names {
        let Some(plane) = layers.planes.get(&theirs).cloned() else {
            let have: Vec<&str> = layers.planes.keys().map(String::as_str).collect();
            let near = crate::args::nearest(&theirs, have.iter().copied());
            let hint = near.map_or(String::new(), |n| format!("; did you mean \"{n}\"?"));
            return Err(Fail::new(
                FAILED,
                format!("{place}: \"{ours}\": the EXR has no channel \"{theirs}\"{hint}"),
            ));
        };
        layers.planes.insert(ours, plane);
    }
    Ok(())
}
