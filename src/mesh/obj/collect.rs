//! Assembly of blocks in the order of the file.

use super::{
    MAX_ELEMENTS, NONE, ObjArrays, ObjRun,
    block::{Block, BlockContent, EventKind, Failure, SKIP_CURVES, SKIP_LINES, SKIP_POINTS, SKIPS, SkipCount, WHITE},
    error::{LISTS, LineProblem, ObjError},
};

/// Largest number of `mtllib` statements kept: real files have one.
const MOST_LIBRARIES: usize = 256;

/// Appends blocks to arrays; keeps the state that outlives a block.
pub(super) struct Collector<'a> {
    arrays: &'a mut ObjArrays,
    /// Number of lines of the blocks so far.
    lines: u64,
    /// Indices past the end of their lists so far, each larger than the one before it, and their lines.
    ahead: [Vec<(u32, u64)>; 3],
    skipped: [SkipCount; SKIPS],
    current: RunState,
}

/// State that holds for the next face.
#[derive(Default)]
struct RunState {
    /// Names of object, group and material; empty for none.
    names: [String; 3],
    smoothing: Option<u32>,
    /// The first face with this state.
    since: usize,
    changed: bool,
}

impl<'a> Collector<'a> {
    pub fn new(arrays: &'a mut ObjArrays) -> Self {
        arrays.clear();
        let current = RunState { changed: true, ..Default::default() };
        Self { arrays, lines: 0, ahead: Default::default(), skipped: Default::default(), current }
    }

    /// Appends a block, which must be the next in the file.
    pub fn append(&mut self, block: &mut Block) -> Result<(), ObjError> {
        match block.failure.take() {
            Some(Failure::Io(error)) => return Err(error.into()),
            Some(Failure::Line(problem)) => return Err(ObjError::Line { line: self.line(0), problem }),
            None => {}
        }
        self.arrays.file_size.0 += block.filled as u64;
        let parsed = &mut block.parsed;
        self.resolve_relative(parsed)?;
        if let Some(error) = parsed.error.take() {
            return Err(ObjError::Line { line: self.line(error.line), problem: error.problem });
        }
        self.check_sizes(parsed)?;
        self.append_events(parsed)?;
        self.append_vertices(parsed);
        self.append_faces(parsed);
        self.note_ahead(parsed);
        for (total, here) in self.skipped.iter_mut().zip(&parsed.skipped) {
            if total.count == 0 {
                total.first_line = self.lines + here.first_line + 1;
            }
            total.count += here.count;
        }
        self.lines += u64::from(parsed.lines);
        Ok(())
    }

    /// Line number in the file of a block's line.
    fn line(&self, line: u32) -> u64 {
        self.lines + u64::from(line) + 1
    }

    fn counts(&self) -> [usize; 3] {
        [self.arrays.positions.len(), self.arrays.texcoords.len(), self.arrays.normals.len()]
    }

    fn resolve_relative(&self, parsed: &mut BlockContent) -> Result<(), ObjError> {
        let bases = self.counts();
        for relative in &parsed.relative {
            let list = usize::from(relative.list);
            let value = &mut parsed.corners[list][relative.corner as usize];
            let resolved = bases[list] as i64 + i64::from(*value as i32);
            if resolved < 0 {
                let face = parsed.face_ends.partition_point(|end| *end <= relative.corner);
                return Err(self.before_line(parsed, face, list, resolved));
            }
            *value = resolved as u32;
        }
        Ok(())
    }

    /// The error of an index that counts back to before the first element.
    fn before_line(&self, parsed: &BlockContent, face: usize, list: usize, resolved: i64) -> ObjError {
        // The error gives the distance before the first element, because the number of elements at that line is not
        // stored.
        let line = self.line(parsed.face_lines.get(face).copied().unwrap_or(parsed.lines));
        ObjError::Line {
            line,
            problem: LineProblem::BeforeFirst { list: LISTS[list], missing: resolved.unsigned_abs() },
        }
    }

