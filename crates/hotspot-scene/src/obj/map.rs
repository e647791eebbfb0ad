//! Texture statements of MTL files: options, then a file name.

use super::text::Statement;
use crate::error::Result;
use crate::scene::{Channel, Wrap};

/// A texture statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) wrap: Wrap,
    /// Of the flipped coordinates, as [`crate::TextureRef::transform`].
    pub(super) transform: [[f32; 3]; 2],
    /// What `-imfchan` picks where a number is read.
    pub(super) channel: Option<Channel>,
    /// Options that change the picture and are not modelled.
    pub(super) unmodelled: Vec<String>,
}

/// Reads a texture statement. The name is the rest after the options, and may hold spaces.
pub(super) fn read(statement: &Statement<'_>) -> Result<Map> {
    let mut wrap = Wrap::Repeat;
    let (mut offset, mut scale) = ([0.0f32; 2], [1.0f32; 2]);
    let (mut channel, mut unmodelled) = (None, Vec::new());
    let mut words = statement.all_words().peekable();
    while let Some(option) = words.next_if(|word| is_option(word)) {
        match option {
            "-o" | "-s" | "-t" => {
                // One to three numbers.
                let mut values = [None; 3];
                for value in &mut values {
                    // The name may begin with a digit, but is not a number.
                    if let Some(word) = words.next_if(|word| statement.number(word).is_ok()) {
                        *value = Some(finite(statement, word)?);
                    }
                }
                let target = match option {
                    "-o" => &mut offset,
                    "-s" => &mut scale,
                    _ => {
                        if values.iter().flatten().any(|value| *value != 0.0) {
                            unmodelled.push("-t (turbulence)".into());
                        }
                        continue;
                    }
                };
                for (target, value) in target.iter_mut().zip(values) {
                    *target = value.unwrap_or(*target);
                }
            }
            "-clamp" => {
                if words.next() == Some("on") {
                    wrap = Wrap::Clamp;
                }
            }
            "-imfchan" => {
                channel = match words.next() {
                    Some("g") => Some(Channel::G),
                    Some("b") => Some(Channel::B),
                    Some("m") => Some(Channel::A),
                    // Luminance and depth: grey pictures have it in each.
                    _ => Some(Channel::R),
                };
            }
            "-mm" => {
                // What is added, and what multiplies.
                let mut identity = true;
                for neutral in [0.0, 1.0] {
                    if let Some(word) = words.next_if(|word| statement.number(word).is_ok()) {
                        identity &= finite(statement, word)? == neutral;
                    }
                }
                if !identity {
                    unmodelled.push("-mm".into());
                }
            }
            // -blendu, -blendv, -cc, -boost, -texres, -bm, -type: how to filter, or for what is not modelled anyway.
            _ => {
                words.next();
            }
        }
    }
    let name = words.collect::<Vec<_>>().join(" ");
    if name.is_empty() {
        return Err(statement.wrong("no file is named here"));
    }
    // v' = s v + o, with v counted from the lower edge: 1 - v' = s (1 - v) + (1 - s - o).
    let transform = [[scale[0], 0.0, offset[0]], [0.0, scale[1], 1.0 - scale[1] - offset[1]]];
    if !transform.iter().flatten().all(|n| n.is_finite()) {
        return Err(statement.wrong("a number is too large"));
    }
    Ok(Map { name, line: statement.line, wrap, transform, channel, unmodelled })
}

/// An option rather than a file whose name begins with a hyphen.
fn is_option(word: &str) -> bool {
    const OPTIONS: [&str; 13] = [
        "-o", "-s", "-t", "-mm", "-clamp", "-imfchan", "-blendu", "-blendv", "-cc", "-boost", "-texres",
        "-bm", "-type",
    ];
    OPTIONS.contains(&word)
}

/// A word as a finite number.
pub(super) fn finite(statement: &Statement<'_>, word: &str) -> Result<f32> {
    if word.is_empty() {
        return Err(statement.wrong("no value follows"));
    }
    let number = statement.number(word)?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(statement.wrong(format!("{word} is not a finite number")))
    }
}
