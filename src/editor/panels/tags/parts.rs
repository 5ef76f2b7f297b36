//! Menu of the parts that come with Rigsmith, and the joints that a part goes onto.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use bevy_egui::egui::Ui;

use crate::{
    files::{PartFileError, PartFiles, bundled_parts},
    processor::Modules,
    rig::{Rig, Uid, label::label_side, operations::TagOperation, part::PartInstance},
};

/// The parts, read when they are first listed.
#[derive(Default)]
pub(super) struct PartList(Option<Vec<(&'static str, Arc<Rig>)>>);

impl PartList {
    /// Draws a menu of the parts; returns the one that was chosen, with its file.
    pub fn menu(&mut self, ui: &mut Ui) -> Option<(&'static str, Arc<Rig>)> {
        let mut chosen = None;
        for (file, part) in self.0.get_or_insert_with(bundled_parts) {
            let name = file.rsplit('/').next().unwrap_or(file).trim_end_matches(".rig.ron").replace('_', " ");
            let joints: Vec<&str> = part.walk().filter_map(|joint| joint.data.label.as_deref()).take(6).collect();
            let tip = format!("{}\n{} joints: {}", part.about().description, part.len(), joints.join(", "));
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
    (file, part): (&str, &Rig),
    modules: &Modules,
) -> Result<TagOperation, PartFileError> {
    let joints = chain(rig, selected, part.len());
    let label = |joint: &Uid| rig.joint(*joint).and_then(|joint| joint.data.label.as_deref());
    let of_part = side(part.walk().map(|joint| joint.data.label.as_deref()));
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

/// Joints that a part of `count` joints goes onto: the selected joints in the order of the rig; for a single selected joint,
/// the chain of first children below it.
fn chain(rig: &Rig, selected: &[Uid], count: usize) -> Vec<Uid> {
    match *selected {
        [top] => {
            let mut joints = vec![top];
            while let Some(child) = joints.last().and_then(|joint| rig.children(Some(*joint)).first()) {
                if joints.len() >= count {
                    break;
                }
                joints.push(*child);
            }
            joints
        }
        _ => rig.walk().map(|joint| joint.data.uid).filter(|joint| selected.contains(joint)).collect(),
    }
}
