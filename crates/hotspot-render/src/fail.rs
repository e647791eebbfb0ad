//! How a command ends when it does not succeed: one sentence and an exit code.

/// The work failed.
pub(crate) const FAILED: u8 = 1;
/// Wrong usage.
pub(crate) const USAGE: u8 = 2;
/// A gate tripped.
pub(crate) const GATE: u8 = 3;
/// Interrupted after saving.
pub(crate) const INTERRUPTED: u8 = 130;

/// What went wrong, for people, and the exit code.
#[derive(Debug)]
pub(crate) struct Fail {
    pub(crate) message: String,
    pub(crate) code: u8,
}

impl Fail {
    pub(crate) fn new(code: u8, message: impl Into<String>) -> Self {
        Self { message: message.into(), code }
    }

    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self::new(USAGE, message)
    }
}

impl<E: std::error::Error> From<E> for Fail {
    fn from(error: E) -> Self {
        Self::new(FAILED, error.to_string())
    }
}
