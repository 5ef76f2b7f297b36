//! Joints without flesh, and the body part of each bone: roots, targets and slots hang in the air, and an arm holds no
//! flesh of a head that is a part of its own.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::{BoneTree, closest_on},
    limb_parts::separate_limbs,
    rings::RingBones,
    sight::Sight,
};

/// Roots with more children than this keep all their bones, and bones to so many run side by side.
pub(super) const MANY_CHILDREN: usize = 256;
/// Samples along a bone.
pub(super) const STATIONS: usize = 8;
/// A body part is a bone's home if it encloses the bone's joint or at least this share of the bone.
pub(super) const AT_HOME: f32 = 0.7;

/// The joints above the body, which carry a character through the world and hold no flesh.
pub(crate) struct Roots {
    /// Flag of each joint: whether it hangs on a root by a bone that runs through the air.
    pub hangs_in_air: Vec<bool>,
}

impl Roots {
    /// Finds the roots of checked joints.
    pub fn new(joints: &[WeightJoint], children: &[Vec<usize>], sight: &Sight) -> Self {
        let (order, _) = parents_first(joints);
        let mut sizes = vec![1usize; joints.len()];
        for &index in order.iter().rev() {
            if let Some(parent) = joints[index].parent {
                sizes[parent] += sizes[index];
            }
        }
        let mut hangs_in_air = vec![false; joints.len()];
        let mut is_root: Vec<bool> = joints.iter().map(|joint| joint.parent.is_none()).collect();
        // Roots below which the body hangs in the air: whatever else they carry holds no flesh with them, either.
        let mut stands_off = vec![false; joints.len()];
        for &index in &order {
            let Some(parent) = joints[index].parent.filter(|&parent| is_root[parent]) else { continue };
            if children[parent].len() > MANY_CHILDREN {
                continue;
            }
            let (from, to) = (joints[parent].head, joints[index].head);
            let is_outside = share(from, to, |place| sight.encloses(place)) < 0.5;
            hangs_in_air[index] =
                is_outside || children[parent].len() == 1 && stands_below(joints, children, parent, index);
            stands_off[parent] |= hangs_in_air[index] && 2 * sizes[index] >= sizes[parent];
            is_root[index] = hangs_in_air[index] && !sight.encloses(to) && !sight.is_amid(to);
        }
        for (index, joint) in joints.iter().enumerate() {
            hangs_in_air[index] |= joint.parent.is_some_and(|parent| stands_off[parent]);
        }
        Self { hangs_in_air }
    }

    /// The joints of targets and handles: subtrees that hang in the air beside the largest one, at most half as large,
    /// without a body part of their own and without a bone in flesh that no bone of the largest one is near to.
    pub fn helpers(&self, joints: &[WeightJoint], sight: &Sight) -> Vec<bool> {
        let (order, _) = parents_first(joints);
        let mut top: Vec<usize> = (0..joints.len()).collect();
        let mut sizes = vec![0usize; joints.len()];
        for &index in &order {
            if let Some(parent) = joints[index].parent.filter(|_| !self.hangs_in_air[index]) {
                top[index] = top[parent];
            }
            sizes[top[index]] += 1;
        }
        let is_hanging = |index: &usize| self.hangs_in_air[*index];
        let Some(body) = order.iter().copied().filter(is_hanging).max_by_key(|&index| sizes[index]) else {
            return vec![false; joints.len()];
        };
        let has_parts = sight.parts().next().is_some();
        let homes = |index: usize| -> Vec<usize> {
            let head = joints[index].head;
            if !has_parts {
                return if sight.encloses(head) { vec![0] } else { Vec::new() };
            }
            let mut homes = sight.candidates(head);
            homes.retain(|&part| !sight.is_crowded(joints.len()) && sight.is_within(part, head));
            homes
        };
        let mut shared = vec![false; sight.islands().max(1)];
        for index in (0..joints.len()).filter(|&index| top[index] == body) {
            homes(index).into_iter().for_each(|home| shared[home] = true);
        }
        let mut own = vec![false; joints.len()];
        for index in (0..joints.len()).filter(|&index| self.hangs_in_air[top[index]] && top[index] != body) {
            own[top[index]] |= homes(index).into_iter().any(|home| !shared[home]);
        }
        for index in self.apart(joints, &top, body, sight) {
            own[top[index]] = true;
        }
        let is_helper = |index: usize| {
            let top = top[index];
            self.hangs_in_air[top] && top != body && 2 * sizes[top] <= sizes[body] && !own[top]
        };
        (0..joints.len()).map(is_helper).collect()
    }

