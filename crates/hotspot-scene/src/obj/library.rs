//! The material libraries that `mtllib` names, and the materials that `usemtl` takes from them.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::locate::{Found, locate};
use super::material;
use super::mtl::{self, Mtl};
use super::parse::Parsed;
use super::textures::Textures;
use crate::budget::Budget;
use crate::error::Result;
use crate::files::{self, Folder};
use crate::notes::{Notes, cut};
use crate::options::LoadOptions;
use crate::scene::{Bsdf, Color, Material};

/// Materials by name.
pub(super) struct Library {
    materials: HashMap<String, Mtl>,
}

impl Library {
    /// Reads all files that the `mtllib` statements lead to.
    pub(super) fn read(
        parsed: &Parsed,
        folder: &Folder,
        options: &LoadOptions,
        budget: &Budget,
        notes: &mut Notes,
    ) -> Result<Self> {
        let mut materials = HashMap::new();
        let mut seen = HashSet::new();
        // Statements and names that were looked for already.
        let (mut statements, mut looked_for) = (HashSet::new(), HashSet::new());
        for (names, line) in &parsed.libraries {
            // Exporters repeat the statement for every object.
            if !statements.insert(names.as_str()) {
                continue;
            }
            let element = format!("line {line}");
            // One name with spaces, or several names.
            let whole =
                !names.is_empty() && matches!(find(folder, names), Found::AsNamed(_) | Found::Elsewhere(_));
            let several = if whole {
                vec![names.as_str()]
            } else {
                names.split_ascii_whitespace().take_while(|name| !name.starts_with('#')).collect()
            };
            for name in several {
                if !looked_for.insert(name) {
                    continue;
                }
                let shown = format!("{element}: {name}");
                let path = match find(folder, name) {
                    Found::AsNamed(path) => path,
                    Found::Elsewhere(path) => {
                        notes.repair("material library found by its name alone", &shown, 1);
                        path
                    }
                    Found::Nowhere => {
                        notes.repair("missing material library left out", &shown, 1);
                        continue;
                    }
                    Found::Outside(reason) => {
                        notes.repair(&format!("material library left out: {reason}"), &shown, 1);
                        continue;
                    }
                };
                // Other names of the same file.
                if !seen.insert(path.clone()) {
                    continue;
                }
                let bytes = files::read(&path, options.max_file_bytes, budget, &element)?;
                // A material takes about two thousand bytes, twice for a moment, for some ten bytes of text.
                budget.charge(bytes.len() as u64, 512, &element)?;
                let name = name.replace('\\', "/");
                mtl::parse(&bytes, Path::new(&name), &mut materials, budget, notes)
                    .map_err(|error| error.in_file(Path::new(&name)))?;
            }
        }
        Ok(Self { materials })
    }

    /// The material at `index` of [`Parsed::materials`], or grey matte; white where there are vertex colours to show.
    pub(super) fn material(
        &self,
        parsed: &Parsed,
        index: Option<usize>,
        textures: &mut Textures<'_>,
        notes: &mut Notes,
    ) -> Result<Material> {
        let plain = |name: &str| {
            let mut material = Material::default_matte(cut(name));
            if !parsed.colors.is_empty() {
                material.bsdf = Bsdf::Matte { reflectance: Color::constant([1.0; 3]) };
            }
            material
        };
        let Some((name, line)) = index.and_then(|index| parsed.materials.get(index)) else {
            notes.repair("no material: grey matte used", "faces before any usemtl", 1);
            return Ok(plain("default"));
        };
        // A name may hold `#`, or a comment may follow it.
        let stem = name.split_once(" #").map_or(name.as_str(), |(stem, _)| stem.trim_end());
        match self.materials.get(name).or_else(|| self.materials.get(stem)) {
            Some(mtl) => material::build(cut(name).to_owned(), mtl, textures, notes)
                .map_err(|error| error.in_file(&mtl.file)),
            None => {
                let element = format!("line {line}: usemtl {name}");
                notes.repair("material not found: grey matte used", &element, 1);
                Ok(plain(name))
            }
        }
    }
}

fn find(folder: &Folder, name: &str) -> Found {
    locate(folder, Path::new(""), name)
}
