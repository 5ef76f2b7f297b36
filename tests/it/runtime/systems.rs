//! Running rigs in an app.

use super::{biped::biped, *};
use bevy::{animation::AnimationPlugin, prelude::*, time::TimeUpdateStrategy};
use rigsmith::{
    plugins::runtime::{ControlPose, DrivenMorphs, InstanceMode, RigRuntime, RuntimePlugin, spawn_instance},
    rig::{Constraint, KeyEase, Output},
    solve::program::{ExposedNode, Keep},
    test_app::strict_app,
};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, AnimationPlugin, RuntimePlugin));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(std::time::Duration::from_millis(16)));
    strict_app(app)
}

fn program(keep: Keep) -> Arc<RigProgram> {
    let options = CompileOptions { keep, ..CompileOptions::default() };
    Arc::new(RigProgram::compile(&biped(), &options).unwrap())
}

fn instance(app: &mut App, program: &Arc<RigProgram>, mode: InstanceMode, place: Transform) -> Entity {
    let rig = app.world_mut().spawn(place).id();
    spawn_instance(app.world_mut(), rig, program, mode);
    rig
}

fn entity(app: &App, rig: Entity, label: &str) -> Entity {
    let runtime = app.world().get::<RigRuntime>(rig).unwrap();
    let slot = runtime.state().program().find_label(label).unwrap();
    runtime.entity(slot).unwrap_or_else(|| panic!("{label} has no entity"))
}

fn world_position(app: &App, rig: Entity, label: &str) -> Vec3 {
    app.world().get::<GlobalTransform>(entity(app, rig, label)).unwrap().translation()
}

fn in_games() -> Keep {
    Keep::DeformAndExposed(vec![ExposedNode::Controls])
}

#[test]
fn both_modes_put_joints_in_the_same_places() {
    let mut app = app();
    let place = Transform::from_xyz(5.0, 0.0, 2.0).with_rotation(Quat::from_rotation_y(0.7));
    let hierarchy = instance(&mut app, &program(Keep::All), InstanceMode::Hierarchy, place);
    let direct = instance(&mut app, &program(in_games()), InstanceMode::Direct, place);
    app.update();
    let offset = PoseOffset { translation: Vec3::new(-0.2, 0.1, 0.2), ..turned(Vec3::X, 20.0) };
    for control in ["arm_L_goal", "leg_R_goal", "chest", "finger_control_R_1_1"] {
        let posed = entity(&app, direct, control);
        app.world_mut().entity_mut(posed).insert(ControlPose::from(offset));
        let posed = entity(&app, hierarchy, control);
        let mut transform = app.world_mut().get_mut::<Transform>(posed).unwrap();
        *transform = *transform * Transform { translation: offset.translation, rotation: offset.rotation, ..default() };
    }
    app.update();
    for label in ["arm_L_end", "leg_R_end", "head", "finger_R_1_2", "spine_3", "arm_R_lower_twist_1", "eye_L"] {
        near(world_position(&app, hierarchy, label), world_position(&app, direct, label), 2e-5);
    }
    let goal = world_position(&app, hierarchy, "arm_L_goal");
    near(world_position(&app, direct, "arm_L_end"), goal, 1e-4);
}

#[test]
fn what_stands_still_does_nothing() {
    let mut app = app();
    let rigs: Vec<Entity> = (0..9)
        .map(|i| {
            instance(&mut app, &program(in_games()), InstanceMode::Direct, Transform::from_xyz(i as f32, 0.0, 0.0))
        })
        .collect();
    #[derive(Resource, Default)]
    struct ChangedRigs(Vec<Entity>);
    app.init_resource::<ChangedRigs>().add_systems(
        Last,
        |mut ran: ResMut<ChangedRigs>, rigs: Query<Entity, Changed<RigRuntime>>| {
            ran.0 = rigs.iter().collect();
        },
    );
    app.update();
    app.update();
    assert!(app.world().resource::<ChangedRigs>().0.is_empty());
    let posed = entity(&app, rigs[4], "chest");
    app.world_mut().entity_mut(posed).insert(ControlPose::from(turned(Vec3::Y, 30.0)));
    app.update();
    assert_eq!(app.world().resource::<ChangedRigs>().0, [rigs[4]]);
    app.update();
    assert!(app.world().resource::<ChangedRigs>().0.is_empty());
    // A rig that moves as a whole takes its joints along without running.
    let before = world_position(&app, rigs[2], "head");
    app.world_mut().get_mut::<Transform>(rigs[2]).unwrap().translation.y += 3.0;
    app.update();
    assert!(app.world().resource::<ChangedRigs>().0.is_empty());
    near(world_position(&app, rigs[2], "head"), before + Vec3::Y * 3.0, 1e-5);
    // With a rig, its nodes go.
    let head = entity(&app, rigs[2], "head");
    app.world_mut().despawn(rigs[2]);
    assert!(app.world().get_entity(head).is_err());
}

