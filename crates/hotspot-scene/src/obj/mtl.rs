//! MTL files to materials.
//!
//! Kd and Ks become matte or substrate, illumination models 3 and 5 a mirror, Ns a GGX roughness with
//! alpha = roughness² = sqrt(2 / (Ns + 2)), Ke emitted radiance from both sides (OBJ does not say which is the front).
//!
//! `tobj` parses a copy in which every number is finite and in range, and every colour has its three numbers: it panics on
//! fewer. Texture statements with their options are read here.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use super::text::{Statement, Statements};
use crate::error::Result;
use crate::notes::Notes;
use crate::scene::Wrap;

/// A material as the file states it.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    /// The file, as the OBJ names it.
    pub(super) file: PathBuf,
    pub(super) line: usize,
    /// Colours and numbers, all of them finite and in range.
    pub(super) stated: tobj::Material,
    pub(super) map_kd: Option<Map>,
    pub(super) map_ke: Option<Map>,
    pub(super) map_d: Option<Map>,
    /// Keywords of what is not modelled, with line and effect.
    pub(super) unmodelled: Vec<(String, usize, &'static str)>,
}

/// A texture statement.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) wrap: Wrap,
    /// Of the flipped coordinates, as [`crate::TextureRef::transform`].
    pub(super) transform: [[f32; 3]; 2],
}

/// Parses a library. The first definition of a name counts.
pub(super) fn parse(
    bytes: &[u8],
    file: &Path,
    out: &mut HashMap<String, Mtl>,
    notes: &mut Notes,
) -> Result<()> {
    let mut statements = Statements::new(bytes);
    let mut found: Vec<(String, Mtl)> = Vec::new();
    let mut text = String::new();
    while let Some(statement) = statements.next()? {
        if statement.keyword() == "newmtl" {
            let mtl = Mtl { file: file.into(), line: statement.line, ..Mtl::default() };
            found.push((statement.rest().to_owned(), mtl));
            text.push_str("newmtl x\n");
        } else if let Some((_, mtl)) = found.last_mut() {
            mtl.statement(&statement, &mut text, notes)?;
        } else {
            let element = format!("{} line {}", file.display(), statement.line);
            notes.repair("statement before the first newmtl ignored", &element, 1);
        }
    }
    let (stated, _) = tobj::load_mtl_buf(&mut text.as_bytes()).map_err(super::refused)?;
    for ((name, mut mtl), stated) in found.into_iter().zip(stated) {
        mtl.stated = stated;
        match out.entry(name) {
            Entry::Vacant(free) => {
                free.insert(mtl);
            }
            Entry::Occupied(_) => {
                let element = format!("{} line {}", mtl.file.display(), mtl.line);
                notes.repair("second definition of a material ignored", &element, 1);
            }
        }
    }
    Ok(())
}

