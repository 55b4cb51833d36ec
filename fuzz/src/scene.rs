//! Scenes made from bytes, and what must hold of the answers about them.
//!
//! The first byte chooses how coordinates are read: as small integers, where everything is
//! degenerate, or as raw bits of f32 or f64, including NaN. Then bodies follow: a byte for kind and
//! size, vertices, corners; for a step, also end positions.

use impinge::{
    Backend, BodyId, Detector, Elements, Error, Method, Query, Scene, Settings, SharedVertex, Start,
};

const MOST_BODIES: usize = 4;

struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk::<N>()?;
        self.0 = tail;
        Some(*head)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn coordinate(&mut self, mode: u8) -> Option<f64> {
        match mode % 3 {
            0 => self.byte().map(|byte| f64::from(byte % 4)),
            1 => self.take().map(|bits| f64::from(f32::from_le_bytes(bits))),
            _ => self.take().map(f64::from_le_bytes),
        }
    }

    fn positions(&mut self, n: usize, mode: u8) -> Option<Vec<[f64; 3]>> {
        let mut position = || {
            let [x, y, z] = [0, 1, 2].map(|_| self.coordinate(mode));
            Some([x?, y?, z?])
        };
        (0..n).map(|_| position()).collect()
    }

    fn elements<const N: usize>(&mut self, n: usize, n_vertices: usize) -> Option<Vec<[u32; N]>> {
        // One number too many is possible, and refused.
        let mut corner = || Some(u32::from(self.byte()?) % (n_vertices as u32 + 1));
        let mut element = || {
            let mut corners = [0; N];
            for of in &mut corners {
                *of = corner()?;
            }
            Some(corners)
        };
        (0..n).map(|_| element()).collect()
    }
}

/// The value, unless the input was refused as it may be.
fn accepted<T>(result: Result<T, Error>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(Error::NonFinitePosition { .. } | Error::VertexIndexOutOfRange { .. }) => None,
        Err(error) => panic!("{error}"),
    }
}

fn narrow(positions: &[[f64; 3]]) -> Vec<[f32; 3]> {
    positions
        .iter()
        .map(|position| position.map(|x| x as f32))
        .collect()
}

/// Adds one body; `moves` if end positions follow. `None` at the end of the bytes.
fn add_body(scene: &mut Scene, bytes: &mut Bytes<'_>, mode: u8, moves: bool) -> Option<()> {
    let what = bytes.byte()?;
    let n_vertices = 3 + what as usize % 16;
    let n_elements = 1 + bytes.byte()? as usize % 80;
    let positions = bytes.positions(n_vertices, mode)?;
    // Only steps get bodies of edges and points.
    let elements: Elements = match (what >> 6, moves) {
        (0, true) => bytes.elements::<1>(n_elements, n_vertices)?.into(),
        (1, true) => bytes.elements::<2>(n_elements, n_vertices)?.into(),
        (2, _) | (0, false) => bytes.elements::<3>(n_elements, n_vertices)?.into(),
        _ => bytes.elements::<4>(n_elements, n_vertices)?.into(),
    };
    let is_double = what & 0x20 != 0;
    let added = match is_double {
        true => scene.add((elements, positions)),
        false => scene.add((elements, narrow(&positions))),
    };
    let end = match moves {
        true => Some(bytes.positions(n_vertices, mode)?),
        false => None,
    };
    if let (Some(id), Some(end)) = (accepted(added), end) {
        set_end(scene, id, &end, is_double);
    }
    Some(())
}

fn set_end(scene: &mut Scene, id: BodyId, end: &[[f64; 3]], is_double: bool) {
    // A body whose end is refused stands still.
    accepted(match is_double {
        true => scene.set_end_positions(id, end),
        false => scene.set_end_positions(id, &narrow(end)),
    });
}

fn build(data: &[u8], moves: bool) -> Option<(Scene, u8)> {
    let mut bytes = Bytes(data);
    let mode = bytes.byte()?;
    let mut scene = Scene::new();
    while scene.n_bodies() < MOST_BODIES && !bytes.0.is_empty() {
        add_body(&mut scene, &mut bytes, mode, moves)?;
    }
    Some((scene, mode))
}

fn detector(method: Method) -> Detector {
    Detector::new(Settings::new().method(method).backend(Backend::Cpu).threads(1))
    .expect("these settings are allowed")
}

/// Every method finds the oracle's pairs. Returns how many there are.
pub fn pairs(data: &[u8]) -> usize {
    let Some((scene, mode)) = build(data, false) else {
        return 0;
    };
    let rule = match mode & 0x80 {
        0 => SharedVertex::Skip,
        _ => SharedVertex::Resolve,
    };
    let query = Query::all().shared_vertex(rule);
    let answer = |method| {
        let pairs = detector(method).detect(&scene, &query);
        let pairs = pairs.expect("a checked scene is answered");
        pairs.rows().collect::<Vec<_>>()
    };
    let expected = answer(Method::Naive);
    for method in [Method::Auto, Method::Clusters, Method::Cells] {
        assert_eq!(expected, answer(method), "{method:?}");
    }
    expected.len()
}

/// The impacts, the earliest one, whether there is any, and the candidates of a step are the
/// oracle's. Returns how many impacts there are.
pub fn steps(data: &[u8]) -> usize {
    const CHECKED: &str = "a checked scene is answered";
    let Some((scene, mode)) = build(data, true) else {
        return 0;
    };
    let start = match mode & 0x80 {
        0 => Start::Report,
        _ => Start::Skip,
    };
    let query = Query::all().start(start);
    let (mut fast, mut naive) = (detector(Method::Clusters), detector(Method::Naive));
    let expected = naive.impacts(&scene, &query).expect(CHECKED);
    let found = fast.impacts(&scene, &query).expect(CHECKED);
    assert!(found.iter().eq(&expected));
    assert_eq!(
        fast.earliest(&scene, &query).expect(CHECKED),
        expected.earliest()
    );
    assert_eq!(
        fast.is_free(&scene, &query).expect(CHECKED),
        expected.is_empty()
    );
    let [by_fast, by_naive] = [&mut fast, &mut naive].map(|detector| {
        let candidates = detector.candidates(&scene, 0.0, &query).expect(CHECKED);
        candidates.iter().collect::<Vec<_>>()
    });
    assert_eq!(by_fast, by_naive);
    expected.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random bytes are what a fuzzer begins with. Together the scenes must have pairs and impacts,
    /// or the test checks nothing.
    #[test]
    fn noise() {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        };
        let (mut n_pairs, mut n_impacts) = (0, 0);
        for round in 0..400 {
            let data: Vec<u8> = (0..200 + 8 * round).map(|_| next()).collect();
            n_pairs += pairs(&data);
            n_impacts += steps(&data);
        }
        assert!(
            n_pairs > 100 && n_impacts > 1_000,
            "{n_pairs} pairs, {n_impacts} impacts"
        );
    }
}
