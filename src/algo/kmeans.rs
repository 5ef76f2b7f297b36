//! k-means: groups of points around centroids, with the least square error.
//!
//! Seeds are spread over dense regions ("Automatic placement of bones on face models", section 3.2): each next one is
//! drawn in proportion to the points' squared distances from the seeds so far, the best of several draws kept (Arthur
//! and Vassilvitskii, "k-means++", 2007), so a seed is likely where many points are far from any. Then points go to
//! their nearest centroid and centroids to their points' mean, until no point changes its group (Lloyd).
//!
//! In the first rounds, centroids jump from groups that could be merged with a neighbour to groups that should be
//! split, which Lloyd's rounds alone never do. For many points, means of eight neighbours each are grouped first: that
//! is fast enough to try jumps until none lowers the error, and leaves little work for the points themselves.
//!
//! Bounds show for most points that their group cannot have changed: the largest distance of the own centroid and the
//! least distance of any other (Hamerly, "Making k-means even faster", 2010). They are stored relative to the distance
//! that centroids have moved since the start, so a point whose bounds hold is not written, and a block of such points
//! is not even read. Bounds only avoid comparisons without effect, so the result is that of [`kmeans_plain`] to the
//! last bit.
//!
//! Sums are integers (in units of 2⁻³⁴ of the extent), which makes them exact in any order: points that change their
//! group are added and subtracted, on any number of threads.

mod coarse;
mod lloyd;
mod rearrange;
mod seeds;
mod space;

use glam::Vec3;
use thiserror::Error;

use self::space::Space;

/// Progress callback, called now and then with the finished share (0 to 1, never falling); it cancels by returning
/// `false`.
pub type Progress<'a> = &'a (dyn Fn(f32) -> bool + Sync);

/// Settings of [`kmeans`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KMeansSettings {
    /// Number of groups, fixed ones included.
    pub groups: usize,
    /// Number of starts with different seeds; the least error is kept. At least one is made.
    pub starts: usize,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Largest number of rounds of a start, even if points still change their groups.
    pub max_rounds: usize,
}

impl Default for KMeansSettings {
    fn default() -> Self {
        Self { groups: 40, starts: 3, seed: 0, max_rounds: 1000 }
    }
}

/// Result of [`kmeans`].
#[derive(Debug, Clone, PartialEq)]
pub struct KMeans {
    /// The centroid of each group; fixed ones first, in their given order.
    pub centroids: Vec<Vec3>,
    /// The group of each point: the nearest centroid, the first of equally near ones.
    pub labels: Vec<u32>,
    /// Sum over all points of the squared distance to their centroid.
    pub square_error: f64,
    /// Number of rounds of the best start.
    pub rounds: usize,
}

/// Error of grouping points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum KMeansError {
    /// A request for zero groups.
    #[error("0 groups were asked for; ask for at least 1")]
    NoGroups,
    /// More groups than points.
    #[error("{groups} groups are more than {points} points; ask for fewer groups")]
    MoreGroupsThanPoints {
        /// Number of groups requested.
        groups: usize,
        /// Number of points.
        points: usize,
    },
    /// More groups than different points.
    #[error("{groups} groups are more than {distinct} different places of points; ask for fewer groups")]
    MoreGroupsThanPlaces {
        /// Number of groups requested.
        groups: usize,
        /// Number of different points.
        distinct: usize,
    },
    /// More fixed centroids than groups.
    #[error("{fixed} fixed centroids are more than {groups} groups; ask for more groups or fix fewer")]
    MoreFixedThanGroups {
        /// Number of fixed centroids.
        fixed: usize,
        /// Number of groups requested.
        groups: usize,
    },
    /// A point that is not finite.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Index of the point.
        point: usize,
    },
    /// A fixed centroid that is not finite.
    #[error("fixed centroid {centroid} has a coordinate that is not a finite number")]
    FixedNotFinite {
        /// Index of the centroid.
        centroid: usize,
    },
    /// More points than can be summed.
    #[error("{points} points are more than {} that can be grouped; simplify the mesh first", space::MAX_POINTS)]
    TooMany {
        /// Number of points.
        points: usize,
    },
    /// Cancelled by the progress callback.
    #[error("grouping was cancelled")]
    Cancelled,
}

