//! What paths through a region do: the evidence that causes are told from.

use crate::counter::Counter;
use crate::ledger::{Ledgers, SpawnerKind};
use crate::metric::CostModel;
use crate::recorder::{CostPixel, TileRecorder};
use std::collections::BTreeMap;

/// Paths traced through a region, counted and booked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sounding {
    /// Their sums.
    pub counts: CostPixel,
    /// The same booked: all of these paths and no others.
    pub ledgers: Ledgers,
}

impl Sounding {
    /// Adds the sums of a recorder of these paths.
    pub fn add(&mut self, recorder: &TileRecorder) {
        for pixel in recorder.costs() {
            self.counts.merge(pixel);
        }
    }

    /// How many paths.
    pub const fn paths(&self) -> u64 {
        self.counts.samples
    }
}

/// Nodes, triangles, leaves and alpha tests at one payer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Paid {
    pub(super) nodes: f64,
    pub(super) shapes: f64,
    pub(super) alpha_tests: f64,
}

/// A shadow ray's aim: how many were sent, how many were blocked.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Aimed {
    pub(super) rays: f64,
    pub(super) blocked: f64,
}

/// Soundings of one region per path, by who does it.
#[derive(Clone, Debug, Default)]
pub(super) struct Flow {
    pub(super) paths: f64,
    /// Intersection cost.
    pub(super) cost: f64,
    pub(super) rays: f64,
    pub(super) shadow_rays: f64,
    pub(super) nodes: f64,
    pub(super) shapes: f64,
    /// Cost of blocked shadow rays.
    pub(super) blocked: f64,
    /// Cost of paths that brought no light but for their blocked shadow rays: a lower bound.
    pub(super) futile: f64,
    /// Texture look-ups but for those of alpha tests.
    pub(super) textures: f64,
    pub(super) alpha_tests: f64,
    /// Moves from object to object.
    pub(super) moves: BTreeMap<(u32, u32), f64>,
    /// Bounce rays by the object and material that they leave.
    pub(super) left: BTreeMap<(u32, u32), f64>,
    /// By the object of the light.
    pub(super) aimed: BTreeMap<Option<u32>, Aimed>,
    /// By whose nodes and triangles were met; `None`: the scene's.
    pub(super) paid: BTreeMap<Option<u32>, Paid>,
}

impl Flow {
    pub(super) fn of<'s>(soundings: impl IntoIterator<Item = &'s Sounding>, model: CostModel) -> Self {
        let mut flow = Self::default();
        for sounding in soundings {
            flow.add(sounding, model);
        }
        let paths = flow.paths.max(1.0);
        let sums = [
            &mut flow.cost,
            &mut flow.rays,
            &mut flow.shadow_rays,
            &mut flow.nodes,
            &mut flow.shapes,
            &mut flow.blocked,
            &mut flow.futile,
            &mut flow.textures,
            &mut flow.alpha_tests,
        ];
        let maps = flow.moves.values_mut().chain(flow.left.values_mut());
        let aimed = flow.aimed.values_mut().flat_map(|a| [&mut a.rays, &mut a.blocked]);
        let paid = flow.paid.values_mut().flat_map(|p| [&mut p.nodes, &mut p.shapes, &mut p.alpha_tests]);
        sums.into_iter().chain(maps).chain(aimed).chain(paid).for_each(|sum| *sum /= paths);
        flow
    }

    fn add(&mut self, sounding: &Sounding, model: CostModel) {
        let count = |counter| sounding.counts.get(counter) as f64;
        let cost = |nodes: f64, shapes: f64| model.c0 * nodes + model.c1 * shapes;
        self.paths += sounding.paths() as f64;
        self.cost += cost(count(Counter::Nodes), count(Counter::Shapes));
        self.rays += count(Counter::Rays);
        self.shadow_rays += count(Counter::RaysShadow);
        self.nodes += count(Counter::Nodes);
        self.shapes += count(Counter::Shapes);
        self.textures += (count(Counter::Texture) - count(Counter::AlphaTests)).max(0.0);
        self.alpha_tests += count(Counter::AlphaTests);
        let ledgers = &sounding.ledgers;
        let mut blocked = 0.0;
        for row in &ledgers.spawner {
            let rays = row.rays as f64;
            match (row.kind, row.object, row.material) {
                (SpawnerKind::Bounce, Some(object), Some(material)) => {
                    *self.left.entry((object, material)).or_default() += rays;
                }
                (SpawnerKind::Shadow, ..) => {
                    let aimed = self.aimed.entry(row.light).or_default();
                    aimed.rays += rays;
                    aimed.blocked += row.hits as f64;
                    // Booked is nodes + triangles: of their cost the same share.
                    let all = (row.traversal.nodes + row.traversal.shapes) as f64;
                    if all > 0.0 {
                        blocked += row.traversal.cost(model) * row.blocked as f64 / all;
                    }
                }
                _ => {}
            }
        }
        self.blocked += blocked;
        self.futile += (cost(count(Counter::WasteNodes), count(Counter::WasteShapes)) - blocked).max(0.0);
        for row in &ledgers.matrix {
            if let (Some(from), Some(to)) = (row.spawner, row.payer) {
                *self.moves.entry((from, to)).or_default() += row.landed as f64;
            }
        }
        for row in &ledgers.payer {
            let paid = self.paid.entry(row.object).or_default();
            paid.nodes += row.traversal.nodes as f64;
            paid.shapes += row.traversal.shapes as f64;
            paid.alpha_tests += row.traversal.alpha_tests as f64;
        }
    }

    /// Camera and bounce rays.
    pub(super) fn vertices(&self) -> f64 {
        self.rays - self.shadow_rays
    }

    pub(super) fn moved(&self, from: u32, to: u32) -> f64 {
        self.moves.get(&(from, to)).copied().unwrap_or(0.0)
    }

    pub(super) fn paid(&self, payer: Option<u32>) -> Paid {
        self.paid.get(&payer).copied().unwrap_or_default()
    }
}
