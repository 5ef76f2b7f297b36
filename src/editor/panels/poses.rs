//! Poses panel: the pose of the rig and its stored poses. The rest pose never changes here.

use bevy::prelude::*;
use bevy_egui::egui::{self, Align, Button, Key, Layout, Rect, Sense, TextEdit, Ui, UiBuilder, WidgetInfo, WidgetType};

use super::{
    displayed_rig::DisplayedRig,
    fields::{self, Renaming},
    list::{self, List},
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        panel::{EditorPanel, Requests},
    },
    plugins::{
        RigSystems,
        document::{EditRequest, Selection},
    },
    rig::{Rig, StoredPose, Uid, operations::Operation},
};

/// Plugin that carries out [`Action::ResetPose`] and [`Action::StorePose`].
pub struct PosesPlugin;

impl Plugin for PosesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<ActionRequest>()
            .add_systems(Update, pose_actions.after(RigSystems::Gesture).before(RigSystems::Edits));
    }
}

fn pose_actions(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &Selection)>,
    mut commands: Commands,
) {
    for ActionRequest(action) in actions.read() {
        let Some(entity) = active.as_ref().map(|active| active.0) else { continue };
        let Ok((rig, selection)) = rigs.get(entity) else { continue };
        let operation = match action {
            Action::ResetPose => Operation::ResetPose(selection.0.clone()),
            Action::StorePose => Operation::StorePose(free_name(rig)),
            _ => continue,
        };
        commands.write_message(EditRequest::operation(entity, operation));
    }
}

/// The first free name of "Pose 1", "Pose 2" and so on.
fn free_name(rig: &Rig) -> String {
    let taken = |name: &String| rig.stored_poses().iter().any(|pose| pose.name == *name);
    let names = (1..).map(|number| format!("Pose {number}"));
    names.into_iter().find(|name| !taken(name)).unwrap_or_default()
}

/// The panel.
#[derive(Default)]
pub struct PosesPanel {
    /// The name typed for the next pose.
    name: String,
    rename: Option<Rename>,
}

/// Name of a stored pose that is being typed.
struct Rename {
    pose: Uid,
    text: String,
    focused: bool,
}

impl EditorPanel for PosesPanel {
    fn title(&self) -> &'static str {
        "Poses"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let mut operation = current(ui, &shown);
        operation = self.store(ui, &shown).or(operation);
        if shown.rig.stored_poses().is_empty() {
            list::nothing(ui, "No pose is stored.");
        } else {
            operation = self.stored(ui, &shown).or(operation);
        }
        if let Some(operation) = operation {
            requests.send(EditRequest::operation(shown.entity, operation));
        }
    }
}

/// Draws the number of posed joints and the reset button.
fn current(ui: &mut Ui, shown: &DisplayedRig) -> Option<Operation> {
    let posed = shown.rig.pose().len();
    let text = match posed {
        0 => "At rest".to_owned(),
        1 => "1 joint is posed".to_owned(),
        more => format!("{more} joints are posed"),
    };
    ui.weak(text);
    let selected = shown.selection.0.iter().any(|joint| shown.rig.offset(*joint).is_some());
    let size = egui::vec2((ui.available_width() - ui.spacing().item_spacing.x) / 2.0, ui.spacing().interact_size.y);
    ui.horizontal(|ui| {
        let mut button = |text: &str, enabled: bool| {
            let button = Button::new(text).truncate();
            ui.add_enabled_ui(enabled, |ui| ui.add_sized(size, button)).inner.clicked()
        };
        let (one, all) = (button("Reset selected", selected), button("Reset all", posed > 0));
        match (one, all) {
            (true, _) => Some(Operation::ResetPose(shown.selection.0.clone())),
            (_, true) => Some(Operation::ResetPose(Vec::new())),
            _ => None,
        }
    })
    .inner
}

