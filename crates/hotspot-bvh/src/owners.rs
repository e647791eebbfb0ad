//! What the triangles below each node and leaf block have in common: the ground of payer ledgers.

use crate::Bvh;
use crate::node::Child;

/// Whose triangles lie below a node or in a leaf block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Owner {
    /// All of this owner.
    One(u32),
    /// Of several owners.
    Several,
    /// Of a mesh that is stored once: they belong to whatever instance the ray is in.
    Instance,
}

impl Owner {
    fn union(self, other: Self) -> Self {
        if self == other { self } else { Self::Several }
    }
}

/// The owners of all nodes and leaf blocks, by the ids that probes are told.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Owners {
    /// By node.
    pub nodes: Vec<Owner>,
    /// By leaf block.
    pub blocks: Vec<Owner>,
}

impl Bvh {
    /// Whose triangles lie below each node and in each leaf block. `triangle` names the owner of a triangle of the world,
    /// `instance` that of an instance. A node above triangles of the world and instances belongs to one owner if all of them
    /// do.
    pub fn owners(&self, triangle: impl Fn(u32) -> u32, instance: impl Fn(u32) -> u32) -> Owners {
        // What no ray of the world's own tree reaches belongs to meshes.
        let mut owners = Owners {
            nodes: vec![Owner::Instance; self.nodes.len()],
            blocks: vec![Owner::Instance; self.blocks.len()],
        };
        let of_leaf = |child: Child, owners: &mut Owners| -> Option<Owner> {
            if child.is_instance() {
                return Some(Owner::One(instance(child.index() as u32)));
            }
            let of_triangles = self.block_triangles(child.index() as u32).map(|t| Owner::One(triangle(t)));
            let owner = of_triangles.reduce(Owner::union)?;
            owners.blocks[child.index()] = owner;
            Some(owner)
        };
        if self.root == Child::EMPTY || self.root.is_leaf() {
            if self.root != Child::EMPTY {
                of_leaf(self.root, &mut owners);
            }
            return owners;
        }
        // Nodes from the root on; each stands before those below it, so backwards all children are known.
        let mut order = vec![self.root.index()];
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            next += 1;
            let inner = self.nodes[node].occupied().map(|(_, child)| child).filter(|child| !child.is_leaf());
            order.extend(inner.map(Child::index));
        }
        for &node in order.iter().rev() {
            let children = self.nodes[node].occupied().filter_map(|(_, child)| {
                if child.is_leaf() { of_leaf(child, &mut owners) } else { Some(owners.nodes[child.index()]) }
            });
            owners.nodes[node] = children.reduce(Owner::union).unwrap_or(Owner::Several);
        }
        owners
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, Instance};
    use std::collections::BTreeSet;

    /// `count` triangles in a row, `gap` apart.
    fn row(count: usize, gap: f32) -> Vec<[[f32; 3]; 3]> {
        (0..count)
            .map(|i| {
                let x = i as f32 * gap;
                [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]
            })
            .collect()
    }

    /// Every owner below a child, by walking down: the slow twin.
    fn below(bvh: &Bvh, child: Child, of: &dyn Fn(u32) -> u32, all: &mut BTreeSet<u32>) {
        if child.is_instance() {
            all.insert(1000 + child.index() as u32);
        } else if child.is_leaf() {
            all.extend(bvh.block_triangles(child.index() as u32).map(of));
        } else {
            for (_, child) in bvh.nodes[child.index()].occupied() {
                below(bvh, child, of, all);
            }
        }
    }

    fn expected(all: &BTreeSet<u32>) -> Owner {
        match all.first() {
            Some(one) if all.len() == 1 => Owner::One(*one),
            _ => Owner::Several,
        }
    }

    #[test]
    fn owners_agree_with_a_walk_from_each_node() {
        let mesh = row(300, 1.5);
        let shift = |x: f64| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 5.0], [0.0, 0.0, 1.0, 0.0]];
        let instances =
            [Instance { mesh: 0, to_world: shift(0.0) }, Instance { mesh: 0, to_world: shift(9.0) }];
        let world = row(700, 1.25);
        let of = |t: u32| if t < 100 { t % 3 } else { t / 100 };
        let bvh = Bvh::build_instanced(&world, &[mesh], &instances, BuildOptions::default()).unwrap();
        let owners = bvh.owners(of, |i| 1000 + i);
        let mut seen = BTreeSet::new();
        let mut open = vec![bvh.root];
        let mut inside = 0;
        while let Some(child) = open.pop() {
            let mut all = BTreeSet::new();
            below(&bvh, child, &of, &mut all);
            let owner = if child.is_instance() {
                continue;
            } else if child.is_leaf() {
                owners.blocks[child.index()]
            } else {
                open.extend(bvh.nodes[child.index()].occupied().map(|(_, child)| child));
                inside += 1;
                owners.nodes[child.index()]
            };
            assert_eq!(owner, expected(&all), "{child:?}");
            seen.insert(owner == Owner::Several);
        }
        assert_eq!(seen.len(), 2, "mixed and whole subtrees both occur");
        // All others are the mesh's.
        let shared = owners.nodes.iter().filter(|owner| **owner == Owner::Instance).count();
        assert_eq!(shared + inside, bvh.node_count());
        assert!(owners.blocks.contains(&Owner::Instance));
    }

    #[test]
    fn small_and_empty_trees() {
        let empty = Bvh::build(&[], BuildOptions::default()).unwrap();
        assert_eq!(empty.owners(|_| 0, |_| 0), Owners::default());
        let one = Bvh::build(&row(1, 1.0), BuildOptions::default()).unwrap();
        let owners = one.owners(|_| 7, |_| 0);
        assert!(owners.nodes.iter().chain(&owners.blocks).all(|owner| *owner == Owner::One(7)));
        assert_eq!(owners.blocks.len(), 1);
    }
}
