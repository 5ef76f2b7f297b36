//! Controls panel: the state of the build, the rig's features, the pose and the attributes of the selected control, and the
//! rig's switches.

use bevy::{math::EulerRot, prelude::*};
use bevy_egui::egui::{self, ComboBox, ScrollArea, Ui};

use super::{
    displayed_rig::DisplayedRig,
    features::Features,
    fields::{CommonValue, Look, NumberEdit, Numbers, labelled, named},
    list,
    poses::PosedRig,
    process::{AT_END, AT_START},
};
use crate::{
    editor::{
        counts::built_commands,
        panel::{EditorPanel, Requests},
    },
    plugins::{
        commands::{BuildFailure, BuildRequest, BuildResult, BuildStep, Processor, RunFailure},
        controls::SwitchRequest,
        document::{Change, EditRequest},
        runtime::RigRuntime,
    },
    rig::{
        Attribute, AttributeKind, BuiltNode, BuiltRig, Channels, Matching, PoseOffset, RigEdit, SwitchData, Uid,
        operations::Operation, proportion::Quantity,
    },
    solve::program::RigState,
};

/// The panel.
#[derive(Default)]
pub struct ControlsPanel {
    numbers: Numbers,
    features: Features,
}

impl EditorPanel for ControlsPanel {
    fn title(&self) -> &'static str {
        "Controls"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let built = world.get::<BuildResult>(shown.entity).map(|built| &*built.0);
        let runtime = world.get::<RigRuntime>(shown.entity);
        ScrollArea::vertical().id_salt("controls").auto_shrink(false).show(ui, |ui| {
            build_state(ui, world, &shown, requests);
            self.features.show(ui, &shown, requests);
            let (Some(built), Some(runtime)) = (built, runtime) else { return };
            ui.separator();
            let active = shown.selection.active().and_then(|active| built.node(active));
            match active.filter(|node| node.control.is_some() || !node.attributes.is_empty()) {
                Some(node) => {
                    let Some(posed) = PosedRig::of(world, shown.entity) else { return };
                    self.control(ui, node, runtime.state(), &posed, requests);
                }
                None => {
                    ui.weak("Click a control in Select or Pose mode to see its values.");
                }
            }
            switches(ui, built, runtime.state(), shown.entity, requests);
        });
    }
}

/// State of the build, the error that stopped it, and its buttons.
fn build_state(ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
    let Some(processor) = world.get::<Processor>(shown.entity) else {
        ui.weak("The rig has no commands yet.");
        return;
    };
    let (place, total) = (processor.builder().cursor(), processor.builder().len());
    ui.horizontal_wrapped(|ui| {
        ui.label(built_commands(processor.builder()));
        let no_back = (place == 0).then_some(AT_START);
        let no_further = (place == total).then_some(AT_END);
        let buttons = [
            ("Build", "Carry out all commands", BuildStep::All, no_further),
            ("◀", "Take back the last command", BuildStep::Back, no_back),
            ("▶", "Carry out the next command", BuildStep::Forward, no_further),
            ("Roll back", "Take back all commands", BuildStep::RollBack, no_back),
        ];
        for (name, what, step, why_not) in buttons {
            let button = ui.add_enabled(why_not.is_none(), egui::Button::new(name));
            if ["◀", "▶"].contains(&name) {
                // A symbol says nothing to people who hear it.
                named(ui, button.id, what);
            }
            let button = button.on_hover_text(what);
            if button.on_disabled_hover_text(why_not.unwrap_or_default()).clicked() {
                requests.send(BuildRequest { rig: shown.entity, step });
            }
        }
    });
    let failure = world.get::<BuildFailure>(shown.entity).map(|failure| failure.0.to_string());
    let run_failure = || Some(world.get::<RunFailure>(shown.entity)?.words(&shown.rig));
    if let Some(text) = failure.or_else(run_failure) {
        ui.colored_label(ui.visuals().error_fg_color, text);
    }
}

const LENGTH: Look = Look { speed: 0.005, decimals: 4, suffix: "", quantity: Quantity::Plain };
const DEGREES: Look = Look { speed: 0.5, decimals: 2, suffix: "°", quantity: Quantity::Degrees };
const FACTOR: Look = Look { speed: 0.005, decimals: 3, suffix: "", quantity: Quantity::Factor };
const VALUE: Look = Look { speed: 0.005, decimals: 3, suffix: "", quantity: Quantity::Plain };

/// Size of a running rig: the distance of its farthest node.
fn rig_size(state: &RigState) -> f32 {
    let far = (0..state.program().nodes().len()).map(|slot| state.global_at(slot).translation.length());
    far.filter(|far| far.is_finite()).fold(1e-3, f32::max)
}

/// Kind of transform channels.
#[derive(Clone, Copy)]
enum Channel {
    Translate,
    Rotate,
    Scale,
}

