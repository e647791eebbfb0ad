//! Booking rays while they are traced: a probe that records paths too.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of its place, one addition there, one to the ray's own sum; the spawner is booked once per ray. Visits
//! inside an instance are added in a place of their own, and moved to the instance's when the ray leaves it: so no visit has to ask.
//!
//! Visits of more than 254 boxes or triangles, and of nodes and blocks that do not exist, are booked as exactly, but take longer. A ray may visit
//! 2^27 nodes and as many leaf blocks from its start or an instance to the next or its end, as many as a tree may have: of one that visits
//! more, the sums are wrong.

mod paths;
#[cfg(test)]
mod tests;

use super::bins::{Aim, BinCounts, Bins, RareCounts, RayKey, Sender};
use super::cells::{Aside, Cells, Row};
use super::payers::{Column, NOWHERE, Payers, Place, Tree};
use super::rows::{Ledgers, MatrixRow, PayerRow, SpawnerRow, Traversal};
use crate::pair::{LEAVES, NODES, PAIRS, Pair};
use crate::recorder::{PathEnd, PathTally, PixelVisit};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};
pub use paths::BookedPaths;

/// The sums of one worker.
#[derive(Clone, Debug)]
pub struct Ledger {
    cells: Cells,
    bins: Bins,
}

impl Ledger {
    /// Empty sums for a scene of these payers.
    pub fn new(payers: &Payers) -> Self {
        Self { cells: Cells::new(payers), bins: Bins::new() }
    }

    /// Books the paths of a visit of a pixel as well as recording them.
    #[inline(always)]
    pub fn visit<'p>(&'p mut self, payers: &'p Payers, pixel: PixelVisit<'p>) -> BookedVisit<'p> {
        let (pairs, state) = self.open(payers);
        BookedVisit { pairs, state, tally: PathTally::new(), pixel }
    }

    #[inline(always)]
    fn open<'p>(&'p mut self, payers: &'p Payers) -> (&'p mut [u64], State<'p>) {
        let (pairs, aside) = self.cells.parts();
        let state = State {
            tree: payers.tree(),
            key: RayKey::new(Sender::new(0, NONE), Aim::NONE, 0, RayKind::Camera),
            special: false,
            rare: [0; 2],
            inside: 0,
            block: 0,
            payers,
            aside,
            bins: &mut self.bins,
        };
        (pairs, state)
    }

    /// Adds the sums of another worker of the same scene.
    ///
    /// # Panics
    /// When the other is of a scene of another number of objects.
    pub fn merge(&mut self, other: &Self) {
        self.cells.merge(&other.cells);
        self.bins.merge(&other.bins);
    }

    /// Bytes that may be touched.
    pub fn memory(&self) -> u64 {
        (self.cells.memory() + self.bins.memory()) as u64
    }

    /// The rows, named.
    pub fn rows(&self, payers: &Payers, objects: &[String], materials: &[String]) -> Ledgers {
        let mut ledgers = Ledgers {
            objects: objects.to_vec(),
            materials: materials.to_vec(),
            merged_objects: payers.merged(),
            ..Ledgers::default()
        };
        ledgers.spawner = self
            .bins
            .iter()
            .map(|(key, counts, [instances, alpha_tests])| {
                let BinCounts { rays, hits, blocked, nodes, boxes, leaves, shapes } = counts;
                SpawnerRow {
                    object: payers.object(key.object()),
                    material: (key.material() != NONE).then_some(key.material()),
                    bounce: key.bounce(),
                    kind: key.kind().into(),
                    light: payers.object(key.light()),
                    rays,
                    hits,
                    blocked,
                    traversal: Traversal { nodes, boxes, leaves, shapes, instances, alpha_tests },
                }
            })
            .collect();
        let mut paid = vec![Traversal::default(); payers.count()];
        for spawner in 0..payers.count() {
            for (payer, (traversal, landed)) in self.cells.paid(spawner, payers).into_iter().enumerate() {
                if traversal == Traversal::default() && landed == 0 {
                    continue;
                }
                paid[payer].add(&traversal);
                let [spawner, payer] = [spawner, payer].map(|slot| payers.object(slot as Column));
                ledgers.matrix.push(MatrixRow { spawner, payer, others: false, landed, traversal });
            }
        }
        ledgers.payer = paid
            .into_iter()
            .enumerate()
            .filter(|(_, traversal)| *traversal != Traversal::default())
            .map(|(payer, traversal)| PayerRow { object: payers.object(payer as Column), traversal })
            .collect();
        ledgers.finish();
        ledgers
    }
}

