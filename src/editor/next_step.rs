//! The next sensible step, in one line, from what there is: a mesh, joints, weights, a build.

use bevy::prelude::*;

use super::{ActiveRig, actions::Action, keys::KeyBindings, mode::Mode, panels::skinning::is_held};
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
    let joints = match rig.len() {
        1 => "1 joint".to_owned(),
        count => format!("{count} joints"),
    };
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
                let (done, all) = (builder.cursor(), builder.len());
                return Some(format!("{done} of {all} commands are carried out: {} builds all.", key(Action::Build)));
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
