//! Booking rays while they are traced: a probe around the recorder's.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of its column, one addition; the spawner is booked once per ray.

use super::bins::{BinCounts, Bins, Key, RareCounts};
use super::cells::{Aside, Cell, Cells, LEAVES, NODES, Pair};
use super::payers::{Column, Payers, Tree};
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
        let (cells, aside) = self.cells.parts();
        BookedPath {
            tree: payers.tree(),
            cells,
            start: 0,
            sums: [Pair::NOTHING; 2],
            rare: [0; 2],
            key: Key::new(0, NONE, 0, 0, RayKind::Camera),
            inside: 0,
            block: 0,
            left: 0,
            odd: false,
            odd_sums: [[0; 2]; 2],
            path,
            payers,
            aside,
            bins: &mut self.bins,
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

/// A path that is booked and recorded, and the ray that it is casting.
#[derive(Debug)]
pub struct BookedPath<'p> {
    tree: Tree<'p>,
    cells: &'p mut [Cell],
    /// Index of the first cell of the spawner of the ray.
    start: usize,
    /// Visits of the ray.
    sums: [Pair; 2],
    /// Its instances and alpha tests.
    rare: RareCounts,
    /// What sent it.
    key: Key,
    /// Slot of the instance that it is in.
    inside: Column,
    /// Column of its last leaf block.
    block: Column,
    /// Slot of the object that the path left last.
    left: Column,
    /// Whether there is anything in `odd_sums`: visits that `sums` cannot hold.
    odd: bool,
    odd_sums: [[u64; 2]; 2],
    path: PathRecorder<'p>,
    payers: &'p Payers,
    aside: &'p mut Aside,
    bins: &'p mut Bins,
}

impl BookedPath<'_> {
    /// Closes the path ([`PathRecorder::end`]).
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        self.path.end(end);
    }

    #[inline(always)]
    fn visit(&mut self, column: Column, pair: usize, boxes: u32) {
        let cell = self.start + usize::from(column);
        let Some(visit) = Pair::visit(boxes) else {
            self.aside.odd_visit(cell, pair, boxes);
            return self.odd_visit(pair, [1, u64::from(boxes)]);
        };
        let sum = &mut self.cells[cell][pair];
        if sum.add(visit) {
            self.aside.empty(cell, pair, sum);
        }
        if self.sums[pair].add(visit) {
            let full = self.sums[pair].take();
            self.odd_visit(pair, full);
        }
    }

    #[cold]
    #[inline(never)]
    fn odd_visit(&mut self, pair: usize, [visits, boxes]: [u64; 2]) {
        self.odd = true;
        self.odd_sums[pair][0] += visits;
        self.odd_sums[pair][1] += boxes;
    }

    /// The ray's nodes with their boxes, and leaf blocks with their triangles.
    #[inline(always)]
    fn sums(&mut self) -> [[u64; 2]; 2] {
        let mut sums = self.sums.map(Pair::split);
        if self.odd {
            let odd = std::mem::take(&mut self.odd_sums);
            sums = [NODES, LEAVES].map(|pair| [sums[pair][0] + odd[pair][0], sums[pair][1] + odd[pair][1]]);
            self.odd = false;
        }
        sums
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
        let spawner = self.payers.slot(by.object);
        if by.kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            self.aside.landed(self.left, spawner);
            self.left = spawner;
        }
        self.path.untraced(by);
        self.start = self.aside.start(spawner);
        self.sums = [Pair::NOTHING; 2];
        self.rare = [0; 2];
        self.key = Key::new(spawner, by.material, self.payers.light(by.light), by.bounce, by.kind);
        self.inside = 0;
        self.block = 0;
        BookedRay { path: self }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.path.untraced(by);
        let object = self.payers.slot(by.object);
        let key = Key::new(object, by.material, self.payers.light(by.light), by.bounce, by.kind);
        self.bins.add(key, &BinCounts { rays: 1, ..BinCounts::default() }, [0; 2]);
    }

    #[inline(always)]
    fn bsdf(&mut self, evaluations: u32) {
        self.path.bsdf(evaluations);
    }

    #[inline(always)]
    fn texture(&mut self, lookups: u32, bytes: u32) {
        self.path.texture(lookups, bytes);
    }

    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        self.path.light(left, luminance);
    }
}

/// A ray that is booked and counted. All of it stands in its path: traversals are calls, and one address is handed over faster
/// than twenty words.
#[derive(Debug)]
pub struct BookedRay<'r, 'p> {
    path: &'r mut BookedPath<'p>,
}

impl RayProbe for BookedRay<'_, '_> {
    #[inline(always)]
    fn node(&mut self, id: u32, boxes: u32) {
        let column = self.path.tree.node(id, self.path.inside);
        self.path.visit(column, NODES, boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, id: u32, shapes: u32) {
        let path = &mut *self.path;
        match path.tree.block(id, path.inside) {
            Some(column) => {
                path.block = column;
                path.visit(column, LEAVES, shapes);
            }
            None => {
                path.block = 0;
                path.aside.stray_visit(path.start, path.payers.stray(id));
                path.odd_visit(LEAVES, [1, u64::from(shapes)]);
            }
        }
    }

    #[inline(always)]
    fn instance(&mut self, id: u32) {
        let path = &mut *self.path;
        path.inside = path.payers.instance(id);
        path.rare[0] += 1;
        path.aside.instance(path.key.object(), path.inside);
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        let path = &mut *self.path;
        path.path.add_alpha(lookups, bytes);
        path.rare[1] += 1;
        // Blocks of several objects are the scene's.
        let payer = if path.payers.is_slot(path.block) { path.block } else { 0 };
        path.aside.alpha_test(path.key.object(), payer);
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        let path = self.path;
        let [[nodes, boxes], [leaves, shapes]] = path.sums();
        let shadow = path.key.kind() == RayKind::Shadow;
        path.path.add_traversal(shadow, [nodes, boxes, leaves, shapes, path.rare[0]], hit);
        let blocked = if hit && shadow { nodes + shapes } else { 0 };
        let counts = BinCounts { rays: 1, hits: u64::from(hit), blocked, nodes, boxes, leaves, shapes };
        path.bins.add(path.key, &counts, path.rare);
    }
}
