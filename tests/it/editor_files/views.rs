//! View that a project keeps: what a person arranged is there again when it is opened.

use std::collections::BTreeMap;

use bevy_panorbit_camera::PanOrbitCamera;
use rigsmith::{
    editor::{camera, mode::Mode, panels::graph::GraphView},
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
