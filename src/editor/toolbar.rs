//! The toolbar: modes and frequent switches.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    ActiveRig,
    actions::{Action, ActionRequest},
    follow,
    keys::KeyBindings,
    mode::Mode,
    palette,
    panel::Requests,
    settings::EditorSettings,
    style,
};
use crate::plugins::{
    display::MeshDisplay,
    document::Symmetry,
    drawing::{LabelChoice, RigDrawing},
};

/// Draws the toolbar.
pub(super) fn show(ui: &mut egui::Ui, world: &World, requests: &mut Requests) {
    let keys = world.get_resource::<KeyBindings>();
    let tip = |what: &str, action: Action| match keys.and_then(|keys| keys.key(action)) {
        Some(key) => format!("{what} ({key})"),
        None => what.to_owned(),
    };
    let mode = world.get_resource::<Mode>().copied().unwrap_or_default();
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        for choice in Mode::ALL {
            if matches!(choice, Mode::Move | Mode::Pose) {
                ui.separator();
            }
            let key = keys.and_then(|keys| keys.key(Action::Mode(choice))).map(ToString::to_string);
            let label = egui::Button::selectable(mode == choice, choice.name());
            let label = match &key {
                Some(key) => label.shortcut_text(egui::RichText::new(key).small().color(style::quiet(ui.visuals()))),
                None => label,
            };
            let response = ui.add(label).on_hover_text(tip(purpose(choice), Action::Mode(choice)));
            if response.clicked() {
                requests.send(ActionRequest(Action::Mode(choice)));
            }
        }
        ui.separator();
        let what = "Put a skeleton into the mesh: the template whose limbs it shows, or the rig's own joints";
        let mut button = |ui: &mut egui::Ui, button: egui::Button, what: &str, action: Action| {
            let why_not = palette::obstacle(world, action);
            let response = ui.add_enabled(why_not.is_none(), button).on_hover_text(tip(what, action));
            if response.clicked() {
                requests.send(ActionRequest(action));
            }
            if let Some(why_not) = why_not {
                response.on_disabled_hover_text(why_not);
            }
        };
        button(ui, egui::Button::new("Fit"), what, Action::Fit);
        ui.separator();
        let mut switch = |ui: &mut egui::Ui, on: bool, name: &str, what: &str, action: Action| {
            button(ui, egui::Button::selectable(on, name), what, action);
        };
        let symmetry = world
            .get_resource::<ActiveRig>()
            .and_then(|rig| world.get::<Symmetry>(rig.0))
            .is_some_and(|symmetry| symmetry.0.is_some());
        switch(ui, symmetry, "Symmetry", "What is done on one side happens on the other, too", Action::Symmetry);
        let settings = world.get_resource::<EditorSettings>();
        let children = settings.is_some_and(|settings| settings.move_children);
        switch(ui, children, "With children", "Children move along with their parent", Action::MoveChildren);
        let space = settings.map(|settings| settings.gizmo_space).unwrap_or_default();
        switch(ui, false, space.name(), "Axes that gizmos move along: world, local or view", Action::GizmoSpace);
        ui.separator();
        let display = world.get_resource::<MeshDisplay>();
        switch(ui, display.is_some_and(|d| d.xray), "X-ray", "The mesh half transparent", Action::XRay);
        switch(ui, display.is_some_and(|d| d.wireframe), "Wire", "The edges of the mesh", Action::Wireframe);
        let drawing = world.get_resource::<RigDrawing>();
        switch(
            ui,
            drawing.is_some_and(|d| d.labels == LabelChoice::All),
            "Labels",
            "The names of all joints",
            Action::Labels,
        );
        switch(ui, drawing.is_some_and(|d| d.axes), "Axes", "The axes of the selected joints", Action::LocalAxes);
        let controls = drawing.is_some_and(|d| d.controls);
        switch(ui, controls, "Controls", "The controls of the built rig, in Select and Pose mode", Action::Controls);
        switch(ui, drawing.is_some_and(|d| d.grid), "Grid", "The ground", Action::Grid);
        let bones = drawing.is_some_and(|d| d.bones);
        switch(ui, bones, "Bones", "All bones, or those of selected joints alone", Action::Bones);
    });
}

/// Draws the badge of a template's file that is newer than the rig; returns `true` if it was clicked. It stands beside the menus,
/// which leave room for it, so that nothing moves when it comes.
pub(super) fn update(ui: &mut egui::Ui, world: &World) -> bool {
    let Some(offer) = follow::offer(world) else { return false };
    let text = egui::RichText::new("⬆ Update").strong().color(style::accent(ui.visuals()));
    let said = format!("Update: {}", follow::counts(offer));
    let badge = ui.button(text);
    badge.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, &said));
    badge.on_hover_text(&said).clicked()
}

/// Purpose of a mode, for its tooltip.
fn purpose(mode: Mode) -> &'static str {
    match mode {
        Mode::Select => "Click joints, drag boxes",
        Mode::Place => "Click the mesh to place a joint inside",
        Mode::Stroke => "Draw a stroke to make a chain",
        Mode::Move => "Move joints at rest",
        Mode::Rotate => "Turn joints at rest",
        Mode::Scale => "Scale joints at rest",
        Mode::Pose => "Pull and turn joints and see the mesh follow; the rest pose stays",
        Mode::Weights => "See which points a joint moves",
        Mode::Paint => "Paint the weights of the selected joint",
    }
}
