//! The data that host and device exchange. Each struct here has its twin in
//! `kernels/shared/layout.wgsl`, where the bits are drawn. Tests parse the shaders and compare.

use std::fmt;

use bytemuck::{Pod, Zeroable};

/// Declares plain structs of 32-bit words.
macro_rules! words {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $type:ty),* $(,)? })*) => {
        $(
            $(#[$doc])*
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
            #[repr(C)]
            pub struct $name {
                $(
                    #[doc = concat!("`", stringify!($field), "` of `", stringify!($name), "` in `kernels/shared/layout.wgsl`.")]
                    pub $field: $type,
                )*
            }

            impl $name {
                /// The names of its fields.
                #[allow(dead_code)]
                const FIELDS: &'static [&'static str] = &[$(stringify!($field)),*];
            }
        )*
    };
}

words! {
    /// A node of the trees.
    Node { low: [u32; 3], first_child: u32, high: [u32; 3], shape: u32 }
    /// One part of a frame.
    Body {
        root: u32, slack: u32, within: u32, part: u32,
        category: [u32; 2], mask: [u32; 2],
        first_slot: u32, first_number: u32,
    }
    /// A run of elements and its unique vertices.
    Cluster { first_slot: u32, first_vertex: u32, sizes: u32, body: u32 }
    /// The nodes of one height.
    Level { first: u32, count: u32 }
    /// Two nodes whose boxes may overlap; in the list of ignored pairs, two parts.
    NodePair { a: u32, b: u32 }
    /// Two clusters.
    WorkItem { a: u32, b: u32 }
    /// Two slots, with flags.
    Candidate { a: u32, b: u32 }
    /// Two global element numbers that certainly intersect; in a step, two slots of a pair that
    /// is searched, with flags.
    PairKey { low: u32, high: u32 }
    /// Two global element numbers left to exact arithmetic; in a step that the host decides, two
    /// slots.
    UnsureKey { low: u32, high: u32 }
    /// Until when a pair of a step certainly does not touch, and by when it certainly does: the
    /// bits of two f32.
    PairTimes { free_until: u32, touches_by: u32 }
    /// Parameters of one dispatch.
    Params {
        first: u32, count: u32,
        counter: u32, per_group: u32, capacity: u32, slot: u32,
        n_ignored: u32, resolve: u32,
        group_size: u32, lambda: u32, most_cells: u32, owner_rule: u32,
        lists_only: u32, n_entries: u32, tile_row: u32, tile_column: u32, tile_side: u32,
        by_number: u32, sought: u32, kinds: u32,
        reach: u32, queue_room: u32, items_room: u32,
        kept_room: u32, entries_room: u32, pairs_room: u32, searched_room: u32,
    }
    /// An element within its body's reach.
    Kept { low: [u32; 3], slot: u32, high: [u32; 3], body: u32, range: [u32; 3], unused: u32 }
    /// The box in which a body may meet others.
    Reach { low: [u32; 3], gap: u32, high: [u32; 3], gap_too: u32 }
    /// The grid; the host never reads the floats.
    Grid {
        origin: [u32; 3], shift: u32, scale: [u32; 3], n_cells: u32,
        finest: [u32; 3], unused: u32, resolution: [u32; 3], unused_too: u32,
    }
    /// A coarse cell.
    Cell { n_entries: u32, highest: u32, lowest: u32 }
    /// Two groups of one cell.
    CellItem { cell: u32, sizes: u32, first_a: u32, first_b: u32 }
    /// Where the list of a cell starts.
    Start { entry: u32 }
    /// One entry of a cell's list.
    ListEntry { kept: u32 }
    /// A word of the region, or of the entries per shift.
    Tally { word: u32 }
    /// Workgroups of an indirect dispatch.
    Arguments { x: u32, y: u32, z: u32 }
    /// One word of a position: the bits of a coordinate.
    Coordinate { bits: u32 }
    /// How far a vertex may move: the bits of an f32.
    Share { bits: u32 }
    /// The corners of an element; a triangle repeats its last corner.
    Corners { vertices: [u32; 4] }
    /// A vertex of a cluster.
    ClusterVertex { vertex: u32 }
    /// The number of the element at a slot, within its part; in a piece the global one.
    Order { number: u32 }
    /// How much of something was needed.
    Counter { n: u32 }
    /// A word of the rules about what is left out.
    Rule { word: u32 }
}

