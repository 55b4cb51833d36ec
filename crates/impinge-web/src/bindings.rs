//! The functions that JavaScript calls. `js` wraps them; their names are private to the
//! package.
//!
//! An error is thrown as a string: its code, a line break, its text.

use std::cell::RefCell;

use impinge::{
    Backend, BodyKind, CancelToken, Control, Method, Part, Positions, Real, Recluster, Settings,
    Stats,
};
use js_sys::{Array, Float32Array, Float64Array, Function, Uint8Array, Uint32Array};
use wasm_bindgen::prelude::*;

use crate::answer::Answer;
use crate::ask::{Asker, Question};
use crate::error::Error;
use crate::world::{Put, World, welded};

type Thrown<T> = Result<T, JsValue>;

fn thrown(error: impl Into<Error>) -> JsValue {
    let error = error.into();
    JsValue::from_str(&format!("{}\n{error}", error.code()))
}

/// An entry of a list by the number that the package has for it.
fn entry<T: Copy, const N: usize>(list: [T; N], number: u32) -> Thrown<T> {
    let found = list.get(number as usize).copied();
    found.ok_or_else(|| thrown(Error::Foreign))
}

thread_local! {
    /// `(watcher, done, total)`: whether to stop the question that this watcher watches.
    static WATCH: RefCell<Option<Function>> = const { RefCell::new(None) };
}

/// Sets the function that looks at questions while they are answered.
#[wasm_bindgen]
pub fn set_watch(watch: Function) {
    WATCH.set(Some(watch));
}

/// What a question with this watcher heeds; nothing if it is 0.
fn control(watcher: u32) -> Control {
    if watcher == 0 {
        return Control::new();
    }
    let stop = CancelToken::new();
    let stopped = stop.clone();
    Control::new().cancel(&stop).progress(move |at| {
        let stops = WATCH.with_borrow(|watch| {
            let (done, total) = (
                JsValue::from(at.done as f64),
                JsValue::from(at.total as f64),
            );
            let said = watch
                .as_ref()?
                .call3(&JsValue::NULL, &watcher.into(), &done, &total);
            said.ok()
        });
        if stops.is_some_and(|stops| stops.is_truthy()) {
            stopped.cancel();
        }
    })
}

/// A scene.
#[wasm_bindgen]
pub struct SceneHandle(World);

impl SceneHandle {
    fn put<R: Real>(
        &mut self,
        [what, body, kind]: [u32; 3],
        index: &[u32],
        positions: &[R],
    ) -> Thrown<u32>
    where
        Vec<[R; 3]>: Into<Positions>,
    {
        let (what, kind) = (entry(Put::ALL, what)?, entry(BodyKind::ALL, kind)?);
        let put = self.0.put(what, body, kind, index, positions);
        put.map_err(thrown)
    }
}

#[wasm_bindgen]
impl SceneHandle {
    /// An empty scene.
    #[wasm_bindgen(constructor)]
    pub fn new() -> SceneHandle {
        SceneHandle(World::new())
    }

    /// See [`World::put`].
    pub fn put_f32(
        &mut self,
        what: u32,
        body: u32,
        kind: u32,
        index: &[u32],
        positions: &[f32],
    ) -> Thrown<u32> {
        self.put([what, body, kind], index, positions)
    }

    /// See [`World::put`].
    pub fn put_f64(
        &mut self,
        what: u32,
        body: u32,
        kind: u32,
        index: &[u32],
        positions: &[f64],
    ) -> Thrown<u32> {
        self.put([what, body, kind], index, positions)
    }

    /// See [`World::clear_end_positions`].
    pub fn clear_end_positions(&mut self, body: u32) -> Thrown<()> {
        self.0.clear_end_positions(body).map_err(thrown)
    }

    /// See [`World::set_transform`].
    pub fn set_transform(&mut self, body: u32, columns: &[f64]) -> Thrown<()> {
        let columns = columns.try_into().map_err(|_| thrown(Error::Foreign))?;
        self.0.set_transform(body, columns).map_err(thrown)
    }

    /// See [`World::set_end_transform`].
    pub fn set_end_transform(&mut self, body: u32, columns: &[f64]) -> Thrown<()> {
        let columns = columns.try_into().map_err(|_| thrown(Error::Foreign))?;
        self.0.set_end_transform(body, columns).map_err(thrown)
    }

    /// See [`World::set_filter`].
    pub fn set_filter(&mut self, body: u32, category: u64, mask: u64) -> Thrown<()> {
        self.0.set_filter(body, category, mask).map_err(thrown)
    }

