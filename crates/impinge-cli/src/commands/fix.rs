//! `impinge fix`: mends a mesh without moving a vertex.

mod args;

use std::io::Write;
use std::path::Path;

use impinge_check::{
    Counts, Finding, FixError, FixOptions, Fixed, Place, Repair, Report, Row, fix_mesh,
};
use impinge_io::{
    Cell, ELEMENTS, Elements, Mesh, ReadOptions, Summary, printable, read_bytes_with_summary,
    read_with_summary, write_obj, write_plain_ply, write_stl,
};
use serde_json::{Map, Value, json};

pub use self::args::{FIX_EXAMPLES, FixArgs};
use crate::apart::Inputs;
use crate::commands::check::{FailOn, fail, quoted};
use crate::error::Error;
use crate::load::{NAME_OF_STDIN, STDIN, format_of_stdin, stdin_bytes, tell};
use crate::output;
use crate::rows;
use crate::text::{counted, several};
use crate::values::MendedFormat;

/// `impinge fix`.
pub fn fix(args: &FixArgs) -> Result<(), Error> {
    let inputs = Inputs::new([&args.mesh]);
    inputs.check("--out", &args.out.path)?;
    let rows_file = args.rows.file(&inputs, args.json)?;
    let repairs = args.repairs();
    if args.only.contains(&Repair::CloseHoles) && args.close_holes.is_none() {
        let text = "--only close-holes: --close-holes N says of how many edges";
        return Err(Error::Usage(text.to_owned()));
    }
    if !args.force && args.out.path.exists() {
        return Err(Error::Usage(format!(
            "--out {}: the file exists; --force replaces it",
            printable(&args.out.path)
        )));
    }
    let options = FixOptions {
        repairs,
        close_holes: args.close_holes.unwrap_or(0),
        threads: args.threads.map_or(0, usize::from),
    };
    let (mesh, summary) = read_mesh(args)?;
    tell(&args.mesh.display().to_string(), &summary.notes());
    let fixed = fix_mesh(mesh, &options).map_err(|error| match error {
        FixError::Refused(source) => Error::Refused {
            what: args.mesh.display().to_string(),
            source,
        },
        other => Error::Usage(format!("{}: {other}", printable(&args.mesh))),
    })?;
    if matches!(&fixed.mesh.elements, Elements::Triangles(faces) if faces.is_empty()) {
        return Err(Error::NoFaceLeft {
            path: args.mesh.clone(),
            n_flat: counted(fixed.repairs.degenerate_faces, "face"),
        });
    }
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    write(args, &fixed.mesh)?;
    if let Some(file) = &rows_file {
        let pairs = &fixed.self_intersections;
        if (pairs.len() as u64) < fixed.after.self_intersections {
            return Err(Error::Usage(format!(
                "--rows: {} pairs, many of them of faces with the same vertices, are only counted",
                fixed.after.self_intersections
            )));
        }
        let cells = |&[a, b]: &[u32; 2]| [0, a, 0, b].map(Cell::Number);
        rows::write(file, ELEMENTS.into(), pairs.len(), pairs.iter().map(cells))?;
    }
    if args.json {
        writeln!(output::out(), "{}", object(args, &options, &fixed))?;
    } else {
        output::say(
            text(args, &options, &fixed, &summary).as_bytes(),
            rows_file.as_ref(),
        )?;
    }
    fail(&Report {
        rows: &[row(&args.out.path, false, fixed.after, &fixed.places_after)],
        fail_on: &FailOn::findings(&args.fail_on),
    })
}

fn read_mesh(args: &FixArgs) -> Result<(Mesh, Summary), Error> {
    let options = ReadOptions::as_they_are();
    if args.mesh != Path::new(STDIN) {
        return Ok(read_with_summary(&args.mesh, &options)?);
    }
    let format = format_of_stdin(args.format)?;
    let bytes = stdin_bytes(&options)?;
    Ok(read_bytes_with_summary(
        &bytes,
        format,
        NAME_OF_STDIN,
        &options,
    )?)
}

