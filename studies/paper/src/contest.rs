//! Runs frames of all contestants in turns, so that all meet the same conditions, and compares
//! their pairs.

use std::time::Duration;

use impinge::{BodyId, Scene, hash_rows};

use crate::control::Control;
use crate::error::Error;
use crate::finders::{Finder, Found, Setup};
use crate::published;
use crate::report::{Method, Moment, Run, StageTimes};
use crate::samples::Samples;

/// The pause between two contestants' frames, in which idle workers of the first one fall asleep.
const PAUSE: Duration = Duration::from_millis(1);

/// The most frames of a contestant on a software driver, whose times say little.
const FRAMES_IN_SOFTWARE: usize = 10;
const FRAMES_IN_SOFTWARE_QUICK: usize = 2;

struct Contestant {
    setup: Setup,
    is_chosen_lambda: bool,
    finder: Box<dyn Finder>,
    /// It runs one of so many frames.
    every: usize,
    found: Vec<Found>,
    /// Its pairs in the last frame that it ran.
    rows: Vec<[u32; 4]>,
    hash: u64,
    n_frames_differing: usize,
}

/// All contestants on one scene. The others are compared with the first one.
pub(crate) struct Contest {
    contestants: Vec<Contestant>,
    course: Vec<Moment>,
}

impl Contest {
    /// A contest of `n_frames` frames. The flag of each setup says whether its λ was the fastest or
    /// was given.
    pub fn new(setups: Vec<(Setup, bool)>, n_frames: usize, is_quick: bool) -> Result<Self, Error> {
        let n_in_software = match is_quick {
            true => FRAMES_IN_SOFTWARE_QUICK,
            false => FRAMES_IN_SOFTWARE,
        };
        let contestants = setups.into_iter().map(|(setup, is_chosen_lambda)| {
            Ok(Contestant {
                finder: setup.build()?,
                every: match setup.place.is_software() {
                    true => n_frames.div_ceil(n_in_software).max(1),
                    false => 1,
                },
                setup,
                is_chosen_lambda,
                found: Vec::with_capacity(n_frames),
                rows: Vec::new(),
                hash: 0,
                n_frames_differing: 0,
            })
        });
        Ok(Contest {
            contestants: contestants.collect::<Result<_, Error>>()?,
            course: Vec::with_capacity(n_frames),
        })
    }

    /// Runs one frame with all contestants that run this frame, starting with a different one each
    /// time. Returns the pairs of the first contestant, if it runs this frame.
    pub fn frame(
        &mut self,
        frame: usize,
        scene: &Scene,
        bodies: [BodyId; 2],
        control: &Control<'_>,
    ) -> Result<Option<&[[u32; 4]]>, Error> {
        let n = self.contestants.len();
        for turn in 0..n {
            let contestant = &mut self.contestants[(frame + turn) % n];
            if !contestant.takes(frame) {
                continue;
            }
            control.go_on()?;
            let Contestant { finder, rows, .. } = contestant;
            if contestant.found.is_empty() {
                // An untimed run first, so that the timed one neither grows memory nor clusters.
                finder.find(scene, bodies, control.cancel, rows)?;
            }
            std::thread::sleep(PAUSE);
            let found = finder.find(scene, bodies, control.cancel, rows)?;
            contestant.found.push(found);
        }
        let Some((first, others)) = self.contestants.split_first_mut() else {
            return Ok(None);
        };
        if !first.takes(frame) {
            return Ok(None);
        }
        first.book();
        for contestant in others.iter_mut().filter(|c| c.takes(frame)) {
            contestant.book();
            contestant.n_frames_differing += usize::from(contestant.rows != first.rows);
        }
        self.course.push(Moment {
            frame,
            n_pairs: first.rows.len(),
            n_colliding: n_colliding(&first.rows),
        });
        Ok(Some(&first.rows))
    }

    /// The counts of the first contestant, frame by frame.
    pub fn course(&self) -> &[Moment] {
        &self.course
    }

    /// The figures of all contestants.
    pub fn runs(&self) -> Vec<Run> {
        self.contestants.iter().map(Contestant::run).collect()
    }
}

impl Contestant {
    /// Whether it runs a frame: the middle one of each `every` frames.
    fn takes(&self, frame: usize) -> bool {
        frame % self.every == self.every / 2
    }

    fn book(&mut self) {
        let of_frame = hash_rows(self.rows.iter().copied());
        self.hash = self.hash.wrapping_add(of_frame);
    }

