//! Fingerprints of a frame: equal if and only if (but for chance) every sum is bit-identical.
//!
//! XXH3-128 over little-endian 64-bit words: width, height, halves; then for each pixel, row by row from the top, and
//! each half: for radiance the bits of the three f64 sums and the sample count, for counters every
//! [`crate::Counter`] in index order and the counted samples. Time, squares and throughput are left out.

use crate::counter::Counter;
use crate::frame::Frame;
use serde::{Deserialize, Serialize};
use twox_hash::xxhash3_128::{DEFAULT_SECRET_LENGTH, RawHasher, SecretBuffer};

/// The fingerprints of a frame, 32 hexadecimal digits each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    /// Of the radiance sums.
    pub radiance: String,
    /// Of the counters; absent without cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counters: Option<String>,
}

impl Digest {
    /// The fingerprints of `frame`.
    pub fn of(frame: &Frame) -> Self {
        let halves = || frame.pixels().flat_map(|(x, y)| (0..frame.halves()).map(move |half| (x, y, half)));
        let radiance = || {
            let mut words = Words::new(frame);
            for film in halves().filter_map(|(x, y, half)| frame.film(x, y, half)) {
                words.write(film.sum.map(f64::to_bits));
                words.write([film.samples]);
            }
            words.hex()
        };
        let counters = || {
            let mut words = Words::new(frame);
            for cost in halves().filter_map(|(x, y, half)| frame.cost(x, y, half)) {
                words.write(cost.counts);
                words.write([cost.samples]);
            }
            words.hex()
        };
        let (radiance, counters) = rayon::join(radiance, || frame.desc().cost.then(counters));
        Self { radiance, counters }
    }
}

/// Bytes that are hashed at a time.
const TOGETHER: usize = 1 << 14;

struct Words {
    hasher: RawHasher<&'static [u8; DEFAULT_SECRET_LENGTH]>,
    waiting: Vec<u8>,
}

impl Words {
    fn new(frame: &Frame) -> Self {
        let hasher = RawHasher::new(SecretBuffer::default());
        let mut words = Self { hasher, waiting: Vec::with_capacity(TOGETHER + 8 * Counter::COUNT) };
        let desc = frame.desc();
        words.write([u64::from(desc.width), u64::from(desc.height), frame.halves() as u64]);
        words
    }

    fn write(&mut self, words: impl IntoIterator<Item = u64>) {
        self.waiting.extend(words.into_iter().flat_map(u64::to_le_bytes));
        if self.waiting.len() >= TOGETHER {
            self.hasher.write(&self.waiting);
            self.waiting.clear();
        }
    }

    fn hex(mut self) -> String {
        self.hasher.write(&self.waiting);
        format!("{:032x}", self.hasher.finish_128())
    }
}
