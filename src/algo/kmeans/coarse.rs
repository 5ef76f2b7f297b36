//! Where centroids go roughly, found on few means of neighbours that stand for many points.

use super::{
    KMeansError,
    lloyd::{self, Pace, State},
    rearrange, seeds,
    space::{Place, Space},
};

/// The most rounds before and between jumps.
const ROUNDS: usize = 40;
/// How often centroids may jump once they have come to rest, and how many at once.
const TRIES: usize = 8;
const AT_ONCE: usize = 4;
/// Then a jump is worth it if it promises to gain so many times what it costs.
const WORTH: f64 = 1.5;

/// Centroids that are worth beginning with; none if there are too few places.
pub(super) fn place<const BOUNDS: bool>(
    coarse: &Space,
    groups: usize,
    random: seeds::Random,
    report: &dyn Fn(usize) -> Result<(), KMeansError>,
) -> Result<Option<Vec<Place>>, KMeansError> {
    let Ok(seeds) = seeds::choose(coarse, groups, random) else { return Ok(None) };
    // How far a start has come is told by its rounds on all points.
    let report = |_: usize| report(0);
    let run = |centroids: Vec<Place>, jumps: &'static [usize]| -> Result<State, KMeansError> {
        lloyd::run::<BOUNDS>(coarse, centroids, &Pace { rounds: ROUNDS, jumps, stride: lloyd::LONG }, &report)
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
        // Fewer at once may still help.
        at_once /= 2;
        if at_once == 0 {
            break;
        }
    }
    Ok(Some(best.centroids))
}
