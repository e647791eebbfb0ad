//! Booking rays while they are traced: a probe around the recorder's.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of its place, one addition there; the spawner is booked once per ray. Visits inside an instance
//! are added in a place of their own, and moved to the instance's when the ray leaves it: so no visit has to ask.

use super::bins::{BinCounts, Bins, Key, RareCounts};
use super::cells::{Aside, Cells, LEAVES, NODES, Pair};
use super::payers::{Column, Payers, Place, Tree};
use super::rows::{Ledgers, MatrixRow, PayerRow, SpawnerRow, Traversal};
use crate::recorder::{PathEnd, PathRecorder};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};

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

    /// Books a path as well as recording it. To be ended ([`BookedPath::end`]): paths that are not would be in the ledgers but
    /// not in the frame.
    #[inline(always)]
    pub fn path<'p>(&'p mut self, payers: &'p Payers, path: PathRecorder<'p>) -> BookedPath<'p> {
        let (pairs, aside) = self.cells.parts();
        BookedPath {
            pairs,
            state: State {
                tree: payers.tree(),
                key: Key::new(0, NONE, 0, 0, RayKind::Camera),
                rare: [0; 2],
                inside: 0,
                special: false,
                before: [0; 2],
                block: 0,
                left: 0,
                path,
                payers,
                aside,
                bins: &mut self.bins,
            },
        }
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
                let &BinCounts { rays, hits, blocked, nodes, boxes, leaves, shapes } = counts;
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

/// A path that is booked and recorded.
#[derive(Debug)]
pub struct BookedPath<'p> {
    /// What rays visited, by spawner and place.
    pairs: &'p mut [Pair],
    state: State<'p>,
}

impl BookedPath<'_> {
    /// Closes the path ([`PathRecorder::end`]).
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        self.state.path.end(end);
    }
}

/// A path, what is known of the ray that it is casting, and where they are booked but for visits.
#[derive(Debug)]
struct State<'p> {
    tree: Tree<'p>,
    /// What sent the ray.
    key: Key,
    /// Its instances and alpha tests; nothing between rays.
    rare: RareCounts,
    /// Slot of the instance that it is in; the scene's between rays.
    inside: Column,
    /// Whether there is anything in `rare`.
    special: bool,
    /// Nodes and blocks that it visited before its last instance; nothing between rays.
    before: [u64; 2],
    /// Slot of its last leaf block before that instance.
    block: Column,
    /// Where in [`Aside`] is kept how paths went on from the object that the path left last.
    left: usize,
    path: PathRecorder<'p>,
    payers: &'p Payers,
    aside: &'p mut Aside,
    bins: &'p mut Bins,
}

impl State<'_> {
    #[inline(always)]
    fn key_of(&self, spawner: Column, by: Spawner) -> Key {
        // Only shadow rays aim.
        let light = if by.light == NONE { 0 } else { self.payers.light(by.light) };
        Key::new(spawner, by.material, light, by.bounce, by.kind)
    }

    /// A visit of very many boxes, or beyond every row.
    #[cold]
    #[inline(never)]
    fn odd_visit(&mut self, id: u32, pair: usize, boxes: u32) {
        let spawner = self.key.object();
        let place = if pair == NODES { self.tree.node(id) } else { self.tree.block(id) };
        match place.filter(|place| usize::from(*place) < self.aside.row(0).end) {
            Some(place) => self.aside.odd_visits(spawner, place, [1, u64::from(boxes)]),
            None => {
                let triangles = if pair == LEAVES { self.payers.stray(id) } else { &[] };
                self.aside.visit_nowhere(spawner, pair, boxes, triangles);
            }
        }
    }

    /// Takes a full pair out of the spawner's row.
    #[cold]
    #[inline(never)]
    fn empty(&mut self, row: &mut [Pair], place: Place) {
        self.aside.odd_visits(self.key.object(), place, row[usize::from(place)].take());
    }

    /// The ray enters an instance, after so many visits of nodes and blocks since the last, `block` the last of them.
    #[inline(never)]
    fn enter(&mut self, row: &mut [Pair], id: u32, visits: [u32; 2], block: u32) {
        let spawner = self.key.object();
        self.block = self.slot_of_block(block);
        self.aside.leave(spawner, row, self.inside);
        self.inside = self.payers.instance(id);
        self.aside.instance(spawner, self.inside);
        self.rare[0] += 1;
        self.before[NODES] += u64::from(visits[NODES]);
        self.before[LEAVES] += u64::from(visits[LEAVES]);
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

    /// Books what few rays have, of one that ends: nodes and blocks before its last instance, and its instances.
    #[inline(never)]
    fn finish_special(&mut self, row: &mut [Pair]) -> [u64; 3] {
        let rare = std::mem::take(&mut self.rare);
        self.bins.add_rare(self.key, rare);
        if rare[0] > 0 {
            self.aside.leave(self.key.object(), row, self.inside);
            self.inside = 0;
        }
        self.special = false;
        self.block = 0;
        let [nodes, leaves] = std::mem::take(&mut self.before);
        [nodes, leaves, rare[0]]
    }
}

