//! Sockets and options of parts: where others hang, and what they may vary.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    files::{BUNDLED_CHARACTERS, BUNDLED_PARTS, PartFiles, RealDisk, load_template, store_rig_over},
    instance::{
        ExposedNodes, InstanceNodes, RigBuilt, RigFailed, RigInstance, RigInstancePlugin, RigTemplate, RigUpdated,
    },
    plugins::runtime::{InstanceMode, RigNodes},
    rig::{
        Rig, RigEdit, TagKind,
        template::{FeatureSummary, read_header, read_template},
    },
    solve::program::ExposedNode,
};

use super::template_text::apply;

const ARM: &str = r#"(
    format: 2,
    name: "arm",
    kind: "part",
    sockets: [
        // Where a hand hangs, or a sword.
        (name: "hand_l", joint: "lower", translation: (0.1, 0.3, 0), rotation: (0, 0, 30)),
    ],
    options: [
        (
            name: "size",
            default: 0.5,
            description: "Size of the controls",
            form: Slider(min: 0.1, max: 2.0),
            sets: [
                (tag: "control/upper", param: "relative_size"),
                (tag: "control/lower", param: "relative_size"),
            ],
        ),
        (name: "shape", default: "circle", form: Menu(options: ["cube", "circle"]), sets: [(tag: "control/lower", param: "shape")]),
    ],
    joints: [
        (label: "upper", tags: [control(relative_size: 0.5)]),
        (label: "lower", parent: "upper", translation: (0, 0.4, 0), tags: [control(relative_size: 0.5, shape: "circle")]),
    ],
)
"#;

const TOOL: &str = r#"(format: 2, name: "tool", joints: [(label: "grip", translation: (0, 0.05, 0))])"#;

fn folder(body: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arm.rig.ron"), ARM).unwrap();
    fs::write(folder.path().join("tool.rig.ron"), TOOL).unwrap();
    let path = folder.path().join("t.rig.ron");
    fs::write(&path, body).unwrap();
    (folder, path)
}

/// A template with those sockets and parts.
fn body(sockets: &str, parts: &str) -> String {
    format!(
        "(\n    format: 2,\n    name: \"t\",\n    sockets: [{sockets}],\n    joints: [(label: \"body\", translation: (0, 1, 0))],\n    parts: [\n        {parts},\n    ],\n)\n"
    )
}

const ARMS: &str = r#"(part: "arm.rig.ron", name: "left arm", parent: "body", translation: (0.2, 0, 0), prefix: "l_", options: {"size": 0.7}),
        (part: "arm.rig.ron", name: "right arm", parent: "body", translation: (-0.2, 0, 0), prefix: "r_", mirror: true, options: {"shape": "cube"}),
        (part: "tool.rig.ron", name: "left tool", socket: "left arm.hand_l", prefix: "l_"),
        (part: "tool.rig.ron", name: "right tool", socket: "right arm.hand_r", prefix: "r_", mirror: true)"#;

fn load(path: &Path) -> Rig {
    load_template(&RealDisk, path).unwrap_or_else(|error| panic!("{error}")).rig
}

fn params(rig: &Rig, label: &str) -> String {
    let joint = rig.joint(rig.find_label(label).unwrap()).unwrap();
    match &joint.data.tags[0].kind {
        TagKind::Command { params, .. } => params.clone(),
        TagKind::Feature { .. } => panic!("{label}"),
    }
}

