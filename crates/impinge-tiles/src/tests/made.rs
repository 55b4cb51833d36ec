//! Scenes for tests, as files and as input of the oracle.

use std::path::{Path, PathBuf};

use impinge::{CancelToken, Control, Detector, Impacts, Method, Query, Scene, Settings};
use impinge_io::{ColoredMesh, Elements, Mesh, Positions, Weld, write_ply};

use crate::{Ask, Cells, Merged, Plan, PlanOptions, RunOptions, ScatterOptions};

/// A linear congruential generator (Knuth's MMIX).
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: u32) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(n)) as u32
    }

    pub fn chance(&mut self, one_in: u32) -> bool {
        self.below(one_in) == 0
    }
}

/// Elements over few vertices of a lattice: many touch, lie on cuts, or are degenerate. One in
/// eight is very large.
pub fn lattice(random: &mut Random, n: usize, is_solid: bool, is_f64: bool) -> Mesh {
    let width = 4 + random.below(8);
    let n_vertices = 4 + n as u32 / 2;
    // Multiples of 1/3 are not representable in f32, so these coordinates need f64.
    let unit = if is_f64 { 1.0 / 3.0 } else { 0.25 };
    let positions: Vec<[f64; 3]> = (0..n_vertices)
        .map(|_| std::array::from_fn(|_| f64::from(random.below(width)) * unit))
        .collect();
    // Mostly near vertices, so that most elements are small.
    let near = |random: &mut Random, start: u32| {
        if random.chance(8) {
            return random.below(n_vertices);
        }
        let distance = |v: &u32| -> f64 {
            let (a, b) = (positions[*v as usize], positions[start as usize]);
            (0..3).map(|axis| (a[axis] - b[axis]).abs()).sum()
        };
        let tries: Vec<u32> = (0..6).map(|_| random.below(n_vertices)).collect();
        tries
            .into_iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap()
    };
    let corners = |random: &mut Random| {
        let start = random.below(n_vertices);
        [
            start,
            near(random, start),
            near(random, start),
            near(random, start),
        ]
    };
    let elements = if is_solid {
        Elements::Tetrahedra((0..n).map(|_| corners(random)).collect())
    } else {
        Elements::Triangles(
            (0..n)
                .map(|_| corners(random))
                .map(|[a, b, c, _]| [a, b, c])
                .collect(),
        )
    };
    let positions = if is_f64 {
        Positions::F64(positions)
    } else {
        Positions::F32(positions.iter().map(|p| p.map(|x| x as f32)).collect())
    };
    Mesh {
        positions,
        elements,
    }
}

/// The same mesh with most of its vertices elsewhere on the lattice, a few of them far away.
pub fn moved(random: &mut Random, mesh: &Mesh) -> Mesh {
    let unit = match mesh.positions {
        Positions::F32(_) => 0.25,
        Positions::F64(_) => 1.0 / 3.0,
    };
    let mut step = |x: f64| {
        let reach = if random.chance(16) { 9 } else { 3 };
        // The product is a lattice coordinate whatever the order of rounding: `x` is one.
        ((x / unit).round() + f64::from(random.below(reach)) - f64::from(reach / 2)) * unit
    };
    let positions = mesh.positions.to_f64();
    let ends: Vec<[f64; 3]> = positions.iter().map(|p| p.map(&mut step)).collect();
    Mesh {
        elements: mesh.elements.clone(),
        positions: match mesh.positions {
            Positions::F32(_) => Positions::F32(ends.iter().map(|p| p.map(|x| x as f32)).collect()),
            Positions::F64(_) => Positions::F64(ends),
        },
    }
}

/// Writes a mesh in a format that preserves it: PLY for triangles, Medit for tetrahedra.
pub fn write(folder: &Path, name: &str, mesh: &Mesh) -> PathBuf {
    match &mesh.elements {
        Elements::Triangles(_) => {
            let path = folder.join(format!("{name}.ply"));
            let colored = ColoredMesh {
                positions: &mesh.positions,
                elements: &mesh.elements,
                element_colors: None,
                colliding: None,
                name,
            };
            write_ply(&path, &[colored]).unwrap();
            path
        }
        Elements::Tetrahedra(tets) => {
            let path = folder.join(format!("{name}.mesh"));
            let mut text = format!(
                "MeshVersionFormatted 2\nDimension 3\nVertices {}\n",
                mesh.n_vertices()
            );
            for [x, y, z] in mesh.positions.to_f64() {
                text += &format!("{x} {y} {z} 0\n");
            }
            text += &format!("Tetrahedra {}\n", tets.len());
            for [a, b, c, d] in tets.iter().map(|tet| tet.map(|v| v + 1)) {
                text += &format!("{a} {b} {c} {d} 0\n");
            }
            std::fs::write(&path, text + "End\n").unwrap();
            path
        }
    }
}

