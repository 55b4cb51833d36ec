//! Text files as lines and as words, with line numbers.

use crate::error::{Error, Name, Place, shown};

/// Whether a byte separates words. Lines may end in `\n`, `\r\n` or, in very old files, `\r`.
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c)
}

/// Parses `word` as a number. Floats are rounded to nearest, as by the standard library's correctly
/// rounding parser.
pub(crate) fn number<T: std::str::FromStr>(
    name: Name,
    place: Place,
    word: &[u8],
    expected: &str,
) -> Result<T, Error> {
    std::str::from_utf8(word)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| name.syntax(place, expected, shown(word)))
}

/// A line of a text file, without its end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'a> {
    pub bytes: &'a [u8],
    /// Counted from 1.
    pub number: u64,
}

impl<'a> Line<'a> {
    pub(crate) fn place(self) -> Place {
        Place::Line(self.number)
    }

    pub(crate) fn words(self) -> impl Iterator<Item = &'a [u8]> {
        self.bytes
            .split(|&b| is_space(b))
            .filter(|word| !word.is_empty())
    }

    /// The part before `mark`, which starts a comment.
    pub(crate) fn before(self, mark: u8) -> Line<'a> {
        let end = self
            .bytes
            .iter()
            .position(|&b| b == mark)
            .unwrap_or(self.bytes.len());
        Line {
            bytes: &self.bytes[..end],
            ..self
        }
    }

    pub(crate) fn is_blank(self) -> bool {
        self.bytes.iter().all(|&b| is_space(b))
    }
}

/// A cursor over a text that returns lines or words, whichever the format needs; both count lines.
#[derive(Debug, Clone)]
pub(crate) struct Text<'a> {
    name: Name<'a>,
    bytes: &'a [u8],
    /// The offset of the next byte.
    offset: usize,
    /// The line that the next byte is on, counted from 1.
    line: u64,
    /// What starts a comment that [`Text::word`] skips, if anything.
    comment: Option<u8>,
    /// If binary data is mixed with text, line numbers mean nothing: places are then offsets in
    /// bytes, added to this base.
    base: Option<usize>,
}

impl<'a> Text<'a> {
    /// A cursor at the start of `bytes`, after the byte order mark that some editors put before
    /// UTF-8.
    pub(crate) fn new(name: Name<'a>, bytes: &'a [u8]) -> Self {
        let offset = if bytes.starts_with(b"\xef\xbb\xbf") {
            3
        } else {
            0
        };
        Text {
            name,
            bytes,
            offset,
            line: 1,
            comment: None,
            base: None,
        }
    }

    /// Makes [`Text::word`] skip from `mark` to the end of its line.
    pub(crate) fn with_comments(mut self, mark: u8) -> Self {
        self.comment = Some(mark);
        self
    }

    /// Makes places offsets in bytes; `base` is where this text starts in its file.
    pub(crate) fn in_bytes(mut self, base: usize) -> Self {
        self.base = Some(base);
        self
    }

    pub(crate) fn place(&self) -> Place {
        match self.base {
            None => Place::Line(self.line),
            Some(base) => Place::Byte((base + self.offset) as u64),
        }
    }

