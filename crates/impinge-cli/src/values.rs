//! Values of options: files by their extension, sizes with a suffix, ranges.

use std::marker::PhantomData;
use std::num::{IntErrorKind, NonZeroUsize, ParseIntError};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::ValueEnum;
use clap::builder::{OsStringValueParser, TypedValueParser, ValueParser, ValueParserFactory};

/// A value that is made of a path, which need not be UTF-8.
pub trait OfPath: Sized {
    fn of_path(path: &Path) -> Result<Self, String>;
}

/// How options take such a value.
pub fn of_path<T: OfPath + Clone + Send + Sync + 'static>() -> ValueParser {
    ValueParser::new(OsStringValueParser::new().try_map(|path| T::of_path(path.as_ref())))
}

/// A file of a format that its name tells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileOf<F> {
    pub path: PathBuf,
    pub format: F,
}

/// The formats of a kind of file.
pub trait OfName: Sized {
    /// The format of a file, by its path and its extension in lower case.
    fn of_name(path: &Path, extension: &str) -> Result<Self, &'static str>;
}

impl<F: OfName> OfPath for FileOf<F> {
    fn of_path(path: &Path) -> Result<Self, String> {
        let extension = path.extension().unwrap_or_default();
        let extension = extension.to_string_lossy().to_ascii_lowercase();
        let format = F::of_name(path, &extension)?;
        let path = path.to_owned();
        Ok(FileOf { path, format })
    }
}

impl<F: OfName + Clone + Send + Sync + 'static> ValueParserFactory for FileOf<F> {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        of_path::<Self>()
    }
}

/// A file for rows.
pub type RowsFile = FileOf<RowsFormat>;

/// The format of rows of pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RowsFormat {
    /// One line per pair, numbers separated by commas
    Csv,
    /// One JSON object per pair, each on its own line
    Jsonl,
    /// A NumPy array
    Npy,
    /// A Parquet file
    #[cfg(feature = "parquet")]
    Parquet,
}

impl OfName for RowsFormat {
    fn of_name(path: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "npy" => Ok(RowsFormat::Npy),
            "csv" => Ok(RowsFormat::Csv),
            "jsonl" | "ndjson" => Ok(RowsFormat::Jsonl),
            #[cfg(feature = "parquet")]
            "parquet" => Ok(RowsFormat::Parquet),
            #[cfg(not(feature = "parquet"))]
            "parquet" => Err("this program was built without the feature parquet"),
            _ if path == Path::new("-") => Ok(RowsFormat::Csv),
            _ => Err("rows are written as .csv, .jsonl, .npy or .parquet"),
        }
    }
}

impl RowsFile {
    /// A file whose name gives the format, unless that is told.
    pub fn new(path: &Path, format: Option<RowsFormat>) -> Result<Self, String> {
        let Some(format) = format else {
            return Self::of_path(path);
        };
        let path = path.to_owned();
        Ok(RowsFile { path, format })
    }

    /// Whether the rows go to standard output.
    pub fn is_stdout(&self) -> bool {
        self.path == Path::new("-")
    }
}

/// A file for curves.
pub type CurvesFile = FileOf<CurvesFormat>;

/// The format of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurvesFormat {
    Ply,
    Obj,
    Vtu,
}

impl OfName for CurvesFormat {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "ply" => Ok(CurvesFormat::Ply),
            "obj" => Ok(CurvesFormat::Obj),
            "vtu" => Ok(CurvesFormat::Vtu),
            _ => Err("curves are written as .ply, .obj or .vtu"),
        }
    }
}

/// A file for coloured meshes.
pub type MeshFile = FileOf<MeshFormat>;

/// The format of coloured meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    Ply,
    Glb,
    Vtu,
}

impl OfName for MeshFormat {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "ply" => Ok(MeshFormat::Ply),
            "glb" => Ok(MeshFormat::Glb),
            "vtu" => Ok(MeshFormat::Vtu),
            _ => Err("meshes are written as .ply, .glb or .vtu"),
        }
    }
}

/// A file for a body at the end of a step, exactly.
pub type ReachedFile = FileOf<ReachedFormat>;

/// The format of such a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReachedFormat {
    Ply,
    Obj,
}

impl OfName for ReachedFormat {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "ply" => Ok(ReachedFormat::Ply),
            "obj" => Ok(ReachedFormat::Obj),
            _ => Err("bodies are written as .ply or .obj"),
        }
    }
}