    /// See [`World::set_thickness`].
    pub fn set_thickness(&mut self, body: u32, thickness: f64) -> Thrown<()> {
        self.0.set_thickness(body, thickness).map_err(thrown)
    }

    /// See [`World::set_edges`].
    pub fn set_edges(&mut self, body: u32, edges: &[u32]) -> Thrown<()> {
        self.0.set_edges(body, edges).map_err(thrown)
    }

    /// See [`World::set_groups`].
    pub fn set_groups(&mut self, body: u32, groups: &[u32]) -> Thrown<()> {
        self.0.set_groups(body, groups).map_err(thrown)
    }

    /// See [`World::set_pinned`].
    pub fn set_pinned(&mut self, body: u32, pinned: &[u8]) -> Thrown<()> {
        self.0.set_pinned(body, pinned).map_err(thrown)
    }

    /// See [`World::keep_at_rest`].
    pub fn rest_pairs(&mut self, number: u32, distance: f64) -> Thrown<u32> {
        self.0.keep_at_rest(number, distance).map_err(thrown)
    }

    /// See [`World::keep_vertex_pairs`].
    pub fn vertex_pairs(
        &mut self,
        number: u32,
        a: u32,
        b: u32,
        offsets: &[u32],
        vertices: &[u32],
    ) -> Thrown<()> {
        let kept = self.0.keep_vertex_pairs(number, [a, b], offsets, vertices);
        kept.map_err(thrown)
    }

    /// See [`World::forget_pairs`].
    pub fn forget_pairs(&mut self, number: u32) {
        self.0.forget_pairs(number);
    }

    /// See [`World::set_element_thickness`].
    pub fn set_element_thickness(&mut self, body: u32, part: u32, thickness: &[f64]) -> Thrown<()> {
        let set = self.0.set_element_thickness(body, part, thickness);
        set.map_err(thrown)
    }

    /// See [`World::take_step`].
    pub fn take_step(&mut self, start: &[u32], bodies: &[u32], positions: &Array) -> Thrown<()> {
        let positions = positions.iter().map(|given| {
            if let Some(single) = given.dyn_ref::<Float32Array>() {
                return Ok(single.to_vec().as_chunks().0.to_vec().into());
            }
            let double = given.dyn_ref::<Float64Array>();
            let double = double.ok_or_else(|| thrown(Error::Foreign))?;
            Ok(double.to_vec().as_chunks().0.to_vec().into())
        });
        let positions = positions.collect::<Thrown<Vec<Positions>>>()?;
        let taken = self.0.take_step(start, bodies, positions);
        taken.map_err(thrown)
    }

    /// See [`World::remove`].
    pub fn remove(&mut self, body: u32) -> Thrown<()> {
        self.0.remove(body).map_err(thrown)
    }

    /// The number of corners of the elements of a body, of its elements, of its vertices.
    pub fn size(&self, body: u32) -> Thrown<Vec<u32>> {
        let body = self.0.body(body).map_err(thrown)?;
        let corners = body.kind().n_corners();
        // The library refuses bodies with more than 32 bits can count.
        let numbers = [corners, body.elements().len(), body.n_vertices()];
        Ok(numbers.map(|n| n as u32).to_vec())
    }

    /// The vertices of the elements of a part: 0 as given, 1 edges, 2 faces.
    pub fn index(&self, body: u32, part: u32) -> Thrown<Vec<u32>> {
        let part = entry([Part::Given, Part::Edges, Part::Faces], part)?;
        self.0.index(body, part).map_err(thrown)
    }

    /// The positions of a body: 0 now, 1 at the end of the step (`undefined` if it stands still), 2
    /// at rest.
    pub fn positions(&self, body: u32, which: u32) -> Thrown<JsValue> {
        let body = self.0.body(body).map_err(thrown)?;
        Ok(match which {
            0 => coordinates(body.positions()),
            1 => body.end_positions().map_or(JsValue::UNDEFINED, coordinates),
            _ => coordinates(body.rest_positions()),
        })
    }

    /// The numbers of all bodies.
    pub fn bodies(&self) -> Vec<u32> {
        self.0.bodies()
    }

    /// The scene as it is now, for a question that is answered later.
    #[cfg(feature = "gpu")]
    pub fn snapshot(&self) -> SceneHandle {
        SceneHandle(self.0.clone())
    }
}

