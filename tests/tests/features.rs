//! What a look at the pictures of `scenes/features` tells, by pixels: twins look alike, what moves is where it must be.
//!
//! A *portrait* shows one object of a file alone, seen from the front by an orthographic camera over its bounds (or a given
//! window), under a light of the test's own. Twins are sampled at the same film positions by the same random numbers, so
//! that little but rounding sets them apart: tolerances are stated with each.

use hotspot_integrator::{Instancing, PrepareOptions, RenderScene};
use hotspot_scene::{
    Camera, Environment, Light, LightKind, LoadOptions, Projection, Scene, load, load_environment,
};
use hotspot_tests::picture::{Picture, picture, settings};
use std::path::PathBuf;

fn path(file: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../scenes/features", file].iter().collect()
}

fn scene_with(name: &str, options: &LoadOptions) -> Scene {
    let scene = load(&path(&format!("{name}.gltf")), options).expect("the file loads");
    assert!(
        scene.unmodelled.is_empty() && scene.repairs.is_empty(),
        "{name}: {:?} {:?}",
        scene.unmodelled,
        scene.repairs
    );
    scene
}

fn scene(name: &str) -> Scene {
    scene_with(name, &LoadOptions::default())
}

/// The objects whose names satisfy `is`, alone.
fn alone(scene: &Scene, is: impl Fn(&str) -> bool) -> Scene {
    let mut alone = scene.clone();
    alone.instances.retain(|i| is(&scene.objects[i.object as usize].name));
    assert!(!alone.instances.is_empty(), "there is no such object");
    alone.lights.clear();
    alone.environment = Some(Environment::Constant([0.0; 3]));
    alone
}

/// Least and greatest corner in the world.
fn bounds(scene: &Scene) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for instance in &scene.instances {
        for p in &scene.meshes[instance.mesh as usize].positions {
            for (axis, row) in instance.to_world.iter().enumerate() {
                let x = (0..3).map(|i| row[i] * f64::from(p[i])).sum::<f64>() + row[3];
                bounds[0][axis] = bounds[0][axis].min(x);
                bounds[1][axis] = bounds[1][axis].max(x);
            }
        }
    }
    bounds
}

/// Sees 2 `half` x 2 `half` around (x, y) along -z.
fn window([x, y]: [f64; 2], half: f64) -> Camera {
    Camera {
        name: "test".into(),
        to_world: [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, 10.0]],
        projection: Projection::Orthographic { xmag: half, ymag: half },
    }
}

/// A window over the bounds, somewhat wider.
fn framing(scene: &Scene) -> Camera {
    let [lo, hi] = bounds(scene);
    let centre = [0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1])];
    window(centre, 0.52 * (hi[0] - lo[0]).max(hi[1] - lo[1]))
}

const EDGE: usize = 48;

fn render(scene: &Scene, camera: &Camera, spp: u32) -> Picture {
    render_wide(scene, camera, EDGE as u32, spp)
}

/// Of another width.
fn render_wide(scene: &Scene, camera: &Camera, width: u32, spp: u32) -> Picture {
    render_as(scene, camera, width, spp, Instancing::Auto)
}

/// With meshes stored as told.
fn render_as(scene: &Scene, camera: &Camera, width: u32, spp: u32, instancing: Instancing) -> Picture {
    let options = PrepareOptions { instancing, ..PrepareOptions::default() };
    let ready = RenderScene::prepare(scene, options).expect("the scene is whole");
    picture(&ready, camera, &settings(width, EDGE as u32, spp, 1, 7))
}

/// Parallel light from the upper left of irradiance π: a matte surface facing it shows its reflectance.
fn sunlit(mut scene: Scene) -> Scene {
    let direction = [0.5, -0.5, -0.5f32.sqrt()];
    scene.lights.push(Light {
        name: "test".into(),
        kind: LightKind::Directional { direction },
        intensity: [std::f32::consts::PI; 3],
    });
    scene
}

/// Light of radiance 1 from everywhere.
fn surrounded(mut scene: Scene) -> Scene {
    scene.environment = Some(Environment::Constant([1.0; 3]));
    scene
}