/// A visit of a pixel whose paths are booked and recorded.
#[derive(Debug)]
pub struct BookedVisit<'p> {
    /// What rays visited, by spawner and place.
    pairs: &'p mut [u64],
    state: State<'p>,
    /// Of the path at hand.
    tally: PathTally,
    pixel: PixelVisit<'p>,
}

/// All that a ray changes but for its path's tally and the pairs, behind one address.
#[derive(Debug)]
struct State<'p> {
    tree: Tree<'p>,
    /// What sent the ray.
    key: RayKey,
    /// Whether the ray has met anything that few do.
    special: bool,
    /// The ray's instances and alpha tests; nothing between rays.
    rare: RareCounts,
    /// Slot of the instance that it is in; the scene's between rays.
    inside: Column,
    /// Slot of its last leaf block before that instance.
    block: Column,
    payers: &'p Payers,
    aside: &'p mut Aside,
    bins: &'p mut Bins,
}

impl<'p> BookedVisit<'p> {
    /// Opens a path. To be ended ([`BookedPath::end`]): one that is not would be counted as a part of the next path, or
    /// without a sample.
    #[inline(always)]
    pub fn path(&mut self) -> BookedPath<'_, 'p> {
        BookedPath { visit: self }
    }
}

impl<'p> State<'p> {
    /// A ray of a path is about to be cast.
    #[inline(always)]
    fn ray<'r>(
        &'r mut self,
        pairs: &'r mut [u64],
        tally: &'r mut PathTally,
        key: RayKey,
    ) -> BookedRay<'r, 'p> {
        let (spawner, kind) = (key.object(), key.kind());
        if kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            tally.leave(self.aside.landed(tally.left(), spawner));
        }
        let shadow = kind == RayKind::Shadow;
        tally.sent(shadow);
        self.key = key;
        let row = self.aside.row_of(pairs, spawner);
        BookedRay { state: self, tally, row, visits: [Pair::NOTHING; PAIRS], block: NONE, shadow }
    }

    /// A visit of very many boxes, or beyond every row.
    #[cold]
    #[inline(never)]
    fn odd_visit(&mut self, tally: &mut PathTally, id: u32, pair: usize, boxes: u32) {
        let spawner = self.key.object();
        let place = if pair == NODES { self.tree.node(id) } else { self.tree.block(id) };
        match place.filter(|place| *place != NOWHERE) {
            Some(place) => self.aside.odd_visits(spawner, place, [1, u64::from(boxes)]),
            None => {
                let triangles = if pair == LEAVES { self.payers.stray(id) } else { &[] };
                self.aside.visit_nowhere(spawner, pair, boxes, triangles);
            }
        }
        tally.odd_visit(pair, boxes);
        self.special = true;
    }

    /// The same of few boxes. Told as it would be added: so no visit needs the number apart.
    #[cold]
    #[inline(never)]
    fn stray_visit(&mut self, tally: &mut PathTally, id: u32, pair: usize, visit: Pair) {
        let [_, boxes] = visit.split();
        self.odd_visit(tally, id, pair, boxes as u32);
    }

    /// Takes a full pair out of the spawner's row.
    #[cold]
    #[inline(never)]
    fn empty(&mut self, row: &mut Row, place: Place) {
        self.aside.odd_visits(self.key.object(), place, Pair::take_from(&mut row[usize::from(place)]));
    }

    /// The ray enters an instance after `block`, the last that it visited since another.
    #[inline(never)]
    fn enter(&mut self, row: &mut Row, id: u32, block: u32) {
        let spawner = self.key.object();
        self.block = self.slot_of_block(block);
        self.aside.leave(spawner, row, self.inside);
        self.inside = self.payers.instance(id);
        self.aside.instance(spawner, self.inside);
        self.rare[0] += 1;
        self.special = true;
    }

    /// The slot that pays for what happens in the ray's last block, if that is after its last instance.
    fn slot_of_block(&self, block: u32) -> Column {
        if block == NONE {
            self.block
        } else {
            self.payers.slot_of_block(self.tree.block(block), self.inside)
        }
    }

    /// A hit on a block was asked whether it is there.
    #[inline(never)]
    fn alpha_test(&mut self, block: u32) {
        self.aside.alpha_test(self.key.object(), self.slot_of_block(block));
        self.rare[1] += 1;
        self.special = true;
    }

    /// Books what few rays have of one that has ended.
    #[inline(never)]
    fn finish_special(&mut self, tally: &mut PathTally, row: &mut Row, shadow: bool, blocked: bool) {
        let rare = std::mem::take(&mut self.rare);
        self.bins.add_rare(self.key, rare);
        if rare[0] > 0 {
            tally.more().add_instances(shadow, rare[0]);
            self.aside.leave(self.key.object(), row, self.inside);
            self.inside = 0;
        }
        self.block = 0;
        self.special = false;
        if tally.is_odd() {
            let [nodes, leaves] = tally.end_odd(shadow, blocked);
            // The ray itself is counted with the visits that pairs hold.
            let counts = BinCounts {
                rays: 0,
                hits: 0,
                blocked: if blocked { nodes[0] + leaves[1] } else { 0 },
                nodes: nodes[0],
                boxes: nodes[1],
                leaves: leaves[0],
                shapes: leaves[1],
            };
            self.bins.add_wide(self.key, &counts);
        }
    }
}

