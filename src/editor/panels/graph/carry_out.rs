//! Actions and requests of the graph, carried out: edits and picks are sent on, everything else changes what the window
//! shows.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
};

use bevy::prelude::*;

use super::{
    TITLE,
    action::{GraphAction, obstacle},
    layout::snapped,
    model::frame_of,
    state::{FEW, GraphLook, GraphRequest, GraphView},
};
use crate::{
    editor::{
        ActiveRig,
        actions::{Action, ActionRequest, queue_requests},
        dock::Layout,
        notice::Notice,
    },
    plugins::{
        document::{EditRequest, Selection},
        picking::{Pick, PickRequest},
    },
    rig::{
        Rig, TagKind, Uid,
        operations::{Operation, TagOperation},
    },
};

/// Carries out what panels, keys and menus ask for, before the picks and edits of the same frame.
pub(super) fn attend(requests: MessageReader<GraphRequest>, actions: MessageReader<ActionRequest>, commands: Commands) {
    let own = |action| if let Action::Graph(action) = action { Some(action) } else { None };
    queue_requests(requests, answer, actions, own, act, commands);
}

fn answer(world: &mut World, request: GraphRequest) {
    match request {
        GraphRequest::Select(tags) => select(world, tags),
        GraphRequest::Move(list) => {
            let list = list.into_iter().filter(|(_, place)| place.iter().all(|number| number.is_finite()));
            let list: Vec<_> = list.map(|(tag, place)| (tag, snapped(place))).collect();
            world.resource_mut::<GraphView>().moved.extend(list);
        }
        GraphRequest::Fold(frame, is_open) => {
            world.resource_mut::<GraphView>().folds.insert(frame, is_open);
        }
        GraphRequest::Hover(is_over) => world.resource_mut::<GraphView>().hovered = is_over,
    }
}

/// Selects commands and the joints that carry them.
fn select(world: &mut World, tags: BTreeSet<Uid>) {
    let Some(rig) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    let Some(document) = world.get::<Rig>(rig) else { return };
    let joints = joints_of(document, &tags);
    let what = if joints.is_empty() { Pick::None } else { Pick::Joints(joints.into_iter().collect()) };
    let frames = frames_of(document, &tags);
    let mut view = world.resource_mut::<GraphView>();
    view.selected = tags;
    // A click in the graph folds nothing that is in view.
    open(&mut view, frames);
    world.write_message(PickRequest { rig, what, add: false });
}

/// Frames of selected commands that are opened: none if too many are selected; of several joints those with most of the
/// selected commands, as long as few commands come into view.
fn frames_of(rig: &Rig, tags: &BTreeSet<Uid>) -> BTreeSet<Uid> {
    if tags.is_empty() || tags.len() > FEW {
        return BTreeSet::new();
    }
    // Numbers of selected commands and of all commands of each frame.
    let mut found: BTreeMap<Uid, (usize, usize)> = BTreeMap::new();
    for joint in rig.walk() {
        for tag in &joint.data.tags {
            let Some(frame) = frame_of(rig, &joint.data, tag) else { continue };
            let (selected, all) = found.entry(frame).or_default();
            *selected += usize::from(tags.contains(&tag.uid));
            *all += 1;
        }
    }
    found.retain(|_, (selected, _)| *selected > 0);
    if joints_of(rig, tags).len() < 2 || found.len() < 2 {
        return found.into_keys().collect();
    }
    let mut frames: Vec<(Uid, usize, usize)> =
        found.into_iter().map(|(frame, (selected, all))| (frame, selected, all)).collect();
    frames.sort_by_key(|(frame, selected, all)| (Reverse(*selected), *all, *frame));
    let mut room = FEW;
    frames.retain(|(_, _, all)| {
        let fits = *all <= room;
        room -= if fits { *all } else { 0 };
        fits
    });
    frames.into_iter().map(|(frame, ..)| frame).collect()
}

/// Opens the frames of selected commands, those that were folded by hand, too.
fn open(view: &mut GraphView, frames: BTreeSet<Uid>) {
    view.folds.retain(|frame, is_open| *is_open || !frames.contains(frame));
    view.lit.extend(frames);
}

/// Joints that carry tags.
fn joints_of(rig: &Rig, tags: &BTreeSet<Uid>) -> BTreeSet<Uid> {
    tags.iter().filter_map(|tag| Some(rig.find_tag(*tag)?.0.data.uid)).collect()
}

