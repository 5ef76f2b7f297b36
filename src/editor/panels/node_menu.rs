//! Menu of a control or joint in the viewport: a right click offers its switches, which keep the pose, and what else can be
//! done to it.

use bevy::prelude::*;
use bevy_egui::egui::{self, Area, Button, Frame, Id, Key, Order, Pos2, Rect, Ui};

use super::{
    controls::values_of,
    displayed_rig::DisplayedRig,
    poses::PosedRig,
    selection_sets::{free_name, recall},
    tags::show_tag,
    timeline::{OpenClip, Timeline, TimelineAction, obstacle, range, requested},
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        camera::ViewportSight,
        mode::Mode,
        panel::{Requests, ViewportPainter},
        pointer::ViewportArea,
        tools::select::REACH,
    },
    plugins::{
        commands::BuildResult,
        controls::SwitchRequest,
        document::{EditRequest, HoveredNode, Selection},
        picking::{HoverRequest, Pick, PickRequest},
        runtime::RigRuntime,
    },
    rig::{BuiltRig, Matching, Rig, SwitchData, Uid, operations::Operation},
    solve::program::RigState,
};

/// Largest distance of the pointer from a click that it has not left, in points.
const STILL: f32 = 4.0;

/// Menu of the node that was clicked last.
#[derive(Default)]
pub(super) struct NodeMenu {
    open: Option<OpenMenu>,
    /// Rig and place of a click from which the pointer has moved on; the node there is known in the next frame.
    sought: Option<(Entity, Pos2)>,
}

#[derive(Debug, Clone, Copy)]
struct OpenMenu {
    rig: Entity,
    node: Uid,
    at: Pos2,
    /// Frames since the click that opened it, which does not close it.
    age: u32,
}

impl ViewportPainter for NodeMenu {
    fn paint(&mut self, _: &egui::Painter, _: Rect, _: &World) {}

    fn widgets(&mut self, ui: &mut Ui, area: Rect, world: &World, requests: &mut Requests) {
        let Some(active) = world.get_resource::<ActiveRig>().map(|active| active.0) else {
            self.open = None;
            return;
        };
        let ctx = ui.ctx().clone();
        if let Some(at) = clicked(&ctx, area) {
            let is_mode = world.get_resource::<Mode>().is_none_or(|mode| matches!(mode, Mode::Select | Mode::Pose));
            (self.open, self.sought) = (None, None);
            match request_under(world, active, at, area) {
                _ if !is_mode => {}
                Some(request) => {
                    requests.send(request);
                    self.sought = Some((active, at));
                }
                None => self.begin(world, active, at, requests),
            }
        } else if let Some((_, at)) = self.sought.take().filter(|(rig, _)| *rig == active) {
            self.begin(world, active, at, requests);
        }
        let Some(open) = &mut self.open else { return };
        open.age += 1;
        let open = *open;
        if open.rig != active {
            self.open = None;
            return;
        }
        let shown = Area::new(Id::new("node menu")).order(Order::Foreground).fixed_pos(open.at).constrain(true);
        let shown =
            shown.show(&ctx, |ui| Frame::menu(ui.style()).show(ui, |ui| entries(ui, world, &open, requests)).inner);
        let is_elsewhere = ctx.input(|input| {
            let pressed = input.pointer.any_pressed();
            pressed && input.pointer.interact_pos().is_some_and(|at| !shown.response.rect.contains(at))
        });
        let is_escaped = ctx.input(|input| input.key_pressed(Key::Escape));
        if shown.inner || is_escaped || is_elsewhere && open.age > 2 {
            self.open = None;
        }
    }
}

impl NodeMenu {
    /// Opens the menu of the node under the pointer, if there is one.
    fn begin(&mut self, world: &World, rig: Entity, at: Pos2, requests: &mut Requests) {
        let hovered = world.get::<HoveredNode>(rig).and_then(|hovered| hovered.0);
        self.open = hovered.map(|node| OpenMenu { rig, node, at, age: 0 });
        if let Some(open) = self.open
            && !world.get::<Selection>(rig).is_some_and(|selection| selection.0.contains(&open.node))
        {
            requests.send(PickRequest { rig, what: Pick::Joints(vec![open.node]), add: false });
        }
    }
}

/// Request for the node under a click, where the pointer has moved on within the same slow frame; `None` while it is still there.
fn request_under(world: &World, rig: Entity, at: Pos2, area: Rect) -> Option<HoverRequest> {
    let pointer = world.get_resource::<ViewportArea>()?.pointer;
    let sight = world.get_resource::<ViewportSight>()?.0?;
    let at = Vec2::new(at.x - area.min.x, at.y - area.min.y);
    let is_there = pointer.is_some_and(|pointer| pointer.distance(at) <= STILL);
    let what = Some((sight.plane, sight.point(at), REACH * sight.pixel));
    (!is_there).then_some(HoverRequest { rig, what })
}

/// Place of a right click in the viewport that was no drag.
fn clicked(ctx: &egui::Context, area: Rect) -> Option<Pos2> {
    let (is_clicked, at) = ctx.input(|input| (input.pointer.secondary_clicked(), input.pointer.interact_pos()));
    let at = at.filter(|at| is_clicked && area.contains(*at))?;
    let layer = ctx.layer_id_at(at);
    layer.is_none_or(|layer| layer.order == Order::Background).then_some(at)
}

