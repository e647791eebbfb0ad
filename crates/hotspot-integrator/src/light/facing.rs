//! Choosing emissive triangles by where they are seen from.
//!
//! Power alone wastes samples: half of a lamp's mesh faces away, and lamps near by matter more than those far off. Here
//! emissive triangles are grouped by part (an object's surface of one material). A group is chosen by its power, the square of
//! its distance, how much of it faces the point, and whether it is above the point's horizon; a triangle within it by its
//! power times the cosine of its normal with the direction in which the point lies. That direction is rounded to one of a
//! number of bins over the octahedron (Meyer et al., *On Floating-Point Normal Vectors*, 2010), each with a distribution made
//! beforehand ([`trees`](super::trees)), and the groups are weighed eight at a time, so that a choice takes little longer than
//! by power. Within a group triangles follow a Hilbert curve over the
//! octahedron of their directions from the group's centre: neighbouring numbers choose neighbouring triangles, and stratified
//! numbers stay stratified on the lamp; two equal neighbours are one patch ([`patches`](super::patches)).
//!
//! A share of each choice goes by power alone ([`DEFENSIVE`]): what the rounded direction or the bounds misjudge is still
//! sampled, so the estimate stays unbiased and its weights bounded.

use super::lanes::{PATCH, patch_row};
use super::patches::{Patch, Place};
use super::trees::{Descent, Node, Trees};
use super::triangles::LightTriangle;
use crate::geometry::Geometry;
use crate::lanes::math::vec3;
use glam::{Vec2, Vec3};
use hotspot_bvh::simd::{F8, Lanes};
use rayon::prelude::*;

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

/// Groups that are weighed at once.
const LANES: usize = 8;
const BLOCKS: usize = MOST_GROUPS.div_ceil(LANES);

/// The groups of a scene.
#[derive(Debug)]
pub(super) struct Facing {
    groups: Vec<Group>,
    /// What choosing one reads of each.
    blocks: [Block; BLOCKS],
    /// Of each group: how much of its power faces the directions of each bin, [`EDGE`]² of them.
    facing: Vec<f32>,
    /// From a triangle's number to group, patch in it, and index into the lights; by number less `first`.
    place_of: Vec<[u32; 3]>,
    first: u32,
    /// Patches of all groups, for lanes.
    rows: Vec<[f32; PATCH]>,
}

#[derive(Debug)]
struct Group {
    outline: Outline,
    /// One distribution over the patches for each bin.
    trees: Trees,
    /// The patches, in the order of the distributions.
    order: Vec<Patch>,
    /// Of the first of them, in [`Facing::rows`].
    first_row: u32,
}

/// What is known of a group from afar.
#[derive(Clone, Copy, Debug)]
struct Outline {
    centre: Vec3,
    radius: f32,
    power: f32,
    /// Share of all groups' power.
    share: f32,
    /// Bins along an edge of the octahedron's square.
    edge: f32,
}

/// Outlines side by side, those that are missing without power.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
struct Block {
    centre: [[f32; LANES]; 3],
    radius: [f32; LANES],
    power: [f32; LANES],
    share: [f32; LANES],
    edge: [f32; LANES],
}

/// The groups, seen from somewhere.
struct Seen {
    /// In what proportion they are chosen, if their sum is a positive number.
    weights: [[f32; LANES]; BLOCKS],
    /// The bin in which the point lies.
    bins: [[f32; LANES]; BLOCKS],
    /// What to multiply a weight by; 0: choose by power.
    scale: f32,
}

/// A chosen group.
#[derive(Clone, Copy, Default)]
struct ChosenGroup {
    index: usize,
    bin: usize,
    /// What the choice left of its number.
    rest: f32,
    probability: f32,
}

