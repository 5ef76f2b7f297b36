//! Work of expressions, counted where it is done.

use std::cell::Cell;

thread_local! {
    static POINTS: Cell<u64> = const { Cell::new(0) };
}

/// Number of points of heads that this thread has visited since its start to prepare faces for expressions, to pose and to
/// skin them. Heads with more points take more.
pub fn visited_points() -> u64 {
    POINTS.get()
}

/// Counts visited points.
pub(super) fn visit(points: usize) {
    POINTS.set(POINTS.get() + points as u64);
}
