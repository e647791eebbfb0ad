//! Russian roulette: with which probability a path goes on from a vertex.
//!
//! **pbrt-v3's rule** ([`Roulette::From`]): the throughput, at most 0.95. It knows neither what the rest of a path brings nor what it
//! costs, and punishes paths that start on a dark surface although their pixel is dark as well.
//!
//! **For efficiency** ([`Roulette::Efficient`]). Let a path with throughput w reach a vertex from which it would bring w·L more and
//! cost C more. To go on with probability p, at a weight of 1/p, adds `w² E[L²] (1/p − 1)` to the variance V of a sample and takes
//! C (1 − p) from its cost T. The least V·T, which is what decides about the time to an error, has V′/V = −T′/T, so
//!
//! > `p = w √(E[L²] / E[C] · T / V)`
//!
//! (Bolin and Meyer, *An Error Metric for Monte Carlo Ray Tracing*, 1997; Rath et al., *EARS: Efficiency-Aware Russian Roulette and
//! Splitting*, SIGGRAPH 2022, who learn L and C place by place). Here the square root is one number for the scene, the *gain*, found by a
//! few thousand paths before the render ([`pilot`]). Errors count in relation to the pixel, whose value follows the weight of the first
//! scattering: so w is the throughput over that of the first vertex. The first vertex itself always goes on.
//!
//! Unbiased with any gain. Cost maps: paths are as long as pays, which changes everything that is counted from the second vertex on.

mod pilot;

pub(crate) use pilot::Pilot;

/// When paths may be ended at random.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Roulette {
    /// Never.
    Off,
    /// From this surface vertex (counted from 0) on, by pbrt-v3's rule: with a throughput below 1 the path goes on with that
    /// probability, at most 0.95.
    From(u32),
    /// From the second surface vertex on, as likely as makes the least error for the time; how likely that is, some thousand paths find
    /// out before the first sample (counted in the render's seconds). Where there is nothing to find, as in baking without a camera,
    /// twice the throughput over that of the first vertex.
    Efficient,
}

/// What the path loop needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Survival {
    /// First vertex at which paths may end.
    pub(crate) from: u32,
    /// Survival over relative throughput; `None`: throughputs are not relative to the first vertex's.
    pub(crate) gain: Option<f32>,
}

/// A first scattering that weighs less counts as this much: nobody sees noise in what is nearly black.
pub(crate) const LEAST_BASE: f32 = 0.1;
/// Where nothing can be found out, and to find out with.
const USUAL_GAIN: f32 = 2.0;

impl Survival {
    /// As asked for; `learn` finds the gain where one is needed, from the survival to try with.
    pub(crate) fn new(roulette: Roulette, learn: impl FnOnce(Self) -> Option<f32>) -> Self {
        match roulette {
            Roulette::Off => Self { from: u32::MAX, gain: None },
            Roulette::From(from) => Self { from, gain: None },
            Roulette::Efficient => {
                let usual = Self { from: 1, gain: Some(USUAL_GAIN) };
                Self { gain: learn(usual).or(usual.gain), ..usual }
            }
        }
    }

    /// What relative throughputs are multiplied by, after a first scattering of this weight (largest component).
    #[inline(always)]
    pub(crate) fn relative(gain: f32, weight: f32) -> f32 {
        gain / if weight > LEAST_BASE { weight } else { LEAST_BASE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn throughputs_are_relative_to_the_first_unless_that_is_tiny() {
        assert_eq!(Survival::relative(2.0, 0.5), 4.0);
        assert_eq!(Survival::relative(2.0, 4.0), 0.5);
        for weight in [0.05, 0.0, f32::NAN] {
            assert_eq!(Survival::relative(2.0, weight), 2.0 / LEAST_BASE);
        }
        assert_eq!(Survival::relative(2.0, f32::INFINITY), 0.0);
    }

    #[test]
    fn only_efficient_roulette_asks_for_a_gain() {
        let never = |_| -> Option<f32> { unreachable!("no gain is needed") };
        assert_eq!(Survival::new(Roulette::Off, never), Survival { from: u32::MAX, gain: None });
        assert_eq!(Survival::new(Roulette::From(3), never), Survival { from: 3, gain: None });
        let found = Survival::new(Roulette::Efficient, |usual| usual.gain.map(|gain| 2.0 * gain));
        assert_eq!(found, Survival { from: 1, gain: Some(2.0 * USUAL_GAIN) });
        assert_eq!(Survival::new(Roulette::Efficient, |_| None).gain, Some(USUAL_GAIN));
    }
}
