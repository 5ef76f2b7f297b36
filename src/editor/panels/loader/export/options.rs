//! Options of a template: values that its uses as a part may set, each with a form.

use std::sync::Arc;

use bevy::prelude::Entity;
use bevy_egui::egui::{Checkbox, ComboBox, Frame, Label, RichText, Ui, WidgetInfo, WidgetType};

use super::{draft::HeaderDraft, sockets::free_name, text_entry::TypedFields};
use crate::{
    editor::{
        notice::Notice,
        panel::Requests,
        panels::{displayed_rig::DisplayedRig, list},
    },
    processor::Modules,
    rig::{
        TagKind, Uid,
        part::{OptionForm, PartOption, tag_name},
        ron_text,
    },
};

/// Name of the step that changes an option.
const CHANGE: &str = "Change option";

/// The options in the form.
#[derive(Default)]
pub(super) struct OptionList {
    fields: TypedFields,
}

/// A parameter of a command that an option can set.
struct Target {
    tag: Uid,
    param: String,
}

impl OptionList {
    /// Draws the options.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        modules: &Arc<Modules>,
        draft: &mut HeaderDraft,
        requests: &mut Requests,
    ) {
        ui.strong("Options");
        let about = shown.rig.about();
        if !about.options.is_empty() && about.kind != "part" {
            let text = "Options are set where the template is used as a part: its kind is to be \"part\".";
            ui.add(Label::new(RichText::new(text).small()).wrap());
        }
        let mut removed = None;
        for (number, option) in about.options.iter().enumerate() {
            Frame::group(ui.style()).inner_margin(4.0).show(ui, |ui| {
                ui.set_width(ui.available_width());
                if self.option(ui, shown, modules, (number, option), draft, requests) {
                    removed = Some(number);
                }
            });
        }
        let target = ui.menu_button("+ Option", |ui| parameters(ui, shown, modules)).inner.flatten();
        if let Some(target) = target {
            match fresh(shown, modules, &target) {
                Some(option) => draft.change("Add option", requests, |about| about.options.push(option)),
                None => {
                    requests.send(Notice::error("The parameters of the command cannot be read: correct them first"))
                }
            }
        }
        if let Some(number) = removed {
            draft.change("Remove option", requests, |about| drop(about.options.remove(number)));
        }
    }

    /// Draws an option; returns true if it is to go.
    fn option(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        modules: &Arc<Modules>,
        (number, option): (usize, &PartOption),
        draft: &mut HeaderDraft,
        requests: &mut Requests,
    ) -> bool {
        let (name, rig) = (&option.name, shown.entity);
        let mut is_removed = false;
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 34.0).max(60.0);
            if let Some(text) = self.fields.text(ui, rig, &format!("Name of option {name}"), name, width) {
                match text.trim() {
                    "" => requests.send(Notice::warning(format!("The option {name} stays: an option needs a name"))),
                    text => draft.change(CHANGE, requests, |about| about.options[number].name = text.to_owned()),
                }
            }
            is_removed = list::symbol_button(ui, "✖", &format!("Remove option {name}"));
        });
        ui.horizontal(|ui| {
            choose_form(ui, (number, option), draft, requests);
            self.default(ui, rig, (number, option), draft, requests);
        });
        self.limits(ui, rig, (number, option), draft, requests);
        let width = ui.available_width();
        let said = format!("Description of option {name}");
        if let Some(text) = self.fields.text(ui, rig, &said, &option.description, width) {
            draft.change(CHANGE, requests, |about| about.options[number].description = text);
        }
        for (place, (tag, param)) in option.sets.iter().enumerate() {
            ui.horizontal(|ui| {
                let text = RichText::new(format!("sets {param} of {tag}")).small();
                ui.add(Label::new(text).truncate());
                if option.sets.len() > 1
                    && list::symbol_button(ui, "✖", &format!("Option {name} leaves {param} of {tag}"))
                {
                    draft.change(CHANGE, requests, |about| drop(about.options[number].sets.remove(place)));
                }
            });
        }
        let also = ui.menu_button(RichText::new("Also sets").small(), |ui| parameters(ui, shown, modules));
        if let Some(Target { tag, param }) = also.inner.flatten() {
            let target = (tag_name(&shown.rig, tag), param);
            if !option.sets.contains(&target) {
                draft.change(CHANGE, requests, |about| about.options[number].sets.push(target));
            }
        }
        is_removed
    }

    fn default(
        &mut self,
        ui: &mut Ui,
        rig: Entity,
        (number, option): (usize, &PartOption),
        draft: &mut HeaderDraft,
        requests: &mut Requests,
    ) {
        let said = format!("Default of option {}", option.name);
        let is_text = matches!(option.form, Some(OptionForm::Text | OptionForm::Menu { .. }));
        let value = if option.form == Some(OptionForm::Check) {
            let mut on = option.default.trim() == "true";
            let check = ui.add(Checkbox::without_text(&mut on));
            check.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, true, on, &said));
            check.clicked().then(|| on.to_string())
        } else {
            let now = match is_text {
                true => ron::from_str::<String>(&option.default).unwrap_or_default(),
                false => option.default.clone(),
            };
            let width = ui.available_width();
            let typed = self.fields.text(ui, rig, &said, &now, width);
            typed.map(|text| if is_text { ron_text(&text) } else { text.trim().to_owned() })
        };
        if let Some(value) = value {
            draft.change(CHANGE, requests, |about| about.options[number].default = value);
        }
    }

    /// Draws the range of a slider, or the texts of a menu.
    fn limits(
        &mut self,
        ui: &mut Ui,
        rig: Entity,
        (number, option): (usize, &PartOption),
        draft: &mut HeaderDraft,
        requests: &mut Requests,
    ) {
        let (width, name) = (ui.available_width(), &option.name);
        match &option.form {
            Some(OptionForm::Slider { min, max, step }) => {
                match self.fields.numbers(ui, rig, &format!("Range of option {name}"), [*min, *max], width) {
                    Some(Ok([min, max])) if min < max => {
                        let form = OptionForm::Slider { min, max, step: *step };
                        draft.change(CHANGE, requests, |about| reform(&mut about.options[number], Some(form)));
                    }
                    Some(_) => {
                        let text =
                            format!("The range of {name} stays as it was: type the smallest and the largest number");
                        requests.send(Notice::warning(text));
                    }
                    None => {}
                }
            }
            Some(OptionForm::Menu { options }) => {
                let said = format!("Texts of option {name}");
                if let Some(text) = self.fields.text(ui, rig, &said, &options.join(", "), width) {
                    let texts = text.split(',').map(str::trim).filter(|text| !text.is_empty());
                    let form = OptionForm::Menu { options: texts.map(str::to_owned).collect() };
                    draft.change(CHANGE, requests, |about| reform(&mut about.options[number], Some(form)));
                }
            }
            _ => {}
        }
    }
}

