//! Faces: what of a triangle, or of two that make up a quadrangle, is kept in equations (see [`few`](super)).

use super::ERROR;
use crate::simd::F8;
use glam::DVec3;

/// The fourth corner of a quadrangle may be off the plane of the others by this part of the largest coordinate.
const FLAT: f64 = 4.0 * f32::EPSILON as f64;
/// A triangle's least height over the largest coordinate, below which its equations say too little.
const LEAST_HEIGHT: f64 = 1e-4;
/// In place of a second triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Coefficients of two coordinates, and what is added.
pub(super) type Equation = [F8; 3];

/// What a face looks like along the axis that it faces most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    Triangle,
    /// Two triangles.
    Quadrangle,
    /// The same with edges along the two other axes.
    Rectangle,
}

/// Along which of the two axes that follow a plane's coordinate changes: along none where the face is level, at right angles to its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tilt {
    None,
    First,
    Second,
    Both,
}

/// One triangle, or two that make up a convex quadrangle. All lanes of its vectors are the same.
#[derive(Clone, Debug)]
pub(super) struct Face {
    /// The plane's coordinate along the axis that the face faces most, by those along the two axes that follow it.
    pub(super) plane: Equation,
    /// Distances from the edges, seen along that axis: of a single triangle the last is the diagonal.
    pub(super) edges: [Equation; 4],
    /// Of a rectangle least and greatest coordinate, along each of the two axes that follow.
    pub(super) extent: [[F8; 2]; 2],
    /// Distance from the diagonal, positive in the first triangle; the third edge of a single one.
    pub(super) diagonal: Equation,
    /// The part of the bound that does not depend on t.
    pub(super) error: F8,
    pub(super) triangles: [u32; 2],
}

/// Faces that face one axis most, by kind, so that the loops over them are compiled for what each kind needs.
#[derive(Clone, Debug, Default)]
pub(super) struct Faces {
    pub(super) triangles: Vec<Face>,
    pub(super) quadrangles: Vec<Face>,
    pub(super) level_quadrangles: Vec<Face>,
    /// By [`Tilt`].
    pub(super) rectangles: [Vec<Face>; 4],
}

impl Faces {
    pub(super) fn add(&mut self, shape: Shape, face: Face) {
        let [F8([a, ..]), F8([b, ..]), _] = face.plane;
        let tilt = match (a == 0.0, b == 0.0) {
            (true, true) => Tilt::None,
            (false, true) => Tilt::First,
            (true, false) => Tilt::Second,
            (false, false) => Tilt::Both,
        };
        let kind = match (shape, tilt) {
            (Shape::Triangle, _) => &mut self.triangles,
            (Shape::Quadrangle, Tilt::None) => &mut self.level_quadrangles,
            (Shape::Quadrangle, _) => &mut self.quadrangles,
            (Shape::Rectangle, tilt) => &mut self.rectangles[tilt as usize],
        };
        kind.push(face);
    }
}

/// The corners of a triangle, exactly.
pub(super) fn corners(triangle: &[[f32; 3]; 3]) -> [DVec3; 3] {
    triangle.map(|corner| DVec3::from_array(corner.map(f64::from)))
}

/// The corners of a convex quadrangle in a plane whose halves are two triangles: those of the first, beginning with the one that the second
/// has not, and the other one's last.
pub(super) fn quadrangle(first: &[DVec3; 3], second: &[DVec3; 3], reach: f32) -> Option<[DVec3; 4]> {
    let [a, b, c] = *first;
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().find_map(|[across, from, to]| {
        let last = *second.iter().find(|corner| **corner != from && **corner != to)?;
        if !second.contains(&from) || !second.contains(&to) {
            return None;
        }
        let normal = (from - across).cross(to - across).normalize();
        let flat = normal.dot(last - across).abs() <= FLAT * f64::from(reach);
        let round = [across, from, last, to];
        let left = |i: usize| {
            let [p, q, r] = [0, 1, 2].map(|k| round[(i + k) % 4]);
            normal.dot((q - p).cross(r - q)) > 0.0
        };
        (flat && (0..4).all(left)).then_some([across, from, to, last])
    })
}

impl Face {
    /// `corners`: of the first triangle; the last lies beyond the edge between the second and third. Of a single triangle that is the
    /// first once more. `None` where one of them is too narrow. The axis that it faces most as well, and its shape.
    pub(super) fn new(
        [a, b, c, d]: &[DVec3; 4],
        triangles: [u32; 2],
        reach: f32,
    ) -> Option<(usize, Shape, Self)> {
        let normal = (*b - *a).cross(*c - *a);
        let axis = (0..3).fold(0, |most, i| if normal[i].abs() > normal[most].abs() { i } else { most });
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        let splat = |x: f64| F8([x as f32; 8]);
        let [x, y] = [first, second].map(|i| normal[i] / normal[axis]);
        let plane = [splat(-x), splat(-y), splat(a[axis] + x * a[first] + y * a[second])];
        // Distance from the edge between two corners, on the side of a third, seen along the axis; and how far that is away.
        let edge = |p: &DVec3, q: &DVec3, inside: &DVec3| {
            let (dx, dy) = (q[first] - p[first], q[second] - p[second]);
            let length = (dx * dx + dy * dy).sqrt();
            let (nx, ny) = (-dy / length, dx / length);
            let height = nx * (inside[first] - p[first]) + ny * (inside[second] - p[second]);
            let [nx, ny] = [nx, ny].map(|n| n * height.signum());
            ([splat(nx), splat(ny), splat(-(nx * p[first] + ny * p[second]))], height.abs())
        };
        let pair = triangles[1] != NONE;
        let diagonal = edge(b, c, a);
        let edges = [
            edge(a, b, c),
            edge(c, a, b),
            if pair { edge(b, d, c) } else { diagonal },
            if pair { edge(d, c, b) } else { diagonal },
        ];
        // What is no number is too narrow as well.
        let least = f64::from(reach) * LEAST_HEIGHT;
        let narrow = |height: f64| height.is_nan() || height < least;
        if narrow(diagonal.1) || edges.iter().any(|edge| narrow(edge.1)) {
            return None;
        }
        let extent = [first, second].map(|axis| {
            let along = [a, b, c, d].map(|corner| corner[axis]);
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            [least, along.into_iter().fold(f64::NEG_INFINITY, f64::max)]
        });
        // A convex quadrangle whose corners are all at ends of both has one at each of the four places.
        let square = [a, b, c, d]
            .iter()
            .all(|corner| extent[0].contains(&corner[first]) && extent[1].contains(&corner[second]));
        let shape = match (pair, square) {
            (false, _) => Shape::Triangle,
            (true, false) => Shape::Quadrangle,
            (true, true) => Shape::Rectangle,
        };
        let off = if pair { 2.0 * FLAT as f32 } else { 0.0 };
        let face = Self {
            plane,
            edges: edges.map(|edge| edge.0),
            diagonal: diagonal.0,
            extent: extent.map(|ends| ends.map(splat)),
            error: F8([(ERROR + 3.0 * off) * reach; 8]),
            triangles,
        };
        Some((axis, shape, face))
    }
}
