//! Scenes that break methods which are only fast on average.
//!
//! Work should be bounded by input plus output. Each scene here violates one hidden assumption of a
//! method: that elements have about the same size, that they are spread out, that the scene has a
//! volume, that there are few bodies. [`SCENES`] lists them all, to be compared with [`plain`] of
//! the same size.

use impinge::Error;

use crate::built::BuiltScene;
use crate::model::{MAX_ELEMENTS, Mesh, Model, add, count, index, real, to_f32};
use crate::random::Random;
use crate::surfaces::{cloth, cube, stand_in};

/// An adversarial scene that can be built at any size.
#[derive(Debug, Clone, Copy)]
pub struct Adversarial {
    /// Its name in tables.
    pub name: &'static str,
    /// The bound that it probes.
    pub probes: &'static str,
    /// The largest useful number of elements: beyond it the answer, or the number of overlapping
    /// boxes, gets too large, or coordinates are no longer exact.
    pub max_n: usize,
    /// Builds the scene with about this many elements.
    pub build: fn(usize) -> Result<BuiltScene, Error>,
}

/// All adversarial scenes.
pub const SCENES: &[Adversarial] = &[
    Adversarial {
        name: "huge-over-small",
        probes: "one element that meets every group costs no more than looking at each once",
        max_n: 1 << 24,
        build: huge_over_small,
    },
    Adversarial {
        name: "stadium",
        probes: "a huge body beside small ones does not spoil the resolution for the small ones",
        max_n: 1 << 24,
        build: stadium,
    },
    Adversarial {
        name: "one-cell",
        probes: "elements in one grid cell whose boxes are apart do not meet pair by pair",
        max_n: 1 << 22,
        build: one_cell,
    },
    Adversarial {
        name: "one-point",
        probes: "time and memory are proportional to the answer, here all pairs",
        max_n: 1 << 12,
        build: one_point,
    },
    Adversarial {
        name: "flat-cloth",
        probes: "a region of volume 0 still gets a resolution, and coplanar overlap is found",
        max_n: 1 << 24,
        build: flat_cloth,
    },
    Adversarial {
        name: "needle-row",
        probes: "a single line of cells: a region that is long in one direction only",
        max_n: 1 << 22,
        build: needle_row,
    },
    Adversarial {
        name: "coincident",
        probes: "a body and its copy in the same place cost their answer, about a dozen pairs per triangle",
        max_n: 1 << 23,
        build: coincident,
    },
    Adversarial {
        name: "outliers",
        probes: "a few elements far away do not enlarge the region for all others",
        max_n: 1 << 24,
        build: outliers,
    },
    Adversarial {
        name: "boxes",
        probes: "many bodies: no step of the frame looks at all pairs of bodies",
        max_n: 1 << 22,
        build: |n| boxes(n / 12, 1),
    },
    Adversarial {
        name: "mixed-sizes",
        probes: "large bodies and many small ones: bodies are not the unit of work",
        max_n: 1 << 22,
        build: mixed_sizes,
    },
    Adversarial {
        name: "slivers",
        probes: "nearly empty boxes: memory stays bounded although nearly all boxes overlap",
        max_n: 1 << 13,
        build: slivers,
    },
    Adversarial {
        name: "machine-parts",
        probes: "parts of a machine, turned in space: long walls and fans of slivers beside fine fillets",
        max_n: 1 << 20,
        build: machine_parts,
    },
    Adversarial {
        name: "stacked-cubes",
        probes: "boxes that end on cell borders: each touching pair is found, and found once",
        max_n: 1 << 20,
        build: stacked_cubes,
    },
    Adversarial {
        name: "chessboard",
        probes: "the same borders between two large bodies",
        max_n: 1 << 23,
        build: chessboard,
    },
];

/// The reference scene: two well-shaped bodies of `n / 2` triangles each that overlap by less than
/// half their length.
///
/// # Errors
/// As [`impinge::Scene::add`]; the same holds for all scenes here.
pub fn plain(n: usize) -> Result<BuiltScene, Error> {
    BuiltScene::two_body("plain", &stand_in(n / 2), [0.4, 0.01, 0.01])
}

