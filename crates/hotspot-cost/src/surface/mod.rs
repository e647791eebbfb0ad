//! Cost on surfaces: sums at the vertices of meshes, and the glTF file that shows them.
//!
//! **What is booked where.** A path is rays r_0 … each cast from where the one before it landed. Where r_i lands, C_tr(r_i) and the
//! cost of the shadow ray cast from there, C_vis(r_i), are booked: the terms of C(p) one by one. What the last ray of an escaped path
//! cost has no place on a surface and is kept apart, so that booked and escaped add up to the paths' cost exactly.
//!
//! **Exact.** Barycentric weights are rounded to parts of 2^16 that sum to 1, and sums are integers of such parts: nothing is lost,
//! and the order of additions does not matter.

#[cfg(feature = "maps")]
mod colors;
mod glb;

#[cfg(feature = "maps")]
pub use colors::{SurfaceScale, UNSEEN, vertex_colors};
pub use glb::{SurfaceCamera, SurfacePart, write_glb};

use crate::metric::CostModel;
use std::sync::atomic::{AtomicU64, Ordering};

/// Parts that a weight of 1 has.
pub const ONE: u64 = 1 << 16;

/// Cost of some rays, in exact counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceCounts {
    /// Camera and bounce rays.
    pub rays: u64,
    /// Nodes that they and the shadow rays cast where they landed visited.
    pub nodes: u64,
    /// Triangles tested.
    pub shapes: u64,
}

impl SurfaceCounts {
    /// Equation 1: c0 · nodes + c1 · shapes.
    pub fn cost(&self, model: CostModel) -> f64 {
        model.c0 * self.nodes as f64 + model.c1 * self.shapes as f64
    }

    /// Adds another's counts.
    pub const fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.nodes += other.nodes;
        self.shapes += other.shapes;
    }
}

/// Sums at vertices, filled by any number of workers at once. 24 bytes per vertex.
#[derive(Debug)]
pub struct SurfaceSums {
    vertices: Vec<[AtomicU64; 3]>,
}

/// What a vertex got, in parts of [`ONE`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VertexSum {
    /// Weights of the rays that landed around it.
    pub rays: u64,
    /// Nodes.
    pub nodes: u64,
    /// Triangles tested.
    pub shapes: u64,
}

impl VertexSum {
    /// Rays.
    pub fn rays(&self) -> f64 {
        self.rays as f64 / ONE as f64
    }

    /// Equation 1.
    pub fn cost(&self, model: CostModel) -> f64 {
        (model.c0 * self.nodes as f64 + model.c1 * self.shapes as f64) / ONE as f64
    }
}

impl SurfaceSums {
    /// Bytes per vertex.
    pub const BYTES: u64 = size_of::<[AtomicU64; 3]>() as u64;

    /// Nothing at each of so many vertices.
    pub fn new(vertices: usize) -> Self {
        Self { vertices: (0..vertices).map(|_| Default::default()).collect() }
    }

    /// Shares the cost of one ray out among three vertices, by the weights of the second and the third: they are taken into the triangle
    /// first, so that what is not a number counts as 0.
    ///
    /// # Panics
    /// When there is no such vertex.
    #[inline]
    pub fn land(&self, vertices: [u32; 3], weights: [f32; 2], cost: &SurfaceCounts) {
        let part = |weight: f32, most: u64| ((weight * ONE as f32).round() as u64).min(most);
        let second = part(weights[0], ONE);
        let third = part(weights[1], ONE - second);
        for (vertex, weight) in vertices.into_iter().zip([ONE - second - third, second, third]) {
            let [rays, nodes, shapes] = &self.vertices[vertex as usize];
            for (sum, count) in [(rays, cost.rays), (nodes, cost.nodes), (shapes, cost.shapes)] {
                sum.fetch_add(weight * count, Ordering::Relaxed);
            }
        }
    }

    /// What a vertex got.
    ///
    /// # Panics
    /// When there is no such vertex.
    pub fn vertex(&self, vertex: usize) -> VertexSum {
        let [rays, nodes, shapes] = [0, 1, 2].map(|i| self.vertices[vertex][i].load(Ordering::Relaxed));
        VertexSum { rays, nodes, shapes }
    }

    /// What all vertices got together: whole numbers, since every ray's parts sum to 1.
    pub fn total(&self) -> SurfaceCounts {
        let sum = |i: usize| -> u64 {
            let parts: u128 = self.vertices.iter().map(|v| u128::from(v[i].load(Ordering::Relaxed))).sum();
            (parts / u128::from(ONE)) as u64
        };
        SurfaceCounts { rays: sum(0), nodes: sum(1), shapes: sum(2) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn nothing_is_lost_whatever_the_weights() {
        let sums = SurfaceSums::new(5);
        let mut random = Random::new(3);
        let mut all = SurfaceCounts::default();
        let hostile = [f32::NAN, -1.0, 2.0, f32::INFINITY, 1.0, 0.0];
        for k in 0..2000 {
            let u = if k % 3 == 0 { hostile[k / 3 % 6] } else { random.unit() as f32 };
            let v = (1.0 - u) * random.unit() as f32;
            let cost = SurfaceCounts {
                rays: 1,
                nodes: u64::from(random.below(90)),
                shapes: u64::from(random.below(7)),
            };
            all.add(&cost);
            sums.land([random.below(5), random.below(5), random.below(5)], [u, v], &cost);
        }
        assert_eq!(sums.total(), all);
        assert_eq!(all.cost(CostModel { c0: 2.0, c1: 3.0 }), (2 * all.nodes + 3 * all.shapes) as f64);
    }

    #[test]
    fn a_corner_gets_all_of_a_ray_that_lands_on_it() {
        let sums = SurfaceSums::new(4);
        let cost = SurfaceCounts { rays: 1, nodes: 10, shapes: 4 };
        sums.land([1, 2, 3], [1.0, 0.0], &cost);
        sums.land([1, 2, 3], [0.25, 0.5], &cost);
        let rays: Vec<f64> = (0..4).map(|v| sums.vertex(v).rays()).collect();
        assert_eq!(rays, [0.0, 0.25, 1.25, 0.5]);
        assert_eq!(sums.vertex(2).cost(CostModel::default()), 1.25 * 14.0);
    }
}