impl ControlsPanel {
    fn control(&mut self, ui: &mut Ui, node: &BuiltNode, state: &RigState, posed: &PosedRig, requests: &mut Requests) {
        ui.strong(&*node.name);
        let mut change = None;
        if let (Some(control), Some(slot)) = (&node.control, state.program().node(node.uid)) {
            let length = Look { quantity: Quantity::Distance { size: rig_size(state) }, ..LENGTH };
            change = self.pose(ui, node.uid, control.channels, state.offset_at(slot), length);
        }
        for attribute in node.attributes.iter() {
            let value = state.attribute(node.uid, &attribute.name).unwrap_or(attribute.default);
            if let Some(edit) = self.attribute(ui, attribute, value) {
                let set = |value| Operation::Named {
                    name: "Set attribute",
                    edits: vec![RigEdit::SetAttributeValue(node.uid, attribute.name.to_string(), Some(value))],
                };
                change = Some(changed(edit, set));
            }
        }
        let reset = ui.add_enabled(posed.is_posed(node.uid), egui::Button::new("Reset"));
        let reset = reset.on_hover_text("Pose and attributes of this control back to rest");
        if reset.on_disabled_hover_text("This control is at rest").clicked() {
            change = Some(Change::Do(posed.reset_of(node.uid)));
        }
        self.numbers.tell(requests);
        if let Some(change) = change {
            requests.send(EditRequest { rig: posed.entity, change });
        }
    }

    /// The pose offset of a control; channels that are all locked are left out.
    fn pose(&mut self, ui: &mut Ui, node: Uid, channels: Channels, offset: PoseOffset, length: Look) -> Option<Change> {
        let (x, y, z) = offset.rotation.to_euler(EulerRot::XYZ);
        let angles = Vec3::new(x, y, z).map(f32::to_degrees);
        let rows = [
            (Channel::Translate, "Translation", channels.translate, offset.translation, length),
            (Channel::Rotate, "Rotation", channels.rotate, angles, DEGREES),
            (Channel::Scale, "Scale", channels.scale, offset.scale, FACTOR),
        ];
        let mut change = None;
        for (channel, name, free, values, look) in rows {
            if !free.contains(&true) {
                continue;
            }
            let fields = values.to_array().map(|value| CommonValue { value, mixed: false });
            let Some((axis, edit)) = self.numbers.vector(ui, name, fields, look) else { continue };
            let set = |value: f32| {
                let mut values = values;
                values[axis] = value;
                let [x, y, z] = values.to_array().map(f32::to_radians);
                let offset = match channel {
                    Channel::Translate => PoseOffset { translation: values, ..offset },
                    Channel::Rotate => PoseOffset { rotation: Quat::from_euler(EulerRot::XYZ, x, y, z), ..offset },
                    Channel::Scale => PoseOffset { scale: values, ..offset },
                };
                Operation::Pose(vec![(node, offset)])
            };
            change = Some(changed(edit, set));
        }
        change
    }

    fn attribute(&mut self, ui: &mut Ui, attribute: &Attribute, value: f32) -> Option<NumberEdit> {
        let name = &*attribute.name;
        let AttributeKind::Choice(choices) = &attribute.kind else {
            return self.numbers.number(ui, name, value, VALUE);
        };
        let mut chosen = (value.round().max(0.0) as usize).min(choices.len().saturating_sub(1));
        let before = chosen;
        labelled(ui, name, |ui| {
            let combo = ComboBox::from_id_salt(name).selected_text(choices.get(chosen).map_or("", String::as_str));
            let combo = combo.width(ui.available_width()).show_ui(ui, |ui| {
                for (number, choice) in choices.iter().enumerate() {
                    ui.selectable_value(&mut chosen, number, choice);
                }
            });
            named(ui, combo.response.id, name);
        });
        (chosen != before).then_some(NumberEdit::Set(chosen as f32))
    }
}

fn changed(edit: NumberEdit, set: impl Fn(f32) -> Operation) -> Change {
    match edit {
        NumberEdit::Set(value) => Change::Do(set(value)),
        NumberEdit::Preview(value) => Change::Preview(set(value)),
        NumberEdit::Commit => Change::Commit,
        NumberEdit::Cancel => Change::CancelPreview,
    }
}

/// The switches of the rig, each with its values as buttons; what a switch matches stays where it is.
fn switches(ui: &mut Ui, built: &BuiltRig, state: &RigState, rig: Entity, requests: &mut Requests) {
    if built.switches.is_empty() {
        return;
    }
    ui.separator();
    ui.strong("Switches");
    for switch in &built.switches {
        let Some(node) = built.node(switch.control) else { continue };
        let value = state.attribute(switch.control, &switch.attribute).unwrap_or_default();
        labelled(ui, &node.name, |ui| {
            ui.horizontal_wrapped(|ui| {
                for (number, name) in values_of(node, switch).iter().enumerate() {
                    let is_on = (value - number as f32).abs() < 0.5;
                    let button = ui.selectable_label(is_on, name).on_hover_text(&*switch.attribute);
                    if button.clicked() && !is_on {
                        let (control, attribute) = (switch.control, switch.attribute.to_string());
                        requests.send(SwitchRequest { rig, control, attribute, value: number as f32 });
                    }
                }
            });
        });
    }
}

/// Names of a switch's values, in the order of their numbers.
pub(super) fn values_of(node: &BuiltNode, switch: &SwitchData) -> Vec<String> {
    let attribute = node.attributes.iter().find(|attribute| attribute.name == switch.attribute);
    match (attribute.map(|attribute| &attribute.kind), &switch.matching) {
        (Some(AttributeKind::Choice(names)), _) => names.clone(),
        (_, Matching::IkFk { .. }) => vec!["FK".to_owned(), "IK".to_owned()],
        (_, Matching::Space { .. }) => vec!["0".to_owned(), "1".to_owned()],
    }
}
