//! The filter of the GPU for moving elements, as `docs/exactness.md` specifies it, in the model of
//! WGSL's arithmetic of `bound`. Signs that it calls certain must be right, for the whole step and
//! for intervals of it. Elements that it drops must not touch, all others not before the one time
//! that it says, and certainly before the other one.

use super::bound::{Device, LARGEST, NARROWING, SMALLEST};
use super::generators::{Kind, Random};
use impinge_core::exact::{ElementPair, first_contact};

const TINY: f32 = f32::from_bits((127 - 76) << 23);
const OF_CUBIC: f32 = 1.0 / 65_536.0;
const OF_QUARTIC: f32 = 1.0 / 16_384.0;
const OF_SUM: f32 = 1.0 / 8192.0;
const INNER: f32 = 5.0;
const NEXT: f32 = 8.0;
const MIDDLE: f32 = 16.0;
const TICKS: u32 = 1 << 24;
const TICK: f32 = 1.0 / 16_777_216.0;
const SHORTEST: u32 = 1 << 14;
const N_INTERVALS: u32 = 32;

#[cfg(feature = "gpu")]
#[test]
fn constants_are_those_of_the_kernel() {
    let mut shaders = impinge_core::gpu::shaders();
    // It has the texts of `narrow_moving`, too.
    let (_, text) = shaders
        .find(|(name, _)| *name == "narrow_search")
        .expect("a kernel");
    for line in [
        format!("const N_INTERVALS: u32 = {N_INTERVALS}u;"),
        format!("const TICKS: u32 = {TICKS:#x}u;"),
        format!("const SHORTEST: u32 = {SHORTEST:#x}u;"),
    ] {
        assert!(text.contains(&line), "{line}");
    }
    for (name, value, written) in [
        ("TINY", TINY, "0x1p-76f"),
        ("OF_CUBIC", OF_CUBIC, "0x1p-16f"),
        ("OF_QUARTIC", OF_QUARTIC, "0x1p-14f"),
        ("OF_SUM", OF_SUM, "0x1p-13f"),
        ("INNER", INNER, "5.0"),
        ("NEXT", NEXT, "8.0"),
        ("MIDDLE", MIDDLE, "16.0"),
        ("TICK", TICK, "0x1p-24f"),
    ] {
        assert!(
            text.contains(&format!("const {name}: f32 = {written};")),
            "{name}"
        );
        let decimal = match written.strip_prefix("0x1p-") {
            Some(power) => 2f32.powi(-power.trim_end_matches('f').parse::<i32>().expect("a power")),
            None => written.parse().expect("a number"),
        };
        assert_eq!(value, decimal, "{name}");
    }
}

/// A vector at the start and at the end.
type Moving<T> = [[T; 3]; 2];

/// The difference polygon: corners, and edges from the first three of them.
struct Polygon<T> {
    corners: [Moving<T>; 4],
    edges: [Moving<T>; 3],
}

impl<T: Copy> Polygon<T> {
    /// From the points of a pair, at the start and at the end.
    fn new(pair: ElementPair, points: &[[[T; 3]; 4]; 2], mut minus: impl FnMut(T, T) -> T) -> Self {
        let mut between = |i: usize, j: usize| -> Moving<T> {
            points.map(|p| std::array::from_fn(|axis| minus(p[i][axis], p[j][axis])))
        };
        match pair {
            ElementPair::EdgeEdge => Polygon {
                corners: [between(0, 2), between(1, 2), between(1, 3), between(0, 3)],
                edges: [between(1, 0), between(2, 3), between(0, 1)],
            },
            _ => Polygon {
                corners: [between(1, 0), between(2, 0), between(3, 0), between(3, 0)],
                edges: [between(2, 1), between(3, 2), between(1, 3)],
            },
        }
    }
}

