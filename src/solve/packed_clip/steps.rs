//! Tracks with a value for each frame: whole steps, told by what they are off a line or a parabola through the frames before.
//!
//! Captured motion has noise above its tolerance, which no few keys follow. Its steps beyond what the last frames foretell
//! are small numbers, and small numbers take few bits (Rice codes).

use bevy::math::Quat;

use super::{
    PackedClipError,
    bits::{BitReader, BitWriter, Reader, write_number},
    track::ValueRange,
};
use crate::{rig::animation::Property, solve::curve_fit::difference};

/// Largest count of steps from the first value.
const MOST_STEPS: i64 = 1 << 27;
/// Count of ones after which a number follows as it is.
const ESCAPE: u32 = 24;
/// Largest count of low bits that are told as they are.
const MOST_SHIFT: u32 = 20;
/// Sizes of steps that are tried, each this share of the one before.
const TRIES: usize = 12;
const FINER: f32 = 0.85;

/// Values of one property of a node, one a frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Steps {
    count: u32,
    scale: Scale,
    /// Three numbers, or the four of rotations that are far from one another.
    numbers: Vec<Residuals>,
}

/// Values of whole numbers of steps.
#[derive(Debug, Clone, PartialEq)]
struct Scale {
    /// Range with the middle rotation; `None` for all four numbers of a rotation.
    range: Option<ValueRange>,
    first: [f32; 4],
    step: f32,
}

/// Numbers that are told by what they are off a forecast.
#[derive(Debug, Clone, PartialEq)]
struct Residuals {
    /// Frames before that give the forecast: 1 for the last value, 2 for a line, 3 for a parabola.
    order: u32,
    shift: u32,
    bits: Vec<u8>,
}

impl Steps {
    /// Steps of values that are off by at most `most`; degrees for rotations. `None` if there are none.
    pub fn new(property: &Property, values: &[[f32; 4]], most: f32) -> Option<Self> {
        // Only the middle rotation counts.
        let range = ValueRange::of(property, values).map(|range| ValueRange { low: [0.0; 3], size: [0.0; 3], ..range });
        if range.is_none() && *property != Property::Rotation {
            return None;
        }
        let own: Vec<[f32; 4]> = values.iter().map(|value| own_numbers(property, &range, value)).collect();
        let first = *own.first()?;
        let width = if range.is_some() { 3 } else { 4 };
        // Numbers are off by half a step each; a turn is twice as far off as its numbers.
        let widest = if *property == Property::Rotation { most.to_radians() / 1.5 } else { most / 0.75 };
        let mut sizes = std::iter::successors(Some(widest), |step| Some(step * FINER)).take(TRIES);
        sizes.find_map(|step| {
            let scale = Scale { range, first, step };
            let whole = |axis: usize| -> Option<Vec<i64>> {
                let number = |own: &[f32; 4]| {
                    let steps = ((own[axis] - first[axis]) / step).round();
                    (steps.abs() < MOST_STEPS as f32).then_some(steps as i64)
                };
                own.iter().map(number).collect()
            };
            let numbers: Vec<Vec<i64>> = (0..width).map(whole).collect::<Option<_>>()?;
            let is_near = |(frame, value): (usize, &[f32; 4])| {
                let at = |axis: usize| numbers.get(axis).map_or(0, |list| list[frame]);
                difference(property, value, &scale.value(property, &std::array::from_fn(at))) <= most
            };
            let is_good = values.iter().enumerate().all(is_near);
            is_good.then(|| {
                let numbers = numbers.iter().map(|list| Residuals::new(list)).collect();
                Self { count: values.len() as u32, scale, numbers }
            })
        })
    }

    /// Count of frames.
    pub fn len(&self) -> usize {
        self.count as usize
    }

    /// Calls a function with each frame and its value.
    pub fn each_value(&self, property: &Property, mut take: impl FnMut(u32, [f32; 4])) {
        let mut lists: Vec<Numbers> = self.numbers.iter().map(Residuals::numbers).collect();
        for frame in 0..self.count {
            let mut numbers = [0; 4];
            for (number, list) in numbers.iter_mut().zip(&mut lists) {
                *number = list.next().unwrap_or_default();
            }
            take(frame, self.scale.value(property, &numbers));
        }
    }

    pub fn write(&self, out: &mut Vec<u8>) {
        out.push(u8::from(self.scale.range.is_some()));
        let middle = self.scale.range.map_or(Property::Rotation.rest(), |range| range.middle);
        let floats = middle.into_iter().chain(self.scale.first).chain([self.scale.step]);
        floats.for_each(|number| out.extend(number.to_le_bytes()));
        for list in &self.numbers {
            out.extend([list.order as u8, list.shift as u8]);
            write_number(out, list.bits.len() as u32);
            out.extend_from_slice(&list.bits);
        }
    }

