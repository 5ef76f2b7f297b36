//! Problems of a pose, folded skin and crossed lips or lids, and their repair.

use glam::{Affine3A, Vec3};

use super::{FittedFace, PATIENCE, ROUNDS, TAKEN, is_alike, moving_skin::PosedSkin, samples::influences};
use crate::algo::face::{
    bones::{FaceBone, FaceBoneKind},
    expression::{BonePose, Mix, field::Field, limited, openings::OpeningLines},
};

/// Distance of lids and lips that counts as closed, as a share of that at rest.
const CLOSED: f32 = 0.2;

/// Problems of a pose.
#[derive(Default)]
struct PoseProblems {
    /// Corners of the triangles that flip.
    folded: Vec<[u32; 3]>,
    /// Points of lips and lids of which the first should be above the second, and the missing distance.
    crossed: Vec<([u32; 2], f32)>,
}

impl PoseProblems {
    fn count(&self) -> usize {
        self.folded.len() + self.crossed.len()
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
        if self.moving.triangles.is_empty() && self.moving.apart.is_empty() {
            return repair;
        }
        let mut posed = PosedSkin::new(&self.moving, self.matrices(poses));
        let (mut fewest, mut in_vain) = (usize::MAX, 0);
        let mut used: Option<UsedUnits> = None;
        let mut taken = vec![0.0_f32; poses.len()];
        for share in ROUNDS {
            let problems = self.problems(&posed);
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
            if is_alike {
                self.widen_alike(&mut apart);
            }
            if is_alike {
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
    fn matrices(&self, poses: &[BonePose]) -> Vec<Affine3A> {
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

    /// Finds triangles that turn by more than a right angle, and lips and lids that cross.
    fn problems(&self, posed: &PosedSkin) -> PoseProblems {
        let slack = 0.002 * self.landmarks.eye_distance();
        let mut crossed = Vec::new();
        for &[above, below] in &self.moving.apart {
            let gap = |points: &[Vec3]| points[above as usize].y - points[below as usize].y;
            let rest = gap(&self.moving.points);
            // Lips that touch at rest may keep touching.
            let least = if rest > slack { CLOSED * rest } else { rest - slack };
            let now = gap(&posed.points);
            if now < least {
                crossed.push(([above, below], least - now));
            }
        }
        PoseProblems { folded: posed.folded().collect(), crossed }
    }

    /// Gives both bones of each pair the larger one of their heights.
    fn widen_alike(&self, heights: &mut [f32]) {
        for &[one, other] in &self.pairs {
            let most = if heights[other].abs() > heights[one].abs() { heights[other] } else { heights[one] };
            (heights[one], heights[other]) = (most, most);
        }
    }

    /// Adds to the heights of bones what raises the first of two points above the second by the missing distance, with the
    /// least movement of bones.
    fn part(&self, crossed: &[([u32; 2], f32)], apart: &mut [f32]) {
        let mut more = vec![0.0_f32; apart.len()];
        for &([above, below], missing) in crossed {
            let mut shares = vec![0.0_f32; apart.len()];
            for (point, sign) in [(above, 1.0), (below, -1.0)] {
                for (joint, weight) in influences(&self.moving.weights, point as usize) {
                    let Some(bone) = (joint as usize).checked_sub(2).filter(|&bone| bone < shares.len()) else {
                        continue;
                    };
                    if self.bones[bone].kind == FaceBoneKind::Skin {
                        shares[bone] += sign * weight;
                    }
                }
            }
            let square: f32 = shares.iter().map(|share| share * share).sum();
            // Points with equal influences cannot be moved apart.
            if square < 0.01 {
                continue;
            }
            for (more, share) in more.iter_mut().zip(shares) {
                let asked = missing * share / square;
                // Neighbouring pairs ask for about the same movement, which counts once.
                if asked.abs() > more.abs() {
                    *more = asked;
                }
            }
        }
        for (apart, more) in apart.iter_mut().zip(more) {
            *apart += more;
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
