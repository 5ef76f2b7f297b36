//! Problems of a pose, folded skin, crossed lips or lids and lids inside eyeballs, and their repair.

use glam::{Affine3A, Vec3};

use super::{FittedFace, PATIENCE, ROUNDS, SolvedPose, TAKEN, TURN, moving_skin::PosedSkin, samples::influences};
use crate::algo::face::bones::FaceBoneKind;

/// Share of an eyeball's radius by which a lid stays outside of it.
const CLEAR: f32 = 1.01;
/// Passes over the shortfalls of a pose; each corrects what the others before it left.
const PASSES: usize = 3;

/// A distance that a pose falls short of, along a direction.
struct Shortfall {
    /// Points of which the first should be further in the direction, and the second less far; with their signs.
    points: [(u32, f32); 2],
    /// Unit length.
    direction: Vec3,
    missing: f32,
}

/// Problems of a pose.
#[derive(Default)]
struct PoseProblems {
    /// Corners of the triangles that flip.
    folded: Vec<[u32; 3]>,
    /// Lips and lids that cross, and lids that sink into an eyeball.
    shortfalls: Vec<Shortfall>,
}

impl PoseProblems {
    fn count(&self) -> usize {
        self.folded.len() + self.shortfalls.len()
    }
}

impl FittedFace {
    /// Repairs a pose as far as it may; alike on both sides if `is_alike`. Returns the share of the furthest movement
    /// that the repair of folds took.
    pub(super) fn repair(&self, pose: &mut SolvedPose, is_alike: bool) -> f32 {
        let furthest = pose.poses.iter().map(|pose| pose.translation.length()).fold(0.0, f32::max);
        let solved: Vec<[Vec3; 2]> = self.motions_of(pose);
        let mut apart = vec![Vec3::ZERO; solved.len()];
        if self.moving.triangles.is_empty() && self.moving.apart.is_empty() {
            return 0.0;
        }
        let length = (TURN * self.landmarks.eye_distance()).max(f32::MIN_POSITIVE);
        let mut posed = PosedSkin::new(&self.moving, self.matrices(pose));
        let (mut fewest, mut in_vain, mut taken) = (usize::MAX, 0, 0.0);
        for share in ROUNDS {
            let problems = self.problems(&posed);
            in_vain = if problems.count() < fewest { 0 } else { in_vain + 1 };
            fewest = fewest.min(problems.count());
            if problems.count() == 0 || in_vain == PATIENCE {
                break;
            }
            self.relax(pose, &problems.folded, share);
            let mut changes: Vec<[Vec3; 2]> = (self.motions_of(pose).iter().zip(&solved).zip(&apart))
                .map(|(([shift, turn], [solved_shift, solved_turn]), apart)| {
                    [*shift - *solved_shift - *apart, *turn - *solved_turn]
                })
                .collect();
            self.part(&problems.shortfalls, &mut apart);
            if is_alike {
                self.even_out(&mut changes, &mut apart);
            }
            taken = 0.0;
            for (bone, ([shift, turn], [change, turned])) in solved.iter().zip(changes).enumerate() {
                if self.bones[bone].kind != FaceBoneKind::Skin {
                    continue;
                }
                let change = change.clamp_length_max(TAKEN * furthest);
                let turned = turned.clamp_length_max(TAKEN * furthest / length);
                taken = f32::max(taken, change.length());
                pose.set(bone, *shift + change + apart[bone], *turn + turned, &self.landmarks);
            }
            posed.update(self.matrices(pose));
        }
        if furthest > 0.0 { taken / furthest } else { 0.0 }
    }

    /// Movement and turn of each bone.
    fn motions_of(&self, pose: &SolvedPose) -> Vec<[Vec3; 2]> {
        pose.poses.iter().zip(&pose.turns).map(|(pose, turn)| [pose.translation, *turn]).collect()
    }

    /// Matrices of neck, head and each bone.
    fn matrices(&self, pose: &SolvedPose) -> Vec<Affine3A> {
        let moved = pose.poses.iter().zip(&self.bones).map(|(pose, bone)| pose.affine(bone.position));
        [Affine3A::IDENTITY; 2].into_iter().chain(moved).collect()
    }

    /// Gives both bones of each pair the mean of their changes, and bones in the middle no change to a side.
    fn even_out(&self, changes: &mut [[Vec3; 2]], apart: &mut [Vec3]) {
        let over = |v: Vec3| v.with_x(-v.x);
        // A turn mirrors as an axial vector.
        let turned_over = |v: Vec3| Vec3::new(v.x, -v.y, -v.z);
        for &[one, other] in &self.pairs {
            let mean = 0.5 * (changes[one][0] + over(changes[other][0]));
            let turn = 0.5 * (changes[one][1] + turned_over(changes[other][1]));
            (changes[one], changes[other]) = ([mean, turn], [over(mean), turned_over(turn)]);
            let mean = 0.5 * (apart[one] + over(apart[other]));
            (apart[one], apart[other]) = (mean, over(mean));
        }
    }

