//! Times of impact as colours of elements.

use std::collections::HashMap;

use impinge::{Body, BodyId, Impacts, Part};

/// The first time of contact of each element that touches anything, by itself or by an edge, a
/// vertex or a face of it.
pub(crate) fn first_times(body: &Body, id: BodyId, impacts: &Impacts) -> Vec<(u32, f64)> {
    let (edges, faces) = (body.part(Part::Edges), body.part(Part::Faces));
    // Sorted corners, filled up with the last one.
    let mut times: HashMap<[u32; 3], f64> = HashMap::new();
    for impact in impacts.iter() {
        for (part, element) in impact.kind.parts().into_iter().zip([impact.a, impact.b]) {
            if element.body != id {
                continue;
            }
            let ix = element.element as usize;
            let corners = match part {
                Part::Edges => edges.corners(ix),
                Part::Faces => faces.corners(ix),
                _ => &[element.element],
            };
            let first = times.entry(key(corners)).or_insert(impact.toi);
            *first = first.min(impact.toi);
        }
    }
    if times.is_empty() {
        return Vec::new();
    }
    let first = |element: u32| {
        let corners = body.elements().corners(element as usize);
        let n = corners.len();
        let subsets = (1..1usize << n).filter(|set| set.count_ones() <= 3);
        let time = |set: usize| {
            let mut chosen = [0; 3];
            let mut count = 0;
            for (k, &corner) in corners.iter().enumerate() {
                if set >> k & 1 == 1 {
                    chosen[count] = corner;
                    count += 1;
                }
            }
            times.get(&key(&chosen[..count])).copied()
        };
        let earliest = subsets.filter_map(time).reduce(f64::min)?;
        Some((element, earliest))
    };
    (0u32..).take(body.n_elements()).filter_map(first).collect()
}

fn key(corners: &[u32]) -> [u32; 3] {
    let last = corners.last().copied().unwrap_or(0);
    let mut key = [last; 3];
    for (held, &corner) in key.iter_mut().zip(corners) {
        *held = corner;
    }
    // One, two and three different corners cannot be confused: an edge (a, b) is filled up with its
    // larger number.
    let n = corners.len().min(3);
    key[..n].sort_unstable();
    let largest = key[n.saturating_sub(1)];
    for held in &mut key[n..] {
        *held = largest;
    }
    key
}

/// Red at the start of the step, yellow at its end.
pub(crate) fn color(toi: f64) -> [u8; 3] {
    const EARLY: [f64; 3] = [214.0, 39.0, 40.0];
    const LATE: [f64; 3] = [255.0, 221.0, 87.0];
    std::array::from_fn(|k| (EARLY[k] + toi * (LATE[k] - EARLY[k])).round() as u8)
}

#[cfg(test)]
mod tests {
    use impinge::{Backend, Detector, Query, Scene};

    use super::*;

    #[test]
    fn the_element_that_is_hit_first_has_the_earlier_time() {
        let mut scene = Scene::new();
        let floor = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        let low = scene.add_triangles(&[[0, 1, 2]], &floor).expect("a body");
        // Two triangles, one a quarter and one half a step above the floor.
        let above: Vec<[f32; 3]> = [0.25f32, 0.5]
            .iter()
            .flat_map(|&z| [[0.5, 0.5, z], [1.0, 0.5, z + 9.0], [0.5, 1.0, z + 9.0]])
            .collect();
        let high = scene
            .add_triangles(&[[0, 1, 2], [3, 4, 5]], &above)
            .expect("a body");
        let end: Vec<[f32; 3]> = above.iter().map(|&[x, y, z]| [x, y, z - 1.0]).collect();
        scene.set_end_positions(high, &end).expect("as many");
        let mut detector = Detector::new(Backend::Cpu).expect("a detector");
        let impacts = detector
            .impacts(&scene, &Query::between_all())
            .expect("an answer");
        let of = |id| first_times(scene.body(id).expect("there"), id, &impacts);
        assert_eq!(of(high), [(0, 0.25), (1, 0.5)]);
        assert_eq!(of(low), [(0, 0.25)]);
        assert_eq!(color(0.0), [214, 39, 40]);
        assert_eq!(color(1.0), [255, 221, 87]);
    }

    #[test]
    fn elements_with_the_same_corners_are_told_apart() {
        assert_ne!(key(&[1]), key(&[1, 2]));
        assert_ne!(key(&[1, 2]), key(&[1, 2, 3]));
        assert_eq!(key(&[3, 1]), key(&[1, 3]));
        assert_eq!(key(&[3, 1, 2]), key(&[2, 3, 1]));
    }
}
