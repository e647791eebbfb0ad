//! The Cornell box in metres, with a red or a blue tall box (the paper's Figure 2): all matte, one emissive quad.
//!
//! Numbers: the published measurements of the Cornell box (facts), walls in the commonly used linear sRGB values.
//! The camera looks along +z, so +x is on the left of the picture; the boxes have no bottoms, the front is open.

use crate::gltf_writer::{Scene, Surface};
use crate::math::{Vec3, v};
use crate::shapes::{Mesh, join, polygon};

/// From published millimetres to metres.
fn mm(x: f64, y: f64, z: f64) -> Vec3 {
    v(x / 1000.0, y / 1000.0, z / 1000.0)
}

/// A box without a bottom, from its top's corners (counter-clockwise from above).
fn box_on_floor(top: [Vec3; 4]) -> Mesh {
    let foot = |p: Vec3| v(p.x, 0.0, p.z);
    let mut faces = vec![polygon(&top)];
    for i in 0..4 {
        let (a, b) = (top[i], top[(i + 1) % 4]);
        faces.push(polygon(&[a, foot(a), foot(b), b]));
    }
    join(faces)
}

pub(crate) fn scene(name: &'static str, tall_box: [f64; 3]) -> Scene {
    let mut s = Scene::new(name);
    let white = s.material("White paint", Surface::Matte([0.725, 0.71, 0.68]));
    let red = s.material("Red paint", Surface::Matte([0.63, 0.065, 0.05]));
    let green = s.material("Green paint", Surface::Matte([0.14, 0.45, 0.091]));
    let tall = s.material("Tall box paint", Surface::Matte(tall_box));
    let lamp = s.material("Lamp", Surface::Light { base: [0.78, 0.78, 0.78], radiance: [17.0, 12.0, 4.0] });

    let floor = [mm(552.8, 0., 0.), mm(0., 0., 0.), mm(0., 0., 559.2), mm(549.6, 0., 559.2)];
    s.add("Floor", polygon(&floor), white);
    let ceiling = [mm(556., 548.8, 0.), mm(556., 548.8, 559.2), mm(0., 548.8, 559.2), mm(0., 548.8, 0.)];
    s.add("Ceiling", polygon(&ceiling), white);
    let back = [mm(549.6, 0., 559.2), mm(0., 0., 559.2), mm(0., 548.8, 559.2), mm(556., 548.8, 559.2)];
    s.add("Back wall", polygon(&back), white);
    let left = [mm(552.8, 0., 0.), mm(549.6, 0., 559.2), mm(556., 548.8, 559.2), mm(556., 548.8, 0.)];
    s.add("Left wall", polygon(&left), red);
    let right = [mm(0., 0., 559.2), mm(0., 0., 0.), mm(0., 548.8, 0.), mm(0., 548.8, 559.2)];
    s.add("Right wall", polygon(&right), green);
    let short = [mm(130., 165., 65.), mm(82., 165., 225.), mm(240., 165., 272.), mm(290., 165., 114.)];
    s.add("Short box", box_on_floor(short), white);
    let high = [mm(423., 330., 247.), mm(265., 330., 296.), mm(314., 330., 456.), mm(472., 330., 406.)];
    s.add("Tall box", box_on_floor(high), tall);
    // Half a millimetre below the ceiling, facing down.
    let light = [mm(343., 548.3, 227.), mm(343., 548.3, 332.), mm(213., 548.3, 332.), mm(213., 548.3, 227.)];
    s.add("Ceiling light", polygon(&light), lamp);
    s.look(mm(278., 273., -800.), mm(278., 273., 0.), 39.3077, 1.0);
    s
}
