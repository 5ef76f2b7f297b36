//! Parts of other sizes: chains of a part that take more or fewer joints than its file has.

use std::{collections::HashMap, sync::Arc};

use bevy::math::{Affine3, Quat, Vec3};

use super::{Part, PartError, PartNeeds, name_of};
use crate::rig::{
    EditError, JointData, NodeRef, NodeRefs, RestTransform, Rig, RigEdit, TagKind, Uid,
    operations::{OperationError, TagError},
    reference::{Pick, PickAt, Source, map_unions},
};

/// Largest number of joints of a chain of a part.
pub(in crate::rig) const MOST_JOINTS: usize = 200;

/// Two or more joints of a part, each the child of the one before, of which an instance may have another number; or branches
/// side by side, such as fingers.
///
/// The first joints and the last one keep their identities, places of the others are taken along the line of the part's own.
/// References to several joints of the chain name those in between, too, and picks of a command's nodes up to the last joint
/// go on up to the last joint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartChain {
    /// Name for people.
    pub name: String,
    /// The joints in the part's file, from the base.
    pub joints: Vec<Uid>,
    /// Smallest number of joints.
    pub min: usize,
    /// Largest number of joints.
    pub max: usize,
    /// True for branches: the joints are the first of each, and all hang on one joint.
    pub is_fan: bool,
}

impl Part {
    /// The part with as many joints in its chain as there are for it where it goes onto `count` joints of a rig; as it is where
    /// it has no chain, or several.
    ///
    /// # Errors
    /// Fewer joints than the part needs with its shortest chain; a chain that is none of the part.
    pub fn sized_for(&self, count: usize) -> Result<Rig, PartError> {
        let [chain @ PartChain { is_fan: false, .. }] = self.chains.as_slice() else { return Ok(self.rig.clone()) };
        let least = chain.resized(&self.rig, chain.min)?;
        let of_chain = least.walk().enumerate().filter(|(_, joint)| chain.joints.contains(&joint.data.uid));
        let end = of_chain.map(|(place, _)| place + 1).max().unwrap_or_default();
        let needed = end.max(PartNeeds::of(&least).joints.len());
        if count < needed {
            let joints = least.walk().take(needed).map(name_of).collect();
            let error = TagError::PartNeeds { part: self.rig.about().name.clone(), joints, given: count };
            return Err(OperationError::from(error).into());
        }
        chain.resized(&self.rig, chain.count_on(&self.rig, count).max(chain.min))
    }
}

impl PartChain {
    /// Number of joints of the chain where its part goes onto `count` joints. What hangs behind the chain may be left out.
    pub(super) fn count_on(&self, part: &Rig, count: usize) -> usize {
        let most = count.saturating_sub(part.len().saturating_sub(self.joints.len()));
        if (self.min..=self.max).contains(&most) { most } else { count.min(self.max) }
    }

    /// The part with `count` joints in this chain.
    ///
    /// # Errors
    /// A chain that does not take so many joints, or is none of `part`.
    pub fn resized(&self, part: &Rig, count: usize) -> Result<Rig, PartError> {
        let Self { name, joints, min, max, is_fan } = self;
        if !(*min..=*max).contains(&count) {
            return Err(PartError::ChainLength { chain: name.clone(), min: *min, max: *max, count });
        }
        let mut out = part.clone();
        if count == joints.len() {
            return Ok(out);
        }
        let chain_edit = |source| PartError::ChainEdit { chain: name.clone(), source };
        if *is_fan {
            return self.branched(part, count).map_err(chain_edit);
        }
        let places = self.places(part, count)?;
        let kept = self.change(&mut out, count).map_err(chain_edit)?;
        let mut above = kept.first().and_then(|first| part.joint(*first)?.parent).map_or(Affine3::IDENTITY, |parent| {
            part.rest_globals().into_iter().find(|(uid, _)| *uid == parent).map_or(Affine3::IDENTITY, |(_, at)| at)
        });
        for (joint, place) in kept.iter().zip(places) {
            let rest = RestTransform::from_affine(&(above.inverse() * place));
            out.apply(&RigEdit::SetRest(*joint, rest))?;
            above = place;
        }
        Ok(out)
    }

