//! Changes to try, as the command `whatif` takes them.

use std::fmt;

/// A change that may save.
#[derive(Clone, Debug, PartialEq)]
pub enum Try {
    /// Make a material matte.
    Matte {
        /// Its name.
        material: String,
    },
    /// Make a material rougher.
    Roughness {
        /// Its name.
        material: String,
        /// 0 to 1.
        roughness: f32,
    },
    /// Take an object away: what it costs at most.
    Delete {
        /// Its name.
        object: String,
    },
    /// Move an object.
    Move {
        /// Its name.
        object: String,
        /// In world space.
        by: [f64; 3],
    },
    /// Fewer scattering events.
    MaxDepth(u32),
}

impl fmt::Display for Try {
    /// As options for a shell.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Matte { material } => write!(f, "--matte {}", quoted(material)),
            Self::Roughness { material, roughness } => {
                write!(f, "--roughness {}", quoted(&format!("{material}={roughness}")))
            }
            Self::Delete { object } => write!(f, "--delete {}", quoted(object)),
            Self::Move { object, by: [x, y, z] } => {
                write!(f, "--move {}", quoted(&format!("{object}={x},{y},{z}")))
            }
            Self::MaxDepth(depth) => write!(f, "--max-depth {depth}"),
        }
    }
}

/// A word as a POSIX shell reads it back: bare where that is safe, else in single quotes.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-.=/+,:@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_survive_a_shell() {
        let matte = |material: &str| Try::Matte { material: material.into() }.to_string();
        assert_eq!(matte("Glass"), "--matte Glass");
        assert_eq!(matte("Table top; rm -rf $HOME"), "--matte 'Table top; rm -rf $HOME'");
        assert_eq!(matte("Bob's"), "--matte 'Bob'\\''s'");
        assert_eq!(matte(""), "--matte ''");
        let rough = Try::Roughness { material: "A b".into(), roughness: 0.5 };
        assert_eq!(rough.to_string(), "--roughness 'A b=0.5'");
        assert_eq!(Try::MaxDepth(7).to_string(), "--max-depth 7");
    }
}
