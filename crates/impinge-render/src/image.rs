//! The picture as pixels, and as a file.

use std::fs;
use std::io;
use std::path::Path;

use crate::error::Error;

/// Opaque sRGB pixels.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[u8; 4]>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({} x {})", self.width, self.height)
    }
}

impl Image {
    /// A black image.
    pub(crate) fn new([width, height]: [u32; 2]) -> Self {
        Image {
            width,
            height,
            pixels: vec![[0, 0, 0, 255]; width as usize * height as usize],
        }
    }

    /// The number of pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// The number of rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green, blue and alpha (255) of every pixel, row after row from the top.
    pub fn pixels(&self) -> &[[u8; 4]] {
        &self.pixels
    }

    /// The pixels of a row from column `x` on.
    pub(crate) fn row_mut(&mut self, x: u32, y: u32) -> &mut [[u8; 4]] {
        let (width, x, y) = (self.width as usize, x as usize, y as usize);
        &mut self.pixels[y * width..][x..width]
    }

    /// The image as the bytes of a PNG file: 8 bits per channel, no alpha.
    ///
    /// # Errors
    /// The PNG format cannot hold the image.
    pub fn to_png(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(png::Compression::High);
        let rgb: Vec<u8> = self
            .pixels
            .iter()
            .flat_map(|&[r, g, b, _]| [r, g, b])
            .collect();
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&rgb)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Writes the image as a PNG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let written = self.to_png().and_then(|bytes| fs::write(path, bytes));
        written.map_err(|source| Error::Write {
            path: path.to_owned(),
            source,
        })
    }
}
