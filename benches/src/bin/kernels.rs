//! The kernels whose instructions `benches/gates/instructions.sh` counts under callgrind: each runs a fixed amount of work
//! in a call of `measured`, and its name is printed in the order of the calls. Everything is fixed: scenes of this
//! repository, rays, seeds, one thread, the instruction set.
#![expect(clippy::print_stdout, reason = "it prints the names")]

use hotspot_benches::trace::query;
use hotspot_benches::trace::rays::{Kind, rays};
use hotspot_benches::trace::soup::Soup;
use hotspot_benches::{VARIANTS, run, scenes, subject};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh};
use std::hint::black_box;

/// What callgrind looks at. The name is part of the gate's script.
#[inline(never)]
fn measured(work: &mut dyn FnMut() -> u64) -> u64 {
    black_box(work())
}

fn main() {
    let file = |name: &str| scenes().join(format!("{name}/{name}.gltf"));
    let soup = Soup::load(&file("creature"));
    for (isa, prefix) in [(Isa::Avx2, "avx2"), (Isa::Portable, "portable")] {
        let options = BuildOptions { isa, ..Default::default() };
        let bvh = match Bvh::build(&soup.triangles, options) {
            Ok(bvh) => bvh,
            Err(e) => panic!("{e}"),
        };
        for kind in Kind::ALL {
            let rays = rays(&soup, &bvh, 64, kind);
            let (mut found, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
            measured(&mut || match kind {
                Kind::Shadow => query::any(&bvh, isa, &rays, &mut blocked),
                _ => query::closest(&bvh, isa, &rays, &mut found),
            });
            println!("trace/{prefix}/{} {}", kind.name(), rays.len());
        }
    }
    // The path loop in the calling thread, where callgrind's switch is.
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start a pool: {e}"),
    };
    for name in ["cornell-box-red", "creature", "white-room-substrate"] {
        let subject = subject(&file(name));
        for (variant, what) in [(&VARIANTS[0], "plain"), (&VARIANTS[3], "counting")] {
            let (size, spp) = (32, 8);
            measured(&mut || pool.install(|| run(&subject, size, spp, variant).frame.memory()));
            let class = subject.scene.class().name();
            println!("path/{class}/{name}/{what} {}", size * size * spp);
        }
    }
}