#[test]
fn parts_hang_on_sockets_of_others_on_both_sides() {
    let (_folder, path) = folder(&body("(name: \"back\", joint: \"body\")", ARMS));
    let template = load_template(&RealDisk, &path).unwrap_or_else(|error| panic!("{error}"));
    let rig = &template.rig;
    let at = |label: &str| rig.position(rig.find_label(label).unwrap());
    let parent = |label: &str| rig.joint(rig.find_label(label).unwrap()).unwrap().parent;
    assert_eq!(parent("l_grip"), rig.find_label("l_lower"));
    assert_eq!(parent("r_grip"), rig.find_label("r_lower"));
    let turned = Quat::from_rotation_z(30f32.to_radians()) * Vec3::new(0.0, 0.05, 0.0);
    let wanted = Vec3::new(0.2, 1.4, 0.0) + Vec3::new(0.1, 0.3, 0.0) + turned;
    assert!(at("l_grip").distance(wanted) < 1e-5, "{} {wanted}", at("l_grip"));
    assert!(at("r_grip").distance(wanted * Vec3::new(-1.0, 1.0, 1.0)) < 1e-5, "{}", at("r_grip"));
    let names: Vec<&str> = template.sockets.iter().map(|socket| socket.name.as_str()).collect();
    assert_eq!(names, ["back", "left arm.hand_l", "right arm.hand_r"]);
}

#[test]
fn options_set_what_they_say_before_the_changes_of_the_instance() {
    let (_folder, path) = folder(&body("", ARMS));
    let rig = load(&path);
    assert!(params(&rig, "l_upper").contains("0.7") && params(&rig, "l_lower").contains("0.7"));
    assert!(params(&rig, "r_upper").contains("0.5") && params(&rig, "r_lower").contains("cube"));
    let own = ARMS.replace(
        "options: {\"size\": 0.7}",
        "options: {\"size\": 0.7}, changes: [(tag: \"control/lower\", params: (relative_size: 0.9))]",
    );
    fs::write(&path, body("", &own)).unwrap();
    let rig = load(&path);
    assert!(params(&rig, "l_upper").contains("0.7") && params(&rig, "l_lower").contains("0.9"));
    // A value changed in the program is a change of the instance; the option stays.
    let mut rig = rig;
    let joint = rig.find_label("l_upper").unwrap();
    let mut tag = rig.joint(joint).unwrap().data.tags[0].clone();
    if let TagKind::Command { params, .. } = &mut tag.kind {
        *params = params.replace("0.7", "0.6");
    }
    apply(&mut rig, RigEdit::SetTag(joint, Box::new(tag)));
    assert_eq!(store_rig_over(&RealDisk, &path, &rig, &[&path]).unwrap(), Vec::<String>::new());
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("{\"size\": 0.7}") && text.contains("(relative_size: 0.6)"), "{text}");
    assert_eq!(params(&load(&path), "l_lower"), params(&rig, "l_lower"));
}

#[test]
fn sockets_and_options_that_do_not_fit_are_told_with_their_place() {
    let one = |part: &str| body("", part);
    for (text, message, line) in [
        (one("(part: \"tool.rig.ron\", socket: \"bdy\")"), "no socket \"bdy\"", 7),
        (
            one(&format!("{ARMS}, (part: \"tool.rig.ron\", socket: \"left arm.hnd_l\")")),
            "did you mean \"left arm.hand_l\"?",
            10,
        ),
        (one("(part: \"tool.rig.ron\", socket: \"a\", parent: \"body\")"), "leave out the others", 7),
        (one("(part: \"arm.rig.ron\", options: {\"sze\": 1.0})"), "no option \"sze\"; did you mean \"size\"?", 7),
        (one("(part: \"arm.rig.ron\", options: {\"size\": 5.0})"), "takes a number from 0.1 to 2, not 5.0", 7),
        (one("(part: \"arm.rig.ron\", options: {\"size\": \"big\"})"), "takes a number", 7),
        (one("(part: \"arm.rig.ron\", options: {\"shape\": \"star\"})"), "one of \"cube\", \"circle\"", 7),
        (body("(name: \"a.b\", joint: \"body\")", "(part: \"tool.rig.ron\")"), "a name without points", 4),
        (
            body("(name: \"a\", joint: \"bdy\")", "(part: \"tool.rig.ron\")"),
            "joint \"bdy\", which is not there; did you mean \"body\"?",
            4,
        ),
        (body("(name: \"a\", jont: \"body\")", "(part: \"tool.rig.ron\")"), "jont", 4),
    ] {
        let (_folder, path) = folder(&text);
        let error = load_template(&RealDisk, &path).expect_err(&text).to_string();
        assert!(error.contains(message), "{message}: {error}");
        assert!(error.contains(&format!("line {line}")) || error.contains(&format!(":{line}:")), "{line}: {error}");
    }
    let (folder, path) = folder(&one("(part: \"arm.rig.ron\", options: {\"size\": 1.0})"));
    fs::write(folder.path().join("arm.rig.ron"), ARM.replace("tag: \"control/upper\"", "tag: \"control/uper\""))
        .unwrap();
    let error = load_template(&RealDisk, &path).unwrap_err().to_string();
    assert!(error.contains("option \"size\" of the part sets nothing") && error.contains("control/upper"), "{error}");
}

