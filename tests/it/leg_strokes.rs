//! Legs from one stroke: from the front and from the side, to the ankle and to the toes, on the bodies with truth.
//! Joints have names and axes from the moment they are drawn. `RIGSMITH_SEEDS` sets how many hands draw each stroke.

use bevy::prelude::*;
use rigsmith::{
    algo::{
        stroke::ChainChoice,
        view::{View, ViewPlane},
    },
    headless::Workbench,
    plugins::{document::Symmetry, gesture::Gesture},
    rig::{
        Uid,
        operations::{MirrorPlane, Operation},
    },
};

use crate::{
    random::Random,
    three_strokes::{Bench, Body, assert_no_faults, bodies, bundled, drawn, seeds},
};

/// A leg stroke.
#[derive(Debug, Clone, Copy)]
struct LegStroke {
    view: View,
    perspective: bool,
    to_toes: bool,
    /// Distance by which the knee is drawn too low, as a share of the height.
    knee_low: f32,
    seed: u64,
}

/// Hip, knee, ankle and the middle of the toes of the left leg.
fn leg(body: &Body) -> [Vec3; 4] {
    let [hip, knee, ankle, ball] = ["thigh_l", "calf_l", "foot_l", "ball_l"].map(|joint| body.at(joint));
    // The toes go on like the foot, for about a quarter of it.
    [hip, knee, ankle, ball + Vec3::new(0.0, 0.0, 0.25 * (ball - ankle).length())]
}

fn plane(bench: &Bench, stroke: LegStroke) -> ViewPlane {
    let middle = 0.5 * (bench.bounds[0] + bench.bounds[1]);
    let towards = if stroke.view == View::Front { Vec3::Z } else { Vec3::X };
    match stroke.perspective {
        true => ViewPlane::perspective(stroke.view, middle + towards * 1.6 * bench.height(), middle),
        false => ViewPlane::orthographic(stroke.view, bench.bounds),
    }
}

/// Draws the stroke on an empty rig; the chain on the left.
fn draw(bench: &mut Bench, body: &Body, stroke: LegStroke) -> Vec<Uid> {
    let all: Vec<Uid> = bench.bench.rig().walk().map(|joint| joint.data.uid).collect();
    if !all.is_empty() {
        bench.bench.operate(Operation::Delete { joints: all, keep_children: false }).unwrap();
    }
    let plane = plane(bench, stroke);
    let [hip, mut knee, ankle, toes] = leg(body);
    knee += (ankle - knee).normalize() * stroke.knee_low * bench.height();
    let mut line: Vec<Vec2> = [hip, knee, ankle, toes].iter().filter_map(|place| plane.project(*place)).collect();
    line.truncate(if stroke.to_toes { 4 } else { 3 });
    let stray = if stroke.knee_low > 0.0 { 0.004 } else { 0.012 };
    let points = drawn(&line, stray * bench.height(), &mut Random(stroke.seed.wrapping_mul(0x1234_5678_9abc_def1)));
    let size = (bench.bounds[1] - bench.bounds[0]).max_element();
    bench.stroke(plane, points, ChainChoice::Limb(0.02 * size));
    let rig = bench.bench.rig();
    rig.walk().filter(|joint| rig.position(joint.data.uid).x > 0.0).map(|joint| joint.data.uid).collect()
}

