//! Text from anywhere into HTML, and templates filled with it.

pub(super) use crate::names::short;
use crate::names::visible;

/// Text that is safe between tags and in double-quoted attributes, made [`visible`].
pub(super) fn html(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    for c in text.chars().map(visible) {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// A name of at most `limit` characters, escaped.
pub(super) fn name(text: &str, limit: usize) -> String {
    html(&short(text, limit))
}

/// JSON that is safe within a script element: no `<` can end it or open a comment.
pub(super) fn script_json(value: &serde_json::Value) -> String {
    value.to_string().replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Replaces each `{{key}}` of a template by its text, in one pass: what is filled in is never searched again.
pub(super) fn fill(template: &str, texts: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(template.len() + texts.iter().map(|t| t.1.len()).sum::<usize>());
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        out.push_str(before);
        let Some((key, tail)) = after.split_once("}}") else {
            rest = after;
            break;
        };
        out.extend(texts.iter().find(|t| t.0 == key).map(|t| t.1));
        rest = tail;
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_escapes() {
        assert_eq!(html("<b a=\"x\">'&"), "&lt;b a=&quot;x&quot;&gt;&#39;&amp;");
        assert_eq!(html("a\u{202e}b\0"), "a\u{fffd}b\u{fffd}");
        assert_eq!(name("äöü", 2), "äö…");
        let json = script_json(&serde_json::json!({ "n": "</script><!--&" }));
        assert!(!json.contains('<') && !json.contains('&'), "{json}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap()["n"], "</script><!--&");
    }

    #[test]
    fn templates_are_filled_once() {
        assert_eq!(fill("a{{x}}b{{y}}c{{z}}", &[("x", "{{y}}"), ("y", "Y")]), "a{{y}}bYc");
        assert_eq!(fill("{{open", &[]), "open");
    }
}
