//! Renders over other trees, to see how much of a cost is the luck of the tree.

use crate::fail::Fail;
use crate::open::SceneArgs;
use crate::progress::Talker;
use crate::stage::Stage;
use hotspot_cost::{LayerOptions, Layers, TreeNoise, TreeSpread};
use hotspot_integrator::{Control, Gather, Settings};
use hotspot_scene::Scene;
use std::sync::atomic::{AtomicBool, Ordering};

/// Settings of a render that counts over another tree: the same paths, but for a quarter of the samples. Few show the
/// tree's luck as well, since all of them go through it.
pub(crate) fn settings(of: &Settings) -> Settings {
    let mut settings = of.clone();
    settings.spp = (of.spp / 4).max(2);
    settings.cost_spp = None;
    settings.time_limit = None;
    settings.gather = Gather { radiance: false, cost: true, time: false, ..of.gather };
    settings
}

/// What is kept of such a render.
pub(crate) const fn layers(of: &LayerOptions) -> LayerOptions {
    LayerOptions { radiance: false, var: false, ..*of }
}

/// Renders over `count` further trees. Interrupted it keeps those that are done; `None` when those are fewer than two.
pub(crate) fn measure(
    stage: &Stage<'_>,
    (open, scene): (&SceneArgs, &Scene),
    of: (&Settings, &LayerOptions),
    count: u32,
    planes: &mut Layers,
    (talker, cancel): (&Talker, &AtomicBool),
) -> Result<Option<TreeNoise>, Fail> {
    let (settings, options) = (settings(of.0), layers(of.1));
    let mut spread = TreeSpread::new(settings.width, settings.height);
    for number in 1..=u64::from(count) {
        if cancel.load(Ordering::Relaxed) {
            break;
        }
        let prepared = open.prepare_over_tree(scene, Some(number))?;
        let progress = |p| talker.progress(p);
        let control = Control { cancel: Some(cancel), progress: Some(&progress), ..Control::default() };
        let rendered = stage.render_over(&prepared, &settings, control);
        if rendered.stop == hotspot_integrator::Stop::Done {
            spread.add(&stage.layers(&rendered, &options));
        }
    }
    talker.finish();
    Ok(spread.finish(u64::from(settings.spp), planes))
}
