//! Ray traversal beside Embree's: the same rays, one at a time, in one thread, with the full hit record (t, u, v,
//! primitive, geometric normal), in turns so that a drifting machine does not bias the ratios.
//!
//! ```text
//! benches/embree/build.sh        # once: compiles target/embree/driver, see there
//! cargo run --profile bench -p hotspot-benches --bin trace -- [SCENE … | million] [--size N] [--rounds N] [--threads N]
//!     [--quality fast,medium,high,obvhs] [--isa avx2|portable] [--driver FILE] [--alone]
//! ```
//!
//! Without scenes: `../shared/scenes` (killeroo, living room) where there, this repository's creature, and a generated
//! scene of a million triangles. Threads are those of the builds. Ratios above 1: we are faster than Embree.
#![expect(clippy::print_stdout, reason = "it prints tables")]

use hotspot_benches::scenes;
use hotspot_benches::trace::peer::{Peer, PeerHit};
use hotspot_benches::trace::query;
use hotspot_benches::trace::rays::{Kind, leak_rays, rays};
use hotspot_benches::trace::soup::Soup;
use hotspot_bvh::simd::Isa;
use hotspot_bvh::{BuildOptions, Bvh, Hit, Quality, Ray};
use std::path::PathBuf;
use std::time::Instant;

const MODES: [&str; 2] = ["robust", "fast"];

struct Options {
    scenes: Vec<String>,
    size: u32,
    rounds: usize,
    threads: usize,
    qualities: Vec<Quality>,
    isa: Isa,
    driver: Option<PathBuf>,
}

fn options() -> Options {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| scenes().join("../target"), PathBuf::from);
    let mut o = Options {
        scenes: Vec::new(),
        size: 512,
        rounds: 9,
        threads: 1,
        qualities: vec![Quality::Medium, Quality::High],
        isa: Isa::Auto,
        driver: Some(target.join("embree/driver")),
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || match words.next() {
            Some(value) => value,
            None => panic!("{word} wants a value"),
        };
        let number = |value: String| match value.parse() {
            Ok(n) => n,
            Err(e) => panic!("{value}: {e}"),
        };
        match word.as_str() {
            "--size" => o.size = number(value()) as u32 / 16 * 16,
            "--rounds" => o.rounds = number(value()),
            "--threads" => o.threads = number(value()),
            "--driver" => o.driver = Some(value().into()),
            "--alone" => o.driver = None,
            "--isa" => o.isa = if value() == "portable" { Isa::Portable } else { Isa::Avx2 },
            "--quality" => {
                let all = [Quality::Fast, Quality::Medium, Quality::High, Quality::Obvhs];
                let list = value();
                o.qualities = all.into_iter().filter(|q| list.split(',').any(|w| w == q.name())).collect();
            }
            _ => o.scenes.push(word),
        }
    }
    if o.scenes.is_empty() {
        let shared = scenes().join("../../shared/scenes");
        let given = ["killeroo", "living-room-matte"].map(|n| shared.join(format!("{n}/{n}.gltf")));
        let own = scenes().join("creature/creature.gltf");
        let files = given.into_iter().chain([own]).filter(|f| f.exists());
        o.scenes = files.map(|f| f.display().to_string()).chain(["million".into()]).collect();
    }
    o
}

fn main() {
    let o = options();
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(o.threads).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start {} threads: {e}", o.threads),
    };
    let folder = std::env::temp_dir().join(format!("hotspot-trace-{}", std::process::id()));
    let mut peer = o.driver.as_ref().and_then(|driver| match Peer::start(driver, &folder) {
        Ok(peer) => Some(peer),
        Err(e) => {
            println!("without Embree: {}: {e} (benches/embree/build.sh compiles it)", driver.display());
            None
        }
    });
    println!("isa {}, {} rounds, rays of {} x {} pixels", o.isa.name(), o.rounds, o.size, o.size);
    for name in &o.scenes {
        let soup = if name == "million" { Soup::million() } else { Soup::load(name.as_ref()) };
        let built = pool.install(|| builds(&o, &soup, peer.as_mut()));
        for kind in Kind::ALL {
            compare(&o, &soup, kind, &built, peer.as_mut());
        }
    }
    leaks(&o, peer.as_mut());
    drop(peer);
    let _ = std::fs::remove_dir_all(folder);
}

