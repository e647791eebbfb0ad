//! What each pixel shows: the layers of `--layers aov`, and the names under the page's pointer.

use crate::progress::Talker;
use hotspot_cost::exr_io::ExrFile;
use hotspot_cost::{Frame, Layers, cryptomatte};
use hotspot_integrator::{FIRST_HIT_BYTES, FirstHit, RenderScene, Settings, add_first_hits};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use crate::stage::Stage;

/// Bytes per pixel that the layers need: the hits, their planes, and the EXR writer's copy of these.
pub(crate) const BYTES: u64 = FIRST_HIT_BYTES + FIRST_HIT_BYTES / 2;

/// Names of a Cryptomatte's layers.
const OBJECTS: &str = "CryptoObject";
const MATERIALS: &str = "CryptoMaterial";

/// An index for each pixel, and what the indices are called. Empty when unknown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names {
    pub(crate) ids: Vec<u32>,
    pub(crate) names: Vec<String>,
}

/// Casts the render's camera rays once more. With `layers` all of them, for the EXR: adds the layers to `layers` and what describes them
/// to the header's `attributes`; without, one of each pixel, for the page. Returns the material of each pixel.
pub(crate) fn look(
    stage: &Stage<'_>,
    settings: &Settings,
    frame: &Frame,
    layers: Option<(&mut Layers, &mut BTreeMap<String, String>)>,
    (talker, cancel): (&Talker, &AtomicBool),
) -> Names {
    let start = Instant::now();
    let most = if layers.is_some() { u64::MAX } else { 1 };
    let prepared = &stage.prepared;
    let Some(hits) = stage.first_hits(settings, frame, most, cancel) else {
        if layers.is_some() {
            talker.warn("interrupted: the layers of --layers aov are not in the EXR");
        }
        return Names::default();
    };
    let names: Vec<String> = prepared.material_names().map(str::to_owned).collect();
    if let Some((layers, attributes)) = layers {
        add(layers, attributes, &hits, prepared, &names);
        talker.say(&format!("albedo, normal, depth and mattes in {:.2} s", start.elapsed().as_secs_f64()));
    }
    Names { ids: hits.iter().map(|hit| hit.materials[0].id).collect(), names }
}

fn add(
    layers: &mut Layers,
    attributes: &mut BTreeMap<String, String>,
    hits: &[FirstHit],
    prepared: &RenderScene,
    materials: &[String],
) {
    add_first_hits(layers, hits);
    let ranks: Vec<_> = hits.iter().map(|hit| hit.objects).collect();
    cryptomatte::add(layers, attributes, OBJECTS, &ranks, prepared.objects());
    let ranks: Vec<_> = hits.iter().map(|hit| hit.materials).collect();
    cryptomatte::add(layers, attributes, MATERIALS, &ranks, materials);
}

/// Objects and materials of a file's pixels, where it has Cryptomattes of them. Those that `objects` and `materials` name (a document's
/// ledgers) keep their indices.
pub(crate) fn of_file(file: &ExrFile, objects: &[String], materials: &[String]) -> [Names; 2] {
    [(OBJECTS, objects), (MATERIALS, materials)].map(|(layer, known)| {
        let found = cryptomatte::largest(&file.layers, &file.header.attributes, layer);
        let Some((mut ids, found)) = found else { return Names::default() };
        let mut names = known.to_vec();
        let index: BTreeMap<&str, u32> = known.iter().map(String::as_str).zip(0..).collect();
        let mut place = Vec::with_capacity(found.len());
        for name in &found {
            place.push(index.get(name.as_str()).copied().unwrap_or_else(|| {
                names.push(name.clone());
                names.len() as u32 - 1
            }));
        }
        for id in &mut ids {
            *id = place.get(*id as usize).copied().unwrap_or(u32::MAX);
        }
        Names { ids, names }
    })
}
