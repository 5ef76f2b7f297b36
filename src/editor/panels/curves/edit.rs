//! Gestures on curves: keys in time or in value, and tangents. A drag previews one operation, and the release makes it one step.

use bevy_egui::egui::{Key as KeyboardKey, PointerButton, Pos2, Rect, Response, Ui};

use super::{
    Plot,
    curve::{Curve, CurveKey},
};
use crate::{
    editor::{
        panel::Requests,
        panels::timeline::{KeyDrag, OpenClip, Timeline, TimelineRequest, add_keys, contains_keys, preview},
    },
    plugins::document::{Change, EditRequest},
    rig::{
        animation::{Key, TrackTarget},
        operations::{KeyOperation, KeyTimes},
    },
};

/// Pixels within which the pointer meets a key or the end of a tangent.
const REACH: f32 = 7.0;

/// Gesture of the pointer on curves.
pub(super) enum Gesture {
    /// Keys that move in time.
    Time(KeyDrag),
    /// Keys of a track that move in value.
    Value(ValueDrag),
    /// Tangent of a key.
    Tangent(TangentDrag),
    /// A box that selects keys, between two opposite corners.
    Box([Pos2; 2]),
    /// Time and values that are panned.
    Pan,
}

/// Keys that move in value.
pub(super) struct ValueDrag {
    target: TrackTarget,
    axis: usize,
    keys: Vec<CurveKey>,
    from: f32,
    shown: Option<KeyOperation>,
}

/// Tangent that is turned.
pub(super) struct TangentDrag {
    target: TrackTarget,
    axis: usize,
    key: CurveKey,
    /// Side of the key: 0 before it, 1 behind it.
    side: usize,
    shown: Option<KeyOperation>,
}

/// Meeting of the pointer with a curve.
#[derive(Clone, Copy)]
enum Hit<'a> {
    Key(&'a Curve, &'a CurveKey),
    Tangent(&'a Curve, &'a CurveKey, usize),
}

/// The nearest key or end of a tangent; tangents show at selected keys alone.
fn hit<'a>(at: Pos2, plot: &Plot, all: &'a [Curve], selected: &KeyTimes) -> Option<Hit<'a>> {
    let mut best: Option<(f32, Hit)> = None;
    let mut offer = |place: Pos2, hit: Hit<'a>| {
        let distance = place.distance(at);
        if distance <= REACH && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, hit));
        }
    };
    for curve in all {
        let times = selected.get(&curve.target);
        for key in &curve.keys {
            offer(plot.at(key.key.time, key.value), Hit::Key(curve, key));
            let is_selected = times.is_some_and(|times| times.contains(&key.key.time));
            for (side, end) in plot.tangents(key).filter(|_| is_selected).into_iter().flatten().enumerate() {
                offer(end, Hit::Tangent(curve, key, side));
            }
        }
    }
    best.map(|(_, hit)| hit)
}

/// Handles the pointer on the curves.
pub(super) fn gestures(
    gesture: &mut Option<Gesture>,
    ui: &Ui,
    response: &Response,
    plot: &Plot,
    all: &[Curve],
    open: &OpenClip,
    timeline: &Timeline,
    requests: &mut Requests,
) {
    let (held, escaped) = ui.input(|input| (input.modifiers, input.key_pressed(KeyboardKey::Escape)));
    let at = response.interact_pointer_pos().or_else(|| ui.input(|input| input.pointer.latest_pos()));
    if response.drag_started()
        && let (Some(press), Some(at)) = (ui.input(|input| input.pointer.press_origin()), at)
    {
        *gesture = begin(response, plot, all, timeline, (press, at), held.shift, requests);
    }
    if let Some(at) = at.filter(|_| !escaped) {
        let shown = match gesture {
            Some(Gesture::Pan) => {
                requests.send(TimelineRequest::Show(plot.axis.panned(response.drag_delta().x)));
                None
            }
            Some(Gesture::Time(drag)) => drag.to(open.clip, plot.axis.time(at.x), held.alt).then(|| drag.shown.clone()),
            Some(Gesture::Value(drag)) => drag.to(plot.value(at.y)).then(|| drag.shown.clone()),
            Some(Gesture::Tangent(drag)) => drag.to(plot, at, held.alt).then(|| drag.shown.clone()),
            Some(Gesture::Box(corners)) => {
                corners[1] = at;
                None
            }
            None => None,
        };
        if let Some(shown) = shown {
            requests.send(preview(open, shown));
        }
    }
    if (response.drag_stopped() || !response.dragged())
        && let Some(over) = gesture.take()
    {
        let was_dropped = escaped || !response.drag_stopped();
        let (is_moved, keys) = match over {
            Gesture::Time(drag) => (drag.shown.is_some(), Some(drag.moved)),
            Gesture::Value(drag) => (drag.shown.is_some(), None),
            Gesture::Tangent(drag) => (drag.shown.is_some(), None),
            Gesture::Box(_) if was_dropped => return,
            Gesture::Box([from, to]) => {
                let found = within(Rect::from_two_pos(from, to), plot, all, open);
                // The curves stay those of the selected keys: an empty box deselects nothing.
                if !found.is_empty() {
                    let mut keys = if held.shift || held.command { timeline.keys.clone() } else { KeyTimes::new() };
                    add_keys(&mut keys, &found);
                    requests.send(TimelineRequest::Select(keys));
                }
                return;
            }
            Gesture::Pan => return,
        };
        let is_moved = is_moved && !was_dropped;
        let change = if is_moved { Change::Commit } else { Change::CancelPreview };
        requests.send(EditRequest { rig: open.entity, change });
        if let Some(keys) = keys.filter(|_| is_moved) {
            requests.send(TimelineRequest::Select(keys));
        }
    }
    let is_menu = response.secondary_clicked();
    if (response.clicked() || is_menu)
        && let Some(at) = response.interact_pointer_pos()
        // The curves stay those of the selected keys: an empty click deselects nothing.
        && let Some(Hit::Key(curve, key)) = hit(at, plot, all, &timeline.keys)
    {
        let own = one(curve, key);
        // The menu of a selected key is that of all of them.
        if is_menu && contains_keys(&timeline.keys, &own) {
            return;
        }
        let is_more = !is_menu && (held.shift || held.command);
        let mut keys = if is_more { timeline.keys.clone() } else { KeyTimes::new() };
        add_keys(&mut keys, &own);
        requests.send(TimelineRequest::Select(keys));
    }
}