#[test]
fn a_header_lists_sockets_and_options() {
    let header = read_header(ARM.as_bytes()).unwrap();
    assert_eq!((header.sockets[0].name.as_str(), header.sockets[0].joint.as_str()), ("hand_l", "lower"));
    let options: Vec<(&str, &str)> =
        header.options.iter().map(|option| (option.name.as_str(), option.default.as_str())).collect();
    assert_eq!(options, [("size", "0.5"), ("shape", "\"circle\"")]);
    assert!(header.options[0].form.is_some() && header.options[0].description == "Size of the controls");
}

#[test]
fn a_renamed_joint_keeps_its_socket_and_a_deleted_one_takes_it_along() {
    let (folder, _) = folder(&body("", ARMS));
    let path = folder.path().join("arm.rig.ron");
    let mut rig = load(&path);
    let lower = rig.find_label("lower").unwrap();
    apply(&mut rig, RigEdit::SetLabel(lower, Some("forearm".into())));
    assert_eq!(store_rig_over(&RealDisk, &path, &rig, &[&path]).unwrap(), Vec::<String>::new());
    let template = load_template(&RealDisk, &path).unwrap();
    assert_eq!((template.sockets[0].label.as_str(), template.sockets[0].joint), ("forearm", Some(lower)));
    let lower = template.rig.find_label("forearm").unwrap();
    let mut rig = template.rig;
    apply(&mut rig, RigEdit::RemoveJoint(lower));
    assert_eq!(store_rig_over(&RealDisk, &path, &rig, &[&path]).unwrap(), Vec::<String>::new());
    assert_eq!(load_template(&RealDisk, &path).unwrap().sockets, Vec::new());
}

/// Reports of instances.
#[derive(Resource, Default)]
struct InstanceReport {
    built: usize,
    updated: usize,
    failed: Vec<String>,
}

fn game() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, RigInstancePlugin::default())).init_resource::<InstanceReport>();
    app.add_observer(|_: On<RigBuilt>, mut told: ResMut<InstanceReport>| told.built += 1)
        .add_observer(|_: On<RigUpdated>, mut told: ResMut<InstanceReport>| told.updated += 1)
        .add_observer(|failed: On<RigFailed>, mut told: ResMut<InstanceReport>| {
            told.failed.push(failed.error.to_string())
        });
    app.finish();
    app.cleanup();
    app
}

