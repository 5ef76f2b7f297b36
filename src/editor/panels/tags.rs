//! Tags panel: the stack of tags of the selected joints, as cards with their values, and the library of modules.
//!
//! Tags that several selected joints have alike are one card and are changed together.

mod curve_field;
mod fault;
mod forms;
mod header;
pub(super) mod library;
mod parameter_text;
mod parts;
mod pick;
mod read_values;
mod references;
mod stack;
mod value_edit;
mod values;

use std::{collections::HashSet, fmt::Display, sync::Arc};

use bevy::prelude::*;
use bevy_egui::egui::{
    self, Checkbox, CursorIcon, DragAndDrop, RichText, ScrollArea, Sense, Ui, WidgetInfo, WidgetType,
};

use super::{
    displayed_rig::DisplayedRig,
    fields::MIXED,
    list,
    properties::tags::{reason, state},
};
use crate::{
    editor::{
        counts::counted,
        dock::ShowPanel,
        notice::Notice,
        panel::{EditorPanel, Requests},
    },
    plugins::{
        commands::{CommandReport, Processor, RigModules, TagEntities},
        document::{Change, EditRequest},
        picking::{Pick, PickRequest},
    },
    processor::{CommandState, CommandStatus, Modules},
    rig::{
        TagKind, Uid,
        operations::{Operation, PasteContent, PasteTo, TagClipboard, TagOperation},
    },
};
use fault::Fault;
use pick::{PickStep, Picking};
use stack::{Entry, Stack};
use value_edit::{ValueEdit, with_text};
use values::Values;

/// Request to open the card of a tag, with the number of requests before it.
#[derive(Resource, Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShownTag {
    /// Number of the request.
    pub number: u64,
    /// The tag.
    pub tag: Uid,
}

/// Selects the joint of a tag and opens the tag's card in this panel, which comes forward.
pub(super) fn show_tag(world: &World, shown: &DisplayedRig, tag: Uid, requests: &mut Requests) {
    let Some((joint, _)) = shown.rig.find_tag(tag) else { return };
    let number = world.get_resource::<ShownTag>().map_or(0, |known| known.number) + 1;
    requests.send(PickRequest { rig: shown.entity, what: Pick::Joints(vec![joint.data.uid]), add: false });
    requests.set(ShownTag { number, tag });
    requests.send(ShowPanel("Tags"));
}

/// The panel.
#[derive(Default)]
pub struct TagsPanel {
    stack: Stack,
    values: Values,
    /// Tags whose cards are open.
    open: HashSet<Uid>,
    words: String,
    clipboard: Option<Arc<TagClipboard>>,
    parts: parts::PartMenu,
    /// Number of the last [`ShownTag`] that was answered.
    answered: u64,
    /// Card that is scrolled into view.
    reveal: Option<Uid>,
}

/// A card that is dragged by its handle.
pub(super) struct DraggedCard {
    /// Place of the card in the stack.
    place: usize,
    /// Commands of the card; none for a feature.
    pub commands: Vec<Uid>,
}

/// Request of a card.
enum CardRequest {
    Operation(TagOperation),
    Value(ValueEdit),
    Copy,
    Cut,
    Mirror,
}

impl EditorPanel for TagsPanel {
    fn title(&self) -> &'static str {
        "Tags"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let pick = self.values.picking.take().map(|picking| picking.step(ui, world, &shown));
        self.stack.refresh(&shown, pick.as_ref().and_then(PickStep::joints));
        let taken = pick.and_then(|pick| self.picked(pick, &shown, requests));
        if self.stack.joints.is_empty() {
            return list::nothing(ui, "Select a joint to see its tags: what the rig builds on it.");
        }
        let Some(modules) = world.get_resource::<RigModules>() else { return };
        self.values.follow(&modules.0);
        self.header(ui, world, &modules.0, &shown, requests);
        ui.separator();
        let entries = std::mem::take(&mut self.stack.entries);
        self.answer(world, &entries);
        if let Some((picking, text)) = taken
            && let Some(entry) = entries.iter().find(|entry| entry.first.uid == picking.tag)
            && let Some(module) = entry.module().and_then(|name| modules.0.get(name))
        {
            let edit = with_text(module, entry, &picking.path, &text);
            self.carry_out(CardRequest::Value(edit), entry, &modules.0, &shown, requests);
        }
        ScrollArea::vertical().id_salt("tags").auto_shrink(false).show(ui, |ui| {
            if entries.is_empty() {
                ui.weak("Nothing is built here. Add a control, an IK handle, a spring …");
            }
            for (number, entry) in entries.iter().enumerate() {
                let request = self.card(ui, world, &shown, &modules.0, &entries, number);
                if let Some(request) = request {
                    self.carry_out(request, entry, &modules.0, &shown, requests);
                }
            }
        });
        self.stack.entries = entries;
        self.values.keep(&self.open);
        self.values.tell(requests);
    }
}

