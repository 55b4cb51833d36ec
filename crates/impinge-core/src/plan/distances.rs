//! How near elements may come, and how far boxes must reach so that those of near elements overlap.
//!
//! ```text
//! distance    what is asked: of a query for near pairs, the separation of a step, or twice the
//!             inflation of candidates
//! thickness   what a body adds to it, or each of its elements
//! bound       what any pair of a step keeps at most, besides its thickness: the separation, and a
//!             clearance
//! inflation   how far the boxes of a part reach beyond its elements: its thickness, and half of
//!             the bound
//! ```

use std::collections::BTreeMap;

use crate::boxes::{BoxSource, Sweep};
use crate::scene::Scene;
use crate::scene::index::{ElementIx, PartIx};
use impinge_exact::internal::{Keep, Reach};
use impinge_exact::{Contact, ElementPair, Point};

use super::Plan;

impl Plan {
    /// Makes elements keep a separation, their thickness, and a clearance if there is one.
    pub(super) fn keep(&mut self, scene: &Scene, keep: Keep) {
        self.keep = keep;
        (self.distance, self.bound) = (keep.separation, keep.separation);
        self.thicken(scene);
        if !keep.is_plain() {
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
        let thickest = (self.parts.iter()).fold(0.0, |most: f64, part| most.max(part.thickness));
        if thickest > 0.0 {
            // What a pair keeps is a sum that is rounded up a few times: by less than this.
            let rounded = (self.bound + 2.0 * thickest) * 2f64.powi(-50);
            self.bound = (self.bound + rounded).next_up();
        }
    }

    /// The distance and a margin, or more.
    pub(crate) fn farther(&self, margin: f64) -> f64 {
        (self.distance + margin).next_up()
    }

    /// The question which elements are within a distance that is larger by a margin.
    pub(crate) fn within_farther(&self, margin: f64) -> Plan {
        let distance = self.farther(margin);
        Plan {
            distance,
            bound: distance,
            ..self.clone()
        }
    }

    /// The distance asked for.
    pub(crate) fn distance(&self) -> f64 {
        self.distance
    }

    /// Whether elements keep a clearance, so that a pair keeps what its distance at the start says.
    pub(crate) fn has_clearance(&self) -> bool {
        !self.keep.is_plain()
    }

    /// Whether elements of a step keep a separation, a thickness or a clearance.
    pub(crate) fn keeps_distance(&self) -> bool {
        self.bound > 0.0
    }

    /// By how much boxes reach farther together than elements keep, at most, besides rounding.
    pub(crate) fn farther_than_kept(&self) -> f64 {
        match self.bound - self.distance {
            0.0 => 0.0,
            farther => farther.next_up(),
        }
    }

    /// At least what any pair of two parts keeps, and whether all of them keep just that.
    pub(crate) fn most_kept(&self, a: PartIx, b: PartIx) -> (f64, bool) {
        let thickness = [a, b].map(|part| self.part(part).thickness);
        if self.has_clearance() {
            let [a, b] = thickness;
            return ((self.bound + (a + b).next_up()).next_up(), false);
        }
        let are_alike = [a, b].map(|part| self.thickness_of_each(part).is_none()) == [true; 2];
        (self.keep.with_thickness(thickness).separation, are_alike)
    }

    /// What two elements keep.
    fn keep_of(&self, pair: [(PartIx, ElementIx); 2]) -> Keep {
        self.keep.with_thickness(self.thickness_of_both(pair))
    }

    /// The separation of two elements, with their thickness.
    pub(crate) fn separation(&self, pair: [(PartIx, ElementIx); 2]) -> f64 {
        self.keep_of(pair).separation
    }

    /// What two elements keep, by their points at both ends.
    pub(crate) fn kept(
        &self,
        scene: &Scene,
        elements: [(PartIx, ElementIx); 2],
        pair: ElementPair,
        ends: [&[Point; 4]; 2],
    ) -> f64 {
        let unit = self.unit_roundoff(scene, elements.map(|(part, _)| part));
        self.keep_of(elements).distance(pair, ends, unit)
    }

    /// When two elements are first as near as they may come: a bound, if no times are asked.
    pub(crate) fn first(
        &self,
        scene: &Scene,
        elements: [(PartIx, ElementIx); 2],
        pair: ElementPair,
        ends: [&[Point; 4]; 2],
    ) -> Option<Contact> {
        let unit = self.unit_roundoff(scene, elements.map(|(part, _)| part));
        let keep = self.keep_of(elements);
        match self.asks_times() {
            true => keep.first(pair, ends, unit),
            false => keep.whenever(pair, ends, unit),
        }
    }

    /// The contact of two elements that are as near as they may come from the start on.
    pub(crate) fn at_start(
        &self,
        elements: [(PartIx, ElementIx); 2],
        pair: ElementPair,
        start: &[Point; 4],
    ) -> Contact {
        self.keep_of(elements).at_start(pair, start)
    }

    /// The unit roundoff of the positions of two parts that move; the larger one.
    fn unit_roundoff(&self, scene: &Scene, parts: [PartIx; 2]) -> f64 {
        let units = parts.map(|part| {
            let body = self.body(scene, part);
            let end = body.end_positions();
            end.map_or(0.0, |end| body.positions().unit_roundoff(end))
        });
        units[0].max(units[1])
    }

    /// Makes elements as thick as the scene says.
    pub(super) fn thicken(&mut self, scene: &Scene) {
        for part in &mut self.parts {
            part.thickness = scene.body_in(part.id.slot()).thickness();
        }
        let each = |part| self.body(scene, part).thickness_of_each();
        if self.part_ixs().any(|part| each(part).is_some()) {
            self.thickness = self.part_ixs().map(|part| each(part).cloned()).collect();
        }
    }

    /// How thick each element of a part is, by its number in the part, and a number that differs
    /// from that of all others; `None` if all are equally thick.
    #[inline(always)]
    pub(crate) fn thickness_of_each(&self, part: PartIx) -> Option<(&[f64], u64)> {
        let each = self.thickness.get(part.index())?.as_ref()?;
        Some((each.of(self.part(part).part), each.stamp()))
    }

    /// How thick an element of a part is.
    #[inline(always)]
    pub(crate) fn thickness_of(&self, part: PartIx, element: ElementIx) -> f64 {
        match self.thickness_of_each(part) {
            None => self.part(part).thickness,
            Some((each, _)) => each[element.index()],
        }
    }

    /// Within which distance elements of two parts are near; at most, where each element has a
    /// thickness of its own.
    pub(crate) fn reach(&self, a: PartIx, b: PartIx) -> Reach {
        let [a, b] = [a, b].map(|part| self.part(part).thickness);
        Reach::of_sum([self.distance, a, b])
    }

    /// Within which distance two elements are near.
    pub(crate) fn reach_of(&self, pair: [(PartIx, ElementIx); 2]) -> Reach {
        let [a, b] = self.thickness_of_both(pair);
        Reach::of_sum([self.distance, a, b])
    }

    /// How thick each of two elements is.
    #[inline(always)]
    pub(crate) fn thickness_of_both(&self, pair: [(PartIx, ElementIx); 2]) -> [f64; 2] {
        pair.map(|(part, element)| self.thickness_of(part, element))
    }

    /// How thick two elements are together, rounded up: the float after their rounded sum.
    pub(crate) fn thickness(&self, pair: [(PartIx, ElementIx); 2]) -> f64 {
        let [a, b] = self.thickness_of_both(pair);
        match a + b {
            0.0 => 0.0,
            sum => sum.next_up(),
        }
    }

    /// How far the boxes of a part must reach beyond its elements, so that those of near elements
    /// overlap: those of two parts reach at least as far together as their elements may be apart.
    /// Where each element has a thickness of its own, its box must reach farther by that.
    pub(crate) fn inflation(&self, part: PartIx) -> f64 {
        self.inflation_by(match self.thickness_of_each(part) {
            None => self.part(part).thickness,
            Some(_) => 0.0,
        })
    }

    /// How far the box of an element must reach beyond it.
    pub(crate) fn inflation_of(&self, part: PartIx, element: ElementIx) -> f64 {
        self.inflation_by(self.thickness_of(part, element))
    }

    fn inflation_by(&self, thickness: f64) -> f64 {
        match (self.bound, thickness) {
            (0.0, thickness) => thickness,
            (distance, thickness) => (thickness + (distance / 2.0).next_up()).next_up(),
        }
    }

    /// Makes this a question about all ways that end at rounded positions, at any time of the step.
    pub(crate) fn round(&mut self, scene: &Scene) {
        // The parts of a body share its positions.
        let mut of_bodies = BTreeMap::new();
        for ix in 0..self.parts.len() {
            let body = self.body(scene, PartIx::from_usize(ix));
            let rounded = of_bodies.entry(self.parts[ix].id).or_insert_with(|| {
                let end = body.end_positions();
                end.map_or(0.0, |end| body.positions().most_rounded(end))
            });
            self.parts[ix].rounded = *rounded;
        }
    }

    /// How far vertices of two parts may be from their ways, because positions on these are
    /// rounded.
    pub(crate) fn rounded(&self, a: PartIx, b: PartIx) -> f64 {
        f64::max(self.part(a).rounded, self.part(b).rounded)
    }

    /// Whether positions on the ways of vertices are rounded.
    pub(crate) fn is_rounded(&self) -> bool {
        self.parts.iter().any(|part| part.rounded > 0.0)
    }

    /// The sweep of a part: its boxes also reach by its [`inflation`](Plan::inflation), and as far
    /// as positions are rounded. Of elements that have a thickness of their own, see [`BoxSource`].
    #[inline(always)]
    pub(crate) fn sweep_of(&self, sweep: Sweep, part: PartIx) -> Sweep {
        sweep.inflated_by(self.inflation(part) + self.part(part).rounded)
    }

    /// What makes the boxes of a part.
    #[inline(always)]
    pub(crate) fn boxes_of<'a>(
        &'a self,
        scene: &'a Scene,
        sweep: Sweep,
        part: PartIx,
    ) -> BoxSource<'a> {
        let each = self.thickness_of_each(part).map(|(each, _)| each);
        BoxSource::new(self.body(scene, part), self.sweep_of(sweep, part), each)
    }
}
