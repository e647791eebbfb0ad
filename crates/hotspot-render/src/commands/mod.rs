//! One room per command.

pub(crate) mod bake;
pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod error;
pub(crate) mod predict;
pub(crate) mod render;
pub(crate) mod report;
pub(crate) mod whatif;

use crate::fail::{FAILED, Fail};
use std::path::Path;

/// Makes a folder for outputs and sees that it can be written into: that should not be found out after hours of work.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Fail> {
    std::fs::create_dir_all(folder).map_err(|e| {
        Fail::new(FAILED, format!("cannot make the folder {}: {e}; choose another with -o", folder.display()))
    })?;
    tempfile::tempfile_in(folder).map_err(|e| {
        Fail::new(
            FAILED,
            format!("cannot write into {}: {e}; choose another folder with -o", folder.display()),
        )
    })?;
    Ok(())
}
