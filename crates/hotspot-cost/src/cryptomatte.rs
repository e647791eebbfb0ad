//! Cryptomatte 1.2 (Friedman and Jones, Psyop): mattes of everything that has a name, with its share of each pixel.
//!
//! For each pixel the [`RANKS`] names that cover most of it, each as the hash of its name (32-bit MurmurHash3 with seed 0 over
//! UTF-8, the exponent kept off 0 and 255, read as a float) and its coverage. Channels are `<layer>00.r` (hash), `.g`
//! (coverage), `.b`, `.a` (the next rank), `<layer>01.r` …; the header holds `cryptomatte/<key>/name`, `hash`, `conversion` and
//! `manifest`. Coverage is a share of the pixel's camera samples (box filter), so that it sums to alpha wherever no more than
//! [`RANKS`] names meet in a pixel.

use crate::layers::Layers;
use hotspot_probe::NONE;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, HashMap, HashSet};

/// Names kept of each pixel: three layers of two.
pub const RANKS: usize = 6;

/// A name and its share of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rank {
    /// Index of the name, [`NONE`] where fewer names meet in the pixel.
    pub id: u32,
    /// Share of the pixel, 0..=1.
    pub coverage: f32,
}

impl Rank {
    /// Nothing.
    pub const EMPTY: Self = Self { id: NONE, coverage: 0.0 };
}

/// What covers one pixel, largest first, the lower index first among equals.
pub type Ranks = [Rank; RANKS];

/// Counts what the samples of one pixel meet.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    counts: Vec<(u32, u64)>,
}

impl Coverage {
    /// One sample met the name of this index.
    #[inline]
    pub fn add(&mut self, id: u32) {
        match self.counts.iter_mut().find(|(known, _)| *known == id) {
            Some((_, count)) => *count += 1,
            None => self.counts.push((id, 1)),
        }
    }

    /// The shares of `samples` samples; empties the counter for the next pixel.
    pub fn finish(&mut self, samples: u64) -> Ranks {
        self.counts.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        let mut ranks = [Rank::EMPTY; RANKS];
        for (rank, &(id, count)) in ranks.iter_mut().zip(&self.counts) {
            *rank = Rank { id, coverage: (count as f64 / samples.max(1) as f64) as f32 };
        }
        self.counts.clear();
        ranks
    }
}

/// MurmurHash3_x86_32 (Austin Appleby, public domain) with seed 0.
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
    let mut hash = 0u32;
    let mut blocks = bytes.chunks_exact(4);
    for block in &mut blocks {
        hash = (hash ^ scramble(word(block))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    hash ^= scramble(word(blocks.remainder()));
    hash ^= bytes.len() as u32;
    hash = (hash ^ (hash >> 16)).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ (hash >> 13)).wrapping_mul(0xc2b2_ae35);
    hash ^ (hash >> 16)
}

