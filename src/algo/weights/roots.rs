//! Joints without flesh, and the body part of each bone: roots, targets and slots hang in the air, and an arm holds no
//! flesh of a head that is a part of its own.

use glam::Vec3;

use super::{
    WeightJoint,
    bone::BoneSegment,
    bone_tree::{BoneTree, closest_on},
    bones::LEAF_REACH,
    rings,
    sight::Sight,
};

/// Roots with more children than this keep all their bones.
const MANY_CHILDREN: usize = 256;
/// Samples along a bone.
const STATIONS: usize = 8;
/// A body part is a bone's home if it encloses the bone's joint or at least this share of the bone.
const AT_HOME: f32 = 0.7;

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
            hangs_in_air[index] = share(from, to, |place| sight.encloses(place)) < 0.5;
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
        let parts: Vec<usize> = sight.parts().collect();
        let homes = |index: usize| -> Vec<bool> {
            let head = joints[index].head;
            if parts.is_empty() {
                return vec![sight.encloses(head)];
            }
            parts.iter().map(|&part| sight.is_within(part, head)).collect()
        };
        let mut shared = vec![false; parts.len().max(1)];
        for index in (0..joints.len()).filter(|&index| top[index] == body) {
            shared.iter_mut().zip(homes(index)).for_each(|(shared, home)| *shared |= home);
        }
        let mut own = vec![false; joints.len()];
        for index in (0..joints.len()).filter(|&index| self.hangs_in_air[top[index]] && top[index] != body) {
            own[top[index]] |= homes(index).iter().zip(&shared).any(|(home, shared)| *home && !shared);
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
    /// Flags of each island: whether it is home to each joint; empty where everybody may hold it but slots.
    parts: Vec<Vec<bool>>,
    /// Flag of each joint: whether it is a slot; empty if nothing else holds flesh.
    slots: Vec<bool>,
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
        let mut parts = vec![Vec::new(); sight.islands()];
        for part in sight.parts() {
            let mut at_home = vec![false; claims.len()];
            for segment in segments {
                let is_home = &mut at_home[segment.joint as usize];
                let is_within = |place| sight.is_within(part, place);
                *is_home = *is_home
                    || is_within(segment.head)
                    || segment.head != segment.tail && share(segment.head, segment.tail, is_within) >= AT_HOME;
            }
            parts[part] = if at_home.contains(&true) { at_home } else { Vec::new() };
        }
        let mut members = vec![Vec::new(); parts.len()];
        for point in 0..points.len() {
            members[sight.island(point)].push(point);
        }
        let places = |part: usize| -> Vec<Vec3> { members[part].iter().map(|&point| points[point]).collect() };
        let is_ring = |part: &usize| !parts[*part].is_empty() && rings::bearer(&places(*part), segments).is_some();
        let rings: Vec<usize> = sight.parts().filter(is_ring).collect();
        leave_rings(&mut parts, &rings);
        let mut links = separate_limbs(&mut parts, joints, segments, points, sight);
        for joint in (0..claims.len()).filter(|&joint| claims[joint]) {
            if parts.iter().all(|part: &Vec<bool>| part.get(joint) != Some(&true)) {
                parts.iter_mut().filter_map(|part| part.get_mut(joint)).for_each(|is_home| *is_home = true);
            }
        }
        adopt(&mut parts, slots, segments, points, sight);
        let bearers: Vec<usize> = (0..parts.len()).filter(|&part| !parts[part].is_empty()).collect();
        let mut lying = vec![false; parts.len()];
        sight.parts().filter(|_| !bearers.is_empty()).for_each(|part| lying[part] = parts[part].is_empty());
        for part in sight.parts().filter(|_| !bearers.is_empty()) {
            if parts[part].is_empty() {
                let stride = members[part].len().div_ceil(SAMPLES).max(1);
                let samples = members[part].iter().step_by(stride).map(|&point| points[point]);
                let bearer = bearer(samples, &bearers, sight);
                parts[part] = parts[bearer].clone();
                let of_bearer: Vec<u32> =
                    links.iter().filter(|(island, _)| *island == bearer).map(|(_, bone)| *bone).collect();
                links.extend(of_bearer.into_iter().map(|bone| (part, bone)));
            }
        }
        links.sort_unstable();
        if segments.iter().all(|segment| slots[segment.joint as usize]) {
            return Self { parts, slots: Vec::new(), links, lying };
        }
        // Only now, so that what lies on such a part, as a book in a hand, may be a slot's.
        for part in bearers {
            if parts[part].iter().zip(slots).any(|(is_home, is_slot)| *is_home && !is_slot) {
                parts[part].iter_mut().zip(slots).for_each(|(is_home, is_slot)| *is_home &= !is_slot);
            }
        }
        Self { parts, slots: slots.to_vec(), links, lying }
    }

    /// True if a bone of a joint may hold flesh of an island.
    pub fn may_hold(&self, bone: u32, joint: u32, island: usize) -> bool {
        self.is_at_home(joint, island) && self.links.binary_search(&(island, bone)).is_err()
    }

    /// True if an island lies on others, as a hat or a buckle does: it is no flesh about a bone.
    pub fn lies_on_others(&self, island: usize) -> bool {
        self.lying.get(island) == Some(&true)
    }

    /// True if a joint may hold flesh of an island.
    pub fn is_at_home(&self, joint: u32, island: usize) -> bool {
        match self.parts.get(island).filter(|part| !part.is_empty()) {
            Some(part) => part[joint as usize],
            None => !self.is_slot(joint),
        }
    }

    /// True if a joint is a slot beside joints that hold flesh.
    pub fn is_slot(&self, joint: u32) -> bool {
        self.slots.get(joint as usize).is_some_and(|is_slot| *is_slot)
    }
}

