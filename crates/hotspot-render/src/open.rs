//! Opening a scene: which file, which part and moment of it, in what light, seen from where.

use crate::args::nearest;
use crate::demo;
use crate::fail::{FAILED, Fail};
use clap::{Args, ValueEnum};
use hotspot_integrator::{BuildOptions, Instancing, Isa, PrepareOptions, Quality, RenderScene, frame_bounds};
use hotspot_scene::{Camera, Environment, LoadOptions, Projection, Repair, Scene, SceneChoice};
use serde_json::{Value, json};
use std::path::PathBuf;

/// What to open.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// The scene: .gltf, .glb or .obj
    #[arg(value_name = "SCENE", required_unless_present = "demo", conflicts_with = "demo")]
    pub(crate) file: Option<PathBuf>,
    /// Render the built-in scene
    #[arg(long)]
    pub(crate) demo: bool,
    /// Which scene of a glTF file, by name or by index ("#0" is its first) [default: the file's own choice]
    #[arg(long, value_name = "NAME|#INDEX")]
    pub(crate) scene: Option<String>,
    /// Camera by name or by index ("#0" is the file's first)
    #[arg(long, value_name = "NAME|#INDEX")]
    pub(crate) camera: Option<String>,
    /// Show glTF animations at this time in seconds [default: everything at rest]
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, allow_hyphen_values = true)]
    pub(crate) time: Option<f64>,
    /// Which material variant of a glTF file to show
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Option<String>,
    /// Light from around the scene, in place of the file's: a radiance, or an equirectangular .exr or .hdr picture
    #[arg(long, value_name = "R,G,B|FILE", value_parser = parse_env)]
    pub(crate) env: Option<EnvArg>,
    /// Turn the environment picture about the vertical axis, in degrees, counter-clockwise seen from above
    #[arg(long, value_name = "DEG", value_parser = parse_angle, allow_hyphen_values = true)]
    pub(crate) env_rotate: Option<f64>,
    /// Which meshes are stored once, however often they appear: those that save much memory, all, or none
    #[arg(long, value_enum, default_value_t = InstancesArg::Auto)]
    pub(crate) instances: InstancesArg,
    /// How much time to spend on the tree, or which other builder to use
    #[arg(long, value_enum, default_value_t = QualityArg::Medium)]
    pub(crate) bvh: QualityArg,
    /// Instruction set of the traversal; all give the same result
    #[arg(long, value_enum, default_value_t = IsaArg::Auto)]
    pub(crate) isa: IsaArg,
    /// Most memory that loading the scene may take, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 8192)]
    pub(crate) max_memory: u64,
    /// Most memory for textures, in MiB; the largest are reduced until the rest fits
    #[arg(long, value_name = "MIB", default_value_t = 4096, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) max_texture_memory: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QualityArg {
    Fast,
    Medium,
    High,
    /// By the crate obvhs, to compare with
    Obvhs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum IsaArg {
    Auto,
    Portable,
    Avx2,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum InstancesArg {
    Auto,
    Once,
    Copies,
}

/// Light from around the scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum EnvArg {
    /// Linear red, green, blue from everywhere.
    Constant([f32; 3]),
    File(PathBuf),
}

impl SceneArgs {
    /// Loads the file and sets the environment.
    pub(crate) fn load(&self) -> Result<Scene, Fail> {
        let is_obj = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
        if self.file.as_ref().is_some_and(is_obj)
            && (self.scene.is_some() || self.variant.is_some() || self.time.is_some())
        {
            return Err(Fail::usage(
                "--scene, --variant and --time choose among parts of a glTF file, and OBJ has none; leave them out",
            ));
        }
        let options = self.load_options();
        let mut scene = match &self.file {
            Some(path) => hotspot_scene::load(path, &options)?,
            None => hotspot_scene::load_glb_bytes("demo.glb", demo::GLB, &options)?,
        };
        match &self.env {
            None => {}
            Some(EnvArg::Constant(radiance)) => scene.environment = Some(Environment::Constant(*radiance)),
            Some(EnvArg::File(path)) => {
                let (map, repairs) = hotspot_scene::load_environment(path, &options)?;
                scene.environment = Some(Environment::Map(map));
                scene.repairs.extend(repairs);
            }
        }
        if let Some(degrees) = self.env_rotate {
            match &mut scene.environment {
                Some(Environment::Map(map)) => map.rotation += degrees.to_radians(),
                _ => {
                    return Err(Fail::usage(
                        "--env-rotate turns an environment picture, and there is none; name one with --env FILE",
                    ));
                }
            }
        }
        Ok(scene)
    }