fn until(app: &mut App, is_so: impl Fn(&InstanceReport) -> bool) {
    let start = std::time::Instant::now();
    while !is_so(app.world().resource::<InstanceReport>()) {
        let failed = &app.world().resource::<InstanceReport>().failed;
        assert!(start.elapsed() < super::bench::HANG, "nothing comes: {failed:?}");
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

fn template(app: &mut App, path: &Path) -> Handle<RigTemplate> {
    let content = fs::read(path).unwrap();
    let template = RigTemplate::read_with_parts(&content, path, &mut PartFiles::new(&RealDisk)).unwrap();
    app.world_mut().resource_mut::<Assets<RigTemplate>>().add(template)
}

#[test]
fn a_game_attaches_things_to_sockets() {
    let (_folder, path) = folder(&body("(name: \"back\", joint: \"body\", translation: (0, 0, -0.2))", ARMS));
    let mut app = game();
    let handle = template(&mut app, &path);
    for (number, mode) in [InstanceMode::Hierarchy, InstanceMode::Direct].into_iter().enumerate() {
        let instance = app.world_mut().spawn((RigInstance(handle.clone()), mode)).id();
        until(&mut app, |told| told.built > number);
        let socket = |app: &mut App, name: &'static str| {
            app.world_mut().run_system_once(move |nodes: InstanceNodes| nodes.socket(instance, name)).unwrap()
        };
        assert_eq!(socket(&mut app, "left arm.hand"), None);
        for (name, place) in [
            ("back", Vec3::new(0.0, 1.0, -0.2)),
            ("left arm.hand_l", Vec3::new(0.3, 1.7, 0.0)),
            ("right arm.hand_r", Vec3::new(-0.3, 1.7, 0.0)),
        ] {
            let (joint, at) = socket(&mut app, name).unwrap_or_else(|| panic!("{name} {mode:?}"));
            let sword = app.world_mut().spawn((at, ChildOf(joint))).id();
            app.update();
            app.update();
            let now = app.world().get::<GlobalTransform>(sword).unwrap().translation();
            assert!(now.distance(place) < 1e-5, "{name} {mode:?}: {now}");
        }
    }
}

#[test]
fn an_instance_has_the_nodes_that_it_exposes() {
    let (_folder, path) = folder(&body("", ARMS));
    let mut app = game();
    let handle = template(&mut app, &path);
    let controls = |app: &App, instance: Entity| {
        let nodes = app.world().get::<RigNodes>(instance).unwrap();
        nodes.iter().filter(|node| app.world().get::<rigsmith::plugins::runtime::ControlPose>(*node).is_some()).count()
    };
    let all = app.world_mut().spawn((RigInstance(handle.clone()), InstanceMode::Direct)).id();
    let none =
        app.world_mut().spawn((RigInstance(handle.clone()), InstanceMode::Direct, ExposedNodes(Vec::new()))).id();
    until(&mut app, |told| told.built == 2);
    let (of_all, of_none) = (controls(&app, all), controls(&app, none));
    assert!(of_all >= 4 && of_none < of_all, "{of_all} {of_none}");
    // One of them, by its uid, in the running instance; the pose and the joints stay.
    let control = {
        let running = app.world().get::<rigsmith::instance::RunningTemplate>(none).unwrap().get().clone();
        running.built.nodes.iter().find(|node| node.control.is_some()).unwrap().uid
    };
    app.world_mut().entity_mut(none).insert(ExposedNodes(vec![ExposedNode::Uid(control)]));
    app.update();
    assert_eq!(controls(&app, none), of_none + 1);
    assert_eq!(app.world().resource::<InstanceReport>().updated, 0, "the template is the same");
    // A node that is not there is told, and the instance has all controls.
    app.world_mut().entity_mut(none).insert(ExposedNodes(vec![ExposedNode::Label("nobody".into())]));
    until(&mut app, |told| !told.failed.is_empty());
    assert!(app.world().resource::<InstanceReport>().failed[0].contains("nobody"));
    assert_eq!(controls(&app, none), of_all);
    app.world_mut().entity_mut(none).remove::<ExposedNodes>();
    app.update();
    assert_eq!(controls(&app, none), of_all);
}

#[test]
fn frozen_files_with_parts_stay_readable() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("link.rig.ron"), include_str!("../frozen/format-2-part.rig.ron")).unwrap();
    let path = folder.path().join("body.rig.ron");
    let text = include_str!("../frozen/format-2-parts.rig.ron");
    fs::write(&path, text).unwrap();
    let template = load_template(&RealDisk, &path).unwrap_or_else(|error| panic!("{error}"));
    let rig = &template.rig;
    assert_eq!((rig.len(), template.notes.as_slice()), (3 + 5 + 3, &[][..]));
    let names: Vec<&str> = template.sockets.iter().map(|socket| socket.name.as_str()).collect();
    assert_eq!(names, ["back", "spine.end", "tail.end", "wing.end"]);
    let first = rig.joint(rig.find_label("tail_link_1").unwrap()).unwrap();
    assert_eq!((first.data.rest.scale.y, first.data.rest.translation.y), (2.0, 0.05));
    let tags: Vec<String> =
        first.data.tags.iter().map(|tag| format!("{:?} {} {}", tag.kind, tag.enabled, tag.comment)).collect();
    assert_eq!(tags.len(), 3, "the mark is gone, the bell is there: {tags:#?}");
    assert!(tags[0].contains("false") && tags[1].contains("0.7") && tags[1].contains("star"), "{tags:#?}");
    assert!(tags[1].contains("true seen from behind") && !tags[1].contains("color"), "{tags:#?}");
    assert_eq!(first.data.tags[2].uid, rigsmith::rig::Uid(0xaa));
    let root = rig.joint(rig.find_label("tail_root").unwrap()).unwrap();
    assert!(root.data.locked);
    let hung = rig.joint(rig.find_label("wing_link_1").unwrap()).unwrap();
    assert_eq!(hung.parent.and_then(|parent| rig.joint(parent)?.data.label.clone()).as_deref(), Some("tail_link_5"));
    // A save changes nothing, and everything different is listed.
    assert_eq!(store_rig_over(&RealDisk, &path, rig, &[&path]).unwrap(), Vec::<String>::new());
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    let listed: usize = template.instances.iter().map(|instance| instance.overrides().len()).sum();
    assert_eq!(listed, 13);
}

