//! File format of units and expressions: RON that a person can read and write, checked on reading.

use std::fmt;

use glam::Vec3;
use ron::{Options, extensions::Extensions, ser::PrettyConfig};
use serde::{Deserialize, Deserializer, Serialize, de::DeserializeOwned, de::Error};

/// Largest length of a text in bytes.
pub const MAX_TEXT: usize = 256 << 10;
/// Largest number of units, moves or uses in one list.
const MOST: usize = 256;
/// Longest name in bytes.
const LONGEST_NAME: usize = 64;
/// Largest strength of an expression or a unit: beyond 1 is caricature.
pub const MAX_STRENGTH: f32 = 1.5;

/// Error in a file of units or expressions, with its place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: line {line}, column {column}: {message}")]
pub struct ExpressionError {
    /// Name of the file, given by the caller.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Description of the problem, with a hint.
    pub message: String,
}

/// Movement of the face by one muscle, or a group that acts as one.
///
/// Written for the character's left (+x), the right is its mirror image. Lengths are in eye distances (landmarks 36 to
/// 45), x to the side, away from the middle, y up, z to the front.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unit {
    /// Name, such as `mouth_smile`.
    #[serde(deserialize_with = "name")]
    pub name: String,
    /// Description: the muscle and its visible effect.
    #[serde(default)]
    pub about: String,
    /// Numbers of the action units of the Facial Action Coding System that it stands for.
    #[serde(default, deserialize_with = "few")]
    pub facs: Vec<u8>,
    /// Names among the blend shapes of ARKit: one for both sides together, or those of the left and the right side.
    #[serde(default, deserialize_with = "shape_names")]
    pub arkit: Vec<String>,
    /// Largest sum of strengths in a blend of expressions.
    #[serde(default = "max_strength", deserialize_with = "limit")]
    pub limit: f32,
    /// True if each side moves the whole face, as a jaw that goes to the left: the movements are not restricted to one
    /// side.
    #[serde(default)]
    pub whole: bool,
    /// Movements of the skin.
    #[serde(default, deserialize_with = "few")]
    pub moves: Vec<UnitMove>,
    /// Opening of the jaw in degrees. The skin follows `moves`; in a unit without any, the skin below the mouth follows
    /// the jaw.
    #[serde(default, deserialize_with = "angle")]
    pub jaw: f32,
    /// Movement of the jaw.
    #[serde(default, deserialize_with = "vector")]
    pub jaw_shift: Vec3,
    /// Movement of the tongue's tip, which the jaw carries; its root stays.
    #[serde(default, deserialize_with = "vector")]
    pub tongue: Vec3,
    /// Rotation of the eyeballs.
    #[serde(default)]
    pub gaze: Gaze,
    /// Share of the opening between the lids that is closed, 0 to 1, wherever the lids are: `moves` alone leave a gap on eyes of
    /// other shapes.
    #[serde(default, deserialize_with = "closing")]
    pub closes_eye: f32,
}

/// Rotation of an eyeball in degrees.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Gaze {
    /// Angle to the side, away from the nose.
    #[serde(deserialize_with = "angle")]
    pub out: f32,
    /// Angle upwards.
    #[serde(deserialize_with = "angle")]
    pub up: f32,
}

/// Movement of a place of the skin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitMove {
    /// Landmarks whose mean is the place (Multi-PIE numbers of the character's left).
    #[serde(deserialize_with = "marks")]
    pub at: Vec<u8>,
    /// Offset added to the mean of `at`.
    #[serde(default, deserialize_with = "vector")]
    pub offset: Vec3,
    /// Displacement of the place.
    #[serde(default, deserialize_with = "vector")]
    pub by: Vec3,
    /// Landmarks whose mean gives a direction from `at`, such as from one lid to the other; a share of the way is added
    /// to `by`.
    #[serde(default, deserialize_with = "targets")]
    pub toward: Vec<u8>,
    /// Share of the way to `toward`; negative is away from it.
    #[serde(default, deserialize_with = "share")]
    pub share: f32,
    /// Reach of the movement in the skin around: the radii of an ellipse, in x and y.
    #[serde(deserialize_with = "reach")]
    pub reach: (f32, f32),
    /// Skin that the movement applies to.
    #[serde(default)]
    pub part: Part,
}

