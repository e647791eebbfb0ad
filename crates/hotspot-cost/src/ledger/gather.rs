//! Booking rays while they are traced: a probe around the recorder's.
//!
//! Each worker has a [`Ledger`] of its own and merges it in the end; sums of integers do not depend on the order. What a
//! visit costs: one look-up of the payer, one row of the matrix to add to; the spawner is booked once per ray.

use super::bins::{Bins, Key};
use super::payers::{BlockSlot, Payers, Slot};
use super::rows::{Ledgers, MatrixRow, PayerRow, SpawnerRow, Traversal};
use crate::recorder::{PathEnd, PathRecorder, RayCounter};
use hotspot_probe::{NONE, Probe, RayKind, RayProbe, Spawner};
use std::collections::BTreeMap;

/// Nodes, boxes, leaves, shapes.
type Cell = [u64; 4];
/// Instances, alpha tests, paths that went on: where there are any.
type RareCell = [u64; 3];

/// The sums of one worker.
#[derive(Clone, Debug)]
pub struct Ledger {
    slots: usize,
    /// `slots` × `slots`, a row for each spawning object.
    cells: Vec<Cell>,
    /// The same for what few scenes have.
    rare: Vec<RareCell>,
    bins: Bins,
}

impl Ledger {
    /// Empty sums for a scene of these payers.
    pub fn new(payers: &Payers) -> Self {
        let slots = payers.count();
        // Zeroed pages take memory only when touched.
        Self {
            slots,
            cells: vec![[0; 4]; slots * slots],
            rare: vec![[0; 3]; slots * slots],
            bins: Bins::new(),
        }
    }

    /// Books a path as well as recording it. To be ended ([`BookedPath::end`]): paths that are not would be in the ledgers but
    /// not in the frame.
    #[inline(always)]
    pub const fn path<'p>(&'p mut self, payers: &'p Payers, path: PathRecorder<'p>) -> BookedPath<'p> {
        BookedPath { path, payers, ledger: self, left: 0 }
    }

    /// Adds the sums of another worker of the same scene.
    ///
    /// # Panics
    /// When the other is of a scene of another number of objects.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.slots, other.slots, "ledgers of different scenes");
        for (sums, counts) in self.cells.iter_mut().zip(&other.cells) {
            // Most are empty: they are not written to, so that they take no memory.
            if *counts != [0; 4] {
                for (sum, count) in sums.iter_mut().zip(counts) {
                    *sum += count;
                }
            }
        }
        for (sums, counts) in self.rare.iter_mut().zip(&other.rare) {
            if *counts != [0; 3] {
                for (sum, count) in sums.iter_mut().zip(counts) {
                    *sum += count;
                }
            }
        }
        self.bins.merge(&other.bins);
    }

    /// Bytes that may be touched.
    pub fn memory(&self) -> u64 {
        (size_of_val(self.cells.as_slice()) + size_of_val(self.rare.as_slice()) + self.bins.memory()) as u64
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
            .map(|(key, &[rays, hits, blocked, nodes, boxes, leaves, shapes, instances, alpha_tests])| {
                SpawnerRow {
                    object: payers.object(key.object),
                    material: (key.material != NONE).then_some(key.material),
                    bounce: key.bounce(),
                    kind: key.kind().into(),
                    light: payers.object(key.light),
                    rays,
                    hits,
                    blocked,
                    traversal: Traversal { nodes, boxes, leaves, shapes, instances, alpha_tests },
                }
            })
            .collect();
        let mut paid: BTreeMap<usize, Traversal> = BTreeMap::new();
        for (index, (&[nodes, boxes, leaves, shapes], &[instances, alpha_tests, landed])) in
            self.cells.iter().zip(&self.rare).enumerate()
        {
            let traversal = Traversal { nodes, boxes, leaves, shapes, instances, alpha_tests };
            if traversal == Traversal::default() && landed == 0 {
                continue;
            }
            let (spawner, payer) = (index / self.slots, index % self.slots);
            paid.entry(payer).or_default().add(&traversal);
            let [spawner, payer] = [spawner, payer].map(|slot| payers.object(slot as Slot));
            ledgers.matrix.push(MatrixRow { spawner, payer, others: false, landed, traversal });
        }
        ledgers.payer = paid
            .into_iter()
            .filter(|(_, traversal)| *traversal != Traversal::default())
            .map(|(payer, traversal)| PayerRow { object: payers.object(payer as Slot), traversal })
            .collect();
        ledgers.finish();
        ledgers
    }
}

