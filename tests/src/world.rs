//! Scenes made in memory: quads, boxes, spheres, materials and cameras in a few words.
//!
//! Right-handed, Y up, counter-clockwise triangles seen from the front.

use hotspot_integrator::{BuildOptions, Instancing, PrepareOptions, RenderScene};
use hotspot_scene::{
    Bsdf, Camera, Color, Environment, EnvironmentMap, Instance, Light, LightKind, Material, Mesh, Object,
    Projection, Scalar, Scene, Texture, TextureRef, Wrap,
};

/// Point or direction.
pub type V3 = [f64; 3];

/// a − b.
pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + s·b.
pub fn add_scaled(a: V3, s: f64, b: V3) -> V3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// a · b.
pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// At length 1.
pub fn unit(a: V3) -> V3 {
    let length = dot(a, a).sqrt();
    a.map(|c| c / length)
}

/// The identity as an instance's matrix.
pub const IDENTITY: [[f64; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A scene in the making.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// As the loader would give it.
    pub scene: Scene,
}

impl World {
    /// Empty.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an object of its own.
    #[must_use]
    pub fn with(self, mesh: Mesh, material: Material) -> Self {
        self.with_placed(mesh, material, IDENTITY)
    }

    /// Adds an object, placed by a matrix.
    #[must_use]
    pub fn with_placed(mut self, mesh: Mesh, material: Material, to_world: [[f64; 4]; 3]) -> Self {
        let index = self.scene.meshes.len() as u32;
        self.scene.meshes.push(mesh);
        self.place(index, material, to_world);
        self
    }

    /// Sets a constant environment.
    #[must_use]
    pub fn with_environment(mut self, radiance: [f32; 3]) -> Self {
        self.scene.environment = Some(Environment::Constant(radiance));
        self
    }

    /// Sets a map as environment.
    #[must_use]
    pub fn with_environment_map(mut self, map: EnvironmentMap) -> Self {
        self.scene.environment = Some(Environment::Map(map));
        self
    }

    /// Adds a light without area.
    #[must_use]
    pub fn with_light(mut self, kind: LightKind, intensity: [f32; 3]) -> Self {
        let name = format!("light {}", self.scene.lights.len());
        self.scene.lights.push(Light { name, kind, intensity });
        self
    }

    /// Adds an object that shares the mesh of the last one.
    #[must_use]
    pub fn with_again(mut self, material: Material, to_world: [[f64; 4]; 3]) -> Self {
        let mesh = self.scene.instances.last().expect("there is an object before").mesh;
        self.place(mesh, material, to_world);
        self
    }

    fn place(&mut self, mesh: u32, material: Material, to_world: [[f64; 4]; 3]) {
        let index = self.scene.instances.len() as u32;
        self.scene.objects.push(Object { name: format!("object {index}") });
        self.scene.materials.push(material);
        self.scene.instances.push(Instance { object: index, mesh, material: index, to_world });
    }

    /// Adds an image. The first one has index 0.
    #[must_use]
    pub fn with_texture(mut self, texture: Texture) -> Self {
        self.scene.textures.push(texture);
        self
    }

    /// Makes it ready for rendering, with or without meshes that are stored once.
    pub fn prepare_with(&self, instancing: Instancing) -> RenderScene {
        let options = PrepareOptions { instancing, ..PrepareOptions::default() };
        RenderScene::prepare(&self.scene, options).expect("the scene is whole")
    }

    /// Makes it ready for rendering.
    pub fn prepare(&self) -> RenderScene {
        RenderScene::prepare(&self.scene, BuildOptions::default()).expect("the scene is whole")
    }
}

/// A mesh without normals.
pub fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh { name: "mesh".into(), positions, triangles, ..Mesh::default() }
}

/// A quad, counter-clockwise seen from the front.
pub fn quad(corners: [V3; 4]) -> Mesh {
    mesh(corners.map(|c| c.map(|v| v as f32)).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A rectangle: centre and two half edges; the front is on the side of `u × v`.
pub fn rectangle(center: V3, u: V3, v: V3) -> Mesh {
    quad(rectangle_corners(center, u, v))
}

/// The same with texture coordinates: the image's upper edge at `+v`, its right edge at `+u`.
pub fn panel(center: V3, u: V3, v: V3) -> Mesh {
    let uvs = Some(vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    Mesh { uvs, ..rectangle(center, u, v) }
}

/// An image from a function of column and row.
pub fn image(width: u32, height: u32, mut texel: impl FnMut(u32, u32) -> [u8; 4]) -> Texture {
    let rgba = (0..width * height).flat_map(|i| texel(i % width, i / width)).collect();
    Texture { name: "image".into(), width, height, rgba }
}

/// A repeating image looked up by its nearest texel, through the first set of texture coordinates.
pub fn nearest(texture: u32) -> TextureRef {
    TextureRef {
        texture,
        wrap: [Wrap::Repeat; 2],
        nearest: true,
        transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        second_uvs: false,
    }
}

/// The same between texels.
pub fn bilinear(texture: u32) -> TextureRef {
    TextureRef { nearest: false, ..nearest(texture) }
}

/// An 8-bit colour channel as linear light (IEC 61966-2-1).
pub fn linear(c: u8) -> f64 {
    let c = f64::from(c) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Its corners.
pub fn rectangle_corners(center: V3, u: V3, v: V3) -> [V3; 4] {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(a, b)| add_scaled(add_scaled(center, a, u), b, v))
}

/// A closed box with its front outside, or inside.
pub fn cuboid(min: V3, max: V3, inward: bool) -> Mesh {
    let positions = (0..8)
        .map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { max[axis] as f32 } else { min[axis] as f32 }))
        .collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] })
        .collect();
    mesh(positions, triangles)
}

