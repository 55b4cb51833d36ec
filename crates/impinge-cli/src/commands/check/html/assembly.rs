//! The page of an assembly: the matrix of its parts, each pair that is not apart with a picture, and a
//! view of all parts. At a place of the view its two parts have a colour each and the others are
//! faint.

use std::io::Write;
use std::path::Path;

use impinge_check::report::escaped;
use impinge_check::{Assembly, PartPair};
use impinge_io::{AtomicFile, Elements, Mesh, printable};
use impinge_render::{Camera, Face, Focus, Normals, Picture, Surface};

use super::super::args::CheckArgs;
use super::super::relations::{LEGEND, matrix, said, summary};
use super::{MOST_PICTURES, SIZE, end, image, see, start, view};
use crate::error::Error;
use crate::palette;
use crate::picture::{bounds, diagonal};
use crate::text::counted;

/// Writes the page.
pub fn write(
    path: &Path,
    args: &CheckArgs,
    names: &[String],
    meshes: &[Mesh],
    answer: &Assembly,
) -> Result<(), Error> {
    let failed = |source| Error::Write {
        path: path.to_owned(),
        source,
    };
    let mut body = start("impinge check --assembly", &summary(args, answer));
    body += "<section>\n";
    body += &table(names, answer);
    body += &places(args, names, meshes, answer)?;
    body += "</section>\n";
    body += &end("", args);
    let mut to = AtomicFile::create(path)?;
    to.write_all(body.as_bytes()).map_err(failed)?;
    Ok(to.finish()?)
}

/// The matrix. A cell of two parts that are not apart opens the view at their place.
fn table(names: &[String], answer: &Assembly) -> String {
    let legend = LEGEND.map(|letter| format!("<span>{letter}</span>"));
    let mut text = format!(
        "<p class=\"legend\">{}</p>\n\
         <div class=\"scroll\"><table class=\"matrix\"><thead><tr><th scope=\"col\"></th>",
        legend.join(" ")
    );
    for (number, name) in names.iter().enumerate() {
        let name = escaped(name);
        text += &format!("<th scope=\"col\" title=\"{name}\">{number}</th>");
    }
    text += "</tr></thead>\n<tbody>\n";
    for (number, (name, row)) in names.iter().zip(matrix(answer)).enumerate() {
        text += &format!("<tr><th scope=\"row\">{number} {}</th>", escaped(name));
        for (other, letter) in row.into_iter().enumerate() {
            let class = match letter {
                'X' | 'I' | 'O' | 'i' | 'o' => " class=\"bad\"",
                'n' => " class=\"near\"",
                _ => "",
            };
            let parts = [number.min(other), number.max(other)];
            let at = answer.pairs.binary_search_by_key(&parts, |pair| pair.parts);
            text += &match at {
                Ok(at) => format!(
                    "<td{class}><button class=\"see\" data-at=\"{at}\">{letter}</button></td>"
                ),
                Err(_) if letter == '.' => "<td></td>".to_owned(),
                Err(_) => format!("<td>{letter}</td>"),
            };
        }
        text += "</tr>\n";
    }
    text + "</tbody></table></div>\n"
}

