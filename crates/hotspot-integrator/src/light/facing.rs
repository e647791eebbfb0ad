//! Choosing emissive triangles by where they are seen from.
//!
//! Power alone wastes samples: half of a lamp's mesh faces away, and lamps near by matter more than those far off. Here
//! emissive triangles are grouped by part (an object's surface of one material). A group is chosen by its power, the square of
//! its distance, how much of it faces the point, and whether it is above the point's horizon; a triangle within it by its
//! power times the cosine of its normal with the direction in which the point lies. That direction is rounded to one of a
//! number of bins over the octahedron (Meyer et al., *On Floating-Point Normal Vectors*, 2010), each with a distribution made
//! beforehand, so that a choice takes no longer than by power. Within a group triangles follow a Hilbert curve over the
//! octahedron of their directions from the group's centre: neighbouring numbers choose neighbouring triangles, and stratified
//! numbers stay stratified on the lamp; two equal neighbours are one patch ([`patches`](super::patches)).
//!
//! A share of each choice goes by power alone ([`DEFENSIVE`]): what the rounded direction or the bounds misjudge is still
//! sampled, so the estimate stays unbiased and its weights bounded.

use super::guided::Guided;
use super::patches::{Patch, Place};
use super::triangles::LightTriangle;
use crate::geometry::Geometry;
use glam::{Vec2, Vec3};

/// Share of each choice that goes by power alone.
const DEFENSIVE: f32 = 0.1;
/// With more groups the choice goes by power: asking each would cost more than it brings.
pub(super) const MOST_GROUPS: usize = 16;
/// Most entries of all distributions of a group.
const MOST_ENTRIES: usize = 1 << 21;
/// Bins along an edge of the octahedron's square.
const EDGE: usize = 16;
/// Normals whose product is larger are the same.
const FLAT: f32 = 0.999;
/// Added to the cosine: triangles just behind the horizon of a bin's middle are seen from elsewhere in the bin.
const SLACK: f32 = 0.08;

/// The groups of a scene.
#[derive(Debug)]
pub(super) struct Facing {
    groups: Vec<Group>,
    /// From a triangle's number to group, patch in it, and index into the lights; by number less `first`.
    place_of: Vec<[u32; 3]>,
    first: u32,
}

#[derive(Debug)]
struct Group {
    centre: Vec3,
    radius: f32,
    power: f32,
    /// Share of all groups' power.
    share: f32,
    /// Bins along an edge of the octahedron's square.
    edge: usize,
    /// Of each bin: how much of the power faces it.
    facing: Vec<f32>,
    /// One distribution for each bin.
    guided: Guided,
    /// The patches, in the order of the distributions.
    order: Vec<Patch>,
}

/// A chosen place on the lights.
pub(super) struct Chosen {
    pub(super) place: Place,
    /// With which its triangle is chosen.
    pub(super) probability: f32,
}

impl Facing {
    /// `patches`: of all of the lights. `None` where there are too many groups, or none, or nothing to choose: one lamp that is
    /// flat faces all that it lights with every patch.
    pub(super) fn new(lights: &[LightTriangle], patches: &[Patch], geometry: &Geometry) -> Option<Self> {
        let first = lights.iter().map(|l| l.primitive).min()?;
        let last = lights.iter().map(|l| l.primitive).max()?;
        let part = |patch: &Patch| {
            patch.triangles().next().map(|i| geometry.part_of[lights[i as usize].primitive as usize])
        };
        let members: Vec<&[Patch]> = patches.chunk_by(|a, b| part(a) == part(b)).collect();
        let flat = || lights.iter().all(|light| light.normal.dot(lights[0].normal) > FLAT);
        if members.len() > MOST_GROUPS || (members.len() == 1 && flat()) {
            return None;
        }
        let total: f64 = lights.iter().map(|l| l.probability).sum();
        let mut place_of = vec![[0; 3]; (last - first) as usize + 1];
        let groups: Vec<Group> = members
            .into_iter()
            .enumerate()
            .map(|(g, patches)| {
                let group = Group::new(lights, geometry, patches.to_vec(), total);
                for (place, patch) in group.order.iter().enumerate() {
                    for index in patch.triangles() {
                        let primitive = lights[index as usize].primitive;
                        place_of[(primitive - first) as usize] = [g as u32, place as u32, index];
                    }
                }
                group
            })
            .collect();
        Some(Self { groups, place_of, first })
    }

