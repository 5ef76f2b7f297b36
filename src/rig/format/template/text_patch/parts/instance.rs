//! Part instances that come into a template's text and go out of it.

use super::super::patch::Patch;
use crate::rig::{
    Rig,
    format::template::{
        FORMAT, quoted,
        shorthand::Declarations,
        write::{feature_list, feature_summaries, needs_text},
    },
    part::PartInstance,
};

/// The text of a rig's template with part instances besides. The header has the features of `whole`, which is the rig with
/// what they bring. `None` for a text that is no template.
pub(crate) fn with_instances(text: &str, own: &Rig, whole: &Rig, instances: &[PartInstance]) -> Option<String> {
    let declared = Declarations::find(text)?;
    let (tree, root) = (&declared.tree, declared.tree.root());
    let mut patch = Patch::new(tree);
    if declared.format() < FORMAT {
        patch.set(root, "format", &FORMAT.to_string());
    }
    if tree.field(root, "features").is_some() && feature_summaries(whole) != feature_summaries(own) {
        patch.set(root, "features", &feature_list(whole));
    }
    if tree.field(root, "needs").is_some()
        && let Some(needs) = needs_text(whole)
        && needs_text(own).as_ref() != Some(&needs)
    {
        patch.set(root, "needs", &needs);
    }
    let texts: Vec<String> = instances.iter().map(instance_text).collect();
    patch.append(root, "parts", &texts);
    Some(patch.text())
}

/// The text of a template without some of its part instances, by their numbers. The header has the features of `whole`, the
/// rig without what they brought. `None` for a text that is no template.
pub(crate) fn without_instances(text: &str, whole: &Rig, gone: &[usize]) -> Option<String> {
    let declared = Declarations::find(text)?;
    let (tree, root) = (&declared.tree, declared.tree.root());
    let mut patch = Patch::new(tree);
    if tree.field(root, "features").is_some() {
        patch.set(root, "features", &feature_list(whole));
    }
    if tree.field(root, "needs").is_some() {
        patch.set_or_remove(root, "needs", needs_text(whole).as_deref());
    }
    patch.exchange(root, "parts", gone, &[]);
    Some(patch.text())
}

/// An instance that goes onto joints, on one line. Its uid is written where it does not follow from the rest.
fn instance_text(instance: &PartInstance) -> String {
    let PartInstance { uid, part, onto, mirror, .. } = instance;
    let mut fields = Vec::new();
    if *uid != PartInstance::uid_from_joints(part, onto) {
        fields.push(format!("uid: \"{uid}\""));
    }
    fields.push(format!("part: {}", quoted(part)));
    let labels: Vec<String> = onto.iter().map(|label| quoted(label)).collect();
    fields.push(format!("onto: [{}]", labels.join(", ")));
    fields.extend(mirror.then(|| "mirror: true".to_owned()));
    format!("({})", fields.join(", "))
}
