//! Answers as flat lists. `shared.js` of the package gives them their shapes.

use std::ops::ControlFlow;

use impinge::contact::{Contacts, Curves, Penetration, Region, Shape};
use impinge::exact::Feature;
use impinge::proximity::Nearest;
use impinge::{
    BodyId, Candidates, Impact, NearPairs, PairKind, Pairs, Positions, Query, StepStart,
};

use crate::ask::{Asker, Question, query};
use crate::error::Error;
use crate::world::{MODULE, World};

/// The lists of an answer. What they hold depends on the question; those with sections have the
/// length of each before it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Answer {
    /// The hash of the answer, if it has one.
    pub hash: u64,
    /// Rows `[body_a, element_a, body_b, element_b]`, bodies by the caller's numbers.
    pub rows: Vec<u32>,
    /// A byte per row and column: kinds and the like.
    pub bytes: Vec<u8>,
    /// Numbers: times, distances, coordinates.
    pub numbers: Vec<f64>,
    /// Indices, in sections.
    pub words: Vec<u32>,
    /// Positions of bodies.
    pub positions: Vec<Positions>,
}

impl Answer {
    pub(crate) fn of(number: f64) -> Self {
        Answer {
            numbers: vec![number],
            ..Answer::default()
        }
    }

    /// `renumber`: from the library's numbers of bodies to the caller's.
    fn add_rows(&mut self, rows: impl Iterator<Item = [u32; 4]>, renumber: impl Fn(u32) -> u32) {
        let row = |[a, i, b, j]: [u32; 4]| [renumber(a), i, renumber(b), j];
        self.rows.extend(rows.flat_map(row));
    }

    pub(crate) fn section(&mut self, words: impl IntoIterator<Item = u32>) {
        let at = self.words.len();
        self.words.push(0);
        self.words.extend(words);
        self.words[at] = (self.words.len() - at - 1) as u32;
    }

    /// The bodies that move and their positions, then what
    /// [`take_step`](crate::world::World::take_step) takes.
    pub(crate) fn add_step<'a>(
        &mut self,
        moving: impl Iterator<Item = (BodyId, &'a Positions)>,
        start: &StepStart,
        world: &World,
    ) {
        let number = world.numbers();
        let number = |body: BodyId| number(body.index() as u32);
        let positions = &mut self.positions;
        let bodies = moving.map(|(body, at)| {
            positions.push(at.clone());
            number(body)
        });
        let bodies: Vec<u32> = bodies.collect();
        self.section(bodies);
        let start = start.bodies().iter().flat_map(|start| {
            let stamp = [start.stamp as u32, (start.stamp >> 32) as u32];
            let number = number(start.body);
            [number, stamp[0], stamp[1], u32::from(start.keeps_rest)]
        });
        self.section(std::iter::once(MODULE).chain(start));
    }

