//! The check of one mesh in memory.
//!
//! In: a mesh with indices in range. Out: [`Counts`], and the [`Marks`] of each element. The
//! steps are welding, self-intersections, facets, union of neighbours and zero areas; each is
//! exact.

use impinge::exact::{Point, orient2d, orient3d};
use impinge::{Backend, Detector, Error, Query, Scene, Settings};
use impinge_io::{Elements, Mesh, Positions, Weld};

use crate::copies::Copies;
use crate::facets::{Facet, facets, groups, is_simplex};
use crate::marks::{Marks, Problem};
use crate::places::{Place, places};
use crate::row::Counts;
use crate::shells::{self, Shell};
use crate::surface::{at, held};
use crate::union_find::UnionFind;
use crate::volume;
use crate::walls;

/// How a mesh is checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Whether vertices at exactly the same position are welded first. On by default: many formats
    /// repeat vertices per face, and without welding every edge would be a border.
    pub weld: bool,
    /// Whether edges, vertices and copies are counted as the mesh has them, and only
    /// self-intersections are sought with vertices at one position welded.
    /// [`fix_mesh`](crate::fix_mesh) parts edges and vertices without moving them: welding
    /// everything would join them again, and welding nothing would report that they touch.
    /// [`weld`](Self::weld) is then ignored.
    pub keep_seams: bool,
    /// The most [places](crate::Place) of each problem that are said, largest first; 3 by default.
    /// No count depends on it.
    pub places: usize,
    /// Whether places name all their elements, not only the first few.
    pub faces: bool,
    /// If a length is given, faces at walls that are at most as thick are counted and marked: near
    /// faces that turn their backs to each other, with matter between them. None by default. Meshes
    /// of tetrahedra have none.
    pub min_thickness: Option<f64>,
    /// Whether a [`Row`](crate::Row) holds the problems of each element, with which
    /// [`Checked::of_row`] shows the mesh without another check. Off by default.
    pub marks: bool,
    /// CPU threads of the self-intersection search; 0 means one per core. No count depends on it.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            weld: true,
            keep_seams: false,
            places: 3,
            faces: false,
            min_thickness: None,
            marks: false,
            threads: 0,
        }
    }
}

/// The result of a check.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The counts of problems.
    pub counts: Counts,
    /// The problems of each element, in the order of the mesh.
    pub marks: Vec<Marks>,
    /// Where the problems are.
    pub places: Vec<Place>,
    /// The checked mesh: welded, if the options say so.
    pub mesh: Mesh,
}

/// Checks a mesh. Its indices must be in range; positions may be anything.
///
/// # Errors
/// Positions or indices that [`Scene::add`] refuses (NaN, infinities), and more
/// corners than 32 bits can number.
pub fn check_mesh(mesh: Mesh, options: &Options) -> Result<Checked, Error> {
    Ok(check(mesh, options)?.0)
}

/// The check of a mesh, and the pairs that [`Counts::self_intersections`] counts; none if they are
/// more than the search lists.
pub fn check_listed(mesh: Mesh, options: &Options) -> Result<(Checked, Vec<[u32; 2]>), Error> {
    let (checked, pairs) = check(mesh, options)?;
    let is_whole = pairs.len() as u64 == checked.counts.self_intersections;
    Ok((checked, if is_whole { pairs } else { Vec::new() }))
}

/// Whether each element intersects another one, vertices at one position welded.
pub fn intersecting_with_seams(mesh: &Mesh, options: &Options) -> Result<Vec<bool>, Error> {
    let mut marks = vec![Marks::default(); mesh.n_elements()];
    intersections(&welded(mesh), options, &mut Counts::default(), &mut marks)?;
    let is_marked = |marks: &Marks| marks.has(Problem::SelfIntersection);
    Ok(marks.iter().map(is_marked).collect())
}

/// The settings of a detector that checks.
fn settings(options: &Options) -> Settings {
    Settings::new()
        .backend(Backend::Cpu)
        .threads(options.threads)
}