    pub(crate) fn offset(&self) -> usize {
        self.offset
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.offset..]
    }

    /// How many items of at least `bytes` each can still follow: the limit for what a header may
    /// reserve.
    pub(crate) fn room(&self, bytes: usize) -> u64 {
        (self.rest().len() / bytes + 1) as u64
    }

    /// Skips `n` bytes, counting the lines in them.
    pub(crate) fn skip(&mut self, n: usize) {
        let end = self.bytes.len().min(self.offset.saturating_add(n));
        self.line += (self.offset..end).filter(|&at| self.ends_line(at)).count() as u64;
        self.offset = end;
    }

    /// Whether a line ends with the byte at this offset: `\n`, or a `\r` that no `\n` follows.
    fn ends_line(&self, at: usize) -> bool {
        match self.bytes.get(at) {
            Some(b'\n') => true,
            Some(b'\r') => self.bytes.get(at + 1) != Some(&b'\n'),
            _ => false,
        }
    }

    /// The next line, ended by `\n`, `\r\n`, `\r` or the end of the file; `None` at the end of the
    /// file.
    pub(crate) fn line(&mut self) -> Option<Line<'a>> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let number = self.line;
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let end = end.unwrap_or(rest.len());
        let taken = match &rest[end..] {
            [b'\r', b'\n', ..] => 2,
            ended => ended.len().min(1),
        };
        self.offset += end + taken;
        self.line += u64::from(taken > 0);
        Some(Line {
            bytes: &rest[..end],
            number,
        })
    }

    /// The next line that is not blank after removing its comment, which starts with `comment`.
    pub(crate) fn content_line(&mut self, comment: u8) -> Option<Line<'a>> {
        loop {
            let line = self.line()?.before(comment);
            if !line.is_blank() {
                return Some(line);
            }
        }
    }

    /// Like [`Text::content_line`], but the end of the file is an error that says what was
    /// `expected`.
    pub(crate) fn need_content_line(
        &mut self,
        comment: u8,
        expected: &str,
    ) -> Result<Line<'a>, Error> {
        self.content_line(comment).ok_or_else(|| {
            self.name
                .syntax(self.place(), expected, "the end of the file")
        })
    }

    fn skip_space(&mut self) {
        while let Some(&byte) = self.bytes.get(self.offset) {
            if Some(byte) == self.comment {
                while self.offset < self.bytes.len() && !self.ends_line(self.offset) {
                    self.offset += 1;
                }
            } else if is_space(byte) {
                self.line += u64::from(self.ends_line(self.offset));
                self.offset += 1;
            } else {
                break;
            }
        }
    }

    /// The next word, on whatever line; `None` at the end of the file. Afterwards [`Text::place`]
    /// is the place of the word.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let start = self.offset;
        while self
            .bytes
            .get(self.offset)
            .is_some_and(|&b| !is_space(b) && Some(b) != self.comment)
        {
            self.offset += 1;
        }
        (self.offset > start).then(|| &self.bytes[start..self.offset])
    }

    /// The next word, without advancing.
    pub(crate) fn peek_word(&mut self) -> Option<&'a [u8]> {
        let mut ahead = self.clone();
        ahead.word()
    }

    /// The next word, which must be there.
    pub(crate) fn need_word(&mut self, expected: &str) -> Result<&'a [u8], Error> {
        self.word().ok_or_else(|| {
            self.name
                .syntax(self.place(), expected, "the end of the file")
        })
    }

    /// The next word as a number.
    pub(crate) fn number<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T, Error> {
        let word = self.need_word(expected)?;
        number(self.name, self.place(), word, expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_and_trimmed() {
        for bytes in [
            &b"a b\r\n\n# c\n d # e\nlast"[..],
            b"a b\r\r# c\r d # e\rlast",
        ] {
            let mut text = Text::new(Name("t"), bytes);
            assert_eq!(
                text.line().map(|l| (l.bytes, l.number)),
                Some((&b"a b"[..], 1))
            );
            let line = text.content_line(b'#').unwrap();
            assert_eq!((line.words().next(), line.number), (Some(&b"d"[..]), 4));
            assert_eq!(
                text.line().map(|l| (l.bytes, l.number)),
                Some((&b"last"[..], 5))
            );
            assert!(text.line().is_none());
            let mut skipped = Text::new(Name("t"), bytes);
            skipped.skip(bytes.len());
            assert_eq!(skipped.place(), Place::Line(5));
        }
    }

    #[test]
    fn words_cross_lines_and_skip_comments() {
        let mut text = Text::new(Name("t"), b"1 2# no\r\r\n 3").with_comments(b'#');
        let numbers: Vec<(u32, Place)> = (0..3)
            .map(|_| (text.number("n").unwrap(), text.place()))
            .collect();
        assert_eq!(
            numbers,
            [
                (1, Place::Line(1)),
                (2, Place::Line(1)),
                (3, Place::Line(3))
            ]
        );
        let error = text.number::<u32>("a count").unwrap_err();
        assert_eq!(
            error.to_string(),
            "t:3: expected a count, found the end of the file"
        );
    }
}
