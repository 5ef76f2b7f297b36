//! Inputs: things outside of a rig that its commands refer to.

use std::{fs, sync::Arc, time::Instant};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    headless::headless_app,
    instance::{InstanceNodes, RigInstance, RigInstancePlugin, RigSource, RigTemplate, TemplateFiles},
    modules,
    plugins::{
        commands::{BuildFailure, BuildResult},
        document::{Change, JointEntities},
        runtime::{InstanceMode, RigInputs, RigRuntime},
    },
    prelude::*,
    processor::{Builder, SourceText, review},
    rig::{
        EditError, RestTransform, RigInput, SourceError,
        extract::extract,
        reference::Names,
        step::edits_from_empty,
        template::{
            UidStyle, format_template, read_header, read_template, survey_template, write_template, write_template_over,
        },
        update::{Take, diff, edits_between, update},
    },
    test_app::strict_app,
};

use super::bench::{HANG, save_whole};

const DRIVER: &str = include_str!("../frozen/format-2-inputs.rig.ron");

fn read(text: &str) -> Rig {
    read_template(text.as_bytes()).unwrap().rig
}

fn wheel(rig: &Rig) -> RigInput {
    rig.inputs().iter().find(|input| input.name == "wheel").unwrap().clone()
}

#[test]
fn templates_declare_inputs() {
    let rig = read(DRIVER);
    let names: Vec<&str> = rig.inputs().iter().map(|input| input.name.as_str()).collect();
    assert_eq!(names, ["wheel", "gear"]);
    let rest = wheel(&rig).rest;
    assert_eq!(rest.translation, Vec3::new(0.0, 1.0, 0.5));
    assert!(rest.rotation.angle_between(Quat::from_rotation_y(90f32.to_radians())) < 1e-5);
    assert_eq!(rig.inputs()[1].rest.scale, Vec3::splat(2.0));
    // Written out it says the same, and the header does without it.
    assert_eq!(read(&write_template(&rig)), rig);
    assert_eq!(read_header(DRIVER.as_bytes()).unwrap().uid, rig.uid());
    for style in [UidStyle::Kept, UidStyle::Written, UidStyle::Derived] {
        let formatted = format_template(DRIVER, style).unwrap();
        assert_eq!(read(&formatted), rig);
        assert_eq!(format_template(&formatted, style).unwrap(), formatted);
    }
    let mut copy = Rig::new(rig.uid(), "");
    edits_from_empty(&rig).iter().for_each(|edit| drop(copy.apply(edit).unwrap()));
    assert_eq!(copy, rig);
}

#[test]
fn a_save_changes_what_changed() {
    let rig = read(DRIVER);
    let saved = |edit: &dyn Fn(&mut Vec<RigInput>)| {
        let mut changed = rig.clone();
        let mut inputs = rig.inputs().to_vec();
        edit(&mut inputs);
        changed.apply(&RigEdit::SetInputs(inputs)).unwrap();
        let text = write_template_over(&changed, DRIVER).unwrap();
        // References get the names of now.
        assert_eq!(write_template(&read(&text)), write_template(&changed), "{text}");
        text
    };
    let moved = saved(&|inputs| inputs[0].rest.translation.y = 1.5);
    assert_eq!(moved, DRIVER.replace("(0, 1, 0.5), rotation", "(0, 1.5, 0.5), rotation"));
    let gone = saved(&|inputs| drop(inputs.pop()));
    assert_eq!(gone, DRIVER.replace("        (name: \"gear\", scale: (2, 2, 2)), // unused\n", ""));
    let renamed = saved(&|inputs| inputs[0].name = "handlebar".to_owned());
    assert!(renamed.contains("name: \"handlebar\"") && renamed.contains("// Held by the hand."), "{renamed}");
    let added = saved(&|inputs| {
        let rest = RestTransform::from_translation(Vec3::X);
        inputs.insert(0, RigInput { uid: Uid(77), name: "door".to_owned(), rest });
    });
    assert!(added.contains("door") && added.contains("// unused"), "{added}");
}

