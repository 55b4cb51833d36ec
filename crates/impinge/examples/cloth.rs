//! Cloth that never intersects itself or what it meets: XPBD, with `near` for its contacts and
//! `truncate` for its steps.
//!
//! ```sh
//! cargo run --release -p impinge --example cloth
//! cargo run --release -p impinge --example cloth -- --scene twist --vertices 10000 --frames 1000 --out frames
//! impinge view frames/twist.obj frames/twist.pc2
//! ```
//!
//! Each step: vertices go where their velocities take them; distance constraints along edges,
//! across faces and across edges are solved (XPBD, Macklin et al. 2016), together with one
//! constraint per pair of elements that `near` finds, by its stencil; then `truncate` says how far
//! each vertex can go. Its positions are proven free, rounding included. The program ends with an
//! error if the exact test `any` ever finds an intersection in a stored state. There is no
//! friction.
//!
//! `examples/cloth` has the same program in Python, and what both print: all arithmetic is adding,
//! multiplying, dividing and square roots of `f64` in one order, and the answers are the same in
//! both languages.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use impinge::{Backend, BodyId, Detector, PairKind, Positions, Query, Scene, Settings, Stencil};

type Point = [f64; 3];
type Surface = (Vec<Point>, Vec<[u32; 3]>);

const DT: f64 = 0.01;
const GRAVITY: f64 = -9.81;
/// What is left of a velocity after a step.
const DAMPING: f64 = 0.99;
const ITERATIONS: usize = 20;
/// Compliance of edges, of diagonals and of bending, in metres per newton with vertices of one
/// kilogram.
const STRETCH: f64 = 0.0;
const SHEAR: f64 = 1e-6;
const BEND: f64 = 1e-4;
/// Elements are pushed apart to this share of an edge, and looked for within [`REACH`].
const THICKNESS: f64 = 0.3;
const REACH: f64 = 0.5;
/// The share of an edge with which near pairs are listed, to be found again while little moves.
const MARGIN: f64 = 0.125;
/// Of a contact. Beside pinned vertices the sum of squares of weights may be tiny, and what it
/// divides would move others by 10^11 metres.
const LEAST_MASS: f64 = 0.01;
/// Of a denominator that may be 0.
const TINY: f64 = 1e-30;
/// Tangent of half the angle by which an end of the twisted cloth turns per step, about 1.4
/// degrees.
const TURN: f64 = 0.0125;
/// How far the middle is pulled per step.
const PULL: f64 = 0.004;

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

fn number(n: usize) -> u32 {
    u32::try_from(n).expect("few vertices")
}

fn float(n: usize) -> f64 {
    f64::from(number(n))
}

/// Points of the unit circle, `n` of them, a power of two: halves of halves of a quarter, so that
/// they are the same everywhere.
fn circle(n: usize) -> Vec<[f64; 2]> {
    let mut points = vec![[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];
    while points.len() < n {
        let mut finer = Vec::new();
        for (ix, &[x, y]) in points.iter().enumerate() {
            let [u, v] = points[(ix + 1) % points.len()];
            let (a, b): (f64, f64) = (x + u, y + v);
            let length = (a * a + b * b).sqrt();
            finer.extend([[x, y], [a / length, b / length]]);
        }
        points = finer;
    }
    points
}

/// A ball below the origin that touches it; circles of latitude between two poles.
fn ball(radius: f64, n: u32) -> Surface {
    let round = circle(n as usize);
    let half = n / 2;
    let mut points = vec![[0.0; 3]];
    for &[up, out] in &round[1..half as usize] {
        let latitude = round
            .iter()
            .map(|&[x, y]| [radius * out * x, radius * out * y, radius * up - radius]);
        points.extend(latitude);
    }
    points.push([0.0, 0.0, -radius - radius]);
    let last = number(points.len() - 1);
    let mut faces = Vec::new();
    for k in 0..n {
        let following = (k + 1) % n;
        faces.push([0, 1 + k, 1 + following]);
        for ring in 0..half - 2 {
            let (a, b) = (1 + ring * n + k, 1 + ring * n + following);
            faces.extend([[a, a + n, b + n], [a, b + n, b]]);
        }
        faces.push([last, last - n + following, last - n + k]);
    }
    (points, faces)
}

/// A ring around the z axis: `n` circles of `m` points.
fn torus(far: f64, near: f64, n: u32, m: u32) -> Surface {
    let small = circle(m as usize);
    let around = circle(n as usize);
    let points = around.iter().flat_map(|&[x, y]| {
        let of_circle = small.iter();
        of_circle.map(move |&[c, s]| [(far + near * c) * x, (far + near * c) * y, near * s])
    });
    let points = points.collect();
    let mut faces = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i * m + j, i * m + (j + 1) % m);
            let (c, d) = ((i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m);
            faces.extend([[a, c, d], [a, d, b]]);
        }
    }
    (points, faces)
}