    fn run(&self) -> Run {
        let Setup {
            method,
            place,
            lambda,
        } = &self.setup;
        let counts = |count: fn(&Found) -> u64| Samples::of_counts(self.found.iter().map(count));
        // Stages are in the order of the frame with the most stages: a frame without contact skips
        // some.
        let mut by_length: Vec<&Found> = self.found.iter().collect();
        by_length.sort_by_key(|found| std::cmp::Reverse(found.stages.len()));
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in by_length.iter().flat_map(|found| &found.stages) {
            if !names.contains(name) {
                names.push(name);
            }
        }
        // A stage that a frame did not run took no time there.
        let stage = |name: &str| {
            let of = |found: &Found| {
                let stages = found.stages.iter().filter(|(stage, _)| *stage == name);
                stages.map(|(_, ms)| ms).sum::<f64>()
            };
            StageTimes {
                name: name.to_owned(),
                ms: Samples::of(self.found.iter().map(of)),
            }
        };
        Run {
            method: *method,
            backend: place.name().to_owned(),
            is_gpu: place.is_gpu(),
            is_software: place.is_software(),
            lambda: self.setup.has_lambda().then_some(*lambda),
            is_papers_lambda: papers_lambda(*method) == Some(*lambda),
            is_chosen_lambda: self.is_chosen_lambda,
            ms: Samples::of(self.found.iter().map(|found| found.ms)),
            stages: names.into_iter().map(stage).collect(),
            n_cells: counts(|found| found.n_cells),
            n_subdivided: counts(|found| found.n_subdivided),
            n_entries: counts(|found| found.n_entries),
            n_candidates: counts(|found| found.n_candidates),
            n_unsure: counts(|found| found.n_unsure),
            bytes_held: self
                .found
                .iter()
                .map(|found| found.bytes_held)
                .max()
                .unwrap_or(0),
            hash: format!("{:016x}", self.hash),
            n_frames_differing: self.n_frames_differing,
        }
    }
}

/// The paper's λ for a method; `None` for a method without λ.
pub(crate) fn papers_lambda(method: Method) -> Option<f64> {
    match method {
        Method::Cells => Some(published::LAMBDA),
        Method::Fwzs11 => Some(published::LAMBDA_FWZS11),
        Method::Clusters => None,
    }
}

/// The number of elements in all bodies together that take part in a pair.
pub(crate) fn n_colliding(rows: &[[u32; 4]]) -> usize {
    let ends = rows
        .iter()
        .flat_map(|&[body_a, a, body_b, b]| [(body_a, a), (body_b, b)]);
    let mut elements: Vec<(u32, u32)> = ends.collect();
    elements.sort_unstable();
    elements.dedup();
    elements.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge::{Backend, CancelToken, Detector};
    use impinge_scenes::{BuiltScene, surfaces};

    use crate::finders::Place;

    /// A finder that lies: it changes the rows of an honest one.
    struct Liar(Detector, fn(&mut Vec<[u32; 4]>));

    impl Finder for Liar {
        fn find(
            &mut self,
            scene: &Scene,
            bodies: [BodyId; 2],
            cancel: &CancelToken,
            rows: &mut Vec<[u32; 4]>,
        ) -> Result<Found, Error> {
            let found = self.0.find(scene, bodies, cancel, rows)?;
            (self.1)(rows);
            Ok(found)
        }
    }

    /// Compares an honest contestant with one that changes rows: the number of frames that differ,
    /// and whether the hashes are equal.
    fn against(lie: fn(&mut Vec<[u32; 4]>)) -> (usize, bool) {
        let balls = BuiltScene::two_body("balls", &surfaces::ball(500), [0.9, 0.0, 0.0]).unwrap();
        let setup = Setup {
            method: Method::Clusters,
            place: Place::Cpu { n_threads: 1 },
            lambda: 1.0,
        };
        let setups = vec![(setup.clone(), false), (setup, false)];
        let mut contest = Contest::new(setups, 3, false).unwrap();
        contest.contestants[1].finder = Box::new(Liar(Detector::new(Backend::Cpu).unwrap(), lie));
        let cancel = CancelToken::new();
        let control = Control {
            cancel: &cancel,
            progress: &|_| {},
        };
        let bodies = [balls.bodies[0], balls.bodies[1]];
        for frame in 0..3 {
            let rows = contest
                .frame(frame, &balls.scene, bodies, &control)
                .unwrap();
            assert!(rows.unwrap().len() > 2);
        }
        let runs = contest.runs();
        assert_eq!(runs[0].n_frames_differing, 0);
        assert_eq!(runs[1].ms.n, 3);
        (runs[1].n_frames_differing, runs[0].hash == runs[1].hash)
    }

    #[test]
    fn liars_are_caught() {
        assert_eq!(against(|_| {}), (0, true));
        let lies: [fn(&mut Vec<[u32; 4]>); 3] = [
            |rows| _ = rows.pop(),
            |rows| rows.push([0, 7, 1, 7]),
            |rows| rows[0][1] += 1,
        ];
        for lie in lies {
            assert_eq!(against(lie), (3, false));
        }
        // In another order the hash is the same, but the answer is wrong, because it must be
        // sorted.
        assert_eq!(against(|rows| rows.swap(0, 1)), (3, true));
    }

    #[test]
    fn colliding_elements_are_counted_once() {
        assert_eq!(n_colliding(&[[0, 1, 1, 1], [0, 1, 1, 2], [0, 3, 1, 2]]), 4);
    }
}
