//! Mends meshes of triangles without moving a vertex.
//!
//! In: a mesh with indices in range. Out: the mended mesh, what each repair did, and the counts of
//! a check before and after. Repairs run in the order of [`Repair::ALL`]; each leaves alone what an
//! earlier one has mended. Every decision about geometry is the sign of a determinant or a
//! comparison of coordinates, so it is exact. Only the choice among several triangulations of a
//! hole is by rounded areas, and every triangle that is chosen passes exact tests.
//!
//! Edges are split by where matter is, which is known for certain only when closed shells are
//! turned and holes are filled. So where that happens, the split is made again with the faces turned
//! and those of the fillings: see [`part`].
//!
//! Positions are never computed: a vertex of the result has the bits of a vertex of the input.

mod faces;
mod holes;
mod orient;
mod shells;
mod split;

use impinge::Error;
use impinge_io::{Elements, Mesh, weld};

use crate::analysis::{self, Options, check_mesh};
use crate::places::Place;
use crate::row::Counts;
use crate::surface::Surface;

pub(crate) use faces::remove_degenerate;
pub use holes::MOST_HOLE_EDGES;

/// Splits after which shells are turned for the last time.
const MOST_SPLITS: u32 = 8;

/// How often holes are closed at most.
const MOST_CLOSINGS: u32 = 8;

/// One kind of repair.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Repair {
    /// Vertices at exactly the same position become one.
    Weld,
    /// Of faces with the same vertices, in any order, the first one stays; none where two of
    /// opposite orientations hang on a closed surface, as an inner wall or a fin.
    Duplicates,
    /// Faces of zero area go. Where one lies along an edge of neighbours, these are divided there,
    /// so that no gap opens; not where a half would have an edge that is there already, where more
    /// than 16 neighbours share the edge, or where one of zero area stays. The divisions add at most
    /// as many faces as there were.
    Degenerate,
    /// Neighbours get the same orientation. In each piece the fewest faces are turned.
    Orient,
    /// Edges of more than two faces come apart: faces that bound the same matter stay together. What
    /// hangs on a closed surface, as a fin or a single wall, gets a border and opens no solid.
    SplitEdges,
    /// Vertices of several fans come apart: each fan gets a vertex of its own at the same position.
    SplitVertices,
    /// Holes of few edges are filled with triangles between their vertices.
    CloseHoles,
    /// Closed shells are turned so that matter is inside: outer ones outward, cavities inward.
    Outward,
    /// Vertices of no face go.
    Unused,
}

impl Repair {
    /// All repairs, in the order in which they run.
    pub const ALL: [Repair; 9] = [
        Repair::Weld,
        Repair::Duplicates,
        Repair::Degenerate,
        Repair::Orient,
        Repair::SplitEdges,
        Repair::SplitVertices,
        Repair::CloseHoles,
        Repair::Outward,
        Repair::Unused,
    ];

    /// The name in options and answers, such as `split-edges`.
    pub fn name(self) -> &'static str {
        match self {
            Repair::Weld => "weld",
            Repair::Duplicates => "duplicates",
            Repair::Degenerate => "degenerate",
            Repair::Orient => "orient",
            Repair::SplitEdges => "split-edges",
            Repair::SplitVertices => "split-vertices",
            Repair::CloseHoles => "close-holes",
            Repair::Outward => "outward",
            Repair::Unused => "unused",
        }
    }
}

/// What is mended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FixOptions {
    /// The repairs, in any order. All of them by default.
    pub repairs: Vec<Repair>,
    /// The most edges of a hole that is closed; 0, the default, closes none. At most
    /// [`MOST_HOLE_EDGES`].
    pub close_holes: usize,
    /// CPU threads; 0 means one per core. The result does not depend on it.
    pub threads: usize,
}

impl Default for FixOptions {
    fn default() -> Self {
        FixOptions {
            repairs: Repair::ALL.to_vec(),
            close_holes: 0,
            threads: 0,
        }
    }
}

/// What each repair did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repairs {
    /// Vertices that welding removed.
    pub welded_vertices: u64,
    /// Faces removed because an earlier one has their vertices, the next ones included.
    pub duplicate_faces: u64,
    /// Faces of sets with the same vertices and both orientations, of which none stays: they
    /// enclosed nothing, and one of them would leave a border.
    pub opposite_faces: u64,
    /// Faces of zero area that were removed, whole or in part.
    pub degenerate_faces: u64,
    /// Faces of zero area that were used to divide their neighbours at one side.
    pub divided_faces: u64,
    /// Faces turned to agree with their neighbours.
    pub turned_faces: u64,
    /// Pieces that have no consistent orientation, such as Möbius strips. They stay as they are.
    pub non_orientable: u64,
    /// Edges of more than two faces that were split.
    pub split_edges: u64,
    /// Vertices added by splitting edges.
    pub split_edges_added: u64,
    /// Vertices of several fans that were split, those on split edges left out.
    pub split_vertices: u64,
    /// Vertices added by splitting vertices.
    pub split_vertices_added: u64,
    /// Holes that were closed.
    pub closed_holes: u64,
    /// Faces that close them.
    pub added_faces: u64,
    /// Holes of few enough edges that stay open, because every filling would be degenerate, not
    /// manifold or intersect something.
    pub refused_holes: u64,
    /// Closed shells: pieces without a border, of one orientation.
    pub shells: u64,
    /// Shells inside an odd number of others: their normals point into the hollow.
    pub cavities: u64,
    /// Shells that were inside out, whole or in part.
    pub turned_shells: u64,
    /// Shells of exactly zero volume, which have no inside and stay as they are.
    pub flat_shells: u64,
    /// Vertices of no face that were removed.
    pub unused_vertices: u64,
}