#[test]
fn what_the_rig_writes_is_no_pose() {
    let mut rig = controls(&[("hand", Vec3::ZERO), ("held", Vec3::X)]);
    let kept = rig.kept("held", "hand", Scalar::Value(1.0));
    let Constraint::Transform { driven, .. } = ({
        rig.follow("held", vec![kept.clone()]);
        (*rig.rig.constraints.remove(0).constraint).clone()
    }) else {
        unreachable!()
    };
    rig.constrain(Constraint::Transform {
        driven,
        targets: vec![kept],
        translate: [true; 3],
        rotate: [true; 3],
        scale: [true; 3],
        weight: Scalar::Value(1.0),
        keep_pose: true,
    });
    let program = Arc::new(RigProgram::compile(&rig.rig, &CompileOptions::default()).unwrap());
    let mut app = app();
    let rig = instance(&mut app, &program, InstanceMode::Hierarchy, Transform::IDENTITY);
    app.update();
    let hand = entity(&app, rig, "hand");
    for frame in 1..20 {
        app.world_mut().get_mut::<Transform>(hand).unwrap().translation.y = frame as f32;
        app.update();
        near(world_position(&app, rig, "held"), Vec3::new(1.0, frame as f32, 0.0), 1e-5);
    }
    // Moved by hand, on top of what it follows.
    let held = entity(&app, rig, "held");
    app.world_mut().get_mut::<Transform>(held).unwrap().translation = Vec3::new(1.0, 0.0, 5.0);
    app.update();
    near(world_position(&app, rig, "held"), Vec3::new(1.0, 19.0, 5.0), 1e-5);
}

#[test]
fn morph_targets_follow_by_name() {
    let mut rig = controls(&[("face", Vec3::ZERO)]);
    rig.attribute("face", "smile", 0.0, (0.0, 1.0));
    let driver = Scalar::attribute(rig.uid("face"), "smile");
    let keys = vec![(0.0, 0.0), (1.0, 1.0)];
    rig.constrain(Constraint::DrivenKey { driver, keys, ease: KeyEase::Linear, output: Output::Morph("smile".into()) });
    let program = Arc::new(RigProgram::compile(&rig.rig, &CompileOptions::default()).unwrap());
    let mut app = app();
    let instance = instance(&mut app, &program, InstanceMode::Direct, Transform::IDENTITY);
    let names = ["frown", "smile"].map(str::to_owned);
    let morphs = DrivenMorphs::new(instance, &program, &names);
    assert_eq!(morphs.targets, [(1, 0)]);
    let mesh = app.world_mut().spawn(morphs).id();
    let set = |app: &mut App, value: f32| {
        let mut runtime = app.world_mut().get_mut::<RigRuntime>(instance).unwrap();
        runtime.state_mut().set_attribute(rig.uid("face"), "smile", value).unwrap();
        app.update();
        app.world().get::<DrivenMorphs>(mesh).unwrap().weights.clone()
    };
    assert_eq!(set(&mut app, 0.75), [0.75]);
    assert_eq!(set(&mut app, 0.5), [0.5]);
}

#[test]
fn a_crowd_is_the_same_as_one() {
    let mut app = app();
    let program = program(in_games());
    let place = |number: usize| Transform::from_xyz(number as f32, 0.0, 0.0);
    let rigs: Vec<Entity> =
        (0..300).map(|number| instance(&mut app, &program, InstanceMode::Direct, place(number))).collect();
    for frame in 0..3 {
        for rig in &rigs {
            for control in ["cog", "arm_L_goal", "leg_R_goal", "head_control"] {
                let posed = entity(&app, *rig, control);
                let pose = ControlPose::from(turned(Vec3::Y, frame as f32 * 9.0));
                app.world_mut().entity_mut(posed).insert(pose);
            }
        }
        app.update();
    }
    let first = app.world().get::<RigRuntime>(rigs[0]).unwrap().state().globals();
    for (number, rig) in rigs.iter().enumerate() {
        let runtime = app.world().get::<RigRuntime>(*rig).unwrap();
        let other = runtime.state().globals();
        assert!(first.iter().zip(other).all(|(a, b)| same_bits(a, b)));
        for (slot, node) in program.nodes().iter().enumerate().filter(|(_, node)| node.kind == NodeType::Joint) {
            let joint = app.world().get::<GlobalTransform>(runtime.entity(slot).unwrap()).unwrap();
            let wanted = place(number).compute_affine() * other[slot].affine();
            assert_eq!(joint.affine(), wanted, "{:?} of rig {number}", node.label);
        }
    }
}

/// A chain of springs on a rig that walks: in both modes its tips stay behind and settle.
#[test]
fn springs_feel_the_walk_of_their_rig() {
    let mut rig = biped();
    let head = rig.find_label("finger_L_0_1").unwrap().uid;
    let mut constraint = rig.constraints[0].clone();
    constraint.uid = rigsmith::rig::Uid(987_654);
    constraint.constraint = Arc::new(Constraint::Spring {
        driven: head,
        frequency: Scalar::Value(2.0),
        damping: Scalar::Value(0.5),
        weight: Scalar::Value(1.0),
        translate: true,
        rotate: false,
        motion: Scalar::Value(1.0),
        colliders: Vec::new(),
    });
    rig.constraints.push(constraint);
    for (mode, keep) in [(InstanceMode::Hierarchy, Keep::All), (InstanceMode::Direct, in_games())] {
        let options = CompileOptions { keep, ..CompileOptions::default() };
        let program = Arc::new(RigProgram::compile(&rig, &options).unwrap());
        let mut app = app();
        // The rig stands on something that moves, and is twice as large.
        let cart = app.world_mut().spawn(Transform::IDENTITY).id();
        let rig = instance(&mut app, &program, mode, Transform::from_scale(Vec3::splat(2.0)));
        app.world_mut().entity_mut(rig).insert(ChildOf(cart));
        for _ in 0..3 {
            app.update();
        }
        let rest = world_position(&app, rig, "finger_L_0_1");
        app.world_mut().get_mut::<Transform>(cart).unwrap().translation.x += 1.0;
        app.update();
        let lagging = world_position(&app, rig, "finger_L_0_1");
        assert!(lagging.x - rest.x < 0.5, "{mode:?}: it went {} at once", lagging.x - rest.x);
        for _ in 0..400 {
            app.update();
        }
        near(world_position(&app, rig, "finger_L_0_1"), rest + Vec3::X, 1e-3);
    }
}
