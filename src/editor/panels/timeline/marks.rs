//! Keys as marks: where many stand within few pixels, one bar stands for all of them, so that the number of marks depends on the
//! width of the panel alone.

use super::axis::TimeAxis;
use crate::rig::animation::{Ease, Key};

/// Least distance in pixels of two marks.
const APART: f32 = 7.0;
/// Half of the width of a mark, in pixels.
pub(super) const HALF: f32 = 4.5;

/// Interpolation of a key, as its mark shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MarkKind {
    /// Stepped: a square.
    Stepped,
    /// Linear: a diamond.
    Linear,
    /// Cubic: a disc.
    Cubic,
}

/// Time of one or more keys.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Second in the clip.
    pub time: f32,
    /// Interpolation of the first of the keys.
    pub kind: MarkKind,
}

impl From<&Key> for Mark {
    fn from(key: &Key) -> Self {
        let kind = match key.ease {
            Ease::Stepped => MarkKind::Stepped,
            Ease::Linear => MarkKind::Linear,
            Ease::Cubic { .. } => MarkKind::Cubic,
        };
        Self { time: key.time, kind }
    }
}

/// Marks by rising time, of each time one.
pub(super) fn merged(mut marks: Vec<Mark>) -> Vec<Mark> {
    marks.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.kind.cmp(&b.kind)));
    marks.dedup_by(|later, first| later.time == first.time);
    marks
}

/// Marks that are drawn as one: a single one, or a bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bucket {
    /// Pixels of the first and the last mark.
    pub x: [f32; 2],
    /// Times of the two.
    pub times: [f32; 2],
    /// Number of marks.
    pub count: usize,
    /// Interpolation of the first one.
    pub kind: MarkKind,
}

/// Visible marks, gathered where they stand close. The cost grows with the width of the axis and the logarithm of the marks.
pub fn buckets(marks: &[Mark], axis: &TimeAxis) -> Vec<Bucket> {
    let room = HALF / axis.scale();
    let mut first = marks.partition_point(|mark| mark.time < axis.span[0] - room);
    let end = marks.partition_point(|mark| mark.time <= axis.span[1] + room);
    let mut found = Vec::new();
    while first < end {
        let mark = marks[first];
        let limit = mark.time + APART / axis.scale();
        let behind = first + marks[first..end].partition_point(|other| other.time < limit);
        // Where numbers are too coarse for pixels, a mark at least contains itself.
        let behind = behind.max(first + 1);
        let last = marks[behind - 1];
        found.push(Bucket {
            x: [axis.at(mark.time), axis.at(last.time)],
            times: [mark.time, last.time],
            count: behind - first,
            kind: mark.kind,
        });
        first = behind;
    }
    found
}

/// The bucket under a pixel, with some reach beside it; the nearest one.
pub(super) fn bucket_at(buckets: &[Bucket], x: f32) -> Option<Bucket> {
    let distance = |bucket: &Bucket| (bucket.x[0] - x).max(x - bucket.x[1]).max(0.0);
    let near = buckets.iter().filter(|bucket| distance(bucket) <= HALF + 1.0);
    near.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}

/// Number of these times, which rise, from the first to the last second of a span, both included.
pub(super) fn count_within(times: &[f32], span: [f32; 2]) -> usize {
    times.partition_point(|time| *time <= span[1]) - times.partition_point(|time| *time < span[0])
}
