//! The 8-wide tree in memory.

use crate::simd::F8;

impl Default for Child {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// Points to a child: a leaf block, an instance, or another node. Blocks and instances are leaves.
///
/// From the top: whether it is a leaf, whether an instance, 27 bits of index, and in three bits how many boxes the node or triangles the
/// block has, less one: so a traversal that counts need not ask what it visits. The number stands below the index, so that words
/// are in the order of kinds and indices, by which ties between equally near children are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(pub(crate) u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// An unused slot; its box is inside out, so no ray enters it.
    pub(crate) const EMPTY: Self = Self(u32::MAX);
    const INSTANCE: u32 = 1 << 30;
    /// Bits of the number.
    const NUMBER_BITS: u32 = 3;
    const NUMBER: u32 = (1 << Self::NUMBER_BITS) - 1;
    /// Indices below this fit into a child.
    pub(crate) const LIMIT: u32 = (Self::INSTANCE >> Self::NUMBER_BITS) - 1;

    /// A block of so many triangles, 1 to 8.
    pub(crate) const fn leaf(block: u32, triangles: u32) -> Self {
        Self(Self::LEAF | Self::numbered(block, triangles))
    }

    /// A node of so many children, 1 to 8.
    pub(crate) const fn node(node: u32, children: u32) -> Self {
        Self(Self::numbered(node, children))
    }

    /// An instance, which has no number.
    pub(crate) const fn instance(instance: u32) -> Self {
        Self(Self::LEAF | Self::INSTANCE | instance << Self::NUMBER_BITS)
    }

    const fn numbered(index: u32, number: u32) -> u32 {
        debug_assert!(index < Self::LIMIT && number >= 1 && number <= Self::NUMBER + 1);
        index << Self::NUMBER_BITS | ((number - 1) & Self::NUMBER)
    }

    #[inline(always)]
    pub(crate) const fn is_instance(self) -> bool {
        self.0 & Self::INSTANCE != 0
    }

    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Index of the block, instance or node.
    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 << 2 >> (2 + Self::NUMBER_BITS)) as usize
    }

    /// The same of what is known to be a node: a shift is all that it takes.
    #[inline(always)]
    pub(crate) const fn node_index(self) -> usize {
        (self.0 >> Self::NUMBER_BITS) as usize
    }

    /// How far from the first of its kind it lies, where each takes `size` bytes, a multiple of 8.
    #[inline(always)]
    pub(crate) const fn offset(self, size: usize) -> usize {
        // The index stands eightfold in the word.
        (self.0 & !(Self::LEAF | Self::INSTANCE | Self::NUMBER)) as usize * (size >> Self::NUMBER_BITS)
    }

    /// Boxes of the node or triangles of the block.
    #[inline(always)]
    pub(crate) const fn number(self) -> u32 {
        (self.0 & Self::NUMBER) + 1
    }

    /// For hashing: kind and index, which say all; 30 bits for the index, so that a tree has the hash that it always had.
    pub(crate) const fn hashed(self) -> u32 {
        if self.0 == Self::EMPTY.0 {
            self.0
        } else {
            self.0 & (Self::LEAF | Self::INSTANCE) | self.index() as u32
        }
    }

    /// The same child after its blocks and nodes were moved by so many places.
    pub(crate) const fn moved(self, nodes: u32, blocks: u32) -> Self {
        if self.is_instance() {
            // An instance, or empty.
            self
        } else if self.is_leaf() {
            Self(self.0 + (blocks << Self::NUMBER_BITS))
        } else {
            Self(self.0 + (nodes << Self::NUMBER_BITS))
        }
    }
}

/// An inner node: the boxes of up to eight children.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// `bounds[axis]`: minima and maxima, one child per lane.
    pub(crate) bounds: [[F8; 2]; 3],
    /// Leaf blocks first, then nodes and instances, then unused slots.
    pub(crate) children: [Child; 8],
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        bounds: [[F8([f32::INFINITY; 8]), F8([f32::NEG_INFINITY; 8])]; 3],
        children: [Child::EMPTY; 8],
    };

    /// The occupied slots' boxes and children.
    pub(crate) fn occupied(&self) -> impl Iterator<Item = (Bounds, Child)> + '_ {
        let bounds = |slot: usize| Bounds {
            min: [0, 1, 2].map(|axis| self.bounds[axis][0].0[slot]),
            max: [0, 1, 2].map(|axis| self.bounds[axis][1].0[slot]),
        };
        (0..8)
            .filter(|&slot| self.children[slot] != Child::EMPTY)
            .map(move |slot| (bounds(slot), self.children[slot]))
    }
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
}

impl Bounds {
    pub(crate) const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    pub(crate) fn of_points(points: &[[f32; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, p| bounds.union(&Self { min: *p, max: *p }))
    }

    pub(crate) fn union(&self, other: &Self) -> Self {
        Self {
            min: core::array::from_fn(|i| self.min[i].min(other.min[i])),
            max: core::array::from_fn(|i| self.max[i].max(other.max[i])),
        }
    }

    pub(crate) fn scaled(&self, scale: f32) -> Self {
        Self { min: self.min.map(|c| c * scale), max: self.max.map(|c| c * scale) }
    }

    /// Half of the surface area, in f64 so that boxes of any f32 size have one; 0 when empty.
    pub(crate) fn half_area(&self) -> f64 {
        let [x, y, z]: [f64; 3] =
            core::array::from_fn(|i| (f64::from(self.max[i]) - f64::from(self.min[i])).max(0.0));
        x * y + y * z + z * x
    }
}
