// The data that host and device exchange. The Rust twins are in `gpu/layout.rs`; a test
// parses this file and compares sizes, offsets and constants.

// Workgroups in a row of a dispatch that has more than one.
const WIDEST: u32 = 32768u;

// A node of the trees: a box in ordered keys (see boxes.wgsl) and where its children are.
//
//   shape  31           13   12   11       4 3        0
//         +---------------+------+----------+----------+
//         |       0       | gate |  height  | children |
//         +---------------+------+----------+----------+
//
// Height 0: a cluster; `first_child` is its number. Gate: the entrance to a body; `first_child` is
// the body's number and the only child is the body's root. Else: children have consecutive numbers.
struct Node {
    low: vec3<u32>,
    first_child: u32,
    high: vec3<u32>,
    shape: u32,
}

const CHILDREN: u32 = 15u;
const GATE: u32 = 0x1000u;

// The nodes of one height.
struct Level { first: u32, count: u32 }

// One part of the frame: of a body one, in a step up to three. `slack`: by how many keys its boxes
// are widened, for rounded positions. In a step, the bits of `part`:
//
//   part  31             5      4        3       2     1   0
//         +----------------+------------+--------+------+------+
//         |  body number   | own parts | points | bare | part |
//         +----------------+------------+--------+------+------+
//
// Own parts: pairs with other parts of the same body are asked for. Points, bare: the body has no
// edges, no faces. `first_slot`, `first_number`: those of its first element; records are in the
// order of their places.
struct Body {
    root: u32,
    slack: u32,
    within: u32,
    part: u32,
    category: vec2<u32>,
    mask: vec2<u32>,
    first_slot: u32,
    first_number: u32,
}

const PART: u32 = 3u;
const EDGES: u32 = 0u;
const VERTICES: u32 = 1u;
const FACES: u32 = 2u;
const BARE: u32 = 4u;
const POINTS: u32 = 8u;
const OWN_PARTS: u32 = 16u;
const BODY_SHIFT: u32 = 5u;

// A run of at most 64 elements and the run of its unique vertices.
//
//   sizes  31         16 15          0
//         +-------------+-------------+
//         |  vertices   | elements  |
//         +-------------+-------------+
struct Cluster {
    first_slot: u32,
    first_vertex: u32,
    sizes: u32,
    body: u32,
}

struct NodePair { a: u32, b: u32 }
struct WorkItem { a: u32, b: u32 }

// Two slots. Bit 31 of `a`: positions were rounded. Bit 31 of `b`: the two share a vertex; in a
// step, `a` is an edge.
struct Candidate { a: u32, b: u32 }

// Two global element numbers, the lower one first. In a step, a pair key is a candidate; and an
// unsure key has two slots, if the host decides it.
struct PairKey { low: u32, high: u32 }
struct UnsureKey { low: u32, high: u32 }

// Of a pair of a step: until when it certainly does not touch, and by when it certainly does; 2 if
// that is not certain.
struct PairTimes { free_until: f32, touches_by: f32 }

// Parameters of one dispatch.
struct Params {
    // bounds: the clusters, nodes or levels to refit. traversal: the round.
    first: u32,
    count: u32,
    // prepare: the counter to read, elements per workgroup, the most elements, the slot for the
    // arguments.
    counter: u32,
    per_group: u32,
    capacity: u32,
    slot: u32,
    // Pairs of bodies that do not meet whatever their filters say.
    n_ignored: u32,
    // 1 when pairs that share a vertex are resolved, 0 when they are left out.
    resolve: u32,
    // Cells: elements per group, cells per element (bits of an f32), the most cells there is room
    // for.
    group_size: u32,
    lambda: u32,
    most_cells: u32,
    // Methods of other crates: 1 when only the cell that owns a pair tests it.
    owner_rule: u32,
    // Cells: 1 when lists are filled but no work items are made. Then, for one cell at a time: its
    // entries, and the tile of the product of its groups.
    lists_only: u32,
    n_entries: u32,
    tile_row: u32,
    tile_column: u32,
    tile_side: u32,
    // Steps: 1 when pairs are named by global numbers, 0 when by slots.
    by_number: u32,
    // Steps: which contacts are sought.
    sought: u32,
    // Steps: the kinds of pairs that the query names, as bits, with bit 31; 0 if it names none.
    kinds: u32,
    // Steps that keep a distance, and safe distances: how far boxes are widened (bits of an f32).
    reach: u32,
    // Last kernels of what stays on the device: the room of all buffers before the lists (that of
    // candidates is `capacity`), of pairs, and of pairs that a step searches (0 in a frame).
    queue_room: u32,
    items_room: u32,
    kept_room: u32,
    entries_room: u32,
    pairs_room: u32,
    searched_room: u32,
}

