//! Block of whole lines of an OBJ file, parsed into lists of its own.
//!
//! Plain lines (`v x y z`, `vt`, `vn`, `f` with positive indices) are read here without looking for their end first.
//! Any other line goes to [`super::statement`], which is slower and handles every statement. Indices that count
//! backwards are kept relative to the start of the block, because the number of vertices before it is not known yet.

use super::{
    NONE,
    error::{BlockError, LineProblem},
    scan::{Scan, WINDOW},
};

/// Line ends after the text, so that plain lines need no bounds checks near its end.
pub(super) const MARGIN: usize = WINDOW + 8;

/// Text and the values parsed from it. Blocks are reused, so that nothing is allocated per block.
#[derive(Debug, Default)]
pub(super) struct Block {
    /// Bytes of whole lines, up to `filled`, and at least [`MARGIN`] line ends after them.
    pub text: Vec<u8>,
    pub filled: usize,
    /// Failure to read the text.
    pub failure: Option<Failure>,
    pub parsed: BlockContent,
}

/// Failure of a block before it is parsed.
#[derive(Debug)]
pub(super) enum Failure {
    Io(std::io::Error),
    /// A problem on the block's first line.
    Line(LineProblem),
}

/// Values parsed from a block.
#[derive(Debug, Default)]
pub(super) struct BlockContent {
    pub positions: Vec<[f32; 3]>,
    /// Colours, one a position, or empty.
    pub colors: Vec<[f32; 3]>,
    pub texcoords: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    /// End of each face's corners.
    pub face_ends: Vec<u32>,
    /// The line of each face.
    pub face_lines: Vec<u32>,
    /// Indices of positions, texture coordinates and normals. The latter two lists may be shorter: missing entries are
    /// [`NONE`].
    pub corners: [Vec<u32>; 3],
    /// Corners whose index is relative to the block's start, as a wrapping number.
    pub relative: Vec<Relative>,
    /// The largest forward index of each list, from 1; 0 without any.
    pub largest: [u32; 3],
    pub events: Vec<Event>,
    /// Text of the events.
    pub names: Vec<u8>,
    /// Counts of skipped statements by kind.
    pub skipped: [SkipCount; SKIPS],
    /// Lines in the block, or before the error.
    pub lines: u32,
    pub error: Option<BlockError>,
    /// Buffer for a statement continued over several lines.
    pub joined: Vec<u8>,
}

/// A corner index that counts backwards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Relative {
    pub corner: u32,
    /// List of the index: 0 position, 1 texture coordinate, 2 normal.
    pub list: u8,
}

/// A statement that holds for the faces after it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Event {
    pub what: EventKind,
    /// Number of the block's faces before the statement.
    pub face: u32,
    /// Start of the statement's text in [`BlockContent::names`].
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

/// Number of skipped statements of one kind, and the line of the first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SkipCount {
    pub count: u64,
    pub first_line: u64,
}

pub(super) const SKIPS: usize = 4;
pub(super) const SKIP_LINES: usize = 0;
pub(super) const SKIP_POINTS: usize = 1;
pub(super) const SKIP_CURVES: usize = 2;
pub(super) const SKIP_UNKNOWN: usize = 3;

