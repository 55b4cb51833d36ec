//! The plots of a report: figures 5 and 7 of the paper, and two of our own.

use plotters::style::RGBColor;

use crate::document::{density, ms};
use crate::error::Error;
use crate::pictures::File;
use crate::plots::{Axis, Bars, COLORS, Curve, Curves, Group, Height, Mark, file};
use crate::published;
use crate::report::{Method, Report, Run, Scene};

/// Names of the plots' files.
pub(crate) const COMPARISON: [&str; 2] = ["figure-5-cpu", "figure-5-gpu"];
pub(crate) const TABLE_SIZES: &str = "figure-7";
pub(crate) const LAMBDA: [(&str, Method, bool); 4] = [
    ("lambda-cells-cpu", Method::Cells, false),
    ("lambda-fwzs11-cpu", Method::Fwzs11, false),
    ("lambda-cells-gpu", Method::Cells, true),
    ("lambda-fwzs11-gpu", Method::Fwzs11, true),
];
pub(crate) const STEPS: &str = "steps";

/// All plots for which there is data.
pub(crate) fn plots(report: &Report) -> Result<Vec<File>, Error> {
    let mut all = Vec::new();
    for (name, is_gpu) in COMPARISON.into_iter().zip([false, true]) {
        if let Some(bars) = comparison(report, is_gpu) {
            all.push(file(name, &bars)?);
        }
    }
    for (name, method, is_gpu) in LAMBDA {
        if let Some(curves) = lambda(report, method, is_gpu) {
            all.push(file(name, &curves)?);
        }
    }
    if let Some(curves) = table_sizes(report) {
        all.push(file(TABLE_SIZES, &curves)?);
    }
    if let Some(curves) = steps(report) {
        all.push(file(STEPS, &curves)?);
    }
    Ok(all)
}

/// A kind of bar in figure 5, and its contestant.
struct Bar {
    name: &'static str,
    color: RGBColor,
    of: fn(&Scene, bool) -> Option<&Run>,
}

const BARS: [Bar; 5] = [
    Bar {
        name: "[FWZS11], λ = 5",
        color: COLORS[0],
        of: |scene, is_gpu| scene.run(Method::Fwzs11, is_gpu),
    },
    Bar {
        name: "[FWZS11], best λ",
        color: RGBColor(0xc4, 0xc4, 0xc4),
        of: |scene, is_gpu| scene.best(Method::Fwzs11, is_gpu),
    },
    Bar {
        name: "Cells, λ = 1",
        color: COLORS[1],
        of: |scene, is_gpu| scene.run(Method::Cells, is_gpu),
    },
    Bar {
        name: "Cells, best λ",
        color: COLORS[2],
        of: |scene, is_gpu| scene.best(Method::Cells, is_gpu),
    },
    Bar {
        name: "Clusters",
        color: COLORS[3],
        of: |scene, is_gpu| scene.run(Method::Clusters, is_gpu),
    },
];

fn comparison(report: &Report, is_gpu: bool) -> Option<Bars> {
    let scenes = report.surfaces.iter();
    let groups: Vec<Group> = scenes
        .filter_map(|scene| {
            let whole = scene.run(Method::Fwzs11, is_gpu)?.ms.median;
            let bar = |bar: &Bar| {
                let median = (bar.of)(scene, is_gpu)?.ms.median;
                Some((median / whole, ms(median)))
            };
            Some((scene.name.clone(), BARS.iter().map(bar).collect()))
        })
        .collect();
    let place = match (is_gpu, &report.adapter) {
        (true, Some(adapter)) => &adapter.name,
        _ => &report.machine.cpu,
    };
    // A kind that no scene has gets no space, such as the best λ if only the paper's λ was run.
    let is_there = |kind: &usize| groups.iter().any(|(_, bars)| bars[*kind].is_some());
    let kinds: Vec<usize> = (0..BARS.len()).filter(is_there).collect();
    let chosen = |mut bars: Vec<Height>| kinds.iter().map(|&kind| bars[kind].take()).collect();
    (!groups.is_empty()).then(|| Bars {
        title: format!("Time per frame on {place}"),
        y: "[FWZS11] with λ = 5 is 1; numbers: ms".to_owned(),
        kinds: kinds
            .iter()
            .map(|&kind| (BARS[kind].name.to_owned(), BARS[kind].color))
            .collect(),
        groups: groups
            .into_iter()
            .map(|(name, bars)| (name, chosen(bars)))
            .collect(),
        mark: Some((
            1.0 / published::CLAIMED_SPEED_UP,
            "the paper's claim".to_owned(),
        )),
    })
}