    /// Kinds, whether at the start, then whether the start intersects: 0, 1, or 2 if nobody asked.
    fn of_impacts<'a>(
        impacts: impl Iterator<Item = &'a Impact> + Clone,
        start_intersects: Option<bool>,
        world: &World,
    ) -> Self {
        let mut answer = Answer::default();
        answer.add_rows(impacts.clone().map(Impact::row), world.numbers());
        let bytes = &mut answer.bytes;
        bytes.extend(impacts.clone().map(|impact| impact.kind as u8));
        bytes.extend(impacts.clone().map(|impact| u8::from(impact.at_start)));
        bytes.push(start_intersects.map_or(2, u8::from));
        answer.numbers.extend(impacts.map(|impact| impact.toi));
        answer
    }

    /// Kinds, two features per pair, whether parallel; distances and points, if they were asked
    /// for.
    pub(crate) fn of_near(near: &NearPairs, world: &World) -> Self {
        let mut answer = Answer {
            hash: near.hash(),
            ..Answer::default()
        };
        answer.add_rows(near.rows(), world.numbers());
        let bytes = &mut answer.bytes;
        bytes.extend(near.iter().map(|pair| pair.kind as u8));
        bytes.extend(near.iter().flat_map(|pair| pair.features.map(code)));
        bytes.extend(near.iter().map(|pair| u8::from(pair.is_parallel)));
        let numbers = &mut answer.numbers;
        numbers.extend(near.iter().filter_map(|pair| pair.distance));
        let points = near.iter().filter_map(|pair| pair.closest);
        numbers.extend(points.flat_map(|closest| closest.points).flatten());
        answer
    }

    /// Shapes, whether directed, whether curves are closed and directed; points, lengths, regions;
    /// where corners start, corners, where points of curves start, points of curves, and the
    /// contacts of each region.
    fn of_contacts(contacts: &Contacts, world: &World) -> Result<Self, Error> {
        let mut answer = Answer::default();
        let (n, curves) = (contacts.len(), contacts.curves()?);
        let bytes = &mut answer.bytes;
        bytes.extend(contacts.shapes().iter().map(|shape| match shape {
            Shape::Solid => 0,
            Shape::Apart => 1,
            Shape::Point => 2,
            Shape::Segment => 3,
            Shape::Polygon => 4,
        }));
        bytes.extend((0..n).map(|ix| u8::from(contacts.is_directed(ix))));
        let each = 0..curves.len();
        bytes.extend(each.clone().map(|ix| u8::from(curves.is_closed(ix))));
        bytes.extend(each.clone().map(|ix| u8::from(curves.is_directed(ix))));
        let points = contacts.points();
        answer.numbers.push(points.len() as f64);
        answer.numbers.extend(points.as_flattened());
        answer.numbers.extend(each.map(|ix| curves.length(ix)));
        answer.section(contacts.starts().iter().map(|&start| start as u32));
        answer.section(contacts.all_corners().iter().copied());
        answer.add_curves(&curves);
        answer.add_regions(&contacts.regions()?, world);
        Ok(answer)
    }

    /// The kind of each row.
    pub(crate) fn of_candidates(candidates: &Candidates, world: &World) -> Self {
        let mut answer = Answer {
            hash: candidates.hash(),
            ..Answer::default()
        };
        for kind in PairKind::ALL {
            let rows = candidates.rows_of(kind);
            let n = answer.bytes.len() + rows.len();
            answer.bytes.resize(n, kind as u8);
            answer.add_rows(rows, world.numbers());
        }
        answer
    }

    /// A row, the distance and two points, if there is any pair.
    pub(crate) fn of_nearest(nearest: Option<Nearest>, number: impl Fn(BodyId) -> u32) -> Self {
        let mut answer = Answer::default();
        if let Some(Nearest {
            distance,
            a,
            b,
            points,
            ..
        }) = nearest
        {
            answer.rows = vec![number(a.body), a.element, number(b.body), b.element];
            answer.numbers.push(distance);
            answer.numbers.extend(points.as_flattened());
        }
        answer
    }

    fn add_curves(&mut self, curves: &Curves) {
        self.section(curves.starts().iter().map(|&start| start as u32));
        self.section(curves.all_points().iter().copied());
    }

    fn of_penetration(penetration: &Penetration, world: &World) -> Self {
        let mut answer = Answer::of(penetration.volume().unwrap_or(f64::NAN));
        for inside in &penetration.inside {
            answer.section(inside.iter().copied());
        }
        answer.add_regions(&penetration.regions, world);
        answer
    }

    /// What regions have, 21 numbers and three sections each; what is unknown is not a number.
    fn add_regions(&mut self, regions: &[Region], world: &World) {
        let number = world.numbers();
        for region in regions {
            let of = &mut self.numbers;
            of.extend(region.position);
            of.extend(region.bounds.as_flattened());
            of.extend([region.length, region.patch_area]);
            of.extend(region.area);
            of.extend(region.normal.unwrap_or([f64::NAN; 3]));
            of.push(region.depth.unwrap_or(f64::NAN));
            of.push(region.volume.unwrap_or(f64::NAN));
            of.extend(region.bodies.map(|body| f64::from(number(body))));
            for words in [&region.contacts, &region.inside[0], &region.inside[1]] {
                self.section(words.iter().copied());
            }
        }
    }
}

