//! Parts that stay parts: templates that use the files of other templates, changed where they are used, and updated when the
//! part's file is saved.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use rigsmith::{
    files::{PartCache, PartFiles, RealDisk, load_template, store_rig_over},
    headless::headless_app,
    instance::{RigBuilt, RigFailed, RigInstance, RigInstancePlugin, RigUpdated, RunningTemplate, TemplateFiles},
    modules,
    processor::{BuildScope, Builder, ModuleError, RigModule, review},
    rig::{Rig, RigEdit, TagKind, Uid, template::read_template},
};

use serde::{Deserialize, Serialize};

use super::{
    bench::{HANG, save_whole},
    saved_text,
    template_text::apply,
};

pub(super) const FINGER: &str = r#"(
    format: 2,
    name: "finger",
    kind: "part",
    joints: [
        (
            label: "bone_1",
            translation: (0.02, 0, 0),
            rotation: (0, 0, 20),
            tags: [
                Feature(kind: "fk", name: "fk"),
                control(feature: "fk", shape: "cube", relative_size: 0.5, creation: (name: "base")),
            ],
        ),
        (label: "bone_2", parent: "bone_1", translation: (0, 0.04, 0), tags: [control(relative_size: 0.4)]),
        (label: "bone_3", parent: "bone_2", translation: (0, 0.03, 0)),
    ],
)
"#;

/// A hand with as many fingers, on one side of the character.
pub(super) fn hand(name: &str, fingers: usize, mirror: bool, changes: &str) -> String {
    let mut text = format!(
        "(\n    format: 2,\n    name: \"{name}\",\n    joints: [\n        // The palm.\n        (label: \"palm\", translation: ({}, 1, 0), tags: [control(creation: (name: \"palm\"))]),\n    ],\n    parts: [\n",
        if mirror { -0.5 } else { 0.5 }
    );
    for finger in 0..fingers {
        let side = if mirror { ", mirror: true" } else { "" };
        let changes = if finger == 0 { changes } else { "" };
        text.push_str(&format!(
            "        (part: \"finger.rig.ron\", name: \"finger {finger}\", parent: \"palm\", translation: (0, 0.1, {:?}), prefix: \"f{finger}_\"{side}{changes}),\n",
            0.02 * finger as f32
        ));
    }
    text.push_str("    ],\n)\n");
    text
}

pub(super) fn load(path: &Path) -> Rig {
    load_template(&RealDisk, path).unwrap_or_else(|error| panic!("{error}")).rig
}

fn params(rig: &Rig, joint: &str) -> String {
    let joint = rig.joint(rig.find_label(joint).unwrap()).unwrap();
    let command = |tag: &rigsmith::rig::TagData| match &tag.kind {
        TagKind::Command { params, .. } => Some(params.clone()),
        TagKind::Feature { .. } => None,
    };
    joint.data.tags.iter().find_map(command).unwrap()
}