/// Time against λ.
fn lambda(report: &Report, method: Method, is_gpu: bool) -> Option<Curves> {
    let sweeps: Vec<_> = report
        .surfaces
        .iter()
        .filter_map(|scene| {
            let sweep = scene.sweep(method, is_gpu)?;
            Some((scene.name.clone(), sweep.points.clone()))
        })
        .collect();
    let all = || sweeps.iter().flat_map(|(_, points)| points.iter().copied());
    let mut lambdas: Vec<f64> = all().map(|(lambda, _)| lambda).collect();
    lambdas.sort_unstable_by(f64::total_cmp);
    lambdas.dedup();
    let title = match method {
        Method::Fwzs11 => "[FWZS11]",
        _ => "Two levels (Cells)",
    };
    (lambdas.len() > 1).then(|| Curves {
        title: format!(
            "{title} on the {}: time per frame against λ",
            if is_gpu { "GPU" } else { "CPU" }
        ),
        x: Axis {
            name: "λ".to_owned(),
            is_log: true,
            ticks: lambdas.iter().map(|x| (*x, density(*x))).collect(),
        },
        y: Axis::log("ms", all().map(|(_, ms)| ms)),
        curves: sweeps
            .iter()
            .zip(COLORS.iter().skip(1))
            .map(|((name, points), color)| Curve {
                name: name.clone(),
                color: *color,
                points: points.clone(),
                has_dots: true,
            })
            .collect(),
        marks: Vec::new(),
    })
}

fn table_sizes(report: &Report) -> Option<Curves> {
    let sizes = report.table_sizes.as_ref()?;
    let whole = sizes.n_elements as f64;
    let curve = |name: &str, color, rate: &dyn Fn(&crate::report::TableSize) -> f64| Curve {
        name: name.to_owned(),
        color,
        points: sizes
            .points
            .iter()
            .map(|point| (point.table_size as f64 / whole, rate(point)))
            .collect(),
        has_dots: true,
    };
    let most = sizes.points.iter().map(|point| point.missing_rate);
    let papers = published::duplicates(&sizes.scene);
    // Sizes are the number of elements times powers of two.
    let tick = |power: i32| {
        let label = match power {
            ..0 => format!("1/{}", 1 << -power),
            _ => (1 << power).to_string(),
        };
        (2f64.powi(power), label)
    };
    Some(Curves {
        title: format!("Hash table, {}: losses against its size", sizes.scene),
        x: Axis {
            name: "slots of the table / elements of both bodies".to_owned(),
            is_log: true,
            ticks: (-3..=5).map(tick).collect(),
        },
        y: Axis::linear(
            "missing rate of colliding triangles",
            most.fold(0.0, f64::max),
        ),
        curves: vec![
            curve("hash table, as in the paper", COLORS[3], &|p| {
                p.missing_rate
            }),
            curve("hash table after box tests", COLORS[1], &|p| {
                p.missing_rate_with_box_test
            }),
            curve("owner rule, no table", COLORS[4], &|_| 0.0),
        ],
        marks: papers
            .map(|papers| Mark {
                at: (1.0, papers.missing_rate),
                name: format!("the paper: {}", papers.missing_rate),
            })
            .into_iter()
            .collect(),
    })
}

/// Colliding tetrahedra step by step.
fn steps(report: &Report) -> Option<Curves> {
    let scenes = &report.volumes;
    let last = scenes.iter().filter_map(|scene| scene.course.last());
    let n_steps = last.map(|moment| moment.frame + 1).max()?;
    let most = scenes.iter().map(|scene| scene.n_colliding.max);
    Some(Curves {
        title: "Solids dropped on each other: colliding tetrahedra".to_owned(),
        x: Axis::linear("step", n_steps as f64),
        y: Axis::linear("tetrahedra of both bodies", most.fold(0.0, f64::max)),
        curves: scenes
            .iter()
            .zip(COLORS.iter().skip(1))
            .map(|(scene, color)| Curve {
                name: scene.name.clone(),
                color: *color,
                points: scene
                    .course
                    .iter()
                    .map(|moment| (moment.frame as f64, moment.n_colliding as f64))
                    .collect(),
                has_dots: false,
            })
            .collect(),
        marks: Vec::new(),
    })
}
