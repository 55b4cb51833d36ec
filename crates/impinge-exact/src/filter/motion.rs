//! Moving elements: certainly apart, certainly in contact within known times, or unsure.
//!
//! What it does: tests the difference polygon of two moving elements (see `crate::sweep`) over an
//! interval of time, in plain `f64` or `f32`. One pair per lane. The search of [0, 1] for the first
//! contact is a sequence of two tests of an interval, [`PolygonMotion::look`] and
//! [`PolygonMotion::enclose`], which have no branches. The caller stores the intervals
//! ([`Search`]), and so can keep all lanes busy.
//!
//! In: the points at the start and at the end ([`PolygonMotion`]). Out: masks and times. Cost in
//! operations for all lanes: [`PolygonMotion::are_far`] about 200, [`PolygonMotion::are_across`]
//! 300, [`PolygonMotion::are_aside`] 400, [`PolygonMotion::look`] 500, [`PolygonMotion::enclose`]
//! 900.
//!
//! Method: over [a, b] the corners V and edges E of the polygon are computed at a and at b, and
//! from them the Bernstein coefficients over [a, b] of the cubic f = N . V_0 and of the quartics w
//! = N . (V x E), one per edge. If all coefficients of f have one sign, or all of some w are
//! negative, there is no contact. If f has one root, and all coefficients of all w are positive
//! around it, there is contact. Else the interval is halved.
//!
//! Invariant: with |.| the largest coordinate at either end of the step and u the unit roundoff,
//! computed coefficients are wrong by less than 128 u |E_0| |E_1| |V_0| (f; three times that for
//! the inner ones, which are kept three times as large) and 384 u |E_0| |E_1| |V| |E| (w; times 4,
//! 6, 4 for the inner ones), at any time in any interval (`docs/exactness.md`, "The filter for
//! moving elements"). NaN and overflow end as unsure.

use super::number::Number;

/// The difference polygon of pairs of moving elements: a triangle or a parallelogram.
///
/// The number of corners is a value, not a type parameter: the functions below are long, and this
/// compiles them only once per instruction set.
#[derive(Clone, Copy)]
pub struct PolygonMotion<T: Number> {
    /// 3 or 4.
    n_corners: usize,
    /// At the start and at the end.
    corners: [[[T; 3]; 4]; 2],
    /// From each corner to the next. Only two for a parallelogram: the others are their opposites.
    edges: [[[T; 3]; 3]; 2],
    /// The largest coordinate of a corner, at either end.
    corner_sizes: [T; 4],
    edge_sizes: [T; 3],
    /// The lanes in which all of this is within the range of the error bounds.
    is_small: T::Mask,
    /// Whether coordinates may differ from these.
    has_margin: bool,
}

/// The result of [`PolygonMotion::look`] for an interval.
#[derive(Clone, Copy)]
pub struct Look<T: Number> {
    /// Certainly no contact.
    pub no: T::Mask,
    /// Else: f certainly has one root inside.
    pub single: T::Mask,
    /// Nothing is certain, and nothing will be in shorter intervals.
    pub hopeless: T::Mask,
}

/// The result of [`PolygonMotion::enclose`] for an interval in which f has one root.
#[derive(Clone, Copy)]
pub struct Enclosed<T: Number> {
    /// Certainly contact at the root.
    pub inside: T::Mask,
    /// Certainly no contact at the root.
    pub outside: T::Mask,
    /// The root is inside [`first`, `last`].
    pub first: T,
    pub last: T,
    /// `first` and `last` are so close that halving the interval does not help.
    pub is_short: T::Mask,
}

/// Which Bernstein coefficients of f over an interval are certainly positive, and which certainly
/// negative.
struct Cubic<T: Number> {
    positive: [T::Mask; 4],
    negative: [T::Mask; 4],
}

impl<T: Number> Cubic<T> {
    #[inline(always)]
    fn new(f: &[T; 4], bound: T, inner_bound: T) -> Self {
        let zero = T::splat(0.0);
        Self {
            positive: [
                f[0].gt(bound),
                f[1].gt(inner_bound),
                f[2].gt(inner_bound),
                f[3].gt(bound),
            ],
            negative: [
                (zero - bound).gt(f[0]),
                (zero - inner_bound).gt(f[1]),
                (zero - inner_bound).gt(f[2]),
                (zero - bound).gt(f[3]),
            ],
        }
    }

