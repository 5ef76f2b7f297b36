//! Names of drawn joints: by chain, side and place, such as `spine_1` and `arm_l_2`.

use std::collections::BTreeSet;

use bevy::math::Vec3;

use super::{Draft, MirrorPlane};
use crate::rig::{
    EditError, Rig, RigEdit, Uid,
    label::mirrored_label,
    label_index::{ChainPlace, ChainSides},
};

/// Least share of a chain's extent that its rise or fall has to be, to be a chain that goes up or down.
const STEEP: f32 = 0.6;

/// A pixel of a view of a whole character, in parts of the distance from the ground in the middle of it.
const PIXEL: f32 = 0.002;

/// Place along the trunk, from 0 at its start to 1 at its end, below which legs begin; arms begin above it.
const HIP: f32 = 0.35;

/// The name of a chain that is drawn, and the place of its first joint.
pub(super) struct ChainName {
    base: String,
    first: u32,
    /// Ending of all joints; `None` with a plane of symmetry, where each joint has that of its own place.
    side: Option<&'static str>,
}

impl ChainName {
    /// Name of a chain by the joint that carries it and by its direction. `positions` are the places of the chain's joints,
    /// `parent` is the joint above. The names are those of a character that stands upright and looks along +Z.
    pub fn new(rig: &Rig, positions: &[Vec3], parent: Option<Uid>, plane: Option<&MirrorPlane>) -> Self {
        let side = positions.last().map_or("", |last| side_ending(*last, plane));
        // Drawn without a plane, a finger that crosses the middle of a hand is one chain of one side.
        let whole = plane.is_none().then_some(side);
        let upper = parent.and_then(|parent| rig.joint(parent));
        let known = upper.and_then(|joint| joint.data.label.as_deref()).and_then(ChainPlace::of);
        if let (Some(place), Some(joint)) = (&known, upper)
            && joint.children.is_empty()
            && stays_on_side(place.chain, positions, rig.position(joint.data.uid), plane)
        {
            return Self { base: place.base().to_owned(), first: place.number + 1, side: whole };
        }
        let base = base(rig, positions, parent, known.as_ref(), plane);
        // With a plane of symmetry the name has to be free on both sides.
        let sides = match side {
            "_l" if plane.is_none() => ChainSides::Left,
            "_r" if plane.is_none() => ChainSides::Right,
            _ => ChainSides::All,
        };
        let number = rig.free_chain_number(base, sides);
        let base = if number == 1 { base.to_owned() } else { format!("{base}{number}") };
        Self { base, first: 1, side: whole }
    }

    /// True if the chain goes on with the numbers of the chain that it is drawn onto.
    pub fn continues(&self) -> bool {
        self.first > 1
    }

    /// The name of the joint at a place of the chain, from 0: with the side on which the chain ends, or with a plane of symmetry
    /// the side on which `position` lies.
    pub fn joint(&self, rig: &Rig, place: usize, position: Vec3, plane: Option<&MirrorPlane>) -> String {
        let side = self.side.unwrap_or_else(|| side_ending(position, plane));
        let name = |number: u32| format!("{}{side}_{number}", self.base);
        let is_free = |name: &str| !rig.has_label(name) && (plane.is_none() || !rig.has_label(&partner_name(name)));
        let first = self.first + place as u32;
        let own = name(first);
        if is_free(&own) {
            return own;
        }
        (first + 1..).map(name).find(|name| is_free(name)).unwrap_or(own)
    }
}

/// The end of a chain's name that tells the side of a place.
fn side_ending(position: Vec3, plane: Option<&MirrorPlane>) -> &'static str {
    match side(position, plane) {
        0 => "",
        1 => "_l",
        _ => "_r",
    }
}

/// Side of a place: 1 left (towards +X), -1 right, 0 on the plane between them. Without a plane of symmetry a place is in the
/// middle that is as near to it as a pixel of a view of the whole character.
fn side(position: Vec3, plane: Option<&MirrorPlane>) -> i32 {
    let across = plane.map_or(position.x, |plane| plane.distance(position));
    let tolerance = plane.map_or((PIXEL * position.length()).max(1e-4), |plane| plane.tolerance);
    i32::from(across > tolerance) - i32::from(across < -tolerance)
}

/// True if a chain below a joint of another one is its continuation and not, like an arm on a spine, a chain of its own.
fn stays_on_side(chain: &str, positions: &[Vec3], from: Vec3, plane: Option<&MirrorPlane>) -> bool {
    let has_side = chain.ends_with("_l") || chain.ends_with("_r");
    let is_beside = |position: &Vec3| side(*position, plane) != 0;
    has_side == (side(from, plane) != 0) && positions.iter().all(|position| is_beside(position) == has_side)
}

