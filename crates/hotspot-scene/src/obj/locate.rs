//! Where the files are that OBJ and MTL files name.
//!
//! Such files name others as they lay on the machine that wrote them: relative to the MTL file or to the OBJ file, in
//! another folder, with a drive letter, in another case. Nothing outside the folder of the OBJ file is ever read.

use std::path::{Path, PathBuf};

use crate::files::{Folder, Refusal};

/// Files of a folder that are looked through for a name in another case.
const MAX_ENTRIES: usize = 10_000;

/// Where a file is.
pub(super) enum Found {
    /// Where its name says.
    AsNamed(PathBuf),
    /// Beside the MTL file or the OBJ file, under the last part of its name, perhaps in another case.
    Elsewhere(PathBuf),
    /// There is none.
    Nowhere,
    /// Its name leads out of the folder, and there is none of its last part inside; with the reason.
    Outside(&'static str),
}

/// The file that `file` (empty for the OBJ file itself) names.
pub(super) fn locate(folder: &Folder, file: &Path, name: &str) -> Found {
    let name = name.replace('\\', "/");
    let beside = file.parent().and_then(Path::to_str).unwrap_or_default();
    let mut outside = None;
    let mut tries = vec![name.clone()];
    // What is absolute must not become relative by putting a folder before it.
    if !beside.is_empty() && !name.starts_with('/') {
        tries.insert(0, format!("{beside}/{name}"));
    }
    for name in &tries {
        match folder.find(name) {
            Ok(path) => return Found::AsNamed(path),
            Err(Refusal::Outside(reason)) => outside = Some(reason),
            Err(Refusal::Missing(_)) => {}
        }
    }
    let last = name.rsplit('/').next().unwrap_or_default();
    if matches!(last, "" | "." | "..") {
        return outside.map_or(Found::Nowhere, Found::Outside);
    }
    for place in [beside, "."] {
        let place = if place.is_empty() { "." } else { place };
        if let Some(path) = in_folder(folder, place, last) {
            return Found::Elsewhere(path);
        }
    }
    outside.map_or(Found::Nowhere, Found::Outside)
}

/// The file called `last` in a folder, in any case; the first by name where there are several.
fn in_folder(folder: &Folder, place: &str, last: &str) -> Option<PathBuf> {
    if let Ok(path) = folder.find(&format!("{place}/{last}")) {
        return Some(path);
    }
    let wanted = last.to_lowercase();
    let entries = std::fs::read_dir(folder.find(place).ok()?).ok()?.take(MAX_ENTRIES);
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let found = names.filter(|name| name.to_lowercase() == wanted).min()?;
    // Found again by the folder's rules: a link may lead out.
    folder.find(&format!("{place}/{found}")).ok()
}
