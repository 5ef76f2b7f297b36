//! Groups panel: the local groups of a rig with their colours and joints; create, rename, recolour, assign, merge, reset,
//! remove.

use std::{collections::BTreeMap, sync::Arc};

use bevy::prelude::*;
use bevy_egui::egui::{self, Checkbox, ComboBox, Key, ScrollArea, TextEdit, Ui, WidgetInfo, WidgetType};

use super::{
    displayed_rig::{DisplayedRig, Stamp, color},
    fields::{color_button, named},
    list,
};
use crate::{
    editor::{
        notice::Notice,
        panel::{EditorPanel, Requests},
        style,
    },
    plugins::{
        document::{Change, EditRequest},
        picking::{Pick, PickRequest},
    },
    rig::{
        GroupData, Rig, RigEdit, Uid,
        operations::{Operation, TagOperation, TagScope, merged_groups},
    },
};

/// The panel.
#[derive(Default)]
pub struct GroupsPanel {
    /// Joints that a new group takes, and that are taken out of their groups.
    reach: Reach,
    /// Name of a group that is being made.
    draft: String,
    /// Group that is being renamed, with the typed name.
    renamed: Option<(Uid, String)>,
    /// Group whose colour is being chosen.
    colored: Option<(Uid, [f32; 3])>,
    /// State of the rig that the joints of groups were taken from.
    made_from: Option<Stamp>,
    members: BTreeMap<Uid, Arc<[Uid]>>,
}

/// Colours of new groups in turn: far apart, and all readable on dark and light ground.
const COLORS: [[f32; 3]; 8] = [
    [0.85, 0.35, 0.30],
    [0.30, 0.55, 0.90],
    [0.35, 0.70, 0.35],
    [0.90, 0.65, 0.20],
    [0.65, 0.45, 0.85],
    [0.20, 0.70, 0.70],
    [0.85, 0.45, 0.70],
    [0.60, 0.55, 0.35],
];

/// Joints of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Reach {
    /// The selected joints.
    #[default]
    Selected,
    /// The selected joints and those below them.
    Below,
    /// All joints of the rig.
    All,
}

impl Reach {
    const ALL: [Self; 3] = [Self::Selected, Self::Below, Self::All];

    fn name(self) -> &'static str {
        match self {
            Self::Selected => "Selected joints",
            Self::Below => "Selected and below",
            Self::All => "All joints",
        }
    }

    fn joints(self, rig: &Rig, selected: &[Uid]) -> Vec<Uid> {
        let scope = match self {
            Self::Selected => TagScope::Joints(selected.to_vec()),
            Self::Below => TagScope::Hierarchy(selected.to_vec()),
            Self::All => TagScope::Rig,
        };
        scope.joints(rig).unwrap_or_default()
    }
}

/// Request of a row.
enum RowRequest {
    Edits(Vec<RigEdit>),
    Preview(Vec<RigEdit>),
    Operation(Operation),
    /// A name that another group has.
    Taken(String),
    Select,
}

impl EditorPanel for GroupsPanel {
    fn title(&self) -> &'static str {
        "Groups"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let selected: Vec<Uid> =
            shown.selection.0.iter().copied().filter(|joint| shown.rig.joint(*joint).is_some()).collect();
        self.refresh(&shown);
        let reached = self.reach.joints(&shown.rig, &selected);
        self.reach(ui, &shown, &reached, requests);
        self.create(ui, &shown, &reached, requests);
        ui.separator();
        let empty: Vec<Uid> =
            shown.rig.groups().iter().map(|group| group.uid).filter(|uid| self.of(*uid).is_empty()).collect();
        if !empty.is_empty() {
            let text = format!("Remove {} empty", empty.len());
            if ui.button(text).on_hover_text("Groups without joints").clicked() {
                send(empty.iter().map(|uid| RigEdit::RemoveLocalGroup(*uid)).collect(), &shown, requests);
            }
        }
        if shown.rig.groups().is_empty() {
            list::nothing(ui, "No groups. A group turns its joints on and off together, and gives them a colour.");
        }
        ScrollArea::vertical().id_salt("groups").auto_shrink(false).show(ui, |ui| {
            for group in shown.rig.groups() {
                match self.row(ui, group, &shown, &selected) {
                    Some(RowRequest::Edits(edits)) => send(edits, &shown, requests),
                    Some(RowRequest::Preview(edits)) => {
                        let change = Change::Preview(Operation::Edits(edits));
                        requests.send(EditRequest { rig: shown.entity, change });
                    }
                    Some(RowRequest::Operation(operation)) => {
                        requests.send(EditRequest::operation(shown.entity, operation));
                    }
                    Some(RowRequest::Taken(name)) => requests.send(Notice::warning(format!(
                        "Another group is called \"{name}\"; give this one another name, or merge the two by its menu."
                    ))),
                    Some(RowRequest::Select) => {
                        let what = Pick::Joints(self.of(group.uid).to_vec());
                        requests.send(PickRequest { rig: shown.entity, what, add: false });
                    }
                    None => {}
                }
            }
        });
    }
}

