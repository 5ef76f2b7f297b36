//! Problems of a pose, folded skin and crossed lips or lids, and their repair.

use glam::{Affine3A, Vec3};

use super::{FittedFace, PATIENCE, ROUNDS, TAKEN, moving_skin::PosedSkin, samples::influences};
use crate::algo::face::{
    bones::FaceBoneKind,
    expression::{BonePose, limited},
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

impl FittedFace {
    /// Repairs a pose as far as it may; alike on both sides if `is_alike`. Returns the triangles that stay folded.
    pub(super) fn repair(&self, poses: &mut [BonePose], is_alike: bool) -> Vec<u32> {
        let of_skin = self.bones.iter().zip(&*poses).filter(|(bone, _)| bone.kind == FaceBoneKind::Skin);
        let furthest = of_skin.map(|(_, pose)| pose.translation.length()).fold(0.0, f32::max);
        let solved: Vec<Vec3> = poses.iter().map(|pose| pose.translation).collect();
        let mut apart = vec![0.0; poses.len()];
        if self.moving.triangles.is_empty() && self.moving.apart.is_empty() {
            return Vec::new();
        }
        let mut posed = PosedSkin::new(&self.moving, self.matrices(poses));
        let (mut fewest, mut in_vain) = (usize::MAX, 0);
        for share in ROUNDS {
            let problems = self.problems(&posed);
            in_vain = if problems.count() < fewest { 0 } else { in_vain + 1 };
            fewest = fewest.min(problems.count());
            if problems.count() == 0 || in_vain == PATIENCE {
                break;
            }
            self.relax(poses, &problems.folded, share);
            self.part(poses, &problems.crossed, &mut apart);
            let mut changes: Vec<Vec3> = (poses.iter().zip(&solved).zip(&apart))
                .map(|((pose, solved), apart)| pose.translation - *solved - Vec3::Y * *apart)
                .collect();
            if is_alike {
                self.even_out(&mut changes);
            }
            for (((pose, solved), apart), change) in poses.iter_mut().zip(&solved).zip(&apart).zip(changes) {
                let change = change.clamp_length_max(TAKEN * furthest);
                pose.translation = limited(*solved + change + Vec3::Y * *apart, &self.landmarks);
            }
            posed.update(self.matrices(poses));
        }
        posed.folded_numbers()
    }

    /// Matrices of neck, head and each bone.
    fn matrices(&self, poses: &[BonePose]) -> Vec<Affine3A> {
        let moved = poses.iter().zip(&self.bones).map(|(pose, bone)| pose.affine(bone.position));
        [Affine3A::IDENTITY; 2].into_iter().chain(moved).collect()
    }

    /// Gives both bones of each pair the mean of their changes.
    fn even_out(&self, changes: &mut [Vec3]) {
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

    /// Raises the first of two points above the second by the missing distance, with the least movement of bones, which
    /// is added to `apart`.
    fn part(&self, poses: &mut [BonePose], crossed: &[([u32; 2], f32)], apart: &mut [f32]) {
        let mut more = vec![0.0_f32; poses.len()];
        for &([above, below], missing) in crossed {
            let mut shares = vec![0.0_f32; poses.len()];
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
        for ((pose, apart), more) in poses.iter_mut().zip(apart).zip(more) {
            pose.translation.y += more;
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
