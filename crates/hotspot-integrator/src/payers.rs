//! Who pays for what in a prepared scene: the tree's owners, as the ledgers want them; and what they know its parts by.

use crate::geometry::Geometry;
use crate::scene::RenderScene;
use hotspot_bvh::Owner;
use hotspot_cost::ledger::{Aim, Payer, PayerDesc, Payers, RayKey, Sender};
use hotspot_probe::{NONE, RayKind};

impl RenderScene {
    /// The tables of the payer ledger: a node or leaf block belongs to an object if every triangle below it does; those of a
    /// mesh that is stored once to the object of the instance that the ray is in.
    pub fn payers(&self) -> Payers {
        let geometry = &self.geometry;
        let owner = |triangle: u32| geometry.part(triangle).object;
        let instances: Vec<u32> = geometry.placed.iter().map(|placed| placed.part.object).collect();
        let owners = self.bvh.owners(owner, |instance| instances[instance as usize]);
        let payer = |owner: &Owner, triangles: &dyn Fn() -> Vec<u32>| match owner {
            Owner::One(object) => Payer::Object(*object),
            Owner::Several => Payer::Scene(triangles()),
            Owner::Instance => Payer::Instance,
        };
        let block = |(id, found): (usize, &Owner)| {
            payer(found, &|| self.bvh.block_triangles(id as u32).map(owner).collect())
        };
        let emits = |part: &&crate::geometry::Part| part.light_pdf_area > 0.0;
        let mut lights: Vec<u32> = geometry.parts.iter().filter(emits).map(|part| part.object).collect();
        lights.sort_unstable();
        lights.dedup();
        Payers::new(&PayerDesc {
            nodes: owners.nodes.iter().map(|owner| payer(owner, &Vec::new)).collect(),
            blocks: owners.blocks.iter().enumerate().map(block).collect(),
            instances,
            triangles: self.object_triangles(),
            lights,
        })
    }
}

/// The tables of ledgers, and what those know the parts of a scene by.
pub(crate) struct Booking {
    pub(crate) payers: Payers,
    camera: RayKey,
    /// By number of part: what sends rays from it, and what those have that are aimed at it.
    parts: Vec<(Sender, Aim)>,
}

impl Booking {
    pub(crate) fn new(scene: &RenderScene) -> Self {
        let payers = scene.payers();
        let of = |number: usize| {
            let part = scene.geometry.part_of_number(number as u32);
            (payers.sender(part.object, part.material), payers.aim(part.object))
        };
        let parts = (0..scene.geometry.part_count()).map(of).collect();
        let camera = RayKey::new(payers.sender(NONE, NONE), Aim::NONE, 0, RayKind::Camera);
        Self { payers, camera, parts }
    }

    /// What a bounce ray that leaves this part is booked on; before any bounce a camera ray, which leaves none.
    #[inline(always)]
    pub(crate) fn onward(&self, part: u32, bounce: u32) -> RayKey {
        if bounce == 0 {
            return self.camera;
        }
        let (sender, _) = self.parts[part as usize];
        RayKey::new(sender, Aim::NONE, bounce, RayKind::Bounce)
    }

    /// What a shadow ray from this part to a triangle of the world is booked on ([`NONE`]: to the environment or a light without size).
    #[inline(always)]
    pub(crate) fn shadow(&self, geometry: &Geometry, part: u32, to: u32, bounce: u32) -> RayKey {
        let (sender, _) = self.parts[part as usize];
        let lit = geometry.part_of.get(to as usize).and_then(|part| self.parts.get(*part as usize));
        RayKey::new(sender, lit.map_or(Aim::NONE, |(_, aim)| *aim), bounce, RayKind::Shadow)
    }
}

#[cfg(test)]
mod tests;