/// One huge triangle through a body of `n` small ones. Probes that an element which meets every
/// group costs one look at each group.
///
/// # Errors
/// As [`plain`].
pub fn huge_over_small(n: usize) -> Result<BuiltScene, Error> {
    let mut huge = Mesh::default();
    huge.push([
        [-100.0, -100.0, 0.01],
        [100.0, -100.0, 0.012],
        [0.0, 200.0, 0.009],
    ]);
    BuiltScene::between("huge-over-small", huge.model(), stand_in(n))
}

/// A teapot in a stadium: a floor of two triangles 8,192 wide, and on it two bodies of `n / 2`
/// triangles with a box diagonal of 1 that meet each other and the floor. Probes that a scale set
/// by the largest element, or by the box of the whole scene, is not imposed on small ones.
///
/// # Errors
/// As [`plain`].
pub fn stadium(n: usize) -> Result<BuiltScene, Error> {
    let teapot = stand_in(n / 2);
    let neighbour = teapot.translated([0.4, 0.01, 0.01]);
    BuiltScene::all(
        "stadium",
        [cloth_about_origin(1, 8192.0), teapot, neighbour],
    )
}

fn cloth_about_origin(n_along: usize, spacing: f32) -> Model {
    let half = (0.5 * real(n_along) * f64::from(spacing)) as f32;
    cloth(n_along, n_along, spacing).translated([-half, -half, 0.0])
}

/// Two bodies whose triangles lie flat in one stack, alternately from each body, 2^-24 apart, plus
/// one triangle of each body 2^20 away. A uniform grid over the region puts the whole stack in one
/// cell. No two boxes touch, so there are no pairs. Probes that work in one cell is not quadratic.
///
/// # Errors
/// As [`plain`].
pub fn one_cell(n: usize) -> Result<BuiltScene, Error> {
    let mut stacks = [Mesh::default(), Mesh::default()];
    let n = n.min(1 << 23);
    for layer in 0..n {
        let z = (real(layer) * 0.5f64.powi(24)) as f32;
        stacks[layer % 2].push([[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]);
    }
    let far = 2f32.powi(20);
    for (stack, z) in stacks.iter_mut().zip([far, far + 2.0]) {
        stack.push([[far, far, z], [far + 1.0, far, z], [far, far + 1.0, z]]);
    }
    let [a, b] = stacks.map(Mesh::model);
    BuiltScene::between("one-cell", a, b)
}

/// Two bodies of `n / 2` triangles, all hinged on one segment like the pages of a book: every
/// triangle of one body meets every triangle of the other, `(n / 2)^2` pairs. Probes that memory
/// and time are proportional to the answer.
///
/// # Errors
/// As [`plain`].
pub fn one_point(n: usize) -> Result<BuiltScene, Error> {
    let mut books = [Mesh::default(), Mesh::default()];
    let n_pages = 2 * (n.min(MAX_ELEMENTS) / 2);
    for page in 0..n_pages {
        let angle = std::f64::consts::TAU * real(page) / real(n_pages);
        let edge = to_f32([angle.cos(), angle.sin(), 0.0]);
        books[page % 2].push([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], edge]);
    }
    let [a, b] = books.map(Mesh::model);
    BuiltScene::between("one-point", a, b)
}

/// Two flat sheets in one plane, one moved by half a square along both axes: a region without
/// volume, all overlap coplanar, all coordinates exact.
///
/// # Errors
/// As [`plain`].
pub fn flat_cloth(n: usize) -> Result<BuiltScene, Error> {
    let side = (n / 4).isqrt();
    BuiltScene::two_body("flat-cloth", &cloth(side, side, 1.0), [0.5, 0.5, 0.0])
}

/// `n / 2` upright triangles in a row along x, each pierced by one of the other body: exactly one
/// pair each. Probes a region that is 1 high, 2 wide and `2 n` long: one line of cells.
///
/// # Errors
/// As [`plain`].
pub fn needle_row(n: usize) -> Result<BuiltScene, Error> {
    let (mut row, mut needles) = (Mesh::default(), Mesh::default());
    for place in 0..(n / 2).min(MAX_ELEMENTS) {
        let x = (4.0 * real(place)) as f32;
        row.push([[x, 0.0, 0.0], [x + 2.0, 0.0, 0.0], [x + 1.0, 0.0, 1.0]]);
        let x = x + 1.0;
        needles.push([[x, -1.0, 0.25], [x, 1.0, 0.25], [x, 0.0, 0.75]]);
    }
    BuiltScene::between("needle-row", row.model(), needles.model())
}

