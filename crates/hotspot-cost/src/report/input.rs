//! What the pages are made from: plain data that any renderer can fill in.
//!
//! Names and sentences may come from hostile files: the page escapes all of them.

use crate::Rect;
use crate::maps::{ColorMap, Scale};
use image::RgbImage;

/// What a map's values are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ValueKind {
    /// An amount of work: read as a ratio to the median pixel.
    #[default]
    Amount,
    /// A share of 0..1 (how paths ended): read in percent.
    Share,
}

/// One layer that the page can show and read out.
#[derive(Clone, Debug)]
pub struct MapLayer<'a> {
    /// Name in files: `intersection`.
    pub metric: String,
    /// Name for people: "Intersection cost".
    pub label: String,
    /// Unit per path: "nodes + triangles", "µs". May be empty.
    pub unit: String,
    /// How values are read.
    pub kind: ValueKind,
    /// Row-major values, one per pixel, from the top.
    pub values: &'a [f32],
    /// Scale of the picture.
    pub scale: Scale,
    /// Colours of the picture.
    pub map: ColorMap,
    /// Despike the picture (never the read-out), for `time_us`.
    pub despike: bool,
}

/// Which object each pixel shows.
#[derive(Clone, Debug)]
pub struct ObjectLayer<'a> {
    /// Row-major index into `names`, anything outside it where nothing was hit.
    pub ids: &'a [u32],
    /// Names of the objects.
    pub names: Vec<String>,
}

/// A label and its value, both for people.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fact {
    /// "Samples per pixel".
    pub label: String,
    /// "64".
    pub value: String,
}

impl Fact {
    /// A fact from anything that prints.
    pub fn new(label: impl ToString, value: impl ToString) -> Self {
        Self { label: label.to_string(), value: value.to_string() }
    }
}

/// A change that was tried, and what it did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SuggestionRow {
    /// The change in words.
    pub what: String,
    /// Why it was tried.
    pub reason: String,
    /// The command that tries it.
    pub command: String,
    /// Change of the intersection cost: "−23.1 % ± 0.8 %".
    pub cost: String,
    /// Change of the time. May be empty.
    pub time: String,
    /// Change of the picture. May be empty.
    pub picture: String,
}

/// A command that tries a change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CardTry {
    /// The command line.
    pub command: String,
    /// What was measured: saving and change of the picture. Empty when nobody has tried.
    pub measured: String,
}

/// A region that costs more than its share.
#[derive(Clone, Debug)]
pub struct HotspotCard {
    /// 1 for the costliest.
    pub rank: u32,
    /// The object: "Wardrobe".
    pub name: String,
    /// Its box in pixels.
    pub bbox: Rect,
    /// Share of the picture's pixels, 0..=1.
    pub pixel_share: f64,
    /// Share of the picture's cost, 0..=1.
    pub cost_share: f64,
    /// Why, in words.
    pub cause: String,
    /// What to try, in words. May be empty.
    pub fix: String,
    /// Commands that try it, and what they found.
    pub tries: Vec<CardTry>,
    /// Factors against the frame's median: "Rays per path" "2.1×".
    pub factors: Vec<Fact>,
}

/// A row of a ledger: something named, and its share of the frame's cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LedgerRow {
    /// The object or material; "camera", "scene".
    pub name: String,
    /// Index into the names of the table's layer, so that its pixels can be shown; `None` for what has none.
    pub id: Option<u32>,
    /// Share of the frame's cost, 0..=1.
    pub share: f64,
    /// What else is known: "41 % shadow rays". May be empty.
    pub detail: String,
}

/// A ledger: shares that add up to the frame's cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LedgerTable {
    /// "Who sent the rays".
    pub title: String,
    /// What the shares are shares of, and what they do not say.
    pub note: String,
    /// Whether ids are those of materials (else of objects).
    pub materials: bool,
    /// Largest share first.
    pub rows: Vec<LedgerRow>,
}

/// A row of the table of totals.
#[derive(Clone, Debug)]
pub struct TotalRow {
    /// Name for people, with its unit.
    pub label: String,
    /// Mean per path.
    pub mean: f64,
    /// 95 % interval of the mean.
    pub ci95: Option<[f64; 2]>,
    /// What the interval is made from: "independent halves", "upper bound". May be empty.
    pub ci_kind: String,
    /// Exact sum over the frame, in digits. May be empty.
    pub sum: String,
}

