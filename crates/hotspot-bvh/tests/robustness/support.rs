//! Seeded random numbers, triangle soups, rays, and the check that every room shares: [`Scene::check`].

use hotspot_bvh::oracle::{self, Counts};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh, Hit, NoProbe, Quality, Ray, RayProbe};

pub(crate) type Triangle = [[f32; 3]; 3];

pub(crate) const QUALITIES: [Quality; 3] = [Quality::Fast, Quality::Medium, Quality::High];

/// Steele, Lea, Flood, *Fast Splittable Pseudorandom Number Generators* (OOPSLA 2014): splitmix64.
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In 0..`end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    pub(crate) fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    pub(crate) fn coin(&mut self) -> bool {
        self.bits() >> 63 == 1
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [−1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Uniform in the cube [−1, 1)³.
    pub(crate) fn cube(&mut self) -> [f64; 3] {
        [self.signed(), self.signed(), self.signed()]
    }

    /// Uniform on the unit sphere.
    pub(crate) fn direction(&mut self) -> [f64; 3] {
        loop {
            let p = self.cube();
            let square = dot(p, p);
            if square > 1e-4 && square <= 1.0 {
                return p.map(|c| c / square.sqrt());
            }
        }
    }

    /// 10^x for x uniform in `low`..`high`.
    pub(crate) fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * self.unit())
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| a[i] - b[i])
}

/// a + b · s.
pub(crate) fn along(a: [f64; 3], b: [f64; 3], s: f64) -> [f64; 3] {
    core::array::from_fn(|i| a[i] + b[i] * s)
}

pub(crate) fn wide(a: [f32; 3]) -> [f64; 3] {
    a.map(f64::from)
}

pub(crate) fn narrow(a: [f64; 3]) -> [f32; 3] {
    a.map(|c| c as f32)
}

/// Edge 1 × edge 2: exact where coordinates have few bits.
pub(crate) fn cross_of(triangle: &Triangle) -> [f64; 3] {
    let [a, b, c] = triangle.map(wide);
    let (e, f) = (sub(b, a), sub(c, a));
    [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
}

/// `count` triangles with corners within `size` of a centre in the cube [−1, 1)³.
pub(crate) fn soup(rng: &mut Rng, count: usize, size: f64) -> Vec<Triangle> {
    (0..count)
        .map(|_| {
            let centre = rng.cube();
            core::array::from_fn(|_| narrow(along(centre, rng.cube(), size)))
        })
        .collect()
}

pub(crate) fn scaled(triangles: &[Triangle], scale: f64) -> Vec<Triangle> {
    triangles.iter().map(|t| t.map(|v| narrow(wide(v).map(|c| c * scale)))).collect()
}

/// A point of a triangle: inside, on an edge, or a corner, each as likely.
pub(crate) fn point_on(rng: &mut Rng, triangle: &Triangle) -> [f32; 3] {
    let [a, b, c] = triangle.map(wide);
    let (mut s, mut t) = (rng.unit(), rng.unit());
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    match rng.below(3) {
        0 => narrow(along(along(a, sub(b, a), s), sub(c, a), t)),
        1 => narrow(along(a, sub(b, a), s)),
        _ => *rng.pick(triangle),
    }
}

/// A ray from `origin` that aims at `target`.
pub(crate) fn towards(origin: [f32; 3], target: [f32; 3]) -> Ray {
    Ray::new(origin, core::array::from_fn(|i| target[i] - origin[i]))
}

/// All bits of a hit.
pub(crate) fn bits(hit: Option<Hit>) -> Option<[u32; 7]> {
    hit.map(|h| {
        let [x, y, z] = h.normal.map(f32::to_bits);
        [h.primitive, h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), x, y, z]
    })
}

/// What a probe was told about one ray.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    pub(crate) counts: Counts,
    pub(crate) node_ids: Vec<u32>,
    /// Block and its triangles.
    pub(crate) leaf_ids: Vec<(u32, u32)>,
    pub(crate) instance_ids: Vec<u32>,
    /// Texture look-ups and bytes told by filters.
    pub(crate) alpha: (u64, u64),
    /// The flag of every call of `finish`.
    pub(crate) finished: Vec<bool>,
}

/// Writes down everything.
pub(crate) struct Listener<'a>(pub(crate) &'a mut Heard);

impl RayProbe for Listener<'_> {
    fn node(&mut self, id: u32, boxes: u32) {
        self.0.counts.nodes += 1;
        self.0.counts.boxes += u64::from(boxes);
        self.0.node_ids.push(id);
    }
    fn leaf(&mut self, id: u32, shapes: u32) {
        self.0.counts.leaves += 1;
        self.0.counts.shapes += u64::from(shapes);
        self.0.leaf_ids.push((id, shapes));
    }
    fn instance(&mut self, id: u32) {
        self.0.counts.instances += 1;
        self.0.instance_ids.push(id);
    }
    fn alpha(&mut self, lookups: u32, bytes: u32) {
        self.0.alpha.0 += u64::from(lookups);
        self.0.alpha.1 += u64::from(bytes);
    }
    fn finish(self, hit: bool) {
        self.0.finished.push(hit);
    }
}

/// Triangles and their tree under every instruction set.
pub(crate) struct Scene {
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) trees: Vec<Bvh>,
}

impl Scene {
    pub(crate) fn new(triangles: Vec<Triangle>, quality: Quality) -> Self {
        let trees = [Isa::Portable, Isa::Auto]
            .map(|isa| Bvh::build(&triangles, BuildOptions { quality, isa, ..Default::default() }).unwrap())
            .into();
        Self { triangles, trees }
    }

    /// Tree and loop give the same bits, with and without a probe, under every instruction set; every value is finite;
    /// and the probe hears what the recursive twin counts. Returns the hit.
    #[track_caller]
    pub(crate) fn check(&self, ray: &Ray) -> Option<Hit> {
        let expected = oracle::brute_force(&self.triangles, ray);
        if let Some(hit) = expected {
            let sane = hit.t.is_finite()
                && hit.t > ray.t_min
                && hit.t < ray.t_max
                && (0.0..=1.0).contains(&hit.u)
                && (0.0..=1.0).contains(&hit.v)
                && hit.u + hit.v <= 1.0
                && (dot(wide(hit.normal), wide(hit.normal)) - 1.0).abs() < 1e-6;
            assert!(sane, "{hit:?} of {ray:?}");
        }
        for tree in &self.trees {
            let isa = tree.isa();
            let closest = tree.closest_hit(ray, NoProbe);
            assert_eq!(bits(closest), bits(expected), "{isa:?} {ray:?}: {closest:?}, not {expected:?}");
            assert_eq!(tree.occluded(ray, NoProbe), expected.is_some(), "{isa:?} occluded {ray:?}");
            self.check_counts(tree, ray, expected);
        }
        expected
    }

    #[track_caller]
    fn check_counts(&self, tree: &Bvh, ray: &Ray, expected: Option<Hit>) {
        let mut nearest = Heard::default();
        let hit = tree.closest_hit(ray, Listener(&mut nearest));
        assert_eq!(bits(hit), bits(expected), "with a probe: {ray:?}");
        let (found, counts) = oracle::closest(tree, ray);
        assert_eq!(found, expected.map(|h| (h.primitive, h.t)), "oracle: {ray:?}");
        assert_eq!(nearest.counts, counts, "{:?} closest {ray:?}", tree.isa());
        assert_eq!(nearest.finished, [expected.is_some()], "{ray:?}");

        let mut any = Heard::default();
        let blocked = tree.occluded(ray, Listener(&mut any));
        let (found, counts) = oracle::occluded(tree, ray);
        assert_eq!((blocked, found), (expected.is_some(), expected.is_some()), "with a probe: {ray:?}");
        assert_eq!(any.counts, counts, "{:?} occluded {ray:?}", tree.isa());
        assert_eq!(any.finished, [expected.is_some()], "{ray:?}");

        for heard in [nearest, any] {
            assert!(heard.node_ids.iter().all(|&id| (id as usize) < tree.node_count()));
            for (id, shapes) in heard.leaf_ids {
                assert!((id as usize) < tree.block_count());
                assert_eq!(shapes as usize, tree.block_triangles(id).count());
            }
        }
    }
}
