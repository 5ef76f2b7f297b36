//! Menu of the parts that come with Rigsmith, and the joints that a part goes onto.

use std::sync::Arc;

use bevy_egui::egui::Ui;

use crate::{
    files::bundled_parts,
    rig::{Rig, Uid},
};

/// The parts, read when they are first listed.
#[derive(Default)]
pub(super) struct PartList(Option<Vec<(&'static str, Arc<Rig>)>>);

impl PartList {
    /// Draws a menu of the parts; returns the one that was chosen.
    pub fn menu(&mut self, ui: &mut Ui) -> Option<Arc<Rig>> {
        let mut chosen = None;
        for (name, part) in self.0.get_or_insert_with(bundled_parts) {
            let name = name.rsplit('/').next().unwrap_or(name).replace('_', " ");
            let joints: Vec<&str> = part.walk().filter_map(|joint| joint.data.label.as_deref()).take(6).collect();
            let tip = format!("{}\n{} joints: {}", part.about().description, part.len(), joints.join(", "));
            if ui.button(name).on_hover_text(tip.trim()).clicked() {
                chosen = Some(Arc::clone(part));
                ui.close();
            }
        }
        chosen
    }
}

/// Joints that a part of `count` joints goes onto: the selected joints in the order of the rig; for a single selected joint,
/// the chain of first children below it.
pub(super) fn chain(rig: &Rig, selected: &[Uid], count: usize) -> Vec<Uid> {
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