/// A body of `n / 2` triangles and itself, in the same place: every triangle meets its copy and the
/// copies of its neighbours, all of it touching and coplanar. Probes the exact test at its slowest.
///
/// # Errors
/// As [`plain`].
pub fn coincident(n: usize) -> Result<BuiltScene, Error> {
    BuiltScene::two_body("coincident", &stand_in(n / 2), [0.0; 3])
}

/// The [`plain`] scene with eight more triangles per body, a million units away towards all
/// corners. Probes that the resolution does not depend only on the region in which bodies overlap.
///
/// # Errors
/// As [`plain`].
pub fn outliers(n: usize) -> Result<BuiltScene, Error> {
    let body = stand_in(n / 2);
    let with_outliers = |model: &Model, distance: f32| {
        let mut mesh = Mesh {
            positions: model.positions.clone(),
            faces: faces_of(model),
        };
        for corner in 0..8u8 {
            let far: [f32; 3] = std::array::from_fn(|axis| {
                if corner >> axis & 1 == 1 {
                    distance
                } else {
                    -distance
                }
            });
            mesh.push([far, add(far, [1.0, 0.0, 0.0]), add(far, [0.0, 1.0, 1.0])]);
        }
        mesh.model()
    };
    let other = body.translated([0.4, 0.01, 0.01]);
    BuiltScene::between(
        "outliers",
        with_outliers(&body, 1_000_000.0),
        with_outliers(&other, 1_000_500.0),
    )
}

fn faces_of(model: &Model) -> Vec<[u32; 3]> {
    match &model.elements {
        impinge::Elements::Triangles(faces) => faces.clone(),
        _ => Vec::new(),
    }
}

/// A cube of edge `size` about `centre`, turned at random.
fn tumbled_cube(random: &mut Random, centre: [f32; 3], size: f32) -> Model {
    // A uniform direction in four dimensions is a uniform rotation (Marsaglia 1972): draw in the
    // cube until inside the ball.
    let (q, norm) = loop {
        let q: [f32; 4] = std::array::from_fn(|_| random.range(-1.0, 1.0));
        let norm: f32 = q.iter().map(|x| x * x).sum();
        if norm > 0.01 && norm <= 1.0 {
            break (q, norm);
        }
    };
    let [w, x, y, z] = q;
    let s = 2.0 / norm;
    let rows = [
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - z * w),
            s * (x * z + y * w),
        ],
        [
            s * (x * y + z * w),
            1.0 - s * (x * x + z * z),
            s * (y * z - x * w),
        ],
        [
            s * (x * z - y * w),
            s * (y * z + x * w),
            1.0 - s * (x * x + y * y),
        ],
    ];
    cube([0.0; 3], size).mapped(|p| {
        let turned = rows.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
        add(turned, centre)
    })
}

/// `n_bodies` cubes of 12 triangles each, placed and turned at random, with edges of 0.4 to 0.8 in
/// a space of one unit volume per body: each cube meets about one other. The query asks for pairs
/// of all bodies. Probes that no step visits all pairs of bodies.
///
/// # Errors
/// As [`plain`].
pub fn boxes(n_bodies: usize, seed: u64) -> Result<BuiltScene, Error> {
    let mut random = Random::new(seed);
    let n_bodies = n_bodies.min(MAX_ELEMENTS / 12);
    let side = real(n_bodies).cbrt() as f32;
    let cubes = (0..n_bodies).map(|_| {
        let centre = random.point(0.0, side);
        let size = random.range(0.4, 0.8);
        tumbled_cube(&mut random, centre, size)
    });
    BuiltScene::all("boxes", cubes)
}

