//! Tables of rows: CSV, lines of JSON, NumPy arrays. One description of the columns serves all
//! formats, and those that others write.

use std::fmt;
use std::io::{self, Write};

use crate::npy::{npy_header, npy_header_in};

/// The format of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// A line with the names of the columns, then a line per row, values separated by commas.
    Csv,
    /// A JSON object per row, each on its own line.
    Jsonl,
    /// NumPy's array format: an `(n, k)` array of `u32` if all columns hold these, else a packed
    /// structured array.
    Npy,
}

/// A column of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Its name in all formats.
    pub name: &'static str,
    /// What it holds.
    pub holds: Holds,
    /// Whether rows may have [nothing](Cell::None) there.
    pub may_be_none: bool,
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holds {
    /// Numbers of 8 bits.
    U8,
    /// Numbers of 32 bits.
    U32,
    /// `f64` in text, `f32` in arrays: for numbers that are `f32`.
    F32,
    /// `f64`.
    F64,
    /// Yes or no; 1 and 0 in CSV.
    Bool,
    /// Whole numbers of 64 bits, with a sign.
    Count,
    /// Text of so many ASCII characters at most.
    Text(usize),
    /// Text of any length. Not in arrays.
    Line,
    /// One of a few words, in arrays its number in 8 bits.
    Word,
    /// Three `f64`, in CSV under three names.
    Point([&'static str; 3]),
    /// A vertex `v7`, an edge `e7-9` or a face `f3`; in arrays 0, 1 or 2 under this name, and two
    /// numbers.
    Feature(&'static str),
}

/// A value in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell<'a> {
    /// Of [`Holds::U8`] and [`Holds::U32`].
    Number(u32),
    /// Of [`Holds::F32`] and [`Holds::F64`].
    Float(f64),
    /// Of [`Holds::Count`].
    Count(i64),
    /// Of [`Holds::Bool`].
    Bool(bool),
    /// Of [`Holds::Text`]: letters, digits and `_`.
    Text(&'a str),
    /// Of [`Holds::Line`].
    Line(&'a str),
    /// Nothing, in a column that [may have none](Column::or_none); NaN in arrays.
    None,
    /// Of [`Holds::Word`].
    Word(u8, &'a str),
    /// Of [`Holds::Point`].
    Point([f64; 3]),
    /// Of [`Holds::Feature`]: 0, 1 or 2, and the number twice, or of an edge two numbers.
    Feature(u8, [u32; 2]),
}

/// The columns `body_a`, `element_a`, `body_b`, `element_b`.
pub const ELEMENTS: [Column; 4] = [
    Column::new("body_a", Holds::U32),
    Column::new("element_a", Holds::U32),
    Column::new("body_b", Holds::U32),
    Column::new("element_b", Holds::U32),
];

/// The column `kind`, with the names of kinds of pairs: two letters.
pub const KIND: Column = Column::new("kind", Holds::Text(2));

/// The columns of impacts: `kind`, `body_a`, `element_a`, `body_b`, `element_b`, `toi`. Times are
/// all `f32`, unless `in_f64`.
pub fn impact_columns(in_f64: bool) -> Vec<Column> {
    let toi = match in_f64 {
        true => Holds::F64,
        false => Holds::F32,
    };
    [&[KIND][..], &ELEMENTS, &[Column::new("toi", toi)]].concat()
}

impl<'a> Cell<'a> {
    /// The row of an impact, for [`impact_columns`]: its kind,
    /// `[body_a, element_a, body_b, element_b]` and its time.
    pub fn impact(kind: &'a str, elements: [u32; 4], toi: f64) -> [Self; 6] {
        let [body_a, a, body_b, b] = elements.map(Cell::Number);
        [Cell::Text(kind), body_a, a, body_b, b, Cell::Float(toi)]
    }
}

/// As in CSV files, without quotes.
impl fmt::Display for Cell<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Cell::Number(n) => write!(f, "{n}"),
            Cell::Count(n) => write!(f, "{n}"),
            Cell::Float(x) => write!(f, "{x:?}"),
            Cell::Bool(is_so) => write!(f, "{}", u8::from(is_so)),
            Cell::Text(text) | Cell::Word(_, text) | Cell::Line(text) => f.write_str(text),
            Cell::Point([x, y, z]) => write!(f, "{x:?},{y:?},{z:?}"),
            Cell::Feature(0, [vertex, _]) => write!(f, "v{vertex}"),
            Cell::Feature(1, [low, high]) => write!(f, "e{low}-{high}"),
            Cell::Feature(_, [face, _]) => write!(f, "f{face}"),
            Cell::None => Ok(()),
        }
    }
}

impl Column {
    /// A column.
    pub const fn new(name: &'static str, holds: Holds) -> Self {
        Column {
            name,
            holds,
            may_be_none: false,
        }
    }

    /// The same, where rows may have nothing. In arrays only of [`Holds::F64`].
    pub const fn or_none(self) -> Self {
        Column {
            may_be_none: true,
            ..self
        }
    }
}

/// The format and the columns of a table.
#[derive(Debug, Clone)]
pub struct Table {
    format: TableFormat,
    columns: Vec<Column>,
}

impl Table {
    /// A table with these columns, in this order.
    ///
    /// # Panics
    /// If the format is that of arrays, and a column holds text of any length or may have none.
    pub fn new(format: TableFormat, columns: impl Into<Vec<Column>>) -> Self {
        let columns = columns.into();
        let is_array = |column: &Column| {
            column.holds != Holds::Line && (!column.may_be_none || column.holds == Holds::F64)
        };
        assert!(
            format != TableFormat::Npy || columns.iter().all(is_array),
            "columns of text are not in arrays, and only numbers may be nothing"
        );
        Table { format, columns }
    }

    /// The bytes before the first row. Without the number of rows they are only as long as these
    /// bytes are with it.
    pub fn header(&self, n_rows: Option<u64>) -> Vec<u8> {
        match self.format {
            TableFormat::Jsonl => Vec::new(),
            TableFormat::Csv => {
                let names = self.columns.iter().flat_map(|column| match &column.holds {
                    Holds::Point(names) => &names[..],
                    _ => std::slice::from_ref(&column.name),
                });
                (names.copied().collect::<Vec<_>>().join(",") + "\n").into_bytes()
            }
            TableFormat::Npy => self.npy(0, n_rows.unwrap_or(u64::MAX)),
        }
    }

    /// The bytes that replace those of a [`header`](Table::header) that was made without the number
    /// of rows; `None` if those hold.
    pub fn late_header(&self, n_rows: u64) -> Option<Vec<u8>> {
        let is_counted = self.format == TableFormat::Npy;
        is_counted.then(|| self.npy(self.header(None).len(), n_rows))
    }

    fn npy(&self, n_bytes: usize, n: u64) -> Vec<u8> {
        let header = |kind: &str, shape: &str| match n_bytes {
            0 => npy_header(kind, shape),
            _ => npy_header_in(n_bytes, kind, shape),
        };
        if self.columns.iter().all(|column| column.holds == Holds::U32) {
            return header("'<u4'", &format!("({n}, {})", self.columns.len()));
        }
        let fields: Vec<String> = self.columns.iter().map(field).collect();
        header(&format!("[{}]", fields.join(", ")), &format!("({n},)"))
    }

    /// Writes a row, which has a cell per column.
    ///
    /// # Errors
    /// Those of `to`.
    pub fn row(&self, to: &mut dyn Write, cells: &[Cell<'_>]) -> io::Result<()> {
        debug_assert_eq!(cells.len(), self.columns.len());
        let columns = self.columns.iter().zip(cells).enumerate();
        match self.format {
            TableFormat::Npy => columns
                .into_iter()
                .try_for_each(|(_, (column, cell))| put(to, column.holds, *cell)),
            TableFormat::Csv => {
                for (ix, (_, cell)) in columns {
                    to.write_all(if ix > 0 { b"," } else { b"" })?;
                    match cell {
                        Cell::Line(line) => quoted(to, line)?,
                        cell => write!(to, "{cell}")?,
                    }
                }
                to.write_all(b"\n")
            }
            TableFormat::Jsonl => {
                for (ix, (column, cell)) in columns {
                    let start = if ix > 0 { ',' } else { '{' };
                    write!(to, "{start}\"{}\":", column.name)?;
                    match cell {
                        Cell::Text(_) | Cell::Word(..) | Cell::Feature(..) => {
                            write!(to, "\"{cell}\"")?;
                        }
                        Cell::Line(line) => write!(to, "{}", serde_json::Value::from(*line))?,
                        Cell::Bool(is_so) => write!(to, "{is_so}")?,
                        Cell::Point(_) => write!(to, "[{cell}]")?,
                        Cell::None => to.write_all(b"null")?,
                        Cell::Number(_) | Cell::Count(_) | Cell::Float(_) => write!(to, "{cell}")?,
                    }
                }
                to.write_all(b"}\n")
            }
        }
    }
}

/// Text in a CSV file, in quotes where it needs them (RFC 4180).
fn quoted(to: &mut dyn Write, text: &str) -> io::Result<()> {
    match text.contains([',', '"', '\n', '\r']) {
        true => write!(to, "\"{}\"", text.replace('"', "\"\"")),
        false => to.write_all(text.as_bytes()),
    }
}

/// Its fields in a structured array.
fn field(column: &Column) -> String {
    let name = column.name;
    match column.holds {
        Holds::U8 | Holds::Word => format!("('{name}', '|u1')"),
        Holds::U32 => format!("('{name}', '<u4')"),
        Holds::F32 => format!("('{name}', '<f4')"),
        Holds::F64 => format!("('{name}', '<f8')"),
        Holds::Bool => format!("('{name}', '|b1')"),
        Holds::Text(width) => format!("('{name}', '<U{width}')"),
        Holds::Count => format!("('{name}', '<i8')"),
        Holds::Line => unreachable!("Table::new refuses it in arrays"),
        Holds::Point(_) => format!("('{name}', '<f8', (3,))"),
        Holds::Feature(kind) => format!("('{kind}', '|u1'), ('{name}', '<u4', (2,))"),
    }
}

/// A value in an array: little-endian.
fn put(to: &mut dyn Write, holds: Holds, cell: Cell<'_>) -> io::Result<()> {
    match (cell, holds) {
        (Cell::Number(n), Holds::U8) => to.write_all(&n.to_le_bytes()[..1]),
        (Cell::Number(n), _) => to.write_all(&n.to_le_bytes()),
        (Cell::Float(x), Holds::F32) => to.write_all(&(x as f32).to_le_bytes()),
        (Cell::Float(x), _) => to.write_all(&x.to_le_bytes()),
        (Cell::Count(n), _) => to.write_all(&n.to_le_bytes()),
        (Cell::Bool(is_so), _) => to.write_all(&[u8::from(is_so)]),
        (Cell::Text(text), Holds::Text(width)) => {
            // As in NumPy, a character is four bytes, and zeros fill the text up.
            let letters = text.chars().map(u32::from).chain(std::iter::repeat(0));
            letters
                .take(width)
                .try_for_each(|letter| to.write_all(&letter.to_le_bytes()))
        }
        (Cell::Text(text), _) => to.write_all(text.as_bytes()),
        (Cell::Word(number, _), _) => to.write_all(&[number]),
        (Cell::Point(point), _) => to.write_all(point.map(f64::to_le_bytes).as_flattened()),
        (Cell::Feature(kind, numbers), _) => {
            to.write_all(&[kind])?;
            to.write_all(numbers.map(u32::to_le_bytes).as_flattened())
        }
        (Cell::None, _) => to.write_all(&f64::NAN.to_le_bytes()),
        (Cell::Line(_), _) => unreachable!("Table::new refuses it in arrays"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(table: &Table, rows: &[&[Cell<'_>]]) -> Vec<u8> {
        let mut bytes = table.header(Some(rows.len() as u64));
        for row in rows {
            table.row(&mut bytes, row).unwrap();
        }
        bytes
    }

    /// The description in the header of an array, and the data.
    fn npy(bytes: &[u8]) -> (&str, &[u8]) {
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!(start % 64, 0);
        let header = std::str::from_utf8(&bytes[10..start]).unwrap();
        assert!(header.ends_with('\n'));
        (header, &bytes[start..])
    }

    #[test]
    fn numbers_are_a_plain_array() {
        let row = [0, 7, 1, 0x0102_0304].map(Cell::Number);
        for n in [0, 2, 1000] {
            let bytes = written(&Table::new(TableFormat::Npy, ELEMENTS), &vec![&row[..]; n]);
            let (header, data) = npy(&bytes);
            assert!(header.contains(&format!("'<u4', 'fortran_order': False, 'shape': ({n}, 4)")));
            assert_eq!(data.len(), 16 * n);
            if n > 0 {
                assert_eq!(data[..16], [0, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 4, 3, 2, 1]);
            }
        }
        let csv = written(&Table::new(TableFormat::Csv, ELEMENTS), &[&row]);
        assert_eq!(csv, b"body_a,element_a,body_b,element_b\n0,7,1,16909060\n");
    }

    #[test]
    fn a_late_header_fits() {
        for format in [TableFormat::Npy, TableFormat::Csv] {
            let table = Table::new(format, impact_columns(true));
            let early = table.header(None);
            match table.late_header(3) {
                None => assert_eq!(early, table.header(Some(3))),
                Some(late) => {
                    assert_eq!(late.len(), early.len());
                    assert!(npy(&late).0.contains("'shape': (3,)"));
                }
            }
        }
    }

    #[test]
    fn every_cell_in_every_format() {
        let columns = [
            Column::new("n", Holds::U8),
            Column::new("toi", Holds::F32),
            Column::new("x", Holds::F64),
            Column::new("parallel", Holds::Bool),
            Column::new("type", Holds::Text(3)),
            Column::new("shape", Holds::Word),
            Column::new("point", Holds::Point(["px", "py", "pz"])),
            Column::new("feature", Holds::Feature("feature_kind")),
            Column::new("count", Holds::Count),
        ];
        let row = [
            Cell::Number(255),
            Cell::Float(0.5),
            Cell::Float(1e-7),
            Cell::Bool(true),
            Cell::Text("AB"),
            Cell::Word(2, "segment"),
            Cell::Point([1.0, -2.5, 1e21]),
            Cell::Feature(1, [7, 9]),
            Cell::Count(-3),
        ];
        let in_format = |format| written(&Table::new(format, columns), &[&row]);
        assert_eq!(
            String::from_utf8(in_format(TableFormat::Csv)).unwrap(),
            "n,toi,x,parallel,type,shape,px,py,pz,feature,count\n255,0.5,1e-7,1,AB,segment,1.0,-2.5,1e21,e7-9,-3\n"
        );
        assert_eq!(
            String::from_utf8(in_format(TableFormat::Jsonl)).unwrap(),
            "{\"n\":255,\"toi\":0.5,\"x\":1e-7,\"parallel\":true,\"type\":\"AB\",\"shape\":\"segment\",\
             \"point\":[1.0,-2.5,1e21],\"feature\":\"e7-9\",\"count\":-3}\n"
        );
        let bytes = in_format(TableFormat::Npy);
        let (header, data) = npy(&bytes);
        let fields = "[('n', '|u1'), ('toi', '<f4'), ('x', '<f8'), ('parallel', '|b1'), ('type', '<U3'), ('shape', '|u1'), \
                      ('point', '<f8', (3,)), ('feature_kind', '|u1'), ('feature', '<u4', (2,)), ('count', '<i8')]";
        assert!(header.contains(fields), "{header}");
        let mut expected = vec![255];
        expected.extend(0.5f32.to_le_bytes());
        expected.extend(1e-7f64.to_le_bytes());
        expected.extend([1, 65, 0, 0, 0, 66, 0, 0, 0, 0, 0, 0, 0, 2]);
        expected.extend([1.0f64, -2.5, 1e21].map(f64::to_le_bytes).as_flattened());
        expected.extend([1, 7, 0, 0, 0, 9, 0, 0, 0]);
        expected.extend((-3i64).to_le_bytes());
        assert_eq!(data, expected);
    }

    #[test]
    fn lines_are_quoted_and_nothing_is_empty() {
        let columns = [
            Column::new("path", Holds::Line),
            Column::new("n", Holds::Count).or_none(),
            Column::new("error", Holds::Line).or_none(),
        ];
        let rows: [&[Cell<'_>]; 2] = [
            &[Cell::Line("a.stl"), Cell::Count(i64::MAX), Cell::None],
            &[Cell::Line("b, c"), Cell::None, Cell::Line("no \"faces\"")],
        ];
        let in_format = |format| written(&Table::new(format, columns), &rows);
        assert_eq!(
            String::from_utf8(in_format(TableFormat::Csv)).unwrap(),
            "path,n,error\na.stl,9223372036854775807,\n\"b, c\",,\"no \"\"faces\"\"\"\n"
        );
        assert_eq!(
            String::from_utf8(in_format(TableFormat::Jsonl)).unwrap(),
            "{\"path\":\"a.stl\",\"n\":9223372036854775807,\"error\":null}\n\
             {\"path\":\"b, c\",\"n\":null,\"error\":\"no \\\"faces\\\"\"}\n"
        );
    }
}
