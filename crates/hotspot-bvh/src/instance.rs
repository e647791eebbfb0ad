//! Meshes that are stored once and placed many times.
//!
//! A ray meets an instance if and only if
//! 1. it passes the slab test of the instance's world box, and
//! 2. the ray taken into the mesh's own space (in f64, rounded to f32; its direction is not normalised, so t keeps its
//!    meaning) hits a triangle there, by the definition in `triangle.rs`.
//!
//! Its t is the one found there, clamped to the interval of the world box's slab test. As for single triangles, the clamp
//! changes t by rounding errors only, and makes the answer independent of the tree: no ancestor's box is entered later than
//! the instance's own. It is the clamped t that must lie between `t_min` and `t_max`.
//!
//! Within an instance closed meshes do not leak: one rounded ray meets all its triangles. Between two instances that only
//! touch, a ray may pass, since each rounds it in its own way.

use crate::node::{Bounds, Child};
use crate::ray::Ray;
use crate::triangle::{FAR_PAD, RayFrame, slab_interval};

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index of the mesh as given to the build.
    pub mesh: u32,
    /// Mesh space to world space: rows of a 3×4 affine matrix. Must be invertible.
    pub to_world: [[f64; 4]; 3],
}

/// An instance in the tree.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// The mesh's own tree.
    pub(crate) root: Child,
    /// Encloses the instance in the world.
    pub(crate) bounds: Bounds,
    to_object: [[f64; 4]; 3],
}

/// `m` applied to a point (`w` = 1) or a direction (`w` = 0).
#[inline(always)]
fn apply(m: &[[f64; 4]; 3], v: [f32; 3], w: f64) -> [f64; 3] {
    let [x, y, z] = [f64::from(v[0]), f64::from(v[1]), f64::from(v[2])];
    let row = |r: &[f64; 4]| r[0] * x + r[1] * y + r[2] * z + r[3] * w;
    [row(&m[0]), row(&m[1]), row(&m[2])]
}

/// The inverse, or `None` where it does not exist or is not worth its name: a round trip must give the identity within
/// 1e-9, so that a ray in the mesh's space is the ray in the world.
pub(crate) fn inverse(m: &[[f64; 4]; 3]) -> Option<[[f64; 4]; 3]> {
    let minor = |a: usize, b: usize, i: usize, j: usize| m[a][i] * m[b][j] - m[a][j] * m[b][i];
    let cofactors = [
        [minor(1, 2, 1, 2), minor(1, 2, 2, 0), minor(1, 2, 0, 1)],
        [minor(2, 0, 1, 2), minor(2, 0, 2, 0), minor(2, 0, 0, 1)],
        [minor(0, 1, 1, 2), minor(0, 1, 2, 0), minor(0, 1, 0, 1)],
    ];
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactors[0][j]).sum();
    let mut out = [[0.0; 4]; 3];
    for (i, row) in out.iter_mut().enumerate() {
        for j in 0..3 {
            row[j] = cofactors[j][i] / determinant;
        }
        row[3] = -(0..3).map(|j| row[j] * m[j][3]).sum::<f64>();
    }
    let faithful = (0..3).all(|i| {
        (0..3).all(|j| {
            let product: f64 = (0..3).map(|k| out[i][k] * m[k][j]).sum();
            (product - f64::from(u8::from(i == j))).abs() < 1e-9
        })
    });
    (faithful && out.iter().flatten().all(|c| c.is_finite())).then_some(out)
}

/// Scales between a mesh's space and the world, and places, that leave f32 room for lengths and their squares.
const LARGEST: f64 = 1e15;

/// The inverse for an instance of a mesh in these boxes, where it makes sense to f32: so that neither a point nor a ray's
/// direction leaves its range on the way from one space to the other.
fn moderate_inverse(boxes: &[Bounds], to_world: &[[f64; 4]; 3]) -> Option<[[f64; 4]; 3]> {
    let moderate = |m: &[[f64; 4]; 3]| m.iter().flatten().all(|c| c.abs() < LARGEST);
    let small = boxes.iter().flat_map(|b| [b.min, b.max]).flatten().all(|c| f64::from(c.abs()) < LARGEST);
    inverse(to_world).filter(|back| small && moderate(to_world) && moderate(back))
}

/// Whether [`Placed::new`] takes an instance.
pub(crate) fn can_place(bounds: &Bounds, to_world: &[[f64; 4]; 3]) -> bool {
    moderate_inverse(&[*bounds], to_world).is_some() && enclose(to_world, &[*bounds]).is_some()
}

/// A world box around boxes placed by `m`, rounded outwards; `None` when it is not finite.
fn enclose(m: &[[f64; 4]; 3], boxes: &[Bounds]) -> Option<Bounds> {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for b in boxes {
        for corner in 0..8 {
            let p = [0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { b.max[axis] } else { b.min[axis] });
            let world = apply(m, p, 1.0);
            for axis in 0..3 {
                min[axis] = min[axis].min(world[axis]);
                max[axis] = max[axis].max(world[axis]);
            }
        }
    }
    let bounds = Bounds { min: min.map(|c| (c as f32).next_down()), max: max.map(|c| (c as f32).next_up()) };
    let finite = bounds.min.iter().chain(&bounds.max).all(|c| c.is_finite());
    finite.then_some(bounds)
}

