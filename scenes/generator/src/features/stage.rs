//! The stage on which features are shown: floor, back wall, a lamp from the upper left, a fill from all around; and shapes.

use super::doc::{Doc, light};
use super::png::Png;
use crate::math::{Affine, Vec3, X, Y, Z, v};
use crate::shapes::{Mesh, quad};
use serde_json::{Value, json};

/// How the stage is lit.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Lit {
    /// Lamp and fill.
    Well,
    /// A weak fill alone: for subjects that shine themselves.
    Dim,
}

impl Doc {
    /// Floor, wall, light and the camera that all stages share: at z = 0 it sees x from -1.7 to 1.7, y from -0.3 to 1.9.
    pub(super) fn stage(&mut self, lit: Lit) {
        self.bare_stage(lit);
        self.look("Camera", v(0.0, 1.1, 6.0), v(0.0, 0.76, 0.0), 21.5);
    }

    /// The stage without a camera.
    pub(super) fn bare_stage(&mut self, lit: Lit) {
        let floor = self.matte("Floor", [0.34, 0.33, 0.32]);
        let wall = self.matte("Wall", [0.42, 0.44, 0.47]);
        self.add("Floor", &quad(v(-4.0, 0.0, 4.0), X * 8.0, Z * -5.5), floor, [0.0; 3]);
        self.add("Wall", &quad(v(-4.0, 0.0, -1.5), X * 8.0, Y * 5.0), wall, [0.0; 3]);
        self.environment = Some(if lit == Lit::Well { [0.45; 3] } else { [0.06; 3] });
        if lit == Lit::Well {
            let lamp = self.material("Lamp", light([1.0, 0.97, 0.92], 14.0));
            self.add("Lamp", &facing(v(-2.6, 3.4, 3.4), v(0.0, 0.6, 0.0), 1.4), lamp, [0.0; 3]);
        }
    }
}

/// A square of edge `size` at `centre`, its front towards `target`.
pub(super) fn facing(centre: Vec3, target: Vec3, size: f64) -> Mesh {
    let front = (target - centre).unit();
    let right = Y.cross(front).unit();
    let up = front.cross(right);
    quad(centre - (right + up) * (size / 2.0), right * size, up * size)
}

/// An upright rectangle about the origin, front along +z.
pub(super) fn card(width: f64, height: f64) -> Mesh {
    quad(v(-width / 2.0, -height / 2.0, 0.0), X * width, Y * height)
}

/// Texture coordinates of a card's corners that show `span` = [left, top, right, bottom] of the picture, upright.
pub(super) fn card_uvs([left, top, right, bottom]: [f64; 4]) -> [[f64; 2]; 4] {
    [[left, bottom], [right, bottom], [right, top], [left, top]]
}

/// The whole picture.
pub(super) const WHOLE: [f64; 4] = [0.0, 0.0, 1.0, 1.0];

/// `mesh` turned about an axis, by turns.
pub(super) fn turned(mesh: Mesh, axis: Vec3, turns: f64) -> Mesh {
    mesh.moved(Affine::rotate(axis, turns))
}

/// A picture that tells up from down and left from right: a dark F on cream, corners red, green and blue.
pub(super) fn letter() -> Png {
    const ROWS: [&str; 16] = [
        "RRRR........GGGG",
        "RRRR........GGGG",
        "RR............GG",
        "RR..########..GG",
        "....########....",
        "....##..........",
        "....##..........",
        "....######......",
        "....######......",
        "....##..........",
        "....##..........",
        "....##..........",
        "BB..##..........",
        "BB..............",
        "BBBB............",
        "BBBB............",
    ];
    Png::new(16, 16, |x, y| match ROWS[y].as_bytes()[x] {
        b'R' => [210, 40, 30, 255],
        b'G' => [40, 160, 60, 255],
        b'B' => [40, 80, 210, 255],
        b'#' => [30, 28, 34, 255],
        _ => [235, 225, 200, 255],
    })
}

/// A checkerboard of `n` x `n` fields.
pub(super) fn checker(n: usize, a: [u8; 3], b: [u8; 3]) -> Png {
    Png::new(n, n, |x, y| {
        let [r, g, b] = if (x + y) % 2 == 0 { a } else { b };
        [r, g, b, 255]
    })
}

/// Samplers.
pub(super) const CLAMP: u32 = 33071;
pub(super) const MIRROR: u32 = 33648;
pub(super) const REPEAT: u32 = 10497;

/// A sampler with these wrap modes.
pub(super) fn sampler(s: u32, t: u32, nearest: bool) -> Value {
    let filter = if nearest { 9728 } else { 9729 };
    json!({ "wrapS": s, "wrapT": t, "magFilter": filter, "minFilter": filter })
}
