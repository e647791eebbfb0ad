//! One room per command.

pub(crate) mod compare;
pub(crate) mod render;
pub(crate) mod report;
