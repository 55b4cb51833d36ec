//! Parts of an assembly: which pass into each other, which only touch, which are near.
//!
//! In: meshes of triangles. Out: each pair of parts that is not apart, with its relation. All is
//! asked of a detector: which faces meet (`detect`), where (`contacts`), which vertices are inside
//! (`contains`), how near (`distance`, and `near` where a rounded distance could be wrong).
//!
//! A part is a *solid* if it is closed and of one orientation, and encloses a volume; else it is a
//! *sheet*. Two solids interpenetrate if and only if their insides share a point, a solid and a
//! sheet if and only if the sheet has a point inside, two sheets if and only if one passes through
//! the other. So parts that share a wall, an edge or a corner only touch, without any tolerance.
//! Vertices inside decide most pairs; the rest is decided at the points where faces meet, by
//! [`local`]. A part whose pieces pass through each other is taken as all of them together.

mod local;

use std::collections::BTreeMap;

use impinge::exact::Point;
use impinge::{Backend, BodyId, Control, Detector, Error, Pairs, Query, Scene, Settings};
use impinge_io::{Elements, Mesh, weld};

use self::local::{Part, interpenetrate};
use crate::fix::remove_degenerate;
use crate::surface::{Surface, held};

/// What is asked about an assembly.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AssemblyOptions {
    /// Parts at most this far from each other are near; none if it is `None`.
    pub clearance: Option<f64>,
    /// Whether pairs that only touch are left out.
    pub ignores_touching: bool,
    /// CPU threads; 0 means one per core. The answer does not depend on it.
    pub threads: usize,
}

/// How two parts that are not apart lie to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Relation {
    /// They share space, and their surfaces meet.
    Interpenetrating,
    /// The first is wholly inside the second, and their surfaces do not meet.
    Inside,
    /// The second is wholly inside the first, and their surfaces do not meet.
    Around,
    /// Some of the first is inside the second, and some is not. Their surfaces do not meet. Where
    /// that holds of both, this is the answer, too: it depends on their order.
    PartlyInside,
    /// Some of the second is inside the first, and some is not. Their surfaces do not meet.
    PartlyAround,
    /// They share points, but no space.
    Touching,
    /// They share no point, and are not farther apart than the clearance.
    Near,
}

impl Relation {
    /// The name in answers, such as `interpenetrating`.
    pub fn name(self) -> &'static str {
        match self {
            Relation::Interpenetrating => "interpenetrating",
            Relation::Inside => "inside",
            Relation::Around => "around",
            Relation::PartlyInside => "partly-inside",
            Relation::PartlyAround => "partly-around",
            Relation::Touching => "touching",
            Relation::Near => "near",
        }
    }

    /// Whether the parts share space.
    pub fn shares_space(self) -> bool {
        !matches!(self, Relation::Touching | Relation::Near)
    }
}

/// Two parts that are not apart.
#[derive(Debug, Clone, PartialEq)]
pub struct PartPair {
    /// Their numbers, the lower one first.
    pub parts: [usize; 2],
    /// How they lie to each other.
    pub relation: Relation,
    /// Pairs of faces that share a point.
    pub n_pairs: u64,
    /// The distance of the two surfaces, rounded down; 0 if they meet.
    pub distance: f64,
    /// A point where they meet, else the nearest point of the first; rounded.
    pub point: Point,
}

/// A part of an assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct PartKind {
    /// How many faces it has, after faces of zero area divided their neighbours.
    pub n_faces: u64,
    /// Whether it has an inside.
    pub is_solid: bool,
}

/// The answer about an assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct Assembly {
    /// The parts, as given.
    pub parts: Vec<PartKind>,
    /// Pairs that are not apart, by their numbers.
    pub pairs: Vec<PartPair>,
}

