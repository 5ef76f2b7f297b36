//! Average linkage on a line.

use rayon::prelude::*;

use super::{Dendrogram, LinkageError, Progress, history::History};

/// An interval of the sorted values.
#[derive(Clone, Copy)]
struct Interval {
    /// Sum of its values.
    sum: f64,
    /// Number of values.
    size: u32,
    /// Node of the interval in the history.
    node: u32,
}

impl Interval {
    fn mean(&self) -> f64 {
        self.sum / f64::from(self.size)
    }
}

/// Number of merges between two calls of the progress callback.
const REPORT: usize = 1 << 14;

/// Clusters finite values.
///
/// The gaps between the intervals on the left stack fall towards its top. While the gap ahead is smaller still, the
/// chain goes on; else the two topmost intervals are each other's nearest and merge. The merged interval waits on the
/// right, since its gap to the left has grown. Each merge adds one step, so the time is linear.
pub(super) fn run(values: &[f32], progress: Progress) -> Result<Dendrogram, LinkageError> {
    let mut sorted: Vec<u64> =
        values.iter().enumerate().map(|(at, &value)| u64::from(ordered(value)) << 32 | at as u64).collect();
    sorted.par_sort_unstable();
    let mut history = History::new(values.len());
    let mut right: Vec<Interval> = sorted
        .iter()
        .rev()
        .map(|&key| Interval { sum: f64::from(values[key as u32 as usize]), size: 1, node: key as u32 })
        .collect();
    let mut left: Vec<(Interval, f64)> = Vec::new();
    let mut reported = 0;
    loop {
        let ahead = match (left.last(), right.last()) {
            (Some((top, _)), Some(next)) => (next.mean() - top.mean()).max(0.0),
            _ => f64::INFINITY,
        };
        // The left of two equal gaps is taken.
        if let Some(&(top, gap)) = left.last()
            && gap <= ahead
            && gap < f64::INFINITY
        {
            left.pop();
            let Some((before, _)) = left.pop() else { break };
            let size = before.size + top.size;
            let node = history.join(before.node, top.node, gap, size);
            right.push(Interval { sum: before.sum + top.sum, size, node });
            if history.len() >= reported + REPORT {
                reported = history.len();
                if !progress(reported as f32 / values.len() as f32) {
                    return Err(LinkageError::Cancelled);
                }
            }
        } else if let Some(next) = right.pop() {
            left.push((next, ahead));
        } else {
            break;
        }
    }
    if !progress(1.0) {
        return Err(LinkageError::Cancelled);
    }
    Ok(history.finish(1.0))
}

/// Bits in the order of the numbers; both zeros are equal.
fn ordered(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}
