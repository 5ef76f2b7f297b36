//! The `.rig` text format: joint positions and topology, one line a joint, as Pencil Rigger stores them.
//!
//! ```text
//! rig 1
//! # INDEX PARENT X Y Z [LABEL]
//! joint 0 -1 0 0.95 0 hips
//! joint 1 0 0 1.1 0.02 spine   # a comment may follow
//! ```
//!
//! - The first line that is neither blank nor a comment is `rig` and the version of the format.
//! - Every other line is a joint: its own number, its parent's (`-1` for a root; several roots are allowed), its
//!   position in model units, and optionally its label. Joints and parents may come in any order.
//! - Numbers are unique and may leave gaps; joints are taken in ascending order and renumbered from 0.
//! - Fields are separated by any white space; lines end in `\n`, `\r\n` or `\r`; a byte order mark is skipped.
//! - `#` at the start of a field begins a comment; inside a field it is an ordinary character (`arm#2` is a label).
//! - A label has no white space, no control characters and no `#` at its start.

mod error;
mod write;

pub use error::{JointField, RigTextError};
pub use write::{LabelChange, RigTextOutput, write};

use glam::Vec3;

use error::quoted;

/// Number of the format that Rigsmith writes, which is also the highest number that it reads.
pub const VERSION: u32 = 1;

/// Skeleton in the form of a `.rig` file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigText {
    /// The joints in ascending order of their numbers.
    pub joints: Vec<RigTextJoint>,
}

impl RigText {
    /// Checks that joints are no further from those above them than a number can hold: a rig has these ways, while the text has
    /// places alone.
    ///
    /// # Errors
    /// [`RigTextError::FarFromParent`] with the first joint that is.
    pub fn check_ways(&self) -> Result<(), RigTextError> {
        let is_far = |joint: &RigTextJoint| {
            let parent = joint.parent.and_then(|parent| self.joints.get(parent));
            parent.is_some_and(|parent| !(joint.position - parent.position).is_finite())
        };
        match self.joints.iter().position(is_far) {
            Some(joint) => Err(RigTextError::FarFromParent { joint, label: self.joints[joint].label.clone() }),
            None => Ok(()),
        }
    }
}

/// Joint of a [`RigText`].
#[derive(Debug, Clone, PartialEq)]
pub struct RigTextJoint {
    /// Index of the parent in [`RigText::joints`], before or after this joint; `None` for a root.
    pub parent: Option<usize>,
    /// Position in rig space, in model units; finite.
    pub position: Vec3,
    /// Label without white space, control characters or a leading `#`.
    pub label: Option<String>,
}

/// Reads the content of a `.rig` file. Time is linear in the size (`n log n` if the numbers are out of order), and
/// memory is at most about eight times the size.
///
/// # Errors
/// See [`RigTextError`]; the first error found is returned, line errors before those of the whole.
pub fn parse(bytes: &[u8]) -> Result<RigText, RigTextError> {
    let text = decode(bytes)?;
    let mut rows = Vec::new();
    let mut has_header = false;
    for (line, content) in lines(text) {
        let mut fields = content.split_whitespace().take_while(|field| !field.starts_with('#'));
        let Some(keyword) = fields.next() else { continue };
        match keyword {
            "rig" if has_header => return Err(RigTextError::SecondHeader { line }),
            "rig" => {
                header(line, fields)?;
                has_header = true;
            }
            _ if !has_header => {
                return Err(RigTextError::NoHeader { line, found: quoted(keyword) });
            }
            "joint" => rows.push(row(line, fields)?),
            _ => {
                return Err(RigTextError::UnknownKeyword { line, found: quoted(keyword) });
            }
        }
    }
    if !has_header {
        return Err(RigTextError::Empty);
    }
    connect(rows)
}

/// False if the first bytes of a file cannot begin a `.rig` text: [`parse`] refuses these bytes as it would refuse the file.
pub fn may_begin_with(bytes: &[u8]) -> bool {
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.strip_prefix('\u{FEFF}').unwrap_or(text),
        // The last character may go on.
        Err(error) => return error.error_len().is_none(),
    };
    let keyword =
        lines(text).find_map(|(_, line)| line.split_whitespace().next().filter(|word| !word.starts_with('#')));
    keyword.is_none_or(|keyword| "rig".starts_with(keyword) || keyword.starts_with("rig"))
}

fn decode(bytes: &[u8]) -> Result<&str, RigTextError> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(RigTextError::Utf16);
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let valid = bytes.get(..error.valid_up_to()).unwrap_or_default();
        let text = std::str::from_utf8(valid).unwrap_or_default();
        RigTextError::NotUtf8 { line: lines(text).last().map_or(1, |(line, _)| line) }
    })?;
    Ok(text.strip_prefix('\u{FEFF}').unwrap_or(text))
}

/// Splits text into lines numbered from 1, ended by `\n`, `\r\n` or `\r`.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut rest = Some(text);
    let mut line = 0;
    std::iter::from_fn(move || {
        let text = rest?;
        line += 1;
        let Some(end) = memchr::memchr2(b'\n', b'\r', text.as_bytes()) else {
            rest = None;
            return Some((line, text));
        };
        let (content, ending) = text.split_at(end);
        rest = ending.strip_prefix("\r\n").or_else(|| ending.get(1..));
        Some((line, content))
    })
}