/// Why an assembly is not checked.
#[derive(Debug, thiserror::Error)]
pub enum AssemblyError {
    /// Parts must be surfaces.
    #[error("part {0} has {1} tetrahedra: parts are meshes of triangles")]
    Tetrahedra(usize, usize),
    /// A clearance that is no length.
    #[error("a clearance of {0}: a length of 0 or more is expected")]
    Clearance(f64),
    /// Content that the library refuses.
    #[error("part {0}: {1}")]
    Part(usize, #[source] Error),
    /// A question that fails.
    #[error(transparent)]
    Refused(#[from] Error),
}

/// Compares all parts of an assembly. Vertices at one position are welded within each part.
///
/// ```
/// use impinge_check::{AssemblyOptions, Relation, check_assembly};
/// use impinge_io::{Elements, Mesh, Positions};
/// # fn main() -> Result<(), impinge_check::AssemblyError> {
/// let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
/// let at = |x: f64| Mesh {
///     positions: Positions::F64(corners.map(|[a, b, c]| [a + x, b, c]).to_vec()),
///     elements: Elements::Triangles(faces.clone()),
/// };
/// // A corner of the second is a corner of the first; the third reaches into the second.
/// let answer = check_assembly(vec![at(0.0), at(1.0), at(1.5)], &AssemblyOptions::default())?;
/// let said: Vec<_> = answer.pairs.iter().map(|pair| (pair.parts, pair.relation)).collect();
/// assert_eq!(said, [([0, 1], Relation::Touching), ([1, 2], Relation::Interpenetrating)]);
/// # Ok(()) }
/// ```
///
/// # Errors
/// [`AssemblyError`].
pub fn check_assembly(
    meshes: Vec<Mesh>,
    options: &AssemblyOptions,
) -> Result<Assembly, AssemblyError> {
    check_assembly_with(meshes, options, Control::new())
}

/// As [`check_assembly`], with a control that can stop it.
///
/// # Errors
/// [`AssemblyError`]; [`Error::Cancelled`] among the refusals.
pub fn check_assembly_with(
    meshes: Vec<Mesh>,
    options: &AssemblyOptions,
    control: Control,
) -> Result<Assembly, AssemblyError> {
    let clearance = options.clearance;
    if let Some(given) = clearance.filter(|given| !(*given >= 0.0 && given.is_finite())) {
        return Err(AssemblyError::Clearance(given));
    }
    let (mut scene, mut ids, mut parts) = (Scene::new(), Vec::new(), Vec::new());
    for (number, mesh) in meshes.into_iter().enumerate() {
        let (id, part) = add(&mut scene, number, mesh)?;
        ids.push(id);
        parts.push(part);
    }
    let mut asker = Asker {
        scene,
        ids,
        parts,
        detector: Detector::new(
            Settings::new()
                .backend(Backend::Cpu)
                .threads(options.threads),
        )?,
    };
    asker.detector.set_control(control);
    let meeting = asker.meeting()?;
    let mut pairs = Vec::new();
    for [a, b] in close(&asker.parts, clearance.unwrap_or(0.0)) {
        let rows = meeting.get(&[a, b]).map_or(&[][..], Vec::as_slice);
        if let Some(pair) = asker.relation([a, b], rows, clearance)?
            && !(options.ignores_touching && pair.relation == Relation::Touching)
        {
            pairs.push(pair);
        }
    }
    pairs.sort_by_key(|pair| pair.parts);
    let kind = |part: &Part| PartKind {
        n_faces: part.surface.faces.len() as u64,
        is_solid: part.is_solid(),
    };
    Ok(Assembly {
        parts: asker.parts.iter().map(kind).collect(),
        pairs,
    })
}

/// Adds a part to the scene.
fn add(scene: &mut Scene, number: usize, mut mesh: Mesh) -> Result<(BodyId, Part), AssemblyError> {
    // The scene refuses indices out of range and coordinates that are not finite.
    let refused = |source| AssemblyError::Part(number, source);
    let faces = match &mesh.elements {
        Elements::Triangles(faces) => faces.clone(),
        Elements::Tetrahedra(tets) => return Err(AssemblyError::Tetrahedra(number, tets.len())),
    };
    let body = scene
        .add((impinge::Elements::from(faces), held(&mesh.positions)))
        .map_err(refused)?;
    weld(&mut mesh);
    mesh.positions.narrow_if_exact();
    let Elements::Triangles(faces) = mesh.elements else {
        return Err(AssemblyError::Tetrahedra(number, 0));
    };
    // Faces without an area have no sides. A part where they leave a gap is no solid.
    let mut surface = Surface::new(mesh.positions, faces);
    remove_degenerate(&mut surface);
    let (faces, positions) = (surface.faces.clone(), held(&surface.positions));
    scene
        .remesh(body, (impinge::Elements::from(faces), positions))
        .map_err(refused)?;
    Ok((body, Part::new(surface)))
}

/// Pairs of parts whose boxes are within a distance, each with the lower number first.
fn close(parts: &[Part], distance: f64) -> Vec<[usize; 2]> {
    // Rounding must not lose a pair.
    let reach = distance * (1.0 + 1e-12);
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| parts[a].low[0].total_cmp(&parts[b].low[0]));
    let (mut open, mut found) = (Vec::<usize>::new(), Vec::new());
    for part in order {
        let at = &parts[part];
        let gap = |low: f64, high: f64| (low - high).next_down() > reach;
        open.retain(|&other| !gap(at.low[0], parts[other].high[0]));
        for &other in &open {
            let with = &parts[other];
            let apart = |k: usize| gap(at.low[k], with.high[k]) || gap(with.low[k], at.high[k]);
            if !(1..3).any(apart) {
                found.push([part.min(other), part.max(other)]);
            }
        }
        open.push(part);
    }
    found.sort_unstable();
    found
}

/// How much of the surface of a part is inside another, of those that do not meet.
#[derive(Clone, Copy, PartialEq)]
enum Share {
    None,
    Some,
    All,
}

/// How two parts whose surfaces do not meet share space; `None` if they do not. `shares`: of each in
/// the other. A part of which all is inside is not wholly inside if the other has a cavity in it.
fn nested(shares: [Share; 2]) -> Option<Relation> {
    match shares {
        [Share::None, Share::None] => None,
        [Share::All, Share::None] => Some(Relation::Inside),
        [Share::None, Share::All] => Some(Relation::Around),
        [Share::None, Share::Some] | [Share::Some, Share::All] => Some(Relation::PartlyAround),
        _ => Some(Relation::PartlyInside),
    }
}

/// What is asked of the detector.
struct Asker {
    scene: Scene,
    ids: Vec<BodyId>,
    parts: Vec<Part>,
    detector: Detector,
}

impl Asker {
    /// The pairs of faces that meet, of each two parts of which any do: their rows.
    fn meeting(&mut self) -> Result<BTreeMap<[usize; 2], Vec<[u32; 4]>>, Error> {
        let numbers: BTreeMap<BodyId, usize> = self
            .ids
            .iter()
            .enumerate()
            .map(|(n, &id)| (id, n))
            .collect();
        let pairs = self.detector.detect(&self.scene, &Query::between_all())?;
        let mut found: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for ((a, b), row) in pairs.iter().zip(pairs.rows()) {
            let [a, b] = [a.body, b.body].map(|body| numbers[&body]);
            found.entry([a.min(b), a.max(b)]).or_default().push(row);
        }
        Ok(found)
    }