/// A file for a mended mesh.
pub type MendedFile = FileOf<MendedFormat>;

/// The format of mended meshes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MendedFormat {
    Ply,
    Obj,
    Stl,
}

impl OfName for MendedFormat {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "ply" => Ok(MendedFormat::Ply),
            "obj" => Ok(MendedFormat::Obj),
            "stl" => Ok(MendedFormat::Stl),
            _ => Err("mended meshes are written as .ply, .obj or .stl"),
        }
    }
}

/// A file for a picture.
pub type PngFile = FileOf<Png>;

/// The format of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Png;

impl OfName for Png {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "png" => Ok(Png),
            _ => Err("pictures are written as .png"),
        }
    }
}

/// A file for a page.
pub type HtmlFile = FileOf<Html>;

/// The format of pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Html;

impl OfName for Html {
    fn of_name(_: &Path, extension: &str) -> Result<Self, &'static str> {
        match extension {
            "html" | "htm" => Ok(Html),
            _ => Err("reports are written as .html"),
        }
    }
}

/// Files for the frames of a sequence: a name in which `%d` or `%04d` stands for the number of the
/// frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FramesFile<T> {
    before: String,
    width: usize,
    after: String,
    made_of: PhantomData<T>,
}

impl<T: OfPath> FramesFile<T> {
    /// The file of a frame.
    pub fn frame(&self, frame_ix: usize) -> Result<T, String> {
        let (before, width, after) = (&self.before, self.width, &self.after);
        T::of_path(format!("{before}{frame_ix:0width$}{after}").as_ref())
    }
}

impl<T: OfPath> FromStr for FramesFile<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            "expected a name with a number for the frame in it, such as seen_%04d.ply".to_owned()
        };
        let (before, rest) = text.split_once('%').ok_or_else(expected)?;
        let (width, after) = rest.split_once('d').ok_or_else(expected)?;
        let width = match width {
            "" => 0,
            width => width
                .parse()
                .ok()
                .filter(|width| *width <= 20)
                .ok_or_else(expected)?,
        };
        let files = FramesFile {
            before: before.to_owned(),
            width,
            after: after.to_owned(),
            made_of: PhantomData,
        };
        files.frame(0)?;
        Ok(files)
    }
}

/// A format of meshes by its extension.
pub fn mesh_format(text: &str) -> Result<impinge_io::Format, String> {
    impinge_io::Format::from_extension(text)
        .filter(|format| *format != impinge_io::Format::Tetgen)
        .ok_or_else(|| "expected the extension of a mesh file, such as ply, obj or stl".to_owned())
}

/// A number of at least 1: one of the `NonZero` types.
pub fn at_least_one<N: FromStr<Err = ParseIntError>>(text: &str) -> Result<N, String> {
    text.parse().map_err(|error: ParseIntError| {
        let expected = "expected a whole number of at least 1";
        match error.kind() {
            IntErrorKind::PosOverflow => {
                let largest = u64::MAX >> (64 - 8 * size_of::<N>());
                format!("{expected} and at most {largest}")
            }
            _ => expected.to_owned(),
        }
    })
}

/// A number of threads.
pub fn threads(text: &str) -> Result<NonZeroUsize, String> {
    at_least_one(text)
        .ok()
        .filter(|threads: &NonZeroUsize| threads.get() <= 1024)
        .ok_or_else(|| "expected a whole number of at least 1 and at most 1024".to_owned())
}

/// Frames `start..end` of a sequence; `end` may be open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    pub start: usize,
    pub end: Option<usize>,
}

impl FrameRange {
    /// The frames of the range; `None` if the range reaches beyond the last frame.
    pub fn within(self, n_frames: usize) -> Option<Range<usize>> {
        let end = self.end.unwrap_or(n_frames);
        (self.start <= end && end <= n_frames).then_some(self.start..end)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected A..B, A.. or ..B".to_owned();
        let (start, end) = text.split_once("..").ok_or_else(expected)?;
        let number = |text: &str| text.parse().map_err(|_| expected());
        let start = if start.is_empty() { 0 } else { number(start)? };
        let end = match end {
            "" => None,
            end => Some(number(end)?),
        };
        if end.is_some_and(|end| end <= start) {
            return Err(format!("no frame lies in {text}"));
        }
        Ok(FrameRange { start, end })
    }
}

