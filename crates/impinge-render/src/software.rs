//! Draws a picture on the CPU, without a GPU or a driver: the passes and the light of the shaders,
//! written once more.
//!
//! Like the renderer on a device it works in tiles with a margin as wide as the reach of occlusion,
//! so that memory beyond the faces is bounded. Threads share the rows of a tile. Every pixel is
//! computed by one thread, in the order of the faces, so their number changes no byte.

use std::thread;

use crate::corners::{Corner, chunks};
use crate::error::Error;
use crate::image::Image;
use crate::picture::Picture;
use crate::view::{Frame, View};

/// Width and height of a tile without its margins. With them it takes up to 300 MB.
const TILE: u32 = 1536;
/// The largest width and height of a picture: that of most GPUs.
const MOST: u32 = 16_384;
/// The largest distance between a hollow and a face that darkens it, as for the renderer on a
/// device: as a share of the scene's longest half extent, and in pixels.
pub(crate) const REACH: f32 = 0.16;
pub(crate) const REACH_PIXELS: u32 = 254;
/// The radius of the blur of occlusion, in pixels.
pub(crate) const BLUR: u32 = 2;
/// Where a pixel is sampled: the pattern of GPUs for four samples.
const SAMPLES: [[f64; 2]; 4] = [
    [0.375, 0.125],
    [0.875, 0.375],
    [0.125, 0.625],
    [0.625, 0.875],
];
/// By how many units in the last place of a depth faces that show through are nearer.
const RAISED: f32 = 8.0;
/// How many places around a pixel are looked at for occlusion.
const N_PLACES: i32 = 20;

impl Picture {
    /// Draws the picture on the CPU. It looks like that of a `Renderer`, up to the rounding of
    /// colours, and is the same on every machine with the same mathematical functions.
    ///
    /// # Errors
    /// A position that is not finite or an index out of range; a size of 0 or above 16,384; a
    /// setting out of its range.
    pub fn draw(&self) -> Result<Image, Error> {
        self.draw_in_tiles(TILE)
    }

    /// The same with tiles of another size. For tests.
    #[doc(hidden)]
    pub fn draw_in_tiles(&self, tile: u32) -> Result<Image, Error> {
        let [width, height] = self.size;
        if width.min(height) == 0 || width.max(height) > MOST {
            return Err(Error::Size {
                given: self.size,
                allowed: format!("1 x 1 to {MOST} x {MOST}"),
            });
        }
        self.check()?;
        let frame = Frame::of(self);
        let lens = Lens {
            view: View::of(self, &frame),
            size: self.size.map(f64::from),
        };
        let faces = |shows_through: bool| {
            let mut faces = Vec::new();
            let wanted = |face: &crate::Face| face.shows_through == shows_through;
            chunks(self, &frame, 1 << 16, wanted, |corners| {
                faces.extend_from_slice(corners);
            });
            faces
        };
        let (plain, raised) = (faces(false), faces(true));
        let margin = REACH_PIXELS.min(height / 4) + BLUR;
        let mut image = Image::new(self.size);
        for row in (0..height).step_by(tile as usize) {
            for column in (0..width).step_by(tile as usize) {
                let begin = [column, row];
                let end: [u32; 2] =
                    std::array::from_fn(|k| begin[k].saturating_add(tile).min(self.size[k]));
                let drawn = begin.map(|x| x.saturating_sub(margin));
                let size = std::array::from_fn(|k| (end[k] + margin).min(self.size[k]) - drawn[k]);
                let tile = Tile {
                    picture: self,
                    lens: &lens,
                    begin: drawn,
                    size,
                    reach: (margin - BLUR) as f32,
                };
                let pixels = tile.draw(&plain, &raised);
                for y in begin[1]..end[1] {
                    let from = tile.index(begin[0] - drawn[0], y - drawn[1]);
                    let n = (end[0] - begin[0]) as usize;
                    image.row_mut(begin[0], y)[..n].copy_from_slice(&pixels[from..][..n]);
                }
            }
        }
        Ok(image)
    }
}

/// A corner of a face as the viewer sees it.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    /// The eye is at 0 and looks along -z.
    seen: [f64; 3],
    normal: [f64; 3],
}