    /// How two parts lie to each other, by the rows of their faces that meet; `None` if they are
    /// apart.
    fn relation(
        &mut self,
        parts: [usize; 2],
        rows: &[[u32; 4]],
        clearance: Option<f64>,
    ) -> Result<Option<PartPair>, Error> {
        let shares = [
            self.share_inside(parts)?,
            self.share_inside([parts[1], parts[0]])?,
        ];
        let [a, b] = parts.map(|part| self.ids[part]);
        let said = |relation, distance, point| {
            Some(PartPair {
                parts,
                relation,
                n_pairs: rows.len() as u64,
                distance,
                point,
            })
        };
        if !rows.is_empty() {
            // Where nearly all of two parts meets, one place is enough.
            let is_certain = shares != [Share::None; 2];
            let rows = if is_certain { &rows[..1] } else { rows };
            let query = Query::between_all();
            let pairs = Pairs::of_rows(&self.scene, &query, rows)?;
            let contacts = self.detector.contacts(&self.scene, &pairs)?;
            let both = parts.map(|part| &self.parts[part]);
            let relation = match is_certain || interpenetrate(both, &contacts) {
                true => Relation::Interpenetrating,
                false => Relation::Touching,
            };
            let point = contacts.points().first().copied().unwrap_or_default();
            return Ok(said(relation, 0.0, point));
        }
        let inside = nested(shares);
        if inside.is_none() && clearance.is_none() {
            return Ok(None);
        }
        let Some(nearest) = self.detector.distance(&self.scene, a, b)? else {
            return Ok(None);
        };
        let point = nearest.points[0];
        if let Some(relation) = inside {
            return Ok(said(relation, nearest.distance, point));
        }
        let most = clearance.unwrap_or(0.0);
        // A distance is rounded down: one that is less is less, and one that is equal may be more.
        let is_near = nearest.distance < most || {
            let query = Query::between(a, b);
            nearest.distance == most && !self.detector.near(&self.scene, most, &query)?.is_empty()
        };
        Ok(said(Relation::Near, nearest.distance, point).filter(|_| is_near))
    }

    /// How many vertices of the first part are strictly inside the second.
    fn share_inside(&mut self, [inner, outer]: [usize; 2]) -> Result<Share, Error> {
        let [part, around] = [inner, outer].map(|part| &self.parts[part]);
        if !around.is_solid() {
            return Ok(Share::None);
        }
        let within = |at: &Point| (0..3).all(|k| around.low[k] < at[k] && at[k] < around.high[k]);
        let points: Vec<Point> = part.vertices().filter(within).collect();
        if points.is_empty() {
            return Ok(Share::None);
        }
        let places = self
            .detector
            .contains(&self.scene, self.ids[outer], &points)?;
        let n_inside = places.iter().filter(|&&place| place == 1).count();
        Ok(match n_inside {
            0 => Share::None,
            n if n == part.vertices().count() => Share::All,
            _ => Share::Some,
        })
    }
}
