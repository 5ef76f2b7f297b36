//! The joints that move a mesh, with their colours and locks.

use bevy::{ecs::change_detection::Tick, prelude::*};
use bevy_egui::egui::{
    Align, Checkbox, Color32, CornerRadius, Layout, Rect, Sense, Ui, UiBuilder, WidgetInfo, WidgetType, vec2,
};

use super::in_area;
use crate::{
    editor::{
        panel::Requests,
        panels::{
            displayed_rig::{self, DisplayedRig, Stamp},
            list::{self, List},
        },
    },
    plugins::{
        commands::BuildResult,
        display::joint_color,
        document::EditRequest,
        picking::{Pick, PickRequest},
        surface::RigMesh,
    },
    rig::{NodeKind, NodeType, SkinData, Uid, operations::Operation},
};

/// List of joints.
#[derive(Default)]
pub(super) struct JointList {
    made_from: Option<(Stamp, Option<Tick>)>,
    joints: Vec<ListedJoint>,
    filter: String,
    /// Joint that was last scrolled into view.
    revealed: Option<Uid>,
}

/// Joint of the list.
#[derive(Debug, Clone)]
struct ListedJoint {
    uid: Uid,
    name: String,
    /// True for joints of the document, which have a lock of their own.
    has_lock: bool,
    is_locked: bool,
}

/// Rows that are seen at once.
const ROWS: usize = 8;

impl JointList {
    pub fn show(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, mesh: &RigMesh, requests: &mut Requests) {
        self.refresh(world, shown);
        let skin = shown.rig.skin(mesh.uid);
        list::search_bar(ui, "Find joint", "Part of a joint's name", &mut self.filter, |_| {});
        let words = self.filter.trim().to_lowercase();
        let found: Vec<&ListedJoint> =
            self.joints.iter().filter(|joint| joint.name.to_lowercase().contains(&words)).collect();
        if found.is_empty() {
            ui.weak(if self.joints.is_empty() { "There are no joints yet." } else { "No joint is called so." });
            return;
        }
        let active = shown.selection.active();
        let reveal = active.filter(|active| self.revealed != Some(*active));
        let reveal = reveal.and_then(|active| found.iter().position(|joint| joint.uid == active));
        self.revealed = active;
        let height = list::row_height(ui);
        let rows = found.len().min(ROWS) as f32;
        in_area(ui, "joints", rows * height, |ui| {
            let list = List { id: "joints", count: found.len(), height, reveal, follow: false };
            list.show(ui, |ui, range, row| {
                for number in range {
                    draw(ui, row(number), found[number], active, skin.map(|skin| &**skin), shown, requests);
                }
            });
        });
    }

    /// Lists the joints again after a change of the rig.
    fn refresh(&mut self, world: &World, shown: &DisplayedRig) {
        let built = world.get_entity(shown.entity).ok().and_then(|rig| rig.get_ref::<BuildResult>());
        let key = (shown.stamp(), built.as_ref().map(|built| built.last_changed()));
        if self.made_from == Some(key) {
            return;
        }
        let own = shown.rig.walk().filter(|joint| joint.data.kind == NodeKind::Joint);
        let mut joints: Vec<ListedJoint> = own
            .map(|joint| ListedJoint {
                uid: joint.data.uid,
                name: shown.name(joint.data.uid).into_owned(),
                has_lock: true,
                is_locked: joint.data.locked,
            })
            .collect();
        let nodes = built.iter().flat_map(|built| &built.0.nodes).filter(|node| node.kind == NodeType::Joint);
        joints.extend(nodes.filter_map(|node| {
            let subject = node.origin.as_ref()?.subject;
            let is_locked = shown.rig.joint(subject).is_some_and(|joint| joint.data.locked);
            Some(ListedJoint { uid: node.uid, name: node.name.to_string(), has_lock: false, is_locked })
        }));
        self.joints = joints;
        self.made_from = Some(key);
    }
}

/// Draws a row: the colour of the joint, its name and its lock.
fn draw(
    ui: &mut Ui,
    rect: Rect,
    joint: &ListedJoint,
    active: Option<Uid>,
    skin: Option<&SkinData>,
    shown: &DisplayedRig,
    requests: &mut Requests,
) {
    let layout = Layout::left_to_right(Align::Center);
    let mut ui = ui.new_child(UiBuilder::new().id_salt(joint.uid).max_rect(rect).layout(layout));
    ui.spacing_mut().item_spacing.x = 4.0;
    let (swatch, response) = ui.allocate_exact_size(vec2(12.0, 12.0), Sense::hover());
    match skin.and_then(|skin| skin.joints.iter().position(|other| *other == joint.uid)) {
        Some(number) => {
            ui.painter().rect_filled(swatch, CornerRadius::same(2), color(number));
            response.on_hover_text("Colour of the joint among the colours of all joints");
        }
        None => drop(response.on_hover_text("The joint moves no point of the mesh")),
    }
    let mut is_locked = joint.is_locked;
    let field = ui.add_enabled(joint.has_lock, Checkbox::without_text(&mut is_locked));
    let said = format!("Lock weights of {}", joint.name);
    field.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, joint.has_lock, is_locked, &said));
    let tip = if joint.has_lock { "Locked: its weights stay" } else { "Locked with the joint that it was made for" };
    if field.on_hover_text(tip).on_disabled_hover_text(tip).clicked() {
        let operation = Operation::Lock(vec![joint.uid], is_locked);
        requests.send(EditRequest::operation(shown.entity, operation));
    }
    let label = ui.selectable_label(active == Some(joint.uid), &joint.name);
    if label.clicked() {
        requests.send(PickRequest { rig: shown.entity, what: Pick::Joints(vec![joint.uid]), add: false });
    }
}

/// Colour of a joint by its place in the weights.
fn color(number: usize) -> Color32 {
    let color = joint_color(number).to_srgba();
    displayed_rig::color([color.red, color.green, color.blue])
}
