//! Meshes placed in the world: random matrices, rays at them, and the check that the rooms of instances and filters
//! share ([`Placement::check_filtered`]).

use crate::support::{Heard, Listener, Rng, Triangle, along, bits, dot, narrow, point_on, sub, wide};
use hotspot_bvh::oracle;
use hotspot_bvh::simd::{Isa, Portable};
use hotspot_bvh::{
    BuildOptions, Bvh, Candidate, Filter, Hit, Instance, NoFilter, NoProbe, Quality, Ray, RayProbe,
};

/// Rows of a 3×4 affine matrix.
pub(crate) type Matrix = [[f64; 4]; 3];

pub(crate) const IDENTITY: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// `m` applied to a point.
pub(crate) fn place(m: &Matrix, p: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| dot([m[i][0], m[i][1], m[i][2]], p) + m[i][3])
}

/// `m` applied to a direction.
pub(crate) fn turn(m: &Matrix, d: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| dot([m[i][0], m[i][1], m[i][2]], d))
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|c| c / length)
}

pub(crate) fn determinant(m: &Matrix) -> f64 {
    let column = |j: usize| [m[0][j], m[1][j], m[2][j]];
    dot(column(0), cross(column(1), column(2)))
}

pub(crate) fn translation(x: f64, y: f64, z: f64) -> Matrix {
    let mut m = IDENTITY;
    for (row, c) in m.iter_mut().zip([x, y, z]) {
        row[3] = c;
    }
    m
}

pub(crate) fn scaling(x: f64, y: f64, z: f64) -> Matrix {
    [[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], [0.0, 0.0, z, 0.0]]
}

/// An orthonormal frame.
pub(crate) fn rotation(rng: &mut Rng) -> [[f64; 3]; 3] {
    let a = rng.direction();
    loop {
        let c = cross(a, rng.direction());
        if dot(c, c) > 0.01 {
            let c = unit(c);
            return [a, cross(c, a), c];
        }
    }
}

/// Rotation · shear · scaling · rotation, each scale in 10^±`decades`, half of them mirrored, moved by up to `far`.
pub(crate) fn affine(rng: &mut Rng, decades: f64, shear: f64, far: f64) -> Matrix {
    let (r, q) = (rotation(rng), rotation(rng));
    let scales: [f64; 3] = core::array::from_fn(|_| rng.magnitude(-decades, decades));
    let mirror = if rng.coin() { -1.0 } else { 1.0 };
    let (s, t) = (shear * rng.signed(), shear * rng.signed());
    let middle = |p: [f64; 3]| {
        let p = [p[0] * scales[0] * mirror, p[1] * scales[1], p[2] * scales[2]];
        [p[0] + s * p[1], p[1] + t * p[2], p[2]]
    };
    let columns: [[f64; 3]; 3] = core::array::from_fn(|j| {
        let inner = middle([q[0][j], q[1][j], q[2][j]]);
        core::array::from_fn(|i| dot(r[i], inner))
    });
    core::array::from_fn(|i| [columns[0][i], columns[1][i], columns[2][i], far * rng.signed()])
}

/// Every hit counts, but is asked about and told to the probe.
#[derive(Clone, Copy)]
pub(crate) struct Everything;

/// Bytes that [`Everything`] tells per question.
pub(crate) const BYTES: u32 = 16;

impl Filter for Everything {
    const ON: bool = true;
    fn accept<P: RayProbe>(&mut self, _candidate: &Candidate<'_>, probe: &mut P) -> bool {
        probe.alpha(1, BYTES);
        true
    }
}

/// A question to a filter: instance, triangle, the bits of u and v, and the answer.
pub(crate) type Question = (u32, u32, [u32; 2], bool);

/// Writes down what another filter is asked, and what it answers.
pub(crate) struct Recorder<'a, F>(pub(crate) F, pub(crate) &'a mut Vec<Question>);

impl<F: Filter> Filter for Recorder<'_, F> {
    const ON: bool = F::ON;
    fn accept<P: RayProbe>(&mut self, candidate: &Candidate<'_>, probe: &mut P) -> bool {
        let answer = self.0.accept(candidate, probe);
        let (u, v) = candidate.barycentric();
        self.1.push((candidate.instance(), candidate.primitive(), [u.to_bits(), v.to_bits()], answer));
        answer
    }
}

/// All bits of a hit, and its instance.
pub(crate) fn all_bits(hit: Option<Hit>) -> Option<(u32, [u32; 7])> {
    hit.and_then(|h| Some((h.instance, bits(Some(h))?)))
}

