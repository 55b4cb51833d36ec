//! Where the points of two elements that meet must stop so that they stay apart.
//!
//! What it does: two elements whose points lie on either side of a space between two parallel
//! planes, at the start and at the end, do so on all of their straight ways: the planes go along.
//! No times are needed.
//!
//! How: the planes lie across the shortest way between the elements, at the start or at the end.
//! The points that go towards the other element are stopped: where both come nearer, each gets a
//! share of the room, by how far it wants to go. Where floats see no room, the points that go
//! towards the other element stay where they are, and the others go on. Heights over a plane are
//! computed in `f64`, so this is where points should stop; that elements then stay apart is decided
//! by the exact test.
//!
//! Source: A. Chen et al., "Divide and Truncate", SIGGRAPH 2026, for planes that divide the room
//! between elements. There they rest.

use crate::Point;
use crate::element_pair::ElementPair;
use crate::filter::nearness::Polygon;
use crate::rounding::{root, to_usual_size};

/// The share of the room that stays free, so that elements are certainly apart when their points
/// have stopped.
const LEAST_SHARE: f64 = 1.0 / 1024.0;

/// A bound of the relative error of a height: 8 roundings, where 5 happen.
const ERROR: f64 = 4.0 * f64::EPSILON;

/// About the shortest way from the second element to the first; without a length where sizes are
/// out of range.
fn shortest_way(pair: ElementPair, points: &[Point; 4]) -> Point {
    let (is_small, way) = Polygon::of_pair(pair, points).way();
    match (is_small, pair) {
        (false, _) => [0.0; 3],
        // The polygon is the face minus the vertex, or the first edge minus the second.
        (true, ElementPair::EdgeEdge) => way,
        (true, _) => way.map(|x| -x),
    }
}

/// How far each point of two elements may go from its start to its end, a share, so that the
/// elements stay apart: about, and only as far as those that are now where they do not have to stop
/// stay there. Points that do not have to stop earlier than now have 1.
///
/// `None` if the elements are not certainly farther apart at the start.
#[must_use]
pub fn shares_apart(pair: ElementPair, times: [&[Point; 4]; 3], distance: f64) -> Option<[f64; 4]> {
    at_usual_size(times, distance, |times, distance| {
        usual_apart(pair, times, distance)
    })
}

/// [`shares_apart`] of usual sizes.
fn usual_apart(
    pair: ElementPair,
    [start, now, end]: [&[Point; 4]; 3],
    distance: f64,
) -> Option<[f64; 4]> {
    let is_possible = |across: &Across| across.room(start, distance).is_some_and(|room| room > 0.0);
    let possible = ways(pair, [start, end]).filter(is_possible);
    farthest(possible.map(|across| across.shares([start, now, end], distance, Planes::Follow)))
}

/// The shares of which the least is largest.
fn farthest(shares: impl Iterator<Item = [f64; 4]>) -> Option<[f64; 4]> {
    let least = |shares: &[f64; 4]| shares.iter().fold(1.0, |least: f64, &x| least.min(x));
    shares.max_by(|a, b| least(a).total_cmp(&least(b)))
}

/// As [`shares_apart`], but the planes rest: the elements stay apart wherever each point stops, if
/// none goes farther than its share of its way, or than it is now if that is 1. Positions on the
/// ways may be off by `rounded` along each axis, those that are now included.
///
/// `None` if there is not certainly so much room.
#[must_use]
pub fn shares_at_rest(
    pair: ElementPair,
    times: [&[Point; 4]; 3],
    distance: f64,
    rounded: f64,
) -> Option<[f64; 4]> {
    let scale = to_usual_size(&times).unwrap_or(1.0);
    at_usual_size(times, distance, |times, distance| {
        usual_at_rest(pair, times, distance, rounded * scale)
    })
}

/// [`shares_at_rest`] of usual sizes.
fn usual_at_rest(
    pair: ElementPair,
    times: [&[Point; 4]; 3],
    distance: f64,
    rounded: f64,
) -> Option<[f64; 4]> {
    let [start, _, end] = times;
    let shares = ways(pair, [start, end]).filter_map(|across| {
        // A height changes by at most three times as much as a coordinate, of a point that is now
        // where it is and of where it stops.
        let off = across.noise(&times, distance) + 6.0 * rounded;
        let room = across.room(start, distance)?;
        (room > 8.0 * off).then(|| across.shares(times, distance, Planes::Rest { off }))
    });
    farthest(shares)
}

