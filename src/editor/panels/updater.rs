//! Updater panel: whether the file of the rig's template is newer, what it would change, and the conflicts, in each of which the
//! value here or that of the file is taken.

use std::sync::Arc;

use bevy::prelude::World;
use bevy_egui::egui::{Button, Rect, RichText, TextStyle, Ui, UiBuilder, WidgetInfo, WidgetType, vec2};

use super::list::{self, List};
use crate::{
    editor::{
        ActiveRig,
        files::OpenDocument,
        follow::{OfferAnswer, counts},
        panel::{EditorPanel, Requests},
        style,
    },
    instance::{RigSource, UpdateOffer},
    rig::update::{Change, ChangeKind, Choices, Take},
};

/// The panel.
#[derive(Default)]
pub struct UpdaterPanel {
    /// Offer that the choices are for.
    of: Option<Arc<[Change]>>,
    choices: Option<Choices>,
    /// Changes in the order of the list: conflicts first.
    order: Vec<usize>,
    /// Poses and motion that the update cannot keep.
    notes: Vec<String>,
}

impl EditorPanel for UpdaterPanel {
    fn title(&self) -> &'static str {
        "Updater"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else {
            return list::nothing(ui, "No rig is open.");
        };
        let Some(source) = world.get::<RigSource>(rig) else {
            return list::nothing(
                ui,
                "This rig follows no file. It does once a template's file is opened, loaded or saved.",
            );
        };
        ui.horizontal_wrapped(|ui| head(ui, world.get::<OpenDocument>(rig), source, requests));
        let Some(offer) = world.get::<UpdateOffer>(rig) else {
            self.of = None;
            return list::nothing(ui, "The rig has everything that its file has.");
        };
        self.refresh(offer);
        ui.horizontal_wrapped(|ui| {
            ui.colored_label(style::accent(ui.visuals()), RichText::new(title(offer)).strong());
            self.buttons(ui, offer, requests);
        });
        self.rows(ui, offer);
    }
}

/// Draws what is followed, and the switch of live updates.
fn head(ui: &mut Ui, document: Option<&OpenDocument>, source: &RigSource, requests: &mut Requests) {
    if let Some(path) = document.and_then(|document| document.template.as_ref()) {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let version = source.base().map(|base| base.about().version.clone()).filter(|version| !version.is_empty());
        let text = version.map_or_else(|| name.clone(), |version| format!("{name}, {version}"));
        ui.label(text).on_hover_text(path.display().to_string());
    }
    let mut is_live = source.is_live;
    let tip = "Whatever is saved to the file is taken over at once, unless both sides changed the same";
    if ui.checkbox(&mut is_live, "Live").on_hover_text(tip).clicked() {
        requests.send(OfferAnswer::Live(is_live));
    }
}

/// Title of an offer.
fn title(offer: &UpdateOffer) -> String {
    let version = offer.version.as_ref().map_or_else(String::new, |version| format!(" ({version})"));
    format!("The file is newer{version}: {}", counts(offer))
}

