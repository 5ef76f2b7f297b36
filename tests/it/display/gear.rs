//! Objects that hang on a joint of an imported character.

use rigsmith::rig::character::import_skeleton;

use super::*;
use crate::carried_objects::{armed, turned};

#[test]
fn what_hangs_on_a_joint_is_drawn_where_the_joint_holds_it() {
    let model = armed();
    let skeleton = import_skeleton(&model, &mut UidSource::seeded(7));
    let hand = skeleton.nodes[1];
    let mut bench = Bench::new(model);
    let skin = RigEdit::SetSkin(MESH, skeleton.skin);
    bench.apply_all(skeleton.edits.into_iter().chain([skin]).collect());
    bench.settle();
    bench.assert_still();
    bench.apply(RigEdit::SetOffset(hand, Some(turned())));
    bench.settle();
    let place = bench.app.world().get::<GlobalTransform>(bench.rig).unwrap().affine();
    let [was, tip] = [Vec3::new(0.4, 1.6, 0.05), Vec3::new(-0.7, 1.3, 0.05)].map(|point| place.transform_point3(point));
    let shown = bench.skinned();
    assert!(shown.iter().any(|point| point.distance(tip) < 1e-4), "{shown:?}");
    assert!(shown.iter().all(|point| point.distance(was) > 0.1), "{shown:?}");
}