/// Draws the entries; true if one was chosen.
fn entries(ui: &mut Ui, world: &World, open: &OpenMenu, requests: &mut Requests) -> bool {
    ui.set_min_width(170.0);
    let (rig, node) = (open.rig, open.node);
    let Some(document) = world.get::<Rig>(rig) else { return true };
    let built = world.get::<BuildResult>(rig).map(|built| &*built.0);
    let runtime = world.get::<RigRuntime>(rig);
    ui.strong(name_of(document, built, node));
    let mut is_chosen = false;
    if let (Some(built), Some(runtime)) = (built, runtime) {
        is_chosen |= switches(ui, world, built, runtime.state(), (rig, node), requests);
    }
    ui.separator();
    let mut entry = |ui: &mut Ui, text: &str, why_not: Option<&str>| {
        let response = ui.add_enabled(why_not.is_none(), Button::new(text).frame(false));
        let clicked = response.clicked();
        if let Some(why_not) = why_not {
            response.on_disabled_hover_text(why_not);
        }
        is_chosen |= clicked;
        clicked
    };
    let edit = |operation| EditRequest::operation(rig, operation);
    if let Some(posed) = PosedRig::of(world, rig) {
        if entry(ui, "Reset pose", (!posed.is_posed(node)).then_some("it is not posed")) {
            requests.send(edit(posed.reset(false)));
        }
        let mirror = posed.mirror_selected();
        let why_not = mirror.is_none().then_some("it has no other side");
        if entry(ui, "Mirror pose to the other side", why_not)
            && let Some(operation) = mirror
        {
            requests.send(edit(operation));
        }
    }
    if entry(ui, TimelineAction::Key.name(), obstacle(world, TimelineAction::Key)) {
        requests.send(ActionRequest(Action::Timeline(TimelineAction::Key)));
    }
    let command = built.and_then(|built| built.node(node)?.origin.as_ref()).map(|origin| origin.command);
    if let Some(command) = command
        && entry(ui, "Show the command that made it", None)
        && let Some(shown) = DisplayedRig::of(world)
    {
        show_tag(world, &shown, command, requests);
    }
    ui.separator();
    let sets: Vec<_> = document.selection_sets().iter().filter(|set| set.nodes.contains(&node)).collect();
    for set in sets {
        if entry(ui, &format!("Select {}", set.name), None) {
            requests.send(recall(rig, set, false));
        }
    }
    let selected = world.get::<Selection>(rig).map(|selection| selection.0.clone()).unwrap_or_default();
    if entry(ui, "Store selection as a set", selected.is_empty().then_some("nothing is selected")) {
        let set = document.with_selection_set(&free_name(document), selected);
        requests.send(edit(Operation::Named { name: "Store selection set", edits: vec![set] }));
    }
    is_chosen
}

/// Draws the switches that concern a node of a rig, each with its values, for the pose and over the range of the open clip; true
/// if one was thrown.
pub(super) fn switches(
    ui: &mut Ui,
    world: &World,
    built: &BuiltRig,
    state: &RigState,
    (rig, node): (Entity, Uid),
    requests: &mut Requests,
) -> bool {
    let mut is_thrown = false;
    let clip = OpenClip::of(world).filter(|clip| clip.entity == rig).zip(world.get_resource::<Timeline>());
    for switch in built.switches.iter().filter(|switch| concerns(built, switch, node)) {
        let Some(node) = built.node(switch.control) else { continue };
        let value = state.attribute(switch.control, &switch.attribute).unwrap_or_default();
        let title = match switch.matching {
            Matching::IkFk { .. } => "Kinematics",
            Matching::Space { .. } => "Space",
        };
        ui.weak(format!("{title} ({} {})", node.name, switch.attribute));
        ui.horizontal_wrapped(|ui| {
            for (number, name) in values_of(node, switch).iter().enumerate() {
                let is_on = (value - number as f32).abs() < 0.5;
                let button = ui.selectable_label(is_on, name).on_hover_text("Everything stays where it is");
                if button.clicked() {
                    is_thrown = true;
                    if !is_on {
                        let (control, attribute) = (switch.control, switch.attribute.to_string());
                        requests.send(SwitchRequest { rig, control, attribute, value: number as f32 });
                    }
                }
            }
        });
        let Some((clip, timeline)) = &clip else { continue };
        let [from, to] = range(clip, timeline).map(|time| (time * clip.clip.frame_rate).round());
        ui.horizontal_wrapped(|ui| {
            for (number, name) in values_of(node, switch).iter().enumerate() {
                let button = ui.button(format!("{name}, frames {from} to {to}"));
                if button.on_hover_text("Sets keys so that everything moves as before").clicked() {
                    is_thrown = true;
                    requests.send(requested(clip, timeline, switch, number as f32));
                }
            }
        });
    }
    is_thrown
}

/// True if a switch moves a node, or is set on it.
pub(super) fn concerns(built: &BuiltRig, switch: &SwitchData, node: Uid) -> bool {
    // Goals hang below the controls that people move.
    let carries = |below: Uid| {
        let index = built.nodes.iter().position(|known| known.uid == below);
        let above = std::iter::successors(index, |at| built.nodes[*at].parent);
        let nearest = above.into_iter().find(|at| built.nodes[*at].control.is_some());
        nearest.is_some_and(|at| built.nodes[at].uid == node)
    };
    let of_matching = match &switch.matching {
        Matching::Space { control } => *control == node,
        Matching::IkFk { joints, fk, goal, pole, .. } => {
            joints.contains(&node) || fk.contains(&node) || carries(*goal) || pole.is_some_and(carries)
        }
    };
    switch.control == node || of_matching
}

fn name_of(rig: &Rig, built: Option<&BuiltRig>, node: Uid) -> String {
    match (rig.joint(node), built.and_then(|built| built.node(node))) {
        (None, Some(created)) => created.name.to_string(),
        (Some(joint), _) => super::joint_name(&joint.data).into_owned(),
        (None, None) => node.to_string(),
    }
}
