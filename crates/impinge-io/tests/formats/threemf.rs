//! 3MF: items, components, transforms, parts, and archives that are damaged or lie.

use impinge_io::{
    Error, Format, Mesh, ReadOptions, read_bodies_bytes, read_bytes, read_bytes_with_summary,
};

use crate::common::{MODEL, TRIANGLES, VERTICES, threemf_mesh, threemf_model, zip};
use crate::triangles;

fn load(bytes: &[u8]) -> Result<Mesh, Error> {
    read_bytes(bytes, Format::ThreeMf, "a.3mf", &ReadOptions::as_they_are())
}

fn model(objects: &str, items: &str) -> Vec<u8> {
    zip(&[(MODEL, threemf_model(objects, items).as_bytes())], true)
}

fn refused(bytes: &[u8]) -> String {
    let message = load(bytes).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

fn object(id: &str) -> String {
    format!("<object id=\"{id}\">{}</object>", threemf_mesh())
}

#[test]
fn items_and_components_are_placed() {
    // The object as it is; moved by (10, 20, 30); and inside another one, mirrored and then moved
    // by (0, 0, 5).
    let nested = "<object id=\"2\"><components><component objectid=\"1\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></components></object>";
    let items = "<item objectid=\"1\"/><item objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 10 20 30\"/>\
                 <item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 0 0 5\"/>";
    let bytes = model(&(object("1") + nested), items);
    let mesh = load(&bytes).unwrap();
    let n = VERTICES.len();
    let points = mesh.positions.to_f64();
    assert_eq!(points.len(), 3 * n);
    for (ix, [x, y, z]) in VERTICES.into_iter().enumerate() {
        assert_eq!(points[ix], [x, y, z]);
        assert_eq!(points[n + ix], [x + 10.0, y + 20.0, z + 30.0]);
        assert_eq!(points[2 * n + ix], [-x, y, z + 5.0]);
    }
    let faces = triangles(&mesh);
    assert_eq!(faces.len(), 3 * TRIANGLES.len());
    let [a, b, c] = TRIANGLES[0];
    let shift = 2 * n as u32;
    // Matter stays inside a mirrored object.
    assert_eq!(
        faces[2 * TRIANGLES.len()],
        [a + shift, c + shift, b + shift]
    );
    let bodies = read_bodies_bytes(
        &bytes,
        Format::ThreeMf,
        "a.3mf",
        &ReadOptions::as_they_are(),
    );
    assert_eq!(bodies.unwrap().0.len(), 3);
}

#[test]
fn relationships_and_the_production_extension_name_parts() {
    let rels = "<Relationships><Relationship Target=\"/other/thumb.png\" Type=\"http://x/thumbnail\"/>\
                <Relationship Target=\"/other/Main.model\" Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
    let main = threemf_model(
        "",
        "<item objectid=\"7\" p:path=\"/3D/Objects/Part.model\"/>",
    );
    let part = threemf_model(&object("7"), "");
    for name in ["3D/Objects/Part.model", "3d/objects/part.MODEL"] {
        let parts = [
            ("_rels/.rels", rels),
            ("other/Main.model", &main),
            (name, &part),
        ];
        let bytes = zip(&parts.map(|(name, text)| (name, text.as_bytes())), true);
        assert_eq!(triangles(&load(&bytes).unwrap()), TRIANGLES);
    }
    let said = refused(&zip(&[(MODEL, main.as_bytes())], true));
    assert!(
        said.contains("3D/Objects/Part.model") && said.contains("none in the archive"),
        "{said}"
    );
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let item = "<item objectid=\"1\"/>";
    for (objects, items, part) in [
        (object("2"), item, "the object '1'"),
        (object("1") + &object("1"), item, "one object '1'"),
        (object("1").replace("v1=\"0\"", "v1=\"99\""), item, "99"),
        (object("1").replacen("x=\"", "x=\"nan", 1), item, "a number"),
        (
            object("1").replacen(" x=", " w=", 1),
            item,
            "the attribute 'x'",
        ),
        (
            object("1"),
            "<item objectid=\"1\" transform=\"1 2 3\"/>",
            "12",
        ),
        (
            "<vertex x=\"0\" y=\"0\" z=\"0\"/>".to_owned(),
            item,
            "an object",
        ),
        (
            "<object id=\"1\"><components><component objectid=\"1\"/></components></object>"
                .to_owned(),
            item,
            "depth of components",
        ),
    ] {
        let said = refused(&model(&objects, items));
        assert!(
            said.starts_with("a.3mf") && said.contains(part),
            "{part}: {said}"
        );
    }
    assert!(refused(b"no archive").contains("a ZIP archive"));
}

#[test]
fn archives_that_lie_are_refused_and_cost_nothing() {
    let bytes = model(&object("1"), "<item objectid=\"1\"/>");
    let entry = bytes
        .windows(4)
        .position(|four| four == b"PK\x01\x02")
        .unwrap();
    let with = |offset: usize, value: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[entry + offset..entry + offset + value.len()].copy_from_slice(value);
        refused(&bytes)
    };
    assert!(with(8, &[1, 0]).contains("encrypted"));
    assert!(with(10, &[9, 0]).contains("the ZIP method 9"));
    assert!(with(16, &[1, 2, 3, 4]).contains("checksum"));
    assert!(with(20, &u32::MAX.to_le_bytes()).contains("fewer"));
    // 4 GB announced: refused before memory is asked for.
    assert!(with(24, &(u32::MAX - 1).to_le_bytes()).contains("4294967294"));
    assert!(with(24, &7u32.to_le_bytes()).contains("a.3mf"));
    // A part of zeros that expands a thousandfold, beyond what a file of this size may.
    let zeros = vec![b' '; 80 << 20];
    let said = refused(&zip(&[(MODEL, &zeros)], true));
    assert!(said.contains("bytes of expanded data"), "{said}");
    // Each object is twice the one before: 2^30 places of nothing.
    let doubled: String = (2..=30)
        .map(|id| {
            let inner = format!("<component objectid=\"{}\"/>", id - 1).repeat(2);
            format!("<object id=\"{id}\"><components>{inner}</components></object>")
        })
        .collect();
    let options = ReadOptions {
        max_expanded_bytes: 1 << 20,
        ..ReadOptions::as_they_are()
    };
    let bytes = model(&(object("1") + &doubled), "<item objectid=\"30\"/>");
    let said = read_bytes(&bytes, Format::ThreeMf, "a.3mf", &options).unwrap_err();
    assert!(matches!(said, Error::TooLarge { .. }), "{said}");
}

#[test]
fn a_unit_other_than_a_millimetre_is_told() {
    for (unit, told) in [("millimeter", None), ("inch", Some("inch")), ("?", None)] {
        let text = threemf_model(&object("1"), "<item objectid=\"1\"/>");
        let with_unit = text.replacen("<model", &format!("<model unit=\"{unit}\""), 1);
        assert_ne!(with_unit, text);
        let bytes = zip(&[(MODEL, with_unit.as_bytes())], true);
        let options = ReadOptions::as_they_are();
        let read = read_bytes_with_summary(&bytes, Format::ThreeMf, "a.3mf", &options);
        assert_eq!(read.unwrap().1.unit, told, "{unit}");
    }
}
