//! Mesh primitives (glTF 2.0, section 3.7.2) to meshes.

use gltf::Semantic;
use gltf::mesh::Mode;

use super::accessor::{self, Kind};
use super::colors;
use super::deform::{self, Deformation, Vertices};
use super::document::Document;
use super::draco;
use super::tangents::{self, TangentSources};
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
    second_uvs: Option<usize>,
    indices: Option<usize>,
    shape: Shape,
    colors: Option<usize>,
    /// Set where the material has a normal map.
    pub(crate) tangents: Option<TangentSources>,
    /// The buffer view of a compressed primitive.
    pub(crate) draco: Option<u64>,
}

/// How vertices form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Shape {
    List,
    Strip,
    Fan,
}

impl Sources {
    /// Reads which accessors a primitive names; `None` where it draws no triangles (noted). `uv_sets` are what its
    /// material needs.
    pub(crate) fn of(
        primitive: &gltf::Primitive<'_>,
        path: &str,
        uv_sets: [Option<u32>; 2],
        notes: &mut Notes,
    ) -> Option<Self> {
        let shape = match primitive.mode() {
            Mode::Triangles => Shape::List,
            Mode::TriangleStrip => Shape::Strip,
            Mode::TriangleFan => Shape::Fan,
            Mode::Points => {
                notes.unmodelled("points", path, "not drawn");
                return None;
            }
            Mode::Lines | Mode::LineLoop | Mode::LineStrip => {
                notes.unmodelled("lines", path, "not drawn");
                return None;
            }
        };
        let find = |semantic| primitive.get(&semantic).map(|accessor| accessor.index());
        let Some(positions) = find(Semantic::Positions) else {
            notes.repair("primitive without positions dropped", path, 1);
            return None;
        };
        let [uvs, second_uvs] = uv_sets.map(|set| {
            let found = set.and_then(|set| find(Semantic::TexCoords(set)));
            if let (Some(set), None) = (set, found) {
                notes.repair(&format!("no TEXCOORD_{set}: the texture is read at (0, 0)"), path, 1);
            }
            found
        });
        let colors = find(Semantic::Colors(0));
        let indices = primitive.indices().map(|accessor| accessor.index());
        let normals = find(Semantic::Normals);
        Some(Self {
            positions,
            normals,
            uvs,
            second_uvs,
            indices,
            shape,
            colors,
            tangents: None,
            draco: None,
        })
    }

    /// Reads, bends and cleans the mesh; `None` where no triangle is left (noted).
    pub(crate) fn read(
        &self,
        doc: &Document<'_>,
        primitive: &gltf::Primitive<'_>,
        deformation: &Deformation,
        name: String,
        path: &str,
        notes: &mut Notes,
    ) -> Result<Option<Mesh>> {
        let at = |index: Option<usize>| index.and_then(|index| doc.gltf.accessors().nth(index));
        let compressed = match self.draco {
            Some(_) => Some(draco::decode(doc, primitive, path, notes)?),
            None => None,
        };
        let Some(positions) = at(Some(self.positions)) else { return Ok(None) };
        let positions = accessor::vectors::<3>(doc, &positions, Kind::Vector, notes)?;
        let vertices = positions.len();
        let normals = match at(self.normals) {
            Some(accessor) => Some(accessor::vectors::<3>(doc, &accessor, Kind::Vector, notes)?),
            None => None,
        };
        let mut read_uvs = |index| match at(index) {
            Some(accessor) => accessor::vectors::<2>(doc, &accessor, Kind::Uv, notes).map(Some),
            None => Ok(None),
        };
        let (uvs, second_uvs) = (read_uvs(self.uvs)?, read_uvs(self.second_uvs)?);
        let colors = match at(self.colors) {
            Some(accessor) => colors::read(doc, &accessor, path, notes)?,
            None => None,
        };
        let tangents = match at(self.tangents.and_then(|tangents| tangents.accessor)) {
            Some(accessor) => Some(accessor::vectors::<4>(doc, &accessor, Kind::Vector, notes)?),
            None => None,
        };
        let counts = [
            ("NORMAL", normals.as_ref().map(Vec::len)),
            ("TEXCOORD", uvs.as_ref().map(Vec::len)),
            ("TEXCOORD", second_uvs.as_ref().map(Vec::len)),
            ("COLOR_0", colors.as_ref().map(Vec::len)),
            ("TANGENT", tangents.as_ref().map(Vec::len)),
        ];
        for (attribute, count) in counts {
            if count.is_some_and(|count| count != vertices) {
                return Err(crate::error::invalid(
                    format!("{path}.attributes.{attribute}"),
                    format!("there are {} for {vertices} positions", count.unwrap_or(0)),
                    crate::error::REEXPORT,
                ));
            }
        }
        let indices = match (compressed, at(self.indices)) {
            (Some(indices), _) => indices,
            (None, Some(accessor)) => accessor::indices(doc, &accessor, vertices, notes)?,
            (None, None) => {
                doc.budget.charge(vertices as u64, 4, path)?;
                let count = u32::try_from(vertices)
                    .map_err(|_| limit(path, "the primitive has more than 2³² vertices", "split the mesh"))?;
                (0..count).collect()
            }
        };
        if self.draco.is_some() && indices.iter().any(|index| *index as usize >= vertices) {
            let problem =
                format!("there are more vertices in the compressed stream than the {vertices} positions");
            return Err(crate::error::invalid(path, problem, crate::error::REEXPORT));
        }
        doc.budget.charge(indices.len() as u64, 12, path)?;
        // What `clean` holds for a moment: a flag, a sum and an index per vertex.
        doc.budget.charge(vertices as u64, 48, path)?;
        let mut triangles = self.triangles(&indices, path, notes);
        let mut vertices = Vertices { positions, normals, tangents };
        let mirrored = deformation.apply(doc, primitive, path, &mut vertices, notes)?;
        deform::turn_mirrored(&mut triangles, &mirrored);
        let Vertices { positions, normals, tangents } = vertices;
        let mesh = Mesh { name, positions, normals, uvs, second_uvs, triangles, colors, tangents };
        let mut mesh = geometry::clean(mesh, path, notes);
        if mesh.triangles.is_empty() {
            notes.repair("primitive without triangles dropped", path, 1);
            return Ok(None);
        }
        if let Some(sources) = self.tangents {
            tangents::complete(doc, sources, &mut mesh, path, notes)?;
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