/// Trees by quality, and the seconds that each took.
struct Built {
    bvhs: Vec<Bvh>,
    seconds: Vec<f64>,
}

/// Builds with each quality, in turns with Embree: medians of seconds.
fn builds(o: &Options, soup: &Soup, mut peer: Option<&mut Peer>) -> Built {
    let triangles = &soup.triangles;
    println!("\n{}: {} triangles", soup.name, triangles.len());
    println!("  {:<22} {:>9} {:>7} {:>12}", "build", "seconds", "ratio", "bytes/tri");
    let rounds = o.rounds.clamp(1, 3);
    let mut seconds = vec![Vec::new(); o.qualities.len() + MODES.len()];
    let mut bytes = vec![0.0; seconds.len()];
    let mut bvhs = Vec::new();
    if let Some(peer) = peer.as_deref_mut() {
        peer.triangles(triangles);
    }
    for _ in 0..rounds {
        bvhs.clear();
        for (i, &quality) in o.qualities.iter().enumerate() {
            let start = Instant::now();
            let bvh = match Bvh::build(
                triangles,
                BuildOptions { quality, isa: o.isa, ..BuildOptions::default() },
            ) {
                Ok(bvh) => bvh,
                Err(e) => panic!("{e}"),
            };
            seconds[i].push(start.elapsed().as_secs_f64());
            bytes[i] = bvh.memory() as f64;
            bvhs.push(bvh);
        }
        if let Some(peer) = peer.as_deref_mut() {
            for (m, mode) in MODES.iter().enumerate() {
                let built = peer.build(mode, o.threads);
                seconds[o.qualities.len() + m].push(built.seconds);
                bytes[o.qualities.len() + m] = built.bytes;
            }
        }
    }
    let names = o.qualities.iter().map(|q| format!("hotspot {}", q.name()));
    let names = names.chain(MODES.iter().map(|m| format!("embree {m}, high")));
    let medians: Vec<f64> = seconds.iter_mut().map(|s| median(s)).collect();
    for (i, name) in names.enumerate().filter(|(i, _)| !seconds[*i].is_empty()) {
        let per = bytes[i] / triangles.len() as f64;
        // The first Embree build is the measure.
        let ratio = medians[i] / medians[o.qualities.len()];
        println!("  {name:<22} {:>9.3} {ratio:>7.2} {per:>12.1}", medians[i]);
    }
    Built { bvhs, seconds: medians[..o.qualities.len()].to_vec() }
}

/// From how many rays on a slower build has paid for itself by faster rays, given the seconds of builds and of a ray each;
/// `None`: never.
fn break_even(build: [f64; 2], ray: [f64; 2]) -> Option<f64> {
    let (costs, gains) = (build[1] - build[0], ray[0] - ray[1]);
    (gains > 0.0).then(|| costs.max(0.0) / gains)
}

/// Our side.
fn trace(o: &Options, bvh: &Bvh, kind: Kind, rays: &[Ray], found: &mut [Option<Hit>], blocked: &mut [bool]) {
    match kind {
        Kind::Shadow => query::any(bvh, o.isa, rays, blocked),
        Kind::Packets => query::packets(bvh, o.isa, rays, found),
        Kind::Primary | Kind::Bounce => query::closest(bvh, o.isa, rays, found),
    };
}

