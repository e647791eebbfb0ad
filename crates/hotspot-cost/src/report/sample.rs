//! A made-up render for the tests: a room with a mirror, a ball and a lamp, and plausible noisy costs.

use super::input::*;
use crate::Rect;
use crate::maps::{ColorMap, Exposure, Scale, beauty};
use image::RgbImage;

/// Names of the layers, their labels, units, and how dear each surface is in them.
const LAYERS: [(&str, &str, &str); 23] = [
    ("rays", "Rays", "rays"),
    ("intersection", "Intersection cost", "nodes + triangles"),
    ("time_us", "Time", "µs"),
    ("rays_shadow", "Shadow rays", "rays"),
    ("nodes", "Nodes", "nodes"),
    ("nodes_shadow", "Nodes, shadow", "nodes"),
    ("shapes", "Triangles", "triangles"),
    ("shapes_shadow", "Triangles, shadow", "triangles"),
    ("intersection_shadow", "Intersection, shadow", "nodes + triangles"),
    ("boxes", "Boxes", "boxes"),
    ("leaves", "Leaf blocks", "leaves"),
    ("instances", "Instances", "instances"),
    ("bsdf", "BSDF evaluations", "evaluations"),
    ("texture", "Texture look-ups", "look-ups"),
    ("texture_bytes", "Texture bytes", "bytes"),
    ("alpha_tests", "Alpha tests", "tests"),
    ("waste", "Wasted work", "nodes + triangles"),
    ("cause.throughput", "Throughput at the end", ""),
    ("cause.escaped", "Escaped", ""),
    ("cause.absorbed", "Absorbed", ""),
    ("cause.roulette", "Ended by roulette", ""),
    ("cause.depth_limit", "Reached the depth limit", ""),
    ("extra", "Another layer", "units"),
];

/// Planes of a synthetic render.
pub(super) struct Sample {
    pub(super) beauty: RgbImage,
    pub(super) planes: Vec<Vec<f32>>,
    pub(super) ids: Vec<u32>,
    pub(super) size: (u32, u32),
}

