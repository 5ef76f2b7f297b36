//! Templates and modules that are dragged from their lists onto a joint in the viewport.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, DragAndDrop, FontId, Stroke};

use super::{DraggedModule, DraggedTemplate, LibraryAct, LibraryRequest, PartSides, TemplateLibrary, partner};
use crate::{
    editor::{
        ActiveRig,
        camera::ViewportSight,
        notice::Notice,
        panel::{Requests, ViewportPainter},
        panels::joint_name,
        style,
    },
    plugins::document::{EditRequest, JointEntities},
    rig::{
        Rig, TagKind, Uid,
        operations::{Operation, TagOperation},
    },
};

/// Distance in points up to which a joint is meant.
const REACH: f32 = 48.0;

/// Mark of the joint under a dragged template or module; it takes that when it is let go.
pub(super) struct DropTarget;

/// The joint nearest to a place in the viewport, and where it is.
fn nearest(world: &World, at: Vec2) -> Option<(Uid, Vec2)> {
    let active = world.get_resource::<ActiveRig>()?.0;
    let sight = world.get_resource::<ViewportSight>()?.0?;
    let (rig, entities) = (world.get::<Rig>(active)?, world.get::<JointEntities>(active)?);
    let to_rig = world.get::<GlobalTransform>(active).copied().unwrap_or_default().affine().inverse();
    let seen = rig.walk().filter_map(|joint| {
        let place = world.get::<GlobalTransform>(entities.get(joint.data.uid)?)?.translation();
        Some((joint.data.uid, sight.project(to_rig.transform_point3(place))?))
    });
    let near = seen.filter(|(_, place)| place.distance(at) <= REACH);
    near.min_by(|a, b| a.1.distance(at).total_cmp(&b.1.distance(at)))
}

/// True if a dragged template is a part that goes onto both sides.
pub(in crate::editor) fn goes_onto_both(world: &World, dragged: &DraggedTemplate) -> bool {
    let listing = world.get_resource::<TemplateLibrary>().map(TemplateLibrary::listing);
    let listed = listing.and_then(|listing| listing.find(&dragged.place));
    PartSides::are_both(world) && listed.is_some_and(|listed| listed.is_part())
}

/// Effect of a drop on a joint, in words; `both` for a part that goes onto the joint's partner, too.
pub(in crate::editor) fn dropping(rig: &Rig, dragged: &DraggedTemplate, joint: Uid, both: bool) -> String {
    let name = |joint: Uid| rig.joint(joint).map(|joint| joint_name(&joint.data).into_owned()).unwrap_or_default();
    let other = partner(rig, joint).filter(|_| both);
    let also = other.map_or_else(String::new, |other| format!(" and {}", name(other)));
    format!("{} onto {}{also}", dragged.name, name(joint))
}

fn pointer(ctx: &egui::Context, area: egui::Rect) -> Option<Vec2> {
    let at = ctx.input(|input| input.pointer.latest_pos()).filter(|at| area.contains(*at))?;
    Some(Vec2::new(at.x - area.min.x, at.y - area.min.y))
}

/// Request that gives a joint a command of a module.
pub(in crate::editor) fn attach(rig: Entity, joint: Uid, module: &str) -> EditRequest {
    let kind = TagKind::Command { module: module.to_owned(), feature: None, params: "()".to_owned() };
    EditRequest::operation(rig, Operation::Tags(TagOperation::Add { joints: vec![joint], kind, index: None }))
}

/// Subject of a drag.
enum DragSubject {
    Template(Arc<DraggedTemplate>),
    Module(&'static str),
}

impl DragSubject {
    fn of(ctx: &egui::Context) -> Option<Self> {
        let template = DragAndDrop::payload::<DraggedTemplate>(ctx).map(Self::Template);
        template.or_else(|| DragAndDrop::payload::<DraggedModule>(ctx).map(|module| Self::Module(module.0)))
    }

    fn name(&self) -> &str {
        match self {
            Self::Template(template) => &template.name,
            Self::Module(module) => module,
        }
    }

    /// Effect of a drop on a joint, in words.
    fn dropping(&self, world: &World, rig: &Rig, joint: Uid) -> String {
        match self {
            Self::Template(template) => dropping(rig, template, joint, goes_onto_both(world, template)),
            Self::Module(module) => {
                let name = rig.joint(joint).map(|joint| joint_name(&joint.data)).unwrap_or_default();
                format!("{module} on {name}")
            }
        }
    }
}

impl ViewportPainter for DropTarget {
    fn paint(&mut self, painter: &egui::Painter, area: egui::Rect, world: &World) {
        let Some(dragged) = DragSubject::of(painter.ctx()) else { return };
        let Some(at) = pointer(painter.ctx(), area) else { return };
        let active = world.get_resource::<ActiveRig>().and_then(|active| world.get::<Rig>(active.0));
        let color = style::ACCENT;
        let text = match nearest(world, at) {
            Some((joint, place)) => {
                painter.circle_stroke(area.min + egui::vec2(place.x, place.y), 10.0, Stroke::new(2.0, color));
                active.map_or_else(String::new, |rig| dragged.dropping(world, rig, joint))
            }
            None => format!("{}: drop it on a joint", dragged.name()),
        };
        let beside = area.min + egui::vec2(at.x + 14.0, at.y + 10.0);
        painter.text(beside, Align2::LEFT_TOP, text, FontId::proportional(12.0), color);
    }

    fn widgets(&mut self, ui: &mut egui::Ui, area: egui::Rect, world: &World, requests: &mut Requests) {
        let ctx = ui.ctx();
        if !ctx.input(|input| input.pointer.any_released()) {
            return;
        }
        let (Some(dragged), Some(at)) = (DragSubject::of(ctx), pointer(ctx, area)) else { return };
        let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
        DragAndDrop::clear_payload(ctx);
        match (nearest(world, at), dragged) {
            (Some((joint, _)), DragSubject::Template(template)) => {
                let act = LibraryAct::Drop { joint };
                requests.send(LibraryRequest { place: template.place.clone(), act });
            }
            (Some((joint, _)), DragSubject::Module(module)) => requests.send(attach(rig, joint, module)),
            (None, dragged) => {
                let text = format!("{}: there is no joint; drop it on one", dragged.name());
                requests.send(Notice::warning(text).named());
            }
        }
    }
}
