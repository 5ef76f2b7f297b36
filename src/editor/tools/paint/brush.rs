//! The brush: its settings, and the actions of keys and buttons on it.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use super::SelectedPoints;
use crate::{
    algo::paint::{Brush, BrushMode, BrushReach, FalloffCurve, PruneSettings},
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest},
        files::attend,
        pointer::ModifierKeys,
        tools::ToolSystems,
    },
    plugins::{
        RigSystems,
        document::{EditRequest, Selection},
        painting::{WeightChange, WeightChangeRequest},
        surface::{RigMesh, RigMeshes, RigSurface},
    },
    rig::{Rig, Uid, operations::Operation},
};

/// Plugin of the brush's settings and actions.
pub struct BrushPlugin;

impl Plugin for BrushPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<PaintBrush>()
            .init_resource::<SelectedPoints>()
            .add_message::<ActionRequest>()
            .add_message::<WeightChangeRequest>()
            .add_systems(Update, carry_out.after(attend).before(ToolSystems::Tools).before(RigSystems::Script));
    }
}

/// Settings of the brush, of pruning, and of the colours while weights are shown.
#[derive(Resource, Debug, Clone, Copy, PartialEq)]
pub struct PaintBrush {
    /// Effect on the weights.
    pub mode: BrushMode,
    /// Size of the effect, 0 to 1.
    pub strength: f32,
    /// Radius in the rig's units; `None` for one that fits the character.
    pub radius: Option<f32>,
    /// Part of the radius over which the effect fades, 0 to 1.
    pub softness: f32,
    /// Course of the effect over the falloff.
    pub curve: FalloffCurve,
    /// Measure of distances.
    pub reach: BrushReach,
    /// Smooths and sharpens all free joints together if `true`.
    pub all_joints: bool,
    /// The largest number of influences of a painted point.
    pub most: usize,
    /// Settings of pruning.
    pub prune: PruneSettings,
    /// Shows the colours of all joints if `true`, the weights of the active joint if `false`.
    pub all_colors: bool,
}

impl Default for PaintBrush {
    fn default() -> Self {
        Self {
            mode: BrushMode::Add,
            strength: 0.25,
            radius: None,
            softness: 1.0,
            curve: FalloffCurve::Smooth,
            reach: BrushReach::Surface,
            all_joints: false,
            most: 8,
            prune: PruneSettings::default(),
            all_colors: false,
        }
    }
}

/// Radius of a brush that nobody has set, as a share of the character's size.
const RADIUS: f32 = 0.04;
/// Factor of a step of the radius.
const STEP: f32 = 1.2;
/// Step of the strength.
const STRENGTH_STEP: f32 = 0.05;

impl PaintBrush {
    /// The brush on a character of this size.
    pub fn of_size(&self, size: f32) -> Brush {
        let radius = self.radius.unwrap_or(size * RADIUS);
        Brush {
            mode: self.mode,
            strength: self.strength,
            radius,
            falloff: radius * self.softness,
            curve: self.curve,
            reach: self.reach,
            all_joints: self.all_joints,
        }
    }
}

/// Effect of a stroke that begins with these keys held: Control turns it round, Shift smooths.
pub fn mode_of(mode: BrushMode, held: ModifierKeys) -> BrushMode {
    match (held.shift, held.control) {
        (true, _) => BrushMode::Smooth,
        (false, true) => mode.opposite(),
        (false, false) => mode,
    }
}

/// Size of a rig in its units: the longest side of its surface, or of its skeleton.
pub fn rig_size(rig: &Rig, surface: Option<&RigSurface>) -> f32 {
    let [low, high] = match surface {
        Some(surface) => surface.bounds(),
        None => rig.rest_globals().iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], (_, joint)| {
            [low.min(joint.translation), high.max(joint.translation)]
        }),
    };
    let size = (high - low).max_element();
    if size.is_finite() && size > 0.0 { size } else { 1.0 }
}

/// An action of painting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum BrushAction {
    /// Makes the radius smaller.
    Smaller,
    /// Makes the radius larger.
    Larger,
    /// Makes the strength less.
    Weaker,
    /// Makes the strength more.
    Stronger,
    /// Paints by adding.
    Add,
    /// Paints by taking away.
    Subtract,
    /// Paints by replacing.
    Replace,
    /// Paints by smoothing.
    Smooth,
    /// Paints by sharpening.
    Sharpen,
    /// Measures distances on the surface, or through the volume.
    Reach,
    /// Smooths all joints, or the selected one.
    AllJoints,
    /// Shows the colours of all joints, or the weights of the selected one.
    Colors,
    /// Locks the weights of the selected joints, or unlocks them.
    Lock,
    /// Normalises the weights of all meshes.
    Normalise,
    /// Prunes the weights of all meshes.
    Prune,
    /// Selects no point.
    NoPoints,
}

impl BrushAction {
    /// Every action.
    pub const ALL: [Self; 16] = [
        Self::Smaller,
        Self::Larger,
        Self::Weaker,
        Self::Stronger,
        Self::Add,
        Self::Subtract,
        Self::Replace,
        Self::Smooth,
        Self::Sharpen,
        Self::Reach,
        Self::AllJoints,
        Self::Colors,
        Self::Lock,
        Self::Normalise,
        Self::Prune,
        Self::NoPoints,
    ];

