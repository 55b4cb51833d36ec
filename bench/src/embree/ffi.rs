//! The few declarations of Embree 3 (`rtcore.h`, version 3.13) that are needed here.

use std::ffi::{c_char, c_int, c_uint, c_void};

pub type Device = *mut c_void;
pub type Scene = *mut c_void;
pub type Geometry = *mut c_void;

/// `RTC_GEOMETRY_TYPE_USER`
pub const GEOMETRY_USER: c_int = 120;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`
pub const GEOMETRY_TRIANGLE: c_int = 0;
/// `RTC_INVALID_GEOMETRY_ID`
pub const NO_GEOMETRY: c_uint = c_uint::MAX;

/// `enum RTCBufferType`
pub const BUFFER_INDEX: c_int = 0;
pub const BUFFER_VERTEX: c_int = 1;

/// `enum RTCFormat`
pub const FORMAT_UINT3: c_int = 0x5003;
pub const FORMAT_FLOAT3: c_int = 0x9003;

/// `enum RTCBuildQuality`
pub const QUALITY_LOW: c_int = 0;
pub const QUALITY_MEDIUM: c_int = 1;
pub const QUALITY_REFIT: c_int = 3;

/// `enum RTCSceneFlags`
pub const SCENE_NONE: c_int = 0;
pub const SCENE_DYNAMIC: c_int = 1;
pub const SCENE_COMPACT: c_int = 2;
pub const SCENE_ROBUST: c_int = 4;

/// `struct RTCBounds`
#[repr(C, align(16))]
pub struct Bounds {
    /// Lower x, y, z, and a lane of padding.
    pub min: [f32; 4],
    /// Upper x, y, z, and a lane of padding.
    pub max: [f32; 4],
}

/// `struct RTCBoundsFunctionArguments`
#[repr(C)]
pub struct BoundsArguments {
    pub user: *mut c_void,
    pub primitive: c_uint,
    pub time_step: c_uint,
    pub bounds: *mut Bounds,
}

/// `struct RTCCollision`
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Collision {
    pub geometry0: c_uint,
    pub primitive0: c_uint,
    pub geometry1: c_uint,
    pub primitive1: c_uint,
}

/// `struct RTCPointQuery`
#[repr(C, align(16))]
pub struct PointQuery {
    pub position: [f32; 3],
    pub time: f32,
    pub radius: f32,
}

/// `struct RTCPointQueryContext`, for one level of instances
#[repr(C, align(16))]
pub struct PointQueryContext {
    pub world_to_instance: [f32; 16],
    pub instance_to_world: [f32; 16],
    pub instance: c_uint,
    pub n_instances: c_uint,
}

/// `struct RTCPointQueryFunctionArguments`
#[repr(C, align(16))]
pub struct PointQueryArguments {
    pub query: *mut PointQuery,
    pub user: *mut c_void,
    pub primitive: c_uint,
    pub geometry: c_uint,
    pub context: *mut PointQueryContext,
    pub similarity_scale: f32,
}

/// `RTCPointQueryFunction`
pub type PointQueryFunction = unsafe extern "C" fn(*mut PointQueryArguments) -> bool;
/// `RTCBoundsFunction`
pub type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);
/// `RTCCollideFunc`
pub type CollideFunction = unsafe extern "C" fn(*mut c_void, *mut Collision, c_uint);

#[link(name = "embree3")]
unsafe extern "C" {
    pub fn rtcNewDevice(config: *const c_char) -> Device;
    pub fn rtcReleaseDevice(device: Device);
    pub fn rtcGetDeviceError(device: Device) -> c_int;
    pub fn rtcNewScene(device: Device) -> Scene;
    pub fn rtcReleaseScene(scene: Scene);
    pub fn rtcSetSceneBuildQuality(scene: Scene, quality: c_int);
    pub fn rtcSetSceneFlags(scene: Scene, flags: c_int);
    pub fn rtcCommitScene(scene: Scene);
    pub fn rtcAttachGeometry(scene: Scene, geometry: Geometry) -> c_uint;
    pub fn rtcCollide(scene0: Scene, scene1: Scene, callback: CollideFunction, user: *mut c_void);
    pub fn rtcNewGeometry(device: Device, kind: c_int) -> Geometry;
    pub fn rtcReleaseGeometry(geometry: Geometry);
    pub fn rtcSetGeometryBuildQuality(geometry: Geometry, quality: c_int);
    pub fn rtcSetGeometryUserPrimitiveCount(geometry: Geometry, count: c_uint);
    pub fn rtcSetGeometryUserData(geometry: Geometry, user: *mut c_void);
    pub fn rtcSetGeometryBoundsFunction(
        geometry: Geometry,
        bounds: BoundsFunction,
        user: *mut c_void,
    );
    pub fn rtcCommitGeometry(geometry: Geometry);
    pub fn rtcSetSharedGeometryBuffer(
        geometry: Geometry,
        kind: c_int,
        slot: c_uint,
        format: c_int,
        data: *const c_void,
        offset: usize,
        stride: usize,
        count: usize,
    );
    pub fn rtcUpdateGeometryBuffer(geometry: Geometry, kind: c_int, slot: c_uint);
    pub fn rtcPointQuery(
        scene: Scene,
        query: *mut PointQuery,
        context: *mut PointQueryContext,
        function: Option<PointQueryFunction>,
        user: *mut c_void,
    ) -> bool;
}
