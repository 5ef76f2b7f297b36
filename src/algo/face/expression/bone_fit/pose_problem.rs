//! Problems of a pose, folded skin and crossed lips or lids, and their repair.

use std::collections::BTreeMap;

use glam::{Affine3A, Vec3};

use super::{
    FittedFace, PATIENCE, ROUNDS, TAKEN, is_alike,
    moving_skin::PosedSkin,
    samples::{FacingPoints, influences},
};
use crate::algo::face::{
    bones::{FaceBone, FaceBoneKind},
    expression::{BonePose, Mix, field::Field, limited, openings::OpeningLines},
};

/// Distance of lips that counts as closed, as a share of that at rest.
const CLOSED: f32 = 0.2;
/// Distance of lids that counts as closed, as a share of that at rest.
const CLOSED_LIDS: f32 = 0.12;
/// Least distance of lids, as a share of that at rest.
const CROSSED_LIDS: f32 = 0.05;
/// Weight of lids that are too near beside those that are too far.
const CROSSED: f32 = 8.0;
/// Stiffness of bones of lids that are brought to their distance, beside the number of points.
const STIFF_LIDS: f32 = 0.02;
/// Most rounds, after folds were mended, in which lips and lids that cross are moved apart.
const GUARDS: usize = 6;
/// Rounds in which bones of lids are moved one after the other.
const LID_ROUNDS: usize = 40;
/// Mobility of the lower lid beside that of the upper one.
const LOWER_LID: f32 = 0.25;

/// Problems of a pose.
#[derive(Default)]
struct PoseProblems {
    /// Corners of the triangles that flip.
    folded: Vec<[u32; 3]>,
    /// Points of lips that are too near to each other, and the missing distance.
    crossed: Vec<(FacingPoints, f32)>,
    /// Points of the lids of an eye where some of them are too near or too far, and the missing distances: negative where they
    /// are too far, zero where they are right.
    lids: Vec<(FacingPoints, f32)>,
    /// Number of points of lids that are too near or too far.
    lids_off: usize,
}

impl PoseProblems {
    fn count(&self) -> usize {
        self.folded.len() + self.crossed.len() + self.lids_off
    }
}

/// Outcome of the repair of a pose.
pub(in crate::algo::face::expression) struct Repair {
    /// Triangles that stay folded, in rising order.
    pub folded: Vec<u32>,
    /// Share of each unit's furthest movement that the repair took, on the left and on the right.
    pub taken: Vec<[f32; 2]>,
}

impl Repair {
    /// The outcome for a pose that needs none.
    pub(super) fn none(mix: &Mix) -> Self {
        Self { folded: Vec::new(), taken: vec![[0.0; 2]; mix.strengths.len()] }
    }
}

/// One unit on one side of a mix.
struct UsedUnit {
    unit: usize,
    side: usize,
    /// Length of each bone's movement for it.
    lengths: Vec<f32>,
    /// The longest of them.
    furthest: f32,
}

/// The units of a mix. A change of a bone is charged to them in the shares that they have in its movement.
struct UsedUnits {
    units: Vec<UsedUnit>,
    /// Sum of the units' lengths for each bone.
    totals: Vec<f32>,
    /// The most that each bone may be changed.
    bounds: Vec<f32>,
}

impl UsedUnits {
    fn bound(&self, bone: usize) -> f32 {
        let moving = self.units.iter().filter(|used| used.lengths[bone] > 0.0);
        let most = moving.map(|used| used.furthest * (self.totals[bone] / used.lengths[bone]));
        most.reduce(f32::min).map_or(0.0, |most| TAKEN * most)
    }

    /// Charges changes of bones to the units.
    fn charge(&self, changes: &[f32], taken: &mut [[f32; 2]]) {
        for UsedUnit { unit, side, lengths, furthest } in &self.units {
            let bones = changes.iter().zip(lengths).zip(&self.totals).filter(|(_, total)| **total > 0.0);
            let shares = bones.map(|((change, length), total)| change * (length / total) / furthest);
            taken[*unit][*side] = shares.fold(0.0, f32::max);
        }
    }
}

