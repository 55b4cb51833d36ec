//! From which size on another way of doing the same work pays; and which ways a frame went.
//!
//! No answer depends on these numbers. They are in one place so that tests can enter every way with
//! small scenes: with each number at 0 and at infinity.

/// One end of the range of a threshold.
trait Ends: Copy {
    const ENDS: [Self; 2];
}

impl Ends for u32 {
    const ENDS: [u32; 2] = [0, u32::MAX];
}

impl Ends for u64 {
    const ENDS: [u64; 2] = [0, u64::MAX];
}

impl Ends for usize {
    const ENDS: [usize; 2] = [0, usize::MAX];
}

impl Ends for f64 {
    const ENDS: [f64; 2] = [0.0, f64::INFINITY];
}

/// The type with all thresholds, from one list of them, so that tests forget none.
macro_rules! thresholds {
    ($($(#[$doc:meta])* $name:ident: $type:ty = $default:expr,)*) => {
        /// The thresholds of the CPU backend. Not for users: a better value belongs into the
        /// default.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Tuning {
            $($(#[$doc])* pub $name: $type,)*
        }

        impl Default for Tuning {
            fn default() -> Self {
                Tuning { $($name: $default,)* }
            }
        }

        impl Tuning {
            /// The names of all thresholds.
            pub const NAMES: &[&str] = &[$(stringify!($name)),*];

            /// All thresholds at 0, and all at infinity.
            pub const ENDS: [Tuning; 2] = [
                Tuning { $($name: <$type as Ends>::ENDS[0],)* },
                Tuning { $($name: <$type as Ends>::ENDS[1],)* },
            ];

            /// These thresholds, but the one of this name as in `other`.
            ///
            /// # Panics
            /// If no threshold has this name.
            pub fn with(mut self, name: &str, other: &Tuning) -> Tuning {
                match name {
                    $(stringify!($name) => self.$name = other.$name,)*
                    _ => panic!("no threshold is called {name}"),
                }
                self
            }
        }
    };
}

thresholds! {
    /// From this many elements of all bodies on, helpers are woken at the beginning of a frame of
    /// `Clusters`.
    call_from: u64 = 30_000,
    /// From this many elements on, a frame is expected to take so long that sleeping helpers are
    /// woken, whatever the last frame took.
    wake_from: u64 = 300_000,
    /// From this many elements on, a body is clustered on several threads.
    pool_from: usize = 4096,
    /// The most units of work per task, whatever a stage's units are: the stages' own limits are
    /// lower. At least one.
    most_per_task: usize = usize::MAX,
    /// Stage `bounds` of `Clusters`: with fewer elements of all bodies, one thread computes the
    /// boxes. Positions have just been written, mostly by one thread. If they fit in its cache,
    /// this thread reads them faster than another could fetch them.
    bounds_parallel_from: u64 = 120_000,
    /// The same for steps, in elements of all parts.
    step_bounds_parallel_from: u64 = 60_000,
    /// How much the clusters' surface may grow against the body's before the body is clustered
    /// again.
    stale_from: f64 = 1.5,
    /// The clusters of a body are sorted (see `cpu::culled`) if it has at least this many
    /// elements.
    culled_from: usize = 2_048,
    /// Clusters stay sorted if at least one in this many lies beside the other bodies.
    culled_one_in: usize = 4,
    /// Sorting groups of clusters again costs as much as they save in this many frames.
    culled_cost: u32 = 6,
    /// Frames after which all boxes are found again, to see which clusters are culled by now and
    /// how well clusters fit.
    culled_lasts: u32 = 64,
    /// Stage `bounds` of `Cells`: with fewer elements, waking a thread costs more than it saves.
    cull_parallel_from: u64 = 100_000,
    /// The most bodies for which a coarse map is made (see `cpu::cull`); never more than 32.
    most_maps: usize = 8,
    /// Elements of all bodies per cell of the map. At least one.
    map_cell: u64 = 8,
    /// The most rows of the map that one element marks; a larger element counts as being
    /// everywhere.
    most_marked: u32 = 256,
    /// The most work items per batch: the methods' own limits are lower. At least one.
    most_batch_items: usize = usize::MAX,
    /// With fewer work items in a batch of `Clusters`, one worker takes them all.
    pairing_parallel_from: usize = 64,
    /// The most clusters whose boxes and corners a worker keeps: 500 KB of them fit in a
    /// second-level cache. At least two.
    most_cached: u64 = 128,
    /// A worker decides its candidates once there are this many.
    decide_from: usize = 1024,
    /// With fewer pairs of boxes of two clusters that overlap, directions of their elements are not
    /// tested: `narrow` takes the pairs as fast.
    directions_from: usize = 512,
    /// The search for the earliest contact computes the boxes of elements again once contacts are
    /// sought only in this part of the time that the boxes hold.
    step_shorter_from: f64 = 0.5,
    /// With fewer keys, or with fewer keys than half the numbers of elements, one thread sorts them
    /// in place as fast.
    sort_from: usize = 1 << 15,
    /// `Auto`: from this many elements of new bodies on, the grid is worth a try. With fewer,
    /// clusters are made in about a millisecond.
    auto_from: u64 = 10_000,
    /// `Auto`: bodies with fewer elements than this do not count as new.
    auto_body_from: u32 = 1_000,
    /// `Auto`: with more elements in a cell than this (see `Cells::crowding`), making clusters
    /// costs less than pairing all of a cell.
    auto_most_crowded: u64 = 64,
}

/// How often a frame took each way that depends on [`Tuning`], for tests that must take it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Ways {
    /// Times that tasks were shared with helpers.
    pub n_shared: u64,
    /// Tasks, shared or not.
    pub n_tasks: u64,
    /// Times that helpers were woken before there was work.
    pub n_called: u64,
    /// Whether helpers that slept were woken.
    pub wakes: bool,
    /// Times that work went to a rayon pool.
    pub n_pooled: u64,
    /// Groups of clusters that came back and were sorted again.
    pub n_came_back: u64,
    /// Bodies that were entered in a coarse map.
    pub n_mapped: u64,
    /// Bodies with elements too large for the map.
    pub n_everywhere: u64,
    /// Clusters that took the place of others in a worker's cache.
    pub n_evicted: u64,
    /// Times that a worker decided candidates because there were enough of them.
    pub n_full: u64,
    /// Times that boxes of elements were dropped because contacts are sought in a shorter time.
    pub n_shortened: u64,
    /// Candidates that directions of elements told apart, because very many boxes overlapped.
    pub n_parted: u64,
    /// Times that keys were sorted by counting.
    pub n_counted: u64,
    /// Times that near pairs were listed with a margin.
    pub n_listed: u64,
}
