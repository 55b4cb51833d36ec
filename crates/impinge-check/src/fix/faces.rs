//! Faces that go: duplicates, faces of zero area, and vertices that no face is left to use.

use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};

use impinge::exact::Point;
use impinge_io::Positions;

use crate::analysis::is_flat_triangle;
use crate::copies::Copies;
use crate::facets::is_simplex;
use crate::surface::Surface;
use crate::union_find::UnionFind;

/// Of faces with the same vertices the first stays, or none: see [`hanging`]. Returns how many go,
/// and how many of them are of sets of which none stays.
pub fn remove_duplicates(surface: &mut Surface) -> (u64, u64) {
    let copies = Copies::new(&surface.faces, surface.n_vertices());
    let mut goes = vec![false; surface.faces.len()];
    for &face in copies.sets().flat_map(|set| &set[1..]) {
        goes[face as usize] = true;
    }
    let mut n_opposite = 0;
    for set in hanging(surface, &copies, &goes) {
        goes[set[0] as usize] = true;
        n_opposite += set.len() as u64;
    }
    (remove(surface, &goes), n_opposite)
}

/// The sets of which no face stays.
///
/// Faces with the same vertices, as many of one orientation as of the other, enclose nothing: an
/// inner wall of two solids, or a fin of no thickness that hangs on one. With one of them left, the
/// surface would have a border that it did not have. So of faces like these that hang together,
/// none stays where the other faces meet in even numbers at each edge of theirs, and some there
/// are: then what is left is closed there. A sheet with two sides, which no other faces meet, keeps
/// one.
fn hanging<'a>(surface: &Surface, copies: &'a Copies, is_copy: &[bool]) -> Vec<&'a [u32]> {
    let is_even = |face: &u32| {
        let [a, b, c] = surface.faces[*face as usize];
        [a > b, b > c, a > c].iter().filter(|it| **it).count() % 2 == 0
    };
    let cancel = |set: &&[u32]| {
        let n_even = set.iter().filter(|face| is_even(face)).count();
        2 * n_even == set.len() && is_simplex(&surface.faces[set[0] as usize])
    };
    let sets: Vec<&[u32]> = copies.sets().filter(cancel).collect();
    let mut of_face = HashMap::new();
    // The sets at each edge, and how many other faces there are.
    let mut edges: HashMap<[u32; 2], (Vec<u32>, u32)> = HashMap::new();
    for (ix, set) in (0u32..).zip(&sets) {
        of_face.insert(set[0], ix);
        for edge in sides(surface.faces[set[0] as usize]) {
            edges.entry(Edges::key(edge)).or_default().0.push(ix);
        }
    }
    for (face, &corners) in (0u32..).zip(&surface.faces) {
        if is_copy[face as usize] || of_face.contains_key(&face) || !is_simplex(&corners) {
            continue;
        }
        for edge in sides(corners) {
            if let Some((_, n_others)) = edges.get_mut(&Edges::key(edge)) {
                *n_others += 1;
            }
        }
    }
    let mut patches = UnionFind::new(sets.len() as u32);
    for (at_edge, _) in edges.values() {
        for &set in &at_edge[1..] {
            patches.join(at_edge[0], set);
        }
    }
    let (mut is_closed, mut hangs) = (vec![true; sets.len()], vec![false; sets.len()]);
    for (at_edge, n_others) in edges.values() {
        let patch = patches.root(at_edge[0]) as usize;
        is_closed[patch] &= n_others % 2 == 0;
        hangs[patch] |= *n_others > 0;
    }
    let mut goes = |ix: &u32| {
        let patch = patches.root(*ix) as usize;
        is_closed[patch] && hangs[patch]
    };
    let going: Vec<u32> = (0..sets.len() as u32).filter(|ix| goes(ix)).collect();
    going.into_iter().map(|ix| sets[ix as usize]).collect()
}

/// The most neighbours at the long side of a flat face that it divides.
const MOST_NEIGHBOURS: usize = 16;