    #[inline(always)]
    fn has_no_root(&self) -> T::Mask {
        let ([a, b, c, d], [e, f, g, h]) = (self.positive, self.negative);
        (a & b & c & d) | (e & f & g & h)
    }

    /// Whether the signs certainly change once: the outer coefficients have opposite signs, and
    /// some inner one does not have the sign of the outer one farther away.
    #[inline(always)]
    fn has_one_root(&self) -> T::Mask {
        let ([a, b, c, d], [e, f, g, h]) = (self.positive, self.negative);
        (a & h & (b | g)) | (e & d & (f | c))
    }

    /// Whether the sign of any coefficient is certain. If not, none will be over shorter intervals.
    #[inline(always)]
    fn is_sure_anywhere(&self) -> T::Mask {
        let ([a, b, c, d], [e, f, g, h]) = (self.positive, self.negative);
        a | b | c | d | e | f | g | h
    }
}

/// A point or a direction, one pair per lane.
pub type Vec3<T> = [T; 3];

// Here and below no closures are passed to library functions: those would be compiled on their
// own, without the instruction set, and every operation would become a call.

impl<T: Number> PolygonMotion<T> {
    /// A vertex, point 0, and a face, points 1 to 3; or two edges, points 0 and 1, and points 2 and
    /// 3.
    #[inline(always)]
    pub fn new(are_edges: bool, start: &[Vec3<T>; 4], end: &[Vec3<T>; 4]) -> Self {
        if are_edges {
            Self::of(
                4,
                [edge_corners(start), edge_corners(end)],
                [edge_edges(start), edge_edges(end)],
            )
        } else {
            Self::of(
                3,
                [face_corners(start), face_corners(end)],
                [face_edges(start), face_edges(end)],
            )
        }
    }
}

#[inline(always)]
fn face_corners<T: Number>([p, a, b, c]: &[Vec3<T>; 4]) -> [Vec3<T>; 4] {
    let zero = T::splat(0.0);
    [
        difference(a, p),
        difference(b, p),
        difference(c, p),
        [zero, zero, zero],
    ]
}

#[inline(always)]
fn face_edges<T: Number>([_, a, b, c]: &[Vec3<T>; 4]) -> [Vec3<T>; 3] {
    [difference(b, a), difference(c, b), difference(a, c)]
}

#[inline(always)]
fn edge_corners<T: Number>([p, q, r, s]: &[Vec3<T>; 4]) -> [Vec3<T>; 4] {
    [
        difference(p, r),
        difference(q, r),
        difference(q, s),
        difference(p, s),
    ]
}

#[inline(always)]
fn edge_edges<T: Number>([p, q, r, s]: &[Vec3<T>; 4]) -> [Vec3<T>; 3] {
    let zero = T::splat(0.0);
    [difference(q, p), difference(r, s), [zero, zero, zero]]
}

impl<T: Number> PolygonMotion<T> {
    #[inline(always)]
    fn of(n_corners: usize, corners: [[Vec3<T>; 4]; 2], edges: [[Vec3<T>; 3]; 2]) -> Self {
        let zero = T::splat(0.0);
        let mut motion = Self {
            n_corners,
            corners,
            edges,
            corner_sizes: [zero; 4],
            edge_sizes: [zero; 3],
            is_small: zero.gt(zero),
            has_margin: false,
        };
        let mut largest = zero;
        for ix in 0..n_corners {
            let [start, end] = &motion.corners;
            motion.corner_sizes[ix] = size(&start[ix]).larger(size(&end[ix]));
            largest = largest.larger(motion.corner_sizes[ix]);
        }
        for ix in 0..motion.n_edges() {
            let [start, end] = &motion.edges;
            motion.edge_sizes[ix] = size(&start[ix]).larger(size(&end[ix]));
            largest = largest.larger(motion.edge_sizes[ix]);
        }
        motion.is_small = T::splat(T::LARGEST).gt(largest);
        motion
    }

