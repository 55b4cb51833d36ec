//! 3MF: the objects that the build places, as one body or as a body per item.
//!
//! Source: 3MF Consortium, "3MF Core Specification" 1.3 and "Production Extension" 1.1 (objects in
//! parts of their own). Coordinates are read as f64, correctly rounded, in the unit of the file.
//! Those of items and components with a transform are computed in f64, each sum and product rounded
//! to nearest; a transform that mirrors turns the triangles, so that matter stays inside. Colours,
//! materials and other extensions are ignored.

mod zip;

use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use self::zip::Archive;
use crate::bodies::PartName;
use crate::budget::{Budget, most_expanded};
use crate::collect::{Collector, check_n_vertices, finite, vertex_ix};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::options::ReadOptions;

/// How deep components may be nested.
const DEEPEST: usize = 32;
/// The part that is the model if no relationship names one.
const USUAL: &str = "3D/3dmodel.model";

/// Units of a model; without one, numbers are millimetres.
const UNITS: [&str; 5] = ["micron", "centimeter", "inch", "foot", "meter"];

/// Rows for x, y, z and the shift: a point is a row vector before it.
type Matrix = [[f64; 3]; 4];

#[derive(Default)]
struct Object {
    name: String,
    points: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    components: Vec<Use>,
}

/// An object that an item of the build or a component places.
#[derive(Clone)]
struct Use {
    /// The part of the object, if it is another one.
    part: Option<String>,
    id: String,
    transform: Option<Matrix>,
}

#[derive(Default)]
struct Model {
    objects: HashMap<String, Object>,
    items: Vec<Use>,
    /// If it is not a millimetre.
    unit: Option<&'static str>,
}

pub(crate) fn read<'a>(
    bytes: &[u8],
    name: Name<'a>,
    options: &ReadOptions,
) -> Result<Collector<'a>, Error> {
    let archive = Archive::open(bytes, name)?;
    let length = bytes.len() as u64;
    let mut package = Package {
        archive,
        name,
        packed: Budget::new(most_expanded(length, options.max_expanded_bytes)),
        placed: Budget::new(options.max_expanded_bytes.max(16 * length)),
        models: HashMap::new(),
    };
    let root = package.root()?;
    package.load(&root)?;
    let items = package.models[&root].items.clone();
    let mut out = Collector::new(name);
    out.unit = package.models[&root].unit;
    let mut points = Vec::new();
    for item in &items {
        let part = item.part.clone().unwrap_or_else(|| root.clone());
        package.load(&part)?;
        let label = package.models[&part]
            .objects
            .get(&item.id)
            .map(|object| object.name.clone());
        let label = label.filter(|label| !label.is_empty());
        let stand_in = format!("object {}", item.id);
        let named = label.as_deref();
        out.begin_part(
            named.map_or(PartName::StandIn(&stand_in), PartName::Given),
            true,
            points.len(),
        );
        package.place(&part, item, item.transform, 0, &mut points, &mut out)?;
    }
    check_n_vertices(name, Place::File, points.len() as u64)?;
    out.positions = Positions::F64(points);
    Ok(out)
}

struct Package<'p> {
    archive: Archive<'p>,
    name: Name<'p>,
    packed: Budget,
    placed: Budget,
    models: HashMap<String, Model>,
}