impl Block {
    /// Parses the text. An error is kept in [`BlockContent::error`], together with the values before it.
    pub fn parse(&mut self) {
        self.parsed.clear();
        if self.failure.is_some() {
            return;
        }
        let mut at = 0;
        while at < self.filled {
            match self.parsed.plain(&self.text, at) {
                Some(next) => {
                    at = next;
                    self.parsed.lines += 1;
                }
                None => match self.parsed.statement(&self.text[at..self.filled]) {
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

    /// Memory of the large lists in bytes.
    pub fn bytes(&self) -> usize {
        let corners = self.parsed.corners.iter().map(Vec::capacity).sum::<usize>() + self.parsed.relative.capacity();
        self.text.capacity() + 4 * corners + self.parsed.joined.capacity() + 24 * self.parsed.positions.capacity()
    }
}

impl BlockContent {
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

    /// Makes each optional list either empty or as long as the list it belongs to.
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

    /// Reads the plain line that starts at `at` and returns the start of the next line; returns `None` and keeps
    /// nothing if the line is not plain.
    #[inline(always)]
    fn plain(&mut self, text: &[u8], at: usize) -> Option<usize> {
        match *text.get(at..)?.first_chunk::<3>()? {
            [b'v', b' ', _] => {
                let mut scan = Scan::new(text, at, 2)?;
                let (position, end) = scan.decimals::<3>(at + 2)?;
                if let Some(next) = scan.line_end(end) {
                    self.positions.push(position);
                    return Some(next);
                }
                let start = scan.separated(end)?;
                let (color, end) = scan.decimals::<3>(start)?;
                let next = scan.line_end(end)?;
                self.push_colored(position, color);
                Some(next)
            }
            [b'v', b't', b' '] => {
                let mut scan = Scan::new(text, at, 3)?;
                let (texcoord, end) = scan.decimals::<2>(at + 3)?;
                let next = match scan.line_end(end) {
                    Some(next) => next,
                    None => {
                        let start = scan.separated(end)?;
                        let (_, end) = scan.decimal(start)?;
                        scan.line_end(end)?
                    }
                };
                self.texcoords.push(texcoord);
                Some(next)
            }
            [b'v', b'n', b' '] => {
                let mut scan = Scan::new(text, at, 3)?;
                let (normal, end) = scan.decimals::<3>(at + 3)?;
                let next = scan.line_end(end)?;
                self.normals.push(normal);
                Some(next)
            }
            [b'f', b' ', _] => self.plain_face(text, at),
            [b'\n', ..] => Some(at + 1),
            _ => None,
        }
    }

    pub fn push_colored(&mut self, position: [f32; 3], color: [f32; 3]) {
        self.colors.resize(self.positions.len(), WHITE);
        self.positions.push(position);
        self.colors.push(color);
    }

    #[inline(always)]
    fn plain_face(&mut self, text: &[u8], at: usize) -> Option<usize> {
        let start = self.corners[0].len();
        let lengths = self.lengths();
        match self.plain_corners(text, at, start) {
            Some(next) if self.corners[0].len() >= start + 3 => {
                self.close_face();
                Some(next)
            }
            _ => {
                self.drop_face(lengths);
                None
            }
        }
    }

    /// Ends the face whose corners were just pushed.
    pub fn close_face(&mut self) {
        self.face_ends.push(self.corners[0].len() as u32);
        self.face_lines.push(self.lines);
    }

    /// Lengths of the lists of corners.
    pub fn lengths(&self) -> [usize; 3] {
        self.corners.each_ref().map(Vec::len)
    }

    /// Removes an unfinished face, given the lengths of the lists of corners before it. Lists that were empty become
    /// empty again: an empty list means that no corner has such an index.
    pub fn drop_face(&mut self, lengths: [usize; 3]) {
        for (list, length) in self.corners.iter_mut().zip(lengths) {
            list.truncate(length);
        }
    }

    /// Reads the corners of one face, all of the same form.
    #[inline(always)]
    fn plain_corners(&mut self, text: &[u8], at: usize, start: usize) -> Option<usize> {
        let mut scan = Scan::new(text, at, 2)?;
        let mut at = scan.blanks(at + 2)?;
        let [points, texcoords, normals] = &mut self.corners;
        let mut largest = self.largest;
        at = push_index(&mut scan, at, points, &mut largest[0])?;
        let (with_texcoord, with_normal) = match (text.get(at)?, text.get(at + 1)?) {
            (b'/', b'/') => (false, true),
            (b'/', _) => {
                texcoords.resize(start, NONE);
                at = scan.slash(at)?;
                at = push_index(&mut scan, at, texcoords, &mut largest[1])?;
                (true, *text.get(at)? == b'/')
            }
            _ => (false, false),
        };
        if with_normal {
            normals.resize(start, NONE);
            at = if with_texcoord { scan.slash(at)? } else { scan.slashes(at)? };
            at = push_index(&mut scan, at, normals, &mut largest[2])?;
        }
        loop {
            if let Some(next) = scan.line_end(at) {
                self.largest = largest;
                return Some(next);
            }
            at = scan.separated(at)?;
            at = push_index(&mut scan, at, points, &mut largest[0])?;
            if with_texcoord {
                at = scan.slash(at)?;
                at = push_index(&mut scan, at, texcoords, &mut largest[1])?;
            }
            if with_normal {
                at = if with_texcoord { scan.slash(at)? } else { scan.slashes(at)? };
                at = push_index(&mut scan, at, normals, &mut largest[2])?;
            }
        }
    }
}

/// The colour of vertices without one in a file where others have colours.
pub(super) const WHITE: [f32; 3] = [1.0; 3];

/// Reads an index and appends it, counted from 0.
#[inline(always)]
fn push_index(scan: &mut Scan, at: usize, list: &mut Vec<u32>, largest: &mut u32) -> Option<usize> {
    let (value, end) = scan.index(at)?;
    list.push(value.wrapping_sub(1));
    *largest = (*largest).max(value);
    (value != 0).then_some(end)
}
