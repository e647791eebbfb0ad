//! A probe of one's own through this crate's traversal: which triangles are tested most?
//!
//! Run with `cargo run --release -p hotspot-bvh --example embed_bvh`.

#![expect(clippy::print_stdout, reason = "an example talks to its reader")]

use hotspot_bvh::{Bvh, NoProbe, Ray, RayProbe};

/// Adds one to every triangle of each leaf block that a ray tests.
struct Heat<'a> {
    bvh: &'a Bvh,
    tests: &'a mut [u32],
    nodes: &'a mut u64,
}

impl RayProbe for Heat<'_> {
    fn node(&mut self, _id: u32, _boxes: u32) {
        *self.nodes += 1;
    }
    fn leaf(&mut self, id: u32, _shapes: u32) {
        for triangle in self.bvh.block_triangles(id) {
            self.tests[triangle as usize] += 1;
        }
    }
    fn instance(&mut self, _id: u32) {}
    fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
    fn finish(self, _hit: bool) {}
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A bumpy sheet of 2 × 64 × 64 triangles.
    let n = 64;
    let vertex = |i: usize, j: usize| {
        let (x, y) = (i as f32 / n as f32 * 2.0 - 1.0, j as f32 / n as f32 * 2.0 - 1.0);
        [x, y, 0.2 * (1.0 - x * x) * (1.0 - y * y) * (9.0 * x * y).abs().min(1.0)]
    };
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let bvh = Bvh::build(&triangles, Default::default())?;

    let mut tests = vec![0; triangles.len()];
    let mut nodes = 0;
    let mut hits = 0;
    let rays = 256;
    for i in 0..rays {
        for j in 0..rays {
            let at = |k: usize| (k as f32 + 0.5) / rays as f32 * 2.4 - 1.2;
            let ray = Ray::new([at(i), at(j), 1.0], [0.3, 0.1, -1.0]);
            let hit = bvh.closest_hit(&ray, Heat { bvh: &bvh, tests: &mut tests, nodes: &mut nodes });
            // Without a probe: the same hit, and nothing is counted.
            assert_eq!(hit, bvh.closest_hit(&ray, NoProbe));
            hits += usize::from(hit.is_some());
        }
    }
    let count = rays * rays;
    let total: u32 = tests.iter().sum();
    println!(
        "{count} rays, {hits} hits, {:.2} nodes and {:.2} triangles per ray",
        nodes as f64 / count as f64,
        f64::from(total) / count as f64
    );
    let (hottest, most) = tests.iter().enumerate().max_by_key(|(_, t)| **t).ok_or("there are triangles")?;
    println!("tested most: triangle {hottest}, {most} times");
    Ok(())
}
