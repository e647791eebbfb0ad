//! Why a file was not loaded: one sentence with the file, the element in it, and what to do.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Where in which file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file as the caller named it (or as another file names it).
    pub file: PathBuf,
    /// JSON path such as `accessors[3].bufferView`, `line 12` of a text file, or empty for the file as a whole.
    pub element: String,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if !self.element.is_empty() {
            write!(f, ": {}", self.element)?;
        }
        Ok(())
    }
}

/// Why a file was not loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A file could not be read.
    #[error("{place}: {problem} ({source}); {remedy}")]
    Io {
        /// Which file names it, and where.
        place: Place,
        /// What was attempted.
        problem: String,
        /// What to do.
        remedy: String,
        /// The system's answer.
        source: io::Error,
    },
    /// The file contradicts its format or itself.
    #[error("{place}: {problem}; {remedy}")]
    Invalid {
        /// Where.
        place: Place,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// The file may be right, but needs something that this loader lacks.
    #[error("{place}: {problem}; {remedy}")]
    Unsupported {
        /// Where.
        place: Place,
        /// What it needs.
        problem: String,
        /// What to do.
        remedy: String,
    },
    /// The file asks for more than [`crate::LoadOptions`] grants.
    #[error("{place}: {problem}; {remedy}")]
    Limit {
        /// Where.
        place: Place,
        /// What it asks for, and what is granted.
        problem: String,
        /// What to do.
        remedy: String,
    },
}

impl LoadError {
    /// Where it happened.
    pub fn place(&self) -> &Place {
        match self {
            Self::Io { place, .. }
            | Self::Invalid { place, .. }
            | Self::Unsupported { place, .. }
            | Self::Limit { place, .. } => place,
        }
    }

    /// Fills in the file of an error that was raised where only the element was known.
    pub(crate) fn in_file(mut self, file: &Path) -> Self {
        let (Self::Io { place, .. }
        | Self::Invalid { place, .. }
        | Self::Unsupported { place, .. }
        | Self::Limit { place, .. }) = &mut self;
        if place.file.as_os_str().is_empty() {
            place.file = file.into();
        }
        self
    }
}

/// Shorthand for `Result<T, LoadError>`.
pub(crate) type Result<T> = std::result::Result<T, LoadError>;

/// What nearly always helps with a file that contradicts itself.
pub(crate) const REEXPORT: &str = "export the file again or repair it";

fn at(element: impl Into<String>) -> Place {
    Place { file: PathBuf::new(), element: shorten(element.into()) }
}

/// Names come from the file and may be as long as the file.
fn shorten(text: String) -> String {
    const MAX: usize = 200;
    match text.char_indices().nth(MAX) {
        Some((end, _)) => format!("{}…", text.get(..end).unwrap_or_default()),
        None => text,
    }
}

pub(crate) fn io(
    element: impl Into<String>,
    problem: impl Into<String>,
    remedy: &str,
    source: io::Error,
) -> LoadError {
    LoadError::Io { place: at(element), problem: shorten(problem.into()), remedy: remedy.into(), source }
}

pub(crate) fn invalid(element: impl Into<String>, problem: impl Into<String>, remedy: &str) -> LoadError {
    LoadError::Invalid { place: at(element), problem: shorten(problem.into()), remedy: remedy.into() }
}

pub(crate) fn unsupported(element: impl Into<String>, problem: impl Into<String>, remedy: &str) -> LoadError {
    LoadError::Unsupported { place: at(element), problem: shorten(problem.into()), remedy: remedy.into() }
}

pub(crate) fn limit(element: impl Into<String>, problem: impl Into<String>, remedy: &str) -> LoadError {
    LoadError::Limit { place: at(element), problem: shorten(problem.into()), remedy: remedy.into() }
}
