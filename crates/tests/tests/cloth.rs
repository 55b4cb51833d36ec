//! Cloth that never intersects: every stored state comes from `advance`, and no state has two
//! triangles that intersect.
//!
//! The scene is awkward on purpose, in single precision: a sheet falls flat onto a box whose edges
//! are exactly below its own, is pierced at by a box that stands on its corner, rests on the first
//! box's top, coplanar with it, and hangs down at the sides; a second sheet falls on it, folded
//! double.

use impinge::{
    Backend, BodyId, Detector, Elements, Impact, PairKind, Part, Positions, Precision, Query,
    Scene, SharedVertex, Start,
};
use impinge_scenes::surfaces::{cloth, cuboid};

type Point = [f64; 3];

const DT: f64 = 1.0 / 120.0;
const GRAVITY: f64 = -9.8;
/// How often contacts of a step are merged before the step is cut short.
const N_ROUNDS: usize = 8;
/// Rounds of making edges as long as they should be.
const N_STRETCH: usize = 12;

/// A sheet: its edges with their lengths at rest.
struct Sheet {
    id: BodyId,
    springs: Vec<([usize; 2], f64)>,
    velocities: Vec<Point>,
}

struct World {
    scene: Scene,
    sheets: Vec<Sheet>,
    detector: Detector,
    step: Query,
    query: Query,
    n_contacts: usize,
    n_cut: usize,
    n_steps: usize,
    /// Whether to do without `advance`.
    is_careless: bool,
}

