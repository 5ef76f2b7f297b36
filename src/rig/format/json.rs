//! JSON for people and programs, with numbers as short as those of templates.

use std::io;

use serde::Serialize;
use serde_json::{
    Error, Serializer,
    ser::{CompactFormatter, Formatter},
};

/// Text of a value as JSON in one line, whose numbers are the shortest that read back.
///
/// The numbers of rigs have single precision, and those of JSON values double precision, in which 0.1 is 0.10000000149011612. A
/// fraction that has no more than single precision is written as such: 0.1. Whole numbers up to 2^53 are exact.
///
/// # Errors
/// What cannot be JSON: maps whose keys are no texts.
pub fn json_text(value: &(impl Serialize + ?Sized)) -> Result<String, Error> {
    let mut bytes = Vec::new();
    value.serialize(&mut Serializer::with_formatter(&mut bytes, ShortNumbers))?;
    String::from_utf8(bytes).map_err(serde::ser::Error::custom)
}

/// Format of numbers: see [`json_text`].
struct ShortNumbers;

impl Formatter for ShortNumbers {
    fn write_f64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        const EXACT: f64 = (1_u64 << 53) as f64;
        let single = value as f32;
        let is_whole = value.fract() == 0.0 && value.abs() <= EXACT;
        if !is_whole && f64::from(single) == value {
            CompactFormatter.write_f32(writer, single)
        } else {
            CompactFormatter.write_f64(writer, value)
        }
    }
}