/// Joint, tag and field of a change.
fn subject(change: &Change) -> String {
    let parts = [change.joint.as_deref(), change.tag.as_deref(), change.field.as_deref()];
    parts.into_iter().flatten().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Values of the two sides, as far as the change has them.
fn values(change: &Change) -> [String; 2] {
    let [mine, theirs] = match change.kind {
        ChangeKind::Added => ["deleted", "changed"],
        ChangeKind::Removed => ["changed", "deleted"],
        ChangeKind::Changed | ChangeKind::Renamed | ChangeKind::Moved => ["nothing", "nothing"],
    };
    [change.from.clone().unwrap_or_else(|| mine.to_owned()), change.to.clone().unwrap_or_else(|| theirs.to_owned())]
}

impl UpdaterPanel {
    /// Begins with the choices of another offer: the values here stay where nothing else is chosen.
    fn refresh(&mut self, offer: &UpdateOffer) {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, &offer.changes)) {
            return;
        }
        self.of = Some(offer.changes.clone());
        self.choices = Some(Take::Mine.into());
        let (conflicts, others): (Vec<usize>, Vec<usize>) =
            (0..offer.changes.len()).partition(|number| offer.changes[*number].conflict);
        self.order = conflicts.into_iter().chain(others).collect();
        self.notes = offer.poses.iter().map(ToString::to_string).chain(offer.clips.lines()).collect();
    }

    fn buttons(&mut self, ui: &mut Ui, offer: &UpdateOffer, requests: &mut Requests) {
        let Some(choices) = &mut self.choices else { return };
        let has_conflicts = offer.changes.iter().any(|change| change.conflict);
        let take = ui.button(RichText::new("Take over").strong());
        let tip = "All changes, and in conflicts what is chosen; one step, which can be undone";
        if take.on_hover_text(tip).clicked() {
            requests.send(OfferAnswer::Choose(choices.clone()));
        }
        if has_conflicts {
            if ui.button("All mine").on_hover_text("In all conflicts the value here").clicked() {
                *choices = Take::Mine.into();
            }
            if ui.button("All theirs").on_hover_text("In all conflicts the value of the file").clicked() {
                *choices = Take::Theirs.into();
            }
        }
        if ui.button("Leave").on_hover_text("Until the file is saved again").clicked() {
            requests.send(OfferAnswer::Leave);
        }
    }

    fn rows(&mut self, ui: &mut Ui, offer: &UpdateOffer) {
        let Some(choices) = &mut self.choices else { return };
        let line = list::row_height(ui);
        let notes = &self.notes;
        let rows = List {
            id: "changes",
            count: self.order.len() + notes.len(),
            height: 2.0 * line + 6.0,
            reveal: None,
            follow: false,
        };
        rows.show(ui, |ui, range, place| {
            for number in range {
                let rect = place(number);
                let upper = Rect::from_min_size(rect.min, vec2(rect.width(), line));
                let lower = Rect::from_min_size(upper.left_bottom(), vec2(rect.width(), line));
                let (strong, quiet) = (ui.visuals().strong_text_color(), style::quiet(ui.visuals()));
                let Some(change) = self.order.get(number).and_then(|place| offer.changes.get(*place)) else {
                    let note = notes.get(number - self.order.len()).map(String::as_str).unwrap_or_default();
                    told(ui, upper, note, style::obstacle(ui.visuals()));
                    continue;
                };
                let subject = subject(change);
                if change.conflict {
                    told(ui, upper, &subject, style::obstacle(ui.visuals()));
                    conflict(ui, lower, change, &subject, choices);
                    continue;
                }
                told(ui, upper, &subject, strong);
                let [mine, theirs] = values(change);
                let text = match change.kind {
                    ChangeKind::Added => "added".to_owned(),
                    ChangeKind::Removed => "removed".to_owned(),
                    ChangeKind::Changed => format!("{mine} ➡ {theirs}"),
                    ChangeKind::Renamed => format!("renamed {mine} ➡ {theirs}"),
                    ChangeKind::Moved => format!("moved {mine} ➡ {theirs}"),
                };
                told(ui, lower, &text, quiet);
            }
        });
    }
}

/// Draws a line that programs for blind people read, too.
fn told(ui: &mut Ui, rect: Rect, text: &str, color: bevy_egui::egui::Color32) {
    let response = ui.interact(rect, ui.id().with((text, rect.top() as i32)), bevy_egui::egui::Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, text));
    if list::line(ui, rect, text, color) {
        response.on_hover_text(text);
    }
}

/// Draws the two values of a conflict side by side; a click takes one.
fn conflict(ui: &mut Ui, rect: Rect, change: &Change, subject: &str, choices: &mut Choices) {
    let taken = choices.of_change(change);
    let half = (rect.width() - 4.0) / 2.0;
    let sides = [(Take::Mine, "Mine", rect.left()), (Take::Theirs, "Theirs", rect.left() + half + 4.0)];
    for ((take, name, left), value) in sides.into_iter().zip(values(change)) {
        let place = Rect::from_min_size(rect.min + vec2(left - rect.left(), 0.0), vec2(half, rect.height()));
        let text = RichText::new(format!("{name}: {value}")).text_style(TextStyle::Small);
        let mut side = ui.new_child(UiBuilder::new().max_rect(place));
        let is_on = take == taken;
        let button = side.add_sized(place.size(), Button::selectable(is_on, text).truncate());
        let said = format!("{name}: {subject}");
        button.widget_info(|| WidgetInfo::selected(WidgetType::RadioButton, true, is_on, &said));
        if button.on_hover_text(&value).clicked() {
            choices.choose(change, take);
        }
    }
}