/// The bits of a name's id: its hash, one bit of the exponent turned over where the float would be denormal, infinite or not
/// a number. Never 0, which stands for nothing.
fn id_bits(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

/// A name's id as the pixels hold it (`uint32_to_float32`).
pub fn id_of(name: &str) -> f32 {
    f32::from_bits(id_bits(name))
}

/// Adds the channels of a layer such as `CryptoObject` to `layers`, and what describes them to a header's `attributes`.
///
/// The manifest lists the names that occur in the picture. A name that is there already, or whose hash is, gets ` #2`, ` #3` … so
/// that nothing merges.
///
/// # Panics
/// When there are not as many ranks as pixels.
pub fn add(
    layers: &mut Layers,
    attributes: &mut BTreeMap<String, String>,
    layer: &str,
    pixels: &[Ranks],
    names: &[String],
) {
    assert_eq!(pixels.len(), layers.pixels(), "{layer} does not fit the picture");
    let (ids, manifest) = manifest(pixels, names);
    for (place, rank) in (0..RANKS).enumerate() {
        let [id, coverage] = if place % 2 == 0 { ["r", "g"] } else { ["b", "a"] };
        let channel = |suffix: &str| format!("{layer}{:02}.{suffix}", place / 2);
        let hash = |ranks: &Ranks| ids.get(&ranks[rank].id).copied().map_or(0.0, f32::from_bits);
        layers.insert(channel(id), pixels.iter().map(hash).collect());
        let share =
            |ranks: &Ranks| if ids.contains_key(&ranks[rank].id) { ranks[rank].coverage } else { 0.0 };
        layers.insert(channel(coverage), pixels.iter().map(share).collect());
    }
    let key = format!("{:08x}", id_bits(layer));
    for (attribute, value) in [
        ("name", layer),
        ("hash", "MurmurHash3_32"),
        ("conversion", "uint32_to_float32"),
        ("manifest", &Value::Object(manifest).to_string()),
    ] {
        attributes.insert(format!("cryptomatte/{}/{attribute}", &key[..7]), value.to_owned());
    }
}

/// The ids of the names that occur, by index, and the manifest: name to hash in hexadecimal.
fn manifest(pixels: &[Ranks], names: &[String]) -> (HashMap<u32, u32>, Map<String, Value>) {
    let mut occurring: Vec<u32> = Vec::new();
    let mut seen = vec![false; names.len()];
    for rank in pixels.iter().flatten() {
        if let Some(seen) = seen.get_mut(rank.id as usize)
            && !core::mem::replace(seen, true)
        {
            occurring.push(rank.id);
        }
    }
    // In the order of the names, so that a suffix does not depend on the picture's first pixel.
    occurring.sort_unstable();
    let mut taken = HashSet::new();
    let (mut ids, mut manifest) = (HashMap::new(), Map::new());
    for index in occurring {
        let given = &names[index as usize];
        let mut name = given.clone();
        let mut number = 2;
        while manifest.contains_key(&name) || taken.contains(&id_bits(&name)) {
            name = format!("{given} #{number}");
            number += 1;
        }
        let bits = id_bits(&name);
        taken.insert(bits);
        ids.insert(index, bits);
        manifest.insert(name, Value::String(format!("{bits:08x}")));
    }
    (ids, manifest)
}

/// What covers most of each pixel: indices into the names, [`NONE`] where nothing does. Of the Cryptomatte whose name ends in
/// `layer` (renderers put a prefix before it), whatever the case of its letters and of its channels; `None` where the file has
/// none, or without a manifest in its header.
pub fn largest(
    layers: &Layers,
    attributes: &BTreeMap<String, String>,
    layer: &str,
) -> Option<(Vec<u32>, Vec<String>)> {
    let wanted = layer.to_lowercase();
    let (key, name) = attributes.iter().find_map(|(attribute, value)| {
        let key = attribute.strip_prefix("cryptomatte/")?.strip_suffix("/name")?;
        value.to_lowercase().ends_with(&wanted).then_some((key, value))
    })?;
    let manifest: Map<String, Value> =
        serde_json::from_str(attributes.get(&format!("cryptomatte/{key}/manifest"))?).ok()?;
    let plane = |suffixes: [&str; 3]| suffixes.iter().find_map(|s| layers.plane(&format!("{name}00.{s}")));
    let (ids, shares) = (plane(["r", "R", "red"])?, plane(["g", "G", "green"])?);
    let mut names = Vec::with_capacity(manifest.len());
    let mut index_of = HashMap::new();
    for (name, hash) in manifest {
        let Some(bits) = hash.as_str().and_then(|hex| u32::from_str_radix(hex, 16).ok()) else { continue };
        index_of.insert(bits, names.len() as u32);
        names.push(name);
    }
    let index =
        |(id, share): (&f32, &f32)| if *share > 0.0 { index_of.get(&id.to_bits()).copied() } else { None };
    Some((ids.iter().zip(shares).map(|pixel| index(pixel).unwrap_or(NONE)).collect(), names))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values of Psyop's own tests of its decoder, and known hashes of MurmurHash3_x86_32 with a remainder of each length.
    #[test]
    fn names_hash_as_published() {
        let published = [
            ("hello", 6.070_562_7e-17),
            ("cube", -4.084_619_1e15),
            ("sphere", 2.790_186e15),
            ("plane", 3.665_576_2e-11),
            ("равнина", -1.319_263_1e-25),
            ("mädchen", 6.236_13e25),
        ];
        for (name, value) in published {
            let id = id_of(name);
            assert!((id / value - 1.0).abs() < 1e-6, "{name}: {id:e} {value:e}");
        }
        for (text, hash) in [("", 0), ("test", 0xba6b_d213), ("Hello, world!", 0xc036_3e43)] {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
        // Exponent 0: the float would be 0.
        assert_eq!(id_bits(""), 1 << 23);
    }

    #[test]
    fn shares_are_ranked_and_the_counter_starts_anew() {
        let mut coverage = Coverage::default();
        for id in [7, 3, 3, 9, 7, 3] {
            coverage.add(id);
        }
        let ranks = coverage.finish(8);
        assert_eq!(ranks.map(|r| r.id), [3, 7, 9, NONE, NONE, NONE]);
        assert_eq!(ranks.map(|r| r.coverage), [0.375, 0.25, 0.125, 0.0, 0.0, 0.0]);
        assert_eq!(coverage.finish(0), [Rank::EMPTY; RANKS]);
        (0..9).for_each(|id| coverage.add(id % 8));
        assert_eq!(coverage.finish(9).map(|r| r.id), [0, 1, 2, 3, 4, 5], "equal shares by index");
    }

    fn pixel(covers: &[(u32, f32)]) -> Ranks {
        let mut ranks = [Rank::EMPTY; RANKS];
        for (rank, &(id, coverage)) in ranks.iter_mut().zip(covers) {
            *rank = Rank { id, coverage };
        }
        ranks
    }

    #[test]
    fn a_layer_comes_back() {
        let mut layers = Layers::new(2, 2);
        let mut attributes = BTreeMap::new();
        let names = ["Wall", "unseen", "Lamp \"{}\" ä", "Wall", "Wall #2"].map(String::from);
        let pixels =
            [pixel(&[(0, 0.75), (2, 0.25)]), pixel(&[(3, 1.0)]), pixel(&[]), pixel(&[(4, 0.5), (77, 0.25)])];
        add(&mut layers, &mut attributes, "CryptoObject", &pixels, &names);
        let channels: Vec<&str> = layers.planes.keys().map(String::as_str).collect();
        let expected: Vec<String> = ["00", "01", "02"]
            .iter()
            .flat_map(|n| ["a", "b", "g", "r"].map(|c| format!("CryptoObject{n}.{c}")))
            .collect();
        assert_eq!(channels, expected);
        assert_eq!(attributes["cryptomatte/3ae39a5/name"], "CryptoObject");
        assert_eq!(attributes["cryptomatte/3ae39a5/hash"], "MurmurHash3_32");
        assert_eq!(attributes["cryptomatte/3ae39a5/conversion"], "uint32_to_float32");
        let manifest: Map<String, Value> =
            serde_json::from_str(&attributes["cryptomatte/3ae39a5/manifest"]).unwrap();
        // The second wall is told from the first, and the object of that very name from both.
        let listed: Vec<&str> = manifest.keys().map(String::as_str).collect();
        assert_eq!(listed, ["Lamp \"{}\" ä", "Wall", "Wall #2", "Wall #2 #2"]);
        for (name, hash) in &manifest {
            assert_eq!(hash.as_str().unwrap(), format!("{:08x}", id_of(name).to_bits()));
        }
        let plane = |name: &str| layers.plane(name).unwrap();
        assert_eq!(plane("CryptoObject00.r")[..2], [id_of("Wall"), id_of("Wall #2")]);
        assert_eq!(
            (plane("CryptoObject00.b")[0], plane("CryptoObject00.a")[0]),
            (id_of("Lamp \"{}\" ä"), 0.25)
        );
        // Without a name in the list there is no matte.
        assert_eq!((plane("CryptoObject00.b")[3], plane("CryptoObject00.a")[3]), (0.0, 0.0));

        let (ids, found) = largest(&layers, &attributes, "CryptoObject").unwrap();
        let named: Vec<Option<&str>> =
            ids.iter().map(|id| found.get(*id as usize).map(String::as_str)).collect();
        assert_eq!(named, [Some("Wall"), Some("Wall #2"), None, Some("Wall #2 #2")]);
        assert!(largest(&layers, &attributes, "CryptoMaterial").is_none());
    }

    #[test]
    fn other_renderers_mattes_are_read_and_broken_ones_are_none() {
        let mut layers = Layers::new(1, 1);
        layers.insert("ViewLayer.CryptoObject00.R", vec![id_of("Cube")]);
        layers.insert("ViewLayer.CryptoObject00.G", vec![1.0]);
        let mut attributes = BTreeMap::from([
            ("cryptomatte/1234567/name".to_owned(), "ViewLayer.CryptoObject".to_owned()),
            (
                "cryptomatte/1234567/manifest".to_owned(),
                format!("{{\"Cube\":\"{:08x}\",\"odd\":3,\"worse\":\"xyz\"}}", id_of("Cube").to_bits()),
            ),
        ]);
        let (ids, names) = largest(&layers, &attributes, "CryptoObject").unwrap();
        assert_eq!(names[ids[0] as usize], "Cube");
        attributes.insert("cryptomatte/1234567/manifest".into(), "[not json".into());
        assert!(largest(&layers, &attributes, "CryptoObject").is_none());
    }
}