/// One object under parallel light.
fn portrait(scene: &Scene, object: &str) -> Picture {
    let alone = sunlit(alone(scene, |name| name == object));
    render(&alone, &framing(&alone), 16)
}

/// Mean and largest absolute difference of two pictures.
fn difference(a: &Picture, b: &Picture) -> (f64, f64) {
    let all = a.pixels.iter().flatten().zip(b.pixels.iter().flatten()).map(|(a, b)| (a - b).abs());
    let largest = all.clone().fold(0.0, f64::max);
    (all.sum::<f64>() / (3 * a.pixels.len()) as f64, largest)
}

#[track_caller]
fn alike(a: &Picture, b: &Picture, mean: f64, most: f64, what: &str) {
    assert!(a.max() > 0.05, "{what}: there is nothing to see");
    let (found, largest) = difference(a, b);
    assert!(found <= mean && largest <= most, "{what}: they differ by {found:.5}, at most by {largest:.5}");
}

fn luminance(p: &[f64; 3]) -> f64 {
    (p[0] + p[1] + p[2]) / 3.0
}

/// Share of the pixels that show something.
fn coverage(picture: &Picture) -> f64 {
    picture.pixels.iter().filter(|p| luminance(p) > 1e-4).count() as f64 / picture.pixels.len() as f64
}

/// Mean column and row of what shows, as positions in the window (-1..1, y upwards).
fn centroid(picture: &Picture) -> [f64; 2] {
    let (mut sum, mut weight) = ([0.0; 2], 0.0);
    for (i, p) in picture.pixels.iter().enumerate() {
        let w = f64::from(luminance(p) > 1e-4);
        let at = |i: usize| (i as f64 + 0.5) / EDGE as f64 * 2.0 - 1.0;
        sum = [sum[0] + w * at(i % EDGE), sum[1] - w * at(i / EDGE)];
        weight += w;
    }
    sum.map(|s| s / weight)
}

/// Mean colour of the pixels around a position of the window (-1..1, y upwards).
fn spot(picture: &Picture, [x, y]: [f64; 2]) -> [f64; 3] {
    let at = |c: f64| ((c + 1.0) / 2.0 * EDGE as f64) as usize;
    let (column, row) = (at(x), at(-y));
    let mut sum = [0.0; 3];
    for r in row - 1..=row + 1 {
        for c in column - 1..=column + 1 {
            sum.iter_mut().zip(picture.pixels[r * EDGE + c]).for_each(|(s, p)| *s += p / 9.0);
        }
    }
    sum
}

/// Rounding alone: hits, coordinates and texels agree.
const ROUNDING: f64 = 2e-3;
/// A sample more or less at an edge, of 16 in a pixel.
const EDGES: f64 = 0.15;

#[test]
fn texture_transforms_equal_coordinates() {
    let scene = scene("texture-transform");
    for case in ["offset", "rotation", "scale", "all"] {
        let a = portrait(&scene, &format!("Transform {case}"));
        let b = portrait(&scene, &format!("Coordinates {case}"));
        alike(&a, &b, ROUNDING, EDGES, case);
    }
    // And each case is one: they differ from each other.
    let (a, b) = (portrait(&scene, "Transform rotation"), portrait(&scene, "Transform offset"));
    assert!(difference(&a, &b).0 > 0.05);
}

#[test]
fn second_coordinates_equal_first() {
    let scene = scene("second-uvs");
    let (a, b) = (portrait(&scene, "First coordinates"), portrait(&scene, "Second coordinates"));
    alike(&a, &b, ROUNDING, EDGES, "second coordinates");
    // The upper left corner of the picture is red, the upper right green, the lower left blue.
    let largest = |p: [f64; 3]| (0..3).max_by(|i, j| p[*i].total_cmp(&p[*j])).unwrap();
    assert_eq!(largest(spot(&a, [-0.85, 0.85])), 0);
    assert_eq!(largest(spot(&a, [0.85, 0.85])), 1);
    assert_eq!(largest(spot(&a, [-0.85, -0.85])), 2);
    // Dark tiles and the glow on its own coordinates.
    let both = portrait(&scene, "Both");
    assert!(luminance(&spot(&both, [0.0, 0.0])) > luminance(&spot(&both, [0.85, 0.85])) + 0.2);
}

