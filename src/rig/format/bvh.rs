//! The BVH format: a skeleton, and motion capture frame by frame.
//!
//! ```text
//! HIERARCHY
//! ROOT Hips
//! {
//!     OFFSET 0 0 0
//!     CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
//!     JOINT Chest
//!     {
//!         OFFSET 0 5.21 0
//!         CHANNELS 3 Zrotation Xrotation Yrotation
//!         End Site
//!         {
//!             OFFSET 0 18.65 0
//!         }
//!     }
//! }
//! MOTION
//! Frames: 1
//! Frame Time: 0.033333
//! 8.03 35.01 88.36 -3.41 14.78 -164.35 13.09 40.30 -24.60
//! ```
//!
//! - Words are separated by any white space; lines end in `\n`, `\r\n` or `\r`. A name goes to the end of its line, or to a
//!   brace, and may have blanks. Bytes that are no UTF-8 are replaced in names.
//! - Any joint may have any channels in any order; position channels replace the coordinates of the offset. Several roots are
//!   read.
//! - A frame is a line. Another count of frames than the header says is a note; a frame with another count of values than
//!   there are channels is an error.

mod error;
mod frames;

use bevy::math::Vec3;

pub use self::error::BvhError;
use self::error::quoted;
use crate::{
    mesh::model::Trs,
    rig::animation::motion::{Motion, MotionChannel, MotionJoint},
};

/// Most joints that are read.
const MAX_JOINTS: usize = 20_000;
/// Most channels of a joint.
const MAX_CHANNELS: usize = 12;
/// Bound of numbers.
const MAX_NUMBER: f32 = 1e9;

/// Reads the content of a BVH file. Time is linear in the size; frames are read on all cores.
///
/// # Errors
/// See [`BvhError`]; the first error of the hierarchy, else that of the first wrong frame.
pub fn read_bvh(bytes: &[u8], name: &str) -> Result<Motion, BvhError> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(BvhError::Utf16);
    }
    let mut cursor = Cursor { rest: bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), line: 1 };
    let mut motion = Motion { name: name.to_owned(), ..Motion::default() };
    motion.joints = hierarchy(&mut cursor)?;
    let header = MotionHeader::read(&mut cursor)?;
    motion.frame_time = header.frame_time;
    let (values, rows) = frames::read(cursor.rest, cursor.line, motion.width())?;
    motion.values = values;
    if rows != header.frames {
        motion.notes.push(format!(
            "line {}: the header says {} frames, and {rows} follow; {rows} were read",
            header.line, header.frames
        ));
    }
    if motion.frames() == 0 {
        motion.notes.push("the file has no frame: it has a skeleton, but no motion".to_owned());
    }
    Ok(motion)
}

/// True for bytes that may be the first of a BVH file: white space and its first word, or the beginning of it.
pub fn may_begin_with(bytes: &[u8]) -> bool {
    let mut cursor = Cursor { rest: bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), line: 1 };
    let word = cursor.word();
    b"HIERARCHY".get(..word.len()).is_some_and(|wanted| wanted.eq_ignore_ascii_case(word))
}

