//! Joints on the skin, as rigs of key points have them in faces: a bone that runs to the nose tells where the nose is, and not
//! up to where the neck turns.

use super::{WeightJoint, roots::parents_first, sight::Sight};

/// A joint lies on the skin if it is no further from it than this share of the bone that leads there.
const ON_SKIN: f32 = 0.05;
/// Joints closer than this beside a mesh of size 2 share a place.
const SAME: f32 = 1e-4;
/// Lengths of bones that differ by more than this share are not a pair's.
const ALIKE: f32 = 0.2;
/// Share of a bone from the neck to the nose that lies in the neck.
const IN_NECK: f32 = 0.45;

/// The joints as bones are to run between them: a pair that begins at one place on the skin, as the bones from the nose to
/// both eyes, begins in the flesh before it. Otherwise the joint above would hold all that is around its long bone: of a neck
/// that ends at the nose, the face.
pub(super) fn set_back(joints: &[WeightJoint], sight: &Sight) -> Vec<WeightJoint> {
    let children = parents_first(joints).1;
    let distance = |a: usize, b: usize| joints[a].head.distance(joints[b].head);
    let mut moved = joints.to_vec();
    for (parent, pair) in children.iter().enumerate() {
        let [left, right] = pair[..] else { continue };
        let ([left_end], [right_end]) = (&children[left][..], &children[right][..]) else { continue };
        let (length, other) = (distance(left, *left_end), distance(right, *right_end));
        let is_pair = distance(left, right) <= SAME && length.min(other) > SAME;
        if !is_pair || (length - other).abs() > ALIKE * length.max(other) || distance(parent, left) <= SAME {
            continue;
        }
        let (from, to) = (joints[parent].head, joints[left].head);
        if sight.gap(to).is_some_and(|gap| gap <= ON_SKIN * from.distance(to)) {
            let place = from.lerp(to, IN_NECK);
            moved[left].head = place;
            moved[right].head = place;
        }
    }
    moved
}