#[test]
fn wraps_show_what_they_should() {
    let scene = scene("texture-wrap");
    // From -0.75 to 1.75 across and -0.5 to 2 down: the whole picture spans -0.4..0.4 of the window, from 0.6 down to -0.2.
    let inside = |u: f64, v: f64| [(u - 0.5) / 1.25 / 1.04, (0.75 - v) / 1.25 / 1.04];
    let look = |name: &str, u: f64, v: f64| spot(&portrait(&scene, name), inside(u, v));
    let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.06);
    // A place in the red corner, and its images.
    let red = look("Repeat", 0.08, 0.08);
    assert!(red[0] > 4.0 * red[1], "{red:?}");
    for (name, u, v) in [
        ("Repeat", 1.08, 1.08),
        ("Mirror", -0.08, -0.08),
        ("Mirror", -0.08, 1.92),
        ("Clamp", -0.5, -0.3),
        ("Mirror across, clamp down", -0.08, -0.3),
    ] {
        let p = look(name, u, v);
        assert!(close(p, red), "{name} {u} {v}: {p:?} {red:?}");
    }
    assert!(!close(look("Clamp", 1.5, 1.5), red) && !close(look("Mirror", 1.08, 1.08), red));
}

#[test]
fn emissive_textures_equal_factors() {
    let scene = scene("emissive-texture");
    let (a, b) = (portrait(&scene, "By texture"), portrait(&scene, "By factors"));
    alike(&a, &b, ROUNDING, EDGES, "emission");
    assert!((a.max() - 0.5).abs() < 1e-3);
}

#[test]
fn metallic_roughness_textures_equal_factors() {
    let scene = scene("metallic-roughness-texture");
    let show = |object: &str| {
        let alone = surrounded(sunlit(alone(&scene, |name| name == object)));
        render(&alone, &framing(&alone), 256)
    };
    // Noise: the material of a mix is chosen at random; a few samples differ at the fields' borders.
    alike(&show("By texture"), &show("By factors"), 5e-3, 0.5, "metallic and roughness");
}

#[test]
fn vertex_colours_equal_factors() {
    let scene = scene("vertex-colors");
    let factors = portrait(&scene, "Factors");
    for kind in ["Floats", "Bytes", "Shorts"] {
        alike(&portrait(&scene, kind), &factors, ROUNDING, EDGES, kind);
    }
    let (white, grey) = (portrait(&scene, "Wheel"), portrait(&scene, "Wheel under grey"));
    for (w, g) in white.pixels.iter().flatten().zip(grey.pixels.iter().flatten()) {
        assert!((0.3 * w - g).abs() < 1e-4, "{w} {g}");
    }
}

/// Pearson's correlation of brightness.
fn correlation(a: &Picture, b: &Picture) -> f64 {
    let list = |p: &Picture| p.pixels.iter().map(luminance).collect::<Vec<_>>();
    let (a, b) = (list(a), list(b));
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let dot = |x: &[f64], mx: f64, y: &[f64], my: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum()
    };
    dot(&a, ma, &b, mb) / (dot(&a, ma, &a, ma) * dot(&b, mb, &b, mb)).sqrt()
}

#[test]
fn mapped_bumps_look_like_bumps() {
    let scene = scene("normal-map");
    let map = portrait(&scene, "Map");
    // The map's 8 bits are not symmetric about zero.
    for twin in ["Tangents", "Mirrored node", "Mirrored coordinates"] {
        alike(&portrait(&scene, twin), &map, 0.01, 0.15, twin);
    }
    let solid = portrait(&scene, "Triangles");
    // The frame around the bumps is alike in all, and counts too.
    let likeness = correlation(&map, &solid);
    assert!(likeness > 0.85, "mapped and solid bumps correlate by {likeness:.3}");
    let weak = portrait(&scene, "Scale 0.4");
    let contrast = |p: &Picture| luminance(&spot(p, [-0.1, 0.1])) - luminance(&spot(p, [0.1, -0.1]));
    assert!(contrast(&map) > 2.0 * contrast(&weak) && contrast(&weak) > 0.05);
}

