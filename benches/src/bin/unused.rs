//! What features cost the scenes that do not use them: each scene is rendered by its kernel, and by the same kernel with one
//! feature's code compiled out, in turns so that a drifting machine does not bias the ratios.
//!
//! ```text
//! RUSTFLAGS="--cfg hotspot_ablation" cargo run --profile bench -p hotspot-benches --bin unused -- [SCENE …] [--size N] [--spp N] [--rounds N]
//! ```
//!
//! One thread, seconds of processor time, radiance only. Without the flag there are no such kernels, and the program says so.
#![expect(clippy::print_stdout, reason = "it prints a table")]

#[cfg(not(hotspot_ablation))]
fn main() {
    println!("built without the kernels to compare with: set RUSTFLAGS=\"--cfg hotspot_ablation\"");
}

#[cfg(hotspot_ablation)]
fn main() {
    use hotspot_benches::{VARIANTS, run, scenes, subject};
    use hotspot_integrator::Feature;

    let mut files = Vec::new();
    let (mut size, mut spp, mut rounds) = (128, 16, 9);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut number = || match words.next().and_then(|n| n.parse().ok()) {
            Some(n) => n,
            None => panic!("{word} wants a number"),
        };
        match word.as_str() {
            "--size" => size = number(),
            "--spp" => spp = number(),
            "--rounds" => rounds = number(),
            _ => files.push(std::path::PathBuf::from(word)),
        }
    }
    if files.is_empty() {
        let own = ["cornell-box-red", "creature", "white-room-substrate"];
        files = own.map(|name| scenes().join(format!("{name}/{name}.gltf"))).into();
    }
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start a thread: {e}"),
    };
    for file in files {
        let mut subject = subject(&file);
        let features: Vec<Option<Feature>> = [None].into_iter().chain(Feature::ALL.map(Some)).collect();
        let mut seconds = vec![Vec::new(); features.len()];
        let mut means = vec![0.0; features.len()];
        // One round to warm up, then rounds that go through all kernels, every other one backwards.
        for round in 0..=rounds {
            let mut order: Vec<usize> = (0..features.len()).collect();
            if round % 2 == 1 {
                order.reverse();
            }
            for i in order {
                subject.scene.set_without(features[i]);
                let rendered = pool.install(|| run(&subject, size, spp, &VARIANTS[0]));
                means[i] = mean(&rendered);
                if round > 0 {
                    seconds[i].push(rendered.seconds);
                }
            }
        }
        println!(
            "{} ({}): {size} x {size}, {spp} spp, 1 thread, {rounds} rounds",
            subject.name,
            subject.scene.class().name()
        );
        println!("{:<18} {:>8} {:>28}", "without", "ratio", "(kernel / kernel without)");
        for i in 1..features.len() {
            // Ratios within a round: both ran within seconds of each other.
            let mut ratios: Vec<f64> =
                seconds[0].iter().zip(&seconds[i]).map(|(with, without)| with / without).collect();
            ratios.sort_by(f64::total_cmp);
            let middle = ratios[ratios.len() / 2];
            let name = features[i].map_or(String::new(), |f| format!("{f:?}"));
            // A scene that uses the feature looks different without it; then the ratio says what using it costs.
            let used = if means[i].to_bits() == means[0].to_bits() { "" } else { "   used by this scene" };
            println!("{name:<18} {middle:>8.3}    ({:.3}..{:.3}){used}", ratios[0], ratios[ratios.len() - 1]);
        }
    }
}

/// Mean radiance of a picture: equal to the last bit where two kernels do the same.
#[cfg(hotspot_ablation)]
fn mean(rendered: &hotspot_integrator::Rendered) -> f64 {
    let desc = rendered.frame.desc();
    let mut sum = 0.0;
    for y in 0..desc.height {
        for x in 0..desc.width {
            sum += rendered.frame.film(x, y, 0).map_or(0.0, |film| film.sum.iter().sum::<f64>());
        }
    }
    sum
}