/// Width and height in pixels with an `x` between them.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    text.split_once('x')
        .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]))
        .filter(|size| !size.contains(&0))
        .ok_or_else(|| "expected width and height, such as 1280x960".to_owned())
}

/// An angle in degrees.
pub fn azimuth(text: &str) -> Result<f64, String> {
    let angle = text.parse::<f64>().ok().filter(|angle| angle.is_finite());
    angle.ok_or_else(|| "expected an angle in degrees".to_owned())
}

/// An angle above the ground in degrees.
pub fn elevation(text: &str) -> Result<f64, String> {
    let angle = text.parse::<f64>().ok();
    let angle = angle.filter(|angle| (-90.0..=90.0).contains(angle));
    angle.ok_or_else(|| "expected an angle from -90 to 90 degrees".to_owned())
}

/// A part of the whole.
pub fn part(text: &str) -> Result<f32, String> {
    let part = text.parse::<f32>().ok();
    let part = part.filter(|part| (0.0..=1.0).contains(part));
    part.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}

/// A number above 0.
pub fn lambda(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}

/// A distance: a finite number that is not below 0. One that is not 0 as it is written stays so.
pub fn distance(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok();
    let value = value.filter(|value| value.is_finite() && *value >= 0.0);
    let value = value.ok_or("expected a finite number that is not below 0")?;
    let digits = text.split(['e', 'E']).next().unwrap_or_default();
    match value == 0.0 && digits.contains(|c: char| ('1'..='9').contains(&c)) {
        true => Err("so near to 0 that it would be read as 0".to_owned()),
        false => Ok(value),
    }
}

/// Two body numbers with a comma between them.
pub fn body_numbers(text: &str) -> Result<(usize, usize), String> {
    text.split_once(',')
        .and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)))
        .ok_or_else(|| "expected two body numbers, such as 0,1".to_owned())
}

/// The numbers of two different bodies with a comma between them.
pub fn two_bodies(text: &str) -> Result<(usize, usize), String> {
    match body_numbers(text)? {
        (a, b) if a == b => {
            Err("these are one body: `impinge self` finds where it meets itself".to_owned())
        }
        numbers => Ok(numbers),
    }
}

/// A body's number and a length with a comma between them.
pub fn body_length(text: &str) -> Result<(usize, f64), String> {
    let expected = || "expected a body's number and a length, such as 0,0.5".to_owned();
    let (body, length) = text.split_once(',').ok_or_else(expected)?;
    let body = body.trim().parse().map_err(|_| expected())?;
    Ok((body, distance(length.trim())?))
}

/// A count above 0, with an optional suffix: `k`, `M`, `G` are powers of 1000.
pub fn count(text: &str) -> Result<u64, String> {
    let expected = || "expected a number such as 250000, 250k or 2M".to_owned();
    let split = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    let (digits, suffix) = text.split_at(split);
    let factor: u64 = match suffix {
        "" => 1,
        "k" | "K" => 1_000,
        "M" | "m" => 1_000_000,
        "G" | "g" => 1_000_000_000,
        _ => return Err(expected()),
    };
    let n = digits
        .parse::<u64>()
        .ok()
        .and_then(|n| n.checked_mul(factor));
    n.filter(|&n| n > 0).ok_or_else(expected)
}

/// A number of bytes with an optional suffix: `k`, `M`, `G`, `T` (or `KiB`, `MiB`, …) are powers of
/// 1024, `kB`, `MB`, … powers of 1000, as in GNU tools.
pub fn bytes(text: &str) -> Result<u64, String> {
    let expected =
        || "expected a number of bytes, such as 500000000, 512M, 2GiB or 1.5G".to_owned();
    let split = text
        .find(|c: char| !(c.is_ascii_digit() || c == '.'))
        .unwrap_or(text.len());
    let (number, suffix) = text.split_at(split);
    let suffix = suffix.trim().to_ascii_lowercase();
    let (power, rest) = match suffix.chars().next() {
        None => (0, ""),
        Some('b') => (0, suffix.as_str()),
        Some(letter) => {
            let power = "kmgt".find(letter).ok_or_else(expected)? + 1;
            (power, &suffix[1..])
        }
    };
    let base: u64 = match (power, rest) {
        (0, "" | "b") => 1,
        (1.., "" | "ib") => 1024,
        (1.., "b") => 1000,
        _ => return Err(expected()),
    };
    let unit = (0..power).fold(1u64, |unit, _| unit * base);
    let whole = match number.split_once('.') {
        None => number.parse::<u64>().ok(),
        Some(_) if power == 0 => None,
        Some((whole, part)) => return fraction(whole, part, unit).ok_or_else(expected),
    };
    whole
        .and_then(|whole| whole.checked_mul(unit))
        .ok_or_else(expected)
}