/// A mended mesh.
#[derive(Debug, Clone)]
pub struct Fixed {
    /// The mesh. It has no face if all faces had zero area.
    pub mesh: Mesh,
    /// What each repair did.
    pub repairs: Repairs,
    /// The check of the mesh as it was; welded, if the repairs weld.
    pub before: Counts,
    /// The check of the mended mesh, with [`keep_seams`](Options::keep_seams).
    pub after: Counts,
    /// Where the problems of the mesh were.
    pub places_before: Vec<Place>,
    /// Where those of the mended mesh are.
    pub places_after: Vec<Place>,
    /// The pairs of faces of the mended mesh that intersect, sorted. They are not mended. Empty if
    /// [`after`](Self::after) counts more than the pairs that [`check_mesh`] lists.
    pub self_intersections: Vec<[u32; 2]>,
}

impl Fixed {
    /// Whether vertices at one position are different ones, so that a check has to keep seams to
    /// see what this repair has done.
    pub fn has_seams(&self) -> bool {
        self.repairs.split_edges_added + self.repairs.split_vertices_added > 0
    }

    /// What a repair did, by the names in answers.
    pub fn numbers(&self, repair: Repair) -> Vec<(&'static str, u64)> {
        let done = &self.repairs;
        match repair {
            Repair::Weld => vec![("vertices_removed", done.welded_vertices)],
            Repair::Duplicates => vec![
                ("faces_removed", done.duplicate_faces),
                ("opposite_faces", done.opposite_faces),
            ],
            Repair::Degenerate => vec![
                ("faces_removed", done.degenerate_faces),
                ("faces_divided", done.divided_faces),
            ],
            Repair::Orient => vec![
                ("faces_turned", done.turned_faces),
                ("pieces_not_orientable", done.non_orientable),
            ],
            Repair::SplitEdges => vec![
                ("edges_split", done.split_edges),
                ("vertices_added", done.split_edges_added),
            ],
            Repair::SplitVertices => vec![
                ("vertices_split", done.split_vertices),
                ("vertices_added", done.split_vertices_added),
            ],
            Repair::CloseHoles => vec![
                ("holes_closed", done.closed_holes),
                ("faces_added", done.added_faces),
                ("holes_refused", done.refused_holes),
            ],
            Repair::Outward => vec![
                ("shells", done.shells),
                ("cavities", done.cavities),
                ("shells_turned", done.turned_shells),
                ("shells_flat", done.flat_shells),
            ],
            Repair::Unused => vec![("vertices_removed", done.unused_vertices)],
        }
    }
}

