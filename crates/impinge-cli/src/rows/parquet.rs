//! Parquet files: the columns of CSV files, with types.

use std::io;
use std::sync::Arc;

use impinge_io::{AtomicFile, Cell, Column, Holds};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

/// Rows that are kept before they are written as a group.
const GROUP: usize = 1 << 16;

/// A file that is being written.
pub struct Columns {
    writer: SerializedFileWriter<AtomicFile>,
    columns: Vec<Values>,
    n_rows: usize,
}

/// The values of a column that are not yet written.
struct Values {
    values: Typed,
    /// For each row whether it has a value, 1 or 0, where rows may have none.
    levels: Option<Vec<i16>>,
}

enum Typed {
    Bool(Vec<bool>),
    Int32(Vec<i32>),
    Int64(Vec<i64>),
    Float(Vec<f32>),
    Double(Vec<f64>),
    Text(Vec<ByteArray>),
}

impl Columns {
    /// Starts a file.
    pub fn create(file: AtomicFile, columns: &[Column]) -> io::Result<Self> {
        let (mut fields, mut values) = (Vec::new(), Vec::new());
        for column in columns {
            let (physical, logical, typed) = kind(column.holds);
            let names = match &column.holds {
                Holds::Point(names) => &names[..],
                _ => std::slice::from_ref(&column.name),
            };
            let repetition = match column.may_be_none {
                true => Repetition::OPTIONAL,
                false => Repetition::REQUIRED,
            };
            for name in names {
                let field = Type::primitive_type_builder(name, physical);
                let field = field.with_repetition(repetition);
                let field = field.with_logical_type(logical.clone()).build()?;
                fields.push(Arc::new(field));
                values.push(Values {
                    values: typed(),
                    levels: column.may_be_none.then(Vec::new),
                });
            }
        }
        let schema = Type::group_type_builder("rows").with_fields(fields);
        let schema = Arc::new(schema.build()?);
        let properties = WriterProperties::builder()
            .set_created_by(concat!("impinge ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        Ok(Columns {
            writer: SerializedFileWriter::new(file, schema, Arc::new(properties))?,
            columns: values,
            n_rows: 0,
        })
    }

    /// Adds a row.
    pub fn put(&mut self, cells: &[Cell<'_>]) -> io::Result<()> {
        let mut columns = self.columns.iter_mut();
        let mut next = || columns.next().expect("a column per cell, three per point");
        for cell in cells {
            match *cell {
                Cell::Point(point) => point.into_iter().for_each(|x| next().put(Cell::Float(x))),
                cell => next().put(cell),
            }
        }
        self.n_rows += 1;
        if self.n_rows == GROUP {
            self.write()?;
        }
        Ok(())
    }

    /// Writes the rows that are kept as a group.
    fn write(&mut self) -> io::Result<()> {
        if self.n_rows == 0 {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for column in &mut self.columns {
            let levels = column.levels.as_deref();
            match &mut column.values {
                Typed::Bool(values) => write::<BoolType>(&mut group, values, levels)?,
                Typed::Int32(values) => write::<Int32Type>(&mut group, values, levels)?,
                Typed::Int64(values) => write::<Int64Type>(&mut group, values, levels)?,
                Typed::Float(values) => write::<FloatType>(&mut group, values, levels)?,
                Typed::Double(values) => write::<DoubleType>(&mut group, values, levels)?,
                Typed::Text(values) => write::<ByteArrayType>(&mut group, values, levels)?,
            }
            if let Some(levels) = &mut column.levels {
                levels.clear();
            }
        }
        group.close()?;
        self.n_rows = 0;
        Ok(())
    }

    /// Writes what is left, and gives the file back.
    pub fn finish(mut self) -> io::Result<AtomicFile> {
        self.write()?;
        Ok(self.writer.into_inner()?)
    }
}

/// Writes one column of a group, and empties it.
fn write<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, AtomicFile>,
    values: &mut Vec<T::T>,
    levels: Option<&[i16]>,
) -> io::Result<()> {
    let mut column = group.next_column()?.expect("a column of the schema");
    column.typed::<T>().write_batch(values, levels, None)?;
    column.close()?;
    values.clear();
    Ok(())
}

/// How a column is stored.
fn kind(holds: Holds) -> (Physical, Option<LogicalType>, fn() -> Typed) {
    let unsigned = |bits| Some(LogicalType::integer(bits, false));
    match holds {
        Holds::Bool => (Physical::BOOLEAN, None, || Typed::Bool(Vec::new())),
        Holds::U8 => (Physical::INT32, unsigned(8), || Typed::Int32(Vec::new())),
        Holds::U32 => (Physical::INT32, unsigned(32), || Typed::Int32(Vec::new())),
        Holds::Count => (Physical::INT64, None, || Typed::Int64(Vec::new())),
        Holds::F32 => (Physical::FLOAT, None, || Typed::Float(Vec::new())),
        Holds::F64 | Holds::Point(_) => (Physical::DOUBLE, None, || Typed::Double(Vec::new())),
        Holds::Text(_) | Holds::Line | Holds::Word | Holds::Feature(_) => {
            let text = Some(LogicalType::String);
            (Physical::BYTE_ARRAY, text, || Typed::Text(Vec::new()))
        }
    }
}

impl Values {
    fn put(&mut self, cell: Cell<'_>) {
        if let Some(levels) = &mut self.levels {
            levels.push(i16::from(cell != Cell::None));
        }
        match (&mut self.values, cell) {
            (_, Cell::None) => (),
            (Typed::Bool(values), Cell::Bool(is_so)) => values.push(is_so),
            // Numbers without a sign are stored as those with the same bits.
            (Typed::Int32(values), Cell::Number(n)) => values.push(n.cast_signed()),
            (Typed::Int64(values), Cell::Count(n)) => values.push(n),
            (Typed::Float(values), Cell::Float(x)) => values.push(x as f32),
            (Typed::Double(values), Cell::Float(x)) => values.push(x),
            (Typed::Text(values), cell) => values.push(cell.to_string().into_bytes().into()),
            (_, cell) => unreachable!("{cell:?} in a column of another type"),
        }
    }
}
