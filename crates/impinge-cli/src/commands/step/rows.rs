//! Impacts as files: NumPy arrays and CSV.

use std::io::{self, Write};

use impinge::{Impact, Impacts};
use impinge_io::write_impacts_npy;

use crate::args::ToiArg;
use crate::error::Error;
use crate::target::Target;
use crate::values::{RowsFile, RowsFormat};

/// Writes rows `kind, body_a, element_a, body_b, element_b, toi`, sorted.
pub fn write(file: &RowsFile, toi: ToiArg, impacts: &Impacts) -> Result<(), Error> {
    Target::fill(file, |to| put(to, file.format, toi, impacts.as_slice()))
}

fn put(to: &mut dyn Write, format: RowsFormat, toi: ToiArg, impacts: &[Impact]) -> io::Result<()> {
    match format {
        RowsFormat::Npy => npy(to, toi, impacts),
        RowsFormat::Csv => csv(to, impacts),
        RowsFormat::Jsonl => jsonl(to, impacts),
    }
}

fn npy(to: &mut dyn Write, toi: ToiArg, impacts: &[Impact]) -> io::Result<()> {
    let rows = impacts
        .iter()
        .map(|impact| (impact.kind.name(), impact.row(), impact.toi));
    write_impacts_npy(to, rows, toi == ToiArg::F64)
}

/// Times are written with enough digits to read back the same bits, in single and in double precision.
fn csv(to: &mut dyn Write, impacts: &[Impact]) -> io::Result<()> {
    writeln!(to, "kind,body_a,element_a,body_b,element_b,toi")?;
    for impact in impacts {
        let [body_a, a, body_b, b] = impact.row();
        let (kind, toi) = (impact.kind.name(), impact.toi);
        writeln!(to, "{kind},{body_a},{a},{body_b},{b},{toi:?}")?;
    }
    Ok(())
}

fn jsonl(to: &mut dyn Write, impacts: &[Impact]) -> io::Result<()> {
    for impact in impacts {
        writeln!(to, "{}", super::answer::impact(*impact))?;
    }
    Ok(())
}