impl FittedFace {
    /// Repairs the pose of a mix as far as it may; alike on both sides in a mix that is alike on both sides.
    pub(super) fn repair(&self, poses: &mut [BonePose], mix: &Mix, opening_lines: &OpeningLines) -> Repair {
        let is_alike = is_alike(mix);
        let solved: Vec<Vec3> = poses.iter().map(|pose| pose.translation).collect();
        let mut apart = vec![0.0; poses.len()];
        let mut repair = Repair::none(mix);
        if self.moving.triangles.is_empty() && self.moving.facing.apart.is_empty() {
            return repair;
        }
        let closed = self.closed_shares(mix);
        let mut posed = PosedSkin::new(&self.moving, self.matrices(poses));
        let (mut fewest, mut in_vain) = (usize::MAX, 0);
        let mut used: Option<UsedUnits> = None;
        let mut taken = vec![0.0_f32; poses.len()];
        for share in ROUNDS {
            let problems = self.problems(&posed, closed);
            in_vain = if problems.count() < fewest { 0 } else { in_vain + 1 };
            fewest = fewest.min(problems.count());
            if problems.count() == 0 || in_vain == PATIENCE {
                break;
            }
            self.relax(poses, &problems.folded, share);
            let mut changes: Vec<Vec3> = (poses.iter().zip(&solved).zip(&apart))
                .map(|((pose, solved), apart)| pose.translation - *solved - Vec3::Y * *apart)
                .collect();
            self.part(&problems.crossed, &mut apart);
            self.close(&problems.lids, &mut apart);
            if is_alike {
                self.widen_alike(&mut apart);
                self.even_out(&mut changes);
            }
            let bounds = &used.get_or_insert_with(|| self.used_units(mix, opening_lines, is_alike)).bounds;
            for (bone, change) in changes.into_iter().enumerate() {
                let change = change.clamp_length_max(bounds[bone]);
                taken[bone] = change.length();
                poses[bone].translation = limited(solved[bone] + change + Vec3::Y * apart[bone], &self.landmarks);
            }
            posed.update(self.matrices(poses));
        }
        // Whatever folds, lips and lids do not cross.
        for _ in 0..GUARDS {
            let problems = self.problems(&posed, [0.0; 2]);
            if problems.crossed.is_empty() && problems.lids.is_empty() {
                break;
            }
            let before = apart.clone();
            self.part(&problems.crossed, &mut apart);
            self.close(&problems.lids, &mut apart);
            if is_alike {
                self.widen_alike(&mut apart);
            }
            for (pose, (apart, before)) in poses.iter_mut().zip(apart.iter().zip(before)) {
                pose.translation = limited(pose.translation + Vec3::Y * (apart - before), &self.landmarks);
            }
            posed.update(self.matrices(poses));
        }
        if let Some(used) = used {
            used.charge(&taken, &mut repair.taken);
        }
        repair.folded = posed.folded_numbers();
        repair
    }

    /// The units of a mix, and the most that each bone may be changed so that none of them loses more than its share.
    fn used_units(&self, mix: &Mix, opening_lines: &OpeningLines, is_alike: bool) -> UsedUnits {
        let mut used = UsedUnits { units: Vec::new(), totals: vec![0.0; self.bones.len()], bounds: Vec::new() };
        for (unit, strengths) in mix.strengths.iter().enumerate().take(self.units.units().len()) {
            for (side, strength) in strengths.iter().enumerate().filter(|(_, strength)| **strength > 0.0) {
                let mut alone = Mix::rest(&self.units);
                alone.strengths[unit][side] = *strength;
                let Some(field) = Field::new(&alone, &self.units, &self.bones, &self.landmarks) else { continue };
                let poses = self.solve(&alone, &field, opening_lines);
                let length = |(pose, bone): (&BonePose, &FaceBone)| match bone.kind {
                    FaceBoneKind::Skin => pose.translation.length(),
                    _ => 0.0,
                };
                let lengths: Vec<f32> = poses.iter().zip(&self.bones).map(length).collect();
                let furthest = lengths.iter().copied().fold(0.0, f32::max);
                if furthest > 0.0 {
                    for (total, length) in used.totals.iter_mut().zip(&lengths) {
                        *total += length;
                    }
                    used.units.push(UsedUnit { unit, side, lengths, furthest });
                }
            }
        }
        used.bounds = (0..self.bones.len()).map(|bone| used.bound(bone)).collect();
        if is_alike {
            for &[one, other] in &self.pairs {
                let least = used.bounds[one].min(used.bounds[other]);
                (used.bounds[one], used.bounds[other]) = (least, least);
            }
        }
        used
    }

