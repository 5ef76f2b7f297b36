//! Parser of any statement in any form.

use memchr::memchr2;

use super::{
    NONE,
    block::{BlockContent, Event, EventKind, Relative, SKIP_CURVES, SKIP_LINES, SKIP_POINTS, SKIP_UNKNOWN},
    error::{LISTS, LineProblem, excerpt},
    number,
};

impl BlockContent {
    /// Reads the statement that `text` starts with, over all its continued lines. Returns the number of bytes read.
    pub fn statement(&mut self, text: &[u8]) -> Result<usize, LineProblem> {
        let (mut end, mut next) = line_bounds(text, 0);
        let mut lines = 1;
        let comment = text[..end].trim_ascii_start().first() == Some(&b'#');
        if comment || text[..end].last() != Some(&b'\\') {
            self.interpret(&text[..end])?;
        } else {
            let mut joined = std::mem::take(&mut self.joined);
            joined.clear();
            joined.extend_from_slice(&text[..end]);
            while joined.last() == Some(&b'\\') {
                joined.pop();
                joined.push(b' ');
                if next == text.len() {
                    break;
                }
                let start = next;
                (end, next) = line_bounds(text, start);
                joined.extend_from_slice(&text[start..end]);
                lines += 1;
            }
            let result = self.interpret(&joined);
            self.joined = joined;
            result?;
        }
        self.lines += lines;
        Ok(next)
    }

    fn interpret(&mut self, line: &[u8]) -> Result<(), LineProblem> {
        let line = line.trim_ascii();
        let (keyword, rest) = split_token(line);
        match keyword {
            b"" => {}
            _ if keyword[0] == b'#' => {}
            b"v" => self.position(rest)?,
            b"vt" => {
                let [u, v, _] = coordinates("vt", rest, 1)?;
                self.texcoords.push([u, v]);
            }
            b"vn" => {
                let normal = coordinates("vn", rest, 3)?;
                self.normals.push(normal);
            }
            b"f" | b"fo" => self.face(rest)?,
            b"o" => self.event(EventKind::Object, rest),
            b"g" => self.event(EventKind::Group, rest),
            b"usemtl" => self.event(EventKind::Material, rest),
            b"mtllib" => self.event(EventKind::Library, rest),
            b"s" => self.smoothing(rest),
            b"l" => self.skip(SKIP_LINES),
            b"p" => self.skip(SKIP_POINTS),
            _ if CURVES.contains(&keyword) => self.skip(SKIP_CURVES),
            _ if DISPLAY.contains(&keyword) => {}
            _ => self.skip(SKIP_UNKNOWN),
        }
        Ok(())
    }

    /// `v x y z`, with a weight `w`, or with a colour `r g b` and perhaps its opacity.
    fn position(&mut self, rest: &[u8]) -> Result<(), LineProblem> {
        let mut values = [0.0; 7];
        let found = fill(&mut values, rest)?;
        if found < 3 {
            return Err(LineProblem::FewNumbers { keyword: "v", wanted: 3, found });
        }
        let [x, y, z, r, g, b, _] = values;
        if found >= 6 {
            self.push_colored([x, y, z], [r, g, b]);
        } else {
            self.positions.push([x, y, z]);
        }
        Ok(())
    }

    fn face(&mut self, rest: &[u8]) -> Result<(), LineProblem> {
        let start = self.corners[0].len();
        let (lengths, relative) = (self.lengths(), self.relative.len());
        let result = self.corners_of(rest, start);
        if result.is_err() {
            self.drop_face(lengths);
            self.relative.truncate(relative);
        }
        result
    }

    fn corners_of(&mut self, mut rest: &[u8], start: usize) -> Result<(), LineProblem> {
        loop {
            let (corner, more) = split_token(rest);
            if corner.is_empty() || corner[0] == b'#' {
                break;
            }
            rest = more;
            let mut fields = corner.split(|&byte| byte == b'/');
            for list in 0..3 {
                let field = fields.next().unwrap_or_default();
                if !field.is_empty() {
                    self.corner_index(list, field, corner)?;
                } else if list == 0 {
                    return Err(LineProblem::BadCorner { text: excerpt(corner) });
                }
            }
            if fields.next().is_some() {
                return Err(LineProblem::BadCorner { text: excerpt(corner) });
            }
        }
        let corners = self.corners[0].len() - start;
        if corners < 3 {
            return Err(LineProblem::FewCorners { corners });
        }
        self.close_face();
        Ok(())
    }

