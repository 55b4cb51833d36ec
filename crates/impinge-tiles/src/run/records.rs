//! The elements of a tile as records, and scenes made of some of them.

use std::ops::Range;

use impinge::{Elements, Positions, Scene};

use super::ranges::within;
use super::surfaces::{Surface, Surfaces};
use crate::cells::owner_point;
use crate::chunk::{Record, Shape};
use crate::parts::Segment;

/// All records of a tile, file by file, elements ascending. They are numbered from 0.
#[derive(Default)]
pub struct Records {
    files: Vec<OfFile>,
}

struct OfFile {
    file: usize,
    shape: Shape,
    /// The number of the file's first record.
    first: usize,
    bytes: Vec<u8>,
}

impl OfFile {
    fn len(&self) -> usize {
        self.bytes.len() / self.shape.stride()
    }

    fn record(&self, ix: usize) -> Record<'_> {
        let stride = self.shape.stride();
        Record::new(self.shape, &self.bytes[ix * stride..][..stride])
    }
}

/// A scene of some records, and the numbers of these records.
pub struct Part {
    pub scene: Scene,
    /// Per body: the numbers of its records, in consecutive runs.
    bodies: Vec<Vec<Range<usize>>>,
}

impl Part {
    /// The number of the record of an element of the scene.
    pub fn record(&self, body: u32, element: u32) -> usize {
        let mut left = element as usize;
        for run in &self.bodies[body as usize] {
            if left < run.len() {
                return run.start + left;
            }
            left -= run.len();
        }
        unreachable!("the detector reports elements of the scene")
    }
}

impl Records {
    /// Appends the next segment; segments come in the order of files and elements.
    pub fn add(&mut self, segment: Segment) {
        if segment.bytes.is_empty() {
            return;
        }
        let first = self.len();
        match self.files.last_mut() {
            Some(held) if held.file == segment.file => held.bytes.extend(segment.bytes),
            _ => self.files.push(OfFile {
                file: segment.file,
                shape: segment.shape,
                first,
                bytes: segment.bytes,
            }),
        }
    }

    pub fn len(&self) -> usize {
        self.files.last().map_or(0, |held| held.first + held.len())
    }

    fn find(&self, record: usize) -> (&OfFile, usize) {
        let ix = self.files.partition_point(|held| held.first <= record) - 1;
        (&self.files[ix], record - self.files[ix].first)
    }

    /// The point that decides to which tile a pair belongs.
    pub fn owner_point(&self, a: usize, b: usize) -> [f64; 3] {
        let lower = |record: usize| {
            let (held, ix) = self.find(record);
            held.record(ix).bounds().0
        };
        owner_point(&lower(a), &lower(b))
    }

    /// The pair as a row: file, element, file, element.
    pub fn row(&self, a: usize, b: usize) -> [u32; 4] {
        let named = |record: usize| {
            let (held, ix) = self.find(record);
            (held.file as u32, held.record(ix).element())
        };
        let (a, b) = (named(a), named(b));
        [a.0, a.1, b.0, b.1]
    }

    /// The surfaces of the files that have any record, for a step.
    ///
    /// # Errors
    /// As adding these elements to a scene.
    pub fn surfaces(&self) -> Result<Surfaces, impinge::Error> {
        let surfaces = self.files.iter().map(|held| {
            let Shape { corners, width, .. } = held.shape;
            let records = || (0..held.len()).map(|ix| held.record(ix));
            let points =
                || records().flat_map(move |record| (0..corners).map(move |c| (record, c)));
            let (numbers, firsts) = dense(points().map(|(record, c)| record.vertex(c)));
            let all: Vec<(Record<'_>, usize)> = points().collect();
            let vertices = || firsts.iter().map(|&ix| all[ix as usize]);
            let positions =
                vertices().map(|(record, c)| [record.position(c), record.position(corners + c)]);
            let named = vertices().map(|(record, c)| record.vertex(c));
            let surface = Surface::new(held.file, width, named.collect(), positions.collect());
            let names = records().map(|record| record.element());
            match corners {
                3 => Ok(surface.of_triangles(numbers.as_chunks().0, names)),
                _ => surface.of_tetrahedra(numbers.as_chunks().0, names.collect()),
            }
        });
        Ok(Surfaces(surfaces.collect::<Result<_, _>>()?))
    }

    /// A scene of the records in `ranges` (ascending), with one body per file that has any.
    /// Vertices are numbered densely.
    pub fn scene(&self, ranges: &[Range<usize>], weld: bool) -> Result<Part, impinge::Error> {
        let mut part = Part {
            scene: Scene::new(),
            bodies: Vec::new(),
        };
        for held in &self.files {
            let whole = held.first..held.first + held.len();
            let runs: Vec<Range<usize>> = within(ranges, &whole).collect();
            if runs.is_empty() {
                continue;
            }
            let records = || {
                runs.iter()
                    .flat_map(|run| run.clone().map(|ix| held.record(ix - held.first)))
            };
            let corners = held.shape.corners;
            let points =
                || records().flat_map(move |record| (0..corners).map(move |c| (record, c)));
            let (numbers, firsts) =
                if weld {
                    dense(points().map(|(record, corner)| {
                        record.position(corner).map(|x| (x + 0.0).to_bits())
                    }))
                } else {
                    dense(points().map(|(record, corner)| record.vertex(corner)))
                };
            let all: Vec<[f64; 3]> = points()
                .map(|(record, corner)| record.position(corner))
                .collect();
            let positions = firsts.iter().map(|&ix| all[ix as usize]);
            let positions: Positions = match held.shape.width {
                4 => positions
                    .map(|p| p.map(|x| x as f32))
                    .collect::<Vec<[f32; 3]>>()
                    .into(),
                _ => positions.collect::<Vec<[f64; 3]>>().into(),
            };
            let elements: Elements = match corners {
                3 => numbers.as_chunks::<3>().0.to_vec().into(),
                _ => numbers.as_chunks::<4>().0.to_vec().into(),
            };
            part.scene.add((elements, positions))?;
            part.bodies.push(runs);
        }
        Ok(part)
    }
}

/// Gives equal keys equal numbers, from 0 on. Returns the number of each key, and the first place
/// of each number.
fn dense<K: Ord>(keys: impl Iterator<Item = K>) -> (Vec<u32>, Vec<u32>) {
    let mut sorted: Vec<(K, u32)> = keys.zip(0u32..).collect();
    sorted.sort_unstable();
    let mut numbers = vec![0; sorted.len()];
    let mut firsts = Vec::new();
    for same in sorted.chunk_by(|a, b| a.0 == b.0) {
        for (_, at) in same {
            numbers[*at as usize] = firsts.len() as u32;
        }
        firsts.push(same[0].1);
    }
    (numbers, firsts)
}
