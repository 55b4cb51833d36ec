//! Distances against an oracle in fractions. For every subset of the polygon's corners, the oracle
//! finds the point of their plane, line or point that is nearest to the origin, and keeps it if its
//! weights are positive. The nearest of these is the nearest point of the polygon. No normals, no
//! regions of edges or corners.

use dashu_int::IBig;
use impinge_exact::{
    Contact, ElementPair, Feature, are_within, closest_points, edge_face_are_within,
    faces_are_within, first_contact, first_within, nearest_features, triangles_intersect,
};

use crate::generators::{Kind, Random};
use crate::grid::Grid;
use crate::moving::{MOTIONS, PAIRS, Point, corners, integers_over, step_on_lattice};

type Vector = [IBig; 3];

/// The square of the distance as a fraction, and the corners whose blend is the nearest point.
struct Shortest {
    over: IBig,
    under: IBig,
    support: Vec<usize>,
}

impl Shortest {
    fn is_within(&self, distance: &IBig) -> bool {
        self.over <= distance * distance * &self.under
    }

    fn is_shorter(&self, other: &Self) -> bool {
        &self.over * &other.under < &other.over * &self.under
    }
}

fn dot(a: &Vector, b: &Vector) -> IBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn shortest(polygon: &[Vector]) -> Shortest {
    let mut best: Option<Shortest> = None;
    // Small subsets first: the nearest point belongs to the smallest subset that has it.
    for size in 1..=3_u32.min(polygon.len() as u32) {
        for set in (1_u32..1 << polygon.len()).filter(|set| set.count_ones() == size) {
            let support: Vec<usize> = (0..polygon.len()).filter(|ix| set >> ix & 1 == 1).collect();
            let Some(found) = foot(polygon, support) else {
                continue;
            };
            if best.as_ref().is_none_or(|best| found.is_shorter(best)) {
                best = Some(found);
            }
        }
    }
    best.expect("a corner at least")
}

/// The shortest blend of corners with weights of sum 1, if the corners are independent and the
/// weights positive. The dot product of the shortest blend with every corner is the same.
fn foot(polygon: &[Vector], support: Vec<usize>) -> Option<Shortest> {
    let n = support.len();
    // Rows: G weights - m = 0 for each corner, and sum of weights = 1; unknowns: weights, then m.
    let mut rows: Vec<Vec<IBig>> = support
        .iter()
        .map(|&i| {
            let mut row: Vec<IBig> = support
                .iter()
                .map(|&j| dot(&polygon[i], &polygon[j]))
                .collect();
            row.extend([IBig::NEG_ONE, IBig::ZERO]);
            row
        })
        .collect();
    let mut last = vec![IBig::ONE; n];
    last.extend([IBig::ZERO, IBig::ONE]);
    rows.push(last);
    for step in 0..=n {
        let pivot = (step..=n).find(|&row| rows[row][step] != IBig::ZERO)?;
        rows.swap(step, pivot);
        let pivot_row = rows[step].clone();
        for (ix, row) in rows.iter_mut().enumerate() {
            if ix != step {
                let factor = row[step].clone();
                for (entry, above) in row.iter_mut().zip(&pivot_row) {
                    *entry = &pivot_row[step] * &*entry - &factor * above;
                }
            }
        }
    }
    // Weight k is rows[k][n + 1] / rows[k][k]; m, the last, is the square of the blend's length.
    let fraction = |ix: usize| {
        let (over, under) = (rows[ix][n + 1].clone(), rows[ix][ix].clone());
        if under < IBig::ZERO {
            (-over, -under)
        } else {
            (over, under)
        }
    };
    let is_inside = (0..n).all(|ix| fraction(ix).0 > IBig::ZERO);
    let (over, under) = fraction(n);
    is_inside.then_some(Shortest {
        over,
        under,
        support,
    })
}

fn polygon(pair: ElementPair, points: &[Vector]) -> Vec<Vector> {
    corners(pair)
        .iter()
        .map(|&[i, j]| std::array::from_fn(|k| &points[i][k] - &points[j][k]))
        .collect()
}