    /// The same elements, where at any time each coordinate of a corner and of an edge may differ
    /// from the given one by up to `margin`: what is certainly apart is so for all of these.
    #[inline(always)]
    #[must_use]
    pub fn with_margin(mut self, margin: f64) -> Self {
        if margin == 0.0 {
            return self;
        }
        let mut least = self.corner_sizes[0];
        for ix in 1..self.n_corners {
            least = smaller(least, self.corner_sizes[ix]);
        }
        for ix in 0..self.n_edges() {
            least = smaller(least, self.edge_sizes[ix]);
        }
        // Every bound has the size of one corner as a factor. `BOUND` is 64 unit roundoffs.
        let times = T::splat(1.0) + T::splat(16.0 * margin / T::BOUND) / least;
        for size in &mut self.corner_sizes {
            *size = *size * times;
        }
        self.has_margin = true;
        self
    }

    /// The number of edges that are stored.
    #[inline(always)]
    fn n_edges(&self) -> usize {
        if self.n_corners == 3 { 3 } else { 2 }
    }

    /// The lanes whose elements are certainly apart from t = 0 to `until`: the cheap first step,
    /// [`are_far`](Self::are_far) and [`are_across`](Self::are_across), and for edges
    /// [`are_beside`](Self::are_beside).
    #[inline(always)]
    #[must_use]
    pub fn are_apart(&self, until: f64) -> T::Mask {
        let apart = self.are_far(until) | self.are_across(until);
        if self.n_corners == 3 {
            return apart;
        }
        apart | self.are_beside(until)
    }

    /// The lanes whose elements are certainly apart from t = 0 to `until`: they are apart on an
    /// axis or along the sum of all corners, at both ends of that time.
    #[inline(always)]
    #[must_use]
    pub fn are_far(&self, until: f64) -> T::Mask {
        let [start, end] = self.corners_until(until);
        let mut sum = start[0];
        let mut size = self.corner_sizes[0];
        for ix in 0..self.n_corners {
            size = size.larger(self.corner_sizes[ix]);
            for axis in 0..3 {
                sum[axis] = sum[axis] + end[ix][axis];
                if ix > 0 {
                    sum[axis] = sum[axis] + start[ix][axis];
                }
            }
        }
        let (start, end) = (&start[..self.n_corners], &end[..self.n_corners]);
        // At t = 1 only differences are rounded, and their signs are right; but infinite ones make
        // others NaN, which minima lose.
        let bound = if until == 1.0 && !self.has_margin {
            T::splat(0.0) * size
        } else {
            T::splat(T::BOUND / 4.0) * size + T::splat(T::TINY[0])
        };
        (are_before(&sum, start, end, size) & self.is_small)
            | are_apart_on_an_axis(start, end, bound)
    }

    /// The lanes whose elements are certainly apart from t = 0 to `until`: they are apart along a
    /// normal at both ends of that time, or f has one sign.
    #[inline(always)]
    #[must_use]
    pub fn are_across(&self, until: f64) -> T::Mask {
        let t = T::splat(until);
        let [start, end] = self.corners_until(until);
        let mut size = self.corner_sizes[0];
        for ix in 1..self.n_corners {
            size = size.larger(self.corner_sizes[ix]);
        }
        let (start, end) = (&start[..self.n_corners], &end[..self.n_corners]);
        let edges = [
            [self.edges[0][0], self.edge_at(0, t)],
            [self.edges[0][1], self.edge_at(1, t)],
        ];
        let normal = cross_over(&edges[0], &edges[1]);
        let along =
            are_before(&normal[0], start, end, size) | are_before(&normal[2], start, end, size);
        let cubic = self.signs(&cubic(&normal, &[start[0], end[0]]));
        (along | cubic.has_no_root()) & self.is_small
    }

