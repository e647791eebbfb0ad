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
}

impl<'a> Textures<'a> {
    pub(super) fn new(folder: &'a Folder, options: &'a LoadOptions, budget: &'a Budget) -> Self {
        Self { images: Images::new(options), folder, options, budget, by_path: HashMap::new() }
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
        let found = match locate(self.folder, file, &map.name) {
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
