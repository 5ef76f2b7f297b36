//! Form in which the rig is written as a template: its header, its features, its options and sockets, and a picture taken in
//! the viewport.

mod draft;
mod options;
mod sockets;
mod text_entry;

use bevy::prelude::{Entity, World};
use bevy_egui::egui::{Button, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::{
    editor::{
        library::{HEADER, SaveTemplate, TemplateContent, TemplateDraft},
        panel::Requests,
        panels::displayed_rig::{DisplayedRig, Stamp},
    },
    plugins::commands::RigModules,
    rig::{RigAbout, feature::combined_features},
};
use draft::HeaderDraft;
use options::OptionList;
use sockets::SocketList;

/// The form.
#[derive(Default)]
pub(super) struct ExportForm {
    /// Field of a rig's header that is being typed.
    typed: Option<(Entity, HeaderField, String)>,
    /// Names of the features, with the state of the rig that they were listed from.
    features: Option<(Stamp, String)>,
    options: OptionList,
    sockets: SocketList,
}

/// Field of the header.
#[derive(Clone, Copy, PartialEq, Eq)]
enum HeaderField {
    Name,
    Version,
    Author,
    Kind,
    Description,
}

impl HeaderField {
    const ALL: [Self; 5] = [Self::Name, Self::Version, Self::Author, Self::Kind, Self::Description];

    fn name(self) -> &'static str {
        match self {
            Self::Name => "Name",
            Self::Version => "Version",
            Self::Author => "Author",
            Self::Kind => "Kind",
            Self::Description => "Description",
        }
    }

    fn of(self, about: &mut RigAbout) -> &mut String {
        match self {
            Self::Name => &mut about.name,
            Self::Version => &mut about.version,
            Self::Author => &mut about.author,
            Self::Kind => &mut about.kind,
            Self::Description => &mut about.description,
        }
    }
}

impl ExportForm {
    /// Draws the form.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        world: &World,
        shown: &DisplayedRig,
        draft: &TemplateDraft,
        requests: &mut Requests,
    ) {
        let mut header = HeaderDraft::of(shown);
        for field in HeaderField::ALL {
            self.field(ui, shown, field, &mut header, requests);
        }
        let features = self.features(shown);
        if !features.is_empty() {
            ui.add(Label::new(RichText::new(format!("Features: {features}")).small()).wrap());
        }
        if let Some(modules) = world.get_resource::<RigModules>() {
            self.options.show(ui, shown, &modules.0, &mut header, requests);
        }
        self.sockets.show(ui, shown, &mut header, requests);
        ui.separator();
        let mut next = draft.clone();
        let suggested = TemplateDraft { path: String::new(), ..draft.clone() }.file(world).display().to_string();
        let typed = TextEdit::singleline(&mut next.path).hint_text(&suggested).desired_width(f32::INFINITY);
        let typed = ui.add(typed).on_hover_text(format!("The file; without one it is {suggested}"));
        typed.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, "Template file"));
        ui.checkbox(&mut next.picture, "Picture from the viewport").on_hover_text("A .png beside the template");
        ui.checkbox(&mut next.replace, "Replace").on_hover_text("Replaces a file that is there");
        let file = next.file(world);
        let (replace, mut is_sent) = (next.replace, false);
        ui.horizontal_wrapped(|ui| {
            let can = !shown.rig.is_empty();
            let tip = "Header, options, sockets, groups, joints, tags, features and parts, as a .rig.ron";
            let save = ui.add_enabled(can, Button::new("Save template")).on_hover_text(tip);
            if save.on_disabled_hover_text("There are no joints").clicked() {
                let content = TemplateContent::Rig { picture: next.picture };
                requests.send(SaveTemplate { path: file.clone(), replace, content });
                is_sent = true;
            }
            let joints = shown.selection.0.clone();
            let tip = "The selected joints with their tags, as a part of their own";
            let extract = ui.add_enabled(!joints.is_empty(), Button::new("Extract selected")).on_hover_text(tip);
            if extract.on_disabled_hover_text("No joint is selected").clicked() {
                let first =
                    joints.first().map(|joint| shown.name(*joint).replace(['/', '\\'], "_")).unwrap_or_default();
                let is_typed = !next.path.trim().is_empty();
                let path = if is_typed { file } else { file.with_file_name(format!("{first}.rig.ron")) };
                requests.send(SaveTemplate { path, replace, content: TemplateContent::Joints(joints) });
                is_sent = true;
            }
        });
        // The next file is another one, or has been written just now.
        next.replace &= !is_sent;
        if next != *draft {
            requests.set(next);
        }
    }

    fn features(&mut self, shown: &DisplayedRig) -> &str {
        if self.features.as_ref().is_none_or(|(stamp, _)| *stamp != shown.stamp()) {
            let features = combined_features(&shown.rig);
            let names = features.iter().map(|feature| feature.key.name.as_str()).filter(|name| !name.is_empty());
            self.features = Some((shown.stamp(), names.collect::<Vec<_>>().join(", ")));
        }
        self.features.as_ref().map_or("", |(_, names)| names)
    }

    /// Draws a field of the header; what was typed becomes one step when the field is left.
    fn field(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        field: HeaderField,
        header: &mut HeaderDraft,
        requests: &mut Requests,
    ) {
        let now = field.of(&mut shown.rig.about().clone()).clone();
        let mut text = match &self.typed {
            Some((rig, of, text)) if (*rig, *of) == (shown.entity, field) => text.clone(),
            _ => now.clone(),
        };
        let edit = match field {
            HeaderField::Description => TextEdit::multiline(&mut text).desired_rows(2),
            _ => TextEdit::singleline(&mut text),
        };
        let response = ui.add(edit.hint_text(field.name()).desired_width(f32::INFINITY));
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, field.name()));
        let response = response.on_hover_text(field.name());
        // The next field has the focus before this one is drawn without it, so the focus alone replaces no typed text.
        if response.changed() {
            self.typed = Some((shown.entity, field, text));
        }
        if response.has_focus() {
            return;
        }
        let typed = self.typed.take_if(|(rig, of, _)| (*rig, *of) == (shown.entity, field));
        if let Some((_, _, text)) = typed.filter(|(_, _, text)| *text != now) {
            header.change(HEADER, requests, |about| *field.of(about) = text);
        }
    }
}
