//! Maps of a motion's joints to those of a rig.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Quat, Vec3};
use serde::Serialize;

use super::{
    four_legs::FourLegs,
    humanoid::{HumanBone, HumanJoints, SkeletonJoint, by_names_and, by_shape, is_above, named_bones},
    motion::Motion,
};
use crate::rig::{NodeKind, Rig, SourceError, Uid, nearest::did_you_mean, parse_ron, utf8};

/// Largest map file in bytes.
pub const MAX_BYTES: usize = 4 << 20;

/// Most joints one below the other that only carry a skeleton, such as those above the hips.
const MOST_ROOTS: usize = 4;

/// Way in which a skeleton's bones were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FoundBy {
    /// Map that was given.
    Map,
    /// Names of the joints.
    Names,
    /// Shape of the skeleton.
    Shape,
    /// Labels of the joints: no bones were found, and joints of the same names are mapped.
    Labels,
}

/// Joints of a motion for joints of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMap {
    /// Joints of the motion for bones of a human.
    pub source: HumanJoints,
    /// Joints of the rig for bones of a human, as indices in the order of [`Rig::walk`].
    pub target: HumanJoints,
    /// Further pairs: joint of the motion and of the rig, which turn alike.
    pub pairs: Vec<(usize, usize)>,
    /// Way in which the motion's bones were found.
    pub found_by: FoundBy,
    /// Rotations of the motion's and of the rig's skeleton from axes in which left is X, up is Y and forward is Z, for animals;
    /// those of humans follow from their bones.
    pub axes: Option<[Quat; 2]>,
}

/// Reason why no map can be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JointMapError {
    /// The map names a joint that the motion does not have.
    #[error("the motion has no joint \"{name}\"{nearest}")]
    NoSource {
        /// Name in the map.
        name: String,
        /// End of the sentence, with names that are near.
        nearest: String,
    },
    /// The map names a joint that the rig does not have.
    #[error("the rig has no joint \"{name}\"{nearest}")]
    NoTarget {
        /// Name in the map.
        name: String,
        /// End of the sentence, with names that are near.
        nearest: String,
    },
    /// No joint of the motion is mapped.
    #[error(
        "no joint of the motion is mapped to the rig: neither are names alike nor is it a human; give a map with --map: [(\"joint of the motion\", \"joint of the rig\"), ...]"
    )]
    Nothing,
    /// Joints that carry everything are mapped alone.
    #[error(
        "of the motion only \"{name}\" is mapped to the rig, which carries all other joints: neither are their names alike nor is it a human; give a map with --map: [(\"joint of the motion\", \"joint of the rig\"), ...]"
    )]
    OnlyRoot {
        /// Joint of the motion.
        name: String,
    },
}

/// Pairs of names: joint of the motion, joint of the rig. A joint of the motion with an empty name beside it moves nothing.
pub type NamePairs = Vec<(String, String)>;

/// Reads a map file: a RON list of pairs of names, `[("LeftUpLeg", "thigh_l")]`.
///
/// # Errors
/// The text is no such list; the error has its place.
pub fn read_joint_map(bytes: &[u8]) -> Result<NamePairs, SourceError> {
    parse_ron(utf8(bytes, MAX_BYTES, "map of joints")?)
}

/// Text of a map file.
pub fn write_joint_map(pairs: &[(String, String)]) -> String {
    let mut text = "// Joint of the motion, joint of the rig; \"\" for none.\n[\n".to_owned();
    for (source, target) in pairs {
        text.push_str(&format!("    ({source:?}, {target:?}),\n"));
    }
    text.push_str("]\n");
    text
}

impl JointMap {
    /// Map of a motion to a rig. Pairs that are given win over what names and shape say, and complete names that say too little.
    /// A joint of the motion that is given an empty name moves nothing.
    ///
    /// # Errors
    /// A given name is unknown, or nothing can be mapped.
    pub fn new(motion: &Motion, rig: &Rig, given: &[(String, String)]) -> Result<Self, JointMapError> {
        let (sources, targets) = (motion_joints(motion), rig_joints(rig));
        let (mut places, mut unwanted) = (Vec::with_capacity(given.len()), BTreeSet::new());
        for (from, to) in given {
            let from = find(&sources, from).map_err(|(name, nearest)| JointMapError::NoSource { name, nearest })?;
            if to.is_empty() {
                unwanted.insert(from);
                continue;
            }
            let to = find(&targets, to).map_err(|(name, nearest)| JointMapError::NoTarget { name, nearest })?;
            places.push((from, to));
        }
        let map = match animals(&sources, &targets) {
            Some(animals) => Self::of_animals([&sources, &targets], &animals, &places),
            None => Self::of_bones([&sources, &targets], places)?,
        };
        let found_by = if given.is_empty() { map.found_by } else { FoundBy::Map };
        Self { found_by, ..map }.without(&unwanted)
    }

