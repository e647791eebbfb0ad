//! One room per command.

pub(crate) mod calibrate;
pub(crate) mod compare;
pub(crate) mod predict;
pub(crate) mod render;
pub(crate) mod report;