fn write(args: &FixArgs, mesh: &Mesh) -> Result<(), Error> {
    // What is mended has triangles alone.
    let Elements::Triangles(faces) = &mesh.elements else {
        return Ok(());
    };
    let write = match args.out.format {
        MendedFormat::Obj => write_obj,
        MendedFormat::Stl => write_stl,
        MendedFormat::Ply => write_plain_ply,
    };
    Ok(write(&args.out.path, &mesh.positions, faces)?)
}

fn row(path: &Path, is_welded: bool, counts: Counts, places: &[Place]) -> Row {
    Row {
        path: path.display().to_string(),
        is_welded,
        result: Ok(counts),
        marks: None,
        notes: Vec::new(),
        places: places.to_vec(),
    }
}

/// The object that `docs/fix.schema.json` describes.
fn object(args: &FixArgs, options: &FixOptions, fixed: &Fixed) -> Value {
    let mut repairs = Map::new();
    for repair in Repair::ALL {
        let mut of = Map::new();
        of.insert("asked".into(), options.repairs.contains(&repair).into());
        for (name, n) in fixed.numbers(repair) {
            of.insert(name.into(), n.into());
        }
        repairs.insert(repair.name().into(), of.into());
    }
    let welds = options.repairs.contains(&Repair::Weld);
    let before = row(&args.mesh, welds, fixed.before, &fixed.places_before);
    json!({
        "path": before.path,
        "out": args.out.path.display().to_string(),
        "repairs": repairs,
        "close_holes": options.close_holes,
        "seams": fixed.has_seams(),
        "before": before.to_json(),
        "after": row(&args.out.path, false, fixed.after, &fixed.places_after).to_json(),
    })
}

/// What was done, what is left, and what to do next.
fn text(args: &FixArgs, options: &FixOptions, fixed: &Fixed, summary: &Summary) -> String {
    let done = &fixed.repairs;
    let size = |counts: &Counts| {
        let faces = counted(counts.n_triangles, "face");
        format!("{faces}, {}", vertices(counts.n_vertices))
    };
    let mut text = format!("{}: {}\n", printable(&args.mesh), size(&fixed.before));
    let mut is_changed = false;
    for &repair in &options.repairs {
        let said = said(repair, fixed);
        if said.is_empty() {
            continue;
        }
        is_changed = true;
        text += &format!("  {:<15} {}\n", repair.name(), said.join(", "));
    }
    if !is_changed {
        text += "  nothing to mend\n";
    }
    text += &format!("{}: {}\n", printable(&args.out.path), size(&fixed.after));
    let after = &fixed.after;
    let left: Vec<String> = [
        (
            after.self_intersections,
            "pair of faces that intersect",
            "pairs of faces that intersect",
        ),
        (after.degenerate, "degenerate face", "degenerate faces"),
        (after.duplicates, "duplicate face", "duplicate faces"),
        (
            after.non_manifold_facets,
            "non-manifold edge",
            "non-manifold edges",
        ),
        (
            after.non_manifold_vertices,
            "non-manifold vertex",
            "non-manifold vertices",
        ),
        (
            after.inconsistent_facets,
            "edge of inconsistent orientation",
            "edges of inconsistent orientation",
        ),
        (after.boundary_facets, "border edge", "border edges"),
        (
            done.non_orientable,
            "piece without an orientation",
            "pieces without an orientation",
        ),
        (
            done.flat_shells,
            "shell without volume",
            "shells without volume",
        ),
        (
            Finding::InsideOut.count(after),
            "closed surface inside out",
            "closed surfaces inside out",
        ),
        (
            after.unused_vertices,
            "vertex of no face",
            "vertices of no face",
        ),
    ]
    .into_iter()
    .filter(|&(n, ..)| n > 0)
    .map(|(n, one, many)| several(n, one, many))
    .collect();
    let left = match left.is_empty() {
        true => "nothing".to_owned(),
        false => left.join(", "),
    };
    text += &format!("left: {left}\n");
    let not_kept = [
        (summary.n_parts_joined, "name of a part", "names of parts"),
        (
            summary.n_polygons_fanned,
            "polygon, now triangles",
            "polygons, now triangles",
        ),
    ];
    let not_kept = not_kept.into_iter().filter(|&(n, ..)| n > 0);
    let not_kept: Vec<String> = not_kept
        .map(|(n, one, many)| several(n, one, many))
        .collect();
    if !not_kept.is_empty() {
        text += &format!("not kept: {}\n", not_kept.join("; "));
    }
    let is_stl = args.out.format == MendedFormat::Stl;
    if is_stl && fixed.has_seams() {
        text += "note: STL has positions alone, so readers join again what was split; PLY and OBJ keep it apart\n";
    }
    let seams = if fixed.has_seams() && !is_stl {
        " --keep-seams"
    } else {
        ""
    };
    let out = quoted(&args.out.path.to_string_lossy());
    text += &format!("next: impinge check {out}{seams}\n");
    text
}

