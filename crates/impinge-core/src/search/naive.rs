//! The oracle: every box against every box, then the exact test. It defines what is correct.
//!
//! Cost: quadratic in elements; memory: the boxes. A box is the extent of an element's corners
//! in double precision; boxes that do not overlap (closed) hold elements that cannot meet.

use crate::boxes::Extent;
use crate::plan::{Plan, TestId, pair_key};
use crate::query::progress::Control;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::Number;
use crate::search::narrow::{PairElement, Test};
use crate::search::stats::Stats;

/// Calls `emit` with the test, the key and the value of every pair that the frame asks for and that
/// passes its test, in the order of the keys. An error of `emit` ends the search.
pub(crate) fn run<T: Test>(
    test: &T,
    scene: &Scene,
    plan: &Plan,
    control: &Control,
    stats: &mut Stats,
    mut emit: impl FnMut(TestId, u64, T::Value) -> Result<(), Error>,
) -> Result<(), Error> {
    let elements = elements(test, scene, plan);
    let n = elements.len();
    for (ix, (number_a, a, box_a)) in elements.iter().enumerate() {
        control.step(ix as u64, n as u64)?;
        for (number_b, b, box_b) in &elements[ix + 1..] {
            let Some(id) = plan.test(a.part, b.part) else {
                continue;
            };
            if box_a.overlaps(box_b) {
                stats.n_candidates += u64::from(test.admits(id, *a, *b));
                if let Some(value) = test.decide(id, *a, *b) {
                    emit(id, pair_key(*number_a, *number_b), value)?;
                }
            }
        }
    }
    Ok(())
}

/// All elements in the order of their numbers, with their boxes.
fn elements<'a, T: Test>(
    test: &T,
    scene: &'a Scene,
    plan: &'a Plan,
) -> Vec<(Number, PairElement<'a>, Extent)> {
    plan.part_ixs()
        .flat_map(|part| {
            plan.elements(scene, part).map(move |(number, corners)| {
                let element = PairElement {
                    scene,
                    plan,
                    part,
                    element: plan.part(part).element(number),
                    corners,
                };
                (number, element)
            })
        })
        .map(|(number, element)| (number, element, test.extent(element)))
        .collect()
}
