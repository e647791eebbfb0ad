//! Cost baked on surfaces: nothing is lost, nothing depends on threads, and it lies where rays land.

use hotspot_cost::surface::SurfaceCounts;
use hotspot_cost::{Counter, Frame};
use hotspot_integrator::{
    BakeView, Baked, Control, Instancing, Isa, LightChoice, MeshError, PrepareOptions, RenderScene, Settings,
    SurfaceMesh, bake, surface_view, viewpoints,
};
use hotspot_scene::{Camera, Scene};
use hotspot_tests::picture::{self, frame};
use hotspot_tests::reference::own_scene;
use hotspot_tests::world::{
    World, cuboid, light, matte, mirror, pencil, pinhole, rectangle, sphere, substrate,
};

/// Depth 15, seed 1.
fn settings(width: u32, height: u32, spp: u32) -> Settings {
    picture::settings(width, height, spp, 15, 1)
}

fn prepared(scene: &Scene, instancing: Instancing) -> RenderScene {
    RenderScene::prepare(scene, PrepareOptions { instancing, ..PrepareOptions::default() }).unwrap()
}

fn baked(scene: &RenderScene, detail: u32, view: BakeView<'_>, settings: &Settings) -> (SurfaceMesh, Baked) {
    let mesh = SurfaceMesh::new(scene, detail, None).unwrap();
    let baked = bake(scene, &mesh, view, settings, Control::default());
    (mesh, baked)
}

fn sum(frame: &Frame, counter: Counter) -> u64 {
    frame.costs().map(|pixel| pixel.get(counter)).sum()
}

/// Booked and escaped are what a render of the same settings counts, to the last node, for every class of kernel.
fn agrees(scene: &RenderScene, camera: &Camera, settings: &Settings, detail: u32) -> Baked {
    let (_, baked) = baked(scene, detail, BakeView::Camera(camera), settings);
    let rendered = frame(scene, camera, settings);
    let landed = baked.sums.total();
    let mut all = landed;
    all.add(&baked.escaped);
    let expected = SurfaceCounts {
        rays: sum(&rendered.frame, Counter::Rays) - sum(&rendered.frame, Counter::RaysShadow),
        nodes: sum(&rendered.frame, Counter::Nodes),
        shapes: sum(&rendered.frame, Counter::Shapes),
    };
    assert_eq!(all, expected);
    assert_eq!(
        baked.escaped.rays,
        sum(&rendered.frame, Counter::Escaped),
        "an escaped path has one such ray"
    );
    assert!(landed.rays > 0 && landed.nodes + landed.shapes > 0);
    baked
}

#[test]
fn nothing_is_lost() {
    for (name, detail) in [("cornell-box-red", 16), ("mirror-gap-wide", 0), ("creature", 8)] {
        let scene = own_scene(name).expect("the checkout has its scenes");
        let camera = scene.cameras[0].clone();
        let settings = settings(40, 30, 6);
        agrees(&prepared(&scene, Instancing::Auto), &camera, &settings, detail);
    }
    // Instances, holes of the environment, learned lights.
    let (world, camera) = balls();
    let scene = prepared(&world.scene, Instancing::Always);
    assert!(scene.instance_count() > 0);
    agrees(&scene, &camera, &settings(24, 24, 5), 10);
    let mut learned = settings(24, 24, 2);
    learned.light_choice = LightChoice::Learned;
    agrees(&scene, &camera, &learned, 10);
}

