//! Distances of near pairs with their derivatives: `impinge_near_stencils`.

use std::sync::OnceLock;

use impinge::{PairKind, Stencil, Stencils, project_psd};

use crate::answers::{code, impinge_near};
use crate::arrays::{self, Floats, collect, reserve};
use crate::scene::impinge_scene;
use crate::status::{Failure, clear, destroy, guard, held, put};
use crate::types::*;

const WHAT: &str = "stencils";

/// Vertices of near pairs or contacts, and how their distances depend on them.
pub struct impinge_stencils {
    stencils: Stencils,
    /// Where the rows are in `stencils`, if they have another order.
    order: Vec<usize>,
    vertices: Vec<[u32; 4]>,
    kinds: Vec<u8>,
    features: Vec<[u8; 2]>,
    starts: Vec<u64>,
    /// Numbers, computed when they are first looked at; none if there is no memory for them.
    numbers: [OnceLock<Option<Vec<f64>>>; NUMBERS.len()],
}

/// How many numbers a stencil has in a column, and which.
type Numbers = (u32, usize, fn(&Stencil, &mut Vec<f64>));

const NUMBERS: [Numbers; 8] = [
    (COLUMN_WEIGHT, 1, |of, to| to.push(of.weight)),
    (COLUMN_COEFFICIENTS, 4, |of, to| {
        to.extend(of.coefficients())
    }),
    (COLUMN_SQUARED_DISTANCE, 1, |of, to| {
        to.push(of.squared_distance())
    }),
    (COLUMN_GRADIENT, 12, |of, to| to.extend(of.gradient())),
    (COLUMN_HESSIAN, 144, |of, to| {
        to.extend_from_slice(of.hessian().as_flattened())
    }),
    (COLUMN_MOLLIFIER, 1, |of, to| to.push(of.mollifier())),
    (COLUMN_MOLLIFIER_GRADIENT, 12, |of, to| {
        to.extend(of.mollifier_gradient())
    }),
    (COLUMN_MOLLIFIER_HESSIAN, 144, |of, to| {
        to.extend_from_slice(of.mollifier_hessian().as_flattened());
    }),
];

impl impinge_stencils {
    fn new(stencils: Stencils, order: Vec<usize>) -> Result<Self, Failure> {
        let starts = stencils.offsets().iter().map(|&start| u64::from(start));
        let mut answer = impinge_stencils {
            order,
            vertices: Vec::new(),
            kinds: Vec::new(),
            features: Vec::new(),
            starts: collect(starts, WHAT)?,
            numbers: Default::default(),
            stencils,
        };
        let rows = 0..answer.stencils.len();
        answer.vertices = collect(rows.clone().map(|ix| answer.row(ix).vertices), WHAT)?;
        answer.kinds = collect(rows.clone().map(|ix| bit(answer.row(ix).kind) as u8), WHAT)?;
        let features = rows.map(|ix| {
            let row = answer.row(ix);
            let [a, b] = row.features.map(|feature| code(feature, false));
            match row.kind {
                // As vertices are: the vertex comes first.
                PairKind::EdgeVertex => [b, a],
                _ => [a, b],
            }
        });
        answer.features = collect(features, WHAT)?;
        Ok(answer)
    }

    fn row(&self, ix: usize) -> &Stencil {
        let rows = self.stencils.iter().as_slice();
        match self.order.get(ix) {
            Some(&at) => &rows[at],
            None => &rows[ix],
        }
    }

    fn numbers(&self, column: u32) -> Result<impinge_array, Failure> {
        let Some(ix) = NUMBERS.iter().position(|&(of, ..)| of == column) else {
            return Err(Failure::invalid(format!(
                "column: stencils have no column {column}"
            )));
        };
        let (_, n_columns, of) = NUMBERS[ix];
        let n = self.stencils.len();
        let find = || {
            let mut numbers = Vec::new();
            reserve(&mut numbers, n_columns * n, WHAT).ok()?;
            (0..n).for_each(|ix| of(self.row(ix), &mut numbers));
            Some(numbers)
        };
        let numbers = self.numbers[ix].get_or_init(find).as_ref();
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

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_near_stencils(
    near_pairs: *const impinge_near,
    scene: *const impinge_scene,
    rest: *const impinge_array,
    stencils: *mut *mut impinge_stencils,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
        unsafe {
            clear(stencils, "stencils")?;
            let near = held(near_pairs, "near_pairs")?;
            let scene = &held(scene, "scene")?.scene;
            let rest = match rest.as_ref() {
                None => None,
                Some(rest) => Some(match arrays::floats::<3>(rest, "rest")? {
                    Floats::F64(rest) => rest,
                    Floats::F32(rest) => {
                        let widened = rest.iter().map(|point| point.map(f64::from));
                        collect(widened, "rest")?.into()
                    }
                }),
            };
            let found = near.near.stencils(scene, rest.as_deref())?;
            let order = arrays::copied(&near.order, WHAT)?;
            let answer = Box::new(impinge_stencils::new(found, order)?);
            put(stencils, "stencils", Box::into_raw(answer))
        }
    })
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
            let answer = Box::new(impinge_stencils::new(found, Vec::new())?);
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
    fn each<const N: usize>(numbers: &mut [f64]) {
        let rows = numbers.as_chunks_mut::<N>().0;
        rows.as_chunks_mut::<N>().0.iter_mut().for_each(project_psd);
    }
    guard(|| {
        let project = match size {
            3 => each::<3>,
            6 => each::<6>,
            9 => each::<9>,
            12 => each::<12>,
            _ => {
                return Err(Failure::invalid(format!(
                    "size: {size} given, 3, 6, 9 or 12 allowed"
                )));
            }
        };
        if n == 0 {
            return Ok(());
        }
        if matrices.is_null() {
            return Err(Failure::invalid(format!(
                "matrices: NULL, but there are {n} matrices"
            )));
        }
        let n_numbers = n.checked_mul(size * size);
        let n_numbers = n_numbers.filter(|&n| n <= isize::MAX as usize / size_of::<f64>());
        let n_numbers = n_numbers.ok_or_else(|| {
            Failure::invalid(format!("n: {n} matrices given, which no memory can hold"))
        })?;
        // SAFETY: see `impinge_near_stencils`.
        project(unsafe { std::slice::from_raw_parts_mut(matrices, n_numbers) });
        Ok(())
    })
}
