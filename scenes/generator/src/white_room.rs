//! A bright white dining room lit through two windows; the table top is glossy (substrate) or matte like the table's
//! legs (the paper's Figure 3). Nothing else differs between the two scenes.

use crate::furniture as f;
use crate::gltf_writer::{Place, Scene, Surface, substrate};
use crate::math::{Affine, X, Y, Z, v};
use crate::shapes::{Mesh, cuboid, cylinder, join, quad, rod, sphere, wall_with_opening};

pub(crate) fn scene(name: &'static str, glossy_top: bool) -> Scene {
    let mut s = Scene::new(name);
    let white = s.material("White wall", Surface::Matte([0.84, 0.83, 0.81]));
    let ceiling = s.material("Ceiling paint", Surface::Matte([0.88, 0.88, 0.87]));
    let floor = s.material("Pale floor", Surface::Matte([0.62, 0.56, 0.48]));
    let legs = s.material("Table leg", Surface::Matte([0.33, 0.24, 0.17]));
    let top =
        if glossy_top { s.material("Table top lacquer", substrate([0.20, 0.10, 0.055], 0.25)) } else { legs };
    let woodwork = s.material("White frame", Surface::Matte([0.80, 0.80, 0.79]));
    let seat = s.material("Chair seat", Surface::Matte([0.72, 0.70, 0.66]));
    let oak = s.material("Oak", Surface::Matte([0.56, 0.42, 0.28]));
    let porcelain = s.material("Porcelain", substrate([0.78, 0.77, 0.74], 0.3));
    let steel = s.material("Brushed steel", Surface::Metal { base: [0.62, 0.61, 0.60], roughness: 0.35 });
    let shade = s.material("Lamp shade", Surface::Matte([0.09, 0.10, 0.11]));
    let linen = s.material("Linen", Surface::Matte([0.76, 0.74, 0.70]));
    let wool = s.material("Rug wool", Surface::Matte([0.46, 0.50, 0.53]));
    let twig = s.material("Twig", Surface::Matte([0.20, 0.13, 0.08]));
    let bud = s.material("Bud", Surface::Matte([0.80, 0.34, 0.30]));
    let leaf = s.material("Leaf", Surface::Matte([0.12, 0.28, 0.10]));
    let fruit = s.material("Green apple", substrate([0.34, 0.50, 0.10], 0.35));
    let print = s.material("Print ink", Surface::Matte([0.16, 0.24, 0.34]));
    let sun = s.material("Print sun", Surface::Matte([0.78, 0.42, 0.16]));
    let palette = [
        s.material("Teal book", Surface::Matte([0.12, 0.32, 0.34])),
        s.material("Rust book", Surface::Matte([0.52, 0.20, 0.10])),
        s.material("White book", Surface::Matte([0.78, 0.76, 0.72])),
        s.material("Ochre book", Surface::Matte([0.62, 0.44, 0.14])),
        s.material("Grey book", Surface::Matte([0.30, 0.31, 0.33])),
    ];
    let sky = s.material("Window light", Surface::Light { base: [0.0; 3], radiance: [2.2, 2.35, 2.6] });
    let dusk = s.material("Side window light", Surface::Light { base: [0.0; 3], radiance: [10.0, 9.7, 9.2] });

    // The room: x -2.8 .. 2.8, y 0 .. 2.7, z -2 .. 3, closed but for the windows, which their lights close.
    let (x0, x1, z0, z1, h) = (-2.8, 2.8, -2.0, 3.0, 2.7);
    let (w, d, reveal) = (x1 - x0, z1 - z0, 0.22);
    s.add("Back wall", quad(v(x0, 0.0, z0), X * w, Y * h), white);
    s.add("Rear wall", quad(v(x1, 0.0, z1), X * -w, Y * h), white);
    s.add("Floor", quad(v(x0, 0.0, z1), X * w, Z * -d), floor);
    s.add("Ceiling", quad(v(x0, h, z0), X * w, Z * d), ceiling);
    let left = Affine::rotate(Y, 0.25).at(x0, 0.0, z1);
    let wide = [1.75, 0.75, 4.35, 2.35];
    s.add("Window wall", wall_with_opening(d, h, wide, reveal).moved(left), white);
    let (bars, light) = f::window(wide, reveal, (2, 0));
    s.add("Window frame", bars.moved(left), woodwork);
    s.add("Window light", light.moved(left), sky);
    s.add("Window sill", cuboid(v(1.67, 0.715, -0.02), v(4.43, 0.748, 0.09)).moved(left), woodwork);
    let right = Affine::rotate(Y, -0.25).at(x1, 0.0, z0);
    let side = [3.25, 0.4, 4.75, 2.35];
    s.add("Right wall", wall_with_opening(d, h, side, reveal).moved(right), white);
    let (bars, light) = f::window(side, reveal, (1, 1));
    s.add("Side window frame", bars.moved(right), woodwork);
    s.add("Side window light", light.moved(right), dusk);
    let skirting = [
        cuboid(v(x0, 0.0, z0 + 0.0005), v(x1, 0.1, z0 + 0.014)),
        cuboid(v(x0 + 0.0005, 0.0, z0 + 0.014), v(x0 + 0.014, 0.1, z1)),
    ];
    s.add("Skirting", join(skirting), woodwork);

    // Curtains at both ends of the wide window.
    let hang = |local: f64| Affine::rotate(Y, 0.25).at(x0 + 0.13, 2.48, z1 - local);
    let curtains =
        [f::curtain(0.55, 2.44, 6.0).moved(hang(1.17)), f::curtain(0.55, 2.44, 6.0).moved(hang(4.36))];
    s.add("Curtains", join(curtains), linen);
    let rail = [v(x0 + 0.13, 2.5, z1 - 0.95), v(x0 + 0.13, 2.5, z1 - 3.0), v(x0 + 0.13, 2.5, z1 - 4.95)];
    s.add("Curtain rail", rod(&rail, 0.012, 12), steel);

    // The table, and what stands on it.
    let table = v(0.05, 0.0, -0.05);
    let high = 0.74;
    let on = |x: f64, z: f64| v(table.x + x, high, table.z + z);
    s.place(
        "Table top",
        vec![(f::slab(1.9, 0.035, 0.95, 0.010).at(0.0, high - 0.035, 0.0), top)],
        Place::at(table),
    );
    s.place("Table legs", vec![(f::table_legs(1.9, 0.95, high - 0.035), legs)], Place::at(table));
    s.place("Vase", vec![(f::vase(0.34, 0.105, 40), porcelain)], Place::at(on(0.22, -0.08)));
    let (twigs, buds) = f::twigs(11, 0.70, 9);
    s.place("Blossom twigs", vec![(twigs, twig), (buds, bud)], Place::at(on(0.22, -0.08) + Y * 0.24));
    s.place("Fruit bowl", vec![(f::bowl(0.17, 0.085, 44), porcelain)], Place::at(on(-0.34, 0.06)));
    let (flesh, stalk) = f::fruit(0.040, 18);
    let apple = s.mesh("Apple", vec![(flesh, fruit), (stalk, twig)]);
    let apples = [(-0.06, 0.02, 0.0), (0.05, 0.045, 0.3), (0.025, -0.06, 0.6), (-0.055, -0.06, 0.8)];
    for (i, (x, z, turns)) in apples.into_iter().enumerate() {
        let p = on(-0.34 + x, 0.06 + z) + Y * 0.024;
        s.node(&format!("Apple {}", i + 1), apple, Place::turned(p, turns));
    }
    let cup = s.mesh("Cup", vec![(f::bowl(0.042, 0.07, 28), porcelain)]);
    let plate = s.mesh("Plate", vec![(f::plate(0.125, 40), porcelain)]);
    for (i, (x, z)) in [(-0.62, 0.30), (0.55, 0.30), (-0.62, -0.30), (0.62, -0.30)].into_iter().enumerate() {
        s.node(&format!("Plate {}", i + 1), plate, Place::at(on(x, z)));
        s.node(&format!("Cup {}", i + 1), cup, Place::at(on(x + 0.19, z * 0.85)));
    }

    // Four chairs share one mesh.
    let (bars, rest) = f::chair();
    let chair = s.mesh("Chair", vec![(bars, oak), (rest, seat)]);
    for (i, (x, z, turns)) in
        [(-0.50, -0.78, 0.0), (0.55, -0.80, 0.02), (-0.46, 0.80, 0.49), (0.50, 0.86, 0.515)]
            .into_iter()
            .enumerate()
    {
        s.node(&format!("Chair {}", i + 1), chair, Place::turned(table + v(x, 0.0, z), turns));
    }
    s.place("Rug", vec![(f::rug(3.0, 2.3), wool)], Place::at(table));

    // A lamp over the table (unlit).
    let (dome, cord) = f::pendant(0.24, 0.17, h - 1.52);
    s.place("Pendant lamp", vec![(dome, shade), (cord, steel)], Place::at(v(0.05, 1.52, -0.05)));

    // Along the back wall: a low bookcase, a picture, a plant.
    let case = Affine::IDENTITY.at(0.95, 0.0, z0 + 0.001);
    s.add("Bookcase", f::bookcase(1.5, 0.86, 0.3, 2).moved(case), oak);
    let mut rows = vec![Mesh::default(); palette.len()];
    for (shelf, (width, seed)) in [(1.38, 31), (1.05, 32)].into_iter().enumerate() {
        let y = 0.023 + shelf as f64 * (0.86 - 0.022) / 2.0;
        for (row, mesh) in rows.iter_mut().zip(f::books(width, palette.len(), seed)) {
            row.add(&mesh.at(-0.715, y, 0.24).moved(case));
        }
    }
    s.place("Bookcase books", rows.into_iter().zip(palette).collect(), Place::Here);
    let stack = [(0.24, 0.0, 0.004), (0.22, 0.032, -0.02), (0.19, 0.060, 0.03)];
    let stack = join(stack.map(|(w, y, turns)| {
        cuboid(v(-w / 2.0, y, -0.09), v(w / 2.0, y + 0.027, 0.09)).moved(Affine::rotate(Y, turns))
    }));
    s.place("Book stack", vec![(stack, palette[1])], Place::at(v(1.38, 0.861, z0 + 0.16)));
    s.place(
        "Globe",
        vec![(sphere(0.07, 28), print), (cylinder(0.05, 0.015, 0.003, 20).at(0.0, -0.085, 0.0), steel)],
        Place::at(v(1.38, 1.034, z0 + 0.16)),
    );
    s.place("Small vase", vec![(f::vase(0.2, 0.07, 32), porcelain)], Place::at(v(0.45, 0.861, z0 + 0.16)));
    let picture = v(0.15, 1.60, z0 + 0.003);
    let [frame, paper, hills, disc] = f::print(0.72);
    s.place("Picture", vec![(frame, oak), (paper, linen), (hills, print), (disc, sun)], Place::at(picture));
    let (pot, stems, leaves) = f::plant(1.35, 19, 8);
    s.place(
        "Potted plant",
        vec![(pot, porcelain), (stems, twig), (leaves, leaf)],
        Place::at(v(-2.25, 0.0, z0 + 0.42)),
    );

    s.look(v(2.6, 1.42, 1.05), v(-0.6, 0.86, -0.38), 45.0, 16.0 / 9.0);
    s
}
