//! Tracks of packed clips.

use bevy::math::{Quat, Vec3};

use super::{
    PackedClipError,
    bits::{BitReader, BitWriter, Reader, write_number},
    steps::Steps,
    unit,
};
use crate::{rig::animation::Property, solve::curve_fit::difference};

/// Bits of a number of a key.
const BITS: std::ops::RangeInclusive<u32> = 3..=22;
/// Least cosine of half the angle from the middle rotation of a track to its others.
const NEAR: f32 = 0.3;
/// Byte of a part that stays at rest, in place of a track.
pub(super) const REST: u8 = 0;
/// Bound of numbers of ranges; larger ones are damage.
const MOST: f32 = 1e12;

/// Track of one property of a node that does not stay at rest. Large ones are boxed: a constant is few bytes of a file, and
/// takes little memory, too.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum PackedTrack {
    /// One value all the time.
    Constant([f32; 4]),
    /// Keys as they are: frames and values.
    Whole(Vec<(u32, [f32; 4])>),
    /// Keys whose numbers have few bits.
    Few(Box<FewBits>),
    /// A value for each frame.
    Steps(Box<Steps>),
}

/// Keys whose numbers have few bits.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FewBits {
    frames: Vec<u32>,
    bits: u32,
    range: ValueRange,
    numbers: Vec<u8>,
}

/// Range of the numbers of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ValueRange {
    /// Rotation from which others are told.
    pub middle: [f32; 4],
    pub low: [f32; 3],
    pub size: [f32; 3],
}

impl ValueRange {
    /// Range of values; `None` if rotations are too far from one another.
    pub fn of(property: &Property, values: &[[f32; 4]]) -> Option<Self> {
        let mut range = Self { middle: Property::Rotation.rest(), low: [f32::MAX; 3], size: [0.0; 3] };
        if *property == Property::Rotation {
            let first = unit(*values.first()?);
            let sum = values.iter().fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, value| {
                let turn = unit(*value);
                sum + if turn.dot(first) < 0.0 { -turn } else { turn }
            });
            let length = sum.length();
            (length > 1e-3 * values.len() as f32).then_some(())?;
            range.middle = (sum * (1.0 / length)).to_array();
        }
        let mut high = [f32::MIN; 3];
        for value in values {
            let own = range.inner(property, *value)?;
            range.low = std::array::from_fn(|axis| range.low[axis].min(own[axis]));
            high = std::array::from_fn(|axis| high[axis].max(own[axis]));
        }
        range.size = std::array::from_fn(|axis| high[axis] - range.low[axis]);
        let is_small = |number: &f32| number.abs() <= MOST;
        range.low.iter().chain(&range.size).all(is_small).then_some(range)
    }

    /// Three numbers of a value; `None` for a rotation far from the middle one.
    pub fn inner(&self, property: &Property, value: [f32; 4]) -> Option<[f32; 3]> {
        if *property != Property::Rotation {
            return Some([value[0], value[1], value[2]]);
        }
        let turn = unit(self.middle).inverse() * unit(value);
        let turn = if turn.w < 0.0 { -turn } else { turn };
        (turn.w >= NEAR).then_some([turn.x, turn.y, turn.z])
    }

    /// Value of three numbers.
    pub fn outer(&self, property: &Property, own: [f32; 3]) -> [f32; 4] {
        let [x, y, z] = own;
        if *property != Property::Rotation {
            return [x, y, z, 0.0];
        }
        let w = (1.0 - Vec3::new(x, y, z).length_squared()).max(0.0).sqrt();
        (unit(self.middle) * Quat::from_xyzw(x, y, z, w)).normalize().to_array()
    }

    /// Range with a middle rotation alone.
    pub fn of_middle(reader: &mut Reader) -> Result<Self, PackedClipError> {
        Ok(Self { middle: value(reader, &Property::Rotation)?, low: [0.0; 3], size: [0.0; 3] })
    }

    /// Range of a file.
    fn read(reader: &mut Reader) -> Result<Self, PackedClipError> {
        let middle = value(reader, &Property::Rotation)?;
        let at = reader.at();
        let mut three = || -> Result<[f32; 3], PackedClipError> {
            Ok([reader.float("a range")?, reader.float("a range")?, reader.float("a range")?])
        };
        let low = three()?;
        let size = three()?;
        if low.iter().any(|low| low.abs() > MOST) || size.iter().any(|size| *size < 0.0 || *size > MOST) {
            return Err(PackedClipError::Damaged { what: "a range", at });
        }
        Ok(Self { middle, low, size })
    }
}