/// The picture of the whole, and the places.
fn places(
    args: &CheckArgs,
    names: &[String],
    meshes: &[Mesh],
    answer: &Assembly,
) -> Result<String, Error> {
    let parts = (0..).zip(meshes);
    let parts = parts.map(|(part, mesh)| surface(mesh, palette::body(part).colliding, false));
    let mut picture = Picture {
        surfaces: parts.collect(),
        camera: Camera {
            up: args.picture.up.into(),
            ..Camera::default()
        },
        size: SIZE,
        see_through: args.picture.see_through,
        ..Picture::default()
    };
    let whole = image(&picture, "all parts")?;
    let boxes = meshes.iter().map(|mesh| bounds(&mesh.positions.to_f64()));
    let boxes: Vec<[[f64; 3]; 2]> = boxes.collect();
    let size = |pair: &PartPair| {
        let lengths = pair.parts.map(|part| length(boxes[part]));
        // What both boxes hold, but not much less than the smaller part.
        let [a, b] = pair.parts.map(|part| boxes[part]);
        let both = [
            [0, 1, 2].map(|k| a[0][k].max(b[0][k])),
            [0, 1, 2].map(|k| a[1][k].min(b[1][k])),
        ];
        length(both).max(0.3 * lengths[0].min(lengths[1]))
    };
    let spots: Vec<view::Spot> = answer
        .pairs
        .iter()
        .map(|pair| (pair.point, size(pair)))
        .collect();
    let counts: Vec<usize> = picture
        .surfaces
        .iter()
        .map(|part| part.faces.len())
        .collect();
    let mesh = view::element(&joined(&picture.surfaces), &spots, &counts, view::share(1));
    let title = counted(names.len() as u64, "part");
    let mut text = match &mesh {
        Some(mesh) => format!("<div data-v=\"{title}\">{}{mesh}</div>\n", see(&whole)),
        None => whole,
    };
    let all = diagonal(&picture.surfaces);
    text += "<ul class=\"pairs\">\n";
    for (ix, (pair, (target, size))) in answer.pairs.iter().zip(spots).enumerate() {
        // Parts without an extent are looked at from where they can be found.
        let distance = 3.5 * if size > 0.0 { size } else { 0.04 * all };
        picture.focus =
            (distance > 0.0 && distance.is_finite()).then_some(Focus { target, distance });
        let mut shown = String::new();
        if ix < MOST_PICTURES {
            let two = [0, 1].map(|side| (pair.parts[side], palette::body(side).colliding));
            picture.surfaces = two
                .map(|(part, color)| surface(&meshes[part], color, true))
                .into();
            shown = image(&picture, pair.relation.name())?;
        }
        let name = |side: usize, class: &str| {
            let [red, green, blue] = palette::body(side).colliding;
            let name = escaped(&printable(&names[pair.parts[side]]));
            format!(
                "<i class=\"{class}\" style=\"background:rgb({red},{green},{blue})\"></i>{name}"
            )
        };
        let [a, b] = [name(0, "one"), name(1, "two")];
        let caption = said([&a, &b], pair);
        text += &match (picture.focus, &mesh) {
            (Some(focus), Some(_)) => format!(
                "<li><button class=\"see place\" data-parts=\"{},{}\" {}>{shown}<span>{caption}</span></button></li>\n",
                pair.parts[0],
                pair.parts[1],
                view::attributes(&picture.camera, &focus)
            ),
            _ => format!("<li class=\"place\">{shown}<span>{caption}</span></li>\n"),
        };
    }
    Ok(text + "</ul>\n")
}

fn surface(mesh: &Mesh, color: [u8; 3], shows_through: bool) -> Surface {
    let faces = match &mesh.elements {
        Elements::Triangles(faces) => &faces[..],
        // Refused before.
        Elements::Tetrahedra(_) => &[],
    };
    let faces = faces.iter().map(|&corners| Face {
        corners,
        color,
        shows_through,
    });
    Surface {
        positions: mesh.positions.to_f64(),
        faces: faces.collect(),
        normals: Normals::Flat,
    }
}

/// All parts as one mesh.
fn joined(parts: &[Surface]) -> Surface {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    for part in parts {
        let first = positions.len() as u32;
        faces.extend(part.faces.iter().map(|face| Face {
            corners: face.corners.map(|corner| first + corner),
            ..*face
        }));
        positions.extend(&part.positions);
    }
    Surface {
        positions,
        faces,
        normals: Normals::Flat,
    }
}

/// The diagonal of a box; along an axis where its ends are reversed it has no length.
fn length([low, high]: [[f64; 3]; 2]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| (high[k] - low[k]).max(0.0));
    x.hypot(y).hypot(z)
}