    /// Description in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smaller => "Brush: smaller",
            Self::Larger => "Brush: larger",
            Self::Weaker => "Brush: weaker",
            Self::Stronger => "Brush: stronger",
            Self::Add => "Brush: add weight",
            Self::Subtract => "Brush: subtract weight",
            Self::Replace => "Brush: replace weight",
            Self::Smooth => "Brush: smooth weights",
            Self::Sharpen => "Brush: sharpen weights",
            Self::Reach => "Brush: surface or volume",
            Self::AllJoints => "Brush: smooth all joints or one",
            Self::Colors => "Influence colours of all joints or one",
            Self::Lock => "Lock or unlock weights",
            Self::Normalise => "Normalise weights",
            Self::Prune => "Prune weights",
            Self::NoPoints => "Select no points",
        }
    }

    /// The action that chooses a mode.
    pub fn of_mode(mode: BrushMode) -> Self {
        match mode {
            BrushMode::Add => Self::Add,
            BrushMode::Subtract => Self::Subtract,
            BrushMode::Replace => Self::Replace,
            BrushMode::Smooth => Self::Smooth,
            BrushMode::Sharpen => Self::Sharpen,
        }
    }

    /// The mode that the action chooses.
    fn mode(self) -> Option<BrushMode> {
        BrushMode::ALL.into_iter().find(|mode| Self::of_mode(*mode) == self)
    }
}

/// Reason why an action of painting can do nothing at present, in a few words; `None` if it can.
pub fn obstacle(world: &World, action: BrushAction) -> Option<&'static str> {
    let entity = world.get_resource::<ActiveRig>()?.0;
    let rig = world.get::<Rig>(entity)?;
    match action {
        BrushAction::Normalise | BrushAction::Prune | BrushAction::Colors => {
            rig.skins().next().is_none().then_some("no mesh has weights")
        }
        BrushAction::Lock => {
            let selected = world.get::<Selection>(entity)?;
            (!selected.0.iter().any(|joint| rig.joint(*joint).is_some())).then_some("no joint is selected")
        }
        BrushAction::NoPoints => {
            let selected = world.get_resource::<SelectedPoints>()?;
            selected.points.is_empty().then_some("no point is selected")
        }
        _ if world.get::<RigMeshes>(entity).is_none_or(|meshes| meshes.is_empty()) => Some("no mesh is open"),
        BrushAction::Weaker | BrushAction::Stronger => {
            let strength = world.get_resource::<PaintBrush>()?.strength;
            match action {
                BrushAction::Weaker => (strength <= 0.0).then_some("the brush has its least strength"),
                _ => (strength >= 1.0).then_some("the brush has its full strength"),
            }
        }
        _ => None,
    }
}

pub(super) fn carry_out(
    mut actions: MessageReader<ActionRequest>,
    active: Option<Res<ActiveRig>>,
    rigs: Query<(&Rig, &Selection, Option<&RigSurface>, Option<&RigMeshes>)>,
    meshes: Query<&RigMesh>,
    mut brush: ResMut<PaintBrush>,
    mut selected: ResMut<SelectedPoints>,
    mut commands: Commands,
) {
    for ActionRequest(action) in actions.read() {
        let Action::Brush(action) = action else { continue };
        let found = active.as_ref().and_then(|active| Some((active.0, rigs.get(active.0).ok()?)));
        let size = found.as_ref().map_or(1.0, |(_, (rig, _, surface, _))| rig_size(rig, *surface));
        let mut next = *brush;
        let radius = next.of_size(size).radius;
        match action {
            BrushAction::Smaller => next.radius = Some((radius / STEP).max(size * 1e-4)),
            BrushAction::Larger => next.radius = Some((radius * STEP).min(size * 2.0)),
            BrushAction::Weaker => next.strength = (next.strength - STRENGTH_STEP).clamp(0.0, 1.0),
            BrushAction::Stronger => next.strength = (next.strength + STRENGTH_STEP).clamp(0.0, 1.0),
            BrushAction::Reach => next.reach = next.reach.other(),
            BrushAction::AllJoints => next.all_joints = !next.all_joints,
            BrushAction::Colors => next.all_colors = !next.all_colors,
            BrushAction::NoPoints => {
                selected.set_if_neq(SelectedPoints::default());
            }
            BrushAction::Lock | BrushAction::Normalise | BrushAction::Prune => {
                let Some((entity, (rig, selection, _, own))) = found else { continue };
                let own = own.iter().flat_map(|own| own.iter());
                let bound = own.filter(|mesh| meshes.get(*mesh).is_ok_and(|mesh| rig.skin(mesh.uid).is_some()));
                let change = match action {
                    BrushAction::Lock => {
                        lock(entity, rig, selection, &mut commands);
                        continue;
                    }
                    BrushAction::Prune => WeightChange::Prune(next.prune),
                    _ => WeightChange::Normalise,
                };
                for mesh in bound {
                    commands.write_message(WeightChangeRequest { mesh, change });
                }
            }
            _ => next.mode = action.mode().unwrap_or(next.mode),
        }
        brush.set_if_neq(next);
    }
}

/// Locks the selected joints if one of them is not, or unlocks them.
fn lock(entity: Entity, rig: &Rig, selection: &Selection, commands: &mut Commands) {
    let joints: Vec<Uid> = selection.0.iter().copied().filter(|joint| rig.joint(*joint).is_some()).collect();
    if joints.is_empty() {
        return;
    }
    let is_free = joints.iter().any(|joint| rig.joint(*joint).is_some_and(|joint| !joint.data.locked));
    commands.write_message(EditRequest::operation(entity, Operation::Lock(joints, is_free)));
}
