//! Impacts as files: NumPy arrays and CSV.

use std::io::{self, BufWriter, Write};

use impinge::{Impact, Impacts};
use impinge_io::{AtomicFile, npy_header};

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

/// A packed structured array: `kind` is two characters of four bytes each, as in NumPy.
fn npy(to: &mut impl Write, toi: ToiArg, impacts: &[Impact]) -> io::Result<()> {
    let time = match toi {
        ToiArg::F32 => "<f4",
        ToiArg::F64 => "<f8",
    };
    let fields = format!(
        "[('kind', '<U2'), ('body_a', '<u4'), ('element_a', '<u4'), ('body_b', '<u4'), ('element_b', '<u4'), ('toi', '{time}')]"
    );
    to.write_all(&npy_header(&fields, &format!("({},)", impacts.len())))?;
    for impact in impacts {
        for letter in impact.kind.name().chars() {
            to.write_all(&u32::from(letter).to_le_bytes())?;
        }
        to.write_all(impact.row().map(u32::to_le_bytes).as_flattened())?;
        match toi {
            // The time is an `f32` already.
            ToiArg::F32 => to.write_all(&(impact.toi as f32).to_le_bytes())?,
            ToiArg::F64 => to.write_all(&impact.toi.to_le_bytes())?,
        }
    }
    Ok(())
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
