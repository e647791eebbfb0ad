//! The surface of the emitters cut into patches, so that two numbers that are stratified in the plane stay so on it.
//!
//! Choosing a triangle with one number and a point of it with the rest and the other number keeps little of the plane: a
//! square lamp is torn along its diagonal, and of a sphere of a thousand triangles the second number only moves points within
//! one of them. Hence two steps:
//!
//! **Patches.** Two triangles of one part that share an edge and have the same area are one patch: the unit square, cut along
//! the diagonal, is laid upon them, continuously and with the same density everywhere. All other triangles are patches
//! by themselves, with the square folded onto them ([`square_to_triangle`]).
//!
//! **Strips.** The patches of a part are cut into strips, across its longest axis, about as wide as a patch is long. The first number
//! chooses the strip (of all parts'), the second one the patch within it, where patches lie in order: along the second axis
//! or, on closed surfaces, around the first. What the choices leave of both numbers makes the point. A sphere's strips are
//! the slabs between parallels, and places in them longitudes: Archimedes' map of equal areas.
//!
//! All choices invert cumulative distributions. The density is that of the triangles' probabilities: patches and
//! strips only add them up.

use super::triangles::{LightTriangle, area};
use crate::geometry::Geometry;
use crate::math::square_to_triangle;
use core::hint::select_unpredictable;
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// Areas that differ by no more than this are the same: what rounding of corners makes of the same shape. The density is off
/// by half of it at most.
const SAME_AREA: f64 = 1e-5;
/// A part with fewer patches has each of them for a strip.
const LEAST_PATCHES: usize = 8;
/// Vector area over area from which on a surface is taken for open.
const OPEN: f64 = 0.5;

/// Patches whose choice the first number makes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strip {
    /// Probability of all lights before it, given that no environment is chosen.
    cumulative: f32,
    /// Its own, given the same.
    probability: f32,
    first: u32,
    count: u32,
}

/// One triangle, or two.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// Given its strip: that of all patches before it in the strip, and its own.
    cumulative: f32,
    probability: f32,
    halves: [Half; 2],
    pair: bool,
}

/// A triangle of a patch.
#[derive(Clone, Copy, Debug)]
struct Half {
    /// Index into the lights' triangles.
    triangle: u32,
    /// Of the weights of the corner off the diagonal, and of the diagonal's two ends: which belongs to the triangle's second
    /// and third corner.
    weights: [u8; 2],
}

/// A patch, as [`Patch`] and [`Half`] have it; where it is a strip by itself, with the strip's probabilities.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) cumulative: f32,
    pub(super) probability: f32,
    pub(super) pair: bool,
    pub(super) triangles: [u32; 2],
    pub(super) weights: [[u8; 2]; 2],
}

/// A place on the lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Index into the lights' triangles.
    pub(super) triangle: u32,
    /// Barycentric weights of its second and third corner.
    pub(super) weights: (f32, f32),
}

/// Strips and patches of all emissive triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct Patches {
    strips: Vec<Strip>,
    patches: Vec<Patch>,
    /// For each of as many equal intervals of [0, 1) as a strip has patches, beside these: its last patch that begins before.
    guide: Vec<u32>,
}

impl Patches {
    /// `lights`: the triangles of each part side by side.
    pub(super) fn new(lights: &[LightTriangle], geometry: &Geometry) -> Self {
        let part = |light: &LightTriangle| geometry.part_of[light.primitive as usize];
        let mut this = Self::default();
        let mut first = 0;
        for group in lights.chunk_by(|a, b| part(a) == part(b)) {
            this.add(lights, geometry, first as u32..(first + group.len()) as u32);
            first += group.len();
        }
        let mut before = 0.0;
        for strip in &mut this.strips {
            let patches = &mut this.patches[strip.first as usize..][..strip.count as usize];
            let total: f64 = patches.iter().map(|patch| patch.power(lights)).sum();
            let mut within = 0.0;
            for patch in patches.iter_mut() {
                let probability = patch.power(lights) / total;
                (patch.cumulative, patch.probability) = (within as f32, probability as f32);
                within += probability;
            }
            let mut last = 0;
            for interval in 0..patches.len() {
                // The number may round up into the interval.
                let begin = interval as f32 / patches.len() as f32 * (1.0 - 4.0 * f32::EPSILON);
                while last + 1 < patches.len() && patches[last + 1].cumulative <= begin {
                    last += 1;
                }
                this.guide.push(last as u32);
            }
            (strip.cumulative, strip.probability) = (before as f32, total as f32);
            before += total;
        }
        this
    }