    /// Map by the bones of two humans, or else by equal labels, with pairs that are given.
    fn of_bones([sources, targets]: [&[SkeletonJoint]; 2], places: Vec<(usize, usize)>) -> Result<Self, JointMapError> {
        let is_guessed = places.is_empty();
        let target = target_bones(sources, targets, &places);
        let mut pairs = Vec::new();
        let mut replaced: BTreeMap<HumanBone, BTreeSet<usize>> = BTreeMap::new();
        for (from, to) in places {
            match target.iter().find(|(_, joints)| joints.contains(&to)) {
                Some((bone, _)) => replaced.entry(*bone).or_default().extend([from]),
                None => pairs.push((from, to)),
            }
        }
        let known = replaced.iter().filter_map(|(bone, joints)| Some((*bone, *joints.first()?))).collect();
        let (mut source, found_by) = found(sources, &known);
        for (bone, joints) in replaced {
            source.insert(bone, joints.into_iter().collect());
        }
        // Joints of the same name that are no bones of a human turn alike.
        let taken: BTreeSet<usize> = target.values().flatten().copied().collect();
        let is_human = source.keys().any(|bone| target.contains_key(bone));
        for (to, joint) in targets.iter().enumerate().filter(|(to, _)| !is_human || !taken.contains(to)) {
            let is_mapped = pairs.iter().any(|(_, known)| *known == to);
            let from = sources.iter().position(|known| !joint.name.is_empty() && known.name == joint.name);
            if let (Some(from), false) = (from, is_mapped) {
                pairs.push((from, to));
            }
        }
        if !is_human {
            let Some((first, _)) = pairs.first() else { return Err(JointMapError::Nothing) };
            if is_guessed && are_roots(sources, targets, &pairs) {
                return Err(JointMapError::OnlyRoot { name: sources[*first].name.clone() });
            }
            let (source, target, found_by) = (HumanJoints::new(), HumanJoints::new(), FoundBy::Labels);
            return Ok(Self { source, target, pairs, found_by, axes: None });
        }
        Ok(Self { source, target, pairs, found_by, axes: None })
    }

    /// The map without joints of the motion that are to move nothing.
    fn without(mut self, unwanted: &BTreeSet<usize>) -> Result<Self, JointMapError> {
        if unwanted.is_empty() {
            return Ok(self);
        }
        self.source.retain(|_, joints| {
            joints.retain(|joint| !unwanted.contains(joint));
            !joints.is_empty()
        });
        self.target.retain(|bone, _| self.source.contains_key(bone));
        self.pairs.retain(|(from, _)| !unwanted.contains(from));
        let is_empty = self.pairs.is_empty() && self.bones().next().is_none();
        if is_empty { Err(JointMapError::Nothing) } else { Ok(self) }
    }

    /// Map of two animals: hips to hips, and other joints by their chains, but for those of pairs that are given.
    fn of_animals(
        [sources, targets]: [&[SkeletonJoint]; 2],
        [from, to]: &[FourLegs; 2],
        given: &[(usize, usize)],
    ) -> Self {
        let is_given = |target: usize| given.iter().any(|(_, known)| *known == target);
        let hips = given.iter().rev().find(|(_, known)| *known == to.hips).map_or(from.hips, |(source, _)| *source);
        let mut pairs: Vec<(usize, usize)> = given.iter().copied().filter(|(_, target)| *target != to.hips).collect();
        let guessed = from.pairs(sources, to, targets);
        pairs.extend(guessed.into_iter().filter(|(_, target)| !is_given(*target)));
        Self {
            source: HumanJoints::from([(HumanBone::Hips, vec![hips])]),
            target: HumanJoints::from([(HumanBone::Hips, vec![to.hips])]),
            pairs,
            found_by: FoundBy::Shape,
            axes: Some([from.axes, to.axes]),
        }
    }