fn header<'a>(line: usize, mut fields: impl Iterator<Item = &'a str>) -> Result<(), RigTextError> {
    let found = fields.next().unwrap_or_default();
    match found.parse::<u64>() {
        Ok(version) if version == u64::from(VERSION) => {}
        Ok(version) if version > u64::from(VERSION) => {
            return Err(RigTextError::NewerVersion { line, found: version });
        }
        _ => {
            return Err(RigTextError::BadVersion { line, found: quoted(found) });
        }
    }
    fields.next().map_or(Ok(()), |extra| Err(RigTextError::ExtraInHeader { line, found: quoted(extra) }))
}

/// A joint as written, its numbers not yet looked up.
struct Row {
    line: usize,
    index: u64,
    parent: Option<u64>,
    position: Vec3,
    label: Option<String>,
}

fn row<'a>(line: usize, mut fields: impl Iterator<Item = &'a str>) -> Result<Row, RigTextError> {
    let mut next = |field| fields.next().ok_or(RigTextError::MissingField { line, field });
    let whole = |field, text: &str| {
        text.parse::<i64>().map_err(|_| RigTextError::NotWhole { line, field, found: quoted(text) })
    };
    let index_text = next(JointField::Index)?;
    let index = u64::try_from(whole(JointField::Index, index_text)?).map_err(|_| RigTextError::NotWhole {
        line,
        field: JointField::Index,
        found: quoted(index_text),
    })?;
    let parent_text = next(JointField::Parent)?;
    let parent = match whole(JointField::Parent, parent_text)? {
        -1 => None,
        parent => Some(u64::try_from(parent).map_err(|_| RigTextError::NotWhole {
            line,
            field: JointField::Parent,
            found: quoted(parent_text),
        })?),
    };
    let mut coordinate = |field| {
        let text = next(field)?;
        let value: f32 = text.parse().map_err(|_| RigTextError::NotNumber { line, field, found: quoted(text) })?;
        if value.is_finite() { Ok(value) } else { Err(RigTextError::NotFinite { line, field, found: quoted(text) }) }
    };
    let position = Vec3::new(coordinate(JointField::X)?, coordinate(JointField::Y)?, coordinate(JointField::Z)?);
    let label = fields.next();
    if let Some(label) = label.filter(|label| label.chars().any(char::is_control)) {
        return Err(RigTextError::ControlCharacter { line, found: quoted(label) });
    }
    if let Some(extra) = fields.next() {
        return Err(RigTextError::ExtraField { line, found: quoted(extra) });
    }
    Ok(Row { line, index, parent, position, label: label.map(str::to_owned) })
}

/// Puts joints in ascending order and looks up their parents.
fn connect(mut rows: Vec<Row>) -> Result<RigText, RigTextError> {
    if !rows.is_sorted_by_key(|row| row.index) {
        rows.sort_by_key(|row| row.index);
    }
    // Rows of equal number keep the order of their lines, so the error names the second of a pair.
    let twice = rows.windows(2).filter(|pair| pair[0].index == pair[1].index).min_by_key(|pair| pair[1].line);
    if let Some([first, second]) = twice {
        return Err(RigTextError::Duplicate { line: second.line, index: second.index, first: first.line });
    }
    let has_gaps = rows.last().is_some_and(|last| last.index != rows.len() as u64 - 1);
    let position_of = |index: u64| {
        if has_gaps {
            rows.binary_search_by_key(&index, |row| row.index).ok()
        } else {
            usize::try_from(index).ok().filter(|&i| i < rows.len())
        }
    };
    let mut parents = Vec::with_capacity(rows.len());
    let mut orphan: Option<(usize, u64, u64)> = None;
    for row in &rows {
        let parent = row.parent.and_then(position_of);
        if let (None, Some(missing)) = (parent, row.parent)
            && orphan.is_none_or(|(line, ..)| row.line < line)
        {
            orphan = Some((row.line, row.index, missing));
        }
        parents.push(parent);
    }
    if let Some((line, index, parent)) = orphan {
        return Err(RigTextError::NoSuchParent { line, index, parent });
    }
    if let Some(cycle) = find_cycle(&parents) {
        let line = cycle.iter().map(|&i| rows[i].line).min().unwrap_or(0);
        let indices: Vec<u64> = cycle.iter().map(|&i| rows[i].index).collect();
        return Err(RigTextError::Cycle { line, joints: error::chain(&indices) });
    }
    let joints = rows
        .into_iter()
        .zip(parents)
        .map(|(row, parent)| RigTextJoint { parent, position: row.position, label: row.label })
        .collect();
    Ok(RigText { joints })
}

/// Returns the joints of a cycle, each followed by its parent, or `None` if there is none. Time is linear.
fn find_cycle(parents: &[Option<usize>]) -> Option<Vec<usize>> {
    /// Marker of a joint that no walk has reached; other values are the start of the walk that has.
    const UNSEEN: usize = usize::MAX;
    let mut seen_from = vec![UNSEEN; parents.len()];
    for start in 0..parents.len() {
        let mut at = Some(start);
        while let Some(joint) = at
            && seen_from[joint] == UNSEEN
        {
            seen_from[joint] = start;
            at = parents[joint];
        }
        if let Some(first) = at
            && seen_from[first] == start
        {
            let mut cycle = vec![first];
            cycle.extend(
                std::iter::successors(parents[first], |&joint| parents[joint]).take_while(|&joint| joint != first),
            );
            return Some(cycle);
        }
    }
    None
}
