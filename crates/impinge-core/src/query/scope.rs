//! The query: which pairs are asked for, and how.

use std::collections::BTreeSet;

use crate::query::pair_kind::{PairKind, PairKinds};
use crate::query::pair_set::PairSet;
use crate::query::step::{Clearance, Hit, PairFilter, Precision, Start, check_distance};
use crate::query::vertex_lists::VertexLists;
#[cfg(feature = "gpu")]
use crate::scene::Scene;
use crate::scene::error::{Error, shown};
use crate::scene::ids::BodyId;
use crate::scene::words::words;
use impinge_exact::internal::Keep;

/// How pairs of one body that share vertices are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum SharedVertex {
    /// Pairs that share a vertex index are not reported.
    Skip,
    /// The default: they are reported if and only if their intersection is larger than the convex
    /// hull of the vertices with common indices; if they have the same vertex indices, always.
    ///
    /// For triangles that are not degenerate: sharing one vertex, when the edge opposite it in one
    /// meets the other triangle; sharing an edge, when they are coplanar and fold to the same side.
    /// For tetrahedra: when the intersection is larger than the common vertex, edge or face. If the
    /// indices of one element are some of those of the other, but not all, the intersection is
    /// the hull, and the pair is not reported: a triangle with a repeated index, for example.
    ///
    /// Edges and points of one body that share a vertex are not reported under either rule.
    #[default]
    Resolve,
}

words!("shared_vertex", "resolve or skip", SharedVertex: [Resolve = "resolve", Skip = "skip"; 2]);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    Between(BodyId, BodyId),
    SelfOf(BodyId),
    /// Pairs of one of [`Query::across`] and another body; with `within`, self-collision of these
    /// too.
    Across {
        within: bool,
    },
    /// All bodies: pairs of different bodies, pairs within one, or both.
    All {
        between: bool,
        within: bool,
    },
}

/// A half-open box of space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub low: [f64; 3],
    pub high: [f64; 3],
}

impl Cell {
    pub fn holds(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| self.low[axis] <= point[axis] && point[axis] < self.high[axis])
    }
}

/// What is left out of a query: see [`Query::exclude`].
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Exclusion(Excluded);

#[derive(Debug, Clone, PartialEq)]
enum Excluded {
    Bodies(BodyId, BodyId),
    Rings(u32),
    Groups(u32, u32),
    Vertices(VertexLists),
    Pairs(PairSet),
}

impl Exclusion {
    /// The most rings that can be left out.
    pub const MOST_RINGS: u32 = 16;

    /// Pairs of one body that are near each other in its surface: some vertex of one element is at
    /// most so many edges away from some vertex of the other. 0 leaves out what shares a vertex, 1
    /// also what an edge joins. Nothing is proven of pairs that are left out: they may pass through
    /// each other.
    pub fn rings(n: u32) -> Self {
        Exclusion(Excluded::Rings(n))
    }

    /// Pairs of elements of two [groups](crate::Scene::set_groups), or of one with itself: each
    /// vertex of one element and each vertex of the other must be in such groups. Several such
    /// exclusions of one query are one rule about pairs of vertices: with (0, 1) and (1, 2), a
    /// vertex of group 1 and an edge of a vertex of group 0 and one of group 2 are left out, though
    /// neither leaves them out alone.
    pub fn groups(g: u32, h: u32) -> Self {
        Exclusion(Excluded::Groups(g.min(h), g.max(h)))
    }

    /// Pairs of an element of body `a` and one of body `b` of which some vertices are listed
    /// together, as compressed sparse rows: the list of vertex `v` of `a` is
    /// `vertices[offsets[v]..offsets[v + 1]]`, vertices of `b`. With `a == b` these are pairs of
    /// that body, in either order. Lists need not be sorted. Whether they fit both bodies, and
    /// these the scene, is checked when something is asked.
    ///
    /// For what only the caller knows: vertices that are sewn or glued together, or that a solver
    /// handles in another way.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Exclusion, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points = scene.add_points(&[[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])?;
    /// let query = Query::all().exclude(Exclusion::vertices(points, points, [0, 1, 1, 1], [1]));
    /// let near = Detector::new(Backend::Cpu)?.near(&scene, 1.0, &query)?;
    /// assert_eq!(near.rows().collect::<Vec<_>>(), [[0, 1, 0, 2]]);
    /// # Ok(()) }
    /// ```
    pub fn vertices(
        a: BodyId,
        b: BodyId,
        offsets: impl Into<Vec<u64>>,
        vertices: impl Into<Vec<u32>>,
    ) -> Self {
        let lists = VertexLists::new([a, b], offsets.into(), vertices.into());
        Exclusion(Excluded::Vertices(lists))
    }
}

