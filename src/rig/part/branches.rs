//! Branches of a part, such as fingers, of which a use may have fewer or more.

use std::collections::{BTreeSet, HashSet};

use super::{
    PartChain,
    instance::ATTRIBUTE,
    resize::{refer, with, without},
};
use crate::rig::{EditError, JointData, Rig, RigEdit, TagKind, Uid, reference::map_text_fields, remap::Remap};

impl PartChain {
    /// The part with the first `count` branches; beyond its own ones they are copies of the last, each as far from the one before
    /// as the last two are from each other.
    pub(super) fn branched(&self, part: &Rig, count: usize) -> Result<Rig, EditError> {
        let mut out = part.clone();
        let gone: Vec<Uid> = self.joints.iter().skip(count).flat_map(|root| branch(part, *root)).collect();
        remove(&mut out, &gone)?;
        if let [.., before, last] = self.joints[..] {
            let copies = 1..(count + 1).saturating_sub(self.joints.len());
            let added = copies.map(|number| copy(&mut out, [before, last], number)).collect::<Result<Vec<_>, _>>()?;
            refer(&mut out, &mut |union| with(union, &self.joints, last, &added));
        }
        Ok(out)
    }
}

/// A joint and the joints below it, parents first.
fn branch(rig: &Rig, root: Uid) -> Vec<Uid> {
    let (mut found, mut seen) = (vec![root], HashSet::from([root]));
    for joint in rig.walk() {
        if joint.parent.is_some_and(|parent| seen.contains(&parent)) {
            seen.insert(joint.data.uid);
            found.push(joint.data.uid);
        }
    }
    found
}

/// Removes branches, with the features that their commands alone had.
fn remove(rig: &mut Rig, gone: &[Uid]) -> Result<(), EditError> {
    let Some(first) = gone.first() else { return Ok(()) };
    if let Some(above) = rig.joint(*first).and_then(|joint| joint.parent) {
        refer(rig, &mut |union| without(union, gone, above));
    }
    let before = features_in_use(rig);
    for joint in gone.iter().rev() {
        rig.apply(&RigEdit::RemoveJoint(*joint))?;
    }
    for feature in before.difference(&features_in_use(rig)) {
        let on = rig.find_tag(*feature).map(|(joint, _)| joint.data.uid);
        if let Some(joint) = on {
            rig.apply(&RigEdit::RemoveTag(joint, *feature))?;
        }
    }
    Ok(())
}

/// Features that commands belong to.
fn features_in_use(rig: &Rig) -> BTreeSet<Uid> {
    let of = |kind: &TagKind| match kind {
        TagKind::Command { feature, .. } => *feature,
        TagKind::Feature { .. } => None,
    };
    rig.walk().flat_map(|joint| &joint.data.tags).filter_map(|tag| of(&tag.kind)).collect()
}

/// Adds a copy of the last branch, the first with the number 1; returns its root.
fn copy(rig: &mut Rig, [before, last]: [Uid; 2], number: usize) -> Result<Uid, EditError> {
    let (branch, nth) = (branch(rig, last), number.to_string());
    let mut remap = Remap::default();
    for joint in branch.iter().filter_map(|joint| rig.joint(*joint)) {
        let tags = joint.data.tags.iter().map(|tag| tag.uid);
        for uid in std::iter::once(joint.data.uid).chain(tags) {
            remap.uids.insert(uid, Uid::derived(["branch of a part", nth.as_str(), uid.to_string().as_str()]));
        }
    }
    let place = |joint: Uid| rig.joint(joint).map(|joint| joint.data.rest.translation).unwrap_or_default();
    let way = (place(last) - place(before)) * number as f32;
    let label = rig.joint(last).and_then(|joint| joint.data.label.clone()).unwrap_or_default();
    let stem: String = label.chars().take_while(|c| c.is_alphabetic()).collect();
    let named = |name: &str| match name.strip_prefix(stem.as_str()).filter(|_| !stem.is_empty()) {
        Some(rest) => format!("{stem}{}{rest}", number + 1),
        None => format!("{name}_{}", number + 1),
    };
    let mut copies: Vec<(JointData, Option<Uid>)> = Vec::with_capacity(branch.len());
    for joint in branch.iter().filter_map(|joint| rig.joint(*joint)) {
        let mut data = JointData { mirror: None, ..remap.joint(&joint.data) };
        data.label = data.label.as_deref().map(named);
        if joint.data.uid == last {
            data.rest.translation += way;
        }
        for tag in &mut data.tags {
            // Attributes are told apart by the nodes that bear them.
            if let TagKind::Command { module, params, .. } = &mut tag.kind
                && *module != *ATTRIBUTE
            {
                let name = |name: &str| (!name.is_empty()).then(|| named(name));
                *params = map_text_fields(params, &["name", "label"], name);
            }
        }
        copies.push((data, joint.parent.map(|parent| remap.get(parent).unwrap_or(parent))));
    }
    for (data, parent) in copies {
        rig.apply(&RigEdit::AddJoint { joint: Box::new(data), parent, index: usize::MAX })?;
    }
    Ok(remap.get(last).unwrap_or(last))
}
