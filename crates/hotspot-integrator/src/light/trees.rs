//! Many distributions over the same entries, each a tree of small ones.
//!
//! A distribution for each of hundreds of directions over each of thousands of patches does not fit a cache as single
//! precision, where a binary search misses at every other step. A node of sixteen entries is as long as half a cache
//! line ([`steps`](super::steps)): a thousand patches are three nodes deep, the upper two levels of all directions stay in the
//! cache, and the whole is half the size. Bytes would halve it once more, but what 255 units round away is seen: 5 to 8 % more
//! error on lamps that fill little of the view.

use super::steps::Steps;

/// Entries of a node.
const WIDTH: usize = 16;
/// Levels that 2^32 entries need.
const DEEPEST: usize = 8;

/// Sixteen entries.
pub(super) type Node = Steps<u16, WIDTH>;

/// How a tree lies in its nodes: by level, the root first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shape {
    /// First node of each level.
    levels: [u32; DEEPEST],
    depth: usize,
    /// Nodes of a tree.
    stride: usize,
}

/// The distributions, one after the other.
#[derive(Debug, Default)]
pub(super) struct Trees {
    shape: Shape,
    nodes: Vec<Node>,
}

/// A search for an entry, under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Descent {
    index: usize,
    rest: f32,
    probability: f32,
}

impl Descent {
    /// At the root, for `u` in [0, 1).
    #[inline(always)]
    pub(super) fn new(u: f32) -> Self {
        Self { index: 0, rest: u, probability: 1.0 }
    }

    /// As [`Trees::sample`], once there is no other level.
    #[inline(always)]
    pub(super) fn found(&self) -> (usize, f32, f32) {
        (self.index, self.rest, self.probability)
    }
}

impl Shape {
    fn new(count: usize) -> Self {
        let mut sizes = vec![count.div_ceil(WIDTH)];
        while sizes[0] > 1 {
            sizes.insert(0, sizes[0].div_ceil(WIDTH));
        }
        let mut shape = Self { depth: sizes.len(), ..Self::default() };
        for (level, size) in shape.levels.iter_mut().zip(&sizes) {
            *level = shape.stride as u32;
            shape.stride += size;
        }
        shape
    }

    #[inline(always)]
    fn levels(&self) -> &[u32] {
        &self.levels[..self.depth]
    }

    /// Makes a distribution in proportion to weights (at least 0, one for each entry). Without any weight it finds its first
    /// entry.
    pub(super) fn fill(&self, nodes: &mut [Node], mut weights: Vec<f32>) {
        for first in self.levels().iter().rev() {
            weights.resize(weights.len().next_multiple_of(WIDTH), 0.0);
            let (groups, _) = weights.as_chunks::<WIDTH>();
            for (node, group) in nodes[*first as usize..].iter_mut().zip(groups) {
                *node = Node::new(group);
            }
            weights = groups.iter().map(|group| group.iter().sum()).collect();
        }
    }
}

impl Trees {
    /// Of `distributions` over `count` entries each (1 to 2^32), which find their first entries until they are filled.
    pub(super) fn new(distributions: usize, count: usize) -> Self {
        let shape = Shape::new(count);
        Self { shape, nodes: vec![Node::new(&[0.0; WIDTH]); distributions * shape.stride] }
    }