impl<T: Copy> Polygon<T> {
    /// The polygon at the ends of an interval. `at`: a number that moves, at the first or at the
    /// second of them.
    fn over(&self, mut at: impl FnMut([T; 2], usize) -> T) -> Self {
        let mut over = |[start, end]: &Moving<T>| -> Moving<T> {
            [0, 1].map(|ix| std::array::from_fn(|axis| at([start[axis], end[axis]], ix)))
        };
        Polygon {
            corners: self.corners.each_ref().map(&mut over),
            edges: self.edges.each_ref().map(&mut over),
        }
    }
}

/// A sum of products of numbers: exact, or as a device computes it.
trait Sum {
    type Number: Copy;
    fn negated(x: Self::Number) -> Self::Number;
    fn of(&mut self, monomials: &[Vec<Self::Number>]) -> Self::Number;
}

/// Exact integers.
struct Exactly;

impl Sum for Exactly {
    type Number = i128;
    fn negated(x: i128) -> i128 {
        -x
    }
    fn of(&mut self, monomials: &[Vec<i128>]) -> i128 {
        monomials
            .iter()
            .map(|factors| factors.iter().product::<i128>())
            .sum()
    }
}

impl Sum for Device<'_> {
    type Number = f32;
    fn negated(x: f32) -> f32 {
        -x
    }
    fn of(&mut self, monomials: &[Vec<f32>]) -> f32 {
        let mut terms: Vec<f32> = monomials
            .iter()
            .map(|factors| self.product(factors))
            .collect();
        // Mostly in the order in which they are written, in which terms cancel late; else in any
        // order.
        let shuffled = self.below(2) == 0;
        while terms.len() > 1 {
            let n = terms.len() as u64;
            let first = if shuffled { self.below(n) as usize } else { 0 };
            let x = terms.remove(first);
            let second = if shuffled {
                self.below(n - 1) as usize
            } else {
                0
            };
            let y = terms.remove(second);
            terms.insert(0, self.add(x, y));
        }
        terms[0]
    }
}

const CYCLES: [[usize; 3]; 3] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];

/// The monomials of each coordinate of d x e.
fn cross<S: Sum>(d: [S::Number; 3], e: [S::Number; 3]) -> [[Vec<S::Number>; 2]; 3] {
    [1, 2, 0].map(|ix: usize| {
        let [i, j, _] = CYCLES[ix];
        [vec![d[i], e[j]], vec![S::negated(d[j]), e[i]]]
    })
}

/// The sum of all d x e . v.
fn triples<S: Sum>(sum: &mut S, terms: &[[[S::Number; 3]; 3]]) -> S::Number {
    let mut monomials = Vec::new();
    for &[d, e, v] in terms {
        for (axis, normal) in cross::<S>(d, e).into_iter().enumerate() {
            for mut factors in normal {
                factors.push(v[axis]);
                monomials.push(factors);
            }
        }
    }
    sum.of(&monomials)
}

/// The sum of all (d x e) . (c x g).
fn quadruples<S: Sum>(sum: &mut S, terms: &[[[S::Number; 3]; 4]]) -> S::Number {
    let mut monomials = Vec::new();
    for &[d, e, c, g] in terms {
        for (first, second) in cross::<S>(d, e).iter().zip(&cross::<S>(c, g)) {
            for p in first {
                for q in second {
                    monomials.push([&p[..], &q[..]].concat());
                }
            }
        }
    }
    sum.of(&monomials)
}

/// f_0, 3 f_1, 3 f_2, f_3.
fn cubic<S: Sum>(sum: &mut S, polygon: &Polygon<S::Number>) -> [S::Number; 4] {
    let ([d, e, _], v) = (polygon.edges, polygon.corners[0]);
    let term = |[i, j, k]: [usize; 3]| [d[i], e[j], v[k]];
    [
        triples(sum, &[[0, 0, 0]].map(term)),
        triples(sum, &[[0, 0, 1], [0, 1, 0], [1, 0, 0]].map(term)),
        triples(sum, &[[0, 1, 1], [1, 0, 1], [1, 1, 0]].map(term)),
        triples(sum, &[[1, 1, 1]].map(term)),
    ]
}

