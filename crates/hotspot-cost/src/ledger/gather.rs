//! Booking rays while they are traced: a probe that records paths too.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of its place, one addition there, one to the path's own sum; the spawner is booked once per ray. Visits
//! inside an instance are added in a place of their own, and moved to the instance's when the ray leaves it: so no visit has to ask.
//!
//! Visits of more than 254 boxes or triangles, and of nodes and blocks that do not exist, are booked as exactly, but take longer. A ray may visit
//! 2^27 nodes and as many leaf blocks from its start or an instance to the next or its end, as many as a tree may have: of one that visits
//! more, the sums are wrong.

mod paths;
#[cfg(test)]
mod tests;

use super::bins::{BinCounts, Bins, Key, RareCounts};
use super::cells::{Aside, Cells, LEAVES, NODES, PAIRS, Pair, Row};
use super::payers::{Column, NOWHERE, Payers, Place, Tree};
use super::rows::{Ledgers, MatrixRow, PayerRow, SpawnerRow, Traversal};
use crate::recorder::{PathCounts, PathEnd, PixelVisit};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};
pub use paths::{BookedPaths, Tallies};

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
        let (pairs, state) = self.open(payers, pixel);
        BookedVisit { pairs, state }
    }

    #[inline(always)]
    fn open<'p, K>(&'p mut self, payers: &'p Payers, counts: K) -> (&'p mut [u64], State<'p, K>) {
        let (pairs, aside) = self.cells.parts();
        let state = State {
            tree: payers.tree(),
            key: Key::new(0, NONE, 0, 0, RayKind::Camera),
            special: false,
            sums: [[Pair::NOTHING; PAIRS]; 3],
            left: 0,
            rare: [0; 2],
            inside: 0,
            apart: [[0; 2]; PAIRS],
            block: 0,
            payers,
            aside,
            bins: &mut self.bins,
            counts,
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
    state: State<'p, PixelVisit<'p>>,
}

/// Has the counts of the path at hand: a visit of a pixel, or [`Tallies`].
pub trait Keeper {
    /// Those.
    fn counts(&mut self) -> &mut PathCounts;
}

impl Keeper for PixelVisit<'_> {
    #[inline(always)]
    fn counts(&mut self) -> &mut PathCounts {
        self.path()
    }
}

/// All that a path and a ray change but for the pairs, behind one address.
#[derive(Debug)]
struct State<'p, K> {
    tree: Tree<'p>,
    /// What sent the ray.
    key: Key,
    /// Whether there is anything in `rare` or `apart`.
    special: bool,
    /// Visits of the path's rays, nodes with boxes and leaf blocks with shapes: of camera and bounce rays, of shadow rays, of blocked shadow
    /// rays that have ended. None is full between rays.
    sums: [[Pair; PAIRS]; 3],
    /// Where in [`Aside`] is kept how paths went on from the object that the path left last.
    left: usize,
    /// The ray's instances and alpha tests; nothing between rays.
    rare: RareCounts,
    /// Slot of the instance that it is in; the scene's between rays.
    inside: Column,
    /// What it visited and `sums` cannot hold; nothing between rays.
    apart: [[u64; 2]; PAIRS],
    /// Slot of its last leaf block before that instance.
    block: Column,
    payers: &'p Payers,
    aside: &'p mut Aside,
    bins: &'p mut Bins,
    /// Has all other counts.
    counts: K,
}

/// In [`State::sums`]; the first two are those of a `bool`.
const BLOCKED: usize = 2;

impl<'p> BookedVisit<'p> {
    /// Opens a path. To be ended ([`BookedPath::end`]): one that is not would be counted as a part of the next path, or
    /// without a sample.
    #[inline(always)]
    pub fn path(&mut self) -> BookedPath<'_, 'p> {
        self.state.left = 0;
        BookedPath { visit: self }
    }
}

impl<'p, K: Keeper> State<'p, K> {
    #[inline(always)]
    fn counts(&mut self) -> &mut PathCounts {
        self.counts.counts()
    }