/// Takes the joints from rings that are at home in what a ring is around: a belt lies on the hips, whether more of it is seen from
/// one thigh or from the other.
fn leave_rings(parts: &mut [Vec<bool>], rings: &[usize]) {
    for &ring in rings {
        let others = (0..parts.len()).filter(|part| rings.binary_search(part).is_err());
        let others: Vec<usize> = others.filter(|&part| !parts[part].is_empty()).collect();
        for joint in 0..parts[ring].len() {
            parts[ring][joint] &= !others.iter().any(|&part| parts[part][joint]);
        }
        if !parts[ring].contains(&true) {
            parts[ring] = Vec::new();
        }
    }
}

/// Takes the bones of limbs that are parts of their own from the parts of the trunk in which they begin, with all bones below. A
/// limb is a part of its own if a part holds its first bone and not the joint above it, and if no part of the trunk runs along
/// that bone, as sleeves and trouser legs do: around half of it at least, and with skin between it and its twin. A robe has no
/// skin between the legs, and hangs from the hips. A last joint has no bone yet: it runs on as far as the part that holds it alone,
/// as that of a head which begins in a collar.
///
/// Returns the parts of trunks and the bones that lead to a pair of such limbs, sorted: these hold nothing there, as no flesh of
/// the trunk leads to the limbs. Otherwise hips would hold all of a robe that lies beside the thighs.
fn separate_limbs(
    parts: &mut [Vec<bool>],
    joints: &[WeightJoint],
    segments: &[BoneSegment],
    points: &[Vec3],
    sight: &Sight,
) -> Vec<(usize, u32)> {
    /// Share of a bone that a sleeve is around.
    const SLEEVE: f32 = 0.5;
    let mut bones: Vec<Vec<&BoneSegment>> = vec![Vec::new(); joints.len()];
    for segment in segments.iter().filter(|segment| segment.head != segment.tail) {
        bones[segment.joint as usize].push(segment);
    }
    let is_home = |parts: &[Vec<bool>], part: usize, joint: usize| parts[part].get(joint) == Some(&true);
    let mut gone = vec![vec![false; joints.len()]; parts.len()];
    let mut links = Vec::new();
    let (order, children) = parents_first(joints);
    for joint in order {
        let Some(parent) = joints[joint].parent else { continue };
        let homes: Vec<usize> = (0..parts.len()).filter(|&part| is_home(parts, part, joint)).collect();
        let (left, kept): (Vec<usize>, Vec<usize>) = homes.iter().copied().partition(|&part| gone[part][parent]);
        if !left.is_empty() && !kept.is_empty() {
            left.iter().for_each(|&part| gone[part][joint] = true);
            continue;
        }
        let (trunk, others): (Vec<usize>, Vec<usize>) =
            homes.into_iter().partition(|&part| is_home(parts, part, parent));
        if trunk.is_empty() || others.is_empty() {
            continue;
        }
        let bone = match bones[joint][..] {
            [bone] => *bone,
            [] if children[joint].is_empty() => last_bone(joint, parent, joints, &others, points, sight),
            _ => continue,
        };
        let around = |part: usize| share(bone.head, bone.tail, |place| sight.is_within(part, place));
        if bone.head == bone.tail || !others.iter().any(|&part| around(part) >= AT_HOME) {
            continue;
        }
        let twins: Vec<&BoneSegment> = (0..joints.len())
            .filter(|&other| are_twins(joints, &bones, joint, other))
            .map(|other| bones[other][0])
            .collect();
        let is_sleeve = |part: usize| {
            let skin_between = |twin: &&BoneSegment| {
                (0..STATIONS).map(|i| (i as f32 + 0.5) / STATIONS as f32).any(|along| {
                    let (from, to) = (bone.head.lerp(bone.tail, along), twin.head.lerp(twin.tail, along));
                    sight.is_within(part, from) && sight.is_between(part, from, to)
                })
            };
            around(part) >= SLEEVE && twins.iter().all(skin_between)
        };
        if !trunk.iter().any(|&part| is_sleeve(part)) {
            trunk.iter().for_each(|&part| gone[part][joint] = true);
            if !twins.is_empty() {
                let ends = (joints[parent].head, joints[joint].head);
                let leads = |bone: &usize| (segments[*bone].head, segments[*bone].tail) == ends;
                let leading = (0..segments.len()).filter(leads);
                links.extend(leading.flat_map(|bone| trunk.iter().map(move |&part| (part, bone as u32))));
            }
        }
    }
    for (homes, gone) in parts.iter_mut().zip(gone) {
        homes.iter_mut().zip(gone).for_each(|(is_home, gone)| *is_home &= !gone);
    }
    // A joint that leads to limbs alone holds the trunk by these bones.
    links.sort_unstable();
    let leads = |part: usize, bone: usize| links.binary_search(&(part, bone as u32)).is_ok();
    let has_other =
        |part: usize, joint: u32| (0..segments.len()).any(|bone| segments[bone].joint == joint && !leads(part, bone));
    links.iter().copied().filter(|(part, bone)| has_other(*part, segments[*bone as usize].joint)).collect()
}

