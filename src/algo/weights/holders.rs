//! The bones near a point that may hold it. Of thousands of loose pieces each has its own few bones: a search among all bones
//! would pass over most of them for every point.

use glam::Vec3;

use super::{
    bone::BoneSegment,
    bone_tree::{BoneTree, keep_cheapest},
};

/// Bones that are compared one by one at most.
const FEW: usize = 64;

/// Bones in a tree, and by their joints.
#[derive(Debug, Clone, Default)]
pub(crate) struct Holders {
    tree: BoneTree,
    /// Bones in the order of their joints, and the place of the first bone of each joint.
    bones: Vec<u32>,
    starts: Vec<u32>,
}

impl Holders {
    /// Sorts bones by their joints, and puts them into a tree. O(n log n) for n bones.
    pub fn new(segments: &[BoneSegment]) -> Self {
        let joint = |bone: &u32| segments[*bone as usize].joint;
        let mut bones: Vec<u32> = (0..segments.len() as u32).collect();
        bones.sort_by_key(joint);
        let joints = bones.last().map_or(0, |last| joint(last) + 1);
        let starts = (0..=joints).map(|number| bones.partition_point(|bone| joint(bone) < number) as u32).collect();
        Self { tree: BoneTree::new(segments), bones, starts }
    }

    /// The bones of a joint.
    fn of(&self, joint: u32) -> &[u32] {
        let place = |joint: u32| self.starts.get(joint as usize).map_or(self.bones.len(), |start| *start as usize);
        &self.bones[place(joint)..place(joint.saturating_add(1))]
    }

    /// The bones as [`BoneTree::cheapest`] finds them, where those of other joints than `joints` cost infinity. All bones count
    /// if these are `None`.
    pub fn cheapest(
        &self,
        (point, band): (Vec3, f32),
        joints: Option<&[u32]>,
        mut cost: impl FnMut(u32) -> f32,
        least: impl Fn(f32) -> f32,
        out: &mut Vec<(f32, u32)>,
    ) {
        let are_few =
            |joints: &[u32]| joints.len() <= FEW && joints.iter().map(|j| self.of(*j).len()).sum::<usize>() <= FEW;
        let Some(joints) = joints.filter(|joints| are_few(joints)) else {
            return self.tree.cheapest(point, band, cost, least, out);
        };
        let all = joints.iter().flat_map(|joint| self.of(*joint));
        out.clear();
        out.extend(all.map(|&bone| (cost(bone), bone)).filter(|(cost, _)| *cost < f32::INFINITY));
        let best = out.iter().fold(f32::INFINITY, |best, (cost, _)| best.min(*cost));
        keep_cheapest(out, best, band);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_bones_are_found_as_the_tree_finds_them() {
        // A star, and a chain beside it.
        let spot = |number: u32| Vec3::new((number % 7) as f32, (number % 11) as f32, (number % 13) as f32) / 13.0;
        let star = (0..200).map(|number| BoneSegment { joint: 0, head: Vec3::ZERO, tail: spot(number) });
        let chain = (1..200).map(|number| BoneSegment { joint: number, head: spot(number), tail: spot(number + 1) });
        let bones: Vec<BoneSegment> = star.chain(chain).collect();
        let holders = Holders::new(&bones);
        let distance = |bone: u32, point: Vec3| {
            crate::algo::weights::bone_tree::closest_on(&bones[bone as usize], point).distance(point)
        };
        for joints in [vec![], vec![3, 9, 17], vec![0, 5], (0..200).collect()] {
            for number in 0..50 {
                let point = spot(3 * number) + Vec3::splat(0.01);
                let mut calls = 0;
                let mut cost = |bone: u32| {
                    calls += 1;
                    let is_one = joints.contains(&bones[bone as usize].joint);
                    if is_one { distance(bone, point) } else { f32::INFINITY }
                };
                let mut wanted: Vec<(f32, u32)> = (0..bones.len() as u32).map(|bone| (cost(bone), bone)).collect();
                let best = wanted.iter().fold(f32::INFINITY, |best, (cost, _)| best.min(*cost));
                wanted.retain(|(cost, _)| *cost < f32::INFINITY);
                keep_cheapest(&mut wanted, best, 0.5);
                let mut found = Vec::new();
                holders.cheapest((point, 0.5), Some(&joints), &mut cost, |distance| distance, &mut found);
                assert_eq!(found, wanted, "{joints:?} {point}");
                if joints.len() == 3 {
                    assert_eq!(calls, bones.len() + 3);
                }
            }
        }
    }
}
