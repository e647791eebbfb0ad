//! OBJ statements to polygons, with indices that are in range; what is wrong is named with its line.
//!
//! `o` names objects. `g` parts the faces of an object (they become objects of their own, named `object/group`), and names
//! the objects where no `o` does: files hold one `o` with many `g` as often as one `g` per `o`, and it is the finer of the two
//! that says where the cost is. Materials do not part objects.

use std::collections::HashMap;

use super::colors::VertexColors;
use super::text::{Mended, Statement, Statements, without_utf16};
use crate::budget::Budget;
use crate::error::{Result, invalid, limit};
use crate::notes::Notes;

/// No texture coordinate or no normal at a corner.
pub(super) const NONE: u32 = u32::MAX;

/// Indices of position, texture coordinate and normal; the last two may be [`NONE`]. Of a [`Shading::Smooth`] polygon, the
/// last is an index into [`Parsed::smooth`].
pub(super) type Corner = [u32; 3];

/// Where a polygon's shading normals come from.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Shading {
    /// It has none.
    Flat,
    /// From `vn`, at every corner.
    Stated,
    /// From the polygons of its smoothing group around each vertex. `vn` comes first where a file has both.
    Smooth,
}

/// Polygons of one object with one material and one kind of shading.
pub(super) struct Group {
    /// Index into [`Parsed::objects`].
    pub(super) object: usize,
    /// Index into [`Parsed::materials`].
    pub(super) material: Option<usize>,
    pub(super) shading: Shading,
    pub(super) corners: Vec<Corner>,
    /// Corners per polygon, at least three.
    pub(super) arities: Vec<u32>,
}

/// An OBJ file, its indices in range.
#[derive(Default)]
pub(super) struct Parsed {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) colors: VertexColors,
    /// How many pairs of vertex and smoothing group share a normal.
    pub(super) smooth: usize,
    pub(super) objects: Vec<String>,
    /// Names, each with the line that first used it.
    pub(super) materials: Vec<(String, usize)>,
    pub(super) groups: Vec<Group>,
    /// What `mtllib` names, with its line.
    pub(super) libraries: Vec<(String, usize)>,
}

impl Parsed {
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }
}

/// Parses a whole file. `stem` names the object of faces that come before any `o` or `g`.
pub(super) fn parse(bytes: &[u8], stem: &str, budget: &Budget, notes: &mut Notes) -> Result<Parsed> {
    let mut parser = Parser {
        out: Parsed::default(),
        budget,
        notes,
        object_name: stem.to_owned(),
        is_named: false,
        group_name: None,
        objects: HashMap::new(),
        object: None,
        material: None,
        materials: HashMap::new(),
        groups: HashMap::new(),
        highest: [(0, 0); 3],
        smoothing: None,
        smooth: HashMap::new(),
        corners: Vec::new(),
        unknown: (0, 0),
    };
    let mended = Mended::default();
    let bytes = without_utf16(bytes, budget)?;
    let mut statements = Statements::new(&bytes, &mended);
    while let Some(statement) = statements.next()? {
        parser.statement(&statement)?;
    }
    mended.note("", parser.notes);
    parser.finish()
}

struct Parser<'b, 'n> {
    out: Parsed,
    budget: &'b Budget,
    notes: &'n mut Notes,
    /// What `o` says, or the stem of the file.
    object_name: String,
    /// Whether an `o` is in force.
    is_named: bool,
    group_name: Option<String>,
    objects: HashMap<String, usize>,
    /// Index of the object in force; `None` after its name has changed.
    object: Option<usize>,
    material: Option<usize>,
    materials: HashMap<String, usize>,
    groups: HashMap<(usize, Option<usize>, Shading), usize>,
    /// Highest index used of each kind, with its line: a face may refer to vertices that follow it.
    highest: [(u32, usize); 3],
    /// The smoothing group in force.
    smoothing: Option<u32>,
    /// The normal of a vertex in a smoothing group.
    smooth: HashMap<(u32, u32), u32>,
    /// Of the face at hand.
    corners: Vec<Corner>,
    /// How many statements are not OBJ, and the line of the first.
    unknown: (u64, usize),
}