/// The same for elements that are farther apart at the start, but by so little that heights in
/// `f64` do not tell where to stop. Points that go towards the other element stay at their start,
/// or follow it if it goes away as a whole. If there are none, those stay that do not certainly go
/// away; if there are none of these either, all that move. So some point that is not at its start
/// now has less than 1, if there is one.
#[must_use]
pub fn shares_without_room(pair: ElementPair, times: [&[Point; 4]; 3], distance: f64) -> [f64; 4] {
    let shares = at_usual_size(times, distance, |times, distance| {
        usual_without_room(pair, times, distance)
    });
    let [start, now, _] = times;
    match (0..pair.n_points()).any(|ix| now[ix] != start[ix] && shares[ix] < 1.0) {
        true => shares,
        // Scaling lost small motions beside large numbers.
        false => stays_if(|ix| now[ix] != start[ix]),
    }
}

/// Shares of points and a distance; very small or very large ones are multiplied by a power of two,
/// with which the largest coordinate is usual. Shares are the same.
fn at_usual_size<R>(
    times: [&[Point; 4]; 3],
    distance: f64,
    shares: impl FnOnce([&[Point; 4]; 3], f64) -> R,
) -> R {
    let Some(scale) = to_usual_size(&times) else {
        return shares(times, distance);
    };
    let scaled = times.map(|points| points.map(|point| point.map(|x| x * scale)));
    shares(scaled.each_ref(), distance * scale)
}

/// [`shares_without_room`] of usual sizes.
fn usual_without_room(
    pair: ElementPair,
    [start, now, end]: [&[Point; 4]; 3],
    distance: f64,
) -> [f64; 4] {
    // Where elements are large beside their distance, their common normal may be a better way.
    let normal = Polygon::of_pair(pair, start).normal();
    let across_both = [normal, normal.map(|x| -x)].map(|way| Across::new(way, pair));
    let tried = ways(pair, [start, end]).chain(across_both.into_iter().flatten());
    let with_room = tried.filter_map(|across| {
        let room = across.room(start, distance)? / across.length();
        (!room.is_nan()).then_some((room, across))
    });
    let best = with_room.max_by(|(a, _), (b, _)| a.total_cmp(b));
    let Some((room, across)) = best else {
        return stays_if(|ix| now[ix] != start[ix]);
    };
    let noise = across.noise(&[start, now], distance);
    if LEAST_SHARE * room > noise {
        let shares = across.shares([start, now, end], distance, Planes::Follow);
        if (0..pair.n_points()).any(|ix| now[ix] != start[ix] && shares[ix] < 1.0) {
            return shares;
        }
    }
    across.shares_without_room([start, now, end], distance, noise)
}

/// 0 for some points, and 1 for all others.
fn stays_if(stays: impl Fn(usize) -> bool) -> [f64; 4] {
    core::array::from_fn(|ix| if stays(ix) { 0.0 } else { 1.0 })
}

/// About the shortest ways between two elements, at some times.
fn ways<'a>(
    pair: ElementPair,
    times: impl IntoIterator<Item = &'a [Point; 4]>,
) -> impl Iterator<Item = Across> {
    let ways = times
        .into_iter()
        .map(move |points| shortest_way(pair, points));
    ways.filter_map(move |way| Across::new(way, pair))
}

/// What the planes between two elements do.
#[derive(Clone, Copy, PartialEq)]
enum Planes {
    /// If only one element comes nearer, its plane is as near as the other is now.
    Follow,
    /// They are good wherever the points stop, with heights off by so much.
    Rest { off: f64 },
}

/// A direction from the second element to the first.
struct Across {
    /// Its largest coordinate is 1 or -1.
    normal: Point,
    pair: ElementPair,
}

