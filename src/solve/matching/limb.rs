//! Matching of limbs between forward and inverse kinematics.

use glam::Vec3;

use super::{Attempt, MatchError, angle_between, number};
use crate::{
    mesh::model::Trs,
    rig::{Constraint, Scalar, Uid},
    solve::rotate::{about, direction},
};

/// The limb of a switch.
pub(super) struct Limb<'a> {
    pub joints: &'a [Uid],
    pub fk: &'a [Uid],
    pub goal: Uid,
    pub goal_offset: Trs,
    pub pole: Option<Uid>,
    /// Controls above the limb that keep their place.
    pub held: &'a [Uid],
}

/// Tolerance of the end's position, as a share of the limb's length. The elbow of an almost straight limb moves many
/// times as far as its end.
const NEAR: f32 = 1e-6;

/// Tolerance of the middle joint's position, as a share of the limb's length.
const NEAR_MIDDLE: f32 = 2e-5;

/// Share of its length that a limb reaches at least for a goal ahead of its end to be tried.
const STRAIGHT: f32 = 0.999;

/// Ways by which the goal of an almost straight limb is moved ahead, as shares of the limb's length.
const AHEAD: [f32; 9] = [-1e-6, -5e-7, -2.5e-7, 1.25e-7, 2.5e-7, 5e-7, 1e-6, 4e-6, 1.6e-5];

/// Rounds in which the controls above a limb and its own are brought to agree.
const ROUNDS: usize = 2;

