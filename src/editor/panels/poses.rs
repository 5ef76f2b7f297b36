//! Poses panel: the pose of the rig, and its library of stored poses as cards with pictures. The rest pose never changes here.

mod picture;
mod pose_view;
mod tween;

use std::ops::Range;

use bevy::prelude::*;
use bevy_egui::egui::{
    self, Align, Button, Key, Layout, Rect, ScrollArea, Sense, Stroke, TextEdit, Ui, UiBuilder, WidgetInfo, WidgetType,
};

pub(in crate::editor) use self::pose_view::{PosedRig, put_clip};
use self::{
    picture::Pictures,
    tween::{Tween, TweenTarget},
};
use super::{
    displayed_rig::DisplayedRig,
    fields::{self, Renaming},
    list::{self, List},
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        counts::counted,
        help::describe,
        notice::Notice,
        palette,
        panel::{EditorPanel, Requests},
        style,
    },
    plugins::{
        RigSystems,
        document::{EditRequest, Selection},
    },
    rig::{
        Rig, StoredPose, Uid,
        operations::{Operation, WholePose},
    },
};

/// Plugin that carries out [`Action::ResetPose`], [`Action::MirrorPose`] and [`Action::StorePose`].
pub struct PosesPlugin;

impl Plugin for PosesPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<ActionRequest>()
            .add_message::<Notice>()
            .add_systems(Update, pose_actions.after(RigSystems::Gesture).before(RigSystems::Edits));
    }
}

fn pose_actions(mut actions: MessageReader<ActionRequest>, active: Option<Res<ActiveRig>>, mut commands: Commands) {
    let Some(entity) = active.map(|active| active.0) else { return actions.clear() };
    for ActionRequest(action) in actions.read().copied() {
        if matches!(action, Action::ResetPose | Action::MirrorPose | Action::StorePose) {
            commands.queue(move |world: &mut World| carry_out(world, entity, action));
        }
    }
}

fn carry_out(world: &mut World, entity: Entity, action: Action) {
    if let Some(why_not) = palette::obstacle(world, action) {
        world.write_message(Notice::info(format!("{}: {why_not}.", describe(action))));
        return;
    }
    let Some(posed) = PosedRig::of(world, entity) else { return };
    let has_selection = world.get::<Selection>(entity).is_some_and(|selection| !selection.0.is_empty());
    let operation = match action {
        Action::ResetPose => posed.reset(!has_selection),
        Action::StorePose => posed.store(free_name(posed.rig)),
        _ if has_selection => {
            let Some(operation) = posed.mirror_selected() else { return };
            operation
        }
        _ => posed.flip(),
    };
    world.write_message(EditRequest::operation(entity, operation));
}

/// The first free name of "Pose 1", "Pose 2" and so on.
fn free_name(rig: &Rig) -> String {
    let taken = |name: &String| rig.stored_poses().iter().any(|pose| pose.name == *name);
    let names = (1..).map(|number| format!("Pose {number}"));
    names.into_iter().find(|name| !taken(name)).unwrap_or_default()
}

/// Height of a card.
const CARD: f32 = 54.0;

/// The panel.
#[derive(Default)]
pub struct PosesPanel {
    /// The name typed for the next pose.
    name: String,
    rename: Option<Rename>,
    tween: Tween,
    pictures: Pictures,
    /// Height of everything above the cards, as it was drawn last.
    head: f32,
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
        let Some(posed) = PosedRig::of(world, shown.entity) else { return };
        // Where no two cards fit below the buttons, all of the panel scrolls.
        let is_low = ui.available_height() < self.head + 2.0 * CARD;
        let operation = if is_low {
            let area = ScrollArea::vertical().id_salt("low poses").auto_shrink(false).min_scrolled_height(0.0);
            area.show(ui, |ui| self.content(ui, world, (&posed, &shown), true, requests)).inner
        } else {
            self.content(ui, world, (&posed, &shown), false, requests)
        };
        if let Some(operation) = operation {
            requests.send(EditRequest::operation(posed.entity, operation));
        }
    }
}

