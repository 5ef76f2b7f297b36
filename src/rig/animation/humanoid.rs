//! Humanoid bones, and joints of skeletons that stand for them.
//!
//! A skeleton has for each bone the joints of a chain: an arm may have a twist joint between shoulder and elbow, a spine any
//! number of joints. Limbs are found by their names; spine, neck and helper joints follow from the hierarchy.

mod names;
mod shape;

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
    fmt,
    str::FromStr,
};

use bevy::math::Vec3;

pub use self::shape::by_shape;

/// Fewest joints of a file that numbers all of its nodes.
const FEWEST_NUMBERED: usize = 8;

/// Share of the lower leg by which the ball of a foot is away from the ankle, at least.
const LEAST_FOOT: f32 = 0.1;

/// Side of a bone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BodySide {
    /// The character's left.
    Left,
    /// The character's right.
    Right,
}

impl BodySide {
    /// Pair of sides.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];
}

/// Bone of an arm or a leg.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LimbBone {
    /// Collarbone.
    Shoulder,
    /// Upper arm, from shoulder to elbow.
    UpperArm,
    /// Lower arm, from elbow to wrist.
    LowerArm,
    /// Hand.
    Hand,
    /// Upper leg, from hip to knee.
    UpperLeg,
    /// Lower leg, from knee to ankle.
    LowerLeg,
    /// Foot.
    Foot,
    /// Toes.
    Toes,
}

/// Finger of a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Finger {
    /// Thumb.
    Thumb,
    /// Index finger.
    Index,
    /// Middle finger.
    Middle,
    /// Ring finger.
    Ring,
    /// Little finger.
    Little,
}

/// Bone of a human, as far as clips need it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HumanBone {
    /// Hips, which carry all.
    Hips,
    /// Spine from above the hips to the chest.
    Spine,
    /// Neck.
    Neck,
    /// Head.
    Head,
    /// Bone of a limb.
    Limb(BodySide, LimbBone),
    /// Joint of a finger, counted from 1 at the hand.
    Finger(BodySide, Finger, u8),
}

impl fmt::Display for HumanBone {
    /// The name in snake case, as VRM has it in camel case: `left_upper_arm`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = |side: &BodySide| if *side == BodySide::Left { "left" } else { "right" };
        match self {
            Self::Hips => f.write_str("hips"),
            Self::Spine => f.write_str("spine"),
            Self::Neck => f.write_str("neck"),
            Self::Head => f.write_str("head"),
            Self::Limb(of, bone) => {
                let bone = match bone {
                    LimbBone::Shoulder => "shoulder",
                    LimbBone::UpperArm => "upper_arm",
                    LimbBone::LowerArm => "lower_arm",
                    LimbBone::Hand => "hand",
                    LimbBone::UpperLeg => "upper_leg",
                    LimbBone::LowerLeg => "lower_leg",
                    LimbBone::Foot => "foot",
                    LimbBone::Toes => "toes",
                };
                write!(f, "{}_{bone}", side(of))
            }
            Self::Finger(of, finger, number) => {
                let finger = match finger {
                    Finger::Thumb => "thumb",
                    Finger::Index => "index",
                    Finger::Middle => "middle",
                    Finger::Ring => "ring",
                    Finger::Little => "little",
                };
                write!(f, "{}_{finger}_{number}", side(of))
            }
        }
    }
}

/// Word that names no bone.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{0}\" is no bone of a human; there are hips, spine, neck, head, left_upper_arm and the like")]
pub struct HumanBoneError(pub String);

impl FromStr for HumanBone {
    type Err = HumanBoneError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::all().find(|bone| bone.to_string() == text).ok_or_else(|| HumanBoneError(text.to_owned()))
    }
}

impl HumanBone {
    /// All bones, in order.
    pub fn all() -> impl Iterator<Item = Self> {
        let limbs = [
            LimbBone::Shoulder,
            LimbBone::UpperArm,
            LimbBone::LowerArm,
            LimbBone::Hand,
            LimbBone::UpperLeg,
            LimbBone::LowerLeg,
            LimbBone::Foot,
            LimbBone::Toes,
        ];
        let fingers = [Finger::Thumb, Finger::Index, Finger::Middle, Finger::Ring, Finger::Little];
        let of_side = move |side| {
            let of_finger = move |finger| (1..=3).map(move |number| Self::Finger(side, finger, number));
            limbs.into_iter().map(move |bone| Self::Limb(side, bone)).chain(fingers.into_iter().flat_map(of_finger))
        };
        [Self::Hips, Self::Spine, Self::Neck, Self::Head]
            .into_iter()
            .chain(BodySide::BOTH.into_iter().flat_map(of_side))
    }
}