impl Limb<'_> {
    /// Poses the controls so that the joints have the rig transforms `wanted`, and the controls above the limb those of
    /// `above`, with the attribute at `after`.
    pub fn hold(
        &self,
        attempt: &mut Attempt<'_>,
        wanted: &[Trs],
        above: &[Trs],
        [before, after]: [f32; 2],
    ) -> Result<(), MatchError> {
        self.hold_limb(attempt, wanted, [before, after])?;
        // A control above the limb may turn with the goal, and carries the limb.
        for _ in 0..ROUNDS {
            if self.is_above_held(attempt, above)? {
                break;
            }
            for (control, wanted) in self.held.iter().zip(above) {
                attempt.place(*control, wanted, None)?;
            }
            self.hold_limb(attempt, wanted, [before, after])?;
        }
        Ok(())
    }

    /// Rig transforms of the controls above the limb.
    pub fn above(&self, attempt: &mut Attempt<'_>) -> Result<Vec<Trs>, MatchError> {
        self.held.iter().map(|control| attempt.global(*control)).collect()
    }

    /// True if the controls above the limb have the rig transforms `above`.
    pub fn is_above_held(&self, attempt: &mut Attempt<'_>, above: &[Trs]) -> Result<bool, MatchError> {
        for (control, wanted) in self.held.iter().zip(above) {
            let now = attempt.global(*control)?;
            let near = 1e-6 * wanted.translation.length().max(1e-3);
            if now.translation.distance(wanted.translation) > near || angle_between(&now, wanted) >= 1e-3 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn hold_limb(
        &self,
        attempt: &mut Attempt<'_>,
        wanted: &[Trs],
        [before, after]: [f32; 2],
    ) -> Result<(), MatchError> {
        let length: f32 = wanted.windows(2).map(|pair| pair[0].translation.distance(pair[1].translation)).sum();
        // The solver starts from the forward pose, so that pose has to agree unless it held the limb alone before.
        if after < 1.0 || before > 0.0 {
            self.hold_forward(attempt, wanted, length)?;
        }
        if after > 0.0 {
            self.hold_inverse(attempt, wanted, length)?;
        }
        Ok(())
    }

    /// Poses each forward control so that its joint is held as wanted.
    fn hold_forward(&self, attempt: &mut Attempt<'_>, wanted: &[Trs], length: f32) -> Result<(), MatchError> {
        // A limb whose first joint keeps its place may be elsewhere than its controls.
        let mut moved = Vec3::ZERO;
        for (number, ((joint, control), wanted)) in self.joints.iter().zip(self.fk).zip(wanted).enumerate() {
            let Some((stand_in, translates)) = follows(attempt, *joint, *control) else { continue };
            // The joint's place is that of the node which the control carries for it.
            let (now, carried) =
                (attempt.global(*control)?, attempt.global(stand_in)?.relative_to(&attempt.global(*control)?));
            let rotation = (wanted.rotation * carried.rotation.conjugate()).normalize();
            let translation = match translates {
                true => wanted.translation + moved - rotation * (now.scale * carried.translation),
                false => now.translation,
            };
            let place = Trs { translation, rotation, scale: now.scale };
            attempt.place(*control, &place, Some(if translates { 1e-5 * length } else { f32::INFINITY }))?;
            if number == 0 && !translates {
                moved = attempt.global(stand_in)?.translation - wanted.translation;
            }
        }
        Ok(())
    }

    /// Poses goal and pole so that the solver holds the joints as wanted.
    fn hold_inverse(&self, attempt: &mut Attempt<'_>, wanted: &[Trs], length: f32) -> Result<(), MatchError> {
        let (Some(root), Some(end), Some(last)) = (wanted.first(), wanted.last(), self.joints.last()) else {
            return Ok(());
        };
        let solver = Solver::of(attempt, self.goal, self.joints);
        let goal = attempt.global(self.goal)?;
        let rotation = match solver.orients {
            true => (end.rotation * self.goal_offset.rotation.conjugate()).normalize(),
            false => goal.rotation,
        };
        let at = |translation: Vec3| Trs { translation, rotation, scale: goal.scale };
        attempt.place_carried(self.goal, &at(end.translation))?;
        if let (Some(pole), true) = (self.pole, wanted.len() == 3) {
            let place = self.pole_place(attempt, &solver, wanted, length)?;
            let now = attempt.global(pole)?;
            attempt.place_carried(pole, &Trs { translation: place, ..now })?;
        }

        if wanted.len() == 3 && !solver.is_soft {
            self.hold_straight(attempt, wanted, length)?;
        }

        // A soft limb lags behind its goal: the goal is moved ahead until the end is at its wanted place.
        let off = |attempt: &mut Attempt<'_>, ahead: f32| -> Result<f32, MatchError> {
            let line = direction(end.translation - root.translation).unwrap_or(Vec3::X);
            attempt.place_carried(self.goal, &at(end.translation + line * ahead))?;
            let now = attempt.global(*last)?;
            Ok((now.translation - end.translation).dot(line))
        };
        let first = attempt.global(*last)?.translation.distance(end.translation);
        if first <= NEAR * length || !solver.is_soft {
            return Ok(());
        }
        let (mut low, mut high) = (0.0, 0.5 * length);
        let reached = off(attempt, high)?;
        if reached > -20.0 * NEAR * length {
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                let off = off(attempt, middle)?;
                match off < -0.5 * NEAR * length {
                    true => low = middle,
                    false => high = middle,
                }
                if off.abs() <= 0.5 * NEAR * length {
                    return Ok(());
                }
            }
        }
        off(attempt, high)?;
        Ok(())
    }

    /// Moves the goal of an almost straight limb ahead until the middle joint is where it should be: rounding that puts the goal
    /// a little nearer bends such a limb by thousands of times as much.
    fn hold_straight(&self, attempt: &mut Attempt<'_>, wanted: &[Trs], length: f32) -> Result<(), MatchError> {
        let (root, mid, end) = (wanted[0].translation, self.joints[1], wanted[2].translation);
        let Some(line) = direction(end - root) else { return Ok(()) };
        let near = NEAR_MIDDLE * length;
        let first = attempt.global(mid)?.translation.distance(wanted[1].translation);
        if first <= near || root.distance(end) < STRAIGHT * length {
            return Ok(());
        }
        let start = attempt.global(self.goal)?;
        let mut best = (first, 0.0);
        for share in AHEAD {
            let ahead = share * length;
            attempt.place_carried(self.goal, &Trs { translation: end + line * ahead, ..start })?;
            let off = attempt.global(mid)?.translation.distance(wanted[1].translation);
            best = if off < best.0 { (off, ahead) } else { best };
            if off <= near {
                return Ok(());
            }
        }
        attempt.place_carried(self.goal, &Trs { translation: end + line * best.1, ..start })
    }

    /// Position of the pole that holds the middle joint, at the pole's built distance from it.
    fn pole_place(
        &self,
        attempt: &mut Attempt<'_>,
        solver: &Solver,
        wanted: &[Trs],
        length: f32,
    ) -> Result<Vec3, MatchError> {
        let [root, mid, end] = [wanted[0], wanted[1], wanted[2]];
        if solver.pin.as_ref().is_some_and(|pin| number(attempt, pin) > 0.0) {
            return Ok(mid.translation);
        }
        let built = |node: Option<Uid>| node.and_then(|node| attempt.built(node)).map(|global| global.translation);
        let far = match (built(self.pole), built(self.joints.get(1).copied())) {
            (Some(pole), Some(mid)) => pole.distance(mid),
            _ => length,
        };
        let far = far.max(0.25 * length);
        let upper = direction(mid.translation - root.translation).unwrap_or(Vec3::Y);
        let lower = direction(end.translation - mid.translation).unwrap_or(upper);
        let line = direction(end.translation - root.translation).unwrap_or(upper);
        // The same threshold as the solver's between bent and straight limbs.
        let axis = lower.cross(upper);
        let bend = if axis.length() > 1e-4 {
            axis.cross(line)
        } else {
            let prefer = root.rotation * solver.prefer;
            prefer - line * prefer.dot(line)
        };
        let Some(bend) = direction(bend) else { return Ok(mid.translation) };
        let twist = solver.twist.as_ref().map_or(0.0, |twist| number(attempt, twist));
        // The twist turns the plane of the bend about the line, and so everything beside the line.
        let on_line = root.translation + line * (mid.translation - root.translation).dot(line);
        Ok(on_line + about(line, -twist.to_radians()) * (mid.translation - on_line + bend * far))
    }
}

