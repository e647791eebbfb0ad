//! The profile file: what `calibrate` found on a machine. Schema `hotspot-profile/1`, published as
//! `schema/hotspot-profile-1.schema.json`; the rules for keys are those of [`crate::document`]. Times are nanoseconds of one
//! thread.

use super::fit::{Fit, Form, Score, Traversal};
use crate::error::{self, Error};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The schema written.
pub const PROFILE_SCHEMA: &str = "hotspot-profile/1";

/// The JSON Schema of [`Profile`].
pub const PROFILE_JSON_SCHEMA: &str = include_str!("../../schema/hotspot-profile-1.schema.json");

/// What was measured where.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Profile {
    /// [`PROFILE_SCHEMA`].
    pub schema: String,
    /// Program and version that calibrated.
    pub generator: String,
    /// The command line, word by word.
    pub command: Vec<String>,
    /// Where.
    pub machine: Machine,
    /// Worker threads that were busy at once: they share caches and memory.
    pub threads: u32,
    /// Kernels that were timed, one per class of scene.
    pub kernels: Vec<String>,
    /// Settings of the runs, by the name of their command-line option.
    pub settings: BTreeMap<String, Value>,
    /// Edge of the tiles in pixels.
    pub tile: u32,
    /// c0 and c1 for `intersection`: nanoseconds of traversal.
    pub intersection: Traversal,
    /// Fits over all scenes, each scene counting alike.
    pub fits: BTreeMap<Form, Fit>,
    /// Scene by scene.
    pub scenes: Vec<SceneProfile>,
}

/// A computer.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Machine {
    /// Processor, as the system calls it; empty when it does not say.
    pub cpu: String,
    /// Processors that the program may use.
    pub processors: u32,
    /// Architecture and operating system: `x86_64 linux`.
    pub system: String,
}

/// What one scene showed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneProfile {
    /// Its name.
    pub scene: String,
    /// The kernel that ran.
    pub kernel: String,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Camera samples per pixel of each run.
    pub samples_per_pixel: u64,
    /// Timed runs.
    pub repeats: u32,
    /// Each run's time over the median run's.
    pub drift: Vec<f64>,
    /// Tiles fitted.
    pub tiles: u64,
    /// Mean time per path.
    pub mean_ns: f64,
    /// R² that a perfect model would reach through the noise of the tiles' times.
    pub repeat_r2: Option<f64>,
    /// This scene's own fits, judged on tiles that they have not seen.
    pub fits: BTreeMap<Form, Fit>,
    /// The fits over all scenes, judged on this scene's tiles that they have not seen.
    pub pooled: BTreeMap<Form, Score>,
    /// The fits to all other scenes, judged on this one; empty for a single scene.
    pub from_other_scenes: BTreeMap<Form, Score>,
    /// File name of the map of what the full fit leaves.
    pub residual_map: String,
}

impl Profile {
    /// As indented JSON with a newline at its end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads a profile; `place` names it in errors.
    ///
    /// # Errors
    /// [`Error::Invalid`] when it is not JSON of this shape or its numbers are none, [`Error::Unsupported`] for another schema.
    pub fn from_json(text: &str, place: &str) -> error::Result<Self> {
        const ADVICE: &str = "write it again with calibrate";
        let profile: Self = serde_json::from_str(text)
            .map_err(|e| Error::invalid(place, format!("it is not a profile: {e}"), ADVICE))?;
        if profile.schema != PROFILE_SCHEMA {
            return Err(Error::unsupported(
                place,
                format!("its schema is \"{}\", this program reads \"{PROFILE_SCHEMA}\"", profile.schema),
                ADVICE,
            ));
        }
        let usable = |ns: f64| ns.is_finite() && ns >= 0.0;
        let model = profile.intersection.model();
        let fits = profile.fits.values().flat_map(|fit| fit.coefficients.values());
        if !usable(model.c0) || !usable(model.c1) || !fits.into_iter().all(|c| usable(c.ns)) {
            return Err(Error::invalid(place, "a coefficient is negative or not a number", ADVICE));
        }
        if model.c0 == 0.0 && model.c1 == 0.0 {
            return Err(Error::invalid(place, "nodes and shapes cost nothing in it", ADVICE));
        }
        Ok(profile)
    }
}
