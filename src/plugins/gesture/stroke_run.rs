//! Strokes of runs: where they start among the joints of the rig and those that gestures before them add.
//!
//! A stroke of a given number of joints is a chain, whatever it crosses, and depends on nothing but the joint on which it
//! starts. A grid on the view plane finds that joint without a look at all others. Entities of joints that were just added
//! stand where their chains have them but for rounding, so that a start is only decided where rounding decides nothing.

use std::collections::HashMap;

use bevy::prelude::*;

use super::{
    GestureScript,
    click_run::{ChainAnswer, RunRig},
};
use crate::{
    algo::view::ViewPlane,
    plugins::{
        document::{ChainParent, Change},
        stroke::{StrokeFailure, StrokeRequest, followed_chain},
    },
    rig::Rig,
};

/// Largest difference, as a share of the model's size, between the place of a joint in its chain and that of its entity.
const MARGIN: f32 = 2e-5;
/// Furthest cell of the grid in which starts are looked for.
const FURTHEST: f32 = 1e6;

/// Joint on which a stroke starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StrokeStart {
    /// Place apart from all joints.
    Free,
    /// Joint of the rig, or of a chain that is drawn before.
    On(ChainParent),
}

/// Joints of a rig, and those that the requests of a run add to it.
#[derive(Default)]
pub(super) struct RunJoints {
    joints: Vec<(ChainParent, Vec3)>,
    /// True if the joints that the rig had before the run are among them.
    is_listed: bool,
    /// Number of requests that add joints.
    requests: usize,
    grid: Option<JointGrid>,
}

impl RunJoints {
    /// Takes over the joints that a change adds.
    pub(super) fn note(&mut self, change: &Change) {
        let positions = match change {
            Change::Place(position) => std::slice::from_ref(position),
            Change::Draw { positions, .. } => positions.as_slice(),
            _ => return,
        };
        for (joint, position) in positions.iter().enumerate() {
            self.joints.push((ChainParent::Added { request: self.requests, joint }, *position));
        }
        self.requests += 1;
    }

    /// The joint within `reach` of the first point of a stroke on a view plane of a model of that size; `None` where rounding
    /// could decide it.
    pub(super) fn start(
        &mut self,
        rig: &Rig,
        plane: &ViewPlane,
        size: f32,
        reach: f32,
        points: &[(f32, f32)],
    ) -> Option<StrokeStart> {
        let Some(point) = points.first().map(|point| Vec2::from(*point)) else { return Some(StrokeStart::Free) };
        if !self.is_listed {
            let listed = rig.rest_globals().into_iter();
            self.joints.extend(listed.map(|(uid, global)| (ChainParent::Joint(uid), global.translation)));
            self.is_listed = true;
        }
        let margin = MARGIN * size;
        let radius = reach + margin;
        let kept = self.grid.take().filter(|grid| grid.plane == *plane && 2.0 * radius <= grid.cell);
        let grid = self.grid.insert(kept.unwrap_or_else(|| JointGrid::new(*plane, radius, size)));
        grid.follow(&self.joints);
        if !(point / grid.cell).abs().cmplt(Vec2::splat(FURTHEST)).all() {
            return None;
        }
        let mut nearest: Option<(f32, usize)> = None;
        let mut next = f32::INFINITY;
        for (place, number) in grid.around(point, radius) {
            let distance = place.distance(point);
            match nearest {
                _ if !distance.is_finite() || distance > radius => {}
                Some((least, _)) if distance >= least => next = next.min(distance),
                before => {
                    next = before.map_or(f32::INFINITY, |(least, _)| least);
                    nearest = Some((distance, number));
                }
            }
        }
        match nearest {
            None => Some(StrokeStart::Free),
            Some((distance, number)) if distance + margin <= reach && next - distance > 2.0 * margin => {
                self.joints.get(number).map(|(joint, _)| StrokeStart::On(*joint))
            }
            Some(_) => None,
        }
    }
}

/// Joints on a view plane, by the square cell in which they lie.
struct JointGrid {
    plane: ViewPlane,
    /// Side of a cell, in model units.
    cell: f32,
    cells: HashMap<[i64; 2], Vec<(Vec2, usize)>>,
    /// Number of joints that are in it.
    count: usize,
}

impl JointGrid {
    /// Empty grid for circles of that radius on a model of that size.
    fn new(plane: ViewPlane, radius: f32, size: f32) -> Self {
        let cell = (2.0 * radius).max(1e-3 * size).max(f32::MIN_POSITIVE);
        Self { plane, cell, cells: HashMap::new(), count: 0 }
    }

    /// Takes over the joints that were added since the last call.
    fn follow(&mut self, joints: &[(ChainParent, Vec3)]) {
        for (number, (_, position)) in joints.iter().enumerate().skip(self.count) {
            if let Some(place) = self.plane.project(*position) {
                let cell = self.cell_of(place);
                self.cells.entry(cell).or_default().push((place, number));
            }
        }
        self.count = joints.len();
    }

    fn cell_of(&self, place: Vec2) -> [i64; 2] {
        (place / self.cell).floor().to_array().map(|at| at as i64)
    }

    /// Joints in the cells that a circle touches, with their numbers.
    fn around(&self, point: Vec2, radius: f32) -> impl Iterator<Item = (Vec2, usize)> {
        let [low, high] = [self.cell_of(point - radius), self.cell_of(point + radius)];
        let cells = (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]));
        cells.filter_map(move |cell| self.cells.get(&cell)).flatten().copied()
    }
}

impl GestureScript {
    /// Change that draws the chain of a stroke, and what its answer says; `None` if it has no effect, which is its answer.
    pub(super) fn drawn_chain(
        &mut self,
        request: &StrokeRequest,
        start: StrokeStart,
        run: &RunRig,
    ) -> Option<(Change, ChainAnswer)> {
        let chain = match followed_chain(request, run.surface?, None) {
            Ok(chain) => chain,
            Err(error) => {
                self.fail(&StrokeFailure::from(error).into());
                return None;
            }
        };
        // A stroke that starts on a joint continues from it: that joint is the chain's first.
        let (parent, skip) = match start {
            StrokeStart::Free => (ChainParent::Active, 0),
            StrokeStart::On(joint) => (joint, 1),
        };
        let to_rest = run.rig.rest_from_pose(None);
        let drawn = chain.joints.iter().skip(skip);
        let positions: Vec<Vec3> = drawn.map(|joint| to_rest.transform_point3(joint.position)).collect();
        if positions.is_empty() {
            self.fail(&StrokeFailure::TooShort.into());
            return None;
        }
        Some((Change::Draw { positions, parent }, ChainAnswer { joints: chain.joints.len(), notes: chain.notes }))
    }
}
