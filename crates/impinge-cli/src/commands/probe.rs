//! `impinge probe`: which elements of a mesh are nearest to each of many points, which of them are
//! inside, and which tetrahedron contains each.

use std::io::Write;

use impinge::{CancelToken, Closest, ClosestElement, Query};
use impinge_io::{Cell, Column, Holds, ReadOptions, printable, read_points};

use crate::apart::Inputs;
use crate::args::ProbeArgs;
use crate::detection::Times;
use crate::error::Error;
use crate::one_mesh::{OneMesh, rows_of_stdin};
use crate::output::{how_alone, say};
use crate::text::{counted, exactly, grouped, hex};
use crate::values::RowsFile;
use crate::watch::go_on;
use crate::{report, rows};

/// `impinge probe`.
pub fn probe(args: &ProbeArgs, cancel: &CancelToken) -> Result<(), Error> {
    let inputs = Inputs::new([&args.mesh, &args.points]);
    let rows_file = args.rows.file(&inputs, args.how.json)?;
    let of_stdin = rows_of_stdin("--points -", &args.points, &args.mesh)?;
    let mesh = OneMesh::read(&args.mesh, &args.how, cancel)?;
    go_on(cancel)?;
    let points = match of_stdin {
        Some(points) => points,
        None => read_points(&args.points, &ReadOptions::as_they_are())?,
    };
    let mut detector = mesh.detector(&args.how, cancel)?;
    let scene = mesh.scene();
    // First what may be refused.
    let places = match args.signed {
        true => {
            let places = detector.contains(scene, mesh.id, &points);
            Some(places.map_err(|error| mesh.refused(error))?)
        }
        false => None,
    };
    let mut times = Times::default();
    if args.signed {
        times.add(detector.stats());
    }
    let tetrahedra = match args.locate {
        true => {
            let found = detector.locate(scene, mesh.id, &points);
            let found = found.map_err(|error| mesh.refused(error))?;
            times.add(detector.stats());
            Some(found)
        }
        false => None,
    };
    let most = args.most.unwrap_or(f64::INFINITY);
    let query = Query::all().n_nearest(args.nearest.get().min(mesh.most_faces()?));
    let closest = detector.closest(scene, &points, most, &query)?;
    times.add(closest.stats());
    let answer = Answer {
        args,
        mesh: &mesh,
        closest: &closest,
        places: places.as_deref(),
        tetrahedra: tetrahedra.as_deref(),
        ms: times.sum_ms(),
    };
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        answer.write_rows(file)?;
    }
    if args.how.json {
        report::print(&answer.report()?)?;
        return Ok(());
    }
    let mut text = Vec::new();
    answer.print(&mut text)?;
    say(&text, rows_file.as_ref())
}

/// Where a point lies, as a word.
fn word(place: i8) -> &'static str {
    match place {
        1 => "inside",
        0 => "on",
        _ => "outside",
    }
}

struct Answer<'a> {
    args: &'a ProbeArgs,
    mesh: &'a OneMesh,
    closest: &'a Closest,
    /// 1 inside, 0 on the surface, -1 outside.
    places: Option<&'a [i8]>,
    tetrahedra: Option<&'a [Option<u32>]>,
    ms: f64,
}

