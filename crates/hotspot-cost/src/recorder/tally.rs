//! The counts of one path by itself, until it is added to its pixel: of those that are traced side by side or booked.

use super::path::PathCounts;
use crate::pair::{LEAVES, NODES, PAIRS, Pair};
use hotspot_probe::RayProbe;

/// The sums of shadow rays that were blocked; the first two are those of a `bool`.
const BLOCKED: usize = 2;

/// In [`PathTally::left`]: there is something in `more`.
const MORE: u32 = 1 << 31;
/// The same of `odd`.
const ODD: u32 = 1 << 30;

/// The counts of one path ([`PixelVisit::add`](super::PixelVisit::add)), such as of one among others that are traced side by side. What every ray
/// adds to is one cache line: many paths are under way at once then.
///
/// A path may send fewer than 2^32 rays of each kind, and evaluate BSDFs as often. A ray may visit 2^27 nodes and as many leaf blocks from its start or an instance to the next
/// or its end, as many as a tree may have: of one that visits more, the sums are wrong.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct PathTally {
    /// Visits of the path's rays, nodes with boxes and leaf blocks with shapes: of camera and bounce rays, of shadow rays, of blocked shadow rays.
    /// None is full between rays, blocked ones being shadow rays.
    sums: [[Pair; PAIRS]; 3],
    /// Camera and bounce rays, shadow rays.
    rays: [u32; 2],
    bsdf: u32,
    /// Where ledgers keep how paths went on from the object that it left last: below 2^30. Above it [`MORE`], [`ODD`].
    left: u32,
    /// What few paths have, and what pairs cannot hold.
    more: PathCounts,
    /// Of the ray at hand alone, with [`ODD`]: visits with boxes that pairs cannot hold.
    odd: [[u64; 2]; PAIRS],
}

impl PathTally {
    /// A path that has counted nothing.
    #[inline(always)]
    pub fn new() -> Self {
        Self {
            sums: [[Pair::NOTHING; PAIRS]; 3],
            rays: [0; 2],
            bsdf: 0,
            left: 0,
            more: PathCounts::none(),
            odd: [[0; 2]; PAIRS],
        }
    }

    /// Forgets the path: as new.
    #[inline(always)]
    pub fn clear(&mut self) {
        if self.left & (MORE | ODD) != 0 {
            self.more = PathCounts::none();
            // Nothing, unless a ray was not finished.
            self.odd = [[0; 2]; PAIRS];
        }
        self.sums = [[Pair::NOTHING; PAIRS]; 3];
        (self.rays, self.bsdf, self.left) = ([0; 2], 0, 0);
    }

