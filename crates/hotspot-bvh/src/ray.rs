//! Rays and what they hit.

/// A ray `origin + t * direction` for t in the open interval (`t_min`, `t_max`). The direction need not be of unit
/// length; t counts in its lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: [f32; 3],
    /// Where it goes; any length but zero.
    pub direction: [f32; 3],
    /// Hits at or before it do not count; at least 0.
    pub t_min: f32,
    /// Hits at or beyond it do not count; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray without end.
    #[inline(always)]
    pub const fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// True when origin and direction are finite. Other rays hit nothing.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        let [ox, oy, oz] = self.origin;
        let [dx, dy, dz] = self.direction;
        // 0 · x is 0 for finite x and NaN otherwise; no sum of zeros can overflow.
        0.0 * ox + 0.0 * oy + 0.0 * oz + 0.0 * dx + 0.0 * dy + 0.0 * dz == 0.0
    }
}

/// In place of an instance: the hit is on a triangle of the world.
pub const NO_INSTANCE: u32 = u32::MAX;

/// The nearest hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex, in [0, 1].
    pub u: f32,
    /// Barycentric weight of the third vertex, in [0, 1], u + v ≤ 1.
    pub v: f32,
    /// Index of the triangle as given to the build; of an instance's mesh where [`Hit::instance`] names one.
    pub primitive: u32,
    /// Index of the instance, [`NO_INSTANCE`] for triangles of the world.
    pub instance: u32,
    /// Geometric normal in the world, of unit length, on the side from which the triangle is counter-clockwise (in its
    /// mesh's own space: the front stays the front where an instance is mirrored); zero where the triangle is degenerate.
    pub normal: [f32; 3],
}