/// `whole.part` units, rounded down to whole bytes, in integers.
fn fraction(whole: &str, part: &str, unit: u64) -> Option<u64> {
    let digits = u32::try_from(part.len())
        .ok()
        .filter(|n| (1..=9).contains(n))?;
    let part: u64 = part.parse().ok()?;
    let whole: u64 = whole.parse().ok()?;
    let part = u128::from(part) * u128::from(unit) / 10u128.pow(digits);
    let total = u128::from(whole) * u128::from(unit) + part;
    u64::try_from(total).ok()
}

/// Three coordinates.
#[cfg(any(feature = "view", test))]
pub fn point(text: &str) -> Result<[f64; 3], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    numbers
        .ok()
        .and_then(|numbers| <[f64; 3]>::try_from(numbers).ok())
        .filter(|point| point.iter().all(|x| x.is_finite()))
        .ok_or_else(|| "expected three coordinates, such as 0,1.5,-2".to_owned())
}

/// A body's number and the first three rows of a matrix.
#[cfg(any(feature = "view", test))]
pub fn body_matrix(text: &str) -> Result<(usize, [[f64; 4]; 4]), String> {
    let expected = || {
        "expected a body's number, a colon and 12 numbers, such as 1:1,0,0,0.5,0,1,0,0,0,0,1,0"
            .to_owned()
    };
    let (body, numbers) = text.split_once(':').ok_or_else(expected)?;
    let body = body.parse().map_err(|_| expected())?;
    let numbers: Result<Vec<f64>, _> = numbers.split(',').map(str::parse).collect();
    let numbers = numbers.map_err(|_| expected())?;
    if numbers.len() != 12 || numbers.iter().any(|x| !x.is_finite()) {
        return Err(expected());
    }
    let mut matrix = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (row, numbers) in matrix.iter_mut().zip(numbers.as_chunks().0) {
        *row = *numbers;
    }
    Ok((body, matrix))
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU32;

    use super::*;

    #[test]
    fn points() {
        assert_eq!(point("0,1.5,-2e-7"), Ok([0.0, 1.5, -2e-7]));
        for text in ["", "1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "1, 2,x"] {
            assert!(point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn bytes_with_suffixes() {
        for (text, value) in [
            ("0", 0),
            ("1234", 1234),
            ("12B", 12),
            ("4k", 4096),
            ("4kB", 4000),
            ("512M", 512 << 20),
            ("2GiB", 2 << 30),
            ("3 GB", 3_000_000_000),
            ("1.5G", 3 << 29),
            ("1T", 1 << 40),
            ("18446744073709551615", u64::MAX),
        ] {
            assert_eq!(bytes(text), Ok(value), "{text}");
        }
        for text in [
            "",
            "M",
            "-1",
            "1.5",
            "1.5B",
            "1x",
            "1kk",
            "1e9",
            "1..5G",
            ".5G",
            "1.G",
            "99999999T",
            "1bb",
        ] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn distances_are_finite_and_0_only_if_they_say_so() {
        for (text, value) in [
            ("0", 0.0),
            ("-0", 0.0),
            ("0.00e7", 0.0),
            ("5e-324", f64::from_bits(1)),
            ("1e308", 1e308),
        ] {
            assert_eq!(distance(text), Ok(value), "{text}");
        }
        for text in ["-1", "inf", "nan", "1e309", "x", ""] {
            let said = "expected a finite number that is not below 0";
            assert_eq!(distance(text), Err(said.to_owned()), "{text}");
        }
        for text in ["1e-400", "0.001E-330", "-1e-400"] {
            assert!(distance(text).unwrap_err().contains("read as 0"), "{text}");
        }
        assert!(body_length("0,1e-400").unwrap_err().contains("read as 0"));
    }

    #[test]
    fn whole_numbers_have_a_largest_one() {
        let one = at_least_one::<NonZeroU32>;
        assert_eq!(one("4294967295"), Ok(NonZeroU32::MAX));
        for text in ["4294967296", "99999999999999999999"] {
            let said = "expected a whole number of at least 1 and at most 4294967295";
            assert_eq!(one(text), Err(said.to_owned()));
        }
        for text in ["0", "-1", "1.5", "x"] {
            let said = "expected a whole number of at least 1";
            assert_eq!(one(text), Err(said.to_owned()));
        }
    }

    #[test]
    fn frame_ranges() {
        let parse = |text: &str| text.parse::<FrameRange>();
        assert_eq!(parse("..").unwrap().within(5), Some(0..5));
        assert_eq!(parse("2..").unwrap().within(5), Some(2..5));
        assert_eq!(parse("2..").unwrap().within(1), None);
        assert_eq!(parse("..3").unwrap().within(5), Some(0..3));
        assert_eq!(parse("1..3").unwrap().within(2), None);
        for text in ["", "3", "3..3", "4..3", "a..b", "..0", "-1..2"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn body_pairs() {
        assert_eq!(body_numbers("0,1"), Ok((0, 1)));
        assert_eq!(body_numbers("3, 3"), Ok((3, 3)));
        for text in ["", "1", "1,", "1,2,3", "-1,2", "a,b"] {
            assert!(body_numbers(text).is_err(), "{text}");
        }
    }

    #[test]
    fn files_by_extension() {
        assert_eq!(
            RowsFile::of_path("a.NPY".as_ref()).unwrap().format,
            RowsFormat::Npy
        );
        assert_eq!(
            RowsFile::of_path("a.csv".as_ref()).unwrap().format,
            RowsFormat::Csv
        );
        assert_eq!(
            RowsFile::of_path("a.jsonl".as_ref()).unwrap().format,
            RowsFormat::Jsonl
        );
        assert!(RowsFile::of_path("-".as_ref()).unwrap().is_stdout());
        assert!(RowsFile::of_path("a.txt".as_ref()).is_err());
        let frames: FramesFile<MeshFile> = "f_%03d.glb".parse().unwrap();
        assert_eq!(
            frames.frame(7).unwrap(),
            MeshFile::of_path("f_007.glb".as_ref()).unwrap()
        );
        for text in ["f.glb", "f_%03d.txt", "f_%s.glb", "f_%99999d.glb"] {
            assert!(text.parse::<FramesFile<MeshFile>>().is_err(), "{text}");
        }
        assert_eq!(
            MeshFile::of_path("a.b.vtu".as_ref()).unwrap().format,
            MeshFormat::Vtu
        );
        assert!(MeshFile::of_path("ply".as_ref()).is_err());
    }

    #[test]
    fn pictures() {
        assert_eq!(size("1280x960"), Ok([1280, 960]));
        for text in [
            "", "1280", "1280x", "1280x-1", "1x2x3", "1.5x2", "0x9", "9x0",
        ] {
            assert!(size(text).is_err(), "{text}");
        }
        assert_eq!((azimuth("-400"), elevation("-90")), (Ok(-400.0), Ok(-90.0)));
        assert!(azimuth("inf").is_err() && azimuth("x").is_err());
        assert!(elevation("90.5").is_err() && elevation("nan").is_err());
        assert_eq!((part("0"), part("1")), (Ok(0.0), Ok(1.0)));
        assert!(part("-0.1").is_err() && part("1.1").is_err());
        assert!(PngFile::of_path("a.PNG".as_ref()).is_ok());
        assert!(PngFile::of_path("a.jpg".as_ref()).is_err());
    }

    #[test]
    fn lambda_is_above_zero() {
        assert_eq!(lambda("0.5"), Ok(0.5));
        for text in ["0", "-1", "nan", "inf", "x"] {
            assert!(lambda(text).is_err(), "{text}");
        }
    }

    #[test]
    fn matrices() {
        let (body, matrix) =
            body_matrix("1:1,0,0,0.5,0,1,0,-2,0,0,1,3e-1").expect("twelve numbers");
        assert_eq!(body, 1);
        assert_eq!(matrix[1], [0.0, 1.0, 0.0, -2.0]);
        assert_eq!(matrix[2], [0.0, 0.0, 1.0, 0.3]);
        assert_eq!(matrix[3], [0.0, 0.0, 0.0, 1.0]);
        for text in [
            "",
            "1",
            "1:2",
            "a:1,0,0,0,0,1,0,0,0,0,1,0",
            "0:1,0,0,inf,0,1,0,0,0,0,1,0",
        ] {
            assert!(body_matrix(text).is_err(), "{text}");
        }
    }
}