    fn check_sizes(&self, parsed: &BlockContent) -> Result<(), ObjError> {
        let new = [parsed.positions.len(), parsed.texcoords.len(), parsed.normals.len()];
        let names = ["vertices", "texture coordinates", "normals"];
        for ((old, new), what) in self.counts().into_iter().zip(new).zip(names) {
            if old + new > MAX_ELEMENTS {
                return Err(ObjError::TooMany { what });
            }
        }
        if self.arrays.corners.len() + parsed.corners[0].len() > MAX_ELEMENTS {
            return Err(ObjError::TooMany { what: "face corners" });
        }
        Ok(())
    }

    fn append_events(&mut self, parsed: &BlockContent) -> Result<(), ObjError> {
        let before = self.arrays.face_count();
        for event in &parsed.events {
            let text = String::from_utf8_lossy(&parsed.names[event.start as usize..event.end as usize]);
            if event.what == EventKind::Library {
                let libraries = &mut self.arrays.material_libraries;
                if libraries.len() < MOST_LIBRARIES && !libraries.iter().any(|library| *library == text) {
                    libraries.push(text.into_owned());
                }
                continue;
            }
            self.commit(before + event.face as usize)?;
            let slot = match event.what {
                EventKind::Object => 0,
                EventKind::Group => 1,
                EventKind::Material => 2,
                EventKind::Smoothing(group) => {
                    self.current.smoothing = Some(group);
                    continue;
                }
                EventKind::Library => continue,
            };
            self.current.names[slot].clear();
            // Exporters write `(null)` for faces without material.
            if !(event.what == EventKind::Material && text == "(null)") {
                self.current.names[slot].push_str(&text);
            }
        }
        Ok(())
    }

    /// Ends the run of the faces since the last change, if there are any, and starts the next one at `face`.
    fn commit(&mut self, face: usize) -> Result<(), ObjError> {
        let current = &mut self.current;
        if current.changed && face > current.since {
            let mut numbers = [NONE; 3];
            for (number, name) in numbers.iter_mut().zip(&current.names) {
                if !name.is_empty() {
                    *number = self.arrays.names.intern(name).ok_or(ObjError::TooMany { what: "letters of names" })?;
                }
            }
            let [object, group, material] = numbers;
            let run = ObjRun {
                first_face: current.since as u32,
                object,
                group,
                material,
                smoothing: current.smoothing.unwrap_or(NONE),
            };
            let same = |last: &ObjRun| ObjRun { first_face: run.first_face, ..*last } == run;
            if !self.arrays.runs.last().is_some_and(same) {
                self.arrays.runs.push(run);
            }
        }
        self.current.since = face;
        self.current.changed = true;
        Ok(())
    }

    fn append_vertices(&mut self, parsed: &BlockContent) {
        let arrays = &mut *self.arrays;
        if !(arrays.colors.is_empty() && parsed.colors.is_empty()) {
            let (before, added) = (arrays.positions.len(), parsed.positions.len());
            let missing = before + added - arrays.colors.len();
            grow(&mut arrays.colors, missing);
            arrays.colors.resize(before, WHITE);
            arrays.colors.extend_from_slice(&parsed.colors);
            arrays.colors.resize(before + added, WHITE);
        }
        extend(&mut arrays.positions, &parsed.positions);
        extend(&mut arrays.texcoords, &parsed.texcoords);
        extend(&mut arrays.normals, &parsed.normals);
    }

    fn append_faces(&mut self, parsed: &BlockContent) {
        let arrays = &mut *self.arrays;
        if parsed.face_ends.is_empty() {
            return;
        }
        let before = arrays.corners.len();
        grow(&mut arrays.face_starts, parsed.face_ends.len() + 1);
        if arrays.face_starts.is_empty() {
            arrays.face_starts.push(0);
        }
        arrays.face_starts.extend(parsed.face_ends.iter().map(|end| before as u32 + end));
        extend(&mut arrays.corners, &parsed.corners[0]);
        let after = arrays.corners.len();
        for (list, here) in
            [&mut arrays.corner_texcoords, &mut arrays.corner_normals].into_iter().zip(&parsed.corners[1..])
        {
            if list.is_empty() && here.is_empty() {
                continue;
            }
            grow(list, after - list.len());
            list.resize(before, NONE);
            list.extend_from_slice(here);
            list.resize(after, NONE);
        }
    }