/// That kinds are named, in `Params::kinds`.
pub const KINDS_NAMED: u32 = 0x8000_0000;
/// Vertices and faces, in `Params::kinds`; likewise below. The bits of [`PairKinds`].
///
/// [`PairKinds`]: crate::query::pair_kind::PairKinds
pub const KIND_VERTEX_FACE: u32 = 1;
/// Two edges.
pub const KIND_EDGE_EDGE: u32 = 2;
/// Edges and vertices.
pub const KIND_EDGE_VERTEX: u32 = 4;
/// Two vertices.
pub const KIND_VERTEX_VERTEX: u32 = 8;
/// All contacts of a step, in `Params::sought`.
pub const SEEK_ALL: u32 = 0;
/// Only the first contact, in `Params::sought`.
pub const SEEK_EARLIEST: u32 = 1;
/// Whether there is any contact, in `Params::sought`.
pub const SEEK_ANY: u32 = 2;
/// Children of a node, in `Node::shape`.
pub const CHILDREN: u32 = 15;
/// Marks the entrance to a body, in `Node::shape`.
pub const GATE: u32 = 0x1000;
/// Where the height of a node is, in `Node::shape`.
pub const HEIGHT_SHIFT: u32 = 4;
/// The most rounds that a traversal takes; counters 0 .. 32 are the queues'.
pub const ROUNDS: u32 = 32;
/// Counter of work items.
pub const N_ITEMS: u32 = 32;
/// Counter of candidates.
pub const N_CANDIDATES: u32 = 33;
/// Counter of certain pairs.
pub const N_PAIRS: u32 = 34;
/// Counter of unsure pairs.
pub const N_UNSURE: u32 = 35;
/// Not 0 if a counter has passed 2^32, or one invocation had too much work.
pub const TOO_MUCH: u32 = 36;
/// Counter of kept elements.
pub const N_KEPT: u32 = 37;
/// Counter of entries of the cell lists.
pub const N_ENTRIES: u32 = 38;
/// Counter of cells that went through the second level.
pub const N_SUBDIVIDED: u32 = 39;
/// Counter of box tests, which only some methods count: low word.
pub const N_BOX_TESTS: u32 = 40;
/// High word.
pub const N_BOX_TESTS_HIGH: u32 = 41;
/// The number of words for the region and the entries per shift.
pub const N_TALLIES: u32 = 37;
/// The edges of a body, in `Body::part`.
pub const EDGES: u32 = 0;
/// The vertices of a body, in `Body::part`.
pub const VERTICES: u32 = 1;
/// The faces of a body, or its elements as given, in `Body::part`.
pub const FACES: u32 = 2;
/// Marks parts of bodies without faces, in `Body::part`.
pub const BARE: u32 = 4;
/// Marks parts of bodies without edges, in `Body::part`.
pub const POINTS: u32 = 8;
/// Marks parts whose pairs with other parts of the same body are asked for, in `Body::part`.
pub const OWN_PARTS: u32 = 16;
/// Where the number of the body is, in `Body::part`.
pub const BODY_SHIFT: u32 = 5;
/// The word of the rules about what is left out that has the number of pairs of groups.
pub const RULES_N_GROUPS: u32 = 0;
/// Where these pairs begin.
pub const RULES_GROUPS: u32 = 1;
/// Where the lists of vertices begin.
pub const RULES_LISTS: u32 = 2;
/// Where the pairs of elements begin.
pub const RULES_PAIRS: u32 = 3;
/// The number of these pairs.
pub const RULES_N_PAIRS: u32 = 4;
/// Where marks of vertices begin.
pub const RULES_MARKS: u32 = 5;
/// Marks vertices that never move, in these rules.
pub const PINNED: u32 = 0x8000_0000;
/// The root of a body without elements, and the top if there is no tree over bodies.
pub const NO_ROOT: u32 = u32::MAX;
/// The least time by which some pair of a step certainly touches, the bits of an f32.
pub const TOUCHES_BY: u32 = 42;
/// The number of pairs for shaders of the caller's: above the room of the list if any is missing.
pub const N_PAIRS_LISTED: u32 = 43;
/// The number of unsure pairs, likewise.
pub const N_UNSURE_LISTED: u32 = 44;
/// The number of counters.
pub const N_COUNTERS: u32 = 45;
/// Says that contact is not certain.
pub const NEVER: f32 = 2.0;
/// Flags of candidates.
#[cfg(test)]
pub const FLAG: u32 = 0x8000_0000;

/// A time by which there certainly is contact, if that is certain.
pub fn time_by(bits: u32) -> Option<f32> {
    Some(f32::from_bits(bits)).filter(|&time| time < NEVER)
}

impl Node {
    /// A node whose box is not known yet.
    pub fn new(first_child: u32, n_children: u32, height: u32, gate: bool) -> Self {
        Node {
            low: [u32::MAX; 3],
            high: [0; 3],
            first_child,
            shape: n_children | height << HEIGHT_SHIFT | if gate { GATE } else { 0 },
        }
    }

    /// The number of its children: 0 for a cluster, 1 for a gate.
    pub fn n_children(&self) -> u32 {
        self.shape & CHILDREN
    }

    /// Its height: 0 for a cluster.
    pub fn height(&self) -> u32 {
        self.shape >> HEIGHT_SHIFT & 0xff
    }

    /// Whether it is the entrance to a body.
    pub fn is_gate(&self) -> bool {
        self.shape & GATE != 0
    }
}

impl fmt::Display for Params {
    /// The parameters that are not 0.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: &[u32] = bytemuck::cast_slice(std::slice::from_ref(self));
        let set = Params::FIELDS
            .iter()
            .zip(words)
            .filter(|(_, word)| **word != 0);
        let set: Vec<String> = set.map(|(name, word)| format!("{name}: {word}")).collect();
        f.write_str(&set.join(", "))
    }
}

/// Words behind parameters.
const PADDING: usize = 64 - size_of::<Params>() / 4;

/// The parameters of one dispatch, padded to the alignment of uniform offsets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Step {
    /// The parameters.
    pub params: Params,
    padding: [u32; PADDING],
}

impl From<Params> for Step {
    fn from(params: Params) -> Self {
        Step {
            params,
            padding: [0; PADDING],
        }
    }
}
