//! Pieces of HTML that both pages use. Every text is escaped here.

use super::escape;
use super::input::Fact;
use crate::maps::compact;
use std::fmt::Write;

/// Longest name in a card or list.
pub(super) const NAME: usize = 120;
/// Longest sentence.
pub(super) const TEXT: usize = 600;
/// Longest list.
const ROWS: usize = 500;

/// A share as people read it: "41 %", "0.8 %".
pub(super) fn percent(share: f64) -> String {
    // A no-break space.
    if share.is_finite() { format!("{}\u{a0}%", compact(share * 100.0)) } else { "–".into() }
}

/// A change as people read it: "+3.20 %", "−23.1 %". Three digits, zeros kept: the ends of an interval stand side by side.
pub(super) fn change(relative: f64) -> String {
    let percent = 100.0 * relative;
    if !percent.is_finite() {
        return "–".into();
    }
    let decimals = if percent == 0.0 { 0.0 } else { (2.0 - percent.abs().log10().floor()).clamp(0.0, 3.0) };
    let number = format!("{percent:+.*}", decimals as usize);
    // What rounds to nothing has no sign.
    let zero = !number.contains(|c: char| ('1'..='9').contains(&c));
    let number = if zero { "0".into() } else { number.replace('-', "−") };
    format!("{number}\u{a0}%")
}

/// List items "label value".
pub(super) fn facts(facts: &[Fact]) -> String {
    let item = |f: &Fact| {
        format!("<li><span>{}</span> {}</li>", escape::name(&f.label, NAME), escape::name(&f.value, NAME))
    };
    facts.iter().map(item).collect()
}

/// A table: headings, then rows of cells with an optional class each. Nothing without rows.
pub(super) fn table(class: &str, headings: &[&str], rows: &[(&str, Vec<String>)]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let mut out = format!("<div class=\"scroll\"><table class=\"{class}\">");
    if !headings.is_empty() {
        out.push_str("<thead><tr>");
        for heading in headings {
            let _ = write!(out, "<th scope=\"col\">{}</th>", escape::html(heading));
        }
        out.push_str("</tr></thead>");
    }
    out.push_str("<tbody>");
    for (class, cells) in rows.iter().take(ROWS) {
        let _ = write!(out, "<tr class=\"{class}\">");
        for cell in cells {
            let _ = write!(out, "<td>{}</td>", escape::name(cell, TEXT));
        }
        out.push_str("</tr>");
    }
    out + "</tbody></table></div>"
}

/// A box with a heading and points. Nothing without points.
pub(super) fn notice(heading: &str, points: &[String]) -> String {
    if points.is_empty() {
        return String::new();
    }
    let mut out = format!("<div class=\"notice\"><b>{}</b><ul>", escape::html(heading));
    for point in points.iter().take(ROWS) {
        let _ = write!(out, "<li>{}</li>", escape::name(point, TEXT));
    }
    if points.len() > ROWS {
        let _ = write!(out, "<li>… and {} more</li>", points.len() - ROWS);
    }
    out + "</ul></div>"
}

/// The JSON file's text. Nothing when empty.
pub(super) fn raw(json: &str) -> String {
    if json.is_empty() {
        return String::new();
    }
    format!("<details><summary>JSON</summary><pre tabindex=\"0\">{}</pre></details>", escape::html(json))
}

/// A picture element; empty when there are no pixels.
pub(super) fn image(data: Option<&str>, id: &str, description: &str) -> String {
    let Some(data) = data else { return String::new() };
    format!(
        "<img id=\"{id}\" src=\"{data}\" alt=\"{}\" draggable=\"false\">",
        escape::name(description, NAME)
    )
}

/// How the pictures are laid out: the read-out below wide ones, beside others; and the aspect ratio.
pub(super) fn layout(width: u32, height: u32) -> (&'static str, String) {
    let aspect = f64::from(width.max(1)) / f64::from(height.max(1));
    (if aspect >= 1.45 { "wide" } else { "tall" }, format!("{:.4}", aspect.clamp(0.05, 20.0)))
}

/// With spaces inside of "2.3 % ± 0.5 %" at which no line ends.
pub(super) fn unbroken(text: &str) -> String {
    text.replace(" %", "\u{a0}%").replace(" ± ", "\u{a0}±\u{a0}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_changes_read_well() {
        assert_eq!((percent(0.41), percent(0.008)), ("41\u{a0}%".into(), "0.8\u{a0}%".into()));
        assert_eq!((change(-0.231), change(0.032)), ("−23.1\u{a0}%".into(), "+3.20\u{a0}%".into()));
        assert_eq!((change(-0.16), change(147.213)), ("−16.0\u{a0}%".into(), "+14721\u{a0}%".into()));
        assert_eq!((change(-0.0), change(1e-7)), ("0\u{a0}%".into(), "0\u{a0}%".into()));
        assert_eq!((change(f64::NAN), percent(f64::INFINITY)), ("–".into(), "–".into()));
    }

    #[test]
    fn empty_parts_are_empty() {
        assert!(table("", &["a"], &[]).is_empty() && notice("x", &[]).is_empty() && raw("").is_empty());
        assert_eq!(layout(0, 0), ("tall", "1.0000".into()));
    }
}
