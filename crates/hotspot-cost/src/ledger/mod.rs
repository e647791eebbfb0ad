//! Ledgers: each count of a frame booked twice, by what sent the ray and by what it met.
//!
//! * **Spawner**: object × material × bounce × kind of ray (× object of the light aimed at).
//! * **Payer**: a node or leaf block of the tree belongs to an object if every triangle below it does, otherwise to the
//!   `scene`; triangles tested are booked one by one.
//! * **Matrix**: spawning object × paying object: whose fault, and at whose expense.
//!
//! Each sums to the frame's totals to the last count. A share in a ledger is no saving: without an object its rays would go
//! elsewhere.

mod bins;
mod cells;
mod csv;
mod gather;
mod payers;
mod rows;

pub use bins::{Aim, RayKey, Sender};
pub use gather::{BookedPath, BookedPaths, BookedRay, BookedVisit, Ledger};
pub use payers::{Payer, PayerDesc, Payers};
pub use rows::{Ledgers, MatrixRow, PayerRow, SpawnerKind, SpawnerRow, Traversal};

#[cfg(test)]
mod tests;
