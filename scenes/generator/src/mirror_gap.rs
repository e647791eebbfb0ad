//! A plain room with a framed mirror hanging 6 cm or 4 mm in front of its wall (the paper's Figure 4).
//!
//! Glass and frame reflect on all sides and the wall is bright, so that paths that get behind the mirror stay there
//! for long. Both scenes have the same buffer: only the translation of the node "Wall mirror" differs.

use crate::furniture as f;
use crate::gltf_writer::{Place, Scene, Surface, substrate};
use crate::math::{Affine, X, Y, Z, v};
use crate::shapes::{cuboid, cylinder, join, quad, rounded_box};

pub(crate) fn scene(name: &'static str, gap: f64) -> Scene {
    let mut s = Scene::new(name);
    // The wall behind the mirror is the brightest: what enters the gap is not absorbed soon.
    let bright = s.material("Mirror wall paint", Surface::Matte([0.90, 0.885, 0.85]));
    let wall = s.material("Wall paint", Surface::Matte([0.50, 0.48, 0.45]));
    let floor = s.material("Floor boards", Surface::Matte([0.34, 0.235, 0.15]));
    let side = s.material("Sage paint", Surface::Matte([0.26, 0.36, 0.30]));
    let glass = s.material("Mirror glass", Surface::Metal { base: [0.96, 0.96, 0.96], roughness: 0.0 });
    let silver =
        s.material("Mirror frame silver", Surface::Metal { base: [0.93, 0.90, 0.84], roughness: 0.3 });
    let wood = s.material("Sideboard oak", Surface::Matte([0.50, 0.34, 0.20]));
    let dark = s.material("Dark metal", Surface::Matte([0.06, 0.06, 0.065]));
    let clay = s.material("Vase glaze", substrate([0.10, 0.22, 0.34], 0.3));
    let leaf = s.material("Leaf", Surface::Matte([0.10, 0.24, 0.08]));
    let terracotta = s.material("Terracotta", Surface::Matte([0.55, 0.27, 0.16]));
    let twig = s.material("Twig", Surface::Matte([0.22, 0.14, 0.09]));
    let bud = s.material("Bud", Surface::Matte([0.85, 0.72, 0.68]));
    let wool = s.material("Rug wool", Surface::Matte([0.55, 0.47, 0.40]));
    let door = s.material("Door paint", Surface::Matte([0.30, 0.36, 0.44]));
    let palette = [
        s.material("Red book", Surface::Matte([0.50, 0.10, 0.08])),
        s.material("Blue book", Surface::Matte([0.09, 0.18, 0.36])),
        s.material("Cream book", Surface::Matte([0.72, 0.64, 0.48])),
        s.material("Green book", Surface::Matte([0.12, 0.28, 0.18])),
    ];
    let lamp = s.material("Ceiling lamp", Surface::Light { base: [0.0; 3], radiance: [19.0, 18.0, 16.5] });

    // The room: x -2.2 .. 2.2, y 0 .. 2.6, z 0 .. 4.4, all sides closed.
    let (w, h, d) = (2.2, 2.6, 4.4);
    s.add("Mirror wall", quad(v(-w, 0.0, 0.0), X * (2.0 * w), Y * h), bright);
    s.add("Left wall", quad(v(-w, 0.0, d), Z * -d, Y * h), wall);
    s.add("Right wall", quad(v(w, 0.0, 0.0), Z * d, Y * h), side);
    s.add("Rear wall", quad(v(w, 0.0, d), X * (-2.0 * w), Y * h), wall);
    s.add("Floor", quad(v(-w, 0.0, d), X * (2.0 * w), Z * -d), floor);
    s.add("Ceiling", quad(v(-w, h, 0.0), X * (2.0 * w), Z * d), wall);
    s.add("Skirting", cuboid(v(-w, 0.0, 0.0005), v(w, 0.09, 0.014)), bright);
    s.add("Ceiling lamp", quad(v(-0.7, h - 0.01, 1.0), X * 1.4, Z * 0.7), lamp);

    // The mirror: 1.5 m x 1.05 m with its frame; the plate is 6 mm thick and closes the frame's back.
    let (mw, mh, bar) = (1.5, 1.05, 0.045);
    let (gw, gh) = (mw / 2.0 - bar, mh / 2.0 - bar);
    let plate = cuboid(v(-gw, -gh, 0.0), v(gw, gh, 0.006));
    let parts = vec![(plate, glass), (f::frame(mw, mh, bar, 0.03), silver)];
    s.place("Wall mirror", parts, Place::at(v(0.0, 1.55, gap)));

    // Below it a sideboard with vase, books, bowl.
    let board = join([
        rounded_box(v(1.7, 0.48, 0.38), 0.008, 2).at(0.0, 0.42, 0.0),
        rounded_box(v(0.545, 0.44, 0.012), 0.004, 1).at(-0.56, 0.42, 0.191),
        rounded_box(v(0.545, 0.44, 0.012), 0.004, 1).at(0.0, 0.42, 0.191),
        rounded_box(v(0.545, 0.44, 0.012), 0.004, 1).at(0.56, 0.42, 0.191),
    ]);
    s.place("Sideboard", vec![(board, wood)], Place::at(v(0.1, 0.0, 0.27)));
    let fittings = join(
        [-0.74, -0.1, 0.1, 0.74]
            .map(|x| cylinder(0.013, 0.18, 0.003, 14).at(x, 0.0, 0.13))
            .into_iter()
            .chain([-0.74, -0.1, 0.1, 0.74].map(|x| cylinder(0.013, 0.18, 0.003, 14).at(x, 0.0, -0.13))),
    );
    s.place("Sideboard feet", vec![(fittings, dark)], Place::at(v(0.1, 0.0, 0.27)));
    s.place("Vase", vec![(f::vase(0.30, 0.095, 32), clay)], Place::at(v(-0.42, 0.66, 0.27)));
    let (twigs, buds) = f::twigs(9, 0.62, 3);
    s.place("Blossom twigs", vec![(twigs, twig), (buds, bud)], Place::at(v(-0.42, 0.86, 0.27)));
    s.place("Bowl", vec![(f::bowl(0.14, 0.08, 40), dark)], Place::at(v(0.28, 0.66, 0.30)));
    let parts = f::books(0.30, 4, 11).into_iter().zip(palette).collect();
    s.place("Books", parts, Place::at(v(0.58, 0.661, 0.36)));

    // Left and right of it.
    let (pot, stems, leaves) = f::plant(1.15, 17, 5);
    s.place(
        "Potted plant",
        vec![(pot, terracotta), (stems, twig), (leaves, leaf)],
        Place::at(v(1.45, 0.0, 0.5)),
    );
    let (frame, rest) = f::chair();
    s.place("Chair", vec![(frame, dark), (rest, wood)], Place::turned(v(-1.45, 0.0, 0.75), 0.08));
    s.place("Rug", vec![(f::rug(2.2, 1.5), wool)], Place::at(v(0.0, 0.0, 1.7)));

    // What the mirror shows: a door, a bookcase, a picture.
    let leaf_of_door = join([
        rounded_box(v(0.9, 2.05, 0.04), 0.006, 1).at(0.0, 1.03, 0.02),
        f::frame(1.06, 2.15, 0.08, 0.05).at(0.0, 1.07, 0.0),
    ]);
    let turned = |x: f64, turns: f64| Affine::rotate(Y, turns).at(x, 0.0, d - 0.001);
    s.add("Door", leaf_of_door.moved(turned(-1.2, 0.5)), door);
    let case = f::bookcase(1.3, 1.9, 0.28, 5).moved(turned(0.9, 0.5));
    s.add("Bookcase", case, wood);
    let mut rows = vec![crate::shapes::Mesh::default(); palette.len()];
    for (shelf, seed) in (0..5).zip([21, 22, 23, 24, 25]) {
        let y = 0.023 + f64::from(shelf) * (1.9 - 0.022) / 5.0;
        let width = [1.2, 0.8, 1.1, 0.95, 0.6][shelf as usize];
        for (row, mesh) in rows.iter_mut().zip(f::books(width, palette.len(), seed)) {
            row.add(&mesh.at(-0.615, y, 0.22).moved(turned(0.9, 0.5)));
        }
    }
    s.place("Bookcase books", rows.into_iter().zip(palette).collect(), Place::Here);

    s.look(v(-0.80, 1.42, 2.85), v(0.06, 1.22, 0.0), 42.0, 4.0 / 3.0);
    s
}