impl Across {
    /// Along a way, if it has a length.
    fn new(way: Point, pair: ElementPair) -> Option<Self> {
        let size = way.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        (size > 0.0 && size < f64::INFINITY).then(|| Across {
            normal: way.map(|x| x / size),
            pair,
        })
    }

    /// The height of a point over another one, and a bound of its error.
    fn height(&self, point: &Point, origin: &Point) -> [f64; 2] {
        let (mut height, mut size) = (0.0, 0.0);
        for (k, x) in point.iter().enumerate() {
            let part = self.normal[k] * (x - origin[k]);
            height += part;
            size += part.abs();
        }
        // Products that underflow are off by less than the smallest normal number.
        [height, ERROR * size + 4.0 * f64::MIN_POSITIVE]
    }

    /// The number of each point, and the side of its element.
    fn sides(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (n, n_first) = (self.pair.n_points(), self.pair.n_first());
        (0..n).map(move |ix| (ix, usize::from(ix >= n_first)))
    }

    /// How far apart planes are, as heights: rounded up, by more than the roundings here.
    fn thick(&self, distance: f64) -> f64 {
        distance * self.length() * (1.0 + 4.0 * ERROR)
    }

    /// The length of the normal.
    fn length(&self) -> f64 {
        root(self.normal.iter().map(|x| x * x).sum())
    }

    /// The lowest of the first element's heights, and the highest of the second's; `signs` of the
    /// error are added.
    fn bounds(&self, points: &[Point; 4], origin: &Point, error: f64) -> [f64; 2] {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (ix, side) in self.sides() {
            let [height, most] = self.height(&points[ix], origin);
            if height.is_nan() {
                return [f64::NAN; 2];
            }
            match side {
                0 => low = low.min(height - error * most),
                _ => high = high.max(height + error * most),
            }
        }
        [low, high]
    }

    /// By how much the elements are at least farther apart, as a height; `None` if that is not a
    /// number.
    fn room(&self, points: &[Point; 4], distance: f64) -> Option<f64> {
        let [low, high] = self.bounds(points, &points[0], 1.0);
        let room = ((low - high).next_down() - self.thick(distance)).next_down();
        (!room.is_nan()).then_some(room)
    }

    /// See [`shares_apart`] and [`shares_at_rest`].
    fn shares(
        &self,
        [start, now, end]: [&[Point; 4]; 3],
        distance: f64,
        planes: Planes,
    ) -> [f64; 4] {
        let origin = &start[0];
        let thick = self.thick(distance);
        let [low, high] = self.bounds(start, origin, 0.0);
        let [low_now, high_now] = self.bounds(now, origin, 0.0);
        let room = low - high - thick;
        let least_spare = match planes {
            Planes::Follow => 0.0,
            Planes::Rest { off } => 2.0 * off,
        };
        let spare = (LEAST_SHARE * room).max(least_spare);
        // How far each has come towards the other.
        let come = [low - low_now, high_now - high];
        let levels = match come.map(|come| come > 0.0 || planes != Planes::Follow) {
            [true, true] => {
                let [first, second] = come.map(|come| come.max(0.0));
                // Where neither comes nearer, that is no number: the middle.
                let share = first / (first + second);
                let share = if share.is_nan() { 0.5 } else { share };
                let level = low - (room * share).clamp(spare, room - spare);
                [level + 0.5 * spare, level - thick - 0.5 * spare]
            }
            // The first one stays where it is now, and the second one may follow it.
            [false, _] => [low_now, low_now - thick - spare],
            [_, false] => [high_now + thick + spare, high_now],
        };
        let mut shares = [1.0; 4];
        for (ix, side) in self.sides() {
            let [from, at, to] =
                [start, now, end].map(|points| self.height(&points[ix], origin)[0]);
            let is_beyond = match side {
                0 => at < levels[0],
                _ => at > levels[1],
            };
            if is_beyond {
                shares[ix] = share_to(levels[side], from, to);
            }
        }
        shares
    }

    /// More than all errors of heights, and of what planes are apart, together.
    fn noise(&self, times: &[&[Point; 4]], distance: f64) -> f64 {
        let of_heights = times.iter().flat_map(|points| {
            let sides = self.sides();
            sides.map(|(ix, _)| self.height(&points[ix], &times[0][0])[1])
        });
        4.0 * (of_heights.fold(0.0, f64::max) + 4.0 * ERROR * self.thick(distance))
    }

