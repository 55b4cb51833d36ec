//! Hubs: vertices that very many elements name, such as the middle of a fan.
//!
//! All elements around a hub have boxes that overlap there, so pairs that share a hub would be
//! quadratic in number. They are never examined one by one:
//!
//! - Elements of one hub follow each other in the order of the clusters (`classes`).
//! - A node of the tree records the hubs that *all* of its elements name. `traversal` skips a
//!   pair of nodes with a common hub: each pair of their elements shares a vertex.
//! - In clusters of which only some elements name a hub, lane masks exclude such pairs.
//!
//! Under `SharedVertex::Skip` that is all. Under `SharedVertex::Resolve`, `cpu::hubs` decides the
//! pairs of each hub by the directions of the elements as seen from it.
//!
//! Two hubs that very many elements name together are an *axis*, such as the spine of a book.
//!
//! Cost: one count per corner per topology. Bodies without hubs keep nothing.

use super::GROUP;
use super::tree::TreeShape;
use crate::scene::index::{ClusterIx, Slot};

/// A vertex that more corners name than this is a hub.
pub(crate) const HUB: u32 = 96;
/// No vertex has this number.
const NONE: u32 = u32::MAX;
/// The most hubs of one element: a tetrahedron has four vertices.
const MOST: usize = 4;

/// The hubs of one element, or those common to all elements of a node: ascending, then
/// [`NONE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct HubSet([u32; MOST]);

impl HubSet {
    pub const EMPTY: HubSet = HubSet([NONE; MOST]);

    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.iter().copied().take_while(|&hub| hub != NONE)
    }

    fn insert(&mut self, hub: u32) {
        if !self.0.contains(&hub) {
            self.0[MOST - 1] = hub;
            self.0.sort_unstable();
        }
    }

    /// The hubs in both sets.
    pub fn and(&self, other: &Self) -> Self {
        let mut both = Self::EMPTY;
        for (slot, hub) in self.iter().filter(|hub| other.0.contains(hub)).enumerate() {
            both.0[slot] = hub;
        }
        both
    }

    #[inline(always)]
    pub fn meets(&self, other: &Self) -> bool {
        self.iter().any(|hub| other.0.contains(&hub))
    }
}

/// Two hubs and the slots of the elements that name both.
#[derive(Debug)]
struct Axis {
    /// The two vertices, lower first.
    hubs: [u32; 2],
    slots: Vec<Slot>,
}

/// One hub and the slots of the elements that name it.
#[derive(Debug)]
struct Hub {
    vertex: u32,
    slots: Vec<Slot>,
}

/// The hubs of one body's clusters.
#[derive(Debug, Default)]
pub(crate) struct Hubs {
    /// Sorted by vertex.
    hubs: Vec<Hub>,
    /// Sorted by the two vertices.
    axes: Vec<Axis>,
    /// `common[level][node]`: the hubs that all elements of the node name.
    common: Vec<Vec<HubSet>>,
    /// For each cluster, where its entries in `lanes` start; and one past the last.
    lane_starts: Vec<u32>,
    /// A hub and the lanes of the cluster that name it, sorted by hub.
    lanes: Vec<(u32, u64)>,
}

/// How often each vertex is named.
pub(super) fn counts<const N: usize>(corners: &[[u32; N]]) -> Vec<u32> {
    let flat = corners.as_flattened();
    let n_vertices = flat.iter().max().map_or(0, |&last| last as usize + 1);
    let mut counts = vec![0u32; n_vertices];
    for &vertex in flat {
        counts[vertex as usize] += 1;
    }
    counts
}

