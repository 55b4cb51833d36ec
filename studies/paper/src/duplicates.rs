//! Table 3 and figure 7: pairs that meet in several cells.
//!
//! Compares three ways on the same frames: every cell tests the pairs that it finds; pairs go
//! through a table hashed by DJB2 before the tests, as in the paper; and our owner rule, by which
//! only one cell tests a pair.

use std::borrow::Borrow;
use std::time::{Duration, Instant};

use impinge::{BodyId, Detector, Method, Pairs};
use impinge_baseline::duplicates::{Checks, Missing, Possible, TwoLevels};

use crate::control::Control;
use crate::course::{Course, spread};
use crate::error::Error;
use crate::finders::Place;
use crate::options::Options;
use crate::published;
use crate::report::{Duplicates, TableSize, TableSizes};
use crate::samples::Samples;

/// The number of frames of a course that are measured.
const N_FRAMES: usize = 40;
const N_FRAMES_OF_SIZES: usize = 8;
const N_FRAMES_QUICK: usize = 2;

/// Sizes of the table in figure 7, as powers of two times the number of elements.
const SIZES: std::ops::RangeInclusive<i32> = -3..=5;

/// The two ways to read the paper: which pairs of a cell are tested.
const WAYS: [Possible; 2] = [Possible::Masks, Possible::Boxes];

/// The results of one way to handle repetitions, over all frames.
#[derive(Default)]
struct Column {
    ms: Vec<f64>,
    n_colliding: usize,
}

impl Column {
    fn add(&mut self, ms: f64, pairs: &Pairs, bodies: [BodyId; 2]) {
        self.ms.push(ms);
        let colliding = bodies.map(|body| pairs.colliding(body).len());
        self.n_colliding += colliding[0] + colliding[1];
    }
}

/// Table 3 for one benchmark: one row per way to read the paper.
pub(crate) fn table(
    course: &mut dyn Course,
    options: &Options,
    control: &Control<'_>,
) -> Result<Vec<Duplicates>, Error> {
    let frames = frames(course, options, N_FRAMES);
    let [a, b] = course.bodies();
    let n_elements: usize = course.n_elements().iter().sum();
    let mut rows = Vec::new();
    for possible in WAYS {
        let mut two_levels = two_levels(options, possible)?;
        let mut owner = owner(options)?;
        let mut columns = <[Column; 3]>::default();
        let (mut checks, mut missing) = (Checks::default(), Missing::default());
        let (mut is_subset, mut is_equal_without) = (true, true);
        for (ix, &frame) in frames.iter().enumerate() {
            control.go_on()?;
            course.pose(frame)?;
            let (scene, query) = (course.scene(), course.query());
            if ix == 0 {
                // An untimed run first, so that the timed ones do not grow memory.
                two_levels.detect(scene, a, b)?;
                two_levels.detect_djb2(scene, a, b, n_elements)?;
                owner.detect(scene, &query)?;
            }
            // Another way starts each time, because the first one finds the least data in the
            // caches.
            let mut answers: [Pairs; 3] = std::array::from_fn(|_| Pairs::default());
            for turn in 0..3 {
                let way = (ix + turn) % 3;
                let ms = match way {
                    0 => timed(&mut answers[way], || owner.detect(scene, &query)),
                    1 => timed(&mut answers[way], || two_levels.detect(scene, a, b)),
                    _ => timed(&mut answers[way], || {
                        two_levels.detect_djb2(scene, a, b, n_elements)
                    }),
                }?;
                columns[way].add(ms, &answers[way], [a, b]);
            }
            let [exact, repeated, found] = &answers;
            is_equal_without &= repeated.rows().eq(exact.rows());
            is_subset &= is_part(found, exact);
            add(&mut missing, Missing::of(exact, found, a, b));
            let counted = two_levels.count(scene, a, b)?;
            checks.n_tests += counted.n_tests;
            checks.n_pairs += counted.n_pairs;
            checks.n_repeated += counted.n_repeated;
            control.report(&what(course, "duplicates"), ix + 1, frames.len());
        }
        let [owned, without, with] = columns;
        let each = |count: usize| count as f64 / frames.len().max(1) as f64;
        rows.push(Duplicates {
            scene: course.name().name().to_owned(),
            has_box_test: possible == Possible::Boxes,
            n_frames: frames.len(),
            table_size: n_elements as u64,
            n_candidates: checks.n_pairs as f64 / frames.len().max(1) as f64,
            share_repeated: checks.repeated_share(),
            times_checked: checks.average(),
            ms_without: Samples::of(without.ms),
            ms_with: Samples::of(with.ms),
            ms_owner: Samples::of(owned.ms),
            n_colliding_without: each(without.n_colliding),
            n_colliding_with: each(with.n_colliding),
            n_colliding_owner: each(owned.n_colliding),
            missing_rate: missing.rate(),
            missing_rate_of_pairs: missing.pair_rate(),
            is_subset,
            is_equal_without,
        });
    }
    Ok(rows)
}

