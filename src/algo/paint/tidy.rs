//! Weights of whole meshes put in order: sums of one, few influences, locked joints as they were.

use super::{Row, RowRules, row::is_tidy};
use crate::mesh::model::Weights;

/// Settings of [`pruned`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PruneSettings {
    /// Influences below this weight go, 0 to 1; the strongest of a point stays in any case.
    pub below: f32,
    /// The largest number of influences of a point; locked ones count, but stay.
    pub most: usize,
}

impl Default for PruneSettings {
    fn default() -> Self {
        Self { below: 0.01, most: 4 }
    }
}

/// Reason why weights cannot be pruned; a sentence without its full stop.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PruneError {
    /// A threshold that is no weight.
    #[error("weights below {0} cannot be pruned; use a threshold from 0 to 1")]
    Threshold(f32),
    /// No influences.
    #[error("a point needs at least one influence; allow one or more")]
    Influences,
}

/// Weights with the free influences of each point scaled until all influences of the point sum to one. Points whose
/// influences do so already stay to the bit; points without influences stay without.
pub fn normalised(weights: &Weights, locked: &[bool]) -> Weights {
    let rules = RowRules { locked, most: usize::MAX };
    changed(weights, |row| if is_tidy(&row) { row } else { rules.normalised(&row) })
}

/// Weights without weak influences and with few of them a point; the others are scaled so that they sum to one. Influences
/// of locked joints stay.
///
/// # Errors
/// See [`PruneError`].
pub fn pruned(weights: &Weights, locked: &[bool], settings: &PruneSettings) -> Result<Weights, PruneError> {
    if !(0.0..=1.0).contains(&settings.below) {
        return Err(PruneError::Threshold(settings.below));
    }
    if settings.most == 0 {
        return Err(PruneError::Influences);
    }
    let rules = RowRules { locked, most: settings.most };
    let is_locked = |joint: u32| locked.get(joint as usize).copied().unwrap_or(false);
    let prune = |row: Row| {
        let is_weak = |(joint, weight): &(u32, f32)| !is_locked(*joint) && *weight < settings.below;
        if is_tidy(&row) && row.len() <= settings.most && !row.iter().any(is_weak) {
            return row;
        }
        let strongest = row.iter().filter(|(joint, weight)| !is_locked(*joint) && weight.is_finite());
        let strongest = strongest.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map(|(joint, _)| *joint);
        let kept: Row = row.iter().copied().filter(|one| !is_weak(one) || Some(one.0) == strongest).collect();
        rules.normalised(&kept)
    };
    Ok(changed(weights, prune))
}

/// Other weights of the same points, in which locked joints have the influences that they have in `before`; the other
/// joints share the rest of each point as in `after`.
pub fn keep_locked(before: &Weights, after: &Weights, locked: &[bool]) -> Weights {
    let is_locked = |joint: u32| locked.get(joint as usize).copied().unwrap_or(false);
    let rules = RowRules { locked, most: usize::MAX };
    let mut result = Weights { starts: vec![0], ..Weights::default() };
    for point in 0..after.len() {
        let known = (point < before.len()).then(|| before.of(point));
        let held: Row = known.into_iter().flatten().filter(|(joint, _)| is_locked(*joint)).collect();
        let was: Row = after.of(point).collect();
        if held.is_empty() && !was.iter().any(|(joint, _)| is_locked(*joint)) {
            result.push(was);
            continue;
        }
        let mut free: Row = was.iter().copied().filter(|(joint, _)| !is_locked(*joint)).collect();
        if free.is_empty() && point < before.len() {
            free = before.of(point).filter(|(joint, _)| !is_locked(*joint)).collect();
        }
        let next = if free.is_empty() { was } else { [held, free].concat() };
        result.push(rules.normalised(&next));
    }
    result
}

/// Weights with other influences of each point.
fn changed(weights: &Weights, change: impl Fn(Row) -> Row) -> Weights {
    let mut result = Weights { starts: Vec::with_capacity(weights.starts.len()), ..Weights::default() };
    if !weights.starts.is_empty() {
        result.starts.push(0);
    }
    for point in 0..weights.len() {
        result.push(change(weights.of(point).collect()));
    }
    result
}