    /// Map of these pairs alone: a joint of the motion, and one of the rig as an index in the order of [`Rig::walk`].
    ///
    /// # Errors
    /// There are no pairs.
    pub fn of_pairs(motion: &Motion, rig: &Rig, given: &[(usize, usize)]) -> Result<Self, JointMapError> {
        let (sources, targets) = (motion_joints(motion), rig_joints(rig));
        let (mut target, _) = found(&targets, &BTreeMap::new());
        let mut axes = None;
        if let Some([from, to]) = animals(&sources, &targets) {
            target = HumanJoints::from([(HumanBone::Hips, vec![to.hips])]);
            axes = Some([from.axes, to.axes]);
        }
        let mut source = HumanJoints::new();
        let mut pairs = Vec::new();
        for &(from, to) in given.iter().filter(|(from, to)| *from < sources.len() && *to < targets.len()) {
            match target.iter().find(|(_, joints)| joints.contains(&to)) {
                Some((bone, _)) => source.entry(*bone).or_default().push(from),
                None => pairs.push((from, to)),
            }
        }
        for joints in source.values_mut() {
            joints.sort_unstable();
            joints.dedup();
        }
        target.retain(|bone, _| source.contains_key(bone));
        if source.is_empty() && pairs.is_empty() {
            return Err(JointMapError::Nothing);
        }
        Ok(Self { source, target, pairs, found_by: FoundBy::Map, axes })
    }

    /// Pairs of the map: joint of the motion, joint of the rig. Of several joints of a bone, those at the same share of its
    /// length belong together.
    pub fn joint_pairs(&self) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        for (_, source, target) in self.bones() {
            for (place, from) in source.iter().enumerate() {
                pairs.push((*from, target[(place * target.len() / source.len()).min(target.len() - 1)]));
            }
        }
        pairs.extend(&self.pairs);
        pairs
    }

    /// Bones that both skeletons have.
    pub fn bones(&self) -> impl Iterator<Item = (HumanBone, &[usize], &[usize])> {
        self.source.iter().filter_map(|(bone, source)| Some((*bone, &source[..], &self.target.get(bone)?[..])))
    }

    /// The map as pairs of names, with which a map file gives the same map. Joints without names are left out.
    pub fn names(&self, motion: &Motion, rig: &Rig) -> NamePairs {
        let targets = rig_joints(rig);
        let mut pairs = NamePairs::new();
        for (from, to) in self.joint_pairs() {
            let (from, to) = (&motion.joints[from].name, &targets[to].name);
            if !from.is_empty() && !to.is_empty() {
                pairs.push((from.clone(), to.clone()));
            }
        }
        pairs
    }

    /// Names of the motion's joints that move nothing.
    pub fn unmapped_source(&self, motion: &Motion) -> Vec<String> {
        let used: BTreeSet<usize> = self
            .bones()
            .flat_map(|(_, source, _)| source)
            .chain(self.pairs.iter().map(|(from, _)| from))
            .copied()
            .collect();
        let unused = motion.joints.iter().enumerate().filter(|(at, _)| !used.contains(at));
        unused.map(|(_, joint)| joint.name.clone()).collect()
    }

    /// Labels of the rig's joints that nothing moves.
    pub fn unmapped_target(&self, rig: &Rig) -> Vec<String> {
        let used: BTreeSet<usize> =
            self.bones().flat_map(|(.., target)| target).chain(self.pairs.iter().map(|(_, to)| to)).copied().collect();
        let joints =
            rig.walk().enumerate().filter(|(at, joint)| joint.data.kind == NodeKind::Joint && !used.contains(at));
        joints.map(|(_, joint)| joint.data.label.clone().unwrap_or_else(|| joint.data.uid.to_string())).collect()
    }
}

/// Bones of a skeleton, by names and by what is known of bones that have none, or else by shape.
fn found(joints: &[SkeletonJoint], known: &BTreeMap<HumanBone, usize>) -> (HumanJoints, FoundBy) {
    let named = by_names_and(joints, known);
    if named.is_empty() { (shaped(joints), FoundBy::Shape) } else { (named, FoundBy::Names) }
}

