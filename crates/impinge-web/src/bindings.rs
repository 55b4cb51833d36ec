//! The functions that JavaScript calls. `web/package` wraps them; their names are private to the package.

use impinge::{Backend, Detector, PairKind, Positions, Settings, Statistics};
use js_sys::{Array, Float32Array, Float64Array, Object, Reflect, Uint8Array, Uint32Array};
use wasm_bindgen::prelude::*;

use crate::error::Error;
use crate::step::{FlatImpacts, StepOptions};
use crate::world::{Asked, World, welded};

fn thrown(error: Error) -> JsError {
    JsError::new(&error.to_string())
}

/// A world, and the hash and the statistics of its last answer.
#[wasm_bindgen]
pub struct Engine {
    world: World,
    hash: u64,
    statistics: Object,
}

#[wasm_bindgen]
impl Engine {
    /// An engine on the CPU.
    #[wasm_bindgen(constructor)]
    pub fn new(method: &str, shared_vertex: &str) -> Result<Engine, JsError> {
        let settings = Settings {
            backend: Backend::Cpu,
            ..World::settings(method).map_err(thrown)?
        };
        Engine::of(Detector::with_settings(settings)?, shared_vertex)
    }

    /// An engine on the browser's WebGPU device. Software devices are allowed.
    #[cfg(feature = "gpu")]
    pub async fn webgpu(method: String, shared_vertex: String) -> Result<Engine, JsError> {
        let settings = Settings {
            backend: Backend::Gpu,
            ..World::settings(&method).map_err(thrown)?
        };
        let detector = Detector::with_settings_async(settings).await?;
        Engine::of(detector, &shared_vertex)
    }

    fn of(detector: Detector, shared_vertex: &str) -> Result<Engine, JsError> {
        Ok(Engine {
            world: World::new(detector, shared_vertex).map_err(thrown)?,
            hash: 0,
            statistics: Object::new(),
        })
    }

    /// Adds a body in single precision; see [`World::add`].
    pub fn add_f32(
        &mut self,
        index: &[u32],
        positions: &[f32],
        corners: usize,
    ) -> Result<u32, JsError> {
        self.world.add(index, positions, corners).map_err(thrown)
    }

    /// Adds a body in double precision; see [`World::add`].
    pub fn add_f64(
        &mut self,
        index: &[u32],
        positions: &[f64],
        corners: usize,
    ) -> Result<u32, JsError> {
        self.world.add(index, positions, corners).map_err(thrown)
    }

    /// See [`World::set_positions`].
    pub fn set_positions_f32(&mut self, body: u32, positions: &[f32]) -> Result<(), JsError> {
        self.world.set_positions(body, positions).map_err(thrown)
    }

    /// See [`World::set_positions`].
    pub fn set_positions_f64(&mut self, body: u32, positions: &[f64]) -> Result<(), JsError> {
        self.world.set_positions(body, positions).map_err(thrown)
    }

    /// See [`World::set_end_positions`].
    pub fn set_end_positions_f32(&mut self, body: u32, positions: &[f32]) -> Result<(), JsError> {
        let set = self.world.set_end_positions(body, positions);
        set.map_err(thrown)
    }

    /// See [`World::set_end_positions`].
    pub fn set_end_positions_f64(&mut self, body: u32, positions: &[f64]) -> Result<(), JsError> {
        let set = self.world.set_end_positions(body, positions);
        set.map_err(thrown)
    }

    /// See [`World::remove`].
    pub fn remove(&mut self, body: u32) -> Result<(), JsError> {
        self.world.remove(body).map_err(thrown)
    }

    /// The numbers of primitives and of vertices of a body.
    pub fn size(&self, body: u32) -> Result<Vec<u32>, JsError> {
        let (n_primitives, n_vertices) = self.world.size(body).map_err(thrown)?;
        // The library refuses bodies with more than 32 bits can count.
        Ok(vec![n_primitives as u32, n_vertices as u32])
    }

    /// See [`World::detect`]; `bodies` and `with_self` as in [`Asked::of`].
    pub fn detect(&mut self, bodies: &[u32], with_self: bool) -> Result<Vec<u32>, JsError> {
        let asked = Asked::of(bodies, with_self).map_err(thrown)?;
        let (numbers, pairs) = self.world.detect(asked).map_err(thrown)?;
        self.hash = pairs.hash();
        self.statistics = statistics(pairs.stats())?;
        Ok(numbers)
    }