/// A feature as one number: a vertex of the element, its edges from 8 on, its face.
pub(crate) fn code(feature: Feature) -> u8 {
    match feature {
        Feature::Vertex(ix) => ix,
        Feature::Edge(ix) => 8 + ix,
        Feature::Face => 16,
    }
}

/// Pairs as flat lists.
pub(crate) fn of_pairs(pairs: &Pairs, world: &World) -> Answer {
    let mut answer = Answer {
        hash: pairs.hash(),
        ..Answer::default()
    };
    answer.add_rows(pairs.rows(), world.numbers());
    answer
}

/// The words of a query without bodies, which may have been removed since: what leaves out pairs of
/// two bodies.
fn of_elements(words: &[u32]) -> Result<Vec<u32>, Error> {
    let (head, rest) = words.split_first_chunk::<9>().ok_or(Error::Foreign)?;
    let (_, excluded) = (rest.split_at_checked((head[7] >> 5) as usize)).ok_or(Error::Foreign)?;
    let excluded = excluded.as_chunks::<3>().0.iter();
    let groups = excluded.filter(|[kind, ..]| *kind == 2).flatten();
    let all = [0, 0, 0, 0, 0, 0, 0, head[7] & 4, 1];
    Ok(all.iter().chain(groups).copied().collect())
}

impl Asker {
    /// Asks. For questions with a query, `words` and `numbers` are those of [`query`].
    /// [`Question::Distance`]: two bodies; [`Question::Contains`], [`Question::Locate`],
    /// [`Question::SignedDistance`] and [`Question::WindingNumbers`]: one. Points, or origins and
    /// then directions, come after these numbers.
    /// [`Question::Contacts`]: the length and the words of the query that found the pairs, whose numbers are given, a number of the
    /// caller's for the answer, then rows of pairs; [`Question::Penetration`]: the same with two bodies before the rows; its rows are the two bodies, in the order of what is inside.
    ///
    /// # Errors
    /// No such body; those of the question.
    pub fn ask(
        &mut self,
        question: Question,
        world: &World,
        words: &[u32],
        numbers: &[f64],
    ) -> Result<Answer, Error> {
        let (numbers, given) = numbers.split_first_chunk().ok_or(Error::Foreign)?;
        match question {
            Question::Contains
            | Question::Locate
            | Question::SignedDistance
            | Question::WindingNumbers => {
                return self.about_points(question, world, words, given);
            }
            Question::Distance => return self.distance(world, words),
            Question::Contacts | Question::Penetration => {
                return self.about_contacts(question, world, (words, numbers));
            }
            _ => {}
        }
        let query = &query(world, words, numbers)?;
        let (scene, length) = (&world.scene, numbers[9]);
        let detector = &mut self.detector;
        Ok(match question {
            Question::Count => Answer::of(detector.count(scene, query)? as f64),
            Question::Any => Answer::of(f64::from(u8::from(detector.any(scene, query)?))),
            Question::IsFree => Answer::of(f64::from(u8::from(detector.is_free(scene, query)?))),
            Question::Impacts => {
                let impacts = detector.impacts(scene, query)?;
                Answer {
                    hash: impacts.hash(),
                    ..Answer::of_impacts(impacts.iter(), impacts.start_intersects(), world)
                }
            }
            Question::Earliest => {
                let first = detector.earliest(scene, query)?;
                Answer::of_impacts(first.iter(), None, world)
            }
            Question::Advance => {
                let found = detector.advance(scene, query)?;
                let mut answer =
                    Answer::of_impacts(found.first.iter(), found.start_intersects, world);
                answer
                    .numbers
                    .extend([found.fraction, f64::from(found.n_tried)]);
                answer.add_step(found.iter(), found.start(), world);
                answer
            }
            Question::Candidates => {
                Answer::of_candidates(&detector.candidates(scene, length, query)?, world)
            }
            Question::Closest
            | Question::Cast
            | Question::SafeDistances
            | Question::Truncate
            | Question::Neighbours
            | Question::Nearest => return self.probe(question, world, (query, length), given),
            Question::Near => Answer::of_near(&detector.near(scene, length, query)?, world),
            _ => of_pairs(&detector.detect(scene, query)?, world),
        })
    }

