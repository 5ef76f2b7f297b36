//! Coarse grouping: approximate centroids, found on few means of neighbours that stand for many points.

use super::{
    KMeansError,
    lloyd::{self, Schedule, State},
    rearrange, seeds,
    space::{Place, Space},
};

/// Largest number of rounds before and between jumps.
const ROUNDS: usize = 40;
/// Number of attempts at jumps once centroids have converged.
const TRIES: usize = 8;
const AT_ONCE: usize = 4;
/// Least ratio of the expected gain to the cost of a jump after convergence.
const WORTH: f64 = 1.5;

/// First centroids for the fine grouping; `None` without enough means.
pub(super) fn place<const BOUNDS: bool>(
    coarse: &Space,
    groups: usize,
    random: seeds::Random,
    report: &dyn Fn(usize) -> Result<(), KMeansError>,
) -> Result<Option<Vec<Place>>, KMeansError> {
    let Ok(seeds) = seeds::choose(coarse, groups, random) else { return Ok(None) };
    // The progress of a start is measured by its rounds on all points.
    let report = |_: usize| report(0);
    let run = |centroids: Vec<Place>, jumps: &'static [usize]| -> Result<State, KMeansError> {
        lloyd::run::<BOUNDS>(coarse, centroids, &Schedule { rounds: ROUNDS, jumps, stride: lloyd::LONG }, &report)
    };
    let mut best = run(seeds, lloyd::JUMPS)?;
    let mut at_once = AT_ONCE;
    for _ in 0..TRIES {
        let mut centroids = best.centroids.clone();
        rearrange::rearrange(coarse, &best.labels, &mut centroids, WORTH, at_once);
        if centroids == best.centroids {
            break;
        }
        let next = run(centroids, lloyd::NO_JUMPS)?;
        if next.square_error < best.square_error {
            best = next;
            continue;
        }
        // Fewer jumps at once may still help.
        at_once /= 2;
        if at_once == 0 {
            break;
        }
    }
    Ok(Some(best.centroids))
}