#[test]
fn masks_cut_out_what_they_should() {
    let scene = scene("alpha-mask");
    let show = |object: &str| {
        let alone = surrounded(alone(&scene, |name| name == object));
        let [lo, hi] = bounds(&alone);
        let centre = [0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1])];
        render(&alone, &window(centre, 0.4), 64)
    };
    let (mask, triangles) = (show("Mask"), show("Triangles"));
    // The texture's contour is that of a ring within a texel's fraction.
    alike(&mask, &triangles, 0.01, 0.4, "ring");
    // Through the hole and beyond the edge shows the environment; the ring is green.
    for at in [[0.0, 0.0], [0.93, 0.93]] {
        assert!(spot(&mask, at).iter().all(|c| (c - 1.0).abs() < 1e-3));
    }
    let green = spot(&mask, [0.65, 0.0]);
    assert!((green[1] - 0.5).abs() < 0.02 && (green[0] - 0.16).abs() < 0.02, "{green:?}");
    // Where alpha = 1 - r >= cutoff.
    for cutoff in [0.25, 0.5, 0.75] {
        let picture = show(&format!("Cutoff {cutoff}"));
        // Blue reflects a twentieth.
        let covered = picture.pixels.iter().map(|p| (1.0 - p[2]).min(1.0) / (1.0 - 0.0452)).sum::<f64>();
        let share = covered / (EDGE * EDGE) as f64;
        let expected = std::f64::consts::PI / 4.0 * (1.0 - cutoff) * (1.0 - cutoff);
        assert!((share - expected).abs() < 0.015, "cutoff {cutoff}: {share:.4}, expected {expected:.4}");
    }
}

#[test]
fn blending_is_linear_in_alpha() {
    let scene = scene("alpha-blend");
    for alpha in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let alone = surrounded(alone(&scene, |name| name == format!("Alpha {alpha}")));
        let picture = render(&alone, &framing(&alone), 256);
        let middle = spot(&picture, [0.0, 0.0]);
        for (c, color) in middle.into_iter().zip([0.8, 0.15, 0.1]) {
            // 9 pixels of 256 samples: four standard deviations.
            let (expected, deviation) = (1.0 - alpha * (1.0 - color), (1.0 - color) * 0.5 / 48.0);
            assert!((c - expected).abs() < 4.0 * deviation + 1e-3, "alpha {alpha}: {c} {expected}");
        }
    }
}

#[test]
fn ways_to_store_a_shape_agree() {
    let sparse = scene("sparse-accessor");
    alike(&portrait(&sparse, "Sparse"), &portrait(&sparse, "Plain"), ROUNDING, EDGES, "sparse");
    assert!(coverage(&portrait(&sparse, "Sparse over nothing")) > 0.8);
    let quantized = scene("mesh-quantization");
    let plain = portrait(&quantized, "Plain");
    // Normals of 8 bits; positions of 8 bits are off by up to a 500th.
    alike(&portrait(&quantized, "Shorts"), &plain, 5e-3, 0.2, "shorts");
    alike(&portrait(&quantized, "Bytes"), &plain, 0.01, 0.4, "bytes");
    let strips = scene("strips-fans");
    for kind in ["Strip", "Fan"] {
        let (a, b) = (portrait(&strips, kind), portrait(&strips, &format!("{kind} as triangles")));
        alike(&a, &b, ROUNDING, EDGES, kind);
        // Some of it emits towards the viewer: nothing of it is turned away.
        assert!(a.pixels.iter().all(|p| luminance(p) < 1e-4 || p[1] > 0.01), "{kind}");
    }
}

#[test]
fn mirrored_nodes_equal_mirrored_data() {
    let scene = scene("mirrored-node");
    let (a, b) = (portrait(&scene, "Mirrored by its node"), portrait(&scene, "Mirrored in its data"));
    alike(&a, &b, ROUNDING, EDGES, "mirrored");
    // The one-sided lamp still faces the viewer.
    assert!(a.max() > 0.75);
    let plain = portrait(&scene, "Plain");
    assert!(difference(&a, &plain).0 > 0.05, "it is mirrored");
}

