//! Strokes of runs: where they start among the joints of the rig and those that gestures before them add.
//!
//! A chain depends on nothing but the joint on which its stroke starts. A grid on the view plane finds that joint without a
//! look at all others. A stroke of a given number of joints is a chain, whatever it crosses. Any other is one unless it is a
//! scribble, or straight and no longer than a bone that it crosses, see [`classify`](crate::algo::stroke::classify). With live
//! mirroring the other side of each joint is among those on which a stroke may start. Entities
//! of joints that were just added stand where their chains have them but for rounding: where that could decide anything, the
//! stroke belongs to no run.

use std::collections::{BTreeMap, HashMap};

use bevy::prelude::*;

use super::{
    GestureScript,
    click_run::{ChainAnswer, RunRig},
};
use crate::{
    algo::{
        stroke::{is_scribble, is_straight},
        view::ViewPlane,
    },
    plugins::{
        document::{ChainParent, Change},
        stroke::{StrokeFailure, StrokeRequest, followed_chain},
    },
    rig::{
        Rig, Uid,
        operations::{MirrorPlane, settle},
    },
};

/// Largest difference, as a share of the model's size, between the place of a joint in its chain and that of its entity.
const MARGIN: f32 = 2e-5;
/// Joints at one place, and equal bones, of which a stroke may meet all or none: two tell that there is no single one.
const ALIKE: usize = 2;
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

/// Joint of a rig, or one that a run adds.
struct RunJoint {
    /// The joint, for chains that hang on it.
    name: ChainParent,
    place: JointPlace,
}

/// Position of a joint, and that of its other side; the same for a joint without one.
#[derive(Clone, Copy)]
struct JointPlace {
    here: Vec3,
    other: Vec3,
}

impl JointPlace {
    /// Place of a joint of a rig.
    fn of(rig: &Rig, joint: Uid, symmetry: Option<&MirrorPlane>) -> Self {
        let here = rig.position(joint);
        Self { here, other: partner(rig, joint, symmetry).map_or(here, |partner| rig.position(partner)) }
    }
}

/// Other side of a joint with live mirroring; `None` for a joint without one.
fn partner(rig: &Rig, joint: Uid, symmetry: Option<&MirrorPlane>) -> Option<Uid> {
    symmetry?;
    rig.joint(joint)?.data.mirror.filter(|partner| rig.joint(*partner).is_some())
}

/// Joints of a rig, and those that the requests of a run add to it.
#[derive(Default)]
pub(super) struct RunJoints {
    joints: Vec<RunJoint>,
    /// True if the joints that the rig had before the run are among them.
    is_listed: bool,
    /// Number of requests that add joints.
    requests: usize,
    grid: Option<JointGrid>,
    /// Place of the active joint.
    active: Option<JointPlace>,
    /// Place of the joint on which the last stroke started.
    start: Option<JointPlace>,
    bones: Bones,
}

impl RunJoints {
    /// Joints of a run on a rig.
    pub(super) fn new(run: &RunRig) -> Self {
        let active = run.selection.active().filter(|_| run.can_draw);
        let place = |joint| JointPlace::of(run.rig, joint, run.symmetry.as_ref());
        Self { active: active.map(place), ..Self::default() }
    }

    /// Takes over the joints that a change adds, with live mirroring across a plane.
    pub(super) fn note(&mut self, change: &Change, symmetry: Option<&MirrorPlane>) {
        let (positions, parent) = match change {
            Change::Place(position) => (std::slice::from_ref(position), self.active),
            Change::Draw { positions, parent: ChainParent::Active } => (positions.as_slice(), self.active),
            Change::Draw { positions, .. } => (positions.as_slice(), self.start),
            Change::Select(_) => {
                self.active = None;
                return;
            }
            _ => return,
        };
        let (mut above, request) = (parent, self.requests);
        for (joint, (here, mirrored)) in settle(positions, symmetry).into_iter().enumerate() {
            let place = JointPlace { here, other: mirrored.unwrap_or(here) };
            self.bones.add(above.map(|above| above.here), here);
            self.joints.push(RunJoint { name: ChainParent::Added { request, joint }, place });
            if let Some(other) = mirrored {
                self.bones.add(above.map(|above| above.other), other);
                let place = JointPlace { here: other, other: here };
                self.joints.push(RunJoint { name: ChainParent::Partner { request, joint }, place });
            }
            above = Some(place);
        }
        self.active = above;
        self.requests += 1;
    }

