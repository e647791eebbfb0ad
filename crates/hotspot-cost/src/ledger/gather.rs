//! Booking rays while they are traced: a probe that records paths too.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of its place, one addition there, one to the ray's own sum; the spawner is booked once per ray. Visits
//! inside an instance are added in a place of their own, and moved to the instance's when the ray leaves it: so no visit has to ask.

use super::bins::{BinCounts, Bins, Key, RareCounts};
use super::cells::{Aside, Cells, LEAVES, NODES, PAIRS, Pair};
use super::payers::{Column, Payers, Place, Tree};
use super::rows::{Ledgers, MatrixRow, PayerRow, SpawnerRow, Traversal};
use crate::recorder::{PathCounts, PathEnd, PixelVisit};
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

    /// Books the paths of a visit of a pixel as well as recording them.
    #[inline(always)]
    pub fn visit<'p>(&'p mut self, payers: &'p Payers, pixel: PixelVisit<'p>) -> BookedVisit<'p> {
        let (pairs, aside) = self.cells.parts();
        BookedVisit {
            pairs,
            state: State {
                tree: payers.tree(),
                visits: [Pair::NOTHING; PAIRS],
                key: Key::new(0, NONE, 0, 0, RayKind::Camera),
                special: false,
                sums: [[Pair::NOTHING; PAIRS]; 3],
                left: 0,
                rare: [0; 2],
                inside: 0,
                before: [[0; 2]; PAIRS],
                block: 0,
                payers,
                aside,
                bins: &mut self.bins,
                pixel,
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
    pairs: &'p mut [Pair],
    state: State<'p>,
}

/// All that a path and a ray change but for the pairs, behind one address.
#[derive(Debug)]
struct State<'p> {
    tree: Tree<'p>,
    /// What the ray visited since it entered an instance: nodes with boxes, leaf blocks with shapes.
    visits: [Pair; PAIRS],
    /// What sent the ray.
    key: Key,
    /// Whether there is anything in `rare` or `before`.
    special: bool,
    /// Visits of the path's rays that have ended: of camera and bounce rays, of shadow rays, of blocked shadow rays.
    sums: [[Pair; PAIRS]; 3],
    /// Where in [`Aside`] is kept how paths went on from the object that the path left last.
    left: usize,
    /// The ray's instances and alpha tests; nothing between rays.
    rare: RareCounts,
    /// Slot of the instance that it is in; the scene's between rays.
    inside: Column,
    /// What it visited before its last instance, and what `visits` cannot hold; nothing between rays.
    before: [[u64; 2]; PAIRS],
    /// Slot of its last leaf block before that instance.
    block: Column,
    payers: &'p Payers,
    aside: &'p mut Aside,
    bins: &'p mut Bins,
    /// Has all other counts.
    pixel: PixelVisit<'p>,
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

impl State<'_> {
    #[inline(always)]
    fn counts(&mut self) -> &mut PathCounts {
        self.pixel.path()
    }

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
        self.before[pair][0] += 1;
        self.before[pair][1] += u64::from(boxes);
        self.special = true;
    }

    /// Takes a full pair out of the spawner's row.
    #[cold]
    #[inline(never)]
    fn empty(&mut self, row: &mut [Pair], place: Place) {
        self.aside.odd_visits(self.key.object(), place, row[usize::from(place)].take());
    }

    /// Takes the ray's visits of nodes or leaf blocks out of their pair.
    #[inline(never)]
    fn keep_apart(&mut self, pair: usize) {
        let [visits, boxes] = self.visits[pair].take();
        self.before[pair][0] += visits;
        self.before[pair][1] += boxes;
        self.special = true;
    }

    /// The ray enters an instance after `block`, the last that it visited since another.
    #[inline(never)]
    fn enter(&mut self, row: &mut [Pair], id: u32, block: u32) {
        let spawner = self.key.object();
        self.block = self.slot_of_block(block);
        self.aside.leave(spawner, row, self.inside);
        self.inside = self.payers.instance(id);
        self.aside.instance(spawner, self.inside);
        self.rare[0] += 1;
        self.keep_apart(NODES);
        self.keep_apart(LEAVES);
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

    /// Books a ray that has ended, and all of whose visits are in their pairs.
    #[inline(always)]
    fn finish(&mut self, shadow: bool, hit: bool) {
        let (visits, blocked) = (self.visits, hit && shadow);
        self.bins.add_ray(self.key, hit, visits, blocked);
        let kind = usize::from(shadow);
        let mut full = false;
        for (pair, visits) in visits.into_iter().enumerate() {
            full |= self.sums[kind][pair].add(visits);
            if blocked {
                full |= self.sums[BLOCKED][pair].add(visits);
            }
        }
        if full {
            self.count_sums();
        }
    }

    /// Books a ray that has ended, with what few rays have.
    #[inline(never)]
    fn finish_special(&mut self, row: &mut [Pair], shadow: bool, hit: bool) {
        let rare = std::mem::take(&mut self.rare);
        self.bins.add_rare(self.key, rare);
        self.counts().add_instances(shadow, rare[0]);
        if rare[0] > 0 {
            self.aside.leave(self.key.object(), row, self.inside);
            self.inside = 0;
        }
        self.block = 0;
        self.keep_apart(NODES);
        self.keep_apart(LEAVES);
        self.special = false;
        let [nodes, leaves] = std::mem::take(&mut self.before);
        if let (Some(nodes), Some(leaves)) = (Pair::of(nodes), Pair::of(leaves)) {
            self.visits = [nodes, leaves];
            return self.finish(shadow, hit);
        }
        let blocked = hit && shadow;
        self.counts().add_visits(shadow, nodes, leaves);
        if blocked {
            self.counts().add_blocked(nodes[0], leaves[1]);
        }
        let counts = BinCounts {
            rays: 1,
            hits: hit.into(),
            blocked: if blocked { nodes[0] + leaves[1] } else { 0 },
            nodes: nodes[0],
            boxes: nodes[1],
            leaves: leaves[0],
            shapes: leaves[1],
        };
        self.bins.add_wide(self.key, &counts);
    }

    /// Moves the path's sums of visits to its counts.
    fn count_sums(&mut self) {
        let Self { sums, pixel, .. } = self;
        let counts = pixel.path();
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
        state.pixel.end(end);
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
        let BookedVisit { pairs, state } = &mut *self.visit;
        let spawner = state.payers.slot(by.object);
        if by.kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            state.left = state.aside.landed(state.left, spawner);
        }
        state.counts().untraced(by);
        state.key = state.key_of(spawner, by);
        state.visits = [Pair::NOTHING; PAIRS];
        let row = &mut pairs[state.aside.row(spawner)];
        BookedRay { state, row, block: NONE, shadow: by.kind == RayKind::Shadow }
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
pub struct BookedRay<'r, 'p> {
    state: &'r mut State<'p>,
    /// The spawner's row, by place.
    row: &'r mut [Pair],
    /// Its last leaf block since it entered an instance, [`NONE`] without one.
    block: u32,
    shadow: bool,
}

impl BookedRay<'_, '_> {
    #[inline(always)]
    fn visit(&mut self, id: u32, place: Option<Place>, pair: usize, boxes: u32) {
        if let Some(visit) = Pair::visit(boxes)
            && let Some(place) = place
            && let Some(sum) = self.row.get_mut(usize::from(place))
        {
            if sum.add(visit) {
                self.state.empty(self.row, place);
            }
            if self.state.visits[pair].add(visit) {
                self.state.keep_apart(pair);
            }
        } else {
            self.state.odd_visit(id, pair, boxes);
        }
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
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.state.alpha_test(self.block, lookups, bytes);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        if self.state.special {
            self.state.finish_special(self.row, self.shadow, hit);
        } else {
            self.state.finish(self.shadow, hit);
        }
    }
}
