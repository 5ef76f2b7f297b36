//! Dropping a part onto a chain of joints.

use std::collections::{BTreeMap, HashMap};

use super::{
    super::{Draft, OperationError},
    TagError, add,
    paste::refresh_all,
};
use crate::rig::{
    EditError, GroupData, JointData, NodeRefs, Rig, RigEdit, RigInput, TagKind, Uid,
    part::{DroppedPart, Part, PartError, PartInstance, PartNeeds, left_out, name_of, unpaired_sides},
    reference::{NameKind, NameScope, Names, RigScope, map_references, references_in},
    remap::Remap,
    template_copy::TemplateCopy,
};

/// Joint that is not next below another one as its counterpart in a part is.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the part \"{part}\" has {joint} next below {parent}, but of the joints that are given \"{onto}\" is not next below \
     \"{above}\"; give joints that follow each other as {}",
    .joints.join(", ")
)]
pub struct PartOrder {
    /// Name of the part.
    pub part: String,
    /// Label of a joint of the part.
    pub joint: String,
    /// Label of its parent in the part.
    pub parent: String,
    /// Label of the joint that it was to go onto.
    pub onto: String,
    /// Label of the joint that its parent was to go onto.
    pub above: String,
    /// Labels of the joints of the part, as many as were given.
    pub joints: Vec<String>,
}

/// Drops a part with as many joints in its chain as there are, see [`drop_part`], onto joints that hang on each other as the
/// part's do, and notes which joints were too few or too many.
pub(super) fn drop_sized(
    draft: &mut Draft,
    part: &Part,
    joints: &[Uid],
    bindings: &BTreeMap<Uid, Uid>,
) -> Result<(), OperationError> {
    if joints.is_empty() {
        return Err(TagError::NoTarget.into());
    }
    let sized = part.sized_for(joints.len()).map_err(|error| match error {
        PartError::Drop(error) => error,
        error => TagError::Part(Box::new(error)).into(),
    })?;
    check_joints(draft.rig(), &sized, joints)?;
    check_needs(draft.rig(), &sized, joints, bindings, sized.len())?;
    check_order(draft.rig(), &sized, joints)?;
    let copy = TemplateCopy::injected(draft.rig(), &sized);
    drop_part(draft, &sized, joints, bindings, &mut |_, uid| copy.uid_of(uid))?;
    note_left_over(draft, &sized, joints);
    Ok(())
}

/// Puts the tags of a part's joints (parents first, siblings as authored) onto `joints` in order, until either list
/// ends. Refused, before anything changes, if what goes onto `joints` refers to joints of the part that are left out.
///
/// Joints without a label get the part's, joints without a local group the part's group, which is created. References
/// of the part are mapped to the counterparts of their nodes; without one, to the entry in `bindings`, or to the object
/// with the same label or name in the rig.
///
/// `uid_of` gives the uids of what comes of the part's tags and groups.
pub(in crate::rig) fn drop_part(
    draft: &mut Draft,
    part: &Rig,
    joints: &[Uid],
    bindings: &BTreeMap<Uid, Uid>,
    uid_of: &mut dyn FnMut(&mut Draft, Uid) -> Uid,
) -> Result<(), OperationError> {
    check_joints(draft.rig(), part, joints)?;
    check_needs(draft.rig(), part, joints, bindings, joints.len())?;
    let pairs: Vec<(&JointData, Uid)> = part.walk().map(|joint| &joint.data).zip(joints.iter().copied()).collect();
    let mut remap = Remap::default();
    for (joint, target) in &pairs {
        remap.uids.insert(joint.uid, *target);
        for tag in &joint.tags {
            let uid = uid_of(draft, tag.uid);
            remap.uids.insert(tag.uid, uid);
        }
        let unlabelled = draft.rig().joint(*target).is_some_and(|target| target.data.label.is_none());
        if unlabelled && joint.label.is_some() {
            draft.apply(RigEdit::SetLabel(*target, joint.label.clone()))?;
        }
    }
    groups(draft, part, &pairs, &mut remap, uid_of)?;
    bind(draft, part, &pairs, bindings, &mut remap)?;
    let mut dropped = Vec::new();
    for (joint, target) in &pairs {
        for tag in &joint.tags {
            let mut copy = remap.tag(draft.rig(), tag);
            if let TagKind::Command { params, .. } = &mut copy.kind {
                // The part's own rig is the rig that it is dropped into.
                *params = map_references(params, |reference| {
                    if reference.rig == RigScope::Rig(part.uid()) {
                        reference.rig = RigScope::Own;
                    }
                });
            }
            dropped.push(copy.uid);
            add(draft, *target, copy, usize::MAX)?;
        }
    }
    refresh_all(draft, &dropped)
}