/// The nearest hit that `filter` accepts, under the tree's own instruction set.
pub(crate) fn closest<F: Filter, P: RayProbe>(tree: &Bvh, ray: &Ray, filter: F, probe: P) -> Option<Hit> {
    #[cfg(target_arch = "x86_64")]
    if tree.isa() == Isa::Avx2
        && let Some(avx2) = hotspot_bvh::simd::Avx2::detect()
    {
        return tree.closest_hit_filtered(avx2, ray, [], filter, probe);
    }
    tree.closest_hit_filtered(Portable, ray, [], filter, probe)
}

/// Whether `filter` accepts any hit, under the tree's own instruction set.
pub(crate) fn occluded<F: Filter, P: RayProbe>(tree: &Bvh, ray: &Ray, filter: F, probe: P) -> bool {
    #[cfg(target_arch = "x86_64")]
    if tree.isa() == Isa::Avx2
        && let Some(avx2) = hotspot_bvh::simd::Avx2::detect()
    {
        return tree.occluded_filtered(avx2, ray, [], filter, probe);
    }
    tree.occluded_filtered(Portable, ray, [], filter, probe)
}

/// Triangles of the world, meshes, and where they are; with a tree under every instruction set.
pub(crate) struct Placement {
    pub(crate) name: &'static str,
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) meshes: Vec<Vec<Triangle>>,
    pub(crate) instances: Vec<Instance>,
    mesh_of: Vec<u32>,
    pub(crate) trees: Vec<Bvh>,
}

impl Placement {
    pub(crate) fn new(
        name: &'static str,
        triangles: Vec<Triangle>,
        meshes: Vec<Vec<Triangle>>,
        places: &[(u32, Matrix)],
        quality: Quality,
    ) -> Self {
        let instances: Vec<_> = places.iter().map(|&(mesh, to_world)| Instance { mesh, to_world }).collect();
        let trees = [Isa::Portable, Isa::Auto]
            .map(|isa| {
                let options = BuildOptions { quality, isa, ..Default::default() };
                Bvh::build_instanced(&triangles, &meshes, &instances, options).unwrap()
            })
            .into();
        let mesh_of = instances.iter().map(|i| i.mesh).collect();
        Self { name, triangles, meshes, instances, mesh_of, trees }
    }

    pub(crate) fn brute_force<F: Filter>(&self, ray: &Ray, filter: F) -> Option<Hit> {
        let (tree, mesh_of) = (&self.trees[0], &self.mesh_of);
        oracle::brute_force_instanced(tree, &self.triangles, &self.meshes, mesh_of, ray, filter)
    }

    /// [`Placement::check_filtered`] without a filter, and with all entrances to the tree.
    #[track_caller]
    pub(crate) fn check(&self, ray: &Ray) -> Option<Hit> {
        let expected = self.check_filtered(ray, NoFilter);
        for tree in &self.trees {
            assert_eq!(all_bits(tree.closest_hit(ray, NoProbe)), all_bits(expected), "{} {ray:?}", self.name);
            assert_eq!(tree.occluded(ray, NoProbe), expected.is_some(), "{} occluded {ray:?}", self.name);
        }
        expected
    }

    /// Tree and loop give the same bits under every instruction set; every value is finite and inside its range; the
    /// probe hears what the recursive twin counts, and the filter is asked what the twin asks. Returns the hit.
    #[track_caller]
    pub(crate) fn check_filtered<F: Filter + Copy>(&self, ray: &Ray, filter: F) -> Option<Hit> {
        let name = self.name;
        let expected = self.brute_force(ray, filter);
        if let Some(hit) = expected {
            let sane = hit.t.is_finite()
                && hit.t > ray.t_min
                && hit.t < ray.t_max
                && (0.0..=1.0).contains(&hit.u)
                && (0.0..=1.0).contains(&hit.v)
                && hit.u + hit.v <= 1.0
                && (dot(wide(hit.normal), wide(hit.normal)) - 1.0).abs() < 1e-6;
            assert!(sane, "{name}: {hit:?} of {ray:?}");
        }
        for tree in &self.trees {
            let isa = tree.isa();
            let (mut heard, mut asked, mut twin_asked) = (Heard::default(), Vec::new(), Vec::new());
            let hit = closest(tree, ray, Recorder(filter, &mut asked), Listener(&mut heard));
            assert_eq!(
                all_bits(hit),
                all_bits(expected),
                "{name} {isa:?} {ray:?}: {hit:?}, not {expected:?}"
            );
            let (found, counts) = oracle::closest_filtered(tree, ray, Recorder(filter, &mut twin_asked));
            assert_eq!(found, expected.map(|h| (h.instance, h.primitive, h.t)), "{name} twin {ray:?}");
            self.check_heard(&heard, counts, expected.is_some(), ray);
            if F::ON {
                assert_eq!(asked, twin_asked, "{name} {isa:?} questions of closest {ray:?}");
            }

            let (mut heard, mut asked, mut twin_asked) = (Heard::default(), Vec::new(), Vec::new());
            let hit = occluded(tree, ray, Recorder(filter, &mut asked), Listener(&mut heard));
            let (found, counts) = oracle::occluded_filtered(tree, ray, Recorder(filter, &mut twin_asked));
            let any = expected.is_some();
            assert_eq!((hit, found), (any, any), "{name} {isa:?} occluded, and twin: {ray:?} {expected:?}");
            self.check_heard(&heard, counts, any, ray);
            if F::ON {
                assert_eq!(asked, twin_asked, "{name} {isa:?} questions of occluded {ray:?}");
            }
        }
        expected
    }

