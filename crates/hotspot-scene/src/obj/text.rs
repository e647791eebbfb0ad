//! Lines and words of OBJ and MTL files, as programs of four decades write them.
//!
//! Lines end in LF, CR LF or CR. Names in encodings older than UTF-8 are read as Latin-1, which keeps different names
//! different whatever the encoding was. Numbers may have decimal commas, and be what C libraries print for "not a number".

use std::borrow::Cow;
use std::cell::Cell;

use crate::LoadError;
use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid, limit};
use crate::notes::Notes;

/// Longest line, continuations included: a polygon of a hundred thousand corners fits.
const MAX_LINE: usize = 1 << 20;

/// What was mended while reading a file: how often, and the line of the first.
#[derive(Default)]
pub(super) struct Mended {
    commas: Cell<(u64, usize)>,
    latin1: Cell<(u64, usize)>,
}

impl Mended {
    /// Notes what was mended in `file` (empty for the OBJ file itself).
    pub(super) fn note(&self, file: &str, notes: &mut Notes) {
        let note = |notes: &mut Notes, what, (count, line): (u64, usize)| {
            let gap = if file.is_empty() { "" } else { " " };
            notes.repair(what, &format!("{file}{gap}line {line} and on"), count);
        };
        note(notes, "decimal commas read as points", self.commas.get());
        note(notes, "text that is not UTF-8 read as Latin-1", self.latin1.get());
    }
}

fn count(cell: &Cell<(u64, usize)>, line: usize) {
    let (count, first) = cell.get();
    cell.set((count.saturating_add(1), if count == 0 { line } else { first }));
}

/// A line with something on it.
pub(super) struct Statement<'a> {
    /// From 1; the first of continued lines.
    pub(super) line: usize,
    text: Cow<'a, str>,
    mended: &'a Mended,
}

impl Statement<'_> {
    pub(super) fn keyword(&self) -> &str {
        self.text.split_ascii_whitespace().next().unwrap_or_default()
    }

    /// The words after the keyword, up to a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.all_words().take_while(|word| !word.starts_with('#'))
    }

    /// The words after the keyword where `#` may begin a name.
    pub(super) fn all_words(&self) -> impl Iterator<Item = &str> {
        self.text.split_ascii_whitespace().skip(1)
    }

    /// Everything after the keyword: names may hold spaces and `#`.
    pub(super) fn rest(&self) -> &str {
        let blank = |c: char| c.is_ascii_whitespace();
        self.text.split_once(blank).map_or("", |(_, rest)| rest.trim_matches(blank))
    }

    pub(super) fn place(&self) -> String {
        format!("line {}", self.line)
    }

    pub(super) fn wrong(&self, problem: impl Into<String>) -> LoadError {
        invalid(self.place(), problem, REEXPORT)
    }

    /// A word as a number, which may be NaN or infinite.
    pub(super) fn number(&self, word: &str) -> Result<f32> {
        if let Ok(number) = word.parse() {
            return Ok(number);
        }
        // One comma between digits is a decimal comma; more of them part a list.
        if word.matches(',').count() == 1
            && !word.contains('.')
            && let Ok(number) = word.replace(',', ".").parse::<f32>()
        {
            count(&self.mended.commas, self.line);
            return Ok(number);
        }
        // `-1.#IND`, `1.#QNAN`, `1.#INF`, `-nan(ind)`: C libraries of Windows.
        let lower = word.to_ascii_lowercase();
        if lower.contains(".#") || lower.trim_start_matches('-').starts_with("nan(") {
            return Ok(f32::NAN);
        }
        Err(self.wrong(format!("\"{word}\" is not a number")))
    }

    /// The first `N` words after the keyword as numbers, which may be NaN or infinite.
    pub(super) fn numbers<const N: usize>(&self) -> Result<[f32; N]> {
        let mut numbers = [0.0; N];
        let mut words = self.words();
        for number in &mut numbers {
            let word = words.next().ok_or_else(|| self.wrong(format!("{N} numbers are needed here")))?;
            *number = self.number(word)?;
        }
        Ok(numbers)
    }
}

/// The statements of a file, without comments and empty lines.
pub(super) struct Statements<'a> {
    rest: &'a [u8],
    line: usize,
    mended: &'a Mended,
}

impl<'a> Statements<'a> {
    pub(super) fn new(bytes: &'a [u8], mended: &'a Mended) -> Self {
        Self { rest: bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), line: 0, mended }
    }

    pub(super) fn next(&mut self) -> Result<Option<Statement<'a>>> {
        while !self.rest.is_empty() {
            let line = self.line + 1;
            let bytes = self.joined_line(line)?;
            if matches!(bytes.first(), None | Some(b'#')) {
                continue;
            }
            let (text, is_utf8) = match bytes {
                Cow::Borrowed(bytes) => decode(bytes),
                Cow::Owned(bytes) => {
                    let (text, is_utf8) = decode(&bytes);
                    (Cow::Owned(text.into_owned()), is_utf8)
                }
            };
            if !is_utf8 {
                count(&self.mended.latin1, line);
            }
            return Ok(Some(Statement { line, text, mended: self.mended }));
        }
        Ok(None)
    }

    /// A line with those that continue it after a final backslash, without space around it.
    fn joined_line(&mut self, first: usize) -> Result<Cow<'a, [u8]>> {
        let mut piece = self.single_line();
        let is_comment = piece.trim_ascii_start().first() == Some(&b'#');
        let mut joined: Option<Vec<u8>> = None;
        while let Some(stem) = continued(piece).filter(|_| !is_comment) {
            let joined = joined.get_or_insert_default();
            joined.extend(stem);
            joined.push(b' ');
            if joined.len() > MAX_LINE {
                break;
            }
            piece = self.single_line();
        }
        let line = match joined {
            None => Cow::Borrowed(piece),
            Some(mut joined) => {
                joined.extend(piece);
                Cow::Owned(joined)
            }
        };
        if line.len() > MAX_LINE {
            return Err(limit(
                format!("line {first}"),
                format!("the line is longer than {MAX_LINE} bytes"),
                "check that this is a text file, or split the line",
            ));
        }
        Ok(match line {
            Cow::Borrowed(line) => Cow::Borrowed(line.trim_ascii()),
            Cow::Owned(line) => Cow::Owned(line.trim_ascii().to_vec()),
        })
    }

    /// The bytes up to the end of the line; empty at the end of the file.
    fn single_line(&mut self) -> &'a [u8] {
        self.line += 1;
        let Some(end) = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            return std::mem::take(&mut self.rest);
        };
        let (line, rest) = self.rest.split_at_checked(end).unwrap_or((self.rest, &[]));
        self.rest = rest.strip_prefix(b"\r\n").or(rest.get(1..)).unwrap_or_default();
        line
    }
}

