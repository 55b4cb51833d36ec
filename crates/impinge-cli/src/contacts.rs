//! Contact geometry as files: corners as rows, curves as polylines.

use std::io::{self, Write};

use impinge::contact::{Contacts, Curves, Feature, Shape};
use impinge_io::{
    AtomicFile, Polylines, npy_header, write_polylines_obj, write_polylines_ply,
    write_polylines_vtu,
};
use serde_json::{Value, json};

use crate::error::Error;
use crate::text::{counted, grouped};
use crate::values::{CurvesFile, CurvesFormat, RowsFile, RowsFormat};

/// One corner of one contact.
struct Row {
    contact: u32,
    pair: [u32; 4],
    shape: u8,
    corner: u8,
    point: u32,
    features: [Feature; 2],
    position: [f64; 3],
}

fn rows(contacts: &Contacts) -> impl Iterator<Item = Row> + '_ {
    let of_contact = move |(number, contact): (u32, usize)| {
        let corners = (0u8..).zip(contacts.corners(contact));
        corners.map(move |(corner, &point)| Row {
            contact: number,
            pair: contacts.rows()[contact],
            shape: shape_number(contacts.shape(contact)),
            corner,
            point,
            features: contacts.names()[point as usize].features,
            position: contacts.points()[point as usize],
        })
    };
    (0u32..).zip(0..contacts.len()).flat_map(of_contact)
}

/// The number of a shape in files: 1 for a point, 2 for a segment, 3 for a polygon.
fn shape_number(shape: Shape) -> u8 {
    match shape {
        Shape::Solid | Shape::Apart => 0,
        Shape::Point => 1,
        Shape::Segment => 2,
        Shape::Polygon => 3,
    }
}

/// Writes one row per corner of each contact.
pub fn write(file: &RowsFile, contacts: &Contacts) -> Result<(), Error> {
    let mut to = AtomicFile::create(&file.path)?;
    let written = match file.format {
        RowsFormat::Npy => npy(&mut to, contacts),
        // Lines of JSON are refused when the options are checked.
        RowsFormat::Csv | RowsFormat::Jsonl => csv(&mut to, contacts),
    };
    written.map_err(|source| Error::Write {
        path: file.path.clone(),
        source,
    })?;
    Ok(to.finish()?)
}

fn csv(to: &mut impl Write, contacts: &Contacts) -> io::Result<()> {
    writeln!(
        to,
        "contact,body_a,primitive_a,body_b,primitive_b,shape,corner,point,feature_a,feature_b,x,y,z"
    )?;
    for row in rows(contacts) {
        let [body_a, a, body_b, b] = row.pair;
        let shape = match row.shape {
            1 => "point",
            2 => "segment",
            _ => "polygon",
        };
        let [in_a, in_b] = row.features.map(feature_text);
        let [x, y, z] = row.position;
        writeln!(
            to,
            "{},{body_a},{a},{body_b},{b},{shape},{},{},{in_a},{in_b},{x},{y},{z}",
            row.contact, row.corner, row.point
        )?;
    }
    Ok(())
}

/// `v7`, `e7-9` or `f3`.
fn feature_text(feature: Feature) -> String {
    match feature {
        Feature::Vertex(vertex) => format!("v{vertex}"),
        Feature::Edge([low, high]) => format!("e{low}-{high}"),
        Feature::Face(face) => format!("f{face}"),
    }
}

/// The kind (0 for a vertex, 1 for an edge, 2 for a face), and one or two numbers.
fn feature_numbers(feature: Feature) -> (u8, [u32; 2]) {
    match feature {
        Feature::Vertex(vertex) => (0, [vertex; 2]),
        Feature::Edge(edge) => (1, edge),
        Feature::Face(face) => (2, [face; 2]),
    }
}

/// A structured array; the fields are those of the CSV file, features as a kind and two numbers.
fn npy(to: &mut impl Write, contacts: &Contacts) -> io::Result<()> {
    const FIELDS: &str = "[('contact', '<u4'), ('body_a', '<u4'), ('primitive_a', '<u4'), ('body_b', '<u4'), \
         ('primitive_b', '<u4'), ('shape', '|u1'), ('corner', '|u1'), ('point', '<u4'), ('kind_a', '|u1'), \
         ('kind_b', '|u1'), ('feature_a', '<u4', (2,)), ('feature_b', '<u4', (2,)), ('position', '<f8', (3,))]";
    to.write_all(&npy_header(
        FIELDS,
        &format!("({},)", contacts.all_corners().len()),
    ))?;
    for row in rows(contacts) {
        to.write_all(&row.contact.to_le_bytes())?;
        to.write_all(row.pair.map(u32::to_le_bytes).as_flattened())?;
        to.write_all(&[row.shape, row.corner])?;
        to.write_all(&row.point.to_le_bytes())?;
        let [(kind_a, ids_a), (kind_b, ids_b)] = row.features.map(feature_numbers);
        to.write_all(&[kind_a, kind_b])?;
        to.write_all(
            [ids_a, ids_b]
                .as_flattened()
                .iter()
                .flat_map(|id| id.to_le_bytes())
                .collect::<Vec<u8>>()
                .as_slice(),
        )?;
        to.write_all(row.position.map(f64::to_le_bytes).as_flattened())?;
    }
    Ok(())
}

/// Writes the curves as polylines.
pub fn write_curves(file: &CurvesFile, contacts: &Contacts, curves: &Curves) -> Result<(), Error> {
    let all: Vec<(&[u32], bool)> = (0..curves.len())
        .map(|curve| (curves.points(curve), curves.is_closed(curve)))
        .collect();
    let lines = Polylines {
        points: contacts.points(),
        curves: &all,
    };
    match file.format {
        CurvesFormat::Obj => write_polylines_obj(&file.path, &lines)?,
        CurvesFormat::Ply => write_polylines_ply(&file.path, &lines)?,
        CurvesFormat::Vtu => write_polylines_vtu(&file.path, &lines)?,
    }
    Ok(())
}

/// A summary of contacts for the terminal.
pub fn summary(contacts: &Contacts, curves: &Curves) -> String {
    let isolated = match curves.isolated().len() as u64 {
        0 => String::new(),
        n => format!(", {}", counted(n, "isolated point")),
    };
    format!(
        "{}, {} closed, length {}{isolated}; {} of contact",
        counted(curves.len() as u64, "curve"),
        grouped(curves.n_closed() as u64),
        curves.total_length(),
        counted(contacts.points().len() as u64, "point"),
    )
}

/// The summary as a JSON object.
pub fn object(contacts: &Contacts, curves: &Curves) -> Value {
    let n = |shape: Shape| {
        contacts
            .shapes()
            .iter()
            .filter(|&&held| held == shape)
            .count()
    };
    json!({
        "points": contacts.points().len(),
        "shapes": {
            "point": n(Shape::Point),
            "segment": n(Shape::Segment),
            "polygon": n(Shape::Polygon),
        },
        "curves": curves.len(),
        "closed": curves.n_closed(),
        "length": curves.total_length(),
        "isolated": curves.isolated().len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_short() {
        let texts = [Feature::Vertex(7), Feature::Edge([7, 9]), Feature::Face(3)].map(feature_text);
        assert_eq!(texts, ["v7", "e7-9", "f3"]);
    }
}