impl PackedTrack {
    /// Track of keys, whose values are off by at most `most`; degrees for rotations.
    pub fn new(property: &Property, keys: &[(u32, [f32; 4])], most: f32) -> Self {
        if let [(_, value)] = keys {
            return Self::Constant(*value);
        }
        let values: Vec<[f32; 4]> = keys.iter().map(|(_, value)| *value).collect();
        let few = |bits: u32, range: ValueRange| {
            let top = ((1_u32 << bits) - 1) as f32;
            let own = values.iter().filter_map(|value| range.inner(property, *value)).flat_map(|own| {
                (0..3).map(move |axis| {
                    let share =
                        if range.size[axis] > 0.0 { (own[axis] - range.low[axis]) / range.size[axis] } else { 0.0 };
                    (share.clamp(0.0, 1.0) * top).round() as u32
                })
            });
            let mut numbers = BitWriter::default();
            own.for_each(|number| numbers.push(u64::from(number), bits));
            let numbers = numbers.finish();
            FewBits { frames: keys.iter().map(|(frame, _)| *frame).collect(), bits, range, numbers }
        };
        let is_near = |few: &FewBits| {
            let found = few.values(property);
            values.iter().zip(&found).all(|(value, found)| difference(property, value, found) <= most)
        };
        let range = ValueRange::of(property, &values);
        let found = range.and_then(|range| BITS.map(|bits| few(bits, range)).find(is_near));
        found.map_or_else(|| Self::Whole(keys.to_vec()), |few| Self::Few(Box::new(few)))
    }

    /// The track that takes fewer bytes.
    pub fn smaller(self, other: Self) -> Self {
        let size = |track: &Self| {
            let mut bytes = Vec::new();
            track.write(&mut bytes);
            bytes.len()
        };
        if size(&other) < size(&self) { other } else { self }
    }

    /// Count of keys.
    pub fn len(&self) -> usize {
        match self {
            Self::Constant(_) => 1,
            Self::Whole(keys) => keys.len(),
            Self::Few(few) => few.frames.len(),
            Self::Steps(steps) => steps.len(),
        }
    }

    /// Value of a track that does not change.
    pub fn constant(&self) -> Option<[f32; 4]> {
        if let Self::Constant(value) = self { Some(*value) } else { None }
    }

    /// Frames and values of the keys.
    pub fn keys(&self, property: &Property) -> Vec<(u32, [f32; 4])> {
        let mut keys = Vec::with_capacity(self.len());
        self.each_key(property, |frame, value| keys.push((frame, value)));
        keys
    }

    /// Calls a function with frame and value of each key.
    pub fn each_key(&self, property: &Property, mut take: impl FnMut(u32, [f32; 4])) {
        match self {
            Self::Constant(value) => take(0, *value),
            Self::Whole(keys) => keys.iter().for_each(|(frame, value)| take(*frame, *value)),
            Self::Few(few) => few.each_key(property, take),
            Self::Steps(steps) => steps.each_value(property, take),
        }
    }