/// The bone of a last joint below `parent`, straight on and nearly as far as the farthest of some parts reaches.
fn last_bone(
    joint: usize,
    parent: usize,
    joints: &[WeightJoint],
    parts: &[usize],
    points: &[Vec3],
    sight: &Sight,
) -> BoneSegment {
    let head = joints[joint].head;
    let onwards = (head - joints[parent].head).normalize_or_zero();
    let members = (0..points.len()).filter(|&point| parts.contains(&sight.island(point)));
    let reach = members.map(|point| (points[point] - head).dot(onwards)).fold(0f32, f32::max);
    BoneSegment { joint: joint as u32, head, tail: head + onwards * reach * LEAF_REACH }
}

/// True if two joints have one bone each, of about the same length and direction, and hang on one joint or on joints that do.
fn are_twins(joints: &[WeightJoint], bones: &[Vec<&BoneSegment>], joint: usize, other: usize) -> bool {
    /// Lengths that differ by more than this share are not a pair's.
    const ALIKE: f32 = 0.2;
    let above = |joint: usize| joints[joint].parent;
    let of_one = |a: Option<usize>, b: Option<usize>| a.is_some() && a == b;
    let are_beside =
        of_one(above(joint), above(other)) || of_one(above(joint).and_then(above), above(other).and_then(above));
    let ([bone], [twin]) = (&bones[joint][..], &bones[other][..]) else { return false };
    let (way, twin_way) = (bone.tail - bone.head, twin.tail - twin.head);
    let (length, twin_length) = (way.length(), twin_way.length());
    let is_alike = (length - twin_length).abs() <= ALIKE * length.max(twin_length);
    joint != other && are_beside && is_alike && way.dot(twin_way) > 0.5 * length * twin_length
}

/// Gives parts that enclose no bone to the bones at home nowhere that run through their boxes: shells of plates and bars enclose
/// nothing, and without this a mechanical head would go with the neck that it stands on. Slots and last joints take no such part.
fn adopt(parts: &mut [Vec<bool>], slots: &[bool], segments: &[BoneSegment], points: &[Vec3], sight: &Sight) {
    let has_home = |joint: usize| parts.iter().any(|part| part.get(joint) == Some(&true));
    let is_homeless = |segment: &&BoneSegment| {
        let joint = segment.joint as usize;
        segment.head != segment.tail && !slots[joint] && !has_home(joint)
    };
    let homeless: Vec<&BoneSegment> = segments.iter().filter(is_homeless).collect();
    if homeless.is_empty() {
        return;
    }
    let mut boxes = vec![(Vec3::INFINITY, Vec3::NEG_INFINITY); parts.len()];
    for (index, &point) in points.iter().enumerate() {
        let (low, high) = &mut boxes[sight.island(index)];
        (*low, *high) = (low.min(point), high.max(point));
    }
    for part in sight.parts() {
        if !parts[part].is_empty() {
            continue;
        }
        let (low, high) = boxes[part];
        let is_within = |place: Vec3| place.cmpge(low).all() && place.cmple(high).all();
        let mut at_home = vec![false; slots.len()];
        for segment in &homeless {
            at_home[segment.joint as usize] |= share(segment.head, segment.tail, is_within) >= AT_HOME;
        }
        if at_home.contains(&true) {
            parts[part] = at_home;
        }
    }
}

/// The share of samples between two places for which something holds.
fn share(from: Vec3, to: Vec3, holds: impl Fn(Vec3) -> bool) -> f32 {
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

/// The part that most of some places are nearest to, of those with bones; the first of several.
fn bearer(places: impl Iterator<Item = Vec3>, bearers: &[usize], sight: &Sight) -> usize {
    let mut votes = vec![0usize; bearers.len()];
    for place in places {
        let distances = bearers.iter().map(|&part| sight.distance(part, place));
        let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.into_iter().for_each(|(bearer, _)| votes[bearer] += 1);
    }
    let most = votes.iter().copied().max();
    bearers[votes.iter().position(|&count| Some(count) == most).unwrap_or(0)]
}
