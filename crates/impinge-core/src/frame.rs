//! A query resolved for one scene: which layers take part, in what order, which of them meet and under which test.
//!
//! A *layer* is a part of a body whose elements are of one kind. For intersections each body has one layer: the
//! elements that it was given as. For steps it has up to three: its edges, its vertices and its faces.
//!
//! The elements of all layers are numbered consecutively, part after part and body after body in slot order: element `i` of
//! layer `l` has the global number `first(l) + i`. A pair is then one 64-bit key, `lower << 32 | higher`, and sorting
//! the keys of one test sorts rows `(body_a, element_a, body_b, element_b)`.
//!
//! ```text
//!  63            32 31             0
//! +----------------+----------------+
//! | global number  | global number  |   key of a pair, lower number first
//! +----------------+----------------+
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::elements::{Kind, Part};
use crate::error::Error;
use crate::exact::{Contact, ElementPair, Keep, Point, Reach};
use crate::hull::{Extent, Pose};
use crate::ids::BodyId;
pub use crate::index::pair_key;
use crate::index::{ElementIx, LayerIx, Number, pair_numbers};
use crate::pair_kind::{PairKind, PairKinds};
use crate::positions::{Positions, check_positions};
use crate::query::{Cell, Query, Scope, SharedVertex};
use crate::scene::{Body, Filter, Scene};
use crate::step::PairFilter;

/// One part of one body that takes part in a frame.
#[derive(Debug, Clone, Copy)]
pub struct Layer {
    /// The body.
    pub id: BodyId,
    /// Which of its elements.
    pub part: Part,
    /// Global number of its first element.
    pub first: Number,
    /// How many numbers its elements take up. Vertices are numbered as positions are, whether they take part or not.
    pub n_primitives: u32,
    /// The kind of its elements.
    pub kind: Kind,
    /// Whether its self-collision is queried.
    pub within: bool,
    /// Whether the body has no faces.
    pub(crate) is_bare: bool,
    /// Whether the body has no edges either.
    pub(crate) is_points: bool,
    filter: Filter,
    /// How thick the body is: what its elements add to the distance that is asked.
    radius: f64,
    /// How far vertices may be from their ways, because positions on these are rounded.
    rounded: f64,
}

impl Layer {
    /// The global number of an element.
    #[inline(always)]
    pub fn number(&self, element: ElementIx) -> Number {
        self.first.plus(element)
    }

    /// The element that has a global number.
    #[inline(always)]
    pub fn element(&self, number: Number) -> ElementIx {
        number.minus(self.first)
    }

    /// The global numbers of its elements.
    pub fn numbers(&self) -> Range<Number> {
        self.first..self.number(ElementIx::new(self.n_primitives))
    }
}

/// The question about pairs of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ask {
    /// Whether elements that bodies were given as share a point.
    #[default]
    Intersections,
    /// Whether and when vertices, edges and faces touch during a step.
    Impacts,
    /// Which vertices, edges and faces are near each other: the kinds of [`Impacts`](Ask::Impacts), and edges that meet faces.
    Near,
    /// Which vertices, edges and faces have boxes that overlap during a step.
    Candidates(PairKinds),
}

impl Ask {
    /// The parts of bodies that take part, in the order of their layers. In this order, the lower number of a pair belongs to
    /// the element that its kind names first: edges come before vertices, and vertices before faces.
    fn parts(self) -> &'static [Part] {
        match self {
            Ask::Intersections => &[Part::Given],
            Ask::Impacts | Ask::Near | Ask::Candidates(_) => {
                &[Part::Edges, Part::Vertices, Part::Faces]
            }
        }
    }
}

/// The test of a pair of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestId {
    /// Whether the elements that bodies were given as share a point.
    Intersection,
    /// The question about vertices, edges and faces.
    Elements(PairKind),
}