impl From<(BodyId, BodyId)> for Exclusion {
    /// The pairs of two bodies; with the same body twice, its self-collision.
    fn from((a, b): (BodyId, BodyId)) -> Self {
        Exclusion(Excluded::Bodies(a.min(b), a.max(b)))
    }
}

impl From<PairSet> for Exclusion {
    fn from(pairs: PairSet) -> Self {
        Exclusion(Excluded::Pairs(pairs))
    }
}

/// What is asked of a scene: which pairs, and how. One value for every question of a
/// [`Detector`](crate::Detector).
///
/// Options that say *which* pairs ([`kinds`](Query::kinds), [`exclude`](Query::exclude),
/// [`shared_vertex`](Query::shared_vertex), [`owned_by`](Query::owned_by), and the constructors)
/// are refused by a question that cannot honour them. Options that say *how* are ignored by a
/// question that has no use for them, so that a solver keeps one query for all.
///
/// ```
/// use impinge::{Precision, Query, SharedVertex, Start};
/// let query = Query::all().start(Start::Skip).precision(Precision::F64);
/// assert_ne!(query, Query::all());
/// assert_eq!(Query::default(), Query::all());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct Query {
    pub(crate) scope: Scope,
    pub(crate) shared_vertex: SharedVertex,
    pub(crate) excluded: BTreeSet<(BodyId, BodyId)>,
    pub(crate) rings: Option<u32>,
    pub(crate) groups: BTreeSet<(u32, u32)>,
    pub(crate) vertices: Vec<VertexLists>,
    pub(crate) pairs: Vec<PairSet>,
    pub(crate) cell: Option<Cell>,
    /// Only of [`Scope::Across`].
    pub(crate) across: BTreeSet<BodyId>,
    pub(crate) kinds: Option<PairKinds>,
    pub(crate) start: Start,
    pub(crate) precision: Precision,
    pub(crate) separation: f64,
    pub(crate) clearance: Clearance,
    pub(crate) filter: Option<PairFilter>,
    pub(crate) distances: bool,
    pub(crate) closest: bool,
    pub(crate) fixed: BTreeSet<BodyId>,
    pub(crate) hits: Hit,
    pub(crate) n_nearest: u32,
}

impl Default for Query {
    /// [`Query::all`].
    fn default() -> Self {
        Query::all()
    }
}

impl Query {
    fn new(scope: Scope) -> Self {
        Query {
            scope,
            shared_vertex: SharedVertex::default(),
            excluded: BTreeSet::new(),
            rings: None,
            groups: BTreeSet::new(),
            vertices: Vec::new(),
            pairs: Vec::new(),
            cell: None,
            across: BTreeSet::new(),
            kinds: None,
            start: Start::default(),
            precision: Precision::default(),
            separation: 0.0,
            clearance: Clearance::new(0.0),
            filter: None,
            distances: false,
            closest: false,
            fixed: BTreeSet::new(),
            hits: Hit::default(),
            n_nearest: 1,
        }
    }

    /// Pairs between two bodies. Named explicitly, they meet whatever their filters say.
    pub fn between(a: BodyId, b: BodyId) -> Self {
        Query::new(Scope::Between(a, b))
    }

    /// Pairs of different bodies, for all bodies whose [`Filter`](crate::Filter)s let them meet.
    pub fn between_all() -> Self {
        Query::new(Scope::All {
            between: true,
            within: false,
        })
    }

    /// Self-collision of one body.
    pub fn self_of(body: BodyId) -> Self {
        Query::new(Scope::SelfOf(body))
    }

    /// Self-collision of every body.
    pub fn self_all() -> Self {
        Query::new(Scope::All {
            between: false,
            within: true,
        })
    }

    /// Pairs of different bodies and of one body, all together: the default. Different bodies meet
    /// if their [`Filter`](crate::Filter)s let them; no filter keeps a body from self-collision.
    pub fn all() -> Self {
        Query::new(Scope::All {
            between: true,
            within: true,
        })
    }

    /// All pairs of one body: with every other body, and its self-collision. They meet whatever
    /// their filters say.
    pub fn of(body: BodyId) -> Self {
        Query {
            across: [body].into(),
            ..Query::new(Scope::Across { within: true })
        }
    }

    /// Pairs of one of some bodies and one that is not among them. As those of
    /// [`between`](Query::between), they meet whatever their filters say.
    pub fn across(bodies: impl IntoIterator<Item = BodyId>) -> Self {
        Query {
            across: bodies.into_iter().collect(),
            ..Query::new(Scope::Across { within: false })
        }
    }

