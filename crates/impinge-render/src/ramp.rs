//! Numbers of elements as colours: of a step times of contact, of near elements shares of a
//! distance.

use std::collections::HashMap;

use impinge::{Body, BodyId, Element, Error, PairKind, Part, Scene};

/// The colour for a number from 0 to 1, a time of contact for one: from red to yellow.
pub fn ramp(number: f64) -> [u8; 3] {
    const RED: [f64; 3] = [214.0, 39.0, 40.0];
    const YELLOW: [f64; 3] = [255.0, 221.0, 87.0];
    std::array::from_fn(|k| (RED[k] + number.clamp(0.0, 1.0) * (YELLOW[k] - RED[k])).round() as u8)
}

/// The least numbers of elements, given numbers of pairs: of times of contact the first ones.
#[derive(Debug)]
pub struct Least(Vec<OfBody>);

impl Least {
    /// Of the elements of some bodies.
    ///
    /// # Errors
    /// The scene has no such body.
    pub fn new(
        scene: &Scene,
        bodies: impl IntoIterator<Item = BodyId>,
        pairs: impl IntoIterator<Item = (PairKind, [Element; 2], f64)>,
    ) -> Result<Self, Error> {
        let bodies = Vec::from_iter(bodies);
        let mut all = Vec::new();
        all.resize_with(bodies.len(), OfBody::default);
        let numbers: HashMap<BodyId, usize> = bodies.into_iter().zip(0..).collect();
        for (kind, elements, number) in pairs {
            for (part, element) in kind.parts().into_iter().zip(elements) {
                if let Some(&ix) = numbers.get(&element.body) {
                    all[ix].add(scene.body(element.body)?, part, element.element, number);
                }
            }
        }
        Ok(Least(all))
    }

    /// The least number of an element and of its faces, edges and vertices, by the place of its
    /// body and by its corners. `None` if they are in no pair, or there is no such body.
    pub fn of(&self, body: usize, corners: &[u32]) -> Option<f64> {
        self.0.get(body)?.of(corners)
    }

    /// Whether any element of a body has a number.
    pub fn has(&self, body: usize) -> bool {
        let any =
            |of: &OfBody| !(of.vertices.is_empty() && of.edges.is_empty() && of.faces.is_empty());
        self.0.get(body).is_some_and(any)
    }
}

#[derive(Debug, Default)]
struct OfBody {
    vertices: HashMap<u32, f64>,
    edges: HashMap<[u32; 2], f64>,
    faces: HashMap<[u32; 3], f64>,
}

impl OfBody {
    fn add(&mut self, body: &Body, part: Part, element: u32, number: f64) {
        let ix = element as usize;
        match part {
            Part::Edges => put(&mut self.edges, sorted(body.part(part).corners(ix)), number),
            Part::Faces => put(&mut self.faces, sorted(body.part(part).corners(ix)), number),
            _ => put(&mut self.vertices, element, number),
        }
    }

    fn of(&self, corners: &[u32]) -> Option<f64> {
        let vertices = corners
            .iter()
            .filter_map(|corner| self.vertices.get(corner));
        let n = corners.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        let edges = pairs.filter_map(|pair| self.edges.get(&sorted(&pair.map(|k| corners[k]))));
        let triples =
            (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
        let faces =
            triples.filter_map(|triple| self.faces.get(&sorted(&triple.map(|k| corners[k]))));
        vertices.chain(edges).chain(faces).copied().reduce(f64::min)
    }
}

fn sorted<const N: usize>(corners: &[u32]) -> [u32; N] {
    let mut key: [u32; N] = std::array::from_fn(|k| corners[k]);
    key.sort_unstable();
    key
}

fn put<K: Eq + std::hash::Hash>(all: &mut HashMap<K, f64>, key: K, number: f64) {
    let least = all.entry(key).or_insert(number);
    *least = least.min(number);
}

#[cfg(test)]
mod tests {
    use impinge::{Backend, Detector, Query};

    use super::*;

    #[test]
    fn the_element_that_is_hit_first_has_the_earlier_time() {
        let mut scene = Scene::new();
        let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        let low = scene.add_triangles(&[[0, 1, 2]], &floor).expect("a body");
        // Two triangles, one a quarter and one half a step above the floor; another one beside it.
        let above: Vec<[f32; 3]> = [(0.0, 0.25f32), (0.0, 0.5), (9.0, 0.5)]
            .iter()
            .flat_map(|&(x, z)| {
                [
                    [x + 0.5, 0.5, z],
                    [x + 1.0, 0.5, z + 9.0],
                    [x + 0.5, 1.0, z + 9.0],
                ]
            })
            .collect();
        let faces = [[0, 1, 2], [3, 4, 5], [6, 7, 8]];
        let high = scene.add_triangles(&faces, &above).expect("a body");
        let end: Vec<[f32; 3]> = above.iter().map(|&[x, y, z]| [x, y, z - 1.0]).collect();
        scene.set_end_positions(high, &end).expect("as many");
        let mut detector = Detector::new(Backend::Cpu).expect("a detector");
        let impacts = detector
            .impacts(&scene, &Query::between_all())
            .expect("an answer");
        let pairs = impacts.iter().map(|of| (of.kind, [of.a, of.b], of.toi));
        let times = Least::new(&scene, [high, low], pairs).expect("bodies");
        let found = faces.map(|corners| times.of(0, &corners));
        assert_eq!(found, [Some(0.25), Some(0.5), None]);
        assert_eq!(times.of(1, &[2, 0, 1]), Some(0.25));
        assert_eq!([0.0, 1.0].map(ramp), [[214, 39, 40], [255, 221, 87]]);
    }
}