fn send(edits: Vec<RigEdit>, shown: &DisplayedRig, requests: &mut Requests) {
    requests.send(EditRequest::operation(shown.entity, Operation::Edits(edits)));
}

impl GroupsPanel {
    /// Collects the joints of all groups again after a change of the rig.
    fn refresh(&mut self, shown: &DisplayedRig) {
        let stamp = Some(shown.stamp());
        if self.made_from == stamp {
            return;
        }
        self.made_from = stamp;
        let members = |group: Uid| TagScope::Group(group).joints(&shown.rig).unwrap_or_default();
        self.members = shown.rig.groups().iter().map(|group| (group.uid, members(group.uid).into())).collect();
    }

    /// Joints of a group.
    fn of(&self, group: Uid) -> Arc<[Uid]> {
        self.members.get(&group).cloned().unwrap_or_default()
    }

    /// Draws the choice of the joints that the next change is for, and the button that takes them out of their groups.
    fn reach(&mut self, ui: &mut Ui, shown: &DisplayedRig, reached: &[Uid], requests: &mut Requests) {
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 70.0).max(60.0);
            let combo = ComboBox::from_id_salt("reach").selected_text(self.reach.name()).width(width).truncate();
            let combo = combo.show_ui(ui, |ui| {
                for reach in Reach::ALL {
                    ui.selectable_value(&mut self.reach, reach, reach.name());
                }
            });
            combo.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, "Joints of the change"));
            let is_grouped = |joint: &Uid| shown.rig.joint(*joint).is_some_and(|joint| joint.data.group.is_some());
            let grouped: Vec<Uid> = reached.iter().copied().filter(is_grouped).collect();
            let reset = ui.add_enabled(!grouped.is_empty(), egui::Button::new("Reset"));
            let reset = reset.on_disabled_hover_text("None of these joints is in a group");
            if reset.on_hover_text("Takes these joints out of their groups").clicked() {
                let operation = Operation::Group { joints: grouped, name: String::new(), color: None };
                requests.send(EditRequest::operation(shown.entity, operation));
            }
        });
    }

    /// A field for the name of a new group, which takes the joints that are reached.
    fn create(&mut self, ui: &mut Ui, shown: &DisplayedRig, reached: &[Uid], requests: &mut Requests) {
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 70.0).max(60.0);
            let field = ui.add(TextEdit::singleline(&mut self.draft).hint_text("New group").desired_width(width));
            field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "New group"));
            let name = self.draft.trim().to_owned();
            let is_free = shown.rig.groups().iter().all(|group| group.name != name);
            let can = !name.is_empty() && is_free && !reached.is_empty();
            let tip = if reached.is_empty() {
                "Select the joints that go into it first, or choose all"
            } else if !is_free {
                "There is a group of this name"
            } else {
                "Puts these joints into a new group"
            };
            let button =
                ui.add_enabled(can, egui::Button::new("Create")).on_hover_text(tip).on_disabled_hover_text(tip);
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            if can && (button.clicked() || entered) {
                let color = Some(COLORS[shown.rig.groups().len() % COLORS.len()]);
                let operation = Operation::Group { joints: reached.to_vec(), name, color };
                requests.send(EditRequest::operation(shown.entity, operation));
                self.draft.clear();
            }
        });
    }

    fn row(&mut self, ui: &mut Ui, group: &GroupData, shown: &DisplayedRig, selected: &[Uid]) -> Option<RowRequest> {
        let joints = self.of(group.uid);
        let mut request = None;
        ui.horizontal(|ui| {
            let mut rgb = match self.colored {
                Some((uid, rgb)) if uid == group.uid => rgb,
                _ => group.color,
            };
            let color_field = color_button(ui, &mut rgb);
            named(ui, color_field.id, &format!("Colour of {}", group.name));
            if color_field.on_hover_text("Colour").changed() {
                self.colored = Some((group.uid, rgb));
                request =
                    Some(RowRequest::Preview(vec![RigEdit::SetLocalGroup(GroupData { color: rgb, ..group.clone() })]));
            }
            let holding = ui.input(|input| input.pointer.any_down());
            if let Some((_, rgb)) = self.colored.take_if(|(uid, _)| *uid == group.uid && !holding) {
                request =
                    Some(RowRequest::Edits(vec![RigEdit::SetLocalGroup(GroupData { color: rgb, ..group.clone() })]));
            }
            let mut enabled = group.enabled;
            let field = ui.add(Checkbox::new(&mut enabled, ""));
            let said = format!("Build {}", group.name);
            field.widget_info(move || WidgetInfo::selected(WidgetType::Checkbox, true, enabled, &said));
            if field.on_hover_text("Builds the joints of this group").clicked() {
                request = Some(RowRequest::Operation(Operation::Tags(TagOperation::EnableGroup(group.uid, enabled))));
            }
            // The menu and the count take their room first; a long name is cut.
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let menu = ui.menu_button("…", |ui| menu(ui, group, shown, selected, &joints));
                let said = format!("Menu of {}", group.name);
                menu.response.widget_info(move || WidgetInfo::labeled(WidgetType::Button, true, &said));
                request = request.take().or(menu.inner.flatten());
                ui.weak(format!("{}", joints.len()));
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    self.name(ui, group, shown, &mut request)
                });
            });
        });
        request
    }

    /// The name; a double click edits it.
    fn name(&mut self, ui: &mut Ui, group: &GroupData, shown: &DisplayedRig, request: &mut Option<RowRequest>) {
        let Some((_, text)) = self.renamed.as_mut().filter(|(uid, _)| *uid == group.uid) else {
            // Light colours of groups cannot be read on the ground of the light theme.
            let text = egui::RichText::new(&group.name).color(style::readable(ui.visuals(), color(group.color)));
            let label = ui.add(egui::Label::new(text).truncate().sense(egui::Sense::click()));
            label.widget_info(|| WidgetInfo::labeled(WidgetType::Link, true, &group.name));
            let label = label.on_hover_text("Click selects its joints, a double click renames it");
            if label.double_clicked() {
                self.renamed = Some((group.uid, group.name.clone()));
            } else if label.clicked() {
                *request = Some(RowRequest::Select);
            }
            return;
        };
        let field = ui.add(TextEdit::singleline(text).desired_width(100.0));
        field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Group name"));
        if field.lost_focus() {
            let name = text.trim().to_owned();
            self.renamed = None;
            let dropped = ui.input(|input| input.key_pressed(Key::Escape));
            if !dropped && !name.is_empty() && name != group.name {
                // Files and people call groups by their names.
                *request = Some(match shown.rig.groups().iter().any(|other| other.name == name) {
                    true => RowRequest::Taken(name),
                    false => RowRequest::Edits(vec![RigEdit::SetLocalGroup(GroupData { name, ..group.clone() })]),
                });
            }
        } else if !field.has_focus() {
            field.request_focus();
        }
    }
}

