//! Speed against error: what `error.json` holds and how its figures follow from the runs.
//!
//! A run is one render of one configuration with one seed at one number of samples per pixel, with its seconds and its
//! errors against a reference ([`crate::picture_error`]). Everything else is derived, seed by seed, so that samples that
//! runs of one seed share (4 samples per pixel are the first of 16) never pass for independent:
//!
//! * a **point** is the median over seeds, with the interval of order statistics: between the k-th smallest and the k-th
//!   largest lies the true median with probability 1 − 2 P(Binomial(n, ½) < k), whatever the distribution. The largest k that
//!   still gives 95 % is used; below 6 seeds even k = 1 does not, so the stated coverage is less (5 seeds: 93.75 %);
//! * a **slope** is fitted for each seed: least squares of log error on log spp. Independent samples give −1 in squared
//!   error. Its mean over seeds has Student's interval;
//! * **seconds to an error** are interpolated for each seed on the line between the neighbouring points in log seconds, log
//!   error; never extrapolated. `None` where the error is not reached, or already at the first point;
//! * **ratios** of two configurations are taken seed by seed (their runs stand next to each other in time), in logarithms, with
//!   Student's interval.
//!
//! The error used is the unbiased relMSE where the reference has halves (and it is above 0), else the plain one, which
//! flattens at the reference's noise floor.

mod fit;
mod report;
#[cfg(test)]
mod tests;

pub use fit::{Crossing, Estimate, Middle, mean_with_interval, median_with_interval, seconds_to, slope};
pub use report::{ConfigSummary, ErrorReport, Point, Ratio, ReferenceFacts, Run, SCHEMA};

/// The JSON Schema of [`ErrorReport`].
pub const JSON_SCHEMA: &str = include_str!("../../schema/hotspot-error-1.schema.json");