/// A corner in the picture.
#[derive(Debug, Clone, Copy)]
struct Projected {
    /// Column, row and depth.
    at: [f64; 3],
    /// 1 through the distance from the eye.
    nearness: f64,
    vertex: Vertex,
}

/// The view and the size of the whole picture.
#[derive(Debug)]
struct Lens {
    view: View,
    size: [f64; 2],
}

impl Lens {
    fn vertex(&self, corner: &Corner) -> Vertex {
        let ([x, y, z], n) = (corner.position.map(f64::from), corner.normal());
        let axes = self.view.axes;
        Vertex {
            seen: axes.map(|[a, b, c, d]| a * x + b * y + c * z + d),
            normal: axes.map(|[a, b, c, _]| a * n[0] + b * n[1] + c * n[2]),
        }
    }

    /// The depth of a point before it is divided by its distance: 0 or more beyond the nearest
    /// visible distance.
    fn clip_depth(&self, vertex: &Vertex) -> f64 {
        self.view.projection[2] * vertex.seen[2] + self.view.projection[3]
    }

    /// The part of a face that is not too near to the eye: a convex polygon.
    fn clip(&self, face: [Vertex; 3]) -> ([Vertex; 4], usize) {
        let mut kept = [face[0]; 4];
        let mut n_kept = 0;
        let mut keep = |vertex| {
            kept[n_kept] = vertex;
            n_kept += 1;
        };
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            let (depth_a, depth_b) = (self.clip_depth(&a), self.clip_depth(&b));
            if depth_a >= 0.0 {
                keep(a);
            }
            if (depth_a >= 0.0) != (depth_b >= 0.0) {
                let part = depth_a / (depth_a - depth_b);
                let mix = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
                    std::array::from_fn(|k| a[k] + part * (b[k] - a[k]))
                };
                keep(Vertex {
                    seen: mix(a.seen, b.seen),
                    normal: mix(a.normal, b.normal),
                });
            }
        }
        (kept, n_kept)
    }

    fn project(&self, vertex: Vertex) -> Projected {
        let [x, y, z] = vertex.seen;
        let [px, py, ..] = self.view.projection;
        let nearness = match self.view.is_perspective {
            true => -z.recip(),
            false => 1.0,
        };
        let [width, height] = self.size;
        Projected {
            at: [
                0.5 * (1.0 + px * x * nearness) * width,
                0.5 * (1.0 - py * y * nearness) * height,
                self.clip_depth(&vertex) * nearness,
            ],
            nearness,
            vertex,
        }
    }

    /// The light that a face sends from a point to the viewer: see `surface.wgsl`.
    fn light(&self, at: &Vertex, is_front: bool, color: [f32; 3]) -> [f32; 3] {
        let n = at.normal.map(|x| x as f32);
        let outward = if dot(n, n) > 1e-8 {
            unit(n)
        } else {
            // Opposite normals of corners may cancel when interpolated.
            [0.0, 0.0, 1.0]
        };
        let n = if is_front {
            outward
        } else {
            outward.map(|x| -x)
        };
        let to_eye = match self.view.is_perspective {
            true => unit(at.seen.map(|x| -x as f32)),
            false => [0.0, 0.0, 1.0],
        };
        let key = unit([-0.5, 0.65, 0.8]);
        let fill = unit([0.8, 0.1, 0.5]);
        let up = 0.5 + 0.5 * dot(n, self.view.sky.map(|x| x as f32));
        let from_sky = 0.2 + (0.46 - 0.2) * up;
        let from_key = 0.78 * ((dot(n, key) + 0.15) / 1.15).max(0.0);
        let from_fill = 0.16 * dot(n, fill).max(0.0);
        let half_way = unit(std::array::from_fn(|k| key[k] + to_eye[k]));
        let gloss = 0.05 * dot(n, half_way).max(0.0).powi(40);
        color.map(|x| x * (from_sky + from_key + from_fill) + gloss)
    }
}

/// The samples of a pixel.
#[derive(Debug, Clone, Copy)]
struct Samples {
    depth: [f32; 4],
    light: [[f32; 3]; 4],
}

const NOTHING: Samples = Samples {
    depth: [1.0; 4],
    light: [[0.0; 3]; 4],
};

