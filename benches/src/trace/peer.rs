//! Embree at the other end of a pipe (`benches/embree/driver.cpp`).

use super::soup::Triangle;
use hotspot_bvh::Ray;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A running driver.
pub struct Peer {
    child: Child,
    to: Option<ChildStdin>,
    from: BufReader<ChildStdout>,
    folder: PathBuf,
}

/// What the peer says about a build.
#[derive(Clone, Copy, Debug)]
pub struct PeerBuild {
    /// Seconds it took.
    pub seconds: f64,
    /// Bytes it holds, without the triangles given to it.
    pub bytes: f64,
    /// Its version, as in 40400 for 4.4.0.
    pub version: f64,
}

/// One hit of the peer's.
#[derive(Clone, Copy, Debug)]
pub struct PeerHit {
    /// Distance.
    pub t: f32,
    /// Primitive; `u32::MAX`: a miss.
    pub primitive: u32,
}

impl Peer {
    /// Starts the driver; files for it are written to `folder`.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(driver: &Path, folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        let mut child = Command::new(driver).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let to = child.stdin.take();
        let from = child.stdout.take().ok_or_else(|| std::io::Error::other("no pipe"))?;
        Ok(Self { child, to, from: BufReader::new(from), folder: folder.into() })
    }

    /// Sends a command and reads the numbers of the answer.
    fn ask(&mut self, command: &str) -> Vec<f64> {
        let sent = self.to.as_mut().map(|to| writeln!(to, "{command}").and_then(|()| to.flush()));
        let mut line = String::new();
        let read = self.from.read_line(&mut line);
        match (sent, read) {
            (Some(Ok(())), Ok(n)) if n > 0 => {
                line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
            }
            _ => panic!("the driver did not answer \"{command}\""),
        }
    }

    /// Writes raw f32 into the folder.
    fn write(&self, name: &str, values: impl Iterator<Item = f32>) -> PathBuf {
        let bytes: Vec<u8> = values.flat_map(f32::to_ne_bytes).collect();
        let path = self.folder.join(name);
        match std::fs::write(&path, bytes) {
            Ok(()) => path,
            Err(e) => panic!("cannot write {}: {e}", path.display()),
        }
    }

    /// Gives the triangles.
    pub fn triangles(&mut self, triangles: &[Triangle]) {
        let path = self.write("triangles.f32", triangles.iter().flatten().flatten().copied());
        self.ask(&format!("triangles {}", path.display()));
    }

    /// Builds `mode` (robust or fast) with so many threads.
    pub fn build(&mut self, mode: &str, threads: usize) -> PeerBuild {
        let answer = self.ask(&format!("build {mode} {threads}"));
        PeerBuild { seconds: answer[0], bytes: answer[1], version: answer[2] }
    }

    /// Gives the rays, for any hit or for the nearest.
    pub fn rays(&mut self, any: bool, rays: &[Ray]) {
        let words = rays.iter().flat_map(|r| {
            let ([a, b, c], [d, e, f]) = (r.origin, r.direction);
            [a, b, c, r.t_min, d, e, f, r.t_max]
        });
        let path = self.write("rays.f32", words);
        self.ask(&format!("rays {} {}", if any { "any" } else { "closest" }, path.display()));
    }

    /// Traces them: seconds and hits.
    pub fn run(&mut self, mode: &str) -> (f64, u64) {
        let answer = self.ask(&format!("run {mode}"));
        (answer[0], answer[1] as u64)
    }

    /// The last run's hits; for any hit, t is 1 where blocked.
    ///
    /// # Panics
    /// When the file cannot be read back.
    pub fn hits(&mut self, any: bool) -> Vec<PeerHit> {
        let path = self.folder.join("hits.f32");
        self.ask(&format!("hits {}", path.display()));
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) => panic!("cannot read {}: {e}", path.display()),
        };
        let word = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        if any {
            let hit = |blocked: f32| if blocked > 0.0 { 0 } else { u32::MAX };
            (0..bytes.len() / 4)
                .map(|i| PeerHit { t: 0.0, primitive: hit(f32::from_ne_bytes(word(4 * i))) })
                .collect()
        } else {
            (0..bytes.len() / 28)
                .map(|i| PeerHit {
                    t: f32::from_ne_bytes(word(28 * i)),
                    primitive: u32::from_ne_bytes(word(28 * i + 12)),
                })
                .collect()
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The end of its input ends it.
        self.to = None;
        let _ = self.child.wait();
    }
}