    /// The adjacency rule of self-collision: [`SharedVertex::Resolve`], unless it is said. Vertices
    /// are shared when their indices are equal: positions that coincide count once they are welded.
    pub fn shared_vertex(mut self, rule: SharedVertex) -> Self {
        self.shared_vertex = rule;
        self
    }

    /// Leaves pairs out, before they are decided: `(a, b)`, those of two bodies; `(a, a)`, the
    /// self-collision of one; [`Exclusion::rings`], what is near in the surface;
    /// [`Exclusion::groups`], groups of vertices that do not meet; [`Exclusion::vertices`], what
    /// the caller lists; the pairs of [`near`](crate::Detector::near), those that were near at
    /// rest. Each call leaves out more.
    ///
    /// Nothing is proven of pairs that are left out: a step that is
    /// [free](crate::Detector::is_free), or that [`truncate`](crate::Detector::truncate),
    /// [`advance`](crate::Detector::advance) or
    /// [`safe_distances`](crate::Detector::safe_distances) allow, may take them through each other.
    ///
    /// Pairs of an answer are those that it has: without pairs that pinned vertices, filters or
    /// its query left out at the time.
    ///
    /// All of them are about bodies of the scene that is asked about. Ids are the same in a scene
    /// and its clones, so make a scene at rest by `clone`: bodies of any other scene are refused as
    /// [unknown](Error::UnknownBody). Those that were removed have no pairs.
    ///
    /// Besides, pairs of elements all of whose vertices are [pinned](crate::Scene::set_pinned) are
    /// left out of every query, but for [`distance`](crate::Detector::distance) and
    /// [`nearest`](crate::Detector::nearest).
    ///
    /// [`detect`](crate::Detector::detect), [`count`](crate::Detector::count) and
    /// [`any`](crate::Detector::any) find all pairs, then drop those that are left out, one after
    /// the other; limits count the dropped pairs, too. They are about the elements that bodies were
    /// given as. Pairs of an answer leave out two of these if a corner, an edge or a face of one is
    /// in a pair with one of the other: faces without a common vertex that were within its
    /// distance, and of tetrahedra only those at the surface. Frames that stay on a device refuse
    /// pairs of an answer, and [`nearest`](crate::Detector::nearest) refuses all but bodies.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Exclusion, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let strip: Vec<[f32; 3]> = (0..12).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    /// let faces: Vec<[u32; 3]> = (0..10).map(|i| [i, i + 1, i + 2]).collect();
    /// let body = scene.add_triangles(&faces, &strip)?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let at_rest = detector.near(&scene, 1.0, &Query::all())?;
    /// assert!(at_rest.len() > 20);
    /// let query = Query::all().exclude(Exclusion::rings(1));
    /// assert!(detector.near(&scene, 1.0, &query)?.is_empty());
    /// let query = Query::all().exclude(&at_rest);
    /// assert!(detector.near(&scene, 1.0, &query)?.is_empty());
    /// # Ok(()) }
    /// ```
    pub fn exclude(mut self, what: impl Into<Exclusion>) -> Self {
        match what.into().0 {
            Excluded::Bodies(a, b) => {
                self.excluded.insert((a, b));
            }
            Excluded::Rings(n) => self.rings = self.rings.max(Some(n)),
            Excluded::Groups(g, h) => {
                self.groups.insert((g, h));
            }
            Excluded::Vertices(lists) => self.vertices.push(lists),
            Excluded::Pairs(pairs) => self.pairs.push(pairs),
        }
        self
    }

    /// Which kinds of pairs of vertices, edges and faces. If this is not said: vertices and faces,
    /// edges and edges; where bodies are made of edges or points alone also edges and vertices,
    /// vertices and vertices; of [`near`](crate::Detector::near) also edges that meet faces. Any
    /// two elements that are near have such a pair among their parts, so bodies are at least the
    /// distance apart if there are none, and neighbours that fold onto each other have one too.
    /// Only faces with the same three vertices, and a body inside tetrahedra, have none:
    /// [`Detector::any`](crate::Detector::any) finds these.
    ///
    /// [`detect`](crate::Detector::detect), [`count`](crate::Detector::count) and
    /// [`any`](crate::Detector::any) are about the elements that bodies were given as, and refuse
    /// kinds. Questions about a step refuse edges with faces, and faces with faces.
    pub fn kinds(mut self, kinds: impl IntoIterator<Item = PairKind>) -> Self {
        self.kinds = Some(kinds.into_iter().collect());
        self
    }

