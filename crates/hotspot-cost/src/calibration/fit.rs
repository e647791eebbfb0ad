//! Fits of time to counts, judged on tiles that they have not seen.

use super::nnls::Gram;
use super::tiles::{Term, Tile, Tiles};
use crate::metric::CostModel;
use crate::student::quantile95;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which terms a fit has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// The paper's equation 1: nodes and shapes.
    Two,
    /// The same and a constant per path.
    TwoConstant,
    /// All of [`Term::ALL`].
    Full,
}

impl Form {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Two, Self::TwoConstant, Self::Full];

    /// Its terms.
    pub const fn terms(self) -> &'static [Term] {
        match self {
            Self::Two => &[Term::Nodes, Term::Shapes],
            Self::TwoConstant => &[Term::Path, Term::Nodes, Term::Shapes],
            Self::Full => &Term::ALL,
        }
    }

    /// Coefficients for all terms (0 for those that it lacks).
    fn solve(self, gram: &Gram) -> Coefficients {
        let columns: Vec<usize> = self.terms().iter().map(|term| *term as usize).collect();
        let mut all = [0.0; Term::COUNT];
        for (column, value) in columns.iter().zip(gram.select(&columns).solve()) {
            all[*column] = value;
        }
        all
    }
}

/// Nanoseconds for each of [`Term::ALL`].
type Coefficients = [f64; Term::COUNT];

/// A coefficient with its 95 % interval, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    /// Nanoseconds of one thread per event; not negative.
    pub ns: f64,
    /// 95 % interval by resampling blocks of tiles. It holds what tiles differ in and the noise of their times, not what
    /// another machine, day or scene would do.
    pub ci95: [f64; 2],
}

/// How well a fit does on tiles that it has not seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Share of the tiles' variance that is explained: 1 − Σ(t − p)²/Σ(t − t̄)². `None` where all tiles take the same.
    pub r2: Option<f64>,
    /// `r2` over what the noise of the timed runs lets a perfect model reach ([`repeat_r2`]): 1 says that nothing else is left.
    pub r2_of_repeat: Option<f64>,
    /// Root of the mean squared error over the mean time.
    pub nrmse: f64,
}

/// A fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// By term, those that the form has.
    pub coefficients: BTreeMap<Term, Coefficient>,
    /// On held-out tiles. `None` for fits over several scenes, which are judged scene by scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<Score>,
}

impl Fit {
    /// Nanoseconds of one thread for counts in the order of [`Term::ALL`].
    pub fn predict(&self, terms: &[f64; Term::COUNT]) -> f64 {
        self.coefficients.iter().map(|(term, c)| c.ns * terms[*term as usize]).sum()
    }
}

/// c0 and c1 of equation 1 in nanoseconds: see [`traversal`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Traversal {
    /// Of a node visited.
    pub c0: Coefficient,
    /// Of a triangle tested.
    pub c1: Coefficient,
    /// Share of the variance between tiles of the full fit's traversal time that c0·nodes + c1·shapes holds, without a
    /// constant; 1 where there is none.
    pub r2: f64,
}

impl Traversal {
    /// As constants of equation 1.
    pub const fn model(&self) -> CostModel {
        CostModel { c0: self.c0.ns, c1: self.c1.ns }
    }
}

/// Resamplings behind each interval.
const RESAMPLES: usize = 400;

/// A block is at most this many tiles on edge: neighbours share objects and what the model lacks about them.
const BLOCK: u32 = 4;

/// A scene has at least this many blocks, as far as it has tiles.
const BLOCKS: usize = 24;

/// The sums of a scene's tiles, weighted so that scenes count alike: errors relative to the scene's mean time, over the
/// number of tiles. Within a scene all tiles count alike, since R² does so too.
fn add_tile(gram: &mut Gram, scene: &Tiles, tile: &Tile) {
    let mean = scene.mean_ns();
    if mean > 0.0 {
        gram.add(&tile.terms, tile.ns, 1.0 / (mean * mean * scene.tiles.len() as f64));
    }
}