    /// The joints of other subtrees that end a bone in the flesh which is shorter than the way from either of its ends to
    /// the bones of the body, and those without bones that lie in the flesh about as far beyond the last bone of a limb as it
    /// is long. The feet of a figure whose legs end at the knees hang on the targets of these legs or on the root; bones of
    /// handles inside of a foot lie beside the foot's own, and targets where the limb ends.
    fn apart(&self, joints: &[WeightJoint], top: &[usize], body: usize, sight: &Sight) -> Vec<usize> {
        /// Bones almost as near as the nearest one meet at one joint.
        const MEETING: f32 = 1e-3;
        /// Share of the length of the bone that ends towards it which a joint without bones is farther away than.
        const ALONE: f32 = 0.9;
        let of_body = |index: usize| {
            let head = joints[index].head;
            let above = joints[index].parent.filter(|&parent| top[parent] == body).map_or(head, |p| joints[p].head);
            BoneSegment { joint: index as u32, head: above, tail: head }
        };
        let bones: Vec<BoneSegment> = (0..joints.len()).filter(|&index| top[index] == body).map(of_body).collect();
        let tree = BoneTree::new(&bones);
        let mut near = Vec::new();
        // The bones of the body nearest to a place, the way there and the length of the longest of them.
        let mut nearest = |place: Vec3| -> (Vec<u32>, f32, f32) {
            tree.nearest(place, MEETING, |bone| closest_on(&bones[bone as usize], place).distance(place), &mut near);
            let lengths = near.iter().map(|&(_, bone)| bones[bone as usize].head.distance(bones[bone as usize].tail));
            let longest = lengths.fold(0f32, f32::max);
            (near.iter().map(|&(_, bone)| bone).collect(), near.first().map_or(0.0, |nearest| nearest.0), longest)
        };
        let mut has_child = vec![false; joints.len()];
        for parent in joints.iter().filter_map(|joint| joint.parent) {
            has_child[parent] = true;
        }
        let is_apart = |index: &usize| {
            let to = joints[*index].head;
            let Some(parent) = joints[*index].parent.filter(|&parent| top[parent] == top[*index]) else {
                let (ending, way, longest) = nearest(to);
                let ends_towards = |bone: &u32| {
                    let BoneSegment { tail, .. } = bones[*bone as usize];
                    closest_on(&bones[*bone as usize], to).distance(tail) <= MEETING * longest
                };
                let is_beyond = way > ALONE * longest && ending.iter().all(ends_towards);
                return !has_child[*index] && is_beyond && sight.encloses(to);
            };
            let from = joints[parent].head;
            let length = from.distance(to);
            // No way where the nearest bone is so long that its own flesh reaches here.
            let mut way = |place: Vec3| {
                let (_, way, longest) = nearest(place);
                if 2.0 * way > longest { way } else { 0.0 }
            };
            length > 0.0 && way(from).min(way(to)) > length && sight.encloses(from) && sight.encloses(to)
        };
        let is_beside = |index: &usize| self.hangs_in_air[top[*index]] && top[*index] != body;
        (0..joints.len()).filter(is_beside).filter(is_apart).collect()
    }
}

