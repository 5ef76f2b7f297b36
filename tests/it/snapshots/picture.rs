//! Pictures: stored, compared, and put side by side on sheets.

use std::path::{Path, PathBuf};

use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};

/// A picture, three bytes a pixel.
#[derive(Clone, PartialEq, Eq)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    rgb: Vec<u8>,
}

/// Differences that count as none.
#[derive(Clone, Copy)]
pub struct Tolerance {
    /// Distance of two colours from which on they differ: 0 for the same colour, 1 for black and white.
    color: f32,
    /// Share of pixels that may differ.
    share: f32,
}

impl Tolerance {
    /// Tolerance for stored pictures: people see no difference, and it is less than a letter of a panel.
    pub const STORED: Self = Self { color: 0.08, share: 3e-5 };
    /// Tolerance for another renderer, which rounds edges and textures in its own way: less than a line of text.
    pub const RENDERED: Self = Self { color: 0.12, share: 2e-3 };
}

/// Pixels that may differ in the smallest picture.
const FEW: usize = 3;

impl Picture {
    pub fn new(width: usize, height: usize, rgb: Vec<u8>) -> Self {
        assert_eq!(rgb.len(), 3 * width * height);
        Self { width, height, rgb }
    }

    /// A picture of one colour.
    pub fn filled(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self::new(width, height, color.repeat(width * height))
    }

    /// The upper left part of a picture.
    pub fn part(&self, width: usize, height: usize) -> Self {
        let mut part = Self::filled(width.min(self.width), height.min(self.height), [0; 3]);
        part.put(self, 0, 0);
        part
    }

    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = 3 * (y * self.width + x);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    pub fn set(&mut self, x: usize, y: usize, color: [u8; 3]) {
        let at = 3 * (y * self.width + x);
        self.rgb[at..at + 3].copy_from_slice(&color);
    }

    /// Copies another picture to a place; what does not fit is cut off.
    pub fn put(&mut self, other: &Self, left: usize, top: usize) {
        for y in 0..other.height.min(self.height.saturating_sub(top)) {
            for x in 0..other.width.min(self.width.saturating_sub(left)) {
                self.set(left + x, top + y, other.pixel(x, y));
            }
        }
    }

    pub fn load(path: &Path) -> Option<Self> {
        let read = image::load_from_memory(&std::fs::read(path).ok()?);
        let image = read.unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
        Some(Self::new(image.width() as usize, image.height() as usize, image.into_raw()))
    }

    pub fn save(&self, path: &Path) {
        let mut bytes = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
        let (width, height) = (self.width as u32, self.height as u32);
        encoder.write_image(&self.rgb, width, height, ExtendedColorType::Rgb8).expect("a picture in memory");
        let folder = path.parent().expect("a path in a folder");
        std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(path, bytes))
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }

    /// Number of pixels that another picture of the same size has neither there nor right beside: where a text stands between
    /// two rows of pixels, rounding decides.
    fn unmatched(&self, other: &Self, color: f32) -> usize {
        let is_there = |x: usize, y: usize| {
            let own = self.pixel(x, y);
            let is_near = |x: usize, y: usize| distance(&own, &other.pixel(x, y)) <= color;
            let (columns, rows) = (x.saturating_sub(1)..=(x + 1).min(self.width - 1), y.saturating_sub(1)..=y + 1);
            is_near(x, y) || rows.filter(|y| *y < self.height).any(|y| columns.clone().any(|x| is_near(x, y)))
        };
        (0..self.height).map(|y| (0..self.width).filter(|x| !is_there(*x, y)).count()).sum()
    }

    /// The reason why people would call two pictures different, if so.
    pub fn difference(&self, stored: &Self) -> Option<String> {
        self.difference_beyond(Tolerance::STORED, stored)
    }

    /// The reason why two pictures are not alike within a tolerance, if so.
    pub fn difference_beyond(&self, tolerance: Tolerance, stored: &Self) -> Option<String> {
        if (self.width, self.height) != (stored.width, stored.height) {
            let [now, then] = [self, stored].map(|picture| format!("{}x{}", picture.width, picture.height));
            return Some(format!("it is {now} now and was {then}"));
        }
        let far = self.unmatched(stored, tolerance.color).max(stored.unmatched(self, tolerance.color));
        let most = ((self.width * self.height) as f32 * tolerance.share).max(FEW as f32) as usize;
        (far > most).then(|| format!("{far} pixels differ, of which {most} may"))
    }
}

/// Distance of two colours as people see it: brightness counts more than hue.
fn distance(a: &[u8], b: &[u8]) -> f32 {
    let [red, green, blue] = [0, 1, 2].map(|n| (f32::from(a[n]) - f32::from(b[n])) / 255.0);
    let y = 0.299 * red + 0.587 * green + 0.114 * blue;
    let i = 0.596 * red - 0.274 * green - 0.322 * blue;
    let q = 0.211 * red - 0.523 * green + 0.312 * blue;
    (y * y + 0.3 * i * i + 0.2 * q * q).sqrt()
}

/// Largest width and height of a sheet.
const SHEET: [usize; 2] = [1880, 1400];
const GAP: usize = 10;

/// Writes sheets of captioned pictures into a folder, as many as are needed: `NAME-1.png`, `NAME-2.png`, …
pub fn write_sheets(folder: &Path, name: &str, cells: &[(Picture, Picture)]) -> Vec<PathBuf> {
    let mut pages: Vec<Vec<(usize, usize, usize)>> = vec![Vec::new()];
    let (mut left, mut top, mut row) = (GAP, GAP, 0);
    for (number, (caption, picture)) in cells.iter().enumerate() {
        let width = picture.width.max(caption.width);
        let height = picture.height + caption.height;
        if left > GAP && left + width + GAP > SHEET[0] {
            (left, top, row) = (GAP, top + row + GAP, 0);
        }
        if top > GAP && top + height + GAP > SHEET[1] {
            pages.push(Vec::new());
            (left, top, row) = (GAP, GAP, 0);
        }
        pages.last_mut().expect("a page").push((number, left, top));
        left += width + GAP;
        row = row.max(height);
    }
    let write = |(page, places): (usize, Vec<(usize, usize, usize)>)| {
        let end = |of: fn(&Picture) -> usize, at: usize, number: usize| {
            let (caption, picture) = &cells[number];
            at + of(picture).max(of(caption)) + GAP
        };
        let width = places.iter().map(|(n, left, _)| end(|picture| picture.width, *left, *n)).max();
        let height =
            places.iter().map(|(n, _, top)| end(|picture| picture.height, *top, *n) + cells[*n].0.height).max();
        let mut sheet = Picture::filled(width.unwrap_or(1), height.unwrap_or(1), [90, 96, 110]);
        for (number, left, top) in places {
            let (caption, picture) = &cells[number];
            sheet.put(caption, left, top);
            sheet.put(picture, left, top + caption.height);
        }
        let path = folder.join(format!("{name}-{}.png", page + 1));
        sheet.save(&path);
        path
    };
    pages.into_iter().filter(|places| !places.is_empty()).enumerate().map(write).collect()
}