/// Bones of a rig. Where neither its names nor its shape say anything, the pairs of a map do, by the names of the motion.
fn target_bones(sources: &[SkeletonJoint], targets: &[SkeletonJoint], pairs: &[(usize, usize)]) -> HumanJoints {
    let (target, _) = found(targets, &BTreeMap::new());
    if !target.is_empty() || pairs.is_empty() {
        return target;
    }
    let bones: BTreeMap<usize, HumanBone> =
        named_bones(sources).into_iter().map(|(bone, joint)| (joint, bone)).collect();
    let known = pairs.iter().filter_map(|(from, to)| Some((*bones.get(from)?, *to))).collect();
    found(targets, &known).0
}

/// True if a joint has nearly all joints of a skeleton of several ones below it.
fn carries_all(joints: &[SkeletonJoint], at: usize) -> bool {
    let below = (0..joints.len()).filter(|joint| is_above(joints, at, *joint)).count();
    joints.len() > 1 && 4 * (below + 1) >= 3 * joints.len()
}

/// True if all pairs are of joints that carry a whole skeleton.
fn are_roots(sources: &[SkeletonJoint], targets: &[SkeletonJoint], pairs: &[(usize, usize)]) -> bool {
    let is_root = |(from, to): &(usize, usize)| carries_all(sources, *from) || carries_all(targets, *to);
    pairs.len() <= MOST_ROOTS && pairs.iter().all(is_root)
}

/// Skeletons of two animals whose joints have other names; `None` for a motion of a human.
fn animals(sources: &[SkeletonJoint], targets: &[SkeletonJoint]) -> Option<[FourLegs; 2]> {
    let animals = [FourLegs::find(sources)?, FourLegs::find(targets)?];
    let places: BTreeMap<&str, usize> =
        sources.iter().enumerate().rev().map(|(at, joint)| (joint.name.as_str(), at)).collect();
    let named = targets.iter().enumerate().filter(|(_, joint)| !joint.name.is_empty());
    let alike: Vec<(usize, usize)> =
        named.filter_map(|(to, joint)| Some((*places.get(joint.name.as_str())?, to))).collect();
    let is_human = !found(sources, &BTreeMap::new()).0.is_empty();
    (!is_human && are_roots(sources, targets, &alike)).then_some(animals)
}

/// Joint of that name, or the name and the end of a sentence about it.
fn find(joints: &[SkeletonJoint], name: &str) -> Result<usize, (String, String)> {
    let nearest = || did_you_mean(name, joints.iter().map(|joint| &joint.name));
    joints.iter().position(|joint| joint.name == name).ok_or_else(|| (name.to_owned(), nearest()))
}

/// Bones by shape, for a figure that faces along Z, or along the negative Y if it stands along Z.
fn shaped(joints: &[SkeletonJoint]) -> HumanJoints {
    let spread = |axis: Vec3| {
        let along = joints.iter().map(|joint| joint.position.dot(axis));
        along.clone().fold(f32::MIN, f32::max) - along.fold(f32::MAX, f32::min)
    };
    match spread(Vec3::Z) > 1.3 * spread(Vec3::Y) {
        true => by_shape(joints, Vec3::Z, Vec3::NEG_Y),
        false => by_shape(joints, Vec3::Y, Vec3::Z),
    }
}

/// Joints of a motion at rest.
pub fn motion_joints(motion: &Motion) -> Vec<SkeletonJoint> {
    let joint = |(joint, rest): (&super::motion::MotionJoint, crate::mesh::model::Trs)| SkeletonJoint {
        name: joint.name.clone(),
        parent: joint.parent,
        position: rest.translation,
        has_end: !joint.ends.is_empty(),
    };
    motion.joints.iter().zip(motion.rest_globals()).map(joint).collect()
}

/// Joints of a rig at rest, in the order of [`Rig::walk`].
pub fn rig_joints(rig: &Rig) -> Vec<SkeletonJoint> {
    let places: Vec<(Uid, Vec3)> = rig.rest_globals().into_iter().map(|(uid, at)| (uid, at.translation)).collect();
    let index: BTreeMap<Uid, usize> = places.iter().enumerate().map(|(at, (uid, _))| (*uid, at)).collect();
    let joint = |(joint, (_, position)): (&crate::rig::RigJoint, &(Uid, Vec3))| SkeletonJoint {
        name: joint.data.label.clone().unwrap_or_default(),
        parent: joint.parent.and_then(|parent| index.get(&parent).copied()),
        position: *position,
        has_end: false,
    };
    rig.walk().zip(&places).map(joint).collect()
}