/// What a repair did, in words; nothing if it did nothing.
fn said(repair: Repair, fixed: &Fixed) -> Vec<String> {
    let done = &fixed.repairs;
    let faces = |n: u64| counted(n, "face");
    let of = |n: u64, text: String| (n > 0).then_some(text);
    let said = match repair {
        Repair::Weld => vec![of(
            done.welded_vertices,
            vertices(done.welded_vertices) + " removed",
        )],
        Repair::Duplicates => vec![
            of(
                done.duplicate_faces,
                faces(done.duplicate_faces) + " removed",
            ),
            of(
                done.opposite_faces,
                format!(
                    "{} of them of opposite pairs, of which none stays",
                    done.opposite_faces
                ),
            ),
        ],
        Repair::Degenerate => vec![
            of(
                done.degenerate_faces,
                faces(done.degenerate_faces) + " removed",
            ),
            of(
                done.divided_faces,
                faces(done.divided_faces) + " used to divide neighbours",
            ),
        ],
        Repair::Orient => vec![
            of(done.turned_faces, faces(done.turned_faces) + " turned"),
            of(
                done.non_orientable,
                counted(done.non_orientable, "piece") + " not orientable",
            ),
        ],
        Repair::SplitEdges => vec![
            of(
                done.split_edges,
                counted(done.split_edges, "edge") + " split",
            ),
            of(
                done.split_edges_added,
                vertices(done.split_edges_added) + " added",
            ),
        ],
        Repair::SplitVertices => vec![
            of(
                done.split_vertices,
                vertices(done.split_vertices) + " split",
            ),
            of(
                done.split_vertices_added,
                vertices(done.split_vertices_added) + " added",
            ),
        ],
        Repair::CloseHoles => vec![
            of(
                done.closed_holes,
                format!(
                    "{} closed with {}",
                    counted(done.closed_holes, "hole"),
                    faces(done.added_faces)
                ),
            ),
            of(
                done.refused_holes,
                counted(done.refused_holes, "hole") + " without a filling that is sound",
            ),
        ],
        Repair::Outward if done.turned_shells == 0 => Vec::new(),
        Repair::Outward => vec![
            of(
                done.turned_shells,
                format!(
                    "{} of {} turned",
                    done.turned_shells,
                    counted(done.shells, "shell")
                ),
            ),
            of(done.cavities, several(done.cavities, "cavity", "cavities")),
        ],
        Repair::Unused => vec![of(
            done.unused_vertices,
            vertices(done.unused_vertices) + " removed",
        )],
    };
    said.into_iter().flatten().collect()
}

fn vertices(n: u64) -> String {
    several(n, "vertex", "vertices")
}