    pub(crate) fn load_options(&self) -> LoadOptions {
        LoadOptions {
            max_memory_bytes: self.max_memory.saturating_mul(1 << 20),
            max_texture_bytes: self.max_texture_memory.saturating_mul(1 << 20),
            scene: self.scene.as_ref().map(|wanted| match index(wanted) {
                Some(index) => SceneChoice::Index(index),
                None => SceneChoice::Name(wanted.clone()),
            }),
            time: self.time,
            variant: self.variant.clone(),
            ..LoadOptions::default()
        }
    }

    pub(crate) const fn prepare_options(&self) -> PrepareOptions {
        PrepareOptions {
            tree: BuildOptions {
                quality: match self.bvh {
                    QualityArg::Fast => Quality::Fast,
                    QualityArg::Medium => Quality::Medium,
                    QualityArg::High => Quality::High,
                    QualityArg::Obvhs => Quality::Obvhs,
                },
                isa: match self.isa {
                    IsaArg::Auto => Isa::Auto,
                    IsaArg::Portable => Isa::Portable,
                    IsaArg::Avx2 => Isa::Avx2,
                },
                shuffle: None,
            },
            instancing: match self.instances {
                InstancesArg::Auto => Instancing::Auto,
                InstancesArg::Once => Instancing::Always,
                InstancesArg::Copies => Instancing::Never,
            },
            max_memory_bytes: Some(self.max_memory.saturating_mul(1 << 20)),
        }
    }

    /// Makes the scene ready, and names the file where it cannot.
    pub(crate) fn prepare(&self, scene: &Scene) -> Result<RenderScene, Fail> {
        self.prepare_over_tree(scene, None)
    }

    /// The same over another tree, one for each number.
    pub(crate) fn prepare_over_tree(&self, scene: &Scene, shuffle: Option<u64>) -> Result<RenderScene, Fail> {
        let mut options = self.prepare_options();
        options.tree.shuffle = shuffle;
        RenderScene::prepare(scene, options).map_err(|error| {
            let file = self.file.as_ref().map_or("demo.glb".into(), |path| path.to_string_lossy());
            Fail::new(FAILED, format!("{file}: {error}"))
        })
    }

    /// The camera asked for, the file's first, or one that frames the scene (with a note).
    pub(crate) fn choose_camera(
        &self,
        scene: &Scene,
        prepared: &RenderScene,
    ) -> Result<(Camera, Option<Repair>), Fail> {
        if let Some(wanted) = &self.camera {
            let found = match index(wanted) {
                Some(index) => scene.cameras.get(index),
                None => scene.cameras.iter().find(|c| c.name == *wanted),
            };
            return match found {
                Some(camera) => Ok((camera.clone(), None)),
                None if scene.cameras.is_empty() => Err(Fail::usage(format!(
                    "--camera {wanted}: the scene has no cameras; leave the option out"
                ))),
                None => {
                    let names: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
                    let near = nearest(wanted, names.iter().copied());
                    let hint = near.map_or(String::new(), |near| format!("did you mean \"{near}\"? "));
                    Err(Fail::usage(format!(
                        "--camera {wanted}: no such camera; {hint}the scene has {}",
                        names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ")
                    )))
                }
            };
        }
        if let Some(camera) = scene.cameras.first() {
            return Ok((camera.clone(), None));
        }
        let (min, max) = prepared.bounds();
        let note = Repair {
            what: "no camera in the file: one that frames the scene is used".into(),
            element: "scene".into(),
            count: 1,
        };
        Ok((frame_bounds(min, max), Some(note)))
    }