fn faults(bench: &Bench, body: &Body, stroke: LegStroke, left: &[Uid]) -> Vec<String> {
    let rig = bench.bench.rig();
    let mut faults = Vec::new();
    let count = if stroke.to_toes { 4 } else { 3 };
    if left.len() != count || rig.walk().count() != 2 * count {
        faults.push(format!("{} joints left, {} in all", left.len(), rig.walk().count()));
        return faults;
    }
    let [hip, knee, ankle, _] = leg(body);
    let length = hip.distance(knee) + knee.distance(ankle);
    let off = rig.position(left[1]).distance(knee) / length;
    if off > 0.08 {
        faults.push(format!("the knee is {:.1} % of the leg off", 100.0 * off));
    }
    let plane = MirrorPlane::sagittal(bench.height());
    for (number, joint) in left.iter().enumerate() {
        let name = format!("leg_l_{}", number + 1);
        let here = rig.joint(*joint).unwrap();
        let partner = here.data.mirror.and_then(|partner| rig.joint(partner)).unwrap();
        let names = [here.data.label.clone(), partner.data.label.clone()].map(Option::unwrap_or_default);
        if names != [name.clone(), name.replace("_l_", "_r_")] {
            faults.push(format!("named {names:?}, not {name}"));
        }
        let (global, other) = (rig.rest_global(*joint), rig.rest_global(partner.data.uid));
        if global.translation.x < 2.0 * plane.tolerance {
            faults.push(format!("{name} is at x {:.3}", global.translation.x));
        }
        let mirrored = plane.mirrored_affine(&global);
        if !other.matrix3.abs_diff_eq(mirrored.matrix3, 1e-4)
            || !other.translation.abs_diff_eq(mirrored.translation, 1e-5)
        {
            faults.push(format!("{name} and its partner are no mirror images"));
        }
        if let Some(next) = left.get(number + 1) {
            let bone = (rig.position(*next) - global.translation).normalize();
            if global.matrix3.y_axis.dot(bone) < 0.9999 {
                faults.push(format!("Y of {name} is {}, not along the bone {bone}", global.matrix3.y_axis));
            }
        }
    }
    // Knee and ankle bend about X, forwards and backwards: the shin turned about the knee's X stays beside the thigh.
    let axis = rig.rest_global(left[1]).matrix3.x_axis;
    let [thigh, shin] = [0, 1].map(|i| (rig.position(left[i + 1]) - rig.position(left[i])).normalize());
    let bend = thigh.cross(shin);
    if bend.length() > 0.2 && axis.dot(bend.normalize()).abs() < 0.98 {
        faults.push(format!("the knee's X is {axis}, its flexion axis {}", bend.normalize()));
    }
    faults
}

fn check(body: &Body) -> Vec<String> {
    let mut bench = Bench::new(body);
    let mut all = Vec::new();
    for seed in 0..seeds(4).max(1) {
        for view in [View::Front, View::Left] {
            for (to_toes, low) in [(false, 0.0), (true, 0.0), (false, 0.035)] {
                // The bend of a straight leg is not seen from its front.
                if low > 0.0 && view == View::Front {
                    continue;
                }
                let stroke = LegStroke { view, perspective: seed % 2 == 1, to_toes, knee_low: low, seed };
                let left = draw(&mut bench, body, stroke);
                let found = faults(&bench, body, stroke, &left);
                all.extend(found.into_iter().map(|fault| format!("{}, {stroke:?}: {fault}", body.name)));
            }
        }
    }
    all
}

#[test]
fn the_bundled_biped() {
    assert_no_faults(&check(&bundled()));
}

#[test]
fn bodies_of_all_kinds() {
    assert_no_faults(&bodies().iter().flat_map(check).collect::<Vec<_>>());
}

/// Labels of all joints, in order.
fn labels(bench: &Workbench) -> Vec<String> {
    bench.rig().walk().map(|joint| joint.data.label.clone().unwrap_or_default()).collect()
}

fn joint_of(bench: &Workbench, label: &str) -> Uid {
    bench.rig().walk().find(|joint| joint.data.label.as_deref() == Some(label)).unwrap().data.uid
}

fn chain(bench: &mut Workbench, places: &[[f32; 3]], parent: Option<Uid>) {
    let positions = places.iter().map(|place| Vec3::from(*place)).collect();
    bench.operate(Operation::Chain { positions, parent }).unwrap();
}

