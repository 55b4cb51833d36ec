//! Regions: connected contacts, each region with a position, a size, a normal and a depth.
//!
//! Two contacts are connected when they have a named point in common ([`Contacts`]). In closed
//! bodies, edges and vertices inside connect contacts too ([`Penetration`](super::Penetration)).
//!
//! **Normal.** Let L be the directed curves of a region, and `a = ½ ∮ x × dx` the area that they
//! span. By Stokes' theorem `a` is the integral of the first body's normals over its part inside
//! the second body. When the first body moves by u, the volume that they have in common grows by
//! `a · u`. So that volume shrinks fastest when the first body moves along `-a` (Allard et al.,
//! *Volume contact constraints at arbitrary resolution*, 2010): push the first body that way. Where
//! bodies touch only in a patch, `a` is the area of the patch.

use super::curves::{Curves, distance, length};
use super::{Contacts, Shape};
use crate::boxes::scale::Scale;
use crate::scene::error::Error;
use crate::scene::vector::{add, cross, scaled, sub};
use crate::search::sets::Sets;
use crate::search::sink::{filled, grow, with_capacity};
use impinge_exact::Point;

/// What memory is for.
pub(super) const WHAT: &str = "regions of contact";

/// Connected contacts of two bodies, or within one.
#[derive(Clone, PartialEq)]
#[non_exhaustive]
pub struct Region {
    /// The bodies by their [`index`](crate::BodyId::index).
    pub bodies: [u32; 2],
    /// Numbers of contacts: rows of the pairs, sorted.
    pub contacts: Vec<u32>,
    /// The middle of the region: the mean of its curves weighted by length, else of its patches
    /// weighted by area, else of its points.
    pub position: [f64; 3],
    /// The lowest and the highest coordinates of its points, and of the vertices inside.
    pub bounds: [[f64; 3]; 2],
    /// The length of its curves, in the unit of the scene.
    pub length: f64,
    /// The area of its patches, where faces of both bodies lie in one plane; in square units.
    pub patch_area: f64,
    /// The area that its curves span, as a vector: the projected area of the first body's surface
    /// inside the second body. In square units.
    pub area: [f64; 3],
    /// The unit direction in which to push the first body so that the overlap shrinks fastest; push
    /// the second body the other way. `None` if the curves span no area in total (a rod through a
    /// wall), or if faces are not oriented consistently.
    pub normal: Option<[f64; 3]>,
    /// Vertices of the first body inside the second, and of the second inside the first; sorted.
    /// Empty unless [`Penetration`](super::Penetration) found the region.
    pub inside: [Vec<u32>; 2],
    /// The extent of the region along the normal. Bodies that are pushed that far may still
    /// overlap. `None` without a normal, or unless [`Penetration`](super::Penetration) found the
    /// region.
    pub depth: Option<f64>,
    /// The volume that the bodies have in common, in cubic units. A cavity that no edge joins to
    /// its surroundings is a region of negative volume. `None` unless
    /// [`Penetration`](super::Penetration) found the region. Also `None` if the bodies meet in this
    /// region other than by edges that cross faces (vertices on faces, edges on edges, common
    /// planes). Infinite if it is larger than all `f64`. Of a body that crosses itself, volume,
    /// area, normal, depth and regions mean nothing.
    pub volume: Option<f64>,
}

impl std::fmt::Debug for Region {
    /// Numbers of contacts and vertices in place of their lists.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Region");
        short.field("bodies", &self.bodies);
        short.field("n_contacts", &self.contacts.len());
        short.field("n_inside", &self.inside.each_ref().map(Vec::len));
        short.field("position", &self.position);
        short.field("normal", &self.normal);
        short.field("depth", &self.depth);
        short.field("volume", &self.volume);
        short.finish_non_exhaustive()
    }
}

/// Joins the points of each contact.
pub(super) fn join_contacts(contacts: &Contacts, sets: &mut Sets) {
    for contact in 0..contacts.len() {
        for pair in contacts.corners(contact).windows(2) {
            sets.join(pair[0], pair[1]);
        }
    }
}