    /// The lanes whose edges are certainly apart from t = 0 to `until`: they are apart along the
    /// way from the line of the first edge to the origin, at both ends of that time. Parallel edges
    /// have no normal, and all their w are zero.
    #[inline(always)]
    #[must_use]
    pub fn are_beside(&self, until: f64) -> T::Mask {
        let t = T::splat(until);
        let [start, end] = self.corners_until(until);
        let (edge, other) = (self.edges[0][0], self.edge_at(0, t));
        let edge = [edge[0] + other[0], edge[1] + other[1], edge[2] + other[2]];
        let corner = [
            start[0][0] + end[0][0],
            start[0][1] + end[0][1],
            start[0][2] + end[0][2],
        ];
        let share = dot(&edge, &corner) / dot(&edge, &edge);
        let way = [
            corner[0] - edge[0] * share,
            corner[1] - edge[1] * share,
            corner[2] - edge[2] * share,
        ];
        let mut size = self.corner_sizes[0];
        for ix in 1..self.n_corners {
            size = size.larger(self.corner_sizes[ix]);
        }
        let (start, end) = (&start[..self.n_corners], &end[..self.n_corners]);
        are_before(&way, start, end, size) & self.is_small
    }

    /// The lanes whose elements are certainly apart from t = 0 to `until`: some w is negative, or
    /// edges [are beside](Self::are_beside) each other.
    #[inline(always)]
    #[must_use]
    pub fn are_aside(&self, until: f64) -> T::Mask {
        let (zero, t) = (T::splat(0.0), T::splat(until));
        let mut edges = [[[zero; 3]; 2]; 3];
        for (ix, edge) in edges.iter_mut().enumerate().take(self.n_edges()) {
            *edge = [self.edges[0][ix], self.edge_at(ix, t)];
        }
        let normal = cross_over(&edges[0], &edges[1]);
        let edges_size = self.edge_sizes[0] * self.edge_sizes[1];
        let mut outside = zero.gt(zero);
        for ix in 0..self.n_corners {
            let corner = [self.corners[0][ix], self.corner_at(ix, t)];
            outside = outside | self.sides(&normal, &corner, &edges, ix, edges_size).1;
        }
        if self.n_corners == 4 {
            outside = outside | self.are_beside(until);
        }
        outside & self.is_small
    }

    /// The corners at the start and at a time.
    #[inline(always)]
    fn corners_until(&self, until: f64) -> [[Vec3<T>; 4]; 2] {
        let t = T::splat(until);
        let start = self.corners[0];
        let mut end = start;
        for (ix, corner) in end.iter_mut().enumerate().take(self.n_corners) {
            *corner = self.corner_at(ix, t);
        }
        [start, end]
    }

    /// Tests an interval [a, b].
    #[inline(always)]
    #[must_use]
    pub fn look(&self, a: T, b: T) -> Look<T> {
        let mut edges = [[[a; 3]; 2]; 3];
        for (ix, edge) in edges.iter_mut().enumerate().take(self.n_edges()) {
            *edge = self.edge_over(ix, a, b);
        }
        let normal = cross_over(&edges[0], &edges[1]);
        let cubic = self.signs(&cubic(&normal, &self.corner_over(0, a, b)));
        let (_, outside) = self.sides_over(&normal, &edges, a, b);
        let no = self.is_small & (cubic.has_no_root() | outside);
        Look {
            no,
            single: self.is_small & !no & cubic.has_one_root(),
            hopeless: !self.is_small | !cubic.is_sure_anywhere(),
        }
    }

    /// If f has one root in [low, high]: a short interval that has it, and whether there is
    /// contact.
    #[inline(always)]
    #[must_use]
    pub fn enclose(&self, low: T, high: T) -> Enclosed<T> {
        let [first, last] = self.narrowed(low, high);
        let mut edges = [[[low; 3]; 2]; 3];
        for (ix, edge) in edges.iter_mut().enumerate().take(self.n_edges()) {
            *edge = self.edge_over(ix, first, last);
        }
        let normal = cross_over(&edges[0], &edges[1]);
        let (inside, outside) = self.sides_over(&normal, &edges, first, last);
        Enclosed {
            inside,
            outside,
            first,
            last,
            is_short: ((high - low) * T::splat(0.25)).gt(last - first),
        }
    }