/// Joint of a skeleton whose bones are looked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SkeletonJoint {
    /// Name; may be empty.
    pub name: String,
    /// Index of the parent, smaller than the joint's own.
    pub parent: Option<usize>,
    /// Position at rest.
    pub position: Vec3,
    /// True if a bone is known to begin at the joint though no joint may follow: the end sites of a BVH tell.
    pub has_end: bool,
}

/// Joints of a skeleton by the bone that they stand for, each list from the body outwards. The first joint of a bone has its
/// position, the last its rotation.
pub type HumanJoints = BTreeMap<HumanBone, Vec<usize>>;

/// Bone of a head, which clips of bodies do not move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum HeadBone {
    /// Eyeball.
    Eye(BodySide),
    /// Lower jaw.
    Jaw,
}

/// Joints below a head that stand for its bones, by their names.
pub fn head_bones(joints: &[SkeletonJoint], head: usize) -> BTreeMap<HeadBone, usize> {
    let unnumbered = without_numbers(joints);
    let joints: &[SkeletonJoint] = &unnumbered;
    let mut found = BTreeMap::new();
    for (at, joint) in joints.iter().enumerate().filter(|(at, _)| is_above(joints, head, *at)) {
        if let Some(bone) = names::head_bone_of(&joint.name) {
            // The joint nearest to the root comes first.
            found.entry(bone).or_insert(at);
        }
    }
    found
}

/// Joints that stand for bones, by their names. Empty if the names say nothing: a human needs hips and two legs.
pub fn by_names(joints: &[SkeletonJoint]) -> HumanJoints {
    by_names_and(joints, &BTreeMap::new())
}

/// Joints that stand for the bones of a human, found by their names; `known` has the joints of further bones. Empty if
/// neither names nor `known` give a skeleton.
pub fn by_names_and(joints: &[SkeletonJoint], known: &BTreeMap<HumanBone, usize>) -> HumanJoints {
    let mut named = named_bones(joints);
    for (bone, joint) in known {
        named.entry(*bone).or_insert(*joint);
    }
    let arms = shape::unnamed_arms(joints, &named);
    named.extend(arms);
    complete(joints, &named)
}

/// Joints that are named as bones, whether they make up a human or not. Of spines, only those that go on to the head have
/// such names.
pub fn named_bones(joints: &[SkeletonJoint]) -> BTreeMap<HumanBone, usize> {
    let unnumbered = without_numbers(joints);
    let joints: &[SkeletonJoint] = &unnumbered;
    let mut named: BTreeMap<HumanBone, usize> = BTreeMap::new();
    let mut ranks: BTreeMap<HumanBone, usize> = BTreeMap::new();
    for (at, joint) in joints.iter().enumerate() {
        let Some((bone, rank)) = names::bone_of(&joint.name) else { continue };
        // A better word wins, then the joint nearer to the root.
        if ranks.get(&bone).is_none_or(|known| rank < *known) {
            ranks.insert(bone, rank);
            named.insert(bone, at);
        }
    }
    name_arms(joints, &mut named);
    name_feet(joints, &mut named);
    name_thumbs(joints, &mut named);
    if !named.contains_key(&HumanBone::Head)
        && let Some(head) = end_of_spine(joints, &named)
    {
        named.insert(HumanBone::Head, head);
    }
    named
}

/// Joints without the numbers that nearly all names end with, each with another one, where a web site has numbered the
/// nodes.
fn without_numbers(joints: &[SkeletonJoint]) -> Cow<'_, [SkeletonJoint]> {
    let named = joints.iter().filter(|joint| !joint.name.is_empty()).count();
    let number = |joint: &SkeletonJoint| names::node_number(&joint.name).map(|(_, number)| number);
    let numbers: BTreeSet<u32> = joints.iter().filter_map(number).collect();
    if numbers.len() < FEWEST_NUMBERED || 5 * numbers.len() < 4 * named {
        return Cow::Borrowed(joints);
    }
    let mut joints = joints.to_vec();
    for joint in &mut joints {
        if let Some(length) = names::node_number(&joint.name).map(|(stem, _)| stem.len()) {
            joint.name.truncate(length);
        }
    }
    Cow::Owned(joints)
}

