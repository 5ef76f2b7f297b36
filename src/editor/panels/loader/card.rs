//! Card of the chosen template: what its header says, its options, and what can be done with it.

use std::{collections::BTreeMap, ops::RangeInclusive};

use bevy::prelude::World;
use bevy_egui::egui::{
    Button, Checkbox, ComboBox, DragValue, Frame, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType,
};

use crate::{
    editor::{
        counts::counted,
        library::{
            LibraryAct, LibraryAction, LibraryListing, LibraryRequest, PartRefusal, PartSides, obstacle, part_refusal,
            partners,
        },
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{TypedText, decimal, typed_field},
        },
        style,
    },
    files::{ListedTemplate, TemplatePlace},
    rig::{
        part::OptionForm,
        template::{OptionSummary, TemplateHeader},
    },
};

/// Choices in the card.
pub(in crate::editor::panels) struct Card {
    /// Template that the values are of.
    place: Option<TemplatePlace>,
    /// Values of options that differ from those of the part, as RON.
    options: BTreeMap<String, String>,
    /// Text of options that are being typed.
    typed: BTreeMap<String, String>,
    keep: bool,
}

impl Default for Card {
    fn default() -> Self {
        Self { place: None, options: BTreeMap::new(), typed: BTreeMap::new(), keep: true }
    }
}

impl Card {
    /// Draws the card.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        listing: &LibraryListing,
        listed: &ListedTemplate,
        shown: Option<&DisplayedRig>,
        requests: &mut Requests,
    ) {
        self.of(&listed.place);
        Frame::group(ui.style()).inner_margin(6.0).show(ui, |ui| {
            ui.set_width(ui.available_width());
            let header = match &listed.header {
                Ok(header) => header,
                Err(error) => {
                    ui.strong(listed.name());
                    ui.colored_label(ui.visuals().error_fg_color, format!("{}: {error}", listed.place));
                    return;
                }
            };
            about(ui, listed, header);
            if let Some((version, place)) = listing.newer(listed) {
                ui.colored_label(style::accent(ui.visuals()), format!("Version {version} is in {place}"));
            }
            self.options(ui, header, requests);
            self.buttons(ui, world, listed, shown, requests);
        });
    }

    /// Begins with the values of another template, unless it is the present one.
    pub fn of(&mut self, place: &TemplatePlace) {
        if self.place.as_ref() != Some(place) {
            *self = Self { place: Some(place.clone()), keep: self.keep, ..Self::default() };
        }
    }

    /// Draws the options of a part.
    pub fn options(&mut self, ui: &mut Ui, header: &TemplateHeader, requests: &mut Requests) {
        if header.options.is_empty() {
            return;
        }
        ui.strong("Options");
        for option in &header.options {
            ui.horizontal(|ui| {
                let name = option.name.replace('_', " ");
                let width = (ui.available_width() * 0.45).max(60.0);
                ui.allocate_ui(bevy_egui::egui::vec2(width, ui.spacing().interact_size.y), |ui| {
                    ui.set_width(width);
                    ui.add(Label::new(&name).truncate()).on_hover_text(&option.description);
                });
                let now = self.options.get(&option.name).unwrap_or(&option.default).clone();
                if let Some(value) = self.field(ui, option, &now, requests) {
                    if value == option.default {
                        self.options.remove(&option.name);
                    } else {
                        self.options.insert(option.name.clone(), value);
                    }
                }
            });
        }
    }

    /// Draws the field of an option; returns its value after a change.
    fn field(&mut self, ui: &mut Ui, option: &OptionSummary, now: &str, requests: &mut Requests) -> Option<String> {
        let said = format!("Option {}", option.name);
        match &option.form {
            Some(OptionForm::Check) => {
                let mut on = now.trim() == "true";
                let field = ui.add(Checkbox::without_text(&mut on));
                field.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, true, on, &said));
                field.clicked().then(|| on.to_string())
            }
            Some(OptionForm::Slider { min, max, .. }) => {
                number(ui, &said, now, decimal(*min)..=decimal(*max), requests)
            }
            Some(OptionForm::Number) => number(ui, &said, now, f64::NEG_INFINITY..=f64::INFINITY, requests),
            Some(OptionForm::Menu { options }) => {
                let current = ron::from_str::<String>(now).unwrap_or_default();
                let mut chosen = current.clone();
                let menu = ComboBox::from_id_salt(&said).selected_text(&current).width(90.0).show_ui(ui, |ui| {
                    for text in options {
                        ui.selectable_value(&mut chosen, text.clone(), text);
                    }
                });
                menu.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, &said));
                (chosen != current).then(|| quoted(&chosen)).flatten()
            }
            form => {
                let is_text = matches!(form, Some(OptionForm::Text));
                let text = match is_text {
                    true => ron::from_str::<String>(now).unwrap_or_default(),
                    false => now.to_owned(),
                };
                let typed = self.typed.entry(option.name.clone()).or_insert(text);
                let field = ui.add(TextEdit::singleline(typed).desired_width(ui.available_width()));
                field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, &said));
                let value = field.changed().then(|| typed.clone())?;
                if is_text { quoted(&value) } else { Some(value) }
            }
        }
    }

    /// Values of options that differ from those of the part.
    pub fn values(&self) -> Vec<(String, String)> {
        self.options.iter().map(|(name, value)| (name.clone(), value.clone())).collect()
    }

    fn buttons(
        &mut self,
        ui: &mut Ui,
        world: &World,
        listed: &ListedTemplate,
        shown: Option<&DisplayedRig>,
        requests: &mut Requests,
    ) {
        let selected = shown.map(|shown| shown.selection.0.clone()).unwrap_or_default();
        if let Some(shown) = shown.filter(|_| listed.is_part()) {
            both_sides(ui, world, shown, requests);
        }
        let keep_tip = "Joints and controls of the same identity keep their poses and keys; weights stay";
        ui.checkbox(&mut self.keep, "Keep poses and keys").on_hover_text(keep_tip);
        let keep = self.keep;
        let options = self.values();
        let refusal = if listed.is_part() { part_refusal(world, &listed.place) } else { None };
        ui.horizontal_wrapped(|ui| {
            let mut button = |name: &str, tip: &str, action: LibraryAction, act: LibraryAct| {
                let reason = obstacle(world, action);
                let field = ui.add_enabled(reason.is_none(), Button::new(name)).on_hover_text(tip);
                let words = refusal.as_ref().filter(|refusal| reason == Some(refusal.short())).map(PartRefusal::words);
                if field.on_disabled_hover_text(words.or(reason).unwrap_or_default()).clicked() {
                    requests.send(LibraryRequest { place: listed.place.clone(), act });
                }
            };
            if listed.is_part() {
                let tip = "On the selected joints, the chain below one, or the stroke that was just drawn";
                let act = LibraryAct::Part { joints: selected.clone(), options };
                button("Add part", tip, LibraryAction::Part, act);
            }
            button("Load", "In place of the rig, in one step", LibraryAction::Load, LibraryAct::Load { keep });
            let tip = "In place of the rig, and its skeleton into the mesh";
            button("Onto this mesh", tip, LibraryAction::Fit, LibraryAct::Fit { keep });
            let parent = selected.last().copied();
            let tip = "Its joints beside those of the rig, below the active joint if one is selected";
            button("Merge", tip, LibraryAction::Merge, LibraryAct::Merge { parent });
            let tip = "Its tags onto the selected joints, in the order in which they were selected";
            button("Inject", tip, LibraryAction::Inject, LibraryAct::Inject { joints: selected.clone() });
        });
    }
}