#[test]
fn a_part_is_put_below_a_joint_as_often_as_one_likes() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let path = folder.path().join("hand.rig.ron");
    let changes = ", off: [\"fk\"], changes: [(tag: \"control/bone_2\", params: (relative_size: 0.9)), \
                   (joint: \"bone_3\", translation: (0, 0.05, 0), tags: [null(creation: (name: \"nail\"))])]";
    fs::write(&path, hand("hand", 5, false, changes)).unwrap();
    let rig = load(&path);
    assert_eq!(rig.len(), 16);
    let (palm, first) = (rig.find_label("palm").unwrap(), rig.find_label("f0_bone_1").unwrap());
    assert_eq!(rig.joint(first).unwrap().parent, Some(palm));
    assert!((rig.position(rig.find_label("f2_bone_1").unwrap()) - Vec3::new(0.52, 1.1, 0.04)).length() < 1e-6);
    // What is different about one of them, and nowhere else.
    assert!(params(&rig, "f0_bone_2").contains("0.9") && params(&rig, "f1_bone_2").contains("0.4"));
    let last = rig.joint(rig.find_label("f0_bone_3").unwrap()).unwrap();
    assert_eq!((last.data.rest.translation.y, last.data.tags.len()), (0.05, 1));
    let modules = Arc::new(modules::all());
    assert_eq!(review(&rig, &modules), Vec::new());
    let built = Builder::build(&rig, &modules).unwrap();
    let named = |name: &str| built.nodes.iter().filter(|node| node.name.contains(name)).count();
    assert!(named("f0_base") == 0 && named("f1_base") > 0, "a feature that is off builds nothing");
    // The same at each load; and no two things have one uid.
    assert_eq!(load(&path), rig);
    let mut uids: Vec<Uid> = rig.walk().flat_map(|joint| joint.data.tags.iter().map(|tag| tag.uid)).collect();
    let count = uids.len();
    uids.sort_unstable();
    uids.dedup();
    assert_eq!(uids.len(), count);

    // On the other side everything is mirrored.
    fs::write(&path, hand("other", 2, true, "")).unwrap();
    let other = load(&path);
    let place = |rig: &Rig, label: &str| rig.position(rig.find_label(label).unwrap());
    for label in ["f1_bone_1", "f1_bone_2", "f1_bone_3"] {
        let (left, right) = (place(&rig, label), place(&other, label));
        assert!((left * Vec3::new(-1.0, 1.0, 1.0) - right).length() < 1e-6, "{label} {left} {right}");
    }
}

#[test]
fn a_part_goes_onto_joints_and_into_other_parts() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let onto = r#"(
    format: 2,
    name: "claw",
    joints: [
        (label: "a", translation: (0, 1, 0)),
        (label: "b", parent: "a", translation: (0, 0.3, 0)),
        (label: "c", parent: "b", translation: (0, 0.3, 0), tags: [orient(targets: "@command control/base")]),
    ],
    parts: [
        (part: "finger.rig.ron", onto: ["a", "b", "c"]),
    ],
)
"#;
    let path = folder.path().join("claw.rig.ron");
    fs::write(&path, onto).unwrap();
    let rig = load(&path);
    assert_eq!(rig.len(), 3);
    assert!(params(&rig, "a").contains("base") && params(&rig, "b").contains("0.4"));
    assert!(params(&rig, "c").contains("control/"), "a command of the template refers to one of the part");
    Builder::build(&rig, &Arc::new(modules::all())).unwrap();
    // A part of parts.
    let nested = "(format: 2, name: \"two\", joints: [(label: \"root\")], parts: [(part: \"claw.rig.ron\", name: \"left\", parent: \"root\", \
                  prefix: \"l_\"), (part: \"claw.rig.ron\", name: \"right\", parent: \"root\", prefix: \"r_\", mirror: true)])";
    let two = folder.path().join("two.rig.ron");
    fs::write(&two, nested).unwrap();
    let rig = load(&two);
    assert_eq!(rig.len(), 7);
    assert!(rig.find_label("l_c").is_some() && rig.find_label("r_a").is_some());
    Builder::build(&rig, &Arc::new(modules::all())).unwrap();
}

#[test]
fn what_does_not_fit_is_told_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let path = folder.path().join("t.rig.ron");
    let whole = |part: &str| {
        format!(
            "(\n    format: 2,\n    name: \"t\",\n    joints: [(label: \"palm\")],\n    parts: [\n        {part},\n    ],\n)\n"
        )
    };
    for (part, message) in [
        ("(part: \"fnger.rig.ron\", parent: \"palm\")", "fnger.rig.ron"),
        ("(part: \"t.rig.ron\", parent: \"palm\")", "is a part of itself"),
        ("(part: \"finger.rig.ron\", parent: \"plam\")", "there is no joint \"plam\"; did you mean \"palm\"?"),
        ("(part: \"finger.rig.ron\", onto: [\"palm\", \"palm\"])", "\"palm\" is given twice"),
        ("(part: \"finger.rig.ron\", off: [\"fkk\"])", "no feature \"fkk\"; did you mean \"fk\"?"),
        ("(part: \"finger.rig.ron\", changes: [(tag: \"control/bse\", enabled: false)])", "no tag \"control/bse\""),
        ("(part: \"finger.rig.ron\", changes: [(joint: \"bone_4\", translation: (0, 0, 0))])", "no joint \"bone_4\""),
        ("(part: \"finger.rig.ron\", changes: [(enabled: false)])", "one of a `joint` or of a `tag`"),
        ("(part: \"finger.rig.ron\", onto: [\"palm\"], parent: \"palm\")", "leave out `onto` or `parent`"),
        ("(part: \"finger.rig.ron\"), (part: \"finger.rig.ron\")", "give each a `name`"),
        ("(prt: \"finger.rig.ron\")", "prt"),
    ] {
        fs::write(&path, whole(part)).unwrap();
        let error = load_template(&RealDisk, &path).expect_err(part).to_string();
        assert!(error.contains(message) && error.contains("t.rig.ron"), "{part}: {error}");
        assert!(error.contains('6') || error.contains("line 6"), "{part}: no place: {error}");
    }
}

