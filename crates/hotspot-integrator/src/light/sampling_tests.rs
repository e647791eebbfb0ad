//! Light sampling against the densities that MIS asks for: how often each light, each part of it and each direction of the
//! environment is taken, by chi-square (10^6 samples each, rate of any false alarm 1 %), and each sample's own pdf.

use super::{LightTarget, Lights, area, area_to_solid_angle};
use crate::chi_square::{COLUMNS, Cells, ROWS, Random, SAMPLES, Suite, p_value};
use crate::class::FullClass;
use crate::math::Frame;
use crate::sampler::{Dimensions, PixelSampler, SamplerKind};
use crate::scene::RenderScene;
use core::f64::consts::PI;
use glam::{DVec3, Vec3};
use hotspot_bvh::BuildOptions;
use hotspot_probe::NoProbe;
use hotspot_scene::{
    Color, Environment, EnvironmentMap, Instance, Light, LightKind, Material, Mesh, Object, Scene,
};

/// Each triangle an object of its own, with its radiance.
pub(super) fn scene(triangles: &[([[f32; 3]; 3], f32)]) -> Scene {
    let mut scene = Scene::default();
    for (i, (corners, radiance)) in triangles.iter().enumerate() {
        scene.meshes.push(Mesh {
            positions: corners.to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        });
        let emission = Color::constant([*radiance, 0.5 * radiance, 0.0]);
        scene.materials.push(Material {
            emission,
            double_sided: i % 3 == 0,
            ..Material::default_matte("light")
        });
        scene.objects.push(Object { name: format!("light {i}") });
        let to_world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let i = i as u32;
        scene.instances.push(Instance { object: i, mesh: i, material: i, to_world });
    }
    scene
}

/// Triangles of different sizes, shapes and radiances around the origin.
fn scattered(count: usize, random: &mut Random) -> Vec<([[f32; 3]; 3], f32)> {
    (0..count)
        .map(|_| {
            let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| size * (2.0 * random.unit() - 1.0)));
            let center = point(1.0).normalize() * 3.0;
            let size = 0.02 + 0.5 * point(1.0).x.abs();
            let corners = [0; 3].map(|_| (center + point(size)).as_vec3().to_array());
            (corners, (0.1 + 5.0 * point(1.0).x.powi(4)) as f32)
        })
        .collect()
}

fn map() -> EnvironmentMap {
    let mut random = Random(11);
    EnvironmentMap {
        name: "map".into(),
        width: 16,
        height: 8,
        texels: (0..128).map(|_| [0; 3].map(|_| random.unit().powi(3) as f32)).collect(),
        rotation: 0.7,
        scale: [1.0; 3],
    }
}

/// What a sample took: a cell of a triangle, a punctual light, a cell of the environment, or nothing.
struct Bins<'a> {
    scene: &'a RenderScene,
    /// Cells along a triangle's edge.
    fine: usize,
    /// First primitive by light.
    lights: Vec<u32>,
    punctual: usize,
    directions: Cells,
}

impl<'a> Bins<'a> {
    fn new(scene: &'a RenderScene, fine: usize, axis: Vec3, limit: f64) -> Self {
        let lights = scene.lights.triangles.iter().map(|t| t.primitive).collect();
        let directions = Cells::new(axis.as_dvec3(), limit, 1);
        Self { scene, fine, lights, punctual: scene.lights.punctual.len(), directions }
    }