/// A path that is booked and recorded.
#[derive(Debug)]
pub struct BookedPath<'p> {
    path: PathRecorder<'p>,
    payers: &'p Payers,
    ledger: &'p mut Ledger,
    /// Slot of the object that the path left last.
    left: Slot,
}

impl BookedPath<'_> {
    /// Closes the path ([`PathRecorder::end`]).
    #[inline(always)]
    pub fn end(self, end: PathEnd) {
        self.path.end(end);
    }
}

impl Probe for BookedPath<'_> {
    const ON: bool = true;
    type Ray<'r>
        = BookedRay<'r>
    where
        Self: 'r;

    #[inline(always)]
    fn ray(&mut self, by: Spawner) -> BookedRay<'_> {
        let spawner = self.payers.slot(by.object);
        let start = spawner as usize * self.ledger.slots;
        let Ledger { slots, cells, rare, bins } = &mut *self.ledger;
        if by.kind == RayKind::Bounce {
            // The path is where it leaves from: its last ray but for shadow rays has landed there.
            rare[self.left as usize * *slots + spawner as usize][2] += 1;
            self.left = spawner;
        }
        BookedRay {
            counter: self.path.ray(by),
            payers: self.payers,
            row: &mut cells[start..start + *slots],
            rare: &mut rare[start..start + *slots],
            bins,
            key: Key::new(spawner, by.material, self.payers.light(by.light), by.bounce, by.kind),
            inside: 0,
            block: 0,
            alpha_tests: 0,
        }
    }

    #[inline(always)]
    fn untraced(&mut self, by: Spawner) {
        self.path.untraced(by);
        let object = self.payers.slot(by.object);
        let key = Key::new(object, by.material, self.payers.light(by.light), by.bounce, by.kind);
        self.ledger.bins.add(key, &[1, 0, 0, 0, 0, 0, 0, 0, 0]);
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

/// A ray that is booked and counted.
#[derive(Debug)]
pub struct BookedRay<'r> {
    counter: RayCounter<'r>,
    payers: &'r Payers,
    /// Of the spawning object.
    row: &'r mut [Cell],
    rare: &'r mut [RareCell],
    bins: &'r mut Bins,
    key: Key,
    /// Slot of the instance that the ray is in.
    inside: Slot,
    /// Slot of the last leaf block.
    block: Slot,
    alpha_tests: u64,
}

impl BookedRay<'_> {
    #[cold]
    #[inline(never)]
    fn one_by_one(&mut self, triangles: &[Slot]) {
        for slot in triangles {
            self.row[*slot as usize][3] += 1;
        }
    }
}

impl RayProbe for BookedRay<'_> {
    #[inline(always)]
    fn node(&mut self, id: u32, boxes: u32) {
        self.counter.node(id, boxes);
        let cell = &mut self.row[self.payers.node(id, self.inside) as usize];
        cell[0] += 1;
        cell[1] += u64::from(boxes);
    }

    #[inline(always)]
    fn leaf(&mut self, id: u32, shapes: u32) {
        self.counter.leaf(id, shapes);
        match self.payers.block(id, self.inside) {
            BlockSlot::One(slot) => {
                self.block = slot;
                let cell = &mut self.row[slot as usize];
                cell[2] += 1;
                cell[3] += u64::from(shapes);
            }
            BlockSlot::Triangles(triangles) => {
                self.block = 0;
                self.row[0][2] += 1;
                self.one_by_one(triangles);
            }
        }
    }

    #[inline(always)]
    fn instance(&mut self, id: u32) {
        self.counter.instance(id);
        self.inside = self.payers.instance(id);
        self.rare[self.inside as usize][0] += 1;
    }

    #[inline(always)]
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.counter.alpha(lookups, bytes);
        self.alpha_tests += 1;
        self.rare[self.block as usize][1] += 1;
    }

    #[inline(always)]
    fn finish(self, hit: bool) {
        let [nodes, boxes, leaves, shapes, instances] = self.counter.so_far();
        let blocked = if hit && self.counter.is_shadow() { nodes + shapes } else { 0 };
        self.counter.finish(hit);
        let counts = [1, u64::from(hit), blocked, nodes, boxes, leaves, shapes, instances, self.alpha_tests];
        self.bins.add(self.key, &counts);
    }
}
