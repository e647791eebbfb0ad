//! Pictures as arrays: renders, files, masks and tiles.

use hotspot_cost::{Frame, exr_io};
use hotspot_integrator::{Control, Gather, RenderScene, Rendered, Settings, render};
use hotspot_scene::Camera;
use std::path::Path;

/// Linear RGB, row by row from the top.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Values.
    pub pixels: Vec<[f64; 3]>,
}

impl Picture {
    /// The means of a frame.
    pub fn of_frame(frame: &Frame) -> Self {
        let pixels = frame
            .pixels()
            .map(|(x, y)| {
                let film = frame.film_total(x, y);
                film.sum.map(|sum| sum / film.samples as f64)
            })
            .collect();
        Self { width: frame.desc().width as usize, height: frame.desc().height as usize, pixels }
    }

    /// An EXR file with R, G and B.
    pub fn read(path: &Path) -> Self {
        Self::read_channels(path, ["R", "G", "B"])
    }

    /// Three channels of an EXR file.
    pub fn read_channels(path: &Path, channels: [&str; 3]) -> Self {
        let file = exr_io::read(path, &exr_io::Limits::default()).expect("the picture reads");
        let [r, g, b] = channels.map(|name| file.layers.plane(name).expect("the picture has the channels"));
        let pixels =
            r.iter().zip(g).zip(b).map(|((r, g), b)| [f64::from(*r), f64::from(*g), f64::from(*b)]).collect();
        Self { width: file.layers.width as usize, height: file.layers.height as usize, pixels }
    }

    /// The mean of all pixels.
    pub fn mean(&self) -> [f64; 3] {
        let n = self.pixels.len() as f64;
        self.pixels.iter().fold([0.0; 3], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n, m[2] + p[2] / n])
    }

    /// The largest component anywhere.
    pub fn max(&self) -> f64 {
        self.pixels.iter().flatten().fold(f64::NEG_INFINITY, |m, v| m.max(*v))
    }

    /// The smallest component anywhere.
    pub fn min(&self) -> f64 {
        self.pixels.iter().flatten().fold(f64::INFINITY, |m, v| m.min(*v))
    }

    /// Where anything is above 0, grown by one pixel on each side.
    pub fn lit(&self) -> Vec<bool> {
        let lit = |x: usize, y: usize| self.pixels[y * self.width + x].iter().any(|v| *v > 0.0);
        let around = |v: usize, n: usize| v.saturating_sub(1)..(v + 2).min(n);
        (0..self.pixels.len())
            .map(|i| {
                let (x, y) = (i % self.width, i / self.width);
                around(y, self.height).any(|y| around(x, self.width).any(|x| lit(x, y)))
            })
            .collect()
    }
}

/// Renders; non-finite radiance fails the test.
pub fn frame(scene: &RenderScene, camera: &Camera, settings: &Settings) -> Rendered {
    let rendered = render(scene, camera, settings, Control::default());
    assert!(rendered.non_finite.is_empty(), "non-finite radiance: {:?}", rendered.non_finite);
    rendered
}

/// Renders radiance alone, on the plain kernel.
pub fn picture(scene: &RenderScene, camera: &Camera, settings: &Settings) -> Picture {
    let mut settings = settings.clone();
    settings.gather = Gather::RADIANCE;
    Picture::of_frame(&frame(scene, camera, &settings).frame)
}

/// Settings by their most used numbers.
pub fn settings(width: u32, height: u32, spp: u32, max_depth: u32, seed: u64) -> Settings {
    let mut settings = Settings::new(width, height);
    settings.spp = spp;
    settings.max_depth = max_depth;
    settings.seed = seed;
    settings
}

/// Pixel indices of the square tiles of a picture, row by row.
pub fn tiles(width: usize, height: usize, edge: usize) -> Vec<Vec<usize>> {
    let mut tiles = Vec::new();
    for y0 in (0..height).step_by(edge) {
        for x0 in (0..width).step_by(edge) {
            let rows = y0..(y0 + edge).min(height);
            let row = |y: usize| (x0..(x0 + edge).min(width)).map(move |x| y * width + x);
            tiles.push(rows.flat_map(row).collect());
        }
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_everything_once() {
        let mut all: Vec<usize> = tiles(20, 9, 8).concat();
        all.sort_unstable();
        assert_eq!(all, (0..180).collect::<Vec<_>>());
        assert_eq!(tiles(20, 9, 8).len(), 6);
    }

    #[test]
    fn lit_pixels_grow_by_one() {
        let mut picture = Picture { width: 5, height: 4, pixels: vec![[0.0; 3]; 20] };
        picture.pixels[0] = [0.0, 1.0, 0.0];
        let lit: Vec<usize> = picture.lit().iter().enumerate().filter(|l| *l.1).map(|l| l.0).collect();
        assert_eq!(lit, [0, 1, 5, 6]);
    }
}
