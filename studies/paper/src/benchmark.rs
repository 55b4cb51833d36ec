//! Runs one benchmark, whatever moves its bodies: λ, contestants, oracle, picture.

use impinge::{Backend, Detector, Method, Settings};

use crate::contest::Contest;
use crate::control::Control;
use crate::course::Course;
use crate::error::Error;
use crate::finders::Place;
use crate::options::Options;
use crate::pictures::Painter;
use crate::report::{Moment, Scene};
use crate::samples::Samples;
use crate::sweep::{contestants, sweep};

/// The most elements for which the oracle runs: its quadratic cost is then about a second.
const MOST_FOR_ORACLE: usize = 40_000;

/// Runs all frames of a course with all contestants.
pub(crate) fn run(
    course: &mut dyn Course,
    options: &Options,
    places: &[Place],
    painter: &mut Painter,
    control: &Control<'_>,
) -> Result<Scene, Error> {
    let (name, n_frames) = (course.name().name(), course.n_frames());
    let sweep = sweep(course, places, options.is_quick, control.cancel)?;
    let setups = contestants(places, &sweep, options.lambda);
    let mut contest = Contest::new(setups, n_frames, options.is_quick)?;
    // The frame with the most pairs, and its pairs.
    let mut fullest: (usize, Vec<[u32; 4]>) = (0, Vec::new());
    for frame in 0..n_frames {
        course.pose(frame)?;
        let rows = contest.frame(frame, course.scene(), course.bodies(), control)?;
        if let Some(rows) = rows.filter(|rows| rows.len() >= fullest.1.len()) {
            fullest = (frame, rows.to_vec());
        }
        control.report(name, frame + 1, n_frames);
    }
    let moments = contest.course().to_vec();
    let picture = match painter.is_there() {
        true => {
            course.pose(course.picture_frame(&moments))?;
            let rows = find(course, Method::Clusters, control)?;
            painter.paint(course, &rows)?
        }
        false => None,
    };
    let (frame, rows) = fullest;
    course.pose(frame)?;
    let n_elements = course.n_elements();
    let is_small = n_elements.iter().sum::<usize>() <= MOST_FOR_ORACLE;
    let mut runs = contest.runs();
    if is_small && find(course, Method::Naive, control)? != rows {
        // The first contestant is wrong, and so are all that agree with it.
        runs.iter_mut().for_each(|run| run.n_frames_differing += 1);
    }
    let counts = |count: fn(&Moment) -> usize| {
        Samples::of_counts(moments.iter().map(|moment| count(moment) as u64))
    };
    Ok(Scene {
        name: name.to_owned(),
        mesh: course.mesh().to_owned(),
        motion: course.motion(),
        is_stand_in: course.is_stand_in(),
        kind: match course.name().is_volume() {
            true => "tetrahedron".to_owned(),
            false => "triangle".to_owned(),
        },
        n_elements,
        n_frames: moments.len(),
        n_pairs: counts(|moment| moment.n_pairs),
        n_colliding: counts(|moment| moment.n_colliding),
        hash: runs
            .first()
            .map_or_else(String::new, |run| run.hash.clone()),
        n_frames_of_oracle: usize::from(is_small),
        runs,
        sweep,
        picture,
        simulation_ms: None,
        course: moments,
    })
}

/// Finds the pairs in the current state of the scene.
fn find(
    course: &dyn Course,
    method: Method,
    control: &Control<'_>,
) -> Result<Vec<[u32; 4]>, Error> {
    let mut detector = Detector::new(Settings::new().method(method).backend(Backend::Cpu))?;
    detector.set_control(impinge::Control::new().cancel(control.cancel));
    let pairs = detector.detect(course.scene(), &course.query())?;
    Ok(pairs.rows().collect())
}
