//! What metrics are called.

use super::Metric;

impl Metric {
    /// Name, label, unit, description.
    pub(super) const fn words(self) -> (&'static str, &'static str, &'static str, &'static str) {
        match self {
            Self::Rays => (
                "rays",
                "Rays",
                "rays per path",
                "Rays cast for one camera sample: camera, bounce and shadow rays.",
            ),
            Self::RaysShadow => ("rays_shadow", "Shadow rays", "rays per path", "Rays cast towards lights."),
            Self::Nodes => {
                ("nodes", "Tree nodes visited", "nodes per path", "Inner nodes of the tree that rays visit.")
            }
            Self::NodesShadow => (
                "nodes_shadow",
                "Tree nodes visited by shadow rays",
                "nodes per path",
                "Inner nodes of the tree that shadow rays visit.",
            ),
            Self::Shapes => (
                "shapes",
                "Triangles tested",
                "triangles per path",
                "Triangles that rays are tested against.",
            ),
            Self::ShapesShadow => (
                "shapes_shadow",
                "Triangles tested by shadow rays",
                "triangles per path",
                "Triangles that shadow rays are tested against.",
            ),
            Self::Intersection => (
                "intersection",
                "Intersection cost",
                "cost units per path",
                "c0 × nodes visited + c1 × triangles tested, of all rays.",
            ),
            Self::IntersectionShadow => (
                "intersection_shadow",
                "Intersection cost of shadow rays",
                "cost units per path",
                "c0 × nodes visited + c1 × triangles tested, of shadow rays.",
            ),
            Self::Boxes => (
                "boxes",
                "Boxes tested",
                "boxes per path",
                "Child boxes tested: compares across tree widths.",
            ),
            Self::BoxesShadow => (
                "boxes_shadow",
                "Boxes tested by shadow rays",
                "boxes per path",
                "Child boxes tested by shadow rays.",
            ),
            Self::Leaves => {
                ("leaves", "Leaf blocks tested", "blocks per path", "Groups of triangles tested at once.")
            }
            Self::LeavesShadow => (
                "leaves_shadow",
                "Leaf blocks tested by shadow rays",
                "blocks per path",
                "Groups of triangles tested at once by shadow rays.",
            ),
            Self::Instances => (
                "instances",
                "Instances entered",
                "instances per path",
                "Rays transformed into the space of a mesh used more than once.",
            ),
            Self::InstancesShadow => (
                "instances_shadow",
                "Instances entered by shadow rays",
                "instances per path",
                "Shadow rays transformed into the space of a mesh used more than once.",
            ),
            Self::Waste => (
                "waste",
                "Cost in vain",
                "cost units per path",
                "Intersection cost of paths that brought no light, and of blocked shadow rays of the others.",
            ),
            Self::TimeUs => {
                ("time_us", "Time", "µs per path", "Microseconds spent on one camera sample; noisy.")
            }
            Self::Bsdf => (
                "bsdf",
                "Material evaluations",
                "evaluations per path",
                "How often a material is evaluated or sampled.",
            ),
            Self::Texture => (
                "texture",
                "Texture look-ups",
                "look-ups per path",
                "Texture look-ups, alpha tests included.",
            ),
            Self::TextureBytes => {
                ("texture_bytes", "Texture bytes", "bytes per path", "Bytes of texture touched.")
            }
            Self::AlphaTests => (
                "alpha_tests",
                "Alpha tests",
                "tests per path",
                "How often a hit was asked whether the surface is there at all.",
            ),
            Self::Throughput => (
                "cause.throughput",
                "Throughput left at the end",
                "of 1, mean over paths",
                "Largest component of the throughput when a path ends, before roulette's compensation.",
            ),
            Self::Escaped => {
                ("cause.escaped", "Paths that left the scene", "share of paths", "Paths that hit nothing.")
            }
            Self::Absorbed => (
                "cause.absorbed",
                "Paths absorbed",
                "share of paths",
                "Paths that ended because nothing was left to carry.",
            ),
            Self::Roulette => (
                "cause.roulette",
                "Paths ended by roulette",
                "share of paths",
                "Paths that Russian roulette ended at random, mostly dim ones.",
            ),
            Self::DepthLimit => (
                "cause.depth_limit",
                "Paths cut at the depth limit",
                "share of paths",
                "Paths that reached the maximum depth.",
            ),
        }
    }
}
