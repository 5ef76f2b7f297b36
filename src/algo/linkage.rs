//! Average linkage: hierarchical clustering by the mean distance over all pairs of points, one of each cluster.
//!
//! Exact for the mean Euclidean distance, in linear memory and far from quadratic time. Average linkage is *reducible*
//! (two clusters that merge come no nearer to any third), so all pairs of clusters that are each other's nearest may be
//! merged at once, in any order, and give one and the same history (Murtagh, "A survey of recent advances in
//! hierarchical clustering algorithms", 1983). Nearest clusters are found without visiting all pairs of points:
//!
//! 1. While there are many clusters, each keeps its mean and its variance. With Δ between two means, the mean distance
//!    lies in |Δ| ≤ d ≤ √(Δ² + var + var) (Jensen's inequality both ways), which leaves a handful of candidates; a
//!    hierarchy of boxes over the means finds them, and sums over their pairs of points decide.
//! 2. Once a few hundred clusters are left, a matrix of all mean distances is filled, far pairs from their moments up
//!    to the fourth with a proven bound on the rest, and kept by Lance and Williams' formula.
//!
//! Sums decide in single precision only where their error cannot matter; near ties are summed again in double
//! precision, and ties go to the clusters that were there first. So the answer depends on the points alone.

mod boxes;
mod dense;
mod engine;
mod history;
pub(super) mod kd;
mod line;
mod moments;
mod pair;
mod search;

use glam::Vec3;
use thiserror::Error;

/// Progress callback, called now and then with the finished share (0 to 1, never falling); it cancels by returning
/// `false`.
pub type Progress<'a> = &'a (dyn Fn(f32) -> bool + Sync);

/// Largest number of points: clusters have 32-bit numbers, of which one bit is reserved.
const MAX_POINTS: usize = (1 << 30) - 1;

/// Merge of two clusters. Points are clusters 0 to n - 1, merge `i` makes cluster n + i.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Merge {
    /// The cluster with the lower number.
    pub first: u32,
    /// The cluster with the higher number.
    pub second: u32,
    /// Distance of the two clusters.
    pub height: f32,
    /// Number of points in the merged cluster.
    pub size: u32,
}

/// The whole merge history, by height.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dendrogram {
    /// Number of points.
    pub points: usize,
    /// The merges, lowest first; one fewer than points.
    pub merges: Vec<Merge>,
}

impl Dendrogram {
    /// Labels each point with its group where `groups` groups are left (at least one, at most as many as points).
    ///
    /// Groups are numbered by their first point. Linear time.
    pub fn cut(&self, groups: usize) -> Vec<u32> {
        let points = self.points;
        let applied = points.saturating_sub(groups.max(1)).min(self.merges.len());
        // From the last applied merge down, both parts get the label of their whole.
        let mut owner: Vec<u32> = (0..(points + applied) as u32).collect();
        for (index, merge) in self.merges[..applied].iter().enumerate().rev() {
            let whole = owner[points + index];
            for part in [merge.first, merge.second] {
                if let Some(slot) = owner.get_mut(part as usize) {
                    *slot = whole;
                }
            }
        }
        let mut number = vec![u32::MAX; points + applied];
        let mut next = 0;
        owner[..points]
            .iter()
            .map(|&whole| {
                let number = &mut number[whole as usize];
                if *number == u32::MAX {
                    *number = next;
                    next += 1;
                }
                *number
            })
            .collect()
    }

    /// The heights of the `last` merges, highest first.
    pub fn heights(&self, last: usize) -> Vec<f32> {
        self.merges.iter().rev().take(last).map(|merge| merge.height).collect()
    }
}

/// Error of clustering points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum LinkageError {
    /// A coordinate that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// No points to cluster.
    #[error("there are no points to group; pick a mesh with vertices")]
    Empty,
    /// More points than clusters can be numbered.
    #[error("{points} points are more than {MAX_POINTS} that can be grouped; simplify the mesh first")]
    TooMany {
        /// Number of points.
        points: usize,
    },
    /// Cancelled by the progress callback.
    #[error("grouping was cancelled")]
    Cancelled,
}

/// Average linkage of points in space: the distance of two clusters is the mean Euclidean distance over all pairs.
///
/// Heights are in the units of the points, exact to 1e-5 of themselves. Memory is linear in the points (some 150 bytes each, and 1 MB
/// more). Time on surfaces grows about as n log n; points that lie evenly in space (many ties) are
/// slower, never wrong.
pub fn average_linkage(points: &[Vec3], progress: Progress) -> Result<Dendrogram, LinkageError> {
    check(points)?;
    engine::run::<false>(points, progress)
}

/// Average linkage of numbers: the distance of two clusters is the mean absolute difference over all pairs.
///
/// On a line clusters are always intervals: of three intervals in a row, the mean of the second lies between those of the
/// others, and the mean absolute difference of intervals that do not overlap is the difference of their means. So the
/// nearest cluster is always a neighbour, and a chain along the sorted values finds all merges in linear time after the
/// sort. Heights are exact up to rounding.
pub fn average_linkage_1d(values: &[f32], progress: Progress) -> Result<Dendrogram, LinkageError> {
    if values.is_empty() {
        return Err(LinkageError::Empty);
    }
    if values.len() > MAX_POINTS {
        return Err(LinkageError::TooMany { points: values.len() });
    }
    if let Some(point) = values.iter().position(|value| !value.is_finite()) {
        return Err(LinkageError::NotFinite { point });
    }
    line::run(values, progress)
}

/// Average linkage of points in space by the mean *squared* distance: an instant preview of [`average_linkage`].
///
/// The mean squared distance is Δ² + var + var exactly, so no pair of points is visited. Heights are in squared units.
pub fn squared_linkage(points: &[Vec3], progress: Progress) -> Result<Dendrogram, LinkageError> {
    check(points)?;
    engine::run::<true>(points, progress)
}

fn check(points: &[Vec3]) -> Result<(), LinkageError> {
    if points.is_empty() {
        return Err(LinkageError::Empty);
    }
    if points.len() > MAX_POINTS {
        return Err(LinkageError::TooMany { points: points.len() });
    }
    match points.iter().position(|point| !point.is_finite()) {
        Some(point) => Err(LinkageError::NotFinite { point }),
        None => Ok(()),
    }
}
