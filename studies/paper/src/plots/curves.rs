//! Curves over one axis, linear or logarithmic.

use plotters::chart::{ChartBuilder, LabelAreaPosition};
use plotters::element::{Circle, PathElement, Text};
use plotters::series::LineSeries;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

use super::bars::legend;
use super::{AXIS, Area, FONT, GRID, Plot, failed};
use crate::error::Error;

/// An axis and its labels.
pub(crate) struct Axis {
    pub name: String,
    /// Whether the axis is logarithmic.
    pub is_log: bool,
    /// Labelled values in ascending order; the first and the last one are the ends of the axis.
    pub ticks: Vec<(f64, String)>,
}

/// Points joined by lines.
pub(crate) struct Curve {
    pub name: String,
    pub color: RGBColor,
    pub points: Vec<(f64, f64)>,
    /// Whether each point has a dot.
    pub has_dots: bool,
}

/// A point to mark, and its label.
pub(crate) struct Mark {
    pub at: (f64, f64),
    pub name: String,
}

/// Curves over one axis.
pub(crate) struct Curves {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub curves: Vec<Curve>,
    pub marks: Vec<Mark>,
}

impl Axis {
    /// A linear axis from 0 to at least `most`, in about six steps of 1, 2 or 5 times a power of
    /// ten.
    pub fn linear(name: &str, most: f64) -> Self {
        let most = if most > 0.0 { most } else { 1.0 };
        let power = 10f64.powf((most / 6.0).log10().floor());
        let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
        let step = steps
            .into_iter()
            .find(|step| most / step <= 6.0)
            .unwrap_or(steps[3]);
        let n_decimals = (-step.log10().floor()).max(0.0) as usize;
        let n_steps = (most / step - 1e-9).ceil() as usize;
        let ticks = (0..=n_steps.max(1)).map(|k| {
            let value = k as f64 * step;
            (value, format!("{value:.n_decimals$}"))
        });
        Axis {
            name: name.to_owned(),
            is_log: false,
            ticks: ticks.collect(),
        }
    }

    /// A logarithmic axis that contains all values above 0, with labels at 1, 2 and 5 times powers
    /// of ten.
    pub fn log(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .filter(|value| *value > 0.0)
            .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), value| {
                (low.min(value), high.max(value))
            });
        let (low, high) = if low <= high {
            (low, high)
        } else {
            (1.0, 10.0)
        };
        let first = low.log10().floor() as i32;
        let all = (first..first + 30).flat_map(|power| {
            let unit = 10f64.powi(power);
            [1.0, 2.0, 5.0].map(|digit| (digit * unit, (-power).max(0) as usize))
        });
        let mut ticks: Vec<(f64, String)> = Vec::new();
        for (value, n_decimals) in all {
            if value * 1.0001 < low {
                ticks.clear();
            }
            ticks.push((value, format!("{value:.n_decimals$}")));
            if value * 1.0001 >= high && ticks.len() > 1 {
                break;
            }
        }
        Axis {
            name: name.to_owned(),
            is_log: true,
            ticks,
        }
    }

    /// The position of a value on the drawn axis.
    fn place(&self, value: f64) -> f64 {
        match self.is_log {
            true => value.log10(),
            false => value,
        }
    }

    fn ends(&self) -> (f64, f64) {
        let end = |tick: Option<&(f64, String)>, otherwise| {
            tick.map_or(otherwise, |(value, _)| self.place(*value))
        };
        (end(self.ticks.first(), 0.0), end(self.ticks.last(), 1.0))
    }
}