impl Package<'_> {
    /// The part of the model, by the relationships of the package.
    fn root(&mut self) -> Result<String, Error> {
        let Some(bytes) = self
            .archive
            .part("_rels/.rels", self.name, &mut self.packed)?
        else {
            return Ok(USUAL.to_owned());
        };
        let label = format!("{}/_rels/.rels", self.name.0);
        let mut found = None;
        each_tag(&bytes, Name(&label), |_, tag| {
            let is_model = attribute(tag, "Type").is_some_and(|kind| kind.ends_with("/3dmodel"));
            if local(tag.name().as_ref()) == "Relationship" && is_model && found.is_none() {
                found = attribute(tag, "Target");
            }
            Ok(())
        })?;
        Ok(found.map_or_else(|| USUAL.to_owned(), |part| plain(&part)))
    }

    /// Reads a part, unless it is read already.
    fn load(&mut self, part: &str) -> Result<(), Error> {
        if self.models.contains_key(part) {
            return Ok(());
        }
        let Some(bytes) = self.archive.part(part, self.name, &mut self.packed)? else {
            let what = format!("the part {}", shown(part.as_bytes()));
            return Err(self.name.syntax(Place::File, what, "none in the archive"));
        };
        let label = format!("{}/{part}", self.name.0);
        let model = parse(&bytes, Name(&label))?;
        self.models.insert(part.to_owned(), model);
        Ok(())
    }

    /// Adds the triangles of an object and of its components.
    fn place(
        &mut self,
        part: &str,
        used: &Use,
        transform: Option<Matrix>,
        depth: usize,
        points: &mut Vec<[f64; 3]>,
        out: &mut Collector,
    ) -> Result<(), Error> {
        let name = self.name;
        if depth > DEEPEST {
            return Err(name.too_large(
                Place::File,
                "depth of components",
                DEEPEST as u64,
                depth as u64,
            ));
        }
        let found = self.models[part].objects.get(&used.id);
        let Some(object) = found else {
            let what = format!(
                "the object {} in {}",
                shown(used.id.as_bytes()),
                shown(part.as_bytes())
            );
            return Err(name.syntax(Place::File, what, "none"));
        };
        // Objects without triangles are charged too: a few of them can be placed in more ways than
        // time allows.
        let n = object.points.len() as u64 * 24 + object.triangles.len() as u64 * 12 + 64;
        self.placed.charge(name, Place::File, n, 1)?;
        let first = points.len() as u64;
        check_n_vertices(name, Place::File, first + object.points.len() as u64)?;
        let first = first as u32;
        match &transform {
            None => points.extend_from_slice(&object.points),
            Some(matrix) => {
                for (ix, &point) in object.points.iter().enumerate() {
                    points.push(finite(name, Place::File, ix, moved(point, matrix))?);
                }
            }
        }
        let is_mirrored = transform
            .as_ref()
            .is_some_and(|matrix| determinant(matrix) < 0.0);
        out.triangles
            .extend(object.triangles.iter().map(|&[a, b, c]| {
                let face = if is_mirrored { [a, c, b] } else { [a, b, c] };
                face.map(|vertex| vertex + first)
            }));
        for component in object.components.clone() {
            let inner = component.part.clone().unwrap_or_else(|| part.to_owned());
            self.load(&inner)?;
            let both = match (component.transform, transform) {
                (Some(inner), Some(outer)) => Some(product(&inner, &outer)),
                (inner, outer) => inner.or(outer),
            };
            self.place(&inner, &component, both, depth + 1, points, out)?;
        }
        Ok(())
    }
}

fn moved(point: [f64; 3], matrix: &Matrix) -> [f64; 3] {
    let [x, y, z] = point;
    [0, 1, 2].map(|k| x * matrix[0][k] + y * matrix[1][k] + z * matrix[2][k] + matrix[3][k])
}

fn product(first: &Matrix, then: &Matrix) -> Matrix {
    let row = |row: [f64; 3], shift: f64| {
        [0, 1, 2].map(|k| {
            row[0] * then[0][k] + row[1] * then[1][k] + row[2] * then[2][k] + shift * then[3][k]
        })
    };
    [
        row(first[0], 0.0),
        row(first[1], 0.0),
        row(first[2], 0.0),
        row(first[3], 1.0),
    ]
}

fn determinant([a, b, c, _]: &Matrix) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}

/// A part's name without the slash that begins it.
fn plain(part: &str) -> String {
    part.trim_start_matches('/').to_owned()
}

/// A name without its namespace.
fn local(name: &str) -> &str {
    name.rsplit(':').next().unwrap_or(name)
}

/// An attribute by its local name.
fn attribute(tag: &BytesStart, key: &str) -> Option<String> {
    let mut all = tag.attributes();
    let found = all.find_map(|held| held.ok().filter(|held| local(held.key.as_ref()) == key))?;
    Some(match quick_xml::escape::unescape(&found.value) {
        Ok(text) => text.into_owned(),
        Err(_) => found.value.into_owned(),
    })
}

