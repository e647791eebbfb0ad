//! Paths that are traced side by side: what is one path's stands in its tally, all else in one state for all of them.

use super::{BLOCKED, BookedRay, Keeper, State};
use crate::ledger::Ledger;
use crate::ledger::payers::Payers;
use crate::recorder::{PathCounts, PathTally};
use hotspot_probe::{RayKind, Spawner};

impl Ledger {
    /// Books rays of paths that are traced side by side, as well as counting them.
    #[inline(always)]
    pub fn side_by_side<'p>(&'p mut self, payers: &'p Payers, paths: &'p mut [PathTally]) -> BookedPaths<'p> {
        let (pairs, state) = self.open(payers, Tallies { paths, at: 0 });
        BookedPaths { pairs, state }
    }
}

/// Paths that are traced side by side, whose rays are booked and counted.
#[derive(Debug)]
pub struct BookedPaths<'p> {
    pairs: &'p mut [u64],
    state: State<'p, Tallies<'p>>,
}

/// Paths that are traced side by side, and which of them is at hand.
#[derive(Debug)]
pub struct Tallies<'p> {
    paths: &'p mut [PathTally],
    at: usize,
}

impl Keeper for Tallies<'_> {
    #[inline(always)]
    fn counts(&mut self) -> &mut PathCounts {
        self.paths[self.at].counts()
    }
}

impl<'p> BookedPaths<'p> {
    /// Their tallies.
    #[inline(always)]
    pub fn tallies(&mut self) -> &mut [PathTally] {
        self.state.counts.paths
    }

    /// A ray of path `at` is about to be cast; after it was finished, [`Self::end_ray`].
    ///
    /// # Panics
    /// Where there is no such path.
    #[inline(always)]
    pub fn ray(&mut self, at: usize, by: Spawner) -> BookedRay<'_, 'p, Tallies<'p>> {
        self.state.counts.at = at;
        self.state.left = self.state.counts.paths[at].left;
        self.state.ray(self.pairs, by)
    }

    /// The ray has ended.
    #[inline(always)]
    pub fn end_ray(&mut self) {
        let State { sums, key, left, counts: Tallies { paths, at }, .. } = &mut self.state;
        let path = &mut paths[*at];
        path.left = *left;
        // What it visited stands in the sums of its kind, and in those of blocked rays if it was one.
        let shadow = key.kind() == RayKind::Shadow;
        let [nodes, leaves] = &mut sums[usize::from(shadow)];
        path.counts().add_visits(shadow, nodes.take(), leaves.take());
        if shadow {
            let [nodes, leaves] = &mut sums[BLOCKED];
            path.counts().add_blocked(nodes.take()[0], leaves.take()[1]);
        }
    }
}
