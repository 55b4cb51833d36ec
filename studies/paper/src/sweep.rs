//! Finds the fastest λ on a few frames.

use std::time::Duration;

use impinge::CancelToken;

use crate::contest::papers_lambda;
use crate::course::{Course, spread};
use crate::error::Error;
use crate::finders::{Place, Setup};
use crate::report::{Method, Sweep};
use crate::samples::Samples;

/// The values of λ to try: powers of two around the paper's 1, and 5 and values near it.
const CELLS: [f64; 10] = [
    0.015625, 0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0,
];
const FWZS11: [f64; 10] = [0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0];

/// The number of measured frames of a course, and of repetitions per frame.
const N_FRAMES: usize = 3;
const N_REPEATS: usize = 3;

/// Times against λ for every method with a λ, at every hardware place: the average over frames of
/// the fastest of a few repetitions.
pub(crate) fn sweep(
    course: &mut dyn Course,
    places: &[Place],
    is_quick: bool,
    cancel: &CancelToken,
) -> Result<Vec<Sweep>, Error> {
    let (n_frames, n_repeats) = match is_quick {
        true => (1, 1),
        false => (N_FRAMES, N_REPEATS),
    };
    let frames: Vec<usize> = spread(n_frames, course.n_frames()).collect();
    let mut sweeps = Vec::new();
    for place in places.iter().filter(|place| !place.is_software()) {
        for (method, lambdas) in [(Method::Cells, CELLS), (Method::Fwzs11, FWZS11)] {
            let mut points = Vec::new();
            let mut rows = Vec::new();
            for lambda in lambdas {
                let setup = Setup {
                    method,
                    place: place.clone(),
                    lambda,
                };
                let mut finder = setup.build()?;
                let mut times = Vec::new();
                for &frame in &frames {
                    course.pose(frame)?;
                    let (scene, bodies) = (course.scene(), course.bodies());
                    finder.find(scene, bodies, cancel, &mut rows)?;
                    let mut least = f64::INFINITY;
                    for _ in 0..n_repeats {
                        std::thread::sleep(Duration::from_millis(1));
                        least = least.min(finder.find(scene, bodies, cancel, &mut rows)?.ms);
                    }
                    times.push(least);
                }
                points.push((lambda, Samples::of(times).mean));
            }
            sweeps.push(Sweep {
                method,
                backend: place.name().to_owned(),
                points,
            });
        }
    }
    Ok(sweeps)
}

/// The contestants: at each place the library's methods and the peer, each grid with the paper's λ
/// and with the λ that was given or was the fastest. The flag marks this second λ.
pub(crate) fn contestants(
    places: &[Place],
    sweeps: &[Sweep],
    asked: Option<f64>,
) -> Vec<(Setup, bool)> {
    let mut setups = Vec::new();
    for place in places {
        for method in [Method::Clusters, Method::Cells, Method::Fwzs11] {
            let setup = |lambda| Setup {
                method,
                place: place.clone(),
                lambda,
            };
            let Some(papers) = papers_lambda(method) else {
                setups.push((setup(1.0), false));
                continue;
            };
            let best = match (method, asked) {
                (Method::Cells, Some(asked)) => Some(asked),
                _ => best(sweeps, method, place),
            };
            setups.push((setup(papers), best == Some(papers)));
            if let Some(best) = best.filter(|&best| best != papers) {
                setups.push((setup(best), true));
            }
        }
    }
    setups
}

/// The fastest λ of a method at a place.
fn best(sweeps: &[Sweep], method: Method, place: &Place) -> Option<f64> {
    let sweep = sweeps
        .iter()
        .find(|sweep| sweep.method == method && sweep.backend == place.name())?;
    let fastest = sweep.points.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(fastest.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_lambda_takes_part_beside_the_best() {
        let places = [Place::Cpu { n_threads: 1 }];
        let sweeps = [Sweep {
            method: Method::Cells,
            backend: "cpu".to_owned(),
            points: vec![(1.0, 3.0), (0.25, 2.0), (4.0, 9.0)],
        }];
        let lambdas = |asked| -> Vec<(f64, bool)> {
            let all = contestants(&places, &sweeps, asked);
            let cells = all
                .iter()
                .filter(|(setup, _)| setup.method == Method::Cells);
            cells
                .map(|(setup, chosen)| (setup.lambda, *chosen))
                .collect()
        };
        assert_eq!(lambdas(None), [(1.0, false), (0.25, true)]);
        assert_eq!(lambdas(Some(8.0)), [(1.0, false), (8.0, true)]);
        assert_eq!(lambdas(Some(1.0)), [(1.0, true)]);
    }
}