/// Drops a part, as it is fitted, onto joints, and notes it as an instance for the rig's file. Joints without a label get one
/// that is theirs alone.
pub(super) fn drop_instance(
    draft: &mut Draft,
    file: &str,
    fitted: &Rig,
    chosen: &[Uid],
    mirror: bool,
) -> Result<(), OperationError> {
    let joints = &chosen[..chosen.len().min(fitted.len())];
    check_joints(draft.rig(), fitted, joints)?;
    check_needs(draft.rig(), fitted, joints, &BTreeMap::new(), fitted.len())?;
    check_order(draft.rig(), fitted, joints)?;
    for (joint, of_part) in joints.iter().zip(fitted.walk()) {
        let known = draft.rig().joint(*joint).ok_or(EditError::NoJoint(*joint))?;
        if known.data.label.is_none() {
            let label = free_label(draft.rig(), of_part.data.label.as_deref().unwrap_or("joint"));
            draft.apply(RigEdit::SetLabel(*joint, Some(label)))?;
        }
    }
    let label = |joint: &Uid| draft.rig().joint(*joint).and_then(|joint| joint.data.label.clone()).unwrap_or_default();
    let onto: Vec<String> = joints.iter().map(label).collect();
    let of = |uid: Uid| PartInstance { uid, onto: onto.clone(), ..PartInstance::default() };
    let is_free = |instance: &PartInstance| {
        let is_taken = |uid: &Uid| draft.rig().is_taken(*uid);
        !instance.brought(fitted).iter().any(is_taken)
            && draft.rig().dropped_parts().iter().all(|other| other.uid != instance.uid)
    };
    let derived = of(PartInstance::uid_from_joints(file, &onto));
    let instance = if is_free(&derived) { derived } else { of(draft.next_uid()) };
    drop_part(draft, fitted, joints, &BTreeMap::new(), &mut |_, uid| instance.uid_of(uid))?;
    // A file with parts has partners where labels differ by their side alone.
    let pairs = unpaired_sides(draft.rig());
    for &(joint, other) in &pairs {
        draft.apply(RigEdit::SetMirror(joint, Some(other)))?;
        draft.apply(RigEdit::SetMirror(other, Some(joint)))?;
    }
    let others = pairs.iter().filter(|(joint, other)| !joints.contains(joint) && !joints.contains(other)).count();
    if others > 0 {
        let are = if others == 1 { "other pair of joints are" } else { "other pairs of joints are" };
        draft.note(format!(
            "{others} {are} partners now, too: in a file with parts joints are whose labels differ by \
             their side alone"
        ));
    }
    let part = DroppedPart { uid: instance.uid, part: file.to_owned(), joints: joints.to_vec(), mirror };
    if part.instance(draft.rig()).is_none() {
        draft.note("other joints have the same labels: a save writes the part out, unless you rename them".to_owned());
    }
    let dropped = draft.rig().dropped_parts().iter().cloned().chain([part]).collect();
    draft.apply(RigEdit::SetDroppedParts(dropped))?;
    note_left_over(draft, fitted, chosen);
    Ok(())
}

/// The label, with a number if a joint has it already.
fn free_label(rig: &Rig, label: &str) -> String {
    let numbered = (2..).map(|number| format!("{label}_{number}"));
    let mut names = std::iter::once(label.to_owned()).chain(numbered);
    names.find(|name| !rig.has_label(name)).unwrap_or_default()
}

/// Notes that a part goes onto joints with commands of their own.
pub(super) fn note_own_commands<'a>(draft: &mut Draft, file: &str, joints: impl Iterator<Item = &'a Uid>) {
    let rig = draft.rig();
    let tags = joints.filter_map(|joint| rig.joint(*joint)).flat_map(|joint| &joint.data.tags);
    let count = tags.filter(|tag| matches!(tag.kind, TagKind::Command { .. })).count();
    let own = match count {
        0 => return,
        1 => "1 command of their own, which stays".to_owned(),
        more => format!("{more} commands of their own, which stay"),
    };
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file).trim_end_matches(".rig.ron");
    draft.note(format!("{name} was added to joints that have {own}; undo takes it back"));
}