/// Figure 7 for one benchmark.
pub(crate) fn table_sizes(
    course: &mut dyn Course,
    options: &Options,
    control: &Control<'_>,
) -> Result<TableSizes, Error> {
    let frames = frames(course, options, N_FRAMES_OF_SIZES);
    let [a, b] = course.bodies();
    let n_elements: usize = course.n_elements().iter().sum();
    let sizes: Vec<usize> = SIZES
        .map(|power| match power {
            ..0 => n_elements >> -power,
            _ => n_elements << power,
        })
        .map(|size| size.max(1))
        .collect();
    let mut missing = vec![[Missing::default(); 2]; sizes.len()];
    let mut owner = owner(options)?;
    let mut two_levels = [two_levels(options, WAYS[0])?, two_levels(options, WAYS[1])?];
    for (ix, &frame) in frames.iter().enumerate() {
        course.pose(frame)?;
        let exact = owner.detect(course.scene(), &course.query())?;
        for (missing, &size) in missing.iter_mut().zip(&sizes) {
            control.go_on()?;
            for (missing, two_levels) in missing.iter_mut().zip(&mut two_levels) {
                let found = two_levels.detect_djb2(course.scene(), a, b, size)?;
                add(missing, Missing::of(&exact, found, a, b));
            }
        }
        control.report(&what(course, "table sizes"), ix + 1, frames.len());
    }
    Ok(TableSizes {
        scene: course.name().name().to_owned(),
        n_frames: frames.len(),
        n_elements: n_elements as u64,
        points: sizes
            .into_iter()
            .zip(missing)
            .map(|(size, [masks, boxes])| TableSize {
                table_size: size as u64,
                missing_rate: masks.rate(),
                missing_rate_of_pairs: masks.pair_rate(),
                missing_rate_with_box_test: boxes.rate(),
            })
            .collect(),
    })
}

fn what(course: &dyn Course, part: &str) -> String {
    format!("{}, {part}", course.name().name())
}

fn frames(course: &dyn Course, options: &Options, n: usize) -> Vec<usize> {
    let n = if options.is_quick { N_FRAMES_QUICK } else { n };
    spread(n, course.n_frames()).collect()
}

fn two_levels(options: &Options, possible: Possible) -> Result<TwoLevels, Error> {
    Ok(TwoLevels::new(impinge_baseline::duplicates::Settings {
        lambda: published::LAMBDA,
        possible,
        threads: options.n_threads,
        ..impinge_baseline::duplicates::Settings::default()
    })?)
}

/// The library's own two levels, with the owner rule.
fn owner(options: &Options) -> Result<Detector, Error> {
    let place = Place::Cpu {
        n_threads: options.n_threads,
    };
    Ok(Detector::new(
        place
            .settings()
            .method(Method::Cells)
            .density(published::LAMBDA),
    )?)
}

/// Times a detection after a pause, in which idle workers fall asleep, and copies its pairs after
/// the clock has stopped.
fn timed<P: Borrow<Pairs>>(
    to: &mut Pairs,
    detect: impl FnOnce() -> Result<P, impinge::Error>,
) -> Result<f64, Error> {
    std::thread::sleep(Duration::from_millis(1));
    let start = Instant::now();
    let pairs = detect()?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    to.clone_from(pairs.borrow());
    Ok(ms)
}

fn add(sum: &mut Missing, of_frame: Missing) {
    sum.n_colliding += of_frame.n_colliding;
    sum.n_missing += of_frame.n_missing;
    sum.n_pairs += of_frame.n_pairs;
    sum.n_missing_pairs += of_frame.n_missing_pairs;
}

/// Whether all pairs of one answer are in another one; both are sorted.
fn is_part(part: &Pairs, whole: &Pairs) -> bool {
    let mut whole = whole.rows();
    part.rows().all(|row| whole.any(|other| other == row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge::{Backend, Query};
    use impinge_scenes::{BuiltScene, surfaces};

    #[test]
    fn a_part_is_a_part_and_the_whole_is_none_of_it() {
        let balls = BuiltScene::two_body("balls", &surfaces::ball(2_000), [0.4, 0.3, 0.2]).unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let whole = detector.detect(&balls.scene, &balls.query).unwrap();
        let [a, b] = [balls.bodies[0], balls.bodies[1]];
        let mut two_levels = two_levels(&Options::default(), Possible::Masks).unwrap();
        let part = two_levels.detect_djb2(&balls.scene, a, b, 100).unwrap();
        assert!(!part.is_empty() && part.len() < whole.len());
        assert!(is_part(part, &whole) && is_part(&whole, &whole));
        assert!(!is_part(&whole, part));
        let none = detector.detect(&balls.scene, &Query::self_of(a)).unwrap();
        assert!(is_part(&none, part) && !is_part(part, &none));
    }
}
