//! Display panel: what the viewport shows, and the look and size of the window.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_egui::egui::{self, Checkbox, ScrollArea, Ui, WidgetInfo, WidgetType};

use super::displayed_rig::{DisplayedRig, Stamp};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        counts::counted,
        files::RemoveMeshRequest,
        help::describe,
        keys::KeyBindings,
        onion::{ONION_COUNTS, OnionSkin, OnionStep},
        palette::obstacle,
        panel::{EditorPanel, Requests},
        screen::HiddenMeshes,
        settings::{EditorSettings, UI_SCALES},
        style::WindowTheme,
    },
    plugins::{
        display::MeshDisplay,
        drawing::{LabelChoice, RigDrawing, deforming_joints},
        surface::{RigMesh, RigMeshes},
    },
    rig::Uid,
};

/// The panel.
#[derive(Default)]
pub struct DisplayPanel {
    deforming: BTreeSet<Uid>,
    made_from: Option<Stamp>,
}

impl EditorPanel for DisplayPanel {
    fn title(&self) -> &'static str {
        "Display"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        ScrollArea::vertical().id_salt("display").auto_shrink(false).show(ui, |ui| {
            ui.strong("Viewport");
            for (action, is_on) in switches(world) {
                switch(ui, world, action, is_on, requests);
                if action == Action::Deforming && is_on {
                    self.count(ui, world);
                }
            }
            meshes(ui, world, requests);
            onion(ui, world, requests);
            ui.separator();
            window(ui, world, requests);
        });
    }
}

/// Switches of the viewport, with their states.
fn switches(world: &World) -> Vec<(Action, bool)> {
    let mut list = Vec::new();
    if let Some(drawing) = world.get_resource::<RigDrawing>() {
        list.extend([
            (Action::Bones, drawing.bones),
            (Action::Deforming, drawing.deforming),
            (Action::Controls, drawing.controls),
            (Action::Labels, drawing.labels == LabelChoice::All),
            (Action::LocalAxes, drawing.axes),
            (Action::Grid, drawing.grid),
        ]);
    }
    if let Some(display) = world.get_resource::<MeshDisplay>() {
        list.extend([(Action::XRay, display.xray), (Action::Wireframe, display.wireframe)]);
    }
    if let Some(hidden) = world.get_resource::<HiddenMeshes>() {
        list.push((Action::Meshes, !hidden.all && hidden.meshes.is_empty()));
    }
    list
}

/// Draws a switch that an action turns.
fn switch(ui: &mut Ui, world: &World, action: Action, is_on: bool, requests: &mut Requests) {
    let mut on = is_on;
    let field = ui.add(Checkbox::new(&mut on, describe(action)));
    if field.clicked() {
        requests.send(ActionRequest(action));
    }
    if let Some(key) = world.get_resource::<KeyBindings>().and_then(|keys| keys.key(action)) {
        field.on_hover_text(key.to_string());
    }
}

impl DisplayPanel {
    /// Draws the number of joints that deform.
    fn count(&mut self, ui: &mut Ui, world: &World) {
        let Some(shown) = DisplayedRig::of(world) else { return };
        if self.made_from != Some(shown.stamp()) {
            self.deforming = deforming_joints(&shown.rig);
            self.made_from = Some(shown.stamp());
        }
        let joints = counted(shown.rig.len(), "joint", "joints");
        let text = match self.deforming.iter().filter(|joint| shown.rig.joint(**joint).is_some()).count() {
            0 => "No joint moves a point yet: skin the mesh first.".to_owned(),
            1 => format!("1 of {joints} moves points of a mesh."),
            count => format!("{count} of {joints} move points of a mesh."),
        };
        ui.weak(text);
    }
}