/// w_0, 4 w_1, 6 w_2, 4 w_3, w_4 of one edge.
fn quartic<S: Sum>(sum: &mut S, polygon: &Polygon<S::Number>, ix: usize) -> [S::Number; 5] {
    let [d, e, _] = polygon.edges;
    let c = polygon.corners[ix];
    let g = match ix {
        3 => polygon.edges[1].map(|edge| edge.map(S::negated)),
        ix => polygon.edges[ix],
    };
    std::array::from_fn(|n_late| {
        let all = (0..16usize).filter(|bits| bits.count_ones() as usize == n_late);
        let at = |bits: usize, k: usize| bits >> k & 1;
        let terms = all.map(|bits| {
            [
                d[at(bits, 0)],
                e[at(bits, 1)],
                c[at(bits, 2)],
                g[at(bits, 3)],
            ]
        });
        quadruples(sum, &Vec::from_iter(terms))
    })
}

/// n . V for all corners at both ends, for n the sum of all corners, N(0) and N(1).
fn along<S: Sum>(
    sum: &mut S,
    polygon: &Polygon<S::Number>,
    n_corners: usize,
) -> [Vec<S::Number>; 3] {
    let corners = polygon.corners[..n_corners].as_flattened();
    let [d, e, _] = polygon.edges;
    let of_sum = corners.iter().map(|v| {
        let monomials = corners
            .iter()
            .flat_map(|w| (0..3).map(|axis| vec![w[axis], v[axis]]));
        sum.of(&Vec::from_iter(monomials))
    });
    let of_sum = of_sum.collect();
    let [first, last] = [0, 1].map(|end| {
        let values = corners
            .iter()
            .map(|v| triples(sum, &[[d[end], e[end], *v]]));
        values.collect()
    });
    [of_sum, first, last]
}

fn size(d: &Moving<f32>) -> f32 {
    d.as_flattened()
        .iter()
        .fold(0.0, |size: f32, x| size.max(x.abs()))
}

/// The kernel's values with their bounds, by test: a direction or a polynomial.
struct Values {
    along: [(Vec<f32>, f32); 3],
    cubic: [(f32, f32); 4],
    quartics: Vec<[(f32, f32); 5]>,
}

/// The polygon, and the sizes of its corners and edges over the whole step.
struct Pair {
    pair: ElementPair,
    polygon: Polygon<f32>,
    corners: [f32; 4],
    edges: [f32; 3],
    wide: f32,
    slack: f32,
}

/// A pair as the kernels load it. `None` if it is unsure at once.
fn load(
    device: &mut Device<'_>,
    pair: ElementPair,
    points: &[[[f32; 3]; 4]; 2],
    narrowing: f32,
) -> Option<Pair> {
    let mut polygon = Polygon::new(pair, points, |x, y| device.add(x, -y));
    let widest = polygon.corners.iter().map(size).fold(0.0, f32::max);
    let largest = polygon.edges.iter().map(size).fold(widest, f32::max);
    if largest < SMALLEST || largest < narrowing {
        return None;
    }
    let scale = f32::from_bits((254 - (largest.to_bits() >> 23)) << 23);
    let all = polygon.corners.iter_mut().chain(&mut polygon.edges);
    for x in all.flatten().flatten() {
        *x = device.product(&[*x, scale]);
    }
    let slack = device.product(&[narrowing, scale]);
    let wide = device.product(&[widest, scale]);
    let wide = device.add(wide, slack);
    let corners = polygon.corners.map(|d| device.add(size(&d), slack));
    let edges = polygon.edges.map(|d| device.add(size(&d), slack));
    Some(Pair {
        pair,
        polygon,
        corners,
        edges,
        wide,
        slack,
    })
}