/// Names the joints of arms that are called shoulder and wrist: a shoulder that carries the elbow is an upper arm if no other
/// joint is called so, and a wrist that carries the hand is where the hand begins.
fn name_arms(joints: &[SkeletonJoint], named: &mut BTreeMap<HumanBone, usize>) {
    for (at, joint) in joints.iter().enumerate() {
        let Some((side, word)) = names::arm_word_of(&joint.name) else { continue };
        let [collar, upper, lower, hand] = [LimbBone::Shoulder, LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand]
            .map(|bone| HumanBone::Limb(side, bone));
        let carries = |bone: HumanBone| named.get(&bone).is_some_and(|child| joints[*child].parent == Some(at));
        match word {
            names::ArmWord::Shoulder if carries(lower) && !named.contains_key(&upper) => {
                if named.get(&collar) == Some(&at) {
                    named.remove(&collar);
                }
                named.insert(upper, at);
            }
            names::ArmWord::Wrist if carries(hand) => {
                named.insert(hand, at);
            }
            names::ArmWord::Shoulder | names::ArmWord::Wrist => {}
        }
    }
}

/// Names the joints of feet that are called ankle and foot, as SMPL has them: an ankle that carries a foot at some distance
/// is the foot, and what is called so its ball, unless another joint is called toes.
fn name_feet(joints: &[SkeletonJoint], named: &mut BTreeMap<HumanBone, usize>) {
    for (at, joint) in joints.iter().enumerate() {
        let Some(side) = names::ankle_side_of(&joint.name) else { continue };
        let [lower, foot, toes] =
            [LimbBone::LowerLeg, LimbBone::Foot, LimbBone::Toes].map(|bone| HumanBone::Limb(side, bone));
        let (Some(knee), Some(ball)) = (named.get(&lower).copied(), named.get(&foot).copied()) else { continue };
        let way = |from: usize, to: usize| joints[from].position.distance(joints[to].position);
        let is_ball = joints[ball].parent == Some(at) && way(at, ball) > LEAST_FOOT * way(knee, at);
        if is_ball && !named.contains_key(&toes) {
            named.insert(foot, at);
            named.insert(toes, ball);
        }
    }
}

/// Names the joints of thumbs as Unity and VRM 0 have them: proximal, intermediate, distal.
fn name_thumbs(joints: &[SkeletonJoint], named: &mut BTreeMap<HumanBone, usize>) {
    for (at, joint) in joints.iter().enumerate() {
        let Some((side, parent)) = names::middle_thumb_side_of(&joint.name).zip(joint.parent) else { continue };
        let [first, second] = [1, 2].map(|number| HumanBone::Finger(side, Finger::Thumb, number));
        if named.get(&second) == Some(&parent) && !named.contains_key(&first) {
            named.insert(first, parent);
            named.insert(second, at);
        }
    }
}

/// Last joint of a numbered spine that goes on above the arms: the head.
fn end_of_spine(joints: &[SkeletonJoint], named: &BTreeMap<HumanBone, usize>) -> Option<usize> {
    let [left, right] = BodySide::BOTH.map(|side| named.get(&HumanBone::Limb(side, LimbBone::UpperArm)).copied());
    let chest = common_ancestor(joints, left?, right?)?;
    let numbers = joints.iter().enumerate().filter_map(|(at, joint)| Some((names::spine_number(&joint.name)?, at)));
    let (_, last) = numbers.max()?;
    is_above(joints, chest, last).then_some(last)
}

