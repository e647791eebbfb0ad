//! Why a hotspot costs more: typed causes with names and numbers, and what to try.

use super::rules::{Draft, judge};
use super::sounding::{Flow, Sounding};
use super::tries::Try;
use super::{Hotspot, sentences};
use crate::metric::CostModel;
use serde::{Deserialize, Serialize};

/// Why a region costs more than others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CauseKind {
    /// Paths bounce many times between two objects, or within one. Measure: moves between them per path.
    Trapped,
    /// Shadow rays cost much and most are blocked. Measure: blocked share of those towards the
    /// light that most of them aim at.
    BlockedShadowRays,
    /// Rays pass through many surfaces with holes. Measure: alpha tests per ray.
    AlphaTests,
    /// Rays are tested against many triangles of one object for each node: they lie on each other, or are long and thin.
    /// Measure: triangles tested per ray.
    HeavyLeaves,
    /// Rays visit many nodes that hold triangles of several objects, whose boxes overlap. Measure: nodes per ray.
    OverlappingBounds,
    /// Rays cross more or finer geometry. Measure: intersection cost per ray.
    #[default]
    DenseGeometry,
    /// Paths are no shorter than elsewhere and end without having brought light. Measure: their share of the cost.
    FutilePaths,
    /// Many texture look-ups, which are not in the intersection cost. Measure: look-ups per vertex.
    Textures,
    /// Paths have more vertices than elsewhere. Measure: vertices per path.
    LongPaths,
}

/// A cause that was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Finding {
    /// Which.
    pub kind: CauseKind,
    /// Share of the region's excess over ordinary pixels that goes with it (0 to 1); causes can go together, so that shares
    /// need not sum to 1. Absent where it is not in the intersection cost.
    pub share: Option<f64>,
    /// Of the four independent parts of the sounding, the share that find the same by themselves.
    pub confidence: f64,
    /// Objects behind it, by id: of trapping surfaces, of the light that is not reached, of what is met.
    pub objects: Vec<u32>,
    /// Their names.
    pub names: Vec<String>,
    /// The kind's measure in the region.
    pub here: f64,
    /// The same at ordinary pixels.
    pub ordinary: f64,
    /// In words.
    pub words: String,
    /// What to try, in words.
    pub fix: String,
    /// Changes that `whatif` can try, not written to files; as options they are in [`Hotspot::whatif`].
    #[serde(skip)]
    pub tries: Vec<Try>,
}

/// How a material scatters, as far as changes go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialKind {
    /// Matte or unlit: neither can be made matte.
    Matte,
    /// Reflects like a mirror or nearly so.
    Smooth,
    /// Reflects with some roughness.
    Rough,
    /// Lets light through.
    Glass,
}

/// What is known of the scene, for words and for what to try.
#[derive(Clone, Copy, Debug, Default)]
pub struct Context<'a> {
    /// The constants of equation 1.
    pub model: CostModel,
    /// Most scattering events of the render.
    pub max_depth: u32,
    /// By material id; empty when unknown.
    pub materials: &'a [MaterialKind],
    /// World boxes by object id, `None` for objects without triangles; empty when unknown.
    pub bounds: &'a [Option<[[f32; 3]; 2]>],
    /// Triangles by object id; empty when unknown.
    pub triangles: &'a [u64],
    /// Share of the frame's pixels that show each object; empty when unknown.
    pub visible: &'a [f64],
    /// Objects that emit.
    pub lights: usize,
}

impl Context<'_> {
    /// Volume that two objects' boxes share, as a part of the smaller one; `None` when unknown. Flat boxes count as a thousandth
    /// of their longest edge thick.
    pub(super) fn overlap(&self, a: u32, b: u32) -> Option<f64> {
        let bounds = |object: u32| self.bounds.get(object as usize).copied().flatten();
        let thick = |[min, max]: [[f32; 3]; 2]| {
            let edge: [f64; 3] = core::array::from_fn(|i| f64::from(max[i]) - f64::from(min[i]));
            let least = 1e-3 * edge.iter().fold(0.0f64, |most, e| most.max(*e));
            core::array::from_fn::<[f64; 2], 3, _>(|i| {
                let grow = 0.5 * (least - edge[i]).max(0.0);
                [f64::from(min[i]) - grow, f64::from(max[i]) + grow]
            })
        };
        let (a, b) = (thick(bounds(a)?), thick(bounds(b)?));
        let volume = |of: [[f64; 2]; 3]| of.iter().map(|[lo, hi]| (hi - lo).max(0.0)).product::<f64>();
        let shared = core::array::from_fn(|i| [a[i][0].max(b[i][0]), a[i][1].min(b[i][1])]);
        let smaller = volume(a).min(volume(b));
        (smaller > 0.0).then(|| volume(shared) / smaller)
    }
}

/// Most causes told of one hotspot.
const MOST: usize = 3;