/// The least side of a square of vertices that has as many as asked for, over all layers.
fn side_of(n_vertices: usize, n_layers: usize) -> usize {
    let mut side = 3;
    while side * side * n_layers < n_vertices {
        side += 1;
    }
    side
}

/// A distance to be kept.
struct Spring {
    ends: [usize; 2],
    length: f64,
    compliance: f64,
    force: f64,
}

/// Square sheets one above the other, as one body.
struct Cloth {
    side: usize,
    edge: f64,
    faces: Vec<[u32; 3]>,
    rest: Vec<Point>,
    springs: Vec<Spring>,
    /// 0 for pinned vertices, otherwise 1: an inverse mass.
    moves: Vec<f64>,
}

impl Cloth {
    fn new(side: usize, n_layers: usize, height: f64) -> Self {
        let edge = 1.0 / float(side - 1);
        let (mut rest, mut faces) = (Vec::new(), Vec::new());
        for layer in 0..n_layers {
            let first = layer * side * side;
            let skew = if layer % 2 == 0 { 0.13 } else { -0.11 };
            for (i, j) in grid(side) {
                let (x, y) = (float(i) * edge - 0.5, float(j) * edge - 0.5);
                // A little askew, so that nothing is symmetric.
                rest.push([x + skew * y, y - skew * x, height + 0.02 * float(layer)]);
            }
            for (i, j) in grid(side - 1) {
                let a = number(first + i * side + j);
                let side = number(side);
                faces.extend([[a, a + side, a + side + 1], [a, a + side + 1, a + 1]]);
            }
        }
        let mut cloth = Cloth {
            side,
            edge,
            faces,
            moves: vec![1.0; rest.len()],
            rest,
            springs: Vec::new(),
        };
        // No two springs of a group share a vertex, so that their order does not matter.
        let by_one: fn(usize) -> usize = |at| at % 2;
        let by_two: fn(usize) -> usize = |at| at / 2 % 2;
        for (step, parity, of_rows, compliance) in [
            ([1, 0], by_one, true, STRETCH),
            ([0, 1], by_one, false, STRETCH),
            ([1, 1], by_one, true, SHEAR),
            ([1, -1], by_one, true, SHEAR),
            ([2, 0], by_two, true, BEND),
            ([0, 2], by_two, false, BEND),
        ] {
            for group in 0..2 {
                for layer in 0..n_layers {
                    let first = layer * side * side;
                    for (i, j) in grid(side) {
                        if parity(if of_rows { i } else { j }) != group {
                            continue;
                        }
                        let to = [i.checked_add_signed(step[0]), j.checked_add_signed(step[1])];
                        if let [Some(k), Some(l)] = to
                            && k < side
                            && l < side
                        {
                            cloth.join([first + i * side + j, first + k * side + l], compliance);
                        }
                    }
                }
            }
        }
        cloth
    }

    fn join(&mut self, ends: [usize; 2], compliance: f64) {
        self.springs.push(Spring {
            ends,
            length: length(minus(self.rest[ends[1]], self.rest[ends[0]])),
            compliance: compliance / (DT * DT),
            force: 0.0,
        });
    }

    fn pin(&mut self, pinned: &[usize]) {
        for &vertex in pinned {
            self.moves[vertex] = 0.0;
        }
        let moves = &self.moves;
        self.springs
            .retain(|spring| spring.ends.iter().any(|&end| moves[end] > 0.0));
    }
}

/// The rows and columns of a square of `n` by `n`.
fn grid(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (0..n).map(move |j| (i, j)))
}

/// Cosine and sine after so many turns.
fn turned(n_steps: usize) -> [f64; 2] {
    let square = TURN * TURN;
    let (cos, sin) = ((1.0 - square) / (1.0 + square), 2.0 * TURN / (1.0 + square));
    let [mut c, mut s] = [1.0, 0.0];
    for _ in 0..n_steps {
        [c, s] = [c * cos - s * sin, c * sin + s * cos];
    }
    [c, s]
}

/// Two elements to be kept apart.
#[derive(Clone, Copy)]
struct Contact {
    /// Vertices of the cloth with signed weights; a vertex of another body has the weight 0.
    corners: [(usize, f64); 4],
    normal: Point,
    /// What vertices of other bodies add to the distance along the normal.
    offset: f64,
    /// Sum of the weights, squared, by the inverse masses.
    mass: f64,
}