#[test]
fn instances_equal_nodes() {
    let scene = scene("gpu-instancing");
    let show = |prefix: &str| {
        let alone = sunlit(alone(&scene, |name| name.starts_with(prefix)));
        assert_eq!(alone.instances.len(), 16, "{prefix}");
        render(&alone, &framing(&alone), 16)
    };
    alike(&show("Instanced"), &show("Twin"), ROUNDING, EDGES, "instances");
    let nodes = self::scene("instances");
    assert_eq!(nodes.instances.len(), 200 + 3);
    assert_eq!(nodes.meshes.len(), 4, "one mesh for all");
}

/// Mirrored, mapped, coloured, cut out, scaled: whether a mesh is copied or placed makes no difference.
#[test]
fn meshes_stored_once_look_like_copies() {
    for (name, object) in [
        ("mirrored-node", "Mirrored by its node"),
        ("normal-map", "Mirrored node"),
        ("normal-map", "Mirrored coordinates"),
        ("vertex-colors", "Wheel"),
        ("alpha-mask", "Leaning"),
        ("second-uvs", "Both"),
        ("mesh-quantization", "Shorts"),
        ("instances", "Pawn 0"),
    ] {
        let mut alone = sunlit(alone(&scene(name), |n| n == object));
        let camera = framing(&alone);
        // A second one out of sight, since what appears once is never placed.
        let mut away = alone.instances[0].clone();
        away.to_world[0][3] += 50.0;
        alone.instances.push(away);
        let show = |instancing| render_as(&alone, &camera, EDGE as u32, 16, instancing);
        // Rays are moved instead of triangles: rounding differs.
        alike(&show(Instancing::Always), &show(Instancing::Never), ROUNDING, EDGES, object);
    }
}

/// The x positions of the three cubes, found in pictures, and the direction of the bar.
fn cubes_at(time: f64) -> [f64; 3] {
    let scene = scene_with("animation", &LoadOptions { time: Some(time), ..LoadOptions::default() });
    ["LINEAR", "STEP", "CUBICSPLINE"].map(|mode| {
        let alone = sunlit(alone(&scene, |name| name == mode));
        1.6 * centroid(&render(&alone, &window([0.0, 0.95], 1.6), 16))[0]
    })
}

#[test]
fn animations_are_where_they_must_be() {
    for (time, expected) in [
        (-1.0, [-1.2, -1.2, -1.2]),
        (0.5, [-0.6, -1.2, -0.6]),
        (1.0, [0.0, 0.0, 0.0]),
        // 1.2 (3 u² - 2 u³) at u = 0.25.
        (1.25, [0.3, 0.0, 0.1875]),
        (1.75, [0.9, 0.0, 1.0125]),
        (7.0, [1.2, 1.2, 1.2]),
    ] {
        let found = cubes_at(time);
        for (found, expected) in found.into_iter().zip(expected) {
            // Half a pixel.
            assert!((found - expected).abs() < 0.034, "at {time} s: {found} instead of {expected}");
        }
    }
}

#[test]
fn skins_bend() {
    let scene = scene("skin");
    alike(&portrait(&scene, "Rest"), &portrait(&scene, "Plain twin"), ROUNDING, EDGES, "rest");
    let covers = |object: &str, foot: f64, along: f64, up: f64| {
        let alone = surrounded(alone(&scene, |name| name == object));
        let picture = render(&alone, &window([foot + along, 0.2 + up], 0.04), 4);
        // Against white surroundings.
        picture.mean()[2] < 0.9
    };
    let s = 0.5f64.sqrt();
    // Along the lower half, along the bent upper one short of its end, and not beyond it.
    for (x, object, [dx, dy]) in
        [(-0.2, "Bent by an eighth", [s, s]), (0.6, "Bent softly by a quarter", [1.0, 0.0])]
    {
        assert!(covers(object, x, 0.0, 0.1), "{object}");
        assert!(covers(object, x, 0.45 * dx, 0.5 + 0.45 * dy), "{object}");
        assert!(!covers(object, x, 0.56 * dx, 0.5 + 0.56 * dy), "{object}");
        assert!(!covers(object, x, 0.0, 0.9), "{object}");
    }
}

