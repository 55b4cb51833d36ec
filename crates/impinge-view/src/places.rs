//! Where bodies collide: connected groups of colliding primitives.

use std::collections::HashMap;

use crate::find::Answer;
use crate::stage::Stage;

/// A group of pairs that are connected by shared primitives or vertices.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Place {
    /// How many primitives it has.
    pub n_primitives: usize,
    /// The lowest and highest coordinates of their vertices.
    pub bounds: [[f64; 3]; 2],
}

/// The places of an answer, the one with the most primitives first.
pub(crate) fn places(stage: &Stage, answer: &Answer) -> Vec<Place> {
    let bodies = &stage.content.bodies;
    // Numbers of colliding primitives, counted over all bodies.
    let mut numbers: HashMap<(usize, u32), usize> = HashMap::new();
    let mut primitives = Vec::new();
    for (body, colliding) in answer.colliding.iter().enumerate() {
        for &primitive in colliding {
            numbers.insert((body, primitive), primitives.len());
            primitives.push((body, primitive));
        }
    }
    let mut sets = Sets::new(primitives.len());
    let body_of: HashMap<_, _> = bodies
        .iter()
        .enumerate()
        .map(|(ix, shown)| (shown.id, ix))
        .collect();
    for (a, b) in answer.pairs.iter() {
        let number = |element: impinge::Primitive| {
            let body = *body_of.get(&element.body)?;
            numbers.get(&(body, element.primitive)).copied()
        };
        if let (Some(a), Some(b)) = (number(a), number(b)) {
            sets.join(a, b);
        }
    }
    let mut first_at: HashMap<(usize, u32), usize> = HashMap::new();
    let mut bounds = vec![[[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]]; primitives.len()];
    for (number, &(body, primitive)) in primitives.iter().enumerate() {
        let Ok(held) = stage.scene().body(bodies[body].id) else {
            continue;
        };
        for &vertex in held.elements().corners(primitive as usize) {
            let point = held.positions().point(vertex as usize);
            extend(&mut bounds[number], [point, point]);
            match first_at.get(&(body, vertex)) {
                Some(&other) => sets.join(number, other),
                None => {
                    first_at.insert((body, vertex), number);
                }
            }
        }
    }
    let mut found: HashMap<usize, Place> = HashMap::new();
    for (number, own) in bounds.iter().enumerate() {
        let place = found.entry(sets.find(number)).or_insert(Place {
            n_primitives: 0,
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
        });
        place.n_primitives += 1;
        extend(&mut place.bounds, *own);
    }
    let mut places: Vec<(usize, Place)> = found.into_iter().collect();
    places.sort_by_key(|(first, place)| (usize::MAX - place.n_primitives, *first));
    places.into_iter().map(|(_, place)| place).collect()
}

fn extend(bounds: &mut [[f64; 3]; 2], [low, high]: [[f64; 3]; 2]) {
    for k in 0..3 {
        bounds[0][k] = bounds[0][k].min(low[k]);
        bounds[1][k] = bounds[1][k].max(high[k]);
    }
}

/// Disjoint sets of numbers. The lowest number of a set stands for it.
struct Sets(Vec<usize>);

impl Sets {
    fn new(n: usize) -> Self {
        Sets((0..n).collect())
    }

    fn find(&mut self, mut x: usize) -> usize {
        while self.0[x] != x {
            self.0[x] = self.0[self.0[x]];
            x = self.0[x];
        }
        x
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b);
    }
}