/// Nodes and parameters of the limb's solver.
struct Solver {
    orients: bool,
    is_soft: bool,
    prefer: Vec3,
    twist: Option<Scalar>,
    /// The middle joint goes to the pole by this share.
    pin: Option<Scalar>,
}

impl Solver {
    fn of(attempt: &Attempt<'_>, goal_of: Uid, joints: &[Uid]) -> Self {
        let root_of = joints.first().copied();
        for built in &attempt.rig.constraints {
            match &*built.constraint {
                Constraint::TwoBone { root, goal, orient_end, soft, prefer, twist, pin, .. }
                    if Some(*root) == root_of && *goal == goal_of =>
                {
                    let is_soft = match soft {
                        Scalar::Value(soft) => *soft != 0.0,
                        Scalar::Attribute { .. } => number(attempt, soft) != 0.0,
                        Scalar::Choice { .. } | Scalar::Channel { .. } => true,
                    };
                    return Self {
                        orients: orient_end.is_some(),
                        is_soft,
                        prefer: *prefer,
                        twist: Some(twist.clone()),
                        pin: Some(pin.clone()),
                    };
                }
                Constraint::Chain { joints: chain, goal, orient_end, .. } if chain == joints && *goal == goal_of => {
                    let orients = orient_end.is_some();
                    return Self { orients, is_soft: false, prefer: Vec3::ZERO, twist: None, pin: None };
                }
                _ => {}
            }
        }
        Self { orients: true, is_soft: false, prefer: Vec3::ZERO, twist: None, pin: None }
    }
}

/// The node on a forward control that a joint follows, and whether the joint's position follows, too.
fn follows(attempt: &Attempt<'_>, joint: Uid, control: Uid) -> Option<(Uid, bool)> {
    let carrier = |node: Uid| attempt.rig.node(node)?.parent.map(|parent| attempt.rig.nodes[parent].uid);
    attempt.rig.constraints.iter().find_map(|built| match &*built.constraint {
        Constraint::Transform { driven, targets, translate, .. } if *driven == joint => {
            let target = targets.iter().find(|target| carrier(target.node) == Some(control))?;
            Some((target.node, *translate == [true; 3]))
        }
        Constraint::Relative { driven, source, translate, .. } if *driven == joint => {
            (carrier(*source) == Some(control)).then_some((*source, *translate))
        }
        _ => None,
    })
}