fn add(scene: &mut Scene, mesh: &Mesh) -> impinge::BodyId {
    let elements: impinge::Elements = match mesh.elements.clone() {
        Elements::Triangles(faces) => faces.into(),
        Elements::Tetrahedra(tets) => tets.into(),
    };
    let positions: impinge::Positions = match mesh.positions.clone() {
        Positions::F32(positions) => positions.into(),
        Positions::F64(positions) => positions.into(),
    };
    scene.add((elements, positions)).unwrap()
}

/// Every box against every box.
fn naive() -> Detector {
    Detector::new(Settings::new().method(Method::Naive).threads(1)).unwrap()
}

fn query(ask: Ask) -> Query {
    match (ask.between, ask.within) {
        (true, true) => Query::all(),
        (true, false) => Query::between_all(),
        _ => Query::self_all(),
    }
}

/// Rows and hash of the oracle, with vertices welded, as plans do.
pub fn oracle(meshes: &[Mesh], ask: Ask) -> (Vec<[u32; 4]>, u64) {
    let mut welded = meshes.to_vec();
    for mesh in &mut welded {
        impinge_io::weld(mesh);
    }
    oracle_as_given(&welded, ask)
}

/// Rows and hash of the oracle.
pub fn oracle_as_given(meshes: &[Mesh], ask: Ask) -> (Vec<[u32; 4]>, u64) {
    let mut scene = Scene::new();
    for mesh in meshes {
        add(&mut scene, mesh);
    }
    let query = query(ask).shared_vertex(ask.shared_vertex);
    let mut detector = naive();
    let pairs = detector.detect(&scene, &query).unwrap();
    (pairs.rows().collect(), pairs.hash())
}

/// What the oracle finds while bodies move from their first mesh to their second, welded and kept
/// apart as a plan says.
pub fn step_oracle(bodies: &[[Mesh; 2]], options: &PlanOptions, ask: Ask) -> Impacts {
    let mut scene = Scene::new();
    for [start, end] in bodies {
        let (mut start, mut end) = (start.clone(), end.clone());
        if options.weld {
            let weld = Weld::by_position(&start.positions).and(&Weld::by_position(&end.positions));
            name_firsts(&weld, &mut start);
            name_firsts(&weld, &mut end);
        }
        let id = add(&mut scene, &start);
        match &end.positions {
            Positions::F32(end) => scene.set_end_positions(id, end).unwrap(),
            Positions::F64(end) => scene.set_end_positions(id, end).unwrap(),
        }
    }
    let step = query(ask)
        .start(ask.start)
        .precision(ask.precision)
        .separation(options.separation);
    naive().impacts(&scene, &step).unwrap()
}

pub fn one_thread() -> Settings {
    Settings::new().threads(1)
}

pub fn plan(folder: &Path, files: &[PathBuf], options: &PlanOptions) -> Result<Plan, crate::Error> {
    Plan::make(folder, files, options, &CancelToken::new(), &mut |_, _| {})
}

pub fn scatter(plan: &Plan) -> Result<crate::Scattered, crate::Error> {
    let options = ScatterOptions {
        threads: 1,
        ..ScatterOptions::default()
    };
    plan.scatter(&options, &CancelToken::new(), &|_, _| {})
}

pub fn run(plan: &Plan, ask: Ask) -> Result<(), crate::Error> {
    let options = RunOptions {
        ask,
        settings: one_thread(),
        again: false,
    };
    plan.run(0..plan.n_tiles(), &options, Control::new(), &mut |_| {})
}

/// Has elements name the first of welded vertices, and keeps the numbers of all.
fn name_firsts(weld: &Weld, mesh: &mut Mesh) {
    let indices = match &mut mesh.elements {
        Elements::Triangles(faces) => faces.as_flattened_mut(),
        Elements::Tetrahedra(tets) => tets.as_flattened_mut(),
    };
    for ix in indices {
        *ix = weld.firsts()[weld.map()[*ix as usize] as usize];
    }
}

/// All steps.
pub fn answer(
    folder: &Path,
    files: &[PathBuf],
    options: &PlanOptions,
    ask: Ask,
) -> Result<Merged, crate::Error> {
    let plan = plan(folder, files, options)?;
    scatter(&plan)?;
    run(&plan, ask)?;
    plan.merge()
}

pub fn rows(merged: &Merged) -> Vec<[u32; 4]> {
    let bytes = std::fs::read(&merged.rows).unwrap();
    let header = crate::npy::parse(&bytes).unwrap();
    assert_eq!(header.shape, [merged.n_pairs, 4]);
    let (words, rest) = bytes[header.start as usize..].as_chunks::<4>();
    assert!(rest.is_empty());
    let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
    words.as_chunks::<4>().0.to_vec()
}

/// Random cuts, half of them at coordinates of the lattice.
pub fn cells(random: &mut Random, unit: f64) -> Cells {
    let mut cells = Cells::whole();
    for _ in 0..random.below(12) {
        let tile = random.below(cells.n_tiles());
        let half = f64::from(random.below(2)) * 0.5;
        let at = (f64::from(random.below(11)) + half) * unit;
        cells.cut(tile, random.below(3) as usize, at);
    }
    cells
}
