//! Timeline panel: clips with their keys, playback, and the playhead.
//!
//! The open clip poses the rig through a [`ClipPlayer`](crate::plugins::animation::ClipPlayer), so that neither scrubbing nor
//! playing changes the document. Keys are edited by operations alone, one step a gesture: a drag previews its operation and the
//! release commits it. What the timeline shows (clip, playhead, span, selected keys) is the resource [`Timeline`], which the
//! curves show as well; panels change it with [`TimelineRequest`]s.

mod action;
mod area;
mod axis;
mod bar;
mod carry_out;
mod colors;
mod drag;
mod follow;
pub mod import;
mod joint_table;
mod map_draft;
pub(in crate::editor) mod map_file;
mod marks;
mod mask;
mod menu;
pub mod motion_options;
mod node_menu;
mod orphaned_keys;
pub(in crate::editor) mod own_motion;
mod row;
mod ruler;
mod sheet;
mod shown_pose;
mod state;
mod switches;
mod tolerance;

use bevy::{prelude::*, window::RequestRedraw};
use bevy_egui::egui::{Rangef, Rect, Sense, Stroke, Ui, UiBuilder, WidgetInfo, WidgetType, pos2, vec2};

pub(in crate::editor) use self::state::key_times;
pub(super) use self::switches::{range, requested};
pub use self::{
    action::{TimelineAction, obstacle, over_timeline},
    axis::TimeAxis,
    marks::{Bucket, Mark, MarkKind, buckets},
    state::{OpenClip, Timeline, TimelineRequest},
    tolerance::ReductionTolerance,
};
pub(super) use self::{
    area::preview,
    colors::KeyColors,
    drag::KeyDrag,
    menu::show as show_key_menu,
    ruler::{Markers, height as ruler_height, lines, paint_playhead, show as show_ruler},
    state::{add as add_keys, contains as contains_keys},
};
use self::{
    area::{Gesture, Grid},
    bar::Bar,
    row::{LayerRename, RowContext},
    sheet::{Choice, Row, Sheet},
};
use super::{
    displayed_rig::DisplayedRig,
    fields::Numbers,
    list::{self, List},
};
use crate::{
    editor::{
        actions::ActionRequest,
        dock::ShowPanel,
        notice::Notice,
        panel::{EditorPanel, Requests},
    },
    plugins::RigSystems,
};

/// Plugin of the timeline: its state, actions and imports.
pub struct TimelinePlugin;

impl Plugin for TimelinePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Timeline>()
            .init_resource::<import::ClipImport>()
            .add_message::<TimelineRequest>()
            .add_message::<import::ImportRequest>()
            .add_message::<import::MapRequest>()
            .add_message::<ShowPanel>()
            .add_message::<ActionRequest>()
            .add_message::<Notice>()
            .add_message::<RequestRedraw>()
            .add_systems(
                Update,
                (carry_out::attend, import::start, import::change_map, import::land)
                    .chain()
                    .after(RigSystems::Gesture)
                    .before(RigSystems::Edits),
            )
            .add_systems(Last, (follow::follow_playback, follow::remember_names, follow::forget_hover).chain());
    }
}

/// The panel.
#[derive(Default)]
pub struct TimelinePanel {
    sheet: Sheet,
    choice: Choice,
    bar: Bar,
    markers: Markers,
    numbers: Numbers,
    gesture: Option<Gesture>,
    /// Name of a layer that is being typed.
    renaming: Option<LayerRename>,
    /// Number of changes of keys that are being dragged.
    drags: u64,
    /// True if the pointer was last told to be over the panel.
    is_pointed: bool,
}

impl EditorPanel for TimelinePanel {
    fn title(&self) -> &'static str {
        "Timeline"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(shown) = DisplayedRig::of(world) else {
            return list::nothing(ui, "No rig is open.");
        };
        let open = OpenClip::of(world);
        tell_hover(ui, self.title(), &mut self.is_pointed, world, requests);
        self.bar.show(ui, world, &shown, requests);
        if let Some(import) = world.get_resource::<import::ClipImport>()
            && let Some(draft) = import.draft().filter(|draft| draft.rig == shown.entity)
        {
            self.gesture = None;
            return joint_table::show(ui, draft, &shown, import.name().is_some(), requests);
        }
        let (Some(open), Some(timeline)) = (open, world.get_resource::<Timeline>()) else {
            self.gesture = None;
            let text = match shown.rig.clips() {
                [] => "The rig has no clips. Make one with the menu beside the choice, or import motion.",
                _ => "Choose a clip above; without one the rig shows its own pose.",
            };
            return list::nothing(ui, text);
        };
        self.sheet.refresh(world, shown.stamp(), &open);
        let context = RowContext { world, shown: &shown, open: &open, timeline };
        self.body(ui, &context, requests);
    }
}

