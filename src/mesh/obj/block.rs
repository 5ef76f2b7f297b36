//! One block of whole lines, parsed on its own into lists of its own.
//!
//! Plain lines (`v x y z`, `vt`, `vn`, `f` with positive indices) are read here without looking for their end first.
//! Any other line goes to [`super::statement`], which is slower and knows everything. Indices that count backwards
//! are kept relative to the start of the block, because how many vertices come before it is not known yet.

use super::{
    NONE,
    error::{BlockError, LineProblem},
    number::{decimal, index},
};

/// Text and what was read from it. Blocks are used again, so that nothing is allocated per block.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// Bytes of whole lines, up to `filled`.
    pub text: Vec<u8>,
    pub filled: usize,
    /// Why the text could not be read.
    pub failure: Option<Failure>,
    pub parsed: Parsed,
}

/// What is wrong with a block before it is parsed.
#[derive(Debug)]
pub(super) enum Failure {
    Io(std::io::Error),
    /// On the block's first line.
    Line(LineProblem),
}

/// What a block says.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    pub positions: Vec<[f32; 3]>,
    /// Empty, or one a position.
    pub colors: Vec<[f32; 3]>,
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    /// Where each face's corners end.
    pub face_ends: Vec<u32>,
    /// The line of each face.
    pub face_lines: Vec<u32>,
    /// Indices of positions, texture coordinates and normals. The latter two may be shorter: the rest is [`NONE`].
    pub corners: [Vec<u32>; 3],
    /// Corners whose index is relative to the block's start, as a wrapping number.
    pub relative: Vec<Relative>,
    /// The largest index of each list that counts forwards, from 1; 0 if there is none.
    pub largest: [u32; 3],
    pub events: Vec<Event>,
    /// Text of the events.
    pub names: Vec<u8>,
    /// Kinds of statements that were passed over.
    pub skipped: [Skipped; SKIPS],
    /// Lines in the block, or before the error.
    pub lines: u32,
    pub error: Option<BlockError>,
    /// A statement continued over several lines, put together.
    pub joined: Vec<u8>,
}

/// A corner index that counts backwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Relative {
    pub corner: u32,
    /// 0 position, 1 texture coordinate, 2 normal.
    pub list: u8,
}

/// A statement that holds for the faces after it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Event {
    pub what: EventKind,
    /// The number of faces of the block before it.
    pub face: u32,
    /// Its text in [`Parsed::names`].
    pub start: u32,
    pub end: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum EventKind {
    Object,
    Group,
    Material,
    Library,
    Smoothing(u32),
}

/// How often a kind of statement was passed over, and the first line.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Skipped {
    pub count: u64,
    pub first_line: u64,
}

pub(super) const SKIPS: usize = 4;
pub(super) const SKIP_LINES: usize = 0;
pub(super) const SKIP_POINTS: usize = 1;
pub(super) const SKIP_CURVES: usize = 2;
pub(super) const SKIP_UNKNOWN: usize = 3;

impl Block {
    /// Parses the text. An error is kept in [`Parsed::error`]; what came before it is kept too.
    pub fn parse(&mut self) {
        self.parsed.clear();
        if self.failure.is_some() {
            return;
        }
        let text = &self.text[..self.filled];
        let mut at = 0;
        while at < text.len() {
            match self.parsed.plain(&text[at..]) {
                Some(length) => {
                    at += length;
                    self.parsed.lines += 1;
                }
                None => match self.parsed.statement(&text[at..]) {
                    Ok(length) => at += length,
                    Err(problem) => {
                        self.parsed.error = Some(BlockError { line: self.parsed.lines, problem });
                        break;
                    }
                },
            }
        }
        self.parsed.even_out();
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.text.capacity()
    }
}

impl Parsed {
    fn clear(&mut self) {
        self.positions.clear();
        self.colors.clear();
        self.texcoords.clear();
        self.normals.clear();
        self.face_ends.clear();
        self.face_lines.clear();
        self.corners.iter_mut().for_each(Vec::clear);
        self.relative.clear();
        self.largest = [0; 3];
        self.events.clear();
        self.names.clear();
        self.skipped = Default::default();
        self.lines = 0;
        self.error = None;
    }

    /// Makes lists that may be shorter either empty or as long as what they belong to.
    fn even_out(&mut self) {
        let corners = self.corners[0].len();
        for list in &mut self.corners[1..] {
            if !list.is_empty() {
                list.resize(corners, NONE);
            }
        }
        if !self.colors.is_empty() {
            self.colors.resize(self.positions.len(), WHITE);
        }
    }

    /// Reads one plain line and says how long it is with its end; `None`, and nothing kept, if it is not plain.
    #[inline(always)]
    fn plain(&mut self, line: &[u8]) -> Option<usize> {
        match *line.first_chunk::<3>()? {
            [b'v', b' ', _] => self.plain_position(line),
            [b'v', b't', b' '] => {
                let (texcoord, end) = numbers::<2>(line, 3)?;
                let end = match line_end(line, end) {
                    Some(end) => end,
                    None => line_end(line, numbers::<1>(line, end)?.1)?,
                };
                self.texcoords.push(texcoord);
                Some(end)
            }
            [b'v', b'n', b' '] => {
                let (normal, end) = numbers::<3>(line, 3)?;
                let end = line_end(line, end)?;
                self.normals.push(normal);
                Some(end)
            }
            [b'f', b' ', _] => self.plain_face(line),
            [b'\n', ..] => Some(1),
            _ => None,
        }
    }

