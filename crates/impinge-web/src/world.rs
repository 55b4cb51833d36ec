//! A scene whose bodies are numbered 0, 1, 2 … in the order in which they were added. Numbers are
//! not used again.

use impinge::{
    Backend, Body, BodyId, BodyKind, Detector, Elements, Exclusion, Filter, Part, Positions, Query,
    Real, Scene, StartOfBody, StepStart, Thickness, Weld,
};

use crate::error::Error;

/// Tells apart the modules of one page, each of which counts its stamps from 1.
pub(crate) const MODULE: u32 = cfg!(feature = "gpu") as u32;

/// What arrays are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Put {
    /// A new body.
    Add,
    /// New elements and positions of a body.
    Remesh,
    /// New positions of a body.
    Positions,
    /// Its positions at the end of a step.
    EndPositions,
}

impl Put {
    /// All of them, by their number in the package.
    pub const ALL: [Put; 4] = [Put::Add, Put::Remesh, Put::Positions, Put::EndPositions];
}

/// A scene, and the numbers of its bodies.
#[derive(Debug, Clone, Default)]
pub struct World {
    pub(crate) scene: Scene,
    /// Ids by number; `None` once removed.
    ids: Vec<Option<BodyId>>,
    /// Pairs that were near when the caller asked, or whose vertices the caller listed, by the
    /// caller's number.
    pairs: Vec<(u32, Exclusion)>,
}

impl World {
    /// An empty scene.
    pub fn new() -> Self {
        World::default()
    }

    /// Gives arrays to a body, whose number is returned. `index` holds `kind.n_corners()` vertex
    /// numbers per element (none for points: each vertex is one), `positions` x, y, z per vertex.
    ///
    /// # Errors
    /// No such body; arrays that are not whole rows; those of [`Scene::add`] and
    /// [`Scene::set_positions`].
    pub fn put<R: Real>(
        &mut self,
        what: Put,
        body: u32,
        kind: BodyKind,
        index: &[u32],
        positions: &[R],
    ) -> Result<u32, Error>
    where
        Vec<[R; 3]>: Into<Positions>,
    {
        let name = match what {
            Put::EndPositions => "end positions",
            _ => "positions",
        };
        let positions = rows(positions, name)?;
        if what == Put::Add {
            let number = self.next_number()?;
            let elements = elements(kind, index, positions.len())?;
            // The library may give the new body the slot of a removed one.
            let id = match self.scene.add((elements, positions.to_vec())) {
                Err(error) if self.n_removed() > 0 => {
                    return Err(Error::Renumbered { number, error });
                }
                added => added?,
            };
            self.ids.push(Some(id));
            return Ok(number);
        }
        let id = self.id(body)?;
        let set = match what {
            Put::Remesh => {
                let elements = elements(kind, index, positions.len())?;
                self.scene.remesh(id, (elements, positions.to_vec()))
            }
            Put::EndPositions => self.scene.set_end_positions(id, positions),
            _ => self.scene.set_positions(id, positions),
        };
        self.renumbered(body, set)?;
        Ok(body)
    }

    /// Says of which body an error is in the caller's numbers.
    #[inline(never)]
    fn renumbered(&self, body: u32, set: Result<(), impinge::Error>) -> Result<(), Error> {
        match set {
            Ok(()) => Ok(()),
            Err(error) if self.id(body)?.index() == body as usize => Err(Error::Library(error)),
            Err(error) => Err(Error::Renumbered {
                number: body,
                error,
            }),
        }
    }

    /// Lets a body stand still.
    ///
    /// # Errors
    /// No such body.
    pub fn clear_end_positions(&mut self, body: u32) -> Result<(), Error> {
        Ok(self.scene.clear_end_positions(self.id(body)?)?)
    }

    /// Moves the rest positions of a body by a matrix, column by column.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_transform`].
    pub fn set_transform(&mut self, body: u32, columns: &[f64; 16]) -> Result<(), Error> {
        let set = self.scene.set_transform(self.id(body)?, &by_rows(columns));
        self.renumbered(body, set)
    }

    /// Moves the rest positions of a body by a matrix, column by column, to the end of a step.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_end_transform`].
    pub fn set_end_transform(&mut self, body: u32, columns: &[f64; 16]) -> Result<(), Error> {
        let set = (self.scene).set_end_transform(self.id(body)?, &by_rows(columns));
        self.renumbered(body, set)
    }

    /// Sets which bodies a body meets.
    ///
    /// # Errors
    /// No such body.
    pub fn set_filter(&mut self, body: u32, category: u64, mask: u64) -> Result<(), Error> {
        let filter = Filter { category, mask };
        Ok(self.scene.set_filter(self.id(body)?, filter)?)
    }