/// The bounds that the kernels compute, and the values under the model: for the whole step, or for
/// an interval of it.
fn values(device: &mut Device<'_>, loaded: &Pair, interval: Option<[f32; 2]>) -> Values {
    let &Pair {
        pair, wide, slack, ..
    } = loaded;
    let polygon = loaded.polygon.over(|ends, ix| match interval {
        None => ends[ix],
        Some(times) => device.of(&[vec![ends[0], 1.0 - times[ix]], vec![ends[1], times[ix]]]),
    });
    let n_corners = if pair == ElementPair::EdgeEdge { 4 } else { 3 };
    let [d, e, _] = loaded.edges;
    let of_sum = device.of(&[
        vec![OF_SUM, wide, wide],
        vec![32.0, slack, wide],
        vec![TINY],
    ]);
    let bound = device.of(&[
        vec![OF_CUBIC, d, e, wide],
        vec![4.0, slack, d, e],
        vec![4.0, slack, d, wide],
        vec![4.0, slack, e, wide],
        vec![TINY],
    ]);
    let [sum, first, last] = along(device, &polygon, n_corners);
    let inner = device.product(&[INNER, bound]);
    let [f_0, f_1, f_2, f_3] = cubic(device, &polygon);
    let mut quartics = Vec::new();
    for ix in 0..n_corners {
        let c = loaded.corners[ix];
        let g = loaded.edges[ix % if n_corners == 4 { 2 } else { 3 }];
        let outer = device.of(&[
            vec![OF_QUARTIC, d, e, c, g],
            vec![8.0, slack, d, e, c],
            vec![8.0, slack, d, e, g],
            vec![8.0, slack, c, g, d],
            vec![8.0, slack, c, g, e],
            vec![TINY],
        ]);
        let [next, middle] = [NEXT, MIDDLE].map(|more| device.product(&[more, outer]));
        let bounds = [outer, next, middle, next, outer];
        let w = quartic(device, &polygon, ix);
        quartics.push(std::array::from_fn(|k| (w[k], bounds[k])));
    }
    Values {
        along: [(sum, of_sum), (first, bound), (last, bound)],
        cubic: [(f_0, bound), (f_1, inner), (f_2, inner), (f_3, bound)],
        quartics,
    }
}

fn are_all(values: impl Iterator<Item = (f32, f32)> + Clone) -> bool {
    values.clone().all(|(value, bound)| value > bound)
        || values.clone().all(|(value, bound)| value < -bound)
}

/// The kernel's decision: nothing is certain, or that elements do not touch, or that they do
/// between the ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Decided {
    Unclear,
    Free,
    Touches,
}

fn decide(values: &Values) -> Decided {
    let is_aside = |(along, bound): &(Vec<f32>, f32)| are_all(along.iter().map(|&x| (x, *bound)));
    let is_outside = |w: &[(f32, f32); 5]| w.iter().all(|(value, bound)| *value < -bound);
    let is_inside = |w: &[(f32, f32); 5]| w.iter().all(|(value, bound)| value > bound);
    let [(f_0, bound), (f_1, inner), (f_2, _), (f_3, _)] = values.cubic;
    let falls = f_0 > bound && f_3 < -bound && (f_1 > inner || f_2 < -inner);
    let rises = f_0 < -bound && f_3 > bound && (f_1 < -inner || f_2 > inner);
    if values.along.iter().any(is_aside)
        || are_all(values.cubic.iter().copied())
        || values.quartics.iter().any(is_outside)
    {
        Decided::Free
    } else if (falls || rises) && values.quartics.iter().all(is_inside) {
        Decided::Touches
    } else {
        Decided::Unclear
    }
}

/// What the second kernel finds: times in ticks, and whether the pair is left.
#[derive(Debug)]
struct Bracket {
    free_until: u32,
    touches_by: Option<u32>,
    is_left: bool,
}

/// The search of the second kernel. `end`: a time by which another pair touches.
fn bracket(device: &mut Device<'_>, loaded: &Pair, end: u32) -> Bracket {
    let mut found = Bracket {
        free_until: 0,
        touches_by: None,
        is_left: true,
    };
    let mut length = TICKS / 2;
    for _ in 0..N_INTERVALS {
        // The pair itself may touch before the other one.
        let end = found.touches_by.map_or(end, |time| time.min(end));
        let low = found.free_until;
        let high = u32::min(low + length, end);
        let interval = [low, high].map(|time| time as f32 * TICK);
        match decide(&values(device, loaded, Some(interval))) {
            Decided::Free => {
                found.free_until = high;
                length *= 2;
                if high == end {
                    found.is_left = false;
                    break;
                }
                continue;
            }
            Decided::Touches => found.touches_by = Some(high),
            Decided::Unclear => {}
        }
        if high - low <= SHORTEST {
            break;
        }
        length = (high - low) / 2;
    }
    found
}