/// A path that is booked and recorded.
#[derive(Debug)]
pub struct BookedPath<'v, 'p> {
    visit: &'v mut BookedVisit<'p>,
}

impl BookedPath<'_, '_> {
    /// Closes the path ([`PixelVisit::end`]).
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        let BookedVisit { tally, pixel, .. } = self.visit;
        pixel.add(tally, end);
        tally.clear();
    }
}

impl<'p> Probe for BookedPath<'_, 'p> {
    const ON: bool = true;
    type Ray<'r>
        = BookedRay<'r, 'p>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> BookedRay<'_, 'p> {
        let BookedVisit { pairs, state, tally, .. } = &mut *self.visit;
        state.ray(pairs, tally, state.payers.key(by))
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        let BookedVisit { state, tally, .. } = &mut *self.visit;
        tally.sent(by.kind == RayKind::Shadow);
        state.bins.add_ray(state.payers.key(by), false, [Pair::NOTHING; PAIRS], false);
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.visit.tally.bsdf(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.visit.tally.texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.visit.tally.light(left, luminance);
    }
}

/// A ray that is booked and counted; it must be finished. It holds what stays or is seldom asked for, so that it can be
/// registers where the traversal is part of the path loop, and little where that is a call.
#[derive(Debug)]
pub struct BookedRay<'r, 'p> {
    state: &'r mut State<'p>,
    tally: &'r mut PathTally,
    /// The spawner's row, by place.
    row: &'r mut Row,
    /// What it visited, but for what pairs cannot hold.
    visits: [Pair; PAIRS],
    /// Its last leaf block since it entered an instance, [`NONE`] without one.
    block: u32,
    shadow: bool,
}

impl BookedRay<'_, '_> {
    #[inline(always)]
    fn visit(&mut self, id: u32, place: Option<Place>, pair: usize, boxes: u32) {
        let Some(visit) = Pair::visit(boxes) else {
            return self.state.odd_visit(self.tally, id, pair, boxes);
        };
        // Nodes are all somewhere.
        let Some(place) = place.filter(|place| pair == NODES || *place != NOWHERE) else {
            return self.state.stray_visit(self.tally, id, pair, visit);
        };
        if visit.add_to(&mut self.row[usize::from(place)]) {
            self.state.empty(self.row, place);
        }
        self.visits[pair].gather(visit);
    }
}

impl RayProbe for BookedRay<'_, '_> {
    #[inline(always)]
    fn node(&mut self, id: u32, boxes: u32) {
        self.visit(id, self.state.tree.node(id), NODES, boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, id: u32, shapes: u32) {
        self.block = id;
        self.visit(id, self.state.tree.block(id), LEAVES, shapes);
    }

    #[inline(always)]
    fn instance(&mut self, id: u32) {
        let block = std::mem::replace(&mut self.block, NONE);
        self.state.enter(self.row, id, block);
        if Pair::any_full(self.visits) {
            self.tally.odd_visits(std::mem::take(&mut self.visits));
        }
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.tally.more().add_alpha(lookups, bytes);
        self.state.alpha_test(self.block);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        let Self { state, tally, row, visits, shadow, .. } = self;
        let blocked = shadow && hit;
        if state.special {
            state.finish_special(tally, row, shadow, blocked);
        }
        state.bins.add_ray(state.key, hit, visits, blocked);
        tally.end_ray(shadow, visits, blocked);
    }
}