fn gram_of(scenes: &[&Tiles], keep: impl Fn(&Tile) -> bool) -> Gram {
    let mut gram = Gram::new(Term::COUNT);
    for scene in scenes {
        for tile in scene.tiles.iter().filter(|tile| keep(tile)) {
            add_tile(&mut gram, scene, tile);
        }
    }
    gram
}

/// Fits one form to one or more scenes; a single scene's fit is also judged ([`held_out`]).
pub fn fit(scenes: &[&Tiles], form: Form) -> Fit {
    let whole = gram_of(scenes, |_| true);
    let statistic = |gram: &Gram| form.solve(gram).to_vec();
    let found = with_intervals(scenes, &whole, &statistic);
    Fit {
        coefficients: form.terms().iter().map(|term| (*term, found[*term as usize])).collect(),
        held_out: match scenes {
            [scene] => held_out(scenes, form).first().map(|predicted| score(scene, predicted)),
            _ => None,
        },
    }
}

/// What the full fit says that nodes, boxes, leaves and shapes cost, expressed by nodes and shapes alone: the least-squares
/// projection of that part of the fitted time. Where counts are collinear it does not matter which of them the full fit
/// charged. Rays' own cost, shading and textures are not in it.
pub fn traversal(scenes: &[&Tiles]) -> Traversal {
    const PART: [Term; 4] = [Term::Nodes, Term::Boxes, Term::Leaves, Term::Shapes];
    let part = |full: &Coefficients| -> Coefficients {
        core::array::from_fn(|i| if PART.iter().any(|term| *term as usize == i) { full[i] } else { 0.0 })
    };
    let project = |gram: &Gram| {
        let target = gram.with_target(&part(&Form::Full.solve(gram)));
        let c = Form::Two.solve(&target);
        vec![c[Term::Nodes as usize], c[Term::Shapes as usize]]
    };
    let whole = gram_of(scenes, |_| true);
    let found = with_intervals(scenes, &whole, &project);
    let full = part(&Form::Full.solve(&whole));
    let (mut error, mut spread) = (0.0, 0.0);
    for scene in scenes {
        let time = |tile: &Tile| -> f64 { tile.terms.iter().zip(full).map(|(x, b)| x * b).sum() };
        let mean = scene.tiles.iter().map(time).sum::<f64>() / scene.tiles.len().max(1) as f64;
        let weight = 1.0 / (scene.mean_ns().powi(2) * scene.tiles.len() as f64);
        for tile in &scene.tiles {
            let two = found[0].ns * tile.terms[Term::Nodes as usize]
                + found[1].ns * tile.terms[Term::Shapes as usize];
            error += weight * (time(tile) - two).powi(2);
            spread += weight * (time(tile) - mean).powi(2);
        }
    }
    Traversal { c0: found[0], c1: found[1], r2: if spread > 0.0 { 1.0 - error / spread } else { 1.0 } }
}

/// The estimates with their intervals: percentiles over resampled blocks of tiles, drawn with replacement within each scene,
/// widened by t(m − 1)/z·√(m/(m − 1)) for m blocks, without which such intervals are too narrow (Hesterberg, *What teachers
/// should know about the bootstrap*, The American Statistician 69, 2015, section 4.3), and cut at 0. Blocks, since neighbouring
/// tiles err alike; resampling rows rather than residuals, since the scatter grows with time. Where a coefficient is bound at
/// 0 its interval is rough. The same on every run.
fn with_intervals(
    scenes: &[&Tiles],
    whole: &Gram,
    statistic: &dyn Fn(&Gram) -> Vec<f64>,
) -> Vec<Coefficient> {
    let estimate = statistic(whole);
    let blocks: Vec<Vec<Gram>> = scenes.iter().map(|scene| blocks(scene)).collect();
    let count: usize = blocks.iter().map(Vec::len).sum();
    let mut drawn: Vec<Vec<f64>> = vec![Vec::with_capacity(RESAMPLES); estimate.len()];
    let mut state = 0x5eed_u64;
    for _ in 0..RESAMPLES {
        let mut gram = Gram::new(Term::COUNT);
        for scene in &blocks {
            for _ in 0..scene.len() {
                gram.merge(&scene[(next(&mut state) % scene.len() as u64) as usize]);
            }
        }
        for (values, value) in drawn.iter_mut().zip(statistic(&gram)) {
            values.push(value);
        }
    }
    let m = count as f64;
    let widen = if count > 1 { quantile95(m - 1.0) / 1.959_964 * (m / (m - 1.0)).sqrt() } else { 1.0 };
    estimate
        .iter()
        .zip(&mut drawn)
        .map(|(estimate, values)| {
            values.sort_unstable_by(f64::total_cmp);
            let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
            let (low, high) = (at(0.025).min(*estimate), at(0.975).max(*estimate));
            Coefficient {
                ns: *estimate,
                ci95: [(estimate - widen * (estimate - low)).max(0.0), estimate + widen * (high - estimate)],
            }
        })
        .collect()
}