/// The name of a chain that is no continuation.
fn base(
    rig: &Rig,
    positions: &[Vec3],
    parent: Option<Uid>,
    known: Option<&ChainPlace>,
    plane: Option<&MirrorPlane>,
) -> &'static str {
    let (Some(&first), Some(&last)) = (positions.first(), positions.last()) else { return "joint" };
    let way = last - first;
    let is_beside = positions.iter().any(|position| side(*position, plane) != 0);
    let Some(parent) = parent else {
        return match (positions.len(), is_beside) {
            (1, false) => "root",
            (1, true) => "joint",
            (_, false) => "spine",
            (_, true) if way.y < -STEEP * way.length() => "leg",
            (_, true) => "arm",
        };
    };
    match known.map(ChainPlace::base) {
        Some(base) if base.contains("arm") => return "finger",
        Some(base) if base.contains("leg") => return "toe",
        _ => {}
    }
    // Joints of templates have names without numbers.
    let label =
        rig.joint(parent).and_then(|joint| joint.data.label.as_deref()).unwrap_or_default().to_ascii_lowercase();
    let below = [("head", "face"), ("hand", "finger"), ("foot", "toe")];
    if let Some((_, base)) = below.into_iter().find(|(part, _)| label.contains(part)) {
        return base;
    }
    let way = if positions.len() > 1 { way } else { last - rig.position(parent) };
    let share = way.normalize_or_zero();
    let trunk = Trunk::new(rig, parent);
    match is_beside {
        false if trunk.is_lower() && share.y < STEEP => "tail",
        false if trunk.is_lower() => "spine",
        false => "neck",
        // A spine that lies: four legs.
        true if trunk.lies() && share.y < -STEEP && trunk.is_in_front(first) => "front_leg",
        true if trunk.lies() && share.y < -STEEP => "hind_leg",
        true => match trunk.height_of(first) {
            Some(height) if height < HIP => "leg",
            None if share.y < -STEEP => "leg",
            _ => "arm",
        },
    }
}

/// The joints from a joint up to its root, and those that continue them: a spine.
struct Trunk {
    start: Vec3,
    end: Vec3,
    /// Number of joints above the joint.
    above: usize,
    /// Number of all joints.
    count: usize,
}

impl Trunk {
    fn new(rig: &Rig, joint: Uid) -> Self {
        let (root, above) = rig.root_and_depth(joint);
        let (mut last, mut count) = (joint, above + 1);
        // Downwards along first children, which were drawn first.
        while let Some(&child) = rig.children(Some(last)).first() {
            if rig.joint(child).is_some_and(|joint| joint.data.mirror.is_some()) {
                break;
            }
            (last, count) = (child, count + 1);
        }
        Self { start: rig.position(root), end: rig.position(last), above, count }
    }

    /// True if the joint is one of the lower half.
    fn is_lower(&self) -> bool {
        2 * self.above < self.count
    }

    /// Place of a point along the trunk, from 0 at its start to 1 at its end; `None` for a trunk of one joint.
    fn height_of(&self, point: Vec3) -> Option<f32> {
        let way = self.end - self.start;
        (way.length_squared() > 0.0).then(|| (point - self.start).dot(way) / way.length_squared())
    }

    /// True if it is longer than high.
    fn lies(&self) -> bool {
        let way = self.end - self.start;
        way.y.abs() < STEEP * way.length()
    }

    fn is_in_front(&self, place: Vec3) -> bool {
        place.z > 0.5 * (self.start.z + self.end.z)
    }
}

/// Numbers the joints below an inserted one again, if they have names of the same chain, and names the inserted one.
pub(super) fn number_inserted(draft: &mut Draft, joint: Uid, child: Uid) -> Result<(), EditError> {
    let rig = draft.rig();
    let label = |joint: Uid| rig.joint(joint).and_then(|joint| joint.data.label.clone());
    let Some(first) = label(child) else { return Ok(()) };
    let Some(ChainPlace { chain, number }) = ChainPlace::of(&first) else { return Ok(()) };
    let mut names = vec![(joint, first.clone())];
    let (mut at, mut number) = (child, number);
    loop {
        number += 1;
        names.push((at, format!("{chain}_{number}")));
        let next =
            rig.children(Some(at)).iter().copied().find(|next| label(*next).as_ref() == names.last().map(|n| &n.1));
        let Some(next) = next else { break };
        at = next;
    }
    let moved: BTreeSet<Uid> = names.iter().map(|(joint, _)| *joint).collect();
    let others = rig.walk().filter(|joint| !moved.contains(&joint.data.uid));
    let taken: BTreeSet<&str> = others.filter_map(|joint| joint.data.label.as_deref()).collect();
    if names.iter().any(|(_, name)| taken.contains(name.as_str())) {
        return Ok(());
    }
    for (joint, name) in names {
        draft.apply(RigEdit::SetLabel(joint, Some(name)))?;
    }
    Ok(())
}

/// The name of the joint on the other side of a named one.
pub(super) fn partner_name(name: &str) -> String {
    mirrored_label(name).unwrap_or_else(|| name.to_owned())
}
