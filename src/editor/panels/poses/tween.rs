//! Tween: a slider that brings the shown pose towards a stored one, or towards a neighbouring key of the open clip. A drag
//! previews, the release makes one step.

use bevy::prelude::*;
use bevy_egui::egui::{ComboBox, Key, Slider, Ui, WidgetInfo, WidgetType};

use super::pose_view::PosedRig;
use crate::{
    editor::{
        panel::Requests,
        panels::timeline::{OpenClip, key_times},
    },
    plugins::document::{Change, EditRequest, Selection},
    rig::{
        Uid,
        operations::{Operation, WholePose},
    },
};

/// Pose that a tween goes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TweenTarget {
    /// A stored pose.
    Pose(Uid),
    /// The key before the playhead.
    KeyBefore,
    /// The key behind the playhead.
    KeyAfter,
}

/// State of the slider.
#[derive(Default)]
pub(super) struct Tween {
    pub target: Option<TweenTarget>,
    /// True to change the selected nodes alone.
    selected_only: bool,
    drag: Option<TweenDrag>,
}

/// Slider that is being dragged, with the poses of its ends.
struct TweenDrag {
    from: WholePose,
    to: WholePose,
    /// Share in percent.
    share: f32,
    /// Marks a drag that Escape has ended; the button is still down.
    is_dropped: bool,
}

const NAME: &str = "Tween pose";

impl Tween {
    /// Draws the choice of the target and the slider.
    pub fn show(&mut self, ui: &mut Ui, world: &World, posed: &PosedRig, requests: &mut Requests) {
        let open = OpenClip::of(world);
        let stored = posed.rig.stored_poses();
        if self.target.is_some_and(|target| match target {
            TweenTarget::Pose(pose) => posed.rig.stored_pose(pose).is_none(),
            TweenTarget::KeyBefore | TweenTarget::KeyAfter => open.is_none(),
        }) {
            self.target = None;
        }
        if stored.is_empty() && open.is_none() {
            return;
        }
        self.choice(ui, posed, open.is_some());
        let ends = self.target.and_then(|target| goal(world, posed, open.as_ref(), target));
        let can_start = ends.is_some() && (!self.selected_only || !posed.meant().is_empty());
        let mut share = self.drag.as_ref().map_or(0.0, |drag| drag.share);
        let response = ui
            .scope(|ui| {
                ui.spacing_mut().slider_width = (ui.available_width() - 48.0).max(40.0);
                ui.horizontal(|ui| {
                    let slider = Slider::new(&mut share, 0.0..=100.0).show_value(false);
                    let response = ui.add_enabled(can_start || self.drag.is_some(), slider);
                    ui.weak(format!("{share:.0} %"));
                    response
                })
                .inner
            })
            .inner;
        ui.ctx().accesskit_node_builder(response.id, |node| node.set_label("Tween"));
        let response = match (self.target, can_start) {
            (None, _) => response.on_disabled_hover_text("Choose a pose to go to above, or click one below"),
            (Some(_), false) if self.selected_only => response.on_disabled_hover_text("Nothing is selected"),
            (Some(_), false) => response.on_disabled_hover_text("There is no key there"),
            _ => response.on_hover_text("Drag towards the pose; the release makes one step"),
        };
        let edit = |change| EditRequest { rig: posed.entity, change };
        if self.drag.is_none()
            && response.changed()
            && let Some(to) = ends
        {
            self.drag = Some(TweenDrag { from: posed.shown.clone(), to, share, is_dropped: false });
        }
        let is_meant = self.selected_only.then(|| posed.meant());
        let built = posed.built;
        let operation = |drag: &TweenDrag| -> Operation {
            let mixed = drag.from.towards(&drag.to, drag.share / 100.0, built);
            drag.from.change_to(&mixed, is_meant.as_ref(), NAME)
        };
        let Some(drag) = &mut self.drag else { return };
        if !drag.is_dropped && ui.input(|input| input.key_pressed(Key::Escape)) {
            drag.is_dropped = true;
            requests.send(edit(Change::CancelPreview));
        }
        let is_held = response.dragged() || response.is_pointer_button_down_on();
        if response.changed() && !drag.is_dropped {
            drag.share = share;
            let change = if is_held { Change::Preview(operation(drag)) } else { Change::Do(operation(drag)) };
            requests.send(edit(change));
        }
        if !is_held {
            if !drag.is_dropped && response.drag_stopped() {
                requests.send(edit(if drag.share > 0.0 { Change::Commit } else { Change::CancelPreview }));
            }
            self.drag = None;
        }
    }

    /// The pose to go to, and whether all nodes go there.
    fn choice(&mut self, ui: &mut Ui, posed: &PosedRig, has_clip: bool) {
        let name = |target: TweenTarget| match target {
            TweenTarget::Pose(pose) => posed.rig.stored_pose(pose).map_or("", |pose| pose.name.as_str()),
            TweenTarget::KeyBefore => "Key before",
            TweenTarget::KeyAfter => "Key after",
        };
        ui.horizontal(|ui| {
            let width = (ui.available_width() - 78.0).max(60.0);
            let combo = ComboBox::from_id_salt("tween").width(width).truncate();
            let combo = combo.selected_text(self.target.map_or("Tween to…", name));
            let stored = posed.rig.stored_poses().iter().map(|pose| TweenTarget::Pose(pose.uid));
            let keys = [TweenTarget::KeyBefore, TweenTarget::KeyAfter].into_iter().filter(|_| has_clip);
            let response = combo.show_ui(ui, |ui| {
                for target in keys.chain(stored) {
                    ui.selectable_value(&mut self.target, Some(target), name(target));
                }
            });
            ui.ctx().accesskit_node_builder(response.response.id, |node| node.set_label("Tween to"));
            let on = self.selected_only;
            let switch = ui.selectable_label(on, "Selected").on_hover_text("Only the nodes that are selected");
            switch.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, on, "Tween selected nodes only"));
            if switch.clicked() {
                self.selected_only = !on;
            }
        });
    }
}

/// Pose at the far end of the slider; `None` if there is no key in that direction.
fn goal(world: &World, posed: &PosedRig, open: Option<&OpenClip>, target: TweenTarget) -> Option<WholePose> {
    if let TweenTarget::Pose(pose) = target {
        return posed.rig.stored_pose(pose).map(WholePose::from);
    }
    let open = open?;
    let selected = world.get::<Selection>(open.entity).map_or(&[] as &[Uid], |selection| &selection.0);
    let times = key_times(open.clip, selected);
    let near = 0.01 / open.clip.frame_rate;
    let time = match target {
        TweenTarget::KeyAfter => times.into_iter().find(|time| *time > open.time + near)?,
        _ => times.into_iter().rev().find(|time| *time < open.time - near)?,
    };
    Some(posed.at(open.clip, time))
}
