//! View that a project keeps: what a person arranged is there again when it is opened.

use std::collections::BTreeMap;

use bevy_panorbit_camera::PanOrbitCamera;
use rigsmith::{
    editor::{
        camera,
        mode::Mode,
        panels::{
            graph::GraphView,
            timeline::{OpenClip, TimelineRequest},
        },
    },
    rig::{TagKind, operations::TagOperation, project::ProjectCamera},
};

use super::*;

#[test]
fn nodes_of_the_graph_are_where_a_person_left_them() {
    let folder = folder();
    let mut window = Window::new(folder.path());
    window.open(OpenRequest::Empty);
    window.place(1.0);
    let joints: Vec<Uid> = window.rig().walk().map(|joint| joint.data.uid).collect();
    let kind = TagKind::Command { module: "null".into(), params: "()".into(), feature: None };
    window.change(Change::Do(Operation::Tags(TagOperation::Add { joints, kind, index: None })));
    let tag = window.rig().walk().flat_map(|joint| &joint.data.tags).map(|tag| tag.uid).next().expect("a command");
    let moved: BTreeMap<Uid, [f32; 2]> = [(tag, [60.0, -40.0]), (Uid(9), [20.0, 20.0])].into();
    let view = GraphView { rig: Some(window.base.open_rig()), moved, ..default() };
    window.base.app.insert_resource(view);
    let path = window.save_as("guy.rigsmith.ron");

    let mut other = Window::new(folder.path());
    other.base.app.init_resource::<GraphView>();
    other.open_file(&path);
    let view = other.world().resource::<GraphView>().clone();
    assert_eq!(view.rig, Some(other.base.open_rig()), "{:?}", other.notices.list);
    assert_eq!(view.moved, BTreeMap::from([(tag, [60.0, -40.0])]), "what is gone has no place");
    // Laid out by itself, the project is as before there was a graph.
    other.base.app.world_mut().resource_mut::<GraphView>().moved.clear();
    other.act(Action::Save);
    let text = std::fs::read_to_string(&path).expect("the project was saved");
    assert!(!text.contains("graph:"), "{text}");
}

/// The wheel stops before the camera is inside of what it looks at, whatever the size of the character.
#[test]
fn zoom_ends_near_what_is_in_view() {
    for distance in [0.02, 4.0, 400.0] {
        let kept = ProjectCamera { distance, ..default() };
        let (mut orbit, mut projection) = (PanOrbitCamera::default(), Projection::default());
        camera::take(&kept, &mut orbit, &mut projection);
        let least = orbit.zoom_lower_limit / distance;
        assert!((0.004..0.04).contains(&least), "{least} of {distance}");
        assert!(orbit.zoom_upper_limit.is_some_and(|most| most >= 10.0 * distance), "{distance}");
    }
}

/// A brush has nothing to paint on a body without weights, which would be dark all over.
#[test]
fn a_document_without_weights_is_not_opened_for_painting() {
    let folder = folder();
    let mut window = Window::new(folder.path());
    for (mode, then) in [(Mode::Paint, Mode::Select), (Mode::Weights, Mode::Select), (Mode::Stroke, Mode::Stroke)] {
        window.base.app.insert_resource(mode);
        window.open(OpenRequest::Bundled);
        assert_eq!(window.world().get_resource::<Mode>(), Some(&then), "opened in {mode:?}");
    }
}

/// A project opens with the clip that was open in the Timeline, or else with the first one; that is no change of it.
#[test]
fn the_open_clip_of_a_project_is_open_again() {
    let folder = folder();
    let mut window = Window::with_panels(folder.path());
    window.open(OpenRequest::Empty);
    window.place(1.0);
    let clip = |number: u64, name: &str| {
        let clip = RigClip { range: [0.0, 1.0], ..RigClip::new(Uid(0x70 + number), Uid(0x80 + number), name) };
        RigEdit::AddClip(Box::new(clip), usize::MAX)
    };
    window.change(Change::Do(Operation::Edits(vec![clip(0, "walk"), clip(1, "run"), clip(2, "jump")])));
    let opened = |window: &Window| OpenClip::of(window.world()).map(|open| open.clip.name.clone());
    assert_eq!(opened(&window), None, "nobody has opened one");
    let project = window.save_as("clips.rigsmith.ron");
    for (open, named) in
        [(Some(Uid(0x71)), "run"), (Some(Uid(0x70)), "walk"), (Some(Uid(0x72)), "jump"), (None, "walk")]
    {
        window.send(TimelineRequest::Open(open));
        window.act(Action::Save);
        let mut again = Window::with_panels(folder.path());
        again.open_file(&project);
        assert_eq!(opened(&again).as_deref(), Some(named), "{open:?}");
        assert!(!again.is_unsaved(), "a clip that is open is no change");
        again.act(Action::New);
        assert_eq!(opened(&again), None, "another document has none of it");
    }
    // A clip that is gone leaves the first one.
    window.send(TimelineRequest::Open(Some(Uid(0x72))));
    window.act(Action::Save);
    let text = std::fs::read_to_string(&project).expect("the project is text");
    std::fs::write(&project, text.replace("clip: \"0000000000000072\"", "clip: \"0000000000000099\""))
        .expect("written");
    let mut again = Window::with_panels(folder.path());
    again.open_file(&project);
    assert_eq!(opened(&again).as_deref(), Some("walk"));
}
