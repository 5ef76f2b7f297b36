//! Colours for weights.

use bevy::prelude::*;

use super::{WeightColors, build::influences};
use crate::rig::SkinData;

/// Colour of points without any weight.
const NONE: Srgba = Srgba::rgb(0.36, 0.36, 0.37);
/// Colours at equal steps of the weight. Matplotlib's "plasma" map: its lightness rises evenly with the weight, so that
/// it can be read without colour vision, too.
const RAMP: [[u8; 3]; 9] = [
    [13, 8, 135],
    [76, 2, 161],
    [126, 3, 168],
    [168, 34, 150],
    [204, 71, 120],
    [229, 107, 93],
    [248, 149, 64],
    [253, 195, 40],
    [240, 249, 33],
];

/// The colour of a weight in [`WeightColors::Joint`]: grey for none, then dark blue over red to yellow for one.
pub fn weight_color(weight: f32) -> Color {
    if weight <= 0.0 || !weight.is_finite() {
        return NONE.into();
    }
    let place = weight.min(1.0) * (RAMP.len() - 1) as f32;
    let step = (place as usize).min(RAMP.len() - 2);
    let [low, high] = [RAMP[step], RAMP[step + 1]].map(|[r, g, b]| Srgba::rgb_u8(r, g, b));
    low.mix(&high, place - step as f32).into()
}

/// The colour of a joint in [`WeightColors::AllJoints`], by its place in [`SkinData::joints`]. Neighbours in the list
/// differ most.
pub fn joint_color(joint: usize) -> Color {
    // Steps of the golden angle never return to the same hue; lightness distinguishes colours that colour vision may
    // not.
    let hue = (joint as f32 * 137.507_77) % 360.0;
    let lightness = [0.72, 0.52, 0.84][joint % 3];
    Oklcha::new(lightness, 0.13, hue, 1.0).into()
}

/// Colours of a mesh's points by weight.
pub(super) enum Painter {
    /// Weights of the joint with that number, if the skin has it.
    Joint(Option<u32>),
    /// Linear colours of all joints, by their place in [`SkinData::joints`].
    All(Vec<LinearRgba>),
}

impl Painter {
    /// Makes the painter of a mode; `None` while weights are not shown.
    pub fn new(colors: WeightColors, skin: Option<&SkinData>) -> Option<Self> {
        match colors {
            WeightColors::Off => None,
            WeightColors::Joint(joint) => {
                let number = skin.and_then(|skin| skin.joints.iter().position(|other| *other == joint));
                Some(Self::Joint(number.map(|number| number as u32)))
            }
            WeightColors::AllJoints => {
                let count = skin.map_or(0, |skin| skin.joints.len());
                Some(Self::All((0..count).map(|joint| joint_color(joint).to_linear()).collect()))
            }
        }
    }

    /// The linear colour of a point.
    pub fn color(&self, skin: Option<&SkinData>, point: usize) -> [f32; 4] {
        let Some(skin) = skin else { return NONE.into_linear() };
        match self {
            Self::Joint(joint) => {
                let own = influences(skin, point).filter(|(other, _)| Some(*other) == *joint);
                weight_color(own.map(|(_, weight)| weight).sum()).to_linear().to_f32_array()
            }
            Self::All(colors) => {
                let mut sum = Vec3::ZERO;
                let mut all = 0.0;
                for (joint, weight) in influences(skin, point) {
                    sum += colors[joint as usize].to_vec3() * weight;
                    all += weight;
                }
                if all > 0.0 { (sum / all).extend(1.0).to_array() } else { NONE.into_linear() }
            }
        }
    }
}

trait IntoLinear {
    fn into_linear(self) -> [f32; 4];
}

impl IntoLinear for Srgba {
    fn into_linear(self) -> [f32; 4] {
        LinearRgba::from(self).to_f32_array()
    }
}