    /// The joint within `reach` of the first point of a stroke on a view plane of a model of that size; `None` where rounding
    /// could decide it.
    pub(super) fn start(
        &mut self,
        RunRig { rig, symmetry, .. }: &RunRig,
        plane: &ViewPlane,
        size: f32,
        reach: f32,
        points: &[(f32, f32)],
    ) -> Option<StrokeStart> {
        let Some(point) = points.first().map(|point| Vec2::from(*point)) else { return Some(StrokeStart::Free) };
        self.list_joints(rig, symmetry.as_ref());
        self.start = None;
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
                let joint = self.joints.get(number)?;
                self.start = Some(joint.place);
                Some(StrokeStart::On(joint.name))
            }
            Some(_) => None,
        }
    }

    /// Takes over the joints that the rig had before the run.
    fn list_joints(&mut self, rig: &Rig, symmetry: Option<&MirrorPlane>) {
        if self.is_listed {
            return;
        }
        self.is_listed = true;
        let globals = rig.rest_globals();
        let places: HashMap<Uid, Vec3> = globals.iter().map(|(uid, global)| (*uid, global.translation)).collect();
        let listed = globals.into_iter().map(|(uid, global)| {
            let here = global.translation;
            let other = partner(rig, uid, symmetry).and_then(|partner| places.get(&partner).copied()).unwrap_or(here);
            RunJoint { name: ChainParent::Joint(uid), place: JointPlace { here, other } }
        });
        self.joints.extend(listed);
    }

    /// True if a stroke that starts there is a chain in any case, also without a given number of joints.
    pub(super) fn is_chain(
        &mut self,
        rig: &Rig,
        plane: &ViewPlane,
        size: f32,
        reach: f32,
        points: &[(f32, f32)],
        start: StrokeStart,
    ) -> bool {
        let points: Vec<Vec2> = points.iter().map(|point| Vec2::from(*point)).collect();
        let is_plain = reach > 0.0 && points.iter().all(|point| point.is_finite());
        if !is_plain || is_scribble(&points, reach) {
            return false;
        }
        let [Some(first), Some(last)] = [points.first(), points.last()] else { return false };
        if start != StrokeStart::Free || !is_straight(&points) {
            return true;
        }
        self.list_bones(rig);
        self.bones.decide_none(plane, [*first, *last], MARGIN * size)
    }

    /// Takes over the bones that the rig had before the run.
    fn list_bones(&mut self, rig: &Rig) {
        if self.bones.is_listed {
            return;
        }
        self.bones.is_listed = true;
        let place = |joint: &RunJoint| match joint.name {
            ChainParent::Joint(uid) => Some((uid, joint.place.here)),
            ChainParent::Active | ChainParent::Added { .. } | ChainParent::Partner { .. } => None,
        };
        let places: HashMap<Uid, Vec3> = self.joints.iter().filter_map(place).collect();
        for (uid, position) in self.joints.iter().filter_map(place) {
            let parent = rig.joint(uid).and_then(|joint| joint.parent);
            self.bones.add(parent.and_then(|parent| places.get(&parent).copied()), position);
        }
    }
}

/// Numbers of things that are equal in some numbers.
struct AlikeCounts<const N: usize>(HashMap<[u32; N], usize>);

impl<const N: usize> Default for AlikeCounts<N> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<const N: usize> AlikeCounts<N> {
    /// Counts one with these numbers; true if it is among the first [`ALIKE`].
    fn admits(&mut self, numbers: [f32; N]) -> bool {
        let count = self.0.entry(numbers.map(f32::to_bits)).or_default();
        *count += 1;
        *count <= ALIKE
    }
}