fn send(operation: TagOperation, shown: &DisplayedRig, requests: &mut Requests) {
    requests.send(EditRequest::operation(shown.entity, Operation::Tags(operation)));
}

impl TagsPanel {
    /// Opens the card of a tag that was asked for, once its joint is selected.
    fn answer(&mut self, world: &World, entries: &[Entry]) {
        let Some(asked) = world.get_resource::<ShownTag>().filter(|asked| asked.number != self.answered) else {
            return;
        };
        let has_tag = |entry: &&Entry| entry.tags.iter().any(|(_, tag)| *tag == asked.tag);
        if let Some(entry) = entries.iter().find(has_tag) {
            self.answered = asked.number;
            self.open.insert(entry.first.uid);
            self.reveal = Some(entry.first.uid);
        }
    }

    /// Lets a person pick the nodes of a parameter; takes the joints of the card where it waits for nodes already.
    fn pick(&mut self, path: String, entry: &Entry, modules: &Modules, shown: &DisplayedRig, requests: &mut Requests) {
        let tag = entry.first.uid;
        let waits = self.values.picking.take_if(|picking| picking.tag == tag && picking.path == path);
        match (waits, entry.module().and_then(|name| modules.get(name))) {
            (Some(picking), Some(module)) => {
                let edit = with_text(module, entry, &path, &pick::joints(shown, &picking.joints));
                self.carry_out(CardRequest::Value(edit), entry, modules, shown, requests);
            }
            (Some(_), None) => {}
            (None, _) => self.values.picking = Some(Picking::new(shown, tag, path, self.stack.joints.clone())),
        }
    }

    /// Takes in what was picked: the joints of the card are selected again, and the text goes to the parameter.
    fn picked(&mut self, pick: PickStep, shown: &DisplayedRig, requests: &mut Requests) -> Option<(Picking, String)> {
        let mut restore = |picking: &Picking| {
            if shown.selection.0 != picking.joints {
                let what = Pick::Joints(picking.joints.clone());
                requests.send(PickRequest { rig: shown.entity, what, add: false });
            }
        };
        match pick {
            PickStep::Waits(picking) => self.values.picking = Some(picking),
            PickStep::Taken(picking, text) => {
                restore(&picking);
                return Some((picking, text));
            }
            PickStep::Dropped(picking) => restore(&picking),
            PickStep::Left => {}
        }
        None
    }

    fn copied<E: Display>(&mut self, clipboard: Result<TagClipboard, E>, requests: &mut Requests) {
        match clipboard {
            Ok(clipboard) => {
                let count: usize = clipboard.joints.iter().map(|joint| joint.tags.len()).sum();
                requests.send(Notice::done(format!("Copied {}.", counted(count, "tag", "tags"))).quiet());
                self.clipboard = Some(Arc::new(clipboard));
            }
            Err(error) => requests.send(Notice::error(format!("Nothing was copied: {error}."))),
        }
    }

