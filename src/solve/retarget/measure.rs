//! Feet and hands of a clip as it is played on the rig: how far standing feet slide, how high their ankles are, and how far hands
//! slide that hold something.

use std::sync::Arc;

use serde::Serialize;

use super::{Stance, Touch, TouchTarget};
use crate::{
    rig::{
        Rig,
        animation::{
            RigClip,
            humanoid::{BodySide, HumanBone, HumanJoints, LimbBone},
        },
    },
    solve::{
        bake_clip::strike,
        program::{RigProgram, RigState},
    },
};

/// Feet of a clip, in hundredths of the height of the rig's joints.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FootReport {
    /// Number of times at which a whole foot stands.
    pub stances: usize,
    /// Largest way of an ankle on the ground while its foot stands.
    pub slide: f32,
    /// Largest distance of a standing ankle from its height at rest; feet that stand above the ground do not count.
    pub ankle: f32,
}

/// Plays a clip on the rig and measures the ankles at its frames while feet stand flat. `bones` are indices in the order of
/// [`Rig::walk`]; Y is up.
pub fn measure_feet(
    rig: &Rig,
    program: &Arc<RigProgram>,
    clip: &RigClip,
    bones: &HumanJoints,
    stances: &[Stance],
) -> FootReport {
    let globals = rig.rest_globals();
    let heights = || globals.iter().map(|(_, at)| at.translation.y);
    let height = heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min);
    let mut report = FootReport::default();
    if height.is_nan() || height <= 0.0 {
        return report;
    }
    let mut state = RigState::new(program.clone());
    for stance in stances.iter().filter(|stance| stance.flat) {
        let side = if stance.left { BodySide::Left } else { BodySide::Right };
        let foot = bones.get(&HumanBone::Limb(side, LimbBone::Foot)).and_then(|joints| globals.get(*joints.first()?));
        let Some((uid, rest)) = foot else { continue };
        let count = ((stance.span[1] - stance.span[0]) * clip.frame_rate).round() as usize;
        let places: Vec<glam::Vec3> = (0..=count)
            .map(|frame| {
                strike(&mut state, &clip.sample(stance.span[0] + frame as f32 / clip.frame_rate));
                state.global(*uid).unwrap_or_default().translation
            })
            .collect();
        report.stances += 1;
        let level = |place: &glam::Vec3| glam::Vec2::new(place.x, place.z);
        for place in &places {
            report.slide = report.slide.max(100.0 * level(place).distance(level(&places[0])) / height);
        }
        let mean = places.iter().map(|place| place.y).sum::<f32>() / places.len() as f32;
        if (mean - rest.translation.y).abs() < 0.05 * height {
            let off = places.iter().map(|place| (place.y - rest.translation.y).abs()).fold(0.0, f32::max);
            report.ankle = report.ankle.max(100.0 * off / height);
        }
    }
    report
}

/// Hands of a clip, in hundredths of the height of the rig's joints.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct HandReport {
    /// Number of times at which a hand touches something.
    pub touches: usize,
    /// Largest way of a wrist while its hand touches something that stands still in the world.
    pub slide: f32,
}

/// Plays a clip on the rig and measures the wrists at its frames while hands touch something. `bones` are indices in the order of
/// [`Rig::walk`].
pub fn measure_hands(
    rig: &Rig,
    program: &Arc<RigProgram>,
    clip: &RigClip,
    bones: &HumanJoints,
    touches: &[Touch],
) -> HandReport {
    let globals = rig.rest_globals();
    let heights = || globals.iter().map(|(_, at)| at.translation.y);
    let height = heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min);
    let mut report = HandReport { touches: touches.len(), slide: 0.0 };
    if height.is_nan() || height <= 0.0 {
        return report;
    }
    let mut state = RigState::new(program.clone());
    for touch in touches.iter().filter(|touch| touch.thing == TouchTarget::World) {
        let side = if touch.left { BodySide::Left } else { BodySide::Right };
        let hand = bones.get(&HumanBone::Limb(side, LimbBone::Hand)).and_then(|joints| globals.get(*joints.first()?));
        let Some((uid, _)) = hand else { continue };
        let count = ((touch.span[1] - touch.span[0]) * clip.frame_rate).round() as usize;
        let mut first = None;
        for frame in 0..=count {
            strike(&mut state, &clip.sample(touch.span[0] + frame as f32 / clip.frame_rate));
            let place = state.global(*uid).unwrap_or_default().translation;
            let way = first.get_or_insert(place).distance(place);
            report.slide = report.slide.max(100.0 * way / height);
        }
    }
    report
}
