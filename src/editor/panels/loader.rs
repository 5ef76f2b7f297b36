//! Loader panel: the four stages of the rig, its features and groups, the library of templates with pictures, and the form in
//! which a template is written.

pub(super) mod card;
mod export;
mod namesakes;
mod stages;
pub(super) mod tiles;

use bevy::prelude::*;
use bevy_egui::egui::{CollapsingHeader, ScrollArea, Ui};

use super::{displayed_rig::DisplayedRig, features::Features, list};
use crate::editor::{
    library::{ChosenTemplate, LibraryJobs, ListTemplates, TemplateDraft, TemplateLibrary},
    panel::{EditorPanel, Requests},
};
use tiles::{Tiles, TilesShown};

/// The panel.
#[derive(Default)]
pub struct LoaderPanel {
    features: Features,
    tiles: Tiles,
    card: card::Card,
    export: export::ExportForm,
}

impl EditorPanel for LoaderPanel {
    fn title(&self) -> &'static str {
        "Loader"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(library) = world.get_resource::<TemplateLibrary>() else { return };
        if !library.is_begun() {
            requests.send(ListTemplates);
        }
        ScrollArea::vertical().id_salt("loader").auto_shrink(false).show(ui, |ui| {
            let shown = DisplayedRig::of(world);
            if let Some(shown) = &shown {
                stages::show(ui, world, shown, requests);
                self.features.show(ui, shown, requests);
                stages::groups(ui, shown, requests);
                ui.separator();
            }
            ui.strong("Library");
            let chosen = world.get_resource::<ChosenTemplate>().and_then(|chosen| chosen.0.clone());
            let wanted = TilesShown { parts: None, height: 250.0, chosen: chosen.as_ref() };
            if let Some(listed) = self.tiles.show(ui, world, wanted, requests) {
                requests.set(ChosenTemplate(Some(listed.place.clone())));
            }
            if let Some(what) = world.get_resource::<LibraryJobs>().and_then(LibraryJobs::name) {
                ui.weak(format!("Reading {what} …"));
            }
            match chosen.as_ref().and_then(|place| library.listing().find(place)) {
                Some(listed) => self.card.show(ui, world, library.listing(), listed, shown.as_ref(), requests),
                None => list::nothing(ui, "Choose a template, or drag it onto a joint."),
            }
            let Some(shown) = &shown else { return };
            ui.separator();
            let draft = world.get_resource::<TemplateDraft>().cloned().unwrap_or_default();
            let header =
                CollapsingHeader::new("Save as template").id_salt("save as template").open(Some(draft.is_open));
            let response = header.show(ui, |ui| self.export.show(ui, world, shown, &draft, requests));
            if response.header_response.clicked() {
                requests.set(TemplateDraft { is_open: !draft.is_open, ..draft });
            }
        });
    }
}
