//! Paths that are traced side by side: what is one path's stands in its tally, all else in one state for all of them.

use super::{BookedRay, State};
use crate::ledger::payers::Payers;
use crate::ledger::{Ledger, RayKey};
use crate::recorder::PathTally;

impl Ledger {
    /// Books rays of paths that are traced side by side, as well as counting them.
    #[inline(always)]
    pub fn side_by_side<'p>(&'p mut self, payers: &'p Payers, paths: &'p mut [PathTally]) -> BookedPaths<'p> {
        let (pairs, state) = self.open(payers);
        BookedPaths { pairs, state, paths }
    }
}

/// Paths that are traced side by side, whose rays are booked and counted.
#[derive(Debug)]
pub struct BookedPaths<'p> {
    pairs: &'p mut [u64],
    state: State<'p>,
    paths: &'p mut [PathTally],
}

impl<'p> BookedPaths<'p> {
    /// Their tallies.
    #[inline(always)]
    pub fn tallies(&mut self) -> &mut [PathTally] {
        self.paths
    }

    /// A ray of path `at` is about to be cast.
    ///
    /// # Panics
    /// Where there is no such path.
    #[inline(always)]
    pub fn ray(&mut self, at: usize, key: RayKey) -> BookedRay<'_, 'p> {
        self.state.ray(self.pairs, &mut self.paths[at], key)
    }
}
