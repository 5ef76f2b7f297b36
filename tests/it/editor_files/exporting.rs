//! Exports of the window, and what they read back.

use rigsmith::editor::{
    files::ExportRequest,
    running_work::{RunningWorkPlugin, StopWork, StoppableWork},
};

use super::*;

#[test]
fn an_export_can_be_stopped() {
    let folder = folder();
    let plugins = (FilesPlugin, RunningWorkPlugin);
    let mut window = Window::of(AppBench::with_files(folder.path().join("state"), plugins), folder.path());
    window.open(OpenRequest::Bundled);
    let path = folder.path().join("stopped.glb");
    let is_stopped = (0..100).any(|_| {
        window.base.app.world_mut().write_message(ExportRequest(path.clone()));
        window.send(StopWork(StoppableWork::Saving));
        // An export that ended before it was stopped is asked for again.
        let is_there = path.exists();
        if is_there {
            std::fs::remove_file(&path).unwrap();
        }
        !is_there
    });
    assert!(is_stopped, "{:?}", window.notices.list);
    let text = "stopped.glb is not written: it was stopped";
    assert!(window.notices.include(Severity::Info, text), "{:?}", window.notices.list);
    assert!(window.notices.list.iter().all(|notice| notice.severity != Severity::Error), "{:?}", window.notices.list);
    window.send(ExportRequest(path.clone()));
    assert!(path.exists(), "the next export is written");
}

#[test]
fn clips_of_the_document_are_exported_as_they_are_edited() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    window.export("none.anim.ron");
    assert!(window.notices.include(Severity::Error, "no clips to export"));
    let joint = window.rig().roots()[0];
    let mut clip = RigClip { range: [0.5, 1.5], ..RigClip::new(Uid(77), Uid(78), "turn") };
    let keys = [0.5, 1.0, 1.5].map(|time| Key::rotation(time, Quat::from_rotation_z(time))).to_vec();
    let target = TrackTarget { node: joint, property: Property::Rotation };
    clip.layers[0].tracks.insert(target, std::sync::Arc::new(Track { keys }));
    window.change(Change::Do(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip.clone()), 0)])));
    let bytes = std::fs::read(window.export("turn.glb")).expect("a file");
    let file = gltf::Gltf::from_slice(&bytes).expect("a model");
    let animations: Vec<_> = file.animations().collect();
    assert_eq!((animations.len(), animations[0].name()), (1, Some("turn")));
    let channel = animations[0].channels().next().expect("a channel");
    let blob = file.blob.clone().expect("a buffer");
    let reader = channel.reader(|_| Some(&blob[..]));
    let times: Vec<f32> = reader.read_inputs().expect("times").collect();
    assert_eq!((times[0], times[times.len() - 1]), (0.0, 1.0), "a clip begins at zero");
    // The clips alone come back as they were, and a file with animations opens with them.
    let read = load_animation(&RealDisk, &window.export("turn.anim.ron")).expect("clips");
    assert_eq!(read.clips, [clip]);
    let packed = load_packed_clips(&RealDisk, &window.export("turn.rigclip")).expect("packed clips");
    assert_eq!((packed.nodes[0].uid, packed.clips[0].name(), packed.clips[0].frames()), (joint, "turn", 31));
    assert!(window.notices.include(Severity::Done, "Exported turn.rigclip; read back: 1 clip, 1 joint"));
    window.open_file(&folder.path().join("turn.glb"));
    window.answer(Answer::Discard);
    let clips = window.rig().clips().to_vec();
    assert_eq!((clips.len(), clips[0].name.as_str()), (1, "turn"), "{:?}", window.notices.list);
    assert!(clips[0].key_count() >= 2 && !has_unsaved_changes(window.world()));
    assert!(window.notices.include(Severity::Done, "Opened turn.glb with 1 clip"), "{:?}", window.notices.list);
    // Clips whose joints a template replaces can be put onto it.
    window.open_file(&Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/templates/biped.rig.ron"));
    let offer = "\"Import motion of the mesh's file\" in the Timeline puts them onto";
    assert!(window.notices.include(Severity::Info, offer), "{:?}", window.notices.list);
}

#[test]
fn a_mesh_with_joints_replaces_a_rig_after_a_question() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    window.export("turn.glb");
    window.open(OpenRequest::Empty);
    window.answer(Answer::Discard);
    // With joints of its own it takes the place of an open rig without a mesh, which is asked about.
    window.place(1.0);
    let rig = window.rig();
    window.open_file(&folder.path().join("turn.glb"));
    assert!(matches!(window.question(), Some(Question::Unsaved { .. })), "{:?}", window.notices.list);
    window.answer(Answer::Cancel);
    assert_eq!(window.rig(), rig);
}

#[test]
fn exports_can_be_read_back() {
    let folder = folder();
    let mut window = Window::bundled(folder.path());
    window.place(1.0);
    let file = std::fs::read(window.export("out.glb")).expect("a file");
    let file = gltf::Gltf::from_slice(&file).expect("glTF");
    let bare = file.nodes().filter(|node| node.mesh().is_none()).count();
    assert_eq!(bare, 1, "the joint is written though nothing is skinned");
    let template = load_template(&RealDisk, &window.export("out.rig.ron")).expect("a template");
    assert_eq!(template.rig.len(), 1);
    window.export("out.rig");
    window.export("out.obj");
    assert!(["out.rig", "out.obj"].iter().all(|name| folder.path().join(name).exists()));
    window.export("out.skin");
    assert!(window.notices.include(Severity::Error, "skin the mesh first"));
    window.export("out.glb");
    assert!(matches!(window.question(), Some(Question::Replace { .. })), "it is there already");
    window.answer(Answer::Save);
    assert!(window.is_unsaved(), "an export is no save");
}

