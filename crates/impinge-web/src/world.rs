//! A scene whose bodies are numbered 0, 1, 2 … in the order in which they were added, and its detector.

use impinge::{
    Advance, BodyId, Detector, Method, Pairs, Query, Real, Scene, Settings, SharedVertex,
    Statistics, Weld,
};

use crate::error::Error;
use crate::step::{FlatImpacts, StepOptions};

/// Which bodies a question is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Pairs between two bodies.
    Between(u32, u32),
    /// Self-collision of one body.
    Within(u32),
    /// Pairs of different bodies.
    Different,
    /// Pairs of different bodies and self-collision of each.
    Everything,
}

impl Asked {
    /// No body: everything, or without `with_self` the pairs of different bodies. One: within it. Two: between them.
    ///
    /// # Errors
    /// More than two bodies.
    pub fn of(bodies: &[u32], with_self: bool) -> Result<Self, Error> {
        match *bodies {
            [] if with_self => Ok(Asked::Everything),
            [] => Ok(Asked::Different),
            [body] => Ok(Asked::Within(body)),
            [a, b] => Ok(Asked::Between(a, b)),
            _ => Err(Error::Bodies {
                given: bodies.len(),
            }),
        }
    }
}

/// Bodies by number, and a detector.
pub struct World {
    scene: Scene,
    detector: Detector,
    bodies: Bodies,
    shared_vertex: SharedVertex,
}

impl World {
    /// An empty world with this detector. `shared_vertex` is the rule for pairs of one body that share a vertex:
    /// `"skip"` or `"resolve"`.
    ///
    /// # Errors
    /// Another word.
    pub fn new(detector: Detector, shared_vertex: &str) -> Result<Self, Error> {
        let shared_vertex = match shared_vertex {
            "skip" => SharedVertex::Skip,
            "resolve" => SharedVertex::Resolve,
            given => {
                return Err(Error::Word {
                    what: "sharedVertex",
                    given: given.to_owned(),
                    allowed: "\"skip\" or \"resolve\"",
                });
            }
        };
        Ok(World {
            scene: Scene::new(),
            detector,
            bodies: Bodies::default(),
            shared_vertex,
        })
    }

    /// Settings with this method: `"auto"`, `"clusters"`, `"cells"` or `"naive"`.
    ///
    /// # Errors
    /// Another word.
    pub fn settings(method: &str) -> Result<Settings, Error> {
        match Method::ALL.into_iter().find(|known| known.name() == method) {
            Some(method) => Ok(Settings {
                method,
                ..Settings::default()
            }),
            None => Err(Error::Word {
                what: "method",
                given: method.to_owned(),
                allowed: "\"auto\", \"clusters\", \"cells\" or \"naive\"",
            }),
        }
    }

    /// Adds a body and returns its number. `index` holds `corners` (3: triangles, 4: tetrahedra) vertex numbers
    /// per primitive, `positions` x, y, z per vertex.
    ///
    /// # Errors
    /// Arrays that are not whole rows; those of [`Scene::add_triangles`].
    pub fn add<R: Real>(
        &mut self,
        index: &[u32],
        positions: &[R],
        corners: usize,
    ) -> Result<u32, Error> {
        let number = self.bodies.next_number()?;
        let positions = rows(positions, "positions")?;
        let added = match corners {
            4 => {
                let tetrahedra = rows::<_, 4>(index, "index")?;
                self.scene.add_tetrahedra(tetrahedra, positions)
            }
            _ => {
                let triangles = rows::<_, 3>(index, "index")?;
                self.scene.add_triangles(triangles, positions)
            }
        };
        // The library may give the new body the slot of a removed one.
        let id = match added {
            Err(error) if self.bodies.n_removed() > 0 => {
                return Err(Error::Renumbered { number, error });
            }
            added => added?,
        };
        self.bodies.0.push(Some(id));
        Ok(number)
    }

    /// Moves the vertices of a body: as many positions as it has vertices, in either precision. It stands still until
    /// it gets end positions.
    ///
    /// # Errors
    /// No such body; an array that is not whole rows; those of [`Scene::set_positions`].
    pub fn set_positions<R: Real>(&mut self, body: u32, positions: &[R]) -> Result<(), Error> {
        let id = self.bodies.id(body)?;
        let set = self.scene.set_positions(id, rows(positions, "positions")?);
        set.map_err(|error| renumbered(body, id, error))
    }