/// Draws the number of posed joints, and the buttons that reset and mirror.
fn current(ui: &mut Ui, posed: &PosedRig, shown: &DisplayedRig) -> Option<Operation> {
    let count = posed.shown.offsets.len();
    let text = match count {
        0 => "At rest".to_owned(),
        1 => "1 joint is posed".to_owned(),
        more => format!("{} are posed", counted(more, "joint", "joints")),
    };
    ui.weak(text);
    let selected = shown.selection.0.iter().any(|node| posed.is_posed(*node));
    let is_any = count > 0 || !posed.shown.values.is_empty();
    let has_other_side = !posed.other_side().is_empty();
    let size = egui::vec2((ui.available_width() - ui.spacing().item_spacing.x) / 2.0, ui.spacing().interact_size.y);
    let mut chosen = None;
    let mut pair = |ui: &mut Ui, list: [(&'static str, bool, &str); 2]| {
        ui.horizontal(|ui| {
            for (text, enabled, why_not) in list {
                let button = Button::new(text).truncate();
                let response = ui.add_enabled_ui(enabled, |ui| ui.add_sized(size, button)).inner;
                if response.on_disabled_hover_text(why_not).clicked() {
                    chosen = Some(text);
                }
            }
        });
    };
    let at_rest = "nothing is posed";
    pair(ui, [("Reset selected", selected, "nothing of what is selected is posed"), ("Reset all", is_any, at_rest)]);
    let no_side = "what is selected has no other side";
    pair(ui, [("Mirror selected", has_other_side, no_side), ("Flip all", is_any, at_rest)]);
    match chosen? {
        "Reset selected" => Some(posed.reset(false)),
        "Reset all" => Some(posed.reset(true)),
        "Mirror selected" => posed.mirror_selected(),
        _ => Some(posed.flip()),
    }
}

impl PosesPanel {
    /// Draws the buttons, then the cards: below each other in a panel that scrolls, else in a list that scrolls.
    fn content(
        &mut self,
        ui: &mut Ui,
        world: &World,
        (posed, shown): (&PosedRig, &DisplayedRig),
        is_low: bool,
        requests: &mut Requests,
    ) -> Option<Operation> {
        let top = ui.cursor().top();
        let mut operation = current(ui, posed, shown);
        operation = self.store(ui, posed).or(operation);
        self.tween.show(ui, world, posed, requests);
        self.head = ui.cursor().top() - top;
        if posed.rig.stored_poses().is_empty() {
            list::nothing(ui, "No pose is stored.");
            return operation;
        }
        self.pictures.refresh(world, posed.entity, posed.rig);
        self.stored(ui, world, posed, is_low).or(operation)
    }

    /// Draws a name field and a button that stores the pose under it.
    fn store(&mut self, ui: &mut Ui, posed: &PosedRig) -> Option<Operation> {
        let free = free_name(posed.rig);
        let name = self.name.trim();
        let replaces = posed.rig.stored_poses().iter().any(|pose| pose.name == name);
        let accepted = ui.horizontal(|ui| {
            let button = 62.0;
            let width = (ui.available_width() - button - ui.spacing().item_spacing.x).max(40.0);
            let field = ui.add(TextEdit::singleline(&mut self.name).hint_text(free.as_str()).desired_width(width));
            field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Pose name"));
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            let text = if replaces { "Replace" } else { "Store" };
            let size = egui::vec2(ui.available_width(), ui.spacing().interact_size.y);
            let can_store = !posed.rig.is_empty();
            let button = ui.add_enabled(can_store, Button::new(text).min_size(size));
            entered && can_store || button.on_disabled_hover_text("there are no joints").clicked()
        });
        accepted.inner.then(|| {
            let name = std::mem::take(&mut self.name);
            posed.store(if name.trim().is_empty() { free } else { name.trim().to_owned() })
        })
    }

    /// The stored poses.
    fn stored(&mut self, ui: &mut Ui, world: &World, posed: &PosedRig, is_low: bool) -> Option<Operation> {
        let poses = posed.rig.stored_poses();
        let mut operation = None;
        let mut drawn = false;
        let draw = |ui: &mut Ui, range: Range<usize>, row: &dyn Fn(usize) -> Rect| {
            for number in range {
                let pose = &poses[number];
                drawn |= self.rename.as_ref().is_some_and(|rename| rename.pose == pose.uid);
                let rect = row(number).shrink2(egui::vec2(0.0, 1.0));
                let asked = self.card(ui, rect, pose, world, posed);
                operation = asked.or(operation.take());
            }
        };
        if is_low {
            list::visible_rows(ui, poses.len(), CARD, draw);
        } else {
            // The list ends between two cards.
            let whole = (ui.available_height() / CARD).floor().max(1.0) * CARD;
            ui.scope(|ui| {
                ui.set_max_height(whole);
                List { id: "poses", count: poses.len(), height: CARD, reveal: None, follow: false }.show(ui, draw);
            });
        }
        // The typed text is also accepted when the field disappears.
        if !drawn && self.rename.as_ref().is_some_and(|rename| rename.focused) {
            let rename = self.rename.take()?;
            operation = operation.or(posed.rig.stored_pose(rename.pose).and_then(|pose| renamed(pose, &rename.text)));
        }
        operation
    }

    /// Draws a pose: its picture, its name and its actions. A click makes it the one that the slider goes to.
    fn card(
        &mut self,
        ui: &mut Ui,
        rect: Rect,
        pose: &StoredPose,
        world: &World,
        posed: &PosedRig,
    ) -> Option<Operation> {
        let current = pose.offsets == posed.shown.offsets && pose.values == posed.shown.values;
        let is_target = self.tween.target == Some(TweenTarget::Pose(pose.uid));
        let response = ui.interact(rect, ui.id().with(pose.uid), Sense::click());
        response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, current, &pose.name));
        let visuals = ui.visuals();
        if current {
            ui.painter().rect_filled(rect, 3.0, visuals.selection.bg_fill.gamma_multiply(0.6));
        } else if response.hovered() {
            ui.painter().rect_filled(rect, 3.0, visuals.widgets.hovered.bg_fill.gamma_multiply(0.35));
        }
        let side = rect.height() - 4.0;
        let frame = Rect::from_min_size(rect.min + egui::vec2(2.0, 2.0), egui::Vec2::splat(side));
        let color = if is_target { style::accent(visuals) } else { visuals.text_color() };
        let ground = visuals.extreme_bg_color;
        let lines = self.pictures.lines(world, posed.entity, posed.rig, pose);
        picture::paint(&ui.painter_at(frame), frame, lines, ground, Stroke::new(1.3, color));
        let text =
            Rect::from_min_max(egui::pos2(frame.right() + 5.0, rect.top() + 2.0), rect.max - egui::vec2(2.0, 2.0));
        let (head, foot) = text.split_top_bottom_at_fraction(0.5);
        let mut operation = None;
        if self.rename.as_ref().is_some_and(|rename| rename.pose == pose.uid) {
            operation = self.rename(ui, head, pose);
        } else {
            list::line(ui, head, &pose.name, ui.visuals().text_color());
        }
        let builder = UiBuilder::new().id_salt(pose.uid).max_rect(foot).layout(Layout::right_to_left(Align::Center));
        ui.scope_builder(builder, |ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            if list::symbol_button(ui, "🗑", "Delete") {
                operation = Some(Operation::DeletePose(pose.uid));
            }
            let menu = ui.menu_button("…", |ui| self.menu(ui, pose, posed));
            menu.response
                .widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, format!("More of {}", pose.name)));
            operation = menu.inner.flatten().or(operation.take());
            if ui.add_enabled(!current, Button::new("Apply")).on_disabled_hover_text("it is shown already").clicked() {
                operation = Some(match posed.is_clip {
                    true => posed.change_to(&pose.into(), None, "Apply pose"),
                    false => Operation::ApplyPose(pose.uid),
                });
            }
        });
        if response.double_clicked() {
            self.start_rename(pose);
        } else if response.clicked() {
            self.tween.target = Some(TweenTarget::Pose(pose.uid));
        }
        operation
    }

    /// Draws the menu of a pose.
    fn menu(&mut self, ui: &mut Ui, pose: &StoredPose, posed: &PosedRig) -> Option<Operation> {
        let (nodes, own) = (posed.meant(), WholePose::from(pose));
        let mut chosen = None;
        let entry = |ui: &mut Ui, text: &str, why_not: Option<&str>| {
            let response = ui.add_enabled(why_not.is_none(), Button::new(text));
            let clicked = response.clicked();
            if let Some(why_not) = why_not {
                response.on_disabled_hover_text(why_not);
            }
            if clicked {
                ui.close();
            }
            clicked
        };
        let nothing = nodes.is_empty().then_some("nothing is selected");
        if entry(ui, "Apply to selected", nothing) {
            chosen = Some(posed.change_to(&own, Some(&nodes), "Apply pose"));
        }
        if entry(ui, "Apply mirrored", None) {
            chosen = Some(posed.change_to(&posed.mirrored(&own), None, "Apply mirrored pose"));
        }
        if entry(ui, "Apply mirrored to selected", nothing) {
            chosen = Some(posed.change_to(&posed.mirrored(&own), Some(&nodes), "Apply mirrored pose"));
        }
        ui.separator();
        if entry(ui, "Replace by what is shown", None) {
            chosen = Some(posed.store(pose.name.clone()));
        }
        if entry(ui, "Rename", None) {
            self.start_rename(pose);
        }
        chosen
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
