//! A stroke under the pressed button.

use std::sync::Arc;

use bevy::prelude::*;

use super::{
    PaintMeshes, PaintObstacle, PointedPlace,
    brush::{PaintBrush, mode_of},
};
use crate::{
    algo::paint::{Canvas, Mirror, PaintStroke},
    editor::{pointer::ModifierKeys, tools::scene::EditedRig},
    plugins::{
        document::Change,
        painting::{locks, opposite_of, paintable, stroke_edit},
        viewport::Sight,
    },
    rig::{SkinData, Uid, joint_numbers},
};

/// A stroke that is being painted on one mesh; over others it pauses.
pub(super) struct RunningStroke {
    /// The rig.
    pub rig: Entity,
    mesh: Entity,
    uid: Uid,
    /// Weights before the stroke, and joints that it adds to them.
    before: Arc<SkinData>,
    added: Vec<(Uid, Option<Uid>)>,
    canvas: Arc<Canvas>,
    stroke: PaintStroke,
    /// Plane of the mirror images, if the stroke has any.
    mirror: Option<Mirror>,
    /// Pixel of the last dab.
    last: Vec2,
}

/// Distance of dabs, as a share of the radius.
const SPACING: f32 = 0.25;
/// Largest number of dabs between two positions of the pointer.
const MOST_DABS: f32 = 48.0;

impl RunningStroke {
    /// The reason why a stroke that begins at a place would paint nothing.
    pub fn obstacle(
        rig: &EditedRig,
        meshes: &PaintMeshes,
        place: &PointedPlace,
        brush: &PaintBrush,
    ) -> Option<PaintObstacle> {
        Self::at(rig, meshes, place, brush, ModifierKeys::default()).err()
    }

    /// Begins a stroke with a press at a pixel.
    pub fn begin(
        rig: &EditedRig,
        meshes: &PaintMeshes,
        sight: &Sight,
        at: Vec2,
        held: ModifierKeys,
        brush: &PaintBrush,
    ) -> Result<Self, PaintObstacle> {
        let place = meshes.at(rig, sight, at)?;
        let mut stroke = Self::at(rig, meshes, &place, brush, held)?;
        stroke.last = at;
        stroke.dab(&place);
        Ok(stroke)
    }

    fn at(
        rig: &EditedRig,
        meshes: &PaintMeshes,
        place: &PointedPlace,
        brush: &PaintBrush,
        held: ModifierKeys,
    ) -> Result<Self, PaintObstacle> {
        let before = rig.rig.skin(place.uid).ok_or(PaintObstacle::NoWeights)?.clone();
        let canvas = meshes.canvas(place.mesh).ok_or(PaintObstacle::Preparing)?.clone();
        let mut sized = brush.of_size(rig.size());
        sized.mode = mode_of(sized.mode, held);
        let built = rig.built.map(|built| &*built.0);
        let plane = rig.symmetry.0;
        let mut joints = Vec::new();
        if !(sized.all_joints && sized.mode.is_relative()) {
            let active = rig.selection.active().ok_or(PaintObstacle::NoJoint)?;
            let joint = paintable(&rig.rig, built, active)?;
            joints.push((joint.uid, joint.subject));
            if locks(&rig.rig, joints.iter().copied())[0] {
                return Err(PaintObstacle::Locked(rig.name(active)));
            }
            let partner = plane.and_then(|plane| opposite_of(&rig.rig, built, joint, &plane));
            joints.extend(partner.map(|partner| (partner.uid, partner.subject)));
        }
        let has_sides = joints.len() != 1;
        let (numbers, added) = joint_numbers(&before, &joints);
        let known = before.joints.iter().map(|joint| (*joint, before.subjects.get(joint).copied()));
        let locked = locks(&rig.rig, known.chain(added.iter().copied()));
        let stroke = PaintStroke::new(sized, numbers.first().copied(), numbers.get(1).copied(), locked, brush.most)?;
        Ok(Self {
            rig: rig.entity,
            mesh: place.mesh,
            uid: place.uid,
            before,
            added,
            canvas,
            stroke,
            mirror: plane.filter(|_| has_sides).map(|plane| Mirror { point: plane.point, normal: plane.normal }),
            last: Vec2::ZERO,
        })
    }

    /// Paints along a line from the last pixel to another one.
    pub fn line_to(&mut self, rig: &EditedRig, meshes: &PaintMeshes, sight: &Sight, to: Vec2) {
        let pixel = match meshes.at(rig, sight, to) {
            Ok(place) => sight.pixel_at(place.place),
            Err(_) => sight.pixel,
        };
        let step = (SPACING * self.stroke.brush().radius / pixel.max(f32::MIN_POSITIVE)).max(2.0);
        let from = self.last;
        let count = (from.distance(to) / step).floor().min(MOST_DABS);
        for number in 1..=count as usize {
            let at = from + (to - from) * (number as f32 / count);
            if let Ok(place) = meshes.at(rig, sight, at) {
                self.dab(&place);
            }
            self.last = at;
        }
    }

    fn dab(&mut self, place: &PointedPlace) {
        if place.mesh != self.mesh {
            return;
        }
        let Some(spot) = self.canvas.spot(place.triangle, place.barycentric) else { return };
        self.stroke.dab(&self.canvas, &self.before.weights, &spot, self.mirror.as_ref());
    }

    /// The preview of the stroke as far as it has gone.
    pub fn preview(&self) -> Change {
        match stroke_edit(self.uid, &self.before, &self.added, &self.stroke) {
            Some(operation) => Change::Preview(operation),
            None => Change::CancelPreview,
        }
    }
}
