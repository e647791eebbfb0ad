//! How far two pictures differ beyond their noise.

use crate::layers::{Layers, RADIANCE};
use serde::{Deserialize, Serialize};

/// The difference of picture B from picture A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PictureChange {
    /// Mean over pixels and channels of (b − a)²/(a² + 0.01) without what noise adds to it; see [`PictureChange::of`].
    /// Around 0, also below, where only noise differs. Absent where a side has no halves.
    pub relmse: Option<f64>,
    /// Standard error of `relmse`.
    pub relmse_error: Option<f64>,
    /// Mean FLIP difference of the tone-mapped pictures, 0 to 1, noise included. Absent when not computed.
    pub flip: Option<f64>,
    /// The same between the two halves of A: what noise alone amounts to at half the samples. Absent when not computed.
    pub flip_noise: Option<f64>,
}

impl PictureChange {
    /// The relative squared difference of two renders with halves.
    ///
    /// With d = b − a of a pixel and h = half_b − half_a, the halves' own differences are d + h and d − h. They are independent
    /// estimates of the true difference, also where the renders share their random numbers (which halves do not), so their
    /// product d² − h² estimates its square without bias: two noisy renders of one picture do not differ. The weight
    /// 1/(a² + 0.01) is that of the usual relMSE, with the noisy a.
    pub fn of(a: &Layers, b: &Layers) -> Self {
        let none = Self::default();
        if (a.width, a.height) != (b.width, b.height) || a.pixels() == 0 {
            return none;
        }
        let (mut sum, mut squares) = (0.0, 0.0);
        let mut values = vec![0.0; a.pixels()];
        for (name, long) in RADIANCE {
            let half = format!("half.{long}");
            let planes = [a.plane(name), b.plane(name), a.plane(&half), b.plane(&half)];
            let [Some(a), Some(b), Some(half_a), Some(half_b)] = planes else { return none };
            for (i, value) in values.iter_mut().enumerate() {
                let difference = f64::from(b[i]) - f64::from(a[i]);
                let half = f64::from(half_b[i]) - f64::from(half_a[i]);
                let weight = 1.0 / (f64::from(a[i]).powi(2) + 0.01);
                let own = (difference * difference - half * half) * weight / 3.0;
                *value += if own.is_finite() { own } else { 0.0 };
            }
        }
        for value in &values {
            sum += value;
            squares += value * value;
        }
        let count = values.len() as f64;
        let mean = sum / count;
        let variance = (squares / count - mean * mean).max(0.0) / (count - 1.0).max(1.0);
        Self { relmse: Some(mean), relmse_error: Some(variance.sqrt()), ..none }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    fn picture(random: &mut Random, level: f64, noise: f64) -> Layers {
        let mut layers = Layers::new(64, 64);
        for (name, long) in RADIANCE {
            let [a, b]: [Vec<f64>; 2] =
                [0; 2].map(|_| (0..64 * 64).map(|_| level + noise * random.normal()).collect());
            let both = a.iter().zip(&b);
            layers.insert(name, both.clone().map(|(a, b)| (0.5 * (a + b)) as f32).collect());
            layers.insert(format!("half.{long}"), both.map(|(a, b)| (0.5 * (a - b)) as f32).collect());
        }
        layers
    }

    /// Without taking off h², the first would be 0.02²/1.01 = 4e-4.
    #[test]
    fn noise_is_no_difference_and_a_difference_is_found_through_noise() {
        let mut random = Random::new(4);
        let noisy = |random: &mut Random| picture(random, 1.0, 0.02);
        let same = PictureChange::of(&noisy(&mut random), &noisy(&mut random));
        let (relmse, error) = (same.relmse.unwrap(), same.relmse_error.unwrap());
        assert!(relmse.abs() < 4.0 * error && error < 1e-5, "{same:?}");
        let brighter = picture(&mut random, 1.01, 0.02);
        let change = PictureChange::of(&noisy(&mut random), &brighter);
        let expected = 1e-4 / 1.01;
        assert!((change.relmse.unwrap() - expected).abs() < 4.0 * change.relmse_error.unwrap(), "{change:?}");
    }

    #[test]
    fn what_cannot_be_told_is_absent() {
        let mut random = Random::new(5);
        let mut bare = picture(&mut random, 1.0, 0.1);
        let whole = bare.clone();
        bare.planes.remove("half.red");
        assert_eq!(PictureChange::of(&whole, &bare), PictureChange::default());
        assert_eq!(PictureChange::of(&whole, &Layers::new(2, 2)), PictureChange::default());
    }
}
