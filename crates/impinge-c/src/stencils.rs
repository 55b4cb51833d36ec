//! Distances of near pairs with their derivatives: `impinge_near_stencils`.

use std::sync::OnceLock;

use impinge::{Error, PairKind, Stencil, Stencils, project_psd_all};

use crate::answers::{code, impinge_near};
use crate::arrays::{self, Floats, collect};
use crate::scene::impinge_scene;
use crate::status::{Failure, clear, destroy, guard, held, put};
use crate::types::*;

const WHAT: &str = "stencils";

/// Vertices of near pairs or contacts, and how their distances depend on them.
pub struct impinge_stencils {
    stencils: Stencils,
    vertices: Vec<[u32; 4]>,
    kinds: Vec<u8>,
    features: Vec<[u8; 2]>,
    starts: Vec<u64>,
    /// Numbers, computed when they are first looked at; none if there is no memory for them.
    numbers: [OnceLock<Option<Vec<f64>>>; NUMBERS.len()],
}

/// How many numbers a stencil has in a column, and these of all.
type Numbers = (u32, usize, fn(&Stencils) -> Result<Vec<f64>, Error>);

const NUMBERS: [Numbers; 8] = [
    (COLUMN_WEIGHT, 1, |of| of.column(|of| of.weight)),
    (COLUMN_COEFFICIENTS, 4, |of| {
        Ok(of.column(Stencil::coefficients)?.into_flattened())
    }),
    (COLUMN_SQUARED_DISTANCE, 1, |of| {
        of.column(Stencil::squared_distance)
    }),
    (COLUMN_GRADIENT, 12, |of| {
        Ok(of.column(Stencil::gradient)?.into_flattened())
    }),
    (COLUMN_HESSIAN, 144, |of| {
        Ok(of
            .column(Stencil::hessian)?
            .into_flattened()
            .into_flattened())
    }),
    (COLUMN_MOLLIFIER, 1, |of| of.column(Stencil::mollifier)),
    (COLUMN_MOLLIFIER_GRADIENT, 12, |of| {
        Ok(of.column(Stencil::mollifier_gradient)?.into_flattened())
    }),
    (COLUMN_MOLLIFIER_HESSIAN, 144, |of| {
        let column = of.column(Stencil::mollifier_hessian)?;
        Ok(column.into_flattened().into_flattened())
    }),
];

impl impinge_stencils {
    fn new(stencils: Stencils) -> Result<Self, Failure> {
        let starts = stencils.offsets().iter().map(|&start| u64::from(start));
        let mut answer = impinge_stencils {
            vertices: Vec::new(),
            kinds: Vec::new(),
            features: Vec::new(),
            starts: collect(starts, WHAT)?,
            numbers: Default::default(),
            stencils,
        };
        let rows = || answer.stencils.iter();
        answer.vertices = collect(rows().map(|row| row.vertices), WHAT)?;
        answer.kinds = collect(rows().map(|row| bit(row.kind) as u8), WHAT)?;
        let features = rows().map(|row| {
            let [a, b] = row.features.map(code);
            match row.kind {
                // As vertices are: the vertex comes first.
                PairKind::EdgeVertex => [b, a],
                _ => [a, b],
            }
        });
        answer.features = collect(features, WHAT)?;
        Ok(answer)
    }

    fn numbers(&self, column: u32) -> Result<impinge_array, Failure> {
        let Some(ix) = NUMBERS.iter().position(|&(of, ..)| of == column) else {
            return Err(Failure::invalid(format!(
                "column: stencils have no column {column}"
            )));
        };
        let (_, n_columns, of) = NUMBERS[ix];
        let n = self.stencils.len();
        let numbers = self.numbers[ix].get_or_init(|| of(&self.stencils).ok());
        let numbers = numbers.as_ref();
        let numbers = numbers.ok_or_else(|| Failure::out_of_memory(WHAT, n_columns * n))?;
        Ok(impinge_array {
            rows: n,
            row_stride: (size_of::<f64>() * n_columns) as isize,
            ..arrays::view_of(numbers)
        })
    }

    fn column(&self, column: u32) -> Result<impinge_array, Failure> {
        Ok(match column {
            COLUMN_VERTICES => arrays::view(&self.vertices),
            COLUMN_KIND => arrays::view_of(&self.kinds),
            COLUMN_FEATURES => arrays::view(&self.features),
            COLUMN_STARTS => arrays::view_of(&self.starts),
            _ => return self.numbers(column),
        })
    }
}