    /// The certain signs of f's coefficients.
    #[inline(always)]
    fn signs(&self, f: &[T; 4]) -> Cubic<T> {
        let tiny = T::splat(T::TINY[1]);
        let sizes = self.edge_sizes[0] * self.edge_sizes[1] * self.corner_sizes[0];
        let bound = T::splat(2.0 * T::BOUND) * sizes + tiny;
        let inner_bound = T::splat(6.0 * T::BOUND) * sizes + tiny;
        Cubic::new(f, bound, inner_bound)
    }

    /// Whether over [a, b] all w are certainly positive, and whether some w is certainly negative.
    #[inline(always)]
    fn sides_over(
        &self,
        normal: &[Vec3<T>; 3],
        edges: &[[Vec3<T>; 2]; 3],
        a: T,
        b: T,
    ) -> (T::Mask, T::Mask) {
        let zero = T::splat(0.0);
        let edges_size = self.edge_sizes[0] * self.edge_sizes[1];
        let (mut inside, mut outside) = (!zero.gt(zero), zero.gt(zero));
        for ix in 0..self.n_corners {
            let corner = self.corner_over(ix, a, b);
            let (positive, negative) = self.sides(normal, &corner, edges, ix, edges_size);
            inside = inside & positive;
            outside = outside | negative;
        }
        (inside, outside)
    }

    /// f over an interval: f_0, 3 f_1, 3 f_2, f_3.
    #[inline(always)]
    fn f_over(&self, a: T, b: T) -> [T; 4] {
        let normal = cross_over(&self.edge_over(0, a, b), &self.edge_over(1, a, b));
        cubic(&normal, &self.corner_over(0, a, b))
    }

    /// Whether all coefficients of w over an interval are certainly positive, and whether all are
    /// certainly negative.
    #[inline(always)]
    fn sides(
        &self,
        normal: &[Vec3<T>; 3],
        corner: &[Vec3<T>; 2],
        edges: &[[Vec3<T>; 2]; 3],
        ix: usize,
        edges_size: T,
    ) -> (T::Mask, T::Mask) {
        let is_kept = ix < self.n_edges();
        let kept = if is_kept { ix } else { ix - self.n_edges() };
        let moment = cross_over(corner, &edges[kept]);
        // w_0, 4 w_1, 6 w_2, 4 w_3, w_4.
        let w = [
            dot(&normal[0], &moment[0]),
            dot(&normal[0], &moment[1]) + dot(&normal[1], &moment[0]),
            dot(&normal[0], &moment[2]) + dot(&normal[1], &moment[1]) + dot(&normal[2], &moment[0]),
            dot(&normal[1], &moment[2]) + dot(&normal[2], &moment[1]),
            dot(&normal[2], &moment[2]),
        ];
        let sizes = edges_size * (self.corner_sizes[ix] * self.edge_sizes[kept]);
        let bound = T::splat(6.0 * T::BOUND) * sizes;
        let tiny = T::splat(T::TINY[2]);
        let outer = bound + tiny;
        let next = bound * T::splat(4.0) + tiny;
        let middle = bound * T::splat(6.0) + tiny;
        let zero = T::splat(0.0);
        let positive =
            w[0].gt(outer) & w[1].gt(next) & w[2].gt(middle) & w[3].gt(next) & w[4].gt(outer);
        let negative = (zero - outer).gt(w[0])
            & (zero - next).gt(w[1])
            & (zero - middle).gt(w[2])
            & (zero - next).gt(w[3])
            & (zero - outer).gt(w[4]);
        if is_kept {
            (positive, negative)
        } else {
            // The edge from this corner is the opposite of the stored one.
            (negative, positive)
        }
    }

