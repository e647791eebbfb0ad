//! Points on triangles as the origins and ends of rays: where exactly, and how far off they may be.

use glam::Vec3;

/// The least distance of a corner from the opposite edge; 0 without area.
pub(crate) fn least_height(triangle: &[[f32; 3]; 3]) -> f32 {
    heights(triangle).into_iter().fold(f64::INFINITY, f64::min) as f32
}

/// Distances of the corners from the opposite edges; 0 without area.
fn heights(triangle: &[[f32; 3]; 3]) -> [f64; 3] {
    let [a, b, c] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let twice_area = (b - a).cross(c - a).length();
    [c - b, a - c, b - a].map(|edge| {
        let length = edge.length();
        if length > 0.0 { twice_area / length } else { 0.0 }
    })
}

/// Barycentric weights moved so that `point` (theirs) is at least its margin away from every edge, or as far as a triangle
/// too small for that allows.
///
/// Of [`SurfacePoint::margin`] an edge asks for what concerns it: errors along the normal, by which rays start off the plane,
/// and errors across the edge. Those along an edge do not lead over it: a strip much narrower than the rounding of its
/// far ends' coordinates keeps its points.
#[cold]
#[inline(never)]
pub(super) fn inset(triangle: &[[f32; 3]; 3], mut weights: [f32; 3], point: &SurfacePoint) -> [f32; 3] {
    let heights = heights(triangle);
    let [a, b, c] = triangle.map(|v| glam::DVec3::from_array(v.map(f64::from)));
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let error = point.error.as_dvec3();
    let most = f64::from(point.margin());
    let mut missing = 0.0;
    for ((weight, height), edge) in weights.iter_mut().zip(heights).zip([c - b, a - c, b - a]) {
        let across = normal.cross(edge).normalize_or_zero();
        let margin = (2.0 * (normal.abs() + across.abs()).dot(error)).min(most);
        let least = ((margin / height) as f32).min(0.33);
        if *weight < least {
            missing += least - *weight;
            *weight = least;
        }
    }
    // The largest weight pays: it is at least a third, and the other two asked for less than a third each.
    let largest = (0..3).fold(0, |best, i| if weights[i] > weights[best] { i } else { best });
    weights[largest] = (weights[largest] - missing).max(0.0);
    weights
}

/// A triangle prepared for [`SurfacePoint`]s: worth keeping for lights, which are sampled again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceTriangle {
    corner: [f64; 3],
    edges: [[f64; 3]; 2],
    /// The share of the corners in [`SurfacePoint::error`].
    pub(crate) error: [f32; 3],
}

impl SurfaceTriangle {
    #[inline(always)]
    pub(crate) fn new(triangle: &[[f32; 3]; 3]) -> Self {
        let larger = |a: f32, b: f32| if a > b { a } else { b };
        let mut this = Self { corner: [0.0; 3], edges: [[0.0; 3]; 2], error: [0.0; 3] };
        #[expect(clippy::needless_range_loop, reason = "one axis of several arrays in step")]
        for axis in 0..3 {
            let [a, b, c] = [triangle[0][axis], triangle[1][axis], triangle[2][axis]];
            this.corner[axis] = f64::from(a);
            this.edges[0][axis] = f64::from(b) - f64::from(a);
            this.edges[1][axis] = f64::from(c) - f64::from(a);
            this.error[axis] = 2.273_737e-13 * larger(larger(a.abs(), b.abs()), c.abs());
        }
        this
    }

    /// Its first corner.
    #[inline(always)]
    pub(crate) fn corner(&self) -> [f32; 3] {
        [self.corner[0] as f32, self.corner[1] as f32, self.corner[2] as f32]
    }

    #[inline(always)]
    pub(crate) fn point(&self, u: f32, v: f32) -> SurfacePoint {
        let (u, v) = (f64::from(u), f64::from(v));
        let mut p = [0.0f32; 3];
        let mut error = [0.0f32; 3];
        for axis in 0..3 {
            p[axis] = (self.corner[axis] + self.edges[0][axis] * u + self.edges[1][axis] * v) as f32;
            error[axis] = 3.0 * (0.5 * f32::EPSILON) * p[axis].abs() + self.error[axis];
        }
        SurfacePoint { p: Vec3::from_array(p), error: Vec3::from_array(error) }
    }