/// Two bodies of `n / 4` triangles and `n / 24` cubes of 12 triangles around and inside them, with
/// edges from 1/2 down to 1/1024, each size half as likely as the next smaller one. Probes that the
/// unit of work is neither a body nor the largest element.
///
/// # Errors
/// As [`plain`].
pub fn mixed_sizes(n: usize) -> Result<BuiltScene, Error> {
    let mut random = Random::new(7);
    let large = stand_in(n / 4).scaled(8.0);
    let neighbour = large.translated([3.2, 0.1, 0.1]);
    let cubes: Vec<Model> = (0..n.min(MAX_ELEMENTS) / 24)
        .map(|_| {
            // Trailing zeros of random bits: 0 half the time, 1 a quarter of it, and so on.
            let halvings = 10 - random.bits().trailing_zeros().min(9);
            let centre = [
                random.range(-3.0, 6.0),
                random.range(-3.0, 3.0),
                random.range(-1.2, 1.2),
            ];
            tumbled_cube(&mut random, centre, 0.5f32.powi(halvings.cast_signed()))
        })
        .collect();
    BuiltScene::all("mixed-sizes", [large, neighbour].into_iter().chain(cubes))
}

/// Long, thin triangles along diagonals, `n / 2` per body: those of one body along `(1, 1, 1)`,
/// those of the other along `(1, 1, -1)`, crossing the first ones at their middles. Their boxes are
/// nearly empty and four in ten pairs of boxes overlap, so boxes tell little about them. Probes
/// that memory stays bounded and that the pair test is fast.
///
/// # Errors
/// As [`plain`].
pub fn slivers(n: usize) -> Result<BuiltScene, Error> {
    let mut random = Random::new(3);
    let mut bodies = [Mesh::default(), Mesh::default()];
    for _ in 0..(n / 2).min(MAX_ELEMENTS) {
        // Middles are multiples of 2^-12 and half lengths are 2^-2, so ends are exact, and the two
        // slivers with a common middle really share that point.
        let middle: [f32; 3] = std::array::from_fn(|_| (random.unit() * 4096.0).floor() / 4096.0);
        for (body, z) in bodies.iter_mut().zip([0.25, -0.25]) {
            let end = add(middle, [0.25, 0.25, z]);
            let start = add(middle, [-0.25, -0.25, -z]);
            body.push([start, end, add(end, [0.0, 0.0009765625, 0.0])]);
        }
    }
    let [a, b] = bodies.map(Mesh::model);
    BuiltScene::between("slivers", a, b)
}

/// Segments around a tube of [`machine_parts`].
const AROUND: usize = 24;
/// Rings of a fillet at either end of a tube.
const RINGS: usize = 8;

/// Two parts of a machine as programs for CAD export them: tubes of 860 triangles, whose walls are
/// slivers 200 times as long as wide, whose ends are fans across, and whose fillets are cut finely.
/// The tubes of one part run along one direction, those of the other along another one, and none
/// along an axis of coordinates; each tube crosses about two of the other part. One triangle in ten
/// is long. Probes that the cost of long elements is not that of their boxes.
///
/// # Errors
/// As [`plain`].
pub fn machine_parts(n: usize) -> Result<BuiltScene, Error> {
    let per_tube = 2 * AROUND + 2 * (AROUND - 2) + 4 * AROUND * RINGS;
    let n_tubes = (n / 2).min(MAX_ELEMENTS).div_ceil(per_tube);
    let width = (0.1 * real(n_tubes)) as f32;
    let mut random = Random::new(11);
    let mut parts = [Mesh::default(), Mesh::default()];
    let n_faces = n / 2;
    for (part, is_across) in parts.iter_mut().zip([false, true]) {
        for _ in 0..n_tubes {
            let at = [random.range(-width, width), random.range(-1.0, 1.0)];
            let tube = tube(at, is_across);
            let left = n_faces - part.faces.len().min(n_faces);
            let faces = tube.faces[..tube.faces.len().min(left)].to_vec();
            part.append(&Mesh { faces, ..tube });
        }
    }
    let [a, b] = parts.map(Mesh::model);
    BuiltScene::between("machine-parts", a, b)
}