impl Answer<'_> {
    /// The points that are near enough, by their numbers, with what is nearest to them.
    fn found(&self) -> impl Iterator<Item = (usize, ClosestElement)> + '_ {
        let points = 0..self.closest.len();
        points.filter_map(|point| Some((point, self.closest.get(point)?)))
    }

    /// All elements that were found, with the numbers of their points.
    fn all_found(&self) -> impl Iterator<Item = (usize, ClosestElement)> + '_ {
        let n_nearest = self.closest.n_nearest();
        let rows = self.closest.iter().enumerate();
        rows.filter_map(move |(row, found)| Some((row / n_nearest, found?)))
    }

    /// How many points are in a tetrahedron.
    fn n_located(&self) -> Option<u64> {
        let tetrahedra = self.tetrahedra?;
        Some(tetrahedra.iter().flatten().count() as u64)
    }

    /// How many points are inside, on the surface and outside.
    fn counts(&self) -> Option<[u64; 3]> {
        let count = |places: &[i8], which| places.iter().filter(|&&at| at == which).count() as u64;
        self.places
            .map(|places| [1, 0, -1].map(|which| count(places, which)))
    }

    /// The first of the nearest points and the first of the farthest.
    fn extremes(&self) -> Option<[(usize, ClosestElement); 2]> {
        let first = self.found().next()?;
        Some(self.found().fold([first; 2], |[near, far], next| {
            let is_nearer = next.1.distance < near.1.distance;
            let is_farther = next.1.distance > far.1.distance;
            [
                if is_nearer { next } else { near },
                if is_farther { next } else { far },
            ]
        }))
    }

    fn write_rows(&self, file: &RowsFile) -> Result<(), Error> {
        let mut columns = vec![
            Column::new("point", Holds::U32),
            Column::new("element", Holds::U32),
            Column::new("feature", Holds::Text(2)),
            Column::new("distance", Holds::F64),
            Column::new("nearest", Holds::Point(["x", "y", "z"])),
        ];
        if self.places.is_some() {
            columns.push(Column::new("place", Holds::Text(7)));
        }
        if self.tetrahedra.is_some() {
            columns.push(Column::new("tetrahedron", Holds::Count));
        }
        let row = |(point, found): (usize, ClosestElement)| {
            let is_outside = self.places.is_some_and(|places| places[point] < 0);
            let distance = match is_outside {
                true => -found.distance,
                false => found.distance,
            };
            let mut cells = vec![
                rows::number(point),
                Cell::Number(found.element.element),
                Cell::Text(rows::feature_name(found.feature)),
                Cell::Float(distance),
                Cell::Point(found.point),
            ];
            cells.extend(self.places.map(|places| Cell::Text(word(places[point]))));
            cells.extend(
                self.tetrahedra
                    .map(|of| Cell::Count(of[point].map_or(-1, i64::from))),
            );
            cells
        };
        let n = self.all_found().count();
        rows::write(file, columns, n, self.all_found().map(row))
    }

    fn report(&self) -> Result<report::Probe, Error> {
        let at = |(point, found): (usize, ClosestElement)| report::NearestPoint {
            point,
            element: found.element.element,
            distance: found.distance,
            nearest: found.point,
        };
        let both = self.extremes().map(|both| both.map(at).into());
        let (nearest, farthest) = both.unzip();
        Ok(report::Probe {
            asked: report::AskedOfPoints {
                signed: self.args.signed,
                locate: self.args.locate,
                nearest: self.args.nearest.get(),
                most: self.args.most,
            },
            points: self.closest.len(),
            near: self.found().count(),
            found: self.all_found().count(),
            places: self.counts().map(|[inside, on, outside]| report::Places {
                inside,
                on,
                outside,
            }),
            located: self.n_located(),
            nearest,
            farthest,
            hash: hex(self.closest.hash()),
            bodies: [self.mesh.report()?],
            how: report::How::new(self.closest.stats(), report::Total::new(self.ms)),
        })
    }

    /// The answer in the first line, then where points lie.
    fn print(&self, to: &mut impl Write) -> Result<(), Error> {
        let subject = printable(&self.mesh.name);
        let points = counted(self.closest.len() as u64, "point");
        let within = match self.args.most {
            None => points.clone(),
            Some(most) => {
                let near = self.found().count() as u64;
                format!("{} of {points} within {}", grouped(near), exactly(most))
            }
        };
        let hash = hex(self.closest.hash());
        writeln!(to, "{subject}: {within}, hash {hash}")?;
        if let Some(both) = self.extremes() {
            for (name, (point, found)) in ["nearest", "farthest"].into_iter().zip(both) {
                let [x, y, z] = found.point.map(exactly);
                let distance = exactly(found.distance);
                let element = found.element.element;
                writeln!(
                    to,
                    "{name}: point {point}, distance {distance}, to element {element} at {x} {y} {z}"
                )?;
            }
        }
        if let Some(counts) = self.counts() {
            let [inside, on, outside] = counts.map(grouped);
            writeln!(
                to,
                "{inside} inside, {on} on the surface, {outside} outside"
            )?;
        }
        if let Some(n_located) = self.n_located() {
            let n_outside = self.closest.len() as u64 - n_located;
            let [located, outside] = [n_located, n_outside].map(grouped);
            writeln!(to, "{located} in a tetrahedron, {outside} in none")?;
        }
        writeln!(to, "{}", how_alone(self.closest.stats(), self.ms))?;
        let not_asked = match self.args.signed {
            true => "",
            false => "; not asked: inside or outside (--signed)",
        };
        let file = printable(&self.args.points);
        let welded = self.mesh.welded();
        writeln!(to, "{points} of {file} and 1 mesh, {welded}{not_asked}")?;
        Ok(())
    }
}