/// The file as UTF-8 where its byte order mark says UTF-16, else as it is.
pub(super) fn without_utf16<'a>(bytes: &'a [u8], budget: &Budget) -> Result<Cow<'a, [u8]>> {
    let unit: fn([u8; 2]) -> u16 = match bytes.first_chunk() {
        Some(b"\xFF\xFE") => u16::from_le_bytes,
        Some(b"\xFE\xFF") => u16::from_be_bytes,
        _ => return Ok(Cow::Borrowed(bytes)),
    };
    // Three bytes for each two, while the string grows.
    budget.charge(bytes.len() as u64, 3, "the text in UTF-16")?;
    let units = bytes.as_chunks().0.iter().copied().map(unit);
    let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Ok(Cow::Owned(text.into_bytes()))
}

/// What precedes the backslash at the end of a line that goes on in the next. After a byte beyond ASCII in a line that is
/// not UTF-8, a backslash is the second half of a Shift-JIS character.
fn continued(line: &[u8]) -> Option<&[u8]> {
    let stem = line.strip_suffix(b"\\")?;
    let half = stem.last().is_some_and(|byte| !byte.is_ascii()) && std::str::from_utf8(stem).is_err();
    (!half).then_some(stem)
}

/// Text as UTF-8 (true) or Latin-1 (false).
fn decode(bytes: &[u8]) -> (Cow<'_, str>, bool) {
    match std::str::from_utf8(bytes) {
        Ok(text) => (Cow::Borrowed(text), true),
        Err(_) => (Cow::Owned(bytes.iter().copied().map(char::from).collect()), false),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<(usize, String)> {
        let mended = Mended::default();
        let mut statements = Statements::new(bytes, &mended);
        let mut out = Vec::new();
        while let Some(statement) = statements.next().unwrap() {
            out.push((statement.line, format!("{}|{}", statement.keyword(), statement.rest())));
        }
        out
    }

    #[test]
    fn line_ends_of_three_kinds_and_continuations_keep_their_numbers() {
        let wanted = [(1, "a|1".to_owned()), (3, "b|2   3".to_owned()), (6, "c|".to_owned())];
        for end in ["\n", "\r\n", "\r"] {
            let text = ["a\t1 ", "", "b 2 \\", " 3", "  # x \\", " c"].join(end);
            assert_eq!(lines(text.as_bytes()), wanted, "{end:?}");
            assert_eq!(lines(format!("\u{FEFF}{text}{end}").as_bytes()), wanted, "{end:?}");
        }
        // At the very end, and nothing but continuations.
        assert_eq!(lines(b"a \\"), [(1, "a|".to_owned())]);
        assert_eq!(lines(b"\\\n\\\n\\"), []);
    }

    #[test]
    fn old_encodings_keep_names_apart() {
        // Two characters of Shift-JIS; the second byte of the latter is a backslash, 0x85 and 0xA0 are blanks of Unicode.
        let got = lines(b"o \x95\x85\xA0\no \x95\x5C\no \x95\x86\no W\xE4nde\n");
        assert_eq!(got.len(), 4);
        assert_eq!(got[3].1, "o|W\u{E4}nde");
        assert!(got[0].1 != got[1].1 && got[1].1 != got[2].1);
        assert_eq!(lines("o \u{2003}W\u{E4}nde\u{2003}".as_bytes())[0].1, "o|\u{2003}W\u{E4}nde\u{2003}");
    }

    #[test]
    fn numbers_of_many_programs() {
        let mended = Mended::default();
        let statement = Statement { line: 7, text: Cow::Borrowed(""), mended: &mended };
        for (word, wanted) in [("1.", 1.0), (".5", 0.5), ("+1e-3", 1e-3), ("-1E+2", -100.0), ("1,5", 1.5)] {
            assert_eq!(statement.number(word).unwrap(), wanted, "{word}");
        }
        for word in ["nan", "-nan(ind)", "-1.#IND", "1.#QNAN0"] {
            assert!(statement.number(word).unwrap().is_nan(), "{word}");
        }
        assert_eq!(statement.number("-inf").unwrap(), f32::NEG_INFINITY);
        for word in ["1,2,3", "1,000.5", ",", "", "0x10", "1e", "--1", "1_0"] {
            assert!(statement.number(word).is_err(), "{word}");
        }
        assert_eq!(mended.commas.get(), (1, 7));
    }
}
