//! A motion on joints: offsets of joints that no command drives.

use super::{body::Body, pose::Pose, tracks::KeyedTracks};
use crate::rig::{PoseOffset, RestTransform};

/// Offsets of all joints that the motion moves.
pub(super) fn keyed(body: &Body, poses: &[Pose]) -> KeyedTracks {
    let hips = body.hips_place(0, 0.0).map(|(joint, _)| joint);
    let joints = body.target.joints.iter().enumerate().filter(|(at, _)| body.is_moved(*at));
    let nodes = joints.map(|(at, joint)| {
        let rest = RestTransform::from(joint.local);
        let offset = |pose: &Pose| {
            let local = joint.parent.map_or(pose[at], |parent| pose[at].relative_to(&pose[parent]));
            let posed = bevy::prelude::Transform {
                translation: if hips == Some(at) { local.translation } else { rest.translation },
                rotation: local.rotation,
                scale: rest.scale,
            };
            PoseOffset::between(&rest, &posed)
        };
        (joint.uid, poses.iter().map(offset).collect())
    });
    KeyedTracks { nodes: nodes.collect(), ..KeyedTracks::default() }
}