#[test]
fn a_header_counts_what_parts_bring_as_the_template_has_it() {
    for (name, text) in BUNDLED_CHARACTERS {
        let template = read_template(text.as_bytes()).unwrap();
        let none = BTreeMap::new();
        let mut files = PartFiles::given(&none);
        let parts = files.fitted(Path::new("t.rig.ron"), &template).unwrap();
        let mut header = read_header(text.as_bytes()).unwrap();
        let written = (header.joint_count, header.features.clone());
        let mut listed = header.clone();
        listed.complete_from_parts(&template.rig, &files.counted(Path::new("t.rig.ron"), &template).unwrap());
        header.complete_from_parts(&template.rig, &parts);
        assert_eq!(listed, header, "{name}");
        let whole = files.complete(Path::new("t.rig.ron"), text.as_bytes()).unwrap().rig;
        assert_eq!(header.joint_count, whole.len(), "{name}");
        let counted = (header.joint_count, header.features.clone());
        header.complete_from(&whole);
        assert_eq!(counted.1, header.features, "{name}");
        assert_eq!(written, counted, "{name} says so itself");
    }
    for (name, text) in BUNDLED_PARTS {
        let written = read_header(text.as_bytes()).unwrap();
        // A hand's header would be as long as that of four others: what it needs follows from the file.
        if written.needs.is_none() {
            assert_eq!(*name, "parts/hand.rig.ron");
            continue;
        }
        let mut counted = written.clone();
        let none = BTreeMap::new();
        counted.complete_from(&PartFiles::given(&none).complete(Path::new(name), text.as_bytes()).unwrap().rig);
        assert_eq!(written, counted, "{name} says so itself");
    }
}

