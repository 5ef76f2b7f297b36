//! Bytes and bits of packed clips.

use super::PackedClipError;

/// Writes a number: seven bits a byte, the low ones first.
pub(super) fn write_number(out: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// Bytes that are read from the front.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// Reader of bytes, the first of which has that place.
    pub fn new(rest: &'a [u8], at: usize) -> Self {
        Self { rest, at }
    }

    /// Place of the next byte.
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Count of bytes that are left.
    pub fn left(&self) -> usize {
        self.rest.len()
    }

    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], PackedClipError> {
        let (bytes, rest) = self.rest.split_at_checked(count).ok_or(PackedClipError::CutOff(self.at))?;
        self.rest = rest;
        self.at += count;
        Ok(bytes)
    }

    pub fn byte(&mut self) -> Result<u8, PackedClipError> {
        Ok(self.bytes(1)?[0])
    }

    /// Number of at most `most`.
    pub fn number(&mut self, what: &'static str, most: u32) -> Result<u32, PackedClipError> {
        let at = self.at;
        let damaged = PackedClipError::Damaged { what, at };
        let mut number = 0_u64;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return u32::try_from(number).ok().filter(|number| *number <= most).ok_or(damaged);
            }
        }
        Err(damaged)
    }

    /// Finite number.
    pub fn float(&mut self, what: &'static str) -> Result<f32, PackedClipError> {
        let at = self.at;
        let mut bytes = [0; 4];
        bytes.copy_from_slice(self.bytes(4)?);
        let number = f32::from_le_bytes(bytes);
        if number.is_finite() { Ok(number) } else { Err(PackedClipError::Damaged { what, at }) }
    }
}

/// Bits one after the other, the low ones first.
#[derive(Default)]
pub(super) struct BitWriter {
    out: Vec<u8>,
    held: u64,
    count: u32,
}

impl BitWriter {
    /// Adds the low bits of a number, at most 40.
    pub fn push(&mut self, number: u64, bits: u32) {
        self.held |= number << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.out.push(self.held as u8);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    pub fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.out.push(self.held as u8);
        }
        self.out
    }
}

/// Bits of a [`BitWriter`].
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> BitReader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, place: 0 }
    }

    /// Next bits, at most 40; `None` beyond the end.
    pub fn take(&mut self, bits: u32) -> Option<u64> {
        let (from, end) = (self.place / 8, self.place + bits as usize);
        let bytes = self.bytes.get(from..end.div_ceil(8))?;
        let held = bytes.iter().rev().fold(0_u64, |held, byte| (held << 8) | u64::from(*byte));
        let number = (held >> (self.place % 8)) & ((1 << bits) - 1);
        self.place = end;
        Some(number)
    }
}