    #[inline(always)]
    fn plain_position(&mut self, line: &[u8]) -> Option<usize> {
        let (position, end) = numbers::<3>(line, 2)?;
        if let Some(end) = line_end(line, end) {
            self.positions.push(position);
            return Some(end);
        }
        let (color, end) = numbers::<3>(line, end)?;
        let end = line_end(line, end)?;
        self.push_colored(position, color);
        Some(end)
    }

    pub fn push_colored(&mut self, position: [f32; 3], color: [f32; 3]) {
        self.colors.resize(self.positions.len(), WHITE);
        self.positions.push(position);
        self.colors.push(color);
    }

    #[inline(always)]
    fn plain_face(&mut self, line: &[u8]) -> Option<usize> {
        let start = self.corners[0].len();
        let read = self.plain_corners(line, start);
        match read {
            Some(end) if self.corners[0].len() >= start + 3 => {
                self.close_face();
                Some(end)
            }
            _ => {
                self.drop_face(start);
                None
            }
        }
    }

    /// Ends the face whose corners were just pushed.
    pub fn close_face(&mut self) {
        self.face_ends.push(self.corners[0].len() as u32);
        self.face_lines.push(self.lines);
    }

    /// Forgets corners from `start` on.
    pub fn drop_face(&mut self, start: usize) {
        self.corners.iter_mut().for_each(|list| list.truncate(start));
    }

    /// The corners of one face, all of the same form.
    #[inline(always)]
    fn plain_corners(&mut self, line: &[u8], start: usize) -> Option<usize> {
        let mut at = spaces(line, 2)?;
        let (_, after) = index(line, at)?;
        let (with_texcoord, with_normal) = match (line.get(after)?, line.get(after + 1)?) {
            (b'/', b'/') => (false, true),
            (b'/', _) => (true, *line.get(index(line, after + 1)?.1)? == b'/'),
            _ => (false, false),
        };
        if with_texcoord {
            self.corners[1].resize(start, NONE);
        }
        if with_normal {
            self.corners[2].resize(start, NONE);
        }
        let [points, texcoords, normals] = &mut self.corners;
        let mut largest = self.largest;
        loop {
            at = push_index(line, at, points, &mut largest[0])?;
            if with_texcoord {
                at = push_index(line, slash(line, at)?, texcoords, &mut largest[1])?;
            } else if with_normal {
                at = slash(line, at)?;
            }
            if with_normal {
                at = push_index(line, slash(line, at)?, normals, &mut largest[2])?;
            }
            if let Some(end) = line_end(line, at) {
                self.largest = largest;
                return Some(end);
            }
            let next = spaces(line, at)?;
            if next == at {
                return None;
            }
            at = next;
        }
    }
}

/// The colour of vertices that have none in a file where others have.
pub(super) const WHITE: [f32; 3] = [1.0; 3];

#[inline(always)]
fn push_index(line: &[u8], at: usize, list: &mut Vec<u32>, largest: &mut u32) -> Option<usize> {
    let (value, end) = index(line, at)?;
    list.push(value.wrapping_sub(1));
    *largest = (*largest).max(value);
    (value != 0).then_some(end)
}

#[inline(always)]
fn slash(line: &[u8], at: usize) -> Option<usize> {
    (*line.get(at)? == b'/').then_some(at + 1)
}

/// The first place from `at` on that is neither space nor tab.
#[inline(always)]
fn spaces(line: &[u8], mut at: usize) -> Option<usize> {
    while matches!(line.get(at)?, b' ' | b'\t') {
        at += 1;
    }
    Some(at)
}

/// Where the next line starts, if nothing but blanks comes before the end of this one.
#[inline(always)]
fn line_end(line: &[u8], at: usize) -> Option<usize> {
    if *line.get(at)? == b'\n' {
        return Some(at + 1);
    }
    let at = spaces(line, at)?;
    match (line[at], line.get(at + 1)) {
        (b'\n', _) => Some(at + 1),
        (b'\r', Some(b'\n')) => Some(at + 2),
        (b'\r', Some(_)) => Some(at + 1),
        _ => None,
    }
}

/// The next `N` numbers, with blanks before each.
#[inline(always)]
fn numbers<const N: usize>(line: &[u8], mut at: usize) -> Option<([f32; N], usize)> {
    let mut values = [0.0; N];
    for value in &mut values {
        // The byte before must be a blank, or `1.5.5` would be two numbers.
        if !matches!(line[at - 1], b' ' | b'\t') && !matches!(line.get(at)?, b' ' | b'\t') {
            return None;
        }
        (*value, at) = decimal(line, spaces(line, at)?)?;
    }
    Some((values, at))
}