/// Commands of joints, in the order of the rig; of all joints if there is no list.
fn commands_of(rig: &Rig, joints: Option<&[Uid]>) -> BTreeSet<Uid> {
    let asked = rig.walk().filter(|joint| joints.is_none_or(|joints| joints.contains(&joint.data.uid)));
    let tags = asked.flat_map(|joint| &joint.data.tags);
    tags.filter(|tag| matches!(tag.kind, TagKind::Command { .. })).map(|tag| tag.uid).collect()
}

fn act(world: &mut World, action: GraphAction) {
    if let Some(reason) = obstacle(world, action) {
        let text = format!("{}: {reason}.", action.name());
        world.write_message(Notice::info(text));
        return;
    }
    let Some(active) = world.get_resource::<ActiveRig>().map(|active| active.0) else { return };
    let Some(rig) = world.get::<Rig>(active) else { return };
    let view = world.resource::<GraphView>();
    let selected: Vec<Uid> = view.selected.iter().copied().filter(|tag| rig.find_tag(*tag).is_some()).collect();
    let send = |world: &mut World, operation: TagOperation| {
        world.write_message(EditRequest::operation(active, Operation::Tags(operation)));
    };
    match action {
        GraphAction::LayOut => {
            let mut view = world.resource_mut::<GraphView>();
            view.moved.clear();
            look(&mut view, GraphLook::All);
        }
        GraphAction::ShowAll => look(&mut world.resource_mut::<GraphView>(), GraphLook::All),
        GraphAction::ShowSelected => look(&mut world.resource_mut::<GraphView>(), GraphLook::Selected),
        GraphAction::OpenFrames => fold_all(&mut world.resource_mut::<GraphView>(), true),
        GraphAction::FoldFrames => fold_all(&mut world.resource_mut::<GraphView>(), false),
        GraphAction::SelectAll => {
            let all = commands_of(rig, None);
            select(world, all);
        }
        GraphAction::SelectNone => select(world, BTreeSet::new()),
        GraphAction::Toggle => {
            let is_on = |tag: &Uid| rig.find_tag(*tag).is_some_and(|(_, tag)| tag.enabled);
            let are_on = selected.iter().all(is_on);
            send(world, TagOperation::Enable(selected, !are_on));
        }
        GraphAction::Delete => send(world, TagOperation::Delete(selected)),
    }
}

fn fold_all(view: &mut GraphView, are_open: bool) {
    view.folds.clear();
    view.lit.clear();
    view.every = Some(are_open);
    look(view, GraphLook::All);
}

fn look(view: &mut GraphView, at: GraphLook) {
    view.look = (view.look.0 + 1, at);
}

/// Keeps the selected commands with the selected joints: where a joint is selected elsewhere, its commands are. Commands that
/// are gone are not selected.
pub(super) fn follow_selection(
    (active, layout): (Option<Res<ActiveRig>>, Option<Res<Layout>>),
    rigs: Query<(Ref<Rig>, Ref<Selection>)>,
    mut view: ResMut<GraphView>,
) {
    // A panel that is not drawn cannot tell that the pointer has left it.
    if view.hovered && layout.is_some_and(|layout| !layout.is_forward(TITLE)) {
        view.hovered = false;
    }
    let active = active.map(|active| active.0);
    let is_other = view.rig != active;
    if is_other {
        *view = GraphView { rig: active, hovered: view.hovered, ..GraphView::default() };
    }
    let Some((rig, selection)) = active.and_then(|rig| rigs.get(rig).ok()) else { return };
    if rig.is_changed() && view.selected.iter().any(|tag| rig.find_tag(*tag).is_none()) {
        view.selected.retain(|tag| rig.find_tag(*tag).is_some());
    }
    if !is_other && !selection.is_changed() {
        return;
    }
    let joints: BTreeSet<Uid> = selection.0.iter().copied().filter(|uid| rig.joint(*uid).is_some()).collect();
    if joints_of(&rig, &view.selected) != joints {
        let tags = commands_of(&rig, Some(&selection.0));
        let frames = frames_of(&rig, &tags);
        if view.selected != tags {
            view.selected = tags;
        }
        // What an earlier selection opened is folded again.
        if view.lit != frames || frames.iter().any(|frame| view.folds.get(frame) == Some(&false)) {
            view.lit.clear();
            open(&mut view, frames);
        }
    }
}
