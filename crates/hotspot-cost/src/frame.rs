//! The sums of a whole picture, kept as tiles that workers fill independently.

use crate::recorder::{CostPixel, FilmPixel, Rect, TileRecorder};

/// What a frame is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameDesc {
    /// Pixels per row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Keep two independent halves of the samples apart, for confidence intervals.
    pub intervals: bool,
    /// Gather cost; radiance alone otherwise.
    pub cost: bool,
    /// Edge of a tile in pixels, at least 1.
    pub tile: u32,
}

impl FrameDesc {
    /// A frame with cost, without intervals, in 16-pixel tiles.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height, intervals: false, cost: true, tile: 16 }
    }
}

/// The sums of a picture.
#[derive(Clone, Debug)]
pub struct Frame {
    desc: FrameDesc,
    tiles_per_row: u32,
    tiles: Vec<TileRecorder>,
}

impl Frame {
    /// An empty frame.
    ///
    /// # Panics
    /// When width, height or tile is 0.
    pub fn new(desc: FrameDesc) -> Self {
        assert!(desc.width > 0 && desc.height > 0 && desc.tile > 0, "an empty frame: {desc:?}");
        let mut tiles = Vec::new();
        for y in (0..desc.height).step_by(desc.tile as usize) {
            for x in (0..desc.width).step_by(desc.tile as usize) {
                let rect = Rect {
                    x,
                    y,
                    width: desc.tile.min(desc.width - x),
                    height: desc.tile.min(desc.height - y),
                };
                tiles.push(TileRecorder::new(rect, 1 + usize::from(desc.intervals), desc.cost));
            }
        }
        Self { desc, tiles_per_row: desc.width.div_ceil(desc.tile), tiles }
    }

    /// What it is made of.
    pub const fn desc(&self) -> &FrameDesc {
        &self.desc
    }

    /// 1, or 2 with intervals.
    pub const fn halves(&self) -> usize {
        1 + self.desc.intervals as usize
    }

    /// The tiles, row by row from the top: disjoint, and together the whole frame. Hand them to workers.
    pub fn tiles_mut(&mut self) -> &mut [TileRecorder] {
        &mut self.tiles
    }

    /// A recorder of its own for any rectangle, for renderers that bring their own buckets; give it back to
    /// [`Frame::merge`].
    pub fn tile(&self, rect: Rect) -> TileRecorder {
        TileRecorder::new(rect, self.halves(), self.desc.cost)
    }

    /// Adds a recorder's sums; what lies outside the frame is ignored. Integer sums do not depend on the order of
    /// merging; where several recorders cover a pixel, its f64 sums do in their last bits, and its `first_object` is that
    /// of the recorder merged first.
    pub fn merge(&mut self, recorder: &TileRecorder) {
        let whole = Rect { x: 0, y: 0, width: self.desc.width, height: self.desc.height };
        let shared = whole.intersection(&recorder.rect());
        if shared.area() == 0 {
            return;
        }
        let first = self.tile_index(shared.x, shared.y);
        let last = self.tile_index(shared.x + shared.width - 1, shared.y + shared.height - 1);
        for tile in &mut self.tiles[first..=last] {
            tile.merge(recorder);
        }
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let pixels = self.tiles.iter().map(|t| t.rect().area()).sum::<usize>() * self.halves();
        (pixels * (size_of::<FilmPixel>() + if self.desc.cost { size_of::<CostPixel>() } else { 0 })) as u64
    }

    /// Index of the tile that covers a pixel inside the frame.
    const fn tile_index(&self, x: u32, y: u32) -> usize {
        (y / self.desc.tile) as usize * self.tiles_per_row as usize + (x / self.desc.tile) as usize
    }

    fn tile_at(&self, x: u32, y: u32) -> Option<&TileRecorder> {
        if x >= self.desc.width || y >= self.desc.height {
            return None;
        }
        self.tiles.get(self.tile_index(x, y))
    }

    /// Radiance sums of a pixel's half; `None` outside the frame.
    pub fn film(&self, x: u32, y: u32, half: usize) -> Option<&FilmPixel> {
        self.tile_at(x, y)?.film(x, y, half)
    }

    /// Cost sums of a pixel's half; `None` outside the frame or without cost.
    pub fn cost(&self, x: u32, y: u32, half: usize) -> Option<&CostPixel> {
        self.tile_at(x, y)?.cost(x, y, half)
    }

    /// Coordinates of all pixels, row by row from the top.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        Rect { x: 0, y: 0, width: self.desc.width, height: self.desc.height }.pixels()
    }

    /// Radiance sums of a pixel, both halves together; empty outside the frame.
    pub fn film_total(&self, x: u32, y: u32) -> FilmPixel {
        if !self.desc.intervals {
            return self.film(x, y, 0).copied().unwrap_or_default();
        }
        let mut total = FilmPixel::default();
        for film in (0..self.halves()).filter_map(|half| self.film(x, y, half)) {
            total.merge(film);
        }
        total
    }

    /// Cost sums of a pixel, both halves together; empty outside the frame or without cost.
    pub fn cost_total(&self, x: u32, y: u32) -> CostPixel {
        self.with_cost_total(x, y, |total| *total)
    }

    /// What is to be known of [`Frame::cost_total`], without a copy of it where there are no halves: it is some hundred bytes.
    pub(crate) fn with_cost_total<T>(&self, x: u32, y: u32, of: impl FnOnce(&CostPixel) -> T) -> T {
        if !self.desc.intervals
            && let Some(cost) = self.cost(x, y, 0)
        {
            return of(cost);
        }
        let mut total = CostPixel::default();
        for cost in (0..self.halves()).filter_map(|half| self.cost(x, y, half)) {
            total.merge(cost);
        }
        of(&total)
    }

    /// The cost sums of every pixel and half, tile by tile; empty without cost.
    pub fn costs(&self) -> impl Iterator<Item = &CostPixel> {
        self.tiles.iter().flat_map(TileRecorder::costs)
    }
}