    /// Notes forward indices past the end of their lists so far.
    fn note_ahead(&mut self, parsed: &BlockContent) {
        for (list, count) in self.counts().into_iter().enumerate() {
            if parsed.largest[list] as usize <= count {
                continue;
            }
            let ahead = &mut self.ahead[list];
            let mut highest = ahead.last().map_or(count as u32, |(index, _)| (*index).max(count as u32));
            let mut start = 0;
            for (end, line) in parsed.face_ends.iter().zip(&parsed.face_lines) {
                for corner in &parsed.corners[list][start..*end as usize] {
                    let index = corner.wrapping_add(1);
                    if index > highest {
                        highest = index;
                        ahead.push((index, self.lines + u64::from(*line) + 1));
                    }
                }
                start = *end as usize;
            }
        }
    }

    /// Checks the conditions on the whole file and completes the arrays.
    pub fn finish(mut self) -> Result<(), ObjError> {
        let faces = self.arrays.face_count();
        self.commit(faces)?;
        let mut first: Option<(u64, LineProblem)> = None;
        for (list, count) in self.counts().into_iter().enumerate() {
            if list > 0 && count == 0 {
                self.drop_absent(list);
                continue;
            }
            let outside = self.ahead[list].iter().find(|(index, _)| *index as usize > count);
            if let Some((index, line)) = outside.filter(|(_, line)| first.as_ref().is_none_or(|(l, _)| line < l)) {
                let (index, count) = (u64::from(*index), count as u64);
                first = Some((*line, LineProblem::OutOfRange { list: LISTS[list], index, count }));
            }
        }
        if let Some((line, problem)) = first {
            return Err(ObjError::Line { line, problem });
        }
        self.write_notes();
        Ok(())
    }

    /// Clears a list of corner indices whose elements the file does not have: some exporters number normals or texture
    /// coordinates that they do not write.
    fn drop_absent(&mut self, list: usize) {
        if let Some((_, line)) = self.ahead[list].first() {
            let what = LISTS[list];
            self.arrays.notes.push(format!("faces name {what}s, from line {line} on, but the file has none"));
            let arrays = &mut *self.arrays;
            if list == 1 { &mut arrays.corner_texcoords } else { &mut arrays.corner_normals }.clear();
        }
    }

    fn write_notes(&mut self) {
        for (kind, skipped) in self.skipped.iter().enumerate() {
            if skipped.count == 0 {
                continue;
            }
            let what = match kind {
                SKIP_LINES => "line element(s) (`l`)",
                SKIP_POINTS => "point element(s) (`p`)",
                SKIP_CURVES => "statement(s) of free-form curves and surfaces",
                _ => "unknown statement(s)",
            };
            let note = format!("{} {what} left out, the first on line {}", skipped.count, skipped.first_line);
            self.arrays.notes.push(note);
        }
    }
}

/// Appends to a list, growing it as [`grow`] does.
fn extend<T: Copy>(list: &mut Vec<T>, more: &[T]) {
    grow(list, more.len());
    list.extend_from_slice(more);
}

/// Makes room for `more`. Long lists grow by a quarter rather than to twice their size, which bounds unused memory;
/// large allocations move by remapping pages, so this costs no copies.
fn grow<T>(list: &mut Vec<T>, more: usize) {
    const SMALL: usize = 4 << 20;
    if list.capacity() - list.len() >= more {
        return;
    }
    if list.capacity() * size_of::<T>() < SMALL {
        list.reserve(more);
    } else {
        list.reserve_exact(more.max(list.capacity() + list.capacity() / 4 - list.len()));
    }
}