/// Draws the meshes of the rig, with a switch each.
fn meshes(ui: &mut Ui, world: &World, requests: &mut Requests) {
    let Some(hidden) = world.get_resource::<HiddenMeshes>() else { return };
    let meshes = DisplayedRig::of(world).and_then(|shown| world.get::<RigMeshes>(shown.entity));
    let meshes = meshes.iter().flat_map(|meshes| meshes.iter()).filter_map(|mesh| world.get::<RigMesh>(mesh));
    let meshes: Vec<&RigMesh> = meshes.collect();
    for (number, mesh) in meshes.iter().enumerate() {
        let name = match mesh.file.name.as_str() {
            "" => format!("Mesh {}", number + 1),
            name => name.to_owned(),
        };
        let mut on = !hidden.hides(mesh.uid);
        let (clicked, is_removed) = ui.push_id(mesh.uid, |ui| row(ui, &mut on, &name, meshes.len() > 1)).inner;
        if is_removed {
            requests.send(RemoveMeshRequest(mesh.uid));
        }
        if clicked {
            // The switch of one mesh ends the common one.
            let mut next = HiddenMeshes { all: false, meshes: hidden.meshes.clone() };
            if hidden.all {
                next.meshes = meshes.iter().map(|mesh| mesh.uid).collect();
            }
            if on {
                next.meshes.remove(&mesh.uid);
            } else {
                next.meshes.insert(mesh.uid);
            }
            requests.set(next);
        }
    }
}

/// Draws the switch of a mesh, and a button that removes the mesh where it is not the only one. Returns which of them is
/// clicked.
fn row(ui: &mut Ui, on: &mut bool, name: &str, is_one_of_several: bool) -> (bool, bool) {
    let draw = |ui: &mut Ui| {
        if !is_one_of_several {
            return (ui.checkbox(on, name).clicked(), false);
        }
        let both = |ui: &mut Ui| {
            let clicked = ui.checkbox(on, name).clicked();
            let button = ui.small_button("Remove").on_hover_text("Take the mesh out of the document; its file stays");
            let said = format!("Remove {name}");
            button.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, &said));
            (clicked, button.clicked())
        };
        ui.horizontal(both).inner
    };
    ui.indent("mesh", draw).inner
}

/// Draws the switch of the onion skin, and the number and distance of its poses.
fn onion(ui: &mut Ui, world: &World, requests: &mut Requests) {
    let Some(skin) = world.get_resource::<OnionSkin>() else { return };
    switch(ui, world, Action::OnionSkin, skin.on, requests);
    if !skin.on {
        return;
    }
    let mut next = *skin;
    ui.horizontal_wrapped(|ui| {
        ui.weak("Before and after");
        for count in ONION_COUNTS {
            let response = ui.selectable_label(skin.count == count, count.to_string());
            let said = format!("{} before and after", counted(count, "ghost", "ghosts"));
            response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, skin.count == count, &said));
            if response.clicked() {
                next.count = count;
            }
        }
    });
    ui.horizontal_wrapped(|ui| {
        ui.weak("Every");
        for step in OnionStep::ALL {
            if ui.selectable_label(skin.step == step, step.name()).clicked() {
                next.step = step;
            }
        }
    });
    if next != *skin {
        requests.set(next);
    }
}

/// Draws theme, contrast and size of the window.
fn window(ui: &mut Ui, world: &World, requests: &mut Requests) {
    let Some(settings) = world.get_resource::<EditorSettings>() else { return };
    ui.strong("Window");
    ui.horizontal(|ui| {
        for theme in [WindowTheme::Dark, WindowTheme::Light] {
            let chosen = ui.selectable_label(settings.theme == theme, theme.name()).clicked();
            if chosen && settings.theme != theme {
                requests.send(ActionRequest(Action::Theme));
            }
        }
    });
    switch(ui, world, Action::Contrast, settings.high_contrast, requests);
    ui.horizontal(|ui| {
        let [least, .., most] = UI_SCALES;
        let mut step = |ui: &mut Ui, text: &str, action: Action, is_free: bool| {
            let button = ui.add_enabled(is_free, egui::Button::new(text)).on_hover_text(describe(action));
            let said = describe(action);
            button.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, is_free, &said));
            let why_not = obstacle(world, action).unwrap_or_default();
            if button.on_disabled_hover_text(why_not).clicked() {
                requests.send(ActionRequest(action));
            }
        };
        step(ui, "-", Action::UiSmaller, settings.ui_scale > least);
        ui.label(format!("{:.0} %", 100.0 * settings.ui_scale));
        step(ui, "+", Action::UiLarger, settings.ui_scale < most);
        step(ui, "100 %", Action::UiUsual, settings.ui_scale != 1.0);
    });
}
