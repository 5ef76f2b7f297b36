//! Clips, layers, markers, keys that are set aside, and motion from files.

use rigsmith::{
    editor::panels::timeline::import::{ClipImport, MapRequest},
    rig::animation::{LayerAbout, LayerMode, Marker, joint_map::FoundBy},
};

use super::*;
use crate::bench::{begin_drag, new_clip, undo_meanwhile};

fn names(desk: &Desk) -> Vec<&str> {
    desk.rig().clips().iter().map(|clip| clip.name.as_str()).collect()
}

/// Chooses an entry of the clip's menu.
fn choose(desk: &mut Desk, entry: &str) {
    desk.click("Menu of the clip");
    desk.frames(2);
    desk.click(entry);
    desk.frames(3);
}

#[test]
fn clips_are_made_renamed_copied_and_deleted() {
    let (mut desk, _) = desk_with(TimelinePanel::default());
    choose(&mut desk, "New clip");
    assert_eq!(names(&desk), ["walk", "Clip 1"]);
    assert_eq!(OpenClip::of(desk.app.world()).unwrap().clip.name, "Clip 1");
    choose(&mut desk, "Rename clip");
    desk.type_text("run");
    desk.key(KeyboardKey::Enter);
    desk.frames(2);
    assert_eq!(names(&desk), ["walk", "run"]);
    choose(&mut desk, "Duplicate clip");
    assert_eq!(names(&desk), ["walk", "run", "run 2"]);
    choose(&mut desk, "Delete clip");
    assert_eq!(names(&desk), ["walk", "run"]);
    assert!(OpenClip::of(desk.app.world()).is_none());
    // What undo brings back is open again.
    undo(&mut desk);
    assert_eq!(OpenClip::of(desk.app.world()).unwrap().clip.name, "run 2");

    // The choice of a clip, or of none.
    let combo = desk.find("Clip").rect.center();
    desk.time += 1.0;
    desk.click_at(combo);
    desk.frames(2);
    desk.click("walk");
    desk.frames(2);
    assert_eq!(timeline(&desk).clip, Some(CLIP));
}

#[test]
fn range_rate_and_loop_are_fields() {
    let (mut desk, _) = opened();
    let fields = [("End frame", "90", [0.0, 3.0], 30.0), ("Frames a second", "24", [0.0, 3.0], 24.0)];
    let steps = desk.steps().1;
    for (number, (field, text, range, rate)) in fields.into_iter().enumerate() {
        desk.click(field);
        desk.type_text(text);
        desk.key(KeyboardKey::Enter);
        desk.frames(3);
        assert_eq!((clip(&desk).range, clip(&desk).frame_rate), (range, rate), "{field}");
        assert_eq!(desk.steps().1, steps + number + 1);
    }
    // A range never ends before it begins, and what is no number of a field is told.
    let (unchanged, steps) = (bytes(&desk), desk.steps());
    let wrong = [
        ("Start frame", "500", "500 is none of its numbers; write one of at most 72"),
        ("End frame", "-5", "-5 is none of its numbers; write one of at least 0"),
        ("Frames a second", "0", "0 is none of its numbers; write one from 0.1 to 1000"),
        ("Frames a second", "fast", "\"fast\" is no number; write one such as 1.5 or -20"),
    ];
    for (field, text, words) in wrong {
        desk.click(field);
        desk.type_text(text);
        desk.key(KeyboardKey::Enter);
        desk.frames(3);
        assert_eq!((bytes(&desk), desk.steps()), (unchanged.clone(), steps), "{field} {text}");
        assert_eq!(desk.told().pop(), Some(format!("{field} stays as it was: {words}.")));
    }
    desk.click("Loop the clip");
    desk.frames(3);
    assert!(clip(&desk).looped && desk.app.world().get::<ClipPlayer>(desk.rig).unwrap().looped);
    let before = bytes(&desk);
    desk.click("Frame");
    desk.type_text("12");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!((timeline(&desk).time, bytes(&desk)), (0.5, before));
}

