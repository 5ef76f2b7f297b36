//! Part of a skeleton: a template that is added to a rig, or some joints of the rig that are fitted without the others.

use std::{collections::BTreeSet, sync::Arc};

use crate::{
    processor::Modules,
    rig::{
        EditError, NodeKind, RestTransform, Rig, RigEdit, Uid, UidSource,
        label::label_side,
        operations::{Operation, OperationError, Outcome},
        part::{Part, PartInstance},
    },
};

/// A template that is put into a rig beside what the rig has.
#[derive(Debug, Clone)]
pub(super) struct AddedPart {
    /// The template as it is given.
    pub(super) rig: Arc<Rig>,
    /// Joint of the rig that its roots hang on.
    pub(super) parent: Option<Uid>,
}

impl AddedPart {
    /// Adds the template to a rig. Equal rigs give equal uids.
    pub(super) fn put_into(&self, rig: &mut Rig) -> Result<Outcome, OperationError> {
        let names = [rig.uid().to_string(), self.rig.uid().to_string()];
        let mut uids = UidSource::seeded(Uid::derived(["fitted part", &names[0], &names[1]]).0);
        Operation::Merge { other: self.rig.clone(), parent: self.parent }.run(rig, &mut uids, None)
    }

    /// The template as it is in a rig that has it, without the rig's own joints.
    pub(super) fn in_rig(&self, rig: &Rig) -> Result<Rig, OperationError> {
        let own: BTreeSet<Uid> = rig.walk().map(|joint| joint.data.uid).collect();
        let mut whole = rig.clone();
        self.put_into(&mut whole)?;
        let added = whole.walk().map(|joint| joint.data.uid).filter(|uid| !own.contains(uid)).collect();
        Ok(only(&whole, &added)?)
    }
}

/// The rig without all joints but some, which keep their places; each hangs on the nearest of them above it.
pub(super) fn only(rig: &Rig, kept: &BTreeSet<Uid>) -> Result<Rig, EditError> {
    let mut part = rig.clone();
    for joint in rig.walk().filter(|joint| kept.contains(&joint.data.uid)) {
        let uid = joint.data.uid;
        if joint.parent.is_some_and(|parent| !kept.contains(&parent)) {
            let above = rig.ancestors(uid).map(|above| above.data.uid).find(|above| kept.contains(above));
            let global = rig.rest_global(uid);
            part.apply(&RigEdit::SetParent { joint: uid, parent: above, index: usize::MAX })?;
            let rest = above
                .map_or_else(|| RestTransform::from_affine(&global), |above| part.local_rest(Some(above), &global));
            part.apply(&RigEdit::SetRest(uid, rest))?;
        }
    }
    let leaving: Vec<Uid> = part.walk().map(|joint| joint.data.uid).filter(|uid| !kept.contains(uid)).collect();
    // Children stand behind their parents.
    leaving.iter().rev().try_for_each(|uid| part.apply(&RigEdit::RemoveJoint(*uid)).map(drop))?;
    Ok(part)
}

/// Joints of a rig with all that hangs below them, without nulls.
pub(super) fn with_hierarchies(rig: &Rig, joints: &[Uid]) -> BTreeSet<Uid> {
    let below = joints.iter().flat_map(|joint| rig.hierarchy(*joint));
    below.filter(|joint| joint.data.kind == NodeKind::Joint).map(|joint| joint.data.uid).collect()
}

/// Side that the labels of a rig name first: 1 left, -1 right; `None` without one.
pub(super) fn named_side(rig: &Rig) -> Option<i32> {
    let side = |label: Option<&str>| label.map_or(0, label_side);
    rig.walk().map(|joint| side(joint.data.label.as_deref())).find(|side| *side != 0)
}

/// Rigs of a part that may go below a joint: that of the joint's side, or of both sides where the joint is of neither.
pub(super) fn sides(part: &Part, rig: &Rig, parent: Option<Uid>, modules: &Modules) -> Vec<Arc<Rig>> {
    let own = named_side(&part.rig);
    let label = parent.and_then(|parent| rig.joint(parent)).and_then(|joint| joint.data.label.as_deref());
    let wanted = label.map_or(0, label_side);
    let as_written = Arc::new(part.rig.clone());
    let Some(own) = own else { return vec![as_written] };
    if wanted == own {
        return vec![as_written];
    }
    let mirror = |module: &str, params: &str| modules.get(module)?.mirrored(params).ok();
    let instance = PartInstance { mirror: true, ..PartInstance::default() };
    let mirrored = instance.fitted(part, &mirror).ok().map(Arc::new);
    let kept = (wanted == 0 || mirrored.is_none()).then_some(as_written);
    kept.into_iter().chain(mirrored).collect()
}

/// Edits that give the tags of a rig the parameters that they have in another.
pub(super) fn changed_tags(rig: &Rig, target: &Rig) -> Vec<RigEdit> {
    let of_target = target.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag)));
    let is_other = |tag: &crate::rig::TagData| rig.find_tag(tag.uid).is_some_and(|(_, known)| known != tag);
    let changed = of_target.filter(|(_, tag)| is_other(tag));
    changed.map(|(joint, tag)| RigEdit::SetTag(joint, Box::new(tag.clone()))).collect()
}
