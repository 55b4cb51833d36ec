//! The structures and constants of `impinge.h`, with the same layout. `tests/layout.c` holds both
//! against each other.

#![allow(non_camel_case_types)]

use std::ffi::{c_char, c_int, c_void};

use impinge::PairKind;

/// An `impinge_status`.
pub type Status = i32;
pub const OK: Status = 0;
pub const INVALID: Status = 1;
pub const OUT_OF_MEMORY: Status = 2;
pub const BUDGET: Status = 3;
pub const TOO_MANY_PAIRS: Status = 4;
pub const CANCELLED: Status = 5;
pub const DEVICE: Status = 6;
pub const INTERNAL: Status = 7;

pub const ABI_VERSION: u32 = 1;

pub const F32: u32 = 1;
pub const F64: u32 = 2;
pub const U32: u32 = 3;
pub const I32: u32 = 4;
pub const U64: u32 = 5;
pub const I64: u32 = 6;
pub const U8: u32 = 7;

pub const POINTS: u32 = 1;
pub const EDGES: u32 = 2;
pub const TRIANGLES: u32 = 3;
pub const TETRAHEDRA: u32 = 4;

pub const ANY_BODY: u32 = u32::MAX;

pub const BACKEND_AUTO: u32 = 0;
pub const BACKEND_CPU: u32 = 1;
pub const BACKEND_GPU: u32 = 2;

pub const SKIP: u32 = 0;
pub const RESOLVE: u32 = 1;

pub const START_REPORT: u32 = 0;
pub const START_SKIP: u32 = 1;
pub const START_VERIFY: u32 = 2;

pub const DISTANCES: u32 = 1;
pub const CLOSEST_POINTS: u32 = 2;
/// Refused: `impinge_signed_distance` has signs.
#[cfg_attr(not(test), expect(dead_code, reason = "a flag of the header alone"))]
pub const SIGNED: u32 = 4;
pub const CELL: u32 = 8;

pub const HITS_FIRST: u32 = 0;
pub const HITS_ANY: u32 = 1;
pub const HITS_ALL: u32 = 2;

pub const EXCLUDE_BODIES: u32 = 0;
pub const EXCLUDE_RINGS: u32 = 1;
pub const EXCLUDE_GROUPS: u32 = 2;
pub const EXCLUDE_VERTICES: u32 = 3;

pub const LOG_ERROR: u32 = 1;
pub const LOG_INFO: u32 = 2;

pub const COLUMN_KIND: u32 = 1;
pub const COLUMN_ROWS: u32 = 2;
pub const COLUMN_DISTANCE: u32 = 3;
pub const COLUMN_POINTS: u32 = 4;
pub const COLUMN_FEATURES: u32 = 5;
pub const COLUMN_PARALLEL: u32 = 6;
pub const COLUMN_TOI: u32 = 7;
pub const COLUMN_AT_START: u32 = 8;
pub const COLUMN_SHAPE: u32 = 9;
pub const COLUMN_STARTS: u32 = 10;
pub const COLUMN_CORNERS: u32 = 11;
pub const COLUMN_CONTACT_POINTS: u32 = 12;
pub const COLUMN_CURVE_STARTS: u32 = 13;
pub const COLUMN_CURVE_POINTS: u32 = 14;
pub const COLUMN_CURVE_CLOSED: u32 = 15;
pub const COLUMN_CURVE_LENGTH: u32 = 16;
pub const COLUMN_INSIDE_A: u32 = 17;
pub const COLUMN_INSIDE_B: u32 = 18;
pub const COLUMN_IS_HIT: u32 = 19;
pub const COLUMN_T: u32 = 20;
pub const COLUMN_T_END: u32 = 21;
pub const COLUMN_BARYCENTRICS: u32 = 22;
pub const COLUMN_VERTICES: u32 = 23;
pub const COLUMN_WEIGHT: u32 = 24;
pub const COLUMN_COEFFICIENTS: u32 = 25;
pub const COLUMN_SQUARED_DISTANCE: u32 = 26;
pub const COLUMN_GRADIENT: u32 = 27;
pub const COLUMN_HESSIAN: u32 = 28;
pub const COLUMN_MOLLIFIER: u32 = 29;
pub const COLUMN_MOLLIFIER_GRADIENT: u32 = 30;
pub const COLUMN_MOLLIFIER_HESSIAN: u32 = 31;
pub const COLUMN_KEPT: u32 = 32;
pub const COLUMN_NEW: u32 = 33;
pub const COLUMN_GONE: u32 = 34;

pub const SHAPE_SOLID: u8 = 0;
pub const SHAPE_EMPTY: u8 = 1;
pub const SHAPE_POINT: u8 = 2;
pub const SHAPE_SEGMENT: u8 = 3;
pub const SHAPE_POLYGON: u8 = 4;

pub const NO_FEATURE: u32 = 255;
/// No element.
pub const NO_ELEMENT: u32 = u32::MAX;
/// `IMPINGE_ON_SURFACE`
pub const ON_SURFACE: i32 = i32::MIN;

/// The bit of a kind of pairs, `IMPINGE_VF` and so on.
pub fn bit(kind: PairKind) -> u32 {
    1 << kind as u32
}