/// Traces in turns.
fn compare(o: &Options, soup: &Soup, kind: Kind, built: &Built, mut peer: Option<&mut Peer>) {
    let bvhs = &built.bvhs[..];
    let rays = rays(soup, &bvhs[0], o.size, kind);
    if rays.is_empty() {
        return;
    }
    let any = kind == Kind::Shadow;
    let count = rays.len() as f64;
    let mut found: Vec<Option<Hit>> = vec![None; rays.len()];
    let mut blocked = vec![false; rays.len()];
    if let Some(peer) = peer.as_deref_mut() {
        peer.rays(any, &rays);
    }
    let sides = bvhs.len() + if peer.is_some() { MODES.len() } else { 0 };
    let mut seconds = vec![Vec::new(); sides];
    // One round to warm up, then rounds that go through all sides, every other one backwards.
    for round in 0..=o.rounds {
        let mut order: Vec<usize> = (0..sides).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for side in order {
            let time = match (bvhs.get(side), peer.as_deref_mut()) {
                (Some(bvh), _) => {
                    let start = Instant::now();
                    trace(o, bvh, kind, &rays, &mut found, &mut blocked);
                    start.elapsed().as_secs_f64()
                }
                (None, Some(peer)) => peer.run(MODES[side - bvhs.len()]).0,
                (None, None) => continue,
            };
            if round > 0 {
                seconds[side].push(time);
            }
        }
    }
    let rate = |times: &[f64]| count / median(&mut times.to_vec()) * 1e-6;
    for (i, quality) in o.qualities.iter().enumerate() {
        let name = quality.name();
        print!("  {:<8} {name:<7} {:>7.2} Mray/s", kind.name(), rate(&seconds[i]));
        if peer.is_some() {
            for (m, mode) in MODES.iter().enumerate() {
                let theirs = &seconds[bvhs.len() + m];
                // Ratios within a round: both ran within a second of each other.
                let mut ratios: Vec<f64> = seconds[i].iter().zip(theirs).map(|(us, e)| e / us).collect();
                ratios.sort_by(f64::total_cmp);
                let (lo, hi) = (ratios[ratios.len() / 4], ratios[ratios.len() * 3 / 4]);
                print!("   {:.3} x {mode} ({lo:.3}..{hi:.3}; {:.2})", median(&mut ratios), rate(theirs));
            }
        }
        if let Some(before) = i.checked_sub(1) {
            let ray = [before, i].map(|side| 1e-6 / rate(&seconds[side]));
            match break_even([built.seconds[before], built.seconds[i]], ray) {
                Some(rays) => print!("   pays from {:.1} million rays on", rays * 1e-6),
                None => print!("   never pays"),
            }
        }
        println!();
    }
    if let Some(peer) = peer {
        trace(o, &bvhs[0], kind, &rays, &mut found, &mut blocked);
        for mode in MODES {
            peer.run(mode);
            agreement(&format!("{} against {mode}", kind.name()), any, &found, &blocked, &peer.hits(any));
        }
    }
}

/// Says where the two sides differ.
fn agreement(what: &str, any: bool, found: &[Option<Hit>], blocked: &[bool], theirs: &[PeerHit]) {
    let (mut only_us, mut only_them, mut other, mut far) = (0, 0, 0, 0);
    for (i, peer) in theirs.iter().enumerate() {
        let hit = peer.primitive != u32::MAX;
        let ours = if any { blocked[i] } else { found[i].is_some() };
        match (ours, hit) {
            (true, false) => only_us += 1,
            (false, true) => only_them += 1,
            (true, true) if !any => {
                if let Some(ours) = &found[i] {
                    other += u64::from(ours.primitive != peer.primitive);
                    far += u64::from((ours.t - peer.t).abs() > 1e-4 * ours.t.max(peer.t));
                }
            }
            _ => {}
        }
    }
    println!(
        "    {what}: of {} rays {only_us} hit only ours, {only_them} only theirs; {other} another triangle, {far} another t",
        theirs.len()
    );
}

/// Rays from inside a closed mesh at its corners and edges: those that get out.
fn leaks(o: &Options, peer: Option<&mut Peer>) {
    let soup = Soup::ball(141);
    let rays: Vec<Ray> = leak_rays(&soup.triangles, 1_000_000);
    let lost = |hits: u64| rays.len() as u64 - hits;
    println!(
        "\nleaks: {} rays at corners and edges of a closed ball of {} triangles",
        rays.len(),
        soup.triangles.len()
    );
    let mut found = vec![None; rays.len()];
    for &quality in &o.qualities {
        let bvh = match Bvh::build(
            &soup.triangles,
            BuildOptions { quality, isa: o.isa, ..BuildOptions::default() },
        ) {
            Ok(bvh) => bvh,
            Err(e) => panic!("{e}"),
        };
        let hits = query::closest(&bvh, o.isa, &rays, &mut found);
        println!("  hotspot {}: {}", quality.name(), lost(hits));
    }
    if let Some(peer) = peer {
        peer.triangles(&soup.triangles);
        peer.rays(false, &rays);
        for mode in MODES {
            peer.build(mode, o.threads);
            println!("  embree {mode}: {}", lost(peer.run(mode).1));
        }
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