fn coordinates(positions: &Positions) -> JsValue {
    match positions {
        Positions::F32(rows) => Float32Array::from(rows.as_flattened()).into(),
        Positions::F64(rows) => Float64Array::from(rows.as_flattened()).into(),
    }
}

/// A detector. One on a device asks it which elements intersect; all else is answered on the CPU.
#[wasm_bindgen]
pub struct DetectorHandle {
    asker: Asker,
    #[cfg(feature = "gpu")]
    device: Option<impinge::Detector>,
}

/// The method and the rule of new clusterings by their number; the memory budget and the most
/// pairs, -1 for none, and the margin of lists.
fn settings(
    backend: Backend,
    [method, recluster]: [u32; 2],
    [memory_budget, max_pairs, reuse_margin]: [f64; 3],
) -> Thrown<Settings> {
    let limit = |limit: f64| (limit >= 0.0).then_some(limit as u64);
    Ok(Settings::new()
        .backend(backend)
        .method(entry(Method::ALL, method)?)
        .recluster(entry([Recluster::Auto, Recluster::Never], recluster)?)
        .memory_budget(limit(memory_budget))
        .max_pairs(limit(max_pairs))
        .reuse_margin(reuse_margin))
}

#[wasm_bindgen]
impl DetectorHandle {
    /// A detector on the CPU; arguments as in [`settings`].
    #[wasm_bindgen(constructor)]
    pub fn new(
        method: u32,
        recluster: u32,
        memory_budget: f64,
        max_pairs: f64,
        reuse_margin: f64,
    ) -> Thrown<DetectorHandle> {
        let settings = settings(
            Backend::Cpu,
            [method, recluster],
            [memory_budget, max_pairs, reuse_margin],
        )?;
        Ok(DetectorHandle {
            asker: Asker::new(settings).map_err(thrown)?,
            #[cfg(feature = "gpu")]
            device: None,
        })
    }

    /// A detector on the browser's WebGPU device. Software devices are allowed.
    #[cfg(feature = "gpu")]
    pub async fn open(
        method: u32,
        recluster: u32,
        memory_budget: f64,
        max_pairs: f64,
        reuse_margin: f64,
    ) -> Thrown<DetectorHandle> {
        let words = [method, recluster];
        let limits = [memory_budget, max_pairs, reuse_margin];
        let on_device = settings(Backend::Gpu, words, limits)?;
        let device = impinge::Detector::open(on_device).await.map_err(thrown)?;
        let on_cpu = settings(Backend::Cpu, words, limits)?;
        Ok(DetectorHandle {
            asker: Asker::new(on_cpu).map_err(thrown)?,
            device: Some(device),
        })
    }

    /// See [`Asker::ask`]: `[rows, bytes, numbers, words, positions, hash]`.
    pub fn ask(
        &mut self,
        question: u32,
        scene: &SceneHandle,
        watcher: u32,
        words: &[u32],
        numbers: &[f64],
    ) -> Thrown<Array> {
        let question = entry(Question::ALL, question)?;
        self.asker.set_control(control(watcher));
        let answer = self.asker.ask(question, &scene.0, words, numbers);
        answer.map(|answer| lists(&answer)).map_err(thrown)
    }

    /// See [`Asker::candidates_in_runs`]. `each` gets the lists of each run, and stops the search
    /// with `false` or with what it throws, which is thrown here.
    pub fn candidates_in_runs(
        &mut self,
        scene: &SceneHandle,
        watcher: u32,
        words: &[u32],
        numbers: &[f64],
        most: f64,
        each: &Function,
    ) -> Thrown<f64> {
        self.asker.set_control(control(watcher));
        let mut failure = None;
        let hand_out = |run: Answer| match each.call1(&JsValue::NULL, &lists(&run)) {
            Ok(said) => said != JsValue::FALSE,
            Err(error) => {
                failure = Some(error);
                false
            }
        };
        let asked = (words, numbers);
        let n = self
            .asker
            .candidates_in_runs(&scene.0, asked, most as u64, hand_out);
        match failure {
            Some(error) => Err(error),
            None => n.map_err(thrown),
        }
    }