    /// Matrices of neck, head and each bone.
    pub(super) fn matrices(&self, poses: &[BonePose]) -> Vec<Affine3A> {
        let moved = poses.iter().zip(&self.bones).map(|(pose, bone)| pose.affine(bone.position));
        [Affine3A::IDENTITY; 2].into_iter().chain(moved).collect()
    }

    /// Gives both bones of each pair the mean of their changes.
    pub(super) fn even_out(&self, changes: &mut [Vec3]) {
        for &[one, other] in &self.pairs {
            let over = |v: Vec3| v.with_x(-v.x);
            let mean = 0.5 * (changes[one] + over(changes[other]));
            (changes[one], changes[other]) = (mean, over(mean));
        }
    }

    /// Share of the opening that a mix closes, of the left and of the right eye.
    fn closed_shares(&self, mix: &Mix) -> [f32; 2] {
        let mut open = [1.0_f32; 2];
        for (unit, strengths) in self.units.units().iter().zip(&mix.strengths) {
            for (open, strength) in open.iter_mut().zip(strengths) {
                *open *= (1.0 - unit.closes_eye * strength).clamp(0.0, 1.0);
            }
        }
        open.map(|open| 1.0 - open)
    }

    /// Finds triangles that turn by more than a right angle, lips and lids that cross, and lids that should be closed.
    fn problems(&self, posed: &PosedSkin, closed: [f32; 2]) -> PoseProblems {
        let slack = 0.002 * self.landmarks.eye_distance();
        let mut problems = PoseProblems { folded: posed.folded().collect(), ..PoseProblems::default() };
        let mut eyes = [Vec::new(), Vec::new()];
        let mut off = [0; 2];
        for facing in &self.moving.facing.apart {
            let gap = |points: &[Vec3]| points[facing.above as usize].y - points[facing.below as usize].y;
            let (rest, now) = (gap(&self.moving.points), gap(&posed.points));
            // Lips and lids that touch at rest may keep touching.
            let least = |share: f32| if rest > slack { share * rest } else { rest - slack };
            let Some(eye) = facing.eye else {
                let missing = least(CLOSED) - now;
                if missing > 0.0 {
                    problems.crossed.push((*facing, missing));
                }
                continue;
            };
            let open = 1.0 - closed[eye] * (1.0 - CLOSED_LIDS);
            let most = if closed[eye] > 0.0 && rest > slack { open * rest } else { f32::INFINITY };
            let missing = now.clamp(least(CROSSED_LIDS), most) - now;
            off[eye] += usize::from(missing.abs() > 0.25 * slack);
            eyes[eye].push((*facing, missing));
        }
        let with_faults = eyes.into_iter().zip(off).filter(|(_, off)| *off > 0);
        problems.lids = with_faults.flat_map(|(lids, _)| lids).collect();
        problems.lids_off = off.iter().sum();
        problems
    }

    /// Gives both bones of each pair the larger one of their heights.
    fn widen_alike(&self, heights: &mut [f32]) {
        for &[one, other] in &self.pairs {
            let most = if heights[other].abs() > heights[one].abs() { heights[other] } else { heights[one] };
            (heights[one], heights[other]) = (most, most);
        }
    }

    /// Shares of the bones of skin in the height of one facing point above the other; those of the lower one count `lower`.
    pub(super) fn shares(&self, facing: &FacingPoints, lower: f32) -> BTreeMap<usize, [f32; 2]> {
        let mut shares: BTreeMap<usize, [f32; 2]> = BTreeMap::new();
        for (point, sign, mobility) in [(facing.above, 1.0, 1.0), (facing.below, -1.0, lower)] {
            for (joint, weight) in influences(&self.moving.weights, point as usize) {
                let bone = (joint as usize).checked_sub(2);
                let is_skin = |bone: &usize| self.bones.get(*bone).is_some_and(|bone| bone.kind == FaceBoneKind::Skin);
                let Some(bone) = bone.filter(is_skin) else { continue };
                let share = shares.entry(bone).or_default();
                share[0] += sign * weight;
                share[1] += sign * weight * mobility;
            }
        }
        shares
    }

    /// Adds to the heights of bones what brings lips apart by the missing distance, with the least movement of bones.
    fn part(&self, crossed: &[(FacingPoints, f32)], apart: &mut [f32]) {
        let mut more = vec![0.0_f32; apart.len()];
        for (facing, missing) in crossed {
            let shares = self.shares(facing, 1.0);
            let square: f32 = shares.values().map(|[share, _]| share * share).sum();
            // Points with equal influences cannot be moved apart.
            if square < 0.01 {
                continue;
            }
            for (bone, [share, _]) in shares {
                let asked = missing * share / square;
                // Neighbouring pairs ask for about the same movement, which counts once.
                if asked.abs() > more[bone].abs() {
                    more[bone] = asked;
                }
            }
        }
        for (apart, more) in apart.iter_mut().zip(more) {
            *apart += more;
        }
    }

