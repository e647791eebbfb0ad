//! Polygons to triangles: convex ones as fans, others by ear clipping (`earcut`).

use earcut::utils3d::project3d_to_2d;
use earcut::{Earcut, deviation};

/// Largest polygon that is clipped: time may grow with the square of its corners.
const MAX_CLIPPED: usize = 4096;

/// Splits polygons, and keeps its buffers from one to the next.
pub(super) struct Splitter {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
    /// Concave polygons that only a fan was left for: those that cross themselves, or are too large.
    pub(super) fans: u64,
}

impl Splitter {
    pub(super) fn new() -> Self {
        Self { earcut: Earcut::new(), flat: Vec::new(), indices: Vec::new(), fans: 0 }
    }

    /// Appends the triangles of the polygon with these corners, which turn the same way.
    pub(super) fn split(&mut self, polygon: &[u32], positions: &[[f32; 3]], out: &mut Vec<[u32; 3]>) {
        let Some((first, rest)) = polygon.split_first() else { return };
        if let Some(points) = concave(polygon, positions) {
            if self.clip(&points) {
                let triangles = self.indices.as_chunks::<3>().0;
                let turned =
                    |[a, b, c]: [[f64; 2]; 3]| (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]);
                out.extend(triangles.iter().map(|triangle| {
                    let [a, b, c] = triangle.map(|i| polygon.get(i as usize).copied().unwrap_or(*first));
                    let flat = triangle.map(|i| self.flat.get(i as usize).copied().unwrap_or_default());
                    // The projection looks against the polygon's normal.
                    if turned(flat) { [a, c, b] } else { [a, b, c] }
                }));
                return;
            }
            self.fans += 1;
        }
        out.extend(rest.windows(2).filter_map(|pair| Some([*first, *pair.first()?, *pair.last()?])));
    }

    /// Clips ears into `indices`; false where the triangles do not cover the polygon.
    fn clip(&mut self, points: &[[f64; 3]]) -> bool {
        if points.len() > MAX_CLIPPED || !project3d_to_2d(points, points.len(), &mut self.flat) {
            return false;
        }
        self.earcut.earcut(self.flat.iter().copied(), &[], &mut self.indices);
        deviation(self.flat.iter().copied(), &[], &self.indices) < 1e-6
    }
}

/// The corners relative to the first one and of about unit size, where the polygon has an area and a corner that turns
/// against it.
fn concave(polygon: &[u32], positions: &[[f32; 3]]) -> Option<Vec<[f64; 3]>> {
    if polygon.len() < 4 {
        return None;
    }
    let points: Option<Vec<_>> =
        polygon.iter().map(|i| Some(positions.get(*i as usize)?.map(f64::from))).collect();
    let mut points = points?;
    let origin = *points.first()?;
    for point in &mut points {
        *point = sub(*point, origin);
    }
    let size = points.iter().flatten().fold(0.0f64, |size, c| size.max(c.abs()));
    // NaN is dealt with by whoever cleans the mesh.
    if !(size > 0.0 && points.iter().flatten().all(|c| c.is_finite())) {
        return None;
    }
    points.iter_mut().flatten().for_each(|c| *c /= size);
    let count = points.len();
    let corner = |i: usize| points.get(i % count).copied().unwrap_or_default();
    let mut normal = [0.0; 3];
    for i in 0..count {
        let area = cross(corner(i), corner(i + 1));
        normal.iter_mut().zip(area).for_each(|(sum, c)| *sum += c);
    }
    let against = |i: usize| {
        let (u, v) = (sub(corner(i + 1), corner(i)), sub(corner(i + 2), corner(i + 1)));
        // Straight corners bend a little either way by rounding.
        let tolerance = 1e-6 * (dot(u, u) * dot(v, v) * dot(normal, normal)).sqrt();
        dot(cross(u, v), normal) < -tolerance
    };
    (normal != [0.0; 3] && (0..count).any(against)).then_some(points)
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of a polygon, with their areas along its normal `axis`.
    fn split(corners: &[[f32; 3]], axis: [f64; 3]) -> (Vec<[u32; 3]>, Vec<f64>, u64) {
        let mut splitter = Splitter::new();
        let mut out = Vec::new();
        let polygon: Vec<u32> = (0..corners.len() as u32).collect();
        splitter.split(&polygon, corners, &mut out);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| corners[i as usize].map(f64::from));
            dot(cross(sub(b, a), sub(c, a)), axis) / 2.0
        };
        (out.clone(), out.iter().map(area).collect(), splitter.fans)
    }

    #[test]
    fn convex_polygons_are_fans_and_concave_ones_are_clipped() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(split(&square, [0.0, 0.0, 1.0]).0, [[0, 1, 2], [0, 2, 3]]);
        // An arrowhead whose fan around the first corner would lie outside, in both directions and in three planes.
        let arrow = [[0.0, 2.0], [-1.0, 0.0], [0.0, 1.0], [1.0, 0.0]];
        for scale in [1.0f32, 1e-18, 1e18] {
            for plane in 0..3 {
                for reversed in [false, true] {
                    let mut corners = arrow.map(|[x, y]| {
                        let mut corner = [x * scale, y * scale, 0.0];
                        corner.rotate_right(plane);
                        corner
                    });
                    let mut axis = [0.0, 0.0, f64::from(scale).powi(-2)];
                    axis.rotate_right(plane);
                    if reversed {
                        corners.reverse();
                        axis = axis.map(|c| -c);
                    }
                    corners.rotate_left(1);
                    let (triangles, areas, fans) = split(&corners, axis);
                    assert_eq!((triangles.len(), fans), (2, 0));
                    assert!(areas.iter().all(|a| *a > 0.4 && *a < 0.6), "{scale} {plane} {areas:?}");
                }
            }
        }
    }

    #[test]
    fn polygons_that_cross_themselves_or_are_broken_stay_fans() {
        let bow = [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let (triangles, _, fans) = split(&bow, [0.0, 0.0, 1.0]);
        assert_eq!((triangles, fans), (vec![[0, 1, 2], [0, 2, 3]], 1));
        let nan = [[0.0; 3], [f32::NAN, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(split(&nan, [0.0, 0.0, 1.0]).0.len(), 2);
        assert_eq!(split(&[[0.0; 3]; 5], [0.0, 0.0, 1.0]).0.len(), 3);
        let comb = (0..5000).map(|i| [i as f32, if i % 2 == 0 { 0.0 } else { 1.0 }, 0.0]);
        let comb: Vec<_> = comb.chain([[2500.0, 1e6, 0.0]]).collect();
        assert_eq!(split(&comb, [0.0, 0.0, 1.0]).2, 1);
    }
}
