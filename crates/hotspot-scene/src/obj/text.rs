//! Lines and words of OBJ and MTL files.

use std::borrow::Cow;

use crate::LoadError;
use crate::error::{REEXPORT, Result, invalid, limit};

/// Longest line, continuations included: a polygon of a hundred thousand corners fits.
const MAX_LINE: usize = 1 << 20;

/// A line with something on it.
pub(super) struct Statement<'a> {
    /// From 1; the first of continued lines.
    pub(super) line: usize,
    text: Cow<'a, str>,
}

impl Statement<'_> {
    pub(super) fn keyword(&self) -> &str {
        self.words_and_keyword().next().unwrap_or_default()
    }

    /// The words after the keyword.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.words_and_keyword().skip(1)
    }

    fn words_and_keyword(&self) -> impl Iterator<Item = &str> {
        self.text.split_whitespace()
    }

    /// Everything after the keyword: names may hold spaces.
    pub(super) fn rest(&self) -> &str {
        self.text.split_once(char::is_whitespace).map_or("", |(_, rest)| rest.trim())
    }

    pub(super) fn place(&self) -> String {
        format!("line {}", self.line)
    }

    pub(super) fn wrong(&self, problem: impl Into<String>) -> LoadError {
        invalid(self.place(), problem, REEXPORT)
    }

    /// A word as a number, which may be NaN or infinite.
    pub(super) fn number(&self, word: &str) -> Result<f32> {
        word.parse().map_err(|_| self.wrong(format!("\"{word}\" is not a number")))
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
}

impl<'a> Statements<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), line: 0 }
    }

    pub(super) fn next(&mut self) -> Result<Option<Statement<'a>>> {
        while !self.rest.is_empty() {
            let first = self.line + 1;
            let text = self.joined_line(first)?;
            let trimmed = match text {
                Cow::Borrowed(text) => Cow::Borrowed(text.trim()),
                Cow::Owned(text) => Cow::Owned(text.trim().to_owned()),
            };
            if !trimmed.is_empty() && !trimmed.starts_with('#') {
                return Ok(Some(Statement { line: first, text: trimmed }));
            }
        }
        Ok(None)
    }

    /// A line with those that continue it after a final backslash.
    fn joined_line(&mut self, first: usize) -> Result<Cow<'a, str>> {
        let mut text = self.single_line();
        while let Some(stem) = text.trim_end_matches('\r').strip_suffix('\\') {
            let mut joined = stem.to_owned();
            joined.push(' ');
            let more = !self.rest.is_empty();
            if more {
                joined.push_str(&self.single_line());
            }
            text = Cow::Owned(joined);
            if text.len() > MAX_LINE {
                break;
            }
        }
        if text.len() > MAX_LINE {
            return Err(limit(
                format!("line {first}"),
                format!("the line is longer than {MAX_LINE} bytes"),
                "check that this is a text file, or split the line",
            ));
        }
        Ok(text)
    }

    fn single_line(&mut self) -> Cow<'a, str> {
        let (line, rest) = match self.rest.iter().position(|byte| *byte == b'\n') {
            Some(end) => self.rest.split_at_checked(end + 1).unwrap_or((self.rest, &[])),
            None => (self.rest, [].as_slice()),
        };
        self.rest = rest;
        self.line += 1;
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        // Names in old encodings are shown with replacement characters; numbers are ASCII.
        String::from_utf8_lossy(line)
    }
}
