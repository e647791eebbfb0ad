//! What is counted: the integer sums kept for each pixel, and the names under which they are shown.
//!
//! Definitions: a *path* is one camera sample. Every count is a sum over paths, unweighted by throughput (equation 2 of
//! the paper). A counter with a `Shadow` twin holds tracing and shadow rays together; the twin holds the shadow rays'
//! part.

/// One integer sum of a pixel. The discriminant is its index in [`crate::CostPixel::counts`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Counter {
    /// Rays cast: camera, bounce and shadow.
    Rays,
    /// Shadow rays cast.
    RaysShadow,
    /// Inner nodes visited.
    Nodes,
    /// … by shadow rays.
    NodesShadow,
    /// Triangles tested.
    Shapes,
    /// … by shadow rays.
    ShapesShadow,
    /// Child boxes tested.
    Boxes,
    /// … by shadow rays.
    BoxesShadow,
    /// Leaf blocks tested.
    Leaves,
    /// … by shadow rays.
    LeavesShadow,
    /// Rays transformed into an instance's space.
    Instances,
    /// … by shadow rays.
    InstancesShadow,
    /// BSDF evaluations and samplings.
    Bsdf,
    /// Texture look-ups, alpha tests included.
    Texture,
    /// Bytes of texels touched.
    TextureBytes,
    /// Hits that were asked whether the surface is there at all (alpha tests).
    AlphaTests,
    /// Nodes visited in vain: by paths that brought no radiance, and by blocked shadow rays of the others.
    WasteNodes,
    /// Triangles tested in vain, likewise.
    WasteShapes,
    /// Paths that left the scene.
    Escaped,
    /// Paths that ended because nothing was left to carry (black surface, invalid sample).
    Absorbed,
    /// Paths that Russian roulette ended.
    Roulette,
    /// Paths that reached the maximum depth.
    DepthLimit,
}

impl Counter {
    /// Number of counters.
    pub const COUNT: usize = 22;

    /// All of them, in index order.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Rays,
        Self::RaysShadow,
        Self::Nodes,
        Self::NodesShadow,
        Self::Shapes,
        Self::ShapesShadow,
        Self::Boxes,
        Self::BoxesShadow,
        Self::Leaves,
        Self::LeavesShadow,
        Self::Instances,
        Self::InstancesShadow,
        Self::Bsdf,
        Self::Texture,
        Self::TextureBytes,
        Self::AlphaTests,
        Self::WasteNodes,
        Self::WasteShapes,
        Self::Escaped,
        Self::Absorbed,
        Self::Roulette,
        Self::DepthLimit,
    ];

    /// Name in files: `nodes_shadow`, `escaped`, …
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::RaysShadow => "rays_shadow",
            Self::Nodes => "nodes",
            Self::NodesShadow => "nodes_shadow",
            Self::Shapes => "shapes",
            Self::ShapesShadow => "shapes_shadow",
            Self::Boxes => "boxes",
            Self::BoxesShadow => "boxes_shadow",
            Self::Leaves => "leaves",
            Self::LeavesShadow => "leaves_shadow",
            Self::Instances => "instances",
            Self::InstancesShadow => "instances_shadow",
            Self::Bsdf => "bsdf",
            Self::Texture => "texture",
            Self::TextureBytes => "texture_bytes",
            Self::AlphaTests => "alpha_tests",
            Self::WasteNodes => "waste_nodes",
            Self::WasteShapes => "waste_shapes",
            Self::Escaped => "escaped",
            Self::Absorbed => "absorbed",
            Self::Roulette => "roulette",
            Self::DepthLimit => "depth_limit",
        }
    }
}

/// Why a path ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// It left the scene.
    Escaped,
    /// Nothing was left to carry.
    Absorbed,
    /// Russian roulette.
    Roulette,
    /// The maximum depth.
    DepthLimit,
}

impl Cause {
    /// The counter of paths that ended this way.
    pub const fn counter(self) -> Counter {
        match self {
            Self::Escaped => Counter::Escaped,
            Self::Absorbed => Counter::Absorbed,
            Self::Roulette => Counter::Roulette,
            Self::DepthLimit => Counter::DepthLimit,
        }
    }
}
