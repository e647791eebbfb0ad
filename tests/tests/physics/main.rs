//! Pictures with known answers: closed forms, quadratures, symmetries.
//!
//! Where all pixels have the same expectation, they are independent replicates, and their spread gives σ. A comparison
//! fails beyond 4σ (false-alarm rate 6e-5 each, some 500 in all): [`hotspot_tests::measured`]. Closed forms at σ ≤ 0.1 % are
//! the room `analytic`'s next door.

mod bsdf;
mod bumps;
mod closed;
mod cutouts;
mod default_light;
mod depth;
mod emitters;
mod environment;
mod furnace;
mod instances;
mod placing;
mod punctual;
mod surfaces;

use hotspot_tests::measured::{Measured, measure, measure_with};
