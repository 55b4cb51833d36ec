//! The bodies of a file: nodes of a glTF file, objects or groups of an OBJ file.

use std::collections::{HashMap, HashSet};

use crate::mesh::{Elements, Mesh, Positions, Weld};

/// A body of a file, and the name that the file gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedMesh {
    /// The name of a node, an object or a group. `None` if the mesh is all that the file has, and
    /// the file gives it no name.
    pub name: Option<String>,
    /// Its elements in the order of the file, and the vertices that they name.
    pub mesh: Mesh,
    /// The number of each of its vertices in the file, of welded ones that of the first; ascending.
    /// `None` if it has the vertices of the file as they are. Objects and groups of an OBJ file
    /// share one list of vertices. Those of a glTF node are numbered in the `POSITION` accessors
    /// of its primitives, one after the other in the order of first use; those of a 3MF item in
    /// its meshes, in the order in which it names them.
    pub vertices: Option<Vec<u32>>,
}

impl NamedMesh {
    /// All of a file.
    pub fn whole(name: Option<String>, mesh: Mesh) -> Self {
        NamedMesh {
            name,
            mesh,
            vertices: None,
        }
    }

    /// Welds its vertices; returns how many are gone.
    pub(crate) fn weld(&mut self) -> usize {
        let weld = Weld::by_position(&self.mesh.positions);
        if weld.n_welded() > 0 {
            let firsts = weld.firsts();
            self.vertices = Some(match &self.vertices {
                None => firsts.to_vec(),
                Some(all) => firsts.iter().map(|&first| all[first as usize]).collect(),
            });
            weld.apply(&mut self.mesh);
        }
        weld.n_welded()
    }
}

/// What a part is called.
#[derive(Debug, Clone, Copy)]
pub(crate) enum PartName<'a> {
    /// By the file.
    Given(&'a str),
    /// By us, where the file does not say.
    StandIn(&'a str),
}

/// Which triangles of a file belong to which part.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    /// The name of each part, whether the file gave it, and the vertex from which on its vertices
    /// are counted.
    names: Vec<(String, bool, u32)>,
    /// The part of each name that a later triangle of this name belongs to.
    known: HashMap<String, usize>,
    /// The first triangle of a run, and the part that it belongs to; ascending.
    runs: Vec<(usize, usize)>,
}

impl Parts {
    /// From triangle `first` on, triangles belong to the part of this name: to a new one, or to the
    /// one that has it already. The vertices of a new one are counted from `base` on.
    pub(crate) fn begin(&mut self, name: PartName<'_>, is_new: bool, base: u32, first: usize) {
        let (name, is_given) = match name {
            PartName::Given(name) => (name, true),
            PartName::StandIn(name) => (name, false),
        };
        let part = match self.known.get(name) {
            Some(&part) if !is_new => part,
            _ => {
                self.names.push((name.to_owned(), is_given, base));
                self.known.insert(name.to_owned(), self.names.len() - 1);
                self.names.len() - 1
            }
        };
        // A part without triangles leaves nothing behind.
        if self.runs.last().is_some_and(|&(begun, _)| begun == first) {
            self.runs.pop();
        }
        self.runs.push((first, part));
    }

    /// How many parts have begun, without those that ended before a triangle.
    pub(crate) fn len(&self) -> usize {
        let mut begun: Vec<usize> = self.runs.iter().map(|run| run.1).collect();
        begun.sort_unstable();
        begun.dedup();
        begun.len()
    }

    /// One mesh per part that has triangles, in the order of their first ones; the mesh itself if
    /// there are not several. Triangles before the first part are one, too.
    pub(crate) fn split(self, mesh: Mesh) -> Vec<NamedMesh> {
        let faces = match &mesh.elements {
            Elements::Triangles(faces) if !self.runs.is_empty() => faces,
            _ => return vec![NamedMesh::whole(None, mesh)],
        };
        let mut of_parts: Vec<(usize, Vec<[u32; 3]>)> = Vec::new();
        let mut places: Vec<Option<usize>> = vec![None; self.names.len()];
        let ends = self.runs.iter().skip(1).map(|run| run.0);
        let ends = ends.chain([faces.len()]);
        // Triangles before the first name belong to no part.
        let unnamed = self.runs[0].0;
        if unnamed > 0 {
            of_parts.push((usize::MAX, faces[..unnamed].to_vec()));
        }
        for (&(first, part), end) in self.runs.iter().zip(ends) {
            if first == end {
                continue;
            }
            let place = *places[part].get_or_insert_with(|| {
                of_parts.push((part, Vec::new()));
                of_parts.len() - 1
            });
            of_parts[place].1.extend_from_slice(&faces[first..end]);
        }
        if let [(part, _)] = of_parts[..] {
            let named = self.names.get(part);
            // Vertices of parts without triangles may come before its own.
            if named.is_none_or(|(.., base)| *base == 0) {
                let given = named.filter(|(_, is_given, _)| *is_given);
                let name = given.map(|(name, ..)| name.clone());
                return vec![NamedMesh::whole(name, mesh)];
            }
        }
        let mut names = Names::default();
        let mut numbers = vec![0; mesh.positions.len()];
        let bodies = of_parts.into_iter().map(|(part, faces)| {
            let named = self.names.get(part);
            let (name, base) =
                named.map_or(("default", 0), |(name, _, base)| (name.as_str(), *base));
            let (mesh, mut vertices) = part_of(&mesh.positions, faces, &mut numbers);
            for vertex in &mut vertices {
                *vertex -= base;
            }
            NamedMesh {
                name: Some(names.unique(name)),
                mesh,
                vertices: Some(vertices),
            }
        });
        bodies.collect()
    }
}

/// Names that are in use.
#[derive(Debug, Default)]
struct Names {
    used: HashSet<String>,
    /// How often each name has been asked for.
    times: HashMap<String, u32>,
}

impl Names {
    /// The name, or `name (2)` and so on if it is in use.
    fn unique(&mut self, name: &str) -> String {
        let time = self.times.entry(name.to_owned()).or_default();
        loop {
            *time += 1;
            let own = match *time {
                1 => name.to_owned(),
                n => format!("{name} ({n})"),
            };
            if self.used.insert(own.clone()) {
                return own;
            }
        }
    }
}

/// The mesh of these faces and the vertices that they name, in their order; and these vertices.
/// `numbers` has room for a number per vertex.
fn part_of(
    positions: &Positions,
    mut faces: Vec<[u32; 3]>,
    numbers: &mut [u32],
) -> (Mesh, Vec<u32>) {
    let mut named: Vec<u32> = faces.as_flattened().to_vec();
    named.sort_unstable();
    named.dedup();
    for (number, &vertex) in (0..).zip(&named) {
        numbers[vertex as usize] = number;
    }
    for vertex in faces.as_flattened_mut() {
        *vertex = numbers[*vertex as usize];
    }
    let positions = match positions {
        Positions::F32(all) => Positions::F32(named.iter().map(|&v| all[v as usize]).collect()),
        Positions::F64(all) => Positions::F64(named.iter().map(|&v| all[v as usize]).collect()),
    };
    let elements = Elements::Triangles(faces);
    let mesh = Mesh {
        positions,
        elements,
    };
    (mesh, named)
}
