//! Scenes: `impinge_scene_*` and `impinge_weld`.

use std::borrow::Cow;
use std::ffi::c_void;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use impinge::{Body, BodyId, Filter, Positions, Scene, Thickness, Weld};

use crate::arrays::{self, Floats, elements_view, no_rows, positions_view, with_rows};
use crate::status::{Failure, Handle, Held, change, clear, end, guard, held, look, put, write_all};
use crate::types::*;

/// A scene, and the ids of its bodies.
#[derive(Default)]
pub struct Bodies {
    pub scene: Scene,
    /// By the number of the body.
    ids: Vec<Option<BodyId>>,
}

pub type impinge_scene = Handle<Bodies>;

impl Held for Bodies {
    const NAME: &'static str = "scene";
    const CHANGED: &'static str = "another call is changing it; one call at a time changes a scene, and no question is asked about it meanwhile";
    const READ: &'static str = "another call is reading it, such as a question; change it afterwards, and not in that question's callbacks";
}

impl Bodies {
    /// The id of a body.
    pub fn id(&self, body: u32) -> Result<BodyId, Failure> {
        let id = self.ids.get(body as usize).copied().flatten();
        id.ok_or_else(|| {
            Failure::invalid(format!(
                "there is no body {body} among the {} of this scene",
                self.scene.n_bodies()
            ))
        })
    }

    fn body(&self, body: u32) -> Result<&Body, Failure> {
        Ok(self.scene.body(self.id(body)?)?)
    }