/// Layers and rules; the memory is kept from frame to frame.
#[derive(Debug, Default)]
pub struct Frame {
    /// Part after part, in slot order.
    pub layers: Vec<Layer>,
    /// The question about pairs.
    pub ask: Ask,
    /// The adjacency rule of self-collision.
    pub shared_vertex: SharedVertex,
    between: bool,
    ignored: BTreeSet<(BodyId, BodyId)>,
    cell: Option<Cell>,
    /// Whether the question is about a step, not about the positions at its start.
    is_step: bool,
    /// The distance within which elements are near, besides what their bodies add.
    distance: f64,
    /// What the elements of a step keep, at most: the distance, and a clearance if there is one.
    bound: f64,
    keep: Keep,
    /// Which pairs of a step count.
    filter: Option<PairFilter>,
}

impl Frame {
    /// Resolves a query for intersections. Positions that were written in place are not checked yet.
    pub fn resolve(&mut self, scene: &Scene, query: &Query) -> Result<(), Error> {
        self.resolve_for(scene, query, Ask::Intersections)
    }

    /// Resolves a query for any question.
    pub fn resolve_for(&mut self, scene: &Scene, query: &Query, ask: Ask) -> Result<(), Error> {
        self.layers.clear();
        self.distance = 0.0;
        self.bound = 0.0;
        self.keep = Keep::default();
        self.filter = None;
        self.ask = ask;
        // Vertices, edges and faces that share a vertex never count.
        self.shared_vertex = match ask {
            Ask::Intersections => query.shared_vertex,
            Ask::Impacts | Ask::Near | Ask::Candidates(_) => SharedVertex::Skip,
        };
        self.cell = query.cell;
        self.is_step = ask != Ask::Intersections;
        self.check_cell()?;
        if self.ignored != query.ignored {
            self.ignored.clone_from(&query.ignored);
        }
        for &id in &query.across {
            scene.body(id)?;
        }
        if let Scope::Between(a, b) = query.scope {
            scene.body(a)?;
            scene.body(b)?;
            if a == b {
                return Err(Error::SameBody { body: a });
            }
        }
        for &part in ask.parts() {
            self.push_part(scene, query, part)?;
        }
        Ok(())
    }

    fn check_cell(&self) -> Result<(), Error> {
        let Some(Cell { low, high }) = self.cell else {
            return Ok(());
        };
        // NaN is not at most anything.
        match (0..3).all(|axis| low[axis] <= high[axis]) {
            true => Ok(()),
            false => Err(Error::Setting {
                setting: "owned_by",
                given: format!("{low:?} to {high:?}"),
                allowed: "a lower corner that is nowhere above the upper one",
            }),
        }
    }

    /// Whether only the pairs of a cell are wanted.
    pub fn has_cell(&self) -> bool {
        self.cell.is_some()
    }

    /// Whether a pair belongs to the cell, if only its pairs are wanted.
    #[inline(always)]
    pub fn is_owned(&self, scene: &Scene, key: u64) -> bool {
        match self.cell {
            None => true,
            Some(cell) => self.is_in_cell(scene, key, cell),
        }
    }

    #[inline(never)]
    fn is_in_cell(&self, scene: &Scene, key: u64, cell: Cell) -> bool {
        let [a, b] = pair_numbers(key).map(|number| self.lower_corner(scene, number));
        cell.holds(std::array::from_fn(|axis| a[axis].max(b[axis])))
    }

    /// The lower corner of the box of an element: over the whole step, if the question is about one.
    fn lower_corner(&self, scene: &Scene, number: Number) -> [f64; 3] {
        let (layer, element) = self.locate(number);
        let body = self.body(scene, layer);
        let corners = body.corners(self.layer(layer).part, &element);
        let end = body.end_positions().filter(|_| self.is_step);
        let ends = std::iter::once(body.positions()).chain(end);
        let points = ends.flat_map(|at| corners.iter().map(|&corner| at.point(corner as usize)));
        Extent::of(points).min
    }

