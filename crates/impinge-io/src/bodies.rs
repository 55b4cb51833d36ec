//! The bodies of a file: nodes of a glTF file, objects or groups of an OBJ file.

use std::collections::HashMap;

use crate::mesh::{Elements, Mesh, Positions};

/// A body of a file, and the name that the file gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedMesh {
    /// The name of a node, an object or a group. `None` if the mesh is all that the file has, and
    /// the file gives it no name.
    pub name: Option<String>,
    /// Its elements in the order of the file, and the vertices that they name.
    pub mesh: Mesh,
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
    /// The name of each part, and whether the file gave it.
    names: Vec<(String, bool)>,
    /// The part of each name that a later triangle of this name belongs to.
    known: HashMap<String, usize>,
    /// The first triangle of a run, and the part that it belongs to; ascending.
    runs: Vec<(usize, usize)>,
}

impl Parts {
    /// From triangle `first` on, triangles belong to the part of this name: to a new one, or to the
    /// one that has it already.
    pub(crate) fn begin(&mut self, name: PartName<'_>, is_new: bool, first: usize) {
        let (name, is_given) = match name {
            PartName::Given(name) => (name, true),
            PartName::StandIn(name) => (name, false),
        };
        let part = match self.known.get(name) {
            Some(&part) if !is_new => part,
            _ => {
                self.names.push((name.to_owned(), is_given));
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
            _ => return vec![NamedMesh { name: None, mesh }],
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
            let given = self.names.get(part).filter(|(_, is_given)| *is_given);
            let name = given.map(|(name, _)| name.clone());
            return vec![NamedMesh { name, mesh }];
        }
        let mut times: HashMap<&str, u32> = HashMap::new();
        let mut numbers = vec![0; mesh.positions.len()];
        let bodies = of_parts.into_iter().map(|(part, faces)| {
            let name = self.names.get(part).map_or("default", |(name, _)| name);
            let time = times.entry(name).or_default();
            *time += 1;
            let name = match *time {
                1 => name.to_owned(),
                n => format!("{name} ({n})"),
            };
            NamedMesh {
                name: Some(name),
                mesh: part_of(&mesh.positions, faces, &mut numbers),
            }
        });
        bodies.collect()
    }
}

/// The mesh of these faces and the vertices that they name, in their order. `numbers` has room for
/// a number per vertex.
fn part_of(positions: &Positions, mut faces: Vec<[u32; 3]>, numbers: &mut [u32]) -> Mesh {
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
    Mesh {
        positions,
        elements: Elements::Triangles(faces),
    }
}