#[test]
fn morph_targets_blend() {
    let scene = scene("morph");
    for (name, mean) in [("Weight 0", ROUNDING), ("Weight 1 of the mesh", ROUNDING), ("Weight 0.5", 0.02)] {
        // The normals of a half are the mean of the whole's: not quite those of the shape between.
        alike(&portrait(&scene, name), &portrait(&scene, &format!("{name}, twin")), mean, 0.2, name);
    }
    // The sheared outline is that of its twin.
    let (both, twin) = (portrait(&scene, "Both"), portrait(&scene, "Both, twin"));
    alike(&both, &twin, 0.03, 0.25, "both");
}

#[test]
fn specular_glossiness_equals_its_twin() {
    let scene = scene("specular-glossiness");
    for (a, b) in
        [("Glossiness 0.4", "Roughness 0.6"), ("Glossiness 0.9", "Roughness 0.1"), ("Specular 0", "Matte")]
    {
        alike(&portrait(&scene, a), &portrait(&scene, b), ROUNDING, EDGES, a);
    }
}

#[test]
fn variants_change_the_material() {
    for (variant, sample) in [("Beach", "Beach sample"), ("Street", "Street sample")] {
        let options = LoadOptions { variant: Some(variant.into()), ..LoadOptions::default() };
        let scene = scene_with("material-variants", &options);
        let (a, b) = (portrait(&scene, "Changing"), portrait(&scene, sample));
        // Spheres of different fineness.
        alike(&a, &b, 0.02, 0.4, variant);
    }
    let plain = portrait(&scene("material-variants"), "Changing");
    let [r, g, b] = spot(&plain, [-0.3, 0.3]);
    assert!((r - g).abs() < 1e-3 && (g - b).abs() < 1e-3, "plain is grey");
}

#[test]
fn an_orthographic_camera_keeps_sizes() {
    let scene = scene("orthographic");
    let camera = scene.cameras[0].clone();
    let shares: Vec<f64> = (0..5)
        .map(|i| {
            let alone = surrounded(alone(&scene, |name| name == format!("Cube {i}")));
            // Whatever its paint, a cube is darker than its surroundings.
            let picture = render_wide(&alone, &camera, 72, 64);
            picture.pixels.iter().map(|p| f64::from(u8::from(p[1] < 0.65))).sum()
        })
        .collect();
    for share in &shares {
        // A cube covers some 80 pixels, an edge of 8 more or less.
        assert!((share - shares[0]).abs() <= 9.0 && *share > 60.0, "{shares:?}");
    }
}

/// The sun of `sky.hdr` stands ahead on the left: the block's shadow falls towards the viewer's right.
#[test]
fn the_sky_throws_shadows_away_from_its_sun() {
    let mut scene = scene("environment");
    let (sky, repairs) = load_environment(&path("sky.hdr"), &LoadOptions::default()).expect("the sky loads");
    assert!(repairs.is_empty() && (sky.width, sky.height) == (64, 32));
    scene.environment = Some(Environment::Map(sky));
    scene.instances.retain(|i| ["Ground", "Block"].contains(&scene.objects[i.object as usize].name.as_str()));
    let from_above = |x: f64, z: f64| Camera {
        name: "test".into(),
        to_world: [[1.0, 0.0, 0.0, x], [0.0, 0.0, 1.0, 10.0], [0.0, -1.0, 0.0, z]],
        projection: Projection::Orthographic { xmag: 0.05, ymag: 0.05 },
    };
    // The block stands at (0.4, 0.7), 0.5 high; the sun is 40 degrees up, at 45 degrees to the left of ahead.
    let [shadow, left, right] = [(0.6, 0.9), (0.2, 0.9), (0.6, 0.5)]
        .map(|(x, z)| luminance(&render(&scene, &from_above(x, z), 64).mean()));
    assert!(shadow < 0.6 * left && shadow < 0.6 * right, "{shadow} {left} {right}");
}