    /// A ray is about to be cast; `shadow`: a shadow ray.
    #[inline(always)]
    pub fn ray(&mut self, shadow: bool) -> TalliedRay<'_> {
        self.sent(shadow);
        TalliedRay { path: self, visits: [Pair::NOTHING; PAIRS], shadow }
    }

    /// Counts a ray.
    #[inline(always)]
    pub(crate) fn sent(&mut self, shadow: bool) {
        self.rays[usize::from(shadow)] += 1;
    }

    /// BSDFs were evaluated or sampled.
    #[inline(always)]
    pub fn bsdf(&mut self, evaluations: u32) {
        self.bsdf += evaluations;
    }

    /// Textures were looked up.
    #[inline(always)]
    pub fn texture(&mut self, lookups: u32, bytes: u32) {
        self.more().add_texture(lookups, bytes);
    }

    /// The path found light ([`Probe::light`](hotspot_probe::Probe::light)).
    #[inline(always)]
    pub fn light(&mut self, left: u32, luminance: f32) {
        // Few paths find light so near the limit.
        if PathCounts::near_limit(left) {
            self.more().add_light(left, luminance);
        }
    }

    /// What few paths have, which it has then.
    #[inline(always)]
    pub(crate) fn more(&mut self) -> &mut PathCounts {
        self.left |= MORE;
        &mut self.more
    }

    /// The same, if it has any.
    #[inline(always)]
    pub(super) fn if_more(&self) -> Option<&PathCounts> {
        (self.left & MORE != 0).then_some(&self.more)
    }

    /// Rays of a kind.
    #[inline(always)]
    pub(super) fn rays(&self, shadow: bool) -> u64 {
        self.rays[usize::from(shadow)].into()
    }

    /// Visits of nodes with their boxes, and of leaf blocks with their shapes, by rays of a kind.
    #[inline(always)]
    pub(super) fn visits(&self, shadow: bool) -> [[u64; 2]; PAIRS] {
        let [nodes, leaves] = self.sums[usize::from(shadow)];
        [nodes.split(), leaves.split()]
    }

    /// Nodes and shapes of blocked shadow rays.
    #[inline(always)]
    pub(super) fn blocked(&self) -> [u64; 2] {
        let [nodes, leaves] = self.sums[BLOCKED];
        [nodes.split()[0], leaves.split()[1]]
    }

    /// Evaluations of BSDFs.
    #[inline(always)]
    pub(super) fn evaluations(&self) -> u64 {
        self.bsdf.into()
    }

    /// Where ledgers keep how paths went on from the object that it left last.
    #[inline(always)]
    pub(crate) fn left(&self) -> usize {
        (self.left & (ODD - 1)) as usize
    }

    /// See [`Self::left`]; at most 2^20.
    #[inline(always)]
    pub(crate) fn leave(&mut self, left: usize) {
        self.left = self.left & (MORE | ODD) | left as u32;
    }

    /// The ray at hand visited what no pair can hold.
    #[cold]
    #[inline(never)]
    pub(crate) fn odd_visit(&mut self, pair: usize, boxes: u32) {
        self.odd[pair][0] += 1;
        self.odd[pair][1] += u64::from(boxes);
        self.left |= ODD;
    }

    /// The same of all that it visited so far.
    #[cold]
    #[inline(never)]
    pub(crate) fn odd_visits(&mut self, visits: [Pair; PAIRS]) {
        for (sum, visits) in self.odd.iter_mut().zip(visits) {
            let [visits, boxes] = visits.split();
            sum[0] += visits;
            sum[1] += boxes;
        }
        self.left |= ODD;
    }

    /// What the ray at hand visited and pairs cannot hold, which is counted now.
    #[cold]
    #[inline(never)]
    pub(crate) fn end_odd(&mut self, shadow: bool, blocked: bool) -> [[u64; 2]; PAIRS] {
        let [nodes, leaves] = std::mem::take(&mut self.odd);
        self.left &= !ODD;
        let more = self.more();
        more.add_visits(shadow, nodes, leaves);
        if blocked {
            more.add_blocked(nodes[0], leaves[1]);
        }
        [nodes, leaves]
    }

    /// Whether the ray at hand has anything for [`Self::end_odd`].
    #[inline(always)]
    pub(crate) fn is_odd(&self) -> bool {
        self.left & ODD != 0
    }

    /// A ray has ended that visited this.
    #[inline(always)]
    pub(crate) fn end_ray(&mut self, shadow: bool, visits: [Pair; PAIRS], blocked: bool) {
        let mut full = false;
        for (sum, visits) in self.sums[usize::from(shadow)].iter_mut().zip(visits) {
            full |= sum.add(visits);
        }
        if blocked {
            // No more than all shadow rays have, which is taken out with it.
            for (sum, visits) in self.sums[BLOCKED].iter_mut().zip(visits) {
                sum.gather(visits);
            }
        }
        if full {
            self.empty();
        }
    }

    /// Takes all sums out, one of which is full.
    #[cold]
    #[inline(never)]
    fn empty(&mut self) {
        let [others, shadow, blocked] = std::mem::replace(&mut self.sums, [[Pair::NOTHING; PAIRS]; 3]);
        let more = self.more();
        for (shadow, [nodes, leaves]) in [(false, others), (true, shadow)] {
            more.add_visits(shadow, nodes.split(), leaves.split());
        }
        more.add_blocked(blocked[NODES].split()[0], blocked[LEAVES].split()[1]);
    }
}

impl Default for PathTally {
    fn default() -> Self {
        Self::new()
    }
}

/// Counts one ray of a path by its tally; it must be finished, or some of its visits are missing.
#[derive(Debug)]
pub struct TalliedRay<'r> {
    path: &'r mut PathTally,
    /// Since its start, or since what pairs cannot hold was put aside.
    visits: [Pair; PAIRS],
    shadow: bool,
}

impl TalliedRay<'_> {
    #[inline(always)]
    fn visit(&mut self, pair: usize, boxes: u32) {
        match Pair::visit(boxes) {
            Some(visit) => self.visits[pair].gather(visit),
            None => self.path.odd_visit(pair, boxes),
        }
    }
}

impl RayProbe for TalliedRay<'_> {
    #[inline(always)]
    fn node(&mut self, _id: u32, boxes: u32) {
        self.visit(NODES, boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.visit(LEAVES, shapes);
    }

    #[inline(always)]
    fn instance(&mut self, _id: u32) {
        self.path.more().add_instances(self.shadow, 1);
        if Pair::any_full(self.visits) {
            self.path.odd_visits(std::mem::take(&mut self.visits));
        }
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.path.more().add_alpha(lookups, bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        let Self { path, visits, shadow } = self;
        let blocked = shadow && hit;
        if path.is_odd() {
            path.end_odd(shadow, blocked);
        }
        path.end_ray(shadow, visits, blocked);
    }
}
