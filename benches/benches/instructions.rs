//! Instructions of a tiny render under each metric group, by callgrind: repeatable whatever else the machine does.
//! `cargo bench -p hotspot-benches --features callgrind --bench instructions`.

#![expect(missing_docs, reason = "the macros make public items")]

use gungraun::{library_benchmark, library_benchmark_group, main};
use hotspot_benches::{COST_ALONE, Subject, VARIANTS, Variant, run, scenes, subject};
use std::hint::black_box;

fn prepare(name: &str, variant: &'static Variant) -> (Subject, &'static Variant) {
    (subject(&scenes().join(format!("{name}/{name}.gltf"))), variant)
}

#[library_benchmark]
#[bench::cornell_none(prepare("cornell-box-red", &VARIANTS[0]))]
#[bench::cornell_time(prepare("cornell-box-red", &VARIANTS[1]))]
#[bench::cornell_counters(prepare("cornell-box-red", &VARIANTS[3]))]
#[bench::cornell_all(prepare("cornell-box-red", &VARIANTS[6]))]
#[bench::cornell_intervals(prepare("cornell-box-red", &VARIANTS[7]))]
#[bench::cornell_rays_alone(prepare("cornell-box-red", &COST_ALONE[0]))]
#[bench::creature_none(prepare("creature", &VARIANTS[0]))]
#[bench::creature_counters(prepare("creature", &VARIANTS[3]))]
#[bench::creature_all(prepare("creature", &VARIANTS[6]))]
#[bench::creature_rays_alone(prepare("creature", &COST_ALONE[0]))]
fn render((subject, variant): (Subject, &Variant)) -> u64 {
    let rendered = run(&subject, 32, 8, variant);
    black_box(rendered.frame.memory())
}

library_benchmark_group!(name = metrics, benchmarks = [render]);
main!(library_benchmark_groups = metrics);