impl Parser<'_, '_> {
    fn statement(&mut self, statement: &Statement<'_>) -> Result<()> {
        match statement.keyword() {
            "v" => self.vertex(statement)?,
            "vt" => {
                self.charge(statement, 1, 2 * 8)?;
                // One-dimensional textures have no second coordinate.
                let uv = match statement.words().nth(1) {
                    Some(_) => statement.numbers()?,
                    None => [statement.numbers::<1>()?[0], 0.0],
                };
                self.out.uvs.push(uv);
            }
            "vn" => {
                self.charge(statement, 1, 2 * 12)?;
                self.out.normals.push(statement.numbers()?);
            }
            "f" | "fo" => self.face(statement)?,
            "o" => {
                self.object_name = or_default(statement.rest());
                (self.is_named, self.group_name, self.object) = (true, None, None);
            }
            "g" => {
                self.group_name = Some(or_default(statement.rest()));
                self.object = None;
            }
            "usemtl" => {
                let name = statement.rest();
                let next = self.out.materials.len();
                let index = *self.materials.entry(name.to_owned()).or_insert(next);
                if index == next {
                    // Its names and what may be noted about it; what it states is announced with its library.
                    self.charge(statement, 1, 1024 + 4 * name.len() as u64)?;
                    self.out.materials.push((name.to_owned(), statement.line));
                }
                self.material = Some(index);
            }
            "mtllib" => {
                let name = statement.rest();
                self.charge(statement, 1, 256 + 4 * name.len() as u64)?;
                self.out.libraries.push((name.to_owned(), statement.line));
            }
            "s" => {
                self.smoothing = match statement.words().next() {
                    None | Some("off" | "0") => None,
                    Some(group) => Some(group.parse().unwrap_or(u32::MAX)),
                };
            }
            "l" => self.notes.unmodelled("lines", "l", "not drawn"),
            "p" => self.notes.unmodelled("points", "p", "not drawn"),
            "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim"
            | "hole" | "scrv" | "sp" | "end" | "con" | "bzp" | "bsp" | "cdc" | "cdp" | "res" => {
                self.notes.unmodelled("free-form curves and surfaces", statement.keyword(), "not drawn");
            }
            "mg" | "bevel" | "c_interp" | "d_interp" | "lod" | "maplib" | "usemap" | "shadow_obj"
            | "trace_obj" | "ctech" | "stech" => {}
            _ => {
                if self.unknown.0 == 0 {
                    self.unknown.1 = statement.line;
                }
                self.unknown.0 += 1;
            }
        }
        Ok(())
    }

    /// Announces memory; the place is put into words only where it is needed.
    fn charge(&self, statement: &Statement<'_>, count: u64, size: u64) -> Result<()> {
        match self.budget.charge(count, size, "") {
            Ok(()) => Ok(()),
            Err(_) => self.budget.charge(count, size, &statement.place()),
        }
    }

    /// `v x y z`, `v x y z w`, or `v x y z r g b` with more after it.
    fn vertex(&mut self, statement: &Statement<'_>) -> Result<()> {
        self.charge(statement, 1, 2 * 12)?;
        self.out.positions.push(statement.numbers()?);
        let mut more = statement.words().skip(3);
        match (more.next(), more.next(), more.next()) {
            (None, ..) => {}
            (Some(r), Some(g), Some(b)) => {
                let before = self.out.positions.len() - 1;
                let fresh = if self.out.colors.is_empty() { before + 1 } else { 1 };
                self.charge(statement, fresh as u64, 2 * 12)?;
                let color = [statement.number(r)?, statement.number(g)?, statement.number(b)?];
                self.out.colors.push(color, before);
            }
            (Some(weight), ..) => {
                if !matches!(statement.number(weight)?, 0.0 | 1.0) {
                    let effect = "weights belong to curves and surfaces: positions are taken as they are";
                    self.notes.unmodelled("weights of vertices", "v", effect);
                }
            }
        }
        Ok(())
    }

    fn face(&mut self, statement: &Statement<'_>) -> Result<()> {
        self.corners.clear();
        for word in statement.words() {
            let corner = self.corner(statement, word)?;
            self.corners.push(corner);
        }
        let arity = self.corners.len();
        if arity < 3 {
            self.notes.repair("faces with fewer than three corners dropped", "f", 1);
            return Ok(());
        }
        // While vectors and tables grow; the meshes are announced when they are made.
        self.charge(statement, 1, 2 * 4)?;
        self.charge(statement, arity as u64, 2 * 12)?;
        let shading = if self.corners.iter().all(|corner| corner[2] != NONE) {
            Shading::Stated
        } else if self.smoothing.is_some() {
            // An entry of the table, and later a sum.
            self.charge(statement, arity as u64, 48 + 24 + 12)?;
            Shading::Smooth
        } else {
            Shading::Flat
        };
        if shading != Shading::Stated {
            for corner in &mut self.corners {
                corner[2] = match self.smoothing {
                    None => NONE,
                    Some(smoothing) => {
                        // Fewer than corners, which are fewer than bytes of 36 each in memory.
                        let next = self.smooth.len() as u32;
                        *self.smooth.entry((corner[0], smoothing)).or_insert(next)
                    }
                };
            }
        }
        let group = self.group(statement, shading)?;
        if let Some(group) = self.out.groups.get_mut(group) {
            // A line holds fewer corners than it has bytes.
            group.arities.push(arity as u32);
            group.corners.append(&mut self.corners);
        }
        Ok(())
    }