impl PosesPanel {
    /// Draws a name field and a button that stores the pose under it.
    fn store(&mut self, ui: &mut Ui, shown: &DisplayedRig) -> Option<Operation> {
        let free = free_name(&shown.rig);
        let name = self.name.trim();
        let replaces = shown.rig.stored_poses().iter().any(|pose| pose.name == name);
        let accepted = ui.horizontal(|ui| {
            let button = 62.0;
            let width = (ui.available_width() - button - ui.spacing().item_spacing.x).max(40.0);
            let field = ui.add(TextEdit::singleline(&mut self.name).hint_text(free.as_str()).desired_width(width));
            field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Pose name"));
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            let text = if replaces { "Replace" } else { "Store" };
            let size = egui::vec2(ui.available_width(), ui.spacing().interact_size.y);
            entered || ui.add(Button::new(text).min_size(size)).clicked()
        });
        accepted.inner.then(|| {
            let name = std::mem::take(&mut self.name);
            Operation::StorePose(if name.trim().is_empty() { free } else { name.trim().to_owned() })
        })
    }

    /// The stored poses.
    fn stored(&mut self, ui: &mut Ui, shown: &DisplayedRig) -> Option<Operation> {
        let poses = shown.rig.stored_poses();
        let mut operation = None;
        let mut drawn = false;
        let height = ui.spacing().interact_size.y + 4.0;
        List { id: "poses", count: poses.len(), height, reveal: None, follow: false }.show(ui, |ui, range, row| {
            for number in range {
                let pose = &poses[number];
                let renamed = self.rename.as_ref().is_some_and(|rename| rename.pose == pose.uid);
                drawn |= renamed;
                let rect = row(number).shrink2(egui::vec2(0.0, 1.0));
                let asked = if renamed { self.rename(ui, rect, pose) } else { self.row(ui, rect, pose, shown) };
                operation = asked.or(operation.take());
            }
        });
        // The typed text is also accepted when the field disappears.
        if !drawn && self.rename.as_ref().is_some_and(|rename| rename.focused) {
            let rename = self.rename.take()?;
            operation = operation.or(shown.rig.stored_pose(rename.pose).and_then(|pose| renamed(pose, &rename.text)));
        }
        operation
    }

    /// Draws a pose with its actions: apply, rename, delete.
    fn row(&mut self, ui: &mut Ui, rect: Rect, pose: &StoredPose, shown: &DisplayedRig) -> Option<Operation> {
        let current = pose.offsets == *shown.rig.pose();
        let response = ui.interact(rect, ui.id().with(pose.uid), Sense::click());
        response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, current, &pose.name));
        if current {
            ui.painter().rect_filled(rect, 3.0, ui.visuals().selection.bg_fill.gamma_multiply(0.6));
        } else if response.hovered() {
            ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35));
        }
        let mut operation = None;
        let builder = UiBuilder::new().id_salt(pose.uid).max_rect(rect).layout(Layout::right_to_left(Align::Center));
        ui.scope_builder(builder, |ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            if list::symbol_button(ui, "🗑", "Delete") {
                operation = Some(Operation::DeletePose(pose.uid));
            }
            if list::symbol_button(ui, "✏", "Rename") {
                self.start_rename(pose);
            }
            if ui.add_enabled(!current, Button::new("Apply")).clicked() {
                operation = Some(Operation::ApplyPose(pose.uid));
            }
            let name = ui.available_rect_before_wrap().shrink2(egui::vec2(4.0, 0.0));
            list::line(ui, name, &pose.name, ui.visuals().text_color());
        });
        if response.double_clicked() {
            self.start_rename(pose);
        }
        operation
    }

    fn start_rename(&mut self, pose: &StoredPose) {
        self.rename = Some(Rename { pose: pose.uid, text: pose.name.clone(), focused: false });
    }

    /// Draws the text field in place of a name.
    fn rename(&mut self, ui: &mut Ui, rect: Rect, pose: &StoredPose) -> Option<Operation> {
        let rename = self.rename.as_mut()?;
        let id = ui.id().with((pose.uid, "rename"));
        match fields::rename(ui, rect, id, "Rename pose", &mut rename.text, &mut rename.focused) {
            Renaming::Typing => None,
            Renaming::Dropped => {
                self.rename = None;
                None
            }
            Renaming::Accepted => renamed(pose, &self.rename.take()?.text),
        }
    }
}

/// Operation that renames a pose, unless the text is empty or unchanged.
fn renamed(pose: &StoredPose, text: &str) -> Option<Operation> {
    let name = text.trim();
    (!name.is_empty() && name != pose.name).then(|| Operation::RenamePose(pose.uid, name.to_owned()))
}
