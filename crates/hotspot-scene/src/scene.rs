//! The scene as loaded: what a file says, in renderer-neutral terms.
//!
//! Space: glTF's (right-handed, Y up, metres by convention), object-space geometry with one affine matrix per instance.
//! Colours: linear Rec.709. Radiance: W/(sr m²). Indices between the vectors of [`Scene`] are checked by the loaders:
//! every `u32` that names an element of another vector is in range.

use std::sync::Arc;

/// A loaded scene.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Stem of the file's name, for naming outputs.
    pub name: String,
    /// Geometry in object space; several instances may share one mesh.
    pub meshes: Vec<Mesh>,
    /// Placed meshes. A glTF node whose mesh has several primitives gives one instance per primitive.
    pub instances: Vec<Instance>,
    /// What an artist calls an object: a glTF mesh node, an OBJ object or group.
    pub objects: Vec<Object>,
    /// Materials; never empty when there is an instance (a default material is added where a file names none).
    pub materials: Vec<Material>,
    /// Decoded images; materials refer to them by index.
    pub textures: Vec<Texture>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// Lights without area, in file order.
    pub lights: Vec<Light>,
    /// Radiance from all directions that no geometry blocks.
    pub environment: Option<Environment>,
    /// What the file uses and the scene does not carry, by feature and element.
    pub unmodelled: Vec<Unmodelled>,
    /// What was wrong in the file and mended.
    pub repairs: Vec<Repair>,
}

/// A triangle mesh in object space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file, or made up from its index.
    pub name: String,
    /// Vertex positions, finite.
    pub positions: Vec<[f32; 3]>,
    /// Unit shading normals, one per vertex; `None` for flat shading.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates, one per vertex; (0, 0) is the upper left corner of the image. `None` where no texture uses them.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// A second set, for materials whose textures read two ([`TextureRef::second_uvs`]).
    pub second_uvs: Option<Vec<[f32; 2]>>,
    /// Linear RGBA, one per vertex: multiplied into the base colour (the first colour of each [`Bsdf`]) and into alpha.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Unit tangents in x, y, z, one per vertex, w = ±1: the bitangent is w (normal × tangent). `None` where the material
    /// has no normal map, or the mesh no normals to go with it.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Index into [`Scene::objects`].
    pub object: u32,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Object space to world space: rows of a 3×4 affine matrix, `world = m[..][0..3] * p + m[..][3]`. Finite, as the file
    /// says: where its determinant is negative, whoever applies it must also turn the triangles round (swap two corners)
    /// for the front to stay the front; where it is zero, triangles may collapse.
    pub to_world: [[f64; 4]; 3],
}

/// The unit of attribution.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name shown to people; unique within the scene (a `#2` is appended to the second of a name).
    pub name: String,
}

/// A surface: how it scatters and what it emits.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name shown to people; unique within the scene.
    pub name: String,
    /// How it scatters.
    pub bsdf: Bsdf,
    /// Emission leaves both sides when true, else only the front. (Every surface scatters on both sides.)
    pub double_sided: bool,
    /// Emitted radiance; zero for most.
    pub emission: Color,
    /// Where the surface is there at all.
    pub alpha: Alpha,
    /// Bumps.
    pub normal_map: Option<NormalMap>,
}

/// Shading normals from a texture, in the frame of tangent, bitangent and normal of each vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// RGB encode x, y, z in -1..1, not decoded from sRGB.
    pub texture: TextureRef,
    /// Scales x and y.
    pub scale: f32,
}

impl Material {
    /// Grey matte, for surfaces whose file names no material.
    pub fn default_matte(name: &str) -> Self {
        Self {
            name: name.into(),
            bsdf: Bsdf::Matte { reflectance: Color::constant([0.8; 3]) },
            double_sided: true,
            emission: Color::constant([0.0; 3]),
            alpha: Alpha::Opaque,
            normal_map: None,
        }
    }

    /// True when the surface emits.
    pub fn is_emissive(&self) -> bool {
        self.emission.factor.iter().any(|c| *c > 0.0)
    }
}