/// The body parts of a surface of several that each joint holds flesh of.
#[derive(Debug, Clone, Default)]
pub(crate) struct Homes {
    /// Joints that are at home in each island, rising; `None` where everybody may hold it but slots.
    parts: Vec<Option<Vec<u32>>>,
    /// The island whose joints hold each island: the one that it lies on if it has no bones, or itself.
    bearers: Vec<usize>,
    /// Flag of each joint: whether it is a slot; empty if nothing else holds flesh.
    slots: Vec<bool>,
    /// Flag of each island: whether joints without slots are at home there, so that slots hold nothing of it.
    has_flesh: Vec<bool>,
    /// Bones that lead to limbs which are parts of their own, by the island that they hold nothing of; sorted.
    links: Vec<(usize, u32)>,
    /// Flag of each island: whether no bone runs through it while others have some.
    lying: Vec<bool>,
}

/// Approximate number of points of a part without bones that look for the part that it lies on.
const SAMPLES: usize = 32;

impl Homes {
    /// Looks where the bones of joints run. Joints for which `claims` is true and that are at home nowhere may hold all parts;
    /// those for which `slots` is true hold nothing of a part that others are at home in, nor of small ones: a sword is the
    /// slot's that it is around, the hand is not.
    pub fn new(
        joints: &[WeightJoint],
        (claims, slots): (&[bool], &[bool]),
        segments: &[BoneSegment],
        points: &[Vec3],
        sight: &Sight,
    ) -> Self {
        let is_slot = |joint: u32| slots[joint as usize];
        let slots_beside_flesh =
            if segments.iter().all(|segment| is_slot(segment.joint)) { Vec::new() } else { slots.to_vec() };
        let residents = residents(segments, joints.len(), sight);
        let mut parts = vec![None; sight.islands()];
        for (part, joint) in residents {
            parts[part].get_or_insert_with(Vec::new).push(joint);
        }
        let mut members = vec![Vec::new(); parts.len()];
        for point in 0..points.len() {
            members[sight.island(point)].push(point);
        }
        let places = |part: usize| -> Vec<Vec3> { members[part].iter().map(|&point| points[point]).collect() };
        let ring_bones = RingBones::new(segments);
        let is_ring = |part: &usize| parts[*part].is_some() && ring_bones.bearer(&places(*part)).is_some();
        let rings: Vec<usize> = sight.parts().filter(is_ring).collect();
        leave_rings(&mut parts, &rings);
        let links = separate_limbs(&mut parts, joints, segments, (points, &members), sight);
        let has_home = at_home_anywhere(&parts, claims.len());
        for joint in (0..claims.len()).filter(|&joint| claims[joint] && !has_home[joint]) {
            for part in parts.iter_mut().flatten() {
                let at = part.partition_point(|&other| other < joint as u32);
                part.insert(at, joint as u32);
            }
        }
        adopt(&mut parts, slots, segments, sight);
        if sight.is_crowded(joints.len()) {
            return Self { slots: slots_beside_flesh, ..Self::default() };
        }
        let with_bones: Vec<usize> = (0..parts.len()).filter(|&part| parts[part].is_some()).collect();
        let boxes = with_bones.iter().filter_map(|&part| sight.corners(part));
        let boxes: Vec<BoneSegment> = boxes.map(|[head, tail]| BoneSegment { joint: 0, head, tail }).collect();
        let tree = BoneTree::of_boxes(&boxes);
        let mut bearers: Vec<usize> = (0..parts.len()).collect();
        let mut lying = vec![false; parts.len()];
        for part in sight.parts().filter(|&part| parts[part].is_none() && !with_bones.is_empty()) {
            let stride = members[part].len().div_ceil(SAMPLES).max(1);
            let samples = members[part].iter().step_by(stride).map(|&point| points[point]);
            bearers[part] = bearer(samples, &with_bones, &tree, sight);
            lying[part] = true;
        }
        // Not for what lies on such a part, as a book in a hand: it may be a slot's.
        let has_flesh = parts.iter().map(|part| part.iter().flatten().any(|&joint| !is_slot(joint))).collect();
        Self { parts, bearers, slots: slots_beside_flesh, has_flesh, links, lying }
    }

