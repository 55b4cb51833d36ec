//! Impacts as files: NumPy arrays and CSV.

use std::io::{self, BufWriter, Write};

use impinge::{Impact, Impacts};
use impinge_io::{AtomicFile, write_impacts_npy};

use crate::args::ToiArg;
use crate::error::Error;
use crate::output::out;
use crate::values::{RowsFile, RowsFormat};

/// Writes rows `kind, body_a, element_a, body_b, element_b, toi`, sorted.
pub fn write(file: &RowsFile, toi: ToiArg, impacts: &Impacts) -> Result<(), Error> {
    if file.is_stdout() {
        let mut to = BufWriter::new(out());
        put(&mut to, file.format, toi, impacts.as_slice())?;
        return Ok(to.flush()?);
    }
    let mut to = AtomicFile::create(&file.path)?;
    put(&mut to, file.format, toi, impacts.as_slice()).map_err(|source| Error::Write {
        path: file.path.clone(),
        source,
    })?;
    Ok(to.finish()?)
}

fn put(to: &mut impl Write, format: RowsFormat, toi: ToiArg, impacts: &[Impact]) -> io::Result<()> {
    match format {
        RowsFormat::Npy => npy(to, toi, impacts),
        RowsFormat::Csv => csv(to, impacts),
        RowsFormat::Jsonl => jsonl(to, impacts),
    }
}

fn npy(to: &mut impl Write, toi: ToiArg, impacts: &[Impact]) -> io::Result<()> {
    let rows = impacts
        .iter()
        .map(|impact| (impact.kind.name(), impact.row(), impact.toi));
    write_impacts_npy(to, rows, toi == ToiArg::F64)
}

/// Times are written with enough digits to read back the same bits, in single and in double precision.
fn csv(to: &mut impl Write, impacts: &[Impact]) -> io::Result<()> {
    writeln!(to, "kind,body_a,element_a,body_b,element_b,toi")?;
    for impact in impacts {
        let [body_a, a, body_b, b] = impact.row();
        let (kind, toi) = (impact.kind.name(), impact.toi);
        writeln!(to, "{kind},{body_a},{a},{body_b},{b},{toi:?}")?;
    }
    Ok(())
}

fn jsonl(to: &mut impl Write, impacts: &[Impact]) -> io::Result<()> {
    for impact in impacts {
        writeln!(to, "{}", super::answer::impact(*impact))?;
    }
    Ok(())
}
