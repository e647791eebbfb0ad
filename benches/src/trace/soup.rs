//! Triangles in the world, from scene files or made here.

use hotspot_integrator::frame_bounds;
use hotspot_scene::{Camera, Projection};
use std::path::Path;

/// A triangle: three corners.
pub type Triangle = [[f32; 3]; 3];

/// What rays are shot at.
pub struct Soup {
    /// Name of the scene.
    pub name: String,
    /// Triangles in the world.
    pub triangles: Vec<Triangle>,
    /// Those that emit: what shadow rays aim at.
    pub lights: Vec<Triangle>,
    /// Where primary rays come from.
    pub camera: Camera,
}

impl Soup {
    /// The placed triangles of a scene file. Without an emitter there is a lamp in its stead, below the top of the bounds.
    ///
    /// # Panics
    /// When it cannot be loaded.
    pub fn load(path: &Path) -> Self {
        let scene = match hotspot_scene::load(path, &Default::default()) {
            Ok(scene) => scene,
            Err(e) => panic!("{e}"),
        };
        let (mut triangles, mut lights) = (Vec::new(), Vec::new());
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh as usize];
            let m = &instance.to_world;
            let place = |p: [f32; 3]| {
                [0, 1, 2].map(|row| {
                    let sum: f64 = (0..3).map(|i| m[row][i] * f64::from(p[i])).sum();
                    (sum + m[row][3]) as f32
                })
            };
            let emits = scene.materials[instance.material as usize].is_emissive();
            for corners in &mesh.triangles {
                let triangle = corners.map(|c| place(mesh.positions[c as usize]));
                if emits {
                    lights.push(triangle);
                }
                triangles.push(triangle);
            }
        }
        let camera = scene.cameras.first().cloned();
        Self::new(scene.name, triangles, lights, camera)
    }

    fn new(
        name: String,
        triangles: Vec<Triangle>,
        mut lights: Vec<Triangle>,
        camera: Option<Camera>,
    ) -> Self {
        let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for corner in triangles.iter().flatten() {
            for axis in 0..3 {
                min[axis] = min[axis].min(corner[axis]);
                max[axis] = max[axis].max(corner[axis]);
            }
        }
        if lights.is_empty() {
            let at = |x: f32, y: f32, z: f32| {
                [
                    min[0] + x * (max[0] - min[0]),
                    min[1] + y * (max[1] - min[1]),
                    min[2] + z * (max[2] - min[2]),
                ]
            };
            lights.push([at(0.4, 0.97, 0.4), at(0.6, 0.97, 0.4), at(0.5, 0.97, 0.6)]);
        }
        let camera = camera.unwrap_or_else(|| frame_bounds(min, max));
        Self { name, triangles, lights, camera }
    }

    /// A million triangles in a closed hall: rough ground of 2 · 512², and 240 rough balls of 2024 triangles each standing
    /// on it and in the air. Seen from a corner, lit by a panel below the ceiling.
    pub fn million() -> Self {
        let mut triangles = Vec::with_capacity(1_050_000);
        const CELLS: u32 = 512;
        let ground = |i: u32, j: u32| {
            let (x, z) = (i as f32 / CELLS as f32 * 20.0 - 10.0, j as f32 / CELLS as f32 * 20.0 - 10.0);
            [x, 0.8 * noise(x * 0.5, 0.0, z * 0.5) + 0.05 * noise(x * 7.0, 3.0, z * 7.0), z]
        };
        for i in 0..CELLS {
            for j in 0..CELLS {
                let [a, b, c, d] = [ground(i, j), ground(i, j + 1), ground(i + 1, j + 1), ground(i + 1, j)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        for ball in 0..240 {
            let at = |k: u32| hash(ball * 4 + k);
            let center = [at(0) * 18.0 - 9.0, 0.5 + 6.0 * at(1) * at(1), at(2) * 18.0 - 9.0];
            push_ball(&mut triangles, center, 0.25 + 0.6 * at(3), 23, 0.12);
        }
        let [lo, hi] = [[-10.0, -2.0, -10.0], [10.0, 9.0, 10.0]];
        push_box(&mut triangles, lo, hi);
        let quad = [[-2.0, 8.9, -2.0], [2.0, 8.9, -2.0], [2.0, 8.9, 2.0], [-2.0, 8.9, 2.0]];
        let lights = vec![[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]];
        triangles.extend(&lights);
        // From a corner at eye height, along the diagonal and a little down.
        let s = core::f64::consts::FRAC_1_SQRT_2;
        let camera = Camera {
            name: "corner".into(),
            to_world: [[s, -0.2 * s, s, 9.0], [0.0, 0.96, 0.28, 4.0], [-s, -0.2 * s, s, 9.0]],
            projection: Projection::Perspective { yfov: 1.0, aspect: None },
        };
        Self::new("million".into(), triangles, lights, Some(camera))
    }

    /// Rough ground of 2 · `cells`² triangles, seen from above.
    pub fn grid(cells: u32) -> Self {
        let at = |i: u32, j: u32| {
            let (x, z) = (i as f32 / cells as f32 * 20.0 - 10.0, j as f32 / cells as f32 * 20.0 - 10.0);
            [x, 0.8 * noise(x * 0.5, 0.0, z * 0.5) + 0.05 * noise(x * 7.0, 3.0, z * 7.0), z]
        };
        let mut triangles = Vec::with_capacity(2 * (cells as usize).pow(2));
        for i in 0..cells {
            for j in 0..cells {
                let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        Self::new("grid".into(), triangles, Vec::new(), None)
    }

    /// A closed rough ball around the origin, of 4 · `bands`² triangles less those at the poles, for leaks.
    pub fn ball(bands: u32) -> Self {
        let mut triangles = Vec::new();
        push_ball(&mut triangles, [0.0; 3], 1.0, bands, 0.2);
        Self::new("ball".into(), triangles, Vec::new(), None)
    }
}

/// A ball whose radius varies by `rough`: `bands` bands of 2 · `bands` cells. Closed: neighbours share their corners to
/// the last bit.
fn push_ball(out: &mut Vec<Triangle>, center: [f32; 3], radius: f32, bands: u32, rough: f32) {
    let corner = |band: u32, sector: u32| {
        let theta = core::f64::consts::PI * f64::from(band) / f64::from(bands);
        let phi = core::f64::consts::PI * f64::from(sector % (2 * bands)) / f64::from(bands);
        // The poles are one point each.
        let s = if band == 0 || band == bands { 0.0 } else { theta.sin() };
        let n = [(s * phi.cos()) as f32, theta.cos() as f32, (s * phi.sin()) as f32];
        let r = radius
            * (1.0 + rough * noise(3.0 * n[0] + center[0], 3.0 * n[1] + center[1], 3.0 * n[2] + center[2]));
        [0, 1, 2].map(|i| center[i] + r * n[i])
    };
    for band in 0..bands {
        for sector in 0..2 * bands {
            let [a, b] = [corner(band, sector), corner(band, sector + 1)];
            let [c, d] = [corner(band + 1, sector + 1), corner(band + 1, sector)];
            if band > 0 {
                out.push([a, b, c]);
            }
            if band + 1 < bands {
                out.push([a, c, d]);
            }
        }
    }
}

fn push_box(out: &mut Vec<Triangle>, lo: [f32; 3], hi: [f32; 3]) {
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [lo[axis], hi[axis]] {
            let at = |p: f32, q: f32| {
                let mut corner = [side; 3];
                corner[u] = p;
                corner[v] = q;
                corner
            };
            let quad = [at(lo[u], lo[v]), at(hi[u], lo[v]), at(hi[u], hi[v]), at(lo[u], hi[v])];
            out.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
    }
}

/// A number in [0, 1) for each index.
pub fn hash(index: u32) -> f32 {
    // The finaliser of MurmurHash3.
    let mut h = index.wrapping_mul(0x9e37_79b9).wrapping_add(0x85eb_ca6b);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Value noise in [−1, 1], smooth, one octave per unit.
pub(crate) fn noise(x: f32, y: f32, z: f32) -> f32 {
    let cell = |v: f32| v.floor() as i32;
    let (i, j, k) = (cell(x), cell(y), cell(z));
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (u, v, w) = (smooth(x - x.floor()), smooth(y - y.floor()), smooth(z - z.floor()));
    let at = |di: i32, dj: i32, dk: i32| {
        let [a, b, c] = [i + di, j + dj, k + dk].map(i32::cast_unsigned);
        2.0 * hash(a.wrapping_mul(73_856_093) ^ b.wrapping_mul(19_349_663) ^ c.wrapping_mul(83_492_791)) - 1.0
    };
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let plane = |dk: i32| mix(mix(at(0, 0, dk), at(1, 0, dk), u), mix(at(0, 1, dk), at(1, 1, dk), u), v);
    mix(plane(0), plane(1), w)
}
