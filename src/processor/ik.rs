//! Inverse kinematics for modules: one way to make a chain reach for a goal.

use bevy::reflect::Reflect;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::{Amount, BuildScope, ModuleError, world::NodeId};
use crate::rig::{AngleLimits, ChainSolver, Constraint, Scalar};

/// Lowest and highest angles of one joint in degrees about X, Y and Z in that order, relative to how it was built; as
/// plain data of a parameter.
pub type JointAngles = [(Option<f32>, Option<f32>); 3];

/// Solver of a chain.
#[derive(Reflect, Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IkSolver {
    /// Two bones where the chain has three joints, FABRIK where it has more.
    #[default]
    Auto,
    /// Exact, for three joints; with soft reach, stretch and twist.
    TwoBone,
    /// Forward and backward reaching; chains of any length.
    Fabrik,
    /// Cyclic coordinate descent; chains of any length, with limits for each joint.
    Ccd,
}

/// Inverse kinematics of a chain of joints: its goal and solver; see [`BuildScope::add_ik`].
#[derive(Debug, Clone)]
pub struct Ik {
    /// Joints from the root to the end, each a child of the one before.
    pub chain: Vec<NodeId>,
    /// Goal of the end.
    pub goal: NodeId,
    /// The side to which the chain bends.
    pub pole: Option<NodeId>,
    /// The control whose attributes [`Amount`]s name; the goal if there is none.
    pub control: Option<NodeId>,
    /// Solver of the chain.
    pub solver: IkSolver,
    /// The direction in which a straight chain bends, in the rig's space; from the joints and the pole if `None`.
    pub prefer: Option<Vec3>,
    /// 0 leaves the chain as it is, 1 reaches.
    pub weight: Scalar,
    /// Share of the length over which two bones ease into being straight.
    pub soft: Amount,
    /// 0 keeps lengths, 1 stretches two bones to the goal.
    pub stretch: Amount,
    /// Longest stretch as a factor.
    pub max_stretch: f32,
    /// Turn of two bones about the line from root to goal, in degrees.
    pub twist: Amount,
    /// Share by which the middle joint of two bones goes to the pole.
    pub pin: Amount,
    /// True if the end turns with the goal, as it was built relative to it.
    pub orient_end: bool,
    /// Limits of each joint for [`IkSolver::Ccd`].
    pub limits: Vec<JointAngles>,
    /// Rounds of the solvers for longer chains, at most.
    pub iterations: u32,
    /// Largest distance to the goal at which the iterations end, as a share of the chain's length.
    pub tolerance: f32,
}

impl Ik {
    /// A chain that reaches for a goal, with the end's rotation, and with nothing else asked for.
    pub fn new(chain: Vec<NodeId>, goal: NodeId) -> Self {
        Self {
            chain,
            goal,
            pole: None,
            control: None,
            solver: IkSolver::Auto,
            prefer: None,
            weight: Scalar::Value(1.0),
            soft: Amount::Value(0.0),
            stretch: Amount::Value(0.0),
            max_stretch: 2.0,
            twist: Amount::Value(0.0),
            pin: Amount::Value(0.0),
            orient_end: true,
            limits: Vec::new(),
            iterations: 24,
            tolerance: 1e-4,
        }
    }
}