/// Notes which joints were too few or too many for a part that was dropped onto them.
fn note_left_over(draft: &mut Draft, part: &Rig, joints: &[Uid]) {
    let left = part.len().saturating_sub(joints.len());
    if left > 0 {
        let are = if left == 1 { "joint of the part is" } else { "joints of the part are" };
        draft.note(format!("{left} {are} left over: the selection has only {}", joints.len()));
    } else if joints.len() > part.len() {
        let left = joints.len() - part.len();
        let are = if left == 1 { "selected joint is" } else { "selected joints are" };
        draft.note(format!("{left} {are} left over: the part has only {}", part.len()));
    }
}

/// Refuses no joints at all, and joints that are not there or are given twice.
fn check_joints(rig: &Rig, part: &Rig, joints: &[Uid]) -> Result<(), OperationError> {
    for (number, joint) in joints.iter().enumerate() {
        rig.joint(*joint).ok_or(EditError::NoJoint(*joint))?;
        if joints[..number].contains(joint) {
            let (part, joint) = (part.about().name.clone(), joint_name(rig, *joint));
            return Err(TagError::JointTwice { part, joint }.into());
        }
    }
    if joints.is_empty() {
        return Err(TagError::NoTarget.into());
    }
    Ok(())
}

/// Name of a joint of the rig for messages.
fn joint_name(rig: &Rig, joint: Uid) -> String {
    rig.joint(joint).map_or_else(|| joint.to_string(), name_of)
}

/// Refuses joints of which one is not the next below the counterpart of its parent in the part.
fn check_order(rig: &Rig, part: &Rig, joints: &[Uid]) -> Result<(), OperationError> {
    let pairs: HashMap<Uid, Uid> = part.walk().map(|joint| joint.data.uid).zip(joints.iter().copied()).collect();
    let given = &joints[..joints.len().min(part.len())];
    for (joint, onto) in part.walk().zip(given) {
        let Some((parent, above)) = joint.parent.and_then(|parent| Some((parent, *pairs.get(&parent)?))) else {
            continue;
        };
        let next = rig.ancestors(*onto).map(|joint| joint.data.uid).find(|uid| given.contains(uid));
        if next != Some(above) {
            let order = PartOrder {
                part: part.about().name.clone(),
                joint: name_of(joint),
                parent: joint_name(part, parent),
                onto: joint_name(rig, *onto),
                above: joint_name(rig, above),
                joints: part.walk().take(given.len()).map(name_of).collect(),
            };
            return Err(TagError::PartOrder(Box::new(order)).into());
        }
    }
    Ok(())
}

/// Refuses fewer joints than the first `asking` joints of the part need. What the host has under the same label, or
/// `bindings` name, counts.
fn check_needs(
    rig: &Rig,
    part: &Rig,
    joints: &[Uid],
    bindings: &BTreeMap<Uid, Uid>,
    asking: usize,
) -> Result<(), OperationError> {
    let left = left_out(part, joints.len(), asking);
    if left.is_empty() {
        return Ok(());
    }
    let labelled = rig.joints_by_label();
    let is_found = |(kind, uid): &(NameKind, Uid)| {
        let by_label = || part.name_of(NameKind::Joint, *uid).is_some_and(|label| labelled.contains_key(&*label));
        bindings.contains_key(uid) || *kind == NameKind::Joint && by_label()
    };
    if left.iter().all(is_found) {
        return Ok(());
    }
    let (part, needs) = (part.about().name.clone(), PartNeeds::of(part));
    Err(TagError::PartNeeds { part, joints: needs.joints, given: joints.len() }.into())
}

