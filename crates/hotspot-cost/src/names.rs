//! Names from files that may be hostile, made fit to be read.

/// The first `limit` characters made [`visible`], with an ellipsis where more followed.
pub(crate) fn short(text: &str, limit: usize) -> String {
    let mut characters = text.chars().map(visible);
    let mut out: String = characters.by_ref().take(limit).collect();
    if characters.next().is_some() {
        out.push('…');
    }
    out
}

/// [`short`] within a sentence: on one line.
pub(crate) fn in_sentence(text: &str, limit: usize) -> String {
    short(text, limit).replace(['\n', '\t'], "\u{fffd}")
}

/// Characters that hide or reorder text (controls, bidirectional marks and overrides, what has no width) become a visible
/// replacement; newlines and tabs stay.
pub(crate) const fn visible(c: char) -> char {
    match c {
        '\n' | '\t' => c,
        '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' => '\u{fffd}',
        '\u{61c}' | '\u{200b}' | '\u{200e}' | '\u{200f}' | '\u{feff}' => '\u{fffd}',
        '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '\u{fffd}',
        c => c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_sentences_stay_on_one_line() {
        assert_eq!(in_sentence("a\nb\u{202e}c\u{1b}[2J", 60), "a\u{fffd}b\u{fffd}c\u{fffd}[2J");
        assert_eq!(in_sentence("äöüß", 3), "äöü…");
        assert_eq!(short("a\nb", 9), "a\nb");
    }
}
