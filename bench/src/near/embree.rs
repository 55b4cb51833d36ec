//! Embree 3 as a peer: `rtcPointQuery` with each vertex, and in its callback the plain distance of
//! a point and a triangle.
//!
//! Embree compares boxes with a sphere, so it gives a few faces more than are near.

use std::ffi::c_void;

use rayon::prelude::*;

use super::{Mesh, Peer, Row};
use crate::Failure;
use crate::embree::Handles;
use crate::embree::ffi;
use crate::plain::{Point, square_of_point_and_triangle};

/// Vertices per task.
const TASK: usize = 256;

/// Embree set up for a mesh.
pub struct Points {
    handles: Handles,
    /// Padded to 16 bytes, as Embree reads them.
    positions: Vec<[f32; 4]>,
    faces: Vec<[u32; 3]>,
    is_refitted: bool,
    pool: rayon::ThreadPool,
    rows: Vec<Row>,
}

impl Points {
    /// With a tree that is rebuilt, or refitted, in each frame.
    pub fn new(mesh: &Mesh<'_>, is_refitted: bool, n_threads: usize) -> Result<Self, Failure> {
        let quality = match is_refitted {
            true => ffi::QUALITY_REFIT,
            false => ffi::QUALITY_LOW,
        };
        let positions: Vec<_> = mesh
            .positions
            .iter()
            .map(|&[x, y, z]| [x, y, z, 0.0])
            .collect();
        let faces = mesh.faces.to_vec();
        let mut handles = Handles::new(n_threads)?;
        // SAFETY: plain calls of the C interface with live handles. Both buffers keep their place
        // and length as long as the geometry lives: they are released after it.
        unsafe {
            let scene = ffi::rtcNewScene(handles.device);
            handles.scenes.push(scene);
            ffi::rtcSetSceneBuildQuality(scene, ffi::QUALITY_LOW);
            ffi::rtcSetSceneFlags(scene, ffi::SCENE_DYNAMIC);
            let geometry = ffi::rtcNewGeometry(handles.device, ffi::GEOMETRY_TRIANGLE);
            handles.geometries.push(geometry);
            ffi::rtcSetGeometryBuildQuality(geometry, quality);
            let vertices = positions.as_ptr().cast::<c_void>();
            let (stride, n) = (size_of::<[f32; 4]>(), positions.len());
            let (vertex, float3) = (ffi::BUFFER_VERTEX, ffi::FORMAT_FLOAT3);
            ffi::rtcSetSharedGeometryBuffer(geometry, vertex, 0, float3, vertices, 0, stride, n);
            let corners = faces.as_ptr().cast::<c_void>();
            let (stride, n) = (size_of::<[u32; 3]>(), faces.len());
            let (index, uint3) = (ffi::BUFFER_INDEX, ffi::FORMAT_UINT3);
            ffi::rtcSetSharedGeometryBuffer(geometry, index, 0, uint3, corners, 0, stride, n);
            ffi::rtcCommitGeometry(geometry);
            ffi::rtcAttachGeometry(scene, geometry);
            ffi::rtcCommitScene(scene);
        }
        handles.check("setting up")?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n_threads)
            .build()?;
        Ok(Points {
            handles,
            positions,
            faces,
            is_refitted,
            pool,
            rows: Vec::new(),
        })
    }
}

/// What the callback needs, and where rows go.
struct Query<'a> {
    positions: &'a [[f32; 4]],
    faces: &'a [[u32; 3]],
    vertex: u32,
    point: Point,
    square: f64,
    rows: Vec<Row>,
}

fn point([x, y, z, _]: [f32; 4]) -> Point {
    [x, y, z].map(f64::from)
}

unsafe extern "C" fn meets(arguments: *mut ffi::PointQueryArguments) -> bool {
    // SAFETY: Embree passes valid arguments, and as `user` the `Query` that `find` passes and uses
    // nowhere else meanwhile.
    let (query, face) = unsafe {
        let arguments = &*arguments;
        (
            &mut *arguments.user.cast::<Query<'_>>(),
            arguments.primitive,
        )
    };
    let corners = query.faces[face as usize];
    if !corners.contains(&query.vertex) {
        let triangle = corners.map(|corner| point(query.positions[corner as usize]));
        if square_of_point_and_triangle(query.point, triangle) <= query.square {
            query.rows.push([query.vertex, face]);
        }
    }
    // The radius stays.
    false
}

/// The scene, shared by threads that only ask.
#[derive(Clone, Copy)]
struct Shared(ffi::Scene);

// SAFETY: Embree allows queries of a committed scene from several threads.
unsafe impl Send for Shared {}
// SAFETY: see above.
unsafe impl Sync for Shared {}

impl Shared {
    fn ask(self, query: &mut Query<'_>, radius: f32) {
        let [x, y, z, _] = query.positions[query.vertex as usize];
        let mut at = ffi::PointQuery {
            position: [x, y, z],
            time: 0.0,
            radius,
        };
        let mut context = ffi::PointQueryContext {
            world_to_instance: [0.0; 16],
            instance_to_world: [0.0; 16],
            instance: ffi::NO_GEOMETRY,
            n_instances: 0,
        };
        let user = std::ptr::from_mut(query).cast();
        // SAFETY: the scene is committed; the query and the context are valid and not used
        // meanwhile.
        unsafe { ffi::rtcPointQuery(self.0, &mut at, &mut context, Some(meets), user) };
    }
}

impl Peer for Points {
    fn name(&self) -> String {
        let tree = match self.is_refitted {
            true => "refitted",
            false => "rebuilt",
        };
        format!("Embree 3, `rtcPointQuery`, {tree}")
    }

    fn write(&mut self, positions: &[[f32; 3]]) {
        for (to, &[x, y, z]) in self.positions.iter_mut().zip(positions) {
            *to = [x, y, z, 0.0];
        }
    }

    fn find(&mut self, distance: f64) -> Result<&[Row], Failure> {
        let (scene, geometry) = (self.handles.scenes[0], self.handles.geometries[0]);
        // SAFETY: the handles are alive, and nobody asks meanwhile.
        unsafe {
            ffi::rtcUpdateGeometryBuffer(geometry, ffi::BUFFER_VERTEX, 0);
            ffi::rtcCommitGeometry(geometry);
            ffi::rtcCommitScene(scene);
        }
        self.handles.check("a commit")?;
        // Boxes are compared in single precision; a larger radius loses nothing.
        let radius = (distance * (1.0 + 1e-5)) as f32;
        let (positions, faces, scene) = (&self.positions, &self.faces, Shared(scene));
        let n_tasks = positions.len().div_ceil(TASK);
        let lists: Vec<Vec<Row>> = self.pool.install(|| {
            let tasks = (0..n_tasks).into_par_iter();
            tasks
                .map(|task| {
                    let mut query = Query {
                        positions,
                        faces,
                        vertex: 0,
                        point: [0.0; 3],
                        square: distance * distance,
                        rows: Vec::new(),
                    };
                    let vertices = positions.iter().enumerate();
                    for (vertex, &position) in vertices.skip(task * TASK).take(TASK) {
                        query.vertex = vertex as u32;
                        query.point = point(position);
                        scene.ask(&mut query, radius);
                    }
                    query.rows
                })
                .collect()
        });
        self.rows.clear();
        self.rows.extend(lists.into_iter().flatten());
        Ok(&self.rows)
    }
}
