//! Joints that two rigs have in common, held once while the rigs are compared.

use std::sync::Arc;

use crate::rig::{RestTransform, Rig};

/// Gives a rig the joints of another where they are equal, with the same zeros: a text may have another sign of one.
pub(super) fn share_equal_joints(rig: &mut Rig, other: &Rig) {
    for (uid, joint) in &mut rig.joints {
        let same = other.joints.get(uid).filter(|same| ***same == **joint);
        if let Some(same) = same.filter(|same| bits(&same.data.rest) == bits(&joint.data.rest)) {
            *joint = Arc::clone(same);
        }
    }
}

fn bits(rest: &RestTransform) -> [u32; 10] {
    let ([x, y, z], [i, j, k, w]) = (rest.translation.to_array(), rest.rotation.to_array());
    let [a, b, c] = rest.scale.to_array();
    [x, y, z, i, j, k, w, a, b, c].map(f32::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::{Uid, format::template::read::read_text};

    #[test]
    fn equal_joints_of_two_rigs_are_held_once() {
        let [mut rig, other] = [1, 2].map(|y| {
            let moved = format!("(label: \"b\", translation: (0, {y}, 0))");
            read_text(&format!("(format: 2, name: \"n\", joints: [(label: \"a\"), {moved}])"), 1).unwrap().rig
        });
        let before = rig.clone();
        share_equal_joints(&mut rig, &other);
        assert_eq!(rig, before);
        let is_shared = |label: &str| {
            let uid = Uid::derived(["joint", label]);
            Arc::ptr_eq(&rig.joints[&uid], &other.joints[&uid])
        };
        assert_eq!(["a", "b"].map(is_shared), [true, false]);
        let uid = Uid::derived(["joint", "a"]);
        let mut other = before.clone();
        let mut rig = before;
        if let Some(joint) = other.joints.get_mut(&uid) {
            Arc::make_mut(joint).data.rest.translation.x = -0.0;
        }
        share_equal_joints(&mut rig, &other);
        assert_eq!(rig, other);
        assert!(!Arc::ptr_eq(&rig.joints[&uid], &other.joints[&uid]));
    }
}