/// The regions of sets of points, in the order of their first contacts, and the region of each
/// point that stands for its set ([`NO_REGION`] for other points). `orientations`: of the two faces
/// of a contact, 1 if it faces outwards, -1 if it is turned inwards, 0 if it bounds nothing.
///
/// Areas and sums are of scaled coordinates, with one power of two per region.
pub(super) fn regions(
    contacts: &Contacts,
    curves: &Curves,
    sets: &mut Sets,
    orientations: impl Fn(u32) -> [f64; 2],
) -> Result<(Vec<Region>, Vec<u32>), Error> {
    let (mut regions, region_of) = connected(contacts, sets)?;
    let mut middles = with_capacity(regions.len(), WHAT)?;
    middles.extend(regions.iter().map(|region| Middles::of(region.scale())));
    let mut turns = Turns::default();
    for contact in 0..contacts.len() {
        let corners = contacts.corners(contact);
        let Some(&first) = corners.first() else {
            continue;
        };
        let middle = &mut middles[region_of[sets.find(first) as usize] as usize];
        let orientations = orientations(contact as u32);
        middle.take_contact(contacts, contact, orientations);
        if let (&[from, to], true) = (corners, contacts.is_directed(contact)) {
            turns.take([from, to], orientations[0] * orientations[1])?;
        }
    }
    turns.sort();
    for curve in 0..curves.len() {
        let first = curves.points(curve)[0];
        let at = region_of[sets.find(first) as usize] as usize;
        let middle = &mut middles[at];
        let scale = middle.scale;
        let origin = regions[at].origin(scale);
        let turn = turns.of_curve(curves, curve);
        for ends in curves.segments(curve) {
            let [p, q] = ends.map(|point| scale.point(contacts.points()[point as usize]));
            let length = distance(p, q);
            middle.length += length;
            middle.curves.take(scaled(add(p, q), 0.5), length);
            if curves.is_closed(curve) && curves.is_directed(curve) {
                let area = scaled(cross(sub(p, origin), sub(q, origin)), 0.5);
                middle.area = add(middle.area, scaled(area, turn));
            }
        }
    }
    for (region, middle) in regions.iter_mut().zip(middles) {
        region.finish(&middle);
    }
    Ok((regions, region_of))
}

/// The regions with their contacts and bounds alone, and the region of each point as of
/// [`regions`].
fn connected(contacts: &Contacts, sets: &mut Sets) -> Result<(Vec<Region>, Vec<u32>), Error> {
    let mut region_of = filled(NO_REGION, sets.len(), WHAT)?;
    let mut regions: Vec<Region> = Vec::new();
    for contact in 0..contacts.len() {
        let corners = contacts.corners(contact);
        let Some(&first) = corners.first() else {
            continue;
        };
        let region = &mut region_of[sets.find(first) as usize];
        if *region == NO_REGION {
            *region = regions.len() as u32;
            grow(&mut regions, 1, WHAT)?;
            let at = contacts.points()[first as usize];
            regions.push(Region::at(contacts.names()[first as usize].bodies, at));
        }
        let region = &mut regions[*region as usize];
        grow(&mut region.contacts, 1, WHAT)?;
        region.contacts.push(contact as u32);
        for &point in corners {
            region.cover(contacts.points()[point as usize]);
        }
    }
    Ok((regions, region_of))
}

/// The turns of segments, which follow the normals of two faces: the product of both faces'
/// orientations. Only those that are not 1 are held.
#[derive(Default)]
struct Turns(Vec<([u32; 2], f64)>);

impl Turns {
    /// Takes a segment by its two points.
    fn take(&mut self, mut ends: [u32; 2], turn: f64) -> Result<(), Error> {
        if turn != 1.0 {
            ends.sort_unstable();
            grow(&mut self.0, 1, WHAT)?;
            self.0.push((ends, turn));
        }
        Ok(())
    }

    /// To be called once all are taken.
    fn sort(&mut self) {
        self.0
            .sort_unstable_by(|(p, turn), (q, other)| p.cmp(q).then(turn.total_cmp(other)));
    }

    fn of(&self, mut ends: [u32; 2]) -> f64 {
        ends.sort_unstable();
        let first = self.0.partition_point(|(held, _)| *held < ends);
        let found = self.0.get(first).filter(|(held, _)| *held == ends);
        found.map_or(1.0, |(_, turn)| *turn)
    }

    /// The turn of all segments of a curve; 0 if they disagree, as it then has no direction.
    fn of_curve(&self, curves: &Curves, curve: usize) -> f64 {
        if self.0.is_empty() {
            return 1.0;
        }
        let mut turns = curves.segments(curve).map(|ends| self.of(ends));
        let first = turns.next().unwrap_or(1.0);
        let is_one = turns.all(|turn| turn == first);
        if is_one { first } else { 0.0 }
    }
}

/// No region has this number.
pub(super) const NO_REGION: u32 = u32::MAX;