const PAIRS: [ElementPair; 2] = [ElementPair::VertexFace, ElementPair::EdgeEdge];

/// How often values were certain, and how often their signs alone were wrong.
#[derive(Default)]
struct Seen {
    n: u32,
    n_sure: u32,
    n_wrong: u32,
}

impl Seen {
    fn check(&mut self, (value, bound): (f32, f32), exact: i128, what: &str) {
        self.n += 1;
        self.n_wrong += u32::from(value != 0.0 && (value > 0.0) != (exact > 0));
        if value.abs() > bound {
            self.n_sure += 1;
            assert_eq!(value > 0.0, exact > 0, "{what}: {value:e}, exactly {exact}");
            assert_ne!(exact, 0, "{what}: {value:e}");
        }
    }
}

#[test]
fn coefficients_are_right_where_they_are_sure() {
    let mut random = Random::new(50);
    let mut seen: [Seen; 3] = Default::default();
    for kind in [
        Kind::Lattice(3),
        Kind::Skewed(2),
        Kind::Planar(4),
        Kind::Skewed(1),
    ] {
        // From scales where the largest difference is barely above `SMALLEST`, up to `LARGEST`.
        for power in [0, -32, -55, 14] {
            for _ in 0..1000 {
                let points: [[f64; 3]; 8] = kind.points(&mut random);
                // Whole numbers, in `f32` too.
                let narrow = points.map(|p| p.map(|x| x as f32));
                let whole = narrow.map(|p| p.map(|x| x as i128));
                let halves = |p: [[f32; 3]; 8]| [0, 4].map(|k| std::array::from_fn(|i| p[k + i]));
                let scaled = narrow.map(|p| p.map(|x| x * 2f32.powi(power)));
                let whole = [0, 4].map(|k| std::array::from_fn(|i| whole[k + i]));
                let pair = random.pick(&PAIRS);
                // The whole step, or from one multiple of 1/32 to another: larger integers would be
                // too long.
                let low = random.below(32);
                let times = [low, low + 1 + random.below(32 - low)];
                let interval = (random.below(2) == 0).then_some(times.map(|t| t as f32 / 32.0));
                let mut device = Device(&mut random);
                let Some(loaded) = load(&mut device, pair, &halves(scaled), 0.0) else {
                    continue;
                };
                let values = values(&mut device, &loaded, interval);
                let mut exact = Polygon::new(pair, &whole, |x, y| x - y);
                if interval.is_some() {
                    exact = exact.over(|[x, y], ix| {
                        let time = i128::from(times[ix]);
                        x * (32 - time) + y * time
                    });
                }
                let what = format!("{pair:?} {kind:?} 2^{power} {interval:?} {narrow:?}");
                let n_corners = values.quartics.len();
                let exact_along = along(&mut Exactly, &exact, n_corners);
                for ((found, bound), exact) in values.along.iter().zip(&exact_along) {
                    for (&value, &exact) in found.iter().zip(exact) {
                        seen[0].check((value, *bound), exact, &what);
                    }
                }
                for (found, exact) in values.cubic.iter().zip(cubic(&mut Exactly, &exact)) {
                    seen[1].check(*found, exact, &what);
                }
                for (ix, found) in values.quartics.iter().enumerate() {
                    for (found, exact) in found.iter().zip(quartic(&mut Exactly, &exact, ix)) {
                        seen[2].check(*found, exact, &what);
                    }
                }
            }
        }
    }
    for (Seen { n, n_sure, n_wrong }, what) in seen.iter().zip(["directions", "cubic", "quartics"])
    {
        assert!(*n_sure > n / 10, "{what}: {n_sure} of {n} are sure");
        assert!(
            *n_wrong > 50,
            "{what}: the model is too kind, {n_wrong} of {n} signs are wrong"
        );
    }
}

