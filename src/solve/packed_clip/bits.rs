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

/// Numbers of so many bits each, one after the other, the low bits first.
pub(super) fn pack_bits(numbers: impl Iterator<Item = u32>, bits: u32) -> Vec<u8> {
    let (mut out, mut held, mut count) = (Vec::new(), 0_u64, 0);
    for number in numbers {
        held |= u64::from(number) << count;
        count += bits;
        while count >= 8 {
            out.push(held as u8);
            held >>= 8;
            count -= 8;
        }
    }
    if count > 0 {
        out.push(held as u8);
    }
    out
}

/// Number at a place of [`pack_bits`]; zero beyond the end.
pub(super) fn bits_at(bytes: &[u8], place: usize, bits: u32) -> u32 {
    let first = place * bits as usize;
    let from = first / 8;
    let mut held = 0_u64;
    for (number, byte) in bytes.iter().skip(from).take(8).enumerate() {
        held |= u64::from(*byte) << (8 * number);
    }
    ((held >> (first % 8)) & ((1 << bits) - 1)) as u32
}
