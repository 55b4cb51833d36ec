//! `impinge check --html`: one self-contained page with a sortable table, a picture per mesh and
//! one per place, and a view of each mesh that can be turned.
//!
//! Pictures are PNG in base64, drawn on the CPU. Browsers decode them when they come into view, and
//! those of places when their list is opened. Meshes are read and drawn one after another, so
//! memory holds one of them.

mod assembly;
mod view;

use std::io::Write;
use std::path::Path;

use impinge_check::report::{COLUMNS, escaped, numbers};
use impinge_check::{Checked, Place, Problem, Report, Row};
use impinge_io::AtomicFile;
use impinge_render::{Camera, Focus, Picture};

pub use self::assembly::write as write_assembly;
use super::args::CheckArgs;
use super::shown::surface;
use crate::error::Error;
use crate::picture::diagonal;
use crate::text::grouped;

const STYLE: &str = include_str!("report.css");
const TABLE: &str = include_str!("report.js");
const SCRIPT: &str = include_str!("html/view.js");

/// The window that `view.js` draws in.
const VIEW: &str = "<dialog><canvas tabindex=\"0\" aria-label=\"The mesh. Drag or use the arrow keys to turn it.\"></canvas>\
    <div class=\"panel\"><div class=\"bar\"><b></b><button data-do=\"previous\">Previous</button><button data-do=\"next\">Next</button>\
    <button data-do=\"whole\">Whole</button><button data-do=\"close\">Close</button></div><p class=\"at\"></p>\
    <p class=\"hint\">Drag: turn. Wheel or two fingers: nearer. <span>Shift or right button: move. N, P: next and previous place.</span></p>\
    </div></dialog>\n";

/// Width and height of a picture.
const SIZE: [u32; 2] = [240, 180];
/// Said in place of pictures.
const NO_PICTURE: &str = "<div class=\"error\">no picture: the mesh has changed since this row was written, or its check reached a limit</div>";
/// The most pictures of places per mesh; the others are listed.
const MOST_PICTURES: usize = 6;

/// The beginning of a page of its own that loads nothing.
fn start(title: &str, summary: &str) -> String {
    let summary = escaped(summary);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>{title}: {summary}</title>\n\
         <style>\n{STYLE}</style></head>\n<body><h1>{title}</h1>\n<p>{summary}</p>\n"
    )
}

/// Its end: the view, and the scripts.
fn end(table: &str, args: &CheckArgs) -> String {
    let up = format!("{:?}", args.picture.up).to_lowercase();
    format!("{VIEW}<script data-up=\"{up}\">\n{table}{SCRIPT}</script>\n</body></html>\n")
}

/// Writes the report.
pub fn write(path: &Path, report: &Report<'_>, args: &CheckArgs) -> Result<(), Error> {
    let failed = |source| Error::Write {
        path: path.to_owned(),
        source,
    };
    let mut to = AtomicFile::create(path)?;
    let rows = report.rows;
    to.write_all(head(&report.summary()).as_bytes())
        .map_err(failed)?;
    let most = view::share(rows.iter().filter(|row| row.result.is_ok()).count());
    for row in rows {
        to.write_all(of_row(row, most, args)?.as_bytes())
            .map_err(failed)?;
    }
    let tail = format!("</tbody></table>\n{}", end(TABLE, args));
    to.write_all(tail.as_bytes()).map_err(failed)?;
    Ok(to.finish()?)
}

fn head(summary: &str) -> String {
    let start = start("impinge check", summary);
    let legend: String = Problem::ALL
        .iter()
        .map(|problem| {
            let [r, g, b] = problem.color();
            format!(
                "<span><i style=\"background:rgb({r},{g},{b})\"></i>{}</span> ",
                problem.name()
            )
        })
        .collect();
    let names = ["mesh"]
        .into_iter()
        .chain(COLUMNS.map(|(name, _)| name))
        .chain(["volume"]);
    let names: Vec<&str> = names.collect();
    let heads: String = names
        .iter()
        .enumerate()
        .map(|(ix, name)| {
            let class = if ix == 0 { " class=\"name\"" } else { "" };
            format!("<th scope=\"col\"{class}>{name}</th>")
        })
        .collect();
    let choices: String = names
        .iter()
        .enumerate()
        .map(|(ix, name)| format!("<option value=\"{}\">{name}</option>", ix + 1))
        .collect();
    format!(
        "{start}<p class=\"legend\">{legend}</p>\n\
         <label class=\"sort\">Sort by <select>{choices}</select></label>\n\
         <table><thead><tr><th class=\"pic\" scope=\"col\"></th>{heads}</tr></thead>\n<tbody>\n"
    )
}