impl TimelinePanel {
    /// Draws the ruler and, below it, the rows.
    fn body(&mut self, ui: &mut Ui, context: &RowContext, requests: &mut Requests) {
        let (open, timeline) = (context.open, context.timeline);
        let rect = ui.available_rect_before_wrap();
        if rect.width() < 60.0 || rect.height() < 40.0 {
            return;
        }
        let names = (rect.width() * 0.28).clamp(72.0, 240.0).min(rect.width() * 0.6);
        let split = rect.left() + names;
        let below = rect.top() + ruler::height(open.clip);
        let axis = TimeAxis { span: timeline.span, x: Rangef::new(split, rect.right()) };
        let head = Rect::from_min_max(rect.min, pos2(split - 4.0, rect.top() + ui.spacing().interact_size.y));
        ui.scope_builder(UiBuilder::new().id_salt("filter").max_rect(head), |ui| self.head(ui));
        let over = Rect::from_min_max(pos2(split, rect.top()), pos2(rect.right(), below));
        ruler::show(&mut self.markers, ui, over, &axis, open, requests);
        ui.advance_cursor_after_rect(Rect::from_min_max(rect.min, pos2(rect.right(), below)));
        let rows = self.sheet.rows(&self.choice, &context.shown.selection.0);
        let height = ui.spacing().interact_size.y;
        let view = Rect::from_min_max(pos2(split, below), rect.max);
        navigate(ui, view.union(over), &axis, requests);
        let list = List { id: "timeline rows", count: rows.len(), height, reveal: None, follow: false };
        list.show(ui, |ui, range, place| {
            let visible = ui.clip_rect();
            let area = Rect::from_min_max(pos2(split, visible.top().max(below)), pos2(rect.right(), visible.bottom()));
            let response = ui.interact(area, ui.id().with("keys"), Sense::click_and_drag());
            let said = format!("Keys of {}", open.clip.name);
            response.widget_info(|| WidgetInfo::labeled(WidgetType::Other, true, &said));
            let grid = Grid { rows: &rows, axis, top: place(0).top(), height };
            // The gesture comes first, so that keys are painted where they are dragged to in this frame.
            let gesture = &mut self.gesture;
            if area::gestures(gesture, ui, &response, &grid, &self.sheet, open, timeline, requests) {
                self.drags += 1;
            }
            menu::show(&response, context.world, requests);
            self.paint(ui, area, range.clone().map(|number| (rows[number], place(number))), &axis, context);
            for number in range {
                row::show(self, ui, place(number).with_max_x(rect.right()), split, rows[number], context, requests);
            }
        });
    }

    /// The filter of the rows.
    fn head(&mut self, ui: &mut Ui) {
        let tip = "Nodes whose name or properties contain all of these words";
        let Choice { filter, selected_only, .. } = &mut self.choice;
        list::search_bar(ui, "Filter keys", tip, filter, |ui| {
            let on = *selected_only;
            let response = ui.selectable_label(on, "👁").on_hover_text("Only the nodes that are selected");
            response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, on, "Selected nodes only"));
            if response.clicked() {
                *selected_only = !on;
            }
        });
    }

    /// Paints lines of time, the marks of the visible rows, and the playhead.
    fn paint(
        &mut self,
        ui: &Ui,
        area: Rect,
        rows: impl Iterator<Item = (Row, Rect)>,
        axis: &TimeAxis,
        context: &RowContext,
    ) {
        let (open, timeline) = (context.open, context.timeline);
        let painter = ui.painter_at(area);
        let line = Stroke::new(1.0, ui.visuals().faint_bg_color);
        for (_, x) in lines(axis, open.clip) {
            painter.vline(x, area.y_range(), line);
        }
        let dragged = match &self.gesture {
            Some(Gesture::Keys(drag)) => Some(&drag.moved),
            _ => None,
        };
        let version = (timeline.changes, dragged.map_or(0, |_| self.drags + 1));
        let keys = dragged.unwrap_or(&timeline.keys);
        let colors = KeyColors::of(ui.visuals());
        self.sheet.note_selected(keys, version);
        for (row, place) in rows {
            let place = place.with_min_x(area.left()).with_max_x(area.right());
            if matches!(row, Row::All | Row::Node(_)) {
                painter.rect_filled(place.shrink2(vec2(0.0, 1.0)), 0.0, ui.visuals().faint_bg_color);
            }
            let selected = self.sheet.selected_times(row, keys);
            area::paint(&painter, place, axis, (&self.sheet, row), selected, &colors);
        }
        ruler::paint_playhead(ui, area, axis, open);
    }
}

/// Tells whether the pointer is over a panel of keys, which then takes the keys that delete and select. `is_pointed` is what the
/// panel has told last.
pub(super) fn tell_hover(ui: &Ui, panel: &'static str, is_pointed: &mut bool, world: &World, requests: &mut Requests) {
    let is_over = OpenClip::of(world).is_some() && ui.rect_contains_pointer(ui.max_rect());
    let is_known = world.get_resource::<Timeline>().is_some_and(|timeline| timeline.hovered == Some(panel));
    if is_over != *is_pointed || is_over && !is_known {
        *is_pointed = is_over;
        requests.send(TimelineRequest::Hover(panel, is_over));
    }
}

/// Zooms with Control and the wheel, and pans with a wheel to the side.
pub(super) fn navigate(ui: &Ui, rect: Rect, axis: &TimeAxis, requests: &mut Requests) {
    let Some(pointer) = ui.input(|input| input.pointer.hover_pos()) else { return };
    if !ui.rect_contains_pointer(rect) {
        return;
    }
    let (zoom, scroll) = ui.input(|input| (input.zoom_delta(), input.smooth_scroll_delta().x));
    if zoom != 1.0 {
        requests.send(TimelineRequest::Show(axis.zoomed(zoom, pointer.x)));
    } else if scroll != 0.0 {
        requests.send(TimelineRequest::Show(axis.panned(scroll)));
    }
}