    /// True if a bone of a joint may hold flesh of an island.
    pub fn may_hold(&self, bone: u32, joint: u32, island: usize) -> bool {
        self.is_at_home(joint, island) && self.links.binary_search(&(self.bearer(island), bone)).is_err()
    }

    /// The joints that alone may hold an island; `None` if all may.
    pub fn joints_of(&self, island: usize) -> Option<&[u32]> {
        self.parts.get(self.bearer(island))?.as_deref()
    }

    /// Joints that are at home in each island, rising; `None` where everybody may hold it.
    pub fn residents(&self) -> &[Option<Vec<u32>>] {
        &self.parts
    }

    /// True if a joint is at home in an island, not counting those that everybody may hold.
    pub fn is_resident(&self, joint: u32, island: usize) -> bool {
        self.parts.get(island).and_then(Option::as_ref).is_some_and(|part| part.binary_search(&joint).is_ok())
    }

    /// True if an island lies on others, as a hat or a buckle does: it is no flesh about a bone.
    pub fn lies_on_others(&self, island: usize) -> bool {
        self.lying.get(island) == Some(&true)
    }

    fn bearer(&self, island: usize) -> usize {
        self.bearers.get(island).copied().unwrap_or(island)
    }

    /// True if a joint may hold flesh of an island.
    pub fn is_at_home(&self, joint: u32, island: usize) -> bool {
        match self.parts.get(self.bearer(island)).and_then(Option::as_ref) {
            Some(part) => part.binary_search(&joint).is_ok() && !(self.has_flesh[island] && self.is_slot(joint)),
            None => !self.is_slot(joint),
        }
    }

    /// True if a joint is a slot beside joints that hold flesh.
    pub fn is_slot(&self, joint: u32) -> bool {
        self.slots.get(joint as usize).is_some_and(|is_slot| *is_slot)
    }
}

/// Parts with the joints that are at home in each: the part encloses the joint, or most of a bone of it. None in a crowd of
/// parts.
fn residents(segments: &[BoneSegment], joints: usize, sight: &Sight) -> BTreeSet<(usize, u32)> {
    let mut residents = BTreeSet::new();
    for &BoneSegment { joint, head, tail } in segments {
        let mut near = sight.candidates(head);
        if head != tail {
            // A part that encloses most of a bone is around the middle of it.
            near.extend(sight.candidates(head.midpoint(tail)));
            near.sort_unstable();
            near.dedup();
        }
        for part in near {
            let is_within = |place| sight.is_within(part, place);
            if residents.contains(&(part, joint)) {
                continue;
            }
            if is_within(head) || head != tail && share(head, tail, is_within) >= AT_HOME {
                residents.insert((part, joint));
            }
            if sight.is_crowded(joints) {
                return BTreeSet::new();
            }
        }
    }
    residents
}

/// True if a root stands on the ground below its only child, and limbs come back from there down to it: a robe is around the way
/// from the root to the hips as around the legs, but no flesh is.
fn stands_below(joints: &[WeightJoint], children: &[Vec<usize>], root: usize, child: usize) -> bool {
    /// Limbs come back at least this share of the way.
    const BACK: f32 = 0.75;
    /// Limbs that stand on the ground, at least.
    const LEGS: usize = 2;
    /// Legs rise no further beyond the child than this share of the way; arms hang from higher up.
    const RISE: f32 = 0.25;
    let way = joints[child].head - joints[root].head;
    let (mut waiting, mut legs) = (vec![child], 0);
    while let Some(joint) = waiting.pop() {
        let back = joints[child].head - joints[joint].head;
        let share = back.dot(way) / way.length_squared();
        if share >= BACK {
            legs += 1;
        } else if share >= -RISE {
            waiting.extend(&children[joint]);
        }
    }
    legs >= LEGS
}

/// Flag of each joint: whether it is at home in a part.
fn at_home_anywhere(parts: &[Option<Vec<u32>>], joints: usize) -> Vec<bool> {
    let mut has_home = vec![false; joints];
    parts.iter().flatten().flatten().for_each(|&joint| has_home[joint as usize] = true);
    has_home
}

