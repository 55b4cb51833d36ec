//! What `--json` prints: a type per answer, whose documentation is what users read.
//!
//! `docs/*.schema.json` are made from these types, by the test below.

mod make;

#[cfg(test)]
use std::collections::BTreeMap;
use std::io::{self, Write};

use impinge::PairKind;
#[cfg(test)]
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::output::out;

/// Prints an answer as one line.
pub fn print(report: &impl Serialize) -> io::Result<()> {
    let mut to = out();
    serde_json::to_writer(&mut to, report)?;
    writeln!(to)?;
    to.flush()
}

/// Which pairs were asked for: no pair of another sort is in the answer.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Asked {
    /// Pairs of different bodies
    pub between: bool,
    /// Pairs within each body
    #[serde(rename = "self")]
    pub within: bool,
    /// Pairs of one body that share a vertex: whether they intersect where they meet in more than
    /// that, or never. They are never near
    #[cfg_attr(test, schemars(extend("enum" = ["resolve", "skip"])))]
    pub shared_vertex: &'static str,
}

/// Which pairs were asked for: no pair of another sort is in the answer.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct AskedOfStep {
    /// Pairs of different bodies
    pub between: bool,
    /// Pairs within each body
    #[serde(rename = "self")]
    pub within: bool,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Body {
    /// The file as given, or the node, item or group in it
    pub name: String,
    #[cfg_attr(test, schemars(extend("enum" = ["triangles", "tetrahedra"])))]
    pub kind: &'static str,
    pub elements: usize,
    /// After welding
    pub vertices: usize,
    /// Vertices that were welded to another one at the same position; in a step, at both ends
    pub welded: usize,
    /// Vertices at the position of another that were not welded to it; null if they were not
    /// counted
    pub coincident: Option<usize>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct ThickBody {
    #[serde(flatten)]
    pub body: Body,
    /// What --thickness gives it, else 0
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub thickness: f64,
}

/// How an answer was found.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct How<T> {
    /// "cpu", or the name of the GPU
    pub backend: String,
    #[cfg_attr(test, schemars(extend("enum" = ["clusters", "cells", "naive"])))]
    pub method: &'static str,
    /// Milliseconds; medians over --repeat
    pub ms: T,
    pub stats: Counters,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Total {
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub total: f64,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Stages {
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub total: f64,
    #[cfg_attr(test, schemars(with = "BTreeMap<String, f64>"))]
    pub stages: Map<String, Value>,
}

/// Counters; more may be added. Of several frames or runs, those of the last one.
#[derive(Serialize)]
#[serde(transparent)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Counters(
    #[cfg_attr(test, schemars(with = "BTreeMap<String, Option<Counter>>"))] pub Value,
);

#[cfg(test)]
#[derive(JsonSchema)]
#[schemars(untagged)]
#[expect(dead_code, reason = "only described")]
enum Counter {
    Number(u64),
    Grid([u64; 3]),
}

/// How many of each kind.
#[derive(Serialize, Default, Clone, Copy)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct KindsOfStep {
    /// A vertex and a face
    pub vf: u64,
    /// Two edges
    pub ee: u64,
    /// An edge and a vertex
    pub ev: u64,
    /// Two vertices
    pub vv: u64,
}

/// How many of each kind.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Kinds {
    #[serde(flatten)]
    pub of_step: KindsOfStep,
    /// An edge and a face; near, that meet
    pub ef: u64,
    /// Two faces
    pub ff: u64,
}

/// How many of each kind.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct KindsOfTiles {
    /// A vertex and a face
    pub vf: u64,
    /// Two edges
    pub ee: u64,
}

impl KindsOfStep {
    pub fn new(n: impl Fn(PairKind) -> u64) -> Self {
        KindsOfStep {
            vf: n(PairKind::VertexFace),
            ee: n(PairKind::EdgeEdge),
            ev: n(PairKind::EdgeVertex),
            vv: n(PairKind::VertexVertex),
        }
    }
}

impl Kinds {
    pub fn new(n: impl Fn(PairKind) -> u64) -> Self {
        Kinds {
            ef: n(PairKind::EdgeFace),
            ff: n(PairKind::FaceFace),
            of_step: KindsOfStep::new(n),
        }
    }
}

/// A file that could not be read.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Unread {
    /// The number of the body, which has no elements
    pub body: usize,
    /// The file as given
    pub name: String,
    pub error: String,
}