#[derive(Default)]
struct Seconds {
    near: f64,
    solve: f64,
    truncate: f64,
    any: f64,
}

struct World {
    name: &'static str,
    scene: Scene,
    cloth: Cloth,
    pinned: Vec<usize>,
    body: BodyId,
    fixed: Vec<Surface>,
    detector: Detector,
    velocities: Vec<Point>,
    n_steps: usize,
    n_near: usize,
    n_cut: u64,
    seconds: Seconds,
}

fn singles(points: &[Point]) -> Vec<[f32; 3]> {
    points.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// Asks, and adds the time to `seconds`.
fn timed<T>(seconds: &mut f64, ask: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let answer = ask();
    *seconds += start.elapsed().as_secs_f64();
    answer
}

impl World {
    fn new(name: &'static str, n_vertices: usize) -> Result<Self, impinge::Error> {
        let n_layers = if name == "drop" { 2 } else { 1 };
        let height = match name {
            "drop" => 0.03,
            "ring" => 0.06,
            _ => 0.0,
        };
        let mut cloth = Cloth::new(side_of(n_vertices, n_layers), n_layers, height);
        let side = cloth.side;
        let (pinned, fixed): (Vec<usize>, Vec<Surface>) = match name {
            "drop" => {
                let floor = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
                let floor = floor.map(|[x, y]| [x, y, -0.7]).to_vec();
                let faces = vec![[0, 1, 2], [0, 2, 3]];
                (Vec::new(), vec![ball(0.3, 32), (floor, faces)])
            }
            "twist" => {
                let ends = (0..side).chain(side * side - side..side * side);
                (ends.collect(), Vec::new())
            }
            _ => {
                let middle = side / 2;
                let around = middle - side / 16..=middle + side / 16;
                let columns = around.clone();
                let patch = around.flat_map(|i| columns.clone().map(move |j| i * side + j));
                (patch.collect(), vec![torus(0.3, 0.04, 32, 16)])
            }
        };
        cloth.pin(&pinned);
        let mut scene = Scene::new();
        let body = scene.add_triangles(&cloth.faces, &singles(&cloth.rest))?;
        for (points, faces) in &fixed {
            scene.add_triangles(faces, &singles(points))?;
        }
        let settings = Settings::from(Backend::Cpu).reuse_margin(MARGIN * cloth.edge);
        Ok(World {
            name,
            scene,
            pinned,
            body,
            fixed,
            detector: Detector::new(settings)?,
            velocities: vec![[0.0; 3]; cloth.rest.len()],
            cloth,
            n_steps: 0,
            n_near: 0,
            n_cut: 0,
            seconds: Seconds::default(),
        })
    }

    fn positions(&self) -> Result<&[[f32; 3]], impinge::Error> {
        match self.scene.body(self.body)?.positions() {
            Positions::F32(positions) => Ok(positions),
            Positions::F64(_) => unreachable!("the cloth is given in single precision"),
        }
    }

    /// Where the pinned vertices are to be after this step.
    fn pull(&self, to: &mut [Point]) {
        let [c, s] = turned(self.n_steps + 1);
        for &vertex in &self.pinned {
            let [x, y, z] = self.cloth.rest[vertex];
            let s = if x < 0.0 { s } else { -s };
            to[vertex] = match self.name {
                "twist" => [x, y * c - z * s, y * s + z * c],
                _ => [x, y, z - PULL * float(self.n_steps + 1)],
            };
        }
    }

    fn contact(&self, stencil: &Stencil) -> Contact {
        let (weights, points) = (stencil.coefficients(), &stencil.points);
        let mut across = [0.0; 3];
        for (weight, point) in weights.iter().zip(points) {
            for (across, x) in across.iter_mut().zip(point) {
                *across += weight * x;
            }
        }
        let distance = length(across).max(TINY);
        let normal = across.map(|x| x / distance);
        let mut corners = [(0, 0.0); 4];
        let (mut offset, mut mass) = (0.0, 0.0);
        for (ix, corner) in corners.iter_mut().enumerate() {
            let (vertex, weight) = (stencil.vertices[ix] as usize, weights[ix]);
            // The cloth is the first body of the scene, so its vertices are the first.
            if let Some(moves) = self.cloth.moves.get(vertex) {
                *corner = (vertex, weight);
                mass += weight * weight * moves;
            } else {
                offset += weight * dot(normal, points[ix]);
            }
        }
        Contact {
            corners,
            normal,
            offset,
            mass: mass.max(LEAST_MASS),
        }
    }

    fn contacts(&mut self) -> Result<Vec<Contact>, impinge::Error> {
        let query = Query::of(self.body).kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
        let reach = REACH * self.cloth.edge;
        let (detector, scene) = (&mut self.detector, &self.scene);
        let stencils = timed(&mut self.seconds.near, || {
            detector.near(scene, reach, &query)?.stencils(scene, None)
        })?;
        self.n_near = stencils.len();
        let start = Instant::now();
        let contacts = stencils.column(|stencil| self.contact(stencil));
        self.seconds.solve += start.elapsed().as_secs_f64();
        contacts
    }

    fn step(&mut self) -> Result<(), Box<dyn Error>> {
        let at: Vec<Point> = self.positions()?.iter().map(|p| p.map(f64::from)).collect();
        let contacts = self.contacts()?;
        let start = Instant::now();
        if self.name != "twist" {
            for velocity in &mut self.velocities {
                velocity[2] += GRAVITY * DT;
            }
        }
        let mut to = at.clone();
        for (vertex, point) in to.iter_mut().enumerate() {
            for (x, speed) in point.iter_mut().zip(self.velocities[vertex]) {
                *x += self.cloth.moves[vertex] * (speed * DT);
            }
        }
        self.pull(&mut to);
        solve(&mut self.cloth, &contacts, &mut to);
        self.seconds.solve += start.elapsed().as_secs_f64();
        self.scene.set_end_positions(self.body, singles(&to))?;
        let (detector, scene) = (&mut self.detector, &self.scene);
        let truncation = timed(&mut self.seconds.truncate, || {
            detector.truncate(scene, &Query::all())
        })?;
        truncation.apply(&mut self.scene)?;
        self.n_cut += truncation.n_cut();
        let mut velocities = std::mem::take(&mut self.velocities);
        for ((velocity, after), before) in velocities.iter_mut().zip(self.positions()?).zip(&at) {
            *velocity = minus(after.map(f64::from), *before).map(|x| x * (DAMPING / DT));
        }
        self.velocities = velocities;
        self.n_steps += 1;
        let (detector, scene) = (&mut self.detector, &self.scene);
        if timed(&mut self.seconds.any, || detector.any(scene, &Query::all()))? {
            let (name, step) = (self.name, self.n_steps);
            return Err(format!("{name}: the state after step {step} intersects").into());
        }
        Ok(())
    }

    fn line(&self) -> Result<String, impinge::Error> {
        let heights = self.positions()?.iter().map(|p| f64::from(p[2]));
        let lowest = heights.clone().fold(f64::INFINITY, f64::min);
        let highest = heights.fold(f64::NEG_INFINITY, f64::max);
        let World {
            name,
            n_steps,
            n_near,
            n_cut,
            ..
        } = self;
        Ok(format!(
            "{name} {n_steps}: {n_near} near, {n_cut} cut so far, from {lowest:.6} to {highest:.6} high"
        ))
    }

    /// Milliseconds per step so far.
    fn times(&self) -> String {
        let Seconds {
            near,
            solve,
            truncate,
            any,
        } = self.seconds;
        let ms = [near, solve, truncate, any].map(|seconds| 1e3 * seconds / float(self.n_steps));
        let share = (near + truncate) / (near + truncate + solve);
        format!(
            "{} {}: ms per step: near {:.1}, solve {:.1}, truncate {:.1}, any {:.1}; near and truncate are {:.0} % without any",
            self.name,
            self.n_steps,
            ms[0],
            ms[1],
            ms[2],
            ms[3],
            100.0 * share
        )
    }
}

/// Moves the vertices to where springs and contacts want them.
fn solve(cloth: &mut Cloth, contacts: &[Contact], to: &mut [Point]) {
    let Cloth {
        springs,
        moves,
        edge,
        ..
    } = cloth;
    for spring in springs.iter_mut() {
        spring.force = 0.0;
    }
    let mut moved = vec![([0.0; 3], 0.0); to.len()];
    for _ in 0..ITERATIONS {
        for spring in springs.iter_mut() {
            let Spring {
                ends: [a, b],
                length: rest,
                compliance,
                force,
            } = spring;
            let way = minus(to[*b], to[*a]);
            let now = length(way).max(TINY);
            let more = (*rest - now - *compliance * *force) / (moves[*a] + moves[*b] + *compliance);
            *force += more;
            let share = more / now;
            for axis in 0..3 {
                let pull = way[axis] * share;
                to[*a][axis] -= moves[*a] * pull;
                to[*b][axis] += moves[*b] * pull;
            }
        }
        push(contacts, to, moves, THICKNESS * *edge, &mut moved);
    }
}

/// Moves vertices of pairs that are too near apart, each by the mean over its pairs.
fn push(
    contacts: &[Contact],
    to: &mut [Point],
    moves: &[f64],
    thickness: f64,
    moved: &mut [(Point, f64)],
) {
    moved.fill(([0.0; 3], 0.0));
    for contact in contacts {
        let mut gap = contact.offset - thickness;
        for (vertex, weight) in contact.corners {
            gap += weight * dot(contact.normal, to[vertex]);
        }
        if gap >= 0.0 {
            continue;
        }
        let push = -gap / contact.mass;
        for (vertex, weight) in contact.corners {
            let part = weight * moves[vertex] * push;
            if part != 0.0 {
                let (sum, n_pairs) = &mut moved[vertex];
                for (sum, x) in sum.iter_mut().zip(contact.normal) {
                    *sum += part * x;
                }
                *n_pairs += 1.0;
            }
        }
    }
    for (point, (sum, n_pairs)) in to.iter_mut().zip(moved) {
        for (x, sum) in point.iter_mut().zip(sum) {
            *x += *sum / n_pairs.max(1.0);
        }
    }
}

/// A mesh and its frames, as `impinge view` and `impinge sequence` read them; and what does not
/// move.
struct Frames(BufWriter<File>);

impl Frames {
    fn new(folder: &Path, world: &World, n_frames: usize) -> Result<Self, Box<dyn Error>> {
        std::fs::create_dir_all(folder)?;
        let name = world.name;
        let positions = world.positions()?;
        obj(
            &folder.join(format!("{name}.obj")),
            positions,
            &world.cloth.faces,
        )?;
        for (number, (points, faces)) in world.fixed.iter().enumerate() {
            let path = folder.join(format!("{name}_fixed_{number}.obj"));
            obj(&path, &singles(points), faces)?;
        }
        let mut file = BufWriter::new(File::create(folder.join(format!("{name}.pc2")))?);
        file.write_all(b"POINTCACHE2\0")?;
        file.write_all(&1u32.to_le_bytes())?;
        file.write_all(&number(positions.len()).to_le_bytes())?;
        file.write_all(&0f32.to_le_bytes())?;
        file.write_all(&1f32.to_le_bytes())?;
        file.write_all(&number(n_frames + 1).to_le_bytes())?;
        let mut frames = Frames(file);
        frames.add(world)?;
        Ok(frames)
    }

    fn add(&mut self, world: &World) -> Result<(), Box<dyn Error>> {
        for x in world.positions()?.as_flattened() {
            self.0.write_all(&x.to_le_bytes())?;
        }
        Ok(self.0.flush()?)
    }
}

fn obj(path: &Path, points: &[[f32; 3]], faces: &[[u32; 3]]) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    for [x, y, z] in points {
        writeln!(file, "v {x} {y} {z}")?;
    }
    for [a, b, c] in faces.iter().map(|face| face.map(|corner| corner + 1)) {
        writeln!(file, "f {a} {b} {c}")?;
    }
    file.flush()
}

