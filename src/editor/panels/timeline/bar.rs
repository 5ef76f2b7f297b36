//! The bar of the timeline: the choice of a clip, playback, and the clip's range and frame rate. Buttons that can do nothing say
//! why.

use bevy::prelude::*;
use bevy_egui::egui::{
    Button, ComboBox, PopupCloseBehavior, RichText, Sense, Ui, WidgetInfo, WidgetType,
    containers::menu::{MenuButton, MenuConfig},
    vec2,
};

use super::{
    action::{TimelineAction, obstacle},
    state::{OpenClip, Timeline, TimelineRequest, frames},
    tolerance,
};
use crate::{
    editor::{
        actions::{Action, ActionRequest},
        keys::KeyBindings,
        panel::Requests,
        panels::{
            displayed_rig::DisplayedRig,
            fields::{self, Look, NumberEdit, Numbers, Renaming},
        },
    },
    plugins::document::{Change, EditRequest},
    rig::{
        Uid,
        animation::{ClipAbout, RigClip},
        operations::{ClipOperation, Operation},
        proportion::Quantity,
    },
};

/// State of the bar.
#[derive(Default)]
pub(super) struct Bar {
    rename: Option<Rename>,
    numbers: Numbers,
    /// Clip whose range or frame rate is being dragged, as it was before, where its keys are stretched with them.
    dragged: Option<ClipTiming>,
}

/// Range and frame rate of a clip before its keys are stretched.
#[derive(Debug, Clone, Copy)]
struct ClipTiming {
    clip: Uid,
    range: [f32; 2],
    rate: f32,
}

/// Field of a clip's header.
#[derive(Debug, Clone, Copy)]
enum Header {
    Start,
    End,
    Rate,
}

/// Name of a clip that is being typed.
struct Rename {
    clip: Uid,
    text: String,
    focused: bool,
}

const FRAMES: Look = Look { speed: 0.2, decimals: 2, suffix: "", quantity: Quantity::Plain };
/// Least and largest frame rate of a clip.
const RATES: [f32; 2] = [0.1, 1000.0];
const RATE: Look = Look { speed: 0.1, decimals: 3, suffix: "", quantity: Quantity::Plain };

/// Widths with which the bar stays on one line.
#[derive(Debug, Clone, Copy)]
struct Fit {
    /// Choice of a clip.
    clip: f32,
    /// Frame, start, end and frame rate.
    fields: [f32; 4],
    /// True for lines between the groups, and the word before the frame.
    is_wide: bool,
    /// True for all buttons; without, the rarer ones are in the menu alone.
    has_all: bool,
}

impl Fit {
    fn of(width: f32) -> Self {
        let narrow = [56.0, 62.0, 56.0, 62.0];
        match width {
            840.0.. => Self { clip: 132.0, fields: [84.0, 72.0, 72.0, 72.0], is_wide: true, has_all: true },
            690.0.. => Self { clip: 96.0, fields: narrow, is_wide: false, has_all: true },
            _ => Self { clip: 88.0, fields: narrow, is_wide: false, has_all: false },
        }
    }
}

/// Actions that a narrow bar has in its menu alone.
const RARER: [TimelineAction; 4] =
    [TimelineAction::Start, TimelineAction::End, TimelineAction::Marker, TimelineAction::Fit];