/// A weighted sum of positions.
#[derive(Default)]
struct Sum {
    place: Point,
    weight: f64,
}

impl Sum {
    fn take(&mut self, place: Point, weight: f64) {
        self.place = add(self.place, scaled(place, weight));
        self.weight += weight;
    }

    fn middle(&self) -> Option<Point> {
        (self.weight > 0.0).then(|| scaled(self.place, 1.0 / self.weight))
    }
}

/// Sums over a region, of scaled coordinates.
struct Middles {
    scale: Scale,
    /// Whether all coordinates are representable in `f32`.
    is_single: bool,
    curves: Sum,
    patches: Sum,
    points: Sum,
    length: f64,
    patch_area: f64,
    area: Point,
    /// The area of all patches as a vector.
    patch: Point,
}

impl Middles {
    fn of(scale: Scale) -> Self {
        Middles {
            scale,
            is_single: true,
            curves: Sum::default(),
            patches: Sum::default(),
            points: Sum::default(),
            length: 0.0,
            patch_area: 0.0,
            area: [0.0; 3],
            patch: [0.0; 3],
        }
    }

    /// Adds a contact, given the orientations of its two faces.
    fn take_contact(&mut self, contacts: &Contacts, contact: usize, [of_a, of_b]: [f64; 2]) {
        let corners = contacts.corners(contact);
        let scale = self.scale;
        let point = |corner: u32| scale.point(contacts.points()[corner as usize]);
        for &corner in corners {
            let exact = contacts.points()[corner as usize];
            self.is_single &= exact.iter().all(|&x| f64::from(x as f32) == x);
            self.points.take(point(corner), 1.0);
        }
        if contacts.shape(contact) == Shape::Polygon {
            for k in 2..corners.len() {
                let [p, q, r] = [corners[0], corners[k - 1], corners[k]].map(point);
                let area = scaled(cross(sub(q, p), sub(r, p)), 0.5);
                let size = length(area);
                self.patch_area += size;
                self.patch = add(self.patch, scaled(area, of_a * of_b.abs()));
                let middle = scaled(add(add(p, q), r), 1.0 / 3.0);
                self.patches.take(middle, size);
            }
        }
    }

    /// The area that may come from rounding alone: the error of the coordinates along all curves
    /// within a box.
    fn noise(&self, bounds: [Point; 2]) -> f64 {
        let epsilon = if self.is_single {
            f64::from(f32::EPSILON)
        } else {
            f64::EPSILON
        };
        let coordinates = bounds.as_flattened().iter();
        let size = coordinates.fold(0.0f64, |size, x| size.max(x.abs()));
        4.0 * epsilon * size * (self.length + distance(bounds[0], bounds[1]))
    }
}

impl Region {
    pub(super) fn at(bodies: [u32; 2], point: Point) -> Self {
        Region {
            bodies,
            contacts: Vec::new(),
            position: point,
            bounds: [point; 2],
            length: 0.0,
            patch_area: 0.0,
            area: [0.0; 3],
            normal: None,
            inside: [Vec::new(), Vec::new()],
            depth: None,
            volume: None,
        }
    }

    /// Extends the bounds.
    pub(super) fn cover(&mut self, point: Point) {
        let [low, high] = &mut self.bounds;
        for k in 0..3 {
            low[k] = low[k].min(point[k]);
            high[k] = high[k].max(point[k]);
        }
    }

    /// With which its areas and volumes do not overflow, nor underflow where its extents differ by
    /// less than 2^300.
    pub(super) fn scale(&self) -> Scale {
        Scale::of_points(self.bounds)
    }

    /// The middle of its box in scaled coordinates.
    pub(super) fn origin(&self, scale: Scale) -> Point {
        let [low, high] = self.bounds.map(|end| scale.point(end));
        scaled(add(low, high), 0.5)
    }

    fn finish(&mut self, middles: &Middles) {
        let scale = middles.scale;
        let found = middles.curves.middle();
        let found = found.or_else(|| middles.patches.middle());
        let found = found.or_else(|| middles.points.middle());
        self.position = found.map_or(self.position, |middle| scale.point_back(middle));
        self.length = scale.length_back(middles.length);
        self.patch_area = scale.area_back(middles.patch_area);
        self.area = middles.area.map(|part| scale.area_back(part));
        let noise = middles.noise(self.bounds.map(|end| scale.point(end)));
        let normal = |area: Point| {
            let length = length(area);
            (length > noise).then(|| scaled(area, -1.0 / length))
        };
        self.normal = normal(middles.area).or_else(|| normal(middles.patch));
    }
}