/// Takes the joints from rings that are at home in what a ring is around: a belt lies on the hips, whether more of it is seen from
/// one thigh or from the other.
fn leave_rings(parts: &mut [Option<Vec<u32>>], rings: &[usize]) {
    let others = (0..parts.len()).filter(|part| rings.binary_search(part).is_err());
    let elsewhere: BTreeSet<u32> = others.filter_map(|part| parts[part].as_ref()).flatten().copied().collect();
    for &ring in rings {
        let joints = parts[ring].take().into_iter().flatten();
        let joints: Vec<u32> = joints.filter(|joint| !elsewhere.contains(joint)).collect();
        parts[ring] = (!joints.is_empty()).then_some(joints);
    }
}

/// Gives parts that enclose no bone to the bones at home nowhere that run through their boxes: shells of plates and bars enclose
/// nothing, and without this a mechanical head would go with the neck that it stands on. Slots and last joints take no such part.
fn adopt(parts: &mut [Option<Vec<u32>>], slots: &[bool], segments: &[BoneSegment], sight: &Sight) {
    let has_home = at_home_anywhere(parts, slots.len());
    let is_homeless = |segment: &&BoneSegment| {
        let joint = segment.joint as usize;
        segment.head != segment.tail && !slots[joint] && !has_home[joint]
    };
    let mut adopted = BTreeSet::new();
    for &BoneSegment { joint, head, tail } in segments.iter().filter(is_homeless) {
        for part in sight.boxes_around(head.midpoint(tail)).into_iter().filter(|&part| parts[part].is_none()) {
            let is_within = |[low, high]: [Vec3; 2]| {
                share(head, tail, |place| place.cmpge(low).all() && place.cmple(high).all()) >= AT_HOME
            };
            if sight.corners(part).is_some_and(is_within) {
                adopted.insert((part, joint));
            }
        }
        if sight.is_crowded(slots.len()) {
            return;
        }
    }
    for (part, joint) in adopted {
        parts[part].get_or_insert_with(Vec::new).push(joint);
    }
}

/// The share of samples between two places for which something holds.
pub(super) fn share(from: Vec3, to: Vec3, holds: impl Fn(Vec3) -> bool) -> f32 {
    let station = |i: usize| from.lerp(to, (i as f32 + 0.5) / STATIONS as f32);
    (0..STATIONS).filter(|&i| holds(station(i))).count() as f32 / STATIONS as f32
}

/// Joints with each parent before its children, and the children of each joint.
pub(super) fn parents_first(joints: &[WeightJoint]) -> (Vec<usize>, Vec<Vec<usize>>) {
    let mut children = vec![Vec::new(); joints.len()];
    let mut order = Vec::with_capacity(joints.len());
    for (index, joint) in joints.iter().enumerate() {
        match joint.parent {
            Some(parent) => children[parent].push(index),
            None => order.push(index),
        }
    }
    let mut next = 0;
    while let Some(&joint) = order.get(next) {
        next += 1;
        order.extend(&children[joint]);
    }
    (order, children)
}

/// The part that most of some places are nearest to, of those with bones; the first of several. `tree` has their boxes.
fn bearer(places: impl Iterator<Item = Vec3>, bearers: &[usize], tree: &BoneTree, sight: &Sight) -> usize {
    /// Parts that are compared for one place.
    const MOST: usize = 256;
    let mut votes: BTreeMap<usize, usize> = BTreeMap::new();
    let mut near = Vec::new();
    for place in places {
        let mut compared = 0;
        let distance = |bearer: u32| {
            compared += 1;
            if compared > MOST { f32::INFINITY } else { sight.distance(bearers[bearer as usize], place) }
        };
        tree.nearest(place, 0.0, distance, &mut near);
        *votes.entry(near.first().map_or(0, |nearest| nearest.1 as usize)).or_default() += 1;
    }
    let most = votes.into_iter().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)));
    bearers[most.map_or(0, |(bearer, _)| bearer)]
}