/// Chosen patches of eight points.
pub(super) struct ChosenPatches {
    /// Among those of [`Facing::rows`].
    pub(super) row: [u32; 8],
    /// What the choices left of their numbers.
    pub(super) rest: [f32; 8],
    /// With which the patch's triangles are chosen.
    pub(super) probability: [f32; 8],
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
        let mut groups = Vec::with_capacity(members.len());
        let mut facing = Vec::with_capacity(members.len() * EDGE * EDGE);
        let mut blocks = [Block::default(); BLOCKS];
        let mut rows = Vec::new();
        for (g, patches) in members.into_iter().enumerate() {
            let mut group = Group::new(lights, geometry, patches.to_vec(), total, &mut facing);
            group.first_row = rows.len() as u32;
            rows.extend(group.order.iter().map(|patch| patch_row(&patch.row())));
            facing.resize((g + 1) * EDGE * EDGE, 0.0);
            blocks[g / LANES].set(g % LANES, &group.outline);
            for (place, patch) in group.order.iter().enumerate() {
                for index in patch.triangles() {
                    let primitive = lights[index as usize].primitive;
                    place_of[(primitive - first) as usize] = [g as u32, place as u32, index];
                }
            }
            groups.push(group);
        }
        Some(Self { groups, blocks, facing, place_of, first, rows })
    }

    /// The groups as seen from a surface at `p` with normal `n`.
    #[inline(always)]
    fn seen(&self, p: Vec3, n: Vec3) -> Seen {
        let mut seen = Seen { weights: [[0.0; LANES]; BLOCKS], bins: [[0.0; LANES]; BLOCKS], scale: 0.0 };
        let count = self.groups.len();
        if count == 1 {
            seen.bins[0][0] = self.groups[0].outline.bin(p);
            return seen;
        }
        let mut sum = 0.0;
        for (b, block) in self.blocks[..count.div_ceil(LANES)].iter().enumerate() {
            (seen.weights[b], seen.bins[b]) = block.weigh(p, n);
            let facing = self.facing.chunks_exact(EDGE * EDGE).skip(b * LANES);
            for ((weight, bin), facing) in seen.weights[b].iter_mut().zip(&seen.bins[b]).zip(facing) {
                *weight *= facing[*bin as usize];
                sum += *weight;
            }
        }
        if sum > 0.0 && sum.is_finite() {
            seen.scale = (1.0 - DEFENSIVE) / sum;
        }
        seen
    }

    /// Probability of a group, and the bin of its distribution.
    #[inline(always)]
    fn probability(&self, group: usize, seen: &Seen) -> (f32, usize) {
        let (block, lane) = (group / LANES, group % LANES);
        let share = self.blocks[block].share[lane];
        let probability = if self.groups.len() == 1 {
            1.0
        } else if seen.scale > 0.0 {
            DEFENSIVE * share + seen.scale * seen.weights[block][lane]
        } else {
            share
        };
        (probability, seen.bins[block][lane] as usize)
    }

    /// A group, by a number in [0, 1).
    #[inline(always)]
    fn choose_group(&self, p: Vec3, n: Vec3, u: f32) -> ChosenGroup {
        let seen = self.seen(p, n);
        let mut rest = u;
        let mut index = 0;
        let (mut probability, mut bin) = self.probability(0, &seen);
        while rest >= probability && index + 1 < self.groups.len() {
            rest -= probability;
            index += 1;
            (probability, bin) = self.probability(index, &seen);
        }
        let rest = (rest / probability).clamp(0.0, 1.0 - f32::EPSILON);
        ChosenGroup { index, bin, rest, probability }
    }

    /// A place, by two numbers in [0, 1).
    #[inline(always)]
    pub(super) fn choose(&self, p: Vec3, n: Vec3, u: f32, v: f32) -> Chosen {
        let ChosenGroup { index, bin, rest, probability } = self.choose_group(p, n, u);
        let group = &self.groups[index];
        let (index, rest, within) = group.trees.sample(bin, rest);
        let patch = &group.order[index];
        Chosen { place: patch.place(rest, v), probability: probability * within * patch.share() }
    }

    /// The patches that [`Facing::choose`] takes for lanes `asked`, as bits; of others anything. All descend their trees at the same
    /// time, so that one waits for memory while the others do.
    #[inline(always)]
    pub(super) fn choose_patches(&self, p: &[F8; 3], n: &[F8; 3], u: &F8, asked: u32) -> ChosenPatches {
        let mut chosen = [ChosenGroup::default(); 8];
        let mut descents = [Descent::default(); 8];
        for lane in Lanes(asked) {
            chosen[lane] = self.choose_group(vec3(p, lane), vec3(n, lane), u.0[lane]);
            descents[lane] = Descent::new(chosen[lane].rest);
        }
        let mut left = asked;
        let mut level = 0;
        while left != 0 {
            for lane in Lanes(left) {
                let ChosenGroup { index, bin, .. } = chosen[lane];
                if !self.groups[index].trees.descend(bin, level, &mut descents[lane]) {
                    left &= !(1 << lane);
                }
            }
            level += 1;
        }
        let mut patches = ChosenPatches { row: [0; 8], rest: [0.0; 8], probability: [0.0; 8] };
        for lane in Lanes(asked) {
            let (index, rest, within) = descents[lane].found();
            let group = &self.groups[chosen[lane].index];
            patches.row[lane] = group.first_row + index as u32;
            patches.rest[lane] = rest;
            patches.probability[lane] = chosen[lane].probability * within * group.order[index].share();
        }
        patches
    }

    /// Of all groups' patches.
    pub(super) fn rows(&self) -> &[[f32; PATCH]] {
        &self.rows
    }

    /// The light with this primitive, which must be one, and the probability with which [`Facing::choose`] takes it.
    #[inline(always)]
    pub(super) fn probability_of(&self, p: Vec3, n: Vec3, primitive: u32) -> (u32, f32) {
        let [index, place, light] = self.place_of[(primitive - self.first) as usize];
        let group = &self.groups[index as usize];
        let (probability, bin) = self.probability(index as usize, &self.seen(p, n));
        let within = group.trees.probability(bin, place as usize);
        (light, probability * within * group.order[place as usize].share())
    }
}