/// What `impinge pairs`, `self`, `render` and `sequence` print with --json: one object, or one per
/// frame
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Pairs {
    #[serde(flatten)]
    pub frame: Option<Frame>,
    /// How many pairs of elements intersect
    pub pairs: usize,
    /// Hash of the set of pairs, 16 hexadecimal digits; equal on every method, backend and thread
    /// count
    pub hash: String,
    #[serde(flatten)]
    pub how: How<Stages>,
    pub asked: Asked,
    /// One object per mesh, in the order given
    pub bodies: Vec<CollidingBody>,
    /// How many places the pairs form; null beyond 2,000,000 pairs
    pub n_regions: Option<usize>,
    /// The places with the most pairs: pairs of the same two bodies, connected by shared elements
    /// or vertices; at most 100
    pub regions: Vec<Region>,
    /// With --contacts, --curves or --regions only
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contacts: Option<Contacts>,
    /// Files that could not be read, if any: `self` answers for the others
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unread: Vec<Unread>,
}

/// A frame of a sequence.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Frame {
    /// Number of the frame, counted from 0, in a step the one at its start; only for sequences
    pub frame: usize,
    /// The file of the frame; only for sequences of numbered files
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct CollidingBody {
    #[serde(flatten)]
    pub body: Body,
    /// Elements that are in any pair
    pub colliding: usize,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Region {
    /// Numbers of the two bodies; the same number twice for self-collision
    pub bodies: [usize; 2],
    pub pairs: usize,
    /// Middle of the box around the overlaps of the two elements' boxes, over all pairs of the
    /// place
    pub center: [f64; 3],
    /// Longest side of that box
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub size: f64,
    /// The first pair of the place: one element of each body
    pub first: [u32; 2],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Contacts {
    pub points: usize,
    /// How many contacts are a point, a segment or a polygon
    pub shapes: Shapes,
    pub curves: usize,
    pub closed: usize,
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub length: f64,
    /// Points of no curve
    pub isolated: usize,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Shapes {
    pub point: usize,
    pub segment: usize,
    pub polygon: usize,
}

/// What `impinge sequence` prints with --json in place of an answer about a frame that cannot be
/// read, or has positions that are not finite
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct FrameError {
    #[serde(flatten)]
    pub frame: Frame,
    /// Why it is passed over
    pub error: String,
}

/// What `impinge pairs`, `self` print with --json and --count or --any: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Count {
    /// With --count: how many pairs intersect
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<u64>,
    /// With --any: whether there is any pair
    #[serde(skip_serializing_if = "Option::is_none")]
    pub any: Option<bool>,
    pub asked: Asked,
    #[serde(flatten)]
    pub how: How<Total>,
    /// Files that could not be read, if any: `self` answers for the others
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unread: Vec<Unread>,
}

/// What `impinge step` prints with --json: one object. With --earliest, --advance and --truncate,
/// `impacts`, `kinds`, `touching_at_start` and `hash` are null
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Step {
    #[serde(flatten)]
    pub found: Found,
    /// With --advance: the part of the step that can be taken
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub fraction: Option<f64>,
    /// With --truncate: how many vertices stop before their ends
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut: Option<u64>,
    /// With --truncate: how many pairs touch at the start, or are at most as far apart as they are
    /// to keep, without pairs of which no vertex moves; their vertices stay
    #[serde(skip_serializing_if = "Option::is_none")]
    pub touching: Option<u64>,
    /// With --truncate: how often pairs were looked at again
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rounds: Option<u32>,
    /// One object per body, in the order given
    pub bodies: Vec<MovingBody>,
    /// Milliseconds; medians over --repeat
    pub ms: Stages,
    pub stats: Counters,
    /// The distance to be kept, 0 unless --separation says otherwise
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub separation: f64,
    /// What the step leaves between elements, 0 unless --clearance says otherwise
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub clearance: f64,
    pub asked: AskedOfStep,
}

/// What was found in a step.
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Found {
    /// Whether nothing touches from the start to the end, and nothing was found to intersect at
    /// the start
    pub free: bool,
    /// The first contact; of several at one time, the first row. Null if nothing touches
    pub earliest: Option<Impact>,
    /// How many pairs touch
    pub impacts: Option<usize>,
    pub kinds: Option<KindsOfStep>,
    /// How many pairs touch at time 0
    pub touching_at_start: Option<usize>,
    /// Whether elements intersect at the start, neighbours resolved; null with --start report or
    /// skip, which do not ask
    pub start_intersects: Option<bool>,
    /// Hash of the set of impacts with their times, 16 hexadecimal digits; equal on every backend
    /// and thread count
    pub hash: Option<String>,
    /// "cpu", or the name of the GPU
    pub backend: String,
    #[cfg_attr(test, schemars(extend("enum" = ["clusters", "naive"])))]
    pub method: &'static str,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Impact {
    /// The time from 0 to 1, rounded down
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub toi: f64,
    #[cfg_attr(test, schemars(extend("enum" = ["vf", "ee", "ev", "vv"])))]
    pub kind: &'static str,
    /// Bodies are numbered from 0 as given
    pub body_a: u32,
    /// Of kind vf, the vertex: as in the file, of welded ones the first
    pub element_a: u32,
    pub body_b: u32,
    /// Of kind vf, the face
    pub element_b: u32,
}

impl Impact {
    pub fn new(kind: PairKind, [body_a, element_a, body_b, element_b]: [u32; 4], toi: f64) -> Self {
        Impact {
            toi,
            kind: kind.name(),
            body_a,
            element_a,
            body_b,
            element_b,
        }
    }
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct MovingBody {
    /// Its `name` is the file of the start
    #[serde(flatten)]
    pub body: ThickBody,
    /// The file of the end as given
    pub end: String,
}

/// What `impinge sequence --ccd` prints with --json: one object per step from a frame to the next
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct SequenceStep {
    #[serde(flatten)]
    pub frame: Frame,
    #[serde(flatten)]
    pub found: Found,
    /// Milliseconds
    pub ms: Stages,
}

/// What `impinge step --candidates FILE` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Candidates {
    /// How many pairs of boxes overlap
    pub candidates: u64,
    pub kinds: Kinds,
    /// Hash of the set of candidates, 16 hexadecimal digits
    pub hash: String,
    /// In how many runs they were found and written
    pub runs: u64,
    /// How far the boxes were inflated
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub inflation: f64,
    pub asked: AskedOfStep,
    /// One object per body, in the order given
    pub bodies: Vec<MovingBody>,
    /// Milliseconds of finding and writing all runs
    pub ms: Total,
    pub stats: Counters,
}

/// What `impinge near` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Near {
    /// The distance asked for, to which the thickness of both bodies adds
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub distance: f64,
    pub asked: Asked,
    /// How many pairs of elements are within the distance
    pub pairs: usize,
    pub kinds: Kinds,
    /// Whether any elements asked about intersect, neighbours resolved
    pub intersects: bool,
    /// Hash of the set of pairs and their nearest features, 16 hexadecimal digits; equal on every
    /// method and thread count
    pub hash: String,
    /// One object per mesh, in the order given
    pub bodies: Vec<ThickBody>,
    #[serde(flatten)]
    pub how: How<Stages>,
}

/// What `impinge safe` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Safe {
    /// The largest bound asked for
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub most: f64,
    pub asked: Asked,
    /// How many vertices bodies that are not fixed have, as their files number them
    pub vertices: usize,
    /// How many of them may move by less than `most`
    pub bounded: usize,
    /// The least bound of them, and the first vertex that has it; null if there is no vertex
    pub smallest: Option<SafeVertex>,
    /// How many pairs of a vertex and a face, or of two edges, touch or are nearer than the
    /// smallest 64-bit float, or are at most as far apart as their bodies are thick
    pub touching: usize,
    /// Whether any elements asked about intersect, neighbours resolved
    pub intersects: bool,
    /// One object per mesh, in the order given
    pub bodies: Vec<FixedBody>,
    #[serde(flatten)]
    pub how: How<Stages>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct SafeVertex {
    /// Bodies are numbered from 0 as given
    pub body: usize,
    /// As in the file, of welded ones the first
    pub vertex: usize,
    /// Rounded down
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub safe: f64,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct FixedBody {
    #[serde(flatten)]
    pub body: ThickBody,
    /// Whether --fixed names it
    pub fixed: bool,
}

/// What `impinge distance` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Distance {
    /// The smallest distance, rounded down; 0 if and only if the meshes touch, which is decided
    /// exactly, or are nearer than the smallest 64-bit float
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub distance: f64,
    /// Whether it is less than --below; null without that
    pub below: Option<bool>,
    /// The two meshes that are nearest to each other, numbered from 0 as given
    pub bodies: [usize; 2],
    /// Their files, nodes or groups
    pub names: [String; 2],
    /// An element of each mesh at this distance; of several pairs at it, rounded down, the lowest
    pub elements: [u32; 2],
    /// Nearest points of these elements, rounded; if they touch, twice a point that they share
    pub points: [[f64; 3]; 2],
    /// Milliseconds
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub ms: f64,
}

/// What `impinge probe` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Probe {
    pub asked: AskedOfPoints,
    /// How many points there are
    pub points: usize,
    /// How many of them are near enough
    pub near: usize,
    /// How many nearest elements were found of all points together
    pub found: usize,
    /// How many of all points are inside, on the surface and outside, decided exactly; null
    /// without --signed
    pub places: Option<Places>,
    /// How many of all points are in a tetrahedron, decided exactly; null without --locate
    pub located: Option<u64>,
    /// The first of the points whose distance is the smallest; null if there is none
    pub nearest: Option<NearestPoint>,
    /// The first of those, among points that are near enough, whose distance is the largest; null
    /// if there is none
    pub farthest: Option<NearestPoint>,
    /// Hash of the nearest elements of each point, 16 hexadecimal digits; equal on every thread
    /// count
    pub hash: String,
    /// The mesh
    pub bodies: [Body; 1],
    #[serde(flatten)]
    pub how: How<Total>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct AskedOfPoints {
    /// Whether points are inside
    pub signed: bool,
    /// Which tetrahedron contains each point
    pub locate: bool,
    /// How many nearest elements of each point
    pub nearest: u32,
    /// The largest distance of --most; null for any
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub most: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Places {
    pub inside: u64,
    pub on: u64,
    pub outside: u64,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct NearestPoint {
    /// Its number, from 0 as in the file of points
    pub point: usize,
    /// The element of the mesh that is nearest, decided exactly; of several the lowest
    pub element: u32,
    /// Rounded down
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub distance: f64,
    /// The nearest point of the element, rounded
    pub nearest: [f64; 3],
}

/// What `impinge cast` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Cast {
    pub asked: AskedOfRays,
    /// How many rays there are
    pub rays: usize,
    /// How many of them hit the mesh, decided exactly
    pub hit: u64,
    /// How many rows --rows has; null with --hits any, where it has one per ray
    pub hits: Option<usize>,
    /// The first of the hits with the smallest t; null if there is none, and with --hits any
    pub nearest: Option<NearestHit>,
    /// Hash of the rays and the elements that they hit, 16 hexadecimal digits; equal on every
    /// thread count
    pub hash: String,
    /// The mesh
    pub bodies: [Body; 1],
    #[serde(flatten)]
    pub how: How<Total>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct AskedOfRays {
    /// What was to be found of each ray
    #[cfg_attr(test, schemars(extend("enum" = ["first", "any", "all"])))]
    pub hits: &'static str,
    /// The largest t of --most; null for any
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub most: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct NearestHit {
    /// Its number, from 0 as in the file of rays
    pub ray: usize,
    pub element: u32,
    /// In lengths of the direction, rounded down
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub t: f64,
}

/// What `impinge check --assembly --json` prints
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Assembly {
    /// The distance up to which parts count as near; null if --clearance was not given
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub clearance: Option<f64>,
    /// Whether pairs that only touch are in the answer
    #[cfg_attr(test, schemars(extend("enum" = ["report", "ignore"])))]
    pub touching: &'static str,
    pub parts: Vec<Part>,
    /// Pairs of parts that are not apart, by their numbers
    pub pairs: Vec<Parts>,
    /// A row per part, a letter per part: X share space, I inside, O around, i partly inside, o
    /// partly around, t touching, n near, . apart, - the part itself. Where two parts are
    /// partly inside each other, i is in the row of the lower number, o in that of the higher one
    pub matrix: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Part {
    /// The node, the item or the group, after FILE# if there are several files; or the file
    pub name: String,
    /// Their number after faces of zero area divided their neighbours
    pub faces: u64,
    /// Whether it is closed, of one orientation and encloses a volume; else it has no inside
    pub solid: bool,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Parts {
    /// Numbers of two parts, from 0, the lower one first
    pub parts: [usize; 2],
    /// interpenetrating: they share space, and their surfaces meet. inside, around: the first is
    /// wholly inside the second, or the other way, and their surfaces do not meet. partly-inside,
    /// partly-around: some of it is, and some is not; partly-inside where that holds of both.
    /// touching: they share points and no space. near: they are apart, and within the clearance.
    /// Decided exactly
    #[cfg_attr(
        test,
        schemars(extend("enum" = ["interpenetrating", "inside", "around", "partly-inside", "partly-around", "touching", "near"]))
    )]
    pub relation: &'static str,
    /// Pairs of faces that share a point
    pub pairs: u64,
    /// Of the two surfaces, rounded down; 0 if they meet
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub distance: f64,
    /// A point where they meet, else the nearest point of the first; rounded
    pub point: [f64; 3],
}

/// What `impinge devices` prints with --json: one array
#[cfg(any(test, feature = "gpu"))]
#[derive(Serialize)]
#[serde(transparent)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Devices(pub Vec<Device>);

#[cfg(any(test, feature = "gpu"))]
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct Device {
    /// A part of it chooses the device: --device
    pub name: String,
    /// vulkan, metal, dx12, …
    pub interface: String,
    pub driver: String,
    /// Whether it runs on the CPU
    pub is_software: bool,
    /// The most bytes of one buffer
    pub max_binding: u64,
}

/// What `impinge tiles plan` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct TilesPlan {
    /// The plan's number, 16 hexadecimal digits
    pub plan: String,
    /// Bodies
    pub files: usize,
    /// Whether bodies move
    pub step: bool,
    /// In all files
    pub elements: u64,
    pub tiles: u32,
    /// Pieces of work for `scatter`
    pub units: usize,
}

/// What `impinge tiles scatter` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct TilesScatter {
    /// Parts that this process wrote
    pub written: u64,
    /// Parts that were there
    pub kept: u64,
    /// Elements that were read
    pub elements: u64,
    /// Records of them: one per tile that an element reaches
    pub records: u64,
}

/// What `impinge tiles run` prints with --json: one object per tile
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct TilesRun {
    /// Counted from 0
    pub tile: u32,
    /// Elements that reach into the tile
    pub elements: u64,
    /// Pairs that belong to the tile
    pub pairs: u64,
    /// Hash of these pairs, 16 hexadecimal digits
    pub hash: String,
    /// Pairs found here that belong to another tile
    pub elsewhere: u64,
    /// Pieces in which the tile was run; 1 unless space can't be cut further
    pub pieces: u64,
    /// Whether the result was there
    pub kept: bool,
}

/// What `impinge tiles merge` prints with --json: one object
#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct TilesMerge {
    /// Pairs, or of a step impacts
    pub pairs: u64,
    /// The hash that `impinge pairs`, `self` or `step` print, 16 hexadecimal digits
    pub hash: String,
    /// The question in words
    pub asked: String,
    /// Whether vertices at one position were welded
    pub welded: bool,
    pub tiles: u32,
    /// Elements, each counted once per tile that it reaches
    pub records: u64,
    /// Tiles that no cut of space separates
    pub uncut_tiles: u64,
    /// The file of all pairs
    pub rows: String,
    /// As given to `plan`
    pub files: Vec<String>,
    /// Of a step only
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step: Option<TilesStep>,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(JsonSchema))]
pub struct TilesStep {
    /// Whether nothing touches from the start to the end, if the start does not intersect
    pub free: bool,
    /// Not asked: a plan of the starts without step says it
    pub start_intersects: (),
    /// The first contact; of several at one time, the first row. Null if the step is free
    pub earliest: Option<Impact>,
    pub kinds: KindsOfTiles,
    /// How many pairs touch at time 0
    pub touching_at_start: u64,
    /// The distance to be kept, 0 unless --separation says otherwise
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub separation: f64,
}

#[cfg(test)]
mod tests {
    use impinge_testing::schema;

    use super::*;

    /// `check` and `fix` print what `impinge_check` stores, which is described by hand.
    #[test]
    fn descriptions_are_made_from_types() {
        schema::hold::<Pairs>("answer");
        schema::hold::<Count>("count");
        schema::hold::<FrameError>("sequence-error");
        schema::hold::<SequenceStep>("sequence-step");
        schema::hold::<Step>("step");
        schema::hold::<Candidates>("candidates");
        schema::hold::<Near>("near");
        schema::hold::<Safe>("safe");
        schema::hold::<Distance>("distance");
        schema::hold::<Probe>("probe");
        schema::hold::<Cast>("cast");
        schema::hold::<Assembly>("assembly");
        schema::hold::<Devices>("devices");
        schema::hold::<TilesPlan>("tiles-plan");
        schema::hold::<TilesScatter>("tiles-scatter");
        schema::hold::<TilesRun>("tiles-run");
        schema::hold::<TilesMerge>("tiles-merge");
    }
}