#[test]
fn markers_are_added_moved_renamed_and_deleted() {
    let (mut desk, _) = opened();
    ask(&mut desk, TimelineRequest::Scrub(0.5));
    act(&mut desk, TimelineAction::Marker);
    ask(&mut desk, TimelineRequest::Scrub(0.25));
    act(&mut desk, TimelineAction::Marker);
    let markers = |desk: &Desk| -> Vec<(f32, String)> {
        let one = |marker: &Marker| ((marker.time * 30.0).round(), marker.name.clone());
        clip(desk).markers.iter().map(one).collect()
    };
    assert_eq!(markers(&desk), [(8.0, "Marker 2".into()), (15.0, "Marker 1".into())]);
    let steps = desk.steps().1;
    let from = desk.find("Marker Marker 2").rect.left_center() + egui::vec2(3.0, 0.0);
    let by = x(&desk, 1.0) - x(&desk, 0.25);
    desk.drag(from, from + egui::vec2(by, 0.0));
    assert_eq!(markers(&desk), [(15.0, "Marker 1".into()), (30.0, "Marker 2".into())]);
    assert_eq!(desk.steps().1, steps + 1);
    desk.double_click("Marker Marker 1");
    desk.type_text("left foot");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!(markers(&desk)[0], (15.0, "left foot".into()));
    desk.click("Marker Marker 2");
    desk.frames(2);
    assert_eq!(timeline(&desk).time, 1.0, "a click goes there");
    desk.secondary_click("Marker left foot");
    desk.click("Delete marker");
    desk.frames(3);
    assert_eq!(markers(&desk), [(30.0, "Marker 2".into())]);
    assert_eq!(desk.steps().1, steps + 3);
}

#[test]
fn layers_have_weights_modes_and_a_mute() {
    let (mut desk, [_, left, _]) = opened();
    act(&mut desk, TimelineAction::NewLayer);
    desk.click("Layers");
    desk.frames(2);
    let top = clip(&desk).layers[1].uid;
    assert!(desk.look("Base").is_some() && desk.look("Layer 2").is_some());
    desk.click("Layer 2");
    desk.frames(2);
    assert_eq!(timeline(&desk).layer, Some(top));
    // New keys go to that layer.
    desk.select(&[left]);
    act(&mut desk, TimelineAction::Key);
    assert!(!clip(&desk).layers[1].tracks.is_empty());
    let steps = desk.steps().1;
    desk.click("Weight of Layer 2");
    desk.type_text("0.5");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!(clip(&desk).layers[1].weight, 0.5);
    desk.click("Mode of Layer 2: additive");
    desk.frames(3);
    assert_eq!(clip(&desk).layers[1].mode, LayerMode::Override);
    desk.click("Mute Layer 2");
    desk.frames(3);
    assert!(clip(&desk).layers[1].muted);
    assert_eq!(desk.steps().1, steps + 3);
    desk.secondary_click("Layer 2");
    desk.click("Rename layer");
    desk.frames(3);
    desk.type_text("breath");
    desk.key(KeyboardKey::Enter);
    desk.frames(3);
    assert_eq!((clip(&desk).layers[1].name.as_str(), desk.steps().1), ("breath", steps + 4));
    desk.secondary_click("breath");
    desk.click("Delete layer");
    desk.frames(3);
    assert_eq!(clip(&desk).layers.len(), 1);
}

#[test]
fn keys_of_nodes_that_are_gone_are_set_aside_under_their_names() {
    let (mut desk, [_, _, right]) = opened();
    assert!(desk.look("Set aside (1)").is_none());
    desk.edit(Operation::Delete { joints: vec![right], keep_children: true });
    desk.frames(2);
    assert!(desk.look("arm_r").is_none());
    desk.click("Set aside (1)");
    desk.frames(2);
    assert!(desk.says("arm_r") && desk.says("4 keys of 1 track"), "{:?}", desk.seen);
    // They come back with the node, or go to another one of that name.
    undo(&mut desk);
    assert!(desk.look("Set aside (1)").is_none() && desk.look("arm_r").is_some());
    change(&mut desk, Change::Redo);
    let other = desk.chain(&["arm_r"])[0];
    desk.frames(2);
    desk.click("Give to arm_r");
    desk.frames(3);
    assert_eq!(times(&desk, other).len(), 4);
    undo(&mut desk);
    desk.click("Delete the keys of arm_r");
    desk.frames(3);
    assert!(desk.look("Set aside (1)").is_none());
    assert_eq!(clip(&desk).key_count(), 4);
}