    pub fn read(reader: &mut Reader, property: &Property, count: u32) -> Result<Self, PackedClipError> {
        let at = reader.at();
        let damaged = |what: &'static str| PackedClipError::Damaged { what, at };
        let has_range = match reader.byte()? {
            0 if *property == Property::Rotation => false,
            1 => true,
            _ => return Err(damaged("a kind of steps")),
        };
        let range = ValueRange::of_middle(reader)?;
        let mut float = || reader.float("a first value");
        let first = [float()?, float()?, float()?, float()?];
        if first.iter().any(|number| number.abs() > 1e12) {
            return Err(damaged("a first value"));
        }
        let step = reader.float("a step")?;
        if step <= 0.0 || step > 1e6 {
            return Err(damaged("a step"));
        }
        let mut list = || -> Result<Residuals, PackedClipError> {
            let (order, shift) = (u32::from(reader.byte()?), u32::from(reader.byte()?));
            let length = u32::try_from(reader.left()).unwrap_or(u32::MAX);
            let length = reader.number("a length of bits", length)?;
            let list = Residuals { order, shift, bits: reader.bytes(length as usize)?.to_vec() };
            // A number takes a bit at least.
            let is_long = list.bits.len().saturating_mul(8) >= count as usize;
            let is_told = (1..=3).contains(&order) && shift <= MOST_SHIFT && is_long;
            let is_small = |number: i64| number.unsigned_abs() < MOST_STEPS as u64;
            let mut numbers = list.numbers();
            let is_good = is_told && (0..count).all(|_| numbers.next().is_some_and(is_small));
            if is_good { Ok(list) } else { Err(damaged("numbers")) }
        };
        let numbers = (0..if has_range { 3 } else { 4 }).map(|_| list()).collect::<Result<_, _>>()?;
        Ok(Self { count, scale: Scale { range: has_range.then_some(range), first, step }, numbers })
    }
}

/// Numbers of a value: three within a range, else all four.
fn own_numbers(property: &Property, range: &Option<ValueRange>, value: &[f32; 4]) -> [f32; 4] {
    let inner = range.as_ref().and_then(|range| range.inner(property, *value));
    inner.map_or(*value, |[x, y, z]| [x, y, z, 0.0])
}

impl Scale {
    /// Value of whole numbers of steps.
    fn value(&self, property: &Property, numbers: &[i64; 4]) -> [f32; 4] {
        let number = |axis: usize| self.first[axis] + numbers[axis] as f32 * self.step;
        match &self.range {
            Some(range) => range.outer(property, std::array::from_fn(number)),
            None => {
                let turn = Quat::from_array(std::array::from_fn(number));
                if turn.length_squared() > 1e-6 { turn.normalize().to_array() } else { Property::Rotation.rest() }
            }
        }
    }
}

impl Residuals {
    /// The order and shift that take the fewest bits.
    fn new(numbers: &[i64]) -> Self {
        let mut best: Option<(u64, u32, u32)> = None;
        let mut left = numbers.to_vec();
        for order in 1..=3 {
            difference_of(&mut left);
            for shift in 0..=MOST_SHIFT {
                let size: u64 = left.iter().map(|number| bits_of(*number, shift)).sum();
                if best.is_none_or(|(least, ..)| size < least) {
                    best = Some((size, order, shift));
                }
            }
        }
        let (_, order, shift) = best.unwrap_or((0, 1, 0));
        let mut left = numbers.to_vec();
        (0..order).for_each(|_| difference_of(&mut left));
        let mut out = BitWriter::default();
        for number in left {
            let folded = fold(number);
            let high = folded >> shift;
            if high < u64::from(ESCAPE) {
                out.push((1 << high) - 1, high as u32 + 1);
                out.push(folded & ((1 << shift) - 1), shift);
            } else {
                out.push((1 << ESCAPE) - 1, ESCAPE);
                out.push(folded, 32);
            }
        }
        Self { order, shift, bits: out.finish() }
    }

    /// The numbers again, one after the other.
    fn numbers(&self) -> Numbers<'_> {
        Numbers { reader: BitReader::new(&self.bits), order: self.order as usize, shift: self.shift, sums: [0; 3] }
    }
}

/// Numbers of [`Residuals`], which end where the bits do.
struct Numbers<'a> {
    reader: BitReader<'a>,
    order: usize,
    shift: u32,
    /// Sums of what the forecasts were off, then sums of these.
    sums: [i64; 3],
}

impl Iterator for Numbers<'_> {
    type Item = i64;

    fn next(&mut self) -> Option<i64> {
        let mut high = 0;
        while high < ESCAPE && self.reader.take(1)? == 1 {
            high += 1;
        }
        let folded = if high == ESCAPE {
            self.reader.take(32)?
        } else {
            (u64::from(high) << self.shift) | self.reader.take(self.shift)?
        };
        let sign = -((folded & 1) as i64);
        let mut number = ((folded >> 1) as i64) ^ sign;
        for sum in self.sums.iter_mut().take(self.order) {
            *sum = sum.wrapping_add(number);
            number = *sum;
        }
        Some(number)
    }
}

/// Replaces each number but the first by its difference from the one before.
fn difference_of(numbers: &mut [i64]) {
    let mut last = 0;
    for number in numbers {
        let own = *number;
        *number = own - last;
        last = own;
    }
}

/// Number without a sign: 0, -1, 1, -2 become 0, 1, 2, 3.
fn fold(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)) as u64
}

fn bits_of(number: i64, shift: u32) -> u64 {
    let high = fold(number) >> shift;
    if high < u64::from(ESCAPE) { high + 1 + u64::from(shift) } else { u64::from(ESCAPE) + 32 }
}