/// Finds the causes of a hotspot from soundings of its pixels (independent parts of like size) and of
/// [`ordinary_pixels`](super::ordinary_pixels), and writes `cause`, `causes`, `fix` and `whatif`. Names come from the soundings'
/// ledgers. Soundings of different scenes make no sense together; without any
/// path the hotspot is left as it is.
pub fn explain(hotspot: &mut Hotspot, here: &[Sounding], ordinary: &[Sounding], context: &Context<'_>) {
    let Some(first) = here.first() else { return };
    let paths: u64 = here.iter().map(Sounding::paths).sum();
    let all = Flow::of(here, context.model);
    let elsewhere = Flow::of(ordinary, context.model);
    if paths == 0 || elsewhere.paths <= 0.0 {
        return;
    }
    let parts: Vec<Vec<Draft>> =
        here.iter().map(|part| judge(&Flow::of([part], context.model), &elsewhere, context)).collect();
    let drafts = judge(&all, &elsewhere, context);
    hotspot.sounded = paths;
    hotspot.causes = drafts
        .iter()
        .take(MOST)
        .map(|draft| {
            let same = |other: &Draft| other.kind == draft.kind && other.objects == draft.objects;
            let agreeing = parts.iter().filter(|part| part.iter().any(same)).count();
            let mut finding = Finding {
                kind: draft.kind,
                share: draft.share,
                confidence: agreeing as f64 / parts.len() as f64,
                objects: draft.objects.clone(),
                names: draft
                    .objects
                    .iter()
                    .map(|o| first.ledgers.object_name(Some(*o), "?").to_owned())
                    .collect(),
                here: draft.here,
                ordinary: draft.ordinary,
                ..Finding::default()
            };
            finding.words = sentences::cause(&finding);
            finding.fix = sentences::fix(&finding, hotspot, context);
            finding.tries = tries(&finding, draft, hotspot, &first.ledgers, context);
            finding
        })
        .collect();
    hotspot.whatif = Vec::new();
    for option in hotspot.causes.iter().flat_map(|finding| &finding.tries).map(Try::to_string) {
        if !hotspot.whatif.contains(&option) {
            hotspot.whatif.push(option);
        }
    }
    let joined =
        |of: fn(&Finding) -> &str, by: &str| hotspot.causes.iter().map(of).collect::<Vec<_>>().join(by);
    hotspot.fix = joined(|finding| &finding.fix, " ");
    hotspot.cause = if hotspot.causes.is_empty() {
        sentences::nothing(
            all.cost / elsewhere.cost,
            [&all, &elsewhere].map(|flow| (flow.blocked + flow.futile) / flow.cost),
        )
    } else {
        joined(|finding| &finding.words, "; ")
    };
}

/// Objects that fill at most this share of the picture are worth taking away to see what they cost.
const SMALL: f64 = 0.05;

/// What `whatif` can try about a cause.
fn tries(
    finding: &Finding,
    draft: &Draft,
    hotspot: &Hotspot,
    ledgers: &crate::Ledgers,
    context: &Context<'_>,
) -> Vec<Try> {
    let mut tries = Vec::new();
    let shorter = (context.max_depth >= 4).then_some(Try::MaxDepth(context.max_depth / 2));
    let delete = |object: &u32| Try::Delete { object: ledgers.object_name(Some(*object), "?").to_owned() };
    let visible = |object: &u32| context.visible.get(*object as usize).copied().unwrap_or(1.0);
    // The entry that several objects share is none of them.
    let real = |object: &&u32| (**object as usize) < context.bounds.len();
    match finding.kind {
        CauseKind::Trapped | CauseKind::LongPaths => {
            for material in &draft.materials {
                let name = || ledgers.material_name(Some(*material)).to_owned();
                match context.materials.get(*material as usize) {
                    Some(MaterialKind::Smooth) => {
                        tries.push(Try::Roughness { material: name(), roughness: 0.5 });
                        tries.push(Try::Matte { material: name() });
                    }
                    Some(MaterialKind::Rough | MaterialKind::Glass) => {
                        tries.push(Try::Matte { material: name() });
                    }
                    Some(MaterialKind::Matte) | None => {}
                }
            }
            tries.extend(shorter);
        }
        CauseKind::FutilePaths => tries.extend(shorter),
        CauseKind::BlockedShadowRays => {
            if context.lights > 1 {
                tries.extend(draft.objects.iter().filter(real).map(delete));
            }
        }
        CauseKind::AlphaTests | CauseKind::HeavyLeaves => {
            tries.extend(draft.objects.iter().filter(real).map(delete));
        }
        CauseKind::OverlappingBounds | CauseKind::DenseGeometry => {
            let small = |object: &&u32| visible(object) <= SMALL && Some(**object) != hotspot.object;
            tries.extend(draft.objects.iter().filter(real).filter(small).map(delete));
        }
        CauseKind::Textures => {}
    }
    tries
}
