//! Choices that bytes make: the same bytes give the same input, and a byte more or less changes one choice.
//!
//! Bytes that have run out read as zero, and zero is always the plain choice, so that every input ends.

use glam::{Quat, Vec3};

/// Numbers that code gets wrong.
const ODD: [f32; 16] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-45,
    -0.0,
    1e30,
    -1e30,
    1e19,
    1e-20,
    16_777_216.0,
    4_294_967_296.0,
    -1.0,
    0.0,
];

/// Reader of choices.
#[derive(Debug, Clone)]
pub struct Choices<'a> {
    bytes: &'a [u8],
    at: usize,
    was_odd: bool,
}

impl<'a> Choices<'a> {
    /// Choices of these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, was_odd: false }
    }

    /// True if every further choice is the plain one.
    pub fn is_over(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// True if faults and unusual values are wanted in what is made of these bytes. The last byte says so, without being taken:
    /// every other choice stays what it was.
    pub fn is_wild(&self) -> bool {
        self.bytes.last().is_some_and(|last| (32..128).contains(last))
    }

    /// The next byte; zero once they have run out.
    pub fn byte(&mut self) -> u8 {
        let byte = self.bytes.get(self.at).copied().unwrap_or_default();
        self.at += 1;
        byte
    }

    /// A number below `end`; 0 if `end` is 0 or 1. Takes one byte for small ends, two for others.
    pub fn below(&mut self, end: usize) -> usize {
        match end {
            0 | 1 => 0,
            2..=256 => usize::from(self.byte()) % end,
            _ => usize::from(u16::from_le_bytes([self.byte(), self.byte()])) % end,
        }
    }

    /// True once in `one_in` times, and never once the bytes have run out.
    pub fn chance(&mut self, one_in: usize) -> bool {
        one_in > 1 && self.below(one_in) == one_in - 1
    }

    /// One of a list; the first one is the plain choice.
    ///
    /// # Panics
    /// An empty list.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// One of a list; `None` of an empty one.
    pub fn of<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        let at = self.below(from.len());
        from.get(at).copied()
    }

    /// An ordinary number from -8 to 8 in steps of a sixteenth.
    pub fn number(&mut self) -> f32 {
        f32::from(self.byte().cast_signed()) / 16.0
    }

    /// A number, ordinary but for one in 256.
    pub fn any_number(&mut self) -> f32 {
        if !self.chance(256) {
            return self.number();
        }
        self.was_odd = true;
        self.pick(&ODD)
    }

    /// True if a number that is not ordinary was chosen.
    pub fn was_odd(&self) -> bool {
        self.was_odd
    }

    /// A number from 0 to 1.
    pub fn unit(&mut self) -> f32 {
        f32::from(self.byte()) / 255.0
    }

    /// A vector of ordinary numbers.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }

    /// A rotation about one of a few axes.
    pub fn rotation(&mut self) -> Quat {
        let axis = self.pick(&[Vec3::Y, Vec3::X, Vec3::Z, Vec3::new(0.6, 0.8, 0.0)]);
        Quat::from_axis_angle(axis, self.number() * 0.375)
    }
}

/// A number as RON, JSON and OBJ take it where it is finite.
pub fn text_of(number: f32) -> String {
    if number.is_finite() { format!("{number:?}") } else { format!("{number}") }
}

/// Pieces that stumble readers of text.
const PIECES: [&str; 24] = [
    "",
    " ",
    "(",
    ")",
    "[",
    "]",
    "\"",
    ",",
    ":",
    "@this",
    "@any",
    "@joint ",
    "None",
    "Some(",
    "1e39",
    "-1",
    "4294967296",
    "inf",
    "\\u{202e}",
    "/*",
    "//",
    "format: 3,",
    "uid: \"0000000000000001\",",
    "\u{301}",
];

/// Bends a text in a few places; the text stays UTF-8.
pub fn bend(choices: &mut Choices, text: &mut String) {
    for _ in 0..=choices.below(3) {
        let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
        if places.is_empty() {
            return;
        }
        let start = places[choices.below(places.len())];
        let length = choices.below(24);
        let end = places.iter().copied().find(|at| *at >= start + length).unwrap_or(text.len());
        match choices.below(5) {
            0 => text.replace_range(start..end, ""),
            1 => text.insert_str(start, choices.pick(&PIECES)),
            2 => text.replace_range(start..end, choices.pick(&PIECES)),
            3 => {
                let piece = text[start..end].to_owned();
                text.insert_str(end, &piece);
            }
            _ => text.truncate(start),
        }
    }
}