/// A sphere of 20·4ⁿ triangles with its front outside, or inside.
pub fn sphere(center: V3, radius: f64, n: u32, inward: bool) -> Mesh {
    let phi = 0.5 * (1.0 + 5f64.sqrt());
    let mut points: Vec<V3> = Vec::new();
    for (i, j) in [(1.0, phi), (-1.0, phi), (1.0, -phi), (-1.0, -phi)] {
        points.push(unit([0.0, i, j]));
        points.push(unit([i, j, 0.0]));
        points.push(unit([j, 0.0, i]));
    }
    // The faces of an icosahedron: all triples at edge distance.
    let near = |a: V3, b: V3| dot(sub(a, b), sub(a, b)) < 1.2;
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [points[a], points[b], points[c]];
                if near(p, q) && near(q, r) && near(p, r) {
                    let outward = dot(cross(sub(q, p), sub(r, p)), p) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    let mut middles = std::collections::HashMap::new();
    for _ in 0..n {
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |i: usize, j: usize| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    points.push(unit(add_scaled(points[i], 1.0, points[j])));
                    points.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    mesh(
        points.iter().map(|p| add_scaled(center, radius, *p).map(|v| v as f32)).collect(),
        triangles
            .iter()
            .map(|t| t.map(|i| i as u32))
            .map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] })
            .collect(),
    )
}

/// A material that scatters as told and does not emit.
pub fn surface(bsdf: Bsdf) -> Material {
    Material { bsdf, ..Material::default_matte("surface") }
}

/// Lambert.
pub fn matte(reflectance: [f32; 3]) -> Material {
    surface(Bsdf::Matte { reflectance: Color::constant(reflectance) })
}

/// Perfect mirror.
pub fn mirror(reflectance: [f32; 3]) -> Material {
    surface(Bsdf::Mirror { reflectance: Color::constant(reflectance) })
}

/// Coated matte.
pub fn substrate(diffuse: [f32; 3], specular: f32, roughness: f32) -> Material {
    surface(Bsdf::Substrate {
        diffuse: Color::constant(diffuse),
        specular: Color::constant([specular; 3]),
        specular_weight: Scalar::constant(1.0),
        roughness: Scalar::constant(roughness),
    })
}

/// Rough metal.
pub fn metal(f0: [f32; 3], roughness: f32) -> Material {
    surface(Bsdf::RoughMetal { f0: Color::constant(f0), roughness: Scalar::constant(roughness) })
}

/// Makes a material emit from its front.
pub fn emitting(material: Material, radiance: [f32; 3]) -> Material {
    Material { emission: Color::constant(radiance), double_sided: false, ..material }
}

/// A black emitter, front only.
pub fn light(radiance: [f32; 3]) -> Material {
    emitting(matte([0.0; 3]), radiance)
}

/// An environment map, unrotated, from a function of column and row.
pub fn environment_map(
    width: u32,
    height: u32,
    mut texel: impl FnMut(u32, u32) -> [f32; 3],
) -> EnvironmentMap {
    EnvironmentMap {
        name: "map".into(),
        width,
        height,
        texels: (0..width * height).map(|i| texel(i % width, i / width)).collect(),
        rotation: 0.0,
        scale: [1.0; 3],
    }
}

/// A camera at `from` that looks at `to`.
pub fn camera(from: V3, to: V3, projection: Projection) -> Camera {
    let back = unit(sub(from, to));
    let up = if back[1].abs() > 0.99 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
    let right = unit(cross(up, back));
    let up = cross(back, right);
    Camera {
        name: "camera".into(),
        to_world: [0, 1, 2].map(|i| [right[i], up[i], back[i], from[i]]),
        projection,
    }
}

/// A pinhole camera; `yfov` in degrees.
pub fn pinhole(from: V3, to: V3, yfov: f64) -> Camera {
    camera(from, to, Projection::Perspective { yfov: yfov.to_radians(), aspect: None })
}

/// A camera all of whose rays are the same, exactly: an orthographic one of no extent.
pub fn pencil(from: V3, to: V3) -> Camera {
    camera(from, to, Projection::Orthographic { xmag: 0.0, ymag: 0.0 })
}

/// Uniform numbers in [0, 1): SplitMix64 (Steele, Lea, Flood 2014).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next number.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ z >> 31) as f64 / 18_446_744_073_709_551_616.0
    }

    /// A number in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A point of the cube [low, high)³.
    pub fn point(&mut self, low: f64, high: f64) -> V3 {
        [0; 3].map(|_| self.within(low, high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume enclosed, positive when the front is outside (Gauss).
    fn volume(mesh: &Mesh) -> f64 {
        let at = |i: u32| mesh.positions[i as usize].map(f64::from);
        mesh.triangles.iter().map(|&[a, b, c]| dot(at(a), cross(at(b), at(c))) / 6.0).sum()
    }

    #[test]
    fn closed_shapes_enclose_their_volume() {
        assert!((volume(&cuboid([-1.0; 3], [1.0, 2.0, 3.0], false)) - 24.0).abs() < 1e-5);
        assert!((volume(&cuboid([-1.0; 3], [1.0, 2.0, 3.0], true)) + 24.0).abs() < 1e-5);
        let ball = sphere([0.5, 0.0, 0.0], 2.0, 3, false);
        assert_eq!(ball.triangles.len(), 1280);
        assert!((volume(&ball) / (4.0 / 3.0 * core::f64::consts::PI * 8.0) - 1.0).abs() < 0.02);
        assert!(volume(&sphere([0.0; 3], 1.0, 1, true)) < 0.0);
    }
}