    pub fn write(&self, out: &mut Vec<u8>) {
        let floats = |out: &mut Vec<u8>, list: &[f32]| list.iter().for_each(|number| out.extend(number.to_le_bytes()));
        let frames = |out: &mut Vec<u8>, frames: &mut dyn Iterator<Item = u32>| {
            let mut last = 0;
            for frame in frames {
                write_number(out, frame - last);
                last = frame;
            }
        };
        match self {
            Self::Constant(value) => {
                out.push(1);
                floats(out, value);
            }
            Self::Whole(keys) => {
                out.push(2);
                write_number(out, keys.len() as u32);
                frames(out, &mut keys.iter().map(|(frame, _)| *frame));
                keys.iter().for_each(|(_, value)| floats(out, value));
            }
            Self::Few(few) => {
                out.push(3);
                write_number(out, few.frames.len() as u32);
                frames(out, &mut few.frames.iter().copied());
                out.push(few.bits as u8);
                floats(out, &few.range.middle);
                floats(out, &few.range.low);
                floats(out, &few.range.size);
                out.extend_from_slice(&few.numbers);
            }
            Self::Steps(steps) => {
                out.push(4);
                steps.write(out);
            }
        }
    }

    /// Track of a part; `None` for one that stays at rest.
    pub fn read(reader: &mut Reader, property: &Property, frames: u32) -> Result<Option<Self>, PackedClipError> {
        let at = reader.at();
        let damaged = |what: &'static str| PackedClipError::Damaged { what, at };
        Ok(Some(match reader.byte()? {
            REST => return Ok(None),
            1 => Self::Constant(value(reader, property)?),
            2 => {
                let frames = key_frames(reader, frames)?;
                let mut keys = Vec::with_capacity(frames.len());
                for frame in frames {
                    keys.push((frame, value(reader, property)?));
                }
                Self::Whole(keys)
            }
            3 => {
                let frames = key_frames(reader, frames)?;
                let bits = u32::from(reader.byte()?);
                if !BITS.contains(&bits) {
                    return Err(damaged("a count of bits"));
                }
                let range = ValueRange::read(reader)?;
                let numbers = reader.bytes((3 * frames.len() * bits as usize).div_ceil(8))?.to_vec();
                Self::Few(Box::new(FewBits { frames, bits, range, numbers }))
            }
            4 => Self::Steps(Box::new(Steps::read(reader, property, frames)?)),
            _ => return Err(damaged("a kind of track")),
        }))
    }
}

impl FewBits {
    fn values(&self, property: &Property) -> Vec<[f32; 4]> {
        let mut values = Vec::with_capacity(self.frames.len());
        self.each_key(property, |_, value| values.push(value));
        values
    }

    fn each_key(&self, property: &Property, mut take: impl FnMut(u32, [f32; 4])) {
        let top = ((1_u32 << self.bits) - 1) as f32;
        let mut reader = BitReader::new(&self.numbers);
        for frame in &self.frames {
            let own = std::array::from_fn(|axis| {
                let share = reader.take(self.bits).unwrap_or_default() as f32 / top;
                self.range.low[axis] + self.range.size[axis] * share
            });
            take(*frame, self.range.outer(property, own));
        }
    }
}

/// Frames of keys, which rise.
fn key_frames(reader: &mut Reader, frames: u32) -> Result<Vec<u32>, PackedClipError> {
    let at = reader.at();
    let damaged = PackedClipError::Damaged { what: "a frame of a key", at };
    // A key takes a byte at least.
    let most = u32::try_from(reader.left()).unwrap_or(u32::MAX).min(frames);
    let count = reader.number("a count of keys", most)?;
    let mut found: Vec<u32> = Vec::with_capacity(count as usize);
    for key in 0..count {
        let step = reader.number("a frame of a key", frames)?;
        let frame = found.last().copied().unwrap_or_default() + step;
        if frame >= frames || (key > 0 && step == 0) {
            return Err(damaged);
        }
        found.push(frame);
    }
    Ok(found)
}

/// Four floats; a rotation has unit length.
fn value(reader: &mut Reader, property: &Property) -> Result<[f32; 4], PackedClipError> {
    let at = reader.at();
    let mut float = || reader.float("a value");
    let value = [float()?, float()?, float()?, float()?];
    let length = value.iter().map(|number| number * number).sum::<f32>();
    if *property == Property::Rotation && (length - 1.0).abs() > 1e-3 {
        return Err(PackedClipError::Damaged { what: "a rotation", at });
    }
    Ok(value)
}
