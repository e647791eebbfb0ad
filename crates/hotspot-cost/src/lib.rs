//! Per-pixel cost layers for any path tracer.
#![forbid(unsafe_code)]

pub mod analysis;
pub mod compare;
mod counter;
mod digest;
pub mod document;
mod error;
#[cfg(feature = "exr")]
pub mod exr_io;
mod frame;
pub mod hotspots;
mod layers;
mod metric;
mod metric_set;
mod recorder;
pub mod stats;
mod student;
#[cfg(test)]
mod testing;

#[cfg(feature = "maps")]
pub mod maps;
#[cfg(feature = "report")]
pub mod report;

pub use compare::{Comparison, Side, compare};
pub use counter::{Cause, Counter};
pub use digest::Digest;
pub use document::Document;
pub use error::{Error, Result};
pub use frame::{Frame, FrameDesc};
pub use hotspots::{Hotspot, HotspotInput};
pub use layers::{LayerOptions, Layers, RADIANCE};
pub use metric::{CostModel, Metric, Sum};
pub use metric_set::{MetricSet, UnknownMetric};
pub use recorder::{
    CostPixel, FilmPixel, PathEnd, PathRecorder, PixelRecorder, RayCounter, Rect, TileRecorder,
};
pub use stats::{CiKind, Total};