    /// Sets how thick a body is.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_thickness`].
    pub fn set_thickness(&mut self, body: u32, thickness: f64) -> Result<(), Error> {
        let set = self.scene.set_thickness(self.id(body)?, thickness);
        self.renumbered(body, set)
    }

    /// Numbers the edges of a body as the caller does; no rows: as the library does.
    ///
    /// # Errors
    /// No such body; an odd number of vertices; those of [`Scene::set_edges`].
    pub fn set_edges(&mut self, body: u32, edges: &[u32]) -> Result<(), Error> {
        let set = (self.scene).set_edges(self.id(body)?, rows(edges, "edges")?);
        self.renumbered(body, set)
    }

    /// Puts each vertex of a body into a group.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_groups`].
    pub fn set_groups(&mut self, body: u32, groups: &[u32]) -> Result<(), Error> {
        let set = self.scene.set_groups(self.id(body)?, groups);
        self.renumbered(body, set)
    }

    /// Says which vertices of a body never move: those whose byte is not 0.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_pinned`].
    pub fn set_pinned(&mut self, body: u32, pinned: &[u8]) -> Result<(), Error> {
        let pinned: Vec<bool> = pinned.iter().map(|&byte| byte != 0).collect();
        let set = self.scene.set_pinned(self.id(body)?, &pinned);
        self.renumbered(body, set)
    }

    /// Keeps the pairs that are within a distance now, by positions and thickness alone, under a
    /// number, until they are [forgotten](Self::forget_pairs). Returns how many there are.
    ///
    /// # Errors
    /// Those of [`Detector::near`].
    pub fn keep_at_rest(&mut self, number: u32, distance: f64) -> Result<u32, Error> {
        let mut detector = Detector::new(Backend::Cpu)?;
        let near = detector.near(&self.scene.at_rest(), distance, &Query::all())?;
        self.pairs.push((number, Exclusion::from(&near)));
        // A module of 32 bits holds no more.
        Ok(near.len() as u32)
    }

    /// Keeps [listed pairs of vertices](Exclusion::vertices) of two bodies, or of one, under a
    /// number.
    ///
    /// # Errors
    /// No such body. Whether lists fit is checked when something is asked.
    pub fn keep_vertex_pairs(
        &mut self,
        number: u32,
        bodies: [u32; 2],
        offsets: &[u32],
        vertices: &[u32],
    ) -> Result<(), Error> {
        let [a, b] = [self.id(bodies[0])?, self.id(bodies[1])?];
        let offsets: Vec<u64> = offsets.iter().map(|&offset| offset.into()).collect();
        let pairs = Exclusion::vertices(a, b, offsets, vertices);
        self.pairs.push((number, pairs));
        Ok(())
    }

    /// Forgets the pairs of a number, if they are kept.
    pub fn forget_pairs(&mut self, number: u32) {
        self.pairs.retain(|(of, _)| *of != number);
    }

    /// Pairs by their number.
    pub(crate) fn pairs_of(&self, number: u32) -> Result<Exclusion, Error> {
        let held = self.pairs.iter().find(|(of, _)| *of == number);
        held.map(|(_, pairs)| pairs.clone())
            .ok_or(Error::PairsOfAnotherScene)
    }

    /// Sets how thick each vertex (0), edge (1) or face (2) of a body is.
    ///
    /// # Errors
    /// No such body; those of [`Scene::set_thickness`].
    pub fn set_element_thickness(
        &mut self,
        body: u32,
        part: u32,
        thickness: &[f64],
    ) -> Result<(), Error> {
        let thickness = match part {
            0 => Thickness::vertices(thickness),
            1 => Thickness::edges(thickness),
            _ => Thickness::faces(thickness),
        };
        let set = self.scene.set_thickness(self.id(body)?, thickness);
        self.renumbered(body, set)
    }

    /// Takes a step: gives bodies the positions that an answer says, if all bodies are where they
    /// were when it was found. `start`: the module; for each body of then its number, two words of
    /// a stamp, and whether it keeps its rest positions.
    ///
    /// # Errors
    /// A body that was moved since, or is new; one that moves and was removed.
    pub fn take_step(
        &mut self,
        start: &[u32],
        bodies: &[u32],
        positions: Vec<Positions>,
    ) -> Result<(), Error> {
        let start = match start.split_first() {
            Some((&MODULE, start)) => start,
            _ => return Err(Error::StepOfAnotherModule),
        };
        let held = start
            .as_chunks()
            .0
            .iter()
            .filter_map(|&[body, low, high, keeps_rest]| {
                Some(StartOfBody {
                    // What was removed is nowhere.
                    body: self.id(body).ok()?,
                    stamp: u64::from(high) << 32 | u64::from(low),
                    keeps_rest: keeps_rest != 0,
                })
            });
        let start: StepStart = held.collect();
        let moving = bodies.iter().map(|&body| self.id(body)).zip(positions);
        let moving = moving.map(|(id, positions)| Ok((id?, positions)));
        let moving = moving.collect::<Result<Vec<_>, Error>>()?;
        let taken = start.take_step(&mut self.scene, &moving);
        match &taken {
            Err(impinge::Error::Moved { body } | impinge::Error::Added { body }) => {
                let number = self.numbers()(body.index() as u32);
                self.renumbered(number, taken)
            }
            _ => Ok(taken?),
        }
    }