#[test]
fn presets_give_exports_the_names_of_other_programs_and_the_result_is_read_back() {
    let folder = folder();
    let mut window = Window::new(folder.path());
    window.open(OpenRequest::Template("biped".into()));
    let cases = [
        (SkeletonPreset::Plain, "hand_l"),
        (SkeletonPreset::Mixamo, "mixamorig:LeftHand"),
        (SkeletonPreset::Unreal, "hand_l"),
        (SkeletonPreset::Unity, "LeftHand"),
        (SkeletonPreset::Vrm, "leftHand"),
    ];
    for (number, (preset, hand)) in cases.into_iter().enumerate() {
        window.base.app.insert_resource(ExportOptions { preset, author: String::new() });
        let path = window.export(&format!("{number}.glb"));
        let model = load_model(&RealDisk, &path).expect("a model");
        assert!(model.nodes.iter().any(|node| node.name == hand), "{preset:?}");
        let counts = format!("Exported {number}.glb; read back: {} joints", model.nodes.len());
        assert!(window.notices.include(Severity::Done, &counts), "{counts}: {:?}", window.notices.list);
    }
    window.export("rig.rig.ron");
    assert!(window.notices.include(Severity::Done, "Exported rig.rig.ron; read back:"), "{:?}", window.notices.list);
}

#[test]
fn avatars_are_exported_with_an_author() {
    let folder = folder();
    let mut window = Window::new(folder.path());
    window.open(OpenRequest::Template("biped".into()));
    let mut about = window.rig().about().clone();
    about.author.clear();
    window.change(Change::Do(Operation::Edits(vec![RigEdit::SetAbout(Box::new(about))])));
    let before = window.rig();
    let path = window.export("nobody.vrm");
    assert!(
        window.notices.include(Severity::Error, "requires an author") && !path.exists(),
        "{:?}",
        window.notices.list
    );
    window.base.app.insert_resource(ExportOptions { author: "Ann".into(), ..default() });
    let path = window.export("ann.vrm");
    assert!(window.notices.include(Severity::Done, "Exported ann.vrm; read back:"), "{:?}", window.notices.list);
    let bytes = std::fs::read(&path).expect("an avatar");
    let avatar = rigsmith::mesh::gltf::read_avatar(&bytes, "ann.vrm").expect("VRM").expect("an avatar");
    assert_eq!(avatar.vrm.meta.authors, ["Ann"]);
    assert!(avatar.vrm.humanoid.human_bones.contains_key("leftHand"));
    assert_eq!(window.rig(), before, "an export changes nothing");
}

/// Keys of a joint that is gone are offered to another one of its name after the project was saved and opened again, and clips
/// that are exported alone find it.
#[test]
fn names_of_animated_nodes_that_are_gone_are_saved() {
    let folder = folder();
    let mut window = Window::with_panels(folder.path());
    window.open(OpenRequest::Bundled);
    let named = |window: &mut Window| {
        let known = window.rig().roots().to_vec();
        window.place(1.0);
        let joint = window.rig().roots().iter().copied().find(|joint| !known.contains(joint)).expect("a joint");
        let label = RigEdit::SetLabel(joint, Some("arm".to_owned()));
        window.change(Change::Do(Operation::Edits(vec![label])));
        joint
    };
    let joint = named(&mut window);
    let mut clip = RigClip::new(Uid(77), Uid(78), "turn");
    let target = TrackTarget { node: joint, property: Property::Rotation };
    let keys = vec![Key::rotation(0.5, Quat::from_rotation_z(0.5))];
    clip.layers[0].tracks.insert(target, std::sync::Arc::new(Track { keys }));
    window.change(Change::Do(Operation::Edits(vec![RigEdit::AddClip(Box::new(clip), 0)])));
    window.change(Change::Do(Operation::Delete { joints: vec![joint], keep_children: true }));
    let project = window.save_as("gone.rigsmith.ron");
    let clips = window.export("gone.anim.ron");

    let mut other = Window::with_panels(folder.path());
    // A joint that is made here is another one.
    other.base.app.insert_resource(UidSource::seeded(99));
    other.open_file(&project);
    let orphans = |rig: &Rig| orphaned_keys(rig, None, &NodeNames::default());
    let first = orphans(&other.rig());
    assert_eq!((first.len(), first[0].name.label.as_str(), first[0].offer), (1, "arm", None));
    let again = named(&mut other);
    assert_ne!(again, joint);
    assert_eq!(orphans(&other.rig())[0].offer, Some(again));
    // What is saved once more says the same.
    other.act(Action::Save);
    let text = std::fs::read_to_string(&project).expect("saved");
    assert!(text.contains(&format!("node: \"{joint}\", label: \"arm\"")), "{text}");
    let bound = load_animation(&RealDisk, &clips).expect("clips").onto(&other.rig(), None);
    assert_eq!(bound.by_label, [(joint, again)]);
}
