//! Chains of joints that are deeper than a stack of calls would be.

use rigsmith::{plugins::schema::NodeOf, rig::RestTransform};

use super::*;

/// Joints of a chain. If the despawning of each led to that of the next one, they would take several times [`STACK`].
const JOINTS: usize = 4_000;
/// Bytes of the stack on which rigs are despawned.
pub const STACK: usize = 256 << 10;

/// Despawns an entity on a thread with a small stack.
pub fn despawn_on_a_small_stack(app: &mut App, entity: Entity) {
    let world = app.world_mut();
    std::thread::scope(|scope| {
        let despawn = move || world.despawn(entity);
        let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, despawn);
        assert!(thread.unwrap().join().unwrap());
    });
}

#[test]
fn a_deep_rig_is_despawned_with_all_that_hangs_on_it() {
    let mut rig = Rig::new(Uid(1), "deep");
    for number in 0..JOINTS as u64 {
        let rest = RestTransform::from_translation(Vec3::Y * 0.01);
        let joint = rigsmith::rig::JointData { uid: Uid(10 + number), rest, ..Default::default() };
        let parent = number.checked_sub(1).map(|above| Uid(10 + above));
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
    }
    let mut bench = RigBench::started(rig);
    let last = bench.joint(Uid(9 + JOINTS as u64));
    let world = bench.app.world_mut();
    let hung = world.spawn((Transform::default(), ChildOf(last))).id();
    let beside = world.spawn(Rig::new(Uid(2), "beside")).id();
    bench.app.update();
    let nodes =
        |bench: &RigBench| bench.app.world().iter_entities().filter(|entity| entity.contains::<NodeOf>()).count();
    assert_eq!(nodes(&bench), JOINTS);
    let rig = bench.rig;
    despawn_on_a_small_stack(&mut bench.app, rig);
    bench.frames(2);
    assert_eq!(nodes(&bench), 0);
    let is_there = |entity: Entity| bench.app.world().get_entity(entity).is_ok();
    assert!(!is_there(rig) && !is_there(hung) && is_there(beside));
}
