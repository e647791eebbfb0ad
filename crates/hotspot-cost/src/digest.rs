//! Fingerprints of a frame: equal if and only if (but for chance) every sum is bit-identical.
//!
//! XXH3-128 over little-endian 64-bit words: width, height, halves; then for each pixel, row by row from the top, and
//! each half: for radiance the bits of the three f64 sums and the sample count, for counters every
//! [`crate::Counter`] in index order and the counted samples. Time, squares and throughput are left out.

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
        let mut radiance = Words::new(frame);
        let mut counters = frame.desc().cost.then(|| Words::new(frame));
        for (x, y) in frame.pixels() {
            for half in 0..frame.halves() {
                if let Some(film) = frame.film(x, y, half) {
                    radiance.write(film.sum.map(f64::to_bits));
                    radiance.write([film.samples]);
                }
                if let (Some(counters), Some(cost)) = (&mut counters, frame.cost(x, y, half)) {
                    counters.write(cost.counts);
                    counters.write([cost.samples]);
                }
            }
        }
        Self { radiance: radiance.hex(), counters: counters.map(|words| words.hex()) }
    }
}

struct Words(RawHasher<&'static [u8; DEFAULT_SECRET_LENGTH]>);

impl Words {
    fn new(frame: &Frame) -> Self {
        let mut words = Self(RawHasher::new(SecretBuffer::default()));
        let desc = frame.desc();
        words.write([u64::from(desc.width), u64::from(desc.height), frame.halves() as u64]);
        words
    }

    fn write(&mut self, words: impl IntoIterator<Item = u64>) {
        for word in words {
            self.0.write(&word.to_le_bytes());
        }
    }

    fn hex(&self) -> String {
        format!("{:032x}", self.0.finish_128())
    }
}