#[test]
fn an_edit_of_inputs_has_an_inverse_and_refuses_what_cannot_be() {
    let mut rig = read(DRIVER);
    let before = rig.clone();
    let inverse = rig.apply(&RigEdit::SetInputs(Vec::new())).unwrap();
    assert!(rig.inputs().is_empty());
    rig.apply(&inverse).unwrap();
    assert_eq!(rig, before);
    let refused = |edit: &dyn Fn(&mut Vec<RigInput>)| {
        let mut rig = before.clone();
        let mut inputs = before.inputs().to_vec();
        edit(&mut inputs);
        let error = rig.apply(&RigEdit::SetInputs(inputs)).unwrap_err();
        assert_eq!(rig, before);
        error
    };
    let joint = before.find_label("hand").unwrap();
    assert_eq!(refused(&|inputs| inputs[0].uid = joint), EditError::UidInUse(joint));
    assert!(matches!(refused(&|inputs| inputs[0].uid = inputs[1].uid), EditError::UidInUse(_)));
    assert!(matches!(refused(&|inputs| inputs[0].name = "gear".to_owned()), EditError::BadInputName(..)));
    assert!(matches!(refused(&|inputs| inputs[0].name.clear()), EditError::BadInputName(..)));
    assert!(matches!(refused(&|inputs| inputs[0].rest.translation.x = f32::NAN), EditError::BadInput(_)));
}

#[test]
fn references_to_missing_inputs_are_errors_with_their_place() {
    let place = |text: &str| -> SourceError {
        let modules = Arc::new(modules::all());
        let rig = read(text);
        let error = Builder::build(&rig, &modules).unwrap_err();
        assert!(!review(&rig, &modules).is_empty());
        let explicit = rigsmith::rig::template::explicit(text);
        SourceText::new(&explicit).locate(&rig, &error)
    };
    let line = DRIVER.lines().position(|line| line.contains("@input")).unwrap() + 1;
    let unknown = place(&DRIVER.replace("@input wheel", "@input whel"));
    assert_eq!(unknown.line, line, "{unknown}");
    assert!(unknown.message.contains("input \"whel\""), "{unknown}");
    let notes = read_template(DRIVER.replace("@input wheel", "@input whel").as_bytes()).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("wheel")), "the nearest name is told: {notes:?}");
    let gone = place(&DRIVER.replace("@input wheel", "@input wheel#0123456789abcdef"));
    assert_eq!(gone.line, line, "{gone}");
    assert!(gone.message.contains("input"), "{gone}");
    // An input stands outside: nothing moves it.
    let tag = "parent(node: \"@input wheel\", targets: \"@this\")";
    let refused = place(&DRIVER.replace("parent(targets: \"@input wheel\")", tag));
    assert!(refused.message.contains("input") && refused.line == line, "{refused}");
    // Faults of the list itself, all at once.
    let text = DRIVER
        .replace("name: \"gear\"", "uid: \"00000000000000aa\", name: \"wheel\"")
        .replace("(0, 90, 0)", "(0, 0, 0, 2)");
    let (_, faults) = survey_template(text.as_bytes()).unwrap();
    assert!(!faults.is_empty() && faults.iter().all(|fault| fault.line > 3), "{faults:?}");
}

#[test]
fn updates_extractions_and_merges_take_inputs_along() {
    let base = read(DRIVER);
    let mut now = base.clone();
    let mut inputs = base.inputs().to_vec();
    inputs[1].rest.translation.x = 3.0;
    now.apply(&RigEdit::SetInputs(inputs)).unwrap();
    let file = read(&DRIVER.replace("(0, 1, 0.5), rotation", "(0, 2, 0.5), rotation"));
    let changes = diff(&base, &file);
    assert_eq!(changes.len(), 1);
    assert_eq!(changes[0].field.as_deref(), Some("input wheel translation"));
    let updated = update(Some(&base), &now, &file, Take::Mine);
    assert_eq!(updated.conflicts(), 0);
    assert_eq!(wheel(&updated.rig).rest.translation.y, 2.0);
    assert_eq!(updated.rig.inputs()[1].rest.translation.x, 3.0);
    let mut rig = now.clone();
    edits_between(&now, &updated.rig).unwrap().iter().for_each(|edit| drop(rig.apply(edit).unwrap()));
    assert_eq!(rig, updated.rig);
    // Both sides moved the wheel.
    let conflict = update(
        Some(&base),
        &read(&DRIVER.replace("(0, 1, 0.5), rotation", "(9, 1, 0.5), rotation")),
        &file,
        Take::Mine,
    );
    assert_eq!(conflict.conflicts(), 1);

    // Only what the hand refers to comes along.
    let hand = base.find_label("hand").unwrap();
    let out = extract(&base, &[hand], "hand", None).unwrap();
    assert!(out.left.is_empty(), "{:?}", out.left);
    assert_eq!(out.rig.inputs(), [wheel(&base)]);
    assert!(Builder::build(&out.rig, &Arc::new(modules::all())).is_ok());

    // Two drivers share the wheel; another one brings its own.
    let mut app = strict_app(headless_app(1));
    let entity = app.world_mut().spawn(base.clone()).id();
    for (text, count) in [(DRIVER.to_owned(), 2), (DRIVER.replace("wheel", "rudder").replace("gear", "sail"), 4)] {
        let other = Arc::new(read(&text));
        app.world_mut().write_message(EditRequest::operation(entity, Operation::Merge { other, parent: None }));
        app.update();
        let rig = app.world().get::<Rig>(entity).unwrap();
        assert_eq!(rig.inputs().len(), count, "{:?}", rig.inputs());
        assert!(Builder::build(rig, &Arc::new(modules::all())).is_ok());
    }
}

