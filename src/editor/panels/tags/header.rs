//! Head of the Tags panel: the selected joints, and what is added to them, copied from them and pasted onto them.

use std::sync::Arc;

use bevy::prelude::World;
use bevy_egui::egui::{Button, Label, Response, RichText, TextWrapMode, Ui};

use super::{TagsPanel, library, send};
use crate::{
    editor::{counts::counted, panel::Requests, panels::displayed_rig::DisplayedRig},
    processor::Modules,
    rig::{
        TagKind,
        operations::{PasteContent, PasteTo, TagClipboard, TagOperation, TagScope},
    },
};

/// Choices of what is pasted: name and part of the copied tags.
const PASTED: [(&str, PasteContent); 3] =
    [("Tags", PasteContent::Tags), ("Values", PasteContent::Values), ("Tags and values", PasteContent::Both)];

impl TagsPanel {
    /// Draws the head.
    pub(super) fn header(
        &mut self,
        ui: &mut Ui,
        world: &World,
        modules: &Modules,
        shown: &DisplayedRig,
        requests: &mut Requests,
    ) {
        ui.horizontal_wrapped(|ui| {
            // Buttons go on in the next row, not letter by letter.
            ui.style_mut().wrap_mode = Some(TextWrapMode::Extend);
            let joints = &self.stack.joints;
            let name = match joints[..] {
                [joint] => shown.name(joint).into_owned(),
                _ => counted(joints.len(), "joint", "joints"),
            };
            ui.add(Label::new(RichText::new(name).strong()).truncate());
            self.add(ui, modules, shown, requests);
            self.parts.show(ui, world, shown, requests);
            ui.menu_button("Copy", |ui| self.copy(ui, shown, requests));
            // Not in `add_enabled_ui`: what is within another `Ui` does not go on in the next row.
            let Some(clipboard) = self.clipboard.clone() else {
                ui.add_enabled(false, Button::new("Paste")).on_disabled_hover_text("Copy or cut tags first");
                return;
            };
            ui.menu_button("Paste", |ui| self.paste(ui, modules, shown, &clipboard, requests));
        });
    }

    /// Draws the menu from which modules and features are added.
    fn add(&mut self, ui: &mut Ui, modules: &Modules, shown: &DisplayedRig, requests: &mut Requests) {
        let (words, to) = (&mut self.words, &self.stack.joints);
        ui.menu_button("+ Add", |ui| {
            if let Some(module) = library::library(ui, modules, words) {
                let kind = TagKind::Command { module: module.to_owned(), feature: None, params: "()".to_owned() };
                send(TagOperation::Add { joints: to.clone(), kind, index: None }, shown, requests);
            }
            ui.separator();
            if ui.button("Feature").on_hover_text("A switch that other tags can be put into").clicked() {
                let kind = TagKind::Feature {
                    kind: "feature".to_owned(),
                    name: "feature".to_owned(),
                    switch: String::new(),
                    choice: String::new(),
                };
                send(TagOperation::Add { joints: to.clone(), kind, index: Some(0) }, shown, requests);
                ui.close();
            }
        });
    }

    /// Draws the entries that copy all tags of some joints, and the one that cuts them.
    fn copy(&mut self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        let joints = self.stack.joints.clone();
        let group = joints.last().and_then(|joint| shown.rig.joint(*joint)?.data.group);
        let name = group.and_then(|group| shown.rig.group(group)).map_or("", |group| group.name.as_str());
        let scopes = [
            ("All tags".to_owned(), Some(TagScope::Joints(joints.clone()))),
            ("All tags of the hierarchy".to_owned(), Some(TagScope::Hierarchy(joints.clone()))),
            (format!("All tags of the group {name}"), group.map(TagScope::Group)),
            ("All tags of the rig".to_owned(), Some(TagScope::Rig)),
        ];
        for (name, scope) in scopes {
            let Some(scope) = scope else { continue };
            if entry(ui, &name).clicked() {
                // A joint without tags keeps its place, so that pasting onto as many joints meets each one's counterpart.
                let copied = TagClipboard::copy(&shown.rig, &scope, false, |_| true);
                self.copied(copied, requests);
            }
        }
        ui.separator();
        if entry(ui, "Cut all tags").clicked() {
            let copied = TagClipboard::copy(&shown.rig, &TagScope::Joints(joints), false, |_| true);
            self.copied(copied.clone(), requests);
            if let Ok(copied) = copied {
                send(TagOperation::Cut(Arc::new(copied)), shown, requests);
            }
        }
    }

    /// Draws the entries that paste onto the joints, onto their hierarchies, and onto the other side of what was copied.
    fn paste(
        &self,
        ui: &mut Ui,
        modules: &Modules,
        shown: &DisplayedRig,
        clipboard: &Arc<TagClipboard>,
        requests: &mut Requests,
    ) {
        let joints = &self.stack.joints;
        let mut paste = |clipboard: Arc<TagClipboard>, what: PasteContent, to: PasteTo| {
            send(TagOperation::Paste { clipboard, what, to }, shown, requests);
        };
        for (name, what) in PASTED {
            if entry(ui, name).clicked() {
                paste(Arc::clone(clipboard), what, PasteTo::Joints(joints.clone()));
            }
        }
        ui.separator();
        for (name, what) in PASTED {
            if entry(ui, &format!("{name} onto the hierarchy")).clicked() {
                let below = TagScope::Hierarchy(joints.clone()).joints(&shown.rig).unwrap_or_default();
                paste(Arc::clone(clipboard), what, PasteTo::Joints(below));
            }
        }
        ui.separator();
        for (name, what) in PASTED {
            let field = entry(ui, &format!("{name} onto the other side"));
            if field.on_hover_text("Mirrored, onto the partners of the joints that were copied").clicked() {
                let mirrored = (**clipboard).clone();
                let mirrored = mirrored.map_params(|module, params| modules.get(module)?.mirrored(params).ok());
                paste(Arc::new(mirrored), what, PasteTo::Mirror);
            }
        }
    }
}

/// Draws an entry of a menu, which closes the menu.
fn entry(ui: &mut Ui, text: &str) -> Response {
    let response = ui.button(text);
    if response.clicked() {
        ui.close();
    }
    response
}