/// Nodes that came back under other identities get all keys in one step, in layers that concern only some nodes, too.
#[test]
fn all_keys_that_are_set_aside_are_given_at_once() {
    let (mut desk, [_, left, right]) = opened();
    let about = Box::new(LayerAbout { mask: vec![left, right], ..clip(&desk).layers[0].about() });
    desk.edit(Operation::Clips(ClipOperation::SetLayer { clip: CLIP, layer: BASE, about }));
    desk.edit(Operation::Delete { joints: vec![left, right], keep_children: true });
    desk.frames(2);
    desk.click("Set aside (2)");
    desk.frames(2);
    assert!(desk.look("Give all to nodes of their names").is_none());
    let others = desk.chain(&["arm_l", "arm_r"]);
    desk.frames(2);
    let (before, steps) = (bytes(&desk), desk.steps().1);
    desk.click("Give all to nodes of their names");
    desk.frames(3);
    assert_eq!(desk.steps().1, steps + 1);
    assert!(desk.look("Set aside (2)").is_none());
    for other in others {
        assert_eq!(times(&desk, other).len(), 4);
        assert!(clip(&desk).layers[0].concerns(other), "the layer's mask has the node");
    }
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);
}

#[test]
fn rows_are_filtered_and_folded() {
    let (mut desk, [_, left, _]) = opened();
    assert!(desk.look("arm_l rotation").is_none());
    desk.click("Filter keys");
    desk.type_text("ARM_R rot");
    desk.frames(2);
    assert!(desk.look("arm_r").is_some() && desk.look("arm_l").is_none());
    desk.click("Clear filter keys");
    desk.frames(2);
    desk.select(&[left]);
    desk.click("Selected nodes only");
    desk.frames(2);
    assert!(desk.look("arm_l").is_some() && desk.look("arm_r").is_none());
    desk.click("Unfold arm_l");
    desk.frames(2);
    assert!(desk.look("arm_l rotation").is_some());
    desk.click("Fold arm_l");
    desk.frames(2);
    assert!(desk.look("arm_l rotation").is_none());
}

pub(super) fn import(desk: &mut Desk, path: std::path::PathBuf) {
    let clips = desk.rig().clips().len();
    let told = desk.told().len();
    desk.app.world_mut().write_message(ImportRequest(path));
    desk.frames(2);
    crate::bench::wait(desk, "the motion", Desk::frame, |desk| {
        desk.rig().clips().len() != clips || desk.told().len() != told
    });
    desk.frames(3);
}

#[test]
fn motion_is_imported_in_one_step() {
    let folder = tempfile::tempdir().unwrap();
    let (mut desk, _) = desk_with(TimelinePanel::default());
    // Two clips of one file.
    let clips = [clip_on(&desk.rig().clips()[0].nodes().into_iter().collect::<Vec<_>>()), {
        RigClip { uid: Uid(77), name: "run".into(), ..RigClip::new(Uid(77), Uid(78), "run") }
    }];
    let path = folder.path().join("both.anim.ron");
    std::fs::write(&path, write_animation(desk.rig(), None, &clips)).unwrap();
    let (before, steps) = (bytes(&desk), desk.steps().1);
    import(&mut desk, path);
    assert_eq!(names(&desk), ["walk", "walk 2", "run"]);
    assert_eq!(OpenClip::of(desk.app.world()).unwrap().clip.name, "walk 2", "the first one is open");
    assert_eq!(desk.steps().1, steps + 1);
    undo(&mut desk);
    assert_eq!(bytes(&desk), before);

    // A file that is none says why.
    let path = folder.path().join("broken.bvh");
    std::fs::write(&path, "HIERARCHY\nhello").unwrap();
    import(&mut desk, path);
    assert!(desk.told().last().is_some_and(|told| told.contains("Could not import broken.bvh")), "{:?}", desk.told());
    assert_eq!(bytes(&desk), before);
}

#[test]
fn imported_motion_waits_for_steps_that_were_undone_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let path = folder.path().join("run.anim.ron");
    let clip = RigClip { name: "run".into(), ..RigClip::new(Uid(77), Uid(78), "run") };
    std::fs::write(&path, write_animation(desk.rig(), None, &[clip])).unwrap();
    let waits = |desk: &Desk| desk.app.world().resource::<ClipImport>().waits().is_some();
    let waiting = |desk: &mut Desk| {
        let rig = desk.rig;
        begin_drag(&mut desk.app, rig);
        desk.app.world_mut().write_message(ImportRequest(path.clone()));
        desk.until("the motion", waits);
        undo_meanwhile(&mut desk.app, rig, new_clip("wave"));
        desk.frames(3);
    };
    let (before, steps) = (bytes(&desk), desk.steps().1);
    waiting(&mut desk);
    assert_eq!((bytes(&desk), desk.steps()), (before.clone(), (steps + 1, steps)));
    assert!(desk.told().iter().any(|told| told.contains("would lose the steps that were undone")), "{:?}", desk.told());
    change(&mut desk, Change::Redo);
    desk.until("the clip", |desk| desk.steps() == (steps + 2, steps + 2));
    assert_eq!(names(&desk), ["walk", "wave", "run"]);
    (0..2).for_each(|_| undo(&mut desk));
    assert_eq!(bytes(&desk), before);

    // Motion that waits can be dropped.
    waiting(&mut desk);
    desk.app.world_mut().write_message(MapRequest::Cancel);
    desk.frames(3);
    assert!(!waits(&desk));
    change(&mut desk, Change::Redo);
    desk.frames(3);
    assert_eq!((names(&desk), desk.steps()), (vec!["walk", "wave"], (steps + 1, steps + 1)));
}