/// Bones with the joints between those that are known. Empty without hips and legs.
pub(super) fn complete(joints: &[SkeletonJoint], named: &BTreeMap<HumanBone, usize>) -> HumanJoints {
    let limb = |side, bone| named.get(&HumanBone::Limb(side, bone)).copied();
    let legs = BodySide::BOTH.map(|side| Some([limb(side, LimbBone::UpperLeg)?, limb(side, LimbBone::LowerLeg)?]));
    let [Some([left_leg, _]), Some([right_leg, _])] = legs else { return HumanJoints::new() };
    let Some(fork) = common_ancestor(joints, left_leg, right_leg) else { return HumanJoints::new() };
    let hips = named.get(&HumanBone::Hips).copied().filter(|hips| is_above(joints, *hips, left_leg)).unwrap_or(fork);
    let mut found = HumanJoints::from([(HumanBone::Hips, vec![hips])]);

    let arms = BodySide::BOTH.map(|side| limb(side, LimbBone::Shoulder).or_else(|| limb(side, LimbBone::UpperArm)));
    let head = named.get(&HumanBone::Head).copied();
    let chest = match arms {
        [Some(left), Some(right)] => common_ancestor(joints, left, right),
        _ => named.get(&HumanBone::Neck).or(head.as_ref()).and_then(|above| joints[*above].parent),
    };
    let chest = chest.filter(|chest| *chest != hips && *chest != fork);
    if let Some(chest) = chest {
        let stop = if is_above(joints, hips, chest) { Some(hips) } else { common_ancestor(joints, hips, chest) };
        found.insert(HumanBone::Spine, path(joints, chest, stop));
    }
    if let Some(head) = head {
        found.insert(HumanBone::Head, vec![head]);
        let base = chest.unwrap_or(hips);
        let mut neck = if is_above(joints, base, head) { path(joints, head, Some(base)) } else { Vec::new() };
        neck.pop();
        if !neck.is_empty() {
            found.insert(HumanBone::Neck, neck);
        }
    }
    for side in BodySide::BOTH {
        let chains = [
            [LimbBone::UpperArm, LimbBone::LowerArm, LimbBone::Hand],
            [LimbBone::UpperLeg, LimbBone::LowerLeg, LimbBone::Foot],
        ];
        for chain in chains {
            let known: Vec<(LimbBone, usize)> =
                chain.into_iter().filter_map(|bone| Some((bone, limb(side, bone)?))).collect();
            for (place, (bone, joint)) in known.iter().enumerate() {
                let next = known.get(place + 1).map(|(_, next)| *next).filter(|next| is_above(joints, *joint, *next));
                // Joints up to the next bone belong to this one.
                let between = next.map_or_else(Vec::new, |next| path(joints, next, Some(*joint)));
                let own = std::iter::once(*joint).chain(between.into_iter().filter(|other| Some(*other) != next));
                found.insert(HumanBone::Limb(side, *bone), own.collect());
            }
        }
        if let Some(upper) = limb(side, LimbBone::UpperArm) {
            let mut shoulder = path(joints, upper, chest);
            shoulder.pop();
            if chest.is_some() && !shoulder.is_empty() && shoulder.len() <= 4 {
                found.insert(HumanBone::Limb(side, LimbBone::Shoulder), shoulder);
            }
        }
        if let Some(toes) = limb(side, LimbBone::Toes) {
            found.insert(HumanBone::Limb(side, LimbBone::Toes), vec![toes]);
        }
    }
    for (bone, joint) in named {
        if matches!(bone, HumanBone::Finger(..)) {
            found.insert(*bone, vec![*joint]);
        }
    }
    found
}

/// True if a joint is an ancestor of another one.
pub(crate) fn is_above(joints: &[SkeletonJoint], above: usize, joint: usize) -> bool {
    ancestors(joints, joint).any(|at| at == above)
}

/// Ancestors of a joint, the nearest first.
pub(crate) fn ancestors(joints: &[SkeletonJoint], joint: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(joints[joint].parent, |at| joints[*at].parent)
}

fn common_ancestor(joints: &[SkeletonJoint], a: usize, b: usize) -> Option<usize> {
    let of_a: Vec<usize> = ancestors(joints, a).collect();
    ancestors(joints, b).find(|at| of_a.contains(at))
}

/// Joints from below `stop` to `joint`.
pub(super) fn path(joints: &[SkeletonJoint], joint: usize, stop: Option<usize>) -> Vec<usize> {
    let mut path: Vec<usize> =
        std::iter::once(joint).chain(ancestors(joints, joint)).take_while(|at| Some(*at) != stop).collect();
    path.reverse();
    path
}