impl BuildScope<'_> {
    /// Makes a chain reach for a goal: checks everything, finds the direction in which it bends, and adds the
    /// constraint with the role "ik" for the first joint.
    ///
    /// # Errors
    /// A chain that does not fit the solver, one that is straight with nothing to say where it bends, numbers out of
    /// range.
    pub fn add_ik(&mut self, ik: &Ik) -> Result<NodeId, ModuleError> {
        let (Some(root), Some(end)) = (ik.chain.first().copied(), ik.chain.last().copied()) else {
            return Err(ModuleError::parameter("end", "the chain has no joints; choose its first and its last joint"));
        };
        if ik.chain.len() < 2 {
            return Err(ModuleError::parameter(
                "end",
                "start and end are the same joint; choose an end further down the chain",
            ));
        }
        if ik.chain.contains(&ik.goal) {
            let goal = self.name(ik.goal);
            return Err(ModuleError::parameter(
                "goal",
                format!("{goal} is a joint of the chain itself; make a control for the goal, with the control module"),
            ));
        }
        let bones = match (ik.solver, &ik.chain[..]) {
            (IkSolver::Auto | IkSolver::TwoBone, [root, mid, end]) => Some([*root, *mid, *end]),
            (IkSolver::TwoBone, chain) => {
                return Err(ModuleError::parameter(
                    "solver",
                    format!(
                        "two_bone is for 3 joints, and from start to end there are {}; choose fabrik or ccd, or another end",
                        chain.len()
                    ),
                ));
            }
            _ => None,
        };
        let control = Some(ik.control.unwrap_or(ik.goal));
        let orient_end = ik.orient_end.then(|| {
            let (goal, end) = (self.global(ik.goal).rotation, self.global(end).rotation);
            (goal.inverse() * end).normalize()
        });
        let bend = self.bend(ik)?;
        let uid = |scope: &Self, node: NodeId| scope.uid(node);
        let (goal, pole) = (uid(self, ik.goal), ik.pole.map(|pole| uid(self, pole)));
        let weight = ik.weight.clone();
        let constraint = match bones {
            Some([root, mid, end]) => {
                self.in_range("max_stretch", ik.max_stretch, 1.0..=f32::INFINITY)?;
                let prefer = self.global(root).rotation.inverse() * bend.unwrap_or_default();
                Constraint::TwoBone {
                    root: uid(self, root),
                    mid: uid(self, mid),
                    end: uid(self, end),
                    goal,
                    pole,
                    prefer,
                    weight,
                    soft: self.amount("soft", &ik.soft, control, 0.0..=1.0, 0.0)?,
                    stretch: self.amount("stretch", &ik.stretch, control, 0.0..=1.0, 0.0)?,
                    max_stretch: ik.max_stretch,
                    twist: self.amount("twist", &ik.twist, control, f32::NEG_INFINITY..=f32::INFINITY, 0.0)?,
                    // Nothing is pinned to a pole that is off.
                    pin: match pole {
                        Some(_) => self.amount("pin", &ik.pin, control, 0.0..=1.0, 0.0)?,
                        None => Scalar::Value(0.0),
                    },
                    orient_end,
                }
            }
            None => {
                let numbers = [("soft", &ik.soft), ("stretch", &ik.stretch), ("twist", &ik.twist), ("pin", &ik.pin)];
                for (name, amount) in numbers {
                    if *amount != Amount::Value(0.0) {
                        return Err(ModuleError::parameter(
                            name,
                            "is for two bones only; leave it out, or choose an end two joints below start",
                        ));
                    }
                }
                if ik.iterations == 0 || ik.iterations > 1000 {
                    return Err(ModuleError::parameter(
                        "iterations",
                        "write a whole number from 1 to 1000; 24 is usual",
                    ));
                }
                self.in_range("tolerance", ik.tolerance, 0.0..=1.0)?;
                Constraint::Chain {
                    joints: ik.chain.iter().map(|joint| self.uid(*joint)).collect(),
                    goal,
                    pole,
                    solver: match ik.solver {
                        IkSolver::Ccd => ChainSolver::Ccd(self.angle_limits(ik)?),
                        _ => ChainSolver::Fabrik,
                    },
                    iterations: ik.iterations,
                    tolerance: ik.tolerance,
                    weight,
                    orient_end,
                }
            }
        };
        if !matches!((&constraint, ik.solver), (Constraint::Chain { .. }, IkSolver::Ccd)) && !ik.limits.is_empty() {
            return Err(ModuleError::parameter(
                "limits",
                "only ccd keeps limits; choose it as the solver, or leave them out",
            ));
        }
        self.constrain("ik", root, 0, constraint)
    }

    fn angle_limits(&self, ik: &Ik) -> Result<Vec<AngleLimits>, ModuleError> {
        if ik.limits.len() > ik.chain.len() {
            return Err(ModuleError::parameter(
                "limits",
                format!("there are {} for {} joints; leave the last ones out", ik.limits.len(), ik.chain.len()),
            ));
        }
        for (number, (low, high)) in ik.limits.iter().enumerate().flat_map(|(n, axes)| axes.map(|axis| (n, axis))) {
            let (low, high) = (low.unwrap_or(f32::MIN), high.unwrap_or(f32::MAX));
            if low > high || low.is_nan() || high.is_nan() {
                return Err(ModuleError::parameter(
                    "limits",
                    format!("those of joint {} go from {low} to {high}; write the lower angle first", number + 1),
                ));
            }
        }
        Ok(ik.limits.clone())
    }

    /// The direction in which a chain bends, in the rig's space: as it was built, unless another side is asked for; else as
    /// asked for, or towards the pole.
    fn bend(&mut self, ik: &Ik) -> Result<Option<Vec3>, ModuleError> {
        let built = self.bend_of(&ik.chain);
        let points: Vec<Vec3> =
            [ik.chain.first(), ik.chain.last()].into_iter().flatten().map(|joint| self.position(*joint)).collect();
        let (Some(root), Some(end)) = (points.first().copied(), points.last().copied()) else { return Ok(None) };
        let line = (end - root).normalize_or_zero();
        let across = |direction: Vec3| {
            let across = direction - line * direction.dot(line);
            Some(across).filter(|across| across.length() > 1e-3 * direction.length()).and_then(Vec3::try_normalize)
        };
        if let Some(prefer) = ik.prefer {
            let across = across(prefer).filter(|_| prefer.is_finite()).ok_or_else(|| {
                ModuleError::parameter(
                    "prefer",
                    "points along the chain, or nowhere; write a direction across it, such as (0, 0, 1) for forwards",
                )
            })?;
            // A chain that is built bent to that side keeps its plane where it is straightened, as a hinge does.
            return Ok(Some(built.filter(|built| built.dot(across) > 0.0).unwrap_or(across)));
        }
        if built.is_some() {
            return Ok(built);
        }
        let towards_pole = match ik.pole {
            Some(pole) => across(self.position(pole) - root),
            None => None,
        };
        if towards_pole.is_none() && ik.chain.len() > 2 {
            return Err(ModuleError::parameter(
                "prefer",
                "the chain is straight, so nothing says where it bends; write a direction in the rig's space, such as \
                 (0, 0, 1) for forwards, give it a pole, or bend the joints a little",
            ));
        }
        Ok(towards_pole)
    }

    /// The direction in which a chain of nodes leaves the line from its first to its last, in the rig's space; `None` if
    /// it does so by less than a thousandth of its length.
    pub fn bend_of(&mut self, chain: &[NodeId]) -> Option<Vec3> {
        let points: Vec<Vec3> = chain.iter().map(|joint| self.position(*joint)).collect();
        let (root, end) = (*points.first()?, *points.last()?);
        let length: f32 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let line = (end - root).normalize_or_zero();
        let off = points.iter().map(|point| {
            let along = *point - root;
            along - line * along.dot(line)
        });
        let furthest = off.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        if furthest.length() > 1e-3 * length { furthest.try_normalize() } else { None }
    }
}