/// A dozen files, each of which uses the next eight times: neither what they would bring nor what keeps them from it is
/// worked out for each use.
#[test]
fn parts_of_parts_fill_neither_the_memory_nor_the_day() {
    let level = |next: &str| {
        let part = |number: usize| format!("(part: \"{next}\", name: \"{number}\", prefix: \"p{number}_\")");
        let parts: Vec<String> = (0..8).map(part).collect();
        format!("(format: 2, name: \"level\", joints: [(label: \"own\")], parts: [{}])", parts.join(", "))
    };
    let leaf = "(format: 2, name: \"leaf\", joints: [(label: \"a\", tags: [null]), (label: \"b\", parent: \"a\")])";
    let text = level("0.rig.ron");
    let path = Path::new("t.rig.ron");
    for (end, message) in [(Some(leaf), "more than 50000 joints and tags"), (None, "there is no file `12.rig.ron`")] {
        let mut files: BTreeMap<PathBuf, Option<Vec<u8>>> = (0..12)
            .map(|number| (format!("{number}.rig.ron").into(), Some(level(&format!("{}.rig.ron", number + 1)).into())))
            .collect();
        files.insert("12.rig.ron".into(), end.map(Into::into));
        let error = PartFiles::given(&files).complete(path, text.as_bytes()).unwrap_err();
        assert!(error.message.contains(message), "{error}");
        let template = read_template(text.as_bytes()).unwrap();
        let (_, faults) = PartFiles::given(&files).survey(path, &text, template);
        assert_eq!(faults.len(), 8, "each use is told");
    }
}

#[test]
fn a_save_leaves_parts_to_their_files() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let path = folder.path().join("hand.rig.ron");
    let text = hand("hand", 3, false, "");
    fs::write(&path, &text).unwrap();
    let mut rig = load(&path);
    let out = folder.path().join("out.rig.ron");
    assert_eq!(store_rig_over(&RealDisk, &out, &rig, &[&path]).unwrap(), Vec::<String>::new());
    assert_eq!(fs::read_to_string(&out).unwrap(), text);
    // A value of the template's own is one changed line.
    let palm = rig.find_label("palm").unwrap();
    let mut rest = rig.joint(palm).unwrap().data.rest;
    rest.translation.y = 2.0;
    apply(&mut rig, RigEdit::SetRest(palm, rest));
    assert_eq!(store_rig_over(&RealDisk, &out, &rig, &[&path]).unwrap(), Vec::<String>::new());
    assert_eq!(fs::read_to_string(&out).unwrap(), text.replace("(0.5, 1, 0)", "(0.5, 2.0, 0)"));
    // A part of which something cannot be said is written out, and told; nothing is lost.
    let finger = rig.find_label("f1_bone_3").unwrap();
    apply(&mut rig, RigEdit::RemoveJoint(finger));
    let notes = store_rig_over(&RealDisk, &out, &rig, &[&path]).unwrap();
    assert!(notes.len() == 1 && notes[0].contains("\"finger 1\" was written out"), "{notes:?}");
    assert_eq!(saved_text::joints(&load(&out)), saved_text::joints(&rig));
    // Without the part's file all is the template's own, in the form that people write.
    let rig = load(&path);
    fs::remove_file(folder.path().join("finger.rig.ron")).unwrap();
    let notes = store_rig_over(&RealDisk, &out, &rig, &[&path]).unwrap();
    assert!(notes.len() == 1 && notes[0].contains("written out"), "{notes:?}");
    let text = fs::read_to_string(&out).unwrap();
    assert!(text.contains("format: 2") && text.contains("control(") && text.contains("parent: \"palm\""), "{text}");
    assert!(!text.contains("Command(") && !text.contains("version: \"\"") && !text.contains("joint_count"), "{text}");
    assert_eq!(saved_text::joints(&load(&out)), saved_text::joints(&rig));
}