impl Group {
    /// Appends to `facing` how much of its power faces each bin.
    fn new(
        lights: &[LightTriangle],
        geometry: &Geometry,
        mut order: Vec<Patch>,
        total: f64,
        facing: &mut Vec<f32>,
    ) -> Self {
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
        let power_of: Vec<f64> = order.iter().map(|patch| patch.power(lights)).collect();
        let mut trees = Trees::new(edge * edge, order.len());
        let shape = trees.shape();
        // Of each patch one triangle and, where it has two, the other.
        let faces =
            [0, 1].map(|half| Faces::new(lights, order.iter().map(|patch| patch.triangles().nth(half))));
        // Each bin's share of the power that faces it, while its distribution is made.
        let weigh = |(bin, nodes): (usize, &mut [Node])| {
            let at = Vec2::new((bin % edge) as f32 + 0.5, (bin / edge) as f32 + 0.5) / edge as f32;
            let towards = from_octahedron(at);
            let mut seen = vec![0.0; order.len()];
            faces.iter().for_each(|faces| faces.add_seen(towards, &mut seen));
            let sum: f64 = seen.iter().map(|seen| f64::from(*seen)).sum();
            let defensive = if sum > 0.0 { f64::from(DEFENSIVE) * sum / power } else { 1.0 };
            let weight = |(seen, power): (&f32, &f64)| {
                (((1.0 - f64::from(DEFENSIVE)) * f64::from(*seen) + defensive * power) / total) as f32
            };
            shape.fill(nodes, seen.iter().zip(&power_of).map(weight).collect());
            (sum / power).max(1e-3) as f32
        };
        facing.par_extend(trees.nodes().enumerate().collect::<Vec<_>>().into_par_iter().map(weigh));
        let outline =
            Outline { centre, radius, power: power as f32, share: (power / total) as f32, edge: edge as f32 };
        Self { outline, trees, order, first_row: 0 }
    }
}

/// Triangles side by side, so that a bin asks all of them in vectors.
#[derive(Default)]
struct Faces {
    normals: [Vec<f32>; 3],
    /// Probability of each; 0 in place of one that is missing.
    powers: Vec<f32>,
    two_sided: Vec<bool>,
}

impl Faces {
    fn new(lights: &[LightTriangle], triangles: impl Iterator<Item = Option<u32>>) -> Self {
        let mut faces = Self::default();
        for triangle in triangles {
            let light = triangle.map(|i| &lights[i as usize]);
            let normal = light.map_or(Vec3::ZERO, |light| light.normal).to_array();
            faces.normals.iter_mut().zip(normal).for_each(|(all, n)| all.push(n));
            faces.powers.push(light.map_or(0.0, |light| light.probability as f32));
            faces.two_sided.push(light.is_some_and(|light| light.two_sided));
        }
        faces
    }

