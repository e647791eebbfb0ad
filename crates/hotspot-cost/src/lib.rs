//! Per-pixel cost layers for any path tracer.
//!
//! A renderer feeds the recorder (the paper is *Identifying and Visualizing Computational Hotspots in Path Tracing*,
//! Sundarrajan, van de Ruit, Eisemann 2022); everything else follows from the [`Frame`]: [`Layers`] for an EXR file
//! (`exr_io`), totals with intervals ([`stats`]), hotspots with causes ([`hotspots`]), the [`Document`] beside the
//! picture, and the [`Comparison`] of two renders. Nothing here prints or keeps
//! global state. What goes over all pixels (layers, totals, hotspots, EXR files, pages) runs in the caller's rayon pool.
//!
//! ```
//! use hotspot_cost::{Cause, CostModel, Frame, FrameDesc, LayerOptions, Layers, Metric, PathEnd, stats};
//! use hotspot_probe::Spawner;
//!
//! let mut frame = Frame::new(FrameDesc::new(32, 16));
//! for tile in frame.tiles_mut() {
//!     for (x, y) in tile.rect().pixels() {
//!         tile.film_mut(x, y, 0).add([0.5, 0.5, 0.5]);
//!         let mut pixel = tile.pixel(x, y, 0);
//!         let mut path = pixel.path();
//!         path.add_ray(Spawner::CAMERA, 10 + x, 3, true);
//!         path.end(PathEnd { cause: Cause::Escaped, throughput: 1.0, brought_radiance: true, first_object: 0 });
//!     }
//! }
//! let layers = Layers::from_frame(&frame, &LayerOptions::default());
//! assert_eq!(layers.metric(Metric::Nodes).unwrap()[5], 15.0);
//! assert_eq!(stats::total(&frame, Metric::Nodes, CostModel::default()).mean, 25.5);
//! ```
//!
//! # Limits
//! Pixels are compared as tiles of 8 × 8. Time has no intervals: they need repeated renders.
#![forbid(unsafe_code)]

pub mod analysis;
pub mod calibration;
pub mod compare;
pub mod convergence;
mod counter;
pub mod cryptomatte;
mod depth_cut;
mod digest;
pub mod document;
mod error;
mod expected_error;
#[cfg(feature = "exr")]
pub mod exr_io;
mod frame;
pub mod hotspots;
mod layers;
pub mod ledger;
mod metric;
mod metric_set;
#[cfg_attr(not(feature = "report"), allow(dead_code, reason = "the page alone uses some of it"))]
mod names;
mod pair;
mod picture_change;
pub mod picture_error;
pub mod prediction;
mod recorder;
mod repeats;
pub mod stats;
mod student;
pub mod surface;
#[cfg(test)]
mod testing;
pub mod tree_noise;
pub mod whatif;

#[cfg(feature = "maps")]
pub mod maps;
#[cfg(feature = "report")]
pub mod report;

pub use compare::{Comparison, Side, compare, compare_over_trees};
pub use counter::{Cause, Counter};
pub use depth_cut::{DepthCut, DepthLoss};
pub use digest::Digest;
pub use document::Document;
pub use error::{Error, Result};
pub use frame::{Frame, FrameDesc};
pub use hotspots::{Hotspot, HotspotInput};
pub use layers::{LayerOptions, Layers, RADIANCE};
pub use ledger::Ledgers;
pub use metric::{CostModel, Metric, Sum};
pub use metric_set::{MetricSet, UnknownMetric};
pub use picture_change::PictureChange;
pub use recorder::{
    CostPixel, FilmPixel, PathCounts, PathEnd, PathRecorder, PathTally, PixelRecorder, PixelVisit,
    RayCounter, Rect, TalliedRay, TileRecorder,
};
pub use repeats::RepeatChange;
pub use stats::{CiKind, Total};
pub use tree_noise::{TreeNoise, TreeSpread};
pub use whatif::WhatIf;
