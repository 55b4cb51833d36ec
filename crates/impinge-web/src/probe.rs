//! Questions about points and rays, and those of solvers that bound each vertex, as flat lists.

use impinge::{Bounds, Closest, Csr, Hits, Neighbours, PairKind, Part, SafeDistances, Truncation};

use crate::answer::{Answer, code};
use crate::ask::{Asker, Question};
use crate::error::Error;
use crate::world::{World, rows};

impl Answer {
    /// Rows `[body, element]`, features; distances, then points; as many of these per point as the
    /// query says. Where nothing is near, a row of
    /// `u32::MAX`, an infinite distance and no point.
    fn of_closest(closest: &Closest, world: &World) -> Self {
        let number = world.numbers();
        let mut answer = Answer {
            hash: closest.hash(),
            ..Answer::default()
        };
        let Answer {
            rows,
            bytes,
            numbers,
            ..
        } = &mut answer;
        for found in closest {
            rows.extend(found.map_or([u32::MAX; 2], |of| {
                let body = of.element.body.index() as u32;
                [number(body), of.element.element]
            }));
            bytes.push(found.map_or(u8::MAX, |of| code(of.feature)));
            numbers.push(found.map_or(f64::INFINITY, |of| of.distance));
        }
        for found in closest {
            numbers.extend(found.map_or([f64::NAN; 3], |of| of.point));
        }
        answer
    }

    /// Rows `[body, element]` and features of the hits of all rays, before these whether each ray
    /// hits; where it enters, where it leaves, barycentrics; where the hits of each ray start.
    fn of_hits(hits: &Hits, world: &World) -> Self {
        let number = world.numbers();
        let mut answer = Answer {
            hash: hits.hash(),
            ..Answer::default()
        };
        let (bytes, numbers) = (&mut answer.bytes, &mut answer.numbers);
        bytes.extend(hits.is_hit().iter().map(|&is_hit| u8::from(is_hit)));
        for hit in hits {
            let body = number(hit.element.body.index() as u32);
            answer.rows.extend([body, hit.element.element]);
            bytes.push(code(hit.feature));
        }
        numbers.extend(hits.iter().map(|hit| hit.t));
        numbers.extend(hits.iter().map(|hit| hit.t_end));
        numbers.extend(hits.iter().flat_map(|hit| hit.barycentrics));
        answer.section(hits.offsets().iter().map(|&start| start as u32));
        answer
    }

    /// The pairs that touch as near pairs; after their numbers the bounds of all vertices; of each
    /// body its number, how many vertices it has, and whether they are in double precision.
    fn of_safe_distances(safe: &SafeDistances, world: &World) -> Self {
        let number = world.numbers();
        let mut answer = Answer::of_near(safe.touching(), world);
        for id in safe.bodies() {
            let Some(bounds) = safe.of(id) else { continue };
            let is_double = matches!(bounds, Bounds::F64(_));
            let head = [
                number(id.index() as u32),
                bounds.len() as u32,
                is_double.into(),
            ];
            answer.words.extend(head);
            match bounds {
                Bounds::F32(of) => answer.numbers.extend(of.iter().map(|&x| f64::from(x))),
                Bounds::F64(of) => answer.numbers.extend(of),
            }
        }
        answer
    }

    /// The pairs that stopped vertices as candidates; how many vertices were stopped, how many pairs
    /// touch, rounds; whether the start intersects, as for impacts; the bodies that move and their
    /// positions.
    fn of_truncation(truncation: &Truncation, world: &World) -> Self {
        let mut answer = Answer::of_candidates(&truncation.pairs(), world);
        answer
            .bytes
            .push(truncation.start_intersects().map_or(2, u8::from));
        answer.numbers.extend([
            truncation.n_cut() as f64,
            truncation.n_touching() as f64,
            f64::from(truncation.rounds()),
        ]);
        answer.add_step(truncation.iter(), truncation.start(), world);
        answer
    }