    /// What shows `p` a back that does not emit is as likely as if it did, and then gives nothing.
    fn expected(&self, p: Vec3, frame: &Frame) -> Vec<f64> {
        let mut expected = Vec::new();
        let mut unseen = 0.0;
        for (light, primitive) in self.scene.lights.triangles.iter().zip(&self.lights) {
            let probability = f64::from(self.scene.geometry.part(*primitive).light_pdf_area)
                * area(&self.scene.geometry.triangles[*primitive as usize]);
            let cells = self.fine * self.fine;
            let [a, b, c] = self.scene.geometry.triangles[*primitive as usize].map(Vec3::from_array);
            let seen = light.two_sided || (b - a).cross(c - a).dot(p - a) > 0.0;
            let share = if seen { SAMPLES as f64 * probability } else { 0.0 };
            unseen += SAMPLES as f64 * probability - share;
            expected.extend(vec![share / cells as f64; cells]);
        }
        expected.extend(self.scene.lights.punctual.iter().map(|l| SAMPLES as f64 * f64::from(l.probability)));
        let density = |w: DVec3| {
            let w = w.as_vec3();
            let found = self.scene.lights.escaped::<_, FullClass>(w, w.dot(frame.n), &mut NoProbe);
            found.map_or(0.0, |(_, pdf)| f64::from(pdf))
        };
        expected.extend(self.directions.expected(&density));
        let rest = SAMPLES as f64 - unseen - expected.iter().sum::<f64>();
        assert!(rest.abs() < 1e-3 * SAMPLES as f64, "densities make {rest} less than all");
        expected.push(unseen + rest.max(0.0));
        expected
    }

    fn of(&self, target: &LightTarget, wi: Vec3) -> usize {
        let cells = self.fine * self.fine;
        let environment = self.lights.len() * cells + self.punctual;
        match target {
            LightTarget::Surface { primitive, uv, .. } => {
                let light = self.lights.iter().position(|p| p == primitive).expect("a light was taken");
                let n = self.fine;
                let (b, c) = (uv.x * n as f32, uv.y * n as f32);
                let (i, j) = ((b as usize).min(n - 1), (c as usize).min(n - 1 - (b as usize).min(n - 1)));
                // Rows of congruent triangles, every second one upside down.
                let upper = usize::from(b - i as f32 + (c - j as f32) > 1.0 && i + j < n - 1);
                light * cells + n * n - (n - i) * (n - i) + 2 * j + upper
            }
            LightTarget::Environment(_) => {
                environment + self.directions.cell(wi.as_dvec3()).unwrap_or(ROWS * COLUMNS)
            }
            LightTarget::Position { position, .. } => {
                let places = self.scene.lights.punctual.iter();
                let at = places.map(super::punctual::PunctualLight::position);
                self.lights.len() * cells + at.into_iter().position(|p| p == Some(*position)).unwrap()
            }
            LightTarget::Direction(_) => {
                let places = self.scene.lights.punctual.iter();
                let at = places.map(super::punctual::PunctualLight::position);
                self.lights.len() * cells + at.into_iter().position(|p| p.is_none()).unwrap()
            }
        }
    }
}

/// Each sample says the density that a ray in its direction would ask for.
fn assert_density(scene: &RenderScene, frame: &Frame, p: Vec3, sample: &super::LightSample) {
    let asked = match sample.target {
        LightTarget::Surface { primitive, point, cos, .. } => {
            let d2 = (point.p.as_dvec3() - p.as_dvec3()).length_squared();
            area_to_solid_angle(scene.geometry.part(primitive).light_pdf_area, d2 as f32, cos)
        }
        LightTarget::Environment(_) => {
            let cos = sample.wi.dot(frame.n);
            scene.lights.escaped::<_, FullClass>(sample.wi, cos, &mut NoProbe).unwrap().1
        }
        _ => return,
    };
    assert!((sample.pdf / asked - 1.0).abs() < 1e-3, "{sample:?}: asked {asked}");
    assert!((sample.wi.length() - 1.0).abs() < 1e-5);
}