    /// If [low, high] has one root of f: an interval inside it, as short as rounding allows, that
    /// certainly has the root.
    #[inline(always)]
    fn narrowed(&self, low: T, high: T) -> [T; 2] {
        let (zero, one, two, three) = (T::splat(0.0), T::splat(1.0), T::splat(2.0), T::splat(3.0));
        let f = self.f_over(low, high);
        let is_rising = f[3].gt(f[0]);
        // f in powers of s, a share of the interval. Newton's method starts at the root of the
        // chord and is kept inside.
        let powers = [
            f[0],
            f[1] - three * f[0],
            three * f[0] - two * f[1] + f[2],
            f[3] - f[2] + f[1] - f[0],
        ];
        let (mut before, mut after) = (zero, one);
        let mut s = f[0] / (f[0] - f[3]);
        let mut slope = one;
        for _ in 0..N_NEWTON {
            let value = ((powers[3] * s + powers[2]) * s + powers[1]) * s + powers[0];
            slope = (three * powers[3] * s + two * powers[2]) * s + powers[1];
            let is_before = is_rising ^ value.gt(zero);
            before = T::select(is_before, s, before);
            after = T::select(is_before, after, s);
            let next = s - value / slope;
            let is_inside = !before.gt(next) & !next.gt(after);
            s = T::select(is_inside, next, (before + after) * T::splat(0.5));
        }
        let length = high - low;
        let root = low + s * length;
        let bound = self.f_at(root).1;
        // At this distance from the root f is certain, if its slope stays the same; else sixteen
        // times as far.
        let reach = bound * T::splat(1.5) * length / slope.abs() + root * T::splat(T::BOUND / 16.0);
        let (mut first, mut last) = (low, high);
        for widening in WIDENINGS {
            let reach = reach * T::splat(widening);
            let (before, after) = (root - reach, root + reach);
            let f_before = self.f_at(before).0;
            let f_after = self.f_at(after).0;
            let has_passed = certainly(is_rising, f_before, bound, true);
            first = T::select(before.gt(first) & has_passed, before, first);
            let has_passed = certainly(is_rising, f_after, bound, false);
            last = T::select(last.gt(after) & has_passed, after, last);
        }
        [first, last]
    }

    /// f at one time, and the bound of its error.
    #[inline(always)]
    fn f_at(&self, t: T) -> (T, T) {
        let normal = cross(&self.edge_at(0, t), &self.edge_at(1, t));
        let sizes = self.edge_sizes[0] * self.edge_sizes[1] * self.corner_sizes[0];
        let bound = T::splat(2.0 * T::BOUND) * sizes + T::splat(T::TINY[1]);
        (dot(&normal, &self.corner_at(0, t)), bound)
    }

    #[inline(always)]
    fn corner_at(&self, ix: usize, t: T) -> Vec3<T> {
        between(&self.corners[0][ix], &self.corners[1][ix], t)
    }

    #[inline(always)]
    fn edge_at(&self, ix: usize, t: T) -> Vec3<T> {
        between(&self.edges[0][ix], &self.edges[1][ix], t)
    }

    #[inline(always)]
    fn corner_over(&self, ix: usize, a: T, b: T) -> [Vec3<T>; 2] {
        [self.corner_at(ix, a), self.corner_at(ix, b)]
    }

    #[inline(always)]
    fn edge_over(&self, ix: usize, a: T, b: T) -> [Vec3<T>; 2] {
        [self.edge_at(ix, a), self.edge_at(ix, b)]
    }
}

/// Steps of Newton's method: nearly always enough from the root of a chord to the last bits of an
/// `f64`.
const N_NEWTON: usize = 8;

/// The widths that are tried for the interval around a root, relative to the likely width; the
/// narrowest certain one counts.
const WIDENINGS: [f64; 2] = [16.0, 1.0];

/// f = N . V over an interval: f_0, 3 f_1, 3 f_2, f_3.
#[inline(always)]
fn cubic<T: Number>(normal: &[Vec3<T>; 3], corner: &[Vec3<T>; 2]) -> [T; 4] {
    [
        dot(&normal[0], &corner[0]),
        dot(&normal[0], &corner[1]) + dot(&normal[1], &corner[0]),
        dot(&normal[1], &corner[1]) + dot(&normal[2], &corner[0]),
        dot(&normal[2], &corner[1]),
    ]
}

