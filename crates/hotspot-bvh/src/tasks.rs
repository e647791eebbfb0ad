//! Loops whose elements stand alone, in the caller's rayon pool: what they give depends on no number of threads.
//!
//! All are cut into pieces of ten to fifty microseconds, whatever the number of threads: left to itself rayon gives each thread two or so, and
//! one that waits for the last piece longer than that goes to sleep, from which it is slow to wake.

use core::ops::Range;
use rayon::prelude::*;

/// Elements of a loop that is worth sharing out.
pub(crate) const TASK: usize = 4096;
/// Elements of a piece of it.
pub(crate) const PIECE: usize = 1024;

/// Whether a loop over so many elements should be shared out.
pub(crate) fn worthwhile(count: usize) -> bool {
    // In this order: asking for the pool starts it.
    count > TASK && rayon::current_num_threads() > 1
}

/// `f` of each element, at the end of `out`.
pub(crate) fn map_into<T: Sync, U: Send>(out: &mut Vec<U>, items: &[T], f: impl Fn(&T) -> U + Sync + Send) {
    if worthwhile(items.len()) {
        out.par_extend(items.par_iter().with_min_len(PIECE).with_max_len(2 * PIECE).map(f));
    } else {
        out.extend(items.iter().map(f));
    }
}

/// `f` of each element of several lists by list and index in it, one list after the other, at the end of `out`, in pieces of `piece`
/// or so, up to 256. List k begins at `starts[k]` of all, and the last start is their end.
pub(crate) fn flatten_into<U: Send>(
    out: &mut Vec<U>,
    starts: &[usize],
    piece: usize,
    f: impl Fn(usize, usize) -> U + Sync + Send,
) {
    let count = starts.last().copied().unwrap_or(0);
    // Sixteen pieces or more.
    if worthwhile(count.saturating_mul(TASK / (16 * piece))) {
        let all = (0..count).into_par_iter().with_min_len(piece).with_max_len(2 * piece);
        out.par_extend(all.map_init(
            || 0,
            |list, i| {
                if i < starts[*list] || i >= starts[*list + 1] {
                    // The last that begins here or before: those before it may be empty.
                    *list = starts.partition_point(|&start| start <= i) - 1;
                }
                f(*list, i - starts[*list])
            },
        ));
    } else {
        for (list, bounds) in starts.windows(2).enumerate() {
            out.extend((0..bounds[1] - bounds[0]).map(|i| f(list, i)));
        }
    }
}

/// So many of the same at the end of `out`: the pages of new memory are touched by all threads.
pub(crate) fn extend<T: Copy + Send + Sync>(out: &mut Vec<T>, value: T, count: usize) {
    if worthwhile(count) {
        out.par_extend((0..count).into_par_iter().with_min_len(TASK).with_max_len(2 * TASK).map(|_| value));
    } else {
        out.resize(out.len() + count, value);
    }
}

/// `f` of ranges that are all numbers below `count`, put together by `join`, which must not care how.
pub(crate) fn fold<U: Send>(
    count: u32,
    none: impl Fn() -> U + Sync + Send,
    f: impl Fn(Range<u32>) -> U + Sync + Send,
    join: impl Fn(U, U) -> U + Sync + Send,
) -> U {
    if worthwhile(count as usize) {
        let chunk = TASK as u32;
        let ranges = (0..count.div_ceil(chunk)).into_par_iter();
        ranges.with_max_len(1).map(|i| f(i * chunk..count.min((i + 1) * chunk))).reduce(none, join)
    } else {
        f(0..count)
    }
}
