//! Who pays for what in a tree, as tables that a traversal can read at each visit.

use std::cmp::Reverse;

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
/// objects.
pub(super) type Slot = u32;

/// Stands for the instance that the ray is in.
const INSIDE: Slot = u32::MAX;
/// From here on: blocks of several objects, by their index in `mixed`.
const MIXED: Slot = 1 << 31;

/// Most slots: the matrix holds the square of it.
const MOST_SLOTS: usize = 1024;
/// Most objects that are lights of their own in the spawner ledger.
const MOST_LIGHTS: usize = 64;

/// The tables.
#[derive(Clone, Debug, Default)]
pub struct Payers {
    nodes: Vec<Slot>,
    blocks: Vec<Slot>,
    /// Slots of the triangles of blocks with several objects.
    mixed: Vec<Vec<Slot>>,
    instances: Vec<Slot>,
    /// By object.
    slots: Vec<Slot>,
    /// By object, as a light.
    lights: Vec<Slot>,
    /// Object of each slot from 1 on; `slots.len()` for the entry that several share.
    objects: Vec<u32>,
    merged: u64,
}

/// How a leaf block is booked.
pub(super) enum BlockSlot<'a> {
    One(Slot),
    /// One by one.
    Triangles(&'a [Slot]),
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
        let shared = 1 + own as Slot;
        let mut slots = vec![shared; count];
        for (index, object) in objects.iter().enumerate() {
            slots[*object as usize] = 1 + index as Slot;
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
        let mut mixed = Vec::new();
        let nodes = desc
            .nodes
            .iter()
            .map(|payer| match payer {
                Payer::Object(object) => of(*object),
                Payer::Scene(_) => 0,
                Payer::Instance => INSIDE,
            })
            .collect();
        let blocks = desc
            .blocks
            .iter()
            .map(|payer| match payer {
                Payer::Object(object) => of(*object),
                Payer::Scene(triangles) => {
                    mixed.push(triangles.iter().map(|object| of(*object)).collect());
                    MIXED + mixed.len() as Slot - 1
                }
                Payer::Instance => INSIDE,
            })
            .collect();
        let instances = desc.instances.iter().map(|object| of(*object)).collect();
        Self { nodes, blocks, mixed, instances, lights, objects, merged: (count - own) as u64, slots }
    }

    /// Slots, the scene's and the shared one included.
    pub(super) const fn count(&self) -> usize {
        self.objects.len() + 1
    }

    /// How many objects share an entry.
    pub(super) const fn merged(&self) -> u64 {
        self.merged
    }

    /// The object of a slot: `None` for slot 0, the number of objects for the shared one.
    pub(super) fn object(&self, slot: Slot) -> Option<u32> {
        self.objects.get((slot as usize).checked_sub(1)?).copied()
    }

    /// The slot of an object, 0 for none.
    #[inline(always)]
    pub(super) fn slot(&self, object: u32) -> Slot {
        self.slots.get(object as usize).copied().unwrap_or(0)
    }

    /// The slot of an object as a light, 0 for none.
    #[inline(always)]
    pub(super) fn light(&self, object: u32) -> Slot {
        self.lights.get(object as usize).copied().unwrap_or(0)
    }

    /// The slot of a node; `inside`: of the instance that the ray is in.
    #[inline(always)]
    pub(super) fn node(&self, id: u32, inside: Slot) -> Slot {
        match self.nodes.get(id as usize) {
            Some(&INSIDE) => inside,
            Some(&slot) => slot,
            None => 0,
        }
    }

    /// The slot of a leaf block.
    #[inline(always)]
    pub(super) fn block(&self, id: u32, inside: Slot) -> BlockSlot<'_> {
        match self.blocks.get(id as usize) {
            Some(&INSIDE) => BlockSlot::One(inside),
            Some(&slot) if slot < MIXED => BlockSlot::One(slot),
            Some(&slot) => BlockSlot::Triangles(&self.mixed[(slot - MIXED) as usize]),
            None => BlockSlot::One(0),
        }
    }

    /// The slot of an instance.
    #[inline(always)]
    pub(super) fn instance(&self, id: u32) -> Slot {
        self.instances.get(id as usize).copied().unwrap_or(0)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let words = self.nodes.len()
            + self.blocks.len()
            + self.instances.len()
            + self.slots.len()
            + self.lights.len();
        (4 * words + self.mixed.iter().map(|m| size_of::<Vec<Slot>>() + 4 * m.len()).sum::<usize>()) as u64
    }
}
