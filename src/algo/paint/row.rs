//! Influences of one point under change: they sum to one, and locked joints keep theirs.

use super::Row;

/// Weights below this share are dropped, unless they are the only one.
const LEAST: f64 = 1e-4;
/// Sums that differ from one by less count as one.
const ROUNDING: f64 = 1e-6;

/// Rules for the influences of every point.
#[derive(Debug, Clone, Copy)]
pub struct RowRules<'a> {
    /// Locks by joint; joints past the end are free.
    pub locked: &'a [bool],
    /// The largest number of influences; locked ones count, but stay.
    pub most: usize,
}

impl RowRules<'_> {
    fn is_locked(&self, joint: u32) -> bool {
        self.locked.get(joint as usize).copied().unwrap_or(false)
    }

    /// Locked influences as they are, free ones added up by joint, and the share that the free ones have together.
    fn split(&self, row: &[(u32, f32)]) -> (Row, Vec<(u32, f64)>, f64) {
        let (mut held, mut free): (Row, Vec<(u32, f64)>) = (Vec::new(), Vec::new());
        for &(joint, weight) in row.iter().filter(|(_, weight)| weight.is_finite() && *weight > 0.0) {
            if self.is_locked(joint) {
                match held.iter_mut().find(|(other, _)| *other == joint) {
                    Some((_, sum)) => *sum += weight,
                    None => held.push((joint, weight)),
                }
            } else {
                match free.iter_mut().find(|(other, _)| *other == joint) {
                    Some((_, sum)) => *sum += f64::from(weight),
                    None => free.push((joint, f64::from(weight))),
                }
            }
        }
        let share = 1.0 - held.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
        (held, free, share)
    }

    /// The influences of a point: the held ones unchanged, and the strongest of the free ones, which share the rest.
    pub(super) fn joined(&self, held: Row, mut free: Vec<(u32, f64)>, share: f64) -> Row {
        free.retain(|(_, weight)| weight.is_finite() && *weight > 0.0);
        free.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let room = self.most.saturating_sub(held.len()).max(1);
        free.truncate(room);
        let sum: f64 = free.iter().map(|(_, weight)| *weight).sum();
        let mut is_first = true;
        free.retain(|(_, weight)| std::mem::take(&mut is_first) || weight * share >= LEAST * sum);
        let sum: f64 = free.iter().map(|(_, weight)| *weight).sum();
        let mut row = held;
        row.extend(free.into_iter().map(|(joint, weight)| (joint, (weight / sum * share) as f32)));
        row.retain(|(_, weight)| *weight > 0.0);
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        row
    }

    /// Free influences scaled so that all sum to one. Points without influences, and those that locked joints hold alone,
    /// stay as they are.
    pub(super) fn normalised(&self, row: &[(u32, f32)]) -> Row {
        let (held, free, share) = self.split(row);
        if share <= ROUNDING || free.is_empty() {
            return row.to_vec();
        }
        self.joined(held, free, share)
    }
}

/// True for influences that are finite, positive, strongest first and sum to one.
pub(super) fn is_tidy(row: &[(u32, f32)]) -> bool {
    let sum: f64 = row.iter().map(|(_, weight)| f64::from(*weight)).sum();
    (sum - 1.0).abs() <= ROUNDING
        && row.iter().all(|(_, weight)| *weight > 0.0)
        && row.is_sorted_by(|a, b| a.1 > b.1 || a.1 == b.1 && a.0 < b.0)
}

/// Gives joints of a point the weights of `targets`; the other free joints share the rest in proportion.
///
/// Targets of locked joints are passed over. Targets that are more than the free share together are scaled down; where no
/// other free joint can take what they leave, they are scaled up, so a joint that has a point alone keeps it. A point
/// without influences goes to the targets. The result sums to one, strongest first, without weights below a ten-thousandth;
/// a point that locked joints hold alone stays as it is.
pub fn assign(row: &[(u32, f32)], targets: &[(u32, f32)], rules: &RowRules) -> Row {
    let (held, free, share) = rules.split(row);
    let mut wanted: Vec<(u32, f64)> = Vec::with_capacity(targets.len());
    for &(joint, weight) in targets {
        let is_new = wanted.iter().all(|(other, _)| *other != joint);
        if is_new && weight.is_finite() && !rules.is_locked(joint) {
            wanted.push((joint, f64::from(weight).clamp(0.0, share.max(0.0))));
        }
    }
    let given: f64 = wanted.iter().map(|(_, weight)| *weight).sum();
    let mut rest: Vec<(u32, f64)> =
        free.into_iter().filter(|(joint, _)| wanted.iter().all(|(other, _)| other != joint)).collect();
    let others: f64 = rest.iter().map(|(_, weight)| *weight).sum();
    if share <= ROUNDING || wanted.is_empty() || given <= 0.0 && others <= 0.0 {
        return row.to_vec();
    }
    if given >= share {
        rest.clear();
    } else if others > 0.0 {
        rest.iter_mut().for_each(|(_, weight)| *weight *= (share - given) / others);
    }
    // Whatever is left to one side is scaled to the free share.
    wanted.extend(rest);
    rules.joined(held, wanted, share)
}

/// Moves the free influences of a point to those of `mean` by a share: 0 changes nothing, 1 takes them over, and a negative
/// one moves away from them. The result sums to one as that of [`assign`] does.
pub fn towards(row: &[(u32, f32)], mean: &[(u32, f64)], by: f32, rules: &RowRules) -> Row {
    let (held, free, share) = rules.split(row);
    let mean: Vec<(u32, f64)> = mean.iter().copied().filter(|(joint, _)| !rules.is_locked(*joint)).collect();
    let of_mean: f64 = mean.iter().map(|(_, weight)| *weight).sum();
    let own: f64 = free.iter().map(|(_, weight)| *weight).sum();
    if share <= ROUNDING || of_mean <= 0.0 || own <= 0.0 && by <= 0.0 || by == 0.0 {
        return row.to_vec();
    }
    let by = f64::from(by).clamp(-1.0, 1.0);
    let scale = if own > 0.0 { share / own } else { 0.0 };
    let mut next: Vec<(u32, f64)> = free.iter().map(|(joint, weight)| (*joint, weight * scale * (1.0 - by))).collect();
    for (joint, weight) in mean {
        let part = by * weight * share / of_mean;
        match next.iter_mut().find(|(other, _)| *other == joint) {
            Some((_, sum)) => *sum += part,
            None => next.push((joint, part)),
        }
    }
    if next.iter().all(|(_, weight)| *weight <= 0.0) {
        return row.to_vec();
    }
    rules.joined(held, next, share)
}
