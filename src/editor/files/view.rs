//! View state of a document: stored in its project, and restored.

use bevy::{ecs::system::SystemState, prelude::*};
use bevy_panorbit_camera::PanOrbitCamera;

use crate::{
    editor::{
        ActiveRig, camera,
        mode::Mode,
        panels::{
            graph::GraphView,
            timeline::{Timeline, TimelineRequest},
        },
        screen::HiddenMeshes,
    },
    plugins::{
        display::{MeshDisplay, Shading},
        drawing::{LabelChoice, RigDrawing},
    },
    rig::{Rig, project::ProjectView},
};

/// Current view state of the document.
pub(in crate::editor) fn now(world: &mut World) -> ProjectView {
    let mut cameras = world.query::<(&PanOrbitCamera, &Projection)>();
    let camera = cameras.iter(world).next().map(|(orbit, projection)| camera::kept(orbit, projection));
    let mut view = ProjectView { camera, ..default() };
    if let Some(mode) = world.get_resource::<Mode>() {
        view.mode = mode.name().to_owned();
    }
    if let Some(display) = world.get_resource::<MeshDisplay>() {
        view.shading = match display.shading {
            Shading::Shaded => "Shaded",
            Shading::Clay => "Clay",
        }
        .to_owned();
        view.switches.insert("xray".to_owned(), display.xray);
        view.switches.insert("wireframe".to_owned(), display.wireframe);
    }
    if let Some(drawing) = world.get_resource::<RigDrawing>() {
        view.switches.insert("labels".to_owned(), drawing.labels == LabelChoice::All);
        view.switches.insert("axes".to_owned(), drawing.axes);
        view.switches.insert("grid".to_owned(), drawing.grid);
        view.switches.insert("bones".to_owned(), drawing.bones);
        view.switches.insert("deforming".to_owned(), drawing.deforming);
    }
    if let Some(hidden) = world.get_resource::<HiddenMeshes>() {
        view.switches.insert("meshes".to_owned(), !hidden.all);
    }
    let active = world.get_resource::<ActiveRig>().map(|active| active.0);
    if let (Some(rig), Some(graph)) = (active, world.get_resource::<GraphView>().filter(|graph| graph.rig == active)) {
        view.graph = world.get::<Rig>(rig).map(|rig| graph.places(rig)).unwrap_or_default();
    }
    if let (Some(rig), Some(timeline)) = (active, world.get_resource::<Timeline>().filter(|line| line.rig == active)) {
        let clips = world.get::<Rig>(rig).map(Rig::clips).unwrap_or_default();
        // The first one is opened without a word.
        view.clip = timeline.clip.filter(|open| clips.iter().skip(1).any(|clip| clip.uid == *open));
    }
    view
}

/// Opens the clip that was open when a project was saved, or else the first one.
pub(super) fn open_clip(world: &mut World, rig: Entity, view: Option<&ProjectView>) {
    let Some(rig) = world.get::<Rig>(rig) else { return };
    let kept = view.and_then(|view| view.clip).filter(|clip| rig.clip(*clip).is_some());
    let clip = kept.or_else(|| rig.clips().first().map(|clip| clip.uid));
    if clip.is_some() {
        world.write_message(TimelineRequest::Open(clip));
    }
}

/// Shows what the former document hid: whoever opens something wants to see it.
pub(super) fn show_all(world: &mut World) {
    if let Some(mut hidden) = world.get_resource_mut::<HiddenMeshes>() {
        hidden.set_if_neq(HiddenMeshes::default());
    }
    if let Some(mut drawing) = world.get_resource_mut::<RigDrawing>().filter(|drawing| !drawing.bones) {
        drawing.bones = true;
    }
}

/// Leaves the modes of weights for a rig without any: its mesh would be as dark as where a joint moves nothing.
pub(super) fn leave_weights(world: &mut World, rig: Entity) {
    let has_weights = world.get::<Rig>(rig).is_some_and(|rig| rig.skins().next().is_some());
    let Some(mut mode) = world.get_resource_mut::<Mode>().filter(|_| !has_weights) else { return };
    if matches!(*mode, Mode::Weights | Mode::Paint) {
        *mode = Mode::Select;
    }
}

/// Restores the view state. Returns `true` if it includes the camera.
pub(super) fn restore(world: &mut World, view: &ProjectView) -> bool {
    let mut state: SystemState<(
        Option<ResMut<Mode>>,
        Option<ResMut<MeshDisplay>>,
        Option<ResMut<RigDrawing>>,
        Option<ResMut<HiddenMeshes>>,
        (Option<Res<ActiveRig>>, Option<ResMut<GraphView>>),
        Query<(&mut PanOrbitCamera, &mut Projection)>,
    )> = SystemState::new(world);
    let Ok((mode, display, drawing, hidden, (active, graph), mut cameras)) = state.get_mut(world) else { return false };
    let switch = |name: &str| view.switches.get(name).copied();
    if let (Some(mut mode), Some(kept)) = (mode, Mode::ALL.into_iter().find(|mode| mode.name() == view.mode)) {
        mode.set_if_neq(kept);
    }
    if let Some(mut display) = display {
        let mut next = *display;
        next.shading = match view.shading.as_str() {
            "Shaded" => Shading::Shaded,
            "Clay" => Shading::Clay,
            _ => next.shading,
        };
        next.xray = switch("xray").unwrap_or(next.xray);
        next.wireframe = switch("wireframe").unwrap_or(next.wireframe);
        display.set_if_neq(next);
    }
    if let Some(mut drawing) = drawing {
        match switch("labels") {
            Some(true) => drawing.labels = LabelChoice::All,
            Some(false) if drawing.labels == LabelChoice::All => drawing.labels = LabelChoice::None,
            _ => {}
        }
        drawing.axes = switch("axes").unwrap_or(drawing.axes);
        drawing.grid = switch("grid").unwrap_or(drawing.grid);
        drawing.bones = switch("bones").unwrap_or(drawing.bones);
        drawing.deforming = switch("deforming").unwrap_or(drawing.deforming);
    }
    if let (Some(mut hidden), Some(shown)) = (hidden, switch("meshes")) {
        hidden.set_if_neq(HiddenMeshes { all: !shown, ..default() });
    }
    if let (Some(active), Some(mut graph)) = (active, graph) {
        *graph = GraphView::opened(active.0, &view.graph);
    }
    let Some(kept) = &view.camera else { return false };
    for (mut orbit, mut projection) in &mut cameras {
        camera::take(kept, &mut orbit, &mut projection);
    }
    true
}