    /// Each distribution's nodes, for [`Shape::fill`].
    pub(super) fn nodes(&mut self) -> core::slice::ChunksExactMut<'_, Node> {
        self.nodes.chunks_exact_mut(self.shape.stride)
    }

    /// How each distribution lies in its nodes.
    pub(super) fn shape(&self) -> Shape {
        self.shape
    }

    /// The entry that holds `u` (in [0, 1)), where in it `u` lies, in [0, 1), and its probability.
    #[inline(always)]
    pub(super) fn sample(&self, distribution: usize, u: f32) -> (usize, f32, f32) {
        let mut descent = Descent::new(u);
        let mut level = 0;
        while self.descend(distribution, level, &mut descent) {
            level += 1;
        }
        descent.found()
    }

    /// Goes through a level, the root's being 0; whether there is another.
    #[inline(always)]
    pub(super) fn descend(&self, distribution: usize, level: usize, descent: &mut Descent) -> bool {
        let levels = self.shape.levels();
        let nodes = &self.nodes[distribution * self.shape.stride..][..self.shape.stride];
        let step = nodes[levels[level] as usize + descent.index].sample(descent.rest);
        descent.index = descent.index * WIDTH + step.index;
        (descent.rest, descent.probability) = (step.rest, descent.probability * step.probability);
        level + 1 < levels.len()
    }

    /// The probability with which [`Trees::sample`] finds an entry.
    #[inline(always)]
    pub(super) fn probability(&self, distribution: usize, mut index: usize) -> f32 {
        let nodes = &self.nodes[distribution * self.shape.stride..][..self.shape.stride];
        let mut probability = 1.0;
        for first in self.shape.levels().iter().rev() {
            probability *= nodes[*first as usize + index / WIDTH].probability(index % WIDTH);
            index /= WIDTH;
        }
        probability
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_square::Random;

    /// In order and in proportion, each entry by its own probability, for one level and for several; entries without
    /// weight are never found.
    #[test]
    fn trees_find_entries_in_proportion() {
        let mut random = Random(3);
        for count in [1usize, 2, 15, 16, 17, 255, 256, 257, 1000, 5000] {
            let weights: Vec<Vec<f32>> = vec![
                vec![1.0; count],
                (0..count).map(|i| if i % 3 == 1 { 0.0 } else { 0.1 + random.single() }).collect(),
                (0..count).map(|i| f32::from(u8::from(i == count / 2))).collect(),
                vec![0.0; count],
            ];
            let mut trees = Trees::new(weights.len(), count);
            let shape = trees.shape();
            trees.nodes().zip(&weights).for_each(|(nodes, weights)| shape.fill(nodes, weights.clone()));
            for (row, weights) in weights.iter().enumerate() {
                let total: f32 = weights.iter().sum();
                let sum: f64 = (0..count).map(|i| f64::from(trees.probability(row, i))).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{sum}");
                let n = 20_000;
                let mut last = 0;
                let mut hits = vec![0u32; count];
                for i in 0..n {
                    let (found, rest, probability) = trees.sample(row, (i as f32 + 0.5) / n as f32);
                    assert!(found >= last && found < count && (0.0..1.0).contains(&rest));
                    assert!((probability / trees.probability(row, found) - 1.0).abs() < 1e-6);
                    assert!(weights[found] > 0.0 || (total == 0.0 && found == 0));
                    hits[found] += 1;
                    last = found;
                }
                for (i, hits) in hits.iter().enumerate() {
                    let expected = trees.probability(row, i) * n as f32;
                    assert!(
                        (*hits as f32 - expected).abs() <= 1.1,
                        "{row} {i} of {count}: {hits}, {expected}"
                    );
                }
                // At each level a span is off by two units at most, and by what sixteen entries get at least.
                for (i, weight) in weights.iter().enumerate().filter(|_| total > 0.0) {
                    let sum = |size: usize| weights[i / size * size..].iter().take(size).sum::<f32>();
                    let (mut most, mut size) = (1.0, 1);
                    while size < count && *weight > 0.0 {
                        most *= 1.0 + (2.0 * sum(size * WIDTH) / sum(size) + WIDTH as f32) / 65_535.0;
                        size *= WIDTH;
                    }
                    let (found, expected) = (trees.probability(row, i), weight / total);
                    let off = (found - expected).abs();
                    assert!(
                        off <= (most - 1.0) * expected + 1e-6,
                        "{row} {i} of {count}: {found}, {expected}"
                    );
                }
            }
        }
    }
}