    /// Adds one index to the current corner. The index of list 0 comes first and makes the corner.
    fn corner_index(&mut self, list: usize, field: &[u8], corner: &[u8]) -> Result<(), LineProblem> {
        let at = self.corners[0].len() - usize::from(list > 0);
        let count = [self.positions.len(), self.texcoords.len(), self.normals.len()][list];
        let huge = || LineProblem::HugeIndex { list: LISTS[list], text: excerpt(field) };
        let value = match whole(field).ok_or_else(|| LineProblem::BadCorner { text: excerpt(corner) })? {
            0 => return Err(LineProblem::ZeroIndex { list: LISTS[list] }),
            // The block's place in the file is not known yet; the index is checked when the block is appended.
            index @ 1.. => {
                let index = u32::try_from(index).map_err(|_| huge())?;
                self.largest[list] = self.largest[list].max(index);
                index - 1
            }
            back => {
                let back = i32::try_from(back).map_err(|_| huge())?;
                self.relative.push(Relative { corner: at as u32, list: list as u8 });
                (count as i64 + i64::from(back)) as u32
            }
        };
        let values = &mut self.corners[list];
        values.resize(at, NONE);
        values.push(value);
        Ok(())
    }

    fn smoothing(&mut self, rest: &[u8]) {
        let (group, _) = split_token(rest);
        let group = match group {
            b"off" | b"" => Some(0),
            b"on" => Some(1),
            _ => whole(group).and_then(|group| u32::try_from(group).ok()).filter(|group| *group != NONE),
        };
        match group {
            Some(group) => self.event(EventKind::Smoothing(group), b""),
            None => self.skip(SKIP_UNKNOWN),
        }
    }

    fn event(&mut self, what: EventKind, text: &[u8]) {
        let start = self.names.len() as u32;
        self.names.extend_from_slice(text);
        let event = Event { what, face: self.face_ends.len() as u32, start, end: self.names.len() as u32 };
        self.events.push(event);
    }

    fn skip(&mut self, kind: usize) {
        let skipped = &mut self.skipped[kind];
        if skipped.count == 0 {
            skipped.first_line = u64::from(self.lines);
        }
        skipped.count += 1;
    }
}

/// Statements of curves, surfaces and other things that are not polygons.
const CURVES: &[&[u8]] = &[
    b"vp", b"cstype", b"deg", b"bmat", b"step", b"curv", b"curv2", b"surf", b"parm", b"trim", b"hole", b"scrv", b"sp",
    b"end", b"con", b"bzp", b"bsp", b"cdc", b"cdp", b"res", b"call", b"csh",
];

/// Statements about display, which no polygon depends on.
const DISPLAY: &[&[u8]] = &[
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"maplib",
    b"usemap",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"mg",
];

/// End of the line that starts at `start`, and start of the next one.
fn line_bounds(text: &[u8], start: usize) -> (usize, usize) {
    let Some(length) = memchr2(b'\n', b'\r', &text[start..]) else { return (text.len(), text.len()) };
    let end = start + length;
    let crlf = text[end..].starts_with(b"\r\n");
    (end, end + 1 + usize::from(crlf))
}

/// The first token, and the rest of the line without blanks at either end.
fn split_token(line: &[u8]) -> (&[u8], &[u8]) {
    let line = line.trim_ascii();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii_start())
}

/// Reads numbers until the line or a comment ends, and returns their count; numbers past the end of `values` are
/// checked and dropped.
fn fill(values: &mut [f32], mut rest: &[u8]) -> Result<usize, LineProblem> {
    let mut found = 0;
    loop {
        let (token, more) = split_token(rest);
        if token.is_empty() || token[0] == b'#' {
            return Ok(found);
        }
        rest = more;
        let value = number::token(token).ok_or_else(|| LineProblem::NotANumber { text: excerpt(token) })?;
        if !value.is_finite() {
            return Err(LineProblem::NotFinite { text: excerpt(token) });
        }
        if let Some(slot) = values.get_mut(found) {
            *slot = value;
        }
        found += 1;
    }
}

/// Up to three numbers, at least `wanted`; missing ones are 0.
fn coordinates(keyword: &'static str, rest: &[u8], wanted: usize) -> Result<[f32; 3], LineProblem> {
    let mut values = [0.0; 3];
    let found = fill(&mut values, rest)?;
    if found < wanted {
        return Err(LineProblem::FewNumbers { keyword, wanted, found });
    }
    Ok(values)
}

/// A whole number with or without sign. A number too large for `i64` is clamped, which stays out of range.
fn whole(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        _ => (false, text),
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value =
        digits.iter().fold(0_i64, |value, digit| value.saturating_mul(10).saturating_add(i64::from(digit - b'0')));
    Some(if negative { -value } else { value })
}