/// The scattering models. Formulas: hotspot-integrator's `bsdf` room.
#[derive(Clone, Debug)]
pub enum Bsdf {
    /// Lambert.
    Matte {
        /// Albedo, 0..1.
        reflectance: Color,
    },
    /// Ashikhmin–Shirley Fresnel blend with isotropic GGX (pbrt-v3's SubstrateMaterial).
    Substrate {
        /// Rd, 0..1.
        diffuse: Color,
        /// Rs, reflectance at normal incidence, 0..1.
        specular: Color,
        /// Scales `specular`, 0..1.
        specular_weight: Scalar,
        /// glTF roughness 0..1; GGX alpha = max(roughness², 1e-3).
        roughness: Scalar,
    },
    /// Perfect specular reflection without Fresnel.
    Mirror {
        /// Reflectance, 0..1.
        reflectance: Color,
    },
    /// GGX with separable Smith masking and Schlick's Fresnel.
    RoughMetal {
        /// Reflectance at normal incidence, 0..1.
        f0: Color,
        /// glTF roughness 0..1; GGX alpha = max(roughness², 1e-3).
        roughness: Scalar,
    },
    /// Smooth dielectric with exact Fresnel.
    Glass {
        /// Index of refraction inside, above 0.
        ior: f32,
        /// A pane (both interfaces at once, no refraction) rather than the boundary of a solid.
        thin: bool,
        /// Scales the transmitted part, 0..1.
        transmittance: Color,
        /// Absorption inside of a solid per unit of world length, at least 0: a stretch of length d lets
        /// exp(-absorption d) through.
        absorption: [f32; 3],
    },
    /// Shows its colour as radiance, to every path that meets it, and scatters nothing (KHR_materials_unlit). Not
    /// sampled as a light.
    Unlit {
        /// Radiance.
        color: Color,
    },
    /// Linear mix, as glTF's metallic factor between 0 and 1: `(1 - weight) * base + weight * other`.
    Mix {
        /// Share of `other`, 0..1.
        weight: Scalar,
        /// The part at weight 0. May be a mix itself.
        base: Box<Bsdf>,
        /// The part at weight 1. May be a mix itself.
        other: Box<Bsdf>,
    },
}

/// A colour: a constant, or a constant times a texture's colour (decoded to linear).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Color {
    /// Linear factor.
    pub factor: [f32; 3],
    /// Multiplied in where present.
    pub texture: Option<TextureRef>,
}

impl Color {
    /// The same everywhere.
    pub fn constant(factor: [f32; 3]) -> Self {
        Self { factor, texture: None }
    }
}

/// A number: a constant, or a constant times one channel of a texture (not decoded).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scalar {
    /// Factor.
    pub factor: f32,
    /// Multiplied in where present.
    pub texture: Option<(TextureRef, Channel)>,
}

impl Scalar {
    /// The same everywhere.
    pub fn constant(factor: f32) -> Self {
        Self { factor, texture: None }
    }
}

/// A channel of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Red.
    R,
    /// Green (glTF: roughness).
    G,
    /// Blue (glTF: metallic).
    B,
    /// Alpha.
    A,
}

/// A texture and how it is looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: u32,
    /// Behaviour beyond 0..1, horizontally and vertically.
    pub wrap: [Wrap; 2],
    /// Nearest texel rather than bilinear.
    pub nearest: bool,
    /// `uv' = m * [u, v, 1]`: the rows of KHR_texture_transform's matrix; identity by default.
    pub transform: [[f32; 3]; 2],
    /// Reads [`Mesh::second_uvs`] rather than [`Mesh::uvs`].
    pub second_uvs: bool,
}

/// Behaviour of a texture beyond 0..1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Start again.
    Repeat,
    /// Hold the edge.
    Clamp,
    /// There and back.
    Mirror,
}

