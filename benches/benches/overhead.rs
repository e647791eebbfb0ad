//! Time of a small render under each metric group, by criterion. For ratios on a noisy machine use the `overhead` binary,
//! which takes turns.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use hotspot_benches::{COST_ALONE, VARIANTS, run, scenes, subject};
use std::time::Duration;

const SIZE: u32 = 64;
const SPP: u32 = 16;

fn overhead(c: &mut Criterion) {
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start a thread: {e}"),
    };
    for name in ["cornell-box-red", "creature"] {
        let subject = subject(&scenes().join(format!("{name}/{name}.gltf")));
        let mut group = c.benchmark_group(format!("overhead/{name}"));
        group
            .sample_size(10)
            .warm_up_time(Duration::from_millis(500))
            .measurement_time(Duration::from_secs(3));
        group.throughput(Throughput::Elements(u64::from(SIZE * SIZE * SPP)));
        for variant in VARIANTS.iter().chain(&COST_ALONE) {
            group.bench_function(BenchmarkId::from_parameter(variant.name), |b| {
                b.iter(|| pool.install(|| run(&subject, SIZE, SPP, variant)));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, overhead);
criterion_main!(benches);
