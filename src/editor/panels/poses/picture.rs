//! Pictures of stored poses: the skeleton from the front, as lines. They follow from rig and pose alone, and are made once.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_egui::egui::{self, Painter, Stroke, pos2};

use crate::{
    editor::skeleton_lines::bones,
    plugins::runtime::RigRuntime,
    rig::{Revision, Rig, StoredPose, Uid, operations::WholePose},
    solve::program::ContentHash,
};

/// Share of a picture that stays free on each side.
const MARGIN: f32 = 0.08;

/// Pictures that were made, by pose.
#[derive(Default)]
pub(super) struct Pictures {
    made: BTreeMap<Uid, Picture>,
    revision: Option<Revision>,
    program: Option<ContentHash>,
    rig: Option<Entity>,
}

/// Lines in a unit square, y down, and the pose that they were made from.
struct Picture {
    pose: WholePose,
    lines: Vec<[Vec2; 2]>,
}

impl Pictures {
    /// Forgets the pictures of another rig, or of a rig that has changed in more than poses.
    pub fn refresh(&mut self, world: &World, entity: Entity, rig: &Rig) {
        let program = world.get::<RigRuntime>(entity).map(|runtime| runtime.state().hash());
        let is_same = self.rig == Some(entity)
            && self.program == program
            && self.revision.as_ref().is_some_and(|known| known.is_same(rig.revision()));
        if !is_same {
            self.made.clear();
            (self.rig, self.program, self.revision) = (Some(entity), program, Some(rig.revision().clone()));
        }
        self.made.retain(|pose, _| rig.stored_pose(*pose).is_some());
    }

    /// Lines of a stored pose in a unit square.
    pub fn lines(&mut self, world: &World, entity: Entity, rig: &Rig, pose: &StoredPose) -> &[[Vec2; 2]] {
        let is_made = self
            .made
            .get(&pose.uid)
            .is_some_and(|made| made.pose.offsets == pose.offsets && made.pose.values == pose.values);
        if !is_made {
            let pose_of = WholePose::from(pose);
            let lines = fitted(&bones(rig, world.get::<RigRuntime>(entity), &pose_of));
            self.made.insert(pose.uid, Picture { pose: pose_of, lines });
        }
        self.made.get(&pose.uid).map_or(&[], |made| &made.lines)
    }
}

/// Lines as seen from the front, in a unit square with a margin, proportions kept.
fn fitted(bones: &[[Vec3; 2]]) -> Vec<[Vec2; 2]> {
    let seen = |place: Vec3| Vec2::new(place.x, -place.y);
    let points = || bones.iter().flatten().map(|place| seen(*place)).filter(|place| place.is_finite());
    let low = points().fold(Vec2::INFINITY, Vec2::min);
    let high = points().fold(Vec2::NEG_INFINITY, Vec2::max);
    let size = (high - low).max_element();
    if !size.is_finite() {
        return Vec::new();
    }
    let scale = if size > 0.0 { (1.0 - 2.0 * MARGIN) / size } else { 0.0 };
    let centre = (low + high) * 0.5;
    bones.iter().map(|ends| ends.map(|end| (seen(end) - centre) * scale + Vec2::splat(0.5))).collect()
}

/// Paints lines of a unit square into a rectangle.
pub(super) fn paint(painter: &Painter, rect: egui::Rect, lines: &[[Vec2; 2]], ground: egui::Color32, stroke: Stroke) {
    painter.rect_filled(rect, 3.0, ground);
    let place = |at: Vec2| pos2(rect.left() + at.x * rect.width(), rect.top() + at.y * rect.height());
    for [a, b] in lines {
        if a == b {
            painter.circle_filled(place(*a), 1.5, stroke.color);
        } else {
            painter.line_segment([place(*a), place(*b)], stroke);
        }
    }
}