/// Everything on the page of one render.
#[derive(Clone, Debug)]
pub struct ReportInput<'a> {
    /// Name of the scene.
    pub title: String,
    /// The one sentence that matters: "41 % of the cost lies in 9 % of the pixels: mirror “Wardrobe”".
    pub verdict: String,
    /// The tone-mapped picture; its size is the size of every layer.
    pub beauty: &'a RgbImage,
    /// The layers; the first is shown at the start, the first three are embedded most finely.
    pub maps: Vec<MapLayer<'a>>,
    /// Objects for the read-out.
    pub objects: Option<ObjectLayer<'a>>,
    /// Materials for the read-out, in the same way.
    pub materials: Option<ObjectLayer<'a>>,
    /// Per pixel the rank of the hotspot that it belongs to, 0 for none; empty when unknown.
    pub hotspot_pixels: &'a [u16],
    /// Hotspots, costliest first.
    pub hotspots: Vec<HotspotCard>,
    /// Cost by what sent the rays and by what they met.
    pub ledgers: Vec<LedgerTable>,
    /// Settings and timings, most important first: the first six stand at the top.
    pub facts: Vec<Fact>,
    /// Totals per metric.
    pub totals: Vec<TotalRow>,
    /// What the scene uses and the renderer does not model.
    pub unmodelled: Vec<String>,
    /// What was repaired on loading.
    pub repairs: Vec<String>,
    /// The JSON file's text, folded. May be empty.
    pub raw_json: String,
}

/// One of two renders under comparison.
#[derive(Clone, Debug)]
pub struct Side<'a> {
    /// Its name: "wide gap".
    pub name: String,
    /// The tone-mapped picture; both at one exposure.
    pub beauty: &'a RgbImage,
}

/// A layer of both renders.
#[derive(Clone, Debug)]
pub struct CompareLayer<'a> {
    /// Name in files.
    pub metric: String,
    /// Name for people.
    pub label: String,
    /// Unit per path.
    pub unit: String,
    /// How values are read.
    pub kind: ValueKind,
    /// Row-major values of A.
    pub a: &'a [f32],
    /// Row-major values of B.
    pub b: &'a [f32],
    /// One scale for both maps; `Auto` takes it from both together.
    pub scale: Scale,
    /// Colours of both maps.
    pub map: ColorMap,
    /// Scale of the difference B − A.
    pub difference: Scale,
    /// Despike the pictures (never the read-out).
    pub despike: bool,
    /// Row-major: false where the difference is noise and is greyed out.
    pub significant: Option<&'a [bool]>,
}

/// A row of the table of changes.
#[derive(Clone, Debug)]
pub struct ChangeRow {
    /// Name for people, with its unit.
    pub label: String,
    /// Mean per path in A.
    pub a: f64,
    /// Mean per path in B.
    pub b: f64,
    /// (b − a) / a.
    pub relative: f64,
    /// 95 % interval of `relative`.
    pub ci95: Option<[f64; 2]>,
    /// Whether the change is more than noise; `None` when that cannot be told.
    pub significant: Option<bool>,
}

/// A setting of both renders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PairFact {
    /// "Seconds".
    pub label: String,
    /// In A.
    pub a: String,
    /// In B.
    pub b: String,
}

/// Everything on the page of a comparison.
#[derive(Clone, Debug)]
pub struct CompareInput<'a> {
    /// "A against B".
    pub title: String,
    /// The one sentence that matters.
    pub verdict: String,
    /// The first render.
    pub a: Side<'a>,
    /// The second; red marks where it is costlier.
    pub b: Side<'a>,
    /// The layers; the first is shown at the start.
    pub maps: Vec<CompareLayer<'a>>,
    /// Objects for the read-out.
    pub objects: Option<ObjectLayer<'a>>,
    /// Materials for the read-out.
    pub materials: Option<ObjectLayer<'a>>,
    /// Changes of the totals.
    pub totals: Vec<ChangeRow>,
    /// Changes that were tried by themselves, the best first; empty where none were.
    pub suggestions: Vec<SuggestionRow>,
    /// Settings of both.
    pub facts: Vec<PairFact>,
    /// What the reader must know: intervals missing, settings that differ.
    pub notes: Vec<String>,
    /// The JSON file's text, folded. May be empty.
    pub raw_json: String,
}
