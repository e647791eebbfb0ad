//! The page for people: one self-contained, offline HTML file per render or comparison.
//!
//! The verdict comes first, then the picture beside a cost map with a read-out of every layer, then the hotspots with
//! cause and fix; raw numbers are folded away. Text is written into the page as HTML, so that it reads without a
//! script; the layers travel as quantised, compressed planes (`codec.rs`) that the page's script unpacks.
//!
//! The page loads nothing from anywhere and forbids itself to. Every name is escaped: scene files may be hostile.

mod codec;
mod compare;
mod escape;
mod input;
mod layers;
mod page;
mod parts;
#[cfg(test)]
mod sample;

pub use compare::compare_html;
pub use input::{
    CardTry, ChangeRow, CompareInput, CompareLayer, Fact, HotspotCard, LedgerRow, LedgerTable, MapLayer,
    ObjectLayer, PairFact, ReportInput, Side, SuggestionRow, TotalRow, ValueKind,
};
pub use page::html;
