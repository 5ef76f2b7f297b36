//! k-means: groups of points around centroids, with the least square error.
//!
//! Seeds are spread over dense regions ("Automatic placement of bones on face models", section 3.2): each next one is drawn
//! in proportion to the points' squared distances from the seeds so far, the best of several draws kept (Arthur and
//! Vassilvitskii, "k-means++", 2007), so a seed is likely where many points are far from any. Then points go to their nearest
//! centroid and centroids to their points' mean, until no point changes its group (Lloyd).
//!
//! In the first rounds, centroids jump from where two groups might as well be one to where one might better be two, which
//! such rounds alone never do. Of many points, means of eight neighbours each are grouped first: that is quick enough to try
//! jumps until none lowers the error, and leaves little to do for all points.
//!
//! Bounds say for most points that nothing can have changed: how far the own centroid is at most and any other at
//! least (Hamerly, "Making k-means even faster", 2010). They are kept as differences from the way that centroids have gone
//! since the start, so a point whose bounds hold is not written at all, and a block of them is not even read. Bounds only ever
//! spare comparisons that could not change anything, so the answer is that of [`kmeans_plain`] to the last bit.
//!
//! Sums are kept in whole numbers (parts of 2⁻³⁴ of the extent), which makes them exact in any order: points that change
//! their group are added and taken away, on any number of threads.

mod coarse;
mod lloyd;
mod rearrange;
mod seeds;
mod space;

use glam::Vec3;
use thiserror::Error;

use self::space::Space;

/// Called now and then with the part that is done (0 to 1, never falling); `false` cancels.
pub type Progress<'a> = &'a (dyn Fn(f32) -> bool + Sync);

/// What [`kmeans`] is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KMeansSettings {
    /// How many groups, fixed ones included.
    pub groups: usize,
    /// How often to begin with other seeds; the least error is kept. At least one is made.
    pub starts: usize,
    /// What the seeds are drawn from.
    pub seed: u64,
    /// No start goes on for more rounds than this, though points still change their groups.
    pub max_rounds: usize,
}

impl Default for KMeansSettings {
    fn default() -> Self {
        Self { groups: 40, starts: 3, seed: 0, max_rounds: 1000 }
    }
}

/// Groups of points.
#[derive(Debug, Clone, PartialEq)]
pub struct KMeans {
    /// The middle of each group; fixed ones first, as they were given.
    pub centroids: Vec<Vec3>,
    /// The group of each point: the nearest centroid, of equally near ones the first.
    pub labels: Vec<u32>,
    /// Sum over all points of the squared distance to their centroid.
    pub square_error: f64,
    /// How many rounds the best start took.
    pub rounds: usize,
}

/// Why points cannot be grouped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum KMeansError {
    /// Nothing was asked for.
    #[error("0 groups were asked for; ask for at least 1")]
    NoGroups,
    /// Groups would be empty.
    #[error("{groups} groups are more than {points} points; ask for fewer groups")]
    MoreGroupsThanPoints {
        /// How many groups were asked for.
        groups: usize,
        /// How many points there are.
        points: usize,
    },
    /// Groups would be empty, since points coincide.
    #[error("{groups} groups are more than {distinct} different places of points; ask for fewer groups")]
    MoreGroupsThanPlaces {
        /// How many groups were asked for.
        groups: usize,
        /// How many different points there are.
        distinct: usize,
    },
    /// More centroids are fixed than groups were asked for.
    #[error("{fixed} fixed centroids are more than {groups} groups; ask for more groups or fix fewer")]
    MoreFixedThanGroups {
        /// How many centroids are fixed.
        fixed: usize,
        /// How many groups were asked for.
        groups: usize,
    },
    /// A coordinate of a point is infinite or not a number.
    #[error("point {point} has a coordinate that is not a finite number; remove it or repair the mesh")]
    NotFinite {
        /// Its index.
        point: usize,
    },
    /// A coordinate of a fixed centroid is infinite or not a number.
    #[error("fixed centroid {centroid} has a coordinate that is not a finite number")]
    FixedNotFinite {
        /// Its index.
        centroid: usize,
    },
    /// More points than can be summed.
    #[error("{points} points are more than {} that can be grouped; simplify the mesh first", space::MAX_POINTS)]
    TooMany {
        /// How many were given.
        points: usize,
    },
    /// The caller's progress function said stop.
    #[error("grouping was cancelled")]
    Cancelled,
}

/// Groups points around centroids; `fixed` ones come first in the answer, never move and count among the groups.
///
/// The answer depends on points, fixed centroids and settings alone, not on the number of threads. A group that loses
/// all its points begins anew at the point that is furthest from its centroid.
pub fn kmeans(
    points: &[Vec3],
    fixed: &[Vec3],
    settings: &KMeansSettings,
    progress: Progress,
) -> Result<KMeans, KMeansError> {
    run::<true>(points, fixed, settings, progress)
}

/// The same as [`kmeans`] without any bounds: all distances in all rounds. For comparison.
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
        // The number of rounds is not known, so a start's part is halved again and again.
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
        let pace = lloyd::Pace { rounds: settings.max_rounds, jumps, stride };
        let state = lloyd::run::<BOUNDS>(&space, seeds, &pace, &report)?;
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
