//! Scanner that finds the ends of digits in 64 bytes at once.
//!
//! Searching the end of each number only after that of the one before makes a chain of dependent steps as long as the
//! line. One comparison of 64 bytes finds all ends in them; each next end is then a bit further in the mask (Langdale
//! and Lemire, "Parsing Gigabytes of JSON per Second", section 3.1, use such masks for the structure of JSON).

use wide::{CmpGt, i8x16};

use super::number::{rounded, value};

/// Bytes compared at once; the text must hold as many from any scanned position.
pub(super) const WINDOW: usize = 64;

/// A position in a text that moves on from number to number. Reading a number passes the byte after it.
pub(super) struct Scan<'a> {
    text: &'a [u8],
    base: usize,
    /// Bit `i` is set if `text[base + i]` is no digit and was not passed yet.
    stops: u64,
}

/// A bit for each byte that is no digit.
#[inline(always)]
fn non_digits(window: &[u8; WINDOW]) -> u64 {
    let (parts, _) = window.as_chunks::<16>();
    let mut bits = 0;
    for (at, part) in parts.iter().enumerate() {
        // Digits become the ten lowest signed numbers.
        let shifted = i8x16::new(part.map(|byte| byte.wrapping_add(0x80 - b'0') as i8));
        let others = shifted.cmp_gt(i8x16::splat(i8::MIN + 9)).move_mask() as u16;
        bits |= u64::from(others) << (16 * at);
    }
    bits
}

impl<'a> Scan<'a> {
    /// Makes a scan that starts at `base + skip`.
    #[inline(always)]
    pub fn new(text: &'a [u8], base: usize, skip: usize) -> Option<Self> {
        let window = text.get(base..)?.first_chunk()?;
        Some(Self { text, base, stops: non_digits(window) >> skip << skip })
    }

    /// The first byte from `at` on that is no digit. All stops before `at` must have been passed.
    #[inline(always)]
    fn stop(&mut self, at: usize) -> Option<usize> {
        if self.stops == 0 {
            *self = Self::new(self.text, at, 0)?;
            if self.stops == 0 {
                return None;
            }
        }
        Some(self.base + self.stops.trailing_zeros() as usize)
    }

    /// Passes the stop that [`Scan::stop`] found.
    #[inline(always)]
    fn pass(&mut self) {
        self.stops &= self.stops.wrapping_sub(1);
    }

    #[inline(always)]
    fn word(&self, at: usize) -> Option<[u8; 8]> {
        self.text.get(at..)?.first_chunk::<8>().copied()
    }

    /// Passes spaces and tabs.
    #[inline(always)]
    pub fn blanks(&mut self, mut at: usize) -> Option<usize> {
        while matches!(self.text.get(at)?, b' ' | b'\t') {
            self.stop(at)?;
            self.pass();
            at += 1;
        }
        Some(at)
    }

    /// Goes past the `/` that ended a number.
    #[inline(always)]
    pub fn slash(&self, at: usize) -> Option<usize> {
        (*self.text.get(at)? == b'/').then_some(at + 1)
    }

    /// Goes past the `//` that ended a number.
    #[inline(always)]
    pub fn slashes(&mut self, at: usize) -> Option<usize> {
        let at = self.slash(at)?;
        self.stop(at)?;
        self.pass();
        self.slash(at)
    }

    /// Start of the next line, if nothing but blanks comes before the end of this one.
    #[inline(always)]
    pub fn line_end(&self, mut at: usize) -> Option<usize> {
        if *self.text.get(at)? == b'\n' {
            return Some(at + 1);
        }
        while matches!(self.text.get(at)?, b' ' | b'\t') {
            at += 1;
        }
        match (*self.text.get(at)?, *self.text.get(at + 1)?) {
            (b'\n', _) => Some(at + 1),
            (b'\r', b'\n') => Some(at + 2),
            (b'\r', _) => Some(at + 1),
            _ => None,
        }
    }

    /// Reads a whole number without sign of one to eight digits: its value and its end.
    #[inline(always)]
    pub fn index(&mut self, at: usize) -> Option<(u32, usize)> {
        let end = self.stop(at)?;
        let count = end - at;
        if !(1..=8).contains(&count) {
            return None;
        }
        self.pass();
        Some((value(self.word(at)?, count) as u32, end))
    }

    /// Reads a plain decimal like `-12.345678`: its value and its end. Returns `None` for other forms; stops at an
    /// exponent, which the caller's next step refuses.
    #[inline(always)]
    pub fn decimal(&mut self, at: usize) -> Option<(f32, usize)> {
        let negative = *self.text.get(at)? == b'-';
        self.stop(at)?;
        // Passes the sign without a branch, which the processor would often mispredict.
        self.stops &= self.stops.wrapping_sub(u64::from(negative));
        let start = at + usize::from(negative);
        let mut end = self.stop(start)?;
        let whole = end - start;
        if whole > 8 {
            return None;
        }
        let mut mantissa = value(self.word(start)?, whole);
        let mut places = 0;
        if *self.text.get(end)? == b'.' {
            self.pass();
            let first = end + 1;
            end = self.stop(first)?;
            places = end - first;
            mantissa = self.fraction(mantissa, first, places)?;
        }
        if whole + places == 0 || whole + places > 18 {
            return None;
        }
        self.pass();
        Some((rounded(mantissa, places, negative)?, end))
    }

