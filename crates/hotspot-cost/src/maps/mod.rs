//! Pictures for people: heat maps with a burned-in legend, and the tone-mapped beauty.
//!
//! The paper (§3.3 "Visualizing results", §5) maps each metric through a colour map, clips outliers at the 99.9th
//! percentile and despikes the time map with a 3×3 median. Here both happen **in views only**: the layers keep what was
//! measured, and every picture says in its legend what its view altered and in how many pixels.
//!
//! All pictures are 8-bit sRGB, rows from the top. Nothing here panics on hostile sizes or values: a plane that does
//! not hold `width × height` values is drawn as far as it goes.

mod beauty;
mod colormap;
mod heat;
mod legend;
mod numbers;
mod picture;
mod plot;
mod text;
mod view;

pub use beauty::{Beauty, Exposure, beauty};
pub use colormap::{ColorMap, SIGNAL};
pub use heat::{HeatMap, HeatOptions, heat_map};
pub use legend::notes;
pub use numbers::{compact, grouped, ticks};
pub use picture::{crop, encode_png, thumbnail, write_atomic, write_png};
pub use plot::{Curve, LogPlot};
pub use view::{DEFAULT_CLIP, SPIKE, Scale, View, view};
