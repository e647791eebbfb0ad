//! MTL files to what each material states.
//!
//! Keywords are told apart whatever their case. Numbers are finite and in range afterwards, and what is out of range is
//! noted; what they mean together is decided in `material`.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};

use super::map::{self, Map, finite};
use super::text::{Mended, Statement, Statements, without_utf16};
use crate::LoadError;
use crate::budget::Budget;
use crate::error::Result;
use crate::notes::{Notes, cut};

/// A material as the file states it. Colours are in 0..1 but for `ke`.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    /// The file, as the OBJ names it.
    pub(super) file: PathBuf,
    pub(super) line: usize,
    /// Diffuse reflectance.
    pub(super) kd: Option<[f32; 3]>,
    /// Specular reflectance.
    pub(super) ks: Option<[f32; 3]>,
    /// Emission, at least 0.
    pub(super) ke: Option<[f32; 3]>,
    /// Phong's exponent, at least 0.
    pub(super) ns: Option<f32>,
    /// Index of refraction, above 0.
    pub(super) ni: Option<f32>,
    /// Transmission filter.
    pub(super) tf: Option<[f32; 3]>,
    /// Opacity, 0..1.
    pub(super) d: Option<f32>,
    /// Transparency, 0..1: 1 − d.
    pub(super) tr: Option<f32>,
    /// Illumination model.
    pub(super) illum: Option<u8>,
    /// Roughness, 0..1.
    pub(super) pr: Option<f32>,
    /// Metallic, 0..1.
    pub(super) pm: Option<f32>,
    pub(super) map_kd: Option<Map>,
    pub(super) map_ks: Option<Map>,
    pub(super) map_ke: Option<Map>,
    pub(super) map_d: Option<Map>,
    pub(super) map_pr: Option<Map>,
    pub(super) map_pm: Option<Map>,
    /// Keywords of what is not modelled, with line and effect.
    pub(super) unmodelled: Vec<(String, usize, &'static str)>,
}