    /// Of each strip: the probability of all lights before it, given that no environment is chosen.
    pub(super) fn cumulative(&self) -> impl Iterator<Item = f32> + '_ {
        self.strips.iter().map(|strip| strip.cumulative)
    }

    /// All patches, those of a part side by side.
    pub(super) fn all(&self) -> &[Patch] {
        &self.patches
    }

    pub(super) fn strips(&self) -> usize {
        self.strips.len()
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.patches.len()
    }

    pub(super) fn memory(&self) -> u64 {
        (size_of_val(&self.strips[..]) + size_of_val(&self.patches[..]) + size_of_val(&self.guide[..])) as u64
    }

    /// A place of strip `index`, which `select` chose; `v`: the second number.
    #[inline(always)]
    pub(super) fn sample(&self, index: usize, select: f32, v: f32) -> Place {
        const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;
        let strip = &self.strips[index];
        let x = ((select - strip.cumulative) / strip.probability).clamp(0.0, BELOW_ONE);
        let (first, count) = (strip.first as usize, strip.count as usize);
        if count == 1 {
            return self.patches[first].place(x, v);
        }
        let patches = &self.patches[first..][..count];
        let mut chosen = self.guide[first..][..count][((v * count as f32) as usize).min(count - 1)] as usize;
        while chosen + 1 < count && patches[chosen + 1].cumulative <= v {
            chosen += 1;
        }
        let patch = &patches[chosen];
        let y = ((v - patch.cumulative) / patch.probability).clamp(0.0, BELOW_ONE);
        patch.place(x, y)
    }

    /// The patch of each strip, with the probabilities that choose it, where no strip has several.
    pub(super) fn rows_if_alone(&self) -> Option<Vec<Row>> {
        let alone = self.strips.iter().all(|strip| strip.count == 1);
        let row = |strip: &Strip| {
            let patch = self.patches[strip.first as usize];
            Row { cumulative: strip.cumulative, probability: strip.probability, ..patch.row() }
        };
        alone.then(|| self.strips.iter().map(row).collect())
    }

    /// Of all strips: cumulative and probability by their bits, the first patch and how many; and all patches.
    pub(super) fn rows(&self) -> (Vec<[u32; 4]>, Vec<Row>) {
        let strip = |s: &Strip| [s.cumulative.to_bits(), s.probability.to_bits(), s.first, s.count];
        (self.strips.iter().map(strip).collect(), self.patches.iter().map(Patch::row).collect())
    }

    /// Of each patch's interval the patch of the strip to begin with, as [`Patches::sample`] does.
    pub(super) fn guide(&self) -> &[u32] {
        &self.guide
    }

    /// Adds a part's patches and strips, without probabilities.
    fn add(&mut self, lights: &[LightTriangle], geometry: &Geometry, range: core::ops::Range<u32>) {
        let mut patches = pairs(lights, geometry, range.clone());
        let first = self.patches.len() as u32;
        if patches.len() < LEAST_PATCHES {
            let strip = |i| Strip { cumulative: 0.0, probability: 0.0, first: first + i, count: 1 };
            self.strips.extend((0..patches.len() as u32).map(strip));
            self.patches.append(&mut patches);
            return;
        }
        let layout = Layout::new(lights, geometry, range);
        let middle = |patch: &Patch| {
            let of = |half: &Half| corners(lights, geometry, half.triangle).iter().sum::<DVec3>() / 3.0;
            0.5 * (of(&patch.halves[0]) + of(&patch.halves[1]))
        };
        patches.sort_by(|a, b| layout.along(middle(a)).total_cmp(&layout.along(middle(b))));
        // Strips of the same power each, as nearly as patches allow.
        let strips = layout.strips(patches.len());
        let total: f64 = patches.iter().map(|patch| patch.power(lights)).sum();
        let mut before = 0.0;
        let mut strip_of = Vec::with_capacity(patches.len());
        for patch in &patches {
            let power = patch.power(lights);
            strip_of.push((((before + 0.5 * power) / total * strips) as u32).min(strips as u32 - 1));
            before += power;
        }
        let mut start = 0;
        for strip in strip_of.chunk_by(|a, b| a == b) {
            patches[start..start + strip.len()]
                .sort_by(|a, b| layout.across(middle(a)).total_cmp(&layout.across(middle(b))));
            self.strips.push(Strip {
                cumulative: 0.0,
                probability: 0.0,
                first: first + start as u32,
                count: strip.len() as u32,
            });
            start += strip.len();
        }
        self.patches.append(&mut patches);
    }
}