/// The place of a node in the world.
fn place(app: &App, node: Entity) -> Vec3 {
    app.world().get::<GlobalTransform>(node).unwrap().translation()
}

#[test]
fn a_hand_of_an_instance_holds_a_wheel() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let mut app = headless_app(1);
        app.add_plugins(RigInstancePlugin::default());
        let mut app = strict_app(app);
        let template = RigTemplate::read(DRIVER.as_bytes()).unwrap();
        let template = app.world_mut().resource_mut::<Assets<RigTemplate>>().add(template);
        let at = Transform::from_xyz(10.0, 0.0, 0.0).with_rotation(Quat::from_rotation_y(1.0));
        let rig = app.world_mut().spawn((RigInstance(template), mode, at)).id();
        let start = Instant::now();
        while app.world().get::<RigRuntime>(rig).is_none() {
            assert!(start.elapsed() < HANG);
            app.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        app.update();
        let hand =
            app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.find(rig, "hand")).unwrap().unwrap();
        let declared = at * Vec3::new(0.2, 1.0, 0.5);
        assert!(
            place(&app, hand).distance(declared) < 1e-5,
            "{mode:?}: without an entity the wheel is where it is declared"
        );

        // The wheel, on a car: it is a child of something that moves, too.
        let car = app.world_mut().spawn(Transform::from_xyz(0.0, 0.0, 5.0)).id();
        let turned = Transform::from_xyz(0.0, 1.0, 0.5).with_rotation(Quat::from_rotation_y(90f32.to_radians()));
        let wheel = app.world_mut().spawn((turned, ChildOf(car))).id();
        app.world_mut().entity_mut(rig).insert(RigInputs::from([("wheel", wheel)]));
        app.update();
        assert!(place(&app, hand).distance(Vec3::new(0.2, 1.0, 5.5)) < 1e-5, "{mode:?}: {}", place(&app, hand));
        for step in 1..4 {
            // It moves and turns in the same frame as the hand, whatever the rig does.
            let z = 5.0 + step as f32;
            *app.world_mut().get_mut::<Transform>(car).unwrap() = Transform::from_xyz(0.0, 0.0, z);
            let turn = Quat::from_rotation_y((90f32 + 30.0 * step as f32).to_radians());
            app.world_mut().get_mut::<Transform>(wheel).unwrap().rotation = turn;
            app.world_mut().get_mut::<Transform>(rig).unwrap().translation.x += 1.0;
            app.update();
            let around = Quat::from_rotation_y((30.0 * step as f32).to_radians()) * Vec3::X * 0.2;
            let wanted = Vec3::new(0.0, 1.0, 0.5 + z) + around;
            assert!(place(&app, hand).distance(wanted) < 1e-4, "{mode:?}: {} {wanted}", place(&app, hand));
        }
        // Without its entity the wheel is where it is declared, again.
        app.world_mut().entity_mut(wheel).despawn();
        app.update();
        let at = *app.world().get::<Transform>(rig).unwrap();
        assert!(place(&app, hand).distance(at * Vec3::new(0.2, 1.0, 0.5)) < 1e-4);
    }
}