/// Points and triangles of a model of `impinge_scenes`.
fn parts(model: impinge_scenes::Model) -> (Vec<[u32; 3]>, Vec<[f32; 3]>) {
    let Elements::Triangles(faces) = model.elements else {
        panic!("a surface");
    };
    (faces, model.positions)
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length(a: Point) -> f64 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

impl World {
    fn new() -> Self {
        let mut scene = Scene::new();
        // The floor is two triangles; the boxes are fixed.
        let (faces, floor) = parts(cloth(1, 1, 8.0));
        let floor: Vec<_> = floor
            .iter()
            .map(|p| [p[0] - 4.0, p[1] - 4.0, 0.0])
            .collect();
        scene.add_triangles(&faces, &floor).expect("good");
        let (faces, corners) = parts(cuboid([-0.5, -0.5, 0.25], [0.5, 0.5, 0.75]));
        scene.add_triangles(&faces, &corners).expect("good");
        // On its corner, beside the other.
        let (faces, corners) = parts(cuboid([-0.25; 3], [0.25; 3]));
        let (x, y, z) = (
            [0.5f32.sqrt(), -(0.5f32.sqrt()), 0.0],
            [1.0f32, 1.0, -2.0].map(|k| k / 6f32.sqrt()),
            [1.0f32, 1.0, 1.0].map(|k| k / 3f32.sqrt()),
        );
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let corners: Vec<_> = corners
            .iter()
            .map(|&p| [dot(x, p) + 0.875, dot(y, p), dot(z, p) + 0.5])
            .collect();
        scene.add_triangles(&faces, &corners).expect("good");
        let mut sheets = Vec::new();
        // Its edges are exactly above those of the box.
        let (faces, lower) = parts(cloth(16, 16, 0.125));
        let lower: Vec<_> = lower
            .iter()
            .map(|p| [p[0] - 1.0, p[1] - 1.0, 1.0])
            .collect();
        sheets.push(Sheet::new(&mut scene, &faces, &lower));
        // Folded double: the second half lies above the first, a little apart.
        let (faces, upper) = parts(cloth(12, 6, 0.125));
        let upper: Vec<_> = upper
            .iter()
            .map(|p| {
                let (x, fold) = (p[0], 0.75);
                let up = if x <= fold { 0.0 } else { 0.015_625 };
                [x.min(2.0 * fold - x) - 0.375, p[1] - 0.375, 1.25 + up]
            })
            .collect();
        sheets.push(Sheet::new(&mut scene, &faces, &upper));
        let mut detector = Detector::new(Backend::Cpu).expect("a CPU");
        let query = Query::all().shared_vertex(SharedVertex::Resolve);
        let any = detector.any(&scene, &query).expect("good");
        assert!(!any, "the first state intersects");
        World {
            scene,
            sheets,
            detector,
            step: Query::all().start(Start::Report),
            query,
            n_contacts: 0,
            n_cut: 0,
            n_steps: 0,
            is_careless: false,
        }
    }

    fn positions(&self, id: BodyId) -> Vec<Point> {
        let body = self.scene.body(id).expect("it is there");
        let Positions::F32(positions) = body.positions() else {
            panic!("single precision");
        };
        positions.iter().map(|p| p.map(f64::from)).collect()
    }

    fn set_ends(&mut self, ends: &[Vec<Point>]) {
        for (sheet, ends) in self.sheets.iter().zip(ends) {
            let ends: Vec<[f32; 3]> = ends.iter().map(|p| p.map(|x| x as f32)).collect();
            self.scene
                .set_end_positions(sheet.id, &ends)
                .expect("finite");
        }
    }

    /// One step. Every second one is taken as far as it goes, so that elements come as close as
    /// their precision allows; in the others, vertices that would touch move together.
    fn advance(&mut self) {
        let before: Vec<_> = self.sheets.iter().map(|of| self.positions(of.id)).collect();
        let mut wished: Vec<_> = self
            .sheets
            .iter()
            .zip(&before)
            .map(|(sheet, before)| sheet.wish(before))
            .collect();
        self.set_ends(&wished);
        let is_cut = self.n_steps % 2 == 1;
        for _ in 0..if is_cut { 0 } else { N_ROUNDS } {
            let impacts = self
                .detector
                .impacts(&self.scene, &self.step)
                .expect("good");
            self.n_contacts += impacts.len();
            if impacts.is_empty() {
                break;
            }
            // Vertices that meet a fixed body stop; those of two sheets, or of one, move alike.
            let groups: Vec<Vec<(usize, usize)>> =
                impacts.iter().map(|impact| self.vertices(impact)).collect();
            for group in groups {
                let mean = match group.iter().any(|&(sheet, _)| sheet == usize::MAX) {
                    true => [0.0; 3],
                    false => {
                        let mut sum = [0.0; 3];
                        for &(sheet, ix) in &group {
                            let moved = minus(wished[sheet][ix], before[sheet][ix]);
                            for axis in 0..3 {
                                sum[axis] += moved[axis] / group.len() as f64;
                            }
                        }
                        sum
                    }
                };
                for &(sheet, ix) in group.iter().filter(|of| of.0 != usize::MAX) {
                    for axis in 0..3 {
                        wished[sheet][ix][axis] = before[sheet][ix][axis] + mean[axis];
                    }
                }
            }
            self.set_ends(&wished);
        }
        if self.is_careless {
            return self.take_rounded(&before, &wished);
        }
        let advance = self
            .detector
            .advance(&self.scene, &self.step)
            .expect("good");
        self.n_cut += usize::from(advance.fraction < 1.0);
        advance.apply(&mut self.scene).expect("the same bodies");
        for ix in 0..self.sheets.len() {
            let after = self.positions(self.sheets[ix].id);
            for (velocity, (after, before)) in self.sheets[ix]
                .velocities
                .iter_mut()
                .zip(after.iter().zip(&before[ix]))
            {
                *velocity = minus(*after, *before).map(|x| 0.99 * x / DT);
            }
        }
        self.n_steps += 1;
    }

    /// What a solver does that knows the exact time of the first contact, but not what rounding
    /// does: goes there.
    fn take_rounded(&mut self, before: &[Vec<Point>], wished: &[Vec<Point>]) {
        let step = self.step.clone().precision(Precision::F64);
        let first = self.detector.earliest(&self.scene, &step).expect("good");
        let time = first.map_or(1.0, |first| first.toi);
        for ((sheet, before), wished) in self.sheets.iter().zip(before).zip(wished) {
            let at = |p: &Point, q: &Point| {
                std::array::from_fn(|axis| (p[axis] + time * (q[axis] - p[axis])) as f32)
            };
            let rounded: Vec<[f32; 3]> = before.iter().zip(wished).map(|(p, q)| at(p, q)).collect();
            self.scene
                .set_positions(sheet.id, &rounded)
                .expect("finite");
        }
        self.n_steps += 1;
    }

    /// The vertices of an impact as sheet and number; of fixed bodies with no sheet.
    fn vertices(&self, impact: &Impact) -> Vec<(usize, usize)> {
        let parts = match impact.kind {
            PairKind::VertexFace => [Part::Vertices, Part::Faces],
            _ => [Part::Edges; 2],
        };
        let mut vertices = Vec::new();
        for (part, element) in parts.into_iter().zip([impact.a, impact.b]) {
            let sheet = self.sheets.iter().position(|of| of.id == element.body);
            let Some(sheet) = sheet else {
                vertices.push((usize::MAX, 0));
                continue;
            };
            let body = self.scene.body(element.body).expect("it is there");
            if part == Part::Vertices {
                vertices.push((sheet, element.element as usize));
            } else {
                let corners = body.part(part).corners(element.element as usize);
                vertices.extend(corners.iter().map(|&ix| (sheet, ix as usize)));
            }
        }
        vertices
    }

    fn intersects(&mut self) -> bool {
        self.detector.any(&self.scene, &self.query).expect("good")
    }

    /// How high the vertices of the first sheet are: the lowest, and on average.
    fn heights(&self) -> [f64; 2] {
        let positions = self.positions(self.sheets[0].id);
        let lowest = positions.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        let sum: f64 = positions.iter().map(|p| p[2]).sum();
        [lowest, sum / positions.len() as f64]
    }
}

impl Sheet {
    fn new(scene: &mut Scene, faces: &[[u32; 3]], positions: &[[f32; 3]]) -> Self {
        let mut edges: Vec<[usize; 2]> = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b) as usize, a.max(b) as usize])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let springs = edges
            .into_iter()
            .map(|[a, b]| {
                let [p, q] = [a, b].map(|ix| positions[ix].map(f64::from));
                ([a, b], length(minus(p, q)))
            })
            .collect();
        Sheet {
            id: scene.add_triangles(faces, positions).expect("good"),
            springs,
            velocities: vec![[0.0; 3]; positions.len()],
        }
    }

    /// Where the vertices would be after a step without contact.
    fn wish(&self, before: &[Point]) -> Vec<Point> {
        let mut after: Vec<Point> = before
            .iter()
            .zip(&self.velocities)
            .map(|(p, v)| {
                [
                    p[0] + v[0] * DT,
                    p[1] + v[1] * DT,
                    p[2] + (v[2] + GRAVITY * DT) * DT,
                ]
            })
            .collect();
        for _ in 0..N_STRETCH {
            for &([a, b], rest) in &self.springs {
                let between = minus(after[b], after[a]);
                let now = length(between);
                if now == 0.0 {
                    continue;
                }
                let share = 0.5 * (now - rest) / now;
                for axis in 0..3 {
                    after[a][axis] += share * between[axis];
                    after[b][axis] -= share * between[axis];
                }
            }
        }
        after
    }
}

#[test]
fn cloth_never_intersects_in_a_thousand_steps() {
    let mut world = World::new();
    for n in 0..1000 {
        world.advance();
        assert!(!world.intersects(), "the state after step {n} intersects");
    }
    let [lowest, mean] = world.heights();
    println!(
        "{} contacts, {} of 1,000 steps cut short, lowest vertex at {lowest:.3}, mean {mean:.3}",
        world.n_contacts, world.n_cut
    );
    assert!(world.n_contacts > 1000 && world.n_cut > 100);
    // It hangs over the edges of the box, whose top is at 0.75, and above the floor.
    assert!(lowest > 0.0 && lowest < 0.7, "{lowest}");
}

#[test]
fn without_advance_it_does() {
    let mut world = World::new();
    world.is_careless = true;
    let does = (0..1000).any(|_| {
        world.advance();
        world.intersects()
    });
    assert!(does, "the exact first time alone was enough");
}