    /// Adds the power of each triangle that faces a direction, by how much it does.
    fn add_seen(&self, towards: Vec3, seen: &mut [f32]) {
        let [x, y, z] = &self.normals;
        let normals = x.iter().zip(y).zip(z);
        for (((seen, ((x, y), z)), power), two_sided) in
            seen.iter_mut().zip(normals).zip(&self.powers).zip(&self.two_sided)
        {
            let cos = x * towards.x + y * towards.y + z * towards.z;
            // Both sides of a surface that emits to both.
            let cos = if *two_sided { cos.abs() } else { cos };
            *seen += power * ((cos + SLACK).max(0.0) / (1.0 + SLACK));
        }
    }
}

impl Outline {
    /// The bin of the direction from the centre to `p`: below the square of `edge`.
    #[inline(always)]
    fn bin(&self, p: Vec3) -> f32 {
        bin(p - self.centre, self.edge)
    }
}

impl Block {
    fn set(&mut self, lane: usize, outline: &Outline) {
        for (axis, at) in outline.centre.to_array().into_iter().enumerate() {
            self.centre[axis][lane] = at;
        }
        self.radius[lane] = outline.radius;
        self.power[lane] = outline.power;
        self.share[lane] = outline.share;
        self.edge[lane] = outline.edge;
    }

    /// Weight of each group at a surface at `p` with normal `n`, but for how much of it faces there, and the bin in which
    /// `p` lies. Without branches, so that compilers do all of them at once.
    #[inline(always)]
    fn weigh(&self, p: Vec3, n: Vec3) -> ([f32; LANES], [f32; LANES]) {
        let (mut weights, mut bins) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let d = Vec3::new(self.centre[0][i], self.centre[1][i], self.centre[2][i]) - p;
            let radius = self.radius[i];
            let distance2 = d.length_squared();
            let distance = distance2.sqrt();
            // The most that the cosine at the point can be, to first order.
            let cos = if distance > radius { ((n.dot(d) + radius) / distance).clamp(0.02, 1.0) } else { 1.0 };
            weights[i] = self.power[i] * cos / distance2.max(radius * radius);
            bins[i] = bin(-d, self.edge[i]);
        }
        (weights, bins)
    }
}

/// The bin of a direction among `edge`² of them, a whole number below that.
#[inline(always)]
fn bin(d: Vec3, edge: f32) -> f32 {
    // From here on single precision has no fractions: a sum is rounded to the nearest whole number.
    const WHOLE: f32 = 8_388_608.0;
    let at = octahedron(d);
    let cell = |x: f32| (((x * edge - 0.5).max(0.0) + WHOLE) - WHOLE).min(edge - 1.0);
    cell(at.y) * edge + cell(at.x)
}

/// A direction (of any length) on the octahedron's square, [0, 1]²; the middle where there is none.
#[inline(always)]
fn octahedron(d: Vec3) -> Vec2 {
    let inverse = 1.0 / (d.x.abs() + d.y.abs() + d.z.abs());
    let some = inverse > 0.0 && inverse < f32::INFINITY;
    let (x, y) = if some { (d.x * inverse, d.y * inverse) } else { (0.0, 0.0) };
    let folded = ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y));
    let (x, y) = if d.z >= 0.0 || !some { (x, y) } else { folded };
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
        assert_eq!(octahedron(Vec3::NEG_Z * f32::INFINITY), Vec2::splat(0.5));
    }

    /// Whole numbers below the square, for all directions, on the borders too; and each bin's middle is in it.
    #[test]
    fn directions_have_a_bin() {
        for edge in [1.0f32, 2.0, 16.0] {
            for i in 0..100 * 100 {
                let at = Vec2::new((i % 100) as f32, (i / 100) as f32) / 99.0;
                let found = bin(from_octahedron(at), edge);
                assert!(found >= 0.0 && found < edge * edge && found.fract() == 0.0, "{at} {edge}: {found}");
                let [x, y] = (at * edge).to_array().map(|x| x.floor().min(edge - 1.0));
                let middle = (Vec2::new(x, y) + 0.5) / edge;
                assert_eq!(bin(from_octahedron(middle) * 7.0, edge), y * edge + x, "{middle} {edge}");
            }
            for odd in [Vec3::ZERO, Vec3::NAN, Vec3::MAX, Vec3::INFINITY, Vec3::splat(-1e-45)] {
                assert!((0.0..edge * edge).contains(&bin(odd, edge)), "{odd}");
            }
        }
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