    /// Finds triangles that turn by more than a right angle, lips and lids that cross, and lids in eyeballs.
    fn problems(&self, posed: &PosedSkin) -> PoseProblems {
        let slack = 0.002 * self.landmarks.eye_distance();
        let mut shortfalls = Vec::new();
        for &[above, below] in &self.moving.apart {
            let gap = |points: &[Vec3]| points[above as usize].y - points[below as usize].y;
            let rest = gap(&self.moving.points);
            // Lips that touch at rest may keep touching.
            let least = if rest > slack { 0.3 * rest } else { rest - slack };
            let missing = least - gap(&posed.points);
            if missing > 0.0 {
                shortfalls.push(Shortfall { points: [(above, 1.0), (below, -1.0)], direction: Vec3::Y, missing });
            }
        }
        for lid in &self.lids {
            let ball = &self.eyeballs[lid.eyeball];
            let out = posed.points[lid.point as usize] - ball.center;
            let distance = out.length();
            let missing = lid.rest.min(CLEAR * ball.radius) - distance;
            if missing > 0.1 * slack && distance > 0.0 {
                let points = [(lid.point, 1.0), (lid.point, 0.0)];
                shortfalls.push(Shortfall { points, direction: out / distance, missing });
            }
        }
        PoseProblems { folded: posed.folded().collect(), shortfalls }
    }

    /// Moves points by the distances that they fall short of, with the least movement of bones, which is added to
    /// `apart`.
    fn part(&self, shortfalls: &[Shortfall], apart: &mut [Vec3]) {
        let rows: Vec<(&Shortfall, Vec<(usize, f32)>, f32)> = shortfalls
            .iter()
            .map(|shortfall| {
                let mut shares: Vec<(usize, f32)> = Vec::new();
                for (point, sign) in shortfall.points.into_iter().filter(|(_, sign)| *sign != 0.0) {
                    for (joint, weight) in influences(&self.moving.weights, point as usize) {
                        let bone = (joint as usize).checked_sub(2).filter(|bone| *bone < self.bones.len());
                        let Some(bone) = bone.filter(|bone| self.bones[*bone].kind == FaceBoneKind::Skin) else {
                            continue;
                        };
                        match shares.iter_mut().find(|(known, _)| *known == bone) {
                            Some((_, share)) => *share += sign * weight,
                            None => shares.push((bone, sign * weight)),
                        }
                    }
                }
                let square = shares.iter().map(|(_, share)| share * share).sum::<f32>();
                (shortfall, shares, square)
            })
            // Points with equal influences cannot be moved apart.
            .filter(|(.., square)| *square >= 0.01)
            .collect();
        let before = apart.to_vec();
        for _ in 0..PASSES {
            for (shortfall, shares, square) in &rows {
                // Neighbours ask for about the same movement, which counts once.
                let moved: Vec3 = shares.iter().map(|(bone, share)| (apart[*bone] - before[*bone]) * *share).sum();
                let missing = shortfall.missing - moved.dot(shortfall.direction);
                if missing > 0.0 {
                    for (bone, share) in shares {
                        apart[*bone] += shortfall.direction * (missing * share / square);
                    }
                }
            }
        }
    }

    /// Brings the motions of the bones at some corners nearer to each other, by the share `part`.
    fn relax(&self, pose: &mut SolvedPose, folded: &[[u32; 3]], part: f32) {
        let matrices = self.matrices(pose);
        let mut alike = vec![(Vec3::ZERO, 0.0_f32); self.bones.len()];
        for &corners in folded {
            let mut mean = Vec3::ZERO;
            for corner in corners {
                let point = self.moving.points[corner as usize];
                for (joint, weight) in influences(&self.moving.weights, corner as usize) {
                    if let Some(matrix) = matrices.get(joint as usize).filter(|_| joint >= 2) {
                        mean += weight / 3.0 * (matrix.transform_point3(point) - point);
                    }
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
        for (bone, (sum, weights)) in alike.into_iter().enumerate() {
            if self.bones[bone].kind == FaceBoneKind::Skin && weights > 0.0 {
                let share = (part * weights.min(1.0)).min(1.0);
                let (shift, turn) = (pose.poses[bone].translation, pose.turns[bone]);
                let shift = shift + (sum / weights - shift) * share;
                pose.set(bone, shift, turn * (1.0 - share), &self.landmarks);
            }
        }
    }
}
