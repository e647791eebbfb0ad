//! An 8-wide bounding volume hierarchy over triangles, for single rays, generic over a probe; and for packets of them.
//!
//! ```
//! use hotspot_bvh::{Bvh, NoProbe, Ray};
//!
//! let triangles = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
//! let bvh = Bvh::build(&triangles, Default::default())?;
//! let hit = bvh.closest_hit(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]), NoProbe).unwrap();
//! assert_eq!((hit.t, hit.primitive, hit.normal), (1.0, 0, [0.0, 0.0, 1.0]));
//! assert!(!bvh.occluded(&Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, 1.0]), NoProbe));
//! # Ok::<(), hotspot_bvh::BvhError>(())
//! ```
//!
//! * Robust: closed meshes do not leak, and every query agrees exactly with a loop over all triangles
//!   (`triangle.rs` has the argument).
//! * The same hits and the same counts on every processor and instruction set, bit for bit.
//! * Meshes that appear many times are stored once ([`Bvh::build_instanced`]); surfaces with holes are cut out during
//!   traversal ([`Filter`]); a tree without them does not pay for them.
//! * A binary tree by locally ordered clustering and reinsertion decides the topology; a dynamic program collapses it to eight
//!   children per node and up to eight triangles per leaf block. Built in the caller's rayon pool, the same tree for any
//!   number of threads.

#![deny(unsafe_code)]

mod binary;
mod build;
mod collapse;
mod curve;
mod exact;
pub mod few;
mod filter;
mod huge;
mod instance;
pub mod lanes;
mod neighbours;
mod node;
mod obvhs;
pub mod oracle;
mod owners;
mod packet;
mod plan;
mod ploc;
#[cfg(test)]
mod random;
mod ray;
pub mod rays;
mod reinsertion;
mod shuffle;
pub mod simd;
mod stack;
mod tasks;
mod traverse;
mod triangle;

pub use build::{BuildOptions, Quality};
pub use filter::{Candidate, Filter, NoFilter};
pub use hotspot_probe::{NoProbe, RayProbe};
pub use instance::Instance;
pub use owners::{Owner, Owners};
pub use packet::PACKET;
pub use ray::{Hit, NO_INSTANCE, Ray};

use instance::Placed;
use node::{Bounds, Child, Node};
use simd::{Isa, Portable, Simd};
use triangle::{Block, NO_PRIMITIVE};

/// Children per node.
pub const WIDTH: u32 = 8;

/// Why a tree could not be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhError {
    /// A coordinate is NaN or infinite; drop the triangle before building.
    NotFinite {
        /// Index of the mesh; `None`: a triangle of the world.
        mesh: Option<usize>,
        /// Index of the triangle.
        triangle: usize,
    },
    /// More than 2^27 − 2 triangles.
    TooManyTriangles {
        /// How many were given.
        count: usize,
    },
    /// More than 2^27 − 2 instances and triangles together.
    TooManyInstances {
        /// How many were given.
        count: usize,
    },
    /// An instance of a mesh that was not given.
    NoSuchMesh {
        /// Index of the instance.
        instance: usize,
    },
    /// An instance of a mesh without triangles; leave it out.
    EmptyMesh {
        /// Index of the instance.
        instance: usize,
    },
    /// An instance whose matrix has no (faithful) inverse, or which lies beyond the range of f32; place its triangles
    /// themselves.
    NotInvertible {
        /// Index of the instance.
        instance: usize,
    },
}

impl core::fmt::Display for BvhError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotFinite { mesh, triangle } => {
                let place = mesh.map_or(String::new(), |mesh| format!(" of mesh {mesh}"));
                write!(
                    f,
                    "triangle {triangle}{place} has a coordinate that is not finite; drop it before building the tree"
                )
            }
            Self::TooManyTriangles { count } => {
                write!(f, "{count} triangles are more than a tree can hold ({})", Child::LIMIT - 1)
            }
            Self::TooManyInstances { count } => {
                write!(
                    f,
                    "{count} instances are more than a tree can hold beside its triangles ({} in all)",
                    Child::LIMIT - 1
                )
            }
            Self::NoSuchMesh { instance } => {
                write!(f, "instance {instance} is of a mesh that does not exist; give the mesh")
            }
            Self::EmptyMesh { instance } => {
                write!(f, "instance {instance} is of a mesh without triangles; leave it out")
            }
            Self::NotInvertible { instance } => {
                write!(
                    f,
                    "the matrix of instance {instance} cannot be inverted; place its triangles themselves"
                )
            }
        }
    }
}

impl core::error::Error for BvhError {}

/// A tree over triangles.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    blocks: Vec<Block>,
    root: Child,
    instances: Vec<Placed>,
    bounds: Bounds,
    triangles: usize,
    isa: Isa,
}