impl Patch {
    pub(super) fn row(&self) -> Row {
        Row {
            cumulative: self.cumulative,
            probability: self.probability,
            pair: self.pair,
            triangles: self.halves.map(|half| half.triangle),
            weights: self.halves.map(|half| half.weights),
        }
    }

    /// Indices of its triangles.
    pub(super) fn triangles(&self) -> impl Iterator<Item = u32> + Clone + '_ {
        self.halves[..if self.pair { 2 } else { 1 }].iter().map(|half| half.triangle)
    }

    /// The share of each of its triangles in it.
    #[inline(always)]
    pub(super) fn share(&self) -> f32 {
        if self.pair { 0.5 } else { 1.0 }
    }

    /// Probability of taking one of its triangles, given that no environment is chosen.
    pub(super) fn power(&self, lights: &[LightTriangle]) -> f64 {
        self.triangles().map(|triangle| lights[triangle as usize].probability).sum()
    }

    /// A place of it, by a point of the unit square.
    #[inline(always)]
    pub(super) fn place(&self, x: f32, y: f32) -> Place {
        if !self.pair {
            return Place {
                triangle: self.halves[0].triangle,
                weights: square_to_triangle(glam::Vec2::new(x, y)),
            };
        }
        // Weights of the corner off the diagonal, and of its ends at (1, 0) and (0, 1).
        let first = x + y < 1.0;
        // Without a branch: which of the two it is, no predictor knows.
        let weights = [
            select_unpredictable(first, 1.0 - x - y, (x - (1.0 - y)).max(0.0)),
            select_unpredictable(first, x, 1.0 - y),
            select_unpredictable(first, y, 1.0 - x),
            0.0,
        ];
        let half = &self.halves[usize::from(!first)];
        let [b, c] = half.weights.map(|i| weights[usize::from(i & 3)]);
        Place { triangle: half.triangle, weights: (b, c) }
    }
}

fn corners(lights: &[LightTriangle], geometry: &Geometry, triangle: u32) -> [DVec3; 3] {
    let primitive = lights[triangle as usize].primitive;
    geometry.triangles[primitive as usize].map(|p| Vec3::from_array(p).as_dvec3())
}