/// The kind of a bit.
pub fn kind_of(bit: u32) -> Option<PairKind> {
    PairKind::ALL
        .into_iter()
        .find(|&kind| self::bit(kind) == bit)
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_array {
    pub data: *const c_void,
    pub rows: usize,
    pub row_stride: isize,
    pub column_stride: isize,
    pub r#type: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_exclusion {
    pub kind: u32,
    pub a: u32,
    pub b: u32,
    pub n: u32,
    pub offsets: impinge_array,
    pub vertices: impinge_array,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_query {
    pub size: u32,
    pub between: u32,
    /// `self` in C.
    pub own: u32,
    pub shared_vertex: u32,
    pub a: u32,
    pub b: u32,
    pub kinds: u32,
    pub start: u32,
    pub precision: u32,
    pub hits: u32,
    pub n_nearest: u32,
    pub flags: u32,
    pub separation: f64,
    pub clearance: f64,
    pub clearance_share: f64,
    pub cell_low: [f64; 3],
    pub cell_high: [f64; 3],
    pub exclusions: *const impinge_exclusion,
    pub n_exclusions: usize,
    pub fixed: *const u32,
    pub n_fixed: usize,
    pub passes: Option<PassesCallback>,
    pub passes_user: *mut c_void,
    /// Of `impinge_near`, which is made of what is here.
    pub rest_pairs: *const *const c_void,
    pub n_rest_pairs: usize,
}

impl Default for impinge_query {
    fn default() -> Self {
        impinge_query {
            size: size_of::<Self>() as u32,
            between: 1,
            own: 1,
            shared_vertex: RESOLVE,
            a: ANY_BODY,
            b: ANY_BODY,
            kinds: 0,
            start: START_REPORT,
            precision: F32,
            hits: HITS_FIRST,
            n_nearest: 1,
            flags: 0,
            separation: 0.0,
            clearance: 0.0,
            clearance_share: 0.2,
            cell_low: [0.0; 3],
            cell_high: [0.0; 3],
            exclusions: std::ptr::null(),
            n_exclusions: 0,
            fixed: std::ptr::null(),
            n_fixed: 0,
            passes: None,
            passes_user: std::ptr::null_mut(),
            rest_pairs: std::ptr::null(),
            n_rest_pairs: 0,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_element {
    pub vertices: *const u32,
    pub n_vertices: u32,
    pub body: u32,
}

pub type PassesCallback =
    unsafe extern "C" fn(*mut c_void, *const impinge_element, *const impinge_element) -> c_int;
pub type CancelledCallback = unsafe extern "C" fn(*mut c_void) -> c_int;
pub type ProgressCallback = unsafe extern "C" fn(*mut c_void, u64, u64);
pub type LogCallback = unsafe extern "C" fn(*mut c_void, u32, *const c_char);
pub type RunCallback = unsafe extern "C" fn(*mut c_void, u32, *const impinge_pair, usize) -> c_int;
pub type ReleaseCallback = unsafe extern "C" fn(*mut c_void);

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_settings {
    pub size: u32,
    pub backend: u32,
    pub method: u32,
    pub threads: u32,
    pub memory_budget: u64,
    pub max_pairs: u64,
    pub cancelled: Option<CancelledCallback>,
    pub user: *mut c_void,
    pub progress: Option<ProgressCallback>,
    pub log: Option<LogCallback>,
    pub device: *const c_char,
    pub reuse_margin: f64,
}

impl Default for impinge_settings {
    fn default() -> Self {
        impinge_settings {
            size: size_of::<Self>() as u32,
            backend: 0,
            method: 0,
            threads: 0,
            memory_budget: 0,
            max_pairs: 0,
            cancelled: None,
            user: std::ptr::null_mut(),
            progress: None,
            log: None,
            device: std::ptr::null(),
            reuse_margin: 0.0,
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct impinge_pair {
    pub body_a: u32,
    pub element_a: u32,
    pub body_b: u32,
    pub element_b: u32,
}

impl From<[u32; 4]> for impinge_pair {
    fn from([body_a, element_a, body_b, element_b]: [u32; 4]) -> Self {
        impinge_pair {
            body_a,
            element_a,
            body_b,
            element_b,
        }
    }
}

impl impinge_pair {
    pub fn row(self) -> [u32; 4] {
        [self.body_a, self.element_a, self.body_b, self.element_b]
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct impinge_impact {
    pub toi: f64,
    pub kind: u32,
    pub body_a: u32,
    pub element_a: u32,
    pub body_b: u32,
    pub element_b: u32,
    pub at_start: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_nearest {
    pub distance: f64,
    pub points: [[f64; 3]; 2],
    pub body_a: u32,
    pub element_a: u32,
    pub body_b: u32,
    pub element_b: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_closest_element {
    pub distance: f64,
    pub point: [f64; 3],
    pub body: u32,
    pub element: u32,
    pub feature: u32,
    pub found: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_ray_hit {
    pub t: f64,
    pub t_end: f64,
    pub barycentrics: [f64; 3],
    pub ray: u64,
    pub body: u32,
    pub element: u32,
    pub feature: u32,
    /// So that rows have no gaps.
    pub reserved: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_device {
    pub name: *const c_char,
    pub interface_name: *const c_char,
    pub driver: *const c_char,
    pub max_binding: u64,
    pub is_software: u32,
    /// So that rows have no gaps.
    pub reserved: u32,
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_region {
    pub position: [f64; 3],
    pub bounds: [[f64; 3]; 2],
    pub length: f64,
    pub patch_area: f64,
    pub area: [f64; 3],
    pub normal: [f64; 3],
    pub depth: f64,
    pub volume: f64,
    pub body_a: u32,
    pub body_b: u32,
    pub n_contacts: u64,
    pub n_inside: [u64; 2],
}

#[repr(C)]
#[derive(Clone, Copy)]
pub struct impinge_stats {
    pub size: u32,
    pub n_threads: u32,
    pub total_ms: f64,
    pub n_candidates: u64,
    pub n_unsure: u64,
    pub n_work_items: u64,
    pub n_clusters: u64,
    pub n_culled: u64,
    pub n_clustered: u64,
    pub n_batches: u64,
    pub n_reruns: u64,
    pub bytes_held: u64,
    pub backend: *const c_char,
    pub method: *const c_char,
}