    /// See [`shares_without_room`].
    fn shares_without_room(
        &self,
        [start, now, end]: [&[Point; 4]; 3],
        distance: f64,
        noise: f64,
    ) -> [f64; 4] {
        let origin = &start[0];
        let thick = self.thick(distance);
        let bounds = [start, now].map(|points| self.bounds(points, origin, 0.0));
        // As heights over the other element, or depths below it: upwards is away.
        let heights = |side: usize, ix: usize| {
            let heights = [start, now, end].map(|points| self.height(&points[ix], origin)[0]);
            if side == 0 {
                heights
            } else {
                heights.map(|x| -x)
            }
        };
        let lowest = |side: usize| bounds.map(|[low, high]| if side == 0 { low } else { -high });
        let mut shares = [1.0; 4];
        for (ix, side) in self.sides() {
            let [from, at, to] = heights(side, ix);
            let [lowest_from, _] = lowest(side);
            let [other_from, other_now] = lowest(1 - side);
            let followed = LEAST_SHARE * (other_now - other_from);
            let own = LEAST_SHARE * (from - lowest_from);
            let (is_beyond, level) = if followed > noise {
                let level = thick + followed - other_now;
                (at < level, level)
            } else if own > noise {
                (at < lowest_from, lowest_from + own)
            } else {
                (at < lowest_from, from)
            };
            if is_beyond && at < from {
                shares[ix] = share_to(level, from, to);
            }
        }
        if shares.iter().any(|&share| share < 1.0) {
            return shares;
        }
        // Also if a height is not a number.
        let is_unsure = |side: usize, ix: usize| {
            let [from, at, _] = heights(side, ix);
            let is_away = at - from > noise;
            now[ix] != start[ix] && !is_away
        };
        let unsure = |ix: usize| {
            self.sides()
                .any(|(of, side)| of == ix && is_unsure(side, ix))
        };
        let shares = stays_if(unsure);
        if shares.iter().any(|&share| share < 1.0) {
            return shares;
        }
        stays_if(|ix| now[ix] != start[ix])
    }
}