pub(super) fn check(suite: &mut Suite, what: &str, scene: &Scene, p: Vec3, normal: Vec3, fine: usize) {
    let scene = RenderScene::prepare(scene, BuildOptions::default()).unwrap();
    let frame = Frame::new(normal);
    let constant = matches!(scene.lights.environment, super::Surroundings::Constant(_));
    let bins = Bins::new(&scene, fine, normal, if constant { 0.5 * PI } else { PI });
    let expected = bins.expected(p, &frame);
    let mut observed = vec![0; expected.len()];
    let mut random = Random(3);
    let nothing = expected.len() - 1;
    for i in 0..SAMPLES {
        let u = [random.single(), random.single()];
        let sample = scene.lights.sample::<_, FullClass, true>(p, &frame, u, &mut NoProbe);
        if let Some(sample) = sample.as_ref().filter(|_| i % 64 == 0) {
            assert_density(&scene, &frame, p, sample);
        }
        observed[sample.map_or(nothing, |s| bins.of(&s.target, s.wi))] += 1;
    }
    suite.add(what.to_owned(), p_value(&observed, &expected));
}

#[test]
fn lights_are_taken_as_mis_believes() {
    let mut suite = Suite::new();
    let mut random = Random(2);
    let normal = Vec3::new(0.3, 0.9, -0.2).normalize();
    let p = Vec3::new(0.2, -0.1, 0.4);
    let dozen = scene(&scattered(12, &mut random));
    check(&mut suite, "a dozen triangles", &dozen, p, normal, 8);
    let mut sky = dozen.clone();
    sky.environment = Some(Environment::Constant([0.05, 0.1, 0.2]));
    check(&mut suite, "with a constant environment", &sky, p, normal, 8);
    let mut everything = dozen;
    everything.environment = Some(Environment::Map(map()));
    let kinds = [
        LightKind::Point { position: [1.0, 2.0, 0.5] },
        LightKind::Spot {
            position: [-1.0, 2.0, 0.5],
            direction: [1.2, -2.1, -0.1],
            cos_inner: 0.9,
            cos_outer: 0.5,
        },
        LightKind::Directional { direction: [0.1, -1.0, 0.0] },
    ];
    for (i, kind) in kinds.into_iter().enumerate() {
        let intensity = [3.0, 20.0, 0.7][i];
        everything.lights.push(Light { name: String::new(), kind, intensity: [intensity; 3] });
    }
    check(&mut suite, "with a map and punctual lights", &everything, p, normal, 8);
    let mut black = Scene { environment: Some(Environment::Map(map())), ..Scene::default() };
    check(&mut suite, "a map alone", &black, p, normal, 1);
    black.environment = Some(Environment::Constant([1.0; 3]));
    check(&mut suite, "a constant environment alone", &black, p, normal, 1);
    check(&mut suite, "a thousand triangles", &scene(&scattered(1000, &mut random)), p, normal, 3);
    suite.finish();
}

/// From 95 % of the half space to 1e-10 sr (nearer to the half space the mean of 1/pdf no longer settles; there
/// `tests/tests/physics/emitters.rs` looks at the picture): densities are finite and integrate over the light to its probability:
/// the mean of 1/pdf is the solid angle.
#[test]
fn solid_angles_of_any_size() {
    for (height, half) in [(0.1f32, 3.0f32), (1.0, 1.0), (1.0, 1e-2), (2.0, 1.1e-5)] {
        let corner = |x: f32, z: f32| [x * half, height, z * half];
        let triangles = [
            ([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)], 1.0),
            ([corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], 1.0),
        ];
        let scene = RenderScene::prepare(&scene(&triangles), BuildOptions::default()).unwrap();
        // Van Oosterom and Strackee (1983).
        let solid_angle: f64 = triangles
            .iter()
            .map(|(t, _)| {
                let [a, b, c] = t.map(|p| DVec3::from_array(p.map(f64::from)).normalize());
                2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
            })
            .sum();
        let mut random = Random(4);
        let frame = Frame::new(Vec3::Y);
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        for _ in 0..400_000 {
            let u = [random.single(), random.single()];
            n += 1.0;
            let sample = scene.lights.sample::<_, FullClass, true>(Vec3::ZERO, &frame, u, &mut NoProbe);
            let Some(sample) = sample else { continue };
            assert!(sample.pdf > 0.0 && sample.pdf.is_finite());
            let value = 1.0 / f64::from(sample.pdf);
            sum += value;
            squares += value * value;
        }
        let mean: f64 = sum / n;
        let sigma = ((squares / n - mean * mean) / n).sqrt();
        let off = (mean - solid_angle).abs();
        assert!(
            off < 4.0 * sigma + 1e-5 * solid_angle,
            "{height} {half}: {mean} ± {sigma} for {solid_angle}"
        );
    }
}

