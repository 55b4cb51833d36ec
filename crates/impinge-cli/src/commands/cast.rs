//! `impinge cast`: what rays hit of a mesh.

use std::io::Write;

use impinge::{CancelToken, Hit, Hits, Query, RayHit};
use impinge_io::{Cell, Column, Holds, ReadOptions, printable, read_rows};

use crate::apart::Inputs;
use crate::args::CastArgs;
use crate::detection::hit;
use crate::error::Error;
use crate::one_mesh::{OneMesh, rows_of_stdin};
use crate::output::{how_alone, say};
use crate::text::{counted, exactly, grouped, hex};
use crate::values::RowsFile;
use crate::watch::go_on;
use crate::{report, rows};

/// `impinge cast`.
pub fn cast(args: &CastArgs, cancel: &CancelToken) -> Result<(), Error> {
    let inputs = Inputs::new([&args.mesh, &args.rays]);
    let rows_file = args.rows.file(&inputs, args.how.json)?;
    let of_stdin = rows_of_stdin("--rays -", &args.rays, &args.mesh)?;
    let mesh = OneMesh::read(&args.mesh, &args.how, cancel)?;
    go_on(cancel)?;
    let rays: Vec<[f64; 6]> = match of_stdin {
        Some(rays) => rays,
        None => read_rows(&args.rays, &ReadOptions::as_they_are())?,
    };
    let (origins, directions): (Vec<_>, Vec<_>) = rays
        .iter()
        .map(|&[x, y, z, dx, dy, dz]| ([x, y, z], [dx, dy, dz]))
        .unzip();
    drop(rays);
    let mut detector = mesh.detector(&args.how, cancel)?;
    let query = Query::all().hits(args.hits);
    let most = args.most.unwrap_or(f64::INFINITY);
    let hits = detector.cast(mesh.scene(), &origins, &directions, most, &query)?;
    let answer = Answer {
        args,
        mesh: &mesh,
        hits: &hits,
    };
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        answer.write_rows(file)?;
    }
    if args.how.json {
        report::print(&answer.report()?)?;
    } else {
        let mut text = Vec::new();
        answer.print(&mut text)?;
        say(&text, rows_file.as_ref())?;
    }
    hit(args.fail_on_hit, answer.n_hit() > 0)
}

struct Answer<'a> {
    args: &'a CastArgs,
    mesh: &'a OneMesh,
    hits: &'a Hits,
}

impl Answer<'_> {
    /// How many rays hit anything.
    fn n_hit(&self) -> u64 {
        self.hits.is_hit().iter().filter(|&&is_hit| is_hit).count() as u64
    }

    /// The hits with the numbers of their rays.
    fn found(&self) -> impl Iterator<Item = (usize, &RayHit)> {
        (0..self.hits.len()).flat_map(|ray| self.hits.of(ray).iter().map(move |hit| (ray, hit)))
    }

    /// The first of the hits with the smallest t.
    fn nearest(&self) -> Option<(usize, &RayHit)> {
        self.found()
            .reduce(|best, next| if next.1.t < best.1.t { next } else { best })
    }

    fn write_rows(&self, file: &RowsFile) -> Result<(), Error> {
        let ray = Column::new("ray", Holds::U32);
        if self.args.hits == Hit::Any {
            let columns = vec![ray, Column::new("hit", Holds::Bool)];
            let of_rays = self.hits.is_hit().iter().enumerate();
            let of_rays = of_rays.map(|(ray, &is_hit)| [rows::number(ray), Cell::Bool(is_hit)]);
            return rows::write(file, columns, self.hits.len(), of_rays);
        }
        let columns = vec![
            ray,
            Column::new("element", Holds::U32),
            Column::new("feature", Holds::Text(2)),
            Column::new("t", Holds::F64),
            Column::new("t_end", Holds::F64),
            Column::new("barycentrics", Holds::Point(["b0", "b1", "b2"])),
        ];
        let found = self.found().map(|(ray, hit)| {
            [
                rows::number(ray),
                Cell::Number(hit.element.element),
                Cell::Text(rows::feature_name(hit.feature)),
                Cell::Float(hit.t),
                Cell::Float(hit.t_end),
                Cell::Point(hit.barycentrics),
            ]
        });
        rows::write(file, columns, self.hits.iter().len(), found)
    }

    fn report(&self) -> Result<report::Cast, Error> {
        let nearest = self.nearest().map(|(ray, hit)| report::NearestHit {
            ray,
            element: hit.element.element,
            t: hit.t,
        });
        let stats = self.hits.stats();
        Ok(report::Cast {
            asked: report::AskedOfRays {
                hits: self.args.hits.name(),
                most: self.args.most,
            },
            rays: self.hits.len(),
            hit: self.n_hit(),
            hits: (self.args.hits != Hit::Any).then(|| self.hits.iter().len()),
            nearest,
            hash: hex(self.hits.hash()),
            bodies: [self.mesh.report()?],
            how: report::How::new(stats, report::Total::new(stats.total_ms)),
        })
    }

    /// The answer in the first line, then the nearest hit.
    fn print(&self, to: &mut impl Write) -> Result<(), Error> {
        let subject = printable(&self.mesh.name);
        let rays = counted(self.hits.len() as u64, "ray");
        let all = match self.args.hits {
            Hit::All => format!(" ({})", counted(self.hits.iter().len() as u64, "hit")),
            _ => String::new(),
        };
        let (n_hit, hash) = (grouped(self.n_hit()), hex(self.hits.hash()));
        writeln!(to, "{subject}: {n_hit} of {rays} hit it{all}, hash {hash}")?;
        if let Some((ray, hit)) = self.nearest() {
            let (element, t) = (hit.element.element, exactly(hit.t));
            writeln!(to, "nearest: ray {ray} hits element {element} at t {t}")?;
        }
        let stats = self.hits.stats();
        writeln!(to, "{}", how_alone(stats, stats.total_ms))?;
        let not_asked = match self.args.hits {
            Hit::First => "; not asked: what rays hit after that (--hits all)",
            Hit::Any => "; not asked: what they hit (--hits first)",
            _ => "",
        };
        let (file, welded) = (printable(&self.args.rays), self.mesh.welded());
        writeln!(to, "{rays} of {file} and 1 mesh, {welded}{not_asked}")?;
        Ok(())
    }
}
