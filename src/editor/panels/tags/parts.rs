//! Menu of parts as pictures: a click puts a part onto the selected joints, the chain below one, or the stroke drawn last.

use bevy::prelude::World;
use bevy_egui::egui::{
    Button, PopupCloseBehavior, Ui,
    containers::menu::{MenuButton, MenuConfig},
    vec2,
};

use crate::{
    editor::{
        actions::{Action, ActionRequest},
        library::{
            LibraryAct, LibraryRequest, ListTemplates, PartRefusal, ReadPart, TemplateLibrary, is_part_known,
            part_refusal,
        },
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            loader::{
                card::{Card, about, both_sides},
                tiles::{PartTiles, Tiles, TilesShown},
            },
        },
        tools::stroke::{StrokeState, StrokeTool},
    },
    files::TemplatePlace,
};

/// The menu, with the part whose options are shown.
#[derive(Default)]
pub(super) struct PartMenu {
    tiles: Tiles,
    card: Card,
    chosen: Option<TemplatePlace>,
    /// True to show a part's card before it is added.
    options_first: bool,
}

impl PartMenu {
    /// Draws the button of the menu, and the menu while it is open.
    pub fn show(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
        MenuButton::new("Part").config(config).ui(ui, |ui| self.menu(ui, world, shown, requests));
    }

    fn menu(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let Some(library) = world.get_resource::<TemplateLibrary>() else { return };
        if !library.is_begun() {
            requests.send(ListTemplates);
        }
        // A part goes onto the stroke that was drawn last, which may still wait to be accepted.
        if world.get_resource::<StrokeTool>().is_some_and(|tool| matches!(tool.state, StrokeState::Preview(_))) {
            requests.send(ActionRequest(Action::Accept));
        }
        // All parts that come with Rigsmith stand side by side where the window is high enough.
        let height = (ui.ctx().content_rect().height() - 250.0).clamp(180.0, 470.0);
        ui.set_min_size(vec2(312.0, 60.0));
        ui.set_max_width(312.0);
        ui.checkbox(&mut self.options_first, "Options first")
            .on_hover_text("Shows a part's options before it is added");
        both_sides(ui, world, shown, requests);
        let adding = |place: &TemplatePlace, options: Vec<(String, String)>| {
            let act = LibraryAct::Part { joints: shown.selection.0.clone(), options };
            LibraryRequest { place: place.clone(), act }
        };
        if !self.options_first {
            self.chosen = None;
        }
        let chosen = self.chosen.clone();
        let listed = chosen.as_ref().and_then(|place| library.listing().find(place));
        if let Some(listed) = listed
            && let Ok(header) = &listed.header
        {
            about(ui, listed, header);
            self.card.of(&listed.place);
            self.card.options(ui, header, requests);
            if !is_part_known(world, &listed.place) {
                requests.send(ReadPart(listed.place.clone()));
            }
            let refusal = part_refusal(world, &listed.place);
            let button = ui.add_enabled(refusal.is_none(), Button::new("Add part"));
            let why_not = refusal.as_ref().map_or("", PartRefusal::words);
            if button.on_disabled_hover_text(why_not).clicked() {
                requests.send(adding(&listed.place, self.card.values()));
                ui.close();
            }
            ui.separator();
        }
        let parts = PartTiles { adds: !self.options_first };
        let wanted = TilesShown { parts: Some(parts), height, chosen: chosen.as_ref() };
        if let Some(listed) = self.tiles.show(ui, world, wanted, requests) {
            if self.options_first {
                self.chosen = Some(listed.place.clone());
            } else {
                requests.send(adding(&listed.place, Vec::new()));
                ui.close();
            }
        }
    }
}