/// Strokes and clicks name joints by chain, side and place, chains go on with their numbers, and undoing takes the names
/// back.
#[test]
fn joints_are_named_when_they_are_made() {
    let mut bench = Workbench::new(7, "names");
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().get_mut::<Symmetry>(rig).unwrap().0 = Some(MirrorPlane::sagittal(2.0));
    let first = bench.rig().clone();
    chain(&mut bench, &[[0.0, 1.0, 0.0], [0.0, 1.2, 0.0], [0.0, 1.4, 0.0]], None);
    let top = joint_of(&bench, "spine_3");
    chain(&mut bench, &[[0.2, 1.4, 0.0], [0.5, 1.4, -0.05], [0.8, 1.4, 0.0]], Some(top));
    let pelvis = joint_of(&bench, "spine_1");
    chain(&mut bench, &[[0.1, 0.9, 0.0], [0.1, 0.5, 0.05], [0.1, 0.1, 0.0]], Some(pelvis));
    let ankle = joint_of(&bench, "leg_l_3");
    bench.operate(Operation::Place { position: Vec3::new(0.1, 0.05, 0.15), parent: Some(ankle) }).unwrap();
    let hand = joint_of(&bench, "arm_l_3");
    chain(&mut bench, &[[0.85, 1.4, 0.02], [0.9, 1.4, 0.02]], Some(hand));
    chain(&mut bench, &[[0.85, 1.38, 0.05], [0.88, 1.36, 0.06]], Some(hand));
    chain(&mut bench, &[[0.0, 1.6, 0.0], [0.0, 1.7, 0.0]], Some(top));
    chain(&mut bench, &[[0.0, 0.95, -0.2], [0.0, 0.8, -0.4]], Some(pelvis));
    let mut found = labels(&bench);
    found.sort();
    let sided = ["arm", "leg"].map(|chain| (chain, [3, 4][usize::from(chain == "leg")]));
    let mut expected: Vec<String> =
        ["spine_1", "spine_2", "spine_3", "neck_1", "neck_2", "tail_1", "tail_2"].map(String::from).into();
    for side in ["l", "r"] {
        expected
            .extend(sided.iter().flat_map(|(chain, count)| (1..=*count).map(move |n| format!("{chain}_{side}_{n}"))));
        // The first stroke from the hand goes on with the arm, the second is a finger.
        expected.extend(["arm", "arm"].iter().zip([4, 5]).map(|(chain, n)| format!("{chain}_{side}_{n}")));
        expected.extend((1..=2).map(|n| format!("finger_{side}_{n}")));
    }
    expected.sort();
    assert_eq!(found, expected);

    let elbow = joint_of(&bench, "arm_l_2");
    bench.operate(Operation::Insert { child: elbow, position: Vec3::new(0.35, 1.4, -0.02) }).unwrap();
    assert_eq!(bench.rig().joint(elbow).unwrap().data.label.as_deref(), Some("arm_l_3"), "numbered again");
    assert_eq!(
        bench.rig().joint(bench.rig().joint(elbow).unwrap().data.mirror.unwrap()).unwrap().data.label.as_deref(),
        Some("arm_r_3")
    );
    let undone = bench.gestures(vec![Gesture::Undo; 9]);
    assert!(undone.iter().all(|answer| answer.done), "{undone:?}");
    assert_eq!(*bench.rig(), first);
}

/// Arms that hang down begin at the shoulders, wherever the joint is that they hang on.
#[test]
fn arms_that_hang_are_no_legs() {
    for arm in
        [[[0.2, 1.4, 0.0], [0.35, 1.2, 0.0], [0.5, 1.0, 0.0]], [[0.2, 1.4, 0.0], [0.22, 1.1, 0.0], [0.2, 0.8, 0.05]]]
    {
        let mut bench = Workbench::new(7, "names");
        let rig = bench.rig_entity();
        bench.app_mut().world_mut().get_mut::<Symmetry>(rig).unwrap().0 = Some(MirrorPlane::sagittal(2.0));
        chain(&mut bench, &[[0.0, 0.95, 0.0], [0.0, 1.3, 0.0], [0.0, 1.8, 0.0]], None);
        let chest = joint_of(&bench, "spine_2");
        chain(&mut bench, &arm, Some(chest));
        let pelvis = joint_of(&bench, "spine_1");
        chain(&mut bench, &[[0.1, 0.9, 0.0], [0.1, 0.5, 0.05], [0.1, 0.1, 0.0]], Some(pelvis));
        let all = labels(&bench);
        for name in ["arm_l_1", "arm_l_3", "arm_r_3", "leg_l_1", "leg_r_3"] {
            assert!(all.iter().any(|label| label == name), "{name}: {all:?}");
        }
    }
}

