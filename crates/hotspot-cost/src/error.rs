//! What can go wrong, and what to do about it.

use std::path::PathBuf;

/// Alias with this crate's error.
pub type Result<T> = std::result::Result<T, Error>;

/// An error: what, where, what to do. Displays as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file system refused.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: "read", "write", …
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Damaged or contradictory input.
    #[error("{place}: {what}; {advice}")]
    Invalid {
        /// File, or file and element.
        place: String,
        /// What is wrong.
        what: String,
        /// What to do about it.
        advice: String,
    },
    /// Valid, but not something this library handles.
    #[error("{place}: {what}; {advice}")]
    Unsupported {
        /// File, or file and element.
        place: String,
        /// What is not supported.
        what: String,
        /// What to do about it.
        advice: String,
    },
    /// Larger than the limits allow.
    #[error("{place}: {what}; {advice}")]
    Limit {
        /// File, or file and element.
        place: String,
        /// What is too large.
        what: String,
        /// What to do about it.
        advice: String,
    },
}

impl Error {
    pub(crate) fn invalid(
        place: impl Into<String>,
        what: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        Self::Invalid { place: place.into(), what: what.into(), advice: advice.into() }
    }

    pub(crate) fn unsupported(
        place: impl Into<String>,
        what: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        Self::Unsupported { place: place.into(), what: what.into(), advice: advice.into() }
    }
}