/// Removes faces of zero area. Returns how many were removed, whole or in part, and how many have
/// divided neighbours instead.
///
/// A face of zero area whose vertices are three different points is a segment. If it just went, its
/// long side and its two short ones would be borders, although the surface has no gap there. So all
/// neighbours at the long side are divided at the middle vertex, which lies exactly on it: the
/// halves take the places of the face and of its neighbours, and further ones come last.
///
/// Neighbours may have zero area, too: their halves are shorter, and divide in their turn. A face
/// just goes where [`divide`] says `None`, and where more faces would be added than there were. So
/// the surface at most doubles.
pub fn remove_degenerate(surface: &mut Surface) -> (u64, u64) {
    let collapsed: Vec<bool> = surface.faces.iter().map(|face| !is_simplex(face)).collect();
    let n_collapsed = remove(surface, &collapsed);
    let is_flat = |surface: &Surface, face: [u32; 3]| is_flat_triangle(&surface.corners(face));
    let mut flat: Vec<bool> = surface
        .faces
        .iter()
        .map(|&face| is_flat(surface, face))
        .collect();
    if !flat.contains(&true) {
        return (n_collapsed, 0);
    }
    let mut edges = Edges::new(&surface.faces);
    let mut queue: VecDeque<u32> = (0u32..)
        .zip(&flat)
        .filter(|(_, is_flat)| **is_flat)
        .map(|(face, _)| face)
        .collect();
    let n_flat = queue.len() as u64;
    let most_faces = surface.faces.len().saturating_mul(2).min(u32::MAX as usize);
    // The face that each is a part of, as they were.
    let mut whole: Vec<u32> = (0u32..).zip(&flat).map(|(face, _)| face).collect();
    // Each division takes flat faces of one length, and those that it leaves are shorter: it ends.
    while let Some(face) = queue.pop_front() {
        if !flat[face as usize] {
            continue;
        }
        let Some(divided) = divide(surface, &edges, &flat, face) else {
            continue;
        };
        let n_faces = surface.faces.len();
        let n_with_halves = n_faces + divided.halves.len() - divided.faces.len();
        if n_with_halves > most_faces {
            continue;
        }
        for &face in &divided.faces {
            edges.remove(face, surface.faces[face as usize]);
        }
        surface.faces.resize(n_with_halves, [0; 3]);
        flat.resize(n_with_halves, false);
        whole.resize(n_with_halves, 0);
        let parents: Vec<u32> = divided.faces[1..]
            .iter()
            .map(|&face| whole[face as usize])
            .collect();
        let places = divided.faces.into_iter().chain(n_faces as u32..);
        for (ix, (face, &corners)) in places.zip(&divided.halves).enumerate() {
            surface.faces[face as usize] = corners;
            flat[face as usize] = is_flat(surface, corners);
            whole[face as usize] = parents[ix / 2];
            edges.add(face, corners);
        }
        // What could not be divided before may be now.
        for corners in divided.halves {
            for edge in sides(corners) {
                if edges.n_of(edge) <= MOST_NEIGHBOURS + 1 {
                    queue.extend(edges.of(edge).filter(|&face| flat[face as usize]));
                }
            }
        }
    }
    let left = whole.iter().zip(&flat).filter(|(_, is_flat)| **is_flat);
    let n_removed = left.map(|(face, _)| face).collect::<HashSet<_>>().len() as u64;
    remove(surface, &flat);
    (n_collapsed + n_removed, n_flat - n_removed)
}

/// A flat face and its neighbours, and the halves of the neighbours that take their places: two of
/// each, in the order of the neighbours.
struct Divided {
    faces: Vec<u32>,
    halves: Vec<[u32; 3]>,
}