/// The features that a blend of the oracle's corners belongs to; `None` where several features are
/// possible.
fn features(pair: ElementPair, support: &[usize]) -> Option<(Feature, Feature)> {
    use Feature::{Edge, Face, Vertex};
    let numbers = corners(pair);
    let distinct = |which: usize| -> Vec<usize> {
        let mut ids: Vec<usize> = support.iter().map(|&ix| numbers[ix][which]).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    let small = |ix: usize| u8::try_from(ix).unwrap();
    match pair {
        ElementPair::EdgeEdge => {
            let feature = |ids: &[usize], first: usize| match ids {
                [one] => Vertex(small(one - first)),
                _ => Edge(0),
            };
            Some((feature(&distinct(0), 0), feature(&distinct(1), 2)))
        }
        _ => {
            let b = match distinct(0)[..] {
                [one] => Vertex(small(one - 1)),
                [1, 2] => Edge(0),
                [2, 3] => Edge(1),
                [1, 3] => Edge(2),
                _ => Face,
            };
            Some((Vertex(0), b))
        }
    }
}

/// Of the corners and edges of a flat polygon that are nearest, the first in the order of
/// ipc-toolkit's names.
fn first_of_nearest(pair: ElementPair, polygon: &[Vector]) -> Vec<usize> {
    let edges: &[[usize; 2]] = match pair {
        ElementPair::EdgeEdge => &[[0, 2], [1, 3], [0, 1], [2, 3]],
        _ => &[[0, 1], [1, 2], [0, 2]],
    };
    let corners = (0..polygon.len()).map(|ix| vec![ix]);
    corners
        .chain(edges.iter().map(|edge| edge.to_vec()))
        .filter_map(|support| foot(polygon, support))
        .reduce(|best, part| if part.is_shorter(&best) { part } else { best })
        .expect("a corner at least")
        .support
}

fn check(pair: ElementPair, points: &[Point; 4], distance: f64) -> bool {
    let mut all: Vec<f64> = points.iter().flatten().copied().collect();
    all.push(distance);
    let all = integers_over(&all);
    let vectors: Vec<Vector> = (0..4)
        .map(|ix| std::array::from_fn(|k| all[3 * ix + k].clone()))
        .collect();
    let polygon = polygon(pair, &vectors);
    let expected = shortest(&polygon);
    let is_within = expected.is_within(&all[12]);
    let case = || format!("{pair:?} {points:?} {distance}");
    assert_eq!(are_within(pair, points, distance), is_within, "{}", case());
    let nearest = nearest_features(pair, points);
    let support = if nearest.is_parallel {
        first_of_nearest(pair, &polygon)
    } else {
        expected.support
    };
    let features = features(pair, &support).unwrap();
    assert_eq!((nearest.a, nearest.b), features, "{}", case());
    assert!(!nearest.name(pair).is_empty());
    let closest = closest_points(pair, points);
    assert_eq!(closest.nearest, nearest);
    assert!(
        is_largest_below(pair, points, closest.distance),
        "{} {closest:?}",
        case()
    );
    // Rounded points are as precise as coordinates are.
    let size = points
        .iter()
        .flatten()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    if (1e-3..1e6).contains(&size) {
        let [a, b] = closest.points;
        let way: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
        assert!(
            (way.sqrt() - closest.distance).abs() <= 1e-4 * size,
            "{} {closest:?}",
            case()
        );
    }
    is_within
}

/// Whether a number is the largest float that is not above the distance.
fn is_largest_below(pair: ElementPair, points: &[Point; 4], found: f64) -> bool {
    let mut all: Vec<f64> = points.iter().flatten().copied().collect();
    all.push(found);
    if found < f64::MAX {
        all.push(found.next_up());
    }
    let all = integers_over(&all);
    let vectors: Vec<Vector> = (0..4)
        .map(|ix| std::array::from_fn(|k| all[3 * ix + k].clone()))
        .collect();
    let exact = shortest(&polygon(pair, &vectors));
    let is_below = |x: &IBig| x * x * &exact.under <= exact.over;
    is_below(&all[12]) && all.get(13).is_none_or(|next| !is_below(next))
}

#[test]
fn distances_agree_with_the_oracle() {
    let mut random = Random::new(31);
    for kind in Kind::ALL {
        let n = match kind {
            Kind::Lattice(_) => 700,
            Kind::AnyF32 => 40,
            kind if kind.is_wide() => 30,
            _ => 200,
        };
        for pair in PAIRS {
            let mut n_within = 0;
            for _ in 0..n {
                let points = kind.points::<4>(&mut random);
                // Distances that occur, and their neighbours.
                let apart = closest_points(pair, &points).distance;
                let distance = match random.below(6) {
                    0 => 0.0,
                    1 => 1.0,
                    2 => apart,
                    3 => apart.next_up(),
                    4 => apart.next_down().max(0.0),
                    _ => apart * (1.0 + random.unit()),
                };
                let distance = if distance.is_finite() { distance } else { 2.0 };
                n_within += usize::from(check(pair, &points, distance));
            }
            // Numbers of very different size are rarely near each other.
            let few = if kind.is_wide() { 0 } else { 3 };
            assert!(
                n_within > few && n_within < n,
                "{kind:?} {pair:?} {n_within}"
            );
        }
    }
}

#[test]
fn grids_agree_with_the_oracle() {
    let mut random = Random::new(34);
    for grid in Grid::ALL {
        for pair in PAIRS {
            let (mut n_within, mut n_parallel) = (0, 0);
            let n = 500;
            for round in 0..n {
                let points = grid.points(pair, &mut random);
                let apart = closest_points(pair, &points).distance;
                let (p, q) = (grid.vertex([0, 0], 1)[2], grid.vertex([0, 0], 0)[2]);
                let distance = match round % 6 {
                    0 => p - q,
                    1 => 0.025,
                    2 => apart,
                    3 => apart.next_up(),
                    4 => apart.next_down().max(0.0),
                    _ => 0.0,
                };
                n_within += usize::from(check(pair, &points, distance));
                n_parallel += usize::from(nearest_features(pair, &points).is_parallel);
            }
            let counts = format!("{grid:?} {pair:?} within {n_within}, parallel {n_parallel}");
            assert!(n_within > n / 8 && n_within < n, "{counts}");
            if matches!(pair, ElementPair::VertexFace | ElementPair::EdgeEdge) {
                assert!(n_parallel > n / 4, "{counts}");
            }
        }
    }
}

/// A face and an edge, or two faces: the nearest point of the hull of all differences of corners,
/// which needs up to three corners where it is not the origin.
#[test]
fn faces_are_as_near_as_the_hull_of_differences() {
    let mut random = Random::new(32);
    let (mut n_near, mut n_far) = (0, 0);
    for round in 0..800 {
        let [a, b, c, d, e, f] = Kind::Lattice(4).points::<6>(&mut random);
        let distance = f64::from([0_u8, 1, 2, 3][round % 4]) / 2.0;
        let within = |x: &[Point], y: &[Point; 3]| {
            let numbers: Vec<f64> = [x, y]
                .concat()
                .into_iter()
                .flatten()
                .chain([distance])
                .collect();
            let all = integers_over(&numbers);
            let hull: Vec<Vector> = (0..x.len())
                .flat_map(|i| (0..3).map(move |j| (i, x.len() + j)))
                .map(|(i, j)| std::array::from_fn(|k| &all[3 * i + k] - &all[3 * j + k]))
                .collect();
            // If the origin is inside the hull, the two share a point.
            let third = x[x.len() - 1];
            triangles_intersect(&[x[0], x[1], third], y)
                || shortest(&hull).is_within(&all[numbers.len() - 1])
        };
        let case = format!("{a:?} {b:?} {c:?} {d:?} {e:?} {f:?} {distance}");
        let near = within(&[a, b, c], &[d, e, f]);
        assert_eq!(
            faces_are_within(&[a, b, c], &[d, e, f], distance),
            near,
            "{case}"
        );
        assert_eq!(
            faces_are_within(&[d, e, f], &[a, b, c], distance),
            near,
            "{case}"
        );
        let edge_near = within(&[a, b], &[d, e, f]);
        assert_eq!(
            edge_face_are_within(&[a, b], &[d, e, f], distance),
            edge_near,
            "{case}"
        );
        if near {
            n_near += 1;
        } else {
            n_far += 1;
        }
    }
    assert!(n_near > 50 && n_far > 50, "{n_near} {n_far}");
}

/// Moving elements: not within the distance before the time, and within it from then on for a
/// moment.
#[test]
fn first_times_within_a_distance_are_right() {
    let mut random = Random::new(33);
    let (mut n_later, mut n_none, mut n_grazing) = (0, 0, 0);
    for round in 0..1200_usize {
        let [start, end] = step_on_lattice(
            MOTIONS[round % MOTIONS.len()],
            3 + round as u64 % 4,
            &mut random,
        );
        let distance = [0.25, 0.5, 1.0, 0.1, 2.0][round % 5];
        for pair in PAIRS {
            let found = first_within(pair, &start, &end, distance);
            let case = || format!("{pair:?} {start:?} {end:?} {distance} {found:?}");
            // No later than the first contact.
            if let Some(contact) = first_contact(pair, &start, &end) {
                assert!(
                    found.is_some_and(|near| near.time <= contact.time),
                    "{}",
                    case()
                );
            }
            let at = |t: f64| within_at(pair, &start, &end, distance, t);
            match found {
                Some(Contact { at_start: true, .. }) => assert!(at(0.0), "{}", case()),
                Some(contact) => {
                    n_later += 1;
                    assert!(!at(0.0), "{}", case());
                    assert_eq!(at(contact.time), contact.is_exact, "{}", case());
                    for k in 1..8 {
                        assert!(!at(contact.time * f64::from(k) / 8.0), "{}", case());
                    }
                    if !contact.is_exact && !at(contact.time.next_up()) {
                        n_grazing += 1;
                    }
                }
                None => {
                    n_none += 1;
                    for k in 0..=16 {
                        assert!(!at(f64::from(k) / 16.0), "{}", case());
                    }
                }
            }
            // Backwards, they come within the distance if and only if they do forwards.
            let back = first_within(pair, &end, &start, distance);
            assert_eq!(back.is_some(), found.is_some(), "{}", case());
        }
    }
    assert!(n_later > 300 && n_none > 300, "{n_later} {n_none}");
    assert!(n_grazing * 20 < n_later, "{n_grazing} of {n_later}");
}

/// Whether two moving elements are within a distance at a time that is a float.
fn within_at(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
    distance: f64,
    t: f64,
) -> bool {
    let mut numbers: Vec<f64> = start.iter().chain(end).flatten().copied().collect();
    numbers.push(distance);
    let all = integers_over(&numbers);
    let time = integers_over(&[t, 1.0]);
    let rest = &time[1] - &time[0];
    let points: Vec<Vector> = (0..4)
        .map(|ix| {
            std::array::from_fn(|k| &all[3 * ix + k] * &rest + &all[12 + 3 * ix + k] * &time[0])
        })
        .collect();
    shortest(&polygon(pair, &points)).is_within(&(&all[24] * &time[1]))
}