/// Reports of instances.
#[derive(Resource, Default, Debug)]
struct InstanceReport {
    built: usize,
    updated: Vec<(Entity, Vec<Uid>)>,
    failed: Vec<String>,
}

fn until(app: &mut App, what: &str, is_so: impl Fn(&InstanceReport) -> bool) {
    let start = Instant::now();
    while !is_so(app.world().resource::<InstanceReport>()) {
        assert!(start.elapsed() < HANG, "{what} does not come: {:?}", app.world().resource::<InstanceReport>());
        app.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

#[test]
fn a_saved_part_reaches_every_character_that_uses_it() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("finger.rig.ron");
    fs::write(&part, FINGER).unwrap();
    let mut app = headless_app(1);
    app.add_plugins(RigInstancePlugin::live()).init_resource::<InstanceReport>();
    app.add_observer(|_: On<RigBuilt>, mut told: ResMut<InstanceReport>| told.built += 1)
        .add_observer(|failed: On<RigFailed>, mut told: ResMut<InstanceReport>| {
            told.failed.push(failed.error.to_string())
        })
        .add_observer(|updated: On<RigUpdated>, mut told: ResMut<InstanceReport>| {
            told.updated.push((updated.entity, updated.ran.to_vec()));
        });
    app.finish();
    app.cleanup();
    // Fourteen fingers on three hands, one of them with a size of its own.
    let own = ", changes: [(tag: \"control/base\", params: (relative_size: 0.9))]";
    let mut characters = Vec::new();
    for (name, fingers, mirror, changes) in [("a", 5, false, own), ("b", 5, true, ""), ("c", 4, false, "")] {
        let path = folder.path().join(format!("{name}.rig.ron"));
        fs::write(&path, hand(name, fingers, mirror, changes)).unwrap();
        let template = app.world_mut().run_system_once(move |files: TemplateFiles| files.open(path.clone())).unwrap();
        characters.push((app.world_mut().spawn(RigInstance(template)).id(), fingers));
    }
    until(&mut app, "the characters", |told| told.built == 3);
    let sizes = |app: &App, character: Entity| -> Vec<f32> {
        let built = app.world().get::<RunningTemplate>(character).unwrap().get().built.clone();
        let of = |node: &rigsmith::rig::BuiltNode| {
            node.control.as_ref().filter(|_| node.name.contains("_base")).map(|c| c.size)
        };
        built.nodes.iter().filter_map(of).collect()
    };
    let before: Vec<Vec<f32>> = characters.iter().map(|(character, _)| sizes(&app, *character)).collect();
    save_whole(&part, FINGER.replace("relative_size: 0.5", "relative_size: 0.6"));
    until(&mut app, "the saved part", |told| told.updated.len() == 3);
    let told = app.world().resource::<InstanceReport>();
    assert_eq!(told.failed, Vec::<String>::new());
    let updated = told.updated.clone();
    for (number, (character, fingers)) in characters.iter().enumerate() {
        let now = sizes(&app, *character);
        assert_eq!(now.len(), *fingers);
        for (finger, (was, now)) in before[number].iter().zip(&now).enumerate() {
            let is_own = number == 0 && finger == 0;
            assert_eq!(was == now, is_own, "character {number}, finger {finger}: {was} {now}");
        }
        // One command for each finger whose size is the part's, and none of the template's own.
        let ran = &updated.iter().find(|(entity, _)| entity == character).unwrap().1;
        assert_eq!(ran.len(), fingers - usize::from(number == 0), "character {number}");
    }
    // A part that breaks changes nothing; the next good save is taken over.
    save_whole(&part, "(format: 2, name: \"finger\", joints: [");
    until(&mut app, "the failure", |told| told.failed.len() == 3);
    assert!(app.world().resource::<InstanceReport>().failed[0].contains("finger.rig.ron"));
    save_whole(&part, FINGER);
    until(&mut app, "the good part", |told| told.updated.len() == 6);
    assert_eq!(sizes(&app, characters[1].0), before[1]);
}

#[test]
fn the_example_of_the_page_on_writing_rigs_is_right() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/write-a-rig.md")).unwrap();
    let example = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("finger.rig.ron"), FINGER).unwrap();
    let path = folder.path().join("hand.rig.ron");
    fs::write(&path, example).unwrap();
    let rig = load(&path);
    let modules = Arc::new(modules::all());
    assert_eq!(review(&rig, &modules), Vec::new());
    let built = Builder::build(&rig, &modules).unwrap();
    let named = |name: &str| built.nodes.iter().any(|node| node.name.contains(name));
    assert!(named("index_base") && !named("thumb_base") && named("nail"));
}

