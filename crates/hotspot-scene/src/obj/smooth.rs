//! Normals of smoothing groups (`s 1`), for faces that state none.
//!
//! The normal of a vertex within a group is the sum of the unit normals of the group's triangles around it, each weighted by
//! its angle at the vertex (Thürmer and Wüthrich, *Computing Vertex Normals from Polygonal Facets*, 1998): however a polygon
//! is split into triangles, its angles at a corner add up to the same, so that the normal does not depend on the splitting.
//! Weights by the areas of triangles would tilt the corners of a box towards the faces whose diagonals end there. Groups
//! reach across objects and materials; between groups, and towards faces without one, edges stay hard.

/// Sums by index of a vertex in a smoothing group, as the corners of [`super::parse::Shading::Smooth`] name it.
pub(super) struct Smoother {
    sums: Vec<[f64; 3]>,
}

impl Smoother {
    pub(super) fn new(count: usize) -> Self {
        Self { sums: vec![[0.0; 3]; count] }
    }

    /// Adds a triangle to the sums of its corners. One without a normal, or not finite, adds nothing.
    pub(super) fn add(&mut self, corners: [[f32; 3]; 3], sums: [u32; 3]) {
        // Differences and squares of f32 numbers fit f64's range.
        let corners = corners.map(|corner| corner.map(f64::from));
        let [a, b, c] = corners;
        let normal = cross(sub(b, a), sub(c, a));
        let length = dot(normal, normal).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return;
        }
        for (start, [from, to, other]) in sums.into_iter().zip([[a, b, c], [b, c, a], [c, a, b]]) {
            let (u, v) = (sub(to, from), sub(other, from));
            let angle = libm::atan2(length, dot(u, v));
            if let Some(sum) = self.sums.get_mut(start as usize) {
                sum.iter_mut().zip(normal).for_each(|(sum, n)| *sum += angle * (n / length));
            }
        }
    }

    /// The unit normal, or zero where triangles cancel or there are none.
    pub(super) fn normal(&self, index: u32) -> [f32; 3] {
        let sum = self.sums.get(index as usize).copied().unwrap_or_default();
        let length = dot(sum, sum).sqrt();
        // Opposite faces leave what rounding leaves of them.
        if length > 1e-9 { sum.map(|c| (c / length) as f32) } else { [0.0; 3] }
    }
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