/// Calls `each` for every start tag, with the place where it ends.
fn each_tag(
    bytes: &[u8],
    name: Name,
    mut each: impl FnMut(Place, &BytesStart) -> Result<(), Error>,
) -> Result<(), Error> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        name.syntax(
            Place::Byte(error.valid_up_to() as u64),
            "text in UTF-8",
            "other bytes",
        )
    })?;
    let mut reader = Reader::from_str(text);
    loop {
        let event = reader.read_event().map_err(|error| {
            let message = error.to_string().replace(['\n', '\r'], " ");
            name.syntax(
                Place::Byte(reader.error_position()),
                "well-formed XML",
                message,
            )
        })?;
        match event {
            Event::Start(tag) | Event::Empty(tag) => {
                each(Place::Byte(reader.buffer_position()), &tag)?
            }
            Event::Eof => return Ok(()),
            _ => {}
        }
    }
}

fn parse(bytes: &[u8], name: Name) -> Result<Model, Error> {
    let mut model = Model::default();
    let mut current: Option<String> = None;
    each_tag(bytes, name, |place, tag| {
        let needed = |key: &str| {
            attribute(tag, key).ok_or_else(|| {
                let what = format!(
                    "the attribute '{key}' of {}",
                    shown(tag.name().as_ref().as_bytes())
                );
                name.syntax(place, what, "none")
            })
        };
        let tag_name = tag.name();
        match local(tag_name.as_ref()) {
            "model" => {
                let unit = attribute(tag, "unit");
                model.unit = UNITS.into_iter().find(|own| unit.as_deref() == Some(own));
            }
            "object" => {
                let id = needed("id")?;
                let object = Object {
                    name: attribute(tag, "name").unwrap_or_default(),
                    ..Object::default()
                };
                if model.objects.insert(id.clone(), object).is_some() {
                    let what = format!("one object {}", shown(id.as_bytes()));
                    return Err(name.syntax(place, what, "another one"));
                }
                current = Some(id);
            }
            "item" => {
                current = None;
                model
                    .items
                    .push(used(tag, needed("objectid")?, name, place)?);
            }
            kind @ ("vertex" | "triangle" | "component") => {
                let Some(object) = current.as_ref().and_then(|id| model.objects.get_mut(id)) else {
                    return Err(name.syntax(place, "an object", format!("{kind} outside of one")));
                };
                match kind {
                    "vertex" => {
                        let mut at = [0.0; 3];
                        for (value, key) in at.iter_mut().zip(["x", "y", "z"]) {
                            *value = number(&needed(key)?, name, place)?;
                        }
                        let ix = object.points.len();
                        object.points.push(finite(name, place, ix, at)?);
                    }
                    "triangle" => {
                        let mut face = [0; 3];
                        for (value, key) in face.iter_mut().zip(["v1", "v2", "v3"]) {
                            let text = needed(key)?;
                            let index: i64 = text.trim().parse().map_err(|_| {
                                name.syntax(place, "the number of a vertex", shown(text.as_bytes()))
                            })?;
                            *value = vertex_ix(name, index, 0, object.points.len() as u64, place)?;
                        }
                        object.triangles.push(face);
                    }
                    _ => object
                        .components
                        .push(used(tag, needed("objectid")?, name, place)?),
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(model)
}

fn used(tag: &BytesStart, id: String, name: Name, place: Place) -> Result<Use, Error> {
    let transform = match attribute(tag, "transform") {
        None => None,
        Some(text) => {
            let mut numbers = Vec::with_capacity(12);
            for word in text.split_whitespace() {
                numbers.push(number(word, name, place)?);
            }
            let numbers: [f64; 12] = numbers.as_slice().try_into().map_err(|_| {
                name.count(place, "numbers of a transform", 12, numbers.len() as u64)
            })?;
            let matrix: Matrix =
                [0, 3, 6, 9].map(|at| [numbers[at], numbers[at + 1], numbers[at + 2]]);
            Some(matrix)
        }
    };
    Ok(Use {
        part: attribute(tag, "path").map(|part| plain(&part)),
        id,
        transform,
    })
}

fn number(text: &str, name: Name, place: Place) -> Result<f64, Error> {
    text.trim()
        .parse()
        .map_err(|_| name.syntax(place, "a number", shown(text.as_bytes())))
}