/// A tube of length 4 and radius 0.08 along z, or across it, turned in space: its wall, its ends,
/// and fillets around these. A point of its middle is given by two coordinates.
fn tube([x, y]: [f32; 2], is_across: bool) -> Mesh {
    let mut mesh = Mesh::default();
    let radius = |ring: usize| 0.08 * (1.0 - 0.04 * real(ring) * real(ring) / real(RINGS));
    // Rings from one end to the other; the wall is between the middle two.
    let rings = (0..=RINGS)
        .rev()
        .map(|ring| (-2.0 - 0.01 * real(ring), radius(ring)))
        .chain((0..=RINGS).map(|ring| (2.0 + 0.01 * real(ring), radius(ring))));
    for (along, radius) in rings {
        for step in 0..AROUND {
            let angle = std::f64::consts::TAU * real(step) / real(AROUND);
            let (across, up) = (radius * angle.cos(), radius * angle.sin());
            let [x, y] = [f64::from(x) + across, f64::from(y) + up];
            let point = match is_across {
                false => [x, y, along],
                true => [x, along, y],
            };
            mesh.positions.push(to_f32(turned_in_space(point)));
        }
    }
    let vertex = |ring: usize, step: usize| index(ring * AROUND + step % AROUND);
    // The wall first: whatever part of the faces is taken has long ones.
    let order = std::iter::once(RINGS).chain((0..2 * RINGS + 1).filter(|&ring| ring != RINGS));
    let mut faces = Vec::new();
    for ring in order {
        for step in 0..AROUND {
            let [a, b] = [vertex(ring, step), vertex(ring, step + 1)];
            let [c, d] = [vertex(ring + 1, step), vertex(ring + 1, step + 1)];
            faces.extend([[a, b, d], [a, d, c]]);
        }
        if ring == RINGS {
            for end in [0, 2 * RINGS + 1] {
                let fan = 1..AROUND - 1;
                faces.extend(fan.map(|k| [vertex(end, 0), vertex(end, k), vertex(end, k + 1)]));
            }
        }
    }
    mesh.faces = faces;
    mesh
}

/// A rotation about no axis of coordinates, by 1 in the angle of each of two axes.
fn turned_in_space([x, y, z]: [f64; 3]) -> [f64; 3] {
    let (sine, cosine) = 1f64.sin_cos();
    let [x, y] = [cosine * x - sine * y, sine * x + cosine * y];
    [x, cosine * y - sine * z, sine * y + cosine * z]
}

/// Positions of unit cubes stacked without gaps: the largest cube number up to `n_cubes` of them.
fn stack(n_cubes: usize) -> impl Iterator<Item = [usize; 3]> {
    let rounded = count(real(n_cubes).cbrt()).clamp(1, 400);
    let side = if rounded.pow(3) > n_cubes {
        (rounded - 1).max(1)
    } else {
        rounded
    };
    (0..side * side * side)
        .map(move |place| [place % side, place / side % side, place / side / side])
}

fn unit_cube([x, y, z]: [usize; 3]) -> Model {
    let min = to_f32([real(x), real(y), real(z)]);
    crate::surfaces::cuboid(min, add(min, [1.0; 3]))
}

/// Unit cubes on integer coordinates, stacked without gaps, each a body of 12 triangles; the query
/// asks for pairs of all bodies. Faces, edges and corners touch and boxes end exactly on cell
/// borders: probes that each touching pair is found, and found once.
///
/// # Errors
/// As [`plain`].
pub fn stacked_cubes(n: usize) -> Result<BuiltScene, Error> {
    BuiltScene::all("stacked-cubes", stack(n / 12).map(unit_cube))
}

/// The cubes of [`stacked_cubes`] in two bodies, coloured like a chess board in three dimensions:
/// bodies touch along all faces of all cubes.
///
/// # Errors
/// As [`plain`].
pub fn chessboard(n: usize) -> Result<BuiltScene, Error> {
    let mut colours = [Mesh::default(), Mesh::default()];
    for place in stack(n / 12) {
        let cube = unit_cube(place);
        let cube = Mesh {
            faces: faces_of(&cube),
            positions: cube.positions,
        };
        colours[place.iter().sum::<usize>() % 2].append(&cube);
    }
    let [a, b] = colours.map(Mesh::model);
    BuiltScene::between("chessboard", a, b)
}