/// Without symmetry both arms are drawn by hand: each gets the names of its side.
#[test]
fn sides_that_are_drawn_one_by_one_have_the_same_names() {
    let mut bench = Workbench::new(7, "names");
    chain(&mut bench, &[[0.0, 0.95, 0.0], [0.0, 1.3, 0.0], [0.0, 1.8, 0.0]], None);
    let chest = joint_of(&bench, "spine_2");
    for side in [1.0, -1.0] {
        chain(&mut bench, &[[0.2 * side, 1.4, 0.0], [0.5 * side, 1.4, -0.05], [0.8 * side, 1.4, 0.0]], Some(chest));
        chain(&mut bench, &[[0.2 * side, 1.6, 0.0], [0.5 * side, 1.6, -0.05], [0.8 * side, 1.6, 0.0]], Some(chest));
    }
    let mut found = labels(&bench);
    found.retain(|label| label.contains("arm"));
    found.sort();
    let expected = ["arm2_l", "arm2_r", "arm_l", "arm_r"].map(|chain| [1, 2, 3].map(|n| format!("{chain}_{n}")));
    assert_eq!(found, expected.concat());
}

/// Without symmetry a chain that crosses the middle, as fingers of a hand do, has one side: that of its end.
#[test]
fn a_chain_that_crosses_the_middle_has_one_side() {
    let mut bench = Workbench::new(7, "names");
    chain(&mut bench, &[[0.003, 0.0, 0.0], [-0.02, 0.1, 0.0], [-0.03, 0.2, 0.0]], None);
    let wrist = joint_of(&bench, "arm_r_1");
    chain(&mut bench, &[[-0.01, 0.1, 0.0], [0.02, 0.2, 0.0]], Some(wrist));
    let mut found = labels(&bench);
    found.sort();
    assert_eq!(found, ["arm_r_1", "arm_r_2", "arm_r_3", "finger_l_1", "finger_l_2"]);
}

/// Clicks that miss the middle by less than a pixel are in the middle; small things beside it are not.
#[test]
fn clicks_beside_the_middle_by_less_than_a_pixel_have_no_side() {
    let mut bench = Workbench::new(7, "names");
    chain(&mut bench, &[[0.0015, 1.0, 0.0], [-0.002, 1.2, 0.0], [0.0018, 1.4, 0.0]], None);
    chain(&mut bench, &[[0.004, 0.0, 0.1], [0.004, 0.05, 0.1], [0.004, 0.1, 0.1]], None);
    let found = labels(&bench);
    let sides: Vec<bool> = found.iter().map(|label| label.contains("_l_") || label.contains("_r_")).collect();
    assert_eq!(sides, [false, false, false, true, true, true], "{found:?}");
}

/// Labels that are there already may end with any number and hold any name.
#[test]
fn names_go_around_what_is_there() {
    let mut bench = Workbench::new(7, "names");
    let rig = bench.rig_entity();
    bench.app_mut().world_mut().get_mut::<Symmetry>(rig).unwrap().0 = Some(MirrorPlane::sagittal(2.0));
    bench.operate(Operation::Place { position: Vec3::new(0.0, 1.0, 0.0), parent: None }).unwrap();
    let root = joint_of(&bench, "root_1");
    bench.operate(Operation::Labels(vec![(root, "x_4294967295".into())])).unwrap();
    chain(&mut bench, &[[0.0, 1.2, 0.0], [0.0, 1.4, 0.0]], Some(root));
    let top = bench.rig().walk().last().unwrap().data.uid;
    bench.operate(Operation::Place { position: Vec3::new(0.0, 1.6, 0.0), parent: Some(top) }).unwrap();
    chain(&mut bench, &[[0.2, 1.4, 0.0], [0.5, 1.4, -0.05]], Some(root));
    // The name of the next joint's partner is taken.
    bench.operate(Operation::Labels(vec![(top, "arm_r_3".into())])).unwrap();
    let hand = joint_of(&bench, "arm_l_2");
    bench.operate(Operation::Place { position: Vec3::new(0.8, 1.4, 0.0), parent: Some(hand) }).unwrap();
    let all = labels(&bench);
    assert!(["arm_l_4", "arm_r_4"].iter().all(|name| all.iter().any(|label| label == name)), "{all:?}");
    let distinct: std::collections::BTreeSet<&String> = all.iter().collect();
    assert_eq!(distinct.len(), all.len(), "{all:?}");
    let mirrored = |label: &String| !label.contains("_l_") || all.contains(&label.replace("_l_", "_r_"));
    assert!(all.iter().all(mirrored), "{all:?}");
}