/// The bundled biped beside a capture of a human, whose map waits.
pub(super) fn captured() -> (Desk, tempfile::TempDir) {
    captured_of(crate::fuzz_bvh::HUMAN)
}

/// The same beside the capture of this text.
pub(super) fn captured_of(text: &str) -> (Desk, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("step.bvh");
    std::fs::write(&path, text).unwrap();
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let rig = crate::bench::shipped("biped");
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(rig);
    desk.frames(3);
    import(&mut desk, path);
    (desk, folder)
}

/// Accepts the map, and waits for the clip.
pub(super) fn accept(desk: &mut Desk) {
    desk.click("Import motion");
    desk.frames(2);
    crate::bench::wait(desk, "the clip", Desk::frame, |desk| {
        desk.app.world().resource::<ClipImport>().name().is_none() && !desk.rig().clips().is_empty()
    });
    desk.frames(3);
}

#[test]
fn motion_capture_is_put_onto_the_controls() {
    let (mut desk, _folder) = captured();
    assert!(desk.rig().clips().is_empty(), "nothing is imported before the map is accepted");
    assert!(desk.look("Joint for LeftLeg").is_some() && desk.says("shin_l"), "{:?}", desk.seen);
    accept(&mut desk);
    let [clip] = desk.rig().clips() else { panic!("{:?}", desk.told()) };
    assert!(clip.key_count() > 10 && clip.name == "step", "{} {:?}", clip.name, desk.told());
    let nodes = clip.nodes();
    assert!(nodes.iter().any(|node| desk.rig().joint(*node).is_none()), "controls have the keys");
    assert!(desk.look("Joint for LeftLeg").is_none(), "the table is gone");
    undo(&mut desk);
    assert!(desk.rig().clips().is_empty());
}

#[test]
fn the_map_of_joints_is_changed_or_dropped_before_anything_is_applied() {
    let (mut desk, _folder) = captured();
    let (before, steps) = (bytes(&desk), desk.steps());
    let draft = |desk: &Desk| desk.app.world().resource::<ClipImport>().draft().cloned();
    let first = draft(&desk).expect("a map");
    let leg = first.joints().position(|name| name == "LeftLeg").unwrap();
    assert!(first.targets[leg].is_some() && first.mapped() >= 7, "{first:?}");
    // A row by hand.
    let combo = desk.find("Joint for LeftLeg").rect.center();
    desk.time += 1.0;
    desk.click_at(combo);
    desk.frames(2);
    desk.click("nothing");
    desk.frames(3);
    let changed = draft(&desk).unwrap();
    assert_eq!((changed.targets[leg], changed.mapped()), (None, first.mapped() - 1));
    assert_eq!((bytes(&desk), desk.steps()), (before.clone(), steps));
    // Escape leaves all as it was.
    desk.key(KeyboardKey::Escape);
    desk.frames(3);
    assert!(draft(&desk).is_none() && desk.look("Joint for LeftLeg").is_none());
    assert_eq!((bytes(&desk), desk.steps()), (before, steps));
}

/// A map file wins over the guess, as with the command; one that does not fit changes nothing.
#[test]
fn a_map_file_takes_the_place_of_the_guess() {
    let (mut desk, folder) = captured();
    let draft = |desk: &Desk| desk.app.world().resource::<ClipImport>().draft().cloned().expect("a map");
    let first = draft(&desk);
    let [left, right] = ["LeftLeg", "RightLeg"].map(|name| first.joints().position(|joint| joint == name).unwrap());
    let [shin_l, shin_r] = ["shin_l", "shin_r"].map(|label| desk.rig().find_label(label));
    assert_eq!((first.targets[left], first.targets[right]), (shin_l, shin_r));
    assert!(desk.look("Load map…").is_some());
    let load = |desk: &mut Desk, text: &str| {
        let path = folder.path().join("map.ron");
        std::fs::write(&path, text).unwrap();
        desk.app.world_mut().write_message(MapRequest::File(path));
        desk.frames(3);
    };
    load(&mut desk, "[(\"LeftLeg\", \"nobody\")]");
    assert!(desk.told().iter().any(|told| told.contains("has no joint \"nobody\"")), "{:?}", desk.told());
    assert_eq!((draft(&desk).targets, draft(&desk).found_by), (first.targets.clone(), first.found_by));
    load(&mut desk, "[(\"LeftLeg\", \"shin_r\"), (\"RightLeg\", \"shin_l\")]");
    let now = draft(&desk);
    assert_eq!((now.targets[left], now.targets[right]), (shin_r, shin_l));
    assert_eq!(now.found_by, Some(FoundBy::Map));
    accept(&mut desk);
    assert_eq!(desk.rig().clips().len(), 1);
}

