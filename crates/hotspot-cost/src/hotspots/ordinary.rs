//! What a hotspot is held against: the frame's pixels of about the median cost.

use super::{Factors, HotspotInput};
use hotspot_probe::NONE;

/// Fewer pixels that show a surface than this are no picture of one: the background counts then too.
const FEWEST: usize = 16;

/// The fifth of the pixels in the middle by cost, in order of their indices: of those that show a surface, since the background
/// costs a single ray that says nothing about paths. All that have a finite cost where objects are unknown (empty) or hardly any
/// pixel shows one.
///
/// # Panics
/// When `objects` is neither empty nor as long as `cost`.
pub fn ordinary_pixels(cost: &[f32], objects: &[u32]) -> Vec<u32> {
    assert!(objects.is_empty() || objects.len() == cost.len(), "the object plane does not fit its size");
    let finite = || (0..cost.len() as u32).filter(|index| cost[*index as usize].is_finite());
    let mut pixels: Vec<u32> =
        finite().filter(|index| objects.get(*index as usize).is_none_or(|object| *object != NONE)).collect();
    if pixels.len() < FEWEST {
        pixels = finite().collect();
    }
    let by_cost = |index: &u32| cost[*index as usize];
    // Of equal costs (there are many in simple scenes) none is preferred by where it lies.
    let shuffled = |index: &u32| index.wrapping_mul(0x9e37_79b1).rotate_left(16).wrapping_mul(0x85eb_ca6b);
    pixels.sort_unstable_by(|a, b| {
        by_cost(a).total_cmp(&by_cost(b)).then_with(|| shuffled(a).cmp(&shuffled(b))).then(a.cmp(b))
    });
    let (from, to) = (pixels.len() * 2 / 5, (pixels.len() * 3).div_ceil(5));
    let mut pixels = pixels[from..to].to_vec();
    pixels.sort_unstable();
    pixels
}

/// Means over some pixels; `None` where a plane is not given.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Means {
    cost: Option<f64>,
    rays: Option<f64>,
    shadow_rays: Option<f64>,
    nodes: Option<f64>,
    shapes: Option<f64>,
    waste: Option<f64>,
}

impl Means {
    pub(super) fn of(input: &HotspotInput<'_>, pixels: &[u32]) -> Self {
        let mean = |plane: &[f32]| {
            (!plane.is_empty() && !pixels.is_empty()).then(|| {
                pixels.iter().map(|index| f64::from(plane[*index as usize])).sum::<f64>()
                    / pixels.len() as f64
            })
        };
        Self {
            cost: mean(input.cost),
            rays: mean(input.rays),
            shadow_rays: mean(input.shadow_rays),
            nodes: mean(input.nodes),
            shapes: mean(input.shapes),
            waste: mean(input.waste),
        }
    }

    fn vertices(&self) -> Option<f64> {
        Some(self.rays? - self.shadow_rays?)
    }

    /// These against those of ordinary pixels.
    pub(super) fn against(&self, ordinary: &Self) -> Factors {
        let ratio = |of: &dyn Fn(&Self) -> Option<f64>| {
            let (here, there) = (of(self)?, of(ordinary)?);
            (there > 0.0 && here.is_finite()).then(|| here / there)
        };
        let share = |part: Option<f64>, by: Option<f64>| match (part, by) {
            (Some(part), Some(by)) if by > 0.0 => Some(part / by),
            _ => None,
        };
        Factors {
            cost: ratio(&|m| m.cost),
            rays_per_path: ratio(&|m| m.rays),
            vertices_per_path: ratio(&Self::vertices),
            rays_per_vertex: ratio(&|m| share(m.rays, m.vertices())),
            nodes_per_ray: ratio(&|m| share(m.nodes, m.rays)),
            shapes_per_ray: ratio(&|m| share(m.shapes, m.rays)),
            cost_per_node: ratio(&|m| share(m.cost, m.nodes)),
            waste_share: share(self.waste, self.cost),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinary_is_the_middle_of_what_shows_a_surface() {
        let cost: Vec<f32> = (0..100).map(|i| i as f32).collect();
        assert_eq!(ordinary_pixels(&cost, &[]), (40..60).collect::<Vec<_>>());
        // Half of it is background.
        let objects: Vec<u32> = (0..100).map(|i| if i < 50 { NONE } else { 0 }).collect();
        assert_eq!(ordinary_pixels(&cost, &objects), (70..80).collect::<Vec<_>>());
        // Nearly all of it: the surface is not enough.
        let objects: Vec<u32> = (0..100).map(|i| if i < 95 { NONE } else { 0 }).collect();
        assert_eq!(ordinary_pixels(&cost, &objects), (40..60).collect::<Vec<_>>());
        assert!(ordinary_pixels(&[f32::NAN; 4], &[]).is_empty());
    }

    #[test]
    fn equal_costs_are_drawn_from_everywhere() {
        let chosen = ordinary_pixels(&[1.0; 1000], &[]);
        assert_eq!(chosen.len(), 200);
        for part in 0..4 {
            let inside = chosen.iter().filter(|index| **index / 250 == part).count();
            assert!((30..=70).contains(&inside), "{part}: {inside}");
        }
    }

    #[test]
    fn the_cost_is_the_product_of_its_factors() {
        let plane = |hot: f32, plain: f32| [hot, plain, plain, plain, plain];
        let (rays, shadow) = (plane(9.0, 4.0), plane(3.0, 2.0));
        let (nodes, shapes) = (plane(90.0, 20.0), plane(30.0, 20.0));
        let cost: Vec<f32> = nodes.iter().zip(&shapes).map(|(n, s)| n + s).collect();
        let input = HotspotInput {
            width: 5,
            height: 1,
            cost: &cost,
            rays: &rays,
            shadow_rays: &shadow,
            nodes: &nodes,
            shapes: &shapes,
            ..HotspotInput::default()
        };
        let f = Means::of(&input, &[0]).against(&Means::of(&input, &[1, 2, 3]));
        assert_eq!((f.cost, f.vertices_per_path, f.rays_per_vertex), (Some(3.0), Some(3.0), Some(0.75)));
        let product = f.vertices_per_path.unwrap()
            * f.rays_per_vertex.unwrap()
            * f.nodes_per_ray.unwrap()
            * f.cost_per_node.unwrap();
        assert!((product - 3.0).abs() < 1e-12);
        assert_eq!(f.waste_share, None);
    }
}
