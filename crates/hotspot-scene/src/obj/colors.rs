//! Vertex colours: `v x y z r g b`, which many programs write and no specification describes.
//!
//! They are sRGB-encoded in 0..1: so write Blender (which encodes its linear colours for the purpose) and the scanners'
//! tools, and so read three.js (OBJLoader, pull request 23340) and Godot (pull request 71033, which cites Blender's review
//! D15159). Vertices without are white, as there. Some programs (Microsoft's 3D Builder) write 0..255.

use crate::notes::Notes;

/// The colours of a file's vertices; nothing where it has none.
#[derive(Default)]
pub(super) struct VertexColors {
    /// As stated while the file is read, linear after [`VertexColors::finish`].
    colors: Vec<[f32; 3]>,
}

const WHITE: [f32; 3] = [1.0; 3];

impl VertexColors {
    pub(super) fn is_empty(&self) -> bool {
        self.colors.is_empty()
    }

    /// The colour of vertex `index`; those before it that had none become white.
    pub(super) fn push(&mut self, color: [f32; 3], index: usize) {
        self.colors.resize(index, WHITE);
        self.colors.push(color);
    }

    /// Linear colour of a vertex.
    pub(super) fn get(&self, index: u32) -> [f32; 3] {
        self.colors.get(index as usize).copied().unwrap_or(WHITE)
    }

    /// Decodes all colours, and mends those out of range.
    pub(super) fn finish(&mut self, vertices: usize, notes: &mut Notes) {
        if self.colors.is_empty() {
            return;
        }
        self.colors.resize(vertices, WHITE);
        let largest = self.colors.iter().flatten().filter(|c| c.is_finite()).fold(0.0f32, |a, b| a.max(*b));
        // Rounding may lead a little beyond 1; 255 is not reached by it.
        let bytes = largest > 2.0 && largest <= 255.0;
        let scale = if bytes { 1.0 / 255.0 } else { 1.0 };
        let (mut scaled, mut clamped) = (0u64, 0u64);
        for color in &mut self.colors {
            // White by default is in the unit of the others only when it was stated.
            if bytes && *color != WHITE {
                scaled += 1;
                *color = color.map(|c| c * scale);
            }
            let within = color.map(|c| if c.is_nan() { 1.0 } else { c.clamp(0.0, 1.0) });
            clamped += u64::from(within != *color);
            *color = within.map(linear);
        }
        notes.repair("vertex colours in 0..255 scaled to 0..1", "v", scaled);
        notes.repair("vertex colours clamped to 0..1", "v", clamped);
    }
}

/// The sRGB transfer function of IEC 61966-2-1, decoding.
fn linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { libm::pow((f64::from(c) + 0.055) / 1.055, 2.4) as f32 }
}
