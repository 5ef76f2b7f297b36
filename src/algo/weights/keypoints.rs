//! Joints on the skin. Rigs of key points have them in faces: a bone that runs to the nose tells where the nose is, and not
//! up to where the neck turns. Last joints of fingers that lie a little outside of the finger are set into it.

use glam::Vec3;

use super::{WeightJoint, roots::parents_first, sight::Sight};

/// A joint lies on the skin if it is no further from it than this share of the bone that leads there.
const ON_SKIN: f32 = 0.05;
/// Joints closer than this beside a mesh of size 2 share a place.
const SAME: f32 = 1e-4;
/// Lengths of bones that differ by more than this share are not a pair's.
const ALIKE: f32 = 0.2;
/// Share of a bone from the neck to the nose that lies in the neck.
const IN_NECK: f32 = 0.45;

/// A last joint outside of the surface is set into the flesh if it is no further from it than this share of the bone that leads
/// there.
const BESIDE: f32 = 0.15;
/// A joint at least this share of the thickness of the flesh outside is set into the middle of it, and one that is nearer less
/// deep. So a joint flush with the skin, as in the ball of a baby's foot, lies by the skin, whichever side of it the joint is on.
const APART: f32 = 0.12;

/// The joints, with last ones that lie just outside of the surface in the flesh that is nearest to them. Beside
/// the finger, the bone of a last joint would see one side of the flesh, and little of it.
pub(super) fn set_into_flesh(mut joints: Vec<WeightJoint>, sight: &Sight) -> Vec<WeightJoint> {
    let children = parents_first(&joints).1;
    let inner = |index: usize| -> Option<Vec3> {
        let WeightJoint { head, parent, tail, .. } = joints[index];
        let length = joints[parent?].head.distance(head);
        if tail.is_some() || !children[index].is_empty() {
            return None;
        }
        let skin = sight.nearest(head)?;
        let gap = skin.distance(head);
        if gap <= SAME || gap > BESIDE * length || sight.is_inside(head) {
            return None;
        }
        let inward = (skin - head) / gap;
        // A little below the skin, so that the first surface met is the one behind the flesh.
        let thickness = sight.first(skin + inward * SAME, inward)?;
        let depth = (gap / (APART * thickness)).min(1.0) * thickness * 0.5;
        Some(skin + inward * depth.max(SAME))
    };
    let places: Vec<Option<Vec3>> = (0..joints.len()).map(inner).collect();
    for (joint, place) in joints.iter_mut().zip(places) {
        joint.head = place.unwrap_or(joint.head);
    }
    joints
}

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