    /// Places of `count` joints along the chain, in the rig's space.
    fn places(&self, part: &Rig, count: usize) -> Result<Vec<Affine3>, PartError> {
        let globals: HashMap<Uid, Affine3> = part.rest_globals().into_iter().collect();
        let known: Option<Vec<Affine3>> = self.joints.iter().map(|joint| globals.get(joint).copied()).collect();
        let known = known.filter(|known| !known.is_empty());
        let known = known.ok_or_else(|| PartError::ForeignChain { chain: self.name.clone() })?;
        let last = known.len() - 1;
        let parted = |place: usize| {
            let share = if count > 1 { place as f32 / (count - 1) as f32 * last as f32 } else { 0.0 };
            let segment = (share as usize).min(last.saturating_sub(1));
            (segment, (segment + 1).min(last), share - segment as f32)
        };
        let point = |place: usize| {
            let (from, to, share) = parted(place);
            known[from].translation.lerp(known[to].translation, share)
        };
        let mut places = Vec::with_capacity(count);
        for place in 0..count {
            let (from, to, share) = parted(place);
            let (_, a, _) = known[from].to_scale_rotation_translation();
            let (_, b, _) = known[to].to_scale_rotation_translation();
            let mut turn = (a * (1.0 - share) + (if a.dot(b) < 0.0 { -b } else { b }) * share).normalize();
            // A joint with one behind it looks at that as its counterpart in the file does.
            let along = known[from].inverse().transform_point3(known[to].translation).normalize_or_zero();
            let ahead =
                if place + 1 < count { (point(place + 1) - point(place)).normalize_or_zero() } else { Vec3::ZERO };
            if along != Vec3::ZERO && ahead != Vec3::ZERO {
                turn = Quat::from_rotation_arc(turn * along, ahead) * turn;
            }
            places.push(Affine3::from_rotation_translation(turn, point(place)));
        }
        // The ends stand as in the file; a chain of one is its base.
        places[0] = known[0];
        if count > 1 {
            places[count - 1] = known[last];
        }
        Ok(places)
    }

    /// Takes joints out of the chain or puts some in, with all that refers to them. Returns the chain's joints.
    fn change(&self, rig: &mut Rig, count: usize) -> Result<Vec<Uid>, EditError> {
        let joints = &self.joints;
        let last = joints.len() - 1;
        self.pick(rig, count);
        if count <= last {
            let (kept, gone) = (&joints[..count.max(2) - 1], &joints[count.max(2) - 1..last]);
            let mut chain = kept.to_vec();
            // What hung on a joint that goes hangs on the last one before it, as does the end of the chain.
            let above = kept[kept.len() - 1];
            let mut leaves = gone.to_vec();
            if count > 1 {
                chain.push(joints[last]);
            } else {
                leaves.push(joints[last]);
            }
            for joint in &leaves {
                for child in rig.children(Some(*joint)).to_vec() {
                    if !leaves.contains(&child) {
                        rig.apply(&RigEdit::SetParent { joint: child, parent: Some(above), index: usize::MAX })?;
                    }
                }
            }
            refer(rig, &mut |union| without(union, &leaves, above));
            for joint in leaves.iter().rev() {
                rig.apply(&RigEdit::RemoveJoint(*joint))?;
            }
            self.number(rig, &chain)?;
            return Ok(chain);
        }
        let mut chain = joints[..last].to_vec();
        let (before, end) = (joints[last - 1], joints[last]);
        let Some(pattern) = rig.joint(before).map(|joint| joint.data.clone()) else {
            return Err(EditError::NoJoint(before));
        };
        let mut added = Vec::new();
        for number in last..count - 1 {
            let uid = Uid::derived(["joint of a chain", &before.to_string(), &number.to_string()]);
            let data = JointData { uid, label: None, mirror: None, tags: Vec::new(), face: None, ..pattern.clone() };
            let parent = chain.last().copied();
            rig.apply(&RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX })?;
            chain.push(uid);
            added.push(uid);
        }
        rig.apply(&RigEdit::SetParent { joint: end, parent: chain.last().copied(), index: usize::MAX })?;
        chain.push(end);
        refer(rig, &mut |union| with(union, joints, before, &added));
        self.number(rig, &chain)?;
        Ok(chain)
    }

    /// Makes picks by number of the nodes of a command on the chain which go up to the last joint go up to the last of `count`.
    fn pick(&self, rig: &mut Rig, count: usize) {
        let on_chain = self.joints.iter().filter_map(|joint| rig.joint(*joint)).flat_map(|joint| &joint.data.tags);
        let commands: Vec<Uid> = on_chain.map(|tag| tag.uid).collect();
        let most = self.joints.len();
        refer(rig, &mut |union| {
            for reference in &mut union.0 {
                let is_of_chain = matches!(reference.source, Source::Command(tag) if commands.contains(&tag));
                if let Pick::List(places) = &mut reference.pick
                    && let Some(PickAt::Number(first)) = places.first().copied()
                    && is_of_chain
                    && places.len() > 1
                    && places.iter().zip(first..).all(|(place, number)| *place == PickAt::Number(number))
                    && first as usize + places.len() == most
                {
                    let first = first.min(count as u32 - 1);
                    *places = (first..count as u32).map(PickAt::Number).collect();
                }
            }
        });
    }

    /// Numbers the joints of a chain whose labels have numbers.
    fn number(&self, rig: &mut Rig, chain: &[Uid]) -> Result<(), EditError> {
        let label = |rig: &Rig, joint: Uid| rig.joint(joint).and_then(|joint| joint.data.label.clone());
        let before = self.joints[self.joints.len() - 2];
        let Some(known) = label(rig, before).or_else(|| label(rig, chain[0])) else { return Ok(()) };
        let place = chain.iter().position(|joint| *joint == before).unwrap_or_default();
        let (stem, number, rest) = parted(&known).unwrap_or((known.as_str(), 1, ""));
        let is_numbered = stem.len() < known.len();
        for (at, joint) in chain.iter().enumerate().skip(place + 1) {
            let own = label(rig, *joint);
            let is_alike = match &own {
                Some(own) => is_numbered && parted(own).is_some_and(|(other, _, end)| other == stem && end == rest),
                None => true,
            };
            if is_alike {
                let dash = if is_numbered { "" } else { "_" };
                let text = format!("{stem}{dash}{}{rest}", number + at - place);
                rig.apply(&RigEdit::SetLabel(*joint, Some(text)))?;
            }
        }
        Ok(())
    }
}