impl Mtl {
    /// Reads a statement, or copies it for `tobj`.
    fn statement(&mut self, statement: &Statement<'_>, text: &mut String, notes: &mut Notes) -> Result<()> {
        let mut ignore = |effect| self.unmodelled.push((statement.keyword().into(), statement.line, effect));
        let mut state = |keyword: &str, number: f32| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{keyword} {number}");
        };
        match statement.keyword() {
            "Kd" | "Ks" => self.color(statement, 1.0, text, notes)?,
            "Ke" => self.color(statement, f32::MAX, text, notes)?,
            "Ns" => state("Ns", self.within(statement, finite(statement)?, f32::MAX, notes)),
            "d" => {
                let halo = statement.words().next() == Some("-halo");
                let word = statement.words().nth(usize::from(halo)).unwrap_or_default();
                let value = number(statement, word)?;
                state("d", self.within(statement, value, 1.0, notes));
            }
            "Tr" => state("d", 1.0 - self.within(statement, finite(statement)?, 1.0, notes)),
            "illum" => {
                let model = finite(statement)?;
                let known = model.clamp(0.0, 100.0).trunc();
                state("illum", known);
                if [4.0, 6.0, 7.0, 9.0].contains(&known) {
                    self.unmodelled.push((
                        format!("illum {model}"),
                        statement.line,
                        "the surface is opaque, not glass",
                    ));
                }
            }
            "map_Kd" => self.map_kd = Some(map(statement)?),
            "map_Ke" => self.map_ke = Some(map(statement)?),
            "map_d" | "map_opacity" => self.map_d = Some(map(statement)?),
            // The ambient colour stands for light that path tracing computes; Ni acts on glass alone.
            "Ka" | "map_Ka" | "Ni" | "sharpness" | "map_aat" => {}
            "Tf" => {
                if statement.words().any(|word| !matches!(word.parse::<f32>(), Ok(1.0))) {
                    ignore("no light passes through");
                }
            }
            "bump" | "map_bump" | "map_Bump" | "norm" | "disp" => {
                ignore("the surface is drawn without bumps");
            }
            "map_Ks" | "map_Ns" | "refl" => ignore("the highlights are the same everywhere"),
            _ => ignore("ignored"),
        }
        Ok(())
    }

    /// Copies `r g b`, or `r` for all three; in 0..`most`.
    fn color(
        &mut self,
        statement: &Statement<'_>,
        most: f32,
        text: &mut String,
        notes: &mut Notes,
    ) -> Result<()> {
        let keyword = statement.keyword();
        if let Some(kind @ ("spectral" | "xyz")) = statement.words().next() {
            let keyword = format!("{keyword} {kind}");
            self.unmodelled.push((keyword, statement.line, "ignored: only RGB is read"));
            return Ok(());
        }
        let mut color = [finite(statement)?; 3];
        for (channel, word) in color.iter_mut().zip(statement.words()) {
            *channel = number(statement, word)?;
        }
        let [r, g, b] = color.map(|c| self.within(statement, c, most, notes));
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{keyword} {r} {g} {b}");
        Ok(())
    }

    /// Clamps to 0..`most`, and notes it.
    fn within(&self, statement: &Statement<'_>, value: f32, most: f32, notes: &mut Notes) -> f32 {
        let clamped = value.clamp(0.0, most);
        let element = format!("{} line {}", self.file.display(), statement.line);
        notes.repair("value clamped to its range", &element, u64::from(clamped != value));
        clamped
    }
}

/// A word as a finite number.
fn number(statement: &Statement<'_>, word: &str) -> Result<f32> {
    let number = statement.number(word)?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(statement.wrong(format!("{word} is not a finite number")))
    }
}

/// The first word after the keyword as a finite number.
fn finite(statement: &Statement<'_>) -> Result<f32> {
    number(statement, statement.words().next().unwrap_or_default())
}

/// Options and name of a texture statement. The name is the rest after the options, and may hold spaces.
fn map(statement: &Statement<'_>) -> Result<Map> {
    let mut wrap = Wrap::Repeat;
    let (mut offset, mut scale) = ([0.0f32; 2], [1.0f32; 2]);
    let mut words = statement.words().peekable();
    while let Some(option) = words.next_if(|word| word.starts_with('-')) {
        match option {
            "-o" | "-s" | "-t" => {
                // One to three numbers.
                let mut values = [None; 3];
                for value in &mut values {
                    if let Some(word) = words.next_if(|word| word.parse::<f32>().is_ok()) {
                        *value = Some(number(statement, word)?);
                    }
                }
                let target = match option {
                    "-o" => &mut offset,
                    "-s" => &mut scale,
                    // Turbulence.
                    _ => continue,
                };
                for (target, value) in target.iter_mut().zip(values) {
                    *target = value.unwrap_or(*target);
                }
            }
            "-clamp" => {
                if words.next() == Some("on") {
                    wrap = Wrap::Clamp;
                }
            }
            "-mm" => {
                words.next();
                words.next();
            }
            _ => {
                words.next();
            }
        }
    }
    let name = words.collect::<Vec<_>>().join(" ");
    if name.is_empty() {
        return Err(statement.wrong("no file is named here"));
    }
    // v' = s v + o, with v counted from the lower edge: 1 - v' = s (1 - v) + (1 - s - o).
    let transform = [[scale[0], 0.0, offset[0]], [0.0, scale[1], 1.0 - scale[1] - offset[1]]];
    if !transform.iter().flatten().all(|n| n.is_finite()) {
        return Err(statement.wrong("a number is too large"));
    }
    Ok(Map { name, line: statement.line, wrap, transform })
}
