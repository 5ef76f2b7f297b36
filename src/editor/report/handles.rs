//! Handles of controls: pixels at which a press takes a control and nothing else, for programs that aim a mouse.

use std::collections::BTreeMap;

use bevy::{ecs::system::SystemParam, platform::collections::HashMap, prelude::*};

use crate::{
    plugins::{
        commands::BuildResult,
        controls::{
            ControlsInUse,
            outline::{ControlNodes, ControlOutline},
        },
        schema::RigNodes,
        viewport::Sight,
    },
    rig::{LayerDisplay, Uid},
};

/// Side of the squares in which outlines are told apart, in pixels.
const CELL: f32 = 4.0;
/// Distance of samples along an outline, in pixels.
const STEP: f32 = 2.0;
/// Largest number of samples of one straight piece of an outline.
const MOST_SAMPLES: usize = 1000;

/// Controls of rigs, as far as they are drawn, and the names of built nodes.
#[derive(SystemParam)]
pub(super) struct ControlHandles<'w, 's> {
    rigs: Query<'w, 's, (&'static RigNodes, &'static GlobalTransform, &'static BuildResult)>,
    nodes: ControlNodes<'w, 's>,
    in_use: Res<'w, ControlsInUse>,
}

impl ControlHandles<'_, '_> {
    /// Name of a node that a command made.
    pub fn name(&self, rig: Entity, node: Uid) -> Option<String> {
        let (_, _, built) = self.rigs.get(rig).ok()?;
        built.0.node(node).map(|node| node.name.to_string())
    }

    /// Handles by the names of controls, in pixels of the viewport. A control whose outline runs along those of others, or
    /// outside of the viewport, has none.
    pub fn pixels(&self, rig: Entity, sight: &Sight) -> BTreeMap<String, Vec2> {
        let Ok((nodes, place, built)) = self.rigs.get(rig) else { return BTreeMap::new() };
        if !self.in_use.0 {
            return BTreeMap::new();
        }
        let mut controls = self.nodes.visible(Some(nodes), place.affine().inverse());
        controls.retain(|control| control.display == LayerDisplay::Normal);
        let samples: Vec<Vec<Vec2>> = controls.iter().map(|control| samples(control, sight)).collect();
        let named = controls.iter().zip(lone_samples(&samples));
        named.filter_map(|(control, at)| Some((built.0.node(control.uid)?.name.to_string(), at?))).collect()
    }
}

/// Pixels along the outline of a control, as far as they are in the viewport.
fn samples(control: &ControlOutline, sight: &Sight) -> Vec<Vec2> {
    let mut found = Vec::new();
    for ends in control.lines.iter().flat_map(|line| line.windows(2)) {
        let (Some(a), Some(b)) = (sight.project(ends[0]), sight.project(ends[1])) else { continue };
        let count = ((a.distance(b) / STEP).ceil() as usize).clamp(1, MOST_SAMPLES);
        found.extend((0..=count).map(|number| a.lerp(b, number as f32 / count as f32)));
    }
    let edge = Vec2::splat(CELL);
    found.retain(|at| at.cmpge(edge).all() && at.cmple(sight.size - edge).all());
    found
}

/// The first sample of each outline that no other outline comes near.
fn lone_samples(outlines: &[Vec<Vec2>]) -> Vec<Option<Vec2>> {
    let cell = |at: Vec2| (at / CELL).floor().as_ivec2();
    // The outline that passes a square; `None` where several do.
    let mut owners: HashMap<IVec2, Option<usize>> = HashMap::default();
    for (number, points) in outlines.iter().enumerate() {
        for at in points {
            let owner = owners.entry(cell(*at)).or_insert(Some(number));
            if *owner != Some(number) {
                *owner = None;
            }
        }
    }
    let is_alone = |number: usize, at: Vec2| {
        let middle = cell(at);
        let mut around = (-1..=1).flat_map(|x| (-1..=1).map(move |y| middle + IVec2::new(x, y)));
        around.all(|square| owners.get(&square).is_none_or(|owner| *owner == Some(number)))
    };
    let lone = |(number, points): (usize, &Vec<Vec2>)| points.iter().copied().find(|at| is_alone(number, *at));
    outlines.iter().enumerate().map(lone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(from: Vec2, to: Vec2) -> Vec<Vec2> {
        (0..=50).map(|number| from.lerp(to, number as f32 / 50.0)).collect()
    }

    #[test]
    fn handles_are_away_from_other_outlines() {
        let across = line(Vec2::new(10.0, 50.0), Vec2::new(110.0, 50.0));
        let down = line(Vec2::new(12.0, 45.0), Vec2::new(12.0, 145.0));
        let outlines = [across.clone(), down];
        let found = lone_samples(&outlines);
        for (number, other) in [(0, 1), (1, 0)] {
            let at = found[number].unwrap();
            assert!(outlines[number].contains(&at));
            assert!(outlines[other].iter().all(|point| point.distance(at) >= CELL), "{at} is near the other outline");
        }
        assert_eq!(lone_samples(&[across.clone(), across]), [None, None]);
    }
}
