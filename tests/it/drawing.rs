//! Drawing without a renderer: shapes, sizes in pixels, colours, labels, and when pictures are built.

mod in_app;

use bevy::{
    asset::AssetPlugin,
    camera::{ComputedCameraValues, PerspectiveProjection, RenderTargetInfo},
    math::Affine3A,
    prelude::*,
};
use rigsmith::{
    headless::headless_app,
    plugins::{
        document::HoveredNode,
        drawing::{
            DrawingCounts, DrawingPlugin, GhostJoint, Ghosts, LETTER, LabelCandidate, LabelChoice, RigDrawing,
            RigLabels,
            ghosts::{draw_ghosts, draw_plane},
            grid::{GridPlane, draw_grid, spacing},
            ink::{Ink, Pen},
            label_places,
            shapes::{LEAST_BALL, Octahedron, ball_radius},
            skeleton::{DrawnJoint, Emphasis, FAN, ball_radii, bones, draw_skeleton, drawn_joints},
            theme::{Tint, group_tint},
        },
        viewport::{RigViewport, Sight},
    },
    prelude::*,
    rig::{JointData, NodeKind, RestTransform, RigEdit, operations::MirrorPlane},
    test_app::strict_app,
};

const SIZE: Vec2 = Vec2::new(1280.0, 720.0);

/// A perspective view from `eye` to `target`.
fn sight(eye: Vec3, target: Vec3) -> Sight {
    let camera = GlobalTransform::from(Transform::from_translation(eye).looking_at(target, Vec3::Y));
    let projection = Projection::Perspective(PerspectiveProjection::default());
    let viewport = RigViewport { focus: eye.distance(target) };
    Sight::new(&camera, &projection, &viewport, SIZE, &GlobalTransform::IDENTITY).unwrap()
}

/// An orthographic view from `towards`, `height` units high.
fn flat(towards: Vec3, up: Vec3, height: f32) -> Sight {
    let camera = GlobalTransform::from(Transform::from_translation(towards * 5.0).looking_to(-towards, up));
    let mut projection = OrthographicProjection::default_3d();
    projection.area = Rect::from_center_size(Vec2::ZERO, Vec2::new(height * SIZE.x / SIZE.y, height));
    let projection = Projection::Orthographic(projection);
    Sight::new(&camera, &projection, &RigViewport::default(), SIZE, &GlobalTransform::IDENTITY).unwrap()
}

fn joint(uid: u64, position: [f32; 3], parent: Option<usize>) -> DrawnJoint {
    DrawnJoint {
        uid: Uid(uid),
        position: position.into(),
        axes: Mat3::IDENTITY,
        parent,
        bone: Vec3::ZERO,
        kind: NodeKind::Joint,
        color: None,
        emphasis: Emphasis::None,
        hovered: false,
        hidden: false,
    }
}

fn chain() -> Vec<DrawnJoint> {
    let tip = DrawnJoint { bone: Vec3::X * 0.3, ..joint(3, [0.3, 0.4, 0.0], Some(1)) };
    vec![joint(1, [0.0, 0.0, 0.0], None), joint(2, [0.0, 0.4, 0.0], Some(0)), tip]
}

fn draw(joints: &[DrawnJoint], sight: &Sight) -> Ink {
    let mut ink = Ink::default();
    draw_skeleton(joints, &[], sight, &RigDrawing::default(), &mut ink);
    ink
}

fn has(ink: &Ink, tint: Tint) -> bool {
    ink.tints.contains(&tint)
}

#[test]
fn balls_keep_their_size_on_screen() {
    let cases =
        [(0.0, 4.0), (f32::NAN, 4.0), (f32::INFINITY, 4.0), (10.0, 4.0), (60.0, 5.0), (96.0, 8.0), (320.0, 8.0)];
    for (bone, radius) in cases {
        assert_eq!(ball_radius(bone, 1.0), radius, "a bone of {bone} pixels");
    }
    assert_eq!(ball_radius(800.0, 1.0), 20.0, "near balls grow with the bone");
    assert_eq!(ball_radius(60.0, 10.0), 12.0, "never more than a fifth of the bone");
    let mut last = 0.0;
    for bone in 0..2000 {
        let radius = ball_radius(bone as f32, 1.0);
        assert!(radius >= last && radius >= LEAST_BALL);
        last = radius;
    }
}