/// Balls of one mesh under a lamp, one of them mirrored.
fn balls() -> (World, Camera) {
    let at = |x: f64, s: f64| [[s, 0.0, 0.0, x], [0.0, 1.0, 0.1, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let world = World::new()
        .with_environment([0.2; 3])
        .with_placed(sphere([0.0; 3], 0.5, 2, false), matte([0.5; 3]), at(-1.0, 1.0))
        .with_again(substrate([0.4; 3], 0.05, 0.2), at(0.4, -1.0))
        .with_again(mirror([0.9; 3]), at(1.4, 0.7))
        .with(rectangle([0.0, 2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]), light([5.0; 3]));
    (world, pinhole([0.0, 0.5, 4.0], [0.0; 3], 40.0))
}

#[test]
fn threads_and_instruction_sets_do_not_matter() {
    let (world, camera) = balls();
    let points = viewpoints(&prepared(&world.scene, Instancing::Never), 5);
    let of = |isa, threads: usize, around: bool| {
        let mut options = PrepareOptions::default();
        options.tree.isa = isa;
        let scene = RenderScene::prepare(&world.scene, options).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let view = if around { BakeView::Points(&points) } else { BakeView::Camera(&camera) };
        let (mesh, baked) = pool.install(|| baked(&scene, 20, view, &settings(20, 20, 7)));
        let vertices: Vec<_> = (0..mesh.vertex_count()).map(|v| baked.sums.vertex(v)).collect();
        (mesh.positions().to_vec(), vertices, baked.escaped)
    };
    for around in [false, true] {
        assert_eq!(of(Isa::Auto, 1, around), of(Isa::Portable, 3, around));
    }
}

/// All paths along one line: what lands on a floor lands at one point of it, and its vertices around that point get it all.
#[test]
fn cost_lies_where_rays_land() {
    let floor = rectangle([0.0; 3], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]);
    let scene = World::new().with_environment([1.0; 3]).with(floor, matte([0.0; 3])).prepare();
    let camera = pencil([1.3, 5.0, -0.7], [1.3, 0.0, -0.7]);
    for detail in [0, 9, 40] {
        let (mesh, baked) = baked(&scene, detail, BakeView::Camera(&camera), &settings(4, 4, 4));
        assert_eq!(baked.sums.total().rays, 64);
        let (mut middle, mut far) = ([0.0; 3], 0.0f64);
        for (vertex, position) in mesh.positions().iter().enumerate() {
            let rays = baked.sums.vertex(vertex).rays() / 64.0;
            let position = position.map(f64::from);
            for axis in 0..3 {
                middle[axis] += rays * position[axis];
            }
            if rays > 0.0 {
                far = far.max((position[0] - 1.3).hypot(position[2] + 0.7));
            }
        }
        // Weights are parts of 2^16, of triangles of at most 11.4.
        assert!((middle[0] - 1.3).abs() < 4e-4 && (middle[2] + 0.7).abs() < 4e-4, "{detail}: {middle:?}");
        let edge = if detail == 0 { 8.0 * 2f64.sqrt() } else { 8.0 * 2f64.sqrt() / f64::from(detail) };
        assert!(far <= edge * 1.001, "{detail}: {far} of {edge}");
    }
}

/// The pieces of split triangles cover them exactly, without seams and on the right side.
#[test]
fn pieces_cover_what_they_are_pieces_of() {
    let (world, _) = balls();
    let world = world.with(cuboid([-2.0, -1.0, -2.0], [2.0, -0.6, 2.0], false), matte([0.5; 3]));
    for instancing in [Instancing::Never, Instancing::Always] {
        let scene = prepared(&world.scene, instancing);
        let area = |detail: u32| {
            let mesh = SurfaceMesh::new(&scene, detail, None).unwrap();
            let mut all = 0.0;
            for part in mesh.parts() {
                for triangle in mesh.triangles(part) {
                    assert!(triangle.iter().all(|v| part.vertices.contains(&(*v as usize))));
                    let [a, b, c] = triangle.map(|v| mesh.positions()[v as usize].map(f64::from));
                    let [u, v] = [b, c].map(|p| [0, 1, 2].map(|i| p[i] - a[i]));
                    let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                    let size = n.iter().map(|c| c * c).sum::<f64>().sqrt();
                    all += 0.5 * size;
                    // Balls and the box are convex: away from the part's middle. The lamp is flat.
                    let count = part.vertices.len() as f64;
                    let middle = [0, 1, 2].map(|i| {
                        part.vertices.clone().map(|v| f64::from(mesh.positions()[v][i])).sum::<f64>() / count
                    });
                    let outward: f64 = (0..3).map(|i| n[i] * (a[i] - middle[i])).sum();
                    assert!(outward > -1e-6 * size, "{part:?} faces inward");
                }
            }
            (all, mesh.vertex_count())
        };
        let (whole, few) = area(0);
        let (pieces, many) = area(60);
        assert!((whole / pieces - 1.0).abs() < 1e-5 && many > 3 * few, "{whole} {pieces} {few} {many}");
    }
}

#[test]
fn viewpoints_lie_in_the_open() {
    // A closed room with a solid block in its middle that fills an eighth.
    let world = World::new()
        .with(cuboid([0.0; 3], [2.0; 3], true), one_sided())
        .with(cuboid([0.5; 3], [1.5; 3], false), one_sided());
    let scene = world.prepare();
    let points = viewpoints(&scene, 40);
    assert_eq!(points.len(), 40);
    for point in &points {
        let inside = point.iter().all(|c| (0.5..=1.5).contains(c));
        assert!(point.iter().all(|c| (0.0..=2.0).contains(c)) && !inside, "{point:?}");
    }
    assert_eq!(points, viewpoints(&scene, 40));
    // One flat triangle: the axis across it is widened, so that it is seen.
    let flat =
        World::new().with(rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), matte([0.5; 3])).prepare();
    assert_eq!(viewpoints(&flat, 8).len(), 8);
}

