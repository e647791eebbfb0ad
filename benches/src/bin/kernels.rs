//! The kernels whose instructions `benches/gates/instructions.sh` counts under callgrind: each runs a fixed amount of work
//! in a call of `measured`. Without an argument their names are listed; with a name that one runs, and says how many rays or
//! paths it took. Everything is fixed: scenes of this
//! repository, rays, seeds, one thread, the instruction set.
#![expect(clippy::print_stdout, reason = "it prints the names")]

use hotspot_benches::trace::query;
use hotspot_benches::trace::rays::{Kind, rays};
use hotspot_benches::trace::soup::Soup;
use hotspot_benches::{
    COUNTING, COUNTING_AS_IT_RUNS, DEFAULT, PLAIN, VARIANTS, Variant, run, scenes, subject_under,
};
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh};
use std::hint::black_box;

/// What callgrind looks at. The name is part of the gate's script.
#[inline(never)]
fn measured(work: &mut dyn FnMut() -> u64) -> u64 {
    black_box(work())
}

/// Rays through the creature: instruction set and kind.
fn trace(isa: Isa, kind: Kind) -> usize {
    let soup = Soup::load(&scenes().join("creature/creature.gltf"));
    let bvh = match Bvh::build(&soup.triangles, BuildOptions { isa, ..Default::default() }) {
        Ok(bvh) => bvh,
        Err(e) => panic!("{e}"),
    };
    let rays = rays(&soup, &bvh, 64, kind);
    let (mut found, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    measured(&mut || match kind {
        Kind::Shadow => query::any(&bvh, isa, &rays, &mut blocked),
        Kind::Packets => query::packets(&bvh, isa, &rays, &mut found),
        _ => query::closest(&bvh, isa, &rays, &mut found),
    });
    rays.len()
}

/// A small render in the calling thread, where callgrind's switch is.
fn path(scene: &str, isa: Isa, variant: &Variant) -> usize {
    let subject = subject_under(&scenes().join(scene), isa);
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start a pool: {e}"),
    };
    let (size, spp) = (32, 8);
    measured(&mut || pool.install(|| run(&subject, size, spp, variant).frame.memory()));
    (size * size * spp) as usize
}

fn main() {
    let mut kernels: Vec<(String, Box<dyn Fn() -> usize>)> = Vec::new();
    for (isa, name) in [(Isa::Avx2, "avx2"), (Isa::Portable, "portable")] {
        for kind in Kind::ALL {
            kernels.push((format!("trace/{name}/{}", kind.name()), Box::new(move || trace(isa, kind))));
        }
    }
    // A scene of each class.
    let classes = [
        ("matte", "cornell-box-red/cornell-box-red.gltf"),
        ("lobes", "white-room-substrate/white-room-substrate.gltf"),
        ("textured", "features/metallic-roughness-texture.gltf"),
        ("full", "features/alpha-mask.gltf"),
    ];
    for (class, scene) in classes {
        let kinds = [
            (&VARIANTS[0], "single"),
            (&PLAIN, "plain"),
            (&COUNTING, "counting"),
            (&VARIANTS[5], "booked"),
            (&VARIANTS[6], "booked-halves"),
            (&COUNTING_AS_IT_RUNS, "counting-eights"),
            (&DEFAULT, "booked-eights"),
        ];
        for (variant, what) in kinds {
            kernels.push((format!("path/{class}/{what}"), Box::new(move || path(scene, Isa::Auto, variant))));
            // Some versions of valgrind lack an instruction that the compiler likes in these classes.
            if class == "textured" || class == "full" {
                let name = format!("path/{class}/portable/{what}");
                kernels.push((name, Box::new(move || path(scene, Isa::Portable, variant))));
            }
        }
    }
    match std::env::args().nth(1) {
        None => kernels.iter().for_each(|(name, _)| println!("{name}")),
        Some(wanted) => match kernels.iter().find(|(name, _)| *name == wanted) {
            Some((name, kernel)) => println!("{name} {}", kernel()),
            None => panic!("there is no kernel {wanted}"),
        },
    }
}