fn of_row(row: &Row, most: usize, args: &CheckArgs) -> Result<String, Error> {
    let name = escaped(&row.path);
    let counts = match &row.result {
        Ok(counts) => counts,
        Err(failure) => {
            let empty: String = COLUMNS
                .map(|(label, _)| format!("<td data-label=\"{label}\"></td>"))
                .concat();
            return Ok(format!(
                "<tr><td class=\"pic\"></td><td class=\"name\" data-v=\"{name}\">{name}<div class=\"error\">{}</div></td>\
                 {empty}<td data-label=\"volume\"></td></tr>\n",
                escaped(&failure.message)
            ));
        }
    };
    let (mut thumbnail, mut details) = (String::new(), String::new());
    if let Some(checked) = Checked::of_row(row) {
        let mut picture = Picture {
            surfaces: vec![surface(&checked)],
            camera: Camera {
                up: args.picture.up.into(),
                ..Camera::default()
            },
            size: SIZE,
            ..Picture::default()
        };
        thumbnail = image(&picture, &row.path)?;
        let spots: Vec<view::Spot> = checked
            .places
            .iter()
            .map(|place| (place.point, place.size))
            .collect();
        let mesh = view::element(&picture.surfaces[0], &spots, &[], most);
        if let Some(mesh) = &mesh {
            thumbnail = see(&thumbnail) + mesh;
        }
        if !row.places.is_empty() {
            let what = crate::text::counted(row.places.len() as u64, "place");
            details += &format!("<details><summary>{what}</summary><div class=\"places\">");
            let length = diagonal(&picture.surfaces);
            for (ix, place) in row.places.iter().enumerate() {
                look_at(&mut picture, place, &checked, length, args);
                let shown = if ix < MOST_PICTURES {
                    image(&picture, place.problem.name())?
                } else {
                    String::new()
                };
                let caption = caption(place);
                details += &match (picture.focus, &mesh) {
                    (Some(focus), Some(_)) => format!(
                        "<button class=\"see place\" {}>{shown}<span>{caption}</span></button>",
                        view::attributes(&picture.camera, &focus)
                    ),
                    _ => format!("<div class=\"place\">{shown}<span>{caption}</span></div>"),
                };
            }
            details += "</div></details>";
        }
    } else {
        details += NO_PICTURE;
    }
    let mut text = format!(
        "<tr><td class=\"pic\">{thumbnail}</td><td class=\"name\" data-v=\"{name}\">{name}{details}</td>"
    );
    for ((label, problem), n) in COLUMNS.into_iter().zip(numbers(counts)) {
        let class = match problem {
            Some(kind) if kind.is_in(row) => " class=\"bad\"",
            Some(_) => " class=\"ok\"",
            None => "",
        };
        text += &format!(
            "<td data-label=\"{label}\" data-v=\"{n}\"{class}>{}</td>",
            grouped(n)
        );
    }
    let volume = match counts.volume {
        Some(volume) => {
            format!("<td data-label=\"volume\" data-v=\"{volume:e}\">{volume:.4e}</td>")
        }
        None => "<td data-label=\"volume\"></td>".to_owned(),
    };
    Ok(text + &volume + "</tr>\n")
}

/// What opens the view when it is clicked.
fn see(picture: &str) -> String {
    format!("<button class=\"see\" title=\"Look at it from all sides\">{picture}</button>")
}

fn caption(place: &Place) -> String {
    let [x, y, z] = place.point;
    let what = match place.vertex {
        Some(vertex) => format!("non-manifold vertex {vertex}"),
        None => place.problem.name().to_owned(),
    };
    let first: Vec<String> = place.elements.iter().take(3).map(u32::to_string).collect();
    let n = crate::text::counted(place.n_elements, "element");
    format!(
        "{what}: {n}, such as {}; near ({x:.6}, {y:.6}, {z:.6})",
        first.join(", ")
    )
}

/// Looks at a place from the side to which its first element faces.
fn look_at(picture: &mut Picture, place: &Place, checked: &Checked, length: f64, args: &CheckArgs) {
    let corners = place
        .elements
        .first()
        .map(|&element| match &checked.mesh.elements {
            impinge_io::Elements::Triangles(all) => all[element as usize],
            impinge_io::Elements::Tetrahedra(all) => [0, 1, 2].map(|ix| all[element as usize][ix]),
        });
    if let Some(corners) = corners {
        let [a, b, c] = corners.map(|v| checked.mesh.positions.get(v as usize).unwrap_or_default());
        let (u, v) = (
            [0, 1, 2].map(|k| b[k] - a[k]),
            [0, 1, 2].map(|k| c[k] - a[k]),
        );
        let n = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        let norm = n[0].hypot(n[1]).hypot(n[2]);
        if norm > 0.0 && norm.is_finite() {
            let (right, front, up) = match picture.camera.up {
                impinge_render::UpAxis::Z => (n[0], -n[1], n[2]),
                _ => (n[0], n[2], n[1]),
            };
            // A little from the side, so that what stands upright on the element is seen too.
            picture.camera.azimuth = right.atan2(front).to_degrees() + 20.0;
            picture.camera.elevation =
                ((up / norm).clamp(-1.0, 1.0).asin().to_degrees() + 15.0).clamp(-80.0, 80.0);
        }
    }
    let size = place.size.min(length);
    let distance = if size > 0.0 { 2.5 * size } else { 0.1 * length };
    picture.focus = (distance > 0.0 && distance.is_finite()).then_some(Focus {
        target: place.point,
        distance,
    });
    picture.see_through = args.picture.see_through;
}

fn image(picture: &Picture, alt: &str) -> Result<String, Error> {
    let png = picture.draw()?.to_png()?;
    let [width, height] = SIZE;
    Ok(format!(
        "<img loading=\"lazy\" decoding=\"async\" width=\"{width}\" height=\"{height}\" alt=\"{}\" src=\"data:image/png;base64,{}\">",
        escaped(alt),
        base64(&png)
    ))
}

/// Base64 (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for part in bytes.chunks(3) {
        let byte = |ix: usize| u32::from(part.get(ix).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for ix in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * ix) & 63) as usize];
            text.push(if ix <= part.len() { digit.into() } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::base64;

    #[test]
    fn base64_as_in_the_standard() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