/// Skin that a move applies to. Lips divide at the mouth's line, lids at the eye's; beyond the corners both blend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Part {
    /// The whole skin.
    #[default]
    Everywhere,
    /// Skin above the mouth's line.
    UpperLip,
    /// Skin below the mouth's line.
    LowerLip,
    /// Skin above the eye's line.
    UpperLid,
    /// Skin below the eye's line.
    LowerLid,
}

/// Side of the face, or both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Sides {
    /// Left and right side alike.
    #[default]
    Both,
    /// The character's left, +x.
    Left,
    /// The character's right.
    Right,
}

impl Sides {
    /// Returns `true` if side 0 (left) or 1 (right) is included.
    pub(super) fn has(self, side: usize) -> bool {
        matches!((self, side), (Self::Both, _) | (Self::Left, 0) | (Self::Right, 1))
    }
}

/// Named combination of units with strengths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expression {
    /// Name, such as `happiness`.
    #[serde(deserialize_with = "name")]
    pub name: String,
    /// Description of the appearance.
    #[serde(default)]
    pub about: String,
    /// Units of the expression.
    #[serde(deserialize_with = "few")]
    pub units: Vec<UnitUse>,
}

/// Use of a unit in an expression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnitUse {
    /// Name of the unit.
    #[serde(deserialize_with = "name")]
    pub unit: String,
    /// Side of the unit.
    #[serde(default)]
    pub side: Sides,
    /// Strength, 0 to [`MAX_STRENGTH`].
    #[serde(default = "one", deserialize_with = "strength")]
    pub strength: f32,
}

impl Unit {
    /// Returns `true` if the unit moves the tongue and nothing else, and so nothing on a face without one.
    pub fn is_of_tongue(&self) -> bool {
        let is_still = self.moves.is_empty() && self.jaw == 0.0 && self.jaw_shift == Vec3::ZERO;
        self.tongue != Vec3::ZERO && is_still && self.gaze == Gaze::default()
    }

    /// Reads a file of units; `file` is its name in errors. Names are unique in it.
    pub fn parse_list(text: &str, file: &str) -> Result<Vec<Self>, ExpressionError> {
        #[derive(Deserialize)]
        #[serde(transparent)]
        struct List(#[serde(deserialize_with = "few")] Vec<Unit>);
        let List(units) = parse(text, file)?;
        for (index, unit) in units.iter().enumerate() {
            if units.iter().take(index).any(|other| other.name == unit.name) {
                let message = format!("a second unit {:?}; rename one of the two", unit.name);
                return Err(located(text, file, last_quoted(text, &unit.name), message));
            }
        }
        Ok(units)
    }

    /// The text of a file of units.
    pub fn list_to_text(units: &[Self]) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(&units, PrettyConfig::default())
    }
}

impl Expression {
    /// Reads a file with one expression; `file` is its name in errors.
    /// [`ExpressionSet::add`](super::ExpressionSet::add) checks that its units exist.
    pub fn parse(text: &str, file: &str) -> Result<Self, ExpressionError> {
        parse(text, file)
    }

    /// The text of the expression's file.
    pub fn to_text(&self) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(self, PrettyConfig::default())
    }
}

/// Reads a value of any of these types.
fn parse<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, ExpressionError> {
    if text.len() > MAX_TEXT {
        let message =
            format!("{} KiB, more than the {} KiB that are read; split the file", text.len() >> 10, MAX_TEXT >> 10);
        return Err(located(text, file, 0, message));
    }
    if text.trim().is_empty() {
        return Err(located(text, file, 0, "the file is empty; save it again".into()));
    }
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME).from_str(text).map_err(|error| {
        ExpressionError {
            file: file.into(),
            line: error.span.start.line,
            column: error.span.start.col,
            message: error.code.to_string(),
        }
    })
}

/// An error at a byte offset.
pub(super) fn located(text: &str, file: &str, offset: usize, message: String) -> ExpressionError {
    let before = text.get(..offset).unwrap_or_default();
    let line = before.rsplit('\n').next().unwrap_or_default();
    ExpressionError {
        file: file.into(),
        line: before.matches('\n').count() + 1,
        column: line.chars().count() + 1,
        message,
    }
}

/// Byte offset of the last quoted occurrence of a name in a text, 0 without one.
pub(super) fn last_quoted(text: &str, name: &str) -> usize {
    text.rfind(&format!("\"{name}\"")).unwrap_or(0)
}