impl Sample {
    /// `change` scales the mirror's cost, `seed` the noise.
    pub(super) fn new(width: u32, height: u32, change: f32, seed: u32) -> Self {
        let mut state = seed.wrapping_mul(2_654_435_761) | 1;
        let mut noise = move || {
            let mut sum = 0.0;
            for _ in 0..4 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                sum += (state >> 8) as f32 / 8_388_608.0 - 1.0;
            }
            sum / 2.0
        };
        let count = width as usize * height as usize;
        let mut rgb = [vec![0.0; count], vec![0.0; count], vec![0.0; count]];
        let mut planes = vec![vec![0.0; count]; LAYERS.len()];
        let mut ids = vec![u32::MAX; count];
        for i in 0..count {
            let x = (i as u32 % width) as f32 / width as f32;
            let y = (i as u32 / width) as f32 / height as f32;
            let aspect = width as f32 / height as f32;
            let ball = ((x - 0.28) * aspect).hypot(y - 0.72) < 0.16;
            let mirror = (0.56..0.84).contains(&x) && (0.2..0.72).contains(&y);
            let rim = mirror && !((0.57..0.83).contains(&x) && (0.22..0.70).contains(&y));
            let lamp = (0.42..0.5).contains(&x) && y < 0.05;
            let sky = x < 0.06 && y < 0.4;
            let light = 0.35 / (0.3 + (x - 0.46).powi(2) * 2.0 + y * y);
            let (id, color, cost) = match (sky, lamp, ball, rim, mirror, y > 0.8) {
                (true, ..) => (u32::MAX, [0.5, 0.7, 1.0], 0.1),
                (_, true, ..) => (4, [14.0, 13.0, 11.0], 0.15),
                (_, _, true, ..) => (1, [0.6 * light, 0.25 * light, 0.1], 2.1),
                (.., true, _, _) => (2, [0.25, 0.2, 0.15], 5.5 * change),
                (.., true, _) => {
                    (2, [0.5 * light + 0.1, 0.5 * light + 0.12, 0.5 * light + 0.15], 2.9 * change)
                }
                (.., true) => (3, [0.4 * light, 0.33 * light, 0.25 * light], 1.2),
                _ => (0, [0.7 * light, 0.68 * light, 0.63 * light], 1.0),
            };
            ids[i] = id;
            for (plane, value) in rgb.iter_mut().zip(color) {
                plane[i] = value * (1.0 + 0.02 * noise());
            }
            for (k, plane) in planes.iter_mut().enumerate() {
                let base = [7.3, 180.0, 3.1][k % 3] * (1.0 + k as f32 * 0.2);
                plane[i] = match k {
                    11 => 0.0,
                    16..21 => (0.3 * cost * (1.0 + 0.3 * noise())).clamp(0.0, 1.0),
                    _ => base * cost * (1.0 + 0.12 * noise()).max(0.05),
                };
            }
            if i % 4801 == 17 {
                planes[2][i] *= 60.0;
            }
        }
        let beauty = beauty(width, height, [&rgb[0], &rgb[1], &rgb[2]], Exposure::Auto).image;
        Self { beauty, planes, ids, size: (width, height) }
    }

    /// A page's input over it.
    pub(super) fn report(&self) -> ReportInput<'_> {
        let (w, h) = self.size;
        let part = |a: f32, of: u32| (a * of as f32) as u32;
        let spot =
            |rank, name: &str, at: [f32; 4], pixel_share, cost_share, cause: &str, fix: &str| HotspotCard {
                rank,
                name: name.into(),
                bbox: Rect {
                    x: part(at[0], w),
                    y: part(at[1], h),
                    width: part(at[2], w),
                    height: part(at[3], h),
                },
                pixel_share,
                cost_share,
                cause: cause.into(),
                fix: fix.into(),
                tries: vec![CardTry {
                    command: "hotspot-render whatif SCENE --matte Mirror".into(),
                    measured: "intersection cost −23 % ± 1 %, FLIP 0.080".into(),
                }],
                factors: vec![
                    Fact::new("vertices per path", "2.4×"),
                    Fact::new("rays per vertex", "1.1×"),
                    Fact::new("nodes per ray", "1.3×"),
                ],
            };
        ReportInput {
            title: "mirror-gap-wide".into(),
            verdict: "41 % of the cost lies in 14 % of the pixels: mirror “Wardrobe”".into(),
            beauty: &self.beauty,
            maps: self.layers(),
            materials: None,
            hotspot_pixels: &[],
            ledgers: vec![LedgerTable {
                title: "Who sent the rays".into(),
                note: "Shares of the intersection cost, by the object that rays leave.".into(),
                materials: false,
                rows: vec![
                    LedgerRow {
                        name: "Wall <b>".into(),
                        id: Some(0),
                        share: 0.6,
                        detail: "40 % shadow rays".into(),
                    },
                    LedgerRow { name: "camera".into(), id: None, share: 0.4, detail: String::new() },
                ],
            }],
            objects: Some(ObjectLayer {
                ids: &self.ids,
                names: ["Walls", "Ball", "Wardrobe mirror", "Floor", "Lamp"].map(String::from).into(),
            }),
            hotspots: vec![
                spot(
                    1,
                    "Wardrobe mirror",
                    [0.56, 0.2, 0.28, 0.52],
                    0.146,
                    0.41,
                    "Paths are trapped between the mirror and the wall behind it: they bounce 2.4× as often as at the median pixel.",
                    "move the mirror closer to the wall, or close its sides.",
                ),
                spot(
                    2,
                    "Ball",
                    [0.19, 0.56, 0.18, 0.32],
                    0.045,
                    0.078,
                    "Dense geometry: each ray visits 2.1× as many nodes as at the median pixel.",
                    "use a coarser mesh for the parts that are seen from afar.",
                ),
                spot(
                    3,
                    "Floor",
                    [0.0, 0.8, 1.0, 0.2],
                    0.17,
                    0.19,
                    "Shadow rays towards the lamp are mostly blocked.",
                    "",
                ),
            ],
            facts: [
                ("Resolution", "640 × 360"),
                ("Samples", "64 per pixel"),
                ("Time", "4.21 s"),
                ("Threads", "2"),
                ("Kernel", "avx2, 8-wide"),
                ("Exposure", "+0.42 EV"),
                ("Maximum depth", "15"),
                ("Seed", "0"),
            ]
            .into_iter()
            .map(|(a, b)| Fact::new(a, b))
            .collect(),
            totals: LAYERS[..8]
                .iter()
                .map(|(_, label, unit)| TotalRow {
                    label: format!("{label} [{unit}]"),
                    mean: 12.345_67,
                    ci95: Some([12.30, 12.39]),
                    ci_kind: "independent halves".into(),
                    sum: "182 044 331".into(),
                })
                .collect(),
            unmodelled: vec!["KHR_materials_clearcoat on material “Lacquer”".into()],
            repairs: vec!["12 degenerate triangles dropped from mesh “Ball”".into()],
            raw_json: "{\n  \"schema\": 1\n}".into(),
        }
    }

    fn layers(&self) -> Vec<MapLayer<'_>> {
        let layer = |((metric, label, unit), values): (&(&str, &str, &str), _)| MapLayer {
            metric: (*metric).into(),
            label: (*label).into(),
            unit: (*unit).into(),
            kind: if metric.starts_with("cause") { ValueKind::Share } else { ValueKind::Amount },
            values,
            scale: Scale::default(),
            map: ColorMap::Inferno,
            despike: *metric == "time_us",
        };
        LAYERS.iter().zip(self.planes.iter().map(Vec::as_slice)).map(layer).collect()
    }
}