/// Draws the check that puts parts onto both sides; it is on while live mirroring is, until a person says otherwise.
pub(in crate::editor::panels) fn both_sides(ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
    let mut both = PartSides::are_both(world);
    let check = ui.checkbox(&mut both, "Both sides");
    let tip = match partners(&shown.rig, &shown.selection.0).is_some() {
        true => "A mirrored one on the joints of the other side, in the same step",
        false => "Where the joint that a part is dropped on has a partner, a mirrored one goes there in the same step",
    };
    if check.on_hover_text(tip).changed() {
        requests.set(PartSides::choice(world, both));
    }
}

/// Draws what a header says.
pub(in crate::editor::panels) fn about(ui: &mut Ui, listed: &ListedTemplate, header: &TemplateHeader) {
    ui.strong(listed.name());
    let joints = counted(header.joint_count, "joint", "joints");
    let facts = [header.kind.as_str(), header.version.as_str(), header.author.as_str(), joints.as_str()];
    let facts: Vec<&str> = facts.into_iter().filter(|fact| !fact.is_empty()).collect();
    ui.add(Label::new(RichText::new(facts.join(" · ")).small()).wrap());
    if !header.description.is_empty() {
        ui.add(Label::new(&header.description).wrap());
    }
    let mut line = |name: &str, items: Vec<String>| {
        if !items.is_empty() {
            ui.add(Label::new(RichText::new(format!("{name}: {}", items.join(", "))).small()).wrap());
        }
    };
    let features = header.features.iter().map(|feature| match feature.switches.as_slice() {
        [] => feature.name.clone(),
        switches => format!("{} ({})", feature.name, switches.join(", ")),
    });
    line("Features", features.collect());
    line("Sockets", header.sockets.iter().map(|socket| format!("{} on {}", socket.name, socket.joint)).collect());
    if let Some(needs) = &header.needs {
        line("Needs", needs.joints.clone());
        line("Hangs on", needs.sockets.clone());
    }
}

/// Draws the field of a number; returns the number as RON once it is another.
fn number(ui: &mut Ui, said: &str, now: &str, ends: RangeInclusive<f64>, requests: &mut Requests) -> Option<String> {
    let before = ron::from_str::<f32>(now).unwrap_or_default();
    let (mut value, typed) = (before, TypedText::default());
    let drag = DragValue::new(&mut value).speed(0.01).max_decimals(4).update_while_editing(false);
    let drag = drag.range(ends.clone()).custom_parser(typed.reader(ends, ""));
    let field = typed_field(ui, said, drag);
    typed.tell(&field, said, requests);
    // The field changes with each letter, its number when the field is left.
    (value != before && value.is_finite()).then(|| value.to_string())
}

/// A text as RON.
fn quoted(text: &str) -> Option<String> {
    ron::to_string(text).ok()
}