impl<'p> Probe for BookedPath<'p> {
    const ON: bool = true;
    type Ray<'r>
        = BookedRay<'r, 'p>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> BookedRay<'_, 'p> {
        let state = &mut self.state;
        let spawner = state.payers.slot(by.object);
        if by.kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            state.left = state.aside.landed(state.left, spawner);
        }
        state.path.untraced(by);
        state.key = state.key_of(spawner, by);
        let row = &mut self.pairs[state.aside.row(spawner)];
        let shadow = by.kind == RayKind::Shadow;
        BookedRay { state, row, nodes: 0, boxes: 0, leaves: 0, shapes: 0, block: NONE, shadow }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        let state = &mut self.state;
        state.path.untraced(by);
        let key = state.key_of(state.payers.slot(by.object), by);
        state.bins.add(key, &BinCounts { rays: 1, ..BinCounts::default() });
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.state.path.bsdf(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.state.path.texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.state.path.light(left, luminance);
    }
}

/// A ray that is booked and counted; it must be finished. What changes with each visit is held by value, so that it can stay
/// in registers; the rest stands in its path, since traversals may be calls and few words are handed over faster than many.
#[derive(Debug)]
pub struct BookedRay<'r, 'p> {
    state: &'r mut State<'p>,
    /// The spawner's row, by place.
    row: &'r mut [Pair],
    /// Visits, since it entered an instance, and boxes. Of two types, or else the compiler keeps both in one vector, which takes
    /// three times the instructions. No tree has as many as 2^32 nodes or blocks, and a ray visits each once.
    nodes: u32,
    boxes: u64,
    leaves: u32,
    shapes: u64,
    /// Its last leaf block since it entered an instance, [`NONE`] without one.
    block: u32,
    shadow: bool,
}

impl BookedRay<'_, '_> {
    #[inline(always)]
    fn visit(&mut self, id: u32, place: Option<Place>, pair: usize, boxes: u32) {
        if let Some(place) = place
            && let Some(sum) = self.row.get_mut(usize::from(place))
            && let Some(visit) = Pair::visit(boxes)
        {
            if sum.add(visit) {
                self.state.empty(self.row, place);
            }
        } else {
            self.state.odd_visit(id, pair, boxes);
        }
    }
}

impl RayProbe for BookedRay<'_, '_> {
    #[inline(always)]
    fn node(&mut self, id: u32, boxes: u32) {
        self.nodes = self.nodes.wrapping_add(1);
        self.boxes += u64::from(boxes);
        self.visit(id, self.state.tree.node(id), NODES, boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, id: u32, shapes: u32) {
        self.leaves = self.leaves.wrapping_add(1);
        self.shapes += u64::from(shapes);
        self.block = id;
        self.visit(id, self.state.tree.block(id), LEAVES, shapes);
    }

    #[inline(always)]
    fn instance(&mut self, id: u32) {
        let visits = [std::mem::take(&mut self.nodes), std::mem::take(&mut self.leaves)];
        let block = std::mem::replace(&mut self.block, NONE);
        self.state.enter(self.row, id, visits, block);
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.state.path.add_alpha(lookups, bytes);
        self.state.alpha_test(self.block);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        let Self { state, row, boxes, shapes, shadow, .. } = self;
        let (mut nodes, mut leaves, mut instances) = (u64::from(self.nodes), u64::from(self.leaves), 0);
        if state.special {
            let before = state.finish_special(row);
            (nodes, leaves, instances) = (nodes + before[NODES], leaves + before[LEAVES], before[2]);
        }
        state.path.add_traversal(shadow, [nodes, boxes, leaves, shapes, instances], hit);
        let blocked = if hit && shadow { nodes + shapes } else { 0 };
        let counts = BinCounts { rays: 1, hits: u64::from(hit), blocked, nodes, boxes, leaves, shapes };
        state.bins.add(state.key, &counts);
    }
}