const KIND_VERTEX_FACE: u32 = 1u;
const KIND_EDGE_EDGE: u32 = 2u;
const KIND_EDGE_VERTEX: u32 = 4u;
const KIND_VERTEX_VERTEX: u32 = 8u;

const SEEK_ALL: u32 = 0u;
const SEEK_EARLIEST: u32 = 1u;
const SEEK_ANY: u32 = 2u;

// An element within its body's reach: its box, its place (bit 31: rounded), its body, and the
// fine cells that it touches:
//
//   range.x  31       16 15        0
//           +-----------+-----------+
//           |  last x   |  first x  |      and so on for y and z
//           +-----------+-----------+
struct Kept {
    low: vec3<u32>,
    slot: u32,
    high: vec3<u32>,
    body: u32,
    range: vec3<u32>,
    unused: u32,
}

// The box in which a body may meet others.
struct Reach {
    low: vec3<u32>,
    high: vec3<u32>,
}

// The grid. A coarse cell has four fine cells along each axis; `shift` halvings make all of them
// coarser.
struct Grid {
    origin: vec3<f32>,
    shift: u32,
    scale: vec3<f32>,
    n_cells: u32,
    // Coarse cells along each axis before and after the shift.
    finest: vec3<u32>,
    unused: u32,
    resolution: vec3<u32>,
    unused_too: u32,
}

// A coarse cell: the number of entries, the highest body with an entry, and the complement of the
// lowest.
struct Cell {
    n_entries: atomic<u32>,
    highest: atomic<u32>,
    lowest: atomic<u32>,
}

// Two groups of one cell, as runs of the entries.
//
//   cell   31     28 27      14 13       0        sizes  31   28 27      14 13       7 6        0
//         +---------+----------+----------+             +-------+----------+----------+----------+
//         |    0    |    y     |    x     |             |   0   |    z     |  n_b - 1 |  n_a - 1 |
//         +---------+----------+----------+             +-------+----------+----------+----------+
struct CellItem {
    cell: u32,
    sizes: u32,
    first_a: u32,
    first_b: u32,
}

// Workgroups of an indirect dispatch.
struct Arguments { x: u32, y: u32, z: u32 }

// Counters: how much was needed, even if it did not fit.
const ROUNDS: u32 = 32u;
const N_ITEMS: u32 = 32u;
const N_CANDIDATES: u32 = 33u;
const N_PAIRS: u32 = 34u;
const N_UNSURE: u32 = 35u;
const TOO_MUCH: u32 = 36u;
const N_KEPT: u32 = 37u;
const N_ENTRIES: u32 = 38u;
const N_SUBDIVIDED: u32 = 39u;
// Low and high word; only some methods count box tests.
const N_BOX_TESTS: u32 = 40u;
const N_BOX_TESTS_HIGH: u32 = 41u;
// Steps: the least time by which some pair certainly touches, the bits of an f32; 2 if that is
// certain of none.
const TOUCHES_BY: u32 = 42u;
// What stays on the device: the numbers of pairs and of unsure pairs, above the room of the list if
// any may be missing.
const N_PAIRS_LISTED: u32 = 43u;
const N_UNSURE_LISTED: u32 = 44u;
const N_COUNTERS: u32 = 45u;

// Tallies: the region (three complements of its low end, then its high end), then the entries of
// the cell lists for every shift, two words each, then a bit for each shift that is too fine.
const ENTRIES_BY_SHIFT: u32 = 6u;
const SHIFTS_TOO_FINE: u32 = 36u;
const SHIFTS: u32 = 15u;
const N_TALLIES: u32 = 37u;

const NO_ROOT: u32 = 0xffffffffu;

// A candidate that the question leaves out.
const NOTHING: u32 = 0xffffffffu;

// Words of the rules about what is left out: the number of pairs of groups, where they begin, where
// the lists of vertices begin (0: there are none), where pairs begin, how many; then a mark per
// vertex.
const RULES_N_GROUPS: u32 = 0u;
const RULES_GROUPS: u32 = 1u;
const RULES_LISTS: u32 = 2u;
const RULES_PAIRS: u32 = 3u;
const RULES_N_PAIRS: u32 = 4u;
const RULES_MARKS: u32 = 5u;
// Marks vertices that never move.
const PINNED: u32 = 0x80000000u;

const FLAG: u32 = 0x80000000u;