impl Bar {
    pub fn show(&mut self, ui: &mut Ui, world: &World, shown: &DisplayedRig, requests: &mut Requests) {
        let open = OpenClip::of(world);
        let fit = Fit::of(ui.available_width());
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            ui.spacing_mut().button_padding.x = 3.0;
            let line = |ui: &mut Ui| {
                if fit.is_wide {
                    ui.separator();
                }
            };
            let tool =
                |ui: &mut Ui, symbol: &str, action: TimelineAction, on: Option<bool>, requests: &mut Requests| {
                    if fit.has_all || !RARER.contains(&action) {
                        tool(ui, world, symbol, action, on, requests);
                    }
                };
            self.clips(ui, shown, open.as_ref(), fit.clip, requests);
            self.menu(ui, world, open.as_ref(), requests);
            line(ui);
            let playing = world.get_resource::<Timeline>().is_some_and(|timeline| timeline.playing);
            for (symbol, action) in [
                ("⏮", TimelineAction::Start),
                ("⏪", TimelineAction::PreviousKey),
                ("⏴", TimelineAction::PreviousFrame),
                (if playing { "⏸" } else { "▶" }, TimelineAction::Play),
                ("⏵", TimelineAction::NextFrame),
                ("⏩", TimelineAction::NextKey),
                ("⏭", TimelineAction::End),
            ] {
                tool(ui, symbol, action, None, requests);
            }
            let is_looped = open.is_some_and(|open| open.clip.looped);
            tool(ui, "🔁", TimelineAction::Loop, Some(is_looped), requests);
            line(ui);
            tool(ui, "🔑", TimelineAction::Key, None, requests);
            let auto_key = world.get_resource::<Timeline>().is_some_and(|timeline| timeline.auto_key);
            tool(ui, "⏺", TimelineAction::AutoKey, Some(auto_key), requests);
            tool(ui, "⚑", TimelineAction::Marker, None, requests);
            tool(ui, "⌖", TimelineAction::Fit, None, requests);
            if let Some(open) = &open {
                line(ui);
                let is_stretched = world.get_resource::<Timeline>().is_some_and(|timeline| timeline.stretch);
                self.frames(ui, open, &fit, is_stretched, requests);
            }
        });
    }

    /// The choice of a clip, or the field in which its name is typed.
    fn clips(
        &mut self,
        ui: &mut Ui,
        shown: &DisplayedRig,
        open: Option<&OpenClip>,
        width: f32,
        requests: &mut Requests,
    ) {
        let size = vec2(width, ui.spacing().interact_size.y);
        if let Some(rename) = &mut self.rename {
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            let id = ui.id().with((rename.clip, "rename"));
            match fields::rename(ui, rect, id, "Rename clip", &mut rename.text, &mut rename.focused) {
                Renaming::Typing => {}
                Renaming::Dropped => self.rename = None,
                Renaming::Accepted => {
                    let Some(Rename { clip, text, .. }) = self.rename.take() else { return };
                    let name = text.trim().to_owned();
                    if shown.rig.clip(clip).is_some_and(|clip| !name.is_empty() && clip.name != name) {
                        let operation = Operation::Clips(ClipOperation::Rename(clip, name));
                        requests.send(EditRequest::operation(shown.entity, operation));
                    }
                }
            }
            return;
        }
        let now = open.map(|open| open.clip.uid);
        let text = open.map_or("No clip", |open| open.clip.name.as_str());
        let mut chosen = now;
        let combo = ComboBox::from_id_salt("clip").selected_text(text).width(size.x).truncate().show_ui(ui, |ui| {
            ui.selectable_value(&mut chosen, None, "No clip");
            for clip in shown.rig.clips() {
                ui.selectable_value(&mut chosen, Some(clip.uid), &clip.name);
            }
        });
        ui.ctx().accesskit_node_builder(combo.response.id, |node| node.set_label("Clip"));
        combo.response.on_hover_text("The clip that is shown; without one the rig shows its own pose");
        if chosen != now {
            requests.send(TimelineRequest::Open(chosen));
        }
    }

    fn menu(&mut self, ui: &mut Ui, world: &World, open: Option<&OpenClip>, requests: &mut Requests) {
        // Fields are clicked without the menu being closed; entries close it.
        let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
        let (menu, _) = MenuButton::new("…").config(config).ui(ui, |ui| {
            entry(ui, world, TimelineAction::NewClip, requests);
            let rename = ui.add_enabled(open.is_some(), Button::new("Rename clip"));
            if rename.on_disabled_hover_text("no clip is open").clicked()
                && let Some(open) = open
            {
                self.rename = Some(Rename { clip: open.clip.uid, text: open.clip.name.clone(), focused: false });
                ui.close();
            }
            entry(ui, world, TimelineAction::DuplicateClip, requests);
            entry(ui, world, TimelineAction::DeleteClip, requests);
            ui.separator();
            entry(ui, world, TimelineAction::Import, requests);
            entry(ui, world, TimelineAction::ImportOwn, requests);
            entry(ui, world, TimelineAction::NewLayer, requests);
            entry(ui, world, TimelineAction::KeyAll, requests);
            ui.separator();
            RARER.into_iter().for_each(|action| entry(ui, world, action, requests));
            ui.separator();
            entry(ui, world, TimelineAction::BakeClip, requests);
            entry(ui, world, TimelineAction::ReduceClip, requests);
            if let Some(timeline) = world.get_resource::<Timeline>() {
                tolerance::fields(ui, timeline, requests);
            }
            entry(ui, world, TimelineAction::Longer, requests);
            entry(ui, world, TimelineAction::Shorter, requests);
            let mut is_stretched = world.get_resource::<Timeline>().is_some_and(|timeline| timeline.stretch);
            let stretch = ui.checkbox(&mut is_stretched, TimelineAction::Stretch.name());
            if stretch.on_hover_text("Keys and markers go along when start, end or frame rate are changed").clicked() {
                requests.send(ActionRequest(Action::Timeline(TimelineAction::Stretch)));
                ui.close();
            }
        });
        menu.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "Menu of the clip"));
        menu.on_hover_text("Make, rename, copy, delete and import clips");
    }

    /// The frame of the playhead, the range and the frame rate.
    fn frames(&mut self, ui: &mut Ui, open: &OpenClip, fit: &Fit, is_stretched: bool, requests: &mut Requests) {
        let clip = open.clip;
        let height = ui.spacing().interact_size.y;
        let seconds = |frame: f32| (f64::from(frame) / f64::from(clip.frame_rate)) as f32;
        let mut field = |ui: &mut Ui, said: &str, prefix: &str, value: f32, look: Look, width: f32| {
            // Fields are placed, not laid out: they do not wrap by themselves.
            if ui.available_size_before_wrap().x < width {
                ui.end_row();
            }
            self.numbers.field(ui, said, RichText::new(prefix), value.into(), look, vec2(width, height))
        };
        let [of_frame, of_start, of_end, of_rate] = fit.fields;
        let word = if fit.is_wide { "Frame " } else { "" };
        let frame = field(ui, "Frame", word, open.frame(), FRAMES, of_frame);
        if let Some(NumberEdit::Set(frame) | NumberEdit::Preview(frame)) = frame {
            requests.send(TimelineRequest::Scrub(seconds(frame)));
        }
        let [start, end] = clip.range.map(|time| frames(clip, time));
        let edits = [
            (Header::Start, field(ui, "Start frame", "from ", start, FRAMES, of_start)),
            (Header::End, field(ui, "End frame", "to ", end, FRAMES, of_end)),
            (Header::Rate, field(ui, "Frames a second", "fps ", clip.frame_rate, RATE, of_rate)),
        ];
        // People type the digits that the fields show.
        let [first, last] = [start, end].map(shown_frame);
        let (from, to) = match is_stretched {
            true => ([f32::NEG_INFINITY, shown_frame(end - 1.0)], [shown_frame(start + 1.0), f32::INFINITY]),
            false => ([f32::NEG_INFINITY, last], [first, f32::INFINITY]),
        };
        let ends = [(from, "Start frame"), (to, "End frame"), (RATES, "Frames a second")];
        // A drag previews from what was before it, not from its own preview.
        if !ui.input(|input| input.pointer.any_down()) {
            self.dragged = None;
        }
        for ((header, edit), (ends, said)) in edits.into_iter().zip(ends) {
            let Some(edit) = edit.and_then(|edit| self.numbers.between(said, edit, ends)) else { continue };
            let change = if is_stretched {
                let now = ClipTiming { clip: clip.uid, range: clip.range, rate: clip.frame_rate };
                let before = self.dragged.filter(|before| before.clip == clip.uid).unwrap_or(now);
                if matches!(edit, NumberEdit::Preview(_)) {
                    self.dragged = Some(before);
                }
                as_change(edit, |value| stretched(&before, header, value))
            } else {
                changed(clip, edit, |about, value| match header {
                    Header::Start => about.range[0] = seconds(value).min(about.range[1]),
                    Header::End => about.range[1] = seconds(value).max(about.range[0]),
                    Header::Rate => about.frame_rate = value.clamp(RATES[0], RATES[1]),
                })
            };
            requests.send(EditRequest { rig: open.entity, change });
        }
        self.numbers.tell(requests);
    }
}