/// The share of a way between two heights up to a level that is between them; 0 if that is not a
/// number.
fn share_to(level: f64, from: f64, to: f64) -> f64 {
    let share = (level - from) / (to - from);
    if share > 0.0 { share.min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::{are_within, first_within};
    use crate::rounding::power_of_two;
    use impinge_testing::random::Random;

    fn point(random: &mut Random, n: u32, scale: f64) -> Point {
        [(); 3].map(|()| (f64::from(random.below(2 * n + 1)) - f64::from(n)) * scale)
    }

    const PAIRS: [ElementPair; 4] = [
        ElementPair::VertexVertex,
        ElementPair::VertexEdge,
        ElementPair::VertexFace,
        ElementPair::EdgeEdge,
    ];

    #[test]
    fn what_is_stopped_never_comes_within_the_distance() {
        let mut random = Random::new(7);
        let (mut n_free, mut n_stopped) = (0, 0);
        for round in 0..20_000 {
            let pair = PAIRS[round % 4];
            let scale = [1.0, 0.1, 1e-3][round / 4 % 3];
            let [start, end] = [(); 2].map(|()| [(); 4].map(|()| point(&mut random, 4, scale)));
            let distance = [0.0, 0.25, 0.7][round % 3] * scale;
            let Some(shares) = shares_apart(pair, [&start, &end, &end], distance) else {
                // They are near, but for rounding.
                assert!(
                    are_within(pair, &start, distance + 1e-12 * scale),
                    "{start:?}"
                );
                continue;
            };
            assert!(!are_within(pair, &start, distance));
            if first_within(pair, &start, &end, distance).is_none() {
                n_free += 1;
                continue;
            }
            n_stopped += 1;
            assert!(shares.iter().any(|&share| share < 1.0), "{shares:?}");
            let at: [Point; 4] = core::array::from_fn(|ix| {
                core::array::from_fn(|k| start[ix][k] + shares[ix] * (end[ix][k] - start[ix][k]))
            });
            assert_eq!(
                first_within(pair, &start, &at, distance),
                None,
                "{shares:?}"
            );
        }
        assert!(n_free > 2000 && n_stopped > 2000, "{n_free} {n_stopped}");
    }

    /// Planes at rest are good wherever points stop, also beside their ways by as much as rounding
    /// moves them.
    #[test]
    fn planes_at_rest_part_elements_wherever_their_points_stop() {
        let mut random = Random::new(19);
        let (mut n_apart, mut n_met, mut n_none) = (0, 0, 0);
        for round in 0..20_000 {
            let pair = PAIRS[round % 4];
            let scale = [1.0, 0.1, 1e-3][round / 4 % 3];
            let [start, end] = [(); 2].map(|()| [(); 4].map(|()| point(&mut random, 4, scale)));
            let distance = [0.0, 0.25, 0.7][round % 3] * scale;
            let rounded = [0.0, 1e-6, 1e-3, 0.02][round / 7 % 4] * scale;
            // A point on its way, off by what rounding takes.
            let at = |shares: &[f64; 4], random: &mut Random| -> [Point; 4] {
                core::array::from_fn(|ix| {
                    let off = point(random, 8, rounded / 8.0);
                    core::array::from_fn(|k| {
                        start[ix][k] + shares[ix] * (end[ix][k] - start[ix][k]) + off[k]
                    })
                })
            };
            let now = at(&[1.0; 4], &mut random);
            let Some(shares) = shares_at_rest(pair, [&start, &now, &end], distance, rounded) else {
                n_none += 1;
                continue;
            };
            for _ in 0..4 {
                // Of points that stay where they are now, and of those that go back: any share.
                let less = [(); 4].map(|()| f64::from(random.below(1025)) / 1024.0);
                let taken = core::array::from_fn(|ix| shares[ix] * [1.0, less[ix]][round / 2 % 2]);
                let mut to = at(&taken, &mut random);
                for ix in 0..4 {
                    if taken[ix] == 1.0 {
                        to[ix] = now[ix];
                    }
                }
                assert_eq!(
                    first_within(pair, &start, &to, distance),
                    None,
                    "{shares:?}"
                );
                n_apart += 1;
            }
            n_met += usize::from(first_within(pair, &start, &now, distance).is_some());
        }
        assert!(
            n_apart > 20_000 && n_met > 2000 && n_none > 500,
            "{n_apart} {n_met} {n_none}"
        );
    }

    /// Squares of such sizes overflow or underflow, and shares are the same.
    #[test]
    fn shares_do_not_depend_on_the_size() {
        let mut random = Random::new(11);
        for round in 0..400 {
            let pair = PAIRS[round % 4];
            let [start, now, end] = [(); 3].map(|()| [(); 4].map(|()| point(&mut random, 4, 1.0)));
            let distance = [0.0, 0.25][round / 4 % 2];
            let both = |exponent: i32| {
                let size = power_of_two(exponent);
                let sized = [start, now, end].map(|at| at.map(|p| p.map(|x| x * size)));
                let times = sized.each_ref();
                let distance = distance * size;
                (
                    shares_apart(pair, times, distance),
                    shares_without_room(pair, times, distance),
                    shares_at_rest(pair, times, distance, size / 128.0),
                )
            };
            let usual = both(0);
            for exponent in [-1060, -996, -600, -300, 80, 300, 600, 1000, 1020] {
                assert_eq!(both(exponent), usual, "{exponent} {pair:?} {start:?}");
            }
        }
    }

    /// Scaled down, small numbers beside large ones are 0: points that move stay for all that.
    #[test]
    fn small_motions_beside_large_numbers_end() {
        let face = [[0.0; 3], [1e300, 0.0, 0.0], [0.0, 1e300, 0.0]];
        let [start, now] = [1e-30, -1e-30].map(|z| [[0.0, 0.0, z], face[0], face[1], face[2]]);
        let times = [&start, &now, &now];
        let shares = shares_apart(ElementPair::VertexFace, times, 0.0)
            .unwrap_or_else(|| shares_without_room(ElementPair::VertexFace, times, 0.0));
        assert!(shares[0] < 1.0, "{shares:?}");
    }

    const ORIGIN: Point = [0.0; 3];

    /// Two points over each other at first.
    fn over(ends: [f64; 2]) -> [[Point; 4]; 2] {
        let at = |z: [f64; 2]| [[0.0, 0.0, z[0]], [0.0, 0.0, z[1]], ORIGIN, ORIGIN];
        [at([1.0, 0.0]), at(ends)]
    }

    #[test]
    fn who_stays_leaves_the_room_to_who_moves_and_who_goes_away_is_followed() {
        let shares = |ends: [f64; 2]| {
            let [start, end] = over(ends);
            shares_apart(ElementPair::VertexVertex, [&start, &end, &end], 0.0)
                .map(|[a, b, ..]| [a, b])
                .expect("they are apart")
        };
        let [share, other] = shares([-1.0, 0.0]);
        assert!(other == 1.0 && share > 0.499 && share < 0.5, "{share}");
        let [share, other] = shares([-9.0, -5.0]);
        assert!(other == 1.0 && share > 0.599 && share < 0.6, "{share}");
        let [share, other] = shares([-1.0, 2.0]);
        assert!(share > 0.249 && share < 0.25 && other > 0.249 && other < 0.25);
    }

    #[test]
    fn what_touches_has_no_shares() {
        let of = |start: &[Point; 4], distance| {
            shares_apart(ElementPair::VertexVertex, [start, start, start], distance)
        };
        assert_eq!(of(&[ORIGIN; 4], 0.0), None);
        let [start, _] = over([0.0; 2]);
        assert_eq!(of(&start, 1.0), None);
        assert!(of(&start, 0.999).is_some());
        let huge = [[0.0, 0.0, 1e308], [0.0, 0.0, -1e308], ORIGIN, ORIGIN];
        assert_eq!(of(&huge, 0.0), Some([1.0; 4]));
    }

    /// Without room some point that is not at its start goes back each time, and only those that go
    /// towards the other element if there are any.
    #[test]
    fn without_room_points_go_back_until_the_elements_are_apart() {
        let mut random = Random::new(3);
        let (mut n_contacts, mut n_left) = (0, 0);
        for round in 0..4000 {
            let pair = PAIRS[round % 4];
            let scale = [1.0, 0.1, 1e-3][round / 4 % 3];
            let [start, end] = [(); 2].map(|()| [(); 4].map(|()| point(&mut random, 40, scale)));
            // The elements are farther apart than their rounded distance less a bit.
            let distance = crate::closest_points(pair, &start).distance.next_down();
            if distance <= 0.0 || shares_apart(pair, [&start, &end, &end], distance).is_some() {
                continue;
            }
            let n = pair.n_points();
            let mut now = end;
            let mut n_rounds = 0;
            while first_within(pair, &start, &now, distance).is_some() {
                n_contacts += 1;
                n_rounds += 1;
                assert!(n_rounds < 6, "{pair:?} {start:?} {end:?}");
                let shares = shares_without_room(pair, [&start, &now, &end], distance);
                let before = now;
                let is_back = |ix: usize| before[ix] != start[ix] && shares[ix] < 1.0;
                assert!((0..n).any(is_back), "{shares:?}");
                for ix in 0..n {
                    if is_back(ix) {
                        now[ix] = core::array::from_fn(|k| {
                            start[ix][k] + shares[ix] * (end[ix][k] - start[ix][k])
                        });
                    }
                }
            }
            n_left += usize::from((0..n).any(|ix| now[ix] != start[ix]));
        }
        assert!(n_contacts > 1000 && n_left > 1000, "{n_contacts} {n_left}");
        // Farther apart than any number.
        let huge = [[0.0, 0.0, 1e308], [0.0, 0.0, -1e308], ORIGIN, ORIGIN];
        let moved = [ORIGIN, huge[1], ORIGIN, ORIGIN];
        let pair = ElementPair::VertexVertex;
        let shares = shares_without_room(pair, [&huge, &moved, &moved], 0.0);
        assert_eq!(shares[..2], [0.0, 1.0]);
    }
}
