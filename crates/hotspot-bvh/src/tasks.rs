//! Loops whose elements stand alone, in the caller's rayon pool: what they give depends on no number of threads.

use crate::huge;
use core::ops::Range;
use rayon::prelude::*;

/// Elements of a loop that are worth a task of their own.
pub(crate) const TASK: usize = 4096;

/// Whether a loop over so many elements should be shared out.
pub(crate) fn worthwhile(count: usize) -> bool {
    // In this order: asking for the pool starts it.
    count > TASK && rayon::current_num_threads() > 1
}

/// `f` of each number below `count`.
pub(crate) fn collect<U: Send>(count: u32, f: impl Fn(u32) -> U + Sync + Send) -> Vec<U> {
    let mut out = huge::with_capacity(count as usize);
    if worthwhile(count as usize) {
        out.par_extend((0..count).into_par_iter().with_min_len(TASK).map(f));
    } else {
        out.extend((0..count).map(f));
    }
    out
}

/// `f` of each element, at the end of `out`.
pub(crate) fn map_into<T: Sync, U: Send>(out: &mut Vec<U>, items: &[T], f: impl Fn(&T) -> U + Sync + Send) {
    if worthwhile(items.len()) {
        out.par_extend(items.par_iter().with_min_len(TASK).map(f));
    } else {
        out.extend(items.iter().map(f));
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
        ranges.map(|i| f(i * chunk..count.min((i + 1) * chunk))).reduce(none, join)
    } else {
        f(0..count)
    }
}