    /// Appends the digits after the point to the mantissa.
    #[inline(always)]
    fn fraction(&self, mantissa: u64, first: usize, places: usize) -> Option<u64> {
        if places <= 8 {
            return Some(mantissa * WHOLE_TENS[places] + value(self.word(first)?, places));
        }
        if places > 16 {
            return None;
        }
        let upper = mantissa.wrapping_mul(WHOLE_TENS[8]).wrapping_add(value(self.word(first)?, 8));
        let lower = value(self.word(first + 8)?, places - 8);
        Some(upper.wrapping_mul(WHOLE_TENS[places - 8]).wrapping_add(lower))
    }

    /// The next `N` decimals, with blanks before each.
    #[inline(always)]
    pub fn decimals<const N: usize>(&mut self, at: usize) -> Option<([f32; N], usize)> {
        let mut values = [0.0; N];
        let mut at = self.blanks(at)?;
        for (number, value) in values.iter_mut().enumerate() {
            if number > 0 {
                at = self.separated(at)?;
            }
            (*value, at) = self.decimal(at)?;
        }
        Some((values, at))
    }

    /// Goes past the blank that ended a number, and past further blanks.
    #[inline(always)]
    pub fn separated(&mut self, at: usize) -> Option<usize> {
        if !matches!(self.text.get(at)?, b' ' | b'\t') {
            return None;
        }
        self.blanks(at + 1)
    }
}

/// Powers of ten as integers, up to the eight digits of a word.
const WHOLE_TENS: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::obj::number::token;

    #[test]
    fn stops_are_all_but_digits() {
        let mut window = [b'5'; WINDOW];
        for byte in 0..=255_u8 {
            let at = usize::from(byte) % WINDOW;
            window[at] = byte;
            let wanted = if byte.is_ascii_digit() { 0 } else { 1 << at };
            assert_eq!(non_digits(&window), wanted, "{byte}");
            window[at] = b'0' + byte % 10;
        }
    }

    #[test]
    fn decimals_round_as_the_standard_library_does() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let mut fast = 0;
        for round in 0..400_000 {
            let text = match round % 8 {
                0 => format!("{:.6}", (random() as i64 as f64) * 1e-17),
                1 => format!("-{}.{}", random() % 10_000_000, random() % 1_000_000_000),
                2 => format!("{}", f32::from_bits(0x3000_0000 + (random() as u32 >> 4))),
                // Halfway between two floats, and a little beside it.
                3 => format!("{}", 16_777_217 + 2 * (random() % 8_000_000)),
                4 => format!("{}.5", 8_388_608 + random() % 8_388_608),
                5 => format!(
                    "{}.{}",
                    8_388_608 + random() % 8_388_608,
                    ["50000001", "49999999", "5000000001"][round % 3]
                ),
                6 => format!("{}", f64::from(f32::from_bits(random() as u32 >> 2)) * 0.999_999_97),
                _ => format!("{}.{:016}", random() % 10, random() % 10_u64.pow(16)),
            };
            let wanted: f32 = text.parse().unwrap();
            assert_eq!(token(text.as_bytes()).unwrap().to_bits(), wanted.to_bits(), "{text}");
            let padded = format!("{text}{:80}", "");
            if let Some((value, end)) = Scan::new(padded.as_bytes(), 0, 0).unwrap().decimal(0) {
                fast += 1;
                assert_eq!(end, text.len(), "{text}");
                assert_eq!(value.to_bits(), wanted.to_bits(), "{text}");
            }
        }
        assert!(fast > 200_000, "the fast path took only {fast}");
    }

    #[test]
    fn numbers_are_followed_across_windows() {
        let text = format!("{}{}", "12/345 -6.5 789 ".repeat(21), "0".repeat(WINDOW));
        let mut scan = Scan::new(text.as_bytes(), 0, 0).unwrap();
        let mut at = 0;
        for _ in 0..20 {
            let (first, end) = scan.index(at).unwrap();
            let start = scan.slash(end).unwrap();
            let (second, end) = scan.index(start).unwrap();
            let start = scan.separated(end).unwrap();
            let ([third, fourth], end) = scan.decimals::<2>(start).unwrap();
            assert_eq!((first, second, third, fourth), (12, 345, -6.5, 789.0));
            at = scan.separated(end).unwrap();
        }
    }
}