/// A frame with the digits that its field shows.
fn shown_frame(frame: f32) -> f32 {
    (frame * 100.0).round() / 100.0
}

/// Change of a clip's header by a number.
pub(super) fn changed(clip: &RigClip, edit: NumberEdit, set: impl Fn(&mut ClipAbout, f32)) -> Change {
    as_change(edit, |value| about(clip, |about| set(about, value)))
}

/// Change by a number.
fn as_change(edit: NumberEdit, operation: impl Fn(f32) -> Operation) -> Change {
    match edit {
        NumberEdit::Set(value) => Change::Do(operation(value)),
        NumberEdit::Preview(value) => Change::Preview(operation(value)),
        NumberEdit::Commit => Change::Commit,
        NumberEdit::Cancel => Change::CancelPreview,
    }
}

/// Operation that stretches a clip to another start, end or frame rate; a clip is a frame long at least.
fn stretched(before: &ClipTiming, header: Header, value: f32) -> Operation {
    let ClipTiming { clip, range: [start, end], rate } = *before;
    let (seconds, frame) = (value / rate, 1.0 / rate);
    let to = match header {
        Header::Start => [seconds.min(end - frame), end],
        Header::End => [start, seconds.max(start + frame)],
        Header::Rate => {
            return Operation::Clips(ClipOperation::SetRate { clip, rate: value.clamp(RATES[0], RATES[1]) });
        }
    };
    Operation::Clips(ClipOperation::Retime { clip, from: [start, end], to })
}