    /// The choices that make a picture, for the settings in the outputs.
    pub(crate) fn described(&self) -> [(&'static str, Value); 7] {
        let env = match &self.env {
            None => Value::Null,
            Some(EnvArg::Constant(radiance)) => json!(radiance),
            Some(EnvArg::File(path)) => json!(path.to_string_lossy()),
        };
        let instances = match self.instances {
            InstancesArg::Auto => "auto",
            InstancesArg::Once => "once",
            InstancesArg::Copies => "copies",
        };
        [
            ("env", env),
            ("env-rotate", json!(self.env_rotate)),
            ("scene", json!(self.scene)),
            ("time", json!(self.time)),
            ("variant", json!(self.variant)),
            ("instances", json!(instances)),
            ("max-texture-memory", json!(self.max_texture_memory)),
        ]
    }
}

/// `long` pixels on the long edge at the camera's aspect (3:2 where it has none).
pub(crate) fn default_size(camera: &Camera, long: f64) -> (u32, u32) {
    let aspect = match camera.projection {
        Projection::Perspective { aspect, .. } => aspect.unwrap_or(1.5),
        Projection::Orthographic { xmag, ymag } => xmag / ymag,
    };
    let aspect = if aspect.is_finite() { aspect.clamp(0.01, 100.0) } else { 1.5 };
    let short = |ratio: f64| ((long / ratio).round() as u32).max(1);
    if aspect >= 1.0 { (long as u32, short(aspect)) } else { (short(1.0 / aspect), long as u32) }
}

/// The index in `#3`.
fn index(wanted: &str) -> Option<usize> {
    wanted.strip_prefix('#').and_then(|index| index.parse().ok())
}

fn parse_env(text: &str) -> Result<EnvArg, String> {
    let is_number = |word: &str| word.trim().parse::<f32>().is_ok();
    if !text.split(',').any(is_number)
        || [".exr", ".hdr"].iter().any(|e| text.to_ascii_lowercase().ends_with(e))
    {
        return if text.is_empty() { Err("this is empty".into()) } else { Ok(EnvArg::File(text.into())) };
    }
    let values: Vec<f32> = text.split(',').filter_map(|v| v.trim().parse().ok()).collect();
    match <[f32; 3]>::try_from(values) {
        Ok(rgb) if text.split(',').count() == 3 && rgb.iter().all(|c| c.is_finite() && *c >= 0.0) => {
            Ok(EnvArg::Constant(rgb))
        }
        _ => Err(
            "write three numbers that are not negative, such as 1,1,1, or the name of an .exr or .hdr file"
                .into(),
        ),
    }
}

fn parse_angle(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.abs() <= 1e6 => Ok(x),
        _ => Err("write a number of degrees".into()),
    }
}

fn parse_time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("write a number of seconds".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_follow_the_camera() {
        let camera = |aspect| Camera {
            name: String::new(),
            to_world: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            projection: Projection::Perspective { yfov: 1.0, aspect },
        };
        assert_eq!(default_size(&camera(Some(16.0 / 9.0)), 960.0), (960, 540));
        assert_eq!(default_size(&camera(Some(0.5)), 960.0), (480, 960));
        assert_eq!(default_size(&camera(None), 960.0), (960, 640));
    }

    #[test]
    fn environments_are_radiances_or_files() {
        assert_eq!(parse_env("1,2,3"), Ok(EnvArg::Constant([1.0, 2.0, 3.0])));
        assert_eq!(parse_env("sky.hdr"), Ok(EnvArg::File("sky.hdr".into())));
        assert_eq!(parse_env("1,2.exr"), Ok(EnvArg::File("1,2.exr".into())));
        assert_eq!(parse_env("1,2.HDR"), Ok(EnvArg::File("1,2.HDR".into())));
        for wrong in ["", "1,2", "1,x,2,3", "1,2,nan", "-1,0,0", "1"] {
            assert!(parse_env(wrong).is_err(), "{wrong}");
        }
    }
}
