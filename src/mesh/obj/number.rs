//! Decimal numbers, eight digits at a time.
//!
//! Digits are found and summed within one 64-bit word (Mula, "SIMD-ized string to integer", and Lemire, "Quickly
//! parsing eight digits"). A decimal is an integer mantissa divided by a power of ten. Both are exact doubles up to
//! 2^53 and 10^22, so the quotient is the correctly rounded double (Clinger 1990); rounding that once more to `f32` is
//! right unless the double lies exactly between two floats. Such numbers, and all others, go to `fast-float2`.

/// Powers of ten that are exact in a double.
const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The same as integers, as far as digits come in words.
const WHOLE_TENS: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// How many of the eight bytes are digits before the first that is none, and their value.
#[inline(always)]
pub(super) fn digits(bytes: [u8; 8]) -> (usize, u64) {
    let nibbles = u64::from_le_bytes(bytes) ^ 0x3030_3030_3030_3030;
    // A byte above 9 gets its top bit set, by the addition or because it has it. A carry out of a byte only reaches
    // bytes after it, and only the first marked byte counts.
    let others = (nibbles.wrapping_add(0x7676_7676_7676_7676) | nibbles) & 0x8080_8080_8080_8080;
    let count = (others.trailing_zeros() / 8) as usize;
    // Shift what follows the digits out and leading zeros in; in halves, for a shift by 64 bits is not one.
    let half = 4 * (8 - count);
    let value = (nibbles << half) << half;
    let value = (value.wrapping_mul(10).wrapping_add(value >> 8)) & 0x00ff_00ff_00ff_00ff;
    let value = (value.wrapping_mul(100).wrapping_add(value >> 16)) & 0x0000_ffff_0000_ffff;
    let value = (value.wrapping_mul(10_000).wrapping_add(value >> 32)) & 0xffff_ffff;
    (count, value)
}

/// The eight bytes at `at`, if there are so many.
#[inline(always)]
fn word(text: &[u8], at: usize) -> Option<[u8; 8]> {
    text.get(at..)?.first_chunk::<8>().copied()
}

/// Reads a whole number without sign of at most eight digits at `at`: its value and where it ends. `None` if there is
/// no digit, if there are more, or if the text ends within eight bytes.
#[inline(always)]
pub(super) fn index(text: &[u8], at: usize) -> Option<(u32, usize)> {
    let (count, value) = digits(word(text, at)?);
    if count == 0 || (count == 8 && text.get(at + 8)?.is_ascii_digit()) {
        return None;
    }
    Some((value as u32, at + count))
}

/// Reads a plain decimal like `-12.345678` at `at`: its value and where it ends. `None` for whatever is not plain; an
/// exponent is left for the caller to stumble over.
#[inline(always)]
pub(super) fn decimal(text: &[u8], at: usize) -> Option<(f32, usize)> {
    let negative = *text.get(at)? == b'-';
    let mut at = at + usize::from(negative);
    let (whole, mut mantissa) = digits(word(text, at)?);
    if whole == 8 {
        return None;
    }
    at += whole;
    let mut places = 0;
    if *text.get(at)? == b'.' {
        at += 1;
        let (count, value) = digits(word(text, at)?);
        at += count;
        places = count;
        mantissa = mantissa * WHOLE_TENS[count] + value;
        if count == 8 {
            let (more, value) = digits(word(text, at)?);
            if whole + more > 8 {
                return None;
            }
            at += more;
            places += more;
            mantissa = mantissa * WHOLE_TENS[more] + value;
        }
    }
    if whole + places == 0 || mantissa > 1 << 53 {
        return None;
    }
    Some((rounded(mantissa, places, negative)?, at))
}

/// `±mantissa / 10^places` as the nearest float, or `None` where the double in between does not tell which that is.
#[inline(always)]
fn rounded(mantissa: u64, places: usize, negative: bool) -> Option<f32> {
    let double = mantissa as i64 as f64 / TENS[places];
    let between = double.to_bits() & 0x1fff_ffff == 0x1000_0000;
    let bits = (double as f32).to_bits() | (u32::from(negative) << 31);
    (!between).then(|| f32::from_bits(bits))
}

/// A whole token as a float, correctly rounded; `None` if it is no number. Infinities and NaN are numbers here.
pub(super) fn token(text: &[u8]) -> Option<f32> {
    let text = match text {
        [b'+', b'+' | b'-', ..] => return None,
        [b'+', rest @ ..] => rest,
        _ => text,
    };
    fast_float2::parse(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_counted_and_summed() {
        for (text, count, value) in [
            (b"12345678", 8, 12_345_678),
            (b"1234567/", 7, 1_234_567),
            (b"7 999999", 1, 7),
            (b"0:000000", 1, 0),
            (b"/1234567", 0, 0),
            (b"00012\xff00", 5, 12),
            (b"99\x8099999", 2, 99),
        ] {
            assert_eq!(digits(*text), (count, value), "{}", String::from_utf8_lossy(text));
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
        for round in 0..300_000 {
            let text = match round % 6 {
                0 => format!("{:.6}", (random() as i64 as f64) * 1e-17),
                1 => format!("-{}.{}", random() % 10_000_000, random() % 1_000_000_000),
                2 => format!("{}", f32::from_bits(0x3000_0000 + (random() as u32 >> 4))),
                // Halfway between two floats, and a little beside it.
                3 => format!("{}", 16_777_217 + 2 * (random() % 8_000_000)),
                4 => format!("{}.5", 8_388_608 + random() % 8_388_608),
                _ => format!("{}.{:016}", random() % 10, random() % 10_u64.pow(16)),
            };
            let wanted: f32 = text.parse().unwrap();
            assert_eq!(token(text.as_bytes()).unwrap().to_bits(), wanted.to_bits(), "{text}");
            let padded = format!("{text}          ");
            if let Some((value, end)) = decimal(padded.as_bytes(), 0) {
                fast += 1;
                assert_eq!(end, text.len(), "{text}");
                assert_eq!(value.to_bits(), wanted.to_bits(), "{text}");
            }
        }
        assert!(fast > 100_000, "the fast path took only {fast}");
    }

    #[test]
    fn odd_tokens_are_numbers_or_not() {
        for (text, value) in [
            ("+1.5", Some(1.5)),
            (".5", Some(0.5)),
            ("5.", Some(5.0)),
            ("-.7e+02", Some(-70.0)),
            (".8e-001", Some(0.08)),
            ("1E3", Some(1000.0)),
            ("+-1", None),
            ("", None),
            ("-", None),
            (".", None),
            ("1.#IND", None),
            ("1,5", None),
            ("1e", None),
            ("0x10", None),
        ] {
            assert_eq!(token(text.as_bytes()), value, "{text}");
        }
        assert!(token(b"nan").unwrap().is_nan());
        assert_eq!(token(b"-inf"), Some(f32::NEG_INFINITY));
        assert_eq!(token(b"1e39"), Some(f32::INFINITY));
    }
}