/// A label as the text before its last number, the number, and the text behind.
fn parted(label: &str) -> Option<(&str, usize, &str)> {
    let end = label.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = label[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    // Leading zeros belong to the text.
    let digits = label[start..end].trim_start_matches('0');
    let start = end - digits.len().max(1);
    Some((&label[..start], label[start..end].parse().ok()?, &label[end..]))
}

/// Changes the unions of references of all commands.
pub(super) fn refer(rig: &mut Rig, change: &mut dyn FnMut(&mut NodeRefs)) {
    for joint in rig.joints.values_mut().filter(|joint| !joint.data.tags.is_empty()) {
        for tag in &mut Arc::make_mut(joint).data.tags {
            if let TagKind::Command { params, .. } = &mut tag.kind {
                *params = map_unions(params, &mut *change);
            }
        }
    }
}

/// A union without joints that are gone; what named only them names the one before.
pub(super) fn without(union: &mut NodeRefs, gone: &[Uid], above: Uid) {
    let is_gone = |reference: &NodeRef| matches!(reference.source, Source::Joint(joint) if gone.contains(&joint));
    if union.0.iter().all(is_gone) && !union.0.is_empty() {
        union.0.truncate(1);
        union.0[0].source = Source::Joint(above);
    } else {
        union.0.retain(|reference| !is_gone(reference));
    }
}

/// A union with the joints that were added behind `before`, where it names that among others of the chain.
pub(super) fn with(union: &mut NodeRefs, chain: &[Uid], before: Uid, added: &[Uid]) {
    let joint_of = |reference: &NodeRef| match reference.source {
        Source::Joint(joint) if chain.contains(&joint) => Some(joint),
        _ => None,
    };
    let Some(at) = union.0.iter().position(|reference| joint_of(reference) == Some(before)) else { return };
    let others = [at.checked_sub(1), Some(at + 1)].into_iter().flatten().filter_map(|at| union.0.get(at));
    if others.filter_map(joint_of).next().is_none() {
        return;
    }
    let copies = added.iter().map(|joint| NodeRef { source: Source::Joint(*joint), ..union.0[at].clone() });
    let copies: Vec<NodeRef> = copies.collect();
    union.0.splice(at + 1..at + 1, copies);
}
