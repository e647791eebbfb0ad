//! Ledgers as they are written: the rows of `NAME.json` and of the CSV files.

use crate::metric::CostModel;
use hotspot_probe::RayKind;
use serde::{Deserialize, Serialize};

/// The ledgers of a frame, each sorted by falling nodes + shapes. Rows without any count are left out.
///
/// Objects and materials are indices into `objects` and `materials`, the ids that hotspots and layers use.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Ledgers {
    /// Names of the objects, by id. In scenes of very many objects the smallest share the last entry, whose id is not that
    /// of any object.
    pub objects: Vec<String>,
    /// Names of the materials, by id.
    pub materials: Vec<String>,
    /// How many objects share the last entry of `objects`; 0: none do.
    pub merged_objects: u64,
    /// By what sent the ray. In a JSON document at most [`Ledgers::MOST_SPAWNERS`] rows, the last one for all others; the CSV
    /// file has every row.
    pub spawner: Vec<SpawnerRow>,
    /// By what was visited.
    pub payer: Vec<PayerRow>,
    /// By both. In a JSON document at most [`Ledgers::MOST_SPAWNERS`] rows, the last one for all others.
    pub matrix: Vec<MatrixRow>,
}

/// Why rays were cast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SpawnerKind {
    /// From the camera.
    #[default]
    Camera,
    /// From a surface, continuing the path.
    Bounce,
    /// From a surface towards a light.
    Shadow,
    /// Several kinds: the row that stands for all that are not listed.
    Other,
}

impl SpawnerKind {
    /// As written.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Bounce => "bounce",
            Self::Shadow => "shadow",
            Self::Other => "other",
        }
    }
}

impl From<RayKind> for SpawnerKind {
    fn from(kind: RayKind) -> Self {
        match kind {
            RayKind::Camera => Self::Camera,
            RayKind::Bounce => Self::Bounce,
            RayKind::Shadow => Self::Shadow,
        }
    }
}

/// What traversal did. Exact integers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Traversal {
    /// Inner nodes visited.
    pub nodes: u64,
    /// Child boxes tested.
    pub boxes: u64,
    /// Leaf blocks tested.
    pub leaves: u64,
    /// Triangles tested.
    pub shapes: u64,
    /// Rays taken into the space of an instance.
    pub instances: u64,
    /// Hits that were asked whether the surface is there (alpha); paid by the owner of the leaf block.
    pub alpha_tests: u64,
}

impl Traversal {
    /// Adds the counts of another.
    pub const fn add(&mut self, other: &Self) {
        self.nodes += other.nodes;
        self.boxes += other.boxes;
        self.leaves += other.leaves;
        self.shapes += other.shapes;
        self.instances += other.instances;
        self.alpha_tests += other.alpha_tests;
    }

    /// Intersection cost: c0 · nodes + c1 · shapes (equation 1).
    pub fn cost(&self, model: CostModel) -> f64 {
        model.c0 * self.nodes as f64 + model.c1 * self.shapes as f64
    }

    /// Rank within a ledger.
    pub(crate) const fn weight(&self) -> u64 {
        self.nodes.saturating_add(self.shapes)
    }
}

/// A row of the spawner ledger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SpawnerRow {
    /// Object that the rays leave; null for camera rays (and for the row of all others).
    pub object: Option<u32>,
    /// Material that they leave; null for camera rays.
    pub material: Option<u32>,
    /// Scattering events before them, 31 for 31 and more; 0 for camera rays and for shadow rays of the first surface.
    pub bounce: u32,
    /// Why they were cast.
    pub kind: SpawnerKind,
    /// Object of the light that shadow rays aimed at; null for environments, lights without area and other rays.
    pub light: Option<u32>,
    /// Rays cast.
    pub rays: u64,
    /// Of these, how many hit anything; shadow rays: how many were blocked.
    pub hits: u64,
    /// Nodes and shapes of the shadow rays that were blocked: cost that brought no light.
    pub blocked: u64,
    /// What they did.
    #[serde(flatten)]
    pub traversal: Traversal,
}

/// A row of the payer ledger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct PayerRow {
    /// Object whose triangles lie below what was visited; null for the `scene`: nodes and blocks of several objects.
    pub object: Option<u32>,
    /// What happened there.
    #[serde(flatten)]
    pub traversal: Traversal,
}

/// A row of the matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct MatrixRow {
    /// Object that the rays leave; null for the camera.
    pub spawner: Option<u32>,
    /// Object that was visited; null for the `scene`.
    pub payer: Option<u32>,
    /// Stands for all pairs that are not listed; `spawner` and `payer` say nothing then.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub others: bool,
    /// Paths that went from the one to the other and on from there: together as many as bounce rays.
    pub landed: u64,
    /// What happened there.
    #[serde(flatten)]
    pub traversal: Traversal,
}

impl Ledgers {
    /// Most rows of the spawner ledger and of the matrix in a JSON document.
    pub const MOST_SPAWNERS: usize = 1000;

    /// Name of an object; `none` where there is none.
    pub fn object_name<'a>(&'a self, object: Option<u32>, none: &'a str) -> &'a str {
        object.map_or(none, |object| self.objects.get(object as usize).map_or("?", String::as_str))
    }

    /// Name of a material; empty where there is none.
    pub fn material_name(&self, material: Option<u32>) -> &str {
        material.map_or("", |material| self.materials.get(material as usize).map_or("?", String::as_str))
    }

    /// Sorts the rows and names the entry that several objects share.
    pub(super) fn finish(&mut self) {
        use std::cmp::Reverse;
        self.spawner.sort_by_key(|r| {
            (Reverse(r.traversal.weight()), Reverse(r.rays), r.object, r.material, r.bounce, r.kind, r.light)
        });
        self.payer.sort_by_key(|row| (Reverse(row.traversal.weight()), row.object));
        self.matrix.sort_by_key(|row| (Reverse(row.traversal.weight()), row.spawner, row.payer));
        let shared = self.objects.len() as u32;
        if self.merged_objects > 0 || self.spawner.iter().any(|row| row.light == Some(shared)) {
            self.objects.push("(other objects)".to_owned());
        }
    }

    /// The ledgers with what exceeds [`Ledgers::MOST_SPAWNERS`] rows summed up in a last row: for documents.
    #[must_use]
    pub fn shortened(mut self) -> Self {
        if self.spawner.len() > Self::MOST_SPAWNERS {
            let mut rest = SpawnerRow { kind: SpawnerKind::Other, ..SpawnerRow::default() };
            for row in self.spawner.drain(Self::MOST_SPAWNERS - 1..) {
                rest.rays += row.rays;
                rest.hits += row.hits;
                rest.blocked += row.blocked;
                rest.traversal.add(&row.traversal);
            }
            self.spawner.push(rest);
        }
        if self.matrix.len() > Self::MOST_SPAWNERS {
            let mut rest = MatrixRow { others: true, ..MatrixRow::default() };
            for row in self.matrix.drain(Self::MOST_SPAWNERS - 1..) {
                rest.landed += row.landed;
                rest.traversal.add(&row.traversal);
            }
            self.matrix.push(rest);
        }
        self
    }
}