    /// Of each body its number, its first vertex, edge and face, in one section; then for each kind
    /// and each of its sides, if they differ, where lists start, and their entries. The number of
    /// pairs, and the distances of all lists.
    fn of_neighbours(near: &Neighbours, world: &World) -> Self {
        let number = world.numbers();
        let mut answer = Answer::of(near.len() as f64);
        let parts = [Part::Vertices, Part::Edges, Part::Faces];
        let bodies = near.bodies().flat_map(|id| {
            let first = parts.map(|part| near.first(id, part).unwrap_or(0));
            [[number(id.index() as u32)].as_slice(), &first].concat()
        });
        answer.section(bodies);
        let mut add = |of: &Csr| {
            // Numbers of pairs that a module of 32 bits holds.
            answer.section(of.offsets.iter().map(|&start| start as u32));
            answer.section(of.indices.iter().copied());
            answer.numbers.extend(&of.distances);
        };
        for kind in PairKind::ALL {
            add(near.of(kind));
            if let [a, b] = kind.parts()
                && a != b
            {
                add(near.reversed(kind));
            }
        }
        answer
    }
}

impl Asker {
    /// Where points lie: a byte each, -1, 0 or 1; or how far inside they are, a number each; or the
    /// tetrahedra that contain them, a word each, -1 for none; or how often the surface winds
    /// around them, a word each, the lowest number on the surface. `words`: the body.
    pub(crate) fn about_points(
        &mut self,
        question: Question,
        world: &World,
        words: &[u32],
        points: &[f64],
    ) -> Result<Answer, Error> {
        let &[body] = words else {
            return Err(Error::Foreign);
        };
        let points = rows::<_, 3>(points, "points")?;
        let (detector, scene, body) = (&mut self.detector, &world.scene, world.id(body)?);
        let mut answer = Answer::default();
        match question {
            Question::Locate => {
                let found = detector.locate(scene, body, points)?;
                let numbers = found.into_iter().map(|found| found.unwrap_or(u32::MAX));
                answer.words.extend(numbers);
            }
            Question::Contains => {
                let places = detector.contains(scene, body, points)?;
                answer.bytes.extend(places.iter().map(|&place| place as u8));
            }
            Question::WindingNumbers => {
                let found = detector.winding_numbers(scene, body, points)?;
                let numbers = found.into_iter().map(|found| found.unwrap_or(i32::MIN));
                answer.words.extend(numbers.map(i32::cast_unsigned));
            }
            _ => answer.numbers = detector.signed_distance(scene, body, points)?,
        }
        Ok(answer)
    }

    /// Questions about points, rays and bounds. `given`: points, or origins and then directions.
    pub(crate) fn probe(
        &mut self,
        question: Question,
        world: &World,
        (query, length): (&impinge::Query, f64),
        given: &[f64],
    ) -> Result<Answer, Error> {
        let (detector, scene) = (&mut self.detector, &world.scene);
        Ok(match question {
            Question::Closest => {
                let points = rows::<_, 3>(given, "points")?;
                Answer::of_closest(&detector.closest(scene, points, length, query)?, world)
            }
            Question::Cast => {
                let all = rows::<_, 3>(given, "origins and directions")?;
                let (origins, directions) = all.split_at(all.len() / 2);
                let hits = detector.cast(scene, origins, directions, length, query)?;
                Answer::of_hits(&hits, world)
            }
            Question::SafeDistances => {
                Answer::of_safe_distances(&detector.safe_distances(scene, length, query)?, world)
            }
            Question::Truncate => Answer::of_truncation(&detector.truncate(scene, query)?, world),
            Question::Neighbours => {
                Answer::of_neighbours(&detector.neighbours(scene, length, query)?, world)
            }
            _ => {
                let nearest = detector.nearest(scene, query)?;
                let number = world.numbers();
                Answer::of_nearest(nearest, |body| number(body.index() as u32))
            }
        })
    }
}