/// Choices of the command are offered below the table: the control that carries the rig gets the travel, and feet are let
/// go. The next import begins with the same choices.
#[test]
fn motion_capture_has_choices() {
    let walk = include_str!("../retarget/walker.bvh");
    let moved = |clip: &RigClip| -> std::collections::BTreeSet<Uid> {
        let tracks = clip.layers.iter().flat_map(|layer| layer.tracks.keys());
        tracks.filter(|target| target.property == Property::Translation).map(|target| target.node).collect()
    };
    let told = |desk: &Desk, text: &str| desk.told().iter().any(|told| told.contains(text));
    let (mut plain, _folder) = captured_of(walk);
    accept(&mut plain);
    let [without] = plain.rig().clips() else { panic!("{:?}", plain.told()) };
    assert!(!told(&plain, "for root motion") && told(&plain, "feet stand 4 times"), "{:?}", plain.told());

    let (mut desk, folder) = captured_of(walk);
    for label in ["Root motion", "Lock feet"] {
        desk.time += 1.0;
        desk.click(label);
        desk.frames(3);
    }
    let wanted = |desk: &Desk| {
        let options = desk.app.world().resource::<ClipImport>().draft().expect("a map").options;
        assert_eq!((options.root_motion, options.lock_feet), (true, false), "{options:?}");
        assert!(options.travel && options.lock_hands, "{options:?}");
    };
    wanted(&desk);
    accept(&mut desk);
    let [with] = desk.rig().clips() else { panic!("{:?}", desk.told()) };
    assert!(told(&desk, "the travel is on root, for root motion"), "{:?}", desk.told());
    assert!(!told(&desk, "feet stand"), "{:?}", desk.told());
    assert!(moved(with).difference(&moved(without)).next().is_some(), "the root has keys");
    import(&mut desk, folder.path().join("step.bvh"));
    wanted(&desk);
}

/// The clips of a character whose joints a template has replaced go onto the controls of that template.
#[cfg(feature = "cli")]
#[test]
fn motion_of_the_meshs_file_is_put_onto_the_controls() {
    use rigsmith::editor::files::MeshSource;
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("walker.bvh"), include_str!("../retarget/walker.bvh")).unwrap();
    let answer = crate::cli_build::rigsmith(folder.path(), &["animate", "biped", "walker.bvh", "-o", "walker.glb"]);
    assert_eq!(answer.code, 0, "{} {}", answer.out, answer.err);
    let (mut desk, _) = desk_with(TimelinePanel::default());
    let entity = desk.rig;
    desk.app.world_mut().entity_mut(entity).insert(crate::bench::shipped("biped"));
    let body = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/models/biped.obj");
    let mesh = RigMesh::new(Uid(0x3E5), load_model(&RealDisk, &body).unwrap(), Vec::new());
    let mesh = desk.app.world_mut().spawn((mesh, SkinOf(entity), MeshSource::File(body))).id();
    desk.frames(3);
    let own = Action::Timeline(TimelineAction::ImportOwn);
    assert_eq!(obstacle(desk.app.world(), own), Some("the mesh has no file with motion"));
    let source = MeshSource::File(folder.path().join("walker.glb"));
    desk.app.world_mut().entity_mut(mesh).insert(source);
    assert_eq!(obstacle(desk.app.world(), own), None);
    act(&mut desk, TimelineAction::ImportOwn);
    crate::bench::wait(&mut desk, "the map", Desk::frame, |desk| {
        desk.app.world().resource::<ClipImport>().draft().is_some()
    });
    desk.frames(2);
    accept(&mut desk);
    let [clip] = desk.rig().clips() else { panic!("{:?}", desk.told()) };
    assert_eq!(clip.name, "walker");
    assert!(clip.nodes().iter().any(|node| desk.rig().joint(*node).is_none()), "controls have the keys");
}
