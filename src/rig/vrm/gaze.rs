//! Movement of the eyes.

use glam::Vec3;

use super::{HumanNodes, expressions::plain};
use crate::mesh::{
    model::{Model, Trs},
    vrm::{Expressions, LookAt, LookAtKind, RangeMap},
};

/// Largest angle to the sides in degrees, as far as the shapes of a face look.
const ASIDE: f32 = 30.0;

/// Largest angle up and down in degrees.
const UPRIGHT: f32 = 25.0;

/// Height of the eyes above the head's node in metres, where nothing says where they are.
const ABOVE_HEAD: f32 = 0.06;

/// Movement of the eyes by their bones, or by expressions where there are no bones; `None` without both. `globals` are the
/// nodes in the model's space at rest.
///
/// Eyes look straight at what they look at, until they reach the end of their range.
pub fn look_at(model: &Model, globals: &[Trs], human: &HumanNodes, expressions: &Expressions) -> Option<LookAt> {
    let head = globals[human.get("head")?];
    let eyes = [human.get("leftEye"), human.get("rightEye")];
    let looks = ["lookUp", "lookDown", "lookLeft", "lookRight"];
    let (kind, middle) = match eyes {
        [Some(left), Some(right)] => (LookAtKind::Bone, globals[left].translation.midpoint(globals[right].translation)),
        _ if looks.iter().all(|look| expressions.preset.contains_key(*look)) => {
            let lids = [lid(model, "eyeblinkleft"), lid(model, "eyeblinkright")];
            let otherwise = || head.translation + Vec3::Y * ABOVE_HEAD;
            let middle = lids[0].zip(lids[1]).map_or_else(otherwise, |(left, right)| left.midpoint(right));
            (LookAtKind::Expression, middle)
        }
        _ => return None,
    };
    let range = |angle: f32| RangeMap {
        input_max_value: angle,
        output_scale: if kind == LookAtKind::Bone { angle } else { 1.0 },
    };
    Some(LookAt {
        offset_from_head_bone: head.rotation.inverse() * (middle - head.translation),
        kind,
        range_map_horizontal_inner: range(ASIDE),
        range_map_horizontal_outer: range(ASIDE),
        range_map_vertical_down: range(UPRIGHT),
        range_map_vertical_up: range(UPRIGHT),
    })
}

/// Middle of what a morph target moves, in the model's space at rest.
fn lid(model: &Model, name: &str) -> Option<Vec3> {
    let rest = model.at_rest();
    let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
    for part in &rest.parts {
        let names = rest.objects.get(part.object).map_or(&[][..], |object| &object.morph_names);
        for (_, morph) in names.iter().zip(&part.morphs).filter(|(known, _)| plain(known) == name) {
            for (point, offset) in part.vertices.iter().zip(&morph.positions) {
                let length = offset.length();
                sum += rest.points[*point as usize] * length;
                weight += length;
            }
        }
    }
    (weight > 0.0).then(|| sum / weight)
}