    /// Only the pairs that belong to the half-open box `[low, high)`: for programs that cut space
    /// into cells themselves, such as MPI codes. A pair belongs to the cell that holds the larger
    /// of the lower corners of its two bounding boxes, axis by axis. So if each process has all
    /// elements whose boxes touch its cell, and the cells cover space without overlap, each pair
    /// of the whole is found by exactly one process. Bounds may be infinite.
    ///
    /// For a step, boxes hold their elements from the start to the end. If pairs at a distance
    /// count as well, a process needs all elements whose boxes touch its cell when they are
    /// inflated, on all sides, by that distance: the separation of a step, the distance of
    /// [`near`](crate::Detector::near), twice the inflation of
    /// [`candidates`](crate::Detector::candidates); with both bodies' thickness.
    ///
    /// All intersections of the query are found and held first:
    /// [`Settings::max_pairs`](crate::Settings::max_pairs) and the memory budget count them, also
    /// those of [`Detector::count`](crate::Detector::count);
    /// [`Detector::any`](crate::Detector::any) does not stop early, and has no limit of pairs.
    /// Steps and distances hold only the pairs of the cell.
    /// [`Detector::advance`](crate::Detector::advance) and frames that stay on a device refuse a
    /// cell, and so does every question if a lower bound is above the upper one.
    ///
    /// ```
    /// use impinge::Query;
    /// let high = [0.0, f64::INFINITY, f64::INFINITY];
    /// let left = Query::all().owned_by([f64::NEG_INFINITY; 3], high);
    /// ```
    pub fn owned_by(mut self, low: [f64; 3], high: [f64; 3]) -> Self {
        self.cell = Some(Cell { low, high });
        self
    }

    /// Sets what happens to pairs that touch at the start.
    pub fn start(mut self, start: Start) -> Self {
        self.start = start;
        self
    }

    /// Sets the precision to which times are rounded down.
    pub fn precision(mut self, precision: Precision) -> Self {
        self.precision = precision;
        self
    }

    /// Sets the distance that elements must keep, in the unit of the scene: finite, 0 or more.
    ///
    /// A pair is then reported with the first time at which its distance is at most the separation,
    /// decided exactly and rounded down, and pairs within the separation at the start count as
    /// touching at the start. With 0, which is the default, elements must touch. The
    /// [thickness](crate::Scene::set_thickness) of both elements adds to it.
    pub fn separation(mut self, separation: f64) -> Self {
        self.separation = separation;
        self
    }

    /// Sets what a step leaves between elements, in the unit of the scene: finite, 0 or more.
    ///
    /// A pair whose distance at the start is d keeps
    /// `separation + min(clearance, share (d - separation))`, with a [share](Clearance::share) of
    /// 0.2 by default: it counts as in contact at the first time at which its distance is at most
    /// that. Such contacts are not at the start; pairs within the separation at the start count as
    /// touching there, as they do without a clearance. All of this is decided exactly; d -
    /// separation is rounded up to 24 bits first.
    ///
    /// So a chain of steps comes as near to contact as it likes, but never stops just short of it,
    /// where barriers are endless. With a clearance of 1e-4 this is what ipc-toolkit's
    /// `conservative_rescaling = 0.8` does.
    ///
    /// ```
    /// use impinge::{Clearance, Query};
    /// let query = Query::all().clearance(1e-4);
    /// assert_eq!(query, Query::all().clearance(Clearance::new(1e-4).share(0.2)));
    /// ```
    pub fn clearance(mut self, clearance: impl Into<Clearance>) -> Self {
        self.clearance = clearance.into();
        self
    }

    /// Leaves out the pairs that a filter refuses, in questions about the contacts of a step; all
    /// others refuse a filter. It is asked about pairs that are in contact, or might be as far as
    /// floats can tell; an [early](PairFilter::early) one sooner.
    pub fn filter(mut self, filter: PairFilter) -> Self {
        self.filter = Some(filter);
        self
    }

    /// Says which bodies do not move, for [`safe_distances`](crate::Detector::safe_distances): they
    /// leave the whole distance to what is near them. Steps ignore it: what stands still there is a
    /// body without end positions.
    pub fn fixed(mut self, bodies: impl IntoIterator<Item = BodyId>) -> Self {
        self.fixed = bodies.into_iter().collect();
        self
    }

    /// Asks for distances as `f64`, too: [`NearPair::distance`](crate::NearPair::distance), 8 bytes
    /// per pair.
    pub fn distances(mut self) -> Self {
        self.distances = true;
        self
    }