#[test]
fn a_header_has_the_features_that_changes_of_parts_leave() {
    let part = "(format: 2, name: \"limb\", kind: \"part\", joints: [(label: \"bone\", tags: [\
                Feature(kind: \"ik\", name: \"ik\"), Feature(kind: \"ik\", name: \"ik\", switch: \"stretch\"), \
                Feature(uid: \"00000000000000f1\", kind: \"deform\", name: \"twist\"), control()])])";
    let files = BTreeMap::from([(PathBuf::from("limb.rig.ron"), Some(part.as_bytes().to_vec()))]);
    let named = |changes: &str| {
        let text = format!(
            "(format: 2, name: \"man\", joints: [(label: \"body\")], parts: [(part: \"limb.rig.ron\", name: \"left\", \
             parent: \"body\", prefix: \"l_\", changes: [{changes}])])"
        );
        let template = read_template(text.as_bytes()).unwrap();
        let mut reader = PartFiles::given(&files);
        let parts = reader.fitted(Path::new("man.rig.ron"), &template).unwrap();
        let mut header = read_header(text.as_bytes()).unwrap();
        header.complete_from_parts(&template.rig, &parts);
        let mut listed = header.clone();
        listed.complete_from_parts(&template.rig, &reader.counted(Path::new("man.rig.ron"), &template).unwrap());
        assert_eq!(listed, header, "{changes}");
        let counted = header.features.clone();
        header.complete_from(&reader.complete(Path::new("man.rig.ron"), text.as_bytes()).unwrap().rig);
        assert_eq!(counted, header.features, "{changes}");
        let names = |feature: &FeatureSummary| (feature.name.clone(), feature.switches.join(" "));
        counted.iter().map(names).collect::<Vec<_>>()
    };
    let of = |names: &[(&str, &str)]| -> Vec<(String, String)> {
        names.iter().map(|(name, switches)| ((*name).to_owned(), (*switches).to_owned())).collect()
    };
    assert_eq!(named(""), of(&[("twist", ""), ("ik", "stretch")]));
    assert_eq!(named("(tag: \"00000000000000f1\", removed: true)"), of(&[("ik", "stretch")]));
    let added = "(joint: \"bone\", tags: [Feature(kind: \"hand\", name: \"fingers\", switch: \"curl\")])";
    assert_eq!(named(added), of(&[("twist", ""), ("fingers", "curl"), ("ik", "stretch")]));
}

#[test]
fn bundled_parts_say_where_others_hang_and_what_may_be_set() {
    let text = r#"(
    format: 2,
    name: "t",
    joints: [(label: "hips", translation: (0, 1, 0))],
    parts: [
        (part: "parts/tail.rig.ron", name: "tail", parent: "hips", adds: true, count: 9, options: {"frequency": 5}),
        (part: "parts/spring_chain.rig.ron", name: "tuft", adds: true, socket: "tail.tip"),
    ],
)"#;
    let none = BTreeMap::new();
    let template = PartFiles::given(&none).complete(Path::new("t.rig.ron"), text.as_bytes()).unwrap();
    let rig = &template.rig;
    let parent = |label: &str| {
        let joint = rig.joint(rig.find_label(label).unwrap()).unwrap();
        rig.joint(joint.parent.unwrap()).unwrap().data.label.clone().unwrap()
    };
    assert_eq!(
        (parent("chain_1").as_str(), parent("tail_9").as_str()),
        ("tail_9", "tail_8"),
        "the end of a tail of nine"
    );
    let set = |label: &str| {
        let joint = rig.joint(rig.find_label(label).unwrap()).unwrap();
        let commands = joint.data.tags.iter().filter_map(|tag| match &tag.kind {
            TagKind::Command { params, .. } if params.contains("\"frequency\",") => Some(params.clone()),
            _ => None,
        });
        commands.collect::<Vec<String>>().concat()
    };
    assert!(set("tail_1").contains("default: 5") && set("chain_1").contains("default: 2"), "{}", set("tail_1"));
    // Every socket is on a joint of its part, and options say what their tags say already.
    let mut told = 0;
    for (name, text) in BUNDLED_PARTS {
        let part = PartFiles::given(&none).complete(Path::new(name), text.as_bytes()).unwrap();
        let used = format!("(format: 2, name: \"t\", parts: [(part: \"{name}\", name: \"p\", adds: true)])");
        let alone = PartFiles::given(&none).complete(Path::new("t.rig.ron"), used.as_bytes()).unwrap();
        assert_eq!(alone.sockets.len(), part.sockets.len(), "{name}");
        told += part.sockets.len() + part.rig.about().options.len();
    }
    assert!(told >= 18, "{told}");
}
