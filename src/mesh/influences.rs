//! Influences of one point, in the order and scale in which [`Weights`](super::model::Weights) keep them.

/// Keeps the strongest influences of a point, strongest first and equal ones by joint, and makes them sum to one.
///
/// At most `most` stay, and beside the strongest none that is weaker than `least` times their sum. Weights that are not
/// finite or not positive are left out; nothing is left where there is no other.
pub fn keep_strongest(influences: &mut Vec<(u32, f32)>, most: usize, least: f32) {
    influences.retain(|(_, weight)| weight.is_finite() && *weight > 0.0);
    influences.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    influences.truncate(most.max(1));
    // The sum of huge weights is finite in double precision.
    let sum = |influences: &[(u32, f32)]| influences.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
    let (floor, mut is_first) = (f64::from(least) * sum(influences), true);
    influences.retain(|(_, weight)| std::mem::take(&mut is_first) || f64::from(*weight) >= floor);
    let total = sum(influences);
    for (_, weight) in influences {
        *weight = (f64::from(*weight) / total) as f32;
    }
}

/// Share of a weight up to which another counts as equally strong.
const ALIKE: f32 = 1e-5;

/// Keeps the strongest influences of a point as [`keep_strongest`] does, but of equally strong ones all or none, as long as one
/// stays: mirror images in a plane of symmetry stay or go together.
pub fn keep_strongest_alike(influences: &mut Vec<(u32, f32)>, most: usize, least: f32) {
    keep_strongest(influences, usize::MAX, 0.0);
    if let Some((_, next)) = influences.get(most.max(1)).copied() {
        influences.truncate(most.max(1));
        while influences.len() > 1 && influences.last().is_some_and(|(_, last)| *last <= next * (1.0 + ALIKE)) {
            influences.pop();
        }
    }
    keep_strongest(influences, most, least);
}

/// Share of the strongest influence that is left out by which those that stay are weakened.
const SOFTNESS: f32 = 0.25;

/// Keeps the strongest influences of a point as [`keep_strongest_alike`] does, and weakens each of them by a quarter of the
/// strongest one that is left out, before they are made to sum to one.
///
/// Along a surface, one influence after the other becomes the one that is left out, which makes a step in the weights; so it is
/// lower. The influence of the joint `held` keeps its weight if it is one of the strongest.
pub fn keep_strongest_softly(influences: &mut Vec<(u32, f32)>, most: usize, least: f32, held: Option<u32>) {
    keep_strongest(influences, usize::MAX, 0.0);
    let most = most.max(1);
    let place = influences.iter().take(most).position(|(joint, _)| Some(*joint) == held);
    let kept = place.map(|place| influences.remove(place));
    let others = most - usize::from(kept.is_some());
    if let Some((_, next)) = influences.get(others).copied() {
        let sum = |influences: &[(u32, f32)]| influences.iter().map(|(_, weight)| *weight).sum::<f32>();
        let all = sum(influences);
        influences.truncate(others);
        let fewest = usize::from(kept.is_none());
        while influences.len() > fewest && influences.last().is_some_and(|(_, last)| *last <= next * (1.0 + ALIKE)) {
            influences.pop();
        }
        influences.iter_mut().for_each(|(_, weight)| *weight -= SOFTNESS * next);
        let scale = all / sum(influences);
        influences.iter_mut().for_each(|(_, weight)| *weight *= scale);
    }
    influences.extend(kept);
    keep_strongest(influences, most, least);
}