fn menu(ui: &mut Ui, group: &GroupData, shown: &DisplayedRig, selected: &[Uid], joints: &[Uid]) -> Option<RowRequest> {
    let mut chosen = None;
    let mut item = |ui: &mut Ui, name: &str, why_not: Option<&str>, request: &dyn Fn() -> RowRequest| {
        let entry = ui.add_enabled(why_not.is_none(), egui::Button::new(name));
        if entry.on_disabled_hover_text(why_not.unwrap_or_default()).clicked() {
            chosen = Some(request());
            ui.close();
        }
    };
    let put = |joints: Vec<Uid>, name: &str| {
        RowRequest::Operation(Operation::Group { joints, name: name.to_owned(), color: None })
    };
    let below = || TagScope::Hierarchy(selected.to_vec()).joints(&shown.rig).unwrap_or_default();
    let all = || TagScope::Rig.joints(&shown.rig).unwrap_or_default();
    let unselected = selected.is_empty().then_some("Select the joints first");
    let jointless = shown.rig.is_empty().then_some("There are no joints");
    let is_clear = joints.is_empty().then_some("The group has no joints");
    item(ui, "Assign selected", unselected, &|| put(selected.to_vec(), &group.name));
    item(ui, "Assign selected and below", unselected, &|| put(below(), &group.name));
    item(ui, "Assign all joints", jointless, &|| put(all(), &group.name));
    ui.separator();
    item(ui, "Take selected out", unselected, &|| {
        put(selected.iter().copied().filter(|j| joints.contains(j)).collect(), "")
    });
    item(ui, "Clear", is_clear, &|| put(joints.to_vec(), ""));
    ui.menu_button("Merge into", |ui| {
        for other in shown.rig.groups().iter().filter(|other| other.uid != group.uid) {
            item(ui, &other.name, None, &|| {
                let edits = merged_groups(&shown.rig, group.uid, other.uid);
                RowRequest::Operation(Operation::Named { name: "Merge groups", edits })
            });
        }
    });
    ui.separator();
    item(ui, "Remove", None, &|| {
        let mut edits: Vec<RigEdit> = joints.iter().map(|joint| RigEdit::SetGroup(*joint, None)).collect();
        edits.push(RigEdit::RemoveLocalGroup(group.uid));
        RowRequest::Edits(edits)
    });
    chosen
}