    fn carry_out(
        &mut self,
        request: CardRequest,
        entry: &Entry,
        modules: &Modules,
        shown: &DisplayedRig,
        requests: &mut Requests,
    ) {
        let params = |list| Operation::Tags(TagOperation::Params(list));
        match request {
            CardRequest::Operation(operation) => send(operation, shown, requests),
            CardRequest::Copy => self.copied(TagClipboard::copy_tags(&shown.rig, &entry.uids()), requests),
            CardRequest::Cut => {
                let clipboard = TagClipboard::copy_tags(&shown.rig, &entry.uids());
                self.copied(clipboard.clone(), requests);
                if let Ok(clipboard) = clipboard {
                    send(TagOperation::Cut(Arc::new(clipboard)), shown, requests);
                }
            }
            CardRequest::Mirror => match TagClipboard::copy_tags(&shown.rig, &entry.uids()) {
                Ok(copied) => {
                    let mirrored = copied.map_params(|module, params| modules.get(module)?.mirrored(params).ok());
                    let (clipboard, what) = (Arc::new(mirrored), PasteContent::Both);
                    send(TagOperation::Paste { clipboard, what, to: PasteTo::Mirror }, shown, requests);
                }
                Err(error) => requests.send(Notice::error(format!("Nothing was mirrored: {error}."))),
            },
            CardRequest::Value(edit) => {
                let change = match edit {
                    ValueEdit::Set(list) => Change::Do(params(list)),
                    ValueEdit::Preview(list) => Change::Preview(params(list)),
                    ValueEdit::Commit => Change::Commit,
                    ValueEdit::Cancel => Change::CancelPreview,
                    ValueEdit::Pick(path) => return self.pick(path, entry, modules, shown, requests),
                    ValueEdit::Refused(reason) => return requests.send(Notice::error(format!("{reason}."))),
                };
                requests.send(EditRequest { rig: shown.entity, change });
            }
        }
    }

    fn card(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        modules: &Modules,
        entries: &[Entry],
        number: usize,
    ) -> Option<CardRequest> {
        let entry = entries.get(number)?;
        let tag = entry.first.uid;
        let mut request = None;
        let reveals = self.reveal.take_if(|revealed| *revealed == tag).is_some();
        let mut is_field_shown = false;
        let frame = egui::Frame::group(ui.style()).inner_margin(4.0).outer_margin(egui::Margin::symmetric(0, 1));
        let card = frame.show(ui, |ui| {
            ui.set_width(ui.available_width());
            request = self.card_head(ui, world, shown, entries, (number, entry));
            if self.open.contains(&tag) {
                let (edit, is_shown) = self.card_values(ui, world, shown, modules, (entry, reveals));
                request = request.take().or(edit);
                is_field_shown = is_shown;
                return;
            }
            let summary = entry.summary();
            if !summary.is_empty() {
                ui.add(egui::Label::new(RichText::new(summary).small().weak()).truncate());
            }
        });
        if reveals && !is_field_shown {
            card.response.scroll_to_me(Some(egui::Align::Center));
        }
        // A card that was dragged here goes before this one.
        if let Some(dragged) = card.response.dnd_release_payload::<DraggedCard>() {
            request = request.or(moved(entries, dragged.place, number));
        }
        request
    }

