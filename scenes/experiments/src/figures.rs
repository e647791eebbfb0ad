//! The four figures: what the paper claims, what is measured here, and whether that agrees.

mod color;
mod correspondence;
mod gap;
mod material;

use crate::stage::{Scale, Subject};
use image::RgbImage;

/// Whether a claim holds here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Agrees,
    Differs,
}

impl Verdict {
    pub(crate) const fn of(holds: bool) -> Self {
        if holds { Self::Agrees } else { Self::Differs }
    }

    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "differs",
        }
    }
}

/// A claim beside what is measured.
pub(crate) struct Claim {
    /// What the paper says, in short.
    pub(crate) paper: &'static str,
    /// The figures here, with intervals.
    pub(crate) ours: String,
    /// Decided by the figures.
    pub(crate) verdict: Verdict,
    /// Why it may differ. May be empty.
    pub(crate) why: &'static str,
}

/// A picture with a caption.
pub(crate) struct Panel {
    pub(crate) caption: String,
    pub(crate) image: RgbImage,
}

/// One figure on one scene.
pub(crate) struct Figure {
    pub(crate) title: &'static str,
    pub(crate) scene: String,
    pub(crate) settings: String,
    pub(crate) panels: Vec<Panel>,
    pub(crate) claims: Vec<Claim>,
}

pub(crate) fn panel(caption: impl Into<String>, image: RgbImage) -> Panel {
    Panel { caption: caption.into(), image }
}

/// The figures asked for (1 to 4) on all scenes that are there; each is handed on as soon as it is done.
pub(crate) fn all(scale: Scale, wanted: &[u8], mut done: impl FnMut(&Figure)) -> Result<Vec<Figure>, String> {
    let mut figures = Vec::new();
    let mut add = |figure: Figure| {
        done(&figure);
        figures.push(figure);
    };
    if wanted.contains(&1) {
        for subject in [Subject::shared("killeroo")?, Some(Subject::own("creature")?)].into_iter().flatten() {
            add(correspondence::figure(&subject, scale)?);
        }
    }
    if wanted.contains(&2) {
        for [a, b] in pairs(["cornell-box-red", "cornell-box-blue"])? {
            add(color::figure(&a, &b, scale)?);
        }
    }
    if wanted.contains(&3) {
        let shared = (Subject::shared("living-room-substrate")?, Subject::shared("living-room-matte")?);
        if let (Some(a), Some(b)) = shared {
            add(material::figure(&a, &b, scale)?);
        }
        let (a, b) = (Subject::own("white-room-substrate")?, Subject::own("white-room-matte")?);
        add(material::figure(&a, &b, scale)?);
    }
    if wanted.contains(&4) {
        let (wide, narrow) = (Subject::own("mirror-gap-wide")?, Subject::own("mirror-gap-narrow")?);
        add(gap::figure(&wide, &narrow, scale)?);
    }
    Ok(figures)
}

/// The shared pair where it is there, and the project's own.
fn pairs(names: [&str; 2]) -> Result<Vec<[Subject; 2]>, String> {
    let mut pairs = Vec::new();
    if let (Some(a), Some(b)) = (Subject::shared(names[0])?, Subject::shared(names[1])?) {
        pairs.push([a, b]);
    }
    pairs.push([Subject::own(names[0])?, Subject::own(names[1])?]);
    Ok(pairs)
}