fn check(mut mesh: Mesh, options: &Options) -> Result<(Checked, Vec<[u32; 2]>), Error> {
    let n_vertices = mesh.n_vertices();
    let welds = options.weld && !options.keep_seams;
    let weld = welds.then(|| Weld::by_position(&mesh.positions));
    if let Some(weld) = &weld {
        weld.apply(&mut mesh);
    }
    mesh.positions.narrow_if_exact();
    let mut counts = Counts {
        n_vertices: n_vertices as u64,
        n_welded: weld.as_ref().map_or(0, Weld::n_welded) as u64,
        ..Counts::default()
    };
    let mut marks = vec![Marks::default(); mesh.n_elements()];
    // This comes first because it refuses indices out of range and coordinates that are not finite,
    // on which the steps below rely.
    let (pairs, copies) = if options.keep_seams {
        let (pairs, _) = intersections(&welded(&mesh), options, &mut counts, &mut marks)?;
        (pairs, copies(&mesh))
    } else {
        intersections(&mesh, options, &mut counts, &mut marks)?
    };
    duplicates(&copies, &mut counts, &mut marks);
    let fans;
    match &mesh.elements {
        Elements::Triangles(triangles) => {
            counts.n_triangles = triangles.len() as u64;
            let found = topology(triangles, mesh.n_vertices(), &mut counts, &mut marks)?;
            fans = found.fans;
            let (mut pieces, is_closed) = (found.pieces, found.is_closed);
            let mut shells = shells::closed(&mesh.positions, triangles, &mut pieces, is_closed);
            shells::nest(&mesh.positions, triangles, &mut shells, options.threads)?;
            inside_out(&shells, &mut counts, &mut marks);
            if counts.is_watertight == Some(true) && counts.inconsistent_facets == 0 {
                let points = |corners: &[u32; 3]| corners.map(|vertex| at(&mesh.positions, vertex));
                let volume = volume::rounded(triangles.iter().map(points));
                counts.volume = Some(volume).filter(|volume| volume.is_finite());
            }
            degenerate(
                &mesh.positions,
                triangles,
                is_flat_triangle,
                &mut counts,
                &mut marks,
            );
            counts.min_thickness = options.min_thickness;
            if let Some(most) = options.min_thickness {
                let settings = settings(options);
                let positions = &mesh.positions;
                walls::find(
                    positions,
                    triangles,
                    most,
                    &settings,
                    &mut counts,
                    &mut marks,
                )?;
            }
        }
        Elements::Tetrahedra(tets) => {
            counts.n_tetrahedra = tets.len() as u64;
            fans = topology(tets, mesh.n_vertices(), &mut counts, &mut marks)?.fans;
            degenerate(
                &mesh.positions,
                tets,
                is_flat_tetrahedron,
                &mut counts,
                &mut marks,
            );
        }
    }
    let mut places = places(&mesh, &marks, &fans, options.places, options.faces);
    let vertices = places.iter_mut().filter_map(|place| place.vertex.as_mut());
    if let Some(weld) = &weld {
        vertices.for_each(|vertex| *vertex = weld.firsts()[*vertex as usize]);
    }
    let checked = Checked {
        counts,
        places,
        marks,
        mesh,
    };
    Ok((checked, pairs))
}

/// The mesh with vertices at one position as one. Its elements keep their numbers.
fn welded(mesh: &Mesh) -> Mesh {
    let mut welded = mesh.clone();
    impinge_io::weld(&mut welded);
    welded
}

/// The elements with the same vertices. Indices must be in range.
fn copies(mesh: &Mesh) -> Copies {
    match &mesh.elements {
        Elements::Triangles(triangles) => Copies::new(triangles, mesh.n_vertices()),
        Elements::Tetrahedra(tets) => Copies::new(tets, mesh.n_vertices()),
    }
}

/// Counts and marks elements with the vertices of an earlier one.
fn duplicates(copies: &Copies, counts: &mut Counts, marks: &mut [Marks]) {
    for &element in copies.sets().flat_map(|set| &set[1..]) {
        counts.duplicates += 1;
        marks[element as usize].add(Problem::Duplicate);
    }
}