    /// Draws the first line of a card: its handle, fold, title, state and menu.
    fn card_head(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        entries: &[Entry],
        (number, entry): (usize, &Entry),
    ) -> Option<CardRequest> {
        let tag = entry.first.uid;
        let mut request = None;
        ui.horizontal(|ui| {
            let handle = ui.add(egui::Label::new(RichText::new("☰").weak()).sense(Sense::drag()));
            handle.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, format!("Drag {}", entry.title())));
            if handle.drag_started() {
                let commands = if entry.module().is_some() { entry.uids() } else { Vec::new() };
                DragAndDrop::set_payload(ui.ctx(), DraggedCard { place: number, commands });
            }
            handle.on_hover_cursor(CursorIcon::Grab);
            let is_open = self.open.contains(&tag);
            let title = entry.title();
            if list::symbol_button(ui, if is_open { "⏷" } else { "⏵" }, &format!("Values of {title}")) {
                if is_open {
                    self.open.remove(&tag)
                } else {
                    self.open.insert(tag)
                };
            }
            // The menu takes its room first; in narrow panels the title is cut.
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let menu = ui.menu_button("…", |ui| card_menu(ui, shown, entries, number));
                let said = format!("Menu of {title}");
                menu.response.widget_info(move || WidgetInfo::labeled(WidgetType::Button, true, &said));
                let chosen = menu.inner.flatten();
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    let state_width = if entry.module().is_some() { 40.0 } else { 0.0 };
                    let clicked = ui.scope(|ui| {
                        ui.set_max_width((ui.available_width() - state_width).max(30.0));
                        ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Truncate);
                        enabled(ui, shown, entry)
                    });
                    request = clicked.inner.or(chosen);
                    state_of(ui, world, shown, entry);
                });
            });
        });
        request
    }

    /// Draws the values of an open card. Returns what was asked for, and true if the field at fault is on the screen.
    fn card_values(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        modules: &Modules,
        (entry, reveals): (&Entry, bool),
    ) -> (Option<CardRequest>, bool) {
        let Some(name) = entry.module() else { return (feature_fields(ui, entry), false) };
        let Some(module) = modules.get(name) else {
            let reason = format!("There is no module \"{name}\".");
            ui.colored_label(ui.visuals().error_fg_color, reason);
            return (None, false);
        };
        ui.weak(module.doc);
        let failed = failure(world, shown, entry);
        if let Some(reason) = failed.and_then(reason) {
            ui.colored_label(ui.visuals().error_fg_color, reason);
        }
        let fault = failed.and_then(|status| Fault::of(status, reveals));
        let builder = world.get::<Processor>(shown.entity).map(Processor::builder);
        let edit = self.values.show(ui, shown, builder, module, entry, fault.as_ref());
        (edit.map(CardRequest::Value), fault.is_some_and(|fault| fault.is_shown()))
    }
}

/// Puts the tags of an entry before those of another, on each joint: before the next tag of that joint where the other entry
/// has none there.
fn moved(entries: &[Entry], dragged: usize, before: usize) -> Option<CardRequest> {
    if dragged == before {
        return None;
    }
    let tags = &entries.get(dragged)?.tags;
    let behind = move || entries.iter().enumerate().skip(before).filter(move |(number, _)| *number != dragged);
    let next = |joint: Uid| {
        let mut on_joint = behind().flat_map(|(_, entry)| &entry.tags).filter(|(other, _)| *other == joint);
        on_joint.next().map(|(_, tag)| *tag)
    };
    let moves = tags.iter().map(|(joint, tag)| (*tag, *joint, next(*joint))).collect();
    Some(CardRequest::Operation(TagOperation::MoveEach(moves)))
}

fn enabled(ui: &mut Ui, shown: &DisplayedRig, entry: &Entry) -> Option<CardRequest> {
    let on = |tag: &Uid| shown.rig.find_tag(*tag).is_some_and(|(_, tag)| tag.enabled);
    let tags = entry.uids();
    let count = tags.iter().filter(|tag| on(tag)).count();
    let mut value = count > 0;
    let mixed = count > 0 && count < tags.len();
    let title = entry.title();
    let several = if tags.len() > 1 { format!("{title} ({})", tags.len()) } else { title };
    let comment = if entry.first.comment.is_empty() { "on or off" } else { &entry.first.comment };
    // The title may be cut.
    let about = format!("{several}: {comment}");
    let field = Checkbox::new(&mut value, RichText::new(several).strong()).indeterminate(mixed);
    let clicked = ui.add(field).on_hover_text(about).clicked();
    clicked.then_some(CardRequest::Operation(TagOperation::Enable(tags, mixed || value)))
}

/// State of a command of an entry that failed, if one did.
fn failure<'w>(world: &'w World, shown: &DisplayedRig, entry: &Entry) -> Option<&'w CommandStatus> {
    let entities = world.get::<TagEntities>(shown.entity)?;
    let mut reports = entry.tags.iter().filter_map(|(_, tag)| world.get::<CommandReport>(entities.get(*tag)?));
    reports.find(|report| report.0.state == CommandState::Failed).map(|report| &report.0)
}

