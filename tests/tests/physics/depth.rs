//! What the depth limit cuts: against the geometric series of a luminous box, and against what deeper renders show.

use hotspot_cost::DepthLoss;
use hotspot_integrator::{LightChoice, RenderScene, Roulette, Settings};
use hotspot_scene::Camera;
use hotspot_tests::picture::{frame, picture, settings};
use hotspot_tests::reference::{Loaded, own_scene};
use hotspot_tests::say;
use hotspot_tests::stats::mean_and_variance;
use hotspot_tests::world::{World, cuboid, emitting, matte, pencil};

fn loss(scene: &RenderScene, camera: &Camera, settings: &Settings) -> DepthLoss {
    let rendered = frame(scene, camera, settings);
    DepthLoss::of(&rendered.frame, settings.max_depth).expect("paths are counted")
}

/// Inside a closed box of emission e and albedo ρ, light scattered k times brings e ρ^k: after N scatterings
/// e ρ^(N+1)/(1 − ρ) is missing, ρ^(N+1) of the whole, and every path is cut with the throughput ρ^N. With roulette fewer
/// are, of as much throughput together. Each within 4σ of eight seeds (32 comparisons of three figures: false-alarm rate 1 %),
/// σ at most 2 %.
#[test]
fn a_luminous_box_loses_the_rest_of_the_series() {
    let (e, rho) = (0.7f32, 0.8f32);
    let walls = emitting(matte([rho; 3]), [e; 3]);
    let scene = World::new().with(cuboid([-1.0, -0.7, -1.3], [1.2, 0.9, 1.0], true), walls).prepare();
    let camera = pencil([0.1, 0.05, -0.2], [-0.3, -0.6, 0.7]);
    let rho = f64::from(rho);
    for (depth, roulette, choice) in [
        (2, Roulette::Off, LightChoice::Power),
        (3, Roulette::From(0), LightChoice::Power),
        (6, Roulette::Off, LightChoice::Learned),
        (6, Roulette::From(4), LightChoice::Power),
        (15, Roulette::From(4), LightChoice::Power),
        (15, Roulette::Efficient, LightChoice::Power),
    ] {
        let all: Vec<DepthLoss> = (0..8)
            .map(|seed| {
                // Roulette leaves few paths so deep.
                let spp = if depth > 10 { 256 } else { 64 };
                let mut settings = settings(16, 16, spp, depth, seed);
                settings.roulette = roulette;
                settings.light_choice = choice;
                settings.intervals = seed % 2 == 1;
                settings.ledgers = seed % 4 == 3;
                loss(&scene, &camera, &settings)
            })
            .collect();
        let what = format!("depth {depth}, roulette {roulette:?}");
        let n = depth as i32;
        let near = |name: &str, values: Vec<f64>, expected: f64| {
            let (mean, variance) = mean_and_variance(&values);
            let sigma = variance.sqrt();
            say(&format!("{what}, {name}: {mean:.5} ± {sigma:.5}, expected {expected:.5}"));
            assert!((mean - expected).abs() < 4.0 * sigma + 1e-6, "{what}, {name}: {mean}, not {expected}");
            assert!(sigma <= 0.02 * expected, "{what}, {name}: sigma {sigma} tells too little");
        };
        let of = |f: &dyn Fn(&DepthLoss) -> f64| all.iter().map(f).collect::<Vec<_>>();
        near("throughput", of(&|l| l.throughput), rho.powi(n));
        near("lost", of(&|l| l.lost.unwrap()), f64::from(e) * rho.powi(n + 1) / (1.0 - rho));
        near("share", of(&|l| l.lost_share.unwrap()), rho.powi(n + 1));
        near("decay", of(&|l| l.decay.unwrap()), rho);
        if roulette == Roulette::Off {
            // But for directions drawn along the very surface.
            assert!(all.iter().all(|l| l.paths > 0.9999), "{what}: every path is cut");
        } else {
            assert!(all.iter().all(|l| l.paths < 1.0), "{what}");
        }
    }
}

/// Light that was lost is what a deeper render has more of: on scenes of our own, the estimate at depth N against the
/// difference to depth 64, as shares of the latter's luminance. The decay is not geometric from the start here; the
/// estimate must be right within a quarter of itself, or 0.1 % of the picture, and four standard deviations of four seeds.
#[test]
fn rooms_lose_what_deeper_renders_have_more_of() {
    for (name, depths) in [("cornell-box-red", &[4, 8][..]), ("white-room-substrate", &[4, 12])] {
        let Some(scene) = own_scene(name) else { continue };
        let Loaded { scene, camera } = Loaded::new(&scene);
        let luminance = |depth: u32, seed: u64| {
            let [r, g, b] = picture(&scene, &camera, &settings(32, 32, 128, depth, seed)).mean();
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let deep: Vec<f64> = (0..4).map(|seed| luminance(64, seed)).collect();
        let whole = mean_and_variance(&deep).0;
        for depth in depths {
            // The same seed: the paths of both are the same up to the limit, so that their difference has little noise.
            let missing: Vec<f64> =
                deep.iter().zip(0..).map(|(deep, seed)| (deep - luminance(*depth, seed)) / whole).collect();
            let estimated: Vec<f64> = (0..4)
                .map(|seed| {
                    loss(&scene, &camera, &settings(32, 32, 128, *depth, 10 + seed)).lost_share.unwrap()
                })
                .collect();
            let ((missing, a), (estimated, b)) = (mean_and_variance(&missing), mean_and_variance(&estimated));
            say(&format!(
                "{name}, depth {depth}: {:.3} ± {:.3} % missing, estimated {:.3} ± {:.3} %",
                100.0 * missing,
                100.0 * a.sqrt(),
                100.0 * estimated,
                100.0 * b.sqrt()
            ));
            let off = (estimated - missing).abs();
            assert!(off < (0.25 * missing).max(1e-3) + 4.0 * (a + b).sqrt(), "{name}, depth {depth}: {off}");
        }
    }
}
