//! Clicks of a frame, answered in the order in which they were made.
//!
//! Each tool reads the pointer by itself. Where a frame takes long, several tools have clicks in it, and what one of them picks
//! follows from the selection that the one before it left.

use bevy::{ecs::message::MessageId, prelude::*};

use super::{
    ToolPointer,
    scene::Scene,
    select::{ClickedSelection, DrawnControls},
    transform,
};
use crate::{
    editor::pointer::ModifierKeys,
    plugins::picking::{Pick, PickRequest},
    rig::Uid,
};

/// Clicks of this frame that are not answered yet, with the numbers of their pointer events.
#[derive(Resource, Debug, Default)]
pub(super) struct ClickWishes(Vec<(usize, ClickWish)>);

/// A click, or the end of a drag that picks something.
#[derive(Debug)]
pub(super) enum ClickWish {
    /// Picks what was found already.
    Pick(PickRequest),
    /// Click on the mesh, a joint or a control.
    Click {
        /// Pick of what the click meets; `None` beside all.
        pick: Option<Pick>,
        held: ModifierKeys,
        /// Number of clicks in a row.
        count: u8,
        /// Node that the click picks.
        under: Option<Uid>,
    },
    /// Click on a handle of a gizmo, which never hides the joints and controls below it.
    Handle { at: Vec2, held: ModifierKeys, count: u8 },
}

impl ClickWishes {
    /// Adds the click that ends with a pointer event.
    pub fn add(&mut self, event: MessageId<ToolPointer>, wish: ClickWish) {
        self.0.push((event.id, wish));
    }
}

/// Asks for what the clicks of the frame pick.
pub(super) fn answer(
    mut wishes: ResMut<ClickWishes>,
    (scene, controls): (Scene, DrawnControls),
    mut picks: MessageWriter<PickRequest>,
) {
    if wishes.0.is_empty() {
        return;
    }
    let mut wishes = std::mem::take(&mut wishes.0);
    let Some(rig) = scene.rig() else { return };
    wishes.sort_by_key(|(event, _)| *event);
    let mut selection = ClickedSelection::default();
    for (_, wish) in wishes {
        let request = match wish {
            ClickWish::Pick(request) => {
                selection.follow(&rig, &request, None);
                Some(request)
            }
            ClickWish::Click { pick, held, count, under } => Some(selection.request(&rig, pick, held, count, under)),
            ClickWish::Handle { at, held, count } => {
                let request = transform::clicked((&scene, &controls), &rig, selection.nodes(&rig), at, held, count);
                request.inspect(|request| selection.follow(&rig, request, None))
            }
        };
        picks.write_batch(request);
    }
}