/// An image: 8-bit texels as in the file, RGBA, row-major from the top. Colour channels are sRGB-encoded when looked up
/// as a [`Color`], plain numbers when looked up as a [`Scalar`] or as alpha.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Name or path in the file.
    pub name: String,
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `4 * width * height` bytes.
    pub rgba: Arc<[u8]>,
}

/// Where a surface is there at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// Everywhere.
    Opaque,
    /// Where alpha ≥ cutoff.
    Mask {
        /// Threshold.
        cutoff: f32,
        /// Alpha.
        alpha: Scalar,
    },
    /// With probability alpha.
    Blend {
        /// Alpha.
        alpha: Scalar,
    },
}

/// A camera.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name in the file, or made up from its index.
    pub name: String,
    /// Camera space (looking along −Z, +Y up) to world space, rigid: rows of a 3×4 matrix, columns of unit length.
    pub to_world: [[f64; 4]; 3],
    /// What the pixels cover.
    pub projection: Projection,
}

/// What the pixels of a camera cover.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole.
    Perspective {
        /// Full vertical angle in radians, in (0, π).
        yfov: f64,
        /// Width over height where the file says it.
        aspect: Option<f64>,
    },
    /// Parallel rays.
    Orthographic {
        /// Half width in scene units.
        xmag: f64,
        /// Half height in scene units.
        ymag: f64,
    },
}

/// A light without area (KHR_lights_punctual). It shines on surfaces and is not seen itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name shown to people; unique among the objects and lights of the scene.
    pub name: String,
    /// Where it shines.
    pub kind: LightKind,
    /// Linear Rec.709, colour times intensity: W/sr of a point or a spot, W/m² across the rays of a directional light.
    pub intensity: [f32; 3],
}

/// Where a [`Light`] shines; in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// In all directions from a point.
    Point {
        /// The point.
        position: [f32; 3],
    },
    /// In a cone from a point: in full within the inner angle, falling to nothing at the outer one as
    /// clamp((cos θ − cos outer) / (cos inner − cos outer), 0, 1)².
    Spot {
        /// The point.
        position: [f32; 3],
        /// Unit direction of the axis, away from the light.
        direction: [f32; 3],
        /// Cosine of the inner angle.
        cos_inner: f32,
        /// Cosine of the outer angle, below `cos_inner`.
        cos_outer: f32,
    },
    /// From infinitely far away along one direction.
    Directional {
        /// Unit direction in which the light travels.
        direction: [f32; 3],
    },
}

/// Light from infinitely far away.
#[derive(Clone, Debug)]
pub enum Environment {
    /// The same radiance from every direction.
    Constant([f32; 3]),
    /// Radiance by direction.
    Map(EnvironmentMap),
}

/// An equirectangular picture of radiance around the scene.
///
/// Unrotated, the centre of the picture lies along −Z (where a camera without rotation looks), its right half towards +X,
/// its upper edge at +Y: texel centre (x, y) of w × h looks along
/// (sin φ sin θ, cos θ, −cos φ sin θ) with φ = 2π (x + ½)/w − π, θ = π (y + ½)/h.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Name of the file, for people.
    pub name: String,
    /// Texels per row.
    pub width: u32,
    /// Rows, from the zenith down.
    pub height: u32,
    /// Linear Rec.709 radiance, finite and at least 0; `width * height` texels.
    pub texels: Arc<[[f32; 3]]>,
    /// Rotation about +Y in radians, counter-clockwise seen from above: what lay along −Z turns towards −X.
    pub rotation: f64,
    /// Multiplies the texels.
    pub scale: [f32; 3],
}

/// Something that the file uses and the scene does not carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unmodelled {
    /// Feature, such as `KHR_materials_sheen`.
    pub feature: String,
    /// Where, such as `materials[3] "Velvet"`.
    pub element: String,
    /// What happens instead, in a few words.
    pub effect: String,
}

/// Something wrong in the file that was mended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Repair {
    /// What was done, such as `degenerate triangles dropped`.
    pub what: String,
    /// Where.
    pub element: String,
    /// How many times.
    pub count: u64,
}