/// Draws the choice of the form; a default that the other form does not take becomes one that it takes.
fn choose_form(ui: &mut Ui, (number, option): (usize, &PartOption), draft: &mut HeaderDraft, requests: &mut Requests) {
    let said = format!("Form of option {}", option.name);
    let forms = [
        None,
        Some(OptionForm::Slider { min: 0.0, max: 1.0, step: None }),
        Some(OptionForm::Number),
        Some(OptionForm::Check),
        Some(OptionForm::Menu { options: vec!["one".to_owned(), "two".to_owned()] }),
        Some(OptionForm::Text),
    ];
    let mut chosen = None;
    let now = form_name(option.form.as_ref());
    let menu = ComboBox::from_id_salt(&said).selected_text(now).width(84.0).show_ui(ui, |ui| {
        for form in forms {
            let name = form_name(form.as_ref());
            if ui.selectable_label(name == now, name).clicked() && name != now {
                chosen = Some(form);
            }
        }
    });
    menu.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, &said));
    if let Some(form) = chosen {
        draft.change(CHANGE, requests, |about| reform(&mut about.options[number], form));
    }
}

/// Gives an option a form, and a default that the form takes.
fn reform(option: &mut PartOption, form: Option<OptionForm>) {
    option.form = form;
    if option.check(&option.default).is_ok() {
        return;
    }
    option.default = match &option.form {
        Some(OptionForm::Slider { min, .. }) => format!("{min:?}"),
        Some(OptionForm::Number) => "0.0".to_owned(),
        Some(OptionForm::Check) => "false".to_owned(),
        Some(OptionForm::Menu { options }) => ron_text(options.first().map_or("", String::as_str)),
        Some(OptionForm::Text) => ron_text(""),
        None => return,
    };
}

fn form_name(form: Option<&OptionForm>) -> &'static str {
    match form {
        None => "Any value",
        Some(OptionForm::Slider { .. }) => "Slider",
        Some(OptionForm::Number) => "Number",
        Some(OptionForm::Check) => "Check",
        Some(OptionForm::Menu { .. }) => "Menu",
        Some(OptionForm::Text) => "Text",
    }
}

/// Draws a menu of the parameters of the selected joints' commands; returns the one that is chosen.
fn parameters(ui: &mut Ui, shown: &DisplayedRig, modules: &Arc<Modules>) -> Option<Target> {
    let joints = shown.selection.0.iter().filter_map(|joint| shown.rig.joint(*joint));
    let tags = joints.flat_map(|joint| &joint.data.tags);
    let (mut chosen, mut is_empty) = (None, true);
    for tag in tags {
        let TagKind::Command { module, .. } = &tag.kind else { continue };
        let Some(info) = modules.get(module) else { continue };
        is_empty = false;
        ui.menu_button(tag_name(&shown.rig, tag.uid), |ui| {
            for parameter in &info.parameters {
                if ui.button(parameter.name).clicked() {
                    chosen = Some(Target { tag: tag.uid, param: parameter.name.to_owned() });
                    ui.close();
                }
            }
        });
    }
    if is_empty {
        ui.weak("Select joints with the commands that the option sets.");
    }
    chosen
}

/// An option that sets a parameter: of its name, with its value as the default and a form for its kind.
fn fresh(shown: &DisplayedRig, modules: &Arc<Modules>, target: &Target) -> Option<PartOption> {
    let (_, tag) = shown.rig.find_tag(target.tag)?;
    let TagKind::Command { module, params, .. } = &tag.kind else { return None };
    let info = modules.get(module)?;
    let values = info.values(params).ok()?;
    let default = values.get(&target.param)?.to_owned();
    let kind = info.parameters.iter().find(|parameter| parameter.name == target.param).map(|found| found.kind.as_str());
    let form = match kind {
        Some("bool") => Some(OptionForm::Check),
        Some("f32") => Some(OptionForm::Number),
        Some("String") => Some(OptionForm::Text),
        _ => None,
    };
    let taken = shown.rig.about().options.iter().map(|option| option.name.as_str());
    let name = free_name(target.param.clone(), taken);
    let sets = vec![(tag_name(&shown.rig, target.tag), target.param.clone())];
    let mut option = PartOption { name, default, description: String::new(), form, sets };
    // A parameter without a value keeps it: the form takes none.
    if option.check(&option.default).is_err() {
        option.form = None;
    }
    Some(option)
}
