//! Hard numbers, held against f64, closed forms and the promises of `NUMBERS.md`, which maps each hard case to its tests.
//!
//! Bounded here; the same with full counts behind `--ignored`. Seeds are fixed: what passes once passes always.

mod accumulation;
mod gaps;
mod non_finite;
mod roughness;
mod spans;
