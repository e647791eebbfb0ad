//! Makes a binary tree better: Meister and Bittner, *Parallel Reinsertion for Bounding Volume Hierarchy Optimization*
//! (Eurographics 2018). Subtrees with large boxes are taken out and put back where the tree's total surface area shrinks
//! most. All of a round look for their best place at once; then the moves are made by how much they gain, but for those
//! that touch what another has already changed.
//!
//! Equal gains go by place, so that a round's moves do not depend on the order in which they were found.

use crate::binary::{BinaryNode, BinaryTree};
use crate::tasks;
use rayon::prelude::*;

/// Rounds; round k looks at one in 2k + 1 of the first round's candidates: the top of the tree is worth the most.
const ROUNDS: u32 = 16;

/// Places that all searches of a round look at together, at most, but for [`FEWEST`] of each. Where most boxes hold most others hardly
/// anything can be left out, and time would grow by the square.
const PLACES: usize = 1 << 28;
const FEWEST: usize = 4096;

/// A subtree and where it would be better.
#[derive(Clone, Copy, Debug)]
struct Move {
    gain: f32,
    from: u32,
    to: u32,
}

/// Takes `share` of all nodes for the first round.
pub(crate) fn optimize(tree: &mut BinaryTree, share: f32) {
    let count = tree.nodes.len();
    // Three nodes leave nothing to choose.
    if count < 6 || share <= 0.0 {
        return;
    }
    let mut touched = vec![0u8; count];
    let mut candidates: Vec<u64> = Vec::new();
    for round in 0..ROUNDS {
        let batch = (count as f32 * share / (2 * round + 1) as f32) as usize;
        // As built, the tree's top comes first in memory: twice as many as wanted hold most of the largest.
        let batch = batch.clamp(1, count - 2);
        let considered = (2 * batch + 4).min(count);
        candidates.clear();
        candidates.extend((2..considered).map(|place| {
            // Largest first, then by place.
            u64::from(!tree.nodes[place].half_area().to_bits()) << 32 | place as u64
        }));
        if batch < candidates.len() {
            candidates.select_nth_unstable(batch);
            candidates.truncate(batch);
        }
        let shared = &*tree;
        let places = (PLACES / batch).max(FEWEST);
        let search = |stack: &mut Vec<(f32, u32)>, key: &u64| best_move(shared, *key as u32, places, stack);
        // A search is worth dozens of elements of other loops.
        let mut moves: Vec<Move> = if tasks::worthwhile(batch.saturating_mul(32)) {
            let each = candidates.par_iter().with_min_len(64).with_max_len(64);
            each.map_init(Vec::new, search).flatten_iter().collect()
        } else {
            let mut stack = Vec::new();
            candidates.iter().filter_map(|key| search(&mut stack, key)).collect()
        };
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        let round = round as u8 + 1;
        for Move { from, to, .. } in moves {
            let concerned = [to, from, from ^ 1, tree.parent(to), tree.parent(from)];
            if concerned.iter().any(|&place| touched[place as usize] == round) {
                continue;
            }
            for place in concerned {
                touched[place as usize] = round;
            }
            reinsert(tree, from, to);
        }
    }
}

