//! Controls that are too small and too close together on the screen are neither drawn nor picked until the view is nearer.

use std::collections::BTreeSet;

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    algo::view::{View, ViewPlane},
    editor::{
        ActiveRig, building::BuildingPlugin, camera::ViewportSight, control_density::ControlDensityPlugin, mode::Mode,
        pointer::PointerAct, tools::ToolsPlugin,
    },
    headless::headless_app,
    plugins::{
        commands::BuildResult,
        controls::{
            density::{CLOSE, SMALL, crowded_controls},
            outline::{ControlNodes, ControlOutline},
        },
        runtime::RigRuntime,
        schema::RigNodes,
        viewport::{FIELD_OF_VIEW, RigViewport, Sight},
    },
    prelude::*,
    rig::LayerDisplay,
    test_app::strict_app,
};

use crate::{
    bench::{RigBench, shipped},
    viewport_app::{PLAIN, front},
};

/// A control in the form of a square, with sizes in pixels.
fn square(uid: u64, [x, y]: [f32; 2], side: f32) -> ControlOutline {
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)];
    let line = corners.map(|(a, b)| Vec3::new(x + a * side, y + b * side, 0.0) * PIXEL).to_vec();
    ControlOutline { uid: Uid(uid), lines: vec![line], color: [1.0; 3], display: LayerDisplay::Normal }
}

const PIXEL: f32 = 0.01;

#[test]
fn small_controls_close_together_are_crowded() {
    let plane = ViewPlane::orthographic(View::Front, [Vec3::splat(-3.0), Vec3::splat(3.0)]);
    let (small, large) = (SMALL - 1.0, SMALL + 1.0);
    let (near, far) = (CLOSE - 1.0, CLOSE + 1.0);
    let cases: [(Vec<ControlOutline>, &[u64]); 6] = [
        (vec![], &[]),
        (vec![square(1, [0.0, 0.0], 2.0)], &[]),
        (vec![square(1, [0.0, 0.0], small), square(2, [near, 0.0], 3.0)], &[1, 2]),
        (vec![square(1, [0.0, 0.0], small), square(2, [0.0, far], small)], &[]),
        (vec![square(1, [0.0, 0.0], large), square(2, [near, 0.0], small)], &[]),
        (
            vec![
                square(1, [50.0, 9.0], small),
                square(2, [0.0, 0.0], small),
                square(3, [40.0, 0.0], small),
                square(4, [90.0, 0.0], small),
            ],
            &[1, 3],
        ),
    ];
    for (controls, crowded) in cases {
        let expected: BTreeSet<Uid> = crowded.iter().map(|uid| Uid(*uid)).collect();
        assert_eq!(crowded_controls(&controls, &plane, PIXEL), expected, "{controls:?}");
    }
}

fn outlines(bench: &mut RigBench, with_crowded: bool) -> Vec<ControlOutline> {
    let rig = bench.rig;
    let visible = move |controls: ControlNodes, nodes: Query<&RigNodes>| {
        let (nodes, to_rig) = (nodes.get(rig).ok(), bevy::math::Affine3A::IDENTITY);
        if with_crowded { controls.visible_near(nodes, to_rig) } else { controls.visible(nodes, to_rig) }
    };
    bench.app.world_mut().run_system_once(visible).unwrap()
}

/// Controls that are seen, and those that the view leaves out.
fn split(bench: &mut RigBench) -> (BTreeSet<Uid>, BTreeSet<Uid>) {
    let seen: BTreeSet<Uid> = outlines(bench, false).iter().map(|control| control.uid).collect();
    let all = outlines(bench, true).into_iter().map(|control| control.uid);
    let hidden = all.filter(|uid| !seen.contains(uid)).collect();
    (seen, hidden)
}

#[test]
fn fingers_have_controls_once_the_hand_is_near() {
    let mut app = headless_app(1);
    app.add_plugins((ToolsPlugin, BuildingPlugin, ControlDensityPlugin));
    let mut bench = RigBench::with(strict_app(app), shipped("biped"));
    bench.app.insert_resource(ActiveRig(bench.rig)).insert_resource(ViewportSight(Some(front())));
    (0..4).for_each(|_| bench.app.update());
    let built = bench.get::<BuildResult>(bench.rig).expect("a built rig").0.clone();
    let label = |control: Uid| {
        let subject = built.node(control).and_then(|node| node.origin.as_ref()).map(|origin| origin.subject);
        subject.and_then(|joint| built.node(joint)?.label.as_ref().map(ToString::to_string)).unwrap_or_default()
    };
    let fingers = ["thumb_", "index_", "middle_", "ring_", "pinky_"];
    let is_finger = |control: &Uid| fingers.iter().any(|finger| label(*control).starts_with(finger));

    let (seen, hidden) = split(&mut bench);
    let (count, all) = (hidden.iter().filter(|uid| is_finger(uid)).count(), seen.iter().chain(&hidden));
    let all = all.filter(|uid| is_finger(uid)).count();
    assert!(count >= 20 && 4 * count >= 3 * all, "{count} of {all} controls of fingers are left out");
    assert!(seen.len() > 10 && seen.iter().any(|control| label(*control) == "hand_l"), "{} are seen", seen.len());

    // What is not drawn is not picked.
    bench.mode(Mode::Select);
    let sight = front();
    for control in outlines(&mut bench, true).into_iter().filter(|control| hidden.contains(&control.uid)) {
        let at = sight.project(control.lines[0][0]).unwrap();
        let click = PointerAct::Released { dragged: false, count: 1 };
        bench.point(PLAIN, &[(at, PointerAct::Moved), (at, PointerAct::Pressed), (at, click)]);
        bench.app.update();
        let picked = bench.selected();
        assert!(picked.iter().all(|node| !hidden.contains(node)), "{picked:?} is picked at {at}");
        bench.select(&[]);
    }

    // What is selected elsewhere is drawn, as long as it is selected.
    let finger = *hidden.iter().find(|uid| is_finger(uid)).unwrap();
    bench.select(&[finger]);
    bench.app.update();
    assert!(split(&mut bench).0.contains(&finger));
    bench.select(&[]);
    bench.app.update();
    assert_eq!(split(&mut bench), (seen, hidden));

    // From near all are there.
    let hand = built.find_label("hand_l").unwrap().uid;
    let place = bench.get::<RigRuntime>(bench.rig).unwrap().state().global(hand).unwrap().translation;
    let camera = Transform::from_translation(place + Vec3::Z * 0.3).looking_at(place, Vec3::Y);
    let projection = Projection::Perspective(PerspectiveProjection { fov: FIELD_OF_VIEW, ..default() });
    let viewport = RigViewport { focus: 0.3 };
    let near = Sight::new(&camera.into(), &projection, &viewport, Vec2::splat(800.0), &GlobalTransform::IDENTITY);
    bench.app.insert_resource(ViewportSight(near));
    bench.app.update();
    let (_, hidden) = split(&mut bench);
    let left: Vec<String> = hidden.iter().map(|uid| label(*uid)).filter(|label| label.ends_with("_l")).collect();
    assert!(!left.iter().any(|label| fingers.iter().any(|finger| label.starts_with(finger))), "{left:?}");
}