/// Groups points around centroids; `fixed` ones come first in the result, never move and count among the groups.
///
/// The result depends on points, fixed centroids and settings alone, not on the number of threads. A group that loses
/// all its points is moved to the point that is furthest from its centroid.
pub fn kmeans(
    points: &[Vec3],
    fixed: &[Vec3],
    settings: &KMeansSettings,
    progress: Progress,
) -> Result<KMeans, KMeansError> {
    run::<true>(points, fixed, settings, progress)
}

/// Groups points as [`kmeans`] does, without any bounds: all distances in all rounds. For comparison.
pub fn kmeans_plain(
    points: &[Vec3],
    fixed: &[Vec3],
    settings: &KMeansSettings,
    progress: Progress,
) -> Result<KMeans, KMeansError> {
    run::<false>(points, fixed, settings, progress)
}

fn run<const BOUNDS: bool>(
    points: &[Vec3],
    fixed: &[Vec3],
    settings: &KMeansSettings,
    progress: Progress,
) -> Result<KMeans, KMeansError> {
    check(points, fixed, settings.groups)?;
    let starts = settings.starts.max(1);
    let space = Space::new(points, fixed);
    let coarse = space.coarse(settings.groups);
    let mut best: Option<lloyd::State> = None;
    for start in 0..starts {
        // The number of rounds is not known, so each round halves the remaining share of a start.
        let report = |round: usize| {
            let part = 1.0 - 1.0 / (1.0 + round as f32 / 16.0);
            if progress((start as f32 + part) / starts as f32) { Ok(()) } else { Err(KMeansError::Cancelled) }
        };
        report(0)?;
        let random = || seeds::Random::new(settings.seed, start as u64);
        let roughly = match &coarse {
            Some(coarse) => coarse::place::<BOUNDS>(coarse, settings.groups, random(), &report)?,
            None => None,
        };
        let (seeds, jumps, stride) = match roughly {
            Some(centroids) => (centroids, lloyd::NO_JUMPS, lloyd::LONG),
            None => {
                let seeds = seeds::choose(&space, settings.groups, random())
                    .map_err(|distinct| KMeansError::MoreGroupsThanPlaces { groups: settings.groups, distinct })?;
                (seeds, lloyd::JUMPS, 1.0)
            }
        };
        let schedule = lloyd::Schedule { rounds: settings.max_rounds, jumps, stride };
        let state = lloyd::run::<BOUNDS>(&space, seeds, &schedule, &report)?;
        if best.as_ref().is_none_or(|best| state.square_error < best.square_error) {
            best = Some(state);
        }
    }
    if !progress(1.0) {
        return Err(KMeansError::Cancelled);
    }
    let Some(best) = best else { return Err(KMeansError::NoGroups) };
    Ok(space.answer(best, fixed))
}

fn check(points: &[Vec3], fixed: &[Vec3], groups: usize) -> Result<(), KMeansError> {
    if groups == 0 {
        return Err(KMeansError::NoGroups);
    }
    if groups > points.len() {
        return Err(KMeansError::MoreGroupsThanPoints { groups, points: points.len() });
    }
    if points.len() > space::MAX_POINTS {
        return Err(KMeansError::TooMany { points: points.len() });
    }
    if fixed.len() > groups {
        return Err(KMeansError::MoreFixedThanGroups { fixed: fixed.len(), groups });
    }
    if let Some(point) = points.iter().position(|point| !point.is_finite()) {
        return Err(KMeansError::NotFinite { point });
    }
    match fixed.iter().position(|centroid| !centroid.is_finite()) {
        Some(centroid) => Err(KMeansError::FixedNotFinite { centroid }),
        None => Ok(()),
    }
}
