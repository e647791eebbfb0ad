//! From what an MTL file states to a [`Material`], with its textures.

use std::collections::HashMap;
use std::path::Path;

use super::mtl::{Map, Mtl};
use crate::budget::Budget;
use crate::error::{Result, io};
use crate::files::{self, Folder, Refusal};
use crate::images::Images;
use crate::notes::Notes;
use crate::options::LoadOptions;
use crate::scene::{Alpha, Bsdf, Channel, Color, Material, Scalar, TextureRef};

/// Reads textures, each file once.
pub(super) struct Textures<'a> {
    pub(super) images: Images<'a>,
    pub(super) folder: &'a Folder,
    pub(super) options: &'a LoadOptions,
    pub(super) budget: &'a Budget,
    by_path: HashMap<std::path::PathBuf, u32>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(folder: &'a Folder, options: &'a LoadOptions, budget: &'a Budget) -> Self {
        Self { images: Images::new(options), folder, options, budget, by_path: HashMap::new() }
    }

    /// The texture of a statement; `None` where the file is missing (noted).
    fn read(&mut self, map: Option<&Map>, file: &Path, notes: &mut Notes) -> Result<Option<TextureRef>> {
        let Some(map) = map else { return Ok(None) };
        let element = format!("line {}", map.line);
        let found = match find_beside(self.folder, file, &map.name) {
            Ok(found) => found,
            Err(Refusal::Outside(reason)) => return Err(files::outside(&map.name, reason, &element)),
            Err(Refusal::Missing(source)) if source.kind() == std::io::ErrorKind::NotFound => {
                let element = format!("{} {element}: {}", file.display(), map.name);
                notes.repair("missing texture left out", &element, 1);
                return Ok(None);
            }
            Err(Refusal::Missing(source)) => {
                let problem = format!("cannot open \"{}\"", map.name);
                return Err(io(element, problem, "check the file", source));
            }
        };
        let texture = match self.by_path.get(&found) {
            Some(known) => *known,
            None => {
                let bytes = files::read(&found, self.options.max_file_bytes, self.budget, &element)?;
                let index = self.images.add(bytes, &map.name, &element, self.budget)?;
                self.by_path.insert(found, index);
                index
            }
        };
        Ok(Some(TextureRef {
            texture,
            wrap: [map.wrap; 2],
            nearest: false,
            transform: map.transform,
            second_uvs: false,
        }))
    }
}

/// A file that an MTL file names: beside the MTL file, else beside the OBJ file.
fn find_beside(folder: &Folder, mtl: &Path, name: &str) -> std::result::Result<std::path::PathBuf, Refusal> {
    let direct = folder.find(name);
    let mtl_folder = mtl.parent().and_then(Path::to_str).unwrap_or_default();
    if mtl_folder.is_empty()
        || matches!(direct, Err(Refusal::Outside(reason)) if !reason.contains("leads out"))
    {
        return direct;
    }
    folder.find(&format!("{mtl_folder}/{name}")).or(direct)
}

/// The material that `mtl` states.
pub(super) fn build(
    name: String,
    mtl: &Mtl,
    textures: &mut Textures<'_>,
    notes: &mut Notes,
) -> Result<Material> {
    for (feature, line, effect) in &mtl.unmodelled {
        let element = format!("{} line {line} \"{name}\"", mtl.file.display());
        notes.unmodelled(feature, &element, effect);
    }
    let stated = &mtl.stated;
    // A texture alone is shown as it is.
    let color = |factor: Option<[f32; 3]>, texture: Option<TextureRef>, absent: f32| Color {
        factor: factor.unwrap_or(if texture.is_some() { [1.0; 3] } else { [absent; 3] }),
        texture,
    };
    let diffuse = color(stated.diffuse, textures.read(mtl.map_kd.as_ref(), &mtl.file, notes)?, 0.8);
    let mut emission = color(stated.emissive, textures.read(mtl.map_ke.as_ref(), &mtl.file, notes)?, 0.0);
    if emission.factor == [0.0; 3] {
        emission.texture = None;
    }
    let specular = stated.specular.unwrap_or([0.0; 3]);
    let bsdf = if matches!(stated.illumination_model, Some(3 | 5)) {
        Bsdf::Mirror { reflectance: Color::constant(specular) }
    } else if specular == [0.0; 3] {
        Bsdf::Matte { reflectance: diffuse }
    } else {
        // alpha = roughness²; sqrt is exactly rounded, so every machine agrees.
        let alpha = (2.0 / (f64::from(stated.shininess.unwrap_or(0.0)) + 2.0)).sqrt();
        Bsdf::Substrate {
            diffuse,
            specular: Color::constant(specular),
            specular_weight: Scalar::constant(1.0),
            roughness: Scalar::constant(alpha.sqrt() as f32),
        }
    };
    let mut alpha = Scalar::constant(stated.dissolve.unwrap_or(1.0));
    if let Some(texture) = textures.read(mtl.map_d.as_ref(), &mtl.file, notes)? {
        // Opacity maps are grey pictures, or pictures with an alpha channel.
        let channel =
            if textures.images.is_solid(texture.texture, textures.budget) { Channel::R } else { Channel::A };
        alpha.texture = Some((texture, channel));
    }
    let alpha = if alpha == Scalar::constant(1.0) { Alpha::Opaque } else { Alpha::Blend { alpha } };
    Ok(Material { name, bsdf, double_sided: true, emission, alpha, normal_map: None })
}

/// Whether the material looks up a texture.
pub(super) fn is_textured(material: &Material) -> bool {
    let bsdf = match &material.bsdf {
        Bsdf::Matte { reflectance } => reflectance.texture,
        Bsdf::Substrate { diffuse, .. } => diffuse.texture,
        _ => None,
    };
    let alpha = matches!(material.alpha, Alpha::Blend { alpha } if alpha.texture.is_some());
    bsdf.is_some() || alpha || material.emission.texture.is_some()
}
