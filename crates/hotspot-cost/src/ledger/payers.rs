//! Who pays for what in a tree, as tables that a traversal can read at each visit.

use super::bins::{Aim, RayKey, Sender};
use hotspot_probe::{NONE, Spawner};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Whose triangles lie below a node or in a leaf block, as the renderer that knows the tree says it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Payer {
    /// All of one object.
    Object(u32),
    /// Of several; for leaf blocks the object of each triangle.
    Scene(Vec<u32>),
    /// Of whatever instance the ray is in.
    Instance,
}

/// What the ledgers of a scene need to know of it.
#[derive(Clone, Debug, Default)]
pub struct PayerDesc {
    /// By node id.
    pub nodes: Vec<Payer>,
    /// By leaf block id.
    pub blocks: Vec<Payer>,
    /// Object of each instance.
    pub instances: Vec<u32>,
    /// Triangles of each object; its length is the number of objects.
    pub triangles: Vec<u64>,
    /// Objects that shadow rays may aim at.
    pub lights: Vec<u32>,
}

/// The entry of the ledgers that a node, a block or an object is booked on: 0 for the scene (or the camera), 1 and more for
/// objects; above these, in tables of blocks, sets of objects.
pub(super) type Column = u16;

/// Where in a spawner's row a visit is booked: twice the column for nodes, one more for leaf blocks. What the tables of a tree
/// hold, so that a visit need not reckon.
pub(super) type Place = u16;

/// Beyond every row: blocks of several objects without a column, which are in `strays`.
pub(super) const NOWHERE: Place = Place::MAX;

/// Most slots: the matrix holds the square of it.
const MOST_SLOTS: usize = 1024;
/// Most objects that are lights of their own in the spawner ledger.
const MOST_LIGHTS: usize = 64;
/// Most sets of objects that have a column: those of the most blocks.
const MOST_SETS: usize = 1024;

const fn node_place(column: Column) -> Place {
    column << 1
}

const fn block_place(column: Column) -> Place {
    column << 1 | 1
}

/// Objects (by slot) with how many triangles each has in a block.
type Set = Vec<(Column, u64)>;

/// The tables.
#[derive(Clone, Debug, Default)]
pub struct Payers {
    nodes: Vec<Place>,
    blocks: Vec<Place>,
    /// Blocks with several objects, by column above the slots.
    sets: Vec<Set>,
    /// Slots of the triangles of blocks with several objects and no column.
    strays: BTreeMap<u32, Vec<Column>>,
    instances: Vec<Column>,
    /// By object.
    slots: Vec<Column>,
    /// By object, as a light.
    lights: Vec<Column>,
    /// Object of each slot from 1 on; `slots.len()` for the entry that several share.
    objects: Vec<u32>,
    merged: u64,
}

impl Payers {
    /// The tables of a scene. Of more than 1022 objects those with the fewest triangles share an entry; as lights aimed at,
    /// those beyond 64 emitters do.
    pub fn new(desc: &PayerDesc) -> Self {
        let count = desc.triangles.len();
        let mut order: Vec<u32> = (0..count as u32).collect();
        // One slot for the scene, one for those that share.
        let own = if count < MOST_SLOTS {
            count
        } else {
            order.sort_by_key(|object| (Reverse(desc.triangles[*object as usize]), *object));
            MOST_SLOTS - 2
        };
        let mut objects = order[..own].to_vec();
        objects.sort_unstable();
        let shared = 1 + own as Column;
        let mut slots = vec![shared; count];
        for (index, object) in objects.iter().enumerate() {
            slots[*object as usize] = 1 + index as Column;
        }
        let mut lights = vec![shared; count];
        for object in desc.lights.iter().take(MOST_LIGHTS) {
            if let (Some(light), Some(slot)) = (lights.get_mut(*object as usize), slots.get(*object as usize))
            {
                *light = *slot;
            }
        }
        objects.push(count as u32);
        let of = |object: u32| slots.get(object as usize).copied().unwrap_or(shared);
        let set_of = |triangles: &[u32]| {
            let mut set: BTreeMap<Column, u64> = BTreeMap::new();
            for object in triangles {
                *set.entry(of(*object)).or_default() += 1;
            }
            set.into_iter().collect::<Set>()
        };
        let mut blocks_of: BTreeMap<Set, u64> = BTreeMap::new();
        for payer in &desc.blocks {
            if let Payer::Scene(triangles) = payer {
                *blocks_of.entry(set_of(triangles)).or_default() += 1;
            }
        }
        let mut sets: Vec<(Reverse<u64>, Set)> =
            blocks_of.into_iter().map(|(set, blocks)| (Reverse(blocks), set)).collect();
        sets.sort_unstable();
        sets.truncate(MOST_SETS);
        let sets: Vec<Set> = sets.into_iter().map(|(_, set)| set).collect();
        let first_set = shared + 1;
        let columns: BTreeMap<&Set, Column> = sets.iter().zip(first_set..).collect();
        let inside = first_set + sets.len() as Column;
        let nodes = desc
            .nodes
            .iter()
            .map(|payer| match payer {
                Payer::Object(object) => node_place(of(*object)),
                Payer::Scene(_) => node_place(0),
                Payer::Instance => node_place(inside),
            })
            .collect();
        let mut strays = BTreeMap::new();
        let blocks = desc
            .blocks
            .iter()
            .zip(0..)
            .map(|(payer, id)| match payer {
                Payer::Object(object) => block_place(of(*object)),
                Payer::Scene(triangles) => match columns.get(&set_of(triangles)) {
                    Some(column) => block_place(*column),
                    None => {
                        strays.insert(id, triangles.iter().map(|object| of(*object)).collect());
                        NOWHERE
                    }
                },
                Payer::Instance => block_place(inside),
            })
            .collect();
        let instances = desc.instances.iter().map(|object| of(*object)).collect();
        Self { nodes, blocks, sets, strays, instances, lights, objects, merged: (count - own) as u64, slots }
    }

