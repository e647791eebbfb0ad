//! The order of leaves along a Morton curve through their centres.
//!
//! Keys are put into buckets by their highest bits, chunk by chunk; then every bucket is brought together from the chunks and sorted.
//! Both steps go side by side and touch each key in small memory.

use crate::binary::BinaryNode;
use crate::huge;
use crate::tasks::{self, PIECE};
use core::ops::Range;
use glam::{DVec3, Vec4};
use rayon::prelude::*;

/// Bits of a code, 21 an axis.
const BITS: u32 = 63;

/// The code, then the index, so that equals go in the order of their coming.
fn key(code: u64, index: u32) -> u128 {
    u128::from(code) << 64 | u128::from(index)
}

/// The indices of leaves along the curve; `leaf` makes one, more than once.
pub(crate) fn order(count: usize, leaf: &(impl Fn(u32) -> BinaryNode + Sync + Send)) -> Vec<u32> {
    let none = || (Vec4::INFINITY, Vec4::NEG_INFINITY);
    let middles = |range: Range<u32>| {
        range.fold(none(), |(low, high), i| {
            let middle = leaf(i).middle();
            (low.min(middle), high.max(middle))
        })
    };
    let (low, high) = tasks::fold(count as u32, none, middles, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let low = low.truncate().as_dvec3();
    const STEPS: f64 = (1u32 << 21) as f64;
    let size = high.truncate().as_dvec3() - low;
    let scale = DVec3::select(size.cmpgt(DVec3::ZERO), STEPS / size, DVec3::ZERO);
    sorted(count, |index| {
        let at = (leaf(index).middle().truncate().as_dvec3() - low) * scale;
        // The conversion saturates.
        let [x, y, z] = [at.x, at.y, at.z].map(|c| spread((c as u32).min((1 << 21) - 1)));
        x << 2 | y << 1 | z
    })
}

/// Two zeros between bits, of 21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// The numbers below `count` by their code, equals by themselves.
fn sorted(count: usize, code: impl Fn(u32) -> u64 + Sync + Send) -> Vec<u32> {
    // Some hundreds in a bucket, where they are spread evenly.
    let bits = (count / 512).max(1).ilog2().min(12);
    if bits == 0 {
        let mut keys: Vec<u128> = (0..count as u32).map(|index| key(code(index), index)).collect();
        keys.sort_unstable();
        return keys.into_iter().map(|key| key as u32).collect();
    }
    let bucket = |key: u128| ((key >> 64) as u64 >> (BITS - bits)) as usize;
    let buckets = 1usize << bits;
    // Not so small that next to nothing of a bucket is in one chunk, not so large that it leaves the cache.
    let chunk = (count / 64).clamp(2 * PIECE, 64 * PIECE);
    // Zeros, which cost nothing until they are touched.
    let mut keys = huge::advised(vec![0u128; count]);
    // Of each chunk where its buckets begin, and its end.
    let width = buckets + 1;
    let mut starts = vec![0u32; width * count.div_ceil(chunk)];
    let distribute = |local: &mut Vec<u128>, (first, (to, starts)): (usize, (&mut [u128], &mut [u32]))| {
        let first = (first * chunk) as u32;
        local.clear();
        local.extend((first..first + to.len() as u32).map(|index| key(code(index), index)));
        for &key in local.iter() {
            starts[bucket(key) + 1] += 1;
        }
        // `starts[b + 1]` is first the number of keys in b, then where b begins, then where it ends: where b + 1 begins.
        let mut sum = 0;
        for start in &mut starts[1..] {
            sum += core::mem::replace(start, sum);
        }
        for &key in local.iter() {
            let next = &mut starts[bucket(key) + 1];
            to[*next as usize] = key;
            *next += 1;
        }
    };
    let parallel = tasks::worthwhile(count);
    if parallel {
        let chunks = keys.par_chunks_mut(chunk).zip(starts.par_chunks_mut(width)).enumerate();
        chunks.with_max_len(1).for_each_init(Vec::new, distribute);
    } else {
        let mut local = Vec::new();
        let chunks = keys.chunks_mut(chunk).zip(starts.chunks_mut(width)).enumerate();
        chunks.for_each(|item| distribute(&mut local, item));
    }
    let mut order = vec![0u32; count];
    let mut rest = &mut order[..];
    let mut parts = Vec::with_capacity(buckets);
    let mut lengths = vec![0u32; buckets];
    for starts in starts.chunks(width) {
        for (length, bucket) in lengths.iter_mut().zip(starts.windows(2)) {
            *length += bucket[1] - bucket[0];
        }
    }
    for (bucket, length) in lengths.into_iter().enumerate() {
        let (part, after) = rest.split_at_mut(length as usize);
        parts.push((bucket, part));
        rest = after;
    }
    let collect = |local: &mut Vec<u128>, (bucket, to): &mut (usize, &mut [u32])| {
        local.clear();
        for (keys, starts) in keys.chunks(chunk).zip(starts.chunks(width)) {
            local.extend_from_slice(&keys[starts[*bucket] as usize..starts[*bucket + 1] as usize]);
        }
        local.sort_unstable();
        for (to, key) in to.iter_mut().zip(local) {
            *to = *key as u32;
        }
    };
    if parallel {
        parts.par_iter_mut().with_min_len(2).with_max_len(4).for_each_init(Vec::new, collect);
    } else {
        let mut local = Vec::new();
        parts.iter_mut().for_each(|part| collect(&mut local, part));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Alone, and in chunks and buckets that three threads share; codes that differ everywhere, in few bits, or not at all.
    #[test]
    fn the_order_is_that_of_a_stable_sort() {
        let mut random = Random(2);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        for count in [0, 1, 100, 1023, 1024, 4 * PIECE, 4 * PIECE + 1, 9000, 128 * PIECE + 33] {
            for mask in [!0, 0xff, 0xffff << 40, 1 << 62, 0] {
                let codes: Vec<u64> = (0..count).map(|_| random.bits() & mask & (!0 >> 1)).collect();
                let mut expected: Vec<u32> = (0..count as u32).collect();
                expected.sort_by_key(|&index| codes[index as usize]);
                let order = || sorted(count, |index| codes[index as usize]);
                assert!(order() == expected, "{count} {mask:x}");
                assert!(pool.install(order) == expected, "{count} {mask:x}, side by side");
            }
        }
    }
}