impl Placed {
    /// `boxes` enclose the mesh between them, in its own space. `None` when the matrix cannot be inverted, or the place
    /// is beyond the range of f32.
    pub(crate) fn new(root: Child, boxes: &[Bounds], to_world: &[[f64; 4]; 3]) -> Option<Self> {
        let to_object = moderate_inverse(boxes, to_world)?;
        Some(Self { root, bounds: enclose(to_world, boxes)?, to_object })
    }

    /// For hashing.
    pub(crate) fn words(&self) -> impl Iterator<Item = u32> + '_ {
        let matrix =
            self.to_object.iter().flatten().flat_map(|c| [c.to_bits() as u32, (c.to_bits() >> 32) as u32]);
        let bounds = self.bounds.min.iter().chain(&self.bounds.max).map(|c| c.to_bits());
        matrix.chain(bounds).chain([self.root.hashed()])
    }

    /// Where the ray enters and leaves the world box, if it passes rule 1 before `t_max`.
    #[inline(always)]
    pub(crate) fn interval(&self, frame: &RayFrame, t_max: f32) -> Option<(f32, f32)> {
        let (enter, leave) = slab_interval(frame, &self.bounds.min, &self.bounds.max);
        let t_min = frame.ray.t_min;
        let near = if enter > t_min { enter } else { t_min };
        let far = if leave > near { leave } else { near };
        // Where the box ends at t_min, all in it would be clamped to there, and not count.
        (near <= leave * FAR_PAD && near <= t_max && far > t_min).then_some((near, far))
    }

    /// The ray in the mesh's space, up to `t_max`, for a world box entered at `near`. Where that is behind `t_min`, all
    /// that lies before it is clamped to there, and counts.
    #[inline(always)]
    pub(crate) fn object_ray(&self, ray: &Ray, (near, _): (f32, f32), t_max: f32) -> Ray {
        let origin = apply(&self.to_object, ray.origin, 1.0);
        let direction = apply(&self.to_object, ray.direction, 0.0);
        Ray {
            origin: [origin[0] as f32, origin[1] as f32, origin[2] as f32],
            direction: [direction[0] as f32, direction[1] as f32, direction[2] as f32],
            t_min: if near > ray.t_min { 0.0 } else { ray.t_min },
            t_max,
        }
    }

    /// A normal of the mesh in the world, of unit length: the transposed inverse takes it there.
    #[inline(always)]
    pub(crate) fn world_normal(&self, n: [f32; 3]) -> [f32; 3] {
        let m = &self.to_object;
        let [x, y, z] = [f64::from(n[0]), f64::from(n[1]), f64::from(n[2])];
        let world = [
            m[0][0] * x + m[1][0] * y + m[2][0] * z,
            m[0][1] * x + m[1][1] * y + m[2][1] * z,
            m[0][2] * x + m[1][2] * y + m[2][2] * z,
        ];
        // Scaled first: the squares of what an extreme matrix makes of it have no place in f64.
        let largest = world[0].abs().max(world[1].abs()).max(world[2].abs());
        let [x, y, z] = [world[0] / largest, world[1] / largest, world[2] / largest];
        let length = (x * x + y * y + z * z).sqrt();
        if length > 0.0 { [(x / length) as f32, (y / length) as f32, (z / length) as f32] } else { [0.0; 3] }
    }
}

/// Brings the t of a hit in the mesh's space into the interval of rule 1.
#[inline(always)]
pub(crate) fn clamped(t: f32, (near, far): (f32, f32)) -> f32 {
    if t < near {
        near
    } else if t > far {
        far
    } else {
        t
    }
}

/// How far the search in the mesh's space must go when the nearest hit so far is at `best`: where the world box ends no
/// later, a hit beyond `best` would be clamped to or before it.
#[inline(always)]
pub(crate) fn search_limit(best: f32, (_, far): (f32, f32)) -> f32 {
    if far <= best { f32::INFINITY } else { best }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverses_undo_and_flat_matrices_have_none() {
        let m = [[2.0, 0.5, 0.0, 1.0], [0.0, -3.0, 0.2, 2.0], [0.1, 0.0, 0.5, 3.0]];
        let back = inverse(&m).unwrap();
        let there = apply(&m, [1.0, -2.0, 3.0], 1.0).map(|c| c as f32);
        for (got, expected) in apply(&back, there, 1.0).into_iter().zip([1.0, -2.0, 3.0]) {
            assert!((got - expected).abs() < 1e-6);
        }
        let flat = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]];
        assert!(inverse(&flat).is_none());
        assert!(inverse(&[[f64::NAN; 4]; 3]).is_none());
    }
}