/// Distance in pixels from a joint to the furthest vertex of its ball, as drawn.
fn measured(ink: &Ink, sight: &Sight, position: Vec3) -> f32 {
    let centre = sight.project(position).unwrap();
    let outline = RigDrawing::default().theme.outline;
    // The rim of a ball: outline-coloured vertices at the very distance of its centre.
    let on_plane = |at: &[f32; 3]| (Vec3::from(*at) - position).dot(sight.plane.towards()).abs() < 1e-6;
    let rim = ink.positions.iter().zip(&ink.tints).filter(|(at, tint)| **tint == outline && on_plane(at));
    let distances = rim.filter_map(|(at, _)| Some(sight.project(Vec3::from(*at))?.distance(centre)));
    distances.filter(|distance| *distance > 2.5 && *distance < 30.0).fold(0.0, f32::max)
}

#[test]
fn drawn_balls_measure_what_they_should_at_every_zoom() {
    let joints = vec![joint(1, [0.0; 3], None), joint(2, [0.3, 0.0, 0.0], Some(0)), joint(3, [0.6, 0.0, 0.0], Some(1))];
    for distance in [0.4, 1.0, 3.0, 10.0, 40.0, 400.0] {
        let sight = sight(Vec3::new(0.3, 0.0, distance), Vec3::new(0.3, 0.0, 0.0));
        let radii = ball_radii(&joints, &bones(&joints), &sight, 1.0);
        let bone = 0.3 / sight.pixel_at(joints[1].position);
        assert!((radii[1] - ball_radius(bone, 1.0)).abs() < 0.01, "from {distance}");
        assert!(radii[1] >= LEAST_BALL && (radii[1] <= 8.01 || bone > 320.0), "from {distance}: {}", radii[1]);
        // Bones shorter than two pixels are left out, so that nothing else is near the ball.
        let alone = [joints[1]];
        let alone = [DrawnJoint { parent: None, ..alone[0] }];
        let ink = draw(&alone, &sight);
        let measured = measured(&ink, &sight, joints[1].position);
        assert!((measured - (LEAST_BALL + 4.5 + 3.2)).abs() < 0.1, "the mark of a root from {distance}: {measured}");
    }
}

#[test]
fn bones_span_their_joints_and_close() {
    let (head, tail) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, -0.2, 0.9));
    let shape = Octahedron::new(head, tail, 0.05, Vec3::X).unwrap();
    let middle = head.lerp(tail, 0.3);
    for face in shape.faces() {
        assert!(face.normal.dot(face.corners[0] - middle) > 0.0, "faces look outwards");
        assert!(face.corners.contains(&head) ^ face.corners.contains(&tail));
    }
    for corner in shape.waist {
        let along = (corner - head).dot((tail - head).normalize()) / head.distance(tail);
        assert!((along - 0.1).abs() < 1e-5);
        assert!((corner.distance(head.lerp(tail, 0.1)) - 0.05).abs() < 1e-4);
    }
    let faces = shape.faces();
    for (ends, sides) in shape.edges() {
        for side in sides {
            assert!(ends.iter().all(|end| faces[side].corners.contains(end)), "an edge belongs to both of its faces");
        }
    }
    assert_eq!(Octahedron::new(head, head, 0.05, Vec3::X), None);
    assert_eq!(Octahedron::new(head, Vec3::NAN, 0.05, Vec3::X), None);
    assert!(Octahedron::new(Vec3::ZERO, Vec3::X, 0.1, Vec3::X).is_some(), "a side along the bone");

    let joints = chain();
    let ink = draw(&joints, &sight(Vec3::new(0.4, 0.3, 1.5), Vec3::new(0.1, 0.2, 0.0)));
    for end in [joints[0].position, joints[1].position, joints[2].position] {
        assert!(ink.positions.contains(&end.to_array()), "a bone ends at {end}");
    }
    let list = bones(&joints);
    assert_eq!(list.len(), 3);
    let leaf = list[2];
    assert!(leaf.leaf && leaf.joint == 2 && leaf.tail.distance(Vec3::new(0.4, 0.4, 0.0)) < 1e-6);
}

