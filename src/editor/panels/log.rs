//! Log panel: all notices, and their storage.

use std::{borrow::Cow, collections::VecDeque, time::Duration};

use bevy::{prelude::*, window::RequestRedraw};
use bevy_egui::egui::{self, Color32, Label, Rect, RichText, ScrollArea, Sense, Ui, WidgetInfo, WidgetType};

use super::list::{self, List};
use crate::{
    editor::{
        counts::counted,
        dock::ShowPanel,
        notice::{EditNotice, Notice, Severity, capitalised},
        panel::{EditorPanel, Requests},
        style,
    },
    plugins::{
        controls::SwitchedOver,
        document::{ChangeError, EditRefusal, EditReport},
        limits::RigLimits,
    },
    rig::step::Commit,
};

/// Plugin that stores notices, and makes notices of refused edits and of what operations note.
pub struct LogPlugin;

impl Plugin for LogPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<LogBook>()
            .add_message::<Notice>()
            .add_message::<EditNotice>()
            .add_message::<ClearLog>()
            .add_message::<EditRefusal>()
            .add_message::<EditReport>()
            .add_message::<SwitchedOver>()
            .add_message::<RequestRedraw>()
            .add_systems(
                Last,
                (tell_made, tell_notes, tell_refusals, tell_switches, keep_notices).chain().in_set(LogSystems),
            );
    }
}

/// System set in `Last` that writes this frame's notices into the [`LogBook`]. Systems that make notices of other
/// messages in `Last` run before it.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct LogSystems;

/// The notices so far, oldest first; the oldest are dropped beyond [`LogBook::CAPACITY`].
#[derive(Resource, Debug, Default)]
pub struct LogBook {
    entries: VecDeque<LogEntry>,
    /// The number of the next entry.
    next: u64,
}

/// A notice with its time.
#[derive(Debug, Clone, PartialEq)]
pub struct LogEntry {
    /// Number of the entry, counted from 0 and never reused.
    pub number: u64,
    /// Time since the program started.
    pub at: Duration,
    /// The notice.
    pub notice: Notice,
    /// Number of repetitions in a row.
    pub times: u32,
}

/// Request to clear the log.
#[derive(Message, Debug, Clone, Copy)]
pub struct ClearLog;

impl LogBook {
    /// The largest number of entries.
    pub const CAPACITY: usize = 2_000;

    /// The entries, oldest first.
    pub fn entries(&self) -> impl DoubleEndedIterator<Item = &LogEntry> + ExactSizeIterator {
        self.entries.iter()
    }

    /// The number that the next entry gets: changes whenever one is added.
    pub fn next_number(&self) -> u64 {
        self.next
    }

    /// Adds a notice. A repetition of the last one increases its count and updates its time.
    pub fn add(&mut self, notice: Notice, at: Duration) {
        let mut times = 1;
        if let Some(last) = self.entries.pop_back_if(|last| last.notice == notice) {
            times = last.times.saturating_add(1);
        }
        if self.entries.len() >= Self::CAPACITY {
            self.entries.pop_front();
        }
        self.entries.push_back(LogEntry { number: self.next, at, notice, times });
        self.next += 1;
    }
}

impl LogEntry {
    /// The entry as one line for the clipboard.
    pub fn line(&self) -> String {
        let times = if self.times > 1 { format!(" ({} times)", self.times) } else { String::new() };
        format!("{} {}: {}{times}", clock(self.at), severity_name(self.notice.severity), self.notice.text)
    }
}

