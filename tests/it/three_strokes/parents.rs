//! Parents of drawn chains: the nearest joint, and the selected one.

use super::*;

#[test]
fn what_a_chain_hangs_on() {
    let mut bench = Workbench::new(3, "parents");
    let rig = bench.rig_entity();
    let plane = Some(MirrorPlane::sagittal(2.0));
    bench.app_mut().world_mut().get_mut::<Symmetry>(rig).unwrap().0 = plane;
    let chain = |bench: &mut Workbench, places: &[[f32; 3]], parent: Option<Uid>| {
        let positions = places.iter().map(|place| Vec3::from(*place)).collect();
        bench.operate(Operation::Chain { positions, parent }).unwrap();
        bench.app_mut().world().get::<Selection>(rig).unwrap().active().unwrap()
    };
    let tip = chain(&mut bench, &[[0.0, 1.0, 0.0], [0.0, 1.2, 0.0], [0.0, 1.4, 0.0], [0.0, 1.6, 0.0]], None);
    let hand = chain(&mut bench, &[[0.2, 1.4, 0.0], [0.4, 1.2, 0.0], [0.6, 1.0, 0.0]], Some(tip));
    let joints: Vec<(Uid, Vec3)> =
        bench.rig().rest_globals().into_iter().map(|(uid, global)| (uid, global.translation)).collect();
    let spine: Vec<Uid> = joints.iter().filter(|(_, place)| place.x == 0.0).map(|(uid, _)| *uid).collect();
    let nearest = |start: [f32; 3], plane| nearest_parent(bench.rig(), plane, &joints, start.into()).unwrap();
    for (start, expected) in [
        ([0.1, 0.95, 0.0], 0),
        ([0.1, 1.05, 0.0], 0),
        ([0.1, 1.15, 0.0], 1),
        ([0.2, 1.38, 0.0], 2),
        ([0.2, 1.5, 0.0], 2),
        ([0.1, 1.58, 0.0], 3),
        ([0.0, 2.0, 0.0], 3),
        ([0.6, 1.0, 0.0], 0),
    ] {
        assert_eq!(nearest(start, plane), spine[expected], "{start:?}");
    }
    assert_eq!(nearest([0.62, 0.98, 0.0], None), hand, "without symmetry every joint counts");
    // Two fingers on a hand: the third finds it.
    chain(&mut bench, &[[0.65, 0.9, 0.0], [0.67, 0.85, 0.0]], Some(hand));
    chain(&mut bench, &[[0.67, 0.92, 0.0], [0.69, 0.87, 0.0]], Some(hand));
    let joints: Vec<(Uid, Vec3)> =
        bench.rig().rest_globals().into_iter().map(|(uid, global)| (uid, global.translation)).collect();
    assert_eq!(nearest_parent(bench.rig(), plane, &joints, Vec3::new(0.68, 0.94, 0.0)), Some(hand));

    let selection = |joint: Option<Uid>| Selection(joint.into_iter().collect());
    let parent = |rule, selected: Option<Uid>| {
        stroke_parent(rule, bench.rig(), &selection(selected), None, plane, &joints, Vec3::new(0.1, 0.95, 0.0))
    };
    assert_eq!(parent(StrokeParent::Selected, Some(hand)), (Some(hand), ParentReason::Selected));
    assert_eq!(parent(StrokeParent::Natural, Some(hand)), (Some(hand), ParentReason::Selected), "nobody drew it");
    assert_eq!(parent(StrokeParent::Natural, None), (None, ParentReason::Root));
    assert_eq!(parent(StrokeParent::Nearest, Some(hand)), (Some(spine[0]), ParentReason::Nearest));
    assert_eq!(parent(StrokeParent::Joint(Some(tip)), None), (Some(tip), ParentReason::Selected));
}
