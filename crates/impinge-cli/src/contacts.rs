//! Contact geometry as files: corners and regions as rows, curves as polylines.

use std::collections::BTreeSet;

use impinge::contact::{Contacts, Curves, Feature, Region, Shape};
use impinge::{BodyId, Detector, Scene};
use impinge_io::{
    Cell, Column, ELEMENTS, Holds, Polylines, write_polylines_obj, write_polylines_ply,
    write_polylines_vtu,
};

use crate::error::Error;
use crate::origins::Origins;
use crate::report;
use crate::rows;
use crate::text::{counted, grouped};
use crate::values::{CurvesFile, CurvesFormat, RowsFile};

/// Writes one row per corner of each contact.
pub fn write(file: &RowsFile, origins: &Origins, contacts: &Contacts) -> Result<(), Error> {
    let own = [
        Column::new("shape", Holds::Word),
        Column::new("corner", Holds::U8),
        Column::new("point", Holds::U32),
        Column::new("feature_a", Holds::Feature("kind_a")),
        Column::new("feature_b", Holds::Feature("kind_b")),
        Column::new("position", Holds::Point(["x", "y", "z"])),
    ];
    let columns = [&[Column::new("contact", Holds::U32)], &ELEMENTS[..], &own].concat();
    let of_contact = |(number, contact): (u32, usize)| {
        let row @ [in_a, _, in_b, _] = contacts.rows()[contact];
        let [body_a, a, body_b, b] = row.map(Cell::Number);
        let corners = (0u32..).zip(contacts.corners(contact));
        corners.map(move |(corner, &point)| {
            let [of_a, of_b] = contacts.names()[point as usize].features;
            let [of_a, of_b] = [(in_a, of_a), (in_b, of_b)]
                .map(|(body, feature)| cell(origins.feature(body, feature)));
            [
                Cell::Number(number),
                body_a,
                a,
                body_b,
                b,
                word(contacts.shape(contact)),
                Cell::Number(corner),
                Cell::Number(point),
                of_a,
                of_b,
                Cell::Point(contacts.points()[point as usize]),
            ]
        })
    };
    let n = contacts.all_corners().len();
    let rows = (0u32..).zip(0..contacts.len()).flat_map(of_contact);
    rows::write(file, columns, n, rows)
}

/// A shape; only those with corners are in files.
fn word(shape: Shape) -> Cell<'static> {
    match shape {
        Shape::Solid | Shape::Apart => Cell::Word(0, "none"),
        Shape::Point => Cell::Word(1, "point"),
        Shape::Segment => Cell::Word(2, "segment"),
        Shape::Polygon => Cell::Word(3, "polygon"),
    }
}

fn cell(feature: Feature) -> Cell<'static> {
    match feature {
        Feature::Vertex(vertex) => Cell::Feature(0, [vertex; 2]),
        Feature::Edge(edge) => Cell::Feature(1, edge),
        Feature::Face(face) => Cell::Feature(2, [face; 2]),
    }
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

/// Writes one row per region: of two closed bodies with what is inside, how deep, and the volume.
pub fn write_regions(
    file: &RowsFile,
    detector: &mut Detector,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    contacts: &Contacts,
) -> Result<(), Error> {
    let columns = vec![
        Column::new("body_a", Holds::U32),
        Column::new("body_b", Holds::U32),
        Column::new("contacts", Holds::U32),
        Column::new("position", Holds::Point(["x", "y", "z"])),
        Column::new("low", Holds::Point(["low_x", "low_y", "low_z"])),
        Column::new("high", Holds::Point(["high_x", "high_y", "high_z"])),
        Column::new("length", Holds::F64),
        Column::new("patch_area", Holds::F64),
        Column::new("area", Holds::Point(["area_x", "area_y", "area_z"])),
        Column::new("nx", Holds::F64).or_none(),
        Column::new("ny", Holds::F64).or_none(),
        Column::new("nz", Holds::F64).or_none(),
        Column::new("depth", Holds::F64).or_none(),
        Column::new("volume", Holds::F64).or_none(),
        Column::new("inside_a", Holds::U32),
        Column::new("inside_b", Holds::U32),
    ];
    let regions = overlaps(detector, scene, bodies, contacts)?;
    let rows = regions.iter().map(|region| {
        let [a, b] = region.bodies.map(Cell::Number);
        let [low, high] = region.bounds.map(Cell::Point);
        let [nx, ny, nz] = match region.normal {
            Some(normal) => normal.map(Cell::Float),
            None => [Cell::None; 3],
        };
        let or_none = |number: Option<f64>| number.map_or(Cell::None, Cell::Float);
        let [in_a, in_b] = region
            .inside
            .each_ref()
            .map(|inside| rows::number(inside.len()));
        [
            a,
            b,
            rows::number(region.contacts.len()),
            Cell::Point(region.position),
            low,
            high,
            Cell::Float(region.length),
            Cell::Float(region.patch_area),
            Cell::Point(region.area),
            nx,
            ny,
            nz,
            or_none(region.depth),
            or_none(region.volume),
            in_a,
            in_b,
        ]
    });
    rows::write(file, columns, regions.len(), rows)
}

/// The regions of all contacts, by their bodies.
fn overlaps(
    detector: &mut Detector,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    contacts: &Contacts,
) -> Result<Vec<Region>, Error> {
    let plain = contacts.regions()?;
    let met: BTreeSet<[u32; 2]> = plain.iter().map(|region| region.bodies).collect();
    let mut all = Vec::new();
    for pair in met {
        let [a, b] = pair.map(|number| bodies[number as usize].0);
        let inside = match a == b {
            true => None,
            false => match detector.penetration(scene, contacts, a, b) {
                Ok(found) => Some(found.regions),
                // Only what is closed has an inside.
                Err(impinge::Error::NotClosed { .. }) => None,
                Err(error) => return Err(error.into()),
            },
        };
        match inside {
            Some(regions) => all.extend(regions),
            None => all.extend(plain.iter().filter(|of| of.bodies == pair).cloned()),
        }
    }
    Ok(all)
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

/// The summary for a report.
pub fn report(contacts: &Contacts, curves: &Curves) -> report::Contacts {
    let n = |shape: Shape| {
        contacts
            .shapes()
            .iter()
            .filter(|&&held| held == shape)
            .count()
    };
    report::Contacts {
        points: contacts.points().len(),
        shapes: report::Shapes {
            point: n(Shape::Point),
            segment: n(Shape::Segment),
            polygon: n(Shape::Polygon),
        },
        curves: curves.len(),
        closed: curves.n_closed(),
        length: curves.total_length(),
        isolated: curves.isolated().len(),
    }
}