/// Operation that changes the header of a clip.
pub(super) fn about(clip: &RigClip, change: impl FnOnce(&mut ClipAbout)) -> Operation {
    let mut about = clip.about();
    change(&mut about);
    Operation::Clips(ClipOperation::About(clip.uid, Box::new(about)))
}

fn key_of(world: &World, action: TimelineAction) -> Option<String> {
    world.get_resource::<KeyBindings>()?.key(Action::Timeline(action)).map(ToString::to_string)
}

/// Draws a button with a symbol, which is called by its action. `on` makes it a switch.
fn tool(ui: &mut Ui, world: &World, symbol: &str, action: TimelineAction, on: Option<bool>, requests: &mut Requests) {
    let side = ui.spacing().interact_size.y;
    let why_not = obstacle(world, action);
    let button = match on {
        Some(on) => Button::selectable(on, symbol),
        None => Button::new(symbol),
    };
    let response = ui.add_enabled(why_not.is_none(), button.min_size(vec2(side + 2.0, side)));
    response.widget_info(|| match on {
        Some(on) => WidgetInfo::selected(WidgetType::Button, why_not.is_none(), on, action.name()),
        None => WidgetInfo::labeled(WidgetType::Button, why_not.is_none(), action.name()),
    });
    let clicked = response.clicked();
    let tip = match key_of(world, action) {
        Some(key) => format!("{} ({key})", action.name()),
        None => action.name().to_owned(),
    };
    match why_not {
        Some(why_not) => response.on_disabled_hover_text(format!("{tip}: {why_not}")),
        None => response.on_hover_text(tip),
    };
    if clicked {
        requests.send(ActionRequest(Action::Timeline(action)));
    }
}

/// Draws an entry of a menu.
pub(super) fn entry(ui: &mut Ui, world: &World, action: TimelineAction, requests: &mut Requests) {
    let why_not = obstacle(world, action);
    let button = Button::new(action.name());
    let button = match key_of(world, action) {
        Some(key) => button.shortcut_text(key),
        None => button,
    };
    let response = ui.add_enabled(why_not.is_none(), button);
    let clicked = response.clicked();
    if let Some(why_not) = why_not {
        response.on_disabled_hover_text(why_not);
    }
    if clicked {
        requests.send(ActionRequest(Action::Timeline(action)));
        ui.close();
    }
}