    /// [`detect`](Engine::detect) without blocking.
    #[cfg(feature = "gpu")]
    pub async fn detect_async(
        &mut self,
        bodies: Vec<u32>,
        with_self: bool,
    ) -> Result<Vec<u32>, JsError> {
        let asked = Asked::of(&bodies, with_self).map_err(thrown)?;
        let (numbers, pairs) = self.world.detect_async(asked).await.map_err(thrown)?;
        self.hash = pairs.hash();
        self.statistics = statistics(pairs.stats())?;
        Ok(numbers)
    }

    /// See [`World::impacts`]: `[kinds, rows, times, at_start]`.
    pub fn impacts(&mut self, step: StepQuestion) -> Result<Array, JsError> {
        let (impacts, hash) = self
            .world
            .impacts(step.asked, step.options)
            .map_err(thrown)?;
        self.hash = hash;
        self.statistics = statistics(self.world.step_stats())?;
        Ok(arrays(&impacts))
    }

    /// See [`World::earliest`]: `[kinds, rows, times, at_start]`. The hash stays that of the answer before.
    pub fn earliest(&mut self, step: StepQuestion) -> Result<Array, JsError> {
        let earliest = self
            .world
            .earliest(step.asked, step.options)
            .map_err(thrown)?;
        self.statistics = statistics(self.world.step_stats())?;
        Ok(arrays(&earliest))
    }

    /// See [`World::is_free`].
    pub fn is_free(&mut self, step: StepQuestion) -> Result<bool, JsError> {
        let is_free = self
            .world
            .is_free(step.asked, step.options)
            .map_err(thrown)?;
        self.statistics = statistics(self.world.step_stats())?;
        Ok(is_free)
    }

    /// See [`World::advance`]: `[fraction, n_tried, first, bodies, positions]`.
    pub fn advance(&mut self, step: StepQuestion) -> Result<Array, JsError> {
        let answer = self.world.advance(step.asked, step.options);
        let (advance, first, moving) = answer.map_err(thrown)?;
        self.statistics = statistics(self.world.step_stats())?;
        let reached = advance.positions.iter().map(|(_, rows)| match rows {
            Positions::F32(rows) => JsValue::from(Float32Array::from(rows.as_flattened())),
            Positions::F64(rows) => Float64Array::from(rows.as_flattened()).into(),
        });
        Ok(Array::of5(
            &JsValue::from_f64(advance.fraction),
            &JsValue::from_f64(f64::from(advance.n_tried)),
            &arrays(&first),
            &Uint32Array::from(&moving[..]),
            &reached.collect::<Array>(),
        ))
    }

    /// See [`World::start_intersects`].
    pub fn start_intersects(&self) -> Option<bool> {
        self.world.start_intersects()
    }

    /// The hash of the last answer, 16 hexadecimal digits.
    pub fn hash(&self) -> String {
        format!("{:016x}", self.hash)
    }

    /// Statistics of the last answer.
    pub fn statistics(&self) -> Object {
        self.statistics.clone()
    }
}

/// A question about a step.
#[wasm_bindgen]
pub struct StepQuestion {
    asked: Asked,
    options: StepOptions,
}

#[wasm_bindgen]
impl StepQuestion {
    /// `bodies` and `with_self` as in [`Asked::of`]; the rest as in [`StepOptions::new`].
    #[wasm_bindgen(constructor)]
    pub fn new(
        bodies: &[u32],
        with_self: bool,
        start: &str,
        toi: &str,
        separation: f64,
        clearance: f64,
        clearance_share: f64,
    ) -> Result<StepQuestion, JsError> {
        let distances = [separation, clearance, clearance_share];
        Ok(StepQuestion {
            asked: Asked::of(bodies, with_self).map_err(thrown)?,
            options: StepOptions::new(start, toi, distances).map_err(thrown)?,
        })
    }
}

/// The names of the kinds that impacts refer to by number.
#[wasm_bindgen]
pub fn kind_names() -> Vec<String> {
    PairKind::ALL.map(|kind| kind.name().to_owned()).into()
}