    /// Which elements intersect, found on the device.
    #[cfg(feature = "gpu")]
    pub async fn detect(
        &mut self,
        scene: SceneHandle,
        watcher: u32,
        words: Vec<u32>,
        numbers: Vec<f64>,
    ) -> Thrown<Array> {
        let numbers = &numbers[..].try_into().map_err(|_| thrown(Error::Foreign))?;
        let query = crate::ask::query(&scene.0, &words, numbers).map_err(thrown)?;
        let device = self.device.as_mut().ok_or_else(|| thrown(Error::Foreign))?;
        device.set_control(control(watcher));
        let mut device = device.gpu().ok_or_else(|| thrown(Error::Foreign))?;
        let pairs = device.detect_async(&scene.0.scene, &query).await;
        let pairs = pairs.map_err(thrown)?;
        Ok(lists(&crate::answer::of_pairs(&pairs, &scene.0)))
    }

    /// How the last question was answered, on the device or on the CPU: texts and numbers.
    pub fn stats(&self, on_device: bool) -> Array {
        #[cfg(feature = "gpu")]
        if let (true, Some(device)) = (on_device, &self.device) {
            return measured(device.stats());
        }
        let _ = on_device;
        measured(self.asker.stats())
    }
}

fn lists(answer: &Answer) -> Array {
    let positions: Array = answer.positions.iter().map(coordinates).collect();
    let lists: [JsValue; 6] = [
        Uint32Array::from(&answer.rows[..]).into(),
        Uint8Array::from(&answer.bytes[..]).into(),
        Float64Array::from(&answer.numbers[..]).into(),
        Uint32Array::from(&answer.words[..]).into(),
        positions.into(),
        answer.hash.into(),
    ];
    lists.iter().collect()
}

/// `[backend, method, stage…]` and numbers: total, counts, and the time of each stage.
fn measured(stats: &Stats) -> Array {
    let texts = [&stats.backend[..], stats.method].into_iter();
    let texts = texts.chain(stats.stages.iter().map(|stage| stage.name));
    // Counts stay far below 2^53.
    let counts = stats.counts().map(|(_, n)| n as f64);
    let numbers = std::iter::once(stats.total_ms).chain(counts);
    let numbers: Vec<f64> = numbers
        .chain(stats.stages.iter().map(|stage| stage.ms))
        .collect();
    Array::of2(
        &texts.map(JsValue::from_str).collect::<Array>(),
        &Float64Array::from(&numbers[..]),
    )
}

/// Welds vertices at the same position: for each vertex, its number after the welding.
#[wasm_bindgen]
pub fn weld_f32(positions: &[f32]) -> Thrown<Vec<u32>> {
    welded(positions).map_err(thrown)
}

/// [`weld_f32`] in double precision.
#[wasm_bindgen]
pub fn weld_f64(positions: &[f64]) -> Thrown<Vec<u32>> {
    welded(positions).map_err(thrown)
}

/// The mesh of a file, or with `in_bodies` each body in it:
/// `[name, corners, index, positions, map, notes]`.
#[cfg(feature = "io")]
#[wasm_bindgen]
pub fn read(name: &str, bytes: &[u8], weld: bool, in_bodies: bool) -> Thrown<Array> {
    let meshes = match in_bodies {
        true => crate::meshes::read_bodies(name, bytes, weld),
        false => crate::meshes::read(name, bytes, weld).map(|mesh| vec![mesh]),
    };
    let meshes = meshes.map_err(thrown)?;
    let lists = meshes.iter().map(|mesh| {
        let notes: Array = mesh
            .notes
            .iter()
            .map(|note| JsValue::from_str(note))
            .collect();
        let fields: [JsValue; 6] = [
            JsValue::from_str(&mesh.name),
            mesh.corners.into(),
            Uint32Array::from(&mesh.index[..]).into(),
            read_coordinates(&mesh.positions),
            Uint32Array::from(&mesh.map[..]).into(),
            notes.into(),
        ];
        fields.into_iter().collect::<Array>()
    });
    Ok(lists.collect())
}

/// The frames of a point cache; see [`read_frames`](crate::meshes::read_frames).
#[cfg(feature = "io")]
#[wasm_bindgen]
pub fn read_frames(name: &str, bytes: Vec<u8>) -> Thrown<Array> {
    let frames = crate::meshes::read_frames(name, bytes).map_err(thrown)?;
    Ok(frames.iter().map(read_coordinates).collect())
}

#[cfg(feature = "io")]
fn read_coordinates(positions: &impinge_io::Positions) -> JsValue {
    use impinge_io::Positions;
    match positions {
        Positions::F32(rows) => Float32Array::from(rows.as_flattened()).into(),
        Positions::F64(rows) => Float64Array::from(rows.as_flattened()).into(),
    }
}