/// Draws the state of the commands in the build: the worst state of all.
fn state_of(ui: &mut Ui, world: &World, shown: &DisplayedRig, entry: &Entry) {
    let Some(entities) = world.get::<TagEntities>(shown.entity) else { return };
    let reports = entry.tags.iter().filter_map(|(_, tag)| world.get::<CommandReport>(entities.get(*tag)?));
    let Some(CommandReport(status)) = reports.max_by_key(|report| report.0.state as usize) else { return };
    let (word, color) = state(ui, status);
    let text =
        if status.micros >= 1000.0 { format!("{word} · {:.1} ms", status.micros / 1000.0) } else { word.to_owned() };
    let label = ui.add(egui::Label::new(RichText::new(text).small().color(color)).truncate());
    if let Some(reason) = reason(status) {
        label.on_hover_text(reason);
    }
}

fn card_menu(ui: &mut Ui, shown: &DisplayedRig, entries: &[Entry], number: usize) -> Option<CardRequest> {
    let entry = entries.get(number)?;
    let mut chosen = None;
    let mut item = |ui: &mut Ui, name: &str, enabled: bool, request: &dyn Fn() -> Option<CardRequest>| {
        let entry = ui.add_enabled(enabled, egui::Button::new(name));
        if entry.on_disabled_hover_text("The tag is at this end of the stack").clicked() {
            chosen = request();
            ui.close();
        }
    };
    item(ui, "Move up", number > 0, &|| moved(entries, number, number.checked_sub(1)?));
    item(ui, "Move down", number + 1 < entries.len(), &|| moved(entries, number, number + 2));
    ui.separator();
    item(ui, "Copy", true, &|| Some(CardRequest::Copy));
    item(ui, "Cut", true, &|| Some(CardRequest::Cut));
    item(ui, "Mirror to the other side", true, &|| Some(CardRequest::Mirror));
    ui.separator();
    item(ui, "Delete", true, &|| Some(CardRequest::Operation(TagOperation::Delete(entry.uids()))));
    if entry.module().is_some() {
        ui.menu_button("Put into feature", |ui| {
            let commands = entry.uids();
            item(ui, "None", true, &|| Some(CardRequest::Operation(TagOperation::Attach(commands.clone(), None))));
            let joint = entry.tags.first().and_then(|(joint, _)| shown.rig.joint(*joint));
            for tag in joint.into_iter().flat_map(|joint| &joint.data.tags) {
                let TagKind::Feature { name, switch, .. } = &tag.kind else { continue };
                let name = if switch.is_empty() { name.clone() } else { format!("{name}, {switch}") };
                let attach = || Some(CardRequest::Operation(TagOperation::Attach(commands.clone(), Some(tag.uid))));
                item(ui, &name, true, &attach);
            }
        });
    }
    chosen
}

/// Name and switch of a feature.
fn feature_fields(ui: &mut Ui, entry: &Entry) -> Option<CardRequest> {
    let TagKind::Feature { kind, name, switch, .. } = &entry.first.kind else { return None };
    let mut parts = [kind.clone(), name.clone(), switch.clone()];
    let mut changed = false;
    for (part, label) in parts.iter_mut().zip(["Kind", "Name", "Switch"]) {
        let id = ui.make_persistent_id((entry.first.uid, label));
        let mut text = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_else(|| part.clone());
        let response = super::fields::labelled(ui, label, |ui| {
            let response = ui.add(egui::TextEdit::singleline(&mut text).desired_width(ui.available_width()));
            response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, label));
            response
        });
        if response.changed() {
            ui.data_mut(|data| data.insert_temp(id, text.clone()));
        }
        if response.lost_focus() {
            ui.data_mut(|data| data.remove_temp::<String>(id));
            changed |= text != *part && !ui.input(|input| input.key_pressed(egui::Key::Escape));
            *part = text;
        }
    }
    let [kind, name, switch] = parts;
    let tag = entry.first.uid;
    changed.then_some(CardRequest::Operation(TagOperation::Feature { tag, kind, name, switch }))
}