/// The tail of a joint without children turns with it, as the skin below it does.
#[test]
fn a_leaf_is_drawn_as_it_is_posed() {
    let mut rig = Rig::default();
    for (uid, parent, place) in [(1, None, Vec3::ZERO), (2, Some(Uid(1)), Vec3::new(0.0, 0.3, 0.0))] {
        let rest = RestTransform { rotation: Quat::from_rotation_x(0.4), ..RestTransform::from_translation(place) };
        let joint = JointData { uid: Uid(uid), rest, ..Default::default() };
        rig.apply(&RigEdit::AddJoint { joint: Box::new(joint), parent, index: 0 }).unwrap();
    }
    let tail = |pose: &dyn Fn(Uid) -> Affine3A| {
        let joints = drawn_joints(&rig, &Selection::default(), &HoveredNode::default(), |uid| Some(pose(uid)));
        let leaf = *bones(&joints).last().unwrap();
        leaf.tail - joints[leaf.joint].position
    };
    let rest = |uid: Uid| Affine3A::from(rig.rest_global(uid));
    let above = rest(Uid(1)).transform_vector3(Vec3::new(0.0, 0.1, 0.0));
    assert!(tail(&rest).distance(above) < 1e-6, "at rest it goes on straight");
    let turn = Quat::from_rotation_z(1.0);
    let turned = |uid: Uid| if uid == Uid(2) { rest(uid) * Affine3A::from_quat(turn) } else { rest(uid) };
    let expected = rest(Uid(2)).transform_vector3(turn * rest(Uid(2)).inverse().transform_vector3(above));
    assert!(tail(&turned).distance(expected) < 1e-6, "{} {expected}", tail(&turned));
}

#[test]
fn many_bones_that_leave_one_joint_are_a_fan() {
    let fan = |count: usize| {
        let mut joints = vec![joint(1, [0.0; 3], None)];
        joints.extend((0..count).map(|at| joint(2 + at as u64, [at as f32 * 0.1, 1.0, 0.0], Some(0))));
        // One of them goes on.
        joints.push(joint(99, [0.0, 2.0, 0.0], Some(1)));
        joints
    };
    for (count, lines, tails) in [(FAN - 1, 0, FAN - 1), (FAN, FAN - 1, 1)] {
        let list = bones(&fan(count));
        assert_eq!(list.iter().filter(|bone| bone.fan).count(), lines, "{count} children");
        assert_eq!(list.iter().filter(|bone| bone.leaf).count(), tails, "{count} children");
    }
    let joints = fan(FAN);
    let radii = ball_radii(&joints, &bones(&joints), &sight(Vec3::new(0.0, 0.5, 3.0), Vec3::Y), 1.0);
    assert!(radii[5] < radii[0], "balls beside each other leave room: {radii:?}");
}

#[test]
fn bones_have_the_colour_of_their_group() {
    let red = group_tint([1.0, 0.0, 0.0]);
    assert_eq!(red, [255, 0, 0, 255]);
    let mut joints = chain();
    let view = sight(Vec3::new(0.4, 0.3, 1.5), Vec3::new(0.1, 0.2, 0.0));
    let reds = |ink: &Ink| ink.tints.iter().filter(|tint| tint[0] > 80 && tint[1] == 0 && tint[2] == 0).count();
    assert_eq!(reds(&draw(&joints, &view)), 0);
    joints[0].color = Some(red);
    let one = reds(&draw(&joints, &view));
    assert!(one > 0);
    joints[1].color = Some(red);
    assert!(reds(&draw(&joints, &view)) > one);
}

