//! The plots, each as SVG and as PNG. The font is embedded, so the machine needs no fonts.

mod bars;
mod curves;

use std::sync::Once;

use plotters::backend::BitMapBackend;
use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, DrawingBackend, IntoDrawingArea, RGBColor, SVGBackend};
use plotters::style::{FontStyle, register_font};

pub(crate) use bars::{Bars, Group, Height};
pub(crate) use curves::{Axis, Curve, Curves, Mark};

use crate::error::Error;
use crate::pictures::File;

/// Width and height of a plot in SVG pixels; the PNG has twice as many along each side.
const SIZE: (u32, u32) = (760, 420);

/// PNG pixels per SVG pixel, along each side.
const SCALE: u32 = 2;

/// The font family that is registered for measuring and for the PNG. SVG viewers use their own
/// font.
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

/// Something that can be drawn at a scale.
pub(crate) trait Plot {
    /// Draws on an area of `scale` times [`SIZE`].
    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        scale: u32,
    ) -> Result<(), Error>
    where
        B::ErrorType: 'static;
}

/// The plot as `name.svg` and `name.png`.
pub(crate) fn files(name: &str, plot: &impl Plot) -> Result<[File; 2], Error> {
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
    plot.draw(
        &SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(),
        1,
    )?;
    let (width, height) = (SIZE.0 * SCALE, SIZE.1 * SCALE);
    let mut pixels = vec![255; 3 * width as usize * height as usize];
    plot.draw(
        &BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area(),
        SCALE,
    )?;
    Ok([
        File {
            name: format!("{name}.svg"),
            bytes: svg.into_bytes(),
        },
        File {
            name: format!("{name}.png"),
            bytes: png(&pixels, width, height)?,
        },
    ])
}

/// RGB pixels as a PNG.
pub(crate) fn png(pixels: &[u8], width: u32, height: u32) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(pixels))
        .map_err(|error| Error::Plot(error.to_string()))?;
    Ok(bytes)
}

/// An error of the plotting crate.
fn failed(error: impl std::fmt::Display) -> Error {
    Error::Plot(error.to_string())
}