    /// Weights of the groups as seen from a surface at `p` with normal `n`, and their sum.
    #[inline(always)]
    fn weights(&self, p: Vec3, n: Vec3) -> ([f32; MOST_GROUPS], f32) {
        let mut weights = [0.0; MOST_GROUPS];
        let mut sum = 0.0;
        if self.groups.len() > 1 {
            for (weight, group) in weights.iter_mut().zip(&self.groups) {
                *weight = group.weight(p, n);
                sum += *weight;
            }
        }
        (weights, sum)
    }

    /// Probability of a group, from [`Facing::weights`].
    #[inline(always)]
    fn probability(&self, group: usize, weights: &([f32; MOST_GROUPS], f32)) -> f32 {
        let share = self.groups[group].share;
        if self.groups.len() == 1 {
            1.0
        } else if weights.1 > 0.0 && weights.1.is_finite() {
            DEFENSIVE * share + (1.0 - DEFENSIVE) * (weights.0[group] / weights.1)
        } else {
            share
        }
    }

    /// A place, by two numbers in [0, 1).
    #[inline(always)]
    pub(super) fn choose(&self, p: Vec3, n: Vec3, u: f32, v: f32) -> Chosen {
        let weights = self.weights(p, n);
        let mut rest = u;
        let mut index = 0;
        let mut probability = self.probability(0, &weights);
        while rest >= probability && index + 1 < self.groups.len() {
            rest -= probability;
            index += 1;
            probability = self.probability(index, &weights);
        }
        let rest = (rest / probability).clamp(0.0, 1.0 - f32::EPSILON);
        let group = &self.groups[index];
        let bin = group.bin(p);
        let (index, rest) = group.guided.sample(bin, rest);
        let patch = &group.order[index];
        Chosen {
            place: patch.place(rest, v),
            probability: probability * group.guided.probability(bin, index) * patch.share(),
        }
    }

    /// The light with this primitive, which must be one, and the probability with which [`Facing::choose`] takes it.
    #[inline(always)]
    pub(super) fn probability_of(&self, p: Vec3, n: Vec3, primitive: u32) -> (u32, f32) {
        let [index, place, light] = self.place_of[(primitive - self.first) as usize];
        let group = &self.groups[index as usize];
        let weights = self.weights(p, n);
        let within = group.guided.probability(group.bin(p), place as usize);
        (light, self.probability(index as usize, &weights) * within * group.order[place as usize].share())
    }
}

impl Group {
    fn new(lights: &[LightTriangle], geometry: &Geometry, mut order: Vec<Patch>, total: f64) -> Self {
        let corners =
            |i: u32| geometry.triangles[lights[i as usize].primitive as usize].map(Vec3::from_array);
        let middle = |i: u32| corners(i).iter().sum::<Vec3>() / 3.0;
        let triangles: Vec<u32> = order.iter().flat_map(Patch::triangles).collect();
        let power: f64 = triangles.iter().map(|i| lights[*i as usize].probability).sum();
        let centre = triangles
            .iter()
            .fold(glam::DVec3::ZERO, |sum, i| sum + middle(*i).as_dvec3() * lights[*i as usize].probability);
        let centre = (centre / power.max(f64::MIN_POSITIVE)).as_vec3();
        let radius =
            triangles.iter().flat_map(|i| corners(*i)).map(|v| v.distance(centre)).fold(0.0, f32::max);
        let key = |patch: &Patch| {
            let middle = patch.triangles().map(middle).sum::<Vec3>() * patch.share();
            (hilbert(octahedron((middle - centre).normalize_or(Vec3::Z))), patch.triangles().next())
        };
        order.sort_by_cached_key(key);
        let mut edge = EDGE;
        while edge > 1 && edge * edge * order.len() > MOST_ENTRIES {
            edge /= 2;
        }
        let mut guided = Guided::with_capacity(edge * edge, order.len());
        let mut facing = Vec::with_capacity(edge * edge);
        for bin in 0..edge * edge {
            let at = Vec2::new((bin % edge) as f32 + 0.5, (bin / edge) as f32 + 0.5) / edge as f32;
            let towards = from_octahedron(at);
            let seen_of = |i: u32| {
                let light = &lights[i as usize];
                let cos = light.normal.dot(towards);
                // Both sides of a surface that emits to both.
                let cos = if light.two_sided { cos.abs() } else { cos };
                light.probability * f64::from((cos + SLACK).max(0.0) / (1.0 + SLACK))
            };
            let seen = |patch: &Patch| patch.triangles().map(seen_of).sum::<f64>();
            let sum: f64 = order.iter().map(seen).sum();
            facing.push((sum / power).max(1e-3) as f32);
            let defensive = if sum > 0.0 { f64::from(DEFENSIVE) * sum / power } else { 1.0 };
            guided.push(
                order.iter().map(|patch| {
                    (1.0 - f64::from(DEFENSIVE)) * seen(patch) + defensive * patch.power(lights)
                }),
            );
        }
        Self {
            centre,
            radius,
            power: power as f32,
            share: (power / total) as f32,
            edge,
            facing,
            guided,
            order,
        }
    }

