//! Motion of a skeleton of its own, from motion capture for example.
//!
//! A [`Motion`] has joints with rest transforms, and for each frame the values of their channels in one flat list. Transforms
//! of a frame are computed when they are asked for.

use bevy::math::{Quat, Vec3};

use super::{Marker, sample::slerp};
use crate::mesh::model::Trs;

/// Animated value of a joint of a [`Motion`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionChannel {
    /// Coordinate of the joint relative to its parent, in place of that of its rest translation; axis 0 to 2.
    Position(u8),
    /// Rotation about an axis 0 to 2 in degrees; rotations of a joint multiply in the order of its channels.
    Rotation(u8),
    /// Component 0 to 3 (x, y, z, w) of the rotation relative to the parent, in place of that at rest.
    Turn(u8),
    /// Scale factor along an axis 0 to 2, in place of that at rest.
    Scale(u8),
}

/// Joint of a [`Motion`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MotionJoint {
    /// Name in the file.
    pub name: String,
    /// Index of the parent, smaller than the joint's own.
    pub parent: Option<usize>,
    /// Rest transform relative to the parent.
    pub rest: Trs,
    /// Channels in the order of their values.
    pub channels: Vec<MotionChannel>,
    /// Ends of the bone without a joint of their own, relative to the joint.
    pub ends: Vec<Vec3>,
}

/// Skeleton with its motion frame by frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Motion {
    /// Name of the motion.
    pub name: String,
    /// Joints, parents before children.
    pub joints: Vec<MotionJoint>,
    /// Seconds from one frame to the next, above zero.
    pub frame_time: f32,
    /// Values of all frames: frame after frame, joint after joint, channel after channel; finite.
    pub values: Vec<f32>,
    /// Transforms of the joints in the motion's space in the pose in which a mesh was bound to them; empty without one,
    /// and where that is the rest pose.
    pub bind_pose: Vec<Trs>,
    /// True if the file says that the motion is played over and over.
    pub looped: bool,
    /// Named moments, by rising time: seconds after the first frame.
    pub markers: Vec<Marker>,
    /// Remarks of the reader, a sentence each.
    pub notes: Vec<String>,
}

impl Motion {
    /// Number of values of a frame.
    pub fn width(&self) -> usize {
        self.joints.iter().map(|joint| joint.channels.len()).sum()
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.values.len().checked_div(self.width()).unwrap_or_default()
    }

    /// Seconds from the first frame to the last.
    pub fn duration(&self) -> f32 {
        self.frames().saturating_sub(1) as f32 * self.frame_time
    }

    /// Joint with that name, the first of several.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Rest transforms in the motion's space.
    pub fn rest_globals(&self) -> Vec<Trs> {
        self.chained(self.joints.iter().map(|joint| joint.rest))
    }

    /// Transforms of a frame relative to the parents; those at rest for a frame that is not there.
    pub fn locals(&self, frame: usize) -> Vec<Trs> {
        let width = self.width();
        let row = self.values.get(frame * width..(frame + 1) * width).unwrap_or_default();
        let mut at = 0;
        let local = |joint: &MotionJoint| {
            let values = row.get(at..at + joint.channels.len()).unwrap_or_default();
            at += joint.channels.len();
            joint.local(values)
        };
        self.joints.iter().map(local).collect()
    }

    /// Transforms of a frame in the motion's space.
    pub fn globals(&self, frame: usize) -> Vec<Trs> {
        self.chained(self.locals(frame).into_iter())
    }

    /// Transforms in the motion's space at a second, between frames mixed from both neighbours.
    pub fn globals_at(&self, time: f32) -> Vec<Trs> {
        let place = (time / self.frame_time).clamp(0.0, self.frames().saturating_sub(1) as f32);
        let (frame, share) = (place.floor(), place - place.floor());
        // Rounding puts a time beside its frame.
        if !(1e-3..=1.0 - 1e-3).contains(&share) {
            return self.globals(place.round() as usize);
        }
        let (from, to) = (self.locals(frame as usize), self.locals(frame as usize + 1));
        let mixed = |(from, to): (&Trs, &Trs)| Trs {
            translation: from.translation.lerp(to.translation, share),
            rotation: slerp(from.rotation, to.rotation, share),
            scale: if from.scale == to.scale { from.scale } else { from.scale.lerp(to.scale, share) },
        };
        self.chained(from.iter().zip(&to).map(mixed))
    }

    fn chained(&self, locals: impl Iterator<Item = Trs>) -> Vec<Trs> {
        let mut globals: Vec<Trs> = Vec::with_capacity(self.joints.len());
        for (joint, local) in self.joints.iter().zip(locals) {
            let global = joint.parent.and_then(|parent| globals.get(parent)).map_or(local, |parent| *parent * local);
            globals.push(global);
        }
        globals
    }
}

impl MotionJoint {
    /// Transform relative to the parent for values of the channels.
    fn local(&self, values: &[f32]) -> Trs {
        let mut local = self.rest;
        let mut is_turned = false;
        for (channel, value) in self.channels.iter().zip(values) {
            match *channel {
                MotionChannel::Position(axis) => local.translation[usize::from(axis)] = *value,
                MotionChannel::Rotation(axis) => {
                    let turn = about(axis, value.to_radians());
                    local.rotation = if is_turned { local.rotation * turn } else { turn };
                    is_turned = true;
                }
                MotionChannel::Turn(part) => {
                    let mut parts = local.rotation.to_array();
                    parts[usize::from(part)] = *value;
                    local.rotation = Quat::from_array(parts);
                }
                MotionChannel::Scale(axis) => local.scale[usize::from(axis)] = *value,
            }
        }
        let is_rotation = local.rotation.length_squared() > 1e-12;
        local.rotation = if is_rotation { local.rotation.normalize() } else { self.rest.rotation };
        local
    }
}

fn about(axis: u8, angle: f32) -> Quat {
    let (sin, cos) = bevy::math::ops::sin_cos(0.5 * angle);
    match axis {
        0 => Quat::from_xyzw(sin, 0.0, 0.0, cos),
        1 => Quat::from_xyzw(0.0, sin, 0.0, cos),
        _ => Quat::from_xyzw(0.0, 0.0, sin, cos),
    }
}