    /// Makes this a question about the positions that bodies have, whether or not they have others at the end of a step.
    pub(crate) fn stand_still(&mut self) {
        self.is_step = false;
    }

    /// Sets within which distance elements are near: the sum of `distance` and the radii of both bodies.
    pub(crate) fn set_reach(&mut self, distance: f64, radii: &BTreeMap<BodyId, f64>) {
        self.distance = distance;
        self.bound = distance;
        for layer in &mut self.layers {
            layer.radius = radii.get(&layer.id).copied().unwrap_or(0.0);
            layer.rounded = 0.0;
        }
    }

    /// Makes this a question about elements that keep a separation, and a clearance if there is one.
    pub(crate) fn set_keep(&mut self, scene: &Scene, keep: Keep) {
        self.set_reach(keep.separation, &BTreeMap::new());
        self.keep = keep;
        if keep.is_plain() {
            return;
        }
        let (mut magnitude, mut unit) = (0.0, 0.0);
        for (_, body) in scene.bodies() {
            if let (true, Some(end)) = (keep.is_rounded, body.end_positions()) {
                magnitude = body
                    .positions()
                    .magnitude()
                    .max(end.magnitude())
                    .max(magnitude);
                unit = f64::max(unit, body.positions().unit_roundoff(end));
            }
        }
        self.bound = keep.most(magnitude, unit);
    }

    /// Whether elements keep a clearance, so that a pair keeps what its distance at the start says.
    pub(crate) fn has_clearance(&self) -> bool {
        !self.keep.is_plain()
    }

    /// Whether elements of a step keep a separation or a clearance.
    pub(crate) fn keeps_distance(&self) -> bool {
        self.bound > 0.0
    }

    /// At least what any pair keeps.
    pub(crate) fn bound(&self) -> f64 {
        self.bound
    }

    /// What a pair of two layers keeps, by its points at both ends.
    pub(crate) fn kept(
        &self,
        scene: &Scene,
        layers: [LayerIx; 2],
        pair: ElementPair,
        ends: [&[Point; 4]; 2],
    ) -> f64 {
        self.keep
            .distance(pair, ends, self.unit_roundoff(scene, layers))
    }

    /// When a pair of two layers is first as near as it may come.
    pub(crate) fn first(
        &self,
        scene: &Scene,
        layers: [LayerIx; 2],
        pair: ElementPair,
        ends: [&[Point; 4]; 2],
    ) -> Option<Contact> {
        self.keep
            .first(pair, ends, self.unit_roundoff(scene, layers))
    }

    /// The contact of a pair that is as near as it may come from the start on.
    pub(crate) fn at_start(&self, pair: ElementPair, start: &[Point; 4]) -> Contact {
        self.keep.at_start(pair, start)
    }

    /// The unit roundoff of the positions of two layers that move; the larger one.
    fn unit_roundoff(&self, scene: &Scene, layers: [LayerIx; 2]) -> f64 {
        let units = layers.map(|layer| {
            let body = self.body(scene, layer);
            let end = body.end_positions();
            end.map_or(0.0, |end| body.positions().unit_roundoff(end))
        });
        units[0].max(units[1])
    }

    /// Sets which pairs of a step count.
    pub(crate) fn set_filter(&mut self, filter: Option<&PairFilter>) {
        self.filter = filter.cloned();
    }

    /// Whether some pairs do not count, because of their elements.
    pub(crate) fn has_filter(&self) -> bool {
        self.filter.is_some()
    }

    /// Whether pairs that do not count are best left out early.
    pub(crate) fn filters_early(&self) -> bool {
        self.filter.as_ref().is_some_and(PairFilter::is_early)
    }

    /// Whether a pair counts: it belongs to the cell, if there is one, and the filter lets it pass.
    #[inline(always)]
    pub fn counts(&self, scene: &Scene, key: u64) -> bool {
        self.is_owned(scene, key) && (self.filter.is_none() || self.passes(scene, key))
    }