    /// Removes a body. Its number is not used again.
    ///
    /// # Errors
    /// No such body.
    pub fn remove(&mut self, body: u32) -> Result<(), Error> {
        let id = self.id(body)?;
        self.scene.remove(id)?;
        self.ids[body as usize] = None;
        Ok(())
    }

    /// A body.
    ///
    /// # Errors
    /// No such body.
    pub fn body(&self, body: u32) -> Result<&Body, Error> {
        Ok(self.scene.body(self.id(body)?)?)
    }

    /// The vertex numbers of the elements of a part, one element after the other.
    ///
    /// # Errors
    /// No such body.
    pub fn index(&self, body: u32, part: Part) -> Result<Vec<u32>, Error> {
        Ok(match self.body(body)?.part(part) {
            Elements::Points(of) => of.as_flattened().to_vec(),
            Elements::Edges(of) => of.as_flattened().to_vec(),
            Elements::Triangles(of) => of.as_flattened().to_vec(),
            Elements::Tetrahedra(of) => of.as_flattened().to_vec(),
        })
    }

    /// The numbers of all bodies.
    pub fn bodies(&self) -> Vec<u32> {
        let held = (0u32..).zip(&self.ids).filter(|(_, id)| id.is_some());
        held.map(|(number, _)| number).collect()
    }

    fn next_number(&self) -> Result<u32, Error> {
        let n = self.ids.len();
        u32::try_from(n).map_err(|_| {
            Error::Library(impinge::Error::TooMany {
                what: "bodies",
                given: n as u64 + 1,
                limit: u64::from(u32::MAX),
            })
        })
    }

    fn n_removed(&self) -> usize {
        self.ids.iter().filter(|body| body.is_none()).count()
    }

    /// The library's id of a body.
    pub(crate) fn id(&self, number: u32) -> Result<BodyId, Error> {
        let held = self.ids.get(number as usize).copied().flatten();
        held.ok_or_else(|| Error::NoBody {
            number,
            added: self.ids.len(),
            removed: self.n_removed(),
        })
    }

    /// Maps the library's indices of bodies to numbers. They differ once a body was added after a
    /// removal.
    pub(crate) fn numbers(&self) -> impl Fn(u32) -> u32 + use<> {
        let mut numbers = Vec::new();
        for (number, id) in (0u32..).zip(&self.ids) {
            if let Some(id) = id {
                numbers.resize(numbers.len().max(id.index() + 1), 0);
                numbers[id.index()] = number;
            }
        }
        move |slot| numbers.get(slot as usize).copied().unwrap_or(slot)
    }
}

/// Welds vertices at the same position: for each vertex of `positions` (x, y, z per vertex), its
/// number after the welding.
///
/// # Errors
/// An array that is not whole rows.
pub fn welded<R: Real>(positions: &[R]) -> Result<Vec<u32>, Error> {
    let weld = Weld::by_position(rows(positions, "positions")?);
    Ok(weld.map().to_vec())
}

fn by_rows(columns: &[f64; 16]) -> [[f64; 4]; 4] {
    let row = |row: usize| [0, 4, 8, 12].map(|column| columns[row + column]);
    [0, 1, 2, 3].map(row)
}

fn elements(kind: BodyKind, index: &[u32], n_vertices: usize) -> Result<Elements, Error> {
    const WHAT: &str = "index";
    Ok(match kind {
        BodyKind::Points => {
            let each = (0u32..).zip(0..n_vertices);
            Elements::Points(each.map(|(vertex, _)| [vertex]).collect())
        }
        BodyKind::Edges => Elements::Edges(rows(index, WHAT)?.to_vec()),
        BodyKind::Triangles => Elements::Triangles(rows(index, WHAT)?.to_vec()),
        BodyKind::Tetrahedra => Elements::Tetrahedra(rows(index, WHAT)?.to_vec()),
    })
}

pub(crate) fn rows<'a, T, const N: usize>(
    flat: &'a [T],
    what: &'static str,
) -> Result<&'a [[T; N]], Error> {
    match flat.as_chunks() {
        (rows, []) => Ok(rows),
        _ => Err(Error::Ragged {
            what,
            len: flat.len(),
            row: N,
        }),
    }
}