fn run(
    name: &'static str,
    n_vertices: usize,
    n_frames: usize,
    out: Option<&Path>,
) -> Result<(), Box<dyn Error>> {
    let mut world = World::new(name, n_vertices)?;
    let frames = out.map(|folder| Frames::new(folder, &world, n_frames));
    let mut frames = frames.transpose()?;
    println!(
        "{name}: {} vertices, {} faces, {n_frames} steps",
        world.cloth.rest.len(),
        world.cloth.faces.len()
    );
    for step in 1..=n_frames {
        world.step()?;
        if let Some(frames) = &mut frames {
            frames.add(&world)?;
        }
        if step * 4 % n_frames < 4 {
            println!("{}", world.line()?);
            eprintln!("{}", world.times());
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut scenes, mut n_vertices, mut n_frames) = (vec!["drop", "twist", "ring"], 300, 100);
    let mut out = None;
    let mut given = std::env::args().skip(1);
    while let Some(option) = given.next() {
        let value = given
            .next()
            .ok_or_else(|| format!("{option}: a value is missing"))?;
        match option.as_str() {
            "--scene" if value == "all" => {}
            "--scene" => scenes.retain(|name| *name == value),
            "--vertices" => n_vertices = value.parse()?,
            "--frames" => n_frames = value.parse()?,
            "--out" => out = Some(PathBuf::from(value)),
            _ => {
                return Err(format!(
                    "{option}: --scene, --vertices, --frames or --out is expected"
                )
                .into());
            }
        }
    }
    if scenes.is_empty() {
        return Err("--scene: drop, twist, ring or all is expected".into());
    }
    for name in scenes {
        run(name, n_vertices, n_frames, out.as_deref())?;
    }
    Ok(())
}