/// # Safety
/// As `impinge.h` says of `impinge_near_stencils`.
unsafe fn near_stencils(
    near_pairs: *const impinge_near,
    scene: *const impinge_scene,
    rest: *const impinge_array,
    stencils: *mut *mut impinge_stencils,
    by_area: bool,
) -> Status {
    guard(|| {
        // SAFETY: the caller's promise.
        unsafe {
            clear(stencils, "stencils")?;
            let near = held(near_pairs, "near_pairs")?;
            let scene = &held(scene, "scene")?.read()?.scene;
            let rest = match rest.is_null() {
                true => None,
                false => Some(match arrays::floats::<3>(held(rest, "rest")?, "rest")? {
                    Floats::F64(rest) => rest,
                    Floats::F32(rest) => {
                        let widened = rest.iter().map(|point| point.map(f64::from));
                        collect(widened, "rest")?.into()
                    }
                }),
            };
            let found = match (by_area, rest.as_deref()) {
                (false, rest) => near.near.stencils(scene, rest)?,
                (true, Some(rest)) => near.near.stencils_by_area(scene, rest)?,
                (true, None) => {
                    let missing = "rest: NULL, but areas are those at rest";
                    return Err(Failure::invalid(missing));
                }
            };
            let answer = Box::new(impinge_stencils::new(found)?);
            put(stencils, "stencils", Box::into_raw(answer))
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_near_stencils(
    near_pairs: *const impinge_near,
    scene: *const impinge_scene,
    rest: *const impinge_array,
    stencils: *mut *mut impinge_stencils,
) -> Status {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe { near_stencils(near_pairs, scene, rest, stencils, false) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_near_stencils_by_area(
    near_pairs: *const impinge_near,
    scene: *const impinge_scene,
    rest: *const impinge_array,
    stencils: *mut *mut impinge_stencils,
) -> Status {
    // SAFETY: see `impinge_near_stencils`.
    unsafe { near_stencils(near_pairs, scene, rest, stencils, true) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_stencils_merged(
    stencils: *const impinge_stencils,
    merged: *mut *mut impinge_stencils,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_near_stencils`.
        unsafe {
            clear(merged, "merged")?;
            let found = held(stencils, "stencils")?.stencils.merged()?;
            let answer = Box::new(impinge_stencils::new(found)?);
            put(merged, "merged", Box::into_raw(answer))
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_stencils_count(stencils: *const impinge_stencils) -> usize {
    // SAFETY: see `impinge_near_stencils`.
    unsafe { stencils.as_ref() }.map_or(0, |of| of.stencils.len())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_stencils_column(
    stencils: *const impinge_stencils,
    column: u32,
    view: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_near_stencils`.
        let found = unsafe { held(stencils, "stencils") }?.column(column)?;
        // SAFETY: see `impinge_near_stencils`.
        unsafe { put(view, "view", found) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_stencils_destroy(stencils: *mut impinge_stencils) {
    // SAFETY: see `impinge_near_stencils`.
    unsafe { destroy(stencils) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_project_psd(matrices: *mut f64, n: usize, size: usize) -> Status {
    guard(|| {
        if n > 0 && matrices.is_null() {
            return Err(Failure::invalid(format!(
                "matrices: NULL, but there are {n} matrices"
            )));
        }
        if n > 0 && !matrices.is_aligned() {
            return Err(Failure::misaligned(matrices, "matrices"));
        }
        let n_numbers = size.checked_mul(size).and_then(|each| n.checked_mul(each));
        let n_numbers = n_numbers.filter(|&n| n <= isize::MAX as usize / size_of::<f64>());
        let n_numbers = n_numbers.ok_or_else(|| {
            Failure::invalid(format!(
                "n: {n} matrices of size {size} given, which no memory can hold"
            ))
        })?;
        let numbers = match n_numbers {
            0 => &mut [],
            // SAFETY: see `impinge_near_stencils`.
            _ => unsafe { std::slice::from_raw_parts_mut(matrices, n_numbers) },
        };
        Ok(project_psd_all(numbers, size, 0)?)
    })
}