/// Counts and marks pairs that share more points than their common vertices, edge or face. Returns
/// the pairs that were found, sorted, and the elements with the same vertices.
fn intersections(
    mesh: &Mesh,
    options: &Options,
    counts: &mut Counts,
    marks: &mut [Marks],
) -> Result<(Vec<[u32; 2]>, Copies), Error> {
    let mut scene = Scene::new();
    let elements: impinge::Elements = match &mesh.elements {
        Elements::Triangles(triangles) => triangles.clone().into(),
        Elements::Tetrahedra(tets) => tets.clone().into(),
    };
    let body = scene.add((elements, held(&mesh.positions)))?;
    // The scene has refused indices out of range.
    let copies = copies(mesh);
    let few = copies.few(mesh.n_elements());
    if let Some(few) = &few {
        let at = |kept: &u32| *kept as usize;
        let elements: impinge::Elements = match &mesh.elements {
            Elements::Triangles(triangles) => {
                let kept = few.kept.iter().map(|kept| triangles[at(kept)]);
                kept.collect::<Vec<_>>().into()
            }
            Elements::Tetrahedra(tets) => {
                let kept = few.kept.iter().map(|kept| tets[at(kept)]);
                kept.collect::<Vec<_>>().into()
            }
        };
        let positions = scene.body(body)?.positions().clone();
        scene.remesh(body, (elements, positions))?;
    }
    let mut detector = Detector::new(settings(options))?;
    let pairs = detector.detect(&scene, &Query::self_of(body))?;
    let mut found: Vec<[u32; 2]> = pairs.self_of(body).collect();
    match &few {
        None => {
            counts.self_intersections = pairs.len() as u64;
            counts.hash = Some(pairs.hash());
            for &element in found.as_flattened() {
                marks[element as usize].add(Problem::SelfIntersection);
            }
        }
        Some(few) => {
            (counts.self_intersections, counts.hash) = few.count(found.iter().copied());
            for side in found.iter().flat_map(|&pair| few.pairs(pair).sides()) {
                // Either all of a side are marked or none.
                let is_new = |first: &u32| !marks[*first as usize].has(Problem::SelfIntersection);
                if side.first().is_some_and(is_new) {
                    for &element in side {
                        marks[element as usize].add(Problem::SelfIntersection);
                    }
                }
            }
            for place in found.as_flattened_mut() {
                *place = few.kept[*place as usize];
            }
        }
    }
    let is_marked = |marks: &&Marks| marks.has(Problem::SelfIntersection);
    counts.n_intersecting = marks.iter().filter(is_marked).count() as u64;
    Ok((found, copies))
}

/// Counts and marks shells that are inside out.
fn inside_out(shells: &[Shell], counts: &mut Counts, marks: &mut [Marks]) {
    let turned = shells.iter().filter(|shell| shell.is_inside_out());
    counts.inside_out = Some(turned.clone().count() as u64);
    for &face in turned.flat_map(|shell| &shell.faces) {
        marks[face as usize].add(Problem::InsideOut);
    }
}

/// How elements hang together.
struct Topology {
    /// The vertices of several fans, ascending.
    fans: Vec<u32>,
    /// Elements connected through facets.
    pieces: UnionFind,
    /// Whether an element has a neighbour of its orientation at each facet.
    is_closed: Vec<bool>,
}

/// Counts and marks everything that depends on vertex indices alone.
fn topology<const K: usize>(
    elements: &[[u32; K]],
    n_vertices: usize,
    counts: &mut Counts,
    marks: &mut [Marks],
) -> Result<Topology, Error> {
    let n_corners = u32::try_from(elements.len() * K).map_err(|_| Error::TooMany {
        what: "corners of elements",
        given: (elements.len() * K) as u64,
        limit: u64::from(u32::MAX),
    })?;
    let mut corners = UnionFind::new(n_corners);
    let mut pieces = UnionFind::new(n_corners / K as u32);
    let mut borders = UnionFind::new(n_vertices as u32);
    let mut on_border = vec![false; n_vertices];
    let mut is_closed: Vec<bool> = elements.iter().map(is_simplex).collect();
    let sorted = facets(elements, n_vertices);
    let mut n_facets = 0i64;
    for group in groups(&sorted) {
        n_facets += 1;
        let problem = match group {
            [alone] => {
                counts.boundary_facets += 1;
                for vertex in alone.vertices {
                    on_border[vertex as usize] = true;
                    borders.join(alone.vertices[0], vertex);
                }
                (K == 3).then_some(Problem::Boundary)
            }
            [a, b] if a.is_even != b.is_even => None,
            [_, _] => {
                counts.inconsistent_facets += 1;
                Some(Problem::Inconsistent)
            }
            _ => {
                counts.non_manifold_facets += 1;
                Some(Problem::NonManifold)
            }
        };
        let closes = matches!(group, [a, b] if a.is_even != b.is_even);
        for facet in group {
            if let Some(problem) = problem {
                marks[facet.element as usize].add(problem);
            }
            is_closed[facet.element as usize] &= closes;
            join_neighbours(elements, &group[0], facet, &mut corners, &mut pieces);
        }
    }
    drop(sorted);
    counts.boundaries = n_roots(&mut borders, |vertex| on_border[vertex as usize]);
    counts.components = n_roots(&mut pieces, |element| {
        is_simplex(&elements[element as usize])
    });
    let (n_used, fans) = count_vertices(elements, n_vertices, &mut corners, counts);
    if K == 3 {
        let n_faces = elements.iter().filter(|held| is_simplex(held)).count() as i64;
        counts.euler = Some(n_used - n_facets + n_faces);
        let has_pairs = counts.boundary_facets + counts.non_manifold_facets == 0;
        counts.is_watertight = Some(has_pairs && n_faces > 0);
    }
    Ok(Topology {
        fans,
        pieces,
        is_closed,
    })
}