    /// The group of the current object and material.
    fn group(&mut self, statement: &Statement<'_>, shading: Shading) -> Result<usize> {
        let object = match self.object {
            Some(known) => known,
            None => self.find_object(statement)?,
        };
        let material = self.material;
        let key = (object, material, shading);
        if let Some(known) = self.groups.get(&key) {
            return Ok(*known);
        }
        // The group, its mesh and instance, and what may be noted about them.
        self.charge(statement, 1, 1024)?;
        let groups = &mut self.out.groups;
        groups.push(Group { object, material, shading, corners: Vec::new(), arities: Vec::new() });
        self.groups.insert(key, groups.len() - 1);
        Ok(groups.len() - 1)
    }

    /// The object that `o` and `g` name.
    fn find_object(&mut self, statement: &Statement<'_>) -> Result<usize> {
        let group = self.group_name.as_deref().unwrap_or_default();
        // Announced whether it is new or not: names may be as long as lines, and are copied here.
        let length = self.object_name.len() + group.len();
        self.charge(statement, 1, 2 * length as u64)?;
        let name = match &self.group_name {
            Some(group) if !self.is_named => group.clone(),
            Some(group) if *group != self.object_name => format!("{}/{group}", self.object_name),
            _ => self.object_name.clone(),
        };
        let object = match self.objects.get(&name) {
            Some(known) => *known,
            None => {
                self.charge(statement, 1, 256 + 8 * length as u64)?;
                self.out.objects.push(name.clone());
                self.objects.insert(name, self.out.objects.len() - 1);
                self.out.objects.len() - 1
            }
        };
        self.object = Some(object);
        Ok(object)
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, each counted from 1, or from the end when negative.
    fn corner(&mut self, statement: &Statement<'_>, word: &str) -> Result<Corner> {
        let counts = self.out.counts();
        let mut corner = [NONE; 3];
        let mut parts = word.split('/');
        for ((slot, count), highest) in corner.iter_mut().zip(counts).zip(&mut self.highest) {
            let part = parts.next().unwrap_or_default();
            if part.is_empty() {
                continue;
            }
            let number: i64 =
                part.parse().map_err(|_| statement.wrong(format!("\"{word}\" is not a corner of a face")))?;
            let index = if number > 0 { Some(number - 1) } else { (count as i64).checked_add(number) };
            let index = index
                .filter(|index| number != 0 && *index >= 0)
                .and_then(|index| u32::try_from(index).ok())
                .filter(|index| *index != NONE)
                .ok_or_else(|| statement.wrong(format!("index {number} is out of range")))?;
            *slot = index;
            if index >= highest.0 {
                *highest = (index, statement.line);
            }
        }
        if parts.next().is_some() || corner[0] == NONE {
            return Err(statement.wrong(format!("\"{word}\" is not a corner of a face")));
        }
        Ok(corner)
    }

    fn finish(self) -> Result<Parsed> {
        let mut out = self.out;
        let kinds = ["positions (v)", "texture coordinates (vt)", "normals (vn)"];
        for ((count, kind), (index, line)) in out.counts().into_iter().zip(kinds).zip(self.highest) {
            if count >= NONE as usize {
                return Err(limit("", format!("the file has {count} {kind}"), "split the file"));
            }
            // Line 0: none of this kind is used.
            if line > 0 && index as usize >= count {
                return Err(invalid(
                    format!("line {line}"),
                    format!("index {} is out of range, the file has {count} {kind}", u64::from(index) + 1),
                    "export the file again or repair it",
                ));
            }
        }
        let (unknown, line) = self.unknown;
        if unknown > 0 && out.counts() == [0; 3] {
            return Err(invalid(
                format!("line {line}"),
                "neither this nor any other line makes this an OBJ file",
                "give a .gltf, .glb or .obj file",
            ));
        }
        self.notes.repair("unknown statements skipped", &format!("line {line} and on"), unknown);
        out.smooth = self.smooth.len();
        let vertices = out.positions.len();
        out.colors.finish(vertices, self.notes);
        Ok(out)
    }
}

fn or_default(name: &str) -> String {
    if name.is_empty() { "default".into() } else { name.into() }
}