    /// [`candidates_in_runs`](impinge::Detector::candidates_in_runs), with the words and the
    /// numbers of a query. `each` gets the answer of each run, and says whether to go on. Returns
    /// how many candidates it got.
    ///
    /// # Errors
    /// No such body; those of the question.
    pub fn candidates_in_runs(
        &mut self,
        world: &World,
        (words, numbers): (&[u32], &[f64]),
        most: u64,
        mut each: impl FnMut(Answer) -> bool,
    ) -> Result<f64, Error> {
        let numbers = numbers.first_chunk().ok_or(Error::Foreign)?;
        let query = query(world, words, numbers)?;
        let mut n_given = 0;
        let hand_out = |run: Candidates| {
            n_given += run.len();
            match each(Answer::of_candidates(&run, world)) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        };
        let detector = &mut self.detector;
        let _ = detector.candidates_in_runs(&world.scene, numbers[9], &query, most, hand_out)?;
        Ok(n_given as f64)
    }

    /// The nearest pair of two bodies: a row, the distance and two points; nothing, if one of them
    /// is empty.
    fn distance(&mut self, world: &World, words: &[u32]) -> Result<Answer, Error> {
        let &[a, b] = words else {
            return Err(Error::Foreign);
        };
        let nearest = self
            .detector
            .distance(&world.scene, world.id(a)?, world.id(b)?)?;
        let first = world.id(a)?;
        Ok(Answer::of_nearest(nearest, |body| {
            if body == first { a } else { b }
        }))
    }

    fn about_contacts(
        &mut self,
        question: Question,
        world: &World,
        (words, numbers): (&[u32], &[f64; 10]),
    ) -> Result<Answer, Error> {
        let split = words.split_first();
        let split = split.and_then(|(&n, rest)| rest.split_at_checked(n as usize));
        let (asked, rest) = split.ok_or(Error::Foreign)?;
        let (&number, rest) = rest.split_first().ok_or(Error::Foreign)?;
        let (bodies, rows) = match (question, rest) {
            (Question::Penetration, [a, b, rows @ ..]) => {
                (Some([world.id(*a)?, world.id(*b)?]), rows)
            }
            _ => (None, rest),
        };
        let is_known = self.known.as_ref().is_some_and(|(of, _)| *of == number);
        if bodies.is_none() || !is_known {
            let query = query(world, &of_elements(asked)?, numbers)?;
            self.find_contacts(number, world, (&query, rows))?;
        }
        let Some((_, contacts)) = &self.known else {
            return Err(Error::Foreign);
        };
        let Some([a, b]) = bodies else {
            return Answer::of_contacts(contacts, world);
        };
        let found = self.detector.penetration(&world.scene, contacts, a, b)?;
        let number = world.numbers();
        let bodies = [a.min(b), a.max(b)].map(|body| number(body.index() as u32));
        Ok(Answer {
            rows: bodies.to_vec(),
            ..Answer::of_penetration(&found, world)
        })
    }

    /// Finds the contacts of rows of a query, and keeps them under a number.
    fn find_contacts(
        &mut self,
        number: u32,
        world: &World,
        (query, rows): (&Query, &[u32]),
    ) -> Result<(), Error> {
        self.known = None;
        let row = |&[a, i, b, j]: &[u32; 4]| {
            let [a, b] = [world.id(a)?, world.id(b)?];
            Ok([a.index() as u32, i, b.index() as u32, j])
        };
        let rows = rows.as_chunks().0.iter().map(row);
        let rows = rows.collect::<Result<Vec<_>, Error>>()?;
        let pairs = Pairs::of_rows(&world.scene, query, &rows)?;
        let contacts = self.detector.contacts(&world.scene, &pairs)?;
        self.known = Some((number, contacts));
        Ok(())
    }
}