/// For each element, the one of its hubs that is named most often, if it has any; `None` if the
/// body has no hub. `counts` says how often each vertex is named.
pub(super) fn classes<const N: usize>(
    corners: &[[u32; N]],
    counts: &[u32],
) -> Option<Vec<Option<u32>>> {
    if counts.iter().all(|&count| count <= HUB) {
        return None;
    }
    let class = |element: &[u32; N]| {
        let hubs = element
            .iter()
            .filter(|&&vertex| counts[vertex as usize] > HUB);
        // Of two named equally often, the lower one.
        hubs.copied()
            .max_by_key(|&vertex| (counts[vertex as usize], std::cmp::Reverse(vertex)))
    };
    Some(corners.iter().map(class).collect())
}

impl Hubs {
    /// Finds the hubs from the corners in the order of the clusters. `counts` says how often each
    /// vertex is named.
    pub fn new<const N: usize>(corners: &[[u32; N]], counts: &[u32], shape: &TreeShape) -> Self {
        let sets: Vec<HubSet> = corners
            .iter()
            .map(|element| {
                let mut set = HubSet::EMPTY;
                for &vertex in element {
                    if counts[vertex as usize] > HUB {
                        set.insert(vertex);
                    }
                }
                set
            })
            .collect();
        let hubs: Vec<Hub> = runs(sets.iter().map(|set| set.iter().map(|hub| [hub; 2])))
            .into_iter()
            .map(|([vertex, _], slots)| Hub { vertex, slots })
            .collect();
        let axes: Vec<Axis> = runs(sets.iter().map(|set| {
            set.iter().flat_map(|low| {
                set.iter()
                    .filter(move |&high| low < high)
                    .map(move |high| [low, high])
            })
        }))
        .into_iter()
        .filter(|(_, slots)| slots.len() > HUB as usize)
        .map(|(hubs, slots)| Axis { hubs, slots })
        .collect();
        let (lane_starts, lanes) = lanes(&sets);
        Hubs {
            hubs,
            axes,
            common: common(&sets, shape),
            lane_starts,
            lanes,
        }
    }

    /// Whether one hub is named by all elements of both nodes, which may be the same node.
    #[inline(always)]
    pub fn hold_all(&self, (level_a, a): (u32, u32), (level_b, b): (u32, u32)) -> bool {
        let a = &self.common[level_a as usize][a as usize];
        a.meets(&self.common[level_b as usize][b as usize])
    }

    /// For each hub that two clusters (or one with itself) both name: `(lanes of a, lanes of b)`
    /// that name it.
    pub fn between(&self, a: ClusterIx, b: ClusterIx) -> impl Iterator<Item = (u64, u64)> + '_ {
        let of = |cluster: ClusterIx| {
            let (starts, ix) = (&self.lane_starts, cluster.index());
            &self.lanes[starts[ix] as usize..starts[ix + 1] as usize]
        };
        let (of_a, mut of_b) = (of(a), of(b));
        of_a.iter().filter_map(move |&(hub, lanes_a)| {
            while let [(first, _), rest @ ..] = of_b
                && *first < hub
            {
                of_b = rest;
            }
            of_b.first()
                .and_then(|&(first, lanes_b)| (first == hub).then_some((lanes_a, lanes_b)))
        })
    }

    /// The number of hubs and axes.
    pub fn n_to_decide(&self) -> usize {
        self.hubs.len() + self.axes.len()
    }

    /// The vertices of each hub and axis, and the slots of the elements that name them.
    pub fn to_decide(&self) -> impl Iterator<Item = (&[u32], &[Slot])> {
        let hubs = self.hubs.iter();
        let hubs = hubs.map(|hub| (std::slice::from_ref(&hub.vertex), &hub.slots[..]));
        hubs.chain(
            self.axes
                .iter()
                .map(|axis| (&axis.hubs[..], &axis.slots[..])),
        )
    }

    /// The hubs among an element's corners that form an axis with `hub`.
    pub fn partners(&self, hub: u32, corners: &[u32]) -> HubSet {
        let mut partners = HubSet::EMPTY;
        for &other in corners {
            if other != hub && self.is_axis([hub.min(other), hub.max(other)]) {
                partners.insert(other);
            }
        }
        partners
    }

    /// Whether two elements are decided at `shared`, a hub or an axis. Each pair is decided once:
    /// at the first axis that both name, or if there is none at the first hub.
    pub fn owns(&self, shared: &[u32], a: &[u32], b: &[u32]) -> bool {
        let mut common = HubSet::EMPTY;
        for &vertex in a {
            if b.contains(&vertex) && self.is_hub(vertex) {
                common.insert(vertex);
            }
        }
        let pairs = common
            .iter()
            .flat_map(|low| common.iter().map(move |high| [low, high]))
            .filter(|[low, high]| low < high);
        match pairs.into_iter().find(|&pair| self.is_axis(pair)) {
            Some(axis) => shared == axis,
            None => shared.len() == 1 && common.iter().next() == Some(shared[0]),
        }
    }

    fn is_hub(&self, vertex: u32) -> bool {
        (self.hubs.binary_search_by_key(&vertex, |hub| hub.vertex)).is_ok()
    }

    fn is_axis(&self, hubs: [u32; 2]) -> bool {
        (self.axes.binary_search_by_key(&hubs, |axis| axis.hubs)).is_ok()
    }

    pub fn bytes(&self) -> usize {
        let slots: usize = (self.hubs.iter().map(|hub| hub.slots.len()))
            .chain(self.axes.iter().map(|axis| axis.slots.len()))
            .sum();
        let nodes: usize = self.common.iter().map(Vec::len).sum();
        size_of::<Slot>() * slots
            + size_of_val(&self.lane_starts[..])
            + size_of::<HubSet>() * nodes
            + size_of_val(&self.lanes[..])
    }
}