/// A strip lamp of 10 m by 1 mm, turned and at odd coordinates, emits to one side. Points of that side as near to its plane as half a millimetre get
/// light from all of it, points as far behind it none; wherever along it they are, 11 places on 40 lamps.
#[test]
fn thin_lamps_shine_to_their_side_alone() {
    let mut random = Random(8);
    for lamp in 0..40 {
        let mut point = || DVec3::from_array([0; 3].map(|_| 2.0 * random.unit() - 1.0));
        let (along, origin) = (point().normalize(), 3.0 * point());
        let across = along.cross(point()).normalize();
        let corner = |x: f64, y: f64| (origin + along * (10.0 * x) + across * (1e-3 * y)).as_vec3();
        let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        for corners in [[a, b, c], [a, c, d], [c, a, b]] {
            // The first light of `scene` is two-sided.
            let behind = [[0.0, 99.0, 0.0], [1.0, 99.0, 0.0], [0.0, 99.0, 1.0]];
            let triangles = [(behind, 1e-9), (corners.map(|p| p.to_array()), 1.0)];
            let lights = RenderScene::prepare(&scene(&triangles), BuildOptions::default()).unwrap().lights;
            let light = &lights.triangles[1];
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).normalize();
            for place in 0..=10 {
                let at = a.lerp(if place % 2 == 0 { b } else { c }, f64::from(place) / 10.0);
                for height in [5e-4, -5e-4] {
                    let p = (at + normal * height).as_vec3();
                    let seen = light.sample(p, (0.4, 0.3), light.pdf_area).is_some();
                    assert_eq!(seen, height > 0.0, "lamp {lamp}, place {place}, {height} off {corners:?}");
                }
            }
        }
    }
}

/// Stratified numbers stay stratified: of 64 lights of equal power each gets as many of 2^k Sobol points as any other.
#[test]
fn equal_lights_are_taken_equally_often() {
    let triangles: Vec<_> = (0..64u8)
        .map(|i| {
            let (x, y) = (f32::from(i % 8), f32::from(i / 8));
            ([[x, y, 3.0], [x, y + 1.0, 3.0], [x + 1.0, y, 3.0]], 1.0)
        })
        .collect();
    let mut scene = scene(&triangles);
    scene.materials.iter_mut().for_each(|m| m.double_sided = true);
    let lights = RenderScene::prepare(&scene, BuildOptions::default()).unwrap().lights;
    let pixel = PixelSampler::new(SamplerKind::Sobol, 5, 6, 0, 7);
    for vertex in [0, 1, 6, 9] {
        for samples in [64u32, 256, 1024] {
            let mut hits = [0; 64];
            for i in 0..samples {
                let [_, _, u, v] = pixel.sample(i.into()).get(Dimensions::segment(vertex));
                hits[taken(&lights, [u, v])] += 1;
            }
            assert!(hits.iter().all(|h| *h == samples / 64), "vertex {vertex}, {samples}: {hits:?}");
        }
    }
}

fn taken(lights: &Lights, u: [f32; 2]) -> usize {
    let frame = Frame::new(Vec3::Z);
    let sample = lights.sample::<_, FullClass, true>(Vec3::ZERO, &frame, u, &mut NoProbe).unwrap();
    match sample.target {
        LightTarget::Surface { primitive, .. } => primitive as usize,
        _ => unreachable!("there are only triangles"),
    }
}