    /// Adds a body.
    ///
    /// # Safety
    /// The arrays are as described.
    unsafe fn add(
        &mut self,
        kind: u32,
        elements: &impinge_array,
        positions: &impinge_array,
        body: *mut u32,
    ) -> Result<(), Failure> {
        // SAFETY: the caller's promise.
        let at = unsafe { arrays::floats::<3>(positions, "positions") }?;
        // SAFETY: the caller's promise.
        let elements = unsafe { arrays::elements(kind, elements, at.len()) }?;
        let id = self.scene.add((elements, at.into_owned()?))?;
        let number = id.index();
        if number >= self.ids.len() {
            self.ids.resize(number + 1, None);
        }
        self.ids[number] = Some(id);
        if !body.is_null() {
            // SAFETY: the caller's promise.
            unsafe { body.write_unaligned(number as u32) };
        }
        Ok(())
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_create(scene: *mut *mut impinge_scene) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
        unsafe {
            clear(scene, "scene")?;
            put(scene, "scene", Box::into_raw(Box::default()))
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_destroy(scene: *mut impinge_scene) {
    // SAFETY: see `impinge_scene_create`.
    unsafe { end(scene) }
}

macro_rules! add {
    ($name:ident, $kind:ident) => {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            scene: *mut impinge_scene,
            elements: impinge_array,
            positions: impinge_array,
            body: *mut u32,
        ) -> Status {
            // SAFETY: see `impinge_scene_create`.
            unsafe { change(scene, |scene| scene.add($kind, &elements, &positions, body)) }
        }
    };
}
add!(impinge_scene_add_triangles, TRIANGLES);
add!(impinge_scene_add_tetrahedra, TETRAHEDRA);
add!(impinge_scene_add_edges, EDGES);

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_add_points(
    scene: *mut impinge_scene,
    positions: impinge_array,
    body: *mut u32,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            scene.add(POINTS, &no_rows(U32), &positions, body)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_remove(scene: *mut impinge_scene, body: u32) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            scene.scene.remove(scene.id(body)?)?;
            scene.ids[body as usize] = None;
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_remesh(
    scene: *mut impinge_scene,
    body: u32,
    kind: u32,
    elements: impinge_array,
    positions: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            let at = arrays::floats::<3>(&positions, "positions")?;
            let elements = arrays::elements(kind, &elements, at.len())?;
            Ok(scene.scene.remesh(id, (elements, at.into_owned()?))?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_edges(
    scene: *mut impinge_scene,
    body: u32,
    edges: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            let edges = arrays::indices::<2>(&edges, "edges")?;
            Ok(scene.scene.set_edges(id, &edges)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_positions(
    scene: *mut impinge_scene,
    body: u32,
    positions: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            let positions = arrays::floats::<3>(&positions, "positions")?;
            with_rows!(positions, |rows| scene.scene.set_positions(id, &rows[..]))?;
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_end_positions(
    scene: *mut impinge_scene,
    body: u32,
    positions: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            if positions.rows == 0 {
                return Ok(scene.scene.clear_end_positions(id)?);
            }
            let positions = arrays::floats::<3>(&positions, "positions")?;
            with_rows!(positions, |rows| scene
                .scene
                .set_end_positions(id, &rows[..]))?;
            Ok(())
        })
    }
}

/// Rows of a caller, who waits for `release` before changing them.
struct Lent<R> {
    rows: *const [[R; 3]],
    release: Option<ReleaseCallback>,
    user: *mut c_void,
    /// Whether the scene has taken them. Until then nobody is called.
    is_taken: AtomicBool,
}

// SAFETY: the rows are only read, and `impinge.h` says that `release` is called from any thread.
unsafe impl<R: Sync> Send for Lent<R> {}
// SAFETY: as above.
unsafe impl<R: Sync> Sync for Lent<R> {}

impl<R> AsRef<[[R; 3]]> for Lent<R> {
    fn as_ref(&self) -> &[[R; 3]] {
        // SAFETY: the caller lets the rows lie until `release` is called.
        unsafe { &*self.rows }
    }
}

impl<R> Drop for Lent<R> {
    fn drop(&mut self) {
        if let (Some(release), true) = (self.release, *self.is_taken.get_mut()) {
            // SAFETY: the caller's function, with the caller's argument; called once.
            unsafe { release(self.user) };
        }
    }
}

/// Where lent positions go.
type Set = fn(&mut Scene, BodyId, Positions) -> Result<(), impinge::Error>;

/// Hands positions to the scene where they lie, or a copy where rows are not packed.
///
/// # Safety
/// `positions` is as described and lies unchanged until `release` is called.
unsafe fn lend(
    scene: &mut Bodies,
    body: u32,
    positions: &impinge_array,
    (release, user): (Option<ReleaseCallback>, *mut c_void),
    set: Set,
) -> Result<(), Failure> {
    let id = scene.id(body)?;
    let mut share = |at| set(&mut scene.scene, id, at);
    // SAFETY: the caller's promise.
    match unsafe { arrays::floats::<3>(positions, "positions") }? {
        Floats::F32(Cow::Borrowed(rows)) => lend_rows(rows, release, user, &mut share)?,
        Floats::F64(Cow::Borrowed(rows)) => lend_rows(rows, release, user, &mut share)?,
        copy => {
            share(copy.into_owned()?)?;
            if let Some(release) = release {
                // SAFETY: the caller's function, with the caller's argument; called once.
                unsafe { release(user) };
            }
        }
    }
    Ok(())
}

fn lend_rows<R: impinge::Real>(
    rows: &[[R; 3]],
    release: Option<ReleaseCallback>,
    user: *mut c_void,
    share: impl FnOnce(Positions) -> Result<(), impinge::Error>,
) -> Result<(), Failure> {
    let owner = Arc::new(Lent {
        rows,
        release,
        user,
        is_taken: AtomicBool::new(false),
    });
    share(Positions::shared(Arc::clone(&owner)))?;
    owner.is_taken.store(true, Ordering::Relaxed);
    Ok(())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_lend_positions(
    scene: *mut impinge_scene,
    body: u32,
    positions: impinge_array,
    release: Option<ReleaseCallback>,
    user: *mut c_void,
) -> Status {
    let set: Set = |scene, body, at| scene.set_positions(body, at);
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            lend(scene, body, &positions, (release, user), set)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_lend_end_positions(
    scene: *mut impinge_scene,
    body: u32,
    positions: impinge_array,
    release: Option<ReleaseCallback>,
    user: *mut c_void,
) -> Status {
    let set: Set = |scene, body, at| scene.set_end_positions(body, at);
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            lend(scene, body, &positions, (release, user), set)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_transform(
    scene: *mut impinge_scene,
    body: u32,
    matrix: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let (id, rows) = (scene.id(body)?, affine(&matrix)?);
            Ok(scene.scene.set_transform(id, &rows)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_end_transform(
    scene: *mut impinge_scene,
    body: u32,
    matrix: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let (id, rows) = (scene.id(body)?, affine(&matrix)?);
            Ok(scene.scene.set_end_transform(id, &rows)?)
        })
    }
}

/// A matrix of a caller.
///
/// # Safety
/// The array is as described.
unsafe fn affine(matrix: &impinge_array) -> Result<[[f64; 4]; 4], Failure> {
    // SAFETY: the caller's promise.
    let rows = unsafe { arrays::floats::<4>(matrix, "matrix") }?;
    if rows.len() != 4 {
        let given = rows.len();
        return Err(Failure::invalid(format!(
            "matrix: {given} rows of 4 given, 4 needed"
        )));
    }
    Ok(std::array::from_fn(|row| rows.wide(row)))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_filter(
    scene: *mut impinge_scene,
    body: u32,
    category: u64,
    mask: u64,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            Ok(scene.scene.set_filter(id, Filter { category, mask })?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_thickness(
    scene: *mut impinge_scene,
    body: u32,
    thickness: f64,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            Ok(scene.scene.set_thickness(id, thickness)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_element_thickness(
    scene: *mut impinge_scene,
    body: u32,
    kind: u32,
    thickness: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            const WHAT: &str = "thickness";
            let given = arrays::floats::<1>(&thickness, WHAT)?.widened(WHAT)?;
            let given = given.into_flattened();
            let thickness = match kind {
                POINTS => Thickness::vertices(given),
                TRIANGLES => Thickness::faces(given),
                EDGES => Thickness::edges(given),
                other => {
                    return Err(Failure::invalid(format!(
                        "kind: {other} given, IMPINGE_POINTS, _EDGES and _TRIANGLES allowed, for vertices, edges and faces"
                    )));
                }
            };
            Ok(scene.scene.set_thickness(id, thickness)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_groups(
    scene: *mut impinge_scene,
    body: u32,
    groups: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            let groups = arrays::indices::<1>(&groups, "groups")?;
            Ok(scene.scene.set_groups(id, groups.as_flattened())?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_set_pinned(
    scene: *mut impinge_scene,
    body: u32,
    pinned: impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe {
        change(scene, |scene| {
            let id = scene.id(body)?;
            let pinned = arrays::flags(&pinned, "pinned")?;
            Ok(scene.scene.set_pinned(id, &pinned)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_n_bodies(scene: *const impinge_scene) -> usize {
    // SAFETY: see `impinge_scene_create`.
    unsafe { look(scene) }.map_or(0, |scene| scene.scene.n_bodies())
}

/// Shows a part of a body.
///
/// # Safety
/// As `impinge.h` says of views.
unsafe fn show(
    scene: *const impinge_scene,
    body: u32,
    to: *mut impinge_array,
    view: impl FnOnce(&Body) -> impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: the caller's promise.
        let scene = unsafe { held(scene, "scene") }?.read()?;
        // SAFETY: the caller's promise.
        unsafe { put(to, "view", view(scene.body(body)?)) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_positions(
    scene: *const impinge_scene,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe { show(scene, body, view, |body| positions_view(body.positions())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_end_positions(
    scene: *const impinge_scene,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    let end = |body: &Body| match body.end_positions() {
        Some(end) => positions_view(end),
        None => no_rows(positions_view(body.positions()).r#type),
    };
    // SAFETY: see `impinge_scene_create`.
    unsafe { show(scene, body, view, end) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_elements(
    scene: *const impinge_scene,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe { show(scene, body, view, |body| elements_view(body.elements())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_edges(
    scene: *const impinge_scene,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe { show(scene, body, view, |body| elements_view(body.edges())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_scene_faces(
    scene: *const impinge_scene,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe { show(scene, body, view, |body| elements_view(body.faces())) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_weld(
    positions: impinge_array,
    map: *mut u32,
    firsts: *mut u32,
    n_vertices: *mut usize,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_scene_create`.
        let weld = match unsafe { arrays::floats::<3>(&positions, "positions") }? {
            Floats::F32(rows) => Weld::by_position(&rows),
            Floats::F64(rows) => Weld::by_position(&rows),
        };
        if map.is_null() && positions.rows > 0 {
            return Err(Failure::null("map"));
        }
        // SAFETY: the caller has room for as many numbers as there are positions, and there are no
        // more vertices after welding.
        unsafe {
            put(n_vertices, "n_vertices", weld.firsts().len())?;
            write_all(map, weld.map().iter().copied());
            if !firsts.is_null() {
                write_all(firsts, weld.firsts().iter().copied());
            }
        }
        Ok(())
    })
}

/// Panics, for tests of what a broken scene does.
#[cfg(feature = "test-panic")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_test_scene_panic(scene: *mut impinge_scene) -> Status {
    // SAFETY: see `impinge_scene_create`.
    unsafe { change(scene, |_| panic!("as a test asked")) }
}
