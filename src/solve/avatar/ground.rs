//! The ground below the feet of a figure.

use crate::{mesh::model::Model, rig::vrm::HumanNodes};

/// Share of the figure's height by which soles may be off the ground.
const NEAR: f32 = 2e-3;

/// Height of the soles at rest, where they are not on the ground; `None` for soles on the ground and for figures without skin
/// on their feet.
pub(super) fn height(model: &Model, human: &HumanNodes) -> Option<f32> {
    let feet = ["leftFoot", "rightFoot"].map(|bone| human.get(bone));
    let mut is_foot = vec![false; model.nodes.len()];
    for (at, node) in model.nodes.iter().enumerate() {
        is_foot[at] = feet.contains(&Some(at)) || node.parent.is_some_and(|parent| is_foot[parent]);
    }
    let weights = model.weights.as_ref()?;
    let rest = model.at_rest();
    let is_sole = |point: usize| {
        let of_foot = weights.of(point).filter(|(node, _)| is_foot.get(*node as usize).copied().unwrap_or_default());
        of_foot.map(|(_, weight)| weight).sum::<f32>() > 0.5
    };
    let points = 0..weights.len().min(rest.points.len());
    let heights = || rest.points.iter().map(|point| point.y);
    let size = heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min);
    let lowest = points.filter(|point| is_sole(*point)).map(|point| rest.points[point].y).reduce(f32::min)?;
    (lowest.is_finite() && lowest.abs() > NEAR * size).then_some(lowest)
}
