//! Reading files that other files name: regular files only, under a size limit, inside one folder.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use crate::budget::{Budget, readable, room_for};
use crate::error::{Result, invalid, io, limit};

/// Reads a regular file of at most `max_bytes`. `element` is where the file is named, or empty.
pub(crate) fn read(path: &Path, max_bytes: u64, budget: &Budget, element: &str) -> Result<Vec<u8>> {
    let shown = path.display();
    let failed = |source: io::Error| {
        let remedy = match source.kind() {
            io::ErrorKind::NotFound => "check the name, or put the file there",
            io::ErrorKind::PermissionDenied => "make the file readable",
            _ => "check the file",
        };
        io(element, format!("cannot read \"{shown}\""), remedy, source)
    };
    // Asked before opening: opening a named pipe would wait for a writer for ever.
    let metadata = fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() {
        return Err(invalid(
            element,
            format!("\"{shown}\" is not a regular file"),
            "name a file, not a folder, device or pipe",
        ));
    }
    let too_large = |size: u64| {
        limit(
            element,
            format!(
                "\"{shown}\" has {} or more, the limit for one file is {}",
                readable(size),
                readable(max_bytes)
            ),
            "raise the file size limit or split the file",
        )
    };
    let size = metadata.len();
    if size > max_bytes {
        return Err(too_large(size));
    }
    budget.charge(size, 1, element)?;
    let mut bytes = room_for(usize::try_from(size).map_err(|_| too_large(size))?, element)?;
    // The size is checked again while reading: the file may grow, and special files report none.
    let cap = max_bytes.min(size.saturating_add(budget.left()));
    File::open(path)
        .and_then(|file| file.take(cap.saturating_add(1)).read_to_end(&mut bytes))
        .map_err(failed)?;
    let length = bytes.len() as u64;
    if length > cap {
        return Err(too_large(length));
    }
    budget.charge(length.saturating_sub(size), 1, element)?;
    Ok(bytes)
}

/// The folder of an asset; nothing outside it is ever read.
pub(crate) struct Folder {
    root: PathBuf,
}

/// Why a name does not lead to a file of the folder.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// The name is refused whatever is there; with the reason.
    Outside(&'static str),
    /// There is no such file.
    Missing(io::Error),
}

impl Folder {
    /// The folder that holds `file`.
    pub(crate) fn of(file: &Path) -> Result<Self> {
        let parent = match file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let root = fs::canonicalize(parent).map_err(|source| {
            io(
                "",
                format!("cannot open the folder \"{}\"", parent.display()),
                "check the name of the file",
                source,
            )
        })?;
        Ok(Self { root })
    }

    /// The file that `name` (decoded, with `/` or `\` between its parts) leads to.
    pub(crate) fn find(&self, name: &str) -> std::result::Result<PathBuf, Refusal> {
        let name = name.replace('\\', "/");
        if name.is_empty() || name.contains('\0') {
            return Err(Refusal::Outside("it is not a file name"));
        }
        let first = name.split('/').next().unwrap_or_default();
        if first.is_empty() {
            return Err(Refusal::Outside("it is an absolute path"));
        }
        // `http:`, `file:` and `C:` alike. A file whose own name holds a colon is reached as `./a:b`.
        if first.contains(':') {
            return Err(Refusal::Outside("it is an absolute path or an address"));
        }
        let mut depth = 0i64;
        for part in Path::new(&name).components() {
            match part {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => depth -= 1,
                Component::RootDir | Component::Prefix(_) => {
                    return Err(Refusal::Outside("it is an absolute path"));
                }
            }
            if depth < 0 {
                return Err(Refusal::Outside("it leads out of the folder of the scene"));
            }
        }
        let path = fs::canonicalize(self.root.join(&name)).map_err(Refusal::Missing)?;
        if !path.starts_with(&self.root) {
            return Err(Refusal::Outside("a symbolic link leads out of the folder of the scene"));
        }
        Ok(path)
    }

    /// As [`Folder::find`], with a refusal as an error about `element`.
    pub(crate) fn demand(&self, name: &str, element: &str) -> Result<PathBuf> {
        self.find(name).map_err(|refusal| match refusal {
            Refusal::Outside(reason) => outside(name, reason, element),
            Refusal::Missing(source) => io(
                element,
                format!("cannot find \"{name}\""),
                "put the file into the folder of the scene, or correct the name",
                source,
            ),
        })
    }
}

/// The error for a name that is refused whatever is there.
pub(crate) fn outside(name: &str, reason: &str, element: &str) -> crate::LoadError {
    invalid(
        element,
        format!("\"{name}\" is refused: {reason}"),
        "keep every file inside the folder of the scene and name it relative to it",
    )
}