/// Welds vertices at the same position: for each vertex, its number after the welding.
#[wasm_bindgen]
pub fn weld_f32(positions: &[f32]) -> Result<Vec<u32>, JsError> {
    welded(positions).map_err(thrown)
}

/// [`weld_f32`] in double precision.
#[wasm_bindgen]
pub fn weld_f64(positions: &[f64]) -> Result<Vec<u32>, JsError> {
    welded(positions).map_err(thrown)
}

fn arrays(impacts: &FlatImpacts) -> Array {
    Array::of4(
        &Uint8Array::from(&impacts.kinds[..]),
        &Uint32Array::from(&impacts.rows[..]),
        &Float64Array::from(&impacts.times[..]),
        &Uint8Array::from(&impacts.at_start[..]),
    )
}

/// Statistics as an object of JavaScript.
fn statistics(stats: &Statistics) -> Result<Object, JsError> {
    let put = |object: &Object, name: &str, value: JsValue| {
        Reflect::set(object, &JsValue::from_str(name), &value)
            .map(|_| ())
            .map_err(|_| JsError::new("statistics cannot be written"))
    };
    // Counts stay far below 2^53.
    let count = |n: u64| JsValue::from_f64(n as f64);
    let object = Object::new();
    put(&object, "backend", JsValue::from_str(&stats.backend))?;
    put(&object, "method", JsValue::from_str(stats.method))?;
    put(&object, "candidates", count(stats.n_candidates))?;
    put(&object, "unsure", count(stats.n_unsure))?;
    put(&object, "clusters", count(stats.n_clusters))?;
    put(&object, "bytesHeld", count(stats.bytes_held))?;
    put(&object, "totalMs", JsValue::from_f64(stats.total_ms))?;
    let stages = Object::new();
    for stage in &stats.stages {
        put(&stages, stage.name, JsValue::from_f64(stage.ms))?;
    }
    put(&object, "stages", stages.into())?;
    Ok(object)
}

/// A mesh that was read from a file.
#[cfg(feature = "io")]
#[wasm_bindgen]
pub struct MeshFile(crate::meshes::FileMesh);

#[cfg(feature = "io")]
#[wasm_bindgen]
impl MeshFile {
    /// Reads the bytes of a file. The extension of its name is that of its format.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str, bytes: &[u8], weld: bool) -> Result<MeshFile, JsError> {
        let mesh = crate::meshes::read(name, bytes, weld);
        mesh.map(MeshFile).map_err(thrown)
    }

    /// Reads the bodies of a file: nodes of glTF, objects or groups of OBJ.
    pub fn bodies(name: &str, bytes: &[u8], weld: bool) -> Result<Vec<MeshFile>, JsError> {
        let bodies = crate::meshes::read_bodies(name, bytes, weld).map_err(thrown)?;
        Ok(bodies.into_iter().map(MeshFile).collect())
    }

    /// The name of the file, or of a node or a group in it.
    pub fn name(&self) -> String {
        self.0.name.clone()
    }

    /// Vertex numbers, [`corners`](MeshFile::corners) per primitive.
    pub fn index(&self) -> Vec<u32> {
        self.0.index.clone()
    }

    /// x, y, z per vertex, as a `Float32Array` if the file is in single precision, else as a `Float64Array`.
    pub fn positions(&self) -> JsValue {
        coordinates(&self.0.positions)
    }

    /// For each vertex of the file, its number in the mesh.
    pub fn map(&self) -> Vec<u32> {
        self.0.map.clone()
    }

    /// 3 for triangles, 4 for tetrahedra.
    pub fn corners(&self) -> u32 {
        self.0.corners
    }
}

/// The frames of a point cache; see [`read_frames`](crate::meshes::read_frames).
#[cfg(feature = "io")]
#[wasm_bindgen]
pub fn read_frames(name: &str, bytes: Vec<u8>) -> Result<Array, JsError> {
    let frames = crate::meshes::read_frames(name, bytes).map_err(thrown)?;
    Ok(frames.iter().map(coordinates).collect())
}

#[cfg(feature = "io")]
fn coordinates(positions: &impinge_io::Positions) -> JsValue {
    use impinge_io::Positions;
    match positions {
        Positions::F32(rows) => Float32Array::from(rows.as_flattened()).into(),
        Positions::F64(rows) => Float64Array::from(rows.as_flattened()).into(),
    }
}