    #[inline(never)]
    fn passes(&self, scene: &Scene, key: u64) -> bool {
        let Some(filter) = &self.filter else {
            return true;
        };
        let [a, b] = pair_numbers(key).map(|number| self.locate(number));
        let [a, b] = [&a, &b].map(|(layer, element)| {
            let corners = self
                .body(scene, *layer)
                .corners(self.layer(*layer).part, element);
            (self.layer(*layer).id, corners)
        });
        filter.passes([a, b])
    }

    /// Within which distance elements of two layers are near.
    pub(crate) fn reach(&self, a: LayerIx, b: LayerIx) -> Reach {
        let [a, b] = [a, b].map(|layer| self.layer(layer).radius);
        Reach::of_sum([self.distance, a, b])
    }

    /// How far the boxes of a layer must reach beyond its elements, so that those of near elements overlap: those of two
    /// layers reach at least as far together as their elements may be apart.
    pub(crate) fn margin(&self, layer: LayerIx) -> f64 {
        let radius = self.layer(layer).radius;
        match (self.bound, radius) {
            (0.0, radius) => radius,
            (distance, radius) => (radius + (distance / 2.0).next_up()).next_up(),
        }
    }

    /// Makes this a question about all ways that end at rounded positions, at any time of the step.
    pub(crate) fn set_rounding(&mut self, scene: &Scene) {
        // The layers of a body share its positions.
        let mut of_bodies = BTreeMap::new();
        for ix in 0..self.layers.len() {
            let body = self.body(scene, LayerIx::from_usize(ix));
            let rounded = of_bodies.entry(self.layers[ix].id).or_insert_with(|| {
                let end = body.end_positions();
                end.map_or(0.0, |end| body.positions().most_rounded(end))
            });
            self.layers[ix].rounded = *rounded;
        }
    }

    /// How far vertices of two layers may be from their ways, because positions on these are rounded.
    pub(crate) fn rounded(&self, a: LayerIx, b: LayerIx) -> f64 {
        f64::max(self.layer(a).rounded, self.layer(b).rounded)
    }

    /// Whether positions on the ways of vertices are rounded.
    pub(crate) fn is_rounded(&self) -> bool {
        self.layers.iter().any(|layer| layer.rounded > 0.0)
    }

    /// The pose of a layer: its boxes also reach by its [`margin`](Frame::margin), and as far as positions are rounded.
    #[inline(always)]
    pub(crate) fn pose(&self, pose: Pose, layer: LayerIx) -> Pose {
        pose.with_margin(self.margin(layer) + self.layer(layer).rounded)
    }

    fn push_part(&mut self, scene: &Scene, query: &Query, part: Part) -> Result<(), Error> {
        match query.scope {
            Scope::Between(a, b) => {
                self.between = true;
                for id in [a.min(b), a.max(b)] {
                    self.push(scene, id, part, false, Some(Filter::default()))?;
                }
            }
            Scope::Within(body) => {
                self.between = false;
                self.push(scene, body, part, true, None)?;
            }
            Scope::Across => {
                self.between = true;
                for (id, _) in scene.bodies() {
                    let (category, mask) = match query.across.contains(&id) {
                        true => (1, 2),
                        false => (2, 1),
                    };
                    let filter = Filter { category, mask };
                    self.push(scene, id, part, false, Some(filter))?;
                }
            }
            Scope::All { between, within } => {
                self.between = between;
                for (id, _) in scene.bodies() {
                    self.push(scene, id, part, within, None)?;
                }
            }
        }
        Ok(())
    }

    /// Refuses positions that were written in place and are not finite or out of range.
    pub fn check(&self, scene: &Scene) -> Result<(), Error> {
        self.layer_ixs()
            .try_for_each(|layer| self.check_one(scene, layer))
    }