/// Parses a library. The first definition of a name counts.
pub(super) fn parse(
    bytes: &[u8],
    file: &Path,
    out: &mut HashMap<String, Mtl>,
    budget: &Budget,
    notes: &mut Notes,
) -> Result<()> {
    let mended = Mended::default();
    let bytes = without_utf16(bytes, budget)?;
    let mut statements = Statements::new(&bytes, &mended);
    let mut found: Vec<(String, Mtl)> = Vec::new();
    while let Some(statement) = statements.next()? {
        if statement.keyword().eq_ignore_ascii_case("newmtl") {
            let mtl = Mtl { file: file.into(), line: statement.line, ..Mtl::default() };
            found.push((statement.rest().to_owned(), mtl));
        } else if let Some((_, mtl)) = found.last_mut() {
            // A broken value leaves the default, as in the programs that write them.
            match mtl.statement(&statement, notes) {
                Err(LoadError::Invalid { problem, .. }) => {
                    let element = format!("{} line {}", file.display(), statement.line);
                    notes.repair(&format!("{} ignored: {problem}", cut(statement.keyword())), &element, 1);
                }
                done => done?,
            }
        } else {
            let element = format!("{} line {}", file.display(), statement.line);
            notes.repair("statement before the first newmtl ignored", &element, 1);
        }
    }
    mended.note(&file.to_string_lossy(), notes);
    for (name, mtl) in found {
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
    fn statement(&mut self, statement: &Statement<'_>, notes: &mut Notes) -> Result<()> {
        let keyword = statement.keyword().to_ascii_lowercase();
        match keyword.as_str() {
            "kd" => self.kd = self.color(statement, 1.0, notes)?.or(self.kd),
            "ks" => self.ks = self.color(statement, 1.0, notes)?.or(self.ks),
            "ke" => self.ke = self.color(statement, f32::MAX, notes)?.or(self.ke),
            "tf" => self.tf = self.color(statement, 1.0, notes)?.or(self.tf),
            "ns" => self.ns = Some(self.number(statement, f32::MAX, notes)?),
            "ni" => {
                let stated = self.number(statement, f32::MAX, notes)?;
                // Programs that know no index write 0.
                self.ni = Some(stated).filter(|ni| *ni > 0.0);
            }
            "d" => {
                let halo = statement.words().next() == Some("-halo");
                let word = statement.words().nth(usize::from(halo)).unwrap_or_default();
                let value = finite(statement, word)?;
                self.d = Some(self.within(statement, value, 1.0, notes));
            }
            "tr" => self.tr = Some(self.number(statement, 1.0, notes)?),
            // Truncated: some programs write `2.0`.
            "illum" => self.illum = Some(self.number(statement, 255.0, notes)? as u8),
            "pr" => self.pr = Some(self.number(statement, 1.0, notes)?),
            "pm" => self.pm = Some(self.number(statement, 1.0, notes)?),
            "map_kd" => self.map_kd = self.map(statement, notes)?,
            "map_ks" => self.map_ks = self.map(statement, notes)?,
            "map_ke" => self.map_ke = self.map(statement, notes)?,
            "map_d" | "map_opacity" => self.map_d = self.map(statement, notes)?,
            "map_pr" => self.map_pr = self.map(statement, notes)?,
            "map_pm" => self.map_pm = self.map(statement, notes)?,
            // The ambient colour stands for light that path tracing computes.
            "ka" | "map_ka" | "sharpness" | "map_aat" => {}
            // These shape the coat and the highlights that the keywords below ask for.
            "pcr" | "anisor" => {}
            "ps" => self.unless_zero(statement, "no sheen is added"),
            "pc" => self.unless_zero(statement, "no coat is added"),
            "aniso" => self.unless_zero(statement, "the highlights are isotropic"),
            "norm" | "map_norm" | "map_kn" | "bump" | "map_bump" | "disp" | "map_disp" => {
                self.ignore(statement, "the surface is drawn without bumps");
            }
            "map_ns" => self.ignore(statement, "the highlights have the same width everywhere"),
            "refl" | "map_refl" => self.ignore(statement, "reflections show the scene"),
            _ => self.ignore(statement, "ignored"),
        }
        Ok(())
    }

    fn ignore(&mut self, statement: &Statement<'_>, effect: &'static str) {
        self.unmodelled.push((statement.keyword().into(), statement.line, effect));
    }

    /// Programs write these for every material; 0 asks for nothing.
    fn unless_zero(&mut self, statement: &Statement<'_>, effect: &'static str) {
        let asked = statement.words().any(|word| !matches!(statement.number(word), Ok(0.0)));
        if asked {
            self.ignore(statement, effect);
        }
    }

    /// `r g b`, or `r` for all three; in 0..`most`. `None` where the statement is not in RGB.
    fn color(&mut self, statement: &Statement<'_>, most: f32, notes: &mut Notes) -> Result<Option<[f32; 3]>> {
        if let Some(kind @ ("spectral" | "xyz")) = statement.words().next() {
            let keyword = format!("{} {kind}", statement.keyword());
            self.unmodelled.push((keyword, statement.line, "ignored: only RGB is read"));
            return Ok(None);
        }
        let mut color = [finite(statement, statement.words().next().unwrap_or_default())?; 3];
        for (channel, word) in color.iter_mut().zip(statement.words()) {
            *channel = finite(statement, word)?;
        }
        Ok(Some(color.map(|c| self.within(statement, c, most, notes))))
    }

    fn number(&self, statement: &Statement<'_>, most: f32, notes: &mut Notes) -> Result<f32> {
        let number = finite(statement, statement.words().next().unwrap_or_default())?;
        Ok(self.within(statement, number, most, notes))
    }

    /// Clamps to 0..`most`, and notes it.
    fn within(&self, statement: &Statement<'_>, value: f32, most: f32, notes: &mut Notes) -> f32 {
        let clamped = value.clamp(0.0, most);
        if clamped != value {
            let element = format!("{} line {}", self.file.display(), statement.line);
            notes.repair("value clamped to its range", &element, 1);
        }
        clamped
    }

    /// A texture statement; some programs write the keyword alone where there is no texture.
    fn map(&mut self, statement: &Statement<'_>, notes: &mut Notes) -> Result<Option<Map>> {
        if statement.rest().is_empty() {
            let element = format!("{} line {}", self.file.display(), statement.line);
            notes.repair("texture statement without a name ignored", &element, 1);
            return Ok(None);
        }
        let mut map = map::read(statement)?;
        for option in map.unmodelled.drain(..) {
            let keyword = format!("{} {option}", statement.keyword());
            self.unmodelled.push((keyword, statement.line, "the texture is shown without"));
        }
        Ok(Some(map))
    }
}
