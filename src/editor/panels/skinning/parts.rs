//! Objects of a mesh: how each is bound, and a choice for each of them.

use std::{
    collections::BTreeMap,
    sync::{Arc, Weak},
};

use bevy::prelude::*;
use bevy_egui::egui::{CollapsingHeader, ComboBox, Ui};

use crate::{
    editor::{
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{labelled, named},
        },
    },
    plugins::{
        skinning::{MeshPart, PartBinding, held_objects},
        surface::RigMesh,
    },
    rig::{SkinData, Uid},
};

/// Bindings that a person chose for parts of meshes, by the mesh's uid; the next computation of weights keeps to them.
#[derive(Resource, Debug, Clone, PartialEq, Default)]
pub struct SkinningParts(pub BTreeMap<(Uid, MeshPart), PartBinding>);

impl SkinningParts {
    /// Choices for the parts of one mesh.
    pub fn of(&self, mesh: Uid) -> Vec<(MeshPart, PartBinding)> {
        let range = self.0.range((mesh, MeshPart::Object(0))..=(mesh, MeshPart::Piece(usize::MAX)));
        range.map(|((_, part), binding)| (*part, *binding)).collect()
    }
}

/// Joint of one mesh that holds each object, and the weights that say so.
pub(super) struct HeldObjects {
    mesh: Uid,
    skin: Weak<SkinData>,
    joints: Vec<Option<Uid>>,
}

/// Draws the objects of a mesh, folded, each with the joint that holds all of it and a choice. A mesh of one object has none.
pub(super) fn show(
    ui: &mut Ui,
    world: &World,
    mesh: &RigMesh,
    shown: &DisplayedRig,
    known: &mut Vec<HeldObjects>,
    requests: &mut Requests,
) {
    let objects = &mesh.rest.objects;
    if objects.len() < 2 {
        return;
    }
    let choices = world.get_resource::<SkinningParts>().cloned().unwrap_or_default();
    let mut next = choices.clone();
    let held = shown.rig.skin(mesh.uid).map(|skin| held_by(known, mesh, skin));
    CollapsingHeader::new(format!("Parts ({})", objects.len())).id_salt(("parts", mesh.uid)).show(ui, |ui| {
        for (number, object) in objects.iter().enumerate() {
            let key = (mesh.uid, MeshPart::Object(number));
            let holder = held.and_then(|held| held.get(number).copied().flatten());
            let automatic = match holder {
                Some(joint) => format!("Automatic: moves with {}", shown.name(joint)),
                None => "Automatic".to_owned(),
            };
            let mut options = vec![(None, automatic), (Some(PartBinding::Bends), "Bends".to_owned())];
            let chosen = next.0.get(&key).copied();
            let chosen_joint = match chosen {
                Some(PartBinding::Rigid(joint)) => Some(joint),
                _ => None,
            };
            let mut joints: Vec<Uid> = [chosen_joint, shown.selection.active(), holder].into_iter().flatten().collect();
            joints.dedup();
            for joint in joints.into_iter().filter(|joint| shown.rig.joint(*joint).is_some()) {
                options.push((Some(PartBinding::Rigid(joint)), format!("Moves with {}", shown.name(joint))));
            }
            let mut choice = chosen;
            let text = options.iter().find(|(option, _)| *option == chosen).map_or("", |(_, text)| text.as_str());
            let name = if object.name.is_empty() { format!("object {}", number + 1) } else { object.name.clone() };
            labelled(ui, &name, |ui| {
                let combo = ComboBox::from_id_salt(("part", key)).selected_text(text).width(ui.available_width());
                let combo = combo.truncate().show_ui(ui, |ui| {
                    for (option, text) in &options {
                        ui.selectable_value(&mut choice, *option, text);
                    }
                });
                named(ui, combo.response.id, &format!("Binding of {name}"));
            });
            if choice != chosen {
                match choice {
                    Some(binding) => next.0.insert(key, binding),
                    None => next.0.remove(&key),
                };
            }
        }
        ui.weak("Choices count when the mesh is skinned again.");
    });
    if next != choices {
        requests.set(next);
    }
}

/// Joints that hold the objects of a mesh, found once for each set of weights.
fn held_by<'a>(known: &'a mut Vec<HeldObjects>, mesh: &RigMesh, skin: &Arc<SkinData>) -> &'a [Option<Uid>] {
    let is_same = |held: &HeldObjects| held.mesh == mesh.uid && std::ptr::eq(held.skin.as_ptr(), Arc::as_ptr(skin));
    if !known.iter().any(is_same) {
        known.retain(|held| held.mesh != mesh.uid && held.skin.strong_count() > 0);
        known.push(HeldObjects { mesh: mesh.uid, skin: Arc::downgrade(skin), joints: held_objects(mesh, skin) });
    }
    known.iter().find(|held| is_same(held)).map_or(&[], |held| &held.joints)
}