/// Maps each group of the part to the group of its first grouped counterpart, if half of them have one; else to a group
/// of the same name that nothing else is in, or to one that is created.
fn groups(
    draft: &mut Draft,
    part: &Rig,
    pairs: &[(&JointData, Uid)],
    remap: &mut Remap,
    uid_of: &mut dyn FnMut(&mut Draft, Uid) -> Uid,
) -> Result<(), OperationError> {
    for group in part.groups() {
        let members: Vec<Uid> =
            pairs.iter().filter(|(joint, _)| joint.group == Some(group.uid)).map(|(_, target)| *target).collect();
        let group_of = |draft: &Draft, joint: Uid| draft.rig().joint(joint).and_then(|joint| joint.data.group);
        let Some(first) = members.iter().map(|joint| group_of(draft, *joint)).reduce(Option::or) else { continue };
        let grouped = members.iter().filter(|joint| group_of(draft, **joint).is_some()).count();
        let is_own = |uid: Uid| {
            let mut of_group = draft.rig().walk().filter(|joint| joint.data.group == Some(uid));
            of_group.all(|joint| members.contains(&joint.data.uid))
        };
        let waiting = draft.rig().groups().iter().find(|of| of.name == group.name && is_own(of.uid));
        let target = match (first.filter(|_| 2 * grouped >= members.len()), waiting.map(|group| group.uid)) {
            (Some(known), _) | (None, Some(known)) => known,
            (None, None) => {
                let uid = uid_of(draft, group.uid);
                let group = GroupData { uid, name: free_name(draft.rig(), &group.name), ..group.clone() };
                let uid = group.uid;
                draft.apply(RigEdit::AddLocalGroup(group, usize::MAX))?;
                uid
            }
        };
        remap.uids.insert(group.uid, target);
        for joint in members {
            if group_of(draft, joint).is_none() {
                draft.apply(RigEdit::SetGroup(joint, Some(target)))?;
            }
        }
    }
    Ok(())
}

/// The name, with a number if a group has it already: two arms are two groups.
fn free_name(rig: &Rig, name: &str) -> String {
    let is_free = |name: &String| rig.groups().iter().all(|group| group.name != *name);
    let numbered = (2..).map(|number| format!("{name}_{number}"));
    std::iter::once(name.to_owned()).chain(numbered).find(is_free).unwrap_or_default()
}

/// The input of that name, which the part brings where the rig has none.
fn declare(draft: &mut Draft, part: &Rig, uid: Uid, name: &str) -> Result<Uid, OperationError> {
    let mut inputs = draft.rig().inputs().to_vec();
    if let Some(own) = inputs.iter().find(|own| own.name == name) {
        return Ok(own.uid);
    }
    let Some(input) = part.input(uid) else { return Ok(uid) };
    // The other side has another input, under the same uid in the part.
    let uid = if draft.rig().is_taken(uid) { Uid::derived(["input", name]) } else { uid };
    inputs.push(RigInput { uid, ..input.clone() });
    draft.apply(RigEdit::SetInputs(inputs))?;
    Ok(uid)
}

/// Binds references of the part to nodes that were not put onto a joint.
fn bind(
    draft: &mut Draft,
    part: &Rig,
    pairs: &[(&JointData, Uid)],
    bindings: &BTreeMap<Uid, Uid>,
    remap: &mut Remap,
) -> Result<(), OperationError> {
    let params = pairs.iter().flat_map(|(joint, _)| &joint.tags).filter_map(|tag| match &tag.kind {
        TagKind::Command { params, .. } => Some(params),
        TagKind::Feature { .. } => None,
    });
    let lists: Vec<NodeRefs> =
        params.flat_map(|params| references_in(params)).filter_map(|found| found.references.ok()).collect();
    let named = lists.iter().flatten().filter(|reference| match reference.rig {
        RigScope::Own => true,
        RigScope::Rig(rig) => rig == part.uid(),
    });
    let mut missing: Vec<String> = Vec::new();
    for (kind, uid) in named.flat_map(|reference| reference.uids()) {
        if remap.uids.contains_key(&uid) || kind == NameKind::Rig {
            continue;
        }
        if let Some(bound) = bindings.get(&uid) {
            remap.uids.insert(uid, *bound);
            continue;
        }
        let name = part.name_of(kind, uid).map(|name| name.into_owned()).unwrap_or_default();
        let candidates = match kind {
            NameKind::Command => Vec::new(),
            _ if name.is_empty() => Vec::new(),
            // The bearer of the label decides the meaning of the reference once a bearer is renamed.
            NameKind::Joint | NameKind::Label => draft.rig().find(NameScope::default(), NameKind::Joint, &name),
            NameKind::Input => vec![declare(draft, part, uid, &name)?],
            NameKind::Group | NameKind::Rig => draft.rig().find(NameScope::default(), kind, &name),
        };
        match candidates.as_slice() {
            [] => missing.push(format!("{kind} \"{name}\" ({uid})")),
            [one] => drop(remap.uids.insert(uid, *one)),
            _ => return Err(TagError::Ambiguous { kind, uid, name, candidates }.into()),
        }
    }
    missing.sort_unstable();
    missing.dedup();
    for what in missing {
        draft.note(format!("references of the part name the {what}, which has no counterpart in the rig"));
    }
    Ok(())
}