    /// As [`check`](Frame::check), for one layer.
    pub fn check_one(&self, scene: &Scene, layer: LayerIx) -> Result<(), Error> {
        let body = self.body(scene, layer);
        if body.is_checked() {
            return Ok(());
        }
        let id = self.layer(layer).id;
        match body.positions() {
            Positions::F32(positions) => check_positions(id, positions),
            Positions::F64(positions) => check_positions(id, positions),
        }
    }

    fn push(
        &mut self,
        scene: &Scene,
        id: BodyId,
        part: Part,
        within: bool,
        filter: Option<Filter>,
    ) -> Result<(), Error> {
        let body = scene.body(id)?;
        let elements = body.part(part);
        if part != Part::Given && elements.is_empty() {
            return Ok(());
        }
        let first = self.n_primitives();
        let n = match part {
            Part::Vertices => body.n_vertices() as u64,
            _ => elements.len() as u64,
        };
        let limit = u64::from(u32::MAX);
        if first + n > limit {
            return Err(Error::TooMany {
                what: "primitives in one query",
                given: first + n,
                limit,
            });
        }
        self.layers.push(Layer {
            id,
            part,
            first: Number::new(first as u32),
            n_primitives: n as u32,
            kind: elements.kind(),
            is_bare: body.kind() < Kind::Triangles,
            is_points: body.kind() == Kind::Points,
            within: within && !self.ignored.contains(&(id, id)),
            filter: filter.unwrap_or(body.filter()),
            radius: 0.0,
            rounded: 0.0,
        });
        Ok(())
    }

    /// Whether pairs of one body that share a vertex are asked for.
    pub fn resolves(&self) -> bool {
        self.shared_vertex == SharedVertex::Resolve && self.layers.iter().any(|layer| layer.within)
    }

    /// The number of elements of all layers together.
    pub fn n_primitives(&self) -> u64 {
        self.layers
            .last()
            .map_or(0, |last| u64::from(last.numbers().end.raw()))
    }

    /// The numbers that the lower number of a pair of some kind may be: those of the elements that the kind names first. Parts follow
    /// each other, so there are few others between them.
    pub(crate) fn lower_numbers(&self, kind: PairKind) -> Range<Number> {
        let of_part = |layer: &&Layer| layer.part == kind.parts()[0];
        let layers = self.layers.iter().filter(of_part);
        let ranges = layers.map(Layer::numbers);
        ranges
            .reduce(|all, own| all.start.min(own.start)..all.end.max(own.end))
            .unwrap_or(Number::new(0)..Number::new(0))
    }

    /// Asks about some kinds of candidates only, of those that the frame was resolved for.
    pub(crate) fn ask_for(&mut self, kinds: PairKinds) {
        self.ask = Ask::Candidates(kinds);
    }

    /// Whether any pairs of two different layers are wanted.
    pub fn between(&self) -> bool {
        self.layers.len() > 1 && (self.between || self.ask != Ask::Intersections)
    }

    /// The test for pairs of elements of two layers, or of one with itself; `None` if no pair of them is wanted.
    #[inline]
    pub fn test(&self, a: LayerIx, b: LayerIx) -> Option<TestId> {
        let (a, b) = (self.layer(a), self.layer(b));
        let is_asked = if a.id == b.id {
            a.within
        } else {
            self.meet(a, b)
        };
        if !is_asked {
            return None;
        }
        if self.ask == Ask::Intersections {
            return Some(TestId::Intersection);
        }
        let kind = PairKind::of(a.part, b.part)?;
        let is_asked = match self.ask {
            Ask::Candidates(kinds) => kinds.contains(kind),
            // Vertices against faces and edges against edges cover every body with faces. Only bodies without faces need
            // edges against vertices, and only bodies of points need vertices against vertices.
            _ => match kind {
                PairKind::VertexFace | PairKind::EdgeEdge => true,
                PairKind::EdgeVertex => a.is_bare && b.is_bare,
                PairKind::VertexVertex => a.is_points && b.is_points,
                PairKind::EdgeFace => self.ask == Ask::Near,
                PairKind::FaceFace => false,
            },
        };
        is_asked.then_some(TestId::Elements(kind))
    }