impl Bvh {
    /// Builds a tree over `triangles`, each three corners, counter-clockwise seen from the front.
    ///
    /// # Errors
    /// When a coordinate is not finite or there are too many triangles. Degenerate triangles are allowed; nothing hits
    /// them.
    pub fn build(triangles: &[[[f32; 3]; 3]], options: BuildOptions) -> Result<Self, BvhError> {
        build::build::<&[_]>(triangles, &[], &[], options)
    }

    /// Builds a tree over `triangles` of the world and over `instances` of `meshes`, each of which is stored once.
    ///
    /// # Errors
    /// As [`Bvh::build`], and when an instance names no mesh, or one without triangles, or has no faithful inverse.
    pub fn build_instanced<M: AsRef<[[[f32; 3]; 3]]>>(
        triangles: &[[[f32; 3]; 3]],
        meshes: &[M],
        instances: &[Instance],
        options: BuildOptions,
    ) -> Result<Self, BvhError> {
        build::build(triangles, meshes, instances, options)
    }

    /// Whether a mesh of these bounds, so placed, can be an instance: the matrix must have a faithful inverse, and place
    /// and scale must stay well within the range of f32.
    pub fn can_place(min: [f32; 3], max: [f32; 3], to_world: &[[f64; 4]; 3]) -> bool {
        instance::can_place(&Bounds { min, max }, to_world)
    }

    /// The nearest hit of `ray` in (`t_min`, `t_max`).
    #[inline]
    pub fn closest_hit<P: RayProbe>(&self, ray: &Ray, probe: P) -> Option<Hit> {
        #[cfg(target_arch = "x86_64")]
        if self.isa == Isa::Avx2
            && let Some(avx2) = simd::Avx2::detect()
        {
            return self.closest_hit_with(avx2, ray, probe);
        }
        self.closest_hit_with(Portable, ray, probe)
    }

    /// Whether anything is hit in (`t_min`, `t_max`).
    #[inline]
    pub fn occluded<P: RayProbe>(&self, ray: &Ray, probe: P) -> bool {
        #[cfg(target_arch = "x86_64")]
        if self.isa == Isa::Avx2
            && let Some(avx2) = simd::Avx2::detect()
        {
            return self.occluded_with(avx2, ray, probe);
        }
        self.occluded_with(Portable, ray, probe)
    }

    /// [`Bvh::closest_hit`] under a token chosen by the caller, for loops that are compiled for it as a whole.
    #[inline(always)]
    pub fn closest_hit_with<S: Simd, P: RayProbe>(&self, simd: S, ray: &Ray, probe: P) -> Option<Hit> {
        if self.instances.is_empty() {
            self.closest_hit_flat(simd, ray, [], probe)
        } else {
            self.closest_hit_filtered(simd, ray, [], NoFilter, probe)
        }
    }

    /// [`Bvh::occluded`] under a token chosen by the caller.
    #[inline(always)]
    pub fn occluded_with<S: Simd, P: RayProbe>(&self, simd: S, ray: &Ray, probe: P) -> bool {
        if self.instances.is_empty() {
            self.occluded_flat(simd, ray, [], probe)
        } else {
            self.occluded_filtered(simd, ray, [], NoFilter, probe)
        }
    }