/// A comparison of two samples.
pub(super) fn comparison<'a>(a: &'a Sample, b: &'a Sample, significant: &'a [bool]) -> CompareInput<'a> {
    let layer = |k: usize| CompareLayer {
        metric: LAYERS[k].0.into(),
        label: LAYERS[k].1.into(),
        unit: LAYERS[k].2.into(),
        kind: ValueKind::Amount,
        a: &a.planes[k],
        b: &b.planes[k],
        scale: Scale::default(),
        map: ColorMap::Inferno,
        difference: Scale::default(),
        despike: k == 2,
        significant: (k == 0).then_some(significant),
    };
    let row = |label: &str, a: f64, b: f64, ci95, significant| ChangeRow {
        label: label.into(),
        a,
        b,
        relative: (b - a) / a,
        ci95,
        significant,
    };
    CompareInput {
        title: "mirror-gap-wide → mirror-gap-narrow".into(),
        verdict: "The narrow gap costs 8.9 % less (± 0.4 %): intersection cost, significant".into(),
        a: Side { name: "mirror-gap-wide".into(), beauty: &a.beauty },
        b: Side { name: "mirror-gap-narrow".into(), beauty: &b.beauty },
        maps: (0..10).map(layer).collect(),
        objects: None,
        materials: None,
        totals: vec![
            row("Rays", 9.3, 8.8, Some([-0.06, -0.048]), Some(true)),
            row("Intersection cost [nodes + triangles]", 241.0, 219.5, Some([-0.093, -0.085]), Some(true)),
            row("Time [µs]", 3.1, 3.12, Some([-0.02, 0.03]), Some(false)),
            row("Texture look-ups", 0.0, 0.0, None, None),
        ],
        suggestions: vec![SuggestionRow {
            what: "material \"Mirror\" matte".into(),
            reason: "hotspot 1: paths are trapped".into(),
            command: "hotspot-render whatif SCENE --matte Mirror".into(),
            cost: "−23.1 % ± 0.8 %".into(),
            time: "−21 % ± 3 %".into(),
            picture: "FLIP 0.080".into(),
        }],
        facts: vec![PairFact { label: "Seconds".into(), a: "4.21".into(), b: "3.95".into() }],
        notes: vec!["Rendered without --intervals: the interval of time is missing.".into()],
        raw_json: "{}".into(),
    }
}
