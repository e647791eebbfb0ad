//! The 8-wide tree in memory.

use crate::simd::F8;

/// Points to a child: a leaf block, or another node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(pub(crate) u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// An unused slot; its box is inside out, so no ray enters it.
    pub(crate) const EMPTY: Self = Self(u32::MAX);
    /// Indices below this fit into a child.
    pub(crate) const LIMIT: u32 = Self::LEAF - 1;

    pub(crate) const fn leaf(block: u32) -> Self {
        Self(block | Self::LEAF)
    }

    pub(crate) const fn node(node: u32) -> Self {
        Self(node)
    }

    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// Block index of a leaf, node index otherwise.
    #[inline(always)]
    pub(crate) const fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// An inner node: the boxes of up to eight children.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// `bounds[axis]`: minima and maxima, one child per lane.
    pub(crate) bounds: [[F8; 2]; 3],
    /// Leaves first, then nodes, then unused slots.
    pub(crate) children: [Child; 8],
}

impl Node {
    pub(crate) const EMPTY: Self = Self {
        bounds: [[F8([f32::INFINITY; 8]), F8([f32::NEG_INFINITY; 8])]; 3],
        children: [Child::EMPTY; 8],
    };

    /// Occupied slots: the boxes that a visit tests.
    #[inline(always)]
    pub(crate) fn count(&self) -> u32 {
        self.children.iter().map(|&c| u32::from(c != Child::EMPTY)).sum()
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

    /// Half of the surface area, in f64 so that boxes of any f32 size have one; 0 when empty.
    pub(crate) fn half_area(&self) -> f64 {
        let [x, y, z]: [f64; 3] =
            core::array::from_fn(|i| (f64::from(self.max[i]) - f64::from(self.min[i])).max(0.0));
        x * y + y * z + z * x
    }
}
