//! Who pays for what in a prepared scene: the tree's owners, as the ledgers want them.

use crate::scene::RenderScene;
use hotspot_bvh::Owner;
use hotspot_cost::ledger::{Payer, PayerDesc, Payers};

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

#[cfg(test)]
mod tests;
