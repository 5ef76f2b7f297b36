//! Menu of the parts that come with Rigsmith, and the joints that a part goes onto.

use std::{collections::HashMap, sync::Arc};

use bevy_egui::egui::Ui;

use crate::{
    files::bundled_parts,
    rig::{Rig, Uid, part::Part},
};

/// The parts, read when they are first listed.
#[derive(Default)]
pub(super) struct PartList(Option<Vec<(&'static str, Arc<Part>)>>);

impl PartList {
    /// Draws a menu of the parts; returns the one that was chosen.
    pub fn menu(&mut self, ui: &mut Ui) -> Option<Arc<Part>> {
        let mut chosen = None;
        for (name, part) in self.0.get_or_insert_with(bundled_parts) {
            let name = name.rsplit('/').next().unwrap_or(name).replace('_', " ");
            let joints: Vec<&str> = part.rig.walk().filter_map(|joint| joint.data.label.as_deref()).take(6).collect();
            let tip = format!("{}\n{} joints: {}", part.rig.about().description, part.rig.len(), joints.join(", "));
            if ui.button(name).on_hover_text(tip.trim()).clicked() {
                chosen = Some(Arc::clone(part));
                ui.close();
            }
        }
        chosen
    }
}

/// Joints that a part goes onto: the selected joints in the order of the rig; for a single selected joint, that and those below
/// it which are children of each other as the part's are, until there is none.
pub(super) fn joints_for(rig: &Rig, selected: &[Uid], part: &Rig) -> Vec<Uid> {
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