/// Two elements with a common facet belong to one piece, and to one fan around each vertex of the
/// facet.
fn join_neighbours<const K: usize>(
    elements: &[[u32; K]],
    a: &Facet,
    b: &Facet,
    corners: &mut UnionFind,
    pieces: &mut UnionFind,
) {
    pieces.join(a.element, b.element);
    let corner = |element: u32, vertex: u32| {
        let ix = elements[element as usize]
            .iter()
            .position(|&held| held == vertex);
        element * K as u32 + ix.unwrap_or_default() as u32
    };
    for vertex in a.vertices {
        corners.join(corner(a.element, vertex), corner(b.element, vertex));
    }
}

/// The number of sets whose smallest number satisfies `counts`.
fn n_roots(sets: &mut UnionFind, counts: impl Fn(u32) -> bool) -> u64 {
    let n = sets.len();
    (0..n).filter(|&x| counts(x) && sets.root(x) == x).count() as u64
}

/// Counts vertices of no element, and vertices around which elements form several fans. Returns
/// how many vertices belong to elements that name no vertex twice, and those of several fans.
fn count_vertices<const K: usize>(
    elements: &[[u32; K]],
    n_vertices: usize,
    corners: &mut UnionFind,
    counts: &mut Counts,
) -> (i64, Vec<u32>) {
    const UNUSED: u8 = 0;
    const USED: u8 = 1;
    const ONE_FAN: u8 = 2;
    const SEVERAL_FANS: u8 = 3;
    let mut states = vec![UNUSED; n_vertices];
    for (element, held) in (0u32..).zip(elements) {
        let is_simplex = is_simplex(held);
        for (ix, &vertex) in (0u32..).zip(held) {
            let state = &mut states[vertex as usize];
            let corner = element * K as u32 + ix;
            if is_simplex && corners.root(corner) == corner {
                *state = if *state < ONE_FAN {
                    ONE_FAN
                } else {
                    SEVERAL_FANS
                };
            } else {
                *state = (*state).max(USED);
            }
        }
    }
    let count = |sought: u8| states.iter().filter(|&&state| state == sought).count() as u64;
    counts.unused_vertices = count(UNUSED);
    let fans: Vec<u32> = (0u32..)
        .zip(&states)
        .filter(|(_, state)| **state == SEVERAL_FANS)
        .map(|(vertex, _)| vertex)
        .collect();
    counts.non_manifold_vertices = fans.len() as u64;
    ((count(ONE_FAN) + count(SEVERAL_FANS)) as i64, fans)
}

fn degenerate<const K: usize>(
    positions: &Positions,
    elements: &[[u32; K]],
    is_flat: impl Fn(&[Point; K]) -> bool,
    counts: &mut Counts,
    marks: &mut [Marks],
) {
    for (corners, marks) in elements.iter().zip(marks) {
        let points = corners.map(|vertex| at(positions, vertex));
        if is_flat(&points) {
            counts.degenerate += 1;
            marks.add(Problem::Degenerate);
        }
    }
}

/// A triangle has zero area if and only if all its projections onto the three coordinate planes
/// have zero area.
pub fn is_flat_triangle([a, b, c]: &[Point; 3]) -> bool {
    [[0, 1], [1, 2], [2, 0]].iter().all(|&[u, v]| {
        let drop = |p: &Point| [p[u], p[v]];
        orient2d(drop(a), drop(b), drop(c)).is_zero()
    })
}

fn is_flat_tetrahedron([a, b, c, d]: &[Point; 4]) -> bool {
    orient3d(a, b, c, d).is_zero()
}