    /// The bin of the direction from the centre to `p`.
    #[inline(always)]
    fn bin(&self, p: Vec3) -> usize {
        let at = octahedron(p - self.centre) * self.edge as f32;
        let cell = |x: f32| (x as usize).min(self.edge - 1);
        cell(at.y) * self.edge + cell(at.x)
    }

    #[inline(always)]
    fn weight(&self, p: Vec3, n: Vec3) -> f32 {
        let d = self.centre - p;
        let distance2 = d.length_squared();
        let distance = distance2.sqrt();
        // The most that the cosine at the point can be, to first order.
        let cos =
            if distance > self.radius { ((n.dot(d) + self.radius) / distance).clamp(0.02, 1.0) } else { 1.0 };
        self.power * self.facing[self.bin(p)] * cos / distance2.max(self.radius * self.radius)
    }
}

/// A direction (of any length) on the octahedron's square, [0, 1]²; the middle where there is none.
#[inline(always)]
fn octahedron(d: Vec3) -> Vec2 {
    let sum = d.x.abs() + d.y.abs() + d.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return Vec2::splat(0.5);
    }
    let (x, y) = (d.x / sum, d.y / sum);
    let (x, y) = if d.z >= 0.0 { (x, y) } else { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) };
    Vec2::new(0.5 * x + 0.5, 0.5 * y + 0.5)
}

/// The unit direction at a place of the octahedron's square.
fn from_octahedron(at: Vec2) -> Vec3 {
    let (x, y) = (2.0 * at.x - 1.0, 2.0 * at.y - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z >= 0.0 { (x, y) } else { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) };
    Vec3::new(x, y, z).normalize()
}

/// How far along a Hilbert curve over 2^10 × 2^10 cells a place of the unit square lies.
fn hilbert(at: Vec2) -> u32 {
    const BITS: u32 = 10;
    let cell = |x: f32| ((x * (1 << BITS) as f32) as u32).min((1 << BITS) - 1);
    let (mut x, mut y) = (cell(at.x), cell(at.y));
    let mut d = 0;
    for bit in (0..BITS).rev() {
        let s = 1 << bit;
        let (rx, ry) = (u32::from(x & s > 0), u32::from(y & s > 0));
        d += s * s * ((3 * rx) ^ ry);
        if ry == 0 {
            if rx == 1 {
                x = (1 << BITS) - 1 - x;
                y = (1 << BITS) - 1 - y;
            }
            (x, y) = (y, x);
        }
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_octahedron_is_its_own_inverse() {
        for i in 0..32 * 32 {
            let at = Vec2::new((i % 32) as f32 + 0.5, (i / 32) as f32 + 0.5) / 32.0;
            assert!((octahedron(from_octahedron(at) * 3.0) - at).length() < 1e-5, "{at}");
        }
        assert_eq!(octahedron(Vec3::ZERO), Vec2::splat(0.5));
        assert_eq!(octahedron(Vec3::NAN), Vec2::splat(0.5));
    }

    #[test]
    fn the_curve_visits_neighbours() {
        let n = 1024;
        let mut cells: Vec<(u32, i32, i32)> = (0..64 * 64)
            .map(|i| (i % 64, i / 64))
            .map(|(x, y)| (hilbert(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32), x, y))
            .collect();
        cells.sort_unstable();
        for pair in cells.windows(2) {
            assert_eq!((pair[0].1 - pair[1].1).abs() + (pair[0].2 - pair[1].2).abs(), 1, "{pair:?}");
        }
    }
}