/// The place from which the subtree at `from` makes the tree smallest; `None` where it stands best.
///
/// Taken out, its parent goes and the ancestors shrink; put back beside X, the nodes above X grow to hold it and the parent of both
/// is new. The search goes up from `from`, at each ancestor down into the other side, and leaves out a subtree where even a
/// place that costs nothing but the node itself would gain less than is known.
///
/// It goes down into larger boxes than the own one alone: below others nothing is better than beside them, but for rounding.
/// So of two moves in one round neither can be into what the other takes away, in a circle: each would be the smaller.
fn best_move(tree: &BinaryTree, from: u32, places: usize, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
    let nodes = &tree.nodes[..];
    let node = nodes[from as usize];
    let own = node.half_area();
    let mut best = Move { gain: 0.0, from, to: from };
    let above = tree.parent(from);
    // What has been gained above the place that is looked at, and the box of the ancestor without the subtree.
    let mut gained = nodes[above as usize].half_area();
    let mut sibling = from ^ 1;
    let mut without = nodes[sibling as usize];
    let mut ancestor = above;
    stack.clear();
    let mut left = places / 2;
    loop {
        let look = |place: u32, gained: f32, best: &mut Move| {
            let other = &nodes[place as usize];
            let gain = gained - node.half_area_with(other);
            if gain > best.gain {
                (best.gain, best.to) = (gain, place);
            }
            let area = other.half_area();
            other.pair().filter(|_| area > own).map(|pair| (gain + area, pair))
        };
        if gained - own > best.gain {
            stack.extend(look(sibling, gained, &mut best));
        }
        while let Some((gained, pair)) = stack.pop() {
            if gained - own <= best.gain || left == 0 {
                continue;
            }
            left -= 1;
            let sides = [look(2 * pair, gained, &mut best), look(2 * pair + 1, gained, &mut best)];
            stack.extend(sides.into_iter().flatten().filter(|(gained, _)| gained - own > best.gain));
        }
        if ancestor != above {
            without.extend(&nodes[sibling as usize]);
            let whole = nodes[ancestor as usize].half_area();
            gained += whole - without.half_area();
            // Beside the ancestor: the parent of both is as large as the ancestor was.
            if gained - whole > best.gain {
                (best.gain, best.to) = (gained - whole, ancestor);
            }
        }
        if ancestor == 0 {
            break;
        }
        sibling = ancestor ^ 1;
        ancestor = tree.parent(ancestor);
    }
    (best.gain > 0.0).then_some(best)
}

/// Moves the subtree at `from` beside the one at `to`: their parent takes the place of the latter, the sibling that of the
/// old parent.
fn reinsert(tree: &mut BinaryTree, from: u32, to: u32) {
    let (sibling, above) = (from ^ 1, tree.parent(from));
    let nodes = &tree.nodes[..];
    let (left_behind, beside) = (nodes[sibling as usize], nodes[to as usize]);
    let pair = from >> 1;
    let joint = BinaryNode::parent_of(&nodes[from as usize], &beside, pair);
    tree.put(to, &joint);
    tree.put(sibling, &beside);
    tree.put(above, &left_behind);
    if to != 0 {
        tree.refit(tree.parent(to));
    }
    if above != 0 {
        tree.refit(tree.parent(above));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binary::tests::{Boxes, assert_whole, total_area};
    use crate::ploc::tests::over;

    /// Whether `place` lies in the subtree at `top`.
    fn within(tree: &BinaryTree, mut place: u32, top: u32) -> bool {
        while place != top && place != 0 {
            place = tree.parent(place);
        }
        place == top
    }

    /// Every move of every subtree of small trees is made: none gains more than the one found, which gains what it says.
    #[test]
    fn no_other_place_is_better() {
        let mut boxes = Boxes::new(3);
        let mut found = 0;
        for round in 0..60 {
            let leaves = boxes.leaves(3 + round % 30, 0.3);
            let build = || over(&leaves, 1 + round % 3);
            let tree = build();
            let before = total_area(&tree.nodes);
            for from in 2..tree.nodes.len() as u32 {
                let best = best_move(&tree, from, usize::MAX, &mut Vec::new());
                let mut most = 0.0f64;
                for to in (0..tree.nodes.len() as u32).filter(|&to| to != 1) {
                    if within(&tree, to, from) || to == from ^ 1 || to == tree.parent(from) {
                        continue;
                    }
                    let mut moved = build();
                    reinsert(&mut moved, from, to);
                    assert_whole(&moved);
                    let gain = before - total_area(&moved.nodes);
                    most = most.max(gain);
                    if let Some(best) = best.filter(|best| best.to == to) {
                        assert!((f64::from(best.gain) - gain).abs() < 1e-4 * before, "{best:?}: {gain}");
                        found += 1;
                    }
                }
                let claimed = best.map_or(0.0, |best| f64::from(best.gain));
                assert!((claimed - most).abs() < 1e-4 * before, "round {round}, {from}: {best:?} for {most}");
            }
        }
        assert!(found > 300, "{found}");
    }

    #[test]
    fn trees_get_smaller_and_stay_whole() {
        let mut boxes = Boxes::new(4);
        for count in [0, 1, 2, 3, 4, 5, 100, 20_000] {
            let mut tree = over(&boxes.leaves(count, 0.02), 1);
            let before = total_area(&tree.nodes);
            optimize(&mut tree, 0.2);
            assert_whole(&tree);
            let after = total_area(&tree.nodes);
            assert!(after <= before, "{count}: {before} {after}");
            assert!(count < 20_000 || after < before, "{count}: {before} {after}");
        }
    }
}