    /// Asks for distances and nearest points as `f64`, too:
    /// [`NearPair::closest`](crate::NearPair::closest), 56 bytes per pair.
    pub fn closest_points(mut self) -> Self {
        (self.distances, self.closest) = (true, true);
        self
    }

    /// Sets what is asked of rays, for [`cast`](crate::Detector::cast): the first hit, whether
    /// there is any, or all.
    pub fn hits(mut self, hits: Hit) -> Self {
        self.hits = hits;
        self
    }

    /// Sets how many of the nearest elements [`closest`](crate::Detector::closest) finds for each
    /// point: 1, unless it is said. An answer has memory for as many entries per point, 64 bytes
    /// each, however few elements there are.
    pub fn n_nearest(mut self, n: u32) -> Self {
        self.n_nearest = n;
        self
    }

    /// What pairs keep.
    pub(crate) fn keep(&self) -> Keep {
        Keep {
            separation: self.separation,
            clearance: self.clearance.distance,
            share: self.clearance.share,
            is_rounded: false,
        }
    }

    /// Checks the numbers, and that a question about a step is about kinds of pairs that have a
    /// first contact.
    pub(crate) fn check_step(&self) -> Result<(), Error> {
        let refused = [PairKind::EdgeFace, PairKind::FaceFace];
        if let Some(kind) = self
            .kinds
            .and_then(|kinds| refused.into_iter().find(|&kind| kinds.contains(kind)))
        {
            return Err(Error::Setting {
                setting: "kinds",
                given: kind.name().to_owned(),
                allowed: "in a step only vf, ee, ev and vv",
            });
        }
        check_distance("separation", self.separation)?;
        check_distance("clearance", self.clearance.distance)?;
        match (0.0..1.0).contains(&self.clearance.share) {
            true => Ok(()),
            false => Err(Error::Setting {
                setting: "clearance_share",
                given: shown(self.clearance.share),
                allowed: "a number from 0 to less than 1",
            }),
        }
    }

    /// The bodies that a question is about.
    #[cfg(feature = "gpu")]
    pub(crate) fn bodies_of(&self, scene: &Scene) -> Vec<BodyId> {
        match self.scope {
            Scope::Between(a, b) => vec![a, b],
            Scope::SelfOf(body) => vec![body],
            Scope::Across { .. } | Scope::All { .. } => scene.bodies().map(|(id, _)| id).collect(),
        }
    }

    /// Refuses a filter, for questions that ask none.
    pub(crate) fn check_without_filter(&self) -> Result<(), Error> {
        match self.filter {
            None => Ok(()),
            Some(_) => Err(Error::Setting {
                setting: "filter",
                given: "a filter of pairs".to_owned(),
                allowed: "a filter only in questions about the contacts of a step",
            }),
        }
    }

    /// Bodies of the scenes that exclusions are about: those that are named, and one for each set
    /// of pairs.
    pub(crate) fn excluded_bodies(&self) -> impl Iterator<Item = BodyId> + '_ {
        let named = self.excluded.iter().flat_map(|&(a, b)| [a, b]);
        let listed = self.vertices.iter().flat_map(VertexLists::bodies);
        let of_sets = self.pairs.iter().filter_map(PairSet::body);
        named.chain(listed).chain(of_sets)
    }

    /// What is left out besides pairs of bodies, for questions that are about whole bodies.
    pub(crate) fn leaves_out_elements(&self) -> Option<&'static str> {
        if self.rings.is_some() {
            return Some("rings");
        }
        if !self.groups.is_empty() {
            return Some("groups of vertices");
        }
        if !self.vertices.is_empty() {
            return Some("lists of vertices");
        }
        (!self.pairs.is_empty()).then_some("pairs of vertices, edges and faces")
    }

    /// Refuses pairs of an answer, for frames that stay on a device.
    #[cfg(feature = "gpu")]
    pub(crate) fn check_without_pairs(&self) -> Result<(), Error> {
        match self.pairs.is_empty() {
            true => Ok(()),
            false => Err(Error::Setting {
                setting: "exclude",
                given: "pairs of vertices, edges and faces".to_owned(),
                allowed: "in a frame that stays on a device only bodies, rings, groups and lists of vertices",
            }),
        }
    }

    /// Refuses kinds of pairs, for questions about the elements that bodies were given as.
    pub(crate) fn check_without_kinds(&self) -> Result<(), Error> {
        match self.kinds {
            None => Ok(()),
            Some(_) => Err(Error::Setting {
                setting: "kinds",
                given: "kinds of pairs of vertices, edges and faces".to_owned(),
                allowed: "in this question only pairs of the bodies' own elements",
            }),
        }
    }
}