#[test]
fn a_hand_of_an_instance_holds_what_hangs_on_another_one() {
    for mode in [InstanceMode::Hierarchy, InstanceMode::Direct] {
        let mut app = headless_app(1);
        app.add_plugins(RigInstancePlugin::default());
        let mut app = strict_app(app);
        let template = RigTemplate::read(DRIVER.as_bytes()).unwrap();
        let template = app.world_mut().resource_mut::<Assets<RigTemplate>>().add(template);
        let at = Transform::from_xyz(10.0, 0.0, 0.0).with_rotation(Quat::from_rotation_y(1.0));
        let first = app.world_mut().spawn((RigInstance(template.clone()), mode)).id();
        let second = app.world_mut().spawn((RigInstance(template), mode, at)).id();
        let start = Instant::now();
        while [first, second].iter().any(|rig| app.world().get::<RigRuntime>(*rig).is_none()) {
            assert!(start.elapsed() < HANG);
            app.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let hands = [first, second].map(|rig| {
            app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.find(rig, "hand")).unwrap().unwrap()
        });
        let tool = app.world_mut().spawn((Transform::from_xyz(0.0, 0.5, 0.0), ChildOf(hands[0]))).id();
        let declared = Transform::from_xyz(0.0, 1.0, 0.5).with_rotation(Quat::from_rotation_y(90f32.to_radians()));
        let from_wheel = declared.compute_affine().inverse().transform_point3(Vec3::new(0.2, 1.0, 0.5));
        for held in [hands[0], tool] {
            app.world_mut().entity_mut(second).insert(RigInputs::from([("wheel", held)]));
            (0..3).for_each(|_| app.update());
            let wanted = app.world().get::<GlobalTransform>(held).unwrap().transform_point(from_wheel);
            assert!(wanted.distance(at * Vec3::new(0.2, 1.0, 0.5)) > 1.0);
            assert!(place(&app, hands[1]).distance(wanted) < 1e-4, "{mode:?}: {} {wanted}", place(&app, hands[1]));
        }
    }
}

#[test]
fn a_hand_of_a_document_holds_a_wheel_through_edits_and_updates() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("driver.rig.ron");
    fs::write(&file, DRIVER).unwrap();
    let mut app = headless_app(1);
    app.add_plugins(RigInstancePlugin::live());
    let mut app = strict_app(app);
    let path = file.clone();
    let template = app.world_mut().run_system_once(move |files: TemplateFiles| files.open(path.clone())).unwrap();
    let rig = app.world_mut().spawn(RigSource::live(template)).id();
    let until = |app: &mut App, is_so: &dyn Fn(&World) -> bool| {
        let start = Instant::now();
        while !is_so(app.world()) {
            assert!(start.elapsed() < HANG);
            app.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        app.update();
    };
    until(&mut app, &|world| world.get::<BuildResult>(rig).is_some());
    let uid = app.world().get::<Rig>(rig).unwrap().find_label("hand").unwrap();
    let hand = app.world().get::<JointEntities>(rig).unwrap().get(uid).unwrap();
    assert!(place(&app, hand).distance(Vec3::new(0.2, 1.0, 0.5)) < 1e-5);
    let turned = Transform::from_xyz(0.0, 2.0, 0.5).with_rotation(Quat::from_rotation_y(90f32.to_radians()));
    let wheel_entity = app.world_mut().spawn(turned).id();
    app.world_mut().entity_mut(rig).insert(RigInputs::from([("wheel", wheel_entity)]));
    app.update();
    assert!(place(&app, hand).distance(Vec3::new(0.2, 2.0, 0.5)) < 1e-5, "{}", place(&app, hand));

    // The declared place moves: the hand's offset from the wheel changes, the wheel stays where its entity is.
    let mut inputs = app.world().get::<Rig>(rig).unwrap().inputs().to_vec();
    inputs[0].rest.translation.x = 0.1;
    let edit = Operation::Edits(vec![RigEdit::SetInputs(inputs)]);
    app.world_mut().write_message(EditRequest::operation(rig, edit));
    app.update();
    assert!(app.world().get::<BuildFailure>(rig).is_none());
    assert!(place(&app, hand).distance(Vec3::new(0.1, 2.0, 0.5)) < 1e-5, "{}", place(&app, hand));
    app.world_mut().write_message(EditRequest { rig, change: Change::Undo });
    app.update();
    assert!(place(&app, hand).distance(Vec3::new(0.2, 2.0, 0.5)) < 1e-5, "{}", place(&app, hand));

    // A saved file with another place for the wheel is taken over.
    save_whole(&file, DRIVER.replace("(0, 1, 0.5), rotation", "(0.05, 1, 0.5), rotation"));
    until(&mut app, &|world| wheel(world.get::<Rig>(rig).unwrap()).rest.translation.x == 0.05);
    assert!(place(&app, hand).distance(Vec3::new(0.15, 2.0, 0.5)) < 1e-5, "{}", place(&app, hand));
    app.world_mut().entity_mut(rig).remove::<RigInputs>();
    app.update();
    assert!(place(&app, hand).distance(Vec3::new(0.2, 1.0, 0.5)) < 1e-5, "{}", place(&app, hand));
    // Names are looked up and told.
    let rig = app.world().get::<Rig>(rig).unwrap();
    let uid = wheel(rig).uid;
    assert_eq!(rig.name_of(rigsmith::rig::reference::NameKind::Input, uid).as_deref(), Some("wheel"));
}