    /// Sets where the vertices of a body are at the end of a step.
    ///
    /// # Errors
    /// No such body; an array that is not whole rows; those of [`Scene::set_end_positions`].
    pub fn set_end_positions<R: Real>(&mut self, body: u32, positions: &[R]) -> Result<(), Error> {
        let id = self.bodies.id(body)?;
        let positions = rows(positions, "end positions")?;
        let set = self.scene.set_end_positions(id, positions);
        set.map_err(|error| renumbered(body, id, error))
    }

    /// Removes a body. Its number is not used again.
    ///
    /// # Errors
    /// No such body.
    pub fn remove(&mut self, body: u32) -> Result<(), Error> {
        let id = self.bodies.id(body)?;
        self.scene.remove(id)?;
        self.bodies.0[body as usize] = None;
        Ok(())
    }

    /// The numbers of primitives and of vertices of a body.
    ///
    /// # Errors
    /// No such body.
    pub fn size(&self, body: u32) -> Result<(usize, usize), Error> {
        let body = self.scene.body(self.bodies.id(body)?)?;
        Ok((body.n_primitives(), body.n_vertices()))
    }

    /// All pairs, sorted, as flat numbers. Two per pair: the primitives of the bodies asked for. For
    /// [`Asked::Everything`] and [`Asked::Different`] four: a body before each primitive.
    ///
    /// # Errors
    /// No such body; those of [`Detector::detect`].
    pub fn detect(&mut self, asked: Asked) -> Result<(Vec<u32>, &Pairs), Error> {
        let query = self.query(asked)?;
        let pairs = self.detector.detect(&self.scene, &query)?;
        Ok((flat(&self.bodies, asked, pairs)?, pairs))
    }

    /// [`detect`](World::detect) without blocking.
    ///
    /// # Errors
    /// As `detect`.
    #[cfg(feature = "gpu")]
    pub async fn detect_async(&mut self, asked: Asked) -> Result<(Vec<u32>, &Pairs), Error> {
        let query = self.query(asked)?;
        let pairs = self.detector.detect_async(&self.scene, &query).await?;
        Ok((flat(&self.bodies, asked, pairs)?, pairs))
    }

    /// All impacts of a step, and their hash.
    ///
    /// # Errors
    /// No such body; those of [`Detector::impacts`].
    pub fn impacts(
        &mut self,
        asked: Asked,
        options: StepOptions,
    ) -> Result<(FlatImpacts, u64), Error> {
        let step = options.step(self.query(asked)?);
        let impacts = self.detector.impacts(&self.scene, &step)?;
        let flat = FlatImpacts::new(impacts, self.bodies.numbers());
        Ok((flat, impacts.hash()))
    }

    /// The earliest impact of a step: one, or none if the step is free.
    ///
    /// # Errors
    /// As [`impacts`](World::impacts).
    pub fn earliest(&mut self, asked: Asked, options: StepOptions) -> Result<FlatImpacts, Error> {
        let step = options.step(self.query(asked)?);
        let earliest = self.detector.earliest(&self.scene, &step)?;
        Ok(FlatImpacts::new(&earliest, self.bodies.numbers()))
    }

    /// Whether nothing touches during a step.
    ///
    /// # Errors
    /// As [`impacts`](World::impacts).
    pub fn is_free(&mut self, asked: Asked, options: StepOptions) -> Result<bool, Error> {
        let step = options.step(self.query(asked)?);
        Ok(self.detector.is_free(&self.scene, &step)?)
    }

    /// How far a step can be taken; its first contact, if any, as one row; and the number of each body that moves, in the order of
    /// the positions.
    ///
    /// # Errors
    /// As [`impacts`](World::impacts), and those of [`Detector::advance`].
    pub fn advance(
        &mut self,
        asked: Asked,
        options: StepOptions,
    ) -> Result<(Advance, FlatImpacts, Vec<u32>), Error> {
        let step = options.step(self.query(asked)?);
        let advance = self.detector.advance(&self.scene, &step)?;
        let number = self.bodies.numbers();
        let first = FlatImpacts::new(&advance.first, &number);
        let moving = advance.positions.iter();
        let moving = moving
            .map(|(body, _)| number(body.index() as u32))
            .collect();
        Ok((advance, first, moving))
    }