fn one_sided() -> hotspot_scene::Material {
    hotspot_scene::Material { double_sided: false, ..matte([0.5; 3]) }
}

#[test]
fn what_cannot_be_baked_on_is_refused() {
    let empty = prepared(&Scene::default(), Instancing::Auto);
    assert_eq!(SurfaceMesh::new(&empty, 10, None).unwrap_err(), MeshError::Empty);
    let (world, _) = balls();
    let scene = world.prepare();
    let error = SurfaceMesh::new(&scene, 100_000, Some(1 << 20)).unwrap_err();
    assert!(
        matches!(error, MeshError::TooLarge { .. }) && error.to_string().contains("limit of 1 MiB"),
        "{error}"
    );
    // Huge and tiny: coordinates at the ends of f32.
    for scale in [1e30, 1e-20] {
        let quad = rectangle([0.0; 3], [scale, 0.0, 0.0], [0.0, scale, 0.0]);
        let scene = World::new().with_environment([1.0; 3]).with(quad, matte([0.5; 3])).prepare();
        let camera = pinhole([0.0, 0.0, 3.0 * scale], [0.0; 3], 40.0);
        agrees(&scene, &camera, &settings(8, 8, 2), 30);
        let points = viewpoints(&scene, 3);
        let (mesh, baked) = baked(&scene, 30, BakeView::Points(&points), &settings(8, 8, 2));
        assert_eq!(baked.paths, 128);
        assert!(mesh.positions().iter().flatten().all(|c| c.is_finite()));
    }
}

#[test]
fn a_view_of_the_values_interpolates_them() {
    let wall = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let scene = World::new().with_environment([1.0; 3]).with(wall, matte([0.5; 3])).prepare();
    let mesh = SurfaceMesh::new(&scene, 7, None).unwrap();
    let values: Vec<f32> = mesh.positions().iter().map(|p| 2.0 + p[0]).collect();
    let camera = pinhole([0.0, 0.0, 2.0], [0.0; 3], 2.0 * 45f64);
    let view = surface_view(&scene, &mesh, &values, &camera, (8, 8));
    for (i, value) in view.iter().enumerate() {
        let (x, y) = ((i % 8) as f32 * 0.5 - 1.75, (i / 8) as f32 * 0.5 - 1.75);
        let expected = if x.abs() < 1.0 && y.abs() < 1.0 { 2.0 + x } else { 0.0 };
        assert!((value - expected).abs() < 1e-4, "{i}: {value} {expected}");
    }
}