impl Plot for Curves {
    fn draw(&self, area: &Area<'_>) -> Result<(), Error> {
        let text = |size: u32| TextStyle::from((FONT, size).into_font()).color(&AXIS);
        let line = |color: &RGBColor, width: u32| ShapeStyle::from(color).stroke_width(width);
        area.fill(&WHITE).map_err(failed)?;
        let ((x0, x1), (y0, y1)) = (self.x.ends(), self.y.ends());
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, text(17))
            .margin(10)
            .margin_right(24)
            .margin_bottom(34)
            .set_label_area_size(LabelAreaPosition::Left, 66)
            .set_label_area_size(LabelAreaPosition::Bottom, 44)
            .build_cartesian_2d(x0..x1, y0..y1)
            .map_err(failed)?;
        let pixel = |at: (f64, f64)| chart.backend_coord(&(self.x.place(at.0), self.y.place(at.1)));
        let [low, high] = [(x0, y0), (x1, y1)].map(|corner| chart.backend_coord(&corner));
        for (value, label) in &self.x.ticks {
            let x = chart.backend_coord(&(self.x.place(*value), y0)).0;
            area.draw(&PathElement::new([(x, low.1), (x, high.1)], line(&GRID, 1)))
                .map_err(failed)?;
            let style = text(12).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(label.clone(), (x, low.1 + 6), style))
                .map_err(failed)?;
        }
        for (value, label) in &self.y.ticks {
            let y = chart.backend_coord(&(x0, self.y.place(*value))).1;
            area.draw(&PathElement::new([(low.0, y), (high.0, y)], line(&GRID, 1)))
                .map_err(failed)?;
            let style = text(12).pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(label.clone(), (low.0 - 6, y), style))
                .map_err(failed)?;
        }
        let frame = [(low.0, high.1), (low.0, low.1), (high.0, low.1)];
        area.draw(&PathElement::new(frame, line(&AXIS, 1)))
            .map_err(failed)?;
        let style = text(13).pos(Pos::new(HPos::Center, VPos::Top));
        let below = ((low.0 + high.0) / 2, low.1 + 24);
        area.draw(&Text::new(self.x.name.clone(), below, style))
            .map_err(failed)?;
        let turned = (FONT, 13)
            .into_font()
            .transform(plotters::style::FontTransform::Rotate270);
        let style = TextStyle::from(turned)
            .color(&AXIS)
            .pos(Pos::new(HPos::Center, VPos::Top));
        let beside = (8, (low.1 + high.1) / 2);
        area.draw(&Text::new(self.y.name.clone(), beside, style))
            .map_err(failed)?;
        let marks: Vec<((i32, i32), &str)> = self
            .marks
            .iter()
            .map(|mark| (pixel(mark.at), mark.name.as_str()))
            .collect();
        for curve in &self.curves {
            let points = curve
                .points
                .iter()
                .map(|&(x, y)| (self.x.place(x), self.y.place(y)));
            let points: Vec<(f64, f64)> = points.collect();
            chart
                .draw_series(LineSeries::new(
                    points.iter().copied(),
                    line(&curve.color, 2),
                ))
                .map_err(failed)?;
            if curve.has_dots {
                let dots = points
                    .iter()
                    .map(|&at| Circle::new(at, 3, curve.color.filled()));
                chart.draw_series(dots).map_err(failed)?;
            }
        }
        for (at, name) in marks {
            area.draw(&Circle::new(at, 5, line(&AXIS, 2)))
                .map_err(failed)?;
            let style = text(12).pos(Pos::new(HPos::Left, VPos::Bottom));
            let beside = (at.0 + 8, at.1 - 4);
            area.draw(&Text::new(name.to_owned(), beside, style))
                .map_err(failed)?;
        }
        let kinds: Vec<_> = self
            .curves
            .iter()
            .map(|curve| (curve.name.as_str(), Some(curve.color)))
            .collect();
        legend(area, &kinds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_hold_all_values() {
        assert_eq!(
            labels(&Axis::linear("", 0.11)),
            ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10", "0.12"]
        );
        assert_eq!(
            labels(&Axis::linear("", 3000.0)),
            ["0", "500", "1000", "1500", "2000", "2500", "3000"]
        );
        assert_eq!(
            labels(&Axis::linear("", 0.0)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(&Axis::log("", [0.3, 7.0])),
            ["0.2", "0.5", "1", "2", "5", "10"]
        );
        assert_eq!(labels(&Axis::log("", [2.0])), ["1", "2"]);
        assert_eq!(labels(&Axis::log("", [0.03, 0.04])), ["0.02", "0.05"]);
        assert_eq!(labels(&Axis::log("", [])), ["1", "2", "5", "10"]);
    }
}