/// Tells the success of edits that were made. Each step stands for one notice, for two requests of one title may be one
/// that is made and one that is refused.
fn tell_made(
    mut waiting: MessageReader<EditNotice>,
    mut edited: MessageReader<EditReport>,
    mut notices: MessageWriter<Notice>,
) {
    let step_of = |report: &EditReport| match &report.committed {
        Some(Commit::Done(step)) => Some((report.rig, step.name.clone())),
        _ => None,
    };
    let mut made: Vec<(Entity, Cow<'static, str>)> = edited.read().filter_map(step_of).collect();
    for EditNotice { rig, step, notice } in waiting.read() {
        if let Some(at) = made.iter().position(|(of, title)| of == rig && title == step) {
            made.remove(at);
            notices.write(notice.clone());
        }
    }
}

/// Tells what an operation noted, once it is carried out.
fn tell_notes(mut edited: MessageReader<EditReport>, mut notices: MessageWriter<Notice>) {
    for note in edited.read().flat_map(|report| &report.notes) {
        notices.write(Notice::warning(sentence(note)));
    }
}

fn tell_refusals(mut refused: MessageReader<EditRefusal>, mut notices: MessageWriter<Notice>) {
    for refused in refused.read() {
        let text = sentence(&refused.reason.to_string());
        notices.write(match refused.reason {
            // A key that was pressed once too often has done no harm.
            ChangeError::NothingToUndo | ChangeError::NothingToRedo => Notice::info(text),
            _ => Notice::error(text),
        });
    }
}

/// Tells what a switch over a range did, and the joints that it could not hold.
fn tell_switches(mut switched: MessageReader<SwitchedOver>, mut notices: MessageWriter<Notice>) {
    for SwitchedOver { frames, keys, notes, .. } in switched.read() {
        notices.write(match notes.first() {
            None => {
                let (frames, keys) = (counted(*frames, "frame", "frames"), counted(*keys, "key", "keys"));
                Notice::done(format!("Switched over {frames} with {keys}; all joints move as before."))
            }
            Some(first) => {
                let more = match notes.len() {
                    1 => String::new(),
                    count => format!(" So do {} more.", count - 1),
                };
                let text = "Switched, but not all joints could be held:";
                Notice::warning(format!("{text} {first}.{more}"))
            }
        });
    }
}

/// A reason as a sentence: capitalised, with a full stop.
fn sentence(reason: &str) -> String {
    let end = if reason.ends_with(['.', '!', '?']) { "" } else { "." };
    format!("{}{end}", capitalised(reason))
}

fn keep_notices(
    mut notices: MessageReader<Notice>,
    mut clear: MessageReader<ClearLog>,
    mut book: ResMut<LogBook>,
    time: Option<Res<Time<Real>>>,
    limits: Option<Res<RigLimits>>,
    mut redraw: MessageWriter<RequestRedraw>,
) {
    if clear.read().count() > 0 {
        book.entries.clear();
    }
    let at = time.map(|time| time.elapsed()).unwrap_or_default();
    for notice in notices.read() {
        // Toasts and the log show the same text.
        let mut text = notice.sentence().into_owned();
        if let Some(limits) = &limits {
            text = limits.shortened(&text);
        }
        book.add(Notice { text, ..notice.clone() }, at);
        redraw.write(RequestRedraw);
    }
}

/// The panel.
#[derive(Default)]
pub struct LogPanel {
    search: String,
    /// True for each of [`KINDS`] that is left out.
    hidden: [bool; 3],
    /// The entry whose full text is shown.
    chosen: Option<u64>,
    listed: MatchedEntries,
}

/// Reason why there is nothing to do.
const EMPTY: &str = "The log is empty";

/// Kinds of entries that are listed or left out, by a severity of each.
const KINDS: [(Severity, &str); 3] =
    [(Severity::Info, "Show information"), (Severity::Warning, "Show warnings"), (Severity::Error, "Show errors")];

/// Number of an entry's kind in [`KINDS`].
fn kind_of(severity: Severity) -> usize {
    match severity {
        Severity::Info | Severity::Done => 0,
        Severity::Warning => 1,
        Severity::Error => 2,
    }
}

/// Numbers of the entries that match the search, with the search and the kinds they belong to.
#[derive(Default)]
struct MatchedEntries {
    made_from: Option<(u64, usize, String, [bool; 3])>,
    places: Vec<usize>,
}

impl EditorPanel for LogPanel {
    fn title(&self) -> &'static str {
        "Log"
    }

    fn show(&mut self, ui: &mut Ui, world: &World, requests: &mut Requests) {
        let Some(book) = world.get_resource::<LogBook>() else { return };
        if self.refresh(book) {
            // The list reaches its end one frame after it has grown.
            ui.ctx().request_repaint();
        }
        self.bar(ui, book, requests);
        if book.entries.is_empty() {
            return list::nothing(ui, "No notices yet.");
        }
        let chosen = self.chosen.and_then(|chosen| book.entries().find(|entry| entry.number == chosen));
        let detail = chosen.map_or(0.0, |_| (ui.available_height() * 0.35).clamp(44.0, 110.0));
        let height = (ui.available_height() - detail).max(40.0);
        ui.allocate_ui(egui::vec2(ui.available_width(), height), |ui| {
            ui.set_height(height);
            self.entries(ui, book);
        });
        if let Some(entry) = chosen {
            ui.separator();
            ScrollArea::vertical().id_salt("whole text").auto_shrink(false).show(ui, |ui| {
                ui.add(Label::new(RichText::new(entry.line())).wrap().selectable(true));
                if let Some(panel) = entry.notice.panel
                    && ui.button(format!("Show in {panel}")).clicked()
                {
                    requests.send(ShowPanel(panel));
                }
            });
        }
    }
}

impl LogPanel {
    /// Searches again if the entries or the search changed; returns `true` if so.
    fn refresh(&mut self, book: &LogBook) -> bool {
        let key = (book.next, book.entries.len(), self.search.clone(), self.hidden);
        if self.listed.made_from.as_ref() == Some(&key) {
            return false;
        }
        let words: Vec<String> = self.search.split_whitespace().map(str::to_lowercase).collect();
        let found = |entry: &LogEntry| {
            let text = entry.notice.text.to_lowercase();
            let kind = severity_name(entry.notice.severity);
            !self.hidden[kind_of(entry.notice.severity)]
                && words.iter().all(|word| text.contains(word) || kind.starts_with(word.as_str()))
        };
        self.listed.places =
            book.entries().enumerate().filter(|(_, entry)| found(entry)).map(|(place, _)| place).collect();
        self.listed.made_from = Some(key);
        true
    }