/// How the neighbours at the long side of a flat face are divided; `None` if there are none, if
/// there are more than [`MOST_NEIGHBOURS`], if one is flat with another long side or has the same
/// vertices, or if the halves would make an edge that exists already.
fn divide(surface: &Surface, edges: &Edges, flat: &[bool], face: u32) -> Option<Divided> {
    let corners = surface.faces[face as usize];
    let points = surface.corners(corners);
    let middle =
        (0..3).find(|&ix| is_between(&points[ix], &points[(ix + 1) % 3], &points[(ix + 2) % 3]))?;
    let [b, c, a] = [0, 1, 2].map(|step| corners[(middle + step) % 3]);
    if edges.n_of([a, c]) > MOST_NEIGHBOURS + 1 {
        return None;
    }
    let mut divided = Divided {
        faces: vec![face],
        halves: Vec::new(),
    };
    for neighbour in edges.of([a, c]).filter(|&other| other != face) {
        let held = surface.faces[neighbour as usize];
        let d = held
            .into_iter()
            .find(|&vertex| vertex != a && vertex != c)?;
        if d == b || edges.n_of([b, d]) > 0 {
            return None;
        }
        // A flat neighbour is only divided if its own long side is the same; else it is its
        // neighbours' turn first.
        if flat[neighbour as usize] {
            let [at_a, at_c, at_d] = surface.corners([a, c, d]);
            if !is_between(&at_d, &at_a, &at_c) {
                return None;
            }
        }
        let replaced = |old: u32| held.map(|vertex| if vertex == old { b } else { vertex });
        divided.faces.push(neighbour);
        divided.halves.extend([replaced(c), replaced(a)]);
    }
    (divided.faces.len() > 1).then_some(divided)
}

/// Whether a point of the line through a and c lies strictly between them.
fn is_between(b: &Point, a: &Point, c: &Point) -> bool {
    (0..3).any(|axis| {
        let (low, high) = (a[axis].min(c[axis]), a[axis].max(c[axis]));
        low < b[axis] && b[axis] < high
    })
}

fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The faces at each edge, while faces change. Sets, as many faces may share an edge.
struct Edges(HashMap<[u32; 2], BTreeSet<u32>>);

impl Edges {
    fn new(faces: &[[u32; 3]]) -> Self {
        let mut edges = Edges(HashMap::with_capacity(faces.len() * 3 / 2));
        for (face, &corners) in (0u32..).zip(faces) {
            edges.add(face, corners);
        }
        edges
    }

    fn key([a, b]: [u32; 2]) -> [u32; 2] {
        [a.min(b), a.max(b)]
    }

    fn n_of(&self, edge: [u32; 2]) -> usize {
        self.0.get(&Self::key(edge)).map_or(0, BTreeSet::len)
    }

    fn of(&self, edge: [u32; 2]) -> impl Iterator<Item = u32> {
        self.0.get(&Self::key(edge)).into_iter().flatten().copied()
    }

    fn add(&mut self, face: u32, corners: [u32; 3]) {
        for edge in sides(corners) {
            self.0.entry(Self::key(edge)).or_default().insert(face);
        }
    }

    fn remove(&mut self, face: u32, corners: [u32; 3]) {
        for edge in sides(corners) {
            if let Some(faces) = self.0.get_mut(&Self::key(edge)) {
                faces.remove(&face);
            }
        }
    }
}

/// Removes marked faces and returns how many there were.
pub fn remove(surface: &mut Surface, marked: &[bool]) -> u64 {
    let n = surface.faces.len();
    let mut marks = marked.iter();
    surface
        .faces
        .retain(|_| !marks.next().copied().unwrap_or(false));
    (n - surface.faces.len()) as u64
}

/// Removes vertices of no face and returns how many there were. The order of the others stays.
pub fn remove_unused(surface: &mut Surface) -> u64 {
    let n = surface.n_vertices();
    let mut places = vec![u32::MAX; n];
    for &vertex in surface.faces.as_flattened() {
        places[vertex as usize] = 0;
    }
    let mut next = 0u32;
    for place in places.iter_mut().filter(|place| **place == 0) {
        *place = next;
        next += 1;
    }
    if next as usize == n {
        return 0;
    }
    fn kept<P>(held: &mut Vec<P>, places: &[u32]) {
        let mut places = places.iter();
        held.retain(|_| places.next().is_some_and(|&place| place != u32::MAX));
    }
    match &mut surface.positions {
        Positions::F32(held) => kept(held, &places),
        Positions::F64(held) => kept(held, &places),
    }
    for vertex in surface.faces.as_flattened_mut() {
        *vertex = places[*vertex as usize];
    }
    n as u64 - u64::from(next)
}
