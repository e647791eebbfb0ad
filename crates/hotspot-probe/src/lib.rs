//! Instrumentation traits for ray traversal and path tracing.
//!
//! A BVH or renderer that is generic over [`RayProbe`] and [`Probe`] reports what it does (nodes visited, triangles
//! tested, rays cast, textures read) to whoever listens, and pays nothing when nobody does: [`NoProbe`] is zero-sized,
//! its methods are empty and inlined, so the traversal compiles to what it would be without the parameter.
//!
//! A per-path [`Probe`] hands out one [`RayProbe`] for each ray, a value: what it holds can live in registers during the
//! traversal. It may report as it goes or when the traversal calls [`RayProbe::finish`], which every traversal must.
//!
//! The events are those of the cost model of *Identifying and Visualizing Computational Hotspots in Path Tracing*
//! (Sundarrajan, van de Ruit, Eisemann 2022), equation 1: `C(r) = c0 * N_trav + c1 * N_shapes`.
//!
//! ```
//! use hotspot_probe::{NoProbe, RayProbe};
//!
//! /// A traversal of nothing: one node with two boxes, one leaf with three triangles.
//! fn traverse<P: RayProbe>(mut probe: P) {
//!     probe.node(0, 2);
//!     probe.leaf(0, 3);
//!     probe.finish(true);
//! }
//!
//! struct Visits<'a>(&'a mut u64, u64);
//! impl RayProbe for Visits<'_> {
//!     fn node(&mut self, _id: u32, _boxes: u32) {
//!         self.1 += 1;
//!     }
//!     fn leaf(&mut self, _id: u32, _shapes: u32) {}
//!     fn instance(&mut self, _id: u32) {}
//!     fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
//!     fn finish(self, _hit: bool) {
//!         *self.0 += self.1;
//!     }
//! }
//!
//! let mut nodes = 0;
//! traverse(Visits(&mut nodes, 0));
//! traverse(NoProbe);
//! assert_eq!(nodes, 1);
//! assert_eq!(size_of::<NoProbe>(), 0);
//! ```
#![no_std]
#![forbid(unsafe_code)]

/// Marks an absent object, material or light in a [`Spawner`].
pub const NONE: u32 = u32::MAX;

/// Why a ray was cast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayKind {
    /// From the camera: the first ray of a path.
    Camera,
    /// From a surface, continuing the path.
    Bounce,
    /// From a surface towards a sampled light.
    Shadow,
}

/// What sent a ray: the key of the spawner ledger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Spawner {
    /// Object that the ray leaves, [`NONE`] for camera rays.
    pub object: u32,
    /// Material that the ray leaves, [`NONE`] for camera rays.
    pub material: u32,
    /// Scattering events before the ray: 0 for camera rays and for the shadow rays of the first surface vertex.
    pub bounce: u32,
    /// Why it was cast.
    pub kind: RayKind,
    /// For shadow rays the object of the light aimed at ([`NONE`]: the environment or no shadow ray).
    pub light: u32,
}

impl Spawner {
    /// The camera.
    pub const CAMERA: Self =
        Self { object: NONE, material: NONE, bounce: 0, kind: RayKind::Camera, light: NONE };
}

/// Listens to the traversal of one ray.
pub trait RayProbe {
    /// False where every method is empty, so that the traversal need not gather what it would be told: the optimiser drops
    /// that too, but by then it has left its mark on the code around.
    const ON: bool = true;
    /// Inner node `id` was fetched and its `boxes` occupied child boxes were tested. One visit, however wide the node.
    fn node(&mut self, id: u32, boxes: u32);
    /// Leaf block `id` (a SIMD group of triangles) was tested; `shapes` is its number of triangles, padding excluded.
    fn leaf(&mut self, id: u32, shapes: u32);
    /// The ray was transformed into the space of instance `id`.
    fn instance(&mut self, id: u32);
    /// A hit was asked whether the surface is there at all (alpha masks and the like): `lookups` texture look-ups touched
    /// `bytes` bytes of texels.
    fn alpha(&mut self, lookups: u32, bytes: u32);
    /// The traversal ended; `hit` tells whether anything was hit (for a shadow ray: whether it was blocked). To be called once for
    /// every ray: of a probe that is dropped instead some visits may have been reported and others not.
    fn finish(self, hit: bool);
}

/// Listens to one path and hands out a [`RayProbe`] for each of its rays.
pub trait Probe {
    /// False where every method is empty, so that callers can skip work done for the probe alone.
    const ON: bool;
    /// The listener for one ray.
    type Ray<'p>: RayProbe
    where
        Self: 'p;
    /// A ray is about to be cast.
    fn ray(&mut self, by: Spawner) -> Self::Ray<'_>;
    /// A shadow ray counts but is not traced (ray counts alone were asked for).
    fn untraced(&mut self, by: Spawner);
    /// `evaluations` BSDF evaluations or samplings took place.
    fn bsdf(&mut self, evaluations: u32);
    /// `lookups` texture look-ups touched `bytes` bytes of texels.
    fn texture(&mut self, lookups: u32, bytes: u32);
    /// The last camera or bounce ray landed on triangle `primitive` of instance `instance` ([`NONE`]: of the world), where its second
    /// and third corner have these weights.
    #[inline(always)]
    fn landed(&mut self, _instance: u32, _primitive: u32, _weights: [f32; 2]) {}
    /// The path goes on from a surface with this throughput (largest component, with what roulette made of it).
    #[inline(always)]
    fn scattered(&mut self, _throughput: f32) {}
    /// The path found light, `luminance` per camera sample after all weights, that the depth limit would have let scatter
    /// `left` times more.
    #[inline(always)]
    fn light(&mut self, left: u32, luminance: f32) {
        let _ = (left, luminance);
    }
}

/// Listens to nothing and costs nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoProbe;

impl RayProbe for NoProbe {
    const ON: bool = false;
    #[inline(always)]
    fn node(&mut self, _id: u32, _boxes: u32) {}
    #[inline(always)]
    fn leaf(&mut self, _id: u32, _shapes: u32) {}
    #[inline(always)]
    fn instance(&mut self, _id: u32) {}
    #[inline(always)]
    fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
    #[inline(always)]
    fn finish(self, _hit: bool) {}
}

impl Probe for NoProbe {
    const ON: bool = false;
    type Ray<'p> = NoProbe;
    #[inline(always)]
    fn ray(&mut self, _by: Spawner) -> NoProbe {
        NoProbe
    }
    #[inline(always)]
    fn untraced(&mut self, _by: Spawner) {}
    #[inline(always)]
    fn bsdf(&mut self, _evaluations: u32) {}
    #[inline(always)]
    fn texture(&mut self, _lookups: u32, _bytes: u32) {}
}