impl Samples {
    /// The mean light, and the share of samples that show a face.
    fn resolved(&self) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for (depth, [r, g, b]) in self.depth.iter().zip(self.light) {
            if *depth < 1.0 {
                for (sum, x) in sum.iter_mut().zip([r, g, b, 1.0]) {
                    *sum += x;
                }
            }
        }
        sum.map(|x| 0.25 * x)
    }
}

/// A part of a picture, with its margin.
struct Tile<'a> {
    picture: &'a Picture,
    lens: &'a Lens,
    begin: [u32; 2],
    size: [u32; 2],
    /// The largest radius of occlusion in pixels.
    reach: f32,
}

impl Tile<'_> {
    fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.size[0] as usize + x as usize
    }

    fn draw(&self, plain: &[Corner], raised: &[Corner]) -> Vec<[u8; 4]> {
        let n = self.index(0, self.size[1]);
        let mut samples = vec![NOTHING; n];
        self.by_rows(&mut samples, |first, rows| {
            self.faces(plain, 0.0, first, rows);
            self.faces(raised, RAISED, first, rows);
        });
        let scene: Vec<[f32; 4]> = samples.iter().map(Samples::resolved).collect();
        let depths: Vec<f32> = samples.iter().map(|pixel| pixel.depth[0]).collect();
        let through: Option<Vec<[f32; 4]>> = (!raised.is_empty()).then(|| {
            samples.fill(NOTHING);
            self.by_rows(&mut samples, |first, rows| {
                self.faces(raised, RAISED, first, rows);
            });
            samples.iter().map(Samples::resolved).collect()
        });
        drop(samples);
        let mut occlusion = vec![[1.0, 0.0]; n];
        if self.picture.occlusion > 0.0 {
            self.by_rows(&mut occlusion, |first, rows| {
                self.each(first, rows, |x, y| self.occlusion(&depths, x, y));
            });
        }
        let mut pixels = vec![[0; 4]; n];
        self.by_rows(&mut pixels, |first, rows| {
            self.each(first, rows, |x, y| {
                let ix = self.index(x, y);
                let hidden = through.as_ref().map_or([0.0; 4], |through| through[ix]);
                self.composed(scene[ix], hidden, self.brightness(&occlusion, x, y), y)
            });
        });
        pixels
    }

    /// Has threads work on bands of rows; `work` gets the number of its first row.
    fn by_rows<T: Send>(&self, pixels: &mut [T], work: impl Fn(u32, &mut [T]) + Sync) {
        let n_threads = thread::available_parallelism().map_or(1, usize::from);
        let n_rows = self.size[1]
            .div_ceil(n_threads.try_into().unwrap_or(u32::MAX))
            .max(1);
        let work = &work;
        thread::scope(|scope| {
            let bands = pixels.chunks_mut(self.index(0, n_rows));
            for (first, band) in (0..).step_by(n_rows as usize).zip(bands) {
                scope.spawn(move || work(first, band));
            }
        });
    }

    /// Sets every pixel of a band.
    fn each<T>(&self, first: u32, band: &mut [T], at: impl Fn(u32, u32) -> T) {
        for (y, row) in (first..).zip(band.chunks_mut(self.size[0] as usize)) {
            for (x, pixel) in (0..).zip(row) {
                *pixel = at(x, y);
            }
        }
    }

    /// Draws faces into a band of rows.
    fn faces(&self, corners: &[Corner], raised: f32, first: u32, band: &mut [Samples]) {
        for face in corners.as_chunks::<3>().0 {
            let (polygon, n) = self.lens.clip(face.each_ref().map(|c| self.lens.vertex(c)));
            let color = face[0].color().map(linear);
            for k in 2..n {
                let fan = [polygon[0], polygon[k - 1], polygon[k]];
                self.face(
                    fan.map(|v| self.lens.project(v)),
                    color,
                    raised,
                    first,
                    band,
                );
            }
        }
    }

    fn face(
        &self,
        mut corners: [Projected; 3],
        color: [f32; 3],
        raised: f32,
        first: u32,
        band: &mut [Samples],
    ) {
        let width = self.size[0] as usize;
        for corner in &mut corners {
            corner.at[0] -= f64::from(self.begin[0]);
            corner.at[1] -= f64::from(self.begin[1]) + f64::from(first);
        }
        let [a, b, c] = corners.map(|corner| corner.at);
        // Rows go down, so a face that is counter-clockwise for the viewer has a negative area
        // here.
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let range = |k: usize, n: usize| {
            let low = a[k].min(b[k]).min(c[k]).floor().max(0.0);
            let high = a[k].max(b[k]).max(c[k]).ceil().min(n as f64);
            // Both are between 0 and the number of columns or rows, or the range is empty.
            low as usize..high.max(0.0) as usize
        };
        let (columns, rows) = (range(0, width), range(1, band.len() / width));
        let deepest = a[2].max(b[2]).max(c[2]) as f32;
        let bias = raised * f32::EPSILON * exponent(deepest);
        // The weights of the corners at a point: linear in its column and row.
        let weights = |x: f64, y: f64| {
            let of = |p: [f64; 3], q: [f64; 3]| {
                ((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area
            };
            [of(b, c), of(c, a), of(a, b)]
        };
        for y in rows {
            for x in columns.clone() {
                let pixel = &mut band[y * width + x];
                let mut light = None;
                for (sample, [right, down]) in SAMPLES.into_iter().enumerate() {
                    let [u, v, w] = weights(x as f64 + right, y as f64 + down);
                    if u < 0.0 || v < 0.0 || w < 0.0 {
                        continue;
                    }
                    let depth = (u * a[2] + v * b[2] + w * c[2]) as f32 - bias;
                    if depth > pixel.depth[sample] || depth >= 1.0 {
                        continue;
                    }
                    pixel.depth[sample] = depth;
                    // One colour per pixel, at its middle.
                    pixel.light[sample] = *light.get_or_insert_with(|| {
                        let middle = weights(x as f64 + 0.5, y as f64 + 0.5);
                        self.lens.light(&mean(&corners, middle), area < 0.0, color)
                    });
                }
            }
        }
    }

    /// The position of the face in this pixel, relative to the eye.
    fn seen_at(&self, depths: &[f32], x: i64, y: i64) -> Option<[f32; 3]> {
        let x = u32::try_from(x).ok().filter(|x| *x < self.size[0])?;
        let y = u32::try_from(y).ok().filter(|y| *y < self.size[1])?;
        let depth = depths[self.index(x, y)];
        if depth >= 1.0 {
            return None;
        }
        let [px, py, pa, pb] = self.lens.view.projection.map(|x| x as f32);
        let [width, height] = self.lens.size.map(|x| x as f32);
        let right = ((x + self.begin[0]) as f32 + 0.5) / width;
        let down = ((y + self.begin[1]) as f32 + 0.5) / height;
        let across = [(2.0 * right - 1.0) / px, (1.0 - 2.0 * down) / py];
        Some(match self.lens.view.is_perspective {
            true => {
                let z = -pb / (depth + pa);
                [across[0] * -z, across[1] * -z, z]
            }
            false => [across[0], across[1], (depth - pb) / pa],
        })
    }

    /// How much light nearby faces leave, and 1 plus the distance of the face; the latter is 0 if
    /// there is no face. See `occlusion.wgsl`.
    fn occlusion(&self, depths: &[f32], x: u32, y: u32) -> [f32; 2] {
        let (x, y) = (i64::from(x), i64::from(y));
        let seen_at = |right: i64, down: i64| self.seen_at(depths, x + right, y + down);
        let Some(here) = seen_at(0, 0) else {
            return [1.0, 0.0];
        };
        let across = cross(
            slope(here, seen_at(1, 0), seen_at(-1, 0)),
            slope(here, seen_at(0, -1), seen_at(0, 1)),
        );
        let n = if dot(across, across) > 0.0 {
            unit(across)
        } else {
            [0.0, 0.0, 1.0]
        };
        let distance = match self.lens.view.is_perspective {
            true => -here[2],
            false => 1.0,
        };
        let high = self.lens.size[1] as f32 * self.lens.view.projection[1] as f32;
        let reach = (0.5 * high * REACH / distance).min(self.reach);
        let turned = [x + i64::from(self.begin[0]), y + i64::from(self.begin[1])].map(|x| x & 3);
        let turn = ((turned[0] * 5 + turned[1] * 11) & 15) as f32 * (std::f32::consts::TAU / 16.0);
        let mut sum = 0.0;
        for k in 0..N_PLACES {
            let part = (k as f32 + 0.5) / N_PLACES as f32;
            let (sin, cos) = (turn + 2.399_963_2 * k as f32).sin_cos();
            let away = [cos, sin].map(|x| ((reach * part).max(1.0) * x).round_ties_even() as i64);
            let Some(there) = seen_at(away[0], away[1]) else {
                continue;
            };
            let v = sub(there, here);
            let squared = dot(v, v);
            let near = (1.0 - squared / (REACH * REACH)).max(0.0);
            let rise = (dot(v, n) / squared.max(1e-12).sqrt() - 0.08).max(0.0);
            sum += near * rise;
        }
        let lost = (2.2 * self.picture.occlusion * sum / N_PLACES as f32).min(1.0);
        [1.0 - lost, 1.0 + here[2].abs()]
    }

    /// The mean occlusion over those pixels of a block that have about the same depth: see
    /// `composite.wgsl`.
    fn brightness(&self, occlusion: &[[f32; 2]], x: u32, y: u32) -> f32 {
        let here = occlusion[self.index(x, y)][1];
        if here == 0.0 {
            return 1.0;
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        let around = |at: u32, n: u32| at.saturating_sub(BLUR)..(at + BLUR).min(n);
        for y in around(y, self.size[1]) {
            for x in around(x, self.size[0]) {
                let [light, there] = occlusion[self.index(x, y)];
                if there > 0.0 {
                    let alike = (1.0 - 8.0 * (there - here).abs()).max(0.0);
                    sum += alike * light;
                    weights += alike;
                }
            }
        }
        sum / weights
    }

    /// The visible faces, faintly over them the faces that show through, behind them the
    /// background.
    fn composed(&self, seen: [f32; 4], hidden: [f32; 4], brightness: f32, y: u32) -> [u8; 4] {
        let part = self.picture.see_through;
        let left = 1.0 - part * hidden[3];
        let alpha = seen[3] * left + part * hidden[3];
        let down = ((y + self.begin[1]) as f32 + 0.5) / self.lens.size[1] as f32;
        let [top, bottom] = self.picture.background;
        let channel = |k: usize| {
            let [top, bottom] = [top[k], bottom[k]].map(|x| f32::from(x) / 255.0);
            let background = linear(top + down * (bottom - top));
            let mixed = seen[k] * brightness * left + part * hidden[k];
            encoded(mixed + (1.0 - alpha) * background)
        };
        [channel(0), channel(1), channel(2), 255]
    }
}

/// The vertex at these weights of the corners, in perspective.
fn mean(corners: &[Projected; 3], weights: [f64; 3]) -> Vertex {
    let weights: [f64; 3] = std::array::from_fn(|k| weights[k] * corners[k].nearness);
    let sum: f64 = weights.iter().sum();
    let of = |get: fn(&Vertex) -> [f64; 3]| {
        std::array::from_fn(|axis| {
            (0..3)
                .map(|k| weights[k] * get(&corners[k].vertex)[axis])
                .sum::<f64>()
                / sum
        })
    };
    Vertex {
        seen: of(|vertex| vertex.seen),
        normal: of(|vertex| vertex.normal),
    }
}

/// The direction along the surface, taken from the neighbour whose position is closer in depth.
fn slope(here: [f32; 3], one: Option<[f32; 3]>, other: Option<[f32; 3]>) -> [f32; 3] {
    match (one, other) {
        (None, None) => here,
        (Some(one), None) => sub(one, here),
        (None, Some(other)) => sub(here, other),
        (Some(one), Some(other)) => {
            let (forward, backward) = (sub(one, here), sub(here, other));
            if backward[2].abs() < forward[2].abs() {
                backward
            } else {
                forward
            }
        }
    }
}

/// The largest power of two that is not above `x`; 0 if `x` is 0.
fn exponent(x: f32) -> f32 {
    f32::from_bits(x.to_bits() & 0x7f80_0000)
}

/// sRGB to light.
fn linear(srgb: f32) -> f32 {
    match srgb <= 0.04045 {
        true => srgb / 12.92,
        false => ((srgb + 0.055) / 1.055).powf(2.4),
    }
}

/// Light to sRGB.
fn encoded(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let srgb = match light <= 0.003_130_8 {
        true => light * 12.92,
        false => 1.055 * light.powf(1.0 / 2.4) - 0.055,
    };
    (srgb * 255.0).round() as u8
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}
