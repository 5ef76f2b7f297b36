//! Place, axes and units in which a figure stands as VRM 1.0 wants it.

use bevy::math::Vec3;

use super::human_axes;
use crate::{
    mesh::{model::Model, similarity::Similarity},
    rig::vrm::HumanNodes,
};

/// Heights of the head above the feet that count as metres.
const METRES: std::ops::RangeInclusive<f32> = 0.2..=10.0;

/// Similarity that turns a figure until it stands upright and faces +Z, scales it by a power of ten to the size of a human
/// where it cannot be in metres, and moves it over the origin. Heights stay.
pub(super) fn stance(model: &Model, human: &HumanNodes) -> Similarity {
    let globals = model.rest_globals();
    let place = |node: usize| Vec3::from(globals[node].translation);
    let rotation = human_axes(&human.joints, &place).unwrap_or_default().inverse();
    let height_of = |bone: &str| human.get(bone).map_or(0.0, |node| (rotation * place(node)).y);
    let height = height_of("head") - 0.5 * (height_of("leftFoot") + height_of("rightFoot"));
    let turned = Similarity { scale: factor(height), rotation, translation: Vec3::ZERO };
    let hips = human.get("hips").map_or(Vec3::ZERO, |hips| turned.point(place(hips)));
    let size = height * turned.scale;
    // Figures lean and step a little; only one that stands elsewhere is moved.
    let moved = |offset: f32, share: f32| if offset.abs() > share * size { -offset } else { 0.0 };
    Similarity { translation: Vec3::new(moved(hips.x, 0.02), 0.0, moved(hips.z, 0.15)), ..turned }
}

/// Power of ten that makes metres of a height.
fn factor(height: f32) -> f32 {
    if METRES.contains(&height) || !(height > 0.0 && height.is_finite()) {
        return 1.0;
    }
    let powers = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];
    powers.into_iter().find(|factor| (0.3..3.0).contains(&(height * factor))).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::factor;

    #[test]
    fn sizes_become_those_of_humans() {
        for (height, wanted) in [
            (1.5, 1.0),
            (0.3, 1.0),
            (8.0, 1.0),
            (150.0, 1e-2),
            (15.0, 1e-1),
            (1500.0, 1e-3),
            (0.015, 1e2),
            (0.0, 1.0),
            (f32::NAN, 1.0),
        ] {
            assert_eq!(factor(height), wanted, "{height}");
        }
    }
}