/// Text that is not read yet.
struct Cursor<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Cursor<'a> {
    /// Passes over white space, and over the rest of the line at most if `within` it.
    fn blank(&mut self, within: bool) {
        while let Some((byte, rest)) = self.rest.split_first() {
            match byte {
                b'\n' | b'\r' if within => return,
                b'\r' if rest.first() == Some(&b'\n') => {}
                b'\n' | b'\r' => self.line += 1,
                byte if byte.is_ascii_whitespace() || *byte == 0x0B => {}
                _ => return,
            }
            self.rest = rest;
        }
    }

    /// Next word; a brace is a word. Empty at the end.
    fn word(&mut self) -> &'a [u8] {
        self.blank(false);
        self.word_here()
    }

    fn word_here(&mut self) -> &'a [u8] {
        let is_end = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b'{' | b'}' | 0x0B);
        let length = match self.rest.first() {
            Some(b'{' | b'}') => 1,
            _ => self.rest.iter().position(is_end).unwrap_or(self.rest.len()),
        };
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        word
    }

    /// Next word, which a part of the file needs.
    fn need(&mut self, wanted: &'static str) -> Result<&'a [u8], BvhError> {
        let word = self.word();
        if word.is_empty() { Err(BvhError::CutOff { line: self.line, wanted }) } else { Ok(word) }
    }

    fn need_word(&mut self, word: &str, wanted: &'static str) -> Result<(), BvhError> {
        let found = self.need(wanted)?;
        if found.eq_ignore_ascii_case(word.as_bytes()) {
            return Ok(());
        }
        Err(BvhError::Unexpected { line: self.line, found: quoted(found), wanted })
    }

    fn number(&mut self, wanted: &'static str) -> Result<f32, BvhError> {
        let word = self.need(wanted)?;
        number(word).ok_or_else(|| BvhError::BadNumber { line: self.line, found: quoted(word) })
    }

    fn vector(&mut self) -> Result<Vec3, BvhError> {
        let mut next = || self.number("a coordinate");
        Ok(Vec3::new(next()?, next()?, next()?))
    }

    /// Rest of the line up to a brace, without blanks around it.
    fn name(&mut self) -> String {
        self.blank(true);
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r' | b'{' | b'}'));
        let (name, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        let name = String::from_utf8_lossy(name);
        name.trim().chars().filter(|c| !c.is_control()).take(256).collect()
    }
}

/// Number in the range of a motion.
fn number(word: &[u8]) -> Option<f32> {
    fast_float2::parse::<f32, _>(word).ok().filter(|number| number.abs() <= MAX_NUMBER)
}

fn hierarchy(cursor: &mut Cursor) -> Result<Vec<MotionJoint>, BvhError> {
    let word = cursor.word();
    if !word.eq_ignore_ascii_case(b"HIERARCHY") {
        return Err(BvhError::NoHierarchy { line: cursor.line, found: quoted(word) });
    }
    let mut joints: Vec<MotionJoint> = Vec::new();
    // Open joints with whether they have an offset.
    let mut open: Vec<(usize, bool)> = Vec::new();
    loop {
        let word = cursor.need("a joint or `MOTION`")?;
        let line = cursor.line;
        let is = |known: &str| word.eq_ignore_ascii_case(known.as_bytes());
        let parent = open.last().map(|(joint, _)| *joint);
        match parent {
            None if is("ROOT") => begin(cursor, &mut joints, &mut open)?,
            None if is("MOTION") && joints.is_empty() => return Err(BvhError::NoJoints { line }),
            None if is("MOTION") => return Ok(joints),
            Some(_) if is("JOINT") => begin(cursor, &mut joints, &mut open)?,
            Some(joint) if is("OFFSET") => {
                joints[joint].rest = Trs { translation: cursor.vector()?, ..Trs::IDENTITY };
                if let Some((_, has_offset)) = open.last_mut() {
                    *has_offset = true;
                }
            }
            Some(joint) if is("CHANNELS") => joints[joint].channels = channels(cursor)?,
            Some(joint) if is("End") => {
                cursor.name();
                cursor.need_word("{", "`{`")?;
                cursor.need_word("OFFSET", "`OFFSET`")?;
                let end = cursor.vector()?;
                cursor.need_word("}", "`}`")?;
                joints[joint].ends.push(end);
            }
            Some(joint) if word == b"}" => {
                if open.pop().is_some_and(|(_, has_offset)| !has_offset) {
                    return Err(BvhError::NoOffset { line, joint: quoted(joints[joint].name.as_bytes()) });
                }
            }
            None => {
                return Err(BvhError::Unexpected { line, found: quoted(word), wanted: "`ROOT` or `MOTION`" });
            }
            Some(_) => {
                let wanted = "`OFFSET`, `CHANNELS`, `JOINT`, `End Site` or `}`";
                return Err(BvhError::Unexpected { line, found: quoted(word), wanted });
            }
        }
    }
}

fn begin(cursor: &mut Cursor, joints: &mut Vec<MotionJoint>, open: &mut Vec<(usize, bool)>) -> Result<(), BvhError> {
    if joints.len() >= MAX_JOINTS {
        return Err(BvhError::TooManyJoints { line: cursor.line });
    }
    let parent = open.last().map(|(joint, _)| *joint);
    let name = cursor.name();
    cursor.need_word("{", "`{`")?;
    open.push((joints.len(), false));
    joints.push(MotionJoint { name, parent, ..MotionJoint::default() });
    Ok(())
}

fn channels(cursor: &mut Cursor) -> Result<Vec<MotionChannel>, BvhError> {
    let word = cursor.need("a count of channels")?;
    let count = std::str::from_utf8(word).ok().and_then(|word| word.parse::<usize>().ok());
    let Some(count) = count.filter(|count| *count <= MAX_CHANNELS) else {
        return Err(BvhError::BadChannelCount { line: cursor.line, found: quoted(word) });
    };
    let channel = |_| {
        let word = cursor.need("a channel")?;
        let axis = word.first().map(|first| first.to_ascii_uppercase().wrapping_sub(b'X')).filter(|axis| *axis < 3);
        let kind = word.get(1..).unwrap_or_default();
        let channel = match axis {
            Some(axis) if kind.eq_ignore_ascii_case(b"position") => Some(MotionChannel::Position(axis)),
            Some(axis) if kind.eq_ignore_ascii_case(b"rotation") => Some(MotionChannel::Rotation(axis)),
            _ => None,
        };
        channel.ok_or_else(|| BvhError::BadChannel { line: cursor.line, found: quoted(word) })
    };
    (0..count).map(channel).collect()
}

/// Lines before the frames.
struct MotionHeader {
    line: usize,
    frames: usize,
    frame_time: f32,
}

impl MotionHeader {
    fn read(cursor: &mut Cursor) -> Result<Self, BvhError> {
        let found = cursor.need("`Frames:`")?;
        let name = found.strip_suffix(b":").unwrap_or(found);
        if !name.eq_ignore_ascii_case(b"Frames") {
            return Err(BvhError::Unexpected { line: cursor.line, found: quoted(found), wanted: "`Frames:`" });
        }
        let mut word = cursor.need("a count of frames")?;
        if word == b":" {
            word = cursor.need("a count of frames")?;
        }
        let line = cursor.line;
        let count = std::str::from_utf8(word).ok().and_then(|word| word.parse::<usize>().ok());
        let frames = count.ok_or(BvhError::Unexpected { line, found: quoted(word), wanted: "a count of frames" })?;
        cursor.need_word("Frame", "`Frame Time:`")?;
        let found = cursor.need("`Time:`")?;
        if !found.strip_suffix(b":").unwrap_or(found).eq_ignore_ascii_case(b"Time") {
            return Err(BvhError::Unexpected { line: cursor.line, found: quoted(found), wanted: "`Frame Time:`" });
        }
        let mut word = cursor.need("seconds")?;
        if word == b":" {
            word = cursor.need("seconds")?;
        }
        let frame_time = number(word).filter(|time| *time > 1e-6);
        let frame_time = frame_time.ok_or_else(|| BvhError::BadFrameTime { line: cursor.line, found: quoted(word) })?;
        Ok(Self { line, frames, frame_time })
    }
}
