//! Rows of numbers, such as points and rays: from text and from NumPy arrays.

use std::collections::HashSet;
use std::path::Path;

use crate::binary::{Endian, Scalar};
use crate::budget::reserve;
use crate::error::{Error, KNOWN_ROWS, Name, Place, shown};
use crate::files::Source;
use crate::format::Format;
use crate::npy::NpyHeader;
use crate::options::ReadOptions;
use crate::read::collect_file;
use crate::text::{Text, number};

/// Reads rows of `N` finite numbers: a NumPy array of shape `(n, N)` of `float32` or `float64`
/// (`.npy`), or text (`.csv`, `.txt`, `.xyz`) with a row per line. Numbers in text are separated by
/// commas or blanks; what follows `#` is a comment, and the first line may have a name for each
/// column instead: all different, each of which begins with a letter or `_`, perhaps in quotes.
///
/// ```no_run
/// use impinge_io::{ReadOptions, read_rows};
/// # fn main() -> Result<(), impinge_io::Error> {
/// let rays: Vec<[f64; 6]> = read_rows("rays.csv".as_ref(), &ReadOptions::default())?;
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::UnknownRows`] for another extension; [`Error::Syntax`], which names the line or the
/// byte, for a row of another length, for what is no finite number, and for text without a row;
/// [`Error::Truncated`] for an array that ends early, [`Error::Count`] for bytes after it.
pub fn read_rows<const N: usize>(
    path: &Path,
    options: &ReadOptions,
) -> Result<Vec<[f64; N]>, Error> {
    let of_file = path.display().to_string();
    let name = Name(&of_file);
    match extension(path).as_str() {
        "npy" => array(&Source::Named(path).read(options)?, name),
        "csv" | "txt" | "xyz" => lines(&Source::Named(path).read(options)?, name),
        extension => Err(Error::UnknownRows {
            path: path.to_owned(),
            extension: extension.to_owned(),
            known: KNOWN_ROWS,
        }),
    }
}

/// Like [`read_rows`], from bytes: a NumPy array if they begin as one, else text. Errors use `name`
/// for the file.
///
/// # Errors
/// As [`read_rows`].
pub fn read_rows_bytes<const N: usize>(bytes: &[u8], name: &str) -> Result<Vec<[f64; N]>, Error> {
    match bytes.starts_with(b"\x93NUMPY") {
        true => array(bytes, Name(name)),
        false => lines(bytes, Name(name)),
    }
}

/// Reads points: rows of three numbers, as [`read_rows`], or the vertices of a mesh file, which
/// needs no faces. Vertices keep their order and are never welded.
///
/// # Errors
/// As [`read_rows`] and [`read`](crate::read).
pub fn read_points(path: &Path, options: &ReadOptions) -> Result<Vec<[f64; 3]>, Error> {
    match Format::from_extension(&extension(path)) {
        Some(_) => collect_file(path, options, |parts| Ok(parts.positions.to_f64())),
        None => read_rows(path, options),
    }
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

/// Rows of text.
fn lines<const N: usize>(bytes: &[u8], name: Name<'_>) -> Result<Vec<[f64; N]>, Error> {
    let mut text = Text::new(name, bytes);
    let mut rows = Vec::new();
    let mut is_first = true;
    while let Some(line) = text.content_line(b'#') {
        let is_between = |b: &u8| *b == b',' || b.is_ascii_whitespace();
        let words = || line.bytes.split(is_between).filter(|word| !word.is_empty());
        let is_number = |word: &[u8]| number::<f64>(name, line.place(), word, "").is_ok();
        if std::mem::take(&mut is_first) && !words().any(is_number) {
            if are_names::<N>(line.bytes) {
                continue;
            }
            let expected = format!("{N} numbers, or a name for each of {N} columns");
            return Err(name.syntax(line.place(), expected, shown(line.bytes)));
        }
        let n = words().count();
        if n != N {
            return Err(name.syntax(line.place(), format!("{N} numbers in a row"), n.to_string()));
        }
        let mut row = [0.0; N];
        for (to, word) in row.iter_mut().zip(words()) {
            let expected = "a finite number";
            let value: f64 = number(name, line.place(), word, expected)?;
            if !value.is_finite() {
                return Err(name.syntax(line.place(), expected, shown(word)));
            }
            *to = value;
        }
        if rows.len() == rows.capacity() {
            let more = rows.len().max(1024) as u64;
            reserve(name, line.place(), &mut rows, more)?;
        }
        rows.push(row);
    }
    if rows.is_empty() {
        let expected = format!("a row of {N} numbers");
        return Err(name.syntax(text.place(), expected, "the end of the file"));
    }
    Ok(rows)
}

/// Whether a line has a name for each of `N` columns. Names may have blanks if commas separate them.
/// Words that repeat stand for values, such as `NA,NA,NA`.
fn are_names<const N: usize>(line: &[u8]) -> bool {
    let line = String::from_utf8_lossy(line);
    let fields = match line.contains(',') {
        true => line.split(',').map(str::trim).collect::<Vec<_>>(),
        false => line.split_whitespace().collect(),
    };
    let is_name = |field: &&str| {
        let field = field.strip_prefix(['"', '\'']).unwrap_or(field);
        field.starts_with(|c: char| c.is_alphabetic() || c == '_')
    };
    let different: HashSet<_> = fields.iter().filter(|field| is_name(field)).collect();
    fields.len() == N && different.len() == N
}

/// A NumPy array.
fn array<const N: usize>(bytes: &[u8], name: Name<'_>) -> Result<Vec<[f64; N]>, Error> {
    let expected = format!("an array of '<f4' or '<f8' of shape (n, {N})");
    let refuse = |found: String| name.syntax(Place::Byte(0), &expected, found);
    let header = NpyHeader::parse(bytes).ok_or_else(|| refuse("no header of NumPy".to_owned()))?;
    let scalar = match header.descr.as_str() {
        "<f4" => Scalar::F32,
        "<f8" => Scalar::F64,
        other => return Err(refuse(format!("type {}", shown(other.as_bytes())))),
    };
    let n = match header.shape[..] {
        [n, columns] if columns == N as u64 => n,
        _ => return Err(refuse(format!("shape {:?}", header.shape))),
    };
    let start = Place::Byte(header.start);
    let size = scalar.size();
    let data = &bytes[header.start as usize..];
    let needed = n.saturating_mul((N * size) as u64);
    if (data.len() as u64) < needed {
        return Err(name.truncated(start, "rows of numbers", needed, data.len() as u64));
    }
    if (data.len() as u64) > needed {
        return Err(name.count(start, "bytes of rows", needed, data.len() as u64));
    }
    let mut rows: Vec<[f64; N]> = Vec::new();
    reserve(name, start, &mut rows, n)?;
    for row in 0..n as usize {
        let offset = |column: usize| match header.fortran_order {
            true => (column * n as usize + row) * size,
            false => (row * N + column) * size,
        };
        let numbers: [f64; N] =
            std::array::from_fn(|k| scalar.float(&data[offset(k)..], Endian::Little));
        if let Some(k) = numbers.iter().position(|number| !number.is_finite()) {
            let place = Place::Byte(header.start + offset(k) as u64);
            let found = format!("{} in row {row}", numbers[k]);
            return Err(name.syntax(place, "a finite number", found));
        }
        rows.push(numbers);
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npy::npy_header;

    const NAME: Name<'_> = Name("p.csv");

    #[test]
    fn text_has_a_row_per_line() {
        let expected = vec![[1.0, -2.5, 0.1], [3.0, 4.0, 1e-300]];
        for text in [
            "1,-2.5,0.1\n3,4,1e-300\n",
            "x,y,z\n1, -2.5, 0.1\r\n\n3 4\t1e-300",
            "# made by hand\n1 -2.5 .1 # the first\n+3 4 1e-300\n",
        ] {
            assert_eq!(lines::<3>(text.as_bytes(), NAME).unwrap(), expected);
        }
        for names in [
            "x, y, z",
            "x y\tz",
            "\"x\",\"y\",\"z\"",
            "'x' 'y' 'z'",
            "px [m], py [m], pz [m]",
            "_a,\u{3b8},C1",
        ] {
            let text = format!("{names}\n1,-2.5,.1\n3,4,1e-300\n");
            assert_eq!(lines::<3>(text.as_bytes(), NAME).unwrap(), expected);
        }
    }

    /// A line that is taken for names loses a row, and later rows get other numbers.
    #[test]
    fn a_first_row_in_another_syntax_is_not_taken_for_names() {
        for line in [
            "1;1;5",
            "NA,NA,NA",
            "\"1\",\"1\",\"5\"",
            "1/1/5",
            "1:1:5",
            "x,y",
            "x y z w",
            "--,y,z",
            "\u{ff}",
        ] {
            let error = lines::<3>(format!("{line}\n1,2,3\n").as_bytes(), NAME).unwrap_err();
            let expected = "p.csv:1: expected 3 numbers, or a name for each of 3 columns";
            assert_eq!(error.to_string(), format!("{expected}, found '{line}'"));
        }
        let error = lines::<3>(b"1D0 1D0 5D0\n1 2 3\n", NAME).unwrap_err();
        assert!(error.to_string().starts_with("p.csv:1: "), "{error}");
    }

    #[test]
    fn text_without_a_row_is_an_error() {
        for text in ["", "x,y,z", "x,y,z\n", "# nothing\n\n"] {
            let error = lines::<3>(text.as_bytes(), NAME).unwrap_err().to_string();
            let said = "expected a row of 3 numbers, found the end of the file";
            assert!(error.ends_with(said), "{error}");
        }
    }

    #[test]
    fn a_bad_line_is_named() {
        for (text, said) in [
            (
                "1,2,3\n1,2\n",
                "p.csv:2: expected 3 numbers in a row, found 2",
            ),
            (
                "x,y,z\n1,2,3,4",
                "p.csv:2: expected 3 numbers in a row, found 4",
            ),
            (
                "1,2,3\n\n1,two,3\n",
                "p.csv:3: expected a finite number, found 'two'",
            ),
            (
                "x,y,z\ny,z,x\n",
                "p.csv:2: expected a finite number, found 'y'",
            ),
            ("1,nan,3", "p.csv:1: expected a finite number, found 'nan'"),
            (
                "1,2,1e999",
                "p.csv:1: expected a finite number, found '1e999'",
            ),
        ] {
            let error = lines::<3>(text.as_bytes(), NAME).unwrap_err();
            assert_eq!(error.to_string(), said, "{text}");
        }
    }

    fn npy(kind: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let head = String::from_utf8(npy_header(kind, shape)[10..].to_vec()).unwrap();
        let head = head.replace("False,", order);
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_are_read_in_both_orders_and_precisions() {
        let expected = vec![[1.0, 2.0, 3.0], [4.0, 5.0, 0.5]];
        let by_row = [1.0f64, 2.0, 3.0, 4.0, 5.0, 0.5];
        let by_column = [1.0f32, 4.0, 2.0, 5.0, 3.0, 0.5];
        let wide: Vec<u8> = by_row.iter().flat_map(|x| x.to_le_bytes()).collect();
        let narrow: Vec<u8> = by_column.iter().flat_map(|x| x.to_le_bytes()).collect();
        let bytes = npy("'<f8'", "False,", "(2, 3)", &wide);
        assert_eq!(array::<3>(&bytes, NAME).unwrap(), expected);
        let bytes = npy("'<f4'", "True,", "(2, 3)", &narrow);
        assert_eq!(array::<3>(&bytes, NAME).unwrap(), expected);

        for (kind, shape, said) in [
            ("'<i8'", "(2, 3)", "found type '<i8'"),
            ("'<f8'", "(2, 2)", "found shape [2, 2]"),
            ("'<f8'", "(6,)", "found shape [6]"),
            ("'<f8'", "(1, 3)", "expected 24 bytes of rows, found 48"),
            ("'<f8'", "(3, 3)", "72 bytes are needed, but 48 are left"),
            ("'<f8'", "(18446744073709551615, 3)", "bytes are needed"),
        ] {
            let error = array::<3>(&npy(kind, "False,", shape, &wide), NAME).unwrap_err();
            assert!(error.to_string().contains(said), "{error}");
        }
        assert!(array::<3>(b"no array", NAME).is_err());
        let mut spoiled = wide;
        spoiled[24..32].copy_from_slice(&f64::INFINITY.to_le_bytes());
        let error = array::<3>(&npy("'<f8'", "False,", "(2, 3)", &spoiled), NAME).unwrap_err();
        let said = "p.csv: byte 152: expected a finite number, found inf in row 1";
        assert_eq!(error.to_string(), said);
    }
}
