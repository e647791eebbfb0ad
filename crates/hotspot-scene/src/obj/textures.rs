//! The pictures that MTL files name, each file once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use image::ImageFormat;

use super::locate::{Found, locate};
use super::map::Map;
use crate::LoadError;
use crate::budget::Budget;
use crate::error::Result;
use crate::files::{self, Folder};
use crate::images::Images;
use crate::left_out;
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::scene::TextureRef;

/// Reads textures under limits.
pub(super) struct Textures<'a> {
    pub(super) images: Images<'a>,
    folder: &'a Folder,
    options: &'a LoadOptions,
    pub(super) budget: &'a Budget,
    /// `None` for pictures that are not read.
    by_path: HashMap<PathBuf, Option<u32>>,
    /// Names that led to no file, by the folder of the file that states them; with the reason where there is one.
    missing: HashMap<PathBuf, HashMap<String, Option<&'static str>>>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(folder: &'a Folder, options: &'a LoadOptions, budget: &'a Budget) -> Self {
        Self {
            images: Images::new(options),
            folder,
            options,
            budget,
            by_path: HashMap::new(),
            missing: HashMap::new(),
        }
    }

    /// As [`locate`]; what is missing is looked for once, since that goes through folders.
    fn find(&mut self, file: &Path, name: &str) -> Found {
        let beside = file.parent().unwrap_or(Path::new(""));
        match self.missing.get(beside).and_then(|names| names.get(name)) {
            Some(Some(reason)) => return Found::Outside(reason),
            Some(None) => return Found::Nowhere,
            None => {}
        }
        let found = locate(self.folder, file, name);
        let reason = match &found {
            Found::Nowhere => None,
            Found::Outside(reason) => Some(*reason),
            Found::AsNamed(_) | Found::Elsewhere(_) => return found,
        };
        self.missing.entry(beside.to_owned()).or_default().insert(name.to_owned(), reason);
        found
    }

    /// The texture of a statement in `file`; `None` where it cannot be read (noted).
    pub(super) fn read(
        &mut self,
        map: Option<&Map>,
        file: &Path,
        notes: &mut Notes,
    ) -> Result<Option<TextureRef>> {
        let Some(map) = map else { return Ok(None) };
        let element = format!("{} line {}", file.display(), map.line);
        let shown = format!("{element}: {}", map.name);
        let found = match self.find(file, &map.name) {
            Found::AsNamed(path) => path,
            Found::Elsewhere(path) => {
                notes.repair("texture found by its name alone", &shown, 1);
                path
            }
            Found::Nowhere => {
                notes.repair("missing texture left out", &shown, 1);
                return Ok(None);
            }
            Found::Outside(reason) => {
                notes.repair(&format!("texture left out: {reason}"), &shown, 1);
                return Ok(None);
            }
        };
        let texture = match self.by_path.get(&found) {
            Some(known) => *known,
            None => {
                let is_tga = found.extension().is_some_and(|e| e.eq_ignore_ascii_case("tga"));
                // TGA begins without a mark.
                let unmarked = is_tga.then_some(ImageFormat::Tga);
                let bytes = files::read(&found, self.options.max_file_bytes, self.budget, &element);
                let read = bytes
                    .and_then(|bytes| self.images.add(bytes, unmarked, &map.name, &element, self.budget));
                let read = match read {
                    Ok(index) => Some(index),
                    Err(error @ LoadError::Limit { .. }) => return Err(error),
                    Err(error) => {
                        left_out::note(&error, notes);
                        None
                    }
                };
                self.by_path.insert(found, read);
                read
            }
        };
        Ok(texture.map(|texture| TextureRef {
            texture,
            wrap: [map.wrap; 2],
            nearest: false,
            transform: map.transform,
            second_uvs: false,
        }))
    }
}