/// Pairs triangles of the same area across their longest edges, greedily, longest first; what is left stays alone. In the order
/// of their first triangles.
fn pairs(lights: &[LightTriangle], geometry: &Geometry, range: core::ops::Range<u32>) -> Vec<Patch> {
    // A zero has one sign.
    let bits = |p: [f32; 3]| p.map(|x| (x + 0.0).to_bits());
    let triangle = |i: u32| &geometry.triangles[lights[i as usize].primitive as usize];
    // By edge: triangles that have it, and which of their corners lies across it.
    let mut edges: BTreeMap<[[u32; 3]; 2], Vec<(u32, u8)>> = BTreeMap::new();
    for i in range.clone() {
        let corners = triangle(i).map(bits);
        for across in 0..3u8 {
            let [a, b] = [1, 2].map(|k| corners[(usize::from(across) + k) % 3]);
            edges.entry(if a < b { [a, b] } else { [b, a] }).or_default().push((i, across));
        }
    }
    let mut candidates: Vec<(f32, [(u32, u8); 2])> = Vec::new();
    for (edge, sharers) in &edges {
        let [a, b] = edge.map(|p| Vec3::from_array(p.map(f32::from_bits)));
        for pair in sharers.windows(2) {
            let [first, second] = [pair[0], pair[1]].map(|(i, _)| area(triangle(i)));
            if pair[0].0 != pair[1].0 && (first - second).abs() <= SAME_AREA * (first + second) {
                candidates.push((a.distance_squared(b), [pair[0], pair[1]]));
            }
        }
    }
    candidates.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let start = range.start;
    let mut partner: Vec<Option<[(u32, u8); 2]>> = vec![None; range.len()];
    for (_, pair) in candidates {
        let [a, b] = pair.map(|(i, _)| (i - start) as usize);
        if partner[a].is_none() && partner[b].is_none() {
            (partner[a], partner[b]) = (Some(pair), Some(pair));
        }
    }
    range
        .filter_map(|i| match partner[(i - start) as usize] {
            Some([(first, _), _]) if first != i => None,
            Some([first, second]) => Some(Patch::of_two(triangle, first, second)),
            None => {
                let half = Half { triangle: i, weights: [1, 2] };
                Some(Patch { cumulative: 0.0, probability: 0.0, halves: [half; 2], pair: false })
            }
        })
        .collect()
}

impl Patch {
    /// Two triangles with the number of the corner that is off their common edge.
    fn of_two<'a>(triangle: impl Fn(u32) -> &'a [[f32; 3]; 3], first: (u32, u8), second: (u32, u8)) -> Self {
        // The ends of the diagonal, in the first triangle's order.
        let ends = [1, 2].map(|k| triangle(first.0)[(usize::from(first.1) + k) % 3]);
        let half = |(i, across): (u32, u8)| {
            let weight = |corner: usize| {
                if corner == usize::from(across) {
                    0
                } else if triangle(i)[corner] == ends[0] {
                    1
                } else {
                    2
                }
            };
            Half { triangle: i, weights: [weight(1), weight(2)] }
        };
        Self { cumulative: 0.0, probability: 0.0, halves: [half(first), half(second)], pair: true }
    }
}

/// The axes along which a part is cut.
struct Layout {
    centre: DVec3,
    extent: DVec3,
    /// Of the longest, the middle and the shortest side of its box.
    axes: [usize; 3],
    /// Whether places lie around the first axis, rather than along the second.
    closed: bool,
}

impl Layout {
    fn new(lights: &[LightTriangle], geometry: &Geometry, range: core::ops::Range<u32>) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut vector, mut scalar) = (DVec3::ZERO, 0.0);
        for i in range {
            let [a, b, c] = corners(lights, geometry, i);
            for p in [a, b, c] {
                (min, max) = (min.min(p), max.max(p));
            }
            let normal = (b - a).cross(c - a);
            vector += normal;
            scalar += normal.length();
        }
        let extent = max - min;
        let mut axes = [0, 1, 2];
        axes.sort_by(|a, b| extent[*b].total_cmp(&extent[*a]));
        Self { centre: 0.5 * (min + max), extent, axes, closed: vector.length() < OPEN * scalar }
    }

    /// How many strips `count` patches make, so that patches are about as long as they are wide.
    fn strips(&self, count: usize) -> f64 {
        let [first, second, third] = self.axes.map(|axis| self.extent[axis]);
        let across = if self.closed { core::f64::consts::FRAC_PI_2 * (second + third) } else { second };
        (count as f64 * (first / across)).sqrt().round().clamp(1.0, count as f64)
    }

    fn along(&self, p: DVec3) -> f64 {
        p[self.axes[0]]
    }

    fn across(&self, p: DVec3) -> f64 {
        let d = p - self.centre;
        let [_, second, third] = self.axes;
        if self.closed { d[third].atan2(d[second]) } else { d[second] }
    }
}