/// Radiance of the floor under the spot: by its intensity, distance and cone.
#[test]
fn the_spot_lights_its_cone() {
    let mut scene = scene("lights-punctual");
    scene.environment = None;
    scene.lights.retain(|light| matches!(light.kind, LightKind::Spot { .. }));
    let at = |radius: f64| {
        // Below the roof, beside the pole.
        let camera = Camera {
            name: "test".into(),
            to_world: [[1.0, 0.0, 0.0, -radius], [0.0, 0.0, 1.0, 1.4], [0.0, -1.0, 0.0, 0.1]],
            projection: Projection::Orthographic { xmag: 0.01, ymag: 0.01 },
        };
        render(&scene, &camera, 16).mean()[1]
    };
    let albedo = 0.62;
    for radius in [0.05, 0.2, 0.3, 0.4, 0.47, 0.53] {
        let distance = f64::hypot(1.5, radius);
        let cos = 1.5 / distance;
        let (inner, outer) = (1.5 / f64::hypot(1.5, 0.25), 1.5 / f64::hypot(1.5, 0.5));
        let fade = ((cos - outer) / (inner - outer)).clamp(0.0, 1.0);
        let expected =
            albedo / std::f64::consts::PI * 12.0 * 0.85 * fade * fade * cos / (distance * distance);
        let found = at(radius);
        assert!(
            (found - expected).abs() < 0.02 * expected + 2e-3,
            "at {radius} m: {found} instead of {expected}"
        );
    }
}

#[test]
fn the_obj_shows_its_features() {
    let scene = load(&path("obj-features.obj"), &LoadOptions::default()).expect("the file loads");
    assert!(
        scene.unmodelled.is_empty() && scene.repairs.is_empty(),
        "{:?} {:?}",
        scene.unmodelled,
        scene.repairs
    );
    // Concave polygons keep their areas: ten triangles of sides 0.32 and 0.13 around the star's centre; a block less a notch.
    let star = 5.0 * 0.32 * 0.13 * (std::f64::consts::PI / 5.0).sin();
    let letter = 0.64 * (0.6 * 0.7 - 0.24 * 0.52);
    for (object, expected) in [("Star", star), ("Letter_U", letter)] {
        let alone = sunlit(alone(&scene, |name| name == object));
        let camera = framing(&alone);
        let Projection::Orthographic { ymag, .. } = camera.projection else { unreachable!() };
        let picture = render(&alone, &camera, 64);
        let full = picture.max();
        let lit: f64 = picture.pixels.iter().map(|p| p[0] / full).sum();
        let area = lit / (EDGE * EDGE) as f64 * 4.0 * ymag * ymag;
        assert!((area / expected - 1.0).abs() < 0.03, "{object}: {area:.4} instead of {expected:.4}");
    }
    // Corners: red, green, blue and white, counter-clockwise from the lower left.
    let colors = portrait(&scene, "Colours");
    let [red, green, blue, white] =
        [[-0.85, -0.85], [0.85, -0.85], [0.85, 0.85], [-0.85, 0.85]].map(|at| spot(&colors, at));
    assert!(red[0] > 3.0 * red[1] && green[1] > 3.0 * green[2] && blue[2] > 3.0 * blue[0]);
    assert!(white.iter().all(|c| *c > 2.0 * red[1]), "{white:?}");
    // Shading of the smooth ball changes from pixel to pixel, that of the faceted one at edges alone.
    let flat_share = |object: &str| {
        let picture = portrait(&scene, object);
        let row = &picture.pixels[EDGE / 2 * EDGE + 8..EDGE / 2 * EDGE + EDGE - 8];
        row.windows(2).filter(|p| (luminance(&p[0]) - luminance(&p[1])).abs() < 1e-4).count()
    };
    assert!(
        flat_share("Faceted") > 15 && flat_share("Smooth") < 8,
        "{} {}",
        flat_share("Faceted"),
        flat_share("Smooth")
    );
}
