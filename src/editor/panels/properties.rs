//! Properties panel of the selected joints: label, group, rest pose, lock of weights, tags. Several joints share their common
//! fields.
//!
//! A typed or dragged value is one step of the history. The rig shows a number while it is dragged.

pub(super) mod tags;
mod values;

use bevy::prelude::*;
use bevy_egui::egui::{self, Checkbox, ComboBox, Key, ScrollArea, TextEdit, Ui, WidgetInfo, WidgetType};

use super::{
    displayed_rig::{DisplayedRig, color},
    fields::{CommonValue, Look, MIXED, NumberEdit, Numbers, labelled, named, short},
    groups, list,
};
use crate::{
    editor::{
        counts::counted,
        mode::Mode,
        panel::{EditorPanel, Requests},
        settings::EditorSettings,
    },
    plugins::{
        document::{Change, EditRequest},
        picking::{Pick, PickRequest},
        surface::RigSurface,
    },
    rig::{NodeKind, Uid, operations::Operation, proportion::Quantity},
};
use values::{Part, Values};

/// The panel.
#[derive(Default)]
pub struct PropertiesPanel {
    values: Values,
    numbers: Numbers,
    label: Option<LabelDraft>,
    group: String,
    /// Colour of a group while it is being chosen.
    color: Option<(String, [u8; 3])>,
}

/// A label being typed, with its joints: the selection may change before it is committed.
struct LabelDraft {
    joints: Vec<Uid>,
    text: String,
}

impl EditorPanel for PropertiesPanel {
    fn title(&self) -> &'static str {
        "Properties"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        self.values.refresh(&shown);
        self.keep_label(&shown, requests);
        if self.values.joints.is_empty() {
            let is_made = !shown.selection.0.is_empty();
            let hint = if is_made {
                "Commands made what is selected. Controls has the values of controls, Tags the commands of joints."
            } else {
                "Select a joint to see its properties."
            };
            return list::nothing(ui, hint);
        }
        ScrollArea::vertical().id_salt("properties").auto_shrink(false).show(ui, |ui| {
            if self.values.joints.len() > 1 {
                ui.strong(counted(self.values.joints.len(), "joint", "joints"));
            }
            self.label_field(ui, &shown, requests);
            self.group_field(ui, &shown, requests);
            ui.separator();
            self.transform(ui, world, &shown, requests);
            ui.separator();
            self.relations(ui, &shown, requests);
            self.lock_field(ui, &shown, requests);
            if let [joint] = self.values.joints[..] {
                tags::tags(ui, world, &shown, joint, requests);
            }
        });
    }
}

impl PropertiesPanel {
    fn send(&self, operation: Operation, shown: &DisplayedRig, requests: &mut Requests) {
        requests.send(EditRequest::operation(shown.entity, operation));
    }

    /// Commits a label that was typed for joints that are no longer selected.
    fn keep_label(&mut self, shown: &DisplayedRig, requests: &mut Requests) {
        if self.label.as_ref().is_some_and(|draft| draft.joints != self.values.joints) {
            self.accept_label(shown, requests);
        }
    }

    fn accept_label(&mut self, shown: &DisplayedRig, requests: &mut Requests) {
        let Some(draft) = self.label.take() else { return };
        let labels = numbered(&draft.joints, draft.text.trim()).into_iter().filter(|(uid, label)| {
            shown.rig.joint(*uid).is_some_and(|joint| joint.data.label.as_deref().unwrap_or_default() != label)
        });
        let labels: Vec<(Uid, String)> = labels.collect();
        if !labels.is_empty() {
            self.send(Operation::Labels(labels), shown, requests);
        }
    }

    fn label_field(&mut self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        let several = self.values.joints.len() > 1;
        let CommonValue { value, mixed } = self.values.label.clone();
        let kept = self.label.as_ref().map(|draft| draft.text.clone());
        let mut text = kept.unwrap_or(if mixed { String::new() } else { value });
        let hint = if mixed { MIXED.to_owned() } else { shown.name(self.values.joints[0]).into_owned() };
        let response = labelled(ui, "Label", |ui| {
            let field = TextEdit::singleline(&mut text).hint_text(hint).desired_width(ui.available_width());
            let response = ui.add(field);
            response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Label"));
            if several {
                response.on_hover_text("# becomes a number: finger_# gives finger_1, finger_2 ...")
            } else {
                response
            }
        });
        if response.changed() {
            self.label = Some(LabelDraft { joints: self.values.joints.clone(), text });
        }
        if self.label.is_some() && !response.has_focus() {
            if ui.input(|input| input.key_pressed(Key::Escape)) {
                self.label = None;
            } else {
                self.accept_label(shown, requests);
            }
        }
    }

