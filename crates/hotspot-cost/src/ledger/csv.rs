//! Ledgers as CSV (RFC 4180), every row, for spreadsheets: `NAME.ledger.{spawner,payer,matrix}.csv`.

use super::rows::{Ledgers, Traversal};
use std::fmt::Write;

const COUNTS: &str = "nodes,boxes,leaves,shapes,instances,alpha_tests";

fn counts(t: &Traversal) -> String {
    format!("{},{},{},{},{},{}", t.nodes, t.boxes, t.leaves, t.shapes, t.instances, t.alpha_tests)
}

/// A name as a field: in quotes, since names hold anything. A leading `=`, `+`, `-` or `@` would be a formula to spreadsheets;
/// an apostrophe keeps it text.
fn field(name: &str) -> String {
    let text = if name.starts_with(['=', '+', '-', '@', '\t', '\r']) { "'" } else { "" };
    format!("\"{text}{}\"", name.replace('"', "\"\""))
}

fn id(id: Option<u32>) -> String {
    id.map_or_else(String::new, |id| id.to_string())
}

impl Ledgers {
    /// The spawner ledger. Empty ids: the camera, no light with an object.
    pub fn spawner_csv(&self) -> String {
        let mut text = format!(
            "object_id,object,material_id,material,bounce,kind,light_id,light,rays,hits,blocked,{COUNTS}\r\n"
        );
        for row in &self.spawner {
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
                id(row.object),
                field(self.object_name(row.object, "camera")),
                id(row.material),
                field(self.material_name(row.material)),
                row.bounce,
                row.kind.name(),
                id(row.light),
                field(self.object_name(row.light, "")),
                row.rays,
                row.hits,
                row.blocked,
                counts(&row.traversal)
            );
        }
        text
    }

    /// The payer ledger. Empty ids: the scene.
    pub fn payer_csv(&self) -> String {
        let mut text = format!("object_id,object,{COUNTS}\r\n");
        for row in &self.payer {
            let name = field(self.object_name(row.object, "scene"));
            let _ = write!(text, "{},{name},{}\r\n", id(row.object), counts(&row.traversal));
        }
        text
    }

    /// The matrix. Empty ids: the camera, the scene.
    pub fn matrix_csv(&self) -> String {
        let mut text = format!("spawner_id,spawner,payer_id,payer,landed,{COUNTS}\r\n");
        for row in &self.matrix {
            let _ = write!(
                text,
                "{},{},{},{},{},{}\r\n",
                id(row.spawner),
                field(self.object_name(row.spawner, "camera")),
                id(row.payer),
                field(self.object_name(row.payer, "scene")),
                row.landed,
                counts(&row.traversal)
            );
        }
        text
    }
}
