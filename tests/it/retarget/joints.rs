//! Rigs of joints alone.

use rigsmith::rig::{Rig, RigEdit};

/// Takes all commands away.
pub fn strip(rig: &mut Rig) {
    let tags = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| (joint.data.uid, tag.uid)));
    let edits = tags.map(|(joint, tag)| RigEdit::RemoveTag(joint, tag)).collect();
    rig.apply(&RigEdit::Batch(edits)).unwrap();
}