    #[inline]
    fn meet(&self, a: &Layer, b: &Layer) -> bool {
        self.between
            && a.filter.meets(b.filter)
            && (self.ignored.is_empty()
                || !self.ignored.contains(&(a.id.min(b.id), a.id.max(b.id))))
    }

    /// The filter of a layer.
    #[cfg(feature = "gpu")]
    pub fn filter(&self, layer: LayerIx) -> Filter {
        self.layer(layer).filter
    }

    /// Whether pairs of different bodies are wanted.
    #[cfg(feature = "gpu")]
    pub(crate) fn meets_bodies(&self) -> bool {
        self.between
    }

    /// Pairs of bodies, lower first and sorted, that do not meet whatever their filters say.
    #[cfg(feature = "gpu")]
    pub(crate) fn ignored_bodies(&self) -> impl Iterator<Item = (BodyId, BodyId)> + '_ {
        self.ignored.iter().copied().filter(|(a, b)| a != b)
    }

    /// Pairs of layers, lower first and sorted, that do not meet whatever their filters say.
    #[cfg(feature = "gpu")]
    pub fn ignored_pairs(&self) -> impl Iterator<Item = (LayerIx, LayerIx)> + '_ {
        let find = |id: BodyId| {
            let found = self.layers.binary_search_by_key(&id, |layer| layer.id);
            found.ok().map(LayerIx::from_usize)
        };
        self.ignored
            .iter()
            .filter(|(a, b)| a != b)
            .filter_map(move |&(a, b)| Some((find(a)?, find(b)?)))
    }

    /// The elements of a layer, and their numbers.
    pub(crate) fn elements<'a>(
        &self,
        scene: &'a Scene,
        layer: LayerIx,
    ) -> impl Iterator<Item = (Number, &'a [u32])> + use<'a> {
        let Layer { part, first, .. } = *self.layer(layer);
        let elements = self.body(scene, layer).part(part);
        ElementIx::up_to(elements.len()).map(move |ix| {
            let corners = elements.corners(ix.index());
            let element = match part {
                // Vertices are numbered as positions are.
                Part::Vertices => ElementIx::new(corners[0]),
                _ => ix,
            };
            (first.plus(element), corners)
        })
    }

    /// All layers, by their indices.
    pub fn layer_ixs(&self) -> impl ExactSizeIterator<Item = LayerIx> + Clone + use<> {
        LayerIx::up_to(self.layers.len())
    }

    /// All layers, with their indices.
    pub fn numbered_layers(&self) -> impl ExactSizeIterator<Item = (LayerIx, &Layer)> + Clone {
        self.layer_ixs().zip(&self.layers)
    }

    /// A layer.
    #[inline(always)]
    pub fn layer(&self, layer: LayerIx) -> &Layer {
        &self.layers[layer.index()]
    }

    /// The body of a layer.
    #[inline]
    pub fn body<'a>(&self, scene: &'a Scene, layer: LayerIx) -> &'a Body {
        scene.body_in(self.layer(layer).id.slot())
    }

    /// The layer and the element that a global number belongs to.
    #[inline]
    pub fn locate(&self, number: Number) -> (LayerIx, ElementIx) {
        let ix = owner_by_first(&self.layers, number, |layer| layer.first);
        (LayerIx::from_usize(ix), self.layers[ix].element(number))
    }
}

/// Index of the last entry whose `first` is at most `number`. Empty layers share the `first`
/// of their successor; the last one of the run is the one that holds the element.
#[inline]
pub(crate) fn owner_by_first<T, N: Ord>(
    entries: &[T],
    number: N,
    first: impl Fn(&T) -> N,
) -> usize {
    entries.partition_point(|entry| first(entry) <= number) - 1
}
