//! Two sums in one word, so that a visit of a node or leaf block adds once.

/// Two sums in one word: in the lower 36 bits boxes (or triangles) and visits together, above them visits. No visit has more than 254
/// boxes, so the sums of fewer than 2^28 visits stay in their parts, and the top bit is set when half of those are there.
///
/// Together, since then optimisers see that the one of a visit is to be added to the number, and with it the one by which that is more
/// than what stands in the word of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pair(pub(crate) u64);

impl Pair {
    pub(crate) const NOTHING: Self = Self(0);
    /// Where the visits are.
    const VISITS: u32 = 36;
    /// Visits of more boxes are booked elsewhere.
    pub(crate) const MOST: u32 = (1 << 8) - 2;
    /// With so many visits it is full.
    pub(crate) const FULL: u64 = 1 << (63 - Self::VISITS);

    /// One visit of so many boxes; `None` where these do not fit.
    #[inline(always)]
    pub(crate) const fn visit(boxes: u32) -> Option<Self> {
        if boxes <= Self::MOST { Some(Self(boxes as u64 + (1 << Self::VISITS | 1))) } else { None }
    }

    /// So many visits and boxes, where they are such as visits add up to, and fewer than fill it.
    pub(crate) const fn of([visits, boxes]: [u64; 2]) -> Option<Self> {
        if visits < Self::FULL && boxes <= visits * Self::MOST as u64 {
            Some(Self(visits << Self::VISITS | (visits + boxes)))
        } else {
            None
        }
    }

    /// Adds; true where the sum is now to be taken out before the next one.
    #[inline(always)]
    #[must_use]
    pub(crate) const fn add(&mut self, other: Self) -> bool {
        self.gather(other);
        self.is_full()
    }

    /// Adds to a pair of a row; true where that is now to be taken out ([`Self::take_from`]).
    #[inline(always)]
    #[must_use]
    pub(crate) const fn add_to(self, word: &mut u64) -> bool {
        *word = word.wrapping_add(self.0);
        Self(*word).is_full()
    }

    /// Takes out a pair of a row.
    pub(crate) const fn take_from(word: &mut u64) -> [u64; 2] {
        Self(std::mem::replace(word, 0)).split()
    }

    /// Adds what needs no asking: up to [`Self::FULL`] visits beyond a full sum are not lost.
    #[inline(always)]
    pub(crate) const fn gather(&mut self, other: Self) {
        self.0 = self.0.wrapping_add(other.0);
    }

    /// Whether it is to be taken out.
    #[inline(always)]
    pub(crate) const fn is_full(self) -> bool {
        (self.0 as i64) < 0
    }

    /// Whether one of two is.
    #[inline(always)]
    pub(crate) const fn any_full([a, b]: [Self; PAIRS]) -> bool {
        Self(a.0 | b.0).is_full()
    }

    /// Visits and boxes.
    #[inline(always)]
    pub(crate) const fn split(self) -> [u64; 2] {
        let visits = self.0 >> Self::VISITS;
        [visits, (self.0 & ((1 << Self::VISITS) - 1)).wrapping_sub(visits)]
    }

    /// As a row has it.
    #[cfg(test)]
    pub(crate) const fn word(self) -> u64 {
        self.0
    }
}

/// Which of a column's pairs: nodes with their boxes, leaf blocks with their triangles.
pub(crate) const NODES: usize = 0;
pub(crate) const LEAVES: usize = 1;
/// How many.
pub(crate) const PAIRS: usize = 2;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_say_when_they_are_full_and_lose_nothing() {
        assert_eq!((Pair::visit(255), Pair::visit(u32::MAX)), (None, None));
        for boxes in [0, 1, 3, 8, 254] {
            let one = Pair::visit(boxes).unwrap();
            let boxes = u64::from(boxes);
            assert_eq!((one.split(), Pair::of([1, boxes])), ([1, boxes], Some(one)));
            // As full as it gets without saying so.
            let most = Pair::FULL - 1;
            let almost = Pair::of([most, most * boxes]).unwrap();
            assert!(!almost.is_full() && !Pair::any_full([almost, one]));
            let mut pair = almost;
            assert!(pair.add(one) && Pair::any_full([pair, one]) && Pair::any_full([one, pair]));
            assert_eq!(pair.split(), [most + 1, (most + 1) * boxes]);
            // As many more are not lost.
            pair.gather(almost);
            let both = [2 * most + 1, (2 * most + 1) * boxes];
            assert!(pair.is_full());
            assert_eq!(pair.split(), both);
            let mut word = pair.word();
            assert_eq!((Pair::take_from(&mut word), word), (both, 0));
            assert_eq!(Pair::of([most + 1, 0]), None);
        }
        // Boxes that no such visits have.
        assert_eq!(Pair::of([3, 3 * 254 + 1]), None);
    }
}