    /// Adds to the heights of bones what brings all lids nearest to the missing distances: least squares, by one bone after the
    /// other. Bones of the lower lid move less.
    fn close(&self, lids: &[(FacingPoints, f32)], apart: &mut [f32]) {
        let counts: Vec<f32> = lids.iter().map(|(_, missing)| if *missing > 0.0 { CROSSED } else { 1.0 }).collect();
        let mut left: Vec<f32> = lids.iter().map(|(_, missing)| *missing).collect();
        let mut rows: BTreeMap<usize, Vec<(usize, [f32; 2])>> = BTreeMap::new();
        for (row, (facing, _)) in lids.iter().enumerate() {
            for (bone, shares) in self.shares(facing, LOWER_LID) {
                rows.entry(bone).or_default().push((row, shares));
            }
        }
        // Mobility of each bone, and its effect on the distances.
        let bones = rows.into_iter().map(|(bone, rows)| {
            let [all, mobile] = [0, 1].map(|of| rows.iter().map(|(_, shares)| shares[of].abs()).sum::<f32>());
            let mobility = if all > 0.0 { mobile / all } else { 0.0 };
            let effect: Vec<(usize, f32)> = rows.iter().map(|(row, [share, _])| (*row, share * mobility)).collect();
            (bone, mobility, effect)
        });
        let bones: Vec<(usize, f32, Vec<(usize, f32)>)> = bones.collect();
        let stiff = STIFF_LIDS * lids.len() as f32;
        let mut moved = vec![0.0_f32; bones.len()];
        for _ in 0..LID_ROUNDS {
            for ((bone, mobility, effect), moved) in bones.iter().zip(&mut moved) {
                let before = if *mobility > 0.0 { apart[*bone] / mobility } else { 0.0 };
                let pull: f32 = effect.iter().map(|(row, share)| counts[*row] * share * left[*row]).sum();
                let square: f32 = effect.iter().map(|(row, share)| counts[*row] * share * share).sum();
                let more = (pull - stiff * (before + *moved)) / (square + stiff).max(f32::MIN_POSITIVE);
                *moved += more;
                effect.iter().for_each(|(row, share)| left[*row] -= share * more);
            }
        }
        for ((bone, mobility, _), moved) in bones.iter().zip(moved) {
            apart[*bone] += mobility * moved;
        }
    }

    /// Brings the movements of the bones at some corners nearer to each other, by the share `part`.
    fn relax(&self, poses: &mut [BonePose], folded: &[[u32; 3]], part: f32) {
        let jaw = self.bones.iter().position(|bone| bone.kind == FaceBoneKind::Jaw);
        let jaw = jaw.map(|bone| (bone, poses[bone].affine(self.bones[bone].position)));
        let mut alike = vec![(Vec3::ZERO, 0.0_f32); self.bones.len()];
        for &corners in folded {
            let mut mean = Vec3::ZERO;
            for corner in corners {
                for (joint, weight) in influences(&self.moving.weights, corner as usize) {
                    let Some(bone) = (joint as usize).checked_sub(2).filter(|&bone| bone < poses.len()) else {
                        continue;
                    };
                    mean += weight / 3.0
                        * match jaw {
                            Some((jaw, turn)) if jaw == bone => {
                                let point = self.moving.points[corner as usize];
                                turn.transform_point3(point) - point
                            }
                            _ => poses[bone].translation,
                        };
                }
            }
            for corner in corners {
                for (joint, weight) in influences(&self.moving.weights, corner as usize) {
                    let bone = (joint as usize).wrapping_sub(2);
                    if let Some((sum, weights)) = alike.get_mut(bone) {
                        *sum += mean * weight;
                        *weights += weight;
                    }
                }
            }
        }
        for ((pose, bone), (sum, weights)) in poses.iter_mut().zip(&self.bones).zip(alike) {
            if bone.kind == FaceBoneKind::Skin && weights > 0.0 {
                pose.translation += (sum / weights - pose.translation) * (part * weights.min(1.0)).min(1.0);
            }
        }
    }
}
