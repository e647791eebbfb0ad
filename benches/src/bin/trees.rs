//! What builds of the tree cost and what they give, in numbers that need no quiet machine but for the seconds: visits of the
//! rays of `trace`, bytes, and a hash of each tree, so that two versions of the builder can be held against each other.
//!
//! ```text
//! cargo run --profile bench -p hotspot-benches --bin trees -- [SCENE … | million | grid:N] [--quality fast,medium,high,obvhs]
//!     [--rounds N] [--threads 1,2] [--size N] [--driver FILE]
//! ```
//!
//! `--rounds` builds each that often and prints the fastest and the median (the rays are left out with `--size 0`). With
//! `--driver` (`target/embree/driver`) Embree builds in turns, with as many threads, robust, of high quality.
//! `grid:N` is the height field of 2·N² triangles. Seconds include handing the finished tree out, not its release.
#![expect(clippy::print_stdout, reason = "it prints tables")]

use hotspot_benches::trace::peer::Peer;
use hotspot_benches::trace::rays::{Kind, rays};
use hotspot_benches::trace::soup::Soup;
use hotspot_bvh::{BuildOptions, Bvh, Quality, Ray};
use hotspot_probe::RayProbe;
use std::path::PathBuf;
use std::time::Instant;

/// Counts what a ray visits.
struct Count<'a> {
    sums: &'a mut [u64; 3],
    own: [u64; 3],
}

impl RayProbe for Count<'_> {
    fn node(&mut self, _id: u32, _boxes: u32) {
        self.own[0] += 1;
    }
    fn leaf(&mut self, _id: u32, shapes: u32) {
        self.own[1] += 1;
        self.own[2] += u64::from(shapes);
    }
    fn instance(&mut self, _id: u32) {}
    fn alpha(&mut self, _lookups: u32, _bytes: u32) {}
    fn finish(self, _hit: bool) {
        for (sum, own) in self.sums.iter_mut().zip(self.own) {
            *sum += own;
        }
    }
}

/// Nodes, leaf blocks and triangles per ray.
fn visits(bvh: &Bvh, kind: Kind, rays: &[Ray]) -> [f64; 3] {
    let mut sums = [0; 3];
    for ray in rays {
        let probe = Count { sums: &mut sums, own: [0; 3] };
        if kind == Kind::Shadow {
            bvh.occluded(ray, probe);
        } else {
            bvh.closest_hit(ray, probe);
        }
    }
    sums.map(|sum| sum as f64 / rays.len().max(1) as f64)
}

fn hash(bvh: &Bvh) -> u64 {
    bvh.words().fold(0xcbf2_9ce4_8422_2325, |h, word| (h ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3))
}

fn main() {
    let (mut names, mut rounds, mut size) = (Vec::new(), 5usize, 256u32);
    let (mut threads, mut qualities) = (vec![1usize], vec![Quality::Medium]);
    let mut driver: Option<PathBuf> = None;
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().unwrap_or_else(|| panic!("{word} wants a value"));
        let number = |value: &str| value.parse::<usize>().unwrap_or_else(|e| panic!("{value}: {e}"));
        match word.as_str() {
            "--rounds" => rounds = number(&value()).max(1),
            "--size" => size = number(&value()) as u32 / 16 * 16,
            "--threads" => threads = value().split(',').map(number).collect(),
            "--driver" => driver = Some(value().into()),
            "--quality" => {
                let list = value();
                let all = [Quality::Fast, Quality::Medium, Quality::High, Quality::Obvhs];
                qualities = all.into_iter().filter(|q| list.split(',').any(|w| w == q.name())).collect();
            }
            _ => names.push(word),
        }
    }
    let folder = std::env::temp_dir().join(format!("hotspot-trees-{}", std::process::id()));
    let mut peer = driver.map(|driver| match Peer::start(&driver, &folder) {
        Ok(peer) => peer,
        Err(e) => panic!("{}: {e}", driver.display()),
    });
    for name in &names {
        let soup = match name.strip_prefix("grid:") {
            Some(cells) => Soup::grid(cells.parse().unwrap_or_else(|e| panic!("{cells}: {e}"))),
            None if name == "million" => Soup::million(),
            None => Soup::load(name.as_ref()),
        };
        println!("{}: {} triangles", soup.name, soup.triangles.len());
        if let Some(peer) = &mut peer {
            peer.triangles(&soup.triangles);
        }
        for &threads in &threads {
            seconds(&soup, threads, rounds, &qualities, peer.as_mut());
        }
        for &quality in &qualities {
            let bvh = built(&soup, quality);
            let (bytes, count) = (bvh.memory() as f64, soup.triangles.len() as f64);
            println!("  {:<7} tree {:016x}, {:.1} bytes/tri", quality.name(), hash(&bvh), bytes / count);
            for kind in Kind::ALL.into_iter().filter(|_| size > 0) {
                let [nodes, leaves, shapes] = visits(&bvh, kind, &rays(&soup, &bvh, size, kind));
                println!("    {:<8} {nodes:.4} nodes {leaves:.4} leaves {shapes:.4} shapes", kind.name());
            }
        }
    }
    drop(peer);
    let _ = std::fs::remove_dir_all(folder);
}

fn built(soup: &Soup, quality: Quality) -> Bvh {
    let options = BuildOptions { quality, ..BuildOptions::default() };
    Bvh::build(&soup.triangles, options).unwrap_or_else(|e| panic!("{e}"))
}

/// Builds in turns.
fn seconds(soup: &Soup, threads: usize, rounds: usize, qualities: &[Quality], mut peer: Option<&mut Peer>) {
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool,
        Err(e) => panic!("cannot start {threads} threads: {e}"),
    };
    let mut times = vec![Vec::new(); qualities.len() + usize::from(peer.is_some())];
    for _ in 0..rounds {
        for (times, &quality) in times.iter_mut().zip(qualities) {
            let start = Instant::now();
            let bvh = pool.install(|| built(soup, quality));
            times.push(start.elapsed().as_secs_f64());
            drop(bvh);
        }
        if let (Some(peer), Some(times)) = (&mut peer, times.get_mut(qualities.len())) {
            times.push(peer.build("robust", threads).seconds);
        }
    }
    for times in &mut times {
        times.sort_by(f64::total_cmp);
    }
    let theirs = times.get(qualities.len()).map(|t| (t[0], t[rounds / 2]));
    for (times, quality) in times.iter().zip(qualities) {
        let (least, median) = (times[0], times[rounds / 2]);
        print!("  {:<7} {threads} threads: {least:.4} s at least, {median:.4} s median", quality.name());
        if let Some((t_least, t_median)) = theirs {
            let (a, b) = (least / t_least, median / t_median);
            print!("; Embree {t_least:.4}, {t_median:.4}: ratios {a:.2}, {b:.2}");
        }
        println!();
    }
}
