//! Figure 2: a colour changed, geometry the same.

use super::{Claim, Figure, Verdict, panel};
use crate::blocks::correlations;
use crate::stage::{Change, Pair, Scale, Subject};
use hotspot_cost::Metric;
use hotspot_cost::analysis::{TILE, tile_means};
use hotspot_scene::Bsdf;
use std::collections::BTreeMap;

const PICTURE_SPP: u32 = 128;
const METRIC_SPP: u32 = 8;
const DEPTH: u32 = 15;

pub(super) fn figure(red: &Subject, blue: &Subject, scale: Scale) -> Result<Figure, String> {
    let size = scale.size([400, 400]);
    let pictures = [red, blue].map(|s| s.picture(size, PICTURE_SPP, DEPTH).image);
    let pair = Pair::new(red, blue, size, METRIC_SPP, DEPTH)?;
    let [a, b] = pictures;
    let (rays, rays_text) = pair.total(Metric::Rays);
    let (intersection, intersection_text) = pair.total(Metric::Intersection);
    let tiles = |metric| tile_means(size[0], size[1], pair.difference(metric));
    let (of_rays, of_cost) = (tiles(Metric::Rays), tiles(Metric::Intersection));
    let [alike, ..] = correlations(size.map(|edge| edge.div_ceil(TILE)), TILE, &of_rays, &of_rays, &of_cost);
    let where_ = by_object(&pair, red);
    let at_red = where_.first().is_some_and(|row| row.red);
    Ok(Figure {
        title: "Figure 2: a red box made blue",
        scene: format!("{} → {}", red.scene.name, blue.scene.name),
        settings: format!(
            "{} × {}; pictures {PICTURE_SPP} spp, metrics {METRIC_SPP} spp in two halves with shared seeds, depth {DEPTH}; \
             differences clipped at the 99.9th percentile",
            size[0], size[1]
        ),
        panels: vec![
            panel("(a) red", a),
            panel("(b) blue", b),
            panel("(c) path length, blue − red", pair.map(Metric::Rays)),
            panel("(d) intersection cost, blue − red", pair.map(Metric::Intersection)),
        ],
        claims: vec![
            Claim {
                paper: "The blue box lowers the cost, through low throughput and Russian roulette.",
                ours: format!("{rays_text}; {intersection_text}"),
                verdict: Verdict::of(rays < 0.0 && intersection < 0.0),
                why: "",
            },
            Claim {
                paper: "Path length and intersection cost change alike: a colour changes where paths end, not where they go.",
                ours: format!("Correlation of the two difference maps over 8×8 tiles: {}", alike.digits(3)),
                verdict: Verdict::of(alike.ci95[0] > 0.9),
                why: "\"Alike\" is read as a correlation surely above 0.9.",
            },
            Claim {
                paper: "What changes are the paths between the red wall and the box.",
                ours: format!(
                    "Largest mean changes of the intersection cost by what the camera sees: {}",
                    where_
                        .iter()
                        .take(3)
                        .map(|row| {
                            let red = if row.red { " (red)" } else { "" };
                            format!(
                                "{}{red} {} per path ({:.0} % of all)",
                                row.name,
                                row.change,
                                100.0 * row.share
                            )
                        })
                        .collect::<Vec<_>>()
                        .join("; ")
                ),
                verdict: Verdict::of(at_red),
                why: "",
            },
        ],
    })
}

/// What changed in the pixels where the camera sees one object.
struct Row {
    name: String,
    /// It is red: the wall, or the box before it is made blue.
    red: bool,
    change: Change,
    /// Of the change over all pixels.
    share: f64,
}

/// By first-hit object, largest mean decrease first. Objects of less than a thousandth of the picture are left out.
fn by_object(pair: &Pair, subject: &Subject) -> Vec<Row> {
    let objects = &pair.a.objects;
    let difference = pair.difference(Metric::Intersection);
    let total: f64 = difference.iter().map(|d| f64::from(*d)).sum();
    let mut sums: BTreeMap<u32, (f64, usize)> = BTreeMap::new();
    for (object, d) in objects.iter().zip(difference) {
        let entry = sums.entry(*object).or_default();
        *entry = (entry.0 + f64::from(*d), entry.1 + 1);
    }
    let mut rows: Vec<_> = sums
        .into_iter()
        .filter(|(_, (_, count))| count * 1000 >= objects.len())
        .filter_map(|(object, (sum, _))| {
            Some(Row {
                name: subject.prepared.objects().get(object as usize)?.clone(),
                red: is_red(subject, object),
                change: pair.over(Metric::Intersection, |i| objects[i] == object),
                share: if total == 0.0 { 0.0 } else { sum / total },
            })
        })
        .collect();
    rows.sort_by(|a, b| a.change.mean.total_cmp(&b.change.mean));
    rows
}

fn is_red(subject: &Subject, object: u32) -> bool {
    let scene = &subject.scene;
    scene.instances.iter().filter(|instance| instance.object == object).any(|instance| {
        match &scene.materials[instance.material as usize].bsdf {
            Bsdf::Matte { reflectance } => {
                let [r, g, b] = reflectance.factor;
                r > 2.0 * g && r > 2.0 * b
            }
            _ => false,
        }
    })
}
