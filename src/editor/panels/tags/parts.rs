//! Menu of the parts that come with Rigsmith, and the joints that a part goes onto.

use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
    sync::Arc,
};

use bevy_egui::egui::Ui;

use crate::{
    files::{PartFileError, PartFiles, bundled_parts},
    processor::Modules,
    rig::{
        Rig, Uid,
        label::label_side,
        operations::TagOperation,
        part::{Part, PartInstance},
    },
};

/// The parts, read when they are first listed.
#[derive(Default)]
pub(super) struct PartList(Option<Vec<(&'static str, Arc<Part>)>>);

impl PartList {
    /// Draws a menu of the parts; returns the one that was chosen, with its file.
    pub fn menu(&mut self, ui: &mut Ui) -> Option<(&'static str, Arc<Part>)> {
        let mut chosen = None;
        for (file, part) in self.0.get_or_insert_with(bundled_parts) {
            let name = file.rsplit('/').next().unwrap_or(file).trim_end_matches(".rig.ron").replace('_', " ");
            let joints: Vec<&str> = part.rig.walk().filter_map(|joint| joint.data.label.as_deref()).take(6).collect();
            let tip = format!("{}\n{} joints: {}", part.rig.about().description, part.rig.len(), joints.join(", "));
            if ui.button(name).on_hover_text(tip.trim()).clicked() {
                chosen = Some((*file, Arc::clone(part)));
                ui.close();
            }
        }
        chosen
    }
}

/// The operation that adds a part to a rig, on the selected joints: mirrored where these are on the other side than its own.
///
/// # Errors
/// A part that does not take so many joints.
pub(super) fn added(
    rig: &Rig,
    selected: &[Uid],
    (file, part): (&str, &Part),
    modules: &Modules,
) -> Result<TagOperation, PartFileError> {
    let joints = joints_for(rig, selected, &part.rig);
    part.sized_for(joints.len())?;
    let label = |joint: &Uid| rig.joint(*joint).and_then(|joint| joint.data.label.as_deref());
    let of_part = side(part.rig.walk().map(|joint| joint.data.label.as_deref()));
    let mirror = of_part != 0 && side(joints.iter().map(label)) == -of_part;
    let instance = PartInstance {
        part: file.to_owned(),
        onto: vec![String::new(); joints.len()],
        mirror,
        ..PartInstance::default()
    };
    let none = BTreeMap::new();
    let fitted = PartFiles::known(&none, modules.clone()).fitted_part(Path::new(""), &instance)?;
    Ok(TagOperation::AddPart { part: file.to_owned(), fitted: Arc::new(fitted), joints, mirror })
}

/// Side of the first label that names one: see [`label_side`].
fn side<'l>(labels: impl Iterator<Item = Option<&'l str>>) -> i32 {
    labels.flatten().map(label_side).find(|side| *side != 0).unwrap_or_default()
}

/// Joints that a part goes onto: the selected joints in the order of the rig; for a single selected joint, that and those below
/// it which are children of each other as the part's are, until there is none.
fn joints_for(rig: &Rig, selected: &[Uid], part: &Rig) -> Vec<Uid> {
    let [top] = *selected else {
        return rig.walk().map(|joint| joint.data.uid).filter(|joint| selected.contains(joint)).collect();
    };
    let mut pairs: HashMap<Uid, Uid> = HashMap::new();
    let mut joints = Vec::new();
    for joint in part.walk() {
        let below = |parent: Uid| {
            let number = part.children(Some(parent)).iter().position(|child| *child == joint.data.uid)?;
            rig.children(Some(*pairs.get(&parent)?)).get(number).copied()
        };
        let found = match joint.parent {
            Some(parent) => below(parent),
            None => Some(top).filter(|_| joints.is_empty()),
        };
        let Some(found) = found else { break };
        pairs.insert(joint.data.uid, found);
        joints.push(found);
    }
    joints
}