/// Why a mesh is not mended.
#[derive(Debug, thiserror::Error)]
pub enum FixError {
    /// Only meshes of triangles are mended.
    #[error("{0} tetrahedra: only meshes of triangles are mended")]
    Tetrahedra(usize),
    /// A limit that is too large.
    #[error("holes of up to {0} edges: at most {MOST_HOLE_EDGES} can be asked for")]
    Holes(usize),
    /// Content that the library refuses.
    #[error(transparent)]
    Refused(#[from] impinge::Error),
}

/// Mends a mesh of triangles. Its indices must be in range. No vertex is moved.
///
/// ```
/// use impinge_check::{FixOptions, fix_mesh};
/// use impinge_io::{Elements, Mesh, Positions};
/// # fn main() -> Result<(), impinge_check::FixError> {
/// // A tetrahedron, one of whose faces is turned, and another one twice.
/// let mesh = Mesh {
///     positions: Positions::F32(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
///     elements: Elements::Triangles(vec![[0, 2, 1], [0, 1, 3], [1, 3, 2], [2, 0, 3], [0, 1, 3]]),
/// };
/// let fixed = fix_mesh(mesh, &FixOptions::default())?;
/// assert_eq!((fixed.repairs.turned_faces, fixed.repairs.duplicate_faces), (1, 1));
/// assert_eq!(fixed.after.inconsistent_facets + fixed.after.duplicates, 0);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`FixError`].
pub fn fix_mesh(mesh: Mesh, options: &FixOptions) -> Result<Fixed, FixError> {
    let does = |repair: Repair| options.repairs.contains(&repair);
    if let Elements::Tetrahedra(tets) = &mesh.elements {
        return Err(FixError::Tetrahedra(tets.len()));
    }
    if options.close_holes > MOST_HOLE_EDGES {
        return Err(FixError::Holes(options.close_holes));
    }
    // This refuses indices out of range and coordinates that are not finite, on which everything
    // below relies.
    let checked_as_it_was = Options {
        weld: does(Repair::Weld),
        keep_seams: !does(Repair::Weld),
        threads: options.threads,
        ..Options::default()
    };
    let was = check_mesh(mesh.clone(), &checked_as_it_was)?;
    let mut repairs = Repairs::default();
    let mut mesh = mesh;
    if does(Repair::Weld) {
        repairs.welded_vertices = weld(&mut mesh) as u64;
    }
    let Elements::Triangles(faces) = mesh.elements else {
        return Err(FixError::Tetrahedra(0));
    };
    let mut surface = Surface::new(mesh.positions, faces);
    if does(Repair::Duplicates) {
        (repairs.duplicate_faces, repairs.opposite_faces) = faces::remove_duplicates(&mut surface);
    }
    if does(Repair::Degenerate) {
        (repairs.degenerate_faces, repairs.divided_faces) = faces::remove_degenerate(&mut surface);
    }
    part(&mut surface, options, &mut repairs)?;
    if does(Repair::Unused) {
        repairs.unused_vertices = faces::remove_unused(&mut surface);
    }
    let mesh = surface.mesh();
    let (after, places_after, self_intersections) = if surface.faces.is_empty() {
        let n_vertices = surface.n_vertices() as u64;
        let nothing = Counts {
            n_vertices,
            unused_vertices: n_vertices,
            ..Counts::default()
        };
        (nothing, Vec::new(), Vec::new())
    } else {
        let options = Options {
            weld: false,
            keep_seams: true,
            threads: options.threads,
            ..Options::default()
        };
        let (checked, pairs) = analysis::check_listed(mesh.clone(), &options)?;
        (checked.counts, checked.places, pairs)
    };
    Ok(Fixed {
        mesh,
        repairs,
        before: was.counts,
        after,
        places_before: was.places,
        places_after,
        self_intersections,
    })
}

/// Orients, splits, closes holes and turns shells.
///
/// A filling may meet other faces at edges where vertices were split, and its faces take part in
/// what bounds matter there. So after holes were closed, the splits are taken back, and all is done
/// once more with the fillings: as if the result were mended again.
fn part(surface: &mut Surface, options: &FixOptions, repairs: &mut Repairs) -> Result<(), Error> {
    let n_vertices = surface.n_vertices();
    let mut turned = Vec::new();
    for closings in 1..=MOST_CLOSINGS {
        if options.repairs.contains(&Repair::Orient) {
            let (n_turned, n_without) = orient::orient(surface);
            repairs.turned_faces += n_turned;
            repairs.non_orientable = n_without;
        }
        let before = *repairs;
        let origins = split_and_turn(surface, options, &mut turned, repairs)?;
        // Without a split, a filling meets nothing but its hole; what was refused may be sound
        // beside it.
        let may_change =
            repairs.split_edges > 0 || !origins.is_empty() || repairs.refused_holes > 0;
        let again = repairs.closed_holes > before.closed_holes && may_change;
        if !again || closings == MOST_CLOSINGS {
            break;
        }
        for vertex in surface.faces.as_flattened_mut() {
            if let Some(copy) = (*vertex as usize).checked_sub(n_vertices) {
                *vertex = origins[copy];
            }
        }
        surface.truncate_vertices(n_vertices);
        *repairs = Repairs {
            closed_holes: repairs.closed_holes,
            added_faces: repairs.added_faces,
            ..before
        };
    }
    Ok(())
}

/// Splits, closes holes and turns shells, again with the faces turned where that may change a split.
/// `turned` says of each face whether it is turned. Returns the vertices of which those that the
/// last splits added are copies.
fn split_and_turn(
    surface: &mut Surface,
    options: &FixOptions,
    turned: &mut Vec<bool>,
    repairs: &mut Repairs,
) -> Result<Vec<u32>, Error> {
    let does = |repair: Repair| options.repairs.contains(&repair);
    let (n_vertices, before) = (surface.n_vertices(), *repairs);
    let (oriented, turned_before) = (surface.faces.clone(), turned.clone());
    let mut splits = 0;
    loop {
        splits += 1;
        let origins = split::split(
            surface,
            (does(Repair::SplitEdges), does(Repair::SplitVertices)),
            repairs,
        );
        if does(Repair::CloseHoles) && options.close_holes > 0 {
            holes::close(surface, options, repairs)?;
        }
        let again = does(Repair::Outward)
            && shells::turn(surface, options.threads, turned, repairs)?
            && (repairs.split_edges > 0 || !origins.is_empty());
        if !again || splits == MOST_SPLITS {
            return Ok(origins);
        }
        *repairs = before;
        surface.truncate_vertices(n_vertices);
        surface.faces.clone_from(&oriented);
        turned.truncate(oriented.len());
        for (ix, face) in surface.faces.iter_mut().enumerate() {
            if turned[ix] != turned_before.get(ix).is_some_and(|held| *held) {
                face.swap(1, 2);
            }
        }
    }
}