    #[inline(always)]
    fn key_of(&self, spawner: Column, by: Spawner) -> Key {
        // Only shadow rays aim.
        let light = if by.light == NONE { 0 } else { self.payers.light(by.light) };
        Key::new(spawner, by.material, light, by.bounce, by.kind)
    }

    /// A ray is about to be cast.
    #[inline(always)]
    fn ray<'r>(&'r mut self, pairs: &'r mut [u64], by: Spawner) -> BookedRay<'r, 'p, K> {
        let spawner = self.payers.slot(by.object);
        if by.kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            self.left = self.aside.landed(self.left, spawner);
        }
        self.counts().untraced(by);
        self.key = self.key_of(spawner, by);
        let row = self.aside.row_of(pairs, spawner);
        let shadow = by.kind == RayKind::Shadow;
        BookedRay { before: self.sums[usize::from(shadow)], state: self, row, block: NONE, shadow }
    }

    /// A visit of very many boxes, or beyond every row.
    #[cold]
    #[inline(never)]
    fn odd_visit(&mut self, id: u32, pair: usize, boxes: u32) {
        let spawner = self.key.object();
        let place = if pair == NODES { self.tree.node(id) } else { self.tree.block(id) };
        match place.filter(|place| *place != NOWHERE) {
            Some(place) => self.aside.odd_visits(spawner, place, [1, u64::from(boxes)]),
            None => {
                let triangles = if pair == LEAVES { self.payers.stray(id) } else { &[] };
                self.aside.visit_nowhere(spawner, pair, boxes, triangles);
            }
        }
        self.apart[pair][0] += 1;
        self.apart[pair][1] += u64::from(boxes);
        self.special = true;
    }

    /// The same of few boxes. Told as it would be added: so no visit needs the number apart.
    #[cold]
    #[inline(never)]
    fn stray_visit(&mut self, id: u32, pair: usize, visit: Pair) {
        let [_, boxes] = visit.split();
        self.odd_visit(id, pair, boxes as u32);
    }

    /// Takes a full pair out of the spawner's row.
    #[cold]
    #[inline(never)]
    fn empty(&mut self, row: &mut Row, place: Place) {
        self.aside.odd_visits(self.key.object(), place, Pair::take_from(&mut row[usize::from(place)]));
    }

    /// Takes what the ray visited since its kind's sums were `before` out of them, and what else they hold too; what they are now.
    #[cold]
    #[inline(never)]
    fn keep_apart(&mut self, shadow: bool, before: [Pair; PAIRS]) -> [Pair; PAIRS] {
        let sums = std::mem::replace(&mut self.sums[usize::from(shadow)], before);
        for ((apart, sum), before) in self.apart.iter_mut().zip(sums).zip(before) {
            let [visits, boxes] = sum.since(before).split();
            apart[0] += visits;
            apart[1] += boxes;
        }
        self.special = true;
        self.count_sums();
        [Pair::NOTHING; PAIRS]
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
    fn alpha_test(&mut self, block: u32, lookups: u32, bytes: u32) {
        self.counts().add_alpha(lookups, bytes);
        self.aside.alpha_test(self.key.object(), self.slot_of_block(block));
        self.rare[1] += 1;
        self.special = true;
    }

    /// Whether the ray's visits are not all in sums that can take more of them, or there is something else that few rays have.
    #[inline(always)]
    fn is_special(&self, shadow: bool) -> bool {
        self.special || Pair::any_full(self.sums[usize::from(shadow)])
    }

    /// Books a ray that has ended, all of whose visits are in the sums of its kind, which were `before`.
    #[inline(always)]
    fn finish(&mut self, before: [Pair; PAIRS], shadow: bool, hit: bool) {
        let [nodes, leaves] = self.sums[usize::from(shadow)];
        let visits = [nodes.since(before[NODES]), leaves.since(before[LEAVES])];
        let blocked = hit && shadow;
        self.bins.add_ray(self.key, hit, visits, blocked);
        if blocked {
            // No more than all shadow rays have, which is taken out with it.
            let [nodes, leaves] = &mut self.sums[BLOCKED];
            nodes.gather(visits[NODES]);
            leaves.gather(visits[LEAVES]);
        }
    }

    /// Books a ray that has ended, with what few rays have.
    #[inline(never)]
    fn finish_special(&mut self, row: &mut Row, mut before: [Pair; PAIRS], shadow: bool, hit: bool) {
        if Pair::any_full(self.sums[usize::from(shadow)]) {
            before = self.keep_apart(shadow, before);
        }
        let rare = std::mem::take(&mut self.rare);
        self.bins.add_rare(self.key, rare);
        self.counts().add_instances(shadow, rare[0]);
        if rare[0] > 0 {
            self.aside.leave(self.key.object(), row, self.inside);
            self.inside = 0;
        }
        self.block = 0;
        self.special = false;
        let [nodes, leaves] = std::mem::take(&mut self.apart);
        if [nodes, leaves] != [[0; 2]; PAIRS] {
            let blocked = hit && shadow;
            self.counts().add_visits(shadow, nodes, leaves);
            if blocked {
                self.counts().add_blocked(nodes[0], leaves[1]);
            }
            // The ray itself is counted with what is in the sums.
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
        self.finish(before, shadow, hit);
    }

    /// Moves the path's sums of visits to its counts.
    fn count_sums(&mut self) {
        let Self { sums, counts, .. } = self;
        let counts = counts.counts();
        for shadow in [false, true] {
            let [nodes, leaves] = &mut sums[usize::from(shadow)];
            counts.add_visits(shadow, nodes.take(), leaves.take());
        }
        let [nodes, leaves] = &mut sums[BLOCKED];
        counts.add_blocked(nodes.take()[0], leaves.take()[1]);
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
        let state = &mut self.visit.state;
        state.count_sums();
        state.counts.end(end);
    }
}

impl<'p> Probe for BookedPath<'_, 'p> {
    const ON: bool = true;
    type Ray<'r>
        = BookedRay<'r, 'p, PixelVisit<'p>>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> BookedRay<'_, 'p, PixelVisit<'p>> {
        let BookedVisit { pairs, state } = &mut *self.visit;
        state.ray(pairs, by)
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        let state = &mut self.visit.state;
        state.counts().untraced(by);
        let key = state.key_of(state.payers.slot(by.object), by);
        state.bins.add_ray(key, false, [Pair::NOTHING; PAIRS], false);
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.visit.state.counts().bsdf(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.visit.state.counts().texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.visit.state.counts().light(left, luminance);
    }
}

/// A ray that is booked and counted; it must be finished. It holds what stays or is seldom asked for, so that it can be
/// registers where the traversal is part of the path loop, and little where that is a call.
#[derive(Debug)]
pub struct BookedRay<'r, 'p, K> {
    state: &'r mut State<'p, K>,
    /// The spawner's row, by place.
    row: &'r mut Row,
    /// The sums of its kind without its visits.
    before: [Pair; PAIRS],
    /// Its last leaf block since it entered an instance, [`NONE`] without one.
    block: u32,
    shadow: bool,
}

impl<K: Keeper> BookedRay<'_, '_, K> {
    #[inline(always)]
    fn visit(&mut self, id: u32, place: Option<Place>, pair: usize, boxes: u32) {
        let Some(visit) = Pair::visit(boxes) else { return self.state.odd_visit(id, pair, boxes) };
        // Nodes are all somewhere.
        let Some(place) = place.filter(|place| pair == NODES || *place != NOWHERE) else {
            return self.state.stray_visit(id, pair, visit);
        };
        if visit.add_to(&mut self.row[usize::from(place)]) {
            self.state.empty(self.row, place);
        }
        // Asked at the ray's end whether it is full.
        self.state.sums[usize::from(self.shadow)][pair].gather(visit);
    }
}

impl<K: Keeper> RayProbe for BookedRay<'_, '_, K> {
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
        if Pair::any_full(self.state.sums[usize::from(self.shadow)]) {
            self.before = self.state.keep_apart(self.shadow, self.before);
        }
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.state.alpha_test(self.block, lookups, bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        if self.state.is_special(self.shadow) {
            self.state.finish_special(self.row, self.before, self.shadow, hit);
        } else {
            self.state.finish(self.before, self.shadow, hit);
        }
    }
}