    #[track_caller]
    fn check_heard(&self, heard: &Heard, counts: oracle::Counts, hit: bool, ray: &Ray) {
        assert_eq!(heard.counts, counts, "{} {ray:?}", self.name);
        assert_eq!(heard.finished, [hit], "{} {ray:?}", self.name);
        let mut entered = heard.instance_ids.clone();
        entered.sort_unstable();
        entered.dedup();
        assert_eq!(entered.len(), heard.instance_ids.len(), "an instance entered twice: {ray:?}");
        assert!(entered.iter().all(|&id| (id as usize) < self.instances.len()));
    }

    /// A triangle of the world or of an instance, placed in f64 and rounded.
    pub(crate) fn some_triangle(&self, rng: &mut Rng) -> Triangle {
        let of_world = self.instances.is_empty() || (!self.triangles.is_empty() && rng.below(4) == 0);
        if of_world {
            return *rng.pick(&self.triangles);
        }
        let instance = *rng.pick(&self.instances);
        let triangle = *rng.pick(&self.meshes[instance.mesh as usize]);
        triangle.map(|v| narrow(place(&instance.to_world, wide(v))))
    }

    /// A ray with some trap: at a vertex or an edge, from a vertex, from within, along an axis, of any length.
    pub(crate) fn hostile_ray(&self, rng: &mut Rng) -> Ray {
        let at = self.some_triangle(rng);
        let target = wide(point_on(rng, &at));
        let other = self.some_triangle(rng);
        let [a, b, c] = at.map(wide);
        let size = dot(sub(b, a), sub(b, a)).max(dot(sub(c, a), sub(c, a))).sqrt();
        let mut origin = match rng.below(6) {
            0 => wide(other[rng.below(3)]),
            1 => wide(point_on(rng, &other)),
            // From within, if the triangle is part of something closed.
            2 => along(target, sub(wide(other[0]), target), rng.unit()),
            _ => along(target, rng.direction(), size * rng.magnitude(-2.0, 3.0)),
        };
        for axis in 0..3 {
            // In the plane of a side of the box, or along an axis.
            if rng.below(5) == 0 {
                origin[axis] = target[axis];
            }
        }
        let origin = narrow(origin);
        let mut direction = sub(target, wide(origin));
        let zero = |d: [f64; 3]| narrow(d).iter().all(|&c| c == 0.0);
        if rng.below(8) == 0 || zero(direction) {
            direction = rng.direction();
        }
        if rng.below(3) == 0 {
            let scale = rng.magnitude(-20.0, 20.0) / dot(direction, direction).sqrt();
            direction = direction.map(|c| c * scale);
        }
        Ray::new(origin, narrow(direction).map(|c| if c == 0.0 && rng.coin() { -0.0 } else { c }))
    }

    /// The ray again, with ends at or next to `hit`, or anywhere.
    pub(crate) fn with_ends(rng: &mut Rng, ray: &Ray, hit: Option<Hit>) -> Ray {
        let t = hit.map_or_else(|| rng.magnitude(-3.0, 3.0) as f32, |h| h.t);
        match rng.below(8) {
            0 => Ray { t_max: t, ..*ray },
            1 => Ray { t_max: t.next_up(), ..*ray },
            2 => Ray { t_max: t.next_down(), ..*ray },
            3 => Ray { t_min: t, ..*ray },
            4 => Ray { t_min: t.next_down().max(0.0), ..*ray },
            5 => Ray { t_min: t.next_up(), ..*ray },
            6 => Ray { t_min: t * 0.5, t_max: t * rng.magnitude(-0.5, 2.0) as f32, ..*ray },
            _ => Ray { t_min: t, t_max: t * rng.magnitude(-0.5, 2.0) as f32, ..*ray },
        }
    }
}