    fn bar(&mut self, ui: &mut Ui, book: &LogBook, requests: &mut Requests) {
        let (mut copy, mut clear) = (false, false);
        let is_any_listed = !self.listed.places.is_empty();
        let hidden = &mut self.hidden;
        let tip = "Entries with all of these words; error, warning, done and info stand for the kinds";
        list::search_bar(ui, "Search", tip, &mut self.search, |ui| {
            let is_empty = book.entries.is_empty();
            let button = ui.add_enabled(!is_empty, egui::Button::new("Clear")).on_hover_text("Forget all entries");
            clear = button.on_disabled_hover_text(EMPTY).clicked();
            let button = ui.add_enabled(is_any_listed, egui::Button::new("Copy")).on_hover_text("Copy what is listed");
            copy = button.on_disabled_hover_text(if is_empty { EMPTY } else { "No entry is listed" }).clicked();
            // From right to left.
            for ((severity, name), hidden) in KINDS.into_iter().zip(hidden).rev() {
                kind_button(ui, severity, name, hidden);
            }
        });
        if copy {
            let lines = self.listed.places.iter().filter_map(|place| book.entries.get(*place)).map(LogEntry::line);
            ui.ctx().copy_text(lines.collect::<Vec<_>>().join("\n"));
        }
        if clear {
            requests.send(ClearLog);
        }
    }

    fn entries(&mut self, ui: &mut Ui, book: &LogBook) {
        let height = list::row_height(ui);
        let places = &self.listed.places;
        let chosen = &mut self.chosen;
        List { id: "entries", count: places.len(), height, reveal: None, follow: true }.show(ui, |ui, range, row| {
            for number in range {
                let Some(entry) = places.get(number).and_then(|place| book.entries.get(*place)) else { continue };
                entry_row(ui, row(number), entry, chosen);
            }
        });
    }
}

/// Draws a button that lists entries of a kind or leaves them out.
fn kind_button(ui: &mut Ui, severity: Severity, name: &str, hidden: &mut bool) {
    let (symbol, color) = severity_symbol(ui, severity);
    let is_listed = !*hidden;
    let color = if is_listed { color } else { ui.visuals().weak_text_color() };
    let button = ui.selectable_label(is_listed, RichText::new(symbol).color(color)).on_hover_text(name);
    button.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, is_listed, name));
    if button.clicked() {
        *hidden = is_listed;
    }
}

fn entry_row(ui: &mut Ui, rect: Rect, entry: &LogEntry, chosen: &mut Option<u64>) {
    let is_chosen = *chosen == Some(entry.number);
    let response = ui.interact(rect, ui.id().with(entry.number), Sense::click());
    response.widget_info(|| WidgetInfo::selected(WidgetType::SelectableLabel, true, is_chosen, &entry.notice.text));
    if is_chosen {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().selection.bg_fill);
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 3.0, ui.visuals().widgets.hovered.bg_fill.gamma_multiply(0.35));
    }
    let icon = Rect::from_min_size(rect.min, egui::vec2(rect.height(), rect.height()));
    let (symbol, color) = severity_symbol(ui, entry.notice.severity);
    list::symbol(ui, icon, symbol, color);
    let mut text = rect.with_min_x(icon.right() + 2.0);
    if rect.width() > 240.0 {
        list::line(ui, text.with_max_x(text.left() + 42.0), &clock(entry.at), ui.visuals().weak_text_color());
        text.min.x += 44.0;
    }
    let times = if entry.times > 1 { format!("{}× ", entry.times) } else { String::new() };
    // Line breaks would appear as boxes in a single line.
    let line = format!("{times}{}", entry.notice.text.replace('\n', " "));
    let cut = list::line(ui, text, &line, ui.visuals().text_color());
    if response.clicked() {
        *chosen = if is_chosen { None } else { Some(entry.number) };
    }
    if cut {
        response.on_hover_text(&entry.notice.text);
    }
}

/// Minutes and seconds, and hours once there are any.
fn clock(at: Duration) -> String {
    let seconds = at.as_secs();
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}

fn severity_name(severity: Severity) -> &'static str {
    match severity {
        Severity::Info => "info",
        Severity::Done => "done",
        Severity::Warning => "warning",
        Severity::Error => "error",
    }
}

/// The symbol and colour of a severity, the same in the log and in toasts.
pub(super) fn severity_symbol(ui: &Ui, severity: Severity) -> (&'static str, Color32) {
    let visuals = ui.visuals();
    match severity {
        Severity::Info => ("ℹ", visuals.hyperlink_color),
        Severity::Done => ("✔", style::readable(visuals, Color32::from_rgb(92, 184, 92))),
        Severity::Warning => ("⚠", visuals.warn_fg_color),
        Severity::Error => ("✖", visuals.error_fg_color),
    }
}
