//! The next sensible step, in one line, from what there is: a mesh, joints, weights, a build.

use bevy::prelude::*;

use super::{
    ActiveRig,
    actions::Action,
    counts::{built_commands, counted},
    keys::KeyBindings,
    mode::Mode,
    panels::{
        skinning::{is_held, mesh_name, needs_weights},
        timeline::{OpenClip, Timeline, TimelineAction},
    },
};
use crate::{
    plugins::{
        commands::{BuildFailure, BuildResult, Processor},
        fit::FitJob,
        skinning::SkinningJob,
        surface::{RigMesh, RigMeshes},
    },
    rig::{BuiltRig, Rig, TagKind},
};

/// True if one of a rig's meshes has weights for joints that the rig has.
pub fn has_weights<'a>(rig: &Rig, built: Option<&BuiltRig>, mut meshes: impl Iterator<Item = &'a RigMesh>) -> bool {
    meshes.any(|mesh| rig.skin(mesh.uid).is_some_and(|skin| !skin.weights.is_empty() && is_held(rig, built, skin)))
}

/// The next sensible step for a person; `None` while something is being computed, or without a rig.
pub fn next_step(world: &World) -> Option<String> {
    let entity = world.get_resource::<ActiveRig>()?.0;
    let rig = world.get::<Rig>(entity)?;
    let keys = world.get_resource::<KeyBindings>();
    let key = |action: Action| keys.and_then(|keys| keys.key(action)).map_or_else(String::new, ToString::to_string);
    let meshes: Vec<Entity> = world.get::<RigMeshes>(entity).map_or_else(Vec::new, |meshes| meshes.iter().collect());
    if meshes.iter().any(|mesh| world.get::<SkinningJob>(*mesh).is_some() || world.get::<FitJob>(*mesh).is_some()) {
        return None;
    }
    if world.get::<BuildFailure>(entity).is_none()
        && let Some(next) = of_clip(world, &key)
    {
        return Some(next);
    }
    let joints = counted(rig.len(), "joint", "joints");
    let built = world.get::<BuildResult>(entity).map(|built| &*built.0);
    let is_skinned = has_weights(rig, built, meshes.iter().filter_map(|mesh| world.get::<RigMesh>(*mesh)));
    let has_commands =
        rig.walk().flat_map(|joint| &joint.data.tags).any(|tag| matches!(tag.kind, TagKind::Command { .. }));
    Some(match (meshes.is_empty(), rig.is_empty()) {
        (true, true) => format!("Open a mesh or a template with {}, or place a joint.", key(Action::Open)),
        (false, true) => format!(
            "{} puts a skeleton into the mesh; {} draws a chain.",
            key(Action::Fit),
            key(Action::Mode(Mode::Stroke))
        ),
        _ if world.get::<BuildFailure>(entity).is_some() => {
            "The build stopped: the Process panel shows at which command, and why.".to_owned()
        }
        (no_mesh, false) => {
            let builder = world.get::<Processor>(entity).map(Processor::builder);
            if let Some(builder) = builder.filter(|builder| has_commands && builder.cursor() < builder.len()) {
                return Some(format!("Built {}: {} builds all.", built_commands(builder), key(Action::Build)));
            }
            let mut models = meshes.iter().filter_map(|mesh| world.get::<RigMesh>(*mesh));
            if let Some(bare) = models.find(|mesh| is_skinned && needs_weights(rig, built, mesh)) {
                let (name, skin) = (mesh_name(bare), key(Action::Skin));
                return Some(format!(
                    "{name} has no weights yet: {skin} skins what has none, the rest keeps its weights."
                ));
            }
            match rig.clips() {
                _ if !no_mesh && !is_skinned => {}
                [] => {}
                [only] => return Some(format!("The rig has a clip, \"{}\": choose it in the Timeline.", only.name)),
                several => {
                    let clips = counted(several.len(), "clip", "clips");
                    return Some(format!("The rig has {clips}: choose one in the Timeline."));
                }
            }
            match (no_mesh, is_skinned, has_commands) {
                (false, false, _) => format!("{joints}, no weights yet: {} skins.", key(Action::Skin)),
                (_, _, true) => {
                    format!("Move the controls in {} mode, or export with {}.", Mode::Pose.name(), key(Action::Export))
                }
                (false, true, false) => {
                    format!(
                        "{} poses; add a part or tags for controls; {} exports.",
                        key(Action::Mode(Mode::Pose)),
                        key(Action::Export)
                    )
                }
                (true, _, false) => format!("{joints}: add a part or tags, or open a mesh with {}.", key(Action::Open)),
            }
        }
    })
}

/// The next step with the open clip.
fn of_clip(world: &World, key: &impl Fn(Action) -> String) -> Option<String> {
    let of = |action: TimelineAction| key(Action::Timeline(action));
    let open = OpenClip::of(world)?;
    let timeline = world.get_resource::<Timeline>()?;
    let frame = open.frame().round();
    Some(if timeline.playing {
        format!("{} halts the clip.", of(TimelineAction::Play))
    } else if timeline.auto_key {
        format!("Move a control in {} mode: its keys are set at frame {frame}.", Mode::Pose.name())
    } else if open.clip.key_count() == 0 {
        let (one, all) = (of(TimelineAction::Key), of(TimelineAction::KeyAll));
        format!("The clip has no keys: pose controls, then {one} keys the selected ones at frame {frame}, {all} all.")
    } else {
        format!(
            "{} plays; {} keys the selected controls at frame {frame}; drag in the ruler to scrub.",
            of(TimelineAction::Play),
            of(TimelineAction::Key)
        )
    })
}