#[test]
fn hovered_selected_and_active_stand_out_and_differ() {
    let view = sight(Vec3::new(0.4, 0.3, 1.5), Vec3::new(0.1, 0.2, 0.0));
    let theme = RigDrawing::default().theme;
    let with = |emphasis: Emphasis, hovered: bool| {
        let mut joints = chain();
        (joints[1].emphasis, joints[1].hovered) = (emphasis, hovered);
        draw(&joints, &view)
    };
    let plain = with(Emphasis::None, false);
    let pictures = [
        (with(Emphasis::None, true), theme.hovered),
        (with(Emphasis::Selected, false), theme.selected),
        (with(Emphasis::Active, false), theme.active),
    ];
    for (number, (picture, tint)) in pictures.iter().enumerate() {
        assert!(has(picture, *tint) && !has(&plain, *tint), "picture {number}");
        for (other, _) in &pictures[..number] {
            assert_ne!(picture, other);
        }
    }
    let mut null = chain();
    null[0].kind = NodeKind::Null;
    assert!(has(&draw(&null, &view), theme.null) && !has(&plain, theme.null));
}

#[test]
fn pictures_are_in_front_and_sorted_among_themselves() {
    let views = [
        sight(Vec3::new(0.4, 0.3, 1.5), Vec3::new(0.1, 0.2, 0.0)),
        sight(Vec3::new(0.0, 0.0, 400.0), Vec3::ZERO),
        flat(Vec3::Z, Vec3::Y, 2.0),
        flat(Vec3::Y, Vec3::NEG_Z, 0.01),
    ];
    for view in views {
        let ink = draw(&chain(), &view);
        assert!(!ink.is_empty());
        assert!(ink.depths.iter().all(|depth| (0.9..1.0).contains(depth)));
        assert_eq!((ink.positions.len(), ink.tints.len()), (ink.depths.len(), ink.depths.len()));
        assert!(ink.indices.iter().all(|index| (*index as usize) < ink.positions.len()));
        let mut scratch = Ink::default();
        let pen = Pen::new(&mut scratch, &view);
        let towards = view.plane.towards();
        let step = 2.0 * view.pixel;
        for place in [-20.0, -1.0, 0.0, 1.0, 20.0] {
            let at = view.plane.origin + towards * (place * step);
            assert!(pen.depth(at + towards * step, 0.0) > pen.depth(at, 0.0), "two pixels nearer are nearer");
            assert!(pen.depth(at, step) > pen.depth(at, 0.0));
        }
    }
}

#[test]
fn a_picture_survives_joints_behind_and_at_the_camera() {
    let joints = chain();
    for eye in [Vec3::new(0.0, 0.2, 1e-4), joints[1].position, Vec3::new(0.3, 0.4, -0.5)] {
        let ink = draw(&joints, &sight(eye, eye + Vec3::Z));
        assert!(ink.positions.iter().flatten().chain(&ink.depths).all(|number| number.is_finite()));
    }
}

#[test]
fn labels_are_thinned_out() {
    let view = sight(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO);
    let candidate =
        |x: f32, z: f32, text, rank| LabelCandidate { position: Vec3::new(x, 0.0, z), radius: 5.0, text, rank };
    let candidates = [
        candidate(0.0, 0.0, "far", 0),
        candidate(0.0, 0.2, "near", 0),
        candidate(0.01, -0.5, "selected", 1),
        candidate(1.0, 0.0, "beside", 0),
        candidate(0.5, 9.0, "behind", 5),
        candidate(90.0, 0.0, "outside", 5),
        candidate(-1.0, 0.0, "", 5),
    ];
    let texts = |candidates: &[LabelCandidate]| -> Vec<String> {
        label_places(&view, candidates, LETTER).into_iter().map(|(_, text)| text).collect()
    };
    assert_eq!(texts(&candidates), ["selected", "beside"]);
    assert_eq!(texts(&candidates[..2]), ["near"]);
    let places = label_places(&view, &candidates[3..4], LETTER);
    let joint = view.project(Vec3::X).unwrap();
    assert!((places[0].0 - joint - Vec2::new(9.0, 0.0)).length() < 1e-3);
}

