//! The size of the tiles does not show.

use super::{Control, Settings, Way, render, render_somehow};
use crate::scene::{PrepareOptions, RenderScene};
use hotspot_cost::{CostPixel, Digest, Frame};
use hotspot_scene::{LoadOptions, load};
use std::path::PathBuf;

/// All sums but those of time.
fn sums(frame: &Frame) -> Vec<([f64; 3], [f64; 3], CostPixel)> {
    let pixels = frame.pixels();
    pixels
        .map(|(x, y)| {
            let film = frame.film_total(x, y);
            let cost = CostPixel { time_ns: 0, time_samples: 0, ..frame.cost_total(x, y) };
            (film.sum, film.squares, cost)
        })
        .collect()
}

/// Edges from one pixel to more than the picture, in every class of scene, with and without halves.
#[test]
fn tiles_of_any_size_give_the_same_bits() {
    for name in
        ["cornell-box-red/cornell-box-red", "mirror-gap-narrow/mirror-gap-narrow", "creature/creature"]
    {
        let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../scenes", name].iter().collect();
        let scene = load(&path.with_extension("gltf"), &LoadOptions::default()).expect("the scene loads");
        let ready = RenderScene::prepare(&scene, PrepareOptions::default()).expect("the scene is whole");
        for intervals in [false, true] {
            let mut settings = Settings::new(37, 23);
            // Enough to go eight at a time, in halves one by one.
            settings.spp = 12;
            settings.seed = 7;
            settings.intervals = intervals;
            let camera = &scene.cameras[0];
            let usual = render(&ready, camera, &settings, Control::default()).frame;
            for edge in [1, 5, 8, 64] {
                let way = Way { tile: edge, portable_eights: false };
                let other = render_somehow(&ready, camera, &settings, Control::default(), way).frame;
                assert_eq!(other.desc().tile, edge);
                assert_eq!(Digest::of(&usual), Digest::of(&other), "{name}, tiles of {edge}");
                assert_eq!(sums(&usual), sums(&other), "{name}, tiles of {edge}");
            }
        }
    }
}
