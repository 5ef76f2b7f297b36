//! Decimal numbers, eight digits at a time.
//!
//! Digits are summed within one 64-bit word (Mula, "SIMD-ized string to integer", and Lemire, "Quickly parsing eight
//! digits"). A decimal is an integer mantissa times a negative power of ten, multiplied as doubles; that is
//! right to a few units in the double's last place, so rounding it to a float is right unless the double lies as near
//! to the middle between two floats. Such numbers, and all others, go to `fast-float2`.

/// Negative powers of ten, rounded.
const TENTHS: [f64; 19] = [
    1e0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16, 1e-17,
    1e-18,
];

/// The value of the first `count` of eight bytes, which are digits; 0 for a count of 0.
#[inline(always)]
pub(super) fn value(bytes: [u8; 8], count: usize) -> u64 {
    let nibbles = u64::from_le_bytes(bytes) & 0x0f0f_0f0f_0f0f_0f0f;
    // The shift removes the bytes after the digits and inserts leading zeros. Then pairs, fours and eights are summed.
    let value = nibbles.checked_shl(64 - 8 * count as u32).unwrap_or(0);
    let value = (value.wrapping_mul(2_561) >> 8) & 0x00ff_00ff_00ff_00ff;
    let value = (value.wrapping_mul(6_553_601) >> 16) & 0x0000_ffff_0000_ffff;
    value.wrapping_mul(42_949_672_960_001) >> 32
}

/// `±mantissa / 10^places` as the nearest float, or `None` where the double in between does not decide which float that
/// is. The mantissa has at most 18 digits.
#[inline(always)]
pub(super) fn rounded(mantissa: u64, places: usize, negative: bool) -> Option<f32> {
    let double = mantissa as i64 as f64 * TENTHS[places];
    // Three roundings, of the mantissa, the power and the product, each by half a unit, which is one at most in the
    // product's last place: less than four together. The float drops 29 bits.
    let dropped = double.to_bits() as u32 & 0x1fff_ffff;
    let between = dropped.wrapping_sub(0x1000_0000 - 4) <= 8;
    let bits = (double as f32).to_bits() | (u32::from(negative) << 31);
    (!between).then(|| f32::from_bits(bits))
}

/// A whole token as a float, correctly rounded; `None` if it is not a number. Infinities and NaN count as numbers.
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
    fn digits_are_summed() {
        for (text, count, wanted) in [
            (b"12345678", 8, 12_345_678),
            (b"1234567/", 7, 1_234_567),
            (b"7 999999", 1, 7),
            (b"0:000000", 1, 0),
            (b"/1234567", 0, 0),
            (b"00012\xff00", 5, 12),
        ] {
            assert_eq!(value(*text, count), wanted, "{}", String::from_utf8_lossy(text));
        }
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