fn one() -> f32 {
    1.0
}

fn max_strength() -> f32 {
    MAX_STRENGTH
}

/// A number in a range; the error names `what` and the range.
fn number<'de, D: Deserializer<'de>>(reader: D, what: &str, least: f32, most: f32) -> Result<f32, D::Error> {
    checked(f32::deserialize(reader)?, what, least, most)
}

fn checked<E: Error>(value: f32, what: impl fmt::Display, least: f32, most: f32) -> Result<f32, E> {
    if value >= least && value <= most {
        Ok(value)
    } else {
        Err(E::custom(format!("{what} is {value}; give a number from {least} to {most}")))
    }
}

fn limit<'de, D: Deserializer<'de>>(reader: D) -> Result<f32, D::Error> {
    number(reader, "the limit", 0.0, 2.0)
}

fn strength<'de, D: Deserializer<'de>>(reader: D) -> Result<f32, D::Error> {
    number(reader, "the strength", 0.0, MAX_STRENGTH)
}

fn closing<'de, D: Deserializer<'de>>(reader: D) -> Result<f32, D::Error> {
    number(reader, "the share that closes", 0.0, 1.0)
}

fn angle<'de, D: Deserializer<'de>>(reader: D) -> Result<f32, D::Error> {
    number(reader, "the angle in degrees", -45.0, 45.0)
}

fn vector<'de, D: Deserializer<'de>>(reader: D) -> Result<Vec3, D::Error> {
    let (x, y, z) = <(f32, f32, f32)>::deserialize(reader)?;
    for (axis, value) in [("x", x), ("y", y), ("z", z)] {
        checked::<D::Error>(value, axis, -2.0, 2.0)?;
    }
    Ok(Vec3::new(x, y, z))
}

fn reach<'de, D: Deserializer<'de>>(reader: D) -> Result<(f32, f32), D::Error> {
    let (x, y) = <(f32, f32)>::deserialize(reader)?;
    Ok((checked(x, "the reach in x", 0.01, 4.0)?, checked(y, "the reach in y", 0.01, 4.0)?))
}

fn marks<'de, D: Deserializer<'de>>(reader: D) -> Result<Vec<u8>, D::Error> {
    some_marks(reader, 1)
}

fn some_marks<'de, D: Deserializer<'de>>(reader: D, least: usize) -> Result<Vec<u8>, D::Error> {
    let marks = Vec::<u8>::deserialize(reader)?;
    if marks.len() < least || marks.len() > 8 {
        return Err(D::Error::custom(format!("a list of {} landmarks; give {least} to 8", marks.len())));
    }
    match marks.iter().find(|&&mark| mark >= 68) {
        Some(mark) => Err(D::Error::custom(format!("there is no landmark {mark}; they are numbered 0 to 67"))),
        None => Ok(marks),
    }
}

fn targets<'de, D: Deserializer<'de>>(reader: D) -> Result<Vec<u8>, D::Error> {
    some_marks(reader, 0)
}

fn share<'de, D: Deserializer<'de>>(reader: D) -> Result<f32, D::Error> {
    number(reader, "the share", -2.0, 2.0)
}

fn name<'de, D: Deserializer<'de>>(reader: D) -> Result<String, D::Error> {
    let name = String::deserialize(reader)?;
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(plain) {
        return Err(D::Error::custom("a name is 1 to 64 of a-z, 0-9 and _"));
    }
    Ok(name)
}

fn shape_names<'de, D: Deserializer<'de>>(reader: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<String>::deserialize(reader)?;
    let is_plain =
        |name: &String| (1..=LONGEST_NAME).contains(&name.len()) && name.chars().all(|c| c.is_ascii_alphanumeric());
    if names.len() > 2 || !names.iter().all(is_plain) {
        return Err(D::Error::custom("give the one name of a blend shape, or that of the left and of the right side"));
    }
    Ok(names)
}

fn few<'de, D: Deserializer<'de>, T: Deserialize<'de>>(reader: D) -> Result<Vec<T>, D::Error> {
    let list = Vec::<T>::deserialize(reader)?;
    if list.len() > MOST {
        return Err(D::Error::custom(format!("a list of {}, more than {MOST}", list.len())));
    }
    Ok(list)
}