#[test]
fn the_grid_follows_the_zoom_and_fades() {
    for (pixel, step) in [(0.001, 0.01), (0.01, 0.1), (0.011, 0.1), (0.02, 1.0), (3.0, 100.0)] {
        assert!((spacing(pixel) / step - 1.0).abs() < 1e-4, "pixel {pixel}: {}", spacing(pixel));
    }
    let views = [
        (sight(Vec3::new(2.0, 1.5, 3.0), Vec3::Y), GridPlane::Ground),
        (sight(Vec3::new(0.0, 1.0, 3.0), Vec3::Y), GridPlane::Ground),
        (flat(Vec3::Z, Vec3::Y, 2.0), GridPlane::Front),
        (flat(Vec3::NEG_X, Vec3::Y, 2.0), GridPlane::Side),
        (flat(Vec3::Y, Vec3::NEG_Z, 2.0), GridPlane::Ground),
        (flat(Vec3::new(1.0, 1.0, 1.0).normalize(), Vec3::Y, 2.0), GridPlane::Ground),
    ];
    let theme = RigDrawing::default().theme;
    for (view, plane) in views {
        assert_eq!(GridPlane::of(&view), plane);
        let mut ink = Ink::default();
        draw_grid(&view, &theme, &mut ink);
        assert!(ink.tints.iter().any(|tint| tint[3] > 60), "{plane:?} shows");
        assert!(ink.tints.iter().any(|tint| tint[3] == 0), "{plane:?} fades");
        assert!(ink.positions.iter().flatten().all(|number| number.is_finite()));
        assert!(ink.positions.len() < 60_000, "{plane:?}: {} vertices", ink.positions.len());
        let in_scene = ink.depths.iter().all(|depth| *depth == 0.0);
        let behind = ink.depths.iter().all(|depth| *depth > 0.0 && *depth < 1e-6);
        assert!(in_scene || behind);
    }
}

#[test]
fn ghosts_show_what_would_be_made() {
    let view = sight(Vec3::new(0.0, 0.5, 2.0), Vec3::new(0.0, 0.5, 0.0));
    let theme = RigDrawing::default().theme;
    let draw = |ghosts: &Ghosts| {
        let mut ink = Ink::default();
        draw_ghosts(ghosts, &view, &theme, 1.0, &mut ink);
        ink
    };
    assert!(draw(&Ghosts::default()).is_empty() && Ghosts::default().is_empty());
    let joint = GhostJoint { position: Vec3::new(0.2, 0.6, 0.0), parent: Some(Vec3::Y), mirrored: false };
    let one = Ghosts { joints: vec![joint], ..default() };
    let both = GhostJoint { position: Vec3::new(-0.2, 0.6, 0.0), mirrored: true, ..joint };
    let both = Ghosts { joints: vec![joint, both], ..default() };
    assert!(has(&draw(&one), theme.ghost) && !has(&draw(&one), theme.ghost_mirrored));
    assert!(has(&draw(&both), theme.ghost) && has(&draw(&both), theme.ghost_mirrored));
    let span = Some((Vec3::new(0.1, 0.6, 0.2), Vec3::new(0.3, 0.6, -0.2)));
    let (without, with) = (Ghosts { depth_span: span, ..default() }, Ghosts { depth_span: span, ..one.clone() });
    let ticks = |ghosts: &Ghosts| draw(ghosts).tints.iter().filter(|tint| **tint == theme.depth).count();
    assert_eq!(ticks(&with) - ticks(&without), 4, "one more bar where the joint goes");
    let stroke = Ghosts { stroke: vec![Vec3::ZERO, Vec3::Y, Vec3::new(0.2, 1.0, 0.0)], ..default() };
    assert_eq!(draw(&stroke).tints.iter().filter(|tint| **tint == theme.stroke).count(), 8);
    let mut ink = Ink::default();
    let bounds = [Vec3::new(-0.5, 0.0, -0.2), Vec3::new(0.7, 1.8, 0.2)];
    draw_plane(&MirrorPlane::sagittal(1.8), bounds, &view, &theme, &mut ink);
    let x = ink.positions.iter().map(|at| at[0].abs()).fold(0.0, f32::max);
    let y = ink.positions.iter().map(|at| at[1]).fold(0.0, f32::max);
    assert!(x < 0.01 && y > 1.8, "the plane stands at x = 0 and reaches over the mesh");
}

