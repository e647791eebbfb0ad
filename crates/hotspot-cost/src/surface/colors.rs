//! Costs at vertices as colours.

use crate::maps::ColorMap;

/// Colour of vertices where no ray landed: a grey that no colour map contains, linear.
pub const UNSEEN: [f32; 3] = [0.05; 3];

/// Steps of the colour table.
const STEPS: usize = 1025;

/// Which costs get the first and the last colour of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceScale {
    /// First colour.
    pub lo: f64,
    /// Last colour.
    pub hi: f64,
}

impl SurfaceScale {
    /// From the least value to that which `percentile` percent of the rays lie below: each value counts by the rays that landed there, so
    /// that the noise of vertices which few rays met does not set the scale. `values`: (value, rays).
    pub fn auto(values: impl Iterator<Item = (f32, f32)>, percentile: f64) -> Self {
        let mut seen: Vec<(f32, f32)> =
            values.filter(|(value, rays)| value.is_finite() && *rays > 0.0).collect();
        seen.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let all: f64 = seen.iter().map(|(_, rays)| f64::from(*rays)).sum();
        let below = |share: f64| {
            let mut sum = 0.0;
            let at = seen.iter().find(|(_, rays)| {
                sum += f64::from(*rays);
                sum >= share * all
            });
            at.or(seen.last()).map_or(0.0, |(value, _)| f64::from(*value))
        };
        let percentile = (percentile / 100.0).clamp(0.0, 1.0);
        let (lo, hi) = (below(1.0 - percentile), below(percentile));
        Self { lo, hi: if hi > lo { hi } else { lo + 1.0 } }
    }
}

/// Colours for COLOR_0: linear RGBA in 16 bits. `values`: (value, rays).
pub fn vertex_colors(
    values: impl Iterator<Item = (f32, f32)>,
    map: ColorMap,
    scale: SurfaceScale,
) -> Vec<[u16; 4]> {
    let linear = |c: u8| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let bits = |c: f64| (c * 65535.0).round() as u16;
    let table: Vec<[u16; 4]> = map
        .lut(STEPS)
        .into_iter()
        .map(|[r, g, b]| [bits(linear(r)), bits(linear(g)), bits(linear(b)), u16::MAX])
        .collect();
    let [r, g, b] = UNSEEN.map(|c| bits(f64::from(c)));
    values
        .map(|(value, rays)| {
            if !(rays > 0.0 && value.is_finite()) {
                return [r, g, b, u16::MAX];
            }
            let place = (f64::from(value) - scale.lo) / (scale.hi - scale.lo);
            table[(place.clamp(0.0, 1.0) * (STEPS - 1) as f64).round() as usize]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_the_scale_get_the_ends_of_the_map() {
        let values = [(1.0, 1.0), (3.0, 1.0), (9.0, 1.0), (2.0, 0.0), (f32::NAN, 1.0)];
        let colors = vertex_colors(values.into_iter(), ColorMap::Viridis, SurfaceScale { lo: 1.0, hi: 3.0 });
        // Viridis begins at #440154 and ends at #fee825 or a step beside it.
        assert!(colors[0][2] > colors[0][0] && colors[0][0] > colors[0][1], "{colors:?}");
        assert!(colors[1][0] > 60000 && colors[1][2] < 2000, "{colors:?}");
        assert_eq!(colors[1], colors[2], "beyond the end");
        assert_eq!((colors[3], colors[4]), ([3277, 3277, 3277, 65535], [3277, 3277, 3277, 65535]));
    }

    #[test]
    fn few_rays_do_not_set_the_scale() {
        let many = (0..1000).map(|k| (10.0 + (k % 10) as f32, 5.0));
        let scale = SurfaceScale::auto(many.chain([(500.0, 0.01), (900.0, 0.0)]), 99.0);
        assert_eq!((scale.lo, scale.hi), (10.0, 19.0));
        let none = SurfaceScale::auto(core::iter::empty(), 99.0);
        assert!(none.hi > none.lo);
    }
}
