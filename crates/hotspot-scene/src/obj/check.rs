//! The pass before `tobj`: checks every statement, with its line at hand, and states the file again as `tobj` survives it.
//!
//! `tobj` names no line in its errors, lets vertices only be used after their statement once a group ends, keeps one
//! object per run of faces, misplaces texture coordinates and normals where some corners have none, takes a fourth number
//! for a weight, and refuses colours of other than three numbers. The copy has all vertices first, then each group of
//! object and material once, all indices positive, and the same parts at each corner of a group.

use std::collections::HashMap;
use std::fmt::Write;

use super::text::{Statement, Statements};
use crate::budget::Budget;
use crate::error::{Result, invalid, limit};
use crate::notes::Notes;

/// No texture coordinate or no normal at a corner.
pub(super) const NONE: u32 = u32::MAX;

/// Indices of position, texture coordinate and normal; the last two may be [`NONE`].
pub(super) type Corner = [u32; 3];

/// Polygons of one object with one material.
pub(super) struct Group {
    /// Index into [`Parsed::objects`].
    pub(super) object: usize,
    /// Index into [`Parsed::materials`].
    pub(super) material: Option<usize>,
    /// Whether every corner has a normal. Faces without are kept apart, so that they stay flat.
    pub(super) has_normals: bool,
    pub(super) corners: Vec<Corner>,
    /// Corners per polygon, at least three.
    pub(super) arities: Vec<usize>,
}

/// An OBJ file, its indices in range.
#[derive(Default)]
pub(super) struct Parsed {
    /// All `v`, `vt` and `vn` statements; the first `vt` is ours, for corners without one.
    vertices: String,
    /// How many positions, texture coordinates and normals the file states.
    counts: [usize; 3],
    pub(super) objects: Vec<String>,
    /// Names, each with the line that first used it.
    pub(super) materials: Vec<(String, usize)>,
    pub(super) groups: Vec<Group>,
    /// What `mtllib` names, with its line.
    pub(super) libraries: Vec<(String, usize)>,
}

impl Parsed {
    /// The file as `tobj` reads it: one model per group. `textured` says which groups need texture coordinates; what a mesh
    /// does not keep must not split its vertices.
    pub(super) fn restate(&mut self, textured: &[bool], budget: &Budget) -> Result<String> {
        let mut text = std::mem::take(&mut self.vertices);
        let corners: usize = self.groups.iter().map(|group| group.corners.len()).sum();
        // Three indices of ten digits with what parts them.
        budget.charge(corners as u64, 36, "f")?;
        for (group, textured) in self.groups.iter().zip(textured) {
            text.push_str("o x\n");
            let mut corners = group.corners.iter();
            for arity in &group.arities {
                text.push('f');
                for [position, uv, normal] in corners.by_ref().take(*arity) {
                    // Counted from 1, and our own texture coordinate comes first.
                    let uv = if *uv == NONE { 1 } else { u64::from(*uv) + 2 };
                    let (position, normal) = (u64::from(*position) + 1, u64::from(*normal) + 1);
                    // Writing to a string cannot fail.
                    let _ = match (*textured, group.has_normals) {
                        (false, false) => write!(text, " {position}"),
                        (true, false) => write!(text, " {position}/{uv}"),
                        (false, true) => write!(text, " {position}//{normal}"),
                        (true, true) => write!(text, " {position}/{uv}/{normal}"),
                    };
                }
                text.push('\n');
            }
        }
        Ok(text)
    }
}

/// Checks a whole file. `stem` names the object of faces that come before any `o` or `g`.
pub(super) fn check(bytes: &[u8], stem: &str, budget: &Budget, notes: &mut Notes) -> Result<Parsed> {
    // The copy of the vertices, while it grows.
    budget.charge(bytes.len() as u64, 2, "the file as a whole")?;
    let mut parser = Parser {
        out: Parsed { vertices: "vt 0 1\n".into(), ..Parsed::default() },
        budget,
        notes,
        object_name: stem.to_owned(),
        objects: HashMap::new(),
        material: None,
        materials: HashMap::new(),
        groups: HashMap::new(),
        highest: [(0, 0); 3],
        smoothed: None,
        unknown: (0, 0),
    };
    let mut statements = Statements::new(bytes);
    while let Some(statement) = statements.next()? {
        parser.statement(&statement)?;
    }
    parser.finish()
}

struct Parser<'b, 'n> {
    out: Parsed,
    budget: &'b Budget,
    notes: &'n mut Notes,
    object_name: String,
    objects: HashMap<String, usize>,
    material: Option<usize>,
    materials: HashMap<String, usize>,
    groups: HashMap<(usize, Option<usize>, bool), usize>,
    /// Highest index used of each kind, with its line: a face may refer to vertices that follow it.
    highest: [(u32, usize); 3],
    /// Line of the first smoothing group in force at a face without normals.
    smoothed: Option<usize>,
    /// How many statements are not OBJ, and the line of the first.
    unknown: (u64, usize),
}