    /// Whether elements intersect at the start of the step that was asked about last; `None` if that was not asked.
    pub fn start_intersects(&self) -> Option<bool> {
        self.detector.start_intersects()
    }

    /// Statistics of the last answer about a step.
    pub fn step_stats(&self) -> &Statistics {
        self.detector.step_stats()
    }

    fn query(&self, asked: Asked) -> Result<Query, Error> {
        let id = |number| self.bodies.id(number);
        let query = match asked {
            Asked::Between(a, b) => Query::between(id(a)?, id(b)?),
            Asked::Within(body) => Query::within(id(body)?),
            Asked::Different => Query::all(),
            Asked::Everything => Query::everything(),
        };
        Ok(query.shared_vertex(self.shared_vertex))
    }
}

/// Ids by number; `None` once removed. Numbers are not used again.
#[derive(Default)]
struct Bodies(Vec<Option<BodyId>>);

impl Bodies {
    fn next_number(&self) -> Result<u32, Error> {
        let n = self.0.len();
        u32::try_from(n).map_err(|_| {
            Error::Library(impinge::Error::TooMany {
                what: "bodies",
                given: n as u64 + 1,
                limit: u64::from(u32::MAX),
            })
        })
    }

    fn n_removed(&self) -> usize {
        self.0.iter().filter(|body| body.is_none()).count()
    }

    fn id(&self, number: u32) -> Result<BodyId, Error> {
        let held = self.0.get(number as usize).copied().flatten();
        held.ok_or_else(|| Error::NoBody {
            number,
            added: self.0.len(),
            removed: self.n_removed(),
        })
    }

    /// Maps the library's body indices to numbers. They differ once a body was added after a removal.
    fn numbers(&self) -> impl Fn(u32) -> u32 + use<> {
        let mut numbers = Vec::new();
        for (number, id) in (0u32..).zip(&self.0) {
            if let Some(id) = id {
                numbers.resize(numbers.len().max(id.index() + 1), 0);
                numbers[id.index()] = number;
            }
        }
        move |slot| numbers.get(slot as usize).copied().unwrap_or(slot)
    }
}

/// Welds vertices at the same position: for each vertex of `positions` (x, y, z per vertex), its number after the welding.
///
/// # Errors
/// An array that is not whole rows.
pub fn welded<R: Real>(positions: &[R]) -> Result<Vec<u32>, Error> {
    let weld = Weld::by_position(rows(positions, "positions")?);
    Ok(weld.map().to_vec())
}

fn flat(bodies: &Bodies, asked: Asked, pairs: &Pairs) -> Result<Vec<u32>, Error> {
    let two = |(a, b): (u32, u32)| [a, b];
    Ok(match asked {
        Asked::Between(a, b) => {
            let pairs = pairs.between(bodies.id(a)?, bodies.id(b)?);
            pairs.flat_map(two).collect()
        }
        Asked::Within(body) => {
            let pairs = pairs.within(bodies.id(body)?);
            pairs.flat_map(two).collect()
        }
        Asked::Everything | Asked::Different => {
            let number = bodies.numbers();
            let rows = pairs.rows();
            rows.flat_map(|[body_a, a, body_b, b]| [number(body_a), a, number(body_b), b])
                .collect()
        }
    })
}

fn renumbered(number: u32, id: BodyId, error: impinge::Error) -> Error {
    if id.index() == number as usize {
        return Error::Library(error);
    }
    Error::Renumbered { number, error }
}

fn rows<'a, T, const N: usize>(flat: &'a [T], what: &'static str) -> Result<&'a [[T; N]], Error> {
    match flat.as_chunks() {
        (rows, []) => Ok(rows),
        _ => Err(Error::Ragged {
            what,
            len: flat.len(),
            row: N,
        }),
    }
}