    fn group_field(&mut self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        let CommonValue { value, mixed } = self.values.group;
        let group = value.filter(|_| !mixed).and_then(|uid| shown.rig.group(uid)).cloned();
        let text = match &group {
            Some(group) => group.name.as_str(),
            None if mixed => MIXED,
            None => "None",
        };
        let mut change = None;
        let joints = self.values.joints.clone();
        let recolored = |name: String, rgb: [u8; 3]| {
            let color = Some(rgb.map(|byte| f32::from(byte) / 255.0));
            Operation::Group { joints: joints.clone(), name, color }
        };
        labelled(ui, "Group", |ui| {
            if let Some(group) = &group {
                let stored = color(group.color);
                let kept = self.color.as_ref().filter(|(name, _)| *name == group.name).map(|(_, color)| *color);
                let mut rgb = kept.unwrap_or([stored.r(), stored.g(), stored.b()]);
                let field = ui.color_edit_button_srgb(&mut rgb).on_hover_text("Colour of the group");
                named(ui, field.id, "Colour of the group");
                let is_held = ui.input(|input| input.pointer.any_down());
                if field.changed() {
                    self.color = Some((group.name.clone(), rgb));
                    if is_held {
                        change = Some(Change::Preview(recolored(group.name.clone(), rgb)));
                    }
                }
                let holding = is_held || ui.ctx().egui_wants_keyboard_input();
                if let Some((name, rgb)) = self.color.take_if(|_| !holding) {
                    change = Some(Change::Do(recolored(name, rgb)));
                }
            }
            let current = if mixed { None } else { Some(group.as_ref().map_or("", |group| group.name.as_str())) };
            let combo = ComboBox::from_id_salt("group").selected_text(text).truncate().width(ui.available_width());
            let combo = combo.close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside).show_ui(ui, |ui| {
                if let Some(name) = groups::choose(ui, &shown.rig, current, &mut self.group) {
                    change = Some(Change::Do(Operation::Group { joints: joints.clone(), name, color: None }));
                }
            });
            named(ui, combo.response.id, "Group");
        });
        if let Some(change) = change {
            requests.send(EditRequest { rig: shown.entity, change });
        }
    }

    /// Draws kind and bone lengths, and links to the parent and the other side.
    fn relations(&self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        let kind = match (self.values.kind.mixed, self.values.kind.value) {
            (true, _) => MIXED,
            (false, NodeKind::Joint) => "Joint",
            (false, NodeKind::Null) => "Null (no weights)",
        };
        labelled(ui, "Kind", |ui| ui.add(egui::Label::new(kind).truncate()));
        labelled(ui, "Bone length", |ui| ui.add(egui::Label::new(lengths(&self.values.lengths)).truncate()));
        let [joint] = self.values.joints[..] else { return };
        let Some(data) = shown.rig.joint(joint) else { return };
        let mirror = data.data.mirror.filter(|other| shown.rig.joint(*other).is_some());
        for (name, other, none) in [("Parent", data.parent, "None (root)"), ("Mirror", mirror, "None")] {
            labelled(ui, name, |ui| match other {
                Some(other) => {
                    let text = egui::RichText::new(shown.name(other)).color(ui.visuals().hyperlink_color);
                    let link = egui::Label::new(text).truncate().sense(egui::Sense::click());
                    let link = ui.add(link).on_hover_text("Select it");
                    let said = format!("{name}: {}", shown.name(other));
                    link.widget_info(|| WidgetInfo::labeled(WidgetType::Link, true, &said));
                    if link.clicked() {
                        let what = Pick::Joints(vec![other]);
                        requests.send(PickRequest { rig: shown.entity, what, add: false });
                    }
                }
                None => {
                    ui.weak(none);
                }
            });
        }
    }

    fn lock_field(&self, ui: &mut Ui, shown: &DisplayedRig, requests: &mut Requests) {
        let CommonValue { mut value, mixed } = self.values.locked;
        let field = Checkbox::new(&mut value, "Lock weights").indeterminate(mixed);
        if ui.add(field).on_hover_text("Skinning leaves the weights of these joints as they are").clicked() {
            let lock = mixed || value;
            self.send(Operation::Lock(self.values.joints.clone(), lock), shown, requests);
        }
    }

    /// Draws the rest pose, or in Pose mode the pose on top of it.
    fn transform(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let posing = world.get_resource::<Mode>() == Some(&Mode::Pose);
        let size = self.values.size().max(mesh_size(world, shown.entity));
        let (distance, speed) = (Quantity::Distance { size }, self.values.speed());
        let length = Look { speed, decimals: 4, suffix: "", quantity: distance };
        let degrees = Look { speed: 0.5, decimals: 2, suffix: "°", quantity: Quantity::Degrees };
        let factor = Look { speed: 0.005, decimals: 3, suffix: "", quantity: Quantity::Factor };
        let rest = [
            (Part::Position, "Position", length),
            (Part::Local, "Local position", length),
            (Part::Rotation, "Rotation", degrees),
            (Part::Scale, "Scale", factor),
        ];
        let pose = [
            (Part::PoseRotation, "Pose rotation", degrees),
            (Part::PosePosition, "Pose offset", length),
            (Part::PoseScale, "Pose scale", factor),
        ];
        ui.horizontal_wrapped(|ui| {
            ui.strong(if posing { "Pose" } else { "Rest pose" });
            match (posing, self.values.posed) {
                (true, _) => ui.weak("on top of the rest pose"),
                (false, true) => ui.weak("posed: see Pose mode"),
                (false, false) => return,
            };
        });
        let mut edit = None;
        for (part, name, look) in if posing { &pose[..] } else { &rest[..] } {
            if let Some((axis, done)) = self.numbers.vector(ui, name, self.values.vector(*part), *look) {
                edit = Some((*part, axis, done));
            }
        }
        self.numbers.tell(requests);
        if posing {
            let reset = ui.add_enabled(self.values.posed, egui::Button::new("Reset pose of the selection"));
            if reset.on_disabled_hover_text("Nothing of the selection is posed").clicked() {
                self.send(Operation::ResetPose(self.values.joints.clone()), shown, requests);
            }
        }
        let with_children = world.get_resource::<EditorSettings>().is_some_and(|settings| settings.move_children);
        let Some((part, axis, edit)) = edit else { return };
        let mut to = |number| self.values.set(&shown.rig, part, axis, number, with_children);
        let change = match edit {
            NumberEdit::Set(number) => Change::Do(to(number)),
            NumberEdit::Preview(number) => Change::Preview(to(number)),
            NumberEdit::Commit => Change::Commit,
            NumberEdit::Cancel => Change::CancelPreview,
        };
        requests.send(EditRequest { rig: shown.entity, change });
    }
}

/// Largest distance of a rig's meshes from its origin; 1 without meshes.
fn mesh_size(world: &World, rig: Entity) -> f32 {
    let far = world.get::<RigSurface>(rig).map(|surface| {
        let [low, high] = surface.bounds();
        low.abs().max(high.abs()).length()
    });
    far.filter(|far| far.is_finite()).map_or(1.0, |far| far.max(1.0))
}

/// Lengths of the bones that begin at the selected joints.
fn lengths(lengths: &[f32]) -> String {
    let (least, most) = lengths.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), l| (a.min(*l), b.max(*l)));
    match lengths {
        [] => "no child".to_owned(),
        [_] => short(f64::from(most), 4),
        more => {
            let bones = counted(more.len(), "bone", "bones");
            format!("{} to {} ({bones})", short(f64::from(least), 3), short(f64::from(most), 3))
        }
    }
}

/// A label for each joint; `#` stands for its number in the selection.
fn numbered(joints: &[Uid], text: &str) -> Vec<(Uid, String)> {
    let several = joints.len() > 1;
    let label = |number: usize| if several { text.replace('#', &(number + 1).to_string()) } else { text.to_owned() };
    joints.iter().enumerate().map(|(number, uid)| (*uid, label(number))).collect()
}