#[test]
fn what_is_dropped_never_touches_and_times_are_right() {
    let mut random = Random::new(51);
    let (mut n, mut n_dropped, mut n_later, mut n_waiting) = (0, 0, 0, 0);
    let (mut n_touching, mut n_after) = (0, 0);
    for kind in Kind::ALL {
        for is_narrowed in [false, true] {
            for scale in [1.0, 2f64.powi(-29), 2f64.powi(10)] {
                for _ in 0..100 {
                    let points: [[f64; 3]; 8] = kind.points(&mut random);
                    let shift = random.pick(&[0.0, 1.0, 1000.0]);
                    let points = points.map(|p| {
                        p.map(|x| match is_narrowed {
                            // Smaller ones would be out of range.
                            true if x.abs() < 1e-60 => 0.0,
                            true => (x * 1.1 + shift) * scale,
                            false => f64::from((x * scale) as f32),
                        })
                    });
                    let narrow = points.map(|p| p.map(|x| x as f32));
                    let largest = narrow
                        .as_flattened()
                        .iter()
                        .fold(0.0, |m: f32, x| m.max(x.abs()));
                    // Larger ones are unsure at once, and so never dropped.
                    if largest.is_nan() || largest > LARGEST {
                        continue;
                    }
                    let narrowing = if is_narrowed {
                        NARROWING * largest
                    } else {
                        0.0
                    };
                    let pair = random.pick(&PAIRS);
                    let halves = [0, 4].map(|k| std::array::from_fn(|i| narrow[k + i]));
                    let mut device = Device(&mut random);
                    n += 1;
                    let Some(loaded) = load(&mut device, pair, &halves, narrowing) else {
                        continue;
                    };
                    let of_step = decide(&values(&mut device, &loaded, None));
                    let end = match random.below(2) {
                        0 => TICKS,
                        _ => 1 + random.below(u64::from(TICKS)) as u32,
                    };
                    let mut device = Device(&mut random);
                    let found = bracket(&mut device, &loaded, end);
                    let is_dropped = of_step == Decided::Free;
                    n_dropped += u32::from(is_dropped);
                    n_later += u32::from(!is_dropped && !found.is_left && end == TICKS);
                    let is_certain = is_dropped || !found.is_left || found.free_until > 0;
                    if !is_certain && of_step != Decided::Touches && found.touches_by.is_none() {
                        continue;
                    }
                    let [start, end_points] =
                        [0, 4].map(|k| std::array::from_fn(|i| points[k + i]));
                    let contact = first_contact(pair, &start, &end_points);
                    let what = format!("{pair:?} {kind:?}: {start:?} {end_points:?} {found:?}");
                    let by = match of_step {
                        Decided::Touches => Some(TICKS),
                        _ => None,
                    };
                    for by in [by, found.touches_by].into_iter().flatten() {
                        let contact = contact.as_ref().expect(&what);
                        assert!(!contact.at_start, "{what}");
                        assert!(contact.time < f64::from(by) * f64::from(TICK), "{what}");
                        n_touching += 1;
                    }
                    let Some(contact) = contact else {
                        continue;
                    };
                    assert!(!is_dropped, "{what}");
                    assert!(found.is_left || end < TICKS, "{what}");
                    let until = f64::from(found.free_until) * f64::from(TICK);
                    assert!(until == 0.0 || !contact.at_start, "{what}");
                    assert!(until <= contact.time, "{what}");
                    n_waiting += u32::from(until > 0.0);
                    n_after += u32::from(!found.is_left);
                }
            }
        }
    }
    assert!(n_dropped > n / 8, "{n_dropped} of {n} are dropped");
    assert!(n_later > n / 40, "{n_later} of {n} by the search alone");
    assert!(n_waiting > n / 40, "{n_waiting} of {n} touch later");
    assert!(n_touching > n / 40, "{n_touching} of {n} certainly touch");
    assert!(
        n_after > n / 100,
        "{n_after} of {n} touch after another pair"
    );
}