/// The symmetry plane is an area from where it is seen at an angle; from the side, where it would lie over everything, it is a
/// border.
#[test]
fn the_symmetry_plane_leaves_the_side_view_clear() {
    let theme = RigDrawing::default().theme;
    let bounds = [Vec3::new(-0.5, 0.0, -0.2), Vec3::new(0.5, 1.8, 0.2)];
    let drawn = |towards: Vec3| {
        let mut ink = Ink::default();
        draw_plane(&MirrorPlane::sagittal(1.8), bounds, &flat(towards, Vec3::Y, 2.0), &theme, &mut ink);
        assert!(has(&ink, theme.plane_border), "the border is drawn from everywhere");
        let area = ink.tints.iter().filter(|tint| tint[..3] == theme.plane[..3] && **tint != theme.plane_border);
        area.map(|tint| tint[3]).max()
    };
    assert_eq!(drawn(Vec3::Z), Some(theme.plane[3]), "in full from the front");
    assert_eq!([drawn(Vec3::X), drawn(Vec3::NEG_X)], [None; 2], "no tint from the side");
    let slanted = drawn(Vec3::new(1.0, 0.0, 1.0).normalize()).expect("a part of it from between");
    assert!(slanted > 0 && slanted < theme.plane[3], "{slanted}");
}

fn long_rig(joints: usize) -> Rig {
    let mut app = headless_app(1);
    app.finish();
    let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
    let place = |n: usize| Vec3::new((n % 40) as f32 * 0.05, (n / 40) as f32 * 0.05, (n % 7) as f32 * 0.03);
    let positions = (0..joints).map(place).collect();
    app.world_mut().write_message(EditRequest::operation(rig, Operation::Chain { positions, parent: None }));
    app.update();
    app.world().get::<Rig>(rig).unwrap().clone()
}

#[test]
fn twice_the_joints_are_twice_the_ink() {
    let view = sight(Vec3::new(1.0, 0.6, 2.5), Vec3::new(1.0, 0.6, 0.0));
    let drawn = |joints: usize| {
        let rig = long_rig(joints);
        let globals: std::collections::HashMap<Uid, Affine3A> =
            rig.rest_globals().into_iter().map(|(uid, global)| (uid, global.into())).collect();
        let mut first = Ink::default();
        let draw = |ink: &mut Ink| {
            let joints =
                drawn_joints(&rig, &Selection::default(), &HoveredNode(None), |uid| globals.get(&uid).copied());
            draw_skeleton(&joints, &[], &view, &RigDrawing::default(), ink);
        };
        draw(&mut first);
        // Drawn again, the ink needs no more memory than it has.
        let mut again = Ink::with_capacity_of(&first);
        let places = again.positions.as_ptr();
        draw(&mut again);
        assert_eq!((again.positions.len(), again.positions.as_ptr()), (first.positions.len(), places));
        first.positions.len() as f32 / joints as f32
    };
    let [half, whole] = [500, 1000].map(drawn);
    assert!((50.0..200.0).contains(&whole) && (whole / half - 1.0).abs() < 0.1, "{half} and {whole} vertices a joint");
}
