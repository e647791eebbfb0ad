//! Mesh primitives (glTF 2.0, section 3.7.2) to meshes.

use super::accessor::{self, Kind};
use super::document::Document;
use super::json::Element;
use crate::error::{Result, limit};
use crate::geometry;
use crate::notes::Notes;
use crate::scene::Mesh;

/// What a primitive draws with. Primitives that agree in this share one mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Sources {
    positions: usize,
    normals: Option<usize>,
    uvs: Option<usize>,
    indices: Option<usize>,
    shape: Shape,
}

/// How vertices form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Shape {
    List,
    Strip,
    Fan,
}

impl Sources {
    /// Reads which accessors a primitive names; `None` where it draws no triangles (noted). `uv_set` is what its material
    /// needs.
    pub(crate) fn of(
        doc: &Document<'_>,
        primitive: &Element<'_>,
        uv_set: Option<u64>,
        notes: &mut Notes,
    ) -> Result<Option<Self>> {
        let shape = match primitive.integer("mode")? {
            None | Some(4) => Shape::List,
            Some(5) => Shape::Strip,
            Some(6) => Shape::Fan,
            Some(0) => {
                notes.unmodelled("points", &primitive.path, "not drawn");
                return Ok(None);
            }
            Some(1..=3) => {
                notes.unmodelled("lines", &primitive.path, "not drawn");
                return Ok(None);
            }
            Some(other) => return Err(primitive.wrong("mode", format!("{other} is not a mode"))),
        };
        let Some(attributes) = primitive.object("attributes")? else {
            return Err(primitive.wrong("attributes", "this is missing"));
        };
        let accessors = doc.count("accessors")?;
        let find = |key: &str| attributes.index(key, accessors, "accessors");
        let Some(positions) = find("POSITION")? else {
            notes.repair("primitive without positions dropped", &primitive.path, 1);
            return Ok(None);
        };
        let uvs = match uv_set {
            Some(set) => find(&format!("TEXCOORD_{set}"))?,
            None => None,
        };
        if let (Some(set), None) = (uv_set, uvs) {
            notes.repair(&format!("no TEXCOORD_{set}: the texture is read at (0, 0)"), &primitive.path, 1);
        }
        if attributes.get("COLOR_0").is_some() {
            notes.unmodelled("COLOR_0", &primitive.path, "the vertices' colours are left out");
        }
        if !primitive.array("targets")?.is_empty() {
            notes.unmodelled("morph targets", &primitive.path, "the base shape is drawn");
        }
        Ok(Some(Self {
            positions,
            normals: find("NORMAL")?,
            uvs,
            indices: primitive.index("indices", accessors, "accessors")?,
            shape,
        }))
    }

    /// Reads and cleans the mesh; `None` where no triangle is left (noted).
    pub(crate) fn read(
        &self,
        doc: &Document<'_>,
        name: String,
        path: &str,
        notes: &mut Notes,
    ) -> Result<Option<Mesh>> {
        let positions = accessor::vectors::<3>(doc, self.positions, Kind::Vector, notes)?;
        let vertices = positions.len();
        let normals = match self.normals {
            Some(index) => Some(accessor::vectors::<3>(doc, index, Kind::Vector, notes)?),
            None => None,
        };
        let uvs = match self.uvs {
            Some(index) => Some(accessor::vectors::<2>(doc, index, Kind::Uv, notes)?),
            None => None,
        };
        let counts = [("NORMAL", normals.as_ref().map(Vec::len)), ("TEXCOORD", uvs.as_ref().map(Vec::len))];
        for (attribute, count) in counts {
            if count.is_some_and(|count| count != vertices) {
                return Err(crate::error::invalid(
                    format!("{path}.attributes.{attribute}"),
                    format!("there are {} for {vertices} positions", count.unwrap_or(0)),
                    crate::error::REEXPORT,
                ));
            }
        }
        let indices = match self.indices {
            Some(index) => accessor::indices(doc, index, vertices, notes)?,
            None => {
                doc.budget.charge(vertices as u64, 4, path)?;
                let count = u32::try_from(vertices)
                    .map_err(|_| limit(path, "the primitive has more than 2³² vertices", "split the mesh"))?;
                (0..count).collect()
            }
        };
        doc.budget.charge(indices.len() as u64, 12, path)?;
        // What `clean` holds for a moment: a flag, a sum and an index per vertex.
        doc.budget.charge(vertices as u64, 48, path)?;
        let triangles = self.triangles(&indices, path, notes);
        let mesh = Mesh { name, positions, normals, uvs, triangles };
        let mesh = geometry::clean(mesh, path, notes);
        if mesh.triangles.is_empty() {
            notes.repair("primitive without triangles dropped", path, 1);
            return Ok(None);
        }
        Ok(Some(mesh))
    }

    fn triangles(&self, indices: &[u32], path: &str, notes: &mut Notes) -> Vec<[u32; 3]> {
        match self.shape {
            Shape::List => {
                let (triangles, rest) = indices.as_chunks::<3>();
                notes.repair("incomplete triangle dropped", path, u64::from(!rest.is_empty()));
                triangles.to_vec()
            }
            // Every other triangle of a strip is turned round, so that all face the same way.
            Shape::Strip => indices
                .windows(3)
                .filter_map(|three| <[u32; 3]>::try_from(three).ok())
                .enumerate()
                .map(|(i, [a, b, c])| if i % 2 == 0 { [a, b, c] } else { [a, c, b] })
                .collect(),
            Shape::Fan => match indices.split_first() {
                Some((first, rest)) => {
                    rest.windows(2).filter_map(|pair| Some([*pair.first()?, *pair.last()?, *first])).collect()
                }
                None => Vec::new(),
            },
        }
    }
}