/// Number of times that parameters of [`Sided`] were mirrored.
static MIRRORED: AtomicUsize = AtomicUsize::new(0);

/// A module that counts how often its parameters are mirrored.
#[derive(Reflect, Serialize, Deserialize, Debug, Clone, Default)]
#[serde(default, deny_unknown_fields)]
struct Sided {
    aside: f32,
}

impl RigModule for Sided {
    const NAME: &'static str = "sided";
    const DOC: &'static str = "Counts how often it is mirrored.";
    const PARAMETERS: &'static [(&'static str, &'static str)] = &[("aside", "A number with a side.")];
    const SIDED: &'static [&'static str] = &["aside"];

    fn construct(&self, _scope: &mut BuildScope<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    fn mirror(&mut self) {
        MIRRORED.fetch_add(1, Ordering::Relaxed);
        self.aside = -self.aside;
    }
}

#[test]
fn parameters_are_mirrored_once_however_often_a_template_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("part.rig.ron");
    let text = "(format: 2, name: \"part\", kind: \"part\", joints: [(label: \"one\", tags: [sided(aside: 1.0)]), (label: \"two\", parent: \"one\", tags: [sided(aside: 2.0)])])";
    fs::write(&part, text).unwrap();
    let path = folder.path().join("t.rig.ron");
    let instance =
        |name: &str, more: &str| format!("(part: \"part.rig.ron\", name: \"{name}\", prefix: \"{name}_\"{more})");
    let right = ", mirror: true";
    let parts = [instance("a", ""), instance("b", right), instance("c", right)].join(", ");
    fs::write(&path, format!("(format: 2, name: \"t\", parts: [{parts}])")).unwrap();
    let mut modules = modules::all();
    modules.add::<Sided>();
    let mut cache = PartCache::default();
    let mut read = || {
        let before = MIRRORED.load(Ordering::Relaxed);
        let mut files = PartFiles::with_modules(&RealDisk, modules.clone()).with_cache(std::mem::take(&mut cache));
        let rig = files.complete(&path, &fs::read(&path).unwrap()).unwrap().rig;
        cache = std::mem::take(&mut files.cache);
        cache.keep(files.asked.keys());
        (rig, MIRRORED.load(Ordering::Relaxed) - before)
    };
    let (rig, first) = read();
    assert_eq!(first, 2, "once for each parameter of the part, which is used twice");
    assert!(params(&rig, "a_two").contains("2.0") && params(&rig, "c_two").contains("-2.0"));
    assert_eq!(read(), (rig.clone(), 0));
    // What is changed is mirrored, and nothing else.
    fs::write(&part, text.replace("2.0", "3.0")).unwrap();
    let (changed, again) = read();
    assert_eq!(again, 1);
    assert!(params(&changed, "b_one").contains("-1.0") && params(&changed, "c_two").contains("-3.0"));
    // What no reading asks for is forgotten after the next one.
    assert_eq!(read(), (changed, 0));
    fs::write(&part, text).unwrap();
    assert_eq!(read(), (rig, 1));
}
