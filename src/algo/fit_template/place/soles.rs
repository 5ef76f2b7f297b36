//! Soles: feet of animals that walk on all of the foot, as bears do.

use glam::Vec3;

use super::Work;
use crate::algo::fit_template::{
    limbs::{Limb, LimbKind},
    line::CentreLine,
};

/// Height of the part of a leg that stands on the ground, as a share of the height of the trunk's joint over it.
const SOLE: f32 = 0.1;
/// Length of a foot, as a share of that height, from which on it begins to be a sole, and from which on it is one. Paws and
/// hooves are shorter.
const PAW: f32 = 0.33;
const WHOLE_SOLE: f32 = 0.42;
/// Length of a foot, as the same share, below which ball and toes lie nearer to the end of the leg, by the square root of the share.
const HOOF: f32 = 0.2;
/// Least of that share.
const SHORTEST: f32 = 0.75;
/// Length of a block over the standard deviation of places in it.
const BLOCK: f32 = 3.464;
/// Places of the ankle, the ball and the toes, as shares of the foot's length from the heel and over the ground.
const FOOT: [(f32, f32); 3] = [(0.25, 0.25), (0.6, 0.12), (0.85, 0.08)];
/// Fewest cells of a foot.
const CELLS: usize = 12;

/// Part of a leg that stands on the ground.
struct Foot {
    /// Height of the ground.
    ground: f32,
    middle: Vec3,
    /// Length forward.
    length: f32,
    /// Height of the trunk's joint over the ground.
    tall: f32,
}

impl Work<'_> {
    /// Draws ankle, ball and toes of an animal's leg down to a foot that is long for the leg: animals that walk on their toes
    /// have short feet and hocks high above them. The knee follows by its share of the way.
    pub(super) fn stand_on_sole(
        &self,
        (limb, leaf): (&Limb, Option<usize>),
        line: &CentreLine,
        lengths: &[f32],
        places: &mut [Option<Vec3>],
    ) {
        let [.., hip, knee, ankle, ball, toes] = *limb.joints.as_slice() else { return };
        if limb.kind != LimbKind::Leg || !self.template.is_on_fours() {
            return;
        }
        let Some(foot) = leaf.zip(places[limb.attach]).and_then(|(leaf, attach)| self.foot(leaf, attach)) else {
            return;
        };
        let (Some(above), Some(bend), Some(before)) = (places[hip], places[knee], places[ankle]) else { return };
        let Foot { ground, middle, length, tall } = foot;
        let (left, up, forward) = self.directions();
        let share = ((length / tall - PAW) / (WHOLE_SOLE - PAW)).clamp(0.0, 1.0);
        // A hoof is short, and all of it is toes.
        let short = (length / (HOOF * tall)).sqrt().clamp(SHORTEST, 1.0);
        for (&joint, along) in limb.joints.iter().zip(lengths).skip(limb.joints.len() - 2) {
            if short < 1.0 && *along <= line.free {
                places[joint] = places[joint].map(|_| line.at(along * short));
            }
        }
        let back = middle.dot(forward) - 0.5 * length;
        for (joint, (along, high)) in [ankle, ball, toes].into_iter().zip(FOOT) {
            let on_sole = left * middle.dot(left) + up * (ground + high * length) + forward * (back + along * length);
            places[joint] = places[joint].map(|place| place.lerp(on_sole, share));
        }
        let moved = places[ankle].unwrap_or(before) - before;
        let way = before - above;
        let part = ((bend - above).dot(way) / way.length_squared().max(1e-12)).clamp(0.0, 1.0);
        places[knee] = Some(bend + moved * part);
    }

    /// Directions left, up and forward of the figure.
    fn directions(&self) -> (Vec3, Vec3, Vec3) {
        let turn = self.hypothesis.alignment.rotation;
        (turn * Vec3::X, turn * Vec3::Y, turn * Vec3::Z)
    }

    /// The foot at the end of the branch `leaf` of an animal's leg, which hangs on a joint at `attach`.
    fn foot(&self, leaf: usize, attach: Vec3) -> Option<Foot> {
        let (_, up, forward) = self.directions();
        let arc_of = &self.tree.branches.arc_of;
        let centres = &self.graph.centres;
        let leg: Vec<usize> = (0..self.graph.len()).filter(|&node| arc_of[node] as usize == leaf).collect();
        let lowest = leg.iter().map(|&node| centres[node].dot(up)).fold(f32::INFINITY, f32::min);
        let ground = lowest - 0.5 * self.graph.cell;
        let tall = attach.dot(up) - ground;
        let is_low = |node: usize| centres[node].dot(up) - ground < SOLE * tall;
        // A heel that juts out behind the leg is no part of its branch.
        let is_of_other = |node: usize| {
            let arc = arc_of[node] as usize;
            arc != leaf && self.hypothesis.leaves.contains(&Some(arc))
        };
        let mut open: Vec<usize> = leg.into_iter().filter(|&node| is_low(node)).collect();
        let mut is_foot = vec![false; centres.len()];
        open.iter().for_each(|&node| is_foot[node] = true);
        while let Some(node) = open.pop() {
            for next in self.graph.neighbours(node as u32).iter().map(|link| link.0 as usize) {
                if !is_foot[next] && is_low(next) && !is_of_other(next) {
                    is_foot[next] = true;
                    open.push(next);
                }
            }
        }
        let foot: Vec<Vec3> = centres.iter().zip(&is_foot).filter(|(_, is_foot)| **is_foot).map(|(p, _)| *p).collect();
        if foot.len() < CELLS {
            return None;
        }
        let middle = foot.iter().sum::<Vec3>() / foot.len() as f32;
        let variance = foot.iter().map(|place| (*place - middle).dot(forward)).map(|away| away * away).sum::<f32>();
        let length = BLOCK * (variance / foot.len() as f32).sqrt();
        Some(Foot { ground, middle, length, tall })
    }
}