    /// Slots, the scene's and the shared one included.
    pub(super) const fn count(&self) -> usize {
        self.objects.len() + 1
    }

    /// Columns of the matrix: slots, then sets of objects, then the one of [`Self::inside`].
    pub(super) const fn columns(&self) -> usize {
        self.count() + self.sets.len() + 1
    }

    /// The column where visits of the instance that a ray is in stay until it leaves that.
    pub(super) const fn inside(&self) -> usize {
        self.count() + self.sets.len()
    }

    /// The objects of a set's column, with their triangles in each block.
    pub(super) fn set(&self, column: usize) -> &[(Column, u64)] {
        column.checked_sub(self.count()).and_then(|set| self.sets.get(set)).map_or(&[][..], Vec::as_slice)
    }

    /// The slot that pays for what happens in a block at a place, of a ray that is in the instance of slot `inside`: for blocks
    /// of several objects the scene.
    pub(super) fn slot_of_block(&self, place: Option<Place>, inside: Column) -> Column {
        match place.map(|place| place >> 1) {
            Some(column) if usize::from(column) < self.count() => column,
            Some(column) if usize::from(column) == self.inside() => inside,
            _ => 0,
        }
    }

    /// How many objects share an entry.
    pub(super) const fn merged(&self) -> u64 {
        self.merged
    }

    /// The object of a slot: `None` for slot 0, the number of objects for the shared one.
    pub(super) fn object(&self, slot: Column) -> Option<u32> {
        self.objects.get((slot as usize).checked_sub(1)?).copied()
    }

    /// The slot of an object, 0 for none.
    #[inline(always)]
    pub(super) fn slot(&self, object: u32) -> Column {
        self.slots.get(object as usize).copied().unwrap_or(0)
    }

    /// The slot of an object as a light, 0 for none.
    #[inline(always)]
    pub(super) fn light(&self, object: u32) -> Column {
        self.lights.get(object as usize).copied().unwrap_or(0)
    }

    /// What sends rays from an object with a material ([`hotspot_probe::NONE`]: the camera).
    #[inline(always)]
    pub fn sender(&self, object: u32, material: u32) -> Sender {
        Sender::new(self.slot(object), material)
    }

    /// What shadow rays to an object are aimed at.
    #[inline(always)]
    pub fn aim(&self, light: u32) -> Aim {
        Aim::new(self.light(light))
    }

    /// What a ray is booked on.
    #[inline(always)]
    pub(super) fn key(&self, by: Spawner) -> RayKey {
        // Only shadow rays aim.
        let aim = if by.light == NONE { Aim::NONE } else { self.aim(by.light) };
        RayKey::new(self.sender(by.object, by.material), aim, by.bounce, by.kind)
    }

    /// The tables that each visit reads.
    #[inline(always)]
    pub(super) fn tree(&self) -> Tree<'_> {
        Tree { nodes: &self.nodes, blocks: &self.blocks }
    }

    /// The slots of a block's triangles, where it has no column.
    pub(super) fn stray(&self, id: u32) -> &[Column] {
        self.strays.get(&id).map_or(&[][..], Vec::as_slice)
    }

    /// The slot of an instance.
    #[inline(always)]
    pub(super) fn instance(&self, id: u32) -> Column {
        self.instances.get(id as usize).copied().unwrap_or(0)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let words = self.nodes.len()
            + self.blocks.len()
            + self.instances.len()
            + self.slots.len()
            + self.lights.len()
            + self.strays.values().map(Vec::len).sum::<usize>();
        let sets: usize = self.sets.iter().map(|set| size_of_val(set.as_slice())).sum();
        (size_of::<Column>() * words + sets) as u64
    }
}

/// Places of nodes and blocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tree<'a> {
    nodes: &'a [Place],
    blocks: &'a [Place],
}

impl Tree<'_> {
    /// The place of a node, `None` for one that does not exist.
    #[inline(always)]
    pub(super) fn node(&self, id: u32) -> Option<Place> {
        self.nodes.get(id as usize).copied()
    }

    /// The place of a leaf block, `None` for one that does not exist; beyond every row where its triangles are to be booked one
    /// by one ([`Payers::stray`]).
    #[inline(always)]
    pub(super) fn block(&self, id: u32) -> Option<Place> {
        self.blocks.get(id as usize).copied()
    }
}