/// Whether on some axis all corners at both ends are farther from the origin than a bound, on the
/// same side.
#[inline(always)]
fn are_apart_on_an_axis<T: Number>(start: &[Vec3<T>], end: &[Vec3<T>], bound: T) -> T::Mask {
    let (mut least, mut most) = (start[0], start[0]);
    for (start, end) in start.iter().zip(end) {
        for axis in 0..3 {
            let (x, y) = (start[axis], end[axis]);
            most[axis] = most[axis].larger(x).larger(y);
            least[axis] = smaller(smaller(least[axis], x), y);
        }
    }
    let opposite = T::splat(0.0) - bound;
    (opposite.gt(most[0]) | opposite.gt(most[1]) | opposite.gt(most[2]))
        | (least[0].gt(bound) | least[1].gt(bound) | least[2].gt(bound))
}

/// Whether all corners at both ends are certainly on one side of the plane through the origin with
/// this normal, which is taken as exact. `corner_size` is the largest one.
#[inline(always)]
fn are_before<T: Number>(
    normal: &Vec3<T>,
    start: &[Vec3<T>],
    end: &[Vec3<T>],
    corner_size: T,
) -> T::Mask {
    let bound = T::splat(T::BOUND) * (size(normal) * corner_size) + T::splat(T::TINY[0]);
    let first = dot(normal, &start[0]);
    let (mut least, mut most) = (first, first);
    for (start, end) in start.iter().zip(end) {
        let (x, y) = (dot(normal, start), dot(normal, end));
        most = most.larger(x).larger(y);
        least = smaller(smaller(least, x), y);
    }
    least.gt(bound) | (T::splat(0.0) - bound).gt(most)
}

/// Whether a value certainly has the sign that f has before (or after) its root.
#[inline(always)]
fn certainly<T: Number>(is_rising: T::Mask, value: T, bound: T, before: bool) -> T::Mask {
    let is_positive = value.gt(bound);
    let is_negative = (T::splat(0.0) - bound).gt(value);
    if before {
        (is_rising & is_negative) | (!is_rising & is_positive)
    } else {
        (is_rising & is_positive) | (!is_rising & is_negative)
    }
}

#[inline(always)]
fn smaller<T: Number>(a: T, b: T) -> T {
    T::select(b.gt(a), a, b)
}

#[inline(always)]
pub(crate) fn between<T: Number>(p: &Vec3<T>, q: &Vec3<T>, t: T) -> Vec3<T> {
    let rest = T::splat(1.0) - t;
    [
        p[0] * rest + q[0] * t,
        p[1] * rest + q[1] * t,
        p[2] * rest + q[2] * t,
    ]
}

/// Bernstein coefficients of the cross product of two moving vectors: the first, twice the middle
/// one, the last.
#[inline(always)]
fn cross_over<T: Number>(d: &[Vec3<T>; 2], e: &[Vec3<T>; 2]) -> [Vec3<T>; 3] {
    let (one, two) = (cross(&d[0], &e[1]), cross(&d[1], &e[0]));
    [
        cross(&d[0], &e[0]),
        [one[0] + two[0], one[1] + two[1], one[2] + two[2]],
        cross(&d[1], &e[1]),
    ]
}

/// The cross product, each difference of products rounded as it stands.
#[inline(always)]
pub fn cross<T: Number>(d: &Vec3<T>, e: &Vec3<T>) -> Vec3<T> {
    [
        d[1] * e[2] - d[2] * e[1],
        d[2] * e[0] - d[0] * e[2],
        d[0] * e[1] - d[1] * e[0],
    ]
}

/// The scalar product, summed from the left.
#[inline(always)]
pub fn dot<T: Number>(d: &Vec3<T>, e: &Vec3<T>) -> T {
    d[0] * e[0] + d[1] * e[1] + d[2] * e[2]
}

/// The first less the second.
#[inline(always)]
pub fn difference<T: Number>(p: &Vec3<T>, q: &Vec3<T>) -> Vec3<T> {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

/// The largest magnitude of the three coordinates.
#[inline(always)]
pub fn size<T: Number>(d: &Vec3<T>) -> T {
    d[0].abs().larger(d[1].abs()).larger(d[2].abs())
}