impl Parser<'_, '_> {
    fn statement(&mut self, statement: &Statement<'_>) -> Result<()> {
        match statement.keyword() {
            "v" => {
                self.vertex::<3>(statement, 0)?;
                if statement.words().count() > 4 {
                    self.notes.unmodelled("vertex colours", "v", "the vertices' colours are left out");
                }
            }
            // One-dimensional textures have no second coordinate.
            "vt" if statement.words().nth(1).is_none() => self.vertex::<1>(statement, 1)?,
            "vt" => self.vertex::<2>(statement, 1)?,
            "vn" => self.vertex::<3>(statement, 2)?,
            "f" | "fo" => self.face(statement)?,
            "o" | "g" => {
                let name = statement.rest();
                self.object_name = if name.is_empty() { "default".into() } else { name.to_owned() };
            }
            "usemtl" => {
                let name = statement.rest();
                let next = self.out.materials.len();
                let index = *self.materials.entry(name.to_owned()).or_insert(next);
                if index == next {
                    self.out.materials.push((name.to_owned(), statement.line));
                }
                self.material = Some(index);
            }
            "mtllib" => self.out.libraries.push((statement.rest().to_owned(), statement.line)),
            "s" => {
                let on = !matches!(statement.words().next(), None | Some("off" | "0"));
                self.smoothed = if on { self.smoothed.or(Some(statement.line)) } else { None };
            }
            "l" => self.notes.unmodelled("lines", "l", "not drawn"),
            "p" => self.notes.unmodelled("points", "p", "not drawn"),
            "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim"
            | "hole" | "scrv" | "sp" | "end" | "con" => {
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

    /// Copies a vertex statement of `N` numbers that count; `kind` as in [`Parsed::counts`].
    fn vertex<const N: usize>(&mut self, statement: &Statement<'_>, kind: usize) -> Result<()> {
        let numbers = statement.numbers::<N>()?;
        self.budget.charge(2, 12, &statement.place())?;
        let text = &mut self.out.vertices;
        text.push_str(statement.keyword());
        statement.words().zip(numbers).for_each(|(word, _)| text.extend([" ", word]));
        text.push_str(if N == 1 { " 0\n" } else { "\n" });
        if let Some(count) = self.out.counts.get_mut(kind) {
            *count += 1;
        }
        Ok(())
    }

    fn face(&mut self, statement: &Statement<'_>) -> Result<()> {
        let mut corners = Vec::new();
        for word in statement.words() {
            corners.push(self.corner(statement, word)?);
        }
        if corners.len() < 3 {
            self.notes.repair("faces with fewer than three corners dropped", "f", 1);
            return Ok(());
        }
        let has_normals = corners.iter().all(|corner| corner[2] != NONE);
        if let (false, Some(line)) = (has_normals, self.smoothed) {
            let place = format!("line {line}");
            self.notes.unmodelled("smoothing groups", &place, "faces without normals are flat");
        }
        // Per face: how many corners, and what `tobj` holds. Per corner: ours, and there a corner, an index, an entry of a
        // hash table and a vertex of 32 bytes; all while their vectors grow.
        self.budget.charge(1, 2 * 112, &statement.place())?;
        self.budget.charge(corners.len() as u64, 2 * 12 + 24 + 2 * 4 + 75 + 2 * 32, &statement.place())?;
        let group = self.group(has_normals);
        if let Some(group) = self.out.groups.get_mut(group) {
            group.arities.push(corners.len());
            group.corners.append(&mut corners);
        }
        Ok(())
    }

    /// The group of the current object and material.
    fn group(&mut self, has_normals: bool) -> usize {
        let object = match self.objects.get(&self.object_name) {
            Some(known) => *known,
            None => {
                self.out.objects.push(self.object_name.clone());
                self.objects.insert(self.object_name.clone(), self.out.objects.len() - 1);
                self.out.objects.len() - 1
            }
        };
        let material = self.material;
        let groups = &mut self.out.groups;
        *self.groups.entry((object, material, has_normals)).or_insert_with(|| {
            groups.push(Group { object, material, has_normals, corners: Vec::new(), arities: Vec::new() });
            groups.len() - 1
        })
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, each counted from 1, or from the end when negative.
    fn corner(&mut self, statement: &Statement<'_>, word: &str) -> Result<Corner> {
        let counts = self.out.counts;
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
        let out = self.out;
        let kinds = ["positions (v)", "texture coordinates (vt)", "normals (vn)"];
        for ((count, kind), (index, line)) in out.counts.into_iter().zip(kinds).zip(self.highest) {
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
        if unknown > 0 && out.counts == [0; 3] {
            return Err(invalid(
                format!("line {line}"),
                "neither this nor any other line makes this an OBJ file",
                "give a .gltf, .glb or .obj file",
            ));
        }
        self.notes.repair("unknown statements skipped", &format!("line {line} and on"), unknown);
        Ok(out)
    }
}
