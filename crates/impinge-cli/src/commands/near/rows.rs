//! Near pairs as files: NumPy arrays, CSV, lines of JSON.

use std::io::{self, Write};

use impinge::exact::Feature;
use impinge::{NearPair, NearPairs};
use impinge_io::npy_header;
use serde_json::json;

use crate::error::Error;
use crate::target::Target;
use crate::values::{RowsFile, RowsFormat};

/// Characters of the longest type, `EA0_EB1`.
const TYPE: usize = 7;

/// Writes a row for each pair, sorted.
pub fn write(file: &RowsFile, near: &NearPairs) -> Result<(), Error> {
    Target::fill(file, |to| put(to, file.format, near))
}

fn put(to: &mut dyn Write, format: RowsFormat, near: &NearPairs) -> io::Result<()> {
    match format {
        RowsFormat::Npy => npy(to, near),
        RowsFormat::Csv => csv(to, near),
        RowsFormat::Jsonl => jsonl(to, near),
    }
}

/// Distance and nearest points; they were asked for.
fn measured(pair: &NearPair) -> (f64, [[f64; 3]; 2]) {
    pair.closest
        .map_or((f64::NAN, [[f64::NAN; 3]; 2]), |closest| {
            (closest.distance, closest.points)
        })
}

fn feature(feature: Feature) -> String {
    match feature {
        Feature::Vertex(ix) => format!("v{ix}"),
        Feature::Edge(ix) => format!("e{ix}"),
        Feature::Face => "f".to_owned(),
    }
}

/// Characters of four bytes each, as NumPy has them, filled up with zeros.
fn characters(to: &mut dyn Write, text: &str, width: usize) -> io::Result<()> {
    let letters = text.chars().map(u32::from);
    for letter in letters.chain(std::iter::repeat(0)).take(width) {
        to.write_all(&letter.to_le_bytes())?;
    }
    Ok(())
}

/// A structured array, packed.
fn npy(to: &mut dyn Write, near: &NearPairs) -> io::Result<()> {
    let fields = format!(
        "[('kind', '<U2'), ('body_a', '<u4'), ('element_a', '<u4'), ('body_b', '<u4'), ('element_b', '<u4'), \
         ('type', '<U{TYPE}'), ('feature_a', '<U2'), ('feature_b', '<U2'), ('parallel', '|b1'), \
         ('distance', '<f8'), ('point_a', '<f8', (3,)), ('point_b', '<f8', (3,))]"
    );
    to.write_all(&npy_header(&fields, &format!("({},)", near.len())))?;
    for pair in near.iter() {
        let (distance, points) = measured(&pair);
        characters(to, pair.kind.name(), 2)?;
        to.write_all(pair.row().map(u32::to_le_bytes).as_flattened())?;
        characters(to, pair.name(), TYPE)?;
        for side in pair.features {
            characters(to, &feature(side), 2)?;
        }
        to.write_all(&[u8::from(pair.is_parallel)])?;
        to.write_all(&distance.to_le_bytes())?;
        for x in points.as_flattened() {
            to.write_all(&x.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Numbers are written so that they read back to the same bits.
fn csv(to: &mut dyn Write, near: &NearPairs) -> io::Result<()> {
    writeln!(
        to,
        "kind,body_a,element_a,body_b,element_b,type,feature_a,feature_b,parallel,distance,ax,ay,az,bx,by,bz"
    )?;
    for pair in near.iter() {
        let [body_a, a, body_b, b] = pair.row();
        let (kind, name) = (pair.kind.name(), pair.name());
        let [of_a, of_b] = pair.features.map(feature);
        let parallel = u8::from(pair.is_parallel);
        let (distance, points) = measured(&pair);
        write!(
            to,
            "{kind},{body_a},{a},{body_b},{b},{name},{of_a},{of_b},{parallel},{distance:?}"
        )?;
        for x in points.as_flattened() {
            write!(to, ",{x:?}")?;
        }
        writeln!(to)?;
    }
    Ok(())
}

fn jsonl(to: &mut dyn Write, near: &NearPairs) -> io::Result<()> {
    for pair in near.iter() {
        let [body_a, a, body_b, b] = pair.row();
        let (distance, [point_a, point_b]) = measured(&pair);
        let [of_a, of_b] = pair.features.map(feature);
        let object = json!({
            "kind": pair.kind.name(),
            "body_a": body_a,
            "element_a": a,
            "body_b": body_b,
            "element_b": b,
            "type": pair.name(),
            "feature_a": of_a,
            "feature_b": of_b,
            "parallel": pair.is_parallel,
            "distance": distance,
            "point_a": point_a,
            "point_b": point_b,
        });
        writeln!(to, "{object}")?;
    }
    Ok(())
}
