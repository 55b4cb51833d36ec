//! The plots, as SVG. The font that text is measured with is embedded, so the machine needs no
//! fonts.

mod bars;
mod curves;

use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, IntoDrawingArea, RGBColor, SVGBackend};
use plotters::style::{FontStyle, register_font};

pub(crate) use bars::{Bars, Group, Height};
pub(crate) use curves::{Axis, Curve, Curves, Mark};

use crate::error::Error;
use crate::pictures::File;

/// Width and height of a plot in pixels.
const SIZE: (u32, u32) = (760, 420);

/// The font family that is registered for measuring. Viewers use their own font.
const FONT: &str = "sans-serif";

/// Colours that also differ in lightness, so that they are readable in grey and by the colour-blind
/// (Okabe & Ito 2008).
pub(crate) const COLORS: [RGBColor; 6] = [
    RGBColor(0x8a, 0x8a, 0x8a),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
];

/// Grey of axes and grids.
const AXIS: RGBColor = RGBColor(0x44, 0x44, 0x44);
const GRID: RGBColor = RGBColor(0xe2, 0xe2, 0xe2);

/// Where plots are drawn.
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Something that can be drawn.
pub(crate) trait Plot {
    /// Draws on an area of [`SIZE`].
    fn draw(&self, area: &Area<'_>) -> Result<(), Error>;
}

/// The plot as `name.svg`.
pub(crate) fn file(name: &str, plot: &impl Plot) -> Result<File, Error> {
    static REGISTERED: Once = Once::new();
    REGISTERED.call_once(|| {
        for (style, bytes) in [
            (FontStyle::Normal, dejavu::sans::regular()),
            (FontStyle::Bold, dejavu::sans::bold()),
        ] {
            // If the font cannot be read, drawing the first text returns an error.
            let _ = register_font(FONT, style, bytes);
        }
    });
    let mut svg = String::new();
    plot.draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area())?;
    Ok(File {
        name: format!("{name}.svg"),
        bytes: svg.into_bytes(),
    })
}

/// An error of the plotting crate.
fn failed(error: impl std::fmt::Display) -> Error {
    Error::Plot(error.to_string())
}
