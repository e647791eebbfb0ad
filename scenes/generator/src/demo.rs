//! The scene inside the binary (`demo.glb`): the corner of a room with a big wall mirror that hangs 6 cm in front of
//! its wall, a lacquered table with a sculpture of the creature, a window and a dim sky.
//!
//! Composed for 16:9; the hotspots are the mirror's gap and the sculpture.

use crate::creature;
use crate::furniture as f;
use crate::gltf_writer::{Place, Scene, Surface, substrate};
use crate::math::{Affine, X, Y, Z, v};
use crate::shapes::{Mesh, cuboid, cylinder, join, quad, sphere, wall_with_opening};

pub(crate) fn scene() -> Scene {
    let mut s = Scene::new("demo");
    let bright = s.material("Bright plaster", Surface::Matte([0.87, 0.845, 0.80]));
    let plaster = s.material("Plaster", Surface::Matte([0.56, 0.53, 0.49]));
    let colour = s.material("Teal wall", Surface::Matte([0.055, 0.21, 0.24]));
    let ceiling = s.material("Ceiling paint", Surface::Matte([0.68, 0.67, 0.65]));
    let boards = [
        s.material("Light floor board", Surface::Matte([0.50, 0.33, 0.19])),
        s.material("Floor board", Surface::Matte([0.44, 0.28, 0.155])),
        s.material("Dark floor board", Surface::Matte([0.39, 0.24, 0.13])),
    ];
    let glass = s.material("Mirror glass", Surface::Metal { base: [0.95, 0.95, 0.95], roughness: 0.0 });
    let brass = s.material("Brass", Surface::Metal { base: [0.87, 0.63, 0.30], roughness: 0.28 });
    let lacquer = s.material("Table lacquer", substrate([0.10, 0.035, 0.02], 0.22));
    let walnut = s.material("Walnut", Surface::Matte([0.20, 0.115, 0.065]));
    let skin = s.material("Jade", substrate([0.10, 0.34, 0.20], 0.3));
    let horn = s.material("Ivory", substrate([0.72, 0.62, 0.44], 0.3));
    let eye = s.material("Onyx", substrate([0.02, 0.015, 0.015], 0.15));
    let frame = s.material("Window frame", Surface::Matte([0.80, 0.79, 0.77]));
    let cream = s.material("Cream glaze", substrate([0.74, 0.66, 0.52], 0.25));
    let fabric = s.material("Mustard fabric", Surface::Matte([0.62, 0.38, 0.07]));
    let wool = s.material("Rug wool", Surface::Matte([0.56, 0.50, 0.43]));
    let leaf = s.material("Leaf", Surface::Matte([0.09, 0.25, 0.08]));
    let clay = s.material("Terracotta", Surface::Matte([0.58, 0.28, 0.17]));
    let twig = s.material("Twig", Surface::Matte([0.19, 0.12, 0.07]));
    let bud = s.material("Bud", Surface::Matte([0.82, 0.50, 0.44]));
    let palette = [
        s.material("Red book", Surface::Matte([0.46, 0.09, 0.07])),
        s.material("Blue book", Surface::Matte([0.10, 0.20, 0.38])),
        s.material("Cream book", Surface::Matte([0.74, 0.66, 0.50])),
    ];
    let crystal = s.material("Crystal", Surface::Glass { base: [1.0; 3], ior: 1.5, solid: true });
    let window = s.material("Window light", Surface::Light { base: [0.0; 3], radiance: [12.6, 11.9, 10.8] });
    s.environment = Some([0.30, 0.36, 0.46]);

    // The room: x -2.4 .. 2.4, y 0 .. 2.6, z -1.6 .. 3.4; the front wall, behind the camera, has a wide doorway to the sky.
    let (x0, x1, z0, z1, h) = (-2.4, 2.4, -1.6, 3.4, 2.6);
    let (w, d, reveal) = (x1 - x0, z1 - z0, 0.2);
    s.add("Mirror wall", quad(v(x0, 0.0, z0), X * w, Y * h), bright);
    s.add("Coloured wall", quad(v(x0, 0.0, z1), Z * -d, Y * h), colour);
    s.add("Ceiling", quad(v(x0, h, z0), X * w, Z * d), ceiling);
    let right = Affine::rotate(Y, -0.25).at(x1, 0.0, z0);
    let hole = [1.15, 0.4, 3.55, 2.3];
    s.add("Window wall", wall_with_opening(d, h, hole, reveal).moved(right), plaster);
    let (bars, light) = f::window(hole, reveal, (2, 1));
    s.add("Window frame", bars.moved(right), frame);
    s.add("Window light", light.moved(right), window);
    let front = Affine::rotate(Y, 0.5).at(x1, 0.0, z1);
    s.add("Doorway wall", wall_with_opening(w, h, [2.55, 0.0, 4.2, 2.15], reveal).moved(front), plaster);
    let [edge, paper, hills, sun] = f::print(1.25);
    let hung = Affine::rotate(Y, 0.5).at(0.72, 1.5, z1 - 0.001);
    let parts = [(edge, walnut), (paper, frame), (hills, colour), (sun, fabric)];
    s.place("Print", parts.into_iter().map(|(m, id)| (m.moved(hung), id)).collect(), Place::Here);
    // Floor boards in three tones: 24 strips, their joints staggered.
    let mut strips = [const { vec![] }; 3];
    let mut dice = crate::math::Dice::new(4);
    for i in 0..24 {
        let (a, b) = (x0 + w * f64::from(i) / 24.0, x0 + w * f64::from(i + 1) / 24.0);
        let mut z = z1 + 0.2;
        while z > z0 {
            let next = (z - dice.range(0.9, 2.2)).max(z0);
            let tone = dice.range(0.0, 3.0) as usize;
            strips[tone].push(quad(v(a, 0.0, z), X * (b - a), Z * (next - z)));
            z = next;
        }
    }
    s.place("Floor", strips.into_iter().map(join).zip(boards).collect(), Place::Here);
    let skirting = [
        cuboid(v(x0 + 0.0005, 0.0, z0 + 0.016), v(x0 + 0.016, 0.11, z1)),
        cuboid(v(x0, 0.0, z0 + 0.0005), v(x1, 0.11, z0 + 0.016)),
    ];
    s.add("Skirting", join(skirting), frame);

    // The mirror: glass and frame in one node, 6 cm in front of the wall.
    let (mw, mh, bar) = (1.15, 1.75, 0.05);
    let (gw, gh) = (mw / 2.0 - bar, mh / 2.0 - bar);
    let plate = cuboid(v(-gw, -gh, 0.0), v(gw, gh, 0.006));
    s.place(
        "Wardrobe mirror",
        vec![(plate, glass), (f::frame(mw, mh, bar, 0.035), brass)],
        Place::at(v(0.40, 1.28, z0 + 0.06)),
    );

    // The table with the sculpture on a plinth, a vase, books.
    let table = v(-0.44, 0.0, -0.35);
    let high = 0.72;
    s.place(
        "Table top",
        vec![(f::slab(1.5, 0.04, 0.8, 0.012).at(0.0, high - 0.04, 0.0), lacquer)],
        Place::at(table),
    );
    s.place("Table legs", vec![(f::table_legs(1.5, 0.8, high - 0.04), walnut)], Place::at(table));
    let on = |x: f64, z: f64| v(table.x + x, high, table.z + z);
    s.place("Plinth", vec![(cylinder(0.26, 0.035, 0.006, 48), walnut)], Place::at(on(0.18, 0.02)));
    let mesh = s.mesh("Creature sculpture", creature::creature(0.6).parts(skin, horn, eye));
    let stand = on(0.20, -0.03) + Y * 0.035;
    s.node("Creature sculpture", mesh, creature::facing(stand, -0.09, creature::scale_for(0.50)));
    s.place("Vase", vec![(f::vase(0.27, 0.088, 36), cream)], Place::at(on(-0.47, -0.12)));
    let (twigs, buds) = f::twigs(9, 0.52, 12);
    s.place("Blossom twigs", vec![(twigs, twig), (buds, bud)], Place::at(on(-0.47, -0.12) + Y * 0.19));
    let pile: Vec<(Mesh, _)> =
        [(0.25, 0.0, 0.03, 0.19), (0.22, 0.031, -0.025, 0.17), (0.19, 0.059, 0.05, 0.15)]
            .into_iter()
            .zip(palette)
            .map(|((wide, y, turns, deep), colour)| {
                let book = cuboid(v(-wide / 2.0, y, -deep / 2.0), v(wide / 2.0, y + 0.026, deep / 2.0));
                (book.moved(Affine::rotate(Y, turns)), colour)
            })
            .collect();
    s.place("Book pile", pile, Place::at(on(-0.22, 0.2)));
    s.place("Bowl", vec![(f::bowl(0.085, 0.055, 36), brass)], Place::at(on(0.56, 0.2)));

    s.place("Crystal ball", vec![(sphere(0.055, 32), crystal)], Place::at(on(0.5, -0.18) + Y * 0.0552));

    let (bars, rest) = f::chair();
    s.place("Chair", vec![(bars, walnut), (rest, fabric)], Place::turned(v(1.02, 0.0, -0.27), -0.33));
    s.place("Rug", vec![(f::rug(2.9, 1.9), wool)], Place::at(v(-0.2, 0.0, 0.05)));
    let (pot, stems, leaves) = f::plant(1.35, 17, 5);
    s.place(
        "Potted plant",
        vec![(pot, clay), (stems, twig), (leaves, leaf)],
        Place::at(v(-1.92, 0.0, -1.12)),
    );
    let (dome, cord) = f::pendant(0.21, 0.15, h - 1.78);
    s.place("Pendant lamp", vec![(dome, brass), (cord, walnut)], Place::at(v(-0.44, 1.80, -0.35)));

    s.look(v(0.72, 1.36, 3.0), v(-0.42, 0.97, -0.6), 25.0, 16.0 / 9.0);
    s
}
