//! Clicks that pick joints in runs: the joint that a click means among those of a rig at rest.
//!
//! Entities of joints stand where the rig has them at rest but for rounding. Where that could decide anything, the click belongs
//! to no run.

use bevy::prelude::*;

use super::click_run::RunRig;
use crate::{
    algo::{picking::PickTree, view::ViewPlane},
    plugins::surface::RigSurface,
    rig::Uid,
};

/// Largest difference, as a share of the model's size, between the place of a joint in the rig and that of its entity.
const MARGIN: f32 = 2e-5;

/// Joints of a rig that clicks of a run may mean, listed for the first of these.
#[derive(Default)]
pub(super) struct RunPicks {
    listed: Option<(PickTree, Vec<Uid>)>,
}

impl RunPicks {
    /// The joint that a click at a point of a view plane picks; `None` where that is not sure.
    pub(super) fn picked(&mut self, run: &RunRig, plane: &ViewPlane, point: Vec2) -> Option<Uid> {
        let ray = plane.ray(point);
        let hit = run.surface.and_then(RigSurface::ready)?.closest(&ray);
        let (tree, joints) = self.listed.get_or_insert_with(|| {
            let globals = run.rig.rest_globals();
            let tree = PickTree::new(globals.iter().map(|(_, global)| global.translation).collect());
            (tree, globals.into_iter().map(|(joint, _)| joint).collect())
        });
        let [nearest, next] = tree.nearest_two_at(hit.map(|hit| ray.at(hit.distance)), plane, point);
        let (distance, number) = nearest?;
        let margin = MARGIN * (run.bounds[1] - run.bounds[0]).max_element();
        let is_sure = next.is_none_or(|(next, _)| next - distance > 2.0 * margin);
        joints.get(number).copied().filter(|_| is_sure)
    }
}