/// Bones by their length.
#[derive(Default)]
struct Bones {
    /// True if the bones that the rig had before the run are among them.
    is_listed: bool,
    /// Ends of bones of about one length, by the exponent of that; of equal bones [`ALIKE`] at most.
    by_length: BTreeMap<u32, Vec<[Vec3; 2]>>,
    alike: AlikeCounts<6>,
}

impl Bones {
    /// Bone from a joint to one below it; a joint without one above has none.
    fn add(&mut self, head: Option<Vec3>, foot: Vec3) {
        if let Some(head) = head
            && self.alike.admits([head.x, head.y, head.z, foot.x, foot.y, foot.z])
        {
            self.by_length.entry(exponent(head.distance(foot))).or_default().push([head, foot]);
        }
    }

    /// True if a straight stroke inserts no joint into a bone: it crosses none that is as long as it, or several.
    fn decide_none(&self, plane: &ViewPlane, [first, last]: [Vec2; 2], margin: f32) -> bool {
        let least = (0.999 * first.distance(last) - 2.0 * margin).max(0.0);
        let mut is_near_one = false;
        let mut crossed = 0;
        for [head, foot] in self.by_length.range(exponent(least)..).flat_map(|(_, bones)| bones) {
            let [Some(head), Some(foot)] = [plane.project(*head), plane.project(*foot)] else { return false };
            match crossing(head, foot, first, last, margin) {
                Crossing::Clear => crossed += 1,
                Crossing::Near => is_near_one = true,
                Crossing::Apart => {}
            }
            if crossed > 1 {
                return true;
            }
        }
        crossed == 0 && !is_near_one
    }
}

/// Exponent of a length, which rises with it.
fn exponent(length: f32) -> u32 {
    length.to_bits() >> 23
}

/// Relation of two segments whose ends are known but for rounding.
enum Crossing {
    Clear,
    Near,
    Apart,
}

fn crossing(a: Vec2, b: Vec2, c: Vec2, d: Vec2, margin: f32) -> Crossing {
    let (low, high) = (a.min(b) - margin, a.max(b) + margin);
    if !(c.max(d).cmpge(low) & c.min(d).cmple(high)).all() {
        return Crossing::Apart;
    }
    let (ab, cd, ac) = (b - a, d - c, c - a);
    let det = ab.perp_dot(cd);
    let lengths = ab.length() * cd.length();
    if det.abs() <= 1e-3 * lengths {
        return Crossing::Near;
    }
    let (t, s) = (ac.perp_dot(cd) / det, ac.perp_dot(ab) / det);
    // Ends that are a margin away move the place of the crossing by so much of either segment.
    let steep = lengths / det.abs();
    let [along, across] = [ab, cd].map(|segment| 2.0 * margin * steep / segment.length() + 1e-5);
    let within = |at: f32, slack: f32| at > slack && at < 1.0 - slack;
    if within(t, along) && within(s, across) {
        Crossing::Clear
    } else if within(t, -along) && within(s, -across) {
        Crossing::Near
    } else {
        Crossing::Apart
    }
}

/// Joints on a view plane, by the square cell in which they lie.
struct JointGrid {
    plane: ViewPlane,
    /// Side of a cell, in model units.
    cell: f32,
    /// Joints of each cell; of those at one place [`ALIKE`] at most.
    cells: HashMap<[i64; 2], Vec<(Vec2, usize)>>,
    alike: AlikeCounts<2>,
    /// Number of joints that are in it.
    count: usize,
}

impl JointGrid {
    /// Empty grid for circles of that radius on a model of that size.
    fn new(plane: ViewPlane, radius: f32, size: f32) -> Self {
        let cell = (2.0 * radius).max(1e-3 * size).max(f32::MIN_POSITIVE);
        Self { plane, cell, cells: HashMap::new(), alike: AlikeCounts::default(), count: 0 }
    }

    /// Takes over the joints that were added since the last call.
    fn follow(&mut self, joints: &[RunJoint]) {
        for (number, joint) in joints.iter().enumerate().skip(self.count) {
            if let Some(place) = self.plane.project(joint.place.here)
                && self.alike.admits(place.to_array())
            {
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
        let chain = match followed_chain(request, run.surface?, run.symmetry) {
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
