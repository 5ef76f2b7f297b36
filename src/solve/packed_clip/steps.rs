//! Tracks with a value for each frame: whole steps, told by what they are off a line or a parabola through the frames before.
//!
//! Captured motion has noise above its tolerance, which no few keys follow. Its steps beyond what the last frames foretell
//! are small numbers, and small numbers take few bits (Rice codes).

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
    range: ValueRange,
    step: f32,
    numbers: [Residuals; 3],
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
        let mut range = ValueRange::of(property, values)?;
        let own: Vec<[f32; 3]> = values.iter().map(|value| range.inner(property, *value)).collect::<Option<_>>()?;
        range.low = *own.first()?;
        range.size = [0.0; 3];
        // Three numbers that are off by half a step each; a turn is twice as far off as its numbers.
        let widest = if *property == Property::Rotation { most.to_radians() / 1.5 } else { most / 0.75 };
        let mut sizes = std::iter::successors(Some(widest), |step| Some(step * FINER)).take(TRIES);
        sizes.find_map(|step| {
            let whole = |axis: usize| -> Option<Vec<i64>> {
                let number = |own: &[f32; 3]| {
                    let steps = ((own[axis] - range.low[axis]) / step).round();
                    (steps.abs() < MOST_STEPS as f32).then_some(steps as i64)
                };
                own.iter().map(number).collect()
            };
            let numbers = [whole(0)?, whole(1)?, whole(2)?];
            let is_near = |(frame, value): (usize, &[f32; 4])| {
                let found = value_of(property, &range, step, std::array::from_fn(|axis| numbers[axis][frame]));
                difference(property, value, &found) <= most
            };
            values.iter().enumerate().all(is_near).then(|| {
                let count = values.len() as u32;
                Self { count, range, step, numbers: numbers.map(|list| Residuals::new(&list)) }
            })
        })
    }

    /// Count of frames.
    pub fn len(&self) -> usize {
        self.count as usize
    }

    /// Values, one a frame.
    pub fn values(&self, property: &Property) -> Vec<[f32; 4]> {
        let [x, y, z] = &self.numbers;
        let lists = [x, y, z].map(|list| list.numbers(self.count).unwrap_or_default());
        let number = |frame: usize| lists.each_ref().map(|list| list.get(frame).copied().unwrap_or_default());
        (0..self.len()).map(|frame| value_of(property, &self.range, self.step, number(frame))).collect()
    }

    pub fn write(&self, out: &mut Vec<u8>) {
        let floats = [&self.range.middle[..], &self.range.low, &[self.step]];
        floats.into_iter().flatten().for_each(|number| out.extend(number.to_le_bytes()));
        for list in &self.numbers {
            out.extend([list.order as u8, list.shift as u8]);
            write_number(out, list.bits.len() as u32);
            out.extend_from_slice(&list.bits);
        }
    }

    pub fn read(reader: &mut Reader, count: u32) -> Result<Self, PackedClipError> {
        let at = reader.at();
        let damaged = |what: &'static str| PackedClipError::Damaged { what, at };
        let range = ValueRange::read(reader, false)?;
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
            let is_good = (1..=3).contains(&order) && shift <= MOST_SHIFT && is_long;
            let numbers = if is_good { list.numbers(count) } else { None };
            let is_small = |number: &i64| number.unsigned_abs() < MOST_STEPS as u64;
            numbers.filter(|numbers| numbers.iter().all(is_small)).map(|_| list).ok_or(damaged("numbers"))
        };
        let numbers = [list()?, list()?, list()?];
        Ok(Self { count, range, step, numbers })
    }
}

/// Value of three whole numbers of steps.
fn value_of(property: &Property, range: &ValueRange, step: f32, numbers: [i64; 3]) -> [f32; 4] {
    range.outer(property, std::array::from_fn(|axis| range.low[axis] + numbers[axis] as f32 * step))
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

    /// Numbers again; `None` if there are fewer.
    fn numbers(&self, count: u32) -> Option<Vec<i64>> {
        let mut reader = BitReader::new(&self.bits);
        let mut numbers = Vec::with_capacity(count as usize);
        for _ in 0..count {
            let mut high = 0;
            while high < ESCAPE && reader.take(1)? == 1 {
                high += 1;
            }
            let folded = if high == ESCAPE {
                reader.take(32)?
            } else {
                (u64::from(high) << self.shift) | reader.take(self.shift)?
            };
            let sign = -((folded & 1) as i64);
            numbers.push(((folded >> 1) as i64) ^ sign);
        }
        for _ in 0..self.order {
            let mut sum = 0_i64;
            for number in &mut numbers {
                sum = sum.wrapping_add(*number);
                *number = sum;
            }
        }
        Some(numbers)
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