/// The sums of a scene's blocks.
fn blocks(scene: &Tiles) -> Vec<Gram> {
    let count = |edge: u32| (scene.columns.div_ceil(edge) * scene.rows.div_ceil(edge)) as usize;
    let edge = (1..=BLOCK).rev().find(|edge| count(*edge) >= BLOCKS).unwrap_or(1);
    let mut grams = vec![Gram::new(Term::COUNT); count(edge)];
    for tile in &scene.tiles {
        let index = tile.row / edge * scene.columns.div_ceil(edge) + tile.column / edge;
        add_tile(&mut grams[index as usize], scene, tile);
    }
    grams
}

/// SplitMix64.
const fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The time of each scene's tiles as a fit predicts it that has not seen them: tiles are coloured like a chessboard, and those
/// of one colour are predicted by the fit to the other colour of all scenes.
pub fn held_out(scenes: &[&Tiles], form: Form) -> Vec<Vec<f64>> {
    let colour = |tile: &Tile| (tile.row + tile.column) % 2;
    let fits = [0, 1].map(|of| form.solve(&gram_of(scenes, |tile| colour(tile) != of)));
    scenes
        .iter()
        .map(|scene| scene.tiles.iter().map(|tile| apply(&fits[colour(tile) as usize], tile)).collect())
        .collect()
}

/// The time of a scene's tiles as predicted by the fit to the other scenes; empty when there are none.
pub fn scene_held_out(scenes: &[&Tiles], index: usize, form: Form) -> Vec<f64> {
    let others: Vec<&Tiles> =
        scenes.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, scene)| *scene).collect();
    if others.is_empty() || index >= scenes.len() {
        return Vec::new();
    }
    let found = form.solve(&gram_of(&others, |_| true));
    scenes[index].tiles.iter().map(|tile| apply(&found, tile)).collect()
}

fn apply(coefficients: &Coefficients, tile: &Tile) -> f64 {
    tile.terms.iter().zip(coefficients).map(|(x, b)| x * b).sum()
}

/// Judges predictions of a scene's tiles.
pub fn score(scene: &Tiles, predicted: &[f64]) -> Score {
    let mean = scene.mean_ns();
    let (mut error, mut spread) = (0.0, 0.0);
    for (tile, p) in scene.tiles.iter().zip(predicted) {
        error += (tile.ns - p).powi(2);
        spread += (tile.ns - mean).powi(2);
    }
    let r2 = (spread > 0.0).then(|| 1.0 - error / spread);
    let ceiling = repeat_r2(scene).filter(|ceiling| *ceiling > 0.0);
    Score {
        r2,
        r2_of_repeat: r2.zip(ceiling).map(|(r2, ceiling)| r2 / ceiling),
        nrmse: if mean > 0.0 { (error / scene.tiles.len() as f64).sqrt() / mean } else { 0.0 },
    }
}

/// R² that a perfect model of the tiles' times would reach, since the times have noise that no model explains: 1 − Σ
/// [`Tile::noise`]/Σ(t − t̄)². `None` where all tiles take the same.
pub fn repeat_r2(scene: &Tiles) -> Option<f64> {
    let mean = scene.mean_ns();
    let noise: f64 = scene.tiles.iter().map(|tile| tile.noise).sum();
    let spread: f64 = scene.tiles.iter().map(|tile| (tile.ns - mean).powi(2)).sum();
    (spread > 0.0).then(|| 1.0 - noise / spread)
}
