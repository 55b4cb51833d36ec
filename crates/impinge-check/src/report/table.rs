//! A table with a row per mesh: the keys of a row's object but `places`.

use impinge_io::{Cell, Column, Holds, Table, TableFormat};
use serde_json::Value;

use super::Report;
use crate::row::Row;

const fn text(name: &'static str) -> Column {
    Column::new(name, Holds::Line).or_none()
}

const fn flag(name: &'static str) -> Column {
    Column::new(name, Holds::Bool).or_none()
}

const fn count(name: &'static str) -> Column {
    Column::new(name, Holds::Count).or_none()
}

const fn number(name: &'static str) -> Column {
    Column::new(name, Holds::F64).or_none()
}

impl Row {
    /// The columns of a table of meshes: the keys of all objects made by
    /// [`to_json`](Self::to_json) but `places`. What is `null` there is nothing here.
    pub const COLUMNS: [Column; 31] = [
        text("path"),
        flag("welded"),
        count("vertices"),
        count("vertices_welded"),
        count("triangles"),
        count("tetrahedra"),
        count("self_intersections"),
        count("intersecting_elements"),
        text("hash"),
        count("degenerate"),
        count("duplicate_faces"),
        count("non_manifold_edges"),
        count("non_manifold_vertices"),
        count("boundary_edges"),
        count("boundaries"),
        count("inconsistent_edges"),
        count("inside_out_pieces"),
        count("components"),
        count("unused_vertices"),
        flag("watertight"),
        number("volume"),
        count("euler"),
        count("duplicate_tetrahedra"),
        count("non_manifold_faces"),
        count("boundary_faces"),
        count("inconsistent_faces"),
        number("min_thickness"),
        count("thin_faces"),
        number("thinnest"),
        text("error"),
        text("error_kind"),
    ];

    /// The cells of an object made by [`to_json`](Self::to_json), under [`COLUMNS`](Self::COLUMNS).
    pub fn cells(object: &Value) -> [Cell<'_>; 31] {
        Row::COLUMNS.map(|column| match &object[column.name] {
            Value::Bool(is_so) => Cell::Bool(*is_so),
            Value::Number(n) if column.holds == Holds::Count => {
                Cell::Count(n.as_i64().unwrap_or(i64::MAX))
            }
            Value::Number(x) => Cell::Float(x.as_f64().unwrap_or(f64::NAN)),
            Value::String(text) => Cell::Line(text),
            _ => Cell::None,
        })
    }
}

impl Report<'_> {
    /// A table with a row per mesh, under [`Row::COLUMNS`].
    ///
    /// # Panics
    /// If the format is that of arrays, which hold no text.
    pub fn table(&self, format: TableFormat) -> Vec<u8> {
        let table = Table::new(format, Row::COLUMNS);
        let mut bytes = table.header(Some(self.rows.len() as u64));
        for row in self.rows {
            let object = row.to_json();
            let written = table.row(&mut bytes, &Row::cells(&object));
            written.expect("memory takes all bytes");
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::{Counts, ErrorKind};

    /// A key that rows get later must be a column, too.
    #[test]
    fn every_key_is_a_column() {
        let failed = Row::failed("a.stl", true, ErrorKind::File, "no faces");
        let counted = |n_tetrahedra, min_thickness| Row {
            result: Ok(Counts {
                n_tetrahedra,
                min_thickness,
                thin_faces: min_thickness.map(|_| 17),
                thinnest: min_thickness,
                hash: Some(1),
                is_watertight: Some(true),
                volume: Some(0.5),
                inside_out: Some(3),
                euler: Some(-2),
                ..Counts::default()
            }),
            ..failed.clone()
        };
        for row in [failed.clone(), counted(0, Some(0.5)), counted(4, None)] {
            for (key, value) in row.to_json().as_object().unwrap() {
                let Some(column) = Row::COLUMNS.iter().find(|column| column.name == key) else {
                    assert_eq!(key, "places");
                    continue;
                };
                let fits = match column.holds {
                    Holds::Line => value.is_string(),
                    Holds::Bool => value.is_boolean(),
                    Holds::Count => value.is_i64() || value.is_u64(),
                    _ => value.is_f64(),
                };
                assert!(fits || value.is_null(), "{key}: {value}");
            }
        }
    }
}
