//! What the cross-crate tests share: small scenes made in memory, pictures as arrays, the statistics that decide, and the
//! reference images where they are at hand.
//!
//! Every statistical test states its false-alarm rate; nothing here is random beyond the seeds that the tests name, so a
//! test that passes once passes always.
#![forbid(unsafe_code)]

pub mod agreement;
pub mod albedo;
pub mod forms;
pub mod measured;
pub mod picture;
pub mod reference;
pub mod stats;
pub mod twin;
pub mod world;

use std::io::Write;

/// Prints a line of a report. It goes straight to standard error: the test runner keeps what `println!` and `eprintln!`
/// write to itself while a test passes.
pub fn say(line: &str) {
    // A closed pipe is no reason for a test to fail.
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}
