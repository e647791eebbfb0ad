//! Colour maps: which colour stands for which part of a scale.

use colorgrad::Gradient;

/// Drawn where a value is not a number or infinite: magenta, which none of the colour maps contains.
pub const SIGNAL: [u8; 3] = [255, 0, 255];

/// A colour map over 0..1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ColorMap {
    /// Sequential, black over red to pale yellow; perceptually uniform.
    #[default]
    Inferno,
    /// Sequential, violet over green to yellow; perceptually uniform, safe for the colour-blind.
    Viridis,
    /// Sequential rainbow: tells more steps apart, not uniform.
    Turbo,
    /// Diverging, blue below zero, near-white at zero, red above: red means that the second picture is costlier.
    RedBlue,
}

impl ColorMap {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Inferno, Self::Viridis, Self::Turbo, Self::RedBlue];

    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Inferno => "inferno",
            Self::Viridis => "viridis",
            Self::Turbo => "turbo",
            Self::RedBlue => "red-blue",
        }
    }

    /// The map of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|map| map.name() == name)
    }

    /// Whether its middle stands for zero; views of diverging maps are symmetric about zero.
    pub const fn is_diverging(self) -> bool {
        matches!(self, Self::RedBlue)
    }

    /// Colours at `n` even steps over 0..1, both ends included; an odd `n` contains the exact middle.
    pub fn lut(self, n: usize) -> Vec<[u8; 3]> {
        let gradient: Box<dyn Gradient> = match self {
            Self::Inferno => Box::new(colorgrad::preset::inferno()),
            Self::Viridis => Box::new(colorgrad::preset::viridis()),
            Self::Turbo => Box::new(colorgrad::preset::turbo()),
            Self::RedBlue => Box::new(colorgrad::preset::rd_bu()),
        };
        let last = n.saturating_sub(1).max(1) as f32;
        (0..n)
            .map(|i| {
                let t = i as f32 / last;
                // The preset runs from red to blue.
                let [r, g, b, _] = gradient.at(if self.is_diverging() { 1.0 - t } else { t }).to_rgba8();
                [r, g, b]
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_maps() {
        for map in ColorMap::ALL {
            assert_eq!(ColorMap::from_name(map.name()), Some(map));
        }
        assert_eq!(ColorMap::from_name("jet"), None);
    }

    #[test]
    fn red_is_positive_and_the_middle_is_neutral() {
        let lut = ColorMap::RedBlue.lut(257);
        let (low, middle, high) = (lut[0], lut[128], lut[256]);
        assert!(low[2] > low[0] && high[0] > high[2], "{low:?} {high:?}");
        let (min, max) = (middle.iter().min().unwrap(), middle.iter().max().unwrap());
        assert!(max - min <= 6 && *min > 230, "neutral: {middle:?}");
    }

    #[test]
    fn no_map_contains_the_signal_colour() {
        for map in ColorMap::ALL {
            let distance = |c: &[u8; 3]| (0..3).map(|i| u32::from(c[i].abs_diff(SIGNAL[i]))).sum::<u32>();
            assert!(map.lut(1025).iter().all(|c| distance(c) > 100), "{}", map.name());
        }
    }

    #[test]
    fn small_tables_do_not_panic() {
        assert!(ColorMap::Turbo.lut(0).is_empty());
        assert_eq!(ColorMap::Turbo.lut(1).len(), 1);
    }
}
