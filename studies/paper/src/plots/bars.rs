//! Groups of bars, each bar with its number on top.

use plotters::chart::{ChartBuilder, LabelAreaPosition};
use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

use super::{AXIS, Area, FONT, GRID, Plot, failed};
use crate::error::Error;

/// The height of a bar and the text on top of it; `None` if it was not run.
pub(crate) type Height = Option<(f64, String)>;

/// A group's name, and the height of each kind of bar.
pub(crate) type Group = (String, Vec<Height>);

/// Groups of bars beside each other.
pub(crate) struct Bars {
    pub title: String,
    /// The meaning of the height.
    pub y: String,
    /// Names of the bars of a group, and their colours.
    pub kinds: Vec<(String, RGBColor)>,
    /// The groups.
    pub groups: Vec<Group>,
    /// A height to mark, and its label.
    pub mark: Option<(f64, String)>,
}

impl Plot for Bars {
    fn draw(&self, area: &Area<'_>) -> Result<(), Error> {
        let text = |size: u32| TextStyle::from((FONT, size).into_font()).color(&AXIS);
        area.fill(&WHITE).map_err(failed)?;
        let heights = self.groups.iter().flat_map(|(_, bars)| bars).flatten();
        let most = heights.fold(0.0, |most: f64, (height, _)| most.max(*height));
        let most = if most > 0.0 { 1.12 * most } else { 1.0 };
        // A group is one unit wide; its bars fill the middle of it.
        let end = self.groups.len().max(1) as f64;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, text(17))
            .margin(10)
            .margin_bottom(34)
            .set_label_area_size(LabelAreaPosition::Left, 58)
            .set_label_area_size(LabelAreaPosition::Bottom, 26)
            .build_cartesian_2d(0.0..end, 0.0..most)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .disable_x_axis()
            .light_line_style(WHITE)
            .bold_line_style(ShapeStyle::from(&GRID).stroke_width(1))
            .axis_style(ShapeStyle::from(&AXIS).stroke_width(1))
            .y_desc(&self.y)
            .y_label_style(text(12))
            .axis_desc_style(text(13))
            .y_labels(6)
            .draw()
            .map_err(failed)?;
        let mut labels = Vec::new();
        let width = 0.84 / self.kinds.len().max(1) as f64;
        for (group, (name, bars)) in self.groups.iter().enumerate() {
            for (kind, bar) in bars.iter().enumerate() {
                let Some((height, label)) = bar else { continue };
                let left = group as f64 + 0.08 + kind as f64 * width;
                let color = self.kinds.get(kind).map_or(AXIS, |(_, color)| *color);
                let corners = [(left + 0.04 * width, 0.0), (left + 0.96 * width, *height)];
                chart
                    .draw_series([Rectangle::new(corners, color.filled())])
                    .map_err(failed)?;
                let top = chart.backend_coord(&(left + 0.5 * width, *height));
                labels.push((label, (top.0, top.1 - 3)));
            }
            let foot = chart.backend_coord(&(group as f64 + 0.5, 0.0));
            let style = text(13).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(name.clone(), (foot.0, foot.1 + 7), style))
                .map_err(failed)?;
        }
        if let Some((height, _)) = &self.mark {
            let line = ShapeStyle::from(&AXIS).stroke_width(1);
            let [from, to] = [0.0, end].map(|x| chart.backend_coord(&(x, *height)));
            let dash = 6;
            for start in (from.0..to.0).step_by(2 * dash as usize) {
                let stop = (start + dash).min(to.0);
                area.draw(&PathElement::new([(start, from.1), (stop, to.1)], line))
                    .map_err(failed)?;
            }
        }
        // Numbers are drawn last, on white, because a line may pass behind them.
        let style = text(11).pos(Pos::new(HPos::Center, VPos::Bottom));
        for (label, at) in labels {
            let (wide, high) = area.estimate_text_size(label, &style).map_err(failed)?;
            let (half, high) = (wide as i32 / 2, high as i32);
            let corners = [(at.0 - half, at.1 - high), (at.0 + half, at.1 + 1)];
            area.draw(&Rectangle::new(corners, WHITE.filled()))
                .map_err(failed)?;
            area.draw(&Text::new(label.clone(), at, style.clone()))
                .map_err(failed)?;
        }
        let mut kinds: Vec<_> = self
            .kinds
            .iter()
            .map(|(name, color)| (name.as_str(), Some(*color)))
            .collect();
        kinds.extend(self.mark.iter().map(|(_, name)| (name.as_str(), None)));
        legend(area, &kinds)
    }
}

/// Names and colours in a row below the plot; without a colour, a dashed line.
pub(super) fn legend(area: &Area<'_>, kinds: &[(&str, Option<RGBColor>)]) -> Result<(), Error> {
    let style = TextStyle::from((FONT, 12).into_font()).color(&AXIS);
    let style = style.pos(Pos::new(HPos::Left, VPos::Center));
    let width = |name: &str| {
        area.estimate_text_size(name, &style)
            .map(|(width, _)| width as i32)
    };
    let mut widths = Vec::with_capacity(kinds.len());
    for (name, _) in kinds {
        widths.push(16 + width(name).map_err(failed)?);
    }
    let gap = 22;
    let total: i32 = widths.iter().sum::<i32>() + gap * (kinds.len() as i32 - 1).max(0);
    let (all, height) = area.dim_in_pixel();
    let mut x = (all as i32 - total) / 2;
    let y = height as i32 - 20;
    for ((name, color), width) in kinds.iter().zip(widths) {
        let corners = [(x, y - 5), (x + 10, y + 5)];
        match color {
            Some(color) => area
                .draw(&Rectangle::new(corners, color.filled()))
                .map_err(failed)?,
            None => {
                let line = ShapeStyle::from(&AXIS).stroke_width(1);
                for start in [x - 5, x + 3] {
                    let dash = [(start, y), (start + 5, y)];
                    area.draw(&PathElement::new(dash, line)).map_err(failed)?;
                }
            }
        }
        area.draw(&Text::new((*name).to_owned(), (x + 16, y), style.clone()))
            .map_err(failed)?;
        x += width + gap;
    }
    Ok(())
}