/// Keys of the curves in a box on the screen, those that stand close together as well.
fn within(area: Rect, plot: &Plot, all: &[Curve], open: &OpenClip) -> KeyTimes {
    let mut found = KeyTimes::new();
    for curve in all {
        let Some(track) = open.layer.and_then(|layer| layer.tracks.get(&curve.target)) else { continue };
        let is_inside = |time: &f32| curve.value_at(*time).is_some_and(|value| area.contains(plot.at(*time, value)));
        let times: Vec<f32> = track.keys.iter().map(|key| key.time).filter(is_inside).collect();
        if !times.is_empty() {
            let own: KeyTimes = [(curve.target.clone(), times)].into();
            add_keys(&mut found, &own);
        }
    }
    found
}

fn one(curve: &Curve, key: &CurveKey) -> KeyTimes {
    [(curve.target.clone(), vec![key.key.time])].into()
}

/// The gesture of a press that has become a drag, by its first direction.
fn begin(
    response: &Response,
    plot: &Plot,
    all: &[Curve],
    timeline: &Timeline,
    (press, at): (Pos2, Pos2),
    more: bool,
    requests: &mut Requests,
) -> Option<Gesture> {
    if response.dragged_by(PointerButton::Middle) {
        return Some(Gesture::Pan);
    }
    if !response.dragged_by(PointerButton::Primary) {
        return None;
    }
    let Some(hit) = hit(press, plot, all, &timeline.keys) else { return Some(Gesture::Box([press, at])) };
    match hit {
        Hit::Tangent(curve, key, side) => Some(Gesture::Tangent(TangentDrag {
            target: curve.target.clone(),
            axis: curve.axis,
            key: *key,
            side,
            shown: None,
        })),
        Hit::Key(curve, key) => {
            let own = one(curve, key);
            let keys = if contains_keys(&timeline.keys, &own) {
                timeline.keys.clone()
            } else {
                let mut keys = if more { timeline.keys.clone() } else { KeyTimes::new() };
                add_keys(&mut keys, &own);
                requests.send(TimelineRequest::Select(keys.clone()));
                keys
            };
            if (at.x - press.x).abs() > (at.y - press.y).abs() {
                return Some(Gesture::Time(KeyDrag::new(keys, key.key.time, plot.axis.time(press.x), None)));
            }
            let times = keys.get(&curve.target).cloned().unwrap_or_default();
            let keys = curve.keys.iter().filter(|key| times.contains(&key.key.time)).copied().collect();
            let from = plot.value(press.y);
            Some(Gesture::Value(ValueDrag { target: curve.target.clone(), axis: curve.axis, keys, from, shown: None }))
        }
    }
}

impl ValueDrag {
    /// Drags to a value of the pointer; true if the preview has to change.
    fn to(&mut self, value: f32) -> bool {
        let by = value - self.from;
        let moved = |key: &CurveKey| key.with_value(&self.target.property, self.axis, key.value + by);
        let keys: Vec<Key> = self.keys.iter().map(moved).collect();
        let next = (by != 0.0).then(|| KeyOperation::Set(vec![(self.target.clone(), keys)]));
        let is_other = next != self.shown;
        self.shown = next;
        is_other
    }
}

impl TangentDrag {
    /// Turns the tangent towards a pixel, on both sides of the key unless it is `broken`; true if the preview has to change.
    fn to(&mut self, plot: &Plot, at: Pos2, broken: bool) -> bool {
        let side = if self.side == 0 { -1.0 } else { 1.0 };
        // A tangent never turns back in time: two pixels beside the key it is as steep as it gets.
        let run = ((at.x - plot.axis.at(self.key.key.time)) * side).max(2.0) * side / plot.axis.scale();
        let slope = (plot.value(at.y) - self.key.value) / run;
        let mut slopes = self.key.slopes.unwrap_or_default();
        slopes[self.side] = slope;
        if !broken {
            slopes = [slope; 2];
        }
        let key = self.key.with_slopes(&self.target.property, self.axis, slopes);
        let next = (key != self.key.key).then(|| KeyOperation::Set(vec![(self.target.clone(), vec![key])]));
        let is_other = next != self.shown;
        self.shown = next;
        is_other
    }
}
