//! Loops whose elements stand alone, in the caller's rayon pool: what they give depends on no number of threads.

use crate::huge;
use rayon::prelude::*;

/// Elements of a loop that are worth a task of their own.
pub(crate) const TASK: usize = 4096;

/// Whether a loop over so many elements should be shared out.
pub(crate) fn worthwhile(count: usize) -> bool {
    // In this order: asking for the pool starts it.
    count > TASK && rayon::current_num_threads() > 1
}

/// `f` of each index and element, in memory for large arrays.
pub(crate) fn map<T: Sync, U: Send>(items: &[T], f: impl Fn(usize, &T) -> U + Sync) -> Vec<U> {
    let mut out = huge::with_capacity(items.len());
    map_into(&mut out, items, f);
    out
}

/// The same, at the end of `out`.
pub(crate) fn map_into<T: Sync, U: Send>(out: &mut Vec<U>, items: &[T], f: impl Fn(usize, &T) -> U + Sync) {
    if worthwhile(items.len()) {
        out.par_extend(items.par_iter().with_min_len(TASK).enumerate().map(|(i, item)| f(i, item)));
    } else {
        out.extend(items.iter().enumerate().map(|(i, item)| f(i, item)));
    }
}

/// `f` of chunks, put together by `join`, which must not care how.
pub(crate) fn fold<T: Sync, U: Send>(
    items: &[T],
    none: impl Fn() -> U + Sync + Send,
    f: impl Fn(&[T]) -> U + Sync + Send,
    join: impl Fn(U, U) -> U + Sync + Send,
) -> U {
    if worthwhile(items.len()) { items.par_chunks(TASK).map(f).reduce(none, join) } else { f(items) }
}