    /// The point that lies `margin` off the edges, or as near to it as the triangle allows.
    #[cold]
    #[inline(never)]
    pub(crate) fn point_off_edges(&self, u: f32, v: f32) -> SurfacePoint {
        let corners: [[f64; 3]; 3] = core::array::from_fn(|i| {
            core::array::from_fn(|axis| self.corner[axis] + if i > 0 { self.edges[i - 1][axis] } else { 0.0 })
        });
        let point = self.point(u, v);
        let [_, u, v] = inset(&corners.map(|c| c.map(|x| x as f32)), [1.0 - u - v, u, v], &point);
        self.point(u, v)
    }

    /// The largest [`SurfacePoint::margin`] of its points.
    pub(crate) fn most_margin(&self) -> f32 {
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
            .into_iter()
            .fold(0.0, |most, [u, v]| self.point(u, v).margin().max(most))
    }
}

/// A point of a triangle, with a bound on how far it may lie off the triangle's plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) p: Vec3,
    /// Bound per axis, see [`SurfacePoint::new`].
    pub(crate) error: Vec3,
}

impl SurfacePoint {
    /// Interpolates in f64, so that errors of the weights move the point within the plane only. What is left: rounding p
    /// to f32 (2^-24 |p|), rounding the offset origin (2^-24 |p| again), and the f64 evaluation of the plane's distance
    /// in the next intersection test (a few 2^-53 of the corners' coordinates, amplified by up to 2^10 for slivers).
    /// Hence the bound 3·2^-24 |p| + 2^-42 max|corner|, per axis.
    #[inline(always)]
    pub(crate) fn new(triangle: &[[f32; 3]; 3], u: f32, v: f32) -> Self {
        SurfaceTriangle::new(triangle).point(u, v)
    }

    /// The point of a triangle that is stored in a mesh's own space and placed by `to_world`.
    ///
    /// Beside the errors of [`SurfacePoint::new`], a ray from here is taken back into the mesh's space, where its origin is
    /// rounded to f32: 2^-24 of the coordinates there, carried to the world by the absolute values of the matrix; twice
    /// that, for the rounding of the matrix's inverse.
    #[inline(always)]
    pub(crate) fn placed(triangle: &[[f32; 3]; 3], u: f32, v: f32, to_world: &[[f64; 4]; 3]) -> Self {
        const UNIT: f64 = 0.5 * f32::EPSILON as f64;
        let SurfaceTriangle { corner, edges, error: corners } = SurfaceTriangle::new(triangle);
        let (u, v) = (f64::from(u), f64::from(v));
        let mut object = [0.0f64; 3];
        let mut object_error = [0.0f64; 3];
        for axis in 0..3 {
            object[axis] = corner[axis] + edges[0][axis] * u + edges[1][axis] * v;
            object_error[axis] = 2.0 * UNIT * object[axis].abs() + f64::from(corners[axis]);
        }
        let mut p = [0.0f32; 3];
        let mut error = [0.0f32; 3];
        for axis in 0..3 {
            let [x, y, z, w] = to_world[axis];
            p[axis] = (x * object[0] + y * object[1] + z * object[2] + w) as f32;
            let carried = x.abs() * object_error[0] + y.abs() * object_error[1] + z.abs() * object_error[2];
            error[axis] = 3.0 * (0.5 * f32::EPSILON) * p[axis].abs() + carried as f32;
        }
        Self { p: Vec3::from_array(p), error: Vec3::from_array(error) }
    }

    /// How far from its triangle's edges a point should stay: twice the distance by which rays start off the plane, so that
    /// they start inside of any neighbour that meets the face at more than about 27 degrees.
    #[inline(always)]
    pub(super) fn margin(&self) -> f32 {
        2.0 * self.error.length()
    }

    /// Where a ray from `origin` to this point of a light must end, so that it cannot hit the light itself: off the
    /// light's plane, on the side of unit normal `normal`, by the bound of [`SurfacePoint::leave`] and by the errors that
    /// grow with the ray's length: rounding the direction (u = 2^-24 of it), and the distance found by the intersection
    /// test, which is clamped to a slab interval (three roundings) and rounded itself: 5 u per axis.
    #[inline(always)]
    pub(crate) fn meet(&self, normal: Vec3, origin: Vec3) -> Vec3 {
        let reach = (self.p - origin).abs() * (5.0 * 0.5 * f32::EPSILON);
        self.p + normal * normal.abs().dot(self.error + reach)
    }

    /// The origin of a ray that leaves on the side of unit normal `normal` (turned to the ray's side): off the plane by
    /// the bound, so that the ray cannot hit the surface that it leaves (after Pharr, Jakob, Humphreys, *Physically
    /// Based Rendering*, 3rd edition, section 3.9.5, with the bound above).
    #[inline(always)]
    pub(crate) fn leave(&self, normal: Vec3) -> Vec3 {
        self.p + normal * normal.abs().dot(self.error)
    }
}