/// Inverts a list: `things` gives each slot's hubs or axes; returns the slots of each, sorted by
/// hub or axis.
fn runs(
    things: impl Iterator<Item = impl Iterator<Item = [u32; 2]>>,
) -> Vec<([u32; 2], Vec<Slot>)> {
    let slots = (0..).map(Slot::new);
    let mut all: Vec<([u32; 2], Slot)> = slots
        .zip(things)
        .flat_map(|(slot, things)| things.map(move |thing| (thing, slot)))
        .collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a.0 == b.0)
        .map(|run| (run[0].0, run.iter().map(|&(_, slot)| slot).collect()))
        .collect()
}

fn common(sets: &[HubSet], shape: &TreeShape) -> Vec<Vec<HubSet>> {
    let of_all = |sets: &[HubSet]| {
        let (first, rest) = sets.split_first().expect("no node is empty");
        rest.iter().fold(*first, |common, set| common.and(set))
    };
    let mut levels: Vec<Vec<HubSet>> = Vec::with_capacity(shape.n_levels());
    for level in 0..shape.n_levels() {
        let nodes = match levels.last() {
            None => sets.chunks(GROUP).map(of_all).collect(),
            Some(below) => (0..shape.n_nodes(level))
                .map(|node| of_all(&below[shape.children(level, node)]))
                .collect(),
        };
        levels.push(nodes);
    }
    levels
}

fn lanes(sets: &[HubSet]) -> (Vec<u32>, Vec<(u32, u64)>) {
    let mut starts = vec![0];
    let mut lanes: Vec<(u32, u64)> = Vec::new();
    for cluster in sets.chunks(GROUP) {
        let first = lanes.len();
        let named = (0..).zip(cluster);
        lanes.extend(named.flat_map(|(lane, set)| set.iter().map(move |hub| (hub, 1 << lane))));
        lanes[first..].sort_unstable();
        // One entry per hub.
        let mut last = first;
        for ix in first..lanes.len() {
            if ix > first && lanes[ix].0 == lanes[last].0 {
                lanes[last].1 |= lanes[ix].1;
            } else {
                last += usize::from(ix > first);
                lanes[last] = lanes[ix];
            }
        }
        if lanes.len() > first {
            lanes.truncate(last + 1);
        }
        starts.push(lanes.len() as u32);
    }
    (starts, lanes)
}