    /// The nearest hit in a tree without instances: for loops that choose by [`Bvh::instance_count`] themselves.
    ///
    /// `except`: triangles that the ray is known not to hit, such as the one that it starts on. Time is saved, since every
    /// ray comes near that one; visits and counts are as without. A number that no triangle has excepts none.
    ///
    /// # Panics
    /// May panic where the tree has instances.
    #[inline(always)]
    pub fn closest_hit_flat<S: Simd, P: RayProbe, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        probe: P,
    ) -> Option<Hit> {
        simd.vectorize(
            #[inline(always)]
            || self.closest_hit_here(simd, ray, except, probe),
        )
    }

    /// As [`Bvh::closest_hit_flat`], for callers that run in [`Simd::vectorize`] themselves: never a call, so that a probe that
    /// holds much need not be handed over.
    ///
    /// # Panics
    /// May panic where the tree has instances.
    #[inline(always)]
    pub fn closest_hit_here<S: Simd, P: RayProbe, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        probe: P,
    ) -> Option<Hit> {
        traverse::closest::<S, P, NoFilter, false, N>(simd, self, ray, except, NoFilter, probe)
    }

    /// The nearest hits of up to [`PACKET`] rays in a tree without instances: those of [`Bvh::closest_hit_flat`], bit for bit, and
    /// sooner where the rays run close together, as the camera rays of a pixel do. Visits cannot be counted: the rays share them.
    ///
    /// # Panics
    /// Where `rays` and `hits` differ in length or are longer than a packet; may panic where the tree has instances.
    #[inline(always)]
    pub fn closest_hits_flat<S: Simd>(&self, simd: S, rays: &[Ray], hits: &mut [Option<Hit>]) {
        simd.vectorize(
            #[inline(always)]
            || packet::closest_of_packet(simd, self, rays, hits),
        );
    }

    /// Whether anything is hit in a tree without instances; `except` as in [`Bvh::closest_hit_flat`].
    ///
    /// # Panics
    /// May panic where the tree has instances.
    #[inline(always)]
    pub fn occluded_flat<S: Simd, P: RayProbe, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        probe: P,
    ) -> bool {
        simd.vectorize(
            #[inline(always)]
            || self.occluded_here(simd, ray, except, probe),
        )
    }

    /// As [`Bvh::occluded_flat`], for callers that run in [`Simd::vectorize`] themselves ([`Bvh::closest_hit_here`]).
    ///
    /// # Panics
    /// May panic where the tree has instances.
    #[inline(always)]
    pub fn occluded_here<S: Simd, P: RayProbe, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        probe: P,
    ) -> bool {
        traverse::any::<S, P, NoFilter, false, N>(simd, self, ray, except, NoFilter, probe)
    }

    /// The nearest hit that `filter` accepts; `except` as in [`Bvh::closest_hit_flat`], triangles of the world. Not inlined, so that
    /// a loop that seldom needs it stays small.
    #[inline(never)]
    pub fn closest_hit_filtered<S: Simd, P: RayProbe, F: Filter, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        filter: F,
        probe: P,
    ) -> Option<Hit> {
        simd.vectorize(
            #[inline(always)]
            || self.closest_hit_filtered_here::<S, P, F, true, N>(simd, ray, except, filter, probe),
        )
    }

    /// As [`Bvh::closest_hit_filtered`], for callers that run in [`Simd::vectorize`] themselves, and whose rays nearly all come here.
    /// `INSTANCED`: whether the tree may have instances.
    ///
    /// # Panics
    /// May panic where the tree has instances and `INSTANCED` is false.
    #[inline(always)]
    pub fn closest_hit_filtered_here<
        S: Simd,
        P: RayProbe,
        F: Filter,
        const INSTANCED: bool,
        const N: usize,
    >(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        filter: F,
        probe: P,
    ) -> Option<Hit> {
        traverse::closest::<S, P, F, INSTANCED, N>(simd, self, ray, except, filter, probe)
    }

    /// Whether there is a hit that `filter` accepts; `except` as in [`Bvh::closest_hit_flat`], triangles of the world.
    #[inline(never)]
    pub fn occluded_filtered<S: Simd, P: RayProbe, F: Filter, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        filter: F,
        probe: P,
    ) -> bool {
        simd.vectorize(
            #[inline(always)]
            || self.occluded_filtered_here::<S, P, F, true, N>(simd, ray, except, filter, probe),
        )
    }

    /// As [`Bvh::occluded_filtered`], for callers that run in [`Simd::vectorize`] themselves ([`Bvh::closest_hit_filtered_here`]).
    ///
    /// # Panics
    /// May panic where the tree has instances and `INSTANCED` is false.
    #[inline(always)]
    pub fn occluded_filtered_here<S: Simd, P: RayProbe, F: Filter, const INSTANCED: bool, const N: usize>(
        &self,
        simd: S,
        ray: &Ray,
        except: [u32; N],
        filter: F,
        probe: P,
    ) -> bool {
        traverse::any::<S, P, F, INSTANCED, N>(simd, self, ray, except, filter, probe)
    }

    /// Triangles stored: those of the world, and those of each mesh once.
    pub const fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Instances.
    pub fn instance_count(&self) -> usize {
        self.instances.len()
    }

    /// Inner nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Leaf blocks.
    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// Triangles of leaf block `block`, by the index they were given with (within their mesh, for the blocks of meshes);
    /// empty beyond the last block.
    pub fn block_triangles(&self, block: u32) -> impl Iterator<Item = u32> + '_ {
        let primitives = self.blocks.get(block as usize).map_or(&[][..], |b| &b.primitives[..]);
        primitives.iter().copied().filter(|&p| p != NO_PRIMITIVE)
    }

    /// Bytes held by nodes and leaf blocks.
    pub fn memory(&self) -> u64 {
        (size_of_val(self.nodes.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.instances.as_slice())) as u64
    }

    /// Corners of the bounding box of everything, in the world; (+∞, −∞) when there are none.
    pub const fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        (self.bounds.min, self.bounds.max)
    }

    /// Name of the instruction set that [`Bvh::closest_hit`] uses.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// What tells the tree from others, in memory order, for hashing: equal trees give equal words.
    pub fn words(&self) -> impl Iterator<Item = u32> + '_ {
        let nodes = self.nodes.iter().flat_map(|n| {
            let bounds = n.bounds.iter().flatten().flat_map(|row| row.0.map(f32::to_bits));
            bounds.chain(n.children.map(Child::hashed))
        });
        let blocks = self.blocks.iter().flat_map(|b| b.primitives);
        let instances = self.instances.iter().flat_map(Placed::words);
        nodes.chain(blocks).chain(instances).chain([self.root.hashed()])
    }
}
